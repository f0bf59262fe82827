"""Optima and bounds from every start position, with a brake, and where the position is unknown.

`python -m tests.robustness.unknown_positions` compares two hundred random drives of unknown position.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.softstart.kernel.test_brake import HOIST
from tests.softstart.optimal.test_momentum import random_drive, random_torque, slack

from softstart import Drive, InputError, TorqueProfile, optimize, pareto, simulate
from softstart.controller import ready_controller_names
from softstart.drive import UNKNOWN_POSITIONS
from softstart.errors import SimulationError
from softstart.optimal.exact import hold_of
from softstart.optimal.momentum import momentum_bound
from softstart.optimal.problem import Problem
from softstart.optimal.result import InfeasibleError, Optimum, RobustOptimum
from softstart.optimal.robust import optimize_robust, scenarios_of
from softstart.optimal.shortest import start_time_of_direct
from softstart.start.run import Run
from softstart.views.optima import position_sentences

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
HELD = HOIST.replace(brake="motor")
POSITIONS = (*UNKNOWN_POSITIONS, "hanging")
BLIND = ("direct", "ramp", "s-curve")  # strategies that measure nothing


def placed(rng: np.random.Generator, **fixed: Any) -> Drive:
    """A random drive at rest at a random position, a third of them behind a brake."""
    drive = random_drive(rng, initial_load_speed=0.0, initial_motor_speed=0.0, **fixed)
    hangs = drive.load_kind == "active" and drive.Mc > 0.0
    where = rng.choice(POSITIONS if hangs else UNKNOWN_POSITIONS).item()
    brake = {"brake": "motor"} if rng.random() < 0.35 else {}
    if brake and rng.random() < 0.5:
        brake["release"] = float(rng.uniform(0.05, 1.5)) * drive.elastic_period
    return drive.replace(start_position=where, **brake)


# the bounds are attacked ------------------------------------------------------------------------------------


def test_no_torque_gets_below_the_bound_from_any_position() -> None:
    """Random torques of drives of all kinds; with a brake the earliest release counts."""
    rng = np.random.default_rng(21)
    closest, starts, released = math.inf, 0, 0
    for _ in range(700):
        drive = placed(rng)
        try:
            run = simulate(drive, "profile", parameters={"profile": random_torque(rng, drive)})
        except SimulationError:
            continue
        if not math.isnan(run.start_time):
            starts += 1
            released += drive.brake == "motor"
            closest = min(closest, slack(drive, run.k_dyn, run.start_time))
    assert closest >= -1e-9
    assert starts > 350
    assert released > 80


def test_no_shipped_controller_gets_below_the_bound_from_any_position() -> None:
    rng = np.random.default_rng(22)
    starts = 0
    for _ in range(30):
        drive = placed(rng)
        for name in ready_controller_names():
            try:
                run = simulate(drive, name)
            except SimulationError:
                continue
            if not math.isnan(run.start_time):
                starts += 1
                assert slack(drive, run.k_dyn, run.start_time) >= -1e-9, (name, drive)
    assert starts > 150


@pytest.mark.parametrize(
    ("where", "damping"),
    [
        ("mid-gap", 0.0),
        pytest.param("opposite-flank", 0.0, marks=pytest.mark.slow),
        ("opposite-flank", 1.5),
        ("hanging", 1.5),
    ],
)
def test_no_start_with_one_contact_gets_below_the_certificate(where: str, damping: float) -> None:
    """The optimum's own torque shaken, and those of controllers, at their own start times."""
    drive = HOIST.replace(start_position=where, damping=damping)
    rng = np.random.default_rng(23)
    if damping == 0.0 and where == "opposite-flank":
        with pytest.raises(InfeasibleError, match="so hard that the gap opens again whatever the motor does"):
            optimize(drive, "1.3x", terminal="reached", time_limit=0.0)
        return
    best = optimize(drive, "1.3x", terminal="reached")
    assert best.bound.k_dyn <= best.k_dyn <= 1.05 * best.bound.k_dyn
    runs: list[Run] = []
    for _ in range(60):
        torque = best.profile.torque * (1.0 + 0.1 * rng.standard_normal(best.profile.torque.size))
        shaken = TorqueProfile(best.profile.time, np.clip(torque, 0.0, drive.Ms))
        runs.append(simulate(drive, "profile", parameters={"profile": shaken}))
    runs += [simulate(drive, name) for name in ready_controller_names()]
    in_time = [run for run in runs if run.start_time <= best.end_time]
    assert len(in_time) > 3
    single = [run.k_dyn for run in in_time if run.contacts == 1]
    assert min(single, default=math.inf) >= best.bound.k_dyn * (1.0 - 1e-6)
    assert min(run.k_dyn for run in in_time) >= momentum_bound(best.problem).k_dyn * (1.0 - 1e-9)


