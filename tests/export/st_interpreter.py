"""Executes the emitted subset of Structured Text, compiled to Python; it never guesses.

LREAL is float64, REAL is NumPy's float32 (every operation rounded), LINT raises beyond 64 bits. Both sides
of AND and OR are evaluated, an index out of its array raises, so does a division by zero, the control
variable cannot be used behind its loop, the end of a loop must not change in it, and inputs cannot be
assigned to.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np
import tree_sitter
from tests.export.st_tree import Array, Source, StError, Struct, Type, Unit, child, children, parts, text_of

ANY_REAL, ANY_INT = "ANY_REAL", "ANY_INT"  # literals
NUMBERS = ("LREAL", "REAL", "LINT")
FITS = {ANY_REAL: ("LREAL", "REAL"), ANY_INT: ("LINT",)}
MOST = 2**63
PREFIX = "v_"


class Undefined:
    """The control variable behind its loop: whatever is done with it raises."""

    def _raise(self, *_: object) -> NoReturn:
        raise ValueError("a control variable is not defined behind its loop")

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __lt__ = __le__ = __gt__ = __ge__ = _raise
    __eq__ = __ne__ = __neg__ = __index__ = __float__ = __bool__ = _raise  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]


def whole(value: int) -> int:
    if not -MOST <= value < MOST:
        raise OverflowError("beyond LINT")
    return value


def quotient(a: int, b: int) -> int:
    """The quotient of two LINTs, cut towards 0."""
    return whole(abs(a) // abs(b) if (a < 0) == (b < 0) else -(abs(a) // abs(b)))


def remainder(a: int, b: int) -> int:
    """MOD: with the sign of the dividend."""
    return a - b * quotient(a, b)


def outside(index: int) -> NoReturn:
    raise IndexError(f"index {index}")


def to_whole(value: float) -> int:
    """To the nearest, as IEC 60559."""
    return whole(round(float(value)))


def _single(function: Callable[..., float]) -> Callable[..., np.float32]:
    return lambda *arguments: np.float32(function(*map(float, arguments)))


STANDARD: dict[str, Callable[..., float]] = {
    "sqrt": math.sqrt, "ln": math.log, "exp": math.exp, "sin": math.sin, "cos": math.cos, "tan": math.tan,
    "atan": math.atan, "abs": abs, "expt": math.pow,
}  # fmt: skip
CONVERSIONS: dict[str, tuple[str, str, str]] = {
    "lreal_to_real": ("LREAL", "REAL", "_float32"),
    "real_to_lreal": ("REAL", "LREAL", "float"),
    "lint_to_lreal": ("LINT", "LREAL", "float"),
    "lint_to_real": ("LINT", "REAL", "_float32"),
    "lreal_to_lint": ("LREAL", "LINT", "_to_whole"),
    "real_to_lint": ("REAL", "LINT", "_to_whole"),
}
SINGLE = {name: _single(function) for name, function in STANDARD.items() if name != "sqrt"} | {
    "sqrt": np.sqrt
}


class Writer:
    """Python source of one unit."""

    def __init__(self, program: Program, unit: Unit) -> None:
        self.program, self.unit = program, unit
        self.loops: list[str] = []
        self.fixed: list[str] = []  # control variables, and what the ends of the loops around read
        self.lines: list[str] = []

    # names and types ------------------------------------------------------------------------------------

    def variable(self, name: str) -> str:
        return f"{PREFIX}{name}" if self.unit.kind == "function" else f"self.{PREFIX}{name}"

    def place(self, node: tree_sitter.Node) -> tuple[str, Type, str]:
        """Python, type and the variable at its root."""
        if node.type == "identifier":
            name = text_of(node).lower()
            if name == self.unit.name.lower() and self.unit.returns is not None:
                return "result", self.unit.returns, name
            declared = self.unit.type_of(name)
            if declared is None:
                raise StError(node, "not declared")
            return self.variable(name), declared, name
        if node.type == "member_access_expression":
            base = child(node, "object")
            member = text_of(child(node, "member")).lower()
            if base.type == "identifier" and text_of(base).lower() in self.unit.instances:
                name = text_of(base).lower()
                block = self.unit.instances[name]
                if member not in block.outputs:
                    raise StError(node, "outputs of a block only")
                return f"self.{PREFIX}{name}.{PREFIX}{member}", block.outputs[member], name
            code, declared, root = self.place(base)
            if not isinstance(declared, Struct) or member not in declared.fields:
                raise StError(node, "no such field")
            return f"{code}.{member}_", declared.fields[member], root
        if node.type == "index_expression":
            code, declared, root = self.place(child(node, "object"))
            indices = children(node, "index")
            if not isinstance(declared, Array) or len(indices) != len(declared.shape):
                raise StError(node, "not an array of so many dimensions")
            for index, size in zip(indices, declared.shape, strict=True):
                value = self.expression(index, "LINT")
                if value.isdigit():
                    if int(value) >= size:
                        raise StError(index, "beyond the array")
                    code += f"[{value}]"
                else:
                    code += f"[_k if 0 <= (_k := {value}) < {size} else _outside(_k)]"
            return code, declared.element, root
        raise StError(node, "not a variable")

    # expressions ----------------------------------------------------------------------------------------

    def expression(self, node: tree_sitter.Node, wanted: str) -> str:
        code, kind = self.typed(node)
        if kind == wanted:
            return code
        if wanted in FITS.get(kind, ()):
            return self.literal(node, code, wanted)
        raise StError(node, f"{kind} where {wanted} is needed")

    def literal(self, node: tree_sitter.Node, code: str, kind: str) -> str:
        if kind == "LINT":
            whole(int(code.strip("()")))
        if kind == "REAL":
            value = np.float32(float(code.strip("()")))
            if not np.isfinite(value):
                raise StError(node, "beyond REAL")
            return self.program.constant(value)
        if kind == "LREAL" and not math.isfinite(float(code.strip("()"))):
            raise StError(node, "beyond LREAL")
        return code

    def typed(self, node: tree_sitter.Node) -> tuple[str, str]:
        match node.type:
            case "real_literal":
                value = float(text_of(node))
                return (repr(value) if value >= 0.0 else f"({value!r})"), ANY_REAL
            case "integer_literal":
                return (text_of(node) if int(text_of(node)) >= 0 else f"({text_of(node)})"), ANY_INT
            case "boolean_literal":
                return {"TRUE": "True", "FALSE": "False"}[text_of(node)], "BOOL"
            case "identifier" | "member_access_expression" | "index_expression":
                if node.type == "identifier" and text_of(node).lower() in self.unit.constants:
                    kind, value_node = self.unit.constants[text_of(node).lower()]
                    return self.expression(value_node, kind), kind
                code, declared, root = self.place(node)
                if not isinstance(declared, str):
                    raise StError(node, "not a number")
                if root == self.unit.name.lower():
                    raise StError(node, "the result of a function is not read")
                return code, declared
            case "parenthesized_expression":
                inner = parts(node)
                if len(inner) != 1:
                    raise StError(node, "one expression in brackets")
                code, kind = self.typed(inner[0])
                return (code if kind in FITS else f"({code})"), kind
            case "unary_expression":
                return self.unary(node)
            case "binary_expression":
                return self.binary(node)
            case "call_expression":
                return self.call(node)
        raise StError(node, f"{node.type} is not known")

    def unary(self, node: tree_sitter.Node) -> tuple[str, str]:
        operator = text_of(node.child_by_field_name("operator"))  # type: ignore[arg-type]
        operand = child(node, "operand")
        if operator == "NOT":
            return f"(not {self.expression(operand, 'BOOL')})", "BOOL"
        code, kind = self.typed(operand)
        if operator != "-" or kind not in NUMBERS:
            raise StError(node, "unary operator")
        return (f"_whole(-{code})" if kind == "LINT" else f"(-{code})"), kind

    def binary(self, node: tree_sitter.Node) -> tuple[str, str]:
        operator = text_of(node.child_by_field_name("operator"))  # type: ignore[arg-type]
        left, right = child(node, "left"), child(node, "right")
        if operator in ("AND", "OR", "XOR"):
            word = {"AND": "&", "OR": "|", "XOR": "^"}[operator]
            return f"({self.expression(left, 'BOOL')} {word} {self.expression(right, 'BOOL')})", "BOOL"
        kinds = [self.typed(left)[1], self.typed(right)[1]]
        kind = next((kind for kind in kinds if kind not in FITS), "")
        if not kind:
            raise StError(node, "an operation of two literals")
        a, b = self.expression(left, kind), self.expression(right, kind)
        comparison = {"=": "==", "<>": "!=", "<": "<", "<=": "<=", ">": ">", ">=": ">="}.get(operator)
        if comparison:
            if kind == "BOOL":
                raise StError(node, "comparison of truths")
            return f"({a} {comparison} {b})", "BOOL"
        if kind not in NUMBERS:
            raise StError(node, "not a number")
        if kind == "LINT":
            word = {"/": "_quotient", "MOD": "_remainder"}.get(operator, "")
            if word:
                return f"{word}({a}, {b})", kind
            if operator in "+-*":
                return f"_whole({a} {operator} {b})", kind
        elif operator in "+-*/":
            return f"({a} {operator} {b})", kind
        raise StError(node, "operator is not known")

    def arguments(self, node: tree_sitter.Node) -> tuple[list[tree_sitter.Node], dict[str, tree_sitter.Node]]:
        """Those without a name, and those with one; an output has `=>` before its name."""
        plain, named = [], {}
        for one in parts(child(node, "arguments")):
            if one.type == "named_argument":
                sign = "=>" if any(part.type == "=>" for part in one.children) else ""
                name = sign + text_of(child(one, "name")).lower()
                if name in named:
                    raise StError(one, "twice")
                named[name] = child(one, "value")
            else:
                plain.append(one)
        if plain and named:
            raise StError(node, "arguments with and without names")
        return plain, named

    def call(self, node: tree_sitter.Node) -> tuple[str, str]:
        """A call within an expression: a function without outputs."""
        name = text_of(child(node, "function")).lower()
        plain, named = self.arguments(node)
        if name in CONVERSIONS:
            before, after, python = CONVERSIONS[name]
            if named or len(plain) != 1:
                raise StError(node, "one argument")
            return f"{python}({self.expression(plain[0], before)})", after
        if name in STANDARD:
            if named or len(plain) != 1 + (name == "expt"):
                raise StError(node, "number of arguments")
            kind = next((k for k in (self.typed(one)[1] for one in plain) if k not in FITS), "LREAL")
            if kind not in ("LREAL", "REAL"):
                raise StError(node, "argument is no real number")
            python = f"_{name}" if kind == "LREAL" else f"_{name}_single"
            return f"{python}({', '.join(self.expression(one, kind) for one in plain)})", kind
        function = self.program.source.units.get(name)
        if function is None or function.kind != "function":
            raise StError(node, "no such function")
        if function.outputs:
            raise StError(node, "a function with outputs stands alone at the right of an assignment")
        return f"f_{name}({self.handed_over(node, function, plain, named)})", str(function.returns)

    def handed_over(
        self, node: tree_sitter.Node, function: Unit, plain: list[Any], named: dict[str, Any]
    ) -> str:
        if function is self.unit or function.name.lower() not in self.program.written:
            raise StError(node, "called before it is declared")
        formal = {**function.in_outs, **function.inputs}
        if plain:
            if function.in_outs or len(plain) != len(formal):
                raise StError(node, "number of arguments")
            named = dict(zip(formal, plain, strict=True))
        if {name for name in named if not name.startswith("=>")} != set(formal):
            raise StError(node, "not these arguments")
        codes = []
        for name, declared in formal.items():
            if isinstance(declared, str):
                codes.append(self.expression(named[name], declared))
            else:
                code, given, _ = self.place(named[name])
                if given != declared or (isinstance(declared, Array) and not declared.name):
                    raise StError(named[name], "a variable of another type, or of one without a name")
                codes.append(code)
        return ", ".join(codes)

    # statements -----------------------------------------------------------------------------------------

    def say(self, depth: int, line: str) -> None:
        self.lines.append("    " * depth + line)

    def target(self, node: tree_sitter.Node) -> tuple[str, Type]:
        code, declared, root = self.place(node)
        if root in self.unit.inputs or root in self.unit.constants or root in self.unit.instances:
            raise StError(node, "an input or constant is not assigned to")
        if root in self.fixed:
            raise StError(node, "a loop around depends on it")
        return code, declared

    def block(self, nodes: list[tree_sitter.Node], depth: int) -> None:
        begin = len(self.lines)
        for node in nodes:
            self.statement(node, depth)
        if len(self.lines) == begin:
            self.say(depth, "pass")

    def statement(self, node: tree_sitter.Node, depth: int) -> None:
        match node.type:
            case "empty_statement":
                return
            case "assignment_statement":
                self.assignment(node, depth)
            case "invocation_statement":
                self.invocation(node, depth)
            case "if_statement":
                self.say(depth, f"if {self.expression(child(node, 'condition'), 'BOOL')}:")
                self.block(children(node, "consequence"), depth + 1)
                for part in parts(node):
                    if part.type == "elsif_clause":
                        self.say(depth, f"elif {self.expression(child(part, 'condition'), 'BOOL')}:")
                        self.block(children(part, "body"), depth + 1)
                    elif part.type == "else_clause":
                        self.say(depth, "else:")
                        self.block(children(part, "body"), depth + 1)
            case "for_statement":
                self.loop(node, depth)
            case "while_statement":
                self.say(depth, f"while {self.expression(child(node, 'condition'), 'BOOL')}:")
                self.loops.append("while")
                self.block(children(node, "body"), depth + 1)
                self.loops.pop()
            case "exit_statement":
                if not self.loops:
                    raise StError(node, "no loop")
                self.say(depth, "break")
            case "return_statement":
                self.say(depth, self.returned())
            case _:
                raise StError(node, f"{node.type} is not known")

    def returned(self) -> str:
        if self.unit.kind != "function":
            return "return"
        return f"return ({', '.join(['result', *(self.variable(name) for name in self.unit.outputs)])},)"

    def assignment(self, node: tree_sitter.Node, depth: int) -> None:
        right = child(node, "right")
        if right.type == "call_expression":
            function = self.program.source.units.get(text_of(child(right, "function")).lower())
            if function is not None and function.outputs:
                return self.call_with_outputs(node, right, function, depth)
        code, declared = self.target(child(node, "left"))
        if isinstance(declared, str):
            return self.say(depth, f"{code} = {self.expression(right, declared)}")
        other, given, _ = self.place(right)
        if given != declared:
            raise StError(node, "copy of another type")
        if isinstance(declared, Struct):
            return self.say(depth, f"{code}.assign({other})")
        raise StError(node, "arrays are copied element by element")

    def call_with_outputs(
        self, node: tree_sitter.Node, call: tree_sitter.Node, function: Unit, depth: int
    ) -> None:
        plain, named = self.arguments(call)
        given = self.handed_over(call, function, plain, named)
        targets = []
        for name, declared in [("", function.returns), *function.outputs.items()]:
            place = child(node, "left") if not name else named.get(f"=>{name}")
            if place is None:
                targets.append("_")
                continue
            code, kind = self.target(place)
            if kind != declared:
                raise StError(place, f"{kind} takes {declared}")
            targets.append(code)
        if unknown := {name[2:] for name in named if name.startswith("=>")} - set(function.outputs):
            raise StError(call, f"no outputs {unknown}")
        self.say(depth, f"{', '.join(targets)} = m_{function.name.lower()}({given})")

    def invocation(self, node: tree_sitter.Node, depth: int) -> None:
        """A function block is called by its instance, with names."""
        call = parts(node)[0]
        name = text_of(child(call, "function")).lower()
        block = self.unit.instances.get(name)
        if block is None:
            raise StError(node, "not an instance of a function block")
        plain, named = self.arguments(call)
        if plain or any(one.startswith("=>") for one in named) or not set(named) <= set(block.inputs):
            raise StError(node, "inputs by name")
        for one, value in named.items():
            self.say(
                depth, f"self.{PREFIX}{name}.{PREFIX}{one} = {self.expression(value, str(block.inputs[one]))}"
            )
        self.say(depth, f"self.{PREFIX}{name}.execute()")

    def loop(self, node: tree_sitter.Node, depth: int) -> None:
        control = child(node, "control")
        name = text_of(control).lower()
        code, kind = self.target(control)
        if kind != "LINT" or name not in self.unit.locals:
            raise StError(node, "a control variable is a local LINT")
        first, last = (self.expression(child(node, part), "LINT") for part in ("start", "end"))
        steps = children(node, "step")
        step = int(text_of(steps[0])) if steps else 1
        if step == 0:
            raise StError(node, "step 0")
        held = [name, *names_in(child(node, "end"))]
        self.fixed += held
        self.loops.append("for")
        self.say(depth, f"for {code} in range({first}, {last} + {1 if step > 0 else -1}, {step}):")
        self.block(children(node, "body"), depth + 1)
        self.say(depth, f"{code} = _undefined")
        self.loops.pop()
        del self.fixed[len(self.fixed) - len(held) :]


def names_in(node: tree_sitter.Node) -> list[str]:
    if node.type == "identifier":
        return [text_of(node).lower()]
    return [name for part in node.children for name in names_in(part)]


def first_value(declared: Type) -> str:
    """Python of a new variable."""
    if isinstance(declared, Struct):
        return f"S_{declared.name.lower()}()"
    if isinstance(declared, Array):
        inner = first_value(declared.element)
        for size in reversed(declared.shape):
            inner = f"[{inner} for _ in range({size})]"
        return inner
    return {"LREAL": "0.0", "REAL": "_float32(0.0)", "LINT": "0", "BOOL": "False"}[declared]


class Program:
    """A text of Structured Text, ready to be executed.

    >>> text = '''FUNCTION twice : LREAL
    ... VAR_INPUT number : LREAL; END_VAR
    ... twice := 2.0 * number;
    ... END_FUNCTION'''
    >>> Program(text).call("twice", number=3.0)
    (6.0,)
    """

    def __init__(self, text: str) -> None:
        self.source = Source().read(text)
        self.written: set[str] = set()
        self.names: dict[str, Any] = {
            "_float32": np.float32, "_to_whole": to_whole, "_whole": whole, "_outside": outside,
            "_quotient": quotient, "_remainder": remainder, "_undefined": Undefined(),
        }  # fmt: skip
        self.names |= {f"_{name}": function for name, function in STANDARD.items()}
        self.names |= {f"_{name}_single": function for name, function in SINGLE.items()}
        self.lines: list[str] = []
        for struct in self.source.structs.values():
            self._struct(struct)
        for unit in self.source.units.values():
            self._unit(unit)
        self.python = "\n".join(self.lines)
        exec(compile(self.python, "<structured text>", "exec"), self.names)

    def constant(self, value: np.float32) -> str:
        name = f"_c{np.float32(value).view(np.uint32):x}"
        self.names[name] = value
        return name

    def _struct(self, struct: Struct) -> None:
        say = self.lines.append
        say(f"class S_{struct.name.lower()}:")
        say(f"    __slots__ = ({', '.join(repr(f'{name}_') for name in struct.fields)},)")
        say("    def __init__(self):")
        for name, declared in struct.fields.items():
            say(f"        self.{name}_ = {first_value(declared)}")
        say("    def assign(self, other):")
        for name, declared in struct.fields.items():
            if isinstance(declared, Struct):
                say(f"        self.{name}_.assign(other.{name}_)")
            elif isinstance(declared, str):
                say(f"        self.{name}_ = other.{name}_")
            elif isinstance(declared.element, Struct):
                say(f"        for a, b in zip(self.{name}_, other.{name}_): a.assign(b)")
            elif len(declared.shape) == 2:
                say(f"        for a, b in zip(self.{name}_, other.{name}_): a[:] = b")
            else:
                say(f"        self.{name}_[:] = other.{name}_")

    def _unit(self, unit: Unit) -> None:
        name = unit.name.lower()
        writer = Writer(self, unit)
        own = {**unit.outputs, **unit.locals}

        def first(variable: str, declared: Type) -> str:
            if variable in unit.initial:
                return writer.expression(unit.initial[variable], str(declared))
            return first_value(declared)

        if unit.kind == "function":
            given = ", ".join(PREFIX + one for one in [*unit.in_outs, *unit.inputs])
            writer.say(0, f"def m_{name}({given}):")
            writer.say(1, f"result = {first_value(str(unit.returns))}")
            for variable, declared in own.items():
                writer.say(1, f"{PREFIX}{variable} = {first(variable, declared)}")
            writer.block(unit.body, 1)
            if not any(line.strip().startswith(("result = ", "result, ")) for line in writer.lines[2:]):
                raise ValueError(f"{unit.name}: its result is never set")
            writer.say(1, writer.returned())
            self.lines += writer.lines
            if not unit.outputs:
                self.lines += [f"def f_{name}({given}):", f"    return m_{name}({given})[0]"]
        else:
            if unit.in_outs:
                raise ValueError(f"{unit.name}: VAR_IN_OUT of a block")
            writer.say(0, f"class B_{name}:")
            writer.say(1, "def __init__(self):")
            for variable, declared in {**unit.inputs, **own}.items():
                writer.say(2, f"self.{PREFIX}{variable} = {first(variable, declared)}")
            for variable, block in unit.instances.items():
                writer.say(2, f"self.{PREFIX}{variable} = B_{block.name.lower()}()")
            writer.say(2, "pass")
            writer.say(1, "def execute(self):")
            writer.block(unit.body, 2)
            self.lines += writer.lines
        self.written.add(name)

    def call(self, name: str, **arguments: Any) -> tuple[Any, ...]:
        """The result of a function and its outputs."""
        unit = self.source.units[name.lower()]
        given = [arguments[one] for one in [*unit.in_outs, *unit.inputs]]
        with np.errstate(all="raise", under="ignore"):
            return tuple(self.names[f"m_{name.lower()}"](*given))

    def new(self, struct: str) -> Any:
        """A structure with zeros; its fields are attributes with an underscore behind their names."""
        return self.names[f"S_{struct.lower()}"]()

    def block(self, name: str) -> Block:
        """A new instance of a function block or program."""
        unit = self.source.units[name.lower()]
        return Block(unit, self.names[f"B_{name.lower()}"]())


class Block:
    """An instance, called with its inputs by name; those that are left out keep their values."""

    def __init__(self, unit: Unit, instance: Any) -> None:
        self._unit, self._instance = unit, instance
        self._convert = {"LREAL": float, "REAL": np.float32, "LINT": int, "BOOL": bool}

    def __call__(self, **inputs: Any) -> dict[str, Any]:
        """One cycle; its outputs."""
        for name, value in inputs.items():
            kind = str(self._unit.inputs[name.lower()])
            setattr(self._instance, PREFIX + name.lower(), self._convert[kind](value))
        with np.errstate(all="raise", under="ignore"):
            self._instance.execute()
        return {name: getattr(self._instance, PREFIX + name) for name in self._unit.outputs}
