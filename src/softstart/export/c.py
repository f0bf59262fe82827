"""Typed statements -> C99.

One header and one source; no heap, nothing beyond `math.h`. Everything but the interface is static. Numbers
are computed as Python does: in the order written, without fused operations, in single precision where
`real` is float.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping
from typing import Any

from softstart.export.statements import (
    Apply,
    Array,
    Assign,
    Binary,
    Call,
    Constant,
    Convert,
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
    Type,
    Unary,
    Variable,
    While,
    expressions,
    parts,
    walk,
)  # fmt: skip

KEYWORDS = set(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile
    while asm bool true false NULL INFINITY NAN j0 j1 jn y0 y1 yn gamma signgam exp log sin cos tan pow sqrt
    floor ceil hypot atan atan2 expm1 log1p fabs copysign nextafter isnan isfinite int64_t int32_t main
    """.split()  # noqa: SIM905  a list of 60 quoted words is not to be read
)
PRECEDENCE = {
    "or": 1, "and": 2, "==": 3, "!=": 3, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6,
}  # fmt: skip
OWN = re.compile(r"result_\d+|unused_(truth|whole|real|double)")  # names that functions get here
WORDS = {"and": "&&", "or": "||"}
UNARY, ATOM = 7, 9
HELPERS: dict[str, str] = {
    "min": "static {t} {p}(const {t} a, const {t} b) {{ return b < a ? b : a; }}",
    "max": "static {t} {p}(const {t} a, const {t} b) {{ return b > a ? b : a; }}",
    "abs": "static {t} {p}(const {t} a) {{ return a < 0 ? -a : a; }}",
    "sign": "static {t} {p}(const {t} a) {{ return a > 0 ? 1 : a < 0 ? -1 : a; }}",
    "floordiv": """\
static {t} {p}(const {t} a, const {t} b)
{{
    return b == 0 ? 0 : a / b - (a % b != 0 && (a < 0) != (b < 0));
}}""",
    "mod": """\
static {t} {p}(const {t} a, const {t} b)
{{
    const {t} r = b == 0 ? 0 : a % b;
    return r != 0 && (r < 0) != (b < 0) ? r + b : r;
}}""",
    "fmod": """\
static {t} {p}(const {t} a, const {t} b)
{{
    const {t} r = fmod{f}(a, b);
    return r == 0 ? copysign{f}(0, b) : (r < 0) != (b < 0) ? r + b : r;
}}""",
    "ffloordiv": """\
static {t} {p}(const {t} a, const {t} b)
{{
    const {t} r = fmod{f}(a, b);
    const {t} quotient = (a - r) / b - (r != 0 && (r < 0) != (b < 0) ? 1 : 0);
    const {t} whole = floor{f}(quotient);
    if (b == 0) {{
        return a / b;
    }}
    return quotient == 0 ? copysign{f}(0, a / b) : quotient - whole > ({t})0.5 ? whole + 1 : whole;
}}""",
    "gauss": """\
static uint64_t {p}_mixed(uint64_t z)
{{
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}}

/* Noise number `number` of the sequence `seed`: SplitMix64, Box and Muller. */
static {t} {p}(const {t} seed, const {t} number)
{{
    const uint64_t step = UINT64_C(0x9E3779B97F4A7C15);
    const uint64_t start = {p}_mixed((uint64_t)seed * step + step) + 2 * (uint64_t)number * step;
    const uint64_t a = {p}_mixed(start + step), b = {p}_mixed(start + 2 * step);
    const double unit = 1.0 / 9007199254740992.0;
    const double radius = sqrt(-2.0 * log(((double)(a >> 11) + 0.5) * unit));
    return ({t})(radius * cos(2.0 * 3.141592653589793 * (double)(b >> 11) * unit));
}}""",
}  # fmt: skip
STDC = """\
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif
"""
LIBRARY = {
    "sqrt", "exp", "log", "expm1", "log1p", "sin", "cos", "tan", "atan", "atan2", "hypot", "pow", "copysign",
    "floor", "ceil", "nextafter",
}  # fmt: skip


