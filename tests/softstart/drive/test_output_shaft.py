"""The output of a gear: values there and back, limits there, and a machine of which either side is given."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart import Chain, DataSheet, Drive, InputError, compare, machine_table, optimize, simulate, tune
from softstart.chain import Mass, Motor, Shaft
from softstart.controller.recipe import Recipe
from softstart.drive import PARAMETERS
from softstart.drive.model import BY_PATH
from softstart.drive.plausibility import plausibility_warnings
from softstart.page.links import inputs_of, link_of
from softstart.page.project import project_of
from softstart.page.session import Session
from softstart.project import Project
from softstart.reporting.document import data_of
from softstart.start.recommendation import Row
from softstart.sweeping.grid import Subject
from softstart.tuning.problem import gaps_of, inertias_of, tuning_scenarios
from softstart.views.numbers import seen_at, units_of
from softstart.views.tuning import conclusions

CRANE = Drive.load("crane-4amtkf")
# at the output over at the motor shaft, by hand: exponents of the ratio and of the efficiency
BY_HAND = {
    "shaft.stiffness": (2, 1), "shaft.damping": (2, 1), "shaft.gap": (-1, 0), "load.inertia": (2, 1),
    "load.torque": (1, 1), "load.friction": (1, 1), "load.viscous_friction": (2, 1),
    "start.target_speed": (-1, 0), "start.position": (-1, 0), "start.initial_speed": (-1, 0),
    "start.initial_load_speed": (-1, 0), "limits.shaft_torque": (1, 1), "limits.fatigue.torque": (1, 1),
    "shaft.soft_stiffness": (2, 1),
}  # fmt: skip
AT_MOTOR = {  # of a drive, in SI
    "shaft.stiffness": 400.0, "shaft.damping": 0.2, "shaft.gap": 0.3, "load.inertia": 0.2, "load.torque": 9.0,
    "load.friction": 2.0, "load.viscous_friction": 0.01, "start.target_speed": 90.0, "start.position": 0.1,
    "start.initial_speed": 4.0, "start.initial_load_speed": 3.0, "limits.shaft_torque": 130.0,
    "limits.fatigue.torque": 80.0, "shaft.soft_stiffness": 90.0,
}  # fmt: skip
ratios = st.floats(math.log(0.05), math.log(500.0)).map(lambda x: float(f"{math.exp(x):.4g}"))
efficiencies = st.floats(0.3, 1.0).map(lambda x: float(f"{x:.3g}"))
typed = st.floats(0.5, 2.0)


def geared(ratio: float, efficiency: float) -> Drive:
    """The crane with a gear; of a limit of the life all that it takes."""
    return CRANE.replace(
        gear_ratio=ratio, gear_efficiency=efficiency, fatigue_slope=5, fatigue_torque=70, fatigue_cycles=1e6
    )


def test_the_keys_that_are_at_the_output_are_these() -> None:
    assert {p.path for p in PARAMETERS.values() if p.at_output == "value"} == BY_HAND.keys()
    assert {p.path for p in PARAMETERS.values() if p.at_output == "here"} == {"limits.output_torque"}


@given(ratios, efficiencies, typed, st.sampled_from(sorted(BY_HAND)))
def test_a_value_at_the_output_is_that_at_the_motor_by_hand_and_comes_back(i, eta, share, path) -> None:
    """As text, the drive as a file, and a drive that is given the same at the motor shaft."""
    p, (of_ratio, of_efficiency) = PARAMETERS[BY_PATH[path]], BY_HAND[path]
    there = float(f"{share * AT_MOTOR[path] * i**of_ratio * eta**of_efficiency:.6g}")  # as typed
    moved = geared(i, eta).with_settings([f"{path}={there!r} {p.unit} at output"])
    (value,) = getattr(moved, p.name) if p.many else (getattr(moved, p.name),)
    assert value == pytest.approx(there / i**of_ratio / eta**of_efficiency, rel=1e-14)
    for one in (moved, Drive.from_toml(moved.to_toml())):
        (back,) = one.at_output[p.name] if p.many else (one.at_output[p.name],)
        assert f"{back:.13g}" == f"{there:.13g}"
    assert moved.replace(**{p.name: value}) == moved


@settings(max_examples=50)
@given(ratios, efficiencies, st.floats(0.2, 5.0), st.floats(0.1, 2.0), st.sampled_from([1.0, -1.0]))
def test_a_limit_at_the_output_is_judged_as_the_same_at_the_motor(i, eta, most, share, sense) -> None:
    """M at the output permits M/(i eta) at the motor, M eta/i where the load drives; the stricter counts.

    Value and limit of a sentence are as seen, at either shaft, and their ratio is what the margin says.
    """
    there, factor = 60.0 * i * most, i * eta if sense > 0.0 else i / eta
    drive = geared(i, eta).replace(load_torque=sense * 1e-3, start_position="mid-gap")
    run: Any = SimpleNamespace(
        drive=drive,
        k_dyn=1.0,
        peak_torque=there / factor * share,
        limited_time=1.0,
        limited_name="start time",
        used_torque=0.0,
        controller=None,
    )
    as_limits = (
        {"permissible_output_torque": there}, {"permissible_torque": f"{there!r} N*m at output"},
        {"permissible_torque": there / factor},
        {"permissible_output_torque": there, "permissible_torque": 1e9},
        {"permissible_output_torque": 1e9 * i, "permissible_torque": there / factor},
    )  # fmt: skip
    judged = []
    for limits in as_limits:
        run.drive = seen_at(drive.replace(**limits), "output")
        (margin,) = Row(run, None, worst_case=()).margins(run.drive.limits)
        judged.append((margin.share, margin.kept))
        at_output = margin.name == "output torque"
        assert at_output == (
            "permissible_output_torque" in limits and limits.get("permissible_torque") in (None, 1e9)
        )
        assert margin.limit == pytest.approx(there if at_output else there / factor, rel=1e-14)
        assert margin.value == pytest.approx(run.peak_torque * (factor if at_output else 1.0), rel=1e-14)
        for shaft, brings in (("output", 1.0), ("motor", 1.0 if at_output else 1.0 / factor)):
            name, value, limit, unit = replace(margin, units=units_of(seen_at(run.drive, shaft))).seen
            assert (value, limit) == pytest.approx((there * share * brings, there * brings), rel=1e-13)
            of = "output" if at_output or shaft == "output" else "shaft"
            assert (name, unit) == (f"{of} torque", "N m")
        column = units_of(run.drive).shown(run.peak_torque, "N*m")  # of tables and figures
        assert 1.0 - column / there == pytest.approx(margin.share, abs=1e-12)
    assert {kept for _, kept in judged} == {judged[0][1]}
    assert [one for one, _ in judged] == pytest.approx([1.0 - share] * len(judged), abs=1e-12)


@given(ratios, efficiencies, typed, st.integers(0, 2**16))
def test_what_a_data_sheet_says_behind_the_gear_comes_back_as_typed(i, eta, share, seed) -> None:
    """A rotor; up to six digits, in units of catalogues. By the drive, its file, and the report."""
    moment = float(f"{30.0 * share * i**2:.{1 + seed % 6}g}")
    sheet = {
        "load.machine": "rotor", "motor.rated_power": "15 kW", "motor.rated_speed": "1460 rpm",
        "motor.inertia": 20.0, "motor.starting_torque": "240 N*m", "gear.ratio": i, "gear.efficiency": eta,
        "gear.stiffness": f"{float(f'{800.0 * share * i**2:.6g}')!r} N*m/rad",
        "gear.backlash": f"{float(f'{300.0 * share / i:.4g}')!r} arcmin",
        "load.inertia": moment, "load.friction": float(f"{60.0 * share * i * eta:.6g}"),
        "limits.output_torque": float(f"{900.0 * share * i * eta:.6g}"),
    }  # fmt: skip
    drive = DataSheet.from_settings(sheet).drive
    there = {
        "stiffness": float(sheet["gear.stiffness"].split()[0]),
        "gap": math.radians(float(sheet["gear.backlash"].split()[0]) / 60.0), "load_inertia": moment,
        "load_torque": sheet["load.friction"], "permissible_output_torque": sheet["limits.output_torque"],
    }  # fmt: skip
    for one in (drive, Drive.from_toml(drive.to_toml())):
        assert {name: one.at_output[name] for name in there} == pytest.approx(there, rel=1e-12)
    shown_drive = drive.replace(units="arcmin, rpm", permissible_torque=1e5)
    there["permissible_torque"] = 1e5 * i * eta
    report: Any = SimpleNamespace(project=Project(), drive=shown_drive)
    _, rows, _ = data_of(report)
    shown = {row[0]: row[-1] for row in rows}
    units = {"stiffness": "N m/rad", "load_inertia": "kg m²", "gap": "arcmin"}
    for name, value in (there | {"gap": math.degrees(there["gap"]) * 60.0}).items():
        said = f"{float(f'{value:.6g}'):.6g} {units.get(name, 'N m')}"
        assert shown[PARAMETERS[name].meaning] == said, name


def test_a_torque_that_drives_the_motor_loses_on_its_way_there() -> None:
    """Of the power M w at the output eta M w comes to the motor, which turns i times as fast: eta M/i."""
    drive = geared(40.0, 0.8).replace(load_torque="-160 N*m at output")
    assert (drive.load_torque, drive.at_output["load_torque"]) == (-3.2, -160.0)
    many = machine_table(geared(40.0, 0.8), load_torque=["-160 N*m at output", "160 N*m at output"])
    assert many.fields["load_torque"].tolist() == [-3.2, 5.0]


@given(ratios, efficiencies, st.floats(-20.0, 20.0), st.floats(0.0, 20.0))
def test_friction_beside_a_load_that_drives_the_motor_comes_back_as_typed(i, eta, torque, friction) -> None:
    """Power flows one way: P = (M + F) w at the output is eta P or P/eta at the motor, not some of each.

    By hand for the drive, its file, a change of one part at a time, many at once, and the report.
    """
    there = {"load_torque": float(f"{torque * i:.5g}"), "load_friction": float(f"{friction * i:.5g}")}
    whole = sum(there.values())
    factor = eta / i if whole < 0.0 else 1.0 / (i * eta)
    plain = geared(i, eta).replace(
        load_torque=0.0, maximum_torque=None, starting_torque=300.0, start_position="mid-gap"
    )
    texts = {name: f"{value!r} N*m at output" for name, value in there.items()}
    drive = plain.replace(**texts)
    assert drive.Mc == pytest.approx(whole * factor, rel=1e-11, abs=1e-12)
    shown = {row[0]: row[-1] for row in data_of(SimpleNamespace(project=Project(), drive=drive))[1]}
    for one in (drive, Drive.from_toml(drive.to_toml())):
        for name, value in there.items():
            assert getattr(one, name) == pytest.approx(value * factor, rel=1e-13)
            assert one.at_output[name] == pytest.approx(value, rel=1e-13)
            if value:
                assert float(shown[PARAMETERS[name].meaning].split()[0]) == pytest.approx(value, rel=1e-5)
    for name, text in texts.items():  # beside the other one, which is at the motor by now
        # a torque below 0 there that friction outweighs may have come either way: it counts by its sign
        if name == "load_torque" or whole < 0.0 or torque >= 0.0:
            assert drive.replace(**{name: text}) == drive
    many = machine_table(plain, **{name: [text, "0"] for name, text in texts.items()})
    assert [float(many.fields[name][0]) for name in there] == [getattr(drive, name) for name in there]


def test_an_inclined_belt_that_drives_its_motor_is_written_as_its_sheet_says() -> None:
    """200 N m of lift less 30 N m of friction at a drum behind 20:1: both at the output in the file."""
    sheet = DataSheet.from_settings({
        "load.machine": "rotor", "motor.rated_power": "3 kW", "motor.rated_speed": "1410 rpm",
        "motor.inertia": "0.01 kg*m^2", "gear.ratio": 20, "gear.efficiency": 0.8,
        "gear.stiffness": "35 kN*m/rad",
        "load.inertia": "20 kg*m^2", "load.torque": "-200 N*m", "load.friction": "30 N*m",
    })  # fmt: skip
    text = sheet.drive_toml()
    assert 'friction = "30 N*m at output"' in text
    assert 'torque = "-200 N*m at output"' in text
    for drive in (sheet.drive, Drive.from_toml(text)):
        assert (drive.load_torque, drive.load_friction) == pytest.approx((-8.0, 1.2), rel=1e-12)
        there = drive.at_output
        assert (there["load_torque"], there["load_friction"]) == pytest.approx((-200.0, 30.0), rel=1e-12)
    swept = drive.replace(load_friction=0.0).gear_with(load_friction="30 N*m at output")
    assert swept.to_motor(30.0, "N*m") == pytest.approx(1.2, rel=1e-14)


@pytest.mark.parametrize("eta", [1.0, 0.8])
def test_a_drive_with_its_gear_is_the_chain_that_has_the_gear_in_its_shaft(eta: float) -> None:
    """The kernel brings a chain to the motor shaft by itself, with the losses of its gears: both start alike.

    What the shaft behind the gear carries in the chain, which simulates the loss, is the torque that the
    drive has at the output, and uses as much of the same limit.
    """
    i, there = 38.1, {"gap": "9 arcmin at output", "stiffness": "35 kN*m/rad at output"}
    motor: dict[str, Any] = {"starting_torque": 44.7, "rated_speed": "1410 rpm"}
    drive = Drive(
        motor_inertia=0.0083, load_inertia="161 kg*m^2 at output", load_torque="80 N*m at output", **motor,
        damping="25 N*m*s/rad at output", load_kind="reactive", start_position="driving-flank", gear_ratio=i,
        gear_efficiency=eta, permissible_output_torque="1.6 kN*m", **there,
    )  # fmt: skip
    shaft = Shaft(
        "35 kN*m/rad", gap="9 arcmin", damping=25.0, ratio=i, efficiency=eta, side="after",
        permissible_torque=1600.0,
    )  # fmt: skip
    chain = Chain(
        [Mass(0.0083), Mass(161.0, torque=80.0, kind="reactive")], [shaft], Motor(**motor),
        position="driving-flank",
    )  # fmt: skip
    one, other = (simulate(machine, "direct") for machine in (drive, chain))
    assert one.peak_torque_at_output == pytest.approx(i * other.peak_torque, rel=1e-10)
    if eta == 1.0:  # later the shaft drives the motor back, and only the chain knows that losses turn round
        assert one.start_time == pytest.approx(other.start_time, rel=1e-10)
    assert one.used_torque == pytest.approx(100.0 * one.peak_torque_at_output / 1600.0, rel=1e-12)
    assert one.used_torque == pytest.approx(other.used_torque, rel=1e-10)


@given(st.floats(0.5, 0.98), st.floats(0.01, 0.3), st.sampled_from(["direct", "ramp", "s-curve"]))
def test_a_better_gear_loads_the_output_more_and_starts_sooner(eta, better, controller) -> None:
    """What limits and start times are checked with where the efficiency is uncertain."""
    starts = [
        simulate(
            geared(38.1, one).replace(
                load_inertia="290 kg*m^2 at output", stiffness="500 kN*m/rad at output",
                load_torque="200 N*m at output", gap="30 arcmin at output", start_position="mid-gap",
            ),
            controller,
        )
        for one in (eta, min(eta + better, 1.0))
    ]  # fmt: skip
    assert starts[0].peak_torque_at_output < starts[1].peak_torque_at_output
    assert starts[0].start_time > starts[1].start_time


def test_everything_that_takes_a_gap_takes_it_at_the_output() -> None:
    drive = geared(38.1, 0.95).replace(gap="9 arcmin at output")
    gap = math.radians(9 / 60) * 38.1
    (least, own) = gaps_of(drive, ["4.5 arcmin at output", "1x"])
    assert (least, own) == pytest.approx((gap / 2, gap), rel=1e-14)
    assert inertias_of(drive, "290 kg*m^2 at output") == pytest.approx((290 / 38.1**2 / 0.95,), rel=1e-14)
    (_, low, high) = tuning_scenarios(drive, {"gap": ["4.5 arcmin at output", "18 arcmin at output"]})
    assert (low["gap"].offset, high["gap"].offset) == pytest.approx((gap / 2, 2 * gap), rel=1e-14)
    (_, low, high) = tuning_scenarios(drive, {"gap": "1 arcmin at output"})
    assert high["gap"].offset == pytest.approx(gap / 9, rel=1e-14) == -low["gap"].offset
    both = machine_table(drive, gap=["9 arcmin at output", "18 arcmin at output"])
    assert both.fields["gap"] == pytest.approx([gap, 2 * gap])
    axis = Subject(drive, Recipe("direct")).coordinate("shaft.gap", ["9 arcmin at output", "2x"])
    assert axis.values == pytest.approx([gap, 2 * gap], rel=1e-14)
    assert drive.with_gap("18 arcmin at output").gap == pytest.approx(2 * gap, rel=1e-14)


CHAIN, GEARED = Chain.load("crane-4-mass"), geared(38.0, 1.0)
AXIS = Subject(GEARED, Recipe("direct")).coordinate


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (lambda: CRANE.replace(gap="9 arcmin at output"), 'gap = "9 arcmin at output": without gear.ratio'),
        (lambda: CRANE.replace(permissible_output_torque=2e3), "output_torque = 2000.0: without gear_ratio"),
        (lambda: CRANE.replace(gear_efficiency=0.9), "gear_efficiency = 0.9: without gear_ratio there is no"),
        (lambda: GEARED.replace(torque_lag="2 ms at output"), 'does not take "at output"; leave it out.'),
        (lambda: GEARED.replace(motor_inertia="2 kg*m^2 at output"), "inertia of the motor does not take"),
        (lambda: GEARED.replace(gap="-9 arcmin at output"), "the total angular gap must be 0 or more"),
        (lambda: GEARED.replace(gap="9 kg at output"), "kg is a mass, not an angle"),
        (lambda: geared(0, 1), "gear_ratio = 0: the turns of the motor for one of the output must be above"),
        (lambda: GEARED.replace(permissible_output_torque=200), "load_torque = 7.16 N*m at the motor shaft"),
        (lambda: gaps_of(CRANE, ["9 arcmin at output"]), 'gaps = "9 arcmin at output": without gear.ratio'),
        (lambda: gaps_of(GEARED, ["4 arcmin", "9 arcmin at output"]), "behind some of the values only"),
        (lambda: gaps_of(CHAIN, ["9 arcmin at output"]), "the gears of a chain are in its shafts"),
        (lambda: machine_table(CHAIN, gap=["9 arcmin at output"]), "the gears of a chain are in its shafts"),
        (lambda: Shaft(100.0, gap="9 arcmin at output"), 'write side = "before" or "after"'),
        (lambda: Mass("3 kg*m^2 at output"), 'inertia on its own shaft does not take "at output"'),
        (lambda: simulate(GEARED, "ramp", parameters={"time": "1 s at output"}), 'does not take "at output"'),
        (lambda: AXIS("motor.inertia", ["1 kg*m^2 at output"]), 'does not take "at output"'),
    ],
)  # fmt: skip
def test_where_there_is_no_output_that_is_said_in_one_sentence(made, says) -> None:
    with pytest.raises(InputError) as told:
        made()
    (sentence,) = told.value.sentences
    assert says in sentence


def test_a_permissible_torque_that_no_start_comes_near_is_doubted() -> None:
    """Over 10 Ms: of a drive that at the motor shaft, of a chain that of any shaft."""
    for most, doubted in ((619.0, False), (621.0, True)):
        shafts = [CHAIN.shafts[0], CHAIN.shafts[1].replace(permissible_torque=1e-9), *CHAIN.shafts[2:]]
        scale = CHAIN.at_motor_shaft().torque_ratio[1]
        shafts[1] = shafts[1].replace(permissible_torque=most / scale)
        chain = Chain(CHAIN.masses, shafts, CHAIN.motor, load_mass=CHAIN.load_mass, target_speed=92)
        for machine in (
            CRANE.replace(permissible_torque=most),
            CRANE.replace(gear_ratio=20, gear_efficiency=0.5, permissible_output_torque=10 * most),
            chain,
        ):
            said = [one for one in plausibility_warnings(machine) if one.startswith("permissible torque of ")]
            assert len(said) == doubted
            assert all("10.02 times the starting torque, where" in one for one in said)


def test_a_tuning_that_leaves_the_drive_out_is_doubted() -> None:
    quick: dict[str, Any] = {
        "free": ["torque"],
        "certified": False,
        "generations": 1,
        "restarts": 1,
        "workers": 1,
    }
    drive = geared(38.1, 0.95).replace(gap="9 arcmin at output", load_inertia="200 kg*m^2 at output")
    name = "reduced-first-stage"
    beside = tune(drive, name, ["4.5 arcmin", "9 arcmin"], ["100 kg*m^2 at output"], **quick)
    gap, inertia = beside.plausibility_warnings
    assert gap.startswith("the gap of the drive, 5.715 deg, is outside the tuned range, 0.075 to 0.15 deg:")
    assert inertia.startswith("the load inertia of the drive, ")
    assert [one[:16] for one in conclusions(beside)][:2] == ["Warning: the gap", "Warning: the loa"]
    assert beside.summary()["plausibility_warnings"] == beside.plausibility_warnings
    within = tune(drive, name, ["4.5 arcmin at output", "9 arcmin at output"], ["1x"], **quick)
    assert within.plausibility_warnings == []


@pytest.mark.slow
def test_optimum_and_comparison_keep_a_limit_at_the_output() -> None:
    """The quickest start has the torque that the output permits, over the ratio, within 0.1 %."""
    drive = Drive.load("hoist-15kw").replace(gear_ratio=45)
    limited = drive.replace(permissible_output_torque=45 * 175.0)
    best = optimize(limited, limits=True)
    assert best.run.peak_torque == pytest.approx(175.0, rel=1e-3)
    assert best.run.peak_torque <= 175.0
    assert str(best.kept.margins[0]).startswith("output torque 787")
    both = [
        compare(one, ["direct", "s-curve"]).recommendation
        for one in (limited, drive.replace(permissible_torque=175.0))
    ]
    assert both[0].text.replace("output torque", "shaft torque").split(".")[0] == both[1].text.split(".")[0]


AT_OUTPUT = """
units = "rpm, deg"
[motor]
inertia = 0.035
starting_torque = "62 N*m"
rated_speed = "880 rpm"
minimum_torque = "-60 N*m"
[gear]
ratio = 38.1
efficiency = 0.95
[shaft]
stiffness = "35 kN*m/rad at output"
damping = 0.02
gap = "9 arcmin at output"
[load]
inertia = "20 kg*m^2 at output"
torque = "80 N*m at output"
friction = 0.5
[start]
target_speed = "20 rpm at output"
[limits]
shaft_torque = "900 N*m at output"
output_torque = "950 N*m"
starts_per_hour = 60
life = "20000 h"
[limits.fatigue]
slope = 6.6
torque = "700 N*m at output"
cycles = 5e6
[[duty]]
do = "start"
[[duty]]
do = "hold"
time = 3
[[duty]]
do = "stop"
by = "torque"
[[duty]]
do = "load"
torque = "-40 N*m at output"
"""
NEW_GEARS = [{"ratio": "20.0"}, {"efficiency": "0.8"}, {"ratio": "45.5", "efficiency": "0.7"}]


def with_gear(text: str, new: dict[str, str]) -> str:
    old = {"ratio": "38.1", "efficiency": "0.95"}
    for key, value in new.items():
        text = text.replace(f"{key} = {old[key]}", f"{key} = {value}")
    return text


@pytest.mark.parametrize("new", NEW_GEARS)
@pytest.mark.parametrize("load", ["80 N*m", "-80 N*m"])
def test_another_gear_reads_what_the_file_has_at_the_output(new: dict[str, str], load: str) -> None:
    text = AT_OUTPUT.replace("80 N*m", load)
    drive, written = Drive.from_toml(text), Drive.from_toml(with_gear(text, new))
    settings_of_new = [f"gear.{key}={value}" for key, value in new.items()]
    by_name = {f"gear_{key}": float(value) for key, value in new.items()}
    assert written != drive
    assert drive.with_settings(settings_of_new) == written
    assert drive.replace(**by_name) == written
    assert pickle.loads(pickle.dumps(drive)).replace(**by_name) == written
    page = Session(drive)
    page.set_all({f"gear.{key}": value for key, value in new.items()})
    assert page.inputs.machine_with_duty == written
    # what is set as well counts as it is set, before, with or after the gear
    changed = written.replace(gap=0.1)
    assert drive.with_settings([*settings_of_new, "shaft.gap=0.1"]) == changed
    assert drive.replace(gap=0.1).with_settings(settings_of_new) == changed
    assert drive.with_settings(settings_of_new).replace(gap=0.1) == changed
    again = drive.with_settings([*settings_of_new, "shaft.gap=4 arcmin at output"])
    assert again == Drive.from_toml(with_gear(text, new).replace("9 arcmin", "4 arcmin"))
    # and there and back
    assert drive.replace(**by_name).replace(gear_ratio=38.1, gear_efficiency=0.95) == drive


def test_a_table_of_gears_is_read_as_its_files() -> None:
    text = AT_OUTPUT.partition("[limits.fatigue]")[0]
    ratios = [20.0, 38.1, 60.0]
    table = machine_table(Drive.from_toml(text), gear_ratio=ratios)
    written = [Drive.from_toml(with_gear(text, {"ratio": repr(ratio)})) for ratio in ratios]
    assert [one.values() for one in table.elements()] == [one.values() for one in written]
    alone = [simulate(one, "ramp").k_dyn for one in written]
    assert simulate(table, "ramp").k_dyn.values.tolist() == pytest.approx(alone, rel=1e-12)
    with pytest.raises(InputError, match="one list cannot follow several gears; write it at the motor shaft"):
        machine_table(Drive.from_toml(AT_OUTPUT.partition("[[duty]]")[0]), gear_ratio=ratios)


def test_without_a_gear_values_stay_until_there_is_one_again() -> None:
    text = AT_OUTPUT.replace('output_torque = "950 N*m"\n', "").replace("efficiency = 0.95\n", "")
    drive = Drive.from_toml(text)
    bare = drive.replace(gear_ratio=None)
    assert (bare.gap, bare.gear) == (drive.gap, None)
    assert bare.replace(gear_ratio=20.0) == Drive.from_toml(text.replace("ratio = 38.1", "ratio = 20.0"))
    with pytest.raises(InputError) as refused:
        drive.with_settings(["gear.ratio=many"])
    assert [one.partition(":")[0] for one in refused.value.sentences] == ['gear.ratio = "many"']


@pytest.mark.parametrize("new", NEW_GEARS)
def test_a_file_that_is_written_has_at_the_output_what_was_given_there(new: dict[str, str]) -> None:
    drive = Drive.from_toml(AT_OUTPUT)
    by_name = {f"gear_{key}": float(value) for key, value in new.items()}
    written = Drive.from_toml(with_gear(AT_OUTPUT, new))
    again = Drive.from_toml(drive.to_toml())
    assert again == drive
    assert again.to_toml() == drive.to_toml()
    assert again.replace(**by_name) == written
    assert 'inertia = "20 kg*m^2 at output"  # inertia of the load\n' in drive.to_toml()
    page = Session(drive)
    saved = Project.from_toml(project_of(page).to_toml())
    linked = Session(Session().inputs.machine)
    linked.restore(inputs_of(link_of(page.inputs), linked.inputs))
    reopened = Session(saved)
    for other in (reopened, linked):
        other.set_all({f"gear.{key}": value for key, value in new.items()})
    assert reopened.inputs.machine_with_duty == written
    assert linked.inputs.machine == written.replace(duty=None)


def test_a_file_without_a_gear_has_its_values_at_the_motor() -> None:
    text = AT_OUTPUT.replace('output_torque = "950 N*m"\n', "").replace("efficiency = 0.95\n", "")
    bare = Drive.from_toml(text).replace(gear_ratio=None)
    assert Drive.from_toml(bare.to_toml()) == bare
    assert "at output" not in bare.to_toml()


@pytest.mark.parametrize(
    ("setting", "old", "new"),
    [
        ("load.torque=-80 N*m at output", 'torque = "80 N', 'torque = "-80 N'),  # it drives the motor now
        ("load.torque=-3", 'torque = "80 N*m at output"', "torque = -3"),
        ("load.friction=3", "friction = 0.5", "friction = 3"),
    ],
)
def test_a_load_that_turns_round_takes_limits_through_the_gear_as_in_the_file(
    setting: str, old: str, new: str
) -> None:
    drive, written = Drive.from_toml(AT_OUTPUT), Drive.from_toml(AT_OUTPUT.replace(old, new))
    assert drive.with_settings([setting]) == written
    name, _, value = setting.partition("=")
    assert drive.replace(**{name.replace(".", "_"): value}) == written
    page = Session(drive)
    page.set(name, value)
    assert page.inputs.machine_with_duty == written


def test_loads_of_both_signs_in_a_table_take_limits_through_the_gear_as_their_files() -> None:
    text = AT_OUTPUT.partition("[limits.fatigue]")[0].replace("friction = 0.5\n", "")
    drive = Drive.from_toml(text)
    torques = [-3.0, -1.0, 2.0]
    written = [drive.with_settings([f"load.torque={torque}"]) for torque in torques]
    table = machine_table(drive, load_torque=torques)
    assert [one.values() for one in table.elements()] == [one.values() for one in written]
    curve = Drive.from_toml(AT_OUTPUT.partition("[[duty]]")[0])
    with pytest.raises(
        InputError, match="one list cannot follow loads that drive the motor and others; write"
    ):
        machine_table(curve, load_torque=torques)
    lowered = machine_table(curve, load_torque=[-3.0, -2.0])
    assert [one.fatigue_torque for one in lowered.elements()] == 2 * [
        curve.replace(load_torque=-3.0).fatigue_torque
    ]


def test_a_step_of_a_duty_that_is_set_beside_the_gear() -> None:
    drive = Drive.from_toml(AT_OUTPUT)
    written = Drive.from_toml(with_gear(AT_OUTPUT, {"ratio": "20.0"}).replace("time = 3", "time = 5"))
    assert drive.with_settings(["gear.ratio=20", "duty[2].time=5"]) == written
    assert drive.with_settings(["duty[2].time=5"]).with_settings(["gear.ratio=20"]) == written
    torque = drive.with_settings(["duty[4].torque=-50 N*m at output", "gear.ratio=20"])
    assert torque == Drive.from_toml(with_gear(AT_OUTPUT, {"ratio": "20.0"}).replace('"-40', '"-50'))


def test_another_ratio_of_a_data_sheet_is_as_in_its_file() -> None:
    text = """
    [motor]
    rated_power = "3 kW"
    rated_speed = "1410 rpm"
    inertia = "0.0083 kg*m^2"
    [gear]
    ratio = 38.1
    stiffness = "35 kN*m/rad"
    backlash = "9 arcmin"
    [load]
    machine = "travel"
    mass = "6.5 t"
    diameter = "315 mm"
    """
    other = Drive.from_toml(text).replace(gear_ratio=20.0)
    written = Drive.from_toml(text.replace("38.1", "20"))
    names = ("stiffness", "gap", "load_inertia", "load_torque")
    assert [getattr(other, name) for name in names] == [getattr(written, name) for name in names]
