"""Motor, shaft and load as a start sees them: told from motor angle and motor torque alone.

*Free.* While the gap is open a Kalman filter follows phi1, w1 and 1/J1 of the free motor, some samples
behind. Contact is seen when the encoder is behind the motion that this filter foretells for now by more than
`detection_threshold` standard deviations; since the filter stays behind, it has not yet seen the contact. The
way lost
grows with the cube of the time since contact, a c v s^3/6 with a = 1/J1: that tells the time s.

*In contact.* An extended Kalman filter of (phi1, w1, z, w2, 1/J2) begins at that instant, z being the twist
beyond the gap, and sees the samples since then, afterwards each new one. The gap is open again once z < 0 and
the flanks part; then the free motor is followed again, from what is known of motor and load by now.

`observe` does all of it in one call a sample; `estimator_parameters` has its numbers for a drive.
"""

from __future__ import annotations

import math
from typing import Any

from softstart.controller import parameter
from softstart.controller.compiled import Double, Doubles, Vector, compiled, inner, record
from softstart.drive import Drive
from softstart.kernel.motor import encoder_count
from softstart_controllers.sampled import mean_torque
from softstart_controllers.shaft_filter import (
    FREE,
    SHAFT,
    Free,
    N,
    ShaftEstimate,
    copy,
    free_predict,
    free_update,
    predicted_motion,
    shaft_predict,
    shaft_update,
)  # fmt: skip

HALVINGS = 40
WANDER = 0.02  # of J1/J2 of the drive, in the time 1/Omega: the model may be wrong
SMALL = 1e-4  # for differences
TIME_DEVIATION = 0.3  # of the time since contact, before the samples since then are looked at
QUEUE = 18  # demands that are kept: the plant has 16 on their way at most
RING = 64  # samples of the free motor that are kept at most
J1_CERTAINTY = 2.0  # standard deviations of 1/J1 that are no contact
RATIO_DEVIATION = 0.1  # of J1/J2, beforehand
RISE_PERIODS = 4.0  # of the motor on a held shaft, to raise the torque to Ms where nothing else can be done
LEAST_RATIO, MOST_RATIO = 0.02, 4.0  # J1/J2
J1_DEVIATION = 0.04
TORQUE_DEVIATION = 0.002  # of Ms, of the torque measured while the motor is free
SHAFT_DEVIATION = 0.003  # of Ms, while the shaft is in contact
LOAD_DEVIATION = 0.01  # of Ms, of the load torque
FLOOR = 1e-5  # of Ms/c: an ideal encoder is no better

NOTHING, CONTACT, OPENED, PUSHED = 0, 1, 2, 3  # what a sample may show


class Parameters:
    """What `estimator_parameters` gives; a = 1/J1 and b = 1/J2, with the variance of what is thought of them.

    Mc and Mb are the load torque in forward and in backward motion (`load_acceleration`).
    """

    period: Double
    Mc: float
    Mb: float
    load_speed: float
    c: float
    d: float
    a: float
    a_variance: float
    b: float
    b_variance: float
    b_least: float
    b_most: float
    samples: int
    rounding: float
    detection_threshold: float
    free_noise: float
    speed_noise: float
    uncertainty: float
    load_noise: float
    b_noise: float
    slew: float
    rate: float
    torque_lag: float
    queued: int
    rest: float
    wound: float
    proving: float
    released: Double
    raising: float


class State:
    """The filters; `now` is the free motor now, `free` is p.samples behind it.

    The load had `load_speed` at `load_time`, the last instant at which it was known. `sent` are the last
    demands, the newest first: those of the dead time are still to act.
    """

    realised: float
    mean: float
    load_speed: float
    load_variance: float
    load_time: Double
    b: float
    b_variance: float
    kept: int
    begun: float
    closed: float
    held: float
    free: Free
    now: Free
    shaft: ShaftEstimate
    angles: Doubles  # of the samples that `free` has not seen yet
    means: Vector
    leads: Vector
    contact_noises: Vector
    sent: Vector


PARTS: Any = {"free": FREE, "now": FREE, "shaft": SHAFT}
PARTS |= dict.fromkeys(("angles", "means", "leads", "contact_noises"), RING) | {"sent": QUEUE}
PARAMETERS, STATE = record(Parameters), record(State, **PARTS)


