"""What the exact plant says of a staircase: figures of many, and one with its sensitivities."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softstart.controller.base import Sensor
from softstart.drive import Drive
from softstart.optimal.robust.differences import all_moved
from softstart.optimal.robust.shape import Matrix, Player, Staircase
from softstart.plant import layout as at
from softstart.plant import record
from softstart.plant import start as kernel
from softstart.plant.vector import plant_vector
from softstart.profile import Vector
from softstart.start.engine import Book

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
class Course:
    """Shaft torque of one scenario under one profile, and how it changes with the unknowns.

    `T` at instants of the run, `dT` (instants x unknowns); `late` in s is by how much the start misses the
    time asked for (below 0: it is early), guessed from the missing speed where the run was given up.
    """

    peak: float
    times: Vector
    T: Vector
    dT: Matrix
    late: float
    dlate: Vector


class Plays:
    """The scenarios, each ready to be run by the kernel up to one elastic period after its start time."""

    def __init__(self, drives: Sequence[Drive], start_time: float) -> None:
        self.drives = tuple(drives)
        self.start_time = start_time
        self.p = [
            plant_vector(drive, time_limit=start_time + float(drive.elastic_period)) for drive in drives
        ]
        for p in self.p:
            p[:, at.TARGET] *= 1.0 + AIM
        self.horizon = start_time + max(float(drive.elastic_period) for drive in drives)

    def figures(self, player: Player, unknowns: Matrix) -> Figures:
        """Figures of many staircases of one shape, a row of unknowns each."""
        numbers = player.vectors(unknowns)
        size = player.controller.state_size
        sees = player.controller.sensors
        out = np.empty((3, numbers.shape[0], len(self.p)))
        results = np.empty((numbers.shape[0], at.N_X))
        for i, p in enumerate(self.p):
            kernel.run_many(
                type(player.controller).kernel, p, numbers, int(sees), bool(sees & Sensor.STAGE),
                np.array([math.inf]), results, np.zeros(at.N_X), np.zeros(at.N_M),
                np.zeros(kernel.N_MEASURED), np.zeros(size), np.zeros(kernel.NEW_STATE + size),
                np.zeros(at.N_P), np.zeros(numbers.shape[1]), np.zeros((0, 0)),
            )  # fmt: skip
            good = results[:, at.STATUS] == at.ENDED
            out[0, :, i] = np.where(good, np.abs(results[:, at.PEAK]), math.inf)
            out[1, :, i] = np.where(good, results[:, at.START_TIME], math.nan)
            out[2, :, i] = np.where(good, results[:, at.W2], -math.inf)
        return Figures(out[0], out[1], out[2])

    def course(
        self, i: int, player: Player, shape: Staircase, free_edges: NDArray[np.int64], low: float, high: float
    ) -> Course:
        """Scenario i under the staircase, with differences for all levels and the edges marked free."""
        tape = _Tape(player, self.p[i])
        unknowns = shape.unknowns
        numbers = player.vectors(unknowns)[0]
        x = tape.play(numbers, math.inf)
        peak, end, ts = abs(float(x[at.PEAK])), float(x[at.TIME]), float(x[at.START_TIME])
        first = end if math.isnan(x[at.FIRST_CONTACT]) else float(x[at.FIRST_CONTACT])
        times = self._instants(tape, i, first, end)
        asked = np.append(times, end if math.isnan(ts) else ts)
        states = tape.at(asked)
        which, steps = self._steps(shape, free_edges, low, high, first, end)
        rows = numbers + steps[:, None] * player.slopes[which]
        T, w2 = tape.moved(rows, end, asked)
        dT, dlate = np.zeros((times.size, unknowns.size)), np.zeros(unknowns.size)
        dT[:, which] = ((T[:, :-1] - states[:-1, record.T_OUT]) / steps[:, None]).T
        gain = self._gain(i, float(states[-1, record.T_OUT]))
        dlate[which] = (states[-1, record.W2_OUT] - w2[:, -1]) / steps / gain
        late = ts - self.start_time
        if math.isnan(ts):
            late = self._behind(i, float(states[-1, record.W2_OUT]))
        return Course(peak, times, states[:-1, record.T_OUT].copy(), dT, late, dlate)

    def _gain(self, i: int, T: float) -> float:
        """Acceleration of the load under T, rad/s2, at least a part of the mean one that is needed."""
        p = self.p[i][0]
        return max(float((T - p[at.MC]) * p[at.INV_J2]), 0.05 * self._needed(i))

    def _needed(self, i: int) -> float:
        p = self.p[i][0]
        return float(p[at.TARGET] - p[at.W2_0]) / self.start_time

    def _behind(self, i: int, w2: float) -> float:
        """How late a load comes that has only w2 when its run is given up, s."""
        p = self.p[i][0]
        missing = max(float(p[at.TARGET]) - w2, 0.0) / self._needed(i)
        return float(p[at.TIME_LIMIT]) - self.start_time + missing

    def lateness(self, figures: Figures) -> Matrix:
        """By how much each start misses the time asked for, s; below 0 where it is early."""
        behind = np.array(
            [[self._behind(i, w2) for i, w2 in enumerate(row)] for row in figures.final_speed.tolist()]
        )
        late: Matrix = np.where(np.isnan(figures.start_time), behind, figures.start_time - self.start_time)
        return late

    def _instants(self, tape: _Tape, i: int, first: float, end: float) -> Vector:
        """Instants at which the torque is watched: the onset, an even grid of the contact, and the peaks."""
        if end - first <= 2.0 * ONSET:
            return np.array([end])
        period = float(self.p[i][0, at.PERIOD])
        count = max(math.ceil((end - first) / period * PER_PERIOD), 2)
        grid = np.append(first + ONSET, np.linspace(first, end, count + 1)[1:])
        T = np.abs(tape.at(grid)[:, record.T_OUT])
        j = np.flatnonzero((T[2:-1] >= T[1:-2]) & (T[2:-1] > T[3:])) + 2
        width = grid[-1] - grid[-2]
        bend = 2.0 * T[j] - T[j - 1] - T[j + 1]
        peaks = grid[j] + 0.5 * width * (T[j + 1] - T[j - 1]) / np.where(bend > 0.0, bend, np.inf)
        return np.union1d(grid, peaks)

    @staticmethod
    def _steps(
        shape: Staircase, free_edges: NDArray[np.int64], low: float, high: float, first: float, end: float
    ) -> tuple[NDArray[np.int64], Vector]:
        """The unknowns that can make a difference before `end`, and a small step of each."""
        n = shape.n_levels
        clock = np.where(shape.after_contact, first, 0.0)
        last = end if shape.contact is None else first
        early = np.flatnonzero(shape.begins + clock < np.where(shape.after_contact, end, last))
        upper = shape.unknowns[early] > 0.5 * (low + high)
        steps = STEP * (high - low) * np.where(upper, -1.0, 1.0)
        which = np.concatenate([early, n + free_edges]).astype(np.int64)
        return which, np.concatenate([steps, np.full(free_edges.size, EDGE_STEP)])


class _Tape:
    """One scenario, recorded again and again into the same buffers."""

    def __init__(self, player: Player, p: Matrix) -> None:
        self.controller = player.controller
        self.p = p[0].copy()
        self.book = Book(int(player.controller.sensors))
        self.state = np.zeros(self.controller.state_size)
        self.command = np.zeros(kernel.NEW_STATE + self.controller.state_size)
        self.scratch = np.zeros(at.N_X), np.zeros(at.N_M)

    def play(self, numbers: Vector, until: float) -> Vector:
        """The state at the end; the spans stay on the tape."""
        book = self.book
        book.m[:] = 0.0
        self.state[:] = 0.0
        kernel.begin(self.p, book.x, until, book.events)
        book.x[at.ASK_ON_GAP] = 1.0 if self.controller.sensors & Sensor.STAGE else 0.0
        while True:
            reason = kernel.run(
                type(self.controller).kernel, self.p, numbers, book.sees, book.x, book.m, book.measured,
                self.state, self.command, book.segments, book.events, book.stages,
            )  # fmt: skip
            if reason != at.BUFFER_FULL:
                return book.x
            book.grow()

    def moved(self, rows: Matrix, until: float, times: Vector) -> tuple[Matrix, Matrix]:
        """Shaft torque and load speed at `times` for each row of parameters, run to `until`."""
        begun = np.zeros(at.N_X)
        kernel.begin(self.p, begun, until, self.book.events)
        begun[at.ASK_ON_GAP] = 1.0 if self.controller.sensors & Sensor.STAGE else 0.0
        return all_moved(
            type(self.controller).kernel, self.p, np.ascontiguousarray(rows), begun, self.book.sees,
            self.state.size, self.command.size, times, self.book.segments.shape[0],
        )  # fmt: skip

    def at(self, times: Vector) -> Matrix:
        """States at the instants, columns as in plant/record.py."""
        spans = self.book.segments[: int(self.book.x[at.N_SEGMENTS])]
        index = np.searchsorted(spans[:, at.S_START], times, side="right") - 1
        out = np.empty((times.size, record.N_OUT))
        record.states_at(self.p, spans, index.clip(0), times, *self.scratch, out)
        return out
