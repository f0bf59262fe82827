"""No start of any kind lies below the bounds by momentum: closed forms, random torques."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from tests.softstart.optimal.drives import (
    CRANE,
    HELD,
    LONG,
    damped_crane,
    moving_drive,
    placed_drive,
    played,
    random_torque,
    three_masses,
    with_both_parts,
    without_gaps,
)

from softstart import Drive, TorqueProfile, optimize, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.errors import SimulationError
from softstart.optimal import pulse_coast_hold
from softstart.optimal.bounds import earliest_pull, least_heat, momentum_bound, momentum_shortest_time
from softstart.optimal.problem import Problem
from softstart.optimal.result import heat_of


def slack(machine: Any, k_dyn: float, start_time: float, terminal: Any = "reached") -> float:
    """How far K_dyn lies above the bound, as a share; -inf if even the time is below the shortest one."""
    problem = Problem(machine, start_time, terminal)
    if start_time < momentum_shortest_time(problem) * (1 - 1e-9):
        return -math.inf
    bound = momentum_bound(problem)
    assert bound.kind == "momentum"
    return k_dyn / bound.k_dyn - 1.0 if bound.k_dyn > 0.0 else 0.0


@pytest.mark.parametrize("kind", ["moving", "braking", "placed", "parts"])
def test_no_torque_at_all_gets_below(kind: str) -> None:
    """Masses that move at first, friction, a motor that brakes; every position, free or behind a brake.

    Of both parts of a load torque any share is active: the load is held at rest, or falls.
    """
    rng = np.random.default_rng({"moving": 5, "braking": 6, "placed": 21, "parts": 47}[kind])
    closest, starts, several, rubs, released = math.inf, 0, 0, 0, 0
    for _ in range(350):
        drive = placed_drive(rng) if kind == "placed" else moving_drive(rng)
        if kind == "parts":
            drive = with_both_parts(rng, placed_drive(rng) if rng.random() < 0.4 else drive)
        if kind == "braking" or (kind == "parts" and rng.random() < 0.3):
            drive = drive.replace(minimum_torque=-drive.Ms * rng.uniform(0.05, 1.0))
        if kind in ("moving", "braking") and rng.random() < 0.25:
            share = 0.2 * (drive.Ms - drive.Mc)
            rough = {
                "motor_friction": share * rng.random(),
                "motor_viscous_friction": share * rng.random() / drive.target_speed,
                "load_viscous_friction": share * rng.choice([0.0, rng.random()]) / drive.target_speed,
            }
            drive = drive.replace(**rough)
            rubs += 1
        try:
            run = played(drive, random_torque(rng, drive))
        except SimulationError:
            continue
        if not math.isnan(run.start_time):
            starts, several, released = (
                starts + 1,
                several + (run.contacts > 1),
                released + (drive.brake != "none"),
            )
            closest = min(closest, slack(drive, run.k_dyn, run.start_time))
    assert closest >= -1e-9
    assert starts > 170
    assert several > 60
    assert {"placed": released > 40, "parts": released > 15}.get(kind, rubs > 60)


def test_no_gentle_torque_gets_below() -> None:
    """The optimum's own form with its instants and levels shaken: as near to the bound as starts come."""
    rng = np.random.default_rng(8)
    near = 0
    for _ in range(150):
        shape = {"damping": rng.choice([0.0, 0.3]), "torque_lag": rng.choice([0.0, 1e-3])}
        drive = CRANE.replace(gap=10 ** rng.uniform(-2, 0.3), **shape)
        best, _, _ = pulse_coast_hold.solve_pulse_coast_hold(
            Problem(drive.replace(damping=0.0, torque_lag=0.0), 0.4)
        )
        times = best.time * (1 + 0.02 * rng.standard_normal(best.time.size) * (best.time > 0.0))
        levels = np.clip(best.torque * (1 + 0.01 * rng.standard_normal(best.time.size)), 0.0, drive.Ms)
        run = played(drive, TorqueProfile(np.sort(times), levels))
        above = slack(drive, run.k_dyn, run.start_time)
        assert above >= -1e-9
        near += above < 0.05
    assert near > 20


