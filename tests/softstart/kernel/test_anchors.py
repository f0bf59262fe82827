"""The start of the crane drive of [G] in 50-digit arithmetic: what every change must reproduce."""

from __future__ import annotations

import pytest

from softstart import Drive, simulate

# start position: peak N m, K_dyn, gap events, twist at 1 s
ANCHORS = {
    0.0: (257.18400593175536, 4.86538036193256, 20, 0.082380438497258424),
    -1.0: (336.94171218858844, 6.37422838041219, 16, -0.99664341243459861),
}


@pytest.mark.parametrize("law", ["no-pull", "dead-zone", "modelica"])
@pytest.mark.parametrize("position", ANCHORS)
def test_constant_torque_for_one_second(position: float, law: str) -> None:
    """Without damping the contact laws agree."""
    drive = Drive(
        motor_inertia=0.035, load_inertia=0.175, stiffness=368.465, gap=2.0, starting_torque=62.0,
        load_torque=7.16, target_speed=1e6, start_position=position, contact_law=law,
    )  # fmt: skip
    peak, k_dyn, gap_events, twist = ANCHORS[position]
    run = simulate(drive, "direct", until=1.0)
    assert run.peak_torque == pytest.approx(peak, rel=1e-12)
    assert run.k_dyn == pytest.approx(k_dyn, rel=1e-12)
    assert float(run.at(1.0)["theta"]) == pytest.approx(twist, abs=1e-10)
    assert sum(event.kind in {"gap closed", "gap opened"} for event in run.events) == gap_events
