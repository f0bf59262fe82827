"""Open-loop starts of a chain, played exactly, with their exact sensitivities to the demand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.chain.model import Chain
from softstart.controller import make_controller
from softstart.kernel import records as at
from softstart.profile import TorqueProfile
from softstart.start.engine import ended, run_one
from softstart.start.recorded import Recorded, Recorder
from softstart.start.rows import MAX_EVENTS, rows_of


@dataclass(frozen=True, eq=False)
class Answer:
    """Sensitivities to the torques of the knots, a last axis of them.

    `torques[j, k]` of the torque of shaft k at instant j, N m/(N m); `twists[i]` and `speeds[i]` of
    twists and speeds at mark i.
    """

    torques: Vector
    twists: Vector
    speeds: Vector


@dataclass(frozen=True, eq=False)
class Played:
    """A start of a chain under a demand, from 0 to its end."""

    profile: TorqueProfile
    recorded: Recorded

    @property
    def peak(self) -> float:
        """Largest |T| of all shafts, N m, located."""
        return float(np.abs(self.recorded.shafts["peak"]).max())

    def instants(self, step: float) -> Vector:
        """Both ends of every span and instants in between, no further apart than `step`, s."""
        start, end = self.recorded.spans[:, [at.S_START, at.S_END]].T
        parts = np.ceil((end - start) / step).astype(np.int64).clip(1)
        first = np.repeat(np.cumsum(parts) - parts, parts)
        share = (np.arange(parts.sum()) - first) / np.repeat(parts, parts)
        return np.append(np.repeat(start, parts) + share * np.repeat(end - start, parts), end[-1])

    def answer(self, times: ArrayLike, marks: ArrayLike = ()) -> Answer:
        """The sensitivities of all shaft torques at rising instants, and of the state at `marks`."""
        torques, states = self.recorded.sensitivities(self.profile.time, times, marks)
        joints = self.recorded.rows.count - 1
        return Answer(torques, states[:, :joints], states[:, joints:-1])


class Player:
    """Plays demands on one chain; `plays` counts them."""

    def __init__(self, chain: Chain) -> None:
        self.chain, self.nominal = chain, chain.design_drive
        self.rows = rows_of(chain)
        self.plays = 0
        self._room = 1024

    def _run(self, profile: TorqueProfile, until: float, room: int) -> tuple[Recorder, int]:
        made: Any = make_controller("profile", {"profile": profile})
        recorder = Recorder(self.rows, int(made.sensors), room)
        self.plays += 1
        return recorder, run_one(made, self.nominal, recorder, until)

    def play(self, profile: TorqueProfile, until: float) -> Played:
        """The start from 0 to `until` in s; SimulationError if it cannot be finished."""
        recorder, reason = self._run(profile, until, self._room)
        ended(recorder.state, reason, until, MAX_EVENTS, f"Chain {self.chain.name}")
        self._room = max(self._room, recorder.spans.shape[0])
        return Played(profile, recorder.finished())

    def figures(self, profile: TorqueProfile, until: float) -> tuple[float, float, float]:
        """Largest |T| of all shafts until then, N m; start time, s (inf if none); load speed then, rad/s."""
        state = self._run(profile, until, 0)[0].state
        time = float(state.start_time)
        return (
            float(np.abs(state.peak).max()),
            math.inf if math.isnan(time) else time,
            float(state.final_speed),
        )
