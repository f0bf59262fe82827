"""How near `pulse-coast-hold` comes to the optimum with one set of gains: gap, J2 and load speed unknown.

The theory is in docs/pulse-coast-hold.md. The controllers are set up for the crane of [G] with its gap of 0.5
rad and J2 = 5 J1, whatever the drive really has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softstart import Drive, MachineTable, machine_table, simulate
from softstart.controller import Controller
from softstart.drive import LoadKind
from softstart.optimal.optimize import optimize
from softstart.optimal.result import OptimumError
from softstart.start.batch import prepared
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.views.drawing import colour_scale, drawing, heat_map, panels
from softstart_controllers.pulse_coast_hold import PulseCoastHold
from softstart_studies.crane import LAG, WITH_INVERTER, published, starts_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["PulseCoastHoldStudy"]

Array = NDArray[np.float64]
Changes = Mapping[str, Any]

CONTROLLER = "pulse-coast-hold"
MOST = {"reactive": 1.10, "active": 1.15}  # asked: over the optimum, in every cell
MEAN = {"reactive": 1.06, "active": 1.08}
K_DYN, SPREAD = 1.05, 0.03  # reactive load
WITH_TOLERANCES = 1.30
STIFFNESS, INERTIA = 0.10, 0.05  # tolerances
PERIOD = 0.001  # s
SMALL = ((0.5, 3.0), (0.5, 5.0), (1.0, 4.0), (2.0, 5.0))  # cells (gap in rad, J2/J1) with K_dyn below 1


@dataclass(frozen=True)
class Extent:
    """How much is worked out: the whole study, or a part of it for a quick look."""

    kinds: tuple[LoadKind, ...] = ("reactive", "active")
    gaps: tuple[float, ...] = (0.5, 1.0, 1.5, 2.0)  # rad
    ratios: tuple[float, ...] = (2.0, 3.0, 4.0, 5.0)  # J2/J1
    phases: int = 16  # of the encoder, evenly over a count
    tolerance_gaps: tuple[float, ...] = (0.5, 2.0)
    tolerance_ratios: tuple[float, ...] = (2.0, 5.0)
    deviations: tuple[float, ...] = (-1.0, 0.0, 1.0)  # of stiffness and motor inertia, in tolerances


# starts and optima ---------------------------------------------------------------------------------------


def starts(
    kind: LoadKind, gaps: Sequence[float], ratios: Sequence[float], phases: int, **really: Any
) -> MachineTable:
    """Drives over (gap, J2, encoder phase); J2 in J1 of the drive that the controllers are told.

    >>> starts("active", (0.5, 2.0), (2.0, 5.0), 4).shape
    (2, 2, 4)
    """
    return machine_table(
        WITH_INVERTER,
        load_kind=kind,
        gap=np.asarray(gaps)[:, None, None],
        load_inertia=float(WITH_INVERTER.J1) * np.asarray(ratios)[None, :, None],
        encoder_phase=(np.arange(phases) / phases)[None, None, :],
        **really,
    )


@dataclass(frozen=True)
class Grid:
    """What came out of a batch of starts; arrays over (gap, J2, encoder phase)."""

    kind: LoadKind
    gaps: Sequence[float]
    ratios: Sequence[float]
    k_dyn: Array
    start_time: Array  # s
    contacts: Array
    optimum: Array  # the least K_dyn of each cell, (gap, J2, ...)

    def spread(self, k: Array) -> float:
        """Largest less least over gaps and phases, over their mean; the worst inertia."""
        return float((np.ptp(k, axis=(0, 2)) / k.mean(axis=(0, 2))).max())

    @property
    def over(self) -> Array:
        """K_dyn over that of the optimum."""
        over: Array = self.k_dyn / self.optimum
        return over


def latest(times: Array) -> Array:
    """The longest start time of each cell, s.

    There the optimum is smaller than at the others: a ratio to it is that of all phases, or a little too
    large.
    """
    longest: Array = times.max(axis=2, keepdims=True)
    return longest


def run(
    kind: LoadKind, gaps: Sequence[float], ratios: Sequence[float], phases: int, *,
    at: Callable[[Array], Array] = latest, controller: Controller | None = None,
    told: Changes | None = None, really: Changes | None = None,
) -> Grid:  # fmt: skip
    """Start all drives, and find the optima at these of their start times.

    `told` and `really` are how the drive told, and the drives, differ from the crane.
    """
    batch = starts(kind, gaps, ratios, phases, **(really or {}))
    ready = controller or published(CONTROLLER)
    set_ups = ready.set_ups(WITH_INVERTER.replace(load_kind=kind, **(told or {})))
    found = prepared(batch).figures(set_ups, batch.mean_torque)
    k, times, contacts = (found[name][0].reshape(batch.shape) for name in ("k_dyn", "start_time", "contacts"))
    allowed = at(times)
    optima = np.empty_like(allowed)
    for i, j, phase in np.ndindex(*allowed.shape):
        drive = ideal(kind, gaps[i], ratios[j], **(really or {}))
        optima[i, j, phase] = optimum(drive, float(allowed[i, j, phase]))
    return Grid(kind, gaps, ratios, k, times, contacts, optima)


def ideal(kind: LoadKind, gap: float, ratio: float, **changed: Any) -> Drive:
    """The drive of a cell as the optimum gets it: its torque follows at once, which is the harder bar."""
    inertia = ratio * float(WITH_INVERTER.J1)
    drive = WITH_INVERTER.replace(load_kind=kind, gap=gap, load_inertia=inertia, **changed)
    return drive.replace(torque_lag=0.0, computing_delay=0.0)


@cache
def optimum(drive: Drive, start_time: float) -> float:
    """K_dyn of the optimum, terminal reached, at this start time.

    Where `optimize` finds none it can confirm, 0.01 % more time is given: that can only lower the bar.
    """
    for _ in range(20):
        try:
            return optimize(drive, start_time, terminal="reached").k_dyn
        except OptimumError:
            start_time *= 1.0001
    raise OptimumError(f"no confirmed optimum of {drive.name} near {start_time:g} s.")


# the grid: near the optimum, whatever gap and inertia ----------------------------------------------------


def grid_table(grid: Grid) -> Table:
    """A row a cell."""
    over = grid.over
    gap, ratio = np.meshgrid(grid.gaps, grid.ratios, indexing="ij")
    return Table.of(f"{CONTROLLER}, {grid.kind} load, {grid.k_dyn.shape[2]} encoder phases", {
        "gap, rad": gap.ravel(),
        "J2/J1": ratio.ravel(),
        "K_dyn, least": grid.k_dyn.min(axis=2).ravel(),
        "K_dyn, most": grid.k_dyn.max(axis=2).ravel(),
        "start time, s, longest": latest(grid.start_time).ravel(),
        "optimum there": grid.optimum.ravel(),
        "over the optimum, mean": over.mean(axis=2).ravel(),
        "over the optimum, most": over.max(axis=2).ravel(),
        "contacts": grid.contacts.max(axis=2).astype(int).ravel(),
    })  # fmt: skip


def near_the_optimum(grid: Grid) -> Claim:
    """In every cell, and on the mean."""
    over = grid.over
    i, j, _ = map(int, np.unravel_index(np.argmax(over), over.shape))
    return Claim(
        f"Load {grid.kind}, its inertia, its speed and the gap unknown: K_dyn is at most "
        f"{MOST[grid.kind]:.2f} of the optimum at its own start time in every cell, {MEAN[grid.kind]:.2f} "
        "on the mean.",
        Verdict.of(bool(over.max() <= MOST[grid.kind] and over.mean() <= MEAN[grid.kind])),
        f"At most {over.max():.3f} (gap {grid.gaps[i]:g} rad, J2 = {grid.ratios[j]:g} J1), on the mean "
        f"{over.mean():.3f}, over {over.size} starts in {grid.optimum.size} cells.",
    )


def invariant_to_the_gap(grid: Grid) -> Claim:
    """K_dyn itself over the gaps: with an active load that of the optimum varies, too."""
    k, own, best = grid.k_dyn, grid.spread(grid.k_dyn), grid.spread(grid.optimum)
    if grid.kind == "reactive":
        return Claim(
            f"With a reactive load K_dyn is at most {K_DYN:.2f} and the same over the gaps within "
            f"{100 * SPREAD:.0f} %.",
            Verdict.of(bool(k.max() <= K_DYN and own <= SPREAD)),
            f"K_dyn {k.min():.3f} to {k.max():.3f}; over gaps and encoder phases it varies by "
            f"{100 * own:.1f} % at the worst inertia (that of the optimum by {100 * best:.1f} %).",
        )
    return Claim(
        "With an active load no controller can be invariant to the gap: the optimum is not.",
        Verdict.of(best > SPREAD),
        f"K_dyn {k.min():.3f} to {k.max():.3f}; over the gaps it varies by {100 * own:.0f} % at the worst "
        f"inertia, that of the optimum at the same start times by {100 * best:.0f} %.",
    )


# what each unknown and each imperfection costs -----------------------------------------------------------


def costs_table(extent: Extent, progress: Progress) -> Table:
    """From everything known and ideal to the controller as it is; a row keeps what those before brought."""
    steps: tuple[tuple[str, Changes, Callable[[float], Changes]], ...] = (
        ("ideal; J2 told", {"torque_lag": 0.0, "encoder_lines": 0},
         lambda ratio: {"hold_share": 0.0, "inertia_ratio": ratio}),
        ("J2 unknown", {"torque_lag": 0.0, "encoder_lines": 0}, lambda _: {"hold_share": 0.0}),
        ("4096 encoder lines", {"torque_lag": 0.0}, lambda _: {"hold_share": 0.0}),
        ("torque lag 2 ms", {}, lambda _: {"hold_share": 0.0}),
        ("peak raised to 0.98 M12avg", {}, lambda _: {}),
    )  # fmt: skip
    rows = []
    for name, changed, given in steps:
        progress(f"price of: {name}")
        ratios = []
        for gap, ratio in SMALL:
            own = PulseCoastHold(**given(ratio))
            cell = (gap,), (ratio,), extent.phases
            grid = run("active", *cell, at=np.copy, controller=own, told=changed, really=changed)
            ratios.append(grid.over)
        rows.append((name, float(np.mean(ratios)), float(np.max(ratios))))
    columns = ("and then", "over the optimum, mean", "over the optimum, most")
    return Table("What each costs, active load, cells with K_dyn below 1", columns, rows)


# tolerances ----------------------------------------------------------------------------------------------


class Case(NamedTuple):
    """One deviation, the worst of its cells and phases."""

    kind: LoadKind
    what: str
    k_dyn: float  # the most
    over: float  # the optimum of the drive as it is: the most, at most


def deviations(extent: Extent) -> Iterator[tuple[str, Changes, Changes]]:
    """Their names, what the controller is told, and what the drive is."""
    yield "as told", {}, {}
    for by_c, by_J in product(extent.deviations, repeat=2):
        c, J = by_c * STIFFNESS, by_J * INERTIA
        if c or J:
            really = {
                "stiffness": float(WITH_INVERTER.c) * (1.0 + c),
                "motor_inertia": float(WITH_INVERTER.J1) * (1.0 + J),
            }
            yield f"c {_percent(c)}, J1 {_percent(J)}", {}, really
    for lag in (0.5 * LAG, 1.5 * LAG):
        yield f"lag assumed {1000 * lag:g} ms", {"torque_lag": lag}, {}
    yield f"dead time {1000 * PERIOD:g} ms", {}, {"computing_delay": PERIOD}


def _percent(deviation: float) -> str:
    return f"{100 * deviation:+.0f} %" if deviation else "as told"


def rounded_up(times: Array) -> Array:
    """The longest of each cell, to the next power of 1.01: starts that take about as long share an optimum.

    >>> rounded_up(np.array([[[0.25, 0.2]]])).round(6)
    array([[[0.250801]]])
    """
    found: Array = 1.01 ** np.ceil(np.log(latest(times)) / np.log(1.01))
    return found


def cases(kind: LoadKind, extent: Extent, progress: Progress) -> list[Case]:
    """As told; stiffness and motor inertia together; the lags that are assumed; the dead time."""
    found = []
    for name, told, really in deviations(extent):
        progress(f"{kind} load, {name}")
        cells = extent.tolerance_gaps, extent.tolerance_ratios
        grid = run(kind, *cells, extent.phases, at=rounded_up, told=told, really=really)
        found.append(Case(kind, name, float(grid.k_dyn.max()), float(grid.over.max())))
    return found


def tolerances_table(found: Sequence[Case]) -> Table:
    """A row a deviation."""
    title = "pulse-coast-hold, tolerances: the worst gap, inertia and encoder phase"
    return Table(title, ("load", "really", "K_dyn, most", "over the optimum, most"), found)


def within_tolerances(found: Sequence[Case]) -> Claim:
    """The worst of all deviations."""
    worst = max(found, key=lambda case: case.over)
    return Claim(
        "Stiffness 10 % off, motor inertia 5 % off, half or one and a half of the lag assumed, a dead time "
        f"of one sample: never more than {WITH_TOLERANCES:.2f} of the optimum.",
        Verdict.of(worst.over <= WITH_TOLERANCES),
        f"At most {worst.over:.3f} ({worst.kind} load, {worst.what}).",
    )


# figures and the study -----------------------------------------------------------------------------------


def corners_figure(extent: Extent) -> Figure:
    """Starts of the corner cells, a column a kind of load."""
    columns = {}
    for kind in extent.kinds:
        told, runs = WITH_INVERTER.replace(load_kind=kind), {}
        for ratio, gap in product((extent.ratios[0], extent.ratios[-1]), (extent.gaps[0], extent.gaps[-1])):
            drive = told.replace(gap=gap, load_inertia=ratio * float(told.J1), encoder_phase=0.3)
            start = simulate(drive, CONTROLLER, fitted_to=told)
            runs[f"gap {gap:g} rad, $J_2$ = {ratio:g} $J_1$: $K_{{dyn}}$ {start.k_dyn:.3f}"] = start
        columns[f"{kind} load"] = runs
    return starts_figure(columns)


def ratios_figure(found: Mapping[LoadKind, Grid]) -> Figure:
    """The worst K_dyn over the optimum of each cell, as a map."""
    worst = {kind: one.over.max(axis=2) for kind, one in found.items()}
    scale = colour_scale(np.array([1.0, *MOST.values()]), *worst.values())
    with drawing():
        figure, axes = panels(len(found), (4.2, 3.4), 2, "$J_2/J_1$", "gap, rad")
        for panel, (kind, one) in zip(axes, found.items(), strict=True):
            ratios, gaps = ([f"{value:g}" for value in axis] for axis in (one.ratios, one.gaps))
            heat_map(panel, ratios, gaps, worst[kind], scale, decimals=3)
            panel.set_title(f"{kind} load (at most {MOST[kind]:.2f} asked)", loc="left")
        figure.suptitle("worst $K_{dyn}$ of each cell over that of the optimum", fontsize=9.5)
    return figure


class PulseCoastHoldStudy(Study):
    """The optimum as feedback, measured against the optimum.

    >>> PulseCoastHoldStudy.name, len(PulseCoastHoldStudy.pictures)
    ('pulse-coast-hold', 2)
    """

    name: ClassVar[str] = "pulse-coast-hold"
    title: ClassVar[str] = "The optimum as feedback, with gap, load inertia and load speed unknown"
    pictures: ClassVar[tuple[str, ...]] = ("pulse-coast-hold-starts", "pulse-coast-hold-ratios")

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it: the grid for both kinds of load, the tolerances."""
        return present(Extent(), progress)


def present(extent: Extent, progress: Progress) -> StudyResult:
    """Work it out, and say and draw what came out."""
    grids = {}
    for kind in extent.kinds:
        progress(f"{kind} load: {len(extent.gaps) * len(extent.ratios)} cells and their optima")
        grids[kind] = run(kind, extent.gaps, extent.ratios, extent.phases)
    costs = costs_table(extent, progress)
    tolerances = [case for kind in extent.kinds for case in cases(kind, extent, progress)]
    progress("drawing")
    claims = [claim(one) for one in grids.values() for claim in (near_the_optimum, invariant_to_the_gap)]
    return PulseCoastHoldStudy.result(
        (*map(grid_table, grids.values()), costs, tolerances_table(tolerances)),
        (*claims, within_tolerances(tolerances)),
        (corners_figure(extent), ratios_figure(grids)),
    )
