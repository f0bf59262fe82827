"""What is shown of a start and of a comparison: words, tables, figures and the files of --out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from softstart.drive import Drive
from softstart.drive.doubts import doubts
from softstart.start.comparison import Comparison
from softstart.start.metrics import SETTLED_BAND
from softstart.start.recommendation import Row, checked_limits
from softstart.start.run import SETTLING_PERIODS, Run
from softstart.views.drawing import (
    COLOURS,
    DASHES,
    GREY,
    MARKERS,
    SHAFTS,
    drawing,
    entitle,
    head,
    legend_above,
    new_figure,
    shade_open_gap,
)
from softstart.views.drives import controllers_set_up, drive_lines
from softstart.views.markdown import file_stem, markdown
from softstart.views.numbers import Table, column_of, number, short
from softstart.views.printed import units_of
from softstart.views.sheet import Sheet, Writer, records_file, rows_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softstart.start.run import Run

STAGE_COLUMNS = ("stage", "gap", "start s", "duration s", "peak torque N m", "at s")
EVENT_COLUMNS = ("time s", "event", "at", "value", "impulse N m s")
OF_SHAFTS = {"gap closed", "gap opened", "impact", "impacts over, flanks press"}
FEW = 8  # masses
SHOWN = 24  # stages and events on a terminal
SAME_TORQUE = 1e-9  # of the torque limits: less beyond them is rounding
SIDES = {0: "open", 1: "closed, driving flank", -1: "closed, other flank"}


# one start -----------------------------------------------------------------------------------------------


def machine_lines(machine: Any, fitted_to: Drive | None = None) -> list[str]:
    """The machine in a few lines, what is doubted of it, and for which drive the controllers are set up."""
    return [
        *drive_lines(machine),
        *(f"  doubt  {one}" for one in doubts(machine)),
        *([f"  {controllers_set_up(machine, fitted_to)}"] if fitted_to else []),
    ]


def figure_rows(run: Run) -> list[list[str]]:
    """The figures of the start, as words and numbers."""

    def with_unit(value: float, unit: str) -> str:
        return f"{short(value)} {unit}" if not math.isnan(value) else "-"

    first, second = run.stage_durations
    names = run.drive.shaft_names
    where = f" in {names[run.worst_shaft]}" if len(names) > 1 else ""
    return [
        ["K_dyn", f"{number(run.k_dyn, 6)}{where}"],
        ["K_dyn of the first contact", number(run.k_dyn_first_contact, 6)],
        ["peak shaft torque", f"{with_unit(run.peak_torque, 'N m')} at {with_unit(run.peak_time, 's')}"],
        ["start time", with_unit(run.start_time, "s")],
        ["settled time", with_unit(run.settled_time, "s")],
        ["shaft torque settled from", with_unit(run.settling_time(), "s")],
        ["first contact", with_unit(run.first_contact, "s")],
        ["speed of impact", with_unit(run.impact_speed, "rad/s")],
        ["motor torque at contact", with_unit(run.torque_at_contact, "N m")],
        ["stage 1, stage 2", f"{with_unit(first, 's')}, {with_unit(second, 's')}"],
        ["contacts", str(run.contacts)],
        ["end of the run", with_unit(run.end_time, "s")],
        *([["torque cut off", clipped]] if (clipped := clipped_torque(run)) else []),
        *([] if math.isnan(run.release_time) else [["brake released", with_unit(run.release_time, "s")]]),
        *(
            [f"from {name}", f"K_dyn {number(one.k_dyn, 6)}, start time {with_unit(one.start_time, 's')}"]
            for name, one in run.positions.items()
        ),
    ]


def position_notes(runs: Sequence[Run]) -> list[str]:
    """From where each start is the worst, if the position is unknown, and what to do if it is not."""
    worst = [f"{run.controller_name} {run.position}" for run in runs if run.positions]
    if not worst:
        return []
    drive = runs[0].drive
    text = (
        "The start position is unknown: each figure is the worst of both flanks and mid-gap. K_dyn is "
        f"largest from: {', '.join(worst)}."
    )
    known = "Friction holds the load anywhere; give start.position if it is always the same."
    return [text if drive.position_given else f"{text} {known}"]


def clipped_torque(run: Any) -> str:
    """How far and how long the demand lay beyond the torque limits, "" if that need not be said.

    It is said of every controller that does not declare that it relies on the limits (`saturates`), and of
    each that answered with an infinite torque.
    """
    excess, time = run.clipped
    motor = run.drive.motor
    low, high = float(motor.minimum_torque), float(motor.maximum_torque)
    infinite = math.isinf(excess)
    if not infinite and (run.controller.saturates or excess <= SAME_TORQUE * max(abs(low), abs(high))):
        return ""
    over = "infinite" if infinite else f"up to {short(excess)} N m"
    return f"the demand is {over} beyond the limits {short(low)} and {short(high)} N m, for {short(time)} s"


def outcome(run: Run) -> str:
    """How the start ended, and what was cut off the demand."""
    clipped = clipped_torque(run)
    return f"{run.status.value} Torque cut off: {clipped}." if clipped else run.status.value


def stage_rows(run: Run) -> list[list[object]]:
    """The stages, full numbers."""
    return [
        [stage.number, SIDES[stage.side], stage.start, stage.duration, stage.peak_torque, stage.peak_time]
        for stage in run.stages
    ]


def event_rows(run: Run) -> list[list[object]]:
    """The events, full numbers, each with the shaft or mass on which it happened."""
    masses, shafts = run.drive.mass_names, run.drive.shaft_names
    return [
        [one.time, one.kind, (shafts if one.kind in OF_SHAFTS else masses)[one.place], one.value, one.impulse]
        for one in run.events
    ]


def shaft_table(run: Run) -> Table:
    """K_dyn, own factor and largest torque of each shaft, at the motor shaft and at its own, its limit."""
    own = run.peak_torques / run.drive.at_motor_shaft().torque_ratio
    cells = {
        "shaft": list(run.drive.shaft_names),
        "K": [number(k, 4) for k in run.k_dyns.tolist()],
        "over its\nown mean": [number(k, 4) for k in run.shaft_factors.tolist()],
        "torque at\nmotor shaft\nN m": column_of(run.peak_torques.tolist()),
        "torque at\nown shaft\nN m": column_of(own.tolist()),
        "at s": column_of(run.peak_times.tolist(), 5),
    }
    if run.drive.limits:
        cells["of the\npermissible\n%"] = [number(100.0 * used, 1) for used in run.utilisation.tolist()]
    return Table.of("Shafts", cells, ("shaft",))


def run_figure(run: Run) -> Any:
    """Torques, speeds and twists over time; of a single shaft grey where its gap is open."""
    single = len(run.drive.shaft_names) == 1
    with drawing():
        figure, panels = new_figure(3, 1, (8.0, 7.5), sharex=True)
        for axes in panels if single else ():
            shade_open_gap(axes, run)
        for axes, draw in zip(panels, (_torques, _speeds, _twists), strict=True):
            draw(axes, run)
            if not axes.get_legend_handles_labels()[0]:
                continue
            if single:
                legend_above(axes, 3)
            else:
                columns = 1 + len(run.drive.mass_names) // FEW
                axes.legend(fontsize=6.5, loc="center left", bbox_to_anchor=(1.0, 0.5), ncols=columns)
        panels[-1].set_xlabel(f"time, s{'     (grey: gap open)' if single else ''}")
        panels[-1].set_xlim(0.0, run.end_time)
        entitle(figure, f"{run.drive.name}: {run.controller_name}")
    return figure


def _shafts(run: Run) -> list[tuple[str, dict[str, Any]]]:
    """Name and line of each shaft."""
    names = run.drive.shaft_names if len(run.drive.shaft_names) > 1 else ("shaft torque T",)
    return [
        (name, {"color": SHAFTS[k % len(SHAFTS)], "ls": DASHES[k // len(COLOURS) % len(DASHES)]})
        for k, name in enumerate(names)
    ]


def _torques(axes: Axes, run: Run) -> None:
    axes.plot(run.t, run.u, color=COLOURS[1], ls=DASHES[1], label="motor torque u")
    peaks = run.recorded.shafts["peak"]
    for (name, line), torque, time, peak in zip(
        _shafts(run), run.T.reshape(run.t.size, -1).T, run.peak_times, peaks, strict=True
    ):
        axes.plot(run.t, torque, label=name, **line)
        axes.plot([time], [peak], "o", ms=4, color=line["color"])
    if run.k_dyn > 0.0:
        axes.axhline(run.peak_torque / run.k_dyn, color=GREY, lw=0.8, ls=":", label="K_dyn = 1")
    head(axes, f"K_dyn = {run.k_dyn:.3f}", "torque, N m")


def _speeds(axes: Axes, run: Run) -> None:
    machine, units = run.drive, units_of(run.drive)
    if len(machine.mass_names) == 2:
        axes.plot(run.t, units.shown(run.w1, "rad/s"), color=COLOURS[1], ls=DASHES[1], label="motor w1")
        axes.plot(run.t, units.shown(run.w2, "rad/s"), color=COLOURS[0], label="load w2")
    else:
        for i, name in enumerate(machine.mass_names):
            colour, dash = COLOURS[i % len(COLOURS)], DASHES[i // len(COLOURS) % len(DASHES)]
            axes.plot(run.t, units.shown(run.w[:, i], "rad/s"), color=colour, ls=dash, label=name)
    if machine.target_speed is not None:
        target = float(units.shown(machine.target_speed, "rad/s"))
        axes.axhline(target, color=GREY, lw=0.8, ls=":", label="target")
    reached = run.start_time == run.start_time
    if reached:
        axes.axvline(run.start_time, color=GREY, lw=0.8, ls=":")
    title = f"start time {run.start_time:.4f} s" if reached else run.status.value
    head(axes, title, f"speed, {units.of('rad/s')}")


def _twists(axes: Axes, run: Run) -> None:
    """The twist of a single shaft in rad, of several each in its gap."""
    gaps, twists = run.drive.gaps, run.twist.T
    if len(gaps) == 1:
        units = units_of(run.drive)
        axes.plot(run.t, units.shown(twists[0], "rad"), color=COLOURS[2])
        flanks, unit = float(units.shown(0.5 * gaps[0], "rad")), units.of("rad")
        title = "twist phi1 - phi2, flanks dashed"
    else:
        for (name, line), gap, twist in zip(_shafts(run), gaps, twists, strict=True):
            if gap > 0.0:
                axes.plot(run.t, 2.0 * twist / gap, label=name, **line)
        flanks, title, unit = 1.0, "twist over half the gap, flanks dashed", "half gaps"
    for flank in (flanks, -flanks):
        axes.axhline(flank, color="#444444", lw=0.8, ls="--")
    head(axes, title, unit)


def stage_table(run: Run) -> Table:
    """The stages."""
    stages = run.stages
    cells = (
        [str(stage.number) for stage in stages],
        [SIDES[stage.side] for stage in stages],
        column_of([stage.start for stage in stages], 5),
        column_of([stage.duration for stage in stages]),
        column_of([stage.peak_torque for stage in stages], 5),
        column_of([stage.peak_time for stage in stages], 5),
    )
    return Table.of("Stages", dict(zip(STAGE_COLUMNS, cells, strict=True)), ("gap",), most=SHOWN)


def event_table(run: Run) -> Table:
    """The events: time, what happened, and of several shafts where."""
    rows: list[Any] = event_rows(run)
    cells = {"time s": column_of([row[0] for row in rows], 6), "event": [row[1] for row in rows]}
    if len(run.drive.shaft_names) > 1:
        cells["at"] = [row[2] for row in rows]
    return Table.of("Events", cells, ("event", "at"), most=SHOWN)


def run_sheet(run: Run, fitted_to: Drive | None = None) -> Sheet:
    """What is shown of a start."""
    assert run.controller is not None
    several, stem = len(run.drive.shaft_names) > 1, file_stem(run.controller_name)
    summary = {key: value for key, value in run.summary().items() if key != "parameters"}
    return Sheet(
        f"{run.drive.name}: start under {run.controller_name}",
        [*machine_lines(run.drive, fitted_to), f"  under  {_strategy(run)}"],
        run.status.value,
        figure_rows(run),
        [*([shaft_table(run)] if several else []), stage_table(run), event_table(run)],
        notes=run.drive.warnings,
        figures={f"run-{stem}": run.plot},
        files={
            f"trace-{stem}.csv": run.to_csv,
            "stages.csv": rows_file(STAGE_COLUMNS, stage_rows(run)),
            "events.csv": rows_file(EVENT_COLUMNS, event_rows(run)),
            "figures.csv": records_file([summary]),
        },
        machine=run.drive,
        fitted_to=fitted_to,
        behind=["## The strategy", _all_digits(run)],
    )


def _strategy(run: Run) -> str:
    """The strategy of a start and its parameters, in short."""
    assert run.controller is not None
    given = run.controller.parameters.items()
    values = ", ".join(f"{key} = {short(v) if isinstance(v, float) else v}" for key, v in given)
    return f"{run.controller_name}{' (' + values + ')' if values else ''}"


def _all_digits(run: Run) -> str:
    """What the strategy of a start does, and its parameters with all digits."""
    assert run.controller is not None
    values = ", ".join(f"{key} = {value}" for key, value in run.controller.parameters.items())
    return markdown(
        ". ".join(filter(None, [type(run.controller).summary, f"Parameters: {values or 'none'}."]))
    )


# a comparison --------------------------------------------------------------------------------------------


class Figure(NamedTuple):
    """A figure of a strategy in the tables of a comparison: with `decimals`, or `digits` significant ones."""

    heading: str
    of: Callable[[Row], float]
    decimals: int | None = None
    digits: int = 4


def share_lost(row: Row) -> float:
    """Time lost until the load has settled, in per cent of the settled time of `direct`."""
    direct = row.run.settled_time - row.settled_lost
    return 100.0 * row.settled_lost / direct if direct > 0.0 else math.nan


GENTLE = (
    Figure("K_dyn", lambda row: row.run.k_dyn, 3),
    Figure("K\nworn", lambda row: row.k_dyn_worn_gap, 3),
    Figure("K\nlight", lambda row: row.k_dyn_light_load, 3),
    Figure("peak\nN m", lambda row: row.run.peak_torque),
)


def _end(name: str, index: int) -> Callable[[Row], float]:
    return lambda row: row.intervals[name][index]


INTERVALS = (
    Figure("K_dyn\nfrom", _end("k_dyn", 0), 3),
    Figure("K_dyn\nto", _end("k_dyn", 1), 3),
    Figure("peak to\nN m", _end("peak_torque", 1)),
    Figure("start\ntime to s", _end("start_time", 1)),
)
QUICK = (
    Figure("settled\ns", lambda row: row.run.settled_time),
    Figure("later\n%", share_lost, 1),
)
TIMES = (
    Figure("start\ntime s", lambda row: row.run.start_time),
    Figure("start\nlater s", lambda row: row.time_lost, digits=3),
    Figure("settled\nlater s", lambda row: row.settled_lost, digits=3),
)
AT_THE_GAP = (
    Figure("first\ncontact\ns", lambda row: row.run.first_contact, digits=3),
    Figure("u at\ncontact\nN m", lambda row: row.run.torque_at_contact, digits=3),
    Figure("stage 1\ns", lambda row: row.run.stage_durations[0], digits=3),
    Figure("stage 2\ns", lambda row: row.run.stage_durations[1], digits=3),
    Figure("K first\ncontact", lambda row: row.run.k_dyn_first_contact, 3),
    Figure("contacts", lambda row: row.run.contacts, 0),
)


def at_details(machine: Any) -> tuple[Figure, ...]:
    """The figures of what happens at the gap; of several shafts each over its own mean torque."""

    def of_shaft(k: int) -> Callable[[Row], float]:
        return lambda row: float(row.run.shaft_factors[k])

    used = Figure("torque\nused %", lambda row: row.run.used_torque, 1)
    of_limit = [] if machine.limits.used_torque is None else [used]
    if len(machine.shaft_names) == 1:
        return (*AT_THE_GAP, *of_limit)
    headings = ("over mean\n" + name.replace(" - ", " -\n") for name in machine.shaft_names)
    shafts = (Figure(heading, of_shaft(k), 3) for k, heading in enumerate(headings))
    return (*shafts, *of_limit, AT_THE_GAP[-1])


def comparison_table(
    rows: Sequence[Row], figures: Sequence[Figure] = (), title: str = "", bold: Sequence[int] = ()
) -> Table:
    """The strategies and these figures, by default all; beside K_dyn also flags and limits, where needed."""
    uncertain = INTERVALS if rows[0].intervals else ()
    figures = figures or (*GENTLE, *QUICK, *uncertain, *TIMES, *at_details(rows[0].run.drive))
    judged = GENTLE[0] in figures
    cells = {"strategy": [row.marked if judged else row.name for row in rows]}
    for figure in figures:
        values = [figure.of(row) for row in rows]
        if figure.decimals is None:
            cells[figure.heading] = column_of(values, figure.digits)
        else:
            cells[figure.heading] = [number(value, figure.decimals) for value in values]
    if judged and any(row.against_limits for row in rows):
        cells["limits"] = [row.against_limits for row in rows]
    return Table.of(title, cells, ("strategy", "limits"), bold=bold)


INTERVALS_NOTE = (
    "from, to: 95 % of the drives that the logs leave possible start within them, under the strategy as it "
    "is set up for the drive found; the limits must be kept at the upper end as well."
)
LEGEND = (
    "K worn: the backlash 4 times as wide (gap x4); K light: 0.4 times the load inertia (J2 x0.4); later: "
    "settled later than direct start."
)


def definitions(comparison: Comparison) -> list[str]:
    """What the columns mean."""
    run = comparison.rows[0].run
    base = run.peak_torque / run.k_dyn if run.k_dyn > 0.0 else math.nan
    several = len(comparison.drive.shaft_names) > 1
    nominal = f'"{comparison.fitted_to.name}"' if comparison.fitted_to else "this machine"
    found = [
        f"K_dyn = {'largest torque of all shafts at the motor shaft' if several else 'peak shaft torque'} / "
        f"{base:.4g} N m, the mean shaft torque under full starting torque.",
        f"{LEGEND} Strategies are set up for {nominal}.",
        f"settled: from then on the load speed is never more than {100.0 * SETTLED_BAND:g} % below the "
        f"target, for {SETTLING_PERIODS:g} elastic periods after the start time.",
    ]
    if checked_limits(comparison.drive):
        cases = ", ".join(("the machine as it is", *comparison.worst_case))
        found.append(f"limits: the least margin in the worst of {cases}.")
    if comparison.drive.brake == "motor":
        found.append("Times count from the command, so that they include the release of the brake.")
    return found


def remarks(comparison: Comparison) -> list[str]:
    """What the figures of these starts leave out, and which starts did not end as they should."""
    rows = comparison.rows
    return [
        *comparison.drive.warnings,
        *([INTERVALS_NOTE] if rows[0].intervals else []),
        *row_remarks(rows),
    ]


def row_remarks(rows: Sequence[Row]) -> list[str]:
    """Positions, starts that failed, torque cut off, and flags."""
    cut = [(row.name, clipped_torque(row.run)) for row in rows]
    failed = [row for row in rows if math.isnan(row.run.start_time)]
    return [
        *position_notes([row.run for row in rows]),
        *(f"{row.name}: {row.run.status.value}" for row in failed),
        *(f"{name}, torque cut off: {clipped}." for name, clipped in cut if clipped),
        *(
            f"{row.name} is flagged: {'; '.join(flag.text for flag in row.flags)}."
            for row in rows
            if row.flags and row not in failed
        ),
    ]


def comparison_figure(rows: Sequence[Row], title: str) -> Any:
    """Motor torque and torque of each shaft of several starts, one panel each."""
    runs = [row.run for row in rows]
    several = len(runs[0].drive.shaft_names) > 1
    names = ["shaft torque T"]
    if several:  # a few names fit above the first panel; of more shafts none
        names = list(runs[0].drive.shaft_names)
        names = names if len(names) < 4 else [f"_{name}" for name in names]
    with drawing():
        figure, axes = new_figure(
            len(runs), 1, (8.0, 1.0 + 1.35 * len(runs)), sharex=True, sharey=True, squeeze=False
        )
        longest = max(run.end_time for run in runs)
        for panel, row in zip(axes[:, 0], rows, strict=True):
            run = row.run
            if not several:
                shade_open_gap(panel, run)
            panel.plot(
                run.t,
                run.u,
                color=COLOURS[1],
                ls=DASHES[1],
                lw=1.1,
                label="motor" if several else "motor torque u",
            )
            for k, (name, torque) in enumerate(zip(names, run.T.reshape(run.t.size, -1).T, strict=True)):
                panel.plot(run.t, torque, color=SHAFTS[k % len(SHAFTS)], label=name)
            panel.set_title(
                f"{row.marked}:  K_dyn {run.k_dyn:.3f},  start {run.start_time:.4f} s",
                loc="left",
                fontsize=9.5,
                pad=3,
            )
            panel.set_ylabel("N m")
        named = 1 + sum(not name.startswith("_") for name in names)
        if named > 2:  # too wide to stand beside the title of a panel
            handles, labels = axes[0, 0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower right", ncols=named)
        else:
            legend_above(axes[0, 0], named)
        axes[-1, 0].set_xlabel("time, s" if several else "time, s     (grey: gap open)")
        axes[-1, 0].set_xlim(0.0, longest)
        entitle(figure, title)
    return figure


def trade_off_figure(points: Sequence[tuple[str, float, float]], title: str) -> Any:
    """K_dyn against start time, one point a strategy: (name, start time in s, K_dyn)."""
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.6))
        for index, (name, time, k) in enumerate(points):
            axes.plot(
                [time],
                [k],
                MARKERS[index % len(MARKERS)],
                ms=9,
                mfc="none",
                mew=2.0,
                color=COLOURS[index % 8],
                label=name,
                clip_on=False,
            )
        axes.axhline(1.0, color=GREY, lw=0.8, ls=":")
        axes.set_xlabel("start time, s")
        axes.set_ylabel("K_dyn")
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.08)
        axes.set_title(title, loc="left")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def comparison_sheet(comparison: Comparison, rows: Sequence[Row] = (), details: bool = True) -> Sheet:
    """What is shown of a comparison; `rows` are its rows in another order."""
    machine, rows = comparison.drive, rows or comparison.rows
    bold = [rows.index(row) for row in comparison.recommendation.shown]
    parts: list[tuple[str, tuple[Figure, ...]]] = [("", (*GENTLE, *QUICK))]
    if rows[0].intervals:
        parts.append(("Intervals of 95 %", INTERVALS))
    if details:
        several = len(machine.shaft_names) > 1
        parts += [("Times", TIMES), ("Shafts" if several else "Events in the backlash", at_details(machine))]
    reached = [row for row in rows if not math.isnan(row.run.start_time)]
    points = [(row.marked, row.run.start_time, row.run.k_dyn) for row in reached]
    figures = {"comparison": lambda: comparison_figure(rows, machine.name)}
    if points:
        figures["trade-off"] = lambda: trade_off_figure(points, machine.name)
    files: dict[str, str | Writer] = {"comparison.csv": records_file(list(map(_record, rows)))}
    stems: list[str] = []
    behind = ["## The strategies"]
    for run in (row.run for row in rows):
        stems.append(stem := file_stem(run.controller_name, stems))
        figures[f"run-{stem}"] = run.plot
        files[f"trace-{stem}.csv"] = run.to_csv
        behind.append(f"### {markdown(stem)}\n\n{_all_digits(run)}\n\n![{stem}](run-{stem}.svg)")
    return Sheet(
        f"{machine.name}: soft-start strategies compared",
        machine_lines(machine, comparison.fitted_to),
        tables=[comparison_table(rows, which, title, bold) for title, which in parts],
        found=[comparison.recommendation.text],
        notes=[
            *(definitions(comparison) if details else [f"{LEGEND} More: --details."]),
            *remarks(comparison),
        ],
        figures=figures,
        files=files,
        machine=machine,
        fitted_to=comparison.fitted_to,
        behind=behind,
    )


def _record(row: Row) -> dict[str, Any]:
    """The figures of a strategy under the names of JSON, each limit with a column of its own."""
    found = row.summary() | {"flags": "; ".join(flag.text for flag in row.flags)}
    found |= {f"margin_{one['limit'].replace(' ', '_')}": one["margin"] for one in found.get("limits", ())}
    return {key: value for key, value in found.items() if key not in ("parameters", "status_text", "limits")}
