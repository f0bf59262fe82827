"""`optimize_engagement`: the least friction work for each peak of the shaft torque, and the known laws
beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from softstart.clutch.laws import LAWS
from softstart.clutch.model import Clutch
from softstart.clutch.optimal.slip import Slip
from softstart.clutch.optimal.solving import COVERS, STEPS, OptimalLaw, Search
from softstart.clutch.result import Engagement
from softstart.clutch.start import engage
from softstart.errors import InputError
from softstart.units import nearest, show

__all__ = ["EngagementFront", "LawBeside", "optimize_engagement"]

HIGHEST = 1.5  # of Tm: peaks above are of no use, and the clutch locks in mid-swing there
HALVINGS = 12

Progress = Callable[[str], object]


@dataclass(frozen=True, eq=False)
class LawBeside:
    """A known law, and the optimum at its own peak and at its own work; SI.

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
    """The front of a clutch: `points` by rising peak, `laws` beside them, and what the bounds cover."""

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
        from softstart.clutch.pictures import front_figure

        return front_figure([self])


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

    `law_class` is "any" (0 <= M <= MM) or "nondecreasing"; from tM on the torque is MM. With `laws` the laws
    of [C] (and the clutch's own, if that is another) are put beside the front. `steps` is the number of
    torques of a law; `progress` is told what is being done. Peak and work are those up to the first lock-up,
    [C] (2) and (3). Raises InputError for a clutch with a gap, damping or a reactive load, and where the
    clutch locks too soon after tM.

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
        _tell(progress, f"optimal law {number} of {points}, {law_class}: peak {peak:.5g} N m")
        found.append(search.least_work(peak))
    beside = []
    if laws:
        for name, run in known_laws(clutch):
            _tell(progress, f"{name} against the optimum, {law_class}")
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
    """(peak found, peak proved) at the work of a run that has less than the law of the least peak: by
    halving.
    """
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


def _tell(progress: Progress | None, doing: str) -> None:
    if progress is not None:
        progress(doing)
