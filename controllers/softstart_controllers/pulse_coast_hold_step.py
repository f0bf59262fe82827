"""The compiled step of `pulse-coast-hold`; what it does and why is told in `pulse_coast_hold`."""

from __future__ import annotations

import math
from typing import Any

from softstart.controller import compiled_step
from softstart.controller.compiled import MEASURED, Answer, Vector, inner, keep_state, named, record
from softstart_controllers.contact import (
    TIME_DEVIATION,
    lean,
    lean_of_ramp,
    mean_of_ramp,
    take_up,
    time_since_contact,
)
from softstart_controllers.sampled import mean_torque
from softstart_controllers.shaft_filter import (
    FREE,
    SHAFT,
    Free,
    Shaft,
    copy,
    free_predict,
    free_update,
    move,
    shaft_predict,
    shaft_update,
)  # fmt: skip

RING = 64  # samples of the free motor that are kept at most
MOST_OPENINGS = 8  # of the gap, after which the torque is just raised
J1_CERTAINTY = 2.0  # standard deviations of 1/J1 that are no contact
SOFTEST = 0.1  # of the coast speed
TELLING = 0.2  # of Ms: with less torque at its end the pulse does not tell the delay
MOST_DELAY = 3.0  # times the delay told and a sample

# phases, in this order
PULSE, COAST, CONTACT, HOLD, RAISE = 0.0, 1.0, 2.0, 3.0, 4.0


class Parameters:
    """What `PulseCoastHold.vector` gives."""

    period: float
    Ms: float
    Mc: float
    reactive: float
    load_speed: float
    c: float
    d: float
    a: float
    a_variance: float
    b: float
    b_variance: float
    b_least: float
    b_most: float
    coast: float
    share: float
    delay: float
    samples: float
    rounding: float
    certainty: float
    free_noise: float
    speed_noise: float
    twist_noise: float
    load_noise: float
    damping: float
    stiffening: float
    rise: float
    patience: float
    blind: float
    slew: float
    rate: float


class State:
    """The pulse, the hold, and the filters; `now` is the free motor now, `free` is p.samples behind it."""

    sample: float
    demand: float
    realised: float
    phase: float
    held_back: float
    delay: float
    load_speed: float
    load_variance: float
    load_time: float
    b: float
    b_variance: float
    push: float
    level: float
    peak: float
    openings: float
    kept: float
    progress: float
    free: Free
    now: Free
    shaft: Shaft
    angles: Vector  # of the samples that `free` has not seen yet
    means: Vector
    leans: Vector
    doubts: Vector


PARTS: Any = {"free": FREE, "now": FREE, "shaft": SHAFT}
PARTS |= dict.fromkeys(("angles", "means", "leans", "doubts"), RING)
PARAMETERS, STATE, COMMAND = record(Parameters), record(State, **PARTS), record(Answer, State, **PARTS)


@inner
def free_motion(p: Parameters, m: State, angle: float, mean: float, early: float, doubt: float) -> None:
    """The filter of the free motor goes on a sample, p.samples behind; from there to now by the torque."""
    h = p.period
    kept = int(m.kept)
    if kept == int(p.samples):
        free_predict(m.free, m.means[0], m.leans[0], h, p.free_noise + m.doubts[0])
        free_update(m.free, m.angles[0], p.rounding)
        kept -= 1
        for i in range(kept):
            m.angles[i] = m.angles[i + 1]
            m.means[i] = m.means[i + 1]
            m.leans[i] = m.leans[i + 1]
            m.doubts[i] = m.doubts[i + 1]
    m.angles[kept] = angle
    m.means[kept] = mean
    m.leans[kept] = early
    m.doubts[kept] = doubt
    m.kept = kept + 1.0
    free_after(p, m, kept + 1)


@inner
def free_after(p: Parameters, m: State, samples: int) -> None:
    """The free motor so many samples after the filter."""
    copy(m.free, m.now)
    for i in range(samples):
        noise = p.free_noise + m.doubts[i]
        free_predict(m.now, m.means[i], m.leans[i], p.period, noise)


@inner
def surely(p: Parameters, m: State) -> float:
    """Angle in rad by which the encoder must differ from the free motor to mean a contact."""
    by_inertia = m.now.p02 * m.now.p02 / m.now.p22 if m.now.p22 > 0.0 else 0.0
    rest = max(m.now.p00 - by_inertia, 0.0) + p.rounding
    return p.certainty * math.sqrt(rest) + J1_CERTAINTY * math.sqrt(by_inertia)


@inner
def drift_since(p: Parameters, m: State, t: float) -> float:
    """Impulse in N m s by which the load torque has slowed a load that it can move: w2 falls by it/J2."""
    if p.reactive == 0.0:
        return p.Mc * (t - m.load_time)
    if m.load_speed > 0.0:
        return min(p.Mc * (t - m.load_time), m.load_speed / m.b)
    return 0.0


