"""The CasADi statement of an optimal start: against closed forms, descents and the exact plant."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from tests.softstart.optimal.drives import CRANE, played, random_drive, three_masses

from softstart import Drive, InputError, TorqueProfile, optimize, simulate
from softstart.optimal.check import BEYOND, torque_allowed
from softstart.optimal.problem import Problem
from softstart.optimal.result import NotConverged, heat_of
from softstart.optimal.statement import as_casadi, phases_of, solve_collocation

WITHIN = 2e-3  # what a demand of straight lines, halved beside its jumps, may cost
EXACT = 1e-3  # the collocation against the exact plant: the peak between its points
TWO_GAPS = 5e-3  # the same where contacts are shorter than its intervals


def guess(hold: float, start_time: float, drive: Any = CRANE):
    """A pulse, a coast, and a torque that is held: a run whose order of contacts is that of most optima."""
    profile = TorqueProfile.steps([0.0, 0.0076, 0.0359, 1.0], [62.0, 0.0, hold])
    return played(drive, profile, start_time + 1.001 * drive.elastic_period)


def checked(problem, run, straight=False, between=EXACT):
    """The claim, and its exact run, with what every start must keep."""
    claim = solve_collocation(problem, run, straight)
    exact = played(problem.drive, claim.profile, claim.end_time + run.elastic_period)
    end = exact.trajectory.at([claim.end_time])
    w = end["w"][0] / problem.target
    if problem.terminal == "reached":
        assert w[int(exact.trajectory.input.machine.load)] >= 1.0 - 1e-6
    else:
        np.testing.assert_allclose(w, 1.0, atol=1e-5)
    assert problem.start_time is None or claim.end_time <= problem.start_time * (1.0 + 1e-7)
    assert claim.profile.torque.min() >= problem.lowest_torque
    assert claim.profile.torque.max() <= problem.highest_torque
    value = {"k_dyn": exact.k_dyn, "start_time": claim.end_time}.get(problem.minimise)
    value = value or heat_of(exact, claim.end_time)
    assert value == pytest.approx(claim.value, rel=between)
    if problem.torque_speed:
        state = exact.trajectory.at(np.linspace(0.0, exact.end_time, 2000))
        over = state["u"] - torque_allowed(problem, state["w"][:, exact.drive.motor_index])
        assert over.max() <= BEYOND * problem.highest_torque
    return claim, exact


# [G]'s drive: the first by the closed form pulse, coast, hold, the second by linear programs
@pytest.mark.parametrize(
    ("start_time", "k_dyn", "straight"),
    [
        (0.2883042, 0.90924724, False),
        pytest.param(0.2883042, 0.90924724, True, marks=pytest.mark.slow),
        pytest.param(0.2522662, 1.4564, False, marks=pytest.mark.slow),
    ],
)
def test_the_two_anchors_are_met_from_a_rough_guess(start_time, k_dyn, straight):
    """The first one is a pulse, a coast, and the torque that holds its peak."""
    claim, _ = checked(Problem(CRANE, start_time), guess(56.0, start_time), straight)
    assert claim.value == pytest.approx(k_dyn, rel=WITHIN)
    if k_dyn < 1.0:
        P = claim.value * Problem(CRANE, start_time).base_torque
        u_eq = (P * (CRANE.J1 + CRANE.J2) - CRANE.Mc * CRANE.J1) / CRANE.J2
        assert claim.profile.at([0.001, 0.2, 0.27]) == pytest.approx([62.0, u_eq, u_eq], rel=2e-3)


def refound(best):
    """The answer run to one elastic period after its start time, however early it is."""
    until = (best.problem.start_time or best.end_time) + 1.001 * best.run.elastic_period
    return played(best.problem.drive, best.profile, until)


CASES: dict[str, tuple[dict[str, Any], dict[str, Any], float | None]] = {
    "steady": ({}, {"terminal": "steady"}, 0.2883042),
    "reached, lag": ({"torque_lag": 0.005}, {"terminal": "reached"}, 0.27),
    "reactive, damped": ({"load_kind": "reactive", "damping": 1.0}, {}, 0.27),
    "dead-zone": ({"damping": 0.3, "contact_law": "dead-zone"}, {}, 0.2883),
    "lag and rate": ({"torque_rate": 2000.0, "torque_lag": 0.005}, {}, 0.33),
    "braking motor": ({"minimum_torque": -30.0}, {}, 0.26),
    "heat": ({}, {"minimise": "heat"}, 0.2883),
    "K_dyn under a heat": ({}, {"heat": 0.2}, 0.32),
    "start time under a K_dyn": ({}, {"minimise": "start_time", "k_dyn": 1.2}, None),
    "curve": ({}, {"torque_speed": ((0.0, 62.0), (30.0, 62.0), (70.0, 30.0))}, 0.33),
    "smooth": ({}, {"smoothness": 3e-5}, 0.2883),
}
QUICK = ("reactive, damped",)


@pytest.mark.parametrize(
    "name", [pytest.param(k, marks=() if k in QUICK else pytest.mark.slow) for k in CASES]
)
def test_every_class_agrees_with_the_optimum_found_otherwise(name):
    changes, options, start_time = CASES[name]
    best = optimize(CRANE.replace(**changes), start_time, **options)
    claim, exact = checked(best.problem, refound(best))
    value = {"k_dyn": best.k_dyn, "heat": best.heat, "start_time": best.end_time}[best.problem.minimise]
    if best.problem.minimise == "heat":  # the descent is at its lower bound there, the statement beside it
        assert best.heat_at_least < value <= claim.value * (1.0 + WITHIN)
    else:
        assert claim.value == pytest.approx(value, rel=WITHIN)
    if best.problem.k_dyn is not None:
        assert exact.k_dyn <= best.problem.k_dyn * (1.0 + EXACT)
    if best.problem.heat is not None:
        assert heat_of(exact, claim.end_time) <= best.problem.heat * (1.0 + 1e-6)
    if best.problem.smoothness or np.isfinite(best.problem.drive.torque_rate):
        assert claim.profile.torque[0] == 0.0  # no step anywhere: its knots at one instant are equal
        assert np.abs(np.diff(claim.profile.torque))[np.diff(claim.profile.time) == 0.0].max() == 0.0


# classes by seed: 13 rate, braking; 28 lag, rate; 33 lag, curve; 36 reactive, ideal
@pytest.mark.parametrize("seed", [13, *(pytest.param(k, marks=pytest.mark.slow) for k in (28, 33, 36))])
def test_random_drives_agree_with_the_linear_programs(seed):
    rng = np.random.default_rng(seed)
    drive, options = random_drive(rng)
    best = optimize(drive, "1.3x", **options)
    claim, _ = checked(best.problem, refound(best))
    assert claim.value == pytest.approx(best.k_dyn, rel=WITHIN)


@pytest.mark.parametrize(
    "changes", [{"torque_lag": 0.005}, pytest.param({"release": 0.05}, marks=pytest.mark.slow)], ids=str
)
def test_a_brake_holds_the_motor_first(changes):
    hoist = Drive.load("hoist-15kw").replace(
        start_position="hanging", brake="motor", target_speed=50.0, **changes
    )
    best = optimize(hoist, "1.2x")
    run = refound(best)
    claim, exact = checked(best.problem, run)
    assert phases_of(best.problem, run)[0].braked
    assert claim.value == pytest.approx(best.k_dyn, rel=WITHIN)
    assert exact.release_time == pytest.approx(best.run.release_time, rel=0.01)


# chains ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "terminal"),
    [
        ({}, "reached"),
        ({"kind": "reactive"}, "reached"),
        ({"law": "dead-zone"}, "reached"),
        ({}, "synchronous"),
    ],
)
def test_a_chain_agrees_with_the_linear_programs(given, terminal):
    best = optimize(three_masses(**given), 0.2, terminal=terminal)
    claim, _ = checked(best.problem, refound(best), between=TWO_GAPS)
    assert best.bound.k_dyn < claim.value
    if not given and terminal == "reached":
        assert claim.value == pytest.approx(0.844, rel=4e-3)
        assert best.k_dyn == pytest.approx(claim.value, rel=5e-3)
    else:
        assert best.k_dyn <= (1.0 + EXACT) * claim.value  # the statement may end beside it


def test_the_phases_are_those_of_the_record():
    run = simulate(three_masses(), "direct", 0.2 + three_masses().elastic_period)
    phases = phases_of(Problem(three_masses(), 0.2), run)
    assert phases[0].pressing == (0, 0)
    assert phases[0].end == pytest.approx(run.events[0].time, rel=1e-12)  # a gap closes
    np.testing.assert_allclose([a.end for a in phases[:-1]], [b.begin for b in phases[1:]], rtol=1e-9)
    assert [one.end for one in phases if one.last] == [0.2]
    assert len(phases) > 10
    assert phases[-1].end == pytest.approx(0.2 + run.elastic_period)
    for one in phases:
        T = run.at([0.5 * (one.begin + one.end)])["T"][0]
        assert np.sign(T).astype(int).tolist() == list(one.pressing)


# the program ----------------------------------------------------------------------------------------------


def test_the_program_is_one_for_any_solver():
    problem = Problem(CRANE, 0.3, "reached")
    one = as_casadi(problem, guess(56.0, 0.3), straight=True)
    solver = ca.nlpsol("s", "ipopt", one.nlp, {"ipopt.print_level": 0, "print_time": False})
    found = one.solution(solver(**one.arguments)["x"])
    assert found.end_time == pytest.approx(0.3, rel=1e-6)
    exact = played(CRANE, found.profile, 0.3 + CRANE.elastic_period)
    assert exact.k_dyn == pytest.approx(found.value, rel=WITHIN)
    assert found.value == found.peak / problem.base_torque
    with pytest.raises(InputError, match="x: 3 numbers"):
        one.solution([0.0, 1.0, 2.0])


def test_a_start_time_that_is_too_short_is_no_result():
    with pytest.raises(NotConverged) as caught:
        solve_collocation(Problem(CRANE, 0.2), guess(62.0, 0.2))
    assert caught.value.violation > 1e-3


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"law": "modelica"}, "contact_law = modelica"),
        ({"efficiency": 0.97}, "gears with losses"),
        ({"curve_speed": [0.0, 30.0], "curve_torque": [0.0, 10.0]}, "load curves"),
    ],
)
def test_what_it_does_not_cover_is_said(given, said):
    chain = three_masses(**given)
    with pytest.raises(InputError, match=said):
        as_casadi(Problem(chain, 0.2), simulate(chain, "direct", 0.4))
