"""What changes at an event: springs and rigid flanks meet and part, friction and brake hold and let go."""

from __future__ import annotations

import math

import numpy as np
from numba import types

from softstart.kernel.events import GRAZE, REJOINED
from softstart.kernel.jit import separately_compiled, inner
from softstart.kernel.records import (
    BACK, BEYOND, BREAK_BACK, BREAK_FORWARD, CLOSED, CONTACT, DEAD_ZONE, DOUBLED, EXIT, IMPACT, JOINED,
    LET_GO, LOWER, MODELICA, MOST_NOTED, OPEN, OPENED, POINT_ABOVE, POINT_BELOW, PRESSED, REACHED, REJOIN,
    RELEASE, RELEASED, SETTLE, SETTLED, SLOWED, STARTS, STOP, STOPS, SWITCH, TARGET_REACHED, TRAVELLED,
    TURNED, UPPER, WELDED, WORK_TYPE, Record,
)  # fmt: skip
from softstart.kernel.series import find_piece, set_piece

# a rigid flank that is reached more slowly than this, against what presses it on within the span, is settled
SLOW = 1e-10
# so many impacts of one shaft at one instant are the collapse of masses that bounce between one another:
# infinitely many in a finite time without any torque that presses, which end with all of them at one speed
# (S. McNamara, W. R. Young, Phys. Fluids A 4 (1992) 496-504, doi:10.1063/1.858323)
COLLAPSE = 100


@inner
def note(s: Record, time: float, kind: int, place: int, value: float, impulse: float) -> None:
    """One event, to be recorded before the next span."""
    s.events += 1.0
    if s.noted < MOST_NOTED:
        s.note_time[s.noted] = time
        s.note_kind[s.noted] = kind
        s.note_place[s.noted] = place
        s.note_value[s.noted] = value
        s.note_impulse[s.noted] = impulse
        s.noted += 1


@inner
def turn_mass(s: Record, i: int, direction: float) -> None:
    """Friction holds mass i from now on (0), or lets it go in a direction."""
    if direction == 0.0:
        note(s, s.time, STOPS, i, s.direction[i], 0.0)
    else:
        note(s, s.time, STARTS, i, direction, 0.0)
    s.direction[i] = direction


@inner
def path_closed(s: Record, but: int) -> bool:
    """Whether no gap between motor and load is open, but for that of one shaft."""
    for k in range(s.path, s.path_end):
        if k != but and (s.mode[k] == OPEN or s.mode[k] == BEYOND):
            return False
    return True


@inner
def engage_spring(s: Record, k: int, side: float) -> None:
    """The spring begins to act, in its damping regime."""
    s.side[k] = side
    s.mode[k] = CONTACT
    z = side * s.theta[k] - s.half_gap[k]  # overlap of the flanks, and its rate
    v = side * (s.w[k] - s.w[k + 1])
    # tau_d > tau_c: the damping torque is capped at that of the spring
    if s.law[k] == MODELICA and s.d[k] * v > s.c[k] * z:
        s.mode[k] = DOUBLED
    pulls = s.law[k] == DEAD_ZONE and s.c[k] * z + s.d[k] * v < 0.0
    s.sign[k] = -side if pulls else side


@inner
def begin_modes(s: Record) -> None:
    """The modes at t = 0."""
    for i in range(s.n):
        s.w[i] = s.w0[i]
        s.direction[i] = np.sign(s.w[i]) if s.has_friction[i] != 0.0 else 1.0
    for k in range(s.n - 1):
        theta, half_gap = s.theta0[k], s.half_gap[k]
        torque = s.c[k] * (abs(theta) - half_gap)
        torque += s.d[k] * math.copysign(1.0, theta) * (s.w[k] - s.w[k + 1])
        s.theta[k] = theta
        s.leading_zeros[k] = 0
        s.side[k] = 0.0
        s.sign[k] = 1.0
        s.peak[k] = 0.0
        s.peak_time[k] = 0.0
        s.impulse[k] = 0.0
        s.first_peak[k] = 0.0
        s.last_impact_time[k] = -1.0
        s.impacts_at_instant[k] = 0.0
        s.mode[k] = OPEN
        if s.rigid[k] != 0.0:
            if half_gap == 0.0:
                s.mode[k] = WELDED
        elif half_gap == 0.0:
            s.mode[k] = JOINED
            s.sign[k] = math.copysign(1.0, theta) if torque >= 0.0 else -math.copysign(1.0, theta)
        elif abs(theta) > half_gap:
            if s.law[k] != DEAD_ZONE and torque < 0.0:
                s.mode[k] = BEYOND
                s.side[k] = math.copysign(1.0, theta)
            else:
                engage_spring(s, k, math.copysign(1.0, theta))


@inner
def moves_with(s: Record, k: int, side: float, kind: int) -> bool:
    """Whether joint k takes the mass behind it along when a flank `side` beside it is struck.

    Where impacts have piled up no impulse is left that could part flanks: their torque decides.
    """
    if s.mode[k] == PRESSED:
        return kind == SETTLED or s.side[k] == side
    return s.mode[k] == WELDED


