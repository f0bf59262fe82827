"""Work done in threads, in processes of this machine, or by the workers of a dask cluster.

`Worker` is one process that can be killed at any moment with everything it has started. `Pool` spreads many
tasks over threads, Workers or a cluster, and yields each result as it comes; the results do not depend on
where they are computed.

Workers are started as `python -c`: nothing of the main script runs again in them, so that a plain script
needs no `if __name__ == "__main__"`. Each one leads a session of its own: Ctrl-C in the terminal reaches the
parent alone. A worker whose parent has died kills itself and what it has started.
"""

from __future__ import annotations

import io
import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from functools import partial, wraps
from importlib import import_module
from itertools import islice
from queue import Empty, SimpleQueue
from typing import IO, Any, Literal, NamedTuple, ParamSpec, Self, TypeVar, cast

from softstart import __version__
from softstart.errors import InputError, SimulationError
from softstart.stopping import AT_STOP, BEGINNING, STOPPING

P = ParamSpec("P")
T = TypeVar("T")
R = TypeVar("R")

# libraries of linear algebra spin on small matrices: several threads each take more time than one
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
ATTEMPTS = 2  # at a task whose process dies
GRACE = 0.4  # s, for a process whose pipe has closed to end by itself
LOADED_FROM_FILE = "softstart_loose_"  # modules of controllers that were loaded from a file
CLUSTER_TIMEOUT = 30.0  # s, for the scheduler to answer and for the first worker
QUEUED_ON_CLUSTER = 256  # tasks that a cluster is given at a time


def single_threaded_blas(function: Callable[P, R]) -> Callable[P, R]:
    """Make libraries of linear algebra compute on one thread while `function` runs; then as before.

    In processes whose environment is not softstart's own: see ONE_THREAD.

    >>> single_threaded_blas(sum)([3.0, 4.0])
    7.0
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        threadpoolctl: Any = import_module("threadpoolctl")
        with threadpoolctl.threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


# one process --------------------------------------------------------------------------------------------


class DiedError(RuntimeError):
    """The process ended before it answered; the text is its exit code or signal."""


class Message(NamedTuple):
    """What a process sends back.

    `content` is (share, text) of `progress`, any value of `part` and `result`, and (exception, traceback as
    text) of `error`.
    """

    kind: Literal["progress", "part", "result", "error"]
    content: Any


class Progress:
    """Given to a function that runs in a Worker, so that it can report its progress and parts of its result.

    >>> sent = []
    >>> progress = Progress(sent.append)
    >>> progress(0.25, "first point"); progress.part(7)
    >>> [message.content for message in sent]
    [(0.25, 'first point'), 7]
    """

    def __init__(self, send: Callable[[Message], object]) -> None:
        self._send = send

    def __call__(self, share: float | None, message: str = "") -> None:
        """Report the share that is done, 0 to 1 (None: unknown), and what is being done."""
        self._send(Message("progress", (share, message)))

    def part(self, value: object) -> None:
        """Report a part of the result."""
        self._send(Message("part", value))


class Worker:
    """A process that runs functions, one after another; linear algebra in it uses one thread.

    It imports `modules` when it starts, so that the first function begins at once. `niceness` lowers its
    priority; `quiet` discards what it prints. `kill` must be called.

    >>> worker = Worker()
    >>> worker.run(divmod, 17, 5)
    (3, 2)
    >>> worker.kill()
    """

    def __init__(self, modules: Sequence[str] = (), niceness: int = 0, quiet: bool = False) -> None:
        path = [str(entry) for entry in sys.path]  # the same modules are found as here
        begin = f"import sys; sys.path[:] = {path!r}; from softstart.parallel import _serve; "
        self._lock = threading.Lock()
        with BEGINNING:
            if STOPPING.is_set():
                raise DiedError("stopped")
            self._process = subprocess.Popen(
                [sys.executable, "-c", f"{begin}_serve({list(modules)!r}, {niceness})"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL if quiet else None,
                env={**os.environ, **ONE_THREAD},
                start_new_session=True,
            )
            AT_STOP.append(self.kill)
        self._messages: SimpleQueue[bytes | None] = SimpleQueue()
        threading.Thread(target=_collect, args=(self._process.stdout, self._messages), daemon=True).start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the process has not ended."""
        return self._process.poll() is None

    def submit(self, function: Callable[..., object], *args: object, reports: bool = False) -> None:
        """Start `function(*args)`, importable; with `reports` it is given a `progress`."""
        task = pickle.dumps((function, args, reports))
        assert self._process.stdin is not None
        with suppress(OSError, ValueError):  # it has died or was killed: `receive` says so
            pickle.dump(task, self._process.stdin)
            self._process.stdin.flush()

    def receive(self, timeout: float | None = None) -> Message | None:
        """The next message, or None after `timeout` seconds. Raises DiedError if the process has ended."""
        try:
            message = self._messages.get(timeout=timeout)
        except Empty:
            return None
        if message is None:
            self._messages.put(None)  # the next call raises too
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(GRACE)
            self.kill()
            code = self._process.returncode
            raise DiedError(f"signal {-code}" if code < 0 else f"exit code {code}")
        return cast("Message", pickle.loads(message))

    def run(self, function: Callable[..., R], *args: object) -> R:
        """The result of `function(*args)`. Raises what it raised, and DiedError if the process died."""
        self.submit(function, *args)
        while (message := self.receive()) is None or message.kind in ("progress", "part"):
            pass
        if message.kind == "error":
            error, text = message.content
            error.add_note(text)
            raise error
        return cast("R", message.content)

    def kill(self) -> None:
        """End the process and all that it has started, at once."""
        with self._lock:
            if self.kill in AT_STOP:
                _kill_group(self.pid)
                self._process.kill()
                self._process.wait()
                with suppress(OSError):
                    self._process.stdin.close()  # type: ignore[union-attr]
                AT_STOP.remove(self.kill)


