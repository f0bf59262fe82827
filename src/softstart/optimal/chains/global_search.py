"""A global search for a first demand: a dozen torques by the covariance matrix adaptation strategy (CMA-ES).

The torques stand at instants that are close together while the gaps are taken up, which is where local optima
differ, and are joined by straight lines. Of each candidate only the exact figures of its start are computed.
N. Hansen, The CMA evolution strategy: a tutorial, arXiv 1604.00772; package cma.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.late import late
from softstart.optimal.chains.search import PENALTY, Search
from softstart.profile import TorqueProfile

cma = late("cma")

EVALUATIONS = 2500
POPULATION = 16
SPREAD = 0.25  # of the highest torque
CROSSINGS = (0.0, 0.3, 0.6, 0.9, 1.2, 1.6, 2.0, 2.6, 3.2, 4.0, 5.0)  # instants, in times to cross the gaps


def require_cma() -> None:
    """A clear sentence where the package is missing."""
    try:
        _ = cma.CMAEvolutionStrategy
    except ImportError:
        raise InputError(
            'seeds = cma: the global search needs the package cma; install it with "pip install '
            'softstart[search]", or name strategies as seeds.'
        ) from None


def found(search: Search, seed: int = 1, evaluations: int = EVALUATIONS) -> tuple[Vector, Vector]:
    """Instants in s and torques in N m of the best demand; the same for the same `seed`."""
    require_cma()
    problem, arrays = search.problem, search.problem.drive.at_motor_shaft()
    high, low = search.high, search.low
    travel = float(arrays.gap.sum()) or high / float(arrays.c.min())
    crossing = math.sqrt(2.0 * travel * float(arrays.J[arrays.motor]) / high)
    crossing = min(crossing, 0.9 * search.end / CROSSINGS[-1])
    times = np.append(crossing * np.array(CROSSINGS), [search.end, search.until])
    target = problem.target

    def cost(shares: Any) -> float:
        torques = np.clip(np.asarray(shares), low / high, 1.0) * high
        beyond = float(np.abs(np.asarray(shares) - np.clip(shares, low / high, 1.0)).sum())
        peak, reached, speed = search.player.figures(TorqueProfile(times, torques), search.until)
        late = max(reached, search.end) / search.end - 1.0
        if math.isinf(reached):
            late = search.until / search.end - speed / target
        miss = max(late, 0.0)
        return peak / problem.base_torque + PENALTY * miss + 0.1 * beyond

    steady = float(arrays.J.sum()) * target / search.end + float(arrays.Mc.sum())
    first = np.full(times.size, min(steady / high, 0.95))
    first[1:6] = 0.3  # a push, then less while the gaps are crossed
    options = {"seed": seed, "verbose": -9, "maxfevals": evaluations, "popsize": POPULATION, "tolfun": 1e-4}
    strategy = cma.CMAEvolutionStrategy(first, SPREAD, options)
    while not strategy.stop():
        asked = strategy.ask()
        strategy.tell(asked, [cost(one) for one in asked])
    best = np.clip(strategy.result.xbest, low / high, 1.0) * high
    return times, best
