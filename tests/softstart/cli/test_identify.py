"""softstart identify: a log becomes a drive file; bad input is one sentence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tests.softstart.test_identification import TRUTH

from softstart import Drive
from softstart.identification.planning import made_up_log


def test_the_command_writes_a_drive_that_compare_takes(run, tmp_path: Path) -> None:
    log = made_up_log(TRUTH, "two levels, then reverse", log_period=2e-3, ripple=1.0, seed=3)
    guess = TRUTH.replace(gap=0.2, stiffness=200, load_inertia=0.4, damping=0.9)
    table = np.column_stack([log.time, log.torque, log.values])
    np.savetxt(
        tmp_path / "a.csv", table, delimiter=",", header="time [s],torque [N*m],angle [rad]", comments=""
    )
    (tmp_path / "guess.toml").write_text(guess.to_toml(), encoding="utf-8")
    line = ["identify", str(tmp_path / "a.csv"), "--drive", str(tmp_path / "guess.toml")]
    result = run(*line, "--torque-is", "demand", "--restarts", "3", "--out", str(tmp_path / "found"))
    assert result.code == 0, result.err
    assert "shaft.gap" in result.out
    assert "7 of 7 parameters are told" in result.out
    drive = Drive.load(tmp_path / "found" / "drive.toml")
    assert drive.gap == pytest.approx(0.08, rel=0.03)
    assert drive.source.startswith("identified from a.csv")
    kept = json.loads((tmp_path / "found" / "identification.json").read_text(encoding="utf-8"))
    assert {one["name"] for one in kept["estimates"]} >= {"gap", "stiffness", "load_inertia"}
    written = {path.name for path in (tmp_path / "found").iterdir()}
    assert written >= {"report.md", "logs.svg", "residuals-1.csv"}


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        (["identify", "--drive", "crane-4amtkf"], "Missing argument 'LOG...'"),
        (["identify", "a.csv"], "Missing option '--drive'"),
        (["plan"], "Missing argument 'DRIVE'"),
        (["identify", "nowhere.csv", "--drive", "crane-4amtkf"], "there is no such file"),
        (
            ["identify", "a.csv", "--drive", "crane-4amtkf", "--torque-is", "guess"],
            "'--torque-is': 'guess' is not one of 'measured', 'demand'.",
        ),
        (
            ["plan", "crane-4amtkf", "--set", "load.kind=reactive", "--wanted", "gpa"],
            '--wanted = "gpa": it is no parameter that this plan can tell; did you mean gap?',
        ),
        (
            ["identify", "a.csv", "--drive", "crane-4amtkf", "--columns", "torque="],
            '--columns "torque=": write a key, an equals sign and a value, as speed=n_act.',
        ),
    ],
)
def test_the_command_refuses_in_one_sentence(run, line: list[str], sentence: str) -> None:
    result = run(*line)
    assert result.code == 2
    assert sentence in result.err
