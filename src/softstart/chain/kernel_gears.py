"""Gears with losses: what they pass on, what they hold at rest, and where the flow of power turns.

A gear of efficiency eta sits between its shaft and the mass on the other side of it, and has the speed w of
that mass. Of the shaft torque T it passes `eta T` on to the mass when power flows that way, and takes `T/eta`
from it when power flows back. The difference is friction on the mass, against its motion:

    (1 - eta) |T|      where the shaft drives the mass
    (1/eta - 1) |T|    where the mass drives the shaft

It passes continuously through T = 0, and jumps where the speed changes its sign with a torque on: there the
mass sticks while the torque that moves it lies between the two (A. F. Filippov, Differential Equations with
Discontinuous Righthand Sides, 1988), as one with a reactive load does, with limits that go with T.
"""

from __future__ import annotations

from softstart.chain import kernel_layout as at
from softstart.chain.kernel_layout import (
    AFTER,
    BEFORE,
    DIRECTION,
    ETA,
    FIRST,
    GEAR,
    GEARS,
    HALF,
    HOLD,
    MASK,
    MC,
    MODE,
    RUBBING,
    SIGN,
    TORQUE,
    USED,
    Cube,
    Matrix,
    Vector,
    W,
)
from softstart.chain.kernel_roots import EPS, NONE, first_root
from softstart.plant.jit import compiled
from softstart.plant.layout import DEAD_ZONE

ROUNDING = 4.0 * EPS


@compiled
def set_gears(shafts: Matrix, mass: Matrix, shaft: Matrix) -> None:
    """The share of each shaft torque that acts on the masses beside it, in the present directions."""
    for k in range(shafts.shape[0]):
        shaft[k, BEFORE] = 1.0
        shaft[k, AFTER] = 1.0
        eta = shafts[k, ETA]
        if eta == 1.0:
            continue
        i = k + int(shafts[k, GEAR])
        mass[int(mass[i, FIRST]), GEARS] += 1.0
        forward = shaft[k, SIGN] * mass[i, DIRECTION]  # power flows towards the last mass
        if forward == 0.0:
            continue
        if i == k:
            shaft[k, BEFORE] = 1.0 / eta if forward > 0.0 else eta
        else:
            shaft[k, AFTER] = eta if forward > 0.0 else 1.0 / eta


@compiled
def grip(shafts: Matrix, shaft: Matrix, series: Cube, j: int, direction: float, o: int) -> float:
    """The coefficient of order o of the friction of the gears at mass j, were it to move so."""
    total = 0.0
    for k in range(max(j - 1, 0), min(j + 1, shafts.shape[0])):
        eta = shafts[k, ETA]
        if eta == 1.0 or k + int(shafts[k, GEAR]) != j:
            continue
        driven = shaft[k, SIGN] * direction if j > k else -shaft[k, SIGN] * direction
        share = (1.0 - eta if driven > 0.0 else 1.0 / eta - 1.0) * shaft[k, SIGN]
        total += share * series[TORQUE, k, o]
    return total


@compiled
def body_grip(
    shafts: Matrix, mass: Matrix, shaft: Matrix, series: Cube, i: int, direction: float, o: int
) -> float:
    """The same of all gears of the body that begins with mass i."""
    total = 0.0
    for j in range(i, mass.shape[0]):
        if int(mass[j, FIRST]) != i:
            break
        total += grip(shafts, shaft, series, j, direction, o)
    return total


@compiled
def held_by(masses: Matrix, shafts: Matrix, mass: Matrix, shaft: Matrix, series: Cube, i: int, j: int,
            held: float, o: int) -> float:  # fmt: skip
    """What of `held`, the coefficient of order o of what holds the body i, falls to its mass j.

    What each of several holds is not determined. None holds more than it can if each is used to the same
    share at the beginning of the span, USED; from there on a gear goes with its torque, and reactive loads
    take what is left.
    """
    used = mass[i, USED]
    direction = 1.0 if used >= 0.0 else -1.0
    of_gear = abs(used) * direction * grip(shafts, shaft, series, j, direction, o)
    of_gears = abs(used) * direction * body_grip(shafts, mass, shaft, series, i, direction, o)
    part = masses[j, MC] / mass[i, HOLD] if mass[i, HOLD] > 0.0 else 1.0 / mass[i, RUBBING]
    return of_gear + (held - of_gears) * part


@compiled
def turning(shafts: Matrix, mass: Matrix, shaft: Matrix, series: Cube, f: Vector, k: int, n: int,
            end: float) -> tuple[int, float]:  # fmt: skip
    """The instant at which the torque of a shaft that may pull changes its sign."""
    mode = shaft[k, MODE]
    pulls = mode == at.CONTACT and shafts[k, at.LAW] == DEAD_ZONE and shafts[k, at.D] > 0.0
    if not pulls and mode != at.JOINED:
        return at.NO_EVENT, end
    for o in range(n + 1):
        f[o] = shaft[k, SIGN] * series[TORQUE, k, o]
    noise = shafts[k, at.C] * (abs(shaft[k, at.THETA]) + shafts[k, HALF])
    noise += shafts[k, at.D] * (abs(mass[k, W]) + abs(mass[k + 1, W]))
    noise += mass[int(mass[k, FIRST]), at.SIZE]  # a twist near 0 has the rounding of those before it
    s = first_root(f, n, end, int(shaft[k, MASK]), ROUNDING * noise, 0.0)
    if s < NONE:
        return at.UNSOLVED, 0.0
    return (at.TURNED, s) if s >= 0.0 else (at.NO_EVENT, end)
