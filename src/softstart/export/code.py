"""The source files of an export: a strategy with its guard, in a language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from softstart.controller.tuned import meanings_of
from softstart.export.block import BlockProgram, block_program
from softstart.export.block_c import block_c
from softstart.export.block_st import block_st
from softstart.export.c import KEYWORDS as C_KEYWORDS
from softstart.export.costs import bytes_of, operations
from softstart.export.design import Design
from softstart.export.fmu import Version, find_compiler, fmu
from softstart.export.fmu_models import block_model
from softstart.export.self_test import test_program
from softstart.export.st_names import RESERVED
from softstart.export.statements import Program, Struct
from softstart.export.vectors import Vectors

KEYWORDS = frozenset(C_KEYWORDS) | RESERVED
# what a signal is, with its unit: of inputs and outputs, in all languages
SIGNALS = {
    "cycles": ("", "cycles since the last call: 1, after a missed one 2; counted by you"),
    "run": ("", "true: run, false: stop; a rising edge begins a start and resets a fault"),
    "set_speed": ("rad/s", "commanded speed with its sign, at the motor shaft"),
    "motor_angle": ("rad", "of the motor shaft, continuous: it does not wrap at a revolution"),
    "motor_speed": ("rad/s", "of the motor shaft: difference of two angles over the cycle time"),
    "motor_torque": ("N m", "realised torque of the motor, as the inverter reports it"),
    "stage": ("", "1, 2, 3, ...: odd while the gap is open, even while it is closed"),
    "shaft_torque": ("N m", "of the shaft, at the motor's speed"),
    "load_speed": ("rad/s", "of the load, at the motor's speed"),
    "torque": ("N m", "torque demand until the next cycle"),
    "fault": ("", "0, or the code of a fault, latched"),
}
DATA = {
    "J1": "kg m2: inertia of the motor", "J2": "kg m2: inertia of the load",
    "c": "N m/rad: stiffness of the shaft", "d": "N m s/rad: damping of the shaft", "gap": "rad: backlash",
    "Ms": "N m: starting torque", "Mc": "N m: load torque", "target_speed": "rad/s: target speed",
}  # fmt: skip


@dataclass(frozen=True)
class BlockCode:
    """The source of an export.

    files : what goes into the folder, beside vectors and README.
    figures, notes : of the code, for the README.
    c_sources : the C code, with which the export is checked.
    """

    prefix: str
    language: str
    real: str
    files: Mapping[str, str | bytes]
    c_sources: Mapping[str, str]
    figures: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    program: BlockProgram | None = None


def written(design: Design, vectors: Vectors, language: str, prefix: str, real: str) -> BlockCode:
    """The source of a strategy with its guard in this language.

    Raises
    ------
    InputError
        For code that cannot be translated, with its file, line and remedy.
    """
    made, single = described(block_program(design.block()), design), real == "float32"
    sources = block_c(made, prefix, single)
    files: dict[str, str | bytes] = {}
    notes: tuple[str, ...] = ()
    if language == "c":
        files = {**sources, **test_program(prefix, vectors)}
    elif language == "st":
        files = {**block_st(made, prefix, vectors, single)}
    else:
        note = find_compiler()[1]
        notes = (note,) if note else ()
    return BlockCode(prefix, language, real, files, sources, costs_of(made, single), notes, made)


def fmus(design: Design, code: BlockCode, readme: str) -> dict[str, str | bytes]:
    """The FMUs of a strategy with its guard, for both versions of FMI, with this documentation."""
    model = block_model(
        design.block(), code.prefix, f"{design.name}, {design.machine.name}", readme,
        code.real == "float32", code.program,
    )  # fmt: skip
    return {name: fmu(model, version).content for version, name in fmu_names(code.prefix).items()}


def fmu_names(prefix: str) -> dict[Version, str]:
    """The file for each version of FMI."""
    return {"2.0": f"{prefix}_fmi2.fmu", "3.0": f"{prefix}_fmi3.fmu"}


def described(made: BlockProgram, design: Design) -> BlockProgram:
    """The program, whose inputs, outputs and parameters say what they are."""
    signals = {name: ", ".join(filter(None, both)) for name, both in SIGNALS.items()}
    known = {"given": signals, "output": signals, "parameters": {**DATA, **meanings_of(design.ready)}}
    comments = {
        struct.name: texts for name, texts in known.items() if (struct := made.struct(name)) is not None
    }
    structs = [_commented(one, comments.get(one.name, {})) for one in made.program.structs]
    program = Program(structs, made.program.functions, made.program.tables)
    return replace(made, program=program)


def _commented(struct: Struct, texts: Mapping[str, str]) -> Struct:
    members = tuple(replace(one, comment=texts.get(one.name, one.comment)) for one in struct.members)
    return replace(struct, members=members)


def costs_of(made: BlockProgram, single: bool) -> dict[str, Any]:
    """Bytes of state and parameters, operations of a step."""
    kinds = {name: made.struct(name) for name in ("block", "state", "limits", "parameters")}
    sizes = {name: 0 if struct is None else bytes_of(struct, single) for name, struct in kinds.items()}
    tail = sum(
        bytes_of(one.type, single) for one in made.program.entry.parameters if one.name.endswith("_tail")
    )
    figures = {
        "state_bytes": sizes["block"] + sizes["state"],
        "parameter_bytes": sizes["limits"] + sizes["parameters"] + tail,
    }
    count = operations(made.program.entry)
    return figures if count is None else {**figures, "operations": count}
