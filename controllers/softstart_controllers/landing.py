"""Closing the gap softly and seeing the contact: what `shaped` and `state-feedback` share.

*Approach.* The motor takes up `approach_speed` relative to the load and keeps it,

    u = clip(J1 (w2 + approach_speed - w1)/(2 (period + lag)), 0, low_torque)

The speed of the load is known: at the start w2(0), under an active load less Mc t/J2 (down to half the
approach speed, no further).

*Contact.* The angle lost to the shaft is l(t) = int int u/J1 - phi1, with the torque realised and the encoder
angle. Its second difference over the window W is the shaft torque, averaged with triangular weights over 2 W:

    J1 (l(t) - 2 l(t - W) + l(t - 2 W))/W^2 > threshold        means contact

*What the window knows.* A contact s ago, met with v = w1 - w2, has taken the angle

    l(s) = J1r/J1 (a s^2/2 + v s - z(s)),    a = u/J1 + Mc/J2,    J1r = J1 J2/(J1 + J2)

with z(s) the twist of the closed drive from z = 0, z' = v: exact with damping. So the measured second
difference gives s by bisection, and s gives z and z' without having to wait for an observer. As l grows with
s^3, an error of the angle is a third as large in s. A reactive load at rest stays so until T > Mc; until
then J2 is infinite (J1r = J1, a = u/J1).
"""

from __future__ import annotations

import math
from typing import Any

from softstart.controller.compiled import Vector, compiled, inner, record
from softstart.drive import Drive
from softstart_controllers.acceleration_delay import RING, window
from softstart_controllers.reduced import load_drift
from softstart_controllers.sampled import encoder_count, mean_torque, patience, pulling_load, sample_period
from softstart_controllers.shaping import swing

THRESHOLD = 0.1  # of M12avg_base
LOW_SHARE = 0.5  # of the shaft torque under the low limit: what the threshold may be at most
LARGEST_DAMPING = 0.95  # damping ratio that the model of the closed drive may have
BISECTIONS = 24
SLOWEST = 0.02  # of the approach speed: with no speed and no torque a contact would never be seen
LOW_TORQUE_SHARE = 0.5  # of the accelerating torque
REFITS = 4  # the speed of impact depends a little on the instant of contact


class Parameters:
    """What `landing_numbers` gives; sigma + i omega is the pole of the closed drive, load moving or stuck."""

    period: float
    J1: float
    low: float
    approach: float
    horizon: float
    load_speed: float
    drift: float
    half: float
    stride: float
    trigger: float
    patience: float
    Mc: float
    pull: float
    sticks: float
    rests: float
    c: float
    d: float
    share: float
    sigma: float
    omega: float
    stuck_sigma: float
    stuck_omega: float


class State:
    """From the first sample on; the ring holds the last lost angles."""

    ring: Vector
    sample: float
    count: float
    free_angle: float
    free_speed: float
    demand: float
    torque: float
    slope: float
    older_slope: float
    contacts: float
    load_speed: float
    left_at: float


PARAMETERS, STATE = record(Parameters), record(State, ring=RING)


@inner
def watch(p: Parameters, m: Any, x: State, y: State) -> tuple[float, float]:
    """Motor speed, and how far the second difference is beyond the trigger (-inf between two looks).

    The free motor goes on under the torque realised; its speed is corrected by the slope of the lost angle.
    x is the state before this sample, y the one after it, so far the same.
    """
    h = p.period
    count = int(x.count)
    beyond = -math.inf
    if count == 0:
        y.free_angle = m.motor_angle
        if x.sample == 0.0:
            y.free_speed = m.motor_speed
        y.slope = 0.0
        y.older_slope = 0.0
        for i in range(RING):
            y.ring[i] = 0.0
    else:
        a = mean_torque(x.torque, m.motor_torque, x.demand) / p.J1
        y.free_angle = x.free_angle + h * (x.free_speed + 0.5 * h * a)
        y.free_speed = x.free_speed + h * a
        stride = int(p.stride)
        if count % stride == 0:
            half = int(p.half)
            kept = count // stride
            lost = y.free_angle - m.motor_angle
            middle = x.ring[(kept + RING - half) % RING]
            oldest = x.ring[(kept + RING - 2 * half) % RING]
            y.ring[kept % RING] = lost
            length = half * stride * h
            y.slope = 0.5 * (lost - oldest) / length
            y.older_slope = (middle - oldest) / length
            beyond = lost - 2.0 * middle + oldest - p.trigger
    y.count = count + 1
    return y.free_speed - y.slope, beyond


@inner
def drift(p: Parameters, x: State) -> float:
    """By how much the load slows down while the gap is open, rad/s^2."""
    return p.drift if x.contacts == 0.0 else p.pull


