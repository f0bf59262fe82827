"""The event that ends a span: gaps that close and open, damping regimes, friction, the target speed."""

from __future__ import annotations

import math

from softstart.chain import kernel_layout as at
from softstart.chain.kernel_gears import body_grip, turning
from softstart.chain.kernel_layout import (
    BEYOND,
    BODY_J,
    CONTACT,
    DIRECTION,
    DOUBLED,
    ETA,
    EVENT_LINE,
    FIRST,
    GEARS,
    HALF,
    HELD,
    HOLD,
    INFLUENCE,
    LAW,
    LOAD_MASS,
    MASK,
    MODE,
    OPEN,
    PRESSED,
    RESTITUTION,
    RIGID,
    RUBBING,
    RUBS,
    SIDE,
    SIZE,
    SPEED,
    STUCK,
    THETA,
    TORQUE,
    TWIST,
    Cube,
    D,
    Matrix,
    Vector,
)
from softstart.chain.kernel_modes import GRAZE, REJOINED
from softstart.chain.kernel_roots import EPS, NONE, first_root
from softstart.plant.jit import compiled
from softstart.plant.layout import DEAD_ZONE, MODELICA, START_TIME, TARGET

ROUNDING = 4.0 * EPS
# impacts that pile up within this share of a span are over: the accumulation time is known
PILED_UP = 1e-9
# flanks as elastic as this may tremble for ever: once they rise by no more than GRAZE of the gap, they rest
ELASTIC = 0.999


@compiled
def far(series: Cube, kind: int, row: int, n: int, distance: float) -> bool:
    """Whether what is in this row cannot change by `distance` within the span."""
    total = 0.0
    for o in range(1, n + 1):
        total += abs(series[kind, row, o])
    return total * (1.0 + 1e-12) < distance


@compiled
def line_of(f: Vector, series: Cube, kind: int, row: int, n: int, constant: float, factor: float) -> None:
    """F = constant + factor * the row."""
    for o in range(n + 1):
        f[o] = factor * series[kind, row, o]
    f[0] += constant


@compiled
def flanks(shafts: Matrix, mass: Matrix, shaft: Matrix, series: Cube, f: Vector, k: int, h: float, n: int,
           end: float) -> tuple[int, float]:  # fmt: skip
    """The flank of an open gap that is reached first, or the end of impacts that pile up on one."""
    half = shafts[k, HALF]
    theta = shaft[k, THETA]
    if far(series, TWIST, k, n, half - abs(theta)):
        return at.NO_EVENT, end
    a = int(mass[k, FIRST])
    faint = 1e-14 * h * h * (mass[a, INFLUENCE] + mass[k + 1, INFLUENCE])
    if shafts[k, RIGID] != 0.0 and shaft[k, MASK] == 0.0 and abs(theta) == half and half > 0.0:
        side = math.copysign(1.0, theta)
        rebound = -side * series[TWIST, k, 1]
        press = side * series[TWIST, k, 2]
        e = shafts[k, RESTITUTION]
        if press > faint and rebound >= 0.0:
            flat = e > ELASTIC and rebound * rebound <= 8.0 * press * GRAZE * half
            if flat or rebound <= PILED_UP * (1.0 - e) * press:
                return at.SETTLE, 0.0
    event = at.NO_EVENT
    noise = ROUNDING * half
    for which in range(2):
        side = 1.0 - 2.0 * which
        zeros = int(shaft[k, MASK]) if shaft[k, SIDE] == side else 0
        line_of(f, series, TWIST, k, n, half, -side)
        s = first_root(f, n, end, zeros, noise, faint)
        if s < NONE:
            return at.UNSOLVED, 0.0
        if s >= 0.0:
            event = at.UPPER if which == 0 else at.LOWER
            end = s
    return event, end


