"""What changes at an event: springs and rigid flanks meet and part, friction holds and lets go."""

from __future__ import annotations

import math

import numpy as np

from softstart.chain import kernel_layout as at
from softstart.chain.kernel_layout import (
    BEYOND,
    CONTACT,
    DIRECTION,
    DOUBLED,
    FIRST,
    HALF,
    JOINED,
    LAW,
    LOAD_MASS,
    MASK,
    MODE,
    OPEN,
    PATH,
    PATH_END,
    PRESSED,
    RESTITUTION,
    RIGID,
    RUBS,
    SIDE,
    SIGN,
    THETA,
    WELDED,
    C,
    D,
    J,
    Matrix,
    Vector,
    W,
)
from softstart.plant.jit import compiled
from softstart.plant.layout import (
    DEAD_ZONE,
    EVENTS,
    GAP_EVENTS,
    MODELICA,
    N_EVENTS,
    PERIOD,
    STAGE,
    START_TIME,
    T_END,
    TIME,
)

# MASK of a contact whose torque has just come back: it begins at zero
REJOINED = 3.0
# a flank that is touched with an overlap below this share of the gap is grazed, not hit, as in the plant
GRAZE = 1e-12
# a rigid flank that is reached more slowly than this, against what presses it on within the span, is settled
SLOW = 1e-10
# so many impacts of one shaft at one instant are the collapse of masses that bounce between one another:
# infinitely many in a finite time without any torque that presses, which end with all of them at one speed
# (S. McNamara, W. R. Young, Phys. Fluids A 4 (1992) 496-504, doi:10.1063/1.858323)
COLLAPSE = 100.0


@compiled
def note(
    x: Vector, events: Matrix, time: float, kind: float, place: float, value: float, impulse: float
) -> None:
    """One event; `events` may have no rows, then it is only counted."""
    x[EVENTS] += 1.0
    if events.shape[0] > 0:
        row = int(x[N_EVENTS])
        events[row, at.E_TIME] = time
        events[row, at.E_KIND] = kind
        events[row, at.E_PLACE] = place
        events[row, at.E_VALUE] = value
        events[row, at.E_IMPULSE] = impulse
        x[N_EVENTS] += 1.0


@compiled
def path_closed(place: Vector, shaft: Matrix, but: int) -> bool:
    """Whether no gap between motor and load is open, but for that of one shaft."""
    for k in range(int(place[PATH]), int(place[PATH_END])):
        if k != but and (shaft[k, MODE] == OPEN or shaft[k, MODE] == BEYOND):
            return False
    return True


@compiled
def engage(shafts: Matrix, mass: Matrix, shaft: Matrix, k: int, side: float) -> None:
    """The spring begins to act, in its damping regime."""
    shaft[k, SIDE] = side
    shaft[k, MODE] = CONTACT
    z = side * shaft[k, THETA] - shafts[k, HALF]
    v = side * (mass[k, W] - mass[k + 1, W])
    if shafts[k, LAW] == MODELICA and shafts[k, D] * v > shafts[k, C] * z:
        shaft[k, MODE] = DOUBLED
    pulls = shafts[k, LAW] == DEAD_ZONE and shafts[k, C] * z + shafts[k, D] * v < 0.0
    shaft[k, SIGN] = -side if pulls else side


@compiled
def begin_modes(masses: Matrix, shafts: Matrix, mass: Matrix, shaft: Matrix) -> None:
    """The modes at t = 0."""
    for i in range(masses.shape[0]):
        mass[i, W] = masses[i, at.W_0]
        mass[i, DIRECTION] = np.sign(mass[i, W]) if masses[i, RUBS] != 0.0 else 1.0
    for k in range(shafts.shape[0]):
        theta = shafts[k, at.THETA_0]
        shaft[k, THETA] = theta
        shaft[k, MASK] = 0.0
        shaft[k, SIDE] = 0.0
        shaft[k, SIGN] = 1.0
        shaft[k, at.PEAK] = 0.0
        shaft[k, at.PEAK_TIME] = 0.0
        shaft[k, at.IMPULSE] = 0.0
        shaft[k, at.STRUCK] = -1.0
        shaft[k, at.BLOWS] = 0.0
        shaft[k, MODE] = OPEN
        if shafts[k, RIGID] != 0.0:
            if shafts[k, HALF] == 0.0:
                shaft[k, MODE] = WELDED
        elif shafts[k, HALF] == 0.0:
            shaft[k, MODE] = JOINED
            torque = shafts[k, C] * theta + shafts[k, D] * (mass[k, W] - mass[k + 1, W])
            shaft[k, SIGN] = 1.0 if torque >= 0.0 else -1.0
        elif abs(theta) > shafts[k, HALF]:
            side = math.copysign(1.0, theta)
            torque = shafts[k, C] * (abs(theta) - shafts[k, HALF])
            torque += shafts[k, D] * side * (mass[k, W] - mass[k + 1, W])
            if shafts[k, LAW] != DEAD_ZONE and torque < 0.0:
                shaft[k, MODE] = BEYOND
                shaft[k, SIDE] = side
            else:
                engage(shafts, mass, shaft, k, side)


