"""Starts of one problem at every start time: a path from the shortest start up, and from a long one down.

Near the shortest start time there are many local optima, each with its own contacts. One descent from the
answer for the next start time keeps to those that it has: from above it keeps what is gentle, from below what
is quick. So starts are found on the way from an easy long one down and from the shortest one up, always at
the same times, and the better of both is kept, as a start serves every longer time. On the way K_dyn does
not rise; an answer beside it is a descent of its own. Where K_dyn is at most 1 one search is enough.

The shortest start is a descent on t_f. Its first demands are the quickest of many that switch between the
limits of the torque at random instants, by their exact starts; under a torque-speed curve also the largest
torque of a rigid drive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import chain
from typing import NamedTuple

import numpy as np

from softstart.optimal import seeds
from softstart.optimal.bounds import momentum_shortest_time
from softstart.optimal.descent import Descent
from softstart.optimal.problem import Objective, Problem
from softstart.optimal.search import Found
from softstart.optimal.starts import DemandSimulator
from softstart.optimal.torque_speed import RigidStart, rigid_start_time
from softstart.profile import TorqueProfile

SAMPLES, TASTED, FINISHED = 100, 10, 4  # first demands: played, tasted in each order, followed to the end
HOPELESS = 0.1  # share of a target speed that is missed: under full torque by all masses, or after a taste
ORDERS = 0.3, 2.0, 12.0  # what is missed, beside the time, in the orders of first demands
FIRSTS, MORE = 3, 9  # pulses that a search begins with; with the others, where these lead to no easy start
LONGEST = 100.0  # times what the inertia alone takes: no longer start is looked for
CLOSE = 1.05  # latest time, by the shortest start found: there it is refined
RUNGS, SPREAD = 9, 0.005  # of the way up: at the shortest time * (1 + spread * (2^k - 1))
DAMPED = 0.05, 0.02, 0.008, 0.003, 0.001  # damping ratios through which an undamped chain is approached
LONG = 1.0, 1.4, 2.0, 3.0  # times a usual start: where an easy one is looked for
WIDE, NARROW, RISE = 0.1, 2e-3, 0.08  # of the start time: steps down; the rise of K_dyn that is aimed at
MOST_RISE, LEAST = 0.2, 4e-3  # of K_dyn, above which a step is taken again shorter; the shortest that is
LEFT = 3  # nodes at which the way down is better in succession: then the way up is left
NEIGHBOURS = 2  # nodes on each side of a start time, that are followed to it
BEST, ALIKE = 3, 1.01  # starts that are refined, if they are so near to the best one
MILD = 1.15  # K_dyn up to which the way down is enough
FOLLOWS, DEAR = 30, 2e3  # steps from a neighbour, and the penalty up to which they are tried again
ROUGH = 1e-3  # of K_dyn: how exactly the rungs are found
FARTHER = 0.1  # of the latest start time of the nodes: steps up, where none of them is easy
BEND = 1e-3  # of the largest torque: what is kept of the knots of a neighbour
TRIES = 800  # knots in all starts around one, where one torque serves several machines
STRETCH, BUMPS, HEIGHT = 0.15, 10, 0.15  # of time; their number; of the highest torque
HOPEFUL = 1.03  # the merit up to which a start around is followed on
MET = 3e-6  # of a bound on K_dyn, that is left to it
EDGE = 1e-6  # of the start time: so much longer than the shortest start


class Node(NamedTuple):
    """A start that is known within a time, s."""

    latest: float
    found: Found


class Path:
    """The starts of a problem at all start times; its own start time does not matter."""

    def __init__(self, problem: Problem, tell: Callable[[str], object] = lambda doing: None) -> None:
        self.problem, self.tell = problem, tell
        self.players = tuple(map(DemandSimulator, problem.machines))
        self.period = max(player.period for player in self.players)

    def descent(self, latest: float, objective: Objective | None = None) -> Descent:
        """The descents within a start time."""
        usual = "k_dyn" if self.problem.minimise == "start_time" else self.problem.minimise
        return Descent(self.problem, latest, objective or usual, self.players)

    # the shortest start ------------------------------------------------------------------------------------

    @cached_property
    def shortest(self) -> Found | None:
        """The shortest start that was found within the bounds of the problem, whatever else it has."""
        found = [self._quickest]
        if self._gentle:
            last = self._gentle[-1]
            search = self.descent(last.latest, "start_time")
            found += [last.found, self._ended(search.down(last.found.profile, least=ROUGH), search)]
        best = min((one for one in found if one), key=lambda one: one.end, default=None)
        return None if best is None else self.first(self.descent(best.end), best)

    @cached_property
    def _quickest(self) -> Found | None:
        """The shortest start by descents on t_f."""
        least = max(momentum_shortest_time(self.problem), rigid_start_time(self.problem))
        latest = 1.5 * least + 2.0 * self.period
        longest = 2.0 * self._gentle[-1].latest if self._gentle else LONGEST * (least + self.period)
        found = None
        while found is None and latest < 2.0 * longest:
            found = self._shortest_within(min(latest, longest))
            latest *= 2.0
        return found

    def _shortest_within(self, latest: float) -> Found | None:
        search = self.descent(latest, "start_time")
        full = search.play(search.onto(TorqueProfile([0.0], [search.high])))
        if full is None or full.missing.min() > HOPELESS:
            return None
        span = min(max(1.2 * full.end, 0.6 * latest), latest)
        switching = [TorqueProfile([0.0], [search.high]), *seeds.switching(search, span, SAMPLES)]
        if curve := self.problem.torque_speed:
            switching += [one for each in self.problem.machines if (one := RigidStart(each, curve).torque)]
        return self.quickest(search, switching, () if self._gentle else self.gentle_firsts(search)[0])

    def quickest(
        self, search: Descent, many: Sequence[TorqueProfile], more: Iterable[TorqueProfile]
    ) -> Found | None:
        """The shortest start by descents from the best of many first demands, and from more."""
        tasting = [search]
        if self.problem.terminal == "steady":  # the torque that is asked for at the end may mislead at first
            easier = replace(self.problem, terminal="synchronous")
            tasting.append(Descent(easier, search.latest, "start_time", self.players))
        firsts = [one for each in tasting for one in self._tasted(each, many)]
        downs = (search.down(search.play(one.demand, one.end)) for one in firsts)
        ended = [one for each in downs if (one := self._ended(each, search))]
        if not ended:
            ended = [one for each in more if (one := self._ended(search.down(each), search))]
        if not ended:
            return None
        best = min(ended, key=lambda one: one.end)
        finer = self.descent(min(search.latest, CLOSE * best.end), "start_time")
        again = finer.down(best.profile)
        again = again and finer.finished(finer.refined(again))
        return again if again and again.ends and again.end < best.end else best

    def _tasted(self, search: Descent, many: Sequence[TorqueProfile]) -> list[Found]:
        """What the best of first demands lead to after a few steps, by the time and by what they miss."""
        near = [one for each in many if (one := search.play(search.onto(each)))]
        tasted = dict[float, Found]()  # by their ends: many lead to the same start
        for roughly in ORDERS:
            near.sort(key=partial(Found.merit, penalty=roughly))
            for each in near[:TASTED]:
                one = search.step_down(each)
                if one is not None and one.missed < HOPELESS:
                    tasted[round(one.end / search.latest, 6)] = one
            del near[:TASTED]
        return sorted(tasted.values(), key=Found.merit)[:FINISHED]

    # one start time ----------------------------------------------------------------------------------------

    def searched(self, search: Descent) -> Found | None:
        """The best start by descents from first demands: closed forms and pulses."""
        first, later = self.gentle_firsts(search)
        damped = self._damped(search)
        first += [] if damped is None else [damped]
        best: Found | None = None
        most, least = (3, 0.1 * ROUGH) if self.problem.minimise == "heat" else (2, ROUGH)
        for several in (first, later):
            after = [one for each in several if (one := search.step_down(search.play(search.onto(each))))]
            after.sort(key=Found.merit)
            downs = [search.down(one, least=least) for one in after[:most]]
            ended = [one for one in downs if one is not None and one.near]
            best = min([*ended, *([best] if best else [])], key=Found.merit, default=None)
            if self.easy(best):
                break
        return best

    def _damped(self, search: Descent) -> TorqueProfile | None:
        """For an undamped chain the answer with a little damping, which leads to a better one."""
        one, problem = self.players[0], self.problem
        if len(self.players) > 1 or one.joints < 2 or one.d.any():
            return None
        known = next(iter(self.gentle_firsts(search)[0]), None)
        for ratio in DAMPED:
            drive = problem.drive.with_damping_ratio(ratio)
            damped = Descent(replace(problem, drive=drive, base=problem.base or problem.drive), search.latest)
            found = None if known is None else damped.down(known, least=ROUGH)
            known = known if found is None else found.profile.simplified(BEND)
        return known

    def gentle_firsts(self, search: Descent) -> tuple[list[TorqueProfile], list[TorqueProfile]]:
        """First demands of gentle starts, closed forms and pulses: the best, and others."""
        formulas = [seeds.pulse_coast_hold(search, player) for player in search.players]
        pulses = seeds.pulse_coast_level(search)
        first, later = [*pulses[:FIRSTS], *[one for one in formulas if one is not None]], pulses[FIRSTS:MORE]
        if self.problem.minimise == "heat":  # the least one is near the constant torque of the same time
            return [*seeds.constant(search), *first, *later], []
        return first, later

    def followed(self, search: Descent, *neighbours: Found | None) -> Found | None:
        """The best of one descent from the demand of each neighbour, as it is or scaled in time."""
        ended = [next(self._ways(search, one), None) for one in neighbours if one is not None]
        return min((one for one in ended if one), key=Found.merit, default=None)

    def _ways(self, search: Descent, neighbour: Found) -> Iterator[Found]:
        """Starts by descents from its demand as it is and scaled in time, the one that seems nearer first."""
        known = neighbour.profile.simplified(BEND)
        scaled = TorqueProfile(known.time * (search.latest / neighbour.end), known.torque)
        played = [start for each in (known, scaled) if (start := search.play(search.onto(each)))]
        for start in sorted(played, key=Found.merit):
            down = self._ended(search.down(start, FOLLOWS, ROUGH, DEAR), search)
            if down is not None:
                yield down

    def easy(self, found: Found | None) -> bool:
        """Whether a start is one whose optimum a single search has."""
        if found is None or not found.near:
            return False
        return self.problem.minimise == "heat" or self._calm(found)

    def at(self, latest: float, near: TorqueProfile | None = None) -> Found | None:
        """The best start within a time, s; None if there is none. `near` is one more first demand."""
        search = self.descent(latest)
        ended = [] if near is None else [self._ended(search.down(near, least=ROUGH), search)]
        ended += [self._widened(search, self.searched(search))]
        found = self._polished(search, ended) if any(map(self.easy, ended)) else None
        if found is None:
            nodes = self._gentle
            gentle = next((one.found for one in nodes if one.latest <= latest), None)
            mild = MILD * float(self.problem.drive.mean_torque)
            if gentle is None or len(self.players) > 1 or gentle.peak > mild:
                nodes = self._nodes
            if self.shortest is not None and self.shortest.end <= latest <= self.shortest.end * (1.0 + EDGE):
                return self.gentlest(self.shortest, latest)
            while nodes and latest > (1.0 + FARTHER) * nodes[0].latest:
                farther, known = (1.0 + FARTHER) * nodes[0].latest, nodes[0].found
                beyond = self.descent(farther)
                found = self.followed(beyond, known)
                nodes.insert(0, Node(farther, min((one for one in (found, known) if one), key=self._figure)))
            below = [one.found for one in nodes if one.latest <= latest][:NEIGHBOURS]
            above = [one.found for one in nodes if one.latest > latest][-NEIGHBOURS:]
            led_to = chain.from_iterable(self._ways(search, one) for one in (*below, *above))
            in_time = [one.found for one in nodes if one.found.end <= latest]
            best = min(in_time, key=self._figure, default=None)
            found = self._polished(search, [*ended, *led_to, best])
        return None if found is None else self.first(search, found)

    def _polished(self, search: Descent, ended: Sequence[Found | None]) -> Found | None:
        """The best start, from the best ones on finer grids."""
        found: Found | None = None
        best = sorted((one for one in ended if one), key=self._figure)
        for one in best[:BEST]:
            if found is None or self._figure(one) < ALIKE * self._figure(found):
                start = search.play(one.demand, one.end)
                fine = [self._ended(start and search.refined(start), search), self._ended(start, search)]
                found = min((each for each in (found, *fine) if each), key=self._figure, default=None)
        return found

    def _ended(self, found: Found | None, search: Descent) -> Found | None:
        found = found and search.finished(found)
        return found if found and found.ends else None

    def first(self, search: Descent, found: Found | None) -> Found | None:
        """The same, with the first end at which all loads have their speed, if only that is asked."""
        if found is None or self.problem.terminal != "reached":
            return found
        sooner = search.play(found.demand, search.first_end(found.starts))
        return sooner if sooner is not None and sooner.ends and sooner.end <= found.end else found

    def gentlest(self, shortest: Found, latest: float) -> Found:
        """The gentlest start found in the time of the shortest one, or a little more."""
        search = self.descent(latest)
        found = self._ended(search.down(shortest.profile, least=ROUGH), search)
        best = shortest if found is None or found.peak > shortest.peak else found
        return self.first(search, best) or best

    def quickest_within(self, k_dyn: float) -> tuple[Found | None, Found]:
        """The shortest start found with at most this K_dyn, and the last on the ladder that exceeds it."""
        most = k_dyn * self.problem.base_torque
        limited = replace(self.problem, minimise="start_time", start_time=None, k_dyn=k_dyn * (1.0 - MET))
        nodes = self._nodes
        first = next((k for k in reversed(range(len(nodes))) if nodes[k].found.peak <= most), None)
        if first is None:
            return None, min((one.found for one in nodes), key=lambda one: one.peak)
        quicker = nodes[min(first + 1, len(nodes) - 1)].found
        search = Descent(limited, nodes[first].latest, "start_time", self.players)
        known = [nodes[first].found, quicker]
        downs = [search.down(one.profile.simplified(BEND), least=ROUGH) for one in known]
        ended = [one for each in downs if (one := self._ended(each and search.refined(each), search))]
        kept = [one for one in ended if one.peak <= most]
        return min(kept, key=lambda one: one.end, default=nodes[first].found), quicker

    # nodes: the starts known at other times -----------------------------------------------------------------

    @cached_property
    def _gentle(self) -> list[Node]:
        """From an easy long start down in time, until none follows; long times first."""
        least = max(momentum_shortest_time(self.problem), rigid_start_time(self.problem))
        first = None
        for share in LONG:
            latest = share * (1.5 * least + 2.0 * self.period)
            found = self.searched(self.descent(latest))
            first = Node(latest, found) if found is not None and first is None else first
            if found is not None and self._calm(found):
                first = Node(latest, found)
                break
        if first is None:
            return []
        wide = self._widened(self.descent(first.latest), first.found)
        nodes, step = [Node(first.latest, wide or first.found)], WIDE
        while step > NARROW:
            latest, last = nodes[-1].latest * (1.0 - step), nodes[-1].found
            self.tell(f"start time {latest:.4g} s")
            search = self.descent(latest)
            found = self.followed(search, last) or self.followed(search, *[one.found for one in nodes[-2:-1]])
            rise = math.inf if found is None else math.log(self._figure(found) / self._figure(last))
            if found is None or (rise > MOST_RISE and step > LEAST):
                step *= 0.3
                continue
            nodes.append(Node(latest, found))
            rise = max(rise, 1e-9)
            step = min(step * min(max(RISE / rise, 0.5), 2.0), WIDE)
        return nodes

    @cached_property
    def _nodes(self) -> list[Node]:
        """Also from the shortest start up, the better of both at each time; long times first."""
        gentle = self._gentle
        if self.shortest is None:
            return gentle
        begin = self.shortest.end
        ladder = [begin * (1.0 + SPREAD * (2.0**k - 1.0)) for k in range(1, RUNGS)]
        until = gentle[-1].latest if gentle else math.inf
        times = sorted([*[t for t in ladder if t < until * 0.999], *[one.latest for one in gentle]])
        known = {one.latest: one.found for one in gentle}
        nodes, worse = [Node(begin, self.shortest)], 0
        for latest in times:
            if latest < begin:
                continue
            last, own = nodes[-1].found, known.get(latest)
            found = None
            if worse < LEFT:  # the quick starts have been the harder ones for so long
                self.tell(f"start time {latest:.4g} s")
                found = self.followed(self.descent(latest), last)
            best = min((one for one in (found, own, last) if one), key=self._figure)
            worse = worse + 1 if best is own else 0
            nodes.append(Node(latest, best))
        return nodes[::-1]

    def _figure(self, found: Found) -> float:
        return found.heat if self.problem.minimise == "heat" else found.peak

    def _calm(self, found: Found) -> bool:
        return found.peak <= self.problem.drive.mean_torque

    def _widened(self, search: Descent, found: Found | None) -> Found | None:
        """The same, or a better one by a wider search where one torque serves several machines."""
        return found if found is None or len(self.players) == 1 else self.around(search, found)

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
            if down is not None and down.near and down.merit() < found.merit():
                found = down
        return found
