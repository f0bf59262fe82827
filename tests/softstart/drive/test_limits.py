"""The limits of a drive: read, written, and refused where they contradict one another."""

import pytest

from softstart import Drive, simulate, sweep
from softstart.errors import InputError

FILE = """
[limits]
shaft_torque = "0.13 kN*m"
start_time = "1200 ms"
starts_per_hour = 60
life = "20000 h"
[limits.fatigue]
slope = 6.6
torque = "90 N*m"
cycles = 2e6
"""
S_N = '[limits.fatigue]\ntorque = [120, "180 N*m"]\ncycles = [1e6, 1e4]\n'


def with_limits(text):
    return Drive.from_toml(Drive.load("crane-4amtkf").to_toml() + text)


def test_limits_are_read_with_units_and_written_back():
    drive = with_limits(FILE)
    limits = drive.limits
    assert (limits.shaft_torque, limits.start_time, limits.starts_per_hour) == (130.0, 1.2, 60.0)
    assert limits.life == 20000 * 3600.0
    assert limits.starts == pytest.approx(60 * 20000)
    assert limits.fatigue.slope == 6.6
    assert limits.fatigue.points == ((90.0, 2e6),)
    assert Drive.from_toml(drive.to_toml()) == drive
    assert drive.with_settings(["limits.fatigue.slope=4", "limits.life=2 years"]).limits.life == 2 * 31557600


def test_points_of_an_s_n_curve_are_sorted_by_torque():
    drive = with_limits(S_N)
    assert drive.limits.fatigue.slope is None
    assert drive.limits.fatigue.points == ((180.0, 1e4), (120.0, 1e6))
    assert Drive.from_toml(drive.to_toml()) == drive


def test_a_drive_without_limits_has_none():
    limits = Drive.load("crane-4amtkf").limits
    assert not limits
    assert limits.fatigue is None
    assert not with_limits("[limits.fatigue]\nslope = 5\n").limits  # compares lives, decides nothing
    assert with_limits("[limits]\nstart_time = 1\n").limits


def test_limits_change_no_start():
    one, other = simulate("crane-4amtkf", "ramp"), simulate(with_limits(FILE), "ramp")
    assert one.recorded.notes.tobytes() == other.recorded.notes.tobytes()
    with pytest.raises(InputError, match=r"limits.shaft_torque: .* changes no start"):
        sweep("crane-4amtkf", "direct", {"limits.shaft_torque": [90, 100]})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[limits]\nshaft_torque = 5", "at constant speed the shaft already carries [load] torque = 7.16"),
        ("[limits]\nshaft_torqe = 90", "did you mean shaft_torque?"),
        ('[limits]\nshaft_torque = "90 N"', "N is a force, not a torque"),
        ("[limits]\nslope = 3", "did you mean [limits.fatigue] slope?"),
        ("[limits]\nfatigue = 3", "limits.fatigue is a table"),
        ('[limits]\nlife = "1 year"', "[limits] starts_per_hour is missing"),
        ("[limits]\nstarts_per_hour = 4000\nstart_time = 1", "take more than an hour"),
        ("[limits.fatigue]\ntorque = 90", "give [limits.fatigue] cycles as well"),
        ("[limits.fatigue]\ncycles = 90", "give [limits.fatigue] torque as well"),
        ("[limits.fatigue]\ntorque = 90\ncycles = 1e6", "one point is no curve"),
        ("[limits.fatigue]\ntorque = [90, 80]\ncycles = 1e6", "there are 1 for 2 values"),
        ("[limits.fatigue]\nslope = 3\n" + S_N.partition("\n")[2], "the points of the S-N curve give its"),
        ("[limits.fatigue]\ntorque = [90, 80]\ncycles = [2e6, 1e6]", "a smaller torque must be withstood"),
        ("[fatigue]\nslope = 3", "did you mean [limits.fatigue]?"),
    ],
)
def test_limits_that_are_refused(text, said):
    with pytest.raises(InputError) as refusal:
        with_limits(text + "\n")
    assert said in str(refusal.value)
