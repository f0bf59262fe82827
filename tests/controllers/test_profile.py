"""The controller `profile`: torque profiles played exactly, sampled, and taken over at the contact."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from tests import twin

from softstart import Drive, InputError, TorqueProfile, machine_table, simulate
from softstart.controller import make_controller
from softstart_controllers.profile import Profile

CRANE = Drive.load("crane-4amtkf")
SENSED = TorqueProfile(
    [0.0, 0.3], [6.0, 50.0], after_contact=TorqueProfile([0.0, 0.04, 0.04], [20.0, 30.0, 55.0])
)


@some.composite
def profiles(draw: some.DrawFn, lowest: float = -20.0, highest: float = 90.0) -> TorqueProfile:
    """Knots with steps among them, some of them at one instant, some torques repeated."""
    lengths = draw(some.lists(some.sampled_from([0.0, 5e-324, 1e-17, 0.001, 0.0137, 0.05]), max_size=7))
    torque = some.sampled_from([0.0, 62.0, 31.0]) | some.floats(lowest, highest)
    torques = draw(some.lists(torque, min_size=len(lengths) + 1, max_size=len(lengths) + 1))
    return TorqueProfile(np.cumsum([0.0, *lengths]), torques)


@settings(max_examples=60, deadline=None)
@given(profiles())
def test_the_demand_is_the_profile_at_every_instant(profile: TorqueProfile) -> None:
    """Without lag or limits the motor torque is the profile, steps included; beyond a limit it is cut."""
    drive = CRANE.replace(minimum_torque=-10.0, maximum_torque=70.0)
    run = simulate(drive, Profile(profile=profile), until=profile.end + 0.05)
    t = np.unique([*np.linspace(0.0, run.end_time, 400), *profile.time])
    np.testing.assert_allclose(run.at(t)["u"], profile.at(t).clip(-10.0, 70.0), rtol=0.0, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(profiles() | some.just(SENSED), some.sampled_from([0.0, 0.0013]), some.sampled_from([0.0, 0.0007]))
def test_twin_and_batch_agree(profile: TorqueProfile, period: float, late: float) -> None:
    lagging = CRANE.replace(torque_lag=0.003, torque_rate=2000.0, maximum_torque=70.0, damping=0.1)
    drive = lagging.replace(computing_delay=late)
    controller = Profile(profile=profile, period=period)
    run = simulate(drive, controller, until=0.3)
    plain = simulate(drive, twin.plain(controller, drive), until=0.3)
    many = simulate(machine_table(drive, maximum_torque=[62.0, 70.0]), controller, until=0.3)
    assert plain.peak_torque == run.peak_torque == float(many.peak_torque[1])
    assert plain.trajectory.states.tobytes() == run.trajectory.states.tobytes()


def test_after_the_contact_the_second_profile_runs_on_its_own_clock() -> None:
    run = simulate(CRANE, Profile(profile=SENSED), until=0.5)
    contact = run.first_contact
    second = SENSED.after_contact
    assert second is not None
    assert 0.01 < contact < 0.3
    before, after = np.linspace(0.0, contact, 50)[:-1], np.linspace(0.0, 0.1, 333)
    np.testing.assert_allclose(run.at(before)["u"], SENSED.at(before), atol=1e-12)
    apart = np.abs(after - 0.04) > 1e-12
    np.testing.assert_allclose(run.at(contact + after)["u"][apart], second.at(after)[apart], atol=1e-11)
    assert run.contacts > 1  # later contacts do not begin it again
    assert float(run.at(0.5)["u"]) == 55.0
    touching = CRANE.replace(start_position=0.5 * CRANE.gap + 0.03)
    at_once = simulate(touching, Profile(profile=SENSED), until=0.02)
    assert at_once.at([0.0, 0.01])["u"] == pytest.approx([20.0, 22.5], rel=1e-12)


def test_with_a_period_the_second_profile_begins_at_a_sample() -> None:
    run = simulate(CRANE, Profile(profile=SENSED, period=0.004), until=0.5)
    takes_over = math.ceil(run.first_contact / 0.004) * 0.004
    assert takes_over > run.first_contact
    first = SENSED.sampled(0.004)
    held = np.linspace(run.first_contact, takes_over, 9)[:-1]
    np.testing.assert_allclose(run.at(held)["u"], first.at(held), atol=1e-12)
    # 20 to 30 N m in 40 ms: the first sample holds the mean, 20.5
    assert float(run.at(takes_over + 0.003)["u"]) == pytest.approx(20.5, rel=1e-12)


@pytest.mark.parametrize(
    ("given_", "words"),
    [
        ({}, "--param file=PATH"),
        ({"file": "a.csv", "profile": SENSED}, "both were given"),
        ({"profile": "62.0"}, "this is no TorqueProfile"),
        ({"file": "nowhere.xls"}, "ends in .csv or .toml"),
        ({"profile": SENSED, "period": math.nan}, "not a number"),
    ],
)
def test_what_it_cannot_play_is_refused_in_one_sentence(given_: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        make_controller("profile", given_)
    assert len(caught.value.sentences) == 1
