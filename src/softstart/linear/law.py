"""The linear law of a controller: the derivative of its step at an instant of its own start.

The start runs on the exact plant (`SampledStart`), with an infinitely fine encoder and without noise, until
the shaft torque is steady. At several samples along the contact the step, a function (measured, state) ->
(demand, new state), is differentiated:

    x+ = A x + B y,   demand = C x + D y        small changes of its state x and of what is measured, y

and the law is compared with the exact plant under the controller itself: each speed and twist is displaced
slightly, both ways, and the responses of shaft torque and demand over a few samples are compared with those
of the linear loop. The steady instant is taken if the prediction is good there, otherwise the instant with
the best prediction: a controller whose demand lies exactly on a limit has no linear law at that point, but it
has one before it gets there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.controller.base import CompiledController, Controller, PlainController, Sensor, label_of
from softstart.drive.machine import Machine
from softstart.errors import InputError, SimulationError
from softstart.kernel import motor as exchange
from softstart.kernel import records as rec
from softstart.linear.plant import Plant, SampledPlant, contact_plant, plant_scales, sampled
from softstart.linear.systems import System
from softstart.start.engine import plain_answer
from softstart.start.kernel_input import KernelInput, kernel_input
from softstart.start.trajectory import StartRecorder

FAR = 1e9  # in target speeds: never reached
CLOSED = (rec.CONTACT, rec.JOINED, rec.PRESSED, rec.WELDED)
LONGEST, STIFF = 58.0, 0.02  # elastic periods and time limits after which a start counts as never steady
MOST_SAMPLES = 20_000
STEADY = 1e-6  # of M12avg_base: spread of shaft torque and demand over two elastic periods
TRIED = {round(1.5**k) for k in range(30)}  # samples of a contact, from its beginning
WINDOW = 16  # samples over which the linear loop is compared with the exact plant
LEAST = 0.01  # of a state: its smallest scale, for rounding's sake
GOOD = 1e-3  # relative mismatch up to which a linear law counts as good
FAIR = 0.1  # the same for a law that feeds back, where the good ones do not: a demand beyond its limit
STEPS = (2.0**-13, 2.0**-17, 2.0**-21)  # of a component's scale
SAME = 1e-4  # of a column's largest entry, in scales: the two sides agree, or the two step sizes do
NOTHING = 1e-10  # an entry below this, in scales, is rounding

NONE = np.zeros(0)

Answer = tuple[float, float, float, Vector]  # demand N m, next sample s, slope N m/s, new state
Step = Callable[[Vector, Vector], Answer]


@dataclass(frozen=True, eq=False)
class Sample:
    """One sample of a start: what is measured, the controller's state and its answer."""

    pressing: bool  # all flanks press and all masses move: the plant is linear
    shaft_torque: float  # of the shaft beside the motor, N m
    measured: Vector
    state: Vector
    demand: float
    ask_again: float
    work: Vector  # of the kernel just before; empty where it is not kept

    @property
    def time(self) -> float:
        """Instant, s."""
        return float(self.measured[exchange.M_TIME])

    @property
    def period(self) -> float:
        """The time to the next sample, s; NaN if there is none or the plant is not linear."""
        return self.ask_again - self.time if self.pressing and self.ask_again < math.inf else math.nan

    @property
    def plant(self) -> Any:
        """The plant by names, as `softstart.kernel.records` has them."""
        return self.work.view(rec.WORK)[0]

    def displaced(self, plant: Plant, by: Vector) -> Sample:
        """The sample with the machine moved by a state of `plant`, and the controller not."""
        copy = replace(self, work=self.work.copy(), state=self.state.copy())
        now = copy.plant
        now["leading_zeros"][:] = now["passed"][:] = 0  # what has just happened no longer applies
        for name, rows in plant.masses.items():
            now[name][: len(rows)] += rows @ by[: rows.shape[1]]
        for name, row in (("phi", plant.rows["phi2"]), ("u", plant.rows.get("u", NONE))):
            now[name] += row @ by[: row.size]
        return copy


