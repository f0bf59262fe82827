"""`softstart init`: answers, files and refusals."""

from __future__ import annotations

import io
import math
import re
import signal
import subprocess
import sys
import tomllib
import types

import pytest

from softstart import DataSheet, Drive
from softstart.cli import asking

ANSWERS = [
    "gantry", "", "travel", "3", "1430", "0.0119", "0.0066", "", "2.2", "", "2.6", "2 ms", "1500", "0",
    "31.5", "0.94", "25 N*m/arcmin", "15", "55", "900",
    "", "12 t", "315", "", "", "", "1.2", "", "", "", "", "1.6 kN*m", "",
]  # fmt: skip
POWER = "rated power in kW, as 3 [by rated torque]: "
SLEWING = {
    "load.machine": "rotor", "motor.rated_power": "15", "motor.rated_speed": "1460", "motor.inertia": "0.09",
    "motor.starting_torque": "240", "gear.ratio": "38", "gear.efficiency": "1", "gear.stiffness": "1.1e6",
    "gear.backlash": "8", "load.inertia": "290", "load.friction": "900",
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
    typed()  # without a terminal it asks for nothing
    code, out, err = run("init")
    assert (code, out) == (2, "")
    for missing in ("[load] machine", "[motor] rated_power", "[motor] rated_speed", "[motor] inertia"):
        assert f"{missing} is missing" in err
    nothing_left()
    typed(*ANSWERS[:5])
    code, out, said = run("init", "--ask", "--out", "mine.toml")
    assert (code, out) == (2, "")
    assert "the answers end before [motor] inertia (inertia of the motor's own rotor)" in said
    assert "--set motor.inertia=" in said
    assert "What was answered is kept in mine.sheet.toml; the same command goes on from there." in said


@pytest.mark.parametrize("at", [1, 4, 9, 20, len(ANSWERS) - 1])
def test_an_interrupted_dialog_goes_on_where_it_was(run, typed, place, at):
    """Wherever it ends, by the same command; nothing is asked twice."""
    typed(*ANSWERS)
    whole = run("init", "--ask")
    assert not list(place.glob("softstart-init*")), "what is printed leaves no file"
    typed(*ANSWERS[:at])
    begun = run("init", "--ask", "--out", "mine.toml")
    typed(*ANSWERS[at:])
    code, _, said = run("init", "--ask", "--out", "mine.toml")
    assert (begun.code, code) == (2, 0)
    assert (place / "mine.toml").read_text() == whole.out
    assert "name of the drive" not in said
    assert (begun.err + said).count("answers are taken up from mine.sheet.toml") == 1
    kept = DataSheet.load("mine.sheet.toml")  # the answers are the data sheet, to edit and to read again
    assert kept.drive_toml() == whole.out


def test_answers_are_gone_back_to_and_taken_away(run, typed):
    typed(*ANSWERS)
    right = run("init", "--ask").out
    # a wrong power is corrected two questions later; Enter keeps the speed; a wrong lag is taken away
    wrong = [*ANSWERS[:3], "30", *ANSWERS[4:5], "<", "back", "3", "", *ANSWERS[5:]]
    typed(*wrong)
    code, out, said = run("init", "--ask")
    assert (code, out) == (0, right)
    assert "rated power in kW, as 3 [30 kW, - for none]: " in said
    typed(*ANSWERS[:7], "9", "<", "-", *ANSWERS[8:])
    assert run("init", "--ask").out == right


def test_what_contradicts_is_asked_again_and_nothing_is_lost(run, typed):
    """A ratio turned round: the drive cannot move; the sentence names the ratio, which is asked again."""
    typed(*ANSWERS)
    right = run("init", "--ask").out
    inverted = [*ANSWERS[:14], "0.0317", *ANSWERS[15:]]
    typed(*inverted)
    code, out, said = run("init", "--ask")
    assert (code, out) == (2, "")
    assert "Is [gear] ratio inverted" in said
    typed("", "31.5", "")  # starting torque, ratio, torque of the load
    assert run("init", "--ask")[:2] == (0, right)


def test_a_file_that_is_not_of_answers_is_left_alone(run, typed, place):
    (place / "mine.sheet.toml").write_text("# my own\n")
    typed(*ANSWERS)
    code, out, err = run("init", "--ask", "--out", "mine.toml")
    assert (code, out) == (2, "")
    assert "there is such a file already" in err
    assert (place / "mine.sheet.toml").read_text() == "# my own\n"


@pytest.mark.slow  # a process of its own
def test_an_interrupt_loses_nothing(place):
    with subprocess.Popen(
        [sys.executable, "-m", "softstart", "init", "--ask", "--out", "mine.toml"], cwd=place, text=True,
        stdin=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as dialog:  # fmt: skip
        dialog.stdin.write("\n".join(ANSWERS[:6]) + "\n")
        dialog.stdin.flush()
        said = ""
        while "brake, fan and coupling" not in said and dialog.poll() is None:
            said += dialog.stderr.read(1)
        dialog.send_signal(signal.SIGINT)
        said += dialog.stderr.read()  # what the reader holds already too; `communicate` would lose that
        assert dialog.wait(timeout=120) == 130
    assert "what was answered is kept in mine.sheet.toml; the same command goes on from there" in said
    assert 'inertia = "0.0119 kg*m^2"' in (place / "mine.sheet.toml").read_text()


def test_an_example_of_the_template_is_no_data(run, place):
    """Unchanged it is refused, with what is missing; and so by every command that takes a data sheet."""
    template = run("init", "--template").out
    (place / "sheet.toml").write_text(template)
    for command in ("init", "compare"):
        code, out, err = run(command, "sheet.toml")
        assert (code, out) == (2, "")
        for missing in ("[load] machine", "[motor] rated_power", "[motor] rated_speed", "[motor] inertia"):
            assert f"{missing} is missing" in err
    assert DataSheet.TABLES
    assert tomllib.loads(template) == {table.name: {} for table in DataSheet.TABLES if table.name}


def test_the_template_is_a_sheet_that_can_be_filled_in(run, place, as_json):
    """Every example of a travel drive, but what others say already."""
    others = re.compile(r"# (radius|rise|elastic_frequency|length) .*(wheel or|rise|oscillate)")
    filled = "".join(
        line.removeprefix("# ") + "\n"
        for line in run("init", "--template").out.splitlines()[2:]
        if not re.search(r"only for (hoist|belt)(;|$)", line) and not others.match(line)
    ).replace("[rope]", "")
    (place / "sheet.toml").write_text(filled)
    found, sheet = as_json("init", "sheet.toml"), DataSheet.load("sheet.toml")
    assert found["data_sheet"]["machine"] == "travel"
    assert found["drive"]["load_inertia"] == sheet.drive.J2
    half = run("init", "sheet.toml", "--set", "load.mass=6000 kg", "--set", "load.friction=0").out
    assert Drive.from_toml(half).Mc < 0.51 * sheet.drive.Mc


# as typed, and by hand J2, c, gap, torque against forward motion
TROLLEY = {
    "load.machine": "trolley", "motor.rated_power": "3", "motor.rated_speed": "1410",
    "motor.inertia": "0.0062", "gear.ratio": "38.1", "gear.efficiency": "95",
    "gear.stiffness": "35 kN*m/rad", "gear.backlash": "9",
    "load.mass": "6.5 t", "load.diameter": "315", "load.slope": "3 %", "limits.output_torque": "1.6 kN*m",
}  # fmt: skip
UPHILL = 6500 * 9.80665 * (0.03 + 0.008) / math.sqrt(1 + 0.03**2) * 0.1575
BELT = {
    "load.machine": "belt conveyor", "motor.rated_power": "75", "motor.rated_speed": "1485",
    "motor.inertia": "0.9", "gear.ratio": "25", "gear.efficiency": "0.94", "gear.stiffness": "400 N*m/arcmin",
    "gear.backlash": "10", "load.mass": "12 t", "load.radius": "0.4", "load.torque": "7000",
}  # fmt: skip
LIFTED = 7000 + 0.02 * 12000 * 9.80665 * 0.4
USUAL = {"motor.rated_power": "kW", "motor.rated_speed": "rpm", "gear.backlash": "arcmin",
         "load.diameter": "mm", "gear.efficiency": "%"}  # fmt: skip


@pytest.mark.parametrize(
    ("typed", "by_hand"),
    [
        (SLEWING, (290 / 38**2, 1.1e6 / 38**2, math.radians(8 / 60) * 38, 900 / 38)),
        (TROLLEY, (6500 * 0.1575**2 / (38.1**2 * 0.95), 35e3 / (38.1**2 * 0.95), math.radians(9 / 60) * 38.1,
                   UPHILL / (38.1 * 0.95))),
        (BELT, (12000 * 0.16 / (625 * 0.94), 400 * 60 * 180 / math.pi / (625 * 0.94),
                math.radians(10 / 60) * 25, LIFTED / (25 * 0.94))),
    ],
    ids=["slewing crane", "trolley uphill", "inclined belt"],
)  # fmt: skip
def test_a_machine_is_the_same_by_every_way_in(run, monkeypatch, place, typed, by_hand):
    """Prompt, --set, data sheet given to a command, form, and Python."""
    asks = []
    question = asking.prompt_text
    monkeypatch.setattr(asking, "prompt_text", lambda p, *rest: asks.append(p) or question(p, *rest))
    dialog = types.SimpleNamespace(isatty=lambda: True, readline=lambda: f"{typed.get(asks[-1].path, '')}\n")
    monkeypatch.setattr(sys, "stdin", dialog)
    assert run("init", "--out", "asked.toml").code == 0

    def unit(path: str) -> str:
        share = path == "gear.efficiency" and float(typed[path]) <= 1.0
        return f" {USUAL[path]}" if path in USUAL and typed[path].isdecimal() and not share else ""

    written = {path: text + unit(path) for path, text in typed.items()}
    if "load.torque" in written:  # which the prompt and the form ask for beside the friction
        written["load.friction"] = "0"
    settings = [word for path, text in written.items() for word in ("--set", f"{path}={text}")]
    assert run("init", *settings, "--out", "set.toml").code == 0
    sheet = DataSheet(**{p.name: written[p.path] for p in DataSheet.PARAMETERS.values() if p.path in written})
    (place / "sheet.toml").write_text(sheet.to_toml())
    pytest.importorskip("nicegui")
    from nicegui import Client
    from nicegui.page import page

    from softstart.page.data_sheet_panel import DataSheetPanel
    from softstart.page.session import Session

    with Client(page("/never-opened")) as client:
        panel = DataSheetPanel(Session(controllers=["direct"]), "A")
        for name, field in panel._fields.items():
            p = DataSheet.PARAMETERS[name]
            field.value = sheet.machine if p.choices else typed.get(p.path, "")
        (place / "form.toml").write_text(panel.sheet().drive_toml())
        client.delete()
    drives = {name: Drive.load(f"{name}.toml") for name in ("asked", "set", "sheet", "form")}
    assert drives["sheet"] == sheet.drive
    assert (place / "form.toml").read_text() == (place / "set.toml").read_text() == sheet.drive_toml()
    for drive in drives.values():
        assert (drive.J2, drive.c, drive.gap, drive.Mc) == pytest.approx(by_hand, rel=1e-5)
        assert drive.assumed == sheet.drive.assumed
        assert drive.limits.output_torque == sheet.permissible_output_torque


def test_the_form_speaks_of_the_unit_that_it_reads():
    """Beside a word in place of a speed: a bare number is in rpm there."""
    pytest.importorskip("nicegui")
    from nicegui import Client
    from nicegui.page import page

    from softstart.page.data_sheet_panel import data_sheet_field

    with Client(page("/never-opened")) as client:
        for name, unit in (
            ("rated_speed", "rpm"),
            ("backlash", "arcmin"),
            ("diameter", "mm"),
            ("mass", "kg"),
        ):
            field = data_sheet_field(DataSheet.PARAMETERS[name])
            field.value = "fast"
            notes = [one.text for one in field.parent_slot.parent.descendants() if hasattr(one, "text")]
            assert any(f"or as a bare number in {unit}" in str(note) for note in notes), name
        client.delete()


def test_a_setting_of_a_data_sheet_is_made_at_its_own_part(run, place):
    (place / "sheet.toml").write_text(DataSheet.from_settings(SLEWING | UNITS).to_toml())
    more = ("--set", "load.inertia=580", "--set", "gear.backlash=16 arcmin", "--set", "load_torque=20")
    code, out, err = run("simulate", "sheet.toml", "--controller", "direct", *more)
    assert (code, "is a data sheet" in err) == (0, True)
    assert "J2 = 0.401662 kg m2, Mc = 20 N m" in out
    assert "gap = 608 arcmin" in out
    assert "assumed: damping ratio 0.02" in out
    assert "assumed:" not in run("simulate", "sheet.toml", "--controller", "direct", "--set", "damping=1").out
    code, _, err = run("simulate", "sheet.toml", "--controller", "direct", "--set", "gear.backlash=16")
    assert (code, 'write "16 arcmin"' in err) == (2, True)


@pytest.fixture
def unknown(place):
    """A data sheet without any stiffness."""
    settings = {path: text for path, text in (SLEWING | UNITS).items() if path != "gear.stiffness"}
    (place / "sheet.toml").write_text(DataSheet.from_settings(settings).to_toml())


@pytest.mark.usefixtures("unknown")
@pytest.mark.parametrize(
    "also", ["shaft.elastic_frequency=8 Hz", "gear.stiffness=1.1e6", "shaft.stiffness=700"]
)
def test_an_unknown_stiffness_is_compared_at_both_ends(run, also):
    """Until one is given: in the sheet, or as that of the drive."""
    compare = ("compare", "sheet.toml", "--controllers", "direct")
    code, out, _ = run(*compare)
    assert (code, "No stiffness is known." in out) == (0, True)
    assert "known to be at 30 Hz: Pareto-optimal direct" in " ".join(out.split())
    out = run(*compare, "--set", also).out
    assert "stiffness is known" not in out
    assert "elastic frequency" not in out


@pytest.mark.slow  # starts of all strategies at both ends
@pytest.mark.usefixtures("unknown")
def test_init_says_how_the_choice_depends_on_an_unknown_stiffness(run):
    code, out, err = run("init", "sheet.toml", "--out", "mine.toml")
    assert code == 0
    assert "softstart: For both ends: Pareto-optimal" in err
    assert "mine.toml is written: load " in out
    assert "What next: softstart compare mine.toml" in " ".join(out.split())
    assert float(Drive.load("mine.toml").soft.Omega) == pytest.approx(6.0 * math.pi, rel=1e-4)  # 3 Hz
    assert Drive.load("mine.toml").assumed.startswith("elastic frequency 30 Hz")


@pytest.mark.slow
@pytest.mark.usefixtures("unknown")
def test_a_report_says_how_the_choice_depends_on_an_unknown_stiffness(run, place):
    found = run("report", "sheet.toml", "--controllers", "direct,ramp", "--budget", "0", "--out", "r.html")
    assert "No stiffness is known." in found.out
    text = (place / "r.html").read_text().replace("\N{NO-BREAK SPACE}", " ")
    assert "Strategies are set up for the stiff end, elastic frequency 30 Hz" in text
    assert "The choice" in text
