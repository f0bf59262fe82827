"""Taking up all gaps of a driveline at low speed, and a damped rise once the load is met."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softstart.controller import (
    CompiledController,
    Effort,
    Numbers,
    ParameterValues,
    compiled_step,
    parameter,
)
from softstart.controller.compiled import MEASURED, Double, Reply, Vector, as_record, keep_state, record
from softstart.drive import Drive
from softstart_controllers.sampled import (
    full_torque_parameter,
    mean_torque,
    period_parameter,
    timeout_parameter,
)
from softstart_controllers.shaft_observer import GAINS, Gains, observer, predict

SLOWEST = 0.3  # of the take-up speed
CONTACT_SHARE = 0.56
ALL_LEFT, NONE_LEFT = 0.5, 1.0  # rad that Omega turns in the delay: all of the damping by T', none of it
LATE_RISE, LATE_SHARE = 1.5, 0.6  # rise in elastic periods and share of damping_ratio, with none of it
FADING, NO_DAMPING = 1.5, 2.5  # rad likewise, from which on damping_ratio fades, and is gone
FOLLOWING = 0.7  # damping ratio of the follower
CALM = 0.1  # of the uncertainty, once the load is met
HELD = 4.0  # times the impulse that means the load gathers while a load holds the motor
SLEWED_SHARE = 0.25  # of Ms
CERTAINTY = 3.0  # standard deviations of the estimated torque that are no load

TAKING_UP, RISING, IMPATIENT = 0.0, 1.0, 2.0  # phases


class Parameters:
    """Speeds, gains and times of `TakeUp`, and the gains of the observer before and after the load."""

    period: Double
    J1: float
    c: float
    Mc: float
    load_share: float
    load_speed: float
    take_up_speed: float
    slowest: float
    falling: float
    speed_gain: float
    contact: float
    leak: float
    full_torque: float
    Ms: float
    rise: Double
    D1: float
    D2: float
    corner: float
    contact_timeout: Double
    first: Gains
    later: Gains


class State:
    """The estimate of motor angle and speed, T and T'; the impulse; the load's speed w2, as corrected."""

    sample: int
    phase: float
    angle: Double
    speed: float
    T: float
    rate: float
    impulse: float
    w2: float
    least: float
    correction: float
    low: float
    progress: Double
    demand: float
    realised: float


PARAMETERS = record(Parameters, first=GAINS, later=GAINS)
STATE, COMMAND = record(State), record(Reply, State)


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Estimate w1, T and T', tell whether the load is met, set the torque."""
    p = as_record(parameters, PARAMETERS)
    m = as_record(measured, MEASURED)
    x = as_record(state, STATE)
    y = as_record(command, COMMAND)
    keep_state(state, command)
    t, u, h = m.time, m.motor_torque, p.period
    phase = x.phase
    if x.sample == 0:
        y.angle = m.motor_angle
        y.speed = m.motor_speed
    else:
        mean = mean_torque(x.realised, u, x.demand)
        gains = p.first if phase == TAKING_UP else p.later
        angle, speed, T, rate = predict(x.angle, x.speed, x.T, x.rate, mean, p.J1, h)
        error = m.motor_angle - angle
        y.angle = angle + gains.angle * error
        y.speed = speed + gains.speed * error
        y.T = T + gains.torque * error
        y.rate = rate + gains.rate * error

    demand = 0.0
    if phase == TAKING_UP:
        wanted = p.load_speed + max(p.take_up_speed - p.falling * t, p.slowest)
        demand = min(max(p.speed_gain * (wanted - y.speed), 0.0), p.full_torque)
        y.impulse = max(x.impulse * p.leak + h * y.T, 0.0)
        if y.impulse > p.contact:
            phase = RISING
            y.w2 = y.speed - max(y.rate, 0.0) / p.c
            y.least = y.w2
            y.low = demand
    elif phase == RISING:
        error = y.speed - x.w2
        gained = p.load_share * (y.T - p.Mc) + x.correction + 2.0 * FOLLOWING * p.corner * error
        y.w2 = max(x.w2 + h * gained, x.least)  # it has been met: it falls back no more
        y.correction = x.correction + h * p.corner * p.corner * error
        y.progress = min(1.0, x.progress + p.rise)
    if t >= p.contact_timeout and phase != IMPATIENT:
        phase = IMPATIENT
        y.low = x.demand
        y.progress = 0.0
    if phase == RISING:
        demand = y.low + (p.full_torque - y.low) * y.progress
        demand -= p.D1 * (y.speed - y.w2) + p.D2 * y.rate
    elif phase == IMPATIENT:
        y.progress = min(1.0, y.progress + p.rise)
        demand = y.low + (p.full_torque - y.low) * y.progress

    y.torque = min(max(demand, 0.0), p.Ms)
    y.ask_again = (x.sample + 1) * h
    y.sample = x.sample + 1
    y.demand = y.torque
    y.realised = u
    y.phase = phase


