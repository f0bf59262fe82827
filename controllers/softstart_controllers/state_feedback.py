"""Linear-quadratic feedback of the estimated state, switched on at contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Effort, compiled_step, parameter, stack
from softstart.controller.compiled import (
    MEASURED,
    Answer,
    Vector,
    compiled,
    inner,
    keep_state,
    named,
    record,
    size,
)
from softstart.drive import Drive
from softstart_controllers import landing
from softstart_controllers.contact_designs import feedback_gains, observer_gains
from softstart_controllers.landing import (
    approach,
    contact_seen,
    load_speed,
    move,
    open_again,
    over_dead_time,
    sticks,
    watch,
)  # fmt: skip
from softstart_controllers.sampled import (
    PATIENCE_DEFAULT,
    PERIOD_DEFAULT,
    check,
    encoder_count,
    mean_torque,
    pulling_load,
)
from softstart_controllers.shaping import swing

IMPACT = 0.7  # c dw12/Omega, of the shaft torque under the full torque
RISE = 0.75  # of the elastic period
TORQUE_WEIGHT = 3.0
RATE_WEIGHT = 4.0
UNCERTAINTY = 0.03
FASTEST = 6.0  # bandwidth of the filter in elastic frequencies, however fine the encoder
SLOWEST = 0.05  # likewise, however coarse the encoder
SLEWED_SHARE = 0.25  # of Ms
OPENS = 0.5  # of the threshold: a shaft that pulls so much has let go
GAP_OPEN, CLOSED, IMPATIENT = 0.0, 1.0, 2.0  # phases


class Parameters:
    """The landing, the weights f of the feedback, the gains of the filter, and how a load hangs at first."""

    landing: landing.Parameters
    full: float
    rise: float
    lag: float
    dead: float
    load_share: float
    f_twist: float
    f_rate: float
    f_torque: float
    k_angle: float
    k_speed: float
    k_twist: float
    k_rate: float
    k_load: float
    opens: float
    wound: float
    proving: float
    released: float


class State:
    """The estimate: motor angle and speed, twist z and its rate v, load torque."""

    landing: landing.State
    phase: float
    angle: float
    speed: float
    z: float
    v: float
    stuck: float
    load: float
    progress: float


PARAMETERS = record(Parameters, landing=landing.PARAMETERS)
STATE = record(State, landing=landing.STATE)
COMMAND = record(Answer, State, landing=landing.STATE)


@inner
def twist_under(p: Parameters, u: float, load: float) -> float:
    """Twist about which the closed drive swings, in rad, under the motor torque u and this load torque."""
    sigma, omega = p.landing.sigma, p.landing.omega
    return (u / p.landing.J1 + load * p.load_share) / (sigma * sigma + omega * omega)


@compiled
def predict(p: Parameters, u: float, x: State, y: State) -> None:
    """The closed drive one sample on, from x to y."""
    near = p.landing
    h = near.period
    a = u / near.J1 + x.load * p.load_share
    if x.stuck != 0.0:
        y.z, y.v, y.stuck, _, gained = move(near, x.z, x.v, 1.0, u, h)
        lost = h * (x.speed + 0.5 * h * u / near.J1) - (y.z - x.z)
    else:
        y.z, y.v = swing(x.z, x.v, twist_under(p, u, x.load), near.sigma, near.omega, h)
        y.stuck = 0.0
        lost = near.share * (h * (0.5 * h * a + x.v) - (y.z - x.z))
        gained = h * u / near.J1 - near.share * (h * a - (y.v - x.v))
    y.angle = x.angle + h * (x.speed + 0.5 * h * u / near.J1) - lost
    y.speed = x.speed + gained


@compiled
def feedback(p: Parameters, u: float, before: float, y: State) -> float:
    """The torque that the feedback asks for, within 0 and the full torque; raises the reference."""
    near = p.landing
    z, v = y.z, y.v
    if p.dead > 0.0:  # until then the last demand goes on acting
        mean, u = over_dead_time(u, before, p.lag, p.dead)
        z, v = swing(z, v, twist_under(p, mean, y.load), near.sigma, near.omega, p.dead)
    progress = y.progress
    low, full = twist_under(p, near.low, near.Mc), twist_under(p, p.full, near.Mc)
    reference = low + (full - low) * progress
    rate = (full - low) / p.rise if progress < 1.0 else 0.0
    y.progress = min(1.0, progress + near.period / p.rise)
    square = near.sigma * near.sigma + near.omega * near.omega
    Omega = math.sqrt(square)
    mean = reference - 2.0 * near.sigma * rate / square - p.f_twist * (z - reference)
    mean -= p.f_rate * (v - rate) / Omega
    mean -= p.f_torque * (twist_under(p, u, y.load) - reference)
    demand = near.J1 * (mean * square - y.load * p.load_share)
    return min(max(demand, 0.0), p.full)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Close the gap; from contact on estimate the state and feed it back."""
    p = named(parameters, PARAMETERS)
    m = named(measured, MEASURED)
    x = named(state, STATE)
    y = named(command, COMMAND)
    keep_state(state, command)
    near, before, now = p.landing, x.landing, y.landing
    t, u = m.time, m.motor_torque
    phase = x.phase
    if before.sample == 0.0:
        y.load = near.Mc
    demand = p.full
    now.sample = before.sample + 1.0
    now.torque = u

    if before.sample == 0.0 and p.wound > 0.0:  # the load hangs: there is no contact to be seen
        phase = CLOSED
        y.z = p.wound
        y.angle = m.motor_angle
        y.speed = m.motor_speed
        y.stuck = 0.0
    elif phase == GAP_OPEN:
        speed, beyond = watch(near, m, before, now)
        demand = approach(near, before, t, speed)
        if beyond > 0.0:
            phase = CLOSED
            stuck = sticks(near, before)
            s, v = contact_seen(near, before, t, u, beyond, now.free_speed, now.older_slope)
            late = s * near.omega >= math.pi
            z, rate, still, _, gained = move(near, 0.0, v, stuck, u, s)
            if late or z <= 0.0:  # seen so late that the phase of the swing is not known
                z, rate, still = 0.0, 0.0, stuck
            else:
                speed = v + load_speed(near, before, t - s) + gained
            y.z = z
            y.v = rate
            y.stuck = still
            y.speed = speed
            y.angle = m.motor_angle
    elif phase == CLOSED and x.progress == 0.0 and (t < p.released or u < p.proving):
        y.angle = m.motor_angle  # the brake holds the motor still
    elif phase == CLOSED:
        predict(p, mean_torque(before.torque, u, before.demand), x, y)
        error = m.motor_angle - y.angle
        y.angle += p.k_angle * error
        y.speed += p.k_speed * error
        if y.stuck != 0.0:  # the twist is the motor's own way
            y.z += p.k_angle * error
            y.v += p.k_speed * error
        else:
            y.z += p.k_twist * error
            y.v += p.k_rate * error
            y.load += p.k_load * error
        if near.c * y.z < p.opens:
            phase = GAP_OPEN
            open_again(t, y.speed, y.speed - y.v, before, now)
            demand = near.low

    if phase == CLOSED:
        demand = feedback(p, u, before.demand, y)
        if t < p.released or u < p.proving:
            y.progress = x.progress  # the reference waits for the brake
    if t >= near.patience:
        phase = IMPATIENT
        demand = p.full

    y.torque = demand
    y.ask_again = math.inf if phase == IMPATIENT else (before.sample + 1.0) * near.period
    y.phase = phase
    now.demand = demand