@dataclass(frozen=True, eq=False)
class SampledStart:
    """A machine as the kernel has it, and a controller that is set up for it.

    `differencing` says whether the speed is the difference of two encoder angles.
    """

    machine: Any
    controller: Controller
    step: Step
    rows: KernelInput
    first_state: Vector
    differencing: bool

    @classmethod
    def of(cls, machine: Machine, controller: Controller, fitted_to: Machine | None = None) -> SampledStart:
        """The controller set up for this (or that) machine; no rounding or noise, the target speed far."""
        fitted, fitted_drive = controller.set_up((fitted_to or machine).design_drive)
        rows = kernel_input(machine)
        differencing = bool(rows.machine.encoder > 0.0)
        rows.machine.target *= FAR
        rows.machine.encoder = rows.machine.torque_noise = 0.0
        if isinstance(fitted, CompiledController):
            step = _compiled(fitted, np.array(fitted.vector(fitted_drive), dtype=np.float64).ravel())
            first = np.zeros(fitted.state_size)
        elif isinstance(fitted, PlainController):
            step, first = _plain(fitted), np.array(fitted.initial_state, dtype=np.float64)
        else:
            raise InputError(
                f"controller = {type(fitted).__name__}: derive it from PlainController or CompiledController."
            )
        return cls(machine, fitted, step, rows, first, differencing)

    @property
    def sees(self) -> int:
        """The sensors that the controller reads."""
        return int(self.controller.sensors)

    @property
    def inputs(self) -> tuple[int, ...]:
        """The indices of what is measured that a small motion changes."""
        indices = [exchange.M_MOTOR_ANGLE, exchange.M_MOTOR_SPEED, exchange.M_MOTOR_TORQUE]
        indices += [exchange.M_SHAFT_TORQUE] * bool(self.sees & rec.SEES_SHAFT_TORQUE)
        indices += [exchange.M_LOAD_SPEED] * bool(self.sees & rec.SEES_LOAD_SPEED)
        return tuple(indices)

    def samples(self, until: float, begin: Sample | None = None) -> Iterator[Sample]:
        """The start from its beginning or from a kept sample."""
        recorder = StartRecorder(self.rows, self.sees | rec.SEES_SHAFT_TORQUE, 0)
        recorder.begin(until, bool(self.controller.sensors & Sensor.STAGE))
        now, state = recorder.state, self.first_state
        if begin is not None:
            recorder.work[:], state = begin.work, begin.state
            now.modes_changed, now.t_end = 1.0, until
        name = f"{self.machine.name}, controller {label_of(self.controller)}"
        while (reason := recorder.advance()) != rec.ENDED:
            if reason != rec.ASK:
                raise SimulationError(f"{name}: the start was given up at t = {now.time:.6g} s.")
            work = recorder.work.copy()
            measured, torque = self._measured(recorder)
            demand, ask_again, slope, after = self.step(measured, state)
            moves = (now.has_friction == 0.0) | (now.direction != 0.0)
            pressing = np.isin(now.mode[: self.rows.count - 1], CLOSED).all() and moves.all()
            yield Sample(bool(pressing), torque, measured, state, demand, ask_again, work)
            if recorder.answer(demand, ask_again, slope) != rec.ASK:
                raise SimulationError(
                    f"{name}: at t = {now.time:.6g} s the controller's answer was no "
                    f"command (torque {demand:.6g} N m, ask again at {ask_again:.6g} s)."
                )
            state = after

    def sampled(self, plant: Plant, period: float, further: float = 0.0) -> SampledPlant:
        """The plant as this controller sees it, with the dead time of the drive and so much further, s."""
        delay = float(self.rows.machine.dead_time) + further
        return sampled(plant, period, delay, self.inputs, self.differencing)

    def _measured(self, recorder: StartRecorder) -> tuple[Vector, float]:
        """What the controller sees, and the shaft torque, which it may not see."""
        now = recorder.state
        before, when = float(now.sample_angle), float(now.sample_time)
        recorder.measure()
        measured = recorder.measured.copy()
        torque = float(measured[exchange.M_SHAFT_TORQUE])
        if not self.sees & rec.SEES_SHAFT_TORQUE:
            measured[exchange.M_SHAFT_TORQUE] = math.nan
        if self.differencing and now.asked != 0.0 and now.time > when:
            measured[exchange.M_MOTOR_SPEED] = (measured[exchange.M_MOTOR_ANGLE] - before) / (now.time - when)
        return measured, torque


def _compiled(controller: CompiledController, numbers: Vector) -> Step:
    size, lines = controller.state_size, type(controller).kernel

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


@dataclass(frozen=True, eq=False)
class SampledRun:
    """The samples of a start, the longest stretch of them in one contact at one sample period (the last of
    equals), and by index those with the work of the kernel, at which the controller is linearised.
    """

    samples: list[Sample]
    contact: range  # indices; empty if there is none
    kept: dict[int, Sample]
    steady: bool

    @property
    def period(self) -> float:
        """Of the stretch, s."""
        return self.samples[self.contact[0]].period


