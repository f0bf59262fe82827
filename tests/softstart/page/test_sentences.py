"""What the page says: fields by their labels, and no word of a command line or of a file."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import pytest

from softstart.cli.commands import COMMANDS
from softstart.page.controls import Controls
from softstart.page.downloads import shipped_drives
from softstart.page.frames import FrameBuilder
from softstart.page.project import take_text
from softstart.page.session import Session

PAGE = Path(__file__).parents[3] / "src/softstart/page"
OF_COMMAND_LINE = {"address.py", "serve.py", "guard.py", "downloads.py"}  # said in a terminal, or for one
TABLES = "motor|shaft|mass|load|start|brake|gear|limits|duty|shift"
FOREIGN = re.compile(
    rf"softstart ({'|'.join(COMMANDS)})\b|(?<![\w-])--[a-z]|\[({TABLES})\]|\b({TABLES})(\[\d+\])?\.[a-z]\w+"
    r"|\b(?!K_dyn)[a-z]+_[a-z_]+\b|drive file"
)
BAD = ("fast", "-1", "1e9", "0", "3 apples", "4 m", "", "nan", "1;2")


def texts_in(part: Any) -> list[str]:
    if isinstance(part, str):
        return [part]
    parts = part.values() if isinstance(part, dict) else part if isinstance(part, list | tuple) else ()
    return [text for one in parts for text in texts_in(one)]


@pytest.mark.parametrize(("machine", "strategy"), [("crane-4amtkf", "ramp"), ("crane-4-mass", "s-curve")])
def test_an_error_begins_with_the_label_of_a_field(machine: str, strategy: str) -> None:
    session = Session(machine, ["direct", strategy])
    session.select(strategy)
    frames = FrameBuilder(session)
    controls = Controls(session, frames, lambda: None)
    labels = {entry.label.lower() for entry in frames.entries.values()}
    said = 0
    for path, entry in frames.entries.items():
        for text in BAD:
            before = session.inputs
            controls.take({"what": "edit", "path": path, "text": text})
            sentence = frames.mistakes.pop(path, "")
            if session.inputs is not before:
                session.undo()
            if not sentence:
                continue
            said += 1
            assert not FOREIGN.search(sentence), sentence
            assert any(label in sentence.lower().partition(":")[0] for label in labels), sentence
            if f'"{text}": ' in sentence.partition(". ")[0]:
                assert sentence.startswith(entry.label[0].upper() + entry.label[1:]), sentence
    assert said > 200
    assert frames.mistakes == {}


def test_a_bare_number_is_said_to_be_in_the_unit_of_its_field() -> None:
    session = Session("crane-4amtkf", ["direct"])
    frames = FrameBuilder(session)
    controls = Controls(session, frames, lambda: None)
    for path, text, unit in (("start.target_speed", "fast", "rpm"), ("shaft.gap", "x", "rad"),
                             ("load.inertia", "x", "kg m²")):  # fmt: skip
        controls.take({"what": "edit", "path": path, "text": text})
        assert frames.mistakes[path].endswith(f"or as a bare number in {unit}.")


@pytest.mark.parametrize("name", shipped_drives())
def test_notes_of_a_machine_have_no_command_language(name: str) -> None:
    for changes in (
        {},
        {"limits.shaft_torque": "1e5 N*m", "start.position": "unknown"},
        {"shaft.gap": "9 rad"},
        {"limits.start_time": "1 ms"},
    ):
        session = Session(name, ["direct", "ramp"])
        if not set(changes) <= set(session.inputs.machine.parameters_by_path()):
            continue
        session.set_all(changes)
        frames = FrameBuilder(session)
        notes = [frames.main_frame()["no_output"]]
        for frame in frames.idle_frames():
            keys = ("recommendation", "plausibility_warnings", "assumed", "rows")
            notes += texts_in([(frame or {}).get(key) for key in keys])
            if (frame or {}).get("recommendation"):
                break
        assert len(notes) > 3
        for note in notes:
            assert not FOREIGN.search(note), note


def test_no_text_of_a_panel_has_command_language() -> None:
    for path in sorted(PAGE.glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        docstrings = {ast.get_docstring(node, clean=False) for node in ast.walk(tree)
                      if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)}  # fmt: skip
        for node in ast.walk(tree) if path.name not in OF_COMMAND_LINE else ():
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
                command = re.search(rf"softstart ({'|'.join(COMMANDS)})\b|(^| )--[a-z]", node.value)
                assert not command or node.value in docstrings, (path.name, node.value)
    for path in sorted((PAGE / "web/modules").glob("*.js")):
        command = re.search(
            rf"softstart ({'|'.join(COMMANDS)})\b|[\" ]--[a-z]+ [A-Z]", path.read_text("utf-8")
        )
        assert not command, (path.name, command)


def test_a_profile_that_is_longer_than_the_start_is_refused_where_it_is_simulated() -> None:
    session = Session("crane-4amtkf", ["direct"])
    take_text(session, "time,torque\n0,20\n0.3,62\n", "mine")
    assert session.result("mine").run is not None
    session.set("load.inertia", 0.05)
    assert session.result("mine").run is None
    assert session.result("mine").trouble.startswith('Strategy "mine": its torque changes until 0.3 s, and')
    session.undo()
    assert session.result("mine").run is not None
