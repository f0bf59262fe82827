"""A log of an inverter: torque, and angle or speed of the motor, over time; read, checked, and made ready."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.input.columns import Wanted, read_columns
from softstart.input.files import ABSENT, FOLDER, read_text, refusal_of, write_whole
from softstart.late import late
from softstart.quantities import RefusedError, nearest, parse, show, to_si

if TYPE_CHECKING:
    import asammdf
else:
    asammdf = late("asammdf")

Kind = Literal["angle", "speed"]
TorqueIs = Literal["demand", "measured"]

COLUMNS: Final = {
    "time": Wanted(("time", "t"), "s"),
    "torque": Wanted(("torque", "u", "demand"), "N*m"),
    "angle": Wanted(("angle", "phi", "position"), "rad"),
    "speed": Wanted(("speed", "w", "omega", "n"), "rad/s"),
    "current": Wanted(("current", "i", "iq"), "A"),
}
MEASUREMENTS: Final = (".mf4", ".mdf", ".dat")  # how names of MDF files end
SAME_INSTANT: Final = 1e-3  # of a sample period: two channels have a sample at the same time
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
        torque_constant: float | str | None = None,
    ) -> Log:
        """A log from a CSV file whose first line names the columns, as `time [ms];torque [N*m];speed [rpm]`.

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
        torque_is : {"measured", "demand"}
            As for `Log`.
        torque_constant : float or str, optional
            Torque over current in N m/A, or with a unit: the file has the current that makes the torque in
            place of it.
        """
        where = os.fspath(path)
        asked = _asked(columns or {})
        constant = None if torque_constant is None else _constant(torque_constant)
        cause = "torque" if constant is None else "current"
        for key in asked:
            if key in ("torque", "current") and key != cause:
                raise InputError(
                    'columns: current: give the torque constant with it, as --torque-constant "1.2 N*m/A".'
                    if constant is None
                    else "columns: torque: with a torque constant the current is read; name it with "
                    "current=, or leave out --torque-constant."
                )
        if where.lower().endswith(MEASUREMENTS):
            found = _from_measurement(where, asked, cause, torque_is == "demand")
        else:
            found = _from_text(where, asked, cause)
        signs = {key: asked[key].sign if key in asked else 1.0 for key in (cause, found.kind)}
        torque = signs[cause] * (1.0 if constant is None else constant) * found.cause
        values: dict[str, Any] = {found.kind: signs[found.kind] * found.values}
        log = cls(found.time, torque, torque_is=torque_is, name=Path(where).name, **values)
        notes = list(found.notes)
        if constant is not None:
            notes.append(f"the torque is {constant:g} N m/A times the current")
        object.__setattr__(log, "notes", (*notes, *log.notes))
        return log

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


class _Asked(NamedTuple):
    """What a file calls a signal: name, sign, and a unit that takes the place of its own."""

    name: str
    sign: float
    unit: str


class _Signals(NamedTuple):
    """Signals of a file in SI: what moves the motor (torque or current), and how it moved."""

    time: Vector
    cause: Vector
    kind: Kind
    values: Vector
    notes: tuple[str, ...] = ()


def _asked(columns: Mapping[str, str]) -> dict[str, _Asked]:
    """The columns as people write them.

    >>> _asked({"speed": "-n_act [rpm]"})
    {'speed': _Asked(name='n_act', sign=-1.0, unit='rpm')}
    """
    found = {}
    for key, text in columns.items():
        if key not in COLUMNS:
            near = nearest(key, COLUMNS)
            hint = f"did you mean {near}?" if near else f"name {', '.join(COLUMNS)}, as speed=n_act."
            raise InputError(f"columns: {show(key)} is no signal of a log; {hint}")
        part = re.fullmatch(r"\s*(-?)\s*(.+?)\s*(?:\[([^\]]*)\])?\s*", text)
        if part is None:
            raise InputError(f"columns: {key} = {show(text)}: write the name of a column, as {key}=NAME.")
        unit = part[3] or ""
        try:
            parse(f"1 {unit}", COLUMNS[key].unit)
        except RefusedError as refusal:
            raise InputError(f"columns: {key} = {show(text)}: {refusal.reason}.") from None
        found[key] = _Asked(part[2], -1.0 if part[1] else 1.0, unit)
    return found


def _constant(given: float | str) -> float:
    value = float(to_si(given, "N*m/A", name="torque_constant"))
    if not value > 0.0:
        raise InputError(
            f"torque_constant = {show(given)}: give a value above 0; a minus before the column turns "
            "the sign."
        )
    return value


def _from_text(where: str, asked: Mapping[str, _Asked], cause: str) -> _Signals:
    """The signals of a CSV file."""
    try:
        text = read_text(Path(where))
    except RefusedError as refusal:
        raise InputError(f"log = {where}: {refusal.reason}.") from None
    heading = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    cells = [part.strip() for part in re.split(r"[;\t,]", heading)]
    names = {part.split("[")[0].split("(")[0].strip().lower() for part in cells}

    def in_heading(key: str) -> bool:
        return bool(names & {one.lower() for one in COLUMNS[key].names})

    kinds = [kind for kind in ("angle", "speed") if kind in asked] or [
        kind for kind in ("angle", "speed") if in_heading(kind)
    ]
    if len(kinds) != 1:
        found = "both" if kinds else "neither"
        raise InputError(
            f"log = {where}: its first line is {show(heading.strip())}, which names {found} of angle and "
            "speed; write --columns angle=NAME or speed=NAME with the name of one column."
        )
    if cause == "torque" and "torque" not in asked and not in_heading("torque") and in_heading("current"):
        raise InputError(
            f"log = {where}: it has a current and no torque; give the torque constant of the motor, as "
            '--torque-constant "1.2 N*m/A".'
        )
    wanted = ["time", cause, kinds[0]]
    own = [Wanted((asked[key].name,), COLUMNS[key].unit) if key in asked else COLUMNS[key] for key in wanted]
    for key in (key for key in wanted if key in asked and asked[key].unit):
        cell = rf"(?<![^;\t,]){re.escape(asked[key].name)}\s*([\[(][^\])]*[\])])?(?=\s*([;\t,]|$))"
        changed = re.sub(cell, lambda _, key=key: f"{asked[key].name} [{asked[key].unit}]", heading)  # type: ignore[misc]
        text = text.replace(heading, changed, 1)
        heading = changed
    _, (time, first, values) = read_columns(text, f"log = {where}", own, headed="names", missing=True)
    return _Signals(time, first, "angle" if kinds[0] == "angle" else "speed", values)


def _from_measurement(where: str, asked: Mapping[str, _Asked], cause: str, held: bool) -> _Signals:
    """The signals of an MDF file; `held`: the torque keeps its value from sample to sample."""
    if (reason := refusal_of(where)) in (ABSENT, FOLDER):
        raise InputError(f"log = {where}: {reason}.")
    if "time" in asked:
        raise InputError("columns: time: each channel of a measurement file has its own; leave time out.")
    try:
        measurement = asammdf.MDF(where)
    except ImportError:
        raise InputError(
            f"log = {where}: measurement files need the package asammdf; install it with "
            '"pip install softstart[mdf]", or write the channels to a CSV file.'
        ) from None
    except Exception as error:  # what its parser meets in a damaged file
        raise InputError(f"log = {where}: this cannot be read as an MDF file ({error}).") from None
    with measurement:
        names = list(measurement.channels_db)

        def called(key: str) -> list[str]:
            known = [asked[key].name] if key in asked else COLUMNS[key].names
            return [name for name in names if name in known] or [
                name for name in names if name.lower() in {one.lower() for one in known}
            ]

        kinds = [kind for kind in ("angle", "speed") if kind in asked] or [
            kind for kind in ("angle", "speed") if called(kind)
        ]
        if len(kinds) != 1:
            raise InputError(
                f"log = {where}: its channels name {'both' if kinds else 'neither'} of angle and speed; "
                f"write --columns angle=NAME or speed=NAME; there are {_few(names)}."
            )
        read = {}
        for key in (cause, kinds[0]):
            one = called(key)
            if len(one) != 1 or len(measurement.whereis(one[0])) != 1:
                name = asked[key].name if key in asked else key
                many = "more than one channel" if one else "no channel"
                raise InputError(
                    f"log = {where}: {many} is called {show(name)}; write --columns {key}=NAME; there are "
                    f"{_few(names)}."
                )
            read[key] = _channel(measurement.get(one[0]), where, key, asked)
    (times, first), (instants, values) = read[cause], read[kinds[0]]
    kind: Kind = "angle" if kinds[0] == "angle" else "speed"
    if np.array_equal(times, instants):
        return _Signals(times, first, kind, values)
    time, torque, values = _together(times, first, instants, values, held, where)
    told = f"{cause} and {kind} are sampled at different instants; the torque between its samples is "
    return _Signals(time, torque, kind, values, (told + ("held" if held else "straight"),))


def _few(names: list[str]) -> str:
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def _channel(
    signal: asammdf.Signal, where: str, key: str, asked: Mapping[str, _Asked]
) -> tuple[Vector, Vector]:
    """Instants in s and values in SI of a channel."""
    unit = (asked[key].unit if key in asked else "") or signal.unit or ""
    wanted = COLUMNS[key].unit
    try:
        factor = float(parse(f"1 {unit}" if unit else 1.0, wanted))
        values = np.asarray(signal.samples, dtype=np.float64)
        times = np.asarray(signal.timestamps, dtype=np.float64)
        if values.ndim != 1 or values.size < FEWEST:
            raise RefusedError(f"it has values of the shape {values.shape}, and a fit needs {FEWEST} or more")
    except RefusedError as refusal:
        raise InputError(
            f"log = {where}: channel {signal.name}: {refusal.reason}; a unit of your own is given with "
            f'--columns "{key}={signal.name} [{wanted}]".'
        ) from None
    except (TypeError, ValueError):
        raise InputError(f"log = {where}: channel {signal.name} holds text, and no numbers.") from None
    _check_times(times, f"{where}, {signal.name}")
    return times, factor * values


def _together(
    times: Vector, torque: Vector, instants: Vector, values: Vector, held: bool, where: str
) -> tuple[Vector, Vector, Vector]:
    """Both signals at the instants of both; values are NaN where they have no sample.

    >>> t, u, y = _together(np.arange(3.0), np.array([1.0, 2.0, 4.0]), np.array([0.0, 1.5, 2.0]),
    ...     np.array([0.0, 5.0, 9.0]), False, "here")
    >>> t.tolist(), u.tolist(), y.tolist()
    ([0.0, 1.0, 1.5, 2.0], [1.0, 2.0, 3.0, 4.0], [0.0, nan, 5.0, 9.0])
    """
    near = SAME_INSTANT * min(float(np.median(np.diff(times))), float(np.median(np.diff(instants))))
    closest = instants[np.clip(np.searchsorted(instants, times - near), 0, instants.size - 1)]
    times = np.where(np.abs(closest - times) <= near, closest, times)
    first, last = max(times[0], instants[0]), min(times[-1], instants[-1])
    if not first < last:
        raise InputError(f"log = {where}: torque and motion were not logged at the same time.")
    time = np.union1d(times, instants)
    time = time[(time >= first) & (time <= last)]
    if held:
        joined = torque[np.searchsorted(times, time, side="right") - 1]
    else:
        joined = np.interp(time, times, torque)
    seen = np.full(time.size, math.nan)
    inside = (instants >= first) & (instants <= last)
    seen[np.searchsorted(time, instants[inside])] = values[inside]
    return time, joined, seen


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
