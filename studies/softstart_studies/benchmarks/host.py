"""Where contenders work: a process of their own, bound to one processor and one thread, timed and weighed.

The parent asks, the child answers, pickled over the child's standard input and output; children wait while
one works. `python -m softstart_studies.benchmarks.host` is the child.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Protocol, Self

from softstart.errors import SimulationError
from softstart_studies.benchmarks.contenders import Contender, make
from softstart_studies.benchmarks.problem import Problem, Vector, gaps

ONE_THREAD = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"),
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}
PATIENCE = 10.0  # s, for a child to go once it is told to


@dataclass(frozen=True)
class Timed:
    """One pass over the starts: seconds of the process's processor time, of the clock, and the peaks, N m."""

    cpu: float
    wall: float
    peaks: Vector


class Host(Protocol):
    """Whoever times contenders."""

    def prepare(self, name: str, problem: Problem, starts: int) -> float:
        """Make ready for so many starts; seconds of the first pass, compiling included."""

    def timed(self, name: str, problem: Problem, starts: int) -> Timed:
        """One pass over `gaps(starts)`."""

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
        """Make ready for so many starts; seconds of the first pass, compiling included."""
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

    def memory(self) -> float | None:
        """Largest resident memory of this process, MiB, from Linux's own account.

        Not `ru_maxrss`: a child inherits that of its parent.
        """
        status = Path("/proc/self/status")
        if not status.exists():
            return None
        kib = [line.split()[1] for line in status.read_text().splitlines() if line.startswith("VmHWM:")]
        return int(kib[0]) / 1024 if kib else None

    def close(self) -> None:
        """Nothing to be done."""


class Child:
    """Works in a process of its own."""

    def __init__(self) -> None:
        self.errors = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "softstart_studies.benchmarks.host"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            env={**os.environ, **ONE_THREAD},
        )

    def prepare(self, name: str, problem: Problem, starts: int) -> float:
        """Make ready for so many starts; seconds of the first pass, compiling included."""
        return float(self._ask("prepare", name, problem, starts))

    def timed(self, name: str, problem: Problem, starts: int) -> Timed:
        """One pass over `gaps(starts)`."""
        answer: Timed = self._ask("timed", name, problem, starts)
        return answer

    def memory(self) -> float | None:
        """Largest resident memory of the child so far, MiB."""
        answer: float | None = self._ask("memory")
        return answer

    def close(self) -> None:
        """Let the child go; one that does not go is ended."""
        if self.process.stdin is not None:
            self.process.stdin.close()
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        self.errors.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _ask(self, verb: str, *arguments: object) -> Any:
        if self.process.stdin is None or self.process.stdout is None:
            raise SimulationError("benchmark: the process of a contender has no channel.")
        try:
            pickle.dump((verb, arguments), self.process.stdin)
            self.process.stdin.flush()
            return pickle.load(self.process.stdout)
        except (EOFError, BrokenPipeError):
            self.errors.seek(0)
            last = self.errors.read().decode(errors="replace").strip().splitlines()[-1:]
            said = last[0] if last else "it said nothing"
            raise SimulationError(f"benchmark: the process of a contender ended: {said}.") from None


def serve(questions: IO[bytes], answers: IO[bytes]) -> None:
    """Answer until the questions end."""
    here = Here()
    verbs = {"prepare": here.prepare, "timed": here.timed, "memory": here.memory}
    while True:
        try:
            verb, arguments = pickle.load(questions)
        except EOFError:
            return
        pickle.dump(verbs[verb](*arguments), answers)
        answers.flush()


def bind_to_one_processor() -> None:
    """Where the system offers it, so that no library's thread pool has more than one."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


if __name__ == "__main__":
    bind_to_one_processor()
    channel = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints must not get between the answers
    serve(sys.stdin.buffer, channel)
