"""`softstart init`: answers, files and refusals."""

from __future__ import annotations

import io
import json
import sys

import pytest

from softstart import DataSheet, Drive

ANSWERS = [
    "gantry", "", "travel", "3 kW", "1430 rpm", "0.0119", "0.0066", "2.2", "2.6", "2 ms", "1500", "0",
    "31.5", "0.94", "25 N*m/arcmin", "15 arcmin", "55 mm", "0.9 m",
    "", "12 t", "157.5 mm", "", "1.2", "", "", "",
]  # fmt: skip


@pytest.fixture
def typed(monkeypatch):
    """What is typed on standard input."""

    def go(*lines: str) -> None:
        monkeypatch.setattr(sys, "stdin", io.StringIO("".join(f"{line}\n" for line in lines)))

    return go


def test_answers_make_a_drive_that_every_command_takes(run, typed, place):
    typed(*ANSWERS)
    code, out, err = run("init", "--ask", "--out", "mine.toml")
    assert code == 0
    assert "softstart compare mine.toml" in out
    assert err.count("rated power, as 3 kW: ") == 1
    assert "diameter on which the coupling" not in err  # there is no play
    assert "ropes that carry" not in err  # nor ropes
    drive = Drive.load("mine.toml")
    assert (drive.name, drive.load_kind) == ("gantry", "reactive")
    assert run("simulate", "mine.toml", "--controller", "ramp", "--json").code == 0
    before = (place / "mine.toml").read_text()
    typed(*ANSWERS)
    code, out, err = run("init", "--ask", "--out", "mine.toml")
    assert (code, out) == (2, "")
    assert "there is such a file already" in err
    assert (place / "mine.toml").read_text() == before


def test_a_wrong_answer_is_asked_again(run, typed):
    typed(*ANSWERS[:3], "3 N", "much", "", *ANSWERS[3:])
    code, out, err = run("init", "--ask")
    assert code == 0
    assert err.count("rated power, as 3 kW: ") == 4
    assert "N is a force, not a power" in err
    assert "it is needed" in err
    typed(*ANSWERS)
    assert run("init", "--ask").out == out


def test_a_value_that_is_given_is_not_asked(run, typed):
    typed(*ANSWERS[:2], *ANSWERS[3:])
    code, _, err = run("init", "--ask", "--set", "load.machine=travel")
    assert code == 0
    assert "kind of the machine" not in err


def test_an_end_of_the_answers_names_the_one_that_is_missing(run, typed, nothing_left):
    typed(*ANSWERS[:5])
    code, out, err = run("init", "--ask", "--out", "mine.toml")
    assert (code, out) == (2, "")
    assert "the answers end before [motor] inertia (inertia of the rotor)" in err
    assert "--set motor.inertia=" in err
    nothing_left()


def test_a_sheet_in_a_file(run, place):
    code, out, _ = run("init", "--template")
    assert code == 0
    filled = "".join(
        line.removeprefix("# ") + "\n" for line in out.splitlines() if not line.startswith("# reeving")
    )
    (place / "sheet.toml").write_text(filled)
    code, out, err = run("init", "sheet.toml", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["data_sheet"]["machine"] == "travel"
    sheet = DataSheet.load("sheet.toml")
    assert found["drive"]["load_inertia"] == sheet.drive.J2
    code, out, _ = run("init", "sheet.toml", "--set", "load.mass=6000 kg", "--set", "load.torque=0")
    assert Drive.from_toml(out).Mc < 0.51 * sheet.drive.Mc


def test_without_a_terminal_it_asks_for_nothing(run, typed):
    typed()
    code, out, err = run("init")
    assert (code, out) == (2, "")
    for missing in ("[load] machine", "[motor] power", "[motor] speed", "[motor] inertia"):
        assert f"{missing} is missing" in err
