"""Strategies on a load torque with an active part and friction: limits, and what they assume of the load."""

from __future__ import annotations

import numpy as np
import pytest
from tests.softstart.kernel.pieces import Pieces

from softstart import Drive, simulate
from softstart.controller.finding import make_controller, ready_controller_names
from softstart.formulas import contact_stage
from softstart_controllers import contact, shaped
from softstart_controllers.reduced import load_drift, stage_2_duration

CRANE = Drive.load("crane-4amtkf").replace(encoder_lines=4096)
ESTIMATING = ("pulse-coast-hold", "shaped", "state-feedback", "current-limit-feedback")
# without a start position, which follows from the load
LOOSE = Drive(**{name: value for name, value in CRANE.given().items() if name != "start_position"})


def test_where_friction_holds_the_load_it_is_that_of_a_reactive_one_with_the_sum() -> None:
    """Forward under T >= 0 nothing else shows: the same K_dyn, to rounding, from every position.

    An estimate of w2 may be below 0 by its noise, where the two loads differ: within 0.3 %.
    """
    held = LOOSE.replace(load_torque=3.0, load_friction=4.16)
    reactive = LOOSE.replace(load_torque=7.16, load_kind="reactive")
    assert (held.start_position, held.rests, held.falling_torque) == ("unknown", True, 0.0)
    for name in ready_controller_names():
        mine, other = simulate(held, name), simulate(reactive, name)
        near = 3e-3 if name in ESTIMATING else 1e-9
        assert mine.k_dyn == pytest.approx(other.k_dyn, rel=near), name
        assert mine.start_time == pytest.approx(other.start_time, rel=near), name


@pytest.mark.parametrize("kind", ["active", "reactive"])
def test_the_limits_are_the_loads_of_one_part(kind: str) -> None:
    """Friction of 1e-14 of the torque changes nothing, nor an active torque of 1e-14 of the friction."""
    alone = CRANE.replace(load_kind=kind, start_position="mid-gap")
    little = 1e-14 * 7.16
    both = {
        "active": CRANE.replace(load_friction=little, start_position="mid-gap"),
        "reactive": CRANE.replace(load_torque=little, load_friction=7.16, start_position="mid-gap"),
    }[kind]
    for name in ("direct", "s-curve", "pulse-coast-hold"):
        assert simulate(both, name).k_dyn == pytest.approx(simulate(alone, name).k_dyn, rel=1e-9)
    exact = CRANE.replace(load_torque=0.0, load_friction=7.16, start_position="mid-gap")
    if kind == "reactive":
        assert simulate(exact, "direct").k_dyn == simulate(alone, "direct").k_dyn


def test_what_strategies_assume_of_the_load() -> None:
    """Slowed by lift + friction forward, pushed back by lift - friction, held where friction is larger."""
    J2 = float(CRANE.J2)
    belt = CRANE.replace(load_torque=5.0, load_friction=2.0)
    assert load_drift(belt) == 3.0 / J2
    assert load_drift(belt.replace(initial_speed=1.0)) == 7.0 / J2
    assert load_drift(belt.replace(initial_speed=-1.0)) == 3.0 / J2
    assert load_drift(belt.replace(load_friction=5.0)) == 0.0
    assert load_drift(belt.replace(load_torque=-5.0)) == -3.0 / J2
    held = belt.replace(load_friction=5.0)
    dw12 = np.sqrt(2.0 * 15.5 / CRANE.J1 * 0.25)
    exact = contact_stage(15.5, CRANE.J1, CRANE.J2, 10.0, CRANE.c, dw12, "reactive").duration
    assert stage_2_duration(held, 15.5) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("friction", [0.0, 2.0, 5.0])
@pytest.mark.parametrize("w2", [0.0, 4.0])
def test_the_estimated_speed_of_a_load_in_the_open_gap(friction: float, w2: float) -> None:
    """`drift_since` against the start itself, before and after the load has stopped."""
    drive = CRANE.replace(
        load_torque=5.0, load_friction=friction, gap=300.0, initial_speed=w2, start_position="mid-gap"
    )
    run = simulate(drive, Pieces(pieces=((0.0, 0.0),)), until=0.6)
    numbers = make_controller("shaped").fitted(drive).vector(drive)
    p = numbers.view(shaped.PARAMETERS)[0].landing.estimator
    m = np.zeros(1, contact.STATE)[0]
    m["load_speed"], m["b"] = w2, 1.0 / drive.J2
    for t in (0.05, 0.2, 0.5):
        speed = w2 - contact.drift_since(p, m, t) / drive.J2
        assert speed == pytest.approx(float(run.at(t)["w2"]), abs=1e-9)


def test_every_strategy_starts_a_load_with_both_parts() -> None:
    """From a hanging one behind a brake and, without one, from a gap through which the load falls."""
    belt = CRANE.replace(load_torque=8.0, load_friction=3.0, damping=1.0, gap=0.1)
    for drive in (belt, belt.replace(start_position="hanging", brake="motor")):
        for name in ("acceleration-delay", *ESTIMATING, "take-up"):
            run = simulate(drive, name)
            assert run.status.name == "REACHED", name
            assert run.k_dyn < 3.0, name
