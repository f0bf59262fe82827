"""A staircase of torque on the exact plant: figures of many at once, and one with its sensitivities.

A profile is a vector of unknowns: the levels and edges of a staircase, or of two where the second starts with
the contact. The `profile` controller's parameters are an affine function of them, so that the compiled kernel
evaluates any number of staircases without building a profile each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.controller import make_controller
from softstart.controller.base import CompiledController, Sensor
from softstart.drive import Drive
from softstart.kernel.records import ENDED
from softstart.profile import TorqueProfile
from softstart.start.batch import notes_under
from softstart.start.engine import run_compiled
from softstart.start.recorded import Recorded, Recorder
from softstart.start.rows import rows_of

Indices = NDArray[np.int64]

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
        """The staircase whose unknowns are `values`; edges that fall by rounding coincide."""
        n, first = self.n_levels, self.levels.size

        def edges(inner: Vector) -> Vector:
            rising: Vector = np.maximum.accumulate(np.concatenate([[0.0], inner]))
            return rising

        if self.contact is None:
            return Staircase(edges(values[n:]), values[:n].copy())
        middle = n + first - 1
        contact = Staircase(edges(values[middle:]), values[first:n].copy())
        return Staircase(edges(values[n:middle]), values[:first].copy(), contact)

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


class ProfileParameters:
    """The `profile` controller's parameter vector as an affine function of a staircase's unknowns."""

    def __init__(self, staircase: Staircase, drive: Drive) -> None:
        self.controller = self._controller(staircase)
        self.origin = staircase.unknowns
        self.constant = self._numbers(staircase, drive)
        self.slopes = np.zeros((self.origin.size, self.constant.size))
        self._trace(staircase, drive, np.arange(staircase.n_levels), self._level_probe(staircase, drive))
        self._trace(staircase, drive, np.arange(staircase.n_levels, self.origin.size), EDGE_PROBE)

    def _trace(self, staircase: Staircase, drive: Drive, which: Indices, probe: float | Vector) -> None:
        """Find where the unknowns `which` stand in the vector: each is moved by another amount."""
        if which.size == 0:
            return
        share = np.arange(1, which.size + 1) / which.size
        moved = self.origin.copy()
        moved[which] += probe * share
        change = self._numbers(staircase.with_unknowns(moved), drive) - self.constant
        change_share = np.abs(change) / np.max(np.abs(probe)) * which.size
        found = np.flatnonzero(change_share > 0.5)
        self.slopes[which[np.round(change_share[found]).astype(np.int64) - 1], found] = 1.0

    @staticmethod
    def _controller(staircase: Staircase) -> CompiledController:
        return cast(CompiledController, make_controller("profile", {"profile": staircase.profile()}))

    def _numbers(self, staircase: Staircase, drive: Drive) -> Vector:
        numbers: Vector = np.asarray(
            self._controller(staircase).fitted(drive).vector(drive), dtype=np.float64
        ).ravel()
        return numbers

    @staticmethod
    def _level_probe(staircase: Staircase, drive: Drive) -> Vector:
        """Away from the nearer torque limit, so that nothing is cut off."""
        upper = staircase.unknowns[: staircase.n_levels] > 0.5 * (
            drive.minimum_torque + min(drive.maximum_torque, drive.Ms)
        )
        return np.where(upper, -LEVEL_PROBE, LEVEL_PROBE)

    def vectors(self, unknowns: Matrix) -> Matrix:
        """Parameter vectors, one row for each row of unknowns."""
        rows: Matrix = np.ascontiguousarray(
            self.constant + (np.atleast_2d(unknowns) - self.origin) @ self.slopes
        )
        return rows


def refined(staircase: Staircase, horizon: float, intervals: int) -> Staircase:
    """The same torque on a grid of so many even intervals beside its own edges."""
    grid = np.linspace(0.0, horizon, intervals + 1)[:-1]
    return staircase.cut(grid, grid)


def merged(staircase: Staircase, tolerance: float) -> Staircase:
    """Neighbouring levels within `tolerance` N m of each other as one, at their mean over time."""

    def one(part: Staircase) -> tuple[Vector, Vector]:
        edges, levels = part.edges.tolist(), part.levels.tolist()
        ends = [*edges[1:], edges[-1] + 0.01]
        kept: list[tuple[float, float, float]] = []
        for here in zip(edges, ends, levels, strict=True):
            near = bool(kept) and abs(kept[-1][2] - here[2]) <= tolerance
            kept.append(_joined(kept.pop(), here) if near else here)
        return np.array([k[0] for k in kept]), np.array([k[2] for k in kept])

    if staircase.contact is None:
        return Staircase(*one(staircase))
    return Staircase(*one(staircase), Staircase(*one(staircase.contact)))


def _joined(
    first: tuple[float, float, float], second: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Two neighbours (start, end, level) as one, at their mean over time."""
    (a, b, low), (_, c, high) = first, second
    mean = (low * (b - a) + high * (c - b)) / (c - a)
    return a, c, min(max(mean, min(low, high)), max(low, high))  # rounding must not lead beyond a limit


