"""What the sampled controllers share: parameters of many, encoder, mean torque of an interval."""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from softstart.controller import parameter
from softstart.drive import Drive
from softstart.input.parameters import Limit

LONGEST_PERIOD = 1e-3  # s
SAMPLES_PER_ELASTIC_PERIOD = 32
SHARE_OF_PATIENCE = 0.15
PERIODS_OF_PATIENCE = 50.0


def sample_period(drive: Drive) -> float:
    """Sample period in s: 1 ms (1 kHz), or 1/32 of the elastic period where that is shorter.

    >>> sample_period(Drive.load("crane-4amtkf"))
    0.001
    """
    return min(LONGEST_PERIOD, drive.elastic_period / SAMPLES_PER_ELASTIC_PERIOD)


def period_parameter() -> Any:
    """`period` as a field of a controller."""
    text = "1 ms, or 1/32 of the elastic period where that is shorter"
    return parameter("s", "sample period", lambda drive, p: sample_period(drive), text, "above 0")


def timeout_parameter(meaning: str = "latest instant for the feedback to act") -> Any:
    """`contact_timeout` as a field of a controller."""
    text = (
        "50 elastic periods and the time a drive without gap needs to its target speed on 15 % of its "
        "accelerating torque"
    )
    return parameter("s", meaning, lambda drive, p: contact_timeout(drive), text, "0 or more")


def full_torque_parameter(meaning: str, limit: Limit = "any") -> Any:
    """`full_torque` as a field of a controller."""
    default = "starting torque Ms"
    return parameter("N*m", meaning, lambda drive, p: drive.Ms, default, limit, multiples=(0.4, 1.0))


def pulling_load(drive: Drive) -> float:
    """Load torque as far as it brakes, max(0, Mc), in N m.

    >>> pulling_load(Drive.load("crane-4amtkf"))
    7.16
    """
    return max(drive.Mc, 0.0)


def contact_timeout(drive: Drive) -> float:
    """How long in s a controller waits for a contact it cannot see, before it goes on without.

    (J1 + J2)(target - w2(0))/(0.15 (Ms - max(0, Mc))) + 50 elastic periods: far beyond any sound start, so
    that it does not act as a timer, and yet no start waits indefinitely.

    >>> round(contact_timeout(Drive.load("crane-4amtkf")), 2)
    5.15
    """
    push = SHARE_OF_PATIENCE * (drive.Ms - pulling_load(drive))
    without_gap = (drive.J1 + drive.J2) * (drive.target_speed - drive.initial_load_speed) / push
    return without_gap + PERIODS_OF_PATIENCE * drive.elastic_period


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
