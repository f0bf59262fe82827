"""No start that can be had lies below the bounds of weak duality, and they come close to the best ones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.softstart.optimal.drives import CRANE

from softstart import Drive
from softstart.optimal import duality
from softstart.optimal.bounds import momentum_bound
from softstart.optimal.check import replayed
from softstart.optimal.duality import dual_bounds, not_covered
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import solve_pulse_coast_hold
from softstart.optimal.starts import DemandSimulator
from softstart.profile import TorqueProfile

GAP = ("gap closed", "gap opened")
BASE = Drive.load("crane-4amtkf")
LATE, GENTLE = 0.30778594119021396, 1.7902284419255463


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A small part of the work, and a coarse grid: less is proved, and all of it holds."""
    monkeypatch.setattr(duality, "CELLS", 700)
    monkeypatch.setattr(duality, "PER_PERIOD", 9)


def random_drive(rng: np.random.Generator) -> Drive:
    """Of all kinds that are covered."""
    J1, Ms = 10 ** rng.uniform(-2, 0), 10 ** rng.uniform(0.5, 2.5)
    J2, Omega = J1 * 10 ** rng.uniform(-1, 1.5), 2.0 * math.pi * 10 ** rng.uniform(0.5, 1.5)
    c = Omega**2 * J1 * J2 / (J1 + J2)
    gap = Ms / c * rng.choice([0.0, *10 ** rng.uniform(-1.0, 1.0, 4)])
    some = {
        "torque_lag": 0.3 / Omega, "torque_rate": Ms * Omega * rng.uniform(0.1, 2.0),
        "motor_friction": Ms * rng.uniform(0.0, 0.05), "motor_viscous_friction": 0.01 * J1 * Omega,
        "load_viscous_friction": 0.01 * J2 * Omega, "contact_law": "dead-zone",
        "damping": 2.0 * rng.choice([0.02, 0.2]) * c / Omega,
    }  # fmt: skip
    return Drive(
        motor_inertia=J1, load_inertia=J2, starting_torque=Ms, stiffness=c, gap=gap,
        load_torque=Ms * rng.uniform(0.0, 0.5), load_kind=rng.choice(["active", "reactive"]).item(),
        start_position=gap * rng.choice([-0.5, 0.0, 0.5]),
        target_speed=1e-3,  # which viscous friction permits; each start has its own, see `answered`
        **{name: value for name, value in some.items() if rng.random() < 0.4},
    )  # fmt: skip


def random_starts(rng: np.random.Generator, drive: Drive) -> Iterator[tuple[Problem, float, int]]:
    """(problem that a start answers, K_dyn, changes of contact): target and start time are its own."""
    period, Ms = 2.0 * math.pi / float(drive.Omega), float(drive.Ms)
    n = int(rng.integers(2, 9))
    times = np.append(0.0, np.sort(rng.uniform(0.0, 5.0 * period, n)))
    profile = TorqueProfile.steps(times.tolist(), (Ms * rng.choice([0.0, 0.5, 1.0], n)).tolist())
    starts = DemandSimulator(drive)
    run = starts.play(profile, 12.0 * period).trajectory
    t = np.linspace(0.2, 10.9, 700) * period
    w = run.at(t)["w"]
    fast = w[:, 1] > 0.05 * np.abs(w).max()
    first = fast & (np.maximum.accumulate(w[:, 1]) == w[:, 1])
    for k in rng.permutation(np.flatnonzero(first))[:2]:
        yield answered(drive, run, profile, "reached", float(t[k]))
    turns = fast[:-1] & (np.diff(np.sign(w[:, 0] - w[:, 1])) != 0.0)
    for k in rng.permutation(np.flatnonzero(turns))[:2]:
        same = brentq(lambda t: float(np.diff(run.at([t])["w"][0])[0]), t[k], t[k + 1], xtol=1e-14)
        yield answered(drive, run, profile, "synchronous", same)


