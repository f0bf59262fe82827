"""The function block around a translated control block, and a program that tests it, in Structured Text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from softstart.export.st import add_program
from softstart.export.st_expressions import Scope
from softstart.export.st_names import comment as remark
from softstart.export.st_names import literal, prefixed
from softstart.export.st_text import Text
from softstart.export.st_units import Declared, Unit, function_of
from softstart.export.statements import Array, Member, Program, Struct, Type

FIRST_VALUES = {"cycles": "1"}  # of inputs that need not be connected
CHECK = """
FUNCTION {name} : LINT
VAR_INPUT
    found : LINT;
    row : LINT;
    torque : {real};
    expected : {real};
    fault : LINT;
    expected_fault : LINT;
END_VAR
VAR CONSTANT
    room : {real} := {room};
END_VAR
{name} := found;
IF found < 0 THEN
    IF NOT ((ABS(torque - expected) <= room) AND (fault = expected_fault)) THEN
        {name} := row;
    END_IF;
END_IF;
END_FUNCTION
"""


def write_block(
    program: Program,
    constants: Mapping[str, Any],
    prefix: str,
    single: bool = False,
    *,
    given: str = "given",
    output: str = "output",
    comment: str = "",
    meanings: Mapping[str, str] | None = None,
) -> Text:
    """A function block that calls the entry of a program once in each cycle.

    Parameters
    ----------
    program : its entry has structures and arrays as parameters.
    constants : values of those parameters that stay constant, by the names of their fields, nested. The
        others are kept by the block, and 0 at first.
    prefix : the name of the block, and the beginning of the names of all that it needs.
    single : numbers are REAL instead of LREAL; clocks and angles stay LREAL.
    given, output : the parameters of the entry whose fields are inputs and outputs of the block.
    comment, meanings : of the block, and of its inputs and outputs by name.

    Returns
    -------
    The text: `str(text)` is a source file that tools import.

    Raises
    ------
    InputError
        For what Structured Text does not have, as a function without a counterpart.
    """
    text = Text(prefix, single)
    add_program(text, program)
    structs = {struct.name: struct for struct in program.structs}
    block = _BlockWriter(text, structs, meanings or {})
    text.units.append(block.unit(program, constants, given, output, comment))
    return text


class _BlockWriter(Scope):
    """Writes the function block."""

    def __init__(self, text: Text, structs: Mapping[str, Struct], meanings: Mapping[str, str]) -> None:
        super().__init__(text)
        self.structs, self.meanings = structs, meanings

    def unit(
        self, program: Program, constants: Mapping[str, Any], given: str, output: str, comment: str
    ) -> Unit:
        """The whole block."""
        entry = program.entry
        types = {one.name: one.type for one in entry.parameters}
        unit = Unit("FUNCTION_BLOCK", self.text.block_name, comment=comment)
        for block, name in (("VAR_INPUT", given), ("VAR_OUTPUT", output)):
            unit.declare(block, [self._signal(one) for one in self._members(types[name])])
        for name, kind in types.items():
            self.declared[self.names.of(f"{name} kept")] = self.text.type_name(kind)
        ready, done = self.names.of("ready"), self.names.of("done")
        self.declared |= {ready: "BOOL", done: "BOOL"}
        fixed = {name: kind for name, kind in types.items() if name in constants}
        if fixed:
            setter = self._setter(fixed, constants)
            self.say(f"IF NOT {ready} THEN")
            self.depth = 1
            self.say(f"{done} := {setter[0]}({self._handed(setter[1].items())});")
            self.say(f"{ready} := TRUE;")
            self.depth = 0
            self.say("END_IF;")
        for to, of in self._signals(types[given], given):
            self.say(f"{to} := {of};")
        signature = self.text.signatures[entry.name]
        handed = ", ".join(
            f"{to} := {self.names.of(f'{name} kept')}"
            for name, to in zip(types, signature.inputs, strict=True)
        )
        self.say(f"{done} := {signature.name}({handed});")
        for of, to in self._signals(types[output], output):
            self.say(f"{to} := {of};")
        unit.declare_all("VAR", self.declared)
        unit.body = self.lines
        return unit

    def _handed(self, names: Iterable[tuple[str, str]]) -> str:
        """Arguments: what the block keeps, and the parameters that it is handed to."""
        return ", ".join(f"{to} := {self.names.of(f'{name} kept')}" for name, to in names)

    def _members(self, kind: Type) -> Sequence[Member]:
        assert isinstance(kind, Struct)
        return self.structs[kind.name].members

    def _signal(self, member: Member) -> Declared:
        meaning = self.meanings.get(member.name, member.comment)
        first = FIRST_VALUES.get(member.name, "")
        return Declared(self.names.of(member.name), self.text.type_name(member.type), first, meaning)

    def _signals(self, kind: Type, kept: str) -> list[tuple[str, str]]:
        """Fields of a structure that the block keeps, and the inputs or outputs that they are."""
        assert isinstance(kind, Struct)
        own = self.names.of(f"{kept} kept")
        return [
            (f"{own}.{self.text.field_name(kind, one.name)}", self.names.of(one.name))
            for one in self._members(kind)
        ]

    def _setter(self, fixed: Mapping[str, Type], constants: Mapping[str, Any]) -> tuple[str, dict[str, str]]:
        """Write the function that sets the constants; its name and those of its parameters."""
        name = self.text.names.new(prefixed(self.text.prefix, "set_numbers"))
        scope = Scope(self.text)
        names = {one: scope.names.of(one) for one in fixed}
        unit = Unit("FUNCTION", name, "BOOL", comment="Numbers of the drive and the strategy")
        unit.declare_all("VAR_IN_OUT", {names[one]: self.text.type_name(kind) for one, kind in fixed.items()})
        for one, kind in fixed.items():
            self._set(scope, names[one], kind, constants[one], unit.body)
        unit.declare("VAR CONSTANT", scope.constants())
        unit.body.append(f"{name} := TRUE;")
        self.text.units.append(unit)
        return name, names

    def _set(
        self, scope: Scope, place: str, kind: Type, value: Any, lines: list[str], note: str = ""
    ) -> None:
        """Lines that set a number, structure or array."""
        if isinstance(kind, Struct):
            for member in self._members(kind):
                inner = f"{place}.{self.text.field_name(kind, member.name)}"
                self._set(scope, inner, member.type, value[member.name], lines, member.comment)
        elif isinstance(kind, Array):
            for index, one in _indexed(value, kind.shape):
                self._set(scope, f"{place}[{index}]", kind.element, one, lines, note)
        else:
            number = {"truth": bool, "whole": int}.get(kind, float)(value)
            lines.append(f"{place} := {scope.constant(number, kind)};{remark(note)}")


def _indexed(values: Any, shape: tuple[int, ...]) -> list[tuple[str, Any]]:
    """The elements of nested lists, with their indices as they are written."""
    if len(shape) == 1:
        return [(str(k), values[k]) for k in range(shape[0])]
    return [(f"{k}, {j}", values[k][j]) for k in range(shape[0]) for j in range(shape[1])]


def add_test(text: Text, rows: Sequence[tuple[Mapping[str, float], float, int]], room: float) -> str:
    """Add a program that plays rows to the block and compares its answers; its name.

    Parameters
    ----------
    rows : inputs by name, torque in N m and code of the fault; those of one start, without NaN.
    room : by how much a torque may be off, N m.

    Its outputs are `finished`, `ok`, and `first_difference`: the number of the row, from 0 on, or -1.
    """
    block = next(unit for unit in text.units if unit.kind == "FUNCTION_BLOCK")
    inputs = {one.name: one.type for one in block.blocks["VAR_INPUT"]}
    torque, fault = (one.name for one in block.blocks["VAR_OUTPUT"])
    real, single = text.type_name("real"), text.single
    check = text.names.new(prefixed(text.prefix, "check"))
    text.units.append(function_of(CHECK.format(name=check, real=real, room=literal(room, "real", single))))
    program = Unit("PROGRAM", text.names.new(f"TEST_{text.prefix}"), comment="Run it once, and read ok")
    program.declare(
        "VAR_OUTPUT",
        [
            Declared("finished", "BOOL"),
            Declared("ok", "BOOL"),
            Declared("first_difference", "LINT", comment="row, -1 without"),
        ],
    )
    program.declare("VAR", [Declared("tested", block.name)])
    write = program.body.append
    write("IF NOT finished THEN")
    write("    first_difference := -1;")
    for k, (given, expected, code) in enumerate(rows):
        handed = ", ".join(f"{name} := {_input(given[name], kind, single)}" for name, kind in inputs.items())
        write(f"    tested({handed});")
        wanted = f"{literal(expected, 'real', single)}, tested.{fault}, {code}"
        write(f"    first_difference := {check}(first_difference, {k}, tested.{torque}, {wanted});")
    write("    ok := first_difference < 0;")
    write("    finished := TRUE;")
    write("END_IF;")
    text.units.append(program)
    return program.name


def _input(value: float, kind: str, single: bool) -> str:
    if kind == "BOOL":
        return "TRUE" if value else "FALSE"
    written: Callable[..., str] = literal
    if kind == "LINT":
        return written(int(value), "whole", single)
    return written(float(value), "real" if kind == "REAL" else "double", single)
