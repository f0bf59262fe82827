"""A contender at work in a process of its own, bound to one processor and one thread."""

from __future__ import annotations

import os
import tempfile
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from softstart.parallel import DiedError, Worker
from softstart_studies.benchmarks.optima.entries import ENTRIES, solve
from softstart_studies.benchmarks.optima.task import Answer, Task
from softstart_studies.benchmarks.process import bind_to_one_processor

PATIENCE = 600.0  # s, for all of a contender's work on one task
ENOUGH = 20.0  # s, after which no further repetition is begun


@dataclass(frozen=True)
class Cost:
    """Seconds of the clock, and of processor time with that of ended child processes (GEKKO's solver)."""

    wall: float = 0.0
    cpu: float = 0.0

    @classmethod
    def now(cls) -> Cost:
        """Since some instant in the past."""
        children = sum(os.times()[2:4])  # in ticks of 10 ms; the own time is finer elsewhere
        return cls(time.perf_counter(), time.process_time() + children)

    def since(self) -> Cost:
        """From this instant until now."""
        now = Cost.now()
        return Cost(now.wall - self.wall, now.cpu - self.cpu)


@dataclass(frozen=True)
class Work:
    """What a contender did: its answer, or why there is none, and what it cost.

    `first` is the first solution after the imports, `repeated` are those after it, in the same process.
    """

    answer: Answer | None
    trouble: str = ""
    imported: Cost = Cost()
    first: Cost = Cost()
    repeated: tuple[Cost, ...] = ()


def work(name: str, task: Task, repetitions: int, options: Mapping[str, Any]) -> Work:
    """Solve in this process, once and then again; `options` go to the contender's `solve`."""
    begin = Cost.now()
    for module in ENTRIES[name].imports:
        import_module(module)
    imported = begin.since()
    costs: list[Cost] = []
    answer = None
    while len(costs) <= repetitions and sum(cost.wall for cost in costs) < ENOUGH:
        begin = Cost.now()
        try:
            answer = solve(name, task, **options)
        except Exception as error:  # a solver's refusal is a result; its class is the package's own affair
            return Work(None, sentence(error), imported, begin.since())
        costs.append(begin.since())
    return Work(answer, "", imported, costs[0], tuple(costs[1:]))


def sentence(error: BaseException) -> str:
    """What an error says, in one line of at most 100 characters.

    >>> sentence(RuntimeError("no\\n  solution"))
    'RuntimeError: no solution'
    """
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return text if len(text) <= 100 else f"{text[:50]} ... {text[-45:]}"


def work_apart(name: str, task: Task, repetitions: int, options: Mapping[str, Any]) -> Work:
    """The same in a process of its own, in a folder of its own: some packages leave files behind."""
    worker = Worker(quiet=True)
    try:
        with tempfile.TemporaryDirectory(prefix="softstart-") as folder:
            worker.submit(_in_folder, folder, name, task, repetitions, dict(options))
            message = worker.receive(PATIENCE)
            if message is None:
                return Work(None, f"no answer within {PATIENCE:g} s")
            if message.kind == "error":
                return Work(None, f"it failed: {sentence(message.content[0])}")
            found: Work = message.content
            return found
    except DiedError as death:
        return Work(None, f"its process ended: {death}")
    finally:
        worker.kill()


def _in_folder(folder: str, *arguments: Any) -> Work:
    """In the process: nothing that a package prints, warns of or writes gets anywhere else."""
    bind_to_one_processor()
    os.environ["OPENMDAO_REPORTS"] = "0"
    os.chdir(folder)
    warnings.simplefilter("ignore")
    return work(*arguments)
