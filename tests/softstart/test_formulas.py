"""Equations (1)-(18) of [G] and the whole direct start: 50 digits, each other, integration, limit cases."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.oracle import integrate, random_case

from softstart import Drive, formulas, simulate
from softstart.errors import InputError
from softstart.formulas import DirectStarts, contact_stage, open_stage, two_stages

CRANE = {"J1": 0.035, "J2": 0.175, "c": 368.465, "gap": 0.5, "Ms": 62.0, "Mc": 7.16}


MIDDLES = {"J1": 0.1, "J2": 0.1, "c": 300.0, "gap": 0.3, "Ms": 50.0}  # of four decades
drives = st.fixed_dictionaries(
    {name: st.floats(-2.0, 2.0).map(lambda power, m=m: m * 10.0**power) for name, m in MIDDLES.items()}
    | {"share": st.floats(0.0, 0.95), "r": st.floats(0.05, 1.0)}
)


def split(drawn: dict[str, float]) -> tuple[float, dict[str, float]]:
    """Reduced torque, and the drive."""
    return drawn["r"] * drawn["Ms"], {n: drawn[n] for n in MIDDLES} | {"Mc": drawn["share"] * drawn["Ms"]}


def exact_18(drive: dict[str, float], M1_open: float, M1_contact: float) -> tuple[Decimal, Decimal]:
    """K_dyn by the letter of [G](18), and t1 by that of [G](3), in 50 digits."""
    with localcontext() as context:
        context.prec = 50
        J1, J2, c, gap, Ms, Mc = (Decimal(drive[name]) for name in ("J1", "J2", "c", "gap", "Ms", "Mc"))
        M_open, M_contact = Decimal(M1_open) * J2 + Mc * J1, Decimal(M1_contact) * J2 + Mc * J1
        Omega2 = c * (J1 + J2) / (J1 * J2)
        root = (1 + Omega2 * J1 * J2 * gap * M_open / M_contact**2).sqrt()
        return M_contact / (Ms * J2 + J1 * Mc) * (1 + root), (gap * J1 * J2 / M_open).sqrt()


@settings(deadline=None)
@given(drives)
def test_both_methods_are_equation_18_and_3_in_50_digits(drawn):
    # a dozen roundings, none of which is magnified: 20 units in the last place
    low, drive = split(drawn)
    for M1_contact in (drive["Ms"], low):
        start, (k_dyn, t1) = two_stages(low, M1_contact, **drive), exact_18(drive, low, M1_contact)
        assert start.k_dyn == pytest.approx(float(k_dyn), rel=5e-15)
        assert start.open_duration == pytest.approx(float(t1), rel=5e-15)


@settings(deadline=None)
@given(drives)
def test_equations_agree_with_each_other(drawn):
    low, drive = split(drawn)
    J1, J2, c, gap, Ms, Mc = drive.values()
    for kind, load in (("active", Mc), ("reactive", 0.0)):  # at rest, a reactive load takes no part
        t1, *end = open_stage(low, J1, J2, Mc, gap, kind=kind)
        expected = (
            low * t1**2 / (2 * J1),
            -load * t1**2 / (2 * J2),
            low * t1 / J1,
            -load * t1 / J2,
        )  # (2), (4)
        assert end[:4] == pytest.approx(expected, rel=1e-14)  # (5), (6)
        assert (end[0] - end[1], end[2] - end[3]) == pytest.approx((gap / 2, end[4]), rel=1e-14)  # (10)
    dw12, Omega = open_stage(low, J1, J2, Mc, gap).dw12, math.sqrt(c / J1 + c / J2)
    stage, mean = (low, J1, J2, Mc, c, dw12), formulas.mean_shaft_torque(low, J1, J2, Mc)
    peak, peak_time, duration = contact_stage(*stage)
    B = c * dw12 / Omega
    assert peak == pytest.approx(mean * (1 + math.sqrt(1 + (B / mean) ** 2)), rel=1e-13)  # (13)
    assert peak_time == pytest.approx((math.pi / 2 + math.atan(mean / B)) / Omega, rel=1e-13)  # (12), (14)
    assert duration == pytest.approx(2 * peak_time, rel=1e-15)  # (15)
    assert formulas.shaft_torque(peak_time, *stage) == pytest.approx(peak, rel=1e-13)  # (11) at (14)
    assert formulas.shaft_torque(duration, *stage) == pytest.approx(0.0, abs=1e-13 * peak)  # (11) at (15)
    free = drive | {"Mc": 0.0}  # without a load torque the kind makes no difference
    assert two_stages(low, Ms, **free, kind="reactive") == pytest.approx(
        two_stages(low, Ms, **free), rel=1e-13
    )


@pytest.mark.parametrize("seed", range(8))
def test_starts_against_a_reactive_load_are_what_integration_gives(seed):
    # the oracle keeps 1e-11 a step; a few dozen steps to the end of the first contact
    drawn, rng = random_case(np.random.default_rng(seed)), np.random.default_rng(seed)
    drive = {name: drawn[name] for name in ("J1", "J2", "c", "gap", "Mc")}
    rest = {"d": 0.0, "theta0": 0.0, "w1_0": 0.0, "w2_0": 0.0, "lag": 0.0, "rate": math.inf, "u0": 0.0}
    Ms = drive["Mc"] / rng.uniform(0.05, 0.9)
    for reduced in (False, True):
        low = float(rng.uniform(0.1, 1.0)) * Ms
        high = low if reduced else Ms
        start = two_stages(low, high, **drive, Ms=Ms, kind="reactive")
        longest = 6 * math.pi / math.sqrt(drive["c"] / drive["J1"])
        ends = math.isfinite(start.contact_duration)
        until = start.open_duration + (1.0001 * start.contact_duration if ends else longest)
        pieces = [(0.0, low), (start.open_duration, high)]
        run = integrate(**drive, **rest, kind="reactive", law="no-pull", torque_pieces=pieces, t_end=until)
        closed, opened, first_stop = (
            next((time for time, kind in run.events if kind == word), math.inf)
            for word in ("closed", "opened", "load-stops")
        )
        assert closed == pytest.approx(start.open_duration, rel=1e-10)
        assert run.peak == pytest.approx(start.peak, rel=1e-10)
        if math.isnan(start.contact_duration):
            assert reduced
            assert first_stop < opened
        else:
            assert opened - closed == pytest.approx(start.contact_duration, rel=1e-9)


@settings(deadline=None)
@given(drives)
def test_friction_that_is_never_overcome_leaves_a_motor_on_a_fixed_shaft(drawn):
    low, drive = split(drawn)
    J1, _, c, gap, Ms, _ = drive.values()
    dw12 = open_stage(low, J1, 1.0, 0.0, gap).dw12
    fixed = contact_stage(Ms, J1, 1e300, 0.0, c, dw12)  # a load inertia beyond measure
    stuck = contact_stage(Ms, J1, 1.0, 1.001 * fixed.peak, c, dw12, "reactive")
    assert stuck == pytest.approx(fixed, rel=1e-13)


def test_reactive_contact_that_friction_holds_closed_and_one_that_stops():
    def duration(M1: float, dw12: float) -> float:
        return contact_stage(M1, 0.035, 0.175, 7.16, 368.465, dw12, "reactive").duration

    border = 7.16 / math.sqrt(0.175 * 368.465)  # c J2 dw12^2 = Mc^2
    assert duration(62, 0.99 * border) == math.inf
    assert math.isfinite(duration(62, 1.01 * border))
    assert math.isnan(duration(3, 1.0))
    expected = 2 * math.atan2(0.1 * math.sqrt(368.465 * 0.035), -3) * math.sqrt(0.035 / 368.465)
    assert duration(3, 0.1) == pytest.approx(expected, rel=1e-14)


def test_no_digits_are_lost_without_a_gap_just_after_contact_or_under_braking():
    start = two_stages(31, 31, **CRANE | {"gap": 0.0})  # a step on a spring
    ratio = (31 * 0.175 + 7.16 * 0.035) / (62 * 0.175 + 7.16 * 0.035)
    period = Drive.load("crane-4amtkf").elastic_period
    assert (start.k_dyn, start.open_duration) == (pytest.approx(2 * ratio, rel=1e-14), 0.0)
    assert start.contact_duration == pytest.approx(period, rel=1e-15)
    J1, Omega = 2.0, math.sqrt(2 * 300.0 / 2.0)  # equal masses: mean = M1/2 without load
    early = formulas.shaft_torque(1e-10, 100.0, J1, J1, 0.0, 300.0, 0.0)  # 1 - cos would leave nothing
    assert early == pytest.approx(50 * (1e-10 * Omega) ** 2 / 2, rel=1e-14)
    # mean << 0 touches the flank and leaves it at once: peak B^2/(2 |mean|), duration 2 B/(|mean| Omega)
    B, braking = 30.0, (-2e9, J1, J1, 0.0, 300.0, 30.0 / 300.0 * Omega)
    peak, peak_time, duration = contact_stage(*braking)
    assert (peak, duration) == pytest.approx((B**2 / 2e9, 2 * B / 1e9 / Omega), rel=1e-14)
    assert formulas.shaft_torque(peak_time, *braking) == pytest.approx(peak, rel=1e-13)


@pytest.mark.parametrize("position", ["mid-gap", "driving-flank", "opposite-flank", "hanging", "inside"])
def test_direct_starts_are_those_of_the_simulation(position):
    # five decades of each parameter, start times in 1 to 60 contacts, loads that drive (Mc < 0) among them
    rng = np.random.default_rng(5)
    for _ in range(20):
        J1, J2, c = 10.0 ** rng.uniform((-3, -3, 0), (2, 2, 5))
        gap = rng.choice([0.0, 10.0 ** rng.uniform(-4, 1)], p=[0.1, 0.9])
        Ms = 10.0 ** rng.uniform(-1, 4)
        least = 0.0 if position == "hanging" else max(-0.9, -0.9 * J2 / J1)
        Mc = Ms * rng.uniform(least, 0.95)
        target = 10.0 ** rng.uniform(-1, 2) * (Ms - Mc) / math.sqrt(c * (1 / J1 + 1 / J2)) / (J1 + J2)
        where = gap * rng.uniform(-0.5, 0.5) if position == "inside" else position
        drive = Drive(
            motor_inertia=J1, load_inertia=J2, stiffness=c, gap=gap, starting_torque=Ms, load_torque=Mc,
            target_speed=target, start_position=where,
        )  # fmt: skip
        run = simulate(drive, "direct")
        given = {"J1": J1, "J2": J2, "c": c, "gap": gap, "Ms": Ms, "Mc": Mc, "target_speed": target}
        start = DirectStarts(**given, theta0=drive.theta0)
        # what one rounding of the twist changes: a shaft wound up by far less than its gap has few digits
        rounded = DirectStarts(**given, theta0=np.nextafter(drive.theta0, math.inf))
        assert start.start_time == pytest.approx(run.start_time, rel=1e-11)
        if run.end_time > start.first_contact + start.contact_duration / 2:  # always with Mc >= 0
            assert start.k_dyn == pytest.approx(run.k_dyn, rel=1e-11)
        else:
            assert Mc < 0.0
        t = np.linspace(0.0, run.end_time, 50)
        state = run.at(t)
        for (name, values), other in zip(start.at(t).items(), rounded.at(t).values(), strict=True):
            least = 2.0 * np.abs(values - other).max()
            assert values == pytest.approx(state[name], abs=max(1e-11 * np.abs(state[name]).max(), least))
        if gap and position != "driving-flank":  # whose grazes the plant may count
            closed = sum(event.kind in {"gap closed", "gap opened"} for event in run.events)
            assert start.gap_events(run.end_time) == closed


@pytest.mark.parametrize(
    ("changes", "sentences"),
    [
        ({"J1": 0.0}, ["J1 = 0: must be finite and above 0."]),
        ({"gap": [0.5, -0.1]}, ["gap[1] = -0.1: must be finite and 0 or more."]),
        ({"Ms": "62 N m"}, ["Ms = '62 N m': a number or an array of numbers is needed."]),
        ({"gap": [1, 2], "c": [1, 2, 3]}, ["The arrays do not broadcast together; their shapes are "]),
        ({"J1": -1, "Ms": 0}, ["J1 = -1: must be finite", "Ms = 0: must be finite"]),
        ({"Mc": -400.0}, ["M1/J1 + Mc/J2 = -514.286 rad/s2: the masses do not approach each other"]),
        ({"Mc": -1.0, "kind": "reactive"}, ["Mc = -1: the torque of a reactive load in N m must be 0"]),
    ],
)
def test_impossible_input_is_refused_in_sentences(changes, sentences):
    with pytest.raises(InputError) as refusal:
        two_stages(62.0, 62.0, **CRANE | changes)
    for given_sentence, expected in zip(refusal.value.sentences, sentences, strict=True):
        assert given_sentence.startswith(expected)


def test_direct_starts_and_contacts_that_cannot_be():
    with pytest.raises(InputError, match="cannot move the load"):
        DirectStarts(**CRANE | {"Mc": 62.0}, target_speed=1.0)
    for theta0 in (-0.26, 0.4):
        with pytest.raises(InputError, match="begins between -gap/2 and"):
            DirectStarts(**CRANE, target_speed=1.0, theta0=theta0)
    with pytest.raises(InputError, match="dw12 = -1"):
        contact_stage(1.0, 1.0, 1.0, 1.0, 1.0, -1.0)
    with pytest.raises(InputError, match="base = 0"):
        formulas.dynamic_coefficient(1.0, 0.0)
