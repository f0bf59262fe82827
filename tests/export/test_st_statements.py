"""Each typed statement as Structured Text, executed, against Python."""

from __future__ import annotations

import copy
import itertools
import math
import types
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.export.st_interpreter import Program as Interpreter
from tests.softstart.export import translated
from tests.softstart.export.test_translate import NAMES, Attributes, filled, function_of

from softstart.errors import InputError
from softstart.export.st import add_program
from softstart.export.st_text import Text
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
    Kind,
    Leave,
    Member,
    Program,
    Return,
    Statement,
    Struct,
    Unary,
    Variable,
    While,
)

REALS = (-7.5, -2.0, -0.3, 0.0, 0.3, 1.0, 2.5, 1e6)
WHOLES = (-7, -2, -1, 0, 1, 3, 8)
a, b = Variable("a", "real"), Variable("b", "real")
i, j, n = Variable("i", "whole"), Variable("j", "whole"), Variable("most", "whole")
t, v = Variable("yes", "truth"), Variable("other", "truth")
D: Kind = "double"


def real(value: float) -> Constant:
    return Constant(value, "real")


def whole(value: int) -> Constant:
    return Constant(value, "whole")


def written(functions: list[Function], structs: tuple[Struct, ...] = (), single: bool = False) -> str:
    text = Text("case", single)
    add_program(text, Program(list(structs), functions))
    return str(text)


def function(body: list[Statement], parameters: list[Variable], *returns: Kind, **local: Kind) -> Function:
    return Function("run_it", tuple(parameters), returns, dict(local), tuple(body))


def run(made: Function, single: bool = False, **given: Any) -> Any:
    """What one function answers."""
    answer = Interpreter(written([made], single=single)).call("case_run_it", **given)
    return answer[0] if len(made.returns) == 1 else answer[1:]


def of_reals(expression: Expression, python: Callable[..., Any], result: Kind = "real") -> None:
    """An expression of a and b for many numbers, to the bit, in LREAL and in REAL."""
    made = function([Return((expression,))], [a, b], result)
    for single, number in ((False, float), (True, np.float32)):
        program = Interpreter(written([made], single=single))
        for x, y in itertools.product(map(number, REALS), repeat=2):
            try:
                wanted = python(x, y)
            except (ZeroDivisionError, ValueError, FloatingPointError, RuntimeWarning):
                continue
            (found,) = program.call("case_run_it", a=x, b=y)
            assert found == wanted, (single, x, y)
            assert type(found) is type(wanted) or result in ("truth", "whole")


@pytest.mark.parametrize("operator", ["+", "-", "*", "/"])
def test_arithmetic(operator: str) -> None:
    python = {
        "+": lambda x, y: x + y,
        "-": lambda x, y: x - y,
        "*": lambda x, y: x * y,
        "/": lambda x, y: x / y,
    }
    of_reals(Binary(operator, a, b, "real"), python[operator])


def test_order_of_operations() -> None:
    right = Binary("-", a, Binary("-", b, Binary("+", a, real(0.1), "real"), "real"), "real")
    of_reals(right, lambda x, y: x - (y - (x + type(x)(0.1))))
    left = Binary("*", Binary("+", a, b, "real"), Unary("-", Binary("-", a, b, "real"), "real"), "real")
    of_reals(left, lambda x, y: (x + y) * -(x - y))
    quotient = Binary("*", a, Binary("*", b, real(-0.7), "real"), "real")
    of_reals(quotient, lambda x, y: x * (y * type(x)(-0.7)))


@pytest.mark.parametrize("operator", ["<", "<=", ">", ">=", "==", "!="])
def test_comparisons(operator: str) -> None:
    of_reals(Binary(operator, a, b, "truth"), lambda x, y: eval(f"x {operator} y"), "truth")


def test_comparison_of_truths() -> None:
    for operator, wanted in (("==", False), ("!=", True)):
        assert (
            run(
                function([Return((Binary(operator, t, v, "truth"),))], [t, v], "truth"), yes=True, other=False
            )
            is wanted
        )


