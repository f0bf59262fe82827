"""A log of an inverter: torque, and angle or speed of the motor, over time; read from CSV, and checked."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_trapezoid

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.identification.log_files import SIGNALS, read_log
from softstart.input.files import write_whole
from softstart.quantities import show

Kind = Literal["angle", "speed"]
TorqueIs = Literal["demand", "measured"]

FEWEST: Final = 30  # samples
MOST_ROWS: Final = 1000  # samples of angle or speed that the fit looks at
LEAST_COUNT: Final = 1e-5  # of the largest difference: a smaller step is rounding
HOLE: Final = 20.0  # typical sample periods without a sample
TURN: Final = 2.0 * math.pi
WIDTHS: Final = range(8, 65)  # bits of a counter
TICKS: Final = (1.0, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # of a clock, s
DAY: Final = 86400.0
COARSE: Final = 0.01  # of the duration: stamps rounded to more do not tell the sample period


@dataclass(frozen=True, eq=False, init=False)
class Log:
    """What an inverter logged of one start: the motor's torque and its angle or speed.

    The log begins while the drive stands still; angle and clock may begin anywhere. An angle that wraps, at
    full turns or where a counter overflows, is unwrapped; a clock too. A step that all differences of the
    values are multiples of is taken for what the encoder, or the log, rounds to. A sample that is there twice
    counts once; other samples with one time stamp are spread evenly, if stamps of even samples would be
    rounded like that.

    Parameters
    ----------
    time : array_like, shape (n,)
        Instants of the samples in s, rising, evenly spaced or not.
    torque : array_like, shape (n,)
        Motor torque in N m at these instants.
    angle, speed : array_like, shape (n,), optional
        Angle of the motor in rad, or its speed in rad/s: one of the two; NaN where it is missing.
    torque_is : {"measured", "demand"}
        "measured": straight lines join the samples of the torque. "demand": each is held until the next, and
        the motor's torque follows with the lag of the drive.
    name : str
        What sentences call it.

    Raises
    ------
    InputError
        For times that do not rise, too few samples, a hole, a motor that turns at the beginning, a torque or
        a motion that is zero throughout, an angle that jumps, and a torque whose sign is not that of the
        motion.

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
    """

    time: Vector
    torque: Vector
    values: Vector  # the angle or the speed
    kind: Kind
    torque_is: TorqueIs
    name: str
    count: float  # rad or rad/s; 0 where none is seen
    notes: tuple[str, ...] = field(default=())
    sign: float = 1.0  # -1 where torque and motion were inverted

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
        arrays = {"time": time, "torque": torque, kind: speed if angle is None else angle}
        columns = {key: np.array(value, dtype=np.float64) for key, value in arrays.items()}
        for key, column in columns.items():
            if column.ndim != 1 or column.size != columns["time"].size:
                raise InputError(f"{name}: {key} has the shape {column.shape}; give one number a sample.")
            if key != kind and not np.isfinite(column).all():
                i = int(np.argmin(np.isfinite(column)))
                raise InputError(f"{name}: the {key} of sample {i + 1} is missing; cut the log there.")
        notes: list[str] = []
        columns["time"] = _unwrapped_clock(columns["time"], notes)
        columns = _spread_evenly(_without_repeats(columns, notes), notes)
        seconds, torques, values = columns.values()
        _check_times(seconds, name)
        seen = np.isfinite(values)
        if kind == "angle":
            values[seen] = _unwrapped(seconds[seen], values[seen], name, notes)
        vars(self).update(
            time=seconds, torque=torques, values=values, kind=kind, torque_is=torque_is, name=name,
            count=_resolution(np.diff(values[seen])),
        )  # fmt: skip
        self._check_motion()
        every = math.ceil(int(seen.sum()) / MOST_ROWS)
        if every > 1:
            values[np.arange(values.size) % every != 0] = math.nan
            notes.append(f"the fit looks at every sample in {every} of the {kind}, and at all of the torque")
        vars(self).update(notes=tuple(notes))

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *,
        columns: Mapping[str, str] | None = None,
        torque_is: TorqueIs = "measured",
    ) -> Log:
        """A log from a CSV file whose heading names the columns, as `time [ms];torque [N*m];speed [rpm]`.

        The heading is the line of names above the numbers, and a line of units below it if there is one; or
        a block with a line for each property of the channels, as scopes write it. What stands above or
        between is passed over. Times may be times of day. A motion without a unit is refused, unless a column
        beside it tells the unit; a torque without one is taken for N m, a time for s, ms or us, and the notes
        say so.

        Parameters
        ----------
        path : str or path
            The file; semicolons, tabs, commas or spaces divide the columns, decimal commas are read.
        columns : mapping, optional
            What the file calls time, torque, angle and speed, as `-n_act [rpm]`: a minus turns the sign, and
            a unit in brackets takes the place of that of the file. A factor before the name makes a torque of
            a current, or an angle of counts: `1.2*iq [N*m]`, `1/4096*pos [turn]`. A share has its whole in
            the brackets: `M_act [% of 35 N*m]`.
        torque_is : {"measured", "demand"}
            As for `Log`.
        """
        values, notes = read_log(os.fspath(path), columns or {})
        log = cls(torque_is=torque_is, name=Path(path).name, **values)
        return log.changed(notes=(*notes, *log.notes))

    def to_csv(self, path: str | os.PathLike[str], about: str = "") -> None:
        """Write the log to a CSV file that `load` reads; `about` goes into a comment above it."""
        heading = f"time [s],torque [N*m],{self.kind} [{SIGNALS[self.kind].unit}]"
        lines = [*(f"# {line}" for line in about.splitlines()), heading]
        rows = zip(self.time.tolist(), self.torque.tolist(), self.values.tolist(), strict=True)
        lines += [f"{t:.9g},{u:.9g},{'' if math.isnan(value) else f'{value:.12g}'}" for t, u, value in rows]
        write_whole(Path(path), lambda stream: stream.write("\n".join(lines) + "\n"))

    @classmethod
    def planned(cls, time: Vector, torque: Vector, kind: Kind = "angle") -> Log:
        """A demand whose motion is not known yet."""
        blank = object.__new__(cls)
        return blank.changed(
            time=time, torque=torque, values=np.zeros(time.size), kind=kind, torque_is="demand", name="plan",
            count=0.0, notes=(),
        )  # fmt: skip

    def changed(self, **fields: object) -> Log:
        """The log with other fields, which are not checked again."""
        log = object.__new__(Log)
        vars(log).update(vars(self) | fields)
        return log

    def first(self, count: int) -> Log:
        """The first samples of the log, as they are."""
        return self.changed(time=self.time[:count], torque=self.torque[:count], values=self.values[:count])

    def forward(self) -> Log:
        """The log with torque and motion inverted, if the motor first turns backward."""
        if float(np.sum(self.speed_and_impulse[0][self._early])) >= 0.0:
            return self
        note = "the drive first turns backward; torque and motion were both inverted"
        return self.changed(
            torque=-self.torque, values=-self.values, sign=-self.sign, notes=(*self.notes, note)
        )

    def integrated(self, lines: float) -> Log:
        """The angle, if the speed is the difference of the counts of an encoder with so many lines.

        A speed in steps of count/period is: its rounding errors then cancel from sample to sample, which the
        angle tells. Any other log stays as it is.
        """
        steps = np.diff(self.time)
        period = float(np.median(steps))
        rounding = 4.0 * np.spacing(np.max(np.abs(self.time)))  # of a clock that counts from 1970
        even = float(np.ptp(steps)) <= 1e-6 * period + rounding and bool(np.isfinite(self.values).all())
        counts = self.count * period / TURN * 4.0 * lines
        if self.kind != "speed" or not even or abs(counts - 1.0) > 0.01:
            return self
        angle = np.concatenate([[0.0], np.cumsum(self.values[1:] * steps)])
        log = Log(self.time, self.torque, angle=angle, torque_is=self.torque_is, name=self.name)
        note = "the speed is a difference of encoder counts and was integrated to the angle"
        return log.changed(notes=(*self.notes, note))

    @property
    def scale(self) -> float:
        """A residual that is small: a count, or a ten-thousandth of the largest value."""
        first = self.values[np.isfinite(self.values)][0]
        return max(self.count, 1e-4 * float(np.nanmax(np.abs(self.values - first))))

    @property
    def speed_and_impulse(self) -> tuple[Vector, Vector]:
        """Speed of the motor, and impulse of its torque until then, N m s, in the samples of the motion."""
        seen = np.isfinite(self.values)
        speed = self.values[seen]
        if self.kind == "angle":
            speed = np.gradient(speed, self.time[seen])
        return speed, cumulative_trapezoid(self.torque, self.time, initial=0.0)[seen]

    @property
    def _early(self) -> slice:
        """The samples of the motion before half the impulse and half the speed.

        Later a motor that hits the flank of a load at rest may fly back.
        """
        speed, impulse = map(np.abs, self.speed_and_impulse)
        early = (impulse <= 0.5 * np.max(impulse)) & (speed <= 0.5 * np.max(speed))
        return slice(0, max(4, int(np.argmin(early)) if not early.all() else early.size))

    def _check_motion(self) -> None:
        name, kind = self.name, self.kind
        seen = np.isfinite(self.values)
        if int(seen.sum()) < FEWEST:
            raise InputError(f"{name}: {int(seen.sum())} samples of the {kind}; a fit needs {FEWEST}.")
        if not np.any(self.torque):
            raise InputError(f"{name}: the torque is 0 in every sample; log the torque of the motor with it.")
        speed, impulse = self.speed_and_impulse
        fastest = float(np.max(np.abs(speed)))
        if fastest == 0.0:
            raise InputError(f"{name}: the {kind} never changes; log a start in which the motor moves.")
        period = float(np.diff(self.time[seen])[0])
        first = float(speed[0])
        step = self.count if kind == "speed" else self.count / period  # a motor at rest may be
        if abs(first) - 1.01 * step > 0.2 * fastest:  # just below the next count
            raise InputError(
                f"{name}: the motor turns at {first:.3g} rad/s where the log begins; begin the log at "
                "standstill."
            )
        share = self._early
        if float(np.sum(speed[share] * impulse[share])) < 0.0:
            word, side = ("rises", "below") if float(speed[share][-1]) > 0.0 else ("falls", "above")
            raise InputError(
                f"{name}: the {kind} {word} where the torque is {side} 0; one of the two has the wrong sign; "
                "set columns to torque=-NAME to change that of the torque."
            )


def _check_times(time: Vector, name: str) -> None:
    if time.size < FEWEST:
        raise InputError(f"{name}: {time.size} samples; a fit needs {FEWEST} or more.")
    steps = np.diff(time)
    if np.any(steps <= 0.0):
        i = int(np.argmax(steps <= 0.0))
        raise InputError(f"{name}: time does not rise at sample {i + 2}: {time[i]:g} s, {time[i + 1]:g} s.")
    i, typical = int(np.argmax(steps)), float(np.median(steps))
    if steps[i] > HOLE * typical:
        raise InputError(
            f"{name}: there is no sample from {time[i]:g} s to {time[i + 1]:g} s, and every {typical:g} s "
            "elsewhere; the torque in between is not known; cut the log there, and give the parts that begin "
            "at standstill."
        )


def _without_repeats(columns: dict[str, Vector], notes: list[str]) -> dict[str, Vector]:
    """The columns without samples that repeat the one before, if all that share its time stamp do.

    Where some of them differ, the stamps are coarse, and a motor at rest has equal samples in them.
    """
    rows = np.array(list(columns.values()))
    equal = np.isclose(rows[:, 1:], rows[:, :-1], rtol=0.0, atol=0.0, equal_nan=True)
    again = np.append(False, equal.all(axis=0))
    if not again.any() or np.any(equal[0] & ~again[1:]):
        return columns
    count = int(again.sum())
    notes.append(f"{count} sample{'s' * (count > 1)} repeated the one before and {_were(count)} left out")
    return {key: column[~again] for key, column in columns.items()}


def _were(count: int) -> str:
    return "were" if count > 1 else "was"


def _unwrapped_clock(time: Vector, notes: list[str]) -> Vector:
    """Times that go on where a counter of ticks overflowed, or a clock passed midnight."""
    back = np.diff(time) < -0.5 * float(np.ptp(time)) if time.size > 2 else np.zeros(0, dtype=bool)
    if int(back.sum()) != 1:
        return time
    others = np.diff(time)[~back]
    width = _counter_range(time, back, TICKS, 0.5 * float(np.median(others)), DAY)
    if width is None:
        return time
    notes.append(f"the clock wraps at {width:.7g} s and was unwrapped")
    return time + width * np.append(0, np.cumsum(back))


def _spread_evenly(columns: dict[str, Vector], notes: list[str]) -> dict[str, Vector]:
    """Columns whose samples share time stamps, spread over even times that are rounded to such stamps."""
    time = columns["time"]
    steps = np.diff(time)
    if np.all(steps > 0.0) or np.any(steps < 0.0) or not steps.any():
        return columns
    stamp, index = _resolution(steps), np.arange(time.size)
    period, start = np.polyfit(index, time - time[0], 1)
    even = time[0] + start + period * index
    # even times that were rounded, down or to the nearest, lie within a stamp about a line
    if not 0.0 < stamp < COARSE * (time[-1] - time[0]) or float(np.ptp(even - time)) > 1.25 * stamp:
        return columns
    notes.append(
        f"the time stamps are rounded to {stamp:.4g} s, and several samples share one: they were spread "
        f"evenly, one each {period:.4g} s"
    )
    return columns | {"time": even}


def _unwrapped(time: Vector, values: Vector, name: str, notes: list[str]) -> Vector:
    """An angle without the jumps of a counter that overflows, or of an encoder that counts within a turn."""
    steps = np.diff(values)
    least = float(np.min(np.abs(steps), where=steps != 0.0, initial=math.inf))
    # a motor that turns by a few counts of its encoder jumps by one of them
    jumps = np.abs(steps) > max(0.5 * float(np.ptp(values)), 4.0 * least)
    if not jumps.any():
        return values
    count = _resolution(steps[~jumps])
    width = _counter_range(values, jumps, (count,), 2.5 * count, TURN)
    if width is None:
        i = int(np.argmax(jumps))
        raise InputError(
            f"{name}: the angle jumps from {values[i]:.6g} to {values[i + 1]:.6g} rad at {time[i + 1]:g} s, "
            "and neither full turns nor the overflow of a counter explain it; cut the log there, or make the "
            "angle continuous."
        )
    turns = width / TURN
    what = f"{turns:.0f} full turns" if abs(turns - round(turns)) < 1e-5 else f"{width:.7g} rad"
    notes.append(f"the angle wraps at {'a full turn' if round(turns, 5) == 1 else what} and was unwrapped")
    return np.unwrap(values, period=width)


def _counter_range(
    values: Vector, jumps: NDArray[np.bool_], units: Sequence[float], room: float, other: float
) -> float | None:
    """The range of a counter that overflows at these jumps: a power of two of a unit, or times `other`.

    It is a jump and the step that stood in its place, which is that of the neighbours, to within `room` and
    the difference of those neighbours; and it holds all values.

    >>> counts = np.array([65000.0, 65300.0, 64.0, 364.0, 664.0])
    >>> _counter_range(counts, np.array([False, True, False, False]), [1.0], 2.5, 360.0)
    65536.0
    """
    steps, places = np.diff(values), np.flatnonzero(~jumps)
    if not places.size:
        return None
    at = np.flatnonzero(jumps)
    nearest_before = steps[places[np.maximum(np.searchsorted(places, at) - 1, 0)]]
    nearest_after = steps[places[np.minimum(np.searchsorted(places, at), places.size - 1)]]
    widths = np.abs(steps[at] - 0.5 * (nearest_before + nearest_after))
    width = float(np.median(widths))
    room = max(room, float(np.median(np.abs(nearest_after - nearest_before))), 1e-6 * width)
    known = [*(unit * 2.0**bits for unit in units for bits in WIDTHS), other * max(1, round(width / other))]
    fits = [
        candidate
        for candidate in known
        if abs(candidate - width) <= room and candidate > (1.0 - 1e-9) * float(np.ptp(values))
    ]
    return min(fits, key=lambda candidate: abs(candidate - width), default=None)


def _resolution(steps: Vector) -> float:
    """The step that all of these are multiples of; 0 if there is none.

    >>> _resolution(np.diff([0.0, 0.7, 2.1, 3.5, 3.5, 9.1, 14.0, 14.7, 16.8, 17.5, 18.9])).__round__(12)
    0.7
    """
    steps = np.abs(steps)
    largest = float(steps.max(initial=0.0))
    steps = steps[steps > 1e-9 * largest]
    if steps.size < 8:
        return 0.0
    count = 0.0
    for step in steps.tolist():  # Euclid's greatest common divisor, but for rounding
        larger, smaller = max(step, count), min(step, count)
        while smaller > LEAST_COUNT * largest:
            larger, smaller = smaller, abs(larger - smaller * round(larger / smaller))
        count = larger
        if count < 5.0 * LEAST_COUNT * largest:
            return 0.0
    multiples = np.round(steps / count)
    count = float(np.sum(steps) / np.sum(multiples))
    return count if float(np.max(np.abs(steps / count - multiples))) < 0.05 else 0.0
