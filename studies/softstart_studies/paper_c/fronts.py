"""`optimize_engagement`: the least friction work over the peak of the shaft torque, known laws beside it.

Also the tables of the study about it, two simple laws with the least peak, and what `softstart clutch
--optimal` shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.clutch import LAWS, Clutch, Engagement, engage
from softstart.errors import InputError
from softstart.hints import nearest
from softstart.quantities import show
from softstart.results import Result
from softstart.study import Table
from softstart.views.clutches import clutch_lines
from softstart.views.drawing import COLOURS, DASHES, GREY, MARKERS, drawing, entitle, head, new_figure
from softstart.views.numbers import TextTable as ShownTable
from softstart.views.numbers import column_of, number
from softstart.views.sheet import Sheet, columns_file, records_file
from softstart_studies.paper_c.least_work import STEPS, OptimalLaw, Search
from softstart_studies.paper_c.printed import IN_KGF, KGF

HIGHEST = 1.5  # of the mean torque: peaks above are useless, and the clutch locks in mid-swing there
COVERS = {
    name: f"all {words}laws with 0 <= M(t) <= MM for t < tM and M = MM from tM on, with which the clutch "
    "slips for at least one elastic period after tM; peak and work up to the first lock-up"
    for name, words in (("any", ""), ("nondecreasing", "nondecreasing "))
}


@dataclass(frozen=True, eq=False, repr=False)
class EngagementFront(Result):
    """Least friction work over the peak of the shaft torque, as `optimize_engagement` returns it; SI.

    `points` are the optimal laws of the class "any" or "nondecreasing" by rising peak. `laws` are known ones,
    each with the least work found at its peak and the bound of that, and with the least peak of all where it
    does no less work than the optimal law of that peak (None: it does less).

    >>> front = optimize_engagement(Clutch.load("paper-c"), 1, laws=False, steps=60)
    >>> front.law_class, len(front.points), front.points[0].optimality_gap_percent < 0.1
    ('any', 1, True)
    """

    clutch: Clutch
    law_class: str
    points: tuple[OptimalLaw, ...]
    laws: tuple[dict[str, Any], ...]

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "clutch": self.clutch.summary(),
            "law_class": self.law_class,
            "bound_covers": COVERS[self.law_class],
            "mean_torque": self.clutch.mean_torque,
            "points": [point.summary() for point in self.points],
            "laws": list(self.laws),
        }

    @property
    def sheet(self) -> Sheet:
        """What the command shows and writes; each law of the front is a file that --law reads."""
        points, laws = [one.summary() for one in self.points], self.laws
        beaten = ", ".join(law["law"] for law in laws if law["least_peak"])
        files = {
            f"law-{i}.csv": columns_file({"t [s]": one.pop("times"), "M [N*m]": one.pop("torques")})
            for i, one in enumerate(points, start=1)
        }
        found = {
            "peak\ntorque N m": column_of([one["peak_torque"] for one in points], 5),
            "friction\nwork J": column_of([one["slip_work"] for one in points], 6),
            "lower\nbound J": column_of([one["work_bound"] for one in points], 6),
            "gap\n%": [number(one["gap_percent"], 3) for one in points],
            "slip\ntime s": column_of([one["slip_time"] for one in points]),
            "peak after\nlock-up N m": column_of([one["locked_peak_torque"] for one in points], 5),
            "steps of\nthe law": [str(len(set(one.times)) - 1) for one in self.points],
        }
        known = {
            "law": [law["law"] for law in laws],
            "peak\ntorque N m": column_of([law["peak_torque"] for law in laws], 5),
            "friction\nwork J": column_of([law["slip_work"] for law in laws], 6),
            "least work at\nthis peak J": column_of([law["least_work"] for law in laws], 6),
            "excess\n%": [number(law["excess_work_percent"], 2) for law in laws],
            "excess of\npeak %": [number(law["excess_peak_percent"], 2) for law in laws],
        }
        return Sheet(
            title=f"{self.clutch.name}: optimal laws, {self.law_class}",
            lines=clutch_lines(self.clutch),
            tables=[
                ShownTable.of(f"Least friction work at a given peak, laws: {self.law_class}", found),
                ShownTable.of("Known laws against the optimum", known, ("law",)),
            ],
            conclusions=[f"The law with the least peak has less peak and work than {beaten}."] * bool(beaten),
            notes=[f"The bounds cover {COVERS[self.law_class]}."],
            figures={"front": lambda: front_figure([self], (1.0, "N m"))},
            files={
                "clutch.toml": self.clutch.to_toml(),
                "front.csv": records_file(points),
                **({"laws.csv": records_file(laws)} if laws else {}),
                **files,
            },
        )


def optimize_engagement(
    clutch: Clutch,
    points: int = 8,
    *,
    law_class: str = "any",
    laws: bool = True,
    steps: int = STEPS,
    progress: Callable[[str], object] = lambda doing: None,
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
    [C] (2), (3); see docs/paper-c.md and docs/theory/clutch.md.

    Examples
    --------
    >>> front = optimize_engagement(Clutch.load("paper-c"), 2, laws=False, steps=60)
    >>> [round(point.peak_torque / 9.80665, 1) for point in front.points]
    [53.3, 80.0]
    """
    wrong = []
    if not isinstance(points, int) or isinstance(points, bool) or not 1 <= points <= 200:
        wrong.append(f"points = {show(points)}: give a whole number of points from 1 to 200.")
    if law_class not in COVERS:
        meant = nearest(law_class, COVERS) if isinstance(law_class, str) else None
        hint = f"; did you mean {show(meant)}?" if meant else "."
        wrong.append(f'law_class = {show(law_class)}: laws are "any" or "nondecreasing"{hint}')
    if wrong:
        raise InputError(wrong)
    search, found, known = Search(clutch, law_class, steps), [], []
    for i in range(points):
        peak = search.slip.Tm * (1.0 + (HIGHEST - 1.0) * (i / max(points - 1, 1)) ** 2)
        progress(f"optimal law {i + 1} of {points}, {law_class}: peak {peak:.5g} N m")
        found.append(search.least_work(peak))
    least = found[0]
    for name, run in _known_laws(clutch, search).items() if laws else ():
        progress(f"{name} against the optimum, {law_class}")
        best, peak, work = search.least_work(run.slip_peak_torque), run.slip_peak_torque, run.slip_work
        beaten = work >= least.slip_work
        known.append(
            {
                "law": name,
                "peak_torque": peak,
                "slip_work": work,
                "least_work": best.slip_work,
                "work_bound": best.work_bound,
                "excess_work_percent": 100.0 * (work / best.slip_work - 1.0),
                "least_peak": least.peak_torque if beaten else None,
                "excess_peak_percent": 100.0 * (peak / least.peak_torque - 1.0) if beaten else None,
            }
        )
    return EngagementFront(clutch, law_class, tuple(found), tuple(known))


