"""`softstart study benchmark-optima`: one optimal start, solved by softstart, rockit, dymos and GEKKO."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, ClassVar, cast

from softstart.study import Progress, Study, StudyResult, Table
from softstart.views.drawing import COLOURS, drawing, new_figure
from softstart_studies.benchmarks.contest import MISSING, condition_table, rounded
from softstart_studies.benchmarks.optima import entries
from softstart_studies.benchmarks.optima.entries import ENTRIES, lines_of_code
from softstart_studies.benchmarks.optima.judge import judge
from softstart_studies.benchmarks.optima.task import START_TIMES, Task, crane_task
from softstart_studies.benchmarks.optima.verdicts import Outcome, claims, fastest
from softstart_studies.benchmarks.optima.worker import Work, work_apart

if TYPE_CHECKING:
    from matplotlib.figure import Figure


__all__ = ["BenchmarkOptima"]

REPETITIONS = 3
GUESSES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the torque, as a share of Ms
Worker = Callable[[str, Task, int, Mapping[str, Any]], Work]


class BenchmarkOptima(Study):
    """Least peak torque of a start within 0.2883 s and within 0.2523 s, the crane drive of [G].

    Every contender works in a process of its own, bound to one processor and one thread, one after the
    other. Whatever it claims, its torque is replayed on the exact plant.

    >>> BenchmarkOptima.name, BenchmarkOptima.pictures
    ('benchmark-optima', ('benchmark-optima-answers',))
    """

    name: ClassVar[str] = "benchmark-optima"
    title: ClassVar[str] = "The same optimal start with softstart, rockit, dymos and GEKKO, re-simulated"
    pictures: ClassVar[tuple[str, ...]] = ("benchmark-optima-answers",)

    def __init__(
        self,
        names: Sequence[str] = tuple(ENTRIES),
        start_times: Sequence[float] = START_TIMES,
        repetitions: int = REPETITIONS,
        guesses: Sequence[float] = GUESSES,
        worker: Worker = work_apart,
    ) -> None:
        self.names, self.start_times = tuple(names), tuple(start_times)
        self.repetitions, self.guesses, self.worker = repetitions, tuple(guesses), worker

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All contenders, a few minutes; nothing is written to `out`."""
        present = [name for name in self.names if entries.installed(name) is not None]
        for name in self.names:
            if name not in present:
                progress(f"{name}: {ENTRIES[name].package} {MISSING}")
        outcomes, guessed = [], []
        for start_time in self.start_times:
            task = crane_task(start_time)
            for name in present:
                progress(f"start within {start_time:g} s: {name}, {ENTRIES[name].how}")
                outcomes.append(self._outcome(name, task))
        for name in (name for name in present if ENTRIES[name].trap):
            task = crane_task(self.start_times[0])
            for guess in self.guesses:
                progress(f"{name} from a guess of {guess:g} Ms")
                guessed.append(self._outcome(name, task, guess))
        return StudyResult(
            tables=(
                _answer_table(outcomes),
                _time_table(outcomes),
                _contender_table(self.names),
                _guess_table(guessed),
                _condition_table(self.repetitions),
            ),
            claims=claims(outcomes, guessed),
            figures={self.pictures[0]: optima_figure(outcomes)},
        )

    def _outcome(self, name: str, task: Task, guess: float | None = None) -> Outcome:
        more = {} if guess is None else {"guess": guess}
        done = self.worker(name, task, self.repetitions if guess is None else 0, more)
        judged = None if done.answer is None else judge(task, done.answer)
        return Outcome(name, task, done, judged, guess)


def _figures(one: Outcome) -> tuple[object, ...]:
    """Claimed and re-simulated K_dyn, end, errors of the end speeds, contacts, remark."""
    if one.judged is None:
        return (None, None, None, None, None, None, one.work.trouble)
    found = one.judged
    return (
        round(found.claimed, 5),
        round(found.k_dyn, 5),
        round(found.end_time, 6),
        float(f"{found.motor_error:.1e}"),
        float(f"{found.load_error:.1e}"),
        found.contacts,
        f"not kept: {', '.join(found.broken)}" if found.broken else "",
    )


