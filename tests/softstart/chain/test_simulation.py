"""The exact start of a chain: two masses are a drive, and what must be kept is kept."""

from __future__ import annotations

import numpy as np
import pytest
from tests.softstart.kernel.pieces import Pieces
from tests.twin import chain_of

from softstart import Command, Drive, InputError, PlainController, SimulationError, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.chain.periodic_torque import PeriodicTorque
from softstart.controller import Sensor
from softstart.start.rows import rows_of

CRANE = Drive.load("crane-4amtkf")
DRIVES = {
    "undamped": {},
    "dead-zone": {"damping": 0.3, "contact_law": "dead-zone"},
    "modelica, reactive": {"damping": 0.5, "contact_law": "modelica", "load_kind": "reactive"},
    "lag and rate": {"torque_lag": 0.002, "torque_rate": 5000.0},
    "dead time and noise": {"computing_delay": 0.0017, "torque_noise": 0.5, "encoder_lines": 256},
    "from overlap": {"start_position": 0.27, "initial_load_speed": 5.0, "load_kind": "reactive"},
}


@pytest.mark.parametrize("changes", DRIVES.values(), ids=list(DRIVES))
def test_a_drive_is_a_chain_of_two_masses(changes):
    """To the kernel it is the same: all that it is given of both agrees to rounding."""
    drive = CRANE.replace(**changes)
    ours, theirs = rows_of(drive), rows_of(chain_of(drive))
    shafts = (theirs.shafts[..., :-1], ours.shafts[..., :-1])  # but for the place of the gear: none
    for other, one in ((theirs.machines, ours.machines), (theirs.masses, ours.masses), shafts):
        np.testing.assert_allclose(other, one, rtol=1e-14)


def test_from_the_driving_flank_there_is_one_contact_however_often_it_is_grazed():
    """The torque comes back to zero once a period, and rounding alone said whether the flanks parted."""
    drive = CRANE.replace(start_position="driving-flank")
    runs = simulate(drive, "direct"), simulate(chain_of(drive), "direct", fitted_to=drive)
    assert [run.contacts for run in runs] == [1, 1]


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


def test_gears_change_nothing_but_the_shaft_on_which_things_are_said():
    geared = Chain.load("crane-4-mass")
    plain = geared.brought_to("motor")
    a, b = (simulate(chain, "ramp", fitted_to=CRANE) for chain in (geared, plain))
    assert a.k_dyn == pytest.approx(b.k_dyn, rel=1e-12)
    hum = PeriodicTorque(0.0, [1.0], [30.0], [0.0], speed=50.0)
    hummed = simulate(geared, "ramp", fitted_to=CRANE, excitation={"crane": hum})
    ratio = geared.speed_ratios()[3]
    slow = PeriodicTorque(0.0, [1.0], [30.0 * ratio], [0.0], speed=50.0)
    same = simulate(plain, "ramp", fitted_to=CRANE, excitation={"crane": slow})
    assert hummed.peak_torque == pytest.approx(same.peak_torque, rel=1e-12)
    assert hummed.peak_torque != pytest.approx(a.peak_torque, rel=1e-6)


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
    assert simulate(chain, "direct", base=CRANE).k_dyn == pytest.approx(
        max(run.peak_torques) / CRANE.mean_torque, rel=1e-14
    )


@pytest.mark.parametrize("zeta", [0.0, 0.03])
def test_two_masses_on_a_shaft_with_a_damping_ratio_swing_with_it(zeta):
    """A spring without a gap pulls too: after a damped period exp(-2 pi zeta/sqrt(1 - zeta^2)) is left."""
    c, J1, J2 = 900.0, 0.4, 1.6
    shaft = Shaft(c, damping_ratio=zeta, start_position=0.01)
    omega = np.sqrt(c * (1.0 / J1 + 1.0 / J2))
    period = 2.0 * np.pi / (omega * np.sqrt(1.0 - zeta**2))
    run = simulate(Chain([Mass(J1), Mass(J2)], [shaft]), None, 2.0 * period)
    swings = run.at([0.0, period, 2.0 * period])["twist"][:, 0]
    decrement = np.exp(-2.0 * np.pi * zeta / np.sqrt(1.0 - zeta**2))
    assert swings == pytest.approx(0.01 * decrement ** np.arange(3.0), rel=1e-12)


# ---- what must be kept --------------------------------------------------------------------------------


def free_chain(gap: float = 0.03, damping: float = 0.0, law: str = "no-pull") -> Chain:
    """Five masses thrown against each other; nothing acts from outside."""
    speeds = (3.0, -1.0, 0.5, -2.0, 1.0)
    inertias = (0.3, 0.1, 0.5, 0.05, 0.8)
    shaft = Shaft(150.0, gap=gap, damping=damping, contact_law=law)
    return Chain([Mass(J, initial_speed=w) for J, w in zip(inertias, speeds, strict=True)], [shaft] * 4)


