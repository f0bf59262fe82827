"""Starts drawn at random for the oracle and whatever is compared with it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def random_case(rng: np.random.Generator) -> dict[str, Any]:
    """Arguments of `integrate` for a start drawn at random, a few to ten elastic periods long."""

    def decades(low: float, high: float) -> float:
        return float(10 ** rng.uniform(math.log10(low), math.log10(high)))

    J1 = decades(1e-3, 1e2)
    J2 = J1 * decades(0.1, 100)
    period, twist = decades(5e-3, 1.0), decades(1e-3, 0.3)  # twist: of the shaft under the starting torque
    Omega = 2 * math.pi / period
    c = Omega**2 * J1 * J2 / (J1 + J2)
    zeta = 0.0 if rng.random() < 0.25 else float(rng.uniform(0, 1.5))
    Ms, speed, t_end = c * twist, Omega * twist, period * float(rng.uniform(3, 10))
    gap = 0.0 if rng.random() < 0.05 else twist * decades(1e-3, 100)
    place = rng.random()
    theta0 = 0.0 if place < 0.25 else gap * float(rng.uniform(-0.5, 0.5))
    if place > 0.75:
        theta0 = float(rng.choice([-1, 1])) * (gap / 2 + twist * float(rng.uniform(0, 2)))
    w1, w2 = (0.0 if rng.random() < 0.5 else speed * float(rng.normal()) for _ in range(2))
    starts = [0.0, *sorted(float(t) for t in rng.uniform(0, t_end, rng.integers(0, 4)))]
    return {
        "J1": J1,
        "J2": J2,
        "c": c,
        "d": 2 * zeta * c / Omega,
        "gap": gap,
        "Mc": Ms * float(rng.uniform(0, 0.9)),
        "kind": str(rng.choice(["active", "reactive"])),
        "law": str(rng.choice(["no-pull", "dead-zone", "modelica"])),
        "theta0": theta0,
        "w1_0": w1,
        "w2_0": w2,
        "torque_pieces": [(t, Ms * float(rng.uniform(-0.3, 1.2))) for t in starts],
        "lag": 0.0 if rng.random() < 0.5 else decades(2e-4, 2e-2),
        "rate": math.inf if rng.random() < 0.5 else Ms / (period * decades(0.05, 3)),
        "u0": 0.0 if rng.random() < 0.6 else Ms * float(rng.uniform(-0.3, 1.0)),
        "t_end": t_end,
        "target": Ms / (J1 + J2) * t_end * float(rng.uniform(0.05, 0.8)),
    }
