"""What an unknown name was probably meant to be: one that differs by slips of the pen, not another thing.

A suggestion that is wrong costs more than none, so there is one only where few letters differ for the length
of the name, or where it is a part of exactly one name. Words that the field has for what is called otherwise
here get a sentence.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from softstart.errors import listed

MOST = 3  # names in a suggestion
LONGEST = 60  # characters: to compare long names takes long, and nothing here has one
LETTERS_A_SLIP = 5  # one slip in so many letters is a slip, more are another word
CURVE = "docs/howto/motor-torque-over-speed.md"

# words of the field for what is called otherwise here, without spaces and punctuation
_TERMS = {
    ("stardelta", "wyedelta", "startriangle", "ydelta", "ystart"): (
        "a star-delta start is a third of the motor torque over speed until its change-over; give the torque "
        f"over time as a profile, or the motor's curve as a load curve ({CURVE})"
    ),
    ("softstarter", "softstart", "softstarting"): (
        "soft starters raise the torque over time: see ramp and s-curve"
    ),
    ("dol", "directonline", "acrosstheline", "fullvoltage"): (
        f"direct is a start with constant starting torque; for the torque over speed of a motor see {CURVE}"
    ),
    ("vf", "uf", "voltsperhertz", "vfd", "inverter", "speedramp", "scalar"): (
        "strategies here set a torque; one that follows a speed ramp is a controller of your own "
        "(docs/howto/add-a-controller.md)"
    ),
    (
        "torquespeed", "speedtorque", "torquespeedcurve", "torquecurve", "motorcurve", "torqueoverspeed",
        "breakdowntorque", "pullouttorque", "kloss",
    ): f"the torque of a motor over its speed is a load curve on the mass of its rotor, in a chain ({CURVE})",
}  # fmt: skip
TERMS = {word: sentence for words, sentence in _TERMS.items() for word in words}


# other words for a key or a choice, and the word here: it is meant only where it is valid
SYNONYMS = {
    **dict.fromkeys(("pause", "wait", "dwell"), "hold"),
    **dict.fromkeys(("brems", "bremse", "bremsen"), "brake"),
    "halt": "stop",
    "speed": "set_speed",
}


def term(name: str) -> str | None:
    """What a word of the field is called here, as the end of a sentence; None for any other word.

    >>> term("Star-Delta").split(";")[0]
    'a star-delta start is a third of the motor torque over speed until its change-over'
    """
    return TERMS.get(re.sub(r"[^a-z]", "", name.casefold().rpartition(".")[2]))


def slips(a: str, b: str, most: int) -> int:
    """How many letters were left out, put in, changed or swapped with their neighbours; at most `most` + 1.

    >>> slips("inertai", "inertia", 3), slips("compre", "compare", 3), slips("torque_speed", "noise", 3)
    (1, 1, 4)
    """
    if abs(len(a) - len(b)) > most:
        return most + 1
    before, last = [0] * (len(b) + 1), list(range(len(b) + 1))
    for i, letter in enumerate(a):
        row = [i + 1]
        for j, other in enumerate(b):
            cost = min(last[j] + (letter != other), row[j] + 1, last[j + 1] + 1)
            if i and j and letter == b[j - 1] and a[i - 1] == other:
                cost = min(cost, before[j - 1] + 1)
            row.append(cost)
        before, last = last, row
        if min(row) > most:
            return most + 1
    return min(last[-1], most + 1)


def nearest(name: str, valid: Iterable[str]) -> str | None:
    """The valid name that `name` was probably meant to be, or None; upper and lower case count as one.

    >>> nearest("RPM", ["rad/s", "rpm"]), nearest("zzz", ["rad/s", "rpm"])
    ('rpm', None)
    >>> nearest("reduced-first-stag", ["reduced-first-stage", "reduced-two-stage"])
    'reduced-first-stage'
    >>> nearest("pulse", ["direct", "pulse-coast-hold"]), nearest("star-delta", ["acceleration-delay"])
    ('pulse-coast-hold', None)
    >>> nearest("pause", ["start", "stop", "hold"])
    'hold'
    """
    if len(name) > LONGEST:
        return None
    plain, folded = name.casefold(), {one.casefold(): one for one in reversed(list(valid))}
    if (synonym := SYNONYMS.get(plain)) in folded:
        return folded[synonym]
    most = min(max(1, len(plain) // LETTERS_A_SLIP), len(plain) - 1)
    distances = {one: slips(plain, one, most) for one in folded}
    least = min(distances.values(), default=most + 1)
    if least <= most:  # of those that are as near the one that begins alike, the last in the alphabet
        near = [one for one in folded if distances[one] == least]
        return folded[max(near, key=lambda one: (one[:1] == plain[:1], one))]
    parts = wholes(name, folded.values())
    return parts[0] if len(parts) == 1 else None


def wholes(name: str, valid: Iterable[str]) -> list[str]:
    """The valid names of which this one is the beginning, or some of the words.

    >>> wholes("reduced", ["direct", "reduced-first-stage", "reduced-two-stage"])
    ['reduced-first-stage', 'reduced-two-stage']
    """

    def words(one: str) -> set[str]:
        return set(re.split(r"[^a-z0-9]+", one.casefold()))

    begins = name.casefold()
    return [
        one
        for one in valid
        if len(name) > 2 and (words(name) <= words(one) or one.casefold().startswith(begins))
    ]


def did_you_mean(
    name: str, valid: Iterable[str], before: str = "", otherwise: str = "", quote: str = ""
) -> str:
    """The end of a sentence about an unknown name: a term of the field, the nearest valid name, or all.

    `before` stands before the name, `quote` on both sides of it; `otherwise` is said where there is none, by
    default all valid names.

    >>> did_you_mean("compre", ["compare", "drives"], "softstart ")
    'did you mean softstart compare?'
    >>> did_you_mean("zzz", ["compare", "drives"])
    'there are compare and drives.'
    """
    known = list(valid)
    if (meaning := term(name)) is not None:
        return f"{meaning}."
    near = nearest(name, known)
    if meant := wholes(name, known)[:MOST] if near is None else [near]:
        return f"did you mean {' or '.join(f'{before}{quote}{one}{quote}' for one in meant)}?"
    return otherwise or f"there are {listed(known)}."
