"""Everything that can be wrong with the file of a drive: one sentence a mistake, with file, table and key."""

import json
import os
import re
import time
from pathlib import Path

import pytest
from tests.softstart.drive.conftest import GOOD

from softstart.drive import Drive

GOOD_TOML = Drive(**GOOD).to_toml()


# a line of the good file, what stands there instead, what the sentence begins with, what it says
TOML = [
    ("gap = 0.5", 'gap = "5 m"', '[shaft] gap = "5 m": ', "m is a length"),
    ("gap = 0.5", "gap = 2024-01-01", "[shaft] gap = 2024-01-01: ", "a date is not a quantity"),
    ("gap = 0.5", "", "[shaft] gap is missing: ", 'write for example gap = "0.5 rad"'),
    ("gap = 0.5", "gapp = 0.5", "[shaft] gapp = 0.5: ", "[shaft] has no key gapp; did you mean gap?"),
    ("gap = 0.5", "Gap = 0.5", "[shaft] Gap = 0.5: ", "did you mean gap?"),
    ("gap = 0.5", "gap = 0.5\ninertia = 1", "[shaft] inertia = 1: ", "[motor] inertia or [load] inertia?"),
    ("gap = 0.5", "gap = 0.5\ntarget_speed = 2", "[shaft] target_speed = 2: ", "mean [start] target_speed?"),
    ("gap = 0.5", "gap = 0.5\nshaft_gap = 2", "[shaft] shaft_gap = 2: ", "did you mean gap?"),
    ("gap = 0.5", "gap = 0.5\nJ1 = 2", "[shaft] J1 = 2: ", "did you mean [motor] inertia?"),
    ("gap = 0.5", 'gap = 0.5\nname = "x"', '[shaft] name = "x": ', "name above the first table?"),
    ("gap = 0.5", "gap = 0.5\nqqq = 2", "[shaft] qqq = 2: ", "it has stiffness, damping, gap, contact_law"),
    ("gap = 0.5", "gap = 0.5\ngap = 2", "line ", "not valid TOML (cannot overwrite a value)"),
    ("gap = 0.5", "gap = 0.5 rad", "line 7, column 11, 'gap = 0.5 rad': ", 'in quotes: gap = "0.5 rad"'),
    ("gap = 0.5", "gap = 0,5", "line ", 'use a decimal point: "0.5")'),
    ("gap = 0.5", "gap = 0,5 rad # flanks", "line ", 'use a decimal point: "0.5 rad")'),
    ("gap = 0.5", "gap = 1,500", "line ", 'write "1.500" with a decimal point, or "1500")'),
    ("gap = 0.5", "gap =", "line ", "not valid TOML (invalid value)"),
    ("[load]", "[lode]", "[lode]: ", "did you mean [load]?"),
    ("[load]", "[LOAD]", "[LOAD]: ", "did you mean [load]?"),
    ("[load]", "[load", "line ", "not valid TOML"),
    ("[load]", "[[load]]", 'load = [{"inertia": 0.175', "one table, not a list of tables"),
    ("[load]", "[shaft]", "line ", "not valid TOML"),
    ("[load]", "[clutch]\ntorque = 3\n[load]", "[clutch]: ", "its tables are [motor], [gear], [shaft], "),
    ("[motor]", "gap = 0.5\n[motor]", "gap = 0.5: ", "did you mean [shaft] gap?"),
    ("[motor]", "load_kind = 'active'\n[motor]", 'load_kind = "active": ', "did you mean [load] kind?"),
    ("[motor]", "nam = 'x'\n[motor]", 'nam = "x": ', "did you mean name?"),
    ("[motor]", "colour = 'red'\n[motor]", 'colour = "red": ', "it has name, source, assumed, units, ["),
    ("[motor]", "clutch = 3\n[motor]", "clutch = 3: ", "has no key clutch"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "instead", "subject", "reason"), TOML, ids=lambda v: str(v)[:24])
