"""Expressions of typed statements as Structured Text, and the variables of the function they stand in."""

from __future__ import annotations

import textwrap

from softstart.errors import InputError
from softstart.export.st_helpers import HELPERS
from softstart.export.st_names import INFINITY, INFINITY_NAME, Names, literal
from softstart.export.st_text import Text
from softstart.export.st_units import Declared
from softstart.export.statements import (
    Apply,
    Array,
    Assign,
    Binary,
    Call,
    Constant,
    Convert,
    Element,
    Expression,
    Field,
    For,
    Kind,
    Statement,
    Struct,
    Unary,
    Variable,
    parts,
    walk,
)  # fmt: skip

WIDEST = 110  # characters of a line, where a call is broken
STANDARD = {
    "sqrt": "SQRT", "exp": "EXP", "log": "LN", "sin": "SIN", "cos": "COS", "tan": "TAN", "atan": "ATAN",
    "abs": "ABS", "pow": "EXPT",
}  # fmt: skip
OPERATORS = {"==": "=", "!=": "<>", "and": "AND", "or": "OR"}
STRENGTH = {
    "*": 5,
    "/": 5,
    "+": 4,
    "-": 4,
    "<": 3,
    "<=": 3,
    ">": 3,
    ">=": 3,
    "==": 2,
    "!=": 2,
    "and": 1,
    "or": 0,
}
ATOM = 9
MAY_FAIL = frozenset({"sqrt", "exp", "log", "pow", "tan"})  # functions that have no value for some numbers


def assigned(body: tuple[Statement, ...]) -> set[str]:
    """Names of the variables that a body assigns to."""
    found = set()
    for statement in walk(body):
        match statement:
            case Assign(place=Variable(name)) | For(variable=Variable(name)):
                found.add(name)
            case Call(places=places):
                found |= {place.name for place in places if place is not None}
            case _:
                pass
    return found


def could_fail(part: Expression) -> bool:
    """Whether this part of an expression has no value for some numbers, and is evaluated only if needed."""
    match part:
        case Binary("/" | "//" | "%"):
            return True
        case Element(_, indices):
            return not all(isinstance(index, Constant) for index in indices)
        case Apply(function):
            return function in MAY_FAIL
        case Convert(operand, "whole"):
            return operand.type in ("real", "double")
        case _:
            return False


def needs_if(condition: Expression) -> bool:
    """Whether an AND or OR in it must not evaluate its right side in vain."""
    return any(
        isinstance(part, Binary)
        and part.operator in ("and", "or")
        and any(map(could_fail, parts(part.right)))
        for part in parts(condition)
    )


