"""What is done when a process is ended at once, as a command by Ctrl-C or TERM."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

STOPPING = threading.Event()  # whether `stop_now` is ending this process
AT_STOP: list[Callable[[], object]] = []
BEGINNING = threading.RLock()  # held while something is made that is in AT_STOP: the end waits for it


@contextmanager
def at_stop(action: Callable[[], object], begin: Callable[[], Any] = lambda: None) -> Iterator[Any]:
    """Call `action` if the process is ended by `stop_now` during the block: remove a file, end a process.

    What `begin` makes, the value of the block, is either not made, for the end has begun, which raises
    KeyboardInterrupt, or the end comes to `action`. So too if the end has begun and the block is left before
    it comes to `action`, which must bear being called after the block.
    """
    try:
        with BEGINNING:
            if STOPPING.is_set():
                raise KeyboardInterrupt
            AT_STOP.append(action)
            begun = begin()
        yield begun
    finally:
        if not STOPPING.is_set():  # else the main thread, stopped by an error, would take it away
            AT_STOP.remove(action)


def stop_now(code: int) -> NoReturn:
    """End this process with all that it has started."""
    STOPPING.set()
    with BEGINNING:
        actions = AT_STOP[::-1]
    for action in actions:
        with suppress(Exception):
            action()
    os._exit(code)
