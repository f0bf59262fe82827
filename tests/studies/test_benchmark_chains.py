"""The benchmark of chains: LSODA and softstart make the same starts. Nothing here is about speed."""

import numpy as np
import pytest

from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.study import Verdict
from softstart_studies.benchmarks.chains.lsoda import Problem, lsoda_start
from softstart_studies.benchmarks.chains.study import (
    BatchCase,
    BenchmarkChains,
    Case,
    batch_cases,
    cases,
    long_chain,
)

SHORT = Chain(
    [Mass(0.03), Mass(0.01), Mass(0.1, torque=5.0)],
    [Shaft(900.0, gap=0.05)] * 2,
    Motor(40.0),
    target_speed=8.0,
)


@pytest.mark.parametrize("ramp", [0.0, 0.02])
def test_lsoda_comes_to_the_same_peaks_as_its_tolerance_shrinks(ramp):
    case = Case(SHORT, ramp)
    ours = case.ours()
    coarse, tight = (lsoda_start(case.problem(), tolerance) for tolerance in (1e-6, 1e-12))
    apart = [np.abs(one.peaks / ours.peak_torques - 1).max() for one in (coarse, tight)]
    assert apart[1] < 1e-8
    assert apart[1] < 0.1 * apart[0]
    assert tight.start_time == pytest.approx(ours.start_time, rel=1e-9)


def test_the_torque_is_held_between_samples():
    problem = Problem(SHORT, 40.0, 0.1, ramp=0.02)
    assert problem.demand(0.0105) == (pytest.approx(20.0), pytest.approx(0.011))
    assert problem.demand(0.02) == (40.0, float("inf"))


def test_the_study_measures_and_judges():
    batches = (BatchCase(side=2), BatchCase(damped=True, feedback="take-up", side=2))
    result = BenchmarkChains((Case(SHORT),), 1, batches).run(None, lambda text: None)
    row = result.tables[0].rows[0]
    assert row[1:4] == (3, 2, "direct")
    assert row[9] < 1e-7
    assert result.claims[1].verdict is Verdict.CONFIRMED
    alone, fed_back = result.tables[1].rows
    assert alone[1:3] == ("direct", 4)
    assert alone[8] < 0.02  # LSODA at 1e-8; 70 undamped contacts let its errors grow
    assert fed_back[1:4] == ("take-up", 4, "")
    assert all(float(row[4]) > 0.0 and float(row[6]) > 0.0 for row in (alone, fed_back))
    assert [case.goal for case in batch_cases()] == [2000.0, 300.0, 2000.0, 300.0]
    assert [case.strategy for case in cases()] == ["direct", "ramp, 1 kHz", "direct"]
    assert float(long_chain().at_motor_shaft().gap.sum()) == pytest.approx(0.35)
