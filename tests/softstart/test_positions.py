"""Where a start begins: words for positions, an unknown one, and what a wider gap does to it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from tests.softstart.kernel.pieces import Pieces
from tests.softstart.kernel.test_brake import HOIST
from tests.twin import chain_of

from softstart import Drive, InputError, TorqueProfile, compare, fatigue, formulas, machine_table, simulate
from softstart.chain import Chain, Mass, Motor, Shaft, reduce_chain
from softstart.controller import make_controller
from softstart.drive import UNKNOWN_POSITIONS
from softstart.optimal.result import largest_heat
from softstart.views.starts import figure_rows

CRANE = Drive.load("crane-4amtkf")


def test_each_word_is_an_angle_of_this_gap() -> None:
    for gap in (0.0, 0.5, 2.0):
        at = {
            one: CRANE.replace(gap=gap, start_position=one).theta0 for one in (*UNKNOWN_POSITIONS, "hanging")
        }
        assert at["driving-flank"] == gap / 2
        assert at["mid-gap"] == 0.0
        assert at["opposite-flank"] == -gap / 2
        assert at["hanging"] == gap / 2 + 7.16 / 368.465
    lowering = CRANE.replace(load_torque=-7.16, start_position="hanging")
    assert lowering.theta0 == -(0.25 + 7.16 / 368.465)  # its weight rests on the other flank


def test_defaults() -> None:
    plain = Drive(**{k: v for k, v in HOIST.given().items() if k != "start_position"})
    assert plain.start_position == "mid-gap"
    assert plain.replace(brake="motor").start_position == "hanging"
    held = plain.replace(load_kind="reactive")  # by friction, wherever it came to rest
    assert held.start_position == held.replace(brake="motor").start_position == "unknown"
    for fields, where in (({"gap": [0.0, 0.1]}, "unknown"), ({"initial_motor_speed": [0.0, 1.0]}, "mid-gap")):
        assert {one.start_position for one in machine_table(held, **fields).elements()} == {where}
    for no_doubt in ({"gap": 0.0}, {"initial_load_speed": -1.0}, {"initial_motor_speed": 1.0}):
        assert held.replace(**no_doubt).start_position == "mid-gap"
    assert held.replace(initial_speed="reversal").start_position == "opposite-flank"
    assert held.replace(start_position="mid-gap").start_position == "mid-gap"
    assert reduce_chain(chain_of(held)).to_drive().start_position == "unknown"
    assert "start_position" not in held.given()
    assert CRANE.start_position == CRANE.replace(load_kind="reactive").start_position == "mid-gap"
    assert "start_position" in CRANE.given()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"start_position": "hangin"}, 'did you mean "hanging"?'),
        ({"start_position": "hanging", "load_kind": "reactive"}, "only an active load hangs"),
        ({"release": "soon"}, '"torque" or a quantity such as "0.1 s"'),
    ],
)
def test_bad_input_is_told(given: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=re.escape(said)):
        CRANE.replace(**given)


def test_a_wider_gap_changes_nothing_for_what_hangs_and_stays_in_contact() -> None:
    """For strategies that never open the gap."""
    rows = compare(HOIST, ["direct", "s-curve", "shaped", "ramp"]).rows
    closed = [row for row in rows if row.run.contacts == 1 and row.run.stages[-1].side == 1]
    assert len(closed) >= 2
    for row in closed:
        assert row.k_dyn_worn_gap == pytest.approx(row.run.k_dyn, rel=1e-10)


def test_an_angle_keeps_its_place_in_a_wider_gap() -> None:
    inside, beyond = CRANE.replace(start_position=-0.1), CRANE.replace(start_position=-0.27)
    assert inside.with_gap(1.0).theta0 == pytest.approx(-0.2)
    assert beyond.with_gap(1.0).theta0 == pytest.approx(-0.52)
    assert inside.replace(gap=1.0).theta0 == -0.1
    assert inside.with_gap(1.0, start_position=0.3).theta0 == 0.3


@pytest.mark.parametrize("name", ["reduced-first-stage", "acceleration-delay"])
def test_unknown_is_the_worst_of_three(name: str) -> None:
    """Figure by figure the maximum of three single starts of a controller that is not told where."""
    rng = np.random.default_rng(14)
    for _ in range(6):
        drive = CRANE.replace(
            gap=rng.uniform(0.02, 2.0), load_inertia=0.175 * rng.uniform(0.2, 4),
            load_kind=str(rng.choice(["active", "reactive"])), load_torque=rng.uniform(0.0, 40.0),
            damping=rng.choice([0.0, 0.5]), torque_lag=rng.choice([0.0, 0.004]), start_position="unknown",
        )  # fmt: skip
        run = simulate(drive, name)
        told = drive.replace(start_position="mid-gap")
        three = {
            one: simulate(drive.replace(start_position=one), name, fitted_to=told)
            for one in UNKNOWN_POSITIONS
        }
        for figure in ("k_dyn", "start_time", "settled_time", "impact_speed"):
            worst = max(getattr(one, figure) for one in three.values())
            assert np.array_equal(getattr(run, figure), worst, equal_nan=True), figure
        assert run.k_dyn == three[run.position].k_dyn
        assert run.summary()["positions"]["worst"] == run.position


def test_every_figure_of_an_unknown_position_is_the_largest() -> None:
    """By hand: the flanks meet with sqrt(2 a gap) from the far flank, and K_dyn of that contact is (18).

    The torque peak is largest from the far flank, but the start from mid-gap takes longest: the excess of a
    demand that rises for good, 20 N m + 300 N m/s beyond 64 N m, belongs to that.
    """
    drive = CRANE.replace(start_position="unknown")
    direct, figures = simulate(drive, "direct"), simulate([drive], "direct")
    v = math.sqrt(2.0 * (62.0 / 0.035 + 7.16 / 0.175) * 0.5)
    reduced, mean = 0.035 * 0.175 / 0.21, formulas.mean_shaft_torque(62.0, 0.035, 0.175, 7.16)
    first = 1.0 + math.sqrt(1.0 + 368.465 * reduced * v**2 / mean**2)
    rising = Pieces(pieces=((0.0, 20.0, 300.0),), end=10.0)
    run, clipped = simulate(drive, rising), simulate([drive], rising)
    ends = {name: one.end_time for name, one in run.positions.items()}
    assert run.position == "opposite-flank"
    assert max(ends, key=lambda name: ends[name]) == "mid-gap"
    excess, over = 20.0 + 300.0 * ends["mid-gap"] - 64.0, ends["mid-gap"] - 44.0 / 300.0
    for single, many, exact in (
        (direct.impact_speed, figures.impact_speed, v),
        (direct.k_dyn_first_contact, figures.k_dyn_first_contact, first),
        (run.clipped.excess, clipped.torque_excess, excess),
        (run.clipped.time, clipped.torque_excess_time, over),
        (run.start_time, clipped.start_time, ends["mid-gap"] - drive.elastic_period),
    ):
        assert [single, many.item()] == pytest.approx([exact, exact], rel=1e-9)
    damped = simulate(drive.replace(damping=1.0), "direct", 2.0)
    each = [one.settling_time() for one in damped.positions.values()]
    assert damped.settling_time() == max(each) > min(each)


# figures of an unknown position by hand -----------------------------------------------------------------


def chain(rng: np.random.Generator, rigid: bool) -> Chain:
    """Four masses with a gear and three gaps, one of them rigid if so; friction holds the load anywhere."""
    masses = [Mass(one) for one in rng.uniform(0.01, 0.3, 3)]
    load = Mass(1.5, torque=rng.uniform(0.0, 30.0), kind="reactive")
    gap = {"gap": rng.uniform(0.05, 0.5), "permissible_torque": 100.0}
    middle = {"stiffness": "inf", "restitution": 0.4} if rigid else {"stiffness": 900.0, "damping": 0.4}
    shafts = [
        Shaft(400.0, damping=0.3, **gap), Shaft(**middle, **gap), Shaft(2e3, damping=2.0, ratio=3, **gap)
    ]  # fmt: skip
    return Chain([*masses, load], shafts, Motor(60.0), target_speed=40.0, position="unknown")


def machines(seed: int) -> Iterator[tuple[Drive | Chain, list[Drive | Chain]]]:
    """Machines of unknown position, each with what it is at the three positions."""
    rng = np.random.default_rng(seed)
    drive = CRANE.replace(
        gap=rng.uniform(0.02, 2.0), load_torque=rng.uniform(0.0, 30.0), load_kind="reactive", damping=0.5,
        start_position="unknown",
    )  # fmt: skip
    yield drive, [drive.replace(start_position=one) for one in UNKNOWN_POSITIONS]
    for rigid in (False, True):
        several = chain(rng, rigid)
        yield several, [replace(several, position=one) for one in UNKNOWN_POSITIONS]


LARGEST = ("k_dyn", "k_dyn_first_contact", "impact_speed", "start_time", "settled_time", "used_torque")
OF_SHAFTS = ("k_dyns", "peak_torques", "peak_impulses", "utilisation", "shaft_factors")
OF_ONE = (
    "first_contact", "torque_at_contact", "stage_durations", "contacts", "events", "stages", "energy",
    "end_time",
)  # fmt: skip
FITTED = CRANE.replace(start_position="mid-gap")


@pytest.mark.parametrize("seed", range(3))
def test_each_figure_of_an_unknown_position_has_its_rule(seed: int) -> None:
    """Largest, by itself; or of the start with the largest torque of all shafts; never of another one."""
    for machine, three in machines(seed):
        run = simulate(machine, "reduced-two-stage", fitted_to=FITTED)
        each = [simulate(one, "reduced-two-stage", fitted_to=FITTED) for one in three]
        hardest = max(each, key=lambda one: one.peak_torque)
        for name in LARGEST:
            known = [getattr(one, name) for one in each]
            worst = np.fmax.reduce(known) if name in ("k_dyn_first_contact", "impact_speed") else max(known)
            np.testing.assert_equal(getattr(run, name), worst, err_msg=name)
        for name in OF_SHAFTS:
            np.testing.assert_equal(getattr(run, name), np.max([getattr(one, name) for one in each], axis=0))
        for k in range(len(machine.shaft_names)):
            of_shaft = max(each, key=lambda one: one.peak_torques[k])
            assert run.peak_times[k] == of_shaft.peak_times[k]
            at = abs(np.atleast_1d(of_shaft.at(run.peak_times[k])["T"])[k])
            assert at == pytest.approx(run.peak_torques[k], rel=1e-9)
            struck = [one.impulse for start in each for one in start.events if one.place == k]
            assert run.peak_impulses[k] == max(map(abs, struck), default=0.0)
        assert run.peak_time == hardest.peak_time
        assert run.settling_time() == pytest.approx(
            np.maximum.reduce([one.settling_time() for one in each]), nan_ok=True
        )
        assert run.clipped == tuple(np.max([one.clipped for one in each], axis=0))
        for name in OF_ONE:
            np.testing.assert_equal(getattr(run, name), getattr(hardest, name), err_msg=name)
            np.testing.assert_equal(getattr(run.shown, name), getattr(hardest, name), err_msg=name)
        assert run.t[-1] == run.end_time
        batch = simulate([machine, machine], "reduced-two-stage", fitted_to=FITTED).isel(start=0)
        for name in (
            "k_dyn",
            "k_dyn_first_contact",
            "peak_torque",
            "peak_time",
            "impact_speed",
            "start_time",
        ):
            np.testing.assert_equal(float(batch[name]), getattr(run, name), err_msg=name)
        for name in ("first_contact", "torque_at_contact", "contacts", "end_time"):
            np.testing.assert_equal(float(batch[name]), getattr(hardest, name), err_msg=name)
        stage_2_end = hardest.trajectory.notes["stage_2_end"]
        np.testing.assert_equal(float(batch["stage_2_end"]), float(stage_2_end), err_msg="of the same start")


def test_what_a_person_reads_says_of_which_start_it_is() -> None:
    """The figures that one start has alone name it; the line of the start time is that of the curves."""
    drive = CRANE.replace(start_position="unknown", load_kind="reactive", damping=0.5)
    run = simulate(drive, "reduced-two-stage")
    assert run.shown.start_time < run.start_time, "hardest from the driving flank, latest from the other one"
    rows = dict(figure_rows(run))
    for name in (
        "first contact",
        "motor torque at contact",
        "stage 1, stage 2",
        "contacts",
        "end of the run",
    ):
        assert rows[name].endswith(f" from {run.position}"), name
    for name in ("K_dyn", "start time", "settled time", "speed of impact"):
        assert "from" not in rows[name]
    lines = [
        line.get_xdata()[0] for axes in run.plot().axes for line in axes.lines if line.get_linestyle() == ":"
    ]
    assert run.shown.start_time in lines
    assert not {one.start_time for one in run.each if one is not run.shown} & set(lines)
    (life,) = fatigue(run).rows
    assert (life.start.k_dyn, life.summary()["start_time"]) == (run.k_dyn, run.start_time)
    assert life.run in run.each


def test_heat_of_a_start_that_ends_before_the_others_is_whole() -> None:
    """Constant torque: the heat is (u/Ms)^2 times the latest start time, whichever torque is largest."""
    drive = CRANE.replace(start_position="unknown", load_kind="reactive", target_speed=20.0, gap=2.0)
    player = make_controller("profile", {"profile": TorqueProfile([0.0, 9.0], [31.0, 31.0])})
    run = simulate(drive, player)
    assert min(one.end_time for one in run.each) < run.start_time, "else nothing is shown"
    assert largest_heat([run], run.start_time) == pytest.approx(0.25 * run.start_time, rel=1e-12)


def test_a_reversal_is_one_word() -> None:
    """From minus the target speed, on the flank that is then in use, through the whole gap to plus."""
    drive = CRANE.replace(initial_speed="reversal", start_position="opposite-flank")
    target = CRANE.target_speed
    assert drive.initial_load_speed == drive.initial_motor_speed == -target
    plain = Drive(**{k: v for k, v in CRANE.given().items() if k != "start_position"})
    assert plain.replace(initial_speed="reversal").start_position == "opposite-flank"
    run = simulate(drive, "direct")
    assert run.at(0.0)["w1"] == run.at(0.0)["w2"] == -target
    assert run.first_contact == pytest.approx(math.sqrt(2 * 0.5 / (62 / 0.035 + 7.16 / 0.175)), rel=1e-12)
    assert Drive.from_toml(drive.to_toml()) == drive


def test_one_speed_for_both_and_its_exceptions() -> None:
    turning = CRANE.replace(initial_speed="-100 rpm")
    assert turning.initial_load_speed == turning.initial_motor_speed == pytest.approx(-100 * math.pi / 30)
    assert turning.replace(initial_motor_speed=0.0).initial_load_speed == turning.initial_load_speed
    with pytest.raises(InputError, match="the load must start below"):
        CRANE.replace(initial_speed=1e4)
    with pytest.raises(InputError, match="a motor that is held stands still"):
        CRANE.replace(initial_speed="reversal", brake="motor")
