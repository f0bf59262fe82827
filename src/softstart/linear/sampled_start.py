"""A start on the exact plant, recorded sample by sample, that can be continued from any of them.

The encoder is taken as infinitely fine and the torque as measured without noise: a linear view has no steps.
With an encoder the speed is still the difference of two angles over a sample, as on the drive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.chain.kernel_records import CONTACT, JOINED, PRESSED, WELDED, Numbers, numbers
from softstart.chain.machines import Machine, two_masses
from softstart.chain.model import Chain
from softstart.controller.base import CompiledController, Controller, PlainController, Sensor, label_of
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.linear.sampled_plant import motor_of
from softstart.kernel import motor as exchange
from softstart.plant import start as kernel
from softstart.plant.vector import plant_vector
from softstart.start.engine import MAX_EVENTS, Recorder, plain_answer

FAR = 1e9  # in target speeds: never reached
CLOSED = (CONTACT, JOINED, PRESSED, WELDED)

Part = int | tuple[str, int]  # what is displaced: an index of `x`, of a chain ("theta", shaft), ("w", mass),
# ("angle", mass) of a load curve

Answer = tuple[float, float, float, Vector]  # demand N m, next sample s, slope N m/s, new state
Step = Callable[[Vector, Vector], Answer]


@dataclass(frozen=True, eq=False)
class Sample:
    """One sample: the plant just before it (`x`, `m`), the measured quantities, the state, the answer.

    Of a chain `parts` has the records of its masses and shafts.
    """

    x: Vector
    m: Vector
    measured: Vector
    state: Vector
    demand: float
    ask_again: float
    slope: float
    parts: tuple[Any, ...] = ()

    @property
    def time(self) -> float:
        """Instant, s."""
        return float(self.x[layout.TIME])

    @property
    def loads(self) -> Any:
        """Records of the masses of a chain, with the piece of its load curve on which each is; else None."""
        return self.parts[0] if self.parts else None

    @property
    def pressing(self) -> bool:
        """The driving flank presses, of a chain all do, and the load moves: the plant is linear."""
        if self.parts:
            masses, shafts = self.parts
            moves = (masses["rubs"] == 0) | (masses["direction"] != 0.0)
            return bool(np.isin(shafts["mode"], CLOSED).all() and moves.all())
        return bool(
            self.x[layout.SIDE] == 1.0 and self.x[layout.LOAD] != 0.0 and self.x[layout.DOUBLED] == 0.0
        )

    def displaced(self, changes: dict[Part, float], state: Vector | None = None) -> Sample:
        """The same instant with `changes` added to the plant, and perhaps another state."""
        x = self.x.copy()
        parts = tuple(part.copy() for part in self.parts)
        for key, by in changes.items():
            if isinstance(key, int):
                x[key] += by
            else:
                parts[key[0] == "theta"][key[0]][key[1]] += by
        m = _without_memo(self.m)
        return replace(self, x=x, m=m, parts=parts, state=self.state if state is None else state)


def _without_memo(m: Vector) -> Vector:
    """Without the kernel's memory of the last contact, which no longer applies."""
    m = m.copy()
    m[layout.MEMO_V] = math.nan
    m[layout.MEMO_DONE] = 0.0
    return m


