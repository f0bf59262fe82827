"""Whole cycles of random duties against the oracle; energy, momentum and rainflow counts of each of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from tests.duty_cases import Case, Player, random_chain, random_drive, single_cases
from tests.softstart.duty_machines import differences, duty_of, machine_of, run_of
from tests.softstart.duty_sampled import SampledPlayer, sampled_case
from tests.twin import plain

from softstart import DutyRun, InputError, run_duty
from softstart.controller import make_controller
from softstart.kernel import records as rec
from softstart.start.fatigue import rainflow_cycles
from softstart.start.metrics import energy_balance
from softstart.start.trajectory import Trajectory

# start, hold, stop, reversal, jog, load change; by torque, coast and brake; a lock; loads that pull
RANDOM = [*(("drive", seed) for seed in range(30)), *(("chain", seed) for seed in range(10))]
SINGLE = [("single", name) for name in single_cases()]
QUICK = [("drive", 1), ("drive", 4), ("drive", 7), ("drive", 9), ("chain", 4), ("single", "proving")]
EACH = [pytest.param(*one, marks=() if one in QUICK else pytest.mark.slow) for one in [*RANDOM, *SINGLE]]
Key = int | str


def case_of(kind: str, key: Key) -> Case:
    if kind == "single":
        return single_cases()[str(key)]
    return random_drive(int(key)) if kind == "drive" else random_chain(int(key))


@cache
def duty_run(kind: str, key: Key) -> DutyRun:
    """Two cycles: a load that is changed in the first one stays so."""
    return run_of(case_of(kind, key), cycles=2)


@pytest.mark.parametrize(("kind", "key"), EACH)
def test_duties_against_the_oracle(kind: str, key: Key) -> None:
    """States at the ends of all phases, peaks of both signs of all steps and their times, within 1e-8.

    The oracle itself changes by 1e-11 at a finer tolerance. In the suite the first cycle, of a chain its
    first four steps.
    """
    case, run = case_of(kind, key), duty_run(kind, key)
    count = len(run.executed)
    if (kind, key) in QUICK:
        count = 4 if kind == "chain" else count // 2
    player, several = Player(case), [step for step, times in case.repeated for _ in range(times)] * 2
    found = differences(case, run, [player.step(**step) for step in several[:count]])
    assert max(found.values()) < 1e-8, found


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["speed-ramp", "acceleration-delay", "pulse-coast-hold", "s-curve", "shaped", "take-up"]
)
def test_duties_of_sampled_strategies(name: str) -> None:
    """What they see and demand in the mirrored frame, out of a motion, and at new set speeds and stops.

    Two others switch at samples where 1e-12 of the load torque moves a reversal by 1e-4 s.
    """
    case = sampled_case(holds=name == "speed-ramp")
    machine, controller = machine_of(case), make_controller(name)
    if "period" in controller.parameters:
        controller = make_controller(name, {"period": 0.004})
    run = run_duty(machine, controller, duty_of(case), cycles=1)
    steps = SampledPlayer(case, plain(controller, machine), name == "speed-ramp").cycle()
    found = differences(case, run, steps)
    assert max(found.values()) < 1e-8, found


def test_a_motor_in_motion_is_not_locked() -> None:
    """A stop that its time ends in motion: the start behind it would take the motor's speed away."""
    case = single_cases()["travel"]
    steps = [{"do": "start"}, {"do": "brake", "time": 0.05}, {"do": "start"}]
    with pytest.raises(InputError, match="the motor still moves"):
        run_of(replace(case, steps=steps))
    run = run_of(replace(case, steps=[steps[0], {"do": "brake"}, steps[2]]))
    ends = [phase.trajectory.of_masses("speed")[[0, -1]] for phase in run.phases]
    for before, after in pairwise(ends):
        assert np.abs(after[0] - before[1]).max() < 1e-8 * case.target


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
    whole = np.flatnonzero(h > 0.0)  # a speed of rounding ends within the rounding of the time
    index = np.repeat(whole, x.size)
    h = h[whole]
    found = trajectory.at((begins[whole, None] + 0.5 * h[:, None] * (1.0 + x)).ravel(), index)
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
        if phase.trajectory.input.curves.size or energy.gears:  # which the quadrature does not have
            continue
        assert np.abs(own["momentum"] - own["impulse"]).max() <= 1e-9 * own["size"].sum(), phase.what
        assert np.abs(own["kinetic"] - own["work"]).max() <= 1e-9 * moved, phase.what
        kernel = [energy.motor, energy.load, energy.ground, -energy.shafts - energy.elastic]
        mine = [own[name].sum() for name in ("motor", "load", "friction", "shafts")]
        assert kernel == pytest.approx(mine, abs=1e-9 * moved), phase.what


def test_energy_and_momentum() -> None:
    for one in QUICK:
        check_balances(duty_run(*one))


@pytest.mark.slow
def test_energy_and_momentum_of_all() -> None:
    for one in [*RANDOM, *SINGLE]:
        check_balances(duty_run(*one))


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
    """The cycles of each shaft from the second cycle of the duty on, which repeats itself."""
    for shaft, points in enumerate(run.turning_points):
        mine = astm_e1049(reversals(points[:, 1].tolist()))
        theirs = rainflow_cycles(points[:, 1].tolist(), repeated=True)
        largest = mine[0, 0]
        assert np.unique(theirs[:, 2]).tolist() == [1.0]
        for column in (0, 1):
            assert np.sort(theirs[:, column]) == pytest.approx(np.sort(mine[:, column]), abs=1e-12 * largest)
        # one cycle from 0 to the equivalent torque and back does the damage of all of them
        equivalent = run.life(6.6).shafts[shaft].equivalent_torque
        assert equivalent**6.6 == pytest.approx((mine[:, 0] ** 6.6).sum() / run.counted_cycles, rel=1e-9)
        # and they are those of the trace: sampled, which cuts its peaks by less than 1 %
        T = run.at(np.linspace(points[0, 0], points[-1, 0], 20_001)[:-1])["T"][:, shaft]
        sampled = astm_e1049(reversals(T.tolist()))
        count = int((mine[:, 0] > 0.1 * largest).sum())
        assert sampled[:count, 0] == pytest.approx(mine[:count, 0], abs=1e-2 * largest)


def test_rainflow_counts() -> None:
    for one in QUICK:
        check_counts(duty_run(*one))


@pytest.mark.slow
def test_rainflow_counts_of_all() -> None:
    for one in [*RANDOM, *SINGLE]:
        check_counts(duty_run(*one))
