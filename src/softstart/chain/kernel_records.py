"""The records on which the kernel of chains works, and how a chain is written into them.

Motor, encoder and controller are those of the two-mass plant, with its vectors `p`, `x` and `m`
(`softstart.plant.layout`). What a chain adds are a record for each mass and for each shaft.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numba
import numpy as np

from softstart import plant
from softstart.arrays import Vector
from softstart.chain.elements import MOST_POINTS
from softstart.chain.model import Chain, ChainArrays
from softstart.chain.periodic_torque import PeriodicTorque
from softstart.errors import InputError
from softstart.plant import layout
from softstart.plant.vector import COUNTS_PER_LINE, LAWS
from softstart.vibration import closed, elastic_frequencies

Record = Any  # an element of a structured array, or such an array

ORDERS: Final = 36  # room for Taylor coefficients


def record_type(fields: list[Any]) -> np.dtype[Any]:
    """The type of a record, aligned, as the kernel needs it."""
    return np.dtype(fields, align=True)


MASS = record_type(
    [
        # given
        ("J", float),
        ("ground", float),  # damping to the ground
        ("Mc", float),  # reactive load torque where friction acts (`rubs`), active one elsewhere
        ("active", float),  # active load torque where a gear rubs
        ("rubs", int),  # 1 where friction acts: a reactive load, or a gear with losses
        ("mean", float),  # constant part of the exciting torques
        ("w0", float),
        ("motor_torque0", float),  # at t = 0, of the motor that acts on it
        # state
        ("w", float),
        ("direction", float),  # 0 stuck, else the sign of the speed that friction opposes; 1 without friction
        # of the body, the masses that move as one: its first mass, and in the record of that mass the rest
        ("first", int),
        ("body_J", float),
        ("hold", float),  # how much its reactive loads can hold
        ("stuck", int),
        ("rubbing", int),  # how many of its masses rub
        ("gears", int),  # how many of its gears have losses
        ("size", float),  # sum of the absolute torques: the scale of rounding
        ("influence", float),  # size/body_J
        ("used", float),  # share of what can hold it that holds it as a span begins, signed
        # Taylor coefficients over the span, whose length is 1
        ("speed", float, ORDERS),
        ("outside", float, ORDERS),  # torques from outside
        ("held", float, ORDERS),  # what holds a stuck body
        # load curves, apart from what every span reads: how many masses have one, in the first record;
        # linear between `points` rising speeds or angles, constant beyond them
        ("curves", int),
        ("points", int),
        ("by_angle", int),
        ("at", float, MOST_POINTS),
        ("torque_at", float, MOST_POINTS),
        ("piece", int),  # how many of the points lie before
        ("offset", float),  # the curve is offset + slope * (speed or angle) there
        ("slope", float),
        ("passed", int),  # +1 or -1: a point has just been passed upwards or downwards
        ("angle", float),
        ("turned", float, ORDERS),
    ]
)

SHAFT = record_type(
    [
        # given
        ("c", float),
        ("d", float),
        ("half", float),  # half the gap
        ("rigid", int),
        ("restitution", float),
        ("law", float),
        ("theta0", float),
        ("eta", float),  # efficiency of its gear
        ("gear", int),  # the gear sits at mass k + gear: 0 before, 1 after
        # state
        ("theta", float),
        ("mode", int),
        ("side", float),
        ("zeros", int),  # how many leading coefficients of the event just fired are zero by its nature
        ("sign", float),  # of the torque
        ("before", float),  # share of the torque that acts on the mass before; not 1 at a gear with losses
        ("after", float),
        ("peak", float),
        ("peak_time", float),
        ("impulse", float),  # largest of its impacts
        ("struck", float),  # time of the last impact
        ("blows", int),  # impacts at that very instant
        # Taylor coefficients over the span
        ("twist", float, ORDERS),
        ("torque", float, ORDERS),
    ]
)

# one harmonic of an exciting torque
TONE = record_type([("mass", int), ("omega", float), ("cosine", float), ("sine", float)])

# mode of a shaft: gap open; spring in contact; the same while `modelica` caps its damping; flanks overlap
# without torque; rigid flanks that press; a spring without a gap; a rigid joint
OPEN, CONTACT, DOUBLED, BEYOND, PRESSED, JOINED, WELDED = range(7)

# a recorded span: time and motor; motion of each mass and shaft at its beginning
SPAN = record_type([(name, float) for name in ("start", "end", "ua", "ub", "ue", "u", "ref", "phi")])
SPAN_MASS = record_type([("w", float), ("direction", float), ("angle", float), ("piece", int)])
SPAN_SHAFT = record_type([("theta", float), ("mode", int), ("side", float), ("sign", float)])

# what is read back at an instant, and over the whole run: work in J of motor and exciting torques, against
# the loads, in damping to the ground, in shafts and gears
MOTOR = record_type([("phi", float), ("u", float)])
WORK = record_type([(name, float) for name in ("motor", "exciting", "load", "ground", "shafts", "gears")])

# a recorded event: `place` is a shaft or a mass; of an impact `value` is the loss in J, impulse in N m s
EVENT = record_type([("time", float), ("kind", int), ("place", int), ("value", float), ("impulse", float)])
CLOSED, OPENED, LOAD_STARTS, LOAD_STOPS, TARGET_REACHED, IMPACT, SETTLED, GEAR_LETS_GO, GEAR_HOLDS = range(
    1, 10
)

# what a span ends with
(
    NO_EVENT, UPPER, LOWER, REJOIN, BACK, EXIT, SWITCH, SETTLE, RELEASE, BREAK_FORWARD, BREAK_BACK, STOP,
    REACHED, UNSOLVED, TURNED, POINT_ABOVE, POINT_BELOW,
) = range(17)  # fmt: skip


class Place(NamedTuple):
    """Indices of masses; the shafts from `path` to before `path_end` lead from motor to load."""

    motor: int
    load: int
    path: int
    path_end: int
    motor_shaft: int


class Start(NamedTuple):
    """One start of a chain: everything the kernel reads and writes."""

    p: Vector  # motor, encoder and limits, as in the two-mass plant
    x: Vector
    m: Vector
    place: Place
    masses: Record
    shafts: Record
    tones: Record
    u: Vector  # Taylor coefficients of the motor torque
    phi: Vector  # and of the motor angle
    f: Vector  # scratch: an event function
    g: Vector
    spans: Record
    span_masses: Record  # a row for each span
    span_shafts: Record
    events: Record


def _blank(rows: int, place: Place, masses: Record, shafts: Record, tones: Record, p: Vector) -> Start:
    """A start that has not begun, with room for so many recorded spans and events."""
    u, phi, f, g = np.zeros((4, ORDERS))
    count = masses.size
    return Start(
        p, np.zeros(layout.N_X), np.zeros(layout.N_M), place, masses, shafts, tones, u, phi, f, g,
        np.zeros(rows, SPAN), np.zeros((rows, count), SPAN_MASS), np.zeros((rows, count - 1), SPAN_SHAFT),
        np.zeros(rows + 4 * count if rows else 0, EVENT),
    )  # fmt: skip


START_TYPE: Any = numba.typeof(  # type: ignore[no-untyped-call]
    _blank(1, Place(0, 1, 0, 1, 0), np.zeros(2, MASS), np.zeros(1, SHAFT), np.zeros(1, TONE), np.zeros(1))
)


# a chain as records ---------------------------------------------------------------------------------

# speeds of masses joined rigidly, typed with the digits of a data sheet at their own shafts
SAME_SPEED = 1e-6


@dataclass(frozen=True, eq=False)
class Numbers:
    """A chain, its motor and its exciting torques as the kernel has them before the start."""

    p: Vector
    place: Place
    masses: Record
    shafts: Record
    tones: Record

    @property
    def count(self) -> int:
        """How many masses there are."""
        return int(self.masses.size)

    def start(self, rows: int = 0) -> Start:
        """A start that has not begun, with room for so many recorded spans and events."""
        return _blank(rows, self.place, self.masses.copy(), self.shafts.copy(), self.tones, self.p)


def elastic_period(chain: Chain) -> float:
    """The period of the first natural frequency with all gaps closed, s; 0 where every joint is rigid.

    >>> round(elastic_period(Chain.load("crane-4-mass")), 4)
    0.0548
    """
    arrays = chain.at_motor_shaft()
    if arrays.rigid.all():
        return 0.0
    body = closed(arrays)
    return 2.0 * math.pi / float(elastic_frequencies(body.J, body.c)[0])


def numbers(
    chain: Chain,
    excitation: Mapping[str | int, PeriodicTorque] | None,
    time_limit: float | None,
    max_events: int,
) -> Numbers:
    """The records of a chain at its motor shaft."""
    arrays = chain.at_motor_shaft()
    _refuse(chain, arrays)
    count = arrays.J.size
    masses = np.zeros(count, MASS)
    masses["J"], masses["ground"], masses["Mc"] = arrays.J, arrays.d_ground, arrays.Mc
    # a reactive load without torque never sticks: it is the same as an active one
    reactive = arrays.reactive & (arrays.Mc > 0.0)
    masses["rubs"] = reactive
    masses["rubs"][arrays.gear[arrays.efficiency != 1.0]] = 1
    geared = (masses["rubs"] != 0) & ~reactive
    masses["active"][geared], masses["Mc"][geared] = arrays.Mc[geared], 0.0
    masses["w0"] = arrays.w0
    for j, (given, i) in enumerate(zip(chain.masses, arrays.speed_ratio.tolist(), strict=True)):
        if given.curve is not None:
            mass = masses[j]
            masses["curves"][0] += 1
            at, torques, by_angle = given.curve
            mass["points"], mass["by_angle"] = len(at), by_angle
            mass["at"][: len(at)], mass["torque_at"][: len(at)] = np.array(at) / i, np.array(torques) * i
    if chain.motor is not None:
        masses["motor_torque0"][arrays.motor] = chain.motor.initial_torque
    for k in range(count - 1):
        if _welded(arrays, k):  # one body has one speed, not two that differ by rounding
            masses["w0"][k + 1] = masses["w0"][k]
    shafts = np.zeros(count - 1, SHAFT)
    shafts["c"] = np.where(arrays.rigid, 0.0, arrays.c)
    shafts["d"], shafts["half"] = arrays.d, 0.5 * arrays.gap
    shafts["rigid"] = arrays.rigid
    shafts["restitution"] = np.nan_to_num(arrays.restitution)
    shafts["law"] = [LAWS[law] for law in arrays.law]
    shafts["theta0"] = arrays.theta0
    shafts["eta"], shafts["gear"] = arrays.efficiency, arrays.gear - np.arange(count - 1)
    low, high = sorted((arrays.motor, arrays.load))
    at_motor = arrays.motor if arrays.load > arrays.motor or arrays.motor == 0 else arrays.motor - 1
    place = Place(arrays.motor, arrays.load, low, high, at_motor)
    tones = _tones(chain, arrays, excitation or {}, masses)
    return Numbers(_motor(chain, arrays, time_limit, max_events), place, masses, shafts, tones)


def _welded(arrays: ChainArrays, k: int) -> bool:
    """Whether shaft k joins its masses rigidly, without a gap."""
    return bool(arrays.rigid[k] and arrays.gap[k] == 0.0)


def _refuse(chain: Chain, arrays: ChainArrays) -> None:
    wrong = []
    for k, shaft in enumerate(chain.shafts):
        if shaft.efficiency != 1.0 and arrays.rigid[k]:
            wrong.append(
                f"[shaft] {k + 1}, efficiency = {shaft.efficiency}: the loss of a gear goes with the torque "
                "of a spring, and this shaft is rigid; give it a stiffness, or leave the efficiency out."
            )
        if _welded(arrays, k) and not math.isclose(arrays.w0[k], arrays.w0[k + 1], rel_tol=SAME_SPEED):
            wrong.append(
                f"[shaft] {k + 1}: it is rigid, so the masses it joins start with one speed, and they have "
                f"{arrays.w0[k]:.12g} and {arrays.w0[k + 1]:.12g} rad/s at the motor shaft; give both the "
                "same initial_speed, divided by the ratio."
            )
    if wrong:
        raise InputError(wrong)


def _motor(chain: Chain, arrays: ChainArrays, time_limit: float | None, max_events: int) -> Vector:
    """The vector p of the two-mass plant, as far as motor, encoder and controller go."""
    row = np.zeros(layout.N_P)
    p = row.view(layout.PLANT)[0]
    period = elastic_period(chain)
    p.period = period
    p.event_cap = max_events
    # no span is longer: in free flight it would reach to the time limit, and rounding depended on that
    p.longest = period if period > 0.0 else math.inf
    p.rate = math.inf
    p.target = math.inf if chain.target_speed is None else chain.target_speed
    p.time_limit = math.inf if time_limit is None else time_limit
    motor = chain.motor
    if motor is None:
        return row
    p.rate = motor.torque_rate
    p.u_min, p.u_max = motor.minimum_torque, motor.maximum_torque
    if motor.encoder_lines > 0.0:
        p.encoder = 2.0 * math.pi / (COUNTS_PER_LINE * motor.encoder_lines)
    p.encoder_phase = motor.encoder_phase
    p.torque_noise, p.noise_seed = motor.torque_noise, motor.noise_seed
    p.dead_time = motor.computing_delay
    p.lag = motor.torque_lag if motor.torque_lag > 1e-12 * period else 0.0
    if time_limit is None:
        heavier = 1.0 / arrays.efficiency_from_motor
        left = motor.starting_torque - float((arrays.Mc * heavier).sum())
        speeds = p.target + float(np.abs(arrays.w0).sum())
        if left > 0.0:
            p.time_limit = 100.0 * (float((arrays.moving_J * heavier).sum()) * speeds / left + period)
    return row


def _tones(
    chain: Chain, arrays: ChainArrays, excitation: Mapping[str | int, PeriodicTorque], masses: Record
) -> Record:
    """The harmonics of all exciting torques at the motor shaft; their means go into `masses`."""
    rows = []
    for name, torque in excitation.items():
        i = chain.index(name)
        brought = arrays.speed_ratio[i]
        masses["mean"][i] += brought * torque.mean
        for omega, cosine, sine in zip(torque.frequencies, torque.cosine, torque.sine, strict=True):
            rows.append((i, omega, brought * cosine, brought * sine))
    return np.array(rows, TONE)


def _drop_stale_cache() -> None:
    """As `softstart.plant` does: numba does not see changes in the files of the functions it calls."""
    here = Path(__file__).parent
    compiled = [*here.glob("__pycache__/kernel_*.nbi"), *here.glob("__pycache__/kernel_*.nbc")]
    sources = [*here.glob("kernel_*.py"), *Path(plant.__file__).parent.glob("*.py")]
    try:
        if compiled and max(p.stat().st_mtime for p in sources) > min(p.stat().st_mtime for p in compiled):
            for path in compiled:
                path.unlink(missing_ok=True)
    except OSError:
        return  # another process is compiling or cleaning, or the folder is read-only: numba decides


_drop_stale_cache()
