"""What must hold for every start, whatever the numbers: energy, momentum, units, time, batch."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.kernel.pieces import Pieces, TwoSteps
from tests.softstart.kernel.test_against_oracle import case, case_with_friction, in_other_units, run_of
from tests.twin import plain

from softstart import Drive, TorqueProfile, controller, records, simulate
from softstart.kernel.records import BEYOND, OPEN

SEEDS = st.integers(1_000, 100_000)


@settings(max_examples=150, deadline=None)
@given(SEEDS)
def test_energy_balance(seed: int) -> None:
    run = run_of(case(seed))
    energy = run.energy
    turnover = max(
        abs(value)
        for value in (energy.motor, energy.load, energy.kinetic, energy.elastic, energy.dissipated, 1e-300)
    )
    start = run.at(0.0)
    turnover = max(turnover, run.drive.J1 * float(start["w1"]) ** 2, run.drive.J2 * float(start["w2"]) ** 2)
    turnover = max(turnover, 0.5 * run.drive.c * float(start["theta"]) ** 2)
    assert abs(energy.residual) < 1e-9 * turnover
    # damping only ever takes energy; but a flank that pulls away and is pressed again while still overlapped
    # finds its spring loaded (these laws have no memory of its creeping back), which may give some back
    mode, beyond = run.recorded.of_shafts(1), np.abs(run.recorded.of_shafts(0)) - 0.5 * run.drive.gap
    side = np.where(np.isin(mode, [OPEN, BEYOND]), 0.0, run.recorded.of_shafts(2))
    pressed_again = (side[:-1] == 0.0) & (side[1:] != 0.0) & (beyond[1:] > 1e-9 * (run.drive.gap + 1e-6))
    if not pressed_again.any():
        assert energy.dissipated > -1e-9 * turnover


@settings(max_examples=150, deadline=None)
@given(SEEDS)
def test_total_momentum(seed: int) -> None:
    """J1 w1 + J2 w2 changes by the impulse of motor torque and load torque alone: the shaft is inside."""
    drawn = case(seed)
    drawn["kind"] = "active"
    run = run_of(drawn)
    start, end = run.at(0.0), run.at(run.end_time)
    J1, J2 = run.drive.J1, run.drive.J2
    # u is smooth within each recorded span: 20 Gauss nodes a span are exact to rounding
    rows = run.recorded.spans
    nodes, weights = np.polynomial.legendre.leggauss(20)
    impulse, size = -drawn["Mc"] * run.end_time, drawn["Mc"] * run.end_time
    for index, row in enumerate(rows):
        pieces = max(1, math.ceil((row[1] - row[0]) / drawn["lag"])) if drawn["lag"] else 1
        edges = np.linspace(row[0], row[1], pieces + 1)
        half = 0.5 * np.diff(edges)[:, None]
        times = edges[:-1, None] + half * (nodes + 1.0)
        u = run.recorded.at(times.ravel(), np.full(times.size, index))["u"].reshape(times.shape)
        impulse += float(np.sum(half * (u * weights)))
        size += float(np.sum(half * np.abs(u * weights)))
    change = float(J1 * (end["w1"] - start["w1"]) + J2 * (end["w2"] - start["w2"]))
    size += abs(float(J1 * start["w1"])) + abs(float(J2 * start["w2"]))
    assert change == pytest.approx(impulse, abs=1e-11 * size)


@pytest.mark.parametrize("make", [case, case_with_friction])
@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, mass=st.floats(-4, 4), time=st.floats(-3, 3))
def test_unit_changes(make: Any, seed: int, mass: float, time: float) -> None:
    """With inertias in other units and time in others, all figures are the same starts."""
    drawn = make(seed)
    m, s = 10.0**mass, 10.0**time
    torque = m / s**2
    scaled = in_other_units(drawn, m, s)
    one, other = run_of(drawn), run_of(scaled)
    assert other.peak_torque == pytest.approx(one.peak_torque * torque, rel=1e-8, abs=1e-12 * scaled["c"])
    if drawn["gap"] > 0.0:
        assert [event.kind for event in other.events] == [event.kind for event in one.events]
    assert other.start_time == pytest.approx(one.start_time * s, rel=1e-8, nan_ok=True)


@settings(max_examples=60, deadline=None)
@given(
    wait=st.floats(1e-6, 100.0),
    torque=st.floats(8.0, 62.0),
    damping=st.floats(0.0, 3.0),
    lag=st.floats(0.0, 0.01),
)
def test_time_shift(wait: float, torque: float, damping: float, lag: float) -> None:
    """A reactive load waits without moving: the same start later is the same start."""
    drive = Drive.load("crane-4amtkf").replace(load_kind="reactive", damping=damping, torque_lag=lag)
    now = simulate(drive, TwoSteps(first=torque, switch=0.05, second=62.0))
    later = simulate(drive, Pieces(pieces=((wait, torque), (wait + 0.05, 62.0))), time_limit=200.0)
    assert later.k_dyn == pytest.approx(now.k_dyn, rel=1e-9)
    assert later.start_time == pytest.approx(now.start_time + wait, rel=1e-10)
    assert later.contacts == now.contacts


RAMPED = TorqueProfile([0.0, 0.02, 0.02, 0.15], [10.0, 50.0, 20.0, 60.0])
SENSED = TorqueProfile(
    [0.0, 0.4], [5.0, 40.0], after_contact=TorqueProfile([0.0, 0.1, 0.1], [0.0, 50.0, 60.0])
)
PROFILES = [
    controller.make_controller("profile", {"profile": RAMPED}),
    controller.make_controller("profile", {"profile": RAMPED, "period": 0.0013}),
    controller.make_controller("profile", {"profile": SENSED}),
    controller.make_controller("profile", {"profile": SENSED, "period": 0.0013}),
]
CONTROLLERS = [TwoSteps(20.0, 0.03, 62.0), *PROFILES, *controller.ready_controller_names()]


@pytest.mark.parametrize("strategy", CONTROLLERS, ids=str)
def test_batch_equals_single_exactly(strategy: Any) -> None:
    rng = np.random.default_rng(7)
    base = Drive.load("crane-4amtkf").replace(torque_lag=0.002, load_kind="reactive", damping=0.2)
    gaps, inertias = rng.uniform(0.05, 4.0, 25), rng.uniform(0.05, 0.4, 25)
    many = simulate(records(base, gap=gaps, load_inertia=inertias), strategy)
    listed = [base.replace(gap=g, load_inertia=j) for g, j in zip(gaps, inertias, strict=True)]
    again = simulate(listed, strategy)
    for i, drive in enumerate(listed):
        run = simulate(drive, strategy)
        for data in (many, again):
            assert float(data.k_dyn[i]) == run.k_dyn
            assert float(data.peak_torque[i]) == run.peak_torque
            np.testing.assert_equal(float(data.start_time[i]), run.start_time)
            assert float(data.contacts[i]) == run.contacts
            assert str(data.status.values[i]) == run.status.name


@pytest.mark.parametrize("strategy", [*PROFILES, *controller.ready_controller_names()], ids=str)
def test_a_plain_controller_equals_its_compiled_twin(strategy: Any) -> None:
    gaps = np.linspace(0.1, 3.0, 6)
    drive = Drive.load("crane-4amtkf").replace(torque_lag=0.001)
    compiled = controller.make_controller(strategy)
    assert isinstance(compiled, controller.CompiledController)
    fast = simulate(records(drive, gap=gaps), compiled, fitted_to=drive)
    slow = simulate(records(drive, gap=gaps), plain(compiled, drive))
    np.testing.assert_array_equal(fast.k_dyn, slow.k_dyn)
    np.testing.assert_array_equal(fast.start_time, slow.start_time)
    np.testing.assert_array_equal(fast.gap_events, slow.gap_events)
