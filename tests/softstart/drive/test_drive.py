"""The drive as a value: defaults, changes, equality, files and back, and the shipped ones."""

import math
import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart import simulate, sweep
from softstart.drive import INFORMATIVE_TABLES, PARAMETERS, Drive, library
from softstart.errors import InputError

CRANE = Drive.load("crane-4amtkf")


def test_defaults():
    plain = Drive(
        motor_inertia=0.035, starting_torque=62.0, stiffness=368.465, gap=1, load_inertia=np.float32(0.5),
        load_torque=7.16, rated_speed=92.0,
    )  # fmt: skip
    assert (plain.maximum_torque, plain.target_speed, plain.torque_rate) == (62.0, 92.0, math.inf)
    assert plain.minimum_torque == plain.torque_lag == plain.damping == plain.theta0 == 0.0
    assert (plain.load_kind, plain.contact_law, plain.encoder_lines) == ("active", "no-pull", 4096.0)
    assert not plain.limits
    assert type(plain.gap) is type(plain.load_inertia) is type(plain.Omega) is float


def test_changes_follow_and_are_checked():
    crane = CRANE.replace(maximum_torque=None, target_speed=None)
    assert crane.replace(starting_torque=100).maximum_torque == 100
    assert crane.replace(rated_power=None, rated_speed=50).target_speed == 50
    words = ["load.inertia=0.07", "shaft.gap=2 rad", "load_kind = reactive", 'name="a = b"']
    assert crane.with_settings(words) == crane.replace(
        load_inertia=0.07, gap=2, load_kind="reactive", name="a = b"
    )
    with pytest.raises(InputError, match=r"^gap = -1: the total angular gap must be 0 or more"):
        crane.replace(gap=-1)
    with pytest.raises(AttributeError, match=r"replace\(gap=...\)"):
        crane.gap = 2.0
    several = "for several use sweep, in Python machine_table(drive, gap=...)"
    with pytest.raises(InputError, match=re.escape(f"[0.5, 2.0]: a drive has one value; {several}.")):
        crane.replace(gap=np.array([0.5, 2.0]))


def test_equality_and_hash():
    worn = CRANE.replace(gap=2)
    assert worn == CRANE.replace(gap=np.float64(2.0))
    assert hash(worn) == hash(CRANE.replace(gap="2 rad"))
    assert worn != CRANE != CRANE.replace(name="other")
    plain = CRANE.replace(maximum_torque=None)
    assert plain.replace(maximum_torque=62) == plain  # given or following: the same drive
    assert pickle.loads(pickle.dumps(worn)) == worn
    assert eval(repr(worn), {"Drive": Drive}) == worn


@pytest.mark.parametrize(
    "parameter", [p for p in PARAMETERS.values() if p.unit or p.choices], ids=lambda p: p.name
)
def test_the_example_of_each_parameter_is_valid(parameter):
    # a life needs the starts per hour, a point of an S-N curve torque, cycles and slope
    table = [p for p in PARAMETERS.values() if p.table == parameter.table in INFORMATIVE_TABLES]
    crane = CRANE.replace(rated_power=None, gear_ratio=20)  # without one nothing is at the output
    changed = crane.with_settings([f"{p.path}={p.example}" for p in table or [parameter]])
    assert Drive.from_toml(changed.to_toml()) == changed


# ---- files and back -------------------------------------------------------------------------------------

positive, angle = st.floats(1e-6, 1e6), st.floats(-1e3, 1e3)
plain_text = st.text(st.characters(exclude_categories=["Cc", "Cf", "Cs"]), min_size=1)


@st.composite
def drives(draw):
    load = draw(positive)
    needed = ("motor_inertia", "load_inertia", "stiffness", "target_speed")
    others = {
        "name": plain_text.filter(lambda s: len(s.splitlines()) == 1 and s.strip()),
        "source": st.text(),
        "minimum_torque": st.floats(-1e6, 0),
        "torque_rate": st.just(math.inf) | positive,
        "start_position": angle,
        "initial_motor_speed": angle,
        "load_kind": st.sampled_from(["active", "reactive"]),
        "contact_law": st.sampled_from(["no-pull", "dead-zone", "modelica"]),
        "encoder_lines": st.integers(0, 10**6),
    }
    return Drive(
        gap=draw(st.just(0.0) | positive), load_torque=load, starting_torque=load * draw(st.floats(1.01, 10)),
        **{name: draw(positive) for name in needed},
        **{name: draw(values) for name, values in others.items() if draw(st.booleans())},
    )  # fmt: skip


@settings(deadline=None, max_examples=50)
@given(drives())
def test_round_trip(drive):
    again = Drive.from_toml(drive.to_toml())
    assert again == drive
    assert again.given().keys() == drive.given().keys()
    assert again.to_toml() == drive.to_toml()


LIMITS = """
[limits]
shaft_torque = "0.13 kN*m"
start_time = "1200 ms"
starts_per_hour = 60
life = "20000 h"
[limits.fatigue]
torque = [120, "180 N*m"]
cycles = [1e6, 1e4]
"""