@inner
def follow(p: Parameters, m: State, angle: float, mean: float, early: float, doubt: float) -> None:
    """The filter of the shaft goes on a sample."""
    h, a = p.period, m.free.inverse
    speed = a * h * p.speed_noise
    twist = h * p.twist_noise * abs(m.shaft.w1 - m.shaft.w2)
    load = m.shaft.b * h * p.load_noise
    shaft_predict(
        m.shaft,
        mean,
        early,
        h,
        a,
        p.c,
        p.d,
        p.Mc,
        p.reactive,
        speed * speed + doubt,
        twist * twist,
        load * load,
    )
    shaft_update(m.shaft, angle, p.rounding, p.b_least, p.b_most)


@inner
def contact(p: Parameters, m: State, t: float, behind: float, pulsing: bool) -> None:
    """Tell when the gap closed, begin the filter of the shaft then, and let it see the samples since."""
    h = p.period
    kept = int(m.kept)
    if pulsing:  # what looked like another inertia may have been the contact
        m.free.inverse = p.a
    a, b = m.free.inverse, m.b
    drift = drift_since(p, m, t)
    w2 = m.load_speed - b * drift
    V = m.now.speed - w2
    u = 0.0
    slope = 0.0
    if pulsing:
        recent = min(kept, 4)
        for i in range(kept - recent, kept):
            u += m.means[i] / recent
        slope = a * u + (b * p.Mc if drift != 0.0 else 0.0)
    s = time_since_contact(behind, V, slope, a, p.c, p.d, kept * h)
    again = max(0, min(math.floor(s / h) - 1, kept - 1))
    free_after(p, m, kept - again)
    back = again * h if drift != 0.0 else 0.0
    doubt = TIME_DEVIATION * s + 0.1 * h
    take_up(
        m.shaft, m.now, s - again * h, doubt * doubt, u, m.load_speed, m.load_variance,
        drift - p.Mc * back, b, m.b_variance, a, p.c, p.d, p.Mc, p.reactive,
    )  # fmt: skip
    first = kept - again
    shaft_update(m.shaft, m.angles[first - 1], p.rounding, p.b_least, p.b_most)
    for i in range(first, kept):
        follow(p, m, m.angles[i], m.means[i], m.leans[i], m.doubts[i])
    m.push = 1.0 if pulsing else 0.0
    m.level = 0.0


@inner
def opened(p: Parameters, m: State, t: float, u: float) -> None:
    """The gap is open again: as at the start, with what is known of motor and load by now."""
    P = m.shaft.P
    m.openings += 1.0
    m.load_speed = m.shaft.w2
    m.load_variance = P[3, 3]
    m.load_time = t
    m.b = m.shaft.b
    m.b_variance = max(P[4, 4], 0.01 * m.b * m.b)
    m.free.angle, m.free.speed = m.shaft.phi1, m.shaft.w1
    m.free.p00, m.free.p01, m.free.p11 = P[0, 0], P[0, 1], P[1, 1]
    m.free.p02, m.free.p12 = 0.0, 0.0
    m.kept = 0.0
    m.held_back = -m.delay * u
    free_after(p, m, 0)


@inner
def full_load(p: Parameters, ratio: float) -> float:
    """Mean shaft torque in N m under Ms, [G](16), for J1/J2 = ratio."""
    return (p.Ms + p.Mc * ratio) / (1.0 + ratio)


@inner
def gentle_speed(p: Parameters, a: float, b: float) -> float:
    """Relative speed in rad/s: the coast speed, or less where the drive, coasting in contact with it, would
    swing to more than the share of the full load that may be held.

    It swings about z0 = Mc b/Omega^2 to z0 + sqrt(z0^2 + v^2/Omega^2).
    """
    square = p.c * (a + b)
    z0 = p.Mc * b / square
    most = p.share * full_load(p, b / a) / p.c
    v = square * most * (most - 2.0 * z0)
    return min(p.coast, max(math.sqrt(max(v, 0.0)), SOFTEST * p.coast))


@inner
def held_back(p: Parameters, m: State, u: float) -> float:
    """Impulse in N m s that is still to come when the demand goes to 0.

    Under a lag, or a dead time, it is what the motor has not got of the impulse demanded so far; a torque
    that slews falls as it rose.
    """
    return m.held_back if p.slew == 0.0 else u * (p.delay + u * p.slew)


@inner
def pulse(p: Parameters, m: State, b: float, u: float) -> float:
    """Torque in N m of the next sample: what the motor needs to its speed, less what is still to come."""
    a = m.free.inverse
    wanted = m.load_speed + (gentle_speed(p, a, b) if m.openings > 0.0 else p.coast)
    missing = (wanted - m.now.speed) / a - held_back(p, m, u)
    return min(max(missing / p.period, 0.0), p.Ms)


