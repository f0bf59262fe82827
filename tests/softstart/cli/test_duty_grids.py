"""`sweep` and `tune` over a duty: of a file, or that of the machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from softstart import Drive, Duty, run_duty

JOG = '[[duty]]\ndo = "jog"\ntime = 0.15\n'
AXIS = ("--axis", "shaft.gap=0.1,0.2")


@pytest.fixture
def machines(place: Path) -> Path:
    """A drive with a duty, and the duty alone, beside the drive without one."""
    (place / "jog.toml").write_text(JOG)
    conveyor = Drive.load("conveyor-11kw").to_toml()
    (place / "belt.toml").write_text(conveyor)
    (place / "jogged.toml").write_text(f"{conveyor}\n{JOG}")
    return place


def test_the_figures_of_a_grid_are_those_of_run_duty(as_json: Any, machines: Path) -> None:
    grid = ("--controller", "ramp", *AXIS, "--stop", "coast", "--cycles", "3", "--workers", "1")
    of_file = as_json("sweep", "belt.toml", *grid, "--duty", "jog.toml")
    of_machine = as_json("sweep", "jogged.toml", *grid, "--duty")
    assert of_file["cells"] == of_machine["cells"]
    assert of_file["duty"] == "jog; stops by coast; 3 cycles"
    assert of_file["status"] == {"CARRIED_OUT": 2}
    drive = Drive.load("belt.toml")
    for cell in of_file["cells"]:
        run = run_duty(drive.replace(gap=cell["gap"]), "ramp", Duty.load("jog.toml"), stop="coast", cycles=3)
        assert (cell["k_dyn"], cell["cycle_time"]) == (run.k_dyn, run.cycle_time)
    assert as_json("sweep", "jogged.toml", *grid[:-6], "--workers", "1")["duty"] is None


def test_what_is_shown_speaks_of_duties(done: Any, machines: Path) -> None:
    out = done("sweep", "jogged.toml", "--controller", "ramp", *AXIS, "--duty", "--workers", "1")
    for words in ("Duty: jog; 2 cycles", "Over all duties", "Each duty", "All duties were carried out."):
        assert words in out
    assert "2 duties; " in out
    assert "start" not in out.partition("Each duty")[2].replace("start time", "")


def test_a_table_in_two_parts_has_all_axes_in_both(done: Any, machines: Path) -> None:
    axes = (*AXIS, "--axis", "load.inertia=0.2,0.3")
    out = done("sweep", "belt.toml", "--controller", "ramp", *axes, "--workers", "1", "--duty", "conveyor")
    (first, second, *_) = (part.split("\n\n")[0].splitlines() for part in out.split("Each duty")[1:])
    assert [line.split()[:2] for line in first[3:]] == [line.split()[:2] for line in second[3:]]


@pytest.mark.slow
def test_a_tuning_names_the_duty(done: Any, machines: Path) -> None:
    small = ("--gaps", "1x", "--inertias", "1x", "--restarts", "1", "--only", "robust", "--workers", "1")
    asked = ("tune", "jogged.toml", "--controller", "ramp", "--free", "time=0.02:0.03", *small, "--duty")
    out = done(*asked, "--cycles", "1")
    assert "minimised over the duty jog; 1 cycle" in " ".join(out.split())
    assert "duties." in out


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("sweep belt.toml --axis shaft.gap=0.1,0.2 --controller ramp --duty", "duty is missing"),
        (
            "sweep belt.toml --axis shaft.gap=0.1,0.2 --controller ramp --stop coast",
            '--stop = "coast": a single start',
        ),
        (
            "sweep jogged.toml --axis shaft.gap=0.1,0.2 --controller ramp --until 1 --duty",
            "--until = 1.0: the steps",
        ),
        ("sweep belt.toml --axis shaft.gap=0.1,0.2 --controller ramp --duty none.toml", "no such file"),
        (
            "sweep jogged.toml --axis shaft.gap=0.1,0.2 --controller ramp --stop brake --duty",
            "the machine has no brake",
        ),
        ("tune belt.toml --controller ramp --duty", "duty is missing"),
        ("tune jogged.toml --controller ramp --optimum --duty", "leave it out for a duty"),
        ("tune jogged.toml --controller ramp --metric k_dyn_step_2 --duty", "did you mean k_dyn_step_1?"),
    ],
)
def test_refused(line: str, says: str, refused: Any, machines: Path) -> None:
    refused(*line.split(), says=[says])
