"""Rigid gaps: impacts, their accumulation, and flanks that press until they would have to pull."""

from __future__ import annotations

import math
from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.kernel.pieces import Pieces

from softstart import Drive, InputError
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.start.simulation import simulate

CRANE = Drive.load("crane-4amtkf")  # what the pieces are set up for: they take nothing from it


def around(run, when: float):
    """Speeds just before and at an event."""
    return run.at(np.nextafter(when, 0.0))["w"], run.at(when)["w"]


@given(
    J=st.lists(st.floats(0.01, 10.0), min_size=3, max_size=3),
    w=st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3),
    restitution=st.floats(0.05, 1.0),
)
@settings(max_examples=25, deadline=None)
def test_momentum_is_kept_and_energy_lost_by_the_restitution(J, w, restitution):
    """Three free masses: each impact keeps momentum to 1e-12 and loses (1 - e^2) of the relative energy."""
    shafts = [Shaft(gap=0.2, restitution=restitution), Shaft(gap=0.3, restitution=restitution)]
    chain = Chain([Mass(J[i], initial_speed=w[i]) for i in range(3)], shafts)
    run = simulate(chain, None, 1.0)
    inertia = np.array(J)
    scale = float(inertia @ np.abs(run.w).max(axis=0)) + 1e-300
    times = np.array([event.time for event in run.events])
    for event in [e for e in run.events if e.kind == "impact"]:
        if np.sum(np.abs(times - event.time) < 1e-9) > 1 or event.time >= run.end_time:
            continue  # another one at the same instant, or the end of the run: no state lies between or after
        before, after = around(run, event.time)
        k = event.place
        assert float(inertia @ (after - before)) == pytest.approx(0.0, abs=1e-12 * scale)
        v, rebound = before[k] - before[k + 1], after[k] - after[k + 1]
        assert rebound == pytest.approx(-restitution * v, abs=1e-13 * np.abs(run.w).max())
        reduced = J[k] * J[k + 1] / (J[k] + J[k + 1])
        lost = 0.5 * float(inertia @ (before**2 - after**2))
        energy = 0.5 * float(inertia @ before**2)
        assert lost == pytest.approx(0.5 * (1 - restitution**2) * reduced * v**2, abs=1e-12 * energy)
        assert event.value == pytest.approx(lost, abs=1e-12 * energy)
        impulse = (1 + restitution) * reduced * abs(v)
        assert abs(event.impulse) == pytest.approx(impulse, rel=1e-9, abs=1e-13 * scale)
    assert abs(run.energy.residual) <= 1e-13 * (0.5 * float(inertia @ np.square(w)) + 1e-300)


def bounced(restitution: float):
    """Three equal masses: the first meets the second, which bounces between it and the third."""
    masses = [Mass(1.0, initial_speed=1.0), Mass(1.0), Mass(1.0, initial_speed=-1.0)]
    shafts = [Shaft(gap=0.2, restitution=restitution), Shaft(gap=0.21, restitution=restitution)]
    return simulate(Chain(masses, shafts), None, 2.0)


def test_three_masses_collapse_below_the_known_restitution():
    """Equal masses have infinitely many impacts in a finite time if e < 7 - 4 sqrt(3), else a few."""
    limit = 7.0 - 4.0 * math.sqrt(3.0)
    for restitution in (0.5 * limit, 0.9 * limit, 0.99 * limit):
        run = bounced(restitution)
        assert "impacts over, flanks press" in [e.kind for e in run.events]
        w = run.at(run.end_time)["w"]
        assert w == pytest.approx(0.0, abs=1e-7)
        assert float(w.sum()) == pytest.approx(0.0, abs=1e-14)
        assert run.energy.impacts == pytest.approx(1.0, rel=1e-12)
    for restitution in (1.01 * limit, 1.1 * limit, 0.5, 1.0):
        run = bounced(restitution)
        assert {e.kind for e in run.events} == {"impact"}
        assert len(run.events) < 100


