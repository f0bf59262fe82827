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
    MASK,
    MODE,
    SIGN,
    TORQUE,
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
def add_grip(
    shafts: Matrix, mass: Matrix, shaft: Matrix, series: Cube, f: Vector, i: int, direction: float, n: int
) -> None:
    """Add to f the friction of the gears of the body that begins with mass i, were it to move so."""
    for k in range(shafts.shape[0]):
        j = k + int(shafts[k, GEAR])
        eta = shafts[k, ETA]
        if eta == 1.0 or int(mass[j, FIRST]) != i:
            continue
        driven = shaft[k, SIGN] * direction if j > k else -shaft[k, SIGN] * direction
        share = (1.0 - eta if driven > 0.0 else 1.0 / eta - 1.0) * shaft[k, SIGN]
        for o in range(n + 1):
            f[o] += share * series[TORQUE, k, o]


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
