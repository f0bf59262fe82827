"""Speed ramp with a PI speed loop: the start that every inverter with speed control does."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softstart.controller import CompiledController, Effort, Numbers, compiled_step, parameter
from softstart.controller.base import Regulation
from softstart.controller.compiled import MEASURED, Double, Reply, Vector, as_record, keep_state, record
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.kernel.motor import encoder_count
from softstart_controllers.sampled import period_parameter, pulling_load

BAND = 0.02  # of the target speed, in which the load has settled
SHARE_OF_ELASTIC_PERIOD = 0.36  # least S
LEAST_MARGIN = math.radians(30.0)  # phase margin with J1 alone
CREEPING = 10.0  # times (J1 + J2)/kp: longer no speed loop swings
LITTLE_MARGIN = 30.0  # deg, with J1 + J2: the symmetrical optimum leaves 37
RIPPLE = 0.1  # of Ms: torque that an encoder count in a sample may cause
SLEWED_SHARE = 0.25  # of Ms: a torque rate limit counts as the lag in which it slews so much
RESERVE = 1.3  # ramp time over the shortest one
ROUNDING = 1e-9  # of the torque limit
LEAST_PUSH = 1e-3  # of Ms: what is left to accelerate a drive that hardly reaches its target speed


class Parameters:
    """What the step is given."""

    kp: float
    tn: float
    period: Double
    filter_share: float  # of the distance to the measured speed, in a sample
    rate: float  # of the commanded speed, rad/s^2
    rounding: float
    inertia: float  # of the feed-forward, kg m2
    preload: float
    preload_samples: int
    low: float  # limits of the torque, N m
    high: float


class State:
    """Loop and ramp; the ramp begins at the sample `begin`."""

    sample: int
    run: float
    set_speed: float
    taking_up: float  # 1 while the preload takes up the gap
    begin: int
    begin_speed: float
    speed: float  # filtered
    integral: Double  # N m; a sum over many samples


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Reply, State)


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Take up the gap, then hold the speed on its ramp."""
    p, x = as_record(parameters, PARAMETERS), as_record(state, STATE)
    m, y = as_record(measured, MEASURED), as_record(command, COMMAND)
    keep_state(state, command)
    first = x.sample == 0
    y.sample = x.sample + 1
    y.ask_again = y.sample * p.period
    y.speed = m.motor_speed if first else x.speed + p.filter_share * (m.motor_speed - x.speed)
    y.run, y.set_speed = m.run, m.set_speed
    if m.run != 0.0 and (first or x.run == 0.0):
        y.taking_up = 1.0 if p.preload_samples > 0 else 0.0
        y.begin, y.begin_speed = x.sample + p.preload_samples, y.speed
    elif m.run != x.run or (m.set_speed != x.set_speed and x.taking_up == 0.0):
        y.taking_up, y.begin, y.begin_speed = 0.0, x.sample, y.speed
    if y.taking_up == 1.0:
        preload = math.copysign(p.preload, m.set_speed)
        if x.sample < y.begin:
            y.torque = min(max(preload, p.low), p.high)
            return
        y.taking_up, y.begin_speed, y.integral = 0.0, y.speed, preload
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
    if not ((demand > p.high and error > 0.0) or (demand < p.low and error < 0.0)):
        y.integral += p.kp * p.period / p.tn * error


