"""The records that the compiled kernel works on: the drive, the state of one start, the motion of one span.

Each record is a class of fields and a NumPy type made from it. Outside the kernel a record is a row of
float64 numbers; `row.view(STATE)[0]` is the same memory with names: `x.theta`, `p.c`. The entry functions
(`start`, `record`) do that once a call; all others take records.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Pair = tuple[float, float]
Triple = tuple[float, float, float]
Quintuple = tuple[float, float, float, float, float]
Septuple = tuple[float, float, float, float, float, float, float]

MOST_PENDING: Final = 16  # answers of a controller that may wait for their computing delay
COUPLED_TERMS: Final = 23  # of the power series of a span with viscous friction, see `coupled`


def record(*fields: type, **parts: Any) -> Any:
    """The NumPy type of a record: a float64 for each field of the classes, in order.

    A field named in `parts` is an array of so many numbers or of this shape, or a record within the record.

    >>> class Point:
    ...     x: float
    ...     y: float
    >>> row = np.array([3.0, 4.0])
    >>> float(row.view(record(Point))[0].y)
    4.0
    """
    types: list[Any] = []
    for name in (name for one in fields for name in one.__annotations__):
        part = parts.get(name)
        types.append(
            (name, np.float64, part) if isinstance(part, int | tuple) else (name, part or np.float64)
        )
    # np.record has such attributes too, but takes 6 us for each; a compiled function knows the memory only
    scalar = type(fields[-1].__name__, (np.void,), {name: _field(name) for name, *_ in types})
    return np.dtype((scalar, np.dtype(types)))


def _field(name: str) -> property:
    """A field as an attribute, outside of compiled functions."""
    return property(lambda row: row[name], lambda row, value: row.__setitem__(name, value))


def size(dtype: Any) -> int:
    """How many float64 numbers a record takes."""
    return int(dtype.itemsize) // 8


def index(dtype: Any, path: str) -> int:
    """The place of a field in its row of numbers, `landing.count` for one in a record within the record.

    >>> index(STATE, "theta")
    1
    """
    name, _, rest = path.partition(".")
    inner, offset = dtype.fields[name][:2]
    return int(offset) // 8 + (index(inner, rest) if rest else 0)


class Plant:
    """The drive, in SI units."""

    J1: float
    J2: float
    c: float
    d: float
    gap: float
    Mc: float
    reactive: float  # 1 where the load torque opposes motion
    law: float  # one of the contact laws below
    lag: float
    rate: float  # of the slew limiter, N m/s
    u_min: float
    u_max: float
    target: float
    encoder: float  # angle of one count; 0 for an ideal encoder
    theta_0: float
    w1_0: float
    w2_0: float
    period: float  # 2 pi/Omega
    time_limit: float
    longest: float  # a start that lasts so long is given up
    event_cap: float
    inv_J1: float  # derived, since divisions are slow: 1/J1
    inv_J2: float
    inv_J: float  # 1/(J1 + J2)
    w0sq_slip: float  # Omega^2, of the load that moves
    inv_w0sq: float
    w0_slip: float
    encoder_phase: float
    torque_noise: float
    noise_seed: float
    dead_time: float
    release_at: float  # when the motor's brake is released: 0 no brake, inf by torque proving
    friction: float  # Coulomb friction of the motor, N m
    decay1: float  # viscous friction of motor and load over their inertias, 1/s
    decay2: float


class State:
    """The state of one start and what has been noted of it.

    theta = phi1 - phi2 and v = w1 - w2 are kept, not their parts: the gap is then as sharp after a minute as
    at the start.
    """

    time: float
    theta: float
    v: float
    phi2: float
    w2: float
    ref: float  # the demand after the slew limiter
    u: float
    demand: float
    demand_slope: float
    side: float  # 0 gap open, +1 or -1 the flank in contact
    doubled: float  # 1 while the `modelica` law's damping is capped by its spring: T = 2 c z
    beyond: float  # +1 or -1: no torque though the flanks overlap, as a damped spring must not pull back
    load: float  # 0 stuck, +1 or -1 sign of the speed that Mc opposes; an active load has +1 always
    mask: float  # the event that has just fired, one of the masks below
    held: float  # 1 while the brake holds the motor, 2 while its friction does: w1 = 0, so v = -w2
    motor: float  # +1 or -1 sign of the motor speed that its friction opposes, 0 if none does
    ask_at: float
    ask_on_gap: float
    t_end: float
    sample_angle: float
    sample_time: float
    asked: float
    # what is noted
    stage: float
    stage_start: float
    stage_peak: float
    stage_peak_time: float
    peak: float
    peak_time: float
    gap_events: float
    contacts: float
    first_contact: float
    stage_2_end: float
    impact_speed: float
    contact_torque: float
    first_peak: float
    start_time: float
    release_time: float  # when the brake was released
    position: float  # of an unknown one, that with the largest peak: its place in UNKNOWN_POSITIONS
    excess: float  # how far a demand of the controller went beyond the torque limits, N m
    excess_time: float  # for how long, s
    events: float
    n_segments: float
    n_events: float
    n_stages: float
    status: float


class Motion:
    """The motion of the span being solved, see `motion`."""

    free: float
    z0: float
    v0: float
    A: float
    B: float
    E: float
    rate: float  # lambda
    w0sq: float
    zeta: float
    q: float
    root_q: float
    p0: float
    p1: float
    p2: float
    y0: float
    yv0: float
    branch: float
    k: float
    dd: float
    ua: float  # motor torque of the span
    ub: float
    ue: float
    slew_end: float
    form: float  # how the torque is written, see `motion`
    f0: float  # where its parts would cancel: the right-hand side at the start of the span, and its slope
    f1: float
    p3: float
    p4: float
    slow_lag: float  # 1 where ua, ub s and ue exp(-s/lag) would cancel each other's digits
    last_v: float  # the speed at its end where that is known without evaluating the motion
    w0: float
    steady: float  # 1 for an undamped spring under constant torque, whose events are closed formulas
    memo_v: float  # the last contact's entry and duration: under constant torque it repeats
    memo_p: float
    memo_w: float
    memo_s: float
    memo_done: float  # 1 once that contact has run from flank to flank, its peak noted
    end_known: float  # the motion at the end of the span, once it has been evaluated
    end_z: float
    end_v: float
    by_terms: float  # 1 once a search of this start has outlasted the bounds by energy, see `terms`
    passing: float  # when, within this contact, the load passes its target speed; NaN if it does not
    pending: float  # how many demands wait: for the computing delay, or for the corner of a cut line
    over: float  # 1 while the last answer lies beyond the torque limits: the line from `over_since` on
    over_since: float
    over_torque: float
    over_slope: float
    length: float  # with viscous friction: the longest span of the power series of z, z' and w2, and their
    z_terms: Vector  # coefficients, in s/length
    v_terms: Vector
    w2_terms: Vector
    due_time: Vector  # when each of them takes effect, and what it is
    due_demand: Vector
    due_slope: Vector


class Segment:
    """A recorded span: enough to evaluate every state within it exactly."""

    start: float
    end: float
    stage: float
    side: float
    load: float
    theta: float
    v: float
    phi2: float
    w2: float
    ua: float
    ub: float
    ue: float
    k: float
    dd: float
    held: float
    motor: float
    u: float  # torque and demand at the start; ua and ub give them only to the digits that cancel
    ref: float


class EventRow:
    """A recorded event."""

    time: float
    kind: float
    value: float


class StageRow:
    """A recorded stage."""

    number: float
    start: float
    end: float
    side: float
    peak: float
    peak_time: float


class Measured(NamedTuple):
    """What is measured at the instant of asking. What the controller has not declared is NaN."""

    time: float  # s since the start
    motor_angle: float  # rad, rounded to the encoder's counts
    motor_speed: float  # rad/s, difference of encoder angles since the last asking
    motor_torque: float  # N m, the realised torque, after limits, slew and lag
    stage: float  # 1, 2, ... as in [G]: odd gap open, even gap closed
    shaft_torque: float  # N m
    load_speed: float  # rad/s


class Answer:
    """What a controller answers; its new state follows."""

    torque: float
    ask_again: float
    slope: float


PLANT, STATE = record(Plant), record(State)
MOTION = record(
    Motion, due_time=MOST_PENDING, due_demand=MOST_PENDING, due_slope=MOST_PENDING,
    z_terms=COUPLED_TERMS, v_terms=COUPLED_TERMS, w2_terms=COUPLED_TERMS,
)  # fmt: skip
SEGMENT, EVENT, STAGE_ROW, MEASURED = record(Segment), record(EventRow), record(StageRow), record(Measured)
ANSWER = record(Answer)
N_P, N_X, N_M = size(PLANT), size(STATE), size(MOTION)
N_SEGMENT, N_EVENT, N_STAGE = size(SEGMENT), size(EVENT), size(STAGE_ROW)

# contact laws
NO_PULL, DEAD_ZONE, MODELICA = 0.0, 1.0, 2.0

# kinds of recorded events
CLOSED, OPENED, LOAD_STARTS, LOAD_STOPS, TARGET_REACHED, RELEASED = 1.0, 2.0, 3.0, 4.0, 5.0, 6.0
MOTOR_STARTS, MOTOR_STOPS = 7.0, 8.0

# why `advance` came back
ASK, ENDED, BUFFER_FULL, EVENT_LIMIT, NOT_LOCATED, NOT_FINITE, BAD_COMMAND, QUEUE_FULL, TOO_LONG = range(9)

# what a span ends with
(
    NO_EVENT, UPPER, LOWER, GRAZE_UPPER, GRAZE_LOWER, REJOIN, BACK, EXIT, SWITCH, BREAKAWAY, STOP, REACHED,
    RELEASE, UNSOLVED, MOTOR_FORWARD, MOTOR_BACKWARD, MOTOR_STOP,
) = range(17)  # fmt: skip

# masks: the event that has just fired must not fire again at the instant at which the span begins
NOTHING, LEFT_UPPER, LEFT_LOWER, LEFT_BEYOND, SWITCHED, BROKE_AWAY, REJOINED = range(7)


_PREFIXES = (("", (PLANT, STATE, MOTION)), ("S_", (SEGMENT,)), ("E_", (EVENT,)), ("G_", (STAGE_ROW,)))
_INDEX = {
    prefix + name.upper(): dtype.fields[name][1] // 8
    for prefix, types in _PREFIXES
    for dtype in reversed(types)
    for name in dtype.names
} | {"QUEUE": MOTION.fields["due_time"][1] // 8, "Q_TIME": 0}


def __getattr__(name: str) -> int:
    """The index of a field in its row, by its name in capitals: `x[PEAK]` is `x.peak`."""
    if name not in _INDEX:
        raise AttributeError(name)
    globals()[name] = _INDEX[name]  # found without this function from now on
    return _INDEX[name]
