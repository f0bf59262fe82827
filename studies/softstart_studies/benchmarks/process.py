"""Work in a process of its own, bound to one processor and one thread; how it is timed, and its memory.

What is timed is one call, by processor time of the process and of what it has started and seen end.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from softstart.errors import SimulationError
from softstart.parallel import DiedError, Worker

ACCOUNT = Path("/proc/self/status")  # of Linux
FAILED = "benchmark: a contender failed: "
# what Worker does for BLAS and numba, for jax; no reports of OpenMDAO
ENVIRONMENT = {
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
    "OPENMDAO_REPORTS": "0",
}


class Timed(NamedTuple):
    """One pass: seconds of processor time, of the clock, and what was returned."""

    cpu: float
    wall: float
    found: Any


READY: dict[str, Callable[[], Any]] = {}  # of the process


def prepare(name: str, maker: str, *arguments: object) -> float:
    """Make a contender ready; seconds of the first pass, imports and compiling included.

    `maker` is "module:function"; what it returns is called without arguments.
    """
    begin = time.perf_counter()
    module, function = maker.split(":")
    READY[name] = getattr(import_module(module), function)(*arguments)
    READY[name]()
    return time.perf_counter() - begin


def timed(name: str) -> Timed:
    """One pass of a contender that is ready."""
    cpu, wall = spent(), time.perf_counter()
    found = READY[name]()
    return Timed(spent() - cpu, time.perf_counter() - wall, found)


def spent() -> float:
    """Processor time in s, with that of ended child processes (GEKKO's solver) in ticks of 10 ms."""
    return time.process_time() + sum(os.times()[2:4])


def forget() -> None:
    """Let go of all that was made ready, so that one duel's memory is not counted in the next."""
    READY.clear()


class Apart:
    """A process that calls functions, in a folder of its own; what they keep in their modules stays there."""

    def __init__(self) -> None:
        self.worker, self.folder = Worker(quiet=True), tempfile.TemporaryDirectory(prefix="softstart-")
        self.worker.run(settle, self.folder.name)

    def __call__(self, function: Callable[..., Any], *arguments: object) -> Any:
        """What the function returns; SimulationError with one sentence if it or its process fails."""
        try:
            return self.worker.run(function, *arguments)
        except DiedError as death:
            raise SimulationError(f"benchmark: the process of a contender ended: {death}.") from None
        except Exception as error:  # a contender's package may fail in any way
            text = " ".join(f"{type(error).__name__}: {error}".split())
            raise SimulationError(f"{FAILED}{text}.") from error

    def close(self) -> None:
        """End the process."""
        self.worker.kill()
        self.folder.cleanup()


class Here:
    """The same in this process."""

    def __call__(self, function: Callable[..., Any], *arguments: object) -> Any:
        """What the function returns."""
        return function(*arguments)

    def close(self) -> None:
        """Nothing to be done."""


def settle(folder: str) -> None:
    """One processor where the system offers that, so that no library's thread pool has more; one thread."""
    os.environ.update(ENVIRONMENT)
    os.chdir(folder)  # some packages leave files behind
    if sys.platform == "linux":
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def memory() -> float | None:
    """Largest resident memory of this process, MiB, where Linux tells it.

    Not `ru_maxrss`: a child inherits that of its parent.
    """
    if not ACCOUNT.exists():
        return None
    kib = [line.split()[1] for line in ACCOUNT.read_text().splitlines() if line.startswith("VmHWM:")]
    return int(kib[0]) / 1024 if kib else None
