"""A torque profile as a vector of unknowns: the levels and edges of a staircase, or of two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from softstart.controller import make_controller
from softstart.controller.base import CompiledController
from softstart.drive import Drive
from softstart.profile import TorqueProfile, Vector

Matrix = NDArray[np.float64]

LEVEL_PROBE, EDGE_PROBE = 1e-3, 1e-7  # N m, s


@dataclass(frozen=True, eq=False)
class Staircase:
    """Torque `levels[i]` from `edges[i]` to `edges[i + 1]`, the last one from then on.

    `edges` (s, the first is 0) and `levels` (N m) have the same length. `contact` is a second staircase on a
    clock that starts with the first contact, or None for a profile that does not react.
    """

    edges: Vector
    levels: Vector
    contact: Staircase | None = None

    @property
    def parts(self) -> tuple[Staircase, ...]:
        """The staircase itself and the one after contact, if there is one."""
        return (self,) if self.contact is None else (self, self.contact)

    @property
    def unknowns(self) -> Vector:
        """All levels, then all edges but the first: of the first part, then of the second."""
        parts = self.parts
        return np.concatenate([*(p.levels for p in parts), *(p.edges[1:] for p in parts)])

    @property
    def n_levels(self) -> int:
        """How many of the unknowns are levels."""
        return sum(p.levels.size for p in self.parts)

    @property
    def begins(self) -> Vector:
        """Where each level begins, s on the clock of its part."""
        return np.concatenate([p.edges for p in self.parts])

    @property
    def after_contact(self) -> NDArray[np.bool_]:
        """For each level, whether it belongs to the second part."""
        return np.concatenate([np.full(p.levels.size, i == 1) for i, p in enumerate(self.parts)])

    def with_unknowns(self, values: Vector) -> Staircase:
        """The staircase whose unknowns are `values`."""
        n, first = self.n_levels, self.levels.size
        if self.contact is None:
            return Staircase(np.concatenate([[0.0], values[n:]]), values[:n].copy())
        middle = n + first - 1
        contact = Staircase(np.concatenate([[0.0], values[middle:]]), values[first:n].copy())
        return Staircase(np.concatenate([[0.0], values[n:middle]]), values[:first].copy(), contact)

    def profile(self) -> TorqueProfile:
        """The same as a profile with two knots at every edge, needed or not."""
        after = self.contact.profile() if self.contact is not None else None
        return TorqueProfile(np.repeat(self.edges, 2)[1:], np.repeat(self.levels, 2)[:-1], after)

    def tidy(self) -> TorqueProfile:
        """The same as a profile with as few knots as it needs."""
        full = self.profile()
        after = full.after_contact.simplified(1e-9) if full.after_contact is not None else None
        return TorqueProfile(full.time, full.torque, after).simplified(1e-9)

    def cut(self, edges: Vector, contact_edges: Vector | None = None) -> Staircase:
        """The same torque with further edges."""

        def one(part: Staircase, more: Vector) -> tuple[Vector, Vector]:
            joined = np.unique(np.concatenate([part.edges, more]))
            far = np.concatenate([[True], np.diff(joined) > 1e-7])
            own = np.isin(joined, part.edges)
            near_own = np.concatenate([np.diff(joined) <= 1e-7, [False]]) & np.concatenate([own[1:], [False]])
            joined = joined[(far | own) & ~(near_own & ~own)]
            return joined, part.levels[np.searchsorted(part.edges, joined, side="right") - 1]

        if self.contact is None:
            return Staircase(*one(self, edges))
        more = contact_edges if contact_edges is not None else np.zeros(0)
        return Staircase(*one(self, edges), Staircase(*one(self.contact, more)))


class Player:
    """The `profile` controller's parameter vector as an affine function of a staircase's unknowns."""

    def __init__(self, shape: Staircase, drive: Drive) -> None:
        self.controller = self._controller(shape)
        self.origin = shape.unknowns
        self.constant = self._numbers(shape, drive)
        self.slopes = np.zeros((self.origin.size, self.constant.size))
        self._trace(shape, drive, np.arange(shape.n_levels), self._level_probe(shape, drive))
        self._trace(shape, drive, np.arange(shape.n_levels, self.origin.size), EDGE_PROBE)

    def _trace(self, shape: Staircase, drive: Drive, which: NDArray[np.int64], probe: float | Vector) -> None:
        """Find where the unknowns `which` stand in the vector: each is moved by an amount of its own."""
        if which.size == 0:
            return
        share = np.arange(1, which.size + 1) / which.size
        moved = self.origin.copy()
        moved[which] += probe * share
        change = self._numbers(shape.with_unknowns(moved), drive) - self.constant
        told = np.abs(change) / np.max(np.abs(probe)) * which.size
        found = np.flatnonzero(told > 0.5)
        self.slopes[which[np.round(told[found]).astype(np.int64) - 1], found] = 1.0

    @staticmethod
    def _controller(shape: Staircase) -> CompiledController:
        return cast(CompiledController, make_controller("profile", {"profile": shape.profile()}))

    def _numbers(self, shape: Staircase, drive: Drive) -> Vector:
        numbers: Vector = np.asarray(
            self._controller(shape).fitted(drive).vector(drive), dtype=np.float64
        ).ravel()
        return numbers

    @staticmethod
    def _level_probe(shape: Staircase, drive: Drive) -> Vector:
        """Away from the nearer torque limit, so that nothing is cut off."""
        upper = shape.unknowns[: shape.n_levels] > 0.5 * (
            drive.minimum_torque + min(drive.maximum_torque, drive.Ms)
        )
        return np.where(upper, -LEVEL_PROBE, LEVEL_PROBE)

    def vectors(self, unknowns: Matrix) -> Matrix:
        """Parameter vectors, one row for each row of unknowns."""
        rows: Matrix = np.ascontiguousarray(
            self.constant + (np.atleast_2d(unknowns) - self.origin) @ self.slopes
        )
        return rows


def refined(shape: Staircase, horizon: float, intervals: int) -> Staircase:
    """The same torque on a grid of so many even intervals beside its own edges."""
    grid = np.linspace(0.0, horizon, intervals + 1)[:-1]
    return shape.cut(grid, grid)


def merged(shape: Staircase, tolerance: float) -> Staircase:
    """Neighbouring levels within `tolerance` N m of each other as one, at their mean over time."""

    def one(part: Staircase) -> tuple[Vector, Vector]:
        edges, levels = part.edges.tolist(), part.levels.tolist()
        ends = [*edges[1:], edges[-1] + 0.01]
        kept: list[tuple[float, float, float]] = []
        for here in zip(edges, ends, levels, strict=True):
            near = bool(kept) and abs(kept[-1][2] - here[2]) <= tolerance
            kept.append(_joined(kept.pop(), here) if near else here)
        return np.array([k[0] for k in kept]), np.array([k[2] for k in kept])

    if shape.contact is None:
        return Staircase(*one(shape))
    return Staircase(*one(shape), Staircase(*one(shape.contact)))


def _joined(
    first: tuple[float, float, float], second: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Two neighbours (start, end, level) as one, at their mean over time."""
    (a, b, low), (_, c, high) = first, second
    mean = (low * (b - a) + high * (c - b)) / (c - a)
    return a, c, min(max(mean, min(low, high)), max(low, high))  # rounding must not lead beyond a limit
