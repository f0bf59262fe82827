"""The collocation's starts, each integrated anew by `march`: they end where they say, within all limits."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tests.softstart.optimal.test_collocation_march import march

from softstart import Drive
from softstart.errors import InputError
from softstart.optimal.collocation import search as collocation
from softstart.optimal.collocation.search import solve
from softstart.optimal.exact import replay
from softstart.optimal.problem import Problem, Terminal
from softstart.optimal.result import NotConverged
from softstart.profile import TorqueProfile

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
SWITCHES = 0.2522662  # s: bang-bang


@lru_cache
def solved(problem):
    # two finer meshes are enough for what is asked here, except for the many switches of the second anchor
    return solve(problem, max_refinements=5 if problem.start_time == SWITCHES else 2)


def checked(problem):
    """The candidate and its independent integration, with everything that any start must keep."""
    candidate = solved(problem)
    drive = problem.drive
    profile, end = candidate.profile, candidate.end_time
    path = march(drive, profile, end)
    assert problem.start_time is None or end <= problem.start_time * (1 + 1e-8)
    assert path.w2 == pytest.approx(problem.target, rel=3e-6)
    if problem.terminal != "reached":
        assert path.v == pytest.approx(0.0, abs=3e-6 * problem.target)
    assert path.opened == 0
    demand = profile.at(np.linspace(0.0, end, 5000))
    assert demand.min() >= problem.lowest_torque - 1e-9
    assert demand.max() <= problem.highest_torque + 1e-9
    run = replay(drive, profile, end)
    assert run.peak_torque == pytest.approx(path.peak, rel=1e-4)
    assert run.contacts == 1
    return candidate, path


# Optima of issue 3: the first by the closed form pulse-coast-hold, the second by linear programs.
@pytest.mark.parametrize(
    ("start_time", "k_dyn"),
    [(0.2883042, 0.90924724), pytest.param(0.2522662, 1.4564, marks=pytest.mark.slow)],
)
def test_the_two_anchors_of_the_crane_drive_are_met_within_a_thousandth(start_time, k_dyn):
    candidate, path = checked(Problem(CRANE, start_time=start_time))
    problem = Problem(CRANE, start_time=start_time)
    assert replay(CRANE, candidate.profile, start_time).k_dyn == pytest.approx(k_dyn, rel=1e-3)
    assert path.peak / problem.base_torque == pytest.approx(candidate.claimed, rel=2e-4)


def test_the_first_anchor_is_a_pulse_a_coast_and_a_hold():
    candidate, path = checked(Problem(CRANE, start_time=0.2883042))
    P = candidate.claimed * Problem(CRANE, start_time=0.2883042).base_torque
    u_eq = (P * (CRANE.J1 + CRANE.J2) - CRANE.Mc * CRANE.J1) / CRANE.J2
    assert pytest.approx(P, rel=1e-3) == path.T
    assert candidate.profile.at([0.001, 0.2, 0.27]) == pytest.approx([62.0, u_eq, u_eq], rel=2e-3)
    assert path.torque.min() == pytest.approx(0.0, abs=1e-4 * 62.0)


DRIVES = {
    "damped": ({"damping": 0.3}, 0.2883),
    "dead-zone": ({"damping": 0.3, "contact_law": "dead-zone"}, 0.2883),
    "modelica": ({"damping": 0.3, "contact_law": "modelica"}, 0.2883),
    "reactive": ({"load_kind": "reactive"}, 0.2883),
    "reactive and damped": ({"load_kind": "reactive", "damping": 1.0}, 0.27),
    "lag": ({"torque_lag": 0.002}, 0.29),
    "rate": ({"torque_rate": 2000.0}, 0.31),
    "lag and rate": ({"torque_rate": 2000.0, "torque_lag": 0.005}, 0.33),
    "no gap": ({"gap": 0.0}, 0.2883),
    "braking motor": ({"minimum_torque": -30.0}, 0.26),
}
QUICK = ("modelica", "reactive", "rate", "lag and rate", "braking motor")


@pytest.mark.parametrize(
    "name", [pytest.param(k, marks=() if k in QUICK else pytest.mark.slow) for k in DRIVES]
)
def test_every_kind_of_drive_ends_where_it_says_with_the_peak_it_claims(name):
    changes, start_time = DRIVES[name]
    problem = Problem(CRANE.replace(**changes), start_time=start_time)
    candidate, path = checked(problem)
    assert candidate.method == "collocation"
    assert path.peak / problem.base_torque == pytest.approx(candidate.claimed, rel=5e-4)


@pytest.mark.parametrize("name", ["rate", "lag and rate"])
def test_a_limited_rate_is_kept_and_used(name):
    changes, start_time = DRIVES[name]
    candidate, _ = checked(Problem(CRANE.replace(**changes), start_time=start_time))
    profile = candidate.profile
    assert profile.torque[0] == 0.0
    assert np.all(np.diff(profile.time) > 0.0)  # no steps
    slopes = np.abs(np.diff(profile.torque) / np.diff(profile.time))
    assert slopes.max() == pytest.approx(2000.0, rel=1e-6)


def test_a_reactive_load_rests_until_the_shaft_torque_exceeds_its_friction():
    problem = Problem(CRANE.replace(load_kind="reactive"), start_time=0.2883)
    _, path = checked(problem)
    assert path.load_moves > path.contact > 0.0
    # a load that is not turned back at first needs less: the reactive optimum lies below the active one
    assert solved(problem).claimed < solved(Problem(CRANE, start_time=0.2883042)).claimed


def test_what_a_motor_cannot_do_never_helps():
    ideal = solved(Problem(CRANE, start_time=0.29)).claimed
    assert solved(Problem(CRANE.replace(torque_lag=0.002), start_time=0.29)).claimed > ideal
    assert solved(Problem(CRANE, start_time=0.31)).claimed < (
        solved(Problem(CRANE.replace(torque_rate=2000.0), start_time=0.31)).claimed
    )


# ---- terminals -----------------------------------------------------------------------------------------


def test_steady_ends_with_the_torque_of_the_load():
    problem = Problem(CRANE, start_time=0.2883042, terminal="steady")
    candidate, path = checked(problem)
    assert pytest.approx(CRANE.Mc, abs=3e-6 * CRANE.Ms) == path.T
    assert candidate.claimed > solved(Problem(CRANE, start_time=0.2883042)).claimed


@pytest.mark.parametrize("lag", [0.0, 0.005])
def test_reached_keeps_its_peak_while_the_motor_coasts_afterwards(lag):
    drive = CRANE.replace(torque_lag=lag)
    problem = Problem(drive, start_time=0.27, terminal="reached")
    candidate, _path = checked(problem)
    coasting = candidate.profile.followed_by(candidate.end_time, TorqueProfile([0.0], [0.0]))
    after = march(drive, coasting, candidate.end_time + math.pi / drive.Omega)
    assert after.peak / problem.base_torque <= candidate.claimed * (1 + 3e-4)
    if lag == 0.0:
        assert candidate.claimed <= solved(Problem(drive, start_time=0.27)).claimed * (1 + 2e-4)


# ---- what does not depend on choices -------------------------------------------------------------------


def test_a_change_of_units_leaves_k_dyn_as_it_is():
    # time x 7, torque x 0.01
    t, m = 7.0, 0.01
    problem = Problem(CRANE, start_time=0.2883042)
    scaled = CRANE.replace(
        motor_inertia=CRANE.J1 * m * t**2,
        load_inertia=CRANE.J2 * m * t**2,
        stiffness=CRANE.c * m,
        load_torque=CRANE.Mc * m,
        starting_torque=CRANE.Ms * m,
        maximum_torque=CRANE.Ms * m,
        target_speed=60.0 / t,
    )
    other = solved(Problem(scaled, start_time=0.2883042 * t))
    assert other.claimed == pytest.approx(solved(problem).claimed, rel=2e-4)
    assert other.end_time == pytest.approx(solved(problem).end_time * t, rel=1e-6)


@pytest.mark.slow
def test_the_contact_from_which_the_search_begins_does_not_matter():
    problem = Problem(CRANE, start_time=SWITCHES)
    for contact in (0.016, 0.06):
        assert solve(problem, contact_guess=contact, max_refinements=2).claimed == pytest.approx(
            solved(problem).claimed, rel=1e-3
        )


def test_a_start_time_that_is_too_short_is_no_result():
    with pytest.raises(NotConverged, match="IPOPT") as caught:
        solve(Problem(CRANE, start_time=0.2))
    assert caught.value.violation > 1e-3
    assert caught.value.reason


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"start_position": -0.4}, "far flank"),
        ({"gap": 0.0, "initial_motor_speed": -1.0}, "initial_motor_speed"),
        ({"load_kind": "reactive", "damping": 1.0, "contact_law": "modelica"}, "modelica"),
    ],
)
def test_starts_of_no_known_class_are_refused_with_a_reason(changes, word):
    with pytest.raises(InputError, match=word):
        solve(Problem(CRANE.replace(**changes), start_time=0.3))


@pytest.mark.parametrize(
    ("given", "options"),
    [
        ({}, {}),
        pytest.param(
            {"torque_lag": 0.005, "damping": 0.5, "torque_rate": 2500.0},
            {"terminal": "reached"},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_program_of_casadi_is_that_of_the_method(given: dict[str, float], options: Any) -> None:
    """Solved by IPOPT with its own settings on the first mesh; the method refines it."""
    problem = Problem(CRANE.replace(**given), 0.3, **options)
    one = problem.casadi()
    solver = ca.nlpsol("solver", "ipopt", one.nlp, {"ipopt.print_level": 0, "print_time": False})
    x = solver(x0=one.x0, p=one.p, lbx=one.lbx, ubx=one.ubx, lbg=one.lbg, ubg=one.ubg)["x"]
    assert len(one.slots) == x.shape[0] == one.lbx.size
    assert one.k_dyn(x) == pytest.approx(solved(problem).claimed, rel=1e-3)
    assert replay(problem.drive, one.profile(x), 0.3).k_dyn == pytest.approx(one.k_dyn(x), rel=2e-3)
    with pytest.raises(InputError, match="x: 3 numbers"):
        one.k_dyn([0.0, 1.0, 2.0])


@pytest.mark.parametrize(("start_time", "lag"), [(0.4, 0.0), (0.4, 0.003)])
def test_the_exact_plant_keeps_the_torque_speed_curve(start_time: float, lag: float) -> None:
    """Between its points the first mesh is above the curve; the claim is that of the start below it."""
    curve = ((0.0, 62.0), (30.0, 60.0), (80.0, 20.0))
    terminal: Terminal = "reached" if lag else "synchronous"
    problem = Problem(CRANE.replace(torque_lag=lag), start_time, terminal, torque_speed=curve)
    solution, _ = collocation._first(problem, collocation._contacts(problem, None)[0])
    before = collocation.replayed(problem, collocation.claim(problem, solution))
    assert before.excess > 1e-5 * CRANE.Ms
    lower, _ = collocation._aimed_inside(problem, solution, before)
    after = collocation.claim(problem, lower)
    assert collocation.replayed(problem, after).excess < 5e-7 * CRANE.Ms
    assert 1.0 <= after.value / collocation.claim(problem, solution).value < 1.001
