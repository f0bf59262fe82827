"""Engagements and optimal laws as text for people."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softstart.views.numbers import Column, column_of, number, printable, short
from softstart.views.terminal import print_table, sentence

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.clutch import Clutch, Engagement, EngagementFront

STATUS = {"LOCKED": "The clutch has locked.", "SLIPS": "The clutch slips at the end of the run."}


def clutch_lines(clutch: Clutch) -> list[str]:
    """The clutch in a few lines."""
    area = "" if clutch.lining_area is None else f", lining area {short(clutch.lining_area)} m2"
    IM, MM, w0 = short(clutch.clutch_inertia), short(clutch.clutch_torque), short(clutch.drive_speed)
    cp, d, gap = short(clutch.stiffness), short(clutch.damping), short(clutch.gap)
    Ic, Mc = short(clutch.load_inertia), short(clutch.load_torque)
    law = clutch.friction
    return [
        printable(clutch.name),
        f"  clutch  IM = {IM} kg m2, MM = {MM} N m, w0 = {w0} rad/s{area}",
        f"  shaft   cp = {cp} N m/rad, damping {d} N m s/rad, gap = {gap} rad",
        f"  load    Ic = {Ic} kg m2, Mc = {Mc} N m, {clutch.load_kind}",
        f"  law     {law.label}, engaged at {short(law.engaged_at)} s",
        f"  source  {printable(clutch.source)}",
    ]


def figure_rows(run: Engagement) -> list[list[str]]:
    """The figures of an engagement, with unit and meaning."""
    rows = [
        ["peak torque", short(run.peak_torque), "N m", f"shaft, at {short(run.peak_time)} s"],
        ["", short(run.peak_ratio), "", "times the mean torque while the clutch slips"],
        [
            "  while slipping",
            short(run.slip_peak_torque),
            "N m",
            f"up to the lock-up, at {short(run.slip_peak_time)} s",
        ],
        ["  behind it", _or_dash(run.locked_peak_torque), "N m", "after the lock-up"],
        ["slip time", _or_dash(run.slip_time), "s", "first lock-up"],
        ["friction work", short(run.friction_work), "J", "all slip"],
        [
            "  up to the lock-up",
            short(run.slip_work),
            "J",
            f"{short(run.work_while_engaging)} J of it while engaging",
        ],
    ]
    if not math.isnan(run.lining_heat):
        rows.append(["lining heat", short(run.lining_heat), "J/m2", "friction work on the lining area"])
    energy = run.energy
    rows.append(["work of the drive", short(energy.drive), "J", f"balance closed to {energy.residual:.0e}"])
    return rows


def _or_dash(value: float) -> str:
    return "-" if math.isnan(value) else short(value)


def show_engagement(to: Console, run: Engagement) -> None:
    """One engagement: the clutch, its figures, what happened."""
    _clutch(to, run.clutch)
    to.print()
    columns = [Column("figure", False), Column("value"), Column("unit", False), Column("meaning", False)]
    print_table(to, columns, figure_rows(run))
    to.print()
    sentence(to, STATUS[run.status] + " " + _again(run), "bold")
    told = ", ".join(f"{event.name} at {short(event.t)} s" for event in run.events[:12])
    more = len(run.events) - 12
    sentence(to, f"Events: {told}{f', and {more} more' if more > 0 else ''}.", "dim")


def _again(run: Engagement) -> str:
    slips = sum(phase.kind == "slip" for phase in run.phases) - 1
    if slips <= 0 or math.isnan(run.slip_time):
        return ""
    work = run.friction_work - run.slip_work
    return f"It slips again after the lock-up, {slips} time{'s' if slips > 1 else ''}, with {short(work)} J."


def point_columns(front: EngagementFront) -> dict[str, list[str]]:
    """The table of the front."""
    points = front.points
    return {
        "peak\ntorque N m": column_of([p.peak_torque for p in points], 5),
        "friction\nwork J": column_of([p.slip_work for p in points], 6),
        "lower\nbound J": column_of([p.work_bound for p in points], 6),
        "gap\n%": [number(p.gap_percent, 3) for p in points],
        "slip\ntime s": column_of([p.run.slip_time for p in points]),
        "peak after\nlock-up N m": column_of([p.run.locked_peak_torque for p in points], 5),
        "steps of\nthe law": [str(len(set(p.times)) - 1) for p in points],
    }


def law_columns(front: EngagementFront) -> dict[str, list[str]]:
    """The known laws against the front."""
    laws = front.laws
    return {
        "law": [law.name for law in laws],
        "peak\ntorque N m": column_of([law.run.slip_peak_torque for law in laws], 5),
        "friction\nwork J": column_of([law.run.slip_work for law in laws], 6),
        "least work at\nthis peak J": column_of([law.least_work for law in laws], 6),
        "excess\n%": [number(law.excess_work_percent, 2) for law in laws],
        "least peak at\nthis work N m": column_of([law.least_peak for law in laws], 5),
        "excess of\npeak %": [number(law.excess_peak_percent, 2) for law in laws],
    }


def show_front(to: Console, front: EngagementFront) -> None:
    """The front, the known laws beside it, and what the bounds cover."""
    _clutch(to, front.clutch)
    for title, columns in (
        (f"Least friction work at a given peak, laws: {front.law_class}", point_columns(front)),
        ("Known laws against the optimum", law_columns(front)),
    ):
        rows = [list(row) for row in zip(*columns.values(), strict=True)]
        if rows:
            to.print()
            print_table(to, [Column(name, name != "law") for name in columns], rows, title=title)
    to.print()
    sentence(to, conclusion(front), "bold")
    sentence(to, f"The bounds cover {front.covers}.", "dim")


def conclusion(front: EngagementFront) -> str:
    """What the front says in a sentence or two."""
    first = front.points[0]
    said = (
        f"The least peak is {short(first.peak_torque)} N m, with {short(first.slip_work)} J of friction "
        f"work; none has "
        f"less than {short(first.work_bound)} J there."
    )
    beaten = [
        law.name
        for law in front.laws
        if law.run.slip_peak_torque > first.peak_torque and law.run.slip_work > first.slip_work
    ]
    return said + (f" That is less of both than {', '.join(beaten)}." if beaten else "")


def _clutch(to: Console, clutch: Clutch) -> None:
    for index, line in enumerate(clutch_lines(clutch)):
        sentence(to, line, "bold" if index == 0 else "")
