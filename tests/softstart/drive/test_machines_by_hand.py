"""Machines of a data sheet by hand calculation: what acts always, what is friction, and the inertia."""

from __future__ import annotations

import itertools
import math

import pytest

from softstart import DataSheet, Drive, InputError, simulate

MOTOR = {
    "motor.rated_power": "30 kW", "motor.rated_speed": "1450 rpm", "motor.inertia": 0.3,
    "motor.starting_torque": 400, "gear.stiffness": "400 N*m/arcmin", "gear.backlash": "10 arcmin",
}  # fmt: skip
TROLLEY = {
    "load.machine": "trolley", "motor.rated_speed": "1410 rpm", "load.mass": "6.5 t",
    "load.diameter": "315 mm", "load.resistance": 0.008, "gear.ratio": 38.1, "gear.efficiency": 0.94,
}  # fmt: skip
LIFT = {
    "load.machine": "lift", "load.mass": "1975 kg", "load.counterweight": "1438.75 kg", "load.radius": 0.25,
    "gear.ratio": 37.96, "gear.efficiency": 0.85,
}  # fmt: skip
BELT = {
    "load.machine": "belt conveyor", "load.mass": "12 t", "load.radius": "0.4 m", "load.resistance": 0.02,
    "gear.ratio": 25, "gear.efficiency": 0.94,
}  # fmt: skip


@pytest.mark.parametrize(
    ("sheet", "active", "friction", "inertia", "position", "motion"),
    [
        # 6500 g 0.0300/sqrt(1 + 0.03^2) 0.1575/(38.1 x 0.94); 0.008 of the normal force; pi 0.315 1410/38.1
        pytest.param(TROLLEY | {"load.slope": "3 %"}, 8.40597, 2.24159, 0.118167, "hanging",
                     "36.62 m/min", id="trolley uphill"),
        # the load drives the motor: both times 0.94/38.1
        pytest.param(TROLLEY | {"load.slope": "-5 %"}, -12.3693, 1.97909, 0.118167, "hanging",
                     "36.62 m/min", id="trolley downhill"),
        # 536.25 g 0.25/(37.96 x 0.85); (1975 + 1438.75) 0.25^2/(37.96^2 x 0.85); pi 0.5 1450/37.96
        pytest.param(LIFT, 40.7458, 0.0, 0.174197, "hanging", "60 m/min", id="lift, full"),
        pytest.param(LIFT | {"load.mass": 1438.75}, 0.0, 0.0, 0.146833, "unknown", "60 m/min", id="balanced"),
        # 488.75 kg too light: -488.75 g 0.25 x 0.85/37.96
        pytest.param(LIFT | {"load.mass": 950}, -26.8312, 0.0, 0.121893, "hanging", "60 m/min", id="empty"),
        # 10 t on two falls of a drum of 400 mm: arm 0.1 m
        pytest.param({"load.machine": "hoist", "load.mass": "10 t", "load.diameter": "400 mm",
                      "load.reeving": 2, "gear.ratio": 63, "gear.efficiency": 0.9},
                     172.957, 0.0, 0.0279947, "hanging", "14.46 m/min", id="hoist, two falls"),
        # 5770 kg of 12 t are goods, 18 deg: 5770 g sin 0.4/(25 x 0.94), 0.02 x 12000 g cos 0.4/(25 x 0.94)
        pytest.param(BELT | {"load.slope": "18 deg", "load.goods": "5770 kg"},
                     297.626, 38.1005, 3.26809, "hanging", "145.8 m/min", id="steep belt"),
        # the same lift given as a torque: 7000/(25 x 0.94), 0.02 x 12000 g 0.4/(25 x 0.94)
        pytest.param(BELT | {"load.torque": "7000 N*m", "load.friction": 0},
                     297.872, 40.0612, 3.26809, "hanging", "145.8 m/min", id="belt, lift as torque"),
        pytest.param(BELT, 0.0, 40.0612, 3.26809, "unknown", "145.8 m/min", id="level belt"),
        # 4 t of passengers on 9 t, 6 m over 12 m, sprocket of 700 mm
        pytest.param({"load.machine": "escalator", "motor.rated_speed": "970 rpm", "load.mass": "9 t",
                      "load.goods": "4 t", "load.rise": "6 m", "load.length": "12 m", "load.resistance": 0.04,
                      "load.diameter": "700 mm", "gear.ratio": 60, "gear.efficiency": 0.85},
                     134.601, 20.9822, 0.360294, "hanging", "35.55 m/min", id="escalator"),
        # wind of 4 kN m and friction of 9 kN m that holds against it: /(380 x 0.9)
        pytest.param({"load.machine": "slewing gear", "load.inertia": 290e3, "load.torque": "4 kN*m",
                      "load.friction": "9 kN*m", "gear.ratio": 380, "gear.efficiency": 0.9},
                     11.6959, 26.3158, 2.23146, "unknown", "3.816 rpm", id="slewing against wind"),
        # half of 120 t on wheels of 630 mm, wind of 6 kN at the wheels
        pytest.param({"load.machine": "crane", "load.mass": "120 t", "load.diameter": "630 mm",
                      "load.torque": 1890, "load.friction": 0, "load.resistance": 0.008, "load.motors": 2,
                      "gear.ratio": 40, "gear.efficiency": 0.92},
                     25.6793, 40.2925, 4.0445, "unknown", "71.75 m/min", id="gantry, two motors"),
        pytest.param({"load.machine": "fan", "load.inertia": 12, "load.friction": 180, "gear.ratio": 3,
                      "gear.efficiency": 0.96}, 0.0, 62.5, 1.38889, "unknown", "483.3 rpm", id="fan"),
    ],
)  # fmt: skip
def test_a_machine_comes_out_as_by_hand(sheet, active, friction, inertia, position, motion):
    sheet = DataSheet.from_settings(MOTOR | sheet)
    drive = sheet.drive
    reactive = drive.load_kind == "reactive"
    assert (0.0 if reactive else drive.load_torque) == pytest.approx(active, rel=1e-5)
    assert (drive.load_torque if reactive else drive.load_friction) == pytest.approx(friction, rel=1e-5)
    assert pytest.approx(inertia, rel=1e-5) == drive.J2
    assert drive.start_position == position
    assert f"load {motion}, accelerated by" in sheet.drive_toml()
    written = Drive.from_toml(sheet.drive_toml())
    assert (written.Mc, written.load_friction) == pytest.approx((drive.Mc, drive.load_friction), rel=1e-4)


