"""Frozen values whose fields are parameters: each is spelled once, in the class body.

    class Mass(ParameterSet):
        inertia: Number = parameter("mass.inertia", "kg*m^2", "inertia", '"0.035 kg*m^2"', "above 0")

From that line come the keyword with its type, the reading in SI, the sentences, the key in a file and the
documentation.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NoReturn, Self, TypeVar, dataclass_transform

import numpy as np
import numpy.typing as npt

from softstart.errors import InputError
from softstart.input.documents import Table, changed, placed, renamed
from softstart.input.parameters import (
    REQUIRED,
    Limit,
    Mistake,
    Parameter,
    Wording,
    read_values,
    sentences_of,
)
from softstart.quantities import nearest, show

__all__ = [
    "MaybeNumber", "MaybeSeries", "Number", "NumberOrWord", "ParameterSet", "Series", "like",
    "meant_by", "parameter",
]  # fmt: skip

if TYPE_CHECKING:
    Read_co = TypeVar("Read_co", covariant=True)

    class Given(Generic[Read_co]):
        """A field to type checkers: given as numbers or texts with units, and read in SI."""

        def __get__(self, one: object, owner: Any) -> Read_co: ...
        def __set__(self, one: object, given: Sequence[float | str] | npt.ArrayLike | None) -> None: ...

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
    choices: tuple[str, ...] = (),
    many: bool = False,
    infinite: bool = False,
    symbol: str = "",
    follows: str = "",
    formerly: str = "",
    kw_only: bool | None = None,
) -> Any:
    """A field of a `ParameterSet`; `path` is `table.key` of the file, the rest as in `Parameter`."""
    table, _, key = path.rpartition(".")
    described = Parameter(
        key, unit, meaning, example, limit, default, choices, many, infinite, symbol, follows, table,
        formerly=formerly,
    )  # fmt: skip
    metadata = {"parameter": described, "kw_only": kw_only}
    if default is REQUIRED:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def like(cls: type[ParameterSet], name: str) -> Any:
    """A field that is the parameter of another class, which need not be given."""
    described = cls.PARAMETERS[name]
    return dataclasses.field(default=described.default, metadata={"parameter": described, "kw_only": True})


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(parameter,))
class ParameterSet:
    """A value made of parameters: frozen, equal by content, hashable, copied and pickled as such.

    All mistakes of one input raise a single `InputError`. `WHAT` names it in sentences, as "a drive", and
    `SEVERAL` says, by the style of the wording, what to do with several values for one. With `BATCH` its
    numbers may be arrays, which are read-only.
    """

    WHAT: ClassVar[str] = "a table"
    SEVERAL: ClassVar[Mapping[str, str]] = {}
    BATCH: ClassVar[bool] = False
    PARAMETERS: ClassVar[Mapping[str, Parameter]] = {}
    TABLES: ClassVar[tuple[Table, ...]] = ()
    _POSITIONAL: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, kw_only: bool = True) -> None:
        dataclasses.dataclass(init=False, eq=False, repr=False)(cls)
        fields = [one for one in dataclasses.fields(cls) if "parameter" in one.metadata]  # type: ignore[arg-type]
        cls.PARAMETERS = {f.name: dataclasses.replace(f.metadata["parameter"], name=f.name) for f in fields}
        tables = sorted({p.table: None for p in cls.PARAMETERS.values()}, key=bool)  # "" first
        cls.TABLES = tuple(
            Table(table, tuple(p for p in cls.PARAMETERS.values() if p.table == table)) for table in tables
        )
        keyword = {one.name: one.metadata["kw_only"] for one in fields}
        cls._POSITIONAL = tuple(
            name for name, own in keyword.items() if not (kw_only if own is None else own)
        )
        cls.__replace__ = cls.replace  # type: ignore[attr-defined]  # copy.replace of Python 3.13
        ordered = sorted(fields, key=lambda one: one.name not in cls._POSITIONAL)
        cls.__signature__ = inspect.Signature([_argument(one, cls) for one in ordered])  # type: ignore[attr-defined]
        if cls.__doc__:
            described = "\n    ".join(_documented(cls.PARAMETERS))
            cls.__doc__ = cls.__doc__.replace("{parameters}", described)

    if not TYPE_CHECKING:  # type checkers see the fields as keywords

        def __init__(self, *positional: Any, **given: Any) -> None:
            if len(positional) > len(self._POSITIONAL):
                raise TypeError(
                    f"{type(self).__name__} takes {len(self._POSITIONAL)} positional arguments, "
                    f"and {len(positional)} were given"
                )
            named = dict(zip(self._POSITIONAL, positional, strict=False))
            self._fill(named | given if named else given, Wording(), [])

    def _fill(
        self,
        given: Mapping[str, object],
        wording: Wording,
        mistakes: Iterable[Mistake],
        known: Mapping[str, Any] | None = None,
    ) -> None:
        """Read all parameters, or raise one `InputError` for everything that is wrong with them.

        `known` holds values among those given that were read before.
        """
        parameters = self.PARAMETERS
        values, found = read_values(
            given, parameters, wording, batch=self.BATCH, known=known, several=self.SEVERAL
        )
        wrong = [*mistakes, *found]
        if not given.keys() <= parameters.keys():
            wrong += [
                _unknown(name, given, self.WHAT, parameters, wording)
                for name in given
                if name not in parameters
            ]
        own = vars(self)
        own.update(values)
        own["_given"] = frozenset(
            name
            for name in given
            if name in parameters and not (given[name] is None and parameters[name].default is None)
        )
        right = {name: values[name] for name in own["_given"] if name in values} if wrong else values
        sentences = [*sentences_of(wrong), *self._check(right, wording)]
        if not sentences:
            before = f"{wording.where}: " if wording.where else ""
            sentences = [before + sentence for sentence in self.contradictions()]
        if sentences:
            raise InputError(sentences)

    def _check(self, values: Mapping[str, Any], wording: Wording) -> Iterable[str]:
        """Sentences on values that contradict one another, of those that are right in themselves."""
        return ()

    def contradictions(self) -> Iterable[str]:
        """The same once all are right in themselves and set; without the name of the file."""
        return ()

    @classmethod
    def _made(
        cls,
        given: Mapping[str, object],
        wording: Wording,
        mistakes: Iterable[Mistake],
        known: Mapping[str, Any] | None = None,
    ) -> Self:
        one = cls.__new__(cls)
        one._fill(given, wording, mistakes, known)
        return one

    @classmethod
    def _from_document(
        cls, document: dict[str, Any], where: str, also: Mapping[str, object] | None = None
    ) -> Self:
        """From the tables of a TOML document, after the changes of `also` ({path: value})."""
        wording = Wording(where, style="toml")
        document = dict(renamed(document, cls.TABLES))
        wrong = [Mistake(one) for one in changed(document, also or {}, cls.TABLES, cls.WHAT)]
        content, mistakes = placed(document, cls.TABLES, cls.WHAT, wording)
        given = {
            p.name: content[p.table][p.key]
            for p in cls.PARAMETERS.values()
            if p.key in content.get(p.table, ())
        }
        return cls._made(given, wording, [*wrong, *mistakes])

    def _derive(self, **values: Any) -> None:
        """Set values that follow from others, as if they had been given; None takes one back."""
        own = vars(self)
        own.update(values)
        given = own["_given"] | values.keys()
        own["_given"] = frozenset(name for name in given if values.get(name, name) is not None)

    def given(self) -> dict[str, Any]:
        """The parameters that were given, in the order of the fields; the others have their defaults."""
        own, given = vars(self), vars(self)["_given"]
        return {name: own[name] for name in self.PARAMETERS if name in given}

    def values(self) -> dict[str, Any]:
        """All parameters by name."""
        own = vars(self)
        return {name: own[name] for name in self.PARAMETERS}

    def replace(self, **changes: Any) -> Self:
        """The same with some parameters changed; those that follow another one follow it still."""
        return self._changed(changes, Wording(), [])

    def _changed(self, changes: Mapping[str, object], wording: Wording, mistakes: Iterable[Mistake]) -> Self:
        given = self.given()
        known = {name: value for name, value in given.items() if name not in changes}
        return self._made(given | dict(changes), wording, mistakes, known)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self._content() == other._content()

    def __hash__(self) -> int:
        return hash(self._content())

    def _content(self) -> tuple[object, ...]:
        own = vars(self)
        values = (own[name] for name in self.PARAMETERS)
        return tuple((v.shape, v.tobytes()) if isinstance(v, np.ndarray) else v for v in values)

    def __repr__(self) -> str:
        listed = ", ".join(f"{name}={value!r}" for name, value in self.given().items())
        return f"{type(self).__name__}({listed})"

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Self:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (type(self), self.given())

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"{self._noun()} cannot be changed; make another with replace({name}=...)")

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"{self._noun()} cannot be changed")

    def _noun(self) -> str:
        name = type(self).__name__
        return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"


def _rebuilt(cls: type[ParameterSet], given: dict[str, Any]) -> ParameterSet:
    return cls(**given)


def _argument(one: dataclasses.Field[Any], cls: type[ParameterSet]) -> inspect.Parameter:
    """The field as an argument of the constructor, for editors and the documentation."""
    positional = one.name in cls._POSITIONAL
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD if positional else inspect.Parameter.KEYWORD_ONLY
    default = inspect.Parameter.empty if one.default is dataclasses.MISSING else one.default
    return inspect.Parameter(one.name, kind, default=default, annotation=one.type)


def _documented(parameters: Mapping[str, Parameter]) -> Iterable[str]:
    """The parameters as a numpydoc section has them."""
    for p in parameters.values():
        number = {"": "text", "1": "number"}.get(p.unit, f"number in {p.unit}")
        default = p.follows or repr(p.default)
        optional = "" if p.required else f", default {default}"
        kinds = [*map(show, p.choices), number] if p.unit or not p.choices else map(show, p.choices)
        yield f"{p.name} : {' or '.join(kinds)}{optional}"
        meaning = p.meaning[:1].upper() + p.meaning[1:]
        symbol = f" `{p.symbol}`" if p.symbol and p.symbol != p.name else ""
        limit = f"; {p.limit}" if p.limit not in ("any", "one line") else ""
        yield f"    {meaning}{symbol}{limit}."


def meant_by(name: str, parameters: Mapping[str, Parameter], given: Iterable[str] = ()) -> tuple[str, ...]:
    """The parameters that an unknown name may mean: by key, by symbol, or by likeness.

    >>> from softstart.drive import PARAMETERS
    >>> meant_by("inertia", PARAMETERS), meant_by("J2", PARAMETERS), meant_by("gapp", PARAMETERS)
    (('motor_inertia', 'load_inertia'), ('load_inertia',), ('gap',))
    """
    present = set(given)
    everyone = list(parameters.values())
    free = [p for p in everyone if p.name not in present] or everyone
    for among in (free, everyone):
        same = tuple(p.name for p in among if name in (p.key, p.symbol, p.path))
        if same:
            return same
    close = nearest(name, [p.name for p in free]) or nearest(name, [p.name for p in everyone])
    return (close,) if close else ()


def _unknown(
    name: str, given: Mapping[str, object], what: str, parameters: Mapping[str, Parameter], wording: Wording
) -> Mistake:
    meant = meant_by(name, parameters, given)
    remedy = f"did you mean {' or '.join(meant)}?" if meant else f"the names are {', '.join(parameters)}"
    sentence = wording.sentence(
        f"{name} = {wording.show(given[name])}", f"{what} has no parameter {show(name)}; {remedy}"
    )
    return Mistake(sentence, meant=parameters[meant[0]].path if len(meant) == 1 else None)


def read_settings(
    settings: Iterable[str], parameters: Mapping[str, Parameter]
) -> tuple[dict[str, object], Wording, list[Mistake]]:
    """Changes as typed at a command line: values by name, the wording with the keys as typed, and mistakes.

    >>> from softstart.drive import PARAMETERS
    >>> given, wording, mistakes = read_settings(["load.inertia=0.07", "gap = 2 rad", "gapp=1"], PARAMETERS)
    >>> given, wording.label(PARAMETERS["load_inertia"])
    ({'load_inertia': '0.07', 'gap': '2 rad'}, 'load.inertia')
    >>> mistakes[0].sentence
    'gapp=1: there is no parameter "gapp"; did you mean gap?'
    """
    by_path = {path: p for p in parameters.values() for path in (p.formerly, p.path) if path}
    plain = Wording(style="path")
    given: dict[str, object] = {}
    written: dict[str, str] = {}
    first: dict[str, str] = {}
    mistakes = []
    for setting in [settings] if isinstance(settings, str) else settings:
        if not isinstance(setting, str):
            reason = 'a setting is text like "load.inertia=0.07"'
            mistakes.append(Mistake(plain.sentence(show(setting), reason)))
            continue
        key, equals, value = (part.strip() for part in setting.partition("="))
        found = by_path.get(key) or parameters.get(key)
        if not equals or not key:
            reason = "a setting is a key, an equals sign and a value, such as load.inertia=0.07"
            mistakes.append(Mistake(plain.sentence(show(setting), reason)))
        elif found is None:
            reason = f"there is no parameter {show(key)}; {_setting_meant(key, by_path, parameters)}"
            mistakes.append(Mistake(plain.sentence(setting, reason)))
        elif found.name in first:
            reason = f"it was set before ({first[found.name]}); keep one of the two"
            mistakes.append(Mistake(plain.sentence(setting, reason)))
        else:
            quoted = len(value) >= 2 and value[0] == value[-1] and value[0] in "\"'"
            given[found.name] = value[1:-1] if quoted else value
            written[found.name] = key
            first[found.name] = setting
    return given, Wording(style="path", written=written), mistakes


def _setting_meant(key: str, by_path: Mapping[str, Parameter], parameters: Mapping[str, Parameter]) -> str:
    within = [path for path in by_path if path.startswith(f"{key}.")]
    if within:
        return f"{key} is a table, name one of its keys, such as {within[0]}"
    same = [p.path for p in parameters.values() if key in (p.key, p.symbol)]
    if same:
        return f"did you mean {' or '.join(same)}?"
    meant = nearest(key, [*by_path, *parameters])
    return f"did you mean {meant}?" if meant else f"there are {', '.join(by_path)}"
