"""No start of any kind lies below the bounds by momentum: closed forms, random torques, all controllers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from softstart import Drive, TorqueProfile, simulate
from softstart.controller import ready_controller_names
from softstart.errors import SimulationError
from softstart.optimal.exact import replay
from softstart.optimal.lp import ideal
from softstart.optimal.momentum import earliest_pull, momentum_bound, momentum_shortest_time
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import solve

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


def random_drive(rng: np.random.Generator, **fixed: Any) -> Drive:
    """Everything that a drive may have, in units of its own."""
    J1, Ms = 10 ** rng.uniform(-3, 0), 10 ** rng.uniform(0, 3)
    J2 = J1 * 10 ** rng.uniform(-1, 1.3)
    Omega = 2 * math.pi * 10 ** rng.uniform(0.3, 2)
    c = Omega**2 * J1 * J2 / (J1 + J2)
    Mc = Ms * rng.choice([0.0, rng.uniform(0, 0.8)])
    gap = Ms / c * rng.choice([0.0, 10 ** rng.uniform(-1.5, 1.3)])
    target = (Ms - Mc) / (J1 + J2) * 2 * math.pi / Omega * 10 ** rng.uniform(-0.7, 1)
    w2 = rng.choice([0.0, 0.0, rng.uniform(-0.3, 0.5)]) * target
    given: dict[str, Any] = {
        "motor_inertia": J1,
        "load_inertia": J2,
        "starting_torque": Ms,
        "load_torque": Mc,
        "load_kind": rng.choice(["active", "reactive"]).item(),
        "stiffness": c,
        "damping": 2 * rng.choice([0, 0.02, 0.3]) * c / Omega,
        "contact_law": rng.choice(["no-pull", "dead-zone", "modelica"]).item(),
        "gap": gap,
        "start_position": gap * rng.choice([0.0, -0.5, rng.uniform(-0.6, 0.6)]),
        "torque_lag": rng.choice([0, 0, 0.3]) / Omega,
        "initial_load_speed": w2,
        "initial_motor_speed": w2 + rng.choice([0.0, 0.0, rng.uniform(-0.3, 0.5)]) * target,
        "target_speed": target,
    }
    return Drive(**(given | fixed))


def random_torque(rng: np.random.Generator, drive: Drive) -> TorqueProfile:
    """Bangs, ramps and rests within the limits, some in time with the shaft so that contacts repeat."""
    low, high = float(drive.minimum_torque), float(drive.Ms)
    count = int(rng.integers(1, 14))
    lengths = drive.elastic_period * 10 ** rng.uniform(-1.3, 0.7, count)
    levels = rng.choice([low, high, 0.0, rng.uniform(low, high)], count)
    if rng.random() < 0.5:
        levels = rng.uniform(low, high, count)
    times = np.concatenate([[0.0], np.cumsum(lengths)])
    if rng.random() < 0.3:
        return TorqueProfile(times, [*levels, high])
    return TorqueProfile.steps([*times, times[-1] + 1.0], [*levels, high])


def slack(drive: Drive, k_dyn: float, start_time: float, terminal: Any = "reached") -> float:
    """How far K_dyn lies above the bound, as a share; -inf if even the time is below the shortest one."""
    problem = Problem(drive, start_time, terminal)
    if start_time < momentum_shortest_time(problem) * (1 - 1e-9):
        return -math.inf
    bound = momentum_bound(problem)
    assert bound.kind == "momentum"
    return k_dyn / bound.k_dyn - 1.0 if bound.k_dyn > 0.0 else 0.0


@pytest.mark.parametrize("braking", [False, True])
def test_no_torque_at_all_gets_below(braking: bool) -> None:
    rng = np.random.default_rng(5 + braking)
    closest, several = math.inf, 0
    for _ in range(600):
        drive = random_drive(rng)
        if braking:
            drive = drive.replace(minimum_torque=-drive.Ms * rng.uniform(0.05, 1.0))
        try:
            run = simulate(drive, "profile", parameters={"profile": random_torque(rng, drive)})
        except SimulationError:
            continue
        several += run.contacts > 1
        closest = min(closest, slack(drive, run.k_dyn, run.start_time))
    assert closest >= -1e-9
    assert several > 100


def test_no_gentle_torque_gets_below() -> None:
    """The optimum's own form with its instants and levels shaken: as near to the bound as starts come."""
    rng = np.random.default_rng(8)
    near = 0
    for _ in range(150):
        shape = {
            "load_kind": "active",
            "damping": rng.choice([0.0, 0.3]),
            "torque_lag": rng.choice([0.0, 1e-3]),
        }
        drive = CRANE.replace(gap=10 ** rng.uniform(-2, 0.3), **shape)
        ideal = solve(Problem(drive.replace(damping=0.0, torque_lag=0.0), 0.4)).profile
        if ideal.torque.size < 5:
            continue
        times = ideal.time * (1 + 0.02 * rng.standard_normal() * np.array([0, 1, 1, 1, 1]))
        levels = np.clip(ideal.torque * (1 + 0.01 * rng.standard_normal(5)), 0.0, drive.Ms)
        run = simulate(drive, "profile", parameters={"profile": TorqueProfile(times, levels)})
        above = slack(drive, run.k_dyn, run.start_time)
        assert above >= -1e-9
        near += above < 0.05
    assert near > 20


