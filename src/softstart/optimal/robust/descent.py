"""Going down from a staircase: linear programs within a trust region, judged by the exact plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softstart.optimal.robust.linear_step import Rules, free_edges, linear_step, merit
from softstart.optimal.robust.plays import Course, Plays
from softstart.optimal.robust.shape import Player, Staircase
from softstart.profile import Vector

STALLED = 8  # rounds over which a descent must gain something
SMALLEST_TRUST = 1e-6
MENDINGS = 6


@dataclass(frozen=True, eq=False)
class Place:
    """A staircase and what the exact plant says of it."""

    shape: Staircase
    peak: float  # worst |T|, N m
    late: float  # s by which the latest start misses the time asked for; 0 or below if all are in time


def look(plays: Plays, player: Player, shape: Staircase) -> Place:
    """The exact plant's word on one staircase."""
    figures = plays.figures(player, shape.unknowns)
    return Place(shape, float(figures.peak.max()), float(plays.lateness(figures).max()))


def descend(plays: Plays, shape: Staircase, rules: Rules, stalled: float = 1e-6) -> Place:
    """The best staircase reached from `shape`, in time if anything on the way was.

    A step of the linear program is kept only if the exact plant's merit falls by a part of what was promised;
    else the trust region shrinks. Ends where less than `rules.enough` is promised, or where the last rounds
    gained less than `stalled`, both relative to the torque range.
    """
    player = Player(shape, plays.drives[0])
    here = best = look(plays, player, shape)
    trust, courses = rules.trust, _courses(plays, player, here, rules)
    merits = [_merit(here, plays, rules)]
    for _ in range(rules.rounds):
        step = linear_step(plays, courses, here.shape, rules, trust)
        if step is None or step.promise <= rules.enough * rules.span:
            break
        tried = look(plays, player, _moved(here, step.change, rules))
        gain = merits[-1] - _merit(tried, plays, rules)
        if gain < 0.5 * step.promise and tried.late > 0.0 and rules.aim == "gentle":
            tried, gain = _mended(plays, player, courses, here, tried, trust, rules, merits[-1] - gain, gain)
        if gain > 0.05 * step.promise:
            trust = min(2.0 * trust, 0.5) if gain > 0.6 * step.promise else trust
            here = tried
            best = (
                here
                if rules.aim == "quick" or _rank(here, plays, rules) < _rank(best, plays, rules)
                else best
            )
            courses = _courses(plays, player, here, rules)
        else:
            trust *= 0.3
        merits.append(_merit(here, plays, rules))
        few = merits[-STALLED:]
        if trust < SMALLEST_TRUST or (
            len(few) == STALLED and few[0] - few[-1] < stalled * rules.span and gain > 0
        ):
            break
    if rules.aim == "gentle" and here.late > 0.0:
        mended = in_time(plays, player, here, rules, trust)
        best = mended if _rank(mended, plays, rules) < _rank(best, plays, rules) else best
    return best


def in_time(plays: Plays, player: Player, late: Place, rules: Rules, trust: float) -> Place:
    """A place that is a little late, moved until it is in time."""
    for _ in range(MENDINGS):
        if late.late <= 0.0:
            break
        courses = _courses(plays, player, late, rules)
        step = linear_step(
            plays, courses, late.shape, rules, max(trust, 1e-3), earlier=0.1 * late.late + 1e-10
        )
        if step is None:
            break
        late = look(plays, player, _moved(late, step.change, rules))
    return late


def _mended(
    plays: Plays, player: Player, courses: Sequence[Course], here: Place, tried: Place, trust: float,
    rules: Rules, tried_merit: float, gain: float,
) -> tuple[Place, float]:  # fmt: skip
    """The same step once more, aimed earlier by what it came too late; and what it gains."""
    step = linear_step(plays, courses, here.shape, rules, trust, earlier=1.02 * tried.late)
    if step is None:
        return tried, gain
    again = look(plays, player, _moved(here, step.change, rules))
    more = tried_merit - _merit(again, plays, rules)
    return (again, gain + more) if more > 0.0 else (tried, gain)


def _courses(plays: Plays, player: Player, place: Place, rules: Rules) -> list[Course]:
    free = free_edges(place.shape, rules)
    return [
        plays.course(i, player, place.shape, free, rules.low, rules.high) for i in range(len(plays.drives))
    ]


def _merit(place: Place, plays: Plays, rules: Rules) -> float:
    return merit(place.peak, place.late, place.shape, plays.start_time, rules)


def _rank(place: Place, plays: Plays, rules: Rules) -> tuple[float, float]:
    """Less is better: in time first, then the merit."""
    return max(place.late, 0.0), _merit(place, plays, rules)


def _moved(place: Place, change: Vector, rules: Rules) -> Staircase:
    values = place.shape.unknowns + change
    n = place.shape.n_levels
    values[:n] = np.clip(values[:n], rules.low, rules.high)
    return place.shape.with_unknowns(values)