@dataclass(frozen=True)
class SpeedRamp(CompiledController):
    """Speed that rises on a ramp, held by a PI controller of the motor speed, with a torque limit.

    At the samples t_k = k `period`, with the filtered motor speed w and the commanded speed n*:

        e = n* - w
        v = kp e + I + feed_forward (J1 + J2) dn*/dt
        u = v within the limits of strategy and drive
        I := I + kp period e/tn,    unless v is beyond a limit and e points there

    n* begins at w at each new command and goes to the set speed, to 0 after a stop, at the rate of the target
    speed in `ramp_time`. Each end is rounded over the share `rounding` of its duration, in which dn*/dt rises
    or falls linearly. The filter is w := w + (1 - exp(-period/filter_time)) (measured - w).

    A `preload` takes up the gap first, for as long as J1 needs from one flank to the other under it against
    friction, later by lag and dead time; then n* begins, and I is the preload. Its time counts.

    Gains by the symmetrical optimum: kp = (J1 + J2)/(2 S) and tn = 4 S for the sum S of the small time
    constants, lag + dead time + period + filter. S is larger where this is below 0.36 elastic periods,
    where the phase margin with J1 alone, the gap open, would be below 30 degrees, or where an encoder count
    in a sample would cause more than a tenth of Ms (`small_times`).

    Source: practice of inverters; gains: symmetrical optimum with a = 2 as in the user's guide of Modelica's
    library DriveControl, which cites Schroeder (2009).

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), SpeedRamp(ramp_time=0.5))
    >>> round(run.controller.kp, 2), round(run.controller.tn, 4), bool(run.overshoot < 0.03)
    (5.22, 0.0805, True)
    """

    name = "speed-ramp"
    summary = "speed ramp held by a PI speed controller with a torque limit"
    source = "practice"
    effort = Effort.SPEED
    saturates = True
    can_stop = True
    can_reverse = True
    time_parameter = "ramp_time"
    settings = ("kp", "tn")
    kernel = step

    # fmt: off
    ramp_time: float = parameter("s", "time of the speed ramp from standstill to the target speed",
        lambda drive, p: RESERVE * shortest_ramp(drive),
        "1.3 times that of a rigid drive under Ms", "above 0", multiples=(0.5, 4.0))
    rounding: float = parameter("1", "share of the ramp time that is rounded, at each end", 0.0,
        limit="from 0 to 0.5", between=(0.0, 0.5))
    kp: float = parameter("N*m*s/rad", "proportional gain of the speed controller",
        lambda drive, p: 0.5 * (drive.J1 + drive.J2) / small_times(drive, p.period, p.filter_time),
        "(J1 + J2)/(2 S)", "above 0", multiples=(0.1, 4.0))
    tn: float = parameter("s", "integral time of the speed controller",
        lambda drive, p: 4.0 * small_times(drive, p.period, p.filter_time), "4 S", "above 0",
        multiples=(0.25, 10.0))
    filter_time: float = parameter("s", "time constant of the speed filter", 0.0, limit="0 or more")
    feed_forward: float = parameter("1", "share of (J1 + J2) dn*/dt that is fed forward", 1.0,
        limit="0 or more")
    torque_limit: float = parameter("N*m", "torque limit of the inverter, both ways",
        lambda drive, p: drive.Ms, "starting torque Ms", "above 0")
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
            "high": self._most(drive),
        }

    def _most(self, drive: Drive) -> float:
        """The largest torque, N m."""
        return float(min(drive.maximum_torque, self.torque_limit))

    def _preload_samples(self, drive: Drive) -> float:
        """For how many samples the preload acts: x = a t^2/2 over the whole gap, then lag and dead time."""
        if self.preload == 0.0:
            return 0.0
        push = min(self.preload, self._most(drive)) - drive.motor_friction
        if push <= 0.0:
            raise InputError(
                f"speed-ramp: preload = {self.preload:g}: it moves the motor across the gap, so it must be "
                f"above the friction of the motor, {drive.motor_friction:g} N m; or 0 for none."
            )
        time = math.sqrt(2.0 * drive.gap * drive.J1 / push) + drive.torque_lag + drive.computing_delay
        return float(math.ceil(time / self.period))

    def regulation(self, drive: Drive) -> Regulation:
        """The speed is held from the end of the ramp on."""
        way = abs(drive.target_speed - drive.initial_motor_speed) / drive.target_speed
        command_end = self._preload_samples(drive) * self.period + self.ramp_time * way
        # half a swing of the loop; with a slow integral the speed creeps to its set value and does not swing
        gain_time = (drive.J1 + drive.J2) / self.kp if self.kp > 0.0 else 0.0
        swing = max(2.0 * self.tn, math.pi * math.sqrt(gain_time * self.tn))
        dwell = min(swing, CREEPING * gain_time) + 5.0 * drive.elastic_period
        return Regulation(BAND, command_end, dwell)

    def doubts(self, drive: Drive) -> list[str]:
        """Gains that are unstable with the gap open, and a ramp that the torque limit does not allow."""
        found = []
        gains = f"kp = {self.kp:.4g} N m s/rad and tn = {self.tn:.4g} s"
        loop = self.kp, self.tn, self.filter_time, self.period
        margin = math.degrees(phase_margin(drive, drive.J1, *loop))
        if margin <= 0.0:
            found.append(
                f"speed-ramp: {gains} are unstable with the gap open, when only J1 = {drive.J1:.4g} kg m2 "
                f"moves (phase margin {margin:.0f} deg); lower kp, or raise tn."
            )
        margin = math.degrees(phase_margin(drive, drive.J1 + drive.J2, *loop))
        if margin < LITTLE_MARGIN:
            found.append(
                f"speed-ramp: {gains} leave a phase margin of {margin:.0f} deg with the gap closed, so the "
                f"speed oscillates about its ramp; raise tn, or kp, for {LITTLE_MARGIN:.0f} deg or more."
            )
        friction = resistance(drive) - pulling_load(drive)
        if (held := drive.Mc + friction) < drive.minimum_torque:
            found.append(
                f"speed-ramp: the load drives the motor with {-held:.4g} N m at the target speed, and "
                f"motor.minimum_torque = {drive.minimum_torque:.4g} N m cannot hold it; lower that."
            )
        load, most = resistance(drive), self._most(drive)
        accelerating = (drive.J1 + drive.J2) * drive.target_speed / (self.ramp_time * (1.0 - self.rounding))
        if accelerating + load > most * (1.0 + ROUNDING):
            shortest = self.ramp_time * accelerating / (most - load) if most > load else math.inf
            advice = f"ramp_time from {shortest:.4g} s on" if most > load else "a higher torque_limit"
            found.append(
                f"speed-ramp: ramp_time = {self.ramp_time:.4g} s takes {accelerating + load:.4g} N m, more "
                f"than the limit of {most:.4g} N m, so the speed falls behind its ramp; give {advice}."
            )
        return found