@pytest.mark.parametrize(
    "name", ["crane", "middle load", "motor in the middle", "friction", "no gaps", "ground"]
)
def test_no_torque_of_a_chain_gets_below(name: str) -> None:
    """Any gaps and loads, a load between two shafts, a motor between two loads, friction, a mass of inf."""
    rng = np.random.default_rng(4)
    shafts, motor = [Shaft(3e3, damping_ratio=0.02, gap=0.05), Shaft(2e3, gap=0.03)], Motor(100.0)
    light = [Mass(0.1, name="a"), Mass(0.05, name="b", torque=5.0), Mass(0.4, name="c", torque=10.0)]
    chains = {
        "crane": damped_crane(0.05),
        "middle load": Chain(light, shafts, motor, load_mass="b", target_speed=12.0),
        "motor in the middle": Chain(light, shafts, Motor(100.0, mass="b"), target_speed=12.0),
        "friction": three_masses(motor={"torque_lag": 0.004}, kind="reactive"),
        "no gaps": without_gaps(),
        "ground": Chain([*light[:2], Mass(0.4, name="c"), Mass("inf", name="d")], [*shafts, Shaft(5.0)],
                        motor, load_mass="c", target_speed=5.0),
    }  # fmt: skip
    chain, high, starts = chains[name], float(chains[name].motor.starting_torque), 0
    for _ in range(60 if name == "crane" else 20):
        if name == "crane":
            gaps, inertia = float(10.0 ** rng.uniform(-2, 0.3)), float(rng.uniform(0.1, 2))
            chain = damped_crane(float(rng.choice([0.0, 0.05]))).scaled(gaps=gaps, load_inertia=inertia)
        time = np.sort(np.append(0.0, rng.uniform(0.0, 0.4, 5)))
        profile = {"profile": TorqueProfile(time, high * rng.uniform(0.1, 1.0, 6))}
        run = simulate(chain, "profile", 1.0, parameters=profile, fitted_to=CRANE)
        if math.isnan(run.start_time):
            continue
        starts += 1
        assert slack(chain, run.k_dyn, run.start_time) >= -1e-9
        last = len(chain.shafts) - 1
        closed = [one.time for one in run.events if one.kind == "gap closed" and one.place == last]
        if name == "crane" and closed:  # no start is bounded before the load can have been pulled
            assert momentum_shortest_time(Problem(chain, run.start_time, "reached")) <= closed[0]
    assert starts > (20 if name == "crane" else 5)


def test_a_load_that_follows_a_curve_and_losses_have_no_bound() -> None:
    curved = three_masses(curve_speed=[0.0, 30.0], curve_torque=[0.0, 10.0])
    for chain, why in ((curved, "follows a curve"), (three_masses(efficiency=0.97), "gear with losses")):
        bound = momentum_bound(Problem(chain, 0.3))
        assert (bound.kind, bound.k_dyn) == ("none", 0.0)
        assert why in bound.covers


def test_several_machines_have_the_largest_bound() -> None:
    wide = CRANE.replace(gap=0.8)
    problem = Problem(CRANE, LONG, "reached", scenarios=(wide,))
    each = [momentum_bound(Problem(one, LONG, "reached", base=CRANE)).k_dyn for one in (CRANE, wide)]
    assert momentum_bound(problem).k_dyn == max(each)
    times = [momentum_shortest_time(Problem(one, LONG, "reached")) for one in (CRANE, wide)]
    assert momentum_shortest_time(problem) == max(times)
    unknown = CRANE.replace(start_position="unknown")
    each = [momentum_bound(Problem(one, LONG, "reached")).k_dyn for one in unknown.positions.values()]
    assert momentum_bound(Problem(unknown, LONG)).k_dyn == max(each)


@pytest.mark.parametrize("start_time", [LONG, 0.35, 0.6])
@pytest.mark.parametrize("where", ["mid-gap", "driving-flank", "opposite-flank", "hanging"])
def test_it_is_the_optimum_itself_where_that_is_pulse_coast_hold(where: str, start_time: float) -> None:
    problem = Problem(CRANE.replace(start_position=where), start_time, "reached")
    _, _, k_dyn = pulse_coast_hold.solve_pulse_coast_hold(problem)
    assert k_dyn * (1.0 - 1e-8) < momentum_bound(problem).k_dyn < k_dyn


def test_the_plain_form() -> None:
    """A braking motor leaves J2 (target - w2) = (P - Mc) (t - t_c) - Mc t_c; reactive: from rest."""
    problem = Problem(CRANE.replace(minimum_torque=-20.0), 0.3)
    t_c = math.sqrt(2.0 * 0.25 / (62.0 / 0.035 + 7.16 / 0.175))
    P = (0.175 * 60.0 + 7.16 * 0.3) / (0.3 - t_c)
    assert momentum_bound(problem).k_dyn == pytest.approx(P / problem.base_torque, rel=1e-9)
    problem = Problem(CRANE.replace(load_kind="reactive", damping=1.0), 0.3)
    t_c = math.sqrt(2.0 * 0.25 * 0.035 / 62.0)
    P = 7.16 + 0.175 * 60.0 / (0.3 - t_c)
    assert momentum_bound(problem).k_dyn == pytest.approx(P / problem.base_torque, rel=1e-9)


