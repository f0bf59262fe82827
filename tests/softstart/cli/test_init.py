"""`softstart init`: answers, files and refusals."""

from __future__ import annotations

import io
import math
import sys

import pytest

from softstart import DataSheet, Drive

ANSWERS = [
    "gantry", "", "travel", "3", "1430", "0.0119", "0.0066", "", "2.2", "", "2.6", "2 ms", "1500", "0",
    "31.5", "0.94", "25 N*m/arcmin", "15", "55", "900",
    "", "12 t", "0.1575", "", "1.2", "", "", "", "1.6 kN*m", "",
]  # fmt: skip
POWER = "rated power in kW, as 3 [by rated torque]: "
SLEWING = {
    "load.machine": "rotor", "motor.rated_power": "15", "motor.rated_speed": "1460", "motor.inertia": "0.09",
    "motor.starting_torque": "240", "gear.ratio": "38", "gear.efficiency": "1", "gear.stiffness": "1.1e6",
    "gear.backlash": "8", "load.inertia": "290", "load.torque": "900",
}  # fmt: skip
UNITS = {"motor.rated_power": "15 kW", "motor.rated_speed": "1460 1/min", "gear.backlash": "8 arcmin"}


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
    assert "Assumed: resistance 0.008 of the weight; damping ratio 0.02. What next:" in " ".join(out.split())
    assert err.count(POWER) == 1
    assert "1430 rpm = 149.7 rad/s" in err  # a bare number, echoed
    assert "15 arcmin = 0.004363 rad" in err
    assert "diameter on which the coupling" not in err  # there is no play
    drive = Drive.load("mine.toml")
    assert (drive.name, drive.load_kind) == ("gantry", "reactive")
    assert drive.limits.output_torque == 1600.0
    assert run("simulate", "mine.toml", "--controller", "ramp", "--json").code == 0
    assert "this is the file of a drive already" in run("init", "mine.toml").err
    before = (place / "mine.toml").read_text()
    typed(*ANSWERS)
    code, out, err = run("init", "--ask", "--out", "mine.toml")
    assert (code, out) == (2, "")
    assert "there is such a file already" in err
    assert (place / "mine.toml").read_text() == before


def test_a_wrong_answer_is_asked_again(run, typed):
    typed(*ANSWERS[:3], "3 N", "much", "2,2", *ANSWERS[3:])
    code, out, err = run("init", "--ask")
    assert code == 0
    assert err.count(POWER) == 4
    assert "N is a force, not a power" in err
    assert 'use a decimal point: "2.2"' in err
    typed(*ANSWERS)
    assert run("init", "--ask").out == out


def test_an_end_of_the_answers_names_the_one_that_is_missing(run, typed, nothing_left):
    typed(*ANSWERS[:5])
    code, out, said = run("init", "--ask", "--out", "mine.toml")
    assert (code, out) == (2, "")
    assert "the answers end before [motor] inertia (inertia of the motor's own rotor)" in said
    assert "--set motor.inertia=" in said
    nothing_left()
    typed()  # without a terminal it asks for nothing
    code, out, err = run("init")
    assert (code, out) == (2, "")
    for missing in ("[load] machine", "[motor] rated_power", "[motor] rated_speed", "[motor] inertia"):
        assert f"{missing} is missing" in err


def test_the_template_is_a_sheet_that_can_be_filled_in(run, place, as_json):
    filled = "".join(
        line.removeprefix("# ") + "\n"
        for line in run("init", "--template").out.splitlines()
        if "only for hoist;" not in f"{line};"
    ).replace("[rope]", "")
    (place / "sheet.toml").write_text(filled)
    found, sheet = as_json("init", "sheet.toml"), DataSheet.load("sheet.toml")
    assert found["data_sheet"]["machine"] == "travel"
    assert found["drive"]["load_inertia"] == sheet.drive.J2
    half = run("init", "sheet.toml", "--set", "load.mass=6000 kg", "--set", "load.torque=0").out
    assert Drive.from_toml(half).Mc < 0.51 * sheet.drive.Mc


def test_the_slewing_crane_is_the_same_by_every_way_in(run, typed, place):
    """Prompt, --set, data sheet given to a command, and form."""
    typed("", "", "rotor", "15", "1460", "0.09", "", "240", "", "", "", "", "", "38", "1", "1.1e6", "8", "",
          "", "290", "900", "", "", "", "")  # fmt: skip
    assert run("init", "--ask", "--out", "asked.toml").code == 0
    settings = [word for path, text in (SLEWING | UNITS).items() for word in ("--set", f"{path}={text}")]
    assert run("init", *settings, "--out", "set.toml").code == 0
    (place / "sheet.toml").write_text(DataSheet.from_settings(SLEWING | UNITS).to_toml())
    pytest.importorskip("nicegui")
    from nicegui import Client
    from nicegui.page import page

    from softstart.page.data_sheet_panel import DataSheetPanel
    from softstart.page.session import Session

    with Client(page("/never-opened")) as client:
        panel = DataSheetPanel(Session(controllers=["direct"]), "A")
        for name, p in DataSheet.PARAMETERS.items():
            panel._fields[name].value = SLEWING.get(p.path, "")
        (place / "form.toml").write_text(panel.sheet().drive_toml())
        client.delete()
    for name in ("asked", "set", "sheet", "form"):
        drive = Drive.load(f"{name}.toml")
        by_hand = 290 / 38**2, 1.1e6 / 38**2, math.radians(8 / 60) * 38, 900 / 38
        assert (drive.J2, drive.c, drive.gap, drive.Mc) == pytest.approx(by_hand, rel=1e-12)
        assert drive.assumed == "damping ratio 0.02"


def test_a_setting_of_a_data_sheet_is_made_at_its_own_part(run, place):
    (place / "sheet.toml").write_text(DataSheet.from_settings(SLEWING | UNITS).to_toml())
    more = ("--set", "load.inertia=580", "--set", "gear.backlash=16 arcmin", "--set", "load_torque=20")
    code, out, err = run("simulate", "sheet.toml", "--controller", "direct", *more)
    assert (code, "is a data sheet" in err) == (0, True)
    assert "J2 = 0.401662 kg m2, Mc = 20 N m" in out
    assert "gap = 0.17686 rad" in out
    assert "assumed: damping ratio 0.02" in out
    assert "assumed:" not in run("simulate", "sheet.toml", "--controller", "direct", "--set", "damping=1").out
    code, _, err = run("simulate", "sheet.toml", "--controller", "direct", "--set", "gear.backlash=16")
    assert (code, 'write "16 arcmin"' in err) == (2, True)
