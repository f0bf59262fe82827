"""Frozen values whose fields are parameters: each is spelled once, in the class body.

    class Mass(ParameterSet):
        inertia: Number = parameter("mass.inertia", "kg*m^2", "inertia", '"0.035 kg*m^2"', "above 0")

From that line come the keyword with its type, the reading in SI, the sentences, the key in a file and the
documentation.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NoReturn, Self, TypeVar, dataclass_transform

import numpy as np
import numpy.typing as npt

from softstart.errors import InputError
from softstart.hints import term
from softstart.input.documents import DocumentTable, apply_changes, placed
from softstart.input.gear import NO_GEAR, Gear
from softstart.input.parameters import (
    REQUIRED,
    Limit,
    Mistake,
    Parameter,
    Wording,
    meant_by,
    read_values,
    sentences_of,
)
from softstart.quantities import show

if TYPE_CHECKING:
    Read_co = TypeVar("Read_co", covariant=True)

    class Given(Generic[Read_co]):
        """A field given as a quantity and read as a value in SI: what type checkers see."""

        def __get__(self, one: object, cls: object = None) -> Read_co: ...
        def __set__(self, one: object, value: float | str | npt.ArrayLike | None) -> None: ...

    Number = Given[float]
    MaybeNumber = Given[float | None]
    NumberOrWord = Given[float | str]
    Series = Given[tuple[float, ...]]
    MaybeSeries = Given[tuple[float, ...] | None]
else:
    Number, MaybeNumber, NumberOrWord = float, float | None, float | str
    Series, MaybeSeries = tuple[float, ...], tuple[float, ...] | None


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


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(parameter,))
class ParameterSet:
    """A value made of parameters: frozen, equal by content, hashable, copied and pickled as such.

    All mistakes of one input raise a single `InputError`. `WHAT` names it in sentences, as "a drive", and
    `SEVERAL` says what to do with several values for one. With `BATCH` its numbers may be arrays, which are
    read-only. The fields of a subclass with `kw_only=False` are positional arguments as well.
    """

    WHAT: ClassVar[str] = "a table"
    SEVERAL: ClassVar[str] = ""
    BATCH: ClassVar[bool] = False
    PARAMETERS: ClassVar[Mapping[str, Parameter]] = {}
    TABLES: ClassVar[tuple[DocumentTable, ...]] = ()

    def __init_subclass__(cls, kw_only: bool = True) -> None:
        declared = {name: one for name, one in vars(cls).items() if isinstance(one, Parameter)}
        for name, one in declared.items():
            setattr(cls, name, field() if one.required else field(default=one.default))
        dataclass(init=False, eq=False, repr=False)(cls)
        cls.PARAMETERS = dict(cls.PARAMETERS) | {
            name: replace(one, name=name, positional=one.positional or not kw_only)
            for name, one in declared.items()
        }
        everyone = cls.PARAMETERS.values()
        tables = sorted({p.table: None for p in everyone}, key=bool)  # "" first
        cls.TABLES = tuple(DocumentTable(one, tuple(p for p in everyone if p.table == one)) for one in tables)
        cls.__replace__ = cls.replace  # type: ignore[attr-defined]  # copy.replace of Python 3.13
        arguments = sorted(map(_argument, everyone), key=lambda one: one.kind)
        cls.__signature__ = inspect.Signature(arguments)  # type: ignore[attr-defined]
        if cls.__doc__:
            cls.__doc__ = cls.__doc__.replace("{parameters}", "\n    ".join(_documented(everyone)))

    if not TYPE_CHECKING:  # type checkers see the fields as keywords

        def __init__(self, *positional: Any, **given: Any) -> None:
            names = [p.name for p in self.PARAMETERS.values() if p.positional]
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
        wrong = [*mistakes, *found]
        for name in [one for one in given if one not in parameters]:
            free = [p for p in parameters.values() if p.name not in given]
            meant = meant_by(name, parameters.values(), free)
            names = " or ".join(p.name for p in meant)
            other = term(name) or f"the names are {', '.join(parameters)}"
            remedy = f"did you mean {names}?" if meant else other
            reason = f"{self.WHAT} has no parameter {show(name)}; {remedy}"
            alone = tuple(p.path for p in meant) if len(meant) == 1 else ()
            wrong.append(
                Mistake(wording.sentence(f"{name} = {wording.show(given[name])}", reason), (), alone)
            )
        fields = vars(self)
        fields.update(values)
        fields["_given"] = frozenset(
            name
            for name in given.keys() & parameters.keys()
            if not (given[name] is None and parameters[name].default is None)
        )
        right = {name: values[name] for name in fields["_given"] if name in values} if wrong else values
        sentences = [*sentences_of(wrong), *self._check(right, wording)]
        if not sentences:
            before = f"{wording.where}: " if wording.where else ""
            sentences = [before + sentence for sentence in self.contradictions()]
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

    @classmethod
    def _from_document(
        cls, document: dict[str, Any], where: str, also: Mapping[str, object] | None = None
    ) -> Self:
        """From the tables of a TOML document, after the changes of `also` ({path: value})."""
        wording = Wording(where, style="toml")
        wrong = [Mistake(one) for one in apply_changes(document, also or {}, cls.TABLES, cls.WHAT)]
        content, mistakes = placed(document, cls.TABLES, cls.WHAT, wording)
        given = {
            p.name: content[p.table][p.key]
            for p in cls.PARAMETERS.values()
            if p.key in content.get(p.table, ())
        }
        return cls._made(given, wording, [*wrong, *mistakes])

    def _derive(self, **values: Any) -> None:
        """Set values that follow from others, as if they had been given; None takes one back."""
        fields = vars(self)
        fields.update(values)
        fields["_given"] = frozenset(
            one for one in fields["_given"] | values.keys() if fields[one] is not None
        )

    def given(self) -> dict[str, Any]:
        """The parameters that were given, in the order of the fields; the others have their defaults."""
        fields, given = vars(self), vars(self)["_given"]
        return {name: fields[name] for name in self.PARAMETERS if name in given}

    def values(self) -> dict[str, Any]:
        """All parameters by name."""
        fields = vars(self)
        return {name: fields[name] for name in self.PARAMETERS}

    def replace(self, **changes: Any) -> Self:
        """The same with some parameters changed; those that follow another one follow it still."""
        return self._changed(changes, Wording(), [])

    def _changed(self, changes: Mapping[str, object], wording: Wording, mistakes: Iterable[Mistake]) -> Self:
        given = self.given()
        known = {name: value for name, value in given.items() if name not in changes}
        return self._made(given | dict(changes), wording, mistakes, known)

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


def _argument(p: Parameter) -> inspect.Parameter:
    """The parameter as an argument of the constructor, for editors and the documentation."""
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD if p.positional else inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(p.name, kind, default=inspect.Parameter.empty if p.required else p.default)


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