def test_no_shipped_controller_gets_below() -> None:
    rng = np.random.default_rng(3)
    starts = 0
    for _ in range(25):
        drive = random_drive(rng, initial_load_speed=0.0, initial_motor_speed=0.0)
        for name in ready_controller_names():
            try:
                run = simulate(drive, name)
            except SimulationError:
                continue
            starts += 1
            assert slack(drive, run.k_dyn, run.start_time) >= -1e-9, (name, drive)
    assert starts > 100


@pytest.mark.parametrize("start_time", [0.2883042, 0.35, 0.6])
def test_it_is_the_optimum_itself_where_that_is_pulse_coast_hold(start_time: float) -> None:
    problem = Problem(CRANE, start_time)
    assert momentum_bound(problem).k_dyn == pytest.approx(solve(problem).claimed, rel=1e-8)
    assert momentum_bound(problem).k_dyn < solve(problem).claimed


@pytest.mark.parametrize(
    ("drive", "start_time"),
    [
        (CRANE, 0.2522662),
        (CRANE.replace(damping=0.5), 0.2883042),
        (CRANE.replace(load_kind="reactive"), 0.2883042),
        (CRANE.replace(gap=2.0), 0.5),
    ],
    ids=["bang-bang", "damped", "reactive", "worn"],
)
def test_the_linear_program_stays_above(drive: Drive, start_time: float) -> None:
    problem = Problem(drive, start_time)
    best = ideal.solve(problem)
    assert best is not None
    assert momentum_bound(problem).k_dyn <= best.claimed * (1 + 1e-6)


def test_the_plain_form() -> None:
    """A braking motor leaves only J2 (target - w2) = (P - Mc) (t - t_c) - Mc t_c."""
    drive = CRANE.replace(minimum_torque=-20.0)
    t_c = math.sqrt(2.0 * 0.25 / (62.0 / 0.035 + 7.16 / 0.175))
    P = (0.175 * 60.0 + 7.16 * 0.3) / (0.3 - t_c)
    problem = Problem(drive, 0.3)
    assert momentum_bound(problem).k_dyn == pytest.approx(P / problem.base_torque, rel=1e-9)


def test_a_reactive_load_starts_from_rest() -> None:
    drive = CRANE.replace(load_kind="reactive", damping=1.0)
    t_c = math.sqrt(2.0 * 0.25 * 0.035 / 62.0)
    problem = Problem(drive, 0.3)
    P = 7.16 + 0.175 * 60.0 / (0.3 - t_c)
    assert momentum_bound(problem).k_dyn == pytest.approx(P / problem.base_torque, rel=1e-9)


