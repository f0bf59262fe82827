"""The kernel driven from Python: one start, its growing records, and what is read back from them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.arrays import Matrix, Vector
from softstart.errors import SimulationError
from softstart.kernel import records as at
from softstart.kernel import replay, sensitivity, start
from softstart.kernel.motor import N_MEASURED, NEW_STATE
from softstart.start.rows import Rows
from softstart.start.status import Status

FIRST_ROWS = 256
MOST_BYTES = 1 << 30  # of the record of one start


class StartRecorder:
    """One start in the kernel: its work and its growing records; `sees` are the sensors of the controller."""

    def __init__(self, rows: Rows, sees: int, room: int = FIRST_ROWS) -> None:
        self.rows, self.sees = rows, sees
        self.work = np.zeros(at.N_WORK)
        self.measured = np.zeros(N_MEASURED)
        self.spans = np.zeros((room, at.span_size(rows.count)))
        self.events = np.zeros((room + 16 * rows.count if room else 0, at.size(at.EVENT)))

    @property
    def state(self) -> Any:
        """The work of the start, by names."""
        return self.work.view(at.WORK)[0]

    def begin(self, until: float, on_gap: bool) -> None:
        """The state at t = 0; without an end `until` is infinite."""
        given = self.rows
        start.begin(
            self.work, given.machines[0], given.masses[0], given.shafts[0], given.curves[0], given.tones,
            until, on_gap,
        )  # fmt: skip

    def advance(self) -> int:
        """To the next control instant, the end, or a full record; returns which."""
        reason: int = start.advance(self.work, self.rows.tones, self.spans, self.events)
        return reason

    def run(self, step: Any, numbers: Vector, state: Vector, command: Vector) -> int:
        """To the end, or a full record, under a compiled controller."""
        reason: int = start.run_start(
            step, numbers, self.sees, self.work, self.rows.tones, self.spans, self.events,
            self.measured, state, command,
        )  # fmt: skip
        return reason

    def states_of_each(
        self, step: Any, numbers: Matrix, size: int, until: float, on_gap: bool, times: Vector
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Shaft torques and speeds at rising times under each row of numbers of a compiled controller."""
        given, many = self.rows, (numbers.shape[0], times.size)
        w, T = np.empty((*many, given.count)), np.empty((*many, given.count - 1))
        while replay.states_of_each(
            step, numbers, self.sees, on_gap, until, given.machines[0], given.masses[0], given.shafts[0],
            given.curves[0], given.tones, self.work, self.spans, self.events, times,
            np.zeros(times.size, dtype=np.int64), np.empty((times.size, 2)), w,
            np.empty((times.size, given.count - 1)), T, self.measured, np.zeros(size),
            np.zeros(NEW_STATE + size),
        ) == at.BUFFER_FULL:  # fmt: skip
            self.grow()
        return T, w

    def measure(self) -> None:
        """Fill `measured` with what the controller sees now."""
        start.measure(self.work, self.sees, self.rows.tones, self.measured)

    def answer(self, torque: float, ask_again: float, slope: float) -> int:
        """Take the controller's answer; returns ASK, or why it cannot be taken."""
        reason: int = start.take_reply(self.work, torque, ask_again, slope)
        return reason

    def grow(self) -> None:
        """Twice the room for whatever is nearly full; raises SimulationError where memory is not for that."""
        if 2 * (self.spans.nbytes + self.events.nbytes) > MOST_BYTES:
            raise SimulationError(Status.TOO_STIFF.value)
        if self.state.n_spans >= self.spans.shape[0]:
            self.spans = np.concatenate([self.spans, np.zeros_like(self.spans)])
        else:
            self.events = np.concatenate([self.events, np.zeros_like(self.events)])

    def finished(self) -> Trajectory:
        """What has been recorded."""
        now = self.state
        spans, events = min(int(now.n_spans), len(self.spans)), int(now.n_events)
        rows = np.zeros((spans + 1, self.spans.shape[1]))
        rows[:spans] = self.spans[:spans]
        start.note_state(self.work, rows[spans])
        shafts = np.zeros(self.rows.count - 1, at.SHAFT_NOTES)
        for name in at.SHAFT_NOTES.names:
            shafts[name] = now[name][: shafts.size]
        return Trajectory(
            self.rows, rows, self.events[:events].view(at.EVENT)[:, 0].copy(),
            self.work[: at.N_NOTES].copy().view(at.NOTES)[0], shafts,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A start as it was recorded: any instant of it, exactly.

    Attributes
    ----------
    rows : Rows
        The machine as the kernel has it.
    states : array of two dimensions
        A row for each span, and one for the state at the end, as `softstart.kernel.records` lays them out.
    events : structured array
        The events: time, kind, place, value, impulse.
    notes, shafts : structured
        What is noted of the start, and of each shaft.
    """

    rows: Rows
    states: Matrix
    events: NDArray[np.void]
    notes: Any
    shafts: NDArray[np.void]

    @property
    def spans(self) -> Matrix:
        """The spans that take time."""
        return self.states[:-1]

    def of_shafts(self, what: int) -> Matrix:
        """Of all shafts, as each span begins and at the end: 0 twist, 1 mode, 2 side, 3 sign."""
        return self.states[:, at.S_MASSES + at.OF_MASS * self.rows.count + what :: at.OF_SHAFT]

    def of_masses(self, what: int) -> Matrix:
        """The same of all masses: 0 speed, 1 direction, 2 angle, 3 piece of its load curve."""
        end = at.S_MASSES + at.OF_MASS * self.rows.count
        return self.states[:, at.S_MASSES + what : end : at.OF_MASS]

    def _loaded(self) -> tuple[Vector, Matrix]:
        """Work of the kernel with this machine, and its tones."""
        work, given = np.zeros(at.N_WORK), self.rows
        start.begin(
            work, given.machines[0], given.masses[0], given.shafts[0], given.curves[0], given.tones,
            math.inf, False,
        )  # fmt: skip
        return work, given.tones

    def index(self, times: Vector) -> NDArray[np.int64]:
        """The span in which each instant lies; at a joint, the one that begins there."""
        found = np.searchsorted(self.spans[:, at.S_START], times, side="right") - 1
        return found.clip(0).astype(np.int64)

    def at(self, times: ArrayLike, index: NDArray[np.int64] | None = None) -> dict[str, Vector]:
        """States at instants within the run, a row each: phi, w of masses, twist, T of shafts, and u."""
        when = np.ascontiguousarray(times, dtype=np.float64)
        count = self.rows.count
        motor = np.empty((when.size, 2))
        w, twist, T = (np.empty((when.size, columns)) for columns in (count, count - 1, count - 1))
        spans = np.ascontiguousarray(self.spans)
        index = self.index(when) if index is None else index
        replay.states_at(*self._loaded(), spans, index, when, motor, w, twist, T)
        before = np.concatenate([np.zeros((when.size, 1)), -np.cumsum(twist, axis=1)], axis=1)
        place = int(self.rows.machine.load)
        phi = motor[:, :1] + before - before[:, place : place + 1]
        return {"phi": phi, "w": w, "twist": twist, "T": T, "u": motor[:, 1].copy()}

    def sensitivities(
        self, knots: ArrayLike, times: ArrayLike = (), marks: ArrayLike = (), owners: ArrayLike | None = None,
        parts: slice = slice(None, -1),
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
        """Of shaft torques at rising instants, and of the state at rising `marks`, to a demand's torques.

        The demand is linear between its knots; a last axis is of them, or of those who own them, which rise.
        The `parts` of the state are twists, speeds, realised torque of the motor, and its angle.
        """
        when, begin = (np.ascontiguousarray(one, dtype=np.float64) for one in (times, marks))
        given = np.array(knots, dtype=np.float64)  # a copy: the kernel takes no read-only numbers
        own = np.arange(given.size) if owners is None else np.ascontiguousarray(owners, dtype=np.int64)
        count, columns = self.rows.count, int(own[-1]) + 1
        first, end, _ = parts.indices(2 * count + 1)
        size = max(end, 2 * count)
        torques, states = (
            np.zeros((when.size, count - 1, columns)),
            np.zeros((begin.size, end - first, columns)),
        )
        sensitivity.sensitivities(
            *self._loaded(), np.ascontiguousarray(self.spans), given, own, when, torques, begin, first,
            states, np.zeros((size, columns)), np.zeros((size, columns)), np.zeros((2, columns)),
            np.zeros((2, count)),
            np.zeros((size + 1, size + 2, at.ORDERS)),
        )  # fmt: skip
        return torques, states

    def work(self) -> Vector:
        """Work, J, of motor, exciting torques, loads, friction, shafts, gears; change of elastic energy."""
        found = np.zeros(7)
        replay.work_of(*self._loaded(), self.states, found)
        return found

    def stage_peaks(self) -> Matrix:
        """A row for each stage: number, start, end, then largest torque and its instant for each shaft."""
        spans = np.ascontiguousarray(self.spans)
        rows = np.zeros((int(self.notes["gap_events"]) + 2, 3 + 2 * (self.rows.count - 1)))
        if replay.stage_peaks(*self._loaded(), spans, rows) != at.ENDED:
            raise SimulationError("The largest torque of a stage could not be located.")
        return rows[rows[:, 2] > rows[:, 1]]

    def turning_points(self, shaft: int, still: float) -> Matrix:
        """Times, s, and torques, N m, at the reversals of a shaft's torque by more than `still`, and ends."""
        spans = np.ascontiguousarray(self.spans)
        room = 64 + spans.shape[0]
        while True:
            points = np.zeros((room, 2))
            count = replay.turning_points(*self._loaded(), spans, shaft, still, np.zeros(4), points)
            if count == -2:
                raise SimulationError("An extreme of the shaft torque could not be located.")
            if count != -1:
                return points[:count].copy()
            room *= 4

    def load_settles(self, begin: float, floor: float) -> float:
        """From when on, not before `begin`, the load speed is not below `floor`; NaN if it is at the end."""
        return float(replay.load_settles(*self._loaded(), np.ascontiguousarray(self.spans), begin, floor))

    def torque_settles(self, shaft: int, begin: float, limit: float) -> float:
        """From when on a shaft's torque stays within `limit` of its mean; NaN if it is not at the end."""
        spans = np.ascontiguousarray(self.spans)
        return float(replay.torque_settles(*self._loaded(), spans, shaft, begin, limit))
