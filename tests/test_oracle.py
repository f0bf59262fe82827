"""Is the oracle right? Known answers, conservation laws, and itself at a finer tolerance.

In another form the same equations are solved in `softstart/drive/test_control_systems.py`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.oracle import Start, integrate, random_case

CRANE: dict[str, Any] = {
    "J1": 0.035, "J2": 0.175, "c": 368.465, "d": 0.0, "gap": 2.0, "Mc": 7.16, "kind": "active",
    "law": "no-pull", "theta0": 0.0, "w1_0": 0.0, "w2_0": 0.0, "torque_pieces": [(0.0, 62.0)], "lag": 0.0,
    "rate": math.inf, "u0": 0.0, "t_end": 1.0,
}  # fmt: skip


def kinds(run: Start) -> list[str]:
    return [kind for _, kind in run.events]


@pytest.mark.parametrize(
    ("theta0", "peak", "events", "twist"),
    [
        (0.0, 257.18400593175536, 20, 0.082380438497258424),
        (-1.0, 336.94171218858844, 16, -0.99664341243459861),
    ],
)
def test_the_50_digit_anchors(theta0, peak, events, twist):
    # rtol 1e-12 a step; about 100 steps and 10 impacts later the twist is good to some 1e-11
    run = integrate(**CRANE | {"theta0": theta0})
    assert run.peak == pytest.approx(peak, rel=1e-12)
    assert len(run.events) == events
    assert run.theta == pytest.approx(twist, abs=1e-10)
    # energy: the constant torques work along the angles, the spring keeps what it is given
    phi1, z = run.theta - theta0 + run.phi2, max(0.0, abs(run.theta) - 1.0)
    kinetic = (0.035 * run.w1**2 + 0.175 * run.w2**2) / 2
    assert kinetic + 368.465 * z**2 / 2 == pytest.approx(62.0 * phi1 - 7.16 * run.phi2, rel=1e-10)


@pytest.mark.parametrize("seed", range(8))
def test_a_finer_tolerance_changes_nothing(seed):
    case = random_case(np.random.default_rng(seed))
    run, finer = integrate(**case, rtol=1e-11), integrate(**case, rtol=1e-13)
    assert kinds(run) == kinds(finer)
    assert run.peak == pytest.approx(finer.peak, rel=1e-10)
    for (t, _), (t_finer, _) in zip(run.events, finer.events, strict=True):
        assert t == pytest.approx(t_finer, abs=1e-9 * case["t_end"])


def test_gap_of_zero_is_a_linear_oscillator():
    J1, J2, c, d = 0.4, 5.6, 5895.0, 20.0
    changes = {"gap": 0.0, "law": "dead-zone", "Mc": 0.0, "theta0": 0.01, "torque_pieces": [(0.0, 0.0)]}
    run = integrate(**CRANE | changes | {"J1": J1, "J2": J2, "c": c, "d": d, "t_end": 0.3})
    mass = J1 * J2 / (J1 + J2)
    decay = d / (2 * mass)
    w = math.sqrt(c / mass - decay**2)
    expected = 0.01 * math.exp(-decay * 0.3) * (math.cos(0.3 * w) + decay / w * math.sin(0.3 * w))
    assert run.theta == pytest.approx(expected, abs=1e-12)
    assert run.peak == pytest.approx(c * 0.01, rel=1e-12)


def test_stuck_load_breaks_away_where_the_torque_passes_the_friction():
    run = integrate(**CRANE | {"kind": "reactive", "gap": 0.5, "t_end": 0.04})
    assert kinds(run) == ["closed", "load-starts"]
    closed, starts = (t for t, _ in run.events)
    B = math.sqrt(0.5 * 62 / 0.035) * math.sqrt(368.465 * 0.035)
    angle = math.sqrt(368.465 / 0.035) * (starts - closed)
    assert closed == pytest.approx(math.sqrt(0.5 * 0.035 / 62), rel=1e-12)
    assert 62 * (1 - math.cos(angle)) + B * math.sin(angle) == pytest.approx(7.16, rel=1e-9)
    held = integrate(**CRANE | {"kind": "reactive", "Mc": 300.0, "gap": 0.5, "t_end": 0.5})
    assert (held.w2, held.phi2, set(kinds(held))) == (0.0, 0.0, {"closed", "opened"})
