"""Running the command line in this process and in its own."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from softstart.cli import main
from softstart.cli.running import COMPILING

CONTROLLERS = """
from softstart import Command, PlainController, Sensor
from softstart.controller import parameter
from dataclasses import dataclass

class Good(PlainController):
    name = "own"
    summary = "half the torque, then all of it"
    def step(self, measured, state):
        return Command(31.0 if measured.time < 0.1 else 62.0, measured.time + 0.01)

@dataclass(frozen=True)
class Needy(PlainController):
    share: float = parameter("1", "share of the starting torque", "one half")
    def step(self, measured, state):
        return Command(62.0 * (self.share or 0.5), measured.time + 0.01)

class Chatty(PlainController):
    def step(self, measured, state):
        print("this belongs to standard error")
        return Command(62.0)

class Raises(PlainController):
    def step(self, measured, state):
        return Command(1.0 / (measured.time * 0.0))

class Leaves(PlainController):
    def step(self, measured, state):
        raise SystemExit(7)
"""

DRIVE = """
name = "a drive of my own"
[motor]
inertia = 0.035
starting_torque = "62 N*m"
rated_speed = "880 rpm"
[shaft]
stiffness = 368.465
gap = 0.5
[load]
inertia = 0.175
torque = 7.16
"""


class Ended(NamedTuple):
    code: int
    out: str
    err: str


@pytest.fixture
def place(tmp_path, monkeypatch):
    """An empty folder that is the current one, with some files to use."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(CONTROLLERS)
    (tmp_path / "good.toml").write_text(DRIVE)
    (tmp_path / "wrong.toml").write_text(
        DRIVE.replace('"62 N*m"', '"62 N"').replace("gap = 0.5", "gap = nan")
    )
    (tmp_path / "long.csv").write_text("time,torque\n0,40\n30,40\n60,62\n")
    (tmp_path / "folder").mkdir()
    return tmp_path


@pytest.fixture
def run(place, capfd):
    """softstart ARGUMENTS in this process; what is compiled in it depends on the tests before."""

    def go(*arguments: str) -> Ended:
        capfd.readouterr()
        code = main(list(arguments))
        out, err = capfd.readouterr()
        return Ended(code, out, err.replace(f"softstart: {COMPILING}\n", ""))

    return go


@pytest.fixture
def done(run):
    """What softstart ARGUMENTS prints, which has nothing to complain about."""

    def go(*arguments: str) -> str:
        code, out, err = run(*arguments)
        assert (code, err) == (0, "")
        return out

    return go


@pytest.fixture
def as_json(done):
    """What softstart ARGUMENTS --json tells; there is no NaN and no infinity in it."""

    def go(*arguments: str) -> Any:
        return json.loads(done(*arguments, "--json"), parse_constant=pytest.fail)

    return go


@pytest.fixture
def refused(run, place):
    """What softstart ARGUMENTS says of bad input: no output, one sentence, no file left.

    Several mistakes are numbered sentences below a line that counts them.
    """

    def go(*arguments: str, says: Sequence[str] = (), mistakes: int = 1, prints: bool = False) -> str:
        before = snapshot(place)
        code, out, err = run(*arguments)
        assert (code, out if not prints else "") == (2, "")
        first, *rest = err.splitlines()
        assert first.startswith("softstart: ")
        assert err.endswith((".\n", "?\n"))
        assert "Traceback" not in err
        for words in says:
            assert words in err
        if mistakes == 1:
            assert rest == []
        else:
            assert first == f"softstart: {mistakes} errors:"
            assert [line.split(". ")[0].strip() for line in rest] == [str(1 + k) for k in range(mistakes)]
        assert snapshot(place) == before
        return err

    return go


@pytest.fixture
def command():
    """What starts softstart in a process of its own."""
    return sys.executable, "-c", "import sys; from softstart.cli import main; sys.exit(main())"


def snapshot(folder: Path) -> set[str]:
    """All files below a folder, caches of Python aside."""
    found = (os.path.relpath(path, folder) for path in folder.rglob("*"))
    return {name for name in found if "__pycache__" not in name}


@pytest.fixture
def nothing_left(place):
    """A check that no file was added or removed since the test began."""
    before = snapshot(place)

    def check() -> None:
        assert snapshot(place) == before

    return check
