"""The parameter sheet of a strategy: its values rounded to what can be set, and started again with them."""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.chain.model import Chain
from softstart.controller import CompiledController, Controller
from softstart.controller.base import label_of
from softstart.drive import Drive
from softstart.drive.records import Records
from softstart.errors import InputError, SimulationError, listed
from softstart.reporting.markup import Html, Part, html, joined, table, tag
from softstart.reporting.resolution import RATED, Resolution, nearest_step, rated_torque
from softstart.reporting.strategies import ORDINARY, OUTPUT, kind_of
from softstart.start.batch import prepared
from softstart.start.comparison import compared
from softstart.start.recommendation import CASES, Row, checked_limits
from softstart.start.run import Run
from softstart.start.simulation import simulate
from softstart.views.printed import RPM, at_output, decimals_of, digits, fixed, short, unit

KEPT = ("period",)  # the cycle of the control code is what the inverter has, no setting
ALL_CORNERS = 9  # rounded values up to which every combination of half steps is started; of a chain none
INSTANTS = 20_001  # of a chain's start, in which its motor torque is looked at
NEIGHBOURS = 3  # rounded values up to which every combination of steps beside them is tried
DOCUMENTED = (
    "acceleration-delay",
    "current-limit-feedback",
    "pulse-coast-hold",
    "shaped",
    "state-feedback",
    "take-up",
)
_DATA = {
    "motor_inertia": "J1",
    "load_inertia": "J2",
    "stiffness": "c",
    "damping": "d",
    "gap": "the gap",
    "starting_torque": "Ms",
    "load_torque": "Mc",
    "torque_lag": "the torque lag",
    "torque_rate": "the torque rate",
    "torque_noise": "the noise of the torque",
    "computing_delay": "the dead time",
}
_LEFT_OUT_AT_0 = ("damping", "torque_noise", "computing_delay")  # data that such a drive simply has not
_PROBE = 1e-3  # relative
EVEN = 1e-9  # of a step: what lies above a multiple by no more than this is that multiple
GEAR_COUNTS, GEAR_CYCLE = 4000.0, 3.3e-3  # DCS 500B: counts of the nominal torque, cycle at 50 Hz in s
COARSE = 0.1  # a step above this share of the value is said to be coarse


@dataclass(frozen=True)
class Setting:
    """One value of a strategy in SI: exact, and rounded to `step` (None: taken as it is)."""

    name: str
    meaning: str
    unit: str
    exact: float | str
    rounded: float | str
    step: float | None
    least: float = 0.0
    most: float = math.inf

    @property
    def coarse(self) -> bool:
        """Whether the step is large against the value."""
        return (
            self.step is not None
            and isinstance(self.exact, float)
            and self.step > COARSE * abs(self.exact) > 0.0
        )

    def off(self, side: int) -> float:
        """The value half a step too low (-1) or too high (+1), within what the parameter may be."""
        assert self.step is not None
        assert isinstance(self.rounded, float)
        if side == 0:
            return self.rounded
        return min(max(self.rounded + 0.5 * side * self.step, self.least), max(self.most, self.rounded))

    def beside(self, steps: int) -> float:
        """The value so many steps beside the nearest one, within what the parameter may be."""
        assert self.step is not None
        assert isinstance(self.rounded, float)
        return min(max(self.rounded + steps * self.step, self.least), self.most) if steps else self.rounded


@dataclass(frozen=True, eq=False)
class FullRise:
    """A ramp for an inverter that asks for the time from 0 to 100 % of torque, s: exact, and rounded.

    `rise` is the time between the torques of the sheet (s) that comes of the rounded one, `run` the start.
    For one that asks for a rate, exact and rounded are that rate as it counts it.
    """

    exact: float
    rounded: float
    rise: float
    run: Run

    def summary(self) -> dict[str, float]:
        """As plain data."""
        return {
            "exact": self.exact,
            "rounded": self.rounded,
            "k_dyn": self.run.k_dyn,
            "start_time": self.run.start_time,
        }