@compiled
def parting(shafts: Matrix, shaft: Matrix, series: Cube, f: Vector, k: int, n: int,
            end: float) -> tuple[int, float]:  # fmt: skip
    """The instant at which flanks in contact part, or at which the damping regime changes."""
    side = shaft[k, SIDE]
    law = shafts[k, LAW]
    d = shafts[k, D]
    rejoined = shaft[k, MASK] == REJOINED
    zeros = 0 if rejoined else int(shaft[k, MASK])
    if law == MODELICA and d > 0.0:
        doubled = shaft[k, MODE] == DOUBLED
        sign = -side if doubled else side
        for o in range(n + 1):
            v = series[SPEED, k, o] - series[SPEED, k + 1, o]
            f[o] = sign * (shafts[k, at.C] * series[TWIST, k, o] - d * v)
        f[0] -= sign * shafts[k, at.C] * side * shafts[k, HALF]
        noise = ROUNDING * shafts[k, at.C] * (abs(shaft[k, THETA]) + shafts[k, HALF])
        s = first_root(f, n, end, zeros, noise, 0.0)
        if s < NONE:
            return at.UNSOLVED, 0.0
        event = at.NO_EVENT
        if s >= 0.0:
            event = at.SWITCH
            end = s
        if doubled:
            return event, end
        line_of(f, series, TORQUE, k, n, 0.0, side)
        s = first_root(f, n, end, 1 if rejoined else 0, noise, 0.0)
        if s < NONE:
            return at.UNSOLVED, 0.0
        return (at.EXIT, s) if s >= 0.0 else (event, end)
    if law != DEAD_ZONE and d > 0.0:
        if far(series, TORQUE, k, n, side * series[TORQUE, k, 0]):
            return at.NO_EVENT, end
        line_of(f, series, TORQUE, k, n, 0.0, side)
        noise = ROUNDING * shafts[k, at.C] * (abs(shaft[k, THETA]) + shafts[k, HALF])
    else:
        if far(series, TWIST, k, n, side * shaft[k, THETA] - shafts[k, HALF]):
            return at.NO_EVENT, end
        line_of(f, series, TWIST, k, n, -shafts[k, HALF], side)
        noise = ROUNDING * shafts[k, HALF]
    s = first_root(f, n, end, 1 if rejoined else 0, noise, 0.0)
    if s < NONE:
        return at.UNSOLVED, 0.0
    return (at.EXIT, s) if s >= 0.0 else (at.NO_EVENT, end)


@compiled
def returning(shafts: Matrix, shaft: Matrix, series: Cube, f: Vector, k: int, n: int,
              end: float) -> tuple[int, float]:  # fmt: skip
    """From overlapping flanks without torque: the torque comes back, or they part."""
    side = shaft[k, SIDE]
    for o in range(n + 1):
        v = series[SPEED, k, o] - series[SPEED, k + 1, o]
        f[o] = -side * (shafts[k, at.C] * series[TWIST, k, o] + shafts[k, D] * v)
    f[0] += shafts[k, at.C] * shafts[k, HALF]
    noise = ROUNDING * shafts[k, at.C] * (abs(shaft[k, THETA]) + shafts[k, HALF])
    event = at.NO_EVENT
    s = first_root(f, n, end, int(shaft[k, MASK]), noise, 0.0)
    if s < NONE:
        return at.UNSOLVED, 0.0
    if s >= 0.0:
        event = at.REJOIN
        end = s
    line_of(f, series, TWIST, k, n, -shafts[k, HALF], side)
    s = first_root(f, n, end, 0, ROUNDING * shafts[k, HALF], 0.0)
    if s < NONE:
        return at.UNSOLVED, 0.0
    return (at.BACK, s) if s >= 0.0 else (event, end)


@compiled
def releasing(mass: Matrix, shaft: Matrix, series: Cube, f: Vector, k: int, n: int,
              end: float) -> tuple[int, float]:  # fmt: skip
    """Rigid flanks part when they would have to pull."""
    side = shaft[k, SIDE]
    if far(series, TORQUE, k, n, side * series[TORQUE, k, 0]):
        return at.NO_EVENT, end
    line_of(f, series, TORQUE, k, n, 0.0, side)
    noise = 1e-14 * mass[int(mass[k, FIRST]), SIZE]
    s = first_root(f, n, end, 0, noise, noise)
    if s < NONE:
        return at.UNSOLVED, 0.0
    return (at.RELEASE, s) if s >= 0.0 else (at.NO_EVENT, end)


