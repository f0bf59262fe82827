"""Soft landing, then torque steps that leave no swing behind: zero-vibration shaping from contact on."""

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
from softstart_controllers.landing import (
    approach,
    contact_seen,
    load_speed,
    mean_twist,
    motor_torque,
    move,
    open_again,
    over_dead_time,
    sticks,
    watch,
)  # fmt: skip
from softstart_controllers.sampled import PATIENCE_DEFAULT, PERIOD_DEFAULT, check, mean_torque
from softstart_controllers.shaping import ZV, ZVD, later, plan, sensitivity, swing, vector

SHAPERS = {"zv": ZV, "zvd": ZVD}
IMPACT = {"zv": 0.7, "zvd": 0.3}  # c dw12/Omega, of the shaft torque under the full torque
BRAKING = 4.0  # of T'/Omega, that the mean torque stays below T while no steps are found
GAP_OPEN, SWINGING, STEPPING, DONE = 0.0, 1.0, 2.0, 3.0  # phases


class Parameters:
    """The landing and the steps."""

    landing: landing.Parameters
    order: float
    full: float
    lag: float
    dead: float


class State:
    """Twist z and its rate v by the model, the sensitivity D of `shaping`, the planned steps."""

    landing: landing.State
    phase: float
    z: float
    v: float
    stuck: float
    motor_speed: float
    D_real: float
    D_imag: float
    begin: float
    samples: float
    levels: Vector


PARAMETERS = record(Parameters, landing=landing.PARAMETERS)
STATE = record(State, landing=landing.STATE, levels=4)
COMMAND = record(Answer, State, landing=landing.STATE, levels=4)


@inner
def mean_level(p: landing.Parameters, u: float) -> float:
    """M = (u J2 + Mc J1)/(J1 + J2) in N m."""
    return p.c * mean_twist(p, u)


@inner
def torque_of(p: landing.Parameters, level: float) -> float:
    """The motor torque of a mean shaft torque, not below zero."""
    return max(0.0, motor_torque(p, level / p.c))


@inner
def follow(
    p: landing.Parameters, lag: float, z: float, v: float, stuck: float, u: float, demand: float, s: float,
    contact: bool, y: State,
) -> None:  # fmt: skip
    """Twist, its rate, motor speed and the sensitivity D of `shaping` after the time s, by the model.

    D counts from the contact, or from where a stuck load breaks away; later, once no steps could be found,
    from the present sample.
    """
    end_z, end_v, still, moving, gained = move(p, z, v, stuck, u, s)
    D = 0j
    if still == 0.0:
        level = mean_level(p, u)
        sigma, omega = p.sigma, p.omega
        inertia = p.share * p.J1
        begin_z, begin_v = swing(end_z, end_v, level / p.c, sigma, omega, -moving)
        if contact or stuck != 0.0:
            D = sensitivity(begin_v, p.c * begin_z, inertia, sigma, omega, lag, level)
            W = vector(begin_z, begin_v, p.c, sigma, omega, lag, level)
            D = later(D, W, mean_level(p, demand), sigma, omega, moving)
        else:
            D = sensitivity(end_v, p.c * end_z, inertia, sigma, omega, lag, level)
    y.z = end_z
    y.v = end_v
    y.motor_speed += gained
    y.stuck = still
    y.D_real = D.real
    y.D_imag = D.imag


@inner
def at_rest(p: landing.Parameters, u: float, stuck: float, y: State) -> None:
    """The shaft at rest under the motor torque u."""
    y.stuck = 1.0 if stuck != 0.0 and u <= p.Mc else 0.0
    y.z = u / p.c if y.stuck != 0.0 else mean_twist(p, u)
    y.v = 0.0
    y.D_real = 0.0
    y.D_imag = 0.0


