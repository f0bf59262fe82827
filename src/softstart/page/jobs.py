"""Long computations in processes of their own: a queue, progress, and a cancel that stops."""

from __future__ import annotations

import logging
import pickle
import threading
import time
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from enum import Enum
from typing import Any

from softstart.drive.machine import Machine
from softstart.errors import InputError, SimulationError
from softstart.parallel import DiedError, Message, Progress, Worker, checked_workers

NICENESS = 10  # the live page comes first
OUT_OF_MEMORY = "Not enough memory for this computation; ask for fewer points or a smaller grid."
DIED = "The computation was killed ({}), perhaps for lack of memory; start it again or ask for less."
MISTAKE = "Internal error in softstart, not caused by your input; details are in the log of the server."

log = logging.getLogger("softstart.page")


class JobState(Enum):
    """Where a job is; the values are the sentences shown."""

    WAITING = "Queued."
    RUNNING = "Computing."
    DONE = "Done."
    CANCELLED = "Cancelled."
    FAILED = "Not computed."

    @property
    def over(self) -> bool:
        """Whether nothing more will come."""
        return self not in {JobState.WAITING, JobState.RUNNING}


class Job:
    """A function that runs, ran or will run in a process of its own. Made by `Jobs.begin`.

    `share` is how much is done, 0 to 1, or None where that is not known; `message` what is being done;
    `result` what came out; `sentences` why there is no result.
    `state` is set last. `machine` is for those who show it: that of the result; so is `estimate`, in s.
    """

    def __init__(self, user: Hashable, title: str, packed: bytes, ahead: Callable[[Job], int]) -> None:
        self.user, self.title, self._packed, self._ahead = user, title, packed, ahead
        self.state = JobState.WAITING
        self.share: float | None = None
        self.message = ""
        self.result: Any = None
        self.sentences: tuple[str, ...] = ()
        self.machine: Machine | None = None
        self.estimate = 1.0
        self.pid: int | None = None
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._worker: Worker | None = None
        self._began = self._ended = 0.0

    @property
    def stopping(self) -> bool:
        """Whether it was cancelled and its process is being ended."""
        return self._stop.is_set() and not self.state.over

    @property
    def ahead(self) -> int:
        """How many waiting jobs come before this one."""
        return self._ahead(self)

    @property
    def seconds(self) -> float:
        """Time since its process was started, or that its process took."""
        return (self._ended or time.monotonic()) - self._began if self._began else 0.0

    def cancel(self) -> None:
        """Stop it; its process is gone within a second. Does nothing to a job that is over."""
        with self._lock:
            self._stop.set()
            if self._worker is not None:
                self._worker.kill()
            elif not self.state.over:
                self._conclude(JobState.CANCELLED)

    def run(self, start: Callable[[], Worker]) -> None:
        """Run it in a process and listen to that, unless it was cancelled; the process is ended."""
        sentences: tuple[str, ...] = (MISTAKE,)
        state = JobState.FAILED
        try:
            with self._lock:
                if self.state.over:
                    return
                self._worker = start()
                self.pid, self._began, self.state = self._worker.pid, time.monotonic(), JobState.RUNNING
            state, sentences = self._heard(self._worker)
        except Exception:
            log.exception("The process of %r was lost.", self.title)
        finally:
            if self._worker is not None:
                self._worker.kill()
        self._conclude(state, *sentences)

    def _heard(self, worker: Worker) -> tuple[JobState, tuple[str, ...]]:
        worker.submit(_unpacked, self._packed, reports=True)
        try:
            while message := worker.receive():
                match message:
                    case Message("progress", (share, text)):
                        self.share, self.message = share, text
                    case Message("result", result):
                        self.result, self.share = result, 1.0
                        break
                    case Message("error", (InputError() as error, _)):
                        return JobState.FAILED, error.sentences
                    case Message("error", (SimulationError() as error, _)):
                        return JobState.FAILED, (str(error),)
                    case Message("error", (MemoryError(), _)):
                        return JobState.FAILED, (OUT_OF_MEMORY,)
                    case Message("error", (_, text)):
                        log.error("In the process of %r:\n%s", self.title, text)
                        return JobState.FAILED, (MISTAKE,)
        except DiedError as death:
            if self._stop.is_set():
                return JobState.CANCELLED, ()
            return JobState.FAILED, (DIED.format(death),)
        return JobState.DONE, ()

    def _conclude(self, state: JobState, *sentences: str) -> None:
        self._ended = time.monotonic() if self._began else 0.0
        self.sentences, self.state = sentences, state