def test_the_inclined_belt_hangs_on_its_backstop():
    """Peak of a direct start, undamped, by energy; as friction in the gap the lift would make 1400 N m of it.

    The shaft carries the lift M as the motor starts. Friction F holds the belt until the shaft carries M + F,
    at the speed v of the motor; from there the shaft swings about its mean torque.
    """
    belt = BELT | {
        "motor.rated_power": "75 kW", "motor.rated_speed": "1485 rpm", "motor.inertia": 0.9,
        "gear.stiffness": "400 N*m/arcmin", "gear.backlash": "10 arcmin", "shaft.damping_ratio": 0,
    }  # fmt: skip
    drive = DataSheet.from_settings(belt | {"load.torque": "7000 N*m", "load.friction": 0}).drive
    M, F, J1, J2, c, Ms = 7000.0 / 23.5, drive.load_friction, drive.J1, drive.J2, drive.c, drive.Ms
    twist, middle = F / c, M + 0.5 * F
    v = math.sqrt(2.0 * (Ms - middle) * twist / J1)
    mean, Omega = (Ms * J2 + J1 * (M + F)) / (J1 + J2), math.sqrt(c / J1 + c / J2)
    peak = mean + math.hypot(mean - M - F, c * v / Omega)
    assert simulate(drive, "direct").peak_torque == pytest.approx(peak, rel=1e-9)
    level = DataSheet.from_settings(belt | {"load.friction": "7000 N*m"}).drive
    assert simulate(level, "direct").peak_torque > 1.4 * peak


