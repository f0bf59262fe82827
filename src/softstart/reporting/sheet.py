"""The parameter sheet of a strategy: its values rounded to what can be set, and started again with them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softstart.controller import CompiledController, Controller
from softstart.controller.base import label_of
from softstart.drive import Drive, Machine
from softstart.drive.machine_table import MachineTable
from softstart.errors import InputError, SimulationError
from softstart.linear.view import loop_in_words
from softstart.results import OneLine
from softstart.start.batch import prepared
from softstart.start.comparison import compared
from softstart.start.recommendation import CASES, Row, checked_limits
from softstart.start.resolution import Resolution, nearest_step, rated_torque
from softstart.start.results import limited_time
from softstart.start.run import Run
from softstart.start.settings import EVEN, Setting, rounded_settings, step_multiple
from softstart.start.simulation import simulate

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


@dataclass(frozen=True, eq=False, repr=False)
class ParameterSheet(OneLine):
    """What to set on the inverter for one strategy, and what comes of it: a result.

    What is shown of any result is a `softstart.views.sheet.Sheet`, what is known of a drive a `DataSheet`.

    `exact` and `rounded` are starts of the drive with the exact and the rounded values. `worst_k_dyn` is the
    largest K_dyn, `slowest` the longest `Run.limited_time` (s) of `variants` starts in which the rounded
    values are half a step off, all combinations if `corners`, else each alone and all together; NaN if one
    of them fails. `moved` names settings that are not at their nearest step, because the rule by which
    the strategy was chosen would not hold there; where it holds nowhere near, there is no start with rounded
    values, and `failure` says why. `own` is the drive whose numbers the strategy works with,
    `computes_with` says with which of them. `torque_step` (N m) is that of the inverter. `full_rise` is a
    ramp by its time from 0 to 100 % of torque, s, `gear_ramp` by the rate that a DCS 500B counts.
    """

    name: str
    kind: str
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

    def torque_limits(self, drive: Drive) -> list[str]:
        """The torque limits that leave this start as it is, in steps of the inverter."""
        demand = (self.rounded or self.exact).u
        (rated, basis), step, found = rated_torque(drive), self.torque_step, []
        for torque in (float(np.max(demand)), min(float(np.min(demand)), 0.0)):
            if torque:
                limit = math.copysign(math.ceil(abs(torque) / step * (1.0 - EVEN)) * step, torque)
                percent = step_multiple(100.0 * limit / rated, 100.0 * step / rated)
                found.append(f"{step_multiple(limit, step)} N m ({percent} % of the {basis})")
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
            "variants": self.variants,
            "failure": self.failure,
        }


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
        name, kind_of(controller), settings, own, exact, torque_step, computes_with(ready, own)
    )
    two_masses = len(machine.shaft_names) == 1
    try:
        values = _within_the_rule(machine, ready, own, sheet.varied, row, drawn, soft)
        moved = tuple(one.name for one in sheet.varied if values[one.name] != one.rounded)
        settings = tuple(replace(one, rounded=values.get(one.name, one.rounded)) for one in sheet.settings)
        set_to = replace(ready, **values)
        sheet = replace(
            sheet, settings=settings, moved=moved, rounded=simulate(machine, set_to, fitted_to=own)
        )
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
) -> dict[str, float]:  # fmt: skip
    """The values at the steps nearest to the exact ones that keep what the row keeps.

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
        broken = "" if row is None else _broken(machine, replace(ready, **values), own, row, drawn, soft)
        if not broken:
            return values
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
) -> str:
    """What these values break of what the row keeps, a flag or a limit in the worst case, or nothing."""
    cases = tuple(case for case in row.worst_case if case in CASES)
    found = compared(machine, controller, row.direct, None, own, cases, drawn, soft)
    if found.flags and not row.flags:
        return found.flags[0].text
    limits = checked_limits(machine)
    before = {margin.name: margin.kept for margin in row.margins(limits)}
    return next((str(one) for one in found.margins(limits) if before[one.name] and not one.kept), "")


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