@compiled
def goes_with(shaft: Matrix, k: int, side: float, kind: float) -> bool:
    """Whether the joint k takes the mass behind it along when a flank `side` beside it is struck.

    Where impacts have piled up there is no blow left that could part flanks: their torque decides.
    """
    if shaft[k, MODE] == PRESSED:
        return kind == at.SETTLED or shaft[k, SIDE] == side
    return shaft[k, MODE] == WELDED


@compiled
def strike(x: Vector, masses: Matrix, mass: Matrix, shaft: Matrix, k: int, restitution: float, kind: float,
           time: float, events: Matrix) -> None:  # fmt: skip
    """The rigid flanks of shaft k meet: new speeds by momentum and restitution, noted as an event `kind`.

    What is rigidly joined on either side goes with it, pressed flanks too where the blow presses them on;
    where it would have to pull they part. Friction is too weak to matter in a blow.
    """
    side = shaft[k, SIDE]
    count = masses.shape[0]
    a = k
    b = k + 1
    J_a = masses[a, J]
    J_b = masses[b, J]
    while a > 0 and goes_with(shaft, a - 1, side, kind):
        a -= 1
        J_a += masses[a, J]
    while b + 1 < count and goes_with(shaft, b, side, kind):
        b += 1
        J_b += masses[b, J]
    w_a = mass[k, W]
    w_b = mass[k + 1, W]
    v = w_a - w_b
    reduced = J_a * J_b / (J_a + J_b)
    impulse = (1.0 + restitution) * reduced * v
    loss = 0.5 * (1.0 - restitution * restitution) * reduced * v * v
    note(x, events, time, kind, k, loss, impulse)
    shaft[k, at.IMPULSE] = max(shaft[k, at.IMPULSE], abs(impulse))
    if restitution == 0.0:
        w_a = w_b = (J_a * w_a + J_b * w_b) / (J_a + J_b)
    else:
        w_a -= impulse / J_a
        w_b += impulse / J_b
    for i in range(a, b + 1):
        mass[i, W] = w_a if i <= k else w_b
        if masses[i, RUBS] != 0.0:
            direction = np.sign(mass[i, W])
            if direction != mass[i, DIRECTION]:
                if mass[i, DIRECTION] != 0.0:
                    note(
                        x,
                        events,
                        x[TIME],
                        at.LOAD_STOPS if masses[i, at.MC] > 0.0 else at.GEAR_HOLDS,
                        i,
                        mass[i, DIRECTION],
                        0.0,
                    )
                if direction != 0.0:
                    note(
                        x,
                        events,
                        x[TIME],
                        at.LOAD_STARTS if masses[i, at.MC] > 0.0 else at.GEAR_LETS_GO,
                        i,
                        direction,
                        0.0,
                    )
            mass[i, DIRECTION] = direction
    for j in range(max(a - 1, 0), min(b + 1, count - 1)):
        shaft[j, MASK] = 0.0  # speeds have jumped: nothing is zero by its nature any more
    for edge in range(2):
        j = a - 1 if edge == 0 else b
        if 0 <= j < count - 1 and shaft[j, MODE] == PRESSED:
            shaft[j, MODE] = OPEN
            note(x, events, x[TIME], at.OPENED, j, shaft[j, SIDE], 0.0)


@compiled
def settle(
    x: Vector, masses: Matrix, mass: Matrix, shaft: Matrix, k: int, rest: float, events: Matrix
) -> None:
    """Rigid flanks lie on each other from now on; `rest` is how much longer the last impacts take."""
    strike(x, masses, mass, shaft, k, 0.0, at.SETTLED, x[TIME] + rest, events)
    shaft[k, MODE] = PRESSED


@compiled
def meet(x: Vector, masses: Matrix, shafts: Matrix, mass: Matrix, shaft: Matrix, k: int, side: float,
         press: float, h: float, events: Matrix) -> None:  # fmt: skip
    """A flank is reached; `press` is the relative acceleration towards it."""
    v = side * (mass[k, W] - mass[k + 1, W])
    shaft[k, THETA] = side * shafts[k, HALF]
    shaft[k, SIDE] = side
    if shafts[k, RIGID] != 0.0:
        e = shafts[k, RESTITUTION]
        at_once = x[TIME] - shaft[k, at.STRUCK] <= 1e-15 * x[TIME]
        shaft[k, at.BLOWS] = shaft[k, at.BLOWS] + 1.0 if at_once else 0.0
        shaft[k, at.STRUCK] = x[TIME]
        if v <= SLOW * abs(press) * h or (shaft[k, at.BLOWS] > COLLAPSE and e < 1.0):
            rest = 0.0
            if press > 0.0 and e < 1.0:
                rest = 2.0 * max(e * v, -v) / (press * (1.0 - e))
            settle(x, masses, mass, shaft, k, rest, events)
        else:
            strike(x, masses, mass, shaft, k, e, at.IMPACT, x[TIME], events)
    elif press < 0.0 and v * v <= -4.0 * press * GRAZE * shafts[k, HALF]:
        x[EVENTS] += 1.0
        shaft[k, MASK] = 2.0
    else:
        note(x, events, x[TIME], at.CLOSED, k, side, 0.0)
        engage(shafts, mass, shaft, k, side)