def hanging(drive: Drive) -> tuple[float, float, float]:
    """Twist in rad beyond the gap at which a load hangs at first, or 0, and its brake.

    That is the torque in N m that releases the motor by torque proving, or the instant in s at which it is
    released.

    >>> [round(x, 4) for x in hanging(Drive.load("hoist-15kw"))]
    [0.0375, 120.0, 0.0]
    """
    if drive.start_position != "hanging":
        return 0.0, 0.0, 0.0
    T = pulling_load(drive)
    if drive.brake != "none" and isinstance(drive.release, str):
        return T / drive.c, T, 0.0
    return T / drive.c, 0.0, drive.release_time


@dataclass(frozen=True)
class StateFeedback(CompiledController):
    """Soft landing, then a linear-quadratic regulator of the shaft torque on a Kalman filter.

    It measures the motor angle (encoder) and the motor torque. The gap is nowhere among its numbers.

    *Landing.* As `shaped`: the gap is closed `approach_speed` faster than the load, with at most
    `low_torque`; the contact is seen in the encoder angle (`landing`), which also gives twist and twist rate.

    *Estimate.* From contact on the closed drive is followed under the torque realised and corrected by the
    encoder: phi1, w1, the twist z, its rate, and the load torque, a constant that wanders. The gains are
    those of the stationary Kalman filter for an unknown part `uncertainty` Omega^2
    M12avg_base of T'' (white, of that size over 1/Omega) and for the rounding of the encoder. The estimate of
    the load takes up what is wrong in the model, so the shaft torque settles at its reference: integral
    action. While a reactive load is at rest the twist is the motor's own way.

    *Feedback.* The reference T_ref rises from the mean shaft torque under the low torque to that under
    `full_torque` in the time `rise`. With M = (u J2 + Mc J1)/(J1 + J2), the mean torque under the motor
    torque u, and M_y that under the torque the lagging motor has reached by now,

        M = T_ref + 2 zeta T_ref'/Omega - f1 (T - T_ref) - f2 (T' - T_ref')/Omega - f3 (M_y - T_ref)

    u is limited to 0 and full_torque. f1 to f3 minimise the sum over the samples of

        torque_weight (T - T_ref)^2 + rate_weight ((T' - T_ref')/Omega)^2 + (M - T_ref)^2

    for the drive with its lag, sampled. Here T is c z. A limited torque rate counts as more lag, by the time
    in which it slews a quarter of Ms; a dead time is bridged by the model.

    *Hanging.* Where the drive that it is set up for starts with its load hanging in the wound-up shaft, there
    is no contact to be seen: the feedback acts from the first sample on, from that twist, and waits with the
    reference until the brake has let the motor go. Else the start position is nowhere among its numbers.

    *Limits.* Designs are made for groups without units on a grid (`contact_designs`), so
    neighbouring weights may give the same start. Where the estimate pulls by half the threshold, the gap
    counts as open again and is closed again. At `patience` the feedback is dropped for the full torque.

    Source: linear-quadratic-Gaussian control as in the manual of python-control; landing as `shaped`.

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(simulate(crane.replace(gap=gap), StateFeedback()).k_dyn, 1) for gap in (0.5, 2)]
    [1.0, 1.0]
    """

    name: ClassVar[str] = "state-feedback"
    summary: ClassVar[str] = "soft landing, then LQR of the shaft torque on a Kalman filter"
    source: ClassVar[str] = "LQG, python-control"
    effort: ClassVar[Effort | None] = Effort.ENCODER
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = size(STATE)

    low_torque: float | None = parameter(*landing.LOW_TORQUE, multiples=(0.3, 2.0))
    approach_speed: float | None = parameter(
        "rad/s",
        "speed at which the gap is closed",
        "c dw12/Omega = 0.7 of the mean shaft torque under the full torque",
        multiples=(0.3, 3.0),
    )
    full_torque: float | None = parameter(
        "N*m", "torque limit after the rise", "starting torque Ms", multiples=(0.4, 1.0)
    )
    rise: float | None = parameter(
        "s",
        "time in which the reference rises after contact",
        "three quarters of the elastic period",
        multiples=(0.2, 5.0),
    )
    torque_weight: float | None = parameter(
        "1",
        "weight of the error of T, that of the mean torque under the motor being 1",
        "3",
        multiples=(0.03, 30.0),
    )
    rate_weight: float | None = parameter(
        "1",
        "weight of T'/Omega, that of the mean torque under the motor being 1",
        "4",
        multiples=(0.03, 30.0),
    )
    threshold: float | None = parameter(*landing.THRESHOLD_TORQUE)
    uncertainty: float | None = parameter(
        "1",
        "unknown part of T'' that the filter reckons with, as a share of Omega^2 M12avg_base",
        "0.03",
        multiples=(0.1, 10.0),
    )
    patience: float | None = parameter("s", "latest instant for the feedback to act", PATIENCE_DEFAULT)
    period: float | None = parameter("s", "sample period", PERIOD_DEFAULT)

    def __post_init__(self) -> None:
        check(
            self,
            above_zero=(
                "low_torque",
                "approach_speed",
                "full_torque",
                "torque_weight",
                "rate_weight",
                "threshold",
                "uncertainty",
                "period",
            ),
            not_negative=("rise", "patience"),
        )

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """From the nominal drive; neither gap nor start position enter."""
        return {
            "rise": RISE * drive.elastic_period,
            "torque_weight": TORQUE_WEIGHT,
            "rate_weight": RATE_WEIGHT,
            "uncertainty": UNCERTAINTY,
            **landing.landing_defaults(self, drive, IMPACT),
        }

    def vector(self, drive: Drive) -> Vector:
        """The numbers of `Parameters`."""
        p: Any = self  # fitted: every parameter is a number
        Omega, share = drive.Omega, drive.J2 / (drive.J1 + drive.J2)
        step = Omega * p.period
        ratio = min(0.5 * drive.d * Omega / drive.c, landing.LARGEST_DAMPING)
        lag = drive.torque_lag + SLEWED_SHARE * drive.Ms / drive.torque_rate
        noise = encoder_count(drive) ** 2 / 12.0 / (drive.mean_torque / drive.c) ** 2 / p.uncertainty**2
        noise = min(max(noise, share**2 / step / FASTEST**8), share**2 / step / SLOWEST**8)
        angle, speed, twist, rate, load = observer_gains(step, ratio, share, noise)
        return stack(
            *landing.landing_numbers(self, drive, drive.c), p.full_torque, max(p.rise, p.period),
            drive.torque_lag, drive.computing_delay, 1.0 / drive.J2,
            *feedback_gains(step, ratio, Omega * lag, p.torque_weight, p.rate_weight),
            angle, speed * Omega, twist, rate * Omega, load * drive.c * (drive.J1 + drive.J2) / drive.J1,
            -OPENS * p.threshold, *hanging(drive),
        )  # fmt: skip
