"""What is shown of a machine in a duty under one strategy and under several: words, tables, figures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.arrays import Vector
from softstart.chain.model import Chain
from softstart.drive import DutyStep, Machine
from softstart.errors import InputError
from softstart.start.duty import DutyRun, StepRun
from softstart.start.duty_comparison import DutyComparison, DutyRow
from softstart.start.duty_life import SECONDS_PER_HOUR, DutyLife, ShaftLife
from softstart.start.recommendation import Margin
from softstart.views.drawing import (
    DASHES,
    GREY,
    LIMIT,
    MOTOR,
    drawing,
    entitle,
    head,
    heat_map,
    legend_beside,
    new_figure,
)
from softstart.views.fatigue import SPECTRUM, estimated_damping, slope_sentence
from softstart.views.markdown import file_stem
from softstart.views.numbers import (
    DataColumn,
    TextTable,
    number,
    plural,
    seen,
    short,
    titled,
    units_of,
    with_unit,
)
from softstart.views.sheet import Sheet, Writer, columns_file, rows_file
from softstart.views.starts import machine_lines, parameters_of
from softstart.views.traces import masses_of, shafts_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# of the values of a step: unit in SI
ASKED = {
    "set_speed": "rad/s", "time": "s", "angle": "rad", "braking_torque": "N*m", "brake_speed": "rad/s",
    "brake_time": "s", "torque": "N*m", "kind": "", "inertia": "kg*m^2", "friction": "N*m", "mass": "",
}  # fmt: skip
ANEW = "strategy, anew in the other direction"  # `StepRun.how`
ROUNDING = 1e-9  # of the mean torque
IDLE = 0.01  # of set speed times time: the load hardly moves
SAME_RATE = 0.01  # relative difference of two numbers of starts per hour that is no contradiction
LETTER = 0.0085  # share of the figure that a letter of the label of a step needs
PLOT_POINTS = 1500  # of one step
BEFORE = 0.08  # share of a step that is shown before it
EQUIVALENT = (
    "Damage-equivalent torque: one 0-T-0 cycle in each cycle of the duty causes the same damage (rainflow "
    "cycles of the whole trace after ASTM E1049, Miner's rule, no endurance limit)."
)


# steps -----------------------------------------------------------------------------------------------------


def asked_of(step: DutyStep, machine: Machine) -> str:
    """What a step is to do, in words, with the values that it is given.

    >>> from softstart import Drive
    >>> asked_of(DutyStep("jog", time="200 ms", repeat=3), Drive.load("crane-4amtkf"))
    'jog 0.2 s, 3 times'
    """
    units, given = units_of(machine), step.given()
    parts = []
    for key, si in ASKED.items():
        if key not in given:
            continue
        value = given[key]
        text = value if isinstance(value, str) else seen(value, si, units)
        name = "" if key in ("set_speed", "time", "angle") else key.replace("_", " ") + " "
        parts.append(f"{name}{text}")
    parts += [f"{step.repeat:g} times"] if step.repeat > 1.0 else []
    return " ".join([step.do, ", ".join(parts)]).strip()


def how_of(run: DutyRun, row: StepRun) -> str:
    """How a step was carried out, and whether that is the stop by default or the configured one."""
    if row.how == ANEW:
        return "plugging"
    return f"{row.how} ({run.stop_setting})" if row.configured else row.how


def against_limits(margins: Sequence[Margin]) -> str:
    """The margin that decides, and to which limit."""
    least = min(margins, key=lambda one: one.share, default=None)
    return "" if least is None else f"{least.brief}, {least.seen[0]}"


def _least(margins: Sequence[Margin], what: str) -> Any:
    """The margin that decides in per cent, negative where the limit is exceeded, or the name of its limit."""
    least = min(margins, key=lambda one: one.share, default=None)
    if what == "name":
        return "" if least is None else least.seen[0]
    return math.nan if least is None else 100.0 * least.share


def name_of(row: StepRun) -> str:
    """The number of a step and what it does."""
    return f"{row.number}, {row.step.do}"


def _torque(run: DutyRun, value: float) -> float:
    """A torque without what is rounding."""
    return float(value) if abs(value) > ROUNDING * run.base_torque else 0.0


def place_of(row: StepRun | None) -> str:
    """Where a margin is: in a step, or, without one, in the life."""
    return "the life" if row is None else f"step {name_of(row)}"


def step_columns(run: DutyRun, life: DutyLife | None) -> tuple[DataColumn, ...]:
    """The columns of the table of steps."""
    shares = None if life is None else 100.0 * life.worst.shares
    return (
        DataColumn("step", lambda row: str(row.number)),
        DataColumn("to do", lambda row: asked_of(row.step, run.drive)),
        DataColumn("how", lambda row: how_of(run, row)),
        DataColumn("K_dyn", run.k_dyn_of, 3),
        DataColumn("largest\ntorque N m", lambda row: _torque(run, row.largest.max()), si="N*m"),
        DataColumn("smallest\ntorque N m", lambda row: _torque(run, row.smallest.min()), si="N*m"),
        DataColumn("margin\n%", lambda row: _least(run.margins_of(row), "share"), 1, optional=True),
        DataColumn("to the limit", lambda row: _least(run.margins_of(row), "name"), optional=True),
        DataColumn("damage\n%", lambda row: math.nan if shares is None else float(shares[row.number - 1]), 1,
                   optional=True),
        DataColumn("impulse\nN m s", lambda row: float(row.impulses.max()) or math.nan, optional=True),
        DataColumn("impact\nenergy J", lambda row: float(row.impact_energy.sum()), digits=3),
        DataColumn("contacts", lambda row: row.contacts, 0),
        DataColumn("time s", lambda row: row.time),
        DataColumn("settled\ns" if run.regulated else "start\ntime s", lambda row: row.start_time,
                   optional=True),
        DataColumn("angle\nrad", lambda row: row.angle, si="rad"),
    )  # fmt: skip


def shaft_tables(run: DutyRun) -> list[TextTable]:
    """Of several shafts a row each: its largest |T| in each step, at the motor shaft, and what it permits."""
    names = run.drive.shaft_names
    if len(names) == 1:
        return []
    units = units_of(run.drive)
    peaks = np.array([units.shown(row.peak_torques, "N*m") for row in run.rows])
    columns = [DataColumn("shaft", lambda k: names[k])]
    columns += [DataColumn(name_of(row), lambda k, i=i: float(peaks[i, k])) for i, row in enumerate(run.rows)]  # type: ignore[misc]
    used = 100.0 * peaks.max(axis=0) / units.shown(run.drive.permissible_torques, "N*m")
    columns.append(DataColumn("of the\npermissible %", lambda k: float(used[k]), 1, optional=True))
    title = f"Largest torque of each shaft at the motor shaft, {units.label('N*m')}"
    return [TextTable.of_data(title, columns, range(len(names)))]


# life ------------------------------------------------------------------------------------------------------


def rough(value: float) -> str:
    """A life, two digits: the last contacts of a rattling machine depend on more than is known of it.

    >>> rough(31482.0), rough(2.519), rough(1.4163e6), rough(math.nan)
    ('31000', '2.5', '1.4e+06', '-')
    """
    return short(float(f"{value:.2g}"))


LIFE = (
    DataColumn("shaft", lambda one: one.shaft),
    DataColumn("equivalent\ntorque N m", lambda one: one.equivalent_torque, si="N*m"),
    DataColumn("cycles to\nfailure", lambda one: one.cycles, text=rough, optional=True),
    DataColumn("hours", lambda one: one.hours, text=rough, optional=True),
    DataColumn("shifts", lambda one: one.shifts, text=rough, optional=True),
    DataColumn("years", lambda one: one.years, text=rough, optional=True),
)


def life_table(life: DutyLife, machine: Machine) -> TextTable:
    """The lives of the shafts."""
    return TextTable.of_data("Life", LIFE, life.shafts, units_of(machine))


def life_length(one: ShaftLife) -> str:
    """A life in cycles, shifts and years; "" where it is not known."""
    parts = ((one.cycles, "cycles"), (one.hours, "h"), (one.shifts, "shifts"), (one.years, "years"))
    return ", ".join(f"{rough(value)} {unit}" for value, unit in parts if not math.isnan(value))


def life_or_reason(run: DutyRun, slope: float | None) -> tuple[DutyLife | None, str]:
    """The life of a machine in a duty, or why there is none."""
    try:
        return run.life(slope), ""
    except InputError as error:
        return None, str(error)


def life_conclusion(run: DutyRun, life: DutyLife) -> str:
    """The shaft with the shortest life, and the step that takes most of it."""
    worst = life.worst
    number = int(worst.shares.argmax()) + 1
    step = next(row for row in run.rows if row.number == number)
    where = f" of {worst.shaft}" if len(life.shafts) > 1 else ""
    most = f"most damage in step {name_of(step)} ({100.0 * worst.shares[number - 1]:.3g} %)"
    length = life_length(worst)
    if not length:
        torque = f"damage-equivalent torque {_in_words(worst.equivalent_torque, run.drive)}"
        return f"Life{where}: {torque}, {most}."
    used, required = life.margin(run.drive.limits), float(run.drive.limits.life or 0.0)
    reached = "" if used is None else "reached" if used.kept else "not reached"
    asked = f" The required life of {short(required / SECONDS_PER_HOUR)} h is {reached}." if reached else ""
    return f"Life{where}: {length}, {most}.{asked}"


def life_notes(machine: Machine, life: DutyLife) -> list[str]:
    """What the life rests on, and what is missing for it."""
    return [
        f"{EQUIVALENT} {slope_sentence(life.curve, life.slope_given)}",
        missing_for_life(machine, life),
    ]


def missing_for_life(machine: Machine, life: DutyLife) -> str:
    """What is missing for a life in cycles, shifts and years, a sentence; "" where nothing is."""
    if isinstance(machine, Chain):
        return "The life is relative only: a chain has no S-N curve."
    if not life.curve.points:
        shift = "" if life.shift is not None else ", and the duty a [shift] with cycles_per_hour"
        return (
            "The life is relative only: [limits.fatigue] has no point of an S-N curve; give it torque and "
            f"cycles{shift}."
        )
    if life.shift is None:
        return "The life is in cycles only: the duty has no [shift]; give its cycles_per_hour."
    return ""


# one strategy ----------------------------------------------------------------------------------------------


def duty_lines(run: DutyRun) -> list[str]:
    """The duty in a line."""
    steps, per_cycle = len(run.duty.steps), len(run.executed) // run.cycles
    more = "" if per_cycle == steps else f", {per_cycle} with repetitions"
    shift = run.duty.shift
    rate = "" if shift is None else f", {short(shift.cycles_per_hour)} cycles per hour"
    return [f"  duty   {plural(steps, 'step')} a cycle{more}{rate}; {plural(run.cycles, 'cycle')} computed"]


def _in_words(torque: float, machine: Machine) -> str:
    """A torque in a sentence, four digits."""
    units = units_of(machine)
    return with_unit(float(f"{units.shown(torque, 'N*m'):.4g}"), units.label("N*m"))


def headline(run: DutyRun, life: DutyLife | None = None) -> str:
    """The worst step, and whether the limits hold."""
    worst = run.worst
    torque = _in_words(worst.peak_torque, run.drive)
    text = f"Worst step: {name_of(worst)}, K_dyn {run.k_dyn:.3f} ({torque})."
    margins = run.margins(life)
    if not margins:
        return text
    broken = [f"{place_of(row)}: {margin}" for row, margin in margins if not margin.kept]
    if broken:
        return f"{text} Limits are exceeded in {'; '.join(broken)}."
    row, least = min(margins, key=lambda one: one[1].share)
    return f"{text} All limits are kept; the smallest margin is in {place_of(row)}: {least}."


def duty_notes(run: DutyRun) -> Iterator[str]:
    """Where the figures of the steps are from, and how steps were carried out."""
    name, hows = run.controller_name, {row.how for row in run.rows}
    of = f"all {run.cycles} cycles" if run.cycles > 1 else "the cycle"
    base = f'"{run.base.name}"' if run.base is not None else "this machine"
    yield (
        f"Figures of a step are the largest of {of} and of its repetitions, time and angle those with the "
        f"largest torque. K_dyn: largest |T| over {_in_words(run.base_torque, run.drive)}, the mean shaft "
        f"torque of {base} under full starting torque."
    )
    if run.margins():
        yield "Margin: what a step leaves of the limit to which it comes nearest; negative: exceeded."
    if run.drive.limits.output_torque is not None or units_of(run.drive).gear:
        yield "Output torque: that of the shaft through the gear with its losses, as all torques there."
    if not run.repeated:
        yield "The duty ends in motion, so that its cycle is computed once."
    elif run.cycles == 1:
        yield "One cycle: its damage depends on where the machine stood before; compute two or more."
    if run.uses_configured_stop:
        yield f"{name} cannot stop: its stops are by {run.stop} ({run.stop_setting})."
    if ANEW in hows:
        yield (
            f"Plugging: {name} cannot reverse; it is started again in the other direction while the machine "
            "still moves."
        )
    if "holding torque" in hows:
        yield "Holding torque: from the set speed on the motor has the torque that holds the load there."
    if len(run.drive.shaft_names) > 1:
        yield "Damage: of the shaft with the shortest life."
    yield from starts_note(run)
    yield from hurry_notes([run])
    yield from idle_notes([run])
    if len(run.drive.positions) > 1:
        yield "The start position is unknown: the first step is the worst of both flanks and mid-gap."


def starts_note(run: DutyRun) -> Iterator[str]:
    """Whether the cycles in an hour contradict the starts per hour of the limits."""
    asked, shift = run.drive.limits.starts_per_hour, run.duty.shift
    if asked is None or shift is None:
        return
    rate = shift.cycles_per_hour * run.starts
    if abs(rate - asked) > SAME_RATE * asked:
        yield (
            f"[limits] starts_per_hour is {short(float(asked))}, the duty has {short(rate)}: "
            f"{short(shift.cycles_per_hour)} cycles per hour with {plural(run.starts, 'start')} each, "
            "counting reversals and jogs. Lives here are those of the duty."
        )


def grouped(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """The names that belong to each sentence or place."""
    groups: dict[str, list[str]] = {}
    for key, name in pairs:
        groups.setdefault(key, []).append(name)
    return groups


def hurry_notes(runs: Sequence[DutyRun]) -> Iterator[str]:
    """Under which strategies a cycle takes longer than the shift has for it."""
    if (shift := runs[0].duty.shift) is None:
        return
    every = SECONDS_PER_HOUR / shift.cycles_per_hour
    if late := [f"{run.controller_name} ({run.cycle_time:.4g} s)" for run in runs if run.cycle_time > every]:
        yield (
            f"[shift] cycles_per_hour = {short(shift.cycles_per_hour)} leaves {every:.4g} s for a cycle, "
            f"which takes longer under {', '.join(late)}: the life in hours, shifts and years is too short."
        )


def idle_notes(runs: Sequence[DutyRun]) -> Iterator[str]:
    """In which starts and jogs the load hardly moves, or the wrong way, so that they only seem gentle."""
    idle: dict[tuple[str, str], float] = {}
    for run in runs:
        for one in run.executed:
            step = one.step
            if step.do in ("start", "jog"):
                angle = one.angle * step.direction
                speed = abs(step.set_speed or run.drive.target_speed)
                if angle < IDLE * speed * (step.time or one.time):
                    key = (name_of(one), run.controller_name)
                    idle[key] = min(angle, idle.get(key, math.inf))
    units = units_of(runs[0].drive)
    shown = (
        (place, f"{name} ({units.shown(angle, 'rad'):.3g} {units.label('rad')})")
        for (place, name), angle in idle.items()
    )
    for place, names in grouped(shown).items():
        yield (
            f"Step {place}: the load hardly moves, or the wrong way, under {', '.join(names)}; K_dyn there "
            "is not that of a motion."
        )


def duty_facts(run: DutyRun) -> list[list[str]]:
    """The figures of the whole."""
    worst = run.worst
    names, gear = run.drive.shaft_names, run.drive.gear
    where = f" in {names[int(worst.peak_torques.argmax())]}" if len(names) > 1 else ""
    units = units_of(run.drive)
    there = seen(worst.peak_torque, "N*m", units._replace(gear=gear)) if gear and not units.gear else ""
    return [
        ["K_dyn", f"{number(run.k_dyn, 6)} in step {name_of(worst)}"],
        ["peak shaft torque", f"{seen(worst.peak_torque, 'N*m', units)}{where}"],
        ["at the output, with losses", there],
        ["time of a cycle", with_unit(run.cycle_time, "s")],
    ]


def duty_sheet(
    run: DutyRun,
    slope: float | None = None,
    fitted_to: Machine | None = None,
    estimate: Mapping[str, int] | None = None,
) -> Sheet:
    """What is shown of a machine in a duty; `slope` is that of the S-N curve, if another.

    `estimate`: numbers of gears and couplings from which the damping is estimated.
    """
    life, reason = life_or_reason(run, slope)
    values, stem = parameters_of(run), file_stem(run.controller_name)
    columns = step_columns(run, life)
    records = [_record(run, row) for row in run.executed]
    files: dict[str, str | Writer] = {
        f"trace-{stem}.csv": run.to_csv,
        "steps.csv": columns_file({key: [record[key] for record in records] for key in records[0]}),
        "duty.toml": run.duty.to_toml(),
    }
    several = len(run.drive.shaft_names) > 1
    for k, one in enumerate(() if life is None else life.shafts, 1):
        name = f"spectrum-shaft-{k}.csv" if several else "spectrum.csv"
        files[name] = rows_file(SPECTRUM, one.spectrum.tolist())
    return Sheet(
        f"{run.drive.name}: duty under {run.controller_name}",
        [
            *machine_lines(run.drive, fitted_to),
            f"  under  {run.controller_name}{' (' + values + ')' if values else ''}",
            *duty_lines(run),
        ],
        facts=duty_facts(run),
        tables=[
            TextTable.of_data(
                "Steps", columns, run.rows, units_of(run.drive), bold=[run.worst.number - 1], keys=2
            ),
            *shaft_tables(run),
            *([] if life is None else [life_table(life, run.drive)]),
        ],
        conclusions=[headline(run, life), *([] if life is None else [life_conclusion(run, life)])],
        notes=[
            *duty_notes(run),
            *([f"No life: {reason}"] if life is None else life_notes(run.drive, life)),
            f"{estimated_damping(run.drive, estimate)}." if estimate else "",
            *run.drive.warnings,
        ],
        figures={
            f"duty-{stem}": lambda: duty_figure(run),
            f"worst-step-{stem}": lambda: duty_figure(run, worst_recorded(run)),
        },
        panel=lambda ax: draw_torques(ax, run),
        records=records,
        files=files,
        machine=run.drive,
        fitted_to=fitted_to,
    )


def duty_data(
    run: DutyRun, slope: float | None = None, estimate: Mapping[str, int] | None = None
) -> dict[str, object]:
    """All figures as plain data, those of the life too."""
    life, reason = life_or_reason(run, slope)
    margins = run.margins(life)
    kept = all(margin.kept for _, margin in margins) if margins else None
    return {
        **run.summary(),
        "limits_kept": kept,
        "life": None if life is None else life.summary(),
        "no_life": reason,
        "damping_estimated_from": estimate,
    }


def _record(run: DutyRun, row: StepRun) -> dict[str, object]:
    """The figures of a step in one line, without those of each shaft."""
    plain = {key: value for key, value in row.summary().items() if not isinstance(value, list)}
    return {
        **plain,
        "k_dyn": run.k_dyn_of(row),
        "largest_torque": float(row.largest.max()),
        "smallest_torque": float(row.smallest.min()),
        "impact_energy": float(row.impact_energy.sum()),
        "limits": against_limits(run.margins_of(row)),
    }


# the trace -------------------------------------------------------------------------------------------------


def duty_figure(run: DutyRun, step: StepRun | None = None) -> Figure:
    """Torques and speeds over the first two cycles with the steps, or over one step and the end before it."""
    whole = float(run.t[-1])
    begin, end = (0.0, whole) if step is None else (step.begin, step.end)
    begin = begin if step is None else max(0.0, begin - BEFORE * (end - begin))
    with drawing():
        figure, axes = new_figure(2, 1, (9.0, 5.4), sharex=True)
        draw_torques(axes[0], run, begin, end)
        draw_speeds(axes[1], run, begin, end)
        for panel in axes:
            mark_steps(panel, run, begin, end, labels=panel is axes[0])
            legend_beside(panel, fontsize=7.5)
        axes[-1].set_xlabel("time, s")
        axes[-1].set_xlim(begin, end)
        of_step = "" if step is None else f", step {name_of(step)}"
        title = f"{run.drive.name}: duty under {run.controller_name}{of_step}"
        entitle(figure, titled(title, units_of(run.drive)))
    return figure


def traces_between(run: DutyRun, begin: float, end: float) -> tuple[Vector, dict[str, Vector]]:
    """Instants between two, and the states then."""
    inside = run.t[(run.t >= begin) & (run.t <= end)]
    if inside.size == run.t.size:
        return run.t, run.traces
    instants = np.unique(np.concatenate([inside, np.linspace(begin, end, PLOT_POINTS)]))
    return instants, run.at(instants)


def worst_recorded(run: DutyRun) -> StepRun:
    """The worst step as it was carried out in the cycles that are recorded."""
    recorded = [one for one in run.executed if one.phases and one.number == run.worst.number]
    return max(recorded, key=lambda one: one.peak_torque)


def draw_torques(axes: Axes, run: DutyRun, begin: float = 0.0, end: float = math.inf) -> None:
    """Motor and shaft torques, and the permissible ones."""
    units = units_of(run.drive)
    t, traces = traces_between(run, begin, end)
    axes.plot(t, units.shown(traces["u"], "N*m"), lw=0.8, label="motor torque u", **MOTOR)
    for (name, line), torque in zip(shafts_of(run), traces["T"].T, strict=True):
        axes.plot(t, units.shown(torque, "N*m"), label=name, **(line | {"lw": 0.9}))
    permissible = float(run.drive.permissible_torques[int(run.worst.peak_torques.argmax())])
    if not math.isnan(permissible):
        most = units.shown(permissible, "N*m")
        for sign, label in ((1.0, "permissible"), (-1.0, None)):
            axes.axhline(sign * most, color=LIMIT, lw=1.0, ls=DASHES[1], label=label)
    head(axes, f"K_dyn = {run.k_dyn:.3f} in step {name_of(run.worst)}", f"torque, {units.label('N*m')}")


def draw_speeds(axes: Axes, run: DutyRun, begin: float = 0.0, end: float = math.inf) -> None:
    """The speeds of all masses."""
    units = units_of(run.drive)
    t, traces = traces_between(run, begin, end)
    for (name, line), speed in zip(masses_of(run), traces["w"].T, strict=True):
        axes.plot(t, units.shown(speed, "rad/s"), label=name, **(line | {"lw": 0.9}))
    head(axes, "", f"speed, {units.of('rad/s')}")


def mark_steps(axes: Axes, run: DutyRun, begin: float, end: float, labels: bool) -> None:
    """A line at the beginning of each step, with its number and what it does where there is room."""
    last = None
    for row in (row for row in run.executed if row.phases and begin <= row.begin < end):
        first, last = row.cycle != last, row.cycle
        axes.axvline(row.begin, color="#000000" if first else GREY, lw=0.9 if first else 0.6, ls=":")
        share = (min(row.end, end) - row.begin) / (end - begin)
        texts = (f"{row.number} {row.step.do}", f"{row.number}")
        text = next((text for text in texts if share > LETTER * (len(text) + 0.6)), "")
        if labels and text:
            axes.text(
                row.begin, 0.985, f" {text}", fontsize=7, color=GREY, va="top",
                transform=axes.get_xaxis_transform(),
            )  # fmt: skip


# several strategies ----------------------------------------------------------------------------------------


def step_coefficients(comparison: DutyComparison) -> list[DataColumn]:
    """K_dyn of each step, a column each."""

    def of_step(i: int) -> Any:
        return lambda row: math.nan if row.run is None else row.run.k_dyn_of(row.run.rows[i])

    steps = enumerate(comparison.duty.steps)
    return [DataColumn(f"K\n{i + 1} {step.do}", of_step(i), 3) for i, step in steps]


def _of_run(value: Any, none: Any = math.nan) -> Any:
    """A figure of the run of a row, `none` where the duty cannot be finished."""
    return lambda row: none if row.run is None else value(row)


def _nearest(what: str) -> Any:
    return lambda row: _least([margin for _, margin in row.margins], what)


COMPARED = (
    DataColumn("worst\nstep", _of_run(lambda row: name_of(row.run.worst), "-")),
    DataColumn("margin\n%", _nearest("share"), 1, optional=True),
    DataColumn("to the limit", _nearest("name"), optional=True),
    DataColumn("life over\ndirect", lambda row: row.relative, text=rough, optional=True),
    DataColumn("cycles to\nfailure", lambda row: math.nan if row.life is None else row.life.worst.cycles,
               text=rough, optional=True),
    DataColumn("years", lambda row: math.nan if row.life is None else row.life.worst.years, text=rough,
               optional=True),
    DataColumn("cycle\ns", _of_run(lambda row: row.run.cycle_time)),
)  # fmt: skip


def duty_comparison_sheet(
    comparison: DutyComparison, rows: Sequence[DutyRow] = (), fitted_to: Machine | None = None
) -> Sheet:
    """What is shown of strategies in a duty; `rows` are its rows in another order."""
    machine, rows = comparison.drive, rows or comparison.rows
    runs = [row.run for row in rows if row.run is not None]
    columns = [DataColumn("strategy", lambda row: row.name), *step_coefficients(comparison), *COMPARED]
    figures = {"duty": lambda: comparison_map(comparison, rows)}
    files: dict[str, str | Writer] = {"duty.toml": comparison.duty.to_toml()}
    records, stems = [_compared_record(row) for row in rows], list[str]()
    keys = list(dict.fromkeys(key for record in records for key in record))
    files["comparison.csv"] = columns_file({key: [record.get(key) for record in records] for key in keys})
    for run in runs:
        stems.append(stem := file_stem(run.controller_name, stems))
        figures[f"duty-{stem}"] = partial(duty_figure, run)
        files[f"trace-{stem}.csv"] = run.to_csv
    lives = [row.life for row in rows if row.life is not None]
    failed = ((row.reason, row.name) for row in rows if row.run is None)
    return Sheet(
        f"{machine.name}: strategies in a duty",
        [*machine_lines(machine, fitted_to), *duty_lines(runs[0])],
        tables=[TextTable.of_data("Worst of each step", columns, rows, bold=_best(rows), keys=1)],
        conclusions=comparison_conclusions(comparison),
        notes=[
            f"K: largest |T| of a step over {_in_words(runs[0].base_torque, machine)}, the mean shaft torque "
            "under full starting torque; of all cycles and repetitions.",
            *(f"{', '.join(names)}: {reason}" for reason, names in grouped(failed).items()),
            *stop_notes(runs),
            *starts_note(runs[0]),
            *hurry_notes(runs),
            *idle_notes(runs),
            *(life_notes(machine, lives[0]) if lives else [f"No life: {comparison.no_life}"]),
            f"{estimated_damping(machine, comparison.estimate)}." if comparison.estimate else "",
            *machine.warnings,
        ],
        figures=figures,
        records=records,
        files=files,
        machine=machine,
        fitted_to=fitted_to,
    )


def _best(rows: Sequence[DutyRow]) -> list[int]:
    """The place of the row with the lowest K_dyn among those that keep the limits."""
    kept = [i for i, row in enumerate(rows) if row.run is not None and row.limits_kept is not False]
    return [min(kept, key=lambda i: rows[i].k_dyn)] if kept else []


def comparison_conclusions(comparison: DutyComparison) -> list[str]:
    """The lowest K_dyn, the strategies that keep the limits, and the longest life."""
    finished = comparison.finished
    best = min(finished, key=lambda row: row.k_dyn)
    assert best.run is not None
    text = [
        f"Lowest K_dyn of the worst step: {best.name}, {best.k_dyn:.3f} in step {name_of(best.run.worst)}."
    ]
    kept = [row.name for row in finished if row.limits_kept]
    if any(row.limits_kept is not None for row in finished):
        text.append(f"All limits are kept by {', '.join(kept)}." if kept else _exceeded_by_all(finished))
    lasting = [row for row in finished if row.life is not None]
    if lasting:
        longest = min(lasting, key=lambda row: row.life.worst.damage if row.life else math.inf)
        assert longest.life is not None
        over = "" if math.isnan(longest.relative) else f", {rough(longest.relative)} times that of direct"
        length = life_length(longest.life.worst)
        text.append(f"Longest life: {longest.name}{over}{', ' + length if length else ''}.")
    return text


def _exceeded_by_all(rows: Sequence[DutyRow]) -> str:
    """That no strategy keeps all limits, and in which steps none does."""
    broken = [{place_of(step): step for step, margin in row.margins if not margin.kept} for row in rows]
    places = []
    for place in broken[0]:
        if all(place in other for other in broken):
            hows = {step.how for other in broken if (step := other[place]) is not None}
            fixed = hows <= {"brake", "coast", "torque"} and hows
            places.append(place + f" (by {' or '.join(sorted(hows))}, not by the strategy)" * bool(fixed))
    where = f"; each exceeds one in {', '.join(places)}" if places else ""
    return f"No strategy keeps all limits{where}."


def stop_notes(runs: Sequence[DutyRun]) -> Iterator[str]:
    """Which strategies use the configured stop, and which are plugged."""
    configured = (run for run in runs if run.uses_configured_stop)
    ways = grouped((f"{run.stop} ({run.stop_setting})", run.controller_name) for run in configured)
    for stop, names in ways.items():
        yield f"Stops by {stop}, since they cannot stop: {', '.join(names)}."
    plugged = [run.controller_name for run in runs if any(row.how == ANEW for row in run.rows)]
    if plugged:
        yield f"Reversed by plugging, a start in the other direction out of the motion: {', '.join(plugged)}."


def _compared_record(row: DutyRow) -> dict[str, object]:
    """The figures of a strategy in one line."""
    if row.run is None:
        return {"controller": row.name, "reason": row.reason}
    run = row.run
    worst = None if row.life is None else row.life.worst
    return {
        "controller": row.name,
        "reason": "",
        "k_dyn": run.k_dyn,
        "worst_step": run.worst.number,
        **{f"k_dyn_step_{step.number}": run.k_dyn_of(step) for step in run.rows},
        "limits_kept": row.limits_kept,
        "cycle_time": run.cycle_time,
        "relative_life": row.relative,
        "cycles_to_failure": math.nan if worst is None else worst.cycles,
        "years": math.nan if worst is None else worst.years,
    }


def comparison_map(comparison: DutyComparison, rows: Sequence[DutyRow]) -> Figure:
    """K_dyn of each step under each strategy as colours and numbers; struck out where a limit is exceeded."""
    from matplotlib.colors import Normalize

    finished = [row for row in reversed(rows) if row.run is not None]
    runs = [row.run for row in finished if row.run is not None]
    values = np.array([[run.k_dyn_of(step) for step in run.rows] for run in runs])
    broken = np.array(
        [[not all(one.kept for one in run.margins_of(step)) for step in run.rows] for run in runs]
    )
    names = [f"{i} {step.do}" for i, step in enumerate(comparison.duty.steps, 1)]
    with drawing():
        figure, axes = new_figure(1, 1, (2.6 + 0.75 * len(names), 1.5 + 0.28 * len(finished)))
        scale = Normalize(0.0, float(values.max()))
        heat_map(axes, names, [row.name for row in finished], values, scale, decimals=2, struck=broken)
        axes.tick_params(axis="x", labelsize=8)
        struck = "; struck out: a limit is exceeded" if broken.any() else ""
        head(axes, f"K_dyn of each step{struck}", "")
        entitle(figure, comparison.drive.name)
    return figure
