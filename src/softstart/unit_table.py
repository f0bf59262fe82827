"""Which units there are, how large each is, and what kind of quantity it measures.

pint reads the units, from the short list below in which the radian is a dimension of its own and the joule
another. With pint's own list `50 Hz` would be 50 rad/s, `5 N*m` a stiffness and `5 J` a torque.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, cast

if TYPE_CHECKING:
    import pint

__all__ = ["OTHER_NOUNS", "QUANTITIES", "Quantity", "Unit", "nearest", "read_unit"]


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
        Quantity("Pa", "a pressure", "10 bar", ("J/m^3",)),
        Quantity("m^2", "an area", "0.05 m^2"),
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
    "N/m": "a stiffness along a line",
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
inch = 0.0254 * meter = in
foot = 0.3048 * meter = ft
minute = 60 * second = min
hour = 3600 * second = h
tonne = 1e6 * gram = t
pound = 453.59237 * gram = lb
degree = 0.017453292519943295 * radian = deg = °
turn = 6.283185307179586 * radian = rev = revolution = r
arcminute = degree / 60 = arcmin
arcsecond = degree / 3600 = arcsec
revolutions_per_minute = turn / minute = rpm
hertz = 1 / second = Hz
newton = kilogram * meter / second ** 2 = N
kilogram_force = 9.80665 * newton = kgf = force_kilogram
pound_force = 4.4482216152605 * newton = lbf = force_pound
ounce_force = 0.27801385095378125 * newton = ozf = force_ounce
newton_meter = newton * meter = Nm
pascal = newton / meter ** 2 = Pa
bar = 1e5 * pascal
watt = joule / second = W
horsepower = 745.6998715822702 * watt = hp
metric_horsepower = 735.49875 * watt = PS
"""

# Spellings that are offered for an unknown one.
_USUAL = """
m mm cm in ft kg g lb t s ms min h rad mrad deg arcmin arcsec turn rev rpm Hz kHz N kN kgf lbf Nm kNm mNm
J kJ W kW MW hp PS Pa kPa MPa bar mbar
"""

_SYMBOLS = str.maketrans(
    {"·": "*", "⋅": "*", "×": "*", "²": "^2", "³": "^3", "⁴": "^4", "¹": "^1", "⁻": "^-", "⁺": "^+"}
)
# Only products, quotients and one-digit powers of names reach pint: its own grammar knows much more.
_NAME = re.compile(r"(?:[^\W\d]|°)+")
_FACTOR = rf"(?:{_NAME.pattern}|1)(?:\s*(?:\*\*|\^)\s*[+-]?[1-9])?(?![\w.])"
_PRODUCT = rf"\s*{_FACTOR}(?:(?:\s*[*/]\s*|\s+){_FACTOR})*\s*"


class Unit(NamedTuple):
    """A unit in the base units of the list: its size, and the exponent of each dimension."""

    size: float
    dimensions: tuple[tuple[str, float], ...]


@lru_cache(maxsize=512)
def read_unit(written: str) -> Unit | str:
    """The unit as written by people ("kg m2", "N·m/rad", "s⁻¹"), or the reason why it is none.

    >>> read_unit("rpm")
    Unit(size=0.10471975511965977, dimensions=(('[angle]', 1.0), ('[time]', -1.0)))
    >>> read_unit("RPM")
    'unknown unit "RPM" (did you mean "rpm"?)'
    """
    if written == "1":
        return Unit(1.0, ())
    text = written.translate(_SYMBOLS).replace("^-^", "^-").replace("^+^", "^")
    text = re.sub(r"(?<=[^\W\d])\.(?=[^\W\d])", "*", text)  # "N.m"
    text = re.sub(r"(?<=[^\W\d_])([+-]?[1-9])(?![\w.])", r"^\1", text)  # "kg m2", "s-1" as in data sheets
    if not _is_product(text):
        return f'"{written}" is no unit'
    registry = _registry()
    for name in _NAME.findall(text):
        if not registry.parse_unit_name(name):
            meant = nearest(name, _USUAL.split())
            return f'unknown unit "{name}"' + (f' (did you mean "{meant}"?)' if meant else "")
    root = registry.Quantity(1.0, registry.parse_units(text)).to_root_units()
    exponents = tuple(sorted((str(k), float(cast("float", v))) for k, v in root.dimensionality.items() if v))
    return Unit(float(root.magnitude), exponents)


def _is_product(text: str) -> bool:
    """Whether the text is well formed, brackets included: they are replaced by a name from the inside out."""
    inner = ""
    while inner != text:
        inner, text = text, re.sub(rf"\({_PRODUCT}\)", " x ", text)
    return re.fullmatch(_PRODUCT, text) is not None


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(None)
    registry.load_definitions([line for line in _DEFINITIONS.splitlines() if line])
    return registry


def nearest(name: str, valid: Iterable[str]) -> str | None:
    """The valid name that `name` was probably meant to be, or None; upper and lower case count as one.

    >>> nearest("RPM", ["rad/s", "rpm"]), nearest("zzz", ["rad/s", "rpm"])
    ('rpm', None)
    """
    folded = {v.casefold(): v for v in reversed(list(valid))}
    close = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.6)
    return folded[close[0]] if close else None
