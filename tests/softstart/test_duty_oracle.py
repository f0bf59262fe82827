"""Whole cycles of random duties against the oracle; energy, momentum and rainflow counts of each of them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from tests.duty_cases import Player, random_chain, random_drive
from tests.softstart.duty_machines import chain_of, differences, drive_of, run_of

from softstart import DutyRun
from softstart.kernel import records as rec
from softstart.start.metrics import energy_balance
from softstart.start.trajectory import Trajectory

SLOW_DRIVES, SLOW_CHAINS = 30, 10
# of the same generators: start, hold, stop, reversal, jog and load change, by torque, coast and brake
QUICK_DRIVES, QUICK_CHAINS = (3, 5, 24), (0, 4)


def cases(quick: tuple[int, ...], count: int) -> list[Any]:
    return [pytest.param(seed, marks=() if seed in quick else pytest.mark.slow) for seed in range(count)]


@cache
def drive_run(seed: int) -> DutyRun:
    case = random_drive(seed)
    return run_of(case, drive_of(case), cycles=2)


@cache
def chain_run(seed: int) -> DutyRun:
    case = random_chain(seed)
    return run_of(case, chain_of(case), cycles=2)


def agree(case: Any, run: DutyRun, cycles: int) -> None:
    """States at the ends of all phases, peaks of both signs of all steps and their times, within 1e-8.

    The oracle changes by 1e-11 at a finer tolerance; the rest of the room is for shallow contacts.
    """
    player = Player(case)
    steps = [step for _ in range(cycles) for step in player.cycle()]
    found = differences(case, run, steps)
    assert max(found.values()) < 1e-8, found


@pytest.mark.parametrize("seed", cases(QUICK_DRIVES, SLOW_DRIVES))
def test_duties_of_drives(seed: int) -> None:
    agree(random_drive(seed), drive_run(seed), 1 if seed in QUICK_DRIVES else 2)


@pytest.mark.parametrize("seed", cases(QUICK_CHAINS, SLOW_CHAINS))
def test_duties_of_chains(seed: int) -> None:
    agree(random_chain(seed), chain_run(seed), 1 if seed in QUICK_CHAINS else 2)


# ---- energy and momentum --------------------------------------------------------------------------------


def integrals(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Of each mass the change of J w and of J w^2/2, and what its torques make of it while it moves.

    By Gauss' rule of 20 points a span, exact up to order 39: the series of a span has less than 36.
    """
    masses = trajectory.input.masses[0].view(rec.MASS)[:, 0]
    motor = int(trajectory.input.machine.motor)
    x, weights = np.polynomial.legendre.leggauss(20)
    begins = trajectory.states[:, rec.S_START]
    h = np.diff(begins)
    index = np.repeat(np.arange(h.size), x.size)
    found = trajectory.at((begins[:-1, None] + 0.5 * h[:, None] * (1.0 + x)).ravel(), index)
    share = (0.5 * h[:, None] * weights).ravel()[:, None]
    direction = trajectory.of_masses("direction")[index]
    w, T = found["w"], found["T"]
    none = np.zeros((len(T), 1))
    shafts = np.hstack([none, T]) - np.hstack([T, none])
    drives = np.zeros_like(w)
    drives[:, motor] = found["u"]
    loads = masses["active"] + masses["Mc"] * direction
    friction = masses["friction"] * direction + masses["ground"] * w
    speeds = trajectory.of_masses("speed")
    moves = direction != 0.0
    moves[trajectory.states[index, rec.S_BRAKED] != 0.0, motor] = False
    total = np.where(moves, shafts + drives - loads - friction, 0.0)
    return {
        "momentum": masses["J"] * (speeds[-1] - speeds[0]), "impulse": (share * total).sum(axis=0),
        "kinetic": 0.5 * masses["J"] * (speeds[-1] ** 2 - speeds[0] ** 2),
        "work": (share * total * w).sum(axis=0), "motor": (share * drives * w).sum(axis=0),
        "load": (share * loads * w).sum(axis=0), "friction": (share * friction * w).sum(axis=0),
        "shafts": (share * shafts * w).sum(axis=0),
        "size": (share * (np.abs(shafts) + np.abs(drives) + np.abs(loads))).sum(axis=0),
    }  # fmt: skip


