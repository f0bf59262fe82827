"""Soft landing, then torque steps that leave no swing behind: zero-vibration shaping from contact on."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softstart.controller import Numbers, compiled_step, parameter
from softstart.controller.compiled import (
    MEASURED,
    Reply,
    Vector,
    as_record,
    compiled,
    keep_state,
    record,
)
from softstart.drive import Drive
from softstart_controllers import landing
from softstart_controllers.contact import predicted_state
from softstart_controllers.landing import CLOSED, NEXT, RAISING, Landing, landed, sent
from softstart_controllers.shaping import ZV, ZVD, plan_levels, sensitivity, vector

SHAPERS = {"zv": ZV, "zvd": ZVD}
IMPACT = {"zv": 0.7, "zvd": 0.3}  # c dw12/Omega, of the shaft torque under the full torque
BRAKING = 4.0  # of T'/Omega, that the mean torque stays below T while no steps are found
LARGEST_DAMPING = 0.95  # damping ratio that the plan may have
STEPPING, DONE = NEXT, NEXT + 1.0  # phases after those of the landing


class Parameters:
    """The landing and the steps."""

    landing: landing.Parameters
    order: int


class State:
    """The landing and the planned steps: levels of so many samples each, from the sample `first` on."""

    landing: landing.State
    first: int
    samples: int
    levels: Vector


PARAMETERS = record(Parameters, landing=landing.PARAMETERS)
STATE = record(State, landing=landing.STATE, levels=4)
COMMAND = record(Reply, State, landing=landing.STATE, levels=4)


@compiled
def torque_after_contact(p: Parameters, realised: float, y: State) -> float:
    """Plan the steps from the state that the first of them meets, or let the swing die out; the torque now.

    With M = (u J2 + Mc J1)/(J1 + J2), the mean torque of the shaft under the motor torque u.
    """
    near, shaft = p.landing.estimator, y.landing.estimator.shaft
    a, b, c, d = near.a, shaft.b, near.c, near.d
    w1, z, w2, u = predicted_state(near, y.landing.estimator, realised)
    if y.landing.estimator.held != 0.0:  # by the brake, under the torque that holds the load
        return p.landing.low_torque
    if near.Mb != near.Mc and w2 == 0.0 and c * z + d * w1 <= near.Mc:
        return p.landing.low_torque  # until the load breaks away
    share, load = a / (a + b), near.Mc * b / (a + b)
    Omega = math.sqrt(c * (a + b))
    ratio = min(0.5 * d * Omega / c, LARGEST_DAMPING)
    sigma, omega = -ratio * Omega, Omega * math.sqrt(1.0 - ratio * ratio)
    level = share * u + load
    rate = w1 - w2
    W = vector(z, rate, c, sigma, omega, near.torque_lag, level)
    D = sensitivity(rate, c * z, 1.0 / (a + b), sigma, omega, near.torque_lag, level)
    full = share * p.landing.full_torque + load
    n, M0, M1, M2, M3 = plan_levels(int(p.order), W, D, max(0.0, load), full, sigma, omega, near.period)
    if n == 0:
        mean = c * (z - BRAKING * rate / Omega)
        return min(max((mean - load) / share, 0.0), p.landing.full_torque)
    y.landing.phase = STEPPING
    y.first, y.samples = y.landing.sample, n
    y.levels[0] = max((M0 - load) / share, 0.0)
    y.levels[1] = max((M1 - load) / share, 0.0)
    y.levels[2] = max((M2 - load) / share, 0.0)
    y.levels[3] = max((M3 - load) / share, 0.0)
    return float(y.levels[0])


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Land, follow the swing, plan the steps once, play them."""
    p = as_record(parameters, PARAMETERS)
    m = as_record(measured, MEASURED)
    y = as_record(command, COMMAND)
    keep_state(state, command)
    near, now = p.landing, y.landing
    y.torque = landed(near, now, m)
    if now.phase == CLOSED:
        y.torque = torque_after_contact(p, m.motor_torque, y)
    elif now.phase == RAISING and y.torque == near.full_torque:
        now.phase = DONE
    elif now.phase == STEPPING:
        level = int((now.sample - y.first) // y.samples)
        if level < int(p.order):
            y.torque = y.levels[level]
        else:
            y.torque = near.full_torque
            now.phase = DONE
    next_sample = sent(near, now, y.torque, m.motor_torque)
    y.ask_again = math.inf if now.phase == DONE else next_sample


@dataclass(frozen=True)
class Shaped(Landing):
    """Soft landing, then the torque raised in steps that leave no swing in the shaft.

    It measures the motor angle (encoder) and the motor torque. The gap is nowhere among its numbers.

    *Landing.* The motor closes the gap `approach_speed` faster than the load, with at most `low_torque`
    (`landing`); contact and state are estimated (`contact`).
    *Steps.* From T(0) = 0, T'(0) = c dw12 the torque is raised in levels of n samples each, two (`zv`) or
    four (`zvd`), to `full_torque`, so that nothing oscillates after the last step. Undamped and for n samples
    in a quarter of the elastic period, with I = c dw12/Omega and the mean torque M_f under the full torque,

        M_0, M_1 = (M_f - I)/2, (M_f + I)/2

    (`shaping` has damping and lag). n is the smallest number whose levels rise; then K_dyn = 1 with
    `full_torque` = Ms. Where no such levels exist, M = T - 4 T'/Omega, within 0 and the full torque, damps
    the oscillation, and the levels are planned again in every sample; where a load at rest still holds, the
    torque is low until it breaks away.

    The steps have no feedback: inertias, load torque and `frequency` are those of the nominal drive. Lag and
    dead time are compensated, a limited torque rate is not. A hanging load begins with its twist, once the
    brake has let the motor go.

    Source: posicast of Smith (1957), ZV and ZVD of Singer and Seering (1990), with the state at contact.

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(simulate(crane, Shaped(shaper=kind)).k_dyn, 1) for kind in ("zv", "zvd")]
    [1.0, 1.0]
    """

    name = "shaped"
    summary = "soft landing, then torque steps that leave no swing in the shaft (ZV, ZVD)"
    source = "Smith 1957, Singer and Seering 1990"
    kernel = step

    # fmt: off
    shaper: str = parameter("", "shaper", "zv", choices=tuple(SHAPERS))
    approach_speed: float = landing.approach_parameter("0.7 (zv) or 0.3 (zvd)")
    frequency: float = parameter("rad/s", "undamped elastic frequency of the model",
        lambda drive, p: drive.Omega, "Omega", "above 0", multiples=(0.7, 1.4))
    # fmt: on

    @property
    def impact(self) -> float:  # type: ignore[override]
        """C dw12/Omega, of the shaft torque under the full torque."""
        return IMPACT[self.shaper or "zv"]

    def numbers(self, drive: Drive) -> Numbers:
        """Landing, with the stiffness that has this frequency, and steps."""
        numbers = super().numbers(drive)
        numbers["landing"]["estimator"]["c"] = drive.J1 * drive.J2 / (drive.J1 + drive.J2) * self.frequency**2
        return numbers | {"order": SHAPERS[self.shaper]}
