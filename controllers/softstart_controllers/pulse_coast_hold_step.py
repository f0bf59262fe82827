"""The compiled step of `pulse-coast-hold`; what it does and why is told in `pulse_coast_hold`."""

from __future__ import annotations

import math

from softstart.controller import compiled_step
from softstart.controller.compiled import (
    ASK_AGAIN,
    MOTOR_ANGLE,
    MOTOR_SPEED,
    MOTOR_TORQUE,
    STATE,
    TIME,
    TORQUE,
    Vector,
)
from softstart.plant.jit import compiled
from softstart_controllers.contact import (
    TIME_DEVIATION,
    lean,
    lean_of_ramp,
    mean_of_ramp,
    take_up,
    time_since_contact,
)
from softstart_controllers.sampled import mean_torque

from softstart_controllers.shaft_filter import (  # isort: skip
    ANGLE, B, COVARIANCE, FREE_SIZE, INVERSE, N, P00, P01, P02, P11, P12, P22, PHI1, SHAFT_SIZE, SPEED, W1,
    W2, Z, free_predict, free_update, move, shaft_predict, shaft_update,
)  # fmt: skip

RING = 64  # samples of the free motor that are kept at most
MOST_OPENINGS = 8  # of the gap, after which the torque is just raised
J1_CERTAINTY = 2.0  # standard deviations of 1/J1 that are no contact
SOFTEST = 0.1  # of the coast speed
TELLING = 0.2  # of Ms: with less torque at its end the pulse does not tell the delay
MOST_DELAY = 3.0  # times the delay told and a sample

# indices of the parameter vector
(
    P_PERIOD, P_MS, P_MC, P_REACTIVE, P_LOAD_SPEED, P_C, P_D, P_A, P_A_VARIANCE, P_B, P_B_VARIANCE, P_B_LEAST,
    P_B_MOST, P_COAST, P_SHARE, P_DELAY, P_SAMPLES, P_ROUNDING, P_CERTAINTY, P_FREE_NOISE, P_SPEED_NOISE,
    P_TWIST_NOISE, P_LOAD_NOISE, P_DAMPING, P_STIFFENING, P_RISE, P_PATIENCE, P_BLIND,
    P_SLEW, P_RATE,
) = range(30)  # fmt: skip

# indices of `command`: the new state
(
    S_SAMPLE, S_DEMAND, S_TORQUE, S_PHASE, S_HELD_BACK, S_DELAY, S_LOAD_SPEED, S_LOAD_VARIANCE, S_LOAD_TIME,
    S_B, S_B_VARIANCE, S_PUSH, S_LEVEL, S_PEAK, S_OPENINGS, S_KEPT, S_PROGRESS, S_FREE,
) = range(STATE, STATE + 18)  # fmt: skip
S_NOW = S_FREE + FREE_SIZE  # the free motor now; S_FREE is P_SAMPLES behind
S_SHAFT = S_NOW + FREE_SIZE
S_ANGLES = S_SHAFT + SHAFT_SIZE
S_MEANS = S_ANGLES + RING
S_LEANS = S_MEANS + RING
S_DOUBTS = S_LEANS + RING
STATE_SIZE = S_DOUBTS + RING - STATE

# values of S_PHASE, in this order
PULSE, COAST, CONTACT, HOLD, RAISE = 0.0, 1.0, 2.0, 3.0, 4.0


@compiled
def free_motion(p: Vector, m: Vector, angle: float, mean: float, early: float, doubt: float) -> None:
    """The filter of the free motor goes on a sample, P_SAMPLES behind; from there to now by the torque."""
    h = p[P_PERIOD]
    kept = int(m[S_KEPT])
    if kept == int(p[P_SAMPLES]):
        free_predict(m, S_FREE, m[S_MEANS], m[S_LEANS], h, p[P_FREE_NOISE] + m[S_DOUBTS])
        free_update(m, S_FREE, m[S_ANGLES], p[P_ROUNDING])
        kept -= 1
        for i in range(kept):
            m[S_ANGLES + i] = m[S_ANGLES + i + 1]
            m[S_MEANS + i] = m[S_MEANS + i + 1]
            m[S_LEANS + i] = m[S_LEANS + i + 1]
            m[S_DOUBTS + i] = m[S_DOUBTS + i + 1]
    m[S_ANGLES + kept] = angle
    m[S_MEANS + kept] = mean
    m[S_LEANS + kept] = early
    m[S_DOUBTS + kept] = doubt
    m[S_KEPT] = kept + 1.0
    free_after(p, m, kept + 1)


