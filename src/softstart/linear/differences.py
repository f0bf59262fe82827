"""The derivative of a controller's step at one sample, by differences, with what is not smooth named.

The step is a function (measured, state) -> (demand, new state). Each component is moved both ways by a step
and by half of it, and by ever smaller steps until both sides agree. Richardson's extrapolation of the central
difference is then taken (error of fourth order). Where they never agree: if only one side is linear, as past
a switch that lies exactly at the sample, that side is taken; if each is linear but they differ (a corner: the
demand on a limit), the steeper one; if neither is (a jump: the number of a mode), none. All are reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from softstart.linear.sampled_start import Sample, Step
from softstart.plant import start as kernel

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

STEP = 2.0**-13  # of a component's scale
STEPS = (STEP, 2.0**-17, 2.0**-21)
SAME = 1e-4  # of a column's largest entry, in scales: the two sides agree, or the two step sizes do
NOTHING = 1e-10  # an entry below this, in scales, is rounding


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
    tolerances refer to, `base` that of the demand. `rates` are the rows of demand slope and of the instant of
    the next asking: both must be zero, or the view is not that of a sampled loop.
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
    """Differences of the step at a sample; see the module."""
    size = sample.state.size

    def answer(point: Vector) -> Vector:
        measured = sample.measured.copy()
        measured[list(inputs)] = point[size:]
        demand, ask_again, slope, after = step(measured, point[:size])
        return np.array([*after, demand, slope, ask_again])

    centre = np.concatenate([sample.state, sample.measured[list(inputs)]])
    widths = np.concatenate([scales, input_scales])
    period = max(sample.ask_again - sample.time, 1e-300)
    heights = np.concatenate([scales, [base, base / period, period]])
    now = answer(centre)
    columns, kinds = [], []
    for index, width in enumerate(widths):
        move = np.zeros_like(centre)
        move[index] = width
        tried = []
        for step_size in STEPS:
            with np.errstate(invalid="ignore"):  # "never again" is an infinite instant
                wide, near = (
                    [(answer(centre + by * move) - now) / (by * heights) for by in (share, -share)]
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
    """The indices of `measured` that a small motion changes.

    >>> seen(0)
    (1, 2, 3)
    """
    found = [kernel.M_MOTOR_ANGLE, kernel.M_MOTOR_SPEED, kernel.M_MOTOR_TORQUE]
    if sees & kernel.SEES_SHAFT_TORQUE:
        found.append(kernel.M_SHAFT_TORQUE)
    if sees & kernel.SEES_LOAD_SPEED:
        found.append(kernel.M_LOAD_SPEED)
    return tuple(found)