@compiled
def torque_lead(before: float, after: float, demand: float, mean: float) -> float:
    """How much earlier than its mean the torque of a sample acts: (int int u)/h^2 - mean/2, in N m.

    `before` and `after` are the torques measured at its ends, `demand` the constant demand in it, which the
    torque follows exponentially. With x = ln(b/a), b = demand - before, a = demand - after it is
    int int u = h^2 (demand/2 - b/x + (b - a)/x^2). A fast torque has none: it is at its demand.

    >>> torque_lead(0.0, 0.0, 0.0, 0.0), round(torque_lead(10.0, 9.99, 0.0, 9.995), 6), round(0.01 / 12, 6)
    (0.0, 0.000833, 0.000833)
    """
    b = demand - before
    a = demand - after
    if a * b <= 0.0:
        return 0.0
    if abs(b - a) <= 1e-2 * abs(b):  # what is left out is of second order
        return (before - after) / 12.0
    x = math.log(b / a)
    return 0.5 * (demand - mean) - b / x + (b - a) / (x * x)


@compiled
def mean_of_ramp(before: float, after: float, reach: float) -> float:
    """Mean torque of a sample in which it slewed from `before` to `after`, and then stayed there, in N m.

    `reach` is what the slew limiter lets it change in a whole sample.

    >>> mean_of_ramp(40.0, 20.0, 20.0), mean_of_ramp(10.0, 0.0, 20.0), mean_of_ramp(5.0, 5.0, 20.0)
    (30.0, 2.5, 5.0)
    """
    change = after - before
    return after - 0.5 * change * min(abs(change) / reach, 1.0)


@compiled
def lead_of_ramp(before: float, after: float, reach: float) -> float:
    """How much earlier than its mean that torque acts, as `torque_lead`, in N m.

    >>> round(lead_of_ramp(40.0, 20.0, 20.0) * 12.0, 9), round(lead_of_ramp(10.0, 0.0, 20.0) * 12.0, 9)
    (20.0, 10.0)
    """
    change = after - before
    share = min(abs(change) / reach, 1.0)
    return -change * share * (0.25 - share / 6.0)


@compiled
def deviation(s: float, V: float, slope: float, a: float, c: float, d: float) -> float:
    """How far in rad the motor is behind a free one, s after contact: a int int (c z + d z') ds ds.

    V is the relative speed that a free motor would have now and `slope` its rate, so z' = V - slope s at the
    contact; what the shaft has taken from z' since is of higher order. Undamped and coasting it is
    a c V s^3/6: it grows with the cube of the time, and the loss of speed with its square.

    >>> round(deviation(0.003, 15.0, 0.0, 1 / 0.035, 368.465, 0.0), 8)
    0.00071061
    """
    way = s * s * (0.5 * V - slope * s / 3.0)
    return a * (d * way + c * s * s * s * (V / 6.0 - 0.125 * slope * s))


@compiled
def time_since_contact(
    behind: float, V: float, slope: float, a: float, c: float, d: float, longest: float
) -> float:
    """The s up to `longest`, and up to V/slope, at which the deviation is `behind`; by bisection.

    >>> round(time_since_contact(0.0007106, 15.0, 0.0, 1 / 0.035, 368.465, 0.0, 0.01), 6)
    0.003
    """
    low, high = 0.0, longest
    if slope > 0.0:
        high = min(high, max(V, 0.0) / slope)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if deviation(middle, V, slope, a, c, d) < behind:
            low = middle
        else:
            high = middle
    return high


@inner
def state_after_contact(
    p: Parameters, m: State, s: float, speed: float, w2: float, b: float, drift: float, u: float, pull: float
) -> tuple[float, float, float, float, float]:
    """phi1, w1, z, w2 and b now, s after contact.

    Without the contact the motor would have the angle m.now.angle and this speed, and the load w2 - b drift
    now: the load torque, at last `pull`, has taken that impulse from it. From the contact on all go under the
    motor torque u.
    """
    a = m.free.inverse
    rolling = pull * s if drift != 0.0 else 0.0
    way, w1, z, load = predicted_motion(
        speed - a * u * s, 0.0, w2 - b * (drift - rolling), b, u, s, a, p.c, p.d, p.Mc, p.Mb
    )
    return m.now.angle - s * (speed - 0.5 * a * u * s) + way, w1, z, load, b


