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


def sentence_of(
    error: BaseException, otherwise: str = INTERNAL_ERROR, labels: Mapping[str, str] | None = None
) -> str:
    """One plain sentence for an exception: nobody who uses the page sees a traceback.

    `otherwise` is the sentence for an exception that has none of its own; `labels` of fields stand for keys.

    >>> sentence_of(InputError(["gap = -1: a gap is 0 or more.", "inertia = 0: above 0."]))
    'gap = -1: a gap is 0 or more. inertia = 0: above 0.'
    >>> sentence_of(KeyError("x"))
    "Internal error in softstart, not caused by your input (KeyError: 'x')."
    """
    if isinstance(error, InputError):
        texts = map(page_sentence, error.sentences)
        return " ".join(texts if labels is None else (in_words(one, labels) for one in texts))
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
    """A sentence with the labels of fields in place of keys: by path, or by a key that begins the sentence.

    >>> labels = {"motor.rated_speed": "rated speed", "mass[2].inertia": "inertia of fan", "time": "rise"}
    >>> in_words('[motor] rated_speed = "fast": this is not a number with a unit.', labels)
    'Rated speed "fast": this is not a number with a unit.'
    >>> in_words("[mass] 2, inertia is missing: it is needed; write for example inertia = 0.5.", labels)
    'Inertia of fan is missing: it is needed; write for example 0.5.'
    >>> in_words("time = -1: above motor.rated_speed = 3.", labels)
    'Rise -1: above rated speed 3.'
    >>> in_words('[duty] 2, do = "stop": the machine stands.', {})
    'Step 2, stop: the machine stands.'
    """

    def label(found: re.Match[str]) -> str:
        table, number, key, path = found.groups()
        named = path or (f"{table}[{number}].{key}" if number else f"{table}.{key}")
        return labels.get(named, f"step {number}, {key}" if table == "duty" and number else found[0])

    text = re.sub(r'(\[duty\] \d+, )do = "(\w+)"', r"\1\2", sentence)
    pattern = r"(?:\[(\w+)\] (?:(\d+), )?(\w+)|(\w+(?:\[\d+\])?(?:\.\w+)+))(?: =)?"
    text = re.sub(r"^(\w+)(?: =)?(?=[ :])", lambda found: labels.get(found[1], found[0]), text)
    text = re.sub(pattern, label, text)
    text = re.sub(r'write for example [\w.]+ ?= ?"?([^"]*)"?\.$', r"write for example \1.", text)
    return text[:1].upper() + text[1:]


def field_labels(machine: Machine) -> dict[str, str]:
    """What the fields of a machine are called, by path; with their part where others are called alike.

    >>> from softstart import Chain, Drive
    >>> labels = field_labels(Drive.load("crane-4amtkf"))
    >>> [labels[path] for path in ("load.inertia", "shaft.gap", "limits.shaft_torque")]
    ['load inertia', 'total gap', 'shaft torque (limits)']
    >>> field_labels(Chain.load("crane-4-mass"))["mass[2].inertia"]
    'inertia of pinion'
    """
    labels = {}
    for path, (parameter, _) in machine.parameters_by_path().items():
        table, _, number = path.partition("]")[0].partition("[")
        labels[path] = parameter.label
        if number:
            names = machine.mass_names if table == "mass" else machine.shaft_names
            labels[path] += f" of {names[int(number) - 1]}"
        elif path.startswith("limits."):
            labels[path] += " (limits)"
        elif parameter.table in ("motor", "load", "gear", "brake"):
            labels[path] = f"{parameter.table} {parameter.label}"
    return labels


def changed_since(computed: Machine, now: Machine) -> str:
    """What a result was computed for, where that is not the drive of now; empty where it is.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> changed_since(crane, crane)
    ''
    >>> changed_since(crane, crane.replace(name="the same by another name"))
    ''
    >>> changed_since(crane, crane.replace(gap=1.0))
    'For total gap 0.5 rad; the drive has changed since.'
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
    'total gap 1 rad, load inertia 0.2 kg m\N{SUPERSCRIPT TWO}'
    """
    different = [change for change in changes(machine, other) if change.parameter.name not in WORDS]
    if different and machine.name != other.name:
        return cut(machine.name)
    units = units_of(other)
    labels = field_labels(other) | field_labels(machine)
    values = [f"{labels[change.path]} {_value(change, units)}" for change in different[:NAMED]]
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
    >>> written(2980671.4, "N*m/rad", Units()), written(2.5e-7, "N*m/rad", Units())
    ('2980670', '2.5e-07')
    """
    if units.of(si) != si or units.gear:
        value = units.shown(value, si)
    elif " " in (text := shortest(value, si)):
        return text
    text = f"{value:.6g}"
    return f"{float(text):.0f}" if 1e6 <= abs(value) < 1e9 else text  # a field has no room for an exponent