def test_one_sentence_from_a_file(line, instead, subject, reason, sentences):
    text = "".join(
        instead + "\n" if part.split("  #")[0].strip() == line else part
        for part in GOOD_TOML.splitlines(True)
    )
    assert text != GOOD_TOML
    (sentence,) = sentences(lambda: Drive.from_toml(text, where="my.toml"))
    assert sentence.startswith(f"my.toml: {subject}")
    assert reason in sentence
    (same,) = sentences(lambda: Drive.from_toml(text))
    assert f"my.toml: {same}" == sentence


@pytest.mark.parametrize("table", ["motor", "shaft", "load", "start"])
def test_a_table_that_is_none_is_one_sentence(table, sentences):
    text = f"{table} = 5\n" + re.sub(rf"\[{table}\][^\[]*", "", GOOD_TOML)
    text = text if table != "start" else text.replace("[motor]", "[motor]\nrated_speed = 92")
    if table == "motor":
        text += "\n"
    (sentence,) = sentences(lambda: Drive.from_toml(text))
    assert sentence.startswith(f"{table} = 5: {table} is a table; write [{table}] on a line of its own")


def test_an_empty_file_is_one_sentence(sentences):
    for text in ("", "\n\n", "# nothing but a comment\n"):
        (sentence,) = sentences(lambda text=text: Drive.from_toml(text, where="x.toml"))
        assert sentence.startswith("x.toml: it is empty; a drive file has the tables [motor]")


def test_deep_nesting_is_a_sentence(sentences):
    (sentence,) = sentences(lambda: Drive.from_toml("a = " + "[" * 100_000))
    assert "nested too deeply" in sentence or "not valid TOML" in sentence


def test_a_missing_table_names_each_of_its_keys(sentences):
    text = re.sub(r"\[load\][^\[]*", "", GOOD_TOML)
    assert [s.split(":")[0] for s in sentences(lambda: Drive.from_toml(text))] == [
        "[load] inertia is missing",
        "[load] torque is missing",
    ]


def test_all_mistakes_of_a_file_come_at_once(sentences):
    text = """
        gap = "-2 rad"
        [moter]
        inertia = "5 kg"
        startin_torque = true
        [shaft]
        stiffness = "5 N*m"
        contact_law = "dead zone"
        [load]
        inertia = 0
        torque = -1
        kind = "reactive"
        [start]
        target_speed = "50 Hz"
    """
    found = sentences(lambda: Drive.from_toml(text, where="d.toml"))
    assert [s.removeprefix("d.toml: ").split(":")[0] for s in found] == [
        'gap = "-2 rad"',
        "[moter]",
        "[moter] startin_torque = true",
        '[motor] inertia = "5 kg"',
        '[shaft] stiffness = "5 N*m"',
        '[shaft] contact_law = "dead zone"',
        "[load] inertia = 0",
        '[start] target_speed = "50 Hz"',
        "[load] torque = -1 N*m",
    ]


FILES = [
    ("crane-4amtk", "did you mean crane-4amtkf?"),
    ("Crane-4AMTKF", "did you mean crane-4amtkf?"),
    ("no-such-drive-at-all", "shipped drives are conveyor-11kw, "),
    ("missing.toml", "there is no such file"),
    ("crane-4amtkf.toml", "did you mean crane-4amtkf?"),
    ("mine.tml", "did you mean mine.toml?"),
    ("nowhere/mine.toml", 'there is no directory "nowhere"'),
    ("mine.toml/inner.toml", "there is no directory"),
    ("", "the name of the drive is empty"),
    ("folder", "this is a directory"),
    ("\0", "cannot be the path of a file"),
    ("a" * 5000, "the file cannot be read (File name too long)"),
    ("latin.toml", "the file is not UTF-8 text (line 2)"),
    ("image.toml", "the file is not UTF-8 text (line 1)"),
    ("nul.toml", "not valid TOML"),
    ("empty.toml", "it is empty"),
    (5, "named by text"),
    (b"mine.toml", "named by text"),
    (None, "named by text"),
]