def check_balances(run: DutyRun) -> None:
    """Of each phase: energy as the kernel has it closes at 1e-9, and so do momentum and work of each mass."""
    target = float(run.drive.target_speed)
    for phase in run.phases:
        energy, own = energy_balance(phase.trajectory), integrals(phase.trajectory)
        moved = sum(abs(one) for one in (energy.motor, energy.kinetic, energy.elastic, energy.load))
        moved = max(moved, 1e-3 * own["size"].sum() * target)
        assert abs(energy.residual) <= 1e-9 * moved, phase.what
        assert np.abs(own["momentum"] - own["impulse"]).max() <= 1e-9 * own["size"].sum(), phase.what
        assert np.abs(own["kinetic"] - own["work"]).max() <= 1e-9 * moved, phase.what
        kernel = [energy.motor, energy.load, energy.ground, -energy.shafts - energy.elastic]
        mine = [own[name].sum() for name in ("motor", "load", "friction", "shafts")]
        assert kernel == pytest.approx(mine, abs=1e-9 * moved), phase.what


@pytest.mark.parametrize("seed", cases(QUICK_DRIVES, SLOW_DRIVES))
def test_energy_and_momentum_of_drives(seed: int) -> None:
    check_balances(drive_run(seed))


@pytest.mark.parametrize("seed", cases(QUICK_CHAINS, SLOW_CHAINS))
def test_energy_and_momentum_of_chains(seed: int) -> None:
    check_balances(chain_run(seed))


# ---- rainflow -------------------------------------------------------------------------------------------


def reversals(history: list[float]) -> list[float]:
    """Peaks and valleys of a history that repeats itself, from its largest |value| on and back to it."""
    top = int(np.argmax(np.abs(history)))
    points: list[float] = []
    for value in [*history[top:], *history[: top + 1]]:
        if len(points) > 1 and (value - points[-1]) * (points[-1] - points[-2]) >= 0.0:
            points[-1] = value
        elif not points or value != points[-1]:
            points.append(value)
    return points


def astm_e1049(points: list[float]) -> np.ndarray:
    """ASTM E1049-85, 5.4.5: rainflow for a repeating history that begins and ends at its largest value.

    Range and mean of each cycle, all whole, the largest first.
    """
    cycles, left = [], list[float]()
    for point in points:
        left.append(point)
        while len(left) >= 3:
            X, Y = abs(left[-1] - left[-2]), abs(left[-2] - left[-3])
            if X < Y:
                break
            cycles.append((Y, 0.5 * (left[-2] + left[-3])))  # Y is counted, its peak and valley discarded
            del left[-3:-1]
    assert len(left) == 1  # the largest range closes at the end
    return np.array(sorted(cycles, reverse=True)).reshape(-1, 2)


def test_the_count_of_the_standard() -> None:
    """The example of the standard, figure 7: -2, 1, -3, 5, -1, 3, -4, 4, -2."""
    cycles = astm_e1049([5.0, -1.0, 3.0, -4.0, 4.0, -2.0, 1.0, -3.0, 5.0])
    assert cycles[:, 0].tolist() == [9.0, 7.0, 4.0, 3.0]
    assert cycles[:, 1].tolist() == [0.5, 0.5, 1.0, -0.5]


def check_counts(run: DutyRun) -> None:
    """The cycles of each shaft from the second cycle of the duty on."""
    for points, shaft in zip(run.turning_points, run.life(6.6).shafts, strict=True):
        mine = astm_e1049(reversals(points[:, 1].tolist()))
        assert np.unique(shaft.spectrum[:, 2]).tolist() == [1.0]
        floor = 1e-12 * mine[0, 0]
        for column in (0, 1):
            assert np.sort(shaft.spectrum[:, column]) == pytest.approx(np.sort(mine[:, column]), abs=floor)
        assert shaft.equivalent_torque**6.6 == pytest.approx((mine[:, 0] ** 6.6).sum(), rel=1e-9)
        # and the turning points are those of the trace: sampled, some of its peaks are cut off by 1e-3
        begin, end = points[0, 0], points[-1, 0]
        k = run.drive.shaft_names.index(shaft.shaft)
        T = run.at(np.linspace(begin, end, 20_001)[:-1])["T"][:, k]
        assert [points[:, 1].max(), points[:, 1].min()] == pytest.approx(
            [T.max(), T.min()], abs=1e-2 * mine[0, 0]
        )
        sampled = astm_e1049(reversals(T.tolist()))
        large = mine[:, 0] > 0.1 * mine[0, 0]
        assert sampled[: large.sum(), 0] == pytest.approx(mine[large, 0], abs=1e-2 * mine[0, 0])


@pytest.mark.parametrize("seed", cases(QUICK_DRIVES, SLOW_DRIVES))
def test_rainflow_counts_of_drives(seed: int) -> None:
    check_counts(drive_run(seed))


@pytest.mark.parametrize("seed", cases(QUICK_CHAINS, SLOW_CHAINS))
def test_rainflow_counts_of_chains(seed: int) -> None:
    check_counts(chain_run(seed))
