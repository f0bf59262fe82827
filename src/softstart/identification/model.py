"""What the exact plant would have logged: signals at the samples, and their response to torque errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Final, cast

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.controller import CompiledController, make_controller
from softstart.drive import Drive
from softstart.errors import SimulationError
from softstart.identification.logs import Log
from softstart.identification.sensitivity import torque_sensitivities
from softstart.plant import exchange, record
from softstart.plant import layout as at
from softstart.plant.vector import plant_vector
from softstart.profile import TorqueProfile
from softstart.start.engine import Recorder

POSITION: Final = "position"  # where in the gap a log begins, from -1 (opposite flank) to 1 (driving flank)
DEAD_TIME: Final = "computing_delay"
FILTER: Final = "speed_filter"  # time constant of the filter through which a speed was logged
FINE: Final = 4  # instants in each sample period at which a filter sees the speed
MOST_BLOCKS: Final = 600  # of the torque error along a log
WIDE: Final = 1e3  # times the largest torque logged: no limit of the drive cuts a torque that was measured


class LogModel:
    """The drive under the torque of a log: its motor angle or speed at the instants of the samples.

    The torque is the plant's input: straight lines through the samples where the log has the torque that was
    measured (the lag is then in the samples), held from one sample to the next where it has the demand (the
    plant's lag, rate limit and dead time follow). Parameters may be any of a `Drive` and `POSITION`.
    """

    def __init__(self, log: Log, drive: Drive) -> None:
        self.log, self.guess = log, drive
        largest = float(np.max(np.abs(log.torque)))
        limit = WIDE * max(largest, 1e-300)
        changes: dict[str, object] = {
            "starting_torque": limit,
            "maximum_torque": limit,
            "minimum_torque": -limit,
            "encoder_lines": 0.0,
            "brake": "none",
        }
        if log.torque_is == "measured":
            changes |= {"torque_lag": 0.0, "torque_rate": math.inf, "computing_delay": 0.0}
        self.drive = drive.replace(**changes)
        self.dead_time = float(self.drive.computing_delay)
        self.drive = self.drive.replace(computing_delay=0.0)
        self.times = log.time - log.time[0]
        self.recorder = _recorder(self.times.size)
        self.player = _player(TorqueProfile([0.0], [0.0]))
        self.error: Vector | None = None  # of the torque, as the fit knows it: scaled, one for each block
        self.shift: Vector | None = None  # what the linear response to it adds to the signal
        self.last: tuple[dict[str, float] | None, Matrix] = None, np.empty((0, 0))  # values and their row
        self.block = max(1, math.ceil(self.times.size / MOST_BLOCKS))

    def first(self, share: float) -> LogModel:
        """The model of the first part of the log: at least four samples of it."""
        count = max(4, math.ceil(share * self.times.size))
        one = copy(self)
        one.log = self.log.first(count)
        one.times = self.times[:count]
        return one

    def plants(self, values: Sequence[Mapping[str, float]]) -> Matrix:
        """A row of the kernel's parameters for each set of values."""
        if len(values) == 1 and values[0] == self.last[0]:
            return self.last[1]
        names = {name for row in values for name in row} - {POSITION, DEAD_TIME, FILTER}
        changes = {name: np.array([row[name] for row in values]) for name in names}
        if any(POSITION in row for row in values):
            gaps = np.array([row.get("gap", float(self.drive.gap)) for row in values])
            changes["start_position"] = 0.5 * gaps * np.array([row[POSITION] for row in values])
        elif not changes:
            changes = {"gap": np.array([float(self.drive.gap)])}
        # numbers already, and within their ranges: to read and check them takes longer than the motion
        drive = object.__new__(Drive)
        vars(drive).update(vars(self.drive) | changes)
        rows = plant_vector(drive, time_limit=1e9 + float(self.times[-1]))
        rows.view(at.PLANT)[:, 0]["longest"] = math.inf
        self.last = dict(values[0]), rows[:1]
        return rows

    def numbers(self, dead_time: float) -> Vector:
        """The torque of the log as the kernel's `profile` controller takes it."""
        log, times, torque = self.log, self.times, self.log.torque
        if self.error is not None:
            torque = torque + np.repeat(self.error, self.block)[: torque.size] / math.sqrt(self.block)
        if log.torque_is == "demand":
            knots, torques = np.repeat(times, 2)[1:], np.repeat(torque, 2)[:-1]
        else:
            knots, torques = times, torque
        knots = knots + dead_time
        if dead_time > 0.0:
            knots, torques = np.concatenate([[0.0], knots]), np.concatenate([[torques[0]], torques])
        player = _player(TorqueProfile(knots, torques))
        return np.array(player.vector(self.drive), dtype=np.float64).ravel()

    def signals(self, values: Sequence[Mapping[str, float]]) -> Matrix:
        """What would have been logged under each set of values: a row for each."""
        rows = self.plants(values)
        out = np.empty((len(values), self.times.size))
        delays = [row.get(DEAD_TIME, self.dead_time) for row in values]
        numbers = {delay: self.numbers(delay) for delay in set(delays)}
        for i, row in enumerate(values):
            out[i] = self._signal(rows[min(i, len(rows) - 1)], numbers[delays[i]], row.get(FILTER, 0.0))
        return out

    def torque_responses(self, values: Mapping[str, float], plant: Vector | None = None) -> Matrix:
        """How the signal moves, a column for each block of samples, per N m of error in the torque there.

        Scaled by 1/sqrt(samples in a block): with independent errors of the samples, the covariance of the
        signal is their variance times this matrix and its transpose. `plant` is the row of these values, if
        it is known.
        """
        p, lag = self.plants([values])[0] if plant is None else plant, values.get(FILTER, 0.0)
        dead_time, speed = values.get(DEAD_TIME, self.dead_time), self.log.kind == "speed"
        smoothed = speed and lag > 0.0
        found = torque_sensitivities(
            p, self._segments(p, self.numbers(dead_time)), self.times + dead_time,
            held=self.log.torque_is == "demand", block=self.block,
            times=self._fine if smoothed else self.times, speed=speed,
        )  # fmt: skip
        if smoothed:
            found = filtered(self._fine, found.T, lag).T[::FINE]
        found /= math.sqrt(self.block)
        return found

    def states(self, values: Mapping[str, float]) -> Matrix:
        """The states at the samples, in the columns of `plant.record`."""
        numbers = self.numbers(values.get(DEAD_TIME, self.dead_time))
        return self._states(self.plants([values])[0], numbers)

    @property
    def _fine(self) -> Vector:
        count = self.times.size
        fine: Vector = np.interp(np.arange(FINE * (count - 1) + 1) / FINE, np.arange(count), self.times)
        return fine

    def _signal(self, p: Vector, numbers: Vector, lag: float = 0.0) -> Vector:
        if lag > 0.0 and self.log.kind == "speed":
            return filtered(self._fine, self._states(p, numbers, self._fine)[:, record.W1_OUT], lag)[::FINE]
        states = self._states(p, numbers)
        if self.log.kind == "speed":
            return states[:, record.W1_OUT].copy()
        angle: Vector = states[:, record.PHI1_OUT] - p[at.index(at.PLANT, "theta_0")]
        return angle

    def _states(self, p: Vector, numbers: Vector, times: Vector | None = None) -> Matrix:
        times = self.times if times is None else times
        segments = self._segments(p, numbers)
        starts = segments[:, at.index(at.SEGMENT, "start")]
        index = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, None)
        out = np.empty((times.size, record.N_OUT))
        record.states_at(p, segments, index, times, np.zeros(at.N_X), np.zeros(at.N_M), out)
        return out

    def _segments(self, p: Vector, numbers: Vector) -> Matrix:
        """The spans of the motion; they hold until the next call."""
        player, one = self.player, self.recorder
        one.p = p
        one.m[:] = 0.0
        one.begin(float(self.times[-1]) * (1.0 + 1e-9))
        memory, command = np.zeros(player.state_size), np.zeros(exchange.NEW_STATE + player.state_size)
        while (reason := one.run(type(player).kernel, numbers, memory, command)) == at.BUFFER_FULL:
            one.grow()
        if reason != at.ENDED:
            raise SimulationError(f"The start of the log could not be computed (status {reason}).")
        return one.segments[: int(one.x[at.index(at.STATE, "n_segments")])]

    def travels(self, values: Sequence[Mapping[str, float]]) -> Matrix:
        """How far the load moves at most under each set of values, and how often the gap opens and closes.

        Seen at events and samples: exact for a reactive load, which turns at events only.
        """
        numbers, found = self.numbers(self.dead_time), np.empty((len(values), 2))
        for row, p in zip(found, self.plants(values), strict=True):
            angles = self._segments(p, numbers)[:, at.S_PHI2]
            last = float(self.recorder.x[at.PHI2])
            row[0] = np.max(np.abs(np.append(angles, last) - angles[0]))
            row[1] = self.recorder.x[at.GAP_EVENTS]
        return found


