"""The kernel against an independent integration: DOP853 at rtol 1e-11 between located events."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from tests.oracle import integrate, random_case
from tests.softstart.kernel.pieces import Pieces

from softstart import Drive, Run, simulate

KINDS = {
    "gap closed": "closed",
    "gap opened": "opened",
    "load starts": "load-starts",
    "load stops": "load-stops",
    "target speed reached": "target",
    "brake released": "released",
    "motor starts": "motor-starts",
    "motor stops": "motor-stops",
}
DRIVES_PER_BLOCK = 25
BLOCKS = 4 if settings.default.derandomize else 20  # `make fuzz` takes all


def case(seed: int) -> dict[str, Any]:
    """A random start that a Drive can hold: it begins without torque, its target is above the load speed."""
    drawn = random_case(np.random.default_rng(seed))
    drawn["u0"] = 0.0
    drawn["target"] = max(drawn["target"], drawn["w2_0"] + 1e-3 * abs(drawn["w2_0"]))
    return drawn


FIELDS = {
    "J1": "motor_inertia", "J2": "load_inertia", "c": "stiffness", "d": "damping", "gap": "gap",
    "Mc": "load_torque", "kind": "load_kind", "law": "contact_law", "theta0": "start_position",
    "lag": "torque_lag", "rate": "torque_rate", "target": "target_speed", "friction": "motor_friction",
    "w1_0": "initial_motor_speed", "w2_0": "initial_load_speed",
    "b1": "motor_viscous_friction", "b2": "load_viscous_friction", "load_friction": "load_friction",
}  # fmt: skip


def drive_of(drawn: dict[str, Any]) -> Drive:
    """The drive of this start, whose motor has all that the pieces ask for."""
    pieces = drawn["torque_pieces"]
    ends = [*(piece[0] for piece in pieces[1:]), drawn["t_end"]]
    torques = [u for _, u, *_ in pieces]
    torques += [u + (end - t) * sum(slope) for (t, u, *slope), end in zip(pieces, ends, strict=True)]
    limits = {
        "starting_torque": max(*torques, 1.1 * (drawn["Mc"] + drawn.get("load_friction", 0.0)), 1e-09),
        "minimum_torque": min(0.0, *torques),
    }
    fields = {FIELDS[name]: value for name, value in drawn.items() if name in FIELDS}
    release = drawn.get("release", 0.0)
    brake = {"brake": "motor", "release": "torque" if math.isinf(release) else release} if release else {}
    return Drive(**fields, **limits, **brake)


def run_of(drawn: dict[str, Any]) -> Run:
    """The same start by the plant under test."""
    played = Pieces(pieces=tuple(drawn["torque_pieces"]), end=drawn["t_end"])
    return simulate(drive_of(drawn), played, until=drawn["t_end"])


@pytest.mark.hypothesis
@pytest.mark.parametrize("block", range(BLOCKS))
def test_peaks_events_and_final_state(block: int) -> None:
    for seed in range(block * DRIVES_PER_BLOCK, (block + 1) * DRIVES_PER_BLOCK):
        compare_with_oracle(case(seed), seed)


def case_with_friction(seed: int) -> dict[str, Any]:
    """A random start with friction at the motor, viscous friction on either side, or all of them."""
    drawn, rng = case(seed), np.random.default_rng((seed, 17))
    which = rng.integers(1, 8)
    room = 0.9 * (max(1.1 * drawn["Mc"], *(u for _, u in drawn["torque_pieces"])) - drawn["Mc"])
    rate = 2.0 * math.pi / drawn["t_end"]
    if which & 1:
        drawn["friction"] = max(room, 0.0) * float(rng.uniform(0.01, 1.0))
    for bit, name, inertia in ((2, "b1", "J1"), (4, "b2", "J2")):
        if which & bit:
            drawn[name] = drawn[inertia] * rate * float(10 ** rng.uniform(-3.0, 0.5))
    left = room - drawn.get("friction", 0.0)
    if (most := drawn.get("b1", 0.0) + drawn.get("b2", 0.0)) > 0.0:
        drawn["target"] = max(min(drawn["target"], 0.9 * left / most), 1e-6)
    drawn["w2_0"] = min(drawn["w2_0"], 0.5 * drawn["target"])
    return drawn


@pytest.mark.hypothesis
@pytest.mark.parametrize("block", range(BLOCKS // 2))
def test_friction_of_motor_and_load(block: int) -> None:
    for seed in range(20_000 + block * DRIVES_PER_BLOCK, 20_000 + (block + 1) * DRIVES_PER_BLOCK):
        compare_with_oracle(case_with_friction(seed), seed)


def case_of_both_parts(seed: int) -> dict[str, Any]:
    """A random start with an active load torque, some driving, and friction of 0.05 to 2 times that."""
    drawn, rng = case(seed), np.random.default_rng((seed, 29))
    Mc = drawn["Mc"] / 3.0
    most = max(u for _, u in drawn["torque_pieces"])
    drives = rng.random() < 0.4 and Mc * drawn["J1"] / drawn["J2"] < 0.5 * most  # the mean torque is above 0
    sign = -1.0 if drives else 1.0
    return drawn | {
        "kind": "active",
        "Mc": sign * Mc,
        "load_friction": Mc * float(10 ** rng.uniform(-1.3, 0.3)),
    }


@pytest.mark.hypothesis
@pytest.mark.parametrize("block", range(BLOCKS))
def test_a_load_with_an_active_and_a_reactive_part(block: int) -> None:
    for seed in range(40_000 + block * DRIVES_PER_BLOCK, 40_000 + (block + 1) * DRIVES_PER_BLOCK):
        compare_with_oracle(case_of_both_parts(seed), seed)


SHAFTS_WITH_RATES_APART: list[dict[str, Any]] = [
    {  # the swing dies out within 10 ms, the torque goes on rising behind a lag of a second
        "J1": 0.0032780038938991225, "J2": 0.34673134104500997, "c": 2759.831424123467,
        "d": 3.024990444063558, "gap": 0.1799843551400405, "Mc": 8.011087346808829, "kind": "reactive",
        "lag": 1.15986558352683, "theta0": -0.7307878834404656 * 0.1799843551400405 / 2, "t_end": 0.5,
        "torque_pieces": [(0.0, 40.0), (0.15, 15.0), (0.3, -25.0)],
    },
    {  # a damper a thousand times the critical one
        "J1": 0.0041003, "J2": 0.175, "c": 280.29, "d": 2043.9, "gap": 3.9065, "Mc": 7.16, "kind": "active",
        "lag": 5e-42, "theta0": 0.0, "t_end": 0.02, "torque_pieces": [(0.0, 62.0)],
    },
]  # fmt: skip


@pytest.mark.parametrize("law", ["no-pull", "dead-zone", "modelica"])
@pytest.mark.parametrize("drive", SHAFTS_WITH_RATES_APART, ids=["lag", "damper"])
def test_rates_decades_apart(drive: dict[str, Any], law: str) -> None:
    """Bounds by energy hold the fast rate against the slow motion; the search must end all the same."""
    drawn = drive | {"law": law, "w1_0": 0.0, "w2_0": 0.0, "rate": math.inf, "u0": 0.0, "target": 92.15}
    if drawn["lag"] < 1e-40:  # none, for an integrator
        run_of(drawn)
        drawn["lag"] = 0.0
    compare_with_oracle(drawn, law)


def test_a_peak_after_a_rest_on_the_flank() -> None:
    """At rest on the flank under a torque that begins behind a lag: T, T' and T'' are zero, then T rises."""
    drawn = {
        "J1": 0.4, "J2": 0.2, "c": 2.6, "d": 0.0, "gap": 6e-4, "Mc": 0.0, "kind": "active", "law": "no-pull",
        "theta0": 3e-4, "w1_0": 0.0, "w2_0": 0.0, "torque_pieces": [(0.0, 1e-3)], "lag": 4e-4,
        "rate": math.inf, "u0": 0.0, "t_end": 2.0, "target": 1.0,
    }  # fmt: skip
    run, other = run_of(drawn), integrate(**drawn)
    assert run.peak_torque == pytest.approx(2.0 * 1e-3 * 0.2 / 0.6, rel=1e-5)  # of a step: twice the mean
    assert run.peak_torque == pytest.approx(abs(other.peak), rel=1e-8)


