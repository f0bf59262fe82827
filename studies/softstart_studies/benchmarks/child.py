"""Contenders at work in a process of their own, bound to one processor and one thread.

The parent asks and the child answers, pickled over the child's standard input and output; the other children
wait while one works.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from typing import IO, Any

from softstart.errors import SimulationError
from softstart_studies.benchmarks.host import Here, Timed
from softstart_studies.benchmarks.problem import Problem

THREAD_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
ONE_THREAD = {
    **dict.fromkeys(THREAD_COUNTS, "1"),
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}
COMMAND = "from softstart_studies.benchmarks.child import main; main()"
PATIENCE = 10.0  # s, for a child to go once it is told to


class Child:
    """A host whose work is done by a process of its own."""

    def __init__(self) -> None:
        self.errors = tempfile.TemporaryFile()  # noqa: SIM115  closed with the child
        self.process = subprocess.Popen(
            [sys.executable, "-c", COMMAND],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            env={**os.environ, **ONE_THREAD},
        )

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
        """Let the child go; one that does not go is ended."""
        with self.errors:
            try:
                self.process.communicate(timeout=PATIENCE)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.communicate()

    def _ask(self, verb: str, *arguments: object) -> Any:
        to_child, from_child = self.process.stdin, self.process.stdout
        if to_child is None or from_child is None:
            raise SimulationError("benchmark: the process of a contender has no channel.")
        try:
            pickle.dump((verb, arguments), to_child)
            to_child.flush()
            return pickle.load(from_child)
        except (EOFError, BrokenPipeError):
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(PATIENCE)  # its last words are complete only then
            self.errors.seek(0)
            said = self.errors.read().decode(errors="replace").strip().splitlines()[-1:]
            last = f"its last words: {said[0]}" if said else "without a word."
            raise SimulationError(f"benchmark: the process of a contender ended; {last}") from None


def serve(questions: IO[bytes], answers: IO[bytes]) -> None:
    """Answer until the questions end."""
    here = Here()
    verbs: dict[str, Callable[..., object]] = {
        "prepare": here.prepare,
        "timed": here.timed,
        "forget": here.forget,
        "memory": here.memory,
    }
    while True:
        try:
            verb, arguments = pickle.load(questions)
        except EOFError:
            return
        pickle.dump(verbs[verb](*arguments), answers)
        answers.flush()


def bind_to_one_processor() -> None:
    """Where the system offers it, so that no library's thread pool has more than one."""
    if sys.platform == "linux":
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def main() -> None:
    """The child."""
    bind_to_one_processor()
    with os.fdopen(os.dup(1), "wb") as channel:
        os.dup2(2, 1)  # whatever a library prints must not get between the answers
        serve(sys.stdin.buffer, channel)
