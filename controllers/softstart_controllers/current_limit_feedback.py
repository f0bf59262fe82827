"""[G]: current limit with a flexible feedback of the estimated shaft torque."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softstart.controller import Numbers, compiled_step, parameter
from softstart.controller.compiled import MEASURED, Double, Reply, Vector, as_record, keep_state, record
from softstart.drive import Drive
from softstart_controllers import landing
from softstart_controllers.contact import predicted_state
from softstart_controllers.landing import CLOSED, ROOM, Landing, landed, sent
from softstart_controllers.reduced import reduced_torque_parameter

DAMPING_RATIO = 0.7
SLEWED_SHARE = 0.25  # of Ms
PHASE_LEFT = math.pi / 6  # phase margin that the delays must leave


class Parameters:
    """The landing, and the limit with its feedback."""

    landing: landing.Parameters
    feedback: float
    rise: Double


class State:
    """The landing, and how far the limit has risen."""

    landing: landing.State
    progress: Double


PARAMETERS = record(Parameters, landing=landing.PARAMETERS)
STATE = record(State, landing=landing.STATE)
COMMAND = record(Reply, State, landing=landing.STATE)


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Land at the approach speed; from contact on the limit rises, less the feedback of T'."""
    p = as_record(parameters, PARAMETERS)
    m = as_record(measured, MEASURED)
    y = as_record(command, COMMAND)
    keep_state(state, command)
    near, now = p.landing, y.landing
    y.torque = landed(near, now, m)
    if now.phase == CLOSED:
        w1, _, w2, _ = predicted_state(near.estimator, now.estimator, m.motor_torque)
        limit = near.low_torque + (ROOM * near.full_torque - near.low_torque) * y.progress
        y.torque = min(max(limit - p.feedback * (w1 - w2), 0.0), near.full_torque)
        if now.estimator.held == 0.0:  # else the limit waits for the brake
            y.progress = min(1.0, y.progress + p.rise)
    y.ask_again = sent(near, now, y.torque, m.motor_torque)


@dataclass(frozen=True)
class CurrentLimitFeedback(Landing):
    """Torque limit with a derivative ("flexible") feedback of the estimated shaft torque.

    It measures the motor angle (encoder) and the motor torque. The gap is nowhere among its numbers.

    *Gap open.* The low limit accelerates the motor until it is `approach_speed` faster than the load, and
    keeps that speed (`landing`). At Omega M12avg/c the impact alone gives K_dyn = 1, from however wide a gap;
    the default is 0.85 of it, which leaves the rise some room.
    *Gap closed.* The limit rises from `low_torque` to 99 % of `full_torque` in the time `rise`, while the gap
    is closed, and with T' as estimated (`contact`) for the instant at which the torque acts

        u = clip(limit - kd T', 0, full_torque),     kd = 2 damping_ratio J1 Omega/c

    which gives the shaft this damping ratio on top of its own. The delays of the loop limit it
    (`feedback_damping`); a drive too slow for its elastic frequency has no feedback.

    Source: [G], conclusions ("regulators acting on the current-limit level or as a flexible feedback").

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(simulate(crane.replace(gap=gap), CurrentLimitFeedback()).k_dyn, 1) for gap in (0.5, 2)]
    [1.0, 1.0]
    """

    name = "current-limit-feedback"
    summary = "low limit while the gap is open, then a limit with feedback of the estimated dT/dt"
    source = "[G]"
    impact = 0.85
    kernel = step

    # fmt: off
    low_torque: float = reduced_torque_parameter("torque limit while the gap is open", "0 or more")
    approach_speed: float = landing.approach_parameter("0.85")
    rise: float = parameter("s", "rise time of the limit after contact",
        lambda drive, p: drive.elastic_period, "one elastic period", "0 or more", multiples=(0.2, 5.0))
    damping_ratio: float = parameter("1", "damping ratio added by the feedback",
        lambda drive, p: feedback_damping(drive, p.period),
        "0.7 less that of the shaft, or what the delays allow, down to 0", "0 or more", between=(0.0, 1.5))
    # fmt: on

    def numbers(self, drive: Drive) -> Numbers:
        """Landing, feedback, and the rise in a sample."""
        feedback = 2.0 * self.damping_ratio * drive.J1 * drive.Omega
        rise = self.period / max(self.rise, self.period)
        return super().numbers(drive) | {"feedback": feedback, "rise": rise}


def feedback_damping(drive: Drive, period: float) -> float:
    """0.7 less that of the shaft, and at most what the delays allow.

    >>> round(feedback_damping(Drive.load("crane-4amtkf"), 0.001), 3)
    0.7
    """
    unforeseen = drive.J1 / (drive.J1 + drive.J2)
    slewing = SLEWED_SHARE * drive.Ms / drive.torque_rate
    delay = drive.torque_lag + slewing + 0.5 * period + unforeseen * drive.computing_delay
    m = (0.5 * math.pi - PHASE_LEFT) / (drive.Omega * delay)
    lacking = DAMPING_RATIO - 0.5 * drive.d * drive.Omega / drive.c
    return min(max(lacking, 0.0), max(0.5 * (m - 1.0 / m), 0.0))
