"""From a first demand down to a local optimum: successive linear programs on the exact start.

For a demand (`demand.Demand`) the exact start of each machine gives the torques T_k(t) of all its shafts, the
state at the end t_f, and how they answer to the unknowns of the demand, exactly and through all contacts
(`softstart.kernel.sensitivity`). The program of the best step (`model.Model`) has a trust region; the step is
run exactly, and what counts is the merit of that start: its objective with its located peak plus a penalty
times what it misses. The terminal condition is curved, and long steps along its tangent would all be refused
(Maratos effect): one that would be refused and misses it is corrected first, by the smallest changes that
lead to it (second-order correction; R. Fletcher, Practical Methods of Optimization, 1987, 14.4). The trust
region follows how far the program was right. Where the terminal condition stays missed, that costs ten times
as much, and so on.

Objectives are K_dyn, the heat, or the start time: the shortest start is a descent like the others.

Knots: even ones and those of the first demand. Where the torque of an answer passes between two levels within
few knots it becomes a step, whose instant is an unknown; intervals beside other bends are halved. Last, the
smallest changes that meet the terminal condition to rounding (Newton).

Successive linear programming: R. Fletcher, E. Sainz de la Maza, Math. Prog. 43 (1989) 235-256.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.errors import SimulationError
from softstart.optimal.demand import Demand
from softstart.optimal.model import BETWEEN, CALM, LET_THROUGH, Model
from softstart.optimal.problem import Objective, Problem
from softstart.optimal.starts import DemandRun, DemandSimulator, steady_shaft_torques, wanted
from softstart.profile import TorqueProfile

KNOTS, MOST_KNOTS = 14, 160  # even ones, in an elastic period and in all
APART = 0.4  # of their distance, which they keep from knots that are known, so that these do not add up
INSTANTS = 32  # of the fastest period, at which torques are limited
PENALTY, DEAREST = 200.0, 1e5  # of what is missed, as shares, beside the objective as a share
FIRST_TRUST, MOST_TRUST, LEAST_TRUST = 0.1, 0.5, 1e-4  # of the highest torque
STEPS, TASTE = 60, 12
ENDS = 257  # instants among which the end of a first demand is looked for
GOOD, POOR, ACCEPTED = 0.7, 0.3, 0.05  # share of the promised decrease that came true
REFUSED = 0.3  # by what a step that is refused narrows the trust region
MISSED, MET = 1e-5, 1e-8  # share by which a condition is missed: near to it, and kept
CORRECTED = 2  # Newton steps towards the terminal condition, before a step that misses it is refused
NARROW = 3e-3  # trust from which on tangent planes are as good as their square
IN_LAG = 0.04  # of a torque lag, between instants at which a curve limits the torque
JUMP, HALVED = 0.04, 32  # bend of the torque, in highest torques, beside which intervals are halved; so many
STALLED = 3e-4  # of the merit: a gain on a finer grid after which a descent goes on
SWITCH, LEVEL = 0.25, 0.02  # change of the torque, in highest torques, that becomes a step between two levels


@dataclass(frozen=True, eq=False)
class Found:
    """A demand, the exact starts under it, and how good they are."""

    demand: Demand
    end: float  # t_f, s
    starts: tuple[DemandRun, ...]
    peak: float  # of all shafts, machines and instants, N m
    missing: Vector  # what the terminal quantities of all machines lack, as shares; below 0 a surplus
    lacking: Vector  # the same as far as it counts
    beyond: float  # above the torque-speed curve, as a share of the highest torque
    over: float  # above the bounds on K_dyn and heat, as a share of them
    heat: float  # s
    objective: float  # as a share of its scale

    def merit(self, penalty: float = PENALTY) -> float:
        """The objective, and what missing a condition costs."""
        return self.objective + penalty * (float(self.lacking.sum()) + self.beyond + self.over)

    @property
    def missed(self) -> float:
        """The largest share by which a condition is missed."""
        return max(float(self.lacking.max(initial=0.0)), self.beyond, 0.02 * self.over)

    @property
    def ends(self) -> bool:
        """Whether it is a start that keeps all conditions."""
        return self.missed <= MET

    @property
    def near(self) -> bool:
        """Whether it misses its conditions by no more than the smallest changes mend."""
        return self.missed <= MISSED

    @cached_property
    def profile(self) -> TorqueProfile:
        """The torque over time, with as few knots as it needs."""
        return TorqueProfile(self.demand.time, self.demand.torque).simplified()


class Descent:
    """What the descents of one problem share: the latest t_f, s, and the objective."""

    def __init__(
        self, problem: Problem, latest: float, objective: Objective | None = None,
        players: Sequence[DemandSimulator] = (),
    ) -> None:  # fmt: skip
        self.problem, self.latest, self.objective = problem, latest, objective or problem.minimise
        self.players = tuple(players or map(DemandSimulator, problem.machines))
        self.period = max(player.period for player in self.players)
        self.until = self.latest + self.period
        self.low, self.high, self.base = problem.lowest_torque, problem.highest_torque, problem.base_torque
        machines = [player.rows.machine for player in self.players]
        self.rate = min(float(one.rate) for one in machines)
        self.initial = float(machines[0].initial_torque)
        fastest = min(player.fastest for player in self.players)
        self.step = min(fastest / INSTANTS, self.latest / 24)  # of instants at which T is limited
        lags = [float(one.lag) for one in machines if one.lag > 0.0]
        self.curve_step = max(min([0.15 * self.step, *(IN_LAG * lag for lag in lags)]), 2e-5 * self.latest)
        self.starts_at_initial = math.isfinite(self.rate) or problem.smoothness > 0.0
        # the instants of steps: unknown where nothing depends on the torque at an instant itself
        self.heats = self.objective == "heat" or problem.heat is not None
        self.switches = not (self.starts_at_initial or self.heats or problem.torque_speed)
        stiff = self.players[0].mean_torque(self.latest) / problem.starting_torque
        scales = {"k_dyn": self.base, "heat": stiff * stiff * self.latest, "start_time": self.latest}
        self.scale = scales[self.objective]
        count = min(max(math.ceil(KNOTS * self.until / self.period), 24), MOST_KNOTS)
        self.even = np.linspace(0.0, self.until, count + 1)

    # demands -----------------------------------------------------------------------------------------------

    def onto(self, profile: TorqueProfile, apart: float = APART) -> Demand:
        """A demand on its own knots and the even ones that are not near to them, within the limits."""
        keep = profile.time < self.until
        when = profile.time[keep]
        far = np.abs(self.even[:, None] - when).min(axis=1, initial=math.inf) > apart * self.even[1]
        far[-1] = True
        far[0] = when.size == 0 or when[0] > 0.0
        new = self.even[far]
        if self.starts_at_initial:  # no steps
            time = np.unique(np.concatenate([new, when]))
            torque = profile.at(time)
        else:
            time = np.concatenate([when, new])
            order = np.argsort(time, kind="stable")
            time, torque = time[order], np.concatenate([profile.torque[keep], profile.at(new)])[order]
        return self.demand(time, torque)

    def demand(self, time: Vector, torque: Vector) -> Demand:
        """A demand on these knots, with steps where their instants are unknown."""
        made = self.allowed(Demand(time, torque, self.high, float(self.even[1])))
        return made.with_steps() if self.switches else made

    def allowed(self, demand: Demand) -> Demand:
        """The same within the limits of torque and rate."""
        u = np.clip(demand.torque, self.low, self.high)
        if self.starts_at_initial:
            u[0] = min(max(self.initial, self.low), self.high)
        if math.isfinite(self.rate):
            for i, rise in enumerate(self.rate * np.diff(demand.time)):
                u[i + 1] = np.clip(u[i + 1], u[i] - rise, u[i] + rise)
        return replace(demand, torque=u)

    # starts ------------------------------------------------------------------------------------------------

    def play(self, demand: Demand, end: float | None = None) -> Found | None:
        """The exact starts under a demand that end at `end`; None if one cannot be finished.

        Without an end it is the first instant at which all loads have their speed, if only that is asked.
        """
        profile, weights = demand.played
        asked = self.latest if end is None else end
        try:
            starts = tuple(one.play(profile, asked + one.period, weights) for one in self.players)
            if end is None and (self.objective == "start_time" or self.problem.terminal == "reached"):
                return self.play(demand, self.first_end(starts))
        except SimulationError:
            return None
        end, problem = asked, self.problem
        peak = max(one.peak for one in starts)
        pairs = list(zip(self.players, starts, strict=True))
        missing = np.concatenate([self._missing(*pair, end) for pair in pairs])
        beyond = max(0.0, *(self._beyond(*pair) for pair in pairs)) if problem.torque_speed else 0.0
        heat = 0.0
        if self.heats:
            times, shares = starts[0].quadrature(end)
            u = starts[0].trajectory.at(times)["u"] / problem.starting_torque
            heat = float(shares @ (u * u))
        objective = {"k_dyn": peak, "heat": heat, "start_time": end}[self.objective] / self.scale
        objective += self._roughness(demand)
        lacking = np.maximum(missing, 0.0) if problem.terminal == "reached" else np.abs(missing)
        over = max(peak / (problem.k_dyn * self.base) - 1.0, 0.0) if problem.k_dyn else 0.0
        over += max(heat / problem.heat - 1.0, 0.0) if problem.heat else 0.0
        return Found(demand, end, starts, peak, missing, lacking, beyond, over, heat, objective)

    def first_end(self, starts: Sequence[DemandRun]) -> float:
        """The first instant at which all loads, or all masses as one, have the target speed, s.

        Without one until the latest, that at which they come nearest to it.
        """
        times = np.linspace(0.0, self.latest, ENDS)
        weights = [one.J * np.isfinite(one.J) for one in self.players]
        if self.problem.terminal == "reached":
            weights = [np.eye(one.J.size)[one.load] for one in self.players]

        def lack(when: Vector) -> Vector:
            every = [
                1.0 - one.trajectory.at(when)["w"] @ by / (by.sum() * at.target)
                for at, one, by in zip(self.players, starts, weights, strict=True)
            ]
            return np.max(every, axis=0) - 1e-12

        lacking = lack(times)
        there = np.flatnonzero(lacking <= 0.0)
        if not there.size:
            return float(times[ENDS // 2 + np.argmin(lacking[ENDS // 2 :])])
        before, after = float(times[max(there[0] - 1, 0)]), float(times[there[0]])
        if before == after:
            return after
        from scipy.optimize import brentq

        # the later end of what is left of the bracket
        at = float(
            brentq(lambda t: float(lack(np.array([t]))[0]), before, after, xtol=1e-15 * after, rtol=1e-15)
        )
        return at if lack(np.array([at]))[0] <= 0.0 else min(at * (1.0 + 4e-15), after)

    def _missing(self, player: DemandSimulator, start: DemandRun, end: float) -> Vector:
        state = start.trajectory.at([end])
        lacking: Vector = 1.0 - state["w"][0] / player.target
        if self.problem.terminal == "reached":
            return lacking[[player.load]]
        if self.problem.terminal == "steady":
            own = steady_shaft_torques(player.rows)
            T, aim = state["T"][0], wanted(own, self.base, player.motor)
            open_too = (T == 0.0) & (np.abs(own) < np.abs(aim))  # flanks apart carry nothing either
            lacking = np.concatenate([lacking, np.where(open_too, 0.0, aim - T) / self.base])
        return lacking

    def terminal_rows(self, found: Found, answers: Sequence[Matrix] = ()) -> tuple[Matrix, Vector]:
        """By how much each terminal quantity rises, as a share, with each unknown, and with t_f.

        `answers` are the derivatives of the state of each machine at t_f, if they are known.
        """
        rows, rates, end = [], [], found.end
        answers = answers or [start.by_demand((), [end])[1][0] for start in found.starts]
        for player, start, answer in zip(self.players, found.starts, answers, strict=True):
            joints, beside = player.joints, 1e-5 * player.period
            at = start.trajectory.at([end - beside, end, end + beside])
            w = answer[joints:-1] / player.target
            rate = (at["w"][2] - at["w"][0]) / (2.0 * beside * player.target)
            if self.problem.terminal == "reached":
                w, rate = w[[player.load]], rate[[player.load]]
            if self.problem.terminal == "steady":
                closed = (at["T"][1] != 0.0).astype(float)
                w = np.vstack([w, player.twisting(closed, answer) / self.base])
                rate = np.concatenate([rate, (at["T"][2] - at["T"][0]) / (2.0 * beside * self.base)])
            rows.append(w)
            rates.append(rate)
        return np.vstack(rows), np.concatenate(rates)

    def _beyond(self, player: DemandSimulator, start: DemandRun) -> float:
        """By how much the realised torque exceeds the curve at worst, as a share of the highest torque."""
        times = start.instants(self.curve_step)
        state = start.trajectory.at(times)
        return max(float(self.above(state["u"], state["w"][:, player.motor]).max()), 0.0)

    def above(self, u: Vector, w: Vector) -> Vector:
        """By how much motor torques lie above the curve at these speeds, as shares of the highest torque."""
        lines = self.lines()
        found: Vector = (u - (lines[:, :1] + lines[:, 1:] * w).min(axis=0)) / self.high + BETWEEN
        return found

    def lines(self) -> Matrix:
        """The torque-speed curve as straight lines a + b w: rows (a, b)."""
        corners = np.array(self.problem.torque_speed)
        slope = np.diff(corners[:, 1]) / np.diff(corners[:, 0])
        return np.column_stack([corners[:-1, 1] - slope * corners[:-1, 0], slope])

    def _roughness(self, demand: Demand) -> float:
        rise = np.diff(demand.torque)
        calm = CALM * float(np.abs(rise).sum()) / self.high
        if self.problem.smoothness == 0.0:
            return calm
        step = rise / self.problem.starting_torque
        return calm + self.problem.smoothness * float((step * step / np.diff(demand.time)).sum())

    # descents ----------------------------------------------------------------------------------------------

    def down(
        self,
        first: TorqueProfile | Found | None,
        steps: int = STEPS,
        least: float = 1e-4,
        dear: float = DEAREST,
    ) -> Found | None:
        """Down from a first demand, until a program promises less than the share `least`.

        Where a condition is missed after all steps, missing it costs more, up to `dear`.
        """
        found = self.play(self.onto(first)) if isinstance(first, TorqueProfile) else first
        penalty = PENALTY
        found = self._down(found, steps, least, penalty)
        while found is not None and not found.near and penalty < dear:
            penalty *= 10.0
            found = self._down(found, steps, least, penalty)
        return found

    def step_down(self, found: Found | None) -> Found | None:
        """A few steps down, to see where a first demand leads."""
        return self._down(found, TASTE, 1e-3, PENALTY)

    def _down(self, found: Found | None, steps: int, least: float, penalty: float) -> Found | None:
        trust = FIRST_TRUST
        for _ in range(steps):
            if found is None:
                return None
            model, merit = Model(self, found), found.merit(penalty)
            better = None
            while better is None:
                if trust < LEAST_TRUST:
                    return found
                step = model.step(trust, penalty, LET_THROUGH * least)
                if step is None:
                    trust *= REFUSED
                    continue
                change, later, promised = step
                end = min(found.end + later, self.latest)
                tried = self.play(self.allowed(found.demand.changed(change)), end)
                gained = -math.inf if tried is None else merit - tried.merit(penalty)
                if (
                    tried is not None
                    and gained <= ACCEPTED * promised < tried.merit(penalty) - tried.objective
                ):
                    nearer = self.finished(tried, rounds=CORRECTED)
                    if nearer is not None and nearer.merit(penalty) < tried.merit(penalty):
                        tried, gained = nearer, merit - nearer.merit(penalty)
                if promised < least * merit and not (model.squares and trust > NARROW):
                    return tried if tried is not None and gained > 0.0 else found
                if gained > ACCEPTED * promised:
                    better, share = tried, gained / promised
                    trust *= 2.0 if share > GOOD else 0.5 if share < POOR else 1.0
                else:
                    trust *= REFUSED
            found, trust = better, min(trust, MOST_TRUST)
        return found

    def refined(self, found: Found, times: int = 4, least: float = 3e-5) -> Found:
        """The same on finer grids, where the torque changes much between two knots."""
        for number in range(times):
            finer = self.with_switches(found.demand) if number == 0 and self.switches else None
            finer = finer or self._halved(found.demand)
            if finer is None:
                break
            down = self._down(self.play(finer, found.end), STEPS // 2, least, PENALTY)
            if down is None:
                break
            gained = found.merit() - down.merit()
            found = down if gained > 0.0 else found
            if gained < least * found.merit() and number > 0:
                break
            if gained > STALLED * found.merit():  # far from its end: from a wide trust region again
                found = self._down(found, STEPS // 2, least, PENALTY) or found
        return found

    def _halved(self, demand: Demand) -> Demand | None:
        """With a knot in the middle of the intervals beside bends; None where there are none."""
        time, torque = demand.time, demand.torque
        width = np.diff(time)
        slope = np.diff(torque) / np.maximum(width, 1e-12 * self.until)
        bend = np.abs(np.diff(slope)) * np.maximum(width[1:], width[:-1])
        if self.switches:  # beside a step whose instant is unknown
            bend[(width[1:] == 0.0) | (width[:-1] == 0.0)] = 0.0
        beside = np.maximum(np.append(bend, 0.0), np.append([0.0], bend))
        beside[width <= 1e-4 * self.period] = 0.0
        most = max(np.sort(beside)[-HALVED:][0], JUMP * self.high) if beside.size else math.inf
        halved = np.flatnonzero(beside >= most)
        if halved.size == 0:
            return None
        middle = 0.5 * (time[halved] + time[halved + 1])
        mean = 0.5 * (torque[halved] + torque[halved + 1])
        return self.demand(np.insert(time, halved + 1, middle), np.insert(torque, halved + 1, mean))

    def with_switches(self, demand: Demand) -> Demand | None:
        """With steps of the same area where the torque passes between two levels within three intervals."""
        time, torque = demand.time.tolist(), demand.torque.tolist()
        least, level, new = SWITCH * self.high, LEVEL * self.high, False
        i = 1
        while i < len(time) - 2:
            if abs(torque[i] - torque[i - 1]) > level:
                i += 1
                continue
            for j in (i + 1, i + 2, i + 3):
                if j + 1 >= len(time) or time[j] == time[i]:
                    break
                a, b, parts = torque[i], torque[j], torque[i : j + 1]
                rising = all((y - x) * (b - a) >= 0.0 for x, y in pairwise(parts))
                if not rising or abs(b - a) < least or abs(torque[j + 1] - b) > level:
                    continue
                area = sum(
                    0.5 * (torque[k] + torque[k + 1] - 2.0 * b) * (time[k + 1] - time[k]) for k in range(i, j)
                )
                at = min(max(time[i] + area / (a - b), time[i]), time[j])
                time[i + 1 : j], torque[i + 1 : j], new = [at, at], [a, b], True
                i += 2
                break
            i += 1
        return self.demand(np.array(time), np.array(torque)) if new else None

    def finished(self, found: Found, reserve: float = 1e-8, rounds: int = 8) -> Found | None:
        """The same with the terminal condition met to rounding, by the smallest changes of the unknowns."""
        reached = self.problem.terminal == "reached"
        for _ in range(rounds):
            if found.lacking.max() <= (0.0 if reached else 1e-10):
                return found
            demand, (rows, rates) = found.demand, self.terminal_rows(found)
            missing = np.where(found.lacking > 0.0, found.missing + (reserve if reached else 0.0), 0.0)
            low = np.concatenate([self.low - demand.torque, np.zeros(demand.steps.size)]) / self.high
            high = np.concatenate([self.high - demand.torque, np.zeros(demand.steps.size)]) / self.high
            if demand.steps.size:
                earlier, later = demand.room()
                low[demand.time.size :], high[demand.time.size :] = -earlier, later
            if self.starts_at_initial:
                low[0] = high[0] = 0.0
            # where the time is minimised t_f may move too
            moves = 0.1 * self.period * (self.objective == "start_time")
            longer = float(np.clip(self.latest - found.end, 0.0, moves))
            low, high = np.append(low.clip(max=0.0), -moves), np.append(high.clip(min=0.0), longer)
            room = least_change(np.column_stack([rows, rates]), missing, low, high)
            again = self.play(self.allowed(demand.changed(room[:-1])), found.end + float(room[-1]))
            if again is None:
                return None
            found = again
        return found


def least_change(rows: Matrix, wanted: Vector, low: Vector, high: Vector) -> Vector:
    """The smallest x within its limits with rows x = wanted, or near to it: those at a limit are left out.

    >>> one = least_change(np.array([[1.0, 2.0]]), np.array([5.0]), np.zeros(2), np.array([9.0, 1.0]))
    >>> one.round(9).tolist()
    [3.0, 1.0]
    """
    x, free = np.zeros(low.size), high > low
    for _ in range(low.size):
        some = rows[:, free]
        squares = some @ some.T
        ridge = 1e-14 * float(np.trace(squares)) * np.eye(wanted.size)
        x[free] = some.T @ np.linalg.lstsq(squares + ridge, wanted - rows[:, ~free] @ x[~free], rcond=None)[0]
        beyond = free & ((x < low) | (x > high))
        x = np.clip(x, low, high)
        if not beyond.any():
            break
        free &= ~beyond
    return x