@inner
def hold(p: Parameters, m: State, u: float, catching: bool) -> float:
    """Torque in N m of the next sample in contact, from the state that the shaft will have when it acts."""
    h, c, d, Mc, Ms, reactive = p.period, p.c, p.d, p.Mc, p.Ms, p.reactive
    a, b = m.free.inverse, m.shaft.b
    w1, z, w2 = m.shaft.w1, m.shaft.z, m.shaft.w2
    steps = int(m.delay / h) + 1
    for _ in range(steps):
        _, w1, z, w2 = move(w1, z, w2, b, u, m.delay / steps, a, c, d, Mc, reactive)
    rate = w1 - w2
    ratio = b / a
    square = c * (a + b)
    if catching:
        if m.push != 0.0:
            z0 = Mc * b / square
            v = gentle_speed(p, a, b)
            missing = v * v + square * (z0 * z0 - (z - z0) * (z - z0)) - rate * rate
            push = min(missing / (2.0 * max(rate, 1e-9) * a * h), Ms) if missing > 0.0 else 0.0
            if push < Ms:
                m.push = 0.0
            if push > 0.0:
                return push
        _, x1, _, x2 = move(w1, z, w2, b, 0.0, h, a, c, d, Mc, reactive)
        return min(max((x2 - x1) / (a * h), 0.0), Ms)
    full = full_load(p, ratio)
    least = p.share * full
    if m.level < least:
        rise = (least - m.peak) * h * math.sqrt(square) / (2.0 * math.pi)
        m.level = min(m.level + max(rise, 0.0), least)
    level = min(m.level, full)
    demand = level * (1.0 + ratio) - Mc * ratio + p.stiffening * (level - c * z)
    demand -= 2.0 * p.damping * math.sqrt(square) / a * rate
    return min(max(demand, 0.0), Ms)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Pulse, coast, hold: see `PulseCoastHold`."""
    p = named(parameters, PARAMETERS)
    m = named(command, COMMAND)
    seen = named(measured, MEASURED)
    keep_state(state, command)
    h, t, u, angle = p.period, seen.time, seen.motor_torque, seen.motor_angle
    sample = m.sample
    phase = m.phase
    if sample == 0.0:
        phase = RAISE if p.blind != 0.0 else PULSE
        m.free.angle, m.free.speed, m.free.inverse = angle, seen.motor_speed, p.a
        m.free.p00, m.free.p22 = p.rounding, p.a_variance
        m.delay = p.delay
        m.held_back = -p.delay * u
        m.load_speed = p.load_speed
        m.b, m.b_variance = p.b, p.b_variance
        free_after(p, m, 0)
    else:
        mean = mean_torque(m.realised, u, m.demand)
        early = lean(m.realised, u, m.demand, mean)
        doubt = 0.0
        if p.rate > 0.0:  # slewed, lagged or both: one sample does not tell, and the truth may lie outside
            line = mean_of_ramp(m.realised, u, p.rate * h)
            doubt = (2.0 * p.a * h * (mean - line)) ** 2
            if p.slew > 0.0:
                mean, early = line, lean_of_ramp(m.realised, u, p.rate * h)
        if phase < CONTACT:
            m.held_back += h * (m.demand - mean)
            free_motion(p, m, angle, mean, early, doubt)
            behind = m.now.angle - angle
            enough = surely(p, m)
            if behind > enough:
                contact(p, m, t, behind, phase == PULSE)
                phase = CONTACT
            elif behind < -enough:  # the load pushes the motor: there is no contact to wait for
                phase = RAISE
        elif phase != RAISE:
            follow(p, m, angle, mean, early, doubt)
            if m.shaft.z < 0.0 and m.shaft.w1 < m.shaft.w2:
                opened(p, m, t, u)
                phase = PULSE if m.openings <= MOST_OPENINGS else RAISE
    if t >= p.patience and phase != RAISE:
        phase = RAISE
        m.progress = m.demand / p.Ms

    demand = 0.0
    if phase == PULSE:
        demand = pulse(p, m, m.b, u)
        if demand < p.Ms:
            phase = COAST
            if u > TELLING * p.Ms:  # the mean time by which the torque is late, as it was in the pulse
                m.delay = min(max(held_back(p, m, u) / u, 0.0), MOST_DELAY * (p.delay + h))
    elif CONTACT <= phase < RAISE:
        demand = hold(p, m, u, phase == CONTACT)
        if phase == CONTACT:
            m.level = max(m.level, p.c * m.shaft.z)
            if m.shaft.w1 < m.shaft.w2:
                phase = HOLD
                m.peak = m.level
    elif phase == RAISE:
        m.progress = min(1.0, m.progress + p.rise)
        demand = p.Ms * m.progress

    m.torque = demand
    m.ask_again = (sample + 1.0) * h
    m.sample = sample + 1.0
    m.demand = demand
    m.realised = u
    m.phase = phase
