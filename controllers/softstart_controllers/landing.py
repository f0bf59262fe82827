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

import numpy as np

from softstart.controller.compiled import (
    MOTOR_ANGLE,
    MOTOR_SPEED,
    MOTOR_TORQUE,
    STATE,
    Vector,
    inlined,
)
from softstart.drive import Drive
from softstart.plant.jit import compiled
from softstart.plant.vector import encoder_count
from softstart.start.metrics import base_torque
from softstart_controllers.acceleration_delay import RING, window
from softstart_controllers.sampled import mean_torque, pulling_load
from softstart_controllers.shaping import swing

THRESHOLD = 0.1  # of M12avg_base
LOW_SHARE = 0.5  # of the shaft torque under the low limit: what the threshold may be at most
LARGEST_DAMPING = 0.95  # damping ratio that the model of the closed drive may have
BISECTIONS = 24
SLOWEST = 0.02  # of the approach speed: with no speed and no torque a contact would never be seen
REFITS = 4  # the speed of impact depends a little on the instant of contact

# indices of the parameter vector, before those of the controller itself
(
    P_PERIOD, P_J1, P_LOW, P_APPROACH, P_HORIZON, P_LOAD_SPEED, P_DRIFT, P_HALF, P_STRIDE, P_TRIGGER,
    P_PATIENCE, P_MC, P_PULL, P_STICKS, P_RESTS, P_C, P_D, P_SHARE, P_SIGMA, P_OMEGA, P_STUCK_SIGMA,
    P_STUCK_OMEGA, N_LANDING,
) = range(23)  # fmt: skip
# indices of the state, likewise; the ring of the last lost angles comes first
S_RING = 0
(
    S_SAMPLE, S_COUNT, S_FREE_ANGLE, S_FREE_SPEED, S_DEMAND, S_TORQUE, S_SLOPE, S_OLDER_SLOPE,
    S_CONTACTS, S_LOAD_SPEED, S_LEFT_AT, N_LANDING_STATE,
) = range(RING, RING + 12)  # fmt: skip


@inlined
def watch(p: Vector, measured: Vector, state: Vector, command: Vector) -> tuple[float, float]:
    """Motor speed, and how far the second difference is beyond the trigger (-inf between two looks).

    The free motor goes on under the torque realised; its speed is corrected by the slope of the lost angle.
    """
    h = p[P_PERIOD]
    u = measured[MOTOR_TORQUE]
    angle = measured[MOTOR_ANGLE]
    count = int(state[S_COUNT])
    slope = state[S_SLOPE]
    older = state[S_OLDER_SLOPE]
    beyond = -math.inf
    if count == 0:
        free_angle = angle
        free_speed = measured[MOTOR_SPEED] if state[S_SAMPLE] == 0.0 else state[S_FREE_SPEED]
        slope = 0.0
        older = 0.0
        for i in range(RING):
            command[STATE + S_RING + i] = 0.0
    else:
        a = mean_torque(state[S_TORQUE], u, state[S_DEMAND]) / p[P_J1]
        free_angle = state[S_FREE_ANGLE] + h * (state[S_FREE_SPEED] + 0.5 * h * a)
        free_speed = state[S_FREE_SPEED] + h * a
        for i in range(RING):
            command[STATE + S_RING + i] = state[S_RING + i]
        stride = int(p[P_STRIDE])
        if count % stride == 0:
            half = int(p[P_HALF])
            kept = count // stride
            lost = free_angle - angle
            middle = state[S_RING + (kept + RING - half) % RING]
            oldest = state[S_RING + (kept + RING - 2 * half) % RING]
            command[STATE + S_RING + kept % RING] = lost
            length = half * stride * h
            slope = 0.5 * (lost - oldest) / length
            older = (middle - oldest) / length
            beyond = lost - 2.0 * middle + oldest - p[P_TRIGGER]
    for i in range(S_SAMPLE, N_LANDING_STATE):
        command[STATE + i] = state[i]
    command[STATE + S_SAMPLE] = state[S_SAMPLE] + 1.0
    command[STATE + S_COUNT] = count + 1
    command[STATE + S_FREE_ANGLE] = free_angle
    command[STATE + S_FREE_SPEED] = free_speed
    command[STATE + S_TORQUE] = u
    command[STATE + S_SLOPE] = slope
    command[STATE + S_OLDER_SLOPE] = older
    return free_speed - slope, beyond


@inlined
def drift(p: Vector, state: Vector) -> float:
    """By how much the load slows down while the gap is open, rad/s^2."""
    return p[P_DRIFT] if state[S_CONTACTS] == 0.0 else p[P_PULL]


