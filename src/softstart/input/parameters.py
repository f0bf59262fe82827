"""What a parameter is, how its value is read in SI, and the sentence for a value that is wrong."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from softstart.errors import InputError
from softstart.hints import nearest, term
from softstart.input.gear import BEHIND, NO_GEAR, OWN_SIDE, Gear, alike
from softstart.quantities import RefusedError, Value, parse, show, values_in, without_powers

# beyond these no quantity of a machine lies, in SI, and the powers that physics takes of them overflow
LEAST, MOST = 1e-30, 1e30
LONGEST_LINE = 120  # characters of a name: more leave no room for the figure below it

Limit = Literal[
    "any", "above 0", "0 or more", "0 or less", "from 0 to 1", "above 0 and at most 1",
    "a whole number, 0 or more", "a whole number, 1 or more", "one line", "from 0 to 0.5",
]  # fmt: skip

# each holds for a number and, element by element, for an array
LIMITS: dict[str, Callable[[Any], Any]] = {
    "above 0": lambda x: x > 0.0,
    "0 or more": lambda x: x >= 0.0,
    "0 or less": lambda x: x <= 0.0,
    "from 0 to 0.5": lambda x: (x >= 0.0) & (x <= 0.5),
    "from 0 to 1": lambda x: (x >= 0.0) & (x <= 1.0),
    "above 0 and at most 1": lambda x: (x > 0.0) & (x <= 1.0),
    "a whole number, 0 or more": lambda x: (x >= 0.0) & (x % 1.0 == 0.0),
    "a whole number, 1 or more": lambda x: (x >= 1.0) & (x % 1.0 == 0.0),
}


_BARE = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
# what steers a terminal, or turns the order of letters round
_STEERING = re.compile(r"[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


class _Required:
    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED: Any = _Required()


@dataclass(frozen=True)
class Parameter:
    """One parameter: its key in a file, its keyword in Python, and what it means.

    `unit` is the SI unit; a parameter without one is text, or one of `choices`. `default` is REQUIRED, a
    value in SI, or None for "not given"; one that `follows` another parameter takes its value. One with a
    unit and `choices` is a quantity or one of these words. A `many` parameter is a list of numbers, an
    `infinite` one may be infinity. `example` is what to type. `table` is that of the file, "" above the first
    one; `name` is the keyword in Python, `label` what stands before its field, both by default the key.
    `at_output` says whether the value may be written "at output" of the gear ("value"), or is "here" anyway;
    one with a "side" has the gear beside it.
    """

    key: str
    unit: str
    meaning: str
    example: str
    limit: Limit = "any"
    default: Any = REQUIRED
    choices: tuple[str, ...] = ()
    many: bool = False
    infinite: bool = False
    symbol: str = ""
    label: str = ""
    follows: str = ""
    table: str = ""
    name: str = ""
    positional: bool = False
    at_output: Literal["", "value", "here", "side"] = ""

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.key)
        if not self.label:
            object.__setattr__(self, "label", self.key.replace("_", " "))

    @property
    def required(self) -> bool:
        """Whether it has neither a default nor a parameter to follow."""
        return self.default is REQUIRED

    @property
    def path(self) -> str:
        """What the parameter is called with `--set`: `load.inertia`."""
        return f"{self.table}.{self.key}" if self.table else self.key

    @property
    def place(self) -> str:
        """What the parameter is called in a sentence about a file: `[load] inertia`."""
        return f"[{self.table}] {self.key}" if self.table else self.key


@dataclass(frozen=True)
class ParameterValue:
    """A parameter of a machine that can be varied: its word in Python, what it is, and its value."""

    name: str
    parameter: Parameter
    value: Any


@dataclass(frozen=True)
class Wording:
    """How the writer of the input names parameters and writes values.

    `where` is the file, put before each sentence; `style` is "python" (`load_inertia`), "toml"
    (`[load] inertia`) or "path" (`load.inertia`). `written` holds names that were written otherwise, `row`
    stands for the table where there are several, as "[mass] 2, ".
    """

    where: str = ""
    style: str = "python"
    written: Mapping[str, str] = field(default_factory=dict)
    row: str = ""

    @property
    def before(self) -> str:
        """What stands before a sentence: the file."""
        return f"{self.where}: " if self.where else ""

    def label(self, parameter: Parameter) -> str:
        """The parameter as the writer calls it.

        >>> gap = Parameter("gap", "rad", "gap", '"0.5 rad"', table="shaft")
        >>> Wording(style="toml").label(gap), Wording().label(gap)
        ('[shaft] gap', 'gap')
        """
        if self.row:
            return f"{self.row}{parameter.key}"
        names = {"toml": parameter.place, "path": parameter.path}
        return self.written.get(parameter.name) or names.get(self.style, parameter.name)

    def show(self, value: object) -> str:
        """The value as the writer wrote it."""
        return show(value, toml=self.style == "toml")

    def sentence(self, subject: str, reason: str) -> str:
        """Subject and reason with the file before and a full stop behind; "" stands for the whole input."""
        before = [one for one in (self.where, subject) if one] or ["the text"]
        return f"{': '.join(before)}: {reason}{'' if reason.endswith(('?', '.')) else '.'}"

    def missing(self, parameter: Parameter, instead: str = "") -> Mistake:
        """That a required parameter is missing, and what to write; `instead` names what may replace it."""
        p = parameter
        symbol = f" {p.symbol}" if p.symbol and p.symbol != p.key else ""
        text = f"{p.name}={p.example}" if self.style == "python" else f"{p.key} = {p.example}"
        reason = f"the {p.meaning}{symbol} is needed{instead}; write for example {text}"
        return Mistake(self.sentence(f"{self.label(p)} is missing", reason), (f"{self.row}{p.path}",))

    def refused(self, parameter: Parameter, value: object, refusal: RefusedError) -> str:
        """The sentence for a value that was refused; of an array, only the bad element is shown."""
        index = ""
        if refusal.index is not None:
            value, index = refusal.value, f"[{', '.join(map(str, refusal.index))}]"
        return self.sentence(f"{self.label(parameter)}{index} = {self.show(value)}", refusal.reason)


@dataclass(frozen=True)
class Mistake:
    """One sentence; `missing`: paths of parameters of which one is needed, `meant`: those one may mean."""

    sentence: str
    missing: tuple[str, ...] = ()
    meant: tuple[str, ...] = ()


def sentences_of(mistakes: Iterable[Mistake]) -> list[str]:
    """The sentences, each once; a parameter that was only misspelt is not also called missing.

    >>> sentences_of([Mistake("gapp: did you mean gap?", meant=("gap",)), Mistake("no gap", ("gap",))])
    ['gapp: did you mean gap?']
    """
    mistakes = list(mistakes)
    misspelt = {path for mistake in mistakes for path in mistake.meant}
    return list(dict.fromkeys(m.sentence for m in mistakes if not misspelt.intersection(m.missing)))


def meant_by(name: str, parameters: Iterable[Parameter], near: Sequence[Parameter] = ()) -> list[Parameter]:
    """The parameters that an unknown name may mean: by key, symbol, name or path, or else by likeness.

    Those that are `near` go before the others.

    >>> from softstart.drive import PARAMETERS
    >>> [[p.name for p in meant_by(one, PARAMETERS.values())] for one in ("inertia", "J2", "gapp")]
    [['motor_inertia', 'load_inertia'], ['load_inertia'], ['gap']]
    """
    groups = (near, list(parameters))
    for group in groups:
        if same := [p for p in group if name in (p.key, p.symbol, p.name, p.path)]:
            return same
    for group in groups if term(name) is None else ():
        spelt = {spelling: p for p in group for spelling in (p.key, p.path, p.name)}
        if close := nearest(name, spelt):
            return [spelt[close]]
    return []


def read_values(
    given: Mapping[str, object],
    parameters: Mapping[str, Parameter],
    wording: Wording,
    *,
    batch: bool = False,
    known: Mapping[str, Any] = {},
    several: str = "",
    gear: Gear | str = NO_GEAR,
) -> tuple[dict[str, Any], list[Mistake]]:
    """The values of `parameters` (by the names used in `given`), and what is wrong or missing.

    `known` holds values that were read before. None stands for "not given" where that is the default.
    `several` is the reason why a list is refused, `gear` what "... at output" goes through.
    """
    values: dict[str, Any] = {}
    mistakes: list[Mistake] = []
    for name, parameter in parameters.items():
        if name in known:
            values[name] = known[name]
        elif name in given and not (given[name] is None and parameter.default is None):
            try:
                values[name] = read_value(parameter, given[name], batch=batch, several=several, gear=gear)
            except RefusedError as refusal:
                mistakes.append(Mistake(wording.refused(parameter, given[name], refusal)))
        elif parameter.default is REQUIRED:
            mistakes.append(wording.missing(parameter))
        elif parameter.follows:
            values[name] = values.get(parameter.follows)
            other = parameters[parameter.follows]
            if values[name] is None and not other.required and given.get(other.name) is None:
                missing = wording.missing(parameter, f", or {wording.label(other)} in its place")
                mistakes.append(replace(missing, missing=(parameter.path, other.path)))
        else:
            values[name] = parameter.default
    return values, mistakes


def bare(value: object) -> str:
    """A number without a unit as it is written; "" for anything else."""
    text = without_powers(str(value).strip())
    return text if not isinstance(value, bool) and _BARE.fullmatch(text) else ""


def without_unit(
    given: Mapping[str, object],
    parameters: Mapping[str, Parameter],
    usual: Mapping[str, str],
    wording: Wording,
) -> list[Mistake]:
    """A mistake for each number without a unit, but 0, that may be in SI or in its `usual` unit, by name."""
    mistakes = []
    for name in (one for one in usual if one in parameters and one in given):
        p, value = parameters[name], given[name]
        numbers = [bare(one) for one in (value if isinstance(value, list) else [value])]
        if number := next((one for one in numbers if float(one or 0.0) != 0.0), ""):
            also = f'or, if {p.unit} is meant, "{number} {p.unit}"'
            reason = f'no unit; write "{number} {usual[name]}" {also}'
            mistakes.append(Mistake(wording.refused(p, value, RefusedError(reason))))
    return mistakes


def read_value(
    parameter: Parameter,
    value: object,
    *,
    batch: bool = False,
    several: str = "",
    gear: Gear | str = NO_GEAR,
) -> Any:
    """One value in SI, as text, or one of the choices; raises `RefusedError` with reason and remedy.

    A `batch` lets arrays of any shape through; otherwise `several` is the reason why they are refused.
    `gear` is that through which a value "... at output" is brought to the motor shaft, or why there is none.

    >>> read_value(Parameter("gap", "rad", "total gap", '"0.5 rad"', "0 or more"), "500 mrad")
    0.5
    >>> read_value(Parameter("torque", "N*m", "torque", '"90 N*m"', many=True), "[200, 0.09 kN*m]")
    (200.0, 90.0)
    >>> read_value(Parameter("kind", "", "kind", '"active"', choices=("active", "reactive")), "activ")
    Traceback (most recent call last):
    softstart.quantities.RefusedError: the kind is "active" or "reactive"; did you mean "active"?
    """
    p = parameter
    if p.choices and (not p.unit or (isinstance(value, str) and not any(map(str.isdigit, value)))):
        return _read_choice(p, value)
    if not p.unit:
        return _read_text(p, value)
    if p.many and isinstance(value, str):  # of --set, or of a field of the page
        try:
            parts = values_in(value.strip("[] "), p.meaning)
            value = parts if len(parts) > 1 else parts[0]
        except InputError as error:
            raise RefusedError(error.sentences[0].rpartition(": ")[2].rstrip(".")) from None
    number = parse(at_motor(p, value, gear), p.unit, infinite=p.infinite)
    if p.many:
        number = np.atleast_1d(number)
        if number.ndim > 1:
            raise RefusedError(f"the {p.meaning} is one list of numbers, such as {p.example}")
    elif not batch and not isinstance(number, float):
        reason = several or "the {meaning} is one number, not a list"
        raise RefusedError(reason.format(meaning=p.meaning, name=p.name))
    if p.limit in LIMITS:
        _refuse(number, LIMITS[p.limit](number), f"the {p.meaning} must be {p.limit}")
    size = f"its size in {p.unit}" if p.unit != "1" else "it"
    least = LEAST if p.limit == "above 0" else 0.0
    sizes: Any = abs(number)
    within = (sizes >= least) & ((sizes <= MOST) | (sizes == math.inf))
    _refuse(number, within, f"{size} must be between {LEAST:g} and {MOST:g}; check number and unit")
    if isinstance(number, np.ndarray):
        if p.many:
            return tuple(number.tolist())
        number.setflags(write=False)
    return number


def at_motor(p: Parameter, value: object, gear: Gear | str = NO_GEAR) -> object:
    """The value with "... at output" brought to the motor shaft, a number in SI; any other as it is.

    `gear` may be the reason why there is none. Raises `RefusedError` where that counts, and for a parameter
    that is not behind the gear.
    """
    several = isinstance(value, list | tuple)
    each: list[Any] = list(value) if isinstance(value, list | tuple) else [value]
    matches = [BEHIND.fullmatch(one) if isinstance(one, str) else None for one in each]
    if not any(matches):
        return value
    alike(each)
    each = [one if match is None else match[1] for one, match in zip(each, matches, strict=True)]
    if p.at_output == "here":
        return each if several else each[0]
    if not p.at_output:
        raise RefusedError(f'the {p.meaning} does not take "at output"; leave it out')
    if p.at_output == "side" or isinstance(gear, str):
        raise RefusedError(OWN_SIDE if p.at_output == "side" else str(gear))
    if p.many and np.ndim(gear.of_torques):
        geared = np.ndim(gear.ratio * gear.efficiency)
        wrong = "several gears" if geared else "loads that drive the motor and others"
        raise RefusedError(f"one list cannot follow {wrong}; write it at the motor shaft")
    number = parse(each if several else each[0], p.unit, infinite=p.infinite)
    return gear.to_motor(number, p.unit)


def _refuse(number: Value, allowed: bool | NDArray[np.bool_], reason: str) -> None:
    """Raise for the first value of a number or array that is not allowed."""
    if not np.ndim(number):
        if not allowed:
            raise RefusedError(reason)
    elif not np.all(allowed):
        index = tuple(int(i) for i in np.argwhere(np.logical_not(allowed))[0])
        raise RefusedError(reason, float(np.asarray(number)[index]), index)


def _read_text(parameter: Parameter, value: object) -> str:
    what, title = f"the {parameter.meaning}", parameter.limit == "one line"
    if not isinstance(value, str) or not (title or value.strip() or parameter.default == ""):
        raise RefusedError(f"{what} must be text, such as {parameter.example}")
    if any(0xD800 <= ord(letter) < 0xE000 for letter in value):
        raise RefusedError("this text contains an incomplete character (a lone surrogate); write it again")
    if title and (not value.strip() or len(value.splitlines()) > 1):
        raise RefusedError(f"{what} must be one line of text that is not empty")
    if title and len(value) > LONGEST_LINE:
        raise RefusedError(f"{what} has {len(value)} characters, and at most {LONGEST_LINE} fit in a title")
    if title and (found := _STEERING.search(value)) is not None:
        raise RefusedError(f"{what} has the control character U+{ord(found.group()):04X}; leave it out")
    return value


def _read_choice(parameter: Parameter, value: object) -> str:
    if isinstance(value, str) and value in parameter.choices:
        return value
    quantity = [f"a quantity such as {parameter.example}"] if parameter.unit else []
    *first, last = [*map(show, parameter.choices), *quantity]
    reason = f"the {parameter.meaning} is {', '.join(first)} or {last}"
    meant = nearest(value, parameter.choices) if isinstance(value, str) else None
    raise RefusedError(f"{reason}; did you mean {show(meant)}?" if meant else reason)
