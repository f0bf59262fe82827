"""A strategy that holds the speed is judged by its settled time in tables, limits and the recommendation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softstart import Drive, compare, simulate
from softstart.controller import make_controller
from softstart.start.batch import prepared
from softstart.start.recommendation import flags
from softstart.views import starts

CRANE = Drive.load("crane-4amtkf")
# hardly any integral action: under its load torque the drive stays 1.5 % below the target
CREEPING = {"ramp_time": 0.5, "rounding": 0.3, "kp": 5.0, "tn": 20.0}


@pytest.fixture(scope="module")
def creeping():
    run = simulate(CRANE, "speed-ramp", parameters=CREEPING)
    assert math.isnan(run.start_time)
    assert math.isfinite(run.settled_time)
    return run


def test_a_load_that_settles_below_its_target_is_neither_flagged_nor_refused(creeping):
    direct = simulate(CRANE, "direct")
    assert creeping.overshoot <= 0.0
    assert flags(creeping, direct) == ()
    limited = CRANE.replace(permissible_torque=1.1 * creeping.peak_torque,
                            permissible_start_time=1.01 * creeping.settled_time)  # fmt: skip
    table = compare(limited, ["direct", "speed-ramp"], parameters={"speed-ramp": CREEPING}, worst_case=())
    assert table.recommendation.recommended.name == "speed-ramp"
    _, time = table.rows[1].margins(limited.limits)
    assert time.name == "settled time"
    assert time.value == creeping.settled_time
    assert "settled time" in table.recommendation.text


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_limit_on_the_start_time_bounds_the_settled_time_in_batches_too(creeping, share):
    drive = CRANE.replace(permissible_start_time=share * creeping.settled_time)
    ready = make_controller("speed-ramp", CREEPING)
    found = prepared([drive]).figures(ready.set_ups(drive), 1.0)
    assert bool(found["keeps_limits"][0][0]) == (share > 1.0)
    assert found["margin"][0][0] == pytest.approx(1.0 - 1.0 / share, abs=1e-12)


def test_a_loop_that_never_settles_is_flagged_and_named(creeping):
    weak = simulate(CRANE, "speed-ramp", parameters=CREEPING | {"kp": 0.3, "tn": 1e3, "feed_forward": 0.5},
                    time_limit=5.0)  # fmt: skip
    assert math.isnan(weak.settled_time)
    assert [one.word for one in flags(weak, None)] == ["not settled"]
    assert "does not stay within 2 % of its speed" in flags(weak, None)[0].text


def test_tables_state_both_bands_and_the_overshoot_of_strategies_that_hold_the_speed():
    table = compare(CRANE, ["direct", "speed-ramp"])
    sheet = starts.comparison_sheet(table, details=False)
    note = next(one for one in sheet.notes if one.startswith("settled:"))
    assert "within 2 % of the target (speed-ramp)" in note
    assert "not below 99.9 % of the target" in note
    assert "(torque strategies)" in note
    run = table.rows[1].run
    cells = {row[0]: row for row in sheet.tables[0].rows}
    assert cells["speed-ramp"][-1] == f"{100.0 * run.overshoot:.1f}"
    assert cells["direct"][-1] == "-"
    rows = dict(starts.figure_rows(run))
    assert rows["overshoot"] == f"{100.0 * run.overshoot:.3g} % (settled: within 2 % of the target)"
    torque_only = starts.comparison_sheet(compare(CRANE, ["direct", "ramp"]), details=False)
    assert not any("shoot" in str(column) for column in torque_only.tables[0].columns)
    assert not any(one.startswith("settled:") for one in torque_only.notes)


def test_the_overshoot_is_that_of_the_trace():
    run = simulate(CRANE, "speed-ramp", parameters={"feed_forward": 0.0})
    speed = run.at(np.linspace(0.0, run.end_time, 200_001))["w2"]
    assert run.overshoot == pytest.approx(speed.max() / float(CRANE.target_speed) - 1.0, abs=1e-6)
