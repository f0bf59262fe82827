"""The study of optima: peers solve softstart's problem, the exact plant judges. Speed is not tested."""

import math
from dataclasses import replace

import pytest

from softstart import simulate
from softstart.study import Verdict, find_study
from softstart_studies.benchmarks.contest import MISSING, version_of
from softstart_studies.benchmarks.optima import study
from softstart_studies.benchmarks.optima.judge import Judged, judge
from softstart_studies.benchmarks.optima.study import ENTRIES, BenchmarkOptima, Outcome, claims, optima_figure
from softstart_studies.benchmarks.optima.task import START_TIMES, Answer, crane, crane_task, steps
from softstart_studies.benchmarks.process import Here

LONG, SHORT = START_TIMES


def pulse_coast_hold(peak_share):
    """Ms for a while, none until the twist rests, then the torque that holds T: from the equations alone.

    Gap open: v' = u/J1 + Mc/J2. Contact, u = 0: z'' = -(c/m) z + Mc/J2 with m = J1 J2/(J1 + J2), so that the
    coasting twist has its peak P where (P/c - s)^2 = s^2 + (v0/W)^2, s = m Mc/(J2 c), W^2 = c/m.
    """
    task = crane_task(LONG)
    J1, J2, c, Mc, Ms = task.J1, task.J2, task.c, task.Mc, task.Ms
    peak, m = peak_share * task.base, J1 * J2 / (J1 + J2)
    shift, W = m * Mc / (J2 * c), math.sqrt(c / m)
    impact = W * math.sqrt((peak / c - shift) ** 2 - shift**2)
    rise, fall = Ms / J1 + Mc / J2, Mc / J2
    # v1^2/(2 rise) + (impact^2 - v1^2)/(2 fall) = gap/2
    v1 = math.sqrt((impact**2 / fall - task.gap) / (1 / fall - 1 / rise))
    t1 = v1 / rise
    contact = t1 + (impact - v1) / fall
    # z = shift + A cos(W (t - t_peak)), z(contact) = 0
    t_peak = contact + math.acos(-shift / (peak / c - shift)) / W
    momentum = J1 + J2
    hold = (peak * (J1 + J2) - Mc * J1) / J2
    gained = Ms * t1 - Mc * t_peak  # of J1 w1 + J2 w2, at the peak
    end = t_peak + (momentum * task.target - gained) / (hold - Mc)
    return steps(peak_share, [0.0, t1, t_peak, end], [Ms, 0.0, hold]), end


def test_the_task_is_that_of_the_drive():
    task, drive = crane_task(LONG), crane()
    for name in ("J1", "J2", "c", "gap", "Mc", "Ms"):
        assert getattr(task, name) == getattr(drive, name)
    assert (task.start_time, task.target, drive.d, drive.load_kind) == (LONG, 60.0, 0.0, "active")
    full = simulate(drive, "direct")
    # start times of 1.2 and 1.05 times that of constant Ms
    assert pytest.approx(1.2 * full.start_time, rel=1e-5) == LONG
    assert pytest.approx(1.05 * full.start_time, rel=1e-5) == SHORT
    assert full.k_dyn * task.base == pytest.approx(full.peak_torque, rel=1e-12)


@pytest.mark.parametrize("share", [0.85, 0.90924724, 0.95])
def test_the_judge_finds_what_a_closed_form_says(share):
    answer, end = pulse_coast_hold(share)
    judged = judge(replace(crane_task(LONG), start_time=end), answer)
    assert judged.k_dyn == pytest.approx(share, rel=1e-9)
    assert judged.disagreement == pytest.approx(0.0, abs=1e-9)
    assert (judged.motor_error, judged.load_error) == pytest.approx((0.0, 0.0), abs=1e-7)
    assert (judged.contacts, judged.torque_excess, judged.broken) == (1, 0.0, ())


def test_the_known_optimum_takes_the_start_time_of_the_task():
    assert pulse_coast_hold(0.90924724)[1] == pytest.approx(LONG, abs=2e-8)


