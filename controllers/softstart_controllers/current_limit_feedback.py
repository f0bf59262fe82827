"""[G]: current limit with a flexible feedback of the estimated shaft torque."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Effort, compiled_step, parameter, stack
from softstart.controller.compiled import MEASURED, Answer, Vector, keep_state, named, record, size
from softstart.drive import Drive
from softstart_controllers.landing import horizon, over_dead_time, pole, shaft_torque_under
from softstart_controllers.reduced import load_drift, reduced_torque
from softstart_controllers.sampled import (
    PATIENCE_DEFAULT,
    PERIOD_DEFAULT,
    check,
    mean_torque,
    patience,
    sample_period,
)
from softstart_controllers.shaft_observer import Observer, observer, predict
from softstart_controllers.shaping import swing

DAMPING_RATIO = 0.7
SLEWED_SHARE = 0.25  # of Ms
PHASE_LEFT = math.pi / 6  # phase margin that the delays must leave
UNCERTAINTY = 0.05
RIPPLE = 0.2  # standard deviation of kd T', of Ms, that a coarse encoder may cause
THRESHOLD = 0.1  # of M12avg_base
LOW_SHARE = 0.5  # of the shaft torque under the low limit: what the threshold may be at most
CERTAINTY = 5.0  # standard deviations of the estimate
REFINEMENTS = 4
OPEN_AGAIN = 0.3  # of the threshold

GAP_OPEN, CLOSED, OPEN_AGAIN_PHASE, IMPATIENT = 0.0, 1.0, 2.0, 3.0  # phases


class Parameters:
    """Limits, thresholds, the model of the closed drive and the gains k of the observer."""

    period: float
    J1: float
    low: float
    full: float
    feedback: float
    closed: float
    open: float
    rise: float
    approach: float
    horizon: float
    load_speed: float
    drift: float
    patience: float
    c: float
    motor_bend: float
    load_bend: float
    damping_bend: float
    Mc: float
    k_angle: float
    k_speed: float
    k_torque: float
    k_rate: float
    lag: float
    dead: float
    sigma: float
    omega: float


class State:
    """The estimate: motor angle and speed, shaft torque T and its rate; the limit that rises."""

    sample: float
    angle: float
    speed: float
    T: float
    rate: float
    demand: float
    realised: float
    phase: float
    progress: float
    load_speed: float


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Answer, State)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Estimate T and T', tell whether the gap is closed, set the torque."""
    p = named(parameters, PARAMETERS)
    m = named(measured, MEASURED)
    x = named(state, STATE)
    y = named(command, COMMAND)
    keep_state(state, command)
    t, u, h = m.time, m.motor_torque, p.period
    phase = x.phase
    if x.sample == 0.0:
        y.angle = m.motor_angle
        y.speed = m.motor_speed
        y.T = 0.0
        y.rate = 0.0
        y.load_speed = p.load_speed
    else:
        mean = mean_torque(x.realised, u, x.demand)
        bend = 0.0
        if phase == CLOSED:
            middle = x.T + 0.5 * h * x.rate
            bend = p.motor_bend * (mean - middle) - p.load_bend * (middle - p.Mc)
            bend -= p.damping_bend * x.rate
        angle, speed, T, rate = predict(x.angle, x.speed, x.T, x.rate, bend, mean, p.J1, h)
        error = m.motor_angle - angle
        y.angle = angle + p.k_angle * error
        y.speed = speed + p.k_speed * error
        y.T = T + p.k_torque * error
        y.rate = rate + p.k_rate * error

    if phase == CLOSED:
        if p.open > y.T:
            phase = OPEN_AGAIN_PHASE
            y.load_speed = y.speed - y.rate / p.c
    elif p.closed < y.T and phase != IMPATIENT:
        phase = CLOSED
    if t >= p.patience:
        phase = IMPATIENT

    limit = p.low + (p.full - p.low) * x.progress
    if phase == CLOSED:
        rate = y.rate
        if p.dead > 0.0:  # until then the last demand goes on acting
            mean, _ = over_dead_time(u, x.demand, p.lag, p.dead)
            rest = (p.motor_bend * mean + p.load_bend * p.Mc) / (p.motor_bend + p.load_bend)
            _, rate = swing(y.T, rate, rest, p.sigma, p.omega, p.dead)
        y.torque = min(max(limit - p.feedback * rate, 0.0), p.full)
        y.progress = min(1.0, x.progress + p.rise)
    elif phase == IMPATIENT:
        y.torque = limit
        y.progress = min(1.0, x.progress + p.rise)
    else:
        allowed = y.load_speed + p.approach
        if phase == GAP_OPEN:  # never less than half: a contact not seen must not let the load run back
            allowed -= min(p.drift * t, 0.5 * p.approach)
        y.torque = min(max(p.J1 * (allowed - y.speed) / p.horizon, 0.0), p.low)

    y.ask_again = (x.sample + 1.0) * h
    y.sample = x.sample + 1.0
    y.demand = y.torque
    y.realised = u
    y.phase = phase


