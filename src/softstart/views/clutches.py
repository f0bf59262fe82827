"""What is shown of an engagement of a clutch, and of optimal engagement laws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.views.drawing import (
    COLOURS,
    DASHES,
    GREY,
    MARKERS,
    drawing,
    entitle,
    head,
    line_of,
    new_figure,
)
from softstart.views.numbers import NOTHING, Table, column_of, number, printable, short, with_unit
from softstart.views.sheet import Sheet, columns_file, records_file, rows_file

if TYPE_CHECKING:
    from softstart.clutch import Clutch, Engagement, EngagementFront

MOST_EVENTS = 12
STATUS = {"LOCKED": "The clutch has locked.", "SLIPS": "The clutch slips at the end of the run."}
TRACES = {"M": "N*m", "F": "N*m", "T": "N*m", "theta": "rad", "wM": "rad/s", "wc": "rad/s"}
PHASES = ("phase", "start [s]", "end [s]", "peak torque [N*m]", "at [s]", "friction work [J]")


def _lines(clutch: Clutch) -> list[str]:
    """The clutch in a few lines."""
    area = "" if clutch.lining_area is None else f", lining area {short(clutch.lining_area)} m2"
    IM, MM, w0 = short(clutch.clutch_inertia), short(clutch.clutch_torque), short(clutch.drive_speed)
    cp, d, gap = short(clutch.stiffness), short(clutch.damping), short(clutch.gap)
    return [
        printable(clutch.name),
        f"  clutch  IM = {IM} kg m2, MM = {MM} N m, w0 = {w0} rad/s{area}",
        f"  shaft   cp = {cp} N m/rad, damping {d} N m s/rad, gap = {gap} rad",
        f"  load    Ic = {short(clutch.load_inertia)} kg m2, Mc = {short(clutch.load_torque)} N m, "
        f"{clutch.load_kind}",
        f"  law     {clutch.friction.label}, engaged at {short(clutch.friction.engaged_at)} s",
        f"  source  {printable(clutch.source)}",
    ]


# one engagement --------------------------------------------------------------------------------------------


def engagement_sheet(run: Engagement) -> Sheet:
    """Figures, traces, phases and events of an engagement."""
    peak = f"{short(run.peak_torque)} N m at {short(run.peak_time)} s, {short(run.peak_ratio)} times the mean"
    energy, values = run.energy, run.at(run.t)
    facts = [
        ("peak shaft torque", f"{peak} while the clutch slips"),
        ("peak up to the lock-up", f"{short(run.slip_peak_torque)} N m at {short(run.slip_peak_time)} s"),
        ("peak after the lock-up", with_unit(run.locked_peak_torque, "N m")),
        ("slip time", with_unit(run.slip_time, "s")),
        ("friction work", f"{short(run.friction_work)} J, {short(run.work_while_engaging)} while engaging"),
        ("work up to the lock-up", f"{short(run.slip_work)} J"),
        ("heat of the linings", with_unit(run.lining_heat, "J/m2")),
        ("work of the drive", f"{short(energy.drive)} J, balance closed to {energy.residual:.0e}"),
    ]
    again, slips = sum(phase.kind == "slip" for phase in run.phases) - 1, ""
    if again > 0 and not math.isnan(run.slip_time):
        work = f"{short(run.friction_work - run.slip_work)} J"
        slips = f" It slips again after the lock-up, {again} time{'s' * (again > 1)}, with {work}."
    traces = {f"{name} [{unit}]": values[name].tolist() for name, unit in TRACES.items()}
    events = [(event.t, event.name) for event in run.events]
    cells = {"time s": column_of([time for time, _ in events], 6), "event": [name for _, name in events]}
    return Sheet(
        title=f"{run.clutch.name}: {run.law.label}",
        lines=_lines(run.clutch),
        facts=[(name, text) for name, text in facts if text != NOTHING or name != "heat of the linings"],
        tables=[Table.of("Events", cells, ("event",), most=MOST_EVENTS)],
        found=[STATUS[run.status] + slips],
        figures={"engagement": run.plot},
        files={
            "clutch.toml": run.clutch.to_toml(),
            "traces.csv": columns_file({"t [s]": run.t.tolist(), **traces}),
            "events.csv": rows_file(("time [s]", "event"), events),
            "phases.csv": rows_file(PHASES, [list(asdict(phase).values()) for phase in run.phases]),
        },
    )


def engagement_figure(
    runs: Sequence[Engagement], title: str, labels: Sequence[str] = (), unit: tuple[float, str] = (1.0, "N m")
) -> Any:
    """Friction and shaft torque and speeds of engagements; `unit` is (size in N m, name)."""
    size, name = unit
    clutch = runs[0].clutch
    with drawing():
        figure, (friction, torque, speed) = new_figure(3, 1, (8.5, 8.0), sharex=True)
        for index, run in enumerate(runs):
            line = line_of(index, dashed=True)
            traces, label = run.at(run.t), labels[index] if labels else run.law.label
            edges = [*(one for one in run.law.starts if one < run.end_time), run.end_time]
            spans = [np.linspace(start, end, 41) for start, end in pairwise(edges)]  # a step is upright
            pieces = zip(run.law.pieces, spans, strict=False)
            law = [piece.torque(t) / size for piece, span in pieces for t in span]
            friction.plot(np.concatenate(spans), law, **line, label=label)
            torque.plot(run.t, traces["T"] / size, **line)
            torque.plot([run.peak_time], [run.peak_torque / size], "o", ms=4, color=line["color"])
            speed.plot(run.t, traces["wM"], **line)
            speed.plot(run.t, traces["wc"], color=line["color"], ls=":", lw=1.0)
            speed.axvline(run.slip_time, color=line["color"], lw=0.7, ls=":")
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


# optimal laws ----------------------------------------------------------------------------------------------


def front_sheet(front: EngagementFront) -> Sheet:
    """The optimal laws and the known ones; each law of the front is a file that --law reads."""
    points, (first, *_) = [(point, point.summary()) for point in front.points], front.points
    runs = {law.name: law.run for law in front.laws}
    beaten = [name for name, run in runs.items() if run.slip_peak_torque > first.peak_torque]
    beaten = [name for name in beaten if runs[name].slip_work > first.slip_work]
    laws = {
        f"law-{i}.csv": columns_file({"t [s]": one["times"], "M [N*m]": one["torques"]})
        for i, (_, one) in enumerate(points, start=1)
    }
    rows = [{key: one[key] for key in one if key not in ("times", "torques")} for _, one in points]
    known = {"laws.csv": records_file([law.summary() for law in front.laws])} if front.laws else {}
    return Sheet(
        title=f"{front.clutch.name}: optimal laws, {front.law_class}",
        lines=_lines(front.clutch),
        tables=[_points_table(front), _laws_table(front)],
        found=[f"The law with the least peak has less peak and work than {', '.join(beaten)}."]
        if beaten
        else [],
        notes=[f"The bounds cover {front.covers}."],
        figures={"front": front.plot},
        files={"clutch.toml": front.clutch.to_toml(), "front.csv": records_file(rows), **known, **laws},
    )


def _points_table(front: EngagementFront) -> Table:
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


def _laws_table(front: EngagementFront) -> Table:
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


def front_figure(fronts: Sequence[EngagementFront], unit: tuple[float, str] = (1.0, "N m")) -> Any:
    """Friction work over the peak of the shaft torque with the known laws, and some laws of each front."""
    size, name = unit
    with drawing():
        figure, (front, *panels) = new_figure(1, 1 + len(fronts), (4.4 + 3.2 * len(fronts), 4.6))
        for one, panel, colour in zip(fronts, panels, COLOURS, strict=False):
            peaks = [point.peak_torque / size for point in one.points]
            works, bounds = (
                [getattr(p, key) / size for p in one.points] for key in ("slip_work", "work_bound")
            )
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
            point = [law.run.slip_peak_torque / size], [law.run.slip_work / size]
            front.plot(*point, marker, ms=7, mfc="none", mew=1.6, color=colour, label=law.name)
        front.axvline(fronts[0].clutch.mean_torque / size, color=GREY, lw=0.8, ls=":")
        across = f"peak of the shaft torque, {name}     (dotted: none lower)"
        work = "J" if size == 1.0 else name
        head(front, "least work; wide dots: bound", f"friction work, {work}", across)
        front.legend(loc="center right", fontsize=8)
        entitle(figure, fronts[0].clutch.name)
    return figure