@inner
def load_speed(p: Parameters, x: State, t: float) -> float:
    """Speed of the load while the gap is open; a reactive load comes to rest."""
    began = p.load_speed if x.contacts == 0.0 else x.load_speed
    speed = began - drift(p, x) * (t - x.left_at)
    if p.rests != 0.0 and speed * began <= 0.0:
        return 0.0
    return speed


@inner
def sticks(p: Parameters, x: State) -> float:
    """1 where the load is at rest before contact and does not move until T > Mc."""
    return p.sticks if x.contacts == 0.0 else 0.0


@inner
def approach(p: Parameters, x: State, t: float, speed: float) -> float:
    """The torque that closes the gap, within 0 and the low torque."""
    if x.contacts == 0.0:
        # never less than half: a contact not seen must not let the load run back
        allowed = p.load_speed + p.approach - min(p.drift * t, 0.5 * p.approach)
    else:
        allowed = x.load_speed + p.approach
    return min(max(p.J1 * (allowed - speed) / p.horizon, 0.0), p.low)


@inner
def open_again(t: float, motor_speed: float, load_speed_now: float, x: State, y: State) -> None:
    """The flanks have parted: watch again, from the speeds of motor and load."""
    y.count = 0.0
    y.free_speed = motor_speed
    y.contacts = x.contacts + 1.0
    y.load_speed = load_speed_now
    y.left_at = t


@inner
def mean_twist(p: Parameters, u: float) -> float:
    """Twist about which the closed drive swings under the motor torque u, in rad."""
    return (u / p.J1 + p.pull) / (p.sigma * p.sigma + p.omega * p.omega)


@inner
def motor_torque(p: Parameters, twist: float) -> float:
    """The motor torque that keeps a twist: the inverse of `mean_twist`."""
    return p.J1 * (twist * (p.sigma * p.sigma + p.omega * p.omega) - p.pull)


@inner
def move(
    p: Parameters, z: float, v: float, stuck: float, u: float, s: float
) -> tuple[float, float, float, float, float]:
    """The closed drive after the time s under the torque u, by the model.

    Twist, its rate, 1 if the load is still stuck, for how long it has not been, and by how much the motor
    has become faster.
    """
    moving = s
    gained = 0.0
    if stuck != 0.0:
        mean = u / p.c
        end_z, end_v = swing(z, v, mean, p.stuck_sigma, p.stuck_omega, s)
        if p.c * end_z + p.d * end_v <= p.Mc:
            return end_z, end_v, 1.0, 0.0, end_v - v
        low, high = 0.0, s
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            end_z, end_v = swing(z, v, mean, p.stuck_sigma, p.stuck_omega, middle)
            if p.c * end_z + p.d * end_v > p.Mc:
                high = middle
            else:
                low = middle
        end_z, end_v = swing(z, v, mean, p.stuck_sigma, p.stuck_omega, high)
        moving = s - high
        gained = end_v - v
        z, v = end_z, end_v
    end_z, end_v = swing(z, v, mean_twist(p, u), p.sigma, p.omega, moving)
    impulse = p.share * (moving * (u / p.J1 + p.pull) - (end_v - v))  # of the shaft, over J1
    return end_z, end_v, 0.0, moving, gained + moving * u / p.J1 - impulse


@inner
def over_dead_time(u: float, demand: float, lag: float, dead: float) -> tuple[float, float]:
    """Mean motor torque of the dead time, in which the last demand goes on acting, and that at its end."""
    left = math.exp(-dead / lag) if lag > 0.0 else 0.0
    return demand + (u - demand) * (1.0 - left) * lag / dead, demand + (u - demand) * left


@inner
def lost_angle(p: Parameters, s: float, u: float, v: float, stuck: float) -> float:
    """Angle lost to the shaft s after contact, in rad."""
    if s <= 0.0:
        return 0.0
    if stuck != 0.0:
        z, _ = swing(0.0, v, u / p.c, p.stuck_sigma, p.stuck_omega, s)
        return s * (0.5 * s * u / p.J1 + v) - z
    a = u / p.J1 + p.pull
    z, _ = swing(0.0, v, mean_twist(p, u), p.sigma, p.omega, s)
    return p.share * (s * (0.5 * s * a + v) - z)


@compiled
def contact_seen(
    p: Parameters, x: State, t: float, u: float, beyond: float, free_speed: float, older_slope: float
) -> tuple[float, float]:
    """How long ago the contact was, and at what speed the flanks met.

    From the second difference, `beyond` the trigger, the speed the motor would have now, freed from the
    shaft, and what that speed was wrong by in the older half of the window, the shaft's part taken out.
    """
    difference = beyond + p.trigger
    back = p.half * p.stride * p.period
    longest = 2.0 * back + 0.5 * math.pi / p.omega
    slowest = SLOWEST * p.approach
    stuck = sticks(p, x)
    free = free_speed - older_slope - load_speed(p, x, t)
    closing = u / p.J1 + drift(p, x)
    s = 0.0
    v = slowest
    for _ in range(REFITS):
        shaft = lost_angle(p, s - back, u, v, stuck) - lost_angle(p, s - 2.0 * back, u, v, stuck)
        v = max(free + shaft / back - s * closing, slowest)
        low, high = 0.0, longest
        for _ in range(BISECTIONS):
            s = 0.5 * (low + high)
            seen = lost_angle(p, s, u, v, stuck) - 2.0 * lost_angle(p, s - back, u, v, stuck)
            seen += lost_angle(p, s - 2.0 * back, u, v, stuck)
            if seen > difference:
                high = s
            else:
                low = s
    return s, v


