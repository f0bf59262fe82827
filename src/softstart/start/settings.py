"""The values of a strategy, rounded to what can be set on an inverter or written into its program."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from softstart.controller.base import Controller
from softstart.controller.parameters import declared_parameters
from softstart.drive import Drive
from softstart.start.resolution import Resolution, gain_base, nearest_step, rated_torque
from softstart.views.numbers import RPM, decimals_of, digits, fixed, short, unit

OFF_AT_0 = ("preload", "filter_time")  # 0 is none of it, not a value that may be half a step off
GAIN = "N*m*s/rad"  # of a speed controller
KEPT = ("period",)  # the cycle of the control code is what the inverter has, no setting
EVEN = 1e-9  # of a step: what lies above a multiple by no more than this is that multiple
COARSE = 0.1  # a step above this share of the value is said to be coarse
DEFAULT = Resolution()


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

    def shown(self, drive: Drive) -> tuple[str, str, str, str]:
        """What to set, its unit, the same in another one, and the exact value."""
        if isinstance(self.exact, str) or isinstance(self.rounded, str):
            return str(self.rounded), "", "", str(self.exact)
        factor, name, other = 1.0, unit(self.unit), ""
        if self.unit == "s":
            factor, name = 1e3, "ms"
        elif self.unit == "rad/s":
            factor, name = (0.5 / math.pi, "Hz") if "frequency" in self.name else (RPM, "rpm")
            other = f"{digits(self.rounded)} rad/s"
        elif self.unit == "N*m":
            rated, basis = rated_torque(drive)
            percent = step_multiple(100.0 * self.rounded / rated, self.step and 100.0 * self.step / rated)
            other = f"{percent} % of the {basis}"
        elif self.unit == GAIN:
            other = f"{digits(self.rounded / gain_base(drive)[0])} % of torque per % of speed"
        value, exact = factor * self.rounded, short(float(f"{factor * self.exact:.5g}"))
        if self.name in KEPT:
            digit = 10.0 ** (math.floor(math.log10(value)) - 2) if value > 0.0 else 1.0
            most = math.floor(value / digit * (1.0 + EVEN)) * digit  # not longer than it may be
            return f"≤ {short(float(f'{most:.3g}'))}", name, "", exact
        text = short(float(f"{value:.4g}")) if self.step is None else step_multiple(value, factor * self.step)
        return text, name, other, exact


def step_multiple(value: float, step: float | None) -> str:
    """A multiple of a step: all its decimals if the step is a short decimal, else those that tell it apart.

    >>> step_multiple(62.0, 0.5), step_multiple(34.5683, 0.0238732), step_multiple(123.4567, 0.0238732)
    ('62.0', '34.57', '123.46')
    """
    if not step:
        return short(value)
    step = float(f"{step:.9g}")
    if decimals_of(step) <= 6 and step == float(f"{step:.4g}"):
        return fixed(value, decimals_of(step))
    order = math.floor(math.log10(abs(value))) if value else 0
    if not -4 <= order <= 6:
        return digits(value, 7)
    return fixed(value, min(max(math.ceil(-math.log10(step)), 3 - order, 0), max(6 - order, 0)))


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
        number = float(value)
        step = None if name in KEPT else resolution.step(name, unit, rated)
        if unit == GAIN:  # in shares of per cent of torque per per cent of speed
            step = resolution.share * gain_base(drive)[0]
        if name in OFF_AT_0 and number == 0.0:
            step = None
        if step is None or not math.isfinite(number):
            found.append(Setting(name, meaning, unit, number, number, None))
            continue
        least, most = declared.between or (-math.inf if number < 0.0 else 0.0, math.inf)
        most = float(drive.maximum_torque) if unit == "N*m" else float(most)
        rounded = nearest_step(number, step, max(most, 0.0))
        least = min(float(least), rounded)
        found.append(Setting(name, meaning, unit, number, rounded, step, least, most))
    return tuple(found)
