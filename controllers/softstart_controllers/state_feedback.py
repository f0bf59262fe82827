"""Linear-quadratic feedback of the estimated state, switched on at contact."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softstart.controller import Numbers, compiled_step, parameter
from softstart.controller.compiled import (
    MEASURED,
    Double,
    Reply,
    Vector,
    as_record,
    compiled,
    keep_state,
    record,
)
from softstart.drive import Drive
from softstart_controllers import landing
from softstart_controllers.contact import predicted_state
from softstart_controllers.landing import CLOSED, ROOM, Landing, landed, sent
from softstart_controllers.regulator import feedback_gains

SLEWED_SHARE = 0.25  # of Ms
LARGEST_DAMPING = 0.95  # damping ratio that the design may have


class Parameters:
    """The landing, and the weights f of the feedback."""

    landing: landing.Parameters
    rise: Double
    f_twist: float
    f_rate: float
    f_torque: float


class State:
    """The landing, and how far the reference has risen."""

    landing: landing.State
    progress: Double


PARAMETERS = record(Parameters, landing=landing.PARAMETERS)
STATE = record(State, landing=landing.STATE)
COMMAND = record(Reply, State, landing=landing.STATE)


@compiled
def feedback(p: Parameters, u: float, y: State) -> float:
    """The torque that the feedback asks for, within 0 and the full torque; raises the reference."""
    estimator = y.landing.estimator
    near, shaft = p.landing.estimator, estimator.shaft
    a, b, c = near.a, shaft.b, near.c
    w1, z, w2, torque = predicted_state(near, estimator, u)
    share, load = a / (a + b), near.Mc * b / (a + b)  # of the motor torque, in the mean torque of the shaft
    Omega = math.sqrt(c * (a + b))
    low, full = share * p.landing.low_torque + load, share * ROOM * p.landing.full_torque + load
    reference = low + (full - low) * y.progress
    rate = (full - low) / p.rise if y.progress < 1.0 else 0.0
    if estimator.held == 0.0:  # else the reference waits for the brake
        y.progress = min(1.0, y.progress + near.period / p.rise)
    mean = reference + near.d / c * rate - p.f_twist * (c * z - reference)
    mean -= p.f_rate * (c * (w1 - w2) - rate) / Omega
    mean -= p.f_torque * (share * torque + load - reference)
    return min(max((mean - load) / share, 0.0), p.landing.full_torque)


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Land; from contact on estimate the state and feed it back."""
    p = as_record(parameters, PARAMETERS)
    m = as_record(measured, MEASURED)
    y = as_record(command, COMMAND)
    keep_state(state, command)
    y.torque = landed(p.landing, y.landing, m)
    if y.landing.phase == CLOSED:
        y.torque = feedback(p, m.motor_torque, y)
    y.ask_again = sent(p.landing, y.landing, y.torque, m.motor_torque)


@dataclass(frozen=True)
class StateFeedback(Landing):
    """Soft landing, then a linear-quadratic regulator of the shaft torque on a Kalman filter.

    It measures the motor angle (encoder) and the motor torque. The gap is nowhere among its numbers.

    *Landing.* As `shaped`: the gap is closed `approach_speed` faster than the load, with at most
    `low_torque` (`landing`). The contact and what follows are estimated (`contact`): phi1, w1, the twist z,
    w2 and 1/J2, which takes up what is wrong in the model of the load.

    *Feedback.* The reference T_ref rises from the mean shaft torque under the low torque to that under 99 %
    of `full_torque` (below it the feedback can act both ways) in the time `rise`. With M = (u J2 + Mc J1)/
    (J1 + J2), the mean torque under the motor torque u, and M_y that under the torque the lagging motor has
    reached by now,

        M = T_ref + 2 zeta T_ref'/Omega - f1 (T - T_ref) - f2 (T' - T_ref')/Omega - f3 (M_y - T_ref)

    u is limited to 0 and full_torque. f1 to f3 minimise the sum over the samples of

        torque_weight (T - T_ref)^2 + rate_weight ((T' - T_ref')/Omega)^2 + (M - T_ref)^2

    for the drive with its lag, sampled. Here T is c z. A limited torque rate counts as more lag, by the time
    in which it slews a quarter of Ms; a dead time is bridged by the model.

    A load that hangs at first is in contact from the first sample on, and the reference waits for the brake.
    Weights are on a grid (`regulator`), so neighbouring ones may give the same start.

    Source: linear-quadratic-Gaussian control as in the manual of python-control; landing as `shaped`.

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(simulate(crane.replace(gap=gap), StateFeedback()).k_dyn, 1) for gap in (0.5, 2)]
    [1.0, 1.0]
    """

    name = "state-feedback"
    summary = "soft landing, then LQR of the shaft torque on a Kalman filter"
    source = "LQG, python-control"
    kernel = step

    # fmt: off
    rise: float = parameter("s", "rise time of the reference after contact",
        lambda drive, p: 0.75 * drive.elastic_period, "three quarters of the elastic period", "0 or more",
        multiples=(0.2, 5.0))
    torque_weight: float = parameter("1",
        "weight of the error of T, that of the mean torque under the motor being 1", 3.0, limit="above 0",
        multiples=(0.03, 30.0))
    rate_weight: float = parameter("1",
        "weight of T'/Omega, that of the mean torque under the motor being 1", 4.0, limit="above 0",
        multiples=(0.03, 30.0))
    # fmt: on

    def numbers(self, drive: Drive) -> Numbers:
        """Landing, rise, and gains."""
        ratio = min(0.5 * drive.d * drive.Omega / drive.c, LARGEST_DAMPING)
        lag = drive.torque_lag + SLEWED_SHARE * drive.Ms / drive.torque_rate
        step = drive.Omega * self.period
        f_twist, f_rate, f_torque = feedback_gains(
            step, ratio, drive.Omega * lag, self.torque_weight, self.rate_weight
        )
        return super().numbers(drive) | {
            "rise": max(self.rise, self.period),
            "f_twist": f_twist,
            "f_rate": f_rate,
            "f_torque": f_torque,
        }
