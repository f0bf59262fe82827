"""The parameter sheet of a strategy: its values rounded to what can be set, and started again with them.

`parameter_sheet` makes one of any strategy; a report has several.
"""

from __future__ import annotations

import itertools
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from softstart.chain.machines import MachineLike
from softstart.controller import CompiledController, Controller
from softstart.controller.base import label_of
from softstart.controller.tuned import RobustGains, Tuned
from softstart.drive import Drive, Machine
from softstart.drive.data_sheet import DataSheet
from softstart.drive.machine_table import MachineTable
from softstart.errors import InputError, SimulationError
from softstart.linear.view import loop_in_words
from softstart.quantities import Units
from softstart.results import OneLine, Result
from softstart.start.batch import prepared
from softstart.start.comparison import Uncertain, as_far_as_known, compare, compared, make_controllers
from softstart.start.demand import ControllerLike
from softstart.start.recommendation import CASES, Margin, Row, checked_limits
from softstart.start.resolution import Resolution, nearest_step, rated_torque
from softstart.start.results import limited_time
from softstart.start.run import Run
from softstart.start.settings import EVEN, Setting, rounded_settings, step_multiple
from softstart.start.simulation import simulate
from softstart.views.numbers import IN_SI, seen

WITHOUT_CODE = ("direct", "ramp", "s-curve", "speed-ramp")  # which an inverter has
ORDINARY = ("ramp", "s-curve")  # whose sheets say how an inverter names their settings
ALL_CORNERS = 9  # rounded values up to which every combination of half steps is started; of a chain none
NEIGHBOURS = 3  # rounded values up to which every combination of steps beside them is tried
_DATA = {
    "motor_inertia": "J1", "load_inertia": "J2", "stiffness": "c", "damping": "d", "gap": "the gap",
    "starting_torque": "Ms", "load_torque": "Mc", "load_friction": "the friction of the load",
    "torque_lag": "the torque lag",
    "torque_rate": "the torque rate", "torque_noise": "the noise of the torque",
    "computing_delay": "the dead time",
}  # fmt: skip
# data that such a drive simply has not
_LEFT_OUT_AT_0 = ("damping", "load_friction", "torque_noise", "computing_delay")
_PROBE = 1e-3  # relative
GEAR_COUNTS, GEAR_CYCLE = 4000.0, 3.3e-3  # DCS 500B: counts of the nominal torque, cycle at 50 Hz in s


def kind_of(controller: Controller) -> str:
    """The name of the strategy behind a controller, tuned or not."""
    inner = getattr(controller, "controller", controller)
    return str(type(inner).name or type(inner).__name__)


@dataclass(frozen=True, eq=False, repr=False)
class Rise(OneLine):
    """A ramp for an inverter that asks for another figure than its time: exact, and rounded.

    `rise` is the time between the torques of the sheet (s) that comes of the rounded one, `run` the start.
    """

    exact: float
    rounded: float
    rise: float
    run: Run

    def summary(self) -> dict[str, float]:
        """As plain data."""
        figures = {"exact": self.exact, "rounded": self.rounded}
        return {**figures, "k_dyn": self.run.k_dyn, "start_time": self.run.start_time}


class Cell(NamedTuple):
    """A gap (rad) and a load inertia (kg m2) of a tuned set, with the starts of exact and rounded values.

    Of a start that cannot be finished there is none.
    """

    gap: float
    load_inertia: float
    exact: Run | None
    rounded: Run | None

    def summary(self) -> dict[str, float]:
        """As plain data."""
        found = {"gap": self.gap, "load_inertia": self.load_inertia}
        for end, run in (("", self.exact), ("_rounded", self.rounded)):
            figures = (math.nan, math.nan) if run is None else (run.k_dyn, run.limited_time)
            found |= {f"k_dyn{end}": float(figures[0]), f"start_time{end}": float(figures[1])}
        return found


