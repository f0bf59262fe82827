"""Equations (1)-(18) of [G] against high precision, each other, integration, and their limit cases."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from tests.oracle import Start, integrate, random_case

from softstart import stages
from softstart.errors import InputError

CRANE = {"J1": 0.035, "J2": 0.175, "c": 368.465, "gap": 0.5, "Ms": 62.0, "Mc": 7.16}


def four_decades(middle: float) -> st.SearchStrategy[float]:
    return st.floats(-2.0, 2.0).map(lambda power: middle * 10.0**power)


drives = st.fixed_dictionaries(
    {
        "J1": four_decades(0.1),
        "J2": four_decades(0.1),
        "c": four_decades(300.0),
        "gap": four_decades(0.3),
        "Ms": four_decades(50.0),
        "share": st.floats(0.0, 0.95),
        "r": st.floats(0.05, 1.0),
    }
)


def split(drawn: dict[str, float]) -> tuple[float, dict[str, float]]:
    drive = {name: drawn[name] for name in ("J1", "J2", "c", "gap", "Ms")}
    return drawn["r"], drive | {"Mc": drawn["share"] * drawn["Ms"]}


# ---- (18) and (3) in 50 digits ----


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
def test_methods_are_equation_18_and_3_in_50_digits(drawn):
    # a dozen roundings, none of which is magnified: 20 units in the last place
    r, drive = split(drawn)
    for method, M1_contact in ((stages.method_1, drive["Ms"]), (stages.method_2, r * drive["Ms"])):
        start = method(r, **drive)
        k_dyn, t1 = exact_18(drive, r * drive["Ms"], M1_contact)
        assert start.k_dyn == pytest.approx(float(k_dyn), rel=5e-15)
        assert start.open_duration == pytest.approx(float(t1), rel=5e-15)


# ---- the equations against each other ----


@pytest.mark.parametrize("kind", ["active", "reactive"])
@settings(deadline=None)
@given(drives)
def test_the_open_stage_ends_with_half_the_gap_travelled(kind, drawn):
    r, drive = split(drawn)
    J1, J2, _, gap, Ms, Mc = drive.values()
    stage = (r * Ms, J1, J2, Mc)
    t1 = stages.open_stage_duration(*stage, gap, kind=kind)
    w1, w2 = stages.closing_speeds(*stage, gap, kind=kind)
    phi1, phi2 = stages.closing_angles(*stage, gap, kind=kind)
    assert w1 - w2 == pytest.approx(stages.impact_speed(*stage, gap, kind=kind), rel=1e-14)  # (10)
    assert phi1 - phi2 == pytest.approx(gap / 2, rel=1e-14)  # (6)
    if kind == "reactive":  # at rest, the load takes no part
        assert (w2, phi2) == (0.0, 0.0)
    else:
        assert stages.open_stage_angles(t1, *stage) == pytest.approx((phi1, phi2), rel=1e-14)  # (2) at t1
        assert stages.open_stage_speeds(t1, *stage) == pytest.approx((w1, w2), rel=1e-14)


@settings(deadline=None)
@given(drives)
def test_equations_of_contact_agree_with_each_other(drawn):
    r, drive = split(drawn)
    J1, J2, c, gap, Ms, Mc = drive.values()
    M1 = r * Ms
    dw12, Omega = stages.impact_speed(M1, J1, J2, Mc, gap), stages.elastic_frequency(J1, J2, c)
    mean, base = (stages.mean_shaft_torque(M, J1, J2, Mc) for M in (M1, Ms))
    contact = (mean, dw12, c, Omega)
    peak, t_peak = stages.peak_shaft_torque(*contact), stages.time_of_peak(*contact)
    amplitude, psi = stages.shaft_torque_amplitude(*contact), stages.shaft_torque_phase(*contact)
    assert peak == pytest.approx(mean + amplitude, rel=1e-14)  # (12), (13)
    assert t_peak == pytest.approx((math.pi / 2 + psi) / Omega, rel=1e-14)  # (14)
    assert stages.contact_stage_duration(*contact) == pytest.approx(2 * t_peak, rel=1e-15)  # (15)
    assert stages.shaft_torque(t_peak, *contact) == pytest.approx(peak, rel=1e-13)  # (11) at (14) is (13)
    assert stages.shaft_torque(2 * t_peak, *contact) == pytest.approx(0.0, abs=1e-13 * peak)  # (11) at (15)
    k_17 = stages.dynamic_coefficient_of_impact(dw12, c, Omega, base)
    assert stages.method_1(r, **drive).k_dyn == pytest.approx(k_17, rel=1e-14)
    loads = {"Mc_open": Mc, "Mc_contact": Mc, "base": base}
    k_18 = stages.dynamic_coefficient_of_stages(
        M1_open=M1, M1_contact=M1, J1=J1, J2=J2, c=c, gap=gap, **loads
    )
    assert k_18 == pytest.approx(stages.dynamic_coefficient(peak, base), rel=1e-14)


# ---- (7), (11) and the whole start against integration ----


@pytest.mark.parametrize("M1", [62.0, 15.5, 0.0, -40.0])
def test_equation_11_solves_equation_7(M1):
    # both masses integrated, not (8): DOP853 at 1e-12 a step, 20 steps
    J1, J2, c, Mc = (CRANE[name] for name in ("J1", "J2", "c", "Mc"))
    mean, Omega = stages.mean_shaft_torque(M1, J1, J2, Mc), stages.elastic_frequency(J1, J2, c)
    duration = stages.contact_stage_duration(mean, 30.0, c, Omega)
    t = np.linspace(0.0, duration, 50)

    def both_masses(_: float, y: np.ndarray) -> list[float]:
        T = c * (y[0] - y[1])
        return [y[2], y[3], (M1 - T) / J1, (T - Mc) / J2]

    solved = solve_ivp(
        both_masses, (0, duration), [0, 0, 29, -1], t_eval=t, method="DOP853", rtol=1e-12, atol=1e-14
    )
    expected = stages.shaft_torque(t, mean, 30.0, c, Omega)
    assert c * (solved.y[0] - solved.y[1]) == pytest.approx(expected, abs=1e-9 * np.max(expected))


def first_stages(
    kind: str, drive: dict[str, float], M1_open: float, M1_contact: float, t_end: float
) -> Start:
    case = {name: drive[name] for name in ("J1", "J2", "c", "gap", "Mc")}
    t1 = stages.open_stage_duration(M1_open, drive["J1"], drive["J2"], drive["Mc"], drive["gap"], kind=kind)
    rest = {"d": 0.0, "theta0": 0.0, "w1_0": 0.0, "w2_0": 0.0, "lag": 0.0, "rate": math.inf, "u0": 0.0}
    pieces = [(0.0, M1_open), (float(t1), M1_contact)]
    return integrate(**case, **rest, kind=kind, law="no-pull", torque_pieces=pieces, t_end=t_end)


@pytest.mark.parametrize("kind", ["active", "reactive"])
@pytest.mark.parametrize("seed", range(25))
def test_methods_are_what_integration_gives(kind, seed):
    # the oracle keeps 1e-11 a step; a few dozen steps to the end of the first contact
    drawn, rng = random_case(np.random.default_rng(seed)), np.random.default_rng(seed)
    drive = {name: drawn[name] for name in ("J1", "J2", "c", "gap", "Mc")}
    drive["Ms"] = drive["Mc"] / rng.uniform(0.05, 0.9)
    for method, reduced in ((stages.method_1, False), (stages.method_2, True)):
        r = float(rng.uniform(0.1, 1.0))
        start = method(r, **drive, kind=kind)
        period = 2 * math.pi / math.sqrt(drive["c"] / drive["J1"])
        t_end = start.open_duration + 3 * period
        run = first_stages(kind, drive, r * drive["Ms"], r * drive["Ms"] if reduced else drive["Ms"], t_end)
        assert run.contacts[0].start == pytest.approx(start.open_duration, rel=1e-10)
        assert run.contacts[0].peak == pytest.approx(start.peak, rel=1e-10)
        opened = run.contacts[0].end
        if math.isnan(start.contact_duration):
            first_stop = next(t for t, event in run.events if event == "load-stops")
            assert kind == "reactive"
            assert reduced
            assert opened is None or first_stop < opened
        elif math.isinf(start.contact_duration):
            assert opened is None
        else:
            assert opened - run.contacts[0].start == pytest.approx(start.contact_duration, rel=1e-9)


# ---- reactive load ----


@settings(deadline=None)
@given(drives)
def test_reactive_load_without_friction_is_an_active_one_without_torque(drawn):
    r, drive = split(drawn)
    drive["Mc"] = 0.0
    for method in (stages.method_1, stages.method_2):
        assert method(r, **drive, kind="reactive") == pytest.approx(method(r, **drive), rel=1e-13)


@settings(deadline=None)
@given(drives)
def test_friction_that_is_never_overcome_leaves_a_motor_on_a_fixed_shaft(drawn):
    r, drive = split(drawn)
    J1, J2, c, gap, Ms, _ = drive.values()
    dw12 = stages.impact_speed(r * Ms, J1, J2, 0.0, gap)
    # a load inertia beyond measure is a fixed one: (13) and (15) then hold for the stuck load
    stuck = stages.elastic_frequency(J1, 1e300, c)
    peak = stages.peak_shaft_torque(Ms, dw12, c, stuck)
    Mc = 1.001 * peak
    dynamics = {"J1": J1, "J2": J2, "c": c}
    assert stages.reactive_peak_shaft_torque(Ms, Mc, dw12, **dynamics) == pytest.approx(peak, rel=1e-13)
    assert stages.reactive_contact_stage_duration(Ms, Mc, dw12, **dynamics) == pytest.approx(
        stages.contact_stage_duration(Ms, dw12, c, stuck), rel=1e-13
    )


def test_reactive_contact_that_friction_holds_closed_and_one_that_stops():
    dynamics = {"J1": 0.035, "J2": 0.175, "c": 368.465}
    border = 7.16 / math.sqrt(0.175 * 368.465)  # c J2 dw12^2 = Mc^2
    duration = stages.reactive_contact_stage_duration
    assert duration(62, 7.16, 0.99 * border, **dynamics) == math.inf
    assert math.isfinite(duration(62, 7.16, 1.01 * border, **dynamics))
    assert math.isnan(duration(3, 7.16, 1.0, **dynamics))
    assert duration(3, 7.16, 0.1, **dynamics) == pytest.approx(
        2 * math.atan2(0.1 * math.sqrt(368.465 * 0.035), -3) * math.sqrt(0.035 / 368.465), rel=1e-14
    )


# ---- limit cases ----


def test_without_a_gap_the_start_is_a_step_on_a_spring():
    start, Omega = (
        stages.method_2(0.5, **CRANE | {"gap": 0.0}),
        stages.elastic_frequency(0.035, 0.175, 368.465),
    )
    ratio = (31 * 0.175 + 7.16 * 0.035) / (62 * 0.175 + 7.16 * 0.035)
    assert (start.k_dyn, start.open_duration) == (pytest.approx(2 * ratio, rel=1e-14), 0.0)
    assert start.contact_duration == pytest.approx(2 * math.pi / Omega, rel=1e-15)


def test_motor_braking_hard_in_contact_loses_no_digits():
    # mean << 0 touches the flank and leaves it at once: with B = c dw12/Omega the peak is B^2/(2 |mean|), the
    # duration 2 B/(|mean| Omega)
    mean, B = -1e9, 30.0
    contact = (mean, B / 368.465 * 100, 368.465, 100.0)
    assert stages.peak_shaft_torque(*contact) == pytest.approx(B**2 / 2e9, rel=1e-14)
    assert stages.contact_stage_duration(*contact) == pytest.approx(2 * B / 1e9 / 100, rel=1e-14)
    peak = stages.shaft_torque(stages.time_of_peak(*contact), *contact)
    assert peak == pytest.approx(B**2 / 2e9, rel=1e-13)


def test_just_after_contact_the_torque_has_all_its_digits():
    # 1 - cos would leave nothing of mean (Omega t)^2/2
    assert stages.shaft_torque(1e-10, 50.0, 0.0, 368.465, 112.0) == pytest.approx(
        50 * (112e-10) ** 2 / 2, rel=1e-14
    )


# ---- arrays and input ----


def test_arrays_broadcast_and_floats_stay_floats():
    r, gap = np.linspace(0.1, 1.0, 4)[:, None], np.array([0.0, 0.5, 2.0])
    for kind in ("active", "reactive"):
        table = stages.method_2(r, **CRANE | {"gap": gap}, kind=kind)
        assert all(column.shape == (4, 3) for column in table)
        for i, j in np.ndindex(4, 3):
            one = stages.method_2(float(r[i, 0]), **CRANE | {"gap": float(gap[j])}, kind=kind)
            assert all(type(value) is float for value in one)
            assert one == pytest.approx([column[i, j] for column in table], rel=0, abs=0, nan_ok=True)
    assert type(stages.shaft_torque(0.0, 1.0, 1.0, 1.0, 1.0)) is float


@pytest.mark.parametrize(
    ("changes", "sentences"),
    [
        ({"J1": 0.0}, ["J1 = 0: the motor inertia in kg m2 must be finite and above 0."]),
        ({"J2": -1.0}, ["J2 = -1: the load inertia in kg m2 must be finite and above 0."]),
        ({"c": math.inf}, ["c = inf: the stiffness in N m/rad must be finite and above 0."]),
        ({"gap": [0.5, -0.1]}, ["gap[1] = -0.1: the total gap in rad must be finite and 0 or more."]),
        ({"Mc": math.nan}, ["Mc = nan: must be finite."]),
        ({"Ms": "62 N m"}, ["Ms = '62 N m': a number or an array of numbers is needed."]),
        ({"gap": [1, 2], "c": [1, 2, 3]}, ["The arrays do not broadcast together; their shapes are "]),
        ({"J1": -1, "Ms": 0}, ["J1 = -1: the motor inertia", "Ms = 0: the starting torque"]),
        ({"Mc": -400.0}, ["M1/J1 + Mc/J2 = -514.286 rad/s2: the masses do not approach each other"]),
    ],
)
def test_impossible_input_is_refused_in_sentences(changes, sentences):
    with pytest.raises(InputError) as refusal:
        stages.method_1(1.0, **CRANE | changes)
    assert len(refusal.value.sentences) == len(sentences)
    for given_sentence, expected in zip(refusal.value.sentences, sentences, strict=True):
        assert given_sentence.startswith(expected)


def test_other_impossible_input():
    with pytest.raises(InputError, match="reactive load in N m must be 0 or more"):
        stages.method_1(1.0, **CRANE | {"Mc": -1.0}, kind="reactive")
    with pytest.raises(InputError, match="reactive load in N m must be 0 or more"):
        stages.reactive_peak_shaft_torque(1.0, -1.0, 1.0, J1=1, J2=1, c=1)
    with pytest.raises(InputError, match='kind = \'passive\': a load is "active" or "reactive"'):
        stages.method_1(1.0, **CRANE, kind="passive")
    with pytest.raises(InputError, match="never closes"):
        stages.method_1(0.0, **CRANE, kind="reactive")
    with pytest.raises(InputError, match="speed of impact"):
        stages.peak_shaft_torque(1.0, -1.0, 1.0, 1.0)
    with pytest.raises(InputError, match="base = 0"):
        stages.dynamic_coefficient(1.0, 0.0)