@compiled
def begin_shaft(
    p: Parameters, m: State, s: float, s_variance: float, u: float, drift: float, pull: float
) -> None:
    """Begin the filter of the shaft, a time s after contact, from the free motor now.

    The first guess owes its errors to s, to the free motion, to w2 and to 1/J2 = b. The covariance is the sum
    of what each of them does to (phi1, w1, z, w2, 1/J2), by central differences.
    """
    x, now = m.shaft, m.now
    speed, w2, b = now.speed, m.load_speed, m.b
    for k in range(N):
        for j in range(N):
            x.P[k, j] = 0.0
    x.P[0, 0] = now.p00
    for cause in range(4):
        at_s = SMALL * s if cause == 0 else 0.0
        at_speed = SMALL * (abs(speed) + abs(w2)) if cause == 1 else 0.0
        at_w2 = SMALL * (abs(speed) + abs(w2)) if cause == 2 else 0.0
        at_b = SMALL * b if cause == 3 else 0.0
        step = at_s + at_speed + at_w2 + at_b
        variance = (s_variance, now.p11, m.load_variance, m.b_variance)[cause]
        if step <= 0.0:
            continue
        up = state_after_contact(p, m, s + at_s, speed + at_speed, w2 + at_w2, b + at_b, drift, u, pull)
        down = state_after_contact(p, m, s - at_s, speed - at_speed, w2 - at_w2, b - at_b, drift, u, pull)
        for k in range(N):
            x.F[0, k] = (up[k] - down[k]) / (2.0 * step)
        for k in range(N):
            for j in range(N):
                x.P[k, j] += variance * x.F[0, k] * x.F[0, j]
        if cause == 1:  # angle and speed of the free motion err together
            for k in range(N):
                x.P[0, k] += now.p01 * x.F[0, k]
                x.P[k, 0] += now.p01 * x.F[0, k]
    x.phi1, x.w1, x.z, x.w2, x.b = state_after_contact(p, m, s, speed, w2, b, drift, u, pull)


@inner
def free_motion(p: Parameters, m: State, angle: float, mean: float, lead: float, extra_noise: float) -> None:
    """The filter of the free motor goes on a sample, p.samples behind; from there to now by the torque."""
    h = p.period
    kept = int(m.kept)
    if kept == int(p.samples):
        free_predict(m.free, m.means[0], m.leads[0], h, p.free_noise + m.contact_noises[0])
        free_update(m.free, m.angles[0], p.rounding)
        kept -= 1
        for i in range(kept):
            m.angles[i] = m.angles[i + 1]
            m.means[i] = m.means[i + 1]
            m.leads[i] = m.leads[i + 1]
            m.contact_noises[i] = m.contact_noises[i + 1]
    m.angles[kept] = angle
    m.means[kept] = mean
    m.leads[kept] = lead
    m.contact_noises[kept] = extra_noise
    m.kept = kept + 1
    free_after(p, m, kept + 1)


@inner
def free_after(p: Parameters, m: State, samples: int) -> None:
    """The free motor so many samples after the filter."""
    copy(m.free, m.now)
    for i in range(samples):
        noise = p.free_noise + m.contact_noises[i]
        free_predict(m.now, m.means[i], m.leads[i], p.period, noise)


@inner
def margin(p: Parameters, m: State) -> float:
    """Angle in rad by which the encoder must differ from the free motor to mean a contact."""
    by_inertia = m.now.p02 * m.now.p02 / m.now.p22 if m.now.p22 > 0.0 else 0.0
    rest = max(m.now.p00 - by_inertia, 0.0) + p.rounding
    return p.detection_threshold * math.sqrt(rest) + J1_CERTAINTY * math.sqrt(by_inertia)


@inner
def falling(p: Parameters) -> float:
    """Torque in N m that moves a load at rest while the gap is open: 0 where friction holds it."""
    return max(p.Mb, 0.0) + min(p.Mc, 0.0)