@dataclass(frozen=True, eq=False)
class Sheet:
    """What to set for one strategy, and what comes of it.

    `exact` and `rounded` are starts of the drive with the exact and the rounded values. `worst_k_dyn` is the
    largest K_dyn, `slowest` the longest start time (s) of `variants` starts in which the rounded values are
    half a step off, in the combinations that `corners` says; NaN if one of them fails. `worst_values`
    belong to it. `moved` names settings that are not at their nearest step, because the rule by which the
    strategy was chosen would not hold there; where it holds nowhere near, there is no start with rounded
    values, and `failure` says why. `own` is the drive whose numbers the strategy works with, `computes_with`
    says with which of them. `torque_step` (N m) is that of the inverter.
    """

    name: str
    kind: str
    settings: tuple[Setting, ...]
    own: Drive
    exact: Run
    rounded: Run | None
    failure: str
    variants: int
    corners: bool
    worst_k_dyn: float
    slowest: float
    worst_values: Mapping[str, float]
    torque_step: float
    full_rise: FullRise | None
    computes_with: Sequence[str] | None
    moved: tuple[str, ...] = ()
    gear_ramp: FullRise | None = None

    @property
    def varied(self) -> list[Setting]:
        """The settings that were rounded."""
        return [one for one in self.settings if one.step is not None]

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "controller": self.name,
            "settings": [
                {
                    "name": s.name,
                    "unit": s.unit,
                    "exact": s.exact,
                    "rounded": s.rounded if self.rounded else None,
                    "step": s.step,
                }
                for s in self.settings
            ],
            "k_dyn": self.exact.k_dyn,
            "k_dyn_rounded": self.rounded.k_dyn if self.rounded else None,
            "start_time": self.exact.start_time,
            "start_time_rounded": self.rounded.start_time if self.rounded else None,
            "k_dyn_half_a_step_off": self.worst_k_dyn,
            "start_time_half_a_step_off": self.slowest,
            "time_0_to_100_percent": self.full_rise.summary() if self.full_rise else None,
            "variants": self.variants,
            "failure": self.failure,
        }


def make_sheet(
    machine: Drive | Chain,
    controller: Controller,
    exact: Run,
    resolution: Resolution,
    row: Row | None = None,
    drawn: Records | None = None,
) -> Sheet:
    """The sheet of a strategy on a drive or chain; `exact` is its start there.

    With the `row` by which the strategy was chosen, the values of the sheet keep what that row keeps, on the
    drives `drawn` too where the drive is known within intervals.
    """
    drive = machine.design_drive
    ready, own = controller.set_up(drive)
    settings = tuple(_settings(ready, drive, resolution))
    varied = [one for one in settings if one.step is not None]
    rounded: Run | None = None
    failure, variants, corners, worst, slowest = "", 0, False, math.nan, math.nan
    worst_values: dict[str, float] = {}
    full_rise: FullRise | None = None
    gear_ramp: FullRise | None = None
    moved: tuple[str, ...] = ()
    try:
        settings, moved = _within_the_rule(machine, ready, own, settings, row, drawn)
        varied = [one for one in settings if one.step is not None]
        values = {one.name: one.rounded for one in varied}
        rounded = simulate(machine, replace(ready, **values), fitted_to=own)
        if kind_of(controller) in ORDINARY and isinstance(machine, Drive):
            full_rise = _full_rise(machine, replace(ready, **values), own, resolution)
            gear_ramp = _gear_ramp(machine, replace(ready, **values), own)
        if varied:
            corners = len(varied) <= ALL_CORNERS and isinstance(machine, Drive)
            sides = _sides(len(varied), corners)
            k_dyn, time = _starts(machine, ready, own, varied, sides)
            variants, worst, slowest = len(sides), float(np.max(k_dyn)), float(np.max(time))
            if rounded.k_dyn > worst:  # the values as they are set are among what may be
                worst, worst_values = rounded.k_dyn, {one.name: float(one.rounded) for one in varied}
            slowest = max(slowest, rounded.start_time)
            at = sides[int(np.argmax(np.nan_to_num(k_dyn, nan=math.inf)))]
            off = {one.name: one.off(side) for one, side in zip(varied, at, strict=True)}
            worst_values = worst_values or off
    except (SimulationError, InputError) as error:
        failure = " ".join(str(error).split())
    return Sheet(
        name=label_of(exact.controller or controller), kind=kind_of(controller), settings=settings,
        own=own, exact=exact, rounded=rounded, failure=failure, variants=variants, corners=corners,
        worst_k_dyn=worst, slowest=slowest, worst_values=worst_values,
        torque_step=resolution.step("", "N*m", rated_torque(drive)[0]) or 0.0, full_rise=full_rise,
        computes_with=computes_with(ready, own), moved=moved, gear_ramp=gear_ramp,
    )  # fmt: skip


