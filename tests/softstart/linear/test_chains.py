"""The loop of a controller on a whole chain: equal to that of two masses, and to the exact start of many."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.softstart.linear.speed_loops import SpeedPI
from tests.twin import chain_of

from softstart import Drive, InputError, linear_view
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.linear.law import SampledStart, operating_points, run_until_steady
from softstart.linear.plant import contact_plant

CRANE = Drive.load("crane-4amtkf").replace(damping=0.5, torque_lag="2 ms")
CHAIN = Chain.from_toml(
    Chain.load("crane-4-mass").to_toml(), also={f"shaft[{k}].damping_ratio": "0.02" for k in (1, 2, 3)}
)


@pytest.mark.parametrize(
    ("drive", "controller"),
    [
        (CRANE.replace(damping=0.0, torque_lag=0.0), "current-limit-feedback"),
        (CRANE.replace(encoder_lines=1024, computing_delay="0.4 ms"), SpeedPI(1.0, 3.0)),
    ],
)
def test_two_masses_have_the_loop_of_their_drive(drive, controller):
    chain = chain_of(drive)
    one = linear_view(drive, controller)
    two = linear_view(chain, controller, fitted_to=drive)
    assert two.kind == one.kind == "loop"
    assert two.loop.stable == one.loop.stable
    assert two.loop.point.mismatch < 1e-6
    for name in ("gain_margin", "phase_margin", "delay_margin", "modulus_margin"):
        expected = getattr(one.loop.margins, name)
        assert getattr(two.loop.margins, name) == pytest.approx(expected, rel=1e-6), name
    for a, b in zip(two.variations, one.variations, strict=True):
        assert (a.name, a.stable) == (b.name, b.stable)
        assert a.margins.phase_margin == pytest.approx(b.margins.phase_margin, rel=1e-5)


def random_chain(seed):
    """Three to five masses, one or two rigid joints, dampings, gears with losses, the motor anywhere."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 6))
    masses = [
        Mass(float(10.0 ** rng.uniform(-2.5, -0.7)), name=f"m{i}", damping=float(rng.choice([0.0, 0.002])))
        for i in range(count)
    ]
    motor, load = ("m0", f"m{count - 1}") if rng.random() < 0.6 else ("m1", "m0" if count > 3 else "m2")
    shafts = []
    for k in range(count - 1):
        beside = masses[k].name == motor or masses[k + 1].name == motor
        if not beside and rng.random() < 0.2:
            shafts.append(Shaft(math.inf))
            continue
        c, zeta = float(10.0 ** rng.uniform(2.3, 3.5)), float(rng.uniform(0.01, 0.06))
        more = {"gap": float(rng.choice([0.0, 0.05])), "efficiency": float(rng.choice([1.0, 0.93]))}
        more |= {"side": str(rng.choice(["before", "after"])), "ratio": float(rng.choice([1.0, 2.0]))}
        shafts.append(Shaft(c, damping_ratio=zeta, **more))
    if load == f"m{count - 1}":
        masses[-1] = masses[-1].replace(torque=1.0)
    lag = float(rng.choice([0.0, 0.002]))
    return Chain(
        masses, shafts, Motor(30.0, maximum_torque=90.0, minimum_torque=-90.0, mass=motor, torque_lag=lag),
        load_mass=load, target_speed=60.0, position="driving-flank", name=f"chain {seed}",
    )  # fmt: skip


@pytest.mark.parametrize("seed", [3, 11])
def test_small_motions_of_the_whole_chain_are_those_of_the_loop(seed):
    """After small displacements in each direction the exact plant, under the controller, follows the loop."""
    start = SampledStart.of(random_chain(seed), SpeedPI(0.1, 0.5, 10.0), CRANE)
    points = operating_points(start, run_until_steady(start))
    assert points[0].mismatch < 1e-7


def test_with_all_gaps_open_the_motor_turns_alone_or_with_what_is_joined_to_it():
    assert contact_plant(CHAIN, gaps_open=True).A.shape == (2, 2)
    joined = Chain(CHAIN.masses, [CHAIN.shafts[0].replace(gap=0.0), *CHAIN.shafts[1:]], CHAIN.motor)
    assert contact_plant(joined, gaps_open=True).A.shape == (4, 4)
    view = linear_view(CHAIN, "take-up")
    assert view.loop.stable
    assert view.loop.point.mismatch < 1e-6
    alone = view.variations[-1]
    assert (alone.name, alone.stable) == ("all gaps open", True)
    assert alone.margins.phase_margin > view.loop.margins.phase_margin
    assert "limit_cycles" in view.summary()


def test_what_has_no_loop_is_refused():
    rigid = Chain(CHAIN.masses, [Shaft(math.inf), *CHAIN.shafts[1:]], CHAIN.motor)
    with pytest.raises(InputError, match="a shaft beside the motor is rigid"):
        linear_view(rigid, "take-up")
    with pytest.raises(InputError, match="no motor or no target speed"):
        linear_view(Chain(CHAIN.masses, CHAIN.shafts), "take-up")


@pytest.mark.parametrize(
    "curve",
    [
        {"curve_speed": [0.0, 1.0, 2.0, 5.0, 500.0], "curve_torque": [0.0, 0.01, 0.05, 0.1, 9.0]},
        {"curve_angle": [0.0, 0.1, 1.0, 2.0, 500.0], "curve_torque": [0.0, 0.5, 1.0, 3.0, 900.0]},
    ],
)
def test_a_load_curve_is_a_damper_or_a_spring_to_the_ground(curve):
    chain = random_chain(4)
    masses = (*chain.masses[:-2], chain.masses[-2].replace(**curve), chain.masses[-1])
    start = SampledStart.of(replace(chain, masses=masses), SpeedPI(0.1, 0.5, 10.0), CRANE)
    points = operating_points(start, run_until_steady(start))
    on_the_curve = [point for point in points if point.sample.plant["incline"].any()]
    assert on_the_curve[0].mismatch < 1e-7
