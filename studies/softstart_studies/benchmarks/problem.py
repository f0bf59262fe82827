"""The starts that everyone solves: plain numbers, so that a peer needs nothing of softstart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from softstart.arrays import Vector

if TYPE_CHECKING:
    from softstart.controller import Controller
    from softstart.drive import Drive


DRIVE = "crane-4amtkf"
GAPS = (0.5, 2.0)  # rad, the two gaps of [G]; the batches lie between them
RAMP_TIME = 0.5  # s, longer than most of the start, so that it is sampled nearly throughout
STRATEGIES = ("direct", "reduced-first-stage", "reduced-two-stage", "ramp")
DAMPED = "damped "  # before the name of a strategy: a drive with damping and lag
DAMPING, LAG = 0.03, 0.002  # share of the critical damping; s


@dataclass(frozen=True)
class Problem:
    """A crane drive with active load, at rest at mid-gap, until an elastic period after `target`.

    `stage_torques`: motor torque of stage 1, of stage 2 and of all later ones. For a ramp they are None and
    the torque is initial + (full - initial) min(1, t_k/time), held from t_k = k period to the next sample.
    SI units.
    """

    strategy: str
    J1: float
    J2: float
    c: float
    Mc: float
    target: float
    elastic_period: float
    stage_torques: tuple[float, float, float] | None
    initial: float = 0.0
    full: float = 0.0
    time: float = 0.0
    period: float = 0.0
    d: float = 0.0
    lag: float = 0.0


def gaps(count: int) -> Vector:
    """`count` gaps in rad, the middles of equal parts of `GAPS`: few or many, their mean is the same.

    >>> gaps(3)
    array([0.75, 1.25, 1.75])
    """
    low, high = GAPS
    middles: Vector = low + (high - low) * (np.arange(count) + 0.5) / count
    return middles


def crane(gap: float, strategy: str = "") -> Drive:
    """The drive with this gap, rad."""
    from softstart.drive import Drive

    drive = Drive.load(DRIVE).replace(gap=gap)
    if not strategy.startswith(DAMPED):
        return drive
    return drive.replace(damping=2.0 * DAMPING * drive.c / drive.Omega, torque_lag=LAG)


def controller_of(strategy: str, drive: Drive) -> Controller:
    """The controller; a ramp takes `RAMP_TIME`, method 2 raises its torque where [G](15) says."""
    from softstart_studies.crane import published

    strategy = strategy.removeprefix(DAMPED)
    given = {"time": RAMP_TIME} if strategy == "ramp" else {}
    return published(strategy, **given).fitted(drive)


def crane_problem(strategy: str) -> Problem:
    """The problem as numbers, taken from softstart's drive and controller.

    >>> crane_problem("direct").stage_torques
    (62.0, 62.0, 62.0)
    >>> crane_problem("ramp").period
    0.001
    """
    drive = crane(GAPS[0], strategy)
    given = controller_of(strategy, drive).parameters
    stages, plain = None, strategy.removeprefix(DAMPED)
    if plain == "direct":
        stages = (given["torque"],) * 3
    elif plain == "reduced-first-stage":
        stages = (given["torque"], given["full_torque"], given["full_torque"])
    elif plain == "reduced-two-stage":
        stages = (given["torque"], given["torque"], given["full_torque"])
    problem = Problem(
        strategy=strategy,
        J1=float(drive.J1),
        J2=float(drive.J2),
        c=float(drive.c),
        Mc=float(drive.Mc),
        target=float(drive.target_speed),
        elastic_period=float(drive.elastic_period),
        stage_torques=stages,
        d=float(drive.d),
        lag=float(drive.torque_lag),
    )
    if stages is not None:
        return problem
    return replace(
        problem,
        initial=float(given["initial"]),
        full=float(given["full_torque"]),
        time=float(given["time"]),
        period=float(given["period"]),
    )
