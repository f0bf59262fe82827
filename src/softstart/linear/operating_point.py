"""The operating point: an instant of the controller's own start at which its linear law holds.

The start is run on the exact plant until the shaft torque is steady. Several samples along the contact are
tried. At each, the loop of the linearised controller and the sampled plant must predict the response of the
exact plant, under the controller itself, to small displacements of twist and speeds. The steady instant is
taken if the prediction is good there, otherwise the instant with the best prediction: a controller whose
demand lies exactly on a limit has no linear law at that point, but it has one before it gets there.

The law is the derivative of the controller's step, a function (measured, state) -> (demand, new state), by
differences. Each component is displaced both ways by a step and by half of it, with ever smaller steps until
both sides agree. Richardson's extrapolation of the central difference is then taken (error of fourth order).
Where the sides never agree: if only one side is linear, as at a switch that lies exactly at the sample, that
side is taken; if each is linear but they differ (a corner: the demand on a limit), the steeper; if neither
is (a jump: the number of a mode), none. All these cases are reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.kernel import motor as exchange
from softstart.kernel import records as at
from softstart.linear.sampled_plant import SampledPlant, in_contact, sampled, sizes_of
from softstart.linear.sampled_start import Part, Sample, SampledStart, Step
from softstart.linear.systems import System, moved, part, shown

LONGEST, STIFF = 60.0, 2.0  # elastic periods and stiff starts after which a start counts as never steady
MOST_SAMPLES = 20_000
STEADY = 1e-6  # of M12avg_base: spread of shaft torque and demand over two elastic periods
WINDOW = 16  # samples over which the linear loop is compared with the exact plant
LEAST = 0.01  # of a state: its smallest scale, for rounding's sake
GOOD = 1e-3  # relative mismatch up to which a linear law counts as good
STEP = 2.0**-13  # of a component's scale
STEPS = (STEP, 2.0**-17, 2.0**-21)
SAME = 1e-4  # of a column's largest entry, in scales: the two sides agree, or the two step sizes do
NOTHING = 1e-10  # an entry below this, in scales, is rounding


@dataclass(frozen=True, eq=False)
class SampledRun:
    """The samples of a start, and the longest stretch of them in one contact at one sample period."""

    samples: tuple[Sample, ...]
    first: int  # of the contact; above `last` if there is none
    last: int
    period: float
    steady: bool


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """An instant, the derivative of the step there, and the controller's part in the loop.

    `law` has the states `states` of the controller: those that a measured quantity moves and that show in the
    demand. `mismatch` is the largest difference between linear and exact response, relative to the exact.
    """

    sample: Sample
    derivative: Derivative
    states: tuple[int, ...]
    law: System
    plant: SampledPlant
    mismatch: float
    steady: bool

    @property
    def rough(self) -> tuple[tuple[int, Smoothness], ...]:
        """The states in the loop in which the step is not smooth, by their numbers."""
        kinds = self.derivative.smoothness
        return tuple((i, kinds[i]) for i in self.states if kinds[i] is not Smoothness.SMOOTH)


def run_until_steady(start: SampledStart) -> SampledRun:
    """Run the start until it is steady, at most for LONGEST and STIFF."""
    sizes = sizes_of(start.drive)
    period = sizes.period
    enough = STEADY * sizes.base
    samples: list[Sample] = []
    torques: list[float] = []  # of the samples in contact since it was last open
    steady = False
    for sample in start.samples(LONGEST * period + STIFF * _stiff(start)):
        samples.append(sample)
        if sample.pressing:
            torques.append(start.shaft_torque(sample))
        else:
            torques.clear()
        if len(samples) >= MOST_SAMPLES:
            break
        if len(samples) % 8 == 0 and sample.pressing and math.isfinite(sample.ask_again):
            back = max(WINDOW, math.ceil(2.0 * period / (sample.ask_again - sample.time)))
            if len(torques) >= back:
                demands = [one.demand for one in samples[-back:]]
                steady = max(np.ptp(torques[-back:]), np.ptp(demands)) <= enough
                if steady:
                    break
    return _in_contact(tuple(samples), steady)


def _stiff(start: SampledStart) -> float:
    """The time of a stiff start under the starting torque, s."""
    drive: Any = start.drive
    mass = start.rows.masses.view(at.MASS)[0, :, 0]
    target = float(drive.target_speed or 0.0)
    against = float((mass["Mc"] + mass["active"] + mass["friction"] + mass["ground"] * target).sum())
    Ms = float(drive.motor.starting_torque)
    return float(mass["J"][np.isfinite(mass["J"])].sum()) * target / max(Ms - against, 0.01 * Ms)


def _in_contact(samples: tuple[Sample, ...], steady: bool) -> SampledRun:
    """The longest stretch of samples in one contact at one period; the last of equals."""
    best = (1, 0, 0.0)
    first, period = 0, math.nan
    for index, sample in enumerate(samples):
        own = sample.ask_again - sample.time
        same = sample.pressing and math.isfinite(own) and abs(own - period) <= 1e-6 * own
        if not same:
            period = own if sample.pressing and math.isfinite(own) else math.nan
            first = index if not math.isnan(period) else index + 1
        if index - first >= best[1] - best[0] and not math.isnan(period):
            best = (first, index, period)
    return SampledRun(samples, *best, steady)


def operating_points(start: SampledStart, run: SampledRun) -> list[OperatingPoint]:
    """The candidates along the contact, best prediction first; empty if there are no samples in contact."""
    if run.last - run.first < 2:
        return []
    ends = {run.first + 1, run.last}
    offsets = {round(1.5**k) for k in range(1, 30)}
    ends |= {run.first + offset for offset in offsets if run.first + offset < run.last}
    found = [_linearised_at(start, run, index) for index in sorted(ends)]
    return sorted(found, key=lambda one: one.mismatch)


def _linearised_at(start: SampledStart, run: SampledRun, index: int) -> OperatingPoint:
    sample = run.samples[index]
    plant = sampled(
        in_contact(start.drive, sample.plant["incline"]), run.period, float(start.rows.machine.dead_time),
        seen(start.sees), start.differencing,
    )  # fmt: skip
    size = sizes_of(start.drive)
    base, windup, speed = size.base, size.windup, size.speed
    inputs = seen(start.sees)
    sizes = {1: windup, 2: speed, 3: base, 5: base, 6: speed}
    input_scales = np.array([sizes[i] for i in inputs])
    found = derivative(start.step, sample, inputs, _scales(run, index, size.period), input_scales, base)
    whole = System(found.A, found.B, found.C, found.D)
    reached = moved(whole)
    kept = [reached[i] for i in shown(part(whole, reached))]
    point = OperatingPoint(
        sample, found, tuple(kept), part(whole, kept), plant, math.inf, run.steady and index == run.last
    )
    return replace(point, mismatch=_mismatch(start, point, run.period, base, windup, speed))


def _scales(run: SampledRun, index: int, elastic_period: float) -> Vector:
    """The size of each state: how far it moves within an elastic period, a share of itself, or 1."""
    back = math.ceil(elastic_period / run.period)
    states = np.array([one.state for one in run.samples[max(run.first, index - back) : index + 1]])
    with np.errstate(invalid="ignore"):
        reach = np.nan_to_num(np.ptp(states, axis=0), nan=0.0, posinf=0.0)
    size = np.nan_to_num(np.abs(run.samples[index].state), nan=0.0, posinf=0.0)
    scale = np.maximum(reach, LEAST * size)
    return np.where(scale > 0.0, scale, 1.0)


def _mismatch(
    start: SampledStart, point: OperatingPoint, period: float, base: float, windup: float, speed: float
) -> float:
    """The linear loop against the exact plant under the controller, after small displacements both ways."""
    rows = point.plant.rows
    worst = 0.0
    loop, read = closed(point.plant, point.law)
    read = np.vstack([np.hstack([rows["T"], np.zeros((1, point.law.A.shape[0]))]), read])
    for moves, same in start.displacements(windup, speed):
        state = np.zeros(loop.shape[0])
        for name, size in same.items():
            state[: rows["T"].shape[1]] += size * rows[name][0]
        predicted = np.zeros((WINDOW, 2))
        for k in range(WINDOW):
            predicted[k] = read @ state
            state = loop @ state
        there, back = (
            _replayed(start, point.sample, {i: side * by for i, by in moves.items()}, period)
            for side in (STEP, -STEP)
        )
        if there is None or back is None:
            return math.inf
        response = (there - back) / (2.0 * STEP)
        size = max(float(np.max(np.abs(response))), 1e-3 * base)
        worst = max(worst, float(np.max(np.abs(response - predicted))) / size)
    return worst


def closed(plant: SampledPlant, law: System) -> tuple[Vector, Vector]:
    """The loop closed: its transition matrix over (plant, controller), and the row that reads the demand."""
    A, B, C, _ = plant.system
    read = np.hstack([law.D @ C, law.C])
    whole = np.block([[A, np.zeros((A.shape[0], law.A.shape[0]))], [law.B @ C, law.A]])
    return whole + np.vstack([B, np.zeros((law.A.shape[0], 1))]) @ read, read


def _replayed(start: SampledStart, sample: Sample, moves: dict[Part, float], period: float) -> Vector | None:
    """Shaft torque and demand at the samples from here on; None if the contact does not last."""
    rows = []
    for one in start.from_sample(sample.displaced(moves), sample.time + (WINDOW - 0.5) * period):
        if not one.pressing:
            return None
        rows.append((start.shaft_torque(one), one.demand))
    return np.array(rows) if len(rows) == WINDOW else None


class Smoothness(Enum):
    """How the step depends on one component."""

    SMOOTH = "smooth"
    ONE_SIDED = "linear on one side only"
    CORNER = "a corner: each side has its own slope"
    JUMP = "a jump: no slope at all"


ORDER = list(Smoothness)


@dataclass(frozen=True, eq=False)
class Derivative:
    """x+ = A x + B y, demand = C x + D y: small changes of state x and measured y about a sample.

    `inputs` are the indices of `measured`; `scales` and `input_scales` the sizes of x and y that the
    tolerances refer to, `base` that of the demand. `rates` are the rows of the demand's slope and of the
    instant of the next sample: both must be zero, or the controller is not a sampled loop.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    rates: Matrix
    inputs: tuple[int, ...]
    smoothness: tuple[Smoothness, ...]  # of the states, then of the inputs
    scales: Vector
    input_scales: Vector
    base: float


