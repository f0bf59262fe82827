"""The linear program of a step against the exact start, its grids and its end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from tests.softstart.optimal.drives import CRANE, CURVE, HELD, played, three_masses

from softstart.optimal import pulse_coast_hold, seeds
from softstart.optimal.demand import Demand
from softstart.optimal.descent import Descent, least_change
from softstart.optimal.model import Model
from softstart.optimal.problem import Problem
from softstart.optimal.search import Found
from softstart.optimal.starts import steady_shaft_torques

CASES: dict[str, Problem] = {
    "reached, lag": Problem(CRANE.replace(torque_lag=0.005), 0.29, "reached"),
    "steady, damped": Problem(CRANE.replace(damping=0.5), 0.3, "steady"),
    "heat": Problem(CRANE, 0.3, minimise="heat", k_dyn=1.0),
    "curve": Problem(CRANE.replace(torque_lag=0.003), 0.4, "reached", torque_speed=CURVE),
    "smooth": Problem(CRANE, 0.3, smoothness=3e-4),
    "rate": Problem(CRANE.replace(torque_rate=2000.0), 0.33, "reached"),
    "brake": Problem(HELD.replace(torque_lag=0.005), 0.3, "reached"),
    "chain": Problem(three_masses(), 0.2),
    "gaps": Problem(CRANE, 0.3, "reached", scenarios=(CRANE.replace(gap=0.6),)),
}


def of(problem: Problem) -> Descent:
    """The descents within the start time of a problem."""
    assert problem.start_time is not None
    return Descent(problem, problem.start_time)


def begun(search: Descent) -> Found:
    """A search some steps down: no optimum yet, and near no corner."""
    found = search.down(seeds.pulse_coast_level(search)[0], 2, 1e-3, dear=0.0)
    assert found is not None
    return found


@pytest.mark.parametrize("objective", ["own", "start_time"])
@pytest.mark.parametrize("name", CASES)
def test_what_a_small_step_promises_comes_true(name: str, objective: Any) -> None:
    """The model is right to first order; of peaks that it has not seen 1e-5 may come through."""
    problem = CASES[name]
    assert problem.start_time is not None
    search = Descent(problem, problem.start_time, None if objective == "own" else objective)
    found = begun(search)
    model, shares, penalty = Model(search, found), [], 20.0
    for trust in (1e-4, 3e-5):
        step = model.step(trust, penalty, 1e-5)
        assert step is not None
        change, later, promised = step
        knots = found.demand.time.size
        assert np.abs(change[:knots]).max() <= trust + 1e-6
        after = found.demand.changed(change)
        np.testing.assert_allclose(search.allowed(after).torque, after.torque, atol=1e-6 * search.high)
        tried = search.play(search.allowed(after), min(found.end + later, search.latest))
        assert tried is not None
        assert promised > 0.0
        shares.append(found.merit(penalty) - tried.merit(penalty) - promised)
    assert abs(shares[-1]) < 0.05 * promised + 5e-6 * found.merit(penalty), (shares, promised)


@pytest.mark.parametrize("rate", [700.0, 1500.0])
def test_the_end_is_met_where_the_rate_of_the_torque_is_at_its_limit(rate: float) -> None:
    """A knot that moves alone is brought back: knots at the limit move together."""
    search = of(Problem(CRANE.replace(torque_rate=rate, torque_lag=0.002), 0.33, "synchronous"))
    found = search.down(seeds.pulse_coast_level(search)[0])
    assert found is not None
    steep = rate * np.diff(found.demand.time) * (1.0 - 1e-9)
    assert (np.abs(np.diff(found.demand.torque)) >= steep).sum() > 3
    wide = search.play(search.allowed(found.demand.changed(np.full(found.demand.size, 1e-4))), found.end)
    assert wide is not None
    assert wide.lacking.max() > 1e-5
    done = search.finished(wide)
    assert done is not None
    assert done.ends


@pytest.mark.parametrize("terminal", ["reached", "synchronous", "steady"])
def test_finished_meets_the_end_by_the_smallest_changes(terminal: Any) -> None:
    problem = Problem(CRANE.replace(damping=0.3), 0.3, terminal)
    search = of(problem)
    found = search.down(seeds.pulse_coast_level(search)[0])
    assert found is not None
    done = search.finished(found)
    assert done is not None
    assert done.lacking.max() <= (0.0 if terminal == "reached" else 1e-10)
    assert np.abs(done.demand.torque - found.demand.torque).max() < 1e-2 * search.high
    assert done.peak == pytest.approx(found.peak, rel=1e-3)
    run = played(problem.drive, done.profile, done.end + 0.01)
    state = run.trajectory.at([done.end])
    if terminal == "reached":
        assert state["w"][0, 1] >= 60.0 * (1.0 - 1e-9)
    else:
        np.testing.assert_allclose(state["w"][0], 60.0, rtol=1e-9)
    if terminal == "steady":
        np.testing.assert_allclose(state["T"][0], steady_shaft_torques(run.trajectory.input), rtol=1e-6)


def test_the_smallest_change_is_that_of_least_squares_with_bounds() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        rows, wanted = rng.normal(size=(2, 12)), 3.0 * rng.normal(size=2)
        low, high = -rng.random(12), rng.random(12)
        found = least_change(rows, wanted, low, high)
        best = lsq_linear(
            np.vstack([1e4 * rows, 1e-3 * np.eye(12)]), np.append(1e4 * wanted, np.zeros(12)), (low, high)
        )
        assert (low <= found).all()
        assert (found <= high).all()
        if np.abs(rows @ best.x - wanted).max() < 1e-6:  # it can be met
            assert np.linalg.norm(found) <= 1.3 * np.linalg.norm(best.x) + 1e-6


@pytest.mark.parametrize("lag", [0.0, 0.004])
def test_how_a_start_answers_to_the_instants_of_steps(lag: float) -> None:
    """Against central differences of exact starts; through the contact."""
    search = of(Problem(CRANE.replace(torque_lag=lag, damping=0.2), 0.3, "reached"))
    time, torque = (
        [0.0, 0.008, 0.008, 0.021, 0.021, 0.09, 0.09, 0.4],
        [62.0, 62.0, 0.0, 5.0, 48.0, 48.0, 40.0, 45.0],
    )
    demand = search.demand(np.array(time), np.array(torque))
    found, count = search.play(demand, 0.3), len(time)
    assert demand.steps.tolist() == [1, 3, 5]
    assert found is not None
    rows, _ = search.terminal_rows(found)
    for step in range(3):
        moved = np.zeros(demand.size)
        moved[count + step] = 1e-4
        after, before = (search.play(demand.changed(sign * moved), 0.3) for sign in (1.0, -1.0))
        assert after is not None
        assert before is not None
        change = (before.missing - after.missing) / 2e-4
        np.testing.assert_allclose(rows[:, count + step], change, rtol=1e-4, atol=1e-6)


def test_a_passage_between_two_levels_becomes_a_step_of_the_same_area() -> None:
    search = of(Problem(CRANE, 0.3))
    time = np.array([0.0, 0.02, 0.03, 0.04, 0.06, 0.4])
    demand = Demand(time, np.array([62.0, 62.0, 20.0, 0.0, 0.0, 0.0]), 62.0, 0.01)
    made = search.with_switches(demand)
    assert made is not None
    assert made.steps.size == 1
    assert np.trapezoid(made.torque, made.time) == pytest.approx(np.trapezoid(demand.torque, time))


@pytest.mark.parametrize("where", [0.0, -0.25])
def test_the_closed_form_comes_out_of_pulses(where: float) -> None:
    """Not by the closed form, which is left out of the first demands."""
    problem = Problem(CRANE.replace(start_position=where), 0.33)
    search = of(problem)
    found = search.down(seeds.pulse_coast_level(search)[0])
    assert found is not None
    done = search.finished(search.refined(found))
    assert done is not None
    _, _, truth = pulse_coast_hold.solve_pulse_coast_hold(problem)
    assert truth * (1.0 - 1e-6) <= done.peak / search.base <= truth * (1.0 + 1e-3)


def test_limits_of_torque_and_rate_are_kept() -> None:
    problem = Problem(
        CRANE.replace(torque_rate=2000.0, torque_lag=0.003, minimum_torque=-10.0), 0.33, "reached"
    )
    search = of(problem)
    first = search.down(seeds.pulse_coast_level(search)[0], 8)
    assert first is not None
    torque, time = first.demand.torque, first.demand.time
    assert torque[0] == 0.0
    assert torque.min() >= -10.0
    assert torque.max() <= 62.0
    assert np.abs(np.diff(torque) / np.diff(time)).max() <= 2000.0 * (1.0 + 1e-9)


@pytest.mark.parametrize("name", ["reached, lag", "chain"])
def test_thinned_rows_of_torques_have_the_same_maxima(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A long chain would have half a million rows; maxima and the passages between openings stay."""
    search = of(CASES[name])
    found = begun(search)
    whole = Model(search, found).shafts
    monkeypatch.setattr("softstart.optimal.model.MOST_ROWS", whole.values.size // 5)
    thinned = Model(search, found).shafts
    assert 2 * thinned.values.size < whole.values.size
    assert thinned.edges.sum() <= whole.edges.sum()
    maxima = whole.peaks(whole.values)
    assert np.isin(whole.values[maxima], thinned.values[thinned.peaks(thinned.values)]).all()
    by_thinned = search.down(found.profile)
    monkeypatch.undo()
    by_whole = search.down(found.profile)
    assert by_thinned is not None
    assert by_whole is not None
    assert by_thinned.peak == pytest.approx(by_whole.peak, rel=5e-4)  # each ends within some 1e-4
