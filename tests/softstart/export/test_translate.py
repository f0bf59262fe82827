"""Each statement that can be translated means the same as in Python; all else is refused with its line."""

from __future__ import annotations

import inspect
import math
import types
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.export import refused, translated
from tests.softstart.export.statements_in_python import run, zero

from softstart.errors import InputError
from softstart.export.source import python_function
from softstart.export.statements import Field, Struct, Variable
from softstart.export.translate import Translator
from softstart.kernel.jit import unfused

KINDS = {"float": "real", "int": "whole"}


def function_of(function: Callable[..., Any]) -> Any:
    """Its statements."""
    translator = Translator()
    arguments = [
        Variable(name, KINDS.get(str(one.annotation)) or translator.structs.of(translated.OUTER))  # type: ignore[arg-type]
        for name, one in inspect.signature(function).parameters.items()
    ]
    made = translator.function(function, arguments)
    translator.program(made)
    return made, translator


class Attributes:
    """A structure of dicts and lists as the record that Python sees."""

    def __init__(self, held: dict[str, Any]) -> None:
        self.__dict__["held"] = held

    def __getattr__(self, name: str) -> Any:
        found = self.held[name]
        return (
            Attributes(found)
            if isinstance(found, dict)
            else Grid(found)
            if isinstance(found, list)
            else found
        )

    def __setattr__(self, name: str, value: Any) -> None:
        kind = type(self.held[name])
        self.held[name] = kind(value)


class Grid:
    """Nested lists with indices in pairs."""

    def __init__(self, held: list[Any]) -> None:
        self.held = held

    def __getitem__(self, at: Any) -> Any:
        if isinstance(at, tuple):
            return self.held[at[0]][at[1]]
        return Grid(self.held[at]) if isinstance(self.held[at], list) else self.held[at]

    def __setitem__(self, at: Any, value: Any) -> None:
        if isinstance(at, tuple):
            self.held[at[0]][at[1]] = float(value)
        else:
            self.held[at] = float(value)


def filled(kind: Any, rng: np.random.Generator) -> Any:
    """A structure with numbers."""
    if isinstance(kind, Struct):
        return {member.name: filled(member.type, rng) for member in kind.members}
    empty = zero(kind)
    if isinstance(empty, list):
        return np.round(rng.uniform(-3.0, 3.0, np.shape(empty)), 2).tolist()
    return type(empty)(rng.integers(0, 3)) if kind != "real" else float(np.round(rng.uniform(-3.0, 3.0), 2))


POWERS = ("powers", "more_powers")  # numba takes them as products
NUMBERS = st.one_of(
    st.floats(-4.0, 4.0, allow_subnormal=False), st.sampled_from([0.0, 1.0, -1.0, 2.0, 0.25, 1e-9])
)
NAMES = [
    name
    for name, one in vars(translated).items()
    if inspect.isfunction(one) and one.__module__ == translated.__name__ and name != "views"
]


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_statements_mean_what_they_mean_in_python(name: str, data: st.DataObject) -> None:
    function = getattr(translated, name)
    made, translator = function_of(function)
    seed = data.draw(st.integers(0, 1000))
    arguments, same, structs = [], [], []
    for parameter, annotation in inspect.signature(function).parameters.items():
        kind = str(annotation.annotation)
        if kind in KINDS:
            number: Any = data.draw(NUMBERS if kind == "float" else st.integers(-2, 9), label=parameter)
            if name == "records" and kind == "int":
                number = abs(number)
            arguments.append(number)
            same.append(number)
        else:
            rng = np.random.default_rng(seed)
            first = filled(translator.structs.of(translated.OUTER), rng)
            second = filled(translator.structs.of(translated.OUTER), np.random.default_rng(seed))
            arguments.append(first)
            same.append(Attributes(second))
            structs.append((first, second))
    table = {one: list(values) for one, (_, values) in translator.tables.items()}
    answers = run(made, *arguments, tables=table)
    in_python = {key: getattr(one, "py_func", one) for key, one in vars(translated).items()}
    plain = types.FunctionType(function.__code__, in_python)
    expected = (unfused(function) if name in POWERS else plain)(*same)
    expected = expected if isinstance(expected, tuple) else (expected,)
    for answer, wanted in zip(answers, expected, strict=True):
        assert answer == wanted or (math.isnan(answer) and math.isnan(wanted))
    for first, second in structs:
        assert first == second


def test_a_row_gets_its_record_by_name() -> None:
    from softstart.export.values import Row

    translator = Translator()
    outer = Variable("row", translator.structs.of(translated.OUTER))
    made = translator.function(translated.views, [Row(outer, None), Variable("x", "real")])
    assert [one.name for one in made.parameters] == ["row", "x"]
    assert made.changed == {"row"}


def test_fields_have_their_kinds_and_comments() -> None:
    outer = Translator().structs.of(translated.OUTER)
    kinds = {member.name: member.type for member in outer.members}
    assert (kinds["x"], kinds["sample"], kinds["running"]) == ("real", "whole", "truth")
    assert outer.member("x").comment == "m"
    assert isinstance(kinds["inner"], Struct)
    assert kinds["inner"].member("low").comment == "N m"
    assert Field(Variable("o", outer), "x", "real").type == "real"


def test_a_lambda_is_refused() -> None:
    def taken(x: float) -> float:
        return x

    twice = lambda x: 2.0 * x  # noqa: E731  what is refused
    assert function_of(taken)
    with pytest.raises(InputError, match=r"test_translate.py:\d+: <lambda>: this cannot be exported; write"):
        Translator().function(twice, [Variable("x", "real")])


PLACE = 1.0


def test_a_name_of_a_closure_is_no_global_one() -> None:
    def made(PLACE: float) -> Callable[..., Any]:
        def found() -> float:
            return PLACE

        return found

    (answer,) = run(Translator().function(made(7.0), []))
    assert answer == 7.0


def test_tables_of_one_name_in_two_places_stay_two() -> None:
    def made(table: Any) -> Callable[..., Any]:
        def found(n: int) -> float:
            return float(table[n])

        return found

    translator = Translator()
    functions = [
        translator.function(made(np.array([first, 2.0])), [Variable("n", "whole")]) for first in (1.0, 5.0)
    ]
    tables = {name: list(values) for name, (_, values) in translator.tables.items()}
    assert [run(one, 0, tables=tables) for one in functions] == [(1.0,), (5.0,)]


REFUSED = [name for name, one in vars(refused).items() if inspect.isfunction(python_function(one))]


@pytest.mark.parametrize(
    "name",
    [
        name
        for name in REFUSED
        if getattr(refused, name).__module__ == refused.__name__ and name not in ("plain", "moved", "halved")
    ],
)
def test_what_cannot_be_translated_is_refused_with_its_line(name: str) -> None:
    function = getattr(refused, name)
    with pytest.raises(InputError) as caught:
        function_of(function)
    (sentence,) = caught.value.sentences
    lines, first = inspect.getsourcelines(function)
    marked = first + next(at for at, line in enumerate(lines) if "# here" in line)
    assert sentence.startswith(f"{refused.__file__}:{marked}: "), sentence
    assert " cannot be exported; " in sentence
    assert sentence.endswith(".")