@pytest.mark.parametrize(
    ("base", "same"),
    [
        (TROLLEY, [{"load.diameter": None, "load.radius": "157.5 mm"}, {"load.diameter": "0.315 m"}]),
        (
            TROLLEY | {"load.slope": "7.5 %"},
            [
                {"load.slope": f"{math.atan(0.075)!r} rad"},
                {"load.slope": f"{math.degrees(math.atan(0.075))!r} deg"},
                {"load.slope": None, "load.rise": "3 m", "load.length": f"{math.hypot(40.0, 3.0)!r} m"},
            ],
        ),
        (MOTOR | LIFT, [{"load.reeving": 2, "load.radius": 0.5}, {"load.mass": "1.975 t"}]),
        (BELT | {"load.slope": "4 deg"}, [{"load.goods": "12 t"}, {"load.machine": "belt"}]),
    ],
)
def test_one_machine_written_in_several_ways_is_one_drive(base, same):
    """Radius or diameter, slope as angle, per cent or rise, falls or drum, units."""
    drive = DataSheet.from_settings(MOTOR | base).drive
    for change in same:
        other = {path: value for path, value in (MOTOR | base | change).items() if value is not None}
        found = DataSheet.from_settings(other).drive
        assert found.values() == {
            name: pytest.approx(value, rel=1e-13) if isinstance(value, float) else value
            for name, value in drive.values().items()
        }


def test_a_drive_is_exact_in_python():
    """That of its file has what was typed, and of what is computed five digits."""
    sheet = DataSheet(
        machine="rotor", rated_torque=1.0, rated_speed=100.0, motor_inertia=0.0123456789,
        output_inertia=1.23456789, elastic_frequency=7.654321, starting_torque=1.987654321,
    )  # fmt: skip
    drive = sheet.drive
    assert (drive.J1, drive.J2, drive.Ms) == (0.0123456789, 1.23456789, 1.987654321)
    assert math.tau * 7.654321 == pytest.approx(drive.Omega, rel=1e-14)
    assert Drive.from_toml(sheet.to_toml()) == drive
    of_file = Drive.from_toml(sheet.drive_toml())
    same = ("J1", "J2", "Ms", "target_speed", "rated_torque")
    assert [getattr(of_file, name) for name in same] == [getattr(drive, name) for name in same]
    assert of_file.d == float(f"{drive.d:.5g}") != drive.d


def test_ropes_of_car_and_counterweight_by_their_energy():
    """c at the sheave from (m1 a)^2/(2 k) + (m2 a)^2/(2 k) = (M a)^2/(2 c/r^2), with M = m1 + m2."""
    rope = {"rope.stiffness": "0.5 MN/m"}
    m1, m2, k, r, behind = 1975.0, 1438.75, 0.5e6, 0.25, 37.96**2 * 0.85
    drive = DataSheet.from_settings(MOTOR | LIFT | rope).drive
    gears = 400.0 * 60.0 * 180.0 / math.pi / behind
    ropes = r**2 * (m1 + m2) ** 2 / (m1**2 / k + m2**2 / k) / behind
    assert 1.0 / drive.c == pytest.approx(1.0 / gears + 1.0 / ropes, rel=1e-12)


@pytest.mark.parametrize("words", ["trolley", "Gantry crane", "vehicle", "wheels", "a crane"])
def test_words_of_the_question_name_the_machine(words):
    assert DataSheet.from_settings(MOTOR | TROLLEY | {"load.machine": words}).machine == "travel"


@pytest.mark.parametrize("words", ["slewing crane", "lift table", "excavator", "3"])
def test_a_word_for_two_machines_or_none_is_asked(words):
    with pytest.raises(InputError, match='is "hoist", "travel", "belt" or "rotor"'):
        DataSheet.from_settings(MOTOR | TROLLEY | {"load.machine": words})


