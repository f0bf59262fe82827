"""A data sheet: the worked example of the documentation, and what must hold whatever is written in it."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart import DataSheet, Drive, InputError
from softstart.drive.data_sheet_words import usual_rotor

GANTRY = {
    "load.machine": "travel", "motor.rated_power": "3 kW", "motor.rated_speed": "1430 rpm",
    "motor.inertia": "0.0119 kg*m^2", "motor.added_inertia": 0.0066, "motor.starting_ratio": 2.2,
    "motor.maximum_ratio": 2.6, "motor.torque_lag": "2 ms", "coupling.stiffness": 1500,
    "coupling.play": "0.1 mm", "coupling.diameter": "60 mm", "gear.ratio": 31.5, "gear.efficiency": 0.94,
    "gear.stiffness": "25 N*m/arcmin", "gear.backlash": "15 arcmin", "output.diameter": "55 mm",
    "output.length": "0.9 m", "output.play": "0.4 mm", "output.play_diameter": "120 mm",
    "load.mass": "12 t", "load.radius": "157.5 mm", "load.resistance": 0.008, "load.inertia": 1.2,
}  # fmt: skip
PAGE = Path(__file__).parents[3] / "docs" / "howto" / "own-drive.md"


def test_the_example_of_the_page_comes_out_as_by_hand():
    """Each number of the page's table, to the digits that it prints."""
    sheet = DataSheet.from_settings(GANTRY)
    found = dict(re.findall(r"^\| ([^|]+) \| [^|]+ \| ([0-9. ]+) ", PAGE.read_text(encoding="utf-8"), re.M))
    drive = sheet.drive
    for what, number in {
        "rated torque": sheet.rated,
        "Ms": drive.Ms,
        "maximum torque": drive.maximum_torque,
        "J1": drive.J1,
        "J2": drive.J2,
        "Mc": drive.Mc,
        "c": drive.c,
        "gap": drive.gap,
    }.items():
        digits = len(found[what].partition(".")[2])
        assert round(float(number), digits) == float(found[what]), what
    shipped = Drive.load("long-travel-3kw")
    for name in ("J1", "J2", "Mc", "c", "gap", "Ms", "d", "target_speed"):
        assert getattr(drive, name) == pytest.approx(getattr(shipped, name), rel=0.011)
    assert (drive.load_kind, drive.start_position) == (shipped.load_kind, shipped.start_position)


def test_a_duty_belongs_in_the_drive_file(tmp_path):
    """One sentence, where a drive is read and where a data sheet is."""
    text = DataSheet.from_settings(GANTRY).to_toml() + '[brake]\ntorque = 40\n[[duty]]\ndo = "start"\n'
    (tmp_path / "sheet.toml").write_text(text, encoding="utf-8")
    for kind in (Drive, DataSheet):
        with pytest.raises(
            InputError, match=r"sheet\.toml: \[brake\] and \[\[duty\]\]: .*softstart init"
        ) as error:
            kind.load(tmp_path / "sheet.toml")
        assert len(error.value.sentences) == 1


@settings(max_examples=60, deadline=None)
@given(
    mass=st.floats(10.0, 1e5), radius=st.floats(0.02, 2.0), reeving=st.integers(1, 8),
    ratio=st.floats(1.0, 200.0), efficiency=st.floats(0.3, 1.0), stiffness=st.floats(1e2, 1e7),
    backlash=st.floats(0.0, 0.05), power=st.floats(2e5, 1e7),
)  # fmt: skip
def test_work_and_energy_are_those_at_the_output(
    mass, radius, reeving, ratio, efficiency, stiffness, backlash, power
):
    """The power that lifts, the kinetic energy and the wound-up energy are those of the load over eta."""
    speed = 100.0
    sheet = DataSheet(
        machine="hoist", rated_power=power, rated_speed=speed, motor_inertia=0.1, starting_torque=0.5 * power,
        ratio=ratio, efficiency=efficiency, mass=mass, radius=radius, reeving=reeving,
        gear_stiffness=stiffness, backlash=backlash,
    )  # fmt: skip
    if mass * 9.80665 * radius / reeving / (ratio * efficiency) > 0.999 * 50.0 * power / speed:
        with pytest.raises(InputError, match="torque"):  # a weight that this motor does not lift
            _ = sheet.drive
        return
    drive = sheet.drive
    lifting = speed / ratio * radius / reeving  # m/s, of the load
    near = 6e-5  # five digits are written
    assert drive.Mc * speed == pytest.approx(mass * 9.80665 * lifting / efficiency, rel=near)
    assert drive.J2 * speed**2 == pytest.approx(mass * lifting**2 / efficiency, rel=near)
    assert drive.c * ratio**2 == pytest.approx(stiffness / efficiency, rel=near)
    assert drive.gap == pytest.approx(ratio * backlash, rel=near)
    assert drive.Ms * speed == pytest.approx(50.0 * power, rel=near)
    J = drive.J1 * drive.J2 / (drive.J1 + drive.J2)
    assert drive.d / (2.0 * math.sqrt(drive.c * J)) == pytest.approx(0.02, rel=3 * near)
    assert (drive.load_kind, drive.start_position, drive.brake) == ("active", "hanging", "motor")