def _collect(stream: IO[bytes], queue: SimpleQueue[bytes | None]) -> None:
    """Put what is read from a pipe into a queue, and None at its end."""
    with stream, suppress(OSError, ValueError, EOFError, pickle.UnpicklingError):
        while True:
            queue.put(pickle.load(stream))
    queue.put(None)


def _kill_group(leader: int) -> None:
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(leader, signal.SIGKILL)


def _serve(modules: Sequence[str], niceness: int) -> None:
    """The main function of a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if niceness and hasattr(os, "nice"):
        os.nice(niceness)
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)  # what a controller or a solver prints must not get between the messages
    tasks: SimpleQueue[bytes | None] = SimpleQueue()
    lock = threading.Lock()

    def listen() -> None:
        _collect(questions, tasks)
        _kill_group(os.getpid())  # the parent has died
        os._exit(1)

    def send(message: Message) -> None:
        content = pickle.dumps(message)
        with lock:
            pickle.dump(content, answers)
            answers.flush()

    threading.Thread(target=listen, daemon=True).start()
    for module in modules:
        import_module(module)
    while True:
        try:
            function, args, reports = pickle.loads(tasks.get() or b"")
            result = function(*args, progress=Progress(send)) if reports else function(*args)
            send(Message("result", result))
        except Exception as error:  # of any kind: it belongs to whoever asked
            text, failure = "".join(traceback.format_exception(error)), error
            try:
                pickle.loads(pickle.dumps(error))
            except Exception:  # a class that cannot be pickled is sent as its text
                failure = RuntimeError(f"{type(error).__name__}: {error}")
            send(Message("error", (failure, text)))


# many tasks ---------------------------------------------------------------------------------------------


def checked_workers(workers: object, scheduler: str | None = None) -> int:
    """The number of workers, by default that of the processors; InputError for anything else."""
    if scheduler is not None and workers is not None:
        raise InputError("workers, scheduler: a cluster has workers of its own; give one of the two.")
    if workers is None:
        return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
    if isinstance(workers, int) and not isinstance(workers, bool) and 1 <= workers <= 1024:
        return workers
    raise InputError(f"workers = {workers!r}: the number of processes is a whole number from 1 to 1024.")


class _ImportableOnly(pickle.Unpickler):
    """Loads only what another process can load too."""

    def find_class(self, module: str, name: str) -> object:
        if module == "__main__" or module.startswith(LOADED_FROM_FILE):
            raise ImportError(f"{name} is defined in a script")
        return super().find_class(module, name)


def reason_not_picklable(value: object) -> str:
    """Why no other process can load a value; "" if it can.

    >>> reason_not_picklable(("ramp", {"time": 0.1}))
    ''
    """
    try:
        _ImportableOnly(io.BytesIO(pickle.dumps(value))).load()
    except (pickle.PicklingError, AttributeError, TypeError, ImportError) as error:
        return " ".join(str(error).split()) or type(error).__name__
    return ""


def usable_workers(
    value: object, what: str, workers: int | None, scheduler: str | None, threads: bool = False
) -> int:
    """How many workers share work on a value; 1 if no other process can load it, and none was asked for.

    >>> usable_workers(lambda: 1, "the metric", None, None), usable_workers(abs, "the metric", 3, None)
    (1, 3)
    """
    count = checked_workers(workers, scheduler)
    if scheduler is None and (threads or count == 1):
        return count
    if reason := reason_not_picklable(value):
        if workers is None and scheduler is None:
            return 1
        given = f"workers = {workers}" if scheduler is None else "scheduler"
        raise InputError(
            f"{given}: {what} cannot be handed to another process ({reason}); define it at the top level of "
            "a module, or give workers=1."
        )
    return count


class Pool:
    """Runs tasks in `count` places at once; use it in a `with` block.

    With `threads` the places are threads of this process: right for compiled kernels, which release the
    GIL. Otherwise they are Workers, started when first needed; a task whose process dies is tried once more.
    With `scheduler`, the address of a dask scheduler, they are the workers of its cluster. A count of 1
    computes in this thread. `describe` names a task in an error message, which `advice` and `kept` end.

    At the end of the block whatever still runs is stopped: processes are killed at once; `stopping` is set,
    which long functions in threads check now and then.

    >>> with Pool(2, threads=True) as pool:
    ...     sorted(pool.results(abs, [-1, -2, 3]))
    [(-2, 2), (-1, 1), (3, 3)]
    """

    def __init__(
        self,
        count: int = 1,
        *,
        threads: bool = False,
        scheduler: str | None = None,
        describe: Callable[[Any], str] = str,
        advice: str = "take fewer workers",
        kept: str = "Finished parts are kept.",
    ) -> None:
        self.count, self.threads, self.scheduler = count, threads, scheduler
        self.describe, self.advice, self.kept = describe, advice, kept
        self.stopping = threading.Event()
        self._workers: list[Worker] = []
        self._own = threading.local()
        self._executor: Executor | None = None  # of threads, each of which may have a Worker, or of dask
        self._client: Any = None

    def __enter__(self) -> Self:
        if self.scheduler is not None:
            self._client = connect(self.scheduler)
            self._executor = self._client.get_executor()
        elif self.count > 1:
            self._executor = ThreadPoolExecutor(self.count)
        return self

    def __exit__(self, *error: object) -> None:
        self.stopping.set()
        for worker in self._workers:
            worker.kill()
        if self._client is not None:
            self._client.close()
        elif self._executor is not None:
            self._executor.shutdown(wait=True, cancel_futures=True)

    def results(self, function: Callable[[T], R], tasks: Iterable[T]) -> Generator[tuple[T, R], None, None]:
        """Each task with `function(task)`, as they are finished; tasks are taken from the iterable late."""
        if self._executor is None:
            yield from ((task, function(task)) for task in tasks)
            return
        call: Callable[[T], R] = function
        if self.scheduler is not None:
            call = partial(_same_version, __version__, function)
        elif not self.threads:
            call = partial(self._in_process, function)
        rest, most = iter(tasks), QUEUED_ON_CLUSTER if self.scheduler is not None else self.count + 1
        running: dict[Future[R], T] = {}
        while True:
            for task in islice(rest, most - len(running)):
                running[self._executor.submit(call, task)] = task
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(future), self._result(future)

    def _in_process(self, function: Callable[[T], R], task: T) -> R:
        for _ in range(ATTEMPTS):
            try:
                return self._worker().run(function, task)
            except DiedError as error:
                death = error
                if self.stopping.is_set():
                    raise
        raise SimulationError(
            f"A process died {ATTEMPTS} times ({death}) while it computed {self.describe(task)}; if the "
            f"system ended it because memory ran out, {self.advice}. {self.kept}"
        )

    def _worker(self) -> Worker:
        """The process of this thread, started when first needed and when the one before has died."""
        worker: Worker | None = getattr(self._own, "worker", None)
        if worker is None or not worker.alive:
            worker = self._own.worker = Worker()
            self._workers.append(worker)
            if self.stopping.is_set():  # the block has ended meanwhile
                worker.kill()
        return worker

    def _result(self, future: Future[R]) -> R:
        try:
            return future.result()
        except Exception as error:
            what = type(error)
            if self.scheduler is None or what.__module__.startswith("softstart"):
                raise
            if isinstance(error, ImportError):
                raise InputError(
                    f"scheduler: a worker of the cluster cannot load what it needs ({error}); install there "
                    "what is installed here."
                ) from None
            if what.__module__.startswith("distributed") or isinstance(error, OSError | CancelledError):
                text = f"The dask cluster lost a task: {what.__name__} ({_short(error)}). {self.kept}"
                raise SimulationError(text) from None
            raise


def _same_version(version: str, function: Callable[[T], R], task: T) -> R:
    """Run on a cluster, where another version of softstart would give other figures."""
    if version != __version__:
        raise InputError(
            f"softstart {version} asks and softstart {__version__} is to compute; install one version on all "
            "machines."
        )
    return function(task)


def connect(address: str) -> Any:
    """A client of a dask scheduler that has a worker. Raises InputError."""
    try:
        distributed: Any = import_module("distributed")  # optional: comes with softstart[cluster]
    except ImportError:
        install = "it comes with pip install 'softstart[cluster]'"
        raise InputError(f"scheduler: dask.distributed is not installed; {install}.") from None
    client = None
    try:
        client = distributed.Client(address, timeout=CLUSTER_TIMEOUT, set_as_default=False)
        client.wait_for_workers(1, timeout=CLUSTER_TIMEOUT)
    except (OSError, ValueError, TypeError) as error:  # of which TimeoutError is one
        reason = f'it has no worker; start some with "dask worker {address}"'
        if client is None:
            start = 'start one with "dask scheduler" and give its address, as tcp://host:8786'
            reason = f"no dask scheduler answers there ({_short(error)}); {start}"
        else:
            client.close()
        raise InputError(f'scheduler = "{address}": {reason}.') from None
    return client


def _short(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
