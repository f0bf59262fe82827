"""The benchmarks: peers and softstart solve the same starts and optima. Nothing here is about speed."""

import numpy as np
import pytest

from softstart import simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.profile import TorqueProfile
from softstart.study import Verdict
from softstart_studies.benchmarks import lsoda, optima
from softstart_studies.benchmarks.problem import Problem
from softstart_studies.benchmarks.starts import AT_ONCE, BATCH, Duel, Outcome, claims, fight

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


# optima: plain CasADi solves them too, the exact plant judges ---------------------------------------------

LONG, QUICK = optima.START_TIMES
K_DYN = 0.90924724  # no torque of one contact has less if it ends at the target speed


def test_each_broken_condition_is_named():
    answer = optima.closed_form(LONG)
    end, profile, drive = answer.end, answer.profile, optima.DRIVE
    assert optima.judge(0.99 * end, answer).broken == ("start time",)
    early = optima.judge(end, answer._replace(end=0.99 * end))
    assert early.broken == ("end speed",)
    slope = (answer.claimed * drive.mean_torque - drive.Mc) / drive.J2  # T is constant
    assert early.load_error == pytest.approx(-0.01 * end * slope, rel=1e-6)
    over = TorqueProfile(profile.time, profile.torque + 1e-2 * (profile.torque == drive.Ms))
    judged = optima.judge(end, answer._replace(profile=over))
    assert judged.broken == ("torque limits",)
    assert judged.k_dyn == pytest.approx(answer.claimed, rel=1e-9)  # the plant is given no more than Ms
    bouncing = optima.judge(0.25, optima.Answer(3.0, TorqueProfile([0.0], [62.0]), 0.25))
    assert bouncing.contacts > 1
    assert "contact" in bouncing.broken


@pytest.mark.parametrize(("name", "start_time", "k_dyn", "within"), [
    ("closed-form", LONG, K_DYN, 1e-6),
    ("descent", LONG, K_DYN, 1e-3),
    pytest.param("descent", QUICK, 1.4564, 1e-3, marks=pytest.mark.slow),
    pytest.param("casadi", LONG, K_DYN, 1e-3, marks=pytest.mark.slow),
])  # fmt: skip
def test_contenders_come_to_the_known_optima(name, start_time, k_dyn, within):
    done = optima.outcome(name, start_time, repetitions=0)
    assert done.k_dyn == pytest.approx(k_dyn, rel=within)
    assert done.answer.claimed == pytest.approx(done.k_dyn, rel=within)
    assert done.trouble == ""


def made(name, k_dyn, start_time=LONG, broken=()):
    if k_dyn is None:
        return optima.Outcome(name, start_time, None, None, trouble="no solution")
    answer = optima.Answer(k_dyn, TorqueProfile([0.0], [1.0]), start_time)
    return optima.Outcome(name, start_time, answer, optima.Judged(k_dyn, 0.0, 0.0, 1, broken))


def test_claims_of_optima_are_judged_by_the_numbers():
    ours = [made("descent", 0.9093), made("closed-form", 0.90925)]
    (low,) = optima.claims([*ours, made("casadi", 0.9095)])
    assert low.verdict is Verdict.CONFIRMED
    assert "0.90925 against 0.90950" in low.evidence
    assert optima.claims([*ours, made("casadi", 0.90)])[0].verdict is Verdict.REFUTED
    assert optima.claims([*ours, made("casadi", 0.90, broken=("end speed",))]) == []
    assert optima.claims([]) == optima.claims([made("casadi", 0.9)]) == optima.claims(ours) == []

    # one phase: guess by guess
    near, far, none = (made(f"casadi, one phase {k}", k_dyn) for k, k_dyn in enumerate((0.903, 1.8, None)))
    ours = made("closed-form", 0.9)
    claim = optima.claims([ours, near, far, none])[-1]
    assert claim.verdict is Verdict.PARTLY
    assert "Of 3 guesses 1 come within 1 % of the optimum" in claim.evidence
    assert "1 end without a solution" in claim.evidence
    assert optima.claims([ours, far, none])[-1].verdict is Verdict.CONFIRMED
    assert optima.claims([ours, near])[-1].verdict is Verdict.REFUTED
