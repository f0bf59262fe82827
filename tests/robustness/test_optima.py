"""The optimum on random drives of all classes: no other method is gentler, and no start lies below the bound.

Drives are drawn by kind of load, lag, rate limit, torque-speed curve, braking, damping, start position and
terminal, with start times of 1.02 to 2 times the shortest. Beside the answer stand the searchers that were
tried, all shipped controllers, and random torques, also near the answer; the last two where the load need
only reach its speed. `--size 10`: ten times as many drives.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.softstart.optimal.drives import gentle_torque, played, random_drive, random_torque, shaken

from softstart import Optimum, optimize, simulate
from softstart.controller import ready_controller_names
from softstart.errors import InputError, SimulationError
from softstart.optimal.optimize import shortest_start_time
from softstart.optimal.problem import Problem
from softstart.optimal.result import InfeasibleError, OptimumError

GENTLER = 1e-3  # relative: so much gentler a start of someone else may be
BELOW = 1e-5  # relative: a start this little below a bound is not below it
TORQUES = 100


def beside(rng: np.random.Generator, best: Optimum) -> list[tuple[float, int]]:
    """K_dyn and contacts of starts in time: all controllers, torques at random and near the answer."""
    problem, latest, found = best.problem, best.problem.start_time, []
    assert latest is not None
    drive: Any = problem.drive
    until = latest + 0.5 * float(drive.elastic_period)

    def take(name: str, *given: Any) -> None:
        try:
            run = played(drive, *given) if given else simulate(drive, name)
        except SimulationError:
            return
        if run.start_time <= latest * (1.0 + 1e-12) and math.isfinite(run.k_dyn):
            found.append((run.k_dyn, run.contacts))

    if problem.torque_speed or problem.terminal != "reached":
        return []
    for name in ready_controller_names():
        take(name)
    for _ in range(TORQUES):
        draw = rng.random()
        if draw < 0.3:
            profile = gentle_torque(rng, drive, latest) if draw < 0.2 else random_torque(rng, drive)
        else:
            profile = shaken(rng, best.profile, problem.lowest_torque, problem.highest_torque)
        take("profile", profile, until)
    return found


@pytest.mark.parametrize("first", [7, pytest.param(4, marks=pytest.mark.slow)])
def test_no_one_is_gentler(first: int, pytestconfig: pytest.Config) -> None:
    """Drives 7 and 4, 13, ... of this seed have an optimum, with a certificate."""
    numbers = [7] if first == 7 else [4, 13, *range(20, 20 + 10 * (pytestconfig.getoption("size") - 1))]
    for number in numbers:
        rng = np.random.default_rng([3, number])
        drive, options = random_drive(rng)
        share = float(rng.uniform(1.02, 2.0))
        try:
            shortest = shortest_start_time(Problem(drive, 1.0, **options))
            best = optimize(drive, share * shortest, **options)
        except (InfeasibleError, OptimumError, InputError):
            assert number >= 20
            continue
        starts = beside(rng, best)
        others = [one.value for one in best.tried if one.value is not None] + [k for k, _ in starts]
        assert min(others, default=math.inf) >= best.k_dyn * (1.0 - GENTLER), number
        # the certificate is of starts with one contact
        proved = [k for k, contacts in starts if contacts <= 1 or best.bound.kind == "momentum"]
        assert min(proved, default=math.inf) >= best.bound.k_dyn * (1.0 - BELOW), number
        if number < 20 and best.bound.kind == "certificate":
            assert best.k_dyn < 1.01 * best.bound.k_dyn