def _within_the_rule(
    machine: Drive | Chain,
    ready: Controller,
    own: Drive,
    settings: Sequence[Setting],
    row: Row | None,
    drawn: Records | None,
) -> tuple[tuple[Setting, ...], tuple[str, ...]]:
    """The settings at the steps nearest to them that keep what the row keeps, and which were moved for that.

    Raises SimulationError where no step beside the nearest ones does.
    """
    if row is None:
        return tuple(settings), ()
    varied = [one for one in settings if one.step is not None and not isinstance(one.rounded, str)]
    reason = ""
    for steps in _steps_beside(len(varied)):
        tried = {one.name: one.beside(step) for one, step in zip(varied, steps, strict=True)}
        moved = tuple(one.name for one in varied if tried[one.name] != one.rounded)
        if any(steps) and not moved:
            continue
        broken = _broken(machine, replace(ready, **tried), own, row, drawn)
        if not broken:
            return tuple(replace(s, rounded=tried.get(s.name, s.rounded)) for s in settings), moved
        reason = reason or broken
    raise SimulationError(
        f"rounded to these steps the strategy breaks the rule by which it was chosen ({reason}), and so "
        "it does a step beside them: finer steps are needed."
    )


def _steps_beside(count: int) -> list[tuple[int, ...]]:
    """Steps away from the nearest ones, the smallest changes first."""
    alone = [tuple(side if k == i else 0 for k in range(count)) for i in range(count) for side in (-1, 1)]
    if count <= NEIGHBOURS:
        together = sorted(itertools.product((-1, 0, 1), repeat=count), key=lambda one: sum(map(abs, one)))
        return list(together)
    return [(0,) * count, *alone]


def _broken(
    machine: Drive | Chain, controller: Controller, own: Drive, row: Row, drawn: Records | None
) -> str:
    """What these values break of what the row keeps, a flag or a limit in the worst case, or nothing."""
    cases = tuple(case for case in row.worst_case if case in CASES)
    found = compared(machine, controller, row.direct, fitted_to=own, worst_case=cases, drawn=drawn)
    if found.flags and not row.flags:
        return found.flags[0].text
    limits = checked_limits(machine)
    before = {margin.name: margin.kept for margin in row.margins(limits)}
    return next((str(one) for one in found.margins(limits) if before[one.name] and not one.kept), "")


def _full_rise(drive: Drive, ready: Any, own: Drive, resolution: Resolution) -> FullRise | None:
    """The ramp by its time from 0 to 100 % of torque; None where there is no rise."""
    share = (ready.full_torque - ready.initial) / rated_torque(drive)[0]
    if not (share > 0.0 and ready.time > 0.0):
        return None
    exact = float(ready.time / share)
    rounded = nearest_step(exact, resolution.time)
    run = simulate(drive, replace(ready, time=rounded * share), fitted_to=own)
    return FullRise(exact, rounded, rounded * share, run)