def test_each_broken_condition_is_named():
    answer, end = pulse_coast_hold(0.9092)
    task = replace(crane_task(LONG), start_time=end)
    assert judge(replace(task, start_time=0.99 * end), answer).broken == ("start time",)
    early = judge(task, replace(answer, end_time=0.99 * end))
    assert early.broken == ("end speed",)
    assert early.load_error == pytest.approx(
        -0.01 * end * (0.9092 * task.base - task.Mc) / task.J2, rel=1e-6
    )  # constant T
    over = replace(answer, torque=tuple(value + 1e-2 * (value == task.Ms) for value in answer.torque))
    judged = judge(task, over)
    assert judged.broken == ("torque limits",)
    assert judged.torque_excess == pytest.approx(1e-2, rel=1e-9)
    assert judged.k_dyn == pytest.approx(0.9092, rel=1e-9)  # the plant is given no more than Ms
    bouncing = judge(crane_task(0.25), Answer(3.0, (0.0, 0.25), (62.0, 62.0), 0.25))
    assert bouncing.contacts > 1
    assert "contact" in bouncing.broken


def test_speeds_that_differ_at_the_end_swing_on_and_count():
    # 20 N m until 5 ms after the contact; the torque that then holds T0 lets T swing about it:
    # T = T0 + v0 sqrt(c m) sin(W t)
    task, torque = crane_task(LONG), 20.0
    rise, m = torque / task.J1 + task.Mc / task.J2, task.J1 * task.J2 / (task.J1 + task.J2)
    contact = math.sqrt(task.gap / rise)
    W, settled = math.sqrt(task.c / m), m * rise  # T at rest under 20 N m
    speed, after = rise * contact, 5e-3
    swing = math.sqrt(task.c * m)
    T0 = settled * (1 - math.cos(W * after)) + swing * speed * math.sin(W * after)
    v0 = settled * math.sin(W * after) / swing + speed * math.cos(W * after)
    end = contact + after
    judged = judge(task, Answer(1.0, (0.0, end), (torque, torque), end))
    assert judged.motor_error - judged.load_error == pytest.approx(v0, rel=1e-9)
    assert judged.k_dyn == pytest.approx((T0 + v0 * swing) / task.base, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "start_time", "k_dyn", "within"),
    [
        ("closed-form", LONG, 0.90924724, 1e-6),
        ("descent", LONG, 0.90924724, 1e-3),
        ("descent", SHORT, 1.4564, 1e-3),
    ],
)
def test_softstart_answers_with_the_known_optima(name, start_time, k_dyn, within):
    task = crane_task(start_time)
    judged = judge(task, study.ready(name, task)())
    assert judged.k_dyn == pytest.approx(k_dyn, rel=within)
    assert judged.broken == ()
    assert judged.disagreement == pytest.approx(0.0, abs=within)


def peer(name):
    lacking = version_of(ENTRIES[name].package) is None
    return pytest.param(
        name, marks=pytest.mark.skipif(lacking, reason=f"{ENTRIES[name].package}: extra `benchmark`")
    )


@pytest.mark.parametrize("name", [peer("rockit"), peer("gekko"), peer("dymos")])
def test_a_peer_solves_the_long_start(name):
    done = BenchmarkOptima((name,), (LONG,), repetitions=0)._outcome(name, crane_task(LONG))
    assert done.trouble == ""
    # no torque of one contact has less than 0.90924724 if it ends at the target speed
    assert 0.909 < done.judged.k_dyn < 0.93
    assert done.judged.contacts == 1
    assert abs(done.judged.load_error) < 0.1
    assert done.judged.claimed == pytest.approx(done.judged.k_dyn, rel=0.05)


def test_a_solver_that_fails_is_one_sentence(monkeypatch):
    monkeypatch.setitem(ENTRIES, "descent", ENTRIES["descent"]._replace(solver="nowhere:solve"))
    done = BenchmarkOptima(host=Here)._outcome("descent", crane_task(LONG))
    assert done.judged is None
    assert done.trouble.startswith("No module named 'softstart_studies.benchmarks.optima.nowhere'")


TASKS = {t: crane_task(t) for t in START_TIMES}