@dataclass(frozen=True, eq=False, repr=False)
class ParameterSheet(Result):
    """What to set on the inverter for one strategy, and what comes of it; `str(sheet)` is its text.

    Attributes
    ----------
    name, kind : str
        Of the strategy, in tables; of the strategy behind tuned gains.
    controller : Controller
        The strategy as it was given.
    settings : tuple of Setting
        Its parameters, exact and rounded (SI).
    own : Drive
        The drive whose numbers the strategy works with.
    exact, rounded : Run
        The starts with the exact values, and with those that are printed. Where the rule by which the
        strategy was chosen holds at no step near there is no start with rounded values.
    torque_step : float
        That of the inverter, N m.
    computes_with : sequence of str or None
        Numbers of the drive that the strategy computes with; None if it does not tell.
    failure : str
        Why there is no start with rounded values.
    variants, corners : int, bool
        Starts in which the rounded values are half a step off: all combinations if `corners`, else each
        alone and all together.
    worst_k_dyn, slowest : float
        The largest K_dyn and the longest `Run.limited_time` (s) of these; NaN if one of them fails.
    full_rise, gear_ramp : Rise or None
        A ramp by its time from 0 to 100 % of torque, s, and by the rate that a DCS 500B counts.
    moved : tuple of str
        Settings that are not at their nearest step, because that rule would not hold there.
    loop : str
        Margins of a speed loop with the rounded values.
    margins : tuple of Margin
        Those to the limits of the machine with the rounded values, in the worst case.
    cells : tuple of Cell
        Of a robust set, those that it was tuned for.

    Examples
    --------
    >>> found = parameter_sheet("crane-4amtkf", "direct")
    >>> found
    <ParameterSheet: direct, K_dyn 3.1179 exact, 3.1178 rounded>
    >>> round(found.value("torque"), 3)  # 259.7 % of the rated torque, N m
    61.999

    References
    ----------
    K_dyn: [G] (16).
    """

    name: str
    kind: str
    controller: Controller
    settings: tuple[Setting, ...]
    own: Drive
    exact: Run
    torque_step: float
    computes_with: Sequence[str] | None
    rounded: Run | None = None
    failure: str = ""
    variants: int = 0
    corners: bool = False
    worst_k_dyn: float = math.nan
    slowest: float = math.nan
    full_rise: Rise | None = None
    gear_ramp: Rise | None = None
    moved: tuple[str, ...] = ()
    loop: str = ""  # margins of a speed loop with the rounded values
    margins: tuple[Margin, ...] = ()
    cells: tuple[Cell, ...] = ()

    def __repr__(self) -> str:
        """One line with K_dyn of exact and rounded values."""
        rounded = f"{self.rounded.k_dyn:.4f} rounded" if self.rounded else "cannot be rounded"
        return f"<ParameterSheet: {self.name}, K_dyn {self.exact.k_dyn:.4f} exact, {rounded}>"

    def __str__(self) -> str:
        """The sheet as a text of lines of 100 characters, to be copied."""
        from softstart.views.sheet import sheet_text

        return sheet_text(self.sheet)

    @cached_property
    def sheet(self) -> Any:
        """All that is shown of it: a `softstart.views.sheet.Sheet`."""
        from softstart.reporting.sheet_view import shown_sheet

        return shown_sheet(self)

    @property
    def drive(self) -> Machine:
        """The machine that starts."""
        return self.exact.drive

    @property
    def is_code(self) -> bool:
        """Whether no inverter has this strategy: its law is a program."""
        return self.kind not in WITHOUT_CODE

    def export_command(self, machine: str, named: str = "", language: str = "st") -> str:
        """The command that writes the program with the values of this sheet; "" where there is none.

        `named`: what stands for the strategy on the command line, if not its own name.

        >>> parameter_sheet("crane-4amtkf", "take-up").export_command("mine.toml")
        'softstart export mine.toml --controller take-up --as st --out take-up-st'
        """
        drive, one = self.drive.design_drive, self.controller
        usual = {setting.name: setting.rounded for setting in rounded_settings(one.set_up(drive)[0], drive)}
        moved = {one.name: one.rounded for one in self.settings if one.rounded != usual[one.name]}
        if self.computes_with is None or (moved and isinstance(one, Tuned)):  # whose file has the values
            return ""
        label = getattr(one, "label", "")
        given = {} if label else {key: v for key, v in one.parameters.items() if isinstance(v, float | str)}
        name = named or (f"{label}.toml" if label else self.kind)
        words = [word for key, value in (given | moved).items() for word in ("--param", f"{key}={value}")]
        words = ["softstart", "export", machine, "--controller", name, *words, "--as", language]
        return shlex.join([*words, "--out", f"{self.kind}-{language}"])

    @property
    def varied(self) -> list[Setting]:
        """The settings that were rounded."""
        return [one for one in self.settings if one.step is not None]

    @property
    def worst_peak(self) -> float:
        """The peak torque that belongs to `worst_k_dyn`, N m."""
        exact = self.exact
        return self.worst_k_dyn * exact.peak_torque / exact.k_dyn if exact.k_dyn > 0.0 else math.nan

    @property
    def values(self) -> dict[str, float]:
        """What its numbers are set to, SI."""
        return {one.name: one.rounded for one in self.settings if isinstance(one.rounded, float)}

    def value(self, name: str) -> float:
        """What a setting is set to, SI."""
        return float(next(one.rounded for one in self.settings if one.name == name))

    def torque_limits(self, drive: Drive, units: Units = IN_SI) -> list[str]:
        """The torque limits that leave this start as it is, in steps of the inverter."""
        demand = (self.rounded or self.exact).u
        (rated, basis), step, found = rated_torque(drive), self.torque_step, []
        for torque in (float(np.max(demand)), min(float(np.min(demand)), 0.0)):
            if torque:
                limit = math.copysign(math.ceil(abs(torque) / step * (1.0 - EVEN)) * step, torque)
                percent = step_multiple(100.0 * limit / rated, 100.0 * step / rated)
                own = units == units._replace(torque="N*m", gear=None)
                text = (
                    f"{step_multiple(limit, step)} N m" if own else seen(limit, "N*m", units) + units.behind
                )
                found.append(f"{text} ({percent} % of the {basis})")
        return found

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "controller": self.name,
            "settings": [
                one.summary() | ({} if self.rounded else {"rounded": None}) for one in self.settings
            ],
            "k_dyn": self.exact.k_dyn,
            "k_dyn_rounded": self.rounded.k_dyn if self.rounded else None,
            "start_time": self.exact.start_time,
            "start_time_rounded": self.rounded.start_time if self.rounded else None,
            "settled_time": self.exact.settled_time,
            "settled_time_rounded": self.rounded.settled_time if self.rounded else None,
            "k_dyn_half_a_step_off": self.worst_k_dyn,
            "start_time_half_a_step_off": self.slowest,
            "time_0_to_100_percent": self.full_rise.summary() if self.full_rise else None,
            "limits": [one.summary() for one in self.margins],
            "cells": [one.summary() for one in self.cells],
            "variants": self.variants,
            "failure": self.failure,
        }


