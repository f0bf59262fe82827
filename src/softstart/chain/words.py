"""The words of a drive to which a chain answers, and those of its masses and shafts.

The gap of a chain is the sum of all its gaps at the motor shaft, its stiffness that of all shafts in series,
its load the load mass. Each mass and shaft has its own words besides.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Self

from softstart.chain.elements import START, TOP, Mass, Motor, Shaft
from softstart.drive import PARAMETERS
from softstart.drive.machine import Machine
from softstart.drive.model import BY_PATH
from softstart.errors import InputError
from softstart.hints import did_you_mean
from softstart.input.parameters import Parameter, ParameterValue
from softstart.quantities import show

PART = re.compile(r"(mass|shaft)(?:\[(.+)\]\.|_(\d+)_)(\w+)")
POSITION = next(one for one in START.parameters if one.name == "position")  # a word: there are several gaps
SAME = 1e-12  # within this share two gaps are one, whatever binary makes of their sum


class Words(Machine):
    """What a chain is asked and told by words, as a drive is: the base of `Chain`."""

    masses: tuple[Mass, ...]
    shafts: tuple[Shaft, ...]
    motor: Motor | None
    load_mass: str
    target_speed: float | None
    position: str

    if TYPE_CHECKING:  # of the chain

        def index(self, place: str | int) -> int: ...
        def at_motor_shaft(self) -> Any: ...
        def speed_ratios(self, reference: str | int = ...) -> tuple[float, ...]: ...

    @property
    def motor_index(self) -> int:
        """The index of the mass on which the motor acts; the first where there is no motor."""
        return 0 if self.motor is None else self.index(self.motor.mass)

    @property
    def load_index(self) -> int:
        """The index of the mass that is to reach the target speed."""
        return self.index(self.load_mass)

    @property
    def shaft_names(self) -> tuple[str, ...]:
        """Each shaft by the masses that it joins.

        >>> from softstart.chain import Chain
        >>> Chain.load("crane-4-mass").shaft_names[0]
        'rotor - pinion'
        """
        return tuple(f"{a.name} - {b.name}" for a, b in pairwise(self.masses))

    def _replaced(self, **changes: Any) -> Self:
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]

    @property
    def gap_and_inertia(self) -> tuple[float, float]:
        """All gaps together, rad at the motor shaft, and the inertia of the load mass, kg m2.

        >>> from softstart.chain import Chain
        >>> Chain.load("crane-4-mass").gap_and_inertia[1]
        69.2
        """
        return float(self.at_motor_shaft().gap.sum()), self.masses[self.load_index].inertia

    @property
    def motor_inertia_at_load(self) -> float:
        """The inertia of the motor's mass, brought to the shaft of the load, kg m2."""
        ratio = self.speed_ratios("motor")[self.load_index]
        return self.masses[self.motor_index].inertia / ratio**2

    def with_gap_and_inertia(self, gap: float, inertia: float, origin: Any = None) -> Self:
        """The chain with another gap and load inertia, all gaps widened alike.

        A chain whose gaps are all closed has them as its `origin`.

        >>> from softstart.chain import Chain
        >>> Chain.load("crane-4-mass").with_gap_and_inertia(1.0, 70.0).shafts[1].gap
        0.4
        """
        chain, (whole, load) = self, self.gap_and_inertia
        if whole == 0.0 and origin is not None:
            shafts = zip(self.shafts, origin.shafts, strict=True)
            chain = self._replaced(shafts=tuple(one.replace(gap=first.gap) for one, first in shafts))
            whole = chain.gap_and_inertia[0]
        if whole == 0.0 < gap:
            raise InputError(
                f"gap = {gap!r}: the chain has no gap that could be widened; give its shafts some."
            )
        wider = chain.scaled(gaps=_share(gap, whole))
        return wider if inertia == load else wider._with_part("mass", wider.load_index, "inertia", inertia)

    def scaled(self, gaps: float = 1.0, load_inertia: float = 1.0) -> Self:
        """The chain with so many times its gaps, and its load mass with so many times its inertia.

        An angle in a gap keeps its share of it, one beyond a flank its overlap.

        >>> from softstart.chain import Chain
        >>> Chain.load("crane-4-mass").scaled(gaps=4.0).shafts[1].gap
        0.8
        """
        load = self.load_index
        masses = [
            mass.replace(inertia=load_inertia * mass.inertia) if i == load else mass
            for i, mass in enumerate(self.masses)
        ]
        return self._replaced(masses=tuple(masses), shafts=tuple(one.widened(gaps) for one in self.shafts))

    def parameters_by_path(self) -> dict[str, tuple[Parameter, Any]]:
        """All parameters by their paths, each with its value.

        >>> from softstart.chain import Chain
        >>> Chain.load("crane-4-mass").parameters_by_path()["shaft[2].gap"][1]
        0.2
        """
        found = {one.name: (one, getattr(self, one.name)) for one in TOP.parameters}
        parts: list[tuple[str, Any]] = [("motor", self.motor)] if self.motor is not None else []
        parts += [(f"mass[{i}]", mass) for i, mass in enumerate(self.masses, 1)]
        parts += [(f"shaft[{i}]", shaft) for i, shaft in enumerate(self.shafts, 1)]
        for path, part in parts:
            given = part.values()
            found |= {f"{path}.{name}": (one, given[name]) for name, one in part.PARAMETERS.items()}
        start = {"load": self.load_mass, "target_speed": self.target_speed, "position": self.position}
        return found | {f"start.{one.name}": (one, start[one.name]) for one in START.parameters}

    def parameter_value(self, key: str) -> ParameterValue | None:
        """The parameter that a key names, as in a file or in Python; None where there is none.

        >>> from softstart.chain import Chain
        >>> crane = Chain.load("crane-4-mass")
        >>> keys = ("shaft.gap", "shaft[rotor - pinion].gap", "mass[2].inertia")
        >>> [crane.parameter_value(key).name for key in keys]
        ['gap', 'shaft_1_gap', 'mass_2_inertia']
        >>> round(crane.parameter_value("gap").value, 9), crane.parameter_value("start.position").value
        (0.5, 'mid-gap')
        """
        name = BY_PATH.get(key, key)
        if (part := PART.fullmatch(key)) is not None:
            kind, named, number, word = part.groups()
            index = self._number(kind, named or number)
            values = self.parameters_by_path()
            path = f"{kind}[{index}].{word}"
            return ParameterValue(f"{kind}_{index}_{word}", *values[path]) if path in values else None
        if name in SHARED:
            words = {"start_position": POSITION}
            return ParameterValue(name, words.get(name, PARAMETERS[name]), SHARED[name][0](self))
        if self.motor is not None and name in self.motor.PARAMETERS and name != "mass":
            return ParameterValue(name, self.motor.PARAMETERS[name], getattr(self.motor, name))
        return None

    def parameter_keys(self) -> Iterator[str]:
        """The keys of all parameters that can be varied, as in a file."""
        yield from (PARAMETERS[name].path for name in SHARED)
        yield from (
            path for path in self.parameters_by_path() if path.startswith(("mass[", "shaft[", "motor."))
        )

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """The chain with these values, by the words of their parameters, as in a file or in Python.

        >>> from softstart.chain import Chain
        >>> Chain.load("crane-4-mass").with_values({"gap": 1.0, "shaft[2].stiffness": 4e5}).shafts[2].gap
        0.02
        """
        chain, of_motor, wrong = self, {}, []
        for key, value in values.items():
            if (found := chain.parameter_value(key)) is None:
                wrong.append(chain.no_such(key, value))
                continue
            name = found.name
            if (part := PART.fullmatch(name)) is not None:
                kind, _, number, word = part.groups()
                chain = chain._with_part(kind, int(number) - 1, word, value)
            elif name in SHARED:
                chain = SHARED[name][1](chain, value)
            else:
                of_motor[name] = value
        if wrong:
            raise InputError(wrong)
        if chain.motor is None or not of_motor:
            return chain
        return chain._replaced(motor=chain.motor.replace(**of_motor))  # at once: one bounds the other

    def no_such(self, key: str, value: object) -> str:
        """The sentence on a key that names no parameter."""
        words = [
            named.name for path in self.parameter_keys() if (named := self.parameter_value(path)) is not None
        ]
        hint = did_you_mean(
            key, [*self.parameter_keys(), *words], otherwise=f"its words are {', '.join(words)}."
        )
        return f"{key} = {show(value)}: a chain has no parameter {show(key)}; {hint}"

    def _number(self, kind: str, named: str) -> int:
        """The number of a mass or shaft, from 1, by that number or by its name; 0 where there is none."""
        names = [mass.name for mass in self.masses] if kind == "mass" else list(self.shaft_names)
        if named in names:
            return names.index(named) + 1
        return int(named) if named.isdecimal() and int(named) <= len(names) else 0

    def _with_part(self, kind: str, index: int, word: str, value: Any) -> Self:
        parts: list[Any] = list(self.masses if kind == "mass" else self.shafts)
        if word == "gap":
            own = parts[index].gap
            parts[index] = (
                parts[index].widened(_share(value, own)) if own else parts[index].replace(gap=value)
            )
        else:
            other = {"damping": "damping_ratio", "damping_ratio": "damping"}.get(word)
            more: dict[str, Any] = {other: None if other == "damping_ratio" else 0.0} if other else {}
            parts[index] = parts[index].replace(**{word: value}, **more)
        return self._replaced(**{"masses" if kind == "mass" else "shafts": tuple(parts)})


