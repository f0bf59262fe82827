"""Free vibration of a chain with its gaps closed: frequencies, shapes, nodes, Holzer tables.

The mass-normalised stiffness of a chain is B'B with B bidiagonal, one row a shaft, so the elastic
frequencies are the singular values of B, and the rigid one, exactly 0, is not computed at all: B has one row
less than columns. They are bisected on the tridiagonal matrix of Golub and Kahan, whose eigenvalues they and
their negatives are, and whose counts of eigenvalues are right to the last bits of the smallest (J. Demmel,
W. Kahan, SIAM J. Sci. Stat. Comput. 11 (1990) 873-912, doi:10.1137/0911052); the usual eigensolvers keep the
digits of the largest only.

A shape is two Holzer tables, one from each end, that meet at the mass where they fit best: the twisted
factorisation of I. S. Dhillon, B. N. Parlett, Linear Algebra Appl. 387 (2004) 1-28,
doi:10.1016/j.laa.2003.12.028.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector, plain_fields
from softstart.chain.model import Chain, ChainArrays
from softstart.errors import InputError
from softstart.late import late

if TYPE_CHECKING:
    from matplotlib.figure import Figure

views = late("softstart.views.chains")


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
        """The partial systems, highest frequency first: see `softstart.chain.vibration`."""
        return partial_systems(self.chain)

    def plot(self, modes: int = 3) -> Figure:
        """The lowest elastic shapes with their nodes."""
        figure: Figure = views.shapes_figure(self, modes)
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
    """Frequencies and shapes of the chain with its gaps closed, undamped.

    Parameters
    ----------
    chain : Chain
        A chain of N masses; a motor is not needed.

    Returns
    -------
    Vibration
        At the motor shaft: `Omega` in rad/s, one for each mode, and `shape`, a row of N amplitudes for each
        mode. A rigid joint makes one body of its two masses, and one mode less.

    Raises
    ------
    InputError
        If every joint of the chain is rigid, so that nothing vibrates.

    Examples
    --------
    >>> natural_vibration(Chain.load("crane-4-mass")).Omega.round(1)
    array([   0. ,  114.6,  618.5, 1630.3])

    References
    ----------
    [R]; docs/theory/reduction.md.
    J. Demmel, W. Kahan, SIAM J. Sci. Stat. Comput. 11 (1990) 873-912, doi:10.1137/0911052: frequencies.
    I. S. Dhillon, B. N. Parlett, Linear Algebra Appl. 387 (2004) 1-28, doi:10.1016/j.laa.2003.12.028: shapes.
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
    J = _all_finite(chain.at_motor_shaft())
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


@dataclass(frozen=True, eq=False)
class Closed:
    """The chain with all gaps closed, at the motor shaft: what vibrates linearly.

    `body[k]` is the body to which mass k belongs; `shaft[b]` the shaft that joins body b and b + 1.
    """

    J: Vector
    c: Vector
    body: NDArray[np.intp]
    shaft: NDArray[np.intp]


def closed(arrays: ChainArrays) -> Closed:
    """Join what rigid shafts hold together. A rigid gap counts as closed, like an elastic one.

    >>> from softstart.chain import Chain, Mass, Shaft
    >>> chain = Chain([Mass(1), Mass(2), Mass(3)], [Shaft(gap=0.1, restitution=1), Shaft(5)])
    >>> closed(chain.at_motor_shaft()).J
    array([3., 3.])
    """
    body = np.concatenate([[0], np.cumsum(~arrays.rigid)])
    shaft = np.flatnonzero(~arrays.rigid)
    if shaft.size == 0:
        raise InputError("shaft: every joint of the chain is rigid, so nothing vibrates; give a stiffness.")
    J = np.zeros(shaft.size + 1)
    np.add.at(J, body, _all_finite(arrays))
    return Closed(J, arrays.c[shaft], body, shaft)


def _all_finite(arrays: ChainArrays) -> Vector:
    """The inertias; that of a mass at rest is so large that its motion is below rounding."""
    return np.where(np.isinf(arrays.J), AT_REST * arrays.moving_J.sum(), arrays.J)


AT_REST = 1e18  # times the inertia of all others
Kind = Literal["mass", "pair"]


@dataclass(frozen=True)
class PartialSystem:
    """One partial system: its kind, the names of its masses, and its frequency `Omega` in rad/s."""

    kind: Kind
    masses: tuple[str, ...]
    Omega: float

    def summary(self) -> dict[str, Any]:
        """The same as plain data."""
        return plain_fields(self)


def squared_frequencies(J: Vector, c: Vector) -> tuple[Vector, Vector]:
    """`Omega^2` of the masses (NaN at the ends, which have one spring) and of the pairs.

    >>> squared_frequencies(np.array([1.0, 2.0, 3.0]), np.array([6.0, 4.0]))
    (array([nan,  5., nan]), array([9.        , 3.33333333]))
    """
    of_mass = np.full(J.size, np.nan)
    of_mass[1:-1] = (c[:-1] + c[1:]) / J[1:-1]
    return of_mass, c / J[:-1] + c / J[1:]


