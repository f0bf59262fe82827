"""A load torque with an active part and Coulomb friction besides: hand calculations, limits, invariants."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.softstart.kernel.pieces import Pieces
from tests.twin import chain_of

from softstart import Drive, InputError, machine_table, simulate
from softstart.chain import Chain, Mass, Motor, Shaft

CRANE = Drive.load("crane-4amtkf")
LIFT, RUB = 5.0, 2.0  # N m
# without a start position, which follows from the load
LOOSE = Drive(**{name: value for name, value in CRANE.given().items() if name != "start_position"})
BELT = LOOSE.replace(load_torque=LIFT, load_friction=RUB, damping=1.0)


def test_a_load_that_coasts_forward_stops_and_falls() -> None:
    """In an open gap: slowed by lift + friction, then driven back by lift - friction; by hand."""
    w0 = 4.0
    drive = BELT.replace(gap=400.0, initial_load_speed=w0, initial_motor_speed=w0, start_position="mid-gap")
    J2, until = float(drive.J2), 0.5
    run = simulate(drive, Pieces(pieces=((0.0, 0.0),)), until=until)
    stop = J2 * w0 / (LIFT + RUB)
    kinds = [(event.kind, event.time) for event in run.events if event.kind.startswith("load")]
    assert kinds == [("load stops", pytest.approx(stop)), ("load starts", pytest.approx(stop))]
    back = (LIFT - RUB) / J2
    end = run.at(until)
    assert end["w2"] == pytest.approx(-back * (until - stop), rel=1e-12)
    assert end["phi2"] == pytest.approx(0.5 * w0 * stop - 0.5 * back * (until - stop) ** 2, rel=1e-11)
    assert run.energy.load == pytest.approx(
        (LIFT + RUB) * 0.5 * w0 * stop - (LIFT - RUB) * 0.5 * back * (until - stop) ** 2, rel=1e-11
    )
    held = simulate(drive.replace(load_friction=1.001 * LIFT), Pieces(pieces=((0.0, 0.0),)), until=until)
    assert held.at(until)["w2"] == 0.0  # friction holds it where it has stopped


@pytest.mark.parametrize(("torque", "moves"), [(LIFT + RUB, 1), (LIFT - RUB, -1)])
def test_a_load_at_rest_moves_beyond_active_plus_or_minus_friction(torque: float, moves: int) -> None:
    """Without a gap under a slow motor torque: it stays while |T - active| <= friction, to 1e-9 of it."""
    drive = BELT.replace(gap=0.0, minimum_torque=-60.0, damping=3.0, start_position=torque / float(BELT.c))
    for share, expected in ((1e-9, moves), (-1e-9, 0)):
        level = torque * (1.0 + moves * share)
        run = simulate(
            drive.replace(start_position=level / float(drive.c)), Pieces(pieces=((0.0, level),)), until=0.5
        )
        assert np.sign(run.at(0.5)["w2"]) == expected


@pytest.mark.parametrize("friction", [0.0, 2.0, 9.0])
def test_a_batch_a_chain_and_a_single_start_are_one(friction: float) -> None:
    drive = BELT.replace(load_friction=friction, start_position="mid-gap")
    one = simulate(drive, "direct")
    assert simulate(machine_table(drive, gap=[0.5, 0.2]), "direct").k_dyn[0] == one.k_dyn
    assert simulate(chain_of(drive), "direct", fitted_to=drive).peak_torque == one.peak_torque
    assert abs(one.energy.residual) < 1e-12 * one.energy.motor


def test_a_mass_has_both_parts_on_its_own_shaft() -> None:
    """Behind a gear of ratio 4 torques are a quarter at the motor, whatever shaft they are brought to."""
    drive = BELT.replace(start_position="mid-gap")
    load = Mass(16.0 * drive.J2, torque=4.0 * LIFT, friction=4.0 * RUB)
    shaft = Shaft(drive.c, damping=drive.d, gap=drive.gap, ratio=4.0)
    chain = Chain([Mass(drive.J1), load], [shaft], Motor(drive.Ms), target_speed=drive.target_speed)
    run = simulate(chain, "direct", fitted_to=drive)
    assert run.peak_torque == pytest.approx(simulate(drive, "direct").peak_torque, rel=1e-12)
    assert run.k_dyn == pytest.approx(simulate(drive, "direct").k_dyn, rel=1e-12)
    assert Chain.from_toml(chain.to_toml()) == chain
    at_load = chain.brought_to("mass 2").masses[1]
    assert (at_load.torque, at_load.friction) == (4.0 * LIFT, 4.0 * RUB)
    reduced = chain.two_masses
    assert (reduced.load_torque, reduced.load_friction, reduced.load_kind) == (LIFT, RUB, "active")


def test_the_mean_torque_and_the_refusal_take_the_sum() -> None:
    J1, J2 = float(BELT.J1), float(BELT.J2)
    assert BELT.mean_torque == pytest.approx((62.0 * J2 + J1 * (LIFT + RUB)) / (J1 + J2))  # [G](16)
    with pytest.raises(InputError, match=r"against its torque and load_friction = 57 N"):
        BELT.replace(load_friction=57.0)
    with pytest.raises(InputError, match=r"friction of the load besides its torque must be 0 or more"):
        BELT.replace(load_friction="-1 N*m")
    with pytest.raises(InputError, match=r"carries the load torque and load_friction = 2 N"):
        BELT.replace(permissible_torque=6.5)


def test_where_the_start_begins() -> None:
    """Hanging by the active part; at an unknown position only where friction alone can hold the load."""
    behind_brake = {"brake": "motor", "gap": 0.5}
    hangs = BELT.replace(**behind_brake)
    assert (hangs.start_position, hangs.theta0) == ("hanging", 0.25 + LIFT / BELT.c)
    assert BELT.replace(**behind_brake, load_friction=5.0).start_position == "unknown"
    assert [BELT.replace(load_friction=one).start_position for one in (4.99, 5.0)] == ["mid-gap", "unknown"]
    assert BELT.replace(load_friction=5.0, gap=0.0).start_position == "mid-gap"
    assert BELT.replace(load_torque=-LIFT, load_friction=5.0).start_position == "unknown"
    with pytest.raises(InputError, match="start_position is missing: friction holds some of these loads"):
        machine_table(BELT, load_friction=[0.0, 9.0])
    assert len(machine_table(BELT.replace(start_position="mid-gap"), load_friction=[0.0, 9.0])) == 2


def test_more_friction_never_speeds_up_a_start() -> None:
    """A start under constant torque takes longer the more friction there is, whatever the active part."""
    for torque in (-6.0, 0.0, 5.0):
        drive = BELT.replace(load_torque=torque, start_position="driving-flank", damping=3.0)
        frictions = np.linspace(0.0, 30.0, 13)
        times = simulate(machine_table(drive, load_friction=frictions), "direct").start_time.values
        assert all(before < after for before, after in pairwise(times))


def test_an_inclined_belt_on_its_backstop() -> None:
    """Lift 297.9 N m and friction 40.1 N m at the motor, 75 kW. All friction: 1358 N m, and the gap counts.

    By hand, undamped: from rest at T0 the motor alone winds the shaft up about Ms, with sqrt(c/J1), to Mc at
    the rate T' = sqrt((Ms - T0)^2 - (Ms - Mc)^2) sqrt(c/J1); then both masses swing about Mc + over.
    """
    drive = Drive(
        motor_inertia=0.9, starting_torque=723.43, stiffness=2340.6, gap=0.072722, load_inertia=3.2681,
        load_torque=297.9, load_friction=40.1, target_speed="1485 rpm", brake="motor",
    )  # fmt: skip
    share = drive.J2 / (drive.J1 + drive.J2)
    over = (drive.Ms - drive.Mc) * share

    def by_hand(T0: float) -> float:
        rise = math.sqrt(((drive.Ms - T0) ** 2 - (drive.Ms - drive.Mc) ** 2) * share)
        return float(drive.Mc + over + math.hypot(over, rise))

    assert drive.start_position == "hanging"
    damped = drive.replace(damping=1.6256)
    for T0, with_damping in ((297.9, 961.5), (drive.Mc, 924.3), (drive.Mc - 80.2, 998.1)):
        where = {} if T0 == 297.9 else {"start_position": 0.5 * drive.gap + T0 / drive.c}
        one = drive.replace(**where)
        assert simulate(one, "direct").peak_torque == pytest.approx(by_hand(T0), rel=1e-10)
        run = simulate(damped.replace(**where), "direct")
        assert run.peak_torque == pytest.approx(with_damping, abs=0.1)
    friction = damped.replace(load_kind="reactive", brake="none", start_position="unknown")
    assert simulate(friction, "direct").peak_torque == pytest.approx(1358.5, abs=0.1)


def test_a_load_on_the_ground_is_lifted_from_rest_and_does_not_fall_through_the_gap() -> None:
    """A hoist in mid-gap with its load set down: the ground carries it until the shaft torque exceeds Mc.

    The motor crosses half the gap alone, winds up the shaft against a load at rest, then lifts it.
    """
    hoist = Drive.load("hoist-15kw").replace(start_position="mid-gap", brake="none", load_kind="reactive")
    J1, J2, c, d, Ms, Mc = (getattr(hoist, name) for name in ("J1", "J2", "c", "d", "Ms", "Mc"))

    def torque(x: Any) -> Any:  # x: compression of the shaft, speeds of motor and load
        return c * x[0] + d * (x[1] - x[2])

    def lifted(_: float, x: Any) -> float:
        return float(torque(x) - Mc)

    def at_its_peak(_: float, x: Any) -> float:
        return float(c * (x[1] - x[2]) + d * ((Ms - torque(x)) / J1 - (torque(x) - Mc) / J2))

    lifted.terminal = at_its_peak.terminal = True  # type: ignore[attr-defined]
    lifted.direction, at_its_peak.direction = 1.0, -1.0  # type: ignore[attr-defined]
    tight = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}
    wound = solve_ivp(
        lambda t, x: (x[1], (Ms - torque(x)) / J1, 0.0),
        (0.0, 1.0), (0.0, math.sqrt(Ms / J1 * hoist.gap), 0.0), events=lifted, **tight,
    )  # fmt: skip
    peak = solve_ivp(
        lambda t, x: (x[1] - x[2], (Ms - torque(x)) / J1, (torque(x) - Mc) / J2),
        (0.0, 1.0), wound.y[:, -1], events=at_its_peak, **tight,
    )  # fmt: skip

    run = simulate(hoist, "direct")
    assert run.peak_torque == pytest.approx(torque(peak.y[:, -1]), rel=1e-9)
    assert run.peak_torque == pytest.approx(315.33, abs=0.005)
    falling = simulate(hoist.replace(load_kind="active"), "direct")
    assert falling.peak_torque > 1.2 * run.peak_torque
