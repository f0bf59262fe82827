"""Other objectives and bounds, torque-speed curves, smooth torque, sweeps; by theory and by `march`."""

from __future__ import annotations

import numpy as np
import pytest
from tests.softstart.optimal.test_collocation_march import march

from softstart import Drive, optimize
from softstart.optimal import momentum
from softstart.optimal.collocation.search import solve
from softstart.optimal.exact import heat_of, replay
from softstart.optimal.problem import Problem

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


@pytest.fixture(scope="module")
def gentle():
    """The optimum in 0.2883 s, with which others are compared."""
    return solve(Problem(CRANE, start_time=0.2883))


def least_heat(drive, t_f):
    """Momentum (J1 + J2) target = integral of u - Mc, and Cauchy-Schwarz: no active-load start heats less."""
    mean = (drive.J1 + drive.J2) * drive.target_speed / t_f + drive.Mc
    return mean**2 * t_f / drive.Ms**2


def test_least_heat_lies_a_little_above_what_momentum_demands():
    # a stiff shaft without a gap is nearly one mass, for which constant torque is best
    drive = CRANE.replace(gap=0.0, stiffness=2000.0)
    candidate = solve(Problem(drive, start_time=0.3, minimise="heat"))
    bound = least_heat(drive, 0.3)
    assert bound < candidate.claimed < 1.02 * bound
    path = march(drive, candidate.profile, candidate.end_time)
    assert path.heat == pytest.approx(candidate.claimed, rel=1e-4)
    assert path.w2 == pytest.approx(60.0, rel=3e-6)


@pytest.mark.slow
def test_a_bound_on_k_dyn_costs_heat_and_is_kept():
    free = solve(Problem(CRANE, start_time=0.2883, minimise="heat"), max_refinements=1)
    bound = solve(Problem(CRANE, start_time=0.2883, minimise="heat", k_dyn=0.95), max_refinements=2)
    assert least_heat(CRANE, 0.2883) < free.claimed < bound.claimed
    run = replay(CRANE, bound.profile, bound.end_time)
    assert run.k_dyn == pytest.approx(0.95, rel=1e-3)
    assert run.k_dyn <= 0.95 * (1.0 + 1e-6)
    assert heat_of(run, bound.end_time) == pytest.approx(bound.claimed, rel=1e-4)


@pytest.mark.parametrize("load_kind", ["active", pytest.param("reactive", marks=pytest.mark.slow)])
def test_the_heat_has_a_lower_bound_behind_a_lag_and_with_friction_too(load_kind):
    """On the conveyor's like the mesh was off by 0.17 % in a K_dyn that was to be kept."""
    drive = CRANE.replace(torque_lag=0.004, damping=0.5, load_kind=load_kind)
    best = optimize(drive, "1.3x", minimise="heat", k_dyn=1.0)
    assert best.k_dyn <= 1.0 + 1e-6
    assert best.heat_at_least == momentum.least_heat(best.problem)
    assert 0.85 * best.heat < best.heat_at_least < best.heat
    assert best.gap_percent == pytest.approx(100.0 * (best.heat / best.heat_at_least - 1.0))
    if load_kind == "active":
        assert best.heat_at_least == pytest.approx(least_heat(drive, best.problem.start_time), rel=1e-9)
    else:  # friction takes Mc only while the load moves, no sooner than at the largest T
        moves = drive.J2 * drive.target_speed / (best.problem.base_torque - drive.Mc)
        impulse = (drive.J1 + drive.J2) * drive.target_speed + drive.Mc * moves
        exact = impulse**2 / best.problem.start_time / drive.Ms**2
        assert best.heat_at_least == pytest.approx(exact, rel=1e-9)


@pytest.mark.slow
def test_a_bound_on_heat_costs_k_dyn_and_is_kept():
    gentle = solve(Problem(CRANE, start_time=0.32), max_refinements=1)
    run = replay(CRANE, gentle.profile, gentle.end_time)
    allowed = 0.99 * heat_of(run, gentle.end_time)
    cool = solve(Problem(CRANE, start_time=0.32, heat=allowed), max_refinements=2)
    assert cool.claimed > gentle.claimed
    assert march(CRANE, cool.profile, cool.end_time).heat <= allowed * (1 + 1e-5)


def test_least_start_time_under_a_k_dyn_is_the_inverse_of_least_k_dyn_under_a_start_time():
    k_dyn = solve(Problem(CRANE, start_time=0.26), max_refinements=2).claimed
    quick = solve(Problem(CRANE, minimise="start_time", k_dyn=k_dyn), max_refinements=2)
    assert quick.claimed == pytest.approx(0.26, rel=1e-4)
    assert quick.claimed == quick.end_time
    path = march(CRANE, quick.profile, quick.end_time)
    assert path.peak / Problem(CRANE, start_time=0.26).base_torque == pytest.approx(k_dyn, rel=3e-4)


@pytest.mark.slow
def test_a_torque_speed_curve_is_obeyed_all_along_and_costs():
    corners = ((0.0, 62.0), (30.0, 62.0), (70.0, 30.0))
    problem = Problem(CRANE, start_time=0.33, torque_speed=corners)
    candidate = solve(problem, max_refinements=1)
    path = march(CRANE, candidate.profile, candidate.end_time)
    allowed = np.minimum(62.0, 62.0 - 0.8 * (path.w1 - 30.0))
    assert np.max(path.torque - allowed) <= 2e-3 * 62.0
    on_the_slope = (path.w1 > 40.0) & (np.abs(path.torque - allowed) < 1e-3 * 62.0)
    assert on_the_slope.any()
    assert path.w2 == pytest.approx(60.0, rel=3e-6)
    assert candidate.claimed > solve(Problem(CRANE, start_time=0.33)).claimed * (1 + 1e-3)


@pytest.mark.slow
def test_smoothness_makes_the_demand_continuous_and_costs_the_more_the_more_it_weighs(gentle):
    k_dyn = [gentle.claimed]
    rough = []
    for weight in (3e-5, 3e-4):
        candidate = solve(Problem(CRANE, start_time=0.2883, smoothness=weight), max_refinements=0)
        profile = candidate.profile
        assert profile.torque[0] == 0.0
        assert np.all(np.diff(profile.time) > 0.0)
        k_dyn.append(candidate.claimed)
        rough.append(float(np.sum(np.diff(profile.torque) ** 2 / np.diff(profile.time))))
    assert k_dyn[0] < k_dyn[1] < k_dyn[2] < 1.1 * k_dyn[0]
    assert rough[0] > rough[1]


def test_along_a_sweep_a_full_warm_start_needs_fewer_iterations_and_k_dyn_falls(gentle):
    times = (0.2889, 0.2895)
    warm = gentle.warm
    found, warm_iterations, cold_iterations = [], 0, 0
    for start_time in times:
        problem = Problem(CRANE, start_time=start_time)
        candidate = solve(problem, warm=warm)
        cold = solve(problem)
        assert candidate.claimed == pytest.approx(cold.claimed, rel=2e-4)
        assert "warm" in candidate.note
        warm = candidate.warm
        warm_iterations += warm.iterations
        cold_iterations += cold.warm.iterations
        found.append(candidate.claimed)
    assert warm_iterations < 0.7 * cold_iterations
    assert np.all(np.diff(found) < 0.0)


def test_a_warm_start_of_another_class_is_left_aside():
    other = solve(Problem(CRANE.replace(gap=0.0), start_time=0.2883), max_refinements=0)
    assert "cold" in solve(Problem(CRANE, start_time=0.2883), warm=other.warm, max_refinements=0).note
