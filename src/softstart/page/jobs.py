"""Long computations in processes of their own: a fair queue, progress, and a cancel that stops."""

from __future__ import annotations

import itertools
import logging
import os
import pickle
import threading
import time
from collections.abc import Callable, Hashable, Sequence
from enum import Enum
from typing import Any

from softstart.errors import InputError, SimulationError
from softstart.processes import DiedError, Progress, Worker

NICENESS = 10  # the live page comes first
STOP_CHECK = 0.1  # s between two checks whether a job is to stop
MOST_WAITING = 8  # jobs of one user

OUT_OF_MEMORY = "The computation needs more memory than there is; ask for fewer points or a smaller grid."
MISTAKE = (
    "There is a mistake in softstart, and this could not be computed; the log of the server "
    "says more. Everything else goes on."
)

log = logging.getLogger("softstart.page")


class State(Enum):
    """Where a job is; the values are the sentences shown."""

    WAITING = "Waiting for its turn."
    RUNNING = "Computing."
    DONE = "Done."
    CANCELLED = "Cancelled."
    FAILED = "Not computed."

    @property
    def over(self) -> bool:
        """Whether nothing more will come."""
        return self not in {State.WAITING, State.RUNNING}


class Job:
    """A function that runs, ran or will run in a process of its own. Made by `Jobs.begin`.

    `share` is how much is done, 0 to 1, or None where that is not known; `message` what is being done;
    `parts` what came out so far; `result` what came out at the end; `sentences` why there is no result.
    `changes` counts what happened, so that whoever looks now and then sees whether to look closer.
    `subject` is for those who show it: what the result is of.
    """

    def __init__(self, jobs: Jobs, user: Hashable, title: str, packed: bytes) -> None:
        self.user = user
        self.title = title
        self.state = State.WAITING
        self.share: float | None = None
        self.message = ""
        self.parts: list[Any] = []
        self.result: Any = None
        self.sentences: tuple[str, ...] = ()
        self.changes = 0
        self.pid: int | None = None
        self.subject: Any = None
        self._jobs = jobs
        self._packed = packed
        self._stop = threading.Event()
        self._over = threading.Event()
        self._began = self._ended = 0.0

    @property
    def error(self) -> str:
        """Why there is no result, one sentence a line; empty where there is one, or may come."""
        return "\n".join(self.sentences)

    @property
    def stopping(self) -> bool:
        """Whether it was cancelled and its process is being ended."""
        return self._stop.is_set() and not self.state.over

    @property
    def ahead(self) -> int:
        """How many waiting jobs come before this one; 0 for one that does not wait."""
        return self._jobs.ahead(self)

    @property
    def seconds(self) -> float:
        """Time since its process was started, or that its process took."""
        if not self._began:
            return 0.0
        return (self._ended or time.monotonic()) - self._began

    def cancel(self) -> None:
        """Stop it; its process is gone within a second. Does nothing to a job that is over."""
        self._stop.set()
        self._jobs.withdraw(self)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is over; False if that takes longer than `timeout` seconds."""
        return self._over.wait(timeout)


class Jobs:
    """Runs at most `limit` jobs at once, and those of one user one after another.

    Whose last job began longest ago is served next, so that nobody waits for another one's long queue. By
    default two jobs at once, more where there are more than three processors. `end` must be called when the
    server ends; processes whose server was killed end by themselves. `modules` are imported by each process
    before it is given work: with `warm` that is done before anybody waits for it.
    """

    def __init__(self, limit: int | None = None, modules: Sequence[str] = ()) -> None:
        self.limit = limit or max(2, (os.cpu_count() or 1) - 1)
        self.modules = modules
        self._spare: Worker | None = None
        self._warming = False
        self._lock = threading.RLock()
        self._waiting: list[Job] = []
        self._running: dict[Job, threading.Thread] = {}
        self._served: dict[Hashable, int] = {}
        self._tabs: dict[Hashable, set[Hashable]] = {}
        self._shown: dict[tuple[Hashable, str], Job] = {}
        self._turns = itertools.count(1)
        self._ended = False

    def begin(self, user: Hashable, title: str, work: Callable[..., Any], *args: Any, **keywords: Any) -> Job:
        """Put `work(*args, progress=..., **keywords)` into the queue of `user`.

        The function must be importable, its arguments and its result picklable; `progress` is a
        `softstart.processes.Progress`. Raises InputError if too many jobs of this user wait already.
        """
        job = Job(self, user, title, pickle.dumps((work, args, keywords)))
        with self._lock:
            if self._ended:
                raise InputError("The server is ending; nothing new is begun.")
            if sum(one.user == user for one in self._waiting) >= MOST_WAITING:
                raise InputError(
                    f"{MOST_WAITING} computations of yours are waiting already; cancel one, or wait for it."
                )
            self._waiting.append(job)
            self._advance()
        return job

    def of(self, user: Hashable) -> list[Job]:
        """The jobs of a user that are not over, the running one first."""
        with self._lock:
            return [job for job in (*self._running, *self._waiting) if job.user == user]

    def ahead(self, job: Job) -> int:
        """How many waiting jobs come before this one."""
        with self._lock:
            order = self._order()
            return order.index(job) if job in order else 0

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
        with self._lock:
            self._tabs.setdefault(user, set()).add(tab)

    def leave(self, user: Hashable, tab: Hashable = None) -> None:
        """A tab was closed; with the last one of a user all that is computed for them is cancelled."""
        with self._lock:
            tabs = self._tabs.get(user, set())
            tabs.discard(tab)
            if tabs:
                return
            for job in self.of(user):
                job.cancel()
            self._served.pop(user, None)
            self._tabs.pop(user, None)
            for key in [one for one in self._shown if one[0] == user]:
                del self._shown[key]

    def end(self, timeout: float = 5.0) -> None:
        """Cancel everything, and wait until no process is left. Nothing can be begun afterwards."""
        with self._lock:
            self._ended = True
            spare, self._spare = self._spare, None
            threads = list(self._running.values())
            for job in (*self._waiting, *self._running):
                job.cancel()
        if spare is not None:
            spare.end()
        latest = time.monotonic() + timeout
        for thread in threads:
            thread.join(max(0.0, latest - time.monotonic()))

    def withdraw(self, job: Job) -> None:
        """Take a cancelled job out of the queue, if it waits there."""
        with self._lock:
            if job in self._waiting:
                self._waiting.remove(job)
                _conclude(job, State.CANCELLED)
            elif not job.state.over:
                job.changes += 1

    # the queue -----------------------------------------------------------------------------------------

    def _order(self) -> list[Job]:
        """Waiting jobs in the order in which they would be served: turn by turn, one of each user."""
        rank: dict[Hashable, int] = {}
        keys = []
        for place, job in enumerate(self._waiting):
            turn = rank[job.user] = rank.get(job.user, -1) + 1
            keys.append((turn, self._served.get(job.user, 0), place, job))
        return [job for *_, job in sorted(keys, key=lambda key: key[:3])]

    def _advance(self) -> None:
        """Start what may be started now. Called with the lock held."""
        for job in self._order():
            busy = {one.user for one in self._running}
            if self._ended or len(self._running) >= self.limit:
                return
            if job.user in busy:
                continue
            self._waiting.remove(job)
            self._served[job.user] = next(self._turns)
            job.state, job._began = State.RUNNING, time.monotonic()
            job.changes += 1
            thread = threading.Thread(target=self._attend, args=(job,), name=f"job {job.title}", daemon=True)
            self._running[job] = thread
            thread.start()

    # one job -------------------------------------------------------------------------------------------

    def _attend(self, job: Job) -> None:
        """Run a job in a process, listen to it, and end the process: the work of one thread."""
        state = State.FAILED
        sentences: tuple[str, ...] = (MISTAKE,)
        try:
            worker = self._worker()
            try:
                job.pid = worker.pid
                worker.submit(_run, job._packed, reports=True)
                state, sentences = _listen(job, worker)
            finally:
                worker.end()
        except Exception:  # a thread that died would keep its turn in the queue indefinitely
            log.exception("The process of %r could not be attended.", job.title)
        with self._lock:
            del self._running[job]
            _conclude(job, state, sentences)
            self._advance()
        self.warm()

    def warm(self) -> None:
        """Have a process wait for the next job, so that it begins at once. Returns before it is ready."""
        with self._lock:
            if self._ended or self._spare is not None or self._waiting or self._warming:
                return
            self._warming = True
        threading.Thread(target=self._warm, daemon=True).start()

    def _warm(self) -> None:
        worker: Worker | None = None
        try:
            worker = self._started()
        except OSError:  # no process to be had now: a job will say so, or find one
            log.exception("No process could be made ready.")
        with self._lock:
            self._warming = False
            if self._ended and worker is not None:
                worker.end()
            else:
                self._spare = worker

    def _worker(self) -> Worker:
        """The process that waits, or a new one."""
        with self._lock:
            spare, self._spare = self._spare, None
        if spare is not None:
            if spare.alive:
                return spare
            spare.end()
        return self._started()

    def _started(self) -> Worker:
        return Worker(self.modules, NICENESS)


def _run(packed: bytes, *, progress: Progress) -> Any:
    """What a job's process does."""
    work, arguments, keywords = pickle.loads(packed)
    return work(*arguments, progress=progress, **keywords)


