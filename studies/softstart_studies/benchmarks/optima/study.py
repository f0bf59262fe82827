"""`softstart study benchmark-optima`: one optimal start, solved by softstart, rockit, dymos and GEKKO.

Each contender is a function in `contenders`, dymos in `dymos_phases`; each works in a process of its own.
Whatever it claims, its torque is replayed on the exact plant (`judge`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, NamedTuple, cast

from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.views.drawing import COLOURS, drawing, new_figure
from softstart_studies.benchmarks.contest import MISSING, Host, condition_table, rounded, version_of
from softstart_studies.benchmarks.optima.judge import Judged, judge
from softstart_studies.benchmarks.optima.task import START_TIMES, Answer, Task, crane_task
from softstart_studies.benchmarks.process import FAILED, Apart, prepare, timed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["BenchmarkOptima"]

OURS = "softstart"
REPETITIONS = 3
ENOUGH = 20.0  # s, after which no further repetition is begun
GUESSES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the torque, as a share of Ms
SAME = 1e-3  # relative; two K_dyn this close count as equal


class Entry(NamedTuple):
    """A contender: its package, the function that solves, how it is used, and options of that.

    `trap` marks a formulation that is shown as a warning and is solved once.
    """

    package: str
    solver: str
    how: str
    options: Mapping[str, float] = MappingProxyType({})
    trap: bool = False


ENTRIES = {
    "closed-form": Entry(OURS, "contenders:closed_form", "pulse, coast, hold"),
    "descent": Entry(OURS, "contenders:descent", "successive linear programs on the exact start, HiGHS"),
    "collocation": Entry(OURS, "contenders:collocation", "CasADi, phases of free duration, IPOPT"),
    "rockit": Entry(
        "rockit-meco", "contenders:rockit",
        "two stages of free duration, multiple shooting (25 + 75 intervals, RK4), IPOPT",
    ),
    "dymos": Entry(
        "dymos", "dymos_phases:solve", "two linked phases, Gauss-Lobatto of order 3 (15 + 45 segments), SLSQP"
    ),
    "gekko": Entry(
        "gekko", "contenders:gekko",
        "two time-scaled phases on one axis (30 + 120 intervals, 3 nodes), its own IPOPT",
    ),
    **{
        f"{name} {guess:g}": Entry(
            "rockit-meco", "contenders:rockit_one_phase", how, {"rounding": rounding, "guess": guess}, True
        )
        for name, rounding, how in (
            ("rockit-max", 0.0, "one phase, T = c max(0, z), 100 intervals; guess of the torque in Ms"),
            ("rockit-rounded", 0.01, "the same, max(0, z) rounded off by 0.01 rad"),
        )
        for guess in GUESSES
    },
}  # fmt: skip


def ready(name: str, task: Task) -> Callable[[], Answer]:
    """The solver of a contender for a task; this imports its package."""
    module, function = ENTRIES[name].solver.split(":")
    solve = getattr(import_module(f"{__package__}.{module}"), function)
    return partial(solve, task, **ENTRIES[name].options)


@dataclass(frozen=True)
class Outcome:
    """What a contender made of a task, and what the exact plant says of it, or why there is no answer.

    `first`: s of the clock of the first solution with its imports; `seconds`: of processor time, the median
    of those after it.
    """

    name: str
    task: Task
    judged: Judged | None
    first: float = 0.0
    seconds: float = 0.0
    trouble: str = ""

    @property
    def kept(self) -> bool:
        """Whether there is an answer and it keeps all conditions of the task."""
        return self.judged is not None and not self.judged.broken


class BenchmarkOptima(Study):
    """Least peak torque of a start within 0.2883 s and within 0.2523 s, the crane drive of [G].

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
        host: Callable[[], Host] = Apart,
    ) -> None:
        self.names, self.start_times = tuple(names), tuple(start_times)
        self.repetitions, self.host = repetitions, host

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All contenders, a few minutes; nothing is written to `out`."""
        outcomes = []
        for task in map(crane_task, self.start_times):
            for name in self.names:
                entry = ENTRIES[name]
                if version_of(entry.package) is None:
                    progress(f"{name}: {entry.package} {MISSING}")
                    continue
                progress(f"start within {task.start_time:g} s: {name}, {entry.how}")
                outcomes.append(self._outcome(name, task))
        return StudyResult(
            tables=(
                _answer_table(outcomes), _time_table(outcomes), _contender_table(self.names),
                _condition_table(self.repetitions),
            ),
            claims=claims(outcomes),
            figures={self.pictures[0]: optima_figure(outcomes)},
        )  # fmt: skip

    def _outcome(self, name: str, task: Task) -> Outcome:
        host, passes = self.host(), 1 if ENTRIES[name].trap else max(1, self.repetitions)
        try:
            first: float = host(prepare, name, f"{__name__}:ready", name, task)
            found = [host(timed, name)]
            while len(found) < passes and sum(one.wall for one in found) < ENOUGH:
                found.append(host(timed, name))
        except Exception as error:  # a solver's refusal is a result
            return Outcome(name, task, None, trouble=str(error).removeprefix(FAILED)[:100])
        finally:
            host.close()
        seconds = median(one.cpu for one in found)
        return Outcome(name, task, judge(task, found[-1].found), first, seconds)


def least(outcomes: Sequence[Outcome], task: Task, ours: bool) -> tuple[float, str] | None:
    """Smallest re-simulated K_dyn that keeps all conditions, of softstart or of a peer, and whose it is."""
    found = [
        (one.judged.k_dyn, one.name) for one in outcomes
        if one.judged and one.kept and one.task == task and (ENTRIES[one.name].package == OURS) == ours
    ]  # fmt: skip
    return min(found, default=None)


def claims(outcomes: Sequence[Outcome]) -> list[Claim]:
    """That no peer has a smaller K_dyn, and that one phase is a trap."""
    tasks = list(dict.fromkeys(one.task for one in outcomes))
    own = {task: found[0] for task in tasks if (found := least(outcomes, task, ours=True))}
    peers = {task: found for task in own if (found := least(outcomes, task, ours=False))}
    made = []
    if peers:
        said = (
            f"{t.start_time:g} s: {own[t]:.5f} against {k:.5f} of {name}" for t, (k, name) in peers.items()
        )
        made.append(
            Claim(
                "No peer's torque has a smaller K_dyn than softstart's, re-simulated, within 0.1 %.",
                Verdict.of(*(own[task] <= k_dyn * (1.0 + SAME) for task, (k_dyn, _) in peers.items())),
                f"Least K_dyn with all conditions kept: {'; '.join(said)}.",
            )
        )
    trapped = [one for one in outcomes if ENTRIES[one.name].trap and one.task in own]
    if trapped:
        off = [one.judged.k_dyn / own[one.task] if one.judged and one.kept else None for one in trapped]
        missed = [value is None or value > 1.01 for value in off]
        made.append(
            Claim(
                "Written as one phase, the problem is missed by more than 1 % from every guess of torque.",
                Verdict.of(*missed),
                f"Of {len(trapped)} guesses {missed.count(False)} come within 1 % of the optimum and meet "
                f"all conditions, {sum(one.judged is None for one in trapped)} end without a solution.",
            )
        )
    return made


def _answer_table(outcomes: Sequence[Outcome]) -> Table:
    rows: list[tuple[object, ...]] = []
    for one in outcomes:
        found = one.judged
        if found is None:
            rows.append((one.task.start_time, one.name, None, None, None, None, None, one.trouble))
            continue
        errors = (float(f"{error:.1e}") for error in (found.motor_error, found.load_error))
        remark = f"not kept: {', '.join(found.broken)}" if found.broken else ""
        figures = (round(found.claimed, 5), round(found.k_dyn, 5), *errors, found.contacts, remark)
        rows.append((one.task.start_time, one.name, *figures))
    columns = ("claimed", "K_dyn", "w1 error, rad/s", "w2 error, rad/s", "contacts", "remark")
    return Table("Claimed and re-simulated K_dyn", ("start time, s", "contender", *columns), rows)


def _time_table(outcomes: Sequence[Outcome]) -> Table:
    rows = []
    for one in (one for one in outcomes if one.judged is not None):
        rivals = [o for o in outcomes if o.task == one.task and o.kept and ENTRIES[o.name].package == OURS]
        best = min((rival.seconds for rival in rivals), default=0.0)
        ratio = rounded(one.seconds / best) if best else None
        rows.append((one.task.start_time, one.name, rounded(one.first), rounded(one.seconds), ratio))
    columns = ("start time, s", "contender", "first, s", "median cpu, s", "to our fastest")
    return Table("Computing time", columns, rows)


def _contender_table(names: Sequence[str]) -> Table:
    rows = []
    for name in names:
        entry, version = ENTRIES[name], version_of(ENTRIES[name].package)
        rows.append((name, f"{entry.package} {version or ''}".strip(), entry.how if version else MISSING))
    return Table("Contenders", ("name", "package", "how it is used"), rows)


def _condition_table(repetitions: int) -> Table:
    rows = [
        ("K_dyn", "of the whole re-simulated run to an elastic period after t_f"),
        ("first", "of the clock, with imports"),
        ("cpu", "processor time, child processes included; median of the solutions after the first"),
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
