"""Starts of one problem at every start time: a path from the shortest start up, and from a long one down.

Near the shortest start time there are many local optima, each with its own contacts. One descent from the
answer for the next start time keeps to those that it has: from above it keeps what is gentle, from below what
is quick. So the starts are found on a fixed ladder of start times, from the shortest start up and from an
easy long one down, and the better of both is kept. A start serves every longer time: K_dyn does not rise.
Where K_dyn is at most 1 one search from first demands has the optimum in all cases known, and is enough.

The shortest start is a descent on t_f. Its first demands are the quickest of many that switch between the
limits of the torque at random instants, by their exact starts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cached_property

import numpy as np

from softstart.optimal import seeds
from softstart.optimal.bounds import momentum_shortest_time
from softstart.optimal.descent import Descent, Found
from softstart.optimal.problem import Objective, Problem
from softstart.optimal.starts import DemandSimulator
from softstart.optimal.torque_speed import rigid_start_time
from softstart.profile import TorqueProfile

SAMPLES, FOLLOWED, FINISHED = (
    100,
    10,
    4,
)  # first demands of the shortest start: played, a few steps, to the end
ROUGHLY = 0.3  # what is missed, beside the time, in the order of first demands
FIRSTS = 3  # demands that a search begins with
LONGEST = 100.0  # times what the inertia alone takes: no longer start is looked for
CLOSE = 1.05  # latest time, by the shortest start found: there it is refined
RUNGS, SPREAD = 12, 0.005  # of the ladder: shortest time * (1 + spread * (2^k - 1))
ROUGH = 3e-4  # of K_dyn: how exactly the rungs are found
BEND = 1e-3  # of the largest torque: what is kept of the knots of a neighbour
TRIES = 1500  # knots in all starts around one, where one torque serves several machines
STRETCH, BUMPS, HEIGHT = 0.15, 10, 0.15  # of time; their number; of the highest torque
HOPEFUL = 1.03  # the merit up to which a start around is followed on
MET = 3e-6  # of a bound on K_dyn, that is left to it
EDGE = 1e-6  # of the start time: so much longer than the shortest start


class Path:
    """The starts of a problem at all start times; its own start time does not matter."""

    def __init__(self, problem: Problem, tell: Callable[[str], object] = lambda doing: None) -> None:
        self.problem, self.tell = problem, tell
        self.players = tuple(map(DemandSimulator, problem.machines))
        self.period = max(player.period for player in self.players)
        self._up: list[Found] = []
        self._down: dict[int, Found] = {}

    def descent(self, latest: float, objective: Objective | None = None) -> Descent:
        """The descents within a start time."""
        usual = "k_dyn" if self.problem.minimise == "start_time" else self.problem.minimise
        return Descent(self.problem, latest, objective or usual, self.players)

    # the shortest start ------------------------------------------------------------------------------------

    @cached_property
    def shortest(self) -> Found | None:
        """The shortest start that was found within the bounds of the problem, whatever else it has."""
        least = max(momentum_shortest_time(self.problem), rigid_start_time(self.problem))
        latest = 1.5 * least + 2.0 * self.period
        longest = LONGEST * (least + self.period)
        while latest < longest:
            found = self._shortest_within(latest)
            if found is not None:
                return found
            latest *= 2.0
        return None

    def _shortest_within(self, latest: float) -> Found | None:
        search = self.descent(latest, "start_time")
        full = search.play(search.onto(TorqueProfile([0.0], [search.high])))
        if full is None:
            return None
        span = min(1.2 * full.end, latest)
        firsts = [TorqueProfile([0.0], [search.high]), *seeds.switching(search, span, SAMPLES)]
        return self.quickest(search, firsts)

    def quickest(self, search: Descent, firsts: Iterable[TorqueProfile]) -> Found | None:
        """The shortest start by descents from the best of first demands."""
        played = [search.play(search.onto(one)) for one in firsts]
        near = sorted((one for one in played if one), key=lambda one: one.merit(ROUGHLY))[:FOLLOWED]
        after = [one for each in near if (one := search.step_down(each)) is not None]
        after.sort(key=Found.merit)
        ended = []
        for one in after[:FINISHED]:
            down = search.down(one)
            down = down and search.finished(down)
            ended += [down] if down and down.ends else []
        if not ended:
            return None
        best = min(ended, key=lambda one: one.end)
        finer = self.descent(min(search.latest, CLOSE * best.end), "start_time")
        again = finer.down(best.profile)
        again = again and finer.finished(finer.refined(again))
        return again if again and again.ends and again.end < best.end else best

    # one start time ----------------------------------------------------------------------------------------

    def searched(self, search: Descent) -> Found | None:
        """The best start by descents from first demands: closed forms and pulses."""
        firsts = seeds.pulse_coast_level(search)[:FIRSTS]
        formulas = [seeds.pulse_coast_hold(search, player) for player in search.players]
        firsts += [one for one in formulas if one is not None]
        after = [one for each in firsts if (one := search.step_down(search.play(search.onto(each))))]
        after.sort(key=Found.merit)
        ended = [down for one in after[:2] if (down := search.down(one, least=ROUGH)) and down.ends]
        return min(ended, key=Found.merit, default=None)

    def followed(self, search: Descent, *neighbours: Found | None) -> Found | None:
        """The best of one descent from the demand of each neighbour, as it is or scaled in time."""
        ended = []
        for one in neighbours:
            if one is None:
                continue
            known = one.profile.simplified(BEND)
            scaled = TorqueProfile(known.time * (search.latest / one.end), known.torque)
            played = [start for each in (known, scaled) if (start := search.play(search.onto(each)))]
            played.sort(key=Found.merit)
            for start in played:
                down = search.down(start, least=ROUGH)
                down = down and search.finished(down)
                if down is not None and down.ends:
                    ended.append(down)
                    break
        return min(ended, key=Found.merit, default=None)

    def easy(self, found: Found | None) -> bool:
        """Whether a start is one whose optimum a single search has."""
        if found is None or not found.ends:
            return False
        one = len(self.players) == 1
        return one and (self.problem.minimise == "heat" or found.peak <= self.problem.drive.mean_torque)

    def at(self, latest: float, near: TorqueProfile | None = None) -> Found | None:
        """The best start within a time, s; None if there is none. `near` is one more first demand."""
        search = self.descent(latest)
        ended = [] if near is None else [self._ended(search.down(near, least=ROUGH), search)]
        ended += [self.searched(search)] if len(self.players) == 1 else []
        if not any(self.easy(one) for one in ended):
            shortest = self.shortest
            if shortest is not None and shortest.end <= latest <= shortest.end * (1.0 + EDGE):
                return self.gentlest(shortest)
            if shortest is not None and shortest.end < latest:
                number = int(math.log2((latest / shortest.end - 1.0) / SPREAD + 1.0))
                below = self.rung(min(number, RUNGS - 1))
                ended.append(self.followed(search, below, self._down.get(number + 1)))
                ended.append(self._ended(search.play(search.onto(below.profile), below.end), search))
        best = min((one for one in ended if one), key=Found.merit, default=None)
        return None if best is None else self.first(search, self.polished(search, best))

    def _ended(self, found: Found | None, search: Descent) -> Found | None:
        found = found and search.finished(found)
        return found if found and found.ends else None

    def first(self, search: Descent, found: Found | None) -> Found | None:
        """The same, with the first end at which all loads have their speed, if only that is asked."""
        if found is None or self.problem.terminal != "reached":
            return found
        sooner = search.play(found.demand, search.first_end(found.starts))
        return sooner if sooner is not None and sooner.ends and sooner.end <= found.end else found

    def gentlest(self, shortest: Found) -> Found:
        """The gentlest start found in the time of the shortest one."""
        search = self.descent(shortest.end * (1.0 + EDGE))
        found = self._ended(search.down(shortest.profile, least=ROUGH), search)
        best = shortest if found is None or found.peak > shortest.peak else found
        return self.first(search, best) or best

    def quickest_within(self, k_dyn: float) -> tuple[Found | None, Found]:
        """The shortest start found with at most this K_dyn, and the last on the ladder that exceeds it."""
        most = k_dyn * self.problem.base_torque
        limited = replace(self.problem, minimise="start_time", start_time=None, k_dyn=k_dyn * (1.0 - MET))
        longest = LONGEST * self.period + 10.0 * self._time(0)
        for number in itertools.count(1):
            rung = self.rung(number)
            if rung.peak > most:
                if self._time(number) > longest:
                    break
                continue
            search = Descent(limited, self._time(number), "start_time", self.players)
            known = [rung, self._down.get(number), self.rung(number - 1), self._down.get(number - 1)]
            downs = [search.down(one.profile.simplified(BEND), least=ROUGH) for one in known if one]
            ended = [one for each in downs if (one := self._ended(each and search.refined(each), search))]
            kept = [one for one in ended if one.peak <= most]
            return min(kept, key=lambda one: one.end, default=rung), self.rung(number - 1)
        return None, rung

    def polished(self, search: Descent, found: Found) -> Found | None:
        """The same on finer grids, with the terminal condition met to rounding."""
        fine = search.finished(search.refined(found))
        rough = search.finished(found)
        ended = [one for one in (fine, rough) if one is not None and one.ends]
        return min(ended, key=Found.merit, default=None)

    # the ladder --------------------------------------------------------------------------------------------

    def rung(self, number: int) -> Found:
        """The better of both ways on a rung of the ladder, and all rungs below it."""
        assert self.shortest is not None
        if not self._up:
            self._climb(number)
        while len(self._up) <= number:  # a search is enough there
            last = self._up[-1]
            found = self.searched(self.descent(self._time(len(self._up))))
            self._up.append(self._better(len(self._up), last, found))
        return self._up[number]

    def _time(self, number: int) -> float:
        assert self.shortest is not None
        return self.shortest.end * (1.0 + SPREAD * (2.0**number - 1.0))

    def _better(self, number: int, *neighbours: Found | None) -> Found:
        """The best start on a rung, by its neighbours, the first of which serves it as it is."""
        found = self.followed(self.descent(self._time(number)), *neighbours)
        known = [one for one in (found, neighbours[0]) if one is not None]
        return min(known, key=lambda one: one.peak if self.problem.minimise != "heat" else one.heat)

    def _climb(self, number: int) -> None:
        """Up until a search is enough, down from there, and up again."""
        assert self.shortest is not None
        up = [self.shortest]
        while len(up) < RUNGS and not (len(up) > number + 1 and self._calm(up[-1])):
            self.tell(f"start time {self._time(len(up)):.4g} s")
            up.append(self._better(len(up), up[-1]))
        top = len(up) - 1
        search = self.descent(self._time(top))
        down = min(
            (one for one in (up[top], self._long_end(search, up[top])) if one), key=lambda one: one.peak
        )
        self._down = {top: down}
        for rung in range(top - 1, 0, -1):
            self.tell(f"start time {self._time(rung):.4g} s")
            found = self.followed(self.descent(self._time(rung)), down)
            if found is None:
                break
            self._down[rung] = down = found
        self._up = [self.shortest]
        for rung in range(1, top + 1):
            one, other = up[rung], self._down.get(rung)
            best = one if other is None or one.peak <= other.peak else other
            if self._up[-1].peak < up[rung - 1].peak:  # it came from above: what it leads to
                best = min(best, self._better(rung, self._up[-1]), key=lambda one: one.peak)
            self._up.append(best)

    def _calm(self, found: Found) -> bool:
        return found.peak <= self.problem.drive.mean_torque

    def _long_end(self, search: Descent, known: Found) -> Found | None:
        """The best start at a long time, where one torque serves several machines by a wider search."""
        found = self.searched(search)
        if len(self.players) == 1:
            return found
        ended = [one for one in (found, search.down(known.profile.simplified(BEND))) if one and one.ends]
        best = min(ended, key=Found.merit, default=None)
        return best and self.around(search, best)

    def around(self, search: Descent, found: Found) -> Found:
        """The best of local optima around one: its demand stretched in time, or with bumps, and down again.

        It begins at the best so far each time; the random numbers are the same each time.
        """
        rng = np.random.default_rng(1)
        tries = max(TRIES // search.even.size, 4)
        for number in range(tries):
            self.tell(f"start {number + 1} of {tries} around the best one")
            known = found.profile.simplified(BEND)
            if number % 2 == 0:
                demand = TorqueProfile(known.time * rng.uniform(1.0 - STRETCH, 1.0 + STRETCH), known.torque)
            else:
                time = np.union1d(known.time, search.even)
                bumps = rng.normal(0.0, HEIGHT * search.high, BUMPS)
                torque = known.at(time) + np.interp(time, np.linspace(0.0, search.until, BUMPS), bumps)
                demand = TorqueProfile(time, np.clip(torque, search.low, search.high))
            down = search.step_down(search.play(search.onto(demand)))
            if down is not None and down.merit() < HOPEFUL * found.merit():
                down = search.down(down, least=1e-3)
            if down is not None and down.ends and down.merit() < found.merit():
                found = down
        return found