@given(restitution=st.floats(0.0, 0.97))
@settings(max_examples=20, deadline=None)
def test_impacts_pile_up_at_the_known_instant(restitution):
    """First impact at t1 = sqrt(2 s/a), then flights of 2 e^k v/a: the sum is t1 (1 + 2 e/(1 - e))."""
    first = math.sqrt(2 * 0.1 / 3.0)
    end = first * (1 + 2 * restitution / (1 - restitution))
    shaft = Shaft(gap=0.2, restitution=restitution)
    chain = Chain([Mass(1.0), Mass(2.0)], [shaft], Motor(3.0), target_speed=1e3)
    run = simulate(chain, Pieces(pieces=((0.0, 3.0),)), end + 1.0, fitted_to=CRANE)
    over = [e for e in run.events if e.kind == "impacts over, flanks press"]
    assert len(over) == 1
    assert over[0].time == pytest.approx(end, rel=1e-13)
    last = run.at(run.end_time)
    assert last["w"] == pytest.approx(3.0 * run.end_time / 3.0, rel=1e-12)
    assert last["w"][0] == last["w"][1]
    assert last["twist"][0] == 0.1
    assert last["torques"][0] == pytest.approx(2.0, rel=1e-13)  # what the second mass needs
    relative = 0.5 * (1.0 * 2.0 / 3.0) * (3.0 * first) ** 2
    if restitution == 0.0:
        assert run.energy.impacts == pytest.approx(relative, rel=1e-13)
    assert abs(run.energy.residual) < 1e-12 * run.energy.motor


def test_the_impulse_of_a_shaft_is_its_largest_and_a_contact_that_takes_no_time_is_the_first() -> None:
    """By hand: 3 N m on two masses of 1 kg m2 on a spring, the second of which bounces off a third.

    T = 1.5 (1 - cos(w t)) N m until the flanks meet after 1 rad, and the path from motor to load closes and
    opens at once: what the spring has carried by then is the peak of the first contact.
    """
    shafts = [Shaft(100.0), Shaft(gap=2.0, restitution=0.5)]
    chain = Chain([Mass(1.0), Mass(1.0), Mass(2.0)], shafts, Motor(3.0), target_speed=1e3)
    run = simulate(chain, Pieces(pieces=((0.0, 3.0),)), 3.0, fitted_to=CRANE)
    w, t = math.sqrt(200.0), run.first_contact
    assert 0.75 * t**2 - 0.0075 * (1.0 - math.cos(w * t)) == pytest.approx(1.0, rel=1e-12)
    v = 1.5 * t - 0.0075 * w * math.sin(w * t)
    assert (run.impact_speed, run.contacts) == (pytest.approx(v, rel=1e-12), len(run.events))
    assert [stage.number for stage in run.stages[:3]] == [1, 3, 5]
    assert run.k_dyn_first_contact * run.base_torque == pytest.approx(3.0, rel=1e-12)
    assert run.peak_torque > 3.5
    impulses = [abs(event.impulse) for event in run.events]
    assert impulses[0] == pytest.approx(1.5 * v * 2.0 / 3.0, rel=1e-12)
    assert run.peak_impulses.tolist() == [0.0, max(impulses)]
    assert impulses[-1] < max(impulses)


def test_pressed_flanks_part_when_they_would_have_to_pull():
    """A torque that sinks along a line: the flanks part at its zero, where their torque is zero."""
    motor = Motor(3.0, minimum_torque=-3.0, torque_rate=2.0)
    chain = Chain([Mass(1.0), Mass(2.0)], [Shaft(gap=0.2, restitution=0.3)], motor, target_speed=1e3)
    run = simulate(chain, Pieces(pieces=((0.0, 3.0), (4.0, -3.0))), 7.0, fitted_to=CRANE)
    opened = [e for e in run.events if e.kind == "gap opened"]
    assert [e.time for e in opened] == pytest.approx([5.5], rel=1e-13)
    assert run.at(5.5 * (1 - 1e-9))["torques"][0] == pytest.approx(0.0, abs=1e-7)
    assert run.at(5.6)["twist"][0] < 0.1
    # then 1/J of a torque of -2 s: -s^3/3 until the other flank, 0.2 rad away
    other = next(e for e in run.events if e.time > 5.6 and e.kind == "impact")
    assert other.time == pytest.approx(5.5 + 0.6 ** (1 / 3), rel=1e-12)


