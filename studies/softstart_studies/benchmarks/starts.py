"""`softstart study benchmark-starts`: starts a second of softstart and of its peers, as ratios of one run.

What is timed is one call that returns the peak shaft torques of so many starts, by processor time. The making
of drives, arrays and grids comes before it, and so does a first pass with imports and compiling.
"""

from __future__ import annotations

import os
import platform
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, cast

import numpy as np

from softstart import Run, simulate, sweep
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.drive.control_systems import initial_state
from softstart.formulas import DirectStarts
from softstart.start.batch import prepared
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.views.drawing import COLOURS, drawing, new_figure
from softstart_studies.benchmarks import lsoda
from softstart_studies.benchmarks.problem import CHAIN, Problem, Solve, gaps

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["BenchmarkStarts"]

PASSES = 7
AGREEMENT = 1e-6  # in K_dyn, where nothing is sampled
COLUMNS = (
    "start", "peer", "softstart", "peer 1/s", "ours 1/s", "ratio", "wanted", "goal 1/s", "K_dyn diff."
)  # fmt: skip


# contenders ----------------------------------------------------------------------------------------------


def batch(problem: Problem, count: int) -> Solve:
    """The compiled kernel over a batch of prepared machines."""
    ready, set_up = prepared(problem.machines(count)), problem.set_up()
    return lambda: ready.results([set_up]).peaks


def formula(problem: Problem, count: int) -> Solve:
    """The closed forms of [G] over arrays: direct starts of undamped drives."""
    (one,), gap = problem.machines(), gaps(count)
    return lambda: DirectStarts(
        J1=one.J1, J2=one.J2, c=one.c, Ms=one.Ms, Mc=one.Mc, target_speed=one.target_speed, gap=gap
    ).peak[:, None]


def run(problem: Problem, count: int) -> Solve:
    """One simulate call a start; Run with its events and stages."""
    machines, (controller, told) = problem.machines(count), problem.set_up()

    def peaks(machine: Any) -> Any:
        found = cast(Run, simulate(machine, controller, fitted_to=told))
        assert found.events
        assert found.stages
        return np.atleast_1d(found.peak_torque if problem.on_drive else found.peak_torques)

    return lambda: np.array([peaks(one) for one in machines])


def swept(problem: Problem, count: int) -> Solve:
    """A sweep of that many gaps into a folder."""
    (one,), (controller, _) = problem.machines(), problem.set_up()

    def solve() -> Any:
        with tempfile.TemporaryDirectory(prefix="softstart-") as home:
            found = sweep(one, controller, {"gap": gaps(count)}, to=Path(home) / "sweep", workers=1)
            return found.peak_torque.values[:, None]

    return solve


def control_default(problem: Problem, count: int) -> Solve:
    """input_output_response as it comes: RK45, rtol 1e-3, the peak read off outputs every millisecond."""
    return _responses(problem, count, 1e-3)


def control_tight(problem: Problem, count: int) -> Solve:
    """input_output_response with LSODA at 1e-8, no step over 1 ms, outputs every 0.1 ms."""
    options = {"rtol": 1e-8, "atol": 1e-8, "max_step": 1e-3}
    return _responses(problem, count, 1e-4, solve_ivp_method="LSODA", solve_ivp_kwargs=options)


def _responses(problem: Problem, count: int, step: float, **options: Any) -> Solve:
    """The end of each start is given: finding the target speed is nothing that the function does."""
    import control

    work = []
    for drive in problem.machines(count):
        end = simulate(drive, "direct").end_time
        times = np.linspace(0.0, end, round(end / step) + 1)
        work.append((drive.to_control(nonlinear=True), times, float(drive.Ms), initial_state(drive)))

    def solve() -> Any:
        responses = [control.input_output_response(*one, **options) for one in work]
        return np.array([[np.abs(one.outputs[one.output_labels.index("T")]).max()] for one in responses])

    return solve


CONTENDERS: dict[str, Callable[[Problem, int], Solve]] = {
    "batch": batch,
    "formula": formula,
    "run": run,
    "sweep": swept,
    "lsoda": lsoda.restarted,
    "lsoda-tight": lsoda.tight,
    "control": control_default,
    "control-tight": control_tight,
}


# duels ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Duel:
    """A peer against softstart, each with as many starts a pass as a good measurement of time needs.

    `wanted` is the ratio that softstart shall reach, `goal` its starts a second; None where none was set.
    """

    problem: Problem
    peer: str
    peer_starts: int
    ours: str
    our_starts: int
    wanted: float | None = None
    goal: float | None = None

    @property
    def label(self) -> str:
        """Strategy and, of a chain, its machine."""
        problem = self.problem
        if problem.on_drive:
            return problem.strategy
        return f"{getattr(problem.machine, 'name', problem.machine)}, {problem.strategy}"