@pytest.mark.parametrize("operator", ["+", "-", "*", "//", "%"])
def test_whole_numbers(operator: str) -> None:
    made = function([Return((Binary(operator, i, j, "whole"),))], [i, j], "whole")
    program = Interpreter(written([made]))
    for x, y in itertools.product(WHOLES, repeat=2):
        if y or operator not in "//%":
            assert program.call("case_run_it", i=x, j=y) == (eval(f"x {operator} y"),)


def test_beyond_whole_numbers_raises() -> None:
    made = function([Return((Binary("*", i, i, "whole"),))], [i], "whole")
    with pytest.raises(OverflowError):
        run(made, i=2**40)


def test_and_or_evaluate_the_right_side_only_if_it_decides() -> None:
    division = Binary(">", Binary("/", a, b, "real"), real(1.0), "truth")
    for operator in ("and", "or"):
        test = Binary("!=" if operator == "and" else "==", b, real(0.0), "truth")
        both = Binary(operator, test, division, "truth")
        wanted: dict[str, Callable[[float, float], bool]] = {
            "and": lambda x, y: y != 0.0 and x / y > 1.0,
            "or": lambda x, y: y == 0.0 or x / y > 1.0,
        }
        either = [If(both, (Return((real(1.0),)),), (Return((real(2.0),)),))]
        alone = [If(both, (Return((real(1.0),)),)), Return((real(2.0),))]
        second = [If(Binary("<", a, real(-2.0), "truth"), (Return((real(3.0),)),), tuple(either))]
        for body in (either, alone):
            of_reals_of(body, lambda x, y, f=wanted[operator]: 1.0 if f(x, y) else 2.0)
        of_reals_of(second, lambda x, y, f=wanted[operator]: 3.0 if x < -2.0 else 1.0 if f(x, y) else 2.0)
        negated = [
            Assign(v, Unary("not", both, "truth")),
            If(v, (Return((real(4.0),)),)),
            Return((real(5.0),)),
        ]
        of_reals_of(negated, lambda x, y, f=wanted[operator]: 5.0 if f(x, y) else 4.0, other="truth")


def of_reals_of(body: list[Statement], python: Callable[..., float], **local: Kind) -> None:
    program = Interpreter(written([function(body, [a, b], "real", **local)]))
    for x, y in itertools.product(REALS, repeat=2):
        assert program.call("case_run_it", a=x, b=y) == (python(x, y),), (x, y)


def test_elements_are_looked_up_only_if_needed() -> None:
    m = Variable("m", Array("real", (3,)))
    reads = Binary(">", Element(m, (i,), "real"), real(0.0), "truth")
    inside = Binary("and", Binary("<", i, whole(3), "truth"), reads, "truth")
    loop = While(inside, (Assign(i, Binary("+", i, whole(1), "whole")),))
    made = function([loop, Return((i,))], [m, i], "whole")
    for numbers, begin, wanted in (([1.0, 1.0, 1.0], 0, 3), ([1.0, 0.0, 1.0], 0, 1), ([0.0] * 3, 2, 2)):
        assert run(made, m=numbers, i_given=begin) == wanted


def test_conversions() -> None:
    for expression, python in (
        (Convert(a, "whole"), int),
        (Convert(Apply("floor", (a,), "real"), "whole"), math.floor),
        (Convert(Apply("ceil", (a,), "real"), "whole"), math.ceil),
        (Convert(Convert(a, "double"), "whole"), int),
    ):
        made = function([Return((expression,))], [a], "whole")
        for single in (False, True):
            program = Interpreter(written([made], single=single))
            for x in (*REALS, 2.5, -2.5, 3.5, -3.5, 0.999):
                assert program.call("case_run_it", a=np.float32(x) if single else x) == (python(x),)
    assert run(function([Return((Convert(i, "real"),))], [i], "real"), i=7) == 7.0
    assert run(function([Return((Convert(t, "whole"),))], [t], "whole"), yes=True) == 1
    assert run(function([Return((Convert(t, "real"),))], [t], "real"), yes=False) == 0.0
    narrow = function([Return((Convert(Variable("wide", D), "real"),))], [Variable("wide", D)], "real")
    assert run(narrow, wide=0.1, single=True) == np.float32(0.1)
    assert run(narrow, wide=0.1) == 0.1
    wide = function([Return((Binary("+", Convert(a, D), Constant(0.1, D), D),))], [a], D)
    found = run(wide, a=np.float32(0.1), single=True)
    assert type(found) is float
    assert found == float(np.float32(0.1)) + 0.1