def run_until_steady(start: SampledStart) -> SampledRun:
    """Run the start until it is steady, at most for LONGEST and STIFF."""
    sizes = plant_scales(start.machine)
    samples: list[Sample] = []
    contact, kept = range(0), {}
    first, period, candidates = 0, math.nan, dict[int, Sample]()
    pressing, steady = 0, False  # samples since it was last open
    for index, sample in enumerate(
        start.samples(LONGEST * sizes.period + STIFF * float(start.rows.machine.time_limit))
    ):
        samples.append(replace(sample, work=NONE))
        if not abs(sample.period - period) <= 1e-6 * sample.period:
            first, period, candidates = index, sample.period, {}
        elif index - 1 - first not in TRIED:
            del candidates[index - 1]
        candidates[index] = sample
        if period > 0.0 and index + 1 - first >= len(contact):
            contact, kept = range(first, index + 1), candidates
        pressing = pressing + 1 if sample.pressing else 0
        if index % 8 == 7 and sample.period > 0.0:
            back = max(WINDOW, math.ceil(2.0 * sizes.period / sample.period))
            if pressing >= back:
                recent = np.array([(one.shaft_torque, one.demand) for one in samples[-back:]])
                steady = bool(np.ptp(recent, axis=0).max() <= STEADY * sizes.base)
        if steady or len(samples) >= MOST_SAMPLES:
            break
    return SampledRun(samples, contact, kept, steady)


def derivative(
    step: Step, sample: Sample, inputs: tuple[int, ...], scales: Vector, input_scales: Vector, base: float
) -> System:
    """A step at a sample for small changes: x+ = A x + B y, and C x + D y of demand, slope, next instant.

    `scales` and `input_scales` are the sizes of x and y, `base` that of the demand. Each component is
    displaced both ways by a step and by half of it, with ever smaller steps until both sides agree;
    Richardson's extrapolation of the central difference has an error of fourth order. Where the sides never
    agree, the steeper side that is linear is taken (a corner or a switch: a demand on its limit), or nothing
    (a jump: the number of a mode).
    """
    size, seen = sample.state.size, list(inputs)
    period = max(sample.ask_again - sample.time, 1e-300)
    widths = np.concatenate([scales, input_scales])
    heights = np.concatenate([scales, [base, base / period, period]])

    def response(index: int, by: float) -> Vector:
        point = np.concatenate([sample.state, sample.measured[seen]])
        point[index] += by * widths[index]
        measured = sample.measured.copy()
        measured[seen] = point[size:]
        demand, ask_again, slope, after = step(measured, point[:size])
        return np.asarray(np.array([*after, demand, slope, ask_again]) / heights)

    now = response(0, 0.0)

    def quotients(index: int, by: float) -> Matrix:
        return np.array([(response(index, side) - now) / side for side in (by, -by)])

    def slope(index: int) -> Vector:
        one_sided = []
        for by in STEPS:
            wide, near = quotients(index, by), quotients(index, 0.5 * by)
            sides = 2.0 * near - wide
            tolerance = SAME * max(float(np.max(np.abs(near))), NOTHING)
            straight = sides[np.all(np.abs(near - wide) <= tolerance, axis=1)]
            if len(straight) == 2 and np.all(np.abs(sides[0] - sides[1]) <= tolerance):
                return np.asarray((2.0 * near.sum(axis=0) - 0.5 * wide.sum(axis=0)) / 3.0)
            one_sided += [straight] if len(straight) else []
        return max(one_sided[0], key=lambda side: float(np.abs(side).sum())) if one_sided else 0.0 * heights

    with np.errstate(invalid="ignore", over="ignore"):  # "never again" is an infinite instant
        columns = np.array([slope(index) for index in range(widths.size)]).reshape(-1, heights.size)
    whole = (np.where(np.abs(columns) < NOTHING, 0.0, columns) * heights / widths[:, None]).T
    return System(whole[:size, :size], whole[:size, size:], whole[size:, :size], whole[size:, size:])


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """An instant, and the controller's part in the loop there.

    `law` has the states `states` of the controller: those that a measured quantity moves and that show in the
    demand. `is_sampled`: nothing measured changes the slope of the demand or the instant of the next sample.
    `mismatch` is the largest difference between linear and exact response, relative to the exact.
    """

    sample: Sample
    period: float
    law: System
    states: list[int]
    is_sampled: bool
    mismatch: float
    steady: bool

    @property
    def feeds_back(self) -> bool:
        """Whether anything measured changes the demand."""
        return bool(self.states) or bool(np.any(self.law.D))


