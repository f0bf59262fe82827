"""[G] Gerasymiak & Subbotin, Dual-mass mechanical part electromechanical system behavior analysis, p. 18-20.

The data are those of page 20: crane motor 4AMTKF(H)112L6. The paper prints curves without numbers; the table
recomputed from its equations (the check table) has four decimals, and is compared to all of them: here by
integration, by the closed forms and the simulation, with the conclusions, in `studies/test_paper_g.py`.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.oracle import integrate

from softstart.formulas import mean_shaft_torque, two_stages

J1, c, Ms, Mc = 0.035, 368.465, 62.0, 7.16
BASE = mean_shaft_torque(Ms, J1, 5 * J1, Mc)  # fig. 2: the base of J2 = 5 J1 serves all curves


def crane(J2_over_J1: float, gap: float) -> dict[str, float]:
    return {"J1": J1, "J2": J2_over_J1 * J1, "c": c, "gap": gap, "Ms": Ms, "Mc": Mc, "base": BASE}


TABLE = [
    (5, 0.5, 1.0, 3.1179, 3.1179, 0.0166, 0.0533),
    (5, 0.5, 0.25, 2.3894, 1.2677, 0.0321, 0.0743),
    (5, 2.0, 1.0, 4.8654, 4.8654, 0.0332, 0.0658),
    (5, 2.0, 0.25, 3.1729, 2.2144, 0.0643, 0.1008),
    (2, 0.5, 1.0, 2.7157, 2.7157, 0.0163, 0.0485),
]


@pytest.mark.parametrize("row", TABLE)
def test_page_20_table_by_integration(row):
    # Nothing of the closed forms but the switching instant; one contact stage at 1e-11 a step.
    J2_over_J1, gap, r, k_1, k_2, t1, t12 = row
    drive = crane(J2_over_J1, gap)
    start = {name: drive[name] for name in ("J1", "J2", "c", "gap", "Mc")} | {"d": 0.0, "lag": 0.0, "u0": 0.0}
    start |= {"theta0": 0.0, "w1_0": 0.0, "w2_0": 0.0, "kind": "active", "law": "no-pull", "rate": math.inf}
    switch = math.sqrt(gap * drive["J2"] * J1 / (r * Ms * drive["J2"] + Mc * J1))  # (3)
    for after, k in ((Ms, k_1), (r * Ms, k_2)):
        run = integrate(**start, torque_pieces=[(0.0, r * Ms), (switch, after)], t_end=t12 + 0.02)
        assert round(run.peak / BASE, 4) == k
        first = {kind: time for time, kind in reversed(run.events)}
        assert round(first["closed"], 4) == t1
        if after == Ms:
            assert first["opened"] == pytest.approx(t12, abs=1e-4)


def test_page_20_smaller_inertia_lowers_the_coefficient_while_the_motor_is_stronger_than_the_load():
    # Method 1: always. Method 2: only for r Ms > Mc. At r Ms = Mc the mean shaft torque is Mc for every J2
    # and K_dyn does not depend on J2 at all; below that a smaller J2 raises it.
    torques = np.linspace(0.05, 1.0, 96) * Ms  # the axis of figs. 2-4
    for gap in (0.5, 2.0):
        small, large = (two_stages(torques, Ms, **crane(ratio, gap)).k_dyn for ratio in (2, 5))
        assert np.all(small < large)
        small, large = (two_stages(torques, torques, **crane(ratio, gap)).k_dyn for ratio in (2, 5))
        assert np.all((small < large) == (torques > Mc))
        small, large = (two_stages(Mc, Mc, **crane(ratio, gap)).k_dyn for ratio in (2, 5))
        assert small == pytest.approx(large, rel=1e-14)