@compiled
def free_after(p: Vector, m: Vector, samples: int) -> None:
    """The free motor so many samples after the filter, at S_NOW."""
    for i in range(FREE_SIZE):
        m[S_NOW + i] = m[S_FREE + i]
    for i in range(samples):
        noise = p[P_FREE_NOISE] + m[S_DOUBTS + i]
        free_predict(m, S_NOW, m[S_MEANS + i], m[S_LEANS + i], p[P_PERIOD], noise)


@compiled
def surely(p: Vector, m: Vector) -> float:
    """Angle in rad by which the encoder must differ from the free motor to mean a contact."""
    by_inertia = m[S_NOW + P02] * m[S_NOW + P02] / m[S_NOW + P22] if m[S_NOW + P22] > 0.0 else 0.0
    rest = max(m[S_NOW + P00] - by_inertia, 0.0) + p[P_ROUNDING]
    return p[P_CERTAINTY] * math.sqrt(rest) + J1_CERTAINTY * math.sqrt(by_inertia)


@compiled
def drift_since(p: Vector, m: Vector, t: float) -> float:
    """Impulse in N m s by which the load torque has slowed a load that it can move: w2 falls by it/J2."""
    if p[P_REACTIVE] == 0.0:
        return p[P_MC] * (t - m[S_LOAD_TIME])
    if m[S_LOAD_SPEED] > 0.0:
        return min(p[P_MC] * (t - m[S_LOAD_TIME]), m[S_LOAD_SPEED] / m[S_B])
    return 0.0


@compiled
def follow(p: Vector, m: Vector, angle: float, mean: float, early: float, doubt: float) -> None:
    """The filter of the shaft goes on a sample."""
    h, a, X = p[P_PERIOD], m[S_FREE + INVERSE], S_SHAFT
    speed = a * h * p[P_SPEED_NOISE]
    twist = h * p[P_TWIST_NOISE] * abs(m[X + W1] - m[X + W2])
    load = m[X + B] * h * p[P_LOAD_NOISE]
    shaft_predict(
        m,
        X,
        mean,
        early,
        h,
        a,
        p[P_C],
        p[P_D],
        p[P_MC],
        p[P_REACTIVE],
        speed * speed + doubt,
        twist * twist,
        load * load,
    )
    shaft_update(m, X, angle, p[P_ROUNDING], p[P_B_LEAST], p[P_B_MOST])


@compiled
def contact(p: Vector, m: Vector, t: float, behind: float, pulsing: bool) -> None:
    """Tell when the gap closed, begin the filter of the shaft then, and let it see the samples since."""
    h = p[P_PERIOD]
    kept = int(m[S_KEPT])
    if pulsing:  # what looked like another inertia may have been the contact
        m[S_FREE + INVERSE] = p[P_A]
    a, b = m[S_FREE + INVERSE], m[S_B]
    drift = drift_since(p, m, t)
    w2 = m[S_LOAD_SPEED] - b * drift
    V = m[S_NOW + SPEED] - w2
    u = 0.0
    slope = 0.0
    if pulsing:
        recent = min(kept, 4)
        for i in range(kept - recent, kept):
            u += m[S_MEANS + i] / recent
        slope = a * u + (b * p[P_MC] if drift != 0.0 else 0.0)
    s = time_since_contact(behind, V, slope, a, p[P_C], p[P_D], kept * h)
    again = max(0, min(math.floor(s / h) - 1, kept - 1))
    free_after(p, m, kept - again)
    back = again * h if drift != 0.0 else 0.0
    doubt = TIME_DEVIATION * s + 0.1 * h
    take_up(
        m, S_SHAFT, S_NOW, s - again * h, doubt * doubt, u, m[S_LOAD_SPEED], m[S_LOAD_VARIANCE],
        drift - p[P_MC] * back, b, m[S_B_VARIANCE], a, p[P_C], p[P_D], p[P_MC], p[P_REACTIVE],
    )  # fmt: skip
    first = kept - again
    shaft_update(m, S_SHAFT, m[S_ANGLES + first - 1], p[P_ROUNDING], p[P_B_LEAST], p[P_B_MOST])
    for i in range(first, kept):
        follow(p, m, m[S_ANGLES + i], m[S_MEANS + i], m[S_LEANS + i], m[S_DOUBTS + i])
    m[S_PUSH] = 1.0 if pulsing else 0.0
    m[S_LEVEL] = 0.0


