"""Where descents begin: random members of a family of starts, and short staircases by differential evolution.

A blind start over several gaps must live with flanks that meet at different instants. Two ways are gentle:
all meet while the motor coasts and stay together, or all rebound and a second pulse catches them as they come
apart. Which is better changes with the gaps, and each way has several local optima. They differ most in how
long the first pulse and the coast after it are: so both lengths are divided into cells, and each cell
gives the best of a few random members.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.drive import Drive
from softstart.optimal.robust.evaluation import Evaluator, Figures, ProfileParameters, Staircase

PULSES, COASTS = 6, 5  # cells of the lengths of the pulse and of the coast
COASTS_REACTING = 3  # fewer: on the contact's own clock the gaps differ less
CELL_MEMBERS = 200  # random members of each cell
N_NUMBERS = 8
PULSE, COAST, CATCH, COAST_AGAIN, LEVEL, LEVEL_AGAIN, HOLD, CONTACT_LEVEL = range(N_NUMBERS)


class Family:
    """Staircases of pulse, coast, catch, coast, hold; with `react` the pulse first, the rest from contact on.

    Each is described by 8 numbers from 0 to 1: four lengths and the torques of both coasts, of the hold, and
    of the first coast after contact (with `react`).
    """

    def __init__(self, evaluator: Evaluator, low: float, high: float, react: bool) -> None:
        self.evaluator, self.low, self.high, self.react = evaluator, low, high, react
        self.period = max(float(drive.elastic_period) for drive in evaluator.drives)
        self.crossing = max(crossing_time(drive, high) for drive in evaluator.drives)
        # a stand-in with four edges far apart, so that its unknowns can be distinguished
        self.parameters = ProfileParameters(
            self._staircase(self._unknowns(np.full((1, N_NUMBERS), 0.55))[0]), evaluator.drives[0]
        )

    def spread(self, seed: int, less: int = 1, members: int = CELL_MEMBERS) -> list[Staircase]:
        """One staircase of each cell, the best of its random members; of each length `less` times fewer."""
        random = np.random.default_rng(seed)
        cost = gentleness(self.evaluator, self.high - self.low)
        chosen = []
        pulses, coasts = max(PULSES // less, 1), max((COASTS_REACTING if self.react else COASTS) // less, 1)
        for pulse in range(pulses):
            for coast in range(coasts):
                numbers = random.random((members, N_NUMBERS))
                numbers[:, PULSE] = (pulse + numbers[:, PULSE]) / pulses
                numbers[:, COAST] = (coast + numbers[:, COAST]) / coasts
                unknowns = self._unknowns(numbers)
                best = int(np.argmin(cost(self.evaluator.figures(self.parameters, unknowns))))
                chosen.append(self._staircase(unknowns[best]))
        return chosen

    def _unknowns(self, numbers: Matrix) -> Matrix:
        """Levels and edges as Staircase.unknowns has them, a row for each row of numbers."""
        least = 1e-3 * self.period
        pulse = least + numbers[:, PULSE] * max(self.crossing, 0.25 * self.period)
        coast = least + numbers[:, COAST] * (self.period + 0.3 * self.crossing)
        catch = least + 0.4 * self.period * numbers[:, CATCH]
        again = least + 0.8 * self.period * numbers[:, COAST_AGAIN]
        high = np.full(numbers.shape[0], self.high)
        level, level_again, contact = (
            self._torque(1.2 * numbers[:, i] - 0.5) for i in (LEVEL, LEVEL_AGAIN, CONTACT_LEVEL)
        )
        hold = self._torque(0.7 + 0.4 * numbers[:, HOLD])
        if self.react:
            levels = [high, level, contact, high, level_again, hold]
            edges = [pulse, coast, coast + catch, coast + catch + again]
        else:
            levels = [high, level, high, level_again, hold]
            edges = [pulse, pulse + coast, pulse + coast + catch, pulse + coast + catch + again]
        return np.stack([*levels, *edges], axis=1)

    def _torque(self, share: Vector) -> Vector:
        torque: Vector = self.low + (self.high - self.low) * np.clip(share, 0.0, 1.0)
        return torque

    def _staircase(self, unknowns: Vector) -> Staircase:
        zero = np.zeros(1)
        if not self.react:
            return Staircase(np.concatenate([zero, unknowns[5:]]), unknowns[:5].copy())
        contact = Staircase(np.concatenate([zero, unknowns[7:]]), unknowns[2:6].copy())
        return Staircase(np.concatenate([zero, unknowns[6:7]]), unknowns[:2].copy(), contact)


def crossing_time(drive: Drive, high: float) -> float:
    """How long the motor takes through the gap at its highest torque, s, with what its torque is late by."""
    travel = max(max(0.5 * float(one.gap) - float(one.theta0), 0.0) for one in drive.positions.values())
    delay = float(drive.torque_lag) + high / float(drive.torque_rate)
    return math.sqrt(2.0 * travel * float(drive.J1) / high) + delay


LATE = 100.0  # what being late costs, relative to the time asked for
MEMBERS, ROUNDS = 64, 500  # of differential evolution


def gentleness(evaluator: Evaluator, scale: float) -> Callable[[Figures], Vector]:
    """The cost that the search for a gentle start minimises: the worst peak, and a price for being late."""

    def cost(figures: Figures) -> Vector:
        late = np.maximum(evaluator.lateness(figures).max(axis=1), 0.0) / evaluator.start_time
        worst: Vector = figures.peak.max(axis=1) / scale + LATE * late
        return worst

    return cost


def quickness(evaluator: Evaluator) -> Callable[[Figures], Vector]:
    """The cost that the search for a quick start minimises: the latest start time."""

    def cost(figures: Figures) -> Vector:
        worst: Vector = evaluator.lateness(figures).max(axis=1)
        return worst

    return cost


def offspring(random: np.random.Generator, here: Matrix, costs: Vector) -> Matrix:
    """One new member for each of a population in the unit box, by differential evolution."""
    count, size = here.shape
    first, second = random.integers(count, size=(2, count))
    better = np.argsort(costs)[random.integers(max(count // 8, 2), size=count)]
    weight = random.uniform(0.4, 0.9, (count, 1))
    tried = here + weight * (here[better] - here) + weight * (here[first] - here[second])
    keep = random.random(tried.shape) > 0.7
    keep[np.arange(count), random.integers(size, size=count)] = False
    tried = np.where(keep, here, tried)
    made: Matrix = np.where((tried < 0.0) | (tried > 1.0), random.random(tried.shape), tried)
    return made


class Evolution:
    """Staircases of few steps, described by numbers from 0 to 1."""

    def __init__(self, evaluator: Evaluator, steps: int, low: float, high: float, react: bool) -> None:
        self.evaluator, self.steps, self.low, self.high, self.react = evaluator, steps, low, high, react
        self.parts = (
            ((2, evaluator.horizon), (steps, evaluator.horizon)) if react else ((steps, evaluator.horizon),)
        )
        self.parameters = ProfileParameters(
            self.staircase(np.linspace(0.05, 0.95, self.size)), evaluator.drives[0]
        )

    @property
    def size(self) -> int:
        """How many numbers describe a staircase."""
        return sum(2 * steps - 1 for steps, _ in self.parts)

    def unknowns(self, numbers: Matrix) -> Matrix:
        """Levels and edges of each row of numbers; the edges sorted, the first half of the time in detail."""
        levels, edges, at = [], [], 0
        for steps, until in self.parts:
            levels.append(
                self.low + (self.high - self.low) * np.clip(1.2 * numbers[:, at : at + steps] - 0.1, 0, 1)
            )
            share = np.sort(numbers[:, at + steps : at + 2 * steps - 1], axis=1)
            ladder = 1e-6 * np.arange(1, steps)
            edges.append(until * share**2 + ladder)
            at += 2 * steps - 1
        return np.concatenate([*levels, *edges], axis=1)

    def staircase(self, numbers: Vector) -> Staircase:
        """The staircase of one row of numbers."""
        values = self.unknowns(np.atleast_2d(numbers))[0]
        made: list[Staircase] = []
        at, edge = 0, sum(steps for steps, _ in self.parts)
        for steps, _ in self.parts:
            edges = np.concatenate([[0.0], values[edge : edge + steps - 1]])
            made.append(Staircase(edges, values[at : at + steps]))
            at, edge = at + steps, edge + steps - 1
        return made[0] if not self.react else Staircase(made[0].edges, made[0].levels, made[1])

    def best(self, cost: Callable[[Figures], Vector], seed: int) -> tuple[float, Staircase]:
        """The best staircase found from one seed, and its cost."""
        random = np.random.default_rng(seed)
        here = random.random((MEMBERS, self.size))
        costs = cost(self.evaluator.figures(self.parameters, self.unknowns(here)))
        for _ in range(ROUNDS):
            tried = offspring(random, here, costs)
            new = cost(self.evaluator.figures(self.parameters, self.unknowns(tried)))
            gain = new < costs
            here[gain], costs[gain] = tried[gain], new[gain]
        i = int(np.argmin(costs))
        return float(costs[i]), self.staircase(here[i])