def answered(
    drive: Drive, run: Any, profile: TorqueProfile, terminal: Any, end: float
) -> tuple[Problem, float, int]:
    """The problem with that end and the speed of the load then."""
    speed = float(run.at([end])["w"][0, 1])
    problem = Problem(
        drive.replace(target_speed=speed * (1.0 - 1e-9)), end * (1.0 + 1e-9), terminal, base=BASE
    )
    whole = replayed(problem, profile, end)[0]
    closings = [event for event in whole.events if event.kind in GAP and event.time < end]
    return problem, whole.peak_torque / problem.base_torque, len(closings)


def judged(problem: Problem, k_dyn: float, closings: int) -> float:
    """The bound for any number of contacts; none is above the start that it covers."""
    drive: Any = problem.drive
    every, once = dual_bounds(problem, 1.05 * k_dyn, cells=duality.CELLS)  # the work does not end below it
    assert momentum_bound(problem).k_dyn <= every.k_dyn <= once.k_dyn
    assert every.k_dyn <= k_dyn * (1.0 + 1e-7)
    if closings <= (drive.theta0 < 0.5 * drive.gap) and "moving on" not in once.covers:
        assert once.k_dyn <= k_dyn * (1.0 + 1e-7)
    return every.k_dyn


@pytest.mark.parametrize(
    "seed", [*range(6), *(pytest.param(k, marks=pytest.mark.slow) for k in range(6, 150))]
)
def test_no_start_is_below(seed: int, quick: None) -> None:
    rng = np.random.default_rng([47, seed])
    drive = random_drive(rng)
    for case in random_starts(rng, drive):
        judged(*case)


def search(problem: Problem, k_dyn: float) -> tuple[float, float]:
    """Both bounds without that of momentum."""
    drive: Any = problem.drive
    found = duality._Search(problem, drive, k_dyn).both(20_000)
    return tuple(peak * float(drive.Ms) / problem.base_torque for peak in found)  # type: ignore[return-value]


@pytest.mark.parametrize("terminal", ["reached", "synchronous"])
def test_it_reaches_the_closed_form(terminal: Any) -> None:
    problem = Problem(CRANE, 0.2883042, terminal)
    k_dyn = solve_pulse_coast_hold(problem)[2]
    every, once = search(problem, 1.002 * k_dyn)  # so that the work does not end below it
    assert (1.0 - 1e-3) * k_dyn < once <= k_dyn
    assert (1.0 - 1e-2) * k_dyn < every <= once


def test_it_is_close_where_momentum_is_far() -> None:
    """A start that ends before the start time is gentler than all that end then: the end is not given."""
    drive = Drive(
        motor_inertia=0.0011775836, load_inertia=0.0050531922, stiffness=6.3996351922, gap=3.7665896673,
        load_torque=25.3638563977, starting_torque=52.4499622595, load_viscous_friction=0.00020294210132,
        start_position="opposite-flank", target_speed=1296.6271754117,
    )  # fmt: skip
    problem = Problem(drive, LATE, "reached")
    every, once = dual_bounds(problem, GENTLE, cells=15_000)
    assert momentum_bound(problem).k_dyn < every.k_dyn < 0.56 * GENTLE + 0.44 * once.k_dyn
    assert 0.93 * GENTLE < once.k_dyn <= GENTLE
    assert once.kind == every.kind == "duality"
    assert "whose gap closes once and stays closed until the target speed is reached" in once.covers


def test_equal_requests_have_equal_bounds() -> None:
    """To the bit, although the work ends before the bound is near: it is counted, not timed."""
    drive = CRANE.replace(torque_lag=0.004, damping=0.5)
    one, other = (dual_bounds(Problem(drive, 0.28), 3.0, cells=700) for _ in range(2))
    assert one == other
    assert one[1].kind == "duality"
    assert one[1].k_dyn < 2.9