def test_a_torque_that_rises_again_is_no_fall_of_rounding() -> None:
    """Flanks that overlap without torque press again: in a wide gap one of two starts opened indefinitely."""
    drive = Drive(
        motor_inertia=0.003280417279720255, load_inertia=0.026933979981461822, stiffness=6081.461213564751,
        damping=12.194722711325356, gap=6.0770811691186095, load_torque=0.008161493682864906,
        start_position=2.9824742482687534, torque_lag=0.0019378736470435942, starting_torque=62.0,
        maximum_torque=64.0, minimum_torque=-64.0, target_speed=92.15,
    )  # fmt: skip
    steps = Pieces(pieces=((0.0, 40.0), (0.15, 15.0), (0.3, -25.0)), end=0.6)
    run = simulate(drive, steps, until=0.6)
    assert len(run.events) < 20
    assert abs(run.energy.residual) < 1e-9 * abs(run.energy.motor)


def compare_with_oracle(drawn: dict[str, Any], seed: int | str, within: float = 1e-7) -> None:
    """Same peak, events in the same order and at the same instants (of the length of the run), same end."""
    joined = drawn["gap"] == 0.0
    if joined:  # a spring that pulls too, which has no flanks
        drawn = drawn | {"law": "dead-zone"}
    run, other = run_of(drawn), integrate(**drawn)
    events = [one for one in other.events if not (joined and one[1] in ("closed", "opened"))]
    first = sum(event.time == 0.0 for event in run.events) if "release" in drawn else 0  # which have no order
    names, kinds = [KINDS[event.kind] for event in run.events], [kind for _, kind in events]
    # within 1e-8; the floor is the torque of 1e-12 rad
    assert run.peak_torque == pytest.approx(abs(other.peak), rel=1e-8, abs=1e-12 * drawn["c"]), seed
    assert (sorted(names[:first]), names[first:]) == (sorted(kinds[:first]), kinds[first:]), seed
    mine, theirs = [event.time for event in run.events], [time for time, _ in events]
    # a shallow crossing amplifies the oracle's own 1e-11: the last events of long starts move most
    np.testing.assert_allclose(
        mine, theirs, rtol=10.0 * within, atol=within * drawn["t_end"], err_msg=str(seed)
    )
    end = run.at(drawn["t_end"])
    scale = np.abs(run.w1).max() + np.abs(run.w2).max() + 1e-12
    assert [end["w1"], end["w2"]] == pytest.approx([other.w1, other.w2], abs=1e-7 * scale), seed
    assert float(end["u"]) == pytest.approx(other.u, rel=1e-9, abs=1e-9 * max(run.drive.Ms, 1e-12)), seed
