"""All strategies with their guards in Structured Text: parsed, executed over all vectors, and as PLCopen XML.

SOFTSTART_ST_COMPILER names a command that executes Structured Text: `COMMAND source.st NAME vectors.csv
answers.csv` compiles the source, makes an instance of the function block NAME for each scenario in the
first column of the vectors, calls it with the other columns but the last two, row by row, and writes the
columns torque (with 17 digits) and fault, with a head. The vectors run through it too where it is named.
"""

from __future__ import annotations

import csv
import math
import os
import re
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xmlschema
from tests.export import tools
from tests.export.plcopen_schema import schema_file
from tests.export.st_interpreter import Program as Interpreter

from softstart import Drive
from softstart.controller import Controller, make_controller
from softstart.controller.finding import ready_controller_names
from softstart.export.block import BlockProgram, block_program
from softstart.export.controller import export_controller
from softstart.export.plcopen import NAMESPACE, plcopen_xml
from softstart.export.st_block import add_test, write_block
from softstart.export.st_text import Text
from softstart.export.vectors import Precision, Vectors, make_vectors
from softstart.profile import TorqueProfile
from softstart.start.block import ControlBlock

ALL = (*ready_controller_names(), "profile")
COMPILER = os.environ.get("SOFTSTART_ST_COMPILER", "")
ROWS = 60  # of the test program


@cache
def drive() -> Drive:
    """With an encoder, and a torque that lags and is late: what the strategies must reckon with."""
    return Drive.load("crane-4amtkf").replace(encoder_lines=4096.0, torque_lag=0.002, computing_delay=0.0015)


def controller(name: str) -> Controller:
    if name == "profile":  # with times that single precision has too: a step elsewhere may be a cycle late
        times, torques = [0.0, 0.125, 0.125, 0.5], [20.0, 62.0, 30.0, 40.0]
        return make_controller(name, {"profile": TorqueProfile(times, torques)})
    return make_controller(name)


@cache
def program(name: str) -> BlockProgram:
    return block_program(ControlBlock(controller(name), drive()))


@cache
def vectors(name: str, real: Precision) -> Vectors:
    return make_vectors(controller(name), drive(), real=real)


def prefix(name: str) -> str:
    return name.replace("-", "_")


def written(name: str, real: Precision) -> tuple[Text, str]:
    """The text of a block with its test program, and the name of that."""
    made = program(name)
    text = write_block(made.program, made.constants, prefix(name), real == "float32")
    rows = [
        (row.inputs, row.torque, row.fault) for row in vectors(name, real).rows if row.scenario == "nominal"
    ]
    return text, add_test(text, rows[:ROWS], vectors(name, real).room)


def answers(block_program_text: str, name: str, real: Precision) -> tuple[np.ndarray, np.ndarray]:
    """Torques and faults of all rows; each scenario begins with a new instance."""
    executed = Interpreter(block_program_text)
    found, scenario = [], ""
    for row in vectors(name, real).rows:
        if row.scenario != scenario:
            block, scenario = executed.block(prefix(name)), row.scenario
        answer = block(**row.inputs)
        found.append((float(answer["torque"]), answer["fault"]))
    torques, faults = zip(*found, strict=True)
    return np.array(torques), np.array(faults)


def expected(name: str, real: Precision) -> tuple[np.ndarray, np.ndarray]:
    rows = vectors(name, real).rows
    return np.array([row.torque for row in rows]), np.array([row.fault for row in rows])


@pytest.mark.parametrize("name", ALL)
def test_all_vectors_are_equal_to_the_bit_in_lreal(name: str) -> None:
    text, test = written(name, "float64")
    torques, faults = answers(str(text), name, "float64")
    wanted, codes = expected(name, "float64")
    assert np.array_equal(torques.view(np.int64), (wanted + 0.0).view(np.int64)) or np.array_equal(
        torques, wanted
    )
    assert np.array_equal(faults, codes)
    assert np.any(codes != 0)
    assert np.all(np.isfinite(torques))
    assert Interpreter(str(text)).block(test)() == {"finished": True, "ok": True, "first_difference": -1}


