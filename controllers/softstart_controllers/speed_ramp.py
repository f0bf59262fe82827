"""Speed ramp with a PI speed loop: the start that every inverter with speed control does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Effort, Numbers, compiled_step, parameter
from softstart.controller.base import Regulation
from softstart.controller.compiled import MEASURED, Reply, Vector, as_record, keep_state, record
from softstart.drive import Drive
from softstart_controllers.sampled import period_parameter, pulling_load

BAND = 0.02  # of the target speed, in which the load has settled
SLEWED_SHARE = 0.25  # of Ms: a torque rate limit counts as the lag in which it slews so much
SHARE_OF_ELASTIC_PERIOD = 0.36  # least sum of small time constants
LEAST_MARGIN = math.radians(30.0)  # phase margin with J1 alone
RESERVE = 1.3  # ramp time over that of a rigid drive under Ms


class Parameters:
    """What the step is given."""

    kp: float
    tn: float
    period: float
    filter_share: float  # of the distance to the measured speed, in a sample
    rate: float  # of the commanded speed, rad/s^2
    rounding: float
    inertia: float  # of the feed-forward, kg m2
    preload: float
    preload_samples: float
    low: float  # limits of the torque, N m
    high: float


class State:
    """Loop and ramp; the ramp begins at the sample `begin`."""

    sample: float
    speed: float  # filtered
    integral: float  # N m
    run: float
    set_speed: float
    begin: float
    begin_speed: float


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Reply, State)


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Take up the gap, then hold the speed on its ramp."""
    p, x = as_record(parameters, PARAMETERS), as_record(state, STATE)
    m, y = as_record(measured, MEASURED), as_record(command, COMMAND)
    keep_state(state, command)
    first = x.sample == 0.0
    y.sample = x.sample + 1.0
    y.ask_again = y.sample * p.period
    y.speed = m.motor_speed if first else x.speed + p.filter_share * (m.motor_speed - x.speed)
    if first or m.run != x.run or m.set_speed != x.set_speed:
        starting = m.run != 0.0 and (first or x.run == 0.0)
        y.run, y.set_speed = m.run, m.set_speed
        y.begin = x.sample + (p.preload_samples if starting else 0.0)
        y.begin_speed = y.speed
    preload = math.copysign(p.preload, m.set_speed)
    if x.sample < y.begin:
        y.torque = min(max(preload, p.low), p.high)
        return
    if x.sample == y.begin and p.preload_samples > 0.0 and x.begin == y.begin:
        y.begin_speed, y.integral = y.speed, preload
    aim = m.set_speed if m.run != 0.0 else 0.0
    time = (x.sample - y.begin) * p.period
    way = aim - y.begin_speed
    duration = abs(way) / p.rate
    speed, acceleration = aim, 0.0
    if time < duration:
        passed, end = time / duration, p.rounding
        left = 1.0 - passed
        if passed < end:
            share, slope = 0.5 * passed * passed / (end * (1.0 - end)), passed / (end * (1.0 - end))
        elif passed <= 1.0 - end:
            share, slope = (passed - 0.5 * end) / (1.0 - end), 1.0 / (1.0 - end)
        else:
            share, slope = 1.0 - 0.5 * left * left / (end * (1.0 - end)), left / (end * (1.0 - end))
        speed, acceleration = y.begin_speed + way * share, way / duration * slope
    error = speed - y.speed
    demand = p.kp * error + y.integral + p.inertia * acceleration
    y.torque = min(max(demand, p.low), p.high)
    if not (demand > p.high and error > 0.0 or demand < p.low and error < 0.0):
        y.integral += p.kp * p.period / p.tn * error


