"""One start in the kernel, as it is computed (`StartRecorder`) and as it was recorded (`Trajectory`)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.arrays import Matrix, Vector
from softstart.errors import SimulationError
from softstart.kernel import records as rec
from softstart.kernel import replay, sensitivity, start
from softstart.kernel.motor import N_MEASURED, NEW_STATE
from softstart.start.kernel_input import KernelInput
from softstart.start.status import Status

FIRST_ROWS = 256
MOST_BYTES = 1 << 30  # of the record of one start


class StartRecorder:
    """One start in the kernel: its work and its growing records; `sees` are the sensors of the controller.

    With `room` 0 nothing is recorded but the results in `state`.
    """

    def __init__(self, machine_input: KernelInput, sees: int, room: int = FIRST_ROWS) -> None:
        self.input, self.sees = machine_input, sees
        self.work = np.zeros(rec.N_WORK)
        self._state = self.work.view(rec.WORK)[0]
        self.measured = np.zeros(N_MEASURED)
        self.spans = np.zeros((room, rec.span_size(machine_input.count)))
        most_events = room + 16 * machine_input.count if room else 0
        self.events = np.zeros((most_events, rec.size(rec.EVENT)))

    @property
    def state(self) -> Any:
        """The work of the start, by names."""
        return self._state

    def begin(self, until: float, on_gap: bool) -> None:
        """The state at t = 0; without an end `until` is infinite."""
        start.begin(self.work, *self.input.first, until, on_gap)

    def go_on(self, begins: bool) -> None:
        """The next step of a duty, of the machine that is now `input`; see `kernel.start.go_on`."""
        start.go_on(self.work, *self.input.first, begins)

    def watch(self) -> None:
        """Begin to watch the bands that are set in the state."""
        start.watch_step(self.work)

    def advance(self) -> int:
        """To the next control instant, the end, or a full record; returns which."""
        return int(start.advance(self.work, self.input.tones, self.spans, self.events))

    def run(self, step: Any, numbers: Vector, state: Vector, command: Vector) -> int:
        """To the end, or a full record, under a compiled controller."""
        reason: int = start.run_start(
            step, numbers, self.sees, self.work, self.input.tones, self.spans, self.events,
            self.measured, state, command,
        )  # fmt: skip
        return reason

    def states_of_each(
        self, step: Any, numbers: Matrix, size: int, until: float, on_gap: bool, times: Vector
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Shaft torques and speeds at rising times under each row of numbers of a compiled controller."""
        many, masses = (numbers.shape[0], times.size), self.input.count
        w, T = np.empty((*many, masses)), np.empty((*many, masses - 1))
        while replay.states_of_each(
            step, numbers, self.sees, on_gap, until, *self.input.first, self.work, self.spans, self.events,
            times, np.zeros(times.size, dtype=np.int64), np.empty((times.size, 2)), w,
            np.empty((times.size, masses - 1)), T, self.measured, np.zeros(size), np.zeros(NEW_STATE + size),
        ) == rec.BUFFER_FULL:  # fmt: skip
            self.grow()
        return T, w

    def measure(self) -> float:
        """Fill `measured` with what the controller sees now; returns the code of a fault, 0 without."""
        return float(start.measure(self.work, self.sees, self.input.tones, self.measured))

    def answer(self, torque: float, ask_again: float, slope: float) -> int:
        """Take the controller's answer; returns ASK, or why it cannot be taken."""
        return int(start.take_reply(self.work, torque, ask_again, slope))

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
        states = np.zeros((spans + 1, self.spans.shape[1]))
        states[:spans] = self.spans[:spans]
        start.note_state(self.work, states[spans])
        notes = self.work[: rec.N_NOTES].copy().view(rec.NOTES)[0]
        rows = self.events[:events].view(rec.EVENT)[:, 0].copy()
        return Trajectory(self.input, states, rows, notes, self.of_shafts)

    @property
    def of_shafts(self) -> NDArray[np.void]:
        """What is noted of each shaft: its largest torque, the time of that, its largest impulse, ..."""
        now, noted = self.state, np.zeros(self.input.count - 1, rec.SHAFT_NOTES)
        for name in rec.ShaftNotes.__annotations__:
            noted[name] = now[name][: noted.size]
        return noted


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A start as it was recorded: any instant of it, exactly."""

    input: KernelInput  # the machine as the kernel has it
    states: Matrix  # a row for each span, and one for the state at the end, laid out as in `kernel.records`
    events: NDArray[np.void]  # time, kind, place, value, impulse
    notes: rec.ResultRecord  # what is noted of the start, by the names of `kernel.records.ResultRecord`
    shafts: NDArray[np.void]  # and of each shaft, by those of `ShaftNotes`

    @property
    def spans(self) -> Matrix:
        """The spans that take time."""
        return self.states[:-1]

    def of_shafts(self, what: str) -> Matrix:
        """Of all shafts, as each span begins and at the end: "twist", "mode", "side" or "sign"."""
        begin = rec.S_MASSES + rec.OF_MASS * self.input.count
        return self.states[:, begin + ("twist", "mode", "side", "sign").index(what) :: rec.OF_SHAFT]

    def of_masses(self, what: str) -> Matrix:
        """The same of all masses: "speed", "direction", "angle" or "piece" (of the load curve)."""
        begin = rec.S_MASSES + ("speed", "direction", "angle", "piece").index(what)
        return self.states[:, begin : rec.S_MASSES + rec.OF_MASS * self.input.count : rec.OF_MASS]

    def _kernel(self) -> tuple[Vector, Matrix, Matrix]:
        """Work of the kernel with this machine, its tones, and the spans."""
        work = np.zeros(rec.N_WORK)
        start.begin(work, *self.input.first, math.inf, False)
        return work, self.input.tones, np.ascontiguousarray(self.spans)

    def index(self, times: Vector) -> NDArray[np.int64]:
        """The span in which each instant lies; at a joint, the one that begins there."""
        last = np.searchsorted(self.spans[:, rec.S_START], times, side="right") - 1
        return last.clip(0).astype(np.int64)

    def at(self, times: ArrayLike, index: NDArray[np.int64] | None = None) -> dict[str, Vector]:
        """States at instants within the run, a row each: phi, w of masses, twist, T of shafts, and u."""
        when = np.ascontiguousarray(times, dtype=np.float64)
        count, load = self.input.count, int(self.input.machine.load)
        motor = np.empty((when.size, 2))
        w, twist, T = (np.empty((when.size, columns)) for columns in (count, count - 1, count - 1))
        index = self.index(when) if index is None else index
        replay.states_at(*self._kernel(), index, when, motor, w, twist, T)
        # angles from the first mass on, then from that of the load
        behind = np.concatenate([np.zeros((when.size, 1)), -np.cumsum(twist, axis=1)], axis=1)
        phi = motor[:, :1] + behind - behind[:, load : load + 1]
        return {"phi": phi, "w": w, "twist": twist, "T": T, "u": motor[:, 1].copy()}

    def sensitivities(
        self, knots: ArrayLike, times: ArrayLike = (), marks: ArrayLike = (), owners: ArrayLike | None = None,
        parts: slice = slice(None, -1),
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
        """Of shaft torques at rising instants, and of the state at rising `marks`, to a demand's torques.

        The demand is linear between its knots; a last axis is of them, or of those who own them, which rise.
        The `parts` of the state are twists, speeds, realised torque of the motor, and its angle.
        """
        when, begin = (np.ascontiguousarray(instants, dtype=np.float64) for instants in (times, marks))
        # by the clock of the controller; a copy, as the kernel takes no read-only numbers
        demand = np.array(knots, dtype=np.float64) + self.input.machine.begins_at
        columns = np.arange(demand.size) if owners is None else np.ascontiguousarray(owners, dtype=np.int64)
        masses, count = self.input.count, int(columns[-1]) + 1
        first, end, _ = parts.indices(2 * masses + 1)
        size = max(end, 2 * masses)
        torques = np.zeros((when.size, masses - 1, count))
        states = np.zeros((begin.size, end - first, count))
        scratch = [np.zeros(shape) for shape in ((size, count), (size, count), (2, count), (2, masses))]
        sensitivity.sensitivities(
            *self._kernel(), demand, columns, when, torques, begin, first, states, *scratch,
            np.zeros((size + 1, size + 2, rec.ORDERS)),
        )  # fmt: skip
        return torques, states

    def work(self) -> Vector:
        """Work, J, of motor, exciting torques, loads, friction, shafts, gears; change of elastic energy."""
        work, tones, _ = self._kernel()
        energies = np.zeros(7)
        replay.work_of(work, tones, self.states, energies)
        return energies

    def stage_peaks(self) -> Matrix:
        """A row for each stage: number, start, end, then largest torque and its instant for each shaft."""
        rows = np.zeros((int(self.notes.gap_events) + 2, 3 + 2 * (self.input.count - 1)))
        if replay.stage_peaks(*self._kernel(), rows) != rec.ENDED:
            raise SimulationError("The largest torque of a stage could not be located.")
        return rows[rows[:, 2] > rows[:, 1]]

    def turning_points(self, shaft: int, still: float) -> Matrix:
        """Times, s, and torques, N m, at the reversals of a shaft's torque by more than `still`, and ends."""
        room = 64 + self.spans.shape[0]
        while True:
            points = np.zeros((room, 2))
            count = replay.turning_points(*self._kernel(), shaft, still, np.zeros(4), points)
            if count == -2:
                raise SimulationError("An extreme of the shaft torque could not be located.")
            if count != -1:
                return points[:count].copy()
            room *= 4

    def load_settles(self, begin: float, floor: float) -> float:
        """From when on, not before `begin`, the load speed is not below `floor`; NaN if it is at the end."""
        return float(replay.load_settles(*self._kernel(), begin, floor))

    def torque_settles(self, shaft: int, begin: float, limit: float) -> float:
        """From when on a shaft's torque stays within `limit` of its mean; NaN if it is not at the end."""
        return float(replay.torque_settles(*self._kernel(), shaft, begin, limit))
