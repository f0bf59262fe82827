"""Chunks computed by processes of this machine, or in this process; results come as they are finished.

The processes are started bare (`python -c`), not forked and not by multiprocessing: nothing of the asking
process is run again in them, and when one dies it is known which chunk it had.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from queue import SimpleQueue
from threading import Lock
from typing import Any

from softstart.errors import InputError, SimulationError
from softstart.sweeping.starts import Block, Task
from softstart.sweeping.worker import COMMAND, answer

Done = tuple[Task, Block | None]
Dones = Generator[Done, None, None]

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
TRIES = 2  # of a chunk whose process dies


def processors() -> int:
    """How many processors this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def checked_workers(value: object) -> int:
    """The number of processes; without one, that of the processors."""
    if value is None:
        return processors()
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= 1024:
        return value
    raise InputError(f"workers = {value!r}: the number of processes is a whole number from 1 to 1024.")


def computed_here(tasks: Iterator[Task]) -> Dones:
    """One after the other in this process."""
    for task in tasks:
        yield task, answer(task)


class DiedError(RuntimeError):
    """The process ended before it answered."""


class Process:
    """A process that computes chunks, started when first asked and anew when it died."""

    def __init__(self) -> None:
        self.child: subprocess.Popen[bytes] | None = None
        self.closed = False
        self.changing = Lock()

    def ask(self, task: Task) -> Block | None:
        """The answer to a task. Raises what the process raised, and DiedError if it died."""
        child = self._started()
        assert child.stdin is not None
        assert child.stdout is not None
        try:
            pickle.dump(task, child.stdin)
            child.stdin.flush()
            good, said = pickle.load(child.stdout)
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):  # ValueError: closed meanwhile
            code = self.end()
            raise DiedError(f"signal {-code}" if code < 0 else f"exit code {code}") from None
        if good:
            block: Block | None = said
            return block
        raise said

    def end(self) -> int:
        """End the process; its exit code, negative for a signal."""
        with self.changing:
            child, self.child = self.child, None
        if child is None:
            return 0
        child.kill()  # what it is writing it writes beside its place
        for stream in (child.stdin, child.stdout):
            if stream is not None:
                with suppress(OSError):
                    stream.close()
        return child.wait()

    def close(self) -> None:
        """End the process and start no other."""
        with self.changing:
            self.closed = True
        self.end()

    def _started(self) -> subprocess.Popen[bytes]:
        with self.changing:
            if self.closed:
                raise DiedError("closed")
            if self.child is None:
                self.child = subprocess.Popen(
                    [sys.executable, "-c", COMMAND],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    env={**os.environ, **ONE_THREAD},
                    start_new_session=True,  # Ctrl-C of the terminal goes to the asking process alone
                )
                assert self.child.stdin is not None
                pickle.dump(sys.path, self.child.stdin)
            return self.child


def computed_by_processes(tasks: Iterator[Task], count: int) -> Dones:
    """By `count` processes, each with one task at a time; a chunk whose process dies is tried once more."""
    processes = [Process() for _ in range(count)]
    free: SimpleQueue[Process] = SimpleQueue()
    for process in processes:
        free.put(process)

    def work(task: Task) -> Block | None:
        process = free.get()
        try:
            return _with_another_try(process, task)
        finally:
            free.put(process)

    with ThreadPoolExecutor(count) as threads:
        running: dict[Future[Block | None], Task] = {}
        try:
            for task in tasks:
                running[threads.submit(work, task)] = task
                if len(running) > count:
                    yield from _finished(running)
            while running:
                yield from _finished(running)
        finally:
            for future in running:
                future.cancel()
            for process in processes:
                process.close()


def _with_another_try(process: Process, task: Task) -> Block | None:
    for left in reversed(range(TRIES)):
        try:
            return process.ask(task)
        except DiedError as death:
            if process.closed:
                raise
            if not left:
                raise SimulationError(
                    f"A process died {TRIES} times ({death}) while it computed chunk {task.number} of the "
                    "sweep; if the system ended it for want of memory, take fewer workers or smaller chunks. "
                    "Finished chunks are kept."
                ) from None
    raise AssertionError("unreachable")


def _finished(running: dict[Future[Any], Task]) -> Iterator[Done]:
    """Take out those that are done, at least one."""
    done, _ = wait(running, return_when=FIRST_COMPLETED)
    for future in done:
        yield running.pop(future), future.result()
