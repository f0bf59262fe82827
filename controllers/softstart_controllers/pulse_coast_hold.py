"""The optimal start as feedback: pulse, coast, hold, from motor angle and motor torque alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Effort, compiled_step, parameter
from softstart.controller.compiled import MEASURED, Reply, Vector, as_record, inner, keep_state, record, size
from softstart.drive import Drive
from softstart_controllers import contact
from softstart_controllers.contact import (
    CONTACT,
    NOTHING,
    OPENED,
    PUSHED,
    contact_undetectable,
    estimator_parameters,
    observe,
    send,
    torque_delay,
)
from softstart_controllers.sampled import period_parameter, timeout_parameter
from softstart_controllers.shaft_filter import predicted_motion

SHARE_REACTIVE, SHARE_ACTIVE = 0.8, 0.7  # of the speed that makes the stuck load's shaft carry Ms
COARSE = 0.04  # of Ms/c: with larger counts the contact is over before it is seen
SLOW = 1.3  # sqrt(J1/c): with a torque later than this the peak is over
RATIO_DEVIATION = 0.6  # of J1/J2, beforehand
MOST_OPENINGS = 8  # of the gap, after which the torque is just raised
SOFTEST = 0.1  # of the coast speed
TELLING = 0.2  # of Ms: with less torque at its end the pulse does not tell the delay
MOST_DELAY = 3.0  # times the delay told and a sample

# phases, in this order
PULSE, COAST, CATCH, HOLD, RAISE = 0.0, 1.0, 2.0, 3.0, 4.0


class Parameters:
    """What the step is given; `watch` is for the estimator (`contact`)."""

    watch: contact.Parameters
    Ms: float
    coast_speed: float
    hold_share: float
    delay: float
    damping_ratio: float
    stiffening: float
    contact_timeout: float
    blind: float


class State:
    """The pulse and the hold."""

    watch: contact.State
    sample: float
    phase: float
    held_back: float
    delay: float
    push: float
    level: float
    peak: float
    openings: float
    raised: float


PARAMETERS = record(Parameters, watch=contact.PARAMETERS)
STATE = record(State, watch=contact.STATE)
COMMAND = record(Reply, State, watch=contact.STATE)


@inner
def full_load(p: Parameters, ratio: float) -> float:
    """Mean shaft torque in N m under Ms, [G](16), for J1/J2 = ratio."""
    return (p.Ms + p.watch.Mc * ratio) / (1.0 + ratio)


@inner
def gentle_speed(p: Parameters, a: float, b: float) -> float:
    """Relative speed in rad/s: the coast speed, or less where the drive, coasting in contact with it, would
    swing to more than the share of the full load that may be held.

    It swings about z0 = Mc b/Omega^2 to z0 + sqrt(z0^2 + v^2/Omega^2).
    """
    square = p.watch.c * (a + b)
    z0 = p.watch.Mc * b / square
    most = p.hold_share * full_load(p, b / a) / p.watch.c
    v = square * most * (most - 2.0 * z0)
    return min(p.coast_speed, max(math.sqrt(max(v, 0.0)), SOFTEST * p.coast_speed))


@inner
def held_back(p: Parameters, m: State, u: float) -> float:
    """Impulse in N m s that is still to come when the demand goes to 0.

    Under a lag, or a dead time, it is what the motor has not got of the impulse demanded so far; a torque
    that slews falls as it rose.
    """
    return m.held_back if p.watch.slew == 0.0 else u * (p.delay + u * p.watch.slew)


@inner
def pulse(p: Parameters, m: State, b: float, u: float) -> float:
    """Torque in N m of the next sample: what the motor needs to its speed, less what is still to come."""
    a = m.watch.free.inverse
    wanted = m.watch.load_speed + (gentle_speed(p, a, b) if m.openings > 0.0 else p.coast_speed)
    missing = (wanted - m.watch.now.speed) / a - held_back(p, m, u)
    return min(max(missing / p.watch.period, 0.0), p.Ms)


@inner
def hold(p: Parameters, m: State, u: float, catching: bool) -> float:
    """Torque in N m of the next sample in contact, from the state that the shaft will have when it acts."""
    near, shaft, Ms = p.watch, m.watch.shaft, p.Ms
    h, c, d, Mc, Mb = near.period, near.c, near.d, near.Mc, near.Mb
    a, b = m.watch.free.inverse, shaft.b
    w1, z, w2 = shaft.w1, shaft.z, shaft.w2
    steps = int(m.delay / h) + 1
    for _ in range(steps):
        _, w1, z, w2 = predicted_motion(w1, z, w2, b, u, m.delay / steps, a, c, d, Mc, Mb)
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
        _, x1, _, x2 = predicted_motion(w1, z, w2, b, 0.0, h, a, c, d, Mc, Mb)
        return min(max((x2 - x1) / (a * h), 0.0), Ms)
    full = full_load(p, ratio)
    least = p.hold_share * full
    if m.level < least:
        rise = (least - m.peak) * h * math.sqrt(square) / (2.0 * math.pi)
        m.level = min(m.level + max(rise, 0.0), least)
    level = min(m.level, full)
    demand = level * (1.0 + ratio) - Mc * ratio + p.stiffening * (level - c * z)
    demand -= 2.0 * p.damping_ratio * math.sqrt(square) / a * rate
    return min(max(demand, 0.0), Ms)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Pulse, coast, hold: see `PulseCoastHold`."""
    p = as_record(parameters, PARAMETERS)
    m = as_record(command, COMMAND)
    seen = as_record(measured, MEASURED)
    keep_state(state, command)
    watch, shaft = m.watch, m.watch.shaft
    t, u = seen.time, seen.motor_torque
    phase = m.phase
    event = NOTHING
    if phase != RAISE:
        pulsing = 1.0 if phase == PULSE else 0.0
        event = observe(p.watch, watch, t, u, seen.motor_angle, seen.motor_speed, pulsing)
    if m.sample == 0.0:
        phase = RAISE if p.blind != 0.0 else PULSE
        m.delay = p.delay
        m.held_back = -p.delay * u
    elif phase != RAISE:
        if phase < CATCH:
            m.held_back += p.watch.period * (watch.sent[0] - watch.mean)
        if event == CONTACT:
            m.push = 1.0 if phase == PULSE else 0.0
            m.level = 0.0
            phase = CATCH
        elif event == PUSHED:  # the load pushes the motor: there is no contact to wait for
            phase = RAISE
        elif event == OPENED:
            m.openings += 1.0
            m.held_back = -m.delay * u
            phase = PULSE if m.openings <= MOST_OPENINGS else RAISE
    if t >= p.contact_timeout and phase != RAISE:
        phase = RAISE
        m.raised = watch.sent[0]

    demand = 0.0
    if phase == PULSE:
        demand = pulse(p, m, watch.b, u)
        if demand < p.Ms:
            phase = COAST
            if u > TELLING * p.Ms:  # the mean time by which the torque is late, as it was in the pulse
                m.delay = min(max(held_back(p, m, u) / u, 0.0), MOST_DELAY * (p.delay + p.watch.period))
    elif CATCH <= phase < RAISE:
        demand = hold(p, m, u, phase == CATCH)
        if phase == CATCH:
            m.level = max(m.level, p.watch.c * shaft.z)
            if shaft.w1 < shaft.w2:
                phase = HOLD
                m.peak = m.level
    elif phase == RAISE:
        demand = m.raised = min(m.raised + p.watch.raising, p.Ms)

    m.torque = demand
    m.ask_again = (m.sample + 1.0) * p.watch.period
    m.sample += 1.0
    send(p.watch, watch, demand, u)
    m.phase = phase