def filtered(time: Vector, signal: Vector, lag: float) -> Vector:
    """A signal, straight between these instants, behind a filter of the first order that begins settled.

    Of several signals each is a row.

    >>> filtered(np.linspace(0.0, 5.0, 6), np.array([0.0, 1.0, 1.0, 1.0, 1.0, 1.0]), 0.01).round(2).tolist()
    [0.0, 0.99, 1.0, 1.0, 1.0, 1.0]
    """
    steps = np.diff(time)
    kept = np.exp(-steps / lag)
    mean = (1.0 - kept) * lag / steps
    pushed = (1.0 - mean) * signal[..., 1:] + (mean - kept) * signal[..., :-1]
    out = np.empty_like(signal)
    out[..., 0] = value = signal[..., 0]
    for i, share in enumerate(kept.tolist()):
        out[..., i + 1] = value = share * value + pushed[..., i]
    return out


def _recorder(samples: int) -> Recorder:
    one = Recorder(np.zeros(at.N_P), 0)
    rows = 4 * samples + 256
    one.segments = np.zeros((rows, at.N_SEGMENT))
    one.events = np.zeros((rows, at.N_EVENT))
    one.stages = np.zeros((rows, at.N_STAGE))
    return one


def _player(profile: TorqueProfile) -> CompiledController:
    return cast(CompiledController, make_controller("profile", {"profile": profile}))
