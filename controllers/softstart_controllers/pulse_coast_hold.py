"""The optimal start as feedback: pulse, coast, hold, from motor angle and motor torque alone."""

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
from softstart.controller.compiled import (
    MEASURED,
    Double,
    Reply,
    Vector,
    as_record,
    inner,
    keep_state,
    record,
)
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
    """What the step is given; `estimator` is for the estimator (`contact`)."""

    estimator: contact.Parameters
    Ms: float
    coast_speed: float
    hold_share: float
    delay: float
    damping_ratio: float
    stiffening: float
    contact_timeout: Double
    undetectable: float


class State:
    """The pulse and the hold."""

    estimator: contact.State
    sample: int
    phase: float
    held_back: float
    delay: float
    push: float
    level: float
    peak: float
    openings: int
    raised: float


PARAMETERS = record(Parameters, estimator=contact.PARAMETERS)
STATE = record(State, estimator=contact.STATE)
COMMAND = record(Reply, State, estimator=contact.STATE)


@inner
def full_load(p: Parameters, ratio: float) -> float:
    """Mean shaft torque in N m under Ms, [G](16), for J1/J2 = ratio."""
    return (p.Ms + p.estimator.Mc * ratio) / (1.0 + ratio)


@inner
def gentle_speed(p: Parameters, a: float, b: float) -> float:
    """Relative speed in rad/s: the coast speed, or less where the drive, coasting in contact with it, would
    swing to more than the share of the full load that may be held.

    It swings about z0 = Mc b/Omega^2 to z0 + sqrt(z0^2 + v^2/Omega^2).
    """
    square = p.estimator.c * (a + b)
    z0 = p.estimator.Mc * b / square
    most = p.hold_share * full_load(p, b / a) / p.estimator.c
    v = square * most * (most - 2.0 * z0)
    return min(p.coast_speed, max(math.sqrt(max(v, 0.0)), SOFTEST * p.coast_speed))


@inner
def held_back(p: Parameters, m: State, u: float) -> float:
    """Impulse in N m s that is still to come when the demand goes to 0.

    Under a lag, or a dead time, it is what the motor has not got of the impulse demanded so far; a torque
    that slews falls as it rose.
    """
    return m.held_back if p.estimator.slew == 0.0 else u * (p.delay + u * p.estimator.slew)


@inner
def pulse(p: Parameters, m: State, b: float, u: float) -> float:
    """Torque in N m of the next sample: what the motor needs to its speed, less what is still to come."""
    a = m.estimator.free.inverse
    wanted = m.estimator.load_speed + (gentle_speed(p, a, b) if m.openings > 0 else p.coast_speed)
    missing = (wanted - m.estimator.now.speed) / a - held_back(p, m, u)
    return min(max(missing / p.estimator.period, 0.0), p.Ms)


