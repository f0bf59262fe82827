"""What the exact plant would have logged: signals at the samples, and their response to torque errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Final

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.controller import Controller, make_controller
from softstart.drive import Drive
from softstart.drive.records import Columns
from softstart.errors import SimulationError
from softstart.identification.logs import Log
from softstart.kernel.records import ENDED, MACHINE, S_PHI
from softstart.profile import TorqueProfile
from softstart.start.engine import run_one
from softstart.start.recorded import Recorded, Recorder
from softstart.start.rows import Rows, rows_of

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
        self.error: Vector | None = None  # of the torque, as the fit knows it: scaled, one for each block
        self.shift: Vector | None = None  # what the linear response to it adds to the signal
        self.last: tuple[dict[str, float], list[Rows]] = {"": math.nan}, []  # values and their row
        self.block = max(1, math.ceil(self.times.size / MOST_BLOCKS))

    def first(self, share: float) -> LogModel:
        """The model of the first part of the log: at least four samples of it."""
        count = max(4, math.ceil(share * self.times.size))
        one = copy(self)
        one.log = self.log.first(count)
        one.times = self.times[:count]
        return one

    def plants(self, values: Sequence[Mapping[str, float]]) -> list[Rows]:
        """The rows of the kernel for each set of values."""
        if len(values) == 1 and values[0] == self.last[0]:
            return self.last[1]
        names = {name for row in values for name in row} - {POSITION, DEAD_TIME, FILTER}
        changes = {name: np.array([row[name] for row in values]) for name in names}
        if any(POSITION in row for row in values):
            gaps = np.array([row.get("gap", float(self.drive.gap)) for row in values])
            changes["start_position"] = 0.5 * gaps * np.array([row[POSITION] for row in values])
        elif not changes:
            changes = {"gap": np.full(len(values), float(self.drive.gap))}
        # numbers already, and within their ranges: to read and check them takes longer than the motion
        drive = Columns.of(self.drive)
        vars(drive).update(changes)
        rows = rows_of(drive)
        named = rows.machines.view(MACHINE)[:, 0]
        named["longest"], named["time_limit"] = math.inf, 1e9 + float(self.times[-1])
        each = [rows.taken(slice(i, i + 1)) for i in range(len(values))]
        self.last = dict(values[0]), each[:1]
        return each

    def player(self, values: Mapping[str, float]) -> Controller:
        """What plays the torque of the log."""
        knots, owners = self._knots(values)
        torque = self.log.torque
        if self.error is not None:
            torque = torque + np.repeat(self.error, self.block)[: torque.size] / math.sqrt(self.block)
        return make_controller("profile", {"profile": TorqueProfile(knots, torque[owners])})

    def _knots(self, values: Mapping[str, float]) -> tuple[Vector, NDArray[np.int64]]:
        """The knots of the torque, and to which sample each belongs."""
        times, owners = self.times, np.arange(self.times.size)
        if self.log.torque_is == "demand":
            times, owners = np.repeat(times, 2)[1:], np.repeat(owners, 2)[:-1]
        delay = values.get(DEAD_TIME, self.dead_time)
        if delay > 0.0:
            times, owners = np.append(0.0, times + delay), np.append(0, owners)
        return times, owners

    def signals(self, values: Sequence[Mapping[str, float]]) -> Matrix:
        """What would have been logged under each set of values: a row for each."""
        players = {row.get(DEAD_TIME): self.player(row) for row in values}
        out = np.empty((len(values), self.times.size))
        for i, (row, plant) in enumerate(zip(values, self.plants(values), strict=True)):
            motion, lag = self._motion(plant, players[row.get(DEAD_TIME)]), row.get(FILTER, 0.0)
            if lag > 0.0 and self.log.kind == "speed":
                out[i] = filtered(self._fine, motion.at(self._fine)["w"][:, 0], lag)[::FINE]
            elif self.log.kind == "speed":
                out[i] = motion.at(self.times)["w"][:, 0]
            else:
                out[i] = motion.at(self.times)["phi"][:, 0] - motion.of_shafts(0)[0, 0]
        return out

    def torque_responses(self, values: Mapping[str, float], plant: Rows | None = None) -> Matrix:
        """How the signal moves, a column for each block of samples, per N m of error in the torque there.

        Scaled by 1/sqrt(samples in a block): with independent errors of the samples, the covariance of the
        signal is their variance times this matrix and its transpose. `plant` is the row of these values, if
        it is known.
        """
        plant, lag = self.plants([values])[0] if plant is None else plant, values.get(FILTER, 0.0)
        knots, owners = self._knots(values)
        speed = self.log.kind == "speed"
        smoothed = speed and lag > 0.0
        found = self._motion(plant, self.player(values)).sensitivities(
            knots, marks=self._fine if smoothed else self.times, owners=owners // self.block,
            parts=slice(1, 2) if speed else slice(4, 5),
        )[1][:, 0]  # fmt: skip
        if smoothed:
            found = filtered(self._fine, found.T, lag).T[::FINE]
        found /= math.sqrt(self.block)
        return found

    def states(self, values: Mapping[str, float]) -> dict[str, Vector]:
        """The states at the samples, as `Recorded.at` has them."""
        return self.motion(values).at(self.times)

    def motion(self, values: Mapping[str, float]) -> Recorded:
        """The start under the torque of the log."""
        return self._motion(self.plants([values])[0], self.player(values))

    def _motion(self, plant: Rows, player: Controller) -> Recorded:
        recorder = Recorder(plant, 0, 4 * self.times.size + 256)
        reason = run_one(player, self.drive, recorder, float(self.times[-1]) * (1.0 + 1e-9))
        if reason != ENDED:
            raise SimulationError(f"The start of the log could not be computed (status {reason}).")
        return recorder.finished()

    @property
    def _fine(self) -> Vector:
        count = self.times.size
        fine: Vector = np.interp(np.arange(FINE * (count - 1) + 1) / FINE, np.arange(count), self.times)
        return fine

    def travels(self, values: Sequence[Mapping[str, float]]) -> Matrix:
        """How far the load moves at most under each set of values, and how often the gap opens and closes.

        Seen at events and samples: exact for a reactive load, which turns at events only.
        """
        player, found = self.player({}), np.empty((len(values), 2))
        for row, plant in zip(found, self.plants(values), strict=True):
            motion = self._motion(plant, player)
            angles = motion.states[:, S_PHI]
            row[:] = np.max(np.abs(angles - angles[0])), motion.notes.gap_events
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