def _gear_ramp(drive: Drive, ready: Any, own: Drive) -> FullRise | None:
    """A straight ramp as the gear backlash compensation of a DCS 500B counts it; None for another one."""
    share = (ready.full_torque - ready.initial) / rated_torque(drive)[0]
    if kind_of(ready) != "ramp" or not (share > 0.0 and ready.time > 0.0):
        return None
    exact = float(GEAR_COUNTS * share * GEAR_CYCLE / ready.time)
    rounded = max(1.0, float(round(exact)))
    rise = GEAR_COUNTS * share * GEAR_CYCLE / rounded
    return FullRise(exact, rounded, rise, simulate(drive, replace(ready, time=rise), fitted_to=own))


def _settings(ready: Controller, drive: Drive, resolution: Resolution) -> list[Setting]:
    rated = rated_torque(drive)[0]
    found = []
    for field in fields(ready):
        value, about = getattr(ready, field.name), field.metadata
        unit, meaning = str(about.get("unit", "")), str(about.get("meaning", ""))
        if value is None or about.get("kind", "quantity") == "object":
            continue
        if not isinstance(value, int | float) or isinstance(value, bool):
            found.append(Setting(field.name, meaning, unit, str(value), str(value), None))
            continue
        number = float(value)
        step = None if field.name in KEPT else resolution.step(field.name, unit, rated)
        if step is None or not math.isfinite(number):
            found.append(Setting(field.name, meaning, unit, number, number, None))
            continue
        least, most = about.get("between") or (-math.inf if number < 0.0 else 0.0, math.inf)
        most = float(drive.maximum_torque) if unit == "N*m" else float(most)
        rounded = nearest_step(number, step, max(most, 0.0))
        found.append(
            Setting(field.name, meaning, unit, number, rounded, step, min(float(least), rounded), most)
        )
    return found


def _sides(count: int, corners: bool) -> list[tuple[int, ...]]:
    """All combinations of half steps, or each value alone and all together."""
    if corners:
        return list(itertools.product((-1, 1), repeat=count))
    alone = [tuple(side if k == i else 0 for k in range(count)) for i in range(count) for side in (-1, 1)]
    return [*alone, (-1,) * count, (1,) * count]


def _starts(
    drive: Drive | Chain,
    ready: Controller,
    own: Drive,
    varied: Sequence[Setting],
    sides: Sequence[tuple[int, ...]],
) -> tuple[Any, Any]:
    """K_dyn and start times of the drive or chain with the values off by these half steps."""
    each = [{one.name: one.off(side) for one, side in zip(varied, row, strict=True)} for row in sides]
    set_ups = [(replace(ready, **values), own) for values in each]
    found = prepared([drive]).figures(set_ups, drive.mean_torque, np.zeros(len(sides), dtype=np.int64))
    time = np.asarray(found["start_time"][0], dtype=np.float64)
    return np.where(np.isnan(time), np.nan, found["k_dyn"][0]), time


def computes_with(ready: Controller, own: Drive) -> list[str] | None:
    """The data of the drive that a controller computes with, beside its parameters; None if it does not tell.

    >>> from softstart.controller import make_controller
    >>> computes_with(*make_controller("acceleration-delay").set_up(Drive.load("crane-4amtkf")))
    ['J1']
    """
    if not isinstance(ready, CompiledController):
        return None
    numbers = np.asarray(ready.vector(own), dtype=np.float64)
    found = []
    for key, symbol in _DATA.items():
        value = float(getattr(own, key))
        if (value == 0.0 and key in _LEFT_OUT_AT_0) or np.isinf(value):
            continue
        try:
            changes: dict[str, Any] = {key: (1.0 - _PROBE) * value or 1e-6}
            other = own.replace(**changes)
            moved = np.asarray(ready.vector(other), dtype=np.float64)
        except InputError:  # then it is read, at least
            found.append(symbol)
            continue
        if not np.array_equal(numbers, moved, equal_nan=True):
            found.append(symbol)
    return found