@compiled
def drift_since(p: Parameters, m: State, t: float) -> float:
    """Impulse in N m s by which the load torque has slowed a load that it can move: w2 falls by it/J2."""
    time = t - m.load_time
    if m.load_speed > 0.0:
        lost = p.Mc * time
        most = m.load_speed / m.b  # then it stands still
        if p.Mb == p.Mc or lost <= most:
            return lost
        return most + falling(p) * (time - most / p.Mc)
    return falling(p) * time


@inner
def update_shaft_filter(
    p: Parameters, m: State, angle: float, mean: float, lead: float, extra_noise: float
) -> None:
    """The filter of the shaft goes on a sample."""
    h, a = p.period, m.free.inverse
    speed = a * h * p.speed_noise
    twist = h * p.uncertainty * abs(m.shaft.w1 - m.shaft.w2)
    load = m.shaft.b * h * p.load_noise
    w1_noise = speed * speed + extra_noise
    shaft_predict(m.shaft, mean, lead, h, a, p.c, p.d, p.Mc, p.Mb, w1_noise, twist * twist, load * load)
    m.shaft.P[4, 4] += p.b_noise
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
    falls = falling(p)
    pull = falls if falls != 0.0 and w2 <= 0.0 else p.Mc
    V = m.now.speed - w2
    u = 0.0
    slope = 0.0
    if pulsing:
        recent = min(kept, 4)
        for i in range(kept - recent, kept):
            u += m.means[i] / recent
        slope = a * u + (b * pull if drift != 0.0 else 0.0)
    s = time_since_contact(behind, V, slope, a, p.c, p.d, kept * h)
    replayed = max(0, min(math.floor(s / h) - 1, kept - 1))
    free_after(p, m, kept - replayed)
    back = replayed * h if drift != 0.0 else 0.0
    s_deviation = TIME_DEVIATION * s + 0.1 * h
    begin_shaft(p, m, s - replayed * h, s_deviation * s_deviation, u, drift - pull * back, pull)
    first = kept - replayed
    shaft_update(m.shaft, m.angles[first - 1], p.rounding, p.b_least, p.b_most)
    for i in range(first, kept):
        update_shaft_filter(p, m, m.angles[i], m.means[i], m.leads[i], m.contact_noises[i])


@inner
def opened(m: State, t: float) -> None:
    """The gap is open again: as at the start, with what is known of motor and load by now."""
    P = m.shaft.P
    m.load_speed = m.shaft.w2
    m.load_variance = P[3, 3]
    m.load_time = t
    m.b = m.shaft.b
    m.b_variance = max(P[4, 4], 0.01 * m.b * m.b)
    m.free.angle, m.free.speed = m.shaft.phi1, m.shaft.w1
    m.free.p00, m.free.p01, m.free.p11 = P[0, 0], P[0, 1], P[1, 1]
    m.free.p02, m.free.p12 = 0.0, 0.0
    m.kept = 0
    copy(m.free, m.now)


@inner
def begin_estimate(p: Parameters, m: State, angle: float, speed: float) -> None:
    """The first sample; a load that hangs in the wound-up shaft is in contact from then on."""
    m.begun = 1.0
    m.free.angle, m.free.speed, m.free.inverse = angle, speed, p.a
    m.free.p00, m.free.p22 = p.rounding, p.a_variance
    m.load_speed = p.load_speed
    m.b, m.b_variance = p.b, p.b_variance
    copy(m.free, m.now)
    if p.wound > 0.0:
        m.closed, m.held = 1.0, 1.0
        m.shaft.phi1, m.shaft.z, m.shaft.b = angle, p.wound, p.b
        m.shaft.P[4, 4] = p.b_variance