@pytest.mark.parametrize(
    "drive",
    [
        CRANE,
        CRANE.replace(start_position=-0.25, initial_motor_speed=3.0),
        CRANE.replace(load_kind="reactive"),
        CRANE.replace(load_kind="reactive", gap=0.0),
        CRANE.replace(load_kind="reactive", start_position=0.26, load_torque=20.0),
        CRANE.replace(load_kind="reactive", initial_motor_speed=2.0),
    ],
)
def test_the_earliest_pull_is_that_of_full_torque(drive: Drive) -> None:
    run = simulate(drive, "direct")
    first = next(
        e.time
        for e in run.events
        if e.kind == ("load starts" if drive.load_kind == "reactive" else "gap closed")
    )
    assert earliest_pull(Problem(drive, 1.0)) == pytest.approx(first, rel=1e-9)


def test_a_damped_contact_has_to_be_gentle() -> None:
    damped = Problem(CRANE.replace(damping=0.3), 0.32)
    braked = Problem(damped.drive.replace(minimum_torque=-1e-9), 0.32)
    assert momentum_bound(damped).k_dyn > 1.01 * momentum_bound(braked).k_dyn


def test_without_time_only_the_load_torque_remains() -> None:
    problem = Problem(CRANE, minimise="start_time")
    assert momentum_bound(problem).k_dyn == pytest.approx(7.16 / problem.base_torque)


def test_full_torque_all_the_way_is_no_less_than_allowed() -> None:
    """The only start that is in time by a hair: rounding must not call it impossible."""
    drive = CRANE.replace(gap=0.0, load_torque=0.0, target_speed=1.0)
    run = simulate(drive, "direct")
    assert momentum_bound(Problem(drive, run.start_time, "reached")).k_dyn <= run.k_dyn


def test_too_short_for_a_contact() -> None:
    assert momentum_bound(Problem(CRANE, 0.01)).k_dyn == math.inf


def test_shortest_times() -> None:
    assert momentum_shortest_time(Problem(CRANE, 0.3)) == pytest.approx(0.21 * 60.0 / (62.0 - 7.16))
    friction = CRANE.replace(load_kind="reactive")
    assert momentum_shortest_time(Problem(friction, 0.3)) == pytest.approx(0.21 * 60.0 / 62.0)
    # constant torque reaches the speed sooner than both masses could have it, never sooner than this
    run = simulate(CRANE, "direct")
    assert momentum_shortest_time(Problem(CRANE, 0.3, "reached")) < run.start_time


def test_synchronous_starts_respect_the_shortest_time() -> None:
    """Any start is synchronous whenever the twist turns: its speed is what the motor can have brought."""
    rng = np.random.default_rng(11)
    looked_at = 0
    for _ in range(150):
        drive = random_drive(rng, torque_lag=0.0)
        torque = random_torque(rng, drive)
        try:
            run = replay(drive, torque, torque.end + 3 * drive.elastic_period)
        except SimulationError:
            continue
        t = np.linspace(0.0, run.end_time, 4000)
        state = run.at(t)
        turns = np.flatnonzero((state["v"][:-1] * state["v"][1:] < 0.0) & (state["w2"][1:] > 0.0))
        for i in turns[state["w2"][turns] > drive.initial_load_speed]:
            # both speeds are at least this somewhere between the two instants
            speed = float(min(state["w1"][i], state["w2"][i], state["w1"][i + 1], state["w2"][i + 1]))
            if speed <= max(drive.initial_load_speed, 0.0):
                continue
            shortest = momentum_shortest_time(Problem(drive.replace(target_speed=speed), 1e9))
            assert t[i + 1] >= shortest * (1 - 1e-9)
            looked_at += 1
    assert looked_at > 100
