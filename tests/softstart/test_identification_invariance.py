"""What has an origin, a unit, a sign or an order in a log is moved: the drive found stays the same."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.test_identification import REVERSE, TRUTH

from softstart import Identification, InputError, Log, identify
from softstart.arrays import Vector
from softstart.identification.fitting import Fitter
from softstart.identification.model import LogModel
from softstart.identification.planning import simulated_log
from softstart.identification.solving import _directed
from softstart.identification.unknowns import unknowns_of

FREE = ["gap", "position"]
COUNT = 2.0 * math.pi / 4096.0  # of the encoder


def made(seed: int, position: float, period: float = 4e-3) -> Log:
    return simulated_log(TRUTH, REVERSE, log_period=period, ripple=1.0, position=position, seed=seed)


LOG = made(3, -0.6)


def rebuilt(time: Vector = LOG.time, torque: Vector = LOG.torque, angle: Vector = LOG.values) -> Log:
    return Log(time, torque, angle=angle, torque_is="demand")


def problem(log: Log) -> tuple[Fitter, Vector]:
    """What is fitted to a log, and all numbers that the fit is made of."""
    model = LogModel.of(log, TRUTH.replace(start_position="mid-gap"))
    unknowns = unknowns_of(["gap", "torque_lag"], TRUTH, [log], [True])
    numbers = [model.times, model.log.torque, model.log.values, model.rows, model.values, model.root]
    numbers += [np.array([one.guess, one.lower, one.upper]) for one in unknowns]
    return Fitter([model], unknowns), np.concatenate([np.asarray(one, dtype=float) for one in numbers])


SAME = problem(LOG)[1]


def assert_same(log: Log, rel: float = 1e-9) -> None:
    """The fit is the same function of the same numbers; `rel` of the largest of them."""
    assert problem(log)[1] == pytest.approx(SAME, rel=rel, abs=rel)


# ---- zero -----------------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(st.floats(-1e4, 1e4), st.floats(-1e5, 1e5))
def test_the_zero_of_angle_and_of_time_are_nowhere_in_the_fit(angle: float, time: float) -> None:
    # rounding of 1e5 s is 1.5e-11 s, 4e-9 of a period, by which encoder edges are weighted
    assert_same(rebuilt(time=LOG.time + time, angle=LOG.values + angle), rel=1e-6)


# ---- counters -------------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(st.integers(10, 40), st.booleans(), st.integers(0, 2**40), st.sampled_from([4096.0, 4000.0]))
def test_a_counter_may_overflow_anywhere(bits: int, signed: bool, first: int, turn: float) -> None:
    """Of any width above twice the 400 counts that the motor goes in a sample."""
    counts, width = np.round(LOG.values / COUNT), 2**bits
    wrapped = np.mod(counts + first, width)
    if signed:
        wrapped = np.mod(wrapped + width // 2, width) - width // 2
    size = 2.0 * math.pi / turn
    plain = rebuilt(angle=counts * size)
    assert rebuilt(angle=wrapped * size).values - plain.values == pytest.approx(
        wrapped[0] * size, abs=1e-12 * width * size
    )


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 50), st.floats(0.0, 400.0))
def test_an_angle_may_wrap_at_any_number_of_full_turns(turns: int, first: float) -> None:
    """One of a single-turn encoder, and an axis with a modulus."""
    assert_same(rebuilt(angle=np.mod(LOG.values + first, 2.0 * math.pi * turns)))


def test_a_motor_that_turns_by_two_counts_does_not_jump() -> None:
    angle = 0.1 * np.round(np.sin(np.linspace(0.0, 3.0, 60)))
    assert Log(np.arange(60.0), np.full(60, 1.0), angle=angle).values == pytest.approx(angle)


def test_a_jump_that_no_counter_explains_is_a_question() -> None:
    angle = LOG.values + np.where(LOG.time > 0.2, 50.0, 0.0)
    with pytest.raises(InputError, match=r"jumps from .* rad at 0.204 s.*cut the log there"):
        rebuilt(angle=angle)


# ---- time stamps ----------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, LOG.time.size - 1), max_size=40))
def test_samples_that_are_there_twice_count_once(again: list[int]) -> None:
    rows = np.sort([*range(LOG.time.size), *again])
    log = rebuilt(LOG.time[rows], LOG.torque[rows], LOG.values[rows])
    assert_same(log)
    assert bool(again) == any("repeated the one before" in note for note in log.notes)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, LOG.time.size - 2), st.sampled_from([(1e-6, 2**32), (1e-3, 2**16), (1.0, 86400)]))
def test_a_clock_may_overflow_or_pass_midnight(sample: int, clock: tuple[float, int]) -> None:
    tick, width = clock
    range_ = tick * width
    assert_same(rebuilt(time=np.mod(LOG.time - LOG.time[sample], range_)), rel=1e-6)


@given(st.sampled_from([0.25e-3, 0.4e-3, 0.5e-3, 0.7e-3]), st.sampled_from([np.floor, np.round]))
def test_stamps_that_are_too_coarse_are_spread(period: float, rounded) -> None:  # type: ignore[no-untyped-def]
    """Samples more often than the stamps change, of 1 ms, some of them equal while the motor is at rest."""
    time = period * np.arange(1200)
    angle = 100.0 * np.maximum(time - 0.02, 0.0) ** 2
    log = Log(rounded(time / 1e-3) * 1e-3, np.full(1200, 40.0), angle=angle)
    assert log.time.size == 1200
    assert np.diff(log.time) == pytest.approx(period, rel=2e-3)
    assert any("stamps are rounded to 0.001 s" in note for note in log.notes)


@pytest.mark.parametrize(
    "time",
    [LOG.time**1.2, LOG.time + np.where(LOG.time > 0.3, 0.012, 0.0)],
    ids=["uneven", "a piece is missing"],
)
def test_stamps_that_tell_no_period_are_a_question(time: Vector) -> None:
    time = time.copy()
    time[70] = time[69]
    with pytest.raises(InputError, match=r"time does not rise at sample 71"):
        rebuilt(time=time)
    time = np.floor(LOG.time / 0.01) * 0.01  # stamps that leave the period open by 2 %
    with pytest.raises(InputError, match="time does not rise"):
        rebuilt(time=time)


# ---- direction, order -----------------------------------------------------------------------------------


def test_the_direction_of_rotation_does_not_matter_to_friction() -> None:
    log = rebuilt(torque=-LOG.torque, angle=-LOG.values).forward()
    assert_same(log)
    assert "both inverted" in log.notes[-1]
    assert (log.sign, LOG.sign) == (-1.0, 1.0)  # of what is not friction, as an offset of the torque
    assert LOG.forward() is LOG


def test_a_load_that_drives_keeps_its_direction_and_that_is_said() -> None:
    """Lowering, or a log that counts the other way: only the person knows."""
    back = rebuilt(torque=-LOG.torque, angle=-LOG.values)
    lift = TRUTH.replace(load_kind="active", start_position="hanging")
    assert np.array_equal(_directed(back, lift).torque, back.torque)
    assert "set columns to torque=-NAME,angle=-NAME" in _directed(back, lift).notes[-1]
    for alike in (TRUTH, lift.replace(load_torque=0.0, load_friction=7.16, start_position="mid-gap")):
        assert np.array_equal(_directed(back, alike).torque, LOG.torque)


def known(found: Identification) -> dict[str, tuple[float, float, float]]:
    return {one.name: (one.value, one.lower, one.upper) for one in found.estimates}


SHORT = made(3, -0.6, 6e-3)


@pytest.fixture(scope="module")
def found() -> Identification:
    return identify(SHORT, TRUTH, free=FREE, searches=1)


def assert_as_found(found: Identification, other: Identification) -> None:
    """Value and interval to a hundredth of the interval."""
    for name, numbers in known(found).items():
        assert known(other)[name] == pytest.approx(numbers, abs=0.01 * (numbers[2] - numbers[1])), name
    assert 0.0 < found["gap"].upper - found["gap"].lower < 0.01


def test_a_log_with_all_of_it_moved_gives_the_same_drive(found: Identification) -> None:
    """Backward, from 300 rad on, 16 bits with a sign, a clock of the year 2026, each third sample twice."""
    rows = np.sort([*range(SHORT.time.size), *range(0, SHORT.time.size, 3)])
    counts = np.mod(np.round((300.0 - SHORT.values) / COUNT) + 2**15, 2**16) - 2**15
    log = rebuilt(SHORT.time[rows] + 1.78e9, -SHORT.torque[rows], COUNT * counts[rows])
    assert_as_found(found, identify(log, TRUTH, free=FREE, searches=1))


@pytest.mark.slow
def test_the_order_of_logs_does_not_matter() -> None:
    """One of them begins where the other ended, with another period."""
    second = made(5, 0.5, 5e-3)
    second = Log(second.time + 7.0, second.torque, angle=second.values + 41.7, torque_is="demand")
    free = [*FREE, "load_inertia", "torque_lag"]
    guess = TRUTH.replace(torque_lag=0.0)
    one, two = (identify(logs, guess, free=free, searches=1) for logs in ([LOG, second], [second, LOG]))
    swapped = {"position 1": "position 2", "position 2": "position 1"}
    for name, numbers in known(one).items():
        other = known(two)[swapped.get(name, name)]
        assert other == pytest.approx(numbers, abs=0.01 * (numbers[2] - numbers[1])), name
    for log, place in ((1, -0.6), (2, 0.5)):
        assert one[f"position {log}"].value == pytest.approx(place, abs=0.1)