@compiled
def observe(p: Parameters, m: State, t: float, u: float, angle: float, speed: float, pulsing: float) -> int:
    """See a sample: motor torque u, motor angle and, at first, its speed; what it shows.

    `pulsing` is 1 while a motor torque acts on the free motor. A load that pushes the motor (PUSHED) is seen
    as a motor that is ahead of the free one. While `held` the brake holds the motor of a hanging load.
    """
    if m.begun == 0.0:
        begin_estimate(p, m, angle, speed)
        return NOTHING if m.closed == 0.0 else CONTACT
    if m.held != 0.0:
        if t >= p.released and u >= p.proving:  # some time in this sample the brake let the motor go
            m.held = 0.0
            m.shaft.phi1 = angle
            gained = p.a * p.period * (u - p.c * p.wound)
            m.shaft.P[0, 0], m.shaft.P[1, 1] = p.rounding, gained * gained
        return NOTHING
    queued = int(p.queued)
    newest = m.sent[queued]  # of those that act by now
    before, share = m.realised, p.rest / p.period
    m.mean = 0.0
    if share > 0.0:  # until then the one before it went on
        older = m.sent[queued + 1]
        before = older + (before - older) * (math.exp(-p.rest / p.torque_lag) if p.torque_lag > 0.0 else 0.0)
        m.mean = share * mean_torque(m.realised, before, older)
    m.mean += (1.0 - share) * mean_torque(before, u, newest)
    lead = torque_lead(before, u, newest, m.mean)
    extra_noise = 0.0
    if p.rate > 0.0:  # slewed, lagged or both: one sample does not tell, and the truth may lie outside
        line = mean_of_ramp(m.realised, u, p.rate * p.period)
        extra_noise = (2.0 * p.a * p.period * (m.mean - line)) ** 2
        if p.slew > 0.0:
            m.mean, lead = line, lead_of_ramp(m.realised, u, p.rate * p.period)
    if m.closed != 0.0:
        update_shaft_filter(p, m, angle, m.mean, lead, extra_noise)
        if m.shaft.z < 0.0 and m.shaft.w1 < m.shaft.w2:
            opened(m, t)
            m.closed = 0.0
            return OPENED
        return NOTHING
    free_motion(p, m, angle, m.mean, lead, extra_noise)
    behind = m.now.angle - angle
    enough = margin(p, m)
    if behind > enough:
        contact(p, m, t, behind, pulsing != 0.0)
        m.closed = 1.0
        return CONTACT
    return PUSHED if behind < -enough else NOTHING


@inner
def send(p: Parameters, m: State, demand: float, u: float) -> None:
    """Keep the demand of this sample, and the torque that was measured."""
    for i in range(int(p.queued) + 1, 0, -1):
        m.sent[i] = m.sent[i - 1]
    m.sent[0] = demand
    m.realised = u


@compiled
def predicted_state(p: Parameters, m: State, realised: float) -> tuple[float, float, float, float]:
    """w1, z, w2 and motor torque when a demand made now begins to act; until then those sent before do."""
    u, w1, z, w2 = realised, m.shaft.w1, m.shaft.z, m.shaft.w2
    length = p.rest
    for i in range(int(p.queued), -1, -1):
        if length > 0.0:
            demand = m.sent[i]
            if p.slew > 0.0:
                reach = p.rate * length
                after = min(max(demand, u - reach), u + reach)
                mean = mean_of_ramp(u, after, reach)
                u = after
            else:
                left = math.exp(-length / p.torque_lag) if p.torque_lag > 0.0 else 0.0
                mean = demand + (u - demand) * (1.0 - left) * p.torque_lag / length
                u = demand + (u - demand) * left
            _, w1, z, w2 = predicted_motion(w1, z, w2, m.shaft.b, mean, length, p.a, p.c, p.d, p.Mc, p.Mb)
        length = p.period
    return w1, z, w2, u


def threshold_parameter() -> Any:
    """`detection_threshold` as a field of a controller."""
    meaning = "detection threshold of the contact, in standard deviations of the motor angle"
    return parameter("1", meaning, 7.0, limit="above 0", between=(4.0, 12.0))


def uncertainty_parameter() -> Any:
    """`uncertainty` as a field of a controller."""
    return parameter(
        "1", "unknown part of the twist in each sample", 0.15, limit="0 or more", between=(0.01, 0.5)
    )


