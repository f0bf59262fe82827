"""The linear program of a step against the exact start, its grids and its end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.softstart.optimal.drives import CRANE, CURVE, HELD, played, three_masses

from softstart import TorqueProfile
from softstart.optimal import pulse_coast_hold, seeds
from softstart.optimal.descent import Candidate, Descent, Model
from softstart.optimal.problem import Problem
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


def begun(problem: Problem) -> tuple[Descent, Candidate]:
    """A search some steps down: no optimum yet, and near no corner."""
    search = Descent(problem)
    firsts = seeds.pulse_coast_level(search)
    found = search.down(firsts[0], search.latest, 2, 1e-3)
    assert found is not None
    return search, found


@pytest.mark.parametrize("name", CASES)
def test_what_a_small_step_promises_comes_true(name: str) -> None:
    """The model is right to first order; of peaks that it has not seen 1e-5 may come through."""
    search, found = begun(CASES[name])
    model, shares = Model.of(search, found), []
    for trust in (3e-4, 1e-4):
        step = model.step(trust)
        assert step is not None
        change, later, promised = step
        assert np.abs(change).max() <= (trust + 1e-6) * search.high
        torques = found.torques + change
        np.testing.assert_allclose(search.allowed(torques), torques, atol=1e-6 * search.high)
        tried = search.play(search.allowed(torques), min(found.end + later, search.latest))
        assert tried is not None
        assert promised > 0.0
        shares.append(found.merit - tried.merit - promised)
    assert abs(shares[-1]) < 0.05 * promised + 5e-6 * found.merit, (shares, promised)


@pytest.mark.parametrize("terminal", ["reached", "synchronous", "steady"])
def test_finished_meets_the_end_by_the_smallest_changes(terminal: Any) -> None:
    problem = Problem(CRANE.replace(damping=0.3), 0.3, terminal)
    search = Descent(problem)
    found = search.down(seeds.pulse_coast_level(search)[0], search.latest)
    assert found is not None
    done = search.finished(found)
    assert done is not None
    assert done.lacking.max() <= (0.0 if terminal == "reached" else 1e-10)
    assert np.abs(done.torques - found.torques).max() < 1e-2 * search.high
    assert done.peak == pytest.approx(found.peak, rel=1e-3)
    run = played(problem.drive, TorqueProfile(search.time, done.torques), done.end + 0.01)
    state = run.trajectory.at([done.end])
    if terminal == "reached":
        assert state["w"][0, 1] >= 60.0 * (1.0 - 1e-9)
    else:
        np.testing.assert_allclose(state["w"][0], 60.0, rtol=1e-9)
    if terminal == "steady":
        np.testing.assert_allclose(state["T"][0], steady_shaft_torques(run.trajectory.input), rtol=1e-6)


@pytest.mark.parametrize("where", [0.0, -0.25])
def test_the_closed_form_comes_out_of_pulses(where: float) -> None:
    """Not by the closed form, which is left out of the first demands."""
    problem = Problem(CRANE.replace(start_position=where), 0.33)
    search = Descent(problem)
    found = search.down(seeds.pulse_coast_level(search)[0], search.latest)
    assert found is not None
    done = search.finished(search.refined(found))
    assert done is not None
    _, _, truth = pulse_coast_hold.solve_pulse_coast_hold(problem)
    assert truth * (1.0 - 1e-6) <= done.peak / search.base <= truth * (1.0 + 1e-3)


def test_limits_of_torque_and_rate_are_kept() -> None:
    problem = Problem(
        CRANE.replace(torque_rate=2000.0, torque_lag=0.003, minimum_torque=-10.0), 0.33, "reached"
    )
    search = Descent(problem)
    first = search.down(seeds.pulse_coast_level(search)[0], search.latest, 8)
    assert first is not None
    assert first.torques[0] == 0.0
    assert first.torques.min() >= -10.0
    assert first.torques.max() <= 62.0
    assert np.abs(np.diff(first.torques) / np.diff(search.time)).max() <= 2000.0 * (1.0 + 1e-9)
