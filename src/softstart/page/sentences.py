"""Sentences that the page shows: what went wrong, and for which earlier drive a result is."""

from __future__ import annotations

import logging
from typing import Any

from softstart.drive import PARAMETERS, Drive
from softstart.errors import InputError, SimulationError
from softstart.input.parameters import Parameter
from softstart.quantities import shortest

log = logging.getLogger("softstart.page")
LONGEST = 300  # letters of an exception
LONGEST_NAME = 60  # letters of a name in a sentence
NAMED = 3  # parameters named in a sentence
WORDS = ("name", "source")  # they change no result


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
        return " ".join(error.sentences)
    if isinstance(error, SimulationError):
        return " ".join(str(error).split())
    if isinstance(error, MemoryError):
        return "There is not enough memory for this."
    text = " ".join(str(error).split())
    if len(text) > LONGEST:
        text = text[:LONGEST] + " ..."
    what = f"{type(error).__name__}: {text}" if text else type(error).__name__
    log.debug("told the user: %s", what, exc_info=error)
    return otherwise.format(what)


def clipped(name: str) -> str:
    """A name short enough to stand in a sentence.

    >>> clipped("Crane"), len(clipped("Crane " * 100))
    ('Crane', 60)
    """
    return name if len(name) <= LONGEST_NAME else name[: LONGEST_NAME - 1] + "\N{HORIZONTAL ELLIPSIS}"


def changed_since(computed: Drive, now: Drive) -> str:
    """What a result was computed for, where that is not the drive of now; empty where it is.

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


def differences(drive: Drive, other: Drive) -> str:
    """What tells a drive from another one: its name, else its values; empty where both start alike.

    >>> crane = Drive.load("crane-4amtkf")
    >>> differences(crane.replace(gap=1.0, load_inertia=0.2), crane)
    'shaft.gap 1 rad, load.inertia 0.2 kg m2'
    """
    changed = [p for p in changes(drive, other) if p.name not in WORDS]
    if changed and drive.name != other.name:
        return clipped(drive.name)
    named = ", ".join(f"{p.path} {_value(p, getattr(drive, p.name))}" for p in changed[:NAMED])
    return named + (f" and {len(changed) - NAMED} more" if len(changed) > NAMED else "")


def changes(old: Drive, new: Drive) -> list[Parameter]:
    """The parameters in which two drives differ; those that follow another one only where they do not."""
    differing = [p for p in PARAMETERS.values() if getattr(old, p.name) != getattr(new, p.name)]
    names = {p.name for p in differing}
    return [
        p for p in differing
        if not (p.follows in names and all(getattr(d, p.name) == getattr(d, p.follows) for d in (old, new)))
    ]  # fmt: skip


def _value(parameter: Parameter, value: Any) -> str:
    if value is None:
        return "not given"
    if isinstance(value, str):
        return value
    unit = "" if parameter.unit in ("", "1") else " " + parameter.unit.replace("*", " ").replace("^", "")
    texts = [written(float(one), parameter.unit) for one in (value if isinstance(value, tuple) else (value,))]
    return ", ".join(texts) + ("" if " " in texts[-1] else unit)


def written(value: float, unit: str) -> str:
    """A value as a person reads it: in the unit in which it was written, else six digits in SI.

    >>> written(0.06981317007977318, "rad"), written(0.07, "rad"), written(1.0 / 3.0, "rad")
    ('4 deg', '0.07', '0.333333')
    """
    text = shortest(value, unit)
    return text if " " in text else f"{value:.6g}"
