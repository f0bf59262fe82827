"""A start on the exact plant, recorded sample by sample, that can be continued from any of them.

The encoder is taken as infinitely fine and the torque as measured without noise: a linear view has no steps.
With an encoder the speed is still the difference of two angles over a sample, as on the drive.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.chain.machines import Machine
from softstart.controller.base import CompiledController, Controller, PlainController, Sensor, label_of
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.kernel import motor as exchange
from softstart.kernel import records as at
from softstart.start.engine import plain_answer
from softstart.start.recorded import Recorder
from softstart.start.rows import Rows, rows_of

FAR = 1e9  # in target speeds: never reached
CLOSED = (at.CONTACT, at.JOINED, at.PRESSED, at.WELDED)
KEPT = (at.Notes, at.OfMasses, at.OfShafts, at.State)  # of the work of a start

Part = tuple[str, int]  # what is displaced: a field of the kernel's work, and of which mass or shaft

Answer = tuple[float, float, float, Vector]  # demand N m, next sample s, slope N m/s, new state
Step = Callable[[Vector, Vector], Answer]


@dataclass(frozen=True, eq=False)
class Layout:
    """The state of a start of so many masses alone, as a record, and where its numbers stand in the work."""

    record: Any
    index: Any

    @classmethod
    def of(cls, masses: int) -> Layout:
        fields: list[Any] = []
        index = []
        for name in (name for part in KEPT for name in part.__annotations__):
            kind, offset = at.WORK.fields[name][:2]
            size = masses if kind.shape == (at.MOST_MASSES,) else int(np.prod(kind.shape))
            fields.append((name, kind.base, size) if kind.shape else (name, kind.base))
            index.append(offset // 8 + np.arange(size))
        return cls(np.dtype(fields), np.concatenate(index))


@dataclass(frozen=True, eq=False)
class Sample:
    """One sample: the plant just before it (`x`), the measured quantities, the state, the answer."""

    x: Vector
    layout: Layout
    measured: Vector
    state: Vector
    demand: float
    ask_again: float
    slope: float

    @property
    def plant(self) -> Any:
        """The plant by names, as `softstart.kernel.records` has them."""
        return self.x.view(self.layout.record)[0]

    @property
    def time(self) -> float:
        """Instant, s."""
        return float(self.plant["time"])

    @property
    def pressing(self) -> bool:
        """All flanks press and all masses move: the plant is linear."""
        plant = self.plant
        moves = (plant["rubs"] == 0.0) | (plant["direction"] != 0.0)
        return bool(np.isin(plant["mode"][:-1], CLOSED).all() and moves.all())

    def displaced(self, changes: dict[Part, float], state: Vector | None = None) -> Sample:
        """The same instant with `changes` added to the plant, and perhaps another state."""
        other = replace(self, x=self.x.copy(), state=self.state if state is None else state)
        plant = other.plant
        for (name, place), by in changes.items():
            if plant[name].shape:
                plant[name][place] += by
            else:
                plant[name] += by
        plant["zeros"][:] = plant["passed"][:] = 0  # what has just happened no longer applies
        return other


@dataclass(frozen=True, eq=False)
class SampledStart:
    """A machine as the kernel has it, and a controller that is set up for it.

    `differencing` says whether the speed is the difference of two encoder angles.
    """

    drive: Machine
    controller: Controller
    step: Step
    rows: Rows
    first_state: Vector
    differencing: bool
    layout: Layout

    @classmethod
    def of(cls, drive: Machine, controller: Controller, fitted_to: Machine | None = None) -> SampledStart:
        """The controller set up for this (or that) drive; no rounding or noise, the target speed far away."""
        fitted, own = controller.set_up((fitted_to or drive).design_drive)
        rows = rows_of(drive)
        machine = rows.machine
        differencing = bool(machine.encoder > 0.0)
        machine.target *= FAR
        machine.encoder = machine.torque_noise = 0.0
        if isinstance(fitted, CompiledController):
            step, first = _compiled(fitted, own), np.zeros(fitted.state_size)
        elif isinstance(fitted, PlainController):
            step, first = _plain(fitted), np.array(fitted.initial_state, dtype=np.float64)
        else:
            raise InputError(
                f"controller = {type(fitted).__name__}: derive it from PlainController or CompiledController."
            )
        return cls(drive, fitted, step, rows, first, differencing, Layout.of(rows.count))

    @property
    def sees(self) -> int:
        """The sensors that the controller reads."""
        return int(self.controller.sensors)

    def begun(self, until: float, room: int = 0) -> Recorder:
        """A start at its beginning; of so many spans there is room for records."""
        recorder = Recorder(self.rows, self.sees, room)
        recorder.begin(until, bool(self.controller.sensors & Sensor.STAGE))
        return recorder

    def shaft_torque(self, sample: Sample) -> float:
        """Torque at a sample in contact, N m, of the shaft beside the motor."""
        k, plant = self.rows.motor_shaft, sample.plant
        shaft, w = self.rows.shafts[0, k].view(at.SHAFT)[0], plant["w"]
        z = plant["theta"][k] - plant["side"][k] * shaft.half
        torque = shaft.c * z + shaft.d * (w[k] - w[k + 1])
        return float(torque if self.rows.machine.motor <= k else -torque)

    def displacements(self, angle: float, speed: float) -> list[tuple[dict[Part, float], dict[str, float]]]:
        """Small motions in all directions: what they change of the plant, and of the rows of `Continuous`."""
        motor, load = int(self.rows.machine.motor), int(self.rows.machine.load)
        curves = self.rows.curves[0].view(at.CURVE)[:, 0]
        curved = [int(curve.mass) for curve in curves if curve.by_angle]
        found: list[tuple[dict[Part, float], dict[str, float]]] = [
            ({("phi", 0): angle} | {("angle", i): angle for i in curved}, {"phi1": angle})
        ]
        bodies: list[list[int]] = [[0]]
        for k, rigid in enumerate(self.rows.shafts.view(at.SHAFT)[0, :, 0]["rigid"].tolist()):
            if rigid:
                bodies[-1].append(k + 1)
            else:
                bodies.append([k + 1])
                moves: dict[Part, float] = {("theta", k): angle}
                if min(motor, load) <= k < max(motor, load):  # `phi` is the angle of the load
                    moves["phi", 0] = -angle if motor <= k else angle
                for i in curved:  # what lies behind the shaft turns, seen from the motor
                    if motor <= k < i or i <= k < motor:
                        moves["angle", i] = -angle if k < i else angle
                found.append((moves, {f"theta {k}": angle}))
        J = self.rows.masses.view(at.MASS)[0, :, 0]["J"]
        moving = [body for body in bodies if np.isfinite(J[body]).all()]
        found += [({("w", i): speed for i in body}, {f"w {body[0]}": speed}) for body in moving]
        return found

    def samples(self, until: float) -> Iterator[Sample]:
        """The start from its beginning."""
        yield from self._continued(self.begun(until), self.first_state)

    def from_sample(self, sample: Sample, until: float, recorder: Recorder | None = None) -> Iterator[Sample]:
        """The start from a sample on, whose plant or state may have been changed."""
        recorder = recorder or self.begun(until)
        recorder.work[self.layout.index] = sample.x
        recorder.state.n_spans = recorder.state.n_events = 0.0
        recorder.state.changed = 1.0
        recorder.state.t_end = until
        yield from self._continued(recorder, sample.state)

    def _continued(self, recorder: Recorder, state: Vector) -> Iterator[Sample]:
        now = recorder.state
        while True:
            reason = recorder.advance()
            if reason == at.BUFFER_FULL:
                recorder.grow()
                continue
            if reason == at.ENDED:
                return
            if reason != at.ASK:
                raise SimulationError(f"{self._name}: the start was given up at t = {now.time:.6g} s.")
            x = recorder.work[self.layout.index]
            measured = self._measured(recorder)
            demand, ask_again, slope, after = self.step(measured, state)
            yield Sample(x, self.layout, measured, state, demand, ask_again, slope)
            if recorder.answer(demand, ask_again, slope) != at.ASK:
                raise SimulationError(
                    f"{self._name}: at t = {now.time:.6g} s the controller's answer was no "
                    f"command (torque {demand:.6g} N m, ask again at {ask_again:.6g} s)."
                )
            state = after

    def _measured(self, recorder: Recorder) -> Vector:
        now = recorder.state
        before, when = float(now.sample_angle), float(now.sample_time)
        recorder.measure()
        measured = recorder.measured.copy()
        if self.differencing and now.asked != 0.0 and now.time > when:
            measured[exchange.M_MOTOR_SPEED] = (measured[exchange.M_MOTOR_ANGLE] - before) / (now.time - when)
        return measured

    @property
    def _name(self) -> str:
        return f"{self.drive.name}, controller {label_of(self.controller)}"


def _compiled(controller: CompiledController, own: Drive) -> Step:
    numbers = np.array(controller.vector(own), dtype=np.float64).ravel()
    size = controller.state_size
    lines = type(controller).kernel

    def step(measured: Vector, state: Vector) -> Answer:
        command = np.zeros(exchange.NEW_STATE + size)
        lines(numbers, measured, state.copy(), command)
        torque, ask_again, slope = command[: exchange.NEW_STATE].tolist()
        return torque, ask_again, slope, command[exchange.NEW_STATE :]

    return step


def _plain(controller: PlainController) -> Step:
    def step(measured: Vector, state: Vector) -> Answer:
        torque, ask_again, after, slope = plain_answer(controller, measured, tuple(state.tolist()))
        return torque, ask_again, slope, np.array(after, dtype=np.float64).ravel()

    return step
