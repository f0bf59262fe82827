"""What the exact plant would have logged: signals at the samples, and their response to torque errors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.controller import Controller, make_controller
from softstart.drive import Drive
from softstart.drive.machine_table import DriveColumns
from softstart.errors import SimulationError
from softstart.identification.logs import Log
from softstart.kernel.records import ENDED, MACHINE
from softstart.profile import TorqueProfile
from softstart.start.engine import run_one
from softstart.start.kernel_input import KernelInput, kernel_input
from softstart.start.trajectory import StartRecorder, Trajectory

POSITION: Final = "position"  # where in the gap a log begins, from -1 (opposite flank) to 1 (driving flank)
DEAD_TIME: Final = "computing_delay"
FILTER: Final = "speed_filter"  # time constant of the filter through which a speed was logged
SUBSAMPLES: Final = 4  # instants in each sample period at which a filter sees the speed
MOST_BLOCKS: Final = 600  # of the torque error along a log
WIDE_LIMIT: Final = (
    1e3  # times the largest torque logged: no limit of the drive cuts a torque that was measured
)


def without_limits(log: Log) -> dict[str, Any]:
    """The changes to a motor that make it follow the torque of a log: wide limits, no encoder.

    A measured torque has the lag of the motor in its samples already.
    """
    limit = WIDE_LIMIT * max(float(np.max(np.abs(log.torque))), 1e-300)
    wide = {
        "starting_torque": limit, "maximum_torque": limit, "minimum_torque": -limit, "encoder_lines": 0.0,
    }  # fmt: skip
    lag = {"torque_lag": 0.0, "torque_rate": math.inf, "computing_delay": 0.0}
    return wide | (lag if log.torque_is == "measured" else {})


def knots_of(log: Log, delay: float = 0.0) -> tuple[Vector, NDArray[np.int64]]:
    """The knots of the torque, a time `delay` later, and to which sample each belongs.

    Straight lines through the samples of a measured torque; a demand is held from one sample to the next.
    """
    times, owners = log.time - log.time[0], np.arange(log.time.size)
    if log.torque_is == "demand":
        times, owners = np.repeat(times, 2)[1:], np.repeat(owners, 2)[:-1]
    if delay > 0.0:
        times, owners = np.append(0.0, times + delay), np.append(0, owners)
    return times, owners


@dataclass(frozen=True, eq=False)
class LogModel:
    """The drive under the torque of a log: its motor angle or speed at the instants of the samples.

    The demand of a log passes through the plant's lag, rate limit and dead time. Parameters may be any of a
    `Drive`, `POSITION` and `FILTER`. A torque error has one number for each `block` of samples, scaled by
    1/sqrt(block): independent errors of the samples have the same standard deviation as these.
    """

    log: Log  # an angle counted from its first sample, so that its zero is nowhere in the fit
    guess: Drive
    drive: Drive  # the guess without limits
    dead_time: float
    block: int
    rows: NDArray[np.bool_]  # the samples that count,
    values: Vector  # what they tell,
    root: Vector  # and the deviations of what encoder or log round

    @classmethod
    def of(cls, log: Log, drive: Drive, most_blocks: int = MOST_BLOCKS) -> LogModel:
        """The model of a log of this drive."""
        wide = drive.replace(**without_limits(log), brake="none")
        block = max(1, math.ceil(log.time.size / most_blocks))
        rows = np.isfinite(log.values)
        if log.kind == "angle":
            log = log.changed(values=log.values - log.values[rows][0])
        values = log.values[rows]
        if log.kind == "angle" and log.count:
            values, variance = encoder_edges(log.time[rows], values, log.count)
            counts = np.isfinite(variance)
            rows[rows], values, root = counts, values[counts], np.sqrt(variance[counts])
        else:
            root = np.full(values.size, max(log.count / math.sqrt(12.0), 1e-3 * log.scale))
        delay = float(wide.computing_delay)
        return cls(log, drive, wide.replace(computing_delay=0.0), delay, block, rows, values, root)

    def first(self, share: float) -> LogModel:
        """The model of the first part of the log, at least four samples of it, all weighted alike."""
        log = self.log.first(max(4, math.ceil(share * self.times.size)))
        rows = self.rows[: log.time.size]
        count = int(rows.sum())
        root = np.full(count, log.scale or self.log.scale)  # a motor may be at rest at first
        return replace(self, log=log, rows=rows, values=self.values[:count], root=root)

    @property
    def times(self) -> Vector:
        """Instants of the samples after the first, s."""
        return np.asarray(self.log.time - self.log.time[0])

    @property
    def blocks(self) -> int:
        """How many numbers a torque error has."""
        return math.ceil(self.log.time.size / self.block)

    def signals(self, values: Sequence[Mapping[str, float]], error: Vector | None = None) -> Matrix:
        """What would have been logged under each set of values and this torque error: a row for each."""
        out = np.empty((len(values), self.times.size))
        for i, (row, motion) in enumerate(zip(values, self.motions(values, error), strict=True)):
            if self.log.kind == "angle":
                out[i] = motion.at(self.times)["phi"][:, 0] - motion.of_shafts("twist")[0, 0]
            elif lag := row.get(FILTER, 0.0):
                out[i] = filtered(self._fine, motion.at(self._fine)["w"][:, 0], lag)[::SUBSAMPLES]
            else:
                out[i] = motion.at(self.times)["w"][:, 0]
        return out

    def responses(self, values: Mapping[str, float], error: Vector | None = None) -> Matrix:
        """D signal/d error, a row for each sample and a column for each block, about this torque error."""
        knots, owners = knots_of(self.log, values.get(DEAD_TIME, self.dead_time))
        lag = values.get(FILTER, 0.0)  # of a speed
        response = self.motion(values, error).sensitivities(
            knots, marks=self._fine if lag else self.times, owners=owners // self.block,
            parts=slice(1, 2) if self.log.kind == "speed" else slice(4, 5),
        )[1][:, 0]  # fmt: skip
        if lag:
            response = filtered(self._fine, response.T, lag).T[::SUBSAMPLES]
        return np.asarray(response / math.sqrt(self.block))

    def motion(self, values: Mapping[str, float], error: Vector | None = None) -> Trajectory:
        """The start under the torque of the log and this error of it."""
        return next(self.motions([values], error))

    def motions(
        self, values: Sequence[Mapping[str, float]], error: Vector | None = None
    ) -> Iterator[Trajectory]:
        """The start with each set of values."""
        players = {row.get(DEAD_TIME): self._player(row, error) for row in values}
        for row, plant in zip(values, self._plants(values), strict=True):
            recorder = StartRecorder(plant, 0, 4 * self.times.size + 256)
            until = float(self.times[-1]) * (1.0 + 1e-9)
            reason = run_one(players[row.get(DEAD_TIME)], self.drive, recorder, until)
            if reason != ENDED:
                raise SimulationError(f"The start of the log could not be computed (status {reason}).")
            yield recorder.finished()

    def _plants(self, values: Sequence[Mapping[str, float]]) -> list[KernelInput]:
        """The rows of the kernel for each set of values."""
        names = {name for row in values for name in row} - {POSITION, DEAD_TIME, FILTER}
        changes = {name: np.array([row[name] for row in values]) for name in names}
        if any(POSITION in row for row in values):
            gaps = np.array([row.get("gap", float(self.drive.gap)) for row in values])
            changes["start_position"] = 0.5 * gaps * np.array([row[POSITION] for row in values])
        elif not changes:
            changes = {"gap": np.full(len(values), float(self.drive.gap))}
        # numbers already, and within their ranges: to read and check them takes longer than the motion
        drive = DriveColumns.of(self.drive)
        vars(drive).update(changes)
        rows = kernel_input(drive)
        named = rows.machines.view(MACHINE)[:, 0]
        named["longest"], named["time_limit"] = math.inf, 1e9 + float(self.times[-1])
        return [rows.take(slice(i, i + 1)) for i in range(len(values))]

    def _player(self, values: Mapping[str, float], error: Vector | None) -> Controller:
        """What plays the torque of the log."""
        knots, owners = knots_of(self.log, values.get(DEAD_TIME, self.dead_time))
        torque = self.log.torque
        if error is not None:
            torque = torque + np.repeat(error, self.block)[: torque.size] / math.sqrt(self.block)
        return make_controller("profile", {"profile": TorqueProfile(knots, torque[owners])})

    @property
    def _fine(self) -> Vector:
        count = self.times.size
        return np.interp(np.arange(SUBSAMPLES * (count - 1) + 1) / SUBSAMPLES, np.arange(count), self.times)


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


def encoder_edges(time: Vector, angle: Vector, count: float) -> tuple[Vector, Vector]:
    """What an encoder tells in each sample: the angle and its variance, infinite where others tell it.

    Samples on one count have nearly the same error while the motor creeps, and together they tell one thing:
    when the count ended. In the last of them the motor was before that edge by less than it then moved to the
    next sample: by half of that on average, and uniformly about it. How far it moves follows from the times
    to the neighbouring edges, the shorter of which is taken for the variance. Faster samples, the first and
    the last are rounded numbers, of the variance count^2/12. All this depends on the log alone: weights that
    follow the fitted motion find the torque error of a coarse start too small.

    >>> angle, variance = encoder_edges(np.arange(7.0), np.array([0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0]), 1.0)
    >>> angle.round(2).tolist(), (12.0 * variance).round(2).tolist()
    ([0.0, 0.21, 1.0, 1.28, 2.0, 2.0, 2.0], [1.0, 0.44, inf, 0.25, inf, inf, 1.0])
    """
    angles, variance = angle.copy(), np.full(angle.size, math.inf)
    ends = np.flatnonzero(np.abs(np.diff(angle)) > 0.5 * count)
    variance[[0, -1]] = count**2 / 12.0
    if ends.size == 0:
        return angles, variance
    steps, passed = angle[ends + 1] - angle[ends], time[ends + 1] - time[ends]
    at = np.concatenate([[time[0]], 0.5 * (time[ends] + time[ends + 1]), [time[-1]]])
    before, after = np.diff(at)[:-1], np.diff(at)[1:]
    moved = 2.0 * count * passed / np.maximum(before + after, 1e-300)
    most = np.minimum(count * passed / np.maximum(np.minimum(before, after), 1e-300), count)
    single = (np.abs(steps) < 1.5 * count) & (moved < count)
    inner = np.where(single, 0.5 * (count - moved), 0.0)
    angles[ends] += np.sign(steps) * inner
    variance[ends] = np.where(single, most, count) ** 2 / 12.0
    return angles, variance