def _conclude(job: Job, state: State, sentences: tuple[str, ...] = ()) -> None:
    job._ended = time.monotonic() if job._began else 0.0
    job._packed = b""
    job.sentences, job.state = sentences, state
    job.changes += 1
    job._over.set()


def _listen(job: Job, worker: Worker) -> tuple[State, tuple[str, ...]]:
    """Take in what the process sends until it has ended or is to stop."""
    while not job._stop.is_set():
        try:
            message = worker.receive(STOP_CHECK)
        except DiedError as death:
            return State.FAILED, (
                f"The process of this computation was ended from outside ({death}), perhaps because memory "
                "ran out; start it again, or ask for less.",
            )
        if message is None:
            continue
        if message.kind == "progress":
            job.share, job.message = message.content
        elif message.kind == "part":
            job.parts.append(message.content)
        elif message.kind == "result":
            job.result, job.share = message.content, 1.0
            return State.DONE, ()
        else:
            return State.FAILED, _sentences(job, *message.content)
        job.changes += 1
    return State.CANCELLED, ()


def _sentences(job: Job, error: Exception, text: str) -> tuple[str, ...]:
    """What a user is told of an exception."""
    if isinstance(error, InputError):
        return tuple(error.sentences)
    if isinstance(error, SimulationError):
        return (str(error),)
    if isinstance(error, MemoryError):
        return (OUT_OF_MEMORY,)
    log.error("In the process of %r:\n%s", job.title, text)
    return (MISTAKE,)
