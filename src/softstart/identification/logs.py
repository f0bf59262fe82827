"""A log of an inverter: torque, and angle or speed of the motor, over time; read, checked, and made ready."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.identification.traces import COLUMNS, FEWEST, Kind, asked_columns, check_times, read_signals
from softstart.input.files import write_whole
from softstart.quantities import show, to_si

TorqueIs = Literal["demand", "measured"]

MOST_ROWS: Final = 1000  # samples of angle or speed that the fit looks at
LEAST_COUNT: Final = 1e-5  # of the largest difference: a smaller step is rounding
SPIKE: Final = 15.0  # times the usual distance from the line through the neighbours
HOLE: Final = 20.0  # typical sample periods without a sample
TURN: Final = 2.0 * math.pi


@dataclass(frozen=True, eq=False, init=False)
class Log:
    """What an inverter logged of one start: the motor's torque and its angle or speed.

    The log begins while the drive stands still. An angle that wraps at a full turn is unwrapped. A step that
    all differences of the values are multiples of is taken for what the encoder, or the log, rounds to.

    Parameters
    ----------
    time : array_like, shape (n,)
        Instants of the samples in s, rising, evenly spaced or not.
    torque : array_like, shape (n,)
        Motor torque in N m at these instants.
    angle : array_like, shape (n,), optional
        Angle of the motor in rad; NaN where it is missing.
    speed : array_like, shape (n,), optional
        Speed of the motor in rad/s, in place of the angle; NaN where it is missing.
    torque_is : {"measured", "demand"}
        "measured": straight lines join the samples of the torque. "demand": each is held until the next, and
        the motor's torque follows with the lag of the drive.
    name : str
        What sentences call it.

    Raises
    ------
    InputError
        For times that do not rise, too few samples, a hole, a motor that turns at the beginning, a torque or
        a motion that is zero throughout, and a torque whose sign is not that of the motion.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(100) * 1e-3
    >>> log = Log(t, np.full(100, 40.0), angle=900.0 * t**2.1, torque_is="demand")
    >>> log.kind, log.count
    ('angle', 0.0)
    >>> Log(t, np.full(100, -40.0), speed=1000.0 * t)
    Traceback (most recent call last):
    softstart.errors.InputError: log: the speed rises where the torque is below 0; one of the two has the ...

    References
    ----------
    docs/identification.md.
    """

    time: Vector
    torque: Vector
    values: Vector  # the angle or the speed
    kind: Kind
    torque_is: TorqueIs
    name: str
    count: float  # rad or rad/s; 0 where none is seen
    notes: tuple[str, ...] = field(default=())

    def __init__(
        self,
        time: ArrayLike,
        torque: ArrayLike,
        *,
        angle: ArrayLike | None = None,
        speed: ArrayLike | None = None,
        torque_is: TorqueIs = "measured",
        name: str = "log",
    ) -> None:
        if (angle is None) == (speed is None):
            raise InputError(f"{name}: give the angle of the motor or its speed, one of the two.")
        if torque_is not in ("measured", "demand"):
            raise InputError(f'{name}: torque_is = {show(torque_is)}: write "measured" or "demand".')
        kind: Kind = "speed" if angle is None else "angle"
        given = {"time": time, "torque": torque, kind: speed if angle is None else angle}
        columns = {key: np.array(value, dtype=np.float64) for key, value in given.items()}
        for key, column in columns.items():
            if column.ndim != 1 or column.size != columns["time"].size:
                raise InputError(f"{name}: {key} has the shape {column.shape}; give one number a sample.")
        seconds, torques, values = columns.values()
        notes: list[str] = []
        torques = _whole(torques, seconds, name, notes)
        check_times(seconds, name)
        _check_holes(seconds, name)
        if kind == "angle":
            values = _unwrapped(values, notes)
        values = _without_spikes(values, notes)
        vars(self).update(
            time=seconds, torque=torques, values=values, kind=kind, torque_is=torque_is, name=name,
            count=_count(values),
        )  # fmt: skip
        self._check_motion()
        rows = int(np.isfinite(values).sum())
        if rows > MOST_ROWS:
            every = math.ceil(rows / MOST_ROWS)
            values = np.where(np.arange(values.size) % every == 0, values, math.nan)
            notes.append(f"the fit looks at every sample in {every} of the {kind}, and at all of the torque")
        vars(self).update(values=values, notes=tuple(notes))

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        columns: Mapping[str, str] | None = None,
        torque_is: TorqueIs = "measured",
        torque_constant: float | str | None = None,
        rated_torque: float | str | None = None,
    ) -> Log:
        """A log from a CSV file whose first line names the columns, as `time [ms];torque [N*m];speed [rpm]`.

        Names, units and the sample time may also stand in lines of a preamble, and each column may have times
        of its own to its left, as scopes of inverters write it.

        Also from a measurement file, MDF 3 or 4 (`.mf4`, `.mdf`, `.dat`), by the package `asammdf`. Its
        channels may be sampled at different instants: the torque, which is straight or constant between its
        samples, is then known at all of them.

        Parameters
        ----------
        path : str or path
            The file; semicolons, tabs or commas divide the columns, decimal commas are read.
        columns : mapping, optional
            What the file calls time, torque (or current), angle and speed; a name after a minus has the other
            sign, and a unit in brackets behind it takes the place of that of the file: `-n_act [rpm]`.
            A torque may be in %, or in 0.1 %.
        torque_is : {"measured", "demand"}
            As for `Log`.
        torque_constant : float or str, optional
            Torque over current in N m/A, or with a unit: the file has the current that makes the torque in
            place of it.
        rated_torque : float or str, optional
            The torque at 100 % in N m, or with a unit, where the file has it in %.
        """
        where = os.fspath(path)
        asked = asked_columns(columns or {})
        rated = None if rated_torque is None else _above_0("rated_torque", rated_torque, "N*m")
        constant = None if torque_constant is None else _above_0("torque_constant", torque_constant, "N*m/A")
        cause = "torque" if constant is None else "current"
        for key in asked:
            if key in ("torque", "current") and key != cause:
                raise InputError(
                    'columns: current: give the torque constant with it, as --torque-constant "1.2 N*m/A".'
                    if constant is None
                    else "columns: torque: with a torque constant the current is read; name it with "
                    "current=, or leave out --torque-constant."
                )
        found = read_signals(where, asked, cause, rated, held=torque_is == "demand")
        signs = {key: asked[key].sign if key in asked else 1.0 for key in (cause, found.kind)}
        torque = signs[cause] * (1.0 if constant is None else constant) * found.cause
        values: dict[str, Any] = {found.kind: signs[found.kind] * found.values}
        log = cls(found.time, torque, torque_is=torque_is, name=Path(where).name, **values)
        notes = list(found.notes)
        if constant is not None:
            notes.append(f"the torque is {constant:g} N m/A times the current")
        return log.changed(notes=(*notes, *log.notes))

    def to_csv(self, path: str | os.PathLike[str], about: str = "") -> None:
        """Write the log to a CSV file that `load` reads; `about` goes into a comment above it."""
        heading = f"time [s],torque [N*m],{self.kind} [{COLUMNS[self.kind].unit}]"
        lines = [*(f"# {line}" for line in about.splitlines()), heading]
        rows = zip(self.time.tolist(), self.torque.tolist(), self.values.tolist(), strict=True)
        lines += [f"{t:.9g},{u:.9g},{'' if math.isnan(value) else f'{value:.12g}'}" for t, u, value in rows]
        write_whole(Path(path), lambda stream: stream.write("\n".join(lines) + "\n"))

    @classmethod
    def planned(cls, time: Vector, torque: Vector, kind: Kind) -> Log:
        """A demand whose motion is not known yet."""
        blank = object.__new__(cls)
        return blank.changed(
            time=time, torque=torque, values=np.zeros(time.size), kind=kind, torque_is="demand", name="plan",
            count=0.0, notes=(),
        )  # fmt: skip

    def changed(self, **fields: Any) -> Log:
        """The log with other fields, which are not checked again."""
        one = object.__new__(Log)
        vars(one).update(vars(self) | fields)
        return one

    def first(self, count: int) -> Log:
        """The first samples of the log, as they are."""
        return self.changed(time=self.time[:count], torque=self.torque[:count], values=self.values[:count])

    def summed(self, lines: float) -> Log:
        """The angle, if the speed is the difference of the counts of an encoder with so many lines.

        A speed in steps of count/period is: its rounding errors then cancel from sample to sample, which the
        angle tells. Any other log stays as it is.
        """
        steps = np.diff(self.time)
        period = float(np.median(steps))
        even = float(np.ptp(steps)) <= 1e-6 * period and bool(np.isfinite(self.values).all())
        if self.kind != "speed" or not even or not lines or not self.count:
            return self
        if abs(self.count * period / (TURN / (4.0 * lines)) - 1.0) > 0.01:
            return self
        angle = np.concatenate([[0.0], np.cumsum(self.values[1:] * steps)])
        one = Log(self.time, self.torque, angle=angle, torque_is=self.torque_is, name=self.name)
        told = "the speed is the difference of encoder counts, and was summed to the angle"
        return one.changed(notes=(*self.notes, told))

    @property
    def floor(self) -> float:
        """Standard deviation of what the encoder rounds."""
        return self.count / math.sqrt(12.0)

    @property
    def scale(self) -> float:
        """A residual that is small: a count, or a ten-thousandth of the largest value."""
        return max(
            self.count,
            1e-4 * float(np.nanmax(np.abs(self.values - self.values[np.isfinite(self.values)][0]))),
        )

    def _check_motion(self) -> None:
        name, kind = self.name, self.kind
        seen = np.isfinite(self.values)
        if int(seen.sum()) < FEWEST:
            raise InputError(
                f"{name}: {int(seen.sum())} samples of the {kind}; a fit needs {FEWEST} or more."
            )
        if not np.any(self.torque):
            raise InputError(f"{name}: the torque is 0 in every sample; log the torque of the motor with it.")
        time, values = self.time[seen], self.values[seen]
        speed = values if kind == "speed" else np.gradient(values, time)
        fastest = float(np.max(np.abs(speed)))
        if fastest == 0.0:
            raise InputError(f"{name}: the {kind} never changes; log a start in which the motor moves.")
        first = speed[0] if kind == "speed" else (values[1] - values[0]) / (time[1] - time[0])
        one = self.count if kind == "speed" else self.count / (time[1] - time[0])  # a motor at rest may be
        if abs(first) - 1.01 * one > 0.2 * fastest:  # just below the next count
            raise InputError(
                f"{name}: the motor turns at {first:.3g} rad/s where the log begins; begin the log at "
                "standstill."
            )
        impulse = np.concatenate(
            [[0.0], np.cumsum(0.5 * (self.torque[1:] + self.torque[:-1]) * np.diff(self.time))]
        )
        # before half the impulse and half the speed: a motor that hits the flank of a load at rest flies back
        early = (np.abs(impulse[seen]) <= 0.5 * np.max(np.abs(impulse))) & (np.abs(speed) <= 0.5 * fastest)
        share = slice(0, max(4, int(np.argmin(early)) if not early.all() else early.size))
        if float(np.sum(speed[share] * impulse[seen][share])) < 0.0:
            word = "rises" if float(speed[share][-1]) > 0.0 else "falls"
            side = "below" if word == "rises" else "above"
            raise InputError(
                f"{name}: the {'speed' if kind == 'speed' else 'angle'} {word} where the torque is "
                f"{side} 0; one of "
                "the two has the wrong sign; write --columns torque=-NAME to turn that of the torque round."
            )


def _above_0(name: str, given: float | str, unit: str) -> float:
    value = float(to_si(given, unit, name=name))
    if not value > 0.0:
        raise InputError(
            f"{name} = {show(given)}: give a value above 0; a minus before the column turns the sign."
        )
    return value


def _whole(torque: Vector, time: Vector, name: str, notes: list[str]) -> Vector:
    """The torque with single missing samples filled by straight lines."""
    missing = ~np.isfinite(torque)
    if not missing.any():
        return torque
    runs = np.diff(np.flatnonzero(np.concatenate([[True], ~missing, [True]])))
    if int(runs.max()) > 3 or missing[0] or missing[-1]:
        raise InputError(
            f"{name}: {int(missing.sum())} samples of the torque are missing, more than two in a row "
            "or at an end; what moves the drive must be known; cut the log there."
        )
    notes.append(
        f"{int(missing.sum())} missing samples of the torque lie on straight lines between their neighbours"
    )
    return np.interp(time, time[~missing], torque[~missing])


def _check_holes(time: Vector, name: str) -> None:
    steps = np.diff(time)
    typical = float(np.median(steps))
    if float(steps.max()) > HOLE * typical:
        i = int(np.argmax(steps))
        raise InputError(
            f"{name}: there is no sample from {time[i]:g} s to {time[i + 1]:g} s, and every "
            f"{typical:g} s elsewhere; "
            "the torque in between is not known; cut the log there, and give the parts that begin at "
            "standstill."
        )


def _unwrapped(angle: Vector, notes: list[str]) -> Vector:
    """The angle without jumps by a full turn."""
    seen = np.isfinite(angle)
    values = angle[seen]
    if (
        values.size < 2
        or float(np.ptp(values)) > TURN * 1.001
        or float(np.max(np.abs(np.diff(values)))) < 0.6 * TURN
    ):
        return angle
    notes.append("the angle wraps at a full turn and was unwrapped")
    whole = angle.copy()
    whole[seen] = np.unwrap(values)
    return whole


def _without_spikes(values: Vector, notes: list[str]) -> Vector:
    """The values without single samples that lie far off the line through their neighbours."""
    off = np.zeros(values.size)
    off[1:-1] = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    seen = np.isfinite(off)
    usual = 1.5 * float(np.median(np.abs(off[seen]))) + _count(values)
    beside = 0.5 * (np.roll(off, 1) + np.roll(off, -1))
    # a spike of the height h is h off its own line and -h/2 off those of its neighbours
    spikes = seen & (np.abs(off) > SPIKE * usual) & (np.abs(beside + 0.5 * off) < 0.15 * np.abs(off))
    if not spikes.any() or int(spikes.sum()) > 0.02 * values.size + 1:
        return values
    number = int(spikes.sum())
    were = "s lie far off their neighbours and were" if number > 1 else " lies far off its neighbours and was"
    notes.append(f"{number} sample{were} left out")
    return np.where(spikes, math.nan, values)


def _count(values: Vector) -> float:
    """The step that all differences of the values are multiples of; 0 if there is none.

    >>> _count(np.array([0.0, 0.7, 2.1, 3.5, 3.5, 9.1, 14.0, 14.7, 16.8, 17.5, 18.9])).__round__(12)
    0.7
    """
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    largest = float(steps.max(initial=0.0))
    steps = steps[steps > 1e-9 * largest]
    if steps.size < 8:
        return 0.0
    count = 0.0
    for step in steps.tolist():  # Euclid's greatest common divisor, but for rounding
        one, other = max(step, count), min(step, count)
        while other > LEAST_COUNT * largest:
            one, other = other, one - other * round(one / other)
            other = abs(other)
        count = one
        if count < 5.0 * LEAST_COUNT * largest:
            return 0.0
    multiples = np.round(steps / count)
    count = float(np.sum(steps) / np.sum(multiples))
    return count if float(np.max(np.abs(steps / count - multiples))) < 0.05 else 0.0