def shaft_torque_under(drive: Drive, torque: Any) -> float:
    """Mean shaft torque in contact under a motor torque; a load that pushes is not counted.

    >>> round(shaft_torque_under(Drive.load("crane-4amtkf"), 62), 2)
    52.86
    """
    under: float = (torque * drive.J2 + drive.J1 * pulling_load(drive)) / (drive.J1 + drive.J2)
    return under


def contact_threshold(drive: Drive, low: Any, approach_speed: Any, period: Any) -> float:
    """0.1 M12avg_base, at most half of what the shaft carries under the low torque, in N m.

    Nor more than half of what the speed control applies to a motor that the shaft holds at rest, which is J1
    approach_speed/(horizon + W): the speed that it knows is as old as the window W = sqrt(6 q J1/threshold).
    """
    rounding = math.sqrt(6.0 * encoder_count(drive) * drive.J1)
    speed = approach_speed * drive.J1
    ahead = math.sqrt(rounding**2 + 4.0 * LOW_SHARE * horizon(drive, period) * speed)
    root = 2.0 * LOW_SHARE * speed / (rounding + ahead)
    return min(THRESHOLD * drive.mean_torque, LOW_SHARE * shaft_torque_under(drive, low), root**2)


def horizon(drive: Drive, period: Any) -> float:
    """Time in s in which the speed control takes the motor to its speed."""
    ahead: float = 2.0 * (period + drive.torque_lag + drive.computing_delay)
    return ahead


def pole(drive: Drive, stiffness: float, stuck: bool = False) -> tuple[float, float]:
    """Pole of the closed drive as (sigma, omega) in 1/s and rad/s; the load stuck or moving.

    The damping ratio d Omega/(2 c) is taken as 0.95 at most: what is damped more does not swing anyway.
    """
    inverse = 1.0 / drive.J1 + (0.0 if stuck else 1.0 / drive.J2)
    Omega = math.sqrt(stiffness * inverse)
    ratio = min(0.5 * drive.d * Omega / stiffness, LARGEST_DAMPING)
    return -ratio * Omega, Omega * math.sqrt(1.0 - ratio**2)


# unit, meaning and default of the parameters that every landing has
LOW_TORQUE = ("N*m", "torque limit while the gap is open", "load torque plus half the accelerating torque")
THRESHOLD_TORQUE = (
    "N*m",
    "mean shaft torque over the window that means contact",
    "0.1 M12avg_base, at most half of what low torque and speed control can make the shaft carry",
)


def landing_defaults(controller: Any, drive: Drive, impact: float) -> dict[str, Any]:
    """The parameters of the landing, whose impact alone swings the shaft to this share of the full torque.

    Those that were given are kept where others follow from them.
    """

    def given(name: str, default: Any) -> Any:
        value = getattr(controller, name)
        return default if value is None else value

    held = pulling_load(drive)
    low = given("low_torque", held + LOW_TORQUE_SHARE * (drive.Ms - held))
    period = given("period", sample_period(drive))
    carried = impact * shaft_torque_under(drive, given("full_torque", drive.Ms))
    speed = given("approach_speed", drive.Omega * carried / drive.c)
    return {
        "low_torque": low,
        "approach_speed": speed,
        "full_torque": drive.Ms,
        "threshold": contact_threshold(drive, low, speed, period),
        "patience": patience(drive),
        "period": period,
    }


def landing_numbers(controller: Any, drive: Drive, stiffness: float) -> tuple[float, ...]:
    """The numbers of `Parameters`."""
    period, threshold = controller.period, controller.threshold
    half, stride, trigger = window(drive, threshold, 1.0, period)
    rests = float(drive.load_kind == "reactive" and drive.Mc > 0.0)
    sigma, omega = pole(drive, stiffness)
    stuck_sigma, stuck_omega = pole(drive, stiffness, stuck=True)
    return (
        period, drive.J1, controller.low_torque, controller.approach_speed,
        horizon(drive, period), drive.initial_load_speed,
        load_drift(drive), half, stride, trigger, controller.patience, drive.Mc,
        drive.Mc / drive.J2, rests * (drive.initial_load_speed == 0.0), rests, stiffness,
        -2.0 * sigma * stiffness / (sigma**2 + omega**2), drive.J2 / (drive.J1 + drive.J2),
        sigma, omega, stuck_sigma, stuck_omega,
    )  # fmt: skip
