"""The benchmark study: peers and softstart solve the same starts. Nothing here is about speed."""

import pytest

from softstart import SimulationError, simulate
from softstart.study import Verdict, find_study
from softstart_studies.benchmarks import contest
from softstart_studies.benchmarks.chains import DUELS as OF_CHAINS
from softstart_studies.benchmarks.contest import MISSING, Duel, Outcome, fight, prepared, ratio_figure
from softstart_studies.benchmarks.problem import RAMP_TIME, Problem, gaps
from softstart_studies.benchmarks.process import Apart, Here, memory, prepare, timed
from softstart_studies.benchmarks.starts import DUELS, BenchmarkStarts

needs_diffrax = pytest.mark.skipif(contest.version_of("diffrax") is None, reason="diffrax: extra `benchmark`")
CRANE = Problem("direct").machines()[0]


def difference(strategy: str, peer: str, ours: str = "kernel", starts: int = 4) -> float:
    here = Here()
    return fight(Duel(Problem(strategy), peer, starts, ours, starts), here, here, 1).k_dyn_difference


@pytest.mark.parametrize("strategy", ["direct", "reduced-first-stage", "reduced-two-stage"])
@pytest.mark.parametrize("peer", ["lsoda", "lsoda-restarted"])
def test_lsoda_and_softstart_agree(peer, strategy):
    assert difference(strategy, peer, starts=6) < 1e-6


@pytest.mark.parametrize("strategy", ["damped direct", "damped reduced-two-stage"])
def test_lsoda_and_softstart_agree_on_a_damped_drive_behind_a_lag(strategy):
    assert difference(strategy, "lsoda-restarted", starts=4) < 1e-6


def test_the_closed_form_and_the_kernel_agree():
    assert difference("direct", "formula", starts=6) < 1e-12


def test_sampled_lsoda_and_softstart_agree():
    # 500 restarts at rtol 1e-8; the difference falls in step with LSODA's tolerance, so it is LSODA's
    assert difference("ramp", "lsoda-sampled", starts=2) < 2e-5


def test_python_control_agrees_when_told_to_be_exact():
    assert difference("direct", "control-tight", "run-traces", starts=2) < 1e-5


def test_python_control_as_it_comes_is_the_same_start_but_coarse():
    assert 1e-3 < difference("direct", "control", "run", starts=2) < 1.0


@needs_diffrax
def test_diffrax_and_softstart_agree():
    # in a process of its own: it switches jax to 64 bits for good
    child = Apart()
    try:
        outcome = fight(Duel(Problem("reduced-two-stage"), "diffrax", 5, "kernel", 5), child, Here(), 1)
        assert outcome.k_dyn_difference < 1e-6
    finally:
        child.close()


@pytest.mark.parametrize("ours", ["kernel", "batch", "run", "run-traces"])
def test_every_way_of_using_softstart_gives_the_same(ours):
    problem = Problem("direct")
    prepared(Here(), ours, problem, 3)
    peaks = timed(f"{ours} 3").found[:, 0]
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


def test_few_and_many_gaps_have_the_same_mean():
    assert gaps(7).mean() == pytest.approx(gaps(1000).mean(), rel=1e-12)


def test_the_ramp_of_the_peer_is_that_of_the_controller():
    line = Problem("ramp").line()
    run = simulate(CRANE, "ramp", parameters={"time": RAMP_TIME})
    for t in (0.0, 0.0005, 0.2504, 0.4999, 0.5):
        assert line.demand(t, 1)[0] == pytest.approx(float(run.at([t])["u"][0]), rel=1e-12)


def test_peers_refuse_what_they_cannot_do():
    for peer in ("control", "lsoda"):
        with pytest.raises(ValueError, match="ramp"):
            prepared(Here(), peer, Problem("ramp"), 1)


def test_a_process_of_its_own_gives_the_same_and_weighs_itself():
    problem = Problem("direct")
    child = Apart()
    try:
        for host in (Here(), child):
            prepared(host, "lsoda", problem, 2)
        assert child(timed, "lsoda 2").found.tolist() == timed("lsoda 2").found.tolist()
        used = child(memory)
        assert used is None or 20 < used < 2000
    finally:
        child.close()
    assert not child.worker.alive


