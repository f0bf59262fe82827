"""What a robust optimum refuses, the order of its scenarios, the grid of scenarios, and its smaller parts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from softstart import Drive, InputError, simulate
from softstart.optimal.result import InfeasibleError, LowerBound
from softstart.optimal.robust import guesses, optimize_robust, scenarios_of, solving, worth_of_contact_sensor
from softstart.optimal.robust.evaluation import Evaluator, ProfileParameters, Staircase, merged, refined

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


def nothing(drive: Drive) -> LowerBound:
    return LowerBound(0.0, "none", "nothing")


@pytest.fixture
def _hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search that is quick and rough: enough where the quality of the optimum is not the question."""
    monkeypatch.setattr(guesses, "PULSES", 2)
    monkeypatch.setattr(guesses, "COASTS", 2)
    monkeypatch.setattr(guesses, "COASTS_REACTING", 2)
    monkeypatch.setattr(solving, "EVOLUTIONS", ((3, 0),))
    monkeypatch.setattr(guesses, "ROUNDS", 100)
    monkeypatch.setattr(solving, "QUICK_EVOLUTIONS", ((3, 0),))
    monkeypatch.setattr(solving, "FIRST_ROUNDS", 3)
    monkeypatch.setattr(solving, "PURSUED", 1)
    monkeypatch.setattr(solving, "DENSE", 8)
    monkeypatch.setattr(solving, "SPARSE", 3)
    monkeypatch.setattr(solving, "ROUNDS", 8)
    monkeypatch.setattr(solving, "COARSE", 15)
    monkeypatch.setattr(solving, "FINE", 20)


@pytest.mark.usefixtures("_hasty")
def test_order_of_scenarios_changes_nothing() -> None:
    drives = [CRANE, CRANE.replace(gap=0.8), CRANE.replace(load_inertia=0.15)]
    one = optimize_robust(drives, 0.3, base=CRANE, bound_of=nothing)
    other = optimize_robust(drives[::-1], 0.3, base=CRANE, bound_of=nothing)
    assert other.k_dyn_each == one.k_dyn_each[::-1]
    assert np.array_equal(other.profile.torque, one.profile.torque)
    assert other.scenarios[other.worst] == one.scenarios[one.worst]
    again = optimize_robust([*drives, CRANE], 0.3, base=CRANE, bound_of=nothing)
    assert again.k_dyn == one.k_dyn  # a scenario named twice is one scenario
    assert np.array_equal(again.profile.time, one.profile.time)  # the same question has the same answer


@pytest.mark.usefixtures("_hasty")
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param(
            {"damping": 2.0, "contact_law": "modelica", "load_kind": "reactive"}, marks=pytest.mark.slow
        ),
        {"torque_lag": 0.005},
        {"torque_rate": 4000.0},
        {"minimum_torque": -30.0, "starting_torque": 50.0},
    ],
    ids=str,
)
def test_every_kind_of_drive_goes(changes: dict[str, Any]) -> None:
    drives = [CRANE.replace(**changes), CRANE.replace(gap=0.7, **changes)]
    sensor = worth_of_contact_sensor(drives, 0.36, bound_of=nothing, k_dyn_alone=lambda drive: drive.gap)
    direct = max(simulate(drive, "direct").k_dyn for drive in drives)
    for optimum in (sensor.blind, sensor.reacting):
        assert max(optimum.start_times) <= 0.36
        assert optimum.k_dyn < direct
        assert all(run.peak_torque / optimum.k_dyn <= drives[0].Ms for run in optimum.runs)
    assert sensor.alone == (0.5, 0.7)
    assert sensor.percent >= 0.0
    assert sensor.summary()["k_dyn_blind"] == sensor.blind.k_dyn


@pytest.mark.usefixtures("_hasty")
def test_too_short_a_start_time_names_the_slowest_and_the_shortest() -> None:
    drives = [CRANE, CRANE.replace(load_inertia=0.25, name="heavy")]
    with pytest.raises(InfeasibleError, match="heavy") as raised:
        optimize_robust(drives, 0.2, bound_of=nothing)
    verdict = raised.value.verdict
    assert verdict.problem.drive == drives[1]
    # no torque gives both masses more momentum than Ms all the time; the motor's share may go to the load
    heavy = drives[1]
    assert verdict.shortest_start_time >= heavy.J2 * heavy.target_speed / (heavy.Ms - heavy.Mc)
    assert verdict.shortest_start_time <= simulate(heavy, "direct").start_time
    best = optimize_robust(drives, verdict.shortest_start_time, bound_of=nothing)
    assert max(best.start_times) <= verdict.shortest_start_time