def outcome(name, k_dyn, task=TASKS[LONG], broken=()):
    if k_dyn is None:
        return Outcome(name, task, None, trouble="no solution")
    return Outcome(name, task, Judged(k_dyn, k_dyn, task.start_time, 0.0, 0.0, 1, 0.0, broken), 9.0, 1.0)


def test_claims_are_judged_by_the_numbers():
    ours = [outcome("descent", 0.9093), outcome("closed-form", 0.90925)]
    fair, off = outcome("rockit", 0.9095), outcome("dymos", 0.95)
    (low,) = claims([*ours, fair, off])
    assert low.verdict is Verdict.CONFIRMED
    assert "0.90925 against 0.90950 of rockit" in low.evidence
    assert claims([*ours, outcome("rockit", 0.90)])[0].verdict is Verdict.REFUTED
    cheat = claims([*ours, fair, outcome("gekko", 0.90, broken=("end speed",))])[0]
    assert cheat.verdict is Verdict.CONFIRMED
    assert claims([]) == claims([fair]) == claims(ours) == []


def test_the_trap_is_judged_guess_by_guess():
    near, far, none = (
        outcome("rockit-max 0", 0.903),
        outcome("rockit-max 1", 1.8),
        outcome("rockit-max 0.5", None),
    )
    ours = outcome("closed-form", 0.9)
    claim = claims([ours, near, far, none])[-1]
    assert claim.verdict is Verdict.PARTLY
    assert "Of 3 guesses 1 come within 1 % of the optimum" in claim.evidence
    assert "1 end without a solution" in claim.evidence
    assert claims([ours, far, none])[-1].verdict is Verdict.CONFIRMED
    assert claims([ours, near])[-1].verdict is Verdict.REFUTED


@pytest.fixture(scope="module")
def result():
    """The whole study with stand-ins for the solvers: one that knows the optimum, one that refuses."""
    said = []

    def stand_in(name, task):
        if name == "dymos" or task.start_time == SHORT:
            raise RuntimeError("SLSQP did not converge.")
        answer, _ = pulse_coast_hold(0.90924724 if name == "closed-form" else 0.9093)
        return lambda: answer

    names = ("closed-form", "rockit", "dymos", "gekko", "rockit-max 0.5")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "ready", stand_in)
        patch.setattr(study, "version_of", lambda package: None if package == "gekko" else "1.0")
        found = BenchmarkOptima(names, host=Here).run(None, said.append)
    return found, said


def test_rows_and_progress(result):
    found, said = result
    answers, times, _, conditions = found.tables
    assert len(answers.rows) == 8  # four contenders, two tasks
    row = dict(zip(answers.columns, answers.rows[0], strict=True))
    assert (row["contender"], row["claimed"], row["K_dyn"]) == ("closed-form", 0.90925, 0.90925)
    assert (row["contacts"], row["remark"]) == (1, "")
    refused = [row for row in answers.rows if row[1] == "dymos"]
    assert all(row[-1] == "SLSQP did not converge." and row[3] is None for row in refused)
    assert [row[1] for row in times.rows] == ["closed-form", "rockit", "rockit-max 0.5"]
    assert times.rows[0][-1] == 1.0
    assert dict(conditions.rows)["processors and threads used"] == "one, one"
    assert len(said) == 10


def test_a_missing_peer_is_named(result):
    found, said = result
    assert f"gekko: gekko {MISSING}" in said
    row = next(row for row in found.tables[2].rows if row[0] == "gekko")
    assert row[1:] == ("gekko", MISSING)
    assert "softstart[benchmark]" in MISSING


def test_the_picture_shows_the_answers(result):
    found, _ = result
    axes = found.figures["benchmark-optima-answers"].axes
    assert [len(one.lines) for one in axes] == [3, 0]
    assert axes[0].lines[0].get_ydata()[0] == pytest.approx(0.90924724, rel=1e-8)
    assert not optima_figure([]).axes[0].lines


def test_the_study_is_known():
    known = find_study("benchmark-optima")
    assert isinstance(known, BenchmarkOptima)
    assert known.names == tuple(ENTRIES)
    assert {ENTRIES[name].package for name in known.names} >= {"softstart", "rockit-meco", "dymos", "gekko"}
