"""[G]: current limit with a flexible feedback of the estimated shaft torque."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import compiled_step, parameter
from softstart.controller.compiled import MEASURED, Reply, Vector, as_record, keep_state, record, size
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
    rise: float


class State:
    """The landing, and how far the limit has risen."""

    landing: landing.State
    progress: float


PARAMETERS = record(Parameters, landing=landing.PARAMETERS)
STATE = record(State, landing=landing.STATE)
COMMAND = record(Reply, State, landing=landing.STATE)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Land at the approach speed; from contact on the limit rises, less the feedback of T'."""
    p = as_record(parameters, PARAMETERS)
    m = as_record(measured, MEASURED)
    y = as_record(command, COMMAND)
    keep_state(state, command)
    near, now = p.landing, y.landing
    y.torque = landed(near, now, m)
    if now.phase == CLOSED:
        w1, _, w2, _ = predicted_state(near.watch, now.watch, m.motor_torque)
        limit = near.low_torque + (ROOM * near.full_torque - near.low_torque) * y.progress
        y.torque = min(max(limit - p.feedback * (w1 - w2), 0.0), near.full_torque)
        if now.watch.held == 0.0:  # else the limit waits for the brake
            y.progress = min(1.0, y.progress + p.rise)
    y.ask_again = sent(near, now, y.torque, m.motor_torque)


@dataclass(frozen=True)
class CurrentLimitFeedback(Landing):
    """Torque limit with a derivative ("flexible") feedback of the estimated shaft torque.

    It measures the motor angle (encoder) and the motor torque. The gap is nowhere among its numbers.

    *Gap open.* The low limit accelerates the motor until it is `approach_speed` faster than the load, and
    keeps that speed (`landing`). With approach_speed = Omega M12avg/c the impact alone would swing the shaft
    to M12avg, [G](12), that is to K_dyn = 1, from however wide a gap; the default is 0.85 of it, which leaves
    the rise some room.

    *Gap closed.* The contact and what follows are estimated (`contact`). The limit rises from `low_torque` to
    99 % of `full_torque` (below it the feedback can act both ways) in the time `rise`, and

        u = clip(limit - kd T', 0, full_torque),     kd = 2 damping_ratio J1 Omega/c

    With [G](7): T'' + (kd c/J1) T' + Omega^2 T = c (limit/J1 + Mc/J2), so kd gives the shaft the damping
    ratio asked for on top of its own. The rise goes on only while the gap is closed.

    *Limits of the feedback.* The estimator bridges the computing delay: the feedback takes T' as it will be
    then. A delay tau in the loop (torque lag, the time in which a limited rate slews a quarter of Ms, half a
    period, and the computing delay as far as the model may miss the load, J1/(J1 + J2)) turns damping into
    its opposite: the loop gain is one at Omega (zeta + sqrt(zeta^2 + 1)), and a phase margin of 30 degrees is
    kept there by zeta <= (m^2 - 1)/(2 m), m = (pi/3)/(Omega tau). A drive whose torque is too slow for its
    elastic frequency so gets no feedback, but the soft approach and the rise all the same.

    Source: [G], conclusions ("regulators acting on the current-limit level or as a flexible feedback").

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(simulate(crane.replace(gap=gap), CurrentLimitFeedback()).k_dyn, 1) for gap in (0.5, 2)]
    [1.0, 1.0]
    """

    name: ClassVar[str] = "current-limit-feedback"
    summary: ClassVar[str] = (
        "low limit while the gap is open, then a limit with feedback of the estimated dT/dt"
    )
    source: ClassVar[str] = "[G]"
    impact: ClassVar[float] = 0.85
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = size(STATE)
    record: ClassVar[Any] = PARAMETERS

    # fmt: off
    low_torque: float | None = reduced_torque_parameter("torque limit while the gap is open", "0 or more")
    approach_speed: float | None = landing.approach_parameter("0.85")
    rise: float | None = parameter("s", "rise time of the limit after contact",
        lambda drive, p: drive.elastic_period, "one elastic period", "0 or more", multiples=(0.2, 5.0))
    damping_ratio: float | None = parameter("1", "damping ratio added by the feedback",
        lambda drive, p: feedback_damping(drive, p.period),
        "0.7 less that of the shaft, or what the delays allow, down to 0", "0 or more", between=(0.0, 1.5))
    # fmt: on

    def numbers(self, drive: Drive) -> dict[str, Any]:
        """Landing, feedback, and the rise in a sample."""
        p: Any = self  # fitted: every parameter is a number
        feedback = 2.0 * p.damping_ratio * drive.J1 * drive.Omega
        return super().numbers(drive) | {"feedback": feedback, "rise": p.period / max(p.rise, p.period)}


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