def parameter_sheet(
    drive: MachineLike | Uncertain | DataSheet,
    controller: ControllerLike,
    *,
    parameters: Mapping[str, object] | None = None,
    resolution: Resolution | Mapping[str, object] | str | None = None,
) -> ParameterSheet:
    """The parameters of a strategy, rounded to what an inverter takes, and the start with them.

    Parameters
    ----------
    drive : Drive, Chain, Identification, DataSheet, str or path
        As in `compare`.
    controller : str or Controller
        A name, a file of tuned gains, or a Controller. Where the machine has limits that the strategy does
        not keep as it is, its parameters are set for them, as in `compare`.
    parameters : mapping, optional
        Those of a controller that is given by its name.
    resolution : Resolution, mapping or str, optional
        The steps in which the inverter can be set, as "torque=0.5%,time=10ms".

    Returns
    -------
    ParameterSheet
        `str(sheet)` is the sheet as a text. `rounded` is the start with exactly the values that are printed.

    Raises
    ------
    InputError
        Bad input.
    SimulationError
        A start that cannot be finished.

    Examples
    --------
    >>> found = parameter_sheet("crane-4amtkf", "s-curve", resolution="time=5ms")
    >>> found
    <ParameterSheet: s-curve, K_dyn 1.8794 exact, 1.8833 rounded>
    >>> found.value("time")
    0.11

    References
    ----------
    K_dyn: [G] (16).
    """
    steps = resolution if isinstance(resolution, Resolution) else Resolution.read(resolution or {})
    (one,) = make_controllers([controller], {controller: parameters} if parameters else {})  # type: ignore[dict-item]
    comparison = compare(drive, [one])
    row, (_, drawn, soft) = comparison.rows[0], as_far_as_known(drive)
    return make_sheet(comparison.drive, replace(one, **row.setting), row.run, steps, row, drawn, soft)