class Scope:
    """Variables of a function or block, and the lines of its body."""

    def __init__(self, text: Text) -> None:
        self.text = text
        self.names = Names(text.names)
        self.declared: dict[str, str] = {}  # name as written: type as written
        self.infinities: set[str] = set()  # types of numbers of which infinity is needed
        self.lines: list[str] = []
        self.depth = 0

    def say(self, line: str) -> None:
        """A statement, or a part of one, in the body."""
        indent = "    " * self.depth
        self.lines += textwrap.wrap(
            line, WIDEST, initial_indent=indent, subsequent_indent=indent + "    ",
            break_long_words=False, break_on_hyphens=False,
        )  # fmt: skip

    # expressions ------------------------------------------------------------------------------------------

    def write(self, expression: Expression) -> str:
        """An expression as it is written."""
        return self._written(expression)[0]

    def _within(self, expression: Expression, strength: int) -> str:
        """In brackets if it holds together less than that."""
        text, own = self._written(expression)
        return text if own >= strength else f"({text})"

    def _written(self, expression: Expression) -> tuple[str, int]:
        """Its text, and how strongly it holds together."""
        match expression:
            case Constant(value, kind):
                return self.constant(value, kind), ATOM
            case Variable(name):
                return self.names.of(name), ATOM
            case Field(base, name):
                assert isinstance(base.type, Struct)
                return f"{self.write(base)}.{self.text.field_name(base.type, name)}", ATOM
            case Element(base, indices):
                if isinstance(base, Element) and isinstance(base.type, Array):  # of a row
                    return self._written(Element(base.base, base.indices + indices, expression.type))
                assert isinstance(base.type, Array)
                if len(indices) != len(base.type.shape):
                    raise InputError(
                        "A row of a matrix cannot be handed on in Structured Text; hand on both."
                    )
                return f"{self.write(base)}[{', '.join(map(self.write, indices))}]", ATOM
            case Unary("not", operand):
                return f"NOT {self._within(operand, ATOM)}", 6
            case Unary(_, operand):
                return f"-{self._within(operand, ATOM)}", 4
            case Convert(operand, kind):
                return self._converted(operand, kind), ATOM
            case Apply(function, arguments, kind):
                return self._applied(function, arguments, kind), ATOM
            case Binary():
                return self._binary(expression)

    def constant(self, value: float, kind: Kind) -> str:
        """A number as it is written; notes that an infinity must be declared."""
        text = literal(value, kind, self.text.single)
        if INFINITY_NAME in text:
            real = self.text.type_name(kind)
            self.infinities.add(real)
            if real != self.text.type_name("real"):
                text = text.replace(INFINITY_NAME, f"{INFINITY_NAME}_{real.lower()}")
        return text

    def _binary(self, expression: Binary) -> tuple[str, int]:
        operator, left, right = expression.operator, expression.left, expression.right
        if operator in ("//", "%"):
            if expression.type != "whole":
                raise InputError(f"`{operator}` of real numbers has no counterpart in Structured Text.")
            name = self.text.helper("floor_quotient" if operator == "//" else "floor_remainder")
            return f"{name}({self.write(left)}, {self.write(right)})", ATOM
        if operator in ("==", "!=") and left.type == "truth":
            text = f"({self._within(left, ATOM)} XOR {self._within(right, ATOM)})"
            return (text, ATOM) if operator == "!=" else (f"NOT {text}", 6)
        strength = STRENGTH[operator]
        word = OPERATORS.get(operator, operator)
        if operator in ("and", "or"):  # in brackets, but for a chain of the same
            same = isinstance(left, Binary) and left.operator == operator
            return f"{self._within(left, strength if same else 6)} {word} {self._within(right, 6)}", strength
        # brackets at the right keep the order of rounding
        return f"{self._within(left, strength)} {word} {self._within(right, strength + 1)}", strength

    def _converted(self, operand: Expression, kind: Kind) -> str:
        before, after = self.text.type_name(operand.type), self.text.type_name(kind)
        if before == after:
            return self._within(operand, ATOM)
        if isinstance(operand, Constant):
            return self.constant(float(operand.value), kind)
        if before == "BOOL":
            text = f"{self.text.helper('from_truth')}({self.write(operand)})"
            return text if after == "LINT" else f"LINT_TO_{after}({text})"
        if after == "LINT":
            helper = "cut"
            if isinstance(operand, Apply) and operand.function in ("floor", "ceil"):
                helper, operand = operand.function, operand.arguments[0]
            return f"{self.text.helper(helper)}({self._double(operand)})"
        if after == "BOOL":
            return f"({self._within(operand, 4)} <> {'0' if before == 'LINT' else '0.0'})"
        return f"{before}_TO_{after}({self.write(operand)})"

    def _double(self, number: Expression) -> str:
        """A number as LREAL."""
        text = self.write(number)
        return text if self.text.type_name(number.type) == "LREAL" else f"REAL_TO_LREAL({text})"

    def _applied(self, function: str, arguments: tuple[Expression, ...], kind: Kind) -> str:
        given = ", ".join(map(self.write, arguments))
        argument = arguments[0].type
        assert isinstance(argument, str)
        if function == "abs" and kind == "whole":
            return f"{self.text.helper('abs_whole')}({given})"
        if function in STANDARD:
            return f"{STANDARD[function]}({given})"
        if function in ("floor", "ceil"):
            function += "_real"
        if function not in HELPERS:
            raise InputError(f"{function} has no counterpart in Structured Text.")
        return f"{self.text.helper(function, argument)}({given})"

    def constants(self) -> list[Declared]:
        """The infinities that have been asked for."""
        real = self.text.type_name("real")
        found = []
        for kind in sorted(self.infinities):
            name = INFINITY_NAME if kind == real else f"{INFINITY_NAME}_{kind.lower()}"
            value = literal(INFINITY, "real" if kind == real else "double", self.text.single)
            found.append(Declared(name, kind, value))
        return found

    # what stands before a statement -----------------------------------------------------------------------

    def settled(self, expression: Expression) -> Expression:
        """The expression without an AND or OR whose right side could fail: those are evaluated before it."""
        match expression:
            case Binary("and" | "or" as operator, left, right, kind):
                left = self.settled(left)
                if not any(map(could_fail, parts(right))):
                    return Binary(operator, left, self.settled(right), kind)
                found = Variable(f"{operator} {len(self.declared)}", "truth")  # no name of Python
                self.declared[self.names.of(found.name)] = "BOOL"
                self.say(f"{self.names.of(found.name)} := {self.write(left)};")
                self.say(
                    f"IF {self.write(found if operator == 'and' else Unary('not', found, 'truth'))} THEN"
                )
                self.depth += 1
                self.say(f"{self.names.of(found.name)} := {self.write(self.settled(right))};")
                self.depth -= 1
                self.say("END_IF;")
                return found
            case Binary(operator, left, right, kind):
                return Binary(operator, self.settled(left), self.settled(right), kind)
            case Unary(operator, operand, kind):
                return Unary(operator, self.settled(operand), kind)
            case Convert(operand, kind):
                return Convert(self.settled(operand), kind)
            case Apply(function, arguments, kind):
                return Apply(function, tuple(map(self.settled, arguments)), kind)
            case _:
                return expression
