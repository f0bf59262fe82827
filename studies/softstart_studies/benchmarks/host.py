"""Contenders at work in this process: made ready once, then timed and weighed."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from softstart.arrays import Vector
from softstart.errors import SimulationError
from softstart.parallel import DiedError, Worker
from softstart_studies.benchmarks.contenders import Contender, make
from softstart_studies.benchmarks.problem import Problem, gaps

ACCOUNT = Path("/proc/self/status")  # of Linux


@dataclass(frozen=True)
class Timed:
    """One pass over the starts: seconds of the process's processor time, of the clock, and the peaks, N m."""

    cpu: float
    wall: float
    peaks: Vector


class Host(Protocol):
    """Whoever times contenders."""

    def prepare(self, name: str, problem: Problem, starts: int) -> float:
        """Make ready for so many starts; seconds of the first pass, imports and compiling included."""

    def timed(self, name: str, problem: Problem, starts: int) -> Timed:
        """One pass over `gaps(starts)`."""

    def forget(self) -> None:
        """Let go of all that was made ready, so that one duel's memory is not counted in the next."""

    def memory(self) -> float | None:
        """Largest memory of the process so far, MiB; None where that cannot be had."""

    def close(self) -> None:
        """Nothing more will be asked."""


class Here:
    """Works in this process."""

    def __init__(self) -> None:
        self.made: dict[tuple[str, Problem], Contender] = {}
        self.work: dict[tuple[str, Problem, int], Any] = {}

    def prepare(self, name: str, problem: Problem, starts: int) -> float:
        """Make ready for so many starts; seconds of the first pass, imports and compiling included."""
        begin = time.perf_counter()
        if (name, problem) not in self.made:
            self.made[name, problem] = make(name, problem)
        contender = self.made[name, problem]
        self.work[name, problem, starts] = contender.ready(gaps(starts))
        contender.solve(self.work[name, problem, starts])
        return time.perf_counter() - begin

    def timed(self, name: str, problem: Problem, starts: int) -> Timed:
        """One pass over `gaps(starts)`."""
        contender, work = self.made[name, problem], self.work[name, problem, starts]
        cpu, wall = time.process_time(), time.perf_counter()
        peaks = contender.solve(work)
        return Timed(time.process_time() - cpu, time.perf_counter() - wall, peaks.copy())

    def forget(self) -> None:
        """Let go of all that was made ready."""
        self.made.clear()
        self.work.clear()

    def memory(self) -> float | None:
        """Largest resident memory of this process, MiB, where Linux tells it.

        Not `ru_maxrss`: a child inherits that of its parent.
        """
        if not ACCOUNT.exists():
            return None
        kib = [line.split()[1] for line in ACCOUNT.read_text().splitlines() if line.startswith("VmHWM:")]
        return int(kib[0]) / 1024 if kib else None

    def close(self) -> None:
        """Nothing to be done."""


# what Worker does for BLAS and numba, for jax
ONE_THREAD = {
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}
HERE = Here()  # of the process


class Child:
    """A host whose work is done by a process of its own."""

    def __init__(self) -> None:
        self.worker = Worker()
        self.worker.run(bind_to_one_processor)

    def prepare(self, name: str, problem: Problem, starts: int) -> float:
        """Make ready for so many starts; seconds of the first pass, imports and compiling included."""
        return float(self._ask("prepare", name, problem, starts))

    def timed(self, name: str, problem: Problem, starts: int) -> Timed:
        """One pass over `gaps(starts)`."""
        answer: Timed = self._ask("timed", name, problem, starts)
        return answer

    def forget(self) -> None:
        """Let go of all that was made ready."""
        self._ask("forget")

    def memory(self) -> float | None:
        """Largest resident memory of the child so far, MiB."""
        answer: float | None = self._ask("memory")
        return answer

    def close(self) -> None:
        """End the child."""
        self.worker.kill()

    def _ask(self, verb: str, *arguments: object) -> Any:
        try:
            return self.worker.run(_answer, verb, *arguments)
        except DiedError as death:
            raise SimulationError(f"benchmark: the process of a contender ended: {death}.") from None
        except Exception as error:  # a contender's package may fail in any way
            text = " ".join(f"{type(error).__name__}: {error}".split())
            raise SimulationError(f"benchmark: a contender failed: {text}.") from error


def _answer(verb: str, *arguments: object) -> object:
    return getattr(HERE, verb)(*arguments)


def bind_to_one_processor() -> None:
    """One processor where the system offers that, so that no library's thread pool has more; one thread."""
    os.environ.update(ONE_THREAD)
    if sys.platform == "linux":
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
