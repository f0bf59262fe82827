"""What changes at an event: springs and rigid flanks meet and part, friction holds and lets go."""

from __future__ import annotations

import math

import numpy as np

from softstart.chain.kernel_events import GRAZE, REJOINED
from softstart.chain.kernel_records import (
    BACK,
    BEYOND,
    BREAK_BACK,
    BREAK_FORWARD,
    CLOSED,
    CONTACT,
    DOUBLED,
    EXIT,
    GEAR_HOLDS,
    GEAR_LETS_GO,
    IMPACT,
    JOINED,
    LOAD_STARTS,
    LOAD_STOPS,
    LOWER,
    OPEN,
    OPENED,
    POINT_ABOVE,
    POINT_BELOW,
    PRESSED,
    REACHED,
    REJOIN,
    RELEASE,
    SETTLE,
    SETTLED,
    STOP,
    SWITCH,
    TARGET_REACHED,
    TURNED,
    UPPER,
    WELDED,
    Record,
    Start,
)  # fmt: skip
from softstart.chain.kernel_series import find_piece, set_piece
from softstart.plant.jit import compiled
from softstart.plant.layout import DEAD_ZONE, MODELICA, PLANT, STATE

# a rigid flank that is reached more slowly than this, against what presses it on within the span, is settled
SLOW = 1e-10
# so many impacts of one shaft at one instant are the collapse of masses that bounce between one another:
# infinitely many in a finite time without any torque that presses, which end with all of them at one speed
# (S. McNamara, W. R. Young, Phys. Fluids A 4 (1992) 496-504, doi:10.1063/1.858323)
COLLAPSE = 100


@compiled
def note(start: Start, time: float, kind: int, place: int, value: float, impulse: float) -> None:
    """One event; `events` may have no rows, then it is only counted."""
    x = start.x.view(STATE)[0]
    x.events += 1.0
    if start.events.size > 0:
        event = start.events[int(x.n_events)]
        event.time = time
        event.kind = kind
        event.place = place
        event.value = value
        event.impulse = impulse
        x.n_events += 1.0


@compiled
def note_friction(start: Start, i: int, direction: float) -> None:
    """Friction holds mass i from now on (0), or lets it go in a direction."""
    x = start.x.view(STATE)[0]
    mass = start.masses[i]
    of_load = mass.Mc > 0.0
    if direction == 0.0:
        note(start, x.time, LOAD_STOPS if of_load else GEAR_HOLDS, i, mass.direction, 0.0)
    else:
        note(start, x.time, LOAD_STARTS if of_load else GEAR_LETS_GO, i, direction, 0.0)


@compiled
def path_closed(start: Start, but: int) -> bool:
    """Whether no gap between motor and load is open, but for that of one shaft."""
    for k in range(start.place.path, start.place.path_end):
        mode = start.shafts[k].mode
        if k != but and (mode in (OPEN, BEYOND)):
            return False
    return True


@compiled
def engage(masses: Record, shafts: Record, k: int, side: float) -> None:
    """The spring begins to act, in its damping regime."""
    shaft = shafts[k]
    shaft.side = side
    shaft.mode = CONTACT
    z = side * shaft.theta - shaft.half
    v = side * (masses[k].w - masses[k + 1].w)
    if shaft.law == MODELICA and shaft.d * v > shaft.c * z:
        shaft.mode = DOUBLED
    pulls = shaft.law == DEAD_ZONE and shaft.c * z + shaft.d * v < 0.0
    shaft.sign = -side if pulls else side


@compiled
def begin_modes(masses: Record, shafts: Record) -> None:
    """The modes at t = 0."""
    for mass in masses:
        mass.w = mass.w0
        mass.direction = np.sign(mass.w) if mass.rubs != 0 else 1.0
    for k in range(shafts.size):
        shaft = shafts[k]
        shaft.theta = shaft.theta0
        shaft.zeros = 0
        shaft.side = 0.0
        shaft.sign = 1.0
        shaft.peak = 0.0
        shaft.peak_time = 0.0
        shaft.impulse = 0.0
        shaft.struck = -1.0
        shaft.blows = 0
        shaft.mode = OPEN
        if shaft.rigid != 0:
            if shaft.half == 0.0:
                shaft.mode = WELDED
        elif shaft.half == 0.0:
            shaft.mode = JOINED
            torque = shaft.c * shaft.theta + shaft.d * (masses[k].w - masses[k + 1].w)
            shaft.sign = 1.0 if torque >= 0.0 else -1.0
        elif abs(shaft.theta) > shaft.half:
            side = math.copysign(1.0, shaft.theta)
            torque = shaft.c * (abs(shaft.theta) - shaft.half)
            torque += shaft.d * side * (masses[k].w - masses[k + 1].w)
            if shaft.law != DEAD_ZONE and torque < 0.0:
                shaft.mode = BEYOND
                shaft.side = side
            else:
                engage(masses, shafts, k, side)


