"""Processes that share the work; the answer is the same with one as with many."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self

from softstart.errors import InputError
from softstart.tuning.trials import Trials

Work = Callable[..., Any]

_trials: Trials | None = None  # of this worker process


def _begin(packed: bytes) -> None:
    """The question and its yardstick, once a process."""
    global _trials  # noqa: PLW0603
    question, yardstick = pickle.loads(packed)
    _trials = Trials(question, yardstick)


def _do(work: Work, arguments: tuple[Any, ...]) -> Any:
    assert _trials is not None
    return work(_trials, *arguments)


class Workers:
    """Does work in `count` processes, or in this one where `count` is 1. To be used in a `with` block."""

    def __init__(self, trials: Trials, count: int) -> None:
        self.trials = trials
        self.count = count
        self.pool: ProcessPoolExecutor | None = None
        self.others: set[Any] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self.pool is None:
            return
        if kind is not None:  # whoever waits for a Ctrl-C should not wait for the work in hand
            for child in multiprocessing.active_children():
                if child not in self.others:
                    child.terminate()
        self.pool.shutdown(wait=True, cancel_futures=True)

    def each(self, work: Work, items: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """Index and result of each item, as they are done."""
        if self.count == 1 or len(items) < 2:
            for index, item in enumerate(items):
                yield index, work(self.trials, *item)
            return
        try:
            pool = self._pool()
            with _deaf_to_interruption(), _one_thread_each():  # what is started here inherits both
                places: dict[Future[Any], int] = {
                    pool.submit(_do, work, item): index for index, item in enumerate(items)
                }
            pending = set(places)
            while pending:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                for future in sorted(done, key=places.__getitem__):
                    yield places[future], future.result()
        except BrokenProcessPool as error:
            raise InputError(
                f"workers = {self.count}: a worker process ended by itself; in a script put the call below "
                '`if __name__ == "__main__":`, or give workers=1.'
            ) from error

    def all(self, work: Work, items: Sequence[tuple[Any, ...]]) -> list[Any]:
        """The results in the order of the items."""
        found = dict(self.each(work, items))
        return [found[index] for index in range(len(items))]

    def _pool(self) -> ProcessPoolExecutor:
        if self.pool is None:
            self.others = set(multiprocessing.active_children())
            packed = pickle.dumps((self.trials.question, self.trials.yardstick))
            self.pool = ProcessPoolExecutor(
                self.count, multiprocessing.get_context("spawn"), initializer=_begin, initargs=(packed,)
            )
        return self.pool


@contextmanager
def _deaf_to_interruption() -> Iterator[None]:
    """Ctrl-C goes to all processes of a terminal; workers leave it to their parent from the beginning.

    Where the system can, it is held back, not ignored: what comes meanwhile reaches the parent afterwards.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
    elif hasattr(signal, "pthread_sigmask"):
        held = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, held)
    else:
        before = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Workers share the processors already; threads of a linear algebra library in them would only wait."""
    name = "OPENBLAS_NUM_THREADS"
    if name in os.environ:
        yield
        return
    os.environ[name] = "1"
    try:
        yield
    finally:
        del os.environ[name]


def count_of(workers: int | None, trials: Trials) -> int:
    """How many processes to use: as asked, or one a processor. InputError for what cannot be shared."""
    if workers is None:
        asked = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    elif isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise InputError(f"workers = {workers!r}: give a whole number of processes, 1 or more.")
    else:
        asked = workers
    if asked > 1:
        try:
            pickle.dumps(trials.question)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            if workers is None:
                return 1
            raise InputError(
                f"workers = {workers}: the controller or the metric cannot be handed to another process "
                f"({error}); define it at the top level of a module, or give workers=1."
            ) from None
    return asked
