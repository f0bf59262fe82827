"""A chain while it is being reduced, at the motor shaft: what merging a partial system does to it.

The torsional centre-of-mass analogy [R] takes compliances for lengths. A mass between two springs is shared
between its neighbours by the lever rule, more to the side of the stiffer spring; a pair of masses becomes one
at its centre of mass, and the lengths of the shafts beside it grow by the pieces of its own. Inertia,
compliance and gap of the whole are kept by either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from softstart.arrays import Vector
from softstart.chain.elements import Mass, Shaft
from softstart.chain.model import Chain
from softstart.drive import ContactLaw, LoadKind

__all__ = ["Section", "Station", "Working"]


@dataclass(frozen=True)
class Station:
    """A mass: its names, inertia, damping to the ground, torque of either kind, momentum at the start."""

    names: tuple[str, ...]
    J: float
    d_ground: float
    active: float
    reactive: float
    momentum: float

    def with_share(self, other: Station, share: float) -> Station:
        """The mass with a share of another one, at the same speed."""
        return replace(
            self,
            J=self.J + share * other.J,
            d_ground=self.d_ground + share * other.d_ground,
            active=self.active + share * other.active,
            reactive=self.reactive + share * other.reactive,
            momentum=self.momentum + share * other.momentum,
        )

    def mass(self) -> Mass:
        """As a mass of a chain; torques of both kinds add up under the kind of the larger."""
        kind: LoadKind = "reactive" if abs(self.reactive) > abs(self.active) else "active"
        return Mass(
            self.J,
            name=" + ".join(self.names),
            damping=self.d_ground,
            torque=self.active + self.reactive,
            kind=kind,
            initial_speed=self.momentum / self.J,
        )


@dataclass(frozen=True)
class Section:
    """A shaft: compliance `e = 1/c`, `f = d/c^2` (what dampers in series add up), gap, start, law."""

    e: float
    f: float
    gap: float
    start: float
    efficiency: float
    law: ContactLaw

    def with_share(self, other: Section, share: float) -> Section:
        """The section lengthened by a share of another one."""
        return replace(
            self,
            e=self.e + share * other.e,
            f=self.f + share * other.f,
            gap=self.gap + share * other.gap,
            start=self.start + share * other.start,
        )

    def shaft(self) -> Shaft:
        """As a shaft of a chain."""
        return Shaft(
            1.0 / self.e,
            damping=self.f / (self.e * self.e),
            gap=self.gap,
            efficiency=self.efficiency,
            contact_law=self.law,
            start_position=self.start or None,
        )


@dataclass
class Working:
    """The stations and sections of a chain, and where motor and load are."""

    stations: list[Station]
    sections: list[Section]
    motor: int
    load: int

    @classmethod
    def of(cls, chain: Chain) -> Working:
        """The chain at the motor shaft, rigid joints as sections without compliance."""
        at = chain.at_motor_shaft()
        numbers = zip(chain.masses, at.J, at.d_ground, at.Mc, at.w0, at.reactive, strict=True)
        stations = [
            Station((m.name,), float(J), float(d), float(Mc * (not r)), float(Mc * r), float(J * w0))
            for m, J, d, Mc, w0, r in numbers
        ]
        columns = (1.0 / at.c, at.d / at.c**2, at.gap, at.theta0, at.efficiency)
        rows = zip(*(map(float, column) for column in columns), at.law, strict=True)
        sections = [Section(*row) for row in rows]
        return cls(stations, sections, chain.motor_index, chain.load_index)

    @property
    def J(self) -> Vector:
        """The inertias."""
        return np.array([station.J for station in self.stations])

    @property
    def c(self) -> Vector:
        """The stiffnesses."""
        return np.array([1.0 / section.e if section.e else math.inf for section in self.sections])

    def share_out(self, k: int) -> None:
        """Share mass k between its neighbours; its two sections become one.

        With springs c1 and c2 beside it the neighbours get `c1/(c1 + c2)` and `c2/(c1 + c2)` of it.
        """
        left, right, mass = self.sections[k - 1], self.sections[k], self.stations[k]
        to_left = right.e / (left.e + right.e)
        self.stations[k - 1] = self.stations[k - 1].with_share(mass, to_left)
        self.stations[k + 1] = self.stations[k + 1].with_share(mass, 1.0 - to_left)
        one = left.with_share(right, 1.0)
        self.sections[k - 1] = replace(one, efficiency=left.efficiency * right.efficiency)
        del self.stations[k], self.sections[k]
        self.motor -= self.motor > k
        self.load -= self.load > k

    def join(self, k: int) -> None:
        """Make one mass of masses k and k + 1, at their centre of mass; their section goes to its neighbours.

        The neighbour on the side of mass k gets `I2/(I1 + I2)` of the section, the other one the rest; at an
        end of the chain only the gap is kept, all of it, since nothing twists beyond.
        """
        first, second, section = self.stations[k], self.stations[k + 1], self.sections[k]
        to_left = second.J / (first.J + second.J)
        shares = {k - 1: to_left, k + 1: 1.0 - to_left}
        beside = {j: share for j, share in shares.items() if 0 <= j < len(self.sections)}
        for j, share in beside.items():
            grown = self.sections[j].with_share(section, share)
            if len(beside) == 1:
                gap, start = self.sections[j].gap + section.gap, self.sections[j].start + section.start
                grown = replace(grown, gap=gap, start=start)
            self.sections[j] = grown
        if beside:
            j = min(beside)
            self.sections[j] = replace(
                self.sections[j], efficiency=self.sections[j].efficiency * section.efficiency
            )
        joined = first.with_share(second, 1.0)
        self.stations[k] = replace(joined, names=first.names + second.names)
        del self.stations[k + 1], self.sections[k]
        self.motor -= self.motor > k
        self.load -= self.load > k

    def chain(self, of: Chain) -> Chain:
        """As a chain at the motor shaft, with the motor and the start of another one."""
        masses = [station.mass() for station in self.stations]
        motor = None if of.motor is None else replace(of.motor, mass=masses[self.motor].name)
        shafts = tuple(section.shaft() for section in self.sections)
        load = masses[self.load].name
        return replace(of, masses=tuple(masses), shafts=shafts, motor=motor, load_mass=load)
