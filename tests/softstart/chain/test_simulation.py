"""The exact start of a chain: two masses are a drive, and what must be kept is kept."""

from __future__ import annotations

import numpy as np
import pytest
from tests.softstart.kernel.pieces import Pieces
from tests.twin import chain_of

from softstart import Command, Drive, InputError, PlainController, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.controller import Sensor
from softstart.start.kernel_input import kernel_input
from softstart.views.starts import shaft_table

CRANE = Drive.load("crane-4amtkf")
DRIVES = {
    "undamped": {},
    "dead-zone": {"damping": 0.3, "contact_law": "dead-zone"},
    "modelica, reactive": {"damping": 0.5, "contact_law": "modelica", "load_kind": "reactive"},
    "lag and rate": {"torque_lag": 0.002, "torque_rate": 5000.0},
    "dead time and noise": {"computing_delay": 0.0017, "torque_noise": 0.5, "encoder_lines": 256},
    "from overlap": {"start_position": 0.27, "initial_load_speed": 5.0, "load_kind": "reactive"},
}


def test_the_table_of_shafts_has_the_torque_at_each_own_shaft_by_hand():
    """Behind 4:1 it is four times that at the motor shaft: that of the same masses without the gear."""
    shafts, masses = [Shaft(1e4, ratio=4.0, side="after"), Shaft(2e4, gap=0.02)], [Mass(2.0), Mass(3.0)]
    geared = Chain([Mass(0.1), *masses], shafts, Motor(20.0), target_speed=20.0)
    plain = Chain([Mass(1.6), *masses], [Shaft(1e4), shafts[1]], Motor(80.0), target_speed=5.0)
    table, exact = shaft_table(simulate(geared, "direct")), simulate(plain, "direct").peak_torques
    for row, torque in zip(table.rows, exact, strict=True):
        assert [float(row[3]), float(row[4])] == pytest.approx([0.25 * torque, torque], rel=1e-3)


@pytest.mark.parametrize("changes", DRIVES.values(), ids=list(DRIVES))
def test_a_drive_is_a_chain_of_two_masses(changes):
    """To the kernel it is the same: all that it is given of both agrees to rounding."""
    drive = CRANE.replace(**changes)
    ours, theirs = kernel_input(drive), kernel_input(chain_of(drive))
    shafts = (theirs.shafts[..., :-1], ours.shafts[..., :-1])  # but for the place of the gear: none
    for other, one in ((theirs.machines, ours.machines), (theirs.masses, ours.masses), shafts):
        np.testing.assert_allclose(other, one, rtol=1e-14)


def test_no_bit_depends_on_the_time_limit():
    """Undamped, the crane rattles and all its masses fly at times: a span lasts an elastic period at most."""
    starts = [simulate("crane-4-mass", "direct", time_limit=limit) for limit in (None, 0.6, 2.0, 1e3)]
    assert len({start.k_dyn for start in starts}) == 1
    assert len({start.start_time for start in starts}) == 1


def test_the_shaft_torque_the_load_speed_and_the_stage_are_seen():
    chain, seen = Chain.load("crane-4-mass"), []

    class Seeing(PlainController):
        name, sensors = "seeing", Sensor.STAGE | Sensor.SHAFT_TORQUE | Sensor.LOAD_SPEED

        def step(self, measured, state):
            seen.append((measured.time, measured.shaft_torque, measured.load_speed))
            return Command(60.0 - 0.1 * measured.shaft_torque, measured.time + 0.003)

    times, torques, speeds = np.transpose((run := simulate(chain, Seeing(), 0.2)) and seen)
    at = run.at(times)
    assert torques == pytest.approx(at["T"][:, 0], abs=1e-12 * run.peak_torque)
    assert speeds == pytest.approx(at["w"][:, 3], abs=1e-12 * 92.0)