def partial_systems(chain: Chain) -> tuple[PartialSystem, ...]:
    """All partial systems of the chain with its gaps closed, the highest frequency first.

    >>> [round(system.Omega) for system in partial_systems(Chain.load("crane-4-mass"))]
    [1581, 1459, 866, 649, 418]
    """
    body = closed(chain.at_motor_shaft())
    names: list[str] = ["" for _ in body.J]
    for mass, b in zip(chain.masses, body.body, strict=True):
        names[b] = f"{names[b]} + {mass.name}" if names[b] else mass.name
    of_mass, of_pair = squared_frequencies(body.J, body.c)
    systems = [
        PartialSystem("mass", (names[k],), float(of_mass[k]) ** 0.5) for k in range(1, body.J.size - 1)
    ]
    systems += [
        PartialSystem("pair", (names[k], names[k + 1]), float(of_pair[k]) ** 0.5) for k in range(body.c.size)
    ]
    return tuple(sorted(systems, key=lambda system: -system.Omega))


_compiled: Any = numba.njit(cache=True, error_model="numpy")
_TINY = float(np.finfo(np.float64).tiny)


def elastic_frequencies(J: Vector, c: Vector) -> Vector:
    """The elastic frequencies in rad/s, ascending, of the inertias `J` and the stiffnesses `c` between them.

    >>> import numpy as np
    >>> elastic_frequencies(np.array([0.035, 0.175]), np.array([368.465])).round(6)
    array([112.397])
    """
    found: Vector = _bisected(np.ascontiguousarray(J), np.ascontiguousarray(c))
    return found


def shapes(J: Vector, c: Vector, omega: Vector) -> Vector:
    """The shapes at the elastic frequencies `omega`, one row each: amplitudes of the masses, largest one 1.

    >>> import numpy as np
    >>> J, c = np.array([1.0, 3.0]), np.array([3.0])
    >>> shapes(J, c, elastic_frequencies(J, c)).round(12)
    array([[ 1.        , -0.33333333]])
    """
    found: Vector = _twisted(np.ascontiguousarray(J), np.ascontiguousarray(c), np.ascontiguousarray(omega))
    return found


@_compiled
def _bisected(J: Vector, c: Vector) -> Vector:
    """All brackets halved side by side: a frequency has i others below it, counted by negative pivots."""
    n = c.size
    squares = np.empty(2 * n)
    squares[0::2] = c / J[:-1]
    squares[1::2] = c / J[1:]
    low, high = np.full(n, math.sqrt(_TINY)), np.full(n, 2.1 * math.sqrt(squares.max()))
    middle, pivot, negative = np.empty(n), np.empty(n), np.empty(n, np.int64)
    going = True
    while going:
        going = False
        for i in range(n):
            a, b = low[i], high[i]
            middle[i] = 0.5 * (a + b) if b < 4.0 * a else math.sqrt(a) * math.sqrt(b)
            going = going or a < middle[i] < b
            pivot[i], negative[i] = -middle[i], 1
        for k in range(2 * n):
            for i in range(n):
                p = -middle[i] - squares[k] / pivot[i]
                p = p if p != 0.0 else -_TINY
                negative[i] += 1 if p < 0.0 else 0
                pivot[i] = p
        for i in range(n):
            if negative[i] - n - 1 <= i:
                low[i] = middle[i]
            else:
                high[i] = middle[i]
    return 0.5 * (low + high)


@_compiled
def _twisted(J: Vector, c: Vector, omega: Vector) -> Vector:
    n = J.size
    found = np.zeros((omega.size, n))
    # the torque before a mass per its amplitude, and the amplitude of the next mass over that of the last
    before, behind = np.zeros(n), np.zeros(n)
    forth, back = np.ones(n), np.ones(n)
    for i in range(omega.size):
        square = omega[i] * omega[i]
        for k in range(n - 1):
            through = before[k] + square * J[k]
            step = 1.0 - through / c[k]
            forth[k + 1] = step if step != 0.0 else 1e-30
            before[k + 1] = through / forth[k + 1]
        for k in range(n - 1, 0, -1):
            through = behind[k] + square * J[k]
            step = 1.0 - through / c[k - 1]
            back[k - 1] = step if step != 0.0 else 1e-30
            behind[k - 1] = through / back[k - 1]
        meet, least = 0, math.inf
        for k in range(n):
            misfit = abs(square * J[k] + before[k] + behind[k]) / J[k]
            if misfit < least:
                meet, least = k, misfit
        found[i, meet] = 1.0
        for k in range(meet, 0, -1):
            found[i, k - 1] = found[i, k] / forth[k]
        for k in range(meet, n - 1):
            found[i, k + 1] = found[i, k] / back[k]
        largest = 0.0
        for k in range(n):
            if abs(found[i, k]) > abs(largest):
                largest = found[i, k]
        found[i] /= largest
    return found