def delay(drive: Drive, p: ParameterValues) -> float:
    """By how much in s the torque is late: lag, dead time, a sample, a quarter of the slewing time to Ms."""
    slewing = SLEWED_SHARE * drive.Ms / drive.torque_rate
    return float(drive.torque_lag + drive.computing_delay + p.period + slewing)


def share_left(drive: Drive, p: ParameterValues) -> float:
    """Share of the damping by T' that a torque so late leaves, 1 to 0."""
    return min(max((NONE_LEFT - drive.Omega * delay(drive, p)) / (NONE_LEFT - ALL_LEFT), 0.0), 1.0)


def contact_share(drive: Drive, p: ParameterValues) -> float:
    """At least as much as the rounding of a coarse encoder may feign."""
    eyes = observer(drive, p.period, p.uncertainty)
    feigned: float = CERTAINTY * eyes.torque_deviation * eyes.rate_lag / (drive.J1 * p.take_up_speed)
    return max(CONTACT_SHARE, feigned)


def contact_time(drive: Drive, p: ParameterValues) -> float:
    """Several times as long as the speed loop needs for the impulse, so that a load is always noticed."""
    return max(0.16 * drive.elastic_period, HELD * p.contact_share * drive.J1 / p.speed_gain)


def loop_damping(drive: Drive, p: ParameterValues) -> float:
    """0.28 where the torque is quick, at most a loop gain of one at 1 rad of phase lag, 0 if later still."""
    phase = drive.Omega * delay(drive, p)
    damping = min(0.28 * (LATE_SHARE + (1.0 - LATE_SHARE) * share_left(drive, p)), 0.5 / phase)
    return damping * min(max((NO_DAMPING - phase) / (NO_DAMPING - FADING), 0.0), 1.0)


