"""The records of the kernel: what is given of a machine, the work of one start, what is noted of it.

Outside of the kernel a record is a row of float64 numbers; `row.view(WORK)[0]` is the same memory with names:
`s.time`, `s.c[k]`. Everything is at the motor shaft and in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
from numba import from_dtype

from softstart.arrays import Vector

MOST_MASSES: Final = 64
ORDERS: Final = 36  # room for Taylor coefficients
MOST_PENDING: Final = 16  # answers of a controller that may wait for their computing delay
MOST_POINTS: Final = 16  # of a load curve
MOST_NOTED: Final = 2 * MOST_MASSES + 16  # events at one instant

Double = Annotated[float, "double"]
"""Of a field: 64 bits in single-precision exports too, as clocks and angles need."""
_KINDS: dict[Any, str] = {"int": "whole", "bool": "truth", "Double": "double", int: "whole", bool: "truth"}
_KINDS[Double] = "double"
Doubles = Annotated[Vector, "double"]
"""Of an array: the same for its numbers."""
_KINDS |= {"Doubles": "double", Doubles: "double"}

Part = int | tuple[int, ...] | np.dtype[np.void]
Record = Any  # a record of one of these types, in compiled code


def record(*fields: type, whole: Sequence[str] = (), **parts: Part) -> np.dtype[np.void]:
    """The NumPy type of a record: a float64 for each field of the classes, in order.

    A field named in `parts` is an array of so many numbers or of this shape, or a record within the record;
    those named in `whole` hold int64. Exports keep a field that is declared as `int`, `bool` or `Double` as a
    whole number, a truth, or a number of 64 bits.

    >>> class Point:
    ...     x: float
    ...     y: float
    >>> row = np.array([3.0, 4.0])
    >>> float(row.view(record(Point))[0].y)
    4.0
    """
    types: list[Any] = []
    for name in (name for one in fields for name in one.__annotations__):
        part, number = parts.get(name), np.int64 if name in whole else np.float64
        types.append((name, number, part) if isinstance(part, int | tuple) else (name, part or number))
    # np.record has such attributes too, but takes 6 us for each; a compiled function knows the memory only
    known = f"{fields[-1].__module__}.{fields[-1].__qualname__}".replace(".", "_")
    # a NamedTuple has its annotations wrapped
    kinds = {
        name: _KINDS.get(getattr(kind, "__forward_arg__", kind), "real")
        for one in fields
        for name, kind in one.__annotations__.items()
    }
    members = {name: _field(name) for name, *_ in types}
    about = {"__module__": __name__, "kinds": kinds, "classes": fields}  # for exports
    scalar = type(known, (np.void,), members | about)
    globals()[known] = scalar  # where another process finds it
    return np.dtype((scalar, np.dtype(types)))


def _field(name: str) -> property:
    """A field as an attribute, outside of compiled functions."""
    return property(lambda row: row[name], lambda row, value: row.__setitem__(name, value))


def size(dtype: np.dtype[np.void]) -> int:
    """How many float64 numbers a record takes."""
    return int(dtype.itemsize) // 8


class MachineRecord:
    """What is given of motor, encoder and start."""

    lag: float  # of the realised torque, s
    rate: float  # of the slew limiter, N m/s
    u_min: float
    u_max: float
    encoder: float  # angle of one count; 0 for an ideal encoder
    encoder_phase: float
    torque_noise: float
    noise_seed: float
    dead_time: float
    release_at: float  # when the motor's brake is released: 0 no brake, inf by torque proving
    begins_at: float  # when the controller begins, where it waits for its brake to open, s
    opening_delay: float  # for how long the brake still holds after torque proving, s
    initial_torque: float
    target: float
    period: float  # of the first natural frequency with all gaps closed; 0 where every joint is rigid
    time_limit: float
    longest: float  # a start that lasts so long is given up
    event_cap: float
    motor: float  # indices of masses
    load: float
    set_speed: float  # commanded speed, rad/s
    # the band of the load speed in which it has settled, rad/s; NaN: it is not noted when
    band_low: float
    band_high: float
    regulated: float  # 1 where the controller holds the speed: the start ends `dwell` after it has settled
    command_end: float  # when the last command of such a controller has ended, s
    dwell: float  # for how long the load must stay in its band, s; of a stop, all masses in that of rest
    # a start is given up with a larger |T|, N m, or if it cannot come to its speed by then, s; 0: it is not
    give_up_torque: float
    give_up_time: float
    fastest_rise: float  # of the load speed with |T| up to that, rad/s^2; inf if that is not known
    guard: float  # GuardLimits


class GuardLimits:
    """What is guarded under a sampled controller; see `kernel.guard`."""

    period: Double  # of the samples, s; 0 is not guarded
    low: float  # limits of the torque, N m
    high: float
    lag: float  # of the realised torque, with its decay in a period
    decay: float
    rate: float
    dead_time: float
    immediate: float  # 1 without lag, rate and dead time
    tolerance: float  # of the realised torque beside its model, N m
    count: float  # of the encoder, rad
    speed: float  # of the motor that is possible from the beginning, rad/s
    acceleration: float
    hold: float  # torque that the load and friction may hold, N m
    inertia: float  # of the whole machine
    slack: float  # motion of it that a motor may miss, rad
    brake: float  # 1 with a brake of the motor
    commanded: float  # 1 where the controller reads its commands


class GuardState:
    """What has been seen so far."""

    fault: int
    begun: float
    time: Double  # of the last sample, with what was measured
    angle: Double
    torque: float
    due: Double  # when the next sample is due
    fastest: float  # speed so far
    moved: float
    still_speed: float  # that the machine should have, while the encoder stands still
    still_way: float
    window: Double  # beginning of the younger of two windows of demands, with their bounds
    recent_high: float
    recent_low: float
    older_high: float
    older_low: float
    ref_high: float  # bounds of the output of the slew limiter
    ref_low: float
    high: float  # and of the realised torque
    low: float
    off: float  # samples in a row in which the torque is beyond them


class MassRecord:
    """What is given of a mass."""

    J: float
    ground: float  # damping to the ground
    active: float  # load torque that acts always
    mean: float  # of the exciting torques
    Mc: float  # reactive load torque
    friction: float  # Coulomb friction of the motor
    w0: float


class ShaftRecord:
    """What is given of the shaft behind a mass."""

    c: float
    d: float
    half_gap: float  # half the gap
    rigid: float
    restitution: float
    law: float  # one of the contact laws below
    theta0: float
    eta: float  # efficiency of its gear
    gear: float  # the gear sits at mass k + gear: 0 before, 1 after


class Curve:
    """A load curve: linear between `points` rising speeds or angles, constant beyond them."""

    mass: float
    points: float
    by_angle: float
    at: float
    torque: float


class Tone:
    """One harmonic of an exciting torque."""

    mass: float
    omega: float
    cosine: float
    sine: float


class ResultRecord:
    """What is noted of a start."""

    status: float
    start_time: float
    settled: float  # since when the load speed is in its band; NaN where it is not
    reached: float  # at the end 1 where the load has its target speed, of a regulated start in its band
    overshoot: float  # of a regulated start: share of the target by which the load exceeds it; else NaN
    time: float  # at the end that of the run
    final_speed: float  # of the load at the end
    stage: float  # odd while a gap between motor and load is open, even while none is
    gap_events: float
    contacts: float
    first_contact: float
    impact_speed: float  # at which the flanks first meet
    contact_torque: float  # of the motor then
    stage_2_end: float
    release_time: float  # of the brake
    braked: float  # 1 while the brake holds the motor
    excess: float  # how far a demand of the controller went beyond the torque limits, N m
    excess_time: float  # for how long, s
    events: float
    asked: float
    n_spans: float
    n_events: float
    fault: float  # 0, or a code of `kernel.guard.FAULTS`
    position: float  # of an unknown one, that with the largest peak: its place in UNKNOWN_POSITIONS


class ShaftNotes:
    """What is noted of a shaft."""

    peak: float
    peak_time: float
    impulse: float  # largest of its impacts
    first_peak: float  # largest |T| up to the end of stage 2


class Places:
    """Indices of masses; the shafts from `path` to before `path_end` lead from motor to load."""

    n: float  # how many masses there are
    at_motor: float
    at_load: float
    path: float
    path_end: float
    motor_shaft: float


class OfMasses:
    """State of a mass, and what follows from the modes."""

    w: float
    direction: float  # 0 held by friction, else the sign of the speed that it opposes; 1 without friction
    angle: float  # with a load curve
    has_friction: float  # 1 where friction acts: reactive load, motor, a gear with losses
    constant_torque: float  # torque from outside that is constant within the span
    # masses that move as one are a body: the index of its first mass, under which its other numbers stand
    body: float
    inverse_J: float  # one over its inertia; 0 while it is held
    body_J: float
    friction_limit: float  # how much its friction can hold
    stuck: float
    friction_count: float  # how many of its masses rub
    lossy_gears: float  # how many of its gears have losses
    torque_scale: float  # sum of the absolute torques: the scale of rounding
    # its load curve over the speed or the angle: `points` and the torques there, and the straight piece
    points: float  # 0 without a load curve
    by_angle: float
    at: float
    torque_at: float
    piece: float  # how many of the points lie before
    offset: float  # the curve is offset + incline * (speed or angle) there
    incline: float
    passed: float  # +1 or -1: a point has just been passed upwards or downwards
    new_friction: float  # 1 where there was no friction before
    still_since: float  # since when the speed is in the band of rest; NaN where it is not


class OfShafts:
    """State of a shaft, and what follows from the modes."""

    theta: float
    mode: float
    side: float
    sign: float  # of the torque
    peak: float
    peak_time: float
    impulse: float
    first_peak: float
    last_impact_time: float  # time of the last impact
    impacts_at_instant: float  # impacts at that very instant
    leading_zeros: float  # how many leading coefficients of the event just fired are zero by its nature
    stiff: float  # stiffness and damping that act
    damp: float
    spring_zero: float  # twist at which the spring is slack
    share_before: float  # share of the torque that acts on the mass before; not 1 at a gear with losses
    share_after: float


class OfSpan:
    """Taylor coefficients over the span, whose length is 1."""

    speed: float
    twist: float
    torque: float
    exciting_torque: float
    net_torque: float  # on a mass without that of rigid joints; under its first mass, on the body
    rotation: float  # angle of a mass with a load curve by angle


class StartState:
    """The rest of the state of a start."""

    t_end: float
    watch: float  # GuardState
    run: float  # commands: 1 run, 0 stop; the set speed is in MachineRecord
    command_since: float  # when they last changed
    highest_speed: float  # of the load so far, in a regulated start, in the direction `toward`
    # of a step of a duty; in a start 1, 1, 0, NaN, NaN, 0
    sense: float  # -1 where a controller runs backwards: it sees and demands everything with the other sign
    toward: float  # direction in which the load passes its target speed
    ends_at_target: float  # 1: the step ends there
    slow: float  # it ends when the speed of the motor times `toward` has fallen to this, rad/s
    travel_end: float  # or when the angle of the load times `toward` has come to this, rad
    still: float  # band of rest, rad/s: the step ends once all masses have been in it for `dwell`
    phi: float  # angle of the load
    u: float  # its realised torque
    u_ref: float  # the demand after the slew limiter
    demand: float
    demand_slope: float
    slope: float  # of the slew limiter's output in this span
    slew_end: float  # when, in this span, it has come to the demand; inf if it does not
    on_line: float  # 1 where the lag's exponential has died away: u is a line
    ask_at: float
    ask_own: float  # the same by the clock of the controller, to the last digit
    ask_on_gap: float
    sample_angle: float
    sample_time: float
    pending: float  # how many demands wait: for the computing delay, or for the corner of a cut line
    beyond_limits: float  # 1 while the last reply lies beyond the torque limits, on this line:
    beyond_since: float
    beyond_torque: float
    beyond_slope: float
    due_time: float  # when each of them takes effect, and what it is
    due_demand: float
    due_slope: float
    modes_changed: float  # 1 where what follows from the modes is to be computed again
    bodies: float  # 1 where masses move as one
    rate_bound: float  # upper bound of the machine's rates in the present modes, 1/s
    tones: float  # how many harmonics the exciting torques have
    tone_rate: float  # and the fastest of them
    curves: float  # how many masses have a load curve
    torque_u: float  # Taylor coefficients of the motor torque and of the load's angle
    angle_u: float
    f: float  # scratch: an event function
    event_place: float  # shaft or mass of the event that ends the span
    event_share: float  # and when, as a share of the span
    noted: float  # events that are not yet recorded, how many and which
    note_time: float
    note_kind: float
    note_place: float
    note_value: float
    note_impulse: float


class EventRow:
    """A recorded event: `place` is a shaft or a mass; of an impact `value` is the loss in J."""

    time: float
    kind: float
    place: float
    value: float
    impulse: float


class Measured(NamedTuple):
    """What is measured at the instant of asking. What the controller has not declared is NaN.

    Parameters
    ----------
    time : s since the start.
    motor_angle : rad, rounded to the counts of the encoder.
    motor_speed : rad/s, difference of the encoder angles since the last asking.
    motor_torque : N m, the realised torque, after limits, slew limiter and lag.
    stage : 1, 2, ... as in [G]: odd with the gap open, even with the gap closed. Needs `Sensor.STAGE`.
    shaft_torque : N m. Needs `Sensor.SHAFT_TORQUE`.
    load_speed : rad/s. Needs `Sensor.LOAD_SPEED`.
    run : 1 while the drive is to run, 0 while it is to stop.
    set_speed : rad/s, the commanded speed with its sign; in a start the target speed.
    command_time : s since `run` or `set_speed` last changed.

    Examples
    --------
    >>> Measured(0.1, 0.25, 12.0, 62.0).motor_speed
    12.0

    References
    ----------
    The stages: [G].
    """

    time: Double
    motor_angle: Double
    motor_speed: float
    motor_torque: float
    stage: float = math.nan
    shaft_torque: float = math.nan
    load_speed: float = math.nan
    run: float = 1.0
    set_speed: float = math.nan
    command_time: Double = math.nan


class Reply:
    """What a controller answers; its new state follows."""

    torque: float
    ask_again: Double
    slope: float


_WHOLE = (  # numbers that are counted
    "n at_motor at_load path path_end motor_shaft body stuck friction_count lossy_gears points piece passed "
    "mode leading_zeros event_place noted"
)


def _parts() -> dict[str, Part]:
    """The arrays in the work of a start."""
    shapes: dict[str, Part] = dict.fromkeys(("torque_u", "angle_u", "f"), ORDERS)
    shapes |= dict.fromkeys(("at", "torque_at"), (MOST_MASSES, MOST_POINTS))
    shapes |= dict.fromkeys(
        ("note_time", "note_kind", "note_place", "note_value", "note_impulse"), MOST_NOTED
    )
    shapes |= dict.fromkeys(("due_time", "due_demand", "due_slope"), MOST_PENDING)
    shapes |= dict.fromkeys(OfSpan.__annotations__, (MOST_MASSES, ORDERS))
    for part in (MassRecord, ShaftRecord, OfMasses, OfShafts):
        shapes = dict.fromkeys(part.__annotations__, MOST_MASSES) | shapes
    return shapes | {"guard": GUARD_LIMITS, "watch": GUARD_STATE}


GUARD_LIMITS, GUARD_STATE = record(GuardLimits), record(GuardState)
MACHINE = record(MachineRecord, guard=GUARD_LIMITS)
MASS, SHAFT, TONE = record(MassRecord), record(ShaftRecord), record(Tone)
CURVE = record(Curve, at=MOST_POINTS, torque=MOST_POINTS)
NOTES, SHAFT_NOTES, EVENT = record(ResultRecord), record(ShaftNotes), record(EventRow)
MEASURED, ANSWER = record(Measured), record(Reply)
WORK = record(
    ResultRecord,
    MachineRecord,
    Places,
    MassRecord,
    ShaftRecord,
    OfMasses,
    OfShafts,
    OfSpan,
    StartState,
    whole=_WHOLE.split(),
    **_parts(),
)
# for compiled functions
WORK_TYPE: Any = from_dtype(WORK)
MEASURED_TYPE: Any = from_dtype(MEASURED)
TONE_TYPE: Any = from_dtype(TONE)
N_MACHINE, N_NOTES, N_WORK = size(MACHINE), size(NOTES), size(WORK)
# In the work of a start the fields of MassRecord, ShaftRecord, ShaftNotes and EventRow are arrays, one behind
# the other in the same order; these are the places of the first ones
AT_MACHINE, AT_MASSES, AT_SHAFTS, AT_SHAFT_NOTES, AT_EVENTS = (
    int(dict(WORK.fields or ())[name][1]) // 8 for name in ("lag", "J", "c", "peak", "note_time")
)

# a recorded span: these numbers, then w, direction, angle and piece of each mass, then theta, mode, side and
# sign of each shaft
S_START, S_END, S_U, S_REF, S_SLOPE, S_PHI, S_BRAKED, S_STAGE, S_MASSES = range(9)
OF_MASS, OF_SHAFT = 4, 4


def span_size(masses: int) -> int:
    """How many numbers a recorded span of so many masses takes."""
    return S_MASSES + OF_MASS * masses + OF_SHAFT * (masses - 1)


# contact laws
NO_PULL, DEAD_ZONE, MODELICA = 0.0, 1.0, 2.0

# mode of a shaft: gap open; spring in contact; the same while `modelica` caps its damping; flanks overlap
# without torque; rigid flanks that press; a spring without a gap; a rigid joint
OPEN, CONTACT, DOUBLED, BEYOND, PRESSED, JOINED, WELDED = range(7)

# kinds of recorded events; no Python integers, for each of which numba would compile what it is passed to
_kinds: Any = np.arange(1, 9)
CLOSED, OPENED, STARTS, STOPS, TARGET_REACHED, RELEASED, IMPACT, SETTLED = _kinds

# why `advance` came back
(
    ASK, ENDED, BUFFER_FULL, EVENT_LIMIT, NOT_LOCATED, NOT_FINITE, BAD_COMMAND, QUEUE_FULL, TOO_LONG,
    TOO_STIFF, NO_BETTER,
) = range(11)  # fmt: skip
SPANS_PER_EVENT = 2.0  # so many times as many spans as events are permitted

# what a controller may declare to see beyond time, motor angle, speed and torque
SEES_STAGE, SEES_SHAFT_TORQUE, SEES_LOAD_SPEED = 1, 2, 4

# faults
(
    NO_FAULT, NOT_FINITE_MEASURED, SAMPLE_LATE, ENCODER_JUMPED, ENCODER_STUCK, TORQUE_OFF, NO_DEMAND,
) = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)  # fmt: skip

# what a span ends with
(
    NO_EVENT, UPPER, LOWER, REJOIN, BACK, EXIT, SWITCH, SETTLE, RELEASE, BREAK_FORWARD, BREAK_BACK, STOP,
    REACHED, UNSOLVED, TURNED, POINT_ABOVE, POINT_BELOW, LET_GO, SLOWED, TRAVELLED,
) = range(20)  # fmt: skip