def operating_point(start: SampledStart, run: SampledRun) -> OperatingPoint | None:
    """The steady one if its law is good and feeds back; else the best that feeds back; else the best."""

    def rank(point: OperatingPoint) -> tuple[bool, ...]:
        feeds, good = point.feeds_back, point.mismatch < GOOD
        return feeds and good and point.steady, feeds and good, feeds and point.mismatch < FAIR, good, feeds

    return max(operating_points(start, run), key=rank, default=None)


def operating_points(start: SampledStart, run: SampledRun) -> list[OperatingPoint]:
    """The candidates along the contact, best prediction first; empty if there are no samples in contact."""
    if len(run.contact) < 3:
        return []
    points = [_linearised_at(start, run, index, sample) for index, sample in run.kept.items()]
    return sorted(points, key=lambda sample: sample.mismatch)


def _linearised_at(start: SampledStart, run: SampledRun, index: int, sample: Sample) -> OperatingPoint:
    sizes, inputs = plant_scales(start.machine), start.inputs
    of_inputs = {
        exchange.M_MOTOR_ANGLE: sizes.windup,
        exchange.M_MOTOR_TORQUE: sizes.base,
        exchange.M_SHAFT_TORQUE: sizes.base,
    }
    input_scales = np.array([of_inputs.get(one, sizes.speed) for one in inputs])
    scales = _scales(run, index, sizes.period)
    whole = derivative(start.step, sample, inputs, scales, input_scales, sizes.base)
    demand = whole._replace(C=whole.C[:1], D=whole.D[:1])
    states = demand.connected()
    law = demand.part(states)
    is_sampled = not (np.any(whole.C[1:, states]) or np.any(whole.D[1:]))
    steady = run.steady and index == run.contact[-1]
    difference = mismatch(start, sample, run.period, law)
    return OperatingPoint(sample, run.period, law, states, is_sampled, difference, steady)


def _scales(run: SampledRun, index: int, elastic_period: float) -> Vector:
    """The size of each state: how far it moves within an elastic period, a share of itself, or 1."""
    back = math.ceil(elastic_period / run.period)
    states = np.array([one.state for one in run.samples[max(run.contact[0], index - back) : index + 1]])
    with np.errstate(invalid="ignore"):
        reach = np.nan_to_num(np.ptp(states, axis=0), nan=0.0, posinf=0.0)
    size = np.nan_to_num(np.abs(states[-1]), nan=0.0, posinf=0.0)
    scale = np.maximum(reach, LEAST * size)
    return np.where(scale > 0.0, scale, 1.0)


def mismatch(start: SampledStart, sample: Sample, period: float, law: System) -> float:
    """The linear loop against the exact plant under the controller, after small displacements both ways.

    Displaced are the whole machine, each twist and the speed of each body.
    """
    sizes, plant = plant_scales(start.machine), contact_plant(start.machine, sample.plant["incline"])
    loop, _, read = closed_loop(start.sampled(plant, period), law)
    until = sample.time + (WINDOW - 0.5) * period
    angles = plant.masses["w"].shape[1] - plant.inertias.size
    widths = [sizes.windup] * angles + [sizes.speed] * plant.inertias.size
    worst = 0.0
    for index, width in enumerate(widths):
        if index >= angles and math.isinf(plant.inertias[index - angles]):
            continue  # the ground
        state = first = width * np.eye(1, loop.shape[0], index)[0]
        predicted, responses = np.zeros((WINDOW, 2)), []
        for k in range(WINDOW):
            predicted[k], state = read @ state, loop @ state
        for by in (STEPS[0], -STEPS[0]):
            played = list(start.samples(until, begin=sample.displaced(plant, by * first)))
            if len(played) != WINDOW or not all(one.pressing for one in played):
                return math.inf
            responses.append([(one.shaft_torque, one.demand) for one in played])
        response = (np.array(responses[0]) - responses[1]) / (2.0 * STEPS[0])
        size = max(float(np.max(np.abs(response))), 1e-3 * sizes.base)
        worst = max(worst, float(np.max(np.abs(response - predicted))) / size)
    return worst


def closed_loop(plant: SampledPlant, law: System) -> tuple[Matrix, Vector, Matrix]:
    """The closed loop's transition matrix, its input of a torque added to the demand, and what is read.

    States are those of the plant and of the controller; read are the shaft torque and the demand.
    """
    A, B, C, _ = plant.system
    order = law.A.shape[0]
    into = np.append(B, np.zeros(order))
    demand = np.hstack([law.D @ C, law.C])
    whole = np.block([[A, np.zeros((A.shape[0], order))], [law.B @ C, law.A]])
    torque = np.append(plant.torque, np.zeros(order))
    return np.asarray(whole + np.outer(into, demand)), into, np.vstack([torque, demand])