def derivative(
    step: Step, sample: Sample, inputs: tuple[int, ...], scales: Vector, input_scales: Vector, base: float
) -> Derivative:
    """The derivative of the step at a sample, by differences."""
    size = sample.state.size

    def response(point: Vector) -> Vector:
        measured = sample.measured.copy()
        measured[list(inputs)] = point[size:]
        demand, ask_again, slope, after = step(measured, point[:size])
        return np.array([*after, demand, slope, ask_again])

    centre = np.concatenate([sample.state, sample.measured[list(inputs)]])
    widths = np.concatenate([scales, input_scales])
    period = max(sample.ask_again - sample.time, 1e-300)
    heights = np.concatenate([scales, [base, base / period, period]])
    now = response(centre)
    columns, kinds = [], []
    for index, width in enumerate(widths):
        move = np.zeros_like(centre)
        move[index] = width
        tried = []
        for step_size in STEPS:
            with np.errstate(invalid="ignore"):  # "never again" is an infinite instant
                wide, near = (
                    [(response(centre + by * move) - now) / (by * heights) for by in (share, -share)]
                    for share in (step_size, 0.5 * step_size)
                )
            tried.append(_slope(wide, near))
            if tried[-1][1] is Smoothness.SMOOTH:
                break
        column, kind = min(tried, key=lambda one: ORDER.index(one[1]))
        column[np.abs(column) < NOTHING] = 0.0
        columns.append(column * heights / width)
        kinds.append(kind)
    whole = np.array(columns).T
    return Derivative(
        whole[:size, :size], whole[:size, size:],
        whole[size : size + 1, :size], whole[size : size + 1, size:],
        whole[size + 1 :], inputs, tuple(kinds), scales, input_scales, base,
    )  # fmt: skip