def sheet_section(
    drive: Drive, sheets: Sequence[Sheet], resolution: Resolution, chosen: str, role: str
) -> Html:
    """One sheet for each strategy; `chosen` is the name of that one with this `role`."""
    if not sheets:
        return tag("p", "There is no sheet, because no strategy is recommended.")
    steps = "; ".join(resolution.described(drive))
    return html(
        tag(
            "p",
            (
                f"Every value is rounded to what the inverter can be set to: {steps}. The drive was then "
                "started again with the rounded values, and once more with every value half a step off, as a "
                "display that rounds may hide."
            ),
        ),
        joined(_sheet(sheet, role if sheet.name == chosen else "", drive) for sheet in sheets),
        _families(sheets, drive),
    )


def _motor_torque(run: Run) -> Vector:
    """The motor torque over a start, N m."""
    return run.u


FUNCTIONS = {
    "limit": "torque limit",
    "braking": "torque limit, generating",
    "reference": "torque reference",
    "backlash": "torque limit after a change of direction, and its ramp",
    "ramp": "ramp and S-curve of the speed reference",
    "preload": "torque before the brake opens, and its ramp",
}


@cache
def _at_inverters() -> dict[str, Any]:
    """Names of functions in manuals, and what a parameter means at an inverter."""
    return tomllib.loads(Path(__file__).with_name("inverters.toml").read_text("utf-8"))


def _families(sheets: Sequence[Sheet], drive: Drive) -> Html:
    """Where inverters have what the sheets name: names as public manuals print them, and no others."""
    low = min(float(np.min(_motor_torque(sheet.rounded or sheet.exact))) for sheet in sheets)
    asked = [key for key in FUNCTIONS if key != "braking" or low < 0.0]
    asked = [key for key in asked if key != "preload" or drive.brake == "motor"]
    rows, sources = list[list[Part]](), list[Part]()
    for number, family in enumerate(_at_inverters()["family"], start=1):
        lines = [html(f"{FUNCTIONS[key]}: ", tag("code", family[key])) for key in asked if key in family]
        rows += [[f"{family['name']} [{number}]", joined(lines, tag("br"))]] if lines else []
        sources.append(tag("code", f"[{number}] {family['source']}."))
    return tag(
        "section",
        table(
            ["inverter", "functions, with the names in its manual"],
            rows,
            caption="Where to set it: names of these functions in manuals",
            text_columns=(0, 1),
            class_="words",
        ),
        tag(
            "p",
            (
                "Names as public manuals print them; check them against the manual of the firmware. The "
                "ramps of the sheets are ramps of torque. The acceleration ramps of inverters (ramp times, "
                "S-curves of speed) do not replace them: make those shorter than the start."
            ),
            " ",
            joined(sources, " "),
            class_="small",
        ),
    )


def _sheet(sheet: Sheet, role: str, drive: Drive) -> Html:
    rows = [_setting(one, drive) for one in sheet.settings]
    role = role or "for an ordinary inverter"
    heads = ["parameter", "meaning, and what it is at the inverter", "set to", "unit", "that is", "exact"]
    return tag(
        "section",
        tag("h3", f"{sheet.name} ({role})"),
        table(
            heads,
            rows,
            caption=f"Parameter sheet: {sheet.name}",
            text_columns=(0, 1, 3, 4),
            class_="sheet",
        )
        if rows and sheet.rounded is not None
        else None
        if rows
        else tag("p", "This strategy has no parameters."),
        _outcome(sheet, drive),
        tag("ul", joined(tag("li", one) for one in _notes(sheet, drive)), class_="notes"),
        class_="sheet",
    )


