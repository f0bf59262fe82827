"""What is shown of a start and of a comparison: words, tables, figures and the files of --out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from softstart.controller.parameters import declared_parameters
from softstart.drive import Drive, Machine
from softstart.drive.plausibility import plausibility_warnings
from softstart.errors import Sentence
from softstart.start.comparison import SOFT_END, Comparison
from softstart.start.duty import DutyRun
from softstart.start.kernel_input import SETTLED_BAND, SETTLING_PERIODS
from softstart.start.recommendation import Recommendation, Row, checked_limits, margins_of
from softstart.start.run import Run, Stage
from softstart.views.drives import controllers_set_up, drive_lines
from softstart.views.markdown import file_stem, markdown
from softstart.views.numbers import (
    DataColumn,
    TextTable,
    label,
    number,
    seen,
    short,
    titled,
    units_of,
    with_unit,
)
from softstart.views.sheet import Sheet, Writer, records_file, rows_file
from softstart.views.traces import comparison_figure, draw_trade_off, run_figure, torques, trade_off_figure

EVENT_COLUMNS = ("time s", "event", "at", "value", "impulse N m s")
OF_SHAFTS = {"gap closed", "gap opened", "impact", "impacts over, flanks press"}
SHOWN = 24  # stages and events on a terminal
SAME_TORQUE = 1e-9  # of the torque limits: less beyond them is rounding
SIDES = {0: "open", 1: "closed, driving flank", -1: "closed, other flank"}


# one start -----------------------------------------------------------------------------------------------


def machine_lines(machine: Machine, fitted_to: Machine | None = None) -> list[str]:
    """The machine in a few lines, what is doubted of it, and for which drive the controllers are set up."""
    return [
        *drive_lines(machine),
        *(f"  doubt  {warning}" for warning in plausibility_warnings(machine)),
        f"  {controllers_set_up(machine, fitted_to)}" if fitted_to else "",
    ]


def figure_rows(run: Run) -> list[list[str]]:
    """The figures of the start, as words and numbers; of an unknown position some are those of one start.

    Those that the start does not have are empty.
    """
    first, second = run.stage_durations
    of_one = f" from {run.position}" if run.positions else ""
    names, released = run.drive.shaft_names, not math.isnan(run.release_time)
    units, gear = units_of(run.drive), run.drive.gear
    there = seen(run.peak_torque, "N*m", units._replace(gear=gear)) if gear and not units.gear else ""
    where = f" in {names[run.worst_shaft]}" if len(names) > 1 else ""
    return [
        ["K_dyn", f"{number(run.k_dyn, 6)}{where}"],
        ["K_dyn of the first contact", number(run.k_dyn_first_contact, 6)],
        ["peak shaft torque", f"{seen(run.peak_torque, 'N*m', units)} at {with_unit(run.peak_time, 's')}"],
        ["the same at the output", there],
        ["start time", with_unit(run.start_time, "s")],
        ["settled time", with_unit(run.settled_time, "s")],
        ["overshoot", overshoot_of(run)],
        ["shaft torque settled after", with_unit(run.settling_time(), "s")],
        ["first contact", f"{with_unit(run.first_contact, 's')}{of_one}"],
        ["speed of impact", seen(run.impact_speed, "rad/s", units)],
        ["motor torque at contact", f"{seen(run.torque_at_contact, 'N*m', units)}{of_one}"],
        ["stage 1, stage 2", f"{with_unit(first, 's')}, {with_unit(second, 's')}{of_one}"],
        ["contacts", f"{run.contacts}{of_one}"],
        ["end of the run", f"{with_unit(run.end_time, 's')}{of_one}"],
        ["torque cut off", clipped_torque(run)],
        ["limits", "; ".join(map(str, margins_of(run)))],
        ["brake released", f"{with_unit(run.release_time, 's')}{of_one}" if released else ""],
        *(
            [
                f"from {name}",
                f"K_dyn {number(one.k_dyn, 6)}, {one.limited_name} {with_unit(one.limited_time, 's')}",
            ]
            for name, one in run.positions.items()
        ),
    ]


def overshoot_of(run: Run) -> str:
    """The overshoot and the band in which the load settles; "" under a torque strategy."""
    if not run.regulated:
        return ""
    return f"{100.0 * run.overshoot:.3g} % (settled: within {100.0 * run.band:.3g} % of the target)"


def position_notes(runs: Sequence[Run]) -> list[str]:
    """From where each start is the worst, if the position is unknown, and what to do if it is not."""
    worst = [f"{run.controller_name} {run.position}" for run in runs if run.positions]
    if not worst:
        return []
    text = (
        "The start position is unknown: K_dyn, torques, impacts and times of a start are the worst of both "
        "flanks and mid-gap; curves, stages and contacts belong to the start with the largest torque: "
        f"{', '.join(worst)}."
    )
    advice = "Give start.position if it is always the same."
    return [Sentence(text, "" if runs[0].drive.position_given else advice)]


def clipped_torque(run: Run) -> str:
    """How far and how long the demand lay beyond the torque limits, "" if that need not be said.

    It is said of every controller that does not declare that it relies on the limits (`saturates`), and of
    each that answered with an infinite torque.
    """
    excess, time = run.clipped
    motor, units = run.drive.motor, units_of(run.drive)
    low, high = float(motor.minimum_torque), float(motor.maximum_torque)
    infinite = math.isinf(excess)
    saturates = run.controller is not None and run.controller.saturates
    if not infinite and (saturates or excess <= SAME_TORQUE * max(abs(low), abs(high))):
        return ""
    over = "infinite" if infinite else f"up to {seen(excess, 'N*m', units)}"
    least, most = short(float(units.shown(low, "N*m"))), seen(high, "N*m", units)
    return f"the demand is {over} beyond the limits {least} and {most}, for {short(time)} s"


def outcome(run: Run) -> str:
    """How the start ended, what was cut off the demand, and what is doubted of the settings."""
    clipped = clipped_torque(run)
    cut = [f"Torque cut off: {clipped}."] if clipped else []
    return " ".join([run.status.value, *cut, *run.doubts])


def _gap_in(stage: Stage) -> str:
    """On which flank the gap is; without a gap on none, and never open."""
    return SIDES[stage.side] if stage.side or stage.number % 2 else "closed"


STAGES = (
    DataColumn("stage", lambda stage: stage.number, 0),
    DataColumn("gap", _gap_in),
    DataColumn("start s", lambda stage: stage.start, digits=5),
    DataColumn("duration s", lambda stage: stage.duration),
    DataColumn("peak torque N m", lambda stage: stage.peak_torque, digits=5, si="N*m"),
    DataColumn("at s", lambda stage: stage.peak_time, digits=5),
)
EVENTS = (  # of `event_rows`
    DataColumn("time s", lambda row: row[0], digits=6),
    DataColumn("event", lambda row: row[1]),
    DataColumn("at", lambda row: row[2]),
)


def event_rows(run: Run) -> list[list[Any]]:
    """The events, full numbers, each with the shaft or mass on which it happened."""
    masses, shafts = run.drive.mass_names, run.drive.shaft_names
    return [
        [one.time, one.kind, (shafts if one.kind in OF_SHAFTS else masses)[one.place], one.value, one.impulse]
        for one in run.events
    ]


def _start_tables(run: Run) -> list[TextTable]:
    """The shafts of a chain, the stages, and the events: time, what happened, and where."""
    events = EVENTS if len(run.drive.shaft_names) > 1 else EVENTS[:-1]
    return [
        *([] if isinstance(run.drive, Drive) else [shaft_table(run)]),
        TextTable.of_data("Stages", STAGES, run.stages, units_of(run.drive), most=SHOWN),
        TextTable.of_data("Events", events, event_rows(run), most=SHOWN),
    ]


def shaft_table(run: Run) -> TextTable:
    """K_dyn, own factor and largest torque of each shaft, at the motor shaft and at its own, its limit."""
    own = run.peak_torques / run.drive.at_motor_shaft().torque_ratio
    columns = [
        DataColumn("shaft", lambda k: run.drive.shaft_names[k]),
        DataColumn("K", lambda k: float(run.k_dyns[k]), 4),
        DataColumn("over its\nown mean", lambda k: float(run.shaft_factors[k]), 4),
        DataColumn("torque at\nmotor shaft\nN m", lambda k: float(run.peak_torques[k]), si="N*m"),
        DataColumn("torque at\nown shaft\nN m", lambda k: float(own[k]), si="N*m"),
        DataColumn("at s", lambda k: float(run.peak_times[k]), digits=5),
    ]
    if run.drive.limits:
        columns.append(DataColumn("of the\npermissible\n%", lambda k: 100.0 * float(run.utilisation[k]), 1))
    return TextTable.of_data("Shafts", columns, range(len(run.drive.shaft_names)), units_of(run.drive))


def run_sheet(run: Run, fitted_to: Drive | None = None) -> Sheet:
    """What is shown of a start."""
    assert run.controller is not None
    values, stem = parameters_of(run), file_stem(run.controller_name)
    summary = {key: value for key, value in run.summary().items() if key != "parameters"}
    return Sheet(
        titled(f"{run.drive.name}: start under {run.controller_name}", units_of(run.drive)),
        [
            *machine_lines(run.drive, fitted_to),
            f"  under  {run.controller_name}{' (' + values + ')' if values else ''}",
        ],
        run.status.value,
        figure_rows(run),
        _start_tables(run),
        notes=[*run.doubts, *run.drive.warnings],
        figures={f"run-{stem}": lambda: run_figure(run)},
        panel=lambda ax: torques(ax, run),
        files={
            f"trace-{stem}.csv": run.to_csv,
            "stages.csv": rows_file(
                [column.heading for column in STAGES],
                [[column.of(stage) for column in STAGES] for stage in run.stages],
            ),
            "events.csv": rows_file(EVENT_COLUMNS, event_rows(run)),
            "figures.csv": records_file([summary]),
        },
        machine=run.drive,
        fitted_to=fitted_to,
        behind=["## The strategy", markdown(what_it_does(run))],
    )


def parameters_of(run: Run | DutyRun) -> str:
    """The parameters with which the strategy of a start is set up, each value in its unit.

    >>> from softstart import simulate
    >>> parameters_of(simulate("crane-4amtkf", "ramp"))
    'initial = 7.16 N m, time = 0.111803 s, full_torque = 62 N m, period = 0.001 s'
    """
    assert run.controller is not None
    declared = declared_parameters(run.controller)
    units, si = units_of(run.drive), {name: one.unit for name, one in declared.items()}
    return ", ".join(
        f"{key} = {seen(value, si.get(key, '1'), units) if isinstance(value, float) else value}"
        for key, value in run.controller.parameters.items()
    )


def what_it_does(run: Run) -> str:
    """What the strategy of a start does, and its parameters as --param takes them, with all digits."""
    assert run.controller is not None
    declared = declared_parameters(run.controller)
    values = ", ".join(
        f"{key} = {value}{label('', declared[key].unit, ' ') if key in declared else ''}"
        for key, value in run.controller.parameters.items()
    )
    where = " at the motor shaft" if units_of(run.drive).gear else ""
    return ". ".join(filter(None, [type(run.controller).summary, f"Parameters{where}: {values or 'none'}."]))


# a comparison --------------------------------------------------------------------------------------------


def share_lost(row: Row) -> float:
    """Time lost until the load has settled, in per cent of the settled time of `direct`."""
    direct = row.run.settled_time - row.settled_lost
    return 100.0 * row.settled_lost / direct if direct > 0.0 else math.nan


PEAK_COLUMNS = (
    DataColumn("K_dyn", lambda row: row.run.k_dyn, 3),
    DataColumn("K\nworn", lambda row: row.k_dyn_worn_gap, 3),
    DataColumn("K\nlight", lambda row: row.k_dyn_light_load, 3),
    DataColumn("peak\nN m", lambda row: row.run.peak_torque, si="N*m"),
)


def _latest(row: Row) -> float:
    """The upper end of the start time; of the settled time under a strategy that holds the speed."""
    return row.intervals["settled_time" if row.run.regulated else "start_time"][1]


INTERVALS = (
    DataColumn("K_dyn\nfrom", lambda row: row.intervals["k_dyn"][0], 3),
    DataColumn("K_dyn\nto", lambda row: row.intervals["k_dyn"][1], 3),
    DataColumn("peak to\nN m", lambda row: row.intervals["peak_torque"][1], si="N*m"),
    DataColumn("start\ntime to s", _latest),
)
TIME_COLUMNS = (
    DataColumn("settled\ns", lambda row: row.run.settled_time),
    DataColumn("later\n%", share_lost, 1),
    DataColumn("over-\nshoot %", lambda row: 100.0 * row.run.overshoot, 1, optional=True),
)
START_TIME = DataColumn("start\ntime s", lambda row: row.run.start_time)
SETTLED_LATER = DataColumn("settled\nlater s", lambda row: row.settled_lost, digits=3)
TIMES = (START_TIME, SETTLED_LATER)
CONTACTS = DataColumn("contacts", lambda row: row.run.contacts, 0)
AT_THE_GAP = (
    DataColumn("first\ncontact\ns", lambda row: row.run.first_contact, digits=3),
    DataColumn("u at\ncontact\nN m", lambda row: row.run.torque_at_contact, digits=3, si="N*m"),
    DataColumn("stage 1\ns", lambda row: row.run.stage_durations[0], digits=3),
    DataColumn("stage 2\ns", lambda row: row.run.stage_durations[1], digits=3),
    DataColumn("K first\ncontact", lambda row: row.run.k_dyn_first_contact, 3),
    CONTACTS,
)


def at_details(machine: Machine) -> tuple[DataColumn, ...]:
    """The figures of what happens at the gap; of several shafts each over its own mean torque."""

    def of_shaft(k: int) -> Callable[[Row], float]:
        return lambda row: float(row.run.shaft_factors[k])

    used = DataColumn("torque\nused %", lambda row: row.run.used_torque, 1)
    of_limit = [] if machine.limits.used_torque is None else [used]
    if len(machine.shaft_names) == 1:
        return (*AT_THE_GAP, *of_limit)
    headings = ("over mean\n" + name.replace(" - ", " -\n") for name in machine.shaft_names)
    shafts = (DataColumn(heading, of_shaft(k), 3) for k, heading in enumerate(headings))
    return (*shafts, *of_limit, CONTACTS)


def comparison_table(
    rows: Sequence[Row], figures: Sequence[DataColumn] = (), title: str = "", bold: Sequence[int] = ()
) -> TextTable:
    """The strategies and these figures, by default all; beside K_dyn also flags and limits, where needed."""
    figures = figures or (
        *PEAK_COLUMNS,
        *TIME_COLUMNS,
        *of_the_unknown(rows),
        *TIMES,
        *at_details(rows[0].run.drive),
    )
    judged = PEAK_COLUMNS[0] in figures
    # several values of a strategy do not fit into a column: they are among the remarks
    fits = all(len(row.setting) <= 1 for row in rows)

    def name(row: Row) -> str:
        return f"{row.marked if judged else row.name}{', set' if row.setting and not fits else ''}"

    columns = [DataColumn("strategy", name), *figures]
    if judged and fits and any(row.setting for row in rows):
        columns.append(DataColumn("set to", lambda row: row.set_to))
    if judged and any(row.against_limits for row in rows):
        columns.append(DataColumn("limits", lambda row: row.against_limits))
    return TextTable.of_data(title, columns, rows, units_of(rows[0].run.drive), bold=bold)


def at_soft_end(rows: Sequence[Row]) -> tuple[DataColumn, ...]:
    """K_dyn at the soft end of an unknown stiffness, if it is unknown."""
    figure = DataColumn("K\nsoft", lambda row: row.cases[SOFT_END].k_dyn, 3)
    return (figure,) if SOFT_END in rows[0].cases else ()


def of_the_unknown(rows: Sequence[Row]) -> tuple[DataColumn, ...]:
    """What is shown besides of a drive that is known within intervals, or whose stiffness is unknown."""
    return INTERVALS if rows[0].intervals else at_soft_end(rows)


def no_stiffness(stiff: Any, soft: Any) -> str:
    """What is computed for a drive whose stiffness is not known."""
    return (
        f"No stiffness is known. Strategies are set up for the stiff end, elastic frequency {hertz(stiff)} "
        f"Hz; K soft: so set up at the soft end, {hertz(soft)} Hz, where limits must be kept as well."
    )


def hertz(drive: Any) -> str:
    """The elastic frequency of a drive as it is said."""
    return f"{float(drive.Omega) / math.tau:.3g}"


def both_ends(comparison: Comparison) -> list[str]:
    """How the choice differs between both ends of an unknown stiffness; nothing where it is known."""
    if comparison.soft_end is None:
        return []
    ends = comparison.drive, comparison.soft_end.drive
    choices = comparison.recommendation, comparison.at_this_end, comparison.soft_end.recommendation
    both, at_stiff, at_soft = map(_chosen, choices)
    same = len({tuple(row.name for row in choice.shown) for choice in choices}) == 1
    return [
        no_stiffness(*ends),
        Sentence(
            f"For both ends: {both}. If it were known to be at {hertz(ends[0])} Hz: {at_stiff}; at "
            f"{hertz(ends[1])} Hz, and set up for it: {at_soft}. "
            f"The choice {'is the same in all cases' if same else 'depends on the stiffness'}.",
            "Give shaft.elastic_frequency, from the oscillation of the speed in a log, or a stiffness.",
        ),
    ]


def _chosen(choice: Recommendation) -> str:
    """The strategies that a recommendation shows, with their K_dyn."""
    word = "Pareto-optimal" if choice.recommended is None else "recommended"
    shown = [f"{row.name} (K_dyn {row.run.k_dyn:.3f})" for row in choice.shown]
    return f"{word} {', '.join(shown)}" if shown else "no strategy keeps the limits"


INTERVALS_NOTE = (
    "from, to: 95 % of the drives that the logs leave possible start within them, under the strategy as it "
    "is set up for the drive found; the limits must be kept at the upper end as well."
)
LEGEND = (
    "K worn: the backlash 4 times as wide (gap x4); K light: 0.4 times the load inertia (J2 x0.4); later: "
    "settled later than direct start."
)


def settled_means(rows: Sequence[Row]) -> str:
    """What `settled` is under each kind of strategy that is among these."""
    held: dict[float, list[str]] = {}
    for row in (row for row in rows if row.run.regulated):
        held.setdefault(float(f"{100.0 * row.run.band:.3g}"), []).append(row.name)
    kinds = [f"within {band:g} % of the target ({', '.join(names)})" for band, names in held.items()]
    if any(not row.run.regulated for row in rows):
        who = " (torque strategies)" if held else ""
        kinds.append(
            f"not below {100.0 * (1.0 - SETTLED_BAND):g} % of the target, judged for {SETTLING_PERIODS:g} "
            f"elastic periods after the start time{who}"
        )
    return f"settled: the time from which on the load speed is {'; '.join(kinds)}."


def definitions(comparison: Comparison) -> list[str]:
    """What the columns mean."""
    run, units = comparison.rows[0].run, units_of(comparison.drive)
    base = run.peak_torque / run.k_dyn if run.k_dyn > 0.0 else math.nan
    several = len(comparison.drive.shaft_names) > 1
    nominal = f'"{comparison.fitted_to.name}"' if comparison.fitted_to else "this machine"
    found = [
        f"K_dyn = {'largest torque of all shafts at the motor shaft' if several else 'peak shaft torque'} / "
        f"{units.shown(base, 'N*m'):.4g} {units.label('N*m')}, the mean shaft torque under full starting "
        "torque.",
        f"{LEGEND} Strategies are set up for {nominal}.",
        settled_means(comparison.rows),
    ]
    if checked_limits(comparison.drive):
        cases = ", ".join(("the machine as it is", *comparison.worst_case))
        found.append(f"limits: the smallest margin in the worst of {cases}.")
        if comparison.drive.limits.output_torque is not None or units.gear:
            found.append(
                "output torque: that of the shaft through the gear with its losses, as all torques there."
            )
    if comparison.drive.brake == "motor":
        found.append("Times count from the command, so that they include the release of the brake.")
    return found


def short_notes(rows: Sequence[Row]) -> list[str]:
    """What the columns of the table without details mean."""
    band = [settled_means(rows)] if any(row.run.regulated for row in rows) else []
    return [f"{LEGEND} More: --details.", *band]


def remarks(comparison: Comparison) -> list[str]:
    """What the figures of these starts leave out, and which starts did not end as they should."""
    rows = comparison.rows
    cut = [(row.name, clipped_torque(row.run)) for row in rows]
    failed = [row for row in rows if math.isnan(row.run.limited_time)]
    return [
        *comparison.drive.warnings,
        *(
            f"{row.name} is set to {row.set_to}."
            for row in rows
            if row.setting and comparison.at_time is None
        ),
        *([INTERVALS_NOTE] if rows[0].intervals else []),
        *position_notes([row.run for row in rows]),
        *(f"{row.name}: {row.run.status.value}" for row in failed),
        *(f"{name}, torque cut off: {clipped}." for name, clipped in cut if clipped),
        *(doubt for row in rows for doubt in row.run.doubts),
        *(
            f"{row.name} is flagged: {'; '.join(flag.text for flag in row.flags)}."
            for row in rows
            if row.flags and row not in failed
        ),
    ]


def comparison_sheet(comparison: Comparison, rows: Sequence[Row] = (), details: bool = True) -> Sheet:
    """What is shown of a comparison; `rows` are its rows in an order other than by K_dyn."""
    machine = comparison.drive
    rows = rows or sorted(comparison.rows, key=lambda row: row.run.k_dyn)
    bold = [rows.index(row) for row in comparison.recommendation.shown]
    parts: list[tuple[str, tuple[DataColumn, ...]]] = [
        ("", (*PEAK_COLUMNS, *at_soft_end(rows), *TIME_COLUMNS))
    ]
    if rows[0].intervals:
        parts.append(("Intervals of 95 %", INTERVALS))
    if details:
        several = len(machine.shaft_names) > 1
        parts += [("Times", TIMES), ("Shafts" if several else "Events in the backlash", at_details(machine))]
    reached = [row for row in rows if not math.isnan(row.run.settled_time)]
    points = [(row.marked, row.run.settled_time, row.run.k_dyn) for row in reached]
    figures = {"comparison": lambda: comparison_figure(rows, machine.name)}
    if points:
        figures["trade-off"] = lambda: trade_off_figure(points, title=machine.name, time="settled time")
    records = list(map(_record, rows))
    files: dict[str, str | Writer] = {"comparison.csv": records_file(records)}
    stems: list[str] = []
    behind = ["## The strategies"]
    for run in (row.run for row in rows):
        stems.append(stem := file_stem(run.controller_name, stems))
        figures[f"run-{stem}"] = partial(run_figure, run)
        files[f"trace-{stem}.csv"] = run.to_csv
        behind.append(f"### {markdown(stem)}\n\n{markdown(what_it_does(run))}\n\n![{stem}](run-{stem}.svg)")
    return Sheet(
        titled(f"{machine.name}: soft-start strategies compared", units_of(machine)),
        machine_lines(machine, comparison.fitted_to),
        tables=[comparison_table(rows, which, title, bold) for title, which in parts],
        conclusions=[
            *filter(None, [comparison.at_equal_time]),
            comparison.recommendation.text,
            *both_ends(comparison),
        ],
        notes=[
            *(definitions(comparison) if details else short_notes(rows)),
            *(one.within(comparison.at_time or math.nan) for one in comparison.too_slow),
            *remarks(comparison),
        ],
        figures=figures,
        panel=lambda ax: draw_trade_off(ax, points, title=machine.name, time="settled time"),
        records=records,
        files=files,
        machine=machine,
        fitted_to=comparison.fitted_to,
        behind=behind,
    )


def _record(row: Row) -> Mapping[str, Any]:
    """The figures of a strategy under the names of JSON, each limit with a column of its own."""
    found = row.summary() | {"flags": "; ".join(flag.text for flag in row.flags), "set_to": row.set_to}
    found |= {f"margin_{one['limit'].replace(' ', '_')}": one["margin"] for one in found.get("limits", ())}
    return {
        key: value
        for key, value in found.items()
        if key not in ("parameters", "status_text", "limits", "at_output")
    }