class Jobs:
    """Runs at most `limit` jobs at once, the others in the order in which they were begun.

    By default two jobs at once, more where there are more than three processors. `end` must be called when
    the server ends; processes whose server was killed end by themselves. `modules` are imported by each
    process before it is given work: with `warm` that is done before anybody waits for it.
    """

    def __init__(self, limit: int | None = None, modules: Sequence[str] = ()) -> None:
        self.modules = modules
        self._spare: Worker | None = None
        self._lock = threading.Lock()
        self._jobs: list[Job] = []  # that are not over
        self._tabs: dict[Hashable, set[Hashable]] = {}
        self._shown: dict[tuple[Hashable, str], Job] = {}
        self._threads = ThreadPoolExecutor(limit or max(2, checked_workers(None) - 1))
        self._ended = False

    def begin(self, user: Hashable, title: str, work: Callable[..., Any], *args: Any) -> Job:
        """Put `work(*args, progress=...)` into the queue.

        The function must be importable, its arguments and its result picklable; `progress` is a
        `softstart.parallel.Progress`. Raises InputError if the server is ending.
        """
        job = Job(user, title, pickle.dumps((work, args)), self._ahead)
        with self._lock:
            if self._ended:
                raise InputError("The server is ending and starts no computation.")
            self._jobs.append(job)
            self._threads.submit(self._attend, job)
        return job

    def show(self, user: Hashable, place: str, job: Job | None) -> None:
        """Let all tabs of a user show this job at this place, or none."""
        with self._lock:
            if job is None:
                self._shown.pop((user, place), None)
            else:
                self._shown[user, place] = job

    def shown(self, user: Hashable, place: str) -> Job | None:
        """The job that all tabs of a user show at this place."""
        return self._shown.get((user, place))

    def enter(self, user: Hashable, tab: Hashable) -> None:
        """A user has opened a tab."""
        self._tabs.setdefault(user, set()).add(tab)

    def leave(self, user: Hashable, tab: Hashable = None) -> None:
        """A tab was closed; with the last one of a user all that is computed for them is cancelled."""
        with self._lock:
            tabs = self._tabs.get(user, set())
            tabs.discard(tab)
            if tabs:
                return
            self._tabs.pop(user, None)
            self._shown = {key: job for key, job in self._shown.items() if key[0] != user}
            mine = [job for job in self._jobs if job.user == user]
        for job in mine:
            job.cancel()

    def warm(self) -> None:
        """Have a process wait for the next job, so that it begins at once."""
        with self._lock:
            if self._spare is None and not self._ended:
                self._spare = Worker(self.modules, NICENESS)

    def end(self) -> None:
        """Cancel everything, and wait until no process is left. Nothing can be begun afterwards."""
        with self._lock:
            self._ended = True
            jobs, spare = list(self._jobs), self._spare
        for job in jobs:
            job.cancel()
        if spare is not None:
            spare.kill()
        self._threads.shutdown()

    def _ahead(self, job: Job) -> int:
        waiting = [job for job in self._jobs if job.state is JobState.WAITING]
        return waiting.index(job) if job in waiting else 0

    def _attend(self, job: Job) -> None:
        """Run a job, in the process that waits or a new one: the work of one thread."""
        job.run(self._worker)
        with self._lock:
            self._jobs.remove(job)
        with suppress(OSError):  # no process can be started now; the next job finds one, or says so
            self.warm()

    def _worker(self) -> Worker:
        with self._lock:
            spare, self._spare = self._spare, None
        if spare is not None:
            if spare.alive:
                return spare
            spare.kill()
        return Worker(self.modules, NICENESS)


def _unpacked(packed: bytes, *, progress: Progress) -> Any:
    """What a job's process does."""
    work, args = pickle.loads(packed)
    return work(*args, progress=progress)