@compiled
def goes_with(shaft: Record, side: float, kind: int) -> bool:
    """Whether a joint takes the mass behind it along when a flank `side` beside it is struck.

    Where impacts have piled up no impulse is left that could part flanks: their torque decides.
    """
    if shaft.mode == PRESSED:
        return kind == SETTLED or shaft.side == side
    return shaft.mode == WELDED


@compiled
def strike(start: Start, k: int, restitution: float, kind: int, time: float) -> None:
    """The rigid flanks of shaft k meet: new speeds by momentum and restitution, noted as an event `kind`.

    What is rigidly joined on either side goes with it, pressed flanks too where the impact presses them on;
    where it would have to pull they part. Friction is too weak to matter in an impact.
    """
    x = start.x.view(STATE)[0]
    masses, shafts = start.masses, start.shafts
    side = shafts[k].side
    count = masses.size
    a = k
    b = k + 1
    J_a = masses[a].J
    J_b = masses[b].J
    while a > 0 and goes_with(shafts[a - 1], side, kind):
        a -= 1
        J_a += masses[a].J
    while b + 1 < count and goes_with(shafts[b], side, kind):
        b += 1
        J_b += masses[b].J
    w_a = masses[k].w
    w_b = masses[k + 1].w
    v = w_a - w_b
    walled = math.isinf(J_a + J_b)  # one of them stays at rest
    reduced = min(J_a, J_b) if walled else J_a * J_b / (J_a + J_b)
    impulse = (1.0 + restitution) * reduced * v
    loss = 0.5 * (1.0 - restitution * restitution) * reduced * v * v
    note(start, time, kind, k, loss, impulse)
    shafts[k].impulse = max(shafts[k].impulse, abs(impulse))
    if restitution == 0.0 and walled:
        w_a = w_b = 0.0
    elif restitution == 0.0:
        w_a = w_b = (J_a * w_a + J_b * w_b) / (J_a + J_b)
    else:
        w_a -= impulse / J_a
        w_b += impulse / J_b
    for i in range(a, b + 1):
        mass = masses[i]
        mass.w = w_a if i <= k else w_b
        if mass.points > 0 and mass.by_angle == 0:
            find_piece(mass)
        if mass.rubs != 0:
            direction = np.sign(mass.w)
            if direction != mass.direction:
                if mass.direction != 0.0:
                    note_friction(start, i, 0.0)
                if direction != 0.0:
                    note_friction(start, i, direction)
            mass.direction = direction
    for j in range(max(a - 1, 0), min(b + 1, count - 1)):
        shafts[j].zeros = 0  # speeds have jumped: nothing is zero by its nature any more
    for edge in range(2):
        j = a - 1 if edge == 0 else b
        if 0 <= j < count - 1 and shafts[j].mode == PRESSED:
            shafts[j].mode = OPEN
            note(start, x.time, OPENED, j, shafts[j].side, 0.0)


@compiled
def settle(start: Start, k: int, rest: float) -> None:
    """Rigid flanks lie on each other from now on; `rest` is how much longer the last impacts take."""
    x = start.x.view(STATE)[0]
    strike(start, k, 0.0, SETTLED, x.time + rest)
    start.shafts[k].mode = PRESSED


@compiled
def meet(start: Start, k: int, side: float, press: float, h: float) -> None:
    """A flank is reached; `press` is the relative acceleration towards it."""
    x = start.x.view(STATE)[0]
    shaft = start.shafts[k]
    v = side * (start.masses[k].w - start.masses[k + 1].w)
    shaft.theta = side * shaft.half
    shaft.side = side
    if shaft.rigid != 0:
        e = shaft.restitution
        at_once = x.time - shaft.struck <= 1e-15 * x.time
        shaft.blows = shaft.blows + 1 if at_once else 0
        shaft.struck = x.time
        if v <= SLOW * abs(press) * h or (shaft.blows > COLLAPSE and e < 1.0):
            rest = 0.0
            if press > 0.0 and e < 1.0:
                rest = 2.0 * max(e * v, -v) / (press * (1.0 - e))
            settle(start, k, rest)
        else:
            strike(start, k, e, IMPACT, x.time)
    elif press < 0.0 and v * v <= -4.0 * press * GRAZE * shaft.half:
        x.events += 1.0
        shaft.zeros = 2
    else:
        note(start, x.time, CLOSED, k, side, 0.0)
        engage(start.masses, start.shafts, k, side)


