"""The benchmark of starts: peers and softstart solve the same starts. Nothing here is about speed."""

import numpy as np
import pytest

from softstart import simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.study import Verdict
from softstart_studies.benchmarks import lsoda
from softstart_studies.benchmarks.problem import RAMP_TIME, Problem
from softstart_studies.benchmarks.starts import (
    AT_ONCE,
    BATCH,
    Duel,
    Outcome,
    claims,
    fight,
)

CRANE = Problem("direct").machines()[0]
SHORT = Chain(
    [Mass(0.03), Mass(0.01), Mass(0.1, torque=5.0)],
    [Shaft(900.0, gap=0.05)] * 2,
    Motor(40.0),
    target_speed=8.0,
)


@pytest.mark.parametrize(("strategy", "peer", "ours", "starts", "least", "most"), [
    ("reduced-first-stage", "lsoda", "batch", 3, 0.0, 1e-6),
    ("damped reduced-two-stage", "lsoda", "batch", 3, 0.0, 1e-6),
    ("direct", "formula", "batch", 6, 0.0, 1e-12),
    ("ramp", "sweep", "batch", 3, 0.0, 0.0),
    # 500 restarts at rtol 1e-8; the difference falls in step with LSODA's tolerance, so it is LSODA's
    ("ramp", "lsoda", "batch", 2, 0.0, 2e-5),
    ("direct", "control-tight", "run", 2, 0.0, 1e-5),
    ("direct", "control", "run", 2, 1e-3, 1.0),  # as it comes: the same start, but coarse
])  # fmt: skip
def test_contenders_agree(strategy, peer, ours, starts, least, most):
    found = fight(Duel(Problem(strategy), peer, starts, ours, starts), passes=1)
    assert least <= found.k_dyn_difference <= most


@pytest.mark.parametrize("problem", [
    Problem("ramp", SHORT, ramp_time=0.02), Problem("damped direct", SHORT),
])  # fmt: skip
def test_lsoda_comes_to_the_same_peaks_of_a_chain_as_its_tolerance_shrinks(problem):
    (chain,) = problem.machines()
    ours = simulate(chain, problem.set_up()[0], fitted_to=chain.design_drive)
    found = [lsoda.start(problem.line(), tolerance) for tolerance in (1e-6, 1e-12)]
    coarse, tight = (np.abs(peaks / ours.peak_torques - 1).max() for peaks, _ in found)
    assert tight < 1e-8
    assert tight < 0.1 * coarse
    assert found[1][1] == pytest.approx(ours.start_time, rel=1e-9)


def test_the_ramp_of_the_peer_is_that_of_the_controller():
    line = Problem("ramp").line()
    run = simulate(CRANE, "ramp", parameters={"time": RAMP_TIME})
    for t in (0.0, 0.0005, 0.2504, 0.4999, 0.5):
        assert line.demand(t, 1)[0] == pytest.approx(float(run.at([t])["u"][0]), rel=1e-12)


def test_claims_are_judged_by_the_numbers():
    def outcome(ratio, peer="lsoda", strategy="direct", wanted=BATCH, rate=2e6, goal=None, apart=1e-8):
        duel = Duel(Problem(strategy), peer, 1, "batch", 1, wanted, goal)
        return Outcome(duel, rate / ratio, rate, ratio, apart)

    def verdicts(*outcomes):
        return [claim.verdict for claim in claims(outcomes)]

    fast, slow = outcome(400.0), outcome(60.0, strategy="ramp")
    assert verdicts(fast) == [Verdict.CONFIRMED]
    assert verdicts(slow) == [Verdict.REFUTED]
    assert verdicts(fast, slow) == [Verdict.PARTLY]
    assert "direct 400, ramp 60" in claims([fast, slow])[0].evidence
    assert verdicts(outcome(9.0, "lsoda-tight", wanted=None, apart=2e-6)) == [Verdict.REFUTED]
    assert verdicts(outcome(9.0, wanted=None, rate=1999.0, goal=AT_ONCE)) == [Verdict.REFUTED]
    assert claims([]) == []
