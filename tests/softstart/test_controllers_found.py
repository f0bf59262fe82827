"""Finding controllers and entry points, plain controllers, and what happens when one misbehaves."""

from __future__ import annotations

import inspect
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import softstart
from softstart import Command, Drive, InputError, PlainController, SimulationError, plugins, simulate
from softstart.chain.two_masses import verify_on_chain
from softstart.controller import Measured, controller_class, make_controller
from softstart.tuning.problem import recipe_of

CRANE = Drive.load("crane-4amtkf")


MINE = """
from dataclasses import dataclass
from softstart import Command, PlainController
from softstart.controller import parameter
@dataclass(frozen=True)
class Rise(PlainController):
    rise: float = 0.05
    wait: float = parameter("s", "time before it")
    def step(self, measured, state):
        return Command(62.0)
class Lazy(PlainController): pass
class Other: pass
"""


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(MINE, encoding="utf-8")
    path.with_name("broken.py").write_text("1/0", encoding="utf-8")
    return path


def test_a_plain_field_has_no_unit_and_says_so(mine: Path) -> None:
    made: Any = make_controller(f"{mine}:Rise", {"rise": "0.02", "wait": "20 ms"})
    assert (made.rise, made.wait) == (0.02, 0.02)
    for value in ("20 ms", "soon", float("nan")):
        with pytest.raises(InputError, match=r"rise = .*no unit; give a bare number.*parameter\(unit,"):
            make_controller(f"{mine}:Rise", {"rise": value})


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mine.py:Ris", 'did you mean "Rise"'),
        ("mine.py:Other", "derive the class"),
        ("mine.py:Lazy", "still lacks step"),
        ("mine.py", "say which class"),
        ("broken.py:Mine", "does not run: ZeroDivisionError"),
        ("nowhere.py:Mine", "nowhere.py: there is no such file"),
        ("dirct", 'did you mean "direct"'),
        ("", "no controller of this name"),
    ],
)
def test_wrong_names(mine: Path, monkeypatch: pytest.MonkeyPatch, name: str, words: str) -> None:
    monkeypatch.chdir(mine.parent)
    with pytest.raises(InputError) as caught:
        make_controller(name)
    assert len(caught.value.sentences) == 1
    assert words in caught.value.sentences[0]


@pytest.mark.parametrize(
    ("answer", "error", "words"),
    [
        (lambda: Command(math.nan), SimulationError, "NaN or with a past instant"),
        (lambda: Command(1.0, 0.0), SimulationError, "NaN or with a past instant"),
        (lambda: None, InputError, "return Command"),
        (
            lambda: Command(1 / 0),
            SimulationError,
            r"Nonsense failed at t = 0 s in .*line \d+ \(ZeroDivisionErr",
        ),
    ],
)
def test_a_controller_that_fails_or_answers_nonsense(
    answer: Callable[[], Any], error: type[Exception], words: str
) -> None:
    class Nonsense(PlainController):
        def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
            return answer()  # type: ignore[no-any-return]

    with pytest.raises(error, match=words):
        simulate(CRANE, Nonsense())


def test_a_torque_alone_is_held_for_a_period_and_keeps_the_state() -> None:
    """Samples are at multiples of the period to the bit; without a period it is refused."""
    seen: list[tuple[float, tuple[float, ...]]] = []

    @dataclass(frozen=True)
    class Held(PlainController):
        initial_state = (3.0,)
        period: float = 0.001

        def step(self, measured: Measured, state: tuple[float, ...]) -> float:
            seen.append((measured.time, state))
            return 30.0 + len(seen) / 8

    run = simulate(CRANE, Held(), until=0.1)
    assert seen == [(k * 0.001, (3.0,)) for k in range(len(seen))]
    assert len(seen) in (100, 101)
    assert run.at([0.0505])["u"].tolist() == [36.375]
    with pytest.raises(InputError, match="of a controller with a `period`, the torque alone"):
        simulate(CRANE, Held(period=0.0), until=0.1)


def test_the_root_shows_its_public_names_only() -> None:
    assert dir(softstart) == sorted(softstart.__all__)
    assert {"parameter", "compiled_step", "make_controller", "Command", "PlainController"} <= set(
        dir(softstart)
    )


