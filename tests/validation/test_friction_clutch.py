"""[C] Influence of the engagement law of a friction clutch on the load of its elements.

Its table of results does not follow from its equations; the recomputed column is (1)-(3) integrated
beforehand, with the digits given here. Each is compared to all of them, by the exact clutch and by an
integration of (1) as written.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from softstart.clutch import Clutch, engage

KGF = 9.80665
tM, IM, Ic, cp, w0, MM, Mc = 1.0, 0.1, 0.5, 5.0, 230.0, 60.0, 20.0  # the data of the paper, kgf m and s

TABLE = [
    ("linear", 27141, 64.66, lambda t: t),
    ("quadratic-concave", 25880, 65.58, lambda t: 2 * t - t * t),
    ("quadratic-convex", 28243, 68.02, lambda t: t * t),
    ("exponential", 27709, 66.89, lambda t: math.expm1(t) / math.expm1(1.0)),
]


@pytest.mark.parametrize(("law", "L", "Md", "shape"), TABLE, ids=[row[0] for row in TABLE])
def test_recomputed_column_and_by_integration_in_the_units_of_the_paper(law, L, Md, shape):
    def slopes(t, y):
        M = MM * shape(t) if t < tM else MM
        T = cp * (y[0] - y[1])
        return [y[2], y[3], (M - T) / IM, (T - Mc) / Ic, M * (w0 - y[2])]

    def locks(t, y):
        return y[2] - w0

    locks.terminal, locks.direction = True, 1.0
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-10, "dense_output": True}
    first = solve_ivp(slopes, (0.0, tM), np.zeros(5), **options)
    second = solve_ivp(slopes, (tM, 10.0), first.y[:, -1], events=locks, **options)
    assert round(second.y[4, -1]) == L
    t = np.concatenate([np.linspace(0.0, tM, 4001), np.linspace(tM, second.t[-1], 20001)])
    y = np.concatenate([first.sol(t[:4001]), second.sol(t[4001:])], axis=1)
    assert round(float(cp * (y[0] - y[1]).max()), 2) == Md
    run = engage(Clutch.load("paper-c").replace(law=law))
    assert (round(run.slip_work / KGF), round(run.slip_peak_torque / KGF, 2)) == (L, Md)
    assert run.slip_time == pytest.approx(second.t[-1], rel=1e-9)
    assert run.slip_work / KGF == pytest.approx(second.y[4, -1], rel=1e-9)