@pytest.mark.parametrize(
    ("name", "python"),
    [("min", min), ("max", max), ("copysign", None), ("atan2", None)],
)
def test_functions_of_two(name: str, python: Callable[..., Any] | None) -> None:
    if python is not None:
        of_reals(Apply(name, (a, b), "real"), python)
        return
    made = function([Return((Apply(name, (a, b), "real"),))], [a, b], "real")
    for x, y in itertools.product(REALS, repeat=2):  # atan2 has the rounding of a quotient more
        assert run(made, a=x, b=y) == pytest.approx(getattr(math, name)(x, y), rel=5e-16, abs=0.0)


def test_minimum_and_maximum_of_nan_and_zeros() -> None:
    """The first unless the second is smaller, or larger."""
    for name, python in (("min", min), ("max", max)):
        made = function([Return((Apply(name, (a, b), "real"),))], [a, b], "real")
        for x, y in itertools.product((math.nan, 1.0, 0.0, -0.0), repeat=2):
            found, wanted = run(made, a=x, b=y), python(x, y)
            assert math.isnan(found) == math.isnan(wanted)
            assert math.isnan(wanted) or math.copysign(1.0, found) == math.copysign(1.0, wanted)
    for name in ("min", "max"):
        made = function([Return((Apply(name, (i, j), "whole"),))], [i, j], "whole")
        assert run(made, i=3, j=-4) == {"min": -4, "max": 3}[name]


@pytest.mark.parametrize("name", ["sqrt", "exp", "log", "sin", "cos", "tan", "atan", "floor", "ceil", "abs"])
def test_functions_of_one(name: str) -> None:
    made = function([Return((Apply(name, (a,), "real"),))], [a], "real")
    for x in (0.3, 1.0, 2.5, 7.1, -0.7, -3.0, 1e17):
        if x > 0.0 or name not in ("sqrt", "log"):
            if name == "exp" and x > 700.0:
                continue
            python = abs if name == "abs" else getattr(math, name)
            assert run(made, a=x) == float(python(x))
            if name != "exp" or x < 80.0:
                assert run(made, a=np.float32(x), single=True) == np.float32(python(float(np.float32(x))))


def test_not_a_number_and_infinity() -> None:
    for name, wanted in (("isnan", [True, False, False, False]), ("isfinite", [False, False, False, True])):
        made = function([Return((Apply(name, (a,), "truth"),))], [a], "truth")
        for single in (False, True):
            found = [run(made, single, a=x) for x in (math.nan, math.inf, -math.inf, 1e30)]
            assert found == wanted
    unequal = function([Return((Binary("==", a, real(math.inf), "truth"),))], [a], "truth")
    assert not run(unequal, a=1.0)
    returned = function([Return((real(-math.inf), Constant(math.inf, D)))], [], "real", D)
    assert run(returned) == (-(2.0**126), 2.0**126)
    # REAL and LREAL have the same one
    wide = Binary("==", Convert(a, D), Constant(math.inf, D), "truth")
    same = function([Assign(a, real(math.inf)), Return((wide,))], [], "truth", a="real")
    assert run(same, single=True)


def test_sign_and_absolute_value() -> None:
    made = function([Return((Apply("sign", (a,), "real"),))], [a], "real")
    assert [run(made, a=x) for x in (-3.0, 0.0, 2.0)] == [-1.0, 0.0, 1.0]
    assert run(function([Return((Apply("abs", (i,), "whole"),))], [i], "whole"), i=-5) == 5