def make_sheet(
    machine: Machine,
    controller: Controller,
    exact: Run,
    resolution: Resolution,
    row: Row | None = None,
    drawn: MachineTable | None = None,
    soft: Drive | None = None,
) -> ParameterSheet:
    """The sheet of a strategy on a drive or chain; `exact` is its start there.

    With the `row` by which the strategy was chosen, the values of the sheet keep what that row keeps, on the
    drives `drawn` too where the drive is known within intervals, on `soft` where its stiffness is unknown.
    """
    drive = machine.design_drive
    ready, own = controller.set_up(drive)
    rated = rated_torque(drive)[0]
    name, settings = label_of(exact.controller or controller), rounded_settings(ready, drive, resolution)
    torque_step = resolution.step("", "N*m", rated) or 0.0
    sheet = ParameterSheet(
        name, kind_of(controller), controller, settings, own, exact, torque_step, computes_with(ready, own)
    )
    fixed: dict[str, Any] = {one.name: one.rounded for one in settings if one.step is None}
    ready = replace(ready, **{key: value for key, value in fixed.items() if isinstance(value, float)})
    two_masses = len(machine.shaft_names) == 1
    try:
        values, margins = _within_the_rule(machine, ready, own, sheet.varied, row, drawn, soft)
        moved = tuple(one.name for one in sheet.varied if values[one.name] != one.rounded)
        settings = tuple(replace(one, rounded=values.get(one.name, one.rounded)) for one in sheet.settings)
        set_to = replace(ready, **values)
        sheet = replace(
            sheet, settings=settings, moved=moved, rounded=simulate(machine, set_to, fitted_to=own),
            margins=margins, cells=_cells(machine, controller, set_to, own),
        )  # fmt: skip
        sheet = replace(sheet, loop=loop_in_words(machine, set_to))
        if sheet.kind in ORDINARY and two_masses:
            sheet = replace(sheet, **_rises(machine, set_to, own, rated, resolution.time))
        if sheet.varied:
            sheet = _half_steps_off(sheet, machine, ready, len(sheet.varied) <= ALL_CORNERS and two_masses)
    except (SimulationError, InputError) as error:
        sheet = replace(sheet, failure=" ".join(str(error).split()))
    return sheet


def _alone(count: int) -> list[tuple[int, ...]]:
    """Each value alone a step down or up."""
    return [tuple(side if k == i else 0 for k in range(count)) for i in range(count) for side in (-1, 1)]


def _within_the_rule(
    machine: Machine, ready: Controller, own: Drive, varied: Sequence[Setting], row: Row | None,
    drawn: MachineTable | None, soft: Drive | None,
) -> tuple[dict[str, float], tuple[Margin, ...]]:  # fmt: skip
    """The values at the steps nearest to the exact ones that keep what the row keeps, and their margins.

    Raises SimulationError where no step beside the nearest ones does.
    """
    steps = [(0,) * len(varied), *_alone(len(varied))]
    if len(varied) <= NEIGHBOURS:
        every = itertools.product((-1, 0, 1), repeat=len(varied))
        steps = sorted(every, key=lambda one: sum(map(abs, one)))  # the smallest changes first
    reason, tried = "", list[dict[str, float]]()
    for some in steps:
        values = {one.name: one.beside(step) for one, step in zip(varied, some, strict=True)}
        if values in tried:
            continue
        tried.append(values)
        if row is None:
            return values, ()
        broken, margins = _broken(machine, replace(ready, **values), own, row, drawn, soft)
        if not broken:
            return values, margins
        reason = reason or broken
    raise SimulationError(
        f"rounded to these steps the strategy breaks the rule by which it was chosen ({reason}), and so "
        "it does a step beside them: finer steps are needed."
    )


def _broken(
    machine: Machine,
    controller: Controller,
    own: Drive,
    row: Row,
    drawn: MachineTable | None,
    soft: Drive | None,
) -> tuple[str, tuple[Margin, ...]]:
    """What these values break of what the row keeps, a flag or a limit in the worst case; and the margins."""
    cases = tuple(case for case in row.worst_case if case in CASES)
    found = compared(machine, controller, row.direct, None, own, cases, drawn, soft)
    if found.flags and not row.flags:
        return found.flags[0].text, ()
    limits = checked_limits(machine)
    before = {margin.name: margin.kept for margin in row.margins(limits)}
    margins = found.margins(limits)
    return next((str(one) for one in margins if before[one.name] and not one.kept), ""), margins