def _known_laws(clutch: Clutch, search: Search) -> dict[str, Engagement]:
    """The laws of [C] on this clutch, and its own table; only those that slip for a period beyond tM."""
    slip = search.slip
    made: dict[str, Clutch] = {}
    for law in LAWS:
        made[law] = clutch.replace(law=law, law_times=None, law_torques=None)
    if clutch.law == "table" and clutch.friction.held == slip.MM and clutch.friction.engaged_at <= slip.tM:
        made["table"] = clutch
    runs = {name: engage(one) for name, one in made.items()}
    return {name: run for name, run in runs.items() if run.slip_time - slip.tM >= slip.period}


# laws of two numbers -----------------------------------------------------------------------------------


def pulse_and_pause(clutch: Clutch) -> tuple[list[float], list[float]]:
    """A table (s, N m): full torque, none, full torque, so that the shaft rests at its mean torque Tm from
    then on.

    In the plane of T and T'/B the shaft turns about Tm under full torque, about T0 under none. From (0, 0) on
    the circle with radius Tm about Tm to the circle with radius Tm - T0 about T0, and on that to (Tm, 0).

    >>> [round(t, 4) for t in pulse_and_pause(Clutch.load("paper-c"))[0]]
    [0.0, 0.1302, 0.1302, 0.2754, 0.2754]
    """
    IM, Ic = clutch.clutch_inertia, clutch.load_inertia
    Tm, T0 = clutch.mean_torque, clutch.load_torque * IM / (IM + Ic)
    across = Tm - T0
    # the circles meet where (T - Tm)^2 + y^2 = Tm^2 and (T - T0)^2 + y^2 = across^2
    T = T0 + (2.0 * across**2 - Tm**2) / (2.0 * across)
    first = math.acos((Tm - T) / Tm) / clutch.B
    second = first + math.acos((T - T0) / across) / clutch.B
    MM = clutch.clutch_torque
    return [0.0, first, first, second, second], [MM, MM, 0.0, 0.0, MM]