@given(
    stiffnesses=st.lists(st.floats(1.0, 1e5), min_size=2, max_size=2),
    plays=st.lists(st.floats(1e-5, 1e-3), min_size=2, max_size=2),
)
@settings(max_examples=60, deadline=None)
def test_parts_in_series(stiffnesses, plays):
    """The softest part decides, and every part makes it softer and the gap wider."""
    coupling, gears = stiffnesses
    sheet = DataSheet(
        machine="rotor", rated_power=1e3, rated_speed=100.0, motor_inertia=0.1, output_inertia=1.0,
        efficiency=1.0, ratio=1.0, coupling_stiffness=coupling, gear_stiffness=gears,
        coupling_play=plays[0], coupling_diameter=0.1, output_play=plays[1], play_diameter=0.2,
    )  # fmt: skip
    assert sheet.drive.c == pytest.approx(coupling * gears / (coupling + gears), rel=6e-5)
    assert sheet.drive.gap == pytest.approx(20.0 * plays[0] + 10.0 * plays[1], rel=6e-5)


HOIST = {
    "load.machine": "hoist", "motor.rated_power": "15 kW", "motor.rated_speed": "1460 rpm",
    "motor.inertia": 0.35, "motor.starting_torque": 240, "gear.ratio": 40, "gear.efficiency": 1,
    "gear.stiffness": "90.84 kNm/rad", "gear.backlash": "8 arcmin", "load.mass": "5 t",
    "load.radius": 0.2, "load.reeving": 2, "shaft.damping_ratio": "2 %",
}  # fmt: skip


METAL = "metallic cross-section of 0.46 d^2"
ROPE = {"rope.length": "14.72 m", "rope.diameter": "16 mm"}  # 0.46 (16 mm)^2 100 GPa/14.72 m = 0.8 MN/m


@pytest.mark.parametrize(
    ("rope", "fall", "frequency", "assumed"),
    [
        ({}, 1e15, 7.08, "rigid rope"),
        ({"rope.stiffness": "0.8 MN/m"}, 0.8e6, 2.74, ""),  # 1.6 MN/m of two falls
        (ROPE, 0.8e6, 2.74, f"rope modulus 100 GPa on a {METAL}"),
        (ROPE | {"rope.modulus": "50 GPa"}, 0.4e6, 2.014, f"rope {METAL}"),
        # below sqrt(3.2e6/5000)/(2 pi) = 4.03 Hz, of the rope that two motors share
        ({"rope.stiffness": "1.6 MN/m", "load.motors": 2, "load.reeving": "4/2"}, 1.6e6, 3.795, ""),
    ],
)
def test_a_rope_makes_a_hoist_softer(rope, fall, frequency, assumed):
    """Against the free vibration of motor, drum without mass and load, in their own coordinates."""
    drive = DataSheet.from_settings(HOIST | rope).drive
    assert drive.Omega / (2 * math.pi) == pytest.approx(frequency, abs=0.005)
    assert drive.assumed == assumed
    i, r, n, m, gears, J1 = 40.0, 0.2, 2.0, 5000.0, *(np.array([90.84e3, 0.35]) * rope.get("load.motors", 1))
    # angle of the gears, and lift of the load that each fall lags behind, by motor, drum and load
    strain = np.array([[1 / i, -1.0, 0.0], [0.0, r / n, -1.0]])
    K = strain.T @ np.diag([gears, n * fall]) @ strain
    K = K[np.ix_([0, 2], [0, 2])] - np.outer(K[[0, 2], 1], K[1, [0, 2]]) / K[1, 1]
    assert pytest.approx(K[0, 0] / J1 + K[1, 1] / m, rel=3e-4) == drive.Omega**2


@pytest.mark.parametrize(("given_", "efficiency"), [("95 %", 0.95), (95, 0.95), (0.95, 0.95), (1, 1.0)])
def test_an_efficiency_is_a_share_or_per_cent(given_, efficiency):
    sheet = DataSheet.from_settings(HOIST | {"gear.efficiency": given_})
    assert sheet.efficiency == efficiency
    assert ("is 95 %" in sheet.drive.assumed) == (given_ in (95, "95"))


