"""Closing the gap softly: what `current-limit-feedback`, `shaped` and `state-feedback` share.

The motor takes up `approach_speed` relative to the load and keeps it,

    u = clip(J1 (w2 + approach_speed - w1)/(2 (period + lag + computing delay)), 0, low_torque)

The speed of the load is known: at the start w2(0), under an active load less Mc t/J2 (down to half the
approach speed, no further), and after a contact as estimated (`contact`). From contact on the strategy
itself sets the torque. Where an encoder count above a tenth of Ms/c shows the contact too late, and after
`contact_timeout`, the torque is raised in a ramp.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from softstart import formulas
from softstart.controller import CompiledController, Effort, Numbers, ParameterValues, parameter
from softstart.controller.compiled import Double, inner, record
from softstart.drive import Drive
from softstart_controllers import contact
from softstart_controllers.reduced import load_drift
from softstart_controllers.sampled import (
    full_torque_parameter,
    period_parameter,
    pulling_load,
    timeout_parameter,
)

COARSE = 0.1  # of Ms/c: with larger counts the contact is over before it is seen
ROOM = 0.99  # of the full torque, to which a feedback raises it: below its limit it can act both ways
LOW_TORQUE_SHARE = 0.5  # of the accelerating torque

# phases; those of a strategy follow
GAP_OPEN, CLOSED, RAISING, NEXT = 0.0, 1.0, 2.0, 3.0


class Parameters:
    """Estimator and limits; `drift` the slowing down of the load."""

    estimator: contact.Parameters
    low_torque: float
    full_torque: float
    approach_speed: float
    horizon: float
    drift: float
    contact_timeout: Double
    undetectable: float


class State:
    """The estimate, and how far the landing is."""

    estimator: contact.State
    sample: int
    phase: float


PARAMETERS = record(Parameters, estimator=contact.PARAMETERS)
STATE = record(State, estimator=contact.STATE)


@inner
def landed(p: Parameters, x: State, m: Any) -> float:
    """See a sample and tell the phase; the torque while the gap is open, or where nothing can be seen."""
    estimator = x.estimator
    if x.phase <= CLOSED:
        contact.observe(p.estimator, estimator, m.time, m.motor_torque, m.motor_angle, m.motor_speed, 1.0)
        x.phase = CLOSED if estimator.closed != 0.0 else GAP_OPEN
        if p.undetectable != 0.0 or m.time >= p.contact_timeout:
            x.phase = RAISING
    if x.phase == RAISING:
        return min(estimator.sent[0] + p.estimator.raising, p.full_torque)
    allowed = estimator.load_speed + p.approach_speed
    if estimator.load_time == 0.0:  # never less than half: a contact not seen must not let the load run back
        allowed -= min(p.drift * m.time, 0.5 * p.approach_speed)
    return min(max((allowed - estimator.now.speed) / (p.estimator.a * p.horizon), 0.0), p.low_torque)


@inner
def sent(p: Parameters, x: State, torque: float, u: float) -> float:
    """Keep what this sample demands; the instant of the next one."""
    contact.send(p.estimator, x.estimator, torque, u)
    x.sample += 1
    return x.sample * p.estimator.period


def shaft_torque_under(drive: Drive, torque: float) -> float:
    """Mean shaft torque in contact under a motor torque; a load that pushes is not counted.

    >>> round(shaft_torque_under(Drive.load("crane-4amtkf"), 62), 2)
    52.86
    """
    return float(formulas.mean_shaft_torque(torque, drive.J1, drive.J2, pulling_load(drive)))


def low_torque(drive: Drive, p: ParameterValues) -> float:
    """Load torque plus half the accelerating torque, in N m."""
    held = pulling_load(drive)
    return held + LOW_TORQUE_SHARE * (drive.Ms - held)


def approach_speed(drive: Drive, p: ParameterValues) -> float:
    """Speed in rad/s of which the impact alone swings the shaft to the share `impact` of the full torque."""
    return drive.Omega * p.impact * shaft_torque_under(drive, p.full_torque) / drive.c


def approach_parameter(impact: str) -> Any:
    """`approach_speed` as a field of a controller; `impact` in words."""
    text = f"c dw12/Omega = {impact} of the mean shaft torque under the full torque"
    meaning = "speed relative to the load at which the gap is closed"
    return parameter("rad/s", meaning, approach_speed, text, "above 0", multiples=(0.3, 3.0))


@dataclass(frozen=True)
class Landing(CompiledController):
    """A strategy that lands softly. `impact` is c dw12/Omega over the shaft torque under the full torque."""

    effort = Effort.ENCODER
    time_parameter = "full_torque"
    impact: ClassVar[float] = 0.7

    # fmt: off
    low_torque: float = parameter("N*m", "torque limit while the gap is open", low_torque,
        "load torque plus half the accelerating torque", "above 0", multiples=(0.3, 2.0))
    approach_speed: float = approach_parameter("0.7")
    full_torque: float = full_torque_parameter("torque limit after the rise", "above 0")
    detection_threshold: float = contact.threshold_parameter()
    uncertainty: float = contact.uncertainty_parameter()
    contact_timeout: float = timeout_parameter()
    period: float = period_parameter()
    # fmt: on

    def numbers(self, drive: Drive) -> Numbers:
        """The numbers of `Parameters` as `landing`."""
        landing = {
            "estimator": contact.estimator_parameters(drive, self, self.approach_speed),
            "horizon": 2.0 * (self.period + drive.torque_lag + drive.computing_delay),
            "drift": load_drift(drive),
            "undetectable": contact.contact_undetectable(drive, COARSE) and not contact.hanging(drive)[0],
        }
        return {"landing": landing}