@dataclass(frozen=True)
class CurrentLimitFeedback(CompiledController):
    """Torque limit with a derivative ("flexible") feedback of the estimated shaft torque.

    It measures the motor angle (encoder) and the motor torque. The gap is nowhere among its numbers.

    *Observer.* Every `period` the estimates of phi1, w1, T and T' go on by J1 w1' = u - T under the torque
    realised, with T'' = 0 while the gap is open and, while it is closed,

        T'' = (c/J1)(u - T) - (c/J2)(T - Mc) - (d Omega^2/c) T'

    and are corrected by the encoder with stationary Kalman gains (`shaft_observer`), designed for an
    unknown part `uncertainty` Omega^2 Ms of T'' and for the rounding of the encoder. The gap counts as closed
    from T > `threshold` on, and as open again from T < 0.3 `threshold`. The threshold is 0.1 M12avg_base, or
    half of what the shaft carries under the low limit where that is less. A coarse encoder makes the observer
    slower: the uncertainty is lowered until 5 standard deviations of T are below the threshold and one of kd
    T' is below 0.2 Ms.

    *Gap open.* The low limit accelerates the motor until it is `approach_speed` faster than the load, and
    keeps that speed: u = clip(J1 (w2 + approach_speed - w1)/(2 (period + lag + computing delay)), 0,
    low_torque). The speed of the load is known: at the start w2(0), under an active load less Mc t/J2 (down
    to half the approach speed, no further), and after a contact the estimate w1 - T'/c of the instant at
    which it ended. With
    approach_speed = Omega M12avg_base/c the impact alone swings the shaft to M12avg_base, [G](12), that is to
    K_dyn = 1, which the full torque needs anyway; from however wide a gap.

    *Gap closed.* The limit rises from `low_torque` to `full_torque` in the time `rise`, and

        u = clip(limit - kd T', 0, full_torque),     kd = 2 damping_ratio J1 Omega/c

    With [G](7): T'' + (kd c/J1) T' + Omega^2 T = c (limit/J1 + Mc/J2), so kd gives the shaft the damping
    ratio asked for on top of its own. The rise goes on only while the gap counts as closed.

    *Limits of the feedback.* The model bridges the computing delay: the feedback takes T' as it will be then,
    under the last demand. A delay tau in the loop (torque lag, the time in which a limited rate slews a
    quarter of Ms, half a period, and observer's lag and computing delay as far as the model may miss the
    load, J1/(J1 + J2)) turns damping into its opposite: the loop gain is one at Omega (zeta + sqrt(zeta^2 +
    1)), and a phase margin of 30 degrees is kept there by zeta <= (m^2 - 1)/(2 m), m = (pi/3)/(Omega tau).
    Where observer's lag and computing delay together exceed 1/Omega, the feedback cannot follow the shaft:
    from there to 2/Omega the damping ratio is taken back to zero. A drive whose torque or observer is too
    slow for its elastic frequency so gets no feedback, but
    the soft approach and the rise all the same; its gap, once closed, then counts as closed for good.

    If the load is not at its target speed within `patience`, the feedback is dropped and the limit raised,
    so that a wrong estimate does not delay the start indefinitely.

    Source: [G], conclusions ("regulators acting on the current-limit level or as a flexible feedback").

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(simulate(crane.replace(gap=gap), CurrentLimitFeedback()).k_dyn, 1) for gap in (0.5, 2)]
    [1.0, 1.1]
    """

    name: ClassVar[str] = "current-limit-feedback"
    summary: ClassVar[str] = (
        "low limit while the gap is open, then a limit with feedback of the estimated dT/dt"
    )
    source: ClassVar[str] = "[G]"
    effort: ClassVar[Effort | None] = Effort.ENCODER
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = size(STATE)

    low_torque: float | None = parameter(
        "N*m",
        "torque limit while the gap is open",
        "load torque plus 15 % of the accelerating torque",
        multiples=(0.3, 4.0),
    )
    approach_speed: float | None = parameter(
        "rad/s",
        "speed at which the gap is closed",
        "Omega M12avg_base/c: the impact alone makes K_dyn = 1",
        multiples=(0.3, 3.0),
    )
    full_torque: float | None = parameter(
        "N*m", "torque limit after the rise", "starting torque Ms", multiples=(0.4, 1.0)
    )
    rise: float | None = parameter(
        "s", "time in which the limit rises after contact", "one elastic period", multiples=(0.2, 5.0)
    )
    damping_ratio: float | None = parameter(
        "1",
        "damping ratio added by the feedback",
        "0.7 less that of the shaft, or what the delays allow, down to 0",
        between=(0.0, 1.5),
    )
    threshold: float | None = parameter(
        "N*m",
        "estimated shaft torque that means contact",
        "0.1 M12avg_base, at most half the shaft torque under the low limit, at least 5 standard deviations",
    )
    uncertainty: float | None = parameter(
        "1",
        "unknown part of the second derivative of T, as a share of Omega^2 Ms",
        "0.05, less for a coarse encoder",
        multiples=(0.3, 3.0),
    )
    patience: float | None = parameter("s", "latest instant for the feedback to act", PATIENCE_DEFAULT)
    period: float | None = parameter("s", "sample period", PERIOD_DEFAULT)

    def __post_init__(self) -> None:
        check(
            self,
            above_zero=("approach_speed", "full_torque", "threshold", "uncertainty", "period"),
            not_negative=("low_torque", "rise", "damping_ratio", "patience"),
        )

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """From the nominal drive; neither gap nor start position enter."""
        period = sample_period(drive) if self.period is None else self.period
        low = reduced_torque(drive) if self.low_torque is None else self.low_torque
        base = drive.mean_torque
        threshold = min(THRESHOLD * base, LOW_SHARE * shaft_torque_under(drive, low))
        uncertainty = self.uncertainty
        if uncertainty is None:
            uncertainty = _uncertainty(drive, period, threshold if self.threshold is None else self.threshold)
        eyes = observer(drive, period, uncertainty)
        return {
            "low_torque": low,
            "approach_speed": drive.Omega * base / drive.c,
            "full_torque": drive.Ms,
            "rise": drive.elastic_period,
            "damping_ratio": _damping_ratio(drive, eyes, period),
            "threshold": max(threshold, CERTAINTY * eyes.torque_deviation),
            "uncertainty": uncertainty,
            "patience": patience(drive),
            "period": period,
        }

    def vector(self, drive: Drive) -> Vector:
        """The numbers of `Parameters`."""
        p: Any = self  # fitted: every parameter is a number
        period, ratio, Omega = p.period, p.damping_ratio, drive.Omega
        return stack(
            period, drive.J1, p.low_torque, p.full_torque, 2.0 * ratio * drive.J1 * Omega / drive.c,
            p.threshold, OPEN_AGAIN * p.threshold if ratio > 0.0 else -math.inf, period / max(p.rise, period),
            p.approach_speed, horizon(drive, period), drive.initial_load_speed,
            load_drift(drive), p.patience, drive.c, drive.c / drive.J1, drive.c / drive.J2,
            drive.d * Omega**2 / drive.c, drive.Mc, *observer(drive, period, p.uncertainty).gains,
            drive.torque_lag, drive.computing_delay, *pole(drive, drive.c),
        )  # fmt: skip