@pytest.mark.parametrize(
    ("law", "damping"), [("no-pull", 0.0), ("no-pull", 0.4), ("dead-zone", 0.4), ("modelica", 0.4)]
)
def test_momentum_and_energy_without_torque(damping, law):
    chain = free_chain(damping=damping, law=law)
    run = simulate(chain, None, 3.0)
    J = chain.at_motor_shaft().J
    moment = run.w @ J
    assert moment == pytest.approx(moment[0], abs=1e-12 * float(J @ np.abs(run.w[0])))
    start = 0.5 * float(J @ run.w[0] ** 2)
    assert len(run.events) > 40
    assert run.energy.kinetic + run.energy.elastic + run.energy.shafts == pytest.approx(
        0.0, abs=1e-11 * start
    )
    if damping == 0.0:
        c, half = chain.at_motor_shaft().c, 0.5 * chain.at_motor_shaft().gap
        z = np.maximum(np.abs(run.twist) - half, 0.0)
        total = 0.5 * run.w**2 @ J + 0.5 * z**2 @ c
        assert total == pytest.approx(start, rel=1e-11)
    else:
        assert run.energy.shafts > 0.1 * start


def test_forced_vibration_is_that_of_the_formula():
    """A damped oscillator driven by a harmonic, against a wall that its inertia is: exact steady state."""
    J, c, d, omega = 0.2, 80.0, 1.5, 17.0
    chain = Chain([Mass(J), Mass(1e14)], [Shaft(c, damping=d)])
    hum = PeriodicTorque(0.0, [1.0], [3.0], [2.0], speed=omega)
    run = simulate(chain, None, 30.0, excitation={"mass 1": hum})
    times = np.linspace(25.0, 30.0, 40)
    answer = (3.0 - 2.0j) / (c - J * omega**2 + 1j * omega * d)
    assert run.at(times)["twist"][:, 0] == pytest.approx(
        (answer * np.exp(1j * omega * times)).real, abs=1e-11 * abs(answer)
    )
    assert abs(run.energy.residual) < 1e-12 * (abs(run.energy.exciting) + run.energy.shafts)


def test_peaks_are_not_below_a_fine_grid_and_are_taken():
    run = simulate("crane-4-mass", "direct", 0.2, fitted_to=CRANE)
    fine = np.abs(run.at(np.linspace(0.0, 0.2, 20_001))["T"]).max(axis=0)
    assert np.all(fine <= run.peak_torques * (1 + 1e-13))
    assert run.peak_torques == pytest.approx(fine, rel=1e-4)  # (1630 rad/s * 5e-6 s)^2/2 = 3e-5
    for k, when in enumerate(run.peak_times):
        assert abs(run.at(when)["T"][k]) == pytest.approx(run.peak_torques[k], rel=1e-12)


# ---- loads that stick ---------------------------------------------------------------------------------


def test_a_stuck_mass_in_the_middle_holds_the_chain_behind_it():
    """Until the torque of the first shaft is above its friction; then exactly at that instant it moves."""
    c, hold, rate = 100.0, 5.0, 20.0
    chain = Chain(
        [Mass(1e-3), Mass(1.0, torque=hold, kind="reactive"), Mass(2.0)],
        [Shaft(c, damping=2.0), Shaft(c)],
        Motor(50.0, torque_rate=rate),
        target_speed=1.0,
    )
    run = simulate(chain, Pieces(pieces=((0.0, 50.0),)), fitted_to=CRANE)
    starts = next(e for e in run.events if e.kind == "load starts")
    before = run.at(np.linspace(0.0, starts.time * (1 - 1e-9), 20))
    assert np.all(before["w"][:, 1:] == 0.0)
    assert np.all(before["torques"][:, 1] == 0.0)
    assert run.at(np.nextafter(starts.time, 0.0))["torques"][0] == pytest.approx(hold, rel=1e-12)
    assert starts.place == 1
    assert run.status.name == "REACHED"


def test_friction_stops_a_coasting_chain_and_holds_it():
    masses = [Mass(1.0, torque=2.0, kind="reactive", initial_speed=3.0), Mass(0.5, initial_speed=3.0)]
    run = simulate(Chain(masses, [Shaft(400.0, damping=3.0)]), None, 6.0)
    assert run.w[-1] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert run.w[-1][0] == 0.0
    assert sum(e.kind == "load stops" for e in run.events) == 1 + sum(
        e.kind == "load starts" for e in run.events
    )
    lost = 0.5 * 1.5 * 9.0
    assert run.energy.load + run.energy.shafts == pytest.approx(lost, rel=1e-9)


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
        (
            Chain([Mass(1), Mass(1)], [Shaft(1)]),
            {"controller": "direct", "until": 1.0},
            r"\[motor\] is missing",
        ),
        (Chain([Mass(1), Mass(1)], [Shaft(1)]), {"controller": None}, "until is missing"),
        (two(), {"controller": "direct", "until": -1.0}, "until = -1.0"),
        (two(), {"controller": "direct", "excitation": {"mas 1": None}}, "mass 1"),
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


def test_a_controller_that_fails_is_named():
    class Broken(PlainController):
        name = "broken"

        def step(self, measured, state):
            return 1 / 0

    with pytest.raises(SimulationError, match="Broken failed at t = 0 s"):
        simulate("crane-4-mass", Broken())