class Outcome(NamedTuple):
    """Medians over the passes: starts a second of processor time and ratio; largest difference in K_dyn."""

    duel: Duel
    peer_rate: float
    our_rate: float
    ratio: float
    k_dyn_difference: float


def fight(duel: Duel, passes: int) -> Outcome:
    """The two in turns, so that a machine that slows down slows both; the ratio is a median, too."""
    peer = CONTENDERS[duel.peer](duel.problem, duel.peer_starts)
    ours = CONTENDERS[duel.ours](duel.problem, duel.our_starts)
    same = CONTENDERS[duel.ours](duel.problem, duel.peer_starts)
    apart = np.abs(peer() - same()) / duel.problem.machines()[0].mean_torque
    ours()
    theirs: list[float] = []
    own: list[float] = []
    for _ in range(passes):
        for work, starts, rates in ((peer, duel.peer_starts, theirs), (ours, duel.our_starts, own)):
            begin = time.process_time()
            work()
            rates.append(starts / (time.process_time() - begin))
    ratio = median(b / a for a, b in zip(theirs, own, strict=True))
    return Outcome(duel, median(theirs), median(own), ratio, float(apart.max()))


def long_chain(count: int = 8) -> Chain:
    """Equal shafts and gaps between inertias that taper off towards the load."""
    inertias = np.geomspace(0.04, 0.01, count - 1)
    masses = [*(Mass(float(J)) for J in inertias), Mass(0.2, torque=7.0)]
    shafts = [Shaft(1500.0, gap=0.05)] * (count - 1)
    return Chain(masses, shafts, Motor(62.0), target_speed=40.0, name=f"even chain of {count} masses")


BATCH, ONE, ONE_CHAIN = 150.0, 20.0, 30.0  # times LSODA
AT_ONCE, SAMPLED = 2000.0, 300.0  # starts/s of chains: constant torque, and a controller at 1 kHz
DIRECT, RAMP = Problem("direct"), Problem("ramp")
CHAINS = (Problem("direct", CHAIN), Problem("ramp", CHAIN), Problem("direct", long_chain()))
# as many starts as make a pass last about a tenth of a second or two
DUELS = (
    Duel(DIRECT, "lsoda", 20, "batch", 4_000, BATCH),
    Duel(Problem("reduced-first-stage"), "lsoda", 20, "batch", 4_000, BATCH),
    Duel(Problem("reduced-two-stage"), "lsoda", 20, "batch", 4_000, BATCH),
    Duel(Problem("damped direct"), "lsoda", 20, "batch", 4_000, BATCH),
    Duel(Problem("damped reduced-two-stage"), "lsoda", 20, "batch", 4_000, BATCH),
    Duel(RAMP, "lsoda", 2, "batch", 2_000, BATCH),
    Duel(Problem("damped ramp"), "lsoda", 2, "batch", 2_000, BATCH),
    Duel(RAMP, "lsoda", 2, "sweep", 20_000, BATCH),
    Duel(DIRECT, "lsoda", 20, "formula", 50_000),
    Duel(DIRECT, "lsoda", 20, "run", 200, ONE),
    *(Duel(one, "lsoda", 1, "run", 20, ONE_CHAIN) for one in CHAINS),
    *(Duel(one, "lsoda-tight", 1, "run", 20) for one in (DIRECT, *CHAINS)),
    Duel(CHAINS[0], "lsoda", 3, "batch", 225, goal=AT_ONCE),
    Duel(CHAINS[1], "lsoda", 3, "batch", 225, goal=SAMPLED),
    Duel(DIRECT, "control", 4, "run", 200),
    Duel(DIRECT, "control-tight", 4, "run", 200),
)


# the study -----------------------------------------------------------------------------------------------


