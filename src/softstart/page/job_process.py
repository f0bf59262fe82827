"""What runs in a job's own process: one function, with a pipe back to the server."""

from __future__ import annotations

import os
import pickle
import signal
import threading
import traceback
from collections.abc import Sequence
from importlib import import_module
from multiprocessing import parent_process
from multiprocessing.connection import Connection, wait
from typing import Any, Literal, NamedTuple

from softstart.errors import InputError, SimulationError

NICENESS = 10  # the live page comes first

OUT_OF_MEMORY = "The computation needs more memory than there is; ask for fewer points or a smaller grid."


class Told(NamedTuple):
    """What a process says: how far it is, a part of its result, or how it ended.

    `content` is (share, message) of `progress`, any value of `part`, the pickled value of `result`, sentences
    of `refused`, and a traceback of `broken`.
    """

    kind: Literal["progress", "part", "result", "refused", "broken"]
    content: Any


class Tell:
    """Given to the function of a job, so that it can say how far it is.

    >>> from multiprocessing import Pipe
    >>> ours, theirs = Pipe()
    >>> tell = Tell(theirs)
    >>> tell(0.25, "first point"); tell.part(7)
    >>> ours.recv().content, ours.recv().content
    ((0.25, 'first point'), 7)
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection

    def __call__(self, share: float | None, message: str = "") -> None:
        """So much is done, from 0 to 1 (None: not known), and this is being done."""
        self.connection.send(Told("progress", (share, message)))

    def part(self, value: Any) -> None:
        """A part of the result, to be shown before the whole is there."""
        self.connection.send(Told("part", value))


def live(connection: Connection, modules: Sequence[str]) -> None:
    """The life of the process: import what works need, wait for one, do it, say what came of it.

    Imports are done here, not by multiprocessing, so that they too have low priority.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the server, which ends its processes
    if hasattr(os, "setsid"):
        os.setsid()  # what is begun from here can be ended together
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        for module in modules:
            import_module(module)
        packed = connection.recv_bytes()
        connection.send(_done(Tell(connection), packed))
    except (EOFError, ConnectionError):
        os._exit(1)  # the server has gone


def _done(tell: Tell, packed: bytes) -> Told:
    try:
        work, arguments, keywords = pickle.loads(packed)
        result = pickle.dumps(work(*arguments, tell=tell, **keywords))
    except (EOFError, ConnectionError):
        raise
    except InputError as error:
        return Told("refused", error.sentences)
    except SimulationError as error:
        return Told("refused", (str(error),))
    except MemoryError:
        return Told("refused", (OUT_OF_MEMORY,))
    except Exception:  # whatever it is, the server logs it and lives on
        return Told("broken", traceback.format_exc())
    return Told("result", result)


def _end_with_parent() -> None:
    """No server, no work: also where the server was killed and could not end its processes."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        if hasattr(os, "killpg"):
            os.killpg(0, signal.SIGKILL)
        os._exit(1)