@inner
def hold(p: Parameters, m: State, u: float, catching: bool) -> float:
    """Torque in N m of the next sample in contact, from the state that the shaft will have when it acts."""
    near, shaft, Ms = p.estimator, m.estimator.shaft, p.Ms
    h, c, d, Mc, Mb = near.period, near.c, near.d, near.Mc, near.Mb
    a, b = m.estimator.free.inverse, shaft.b
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


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Pulse, coast, hold: see `PulseCoastHold`."""
    p = as_record(parameters, PARAMETERS)
    m = as_record(command, COMMAND)
    seen = as_record(measured, MEASURED)
    keep_state(state, command)
    estimator, shaft = m.estimator, m.estimator.shaft
    t, u = seen.time, seen.motor_torque
    phase = m.phase
    event = NOTHING
    if phase != RAISE:
        pulsing = 1.0 if phase == PULSE else 0.0
        event = observe(p.estimator, estimator, t, u, seen.motor_angle, seen.motor_speed, pulsing)
    if m.sample == 0:
        phase = RAISE if p.undetectable != 0.0 else PULSE
        m.delay = p.delay
        m.held_back = -p.delay * u
    elif phase != RAISE:
        if phase < CATCH:
            m.held_back += p.estimator.period * (estimator.sent[0] - estimator.mean)
        if event == CONTACT:
            m.push = 1.0 if phase == PULSE else 0.0
            m.level = 0.0
            phase = CATCH
        elif event == PUSHED:  # the load pushes the motor: there is no contact to wait for
            phase = RAISE
        elif event == OPENED:
            m.openings += 1
            m.held_back = -m.delay * u
            phase = PULSE if m.openings <= MOST_OPENINGS else RAISE
    if t >= p.contact_timeout and phase != RAISE:
        phase = RAISE
        m.raised = estimator.sent[0]

    demand = 0.0
    if phase == PULSE:
        demand = pulse(p, m, estimator.b, u)
        if demand < p.Ms:
            phase = COAST
            if u > TELLING * p.Ms:  # the mean time by which the torque is late, as it was in the pulse
                m.delay = min(max(held_back(p, m, u) / u, 0.0), MOST_DELAY * (p.delay + p.estimator.period))
    elif CATCH <= phase < RAISE:
        demand = hold(p, m, u, phase == CATCH)
        if phase == CATCH:
            m.level = max(m.level, p.estimator.c * shaft.z)
            if shaft.w1 < shaft.w2:
                phase = HOLD
                m.peak = m.level
    elif phase == RAISE:
        demand = m.raised = min(m.raised + p.estimator.raising, p.Ms)

    m.torque = demand
    m.ask_again = (m.sample + 1) * p.estimator.period
    m.sample += 1
    send(p.estimator, estimator, demand, u)
    m.phase = phase


def coast_speed(drive: Drive, p: ParameterValues) -> float:
    """The share of the speed at which the impact on a stuck load makes the shaft carry Ms."""
    share = SHARE_REACTIVE if drive.rests else SHARE_ACTIVE
    return share * drive.Ms / math.sqrt(drive.c * drive.J1)


@dataclass(frozen=True)
class PulseCoastHold(CompiledController):
    """The gentlest start, pulse, coast, hold (`softstart.optimal.pulse_coast_hold`), as feedback.

    It measures the motor angle (encoder) and the motor torque, every `period`, and knows the motor, stiffness
    and damping of the shaft and the load torque; gap, J2 and later speeds of the load it does not. (J2 only
    enters the defaults of `period` and `contact_timeout`.)

    *Pulse.* Ms until the motor is `coast_speed` faster than the load, less the impulse still to come.
    *Coast.* No torque until contact is detected (`contact`).
    *Catch.* No torque while z', extrapolated by the delay of the torque, is above 0; then as much as leads to
    z' = 0, the peak T = P.
    *Hold.* From there on, within 0 and Ms, while P rises to `hold_share` of M12avg in one elastic period,

        u = P (J1 + J2)/J2 - Mc J1/J2 + `stiffening` (P - T) - kd T',   kd = 2 damping_ratio J1 Omega/c

    If the gap opens again, the sequence is repeated with the estimated J2 and speed of the load. Where
    measurement or torque is too slow, or the load drives the motor, the torque is raised to Ms in a ramp.

    Source: the optimal start, as feedback.

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf").replace(torque_lag=0.002, load_kind="reactive")
    >>> worn = crane.replace(gap=2, load_inertia="0.07 kg*m^2")
    >>> [round(simulate(drive, PulseCoastHold(), fitted_to=crane).k_dyn, 2) for drive in (crane, worn)]
    [0.98, 1.0]
    """

    name = "pulse-coast-hold"
    summary = "pulse to a motor speed, coast until the shaft torque peaks, hold the peak"
    source = "softstart: the optimum of docs/optimal-starts.md as feedback"
    effort = Effort.ENCODER
    time_parameter = "hold_share"
    kernel = step

    # fmt: off
    coast_speed: float = parameter("rad/s", "motor speed relative to the load at the end of the pulse",
        coast_speed, "0.8 Ms/sqrt(c J1) with a load that friction holds at rest, else 0.7 Ms/sqrt(c J1)",
        "above 0", multiples=(0.4, 1.6))
    hold_share: float = parameter("1",
        "share of M12avg to which the shaft torque is raised after the peak", 0.98, limit="0 or more",
        between=(0.6, 1.0))
    damping_ratio: float = parameter("1", "damping ratio of the hold", 0.9, limit="0 or more",
        between=(0.2, 1.5))
    stiffening: float = parameter("1", "motor torque per missing shaft torque in the hold", 0.5,
        limit="0 or more", between=(0.0, 2.0))
    inertia_ratio: float = parameter("1", "initial guess of J2/J1 at contact", 3.0, limit="above 0",
        multiples=(0.3, 4.0))
    detection_threshold: float = contact.threshold_parameter()
    uncertainty: float = contact.uncertainty_parameter()
    contact_timeout: float = timeout_parameter()
    period: float = period_parameter()
    # fmt: on

    def numbers(self, drive: Drive) -> Numbers:
        """Estimator, delay of the torque, rise, and whether the contact can be seen in time at all."""
        estimated = self, self.coast_speed, self.inertia_ratio, RATIO_DEVIATION
        return {
            "estimator": estimator_parameters(drive, *estimated),
            "delay": torque_delay(drive)[0],
            "undetectable": contact_undetectable(drive, COARSE, SLOW),
        }
