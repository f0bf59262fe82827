"""What is started: a machine and its variants under a strategy; and the same as plain numbers for peers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.arrays import Vector

if TYPE_CHECKING:
    from softstart.controller.base import SetUp

DRIVE, CHAIN = "crane-4amtkf", "crane-4-mass"
GAPS = (0.5, 2.0)  # rad, the two gaps of [G]; the drives of a batch lie between them
RAMP_TIME = 0.5  # s, longer than most of the start, so that it is sampled nearly throughout
DAMPED = "damped "  # before the name of a strategy: a drive with damping and lag, a chain with damping
DAMPING, LAG, CHAIN_DAMPING = 0.03, 0.002, 0.02  # share of the critical damping; s; of each shaft

Solve = Callable[[], Any]
"""Peaks of the shaft torques, N m, a row a start: what is timed."""


@dataclass(frozen=True, eq=False)
class Line:
    """Masses in a line, the motor on the first and the load on the last, from rest at mid-gap; active loads.

    The start ends `tail` s after the last mass has reached `target`. `stage_torques`: motor torque of stage
    1, of stage 2 and of all later ones. For a ramp they are None and the torque is initial + (full - initial)
    min(1, t_k/time), held from t_k = k period to the next sample. SI units.
    """

    J: Vector
    Mc: Vector
    c: Vector
    d: Vector
    gap: Vector
    theta0: Vector
    target: float
    tail: float
    lag: float
    stage_torques: tuple[float, float, float] | None
    initial: float = 0.0
    full: float = 0.0
    time: float = 0.0
    period: float = 0.0

    def demand(self, t: float, stage: int) -> tuple[float, float]:
        """The torque now, and the instant at which it changes if the stage does not."""
        if self.stage_torques is not None:
            return self.stage_torques[min(stage, 3) - 1], math.inf
        k = math.floor(t / self.period + 1e-6)
        if k * self.period >= self.time:
            return self.full, math.inf
        share = k * self.period / self.time
        return self.initial + (self.full - self.initial) * share, (k + 1) * self.period


@dataclass(frozen=True, eq=False)
class Problem:
    """A strategy on a shipped drive or chain, or on a chain that is given.

    A batch of a drive differs in the gap, one of a chain in gaps and load inertia (0.9 to 1.1 times).

    >>> Problem("direct").line().stage_torques
    (62.0, 62.0, 62.0)
    """

    strategy: str
    machine: Any = DRIVE
    ramp_time: float = RAMP_TIME

    @property
    def on_drive(self) -> bool:
        """Whether this is the crane drive of [G]."""
        return bool(self.machine == DRIVE)

    def machines(self, count: int = 0) -> list[Any]:
        """So many variants; without a count the machine itself."""
        from softstart.chain.machines import load_machine

        one: Any = load_machine(self.machine) if isinstance(self.machine, str) else self.machine
        damped = self.strategy.startswith(DAMPED)
        if self.on_drive:
            if damped:
                one = one.replace(damping=2.0 * DAMPING * one.c / one.Omega, torque_lag=LAG)
            return [one.replace(gap=float(gap)) for gap in gaps(count)] if count else [one]
        if damped:
            shafts = (shaft.replace(damping_ratio=CHAIN_DAMPING) for shaft in one.shafts)
            one = replace(one, shafts=tuple(shafts))
        widths = 0.9 + 0.2 * (np.arange(count) + 0.5) / max(count, 1)
        inertias = 0.9 + 0.2 * ((0.5 + np.arange(count) * 0.618034) % 1.0)
        pairs = zip(widths.tolist(), inertias.tolist(), strict=True)
        return [one.scaled(gaps=gap, load_inertia=inertia) for gap, inertia in pairs] if count else [one]

    def set_up(self) -> SetUp:
        """The controller for the machine; method 2 raises its torque where [G](15) says."""
        from softstart.controller import make_controller
        from softstart_studies.crane import published

        strategy = self.strategy.removeprefix(DAMPED)
        given = {"time": self.ramp_time} if strategy == "ramp" else {}
        made = published(strategy, **given) if self.on_drive else make_controller(strategy, given)
        return made.set_up(self.machines()[0].design_drive)

    def line(self, machine: Any = None) -> Line:
        """The machine, or a variant of it, as numbers."""
        one: Any = self.machines()[0] if machine is None else machine
        given: dict[str, Any] = dict(self.set_up()[0].parameters)
        stages, plain = None, self.strategy.removeprefix(DAMPED)
        if plain != "ramp":
            first, full = given["torque"], given.get("full_torque", given["torque"])
            stages = (first, first if plain == "reduced-two-stage" else full, full)
            given = {}
        arrays = one if self.on_drive else one.at_motor_shaft()
        J = (one.J1, one.J2) if self.on_drive else arrays.J
        Mc = (0.0, one.Mc) if self.on_drive else arrays.Mc
        theta0 = 0.0 if self.on_drive else arrays.theta0
        given_arrays = (J, Mc, arrays.c, arrays.d, arrays.gap, theta0)
        numbers: list[Any] = [np.atleast_1d(np.array(value, dtype=np.float64)) for value in given_arrays]
        numbers += [float(one.target_speed), float(one.elastic_period)]
        numbers += [float(getattr(one, "torque_lag", 0.0)), stages]
        numbers += [float(given.get(name, 0.0)) for name in ("initial", "full_torque", "time", "period")]
        return Line(*numbers)


def gaps(count: int) -> Vector:
    """`count` gaps in rad, the middles of equal parts of `GAPS`: few or many, their mean is the same.

    >>> gaps(3)
    array([0.75, 1.25, 1.75])
    """
    low, high = GAPS
    middles: Vector = low + (high - low) * (np.arange(count) + 0.5) / count
    return middles
