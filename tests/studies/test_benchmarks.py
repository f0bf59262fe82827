"""The benchmark of starts: peers and softstart solve the same starts. Nothing here is about speed."""

import numpy as np
import pytest

from softstart import simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.study import Verdict, find_study
from softstart_studies.benchmarks import lsoda
from softstart_studies.benchmarks.problem import RAMP_TIME, Problem, gaps
from softstart_studies.benchmarks.starts import (
    AT_ONCE,
    BATCH,
    CONTENDERS,
    DUELS,
    BenchmarkStarts,
    Duel,
    Outcome,
    claims,
    fight,
    long_chain,
)

CRANE = Problem("direct").machines()[0]
SHORT = Chain(
    [Mass(0.03), Mass(0.01), Mass(0.1, torque=5.0)],
    [Shaft(900.0, gap=0.05)] * 2,
    Motor(40.0),
    target_speed=8.0,
)


@pytest.mark.parametrize(("strategy", "peer", "ours", "starts", "least", "most"), [
    ("direct", "lsoda", "batch", 6, 0.0, 1e-6),
    ("reduced-first-stage", "lsoda", "batch", 6, 0.0, 1e-6),
    ("reduced-two-stage", "lsoda", "batch", 6, 0.0, 1e-6),
    ("damped direct", "lsoda", "batch", 4, 0.0, 1e-6),
    ("damped reduced-two-stage", "lsoda", "batch", 4, 0.0, 1e-6),
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
    Problem("direct", SHORT), Problem("ramp", SHORT, ramp_time=0.02), Problem("damped direct", SHORT),
])  # fmt: skip
def test_lsoda_comes_to_the_same_peaks_of_a_chain_as_its_tolerance_shrinks(problem):
    (chain,) = problem.machines()
    ours = simulate(chain, problem.set_up()[0], fitted_to=chain.design_drive)
    found = [lsoda.start(problem.line(), tolerance) for tolerance in (1e-6, 1e-12)]
    coarse, tight = (np.abs(peaks / ours.peak_torques - 1).max() for peaks, _ in found)
    assert tight < 1e-8
    assert tight < 0.1 * coarse
    assert found[1][1] == pytest.approx(ours.start_time, rel=1e-9)


def test_lsoda_comes_to_the_same_sampled_starts_as_its_tolerance_shrinks():
    """With a ramp time that is no whole number of samples."""
    problem, apart = Problem("ramp", ramp_time=1 / 3), []
    ours = CONTENDERS["batch"](problem, 2)()
    for tolerance in (1e-6, 1e-11):
        found = [lsoda.start(problem.line(one), tolerance)[0] for one in problem.machines(2)]
        apart.append(np.abs(np.array(found) - ours).max() / CRANE.mean_torque)
    assert apart[1] < 1e-7 < apart[0]


@pytest.mark.parametrize("ours", ["batch", "run"])
def test_every_way_of_using_softstart_gives_the_same(ours):
    problem = Problem("direct")
    peaks = CONTENDERS[ours](problem, 3)()[:, 0]
    assert peaks.tolist() == [simulate(one, "direct").peak_torque for one in problem.machines(3)]


def test_the_problem_is_that_of_the_drive():
    line = Problem("reduced-two-stage").line()
    assert line.J.tolist() == [CRANE.J1, CRANE.J2]
    assert (line.c, line.d, line.Mc[1], line.Mc[0]) == (CRANE.c, CRANE.d, CRANE.Mc, 0.0)
    first, second, later = line.stage_torques
    assert first == second < later == CRANE.Ms
    assert Problem("reduced-first-stage").line().stage_torques == (first, later, later)
    assert CRANE.d == 0.0
    assert CRANE.load_kind == "active"
    assert gaps(7).mean() == pytest.approx(gaps(1000).mean(), rel=1e-12)
    assert float(long_chain().at_motor_shaft().gap.sum()) == pytest.approx(0.35)


def test_the_ramp_of_the_peer_is_that_of_the_controller():
    line = Problem("ramp").line()
    run = simulate(CRANE, "ramp", parameters={"time": RAMP_TIME})
    for t in (0.0, 0.0005, 0.2504, 0.4999, 0.5):
        assert line.demand(t, 1)[0] == pytest.approx(float(run.at([t])["u"][0]), rel=1e-12)


def test_rows_verdicts_and_picture():
    duels = (
        Duel(Problem("direct"), "lsoda-tight", 2, "batch", 3, 1e-9),
        Duel(Problem("direct", SHORT), "lsoda-tight", 1, "batch", 4, goal=1e-9),
    )
    said = []
    found = BenchmarkStarts(duels, passes=1).run(None, said.append)
    assert len(found.tables[0].rows) == len(said) == 2
    row = dict(zip(found.tables[0].columns, found.tables[0].rows[0], strict=True))
    assert (row["peer"], row["softstart"], row["wanted"]) == ("lsoda-tight", "batch", 1e-9)
    assert row["ratio"] == pytest.approx(row["ours 1/s"] / row["peer 1/s"], rel=0.02)
    assert [claim.verdict for claim in found.claims] == [Verdict.CONFIRMED] * 2
    axes = found.figures["benchmark-starts-ratios"].axes[0]
    assert axes.get_xscale() == "log"
    ratios = [row[5] for row in found.tables[0].rows]
    assert [bar.get_width() for bar in axes.patches] == pytest.approx(ratios, rel=0.01)


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


def test_the_study_is_registered_with_all_its_duels():
    study = find_study("benchmark-starts")
    assert isinstance(study, BenchmarkStarts)
    assert study.duels == DUELS
    assert {name for duel in DUELS for name in (duel.peer, duel.ours)} == {*CONTENDERS}