@dataclass(frozen=True)
class TakeUp(CompiledController):
    """Take up all gaps at low speed, tell the load from light parts, raise the torque with damping.

    For drivelines with several gaps, where the first contact is not that with the load. It measures the motor
    angle (encoder) and the motor torque. Gaps, positions and light parts are nowhere among its numbers.

    *Taking up.* u = clip(`speed_gain` (v - w1), 0, full_torque) brings the motor to v = `take_up_speed` above
    the initial speed of the load; under an active load v falls by `slowing` Mc t/J2, to 0.3 of it at most.
    *Contact with the load.* The impulse of the shaft, int T dt with a memory of `contact_time`, exceeds
    `contact_share` J1 take_up_speed: more than a light part can take.
    *Rise.* From the torque of then on, in the time `rise`, with two dampers:

        u = clip(low + (full_torque - low) s - D1 (w1 - w2) - D2 T'/c, 0, Ms),   D = 2 zeta J1 Omega

    zeta is `damping_ratio` (D1) and `rate_damping_ratio` (D2). T and T' are from the observer
    (`shaft_observer`); w2 accelerates by (T - Mc)/J2 and follows w1 with the bandwidth `corner`. A delay of
    the torque limits speed_gain and both dampers, and slows the rise.

    Source: softstart.

    >>> from softstart import simulate
    >>> from softstart.chain import Chain
    >>> damped = {f"shaft[{k}].damping_ratio": 0.02 for k in (1, 2, 3)}
    >>> chain = Chain.load("crane-4-mass", also=damped)
    >>> [round(simulate(chain, name).k_dyn, 1) for name in ("take-up", "pulse-coast-hold")]
    [1.1, 1.8]
    """

    name = "take-up"
    summary = "all gaps taken up at low speed, then a damped rise once the load is met"
    source = "softstart: docs/take-up.md"
    effort = Effort.ENCODER
    time_parameter = "full_torque"
    kernel = step

    # fmt: off
    take_up_speed: float = parameter("rad/s",
        "motor speed relative to the initial load speed while the gaps are taken up",
        lambda drive, p: 0.16 * drive.Ms / math.sqrt(drive.c * drive.J1), "0.16 Ms/sqrt(c J1)", "above 0",
        multiples=(0.3, 3.0))
    slowing: float = parameter("1",
        "reduction of that speed, as a multiple of the speed at which an active load falls back", 2.0,
        limit="0 or more", between=(0.0, 8.0))
    speed_gain: float = parameter("N*m*s/rad", "gain of the speed loop while the gaps are taken up",
        lambda drive, p: min(2.4 * math.sqrt(drive.c * drive.J1), drive.J1 / delay(drive, p)),
        "2.4 sqrt(c J1), at most J1 over the delay", "above 0", multiples=(0.3, 4.0))
    contact_share: float = parameter("1",
        "impulse of the shaft that means the load, as a share of J1 take_up_speed", contact_share,
        "0.56, more for a coarse encoder", "above 0", between=(0.1, 1.5))
    contact_time: float = parameter("s", "memory of that impulse", contact_time,
        "0.16 elastic periods, at least 4 contact_share J1/speed_gain", "above 0", multiples=(0.2, 5.0))
    full_torque: float = full_torque_parameter("torque after the rise", "above 0")
    rise: float = parameter("s", "rise time of the torque once the load is met",
        lambda drive, p: (LATE_RISE + (0.72 - LATE_RISE) * share_left(drive, p)) * drive.elastic_period,
        "0.72 elastic periods, 1.5 for a late torque", "0 or more", multiples=(0.3, 5.0))
    damping_ratio: float = parameter("1",
        "damping ratio added by w1 less the estimated speed of the load", loop_damping,
        "0.28, less for a late torque", "0 or more", between=(0.0, 1.5))
    rate_damping_ratio: float = parameter("1", "damping ratio added by the estimated T'",
        lambda drive, p: 0.23 * share_left(drive, p), "0.23, down to 0 for a late torque", "0 or more",
        between=(0.0, 1.5))
    corner: float = parameter("rad/s",
        "bandwidth at which the estimated speed of the load follows the motor",
        lambda drive, p: 0.073 * drive.Omega, "0.073 Omega", "0 or more", multiples=(0.2, 5.0))
    uncertainty: float = parameter("1",
        "unknown part of T'' in the observer's model, as a share of Omega^2 Ms", 0.18, limit="above 0",
        multiples=(0.1, 10.0))
    contact_timeout: float = timeout_parameter()
    period: float = period_parameter()
    # fmt: on

    def numbers(self, drive: Drive) -> Numbers:
        """Gains and thresholds; neither gap nor start position enter."""
        damping = 2.0 * drive.J1 * drive.Omega
        return {
            "load_share": 1.0 / drive.J2,
            "load_speed": drive.initial_load_speed,
            "slowest": SLOWEST * self.take_up_speed,
            "falling": self.slowing * max(drive.falling_torque, 0.0) / drive.J2,
            "contact": self.contact_share * drive.J1 * self.take_up_speed,
            "leak": math.exp(-self.period / self.contact_time),
            "rise": self.period / max(self.rise, self.period),
            "D1": damping * self.damping_ratio,
            "D2": damping * self.rate_damping_ratio / drive.c,
            "first": observer(drive, self.period, self.uncertainty).gains,
            "later": observer(drive, self.period, CALM * self.uncertainty).gains,
        }
