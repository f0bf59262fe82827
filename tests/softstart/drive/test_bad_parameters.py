"""Everything that can be wrong with a drive made in Python or changed by settings: one sentence a mistake."""

import math

import pytest
from tests.softstart.drive.conftest import GOOD

from softstart.drive import PARAMETERS, Drive
from softstart.errors import InputError
from softstart.reporting.resolution import rated_torque

# parameter, value, what the sentence begins with, what it says
PYTHON = [
    ("gap", "5 m", 'gap = "5 m": ', "m is a length, not an angle"),
    ("gap", -0.5, "gap = -0.5: ", "the total angular gap must be 0 or more"),
    ("gap", "-30 deg", 'gap = "-30 deg": ', "must be 0 or more"),
    ("motor_inertia", 0, "motor_inertia = 0: ", "must be above 0"),
    ("load_inertia", -1, "load_inertia = -1: ", "the inertia of the load at the motor shaft must be above 0"),
    ("stiffness", 0.0, "stiffness = 0.0: ", "must be above 0"),
    ("damping", -1, "damping = -1: ", "must be 0 or more"),
    ("starting_torque", 0, "starting_torque = 0: ", "must be above 0"),
    ("starting_torque", 7.16, "starting_torque = 7.16 N*m: ", "cannot move the load against load_torque"),
    ("maximum_torque", 61, "maximum_torque = 61 N*m: ", "must not be below starting_torque = 62 N*m"),
    ("minimum_torque", 1, "minimum_torque = 1: ", "must be 0 or less"),
    ("rated_power", 0, "rated_power = 0: ", "must be above 0"),
    ("target_speed", -92, "target_speed = -92: ", "must be above 0"),
    ("torque_lag", -0.001, "torque_lag = -0.001: ", "must be 0 or more"),
    ("torque_rate", 0, "torque_rate = 0: ", "must be above 0"),
    ("torque_rate", -math.inf, "torque_rate = -inf: ", "must be above 0"),
    ("encoder_lines", 2.5, "encoder_lines = 2.5: ", "must be a whole number, 0 or more"),
    ("encoder_lines", -1, "encoder_lines = -1: ", "must be a whole number, 0 or more"),
    ("encoder_lines", "4096 rad", 'encoder_lines = "4096 rad": ', "not a plain number"),
    ("initial_load_speed", 92, "initial_load_speed = 92 rad/s: ", "must start below target_speed = 92 rad/s"),
    ("initial_motor_speed", math.inf, "initial_motor_speed = inf: ", "must be finite"),
    ("load_torque", -400.0, "load_torque = -400 N*m: ", "drives so hard"),
    ("load_torque", 100, "starting_torque = 62 N*m: ", "cannot move the load against load_torque = 100 N*m"),
    ("load_kind", "reactiv", 'load_kind = "reactiv": ', 'did you mean "reactive"?'),
    ("load_kind", "friction", 'load_kind = "friction": ', 'is "active" or "reactive"'),
    ("load_kind", ["active"], "load_kind = ['active']: ", 'is "active" or "reactive"'),
    ("contact_law", "no_pull", 'contact_law = "no_pull": ', 'did you mean "no-pull"?'),
    ("contact_law", None, "contact_law = None: ", '"no-pull", "dead-zone" or "modelica"'),
    ("name", "", 'name = "": ', "one line of text"),
    ("name", "two\nlines", 'name = "two\\nlines": ', "one line of text"),
    ("name", 5, "name = 5: ", "must be text"),
    ("source", ["a", "b"], "source = ['a', 'b']: ", "must be text"),
    ("source", "\ud800", "source = ", "incomplete character"),
    ("gapp", 1, "gapp = 1: ", "did you mean gap?"),
    ("J1", 1, "J1 = 1: ", "did you mean motor_inertia?"),
    ("inertia", 1, "inertia = 1: ", "did you mean motor_inertia or load_inertia?"),
    ("Load_Kind", "active", 'Load_Kind = "active": ', "did you mean load_kind?"),
    ("colour", "red", 'colour = "red": ', "the names are name, source, assumed, units, motor_inertia"),
    ("motor_inertia", 1e-320, "motor_inertia = 1e-320: ", "must be between 1e-30 and 1e+30"),
    ("stiffness", 5e-324, "stiffness = 5e-324: ", "must be between 1e-30 and 1e+30"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value", "subject", "reason"), PYTHON, ids=lambda v: str(v)[:24])
def test_one_sentence_from_python(name, value, subject, reason, sentences):
    (sentence,) = sentences(lambda: Drive(**GOOD | {name: value}))
    assert sentence.startswith(subject)
    assert reason in sentence


def test_everything_missing(sentences):
    found = sentences(Drive)
    required = [name for name, parameter in PARAMETERS.items() if parameter.required]
    assert [s.split(" is missing: ")[0] for s in found] == [*required, "target_speed"]
    assert found[0] == (
        "motor_inertia is missing: the inertia of the motor J1 is needed; "
        'write for example motor_inertia="0.035 kg*m^2".'
    )


def test_a_misspelt_key_is_not_also_missing(sentences):
    given = {name: value for name, value in GOOD.items() if name not in ("gap", "target_speed")}
    found = sentences(lambda: Drive(**given, gapp=0.5, rated_sped=92))
    assert [s.split(" ")[0] for s in found] == ["gapp", "rated_sped"]


def test_several_cross_checks_at_once(sentences):
    found = sentences(
        lambda: Drive(
            **GOOD
            | {"maximum_torque": 3, "load_torque": -1, "load_kind": "reactive", "initial_load_speed": 500}
        )
    )
    assert [s.split(" ")[0] for s in found] == ["maximum_torque", "load_torque", "initial_load_speed"]


SETTINGS = [
    ("load.inertia", '"load.inertia": ', "a key, an equals sign and a value"),
    ("=0.07", '"=0.07": ', "a key, an equals sign and a value"),
    ("load.inertia=", 'load.inertia = "": ', "not a number with a unit"),
    ("load.inertia=-1", 'load.inertia = "-1": ', "must be above 0"),
    ("load_inertia=-1", 'load_inertia = "-1": ', "must be above 0"),
    ("load.inertai=1", "load.inertai=1: ", "did you mean load.inertia?"),
    ("inertia=1", "inertia=1: ", "did you mean motor.inertia or load.inertia?"),
    ("J2=1", "J2=1: ", "did you mean load.inertia?"),
    ("load=1", "load=1: ", "load is a table, name one of its keys, such as load.inertia"),
    ("zzz.yyy=1", "zzz.yyy=1: ", "there are name, source, assumed, units, motor.inertia"),
    ("load.kind=reactve", 'load.kind = "reactve": ', 'did you mean "reactive"?'),
    ("shaft.gap=2 m", 'shaft.gap = "2 m": ', "m is a length"),
    ("motor.starting_torque=1", "motor.starting_torque = 1 N*m: ", "load.torque = 7.16 N*m"),
    (5, "5: ", "a setting is text"),
]


@pytest.mark.parametrize(("setting", "subject", "reason"), SETTINGS, ids=lambda v: str(v)[:24])
def test_one_sentence_from_a_setting(setting, subject, reason, sentences):
    (sentence,) = sentences(lambda: Drive(**GOOD).with_settings([setting]))
    assert sentence.startswith(subject)
    assert reason in sentence


def test_a_setting_twice(sentences):
    (sentence,) = sentences(lambda: Drive(**GOOD).with_settings(["shaft.gap=1", "gap=2"]))
    assert sentence == "gap=2: it was set before (shaft.gap=1); keep one of the two."


def test_rated_torque_power_and_speed_agree_within_what_a_data_sheet_rounds():
    crane = Drive.load("crane-4amtkf")  # 2.2 kW at 880 rpm, 23.87 N m
    assert crane.replace(rated_torque="24 N*m").rated_torque == 24.0
    assert crane.replace(rated_power=None, rated_torque=30).rated_torque == 30.0
    with pytest.raises(InputError, match=r"rated_torque = 30 N\*m: with the rated speed .* 2200 W"):
        crane.replace(rated_torque=30)


def test_the_rated_torque_of_a_data_sheet_is_what_inverters_count_in():
    crane = Drive.load("crane-4amtkf")
    assert rated_torque(crane.replace(rated_torque=24)) == (24.0, "rated torque")
    assert rated_torque(crane.replace(rated_power=None, rated_torque=30)) == (30.0, "rated torque")
    assert rated_torque(crane.replace(rated_power=None)) == (62.0, "starting torque")


@pytest.mark.parametrize("name", [name for name, p in PARAMETERS.items() if p.unit])
def test_no_number_of_a_drive_is_beyond_what_physics_can_square(name):
    crane = Drive.load("crane-4amtkf")
    for huge in (1e308, -1e308, [0.5, 1e300]):
        with pytest.raises(InputError):
            crane.replace(**{name: huge})