@pytest.mark.parametrize("name", ["gauss", "nextafter", "hypot", "expm1"])
def test_functions_without_a_counterpart_are_refused(name: str) -> None:
    with pytest.raises(InputError, match=name):
        written([function([Return((Apply(name, (a, b), "real"),))], [a, b], "real")])


def test_nan_and_remainders_of_reals_are_refused() -> None:
    with pytest.raises(InputError, match="NaN"):
        written([function([Return((real(math.nan),))], [], "real")])
    with pytest.raises(InputError, match="%"):
        written([function([Return((Binary("%", a, b, "real"),))], [a, b], "real")])


@pytest.mark.parametrize(
    ("start", "stop", "step"),
    [(0, 4, 1), (4, 0, -1), (7, -2, -2), (1, 8, 3), (3, 3, 1), (5, 2, 1), (2, 5, -1), (-3, 4, 2), (0, 1, 5)],
)
def test_for(start: int, stop: int, step: int) -> None:
    """Ranges upwards, downwards and empty ones; the end is a constant or a variable."""
    for end in (whole(stop), n):
        keep = Assign(j, Binary("+", Binary("*", j, whole(10), "whole"), i, "whole"))
        made = function(
            [For(i, whole(start), end, step, (keep,)), Return((j,))], [n], "whole", i="whole", j="whole"
        )
        wanted = 0
        for k in range(start, stop, step):
            wanted = 10 * wanted + k
        assert run(made, most=stop) == wanted


def test_for_begins_at_a_variable() -> None:
    keep = Assign(j, Binary("+", j, i, "whole"))
    made = function([For(i, n, whole(-1), -1, (keep,)), Return((j,))], [n], "whole", i="whole", j="whole")
    assert [run(made, most=k) for k in (4, 0, -1, -5)] == [10, 0, 0, 0]


def test_break_and_continue() -> None:
    """`continue` at the end of a branch, in both, deep in one, behind an inner loop; `break` beside it."""

    def equal(place: Expression, value: int) -> Binary:
        return Binary("==", place, whole(value), "truth")

    add = Assign(j, Binary("+", Binary("*", j, whole(3), "whole"), i, "whole"))
    go_on, stop = Leave("continue"), Leave("break")
    inner = For(n, whole(0), whole(3), 1, (If(equal(n, 1), (go_on,)), add))
    deep = If(Binary(">", i, whole(1), "truth"), (If(equal(i, 3), (go_on,)), add), (add,))
    bodies: list[tuple[tuple[Statement, ...], str]] = [
        ((If(equal(i, 2), (go_on,)), add), "if i == 2: continue\n    j = 3 * j + i"),
        ((If(equal(i, 2), (go_on,), (add,)), add), "if i == 2: continue\n    j = 9 * j + 4 * i"),
        ((If(equal(i, 4), (stop,)), add), "if i == 4: break\n    j = 3 * j + i"),
        ((deep, add), "if i > 1:\n        if i == 3: continue\n    j = 9 * j + 4 * i"),
        ((If(equal(i, 2), (add, go_on), (stop,)), add), "if i != 2: break\n    j = 3 * j + i"),
        (
            (inner, If(equal(i, 1), (go_on,)), add),
            "j = 9 * j + 4 * i\n    if i == 1: continue\n    j = 3 * j + i",
        ),
        ((add, go_on, stop), "j = 3 * j + i"),
    ]
    for body, python in bodies:
        made = function(
            [For(i, whole(0), whole(6), 1, body), Return((j,))],
            [],
            "whole",
            i="whole",
            j="whole",
            most="whole",
        )
        names = {"j": 0}
        exec(f"for i in range(6):\n    {python}", names)
        assert run(made) == names["j"], python


