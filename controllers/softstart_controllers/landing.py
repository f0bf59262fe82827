"""Closing the gap softly: what `shaped` and `state-feedback` share.

The motor takes up `approach_speed` relative to the load and keeps it,

    u = clip(J1 (w2 + approach_speed - w1)/(2 (period + lag + computing delay)), 0, low_torque)

The speed of the load is known: at the start w2(0), under an active load less Mc t/J2 (down to half the
approach speed, no further), and after a contact as estimated (`contact`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from softstart.controller import parameter
from softstart.controller.compiled import inner, record
from softstart.drive import Drive
from softstart_controllers import contact
from softstart_controllers.reduced import load_drift
from softstart_controllers.sampled import pulling_load

COARSE = 0.1  # of Ms/c: with larger counts the contact is over before it is seen
SLOW = 2.0  # sqrt(J1/c): with a torque later than this no feedback comes in time
ROOM = 0.99  # of the full torque, to which a feedback raises it: below its limit it can act both ways
LOW_TORQUE_SHARE = 0.5  # of the accelerating torque


class Parameters:
    """What `landing_numbers` gives."""

    low: float
    approach: float
    horizon: float
    drift: float
    blind: float


PARAMETERS = record(Parameters)


@inner
def approach(p: Parameters, near: contact.Parameters, x: contact.State, t: float) -> float:
    """The torque that closes the gap, within 0 and the low torque."""
    allowed = x.load_speed + p.approach
    if x.load_time == 0.0:  # never less than half: a contact not seen must not let the load run back
        allowed -= min(p.drift * t, 0.5 * p.approach)
    return min(max((allowed - x.now.speed) / (near.a * p.horizon), 0.0), p.low)


def shaft_torque_under(drive: Drive, torque: Any) -> float:
    """Mean shaft torque in contact under a motor torque; a load that pushes is not counted.

    >>> round(shaft_torque_under(Drive.load("crane-4amtkf"), 62), 2)
    52.86
    """
    under: float = (torque * drive.J2 + drive.J1 * pulling_load(drive)) / (drive.J1 + drive.J2)
    return under


def horizon(drive: Drive, period: float) -> float:
    """Time in s in which the speed control takes the motor to its speed."""
    return 2.0 * (period + drive.torque_lag + drive.computing_delay)


def landing_numbers(drive: Drive, p: Any) -> dict[str, float]:
    """The numbers of `Parameters`, for a controller with its parameters."""
    return {
        "low": p.low_torque,
        "approach": p.approach_speed,
        "horizon": horizon(drive, p.period),
        "drift": load_drift(drive),
        "blind": contact.blind(drive, COARSE, SLOW) and not contact.hanging(drive)[0],
    }


def low_torque_parameter() -> Any:
    """`low_torque` as a field of a controller."""

    def value(drive: Drive, p: Any) -> float:
        held = pulling_load(drive)
        return held + LOW_TORQUE_SHARE * (drive.Ms - held)

    return parameter(
        "N*m",
        "torque limit while the gap is open",
        "load torque plus half the accelerating torque",
        value=value,
        rule="above 0",
        multiples=(0.3, 2.0),
    )


def approach_speed_parameter(share: str, impact: Callable[[Any], float]) -> Any:
    """`approach_speed` as a field of a controller: of which the impact makes a share of the full torque."""
    return parameter(
        "rad/s",
        "speed at which the gap is closed",
        f"c dw12/Omega = {share} of the mean shaft torque under the full torque",
        value=lambda drive, p: drive.Omega * impact(p) * shaft_torque_under(drive, p.full_torque) / drive.c,
        rule="above 0",
        multiples=(0.3, 3.0),
    )