_FIGURES = ("claimed", "K_dyn", "t_f, s", "w1 error, rad/s", "w2 error, rad/s", "contacts", "remark")


def _answer_table(outcomes: Sequence[Outcome]) -> Table:
    rows = [(one.task.start_time, one.name, *_figures(one)) for one in outcomes]
    return Table("Claimed and re-simulated K_dyn", ("start time, s", "contender", *_FIGURES), rows)


def _time_table(outcomes: Sequence[Outcome]) -> Table:
    """The first solution with and without the imports, the median of those after it, and ratios of that."""
    rows = []
    for one in (one for one in outcomes if one.judged is not None):
        best, alike = fastest(outcomes, one.task), fastest(outcomes, one.task, "collocation")
        work = one.work
        rows.append(
            (
                one.task.start_time,
                one.name,
                rounded(work.imported.wall + work.first.wall),
                rounded(work.first.wall),
                rounded(median(cost.wall for cost in work.repeated or (work.first,))),
                rounded(one.seconds),
                len(work.repeated),
                rounded(one.seconds / best) if best else None,
                rounded(one.seconds / alike) if alike else None,
            )
        )
    columns = (
        "start time, s",
        "contender",
        "import + first, s",
        "first, s",
        "median, s",
        "median cpu, s",
        "of",
    )
    return Table("Computing time", (*columns, "to our fastest", "to our collocation"), rows)


def _contender_table(names: Sequence[str]) -> Table:
    rows = []
    for name in names:
        entry, version = ENTRIES[name], entries.installed(name)
        package = f"{entry.package} {version or ''}".strip()
        rows.append((name, package, lines_of_code(name), entry.how if version else MISSING))
    return Table("Contenders", ("name", "package", "lines of code", "how it is used"), rows)


def _guess_table(guessed: Sequence[Outcome]) -> Table:
    rows = [(one.name, one.guess, *_figures(one)) for one in guessed]
    return Table("One phase, from several guesses of the torque", ("contender", "guess, Ms", *_FIGURES), rows)


def _condition_table(repetitions: int) -> Table:
    rows = [
        ("K_dyn", "of the whole re-simulated run to an elastic period after t_f"),
        ("seconds", "of the clock; cpu: of processor time, child processes included; ratios are of these"),
        ("lines of code", "of the contender's file: not blank, no comment, no docstring; imports included"),
        ("processors and threads used", "one, one"),
        ("repetitions after the first", f"{repetitions}, fewer where they take long"),
    ]
    libraries = ("numpy", "scipy", "casadi", "rockit-meco", "openmdao", "dymos", "gekko")
    return condition_table(rows, libraries)


def optima_figure(outcomes: Sequence[Outcome]) -> Figure:
    """K_dyn over computing time, a panel a start time, by package; hollow where a condition breaks."""
    from matplotlib.ticker import LogLocator

    tasks = list(dict.fromkeys(one.task for one in outcomes))
    packages = list(dict.fromkeys(entry.package for entry in ENTRIES.values()))
    with drawing():
        figure, grid = new_figure(1, max(1, len(tasks)), (5.2 * max(1, len(tasks)), 4.2), squeeze=False)
        for axes, task in zip(grid[0], tasks, strict=False):
            for one in outcomes:
                if one.task != task or one.judged is None:
                    continue
                colour = COLOURS[packages.index(ENTRIES[one.name].package)]
                place = (one.seconds, one.judged.k_dyn)
                axes.plot(*place, "o", color=colour, markerfacecolor=colour if one.kept else "white")
                axes.annotate(one.name, place, (5, 4), textcoords="offset points", color=colour)
            axes.set_xscale("log")
            for formatter in (axes.xaxis.set_major_formatter, axes.xaxis.set_minor_formatter):
                formatter(lambda seconds, _: f"{seconds:g}")
            axes.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
            axes.ticklabel_format(axis="y", useOffset=False)
            axes.margins(x=0.25, y=0.12)
            axes.set_xlabel("computing time, s")
            axes.set_title(f"start within {task.start_time:g} s", loc="left")
        grid[0][0].set_ylabel("$K_{dyn}$ re-simulated (hollow: a condition is not kept)")
    return cast("Figure", figure)
