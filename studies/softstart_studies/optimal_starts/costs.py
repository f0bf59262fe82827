"""What it costs to end synchronous or steady, to play a smooth torque, and to start another kind of drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from softstart.optimal.front import Front, FrontPoint
from softstart.optimal.optimize import optimize
from softstart.optimal.problem import TERMINALS, Terminal
from softstart.optimal.result import InfeasibleError, Optimum, OptimumError
from softstart.study import Claim, Progress, Table, Verdict
from softstart.views.drawing import drawing, new_figure
from softstart_studies.crane import K_DYN, draw_lines, percent
from softstart_studies.optimal_starts.drives import (
    DAMPING,
    Extent,
    crane,
    direct_time,
    gap_of,
    of_points,
    optima,
)
from softstart_studies.optimal_starts.limits import nearest

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PROMISED = 0.05  # by how much reached is said to lie below synchronous where K_dyn > 1
MULTIPLE = 1.2  # of the start time of direct, for a smooth torque
PLAYABLE = 5000.0  # N m/s: a drive that takes 12 ms to its starting torque
LITTLE = 1.05


# terminal conditions -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Endings:
    """The optima of one gap for every terminal condition, by the start time in s."""

    gap: float
    by_terminal: dict[Terminal, dict[float, FrontPoint]]

    def k_dyn(self, terminal: Terminal) -> dict[float, float]:
        """K_dyn over the start time, where there is an optimum."""
        points = self.by_terminal[terminal].items()
        return {time: point.k_dyn for time, point in points if point.k_dyn is not None}

    def cost(self, terminal: Terminal) -> dict[float, float]:
        """K_dyn over that of `reached`, where both have an optimum."""
        least = self.k_dyn("reached")
        return {time: k / least[time] for time, k in self.k_dyn(terminal).items() if time in least}


def endings(front: Front, progress: Progress) -> Endings:
    """The other two terminals at the start times of a front; steady, slower to find, at some of them."""
    gap, times = gap_of(front), [point.start_time_bound for point in front.points]
    synchronous = optima(crane(gap), times, "synchronous", progress).points
    steady = optima(crane(gap), times[2::2], "steady", progress).points
    found: dict[Terminal, tuple[FrontPoint, ...]] = {
        "reached": front.points, "synchronous": synchronous, "steady": steady,
    }  # fmt: skip
    return Endings(
        gap, {name: {one.start_time_bound: one for one in points} for name, points in found.items()}
    )


def endings_table(found: Sequence[Endings]) -> Table:
    """K_dyn of the three over the start time."""
    rows = []
    for one in found:
        for time in one.by_terminal["reached"]:
            k = [one.k_dyn(terminal).get(time) for terminal in TERMINALS]
            more = [100 * (one.cost(name).get(time, math.nan) - 1) for name in ("synchronous", "steady")]
            rows.append((one.gap, time, time / direct_time(one.gap), *k, *more))
    columns = ("gap, rad", "start time, s", "x direct", *TERMINALS, "synchronous, % more", "steady, % more")
    return Table("What the terminal condition costs", columns, rows)


def reached_is_lower(found: Sequence[Endings]) -> Claim:
    """The coasting tail counts: what is gained before t_f comes back after it."""
    lower = [
        (1.0 - 1.0 / cost, time, one.gap, one.k_dyn("synchronous")[time] > 1.0)
        for one in found
        for time, cost in one.cost("synchronous").items()
    ]
    above = [row for row in lower if row[3]]
    below = [abs(row[0]) for row in lower if not row[3]]
    most, time, gap, _ = max(above, default=(0.0, 0.0, 0.0, True))
    tail = f"; at K_dyn < 1 by at most {100 * max(below):.1g} %" if below else ""
    return Claim(
        f"Reached is up to {100 * PROMISED:.0f} % below synchronous where K_dyn > 1.",
        Verdict.of(most > 0.9 * PROMISED),
        f"By at most {100 * most:.2f} % at {len(above)} start times with K_dyn > 1 ({gap:g} rad, {time:.4f} "
        f"s){tail}. The peak of the whole run counts, and with it that of the coasting shaft after the "
        "target speed.",
    )


def steady_costs(found: Sequence[Endings]) -> Claim:
    """Coming down to the load torque takes a share of the time."""
    costs = {one.gap: list(one.cost("steady").items()) for one in found if one.cost("steady")}
    said = "; ".join(
        f"{percent(row[0][1], 1)} at {row[0][0]:.4f} s, {percent(row[-1][1], 1)} at {row[-1][0]:.4f} s "
        f"({gap:g} rad)"
        for gap, row in costs.items()
    )
    worst = max((cost for row in costs.values() for _, cost in row), default=1.0)
    return Claim(
        "(Not in [G]) Ending steady, at the torque of the load, costs little.",
        Verdict.REFUTED if not costs else Verdict.PARTLY if worst > 1.05 else Verdict.CONFIRMED,
        f"K_dyn over that of reached at the same start time: {said}. Bringing the shaft down without swing "
        "takes time that is dear in short starts.",
    )


def endings_figure(found: Sequence[Endings]) -> Figure:
    """K_dyn of the three terminals over the start time, and what they cost beside reached."""
    with drawing():
        figure, panels = new_figure(2, len(found), (9.0, 6.2), sharex="col", sharey="row", squeeze=False)
        for one, (above, below) in zip(found, panels.T, strict=True):
            k = {name: one.k_dyn(name) for name in TERMINALS}
            lines = {name: (list(values), list(values.values())) for name, values in k.items()}
            draw_lines(above, lines, f"gap {one.gap:g} rad", levels=[1.0], markers="os^")
            more = {name: one.cost(name) for name in TERMINALS if name != "reached"}
            costs = {name: (list(k), [100 * (x - 1) for x in k.values()]) for name, k in more.items()}
            draw_lines(below, costs, "", "start time, s", markers="os")
        panels[0, 0].set_ylabel(f"least {K_DYN}")
        panels[0, 0].set_ylim(bottom=0.5)
        panels[1, 0].set_ylabel(f"{K_DYN} above that of reached, %")
        panels[0, -1].legend(loc="upper right", handlelength=3.2)
    return figure  # type: ignore[no-any-return]


# a torque that a drive can play --------------------------------------------------------------------------


@dataclass(frozen=True)
class Price:
    """The optimum with a torque of limited smoothness, None where none was found."""

    lag: float  # s
    rate: float  # N m/s
    weight: float  # s
    best: Optimum | None

    @property
    def k_dyn(self) -> float:
        """Of the optimum; NaN without."""
        return self.best.k_dyn if self.best else math.nan

    def __str__(self) -> str:
        parts = {
            f"lag {1000 * self.lag:g} ms": self.lag,
            f"rate {self.rate:g} N m/s": math.isfinite(self.rate),
            f"weight {self.weight:g} s": self.weight,
        }
        return ", ".join(text for text, said in parts.items() if said)


def prices(extent: Extent, progress: Progress) -> list[Price]:
    """The ideal torque first; then each lag from the quickest rate on; then the weights."""
    asked = [(0.0, math.inf, 0.0)]
    for lag in extent.lags:
        asked += [(lag, math.inf, 0.0)] if lag > 0.0 else []
        asked += [(lag, rate, 0.0) for rate in extent.rates]
    asked += [(0.0, math.inf, weight) for weight in extent.weights]
    found = []
    for lag, rate, weight in asked:
        progress(f"torque with lag {lag:g} s, rate {rate:g} N m/s, weight {weight:g} s")
        drive = crane().replace(torque_lag=lag, torque_rate=rate)
        best = None
        with suppress(InfeasibleError, OptimumError):
            best = optimize(drive, MULTIPLE * direct_time(float(drive.gap)), smoothness=weight)
        found.append(Price(lag, rate, weight, best))
    return found


def prices_table(found: Sequence[Price]) -> Table:
    """K_dyn of each, and how much it is above that of an ideal torque."""
    return Table.of(f"What a smooth torque costs, gap 0.5 rad, {MULTIPLE:g} x direct, synchronous", {
        "lag, s": [one.lag for one in found],
        "rate limit, N m/s": [one.rate for one in found],
        "weight, s": [one.weight for one in found],
        "K_dyn": [one.k_dyn for one in found],
        "above ideal, %": [100 * (one.k_dyn / found[0].k_dyn - 1) for one in found],
        "heat, s": [one.best.heat if one.best else None for one in found],
        "at least": [one.best.bound.k_dyn if one.best else None for one in found],
    })  # fmt: skip


def smooth_costs_little(found: Sequence[Price]) -> Claim:
    """Whether the optimum survives what a drive can do."""
    least = found[0].k_dyn
    solved = sorted((one for one in found[1:] if one.best), key=lambda one: one.weight > 0.0)
    playable = [one for one in solved if one.weight == 0.0 and one.rate >= PLAYABLE]
    dearest = max(one.k_dyn for one in playable)
    said = "; ".join(f"{one} {one.k_dyn:.4f} ({percent(one.k_dyn / least, 1)})" for one in solved)
    return Claim(
        "(Not in [G]) A torque that an inverter can play costs little.",
        Verdict.of(dearest < LITTLE * least),
        f"Ideal torque {least:.4f}; {said}. Down to {PLAYABLE:g} N m/s and with a lag of up to "
        f"{1000 * max(one.lag for one in playable):g} ms it costs at most {percent(dearest / least, 1)}.",
    )


# reactive loads and damped shafts ------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """The optima of one kind of drive, terminal synchronous; its controllers beside it at the first gap."""

    name: str
    front: Front


def kinds(extent: Extent, progress: Progress) -> list[Kind]:
    """All kinds at all gaps, at the start times of the undamped active drive."""
    found = []
    for name in extent.kinds:
        for gap in extent.gaps:
            times = [m * direct_time(gap) for m in extent.kind_multiples]
            beside = extent.kind_controllers if gap == extent.gaps[0] else ()
            found.append(Kind(name, optima(crane(gap, name), times, "synchronous", progress, beside)))
    return found


def kinds_table(found: Sequence[Kind]) -> Table:
    """K_dyn of each; that of the undamped active drive is in the table of optimal starts."""
    rows = [(kind.name, gap_of(kind.front), point) for kind in found for point in kind.front.points]
    return Table.of(f"Reactive load and damped shaft (d = {DAMPING:g} N m s/rad, assumed), synchronous", {
        "drive": [name for name, _, _ in rows],
        "gap, rad": [gap for _, gap, _ in rows],
        **of_points([point for *_, point in rows]),
    })  # fmt: skip


def optimum_of_kinds_is_below(found: Sequence[Kind]) -> Claim:
    """The optimum beside the controllers of these drives."""
    judged = [kind for kind in found if kind.front.controllers]
    names = ", ".join(one.name for one in judged[0].front.controllers)
    ratios = [one.ratio for kind in judged for one in kind.front.controllers if one.ratio is not None]
    best = [(kind, nearest(kind.front)) for kind in judged]
    said = "; ".join(
        f"{kind.name}, {gap_of(kind.front):g} rad: {one.name} {one.k_dyn:.4f}, "
        f"{percent(one.ratio or 1.0, 1)} above the optimum"
        for kind, one in best
    )
    return Claim(
        "(Not in [G]) With a reactive load or a damped shaft too, the optimum is well below the controllers.",
        Verdict.of(min(ratios) > 1.05),
        f"At equal start time, {len(ratios)} starts of {names}; nearest: {said}.",
    )