def test_a_chain_knows_the_momentum_of_its_load() -> None:
    """J_L target + M_L t_f <= P (t_f - t_c); before t_c the motor has to cross its own gap."""
    for chain in (without_gaps(), three_masses()):
        problem = Problem(chain, 0.3)
        first = momentum_shortest_time(problem)
        P = (0.4 * 20.0 + 20.0 * 0.3) / (0.3 - first)
        assert momentum_bound(problem).k_dyn == pytest.approx(P / problem.base_torque, rel=1e-9)
        assert (first > math.sqrt(2.0 * 0.025 * 0.1 / 100.0)) == (chain.shafts[0].gap > 0.0)


@pytest.mark.parametrize(
    "drive",
    [
        CRANE.replace(start_position=-0.25, initial_motor_speed=3.0),
        CRANE.replace(load_kind="reactive"),
        CRANE.replace(load_kind="reactive", start_position=0.26, load_torque=20.0),
    ],
)
def test_the_earliest_pull_is_that_of_full_torque(drive: Drive) -> None:
    kind = "load starts" if drive.load_kind == "reactive" else "gap closed"
    first = next(event.time for event in simulate(drive, "direct").events if event.kind == kind)
    assert earliest_pull(Problem(drive, 1.0)) == pytest.approx(first, rel=1e-9)


@pytest.mark.parametrize("damping", [0.1, 0.3, 1.0])
def test_the_bound_of_a_damped_contact_is_tight(damping: float) -> None:
    """By hand: pulse and coast close the gap at speed v after t_c; T then swings up to its peak P(v), so

    P(v) (t - t_c) = J2 target + Mc t at the bound. T is coasted on by matrix exponentials. The grid of
    instants on which the bound takes P may cost it a thousandth, not more.
    """
    J1, J2, Mc, time, both = 0.035, 0.175, 7.16, 0.32, 1.0 / 0.035 + 1.0 / 0.175
    rates = np.array([[0.0, 1.0, 0.0], [-368.465 * both, -damping * both, Mc / J2], [0.0, 0.0, 0.0]])
    step, push, pull = expm(rates * 2e-5), 62.0 / J1, Mc / J2

    T = np.array([[368.465, damping, 0.0] @ np.linalg.matrix_power(step, k) for k in range(1500)])

    def peak(v: float) -> float:
        return float((T @ [0.0, v, 1.0]).max())

    def missing(v: float) -> float:
        pulse = 0.5 * (v**2 - 2.0 * pull * 0.25) / push
        t1 = math.sqrt(2.0 * pulse / (push + pull))
        w = (push + pull) * t1
        t_c = t1 + (v - w) / pull
        return peak(v) * (time - t_c) - J2 * 60.0 - Mc * time

    v = brentq(missing, 1.01 * math.sqrt(2.0 * pull * 0.25), math.sqrt(2.0 * (push + pull) * 0.25))
    problem = Problem(CRANE.replace(damping=damping), time)
    bound = momentum_bound(problem).k_dyn * problem.base_torque
    assert 0.999 * peak(v) < bound <= peak(v) * (1.0 + 1e-6)


def test_a_damped_contact_has_to_be_gentle() -> None:
    damped = Problem(CRANE.replace(damping=0.3), 0.32)
    braked = Problem(damped.drive.replace(minimum_torque=-1e-9), 0.32)
    assert momentum_bound(damped).k_dyn > 1.01 * momentum_bound(braked).k_dyn


def test_the_ends_of_the_bound() -> None:
    """Without a time only the load torque is left; too short a time for a contact has no start."""
    problem = Problem(CRANE, minimise="start_time")
    assert momentum_bound(problem).k_dyn == pytest.approx(7.16 / problem.base_torque)
    assert momentum_bound(Problem(CRANE, 0.01)).k_dyn == math.inf
    assert momentum_bound(Problem(damped_crane(), 0.005)).k_dyn == math.inf
    # full torque all the way is in time by a hair: rounding must not call it impossible
    drive = CRANE.replace(gap=0.0, load_torque=0.0, target_speed=1.0)
    run = simulate(drive, "direct")
    assert momentum_bound(Problem(drive, run.start_time, "reached")).k_dyn <= run.k_dyn


def test_shortest_times() -> None:
    assert momentum_shortest_time(Problem(CRANE, 0.3)) == pytest.approx(0.21 * 60.0 / (62.0 - 7.16))
    friction = CRANE.replace(load_kind="reactive")
    assert momentum_shortest_time(Problem(friction, 0.3)) == pytest.approx(0.21 * 60.0 / 62.0)
    # constant torque reaches the speed sooner than both masses could have it, never sooner than this
    run = simulate(CRANE, "direct")
    assert momentum_shortest_time(Problem(CRANE, 0.3, "reached")) < run.start_time