def test_while() -> None:
    body = (Assign(j, Binary("+", j, whole(2), "whole")), If(Binary(">", j, n, "truth"), (Leave("break"),)))
    made = function([While(Constant(True, "truth"), body), Return((j,))], [n], "whole", j="whole")
    assert run(made, most=5) == 6
    halves = While(Binary(">", a, real(1.0), "truth"), (Assign(a, Binary("*", a, real(0.5), "real")),))
    assert run(function([halves, Return((a,))], [a], "real"), a_given=6.0) == 0.75


def test_return_in_a_loop_ends_the_function() -> None:
    leave = If(Binary("==", i, n, "truth"), (Return((i, t)),))
    made = function(
        [For(i, whole(0), whole(9), 1, (leave,)), Return((whole(-1), t))], [n, t], "whole", "truth", i="whole"
    )
    assert run(made, most=4, yes=True) == (4, True)
    assert run(made, most=40, yes=False) == (-1, False)


INNER = Struct("Inner", (Member("gain", "real"), Member("T", D), Member("t", "truth")))
OUTER = Struct(
    "Outer",
    (
        Member("first", INNER, "N m"),
        Member("many", Array(INNER, (2,))),
        Member("list", Array("real", (3,))),
        Member("grid", Array("real", (2, 3))),
        Member("count", "whole"),
    ),
)
x, y = Variable("x", OUTER), Variable("y", OUTER)
INNER_T = Field(Field(x, "first", INNER), "T", D)


def test_structures_arrays_and_copies() -> None:
    grid, list_of = Field(x, "grid", Array("real", (2, 3))), Field(x, "list", Array("real", (3,)))
    body: list[Statement] = [
        Assign(INNER_T, Constant(0.1, D)),
        Assign(Field(Element(Field(x, "many", Array(INNER, (2,))), (i,), INNER), "gain", "real"), real(5.0)),
        For(j, whole(0), whole(3), 1, (Assign(Element(grid, (i, j), "real"), Convert(j, "real")),)),
        Copy(list_of, Element(grid, (i,), Array("real", (3,)))),
        Copy(y, x),
        Assign(Element(list_of, (whole(0),), "real"), real(9.0)),
        Copy(Element(grid, (whole(0),), Array("real", (3,))), Field(y, "list", Array("real", (3,)))),
        Return(),
    ]
    made = Function("run_it", (x, y, i), (), {"j": "whole"}, tuple(body), frozenset({"x", "y"}))
    program = Interpreter(written([made], (INNER, OUTER)))
    first, second = program.new("case_Outer"), program.new("case_Outer")
    assert program.call("case_run_it", x=first, y=second, i=1) == (True,)
    assert first.first_.t_value_ == 0.1
    assert [one.gain_ for one in first.many_] == [0.0, 5.0]
    assert first.grid_ == [[0.0, 1.0, 2.0], [0.0, 1.0, 2.0]]
    assert first.list_ == [9.0, 1.0, 2.0]
    assert second.list_ == [0.0, 1.0, 2.0]
    assert second.grid_ == [[0.0, 0.0, 0.0], [0.0, 1.0, 2.0]]  # its own, not that of the first
    with pytest.raises(IndexError):
        program.call("case_run_it", x=first, y=second, i=2)


def test_calls() -> None:
    """By reference and by value, with several values, one, none, and values that nobody needs."""
    swap = Function("swap", (a, b), ("real", "real"), {}, (Return((b, a)),))
    twice = Function(
        "twice", (a,), ("real",), {}, (Assign(a, Binary("*", a, real(2.0), "real")), Return((a,)))
    )
    note = Function("note", (x, a), (), {}, (Assign(INNER_T, Convert(a, D)),), frozenset({"x"}))
    body: list[Statement] = [
        Call(swap, (a, Binary("+", b, real(1.0), "real")), (a, b)),
        Call(swap, (a, b), (None, b)),
        Call(twice, (b,), (b,)),
        Call(twice, (b,), (None,)),
        Call(note, (x, b)),
        Return((b,)),
    ]
    made = Function("run_it", (x, a, b), ("real",), {}, tuple(body), frozenset({"x"}))
    program = Interpreter(written([swap, twice, note, made], (INNER, OUTER)))
    given = program.new("case_Outer")
    # a, b = b + 1, a; b = a; b = 2 b
    assert program.call("case_run_it", x=given, a_given=3.0, b_given=6.0) == (14.0,)
    assert given.first_.t_value_ == 14.0


