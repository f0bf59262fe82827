"""What is shown of an engagement of a clutch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from softstart.views.drawing import GREY, drawing, entitle, head, line_of, new_figure
from softstart.views.numbers import NOTHING, TextTable, column_of, printable, short, with_unit
from softstart.views.sheet import Sheet, columns_file, rows_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softstart.clutch import Clutch, Engagement

MOST_EVENTS = 12
STATUS = {"LOCKED": "The clutch has locked.", "SLIPS": "The clutch slips at the end of the run."}
TRACES = {"M": "N*m", "F": "N*m", "T": "N*m", "theta": "rad", "wM": "rad/s", "wc": "rad/s"}
PHASES = ("phase", "start [s]", "end [s]", "peak torque [N*m]", "at [s]", "friction work [J]")


def clutch_lines(clutch: Clutch) -> list[str]:
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
        ("heat of the linings", with_unit(run.lining_heat, "J/m2").removeprefix(NOTHING)),
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
        lines=clutch_lines(run.clutch),
        facts=facts,
        tables=[TextTable.of("Events", cells, ("event",), most=MOST_EVENTS)],
        conclusions=[STATUS[run.status] + slips],
        figures={"engagement": lambda: engagement_figure([run], run.clutch.name)},
        files={
            "clutch.toml": run.clutch.to_toml(),
            "traces.csv": columns_file({"t [s]": run.t.tolist(), **traces}),
            "events.csv": rows_file(("time [s]", "event"), events),
            "phases.csv": rows_file(PHASES, [list(asdict(phase).values()) for phase in run.phases]),
        },
    )


def engagement_figure(
    runs: Sequence[Engagement], title: str, labels: Sequence[str] = (), unit: tuple[float, str] = (1.0, "N m")
) -> Figure:
    """Friction and shaft torque and speeds of engagements; `unit` is (size in N m, name)."""
    size, name = unit
    clutch = runs[0].clutch
    with drawing():
        figure, (friction, torque, speed) = new_figure(3, 1, (8.5, 8.0), sharex=True)
        for index, run in enumerate(runs):
            line = line_of(index, dashed=True)
            traces, label = run.at(run.t), labels[index] if labels else run.law.label
            edges = [*(one.start for one in run.law.pieces if one.start < run.end_time), run.end_time]
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