@compiled
def prepare(p: Parameters, u: float, demand: float, y: State) -> int:
    """Plan the steps from the state that the first of them meets; how many samples each level lasts."""
    near = p.landing
    lag, dead, c, sigma, omega = p.lag, p.dead, near.c, near.sigma, near.omega
    z, v = y.z, y.v
    D = complex(y.D_real, y.D_imag)
    if dead > 0.0:  # until then the last demand goes on acting
        W = vector(z, v, c, sigma, omega, lag, mean_level(near, u))
        D = later(D, W, mean_level(near, demand), sigma, omega, dead)
        mean, u = over_dead_time(u, demand, lag, dead)
        z, v = swing(z, v, mean_twist(near, mean), sigma, omega, dead)
    W = vector(z, v, c, sigma, omega, lag, mean_level(near, u))
    lowest = max(0.0, mean_level(near, 0.0))
    n, M0, M1, M2, M3 = plan(int(p.order), W, D, lowest, mean_level(near, p.full), sigma, omega, near.period)
    y.samples = n
    y.levels[0] = torque_of(near, M0)
    y.levels[1] = torque_of(near, M1)
    y.levels[2] = torque_of(near, M2)
    y.levels[3] = torque_of(near, M3)
    return n


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Close the gap, follow the swing by the model, plan the steps once, play them."""
    p = named(parameters, PARAMETERS)
    m = named(measured, MEASURED)
    x = named(state, STATE)
    y = named(command, COMMAND)
    keep_state(state, command)
    near, before, now = p.landing, x.landing, y.landing
    t, u = m.time, m.motor_torque
    phase = x.phase
    demand = p.full
    now.sample = before.sample + 1.0
    now.torque = u

    if phase == GAP_OPEN:
        speed, beyond = watch(near, m, before, now)
        demand = approach(near, before, t, speed)
        if beyond > 0.0:
            phase = SWINGING
            s, v = contact_seen(near, before, t, u, beyond, now.free_speed, now.older_slope)
            y.motor_speed = v + load_speed(near, before, t - s)
            stuck = sticks(near, before)
            if s * near.omega < math.pi:
                follow(near, p.lag, 0.0, v, stuck, u, before.demand, s, True, y)
            if s * near.omega >= math.pi or y.z <= 0.0:
                # seen so late that the phase of the swing is not known: take its mean
                at_rest(near, u, stuck, y)
    elif phase == SWINGING:
        mean = mean_torque(before.torque, u, before.demand)
        follow(near, p.lag, x.z, x.v, x.stuck, mean, before.demand, near.period, False, y)
        if y.z < 0.0:
            phase = GAP_OPEN
            open_again(t, y.motor_speed, y.motor_speed - y.v, before, now)
            demand = near.low

    if phase == SWINGING:
        if y.stuck != 0.0:
            demand = near.low
        elif prepare(p, u, before.demand, y) > 0:
            phase = STEPPING
            y.begin = before.sample
        else:  # the swing dies out where it is
            swinging = BRAKING * y.v / math.hypot(near.sigma, near.omega)
            demand = min(torque_of(near, near.c * (y.z - swinging)), p.full)
    if phase == STEPPING:
        level = int((before.sample - y.begin) / y.samples)
        if level < int(p.order):
            demand = y.levels[level]
        else:
            phase = DONE
    elif t >= near.patience:
        phase = DONE
        demand = p.full

    y.torque = demand
    y.ask_again = math.inf if phase == DONE else (before.sample + 1.0) * near.period
    y.phase = phase
    now.demand = demand


@dataclass(frozen=True)
class Shaped(CompiledController):
    """Soft landing, then the torque raised in steps that leave no swing in the shaft.

    It measures the motor angle (encoder) and the motor torque. The gap is nowhere among its numbers.

    *Landing.* The motor closes the gap `approach_speed` faster than the load, with at most `low_torque`. The
    contact is seen in the second difference of the encoder angle against that of a free motor, which is the
    mean shaft torque over a short window; it counts from `threshold` on, and at least from six times the
    encoder's rounding. Its size gives the instant of contact too, and so twist and twist rate at the sample
    that sees it (`landing`).

    *Steps.* The impact has already excited the shaft: T(0) = 0, T'(0) = c dw12. From this state the torque is
    raised in levels of n samples each, two (`zv`) or four (`zvd`), to `full_torque`, chosen so that nothing
    swings after the last step. Undamped and for n samples in a quarter of the elastic period, with I = c
    dw12/Omega and the mean torque M_f under the full torque, the two levels of the mean torque are

        M_0, M_1 = (M_f - I)/2, (M_f + I)/2

    and I = 0 gives the two equal steps of the textbook. n is the smallest number whose levels rise; then T
    never exceeds M_f: K_dyn = 1 with `full_torque` = Ms. The equations, with damping and lag, are in
    `shaping`. `zvd` makes the derivative of what is left with respect to the frequency zero as well; it takes
    twice as long, and a softer landing.

    No such levels may exist: the landing was too hard, or a load at rest still holds. Then the mean torque
    is T - 4 T'/Omega, within 0 and the full torque, which lets the swing die out (T'' = -4 Omega T'), or the
    torque is low until the load breaks away, and the levels are asked for again in every sample. Where the
    flanks part again, the gap is closed again.

    *Limits.* After contact it counts on its model: elastic `frequency`, inertias, load torque and speed of
    the load are those of the nominal drive. A first-order lag of the torque commutes with the shaper, and is
    allowed for; so is a dead time of up to one sample. A limited torque rate is not. Contact not seen within
    `patience` is waited for no longer.

    Source: posicast of Smith (1957), ZV and ZVD of Singer and Seering (1990), with the state at contact.

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(simulate(crane, Shaped(shaper=kind)).k_dyn, 1) for kind in ("zv", "zvd")]
    [1.0, 1.0]
    """

    name: ClassVar[str] = "shaped"
    summary: ClassVar[str] = "soft landing, then torque steps that leave no swing in the shaft (ZV, ZVD)"
    source: ClassVar[str] = "Smith 1957, Singer and Seering 1990"
    effort: ClassVar[Effort | None] = Effort.ENCODER
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = size(STATE)

    shaper: str | None = parameter("", "zv or zvd", "zv", "text", choices=tuple(SHAPERS))
    low_torque: float | None = parameter(*landing.LOW_TORQUE, multiples=(0.3, 2.0))
    approach_speed: float | None = parameter(
        "rad/s",
        "speed at which the gap is closed",
        "c dw12/Omega = 0.7 (zv) or 0.3 (zvd) of the mean shaft torque under the full torque",
        multiples=(0.3, 3.0),
    )
    full_torque: float | None = parameter(
        "N*m", "torque after the last step", "starting torque Ms", multiples=(0.4, 1.0)
    )
    frequency: float | None = parameter(
        "rad/s", "undamped elastic frequency of the model", "Omega", multiples=(0.7, 1.4)
    )
    threshold: float | None = parameter(*landing.THRESHOLD_TORQUE)
    patience: float | None = parameter("s", "longest wait for contact and plan", PATIENCE_DEFAULT)
    period: float | None = parameter("s", "sample period", PERIOD_DEFAULT)

    def __post_init__(self) -> None:
        check(
            self,
            above_zero=("low_torque", "approach_speed", "full_torque", "frequency", "threshold", "period"),
            not_negative=("patience",),
        )

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """From the nominal drive; neither gap nor start position enter."""
        shaper = self.shaper or "zv"
        return {
            "shaper": shaper,
            "frequency": drive.Omega,
            **landing.landing_defaults(self, drive, IMPACT[shaper]),
        }

    def vector(self, drive: Drive) -> Vector:
        """The numbers of `Parameters`."""
        frequency: Any = self.frequency
        inertia = drive.J1 * drive.J2 / (drive.J1 + drive.J2)
        numbers = landing.landing_numbers(self, drive, inertia * frequency**2)
        return stack(
            *numbers, SHAPERS[self.shaper or "zv"], self.full_torque, drive.torque_lag,
            drive.computing_delay,
        )  # fmt: skip