@dataclass(frozen=True)
class SpeedRamp(CompiledController):
    """Speed that rises on a ramp, held by a PI controller of the motor speed, with a torque limit.

    At the samples t_k = k `period`, with the filtered motor speed w and the commanded speed n*:

        e = n* - w
        v = kp e + I + feed_forward (J1 + J2) dn*/dt
        u = v within the torque limits
        I := I + kp period e/tn,    unless v is beyond a limit and e has its direction

    n* begins at the measured speed at each new command and goes to the set speed (to 0 after a stop) at the
    rate target speed/`ramp_time`; both ends are rounded over the share `rounding` of its time. The filter is a
    first-order lag, w := w + (1 - exp(-period/filter_time)) (measured - w).

    With a `preload`, the gap is taken up first: the preload acts for as long as J1 takes over the whole
    gap, against friction, and for lag and dead time; then the ramp begins, with I = preload.

    Gains by the symmetrical optimum: with the sum S of the small time constants of the loop,
    kp = (J1 + J2)/(2 S) and tn = 4 S. S is the largest of three: lag, dead time, `period` and filter; 0.36
    elastic periods; and what leaves a phase margin of 30 degrees with J1 alone, the gap open.

    Source: practice of inverters; the gains: User's Guide of the DriveControl library of Modelica, with
    a = 2, after Schroeder (2009).

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), SpeedRamp(ramp_time=0.5))
    >>> round(run.controller.tn, 4), bool(run.overshoot < 0.05)
    (0.0805, True)
    """

    name = "speed-ramp"
    summary = "speed ramp held by a PI speed controller with a torque limit"
    source = "practice"
    effort = Effort.SPEED
    saturates = True
    can_stop = True
    can_reverse = True
    time_parameter: ClassVar[str] = "ramp_time"
    kernel = step

    # fmt: off
    ramp_time: float = parameter("s", "time of the speed ramp from standstill to the target speed",
        lambda drive, p: RESERVE * rigid_time(drive), "1.3 times that of a rigid drive under Ms", "above 0",
        multiples=(0.5, 4.0))
    rounding: float = parameter("1", "share of the ramp time that is rounded, at each end", 0.0,
        limit="from 0 to 0.5", between=(0.0, 0.5))
    kp: float = parameter("N*m*s/rad", "proportional gain of the speed controller",
        lambda drive, p: (drive.J1 + drive.J2) / (2.0 * small_times(drive, p)), "(J1 + J2)/(2 S)", "0 or more",
        multiples=(0.1, 4.0))
    tn: float = parameter("s", "integral time of the speed controller",
        lambda drive, p: 4.0 * small_times(drive, p), "4 S", "above 0", multiples=(0.25, 10.0))
    filter_time: float = parameter("s", "time constant of the speed filter", 0.0, limit="0 or more")
    feed_forward: float = parameter("1", "share of (J1 + J2) dn*/dt that is fed forward", 1.0,
        limit="0 or more", between=(0.0, 1.2))
    torque_limit: float = parameter("N*m", "torque limit of the inverter, both ways",
        lambda drive, p: drive.Ms, "starting torque Ms", "above 0", multiples=(0.4, 1.0))
    preload: float = parameter("N*m", "torque that takes up the gap before the ramp, 0 for none", 0.0,
        limit="0 or more")
    period: float = period_parameter()
    # fmt: on

    def numbers(self, drive: Drive) -> Numbers:
        """Filter, rate, feed-forward, preload and limits."""
        return {
            "filter_share": -math.expm1(-self.period / self.filter_time) if self.filter_time > 0.0 else 1.0,
            "rate": drive.target_speed / self.ramp_time,
            "inertia": self.feed_forward * (drive.J1 + drive.J2),
            "preload_samples": self._preload_samples(drive),
            "low": max(drive.minimum_torque, -self.torque_limit),
            "high": min(drive.maximum_torque, self.torque_limit),
        }

    def _preload_samples(self, drive: Drive) -> float:
        if self.preload == 0.0:
            return 0.0
        pushing = self.preload - drive.motor_friction
        travel = math.sqrt(2.0 * drive.J1 * drive.gap / pushing)
        return float(math.ceil((travel + drive.torque_lag + drive.computing_delay) / self.period))

    def regulation(self, drive: Drive) -> Regulation:
        """The speed is held from the end of the ramp on."""
        way = abs(drive.target_speed - drive.initial_motor_speed) / drive.target_speed
        command_end = self._preload_samples(drive) * self.period + self.ramp_time * way
        return Regulation(BAND, command_end, 2.0 * self.tn + 5.0 * drive.elastic_period)


def rigid_time(drive: Drive) -> float:
    """Time in s that a rigid drive needs to its target speed under the starting torque.

    >>> round(rigid_time(Drive.load("crane-4amtkf")), 3)
    0.353
    """
    push = drive.Ms - drive.motor_friction - pulling_load(drive)
    return float((drive.J1 + drive.J2) * drive.target_speed / push)


def small_times(drive: Drive, p: Any) -> float:
    """The sum S of the small time constants for which the gains are chosen, s."""
    lag = drive.torque_lag + SLEWED_SHARE * drive.Ms / drive.torque_rate
    late = drive.computing_delay + p.period
    times = lag + late + p.filter_time
    return max(
        times, SHARE_OF_ELASTIC_PERIOD * drive.elastic_period, open_gap_time(drive, lag, p.filter_time, late)
    )


def open_gap_time(drive: Drive, lag: float, filter_time: float, late: float) -> float:
    """The S in s that leaves the least phase margin with J1 alone.

    With the gap open the loop is L = kp (1 + 1/(tn s))/(J1 s (1 + lag s)(1 + filter_time s)) exp(-late s). With
    x = w S and m = 1 + J2/J1, |L| = 1 is m/(2 x) sqrt(1 + 1/(4 x)^2) = g, g the gain lost in lag and filter, so
    that x follows from w; the margin atan(4 x) - atan(w lag) - atan(w filter_time) - w late falls with w.
    """
    m = 1.0 + drive.J2 / drive.J1

    def at(w: float) -> tuple[float, float]:
        g = math.hypot(1.0, w * lag) * math.hypot(1.0, w * filter_time)
        x = 1.0 / math.sqrt(8.0 * (math.hypot(1.0, g / m) - 1.0))
        return x, math.atan(4.0 * x) - math.atan(w * lag) - math.atan(w * filter_time) - w * late

    low, high = 0.0, math.pi / late
    for _ in range(40):
        w = 0.5 * (low + high)
        low, high = (w, high) if at(w)[1] > LEAST_MARGIN else (low, w)
    return at(low)[0] / low
