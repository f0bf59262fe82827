"""First demands for a descent: closed form, the gentlest of a few hundred pulses, random switching."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from softstart.errors import InputError, SimulationError
from softstart.optimal.descent import Descent
from softstart.optimal.pulse_coast_hold import PulseCoastHoldStarts
from softstart.optimal.starts import DemandSimulator
from softstart.profile import TorqueProfile

EARLY = 0.6  # share of the demands that switch early, and of the others that end with the highest torque
HALVINGS = 24
LEVELS = 7
PULSES = (0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 1.0)
PHASES = (0.0, 0.06, 0.12, 0.18, 0.25, 0.4)


def pulse_coast_hold(search: Descent, player: DemandSimulator) -> TorqueProfile | None:
    """Pulse, coast, hold of the least peak that brings this machine to its speed in time; None if none does.

    The instants are those of the two masses that stand for the machine, undamped and with an ideal torque;
    whether it is in time, its exact start says.
    """
    try:
        starts = PulseCoastHoldStarts(player.machine.two_masses, search.high)
    except InputError:
        return None

    def demand(P: float) -> TorqueProfile:
        course = starts.course(P)
        edges, levels = [0.0], []
        for until, level in ((course.t1, search.high), (course.t_peak, 0.0), (search.until, starts.held(P))):
            if edges[-1] < until < math.inf:
                edges.append(until)
                levels.append(min(max(level, search.low), search.high))
        return TorqueProfile.steps(edges, levels)

    low, high = starts.least_peak, starts.full_peak
    if not _in_time(search, player, demand(high)):
        return None
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _in_time(search, player, demand(middle)) else (middle, high)
    return demand(high)


def _in_time(search: Descent, player: DemandSimulator, demand: TorqueProfile) -> bool:
    try:
        return player.figures(demand, search.latest)[1] <= search.latest
    except SimulationError:
        return False


def pulse_coast_level(search: Descent) -> list[TorqueProfile]:
    """Pulse, coast (or brake), a constant torque: the gentlest of a few hundred exact starts, best first.

    The pulse takes a share of the time that full torque needs to the first contact, the coast ends a share of
    the period after the contact; the torque from there on is what brings all loads to their speeds in time.
    One for each pulse, torque of the coast and machine whose contact counts.
    """
    found = []
    for player in search.players:
        first = _first_contact(player, TorqueProfile([0.0], [search.high]), search.until)
        first = first if math.isfinite(first) and first > 0.0 else 0.25 * player.period
        for low, share in itertools.product({max(0.0, search.low), search.low}, PULSES):
            t1 = share * first
            coast = TorqueProfile.steps([0.0, t1, search.until], [search.high, low])
            contact = max(_first_contact(player, coast, search.latest), t1)
            ends = [contact + phase * player.period for phase in PHASES if contact < search.latest]
            levels = [_level(search, t1, t2, low) for t2 in ends if t2 < search.latest]
            best = min((one for one in levels if one is not None), key=lambda one: one[0], default=None)
            found += [] if best is None else [best]
    return [one for _, one in sorted(found, key=lambda one: one[0])]


def constant(search: Descent) -> list[TorqueProfile]:
    """The least constant torque that is in time, if there is one."""
    level = _level(search, 0.0, 0.0, search.low)
    return [] if level is None else [level[1]]


def _first_contact(player: DemandSimulator, demand: TorqueProfile, until: float) -> float:
    """When a gap first closes, s; infinite if none does."""
    try:
        return player.first_contact(demand, until)
    except SimulationError:
        return math.inf


def _level(search: Descent, t1: float, t2: float, low: float) -> tuple[float, TorqueProfile] | None:
    """The least constant torque after a pulse and a coast that is in time, and the largest peak then."""

    def demand(level: float) -> TorqueProfile:
        edges, levels = [0.0], []
        for until, torque in ((t1, search.high), (t2, low), (search.until, level)):
            if until > edges[-1]:
                edges.append(until)
                levels.append(torque)
        return TorqueProfile.steps(edges, levels)

    def in_time(level: float) -> bool:
        return all(_in_time(search, player, demand(level)) for player in search.players)

    a, b = low, search.high
    if not in_time(b):
        return None
    for _ in range(LEVELS):
        middle = 0.5 * (a + b)
        a, b = (a, middle) if in_time(middle) else (middle, b)
    return max(player.figures(demand(b), search.latest)[0] for player in search.players), demand(b)


def switching(search: Descent, span: float, count: int) -> Iterator[TorqueProfile]:
    """Demands that switch between the limits of the torque at random instants, s, most of them early.

    A quick start has a torque at its limits, and swings of the masses that end together: a few switches in
    the first two periods choose them. The random numbers are the same each time.
    """
    rng = np.random.default_rng(1)
    for _ in range(count):
        few = rng.random() < EARLY
        switches = int(rng.integers(1, 4 if few else 6))
        until = min(span, 2.0 * search.period) if few else span
        times = np.sort(rng.uniform(0.0, until, switches))
        levels = np.resize([1.0, 0.0], switches + 1)
        if few:
            levels[:-1] = rng.choice([0.0, 1.0], switches)
        levels[-1] = 1.0 if few or rng.random() < EARLY else levels[-1]
        torques = search.low + (search.high - search.low) * levels
        yield TorqueProfile.steps([0.0, *times, max(search.until, 1.01 * until)], torques)