def _setting(one: Setting, drive: Drive) -> list[Part]:
    name = one.name.replace("_", " ")
    explained = _at_inverters()["setting"].get(one.name)
    note = tag("small", f"; {explained}") if explained else None
    if isinstance(one.exact, str) or isinstance(one.rounded, str):
        return [name, html(one.meaning, note), str(one.rounded), "", "", str(one.exact)]
    value, exact, step, shown = one.rounded, one.exact, one.step, unit(one.unit)
    other = ""
    if one.unit == "s":
        value, exact, step, shown = 1e3 * value, 1e3 * exact, step and 1e3 * step, "ms"
    elif one.unit == "rad/s":
        other, shown = f"{digits(value)} rad/s", "Hz" if "frequency" in one.name else "rpm"
        factor = 0.5 / math.pi if "frequency" in one.name else RPM
        value, exact, step = factor * value, factor * exact, step and factor * step
    elif one.unit == "N*m":
        rated, basis = rated_torque(drive)
        share = step and 100.0 * step / rated
        other = f"{_multiple(100.0 * value / rated, share)} % of the {basis}"
    text = _multiple(value, step)
    meaning = one.meaning
    if one.name == "period":
        meaning = f"{meaning} of the control code"
        digit = 10.0 ** (math.floor(math.log10(value)) - 2) if value > 0.0 else 1.0
        most = math.floor(value / digit * (1.0 + EVEN)) * digit  # not longer than it may be
        return [
            name,
            html(meaning, note),
            f"≤ {short(float(f'{most:.3g}'))}",
            shown,
            "",
            short(float(f"{value:.5g}")),
        ]
    if one.step is None:
        meaning, text = f"{meaning} (not rounded)", short(float(f"{value:.4g}"))
    return [name, html(meaning, note), text, shown, other, short(float(f"{exact:.5g}"))]


def _multiple(value: float | None, step: float | None) -> str:
    """A multiple of a step: all its decimals if the step is a short decimal, else those that tell it apart.

    >>> _multiple(62.0, 0.5), _multiple(34.5683, 0.0238732), _multiple(123.4567, 0.0238732)
    ('62.0', '34.57', '123.46')
    """
    assert value is not None
    if not step:
        return short(value)
    step = float(f"{step:.9g}")
    if decimals_of(step) <= 6 and step == float(f"{step:.4g}"):
        return fixed(value, decimals_of(step))
    order = math.floor(math.log10(abs(value))) if value else 0
    if not -4 <= order <= 6:
        return digits(value, 7)
    enough = max(math.ceil(-math.log10(step)), 3 - order, 0)
    return fixed(value, min(enough, max(6 - order, 0)))


def _outcome(sheet: Sheet, drive: Drive) -> Html:
    if sheet.rounded is None:
        return tag("p", f"The start with the rounded values could not be made: {sheet.failure}")
    exact, rounded = sheet.exact, sheet.rounded
    starts = {
        "exact values": (exact.k_dyn, exact.peak_torque, exact.start_time),
        "rounded values, as in the sheet": (rounded.k_dyn, rounded.peak_torque, rounded.start_time),
    }
    if sheet.variants:
        peak = sheet.worst_k_dyn * exact.peak_torque / exact.k_dyn if exact.k_dyn > 0.0 else math.nan
        starts["worst with the values half a step off"] = sheet.worst_k_dyn, peak, sheet.slowest
    rows = [
        [name, fixed(k_dyn, 4), digits(peak), *filter(None, [at_output(drive, peak)]), digits(time, 5)]
        for name, (k_dyn, peak, time) in starts.items()
    ]
    output = OUTPUT if drive.gear_ratio is not None else ()
    return table(
        ["start with", "K_dyn", "peak torque, N m", *output, "start time, s"], rows,
        caption=f"{sheet.name}: started again after rounding",
    )  # fmt: skip


def _limits(sheet: Sheet, drive: Drive) -> str:
    """The torque limits that leave this start as it is, in steps of the inverter."""
    run = sheet.rounded or sheet.exact
    rated, basis = rated_torque(drive)
    given = _motor_torque(run)
    low, high = min(float(np.min(given)), 0.0), float(np.max(given))
    step = sheet.torque_step
    text = []
    for torque in (high, low):
        if torque:
            limit = math.copysign(math.ceil(abs(torque) / step * (1.0 - EVEN)) * step, torque)
            share = _multiple(100.0 * limit / rated, 100.0 * step / rated)
            text.append(f"{_multiple(limit, step)} N m ({share} % of the {basis})")
    limits = f"Torque limits of the inverter, not tighter than what this start takes: {listed(text)}."
    if basis is not RATED:
        return limits
    current = "A limit of the torque-producing current: the same percentages."
    return f"{limits} {current}"


