"""Vectors of an export: played to a block they give what they say, and they hold every kind of start."""

from __future__ import annotations

import csv
import io
import math

import numpy as np
import pytest

from softstart import Drive, control_block, make_controller, simulate
from softstart.export.vectors import make_vectors, run_in_cycles
from softstart.kernel.guard import FAULTS

CRANE = Drive.load("crane-4amtkf")
TAKE_UP = make_vectors(make_controller("take-up"), CRANE)


def test_the_table_holds_the_starts_and_faults_that_it_names() -> None:
    found = {name: {row.fault for row in TAKE_UP.rows if row.scenario == name} for name in TAKE_UP.scenarios}
    words = {name: {FAULTS[code] for code in codes} for name, codes in found.items()}
    healthy = ("nominal", "worn", "noisy", "stopped")
    assert all(words[name] == {""} for name in healthy)
    assert words["not-finite"] == {"", "measured value not finite"}
    assert words["stuck"] == {"", "encoder stuck"}
    assert words["jumped"] == {"", "encoder jumped"}
    assert words["missed"] == {"", "sample late"}
    assert words["torque"] == {"", "torque does not follow"}


def test_after_each_fault_there_is_a_new_start() -> None:
    for name in ("not-finite", "stuck", "jumped", "missed", "torque"):
        rows = [row for row in TAKE_UP.rows if row.scenario == name]
        stopped = max(k for k, row in enumerate(rows) if row.inputs["run"] == 0.0)
        assert rows[stopped].fault != 0
        assert rows[stopped + 1].fault == 0
        assert any(row.torque > 0.0 for row in rows[stopped:])


def test_the_text_is_read_back_to_the_last_bit() -> None:
    rows = list(csv.DictReader(io.StringIO(TAKE_UP.csv())))
    assert tuple(rows[0]) == TAKE_UP.columns
    assert len(rows) == len(TAKE_UP.rows)
    for read, row in zip(rows, TAKE_UP.rows, strict=True):
        numbers = [float(read[name]) for name in TAKE_UP.inputs]
        assert np.array_equal(numbers, [row.inputs[name] for name in TAKE_UP.inputs], equal_nan=True)
        assert (float(read["torque"]), int(read["fault"])) == (row.torque, row.fault)


def test_the_same_twice_is_the_same_text() -> None:
    assert make_vectors(make_controller("take-up"), CRANE).csv() == TAKE_UP.csv()


def test_a_strategy_that_can_reverse_does() -> None:
    assert "reversed" in make_vectors(make_controller("speed-ramp"), CRANE).scenarios
    assert "reversed" not in TAKE_UP.scenarios


def test_in_single_precision_the_inputs_are_numbers_of_it_and_time_and_angle_are_not() -> None:
    vectors = make_vectors(make_controller("take-up"), CRANE, real="float32")
    torques = [row.inputs["motor_torque"] for row in vectors.rows]
    assert np.array_equal(torques, np.float32(torques), equal_nan=True)
    angles = [row.inputs["motor_angle"] for row in vectors.rows]
    assert not np.array_equal(angles, np.float32(angles))
    assert vectors.room == pytest.approx(2e-3 * CRANE.maximum_torque)
    assert TAKE_UP.room == 0.0


def test_a_sampled_strategy_has_the_same_k_dyn_in_cycles() -> None:
    block = control_block(make_controller("take-up"), CRANE)
    assert run_in_cycles(CRANE, block).k_dyn == pytest.approx(simulate(CRANE, "take-up").k_dyn, rel=1e-9)


def test_inputs_that_a_strategy_has_declared_and_a_missed_cycle_stand_in_the_table() -> None:
    vectors = make_vectors(make_controller("reduced-first-stage"), CRANE)
    assert "stage" in vectors.columns
    assert not any(math.isnan(row.inputs["stage"]) for row in vectors.rows)
    assert {row.inputs["cycles"] for row in TAKE_UP.rows if row.scenario == "missed"} == {1.0, 2.0}