class CWriter:
    """Writes a program.

    Parameters
    ----------
    program : what is written.
    prefix : before the names of types and macros.
    single : whether `real` is float.
    """

    def __init__(self, program: Program, prefix: str, single: bool = False) -> None:
        self.program, self.prefix, self.single = program, prefix, single
        self.types: dict[Any, str] = {
            "truth": "int", "whole": "int64_t", "real": f"{prefix}_real", "double": "double",
        }  # fmt: skip
        self.renamed: dict[str, str] = {}  # names of structures
        self.helpers: dict[str, str] = {}

    # types ------------------------------------------------------------------------------------------

    def type_of(self, kind: Type) -> str:
        """The name of a type; of an array, that of its elements."""
        if isinstance(kind, Struct):
            return f"{self.prefix}_{self.renamed.get(kind.name, kind.name)}"
        return self.type_of(kind.element) if isinstance(kind, Array) else self.types[kind]

    def declared(self, name: str, kind: Type) -> str:
        """A declaration of a name of this type."""
        shape = "".join(f"[{max(size, 1)}]" for size in kind.shape) if isinstance(kind, Array) else ""
        return f"{self.type_of(kind)} {self.name(name)}{shape}"

    @staticmethod
    def name(name: str) -> str:
        """A name that is no word of C."""
        return f"{name}_" if name in KEYWORDS or OWN.fullmatch(name) else name

    @staticmethod
    def index(at: int) -> Constant:
        """A constant index."""
        return Constant(at, "whole")

    def struct(self, struct: Struct) -> str:
        """The definition of a structure."""
        lines = [f"{self.declared(member.name, member.type)};" for member in struct.members] or [
            "int unused;"
        ]
        comments = [f" /* {member.comment} */" if member.comment else "" for member in struct.members] or [""]
        body = "".join(f"    {line}{comment}\n" for line, comment in zip(lines, comments, strict=True))
        return f"typedef struct {{\n{body}}} {self.type_of(struct)};\n"

    # expressions ------------------------------------------------------------------------------------

    def constant(self, value: Any, kind: Type) -> str:
        """A number."""
        if kind == "truth":
            return str(int(value))
        if kind == "whole":
            value = int(value)
            return str(value) if abs(value) < 2**31 else f"INT64_C({value})"
        if math.isnan(value):
            return "NAN"
        if math.isinf(value):
            return "INFINITY" if value > 0 else "-INFINITY"
        return repr(float(value)) + ("f" if self.single and kind == "real" else "")

    def expression(self, one: Expression, least: int = 0) -> str:
        """An expression, in brackets where it binds less than `least`."""
        text, strength = self._expression(one)
        return f"({text})" if strength < least else text

    def _expression(self, one: Expression) -> tuple[str, int]:
        match one:
            case Constant(value, kind):
                text = self.constant(value, kind)
                return text, UNARY if text.startswith("-") else ATOM
            case Variable(name):
                return self.name(name), ATOM
            case Field(base, name):
                by_reference = isinstance(base, Variable) and base.name in self.references
                return f"{self.expression(base, ATOM)}{'->' if by_reference else '.'}{self.name(name)}", ATOM
            case Element(base, indices):
                return self.expression(base, ATOM) + "".join(f"[{self.expression(i)}]" for i in indices), ATOM
            case Binary():
                return self._binary(one)
            case Unary("not", operand):
                return f"!{self.expression(operand, UNARY)}", UNARY
            case Unary(_, operand):
                return f"-{self.expression(operand, ATOM)}", UNARY
            case Convert(operand, kind):
                return f"({self.types[kind]}){self.expression(operand, UNARY)}", UNARY
            case Apply(function, arguments, kind):
                return self._apply(function, arguments, kind), ATOM

    def _binary(self, one: Binary) -> tuple[str, int]:
        if one.operator in ("//", "%"):
            helper = "mod" if one.operator == "%" else "floordiv"
            helper = f"f{helper}" if one.type in ("real", "double") else helper
            return self._apply(helper, (one.left, one.right), one.type), ATOM
        strength = PRECEDENCE[one.operator]
        # what stands to the left is done first; brackets where C compilers ask for them
        inside = 3 if strength <= 2 else strength
        left = self.expression(one.left, strength if _same(one.left, one.operator) else inside)
        right = self.expression(one.right, inside if strength <= 2 else strength + 1)
        return f"{left} {WORDS.get(one.operator, one.operator)} {right}", strength

    def _apply(self, function: str, arguments: Iterable[Expression], kind: Any) -> str:
        given = tuple(arguments)
        inner = ", ".join(self.expression(one) for one in given)
        kind = given[0].type if kind == "truth" else kind
        single = self.single and kind == "real"
        if function in ("isnan", "isfinite"):
            return f"({function}({inner}) != 0)"
        if function == "abs" and kind in ("real", "double"):
            return f"fabs{'f' if single else ''}({inner})"
        if function in LIBRARY:
            return f"{function}{'f' if single else ''}({inner})"
        name = f"{function}_{kind}"
        self.helpers[name] = HELPERS[function].format(t=self.types[kind], p=name, f="f" if single else "")
        return f"{name}({inner})"

    # statements -------------------------------------------------------------------------------------

    def block(self, statements: Iterable[Statement], depth: int) -> list[str]:
        """The lines of some statements."""
        return [line for statement in statements for line in self.statement(statement, depth)]

    def statement(self, statement: Statement, depth: int) -> list[str]:
        """The lines of a statement."""
        pad, inner = "    " * depth, depth + 1
        match statement:
            case Assign(place, value):
                return [f"{pad}{self._assigned(place, value)};"]
            case Copy(place, value):
                to, of = (self._address(one) for one in (place, value))
                return [f"{pad}memcpy({to}, {of}, sizeof({self.expression(place)}));"]
            case If(condition, body, otherwise):
                return self._if(condition, body, otherwise, depth)
            case For(variable, start, stop, step, body):
                name, sign = self.name(variable.name), "<" if step > 0 else ">"
                move = f"{name}++" if step == 1 else f"{name}--" if step == -1 else f"{name} += {step}"
                begin, end = f"{name} = {self.expression(start)}", f"{name} {sign} {self.expression(stop)}"
                return [f"{pad}for ({begin}; {end}; {move}) {{", *self.block(body, inner), f"{pad}}}"]
            case While(condition, body):
                head = (
                    "for (;;) {"
                    if isinstance(condition, Constant)
                    else f"while ({self.expression(condition)}) {{"
                )
                return [f"{pad}{head}", *self.block(body, inner), f"{pad}}}"]
            case Leave(word):
                return [f"{pad}{word};"]
            case Return(values):
                return self._return(values, pad)
            case Call(function, arguments, places):
                return [f"{pad}{self._call(function, arguments, places)};"]

    def _assigned(self, place: Expression, value: Expression) -> str:
        match value:
            case Binary("+" | "-" | "*" | "/", left, right) if left == place:
                return f"{self.expression(place)} {value.operator}= {self.expression(right)}"
            case _:
                return f"{self.expression(place)} = {self.expression(value)}"

    def _if(self, condition: Expression, body: Any, otherwise: Any, depth: int) -> list[str]:
        pad = "    " * depth
        lines = [f"{pad}if ({self.expression(condition)}) {{", *self.block(body, depth + 1)]
        while len(otherwise) == 1 and isinstance(otherwise[0], If):
            one = otherwise[0]
            lines += [
                f"{pad}}} else if ({self.expression(one.condition)}) {{",
                *self.block(one.body, depth + 1),
            ]
            otherwise = one.otherwise
        if otherwise:
            lines += [f"{pad}}} else {{", *self.block(otherwise, depth + 1)]
        return [*lines, f"{pad}}}"]

    def _return(self, values: tuple[Expression, ...], pad: str) -> list[str]:
        if len(values) < 2:
            return [f"{pad}return{''.join(' ' + self.expression(one) for one in values)};"]
        stores = [f"{pad}*result_{place} = {self.expression(one)};" for place, one in enumerate(values)]
        return [*stores, f"{pad}return;"]

    def _address(self, one: Expression) -> str:
        if isinstance(one.type, Array) or (isinstance(one, Variable) and one.name in self.references):
            return self.expression(one)
        return f"&{self.expression(one, ATOM)}"

    def _call(self, function: Function, arguments: Iterable[Expression], places: Any) -> str:
        handed = [
            self.expression(one) if isinstance(one.type, str) else self._address(one) for one in arguments
        ]
        if len(function.returns) < 2:
            stored = f"{self.name(places[0].name)} = " if places and places[0] else ""
            return f"{stored}{self.function_name(function)}({', '.join(handed)})"
        handed += [
            f"&{self.name(one.name) if one else f'unused_{kind}'}"
            for one, kind in zip(places, function.returns, strict=True)
        ]
        return f"{self.function_name(function)}({', '.join(handed)})"

    # functions --------------------------------------------------------------------------------------

    def function_name(self, function: Function) -> str:
        """The name of a function, which is no name of the library."""
        return (
            f"{self.name(function.name)}_"
            if function.name in LIBRARY | set(self.helpers)
            else self.name(function.name)
        )

    def function(self, function: Function) -> str:
        """The definition of a function."""
        self.references = {one.name for one in function.parameters if isinstance(one.type, Struct)}
        lines = self.block(function.body, 1)
        if lines and lines[-1] == "    return;":
            lines.pop()
        head = [self._parameter(one, function) for one in function.parameters]
        if len(function.returns) > 1:
            head += [f"{self.types[kind]} *result_{place}" for place, kind in enumerate(function.returns)]
        result = self.types[function.returns[0]] if len(function.returns) == 1 else "void"
        said = function.comment.replace("*/", "* /")
        comment = f"/* {said}. */\n" if said else ""
        opening = (
            f"{comment}static {result} {self.function_name(function)}({', '.join(head) or 'void'})\n{{\n"
        )
        local = self._locals(function)
        unused = {
            kind
            for one in walk(function.body)
            if isinstance(one, Call) and len(one.places) > 1
            for place, kind in zip(one.places, one.function.returns, strict=True)
            if place is None
        }
        local += [f"    {self.types[kind]} unused_{kind};" for kind in sorted(unused)]
        unread = [f"    (void){self.name(name)};" for name in self._unread(function)]
        return opening + "\n".join([*local, *unread, *lines]) + "\n}\n"

    def _parameter(self, one: Variable, function: Function) -> str:
        if isinstance(one.type, str):
            return f"{self.types[one.type]} {self.name(one.name)}"
        const = "" if one.name in function.changed else "const "
        if isinstance(one.type, Struct):
            return f"{const}{self.type_of(one.type)} *{self.name(one.name)}"
        if len(one.type.shape) > 1:  # C lets no array of two dimensions become const on the way
            return self.declared(one.name, one.type)
        return f"{const}{self.declared(one.name, one.type)}"

    def _locals(self, function: Function) -> list[str]:
        by_type: dict[str, list[str]] = {}
        for name, kind in function.locals.items():
            zero = {"truth": "0", "whole": "0"}.get(kind, self.constant(0.0, kind))
            by_type.setdefault(self.types[kind], []).append(f"{self.name(name)} = {zero}")
        return [
            line
            for kind, names in by_type.items()
            for line in textwrap.wrap(
                f"{kind} {', '.join(names)};", 100, initial_indent="    ", subsequent_indent="        "
            )
        ]

    @staticmethod
    def _unread(function: Function) -> list[str]:
        used = {
            part.name
            for statement in walk(function.body)
            for one in expressions(statement)
            for part in parts(one)
            if isinstance(part, Variable)
        }
        return [one.name for one in function.parameters if one.name not in used]

    def value(self, struct: Struct, values: Mapping[str, Any], depth: int = 1) -> str:
        """The initial value of a structure, with its comments."""
        pad, lines = "    " * depth, []
        for member in struct.members:
            value = values[member.name]
            if isinstance(member.type, Struct):
                text = self.value(member.type, value, depth + 1)
            elif isinstance(member.type, Array):
                text = self.nested(value, member.type)
            else:
                text = self.constant(value, member.type)
            comment = f" /* {member.comment} */" if member.comment else ""
            lines.append(f"{pad}.{self.name(member.name)} = {text},{comment}\n")
        return "{\n" + "".join(lines) + "    " * (depth - 1) + "}"

    def nested(self, value: Any, kind: Array) -> str:
        if len(kind.shape) == 1:
            inner = [
                self.constant(one, kind.element) if isinstance(kind.element, str) else one for one in value
            ]
        else:
            inner = [self.nested(row, Array(kind.element, kind.shape[1:])) for row in value]
        return "{ " + ", ".join(inner or ["0"]) + " }"

    def tables(self, tables: Mapping[str, tuple[Array, tuple[float, ...]]]) -> str:
        """Arrays of constants."""
        return "".join(
            f"static const {self.declared(name, kind)} = {self.nested(values, kind)};\n"
            for name, (kind, values) in tables.items()
        )


def _same(one: Expression, operator: str) -> bool:
    return isinstance(one, Binary) and one.operator == operator