# optima from positions --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "where"), [*(("lp", where) for where in POSITIONS), ("collocation", "hanging")]
)
def test_the_methods_agree_from_every_position(method: Any, where: str) -> None:
    drive = CRANE.replace(start_position=where)
    exact = optimize(drive, 0.32, terminal="reached", method="closed-form")
    found = optimize(drive, 0.32, terminal="reached", method=method)
    assert found.k_dyn == pytest.approx(exact.k_dyn, rel=2e-3)
    assert exact.bound.k_dyn == pytest.approx(exact.k_dyn, rel=1e-8)


def test_a_held_hoist_is_near_1_in_the_time_of_direct() -> None:
    """The hoist of docs/howto/own-drive.md: direct has 1.180 in 0.199 s, the s-curve 1.001 in 0.236 s."""
    direct = simulate(HELD, "direct")
    quick = optimize(HELD, 1.02 * direct.start_time)
    assert quick.k_dyn == pytest.approx(0.9994, abs=1e-4)
    assert quick.bound.k_dyn > 0.9985
    assert quick.run.events[0].kind == "brake released"
    assert quick.run.release_time == 0.0  # an ideal torque reaches that of the load at once
    free = optimize(HELD.replace(brake="none"), 1.02 * direct.start_time)
    assert free.k_dyn == pytest.approx(quick.k_dyn, rel=1e-12)


def test_a_release_by_time_only_takes_that_time() -> None:
    after = optimize(HELD.replace(release=0.1), 0.31, terminal="reached")
    alone = optimize(HELD, 0.21, terminal="reached")
    assert after.run.release_time == pytest.approx(0.1, rel=1e-12)
    assert after.k_dyn == pytest.approx(alone.k_dyn, rel=1e-6)
    assert after.bound.k_dyn == pytest.approx(alone.bound.k_dyn, rel=5e-4)  # how near a certificate comes


@pytest.mark.parametrize(
    "late", [{"torque_lag": 0.005}, {"torque_rate": 2000.0}, {"torque_lag": 0.004, "torque_rate": 2000.0}]
)
def test_torque_proving_waits_for_the_quickest_rise(late: dict[str, float], small_certificate: None) -> None:
    drive = HELD.replace(**late)
    full = simulate(drive, "profile", parameters={"profile": TorqueProfile([0.0], [250.0])})
    best = optimize(drive, "1.2x")
    assert hold_of(best.problem).until == pytest.approx(full.release_time, rel=1e-12)
    assert best.run.release_time == pytest.approx(full.release_time, rel=1e-9)
    assert best.k_dyn >= best.bound.k_dyn
    for name in ready_controller_names():
        run = simulate(drive, name)
        if run.start_time <= best.end_time:
            assert run.k_dyn >= best.k_dyn * (1.0 - 1e-6), name


def test_a_load_that_drops_before_the_release_counts() -> None:
    drive = HELD.replace(start_position="driving-flank", release=0.01)
    best = optimize(drive, "1.2x", terminal="reached")
    dropped = simulate(drive, "direct", until=0.01)
    assert best.k_dyn >= dropped.k_dyn
    assert best.run.release_time == pytest.approx(0.01, rel=1e-12)


