"""What must hold for every start, whatever the numbers: energy, momentum, units, time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.kernel.pieces import Pieces
from tests.softstart.kernel.test_against_oracle import case, case_with_friction, run_of
from tests.softstart.kernel.test_brake import braked

from softstart import Drive, simulate
from softstart.kernel.records import BEYOND, OPEN

SEEDS = st.integers(1_000, 100_000)


@pytest.mark.parametrize("make", [case, case_with_friction, braked])
@settings(max_examples=60, deadline=None)
@given(seed=SEEDS)
def test_energy_balance(make: Any, seed: int) -> None:
    run = run_of(make(seed))
    energy, start = run.energy, run.at(0.0)
    turnover = max(abs(x) for x in (energy.motor, energy.load, energy.kinetic, energy.elastic, 1e-300))
    turnover = max(turnover, abs(energy.dissipated), 0.5 * run.drive.c * float(start["theta"]) ** 2)
    turnover = max(turnover, run.drive.J1 * float(start["w1"]) ** 2, run.drive.J2 * float(start["w2"]) ** 2)
    assert abs(energy.residual) < 1e-9 * turnover
    # damping only ever takes energy; but a flank that pulls away and is pressed again while still overlapped
    # finds its spring loaded (these laws have no memory of its creeping back), which may give some back
    mode, beyond = (
        run.trajectory.of_shafts("mode"),
        np.abs(run.trajectory.of_shafts("twist")) - 0.5 * run.drive.gap,
    )
    side = np.where(np.isin(mode, [OPEN, BEYOND]), 0.0, run.trajectory.of_shafts("side"))
    pressed_again = (side[:-1] == 0.0) & (side[1:] != 0.0) & (beyond[1:] > 1e-9 * (run.drive.gap + 1e-6))
    if not pressed_again.any():
        assert energy.dissipated > -1e-9 * turnover


@settings(max_examples=60, deadline=None)
@given(SEEDS)
def test_total_momentum(seed: int) -> None:
    """J1 w1 + J2 w2 changes by the impulse of motor torque and load torque alone: the shaft is inside."""
    drawn = case(seed)
    drawn["kind"] = "active"
    run = run_of(drawn)
    start, end = run.at(0.0), run.at(run.end_time)
    J1, J2 = run.drive.J1, run.drive.J2
    # u is smooth within each recorded span: 20 Gauss nodes a span are exact to rounding
    rows = run.trajectory.spans
    nodes, weights = np.polynomial.legendre.leggauss(20)
    impulse, size = -drawn["Mc"] * run.end_time, drawn["Mc"] * run.end_time
    for index, row in enumerate(rows):
        pieces = max(1, math.ceil((row[1] - row[0]) / drawn["lag"])) if drawn["lag"] else 1
        edges = np.linspace(row[0], row[1], pieces + 1)
        half = 0.5 * np.diff(edges)[:, None]
        times = edges[:-1, None] + half * (nodes + 1.0)
        u = run.trajectory.at(times.ravel(), np.full(times.size, index))["u"].reshape(times.shape)
        impulse += float(np.sum(half * (u * weights)))
        size += float(np.sum(half * np.abs(u * weights)))
    change = float(J1 * (end["w1"] - start["w1"]) + J2 * (end["w2"] - start["w2"]))
    size += abs(float(J1 * start["w1"])) + abs(float(J2 * start["w2"]))
    assert change == pytest.approx(impulse, abs=1e-11 * size)


@pytest.mark.parametrize("make", [case, case_with_friction])
@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, mass=st.floats(-4, 4), time=st.floats(-3, 3))
def test_unit_changes(make: Any, seed: int, mass: float, time: float) -> None:
    """With inertias in other units and time in others, all figures are the same starts."""
    drawn = make(seed)
    m, s = 10.0**mass, 10.0**time
    torque = m / s**2
    units = dict.fromkeys(("J1", "J2"), m) | dict.fromkeys(("c", "Mc", "friction"), torque)
    units |= dict.fromkeys(("d", "b1", "b2"), torque * s) | dict.fromkeys(("w1_0", "w2_0", "target"), 1.0 / s)
    units |= {"lag": s, "rate": torque / s, "t_end": s}
    scaled = drawn | {name: drawn[name] * unit for name, unit in units.items() if name in drawn}
    scaled["torque_pieces"] = [(t * s, u * torque) for t, u in drawn["torque_pieces"]]
    one, other = run_of(drawn), run_of(scaled)
    assert other.peak_torque == pytest.approx(one.peak_torque * torque, rel=1e-8, abs=1e-12 * scaled["c"])
    if drawn["gap"] > 0.0:
        assert [event.kind for event in other.events] == [event.kind for event in one.events]
    assert other.start_time == pytest.approx(one.start_time * s, rel=1e-8, nan_ok=True)


@pytest.mark.parametrize("make", [case, case_with_friction])
@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_the_instants_of_asking_change_nothing(make: Any, seed: int) -> None:
    """Pieces cut into twelve are the same torque, whose spans begin elsewhere."""
    drawn = make(seed)
    pieces = dict(drawn["torque_pieces"])
    for cut in np.linspace(0.0, drawn["t_end"], 13)[:-1].tolist():
        pieces.setdefault(cut, next(u for t, u in reversed(drawn["torque_pieces"]) if t <= cut))
    whole, parts = run_of(drawn), run_of({**drawn, "torque_pieces": sorted(pieces.items())})
    if drawn["gap"] > 0.0:
        assert [event.kind for event in whole.events] == [event.kind for event in parts.events]
    assert parts.peak_torque == pytest.approx(whole.peak_torque, rel=1e-9, abs=1e-12 * drawn["c"])


@settings(max_examples=30, deadline=None)
@given(
    wait=st.floats(1e-6, 100.0),
    torque=st.floats(8.0, 62.0),
    damping=st.floats(0.0, 3.0),
    lag=st.floats(0.0, 0.01),
)
def test_time_shift(wait: float, torque: float, damping: float, lag: float) -> None:
    """A reactive load waits without moving: the same start later is the same start."""
    drive = Drive.load("crane-4amtkf").replace(load_kind="reactive", damping=damping, torque_lag=lag)
    now = simulate(drive, Pieces(pieces=((0.0, torque), (0.05, 62.0))))
    later = simulate(drive, Pieces(pieces=((wait, torque), (wait + 0.05, 62.0))), time_limit=200.0)
    assert later.k_dyn == pytest.approx(now.k_dyn, rel=1e-9)
    assert later.start_time == pytest.approx(now.start_time + wait, rel=1e-10)
    assert later.contacts == now.contacts