def _cells(machine: Machine, given: Controller, set_to: Controller, own: Drive) -> tuple[Cell, ...]:
    """Exact and rounded values of a robust set in each of the cells for which it was tuned."""
    if not isinstance(given, RobustGains):
        return ()

    def start(cell: Machine, controller: Controller, fitted_to: Drive | None) -> Run | None:
        try:
            return simulate(cell, controller, fitted_to=fitted_to)
        except SimulationError:
            return None

    found = []
    for gap, inertia in itertools.product(given.gaps, given.load_inertias):
        cell = machine.with_gap_and_inertia(gap, inertia)
        found.append(Cell(gap, inertia, start(cell, given, None), start(cell, set_to, own)))
    return tuple(found)


def _rises(drive: Machine, ready: Any, own: Drive, rated: float, step: float) -> dict[str, Any]:
    """The same ramp as other inverters ask for it; nothing where there is no rise."""
    share = (ready.full_torque - ready.initial) / rated
    if not (share > 0.0 and ready.time > 0.0):
        return {}

    def rise(exact: float, rounded: float, time: float) -> Rise:
        return Rise(exact, rounded, time, simulate(drive, replace(ready, time=time), fitted_to=own))

    full = float(ready.time / share)
    rounded = nearest_step(full, step)
    found = {"full_rise": rise(full, rounded, rounded * share)}
    if kind_of(ready) == "ramp":
        counts = float(GEAR_COUNTS * share * GEAR_CYCLE)
        rate = max(1.0, float(round(counts / ready.time)))
        found["gear_ramp"] = rise(counts / ready.time, rate, counts / rate)
    return found


def _half_steps_off(
    sheet: ParameterSheet, machine: Machine, ready: Controller, corners: bool
) -> ParameterSheet:
    """The sheet with the worst of the starts whose values are half a step off, and of that of the sheet."""
    varied, count, rounded = sheet.varied, len(sheet.varied), sheet.rounded
    assert rounded is not None
    together: list[tuple[int, ...]] = [(-1,) * count, (1,) * count]
    sides = list(itertools.product((-1, 1), repeat=count)) if corners else [*_alone(count), *together]
    values = [{v.name: v.beside(0.5 * side) for v, side in zip(varied, one, strict=True)} for one in sides]
    set_ups = [(replace(ready, **one), sheet.own) for one in values]
    found = prepared([machine]).figures(set_ups, machine.mean_torque, np.zeros(len(sides), dtype=np.int64))
    time = limited_time(found)
    k_dyn = np.where(np.isnan(time), np.nan, found["k_dyn"][0])
    # the values as they are set are among what may be
    worst, slowest = np.maximum((np.max(k_dyn), np.max(time)), (rounded.k_dyn, rounded.limited_time))
    return replace(
        sheet, variants=len(sides), corners=corners, worst_k_dyn=float(worst), slowest=float(slowest)
    )


def computes_with(ready: Controller, own: Drive) -> list[str] | None:
    """The data of the drive that a controller computes with, beside its parameters; None if it does not tell.

    >>> from softstart.controller import make_controller
    >>> computes_with(*make_controller("acceleration-delay").set_up(Drive.load("crane-4amtkf")))
    ['J1']
    """
    if not isinstance(ready, CompiledController):
        return None
    numbers, found = np.asarray(ready.vector(own), dtype=np.float64), []
    for key, symbol in _DATA.items():
        value = float(getattr(own, key))
        if (value == 0.0 and key in _LEFT_OUT_AT_0) or np.isinf(value):
            continue
        changes: dict[str, Any] = {key: (1.0 - _PROBE) * value or 1e-6}
        try:
            moved = np.asarray(ready.vector(own.replace(**changes)), dtype=np.float64)
        except InputError:  # then it is read, at least
            found.append(symbol)
            continue
        if not np.array_equal(numbers, moved, equal_nan=True):
            found.append(symbol)
    return found
