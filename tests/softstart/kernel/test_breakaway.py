"""Friction that lets go while flanks touch, at rest: a sign that rounding makes decides nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.softstart.kernel.test_against_oracle import case, run_of

from softstart import Drive, TorqueProfile, simulate
from softstart.controller import make_controller
from softstart.errors import InputError


@pytest.mark.parametrize("where", ["driving-flank", "opposite-flank"])
@pytest.mark.parametrize("share", [1.0, 1.0 - 1e-12, 1.0 - 1e-9, 0.9, 1.1])
@pytest.mark.parametrize("rate", [54092.181934197375, math.inf])
def test_a_motor_breaks_away_while_its_flank_touches(where: str, share: float, rate: float) -> None:
    """Under u = s t the motor moves from t0 = F/s on, the load is held: by hand, with ws = sqrt(c/J1),

        J1 z'' + c z = s (t - t0)    so that    T = s (t - t0 - sin(ws (t - t0))/ws)

    At t0 speed and acceleration towards the flank are 0, but for rounding; the third derivative is not.
    """
    J1, c, F, s = 0.07086871093608395, 39.99045870876764, 7.605273986710433, 54092.181934197375 * share
    drive = Drive(
        motor_inertia=J1, starting_torque=512.4070212195705, motor_friction=F, torque_rate=rate, stiffness=c,
        gap=10.164591068750735, load_inertia=0.008587167714060479, load_torque=220.50643037618846,
        minimum_torque=-512.0, load_kind="reactive", target_speed=377.36566447337725, start_position=where,
    )  # fmt: skip
    way = 1.0 if where == "driving-flank" else -1.0
    ramp = TorqueProfile([0.0, 300.0 / s, 0.1], [0.0, way * 300.0, way * 300.0])
    run = simulate(drive, make_controller("profile", {"profile": ramp}), 150.0 / s, max_events=300)
    s, t0, ws = min(s, rate), F / min(s, rate), math.sqrt(c / J1)
    assert [event.kind for event in run.events] == ["motor starts", "gap closed"]
    assert [event.time for event in run.events] == pytest.approx([t0, t0], rel=1e-9)
    for t in (2.0 * t0, run.end_time):
        by_hand = way * s * (t - t0 - math.sin(ws * (t - t0)) / ws)
        assert float(run.at(t)["T"]) == pytest.approx(by_hand, rel=1e-5)  # the sine cancels 1e-11 of t


def balances(seed: int) -> bool:
    """Whether a random start balances its energy: at rest on a flank, under a torque that meets friction.

    The torque goes up to the friction of the motor as a line, beyond it, to it, or to that of the load too,
    and stays, goes on or comes back. False for a drive whose friction takes all of its torque.
    """
    drawn, rng = case(seed), np.random.default_rng((seed, 41))
    Ms, T = max(abs(u) for _, u in drawn["torque_pieces"]) + drawn["Mc"], drawn["t_end"]
    F = Ms * float(rng.choice([0.0, 0.125, 10 ** rng.uniform(-6.0, -0.4)]))
    drawn["load_friction"] = drawn["Mc"] * float(rng.choice([0.0, 0.5, 1.0]))
    a, b, c = (float(u) for u in rng.choice([0.0, F, F + drawn["Mc"], -F, drawn["Mc"], Ms], 3))
    slopes = ((0.0, 0.0, a), (T / 3.0, a, b - a), (2.0 * T / 3.0, b, c - b))
    drawn["torque_pieces"] = [(t, u, 3.0 * rise / T) for t, u, rise in slopes]
    flank = 0.5 * drawn["gap"] * float(rng.choice([-1.0, 1.0]))
    try:
        run = run_of(drawn | {"friction": F, "theta0": flank, "w1_0": 0.0, "w2_0": 0.0})
    except InputError:
        return False
    energy = run.energy
    size = max(abs(energy.motor), abs(energy.load), abs(energy.kinetic), 1e-9 * Ms)
    assert abs(energy.residual) < 1e-9 * size, seed
    assert len(run.events) < 300, seed
    return True


@pytest.mark.parametrize("seeds", [range(80), pytest.param(range(80, 4000), marks=pytest.mark.slow)])
def test_random_starts_end_with_their_energy(seeds: range) -> None:
    assert sum(map(balances, seeds)) > 0.7 * len(seeds)