def test_what_is_not_declared_is_not_seen() -> None:
    seen: list[Measured] = []

    class Blind(PlainController):
        def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
            seen.append(measured)
            return Command(62.0, measured.time + 0.01)

    simulate(CRANE, Blind(), until=0.05)
    assert all(math.isnan(value) for m in seen for value in (m.shaft_torque, m.load_speed, m.stage))


@pytest.mark.slow
def test_a_compiled_step_notices_a_change_in_what_it_calls(tmp_path):
    (tmp_path / "helper_of_a_step.py").write_text(
        "from numba import njit\n\n@njit(cache=True)\ndef answer():\n    return 10.0\n"
    )
    (tmp_path / "step_with_helper.py").write_text(
        "import numpy as np\nfrom softstart import compiled_step\n"
        "from softstart.kernel.motor import TORQUE, ASK_AGAIN\n"
        "from helper_of_a_step import answer\n\n"
        "@compiled_step\ndef step(parameters, measured, state, command):\n"
        "    command[TORQUE] = answer()\n    command[ASK_AGAIN] = 1.0\n\n"
        "command = np.zeros(3)\nstep(np.zeros(1), np.zeros(7), np.zeros(0), command)\n"
        "print(command[TORQUE])\n"
    )

    def run() -> str:
        line = [sys.executable, "step_with_helper.py"]
        return subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=True).stdout.strip()

    # __main__ is compiled from its file too, and kept beside it
    assert run() == "10.0"
    helper = tmp_path / "helper_of_a_step.py"
    helper.write_text(helper.read_text().replace("10.0", "25.0"))
    later = time.time() + 5.0
    os.utime(helper, (later, later))
    assert run() == "25.0"


def test_the_project_file_of_something_else_registers_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plugins, "CHECKOUT", tmp_path / "pyproject.toml")
    for name, found in (("another", []), ("softstart", ["own"])):
        table = '[tool.softstart.entry-points."softstart.test-group"]\nown = "math:pi"\n'
        plugins.CHECKOUT.write_text(f'[project]\nname = "{name}"\n{table}')
        assert list(plugins.registered.__wrapped__("softstart.test-group")) == found


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("    kernel = step", "", "Direct: kernel is missing"),
        (
            "PARAMETERS).torque",
            "PARAMETERS).torqe",
            "cannot be compiled: no record of the step has a field 'torqe'",
        ),
        ("math.inf", "unknown", "cannot be compiled: NameError: name 'unknown' is not defined"),
        (
            "    torque: float = ",
            "    force: float = ",
            "its step takes torque, which is neither a parameter",
        ),
    ],
)
def test_a_compiled_controller_with_a_mistake_is_refused_in_a_sentence(tmp_path, right, wrong, said):
    file = tmp_path / "mine.py"
    text = Path(str(inspect.getsourcefile(controller_class("direct")))).read_text(encoding="utf-8")
    assert right in text
    file.write_text(text.replace(right, wrong), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        simulate(Drive.load("crane-4amtkf"), f"{file}:Direct")


def test_every_analysis_takes_a_name_a_class_and_an_object() -> None:
    """All name the same controller, so their figures are equal to the bit."""
    cls = type(make_controller("ramp"))
    given = ("ramp", cls, cls())
    chain = softstart.Chain.load("crane-4-mass")
    drive = chain.design_drive
    doors: tuple[Callable[[Any], float], ...] = (
        lambda each: simulate(CRANE, each).k_dyn,
        lambda each: softstart.compare(CRANE, [each]).rows[0].run.k_dyn,
        lambda each: float(softstart.sweep(CRANE, each, {"controller.time": [0.1]}, workers=1).k_dyn[0]),
        lambda each: recipe_of(each).make({"time": 0.1}).parameters["time"],
        lambda each: float(softstart.linear_view(CRANE, each).kind == "open loop"),
        lambda each: verify_on_chain(chain, drive, each).chain_k_dyn,
    )
    for door in doors:
        assert len({door(each) for each in given}) == 1
    assert make_controller(cls, {"time": "120 ms"}) == make_controller("ramp", {"time": "120 ms"})
    assert softstart.sweep(CRANE, cls, {"gap": [1.0]}, until="0.3 s", workers=1).k_dyn[0] > 0.0
    with pytest.raises(InputError, match=r"ramp has no such parameter"):
        simulate(CRANE, cls, parameters={"tme": 0.1})
    with pytest.raises(InputError, match=r"is no controller; derive the class"):
        simulate(CRANE, int)  # type: ignore[arg-type]
