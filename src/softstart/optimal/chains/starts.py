"""Open-loop starts of a chain, played exactly, with their exact sensitivities to the demand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.chain import kernel_start as kernel
from softstart.chain.kernel_records import MOTOR, ORDERS, Numbers, Start, numbers
from softstart.chain.kernel_sensitivity import sensitivities
from softstart.chain.model import Chain
from softstart.controller import make_controller
from softstart.drive import Drive
from softstart.plant import layout
from softstart.profile import TorqueProfile
from softstart.start.engine import MAX_EVENTS, ended, run_one


@dataclass(frozen=True, eq=False)
class Answer:
    """Sensitivities to the torques of the knots, a last axis of them.

    `torques[j, k]` of the torque of shaft k at instant j, N m/(N m); `twists[i]`, `speeds[i]` and `motor[i]`
    of the twists, the speeds and the realised motor torque at mark i.
    """

    torques: Vector
    twists: Vector
    speeds: Vector
    motor: Vector


@dataclass(frozen=True, eq=False)
class Played:
    """A start of a chain under a demand, from 0 to its end."""

    given: Numbers
    profile: TorqueProfile
    recorded: Start

    @property
    def peak(self) -> float:
        """Largest |T| of all shafts, N m, located."""
        return float(np.abs(self.recorded.shafts["peak"]).max())

    @property
    def start_time(self) -> float:
        """First instant at which the load mass has its target speed, s; NaN if never."""
        return float(self.recorded.x[layout.START_TIME])

    @cached_property
    def _replayed(self) -> Start:
        run = self.recorded
        records = {name: getattr(run, name) for name in ("spans", "span_masses", "span_shafts", "events")}
        return self.given.start()._replace(**records)

    def states(self, times: ArrayLike) -> tuple[Vector, Vector, Vector, Vector]:
        """Realised motor torque, speeds, twists and shaft torques at rising instants of the run."""
        when = np.asarray(times, dtype=np.float64)
        index = (np.searchsorted(self.recorded.spans["start"], when, side="right") - 1).clip(0)
        count = self.given.count
        motor = np.empty(when.size, MOTOR)
        w, twist, T = (np.empty((when.size, columns)) for columns in (count, count - 1, count - 1))
        kernel.states_at(self._replayed, index, when, motor, w, twist, T)
        return motor["u"].copy(), w, twist, T

    def instants(self, step: float) -> Vector:
        """Both ends of every span and instants in between, no further apart than `step`, s."""
        spans = self.recorded.spans
        parts = np.ceil((spans["end"] - spans["start"]) / step).astype(np.int64).clip(1)
        first = np.repeat(np.cumsum(parts) - parts, parts)
        share = (np.arange(parts.sum()) - first) / np.repeat(parts, parts)
        start, length = np.repeat(spans["start"], parts), np.repeat(spans["end"] - spans["start"], parts)
        return np.append(start + share * length, spans["end"][-1])

    def answer(self, times: ArrayLike, marks: ArrayLike = ()) -> Answer:
        """The sensitivities of all shaft torques at rising instants, and of the state at `marks`."""
        when, at = np.asarray(times, dtype=np.float64), np.asarray(marks, dtype=np.float64)
        knots = np.array(self.profile.time)
        joints, columns = self.given.count - 1, knots.size
        size = 2 * joints + 2
        torques = np.empty((when.size, joints, columns))
        states = np.zeros((at.size, size, columns))
        sensitivities(
            self._replayed, knots, when, torques, at, states, np.zeros((size, columns)),
            np.zeros((size, columns)), np.zeros((2, columns)), np.zeros((2, joints + 1)),
            np.zeros((size + 1, size + 2, ORDERS)),
        )  # fmt: skip
        return Answer(torques, states[:, :joints], states[:, joints:-1], states[:, -1])


class Player:
    """Plays demands on one chain; `plays` counts them."""

    def __init__(self, chain: Chain, nominal: Drive | None = None) -> None:
        self.chain = chain
        self.given = numbers(chain, None, None, MAX_EVENTS)
        self.nominal = chain.design_drive if nominal is None else nominal
        self.plays = 0
        self._rows = 1024

    def play(self, profile: TorqueProfile, until: float) -> Played:
        """The start from 0 to `until` in s; SimulationError if it cannot be finished."""
        made: Any = make_controller("profile", {"profile": profile})
        recorder = ChainRecorder(self.given, int(made.sensors), self._rows)
        reason = run_one(made, self.nominal, recorder, until)
        ended(recorder.x, reason, until, MAX_EVENTS, f"Chain {self.chain.name}")
        self._rows = max(self._rows, recorder.start.spans.size)
        self.plays += 1
        return Played(self.given, profile, recorder.finished())

    def figures(self, profile: TorqueProfile, until: float) -> tuple[float, float, float]:
        """Largest |T| of all shafts until then, N m; start time, s (inf if none); load speed then, rad/s."""
        made: Any = make_controller("profile", {"profile": profile})
        recorder = ChainRecorder(self.given, int(made.sensors), 0)
        run_one(made, self.nominal, recorder, until)
        self.plays += 1
        time = float(recorder.x[layout.START_TIME])
        peak = float(np.abs(recorder.start.shafts["peak"]).max())
        speed = float(recorder.start.masses["w"][self.given.place.load])
        return peak, math.inf if math.isnan(time) else time, speed
