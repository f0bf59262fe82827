"""Work done aside: in threads, in processes of this machine, or by the workers of a dask cluster.

`Worker` is one process that runs functions one after another, reports how far each is, and can be ended at
any moment with everything it has started. `Pool` spreads many tasks over threads, Workers or a cluster, and
yields each result as soon as it is there; the results do not depend on where they are computed.

Worker processes are started as `python -c`: nothing of the main script runs again in them, so that a plain
script needs no `if __name__ == "__main__"`. Each one leads a session of its own: Ctrl-C in the terminal
reaches the parent alone. A worker whose parent has died kills itself and its own children.
"""

from __future__ import annotations

import io
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import time
import traceback
import uuid
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from functools import partial, wraps
from importlib import import_module
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import IO, Any, Literal, NamedTuple, NoReturn, ParamSpec, Self, TypeVar

from softstart import __version__
from softstart.errors import InputError, SimulationError
from softstart.late import late

P = ParamSpec("P")
T = TypeVar("T")
R = TypeVar("R")

threadpoolctl = late("threadpoolctl")

# libraries of linear algebra spin on small matrices: several threads each take more time than one
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
ATTEMPTS = 2  # at a task whose process dies
GRACE = 0.4  # s, for a process whose pipe has closed to end by itself
LOADED_FROM_FILE = "softstart_loose_"  # modules of controllers that were loaded from a file

CLUSTER_TIMEOUT = 30.0  # s, for the scheduler to answer and for the first worker
ALONE = 300.0  # s, that a computation waits for new workers when all are lost
CLUSTER_CHECK = 2.0  # s, between two checks of the cluster
AHEAD = 2  # tasks under way for each thread of the cluster