def test_what_nobody_gave_is_marked():
    least = {
        "load.machine": "belt", "motor.rated_torque": 20, "motor.rated_speed": "1430 rpm",
        "motor.inertia": 0.01, "gear.ratio": 20, "gear.stiffness": 1e5, "load.mass": 900, "load.radius": 0.2,
    }  # fmt: skip
    sheet = DataSheet.from_settings(least)
    assert sheet.drive.assumed.split("; ") == [
        "starting torque 1.5 times the rated torque", "efficiency 0.95", "no backlash",
        "resistance 0.02 of the weight", "damping ratio 0.02",
    ]  # fmt: skip
    assert sheet.drive.source == "data sheets and assumed values"
    marked = {line.split(" = ")[0] for line in sheet.drive_toml().splitlines() if ", assumed" in line}
    assert marked == {"starting_torque", "efficiency", "inertia", "torque", "gap", "damping"}


def test_a_file_and_back(tmp_path):
    sheet = DataSheet.from_settings(GANTRY)
    assert DataSheet.from_toml(sheet.to_toml()) == sheet
    written = Drive.from_toml(sheet.drive_toml())  # five digits
    for name, value in sheet.drive.given().items():
        assert getattr(written, name) == (value if isinstance(value, str) else pytest.approx(value, rel=5e-5))
    (tmp_path / "sheet.toml").write_text(sheet.to_toml())  # a data sheet where a drive is asked for
    assert Drive.load(tmp_path / "sheet.toml") == sheet.drive


def test_a_sheet_names_the_units_of_its_drive():
    text = "arcmin, rpm, kN m, at output"
    sheet = DataSheet.from_settings(GANTRY | {"units": text})
    assert sheet.drive.units == text
    assert Drive.from_toml(sheet.drive_toml()).units == text
    assert DataSheet.from_settings(GANTRY).drive.units == ""


@pytest.mark.parametrize("name", ["conveyor-11kw", "hoist-15kw", "long-travel-3kw"])
def test_the_rotors_of_shipped_motors_are_usual(name):
    """Motors with four poles, of catalogues: what is said where an inertia is missing covers them."""
    drive = Drive.load(name)
    torque = drive.rated_torque or drive.rated_power / drive.rated_speed
    low, high = map(float, re.findall(r"about (\S+) to (\S+) kg", usual_rotor(torque))[0])
    assert low <= drive.motor_inertia <= high


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"load.mass": None}, "[load] mass is missing: a travel needs the mass that is moved"),
        ({"gear.backlash": 9}, 'backlash = 9: no unit; write "9 arcmin" or, if rad is meant, "9 rad".'),
        ({"motor.rated_speed": 1430.0}, 'write "1430.0 rpm" or, if rad/s is meant'),
        ({"gear.efficiency": 1.2}, "the efficiency of all gears must be above 0 and at most 1"),
        ({"motor.starting_torque": 60}, "[motor] starting_ratio = 2.2 and [motor] starting_torque = 60 N*m"),
        ({"motor.rated_torque": 30}, "the first makes 4492.5 W; leave one out"),
        ({"rope.stiffness": 8e5}, "[rope] stiffness is for a hoist"),
        (HOIST | ROPE | {"rope.stiffness": 8e5}, "both say how stiff the rope is"),
        ({"coupling.diameter": None}, "[coupling] play says nothing without [coupling] diameter"),
        ({"load.radius": None}, "[load] diameter is missing: a travel needs the diameter of wheel or drum"),
        ({"gear.ratio": "1:31.5"}, "write 31.5, or 0.0317460317 if the gear speeds the load up."),
        ({"gear.ratio": 0.03}, "raise the one or lower the other. Is [gear] ratio inverted (turns of"),
        ({"gear.ratio": None}, "raise the one or lower the other. Is [gear] ratio missing, or a power"),
        ({"gear.backlash": "8 min"}, 'min is a time, not an angle; write "8 arcmin" if that is meant.'),
        ({"motor.inertia": None}, "Standard motors of 20 N*m have about 0.005 to 0.02 kg*m^2."),
        ({"motor.inertia": None, "motor.rated_torque": 98}, "of 98 N*m have about 0.05 to 0.2 kg*m^2."),
        ({"units": "furlongs"}, "the drive that follows: units"),
        (
            {"gear.efficiency": "0.95 %"},
            "is read as 0.0095, where the efficiency of all gears is 0.1 or more",
        ),
    ],
)
def test_what_is_wrong_is_said_with_a_remedy(changes, sentence):
    own = HOIST if changes.keys() >= HOIST.keys() else GANTRY
    given_ = {path: value for path, value in (own | changes).items() if value is not None}
    with pytest.raises(InputError) as refused:
        _ = DataSheet.from_settings(given_).drive
    assert sentence in str(refused.value)
