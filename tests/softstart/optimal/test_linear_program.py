"""The linear program against the closed form, the exact plant, its own refinement and its dual."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from softstart import Drive, optimize
from softstart.errors import InputError
from softstart.optimal import pulse_coast_hold
from softstart.optimal.certificate import _Dual, _Envelope
from softstart.optimal.exact import replay
from softstart.optimal.lp import ideal
from softstart.optimal.lp.ideal import Answer, ContactProgram
from softstart.optimal.lp.motion import Contact, entry_of
from softstart.optimal.lp.rows import Limits, Sparse, WarmStarts, highs
from softstart.optimal.problem import Problem, Terminal

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


@pytest.mark.parametrize("limit", [0.2, 0.45, 5.0])
def test_a_warm_start_finds_the_same(limit: float) -> None:
    """Also of a program without a solution, and of one with a variable and a limit more."""
    rng = np.random.default_rng(7)
    A, none = rng.uniform(0.1, 1.0, (30, 20)), np.zeros(0)
    cost, box = -rng.uniform(0.5, 1.0, 20), np.tile([0.0, 1.0], (20, 1))
    no_rows, warm = Sparse.stacked([]), WarmStarts()
    rows = Sparse.dense(A)
    assert Limits(cost, rows, np.full(30, 1.0), no_rows, none).solved(box, warm) is not None
    after = Limits(cost, rows, np.full(30, limit), no_rows, none).solved(box, warm)
    truth = linprog(cost, A, np.full(30, limit), bounds=box)
    assert after is not None
    assert after.cost == pytest.approx(truth.fun, rel=1e-9)
    np.testing.assert_allclose(after.above, truth.ineqlin.marginals, atol=1e-9)
    assert Limits(cost, rows, np.full(30, -limit), no_rows, none).solved(box, warm) is None
    wider = np.vstack([np.hstack([A, np.ones((30, 1))]), np.ones((1, 21))])
    rights, costs = np.append(np.full(30, limit), 0.5), np.append(cost, -1.0)
    box = np.vstack([box, [-0.3, 0.3]])
    more = Limits(costs, Sparse.dense(wider), rights, no_rows, none).solved(box, warm)
    assert more is not None
    assert more.cost == pytest.approx(linprog(costs, wider, rights, bounds=box).fun, rel=1e-9)


@pytest.mark.skipif(
    highs is None, reason="before SciPy 1.15 HiGHS is reached through linprog, which goes to a corner"
)
def test_the_interior_answer_is_as_good_and_in_the_middle_of_all_the_best() -> None:
    """Where P alone costs, torques below it are free: a corner of the best ones has some at their limits."""
    one = np.eye(21)
    rows = np.vstack([np.hstack([sign * one, -np.ones((21, 1))]) for sign in (1.0, -1.0)])
    given = np.concatenate([[1.0], np.zeros(21)])[None, :]
    program = Limits(
        np.append(np.zeros(21), 1.0), Sparse.dense(np.vstack([rows, -given])), np.append(np.zeros(42), -0.5),
        Sparse.stacked([]), np.zeros(0),
    )  # fmt: skip
    box = np.array([[-1.0, 1.0]] * 21 + [[0.0, np.inf]])
    corner, middle = (program.solved(box, interior=inside) for inside in (False, True))
    assert corner is not None
    assert middle is not None
    assert corner.cost == pytest.approx(0.5, abs=1e-9)
    assert middle.cost == pytest.approx(0.5, abs=1e-6)
    assert np.abs(corner.x[1:21]).max() == pytest.approx(0.5)
    assert np.abs(middle.x[1:21]).max() < 0.25


@pytest.mark.parametrize("given", [{}, {"start_position": -0.25, "load_torque": 12.0}])
def test_pulse_coast_hold_comes_out(given: dict[str, float]) -> None:
    problem = Problem(CRANE.replace(**given), 0.33)
    best = ideal.search(problem)
    assert best is not None
    truth = pulse_coast_hold.solve(problem).claimed
    assert best.P / problem.base_torque == pytest.approx(truth, rel=3e-4)  # T stays 2e-4 Ms above 0
    assert best.P / problem.base_torque >= truth * (1.0 - 1e-5)


CASES: dict[str, tuple[dict[str, Any], float, Terminal]] = {
    "bang-bang": ({}, 0.2522662, "synchronous"),
    "reached": ({}, 0.2522662, "reached"),
    "steady": ({}, 0.3, "steady"),
    "damped": ({"damping": 0.5}, 0.27, "synchronous"),
    "dead-zone": ({"damping": 0.5, "contact_law": "dead-zone"}, 0.27, "synchronous"),
    "reactive": ({"load_kind": "reactive"}, 0.27, "synchronous"),
}


@pytest.mark.parametrize(("given", "end", "terminal"), CASES.values(), ids=CASES)
def test_the_exact_plant_agrees(given: dict[str, Any], end: float, terminal: Terminal) -> None:
    problem = Problem(CRANE.replace(**given), end, terminal)
    best = ideal.search(problem)
    assert best is not None
    run = replay(problem.drive, ideal.assemble(problem, best), best.end_time)
    assert best.end_time <= end * (1.0 + 1e-12)
    assert run.contacts == 1
    state = run.at(best.end_time)
    assert state["w2"] == pytest.approx(problem.target, rel=1e-6)
    if terminal != "reached":
        assert run.peak_torque == pytest.approx(best.P, rel=2e-4)
        assert state["v"] == pytest.approx(0.0, abs=1e-6 * problem.target)
    assert run.peak_torque <= best.P * (1.0 + 2e-4)
    if terminal == "steady":
        assert state["T"] == pytest.approx(float(problem.drive.Mc), abs=1e-6 * problem.highest_torque)


def test_finer_grids_converge() -> None:
    """Every torque on a grid is one on a grid twice as fine, checked twice as often: P falls, ever less."""
    problem = Problem(CRANE, 0.2522662)
    peaks = []
    for steps in (20, 40, 80, 160):
        answer = ContactProgram(problem, 0.2355, steps, None, (0.25, 0.5, 0.75, 1.0), 0.0).solve(0.0167662)
        assert isinstance(answer, Answer)
        peaks.append(answer.P)
    changes = np.abs(np.diff(peaks))
    assert changes[-1] < 2e-3 * peaks[-1]
    assert changes[-1] < changes[0]


@pytest.mark.parametrize(("given", "end", "terminal"), CASES.values(), ids=CASES)
def test_no_answer_is_below_its_own_dual(given: dict[str, Any], end: float, terminal: Terminal) -> None:
    problem = Problem(CRANE.replace(**given), end, terminal)
    entry, contact = entry_of(problem), Contact.of(problem.drive)
    te = 1.05 * entry.earliest
    low, high = float(entry.slowest(np.array([te]))[0]), float(entry.fastest(np.array([te]))[0])
    answer = ContactProgram(problem, end - te, 120).solve(te)
    assert isinstance(answer, Answer)
    assert low - 1e-9 <= answer.v <= high + 1e-9
    assert answer.levels.min() >= -1e-9
    assert answer.levels.max() <= problem.highest_torque * (1.0 + 1e-9)
    dual = _Dual(problem, entry, answer.multipliers, _Envelope(contact, 1.5 * end), high, end - te)
    fixed, by_v = dual.at(answer.end_time - te)
    missing = problem.target - float(entry.load_speed(np.array([te]))[0])
    D = fixed + min(by_v * low, by_v * high) + answer.multipliers.speed * missing
    assert D <= answer.P * (1.0 + 1e-6)
    assert D >= answer.P * 0.95  # the gap that is left belongs to the grid


def test_what_is_not_linear_is_refused() -> None:
    for given, words in (
        ({"torque_lag": 0.01}, "jump freely"),
        ({"minimum_torque": -5.0}, "brake"),
        ({"damping": 0.5, "contact_law": "modelica"}, "modelica"),
    ):
        with pytest.raises(InputError, match=words):
            ideal.solve(Problem(CRANE.replace(**given), 0.3))
    with pytest.raises(InputError, match="the least heat, and only K_dyn is linear"):
        ideal.solve(Problem(CRANE, 0.3, minimise="heat"))


def test_where_a_finer_grid_has_no_answer_the_last_one_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """The answer kept belongs to the grid it was found on; cutting goes on from that one."""
    problem = Problem(CRANE, 0.2883042)
    moved, calls = ideal._moved, []

    def once(problem, entry, best, grid, width, within):
        calls.append(grid.size)
        return moved(problem, entry, best, grid, width, within) if len(calls) == 1 else best

    monkeypatch.setattr(ideal, "_moved", once)
    found = ideal.search(problem)
    assert found is not None
    assert len(calls) > 2
    assert found.edges.size == calls[0]


def test_the_profile_keeps_the_limits_that_the_solver_keeps_to_its_tolerance_only():
    """Here HiGHS answers with Ms + 6e-6 N m; the profile that was checked has to stay within Ms."""
    drive = Drive.load("crane-4amtkf").replace(target_speed=60.0, gap=2.0, load_inertia=0.1225)
    best = optimize(drive, 0.2527, terminal="reached")
    assert best.method == "lp"
    assert best.profile.torque.max() <= drive.Ms
    assert best.k_dyn_lower_bound <= best.k_dyn <= 1.001 * best.k_dyn_lower_bound