AIM = 1e-9  # the load's target is raised by so much, so that no rounding lets it miss
PER_PERIOD = 40  # samples of the shaft torque in one elastic period
STEP = 1e-5  # of a level, relative to the torque range, for the differences
EDGE_STEP = 1e-7  # of an edge, in s
ONSET = 5e-6  # s after the contact at which a damped shaft's first torque is watched


@dataclass(frozen=True, eq=False)
class Figures:
    """Per profile and scenario: peak |T|, start time (NaN if never), and load speed at the end of the run."""

    peak: Matrix
    start_time: Matrix
    final_speed: Matrix


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Shaft torque of one scenario under one profile, and how it changes with the unknowns.

    `T` at instants of the run, `dT` (instants x unknowns); `late` in s is by how much the start misses the
    time asked for (below 0: it is early), estimated from the missing speed where the run was stopped.
    """

    peak: float
    times: Vector
    T: Vector
    dT: Matrix
    late: float
    dlate: Vector


class Evaluator:
    """The scenarios, each ready to be run by the kernel up to one elastic period after its start time."""

    def __init__(self, drives: Sequence[Drive], start_time: float) -> None:
        self.drives = tuple(drives)
        self.start_time = start_time
        self.rows = [rows_of(drive, start_time + float(drive.elastic_period)) for drive in drives]
        for rows in self.rows:
            rows.machine.target *= 1.0 + AIM
        self.horizon = start_time + max(float(drive.elastic_period) for drive in drives)

    def figures(self, parameters: ProfileParameters, unknowns: Matrix) -> Figures:
        """Figures of many staircases of one staircase, a row of unknowns each."""
        numbers = parameters.vectors(unknowns)
        found = np.empty((3, numbers.shape[0], len(self.rows)))
        for i, rows in enumerate(self.rows):
            alike = rows.taken(np.zeros(numbers.shape[0], dtype=np.int64))
            notes = notes_under(alike, parameters.controller, numbers)
            good = notes["status"] == ENDED
            found[0, :, i] = np.where(good, notes.peaks[:, 0], math.inf)
            found[1, :, i] = np.where(good, notes["start_time"], math.nan)
            found[2, :, i] = np.where(good, notes["final_speed"], -math.inf)
        return Figures(*found)

    def trajectory(
        self,
        i: int,
        parameters: ProfileParameters,
        staircase: Staircase,
        free_edges: Indices,
        low: float,
        high: float,
    ) -> Trajectory:
        """Scenario i under the staircase, with differences for all levels and the edges marked free."""
        controller = parameters.controller
        recorder = Recorder(self.rows[i], int(controller.sensors))
        unknowns = staircase.unknowns
        numbers = parameters.vectors(unknowns)[0]
        run_compiled(controller, numbers, recorder, None)
        run, notes = recorder.finished(), recorder.state
        peak, end, ts = abs(float(notes.peak[0])), float(notes.time), float(notes.start_time)
        first = end if math.isnan(notes.first_contact) else float(notes.first_contact)
        times = self._instants(run, first, end)
        reached = end if math.isnan(ts) else ts
        place = int(np.searchsorted(times, reached))
        checked = np.insert(times, place, reached)
        watched = np.delete(np.arange(checked.size), place)
        states = run.at(checked)
        T, w2 = states["T"][watched, 0], float(states["w"][place, 1])
        which, steps = self._steps(staircase, free_edges, low, high, first, end)
        step, size = type(controller).kernel, controller.state_size
        on_gap = bool(controller.sensors & Sensor.STAGE)
        rows = numbers + steps[:, None] * parameters.slopes[which]
        moved, w = recorder.states_of_each(step, rows, size, end, on_gap, checked)
        dT, dlate = np.zeros((times.size, unknowns.size)), np.zeros(unknowns.size)
        dT[:, which] = ((moved[:, watched, 0] - T) / steps[:, None]).T
        dlate[which] = (w2 - w[:, place, 1]) / steps / self._gain(i, float(states["T"][place, 0]))
        late = self._behind(i, w2) if math.isnan(ts) else ts - self.start_time
        return Trajectory(peak, times, T, dT, late, dlate)

    def _gain(self, i: int, T: float) -> float:
        """Acceleration of the load under T, rad/s2, at least a part of the mean one that is needed."""
        drive = self.drives[i]
        return max(float((T - drive.Mc) / drive.J2), 0.05 * self._needed(i))

    def _needed(self, i: int) -> float:
        missing = self.rows[i].machine.target - self.drives[i].initial_load_speed
        return float(missing) / self.start_time

    def _behind(self, i: int, w2: float) -> float:
        """How late a load comes that has only w2 when its run is stopped, s."""
        machine = self.rows[i].machine
        missing = max(float(machine.target) - w2, 0.0) / self._needed(i)
        return float(machine.time_limit) - self.start_time + missing

    def lateness(self, figures: Figures) -> Matrix:
        """By how much each start misses the time asked for, s; below 0 where it is early."""
        behind = np.array(
            [[self._behind(i, w2) for i, w2 in enumerate(row)] for row in figures.final_speed.tolist()]
        )
        late: Matrix = np.where(np.isnan(figures.start_time), behind, figures.start_time - self.start_time)
        return late

    @staticmethod
    def _instants(run: Recorded, first: float, end: float) -> Vector:
        """Instants at which the torque is watched: the onset, an even grid of the contact, and the peaks."""
        if end - first <= 2.0 * ONSET:
            return np.array([end])
        period = float(run.rows.machine.period)
        count = max(math.ceil((end - first) / period * PER_PERIOD), 2)
        grid = np.append(first + ONSET, np.linspace(first, end, count + 1)[1:])
        T = np.abs(run.at(grid)["T"][:, 0])
        j = np.flatnonzero((T[2:-1] >= T[1:-2]) & (T[2:-1] > T[3:])) + 2
        width = grid[-1] - grid[-2]
        bend = 2.0 * T[j] - T[j - 1] - T[j + 1]
        peaks = grid[j] + 0.5 * width * (T[j + 1] - T[j - 1]) / np.where(bend > 0.0, bend, np.inf)
        return np.union1d(grid, peaks)

    @staticmethod
    def _steps(
        staircase: Staircase, free_edges: Indices, low: float, high: float, first: float, end: float
    ) -> tuple[Indices, Vector]:
        """The unknowns that can make a difference before `end`, and a small step of each."""
        n = staircase.n_levels
        clock = np.where(staircase.after_contact, first, 0.0)
        last = end if staircase.contact is None else first
        early = np.flatnonzero(staircase.begins + clock < np.where(staircase.after_contact, end, last))
        upper = staircase.unknowns[early] > 0.5 * (low + high)
        steps = STEP * (high - low) * np.where(upper, -1.0, 1.0)
        which = np.concatenate([early, n + free_edges]).astype(np.int64)
        return which, np.concatenate([steps, np.full(free_edges.size, EDGE_STEP)])