def _slope(wide: list[Vector], near: list[Vector]) -> tuple[Vector, Smoothness]:
    """The slope from differences over a step and half of it, each forward and backward."""
    with np.errstate(invalid="ignore", over="ignore"):
        forward, backward = sides = [2.0 * half - whole for half, whole in zip(near, wide, strict=True)]
        tolerance = SAME * max(float(np.max(np.abs(near))), NOTHING)
        straight = [
            bool(np.all(np.abs(half - whole) <= tolerance)) for half, whole in zip(near, wide, strict=True)
        ]
        if all(straight):
            if np.all(np.abs(forward - backward) <= tolerance):
                return (2.0 * (near[0] + near[1]) - 0.5 * (wide[0] + wide[1])) / 3.0, Smoothness.SMOOTH
            return max(sides, key=lambda column: float(np.sum(np.abs(column)))), Smoothness.CORNER
    for column, linear in zip(sides, straight, strict=True):
        if linear:
            return column, Smoothness.ONE_SIDED
    return np.zeros_like(forward), Smoothness.JUMP


def seen(sees: int) -> tuple[int, ...]:
    """The indices of `measured` that a small motion changes, for the sensors that are read.

    >>> seen(0)
    (1, 2, 3)
    """
    found = [exchange.M_MOTOR_ANGLE, exchange.M_MOTOR_SPEED, exchange.M_MOTOR_TORQUE]
    if sees & exchange.SEES_SHAFT_TORQUE:
        found.append(exchange.M_SHAFT_TORQUE)
    if sees & exchange.SEES_LOAD_SPEED:
        found.append(exchange.M_LOAD_SPEED)
    return tuple(found)