@compiled
def part(start: Start, k: int) -> None:
    """The flanks of shaft k cease to act."""
    x = start.x.view(STATE)[0]
    shaft = start.shafts[k]
    note(start, x.time, OPENED, k, shaft.side, 0.0)
    if shaft.law != DEAD_ZONE and shaft.d > 0.0 and shaft.side * shaft.theta > shaft.half:
        shaft.mode = BEYOND
        shaft.zeros = 1
    else:
        shaft.mode = OPEN
        shaft.theta = shaft.side * shaft.half


@compiled
def turn(start: Start, i: int, direction: float) -> None:
    """The body that begins with mass i is held by friction from now on (0), or moves in a direction."""
    for j in range(i, start.masses.size):
        mass = start.masses[j]
        if mass.first != i:
            break
        if mass.rubs != 0:
            note_friction(start, j, direction)
            mass.direction = direction
        if direction == 0.0:
            mass.w = 0.0


@compiled
def handle(start: Start, event: int, k: int, press: float, rest: float, h: float) -> bool:
    """Change of mode at an event on shaft or mass k; True if the path from motor to load closed or opened."""
    p = start.p.view(PLANT)[0]
    x = start.x.view(STATE)[0]
    was = path_closed(start, -1)
    bounced = False
    if event in (UPPER, LOWER):
        shaft = start.shafts[k]
        bounced = shaft.rigid != 0 and start.place.path <= k < start.place.path_end
        meet(start, k, 1.0 if event == UPPER else -1.0, press, h)
        bounced = bounced and shaft.mode == OPEN and shaft.zeros == 0
    elif event == STOP:
        turn(start, k, 0.0)
    elif event in (BREAK_FORWARD, BREAK_BACK):
        turn(start, k, 1.0 if event == BREAK_FORWARD else -1.0)
    elif event in (POINT_ABOVE, POINT_BELOW):
        mass = start.masses[k]
        x.events += 1.0
        mass.passed = 1 if event == POINT_ABOVE else -1
        set_piece(mass, mass.piece + mass.passed)
    elif event == REACHED:
        x.start_time = x.time
        note(start, x.time, TARGET_REACHED, start.place.load, start.masses[k].w, 0.0)
        if x.t_end == math.inf:
            x.t_end = x.time + p.period
    else:
        change(start, event, k, rest)
    now = path_closed(start, -1)
    if bounced and not was and path_closed(start, k):  # closed, and opened at once
        x.stage += 2.0
        x.gap_events += 2.0
        return True
    if now != was:
        x.stage += 1.0
        x.gap_events += 1.0
        return True
    return False


@compiled
def change(start: Start, event: int, k: int, rest: float) -> None:
    """Change of mode of shaft k, whose flanks are in contact or overlap."""
    x = start.x.view(STATE)[0]
    shaft = start.shafts[k]
    if event == SETTLE:
        shaft.side = math.copysign(1.0, shaft.theta)
        settle(start, k, rest)
    elif event == REJOIN:
        note(start, x.time, CLOSED, k, shaft.side, 0.0)
        engage(start.masses, start.shafts, k, shaft.side)
        shaft.zeros = REJOINED
    elif event == EXIT:
        part(start, k)
    elif event == RELEASE:
        note(start, x.time, OPENED, k, shaft.side, 0.0)
        shaft.mode = OPEN
        shaft.zeros = 2
    elif event == BACK:
        x.events += 1.0
        shaft.theta = shaft.side * shaft.half
        shaft.mode = OPEN
        shaft.zeros = 0
    elif event == SWITCH:
        x.events += 1.0
        shaft.mode = CONTACT if shaft.mode == DOUBLED else DOUBLED
        shaft.zeros = 1
    elif event == TURNED:
        x.events += 1.0
        shaft.sign = -shaft.sign
        shaft.zeros = 1
