"""[G] Gerasymiak & Subbotin, Dual-mass mechanical part electromechanical system behavior analysis, p. 18-20.

The data are those of page 20: crane motor 4AMTKF(H)112L6. The paper prints curves without numbers; the table
recomputed from its equations (the check table) has four decimals, and is compared to all of them.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.oracle import integrate

from softstart.formulas import TwoStages, contact_stage, mean_shaft_torque, open_stage, two_stages

J1, c, Ms, Mc = 0.035, 368.465, 62.0, 7.16
BASE = mean_shaft_torque(Ms, J1, 5 * J1, Mc)  # fig. 2: the base of J2 = 5 J1 serves all curves
RATIOS = np.linspace(0.05, 1.0, 96)  # the axis of figs. 2-4


def crane(J2_over_J1: float = 5, gap: float = 0.5) -> dict[str, float]:
    return {"J1": J1, "J2": J2_over_J1 * J1, "c": c, "gap": gap, "Ms": Ms, "Mc": Mc, "base": BASE}


def method_1(r, **drive) -> TwoStages:
    return two_stages(r * Ms, Ms, **drive)


def method_2(r, **drive) -> TwoStages:
    return two_stages(r * Ms, r * Ms, **drive)


TABLE = [
    (5, 0.5, 1.0, 3.1179, 3.1179, 0.0166, 0.0533),
    (5, 0.5, 0.25, 2.3894, 1.2677, 0.0321, 0.0743),
    (5, 2.0, 1.0, 4.8654, 4.8654, 0.0332, 0.0658),
    (5, 2.0, 0.25, 3.1729, 2.2144, 0.0643, 0.1008),
    (2, 0.5, 1.0, 2.7157, 2.7157, 0.0163, 0.0485),
]


@pytest.mark.parametrize("row", TABLE)
def test_page_20_table_of_the_worked_example(row):
    # All printed digits. The last column is a sum of two rounded durations (summed first: 0.0744 and 0.0486).
    J2_over_J1, gap, r, k_1, k_2, t1, t12 = row
    first, second = method_1(r, **crane(J2_over_J1, gap)), method_2(r, **crane(J2_over_J1, gap))
    assert round(first.k_dyn, 4) == k_1
    assert round(second.k_dyn, 4) == k_2
    assert round(first.open_duration, 4) == t1
    assert round(round(first.open_duration, 4) + round(first.contact_duration, 4), 4) == t12
    assert first.open_duration + first.contact_duration == pytest.approx(t12, abs=1e-4)


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


def test_page_19_equation_13_second_form_of_the_peak():
    # (13) as printed, where formulas computes mean plus amplitude; a few roundings apart
    J2 = 5 * J1
    Omega, dw12 = math.sqrt(c / J1 + c / J2), open_stage(Ms, J1, J2, Mc, 0.5).dw12
    printed = BASE * (1 + math.sqrt(1 + (c * dw12 / (Omega * BASE)) ** 2))
    assert contact_stage(Ms, J1, J2, Mc, c, dw12).peak == pytest.approx(printed, rel=1e-14)


def test_page_20_method_1_cannot_bring_the_coefficient_below_two():
    # (17) is 1 + sqrt(1 + square); 2 itself is approached only without load torque, as r goes to 0
    for gap in (0.5, 2.0):
        assert np.all(method_1(RATIOS, **crane(gap=gap)).k_dyn > 2)
    free = crane() | {"Mc": 0.0, "base": mean_shaft_torque(Ms, J1, 5 * J1, 0.0)}
    assert 0 < method_1(1e-9, **free).k_dyn - 2 < 1e-8


def test_page_20_method_2_can():
    for gap, reach in ((0.5, 0.52), (2.0, 0.20)):  # on the axis of fig. 3, in steps of 0.01
        below_two = RATIOS[method_2(RATIOS, **crane(gap=gap)).k_dyn < 2]
        assert below_two.min() == RATIOS.min()
        assert below_two.max() == pytest.approx(reach, abs=1e-9)


def test_page_20_wider_gap_raises_the_coefficient():
    for method in (method_1, method_2):
        assert np.all(method(RATIOS, **crane(gap=2.0)).k_dyn > method(RATIOS, **crane()).k_dyn)


def test_page_20_smaller_inertia_lowers_the_coefficient_while_the_motor_is_stronger_than_the_load():
    # Method 1: always. Method 2: only for r Ms > Mc. At r Ms = Mc the mean shaft torque is Mc for every J2
    # and K_dyn does not depend on J2 at all; below that a smaller J2 raises it.
    for gap in (0.5, 2.0):
        assert np.all(method_1(RATIOS, **crane(2, gap)).k_dyn < method_1(RATIOS, **crane(5, gap)).k_dyn)
        small, large = (method_2(RATIOS, **crane(ratio, gap)).k_dyn for ratio in (2, 5))
        assert np.all((small < large) == (RATIOS * Ms > Mc))
        small, large = (method_2(Mc / Ms, **crane(ratio, gap)).k_dyn for ratio in (2, 5))
        assert small == pytest.approx(large, rel=1e-14)


def test_page_20_least_coefficient_is_not_proportional_to_the_inertia():
    # The paper says the least K_dyn of method 1 changes in direct proportion to J2. Without an impact it is
    # 2 M12avg/base, and M12avg = (Ms J2 + J1 Mc)/(J1 + J2) changes far less: by 0.83 for 0.4 of the inertia.
    least = [method_1(1.0, **crane(ratio, gap=0.0)).k_dyn for ratio in (2, 5)]
    assert least[0] / least[1] == pytest.approx((62 * 2 + 7.16) / 3 / 52.86, rel=1e-12)
    assert least[0] / least[1] > 0.8


def test_page_21_figure_4_stage_2_lasts_nearly_the_same_only_near_the_full_torque():
    # The paper: little difference between the methods, practically none near the starting torque. Ratios of
    # stage 2 of method 1 to that of method 2, to two digits.
    r = np.array([1.0, 0.75, 0.5, 0.25])
    for gap, expected in ((0.5, [1.0, 1.06, 1.14, 1.29]), (2.0, [1.0, 1.04, 1.10, 1.20])):
        first, second = method_1(r, **crane(gap=gap)), method_2(r, **crane(gap=gap))
        assert np.round(first.contact_duration / second.contact_duration, 2) == pytest.approx(expected)
        assert np.all(first.open_duration == second.open_duration)
        # from r = 1 to 0.25 stage 1 grows by 3 to 8 times what stage 2 changes by
        added = first.open_duration[-1] - first.open_duration[0]
        assert added > 2.5 * abs(first.contact_duration[-1] - first.contact_duration[0])


def test_page_21_smaller_inertia_hardly_changes_stage_1():
    # the paper: unchanged; by (3) it is 1.6 % shorter at full torque
    t_2, t_5 = (method_1(1.0, **crane(ratio)).open_duration for ratio in (2, 5))
    assert t_2 / t_5 == pytest.approx(0.9835, abs=5e-5)