class BenchmarkStarts(Study):
    """Constant, staged and sampled torque on the crane of [G] and on chains: scipy, python-control and we.

    >>> BenchmarkStarts.name, BenchmarkStarts.pictures
    ('benchmark-starts', ('benchmark-starts-ratios',))
    """

    name: ClassVar[str] = "benchmark-starts"
    title: ClassVar[str] = "Starts a second beside scipy and python-control, as ratios of one run"
    pictures: ClassVar[tuple[str, ...]] = ("benchmark-starts-ratios",)

    def __init__(self, duels: Sequence[Duel] = DUELS, passes: int = PASSES) -> None:
        self.duels, self.passes = tuple(duels), passes

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All duels, about two minutes; nothing is written to `out`."""
        found = []
        for number, duel in enumerate(self.duels, start=1):
            progress(f"{number}/{len(self.duels)} {duel.label}: {duel.ours} beside {duel.peer}")
            found.append(fight(duel, self.passes))
        rows = [
            (one.duel.label, one.duel.peer, one.duel.ours, *map(rounded, one[1:4]), one.duel.wanted,
             one.duel.goal, float(f"{one.k_dyn_difference:.1e}"))
            for one in found
        ]  # fmt: skip
        names = dict.fromkeys(name for duel in self.duels for name in (duel.ours, duel.peer))
        hows = [(name, (CONTENDERS[name].__doc__ or "").partition("\n")[0]) for name in names]
        title = "Starts a second, by processor time"
        tables = (
            Table(title, COLUMNS, rows),
            Table("Contenders", ("name", "how it is used"), hows),
            conditions("numpy", "scipy", "numba", "control"),
        )
        return self.result(tables, claims(found), [ratio_figure(found)])


def claims(outcomes: Sequence[Outcome]) -> list[Claim]:
    """One for each kind of duel that has been fought."""
    found = []
    kinds = {
        (BATCH, "In a batch or a sweep"),
        (ONE, "One simulate call"),
        (ONE_CHAIN, "One start of a chain"),
    }
    for wanted, what in sorted(kinds, reverse=True):
        of_kind = [one for one in outcomes if one.duel.wanted == wanted]
        if of_kind:
            ratios = ", ".join(f"{one.duel.label} {rounded(one.ratio):,g}" for one in of_kind)
            found.append(
                Claim(
                    f"{what}: at least {wanted:g} times as many starts a second as scipy's LSODA.",
                    Verdict.of(*(one.ratio >= wanted for one in of_kind)),
                    f"Ratio: {ratios}.",
                )
            )
    apart = [one.k_dyn_difference for one in outcomes if one.duel.peer == "lsoda-tight"]
    if apart:
        found.append(
            Claim(
                f"At its tightest tolerance LSODA has the same K_dyn within {AGREEMENT:g}.",
                Verdict.of(*(value <= AGREEMENT for value in apart)),
                f"Largest difference: {max(apart):.1e}.",
            )
        )
    shares = [one.our_rate / one.duel.goal for one in outcomes if one.duel.goal]
    if shares:
        found.append(
            Claim(
                f"A batch of chains makes {AT_ONCE:,.0f} starts/s under constant torque, "
                f"{SAMPLED:.0f} with a controller at 1 kHz.",
                Verdict.of(*(share >= 1.0 for share in shares)),
                f"Least share of that: {min(shares):.2f}.",
            )
        )
    return found


def rounded(value: float) -> float:
    """Three digits: more would be noise.

    >>> rounded(6487.3)
    6490.0
    """
    return float(f"{value:.3g}")


def conditions(*libraries: str) -> Table:
    """The machine and the versions."""
    rows = [
        ("processors", os.cpu_count()),
        ("machine", f"{platform.machine()}, {platform.system()}"),
        ("python", platform.python_version()),
        *((name, version(name)) for name in libraries),
    ]
    return Table("Conditions", ("what", "value"), rows)


def ratio_figure(outcomes: Sequence[Outcome]) -> Figure:
    """One bar a row of the table, coloured by peer; a black tick where a ratio was wanted."""
    peers = list(dict.fromkeys(one.duel.peer for one in outcomes))
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 1.4 + 0.42 * len(outcomes)))
        for place, one in enumerate(outcomes):
            axes.barh(place, one.ratio, height=0.66, color=COLOURS[peers.index(one.duel.peer)])
            # at the right edge, where no bar and no tick can cross it
            axes.annotate(
                f"{rounded(one.ratio):,g}", (1.0, place), xycoords=("axes fraction", "data"), ha="right",
                va="center",
            )  # fmt: skip
            if one.duel.wanted is not None:
                axes.plot([one.duel.wanted] * 2, [place - 0.42, place + 0.42], color="black", lw=1.8)
        axes.set_xscale("log")
        axes.set_xlim(1.0, 10.0 * max(BATCH, *(one.ratio for one in outcomes)))
        names = [f"{one.duel.label}:  {one.duel.ours} : {one.duel.peer}" for one in outcomes]
        axes.set_yticks(range(len(outcomes)), names)
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("starts/s of softstart : starts/s of the peer     (black tick: wanted)")
        axes.set_title("Same starts, same end, in one run", loc="left")
    return figure