def two_steps(clutch: Clutch) -> tuple[list[float], list[float]]:
    """A table (s, N m): the torque about which the shaft swings up to Tm in half a period, then full torque.

    The nondecreasing law of two torques that leaves no oscillation, as posicast and zero-vibration shaping
    do.

    >>> times, torques = two_steps(Clutch.load("paper-c"))
    >>> round(times[1], 4), round(torques[0] / 9.80665, 6)
    (0.4056, 28.0)
    """
    IM, Ic = clutch.clutch_inertia, clutch.load_inertia
    half = math.pi / clutch.B
    first = (0.5 * clutch.mean_torque * (IM + Ic) - clutch.load_torque * IM) / Ic
    return [0.0, half, half], [first, first, clutch.clutch_torque]


# tables and figure of the study ------------------------------------------------------------------------


def tables(found: tuple[EngagementFront, ...]) -> tuple[Table, ...]:
    """The fronts, the laws of [C] against them, and simple laws."""
    points = [
        (one.law_class, point.peak_torque / KGF, point.slip_work / KGF, point.work_bound / KGF,
         point.optimality_gap_percent, point.run.slip_time, point.run.locked_peak_torque / KGF)
        for one in found
        for point in one.points
    ]  # fmt: skip
    distances = [
        (front.law_class, law["law"], law["peak_torque"] / KGF, law["slip_work"] / KGF,
         law["least_work"] / KGF, law["excess_work_percent"],
         law["least_peak"] and law["least_peak"] / KGF, law["excess_peak_percent"])
        for front in found
        for law in front.laws
    ]  # fmt: skip
    simple = []
    names = (("full torque, pause, full torque", pulse_and_pause), ("two steps", two_steps))
    for one, (name, law_of) in zip(found, names, strict=True):
        times, torques = law_of(one.clutch)
        run, best = engage(one.clutch.with_table(times, torques)), one.points[0]
        instants = ", ".join(f"{t:.4f}" for t in sorted(set(times)) if t > 0.0)
        figures = (run.slip_peak_torque, run.slip_work, best.slip_work, best.work_bound)
        simple.append((one.law_class, name, instants, *(figure / KGF for figure in figures)))
    return (
        Table(
            "Least friction work at a given peak",
            ("laws", "peak, kgf m", "work, kgf m", "bound, kgf m", "gap, %", "tau1, s",
             "peak after lock-up, kgf m"),
            points,
        ),
        Table(
            "The laws of [C] against the optimum",
            ("laws", "law", "peak, kgf m", "work, kgf m", "least work at this peak, kgf m", "excess, %",
             "least peak at this work, kgf m", "excess in the peak, %"),
            distances,
        ),
        Table(
            "Simple laws with the least peak",
            ("laws", "law", "its instants, s", "peak, kgf m", "work, kgf m", "optimum found, kgf m",
             "bound, kgf m"),
            simple,
        ),
    )  # fmt: skip


def front_figure(fronts: list[EngagementFront], unit: tuple[float, str] = IN_KGF) -> Any:
    """Friction work over the peak of the shaft torque with the known laws, and some laws of each front."""
    size, name = unit
    with drawing():
        figure, (front, *panels) = new_figure(1, 1 + len(fronts), (4.4 + 3.2 * len(fronts), 4.6))
        for one, panel, colour in zip(fronts, panels, COLOURS, strict=False):
            points = [[p.peak_torque, p.slip_work, p.work_bound] for p in one.points]
            peaks, works, bounds = np.transpose(points) / size
            front.plot(peaks, works, "-o", ms=3.5, color=colour, label=one.law_class)
            front.plot(peaks, bounds, color=colour, ls=DASHES[3], lw=2.5)
            some = sorted({0, len(peaks) // 2, len(peaks) - 1})
            for which, law_colour, dash in zip(some, COLOURS[2:], DASHES, strict=False):
                t = np.append(one.points[which].times, 1.15 * one.points[which].times[-1])
                M = np.append(one.points[which].torques, one.points[which].torques[-1]) / size
                label = f"peak {peaks[which]:.4g} {name}"
                panel.plot(t, M, color=law_colour, ls=dash, lw=1.3, label=label)
            head(panel, f"laws, {one.law_class}", f"friction torque, {name}", "time, s")
            panel.legend(loc="lower right", fontsize=8)
        for law, marker, colour in zip(fronts[0].laws, MARKERS, COLOURS[3:], strict=False):
            point = [law["peak_torque"] / size], [law["slip_work"] / size]
            front.plot(*point, marker, ms=7, mfc="none", mew=1.6, color=colour, label=law["law"])
        front.axvline(fronts[0].clutch.mean_torque / size, color=GREY, lw=0.8, ls=":")
        across = f"peak of the shaft torque, {name}     (dotted: none lower)"
        work = "J" if size == 1.0 else name
        head(front, "least work; wide dots: bound", f"friction work, {work}", across)
        front.legend(loc="center right", fontsize=8)
        entitle(figure, fronts[0].clutch.name)
    return figure