def resistance(drive: Drive) -> float:
    """Torque in N m that the motor needs at the target speed without acceleration.

    >>> resistance(Drive.load("crane-4amtkf"))
    7.16
    """
    viscous = (drive.motor_viscous_friction + drive.load_viscous_friction) * drive.target_speed
    return float(pulling_load(drive) + drive.motor_friction + viscous)


def shortest_ramp(drive: Drive) -> float:
    """The time in s of the shortest ramp to the target speed for which Ms suffices without shaft and gap.

    >>> round(shortest_ramp(Drive.load("crane-4amtkf")), 3)
    0.353
    """
    push = max(drive.Ms - resistance(drive), LEAST_PUSH * drive.Ms)
    return float((drive.J1 + drive.J2) * drive.target_speed / push)


def small_times(drive: Drive, period: float, filter_time: float) -> float:
    """The sum S in s of the small time constants for which the gains are chosen.

    The torque of a count q in a sample is kp q/max(period, filter_time).

    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(small_times(crane.replace(torque_lag=lag), 0.001, 0.0), 4) for lag in (0.0, 0.03)]
    [0.0201, 0.0481]
    """
    lag, late = lags(drive, period)
    count = encoder_count(drive.encoder_lines) / max(period, filter_time)
    return max(
        lag + late + filter_time,
        SHARE_OF_ELASTIC_PERIOD * drive.elastic_period,
        open_gap_time(drive.J2 / drive.J1, lag, late, filter_time),
        0.5 * (drive.J1 + drive.J2) * count / (RIPPLE * drive.Ms),
    )


def lags(drive: Drive, period: float) -> tuple[float, float]:
    """Lag of the torque, and dead time of the loop: half a period each to measure and to hold, s."""
    return drive.torque_lag + SLEWED_SHARE * drive.Ms / drive.torque_rate, drive.computing_delay + period


def open_gap_time(ratio: float, lag: float, late: float, filter_time: float) -> float:
    """The S in s that leaves the phase margin LEAST_MARGIN with J1 alone; `ratio` is J2/J1.

    With x = w S and m = 1 + ratio, |L| = 1 in the loop of `phase_margin` is m/(2 x) sqrt(1 + 1/(4 x)^2) =
    |1 + jw lag| |1 + jw filter_time|, so that x follows from w. The margin falls with w.

    >>> round(open_gap_time(5.0, 0.002, 0.001, 0.0), 5)
    0.00722
    """
    low, high, S = 0.0, math.pi / late, 0.0
    while high - low > 1e-9 * high:
        w = 0.5 * (low + high)
        g = math.hypot(1.0, w * lag) * math.hypot(1.0, w * filter_time)
        lost = g / (1.0 + ratio)
        x = math.sqrt(0.125 * (1.0 + math.hypot(1.0, lost))) / lost
        margin = math.atan(4.0 * x) - math.atan(w * lag) - math.atan(w * filter_time) - w * late
        low, high = (w, high) if margin > LEAST_MARGIN else (low, w)
        S = x / w
    return S


def phase_margin(drive: Drive, J: float, kp: float, tn: float, filter_time: float, period: float) -> float:
    """Phase margin in rad of the speed loop of a rigid inertia J: J1 with the gap open, or J1 + J2.

    L = kp (1 + 1/(tn s)) exp(-late s)/(J s (1 + lag s)(1 + filter_time s)); |L| falls with w. The mean speed
    between two samples, from an encoder, is late by half a period, and so is the torque that is held.

    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(math.degrees(phase_margin(crane, crane.J1, kp, 0.08, 0.0, 0.001))) for kp in (5.2, 100.0)]
    [77, -74]
    """
    late = drive.computing_delay + (period if drive.encoder_lines > 0.0 else 0.5 * period)
    lag, low, high = drive.torque_lag, 0.0, 2.0 * (kp / J + 1.0 / tn)
    while high - low > 1e-9 * high:
        w = 0.5 * (low + high)
        gain = kp / (J * w) * math.hypot(1.0, 1.0 / (w * tn))
        above = gain > math.hypot(1.0, w * lag) * math.hypot(1.0, w * filter_time)
        low, high = (w, high) if above else (low, w)
    return math.atan(high * tn) - math.atan(high * lag) - math.atan(high * filter_time) - high * late