@pytest.mark.parametrize(("path", "reason"), FILES, ids=lambda v: repr(v)[:24])
def test_one_sentence_for_a_file_that_is_none(path, reason, tmp_path, monkeypatch, sentences):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(GOOD_TOML, encoding="utf-8")
    (tmp_path / "folder").mkdir()
    (tmp_path / "latin.toml").write_bytes("\nname = 'Größe'\n".encode("latin-1"))
    (tmp_path / "utf16.toml").write_bytes(GOOD_TOML.encode("utf-16"))
    (tmp_path / "image.toml").write_bytes(b"\x89PNG\r\n\x1a\n")
    (tmp_path / "nul.toml").write_bytes(b"name = \x00")
    (tmp_path / "empty.toml").touch()
    assert Drive.load("utf16.toml") == Drive(**GOOD)  # its mark says what it is
    (sentence,) = sentences(lambda: Drive.load(path))
    assert reason in sentence


def test_a_read_that_fails_is_a_sentence(tmp_path, monkeypatch, sentences):
    def refuse(self):
        raise PermissionError(13, "Permission denied")

    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text("")
    monkeypatch.setattr("pathlib.Path.read_bytes", refuse)
    (sentence,) = sentences(lambda: Drive.load("mine.toml"))
    assert sentence == '"mine.toml": the file cannot be read (Permission denied).'


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no pipes with names")
@pytest.mark.parametrize("kind", ["pipe", "device", "huge"])
def test_what_is_no_ordinary_file_is_refused_at_once(tmp_path, sentences, kind):
    path = tmp_path / "mine.toml"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        with path.open("wb") as stream:
            stream.truncate(3 * 2**30)
    (sentence,) = sentences(lambda: Drive.load(path))
    assert ("MB are read" if kind == "huge" else "no ordinary file") in sentence


HUGE = {
    "a key of 60,000 parts": (".".join(["a"] * 60_000) + " = 1", "nested too deeply"),
    "a table of 60,000 parts": ("[" + ".".join(["a"] * 60_000) + "]", "nested too deeply"),
    "an integer of 5,000 digits": (f"name = 1{'0' * 5000}", "thousands of digits"),
    "a million numbers": ("x = [" + "0," * 1_000_000 + "]", "at most 1"),
    "nested tables": ("name = " + "{a=" * 100 + "1" + "}" * 100, "the name of the drive must be text"),
}


@pytest.mark.parametrize("kind", HUGE)
def test_a_huge_document_is_refused_in_one_short_sentence(sentences, kind):
    text, says = HUGE[kind]
    begun = time.process_time()
    said = sentences(lambda: Drive.from_toml(text))
    assert time.process_time() - begun < 2.0
    assert says in said[0]
    assert max(map(len, said)) < 500


def test_twenty_thousand_unknown_keys_are_counted_and_not_listed(sentences):
    text = "\n".join(f"key{i} = {i}" for i in range(20_000))
    begun = time.process_time()
    said = sentences(lambda: Drive.from_toml(text))
    assert time.process_time() - begun < 5.0
    assert len(said) <= 32
    assert re.fullmatch(r"(\d+) more things are wrong\.", said[-1])
    assert 19_970 <= int(said[-1].split()[0]) <= 19_990
    assert sum(map(len, said)) < 20_000


@pytest.mark.parametrize("name", ["a\tb", "\x1b[2J", "\x00", "\u202eevird"])
def test_a_name_that_steers_the_terminal_is_refused(sentences, name):
    text = Drive.load("crane-4amtkf").replace(name="here").to_toml().replace('"here"', json.dumps(name))
    (sentence,) = sentences(lambda: Drive.from_toml(text))
    assert "has the control character U+" in sentence


def test_a_name_has_room_above_a_figure(sentences):
    crane = Drive.load("crane-4amtkf")
    assert crane.replace(name="x" * 120).name == "x" * 120
    (sentence,) = sentences(lambda: crane.replace(name="x" * 121))
    assert "121 characters, and at most 120" in sentence
