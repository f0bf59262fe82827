"""Plain CasADi solves softstart's optimal start, the exact plant judges. Speed is not tested."""

import math

import pytest

from softstart.profile import TorqueProfile
from softstart.study import Verdict
from softstart_studies.benchmarks.optima import (
    DRIVE,
    START_TIMES,
    Answer,
    Judged,
    Outcome,
    claims,
    judge,
    outcome,
)

LONG, SHORT = START_TIMES
J1, J2, c, Mc, Ms = DRIVE.J1, DRIVE.J2, DRIVE.c, DRIVE.Mc, DRIVE.Ms
BASE, TARGET = float(DRIVE.mean_torque), DRIVE.target_speed
m = J1 * J2 / (J1 + J2)
W = math.sqrt(c / m)


def pulse_coast_hold(peak_share):
    """Ms for a while, none until the twist rests, then the torque that holds T: from the equations alone.

    Gap open: v' = u/J1 + Mc/J2. Contact, u = 0: z'' = -(c/m) z + Mc/J2 with m = J1 J2/(J1 + J2), so that the
    coasting twist has its peak P where (P/c - s)^2 = s^2 + (v0/W)^2, s = m Mc/(J2 c), W^2 = c/m.
    """
    peak, shift = peak_share * BASE, m * Mc / (J2 * c)
    impact = W * math.sqrt((peak / c - shift) ** 2 - shift**2)
    rise, fall = Ms / J1 + Mc / J2, Mc / J2
    # v1^2/(2 rise) + (impact^2 - v1^2)/(2 fall) = gap/2
    v1 = math.sqrt((impact**2 / fall - DRIVE.gap) / (1 / fall - 1 / rise))
    t1 = v1 / rise
    contact = t1 + (impact - v1) / fall
    # z = shift + A cos(W (t - t_peak)), z(contact) = 0
    t_peak = contact + math.acos(-shift / (peak / c - shift)) / W
    hold = (peak * (J1 + J2) - Mc * J1) / J2
    gained = Ms * t1 - Mc * t_peak  # of J1 w1 + J2 w2, at the peak
    end = t_peak + ((J1 + J2) * TARGET - gained) / (hold - Mc)
    return Answer(peak_share, TorqueProfile.steps([0.0, t1, t_peak, end], [Ms, 0.0, hold]), end)


@pytest.mark.parametrize("share", [0.85, 0.90924724])
def test_the_judge_finds_what_a_closed_form_says(share):
    answer = pulse_coast_hold(share)
    judged = judge(answer.end, answer)
    assert judged.k_dyn == pytest.approx(share, rel=1e-9)
    assert (judged.motor_error, judged.load_error) == pytest.approx((0.0, 0.0), abs=1e-7)
    assert (judged.contacts, judged.broken) == (1, ())
    if share > 0.9:
        assert answer.end == pytest.approx(LONG, abs=2e-8)


def test_each_broken_condition_is_named():
    answer = pulse_coast_hold(0.9092)
    end, profile = answer.end, answer.profile
    assert judge(0.99 * end, answer).broken == ("start time",)
    early = judge(end, answer._replace(end=0.99 * end))
    assert early.broken == ("end speed",)
    assert early.load_error == pytest.approx(-0.01 * end * (0.9092 * BASE - Mc) / J2, rel=1e-6)  # constant T
    over = TorqueProfile(profile.time, profile.torque + 1e-2 * (profile.torque == Ms))
    judged = judge(end, answer._replace(profile=over))
    assert judged.broken == ("torque limits",)
    assert judged.k_dyn == pytest.approx(0.9092, rel=1e-9)  # the plant is given no more than Ms
    bouncing = judge(0.25, Answer(3.0, TorqueProfile([0.0], [62.0]), 0.25))
    assert bouncing.contacts > 1
    assert "contact" in bouncing.broken


@pytest.mark.parametrize(("name", "start_time", "k_dyn", "within"), [
    ("closed-form", LONG, 0.90924724, 1e-6),
    ("descent", LONG, 0.90924724, 1e-3),
    pytest.param("descent", SHORT, 1.4564, 1e-3, marks=pytest.mark.slow),
    # no torque of one contact has less than 0.90924724 if it ends at the target speed
    pytest.param("casadi", LONG, 0.90924724, 1e-3, marks=pytest.mark.slow),
])  # fmt: skip
def test_contenders_come_to_the_known_optima(name, start_time, k_dyn, within):
    done = outcome(name, start_time, repetitions=0)
    assert done.k_dyn == pytest.approx(k_dyn, rel=within)
    assert done.answer.claimed == pytest.approx(done.k_dyn, rel=within)
    assert done.trouble == ""


def made(name, k_dyn, start_time=LONG, broken=()):
    if k_dyn is None:
        return Outcome(name, start_time, None, None, trouble="no solution")
    answer = Answer(k_dyn, TorqueProfile([0.0], [1.0]), start_time)
    return Outcome(name, start_time, answer, Judged(k_dyn, 0.0, 0.0, 1, broken))


def test_claims_are_judged_by_the_numbers():
    ours = [made("descent", 0.9093), made("closed-form", 0.90925)]
    (low,) = claims([*ours, made("casadi", 0.9095)])
    assert low.verdict is Verdict.CONFIRMED
    assert "0.90925 against 0.90950" in low.evidence
    assert claims([*ours, made("casadi", 0.90)])[0].verdict is Verdict.REFUTED
    assert claims([*ours, made("casadi", 0.90, broken=("end speed",))]) == []
    assert claims([]) == claims([made("casadi", 0.9)]) == claims(ours) == []


def test_the_trap_is_judged_guess_by_guess():
    near, far, none = (made(f"casadi, one phase {k}", k_dyn) for k, k_dyn in enumerate((0.903, 1.8, None)))
    ours = made("closed-form", 0.9)
    claim = claims([ours, near, far, none])[-1]
    assert claim.verdict is Verdict.PARTLY
    assert "Of 3 guesses 1 come within 1 % of the optimum" in claim.evidence
    assert "1 end without a solution" in claim.evidence
    assert claims([ours, far, none])[-1].verdict is Verdict.CONFIRMED
    assert claims([ours, near])[-1].verdict is Verdict.REFUTED
