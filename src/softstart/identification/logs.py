"""A log of an inverter: torque, and angle or speed of the motor, over time; read, checked, and made ready."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.input.columns import Wanted, read_columns
from softstart.input.files import read_text, write_whole
from softstart.quantities import RefusedError, show

Kind = Literal["angle", "speed"]
TorqueIs = Literal["demand", "measured"]

COLUMNS: Final = {
    "time": Wanted(("time", "t"), "s"),
    "torque": Wanted(("torque", "u", "demand"), "N*m"),
    "angle": Wanted(("angle", "phi", "position"), "rad"),
    "speed": Wanted(("speed", "w", "omega", "n"), "rad/s"),
}
FEWEST: Final = 30  # samples
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
        _check_times(seconds, name)
        if kind == "angle":
            values = _unwrapped(values, notes)
        values = _without_spikes(values, notes)
        set_field = object.__setattr__
        set_field(self, "time", seconds)
        set_field(self, "torque", torques)
        set_field(self, "values", values)
        set_field(self, "kind", kind)
        set_field(self, "torque_is", torque_is)
        set_field(self, "name", name)
        set_field(self, "count", _count(values))
        self._check_motion()
        rows = int(np.isfinite(values).sum())
        if rows > MOST_ROWS:
            every = math.ceil(rows / MOST_ROWS)
            kept = np.full(values.size, math.nan)
            kept[::every] = values[::every]
            set_field(self, "values", kept)
            notes.append(f"the fit looks at every sample in {every} of the {kind}, and at all of the torque")
        set_field(self, "notes", tuple(notes))

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        columns: Mapping[str, str] | None = None,
        torque_is: TorqueIs = "measured",
    ) -> Log:
        """A log from a CSV file whose first line names the columns, as `time [ms];torque [N*m];speed [rpm]`.

        Parameters
        ----------
        path : str or path
            The file; semicolons, tabs or commas divide the columns, decimal commas are read.
        columns : mapping, optional
            What the file calls time, torque, angle and speed; a name after a minus has the other sign.
        torque_is : {"measured", "demand"}
            As for `Log`.
        """
        where = os.fspath(path)
        given = dict(columns or {})
        unknown = [key for key in given if key not in COLUMNS]
        if unknown:
            raise InputError(
                f"columns: {show(unknown[0])} is no signal of a log; name {', '.join(COLUMNS)}, as "
                "speed=n_act."
            )
        try:
            text = read_text(Path(path))
        except RefusedError as refusal:
            raise InputError(f"log = {where}: {refusal.reason}.") from None
        heading = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
        kinds = [kind for kind in ("angle", "speed") if kind in given] or _kinds_in(heading)
        if len(kinds) != 1:
            found = "both" if kinds else "neither"
            raise InputError(
                f"log = {where}: its first line is {show(heading.strip())}, which names {found} of angle and "
                "speed; write --columns angle=NAME or speed=NAME with the name of one column."
            )
        wanted = ["time", "torque", kinds[0]]
        signs = [-1.0 if given.get(key, "").startswith("-") else 1.0 for key in wanted]
        asked = [
            Wanted((given[key].lstrip("-"),), COLUMNS[key].unit) if key in given else COLUMNS[key]
            for key in wanted
        ]
        _, (time, torque, values) = read_columns(text, f"log = {where}", asked, headed="names", missing=True)
        made: dict[str, Any] = {kinds[0]: signs[2] * values}
        return cls(time, signs[1] * torque, torque_is=torque_is, name=Path(where).name, **made)

    def to_csv(self, path: str | os.PathLike[str], about: str = "") -> None:
        """Write the log to a CSV file that `load` reads; `about` goes into a comment above it."""
        heading = f"time [s],torque [N*m],{self.kind} [{COLUMNS[self.kind].unit}]"
        lines = [*(f"# {line}" for line in about.splitlines()), heading]
        rows = zip(self.time.tolist(), self.torque.tolist(), self.values.tolist(), strict=True)
        lines += [f"{t:.9g},{u:.9g},{'' if math.isnan(value) else f'{value:.12g}'}" for t, u, value in rows]
        write_whole(Path(path), lambda stream: stream.write("\n".join(lines) + "\n"))

    def first(self, count: int) -> Log:
        """The first samples of the log, as they are."""
        one = object.__new__(Log)
        for key, value in vars(self).items():
            object.__setattr__(one, key, value[:count] if isinstance(value, np.ndarray) else value)
        return one

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
        object.__setattr__(one, "notes", (*self.notes, told))
        return one

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
        if abs(first) > 0.2 * fastest:
            raise InputError(
                f"{name}: the motor turns at {first:.3g} rad/s where the log begins; begin the log at "
                "standstill."
            )
        impulse = np.concatenate(
            [[0.0], np.cumsum(0.5 * (self.torque[1:] + self.torque[:-1]) * np.diff(self.time))]
        )
        early = np.abs(impulse[seen]) <= 0.5 * np.max(np.abs(impulse))
        share = slice(0, max(4, int(np.argmin(early)) if not early.all() else early.size))
        if float(np.sum(speed[share] * impulse[seen][share])) < 0.0:
            word = "rises" if float(speed[share][-1]) > 0.0 else "falls"
            side = "below" if word == "rises" else "above"
            raise InputError(
                f"{name}: the {'speed' if kind == 'speed' else 'angle'} {word} where the torque is "
                f"{side} 0; one of "
                "the two has the wrong sign; write --columns torque=-NAME to turn that of the torque round."
            )


def _kinds_in(heading: str) -> list[str]:
    names = {
        part.strip().split("[")[0].split("(")[0].strip().lower() for part in re.split(r"[;\t,]", heading)
    }
    return [kind for kind in ("angle", "speed") if names & {one.lower() for one in COLUMNS[kind].names}]


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


def _check_times(time: Vector, name: str) -> None:
    if time.size < FEWEST:
        raise InputError(f"{name}: {time.size} samples; a fit needs {FEWEST} or more.")
    if not np.isfinite(time).all():
        raise InputError(f"{name}: the time of sample {int(np.argmin(np.isfinite(time))) + 1} is missing.")
    steps = np.diff(time)
    if np.any(steps <= 0.0):
        i = int(np.argmax(steps <= 0.0))
        raise InputError(
            f"{name}: time goes from {time[i]:g} s to {time[i + 1]:g} s at sample {i + 2}; it must rise."
        )
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