def beside(values: np.ndarray, scenarios: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest of each row and those beside it in the same scenario."""
    low, high = values.copy(), values.copy()
    for step in (-1, 1):
        other = np.roll(values, step)
        same = np.roll(scenarios, step) == scenarios
        low[same], high[same] = np.minimum(low, other)[same], np.maximum(high, other)[same]
    return low, high


@pytest.mark.parametrize("name", ALL)
def test_vectors_are_within_the_room_in_real(name: str) -> None:
    """A decision may fall a cycle earlier or later."""
    text, _ = written(name, "float32")
    torques, faults = answers(str(text), name, "float32")
    wanted, codes = expected(name, "float32")
    scenarios = np.array([row.scenario for row in vectors(name, "float32").rows])
    low, high = beside(wanted, scenarios)
    first, last = beside(codes, scenarios)
    room = vectors(name, "float32").room
    off = np.maximum(low - torques, torques - high)
    print(f"{name}: at most {np.max(np.abs(torques - wanted)):.2g} N m off, room {room:g} N m")
    assert np.all(off <= room), (scenarios[np.argmax(off)], int(np.argmax(off)), float(np.max(off)))
    assert np.all((faults == codes) | (faults == first) | (faults == last))


@pytest.mark.skipif(not COMPILER, reason="SOFTSTART_ST_COMPILER names no compiler")
@pytest.mark.parametrize("name", ALL)
def test_a_compiler_finds_the_same(name: str, tmp_path: Path) -> None:
    source, played, found = (tmp_path / file for file in ("block.st", "vectors.csv", "answers.csv"))
    source.write_text(str(write_block(program(name).program, program(name).constants, prefix(name))), "ascii")
    played.write_text(vectors(name, "float64").csv(), "utf-8")
    tools.run(COMPILER, source, prefix(name), played, found)
    with found.open(encoding="utf-8") as file:
        rows = [(float(row["torque"]), int(row["fault"])) for row in csv.DictReader(file)]
    assert rows == [(row.torque, row.fault) for row in vectors(name, "float64").rows]


@pytest.mark.parametrize("real", ["float64", "float32"])
@pytest.mark.parametrize("name", ALL)
def test_plcopen_xml_holds_the_same_text(name: str, real: Precision) -> None:
    """Valid by the schema of PLCopen where the registry gives it; always with all that is needed."""
    text, test = written(name, real)
    xml = plcopen_xml(text, "1.0")
    if (schema := schema_file()) is not None:
        xmlschema.XMLSchema(str(schema)).validate(xml)
    print("validated by structure" if schema is None else "validated by the schema of PLCopen")
    root, name_of = ET.fromstring(xml), "{" + NAMESPACE + "}"
    assert root.tag == f"{name_of}project"
    assert [one.get("name") for one in root.iter(f"{name_of}dataType")] == [one.name for one in text.types]
    units = {str(one.get("name")): one for one in root.iter(f"{name_of}pou")}
    assert set(units) == {unit.name for unit in text.units} >= {prefix(name), test}
    for unit in text.units:
        body = units[unit.name].find(f".//{name_of}ST")
        assert body is not None
        assert "".join(body.itertext()).strip() == "\n".join(unit.body).strip()
        declared = [one.get("name") for one in units[unit.name].iter(f"{name_of}variable")]
        assert sorted(map(str, declared)) == sorted(
            one.name for group in unit.blocks.values() for one in group
        )


def test_an_export_holds_source_test_program_and_xml(tmp_path: Path) -> None:
    export_controller("ramp", "crane-4amtkf", "st", tmp_path / "export")
    assert {one.name for one in (tmp_path / "export").iterdir()} == {
        "README.md", "ramp.st", "ramp.xml", "vectors.csv",
    }  # fmt: skip
    executed = Interpreter((tmp_path / "export" / "ramp.st").read_text("ascii"))
    assert executed.block("TEST_ramp")() == {"finished": True, "ok": True, "first_difference": -1}
    assert "TEST_ramp" in (tmp_path / "export" / "README.md").read_text("utf-8")


def test_the_test_program_names_the_first_difference() -> None:
    made = program("ramp")
    text = write_block(made.program, made.constants, "ramp")
    rows = [(row.inputs, row.torque, row.fault) for row in vectors("ramp", "float64").rows[:30]]
    inputs, torque, fault = rows[17]
    rows[17] = (inputs, torque + 1.0, fault)
    test = add_test(text, rows, 1e-6)
    assert Interpreter(str(text)).block(test)() == {"finished": True, "ok": False, "first_difference": 17}


def test_inputs_and_units() -> None:
    """Inputs as declared by the strategy; cycles need not be connected; units stand beside the numbers."""
    text = str(written("take-up", "float64")[0])
    head = text[text.index("FUNCTION_BLOCK take_up") :]
    inputs = re.findall(r"    (\w+) : (\w+)", head[: head.index("END_VAR")])
    assert dict(inputs) == {
        "run": "BOOL", "set_speed": "LREAL", "motor_angle": "LREAL", "motor_speed": "LREAL",
        "motor_torque": "LREAL", "cycles": "LINT",
    }  # fmt: skip
    assert "cycles : LINT := 1;" in head
    block = Interpreter(text).block("take_up")
    row = vectors("take-up", "float64").rows[0]
    given = {key: value for key, value in row.inputs.items() if key != "cycles"}
    assert block(**given)["torque"] == row.torque
    assert block(**(given | {"motor_angle": math.nan})) == {"torque": 0.0, "fault": 1}


def test_single_precision_keeps_clocks_and_angles_double() -> None:
    text = str(written("speed-ramp", "float32")[0])
    assert "    motor_angle : LREAL;" in text
    assert "    motor_speed : REAL;" in text