@pytest.mark.parametrize("parts", [1, 2])
def test_synchronous_starts_respect_the_shortest_time(parts: int) -> None:
    """Any start is synchronous whenever the twist turns: its speed is what the motor can have brought."""
    rng = np.random.default_rng(11)
    looked_at = 0
    for _ in range(60):
        drive = moving_drive(rng, torque_lag=0.0)
        drive = with_both_parts(rng, drive) if parts == 2 else drive
        torque = random_torque(rng, drive)
        try:
            run = played(drive, torque, torque.end + 3 * drive.elastic_period)
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


# heat ------------------------------------------------------------------------------------------------------


def test_the_least_heat_is_momentum_by_cauchy_and_schwarz() -> None:
    for given in ({}, {"torque_lag": 0.004, "damping": 0.5}):
        drive = CRANE.replace(**given)
        mean = (drive.J1 + drive.J2) * 60.0 / 0.3 + drive.Mc
        exact = mean**2 * 0.3 / drive.Ms**2
        assert least_heat(Problem(drive, 0.3, minimise="heat")) == pytest.approx(exact, rel=1e-9)
    # (H + Mc t)^2/t is least at t = H/Mc: 4 H Mc, however much more time there is
    H = 0.21 * 60.0
    for time in (1.0, 2.0, 10.0):
        found = least_heat(Problem(CRANE, time * H / 7.16, minimise="heat"))
        assert found == pytest.approx(4.0 * H * 7.16 / 62.0**2, rel=1e-9)
    friction = Problem(CRANE.replace(load_kind="reactive"), 0.3, minimise="heat", k_dyn=1.0)
    moves = 0.175 * 60.0 / (friction.base_torque - 7.16)  # no sooner than at the largest T
    impulse = 0.21 * 60.0 + 7.16 * moves
    assert least_heat(friction) == pytest.approx(impulse**2 / 0.3 / 62.0**2, rel=1e-9)


def test_no_start_has_less_heat() -> None:
    """Optima of K_dyn are starts; where only the load has its speed, or a brake helps, no bound is known."""
    for drive, time in ((CRANE, LONG), (CRANE.replace(load_kind="reactive"), 0.3)):
        best = optimize(drive, time)
        bound = least_heat(Problem(drive, time, minimise="heat", k_dyn=best.k_dyn))
        assert 0.5 * best.heat < bound < best.heat
        assert best.heat == pytest.approx(heat_of(best.run, best.end_time), rel=1e-12)
    assert least_heat(Problem(CRANE, 0.3, "reached", "heat")) == 0.0
    assert least_heat(Problem(HELD.replace(release=0.05), 0.4, minimise="heat")) == 0.0
    assert least_heat(Problem(damped_crane(), 0.4, minimise="heat")) == 0.0
    belt = CRANE.replace(load_torque=6.0, load_friction=2.0)
    best = optimize(belt, LONG)
    bound = least_heat(Problem(belt, LONG, minimise="heat", k_dyn=best.k_dyn))
    mean = 0.21 * 60.0 / LONG + 4.0  # it takes 6 - 2 N m at the least
    assert best.heat > bound == pytest.approx(mean**2 * LONG / 62.0**2, rel=1e-9)
    assert least_heat(Problem(belt.replace(load_friction=6.0), 0.4, minimise="heat", k_dyn=1.0)) == 0.0


def test_the_bounds_of_a_load_with_both_parts() -> None:
    """Between those of the parts alone, equal to them in the limits; held at rest it is a reactive load."""
    for time in (LONG, 0.4):
        of = {
            share: momentum_bound(
                Problem(
                    CRANE.replace(load_torque=share * 7.16, load_friction=(1.0 - share) * 7.16, damping=1.0),
                    time,
                )
            ).k_dyn
            for share in (0.0, 0.3, 0.5, 0.7, 1.0 - 1e-12)
        }
        reactive = momentum_bound(Problem(CRANE.replace(load_kind="reactive", damping=1.0), time)).k_dyn
        assert [of[share] for share in (0.0, 0.3, 0.5)] == pytest.approx([reactive] * 3, rel=1e-12)
        braked = CRANE.replace(damping=1.0, minimum_torque=-1e-9)  # the plain line, without a gentle contact
        assert of[1.0 - 1e-12] == pytest.approx(momentum_bound(Problem(braked, time)).k_dyn, rel=1e-6)
        assert reactive <= of[0.7] * (1.0 + 1e-3)
