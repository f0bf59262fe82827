"""Is the oracle right? Known answers, conservation laws, a crude stepper, and itself at a finer tolerance."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.oracle import Start, integrate, random_case
from tests.oracle_torque import TorquePath

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


@pytest.mark.parametrize("seed", range(6))
def test_against_a_crude_stepper_without_events(seed):
    # The stepper is first order with 1e5 steps, so 1e-2 of the peak is its own error: this is about meaning.
    case = random_case(np.random.default_rng(1000 + seed)) | {"target": None}
    run = integrate(**case)
    peak, theta, u = crude(case, 100_000)
    size = max(run.peak, 1e-6 * case["c"])
    assert peak == pytest.approx(run.peak, abs=1e-2 * size)
    assert theta == pytest.approx(run.theta, abs=1e-2 * (size / case["c"] + case["gap"]))
    assert u == pytest.approx(run.u, abs=1e-3 * max(abs(torque) for _, torque in case["torque_pieces"]))


def crude(case: dict[str, Any], steps: int) -> tuple[float, float, float]:
    J1, J2, c, d, gap, Mc = (case[name] for name in ("J1", "J2", "c", "d", "gap", "Mc"))
    h, pieces = case["t_end"] / steps, list(case["torque_pieces"])
    demand = r = u = case["u0"]
    follow = -math.expm1(-h / case["lag"]) if case["lag"] else 1.0
    theta, w1, w2, peak = case["theta0"], case["w1_0"], case["w2_0"], 0.0
    for i in range(steps):
        while pieces and i * h >= pieces[0][0]:
            demand = pieces.pop(0)[1]
        r += min(max(demand - r, -case["rate"] * h), case["rate"] * h)
        u += (r - u) * follow
        side = math.copysign(1.0, theta)
        z, v, T = side * theta - gap / 2, w1 - w2, 0.0
        if z > 0:
            damping = min(c * z, d * side * v) if case["law"] == "modelica" else d * side * v
            T = c * z + damping if case["law"] == "dead-zone" else max(0.0, c * z + damping)
        T *= side
        peak = max(peak, abs(T))
        friction = Mc if case["kind"] == "active" else math.copysign(Mc, w2 if w2 != 0 else T)
        moves = case["kind"] == "active" or w2 != 0 or abs(T) > Mc
        w2_next = w2 + h * (T - friction) / J2 if moves else 0.0
        if case["kind"] == "reactive" and w2 * w2_next < 0 and abs(T) <= Mc:
            w2_next = 0.0
        w1 += h * (u - T) / J1
        theta += h * (v + w1 - w2_next) / 2
        w2 = w2_next
    return peak, theta, u


@pytest.mark.parametrize(("lag", "rate"), [(0.02, 300.0), (0.02, math.inf), (0.0, 300.0)])
def test_torque_path_solves_the_limiter_and_the_lag(lag, rate):
    path = TorquePath([(0.1, 50.0), (0.2, -10.0), (0.5, 40.0)], lag, rate, 5.0, 1.0)
    assert (path.spans[0][0], path.spans[-1][1]) == (0.0, 1.0)
    u = 5.0
    for span, after in itertools.pairwise([*path.spans, None]):
        start, end, reference, slope, _ = span
        assert lag == 0 or path.torque(start, span)[0] == pytest.approx(u, rel=1e-12)
        assert math.isinf(rate) or abs(slope) in (0, rate)
        if lag > 0:

            def follow(t, y, span=span):
                return [(span[2] + span[3] * (t - span[0]) - y[0]) / lag]

            solved = solve_ivp(follow, (start, end), [u], method="DOP853", rtol=1e-12, atol=1e-12)
            assert path.torque(end, span)[0] == pytest.approx(solved.y[0, -1], abs=1e-9)
        u = path.torque(end, span)[0]
        if after is not None and not math.isinf(rate):
            assert reference + slope * (end - start) == pytest.approx(after[2], abs=1e-12)


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


def test_load_that_is_thrown_back_reverses_without_resting():
    # the load runs against the shaft: its speed passes zero while |T| > Mc
    run = integrate(**CRANE | {"kind": "reactive", "gap": 0.1, "J2": 0.01, "w2_0": -40.0, "t_end": 0.02})
    t = [time for time, kind in run.events if kind.startswith("load")]
    assert kinds(run)[:3] == ["closed", "load-stops", "load-starts"]
    assert t[0] == t[1]
    assert run.w2 > 0


def test_start_on_a_flank():
    assert integrate(**CRANE | {"theta0": 1.0, "t_end": 0.01}).events == [(0.0, "closed")]
    assert integrate(**CRANE | {"theta0": -1.0, "t_end": 0.01}).events == []
    # pushed into it from rest by a torque that only begins to grow
    growing = CRANE | {"theta0": 1.0, "kind": "reactive", "lag": 0.01, "t_end": 0.003}
    assert integrate(**growing).events[0] == (0.0, "closed")
    # in contact there is no event, and damping acts at once
    pressed = integrate(**CRANE | {"theta0": 1.1, "d": 2.0, "w1_0": 5.0, "t_end": 1e-3})
    assert pressed.events == []
    assert pressed.peak >= 368.465 * 0.1 + 2 * 5


def test_no_pull_flank_lets_go_with_overlap_and_takes_hold_again():
    # Strong damping and a motor that turns back and forth: T ends while z > 0, and rises again before z < 0.
    pieces = [(0.0, 62.0), (0.3, -400.0), (0.301, 300.0)]
    run = integrate(**CRANE | {"d": 12.0, "theta0": 1.0, "torque_pieces": pieces, "t_end": 0.35})
    assert kinds(run) == ["closed", "opened", "closed"]
    closed = run.events[2][0]
    assert 0.3 < run.events[1][0] < closed
    held = integrate(**CRANE | {"d": 12.0, "theta0": 1.0, "torque_pieces": pieces, "t_end": closed})
    assert held.theta > 1.0
    assert pytest.approx(0.0, abs=1e-9) == held.T


def test_dead_zone_pulls_and_modelica_limits_damping_by_the_spring():
    pulled = CRANE | {
        "d": 6.0,
        "law": "dead-zone",
        "theta0": 1.0,
        "torque_pieces": [(0.0, 62.0), (0.3, -600.0)],
    }
    opened = integrate(**pulled | {"t_end": 0.305}).events[1]
    assert opened[1] == "opened"
    assert integrate(**pulled | {"t_end": opened[0] * (1 - 1e-9)}).T < -10.0
    hard = CRANE | {"d": 6.0, "law": "modelica", "t_end": 0.034}
    just_in = integrate(**hard | {"t_end": integrate(**hard).events[0][0] + 1e-5})
    assert pytest.approx(2 * 368.465 * (just_in.theta - 1.0), rel=1e-12) == just_in.T


def test_mirror_image():
    case = CRANE | {"d": 1.0, "kind": "reactive", "gap": 0.4, "theta0": 0.1, "w1_0": 3.0, "w2_0": 1.0}
    mirrored = case | {"theta0": -0.1, "w1_0": -3.0, "w2_0": -1.0, "torque_pieces": [(0.0, -62.0)]}
    run, image = integrate(**case), integrate(**mirrored)
    assert run.events == image.events
    assert (image.theta, image.peak) == (-run.theta, run.peak)