def coast_speed(drive: Drive, p: Any) -> float:
    """The share of the speed at which the impact on a stuck load makes the shaft carry Ms."""
    share = SHARE_REACTIVE if drive.rests else SHARE_ACTIVE
    return share * drive.Ms / math.sqrt(drive.c * drive.J1)


@dataclass(frozen=True)
class PulseCoastHold(CompiledController):
    """The gentlest start, pulse, coast, hold (`softstart.optimal.pulse_coast_hold`), as feedback.

    It measures the motor angle (encoder) and the motor torque, every `period`. It knows the motor, the
    stiffness and damping of the shaft and the load torque; the gap, J2 and, after the first instant, the
    speed of the load it does not. (J2 only enters the defaults of `period` and `contact_timeout`.)

    *Pulse.* Ms until the motor is `coast_speed` faster than the load, no more than that with the impulse
    which the lag still holds back: int (demand - u) dt, as measured. Its ratio to u is the mean time D by
    which the torque is late; it replaces the one told. The pulse also tells J1 (a filter of phi1, w1 and
    1/J1). Coasting into the load at the relative speed v swings the shaft to c v/Omega (without Mc), so to
    K_dyn = (v sqrt(c J1)/Ms) sqrt(x (x + 1))/(x + Mc/Ms) with x = J2/J1. That hardly depends on x, and not
    at all on the gap unless the load moves. By default it is a little below 1, from J2 = 2 J1 on.

    *Coast.* No torque, until the encoder is behind the free motor by `detection_threshold` deviations of the
    prediction and of the rounding (and 2 of 1/J1, on which the decay of the torque turns: it so is no
    contact). The prediction comes from a filter that stays some samples behind, which has not yet seen the
    contact. The way lost grows with the cube of the time since contact, a c v s^3/6 with a = 1/J1: that tells
    s (`contact`).

    *Contact.* From there an extended Kalman filter on (phi1, w1, z, w2, 1/J2), z the twist beyond the gap,
    first sees the samples since contact, then each new one (`shaft_filter`). 1/J2 begins at
    1/(`inertia_ratio` J1) with a standard deviation of 60 %. `uncertainty` is the share of the twist in a
    sample that the model may miss: it stands for a stiffness that is not the one told. The state is carried
    on by D, and by a sample more without torque: as long as z' is above 0 then, there is none; then there is
    as much as ends at z' = 0. If the gap closes during the pulse, it goes on until the drive, coasting, will
    swing as far as it would have from the coast speed.

    *Hold.* From the peak T = P on

        u = P (J1 + J2)/J2 - Mc J1/J2 + `stiffening` (P - T) - kd T',   kd = 2 damping_ratio J1 Omega/c

    within 0 and Ms, while P rises to `hold_share` of M12avg of the estimated J2 in one elastic period: the
    start then is no longer than it needs to be, and K_dyn the same at every gap. If the gap opens all the
    same, it begins again, with the speed of the load and J2 as estimated and a coast speed that they allow.

    *Where it cannot work* it raises the torque to Ms in four elastic periods of the motor against a held
    load: an encoder count above 4 % of Ms/c (the contact would be over before it is seen), a torque later
    than 1.3 sqrt(J1/c) (lag, dead time and half of what the rate limit takes to Ms), a load that pushes the
    motor, a gap open for the ninth time; and, from the torque of then on, after `contact_timeout`.

    Where u >= 0 cannot hold a load back (an active one in a wide gap), K_dyn rises with the gap; so does that
    of the optimum.

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf").replace(torque_lag=0.002, load_kind="reactive")
    >>> worn = crane.replace(gap=2, load_inertia="0.07 kg*m^2")
    >>> [round(simulate(drive, PulseCoastHold(), fitted_to=crane).k_dyn, 2) for drive in (crane, worn)]
    [0.98, 1.0]
    """

    name: ClassVar[str] = "pulse-coast-hold"
    summary: ClassVar[str] = "pulse to a motor speed, coast until the shaft torque peaks, hold the peak"
    source: ClassVar[str] = "softstart: the optimum of docs/optimal-starts.md as feedback"
    effort: ClassVar[Effort | None] = Effort.ENCODER
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = size(STATE)
    record: ClassVar[Any] = PARAMETERS

    # fmt: off
    coast_speed: float | None = parameter("rad/s", "motor speed relative to the load at the end of the pulse",
        coast_speed, "0.8 Ms/sqrt(c J1) with a load that friction holds at rest, else 0.7 Ms/sqrt(c J1)",
        "above 0", multiples=(0.4, 1.6))
    hold_share: float | None = parameter("1",
        "share of M12avg to which the shaft torque is raised after the peak", 0.98, limit="0 or more",
        between=(0.6, 1.0))
    damping_ratio: float | None = parameter("1", "damping ratio of the hold", 0.9, limit="0 or more",
        between=(0.2, 1.5))
    stiffening: float | None = parameter("1", "motor torque per missing shaft torque in the hold", 0.5,
        limit="0 or more", between=(0.0, 2.0))
    inertia_ratio: float | None = parameter("1", "initial guess of J2/J1 at contact", 3.0, limit="above 0",
        multiples=(0.3, 4.0))
    detection_threshold: float | None = contact.threshold_parameter()
    uncertainty: float | None = contact.uncertainty_parameter()
    contact_timeout: float | None = timeout_parameter()
    period: float | None = period_parameter()
    # fmt: on

    def numbers(self, drive: Drive) -> dict[str, Any]:
        """Estimator, delay of the torque, rise, and whether the contact can be seen in time at all."""
        p: Any = self  # fitted: every parameter is a number
        return {
            "watch": estimator_parameters(drive, p, p.coast_speed, p.inertia_ratio, RATIO_DEVIATION),
            "Ms": drive.Ms,
            "delay": torque_delay(drive)[0],
            "blind": contact_undetectable(drive, COARSE, SLOW),
        }
