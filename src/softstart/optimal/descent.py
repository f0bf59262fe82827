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
from itertools import pairwise

import numpy as np

from softstart.arrays import Indices, Matrix, Vector
from softstart.optimal.demand import Demand
from softstart.optimal.model import LET_THROUGH, Model
from softstart.optimal.search import MOST_KNOTS, PENALTY, Found, Search
from softstart.profile import TorqueProfile

SOFT, DEAREST = 2.0, 1e5  # penalty of what is missed at first; up to which it rises
FIRST_TRUST, MOST_TRUST, LEAST_TRUST = 0.1, 0.5, 1e-4  # of the highest torque
STEPS, TASTE = 60, 12
GOOD, POOR, ACCEPTED = 0.7, 0.3, 0.05  # share of the promised decrease that came true
REFUSED = 0.3  # by what a step that is refused narrows the trust region
CORRECTED = 2  # Newton steps towards the terminal condition, before a step that misses it is refused
RESERVE = 1e-8  # share by which speeds that are asked for alone are exceeded
NARROW = 3e-3  # trust from which on tangent planes are as good as their square
JUMP, HALVED = 0.04, 32  # bend of the torque, in highest torques, beside which intervals are halved; so many
FEW, ROUGH = 4, 1e-4  # times that large demands are refined, and how exactly
STALLED = 3e-4  # of the merit: a gain on a finer grid after which a descent goes on
INSIDE = 0.02  # of an interval, that a new step keeps from its ends
BOUND = 1e-6  # share of the rate of a torque, by which it lies below its limit and counts as there
SWITCH, LEVEL = 0.25, 0.02  # change of the torque, in highest torques, that becomes a step between two levels


class Descent(Search):
    """Descents of one problem, from first demands to local optima."""

    def down(
        self, first: TorqueProfile | Found | None, steps: int = STEPS, least: float = 1e-4,
        dear: float = DEAREST, soft: int = 0,
    ) -> Found | None:  # fmt: skip
        """Down from a first demand, until a program promises less than the share `least`.

        Where a condition is missed after all steps, missing it costs more, up to `dear`. In the first `soft`
        steps it costs little, so that a demand far from all good starts may pass through what is none.
        """
        found = self.play(self.onto(first)) if isinstance(first, TorqueProfile) else first
        found = self._down(found, soft, least, SOFT) if soft else found
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
                    nearer = self.finished(
                        tried, rounds=CORRECTED, along=(model.terminal, model.rates / found.end)
                    )
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

    def refined(self, found: Found, times: int = 8, least: float = 1e-5) -> Found:
        """The same on finer grids, where the torque changes much between two knots."""
        gainless = 0
        for number in range(times):
            finer = self.with_switches(found.demand) if number == 0 and self.switches else None
            finer = finer or self._halved(found.demand)
            if finer is None or (number >= FEW and finer.size > MOST_KNOTS):
                break
            if finer.size > MOST_KNOTS:
                least = ROUGH
            down = self._down(self.play(finer, found.end), STEPS // 2, least, PENALTY)
            if down is None:
                break
            gained = found.merit() - down.merit()
            found = down if gained > 0.0 else found
            gainless = gainless + 1 if gained < least * found.merit() else 0
            if gainless > 1:
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
                apart = INSIDE * (time[j] - time[i])  # steeper than any machine, two knots that nearly meet
                at = min(max(time[i] + area / (a - b), time[i] + apart), time[j] - apart)
                time[i + 1 : j], torque[i + 1 : j], new = [at, at], [a, b], True
                i += 2
                break
            i += 1
        return self.demand(np.array(time), np.array(torque)) if new else None

    def finished(
        self, found: Found, rounds: int = 8, along: tuple[Matrix, Vector] | None = None
    ) -> Found | None:
        """The same with the terminal condition met to rounding, by the smallest changes of the unknowns.

        `along` are the derivatives of the terminal quantities, where those of a start beside it will do.
        """
        reached = self.problem.terminal == "reached"
        for _ in range(rounds):
            if found.lacking.max() <= (0.0 if reached else 1e-10):
                return found
            demand, (rows, rates) = found.demand, along or self.terminal_rows(found)
            missing = np.where(found.lacking > 0.0, found.missing + (RESERVE if reached else 0.0), 0.0)
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
            block = np.append(self._blocks(demand), demand.size)
            first = np.flatnonzero(np.diff(block, prepend=-1))
            together = np.add.reduceat(np.column_stack([rows, rates]), first, axis=1)
            low, high = np.maximum.reduceat(low, first), np.minimum.reduceat(high, first)
            room = np.repeat(
                least_change(together, missing, low, high), np.diff(np.append(first, block.size))
            )
            again = self.play(self.allowed(demand.changed(room[:-1])), found.end + float(room[-1]))
            if again is None:
                return None
            found = again
        return found

    def _blocks(self, demand: Demand) -> Indices:
        """By unknown, the first of those that move together: knots between which the rate is at its limit.

        One of them alone would be brought back by `allowed`.
        """
        block = np.arange(demand.size)
        if math.isfinite(self.rate):
            bound = np.abs(np.diff(demand.torque)) >= (1.0 - BOUND) * self.rate * np.diff(demand.time)
            block[1:][bound] = 0
            block = np.maximum.accumulate(block)
        return block


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
