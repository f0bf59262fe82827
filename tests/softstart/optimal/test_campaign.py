"""Random drives from their shortest start on: nothing is refused that exists, and K_dyn never rises.

Every answer is integrated again by the oracle, which shares nothing with the kernel.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from tests.oracle import Start, integrate

from softstart import Drive, Optimum
from softstart.optimal.duality import dual_bounds
from softstart.optimal.optimize import solve
from softstart.optimal.path import Path
from softstart.optimal.problem import Problem, Terminal

TIMES = (1.0, 1.04, 1.15, 1.6)  # of the shortest start found
BOUNDED = (4, 5, 6)  # their last answers are compared with the bounds of weak duality


def drawn(seed: int) -> tuple[Drive, Terminal | None]:
    """A drive and how its start ends; some start at an unknown position."""
    rng = np.random.default_rng([seed, 31])
    J1, Ms, f = 10 ** rng.uniform([-3.0, 0.0, 0.3], [0.0, 3.0, 1.8])
    J2, Mc, Omega = J1 * 10 ** rng.uniform(-1.0, 1.7), Ms * rng.uniform(0.0, 0.7), 2.0 * math.pi * f
    c = Omega**2 * J1 * J2 / (J1 + J2)

    def some(share: float, low: float, high: float) -> float:
        return float(rng.uniform(low, high)) if rng.random() < share else 0.0

    gap = Ms / c * 10 ** rng.uniform(-1.0, 1.5) if rng.random() < 0.9 else 0.0
    where = rng.choice(["driving-flank", "opposite-flank", "mid-gap", "mid-gap", "mid-gap", "unknown"]).item()
    target = (Ms - Mc) / (J1 + J2) / f * rng.uniform(1.0, 8.0)
    ramp = some(0.3, 0.05, 2.0)  # of a period
    drive = Drive(
        motor_inertia=J1, load_inertia=J2, starting_torque=Ms, load_torque=Mc, stiffness=c, gap=gap,
        damping=2.0 * some(0.6, 1e-3, 0.1) * c / Omega,
        contact_law=rng.choice(["no-pull", "no-pull", "dead-zone"]).item(),
        load_kind=rng.choice(["active", "reactive"]).item(),
        torque_lag=some(0.6, 5e-4, 2e-2),
        torque_rate=Ms * f / ramp if ramp else math.inf,
        motor_friction=some(0.2, 0.0, 0.05) * Ms,
        load_viscous_friction=some(0.2, 0.01, 0.2) * (Ms - Mc) / target,
        start_position=where if gap else "mid-gap", target_speed=target,
    )  # fmt: skip
    unknown = len(drive.positions) > 1
    return drive, None if unknown else rng.choice(["synchronous", "steady", "reached"]).item()


def integrated(drive: Drive, best: Optimum, until: float) -> Start:
    """The start of a drive under the demand of an answer."""
    time, torque = best.profile.time, best.profile.torque
    lines = [
        (float(a), float(u), float((v - u) / (b - a)))
        for (a, u), (b, v) in pairwise(zip(time, torque, strict=True))
        if b > a
    ]
    law = drive.contact_law if drive.gap > 0.0 else "dead-zone"  # a spring without flanks pulls too
    return integrate(
        J1=drive.J1, J2=drive.J2, c=drive.c, d=drive.d, gap=drive.gap, Mc=drive.Mc, kind=drive.load_kind,
        law=law, theta0=drive.theta0, w1_0=0.0, w2_0=0.0, lag=drive.torque_lag, rate=drive.torque_rate,
        torque_pieces=[*lines, (float(time[-1]), float(torque[-1]))], u0=0.0, t_end=until,
        friction=drive.motor_friction, b2=drive.load_viscous_friction,
    )  # fmt: skip


def check_by_integration(best: Optimum) -> None:
    """Peak and speeds at t_f to 1e-8, which the oracle's step errors of 1e-12 leave through contacts."""
    problem, end = best.problem, best.end_time
    peaks = []
    for run in (each for one in best.runs for each in one.each):
        peaks.append(integrated(run.drive, best, end + float(run.drive.elastic_period)).peak)
        again = integrated(run.drive, best, end)
        speeds = np.array([again.w1, again.w2]) / problem.target
        np.testing.assert_allclose(speeds, run.trajectory.at([end])["w"][0] / problem.target, atol=1e-8)
        assert speeds[1] >= 1.0 - 1e-8
        assert problem.terminal == "reached" or np.abs(speeds - 1.0).max() < 1e-8
    assert max(peaks) == pytest.approx(best.k_dyn * problem.base_torque, rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_from_the_shortest_start_on(seed: int) -> None:
    """A start serves every longer time, to 1e-4 of K_dyn; no bound lies above a start, to rounding (1e-5)."""
    drive, terminal = drawn(seed)
    path = Path(Problem(drive, 1.0, terminal))
    assert path.shortest is not None
    answers = []
    for multiple in TIMES:  # none is refused: the shortest start ends within each
        best = solve(Problem(drive, multiple * path.shortest.end, terminal), path=path)
        check_by_integration(best)
        assert best.bound.k_dyn <= best.k_dyn * (1.0 + 1e-5)
        answers.append(best)
    for shorter, longer in pairwise(answers):
        assert longer.k_dyn <= shorter.k_dyn * (1.0 + 1e-4)
    if seed in BOUNDED:
        any_number, once = dual_bounds(best.problem, best.k_dyn)
        bound = once if best.run.contacts == 1 else any_number
        assert any_number.k_dyn <= bound.k_dyn <= best.k_dyn * (1.0 + 1e-5)
