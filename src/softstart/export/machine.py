"""A machine as C99: the exact kernel, with the numbers of one drive or chain."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from softstart.drive.machine import Machine
from softstart.export.c import STDC, CWriter
from softstart.export.source import python_function
from softstart.export.statements import (
    Array,
    Element,
    Expression,
    Field,
    Program,
    Struct,
    Type,
    Variable,
    expressions,
    parts,
    walk,
)  # fmt: skip
from softstart.export.translate import Translator
from softstart.export.values import NoRows, Row, Value
from softstart.kernel import records as rec
from softstart.kernel import start
from softstart.kernel.plant import PLANT_INPUT, PLANT_OUTPUT, move_machine
from softstart.start.kernel_input import KernelInput, kernel_input

FOREVER = 1e18  # s, and events: an exported machine has no end
NAMES = {"given": "Input", "output": "Output"}


def machine_c(machine: Machine, prefix: str) -> dict[str, str]:
    """The header and the source, by file name."""
    given = endless(machine)
    program = _program(given)
    state = np.zeros(rec.N_WORK)
    start.begin(state, *given.first, FOREVER, False)
    writer = CWriter(program, prefix)
    parameters = {one.name: one.type for one in program.entry.parameters}
    writer.renamed = {
        kind.name: NAMES[name]
        for name, kind in parameters.items()
        if name in NAMES and isinstance(kind, Struct)
    }
    functions = [writer.function(one) for one in program.functions]
    work = next(one for one in program.structs if one == parameters["work"])
    tones = parameters.get("tones")
    return {
        f"{prefix}.h": _header(writer, program),
        f"{prefix}.c": _source(writer, functions, _first_state(writer, work, state), tones, given),
    }


def _program(given: KernelInput) -> Program:
    """The kernel for so many masses; of its work only what it uses."""
    translator = Translator({rec.MOST_MASSES: max(given.count, 2)}, in_bounds=True)
    structs = translator.structs

    def row(name: str, dtype: Any) -> Row:
        return Row(Variable(name, structs.of(dtype)), None)

    values: list[Value] = [
        row("work", rec.WORK),
        Variable("tones", Array(structs.of(rec.TONE), (len(given.tones),))),
        NoRows(),
        row("measured", rec.MEASURED),
        row("given", PLANT_INPUT),
        row("output", PLANT_OUTPUT),
        Variable("step", "double"),
    ]
    entry = python_function(move_machine)
    assert entry is not None
    program = translator.program(translator.function(entry, values))
    work = structs.of(rec.WORK)
    used = {
        part.name
        for function in program.functions
        for statement in walk(function.body)
        for expression in expressions(statement)
        for part in parts(expression)
        if isinstance(part, Field) and part.base.type == work
    }
    program.structs = [
        replace(one, members=tuple(member for member in one.members if member.name in used))
        if one == work
        else one
        for one in program.structs
    ]
    return program


def endless(machine: Machine) -> KernelInput:
    """A machine whose motion has no end; a strategy outside sees it from t = 0 on."""
    given = kernel_input(machine)
    given = replace(given, machines=given.machines.copy())
    row = given.machine
    row.time_limit = row.longest = row.event_cap = FOREVER
    row.begins_at = 0.0
    return given


def _first_state(writer: CWriter, work: Struct, state: Any) -> str:
    """Statements that set what is not 0."""
    record, lines = state.view(rec.WORK)[0], []

    def store(place: Expression, value: Any, kind: Type) -> None:
        if isinstance(kind, Struct):
            for member in kind.members:
                store(Field(place, member.name, member.type), value[member.name], member.type)
        elif isinstance(kind, Array):
            rest = Array(kind.element, kind.shape[1:]) if len(kind.shape) > 1 else kind.element
            for at in range(kind.shape[0]):
                store(Element(place, (writer.index(at),), rest), value[at], rest)
        elif value != 0.0:
            number = int(value) if kind == "whole" else float(value)
            lines.append(f"    {writer.expression(place)} = {writer.constant(number, kind)};\n")

    writer.references = {"work"}
    place = Variable("work", work)
    for member in work.members:
        store(Field(place, member.name, member.type), record[member.name], member.type)
    return "".join(lines)


def _header(writer: CWriter, program: Program) -> str:
    prefix = writer.prefix
    guard = f"{prefix.upper()}_H"
    structs = "\n".join(writer.struct(one) for one in program.structs if one.name != "Tone")
    names = {one.name: one.type for one in program.entry.parameters}
    return (
        f"/* Call {prefix}_init once, then {prefix}_step with the torque demand and the length of a step in\n"
        "   s. One of 0 s tells the output and moves nothing. */\n"
        f"#ifndef {guard}\n#define {guard}\n\n#include <stdint.h>\n\n"
        f"typedef double {prefix}_real;\n\n{structs}\n"
        f"typedef struct {{\n    {writer.type_of(names['work'])} work;\n"
        f"    {writer.type_of(names['measured'])} measured;\n}} {prefix}_State;\n\n"
        f"void {prefix}_init({prefix}_State *state);\n{_step(prefix)};\n\n#endif\n"
    )


def _step(prefix: str) -> str:
    return (
        f"void {prefix}_step(\n"
        f"    {prefix}_State *state, const {prefix}_Input *input, {prefix}_Output *output, double h)"
    )


def _source(writer: CWriter, functions: list[str], first: str, tones: Any, given: KernelInput) -> str:
    prefix, program = writer.prefix, writer.program
    tone = next((one for one in program.structs if one.name == "Tone"), None)
    rows = ""
    if tones is not None and tone is not None:
        values = [
            writer.value(
                tone, {name: float(row.view(rec.TONE)[0][name]) for name in rec.Tone.__annotations__}
            )
            for row in given.tones
        ]
        listed = ", ".join(values) or "{0}"
        rows = f"{writer.struct(tone)}\nstatic const {writer.declared('tones', tones)} = {{ {listed} }};\n"
    handed = {
        "work": "&state->work", "tones": "tones", "measured": "&state->measured", "given": "input",
        "output": "output", "step": "h",
    }  # fmt: skip
    arguments = ", ".join(handed[one.name] for one in program.entry.parameters)
    work = next(one for one in program.entry.parameters if one.name == "work")
    return (
        f'#include "{prefix}.h"\n\n#include <math.h>\n#include <string.h>\n\n{STDC}\n{rows}'
        + writer.tables(program.tables)
        + "\n".join(["", *writer.helpers.values(), "", *functions])
        + f"\nvoid {prefix}_init({prefix}_State *state)\n{{\n"
        f"    {writer.type_of(work.type)} *work = &state->work;\n"
        f"    memset(state, 0, sizeof(*state));\n{first}}}\n"
        f"\n{_step(prefix)}\n{{\n    {writer.function_name(program.entry)}({arguments});\n}}\n"
    )
