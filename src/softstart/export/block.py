"""A strategy with its guard as a program: what a control block executes, with the numbers of one drive."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.controller.base import CompiledController, label_of
from softstart.errors import InputError
from softstart.export.source import parsed, python_function
from softstart.export.statements import Array, Program, Struct, Variable
from softstart.export.translate import Translator
from softstart.export.values import Known, Row, Structs
from softstart.kernel.block import BLOCK_INPUT, BLOCK_LIMITS, BLOCK_OUTPUT, BLOCK_STATE, run_block
from softstart.kernel.records import (
    ANSWER,
    MEASURED,
    SEES_LOAD_SPEED,
    SEES_SHAFT_TORQUE,
    SEES_STAGE,
    size,
)  # fmt: skip
from softstart.start.block import ControlBlock

SENSED = {"stage": SEES_STAGE, "shaft_torque": SEES_SHAFT_TORQUE, "load_speed": SEES_LOAD_SPEED}
# what the block keeps from cycle to cycle, and what it needs within one
KEPT, SCRATCH = ("block", "state"), ("command", "measured")


@dataclass(frozen=True)
class BlockProgram:
    """A program, whose entry executes one cycle, and its numbers.

    Parameters
    ----------
    program : its entry has, of these names, the parameters that it needs: `limits`, `parameters` and
        `parameters_tail` (constant), `block` and `state` (kept; 0 at first), `command` and `measured` (for
        one cycle; 0 at its begin), `given` and `output`.
    constants : of the constant ones, the values: of a structure by name, of an array in order.
    period : of the cycles, s.
    """

    program: Program
    constants: Mapping[str, Any]
    period: float

    def struct(self, name: str) -> Struct | None:
        """The structure of a parameter of the entry; None where it has none of this name."""
        for variable in self.program.entry.parameters:
            if variable.name == name and isinstance(variable.type, Struct):
                return next(one for one in self.program.structs if one.name == variable.type.name)
        return None


def block_program(block: ControlBlock) -> BlockProgram:
    """Translate a block.

    Raises
    ------
    InputError
        For a strategy in plain Python, and for code that cannot be translated, with its file and line.
    """
    controller = block.controller
    if not isinstance(controller, CompiledController):
        raise InputError(
            f"{label_of(controller)}: this strategy is plain Python; derive it from CompiledController to "
            "export it."
        )
    step = python_function(type(controller).kernel)
    assert step is not None
    records = _records(step)
    translator = Translator()
    names = [one.arg for one in parsed(step).args.args]
    numbers = block.parameters
    parameters, _, state, command = (records.get(name) for name in names)
    state = state or getattr(type(controller).kernel, "state_record", None)  # where it is only kept
    rows = {
        "limits": _row(translator.structs, "limits", BLOCK_LIMITS),
        "parameters": _row(translator.structs, "parameters", parameters, numbers.size),
        "block": _row(translator.structs, "block", BLOCK_STATE),
        "state": _row(translator.structs, "state", state),
        "command": _row(translator.structs, "command", command or ANSWER),
        "measured": _row(translator.structs, "measured", MEASURED),
        "given": _row(translator.structs, "given", BLOCK_INPUT),
        "output": _row(translator.structs, "output", BLOCK_OUTPUT),
    }
    entry = python_function(run_block)
    assert entry is not None
    sees = translator.constant(block.sees)
    program = translator.program(
        translator.function(entry, [Known(type(controller).kernel), sees, *rows.values()])
    )
    unseen = {name for name, bit in SENSED.items() if not block.sees & bit}
    given = rows["given"].head
    assert given is not None
    program.structs = [
        replace(one, members=tuple(member for member in one.members if member.name not in unseen))
        if one == given.type
        else one
        for one in program.structs
    ]
    constants: dict[str, Any] = {"limits": _values(BLOCK_LIMITS, block.limits)}
    if parameters is not None:
        constants["parameters"] = _values(parameters, numbers[: size(parameters)])
    constants["parameters_tail"] = numbers[0 if parameters is None else size(parameters) :].tolist()
    return BlockProgram(program, constants, block.period)


def _records(step: Callable[..., Any]) -> dict[str, Any]:
    """The records that a step gives its rows, by the names of these."""
    found: dict[str, Any] = {}
    for node in ast.walk(parsed(step)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "as_record":
            row, dtype = node.args
            row = row.value if isinstance(row, ast.Subscript) else row
            if isinstance(row, ast.Name) and isinstance(dtype, ast.Name):
                found.setdefault(row.id, step.__globals__.get(dtype.id))
    return found


def _row(structs: Structs, name: str, dtype: Any, numbers: int = 0) -> Row:
    tail = numbers - (0 if dtype is None else size(dtype))
    return Row(
        None if dtype is None else Variable(name, structs.of(dtype)),
        Variable(f"{name}_tail", Array("double", (tail,))) if tail > 0 else None,
    )


def _values(dtype: Any, numbers: Vector) -> dict[str, Any]:
    """The numbers of a record by name, those of records in it too."""
    record = np.ascontiguousarray(numbers).view(dtype)[0]
    return {
        name: _values(dtype[name], np.frombuffer(record[name].tobytes()))
        if dtype[name].names
        else record[name].tolist()
        for name in dtype.names
    }
