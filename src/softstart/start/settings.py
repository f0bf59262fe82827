"""The values of a strategy, rounded to what can be set on an inverter or written into its program."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from softstart.controller.base import Controller
from softstart.controller.parameters import declared_parameters
from softstart.drive import Drive
from softstart.quantities import Units
from softstart.start.resolution import Resolution, gain_base, nearest_step, rated_torque
from softstart.start.setting import rounded as rounded_down
from softstart.views.numbers import IN_SI, RPM, column_of, decimals_of, number, short, unit

OFF_AT_0 = ("preload", "filter_time")  # 0 is none of it, not a value that may be half a step off
GAIN = "N*m*s/rad"  # of a speed controller
KEPT = ("period",)  # the cycle of the control code is what the inverter has, no setting
EVEN = 1e-9  # of a step: what lies above a multiple by no more than this is that multiple
COARSE = 0.1  # a step above this share of the value is said to be coarse
TOLD_APART = 6  # decimals of the steps of which every multiple is printed exactly
DEFAULT = Resolution()


@dataclass(frozen=True)
class Setting:
    """One value of a strategy in SI: exact, and rounded to `step`; without a step to four digits.

    What `shown` prints is the rounded value itself, so that a start with the printed values is that of the
    sheet. The cycle of a program is rounded to three digits, and never up.
    """

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
            isinstance(self.exact, float)
            and self.step is not None
            and self.step > COARSE * abs(self.exact) > 0.0
        )

    def beside(self, steps: float) -> float:
        """The value so many steps beside the nearest one, within what the parameter may be."""
        assert self.step is not None
        assert isinstance(self.rounded, float)
        most = max(self.most, self.rounded)
        return min(max(self.rounded + steps * self.step, self.least), most) if steps else self.rounded

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {key: getattr(self, key) for key in ("name", "unit", "exact", "rounded", "step")}

    def unit_at_inverter(self, drive: Drive) -> tuple[float, str]:
        """The unit in which the value is set, and what it is of that in SI.

        Torques and gains are in per cent where their steps are, else as they are.
        """
        if self.unit == "s":
            return 1e-3, "ms"
        if self.unit == "rad/s":
            return (2.0 * math.pi, "Hz") if "frequency" in self.name else (1.0 / RPM, "rpm")
        (rated, basis), gain = rated_torque(drive), gain_base(drive)[0]
        in_percent = {"N*m": (0.01 * rated, f"% of the {basis}"), GAIN: (gain, "% of torque per % of speed")}
        share, name = in_percent.get(self.unit, (1.0, ""))
        if name and (self.step is None or is_short(self.step / share)):
            return share, name
        return 1.0, unit(self.unit)

    def shown(self, drive: Drive, units: Units = IN_SI) -> tuple[str, str, str, str]:
        """What to set, its unit, the same as it is seen, and the exact value; all in ASCII.

        What is set is the motor's, wherever the rest is seen.
        """
        if isinstance(self.exact, str) or isinstance(self.rounded, str):
            return str(self.rounded), "", "", str(self.exact)
        share, name = self.unit_at_inverter(drive)
        value, exact = self.rounded / share, short(float(f"{self.exact / share:.5g}"))
        if self.name in KEPT:
            return short(value), name, "or less", exact
        text = short(value) if self.step is None else step_multiple(value, self.step / share)
        units = units.of_setting(self.name, self.unit)
        if units.of(self.unit) == name and not units.gear:
            units = IN_SI  # what is set is not said twice
        there, other = units.is_at_output(self.unit), ""
        if there or name not in (unit(units.of(self.unit)), "ms"):
            shown = float(units.shown(self.rounded, self.unit))
            other = f"{column_of([shown])[0]} {unit(units.of(self.unit))}"
        return text, name + " of the motor" * (there and "%" not in name), other, exact


def is_short(step: float) -> bool:
    """Whether a step is a short decimal, so that its multiples can be printed exactly.

    >>> is_short(0.1), is_short(0.0238732)
    (True, False)
    """
    step = float(f"{step:.9g}")
    return decimals_of(step) <= TOLD_APART and step == float(f"{step:.4g}")


def step_multiple(value: float, step: float | None) -> str:
    """A multiple of a step: all its decimals if the step is a short decimal, else those that tell it apart.

    >>> step_multiple(62.0, 0.5), step_multiple(34.5683, 0.0238732), step_multiple(123.4567, 0.0238732)
    ('62.0', '34.57', '123.46')
    """
    if not step:
        return short(value)
    if is_short(step):
        return number(value, decimals_of(float(f"{step:.9g}")))
    order = math.floor(math.log10(abs(value))) if value else 0
    if not -4 <= order <= 6:
        return column_of([value], 7)[0]
    return number(value, min(max(math.ceil(-math.log10(step)), 3 - order, 0), max(6 - order, 0)))


def rounded_settings(
    ready: Controller, drive: Drive, resolution: Resolution = DEFAULT
) -> tuple[Setting, ...]:
    """The parameters of a controller that is set up, each exact and rounded.

    >>> from softstart.controller import make_controller
    >>> crane = Drive.load("crane-4amtkf")
    >>> ready, _ = make_controller("ramp", {"time": 0.11184}).set_up(crane)
    >>> {one.name: one.rounded for one in rounded_settings(ready, crane)}["time"]
    0.112
    """
    rated, found = rated_torque(drive)[0], []
    for name, declared in declared_parameters(ready).items():
        value, unit, meaning = getattr(ready, name), declared.unit, declared.meaning
        if value is None or declared.python_only:
            continue
        if not isinstance(value, int | float) or isinstance(value, bool):
            found.append(Setting(name, meaning, unit, str(value), str(value), None))
            continue
        exact = float(value)
        step = None if name in KEPT else resolution.step(name, unit, rated)
        if unit == GAIN:  # in shares of per cent of torque per per cent of speed
            step = resolution.share * gain_base(drive)[0]
        if name in OFF_AT_0 and exact == 0.0:
            step = None
        least, most = declared.between or (-math.inf if exact < 0.0 else 0.0, math.inf)
        if step is None or not math.isfinite(exact):
            told = rounded_down(exact) if name in KEPT else min(max(float(f"{exact:.4g}"), least), most)
            found.append(Setting(name, meaning, unit, exact, told, None))
            continue
        most = float(drive.maximum_torque) if unit == "N*m" else float(most)
        rounded = nearest_step(exact, step, max(most, 0.0))
        least = min(float(least), rounded)
        found.append(Setting(name, meaning, unit, exact, rounded, step, least, most))
    return tuple(found)
