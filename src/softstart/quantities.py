"""Quantities: which units there are, and how a number or a text with a unit is read in SI.

pint reads the units, from the short list below in which the radian is a dimension of its own and the joule
another. With pint's own list `50 Hz` would be 50 rad/s, `5 N*m` a stiffness and `5 J` a torque. Here a
frequency is no speed and a torque no stiffness: each is refused with the text to write instead. pint is
imported only when a string has a unit that is not an ordinary one.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import date, time
from decimal import Decimal
from functools import lru_cache
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from softstart.errors import InputError
from softstart.hints import nearest

if TYPE_CHECKING:
    import pint

Value = float | NDArray[np.float64]

# ---- units ----------------------------------------------------------------------------------------------


class Quantity(NamedTuple):
    """What a number may be: its SI unit, its noun, an example, and the unit forms that mean it too."""

    unit: str
    noun: str
    example: str
    others: tuple[str, ...] = ()


QUANTITIES: dict[str, Quantity] = {
    q.unit: q
    for q in (
        Quantity("kg*m^2", "an inertia", "0.035 kg*m^2", ("N*m*s^2/rad",)),
        Quantity("N*m", "a torque", "62 N*m", ("J/rad",)),
        Quantity("N*m/s", "a rate of torque", "500 N*m/s"),
        Quantity("N*m/rad", "a stiffness", "368 N*m/rad"),
        Quantity("N*m*s/rad", "a damping", "1.5 N*m*s/rad"),
        Quantity("rad", "an angle", "0.5 rad"),
        Quantity("rad/s", "a speed", "880 rpm"),
        Quantity("s", "a time", "20 ms"),
        Quantity("W", "a power", "2.2 kW", ("N*m/s", "N*m*rad/s")),
        Quantity("Hz", "a frequency", "50 Hz"),
        Quantity("m", "a length", "82 mm"),
        Quantity("kg", "a mass", "0.68 kg"),
        Quantity("kg*m", "an imbalance", "0.045 kg*m"),
        Quantity("N/m", "a stiffness along a line", "1.6 MN/m"),
        Quantity("Pa", "a pressure", "10 bar", ("J/m^3",)),
        Quantity("m^2", "an area", "0.05 m^2"),
        Quantity("A", "a current", "12 A"),
        Quantity("N*m/A", "a torque constant", "1.2 N*m/A", ("J/rad/A",)),
        Quantity("1", "a plain number", "3"),
    )
}

# What a unit in the wrong place is called, besides the quantities above.
OTHER_NOUNS = {
    "N": "a force",
    "J": "an energy",
    "m/s": "a speed along a line",
    "m/s^2": "an acceleration along a line",
    "rad/s^2": "an angular acceleration",
    "N*s/m": "a damping along a line",
    "N*m^2": "a flywheel moment",
    "N*m*s": "an angular momentum",
    "W/s": "a rate of power",
}

_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
meter = [length] = m = metre
gram = [mass] = g
second = [time] = s = sec
radian = [angle] = rad
joule = [energy] = J
ampere = [current] = A
inch = 0.0254 * meter = in
foot = 0.3048 * meter = ft
minute = 60 * second = min
hour = 3600 * second = h
day = 86400 * second
year = 31557600 * second
tonne = 1e6 * gram = t
pound = 453.59237 * gram = lb
ounce = pound / 16 = oz
degree = 0.017453292519943295 * radian = deg = °
turn = 6.283185307179586 * radian = rev = revolution = r = U
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
revolutions_per_minute = turn / minute = rpm
hertz = 1 / second = Hz
newton = kilogram * meter / second ** 2 = N
kilogram_force = 9.80665 * newton = kgf = force_kilogram = kp
pound_force = 4.4482216152605 * newton = lbf = force_pound
ounce_force = 0.27801385095378125 * newton = ozf = force_ounce
pascal = newton / meter ** 2 = Pa
bar = 1e5 * pascal
watt = joule / second = W
horsepower = 745.6998715822702 * watt = hp
metric_horsepower = 735.49875 * watt = PS
"""

# Spellings that are offered for an unknown one.
_USUAL = """
m mm cm in ft kg g lb oz t s ms min h days years rad mrad deg arcmin arcsec turn rev rpm Hz kHz N kN kgf lbf
J kJ W kW MW hp PS Pa kPa MPa bar mbar A mA kA
"""

# Factors of what most drive files write; pint, which says the same, takes a fifth of a second to import.
ORDINARY = {
    ("rpm", "rad/s"): 0.10471975511965977,
    ("deg", "rad"): 0.017453292519943295,
    ("arcmin", "rad"): 0.0002908882086657216,
    ("N*m/deg", "N*m/rad"): 57.29577951308232,
    ("N*m/arcmin", "N*m/rad"): 3437.746770784939,
    ("kN*m", "N*m"): 1000.0,
    ("lbf*ft", "N*m"): 1.3558179483314003,
    ("hp", "W"): 745.6998715822702,
    ("ms", "s"): 0.001,
    ("mm", "m"): 0.001,
    ("kW", "W"): 1000.0,
    ("kg*cm^2", "kg*m^2"): 0.0001,
}