def _notes(sheet: Sheet, drive: Drive) -> list[str]:
    notes = []
    if sheet.moved:
        moved = listed([name.replace("_", " ") for name in sheet.moved])
        notes.append(f"Not at the nearest step, which would break the rule of the recommendation: {moved}.")
    if sheet.variants:
        notes.append(
            f"Half a step off: {sheet.variants} starts, all combinations of half a step down or up."
            if sheet.corners
            else (
                f"Half a step off: {sheet.variants} starts, each value alone, and all together, half a "
                "step down or up."
            )
        )
        permitted = drive.limits.shaft_torque
        peak = sheet.worst_k_dyn * sheet.exact.peak_torque / sheet.exact.k_dyn
        if permitted is not None and peak > float(permitted):
            notes.append(
                f"Half a step off the shaft torque may reach {digits(peak)} N m, more than the "
                f"{digits(float(permitted))} N m that are permitted: set these values exactly, or finer "
                "ones."
            )
        if math.isnan(sheet.worst_k_dyn):
            notes.append("In at least one of them the load does not reach its target speed: set finer steps.")
    notes.append(_limits(sheet, drive))
    coarse = [one.name.replace("_", " ") for one in sheet.settings if one.coarse]
    if coarse:
        notes.append(f"The steps are coarse against {', '.join(coarse)}: look for a finer setting.")
    if sheet.kind in ORDINARY:
        return notes + _on_ramps(sheet, drive)
    if sheet.kind != "direct":
        notes.append(_on_code(sheet, drive))
    return notes


def _on_ramps(sheet: Sheet, drive: Drive) -> list[str]:
    """The same rise as inverters ask for it."""
    notes = []
    if rise := sheet.full_rise:
        rated, basis = rated_torque(drive)
        notes.append(
            f"Some inverters ask for the time of a ramp from 0 to 100 % of torque ({digits(rated)} N m, the "
            f"{basis}): that is {digits(1e3 * rise.exact)} ms, a mean rise of {digits(rated / rise.exact)} "
            f"N m/s. Set to {short(1e3 * rise.rounded)} ms the rise takes {digits(1e3 * rise.rise)} ms, "
            f"K_dyn is {fixed(rise.run.k_dyn, 4)} and the start time {digits(rise.run.start_time, 5)} s."
        )
    if gear := sheet.gear_ramp:
        notes.append(
            "ABB DCS 500B, gear backlash compensation (4000 counts of the rated torque, each 3.3 ms at "
            "50 Hz): GEAR.START TORQ is the initial torque, GEAR.TORQ TIME 0, GEAR.TORQ RAMP "
            f"{digits(gear.exact)}, set to {short(gear.rounded)}. The rise then takes "
            f"{digits(1000.0 * gear.rise)} ms, K_dyn is {fixed(gear.run.k_dyn, 4)} and the start time "
            f"{digits(gear.run.start_time, 5)} s."
        )
    if sheet.kind == "s-curve":
        values = {one.name: one.rounded for one in sheet.settings}
        share, time = float(values["rounding"]), float(values["time"])
        notes.append(
            f"S-curve share {short(100.0 * share)} %: rounded ends of {digits(500.0 * share * time)} ms "
            "each at the beginning and at the end of the rise."
        )
    return notes


def _on_code(sheet: Sheet, drive: Drive) -> str:
    """What an inverter must run and know for a strategy that is a program."""
    found = (
        "The strategy is code of its own (equations: docs/controllers.md of softstart)"
        if sheet.kind in DOCUMENTED
        else "The strategy is code of its own"
    )
    if not sheet.computes_with:
        return f"{found}."
    values = {"code": found, "data": listed(list(sheet.computes_with))}
    if sheet.own == drive:
        return "{code}; beside the sheet it computes with {data} of the drive.".format(**values)
    return (
        "{code}; beside the sheet it computes with {data} of the drive that its gains were tuned for.".format(
            **values
        )
    )