@pytest.mark.parametrize(
    ("base", "changes", "sentence"),
    [
        (TROLLEY, {"load.radius": 0.1575}, "[load] diameter and [load] radius both say how large the wheel"),
        (TROLLEY, {"load.diameter": 315}, 'no unit; write "315 mm" or, if m is meant, "315 m"'),
        (
            TROLLEY,
            {"load.diameter": None},
            "[load] diameter is missing: a travel needs the diameter",
        ),
        (TROLLEY, {"load.slope": 5}, 'no unit; write "5 deg" or, if rad is meant'),
        (TROLLEY, {"load.slope": "95 deg"}, "a slope is below 90 deg"),
        (
            TROLLEY,
            {"load.slope": "5 %", "load.rise": 1, "load.length": 20},
            "both say how steep the track is",
        ),
        (TROLLEY, {"load.rise": 1}, "[load] rise says nothing without [load] length"),
        (TROLLEY, {"load.rise": "6 m", "load.length": "6 m"}, "a track of 6 m cannot rise so far"),
        (TROLLEY, {"load.counterweight": 100}, "[load] counterweight is for a hoist"),
        (TROLLEY, {"load.torque": 100}, "does it act always, as a lift, wind or an imbalance"),
        (BELT, {"load.torque": "7000 N*m"}, "if it is friction, write it as [load] friction"),
        (BELT, {"load.goods": "4 t"}, "says nothing without a slope"),
        (BELT, {"load.goods": "40 t", "load.slope": "3 deg"}, "is more than [load] mass = 12000 kg"),
        (BELT, {"shaft.elastic_frequency": "8 Hz"}, "and gears are given as well; leave out"),
    ],
)
def test_what_would_mean_something_else_is_asked(base, changes, sentence):
    sheet = {path: value for path, value in (MOTOR | base | changes).items() if value is not None}
    with pytest.raises(InputError) as refused:
        DataSheet.from_settings(sheet)
    assert sentence in str(refused.value)


@pytest.mark.parametrize("share", [0.999, 1.001])
def test_wheels_that_slip_are_doubted(share):
    """a + g sin = 0.12 g cos, of a weight on wheels that are all driven."""
    needed = 0.12 * share * 9.80665 * math.cos(0.02) - 9.80665 * math.sin(0.02)
    slope, level = {"load.slope": "0.02 rad"}, DataSheet.from_settings(MOTOR | TROLLEY).drive
    drive = DataSheet.from_settings(MOTOR | TROLLEY | slope).drive
    alpha = needed / 0.1575 * 38.1  # of the motor
    torque = drive.Mc + (level.J1 + level.J2) * alpha
    sheet = DataSheet.from_settings(MOTOR | TROLLEY | slope | {"motor.starting_torque": torque})
    assert sheet.acceleration == pytest.approx(needed, rel=1e-12)
    assert [one[:4] for one in sheet.motion_warnings] == ["mean"] * (share > 1.0)


@pytest.mark.parametrize(
    ("base", "low", "high"),
    [(TROLLEY, 1, 300), (BELT, 1, 480), (LIFT, 0.5, 600)],
    ids=["travel", "belt", "lift"],
)
def test_unusual_speeds_are_doubted(base, low, high):
    base = MOTOR | base | {"motor.starting_torque": 1e4, "motor.rated_torque": 1e4}
    base.pop("motor.rated_power")
    now = 60.0 * DataSheet.from_settings(base).speed
    for limit, share in itertools.product((low, high), (0.99, 1.01)):
        ratio = base["gear.ratio"] * now / (limit * share)
        found = DataSheet.from_settings(base | {"gear.ratio": ratio}).motion_warnings
        assert any(one.startswith("speed of the load") for one in found) == (
            limit * share < low or limit * share > high
        )


def test_a_diameter_given_as_radius_doubles_the_speed_that_is_said():
    radius = {path: value for path, value in (MOTOR | TROLLEY).items() if path != "load.diameter"}
    assert "load 36.62 m/min" in DataSheet.from_settings(MOTOR | TROLLEY).motion
    assert "load 73.25 m/min" in DataSheet.from_settings(radius | {"load.radius": "315 mm"}).motion
