"""What the values of a data sheet say against one another."""

from __future__ import annotations

import math
from collections.abc import Iterator

from softstart.drive.data_sheet_mechanics import slope_sine, stiffnesses
from softstart.drive.data_sheet_values import SheetValues
from softstart.drive.data_sheet_words import ABOUT, INSTEAD, NEEDED
from softstart.input.gear import Gear

TWICE = {
    "rope_length": "how stiff the rope is", "radius": "how large the wheel or drum is",
    "rise": "how steep the track is",
}  # fmt: skip


def contradictions(sheet: SheetValues) -> Iterator[str]:
    """What is missing for this machine, what contradicts something else, and what stands alone."""
    given, of = sheet.given(), sheet.PARAMETERS
    for name in NEEDED[sheet.machine]:
        if not getattr(sheet, name) and not (name == "diameter" and sheet.radius):
            p, instead = of[name], ", or [load] radius" if name == "diameter" else ""
            yield (
                f"{p.place} is missing: a {sheet.machine} needs the {p.meaning}; "
                f"write for example {p.key} = {p.example}{instead}."
            )
    for name, machines in ABOUT.items():
        if name in given and sheet.machine not in machines:
            yield (
                f"{of[name].place} is for a {' or '.join(machines)}, and this is a {sheet.machine}; "
                "leave it out."
            )
    for one, other in (
        ("coupling_play", "coupling_diameter"), ("output_play", "play_diameter"),
        ("shaft_length", "shaft_diameter"), ("shaft_diameter", "shaft_length"),
        ("rope_length", "rope_diameter"), ("rope_diameter", "rope_length"),
        ("rope_modulus", "rope_diameter"), ("rise", "length"), ("length", "rise"),
    ):  # fmt: skip
        if given.get(one) and not given.get(other):
            p, q = of[one], of[other]
            yield f"{p.place} says nothing without {q.place}; write for example {q.key} = {q.example}."
    for name in ("starting_ratio", "maximum_ratio", "efficiency"):
        p, value, usual = of[name], given.get(name), "0.1 or more" if name == "efficiency" else "below 10"
        if value is not None and (value < 0.1 if name == "efficiency" else value >= 10.0):
            yield (
                f"{p.place} is read as {value:.5g}, where the {p.meaning} is {usual}; write for example "
                f'{p.example} or "{100.0 * float(p.example):g} %".'
            )
    yield from _load_in_doubt(sheet)
    yield from _given_twice(sheet)
    parts = stiffnesses(sheet, Gear(1.0)) if sheet.elastic_frequency is not None else {}
    if parts:
        yield (
            f"{of['elastic_frequency'].place} says how stiff all parts are together, and "
            f"{', '.join(parts)} are given as well; leave out the one or the others."
        )


def _load_in_doubt(sheet: SheetValues) -> Iterator[str]:
    """What of the load would mean something else than what it says."""
    given, of = sheet.given(), sheet.PARAMETERS
    if sheet.active_torque and sheet.machine != "hoist" and "friction" not in given:
        yield (
            f"{of['active_torque'].place} = {sheet.active_torque:.5g} N*m: does it act always, as a lift, "
            "wind or an imbalance, or only against the motion? If always, write friction = 0 as well, or "
            f"what friction there is; if it is friction, write it as {of['friction'].place}."
        )
    if sheet.rise and sheet.length and abs(sheet.rise) >= sheet.length:
        yield (
            f"{of['rise'].place} = {sheet.rise:.5g} m: a track of {sheet.length:.5g} m cannot rise so far; "
            "give the length along the slope."
        )
    if abs(sheet.slope) >= 0.5 * math.pi:
        yield f"{of['slope'].place} = {sheet.slope:.5g} rad: a slope is below 90 deg; check the unit."
    if "goods" in given and not slope_sine(sheet):
        yield f"{of['goods'].place} says nothing without a slope; give slope, or rise and length."
    if sheet.goods is not None and sheet.mass is not None and sheet.goods > sheet.mass:
        yield (
            f"{of['goods'].place} = {sheet.goods:.5g} kg is more than {of['mass'].place} = "
            f"{sheet.mass:.5g} kg, of which it is a part."
        )


def _given_twice(sheet: SheetValues) -> Iterator[str]:
    """Pairs of values that say the same thing, and not the same value."""
    given, of, rated = sheet.given(), sheet.PARAMETERS, sheet.rated
    for name, other in INSTEAD.items():
        if not {name, other} <= given.keys():
            continue
        if name in TWICE:
            yield f"{of[other].place} and {of[name].place} both say {TWICE[name]}; leave one out."
            continue
        first = given[name] * (sheet.rated_speed if name == "rated_torque" else rated or math.nan)
        if abs(first - given[other]) > 0.05 * given[other]:
            p, q = of[name], of[other]
            yield (
                f"{p.place} = {given[name]:.5g} and {q.place} = {given[other]:.5g} {q.unit} contradict "
                f"each other: the first makes {first:.5g} {q.unit}; leave one out."
            )
