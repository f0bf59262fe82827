"""Friction that lets go while flanks touch, at rest: a sign that rounding makes decides nothing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from softstart import Drive, Run, TorqueProfile, simulate
from softstart.controller import make_controller
from softstart.errors import InputError

CAP = 300  # events: the starts below have less than forty


def played(drive: Drive, profile: TorqueProfile, until: float) -> Run:
    """The start under this demand, stopped at the cap of events."""
    return simulate(drive, make_controller("profile", {"profile": profile}), until, max_events=CAP)


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
    run = played(drive, TorqueProfile([0.0, 300.0 / s, 0.1], [0.0, way * 300.0, way * 300.0]), 150.0 / s)
    s, t0, ws = min(s, rate), F / min(s, rate), math.sqrt(c / J1)
    assert [(event.kind, event.time) for event in run.events] == [
        ("motor starts", pytest.approx(t0, rel=1e-9)), ("gap closed", pytest.approx(t0, rel=1e-9)),
    ]  # fmt: skip
    for t in (2.0 * t0, run.end_time):
        by_hand = way * s * (t - t0 - math.sin(ws * (t - t0)) / ws)
        assert float(run.at(t)["T"]) == pytest.approx(by_hand, rel=1e-5)  # the sine cancels 1e-11 of t


@pytest.mark.parametrize("after", [1.0, -1.0])
def test_a_torque_that_only_touches_the_friction(after: float) -> None:
    """Up to the friction to the last digit, then back: the motor stays; or on: it goes at once."""
    F, t = 7.16, 0.002
    drive = Drive.load("crane-4amtkf").replace(
        motor_friction=F, start_position="driving-flank", load_kind="reactive", load_torque=30.0
    )
    run = played(drive, TorqueProfile([0.0, 0.01, 0.012], [0.0, F, F + after]), 0.01 + t)
    moved = 0.5 * max(after, 0.0) * t / drive.J1  # without the shaft, which takes (ws t)^2/12
    assert run.at(0.01 + t)["w1"] == pytest.approx(moved, rel=0.01, abs=1e-12)


def drawn(seed: int) -> tuple[dict[str, Any], TorqueProfile, float]:
    """A start from rest on a flank, mostly with friction, under torques that often equal it."""
    rng = np.random.default_rng((seed, 99))

    def decades(low: float, high: float) -> float:
        return float(10 ** rng.uniform(math.log10(low), math.log10(high)))

    J1, Omega, twist = decades(1e-3, 1.0), decades(5.0, 1e3), decades(1e-3, 1.0)
    J2 = J1 * decades(0.05, 50.0)
    c = Omega**2 * J1 * J2 / (J1 + J2)
    Ms = c * twist
    Mc, F = (
        Ms * float(rng.choice([0.0, rng.uniform(0.0, 0.4)])),
        Ms * float(rng.choice([0.0, 0.125, decades(1e-6, 0.4)])),
    )
    given: dict[str, Any] = {
        "motor_inertia": J1, "load_inertia": J2, "stiffness": c, "starting_torque": Ms, "minimum_torque": -Ms,
        "load_torque": Mc, "load_kind": str(rng.choice(["reactive", "active"])), "motor_friction": F,
        "load_friction": Mc * float(rng.choice([0.0, 0.5, 1.0])),
        "gap": twist * decades(1e-2, 100.0),
        "start_position": str(rng.choice(["driving-flank", "opposite-flank", "mid-gap"])),
        "damping": float(rng.choice([0.0, 2.0])) * decades(1e-6, 1.0) * c / Omega,
        "target_speed": 1e6 * Omega,
        "contact_law": str(rng.choice(["no-pull", "dead-zone", "modelica"])),
        "torque_lag": float(rng.choice([0.0, decades(1e-4, 1.0) / Omega])),
        "torque_rate": float(rng.choice([math.inf, Ms * Omega * decades(1e-2, 10.0)])),
    }  # fmt: skip
    T, R = 2.0 * math.pi / Omega * rng.uniform(1.0, 4.0), given["torque_rate"]
    R = R if math.isfinite(R) else Ms * Omega * decades(1e-3, 1.0)
    kind = int(rng.integers(4))
    if kind == 0:  # as fast as the rate limit, or nearly
        top = Ms * float(rng.choice([0.9, 1.0]))
        return given, TorqueProfile([0.0, top / R, 2.0 * Ms / R + T], [0.0, top, top]), float(T)
    levels = [[0.0, F, F, Ms], [F + Mc, F + Mc, -F - Mc, F], [0.0, *rng.choice([0.0, F, F + Mc, -F, Mc], 3)]]
    return given, TorqueProfile(np.linspace(0.0, T, 4), levels[kind - 1]), float(T)


def none_stops_at_the_cap(seeds: range) -> None:
    """Each ends, with a balance of energy."""
    ended = 0
    for seed in seeds:
        given, profile, until = drawn(seed)
        try:
            drive = Drive(**given)
        except InputError:  # its friction takes all of its torque
            continue
        energy = played(drive, profile, until).energy
        size = max(abs(energy.motor), abs(energy.load), abs(energy.kinetic), 1e-3 * drive.Ms)
        assert abs(energy.residual) < 1e-9 * size, seed
        ended += 1
    assert ended > 0.9 * len(seeds)


def test_none_of_forty_random_starts_stops_at_the_cap() -> None:
    none_stops_at_the_cap(range(40))


@pytest.mark.slow
def test_none_of_three_thousand_random_starts_stops_at_the_cap() -> None:
    none_stops_at_the_cap(range(40, 3000))
