"""One profile for several drives: known optima, the independent oracle, and what holds of any optimum.

The crane drive of [G], target 60 rad/s, start time 0.2883042 s. Alone its optimum is the closed form pulse,
coast, hold: K_dyn 0.90924724 (the same for `reached`: below 1 the torque limit is slack at the end).
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.oracle import integrate

from softstart import Drive, simulate
from softstart.controller import make_controller
from softstart.metrics import base_torque
from softstart.optimal.robust import RobustOptimum, SensorWorth, optimize_robust
from softstart.profile import TorqueProfile

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
WIDE = CRANE.replace(gap=1.0)
START_TIME = 0.2883042
ALONE = 0.90924724  # closed form
COARSE_SEARCH = 0.005  # relative: what the search may miss


def solved(drives: list[Drive], **given: object) -> RobustOptimum:
    return optimize_robust(drives, START_TIME, **given)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def alone() -> RobustOptimum:
    return solved([CRANE])


@pytest.fixture(scope="module")
def worth() -> SensorWorth:
    blind, reacting = (solved([CRANE, WIDE], react_to_contact=react) for react in (False, True))
    return SensorWorth(blind, reacting)


@pytest.fixture(scope="module")
def optima(alone: RobustOptimum, worth: SensorWorth) -> list[RobustOptimum]:
    return [alone, worth.blind, worth.reacting]


def test_one_scenario_is_the_single_optimum(alone: RobustOptimum) -> None:
    assert alone.k_dyn == pytest.approx(ALONE, rel=COARSE_SEARCH)
    assert alone.k_dyn >= ALONE * (1.0 - 1e-7)  # nothing is better than the best


def test_a_wider_gap_costs_and_a_contact_sensor_gains(alone: RobustOptimum, worth: SensorWorth) -> None:
    """The wide gap alone is pulse, coast, hold too: its best start is a line search over the pulse."""
    wide_alone = best_pulse_coast_hold(WIDE)
    assert best_pulse_coast_hold(CRANE) == pytest.approx(ALONE, rel=1e-4)
    assert wide_alone > ALONE
    floor = wide_alone * (1.0 - 1e-4)
    assert worth.reacting.k_dyn >= floor
    assert worth.blind.k_dyn >= floor
    assert worth.reacting.k_dyn <= worth.blind.k_dyn
    assert worth.percent == pytest.approx(100.0 * (1.0 - worth.reacting.k_dyn / worth.blind.k_dyn))
    assert worth.blind.k_dyn >= alone.k_dyn  # one scenario more never makes it easier


def best_pulse_coast_hold(drive: Drive) -> float:
    """Least K_dyn of a pulse at Ms, a coast to the peak of T, and that T held, within the start time."""

    def k_dyn_and_time(pulse: float) -> tuple[float, float]:
        coasting = TorqueProfile.steps([0.0, pulse, 1.0], [drive.Ms, 0.0])
        first = simulate(drive, make_controller("profile", {"profile": coasting}), 0.2)
        stage = first.stages[1]
        hold = (stage.peak_torque * (drive.J1 + drive.J2) - drive.Mc * drive.J1) / drive.J2
        whole = TorqueProfile.steps([0.0, pulse, stage.peak_time, 1.0], [drive.Ms, 0.0, hold])
        run = simulate(drive, make_controller("profile", {"profile": whole}))
        return run.k_dyn, run.start_time

    low, high = 0.003, 0.012  # longer pulses are harder and quicker
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if k_dyn_and_time(middle)[1] <= START_TIME else (middle, high)
    return k_dyn_and_time(high)[0]


def test_runs_and_figures_belong_together(optima: list[RobustOptimum]) -> None:
    for optimum in optima:
        player = make_controller("profile", {"profile": optimum.profile})
        again = [simulate(drive, player, base=optimum.base) for drive in optimum.scenarios]
        assert optimum.k_dyn_each == tuple(run.k_dyn for run in again)
        assert optimum.start_times == tuple(run.start_time for run in again)
        assert optimum.k_dyn == max(optimum.k_dyn_each) == optimum.k_dyn_each[optimum.worst]
        assert max(optimum.start_times) <= START_TIME
        for part in (optimum.profile, optimum.profile.after_contact):
            assert part is None or (part.torque.min() >= 0.0 and part.torque.max() <= CRANE.Ms)
        assert optimum.k_dyn >= optimum.lower_bound.k_dyn
        summary = optimum.summary()
        assert summary["k_dyn"] == optimum.k_dyn
        assert summary["profile"]["torque"] == optimum.profile.torque.tolist()


def pieces(profile: TorqueProfile, start: float, end: float) -> list[tuple[float, float]]:
    """The staircase as (instant, torque) from `start` on, up to `end` on its own clock."""
    edges = np.unique(profile.time[profile.time < end])
    return [(start + float(t), float(u)) for t, u in zip(edges, profile.at(edges), strict=True)]


def test_the_oracle_sees_the_same_starts(optima: list[RobustOptimum]) -> None:
    for optimum in optima:
        for drive, run in zip(optimum.scenarios, optimum.runs, strict=True):
            after = optimum.profile.after_contact
            played = pieces(optimum.profile, 0.0, math.inf if after is None else run.first_contact)
            if after is not None:
                played += pieces(after, run.first_contact, math.inf)
            start = integrate(
                J1=drive.J1, J2=drive.J2, c=drive.c, d=0.0, gap=drive.gap, Mc=drive.Mc, kind="active",
                law="no-pull", theta0=0.0, w1_0=0.0, w2_0=0.0, torque_pieces=played, lag=0.0, rate=math.inf,
                u0=0.0, t_end=run.end_time, target=drive.target_speed,
            )  # fmt: skip
            reached = [t for t, kind in start.events if kind == "target"]
            assert reached
            assert reached[0] <= START_TIME * (1.0 + 1e-9)
            assert reached[0] == pytest.approx(run.start_time, rel=1e-7)
            assert start.peak / float(base_torque(CRANE)) == pytest.approx(run.k_dyn, rel=1e-7)


def test_no_random_change_beats_it(worth: SensorWorth) -> None:
    """200 random changes of the profile that keep the start time and the limits: none is 0.1 % better."""
    random = np.random.default_rng(1)
    for optimum in (worth.blind, worth.reacting):
        tried = better = 0
        for _ in range(100):
            changed = disturbed(optimum.profile, random)
            player = make_controller("profile", {"profile": changed})
            runs = [simulate(drive, player, base=CRANE, time_limit=1.0) for drive in optimum.scenarios]
            if not all(run.start_time <= START_TIME for run in runs):
                continue
            tried += 1
            better += max(run.k_dyn for run in runs) < optimum.k_dyn * (1.0 - 1e-3)
        assert tried >= 20
        assert better == 0


def disturbed(profile: TorqueProfile, random: np.random.Generator) -> TorqueProfile:
    """The profile with a random wave on it, a little more torque on the whole, and edges moved."""
    size = 10.0 ** random.uniform(-4.0, -0.5)

    def one(part: TorqueProfile) -> TorqueProfile:
        time = np.sort(part.time * (1.0 + 0.02 * size * random.standard_normal()))
        phase, frequency = random.uniform(0.0, 2.0 * math.pi), random.uniform(5.0, 80.0)
        wave = np.sin(2.0 * math.pi * frequency * time + phase) + random.uniform(0.0, 1.0)
        return TorqueProfile(time, np.clip(part.torque + 20.0 * size * wave, 0.0, CRANE.Ms))

    first = one(profile)
    after = profile.after_contact
    return first if after is None else TorqueProfile(first.time, first.torque, one(after))
