"""The strategies of [G] against (3), (15), (18) over four decades; lag and limiter in 80-digit arithmetic."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal, localcontext

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from softstart import Drive, formulas, simulate


def decades(low: float) -> st.SearchStrategy[float]:
    """Four decades from `low`, evenly in the logarithm."""
    return st.floats(math.log(low), math.log(low) + math.log(1e4)).map(math.exp)


@settings(max_examples=300, deadline=None)
@given(
    J1=decades(1e-3),
    J2=decades(1e-3),
    c=decades(1.0),
    gap=decades(1e-3),
    Ms=decades(0.1),
    load=st.floats(0.0, 0.99),
    r=st.floats(0.01, 1.0),
    strategy=st.sampled_from(["direct", "reduced-first-stage", "reduced-two-stage"]),
)
@example(J1=0.035, J2=0.175, c=368.465, gap=2.0, Ms=62.0, load=0.1155, r=0.25, strategy="reduced-two-stage")
def test_k_dyn_of_the_first_contact_is_18(
    J1: float, J2: float, c: float, gap: float, Ms: float, load: float, r: float, strategy: str
) -> None:
    Mc = load * Ms
    r = 1.0 if strategy == "direct" else r
    # stage 2 must exist: with a torque below the load's, the gap still closes (active load)
    second = r if strategy == "reduced-two-stage" else 1.0
    start = formulas.two_stages(r * Ms, second * Ms, J1=J1, J2=J2, c=c, gap=gap, Ms=Ms, Mc=Mc)
    fields = {"motor_inertia": J1, "load_inertia": J2, "stiffness": c, "gap": gap}
    drive = Drive(**fields, starting_torque=Ms, load_torque=Mc, target_speed=1e9)
    until = start.open_duration + drive.elastic_period * (1 + 1e-9)  # stage 2 is shorter than this
    more = {"raise_at": "end"} if strategy == "reduced-two-stage" else {}  # as [G] does
    run = simulate(
        drive, strategy, until, parameters=more if strategy == "direct" else {"torque": r * Ms, **more}
    )
    assert run.first_contact == pytest.approx(start.open_duration, rel=1e-10)
    assert run.k_dyn_first_contact == pytest.approx(start.k_dyn, rel=1e-10)
    assert run.stage_durations[1] == pytest.approx(start.contact_duration, rel=1e-9)


@settings(max_examples=60, deadline=None)
@given(r=st.floats(0.05, 1.0), gap=st.floats(0.01, 4.0), J2=st.floats(0.02, 0.5))
def test_over_the_whole_start_direct_and_method_1_stay_at_17(r: float, gap: float, J2: float) -> None:
    drive = Drive.load("crane-4amtkf").replace(gap=gap, load_inertia=J2)
    first = simulate(drive, "reduced-first-stage", parameters={"torque": r * 62.0})
    assert first.k_dyn == pytest.approx(first.k_dyn_first_contact, rel=1e-10)
    # method 2 raises the torque as the gap opens again: its second contact is as hard as method 1's first
    second = simulate(drive, "reduced-two-stage", parameters={"torque": r * 62.0, "raise_at": "end"})
    assume(second.contacts > 1)
    assert second.k_dyn == pytest.approx(first.k_dyn, rel=1e-9)


CRANE = Drive.load("crane-4amtkf")


def root_of(f: Callable[[Decimal], Decimal], low: float, high: float) -> float:
    """Where f rises through zero, in the arithmetic of the caller."""
    below, above = Decimal(low), Decimal(high)
    for _ in range(160):
        middle = (below + above) / 2
        below, above = (middle, above) if f(middle) < 0 else (below, middle)
    return float(above)


@pytest.mark.parametrize("lag", [1e-2, 1.0, 1e2, 1e4, 1e6, 1e9])
@pytest.mark.parametrize("rise", [1e-9, 1e-6, 1e-3, 0.05])
def test_first_contact_behind_any_lag_and_limit(lag: float, rise: float) -> None:
    """From mid-gap: the torque of the ramp behind the lag, twice integrated, less that of the ramp's end."""
    drive = CRANE.replace(torque_lag=lag, torque_rate=float(CRANE.Ms) / rise, load_torque=1e-9)
    run = simulate(drive, "direct", until=200.0)
    with localcontext() as context:
        context.prec = 80
        L, R, D = Decimal(lag), Decimal(float(drive.torque_rate)), Decimal(float(drive.Ms))
        J1, J2, half = Decimal(float(drive.J1)), Decimal(float(drive.J2)), Decimal(float(drive.gap)) / 2
        Mc, end = Decimal(float(drive.Mc)), D / R

        def ramp(t: Decimal) -> Decimal:
            """The second integral of a ramp behind the lag."""
            return R * (t**3 / 6 - L * t**2 / 2 + L**2 * t - L**3 * (1 - (-t / L).exp()))

        def twist(t: Decimal) -> Decimal:
            u = ramp(t) - (ramp(t - end) if t > end else 0)
            return u / J1 + Mc * t**2 / (2 * J2) - half

        contact = root_of(twist, 0.0, 200.0)
    assert run.first_contact == pytest.approx(contact, rel=2e-13)


@pytest.mark.parametrize("lag", [0.0, 1e-9, 1e-6, 0.01])
@pytest.mark.parametrize("damping", [0.0, 0.6])
def test_a_limiter_without_effect_has_none(lag: float, damping: float) -> None:
    """Wound up from the driving flank: a limiter that slews in 1e-10 s and less hardly counts."""
    drive = CRANE.replace(start_position="driving-flank", damping=damping, torque_lag=lag)
    step = simulate(drive, "direct", until=0.4)
    for rate in (1e12, 1e14, 1e16, 1e18, 1e24):
        run = simulate(drive.replace(torque_rate=rate), "direct", until=0.4)
        near = 1e-12 + 100.0 * 62.0 / rate  # the slewing, s, times rates of change of no more than 100/s
        assert run.peak_torque == pytest.approx(step.peak_torque, rel=near), rate
        mine, theirs = run.at(0.3), step.at(0.3)
        for name in ("w1", "w2", "T"):
            assert float(mine[name]) == pytest.approx(float(theirs[name]), rel=near), rate
