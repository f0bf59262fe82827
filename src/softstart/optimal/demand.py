"""A torque demand on a grid of knots, and the unknowns by which a program changes it.

The demand u(t) is linear between knots; two knots at one instant are a step. Unknown are the torques at the
knots and the instants of the steps: a step from a to b that comes later by s adds an impulse (a - b) s there,
and turns the lines beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from softstart.arrays import Indices, Matrix, Vector
from softstart.profile import TorqueProfile

BESIDE = 1e-4  # of the unit of time: how narrow the pulse is that stands for the impulse of a step
SMALL = 0.02  # of the highest torque: smaller steps stay where they are
SHARE = 0.45  # of the way to the next knot: so far a step moves at once


@dataclass(frozen=True, eq=False)
class Demand:
    """Torques in N m at knots in s; `steps` are the first knots of the steps whose instants are unknown.

    A unit of an unknown torque is `high`, N m, that of an instant is `unit`, s.

    >>> step = Demand(np.array([0.0, 1.0, 1.0, 2.0]), np.array([4.0, 4.0, 2.0, 2.0]), 4.0, 0.5).with_steps()
    >>> later = step.changed(np.array([0.0, 0.0, 0.0, 0.25, 0.5]))
    >>> later.time.tolist(), later.torque.tolist()
    ([0.0, 1.25, 1.25, 2.0], [4.0, 4.0, 2.0, 3.0])
    """

    time: Vector
    torque: Vector
    high: float
    unit: float
    steps: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    @property
    def size(self) -> int:
        """How many unknowns there are."""
        return self.time.size + self.steps.size

    def with_steps(self) -> Demand:
        """The same with the instants of all larger steps unknown."""
        width = np.diff(self.time)
        far = np.concatenate([[0.0], width, [0.0]]) > 8.0 * BESIDE * self.unit  # from the knot before each
        steps = np.flatnonzero((width == 0.0) & (np.abs(np.diff(self.torque)) > SMALL * self.high))
        steps = steps[far[steps] & far[steps + 2]]
        return replace(self, steps=steps)

    def changed(self, change: Vector) -> Demand:
        """The demand after a change of the unknowns."""
        count, time = self.time.size, self.time
        if self.steps.size:
            time = time.copy()
            time[self.steps] += change[count:] * self.unit
            time[self.steps + 1] = time[self.steps]
        return replace(self, time=time, torque=self.torque + self.high * change[:count])

    def room(self) -> tuple[Vector, Vector]:
        """By how many units the steps may come earlier and later."""
        before = self.time[self.steps] - self.time[self.steps - 1]
        after = self.time[self.steps + 2] - self.time[self.steps + 1]
        room = (SHARE * (width / self.unit - 8.0 * BESIDE).clip(0.0) for width in (before, after))
        return next(room), next(room)

    @cached_property
    def played(self) -> tuple[TorqueProfile, Matrix | float]:
        """The profile, with knots beside the steps; what a unit of each unknown adds at its knots, N m."""
        if not self.steps.size:
            return TorqueProfile(self.time, self.torque), self.high
        count, number, steps = self.time.size, np.arange(self.steps.size), self.steps
        before = np.column_stack([steps - 1, steps + 1]).ravel()  # the knot before each that is put in
        time = self.time[np.repeat(steps, 2)] + np.tile([-BESIDE, BESIDE], steps.size) * self.unit
        added = before + 1 + np.arange(before.size)
        share = (time - self.time[before]) / (self.time[before + 1] - self.time[before])
        weights, known = np.zeros((count + added.size, self.size)), np.ones(count + added.size, dtype=bool)
        known[added] = False
        weights[np.flatnonzero(known), np.arange(count)] = self.high
        weights[added, before] = (1.0 - share) * self.high
        weights[added, before + 1] = share * self.high
        torque = weights[:, :count] @ (self.torque / self.high)
        jump = (self.torque[steps] - self.torque[steps + 1]) / BESIDE
        slope = np.diff(self.torque) / np.maximum(np.diff(self.time), 1e-300)
        for knots, beside in ((steps, steps - 1), (steps + 1, steps + 1)):  # the lines beside the steps turn
            weights[:, count + number] -= weights[:, knots] * (slope[beside] * self.unit / self.high)
        for places in (added[0::2] + 1, added[0::2] + 2):  # the knots of the steps
            weights[places, count + number] += jump
        when = np.empty(known.size)
        when[added], when[known] = time, self.time
        return TorqueProfile(when, torque), weights