def _share(value: float, of: float) -> float:
    """By which factor; twice is exactly twice."""
    if of == 0.0 or math.isclose(value, of, rel_tol=SAME):
        return 1.0
    return float(f"{value / of:.15g}")


Word = tuple[Callable[[Any], Any], Callable[[Any, Any], Any]]  # how it is read, and changed


def _stiffness(chain: Words) -> float:
    """Stiffness of all shafts in series at the motor shaft; infinite where all are rigid."""
    compliance = float((1.0 / chain.at_motor_shaft().c).sum())
    return 1.0 / compliance if compliance > 0.0 else math.inf


def _stiffer(chain: Words, value: float) -> Words:
    factor = _share(value, _stiffness(chain))

    def scaled(shaft: Shaft) -> Shaft:
        return shaft if shaft.rigid else shaft.replace(stiffness=factor * shaft.stiffness)

    return chain._replaced(shafts=tuple(map(scaled, chain.shafts)))


def _of_mass(which: str, word: str) -> Word:
    """Reading and changing a quantity of the mass of the motor or of the load."""
    return (
        lambda chain: getattr(chain.masses[getattr(chain, which)], word),
        lambda chain, value: chain._with_part("mass", getattr(chain, which), word, value),
    )


# words that a chain shares with a drive
SHARED: Mapping[str, Word] = {
    "gap": (
        lambda chain: chain.gap_and_inertia[0],
        lambda chain, gap: chain.with_gap_and_inertia(gap, chain.gap_and_inertia[1]),
    ),
    "stiffness": (_stiffness, _stiffer),
    "motor_inertia": _of_mass("motor_index", "inertia"),
    "load_inertia": _of_mass("load_index", "inertia"),
    "load_torque": _of_mass("load_index", "torque"),
    "load_kind": _of_mass("load_index", "kind"),
    "target_speed": (
        lambda chain: chain.target_speed,
        lambda chain, value: chain._replaced(target_speed=value),
    ),
    "start_position": (lambda chain: chain.position, lambda chain, value: chain._replaced(position=value)),
}