@inner
def strike(s: Record, k: int, restitution: float, kind: int, time: float) -> None:
    """The rigid flanks of shaft k meet: new speeds by momentum and restitution, noted as an event `kind`.

    What is rigidly joined on either side goes with it, pressed flanks too where the impact presses them on;
    where it would have to pull they part. Friction is too weak to matter in an impact.
    """
    side = s.side[k]
    a = k
    b = k + 1
    J_a = s.J[a]
    J_b = s.J[b]
    while a > 0 and moves_with(s, a - 1, side, kind):
        a -= 1
        J_a += s.J[a]
    while b + 1 < s.n and moves_with(s, b, side, kind):
        b += 1
        J_b += s.J[b]
    if s.braked != 0.0 and a <= s.at_motor <= b:
        if s.at_motor <= k:
            J_a = math.inf
        else:
            J_b = math.inf
    w_a = s.w[k]
    w_b = s.w[k + 1]
    v = w_a - w_b
    walled = math.isinf(J_a + J_b)  # one of them stays at rest
    reduced = min(J_a, J_b) if walled else J_a * J_b / (J_a + J_b)
    # momentum is kept, and restitution = -v(+)/v(-): [R]
    impulse = (1.0 + restitution) * reduced * v
    loss = 0.5 * (1.0 - restitution * restitution) * reduced * v * v
    note(s, time, kind, k, loss, impulse)
    s.impulse[k] = max(s.impulse[k], abs(impulse))
    if restitution == 0.0 and walled:
        w_a = w_b = 0.0
    elif restitution == 0.0:
        w_a = w_b = (J_a * w_a + J_b * w_b) / (J_a + J_b)
    else:
        w_a -= impulse / J_a
        w_b += impulse / J_b
    for i in range(a, b + 1):
        s.w[i] = w_a if i <= k else w_b
        if s.points[i] > 0 and s.by_angle[i] == 0.0:
            find_piece(s, i)
        direction = np.sign(s.w[i])
        if s.has_friction[i] != 0.0 and direction != s.direction[i]:
            if s.direction[i] != 0.0:
                turn_mass(s, i, 0.0)
            if direction != 0.0:
                turn_mass(s, i, direction)
    for j in range(max(a - 1, 0), min(b + 1, s.n - 1)):
        s.leading_zeros[j] = 0  # speeds have jumped: nothing is zero by its nature any more
    for edge in range(2):
        beside = a - 1 if edge == 0 else b
        if 0 <= beside < s.n - 1 and s.mode[beside] == PRESSED:
            s.mode[beside] = OPEN
            note(s, s.time, OPENED, beside, s.side[beside], 0.0)


@inner
def settle(s: Record, k: int, rest: float) -> None:
    """Rigid flanks lie on each other from now on; `rest` is how much longer the last impacts take."""
    strike(s, k, 0.0, SETTLED, s.time + rest)
    s.mode[k] = PRESSED


@inner
def meet(s: Record, k: int, side: float, press: float, h: float) -> None:
    """A flank is reached; `press` is the relative acceleration towards it.

    Where v and `press` are 0 it is reached by what follows in the series, and that is a contact.
    """
    v = side * (s.w[k] - s.w[k + 1])
    s.theta[k] = side * s.half_gap[k]
    s.side[k] = side
    if s.rigid[k] != 0.0:
        e = s.restitution[k]
        at_once = s.time - s.last_impact_time[k] <= 1e-15 * s.time
        s.impacts_at_instant[k] = s.impacts_at_instant[k] + 1.0 if at_once else 0.0
        s.last_impact_time[k] = s.time
        if v <= SLOW * abs(press) * h or (s.impacts_at_instant[k] > COLLAPSE and e < 1.0):
            rest = 0.0
            if press > 0.0 and e < 1.0:
                rest = 2.0 * max(e * v, -v) / (press * (1.0 - e))
            settle(s, k, rest)
        else:
            strike(s, k, e, IMPACT, s.time)
    elif press < 0.0 and v * v <= -4.0 * press * GRAZE * s.half_gap[k]:  # overlap v^2/(2 |press|)
        s.events += 1.0
        s.leading_zeros[k] = 2
    else:
        note(s, s.time, CLOSED, k, side, 0.0)
        engage_spring(s, k, side)


@inner
def part(s: Record, k: int) -> None:
    """The flanks of shaft k cease to act."""
    note(s, s.time, OPENED, k, s.side[k], 0.0)
    if s.law[k] != DEAD_ZONE and s.d[k] > 0.0 and s.side[k] * s.theta[k] > s.half_gap[k]:
        s.mode[k] = BEYOND
        s.leading_zeros[k] = 1
    else:
        s.mode[k] = OPEN
        s.theta[k] = s.side[k] * s.half_gap[k]


