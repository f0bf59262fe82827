"""Frozen values whose fields are parameters: each is spelled once, in the class body.

    class Mass(ParameterSet):
        inertia: Number = parameter("mass.inertia", "kg*m^2", "inertia", '"0.035 kg*m^2"', "above 0")

From that line come the keyword with its type, the reading in SI, the sentences, the key in a file and the
documentation.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NoReturn, Self, TypeVar, dataclass_transform

import numpy as np
import numpy.typing as npt

from softstart.errors import InputError
from softstart.hints import term
from softstart.input.documents import DocumentTable
from softstart.input.gear import NO_GEAR, Gear, behind
from softstart.input.parameters import (
    REQUIRED,
    Limit,
    Mistake,
    Parameter,
    Wording,
    meant_by,
    read_value,
    read_values,
    sentences_of,
    without_unit,
)
from softstart.quantities import RefusedError, show

if TYPE_CHECKING:
    Read_co = TypeVar("Read_co", covariant=True)

    class Given(Generic[Read_co]):
        """A field given as a quantity and read as a value in SI: what type checkers see."""

        def __get__(self, one: object, cls: object = None) -> Read_co: ...
        def __set__(self, one: object, value: float | str | npt.ArrayLike | None) -> None: ...

    Row = TypeVar("Row", bound="ParameterSet")

    class Rows(Generic[Row]):
        """A field given as any iterable of parameter sets and read as a tuple."""

        def __get__(self, one: object, cls: object = None) -> tuple[Row, ...]: ...
        def __set__(self, one: object, value: Iterable[Row]) -> None: ...

    Number = Given[float]
    MaybeNumber = Given[float | None]
    NumberOrWord = Given[float | str]
    Series = Given[tuple[float, ...]]
    MaybeSeries = Given[tuple[float, ...] | None]
else:
    Number, MaybeNumber, NumberOrWord = float, float | None, float | str
    Series, MaybeSeries, Rows = tuple[float, ...], tuple[float, ...] | None, tuple


def parameter(
    path: str,
    unit: str,
    meaning: str,
    example: str,
    limit: Limit = "any",
    *,
    default: Any = REQUIRED,
    kw_only: bool = True,
    **more: Any,
) -> Any:
    """A field of a `ParameterSet`; `path` is `table.key` of the file, the rest as in `Parameter`."""
    table, _, key = path.rpartition(".")
    return Parameter(key, unit, meaning, example, limit, default, table=table, positional=not kw_only, **more)


def like(cls: type[ParameterSet], name: str) -> Any:
    """A field that is the parameter of another class."""
    return cls.PARAMETERS[name]


@dataclass(frozen=True)
class Component:
    """A field of a `ParameterSet` that is itself one, of this kind; or `many` of them, as [[mass]]."""

    kind: type[ParameterSet]
    many: bool
    least: int
    default: object
    positional: bool

    @property
    def tables(self) -> tuple[DocumentTable, ...]:
        """Its tables in the file of the whole."""
        required, tables = self.default is REQUIRED, self.kind.TABLES
        if self.kind.PARTS:  # of several tables, as a duty
            return tuple(replace(one, required=False, suggested=False) for one in tables)
        return tuple(
            replace(one, many=self.many, least=self.least, required=required and one.required)
            for one in tables
        )

    def misfits(self, name: str, value: object) -> Iterator[tuple[str, str]]:
        """Subject and reason for a value of another kind."""
        for one in value if isinstance(value, tuple) else [value]:
            if not isinstance(one, self.kind) and not (one is None and self.default is None):
                yield (
                    f"{name} = {show(one)}",
                    f"it takes {self.kind.WHAT}, which {self.kind.__name__}(...) makes",
                )

    def read(
        self, content: Mapping[str, Any], wording: Wording, gear: Gear | str = NO_GEAR
    ) -> tuple[list[ParameterSet], list[Mistake]]:
        """Those in the tables of a document, by name, and what is wrong with them; `gear` of the whole."""
        if self.kind.PARTS:
            return self._read_parts(content, wording, gear)
        if not self.many:
            tables = [content[one.name] for one in self.tables if one.name in content]
            rows = [{key: value for table in tables for key, value in table.items()}]
            return self._read_rows(rows if tables or self.default is REQUIRED else [], [wording], gear)
        name = self.tables[0].name
        rows = content[name] or []
        return self._read_rows(
            rows, [replace(wording, row=f"[{name}] {i + 1}, ") for i in range(len(rows))], gear
        )

    def _read_parts(
        self, content: Mapping[str, Any], wording: Wording, gear: Gear | str
    ) -> tuple[list[ParameterSet], list[Mistake]]:
        """One that is itself made of several tables; none where the document has none of them."""
        if not any(content.get(table.name) for table in self.tables):
            return [], []
        given, mistakes = dict[str, object](), list[Mistake]()
        for name, part in self.kind.PARTS.items():
            parts, wrong = part.read(content, wording, gear)
            mistakes += wrong
            if parts:
                given[name] = parts if part.many else parts[0]
        try:
            return ([] if mistakes else [self.kind._made(given, wording, [])]), mistakes
        except InputError as error:
            return [], [Mistake(sentence) for sentence in error.sentences]

    def _read_rows(
        self, rows: list[dict[str, object]], wordings: list[Wording], gear: Gear | str
    ) -> tuple[list[ParameterSet], list[Mistake]]:
        parts, mistakes, kind = list[ParameterSet](), list[Mistake](), self.kind
        gear = gear if isinstance(gear, str) else gear._replace(load=None)  # a row has a load of its own
        for row, wording in zip(rows, wordings, strict=False):
            given = {p.name: row[p.key] for p in kind.PARAMETERS.values() if p.key in row}
            values, wrong = read_values(given, kind.PARAMETERS, wording, gear=gear)
            wrong += without_unit(given, kind.PARAMETERS, kind.USUAL, wording)
            try:
                parts += [] if wrong else [kind._made(given, Wording(), [], values)]
            except InputError as error:
                place = f"{wording.before}{wording.row or f'[{self.tables[0].name}] '}"
                wrong += [Mistake(place + sentence) for sentence in error.sentences]
            mistakes += wrong
        return parts, mistakes


def component(
    kind: type[ParameterSet], *, least: int | None = None, default: Any = REQUIRED, kw_only: bool = True
) -> Any:
    """A field that is a parameter set of this kind, or a tuple of at least so many."""
    return Component(kind, least is not None, least or 0, default, not kw_only)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(parameter, component))
class ParameterSet:
    """A value made of parameters: frozen, equal by content, hashable, copied and pickled as such.

    All mistakes of one input raise a single `InputError`. `WHAT`, the argument `what` of a class, names
    it in sentences, as "a drive", and `SEVERAL` says what to do with several values for one. With `BATCH` its
    numbers may be arrays, which are read-only. Bare numbers of parameters in `USUAL` are refused in a file,
    see `without_unit`. The fields of a subclass with `kw_only=False` are positional arguments as well.
    Values given "at output" are read again when one of those in `GEARED` is changed, as a ratio, or a load
    that drives the motor from then on.
    """

    WHAT: ClassVar[str] = "a table"
    SEVERAL: ClassVar[str] = ""
    BATCH: ClassVar[bool] = False
    USUAL: ClassVar[Mapping[str, str]] = {}
    GEARED: ClassVar[frozenset[str]] = frozenset()
    PARAMETERS: ClassVar[Mapping[str, Parameter]] = {}
    PARTS: ClassVar[Mapping[str, Component]] = {}
    FIELDS: ClassVar[Mapping[str, Component | Parameter]] = {}
    TABLES: ClassVar[tuple[DocumentTable, ...]] = ()

    def __init_subclass__(cls, kw_only: bool = True, what: str = "") -> None:
        cls.WHAT = what or cls.WHAT
        declared = {name: one for name, one in vars(cls).items() if isinstance(one, Parameter)}
        parts = {name: one for name, one in vars(cls).items() if isinstance(one, Component)}
        for name, default in {name: one.default for name, one in (declared | parts).items()}.items():
            setattr(cls, name, field() if default is REQUIRED else field(default=default))
        dataclass(init=False, eq=False, repr=False)(cls)
        cls.PARTS = dict(cls.PARTS) | parts
        cls.PARAMETERS = dict(cls.PARAMETERS) | {
            name: replace(one, name=name, positional=one.positional or not kw_only)
            for name, one in declared.items()
        }
        cls.FIELDS = {**cls.PARTS, **cls.PARAMETERS}
        everyone, tables = cls.PARAMETERS.values(), list[DocumentTable]()
        for part in cls.PARTS.values():
            tables += () if part.kind.PARTS else part.tables
        for table in dict.fromkeys(p.table for p in everyone):
            keys = tuple(p for p in everyone if p.table == table)
            tables.append(DocumentTable(table, keys, required=any(p.required for p in keys)))
        for part in cls.PARTS.values():  # what is a file by itself, as a duty, comes last
            tables += part.tables if part.kind.PARTS else ()
        cls.TABLES = tuple(sorted(tables, key=lambda table: bool(table.name)))  # "" first
        cls.__replace__ = cls.replace  # type: ignore[attr-defined]  # copy.replace of Python 3.13
        arguments = [_argument(name, one) for name, one in cls.FIELDS.items()]
        arguments.sort(key=lambda one: one.kind)
        cls.__signature__ = inspect.Signature(arguments)  # type: ignore[attr-defined]
        if cls.__doc__:
            cls.__doc__ = cls.__doc__.replace("{parameters}", "\n    ".join(_documented(everyone)))

    if not TYPE_CHECKING:  # type checkers see the fields as keywords

        def __init__(self, *positional: object, **given: object) -> None:
            names = [name for name, one in self.FIELDS.items() if one.positional]
            if len(positional) > len(names):
                raise TypeError(f"{type(self).__name__} takes {len(names)} positional arguments")
            self._fill(dict(zip(names, positional, strict=False)) | given, Wording(), [])

    def _fill(
        self,
        given: Mapping[str, object],
        wording: Wording,
        mistakes: Iterable[Mistake],
        known: Mapping[str, Any] = {},
    ) -> None:
        """Read all parameters, or raise one `InputError` for everything that is wrong with them.

        `known` holds values among those given that were read before.
        """
        parameters = self.PARAMETERS
        values, found = read_values(
            given, parameters, wording, batch=self.BATCH, known=known, several=self.SEVERAL,
            gear=self._gear_in(given),
        )  # fmt: skip
        mistakes = list(mistakes)
        for name, part in self.PARTS.items():
            if name in given:
                value = given[name]
                several = isinstance(value, Iterable) and not isinstance(value, str)
                values[name] = (tuple(value) if several else (value,)) if part.many else value  # type: ignore[arg-type]
                found += [Mistake(wording.sentence(*one)) for one in part.misfits(name, values[name])]
            elif part.default is not REQUIRED:
                values[name] = part.default
            elif not mistakes:  # else it may have been there, and wrong
                found.append(Mistake(wording.sentence(f"{name} is missing", f"{self.WHAT} needs it")))
        wrong, names = [*mistakes, *found], self.FIELDS
        for name in [one for one in given if one not in names]:
            free = [p for p in parameters.values() if p.name not in given]
            meant = meant_by(name, parameters.values(), free)
            other = term(name) or f"the names are {', '.join(names)}"
            remedy = f"did you mean {' or '.join(p.name for p in meant)}?" if meant else other
            reason = f"{self.WHAT} has no parameter {show(name)}; {remedy}"
            alone = tuple(p.path for p in meant) if len(meant) == 1 else ()
            wrong.append(
                Mistake(wording.sentence(f"{name} = {wording.show(given[name])}", reason), (), alone)
            )
        fields = vars(self)
        fields.update(values)
        fields["_at_output"] = {
            name: given[name] for name in given.keys() & parameters if behind(given[name])
        }
        fields["_given"] = frozenset(
            name
            for name in given.keys() & names.keys()
            if not (given[name] is None and names[name].default is None)
        )
        right = {name: values[name] for name in fields["_given"] if name in values} if wrong else values
        sentences = [*sentences_of(wrong), *self._check(right, wording)]
        if not sentences:
            sentences = [wording.before + sentence for sentence in self.contradictions()]
        if sentences:
            raise InputError(sentences)

    @classmethod
    def _gear_in(cls, given: Mapping[str, object]) -> Gear | str:
        """The gear among the values given, through which those "... at output" go, or why there is none."""
        return NO_GEAR

    def _check(self, values: Mapping[str, Any], wording: Wording) -> Iterable[str]:
        """Sentences on values that contradict one another, of those that are right in themselves."""
        return ()

    def contradictions(self) -> Iterable[str]:
        """The same once all are right in themselves and set; without the name of the file."""
        return ()

    @classmethod
    def _made(cls, *filled: Any) -> Self:
        one = cls.__new__(cls)
        one._fill(*filled)
        return one

    def _derive(self, **values: object) -> None:
        """Set values that follow from others, as if they had been given; None takes one back."""
        fields = vars(self)
        fields.update(values)
        fields["_at_output"] = {p: text for p, text in fields["_at_output"].items() if p not in values}
        fields["_given"] = frozenset(
            one for one in fields["_given"] | values.keys() if fields[one] is not None
        )

    def given(self) -> dict[str, Any]:
        """The parameters that were given, in the order of the fields; the others have their defaults."""
        fields, given = vars(self), vars(self)["_given"]
        return {name: fields[name] for name in self.FIELDS if name in given}

    def written(self) -> dict[str, Any]:
        """As `given`, with the values that were given "at output" as they were written there."""
        return self.given() | vars(self)["_at_output"]

    def values(self) -> dict[str, Any]:
        """All parameters by name."""
        fields = vars(self)
        return {name: fields[name] for name in self.FIELDS}

    def replace(self, **changes: object) -> Self:
        """The same with some parameters changed; those that follow another one follow it still.

        >>> from softstart import Drive
        >>> Drive.load("crane-4amtkf").replace(gap="2 rad", load_inertia="700 kg*cm^2").gap
        2.0
        """
        return self._changed(changes, Wording(), [])

    def _changed(self, changes: Mapping[str, object], wording: Wording, mistakes: Iterable[Mistake]) -> Self:
        known, given = self.given(), self.written() | dict(changes)
        again = vars(self)["_at_output"] if isinstance(self._new_gear(changes), Gear) else {}
        known = {name: value for name, value in known.items() if name not in changes and name not in again}
        return self._made(given, wording, mistakes, known)

    def _new_gear(self, changes: Mapping[str, object]) -> Gear | str:
        """The gear after these changes, for values "at output"; "" if they go as before, or it is wrong."""
        changed = {name: changes[name] for name in self.GEARED & changes.keys()}
        with suppress(RefusedError):
            for name, value in changed.items():
                if value is not None:
                    read_value(self.PARAMETERS[name], value, batch=self.BATCH, gear=Gear(1.0))
            if changed:
                old, new = self._gear_in(self.given()), self._gear_in(self.written() | dict(changes))
                return "" if isinstance(old, Gear) and isinstance(new, Gear) and old.like(new) else new
        return ""

    def through(self, gear: Gear) -> Self:
        """The same with the values given "at output" brought to the motor shaft through this gear.

        >>> from softstart import Drive
        >>> Drive.load("crane-4amtkf").replace(gear_ratio=2, gap="0.1 rad at output").through(Gear(20.0)).gap
        2.0
        """
        given, written = self.given(), vars(self)["_at_output"]
        again, wrong = read_values(
            written, {name: self.PARAMETERS[name] for name in written}, Wording(), gear=gear
        )
        return self._made(self.written(), Wording(), wrong, given | again) if written else self

    def __eq__(self, other: object) -> bool:
        return self._content() == other._content() if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._content())

    def _content(self) -> tuple[object, ...]:
        values = self.values().values()
        return tuple((v.shape, v.tobytes()) if isinstance(v, np.ndarray) else v for v in values)

    def __repr__(self) -> str:
        listed = ", ".join(f"{name}={value!r}" for name, value in self.given().items())
        return f"{type(self).__name__}({listed})"

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Self:
        return self

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"{self.WHAT} cannot be changed; make another with replace({name}=...)")

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"{self.WHAT} cannot be changed")


def _argument(name: str, p: Parameter | Component) -> inspect.Parameter:
    """The field as an argument of the constructor, for editors and the documentation."""
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD if p.positional else inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(
        name, kind, default=inspect.Parameter.empty if p.default is REQUIRED else p.default
    )


def _documented(parameters: Iterable[Parameter]) -> Iterable[str]:
    """The parameters as a numpydoc section has them."""
    for p in parameters:
        number = {"": "text", "1": "number"}.get(p.unit, f"number in {p.unit}")
        optional = "" if p.required else f", default {p.follows or repr(p.default)}"
        kinds = [*map(show, p.choices), number] if p.unit or not p.choices else map(show, p.choices)
        yield f"{p.name} : {' or '.join(kinds)}{optional}"
        symbol = f" `{p.symbol}`" if p.symbol and p.symbol != p.name else ""
        limit = f"; {p.limit}" if p.limit not in ("any", "one line") else ""
        yield f"    {p.meaning[:1].upper()}{p.meaning[1:]}{symbol}{limit}."


def read_settings(
    settings: Iterable[str], parameters: Mapping[str, Parameter]
) -> tuple[dict[str, object], Wording, list[Mistake]]:
    """Changes as typed at a command line: values by name, the wording with the keys as typed, and mistakes.

    >>> from softstart.drive import PARAMETERS
    >>> given, wording, mistakes = read_settings(["load.inertia=0.07", "gap = 2 rad", "gapp=1"], PARAMETERS)
    >>> given, wording.label(PARAMETERS["load_inertia"])
    ({'load_inertia': '0.07', 'gap': '2 rad'}, 'load.inertia')
    >>> mistakes[0].sentence
    'gapp=1: there is no parameter "gapp"; did you mean shaft.gap?'
    """
    parameters_by_path = {p.path: p for p in parameters.values()}
    given: dict[str, object] = {}
    written: dict[str, str] = {}
    first: dict[str, str] = {}
    mistakes = []
    for setting in [settings] if isinstance(settings, str) else settings:
        key, equals, value = (part.strip() for part in str(setting).partition("="))
        parameter = parameters_by_path.get(key) or parameters.get(key)
        subject = show(setting)
        if not equals or not key or not isinstance(setting, str):
            reason = "a setting is text: a key, an equals sign and a value, such as load.inertia=0.07"
        elif parameter is None:
            subject, reason = (
                setting,
                f"there is no parameter {show(key)}; {_remedy(key, parameters_by_path, parameters)}",
            )
        elif parameter.name in first:
            subject, reason = setting, f"it was set before ({first[parameter.name]}); keep one of the two"
        else:
            quoted = len(value) >= 2 and value[0] == value[-1] and value[0] in "\"'"
            given[parameter.name] = value[1:-1] if quoted else value
            written[parameter.name], first[parameter.name] = key, setting
            continue
        mistakes.append(Mistake(Wording(style="path").sentence(subject, reason)))
    return given, Wording(style="path", written=written), mistakes


def _remedy(
    key: str, parameters_by_path: Mapping[str, Parameter], parameters: Mapping[str, Parameter]
) -> str:
    within = [path for path in parameters_by_path if path.startswith(f"{key}.")]
    if within:
        return f"{key} is a table, name one of its keys, such as {within[0]}"
    meant, other = (
        meant_by(key, parameters.values()),
        term(key) or f"there are {', '.join(parameters_by_path)}",
    )
    return f"did you mean {' or '.join(p.path for p in meant)}?" if meant else other