def estimator_parameters(
    drive: Drive,
    p: Any,
    speed: float,
    inertia_ratio: float | None = None,
    deviation: float = RATIO_DEVIATION,
) -> dict[str, float]:
    """The numbers of `Parameters` beside drive and controller, for flanks that meet at `speed` in rad/s.

    p has the parameters `period`, `detection_threshold` and `uncertainty`. J2/J1 is `inertia_ratio`, or
    that of the drive, with this standard deviation as a share. A drive whose load hangs in the wound-up shaft
    is in contact from the first sample on, unless the inertia ratio is given.
    """
    wound, proving, released = hanging(drive) if inertia_ratio is None else (0.0, 0.0, 0.0)
    period, detection_threshold = p.period, p.detection_threshold
    a, rate = 1.0 / drive.J1, drive.torque_rate
    queued = min(math.floor(drive.computing_delay / period + 1e-9), QUEUE - 2)
    rest = min(max(drive.computing_delay - queued * period, 0.0), period)
    ratio, noise = 1.0 / (inertia_ratio or drive.J2 / drive.J1), drive.torque_noise
    free = a * period * math.hypot(TORQUE_DEVIATION * drive.Ms, noise)
    delay, slewing = torque_delay(drive)
    rounding = encoder_count(drive.encoder_lines) ** 2 / 12.0 + (FLOOR * drive.Ms / drive.c) ** 2
    return {
        "Mb": drive.backward_torque,
        "load_speed": drive.initial_load_speed,
        "a": a,
        "a_variance": (J1_DEVIATION * a) ** 2,
        "b": ratio * a,
        "b_variance": (deviation * ratio * a) ** 2,
        "b_least": min(LEAST_RATIO, 0.3 * ratio) * a,
        "b_most": max(MOST_RATIO, 3.0 * ratio) * a,
        "samples": _samples(drive, speed, rounding, detection_threshold, delay, period),
        "rounding": rounding,
        "free_noise": free**2,
        "speed_noise": math.hypot(SHAFT_DEVIATION * drive.Ms, noise),
        "load_noise": LOAD_DEVIATION * drive.Ms,
        "b_noise": 0.0 if inertia_ratio else (WANDER * ratio * a) ** 2 * drive.Omega * period,
        "slew": 0.5 / rate if slewing else 0.0,
        "rate": rate if math.isfinite(rate) else 0.0,
        "queued": queued,
        "rest": rest,
        "wound": wound,
        "proving": proving,
        "released": released,
        "raising": drive.Ms * period * math.sqrt(drive.c * a) / (2.0 * math.pi * RISE_PERIODS),
    }


def hanging(drive: Drive) -> tuple[float, float, float]:
    """Twist in rad beyond the gap at which a load hangs at first, or 0, and its brake.

    That is the torque in N m that releases the motor by torque proving, or the instant in s at which it is
    released.

    >>> [round(x, 4) for x in hanging(Drive.load("hoist-15kw"))]
    [0.0375, 120.0, 0.0]
    """
    if drive.start_position != "hanging":
        return 0.0, 0.0, 0.0
    T = max(drive.active_torque, 0.0)
    if drive.brake != "none" and isinstance(drive.release, str):
        return T / drive.c, T, 0.0
    return T / drive.c, 0.0, drive.release_time


def contact_undetectable(drive: Drive, coarse: float, slow: float = math.inf) -> bool:
    """Whether a contact cannot be answered in time.

    The encoder's count is above the share `coarse` of Ms/c, or the torque (dead time, lag, half the slewing
    time to Ms) later than `slow` sqrt(J1/c).

    >>> [contact_undetectable(Drive.load("crane-4amtkf"), coarse, 1.3) for coarse in (0.04, 0.002)]
    [False, True]
    """
    late = 0.5 * drive.Ms / drive.torque_rate + drive.torque_lag + drive.computing_delay
    return (
        encoder_count(drive.encoder_lines) > coarse * drive.Ms / drive.c
        or late * math.sqrt(drive.c / drive.J1) > slow
    )


def torque_delay(drive: Drive) -> tuple[float, bool]:
    """Mean time in s by which the torque is late, and whether the rate limit makes the most of it."""
    slew, late = drive.Ms / drive.torque_rate, drive.torque_lag + drive.computing_delay
    slewing = 0.5 * slew > late
    return (late if slewing else late + 0.5 * slew), slewing


def _samples(
    drive: Drive, v: float, rounding: float, detection_threshold: float, delay: float, period: float
) -> int:
    """How many samples the filter of the free motor stays behind."""
    far = 2.0 * detection_threshold * math.sqrt(rounding)
    coasting = math.cbrt(6.0 * far * drive.J1 / (drive.c * v))
    pulsing = (24.0 * far * drive.J1**2 / (drive.c * drive.Ms)) ** 0.25 + delay
    return min(max(math.ceil(max(coasting, pulsing) / period) + 4, 6), RING)
