"""Where to go down from: starts by pulse, coast, catch, coast, hold, of all lengths of pulse and coast.

A blind start over several gaps must live with flanks that meet at different instants. Two ways are gentle:
all meet while the motor coasts and stay together, or all rebound and a second pulse catches them as they come
apart. Which is better changes with the gaps, and each way has several local optima. They differ most in how
long the first pulse and the coast after it are: so both lengths are divided into cells, and each cell
gives the best of a few random members.
"""

from __future__ import annotations

import math

import numpy as np

from softstart.drive import Drive
from softstart.optimal.robust.plays import Plays
from softstart.optimal.robust.search import gentleness
from softstart.optimal.robust.shape import Matrix, Player, Staircase
from softstart.profile import Vector

PULSES, COASTS = 6, 5  # cells of the lengths of the pulse and of the coast
COASTS_REACTING = 3  # fewer: on the contact's own clock the gaps differ less
MEMBERS = 200  # random members of each cell
N_NUMBERS = 8
PULSE, COAST, CATCH, COAST_AGAIN, LEVEL, LEVEL_AGAIN, HOLD, CONTACT_LEVEL = range(N_NUMBERS)


class Family:
    """Staircases of pulse, coast, catch, coast, hold; with `react` the pulse first, the rest from contact on.

    Each is described by 8 numbers from 0 to 1: four lengths and the torques of both coasts, of the hold, and
    of the first coast after contact (with `react`).
    """

    def __init__(self, plays: Plays, low: float, high: float, react: bool) -> None:
        self.plays, self.low, self.high, self.react = plays, low, high, react
        self.period = max(float(drive.elastic_period) for drive in plays.drives)
        self.crossing = max(_crossing(drive, high) for drive in plays.drives)
        # a stand-in with four edges far apart, so that its unknowns can be told from each other
        self.player = Player(self._shape(self._unknowns(np.full((1, N_NUMBERS), 0.55))[0]), plays.drives[0])

    def spread(self, seed: int, members: int = MEMBERS) -> list[Staircase]:
        """One staircase of each cell, the best of its random members."""
        random = np.random.default_rng(seed)
        cost = gentleness(self.plays, self.high - self.low)
        chosen = []
        coasts = COASTS_REACTING if self.react else COASTS
        for pulse in range(PULSES):
            for coast in range(coasts):
                numbers = random.random((members, N_NUMBERS))
                numbers[:, PULSE] = (pulse + numbers[:, PULSE]) / PULSES
                numbers[:, COAST] = (coast + numbers[:, COAST]) / coasts
                unknowns = self._unknowns(numbers)
                best = int(np.argmin(cost(self.plays.figures(self.player, unknowns))))
                chosen.append(self._shape(unknowns[best]))
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

    def _shape(self, unknowns: Vector) -> Staircase:
        zero = np.zeros(1)
        if not self.react:
            return Staircase(np.concatenate([zero, unknowns[5:]]), unknowns[:5].copy())
        contact = Staircase(np.concatenate([zero, unknowns[7:]]), unknowns[2:6].copy())
        return Staircase(np.concatenate([zero, unknowns[6:7]]), unknowns[:2].copy(), contact)


def _crossing(drive: Drive, high: float) -> float:
    """How long the motor takes through the gap at its highest torque, s, with what its torque is late by."""
    way = max(0.5 * float(drive.gap) - float(drive.start_position), 0.0)
    delay = float(drive.torque_lag) + high / float(drive.torque_rate)
    return math.sqrt(2.0 * way * float(drive.J1) / high) + delay