def test_names_that_a_tool_would_not_take() -> None:
    names = ["dt", "T", "t", "time_", "step", "R", "in__it", "value_1", "limit", "a" * 40, "infinity"]
    parameters = [Variable(name, "real") for name in names]
    total: Expression = real(0.0)
    for parameter in parameters:
        total = Binary("+", total, parameter, "real")
    text = written([function([Return((total,))], parameters, "real")])
    program = Interpreter(text)
    inputs = list(program.source.units["case_run_it"].inputs)
    assert run(function([Return((total,))], parameters, "real"), **dict.fromkeys(inputs, 1.0)) == len(names)


def put(place: Any, text: Text, kind: Struct, held: dict[str, Any]) -> None:
    """Numbers of dicts and lists into a structure."""
    for member in kind.members:
        name = f"{text.field_name(kind, member.name).lower()}_"
        if isinstance(member.type, Struct):
            put(getattr(place, name), text, member.type, held[member.name])
        else:
            setattr(place, name, copy.deepcopy(held[member.name]))


def taken(place: Any, text: Text, kind: Struct) -> dict[str, Any]:
    """The numbers of a structure as dicts and lists."""
    found = {}
    for member in kind.members:
        value = getattr(place, f"{text.field_name(kind, member.name).lower()}_")
        found[member.name] = taken(value, text, member.type) if isinstance(member.type, Struct) else value
    return found


@pytest.mark.parametrize("name", NAMES)
def test_translated_functions_mean_what_they_mean_in_python(name: str) -> None:
    """All that can be translated, from Python to executed Structured Text."""
    made, translator = function_of(getattr(translated, name))
    in_python = {key: getattr(one, "py_func", one) for key, one in vars(translated).items()}
    function = types.FunctionType(getattr(translated, name).__code__, in_python)
    text = Text("case")
    if name == "quotients":
        with pytest.raises(InputError, match="of real numbers has no counterpart in Structured Text"):
            add_program(text, translator.program(made))
        return
    add_program(text, translator.program(made))
    program, random = Interpreter(str(text)), np.random.default_rng(5)
    signature = text.signatures[made.name]
    compared = 0
    for _ in range(60):
        given: dict[str, Any] = {}
        python: list[Any] = []
        records = []
        for parameter, to in zip(made.parameters, signature.inputs, strict=True):
            if isinstance(parameter.type, Struct):
                held = filled(parameter.type, random)
                place = program.new(text.type_name(parameter.type))
                put(place, text, parameter.type, held)
                python.append(Attributes(held))
                records.append((place, parameter.type, held))
                given[to.lower()] = place
            else:
                value = random.choice([0.0, 1.0, -1.0, 2.0, 0.25, 1e-9, float(random.uniform(-4.0, 4.0))])
                number = (
                    int(random.integers(0 if records else -2, 9))
                    if parameter.type == "whole"
                    else float(value)
                )
                python.append(number)
                given[to.lower()] = number
        try:
            wanted = function(*python)
        except (ZeroDivisionError, ValueError, IndexError):
            continue
        result = program.call(signature.name, **given)
        values = wanted if isinstance(wanted, tuple) else () if wanted is None else (wanted,)
        found = result if len(made.returns) == 1 else result[1:]
        limited = [min(max(value, -(2.0**126)), 2.0**126) for value in map(float, values)]
        room = {"powers": 1e-15, "more_powers": 1e-14}.get(name, 0.0)  # Python rounds x**3 once
        assert [float(one) for one in found] == pytest.approx(limited, rel=room, abs=0.0), given
        for place, kind, held in records:
            assert taken(place, text, kind) == held
        compared += 1
    assert compared > 20
