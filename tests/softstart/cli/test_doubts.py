"""What can hardly be is doubted: each limit on both sides, and no machine that is shipped."""

from __future__ import annotations

import math

import pytest
from tests.twin import chain_of

from softstart import Chain, Drive, simulate
from softstart.chain.elements import LIBRARY, Mass, Motor, Shaft
from softstart.drive import library
from softstart.drive.plausibility import plausibility_warnings

CRANE = Drive.load("crane-4amtkf")
J = 0.035 * 0.175 / 0.21  # of the elastic mode
TURN = 2.0 * math.pi


@pytest.mark.parametrize("machine", [*library.names(), *LIBRARY.names()])
def test_no_shipped_machine_is_doubted(machine: str) -> None:
    assert plausibility_warnings((Drive if machine in library.names() else Chain).load(machine)) == []


@pytest.mark.parametrize(
    ("about", "at_limit", "beyond", "others"),
    [
        ("elastic frequency", {"stiffness": J * (0.5 * TURN) ** 2}, 0.99, {}),
        ("elastic frequency", {"stiffness": J * (500 * TURN) ** 2}, 1.01, {"gap": 0.0}),
        ("damping ratio", {"damping": 2.0 * math.sqrt(368.465 * J)}, 1.01, {}),
        ("half a turn", {"gap": math.pi}, 1.01, {}),
        ("inertia of the load", {"load_inertia": 0.01 * 0.035}, 0.99, {}),
        ("inertia of the load", {"load_inertia": 100 * 0.035}, 1.01, {}),
        ("the rated torque", {"starting_torque": 6 * 150 / TURN}, 1.01, {"maximum_torque": 200}),
        ("if rpm", {"target_speed": 10_000 * TURN / 60}, 1.01, {}),
        ("a minute", {"starting_torque": 7.16 + 0.21 * 92.153 / 60}, 0.999, {}),
    ],
)  # fmt: skip
def test_each_limit_on_both_sides(
    about: str, at_limit: dict[str, float], beyond: float, others: dict[str, float]
) -> None:
    ((name, value),) = at_limit.items()
    inward = 1.0 + 1e-3 * math.copysign(1.0, 1.0 - beyond)
    within, without = (CRANE.replace(**{name: share * value}, **others) for share in (inward, beyond))
    for of in (lambda drive: drive, chain_of):
        assert not any(about in one for one in plausibility_warnings(of(within)))
        (found,) = (one for one in plausibility_warnings(of(without)) if about in one)
        assert found.endswith(("?", ".")), "the likeliest mistake comes last"


@pytest.mark.parametrize(
    ("inertia", "ratio", "doubted"), [(0.6, 0.99, True), (0.6, 1.0, False), (0.03, 0.5, False)]
)
def test_a_ratio_below_one_is_doubted_before_the_larger_inertia(
    inertia: float, ratio: float, doubted: bool
) -> None:
    """A fan may turn faster than its motor."""
    chain = Chain([Mass(0.4), Mass(inertia)], [Shaft(4000, gap=0.1, ratio=ratio)], Motor(62, rated_speed=90))
    drive = CRANE.replace(motor_inertia=0.4, load_inertia=inertia / ratio**2, gear_ratio=ratio)
    for machine in (chain, drive):
        assert [one[:16] for one in plausibility_warnings(machine)] == ["gear ratio 0.99 "] * doubted


@pytest.mark.parametrize("position", ["mid-gap", "opposite-flank", "hanging"])
def test_k_dyn_that_is_doubted_is_that_of_the_start(position: str) -> None:
    """Undamped, the estimate is the peak of the first contact itself, [G](16) and (18)."""
    for stiffness, doubted in ((368.465, False), (3684.65, True)):
        drive = CRANE.replace(start_position=position, gap=3.0, stiffness=stiffness)
        k = simulate(drive, "direct").k_dyn_first_contact
        found = [one for one in plausibility_warnings(drive) if one.startswith("K_dyn of direct")]
        assert bool(found) == (k > 8.0) == (doubted and position != "hanging")
        assert not found or f"about {k:.4g} " in found[0]


@pytest.mark.parametrize("ratio", [0.01, 0.05, 0.1])
def test_of_a_damped_drive_it_is_so_to_2_percent(ratio: float) -> None:
    stiff = CRANE.replace(gap=3.0, stiffness=3684.65, damping=2.0 * ratio * math.sqrt(3684.65 * J))
    (found,) = (one for one in plausibility_warnings(stiff) if one.startswith("K_dyn of direct"))
    said = float(found.partition("about ")[2].split()[0])
    assert said == pytest.approx(simulate(stiff, "direct").k_dyn_first_contact, rel=0.02)


def test_a_backlash_in_the_wrong_unit_is_doubted_by_the_commands(run, as_json) -> None:
    """Of 9 arcmin written as 9 rad, behind 25:1, come 225 rad at the motor."""
    gap = ("--set", "gap=225 rad", "--controllers", "direct")
    found = as_json("compare", *gap)["plausibility_warnings"]
    assert [one.split(" at ")[0] for one in found][:1] == ["gap 225 rad"]
    out = run("compare", *gap).out
    assert out.count("  doubt  ") == len(found)
    assert found == plausibility_warnings(CRANE.replace(gap=225))