def test_a_pressed_body_is_struck_as_one_and_let_go_by_a_blow_that_pulls():
    """Masses 2 and 3 lie on each other, 2 pushing: blows on 2 from behind and on 3 from ahead press."""
    masses = [Mass(1.0, initial_speed=4.0), Mass(0.5), Mass(0.7), Mass(0.3, initial_speed=0.0)]
    shafts = [
        Shaft(gap=0.2, restitution=0.5),
        Shaft(gap=0.2, restitution=0.2, start_position=0.1),
        Shaft(gap=0.4, restitution=1.0),
    ]
    chain = Chain(masses, shafts, Motor(1.0, mass="mass 2"), target_speed=1e3)
    run = simulate(chain, Pieces(pieces=((0.0, 1.0),)), 0.5, fitted_to=CRANE)
    assert (run.events[0].kind, run.events[0].time) == ("impacts over, flanks press", 0.0)
    blow = next(e for e in run.events if e.kind == "impact")
    assert blow.place == 0
    before, after = around(run, blow.time)
    assert before[1] == before[2]
    assert after[1] == after[2]
    J, v = np.array([1.0, 0.5, 0.7, 0.3]), before[0] - before[1]
    assert after[1] - before[1] == pytest.approx(1.5 * v / (1 + 1.2), rel=1e-12)
    assert J @ after == pytest.approx(J @ before, rel=1e-13)
    # the third mass, in front, meets the fourth: the blow presses 2 on 3 once more
    second = next(e for e in run.events if e.place == 2 and e.kind == "impact")
    before, after = around(run, second.time)
    assert after[1] == after[2]
    assert J @ after == pytest.approx(J @ before, rel=1e-13)
    assert abs(run.energy.residual) < 1e-13 * 8.0


def test_a_blow_from_behind_opens_pressed_flanks():
    """1 pushes 2 at no distance; 3 is faster and pulls 2 along: 1 is not taken with it."""
    masses = [Mass(0.5), Mass(0.7), Mass(2.0, initial_speed=3.0)]
    shafts = [Shaft(gap=0.2, restitution=0.0, start_position=0.1), Shaft(gap=0.2, restitution=0.5)]
    chain = Chain(masses, shafts, Motor(1.0), target_speed=1e3)
    run = simulate(chain, Pieces(pieces=((0.0, 1.0),)), 0.1, fitted_to=CRANE)
    blow = next(e for e in run.events if e.kind == "impact" and e.place == 1)
    before, after = around(run, blow.time)
    assert before[0] == before[1]
    assert after[0] == pytest.approx(before[0], rel=1e-13)
    assert after[1] > before[1]
    assert ("gap opened", 0, blow.time) in [(e.kind, e.place, e.time) for e in run.events]


def test_a_rigid_joint_carries_what_moves_the_masses_behind_it():
    chain = Chain(
        [Mass(1.0), Mass(2.0), Mass(3.0)], [Shaft("inf"), Shaft(1e3)], Motor(12.0), target_speed=2.0
    )
    run = simulate(chain, Pieces(pieces=((0.0, 12.0),)), fitted_to=CRANE)
    joined = Chain([Mass(3.0), Mass(3.0)], [Shaft(1e3)], Motor(12.0), target_speed=2.0)
    same = simulate(joined, Pieces(pieces=((0.0, 12.0),)), fitted_to=CRANE)
    assert run.start_time == pytest.approx(same.start_time, rel=1e-13)
    assert run.peak_torques[1] == pytest.approx(same.peak_torques[0], rel=1e-13)
    T = run.at(run.t)["T"]
    assert T[:, 0] == pytest.approx(12.0 - (12.0 - T[:, 1]) / 3.0, rel=1e-12)


def test_masses_that_are_joined_rigidly_start_with_one_speed_to_the_digits_of_a_data_sheet():
    for off, refused in ((0.9e-6, False), (1.1e-6, True)):
        masses = [Mass(1.0, initial_speed=3.0), Mass(2.0, initial_speed=3.0 * (1.0 + off))]
        with pytest.raises(InputError, match="give both the same") if refused else nullcontext():
            simulate(Chain(masses, [Shaft("inf")]), None, 1.0)


