"""What the sampled controllers share: sample period, encoder, mean torque of an interval, checks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np
from numba import njit

from softstart.controller import Controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.quantities import show

LONGEST_PERIOD = 1e-3  # s
SAMPLES_PER_ELASTIC_PERIOD = 32
PERIOD_DEFAULT = "1 ms, or 1/32 of the elastic period where that is shorter"
SHARE_OF_PATIENCE = 0.15
PERIODS_OF_PATIENCE = 50.0
PATIENCE_DEFAULT = (
    "50 elastic periods and the time a drive without gap needs to its target speed on 15 % of its "
    "accelerating torque"
)


def number(value: Any) -> Any:
    """A float for a single drive, the array for a batch.

    >>> number(np.float64(2)), number(np.array([1.0, 2.0]))
    (2.0, array([1., 2.]))
    """
    return value if np.ndim(value) else float(value)


def sample_period(drive: Drive) -> Any:
    """Sample period in s: 1 ms (1 kHz), or 1/32 of the elastic period where that is shorter.

    >>> sample_period(Drive.load("crane-4amtkf"))
    0.001
    """
    return number(np.minimum(LONGEST_PERIOD, drive.elastic_period / SAMPLES_PER_ELASTIC_PERIOD))


def pulling_load(drive: Drive) -> Any:
    """Load torque as far as it brakes, max(0, Mc), in N m.

    >>> pulling_load(Drive.load("crane-4amtkf"))
    7.16
    """
    return number(np.maximum(drive.Mc, 0.0))


def patience(drive: Drive) -> Any:
    """How long in s a controller waits for a contact it cannot see, before it goes on without.

    (J1 + J2)(target - w2(0))/(0.15 (Ms - max(0, Mc))) + 50 elastic periods: far beyond any sound start, so
    that it does not act as a timer, and yet no start waits indefinitely.

    >>> round(patience(Drive.load("crane-4amtkf")), 2)
    5.15
    """
    push = SHARE_OF_PATIENCE * (drive.Ms - pulling_load(drive))
    without_gap = (drive.J1 + drive.J2) * (drive.target_speed - drive.initial_load_speed) / push
    return number(without_gap + PERIODS_OF_PATIENCE * drive.elastic_period)


@njit(cache=True, nogil=True, error_model="numpy")
def mean_torque(before: float, after: float, demand: float) -> float:
    """Mean motor torque of an interval, from the torque measured at its ends and the constant demand in it.

    A torque that follows its demand with a lag goes from `before` to `after` exponentially:
    mean = demand - (b - a)/ln(b/a) with b = demand - before, a = demand - after; exact for any lag, also for
    none (after = demand, mean = demand), and close under a slew limit.

    >>> mean_torque(0.0, 62.0, 62.0), round(mean_torque(0.0, 62.0 * (1.0 - math.exp(-1.0)), 62.0), 3)
    (62.0, 22.809)
    """
    b = demand - before
    a = demand - after
    if a * b <= 0.0:  # there already, or past it: a demand cut by the limits of the motor
        return after
    if abs(b - a) <= 1e-6 * abs(b):
        return 0.5 * (before + after)
    return demand - (b - a) / math.log(b / a)


def check(controller: Controller, above_zero: Iterable[str] = (), not_negative: Iterable[str] = ()) -> None:
    """Refuse impossible parameters, all in one `InputError`; None stands for "derive it from the drive".

    Parameters named in neither list only have to be finite; one with choices has to be one of these.
    """
    above, from_zero = set(above_zero), set(not_negative)
    wrong = []
    for field in fields(controller):
        value, choices = getattr(controller, field.name), field.metadata.get("choices", ())
        if choices and value is not None and value not in choices:
            wrong.append(f"{field.name} = {show(value)}: write {' or '.join(map(show, choices))}.")
    for name, value in controller.parameters.items():
        if value is None or isinstance(value, str):
            continue
        values = np.asarray(value, dtype=np.float64)
        good, rule = np.isfinite(values), "finite"
        if name in above:
            good, rule = good & (values > 0.0), "above 0"
        elif name in from_zero:
            good, rule = good & (values >= 0.0), "0 or more"
        if not good.all():
            shown = float(values[~good].flat[0]) if values.ndim else float(values)
            wrong.append(
                f"{name} = {shown:g}: the parameter of the controller {controller.name} must be {rule}."
            )
    if wrong:
        raise InputError(wrong)
