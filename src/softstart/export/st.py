"""Typed statements -> Structured Text of IEC 61131-3: structures and functions.

Portable to the tools that there are: only IF, FOR, WHILE, EXIT and RETURN, no initial values of structures
and arrays, no pointers, no overloaded conversions. AND and OR may evaluate both sides, so where the right one
could fail it is evaluated in an IF. Functions without a value answer TRUE, since a function needs a type.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from softstart.export.st_expressions import Scope, assigned, needs_if
from softstart.export.st_loops import without_continue
from softstart.export.st_names import prefixed
from softstart.export.st_text import Signature, Text
from softstart.export.st_units import Unit
from softstart.export.statements import (
    Array,
    Assign,
    Binary,
    Call,
    Constant,
    Copy,
    Element,
    Expression,
    Field,
    For,
    Function,
    If,
    Kind,
    Leave,
    Program,
    Return,
    Statement,
    Unary,
    Variable,
    While,
    expressions,
    parts,
    walk,
)  # fmt: skip

SENSED = ("stage", "shaft_torque", "load_speed")
UNSEEN = Constant(math.inf, "real")  # of a sensor that is not there, NaN in Python; nothing reads it


def _is_unseen(place: Expression, value: Expression) -> bool:
    """Whether it stores what no sensor sees."""
    is_nan = isinstance(value, Constant) and isinstance(value.value, float) and math.isnan(value.value)
    return is_nan and isinstance(place, Field) and place.name in SENSED


def _variables(body: tuple[Statement, ...]) -> set[str]:
    """Names of all variables in a body."""
    found = (one for statement in walk(body) for one in expressions(statement))
    return {part.name for one in found for part in parts(one) if isinstance(part, Variable)}


class FunctionWriter(Scope):
    """Writes one function; `inputs` are the names of its parameters, `outputs` those of its values."""

    def __init__(self, text: Text, function: Function, name: str) -> None:
        super().__init__(text)
        self.function, self.name = function, name
        count = len(function.returns)
        self.outputs = [name] if count == 1 else [self.names.new(f"out_{k + 1}") for k in range(count)]
        self.inputs: list[str] = []
        self.given: dict[str, dict[str, str]] = {"VAR_IN_OUT": {}, "VAR_INPUT": {}, "VAR_OUTPUT": {}}
        changed = assigned(function.body)
        for parameter in function.parameters:
            declared, own = text.type_name(parameter.type), self.names.of(parameter.name)
            if parameter.name in changed:  # inputs are not assigned to
                self.inputs.append(self.names.new(f"{own}_given"))
                self.declared[own] = declared
                self.say(f"{own} := {self.inputs[-1]};")
            else:
                self.inputs.append(own)
            block = "VAR_INPUT" if isinstance(parameter.type, str) else "VAR_IN_OUT"
            self.given[block][self.inputs[-1]] = declared
        if count > 1:
            kinds = map(text.type_name, function.returns)
            self.given["VAR_OUTPUT"] = dict(zip(self.outputs, kinds, strict=True))
        for local, kind in function.locals.items():
            self.declared[self.names.of(local)] = text.type_name(kind)
        for table in sorted(_variables(function.body) & text.tables.keys()):
            self._table(table, *text.tables[table])

    def _table(self, name: str, kind: Array, values: tuple[float, ...]) -> None:
        """Constant arrays are written otherwise in each tool: here a variable, filled at each call."""
        own = self.names.of(name)
        self.declared[own] = self.text.type_name(kind)
        for k, value in enumerate(values):
            place = divmod(k, kind.shape[1]) if len(kind.shape) == 2 else (k,)
            number = int(value) if kind.element == "whole" else value
            assert isinstance(kind.element, str)
            self.say(f"{own}[{', '.join(map(str, place))}] := {self.constant(number, kind.element)};")

    def unit(self) -> Unit:
        """The whole function."""
        returns = self.function.returns
        result = self.text.type_name(returns[0] if len(returns) == 1 else "truth")
        if len(returns) != 1:
            self.say(f"{self.name} := TRUE;")
        self.block(without_continue(self.function.body))
        if self.lines[-1] == "RETURN;":
            self.lines.pop()
        unit = Unit("FUNCTION", self.name, result, body=self.lines, comment=self.function.comment)
        for block, types in {**self.given, "VAR": self.declared}.items():
            unit.declare_all(block, types)
        unit.declare("VAR CONSTANT", self.constants())
        return unit

    def block(self, statements: Iterable[Statement]) -> None:
        """Statements, one level in; an empty statement where there is none."""
        begin = len(self.lines)
        for statement in statements:
            self.statement(statement)
        if len(self.lines) == begin:
            self.say(";")

    def inner(self, statements: Iterable[Statement]) -> None:
        """Statements of a branch or loop."""
        self.depth += 1
        self.block(statements)
        self.depth -= 1

    def statement(self, statement: Statement) -> None:
        """One statement."""
        match statement:
            case Assign(place, value):
                value = UNSEEN if _is_unseen(place, value) else self.settled(value)
                self.say(f"{self.write(place)} := {self.write(value)};")
            case Copy(place, value):
                self.copy(place, value)
            case If():
                self.branches(statement)
            case For():
                self.loop(statement)
            case While(condition, body):
                self.loop_while(condition, body)
            case Leave():
                self.say("EXIT;")
            case Return(values):
                settled = [self.settled(value) for value in values]
                for name, value in zip(self.outputs, settled, strict=True):
                    self.say(f"{name} := {self.write(value)};")
                self.say("RETURN;")
            case Call():
                self.call(statement)

    def copy(self, place: Expression, value: Expression) -> None:
        """A structure; an array element by element, as not all tools take two arrays for the same type."""
        kind = place.type
        if not isinstance(kind, Array):
            self.say(f"{self.write(place)} := {self.write(value)};")
            return
        k = Variable(f"k {len(self.declared)}", "whole")
        self.declared[self.names.of(k.name)] = "LINT"
        inner = Array(kind.element, kind.shape[1:]) if len(kind.shape) > 1 else kind.element
        to, what = Element(place, (k,), inner), Element(value, (k,), inner)
        copied = Assign(to, what) if isinstance(inner, str) else Copy(to, what)
        self.loop(For(k, Constant(0, "whole"), Constant(kind.shape[0], "whole"), 1, (copied,)))

    def branches(self, statement: If) -> None:
        """IF with its ELSIFs; a condition that needs statements before it gets an IF of its own."""
        condition = statement.condition
        alone = not statement.otherwise
        if alone and isinstance(condition, Binary) and condition.operator == "and" and needs_if(condition):
            return self.branches(If(condition.left, (If(condition.right, statement.body),)))
        self.say(f"IF {self.write(self.settled(condition))} THEN")
        self.inner(statement.body)
        rest = statement.otherwise
        while len(rest) == 1 and isinstance(rest[0], If) and not needs_if(rest[0].condition):
            self.say(f"ELSIF {self.write(rest[0].condition)} THEN")
            self.inner(rest[0].body)
            rest = rest[0].otherwise
        if rest:
            self.say("ELSE")
            self.inner(rest)
        self.say("END_IF;")

    def loop(self, loop: For) -> None:
        """FOR, whose end belongs to the loop."""
        down = loop.step < 0
        if isinstance(loop.stop, Constant):
            end = str(int(loop.stop.value) + (1 if down else -1))
        else:
            end = f"{self.write(loop.stop)} {'+' if down else '-'} 1"
        by = "" if loop.step == 1 else f" BY {loop.step}"
        start = self.write(loop.start).strip("()")
        self.say(f"FOR {self.names.of(loop.variable.name)} := {start} TO {end}{by} DO")
        self.inner(loop.body)
        self.say("END_FOR;")

    def loop_while(self, condition: Expression, body: tuple[Statement, ...]) -> None:
        """WHILE; a condition that needs statements before it is tested within."""
        if not needs_if(condition):
            self.say(f"WHILE {self.write(condition)} DO")
            self.inner(body)
        else:
            self.say("WHILE TRUE DO")
            self.depth += 1
            self.say(f"IF {self.write(Unary('not', self.settled(condition), 'truth'))} THEN")
            self.inner([Leave("break")])
            self.say("END_IF;")
            self.block(body)
            self.depth -= 1
        self.say("END_WHILE;")

    def call(self, call: Call) -> None:
        """A call of a function, with the names of its parameters."""
        other = call.function
        written = self.text.signatures[other.name]
        arguments = [self.settled(argument) for argument in call.arguments]
        given = [f"{to} := {self.write(one)}" for to, one in zip(written.inputs, arguments, strict=True)]
        places = call.places or (None,) * len(other.returns)
        if len(other.returns) == 1:
            place = places[0]
            target = self.names.of(place.name) if place else self.spare(other.returns[0])
        else:
            target = self.spare("truth")
            given += [
                f"{out} => {self.names.of(place.name)}"
                for out, place in zip(written.outputs, places, strict=True)
                if place
            ]
        self.say(f"{target} := {written.name}({', '.join(given)});")

    def spare(self, kind: Kind) -> str:
        """A variable for a result that nobody needs."""
        key = f"unused {kind}"
        name = self.names.of(key)
        self.declared[name] = self.text.type_name(kind)
        return name


def add_function(text: Text, function: Function) -> None:
    """Write a function, behind those that it calls."""
    name = text.names.new(prefixed(text.prefix, function.name))
    writer = FunctionWriter(text, function, name)
    text.signatures[function.name] = Signature(name, writer.inputs, writer.outputs)
    unit = writer.unit()  # after the helpers that it asks for
    text.units.append(unit)


def add_program(text: Text, program: Program) -> None:
    """Write all structures and functions of a program."""
    text.tables |= program.tables
    given = (one.type for function in program.functions for one in function.parameters)
    text.handed_on |= {kind for kind in given if isinstance(kind, Array)}
    for struct in program.structs:
        text.add_struct(struct)
    for function in program.functions:
        add_function(text, function)
