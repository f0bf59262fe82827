"""What it costs to end synchronous or steady."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from softstart.optimal.front import Front, FrontPoint
from softstart.optimal.problem import TERMINALS, Terminal
from softstart.study import Claim, Progress, Verdict
from softstart.views.drawing import drawing, new_figure
from softstart_studies.crane import K_DYN, draw_lines, percent
from softstart_studies.optimal_starts.drives import crane, gap_of, optima

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PROMISED = 0.05  # by how much reached is said to lie below synchronous where K_dyn > 1


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
    return figure