@dataclass(frozen=True, eq=False)
class SampledStart:
    """A drive or chain and a controller that is set up for it."""

    drive: Machine
    controller: Controller
    step: Step
    p: Vector
    first_state: Vector
    given: Numbers | None = field(default=None, repr=False)  # of a chain

    @classmethod
    def of(cls, drive: Machine, controller: Controller, fitted_to: Machine | None = None) -> SampledStart:
        """The controller set up for this (or that) drive; no rounding or noise, the target speed far away."""
        fitted, own = controller.set_up(two_masses(fitted_to or drive))
        given = None
        if isinstance(drive, Chain):
            given = numbers(drive, None, None, MAX_EVENTS)
            p = given.p
        else:
            p = plant_vector(drive)[0].copy()
        p[layout.TARGET] *= FAR
        p[layout.ENCODER] = 0.0
        p[layout.TORQUE_NOISE] = 0.0
        if isinstance(fitted, CompiledController):
            return cls(drive, fitted, _compiled(fitted, own), p, np.zeros(fitted.state_size), given)
        if isinstance(fitted, PlainController):
            first = np.array(fitted.initial_state, dtype=np.float64)
            return cls(drive, fitted, _plain(fitted), p, first, given)
        raise InputError(
            f"controller = {type(fitted).__name__}: derive it from PlainController or CompiledController."
        )

    @property
    def sees(self) -> int:
        """The sensors that the controller reads."""
        return int(self.controller.sensors)

    @property
    def differencing(self) -> bool:
        """Whether the speed is the difference of two encoder angles."""
        return float(motor_of(self.drive).encoder_lines) > 0.0

    def recorder(self) -> Recorder:
        """A start that has not begun."""
        if self.given is not None:
            return ChainRecorder(self.given, self.sees, rows=0)
        return Recorder(self.p, self.sees, recording=False)

    def shaft_torque(self, sample: Sample) -> float:
        """Torque at a sample in contact, N m: of a chain that of the shaft beside the motor."""
        p = self.p
        if self.given is None:
            twist = sample.x[layout.THETA] - 0.5 * p[layout.GAP]
            return float(p[layout.C] * twist + p[layout.D] * sample.x[layout.V])
        masses, shafts = sample.parts
        k, w = self.given.place.motor_shaft, masses["w"]
        shaft = shafts[k]
        z = shaft["theta"] - shaft["side"] * shaft["half"]
        torque = shaft["c"] * z + shaft["d"] * (w[k] - w[k + 1])
        return float(torque if self.given.place.motor <= k else -torque)

    def displacements(self, angle: float, speed: float) -> list[tuple[dict[Part, float], dict[str, float]]]:
        """Small motions in all directions: what they change of the plant, and of the rows of `Continuous`."""
        if self.given is None:
            return [
                ({layout.THETA: angle}, {"phi1": angle, "z": angle}),
                ({layout.V: speed}, {"w1": speed}),
                ({layout.W2: speed}, {"w1": speed, "w2": speed}),
                ({layout.PHI2: angle}, {"phi1": angle}),
            ]
        masses, motor = self.given.masses, self.given.place.motor
        curved = np.flatnonzero(masses["by_angle"] * masses["points"]).tolist()
        found: list[tuple[dict[Part, float], dict[str, float]]] = [
            ({layout.PHI2: angle} | {("angle", i): angle for i in curved}, {"phi1": angle})
        ]
        bodies: list[list[int]] = [[0]]
        for k, rigid in enumerate(self.given.shafts["rigid"].tolist()):
            if rigid:
                bodies[-1].append(k + 1)
            else:
                bodies.append([k + 1])
                moves: dict[Part, float] = {("theta", k): angle}
                for i in curved:  # what lies behind the shaft turns, seen from the motor
                    if motor <= k < i or i <= k < motor:
                        moves["angle", i] = -angle if k < i else angle
                found.append((moves, {f"theta {k}": angle}))
        moving = [body for body in bodies if np.isfinite(masses["J"][body]).all()]
        found += [({("w", i): speed for i in body}, {f"w {body[0]}": speed}) for body in moving]
        return found

    def samples(self, until: float) -> Iterator[Sample]:
        """The start from its beginning."""
        recorder = self.recorder()
        recorder.begin(until)
        recorder.x[layout.ASK_ON_GAP] = 1.0 if self.controller.sensors & Sensor.STAGE else 0.0
        yield from self._continued(recorder, self.first_state)

    def from_sample(self, sample: Sample, until: float, recorder: Recorder | None = None) -> Iterator[Sample]:
        """The start from a sample on, whose plant or state may have been changed."""
        recorder = recorder or self.recorder()
        for part, kept in zip(_parts(recorder), sample.parts, strict=True):
            part[:] = kept
        recorder.x[:] = sample.x
        recorder.x[[layout.N_SEGMENTS, layout.N_EVENTS, layout.N_STAGES]] = 0.0
        recorder.x[layout.T_END] = until
        recorder.m[:] = sample.m
        yield from self._continued(recorder, sample.state)

    def _continued(self, recorder: Recorder, state: Vector) -> Iterator[Sample]:
        while True:
            reason = recorder.advance()
            if reason == layout.BUFFER_FULL:
                recorder.grow()
                continue
            if reason == layout.ENDED:
                return
            if reason != layout.ASK:
                raise SimulationError(
                    f"{self._name}: the start was given up at t = {recorder.x[layout.TIME]:.6g} s."
                )
            x, m = recorder.x.copy(), recorder.m.copy()
            measured = self._measured(recorder)
            demand, ask_again, slope, after = self.step(measured, state)
            parts = tuple(part.copy() for part in _parts(recorder))
            yield Sample(x, m, measured, state, demand, ask_again, slope, parts)
            if kernel.obey(self.p, recorder.x, recorder.m, demand, ask_again, slope) != layout.ASK:
                raise SimulationError(
                    f"{self._name}: at t = {recorder.x[layout.TIME]:.6g} s the controller's answer was no "
                    f"command (torque {demand:.6g} N m, ask again at {ask_again:.6g} s)."
                )
            state = after

    def _measured(self, recorder: Recorder) -> Vector:
        before, when = recorder.x[layout.SAMPLE_ANGLE], recorder.x[layout.SAMPLE_TIME]
        recorder.measure()
        measured = recorder.measured.copy()
        now = measured[exchange.M_TIME]
        if self.differencing and recorder.x[layout.ASKED] != 0.0 and now > when:
            measured[exchange.M_MOTOR_SPEED] = (measured[exchange.M_MOTOR_ANGLE] - before) / (now - when)
        return measured

    @property
    def _name(self) -> str:
        return f"{self.drive.name}, controller {label_of(self.controller)}"


def _parts(recorder: Recorder) -> tuple[Any, ...]:
    """Records of masses and shafts; none of a drive."""
    return (recorder.start.masses, recorder.start.shafts) if isinstance(recorder, ChainRecorder) else ()


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
