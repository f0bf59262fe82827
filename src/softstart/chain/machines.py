"""Drives and chains alike: what tuning, sweeps and the page ask of a machine, and records of either.

A chain answers to the words of a drive: its gap is the sum of all its gaps at the motor shaft, its stiffness
that of all shafts in series, its load the load mass. Each mass and shaft has its own words besides.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softstart.chain.elements import START, TOP, Shaft
from softstart.chain.model import Chain, load_machine
from softstart.drive import PARAMETERS, Drive
from softstart.drive.checks import BROADCAST
from softstart.drive.records import Columns, Records, is_machine
from softstart.errors import InputError
from softstart.input.parameters import Parameter, Wording, read_value
from softstart.quantities import RefusedError, nearest, show

Machine = Drive | Chain
Values = dict[str, tuple[Parameter, Any]]  # by path

BY_PATH = {path: p.name for p in PARAMETERS.values() for path in (p.formerly, p.path) if path}
PART = re.compile(r"(mass|shaft)(?:\[(.+)\]\.|_(\d+)_)(\w+)")
POSITION = next(one for one in START.parameters if one.name == "position")  # a word: there are several gaps
SAME = 1e-12  # within this share two gaps are one, whatever binary makes of their sum


def one_machine(given: Machine | str | os.PathLike[str]) -> Machine:
    """The drive or chain, or that of a name or file; InputError for anything else.

    >>> one_machine("crane-4-mass").name == Chain.load("crane-4-mass").name
    True
    """
    machine = load_machine(given) if isinstance(given, str | os.PathLike) else given
    if is_machine(machine):
        return machine
    raise InputError("drive: give one Drive or Chain, the path of its file, or the name of a shipped one.")


def here(machine: Machine) -> tuple[float, float]:
    """Gap in rad, of a chain all gaps together at the motor shaft, and inertia of the load in kg m2.

    >>> here(Drive.load("crane-4amtkf"))
    (0.5, 0.175)
    """
    if isinstance(machine, Chain):
        return float(machine.at_motor_shaft().gap.sum()), machine.masses[machine.load_index].inertia
    return float(machine.gap), float(machine.load_inertia)


def moved(machine: Machine, gap: float, inertia: float, origin: Machine | None = None) -> Machine:
    """The machine with another gap and load inertia; a chain with all gaps widened alike.

    A chain whose gaps are all closed has them as its `origin`.

    >>> moved(Chain.load("crane-4-mass"), 1.0, 70.0).shafts[1].gap
    0.4
    """
    if not isinstance(machine, Chain):
        return machine.with_gap(gap, load_inertia=inertia)
    whole, load = here(machine)
    if whole == 0.0 and isinstance(origin, Chain):
        shafts = zip(machine.shafts, origin.shafts, strict=True)
        machine = replace(machine, shafts=tuple(one.replace(gap=first.gap) for one, first in shafts))
        whole = here(machine)[0]
    if whole == 0.0 < gap:
        raise InputError(f"gap = {gap!r}: the chain has no gap that could be widened; give its shafts some.")
    wider = machine.changed(gaps=_share(gap, whole))
    return wider if inertia == load else _with_part(wider, "mass", wider.load_index, "inertia", inertia)


def _share(value: float, of: float) -> float:
    """By which factor; twice is exactly twice."""
    if of == 0.0 or math.isclose(value, of, rel_tol=SAME):
        return 1.0
    return float(f"{value / of:.15g}")


def values_of(machine: Machine) -> Values:
    """All parameters of a machine by their paths, each with its value.

    >>> values_of(Chain.load("crane-4-mass"))["shaft[2].gap"][1]
    0.2
    """
    if not isinstance(machine, Chain):
        return {one.path: (one, getattr(machine, name)) for name, one in PARAMETERS.items()}
    found = {one.name: (one, getattr(machine, one.name)) for one in TOP.parameters}
    parts: list[tuple[str, Any]] = [("motor", machine.motor)] if machine.motor is not None else []
    parts += [(f"mass[{i}]", mass) for i, mass in enumerate(machine.masses, 1)]
    parts += [(f"shaft[{i}]", shaft) for i, shaft in enumerate(machine.shafts, 1)]
    for path, part in parts:
        given = part.values()
        found |= {f"{path}.{name}": (one, given[name]) for name, one in part.PARAMETERS.items()}
    start = {"load": machine.load_mass, "target_speed": machine.target_speed, "position": machine.position}
    return found | {f"start.{one.name}": (one, start[one.name]) for one in START.parameters}


# parameters by one word ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Knob:
    """A parameter of a machine that can be varied: its word in Python, what it is, and its value."""

    name: str
    parameter: Parameter
    value: Any


def knob(machine: Machine, key: str) -> Knob | None:
    """The parameter of a machine that a key names, as in a file or in Python; None where there is none.

    >>> crane = Chain.load("crane-4-mass")
    >>> [knob(crane, key).name for key in ("shaft.gap", "shaft[rotor - pinion].gap", "mass[2].inertia")]
    ['gap', 'shaft_1_gap', 'mass_2_inertia']
    >>> round(knob(crane, "gap").value, 9), knob(crane, "start.position").value
    (0.5, 'mid-gap')
    """
    name = BY_PATH.get(key, key)
    if not isinstance(machine, Chain):
        return Knob(name, PARAMETERS[name], getattr(machine, name)) if name in PARAMETERS else None
    if (part := PART.fullmatch(key)) is not None:
        kind, named, number, word = part.groups()
        index = _index(machine, kind, named or number)
        values = values_of(machine)
        path = f"{kind}[{index}].{word}"
        return Knob(f"{kind}_{index}_{word}", *values[path]) if path in values else None
    if name in SHARED:
        words = {"start_position": POSITION}
        return Knob(name, words.get(name, PARAMETERS[name]), SHARED[name][0](machine))
    if machine.motor is not None and name in machine.motor.PARAMETERS and name != "mass":
        return Knob(name, machine.motor.PARAMETERS[name], getattr(machine.motor, name))
    return None


def knobs(machine: Machine) -> Iterator[str]:
    """The keys of all parameters that can be varied, as in a file."""
    if not isinstance(machine, Chain):
        yield from BY_PATH
        return
    yield from (PARAMETERS[name].path for name in SHARED)
    yield from (path for path in values_of(machine) if path.startswith(("mass[", "shaft[", "motor.")))


def with_values(machine: Machine, values: Mapping[str, Any]) -> Machine:
    """The machine with these values, by the words of their parameters.

    >>> with_values(Chain.load("crane-4-mass"), {"gap": 1.0, "shaft_2_stiffness": 4e5}).shafts[2].gap
    0.02
    """
    if not isinstance(machine, Chain):
        return machine.with_gap(**values) if "gap" in values else machine.replace(**values)
    chain: Chain = machine
    for name, value in values.items():
        part = PART.fullmatch(name)
        if part is not None:
            kind, _, number, word = part.groups()
            chain = _with_part(chain, kind, int(number) - 1, word, value)
        elif name in SHARED:
            chain = SHARED[name][1](chain, value)
        else:
            assert chain.motor is not None
            chain = replace(chain, motor=chain.motor.replace(**{name: value}))
    return chain


def _index(chain: Chain, kind: str, named: str) -> int:
    """The number of a mass or shaft, counted from 1, by that number or by its name; 0 where there is none."""
    names = [mass.name for mass in chain.masses] if kind == "mass" else list(chain.shaft_names)
    if named in names:
        return names.index(named) + 1
    return int(named) if named.isdecimal() and int(named) <= len(names) else 0


def _with_part(chain: Chain, kind: str, index: int, word: str, value: Any) -> Chain:
    parts: list[Any] = list(chain.masses if kind == "mass" else chain.shafts)
    if word == "gap":
        own = parts[index].gap
        parts[index] = parts[index].widened(_share(value, own)) if own else parts[index].replace(gap=value)
    else:
        other = {"damping": "damping_ratio", "damping_ratio": "damping"}.get(word)
        more: dict[str, Any] = {other: None if other == "damping_ratio" else 0.0} if other else {}
        parts[index] = parts[index].replace(**{word: value}, **more)
    return replace(chain, masses=tuple(parts)) if kind == "mass" else replace(chain, shafts=tuple(parts))


def _stiffness(chain: Chain) -> float:
    """Stiffness of all shafts in series at the motor shaft; infinite where all are rigid."""
    compliance = float((1.0 / chain.at_motor_shaft().c).sum())
    return 1.0 / compliance if compliance > 0.0 else math.inf


def _stiffer(chain: Chain, value: float) -> Chain:
    factor = _share(value, _stiffness(chain))

    def scaled(shaft: Shaft) -> Shaft:
        return shaft if shaft.rigid else shaft.replace(stiffness=factor * shaft.stiffness)

    return replace(chain, shafts=tuple(map(scaled, chain.shafts)))


def _of_mass(which: str, word: str) -> tuple[Callable[[Chain], Any], Callable[[Chain, Any], Chain]]:
    """Reading and changing a quantity of the mass of the motor or of the load."""
    return (
        lambda chain: getattr(chain.masses[getattr(chain, which)], word),
        lambda chain, value: _with_part(chain, "mass", getattr(chain, which), word, value),
    )


# words that a chain shares with a drive: how they are read, and changed
SHARED: Mapping[str, tuple[Callable[[Chain], Any], Callable[[Chain, Any], Any]]] = {
    "gap": (lambda chain: here(chain)[0], lambda chain, gap: moved(chain, gap, here(chain)[1])),
    "stiffness": (_stiffness, _stiffer),
    "motor_inertia": _of_mass("motor_index", "inertia"),
    "load_inertia": _of_mass("load_index", "inertia"),
    "load_torque": _of_mass("load_index", "torque"),
    "load_kind": _of_mass("load_index", "kind"),
    "target_speed": (
        lambda chain: chain.target_speed,
        lambda chain, value: replace(chain, target_speed=value),
    ),
    "start_position": (lambda chain: chain.position, lambda chain, value: replace(chain, position=value)),
}


# many machines -------------------------------------------------------------------------------------------


def records(machine: Machine | Records | str, **fields: Any) -> Records:
    """Many machines that differ in some values, for one call of `simulate`.

    Parameters
    ----------
    machine : Drive, Chain, Records or str
        The machine that they are variants of, or its name or file; or records that are to differ in further
        values.
    **fields : numbers, texts with a unit, or lists and arrays of such
        Parameters of a drive by their names in Python, as `gap` and `load_inertia`; of a chain the same words
        (its gap is the sum of all its gaps at the motor shaft) and those of one mass or shaft, as
        `shaft_2_gap`. Arrays broadcast together; at least one is needed. Angles and torques in SI as in
        `Drive`. An angle `start_position` stays where it is when the gap changes.

    Returns
    -------
    Records
        Of the shape to which the fields broadcast.

    Raises
    ------
    InputError
        For every field that is unknown and every value that no machine can have, with its place.

    Examples
    --------
    >>> from softstart import Drive, records, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> simulate(records(crane, gap=[0.5, 2.0]), "direct").k_dyn.round(3).values.tolist()
    [3.118, 4.865]
    >>> records(crane, gap=[[0.5], [2.0]], load_inertia=["0.1 kg*m^2", 0.175]).shape
    (2, 2)

    References
    ----------
    docs/howto/python-in-a-notebook.md.
    """
    return _records(machine, fields, Columns.replace)


def varied(machine: Machine | Records, values: Mapping[str, Any]) -> Records:
    """As `records`, but the start of a drive stays where it was in its gap, see `Drive.with_gap`.

    >>> flank = Drive.load("crane-4amtkf").replace(start_position=0.25)
    >>> varied(flank, {"gap": [1.0]}).fields["start_position"]
    array([0.5])
    """
    return _records(machine, values, Columns.with_gap if "gap" in values else Columns.replace)


def _records(machine: Any, values: Mapping[str, Any], change: Callable[..., Columns]) -> Records:
    if not isinstance(machine, Records):
        machine = one_machine(machine)
        machine = Records(machine, {}, (machine,))
    whole = machine.machine
    if isinstance(whole, Chain):
        found = _chains(machine, values)
    else:
        (part,) = machine.parts
        found = Records.of(whole, change(Columns.of(part), **values))
    if not found.fields:
        raise InputError("records: all fields are single values; give a list for one, as gap=[0.5, 2.0].")
    return found


def _chains(chains: Records, values: Mapping[str, Any]) -> Records:
    """Chains that differ in these values, by the words of their parameters."""
    chain: Chain = chains.machine
    wrong, read = list[str](), dict[str, Any](chains.fields)
    for key, value in values.items():
        found = knob(chain, key)
        if found is None:
            words = [named.name for path in knobs(chain) if (named := knob(chain, path)) is not None]
            near = nearest(key, words)
            hint = f"did you mean {near}?" if near else f"its words are {', '.join(words)}."
            wrong.append(f"{key} = {show(value)}: a chain has no parameter {show(key)}; {hint}")
            continue
        try:
            read[found.name] = read_value(found.parameter, value, batch=True)
        except RefusedError as refusal:
            wording = Wording(written={found.parameter.name: key})
            wrong.append(wording.refused(found.parameter, value, refusal))
    arrays = {name: value for name, value in read.items() if isinstance(value, np.ndarray)}
    shapes = ", ".join(f"{name} has shape {value.shape}" for name, value in arrays.items())
    try:
        shape = np.broadcast_shapes(*(value.shape for value in arrays.values()))
    except ValueError:
        wrong.append(f"{shapes}: {BROADCAST}.")
    if wrong:
        raise InputError(wrong)
    fields = {name: np.broadcast_to(value, shape) for name, value in arrays.items()}
    rows = zip(*(values.ravel().tolist() for values in fields.values()), strict=True)
    each = (read | dict(zip(fields, row, strict=True)) for row in rows)
    return Records(chain, fields, tuple(with_values(chain, one) for one in each))