@inner
def set_friction_state(s: Record, i: int, direction: float) -> None:
    """The body that begins with mass i is held by friction from now on (0), or moves in a direction."""
    for j in range(i, s.n):
        if s.body[j] != i:
            break
        if s.has_friction[j] != 0.0:
            turn_mass(s, j, direction)
        if direction == 0.0:
            s.w[j] = 0.0


@inner
def release(s: Record) -> None:
    """The brake lets the motor go; its friction may still hold it."""
    s.braked = 0.0
    s.release_time = s.time
    s.modes_changed = 1.0
    note(s, s.time, RELEASED, s.at_motor, s.u, 0.0)


@inner
def note_stage(s: Record, bounced: bool) -> None:
    """The path from motor to load has closed or opened, or both at once (`bounced`)."""
    if s.stage == 2.0 or (s.stage == 1.0 and bounced):
        s.stage_2_end = s.time
        for k in range(s.n - 1):
            s.first_peak[k] = s.peak[k]
    steps = 2.0 if bounced else 1.0
    s.stage += steps
    s.gap_events += steps
    if s.stage % 2.0 == 0.0 or bounced:
        s.contacts += 1.0


@inner
def change(s: Record, event: int, k: int, rest: float) -> None:
    """Change of mode of shaft k, whose flanks are in contact or overlap."""
    if event == SETTLE:
        s.side[k] = math.copysign(1.0, s.theta[k])
        settle(s, k, rest)
    elif event == REJOIN:
        note(s, s.time, CLOSED, k, s.side[k], 0.0)
        engage_spring(s, k, s.side[k])
        s.leading_zeros[k] = REJOINED
    elif event == EXIT:
        part(s, k)
    elif event == RELEASE:
        note(s, s.time, OPENED, k, s.side[k], 0.0)
        s.mode[k] = OPEN
        s.leading_zeros[k] = 2
    else:
        s.events += 1.0
        s.leading_zeros[k] = 1
        if event == BACK:
            s.theta[k] = s.side[k] * s.half_gap[k]
            s.mode[k] = OPEN
            s.leading_zeros[k] = 0
        elif event == SWITCH:
            s.mode[k] = CONTACT if s.mode[k] == DOUBLED else DOUBLED
        elif event == TURNED:
            s.sign[k] = -s.sign[k]


@separately_compiled(types.int64(WORK_TYPE, *[types.int64] * 2, *[types.float64] * 3))
def handle(s: Record, event: int, k: int, press: float, rest: float, h: float) -> int:
    """Change of mode at an event on shaft or mass k; 1 if the path from motor to load closed or opened."""
    was = path_closed(s, -1)
    bounced = False
    speed = 0.0
    s.modes_changed = 1.0
    if event in (UPPER, LOWER):
        side = 1.0 if event == UPPER else -1.0
        speed = side * (s.w[k] - s.w[k + 1])
        meet(s, k, side, press, h)
        rebounds = s.mode[k] == OPEN and s.leading_zeros[k] == 0
        bounced = rebounds and s.rigid[k] != 0.0 and s.path <= k < s.path_end
    elif event == STOP:
        set_friction_state(s, k, 0.0)
        if s.slow == 0.0 and s.body[s.at_motor] == k:  # SLOWED at the same instant
            s.t_end = s.time
            s.slow = math.nan
    elif event in (BREAK_FORWARD, BREAK_BACK):
        set_friction_state(s, k, 1.0 if event == BREAK_FORWARD else -1.0)
    elif event == LET_GO:
        s.release_at = s.time + s.opening_delay
        if s.opening_delay == 0.0:
            release(s)
    elif event in (SLOWED, TRAVELLED):
        s.t_end = s.time
        s.slow = s.travel_end = math.nan
        s.modes_changed = 0.0
    elif event in (POINT_ABOVE, POINT_BELOW):
        s.events += 1.0
        s.passed[k] = 1 if event == POINT_ABOVE else -1
        set_piece(s, k, s.piece[k] + s.passed[k])
    elif event == REACHED:
        s.start_time = s.time
        s.modes_changed = 0.0
        note(s, s.time, TARGET_REACHED, s.at_load, s.w[k], 0.0)
        if s.regulated == 0.0:
            if not math.isnan(s.band_low):  # it is judged from here on
                s.settled = s.time
            if s.ends_at_target != 0.0:
                s.t_end = s.time
            elif s.t_end == math.inf:  # without `until` a run goes on for one elastic period
                s.t_end = s.time + s.period
    else:
        if event == REJOIN:
            speed = s.side[k] * (s.w[k] - s.w[k + 1])
        change(s, event, k, rest)
    now = path_closed(s, -1)
    bounced = bounced and not was and path_closed(s, k)  # closed, and opened at once
    if now == was and not bounced:
        return 0
    if math.isnan(s.first_contact) and (now or bounced):
        s.first_contact = s.time
        s.impact_speed = speed
        s.contact_torque = s.u
    note_stage(s, bounced)
    return 1
