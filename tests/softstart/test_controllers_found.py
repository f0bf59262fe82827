"""Finding controllers and entry points, plain controllers, and what happens when one misbehaves."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from softstart import (
    Command,
    Drive,
    InputError,
    Measured,
    PlainController,
    Sensor,
    SimulationError,
    plugins,
    simulate,
)
from softstart.controller import (
    controller_class,
    controller_names,
    make_controller,
    ready_controller_names,
)

CRANE = Drive.load("crane-4amtkf")


def test_the_strategies_are_found() -> None:
    """All but those that need something given run at once, each under its own name."""
    names, ready = set(controller_names()), set(ready_controller_names())
    assert names - ready == {"profile"}
    assert {"direct", "acceleration-delay", "current-limit-feedback", "s-curve"} <= ready
    assert all(controller_class(name).name == name for name in names)


LOOSE = """
from softstart import Command, PlainController
class Mine(PlainController):
    name = "mine"
    def step(self, measured, state):
        return Command(62.0)
class Lazy(PlainController):
    name = "lazy"
class Other: pass
"""


PLAIN_FIELDS = """
from dataclasses import dataclass
from softstart import Command, PlainController
from softstart.controller import parameter
@dataclass(frozen=True)
class Rise(PlainController):
    rise: float = 0.05
    wait: float = parameter("s", "time before it")
    def step(self, measured, state):
        return Command(62.0)
"""


def test_a_plain_field_has_no_unit_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "plain.py"
    path.write_text(PLAIN_FIELDS, encoding="utf-8")
    made: Any = make_controller(str(path), {"rise": "0.02", "wait": "20 ms"})
    assert (made.rise, made.wait) == (0.02, 0.02)
    for value in ("20 ms", "soon", float("nan")):
        with pytest.raises(InputError, match=r"rise = .*no unit; give a bare number.*parameter\(unit,"):
            make_controller(str(path), {"rise": value})
    with pytest.raises(InputError, match=r"wait = .*m is a length"):
        make_controller(str(path), {"wait": "20 m"})


@pytest.fixture
def loose(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(LOOSE, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("{}:Min", 'did you mean "Mine"'),
        ("{}:Other", "derive the class"),
        ("{}:Lazy", "still lacks step"),
        ("{}", "say which class"),
        ("nowhere.py:Mine", "nowhere.py: there is no such file"),
        ("dirct", 'did you mean "direct"'),
        ("", "no controller of this name"),
    ],
)
def test_wrong_names(loose: Path, name: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        make_controller(name.format(loose))
    assert len(caught.value.sentences) == 1
    assert words in caught.value.sentences[0]


def test_a_file_that_does_not_run(tmp_path: Path) -> None:
    path = tmp_path / "broken.py"
    path.write_text("1/0", encoding="utf-8")
    with pytest.raises(InputError, match="does not run: ZeroDivisionError"):
        make_controller(f"{path}:Mine")


@pytest.mark.parametrize(
    ("answer", "error", "words"),
    [
        (Command(float("nan")), SimulationError, "NaN or with a past instant"),
        (Command(1.0, 0.0), SimulationError, "NaN or with a past instant"),
        (None, InputError, "answer with Command"),
    ],
)
def test_a_controller_that_answers_nonsense(answer: object, error: type[Exception], words: str) -> None:
    class Nonsense(PlainController):
        name = "nonsense"

        def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
            return answer  # type: ignore[return-value]

    with pytest.raises(error, match=words):
        simulate(CRANE, Nonsense())


def test_a_controller_that_fails() -> None:
    class Fails(PlainController):
        name = "fails"

        def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
            raise RuntimeError("out of ideas")

    with pytest.raises(
        SimulationError, match=r"Fails failed at t = 0 s in .*line \d+ \(RuntimeError: out of ideas\)"
    ):
        simulate(CRANE, Fails())


def test_what_is_not_declared_is_not_seen() -> None:
    seen: list[Measured] = []

    class Blind(PlainController):
        name = "blind"

        def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
            seen.append(measured)
            return Command(62.0, measured.time + 0.01)

    class Sighted(Blind):
        sensors = Sensor.SHAFT_TORQUE | Sensor.LOAD_SPEED | Sensor.STAGE

    simulate(CRANE, Blind(), until=0.05)
    assert all(m.shaft_torque != m.shaft_torque and m.load_speed != m.load_speed for m in seen)
    assert all(m.stage != m.stage for m in seen)
    seen.clear()
    run = simulate(CRANE, Sighted(), until=0.05)
    states = run.at([m.time for m in seen])
    assert [m.shaft_torque for m in seen] == pytest.approx(states["T"], abs=1e-9)
    assert [m.load_speed for m in seen] == pytest.approx(states["w2"], abs=1e-12)
    contact = run.first_contact
    assert contact in [m.time for m in seen]  # asked at the very instant of contact


@pytest.mark.slow
def test_a_compiled_step_notices_a_change_in_what_it_calls(tmp_path):
    (tmp_path / "helper_of_a_step.py").write_text(
        "from numba import njit\n\n@njit(cache=True)\ndef answer():\n    return 10.0\n"
    )
    (tmp_path / "step_with_helper.py").write_text(
        "import numpy as np\nfrom softstart.controller.compiled import compiled_step, TORQUE, ASK_AGAIN\n"
        "from helper_of_a_step import answer\n\n"
        "@compiled_step\ndef step(parameters, measured, state, command):\n"
        "    command[TORQUE] = answer()\n    command[ASK_AGAIN] = 1.0\n\n"
        "command = np.zeros(3)\nstep(np.zeros(1), np.zeros(7), np.zeros(0), command)\n"
        "print(command[TORQUE])\n"
    )

    def run() -> str:
        done = subprocess.run(
            [sys.executable, "step_with_helper.py"], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    # __main__ is compiled from its file too, and kept beside it
    assert run() == "10.0"
    helper = tmp_path / "helper_of_a_step.py"
    helper.write_text(helper.read_text().replace("10.0", "25.0"))
    later = time.time() + 5.0
    os.utime(helper, (later, later))
    assert run() == "25.0"


TABLE = '[tool.softstart.entry-points."softstart.test-group"]\nown = "math:pi"\n'


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ('[project]\nname = "softstart"\n' + TABLE, ["own"]),
        ('[project]\nname = "another"\n' + TABLE, []),  # above an installed package
        (None, []),
    ],
)
def test_a_checkout_registers_what_its_project_file_names(tmp_path, monkeypatch, request, text, names):
    request.addfinalizer(plugins.registered.cache_clear)
    plugins.registered.cache_clear()
    if text is not None:
        (tmp_path / "pyproject.toml").write_text(text)
    monkeypatch.setattr(plugins, "CHECKOUT", tmp_path / "pyproject.toml")
    assert list(plugins.registered("softstart.test-group")) == names
