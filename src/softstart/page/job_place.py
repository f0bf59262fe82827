"""The process of one job, as the server holds it: begun aside, ended with all that it has begun itself."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import wait

from softstart.page.job_process import live

GRACE = 0.4  # s from asking a process to end to ending it

_environment = threading.Lock()


class Place:
    """A process that waits for its one work, and the pipe to it. Made in a thread beside the main one."""

    def __init__(self, modules: Sequence[str] = ()) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=live, args=(theirs, tuple(modules)), daemon=True)
        with _inherited():
            self.process.start()
        theirs.close()

    def how_it_ended(self) -> str:
        """Exit code or signal of a process that has ended."""
        self.process.join(GRACE)
        code = self.process.exitcode
        return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"

    def leave(self) -> None:
        """End the process and those it has begun, whatever they do; they are gone when this returns."""
        self.connection.close()
        if self.process.exitcode is None:
            self.process.terminate()
            wait([self.process.sentinel], GRACE)  # not joined: its number must stay its own until here
            self._kill_group()
            self.process.kill()
        self.process.join()
        self.process.close()

    def _kill_group(self) -> None:
        """The process leads a group, in which all are that it has begun."""
        if hasattr(os, "killpg") and self.process.pid is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self.process.pid, signal.SIGKILL)


@contextmanager
def _inherited() -> Iterator[None]:
    """What a process started here inherits: Ctrl-C held back, linear algebra in one thread.

    The signal is held back in this thread alone, which does not take signals anyway; a process is born deaf
    to it and stays so until it ignores it itself.
    """
    name = "OPENBLAS_NUM_THREADS"
    with _environment:
        before = os.environ.get(name)
        os.environ[name] = "1"
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            if before is None:
                del os.environ[name]
            else:
                os.environ[name] = before
