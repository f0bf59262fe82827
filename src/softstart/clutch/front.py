"""`optimize_engagement`: the least friction work for each peak of the shaft torque, with known laws compared.

For one peak (`Search.least_work`), in turns, the cuts name the end that looks best (`least_over_ends`), and
the linear program finds the law that leads there and what its multipliers prove (`Program`), until the proved
and the found work agree. Each law is engaged on the exact clutch, and its figures are those of that run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.clutch.engagement import Engagement, engage
from softstart.clutch.laws import LAWS
from softstart.clutch.least_work import Answer, Cut, Program, Slip, least_over_ends
from softstart.clutch.model import Clutch
from softstart.errors import InputError, SimulationError
from softstart.quantities import nearest, show

Progress = Callable[[str], object]

STEPS = 160
CLOSE = 2e-4  # of the work: difference at which found and proved agree
TURNS = 25
OVER = 2e-4  # of its peak, by which a law may exceed it between the instants checked; the bound is for that
AGREES = 1e-9
HIGHEST = 1.5  # of Tm: peaks above are useless, and the clutch locks in mid-swing there
HALVINGS = 12
TOUCHES = (2e-4, 1e-3, 5e-3)  # of MM: distance of an end from merely touching w0; the next where one fails

COVERS = {
    "any": "all laws with 0 <= M(t) <= MM for t < tM and M = MM from tM on, with which the clutch slips for "
    "at least one elastic period after tM; peak and work up to the first lock-up",
    "nondecreasing": "all nondecreasing laws with 0 <= M(t) <= MM for t < tM and M = MM from tM on, with "
    "which the clutch slips for at least one elastic period after tM; peak and work up to the first lock-up",
}


@dataclass(frozen=True, eq=False)
class OptimalLaw:
    """A law with the least friction work at its peak torque; SI.

    `times`, `torques` are its table (steps are two points at one instant). `run` is its engagement, which
    `peak_torque` and `slip_work` are taken from. No law of the class has less work than `work_bound` at this
    peak.
    """

    times: tuple[float, ...]
    torques: tuple[float, ...]
    run: Engagement
    work_bound: float

    @property
    def peak_torque(self) -> float:
        """Largest shaft torque up to the lock-up, N m."""
        return self.run.slip_peak_torque

    @property
    def slip_work(self) -> float:
        """Friction work up to the lock-up, J."""
        return self.run.slip_work

    @property
    def gap_percent(self) -> float:
        """How far above the bound the work is, percent."""
        return 100.0 * (self.slip_work / self.work_bound - 1.0)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "peak_torque": self.peak_torque,
            "slip_work": self.slip_work,
            "work_bound": self.work_bound,
            "gap_percent": self.gap_percent,
            "slip_time": self.run.slip_time,
            "locked_peak_torque": self.run.locked_peak_torque,
            "friction_work": self.run.friction_work,
            "times": list(self.times),
            "torques": list(self.torques),
        }


class Search:
    """Optima of one clutch in one class of laws; the cuts of one peak are used for the next.

    >>> search = Search(Clutch.load("paper-c"), "any", steps=60)
    >>> best = search.least_work(60 * 9.80665)
    >>> best.peak_torque <= 60 * 9.80665 * 1.0002, best.work_bound <= best.slip_work, best.gap_percent < 0.1
    (True, True, True)
    """

    def __init__(self, clutch: Clutch, law_class: str = "any", steps: int = STEPS) -> None:
        self.clutch, self.law_class = clutch, law_class
        self.slip = Slip.of(clutch)
        self.program = Program(self.slip, law_class == "nondecreasing", steps)
        self.cuts: list[Cut] = []
        middle = self.slip.w0 - 0.8 * self.slip.g * self.slip.tM
        self.cuts.append(self.program.solve(np.array([0.0, 0.0, middle]), 1.2 * self.slip.Tm).cut)

    def work_bound(self, P: float) -> float:
        """Lower bound in J on the work of all laws of the class with a peak of P (N m), as proved so far."""
        return least_over_ends(self.slip, self.cuts, P, 0.3 * CLOSE * self._scale).bound

    @property
    def _scale(self) -> float:
        return 0.5 * self.slip.I * self.slip.w0**2

    def least_work(self, P: float) -> OptimalLaw:
        """The law of the least work whose peak is P (N m) at most, by no more than `OVER` of it above.

        Raises SimulationError if none is found whose work on the exact clutch is that of the program.
        """
        best: OptimalLaw | None = None
        before, level = -math.inf, 0
        for _ in range(TURNS):
            touch = TOUCHES[level] * self.slip.MM
            least = least_over_ends(self.slip, self.cuts, P, 0.3 * CLOSE * self._scale, touch)
            at_end = (np.array(one) for one in (least.s, least.p, least.q))
            answer = self.program.solve(np.array([float(x) for x in self.slip.start_of_end(*at_end)]), P)
            self.cuts.append(answer.cut)
            found = self._engaged(answer)
            allowed = found is not None and found.peak_torque <= P * (1.0 + OVER)
            if found is not None and allowed and (best is None or found.slip_work < best.slip_work):
                best = found
            if best is not None and best.slip_work - least.bound <= CLOSE * least.bound:
                break
            if least.bound <= before * (1.0 + 1e-7):  # nothing new from this end
                level += 1
                if level == len(TOUCHES):
                    break
            before = least.bound
        if best is None:
            raise SimulationError(
                f"No law with a peak of {P:.6g} N m was found for {self.clutch.name}: the grid of "
                f"{self.program.edges.size - 1} steps is too coarse for it; ask for more steps or a higher "
                "peak."
            )
        bound = self.work_bound(max(best.peak_torque, self.slip.Tm))
        if best.slip_work < bound * (1.0 - 1e-9):
            raise SimulationError(
                f"A law with less work than proved possible ({bound:.9g} J): a mistake in softstart."
            )
        return OptimalLaw(best.times, best.torques, best.run, bound)

    def _engaged(self, answer: Answer) -> OptimalLaw | None:
        """The law on the exact clutch, checked against the program; None if it locks too early."""
        times, torques = merged(self.program.edges, answer.torques, self.slip.MM)
        run = engage(self.clutch.with_table(times, torques))
        s = run.slip_time - self.slip.tM
        if not s >= self.slip.period:
            return None
        matrix, free = self.slip.ends_by(self.program.edges)
        a, b, _, A = (matrix @ answer.torques + free).tolist()
        turn = self.slip.B * s
        p, q = a * math.cos(turn) + b * math.sin(turn), b * math.cos(turn) - a * math.sin(turn)
        claimed = float(self.slip.work(np.array(A), np.array(s), np.array(p), np.array(q)))
        if abs(claimed - run.slip_work) > AGREES * run.slip_work:
            raise SimulationError(
                f"The program claims {claimed:.12g} J of friction work and the exact clutch has "
                f"{run.slip_work:.12g} J: a mistake in softstart."
            )
        return OptimalLaw(tuple(times), tuple(torques), run, 0.0)


def merged(edges: Vector, torques: Vector, MM: float) -> tuple[list[float], list[float]]:
    """Constant torques between edges as a table of steps, equal neighbours joined; MM is held behind.

    >>> merged(np.array([0.0, 1.0, 2.0, 3.0]), np.array([5.0, 5.0, 0.0]), 5.0)
    ([0.0, 2.0, 2.0, 3.0, 3.0], [5.0, 5.0, 0.0, 0.0, 5.0])
    """
    values = np.append(torques, MM).tolist()
    times, heights = [0.0], [values[0]]
    for t, before, after in zip(edges[1:].tolist(), values, values[1:], strict=False):
        if after != before:
            times += [t, t]
            heights += [before, after]
    if times[-1] < edges[-1]:
        times.append(float(edges[-1]))
        heights.append(MM)
    return times, heights


@dataclass(frozen=True, eq=False)
class LawBeside:
    """A known law compared with the optimum at its own peak and at its own work; SI.

    No law of the class with its peak has less work than `work_bound`, and the one found has `least_work`;
    none with its work has a lower peak than `peak_bound`, and the one found has `least_peak`.
    """

    name: str
    run: Engagement
    least_work: float
    work_bound: float
    least_peak: float
    peak_bound: float

    @property
    def excess_work_percent(self) -> float:
        """Work above the least at the same peak, percent."""
        return 100.0 * (self.run.slip_work / self.least_work - 1.0)

    @property
    def excess_peak_percent(self) -> float:
        """Peak above the least at the same work, percent."""
        return 100.0 * (self.run.slip_peak_torque / self.least_peak - 1.0)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "law": self.name,
            "peak_torque": self.run.slip_peak_torque,
            "slip_work": self.run.slip_work,
            "least_work": self.least_work,
            "work_bound": self.work_bound,
            "excess_work_percent": self.excess_work_percent,
            "least_peak": self.least_peak,
            "peak_bound": self.peak_bound,
            "excess_peak_percent": self.excess_peak_percent,
        }


@dataclass(frozen=True, eq=False)
class EngagementFront:
    """Least friction work over the peak of the shaft torque, as `optimize_engagement` returns it; SI.

    Parameters
    ----------
    clutch : Clutch
        The clutch.
    law_class : str
        "any" or "nondecreasing".
    covers : str
        Which laws the bounds cover, in words.
    points : tuple of OptimalLaw
        The optimal laws, by rising peak: N m, J.
    laws : tuple of LawBeside
        Known laws compared with them.

    References
    ----------
    [C]; see docs/paper-c.md.

    Examples
    --------
    >>> front = optimize_engagement(Clutch.load("paper-c"), 1, laws=False, steps=60)
    >>> front.law_class, len(front.points), front.points[0].gap_percent < 0.1
    ('any', 1, True)
    """

    clutch: Clutch
    law_class: str
    covers: str
    points: tuple[OptimalLaw, ...]
    laws: tuple[LawBeside, ...]

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "clutch": self.clutch.summary(),
            "law_class": self.law_class,
            "bound_covers": self.covers,
            "mean_torque": self.clutch.mean_torque,
            "points": [point.summary() for point in self.points],
            "laws": [law.summary() for law in self.laws],
        }

    def plot(self) -> Any:
        """The front with the known laws, and the laws on it."""
        from softstart.views import clutches as views

        return views.front_figure([self])


def optimize_engagement(
    clutch: Clutch,
    points: int = 8,
    *,
    law_class: str = "any",
    laws: bool = True,
    steps: int = STEPS,
    progress: Progress | None = None,
) -> EngagementFront:
    """The least friction work for `points` peaks of the shaft torque, from the least possible one on.

    Peak and work are those up to the first lock-up, [C] (2) and (3).

    Parameters
    ----------
    clutch : Clutch
        A clutch without gap and damping, with an active load.
    points : int, optional
        Number of peaks, 1 to 200, up to 1.5 times the mean torque.
    law_class : str, optional
        "any" (0 <= M <= MM) or "nondecreasing"; from tM on the torque is MM.
    laws : bool, optional
        Whether the laws of [C] (and the clutch's own, if that is another) are compared with the front.
    steps : int, optional
        Number of torques of a law.
    progress : callable, optional
        Called with a sentence on each step of the work.

    Returns
    -------
    EngagementFront
        Optimal laws with their lower bounds: torques in N m, work in J.

    Raises
    ------
    InputError
        If the clutch has a gap, damping or a reactive load, or locks too soon after tM.
    SimulationError
        If no law is found for a peak.

    References
    ----------
    [C] (2), (3); see docs/paper-c.md.

    Examples
    --------
    >>> front = optimize_engagement(Clutch.load("paper-c"), 2, laws=False, steps=60)
    >>> [round(point.peak_torque / 9.80665, 1) for point in front.points]
    [53.3, 80.0]
    """
    _check(points, law_class)
    search = Search(clutch, law_class, steps)
    Tm = search.slip.Tm
    peaks = [Tm * (1.0 + (HIGHEST - 1.0) * (i / max(points - 1, 1)) ** 2) for i in range(points)]
    found = []
    for number, peak in enumerate(peaks, start=1):
        _report(progress, f"optimal law {number} of {points}, {law_class}: peak {peak:.5g} N m")
        found.append(search.least_work(peak))
    beside = []
    if laws:
        for name, run in known_laws(clutch):
            _report(progress, f"{name} against the optimum, {law_class}")
            beside.append(_beside(search, found[0], name, run))
    return EngagementFront(clutch, law_class, COVERS[law_class], tuple(found), tuple(beside))


def known_laws(clutch: Clutch) -> list[tuple[str, Engagement]]:
    """The laws of [C] on this clutch, and its own table; only those that slip for a period beyond tM."""
    made: dict[str, Clutch] = {
        name: clutch.replace(law=name, law_times=None, law_torques=None) for name in LAWS
    }
    if clutch.law == "table" and clutch.friction.held == clutch.clutch_torque:
        made["table"] = clutch
    slip = Slip.of(clutch)
    runs = [(name, engage(one)) for name, one in made.items() if one.friction.engaged_at <= slip.tM]
    return [(name, run) for name, run in runs if run.slip_time - slip.tM >= slip.period]


def _beside(search: Search, first: OptimalLaw, name: str, run: Engagement) -> LawBeside:
    best = search.least_work(run.slip_peak_torque)
    peak, bound = first.peak_torque, search.slip.Tm
    if run.slip_work < first.slip_work:
        peak, bound = _least_peak(search, run)
    return LawBeside(name, run, best.slip_work, best.work_bound, peak, bound)


def _least_peak(search: Search, run: Engagement) -> tuple[float, float]:
    """(peak found, peak proved) at the work of a run with less work than the law of the least peak."""
    low, high = search.slip.Tm, run.slip_peak_torque
    peak = high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        law = search.least_work(middle)
        if law.slip_work <= run.slip_work:
            peak = min(peak, law.peak_torque)
            high = middle
        else:
            low = middle
    proved = search.slip.Tm
    for share in range(HALVINGS + 1):
        middle = search.slip.Tm + (low - search.slip.Tm) * (1.0 - share / HALVINGS)
        if search.work_bound(middle) > run.slip_work:
            proved = middle
            break
    return peak, proved


def _check(points: object, law_class: object) -> None:
    wrong = []
    if not isinstance(points, int) or isinstance(points, bool) or not 1 <= points <= 200:
        wrong.append(f"points = {show(points)}: give a whole number of points from 1 to 200.")
    if law_class not in COVERS:
        meant = nearest(law_class, COVERS) if isinstance(law_class, str) else None
        hint = f"; did you mean {show(meant)}?" if meant else "."
        wrong.append(f'law_class = {show(law_class)}: laws are "any" or "nondecreasing"{hint}')
    if wrong:
        raise InputError(wrong)


def _report(progress: Progress | None, doing: str) -> None:
    if progress is not None:
        progress(doing)