GRAVITY = 9.80665  # m/s^2
MOST_DIGITS = 9  # of a number that a person may have written
# Units that people write, in which a value has few digits where it has 17 in SI.
TYPED = {
    unit: tuple(name for name, of in ORDINARY if of == unit and name != "kN*m")  # which saves no digit
    for unit in ("rad", "rad/s", "N*m/rad", "N*m", "W")
}

_SYMBOLS = str.maketrans(
    {"·": "*", "⋅": "*", "×": "*", "²": "^2", "³": "^3", "⁴": "^4", "¹": "^1", "⁻": "^-", "⁺": "^+",
     "'": "arcmin", "′": "arcmin"}
)  # fmt: skip
# Units of data sheets without dots: kgm^2, Nm, Nms, Ncm, kgfm, Ws; to pint "Nms" is the plural of Nm.
_WITHOUT_DOTS = re.compile(
    r"\b(?:(k?g(?=[cm]?m\^2)|[kMm]?N|kgf|kp)([cm]?m)(s?)|([kMm]?[NWJ])(s))(?![^\W\d_])"
)
_AS_FORCE = re.compile(r"(?<![^\W\d])(lb|oz)s?(?![^\W\d])")
# What pint may see: names, "1/" and one-digit powers. Its own grammar evaluates whatever stands there.
_NAME = re.compile(r"(?:[^\W\d]|°)+")
_WRITTEN = re.compile(
    rf"(?:(?:{_NAME.pattern}|\))(?:\s*(?:\*\*|\^)\s*[+-]?[1-9](?![\w.]))?|1(?=\s*/)|[\s*/(])+"
)
LONGEST = 80  # characters of a unit: products of a thousand factors are no unit, and take time


class Unit(NamedTuple):
    """A unit in the base units of the list: its size, and the exponent of each dimension."""

    size: float
    dimensions: tuple[tuple[str, float], ...]


@lru_cache(maxsize=512)
def read_unit(written: str) -> Unit | str:
    """The unit as written by people ("kgm²", "N·m/rad", "N-m", "s⁻¹"), or the reason why it is none.

    >>> read_unit("rpm")
    Unit(size=0.10471975511965977, dimensions=(('[angle]', 1.0), ('[time]', -1.0)))
    >>> read_unit("RPM")
    'unknown unit "RPM" (did you mean "rpm"?)'
    """
    if written == "1":
        return Unit(1.0, ())
    if len(written) > LONGEST:
        return f'"{written[:30]}..." is too long for a unit'
    text = written.translate(_SYMBOLS).replace("^-^", "^-").replace("^+^", "^")
    text = re.sub(r"(?<=[^\W\d])[.-](?=[^\W\d])", "*", text)  # "N.m", "lbf-ft"
    text = re.sub(r"(?<=[^\W\d_])([+-]?[1-9])(?![\w.])", r"^\1", text)  # "kg m2", "s-1" as in data sheets
    text = _WITHOUT_DOTS.sub(lambda found: "*".join(filter(None, found.groups())), text)
    if not _WRITTEN.fullmatch(text):
        return f'"{written}" is no unit'
    registry = _registry()
    for name in _NAME.findall(text):
        if not registry.parse_unit_name(name):
            meant = nearest(name, _USUAL.split())
            return f'unknown unit "{name}"' + (f' (did you mean "{meant}"?)' if meant else "")
    try:
        root = registry.Quantity(1.0, registry.parse_units(text)).to_root_units()
    except Exception:  # of many kinds, as its parser works by evaluation
        return f'"{written}" is no unit'
    exponents = tuple(sorted((str(k), float(cast("float", v))) for k, v in root.dimensionality.items() if v))
    return Unit(float(root.magnitude), exponents)


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(None)
    registry.load_definitions([line for line in _DEFINITIONS.splitlines() if line])
    return registry


# ---- reading a quantity ---------------------------------------------------------------------------------

# 350x10^-4, 3.5·10⁻² and, of a text that lost its superscripts, 350x10-4
_POWER_OF_TEN = re.compile(
    r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))\s*[x×·⋅*]\s*10"
    r"(?:\s*(?:\^|\*\*)\s*([+-]?[0-9]{1,2})|([+-][0-9]{1,2})|([⁻⁺]?[⁰¹²³⁴-⁹]{1,2}))(?![0-9.])"
)
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
_NUMBER = re.compile(
    r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|inf(?:inity)?(?![a-z])|nan(?![a-z]))",
    re.IGNORECASE,
)


def without_powers(text: str) -> str:
    """The text with a power of ten at its beginning as catalogues write it, in figures of a program.

    >>> without_powers("350x10^-4 kg*m^2"), without_powers("3.5·10⁻² kg m²"), without_powers("5 N*m")
    ('350e-4 kg*m^2', '3.5e-2 kg m²', '5 N*m')
    """
    match = _POWER_OF_TEN.match(text.replace("\N{MINUS SIGN}", "-"))
    if match is None:
        return text
    exponent = next(filter(None, match.groups()[1:])).translate(_SUPERSCRIPTS)
    return f"{match[1]}e{exponent}{text[match.end() :]}"