def _damping_ratio(drive: Drive, eyes: Observer, period: float) -> float:
    """0.7 less that of the shaft, and at most what the delays of torque and observer allow."""
    unforeseen = drive.J1 / (drive.J1 + drive.J2)
    foreseen = eyes.rate_lag + drive.computing_delay
    slewing = SLEWED_SHARE * drive.Ms / drive.torque_rate
    delay = drive.torque_lag + slewing + 0.5 * period + unforeseen * foreseen
    m = (0.5 * math.pi - PHASE_LEFT) / (drive.Omega * delay)
    lacking = DAMPING_RATIO - 0.5 * drive.d * drive.Omega / drive.c
    following = min(max(2.0 - drive.Omega * foreseen, 0.0), 1.0)
    return following * min(max(lacking, 0.0), max(0.5 * (m - 1.0 / m), 0.0))


def _uncertainty(drive: Drive, period: float, threshold: float) -> float:
    """0.05, or less, so that the encoder's rounding neither feigns contacts nor shakes the motor torque.

    With a fast sampler the observer's bandwidth goes with S^(1/8), the deviation of T with S^(5/16) and that
    of T' with S^(7/16), where S is proportional to the square of the uncertainty.
    """
    kd = 2.0 * DAMPING_RATIO * drive.J1 * drive.Omega / drive.c
    uncertainty = UNCERTAINTY
    for _ in range(REFINEMENTS):
        eyes = observer(drive, period, uncertainty)
        feigned = (CERTAINTY * eyes.torque_deviation / threshold) ** (8 / 5)
        shaken = (kd * eyes.rate_deviation / (RIPPLE * drive.Ms)) ** (8 / 7)
        uncertainty /= max(feigned, shaken, 1.0)
    return uncertainty
