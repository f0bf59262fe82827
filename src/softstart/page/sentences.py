"""Sentences that the page shows: what went wrong, and for which earlier drive a result is."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from typing import NamedTuple

from softstart.drive.machine import Machine
from softstart.errors import InputError, Sentence, SimulationError
from softstart.input.parameters import Parameter
from softstart.quantities import Units, shortest
from softstart.views.numbers import cut, unit, units_of

log = logging.getLogger("softstart.page")
LONGEST = 300  # characters of an exception
NAMED = 3  # parameters named in a sentence
WORDS = ("name", "source", "assumed", "units", "gear_ratio", "gear_efficiency")  # they change no result


INTERNAL_ERROR = "Internal error in softstart, not caused by your input ({})."
FAILED_START = "The start was aborted: the strategy failed on this drive ({})."


def sentence_of(error: BaseException, otherwise: str = INTERNAL_ERROR) -> str:
    """One plain sentence for an exception: nobody who uses the page sees a traceback.

    `otherwise` is the sentence for an exception that has none of its own.

    >>> sentence_of(InputError(["gap = -1: a gap is 0 or more.", "inertia = 0: above 0."]))
    'gap = -1: a gap is 0 or more. inertia = 0: above 0.'
    >>> sentence_of(KeyError("x"))
    "Internal error in softstart, not caused by your input (KeyError: 'x')."
    """
    if isinstance(error, InputError):
        return " ".join(map(page_sentence, error.sentences))
    if isinstance(error, SimulationError):
        return page_sentence(" ".join(str(error).split()))
    if isinstance(error, MemoryError):
        return "Not enough memory."
    text = " ".join(str(error).split())
    if len(text) > LONGEST:
        text = text[:LONGEST] + " ..."
    what = f"{type(error).__name__}: {text}" if text else type(error).__name__
    log.debug("shown to the user: %s", what, exc_info=error)
    return otherwise.format(what)


def page_sentence(sentence: str) -> str:
    """A sentence with its advice for the page, which has no command line.

    >>> page_sentence(Sentence("The position is unknown.", "Give --set start.position.", page="Choose it."))
    'The position is unknown. Choose it.'
    """
    return sentence.on_page if isinstance(sentence, Sentence) else sentence


def in_words(sentence: str, labels: Mapping[str, str]) -> str:
    """A sentence with the labels of fields, by path, in place of keys.

    >>> labels = {"motor.rated_speed": "rated speed", "gear.ratio": "turns of the motor"}
    >>> in_words('[motor] rated_speed = "fast": this is not a number with a unit.', labels)
    'Rated speed "fast": this is not a number with a unit.'
    >>> in_words('gear.ratio is missing: it is needed; write for example ratio = 31.5.', labels)
    'Turns of the motor is missing: it is needed; write for example 31.5.'
    """

    def label(found: re.Match[str]) -> str:
        return labels.get(found[3] or f"{found[1]}.{found[2]}", found[0])

    text = re.sub(r"(?:\[(\w+)\] (\w+)|((?:\w+(?:\[\d+\])?\.)+\w+))(?: =)?", label, sentence)
    text = re.sub(r'write for example [\w.]+ = "?([^"]*)"?\.$', r"write for example \1.", text)
    return text[:1].upper() + text[1:]


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


def differences(machine: Machine, other: Machine) -> str:
    """How a machine differs from another one: its name, else its values; empty where both start alike.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> differences(crane.replace(gap=1.0, load_inertia=0.2), crane)
    'shaft.gap 1 rad, load.inertia 0.2 kg m\N{SUPERSCRIPT TWO}'
    """
    different = [change for change in changes(machine, other) if change.parameter.name not in WORDS]
    if different and machine.name != other.name:
        return cut(machine.name)
    units = units_of(other)
    values = [f"{change.path} {_value(change, units)}" for change in different[:NAMED]]
    return ", ".join(values) + (f" and {len(different) - NAMED} more" if len(different) > NAMED else "")


Value = float | str | tuple[float, ...] | None  # of a parameter


class Change(NamedTuple):
    """A parameter in which two machines differ."""

    path: str
    parameter: Parameter
    old: Value
    new: Value


def changes(old: Machine, new: Machine) -> list[Change]:
    """The parameters in which two machines differ; those that follow another one only where they do not."""
    before, after = old.parameters_by_path(), new.parameters_by_path()
    different = {}
    for path in dict.fromkeys([*before, *after]):
        parameter, value = before.get(path) or (after[path][0], None)
        other = after[path][1] if path in after else None
        if value != other:
            different[path] = Change(path, parameter, value, other)
    paths = {parameter.name: path for path, (parameter, _) in before.items()}

    def follows(path: str, parameter: Parameter) -> bool:
        """Whether it is, before and after, as the one that it follows by default, which has changed."""
        leader = paths.get(parameter.follows, "")
        alike = (leader in values and values[leader][1] == values[path][1] for values in (before, after))
        return leader in different and all(alike)

    return [change for change in different.values() if not follows(change.path, change.parameter)]


def _value(change: Change, units: Units) -> str:
    value, si, p = change.old, change.parameter.unit, change.parameter
    units = units if p.at_output == "value" else units.at_motor
    if value is None or isinstance(value, str):
        return value or "not given"
    shown = unit(units.of(si))
    texts = [written(float(part), si, units) for part in (value if isinstance(value, tuple) else (value,))]
    return ", ".join(texts) + (f" {shown}" if shown and " " not in texts[-1] else "")


def written(value: float, si: str, units: Units) -> str:
    """A value as a person reads it: in his unit or, in SI, in that in which it was written, with six digits.

    >>> written(0.06981317007977318, "rad", Units()), written(1.0 / 3.0, "rad", Units())
    ('4 deg', '0.333333')
    >>> written(0.06981317007977318, "rad", Units("deg")), written(0.07, "rad", Units("deg"))
    ('4', '4.0107')
    """
    if units.of(si) != si or units.gear:
        return f"{units.shown(value, si):.6g}"
    text = shortest(value, si)
    return text if " " in text else f"{value:.6g}"