def test_k_dyn_is_that_of_the_worst_shaft_at_the_motor_shaft():
    """Each torque over what its shaft may carry, and over its own mean; K_dyn over that of the chain."""
    most = {"shaft[1].permissible_torque": 400.0, "shaft[3].permissible_torque": 2000.0}
    chain = Chain.load("crane-4-mass", also={"shaft[2].damping_ratio": 0.02, **most})
    run = simulate(chain, "direct")
    own = run.peak_torques * np.array([1.0, 1.0, 20.0])  # shaft 3 lies behind gears of 4 and 5
    assert run.utilisation[[0, 2]] == pytest.approx(own[[0, 2]] / [400.0, 2000.0], rel=1e-13)
    assert np.isnan(run.utilisation[1])
    assert run.k_dyn == pytest.approx(max(run.peak_torques) / chain.mean_torque, rel=1e-14)
    assert run.summary()["utilisation"][1] is None
    masses = chain.at_motor_shaft()
    needed = masses.J * (62.0 - masses.Mc.sum()) / masses.J.sum() + masses.Mc
    assert run.shaft_factors * [sum(needed[k:]) for k in (1, 2, 3)] == pytest.approx(run.peak_torques)
    of_crane = simulate(chain, "direct", base=CRANE)
    assert of_crane.k_dyn == pytest.approx(max(run.peak_torques) / CRANE.mean_torque, rel=1e-14)


# ---- what must be kept --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("law", "damping"), [("no-pull", 0.0), ("no-pull", 0.4), ("dead-zone", 0.4), ("modelica", 0.4)]
)
def test_momentum_and_energy_without_torque(damping, law):
    """Five masses thrown against each other, whose shafts only ever take energy."""
    thrown = zip((0.3, 0.1, 0.5, 0.05, 0.8), (3.0, -1.0, 0.5, -2.0, 1.0), strict=True)
    shaft = Shaft(150.0, gap=0.03, damping=damping, contact_law=law)
    chain = Chain([Mass(J, initial_speed=w) for J, w in thrown], [shaft] * 4)
    run, at = simulate(chain, None, 3.0), chain.at_motor_shaft()
    moment = run.w @ at.J
    assert moment == pytest.approx(moment[0], abs=1e-12 * float(at.J @ np.abs(run.w[0])))
    assert len(run.events) > 40
    z = np.maximum(np.abs(run.twist) - 0.5 * at.gap, 0.0)
    total = 0.5 * run.w**2 @ at.J + 0.5 * z**2 @ at.c
    lost = total[0] - total[-1]
    assert lost == pytest.approx(run.energy.shafts, abs=1e-11 * total[0])
    if damping == 0.0:
        assert total == pytest.approx(total[0], rel=1e-11)
    else:
        assert lost > 0.1 * total[0]


# ---- refusals -----------------------------------------------------------------------------------------


def two(**shaft) -> Chain:
    return Chain([Mass(1.0), Mass(1.0)], [Shaft(10.0, **shaft)], Motor(5.0), target_speed=10.0)


@pytest.mark.parametrize(
    ("chain", "arguments", "said"),
    [
        (
            Chain([Mass(1), Mass(1)], [Shaft(gap=0.1, restitution=0.5, efficiency=0.9)]),
            {"controller": None, "until": 1.0},
            r"\[shaft\] 1, efficiency = 0.9: the loss of a gear goes with the torque of a spring",
        ),
        (Chain([Mass(1), Mass(1)], [Shaft(1)]), {"controller": None}, "until is missing"),
        (two(), {"controller": "direct", "until": -1.0}, "until = -1.0"),
        (two(), {"controller": "direct", "excitation": {"mas 1": None}}, "mass 1"),
        ([two(), two()], {"controller": "direct", "excitation": {0: None}}, "the masses of one chain"),
        (CRANE, {"controller": "direct", "excitation": {0: None}}, "the masses of one chain"),
        (
            Chain([Mass(1, initial_speed=1), Mass(1), Mass(1)], [Shaft("inf"), Shaft(1)]),
            {"controller": None, "until": 1.0},
            "start with one speed",
        ),
    ],
)
def test_bad_input_is_refused_in_a_sentence(chain, arguments, said):
    with pytest.raises(InputError, match=said):
        simulate(chain, **arguments)


def test_a_load_that_cannot_be_moved_needs_an_end():
    chain = Chain([Mass(1.0), Mass(1.0, torque=9.0)], [Shaft(10.0)], Motor(5.0), target_speed=10.0)
    with pytest.raises(InputError, match="not above the load torques"):
        simulate(chain, "direct", fitted_to=CRANE)
    run = simulate(chain, Pieces(pieces=((0.0, 5.0),)), fitted_to=CRANE, time_limit=1.0)
    assert run.status.name == "NOT_REACHED"
