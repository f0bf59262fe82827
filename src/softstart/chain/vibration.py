"""Free vibration of a chain with its gaps closed: frequencies, shapes, nodes, Holzer tables."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softstart.chain.frequencies import elastic_frequencies, shapes
from softstart.chain.joints import Closed, closed
from softstart.chain.model import Chain
from softstart.chain.partial import PartialSystem, partial_systems

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["HolzerRow", "Node", "Vibration", "natural_vibration"]

Vector = NDArray[np.float64]


class Node(NamedTuple):
    """A place that stays at rest: `share` of the twist of shaft `shaft` lies before it (0 at the mass)."""

    shaft: int
    share: float


class HolzerRow(NamedTuple):
    """A line of a Holzer table at the motor shaft; shape 1 at the first mass, torques in N m per rad of it.

    `inertia_torque` is J Omega^2 times the shape, `sum` that of all masses so far, which the shaft behind
    the mass carries; `stiffness` and `twist` are those of that shaft (NaN behind the last mass).
    """

    mass: str
    inertia: float
    shape: float
    inertia_torque: float
    sum: float
    stiffness: float
    twist: float


@dataclass(frozen=True, eq=False)
class Vibration:
    """Natural vibration of a chain, in SI at the motor shaft, gaps closed, undamped.

    `Omega[m]` is the frequency of mode m in rad/s; mode 0 is the rigid one, exactly 0. `shape[m]` are the
    amplitudes of the masses, the largest 1. `torque[m]` are the torques of the shafts in N m per rad of that.
    Frequencies are right to about 1e-14 of themselves. Modes closer to one another than about 1e-9 are told
    apart in frequency, but their shapes are any two of the same plane.
    """

    chain: Chain
    closed: Closed
    Omega: Vector
    shape: Vector
    torque: Vector

    @property
    def frequency(self) -> Vector:
        """The frequencies in Hz."""
        return self.Omega / (2.0 * math.pi)

    def own_shape(self, mode: int) -> Vector:
        """The amplitudes of the masses on their own shafts, in the scale of `shape`."""
        return self.shape[mode] * np.array(self.chain.speed_ratios(self.chain.motor_index))

    @cached_property
    def nodes(self) -> tuple[tuple[Node, ...], ...]:
        """The nodes of each mode: mode m has m of them; the twist of a shaft is shared evenly along it.

        >>> natural_vibration(Chain.load("crane-4-mass")).nodes[1]
        (Node(shaft=2, share=0.699...),)
        """
        return tuple(_nodes(shape) for shape in self.shape)

    def holzer(self, mode: int) -> tuple[HolzerRow, ...]:
        """The Holzer table of a mode; the last sum is what is left of the torques, 0 but for rounding.

        >>> [round(row.sum, 3) for row in natural_vibration(Chain.load("crane-4-mass")).holzer(1)]
        [407.409, 431.016, 455.573, -0.0]
        """
        arrays = self.chain.at_motor_shaft()
        shape = self.shape[mode] / self.shape[mode, 0]
        torques = arrays.J * self.Omega[mode] ** 2 * shape
        sums = np.cumsum(torques)
        c = [*arrays.c, math.nan]
        twists = [*(shape[:-1] - shape[1:]), math.nan]
        names = [mass.name for mass in self.chain.masses]
        columns = (arrays.J, shape, torques, sums, c, twists)
        numbers = (map(float, column) for column in columns)
        return tuple(HolzerRow(*row) for row in zip(names, *numbers, strict=True))

    @cached_property
    def partial_systems(self) -> tuple[PartialSystem, ...]:
        """The partial systems, highest frequency first: see `softstart.chain.partial`."""
        return partial_systems(self.chain)

    def plot(self, modes: int = 3) -> Figure:
        """The lowest elastic shapes with their nodes."""
        from softstart.chain.pictures import shapes_figure

        figure: Figure = shapes_figure(self, modes)
        return figure

    def summary(self) -> dict[str, Any]:
        """The frequencies, shapes, nodes and partial systems as plain data."""
        masses = [mass.name for mass in self.chain.masses]
        modes = [
            {
                "Omega": float(self.Omega[m]),
                "frequency": float(self.frequency[m]),
                "shape": [float(x) for x in self.shape[m]],
                "torque": [float(x) for x in self.torque[m]],
                "nodes": [
                    {"between": masses[n.shaft : n.shaft + 2], "share": n.share} for n in self.nodes[m]
                ],
            }
            for m in range(self.Omega.size)
        ]
        return {
            "chain": self.chain.name,
            "assumed": self.chain.assumed,
            "masses": masses,
            "modes": modes,
            "partial_systems": [system.summary() for system in self.partial_systems],
        }


def natural_vibration(chain: Chain) -> Vibration:
    """Frequencies and shapes of the chain with its gaps closed.

    >>> natural_vibration(Chain.load("crane-4-mass")).Omega.round(1)
    array([   0. ,  114.6,  618.5, 1630.3])
    """
    body = closed(chain.at_motor_shaft())
    elastic = elastic_frequencies(body.J, body.c)
    shape = np.vstack([np.ones(body.J.size), shapes(body.J, body.c, elastic)])
    Omega = np.concatenate([[0.0], elastic])
    # the sum of the inertia torques from the nearer end, not a small difference of amplitudes
    inertial = body.J * Omega[:, None] ** 2 * shape
    torque = np.cumsum(inertial, axis=1)[:, :-1]
    from_end = -np.cumsum(inertial[:, ::-1], axis=1)[:, -2::-1]
    smaller = np.cumsum(np.abs(inertial), axis=1)[:, :-1]
    larger = np.cumsum(np.abs(inertial[:, ::-1]), axis=1)[:, -2::-1]
    of_body = np.where(smaller <= larger, torque, from_end)
    at_joint = _torque_of_joints(chain, body, Omega, shape, of_body)
    return Vibration(chain, body, Omega, shape[:, body.body], at_joint)


def _torque_of_joints(chain: Chain, body: Closed, Omega: Vector, shape: Vector, of_body: Vector) -> Vector:
    """The torque in every shaft; one that is rigid carries what the masses of its body before it leave."""
    J = chain.at_motor_shaft().J
    torque = np.empty((Omega.size, J.size - 1))
    for k in range(J.size - 1):
        b = body.body[k]
        entering = of_body[:, b - 1] if b > 0 else np.zeros(Omega.size)
        first = int(np.searchsorted(body.body, b))
        torque[:, k] = entering + J[first : k + 1].sum() * Omega**2 * shape[:, b]
    torque[:, body.shaft] = of_body
    return torque


def _nodes(shape: Vector) -> tuple[Node, ...]:
    found = []
    for k in range(shape.size - 1):
        here, there = float(shape[k]), float(shape[k + 1])
        if here == 0.0:
            found.append(Node(k, 0.0))
        elif here * there < 0.0:
            found.append(Node(k, here / (here - there)))
    return tuple(found)
