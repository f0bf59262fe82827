"""Where the controller is linearised: an instant of its own start at which the linear law holds.

The start is run on the exact plant until the shaft torque is steady. Along the contact several samples are
tried. At each the loop of the linearised controller and the sampled plant must foretell how the exact plant,
under the controller itself, answers to small displacements of twist and speeds. The steady instant is taken
if it does there, else the instant at which it does best: a controller whose demand rests exactly on a limit
has no linear law at that point, but it has one on the way there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softstart.linear.differences import STEP, Derivative, Smoothness, derivative, seen
from softstart.linear.realisation import System, moved, part, shown
from softstart.linear.sampled_plant import SampledPlant, in_contact, sampled
from softstart.linear.sampled_start import Sample, SampledStart
from softstart.plant import layout as at
from softstart.start.metrics import base_torque

Vector = NDArray[np.float64]

LONGEST, STIFF = 60.0, 2.0  # elastic periods and stiff starts after which a start counts as never steady
MOST_SAMPLES = 20_000
STEADY = 1e-6  # of M12avg_base: spread of shaft torque and demand over two elastic periods
WINDOW = 16  # samples over which the linear loop is compared with the exact plant
LEAST = 0.01  # of a state: its smallest scale, for rounding's sake
GOOD = 1e-3  # relative mismatch up to which a law counts as well told


@dataclass(frozen=True, eq=False)
class Course:
    """The samples of a start, and the last ones of them that are in one contact at one sample period."""

    samples: tuple[Sample, ...]
    first: int  # of the contact; no more than `last` if there is none
    last: int
    period: float
    steady: bool


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """An instant, the derivative of the step there, and the controller's part in the loop.

    `law` has the states `states` of the controller: those that something measured moves and that the demand
    shows. `mismatch` is the largest difference between linear and exact response, relative to the exact.
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


def course(start: SampledStart) -> Course:
    """Run the start until it is steady, or for good."""
    drive = start.drive
    period = float(drive.elastic_period)
    stiff = (drive.J1 + drive.J2) * drive.target_speed / (drive.Ms - drive.Mc)
    enough = STEADY * float(base_torque(drive))
    samples: list[Sample] = []
    steady = False
    for sample in start.samples(LONGEST * period + STIFF * float(stiff)):
        samples.append(sample)
        if len(samples) >= MOST_SAMPLES:
            break
        if len(samples) % 8 == 0 and sample.pressing and math.isfinite(sample.ask_again):
            back = max(WINDOW, math.ceil(2.0 * period / (sample.ask_again - sample.time)))
            recent = samples[-back:]
            if len(recent) == back and all(one.pressing for one in recent):
                torques = [torque(start, one) for one in recent]
                demands = [one.demand for one in recent]
                steady = max(np.ptp(torques), np.ptp(demands)) <= enough
                if steady:
                    break
    return _in_contact(tuple(samples), steady)


def _in_contact(samples: tuple[Sample, ...], steady: bool) -> Course:
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
    return Course(samples, *best, steady)


def torque(start: SampledStart, sample: Sample) -> float:
    """Shaft torque at a sample on the driving flank, N m."""
    p, x = start.p, sample.x
    return float(p[at.C] * (x[at.THETA] - 0.5 * p[at.GAP]) + p[at.D] * x[at.V])


def operating_points(start: SampledStart, run: Course) -> list[OperatingPoint]:
    """The candidates along the contact, the one best told first; empty if there are no samples in contact."""
    if run.last - run.first < 2:
        return []
    plant = sampled(
        in_contact(start.drive), run.period, float(start.drive.computing_delay), seen(start.sees),
        start.differencing,
    )  # fmt: skip
    ends = {run.first + 1, run.last}
    offsets = {round(1.5**k) for k in range(1, 30)}
    ends |= {run.first + offset for offset in offsets if run.first + offset < run.last}
    found = [_at(start, run, index, plant) for index in sorted(ends)]
    return sorted(found, key=lambda one: one.mismatch)


def _at(start: SampledStart, run: Course, index: int, plant: SampledPlant) -> OperatingPoint:
    sample = run.samples[index]
    drive = start.drive
    base = float(base_torque(drive))
    windup = base / float(drive.c)
    speed = float(drive.Omega) * windup
    inputs = seen(start.sees)
    sizes = {1: windup, 2: speed, 3: base, 5: base, 6: speed}
    input_scales = np.array([sizes[i] for i in inputs])
    found = derivative(
        start.step, sample, inputs, _scales(run, index, float(drive.elastic_period)), input_scales, base
    )
    whole = System(found.A, found.B, found.C, found.D)
    reached = moved(whole)
    kept = [reached[i] for i in shown(part(whole, reached))]
    point = OperatingPoint(
        sample, found, tuple(kept), part(whole, kept), plant, math.inf, run.steady and index == run.last
    )
    return replace(point, mismatch=_mismatch(start, point, run.period, base, windup, speed))


def _scales(run: Course, index: int, elastic_period: float) -> Vector:
    """The size of each state: how far it goes within an elastic period, a share of itself, or 1."""
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
    displacements = (
        ({at.THETA: windup}, {"phi1": windup, "z": windup}),
        ({at.V: speed}, {"w1": speed}),
        ({at.W2: speed}, {"w1": speed, "w2": speed}),
        ({at.PHI2: windup}, {"phi1": windup}),
    )
    loop, read = closed(point.plant, point.law)
    read = np.vstack([np.hstack([rows["T"], np.zeros((1, point.law.A.shape[0]))]), read])
    for moves, same in displacements:
        state = np.zeros(loop.shape[0])
        for name, size in same.items():
            state[: rows["T"].shape[1]] += size * rows[name][0]
        foretold = np.zeros((WINDOW, 2))
        for k in range(WINDOW):
            foretold[k] = read @ state
            state = loop @ state
        there, back = (
            _replayed(start, point.sample, {i: side * by for i, by in moves.items()}, period)
            for side in (STEP, -STEP)
        )
        if there is None or back is None:
            return math.inf
        response = (there - back) / (2.0 * STEP)
        size = max(float(np.max(np.abs(response))), 1e-3 * base)
        worst = max(worst, float(np.max(np.abs(response - foretold))) / size)
    return worst


def closed(plant: SampledPlant, law: System) -> tuple[Vector, Vector]:
    """The loop closed: its transition matrix over (plant, controller), and the row that reads the demand."""
    A, B, C, _ = plant.system
    read = np.hstack([law.D @ C, law.C])
    whole = np.block([[A, np.zeros((A.shape[0], law.A.shape[0]))], [law.B @ C, law.A]])
    return whole + np.vstack([B, np.zeros((law.A.shape[0], 1))]) @ read, read


def _replayed(start: SampledStart, sample: Sample, moves: dict[int, float], period: float) -> Vector | None:
    """Shaft torque and demand at the samples from here on; None if the contact does not last."""
    rows = []
    for one in start.from_sample(sample.elsewhere(moves), sample.time + (WINDOW - 0.5) * period):
        if not one.pressing:
            return None
        rows.append((torque(start, one), one.demand))
    return np.array(rows) if len(rows) == WINDOW else None
