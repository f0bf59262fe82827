"""Drives from files and back, and the shipped ones."""

import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart.drive import Drive, library
from softstart.errors import InputError

positive = st.floats(1e-6, 1e6)
angle = st.floats(-1e3, 1e3)


plain = st.characters(exclude_categories=["Cc", "Cf", "Cs"])


@st.composite
def drives(draw):
    def maybe(name, values):
        return {name: draw(values)} if draw(st.booleans()) else {}

    load = draw(positive)
    return Drive(
        motor_inertia=draw(positive),
        load_inertia=draw(positive),
        stiffness=draw(positive),
        gap=draw(st.just(0.0) | positive),
        load_torque=load,
        starting_torque=load * draw(st.floats(1.01, 10)),
        target_speed=draw(positive),
        **maybe("name", st.text(plain, min_size=1).filter(lambda s: len(s.splitlines()) == 1 and s.strip())),
        **maybe("source", st.text()),
        **maybe("minimum_torque", st.floats(-1e6, 0)),
        **maybe("torque_rate", st.just(math.inf) | positive),
        **maybe("start_position", angle),
        **maybe("initial_motor_speed", angle),
        **maybe("load_kind", st.sampled_from(["active", "reactive"])),
        **maybe("contact_law", st.sampled_from(["no-pull", "dead-zone", "modelica"])),
        **maybe("encoder_lines", st.integers(0, 10**6)),
    )


@settings(deadline=None)  # the first example imports pint
@given(drives())
def test_round_trip(drive):
    again = Drive.from_toml(drive.to_toml())
    assert again == drive
    assert again.given().keys() == drive.given().keys()
    assert again.to_toml() == drive.to_toml()


def test_a_file(tmp_path):
    path = tmp_path / "my drive.toml"
    path.write_bytes(
        b"\xef\xbb\xbf" + Drive.load("crane-4amtkf").to_toml().encode()
    )  # with a byte-order mark
    assert Drive.load(path) == Drive.load(str(path)) == Drive.load("crane-4amtkf")


def test_a_shipped_name_goes_before_a_file_of_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "crane-4amtkf").mkdir()
    assert Drive.load("crane-4amtkf").gap == 0.5
    with pytest.raises(InputError, match="this is a directory"):
        Drive.load("./crane-4amtkf")


def test_the_shipped_drives():
    assert library.names() == (
        "conveyor-11kw",
        "crane-4amtkf",
        "crane-4amtkf-light",
        "crane-4amtkf-light-worn",
        "crane-4amtkf-worn",
        "hoist-15kw",
        "long-travel-3kw",
        "nordin-servo-60kw",
        "servo-axis-small",
    )
    for name in library.names():
        drive = Drive.load(name)
        assert drive.source
        assert drive.name != "unnamed drive"
        assert drive.target_speed == drive.rated_speed
        assert library.text(name).startswith("# ")
        assert Drive.from_toml(drive.to_toml()) == drive


@pytest.mark.parametrize("name", ["hoist-15kw", "conveyor-11kw", "long-travel-3kw"])
def test_a_shipped_drive_is_what_its_comment_says(name):
    """Elastic frequency, damping ratio and time to its speed, computed; each value with its source."""
    drive, text = Drive.load(name), library.text(name)
    said = re.search(r"frequency ([\d.]+) Hz, damping ratio (\d+) %;.* in ([\d.]+) s\.", text)
    assert said is not None
    ratio = drive.d * (1 / drive.J1 + 1 / drive.J2) / (2 * drive.Omega)
    rigid = drive.target_speed * (drive.J1 + drive.J2) / (drive.Ms - drive.Mc)
    for number, value in zip(said.groups(), (drive.Omega / (2 * math.pi), 100 * ratio, rigid), strict=True):
        decimals = len(number.partition(".")[2])
        assert round(value, decimals) == float(number)
    quantities = [line for line in text.splitlines() if re.match(r"\w+ = \"\d", line)]
    for line in quantities:
        if not line.startswith("target_speed"):
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
    assert drive.rated_power == 2200.0
    assert drive.target_speed == pytest.approx(880 * 2 * math.pi / 60, rel=1e-15)
    # 0.3 of the rated torque, as [G] says
    assert drive.Mc == pytest.approx(0.3 * drive.rated_power / drive.rated_speed, rel=1e-3)


def test_the_rig_of_nordin():
    drive = Drive.load("nordin-servo-60kw")
    assert (drive.J1, drive.J2, drive.c, drive.gap, drive.d) == (0.4, 5.6, 5895.0, 0.005, 58.95)
    text = library.text("nordin-servo-60kw")
    assert text.count("# assumed") == 8
    assert "assumed" in drive.source


def test_the_small_servo_axis():
    drive = Drive.load("servo-axis-small")
    assert drive.load_kind == "reactive"
    assert drive.torque_lag == 0.001
    assert drive.gap == pytest.approx(10 * 8 / 60 * math.pi / 180, rel=1e-15)
    assert drive.stiffness == pytest.approx(2.5 * 60 * 180 / math.pi / 100, rel=1e-3)
    assert drive.rated_power == 400
    critical = 2 * math.sqrt(drive.c * drive.J1 * drive.J2 / (drive.J1 + drive.J2))
    assert drive.d / critical == pytest.approx(0.02, rel=0.05)
    assert "ASSUMED" in library.text("servo-axis-small")
