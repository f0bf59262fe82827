"""Every command with its defaults, on every shipped machine and on those that `init` writes.

All but a few of the 130 cells are slow, half an hour of processor time. What is refused for a reason stands
in REFUSED with its sentence.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from softstart import Drive
from softstart.chain.elements import LIBRARY
from softstart.chain.machines import load_machine
from softstart.cli import main
from softstart.drive import library
from softstart.drive.data_sheet import DataSheet

MOTOR = {"motor.rated_power": "11 kW", "motor.rated_speed": "1460 rpm", "motor.inertia": "0.055 kg*m^2"}
GEAR = {"gear.ratio": 25, "gear.stiffness": "1 kN*m/arcmin", "gear.backlash": "8 arcmin"}
MASS = {"load.mass": "5400 kg", "load.radius": "0.25 m"}
SHEETS = {
    "hoist": {**MOTOR, **GEAR, "load.mass": "3000 kg", "load.radius": "0.1 m", "load.reeving": 2},
    "travel": {**MOTOR, **GEAR, **MASS},
    "belt": {**MOTOR, **GEAR, **MASS},
    "rotor": {**MOTOR, **GEAR, "load.inertia": "290 kg*m^2", "load.friction": "900 N*m"},
}
COMMANDS = {
    "compare": "compare {}",
    "simulate": "simulate {} --controller direct",
    "fatigue": "fatigue {}",
    "duty": "duty {} --duty travel-crane --controller ramp",
    "linear": "linear {} --controller state-feedback",
    "optimize": "optimize {}",
    "pareto": "pareto {}",
    "tune": "tune {} --controller shaped",
    "sweep": "sweep {} --controller shaped --axis shaft.gap=1x:2x:2",
    "reduce": "reduce {}",
    "report": "report {} --out report.html",
    "sheet": "sheet {} --controller s-curve",
}
# command and machine, or its class: a word of the sentence
REFUSED = {("fatigue", one): "damping" for one in ("undamped", "crane-4-mass")}
# nothing holds an active load after a stop
REFUSED |= {("duty", one): "runs away" for one in ("undamped", "crane-4-mass", "nordin-servo-60kw")}
CHAINS = LIBRARY.names()
MACHINES = (*library.names(), *SHEETS, *CHAINS)
QUICK = (("fatigue", "crane-4amtkf"), ("sweep", "hoist"), *(("fatigue", machine) for machine in SHEETS))
WITH_DUTY = COMMANDS | {
    "duty": "duty {} --controller ramp",
    "optimize": "optimize {} --start-time 1.2x",
    "plan": "plan {}",
    "tune": "tune {} --controller shaped --duty",
    "sweep": "sweep {} --controller shaped --axis shaft.gap=1x:2x:2 --duty",
}
WITH_DUTY.pop("reduce")  # of a chain
OF_DUTY = """
[brake]
torque = "300 N*m"
opening_delay = "50 ms"
[[duty]]
do = "start"
[[duty]]
do = "stop"
by = "coast"
[shift]
cycles_per_hour = 30
"""
CELLS = [(cell, machine) for cell in COMMANDS for machine in (CHAINS if cell == "reduce" else MACHINES)]


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty folder with the drive files of `init`."""
    monkeypatch.chdir(tmp_path)
    for name, values in SHEETS.items():
        sheet = DataSheet.from_settings({"load.machine": name, **values})
        (tmp_path / f"{name}.toml").write_text(sheet.drive_toml(), encoding="utf-8")


@pytest.mark.parametrize(
    ("cell", "machine"), [pytest.param(*one, marks=() if one in QUICK else pytest.mark.slow) for one in CELLS]
)
@pytest.mark.usefixtures("place")
def test_a_default_works(cell: str, machine: str, capfd: pytest.CaptureFixture[str]) -> None:
    """Exit code 0, or a reason that is listed; no message names an option that was not given."""
    path = f"{machine}.toml" if machine in SHEETS else machine
    one = load_machine(path)
    words = COMMANDS[cell].format(path).split()
    undamped = isinstance(one, Drive) and one.damping == 0.0
    refused = REFUSED.get((cell, "undamped" if undamped else machine))
    code, (out, err) = main(words), capfd.readouterr()
    assert set(re.findall(r"(--[a-z-]+)(?: =|:)", err)) <= set(words), err
    assert (code == 0) if refused is None else (code in (2, 3) and refused in err), err
    if cell in ("optimize", "pareto") and len(one.positions) > 1:  # feedback may be lower
        assert "est fixed profile" in out
        assert not re.search("least K_dyn|optimum", out, re.IGNORECASE), out


@pytest.mark.parametrize(
    "cell",
    [
        pytest.param(one, marks=() if one in ("simulate", "fatigue", "duty") else pytest.mark.slow)
        for one in WITH_DUTY
    ],
)
@pytest.mark.usefixtures("place")
def test_every_command_takes_a_file_with_a_duty(cell: str, capfd: pytest.CaptureFixture[str]) -> None:
    """Of a drive with a brake and a shift; a duty that is not asked for changes nothing."""
    text = Drive.load("conveyor-11kw").to_toml() + OF_DUTY
    Path("braked.toml").write_text(text, encoding="utf-8")
    assert main(WITH_DUTY[cell].format("braked.toml").split()) == 0, capfd.readouterr().err
