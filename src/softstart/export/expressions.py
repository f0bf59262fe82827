"""Expressions of compiled Python -> typed expressions, and statements for what an expression cannot hold."""

from __future__ import annotations

import ast
import builtins
import inspect
import math
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import numpy as np

from softstart.controller.compiled import keep_state
from softstart.export.scope import ScopeReader
from softstart.export.source import leaves, python_function
from softstart.export.statements import (
    Apply,
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
    If,
    Place,
    Statement,
    Struct,
    Unary,
    Variable,
    changing,
)  # fmt: skip
from softstart.export.values import (
    OPERATORS,
    TEMPORARY,
    Choice,
    Known,
    NoRows,
    Row,
    Tuple,
    Value,
    applied,
    both,
    converted,
    extreme,
    is_number,
    is_simple,
    joined,
    kind_of,
    negated,
    number,
    operation,
    power,
    truth,
)  # fmt: skip
from softstart.kernel.block import clear, take_state
from softstart.kernel.jit import as_record
from softstart.kernel.motor import NEW_STATE, gauss

MATH = {
    "sqrt", "exp", "log", "expm1", "log1p", "sin", "cos", "tan", "atan", "atan2", "hypot", "pow", "copysign",
}  # fmt: skip


MOST_PRODUCTS = 0x10000  # exponent up to which numba multiplies
IN_ORDER = (inspect.Parameter.POSITIONAL_OR_KEYWORD,)  # what a parameter has to be
MOVES = {python_function(one) for one in (keep_state, take_state, clear)}


def _above_0(value: Expression) -> bool:
    return isinstance(value, Constant) and value.value > 0