@compiled
def opened(p: Vector, m: Vector, t: float, u: float) -> None:
    """The gap is open again: as at the start, with what is known of motor and load by now."""
    P = S_SHAFT + COVARIANCE
    m[S_OPENINGS] += 1.0
    m[S_LOAD_SPEED] = m[S_SHAFT + W2]
    m[S_LOAD_VARIANCE] = m[P + N * W2 + W2]
    m[S_LOAD_TIME] = t
    m[S_B] = m[S_SHAFT + B]
    m[S_B_VARIANCE] = max(m[P + N * B + B], 0.01 * m[S_B] * m[S_B])
    m[S_FREE + ANGLE], m[S_FREE + SPEED] = m[S_SHAFT + PHI1], m[S_SHAFT + W1]
    m[S_FREE + P00], m[S_FREE + P01], m[S_FREE + P11] = m[P], m[P + W1], m[P + N * W1 + W1]
    m[S_FREE + P02], m[S_FREE + P12] = 0.0, 0.0
    m[S_KEPT] = 0.0
    m[S_HELD_BACK] = -m[S_DELAY] * u
    free_after(p, m, 0)


@compiled
def full_load(p: Vector, ratio: float) -> float:
    """Mean shaft torque in N m under Ms, [G](16), for J1/J2 = ratio."""
    return (p[P_MS] + p[P_MC] * ratio) / (1.0 + ratio)


@compiled
def gentle_speed(p: Vector, a: float, b: float) -> float:
    """Relative speed in rad/s: the coast speed, or less where the drive, coasting in contact with it, would
    swing to more than the share of the full load that may be held.

    It swings about z0 = Mc b/Omega^2 to z0 + sqrt(z0^2 + v^2/Omega^2).
    """
    square = p[P_C] * (a + b)
    z0 = p[P_MC] * b / square
    most = p[P_SHARE] * full_load(p, b / a) / p[P_C]
    v = square * most * (most - 2.0 * z0)
    return min(p[P_COAST], max(math.sqrt(max(v, 0.0)), SOFTEST * p[P_COAST]))


@compiled
def held_back(p: Vector, m: Vector, u: float) -> float:
    """Impulse in N m s that is still to come when the demand goes to 0.

    Under a lag, or a dead time, it is what the motor has not got of the impulse demanded so far; a torque
    that slews falls as it rose.
    """
    return m[S_HELD_BACK] if p[P_SLEW] == 0.0 else u * (p[P_DELAY] + u * p[P_SLEW])


@compiled
def pulse(p: Vector, m: Vector, b: float, u: float) -> float:
    """Torque in N m of the next sample: what the motor needs to its speed, less what is still to come."""
    a = m[S_FREE + INVERSE]
    wanted = m[S_LOAD_SPEED] + (gentle_speed(p, a, b) if m[S_OPENINGS] > 0.0 else p[P_COAST])
    missing = (wanted - m[S_NOW + SPEED]) / a - held_back(p, m, u)
    return min(max(missing / p[P_PERIOD], 0.0), p[P_MS])


