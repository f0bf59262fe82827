"""How starts answer to the torques of their demand, and how instants move with contacts: by differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.softstart.optimal.drives import CRANE, HELD, random_chain

from softstart import Drive
from softstart.kernel import records as rec
from softstart.optimal.starts import DemandRun, DemandSimulator
from softstart.profile import TorqueProfile

STEP = 2e-5  # N m
NAMES = ("T", "twist", "w", "u")


def moved(profile: TorqueProfile, direction: Any, size: float) -> TorqueProfile:
    return TorqueProfile(profile.time, profile.torque + size * direction)


def slopes(
    player: DemandSimulator, profile: TorqueProfile, direction: Any, until: float, instants: Any
) -> dict[str, Any]:
    """Differences of all parts of the state along a direction, extrapolated from two steps."""
    found = []
    for step in (STEP, 0.5 * STEP):
        ends = [
            player.play(moved(profile, direction, sign * step), until).trajectory.at(instants)
            for sign in (1.0, -1.0)
        ]
        found.append({name: (ends[0][name] - ends[1][name]) / (2.0 * step) for name in NAMES})
    return {name: (4.0 * found[1][name] - found[0][name]) / 3.0 for name in NAMES}


def off(
    player: DemandSimulator, played: DemandRun, direction: Any, until: float, rng: np.random.Generator
) -> float:
    """The largest difference of sensitivities from differences, as a share of the largest of their kind."""
    profile, trajectory = played.profile, played.trajectory
    instants = np.sort(rng.uniform(0.2 * until, until, 12))
    known = np.append(trajectory.events["time"], profile.time)
    instants = instants[np.abs(instants[:, None] - known[None, :]).min(axis=1) > 1e-4 * until]
    measured = slopes(player, profile, direction, until, instants)
    torques, states = (answer @ direction for answer in played.by_demand(instants, instants))
    joints = player.joints
    exact = {
        "T": torques,
        "twist": states[:, :joints],
        "w": states[:, joints:-1],
        "u": states[:, -1:],
    }
    measured["u"] = measured["u"][:, None]
    return max(
        float(np.abs(exact[name] - measured[name]).max()) / (float(np.abs(measured[name]).max()) + 1e-12)
        for name in NAMES
    )


@pytest.mark.parametrize(("chains", "curved"), [(60, False), (15, True)])
def test_the_answers_of_chains_are_differences(chains: int, curved: bool) -> None:
    """Through contacts, friction and load curves over speed."""
    rng = np.random.default_rng(20)
    contacts, friction, worst = 0, 0, 0.0
    for _ in range(chains):
        player, until = DemandSimulator(random_chain(rng, curved)), 0.06
        edges = np.sort(rng.uniform(0.0, until, 4))
        time = np.array([0.0, edges[0], edges[0], *edges[1:]])  # one step among straight lines
        profile = TorqueProfile(time, rng.uniform(5.0, 55.0, time.size))
        played = player.play(profile, until)
        kinds = played.trajectory.events["kind"]
        contacts += int((kinds == rec.CLOSED).sum())
        friction += int(np.isin(kinds, [rec.STARTS, rec.STOPS]).sum())
        worst = max(worst, off(player, played, rng.normal(size=time.size), until, rng))
    assert contacts > 7.5 * chains
    assert friction > 0.2 * chains
    assert worst < 1e-6


DRIVES: dict[str, Drive] = {
    "lag": CRANE.replace(torque_lag=0.004, damping=0.5),
    "reactive": CRANE.replace(load_kind="reactive", torque_lag=0.002),
    "dead-zone": CRANE.replace(damping=2.0, contact_law="dead-zone", load_kind="reactive"),
    "friction of the motor": CRANE.replace(
        motor_friction=2.0, motor_viscous_friction=0.05, minimum_torque=-40.0
    ),
    "torque proving, from the flank": HELD.replace(start_position="driving-flank", torque_lag=0.01),
    "the brake opens late": HELD.replace(release=0.02, opening_delay=0.02, torque_lag=0.01),
    "release, lag": HELD.replace(release=0.02, torque_lag=0.01, start_position="mid-gap"),
}


@pytest.mark.parametrize("name", DRIVES)
def test_the_answers_of_drives_are_differences(name: str) -> None:
    drive, rng = DRIVES[name], np.random.default_rng(21)
    player, until, high = DemandSimulator(drive), 0.1, float(drive.Ms)
    worst, released = 0.0, 0
    for _ in range(8):
        edges = np.sort(rng.uniform(0.1 * until, until, 4))
        time = np.array([0.0, edges[0], edges[0], *edges[1:]])
        low = high * (-0.4 if drive.minimum_torque < 0.0 else 0.6 if drive.brake == "motor" else 0.05)
        profile = TorqueProfile(time, rng.uniform(low, 0.95 * high, time.size))
        played = player.play(profile, until)
        released += int((played.trajectory.events["kind"] == rec.RELEASED).sum())
        worst = max(worst, off(player, played, rng.normal(size=time.size), until, rng))
    assert worst < 1e-6
    assert released == (8 if drive.brake == "motor" else 0)


def test_instants_move_with_the_contacts() -> None:
    """dt/du at a contact, of chains and drives, and T there: its change along moving instants."""
    rng = np.random.default_rng(22)
    compared = 0
    machines = [
        *(random_chain(rng) for _ in range(25)),
        *(DRIVES[name] for name in ("lag", "reactive", "release, lag")),
    ]
    for machine in machines:
        player, until = DemandSimulator(machine), 0.06
        time = np.linspace(0.0, until, 5)
        high = 0.9 * float(machine.motor.starting_torque)
        profile = TorqueProfile(time, rng.uniform(0.3 * high, high, time.size))
        played, direction = player.play(profile, until), rng.normal(size=time.size)
        begin = contacts(played)
        ends = [contacts(player.play(moved(profile, direction, sign * STEP), until)) for sign in (1.0, -1.0)]
        if not begin.size or {one.size for one in ends} != {begin.size}:
            continue
        shift, _ = played.along_contacts(
            np.append(begin["time"], until), played.by_demand((), played.contacts[0])[1]
        )
        assert not shift[-1].any()
        exact, measured = shift[:-1] @ direction, (ends[0]["time"] - ends[1]["time"]) / (2.0 * STEP)
        speeds = played.trajectory.at(begin["time"])["w"]
        place = begin["place"].astype(int)
        v = np.abs(speeds[np.arange(place.size), place] - speeds[np.arange(place.size), place + 1])
        hard = v > 0.02 * np.abs(speeds).max()
        same = np.diff(begin["time"], prepend=-1.0) > 1e-6 * until
        chosen = hard & same & np.append(same[1:], True)
        compared += int(chosen.sum())
        np.testing.assert_allclose(exact[chosen], measured[chosen], rtol=1e-4, atol=1e-9)
    assert compared > 60


def contacts(played: DemandRun) -> Any:
    events = played.trajectory.events
    return events[(events["kind"] == rec.CLOSED) & (events["time"] > 0.0)]
