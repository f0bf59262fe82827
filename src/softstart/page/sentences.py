"""Sentences that the page shows: what went wrong, and for which earlier drive a result is."""

from __future__ import annotations

import logging
import re
from typing import Any, NamedTuple

from softstart.chain.machines import Values
from softstart.drive.machine import Machine
from softstart.errors import InputError, SimulationError
from softstart.input.parameters import Parameter
from softstart.quantities import Units, shortest
from softstart.views.numbers import unit, units_of

log = logging.getLogger("softstart.page")
LONGEST = 300  # characters of an exception
LONGEST_NAME = 60  # characters of a name in a sentence
NAMED = 3  # parameters named in a sentence
WORDS = ("name", "source", "assumed", "units", "gear_ratio", "gear_efficiency")  # they change no result


OWN_MISTAKE = "This did not work, and that is a mistake in softstart, not in your input ({})."
FAILED_START = "The start was given up: the strategy failed on this drive ({})."


def sentence_of(error: BaseException, otherwise: str = OWN_MISTAKE) -> str:
    """One plain sentence for an exception: nobody who uses the page sees a traceback.

    `otherwise` is said of an exception that has no sentence of its own.

    >>> sentence_of(InputError(["gap = -1: a gap is 0 or more.", "inertia = 0: above 0."]))
    'gap = -1: a gap is 0 or more. inertia = 0: above 0.'
    >>> sentence_of(KeyError("x"))
    "This did not work, and that is a mistake in softstart, not in your input (KeyError: 'x')."
    """
    if isinstance(error, InputError):
        return " ".join(map(page_sentence, error.sentences))
    if isinstance(error, SimulationError):
        return page_sentence(" ".join(str(error).split()))
    if isinstance(error, MemoryError):
        return "There is not enough memory for this."
    text = " ".join(str(error).split())
    if len(text) > LONGEST:
        text = text[:LONGEST] + " ..."
    what = f"{type(error).__name__}: {text}" if text else type(error).__name__
    log.debug("told the user: %s", what, exc_info=error)
    return otherwise.format(what)


def page_sentence(sentence: str) -> str:
    """A sentence without the words of the command line, which a page does not have.

    >>> page_sentence("minimise = life: it is below 0; leave out --max-torque (softstart plan).")
    'it is below 0; leave out max torque.'
    """
    text = re.sub(r" \([^()]*(--[a-z]|softstart [a-z])[^()]*\)|^minimise = \w+: ", "", sentence)
    return re.sub(r"--([a-z][\w-]*)", lambda option: option[1].replace("-", " "), text)


def clipped(name: str) -> str:
    """A name short enough to stand in a sentence.

    >>> clipped("Crane"), len(clipped("Crane " * 100))
    ('Crane', 60)
    """
    return name if len(name) <= LONGEST_NAME else name[: LONGEST_NAME - 1] + "\N{HORIZONTAL ELLIPSIS}"


def changed_since(computed: Machine, now: Machine) -> str:
    """What a result was computed for, where that is not the drive of now; empty where it is.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> changed_since(crane, crane)
    ''
    >>> changed_since(crane, crane.replace(name="the same by another name"))
    ''
    >>> changed_since(crane, crane.replace(gap=1.0))
    'For shaft.gap 0.5 rad; the drive has changed since.'
    """
    named = differences(computed, now)
    if not named:
        return ""
    other = computed.name != now.name
    return f"For {named}; {'another drive is loaded now' if other else 'the drive has changed since'}."


def differences(drive: Machine, other: Machine) -> str:
    """What tells a drive or chain from another one: its name, else its values; empty where both start alike.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> differences(crane.replace(gap=1.0, load_inertia=0.2), crane)
    'shaft.gap 1 rad, load.inertia 0.2 kg m\N{SUPERSCRIPT TWO}'
    """
    found = [one for one in changes(drive, other) if one.parameter.name not in WORDS]
    if found and drive.name != other.name:
        return clipped(drive.name)
    seen = units_of(other)
    named = ", ".join(f"{one.path} {_value(one.parameter, one.old, seen)}" for one in found[:NAMED])
    return named + (f" and {len(found) - NAMED} more" if len(found) > NAMED else "")


class Change(NamedTuple):
    """A parameter in which two machines differ."""

    path: str
    parameter: Parameter
    old: Any
    new: Any


def changes(old: Machine, new: Machine) -> list[Change]:
    """The parameters in which two machines differ; those that follow another one only where they do not."""
    first, second = old.parameters_by_path(), new.parameters_by_path()
    found = []
    for path in dict.fromkeys([*first, *second]):
        parameter, value = first.get(path) or (second[path][0], None)
        other = second[path][1] if path in second else None
        if value != other:
            found.append(Change(path, parameter, value, other))
    return [one for one in found if not _follows(one, first, second, {other.path for other in found})]


def _follows(one: Change, first: Values, second: Values, changed: set[str]) -> bool:
    """Whether a parameter is, before and after, as the one that it follows by default."""
    leader = next((path for path, (other, _) in first.items() if other.name == one.parameter.follows), "")
    return (
        leader in changed
        and leader in second
        and all(values[leader][1] == values[one.path][1] for values in (first, second))
    )


def _value(parameter: Parameter, value: Any, units: Units) -> str:
    if value is None:
        return "not given"
    if isinstance(value, str):
        return value
    of = unit(units.of(parameter.unit))
    each = value if isinstance(value, tuple) else (value,)
    texts = [written(float(one), parameter.unit, units) for one in each]
    return ", ".join(texts) + (f" {of}" if of and " " not in texts[-1] else "")


def written(value: float, si: str, units: Units) -> str:
    """A value as a person reads it: in his unit or, in SI, in that in which it was written, with six digits.

    >>> written(0.06981317007977318, "rad", Units()), written(1.0 / 3.0, "rad", Units())
    ('4 deg', '0.333333')
    >>> written(0.06981317007977318, "rad", Units("deg")), written(0.07, "rad", Units("deg"))
    ('4', '4.0107')
    """
    if units.of(si) != si:
        return f"{units.shown(value, si):.6g}"
    text = shortest(value, si)
    return text if " " in text else f"{value:.6g}"