def test_limits_are_read_with_units_written_back_and_change_no_start():
    drive = Drive.from_toml(CRANE.to_toml() + LIMITS)
    limits = drive.limits
    assert (limits.shaft_torque, limits.start_time, limits.starts_per_hour) == (130.0, 1.2, 60.0)
    assert (limits.life, limits.starts) == (20000 * 3600.0, pytest.approx(60 * 20000))
    assert limits.fatigue.slope is None
    assert limits.fatigue.points == ((180.0, 1e4), (120.0, 1e6))
    assert Drive.from_toml(drive.to_toml()) == drive
    assert not Drive.from_toml(CRANE.to_toml() + "[limits.fatigue]\nslope = 5\n").limits  # decides nothing
    one, other = simulate(CRANE, "ramp"), simulate(drive, "ramp")
    assert one.trajectory.notes.tobytes() == other.trajectory.notes.tobytes()
    with pytest.raises(InputError, match=r"limits.shaft_torque: .* changes no start"):
        sweep("crane-4amtkf", "direct", {"limits.shaft_torque": [90, 100]})
    geared = CRANE.replace(gear_ratio=20, gap="1 deg at output")  # for which a ratio does change starts
    with pytest.raises(InputError, match=r"gear.ratio: all cells have one gear; .* or set the gear"):
        sweep(geared, "direct", {"gear.ratio": [20, 40]})


def test_a_shipped_name_goes_before_a_file_of_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crane-4amtkf").mkdir()
    (tmp_path / "own.toml").write_bytes(b"\xef\xbb\xbf" + CRANE.to_toml().encode())  # a byte-order mark
    assert Drive.load("crane-4amtkf") == Drive.load("own.toml") == CRANE
    with pytest.raises(InputError, match="this is a directory"):
        Drive.load("./crane-4amtkf")


# ---- the shipped ones -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", library.names())
def test_a_shipped_drive_is_what_its_comment_says(name):
    """Elastic frequency, damping ratio and time to its speed, computed; each value with its source."""
    drive, text = Drive.load(name), library.text(name)
    assert drive.source
    assert drive.target_speed == drive.rated_speed
    assert Drive.from_toml(drive.to_toml()) == drive
    said = re.search(r"frequency ([\d.]+) Hz, damping ratio (\d+) %;.* in ([\d.]+) s\.", text)
    if said is None:
        return
    ratio = drive.d * (1 / drive.J1 + 1 / drive.J2) / (2 * drive.Omega)
    rigid = drive.target_speed * (drive.J1 + drive.J2) / (drive.Ms - drive.Mc)
    for number, value in zip(said.groups(), (drive.Omega / (2 * math.pi), 100 * ratio, rigid), strict=True):
        assert round(value, len(number.partition(".")[2])) == float(number)
    for line in text.splitlines():
        if re.match(r"\w+ = \"\d", line) and not line.startswith("target_speed"):
            assert re.search(r"# (plate|computed|typical|data sheet)", line), line


@pytest.mark.parametrize(
    ("name", "J2", "gap"),
    [
        ("crane-4amtkf", 0.175, 0.5),
        ("crane-4amtkf-worn", 0.175, 2.0),
        ("crane-4amtkf-light", 0.07, 0.5),
        ("crane-4amtkf-light-worn", 0.07, 2.0),
    ],
)
def test_the_crane_of_g(name, J2, gap):
    drive = Drive.load(name)
    assert (drive.J1, drive.J2, drive.gap, drive.c, drive.d) == (0.035, J2, gap, 368.465, 0.0)
    assert (drive.Ms, drive.maximum_torque, drive.Mc, drive.load_kind) == (62.0, 64.0, 7.16, "active")
    assert pytest.approx(math.sqrt(368.465 * (0.035 + J2) / (0.035 * J2)), rel=1e-15) == drive.Omega  # [G](8)
    assert drive.elastic_period == pytest.approx(2 * math.pi / drive.Omega, rel=1e-15)
    assert drive.target_speed == pytest.approx(880 * 2 * math.pi / 60, rel=1e-15)
    # 0.3 of the rated torque, as [G] says
    assert drive.Mc == pytest.approx(0.3 * 2200.0 / drive.rated_speed, rel=1e-3)


def test_the_rig_of_nordin_and_the_small_servo_axis():
    rig, servo = Drive.load("nordin-servo-60kw"), Drive.load("servo-axis-small")
    assert (rig.J1, rig.J2, rig.c, rig.gap, rig.d) == (0.4, 5.6, 5895.0, 0.005, 58.95)
    assert library.text("nordin-servo-60kw").count("# assumed") == 8
    assert (servo.load_kind, servo.torque_lag, servo.rated_power) == ("reactive", 0.001, 400)
    assert servo.gap == pytest.approx(10 * 8 / 60 * math.pi / 180, rel=1e-15)
    assert servo.stiffness == pytest.approx(2.5 * 60 * 180 / math.pi / 100, rel=1e-3)
    critical = 2 * math.sqrt(servo.c * servo.J1 * servo.J2 / (servo.J1 + servo.J2))
    assert servo.d / critical == pytest.approx(0.02, rel=0.05)
