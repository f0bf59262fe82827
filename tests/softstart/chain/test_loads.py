"""Ends held fast, brakes, load curves and torque at t = 0: each against the independent integration."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.softstart.chain.oracle_starts import both, differences, random_chain

from softstart import simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.errors import InputError
from softstart.optimal.bounds import momentum_bound
from softstart.optimal.problem import Problem
from softstart.vibration import natural_vibration, reduce_chain
from softstart_studies.paper_r.vibration_with_gaps import chain_backbone

SEEDS = settings(
    max_examples=5, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
BALANCE = 1e-11  # of the energy that moves


def agree(drawn: dict[str, Any]) -> Any:
    """The start of the kernel, which the oracle confirms."""
    run, oracle = both(**drawn)
    found = differences(run, oracle)
    assert max(found.values()) < 1e-8, found
    energy = run.energy
    moved = abs(energy.motor) + abs(energy.exciting) + abs(energy.kinetic) + abs(energy.load)
    assert abs(energy.residual) < BALANCE * moved
    return run


def held_at(drawn: dict[str, Any], end: int) -> dict[str, Any]:
    """The chain with its first (0) or last (-1) mass held fast, motor and load on masses that move."""
    count = drawn["J"].size
    J, w0, Mc = drawn["J"].copy(), drawn["w0"].copy(), drawn["Mc"].copy()
    J[end], w0[end], Mc[end] = math.inf, 0.0, 0.0
    motor = min(max(drawn["motor"], 1), count - 1) if end == 0 else min(drawn["motor"], count - 2)
    return drawn | {"J": J, "w0": w0, "Mc": Mc, "motor": motor, "load": -1 if end == 0 else -2}


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(3, 6), end=st.sampled_from([0, -1]))
@SEEDS
def test_a_chain_held_at_one_end(seed, count, end):
    agree(held_at(random_chain(np.random.default_rng(seed), count), end))


@pytest.mark.parametrize("restitution", [0.0, 0.7, 1.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_impacts_on_a_wall(restitution, mirrored):
    """Masses thrown at a wall: the impulse of the first blow; the wall stays, no energy is lost sight of."""
    way = -1 if mirrored else 1
    masses = [Mass(1.0, initial_speed=way), Mass(2.0, initial_speed=3 * way), Mass("inf", name="wall")]
    shafts = [Shaft(50.0), Shaft(gap=0.002, restitution=restitution)]
    run = simulate(Chain(masses[::way], shafts[::way]), None, 2.0)
    first = next(event for event in run.events if event.impulse)
    before = math.cos(math.sqrt(75.0) * first.time) * 2.0 / 3.0 + 7.0 / 3.0  # of their common motion
    assert abs(first.impulse) == pytest.approx(2.0 * (1.0 + restitution) * before, rel=1e-12)
    times = np.linspace(0.0, 2.0, 200)
    states = run.at(times)
    assert not states["w"][:, 0 if mirrored else 2].any()
    assert np.abs(states["twist"][:, 0 if mirrored else 1]).max() <= 0.001 * (1.0 + 1e-12)
    assert abs(run.energy.residual) < 1e-11


def test_a_mass_on_a_shaft_to_ground():
    """One moving body on a spring to ground, under constant torque: u (1 - cos(sqrt(c/J) t))."""
    chain = Chain(
        [Mass(1.0), Mass(1.0), Mass("inf", name="ground")], [Shaft(stiffness="inf"), Shaft(50.0)],
        Motor(10.0),
        target_speed=1.0,
    )  # fmt: skip
    run = simulate(chain, "direct", 0.7, fitted_to=Chain.load("crane-4-mass"))
    assert run.at(0.7)["torques"][1] == pytest.approx(10.0 * (1.0 - math.cos(5.0 * 0.7)), rel=1e-13)
    assert run.peak_torques[1] == pytest.approx(20.0, rel=1e-13)
    assert natural_vibration(chain).Omega[1] == pytest.approx(5.0, rel=1e-14)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 5))
@SEEDS
def test_a_brake_holds_like_a_wall(seed, count):
    """A friction torque too large to move: with rest on its last mass the chain is that with a wall."""
    drawn = random_chain(np.random.default_rng(seed), count + 1)
    walled = held_at(drawn, -1)
    Mc, reactive = walled["Mc"].copy(), drawn["reactive"].copy()
    Mc[-1], reactive[-1] = 1e4, True
    braked = agree(walled | {"J": drawn["J"], "Mc": Mc, "reactive": reactive})
    wall = both(**walled, check=False)[0]
    assert braked.peak_torques == pytest.approx(wall.peak_torques, rel=1e-9)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 5), by_angle=st.booleans())
@SEEDS
def test_load_curves(seed, count, by_angle):
    """Torques over speed or angle, falling and rising, on up to two masses; reactive loads, lag and gaps."""
    rng = np.random.default_rng(seed)
    drawn = random_chain(rng, count)
    run = both(**drawn, check=False)[0]
    w = run.at(np.linspace(0.0, drawn["t_end"], 50))
    curves = {}
    for i in {int(rng.integers(count)), count - 1}:
        course = w["phi" if by_angle else "w"][:, i]
        size = max(float(np.ptp(course)), 1e-3)
        points = course.min() + size * np.sort(rng.uniform(-0.1, 1.1, 4)) + size * 0.02 * np.arange(4)
        curves[i] = (points, rng.uniform(-0.2, 0.5, 4) * drawn["pieces"][0][1], by_angle)
    agree(drawn | {"curves": curves})


def test_a_fan_settles_where_its_curve_meets_the_torque():
    """One body under 20 N m against 0.4 N m s w: 50 rad/s (1 - exp(-0.4 t/J)); beyond its points 4 N m."""
    fan = Mass(1.0, name="fan", curve_speed=[0.0, 100.0], curve_torque=[0.0, 40.0])
    chain = Chain([Mass(1.0), fan], [Shaft(stiffness="inf")], Motor(20.0), target_speed=40.0)
    run = simulate(chain, "direct", 3.0, fitted_to=Chain.load("crane-4-mass"))
    assert run.at(3.0)["w"][1] == pytest.approx(50.0 * (1.0 - math.exp(-0.6)), rel=1e-13)
    low = replace(chain, masses=(chain.masses[0], fan.replace(curve_speed=[0, 10], curve_torque=[0, 4])))
    run = simulate(low, "direct", 3.0, fitted_to=Chain.load("crane-4-mass"))
    since = -math.log(0.8) / 0.2
    assert run.at(3.0)["w"][1] == pytest.approx(10.0 + 8.0 * (3.0 - since), rel=1e-13)


@given(seed=st.integers(0, 2**32 - 1), share=st.floats(-0.9, 0.9))
@SEEDS
def test_torque_at_the_start_behind_a_lag(seed, share):
    drawn = random_chain(np.random.default_rng(seed), 3)
    drawn |= {"lag": 0.05 * drawn["t_end"], "u0": share * drawn["pieces"][0][1]}
    agree(drawn)
    agree(drawn | {"lag": 0.0, "rate": 8.0 * drawn["pieces"][0][1] / drawn["t_end"]})


FILE = """
[[mass]]
inertia = "0.03 kg*m^2"

