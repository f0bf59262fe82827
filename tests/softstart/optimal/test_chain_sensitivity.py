"""Sensitivities of starts of chains against finite differences, through contacts and friction."""

import numpy as np
import pytest

from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.optimal.chains.starts import Player
from softstart.profile import TorqueProfile

CHAINS = 200
STEP = 2e-5  # of the torques


def random_chain(rng, curved=False):
    """Three to five masses with one to four gaps, any contact law, friction and lag in some; load curves."""
    count = int(rng.integers(3, 6))
    inertias = 0.03 * 10.0 ** rng.uniform(-1.0, 0.5, count)
    masses = [Mass(float(J), name=f"m{i}") for i, J in enumerate(inertias)]
    kind = "reactive" if rng.random() < 0.4 else "active"
    masses[-1] = masses[-1].replace(torque=float(rng.uniform(2.0, 15.0)), kind=kind)
    if curved:
        for i in (1, count - 1):
            points = np.cumsum(rng.uniform(2.0, 10.0, 4)) - 10.0
            masses[i] = masses[i].replace(curve_speed=points, curve_torque=rng.uniform(-5.0, 20.0, 4))
    law = ("no-pull", "dead-zone", "modelica")[int(rng.integers(3))]
    ratio = float(rng.choice([0.0, 0.02, 0.1]))
    shafts = [
        Shaft(
            float(2000.0 * 10.0 ** rng.uniform(-0.5, 0.8)),
            gap=float(rng.choice([0.0, 0.02, 0.06])) if k else 0.04,
            damping_ratio=ratio,
            contact_law=law,
            efficiency=0.9 if kind == "active" and rng.random() < 0.2 else 1.0,
        )
        for k in range(count - 1)
    ]
    lag = float(rng.choice([0.0, 0.0, 3e-3]))
    motor = Motor(60.0, mass="m0", maximum_torque=60.0, torque_lag=lag)
    return Chain(masses, shafts, motor=motor, load_mass=f"m{count - 1}", target_speed=1e4)


def slope(player, profile, direction, until, instants):
    """Central differences of torques and load speed along a direction, and how far two steps disagree."""
    found = []
    for step in (STEP, 0.5 * STEP):
        ends = []
        for sign in (1.0, -1.0):
            moved = TorqueProfile(profile.time, profile.torque + sign * step * direction)
            states = player.play(moved, until).recorded.at(instants)
            ends.append(np.hstack([states["T"], states["w"]]))
        found.append((ends[0] - ends[1]) / (2.0 * step))
    return (4.0 * found[1] - found[0]) / 3.0, np.abs(found[1] - found[0])


@pytest.mark.parametrize(("chains", "curved"), [(CHAINS, False), (CHAINS // 5, True)])
def test_sensitivities_are_those_of_finite_differences(chains, curved):
    """On 200 chains, and on 40 with load curves over speed."""
    rng = np.random.default_rng(20)
    contacts, friction, worst = 0, 0, []
    for _ in range(chains):
        chain = random_chain(rng, curved)
        player = Player(chain)
        until = 0.06
        edges = np.sort(rng.uniform(0.0, until, 4))
        time = np.array([0.0, edges[0], edges[0], *edges[1:]])  # one step among straight lines
        profile = TorqueProfile(time, rng.uniform(5.0, 55.0, time.size))
        played = player.play(profile, until)
        events = played.recorded.events
        contacts += int((events["kind"] == 1).sum())
        friction += int(np.isin(events["kind"], [3, 4]).sum())
        instants = np.sort(rng.uniform(0.2 * until, until, 12))
        apart = np.abs(instants[:, None] - np.append(events["time"], time)[None, :]).min(axis=1)
        instants = instants[apart > 1e-5]  # an event passes no instant within the step
        direction = rng.normal(size=time.size)
        answer = played.answer(instants, instants)
        exact = np.hstack([answer.torques @ direction, answer.speeds @ direction])
        measured, spread = slope(player, profile, direction, until, instants)
        scale = np.concatenate(
            [
                np.full(len(chain.shafts), np.abs(measured[:, : len(chain.shafts)]).max()),
                np.full(len(chain.masses), np.abs(measured[:, len(chain.shafts) :]).max()),
            ]
        )
        worst.append((float((np.abs(exact - measured) / scale).max()), float((spread / scale).max())))
    off, _ = np.array(worst).T

    assert contacts > 7.5 * chains
    assert friction > 0.25 * chains
    assert off.max() < 1e-6
