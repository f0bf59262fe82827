"""What follows t_f: T held, or coasted to its peak and held there; never more torque than before."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from softstart import Drive, TorqueProfile
from softstart.optimal.exact import replay, torque_allowed, with_tail
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import PulseCoastHold, solve
from softstart.start.run import Run

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


def to_the_end(problem: Problem, profile: TorqueProfile, end: float) -> Run:
    return replay(problem.drive, profile, end + problem.drive.elastic_period)


@pytest.mark.parametrize("terminal", ["synchronous", "reached"])
def test_a_held_torque_stays(terminal: Any) -> None:
    problem = Problem(CRANE, 0.2883042, terminal)
    best = solve(problem)
    run = to_the_end(problem, with_tail(problem, best.profile, best.end_time), best.end_time)
    after = run.at(np.linspace(best.end_time, run.end_time, 200))
    P = best.claimed * problem.base_torque
    np.testing.assert_allclose(after["T"], P, rtol=1e-9)
    assert run.k_dyn == pytest.approx(best.claimed, rel=1e-9)


def test_steady_holds_the_load_torque() -> None:
    problem = Problem(CRANE, 0.5, "steady")
    # stretched to T = Mc at rest by a start in contact, wound up by just that
    drive = CRANE.replace(start_position=0.25 + 7.16 / 368.465, target_speed=1.0)
    problem = Problem(drive, 0.5, "steady")
    profile = with_tail(problem, TorqueProfile([0.0], [7.16]), 0.1)
    after = to_the_end(problem, profile, 0.1).at(np.linspace(0.1, 0.15, 20))
    np.testing.assert_allclose(after["T"], 7.16, rtol=1e-9)


@pytest.mark.parametrize("damping", [0.0, 0.4])
@pytest.mark.parametrize("lowest", [0.0, -5.0])
def test_reached_coasts_to_the_peak_and_holds_it(damping: float, lowest: float) -> None:
    drive = CRANE.replace(damping=damping, minimum_torque=lowest)
    problem = Problem(drive, 1.0, "reached")
    end = 0.026
    whole = TorqueProfile([0.0, 0.008, 0.008, 0.024, 0.024], [62.0, 62.0, 0.0, 0.0, 62.0])
    coasting = replay(
        drive, whole.followed_by(end, TorqueProfile([0.0], [lowest])), end + 0.5 * drive.elastic_period
    )
    at_end = float(coasting.at(end)["T"])
    assert coasting.peak_time > end + 1e-4  # T rises still
    made = with_tail(problem, whole, end)
    run = to_the_end(problem, made, end)
    assert run.peak_torque == pytest.approx(coasting.peak_torque, rel=1e-9)
    assert run.peak_torque > at_end
    held = run.at(np.linspace(float(made.end) + 1e-9, run.end_time, 100))["T"]
    if run.peak_torque < PulseCoastHold.of(problem).most_held:
        np.testing.assert_allclose(held, held[0], rtol=1e-8)
    assert float(made.at(coasting.peak_time - 1e-6)) == lowest
    # the profile before t_f is untouched
    early = np.linspace(0.0, end - 1e-9, 500)
    np.testing.assert_array_equal(made.at(early), whole.at(early))


def test_a_peak_that_is_over_is_not_exceeded() -> None:
    problem = Problem(CRANE, 1.0, "reached")
    pulse = TorqueProfile([0.0, 0.0075668, 0.0075668], [62.0, 62.0, 0.0])
    before = replay(CRANE, pulse, 0.045)
    end = 0.042
    assert before.peak_time < end
    run = to_the_end(problem, with_tail(problem, pulse, end), end)
    assert run.peak_torque == pytest.approx(before.peak_torque, rel=1e-12)
    assert run.contacts == 1


def test_holding_at_once_is_never_used_to_raise_it() -> None:
    """Held at T(t_f) while T falls, T would swing back above all before by T'/Omega."""
    problem = Problem(CRANE, 1.0, "reached")
    pulse = TorqueProfile([0.0, 0.0075668, 0.0075668], [62.0, 62.0, 0.0])
    end = 0.037
    peak = replay(CRANE, pulse, end).peak_torque
    for moved in np.linspace(0.0, 0.008, 9):
        run = to_the_end(problem, with_tail(problem, pulse, end + moved), end + moved)
        assert run.peak_torque <= peak * (1 + 1e-9)


@pytest.mark.parametrize("limits", [{"torque_lag": 0.004}, {"torque_rate": 4000.0}, {"torque_lag": 0.02}])
def test_a_torque_that_comes_late(limits: Any) -> None:
    drive = CRANE.replace(**limits)
    problem = Problem(drive, 1.0, "reached")
    pulse = TorqueProfile([0.0, 0.01, 0.01], [62.0, 62.0, 20.0])
    end = 0.04
    coasting = replay(drive, pulse.followed_by(end, TorqueProfile([0.0], [0.0])), end + drive.elastic_period)
    run = to_the_end(problem, with_tail(problem, pulse, end), end)
    assert run.peak_torque <= coasting.peak_torque * (1 + 1e-6)


def test_the_torque_speed_curve_is_kept_to_after_the_end() -> None:
    problem = Problem(CRANE, 0.2883042, torque_speed=((0.0, 70.0), (60.0, 57.0), (80.0, 20.0)))
    best = solve(Problem(CRANE, 0.2883042))
    made = with_tail(problem, best.profile, best.end_time)
    run = to_the_end(problem, made, best.end_time)
    after = run.at(np.linspace(best.end_time, run.end_time, 2000))
    assert np.all(after["u"] <= torque_allowed(problem, after["w1"]))
    assert run.k_dyn == pytest.approx(best.claimed, rel=1e-9)


def test_demands_stay_within_the_limits() -> None:
    rng = np.random.default_rng(2)
    for _ in range(60):
        terminal: Any = rng.choice(["synchronous", "reached"])
        drive = CRANE.replace(
            damping=float(rng.choice([0.0, 0.5])), torque_lag=float(rng.choice([0.0, 0.003]))
        )
        problem = Problem(drive, 1.0, terminal)
        times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.002, 0.03, 6))])
        profile = TorqueProfile(times, rng.uniform(0.0, 62.0, 7))
        end = float(rng.uniform(0.6, 1.0) * times[-1])
        made = with_tail(problem, profile, end)
        assert made.torque.min() >= 0.0
        assert made.torque.max() <= 62.0
        assert math.isfinite(to_the_end(problem, made, end).k_dyn)