[[shaft]]
stiffness = "4 kN*m/rad"
gap = "0.1 rad"
damping_ratio = 0.02

[[mass]]
inertia = "0.2 kg*m^2"
curve_speed = ["0 rpm", "440 rpm", "880 rpm"]
curve_torque = ["0 N*m", "5 N*m", "20 N*m"]

[[shaft]]
stiffness = "300 N*m/rad"
gap = "0.05 rad"
damping_ratio = 0.02
ratio = 4

[[mass]]
name = "spring to ground"
inertia = "inf"

[motor]
starting_torque = "62 N*m"
torque_lag = "5 ms"
initial_torque = "10 N*m"

[start]
target_speed = "20 rpm"
"""


def test_a_file_with_all_of_them():
    """The file is written back as it was, at another shaft it is the same start; alone as in a batch."""
    chain = Chain.from_toml(FILE)
    assert chain.load_mass == "mass 2"
    assert Chain.from_toml(chain.to_toml()) == chain
    run = simulate(chain, "direct")
    there = simulate(chain.brought_to("motor"), "direct")
    assert there.peak_torques == pytest.approx(run.peak_torques, rel=1e-10)
    batch = simulate([chain, chain.changed(gaps=2.0), chain], "direct")
    assert batch.peak_torques[0].values.tolist() == batch.peak_torques[2].values.tolist()
    assert batch.peak_torques[0].values.tolist() == run.peak_torques.tolist()
    assert chain.design_drive.load_inertia == pytest.approx(0.2)


def test_ground_is_drawn_and_the_rest_is_said():
    """The scheme draws it; what has no place for it, or for load curves, says so."""
    chain = Chain.from_toml(FILE)
    natural_vibration(chain).plot().draw_without_rendering()
    notes = " ".join(reduce_chain(chain, force=True).notes)
    assert "stays at rest" in notes
    assert "load curves of mass 2" in notes
    with pytest.raises(InputError, match="no ground"):
        chain_backbone(chain, 10.0)
    problem = Problem(chain, 1.0)
    assert momentum_bound(problem).k_dyn == 0.0
    with pytest.raises(InputError, match="leave no steady torque"):
        Problem(chain, 1.0, "steady")


def test_what_is_refused():
    curve = {"curve_speed": [0.0, 1.0], "curve_torque": [0.0, 1.0]}
    for wrong, sentence in {
        "order": (lambda: Mass(1.0, **curve | {"curve_speed": [1.0, 0.0]}), "order them"),
        "many": (lambda: Mass(1.0, **curve | {"curve_torque": [0.0]}), "as many of both"),
        "two": (lambda: Mass(1.0, **curve, curve_angle=[0.0, 1.0]), "speeds or angles"),
        "moves": (lambda: Mass("inf", initial_speed=1.0), "stays at rest"),
        "middle": (lambda: Chain([Mass(1), Mass("inf"), Mass(1)], [Shaft(1.0)] * 2), "first or the last"),
        "motor": (
            lambda: Chain([Mass(1), Mass("inf", name="x")], [Shaft(1)], Motor(1, mass="x")),
            "that move",
        ),
        "weld": (lambda: Chain([Mass(1), Mass(1), Mass("inf")], [Shaft(1), Shaft("inf")]), "rigid joint"),
        "at once": (lambda: Motor(1.0, initial_torque=0.5), "leave it out"),
    }.values():
        with pytest.raises(InputError, match=sentence):
            wrong()
