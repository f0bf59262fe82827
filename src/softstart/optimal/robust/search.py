"""A first look over all short staircases: differential evolution on the exact plant."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from softstart.optimal.robust.plays import Figures, Plays
from softstart.optimal.robust.shape import Matrix, Player, Staircase
from softstart.profile import Vector

LATE = 100.0  # what being late costs, relative to the time asked for
MEMBERS, ROUNDS = 64, 500


def gentleness(plays: Plays, scale: float) -> Callable[[Figures], Vector]:
    """The cost that the search for a gentle start minimises: the worst peak, and a price for being late."""

    def cost(figures: Figures) -> Vector:
        late = np.maximum(plays.lateness(figures).max(axis=1), 0.0) / plays.start_time
        worst: Vector = figures.peak.max(axis=1) / scale + LATE * late
        return worst

    return cost


def quickness(plays: Plays) -> Callable[[Figures], Vector]:
    """The cost that the search for a quick start minimises: the latest start time."""

    def cost(figures: Figures) -> Vector:
        worst: Vector = plays.lateness(figures).max(axis=1)
        return worst

    return cost


class Search:
    """Staircases of few steps, described by numbers from 0 to 1."""

    def __init__(self, plays: Plays, steps: int, low: float, high: float, react: bool) -> None:
        self.plays, self.steps, self.low, self.high, self.react = plays, steps, low, high, react
        self.parts = ((2, plays.horizon), (steps, plays.horizon)) if react else ((steps, plays.horizon),)
        self.player = Player(self.shape(np.linspace(0.05, 0.95, self.size)), plays.drives[0])

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

    def shape(self, numbers: Vector) -> Staircase:
        """The staircase of one row of numbers."""
        values = self.unknowns(np.atleast_2d(numbers))[0]
        made: list[Staircase] = []
        at, edge = 0, sum(steps for steps, _ in self.parts)
        for steps, _ in self.parts:
            edges = np.concatenate([[0.0], values[edge : edge + steps - 1]])
            made.append(Staircase(edges, values[at : at + steps]))
            at, edge = at + steps, edge + steps - 1
        return made[0] if not self.react else Staircase(made[0].edges, made[0].levels, made[1])

    def best(
        self, cost: Callable[[Figures], Vector], seed: int, rounds: int = ROUNDS
    ) -> tuple[float, Staircase]:
        """The best staircase found from one seed, and its cost."""
        random = np.random.default_rng(seed)
        here = random.random((MEMBERS, self.size))
        costs = cost(self.plays.figures(self.player, self.unknowns(here)))
        rows = np.arange(MEMBERS)
        for _ in range(rounds):
            first, second = random.integers(MEMBERS, size=(2, MEMBERS))
            better = np.argsort(costs)[random.integers(max(MEMBERS // 8, 2), size=MEMBERS)]
            weight = random.uniform(0.4, 0.9, (MEMBERS, 1))
            tried = here + weight * (here[better] - here) + weight * (here[first] - here[second])
            keep = random.random(tried.shape) > 0.7
            keep[rows, random.integers(self.size, size=MEMBERS)] = False
            tried = np.where(keep, here, tried)
            tried = np.where((tried < 0.0) | (tried > 1.0), random.random(tried.shape), tried)
            new = cost(self.plays.figures(self.player, self.unknowns(tried)))
            gain = new < costs
            here[gain], costs[gain] = tried[gain], new[gain]
        i = int(np.argmin(costs))
        return float(costs[i]), self.shape(here[i])
