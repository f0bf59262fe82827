"""Everything that can be wrong with a drive: one sentence a mistake, with file, table and key."""

import json
import math
import os
import re
from pathlib import Path

import pytest

from softstart.drive import PARAMETERS, Drive
from softstart.errors import InputError

GOOD = {
    "motor_inertia": 0.035, "starting_torque": 62.0, "stiffness": 368.465, "gap": 0.5, "load_inertia": 0.175,
    "load_torque": 7.16, "target_speed": 92.0,
}  # fmt: skip
GOOD_TOML = Drive(**GOOD).to_toml()


def sentences(attempt):
    """The sentences of the InputError that an attempt must raise: clear text."""
    with pytest.raises(InputError) as error:
        attempt()
    found = error.value.sentences
    assert str(error.value) == "\n".join(found)
    assert all(re.search(r"[.?]$", sentence) and "\n" not in sentence for sentence in found)
    return found


# ---- files ----------------------------------------------------------------------------------------------

# a line of the good file, what stands there instead, what the sentence begins with, what it says
TOML = [
    ("gap = 0.5", "gap = 2024-01-01", "[shaft] gap = 2024-01-01: ", "a date is not a quantity"),
    ("gap = 0.5", "", "[shaft] gap is missing: ", 'write for example gap = "0.5 rad"'),
    ("gap = 0.5", "gapp = 0.5", "[shaft] gapp = 0.5: ", "[shaft] has no key gapp; did you mean gap?"),
    ("gap = 0.5", "gap = 0.5\ninertia = 1", "[shaft] inertia = 1: ", "[motor] inertia or [load] inertia?"),
    ("gap = 0.5", "gap = 0.5\nJ1 = 2", "[shaft] J1 = 2: ", "did you mean [motor] inertia?"),
    ("gap = 0.5", "gap = 0.5 rad", "line 7, column 11, 'gap = 0.5 rad': ", 'in quotes: gap = "0.5 rad"'),
    ("gap = 0.5", "gap = 0,5 rad # flanks", "line ", 'use a decimal point: "0.5 rad")'),
    ("gap = 0.5", "gap = 1,500", "line ", 'write "1.500" with a decimal point, or "1500")'),
    ("[load]", "[laod]", "[laod]: ", "did you mean [load]?"),
    ("[load]", "[[load]]", 'load = [{"inertia": 0.175', "one table, not a list of tables"),
    ("[load]", "[clutch]\ntorque = 3\n[load]", "[clutch]: ", "its tables are [motor], [gear], [shaft], "),
    ("[motor]", "gap = 0.5\n[motor]", "gap = 0.5: ", "did you mean [shaft] gap?"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "instead", "subject", "reason"), TOML, ids=lambda v: str(v)[:24])
def test_one_sentence_from_a_file(line, instead, subject, reason):
    text = "\n".join(
        instead if part.split("  #")[0].strip() == line else part for part in GOOD_TOML.splitlines()
    )
    (sentence,) = sentences(lambda: Drive.from_toml(text, where="my.toml"))
    assert sentence.startswith(f"my.toml: {subject}")
    assert reason in sentence


FILES = [
    ("Crane-4AMTKF", "did you mean crane-4amtkf?"),
    ("mine.tml", "did you mean mine.toml?"),
    ("nowhere/mine.toml", 'there is no directory "nowhere"'),
    ("folder", "this is a directory"),
    ("latin.toml", "the file is not UTF-8 text (line 2)"),
    ("nul.toml", "not valid TOML"),
    ("device.toml", "no ordinary file"),
    ("huge.toml", "MB are read"),
]


@pytest.mark.parametrize(("path", "reason"), FILES, ids=lambda v: repr(v)[:24])
def test_one_sentence_for_a_file_that_is_none(path, reason, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(GOOD_TOML, encoding="utf-8")
    Path("folder").mkdir()
    Path("latin.toml").write_bytes("\nname = 'Größe'\n".encode("latin-1"))
    Path("utf16.toml").write_bytes(GOOD_TOML.encode("utf-16"))
    Path("nul.toml").write_bytes(b"name = \x00")
    Path("device.toml").symlink_to("/dev/zero")
    with Path("huge.toml").open("wb") as stream:
        os.truncate(stream.fileno(), 3 * 2**30)
    assert Drive.load("utf16.toml") == Drive(**GOOD)  # its mark says what it is
    (sentence,) = sentences(lambda: Drive.load(path))
    assert reason in sentence


HUGE = {
    "a key of 60,000 parts": (".".join(["a"] * 60_000) + " = 1", "nested too deeply"),
    "an integer of 5,000 digits": (f"name = 1{'0' * 5000}", "thousands of digits"),
    "a million numbers": ("x = [" + "0," * 1_000_000 + "]", "at most 1"),
    "nested tables": ("name = " + "{a=" * 100 + "1" + "}" * 100, "the name of the drive must be text"),
}


@pytest.mark.parametrize("kind", HUGE)
def test_a_huge_document_is_refused_in_one_short_sentence(kind):
    text, says = HUGE[kind]
    said = sentences(lambda: Drive.from_toml(text))
    assert says in said[0]
    assert max(map(len, said)) < 500


def test_thousands_of_mistakes_are_counted_and_not_listed():
    *said, last = sentences(lambda: Drive.from_toml("\n".join(f"key{i} = {i}" for i in range(2_000))))
    assert len(said) < 32
    assert 1_970 <= int(re.fullmatch(r"(\d+) more errors\.", last)[1]) <= 1_990


@pytest.mark.parametrize("name", ["\x1b[2J", "\u202eevird"])
def test_a_name_that_steers_the_terminal_is_refused(name):
    text = Drive(**GOOD, name="here").to_toml().replace('"here"', json.dumps(name))
    (sentence,) = sentences(lambda: Drive.from_toml(text))
    assert "has the control character U+" in sentence


# ---- limits ---------------------------------------------------------------------------------------------

S_N = '[limits.fatigue]\ntorque = [120, "180 N*m"]\ncycles = [1e6, 1e4]\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[limits]\nshaft_torque = 5", "at constant speed the shaft already carries [load] torque = 7.16"),
        ("[limits]\nslope = 3", "did you mean [limits.fatigue] slope?"),
        ("[limits]\nfatigue = 3", "limits.fatigue is a table"),
        ('[limits]\nlife = "1 year"', "[limits] starts_per_hour is missing"),
        ("[limits]\nstarts_per_hour = 4000\nstart_time = 1", "take more than an hour"),
        ("[limits.fatigue]\ntorque = [90, 80]\ncycles = 1e6", "there are 1 for 2 values"),
        ("[limits.fatigue]\nslope = 3\n" + S_N.partition("\n")[2], "the points of the S-N curve give its"),
        ("[limits.fatigue]\ntorque = [90, 80]\ncycles = [2e6, 1e6]", "a smaller torque must be withstood"),
    ],
)
def test_limits_that_are_refused(text, said):
    assert any(said in one for one in sentences(lambda: Drive.from_toml(GOOD_TOML + text + "\n")))