@pytest.mark.parametrize(
    ("scenarios", "start_time", "base", "said"),
    [
        ([], 0.3, None, "scenarios: the list is empty"),
        (CRANE, 0.3, None, "give a list of Drives"),
        ([CRANE, "crane"], 0.3, None, "scenario 2: drive = 'crane': give a Drive"),
        ([CRANE], -0.3, None, "start_time = -0.3: give the time allowed in s, above 0"),
        ([CRANE], math.nan, None, "start_time = nan"),
        ([CRANE], True, None, "start_time = True"),
        ([CRANE], 0.3, "crane", "base = 'crane': K_dyn refers to one single Drive"),
        ([CRANE, CRANE.replace(load_torque=-3.0)], 0.3, None, "scenario 2: load_torque = -3 N m"),
        ([CRANE, CRANE.replace(starting_torque=10, load_torque=2), CRANE.replace(load_torque=12)], 0.3, None,
         "scenario 3: load_torque = 12 N m, but the torque that all scenarios allow is only 10 N m"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_bad_input_is_told(scenarios: Any, start_time: Any, base: Any, said: str) -> None:
    with pytest.raises(InputError) as raised:
        optimize_robust(scenarios, start_time, base=base)
    assert said in str(raised.value)


def test_the_grid_of_scenarios() -> None:
    grid = scenarios_of(CRANE, gaps=[1.0, 0.5], inertias=[0.07, 0.175], load_torques=[5.0, 7.16])
    assert len(grid) == 8
    assert grid[0] == CRANE
    assert len(set(grid)) == 8
    assert scenarios_of(CRANE) == (CRANE,)
    with pytest.raises(InputError, match="gaps = 3: give a list of numbers"):
        scenarios_of(CRANE, gaps=3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="gap = -1"):
        scenarios_of(CRANE, gaps=[-1.0])


@pytest.mark.parametrize("react", [False, True])
def test_the_vector_of_the_controller_follows_the_unknowns(react: bool) -> None:
    random = np.random.default_rng(2)
    for _ in range(20):
        staircase = random_staircase(random, react)
        parameters = ProfileParameters(staircase, CRANE)
        moved = staircase.unknowns + 1e-3 * random.standard_normal(staircase.unknowns.size)
        known = ProfileParameters(staircase.with_unknowns(moved), CRANE).constant
        assert np.allclose(parameters.vectors(moved)[0], known, rtol=0.0, atol=1e-12)


def random_staircase(random: np.random.Generator, react: bool) -> Staircase:
    edges = np.concatenate([[0.0], np.cumsum(random.uniform(0.004, 0.03, 5))])
    contact = Staircase(edges, random.uniform(0.0, 62.0, 6)) if react else None
    return Staircase(edges, random.uniform(20.0, 62.0, 6), contact)


@pytest.mark.parametrize("react", [False, True])
def test_cutting_a_staircase_changes_no_torque(react: bool) -> None:
    random = np.random.default_rng(3)
    for _ in range(20):
        staircase = random_staircase(random, react)
        fine = refined(staircase, 0.3, 37)
        times = random.uniform(0.0, 0.4, 200)
        assert np.array_equal(fine.profile().at(times), staircase.profile().at(times))
        few = merged(fine, 1e-9)
        assert few.levels.size == 6
        assert np.allclose(few.profile().at(times), staircase.profile().at(times), atol=1e-9)
        assert np.array_equal(staircase.with_unknowns(staircase.unknowns).unknowns, staircase.unknowns)


@pytest.mark.parametrize("react", [False, True])
@pytest.mark.parametrize("changes", [{}, {"damping": 1.5, "torque_lag": 0.004}], ids=str)
def test_differences_agree_with_two_runs(react: bool, changes: dict[str, Any]) -> None:
    """A finite change of the profile changes the torques as the differences say, up to its square."""
    random = np.random.default_rng(5)
    drive = CRANE.replace(**changes)
    evaluator = Evaluator([drive], 0.3)
    for _ in range(5):
        staircase = random_staircase(random, react)
        parameters = ProfileParameters(staircase, drive)
        edges = np.arange(staircase.unknowns.size - staircase.n_levels)
        trajectory = evaluator.trajectory(0, parameters, staircase, edges, 0.0, 62.0)
        x = random.standard_normal(staircase.unknowns.size)
        x[staircase.n_levels :] *= 1e-4
        errors = []
        for size in (1e-2, 1e-3):
            moved = staircase.with_unknowns(staircase.unknowns + size * x)
            run = simulate(drive, parameters._controller(moved), float(trajectory.times[-1]))
            later = trajectory.times[
                trajectory.times > trajectory.times[0] + 1e-3
            ]  # the torque's jump at contact moves
            kept = np.isin(trajectory.times, later)
            predicted = trajectory.T[kept] + size * (trajectory.dT @ x)[kept]
            errors.append(float(np.abs(run.at(later)["T"] - predicted).max()))
        assert errors[1] < 0.05 * errors[0] + 1e-4


def test_edges_that_fall_by_rounding_coincide():
    """Edges that a descent has pushed together may end in the wrong order by a bit."""
    staircase = Staircase(np.array([0.0, 0.1, 0.2]), np.array([60.0, 9.0, 30.0]))
    edge = 0.024253
    falling = np.array([60.0, 9.0, 30.0, edge, np.nextafter(edge, 0.0)])
    profile = staircase.with_unknowns(falling).tidy()
    assert np.all(np.diff(profile.time) >= 0.0)
    assert profile.at([0.0, 0.03]).tolist() == [60.0, 30.0]
