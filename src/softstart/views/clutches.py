"""Engagements of a clutch and optimal laws in words, tables and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.views.drawing import COLOURS, DASHES, GREY, MARKERS, drawing, entitle, head, new_figure
from softstart.views.numbers import NOTHING, Column, Table, column_of, number, printable, short

if TYPE_CHECKING:
    from softstart.clutch import Clutch, Engagement, EngagementFront

MOST_EVENTS = 12
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


def figures_table(run: Engagement) -> Table:
    """The figures of an engagement, with unit and meaning."""
    rows = [
        ["peak torque", short(run.peak_torque), "N m", f"shaft, at {short(run.peak_time)} s"],
        ["", short(run.peak_ratio), "", "times the mean torque while the clutch slips"],
        ["  while slipping", short(run.slip_peak_torque), "N m",
         f"up to the lock-up, at {short(run.slip_peak_time)} s"],
        ["  behind it", _or_dash(run.locked_peak_torque), "N m", "after the lock-up"],
        ["slip time", _or_dash(run.slip_time), "s", "first lock-up"],
        ["friction work", short(run.friction_work), "J", "all slip"],
        ["  up to the lock-up", short(run.slip_work), "J",
         f"{short(run.work_while_engaging)} J of it while engaging"],
    ]  # fmt: skip
    if not math.isnan(run.lining_heat):
        rows.append(["lining heat", short(run.lining_heat), "J/m2", "friction work on the lining area"])
    energy = run.energy
    rows.append(["work of the drive", short(energy.drive), "J", f"balance closed to {energy.residual:.0e}"])
    columns = [Column("figure", False), Column("value"), Column("unit", False), Column("meaning", False)]
    return Table("", columns, rows)


def _or_dash(value: float) -> str:
    return NOTHING if math.isnan(value) else short(value)


def status(run: Engagement) -> str:
    """Whether the clutch has locked, and whether it slips again."""
    return STATUS[run.status] + " " + _again(run)


def events(run: Engagement) -> str:
    """The first events in one sentence."""
    first = ", ".join(f"{event.name} at {short(event.t)} s" for event in run.events[:MOST_EVENTS])
    more = len(run.events) - MOST_EVENTS
    return f"Events: {first}{f', and {more} more' if more > 0 else ''}."


def _again(run: Engagement) -> str:
    slips = sum(phase.kind == "slip" for phase in run.phases) - 1
    if slips <= 0 or math.isnan(run.slip_time):
        return ""
    work = run.friction_work - run.slip_work
    return f"It slips again after the lock-up, {slips} time{'s' if slips > 1 else ''}, with {short(work)} J."


def point_table(front: EngagementFront) -> Table:
    """The table of the front."""
    points = front.points
    cells = {
        "peak\ntorque N m": column_of([p.peak_torque for p in points], 5),
        "friction\nwork J": column_of([p.slip_work for p in points], 6),
        "lower\nbound J": column_of([p.work_bound for p in points], 6),
        "gap\n%": [number(p.gap_percent, 3) for p in points],
        "slip\ntime s": column_of([p.run.slip_time for p in points]),
        "peak after\nlock-up N m": column_of([p.run.locked_peak_torque for p in points], 5),
        "steps of\nthe law": [str(len(set(p.times)) - 1) for p in points],
    }
    return Table.of(f"Least friction work at a given peak, laws: {front.law_class}", cells)


def law_table(front: EngagementFront) -> Table:
    """The known laws compared with the front."""
    laws = front.laws
    cells = {
        "law": [law.name for law in laws],
        "peak\ntorque N m": column_of([law.run.slip_peak_torque for law in laws], 5),
        "friction\nwork J": column_of([law.run.slip_work for law in laws], 6),
        "least work at\nthis peak J": column_of([law.least_work for law in laws], 6),
        "excess\n%": [number(law.excess_work_percent, 2) for law in laws],
        "least peak at\nthis work N m": column_of([law.least_peak for law in laws], 5),
        "excess of\npeak %": [number(law.excess_peak_percent, 2) for law in laws],
    }
    return Table.of("Known laws against the optimum", cells, ("law",))


def conclusion(front: EngagementFront) -> str:
    """The least peak of the front, and the known laws that it improves on."""
    first = front.points[0]
    sentence = (
        f"The least peak is {short(first.peak_torque)} N m, with {short(first.slip_work)} J of friction "
        f"work; none has less than {short(first.work_bound)} J there."
    )
    beaten = [
        law.name
        for law in front.laws
        if law.run.slip_peak_torque > first.peak_torque and law.run.slip_work > first.slip_work
    ]
    return sentence + (f" That is less of both than {', '.join(beaten)}." if beaten else "")


def engagement_figure(
    runs: Sequence[Engagement], title: str, labels: Sequence[str] = (), unit: tuple[float, str] = (1.0, "N m")
) -> Any:
    """Friction and shaft torque, speeds and friction power of engagements; `unit` is (size in N m, name)."""
    size, name = unit
    names = labels or [run.law.label for run in runs]
    with drawing():
        figure, (friction, torque, speed) = new_figure(3, 1, (8.5, 8.0), sharex=True)
        for index, (run, label) in enumerate(zip(runs, names, strict=True)):
            style: dict[str, Any] = {"color": COLOURS[index % 8], "ls": DASHES[index % 8]}
            t, traces = run.t, run.at(run.t)
            friction.plot(*_law_points(run, size), **style, label=label)
            torque.plot(t, traces["T"] / size, **style)
            torque.plot([run.peak_time], [run.peak_torque / size], "o", ms=4, color=style["color"])
            speed.plot(t, traces["wM"], **style)
            speed.plot(t, traces["wc"], color=style["color"], ls=":", lw=1.0)
            speed.axvline(run.slip_time, color=style["color"], lw=0.7, ls=":")
        clutch = runs[0].clutch
        torque.axhline(clutch.mean_torque / size, color=GREY, lw=0.8, ls=":")
        speed.axhline(clutch.drive_speed, color=GREY, lw=0.8, ls=":")
        friction.set_ylabel(f"friction torque, {name}")
        head(torque, "points: peaks; dotted: mean while the clutch slips", f"shaft torque, {name}")
        head(speed, "clutch side; dotted: load, driving side, end of slip", "speed, rad/s", "time, s")
        speed.set_xlim(0.0, max(run.end_time for run in runs))
        friction.set_ylim(bottom=0.0)
        friction.legend(loc="lower right", handlelength=3.2)
        entitle(figure, title)
    return figure


def _law_points(run: Engagement, size: float) -> tuple[Any, Any]:
    """The law over the run piece by piece, so that a step is upright."""
    edges = [*(one for one in run.law.starts if one < run.end_time), run.end_time]
    spans = [np.linspace(start, end, 41) for start, end in pairwise(edges)]
    values = [
        [piece.torque(t) / size for t in span] for piece, span in zip(run.law.pieces, spans, strict=False)
    ]
    return np.concatenate(spans), np.concatenate(values)


def front_figure(fronts: Sequence[EngagementFront], unit: tuple[float, str] = (1.0, "N m")) -> Any:
    """Friction work over the peak of the shaft torque with the known laws, and some laws of each front."""
    size, name = unit
    work = "J" if size == 1.0 else name
    with drawing():
        figure, panels = new_figure(1, 1 + len(fronts), (4.4 + 3.2 * len(fronts), 4.6))
        front, *laws = np.atleast_1d(panels)
        for index, (one, panel) in enumerate(zip(fronts, laws, strict=True)):
            colour = COLOURS[index]
            peaks = [point.peak_torque / size for point in one.points]
            front.plot(
                peaks,
                [p.slip_work / size for p in one.points],
                "-o",
                ms=3.5,
                color=colour,
                label=one.law_class,
            )
            front.plot(peaks, [p.work_bound / size for p in one.points], color=colour, ls=DASHES[3], lw=2.5)
            for number, which in enumerate(_some(len(one.points))):
                point = one.points[which]
                t = np.append(point.times, 1.15 * point.times[-1])
                M = np.append(point.torques, point.torques[-1]) / size
                panel.plot(t, M, color=COLOURS[number + 2], ls=DASHES[number], lw=1.3,
                           label=f"peak {point.peak_torque / size:.4g} {name}")  # fmt: skip
            head(panel, f"laws, {one.law_class}", f"friction torque, {name}", "time, s")
            panel.legend(loc="lower right", fontsize=8)
        for index, law in enumerate(fronts[0].laws):
            front.plot(
                [law.run.slip_peak_torque / size], [law.run.slip_work / size], MARKERS[index], ms=7,
                mfc="none", mew=1.6, color=COLOURS[index + 3], label=law.name,
            )  # fmt: skip
        front.axvline(fronts[0].clutch.mean_torque / size, color=GREY, lw=0.8, ls=":")
        across = f"peak of the shaft torque, {name}     (dotted: none lower)"
        head(front, "least work; wide dots: bound", f"friction work, {work}", across)
        front.legend(loc="center right", fontsize=8)
        entitle(figure, fronts[0].clutch.name)
    return figure


def _some(count: int) -> list[int]:
    """Three points of a front: the first, one between, the last."""
    return sorted({0, count // 2, count - 1})
