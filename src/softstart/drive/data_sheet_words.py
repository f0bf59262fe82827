"""How people fill in a data sheet: words for machines, usual units, what may stay empty or is typed."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Literal

from softstart.input.parameters import Parameter, bare, read_value
from softstart.quantities import RefusedError

# elastic frequencies of most drives with gears, Hz: where no stiffness is known, the stiff end counts, whose
# K_dyn is the higher one, and results are compared with those of the soft end
BAND = (3.0, 30.0)
METAL = 0.46  # metallic cross-section of a rope over its diameter squared, EN 12385: class 6x36, steel core

MachineKind = Literal["hoist", "travel", "belt", "rotor"]
MACHINES: Mapping[str, str] = {
    "hoist": "a load on ropes",
    "travel": "a crane, trolley or vehicle on wheels",
    "belt": "a belt conveyor",
    "rotor": "slewing gear, fan, rotary table: anything that turns about the output axis",
}

# words that name the kind of a machine, beside the kinds themselves
WORDS: Mapping[str, frozenset[str]] = {
    "hoist": frozenset({"hoist", "hoisting", "lift", "elevator", "winch", "rope", "load"}),
    "travel": frozenset({"travel", "crane", "trolley", "vehicle", "wheel", "gantry", "bogie", "carriage"}),
    "belt": frozenset({"belt", "conveyor", "escalator"}),
    "rotor": frozenset(
        {"rotor", "slewing", "slew", "gear", "fan", "rotary", "table", "pump", "mill", "mixer"}
    ),
}

RESISTANCE = {"travel": 0.008, "belt": 0.02}  # share of the weight
ROPE = {"rope_stiffness", "rope_length", "elastic_frequency"}  # any of them says how a rope yields
STIFFNESSES = ROPE | {"coupling_stiffness", "gear_stiffness", "shaft_diameter"}

# what is filled in where a number is not given, and where that is from
TYPICAL: Mapping[str, tuple[str, str]] = {
    "starting_ratio": ("1.5", "1.5 is what inverters allow for a minute in their heavy-duty rating; at the "
                       "mains 2 to 3, by the data sheet of the motor"),
    "efficiency": ("0.95", "0.97 to 0.98 for each stage of spur, helical or bevel gears"),
    "rope_modulus": ("100 GPa", "90 to 120 GPa on the metallic cross-section, 0.46 d^2, of a rope in use"),
    "resistance": ("0.008, of a belt 0.02", "travel on rolling bearings 0.006 to 0.01; belts 0.016 to 0.03, "
                   "DIN 22101"),
    "elastic_frequency": ("3 to 30 Hz if no stiffness is given", "of the swing of the speed in the log of a "
                          "start; 3 to 30 Hz in most drives with gears"),
    "damping_ratio": ("0.02", "0.02 for gears and steel shafts; with an elastomer coupling 0.06, psi/(4 pi) "
                      "by its catalogue"),
}  # fmt: skip
# the unit that a bare number has at the prompt and in the form, where it is not that of SI; in a file such a
# number is refused
USUAL: Mapping[str, str] = {
    "rated_power": "kW", "rated_speed": "rpm", "torque_lag": "ms", "backlash": "arcmin", "slope": "deg",
    "rope_modulus": "GPa", **dict.fromkeys(
        ("coupling_play", "coupling_diameter", "shaft_diameter", "shaft_length", "output_play",
         "play_diameter", "rope_diameter", "diameter"), "mm"),
}  # fmt: skip
# parameters that say something about these machines only
ABOUT: Mapping[str, tuple[MachineKind, ...]] = {
    **dict.fromkeys(("mass", "diameter", "radius"), ("hoist", "travel", "belt")),
    **dict.fromkeys(("resistance", "slope", "rise", "length"), ("travel", "belt")),
    "goods": ("belt",), "counterweight": ("hoist",),
    **dict.fromkeys(("reeving", "rope_stiffness", "rope_length", "rope_diameter", "rope_modulus"), ("hoist",))
}  # fmt: skip
# parameters that need not be given where the other one is
INSTEAD: Mapping[str, str] = {
    "rated_torque": "rated_power", "starting_ratio": "starting_torque", "maximum_ratio": "maximum_torque",
    "rope_length": "rope_stiffness", "radius": "diameter", "rise": "slope",
}  # fmt: skip
# what a machine cannot do without
NEEDED: Mapping[str, tuple[str, ...]] = {
    "rotor": ("output_inertia",), **dict.fromkeys(("hoist", "travel", "belt"), ("mass", "diameter")),
}  # fmt: skip
_QUOTIENT = re.compile(r"\s*(\d+\.?\d*)\s*[:/]\s*(\d+\.?\d*)\s*")


def converted(name: str, value: object) -> object:
    """What stands for a parameter is read as, where people write it in a way of its own.

    A ratio or a reeving may be a quotient, a slope per cent, a machine any word that names its kind.

    >>> converted("ratio", "4/2"), converted("machine", "gantry crane"), converted("mass", "6 t")
    (2.0, 'travel', '6 t')
    >>> converted("slope", "100 %")  # 45 degrees
    '0.7853981633974483 rad'
    >>> converted("ratio", "1:31.5")
    Traceback (most recent call last):
    softstart.quantities.RefusedError: the ratio counts turns of the motor for one of the output; write ...
    """
    text = str(value).strip()
    quotient = _QUOTIENT.fullmatch(text) if name in ("ratio", "reeving") else None
    if quotient and float(quotient[2]):
        first, second = float(quotient[1]), float(quotient[2])
        if name == "ratio" and first < second:
            raise RefusedError(
                f"the ratio counts turns of the motor for one of the output; write {second / first:.9g}, or "
                f"{first / second:.9g} if the gear speeds the load up"
            )
        return first / second
    if name == "slope" and text.endswith("%") and (share := bare(text[:-1])):
        return f"{math.atan(float(share) / 100.0)!r} rad"
    if name == "machine" and value not in MACHINES:
        words = re.findall(r"[a-z]+", text.lower())
        named = {kind for kind, known in WORDS.items() for word in words if word.removesuffix("s") in known}
        return named.pop() if len(named) == 1 else value
    return value


def usual_rotor(rated_torque: float) -> str:
    """A sentence on the inertia of the rotors of standard motors with four poles, as catalogues list them.

    >>> usual_rotor(97.8)
    ' Standard motors of 97.8 N*m have about 0.05 to 0.2 kg*m^2.'
    """
    middle = 1.6e-4 * rated_torque**1.4  # within a factor of two from 0.75 to 110 kW
    low, high = (float(f"{share * middle:.1g}") for share in (0.5, 2.0))
    return f" Standard motors of {rated_torque:.3g} N*m have about {low:g} to {high:g} kg*m^2."


def typed(p: Parameter, text: str) -> str:
    """What is typed at a prompt or in a form for one parameter: a bare number has its usual unit.

    >>> from softstart import DataSheet
    >>> [typed(DataSheet.PARAMETERS[name], "95") for name in ("backlash", "mass", "efficiency", "ratio")]
    ['95 arcmin', '95 kg', '95 %', '95']
    """
    text = text.strip()
    if p.name != "slope":
        with suppress(RefusedError):  # refused where it is read
            text = str(converted(p.name, text))
    number, unit = bare(text), USUAL.get(p.name, p.unit)
    if p.name == "efficiency" and number and float(number) >= 10.0:
        unit = "%"
    return f"{number} {unit}" if number and unit not in ("", "1") else text.strip()


def answered(settings: Mapping[str, object]) -> dict[str, object]:
    """Values by path of a dialog or form, which asks for friction and for what acts always: "" is none.

    In a file a torque alone may be either (`DataSheet` asks).

    >>> answered({"load.torque": "7 kN*m"})
    {'load.torque': '7 kN*m', 'load.friction': 0}
    """
    torque = "load.torque" in settings and "load.friction" not in settings
    return {**settings, **({"load.friction": 0} if torque else {})}


def in_usual_unit(p: Parameter, refusal: RefusedError) -> RefusedError:
    """A refusal that speaks of a bare number as `typed` reads it, not of one in SI."""
    if p.name not in USUAL:
        return refusal
    return RefusedError(refusal.reason.replace(f"bare number in {p.unit}", f"bare number in {USUAL[p.name]}"))


def if_empty(p: Parameter) -> str:
    """What is used where nothing is typed for a parameter.

    >>> from softstart import DataSheet
    >>> [if_empty(DataSheet.PARAMETERS[name]) for name in ("efficiency", "backlash", "rated_power", "motors")]
    ['0.95, assumed', 'none', 'by rated torque', '1']
    """
    if p.name in TYPICAL:
        return f"{TYPICAL[p.name][0]}, assumed"
    other = next((name for name, instead in INSTEAD.items() if instead == p.name), "")
    if other and p.default is None:
        return f"by {other.replace('_', ' ')}"
    return f"{p.default:g}" if isinstance(p.default, float) and p.default else p.default or "none"


def echo(p: Parameter, text: str) -> str:
    """What is typed for one parameter, with its value in SI; "" for a word or a plain number.

    >>> from softstart import DataSheet
    >>> [echo(DataSheet.PARAMETERS[name], "1460") for name in ("rated_speed", "mass", "ratio")]
    ['1460 rpm = 152.9 rad/s', '1460 kg', '']
    """
    written = typed(p, text)
    if not p.unit or bare(written):
        return ""
    number = read_value(p, converted(p.name, written))
    if p.name == "slope":
        return f"{written} = {number * 180.0 / math.pi:.4g} deg = {100.0 * math.tan(number):.4g} %"
    value = f"{float(f'{number:.4g}'):.10g} {p.unit}".removesuffix(" 1")
    return written if written.endswith(f" {p.unit}") else f"{written} = {value}"