def on_one_thread(function: Callable[P, R]) -> Callable[P, R]:
    """Make libraries of linear algebra compute on one thread while `function` runs; then as before.

    In processes whose environment is not softstart's own: see ONE_THREAD.

    >>> on_one_thread(sum)([3.0, 4.0])
    7.0
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        with threadpoolctl.threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


# what must not be left behind ----------------------------------------------------------------------------

_UNDO: list[Callable[[], object]] = []


@contextmanager
def undone(action: Callable[[], object]) -> Iterator[None]:
    """Call `action` at the end of the block, also if the process ends by `end_now` before.

    >>> with undone(lambda: print("removed")):
    ...     print("there")
    there
    removed
    """
    _UNDO.append(action)
    try:
        yield
    finally:
        _UNDO.remove(action)
        action()


def end_now(code: int) -> NoReturn:
    """End this process with all that it has started, whatever its threads are doing."""
    for action in reversed(_UNDO):
        with suppress(Exception):
            action()
    for worker in tuple(_WORKERS):
        _kill_group(worker)
        with suppress(OSError):
            os.waitpid(worker, 0)
    os._exit(code)


# one process --------------------------------------------------------------------------------------------


_WORKERS: set[int] = set()  # processes that lead a group and have not been ended


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

    def part(self, value: Any) -> None:
        """Report a part of the result."""
        self._send(Message("part", value))


class Worker:
    """A process that runs functions, one at a time; linear algebra in it uses one thread.

    It imports `modules` when it starts, so that the first function begins at once. `niceness` lowers its
    priority; `quiet` discards what it prints. `end` must be called.

    >>> worker = Worker()
    >>> worker.run(divmod, 17, 5)
    (3, 2)
    >>> worker.end()
    """

    def __init__(self, modules: Sequence[str] = (), niceness: int = 0, quiet: bool = False) -> None:
        path = [str(entry) for entry in sys.path]  # the same modules are found as here
        begin = f"import sys; sys.path[:] = {path!r}; from softstart.processes import _serve; "
        self._process = subprocess.Popen(
            [sys.executable, "-c", f"{begin}_serve({list(modules)!r}, {niceness})"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL if quiet else None,
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,
        )
        _WORKERS.add(self._process.pid)
        self._lock, self._over = threading.Lock(), False
        self._frames: SimpleQueue[bytes | None] = SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the process has not ended."""
        return self._process.poll() is None

    def submit(
        self, function: Callable[..., Any], *args: Any, reports: bool = False, **keywords: Any
    ) -> None:
        """Start `function(*args, **keywords)`, importable; with `reports` it is given a `progress`."""
        frame = pickle.dumps((function, args, keywords, reports))
        assert self._process.stdin is not None
        with suppress(OSError, ValueError):  # it has died or was ended: `receive` says so
            _write_frame(self._process.stdin, frame)

    def receive(self, timeout: float | None = None) -> Message | None:
        """The next message, or None after `timeout` seconds. Raises DiedError if the process has ended."""
        try:
            frame = self._frames.get(timeout=timeout)
        except Empty:
            return None
        if frame is None:
            self._frames.put(None)  # the next call raises too
            code = self._ended(GRACE)
            raise DiedError(f"signal {-code}" if code < 0 else f"exit code {code}")
        return Message(*pickle.loads(frame))

    def run(self, function: Callable[..., R], *args: Any) -> R:
        """The result of `function(*args)`. Raises what it raised, and DiedError if the process died."""
        self.submit(function, *args)
        while True:
            message = self.receive()
            assert message is not None
            if message.kind == "result":
                result: R = message.content
                return result
            if message.kind == "error":
                error, text = message.content
                error.add_note(text)
                raise error

    def end(self) -> None:
        """End the process and all that it has started, at once."""
        self._ended(0.0)

    def _ended(self, grace: float) -> int:
        """End the process after `grace` seconds; its exit code, negative for a signal."""
        with self._lock:
            process = self._process
            if not self._over:
                self._over = True
                if process.stdin is not None:
                    with suppress(OSError):
                        process.stdin.close()
                with suppress(subprocess.TimeoutExpired):
                    if grace:
                        process.wait(grace)
                _kill_group(process.pid)
                process.kill()
                process.wait()
                _WORKERS.discard(process.pid)
        self._reader.join(GRACE)
        return process.returncode

    def _read(self) -> None:
        """Collect what the process sends, in a thread, until it ends."""
        assert self._process.stdout is not None
        with self._process.stdout as stream:
            for frame in _frames(stream):
                self._frames.put(frame)
        self._frames.put(None)


def _kill_group(leader: int) -> None:
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(leader, signal.SIGKILL)


def _write_frame(stream: IO[bytes], frame: bytes) -> None:
    stream.write(struct.pack("!Q", len(frame)) + frame)
    stream.flush()


def _frames(stream: IO[bytes]) -> Iterator[bytes]:
    """The frames of a stream until its end; a frame that was cut off is dropped."""
    with suppress(OSError, ValueError):
        while len(head := stream.read(8)) == 8:
            (size,) = struct.unpack("!Q", head)
            frame = stream.read(size)
            if len(frame) < size:
                return
            yield frame