class RefusedError(ValueError):
    """Why a value is refused: reason and remedy, without the name of the key, which the caller knows.

    `index` is the place of the bad element in an array (None for a single value), `value` that element.
    """

    def __init__(self, reason: str, value: object = None, index: tuple[int, ...] | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.value = value
        self.index = index


def to_si(value: object, unit: str, name: str = "value", *, infinite: bool = False) -> Value:
    """The quantity in the SI unit `unit`: a float, or a float64 array for a list or an array.

    `value`: a number (already in `unit`), a string of a number and a unit, a pint quantity, or a list or
    array of these. `unit`: a key of `QUANTITIES` (`"rad/s"`, `"N*m"`, ...) or another unit in SI. `infinite`:
    whether infinity is let through; NaN never is. Raises `InputError`: a sentence that begins with `name`.

    >>> to_si("880 rpm", "rad/s"), to_si("1 kgf*m/rad", "N*m/rad"), to_si(0.035, "kg*m^2")
    (92.1533845053006, 9.80665, 0.035)
    >>> to_si("50 Hz", "rad/s", name="target_speed")
    Traceback (most recent call last):
    softstart.errors.InputError: target_speed = "50 Hz": Hz is a frequency, which may count turns or radians;
    write "50 turn/s" or "50 rad/s".
    """
    try:
        return parse(value, unit, infinite=infinite)
    except RefusedError as refusal:
        place = "" if refusal.index is None else f"[{', '.join(map(str, refusal.index))}]"
        shown = value if refusal.index is None else refusal.value
        raise InputError(f"{name}{place} = {show(shown)}: {refusal.reason}.") from None


def number_in(unit: str, value: object, name: str) -> float:
    """A single quantity in the SI unit `unit`, as `to_si` reads it; a list or an array is refused.

    >>> number_in("s", "20 ms", "until")
    0.02
    >>> number_in("s", [0.1, 0.2], "until")
    Traceback (most recent call last):
    softstart.errors.InputError: until = [0.1, 0.2]: this is a list; give a single value.
    """
    number = to_si(value, unit, name=name)
    if isinstance(number, float):
        return number
    raise InputError(f"{name} = {show(value)}: this is a list; give a single value.")


def time_above_0(value: object, name: str, advice: str) -> float:
    """A time above 0 s, as a number or with a unit; `advice` ends the sentence for anything else.

    >>> time_above_0("20 ms", "until", "; leave it out")
    0.02
    >>> time_above_0(0.0, "until", "; leave it out")
    Traceback (most recent call last):
    softstart.errors.InputError: until = 0.0: give a time above 0 s; leave it out.
    """
    if 0.0 < (seconds := number_in("s", value, name)) < math.inf:
        return seconds
    raise InputError(f"{name} = {show(value)}: give a time above 0 s{advice}.")


def read_multiple(value: object, name: str, endings: Iterable[str] = ("x",)) -> tuple[float, str] | None:
    """The number and the ending of a text as "2x", a multiple of something; None for anything else.

    >>> read_multiple("1.2x", "gap"), read_multiple("5 J1", "inertia", ("x", "J1"))
    ((1.2, 'x'), (5.0, 'J1'))
    >>> read_multiple("2 ms", "time") is None
    True
    """
    text = value.strip() if isinstance(value, str) else ""
    for ending in endings:
        if text.casefold().endswith(ending.casefold()):
            try:
                return float(parse(text[: -len(ending)], "1")), ending
            except RefusedError as refusal:
                raise InputError(f"{name} = {show(value)}: {refusal.reason}.") from None
    return None


def multiplied(value: Any, name: str, units: Mapping[str, float]) -> Any:
    """A multiple times that of the `units` which it names; anything else as it is.

    >>> multiplied("5 J1", "inertia", {"x": 0.175, "J1": 0.035}), multiplied("2 ms", "time", {"x": 0.5})
    (0.175, '2 ms')
    """
    multiple = read_multiple(value, name, units)
    return (
        value if multiple is None else float(f"{multiple[0] * units[multiple[1]]:.12g}")
    )  # 5 x 0.035 is 0.175


def parse(value: object, unit: str, *, infinite: bool = False) -> Value:
    """Like `to_si`, but raises `RefusedError`, for callers that word the sentence themselves.

    >>> parse(["0.5 rad", "2 rad"], "rad")
    array([0.5, 2. ])
    """
    if hasattr(value, "magnitude") and hasattr(value, "units"):  # a quantity of the user's own pint registry
        return parse(value.magnitude, unit, infinite=infinite) * _text(f"1 {value.units}", unit, infinite)
    if hasattr(value, "__array__") and not isinstance(value, np.generic):
        value = np.asarray(value)
    if not isinstance(value, list | tuple | np.ndarray):
        return _single(value, unit, infinite)
    if isinstance(value, list | tuple) and all(type(one) is float for one in value):
        value = np.array(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        numbers = value.astype(np.float64)
        if np.all(np.isfinite(numbers)) and numbers.size:
            return float(numbers) if numbers.ndim == 0 else numbers + 0.0  # in which -0.0 is 0.0
    try:
        cells = np.array(value, dtype=object)
    except ValueError:
        raise RefusedError("the rows of a list must all have the same length") from None
    if cells.size == 0:
        raise RefusedError("an empty list holds no value; give at least one element")
    numbers = np.empty(cells.shape)
    for index, cell in np.ndenumerate(cells):
        try:
            numbers[index] = _single(cell, unit, infinite)
        except RefusedError as refusal:
            raise RefusedError(refusal.reason, cell, index or None) from None
    return float(numbers) if numbers.ndim == 0 else numbers


def shortest(value: float, unit: str, within: float = 0.0) -> str:
    """The shortest text that `parse` reads back to this very float: in SI, or in the unit it was written in.

    Another unit than that of SI is named only where the number would have more than `MOST_DIGITS` digits. A
    value that was brought over to another shaft is as it was written `within` a share of it.

    >>> shortest(0.5, "rad"), shortest(0.06981317007977318, "rad"), shortest(92.1533845053006, "rad/s")
    ('0.5', '4 deg', '880 rpm')
    >>> shortest(1.0 / 3.0, "rad"), shortest(15000.0 * 57.29577951308232, "N*m/rad")
    ('0.3333333333333333', '15000 N*m/deg')
    """
    plain = repr(float(value))
    if within and abs(float(f"{value:.{MOST_DIGITS}g}") - value) <= within * abs(value):
        plain = f"{value:.{MOST_DIGITS}g}"
    if len(plain) <= MOST_DIGITS or not math.isfinite(value):
        return plain
    texts = [f"{value / ORDINARY[one, unit]:.{MOST_DIGITS}g} {one}" for one in TYPED.get(unit, ())]
    same = [one for one in texts if abs(cast("float", parse(one, unit)) - value) <= within * abs(value)]
    return min(same, key=len, default=plain)


class Units(NamedTuple):
    """The units in which a person sees quantities, and the shaft, motor or output, at which they count.

    An angle in `mm` is the arc on a circle of this `diameter`, m: half of it is the lever, as for the
    backlash of gears on their pitch circle. The unit of torque is also that of stiffness, damping and rate of
    torque. With a `gear` everything is seen at its output, by `Gear.to_output`; inertias stay in kg m2.

    >>> units = Units.read("deg, rpm")
    >>> units.of("rad"), round(units.shown(0.5, "rad"), 3), units.typed("4", "rad")
    ('deg', 28.648, '4 deg')
    >>> Units.read("mm on 80 mm").typed("0.3", "rad"), Units.read("").of("rad/s")
    ('0.0075', 'rad/s')
    >>> from softstart.input.gear import Gear
    >>> units = Units.read("arcmin, rpm, kN m, at output", gear=Gear(40.0, 0.8))
    >>> units.of("N*m/rad"), units.shown(50.0, "N*m"), round(units.shown(0.1, "rad"), 3), units.at
    ('kN*m/rad', 1.6, 8.594, ', at the output')
    >>> units.typed("1.6", "N*m"), units.typed("9 arcmin", "rad"), units.at_motor.typed("9", "rad")
    ('1.6 kN*m at output', '9 arcmin at output', '9 arcmin')
    >>> units.typed("0.5x", "rad"), units.typed("2.5 J1", "kg*m^2")  # multiples are the same at both
    ('0.5x', '2.5 J1')
    """

    angle: str = "rad"
    speed: str = "rad/s"
    diameter: float = 0.0
    torque: str = "N*m"
    gear: Any = None  # `input.gear.Gear`, which reads with the help of this module

    @classmethod
    def read(
        cls, text: str, angles: Iterable[float] = (), speeds: Iterable[float] = (),
        gear: object = 'without a gear nothing is "at output"',
    ) -> Units:  # fmt: skip
        """The units of a text as `deg, rpm, kN m` or `mm on 80 mm`; what it leaves out as values are written.

        The values are in SI: an angle that `shortest` writes in deg is one that somebody gave in deg; if
        they all are, that is the unit. `at output` asks for the output of the `gear`, a `Gear`, or is
        refused with this reason; values that have few figures there were given there. Raises `RefusedError`
        for a text that names no such units, or two of a kind.

        >>> Units.read("", [0.06981317007977318], [92.1533845053006])
        Units(angle='deg', speed='rpm', diameter=0.0, torque='N*m', gear=None)
        >>> Units.read("deg, at output")
        Traceback (most recent call last):
        softstart.quantities.RefusedError: without a gear nothing is "at output"
        """
        fields: dict[str, Any] = {}
        for part in filter(None, (one.strip() for one in text.split(","))):
            arc, shaft = re.fullmatch(r"mm\s+on\s+(.+)", part), _SHAFT.fullmatch(part)
            if arc:
                same: dict[str, Any] = {"angle": "mm", "diameter": parse(arc[1], "m")}
                if not same["diameter"] > 0.0:
                    raise RefusedError("the diameter of the pitch circle must be above 0")
            elif shaft:
                same = {"gear": gear if shaft[1].lower() == "output" else None}
                if isinstance(same["gear"], str):
                    raise RefusedError(same["gear"])
            elif not (same := _same_unit(part)):
                raise RefusedError(
                    f"{show(part)} is no unit of an angle, a speed or a torque, and no shaft; write for "
                    'example "deg, rpm, kN m, at output", or "mm on 80 mm" for the backlash on a pitch circle'
                )
            if same.keys() & fields.keys():
                raise RefusedError(f"{show(part)} is the second of its kind; name one")
            fields |= same
        behind: Any = fields.get("gear")
        for key, si, values in (("angle", "rad", angles), ("speed", "rad/s", speeds)):
            there = {behind and _few_figures(behind.to_output(value, si), si) for value in values if value}
            here = {shortest(value, si).partition(" ")[2] or si for value in values if value}
            unit = there.pop() if len(there) == 1 else None
            fields.setdefault(key, unit or (here.pop() if len(here) == 1 else si))
        return cls(**fields)

    @property
    def text(self) -> str:
        """What `read` reads back to these units.

        >>> Units.read("mm on 80 mm, rpm, kNm").text
        'mm on 0.08 m, rpm, kN m'
        """
        angle = f"{self.angle}{f' on {self.diameter!r} m' if self.diameter else ''}"
        torque = "" if self.torque == "N*m" else f", {self.torque.replace('*', ' ')}"
        return f"{angle}, {self.speed}{torque}{', at output' if self.gear else ''}"

    @property
    def at(self) -> str:
        """What a title or an axis adds, once: the shaft, where it is not that of the motor."""
        return ", at the output" if self.gear else ""

    @property
    def behind(self) -> str:
        """The same behind a quantity in a sentence."""
        return self.at.replace(",", "")

    @property
    def at_motor(self) -> Units:
        """The same units at the motor shaft."""
        return self._replace(gear=None)

    def of(self, si: str) -> str:
        """The unit in which a quantity of this SI unit is seen."""
        if si in _OF_TORQUE:
            return self.torque + si.removeprefix("N*m")
        return {"rad": self.angle, "rad/s": self.speed}.get(si, si)

    def label(self, si: str) -> str:
        """The same as headings and axes write it, in ASCII.

        >>> Units(torque="kN*m").label("N*m/rad"), Units().label("kg*m^2")
        ('kN m/rad', 'kg m2')
        """
        return "" if si == "1" else self.of(si).replace("*", " ").replace("^", "")

    def size(self, si: str) -> float:
        """How much of the SI unit one of these is."""
        unit = self.of(si)
        if si in _OF_TORQUE:
            return ORDINARY.get((self.torque, "N*m"), 1.0)
        return 2e-3 / self.diameter if unit == "mm" and si == "rad" else ORDINARY.get((unit, si), 1.0)

    def shown(self, value: Any, si: str) -> Any:
        """A value or an array in SI at the motor shaft as it is seen."""
        size = self.size(si)
        if self.is_at_output(si):
            value = self.gear.to_output(value, si)
        return value if size == 1.0 else value / size

    def of_setting(self, name: str, si: str) -> Units:
        """These units, of a frequency in rad/s those of SI: no gear makes another one of it.

        >>> units = Units(speed="rpm")
        >>> units.of_setting("coast_speed", "rad/s").speed, units.of_setting("corner", "rad/s").speed
        ('rpm', 'rad/s')
        """
        return Units() if si == "rad/s" and "speed" not in name else self

    def rounded(self, value: float, si: str, digits: int) -> float:
        """The value in SI at the motor shaft whose number in these units has so many digits.

        >>> Units.read("deg").rounded(0.0698, "rad", 3) == parse("4 deg", "rad")
        True
        """
        number = parse(self.at_motor.typed(f"{self.shown(value, si):.{digits}g}", si), si)
        return cast("float", self.gear.to_motor(number, si) if self.is_at_output(si) else number)

    def typed(self, text: str, si: str) -> str:
        """What a number in such a field means, as a parameter reads it; any other text stays as it is.

        At the output a quantity with a unit of its own is there too.
        """
        text = without_powers(text)
        if self.is_at_output(si) and _QUANTITY.fullmatch(text.strip()):
            return f"{self.at_motor.typed(text, si).strip()} at output"
        if self.of(si) == si or not _NUMBER.fullmatch(text.strip()):
            return text
        if self.of(si) == "mm":  # a length is no angle
            return f"{float(text) * self.size(si):.{MOST_DIGITS}g}"
        return f"{text.strip()} {self.of(si)}"

    def is_at_output(self, si: str) -> bool:
        """Whether a quantity of this SI unit has another value at the shaft asked for."""
        return self.gear is not None and self.gear.factor(si) is not None


def _few_figures(value: float, unit: str) -> str:
    """The unit in which a value, brought over to another shaft, is short; "" for none.

    >>> [_few_figures(math.radians(one), "rad") for one in (9.0 / 60.0, 0.25, 2.0, 2.0 / 3.0)]
    ['arcmin', 'arcmin', 'deg', 'arcmin']
    >>> _few_figures(0.5 / 38.1, "rad"), _few_figures(0.003, "rad")
    ('', 'rad')
    """
    found = {}
    for one in (unit, *TYPED[unit]):
        text = f"{value / ORDINARY.get((one, unit), 1.0):.{MOST_DIGITS}g}"
        if len(text) <= MOST_DIGITS and math.isclose(
            cast("float", parse(f"{text} {one}", unit)), value, rel_tol=1e-12
        ):
            found[one] = len(text)
    return min(found, key=found.__getitem__, default="")


def seen_from(text: str, output: bool) -> str:
    """The units of a text, as `Units.read` has it, at the output or at the motor shaft.

    >>> seen_from("deg, at output, kN m", False), seen_from("deg", True), seen_from("", True)
    ('deg, kN m', 'deg, at output', 'at output')
    """
    parts = [one for one in map(str.strip, text.split(",")) if one and not _SHAFT.fullmatch(one)]
    return ", ".join([*parts, *["at output"] * output])


_SHAFT = re.compile(r"at\s+(?:the\s+)?(output|motor)(?:\s+shaft)?", re.IGNORECASE)
_OF_TORQUE = ("N*m", "N*m/s", "N*m/rad", "N*m*s/rad")
# a number with or without a unit: no list, no multiple ("2x", "5 J1"), and not already "at output"
_QUANTITY = re.compile(rf"(?>{_NUMBER.pattern})(?!\s*(?:x|J1)$)(?:(?!\sat\s)[^,;])*", re.IGNORECASE)


def _same_unit(written: str) -> dict[str, Any]:
    """The unit of an angle, a speed or a torque that somebody wrote, in any spelling, as a field of `Units`.

    >>> _same_unit("rpm"), _same_unit("1/min"), _same_unit("degree"), _same_unit("N")
    ({'speed': 'rpm'}, {'speed': 'rpm'}, {'angle': 'deg'}, {})
    >>> _same_unit("Nm"), _same_unit("kN m"), _same_unit("ft-lb")
    ({'torque': 'N*m'}, {'torque': 'kN*m'}, {'torque': 'lbf*ft'})
    """
    known = {
        field: (si, *(name for name, of in ORDINARY if of == si))
        for field, si in (("angle", "rad"), ("speed", "rad/s"), ("torque", "N*m"))
    }
    for field, units in known.items():
        if written in units:
            return {field: written}
    for field, units in known.items():
        with suppress(RefusedError):
            size = cast("float", parse(f"1 {written}", units[0]))
            for unit in units:
                if math.isclose(size, ORDINARY.get((unit, units[0]), 1.0), rel_tol=1e-9):
                    return {field: unit}
    return {}


def _single(value: object, unit: str, infinite: bool) -> float:
    if isinstance(value, str):
        return _text(value, unit, infinite)
    if isinstance(value, bool | np.bool_):
        raise RefusedError(f"true and false are not quantities; {_remedy(unit)}")
    if value is None:
        raise RefusedError(f"there is no value; {_remedy(unit)}")
    if isinstance(value, list | tuple):
        raise RefusedError("the rows of a list must all have the same length")
    if not isinstance(value, Real | Decimal):
        kind = type(value).__name__
        a = {"dict": "a table", "complex": "a complex number"}.get(
            kind, f"a{'n' * (kind[0] in 'aeiou')} {kind}"
        )
        raise RefusedError(f"{a} is not a quantity; {_remedy(unit)}")
    try:
        return _checked(float(value), unit, infinite)
    except OverflowError:
        raise RefusedError(f"the number is too large; {_remedy(unit)}") from None


def _checked(number: float, unit: str, infinite: bool) -> float:
    if math.isnan(number):
        raise RefusedError(f"this is not a number; {_remedy(unit)}")
    if math.isinf(number) and not infinite:
        raise RefusedError(f"it must be finite; {_remedy(unit)}")
    return number + 0.0


def _text(text: str, unit: str, infinite: bool) -> float:
    stripped = without_powers(text.strip()).replace("\N{MINUS SIGN}", "-")
    match = _NUMBER.match(stripped)
    if match is None:
        raise RefusedError(f"this is not a number with a unit; {_remedy(unit)}")
    written = stripped[match.end() :].strip()
    if "," in written:
        raise RefusedError(doubtful_comma(stripped, unit))
    if re.search(r"\sat\s", written):
        raise RefusedError('"at output" does not apply here; leave it out')
    named = infinite and "inf" in match.group().lower()  # infinity is written, not a number with many digits
    number = _checked(float(match.group()), unit, named)
    if not written:
        return number
    if written == "%" and unit == "1":
        return number / 100.0
    factor = _factor(written, match.group(), unit)
    # Decimal units are applied by one correctly rounded operation: "9 ms" is 0.009, not a neighbour of it.
    divisor = round(1.0 / factor) if 1e-15 < factor < 1.0 else 0
    scaled = number / divisor if divisor and abs(divisor * factor - 1.0) < 1e-14 else number * factor
    if scaled == 0.0 != number:
        raise RefusedError(f"the number is too small; {_remedy(unit)}")
    return _checked(scaled, unit, named)


def doubtful_comma(text: str, unit: str = "") -> str:
    """The reason why a number with a comma is refused, and how to write it."""
    reason = "a comma may divide decimals or thousands; "
    number = re.match(r"([+-]?[0-9]*),([0-9]+)(?![0-9]*[.,])", text)
    if number is None:
        return f"{reason}use a decimal point and no other mark: {_remedy(unit)}"
    rest = text[number.end() :]
    decimal = f"{number[1]}.{number[2]}{rest}"
    if _THOUSANDS.fullmatch(number.group()):
        return f'{reason}write "{decimal}" with a decimal point, or "{number[1]}{number[2]}{rest}"'
    return f'{reason}use a decimal point: "{decimal}"'


def _factor(written: str, number: str, unit: str) -> float:
    """How many `unit` one `written` is."""
    if written == unit and unit in QUANTITIES:
        return 1.0
    if ordinary := ORDINARY.get((written, unit)):
        return ordinary
    quantity = _quantity(unit)
    source = read_unit(written)
    if isinstance(source, str):
        raise RefusedError(f"{source}; {_remedy(unit)}")
    pounds = _AS_FORCE.sub(r"\1f", written)  # of torque, as in lb-ft, in-lb and oz-in
    moment = _known("N*m^2")
    if (
        unit == "kg*m^2"
        and source.dimensions == moment.dimensions
        and not re.search("lb|oz|pound|ounce", written)
    ):
        return source.size / moment.size / (4.0 * GRAVITY)  # GD^2: a weight on the square of a diameter
    if unit == "rad/s" and "min" in written and source.dimensions == _known("Hz").dimensions:
        source = Unit(source.size * 2.0 * math.pi, _known(unit).dimensions)  # 1/min: revolutions, ISO 80000-3
    forms = [_known(form) for form in (unit, *quantity.others)]
    for read, wanted in itertools.product((source, read_unit(pounds)), forms):
        if isinstance(read, Unit) and wanted.dimensions == read.dimensions:
            factor = read.size / wanted.size
            decimal = float(f"{factor:.12g}")  # 9.80665 stays 9.80665 whatever order pint multiplied in
            return decimal if abs(factor - decimal) <= 1e-15 * factor else factor
    raise RefusedError(_wrong_kind(written, number, source, quantity))


def _wrong_kind(written: str, number: str, found: Unit, quantity: Quantity) -> str:
    unit, remedy = quantity.unit, _remedy(quantity.unit)
    nouns = [(form, q.noun) for q in QUANTITIES.values() for form in (q.unit, *q.others)]
    nouns = [*((q.unit, q.noun) for q in QUANTITIES.values()), *OTHER_NOUNS.items(), *nouns]
    other = next((noun for form, noun in nouns if _known(form).dimensions == found.dimensions), None)
    if other is None:
        return f"{written} is not a unit of {quantity.noun}; {remedy}"
    what = f"not {quantity.noun}"
    if unit == "rad/s" and other == "a frequency":
        amount = f"{float(number) * found.size:.12g}"
        what = "which may count turns or radians"
        remedy = f'write "{amount} turn/s" or "{amount} rad/s"'
    elif unit == "kg*m^2" and other == "a flywheel moment":
        return f"{written} is {other}; write GD^2 in kgf*m^2, and WK^2 in lb*ft^2"
    elif found.dimensions == _known(unit.removesuffix("/rad")).dimensions:
        what = f"but {quantity.noun} is per angle"
        remedy = f'write "{number} {written}/rad" or "{number} {written}/deg"'
    elif unit == "rad" and written in ("min", "sec", "s"):
        remedy = f'write "{number} arc{"min" if written[0] == "m" else "sec"}" if that is meant'
    elif unit == "N*m" and other in ("a stiffness", "an energy"):
        remedy = f'write "{number} N*m" if that is meant'
    return f"{written} is {other}, {what}; {remedy}"


def _quantity(unit: str) -> Quantity:
    return QUANTITIES.get(unit) or Quantity(unit, f"a quantity in {unit}", f"1 {unit}")


def _known(unit: str) -> Unit:
    known = read_unit(unit)
    if isinstance(known, str):
        raise InputError(f'unit = "{unit}": {known}.')
    return known


def _remedy(unit: str) -> str:
    quantity = _quantity(unit)
    if unit == "1":
        return f"write a plain number such as {quantity.example}"
    return f'write {quantity.noun} as "{quantity.example}" or as a bare number in {unit}'


def show(value: object, *, toml: bool = False) -> str:
    """A value as its writer wrote it, cut to a readable length; `toml` writes true, not True.

    >>> show("5 m"), show(True, toml=True), show([0.5, 2.0])
    ('"5 m"', 'true', '[0.5, 2.0]')
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist() if value.size <= 8 else f"an array of shape {value.shape}"
        if isinstance(value, str):
            return value
    try:
        if isinstance(value, str):
            shown = json.dumps(value[:100], ensure_ascii=False)
        elif toml and isinstance(value, bool | list | tuple | dict):
            shown = json.dumps(value, ensure_ascii=False, default=str)
        else:
            shown = str(value) if isinstance(value, date | time) else repr(value)
    except (RecursionError, ValueError):  # an integer with thousands of digits is not written either
        return "a table" if isinstance(value, dict) else "a list" if isinstance(value, list) else "a number"
    return shown if len(shown) <= 70 else f"{shown[:60]}..."


# ---- numbers as people type them ------------------------------------------------------------------------

_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
_WITH_COMMA = re.compile(r"[+-]?[0-9]*,[0-9,]*")
_POINT = re.compile(r"[0-9]\.|\.[0-9]")
_DECIMAL_COMMA = re.compile(r"((?:^|,)\s*[+-]?[0-9]+),([0-9]+)")  # a whole number, then a comma
# 1.000,5 and 12.345,6 but not 0.125,2 or 1.125,2.5: a point of thousands before what may be a decimal comma
_THOUSANDS_POINT = re.compile(r"(?<![0-9.])[1-9][0-9]{0,2}(?:\.[0-9]{3})+,[0-9]+(?![0-9]*\.[0-9])")


def values_in(text: str, name: str = "value", *, whole: bool = False) -> list[str]:
    """The values of a list as typed, each with a decimal point; what they are is read by `to_si` and others.

    Semicolons divide values that may have decimal commas; without them commas divide values. A comma between
    digits that could as well be a decimal comma is refused, unless the list has a decimal point elsewhere or
    is one of `whole` numbers: `1,5,2.5` is 1, 5 and 2.5. A point that may divide thousands, as in `1.000,5`,
    is no decimal point. Raises `InputError`: a sentence that begins with `name`.

    >>> values_in("0.25, 500 mrad"), values_in("0,25; 1"), values_in("1x,2x"), values_in("0.5,1,2")
    (['0.25', '500 mrad'], ['0.25', '1'], ['1x', '2x'], ['0.5', '1', '2'])
    >>> values_in("0,1,0,2", "--gaps")
    Traceback (most recent call last):
    softstart.errors.InputError: --gaps = "0,1,0,2": a comma may divide values or decimals; write
    "0, 1, 0, 2" for 4 values, or "0.1, 0.2" for 2.
    """
    try:
        raw = text.split(";" if ";" in text else ",")
        parts = [part.strip() for part in raw]
        if not all(parts):
            raise RefusedError("a place in the list is empty; write values with commas between")
        if ";" in text:
            return with_points(parts)
        one_kind = len({part[:1].isspace() for part in raw[1:]}) < 2  # "1.5, 2,5" has commas of two kinds
        without = _THOUSANDS_POINT.sub(lambda one: one[0].replace(".", ""), text)
        settled = whole or (one_kind and _POINT.search(without))
        other = [part.strip() for part in _DECIMAL_COMMA.sub(r"\1.\2", without).split(",")]
        if len(other) < len(parts) and not settled:
            both = f'"{", ".join(parts)}" for {len(parts)} values, or "{", ".join(other)}" for {len(other)}'
            both = f"; write {both}" if len(both) < 250 else ""
            raise RefusedError(f"a comma may divide values or decimals{both}")
    except RefusedError as refusal:
        raise InputError(f"{name} = {show(text)}: {refusal.reason}.") from None
    return parts


def with_points(texts: Sequence[str]) -> list[str]:
    """The texts with decimal points instead of decimal commas, where nothing but decimals can be meant.

    Raises `RefusedError` where commas stand beside points, or where all of them may divide thousands.

    >>> with_points(["0,000", "62,5 N*m"])
    ['0.000', '62.5 N*m']
    """
    numbers = [number for text in texts for number in _WITH_COMMA.findall(text)]
    if not numbers:
        return list(texts)
    point = next((text for text in texts if _POINT.search(text)), None)
    comma = next(text for text in texts if "," in text)
    if point is not None:
        raise RefusedError(f"{show(comma)} has a comma and {show(point)} a point; write decimal points only")
    if any(number.count(",") > 1 for number in numbers) or all(map(_THOUSANDS.fullmatch, numbers)):
        raise RefusedError(f"the comma in {show(comma)} may divide thousands; write decimal points only")
    return [text.replace(",", ".") for text in texts]


def check_whole(value: object, name: str, least: int = 1) -> None:
    """Raise InputError for anything but a whole number of `least` or more.

    >>> check_whole(1.5, "chunk")
    Traceback (most recent call last):
    softstart.errors.InputError: chunk = 1.5: give a whole number of 1 or more.
    """
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise InputError(f"{name} = {show(value)}: give a whole number of {least} or more.")


def whole_number(text: str, name: str, least: int = 1, most: int = 10**15) -> int:
    """A whole number from `least` to `most`. Raises `InputError`: a sentence that begins with `name`.

    >>> whole_number("12", "--workers")
    12
    >>> whole_number("1.5", "--workers")
    Traceback (most recent call last):
    softstart.errors.InputError: --workers = "1.5": give a whole number of 1 or more.
    """
    digits = re.fullmatch(r"\s*0*([0-9]{1,16})\s*", text)
    if digits and least <= int(digits[1]) <= most:
        return int(digits[1])
    upper = f"{most}" if most < 10_000 else f"{most:,}"
    bound = f"from {least} to {upper}" if most < 10**15 else f"of {least} or more"
    raise InputError(f"{name} = {show(text)}: give a whole number {bound}.")
