"""Ends held fast and load curves, in closed form and at another shaft."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from softstart import Drive, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.chain.periodic_torque import PeriodicTorque
from softstart.errors import InputError
from softstart.optimal.bounds import momentum_bound
from softstart.optimal.problem import Problem
from softstart.vibration import natural_vibration, reduce_chain

CRANE = Drive.load("crane-4amtkf")  # constant torque takes nothing from it


@pytest.mark.parametrize(("restitution", "mirrored"), [(0.0, True), (0.7, False), (1.0, True)])
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
    run = simulate(chain, "direct", 0.7, fitted_to=CRANE)
    assert run.at(0.7)["torques"][1] == pytest.approx(10.0 * (1.0 - math.cos(5.0 * 0.7)), rel=1e-13)
    assert run.peak_torques[1] == pytest.approx(20.0, rel=1e-13)
    assert natural_vibration(chain).Omega[1] == pytest.approx(5.0, rel=1e-14)


def test_a_fan_settles_where_its_curve_meets_the_torque():
    """One body under 20 N m against 0.4 N m s w: 50 rad/s (1 - exp(-0.4 t/J)); beyond its points 4 N m."""
    fan = Mass(1.0, name="fan", curve_speed=[0.0, 100.0], curve_torque=[0.0, 40.0])
    chain = Chain([Mass(1.0), fan], [Shaft(stiffness="inf")], Motor(20.0), target_speed=40.0)
    run = simulate(chain, "direct", 3.0, fitted_to=CRANE)
    assert run.at(3.0)["w"][1] == pytest.approx(50.0 * (1.0 - math.exp(-0.6)), rel=1e-13)
    low = replace(chain, masses=(chain.masses[0], fan.replace(curve_speed=[0, 10], curve_torque=[0, 4])))
    run = simulate(low, "direct", 3.0, fitted_to=CRANE)
    since = -math.log(0.8) / 0.2
    assert run.at(3.0)["w"][1] == pytest.approx(10.0 + 8.0 * (3.0 - since), rel=1e-13)


@pytest.mark.parametrize("by", ["curve_speed", "curve_angle"])
def test_a_load_curve_behind_a_gear_is_that_at_the_shaft_of_the_motor(by):
    """Behind a gear of 4 the load turns a quarter as fast, with 4 times the torque, 16 times the inertia."""
    motor, rotor = Motor(62.0, torque_lag=0.004), Mass(0.03, name="rotor")
    points, torques = np.array([0.0, 8.0, 40.0, 90.0]), np.array([2.0, 9.0, 4.0, 30.0])

    def chain(ratio: float) -> Chain:
        fan = Mass(0.2 * ratio**2, curve_torque=torques * ratio, **{by: points / ratio})
        shaft = Shaft(4e3, damping=0.5, gap=0.1, ratio=ratio)
        return Chain([rotor, fan], [shaft], motor, target_speed=80.0)  # of the motor

    here, there = (simulate(chain(ratio), "direct", fitted_to=CRANE) for ratio in (1.0, 4.0))
    assert there.peak_torque == pytest.approx(here.peak_torque, rel=1e-12)
    assert there.start_time == pytest.approx(here.start_time, rel=1e-12)
    assert there.at(0.3)["w"] == pytest.approx(here.at(0.3)["w"], rel=1e-11)
    straight = Chain([rotor, Mass(0.2)], [Shaft(4e3, damping=0.5, gap=0.1)], motor, target_speed=80.0)
    assert here.start_time > 1.05 * simulate(straight, "direct").start_time


def test_a_chain_with_all_of_them():
    """Its file is written back as it was, at another shaft it is the same start; alone as in a batch."""
    fan = Mass("0.2 kg*m^2", curve_speed=["0 rpm", "440 rpm", "880 rpm"], curve_torque=[0.0, 5.0, 20.0])
    shafts = [
        Shaft(4e3, gap=0.1, damping_ratio=0.02, ratio=3, efficiency=0.8, side="after"),
        Shaft(300.0, gap=0.05, damping_ratio=0.02, ratio=4),
    ]
    motor = Motor(62.0, torque_lag="5 ms", initial_torque="10 N*m")
    chain = Chain([Mass(0.03), fan, Mass("inf")], shafts, motor, target_speed="20 rpm")
    assert chain.load_mass == "mass 2"
    assert Chain.from_toml(chain.to_toml()) == chain
    hums = [
        {"mass 2": PeriodicTorque(0.0, [1.0], [size], [0.0], speed=50.0)} for size in (30.0, 30.0 / 3.0, 0.0)
    ]
    run, there, quiet = (
        simulate(one, "direct", fitted_to=CRANE, excitation=hum)
        for one, hum in zip((chain, chain.brought_to("motor"), chain), hums, strict=True)
    )
    assert there.peak_torques == pytest.approx(run.peak_torques, rel=1e-10)
    assert there.energy.gears == pytest.approx(run.energy.gears, rel=1e-10)
    assert run.energy.gears > 0.0
    assert quiet.peak_torque != pytest.approx(run.peak_torque, rel=1e-6)
    batch = simulate([chain, chain.scaled(gaps=2.0), chain], "direct", fitted_to=CRANE)
    assert batch.peak_torques[[0, 2]].values.tolist() == [quiet.peak_torques.tolist()] * 2
    assert momentum_bound(Problem(chain, 1.0)).k_dyn == 0.0
    notes = " ".join(reduce_chain(chain, force=True).notes)
    for words in ("stays at rest", "load curves of mass 2", "0.8) are left out of the drive"):
        assert words in notes


def test_what_is_refused():
    curve = {"curve_speed": [0.0, 1.0], "curve_torque": [0.0, 1.0]}
    for sentence, wrong in {
        "order them": lambda: Mass(1.0, **curve | {"curve_speed": [1.0, 0.0]}),
        "speeds or angles": lambda: Mass(1.0, **curve, curve_angle=[0.0, 1.0]),
        "stays at rest": lambda: Mass("inf", initial_speed=1.0),
        "first or the last": lambda: Chain([Mass(1), Mass("inf"), Mass(1)], [Shaft(1.0)] * 2),
        "that move": lambda: Chain([Mass(1), Mass("inf", name="x")], [Shaft(1)], Motor(1, mass="x")),
        "rigid joint": lambda: Chain([Mass(1), Mass(1), Mass("inf")], [Shaft(1), Shaft("inf")]),
    }.items():
        with pytest.raises(InputError, match=sentence):
            wrong()