@inlined
def load_speed(p: Vector, state: Vector, t: float) -> float:
    """Speed of the load while the gap is open; a reactive load comes to rest."""
    began = p[P_LOAD_SPEED] if state[S_CONTACTS] == 0.0 else state[S_LOAD_SPEED]
    speed = began - drift(p, state) * (t - state[S_LEFT_AT])
    if p[P_RESTS] != 0.0 and speed * began <= 0.0:
        return 0.0
    return speed


@inlined
def sticks(p: Vector, state: Vector) -> float:
    """1 where the load is at rest before contact and does not move until T > Mc."""
    return p[P_STICKS] if state[S_CONTACTS] == 0.0 else 0.0


@inlined
def approach(p: Vector, state: Vector, t: float, speed: float) -> float:
    """The torque that closes the gap, within 0 and the low torque."""
    if state[S_CONTACTS] == 0.0:
        # never less than half: a contact not seen must not let the load run back
        allowed = p[P_LOAD_SPEED] + p[P_APPROACH] - min(p[P_DRIFT] * t, 0.5 * p[P_APPROACH])
    else:
        allowed = state[S_LOAD_SPEED] + p[P_APPROACH]
    return min(max(p[P_J1] * (allowed - speed) / p[P_HORIZON], 0.0), p[P_LOW])


@inlined
def open_again(t: float, motor_speed: float, load_speed_now: float, state: Vector, command: Vector) -> None:
    """The flanks have parted: watch anew, from the speeds of motor and load."""
    command[STATE + S_COUNT] = 0.0
    command[STATE + S_FREE_SPEED] = motor_speed
    command[STATE + S_CONTACTS] = state[S_CONTACTS] + 1.0
    command[STATE + S_LOAD_SPEED] = load_speed_now
    command[STATE + S_LEFT_AT] = t


@compiled
def mean_twist(p: Vector, u: float) -> float:
    """Twist about which the closed drive swings under the motor torque u, in rad."""
    return (u / p[P_J1] + p[P_PULL]) / (p[P_SIGMA] * p[P_SIGMA] + p[P_OMEGA] * p[P_OMEGA])


@compiled
def motor_torque(p: Vector, twist: float) -> float:
    """The motor torque that keeps a twist: the inverse of `mean_twist`."""
    return p[P_J1] * (twist * (p[P_SIGMA] * p[P_SIGMA] + p[P_OMEGA] * p[P_OMEGA]) - p[P_PULL])


@compiled
def move(
    p: Vector, z: float, v: float, stuck: float, u: float, s: float
) -> tuple[float, float, float, float, float]:
    """The closed drive after the time s under the torque u, by the model.

    Twist, its rate, 1 if the load is still stuck, for how long it has not been, and by how much the motor
    has become faster.
    """
    moving = s
    gained = 0.0
    if stuck != 0.0:
        mean = u / p[P_C]
        end_z, end_v = swing(z, v, mean, p[P_STUCK_SIGMA], p[P_STUCK_OMEGA], s)
        if p[P_C] * end_z + p[P_D] * end_v <= p[P_MC]:
            return end_z, end_v, 1.0, 0.0, end_v - v
        low, high = 0.0, s
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            end_z, end_v = swing(z, v, mean, p[P_STUCK_SIGMA], p[P_STUCK_OMEGA], middle)
            if p[P_C] * end_z + p[P_D] * end_v > p[P_MC]:
                high = middle
            else:
                low = middle
        end_z, end_v = swing(z, v, mean, p[P_STUCK_SIGMA], p[P_STUCK_OMEGA], high)
        moving = s - high
        gained = end_v - v
        z, v = end_z, end_v
    end_z, end_v = swing(z, v, mean_twist(p, u), p[P_SIGMA], p[P_OMEGA], moving)
    impulse = p[P_SHARE] * (moving * (u / p[P_J1] + p[P_PULL]) - (end_v - v))  # of the shaft, over J1
    return end_z, end_v, 0.0, moving, gained + moving * u / p[P_J1] - impulse


@compiled
def lost_angle(p: Vector, s: float, u: float, v: float, stuck: float) -> float:
    """Angle lost to the shaft s after contact, in rad."""
    if s <= 0.0:
        return 0.0
    if stuck != 0.0:
        z, _ = swing(0.0, v, u / p[P_C], p[P_STUCK_SIGMA], p[P_STUCK_OMEGA], s)
        return s * (0.5 * s * u / p[P_J1] + v) - z
    a = u / p[P_J1] + p[P_PULL]
    z, _ = swing(0.0, v, mean_twist(p, u), p[P_SIGMA], p[P_OMEGA], s)
    return p[P_SHARE] * (s * (0.5 * s * a + v) - z)