@compiled
def hold(p: Vector, m: Vector, u: float, catching: bool) -> float:
    """Torque in N m of the next sample in contact, from the state that the shaft will have when it acts."""
    h, c, d, Mc, Ms, reactive = p[P_PERIOD], p[P_C], p[P_D], p[P_MC], p[P_MS], p[P_REACTIVE]
    a, b = m[S_FREE + INVERSE], m[S_SHAFT + B]
    w1, z, w2 = m[S_SHAFT + W1], m[S_SHAFT + Z], m[S_SHAFT + W2]
    steps = int(m[S_DELAY] / h) + 1
    for _ in range(steps):
        _, w1, z, w2 = move(w1, z, w2, b, u, m[S_DELAY] / steps, a, c, d, Mc, reactive)
    rate = w1 - w2
    ratio = b / a
    square = c * (a + b)
    if catching:
        if m[S_PUSH] != 0.0:
            z0 = Mc * b / square
            v = gentle_speed(p, a, b)
            missing = v * v + square * (z0 * z0 - (z - z0) * (z - z0)) - rate * rate
            push = min(missing / (2.0 * max(rate, 1e-9) * a * h), Ms) if missing > 0.0 else 0.0
            if push < Ms:
                m[S_PUSH] = 0.0
            if push > 0.0:
                return push
        _, x1, _, x2 = move(w1, z, w2, b, 0.0, h, a, c, d, Mc, reactive)
        return min(max((x2 - x1) / (a * h), 0.0), Ms)
    full = full_load(p, ratio)
    least = p[P_SHARE] * full
    if m[S_LEVEL] < least:
        rise = (least - m[S_PEAK]) * h * math.sqrt(square) / (2.0 * math.pi)
        m[S_LEVEL] = min(m[S_LEVEL] + max(rise, 0.0), least)
    level = min(m[S_LEVEL], full)
    demand = level * (1.0 + ratio) - Mc * ratio + p[P_STIFFENING] * (level - c * z)
    demand -= 2.0 * p[P_DAMPING] * math.sqrt(square) / a * rate
    return min(max(demand, 0.0), Ms)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Pulse, coast, hold: see `PulseCoastHold`."""
    p, m = parameters, command
    for i in range(state.shape[0]):
        m[STATE + i] = state[i]
    h, t, u, angle = p[P_PERIOD], measured[TIME], measured[MOTOR_TORQUE], measured[MOTOR_ANGLE]
    sample = m[S_SAMPLE]
    phase = m[S_PHASE]
    if sample == 0.0:
        phase = RAISE if p[P_BLIND] != 0.0 else PULSE
        m[S_FREE + ANGLE], m[S_FREE + SPEED], m[S_FREE + INVERSE] = angle, measured[MOTOR_SPEED], p[P_A]
        m[S_FREE + P00], m[S_FREE + P22] = p[P_ROUNDING], p[P_A_VARIANCE]
        m[S_DELAY] = p[P_DELAY]
        m[S_HELD_BACK] = -p[P_DELAY] * u
        m[S_LOAD_SPEED] = p[P_LOAD_SPEED]
        m[S_B], m[S_B_VARIANCE] = p[P_B], p[P_B_VARIANCE]
        free_after(p, m, 0)
    else:
        mean = mean_torque(m[S_TORQUE], u, m[S_DEMAND])
        early = lean(m[S_TORQUE], u, m[S_DEMAND], mean)
        doubt = 0.0
        if p[P_RATE] > 0.0:  # slewed, lagged or both: one sample does not tell, and the truth may lie outside
            line = mean_of_ramp(m[S_TORQUE], u, p[P_RATE] * h)
            doubt = (2.0 * p[P_A] * h * (mean - line)) ** 2
            if p[P_SLEW] > 0.0:
                mean, early = line, lean_of_ramp(m[S_TORQUE], u, p[P_RATE] * h)
        if phase < CONTACT:
            m[S_HELD_BACK] += h * (m[S_DEMAND] - mean)
            free_motion(p, m, angle, mean, early, doubt)
            behind = m[S_NOW + ANGLE] - angle
            enough = surely(p, m)
            if behind > enough:
                contact(p, m, t, behind, phase == PULSE)
                phase = CONTACT
            elif behind < -enough:  # the load pushes the motor: there is no contact to wait for
                phase = RAISE
        elif phase != RAISE:
            follow(p, m, angle, mean, early, doubt)
            if m[S_SHAFT + Z] < 0.0 and m[S_SHAFT + W1] < m[S_SHAFT + W2]:
                opened(p, m, t, u)
                phase = PULSE if m[S_OPENINGS] <= MOST_OPENINGS else RAISE
    if t >= p[P_PATIENCE] and phase != RAISE:
        phase = RAISE
        m[S_PROGRESS] = m[S_DEMAND] / p[P_MS]

    demand = 0.0
    if phase == PULSE:
        demand = pulse(p, m, m[S_B], u)
        if demand < p[P_MS]:
            phase = COAST
            if u > TELLING * p[P_MS]:  # the mean time by which the torque is late, as it was in the pulse
                m[S_DELAY] = min(max(held_back(p, m, u) / u, 0.0), MOST_DELAY * (p[P_DELAY] + h))
    elif CONTACT <= phase < RAISE:
        demand = hold(p, m, u, phase == CONTACT)
        if phase == CONTACT:
            m[S_LEVEL] = max(m[S_LEVEL], p[P_C] * m[S_SHAFT + Z])
            if m[S_SHAFT + W1] < m[S_SHAFT + W2]:
                phase = HOLD
                m[S_PEAK] = m[S_LEVEL]
    elif phase == RAISE:
        m[S_PROGRESS] = min(1.0, m[S_PROGRESS] + p[P_RISE])
        demand = p[P_MS] * m[S_PROGRESS]

    m[TORQUE] = demand
    m[ASK_AGAIN] = (sample + 1.0) * h
    m[S_SAMPLE] = sample + 1.0
    m[S_DEMAND] = demand
    m[S_TORQUE] = u
    m[S_PHASE] = phase