@compiled
def part(x: Vector, shafts: Matrix, shaft: Matrix, k: int, events: Matrix) -> None:
    """The flanks of shaft k cease to act."""
    side = shaft[k, SIDE]
    note(x, events, x[TIME], at.OPENED, k, side, 0.0)
    if shafts[k, LAW] != DEAD_ZONE and shafts[k, D] > 0.0 and side * shaft[k, THETA] > shafts[k, HALF]:
        shaft[k, MODE] = BEYOND
        shaft[k, MASK] = 1.0
    else:
        shaft[k, MODE] = OPEN
        shaft[k, THETA] = side * shafts[k, HALF]


@compiled
def turn(x: Vector, masses: Matrix, mass: Matrix, i: int, direction: float, events: Matrix) -> None:
    """The body that begins with mass i is held by friction from now on (0), or moves in a direction."""
    j = i
    while j < masses.shape[0] and int(mass[j, FIRST]) == i:
        if masses[j, RUBS] != 0.0:
            if direction == 0.0:
                note(
                    x,
                    events,
                    x[TIME],
                    at.LOAD_STOPS if masses[j, at.MC] > 0.0 else at.GEAR_HOLDS,
                    j,
                    mass[j, DIRECTION],
                    0.0,
                )
            else:
                note(
                    x,
                    events,
                    x[TIME],
                    at.LOAD_STARTS if masses[j, at.MC] > 0.0 else at.GEAR_LETS_GO,
                    j,
                    direction,
                    0.0,
                )
            mass[j, DIRECTION] = direction
        if direction == 0.0:
            mass[j, W] = 0.0
        j += 1


@compiled
def handle(p: Vector, x: Vector, place: Vector, masses: Matrix, shafts: Matrix, mass: Matrix, shaft: Matrix,
           event: int, k: int, press: float, rest: float, h: float, events: Matrix) -> bool:  # fmt: skip
    """Change of mode at an event on shaft or mass k; True if the path from motor to load closed or opened."""
    was = path_closed(place, shaft, -1)
    blow = False
    if event in (at.UPPER, at.LOWER):
        blow = shafts[k, RIGID] != 0.0 and place[PATH] <= k < place[PATH_END]
        meet(x, masses, shafts, mass, shaft, k, 1.0 if event == at.UPPER else -1.0, press, h, events)
        blow = blow and shaft[k, MODE] == OPEN and shaft[k, MASK] == 0.0
    elif event == at.SETTLE:
        shaft[k, SIDE] = math.copysign(1.0, shaft[k, THETA])
        settle(x, masses, mass, shaft, k, rest, events)
    elif event == at.REJOIN:
        note(x, events, x[TIME], at.CLOSED, k, shaft[k, SIDE], 0.0)
        engage(shafts, mass, shaft, k, shaft[k, SIDE])
        shaft[k, MASK] = REJOINED
    elif event == at.EXIT:
        part(x, shafts, shaft, k, events)
    elif event == at.RELEASE:
        note(x, events, x[TIME], at.OPENED, k, shaft[k, SIDE], 0.0)
        shaft[k, MODE] = OPEN
        shaft[k, MASK] = 2.0
    elif event == at.BACK:
        x[EVENTS] += 1.0
        shaft[k, THETA] = shaft[k, SIDE] * shafts[k, HALF]
        shaft[k, MODE] = OPEN
        shaft[k, MASK] = 0.0
    elif event == at.SWITCH:
        x[EVENTS] += 1.0
        shaft[k, MODE] = CONTACT if shaft[k, MODE] == DOUBLED else DOUBLED
        shaft[k, MASK] = 1.0
    elif event == at.TURNED:
        x[EVENTS] += 1.0
        shaft[k, SIGN] = -shaft[k, SIGN]
        shaft[k, MASK] = 1.0
    elif event == at.STOP:
        turn(x, masses, mass, k, 0.0, events)
    elif event in (at.BREAK_FORWARD, at.BREAK_BACK):
        turn(x, masses, mass, k, 1.0 if event == at.BREAK_FORWARD else -1.0, events)
    elif event == at.REACHED:
        x[START_TIME] = x[TIME]
        note(x, events, x[TIME], at.TARGET_REACHED, place[LOAD_MASS], mass[k, W], 0.0)
        if x[T_END] == math.inf:
            x[T_END] = x[TIME] + p[PERIOD]
    now = path_closed(place, shaft, -1)
    if blow and not was and path_closed(place, shaft, k):  # closed, and opened at once
        x[STAGE] += 2.0
        x[GAP_EVENTS] += 2.0
        return True
    if now != was:
        x[STAGE] += 1.0
        x[GAP_EVENTS] += 1.0
        return True
    return False