class ExpressionReader(ScopeReader):
    """Reads the expressions of one function."""

    # expressions --------------------------------------------------------------------------------------

    def read_all(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """The values of expressions, in order: one keeps what it is when a later one changes something."""
        values: list[Value] = []
        for node in nodes:
            mark = len(self.out)
            value = self.value(node)
            if changing(self.out[mark:]):
                later, self.out = self.out[mark:], self.out[:mark]
                values = [
                    one
                    if isinstance(one, Constant)
                    else self.saved(one)
                    if is_number(one)
                    else self.frozen(one)
                    for one in values
                ]
                self.out += later
            values.append(value)
        return values

    def read_numbers(self, nodes: Sequence[ast.expr]) -> list[Expression]:
        """The same of numbers."""
        return [self._number(node, value) for node, value in zip(nodes, self.read_all(nodes), strict=True)]

    def _number(self, node: ast.AST, value: Value) -> Expression:
        if not is_number(value):
            self.fail(node, "what is no number", "use numbers here")
        assert isinstance(value, Expression)
        return value

    def _whole(self, node: ast.AST, value: Value) -> Expression:
        one = self._number(node, value)
        if one.type not in ("whole", "truth"):
            self.fail(node, "a number that may have a fraction", "make it whole by `int(...)`")
        return converted(one, "whole")

    def condition(self, node: ast.expr) -> Expression:
        """An expression as a truth."""
        if isinstance(node, ast.BoolOp):
            return self._bool_op(node, self.condition)
        return truth(self._number(node, self.value(node)))

    def _truth(self, node: ast.expr) -> Expression:
        one = self._number(node, self.value(node))
        if one.type != "truth":
            self.fail(node, "one of two numbers by `and` or `or`", "compare it, as with `!= 0`")
        return one

    def value(self, node: ast.expr) -> Value:
        """The value of an expression; calls and conditional parts become statements before it."""
        found = self._value(node)
        if isinstance(found, Constant) and found.type == "whole" and not -(2**63) <= found.value < 2**63:
            self.fail(node, "a whole number beyond 64 bits", "write it with a point")
        return found

    def _value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant():
                constant = number(node.value)
                return self.fail(node, "a text", "use numbers") if constant is None else constant
            case ast.Name():
                return self._name(node)
            case ast.Attribute():
                return self._attribute(node)
            case ast.Subscript():
                return self._subscript(node)
            case ast.Tuple():
                return Tuple(tuple(self.read_all(node.elts)))
            case ast.BinOp():
                return self._operation(node, node.op, *self.read_numbers([node.left, node.right]))
            case ast.UnaryOp():
                return self._unary(node)
            case ast.BoolOp():
                return self._bool_op(node, self._truth)
            case ast.Compare():
                return self._compare(node)
            case ast.IfExp():
                return self._if_exp(node)
            case ast.Call():
                return self._call(node)
            case _:
                self._refuse(node)

    def _name(self, node: ast.Name) -> Value:
        name = self.places.get(node.id, node.id)
        if name in self.env:
            return self.env[name]
        if name in self.kinds:
            return self.variable(name)
        if name in self.assigned:
            self.fail(node, "a name that may stand for different things", "use one name for each")
        closure = inspect.getclosurevars(self.function).nonlocals
        for names in (closure, self.function.__globals__, vars(builtins)):
            if name in names:
                return self._known(names[name], name)
        self.fail(node, "an unknown name", "define it before")

    def _known(self, thing: Any, name: str) -> Value:
        constant = number(thing)
        if constant is not None:
            return constant
        if isinstance(thing, np.ndarray) and thing.dtype == np.float64 and thing.ndim == 1:
            kind, tables = Array("real", thing.shape), self.translator.tables
            table = kind, tuple(thing.tolist())
            own = self.words & (self.assigned | set(inspect.signature(self.function).parameters))
            while name in own or (name in tables and repr(tables[name]) != repr(table)):
                name += "_2"
            tables[name] = table
            return Variable(name, kind)
        if isinstance(thing, tuple) and all(number(one) is not None for one in thing):
            return Tuple(tuple(self._known(one, name) for one in thing))
        return Known(thing)

    def _attribute(self, node: ast.Attribute) -> Value:
        base = self.value(node.value)
        if isinstance(base, Known):
            if not hasattr(base.thing, node.attr):
                self.fail(node, "an unknown name", "define it before")
            return self._known(getattr(base.thing, node.attr), node.attr)
        if isinstance(base, Choice):
            return self._of_choice(node, base)
        if node.attr == "shape":
            sizes = self._shape(base)
            if sizes is not None:
                return Tuple(tuple(Constant(size, "whole") for size in sizes))
        if isinstance(base, Expression) and isinstance(base.type, Struct):
            try:
                return Field(base, node.attr, base.type.member(node.attr).type)
            except StopIteration:
                pass
        self.fail(node, "this attribute", "use fields of records")

    def _of_choice(self, node: ast.Attribute, base: Choice) -> Value:
        """A field of one of two records: a number is read where it stands."""
        sides = []
        for one in (base.left, base.right):
            if not isinstance(one, Expression) or not isinstance(one.type, Struct):
                self.fail(node, "a field of this", "choose between records")
            sides.append(Field(one, node.attr, one.type.member(node.attr).type))
        left, right = sides
        if not (isinstance(left.type, str) and isinstance(right.type, str)):
            return Choice(base.condition, left, right)
        chosen = self.temporary(joined(left.type, right.type))
        branches = ((Assign(chosen, converted(one, kind_of(chosen))),) for one in (left, right))
        self.out.append(If(base.condition, *branches))
        return chosen

    @staticmethod
    def _shape(base: Value) -> tuple[int, ...] | None:
        match base:
            case NoRows():
                return 0, 0
            case Row(None, tail) if tail is not None and isinstance(tail.type, Array):
                return tail.type.shape
            case Variable() | Field() | Element() if isinstance(base.type, Array):
                return base.type.shape
            case _:
                return None

    def _subscript(self, node: ast.Subscript) -> Value:
        if isinstance(node.slice, ast.Slice):
            return self._slice(node, node.slice)
        nodes = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        base, *values = self.read_all([node.value, *nodes])
        indices: tuple[Expression, ...] = tuple(
            self._whole(one, value) for one, value in zip(nodes, values, strict=True)
        )
        if isinstance(base, Row) and base.head is None and base.tail is not None:
            base = base.tail
        if isinstance(base, Tuple):
            return self._item(node, base, indices[0])
        if (
            isinstance(base, Expression)
            and isinstance(base.type, Array)
            and len(indices) <= len(base.type.shape)
        ):
            left = base.type.shape[len(indices) :]
            pairs = list(zip(indices, base.type.shape, strict=False))
            if any(isinstance(one, Constant) and not -size <= one.value < size for one, size in pairs):
                self.fail(node, "an index beyond the last element", "use one that there is")
            indices = tuple(
                Constant(one.value % size, "whole") if isinstance(one, Constant)
                else one if self.translator.in_bounds else self._from_the_end(one, size)
                for one, size in pairs
            )  # fmt: skip
            return Element(base, indices, Array(base.type.element, left) if left else base.type.element)
        self.fail(node, "this index", "give rows of numbers names with `as_record`")

    def _from_the_end(self, index: Expression, size: int) -> Expression:
        """An index of 0 and more; those below count from the end."""
        counts = isinstance(index, Variable) and index.name in self.counting
        if counts or (isinstance(index, Binary) and index.operator == "%" and _above_0(index.right)):
            return index
        found = self.temporary("whole")
        self.out.append(Assign(found, index))
        below = operation("<", found, Constant(0, "whole"))
        self.out.append(If(below, (Assign(found, operation("+", found, Constant(size, "whole"))),)))
        return found

    def _item(self, node: ast.Subscript, base: Tuple, index: Expression) -> Value:
        size = len(base.items)
        if isinstance(index, Constant):
            if not -size <= index.value < size:
                self.fail(node, "an index beyond the last value", "use one that there is")
            return base.items[int(index.value)]
        index = self._from_the_end(index, size)
        numbers = [self._number(node, item) for item in base.items]
        index = index if is_simple(index) else self.saved(index)
        chosen = self.temporary(joined(*(kind_of(one) for one in numbers)))
        branch: tuple[Statement, ...] = ()
        for place, one in reversed(list(enumerate(numbers))):
            store = Assign(chosen, converted(one, kind_of(chosen)))
            branch = (
                (If(operation("==", index, Constant(place, "whole")), (store,), branch),)
                if branch
                else (store,)
            )
        self.out += branch
        return chosen

    def _slice(self, node: ast.Subscript, cut: ast.Slice) -> Value:
        """`row[:n]` is its record and `row[n:]` what stands behind, for the n at which they meet."""
        base = self.value(node.value)
        if isinstance(base, Row) and cut.step is None and (cut.lower is None) != (cut.upper is None):
            return Row(base.head, None) if cut.lower is None else Row(None, base.tail)
        self._refuse(cut)

    def _operation(
        self, node: ast.AST, operator: ast.operator, left: Expression, right: Expression
    ) -> Expression:
        if isinstance(operator, ast.Pow):
            return self._power(node, left, right)
        if isinstance(operator, ast.BitAnd) and isinstance(left, Constant) and isinstance(right, Constant):
            return Constant(int(left.value) & int(right.value), "whole")
        if type(operator) not in OPERATORS:
            self.fail(node, f"the operator {type(operator).__name__}", "use + - * / // % **, and, or, not")
        return operation(OPERATORS[type(operator)], left, right)

    def _power(self, node: ast.AST, left: Expression, right: Expression) -> Expression:
        """Products where numba takes them: for whole exponents that are known, and the square."""
        whole = joined(kind_of(left), kind_of(right)) in ("truth", "whole")
        known = right.value if isinstance(right, Constant) and right.type == "whole" else 0
        if 0 < known <= MOST_PRODUCTS or (-MOST_PRODUCTS <= known < 0 and not whole):
            result = power(left if is_simple(left) else self.saved(left), abs(int(known)))
            return result if known > 0 else operation("/", Constant(1.0, "real"), result)
        if isinstance(right, Constant) and right.value in (1, 2) and not whole:
            base = converted(left, joined("real", kind_of(left)))
            return power(base if is_simple(base) else self.saved(base), int(right.value))
        if whole:
            self.fail(node, "this power of a whole number", "make the base a float")
        return applied("pow", [left, right])

    def _unary(self, node: ast.UnaryOp) -> Expression:
        if isinstance(node.op, ast.Not):
            return negated(self.condition(node.operand))
        operand = self._number(node.operand, self.value(node.operand))
        if isinstance(node.op, ast.USub):
            operand = converted(operand, joined("whole", kind_of(operand)))
            return (
                Constant(-operand.value, operand.type)
                if isinstance(operand, Constant)
                else Unary("-", operand, kind_of(operand))
            )
        return (
            self.fail(node, "this operator", "use - or not") if isinstance(node.op, ast.Invert) else operand
        )

    def _bool_op(self, node: ast.BoolOp, read: Callable[[ast.expr], Expression]) -> Expression:
        operator = "and" if isinstance(node.op, ast.And) else "or"
        result = read(node.values[0])
        for one in node.values[1:]:
            if isinstance(result, Constant) and bool(result.value) == (operator == "or"):
                return result
            outer, self.out = self.out, []
            right = read(one)
            before, self.out = self.out, outer
            if not before:
                result = both(operator, result, right)
                continue
            # what the right side needs is done only where the left one does not decide
            chosen = self.temporary("truth")
            self.out.append(Assign(chosen, result))
            condition: Expression = chosen if operator == "and" else negated(chosen)
            self.out.append(If(condition, (*before, Assign(chosen, right))))
            result = chosen
        return result

    def _compare(self, node: ast.Compare) -> Expression:
        if isinstance(node.ops[0], ast.In | ast.NotIn):
            items = node.comparators[0]
            if not isinstance(items, ast.Tuple):
                self.fail(node, "`in` of this", "write the values as a tuple")
            left, *others = self.read_numbers([node.left, *items.elts])
            found: Expression = Constant(False, "truth")
            for other in others:
                found = both("or", found, operation("==", left, other))
            return negated(found) if isinstance(node.ops[0], ast.NotIn) else found
        mark = len(self.out)
        numbers = self.read_numbers([node.left, *node.comparators])
        if len(node.ops) > 1 and changing(self.out[mark:]):  # Python may not come to the last one
            self.fail(node, "a call that changes a record in such a chain", "compare two by two, with `and`")
        result: Expression = Constant(True, "truth")
        for left, operator, right in zip(numbers, node.ops, numbers[1:], strict=False):
            if type(operator) not in OPERATORS:
                self.fail(node, "this comparison", "compare numbers by < <= > >= == !=")
            result = both("and", result, operation(OPERATORS[type(operator)], left, right))
        return result

    def _if_exp(self, node: ast.IfExp) -> Value:
        condition = self.condition(node.test)
        if isinstance(condition, Constant):
            return self.value(node.body if condition.value else node.orelse)
        outer, values = self.out, []
        branches: list[tuple[list[Expression], list[Statement], bool]] = []
        for one in (node.body, node.orelse):
            self.out = []
            values.append(value := self.value(one))
            if isinstance(value, Expression) and isinstance(value.type, Struct) and not self.out:
                branches.append(([], [], False))
                continue
            items = value.items if isinstance(value, Tuple) else (value,)
            branches.append(([self._number(one, item) for item in items], self.out, isinstance(value, Tuple)))
        self.out = outer
        if not branches[0][0] and not branches[1][0]:
            return Choice(self.saved(condition), *values)
        (left, before, several), (right, other, _) = branches
        if len(left) != len(right):
            self.fail(node, "two branches of different length", "give both as many values")
        pairs = list(zip(left, right, strict=True))
        chosen = [self.temporary(joined(kind_of(a), kind_of(b))) for a, b in pairs]
        for chosen_from, statements in ((left, before), (right, other)):
            statements += [
                Assign(place, converted(value, kind_of(place)))
                for place, value in zip(chosen, chosen_from, strict=True)
            ]
        self.out.append(If(condition, tuple(before), tuple(other)))
        return Tuple(tuple(chosen)) if several else chosen[0]

    # calls --------------------------------------------------------------------------------------------

    def _call(self, node: ast.Call) -> Value:
        callee = self.value(node.func)
        if not isinstance(callee, Known) or node.keywords:
            self.fail(node, "this call", "call functions by name, with arguments in order")
        function = callee.thing
        if function is as_record:
            return self._record(node)
        arguments = self.read_all(node.args)
        plain = self._plain(node, function, arguments)
        if plain is not None:
            return plain
        made = python_function(function)
        if made is None or made is function:
            self.fail(node, "a call of this", "call functions of math, or compiled ones (`@compiled`)")
        if made in MOVES:
            return self._move_state(node, made.__name__, arguments)
        return self._invoke(node, made, arguments)

    def _record(self, node: ast.Call) -> Value:
        row, dtype = self.read_all(node.args)
        if isinstance(row, Row):
            row = row.head if row.head is not None else row
        if isinstance(row, Expression) and isinstance(row.type, Struct) and isinstance(dtype, Known):
            asked = self.translator.structs.of(dtype.thing)
            same = [member.name for member in row.type.members[: len(asked.members)]]
            if row.type == asked or same == [member.name for member in asked.members]:
                return row  # it, or what it begins with
        self.fail(node, "another record than what is given", "use the records that `compiled_step` is given")

    def _plain(self, node: ast.Call, function: Any, arguments: list[Value]) -> Value | None:
        """A function of Python, math or NumPy that is one of numbers; None for others."""
        module, name = getattr(function, "__module__", None), getattr(function, "__name__", "")
        if python_function(function) is python_function(gauss):
            return applied("gauss", [self._number(node, one) for one in arguments])
        if function not in (min, max, abs, int, float, bool) and module not in ("math", "numpy"):
            return None
        if isinstance(function, np.ufunc):
            name = function.__name__
        numbers = [self._number(node, one) for one in arguments]
        match name:
            case "min" | "max" if len(numbers) > 1:
                return extreme(name, numbers)
            case "abs" | "fabs":
                kind = joined("whole", kind_of(numbers[0]))
                one = converted(numbers[0], kind)
                return applied("abs", [one]) if kind != "whole" else Apply("abs", (one,), "whole")
            case "int":
                return converted(numbers[0], "whole")
            case "float":
                return converted(numbers[0], joined("real", kind_of(numbers[0])))
            case "bool":
                return truth(numbers[0])
            case "floor" | "ceil" if module != "math":  # NumPy keeps the kind
                return applied(name, numbers)
            case "floor" | "ceil":
                one = numbers[0]
                return one if one.type == "whole" else converted(applied(name, [one]), "whole")
            case "isnan" | "isfinite" | "isinf":
                tested = applied(
                    "abs" if name == "isinf" else name, numbers, None if name == "isinf" else "truth"
                )
                return (
                    operation("==", tested, Constant(math.inf, kind_of(tested)))
                    if name == "isinf"
                    else tested
                )
            case "sign" | "nextafter":
                return applied(name, numbers)
            case _ if name in MATH and module == "math":
                return applied(name, numbers)
        self.fail(node, f"the function {name}", "use functions of math")

    def _move_state(self, node: ast.Call, name: str, rows: list[Value]) -> Value:
        """`keep_state`, `take_state` and `clear`: all fields of the state, copied or 0."""
        heads = [row.head if isinstance(row, Row) else row for row in rows]
        for one in heads:
            if one is not None and not (isinstance(one, Expression) and isinstance(one.type, Struct)):
                self.fail(node, "this call", "hand on rows that have records")
        structs = [one for one in heads if isinstance(one, Expression)]
        if len(structs) < len(rows):
            kinds = [one.type for one in structs]
            if any(isinstance(kind, Struct) and len(kind.members) > NEW_STATE for kind in kinds):
                self.fail(node, "a state without a record", "give `compiled_step` its record")
            return Tuple(())  # a strategy without a state
        state, command = (structs[-1], structs[0]) if name != "keep_state" else (structs[0], structs[1])
        assert isinstance(state.type, Struct)
        target = command if name == "keep_state" else state
        self._note_change(node, target)
        for member in state.type.members:
            place = Field(target, member.name, member.type)
            source = Field(state if name == "keep_state" else command, member.name, member.type)
            if name == "clear":
                self._clear(place)
            else:
                self.out.append(
                    Assign(place, source) if isinstance(member.type, str) else Copy(place, source)
                )
        return Tuple(())

    def _clear(self, place: Place) -> None:
        """0 in a number, a record or an array."""
        if isinstance(place.type, str):
            self.out.append(Assign(place, converted(Constant(0, "whole"), place.type)))
        elif isinstance(place.type, Struct):
            for member in place.type.members:
                self._clear(Field(place, member.name, member.type))
        else:
            element, (size, *rest) = place.type.element, place.type.shape
            outer, self.out = self.out, []
            index = Variable(f"{TEMPORARY}{len(place.type.shape)}_at", "whole")
            self.kinds[index.name] = "whole"
            self._clear(Element(place, (index,), Array(element, tuple(rest)) if rest else element))
            body, self.out = tuple(self.out), outer
            zero, end = Constant(0, "whole"), Constant(size, "whole")
            self.out.append(For(index, zero, end, 1, body))

    def _invoke(self, node: ast.Call, function: Callable[..., Any], arguments: list[Value]) -> Value:
        def fail(sentence: str) -> NoReturn:
            self.fail(node, sentence, "write a loop")

        wanted = list(inspect.signature(function).parameters.values())
        arguments = arguments + [
            self._known(one.default, one.name)
            for one in wanted[len(arguments) :]
            if one.default is not inspect.Parameter.empty
        ]
        if len(arguments) != len(wanted) or any(one.kind not in IN_ORDER for one in wanted):
            self.fail(node, "another number of arguments", "hand on each of them, in order")
        made = self.translator.function(function, arguments, fail)
        pieces = [leaf for argument in arguments for leaf in leaves(argument)]
        taken = self.translator.taken[made]
        handed = [leaf for leaf, takes in zip(pieces, taken, strict=True) if takes]
        parameters = list(made.parameters)
        changes = [
            one for one, parameter in zip(handed, parameters, strict=True) if parameter.name in made.changed
        ]
        for one in changes:
            self._note_change(node, one)
        values = tuple(
            converted(one, parameter.type) if isinstance(parameter.type, str) else one
            for one, parameter in zip(handed, parameters, strict=True)
        )
        places = tuple(self.temporary(kind) for kind in made.returns)
        self.out.append(Call(made, values, places))
        return places[0] if len(places) == 1 else Tuple(places)
