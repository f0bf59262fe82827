"""The benchmark of chains: LSODA and softstart make the same starts. Nothing here is about speed."""

import numpy as np
import pytest

from softstart import simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.study import Verdict
from softstart_studies.benchmarks import lsoda
from softstart_studies.benchmarks.chains import DUELS, BenchmarkChains, long_chain
from softstart_studies.benchmarks.contest import Duel
from softstart_studies.benchmarks.problem import Problem
from softstart_studies.benchmarks.process import Here

SHORT = Chain(
    [Mass(0.03), Mass(0.01), Mass(0.1, torque=5.0)],
    [Shaft(900.0, gap=0.05)] * 2,
    Motor(40.0),
    target_speed=8.0,
)


@pytest.mark.parametrize("problem", [
    Problem("direct", SHORT), Problem("ramp", SHORT, ramp_time=0.02), Problem("damped direct", SHORT),
])  # fmt: skip
def test_lsoda_comes_to_the_same_peaks_as_its_tolerance_shrinks(problem):
    (chain,) = problem.machines()
    ours = simulate(chain, problem.controller(), fitted_to=chain.design_drive)
    found = [lsoda.start(problem.line(), tolerance) for tolerance in (1e-6, 1e-12)]
    coarse, tight = (np.abs(peaks / ours.peak_torques - 1).max() for peaks, _ in found)
    assert tight < 1e-8
    assert tight < 0.1 * coarse
    assert found[1][1] == pytest.approx(ours.start_time, rel=1e-9)


def test_the_torque_is_held_between_samples():
    line = Problem("ramp", SHORT, ramp_time=0.02).line()
    half = line.initial + 0.5 * (40.0 - line.initial)
    assert line.demand(0.0105, 1) == (pytest.approx(half), pytest.approx(0.011))
    assert line.demand(0.02, 1) == (40.0, float("inf"))


def test_the_study_measures_and_judges():
    duels = (
        Duel(Problem("direct", SHORT), "lsoda-tight", 1, "run", 1),
        Duel(Problem("direct", SHORT), "lsoda-tight", 2, "kernel", 4, goal=1e-9),
        Duel(Problem("damped take-up", "crane-4-mass"), "", 1, "kernel", 4, goal=1e-9),
    )
    result = BenchmarkChains(duels, 1, Here).run(None, lambda text: None)
    single, batch, fed_back = (
        dict(zip(result.tables[0].columns, row, strict=True)) for row in result.tables[0].rows
    )
    assert single["K_dyn diff."] < 1e-7
    assert batch["K_dyn diff."] < 1e-7
    assert (fed_back["peer 1/s"], fed_back["ratio"], fed_back["K_dyn diff."]) == (None, None, None)
    assert batch["ours 1/s"] > 0.0 < fed_back["ours 1/s"]
    assert [claim.verdict for claim in result.claims] == [Verdict.CONFIRMED] * 2
    assert [duel.goal for duel in DUELS if duel.goal] == [2000.0, 300.0, 2000.0, 300.0]
    assert float(long_chain().at_motor_shaft().gap.sum()) == pytest.approx(0.35)
