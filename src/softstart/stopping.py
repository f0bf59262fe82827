"""What is done when a process is ended at once, as a command by Ctrl-C or TERM."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn

STOPPING = threading.Event()  # whether `stop_now` is ending this process
AT_STOP: list[Callable[[], object]] = []


@contextmanager
def at_stop(action: Callable[[], object]) -> Iterator[None]:
    """Call `action` if the process is ended by `stop_now` during the block: remove a file, end a process.

    So too if the end has begun and the block is left before it comes to `action`, which must bear being
    called after the block.
    """
    AT_STOP.append(action)
    try:
        yield
    finally:
        if not STOPPING.is_set():  # else the main thread, stopped by an error, would take it away
            AT_STOP.remove(action)


def stop_now(code: int) -> NoReturn:
    """End this process with all that it has started."""
    STOPPING.set()
    for action in AT_STOP[::-1]:
        with suppress(Exception):
            action()
    os._exit(code)
