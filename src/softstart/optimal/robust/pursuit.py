"""The search for the gentlest start of all scenarios: from many rough starts down to the last edge of one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from softstart.drive import Drive
from softstart.optimal.result import InfeasibleError, OptimumError, Verdict
from softstart.optimal.robust.descent import Place, descend, look
from softstart.optimal.robust.families import MEMBERS as CELL_MEMBERS
from softstart.optimal.robust.families import Family
from softstart.optimal.robust.linear_step import Rules
from softstart.optimal.robust.plays import Plays
from softstart.optimal.robust.scenarios import differing, limits, reached
from softstart.optimal.robust.search import ROUNDS as LOOK_ROUNDS
from softstart.optimal.robust.search import Search, gentleness, quickness
from softstart.optimal.robust.shape import Player, Staircase, merged, refined
from softstart.profile import Vector

Progress = Callable[[str], None]

SEED = 0  # of everything random here: the same question has the same answer
LOOKS = ((3, 0), (4, 1))  # steps and seed of the searches over short staircases of any kind
QUICK_LOOKS = ((3, 0), (3, 1), (4, 0), (4, 1), (5, 0), (5, 1))
REPRESENTED = 3  # scenarios that the first rounds are over
DENSE, SPARSE = 12, 6  # intervals of an elastic period in the first rounds: in the first two periods, then
FIRST_ROUNDS = 8  # of the descent from each start
ALIKE = 3e-3  # relative: peaks on the way that count as one
PURSUED, FINISHED = 4, 1  # how many are followed to the end of the coarse grid, and on the fine one
COARSE, FINE = 40, 90  # intervals
ROUNDS = 80  # of each descent, at most
CALM, CALMER = 2e-5, 3e-4  # weights of the torque steps, on the way and where the peak may not rise
MERGED = 0.002  # of the torque range: neighbouring levels that become one
TIDY_COST = 2e-4  # relative, that a calmer profile of fewer knots may cost


class Pursuit:
    """The searches, one after the other, each from the best of those before."""

    def __init__(self, drives: Sequence[Drive], start_time: float, react: bool, say: Progress) -> None:
        self.drives, self.start_time, self.react, self.say = tuple(drives), start_time, react, say
        self.low, self.high = limits(drives)
        self.rules = Rules(self.low, self.high, calm=CALM, rounds=ROUNDS)
        self.plays = Plays(drives, start_time)

    def best(self) -> Place:
        """The gentlest place found that is in time; InfeasibleError if none is."""
        coarse = []
        for shape in self._pursued():
            coarse.append(descend(self.plays, shape, self.rules, 1e-4))
            self.say(f"coarse grid: peak {coarse[-1].peak:.3f} N m")
        fine = []
        for place in _different(coarse, ALIKE)[:FINISHED]:
            fine.append(descend(self.plays, self._refined(place.shape, FINE), self.rules, 1e-5))
            self.say(f"fine grid: peak {fine[-1].peak:.3f} N m")
        best = self._calmed(_different(fine)[0])
        if best.late > 0.0:
            raise OptimumError(
                f"robust optimum: a start within {self.start_time:g} s was found and lost again."
            )
        return best

    def _pursued(self) -> list[Staircase]:
        """Where to go on from: the best after a few rounds of each start, over differing scenarios."""
        quick = self._quick() if self._constant(self.plays).late > 0.0 else []
        plays = Plays(differing(self.drives, REPRESENTED), self.start_time)
        rules = replace(self.rules, calm=0.0, rounds=FIRST_ROUNDS)
        places = []
        for shape in [*self._starts(plays), *quick]:
            start = shape.cut(*[self._grid()] * 2)
            places.append(descend(plays, start, rules, 1e-4))
            self.say(f"first rounds: peak {places[-1].peak:.3f} N m")
        return [place.shape for place in _different(places, ALIKE)[:PURSUED]] + quick

    def _starts(self, plays: Plays) -> list[Staircase]:
        """Members of the family from all over, and the best short staircases of any kind."""
        starts = Family(plays, self.low, self.high, self.react).spread(SEED, CELL_MEMBERS)
        for steps, seed in LOOKS:
            search = Search(plays, steps, self.low, self.high, self.react)
            starts.append(search.best(gentleness(plays, self.high - self.low), SEED + seed, LOOK_ROUNDS)[1])
        return starts

    def _grid(self) -> Vector:
        """Edges for the first rounds: close together while the gaps close, then wider."""
        period = max(float(drive.elastic_period) for drive in self.drives)
        dense = min(2.0 * period, self.plays.horizon)
        rest = self.plays.horizon - dense
        count = min(max(math.ceil(rest / period * SPARSE), 2), COARSE)  # a stiff shaft has many periods
        early = np.linspace(0.0, dense, math.ceil(dense / period * DENSE) + 1)[:-1]
        return np.concatenate([early, np.linspace(dense, dense + rest, count + 1)[:-1]])

    def _calmed(self, fine: Place) -> Place:
        """As good with quieter torque, then with few levels whose edges move: the last that costs nothing."""
        floor = fine.peak * (1.0 + 0.1 * TIDY_COST)
        calm = descend(
            self.plays, fine.shape, replace(self.rules, calm=CALMER, floor=floor, rounds=ROUNDS // 2), 1e-5
        )
        few = merged(calm.shape, MERGED * (self.high - self.low))
        tidy = descend(self.plays, few, replace(self.rules, edges=True, calm=0.0), 1e-6)
        self.say(f"moving edges: peak {tidy.peak:.3f} N m")
        in_time = [place for place in (tidy, calm, fine) if place.late <= max(fine.late, 0.0)]
        least = min(place.peak for place in in_time)
        return next(place for place in in_time if place.peak <= least * (1.0 + TIDY_COST))

    def _constant(self, plays: Plays) -> Place:
        """The highest torque all the time."""
        shape = self._flat(self.high)
        return look(plays, Player(shape, self.drives[0]), shape)

    def _flat(self, torque: float) -> Staircase:
        level = np.array([torque, torque])
        edges = np.array([0.0, 0.5 * self.start_time])
        return Staircase(edges, level, Staircase(edges, level) if self.react else None)

    def _quick(self) -> list[Staircase]:
        """A start in time, as the constant torque is none; InfeasibleError if none is found."""
        patient = Plays(self.drives, 100.0 * self.start_time)
        constant = self._constant(patient)
        latest = constant.late + patient.start_time
        plays = Plays(self.drives, latest)
        rules = replace(self.rules, aim="quick", calm=0.0)
        places = [descend(plays, self._refined(self._flat(self.high), COARSE), rules)]
        for steps, seed in QUICK_LOOKS:
            search = Search(plays, steps, self.low, self.high, self.react)
            shape = search.best(quickness(plays), seed, LOOK_ROUNDS)[1]
            places.append(descend(plays, refined(shape, plays.horizon, COARSE), rules))
        best = min(places, key=lambda place: place.late)
        best = descend(plays, refined(best.shape, plays.horizon, FINE), rules)
        self.say(f"quickest start found: {best.late + latest:.6f} s")
        if best.late + latest > self.start_time:
            raise InfeasibleError(self._verdict(plays, best))
        return [best.shape]

    def _verdict(self, plays: Plays, quickest: Place) -> Verdict:
        player = Player(quickest.shape, self.drives[0])
        late = plays.lateness(plays.figures(player, quickest.shape.unknowns))[0]
        slowest = self.drives[int(np.argmax(late))]
        shortest = (quickest.late + plays.start_time) * (1.0 + 1e-6)
        who = (
            f"gap {slowest.gap:g} rad, load inertia {slowest.J2:g} kg m2, load torque {slowest.Mc:g} N m"
            f"{f' ({slowest.name})' if slowest.name else ''}"
        )
        sentence = (
            f"start_time = {self.start_time:g} s is too short for one profile over {len(self.drives)} "
            f"scenario{'s' if len(self.drives) > 1 else ''}: the shortest found is {shortest:.6g} s, and "
            f"the slowest scenario is the one with {who}; the torque limit is {self.high:g} N m."
        )
        return Verdict(reached(slowest, self.start_time, None), shortest, "torque limit", sentence)

    def _refined(self, shape: Staircase, intervals: int) -> Staircase:
        return refined(shape, self.plays.horizon, intervals)


def _different(places: Sequence[Place], alike: float = 5e-4) -> list[Place]:
    """The places in order, best first, without those that are as good as one before."""
    ordered = sorted(places, key=lambda place: (max(place.late, 0.0), place.peak))
    kept: list[Place] = []
    for place in ordered:
        if all(abs(place.peak - other.peak) > alike * other.peak for other in kept):
            kept.append(place)
    return kept