# ---- values ---------------------------------------------------------------------------------------------

# parameter, value, what the sentence begins with, what it says
PYTHON = [
    ("gap", "-30 deg", 'gap = "-30 deg": ', "the total angular gap must be 0 or more"),
    ("motor_inertia", 0, "motor_inertia = 0: ", "must be above 0"),
    ("starting_torque", 7.16, "starting_torque = 7.16 N*m: ", "cannot move the load against load_torque"),
    ("maximum_torque", 61, "maximum_torque = 61 N*m: ", "must not be below starting_torque = 62 N*m"),
    ("minimum_torque", 1, "minimum_torque = 1: ", "must be 0 or less"),
    ("encoder_lines", 2.5, "encoder_lines = 2.5: ", "must be a whole number, 0 or more"),
    ("initial_load_speed", 92, "initial_load_speed = 92 rad/s: ", "must start below target_speed = 92 rad/s"),
    ("load_torque", -400.0, "load_torque = -400 N*m: ", "drives so hard"),
    ("load_kind", "reactiv", 'load_kind = "reactiv": ', 'did you mean "reactive"?'),
    ("contact_law", None, "contact_law = None: ", '"no-pull", "dead-zone" or "modelica"'),
    ("name", "two\nlines", 'name = "two\\nlines": ', "one line of text"),
    ("name", "x" * 121, "name = ", "121 characters, and at most 120"),
    ("source", "\ud800", "source = ", "incomplete character"),
    ("stiffness", 5e-324, "stiffness = 5e-324: ", "must be between 1e-30 and 1e+30"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value", "subject", "reason"), PYTHON, ids=lambda v: str(v)[:24])
def test_one_sentence_from_python(name, value, subject, reason):
    (sentence,) = sentences(lambda: Drive(**GOOD | {name: value}))
    assert sentence.startswith(subject)
    assert reason in sentence


def test_everything_missing_and_a_misspelt_key_not_twice():
    found = [sentence.split(" is missing: ")[0] for sentence in sentences(Drive)]
    required = [name for name, parameter in PARAMETERS.items() if parameter.required]
    assert found == [*required, "target_speed"]
    given = {name: value for name, value in GOOD.items() if name not in ("gap", "target_speed")}
    found = sentences(lambda: Drive(**given, gapp=0.5, rated_sped=92))
    assert [s.split(" ")[0] for s in found] == ["gapp", "rated_sped"]


SETTINGS = [
    ("load.inertia", '"load.inertia": ', "a key, an equals sign and a value"),
    ("load.inertai=1", "load.inertai=1: ", "did you mean load.inertia?"),
    ("gap=2", "gap=2: ", "it was set before (shaft.gap=1); keep one of the two."),
]


@pytest.mark.parametrize(("setting", "subject", "reason"), SETTINGS, ids=lambda v: str(v)[:24])
def test_one_sentence_from_a_setting(setting, subject, reason):
    (sentence,) = sentences(lambda: Drive(**GOOD).with_settings(["shaft.gap=1", setting]))
    assert sentence.startswith(subject)
    assert reason in sentence


def test_rated_torque_power_and_speed_agree_within_what_a_data_sheet_rounds():
    crane = Drive.load("crane-4amtkf")  # 2.2 kW at 880 rpm, 23.87 N m
    assert crane.replace(rated_torque="24 N*m").rated_torque == 24.0
    assert crane.replace(rated_power=None, rated_torque=30).rated_torque == 30.0
    with pytest.raises(InputError, match=r"rated_torque = 30 N\*m: with the rated speed .* 2200 W"):
        crane.replace(rated_torque=30)
    rated = 2200.0 / (880.0 * math.pi / 30.0)
    for off in (-0.049, 0.049):
        assert crane.replace(rated_torque=(1.0 + off) * rated).rated_torque == (1.0 + off) * rated
    for off in (-0.051, 0.051):
        with pytest.raises(InputError, match="agree within 5 %"):
            crane.replace(rated_torque=(1.0 + off) * rated)


@pytest.mark.parametrize("name", [name for name, p in PARAMETERS.items() if p.unit])
def test_no_number_of_a_drive_is_beyond_what_physics_can_square(name):
    for huge in (1e308, -1e308):
        with pytest.raises(InputError):
            Drive(**GOOD | {name: huge})