@compiled
def contact_seen(
    p: Vector, state: Vector, t: float, u: float, beyond: float, free_speed: float, older_slope: float
) -> tuple[float, float]:
    """How long ago the contact was, and at what speed the flanks met.

    From the second difference, `beyond` the trigger, the speed the motor would have now, freed from the
    shaft, and what that speed was wrong by in the older half of the window, the shaft's part taken out.
    """
    difference = beyond + p[P_TRIGGER]
    back = p[P_HALF] * p[P_STRIDE] * p[P_PERIOD]
    longest = 2.0 * back + 0.5 * math.pi / p[P_OMEGA]
    slowest = SLOWEST * p[P_APPROACH]
    stuck = sticks(p, state)
    free = free_speed - older_slope - load_speed(p, state, t)
    closing = u / p[P_J1] + drift(p, state)
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


def shaft_torque_under(drive: Drive, torque: Any) -> Any:
    """Mean shaft torque in contact under a motor torque; a load that pushes is not counted.

    >>> round(float(shaft_torque_under(Drive.load("crane-4amtkf"), 62)), 2)
    52.86
    """
    return (np.asarray(torque) * drive.J2 + drive.J1 * pulling_load(drive)) / (drive.J1 + drive.J2)


def contact_threshold(drive: Drive, low: Any, approach_speed: Any, period: Any) -> Any:
    """0.1 M12avg_base, at most half of what the shaft carries under the low torque, in N m.

    Nor more than half of what the speed control applies to a motor that the shaft holds at rest, which is J1
    approach_speed/(horizon + W): the speed that it knows is as old as the window W = sqrt(6 q J1/threshold).
    """
    rounding = np.sqrt(6.0 * np.asarray(encoder_count(drive)) * drive.J1)
    ahead = horizon(drive, period)
    speed = np.asarray(approach_speed) * drive.J1
    root = 2.0 * LOW_SHARE * speed / (rounding + np.sqrt(rounding**2 + 4.0 * LOW_SHARE * ahead * speed))
    return np.minimum(
        np.minimum(THRESHOLD * base_torque(drive), LOW_SHARE * shaft_torque_under(drive, low)), root**2
    )


def horizon(drive: Drive, period: Any) -> Any:
    """Time in s in which the speed control takes the motor to its speed."""
    return 2.0 * (np.asarray(period) + drive.torque_lag + drive.computing_delay)


def pole(drive: Drive, stiffness: Any, stuck: bool = False) -> tuple[Any, Any]:
    """Pole of the closed drive as (sigma, omega) in 1/s and rad/s; the load stuck or moving.

    The damping ratio d Omega/(2 c) is taken as 0.95 at most: what is damped more does not swing anyway.
    """
    inverse = 1.0 / drive.J1 + (0.0 if stuck else 1.0 / drive.J2)
    Omega = np.sqrt(stiffness * inverse)
    ratio = np.minimum(0.5 * drive.d * Omega / stiffness, LARGEST_DAMPING)
    return -ratio * Omega, Omega * np.sqrt(1.0 - ratio**2)


def landing_numbers(
    drive: Drive,
    *,
    period: Any,
    low_torque: Any,
    approach_speed: Any,
    threshold: Any,
    patience: Any,
    stiffness: Any,
) -> tuple[Any, ...]:
    """The parameters P_PERIOD to P_STUCK_OMEGA, each a number or an array."""
    half, stride, trigger = window(drive, threshold, 1.0, period)
    rests = float(drive.load_kind == "reactive") * (np.asarray(drive.Mc) > 0.0)
    rolling = np.where(rests == 0.0, 1.0, np.sign(drive.initial_load_speed))
    sigma, omega = pole(drive, stiffness)
    stuck_sigma, stuck_omega = pole(drive, stiffness, stuck=True)
    return (
        period, drive.J1, low_torque, approach_speed,
        horizon(drive, period), drive.initial_load_speed,
        rolling * drive.Mc / drive.J2, half, stride, trigger, patience, drive.Mc, drive.Mc / drive.J2,
        rests * (np.asarray(drive.initial_load_speed) == 0.0), rests, stiffness,
        -2.0 * sigma * stiffness / (sigma**2 + omega**2), drive.J2 / (drive.J1 + drive.J2),
        sigma, omega, stuck_sigma, stuck_omega,
    )  # fmt: skip
