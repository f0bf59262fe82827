"""The optimal engagement laws of the clutch of [C], in both classes, and how far the paper's laws are from
them.
"""

from __future__ import annotations

from softstart.clutch import EngagementFront, optimize_engagement
from softstart.clutch.closed_forms import pulse_and_pause, two_steps
from softstart.clutch.collocation import collocated
from softstart.clutch.engagement import engage
from softstart.study import Progress, Table
from softstart_studies.paper_c.printed import KGF, clutch

POINTS = 8
CROSS_CHECKED = 4  # the point at this part of each front, but not the first, by collocation


def fronts(progress: Progress, points: int = POINTS) -> tuple[EngagementFront, ...]:
    """Both fronts."""
    return tuple(
        optimize_engagement(clutch(), points, law_class=law_class, progress=progress)
        for law_class in ("any", "nondecreasing")
    )


def front_table(found: tuple[EngagementFront, ...]) -> Table:
    """All points: peak, work, bound."""
    rows = [
        (one.law_class, point.peak_torque / KGF, point.slip_work / KGF, point.work_bound / KGF,
         point.gap_percent, point.run.slip_time, point.run.locked_peak_torque / KGF)
        for one in found
        for point in one.points
    ]  # fmt: skip
    return Table(
        "Least friction work at a given peak",
        (
            "laws",
            "peak, kgf m",
            "work, kgf m",
            "bound, kgf m",
            "gap, %",
            "tau1, s",
            "peak after lock-up, kgf m",
        ),
        rows,
    )


def distance_table(found: tuple[EngagementFront, ...]) -> Table:
    """The paper's laws against the fronts."""
    rows = [
        (one.law_class, law.name, law.run.slip_peak_torque / KGF, law.run.slip_work / KGF,
         law.least_work / KGF, law.excess_work_percent, law.least_peak / KGF, law.excess_peak_percent)
        for one in found
        for law in one.laws
    ]  # fmt: skip
    return Table(
        "The laws of [C] against the optimum",
        ("laws", "law", "peak, kgf m", "work, kgf m", "least work at this peak, kgf m", "excess, %",
         "least peak at this work, kgf m", "excess in the peak, %"),
        rows,
    )  # fmt: skip


def simple_table(found: tuple[EngagementFront, ...]) -> Table:
    """Laws of two numbers that bring the shaft to its mean torque at rest; the fronts' first points."""
    rows = []
    for one, (name, law) in zip(
        found, (("full torque, pause, full torque", pulse_and_pause), ("two steps", two_steps)), strict=True
    ):
        table = law(clutch())
        run = engage(clutch().with_table(*table))
        best = one.points[0]
        instants = ", ".join(f"{t:.4f}" for t in sorted(set(table[0])) if t > 0.0)
        rows.append((one.law_class, name, instants, run.slip_peak_torque / KGF, run.slip_work / KGF,
                     best.slip_work / KGF, best.work_bound / KGF))  # fmt: skip
    return Table(
        "Simple laws with the least peak",
        (
            "laws",
            "law",
            "its instants, s",
            "peak, kgf m",
            "work, kgf m",
            "optimum found, kgf m",
            "bound, kgf m",
        ),
        rows,
    )


def collocation_table(found: tuple[EngagementFront, ...]) -> Table:
    """A point of each front by direct collocation."""
    rows = []
    for one in found:
        if len(one.points) < 2:
            continue
        point = one.points[max(len(one.points) // CROSS_CHECKED, 1)]
        other = collocated(clutch(), point.peak_torque, one.law_class)
        off = 100.0 * (other.slip_work / point.slip_work - 1.0)
        rows.append(
            (one.law_class, point.peak_torque / KGF, point.slip_work / KGF, other.slip_work / KGF, off)
        )
    return Table(
        "The same optimum by collocation",
        ("laws", "peak, kgf m", "work, kgf m", "by CasADi and IPOPT, kgf m", "apart, %"),
        rows,
    )
