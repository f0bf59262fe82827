"""The three idealised strategies against (3), (15) and (18) of [G], over four decades of everything."""

from __future__ import annotations

import math

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
    drive = Drive(
        motor_inertia=J1,
        load_inertia=J2,
        stiffness=c,
        gap=gap,
        starting_torque=Ms,
        load_torque=Mc,
        target_speed=1e9,
    )
    until = start.open_duration + drive.elastic_period * (1 + 1e-9)  # stage 2 is shorter than this
    given_torque = {} if strategy == "direct" else {"torque": r * Ms}
    given_torque |= {"raise_at": "end"} if strategy == "reduced-two-stage" else {}  # as [G] does
    run = simulate(drive, strategy, until, parameters=given_torque)
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