def test_an_opening_may_come_late_within_its_cell(quick: None) -> None:
    """T is then still near its peak at the beginning of the cell; a start with a gap open at its end."""
    drive = Drive(
        motor_inertia=0.015613823810083367, load_inertia=0.13431133446918767, stiffness=26.43538388865564,
        gap=2.6610126291600964, load_torque=6.181728341684564, starting_torque=142.54834700875472,
        start_position="opposite-flank", target_speed=1.0,
    )  # fmt: skip
    profile = TorqueProfile.steps([0.0, 0.02596, 0.031, 0.2], [float(drive.Ms), 0.0, float(drive.Ms)])
    run = DemandSimulator(drive).play(profile, 0.2).trajectory
    end = brentq(lambda t: float(np.diff(run.at([t])["w"][0])[0]), 0.14, 0.17, xtol=1e-14)
    problem, k_dyn, changes = answered(drive, run, profile, "synchronous", end)
    assert changes == 2
    for share in (1.02, 1.3):
        assert dual_bounds(problem, share * k_dyn, cells=2000)[0].k_dyn <= k_dyn


def test_more_time_lowers_it(quick: None) -> None:
    """As the ends of all sooner starts are among those of the later."""
    drive = CRANE.replace(torque_lag=0.004, damping=0.5)
    bounds = [dual_bounds(Problem(drive, time), 3.0, cells=700)[1].k_dyn for time in (0.27, 0.28, 0.3)]
    assert bounds[0] > 1.01 * bounds[1] > 1.02 * bounds[2]


@pytest.mark.parametrize("kind", ["active", "reactive"])
def test_units_do_not_matter(kind: str) -> None:
    """Time and inertia in other units: the same linear programs."""
    drive = CRANE.replace(load_kind=kind, torque_rate=9000.0, motor_friction=1.0)
    quick = Drive(  # time by 1/10, inertia by 7
        motor_inertia=7.0 * drive.J1, load_inertia=7.0 * drive.J2, stiffness=700.0 * drive.c,
        gap=drive.gap, starting_torque=700.0 * drive.Ms, load_torque=700.0 * drive.Mc, load_kind=kind,
        torque_rate=7000.0 * 9000.0, motor_friction=700.0, target_speed=10.0 * drive.target_speed,
        start_position=drive.theta0,
    )  # fmt: skip
    one, other = (
        duality._Search(Problem(each, t), each, 0.93) for each, t in ((drive, 0.29), (quick, 0.029))
    )
    for search in (one, other):
        search.left = 10**9
    boxes = [[*search.boxes([None], False)] for search in (one, other)]
    for a, b in list(zip(*boxes, strict=True))[:3]:
        low, high = (search.judged(box, 9.0)[0] for search, box in ((one, a), (other, b)))
        assert low == pytest.approx(high, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"minimum_torque": -5.0}, "brake"),
        ({"contact_law": "modelica", "damping": 1.0}, "modelica law is not linear"),
        ({"initial_load_speed": 3.0}, "moves at first"),
        ({"load_friction": 2.0}, "between falling and rising"),
        ({"load_kind": "reactive", "start_position": 0.27}, "wound up against the load"),
        ({"brake": "motor"}, "a brake holds"),
    ],
)
def test_momentum_is_left_where_it_does_not_cover(given: dict[str, Any], why: str) -> None:
    problem = Problem(CRANE.replace(**given), 0.3)
    assert why in not_covered(problem)
    assert {bound.kind for bound in dual_bounds(problem, 9.0)} <= {"momentum", "none"}


def test_several_machines_have_the_largest(quick: None) -> None:
    gaps = [CRANE.replace(gap=gap) for gap in (0.25, 0.5)]
    alone = [dual_bounds(Problem(gap, 0.29, "reached", base=CRANE), 1.4, cells=1000)[0].k_dyn for gap in gaps]
    both = dual_bounds(Problem(gaps[0], 0.29, base=CRANE, scenarios=(gaps[1],)), 1.4, cells=2000)[0].k_dyn
    assert both > 0.9 * max(alone)