@compiled
def friction(masses: Matrix, shafts: Matrix, mass: Matrix, shaft: Matrix, series: Cube, f: Vector, i: int,
             h: float, n: int, end: float) -> tuple[int, float]:  # fmt: skip
    """Breakaway or stop of the body that begins with mass i."""
    if mass[i, RUBBING] == 0.0:
        return at.NO_EVENT, end
    noise = ROUNDING * (mass[i, SIZE] + mass[i, HOLD])
    event = at.NO_EVENT
    if mass[i, STUCK] != 0.0:
        geared = mass[i, GEARS] != 0.0
        if not geared and far(series, HELD, i, n, mass[i, HOLD] - abs(series[HELD, i, 0])):
            return event, end
        for which in range(2):
            line_of(f, series, HELD, i, n, mass[i, HOLD], -1.0 + 2.0 * which)
            if geared:
                for o in range(n + 1):
                    f[o] += body_grip(shafts, mass, shaft, series, i, 1.0 - 2.0 * which, o)
            s = first_root(f, n, end, 0, noise, noise)
            if s < NONE:
                return at.UNSOLVED, 0.0
            if s >= 0.0:
                event = at.BREAK_FORWARD if which == 0 else at.BREAK_BACK
                end = s
        return event, end
    j = i
    while masses[j, RUBS] == 0.0:
        j += 1
    direction = mass[j, DIRECTION]
    if far(series, SPEED, i, n, direction * mass[i, at.W]):
        return event, end
    line_of(f, series, SPEED, i, n, 0.0, direction)
    faint = 1e-14 * h * (mass[i, SIZE] + mass[i, HOLD]) / mass[i, BODY_J]
    s = first_root(f, n, end, 0, 0.0, faint)
    if s < NONE:
        return at.UNSOLVED, 0.0
    return (at.STOP, s) if s >= 0.0 else (event, end)


@compiled
def next_event(p: Vector, x: Vector, place: Vector, masses: Matrix, shafts: Matrix, mass: Matrix,
               shaft: Matrix, series: Cube, lines: Matrix, h: float, n: int,
               ) -> tuple[int, int, float]:  # fmt: skip
    """The first event of the span, on which shaft or mass, and where on [0, 1]."""
    found = at.NO_EVENT
    where = 0
    end = 1.0
    f = lines[EVENT_LINE]
    for k in range(shafts.shape[0]):
        mode = shaft[k, MODE]
        event = at.NO_EVENT
        if mode == OPEN:
            event, s = flanks(shafts, mass, shaft, series, f, k, h, n, end)
        elif mode in (CONTACT, DOUBLED):
            event, s = parting(shafts, shaft, series, f, k, n, end)
        elif mode == BEYOND:
            event, s = returning(shafts, shaft, series, f, k, n, end)
        elif mode == PRESSED:
            event, s = releasing(mass, shaft, series, f, k, n, end)
        if event != at.NO_EVENT:
            if event == at.UNSOLVED:
                return event, k, 0.0
            found, where, end = event, k, s
        if shafts[k, ETA] != 1.0:
            event, s = turning(shafts, mass, shaft, series, f, k, n, end)
            if event == at.UNSOLVED:
                return event, k, 0.0
            if event != at.NO_EVENT:
                found, where, end = event, k, s
    for i in range(masses.shape[0]):
        if int(mass[i, FIRST]) == i:
            event, s = friction(masses, shafts, mass, shaft, series, f, i, h, n, end)
            if event != at.NO_EVENT:
                if event == at.UNSOLVED:
                    return event, i, 0.0
                found, where, end = event, i, s
    i = int(place[LOAD_MASS])
    short = p[TARGET] - mass[i, at.W]
    if math.isnan(x[START_TIME]) and not far(series, SPEED, i, n, short):
        line_of(f, series, SPEED, i, n, p[TARGET], -1.0)
        s = first_root(f, n, end, 0, ROUNDING * p[TARGET], 0.0)
        if s < NONE:
            return at.UNSOLVED, i, 0.0
        if s >= 0.0:
            found, where, end = at.REACHED, i, s
    return found, where, end