def _serve(modules: Sequence[str], niceness: int) -> None:
    """The main function of a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if niceness and hasattr(os, "nice"):
        os.nice(niceness)
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)  # what a controller or a solver prints must not get between the messages
    frames: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(questions, frames), daemon=True).start()
    lock = threading.Lock()

    def send(message: Message) -> None:
        frame = pickle.dumps(tuple(message))
        with lock:
            _write_frame(answers, frame)

    try:
        for module in modules:
            import_module(module)
        while True:
            _answer(frames.get(), send)
    except OSError:
        _leave()


def _listen(questions: IO[bytes], frames: SimpleQueue[bytes]) -> None:
    for frame in _frames(questions):
        frames.put(frame)
    _leave()  # the parent has ended, or wants this process to


def _leave() -> None:
    if hasattr(os, "getpgrp") and os.getpgrp() == os.getpid():
        _kill_group(os.getpid())
    os._exit(1)


def _answer(frame: bytes, send: Callable[[Message], None]) -> None:
    """Run one function and send its result, or what it raised."""
    try:
        function, args, keywords, reports = pickle.loads(frame)
        if reports:
            keywords = {**keywords, "progress": Progress(send)}
        send(Message("result", function(*args, **keywords)))
    except Exception as error:  # of any kind: it belongs to whoever asked
        text = "".join(traceback.format_exception(error))
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # a class that cannot be pickled is sent as its text
            error = RuntimeError(f"{type(error).__name__}: {error}")
        send(Message("error", (error, text)))


# many tasks ---------------------------------------------------------------------------------------------


def processors() -> int:
    """How many processors this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def checked_workers(workers: object, scheduler: str | None = None) -> int:
    """The number of workers, by default that of the processors; InputError for anything else."""
    if scheduler is not None and workers is not None:
        raise InputError("workers, scheduler: a cluster has workers of its own; give one of the two.")
    if workers is None:
        return processors()
    if isinstance(workers, int) and not isinstance(workers, bool) and 1 <= workers <= 1024:
        return workers
    raise InputError(f"workers = {workers!r}: the number of processes is a whole number from 1 to 1024.")


class _Elsewhere(pickle.Unpickler):
    """Loads only what another process can load too."""

    def find_class(self, module: str, name: str) -> Any:
        if module == "__main__" or module.startswith(LOADED_FROM_FILE):
            raise ImportError(f"{name} is defined in a script")
        return super().find_class(module, name)