def test_a_process_that_fails_is_one_sentence():
    child = Apart()
    try:
        with pytest.raises(SimulationError, match=r"a contender failed: ModuleNotFoundError: ") as caught:
            child(prepare, "nobody", "nowhere:nobody")
        assert "\n" not in str(caught.value)
    finally:
        child.close()


@pytest.fixture(scope="module")
def result():
    duels = (
        Duel(Problem("direct"), "lsoda", 2, "kernel", 3, 150.0),
        Duel(Problem("ramp"), "lsoda-sampled", 1, "kernel", 2, 100.0),
        Duel(Problem("direct"), "lsoda", 2, "run", 2, 1e-9),
        Duel(Problem("direct"), "control", 1, "run-traces", 2),
        Duel(Problem("direct"), "diffrax", 2, "kernel", 2),
    )
    said = []
    with pytest.MonkeyPatch.context() as patch:
        known = contest.version_of
        patch.setattr(contest, "version_of", lambda name: None if name == "diffrax" else known(name))
        found = BenchmarkStarts(duels, passes=1, host=Here).run(None, said.append)
    return found, said


def test_rows_columns_and_progress(result):
    found, said = result
    rates, names, processes, conditions = found.tables
    assert len(rates.rows) == len(said) == 5
    row = dict(zip(rates.columns, rates.rows[0], strict=True))
    assert (row["peer"], row["softstart"], row["wanted"]) == ("lsoda", "kernel", 150.0)
    assert row["ratio"] == pytest.approx(row["ours 1/s"] / row["peer 1/s"], rel=0.02)
    assert row["K_dyn diff."] < 1e-6
    assert {name: package.split()[0] for name, package, _ in names.rows}["lsoda-sampled"] == "scipy"
    assert [row[0].split()[0] for row in processes.rows] == ["scipy", "softstart", "control"]
    versions = dict(conditions.rows)
    assert versions["processors and threads used"] == "one, one"
    assert versions["scipy"] == contest.version_of("scipy")
    assert versions["diffrax"] == "not installed"


def test_a_missing_peer_is_a_row_that_says_so(result):
    found, said = result
    assert found.tables[0].rows[-1] == ("direct", "diffrax", "kernel", *[None] * 6)
    assert found.tables[1].rows[-1] == ("diffrax", "diffrax", MISSING)
    assert "softstart[benchmark]" in said[-1]


def test_claims_are_judged_by_the_ratios():
    def outcome(ratio, rate=2e6, strategy="direct", peer="lsoda", ours="kernel", wanted=150.0, apart=1e-8):
        duel = Duel(Problem(strategy), peer, 1, ours, 1, wanted)
        return Outcome(duel, rate / ratio, rate, ratio, ratio, apart, 0.1)

    claims = BenchmarkStarts().claims
    fast, slow = outcome(400.0), outcome(60.0, 0.9e4, "reduced-first-stage")
    assert [claim.verdict for claim in claims([fast])] == [Verdict.CONFIRMED] * 2
    assert [claim.verdict for claim in claims([slow])] == [Verdict.REFUTED, Verdict.CONFIRMED]
    mixed = claims([fast, slow])
    assert mixed[0].verdict is Verdict.PARTLY
    assert "direct (kernel) 400, reduced-first-stage (kernel) 60" in mixed[0].evidence
    apart = claims([outcome(400.0, apart=2e-6)])[-1]
    assert apart.verdict is Verdict.REFUTED
    assert claims([]) == []


def test_the_picture_shows_the_ratios(result):
    found, _ = result
    figure = found.figures["benchmark-starts-ratios"]
    bars = figure.axes[0].patches
    assert len(bars) == 4
    assert figure.axes[0].get_xscale() == "log"
    ratios = [row[5] for row in found.tables[0].rows[:4]]
    assert [bar.get_width() for bar in bars] == pytest.approx(ratios, rel=0.01)
    assert not ratio_figure([]).axes[0].patches


def test_the_study_is_registered_with_all_its_duels():
    study = find_study("benchmark-starts")
    assert isinstance(study, BenchmarkStarts)
    assert study.duels == DUELS
    assert {duel.peer for duel in DUELS + OF_CHAINS} | {duel.ours for duel in DUELS} == {*contest.ENTRIES, ""}