def test_friction_holds_a_body_of_pressed_masses_by_its_sum():
    """Two masses with friction 1 and 2 on a rigid joint: they break away at 3 N m, not before."""
    masses = [Mass(1.0, torque=1.0, kind="reactive"), Mass(2.0, torque=2.0, kind="reactive"), Mass(1.0)]
    chain = Chain(masses, [Shaft("inf"), Shaft(100.0)], Motor(6.0, torque_rate=1.0), target_speed=0.5)
    run = simulate(chain, Pieces(pieces=((0.0, 6.0),)), fitted_to=CRANE)
    starts = [e for e in run.events if e.kind == "load starts"]
    assert [(e.place, e.time) for e in starts] == [(0, pytest.approx(3.0)), (1, pytest.approx(3.0))]
    # friction is shared as it can hold: a third of the motor's torque stays at mass 1
    assert run.at(1.5)["torques"][0] == pytest.approx(1.0, rel=1e-12)


def test_a_gear_in_a_held_body_holds_no_more_than_it_can():
    """3 N m press the second mass on the first, which alone can hold them: the gear grips 0.1 N m at most."""
    masses = [Mass(1.0, torque=10.0, kind="reactive"), Mass(1.0, torque=3.0), Mass(1.0)]
    flanks = Shaft(gap=0.1, restitution=0.0, start_position=0.05)
    geared = Shaft(100.0, efficiency=0.5, side="after", start_position=0.001)
    chain = Chain(masses, [flanks, geared], Motor(4.0, minimum_torque=-4.0), target_speed=1.0)
    run = simulate(chain, Pieces(pieces=((0.0, -4.0),)), 0.5, fitted_to=CRANE)
    assert [e.kind for e in run.events] == ["gear lets go", "impacts over, flanks press", "gear holds"]
    assert run.events[-1].time == 0.0
    found = run.at(np.linspace(0.0, 0.5, 101))
    assert not found["w"][:, :2].any()
    left = found["torques"][:, 0] - 3.0 - found["torques"][:, 1]
    assert np.abs(left).max() < 0.1  # but for what the gear holds


def rattling(seed: int) -> tuple[Chain, Pieces]:
    """Up to six masses, most joints rigid gaps of any restitution, friction, torque that turns round."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 7))
    shafts, speeds = [], [float(rng.normal() * (rng.random() < 0.5)) for _ in range(count)]
    for k in range(count - 1):
        kind, gap = rng.random(), float(10 ** rng.uniform(-2, -0.5))
        if kind < 0.7:
            place = float(rng.choice([0.0, 0.5, -0.5, rng.uniform(-0.5, 0.5)]) * gap)
            restitution = float(rng.choice([0.0, 0.3, 0.6, 0.9, 1.0]))
            shafts.append(Shaft(gap=gap, restitution=restitution, start_position=place))
        elif kind < 0.9:
            shafts.append(Shaft(float(10 ** rng.uniform(1, 4)), damping=float(rng.random()), gap=gap))
        else:
            shafts.append(Shaft("inf"))
            speeds[k + 1] = speeds[k]
    masses = [
        Mass(
            float(10 ** rng.uniform(-1, 1)),
            torque=float(rng.uniform(0, 3) * (rng.random() < 0.6)),
            kind="reactive" if rng.random() < 0.6 else "active",
            initial_speed=speed,
        )
        for speed in speeds
    ]
    place, rate = f"mass {rng.integers(count) + 1}", float(rng.choice([math.inf, 200.0]))
    motor = Motor(20.0, mass=place, minimum_torque=-20.0, torque_rate=rate)
    pieces = tuple((t, float(rng.uniform(-10, 20))) for t in (0.0, 0.3, 0.7, 1.2))
    return Chain(masses, shafts, motor, target_speed=1e3), Pieces(pieces=pieces)


@pytest.mark.parametrize("block", range(4))
def test_whatever_rattles_keeps_its_energy_and_its_flanks(block):
    """Energy balance to 1e-12, and no flank is ever passed."""
    for seed in range(40 * block, 40 * (block + 1)):
        chain, pieces = rattling(seed)
        run = simulate(chain, pieces, 2.0, fitted_to=CRANE)
        energy, arrays = run.energy, chain.at_motor_shaft()
        moved = abs(energy.motor) + abs(energy.kinetic) + abs(energy.load) + abs(energy.impacts)
        assert abs(energy.residual) <= 1e-12 * moved, seed
        rigid = arrays.rigid
        beyond = np.abs(run.twist[:, rigid]).max(axis=0) - 0.5 * arrays.gap[rigid]
        assert np.all(beyond <= 1e-13), seed
        times = [event.time for event in run.events]
        assert times == sorted(times)