def why_not_sendable(value: object) -> str:
    """Why no other process can load a value; "" if it can.

    >>> why_not_sendable(("ramp", {"time": 0.1}))
    ''
    """
    try:
        _Elsewhere(io.BytesIO(pickle.dumps(value))).load()
    except (pickle.PicklingError, AttributeError, TypeError, ImportError) as error:
        return " ".join(str(error).split()) or type(error).__name__
    return ""


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
        self._lock = threading.Lock()
        self._workers: set[Worker] = set()
        self._free: SimpleQueue[Worker | None] = SimpleQueue()
        for _ in range(count):
            self._free.put(None)
        self._executor: ThreadPoolExecutor | None = None
        self._client: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def alone(self) -> bool:
        """Whether all is computed in the calling thread."""
        return self.count == 1 and self.scheduler is None

    def close(self) -> None:
        """End all processes and threads; nothing can be computed afterwards."""
        self.stopping.set()
        with self._lock:
            workers = list(self._workers)
            self._workers.clear()
        for worker in workers:
            worker.end()
        if self._executor is not None:
            self._executor.shutdown(wait=True, cancel_futures=True)
        if self._client is not None:
            self._client.close()
            self._client = None

    def results(self, function: Callable[[T], R], tasks: Iterable[T]) -> Generator[tuple[T, R], None, None]:
        """Each task with `function(task)`, as they are finished; tasks are taken from the iterable late."""
        if self.scheduler is not None:
            return self._on_cluster(function, iter(tasks))
        if self.count == 1:
            return ((task, function(task)) for task in tasks)
        call = function if self.threads else partial(self._in_process, function)
        return self._in_threads(call, tasks)

    def _in_threads(self, call: Callable[[T], R], tasks: Iterable[T]) -> Generator[tuple[T, R], None, None]:
        if self._executor is None:
            self._executor = ThreadPoolExecutor(self.count)
        running: dict[Future[R], T] = {}
        for task in tasks:
            running[self._executor.submit(call, task)] = task
            if len(running) > self.count:
                yield from _finished(running)
        while running:
            yield from _finished(running)

    def _in_process(self, function: Callable[[T], R], task: T) -> R:
        worker = self._free.get()
        try:
            for attempt in range(1, ATTEMPTS + 1):
                worker = worker or self._started()
                try:
                    return worker.run(function, task)
                except DiedError as death:
                    worker.end()
                    with self._lock:
                        self._workers.discard(worker)
                    worker = None
                    if self.stopping.is_set():
                        raise
                    if attempt == ATTEMPTS:
                        raise SimulationError(
                            f"A process died {ATTEMPTS} times ({death}) while it computed "
                            f"{self.describe(task)}; if the system ended it for want of memory, "
                            f"{self.advice}. {self.kept}"
                        ) from None
            raise AssertionError("unreachable")
        finally:
            self._free.put(worker)

    def _started(self) -> Worker:
        with self._lock:
            if self.stopping.is_set():
                raise DiedError("closed")
            worker = Worker()
            self._workers.add(worker)
            return worker

    # a cluster ------------------------------------------------------------------------------------------

    def _on_cluster(
        self, function: Callable[[T], R], tasks: Iterator[T]
    ) -> Generator[tuple[T, R], None, None]:
        """A bounded number of tasks is under way; those of a worker that is lost go to another one."""
        assert self.scheduler is not None
        if self._client is None:
            self._client = connect(self.scheduler)
        client = self._client
        answers: SimpleQueue[Any] = SimpleQueue()
        running: dict[Any, T] = {}
        run, number = uuid.uuid4().hex, 0  # so that the cluster takes them for nobody else's tasks
        checked, room, alone = 0.0, 0, 0.0
        more = True
        while more or running:
            now = time.monotonic()
            if now - checked > CLUSTER_CHECK:
                threads = self._cluster_threads(client)
                room = AHEAD * max(1, threads) + 1
                alone = 0.0 if threads else alone + now - checked if checked else 0.0
                checked = now
                if alone > ALONE:
                    raise SimulationError(
                        f"All workers of the dask cluster are gone since {ALONE:.0f} s. {self.kept}"
                    )
            while more and len(running) < room:
                try:
                    task = next(tasks)
                except StopIteration:
                    more = False
                    break
                call = partial(_same_version, __version__, function)
                future = client.submit(call, task, key=f"softstart-{run}-{number}")
                number += 1
                running[future] = task
                future.add_done_callback(answers.put)
            try:
                future = answers.get(timeout=CLUSTER_CHECK)
            except Empty:
                continue
            yield running.pop(future), self._cluster_result(future)

    def _cluster_threads(self, client: Any) -> int:
        try:
            return sum(client.ncores().values())
        except (OSError, TimeoutError, RuntimeError, ValueError) as error:
            raise self._lost(error) from None

    def _cluster_result(self, future: Any) -> Any:
        distributed = import_module("distributed")
        try:
            return future.result()
        except distributed.KilledWorker as error:
            raise SimulationError(
                f"Several workers of the dask cluster died with the same task ({_short(error)}). {self.kept}"
            ) from None
        except ImportError as error:
            raise InputError(
                f"scheduler: a worker of the cluster cannot load what it needs ({error}); install there what "
                "is installed here."
            ) from None
        except (distributed.CancelledError, OSError, TimeoutError) as error:
            raise self._lost(error) from None

    def _lost(self, error: BaseException) -> SimulationError:
        return SimulationError(f"The dask scheduler was lost ({_short(error)}). {self.kept}")


def _finished(running: dict[Future[R], T]) -> Iterator[tuple[T, R]]:
    """Take out those that are done, at least one."""
    done, _ = wait(running, return_when=FIRST_COMPLETED)
    for future in done:
        yield running.pop(future), future.result()


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
        distributed = import_module("distributed")  # optional: comes with softstart[cluster]
    except ImportError:
        raise InputError(
            "scheduler: dask.distributed is not installed; it comes with pip install 'softstart[cluster]'."
        ) from None
    try:
        client = distributed.Client(address, timeout=CLUSTER_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f'scheduler = "{address}": no dask scheduler answers there ({_short(error)}); start one with '
            '"dask scheduler" and give its address, as tcp://host:8786.'
        ) from None
    try:
        client.wait_for_workers(1, timeout=CLUSTER_TIMEOUT)
    except TimeoutError:
        client.close()
        raise InputError(
            f'scheduler = "{address}": it has no worker; start some with "dask worker {address}".'
        ) from None
    return client


def _short(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