@pytest.mark.parametrize(
    ("drive", "given", "said"),
    [
        (HELD.replace(release=0.1, torque_lag=0.01), {}, "the torque that the motor has built up"),
        (HELD.replace(start_position=0.08, torque_lag=0.01), {}, "swings on the wound-up shaft"),
        (HELD.replace(torque_lag=0.01), {"minimise": "heat"}, "the heat while the motor is held"),
        (HELD.replace(release=0.1), {"start_time": 0.05}, "the brake holds the motor until 0.1 s"),
        (CRANE.replace(start_position="unknown"), {"terminal": "steady"}, "terminal = steady: the start"),
        (CRANE.replace(start_position="unknown"), {"method": "lp"}, "method = lp: the start position"),
        (CRANE.replace(start_position="unknown"), {"smoothness": 0.001}, "smoothness = 0.001: the start"),
        (CRANE.replace(start_position="unknown"), {"k_dyn": 1.1, "minimise": "heat"}, "minimise = heat"),
    ],
)
def test_what_has_no_answer_is_refused(drive: Drive, given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        optimize(drive, **{"start_time": 0.5, **given})


# an unknown position ----------------------------------------------------------------------------------------


def random_unknown(seed: int) -> Drive:
    """A random drive that starts at rest somewhere in its gap: damped or not, with a lag or not."""
    rng = np.random.default_rng([seed, 14])
    drive = random_drive(rng, initial_load_speed=0.0, initial_motor_speed=0.0, contact_law="no-pull")
    gap = float(drive.Ms / drive.c * 10 ** rng.uniform(-1.0, 1.0))
    return drive.replace(gap=gap, start_position="unknown")


def compared(drive: Drive, best: Optimum | RobustOptimum) -> dict[str, float]:
    """The robust optimum against its bound and all strategies in its time; shares, 0 or more is right."""
    robust = isinstance(best, RobustOptimum)
    end_time = max(best.start_times) if robust else best.end_time
    bound = best.lower_bound if robust else best.bound
    runs = {}
    for name in ready_controller_names():
        try:
            runs[name] = simulate(drive, name)
        except SimulationError:
            continue
    for run in runs.values():
        each = [
            simulate(one, run.controller, fitted_to=drive.design_drive) for one in drive.positions.values()
        ]
        assert run.k_dyn == max(single.k_dyn for single in each)
    singles = [
        simulate(one, "profile", parameters={"profile": best.profile}) for one in drive.positions.values()
    ]
    assert best.k_dyn == max(run.k_dyn for run in singles)
    assert end_time == max(run.start_time for run in singles)
    quick = {name: run for name, run in runs.items() if run.start_time <= end_time}
    return {
        "over its bound": best.k_dyn / bound.k_dyn - 1.0,
        **{f"{name} over it": run.k_dyn / best.k_dyn - 1.0 for name, run in quick.items()},
        **{
            f"{name} over the bound": run.k_dyn
            / momentum_bound(Problem(drive, run.start_time, "reached")).k_dyn
            - 1.0
            for name, run in runs.items()
            if not math.isnan(run.start_time)
        },
    }


def wrong_in(found: dict[str, float]) -> dict[str, float]:
    """What contradicts the robust optimum: below a bound, or gentler and as quick without measuring."""
    blind = {f"{name} over it" for name in BLIND}
    return {
        name: share
        for name, share in found.items()
        if share < -1e-9 and (name in blind or name.endswith("bound"))
    }


@pytest.mark.slow
def test_unknown_is_the_robust_optimum_and_its_bound_the_largest(small_search: None) -> None:
    drive, time = CRANE.replace(start_position="unknown"), 0.3
    best = optimize(drive, time)
    assert (best.method, best.problem.terminal) == ("robust", "reached")
    assert "driving-flank, mid-gap, opposite-flank" in best.why
    each = [momentum_bound(Problem(one, time, "reached")).k_dyn for one in drive.positions.values()]
    assert best.bound.k_dyn == max(each)
    assert list(best.alone) == list(drive.positions)
    for where, alone in best.alone.items():
        assert alone.k_dyn == optimize(drive.replace(start_position=where), time, terminal="reached").k_dyn
        assert alone.k_dyn <= best.k_dyn
    assert best.summary()["k_dyn_if_position_known"] == {at: one.k_dyn for at, one in best.alone.items()}
    assert not wrong_in(compared(drive, best))
    said, reacts = position_sentences(best)
    assert said.startswith("Worst of driving-flank, mid-gap, opposite-flank: ")
    assert "feedback reacts" in reacts
    front = pareto(drive, [0.05], controllers=[])
    assert [point.status for point in front.points] == ["INFEASIBLE"]


def test_a_random_drive_of_unknown_position(small_search: None) -> None:
    drive = random_unknown(0)
    best = optimize_robust(list(drive.positions.values()), 1.2 * start_time_of_direct(drive), base=drive)
    assert not wrong_in(compared(drive, best))


def test_scenarios_take_every_position() -> None:
    drive = CRANE.replace(start_position="unknown")
    found = scenarios_of(drive, gaps=[0.5, 1.0])
    assert [(one.gap, one.start_position) for one in found] == [
        (gap, where) for gap in (0.5, 1.0) for where in UNKNOWN_POSITIONS
    ]
