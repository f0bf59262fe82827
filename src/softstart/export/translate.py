"""Compiled Python -> typed statements.

A function is read once for each set of types that it is called with. It may assign numbers to variables and
to fields of records, compute with `+ - * / // % **`, compare, call `min max abs int float bool`, functions
of `math`, and compiled functions; and use `if`, `for` over a `range` or a tuple, `while`, `break`,
`continue`, `return`, conditional expressions, tuples, and other names for parts of records. What cannot be
translated is refused with its file and line: nothing is guessed.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NoReturn

from softstart.errors import InputError
from softstart.export.expressions import ExpressionReader
from softstart.export.simplify import simplified
from softstart.export.source import parsed, python_function
from softstart.export.statements import (
    Array,
    Assign,
    Call,
    Constant,
    Copy,
    Element,
    Expression,
    Field,
    For,
    Function,
    If,
    Leave,
    Program,
    Return,
    Statement,
    Struct,
    Variable,
    While,
    changing,
    ends,
    expressions,
    parts,
    walk,
)  # fmt: skip
from softstart.export.values import (
    Choice,
    Known,
    NoRows,
    Row,
    Structs,
    Tuple,
    Value,
    converted,
    is_number,
    joined,
    kind_of,
    negated,
)  # fmt: skip

TEMPORARY = "value_"
MOST_PASSES = 8  # over a function, until the kinds of its variables stay


class Translator:
    """Translates functions into one program, each set of argument types once.

    Parameters
    ----------
    sizes : sizes of arrays in records that the export shrinks, old: new.
    in_bounds : all indices are 0 or more, known beforehand; else those below count from the end.
    """

    def __init__(self, sizes: dict[int, int] | None = None, in_bounds: bool = False) -> None:
        self.in_bounds = in_bounds
        self.structs = Structs(sizes)
        self.tables: dict[str, tuple[Array, tuple[float, ...]]] = {}
        self.taken: dict[Function, list[bool]] = {}  # of the arguments, which ones are handed on
        self._made: dict[Any, Function] = {}
        self._open: list[Any] = []
        self._masks: dict[Any, set[str]] = {}

    def function(
        self, function: Callable[..., Any], arguments: Sequence[Value], fail: Any = None
    ) -> Function:
        """The statements of a function for arguments of these types."""
        names = inspect.signature(function).parameters
        masks = self.masked(function)
        key = (
            function,
            tuple(
                _signature(argument, name in masks) for name, argument in zip(names, arguments, strict=True)
            ),
        )
        if key in self._open:
            (fail or _refuse_recursion)(f"{function.__name__} calls itself")
        if key not in self._made:
            self._open.append(key)
            reader = Reader(self, function, arguments)
            made = self._made[key] = reader.read()
            self.taken[made] = reader.taken
            self._open.pop()
        return self._made[key]

    @staticmethod
    def constant(number: int) -> Constant:
        """A whole number that is known."""
        return Constant(number, "whole")

    def masked(self, function: Callable[..., Any]) -> set[str]:
        """Parameters whose bits are read: the function is translated for each of their values."""
        if function in self._masks:
            return self._masks[function]
        masks = self._masks[function] = set()
        for node in ast.walk(parsed(function)):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitAnd):
                masks |= {one.id for one in (node.left, node.right) if isinstance(one, ast.Name)}
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                called = python_function(function.__globals__.get(node.func.id))
                names = inspect.signature(called).parameters if called and called is not function else ()
                handed = [one.id if isinstance(one, ast.Name) else "" for one in node.args]
                bits = self.masked(called) if called and called is not function else set()
                masks |= {one for one, name in zip(handed, names, strict=False) if one and name in bits}
        return masks

    def program(self, entry: Function) -> Program:
        """All that the entry needs, with names that differ from one another."""
        functions: list[Function] = []
        structs: dict[str, Struct] = {}
        _collect(entry, functions)
        taken = {name.lower() for name in self.tables}
        for function in functions:
            base, count = function.name, 2
            while function.name.lower() in taken:
                function.name, count = f"{base}_{count}", count + 1
            taken.add(function.name.lower())
            for variable in function.parameters:
                _collect_structs(variable.type, structs)
        return Program(list(structs.values()), functions, self.tables)


def _collect(function: Function, found: list[Function]) -> None:
    for statement in walk(function.body):
        if isinstance(statement, Call) and statement.function not in found:
            _collect(statement.function, found)
    if function not in found:
        found.append(function)


def _collect_structs(kind: Any, found: dict[str, Struct]) -> None:
    if isinstance(kind, Array):
        _collect_structs(kind.element, found)
    elif isinstance(kind, Struct) and kind.name not in found:
        for member in kind.members:
            _collect_structs(member.type, found)
        found[kind.name] = kind


def _refuse_recursion(sentence: str) -> NoReturn:
    raise InputError(f"{sentence}: this cannot be exported; write a loop.")


def _signature(value: Value, constant: bool) -> Any:
    """What a function is translated again for."""
    match value:
        case Tuple(items):
            return tuple(_signature(item, False) for item in items)
        case Known(thing):
            return id(thing)
        case Row(head, tail):
            return "row", head and head.type, tail and tail.type
        case NoRows():
            return "no rows"
        case Choice():
            return "choice"  # it fails
        case Constant(number, kind) if constant:
            return kind, number
        case _:
            return value.type


class Reader(ExpressionReader):
    """Reads one function."""

    # the function as a whole -------------------------------------------------------------------------

    def read(self) -> Function:
        """Read until the kinds of all variables stay, then say what they are."""
        self._check_loop_variables()
        given_by_name = self.tree.args
        if (
            given_by_name.posonlyargs
            or given_by_name.kwonlyargs
            or given_by_name.vararg
            or given_by_name.kwarg
        ):
            self.fail(self.tree, "a function with such parameters", "write them without `*` and `/`")
        for _ in range(MOST_PASSES):
            before = dict(self.kinds), self.returns
            self._pass()
            if (self.kinds, self.returns) == before:
                break
        else:
            self.fail(
                self.tree, "a function whose kinds of numbers do not settle", "give variables new names"
            )
        if self.returns and not ends(tuple(self.out)):
            self.fail(self.tree, "a function that may end without a value", "return one at its end")
        given = {parameter.name for parameter in self.parameters}
        doc = (ast.get_docstring(self.tree) or "").split("\n")[0].rstrip(".")
        made = Function(
            self.tree.name, tuple(self.parameters), self.returns or (), {}, simplified(self.out),
            frozenset(self.changed), doc,
        )  # fmt: skip
        used = {
            part.name
            for statement in walk(made.body)
            for expression in expressions(statement)
            for part in parts(expression)
            if isinstance(part, Variable)
        }
        made.locals = {name: kind for name, kind in self.kinds.items() if name in used and name not in given}
        return made

    def _pass(self) -> None:
        self.env: dict[str, Value] = {}
        self.kinds = {
            name: kind
            for name, kind in self.kinds.items()
            if name in self.words or not name.startswith(TEMPORARY)
        }
        self.places = {}
        self.parameters: list[Variable] = []
        self.taken: list[bool] = []
        self.changed: set[str] = set()
        self.out: list[Statement] = []
        self.temporaries = 0
        for name, argument in zip((one.arg for one in self.tree.args.args), self.arguments, strict=True):
            self._bind_parameter(name, argument)
        for node in self.tree.body:
            if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
                self.statement(node)

    def _bind_parameter(self, name: str, argument: Value) -> None:
        if isinstance(argument, Tuple):
            names = [self.fresh(f"{name}_{place}") for place in range(len(argument.items))]
            for one, item in zip(names, argument.items, strict=True):
                self._bind_parameter(one, item)
            self.env[name] = Tuple(tuple(self.env.get(one) or self.variable(one) for one in names))
        elif isinstance(argument, Row):
            pieces = [
                None if piece is None else self._parameter(f"{name}{ending}", piece.type)
                for piece, ending in ((argument.head, ""), (argument.tail, "_tail"))
            ]
            self.env[name] = Row(*pieces)
        elif isinstance(argument, Known | NoRows) or (
            isinstance(argument, Constant) and name in self.translator.masked(self.function)
        ):
            self.env[name] = argument
            self.taken.append(False)
        elif isinstance(argument, Choice):
            self.fail(self.tree, "one of two records as an argument", "call the function in each branch")
        else:
            variable = self._parameter(name, argument.type)
            if name in self.widened:
                changed = self.places[name] = self.fresh(f"{name}_changed")
                kind = joined(self.widened[name], self.kinds.get(changed, self.widened[name]))
                self.out.append(Assign(Variable(changed, kind), converted(variable, kind)))
            if isinstance(argument.type, str):
                self.kinds[name] = argument.type
            else:
                self.env[name] = variable

    def _parameter(self, name: str, kind: Any) -> Variable:
        variable = Variable(name, kind)
        self.parameters.append(variable)
        self.taken.append(True)
        return variable

    def _check_loop_variables(self) -> None:
        """A loop variable is read within its loops alone, and assigned to by nothing else."""
        loops = [node for node in ast.walk(self.tree) if isinstance(node, ast.For)]
        names = {node.target.id for node in loops if isinstance(node.target, ast.Name)}
        inside = {
            id(node)
            for loop in loops
            for inner in loop.body
            for node in ast.walk(inner)
            if isinstance(node, ast.Name) and isinstance(loop.target, ast.Name) and node.id == loop.target.id
        }
        targets = {id(loop.target) for loop in loops} - inside
        inside |= targets
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Name) and node.id in names and node.id != "_":
                stored = isinstance(node.ctx, ast.Store) and id(node) not in targets
                if stored or id(node) not in inside:
                    self.fail(node, "a loop variable beyond its loop", "use another name for it")

    # statements ---------------------------------------------------------------------------------------

    def block(self, nodes: Iterable[ast.stmt]) -> tuple[Statement, ...]:
        """The statements of a branch. Names for parts of records that it introduces end with it."""
        outer, env = self.out, dict(self.env)
        self.out = []
        for node in nodes:
            self.statement(node)
        inner, self.out = self.out, outer
        self.env = {name: value for name, value in env.items() if self.env.get(name) is value}
        return tuple(inner)

    def statement(self, node: ast.stmt) -> None:
        """Translate one statement."""
        match node:
            case ast.Assign():
                self._assign(node)
            case ast.AugAssign():
                place = ast.parse(ast.unparse(node.target), mode="eval").body
                ast.copy_location(place, node)
                mark = len(self.out)
                left, right = self.read_numbers([place, node.value])
                if changing(self.out[mark:]) and any(
                    isinstance(one, ast.Subscript) for one in ast.walk(place)
                ):
                    self.fail(
                        node, "an index beside a call that changes a record", "call it on a line before"
                    )
                self.store(node.target, self._operation(node, node.op, left, right))
            case ast.AnnAssign(value=value) if value is not None:
                self.store(node.target, self.value(value))
            case ast.If():
                self._if(node)
            case ast.For():
                self._for(node)
            case ast.While():
                self._while(node)
            case ast.Return():
                self._return(node)
            case ast.Break():
                self.out.append(Leave("break"))
            case ast.Continue():
                self.out.append(Leave("continue"))
            case ast.Pass():
                pass
            case ast.Expr():
                self.value(node.value)
            case _:
                self._refuse(node)

    def _assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        if len(node.targets) > 1 and is_number(value) and not isinstance(value, Constant):
            assert isinstance(value, Expression)
            value = self.saved(value)
        value = self.frozen(value) if len(node.targets) > 1 else value
        for target in node.targets:
            self.store(target, value)

    def store(self, target: ast.expr, value: Value) -> None:
        """Assign a value to a name, a field, an element or several of these."""
        if isinstance(target, ast.Tuple):
            if not isinstance(value, Tuple) or len(value.items) != len(target.elts):
                self.fail(target, "what is not so many values", "write the values one by one")
            for one, item in zip(target.elts, value.items, strict=True):
                if isinstance(one, ast.Attribute | ast.Subscript) and not is_number(item):
                    self.fail(target, "a copy of several records", "copy one by one")
            # all values are taken before the first is stored
            items = [self.saved(item) if self._at_risk(item, target) else item for item in value.items]
            for one, item in zip(target.elts, items, strict=True):
                self.store(one, item)
        elif isinstance(target, ast.Name):
            self._store_name(target, value)
        elif isinstance(target, ast.Attribute | ast.Subscript):
            mark = len(self.out)
            place = self.value(target)
            if changing(self.out[mark:]):
                self.fail(target, "a call that changes a record in a place", "call it on a line before")
            if not isinstance(place, Field | Element) or not isinstance(value, Expression):
                self.fail(target, "this place", "assign numbers to fields of records")
            self._note_change(target, place)
            if isinstance(place.type, str):
                self.out.append(Assign(place, converted(self._number(target, value), place.type)))
            else:
                self.out.append(Copy(place, value))
        else:
            self._refuse(target)

    def _at_risk(self, item: Value, target: ast.Tuple) -> bool:
        """Whether a value may be changed by what is stored before it."""
        if not isinstance(item, Expression) or not is_number(item):
            return False
        names: set[str] = set()
        fields: set[str] = set()
        for node in ast.walk(target):
            if isinstance(node, ast.Name):
                names |= {self.places.get(node.id, node.id)} if isinstance(node.ctx, ast.Store) else set()
                (names if isinstance(node.ctx, ast.Store) else fields).add(node.id)
            elif isinstance(node, ast.Attribute):
                fields.add(node.attr)
            elif isinstance(node, ast.Subscript):  # of an array that may be known by another name
                fields |= {part.name for part in parts(item) if isinstance(part, Field)}
        return any(
            (isinstance(part, Variable) and part.name in names)
            or (isinstance(part, Field) and part.name in fields)
            or (isinstance(part, Element) and bool(fields))
            for part in parts(item)
        )

    def _store_name(self, target: ast.Name, value: Value) -> None:
        name = self.places.get(target.id, target.id)
        if name == "_":
            return
        if any(
            parameter.name == name and not isinstance(parameter.type, str) for parameter in self.parameters
        ):
            self.fail(target, "another value for a parameter that is a record", "give it a new name")
        if not is_number(value):
            self.env[name] = self.frozen(value)
            return
        assert isinstance(value, Expression)
        self.env.pop(name, None)
        kind = joined(kind_of(value), self.kinds.get(name, kind_of(value)))
        given = {parameter.name: parameter.type for parameter in self.parameters}
        if given.get(name, kind) != kind:  # of a parameter: a variable takes its place in the next pass
            self.widened[name] = joined(kind, self.widened.get(name, kind))
            self.kinds[self.fresh(f"{name}_changed")] = self.widened[name]
            return
        self.kinds[name] = kind
        self.out.append(Assign(Variable(name, kind), converted(value, kind)))

    def _if(self, node: ast.If) -> None:
        condition = self.condition(node.test)
        if isinstance(condition, Constant):
            for one in node.body if condition.value else node.orelse:
                self.statement(one)
            return
        before = dict(self.env)
        body = self.block(node.body)
        after, self.env = self.env, before
        otherwise = self.block(node.orelse)
        self.env = {name: value for name, value in self.env.items() if after.get(name) is value}
        if body or otherwise:
            self.out.append(If(condition, body, otherwise))

    def _loop_begins(self, node: ast.For | ast.While) -> None:
        """Names that a loop gives to something else do not hold in it from before."""
        for inner in ast.walk(node):
            if isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Store):
                self.env.pop(inner.id, None)

    def _for(self, node: ast.For) -> None:
        if not isinstance(node.target, ast.Name) or node.orelse:
            self.fail(node, "this loop", "write `for name in range(...)`, without `else`")
        if isinstance(node.iter, ast.Tuple):
            items = [
                one
                if isinstance(one, Expression) and self.stays(one)
                else self.saved(one)
                if is_number(one)
                else self.frozen(one)
                for one in self.read_all(node.iter.elts)
            ]
            if any(isinstance(one, ast.Break | ast.Continue) for one in ast.walk(node)):
                self.fail(node, "break or continue in a loop over a tuple", "write a loop over `range`")
            self._loop_begins(node)
            for item in items:
                self.store(node.target, item)
                for one in node.body:
                    self.statement(one)
            return
        call = node.iter
        if not (isinstance(call, ast.Call) and self.value(call.func) == Known(range)):
            self.fail(node.iter, "a loop over this", "write `for name in range(...)`")
        given = [
            self._whole(node_of, value)
            for node_of, value in zip(call.args, self.read_all(call.args), strict=True)
        ]
        zero, unit = Constant(0, "whole"), Constant(1, "whole")
        start, stop, step = (zero, *given, unit) if len(given) == 1 else (*given, unit)[:3]
        if not isinstance(step, Constant) or step.value == 0:
            self.fail(call, "a range whose step is no constant other than 0", "write the step as a number")
        self._loop_begins(node)
        name = self.fresh(f"count_{node.lineno}") if node.target.id == "_" else node.target.id
        if self.kinds.setdefault(name, "whole") != "whole":
            self.fail(node.target, "a loop variable that is a number elsewhere", "give it a new name")
        start, stop = self._fixed(start), self._fixed(stop)
        upwards = step.value > 0 and isinstance(start, Constant) and start.value >= 0
        self.counting = self.counting | {name} if upwards else self.counting - {name}
        body = self.block(node.body)
        self.out.append(For(Variable(name, "whole"), start, stop, int(step.value), body))

    def _fixed(self, bound: Expression) -> Expression:
        """A bound of a loop, which is read once."""
        return bound if self.stays(bound) else self.saved(bound)

    def _while(self, node: ast.While) -> None:
        if node.orelse:
            self.fail(node, "`else` of a loop", "set a variable in the loop")
        self._loop_begins(node)
        outer, self.out = self.out, []
        condition = self.condition(node.test)
        before, self.out = self.out, outer
        if isinstance(condition, Constant) and not condition.value:
            return
        body = self.block(node.body)
        if before:
            leave = If(negated(condition), (Leave("break"),))
            condition, body = Constant(True, "truth"), (*before, leave, *body)
        self.out.append(While(condition, body))

    def _return(self, node: ast.Return) -> None:
        value: Value = Tuple(()) if node.value is None else self.value(node.value)
        items = value.items if isinstance(value, Tuple) else (value,)
        numbers = [self._number(node, item) for item in items]
        kinds = tuple(kind_of(one) for one in numbers)
        if self.returns is not None:
            if len(self.returns) != len(kinds):
                self.fail(node, "another number of values than before", "return as many everywhere")
            kinds = tuple(joined(*pair) for pair in zip(self.returns, kinds, strict=True))
        self.returns = kinds
        self.out.append(Return(tuple(converted(one, kind) for one, kind in zip(numbers, kinds, strict=True))))
