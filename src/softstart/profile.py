"""A torque over time: the form of an optimum, what the `profile` controller follows, and its files.

CSV and TOML are read back to the last bit; C code is for a target.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.input.columns import Wanted, read_columns
from softstart.input.documents import literal, parsed
from softstart.input.files import read_text, write_whole
from softstart.input.parameters import Wording
from softstart.quantities import RefusedError, show, to_si
from softstart.results import OneLine

MOST_SAMPLES = 1_000_000
HEADER = "time [s],torque [N*m]"
TIME = Wanted(("time", "t"), "s")
TORQUE = Wanted(("torque", "u", "demand"), "N*m")
TABLES = ("controller", "profile", "after_contact", "about")
KEYS = ("time", "torque", "time_unit", "torque_unit")
PER_LINE = 4

Knots = tuple[str, Vector, Vector]  # where they are in a file, for errors; times in s, torques in N m


@dataclass(frozen=True, eq=False, init=False, repr=False)
class TorqueProfile(OneLine):
    """A torque demand that is linear between its knots; two knots at the same instant are a step.

    After the last knot the last torque is held.

    Parameters
    ----------
    time : array_like, shape (n,)
        Instants of the knots in s, from 0 on and not falling.
    torque : array_like, shape (n,)
        Torque demands in N m at these instants.
    after_contact : TorqueProfile, optional
        A second profile, on a clock that starts when the gap first closes; it takes over there (a drive that
        detects the contact). None follows the first one to its end.

    Raises
    ------
    InputError
        If the lists are not of one length, hold values that are not finite, or the times fall.

    Examples
    --------
    >>> pulse = TorqueProfile([0.0, 0.25, 0.25, 1.0], [62.0, 62.0, 0.0, 48.0])
    >>> pulse.at([0.0, 0.25, 0.5, 2.0]).tolist()
    [62.0, 0.0, 16.0, 48.0]
    """

    time: Vector
    torque: Vector
    after_contact: TorqueProfile | None = None

    def __init__(
        self, time: ArrayLike, torque: ArrayLike, after_contact: TorqueProfile | None = None
    ) -> None:
        time, torque = _vector("time", time), _vector("torque", torque)
        if time.size != torque.size:
            raise InputError(
                f"profile: {time.size} times for {torque.size} torques; give one torque for each time."
            )
        if time[0] != 0.0:
            raise InputError(f"profile: its first time is {time[0]:g} s; a profile begins at 0 s.")
        falling = np.flatnonzero(np.diff(time) < 0.0)
        if falling.size:
            i = int(falling[0])
            raise InputError(
                f"profile: time falls from {time[i]:g} s to {time[i + 1]:g} s at knot {i + 2}; "
                "give the knots in order of time."
            )
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "torque", torque)
        object.__setattr__(self, "after_contact", after_contact)

    @property
    def end(self) -> float:
        """Instant of the last knot, s."""
        return float(self.time[-1])

    def at(self, times: ArrayLike) -> Vector:
        """Torque demand at any instants; at a step the value after it.

        Parameters
        ----------
        times : array_like
            Instants in s.

        Returns
        -------
        ndarray
            Torque demands in N m, in the shape of `times`.
        """
        when = np.asarray(times, dtype=np.float64)
        last = np.searchsorted(self.time, when, side="right") - 1
        last = last.clip(0, self.time.size - 1)
        after = np.minimum(last + 1, self.time.size - 1)
        width = self.time[after] - self.time[last]
        share = np.where(width > 0.0, (when - self.time[last]) / np.where(width > 0.0, width, 1.0), 0.0)
        values: Vector = self.torque[last] + share * (self.torque[after] - self.torque[last])
        return values

    @classmethod
    def steps(cls, edges: ArrayLike, levels: ArrayLike) -> TorqueProfile:
        """Constant torque `levels[i]` from `edges[i]` to `edges[i + 1]`; the last level is then held.

        Parameters
        ----------
        edges : array_like, shape (n + 1,)
            Instants in s at which the torque changes, from 0 on.
        levels : array_like, shape (n,)
            Torques in N m in between.

        Examples
        --------
        >>> TorqueProfile.steps([0.0, 0.01, 0.02], [62.0, 0.0]).at([0.005, 0.01, 3.0]).tolist()
        [62.0, 0.0, 0.0]
        """
        at, held = np.asarray(edges, dtype=np.float64), np.asarray(levels, dtype=np.float64)
        if at.size != held.size + 1:
            raise InputError(f"profile: {held.size} levels need {held.size + 1} edges, not {at.size}.")
        return cls(np.repeat(at, 2)[1:-1], np.repeat(held, 2)).simplified()

    def simplified(self, tolerance: float = 1e-12) -> TorqueProfile:
        """The same torque with as few knots as it needs (within `tolerance` of its largest torque).

        >>> TorqueProfile([0.0, 0.1, 0.2, 0.2], [1.0, 1.0, 1.0, 1.0]).simplified().time.tolist()
        [0.0]
        """
        allowed = tolerance * float(np.max(np.abs(self.torque), initial=1e-300))
        time, torque = self.time.tolist(), self.torque.tolist()  # items of arrays are slow

        def straight(i: int, j: int, k: int) -> bool:
            """Whether knot j lies on the line from i to k."""
            if time[j] in (time[i], time[k]):
                return bool(time[i] == time[k])  # the middle one of three at the same instant
            line = torque[i] + (torque[k] - torque[i]) * (time[j] - time[i]) / (time[k] - time[i])
            return bool(abs(line - torque[j]) <= allowed)

        kept = [0]
        for i in range(1, len(time)):
            if time[i] == time[kept[-1]] and abs(torque[i] - torque[kept[-1]]) <= allowed:
                continue
            if len(kept) >= 2 and straight(kept[-2], kept[-1], i):
                kept.pop()
            kept.append(i)
        if len(kept) >= 2 and abs(torque[kept[-1]] - torque[kept[-2]]) <= allowed:
            kept.pop()
        return TorqueProfile(self.time[kept], self.torque[kept], self.after_contact)

    def clipped(self, lowest: float, highest: float) -> TorqueProfile:
        """The same torque cut off at the limits, with knots where its lines cross them.

        >>> TorqueProfile([0.0, 1.0], [-10.0, 30.0]).clipped(0.0, 20.0).time.tolist()
        [0.0, 0.25, 0.75, 1.0]
        """
        after = None if self.after_contact is None else self.after_contact.clipped(lowest, highest)
        if self.torque.min() >= lowest and self.torque.max() <= highest:
            return TorqueProfile(self.time, self.torque, after)
        times, torques = [float(self.time[0])], [float(self.torque[0])]
        for t, u in zip(self.time[1:].tolist(), self.torque[1:].tolist(), strict=True):
            start, before = times[-1], torques[-1]
            crossings = []
            for limit in (lowest, highest):
                if min(before, u) < limit < max(before, u) and t > start:
                    crossings.append(((limit - before) / (u - before), limit))
            for share, limit in sorted(crossings):
                times.append(min(start + share * (t - start), t))
                torques.append(limit)
            times.append(t)
            torques.append(u)
        return TorqueProfile(times, np.clip(torques, lowest, highest), after)

    def sampled(self, period: float) -> TorqueProfile:
        """Held from sample to sample, at the mean of this profile until the next sample.

        Its integral is that of this profile at every sample; `after_contact` is sampled on its own clock.

        Parameters
        ----------
        period : float
            Sample period in s.

        Raises
        ------
        InputError
            For more than a million samples.

        Examples
        --------
        >>> TorqueProfile([0.0, 1.0], [0.0, 10.0]).sampled(0.5).at([0.0, 0.5, 1.0]).tolist()
        [2.5, 7.5, 10.0]
        """
        after = None if self.after_contact is None else self.after_contact.sampled(period)
        share = self.end / period
        if not share <= MOST_SAMPLES:
            raise InputError(
                f"period = {period:g} s: that is {share:.3g} samples until the profile ends at "
                f"{self.end:g} s, and at most {MOST_SAMPLES:,} are allowed; give a longer one, or 0 for none."
            )
        count = math.ceil(share)
        samples = np.arange(count + 1) * period
        edges = np.unique(np.concatenate([samples, self.time[self.time < samples[-1]]]))
        middle = self.at(0.5 * (edges[:-1] + edges[1:]))  # straight in between: the mean of each piece
        first = np.searchsorted(edges, samples[:-1])
        impulse = np.add.reduceat(middle * np.diff(edges), first) if count else np.zeros(0)
        levels = np.append(impulse / np.diff(samples), self.torque[-1])
        return TorqueProfile(np.repeat(samples, 2)[1:], np.repeat(levels, 2)[:-1], after)

    def followed_by(self, end: float, tail: TorqueProfile) -> TorqueProfile:
        """The profile up to `end`, then `tail` on a clock that starts there.

        >>> TorqueProfile([0.0], [5.0]).followed_by(1.0, TorqueProfile([0.0], [2.0])).at([0.5, 1.0]).tolist()
        [5.0, 2.0]
        """
        before = self.time < end
        left = self._just_before(end)
        return TorqueProfile(
            np.concatenate([self.time[before], [end], end + tail.time]),
            np.concatenate([self.torque[before], [left], tail.torque]),
            self.after_contact,
        )

    def _just_before(self, t: float) -> float:
        """The torque as t is approached from below."""
        i = int(np.searchsorted(self.time, t, side="left")) - 1
        if i < 0:
            return float(self.torque[0])
        if i + 1 >= self.time.size:
            return float(self.torque[-1])
        share = (t - self.time[i]) / (self.time[i + 1] - self.time[i])
        return float(self.torque[i] + share * (self.torque[i + 1] - self.torque[i]))

    def to_csv(self, path: str | Path) -> None:
        """Write time and torque as CSV, 17 digits: read back, each number has the same bits.

        InputError for a profile with `after_contact`.
        """
        if self.after_contact is not None:
            raise InputError(
                f"output = {path}: a CSV file has no place for what is played after the contact; "
                "write this profile as TOML."
            )

        def write(stream: IO[str]) -> None:
            table = np.column_stack([self.time, self.torque])
            np.savetxt(stream, table, delimiter=",", header=HEADER, comments="", fmt="%.17g")

        write_whole(Path(path), write)

    def toml_text(self, about: Mapping[str, object] | None = None) -> str:
        """TOML that the `profile` controller follows; `about` says where the profile comes from.

        >>> TorqueProfile.read(TorqueProfile([0.0, 0.1], [20.0, 62.0]).toml_text(), ".toml").end
        0.1
        """
        parts = [
            "# A torque profile: softstart simulate DRIVE --controller profile --param file=THIS_FILE",
            '[controller]\nname = "profile"',
            _table("profile", self),
        ]
        if self.after_contact is not None:
            parts.append(_table("after_contact", self.after_contact))
        if about:
            lines = [f"{_text_literal(key)} = {_text_literal(value)}" for key, value in about.items()]
            parts.append("\n".join(["[about]", *lines]))
        return "\n\n".join(parts) + "\n"

    def to_toml(self, path: str | Path, about: Mapping[str, object] | None = None) -> None:
        """Write `toml_text` into a file."""
        write_whole(Path(path), lambda stream: stream.write(self.toml_text(about)))

    def to_c(
        self, path: str | Path, name: str = "torque_profile", about: Mapping[str, object] | None = None
    ) -> None:
        """Write C code for a target: `double name(double time)`, N m over s, tables and a bisection.

        At a step it gives the value after it, behind the last knot the last torque, as `at` does. A profile
        with `after_contact` has a second function `name_after_contact`, on a clock that starts there. `about`
        goes into the comment on top. Raises InputError for a name that C does not take.
        """
        if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name):
            raise InputError(f'name = "{name}": a C function is named with letters, digits and single _.')
        after = self.after_contact
        functions = {name: self} | ({} if after is None else {f"{name}_after_contact": after})
        notes = [" ".join(f"{key}: {value}".split()) for key, value in (about or {}).items()]
        notes += [
            f"double {f}(double time);  {p.time.size} knots to {p.end:g} s" for f, p in functions.items()
        ]
        # */ would end the comment
        text = C_HEADER % "".join(f"   {note.replace('*/', '* /')}\n" for note in notes)
        for function, p in functions.items():
            time, torque = (_rows(map(repr, values.tolist()), "{", "}") for values in (p.time, p.torque))
            text += C_FUNCTION % {"name": function, "n": p.time.size, "time": time, "torque": torque}
        write_whole(Path(path), lambda stream: stream.write(text))

    @classmethod
    def load(cls, path: str | Path) -> TorqueProfile:
        """Read a profile from CSV or TOML.

        Parameters
        ----------
        path : str or Path
            A file whose name ends in .csv, .txt, .dat or .toml.

        Raises
        ------
        InputError
            In one sentence that names the file, the place and the value.
        """
        where, suffix = f"profile = {path}", Path(path).suffix.lower()
        if suffix not in (".toml", ".csv", ".txt", ".dat"):
            raise InputError(f"{where}: its kind is unknown; give a file whose name ends in .csv or .toml.")
        try:
            return cls.read(read_text(Path(path)), suffix, where)
        except RefusedError as refusal:
            raise InputError(f"{where}: {refusal.reason}.") from None

    @classmethod
    def read(cls, text: str, suffix: str = ".csv", where: str = "profile") -> TorqueProfile:
        """A profile from the text of a file whose name ends in `suffix`; `where` begins each sentence.

        >>> TorqueProfile.read("time,torque\\n0,20\\n0.1,62\\n").torque.tolist()
        [20.0, 62.0]
        """
        profile = None
        if suffix == ".toml":
            parts = _from_toml(text, where)
        else:
            time, torque = read_columns(text, where, (TIME, TORQUE)).values
            parts = [(where, time, torque)]
        for place, time, torque in reversed(parts):  # what follows the contact is a part of the first one
            try:
                profile = cls(time, torque, profile)
            except InputError as error:
                reasons = [sentence.removeprefix("profile: ") for sentence in error.sentences]
                raise InputError([f"{place}: {reason}" for reason in reasons]) from None
        assert profile is not None  # a file without knots was refused
        return profile

    def heat(self, until: float, reference: float) -> float:
        """I2t heat in s: the integral of (torque/reference)^2 from 0 to `until`; torque as demanded."""
        edges = np.unique(np.concatenate([self.time[self.time < until], [0.0, until]]))
        a = self.at(edges[:-1])
        b = np.array([self._just_before(float(t)) for t in edges[1:]])
        return float(np.sum(np.diff(edges) * (a * a + a * b + b * b)) / (3.0 * reference**2))


def _vector(name: str, values: object) -> Vector:
    try:
        vector = np.array(values, dtype=np.float64) + 0.0  # in which -0.0 is 0.0
    except (TypeError, ValueError):
        raise InputError(f"profile: its {name} is {values!r}; give a list of numbers.") from None
    if vector.ndim != 1 or vector.size == 0:
        raise InputError(f"profile: its {name} has shape {vector.shape}; give a list of one or more numbers.")
    if not np.isfinite(vector).all():
        raise InputError(f"profile: its {name} holds a value that is not finite; give finite numbers.")
    vector.setflags(write=False)
    return vector


# files ---------------------------------------------------------------------------------------------------


def _table(name: str, profile: TorqueProfile) -> str:
    columns = {"time": profile.time, "torque": profile.torque}
    lines = (f"{key} = {_rows(map(literal, values.tolist()))}" for key, values in columns.items())
    return "\n".join([f"[{name}]", *lines])


def _rows(numbers: Iterable[str], begin: str = "[", end: str = "]") -> str:
    """The numbers of a list, a few a line."""
    texts = list(numbers)
    rows = (", ".join(texts[i : i + PER_LINE]) for i in range(0, len(texts), PER_LINE))
    return f"{begin}\n" + "".join(f"    {row},\n" for row in rows) + end


def _text_literal(value: object) -> str:
    return literal(str(value).encode("utf-8", "replace").decode("utf-8"))


def _from_toml(text: str, where: str) -> list[Knots]:
    """From the tables [profile] and, if there, [after_contact]: lists `time` in s and `torque` in N m.

    `time_unit` and `torque_unit` name other units.
    """
    document = parsed(text, Wording(where, style="toml"), "a profile")
    if unknown := [key for key in document if key not in TABLES]:
        tables = ", ".join(f"[{name}]" for name in TABLES)
        raise InputError(f"{where}: a profile has no {show(unknown[0])}; its tables are {tables}.")
    controller = document.get("controller", {})
    name = controller.get("name", "profile") if isinstance(controller, dict) else controller
    if name != "profile":
        raise InputError(
            f'{where}: it is for the controller {show(name)}; a torque profile has name = "profile".'
        )
    if "profile" not in document:
        raise InputError(f"{where}: it has no table [profile]; write one with the lists time and torque.")
    parts = [part for part in ("profile", "after_contact") if part in document]
    return [_knots(f"{where}: [{part}]", document[part]) for part in parts]


def _knots(where: str, table: object) -> Knots:
    if not isinstance(table, dict):
        raise InputError(f"{where} = {show(table)}: write a table with the lists time and torque.")
    if unknown := [key for key in table if key not in KEYS]:
        raise InputError(f"{where} has no key {show(unknown[0])}; it has {', '.join(KEYS)}.")
    columns = []
    for key, si in (("time", "s"), ("torque", "N*m")):
        values, unit = table.get(key), table.get(f"{key}_unit", si)
        if not isinstance(values, list):
            shown = f"{key} = {show(values)}" if key in table else f"{key} is missing"
            raise InputError(f"{where} {shown}: write a list of numbers, {key} = [0.0, 0.1].")
        size = to_si([f"1 {unit}"], si, name=f"{where} {key}_unit")
        columns.append(np.atleast_1d(to_si(values, si, name=f"{where} {key}")) * size)
    return where, columns[0], columns[1]


C_HEADER = """/* Torque demand in N m over time in s, straight lines between knots. Generated by softstart.

%s
   At a step the value is the one after it; behind the last knot the last torque is held.
   The clock begins with the start, that of ..._after_contact where the gap first closes. */
"""
C_FUNCTION = """
double %(name)s(double time) {
  static const double t[%(n)d] = %(time)s;
  static const double u[%(n)d] = %(torque)s;
  int low = 0, high = %(n)d - 1;
  if (time >= t[high]) return u[high];
  if (time <= t[0]) time = t[0];
  while (high - low > 1) {  /* t[low] <= time < t[high] */
    int middle = low + (high - low) / 2;
    if (t[middle] <= time) low = middle; else high = middle;
  }
  return u[low] + (time - t[low]) / (t[high] - t[low]) * (u[high] - u[low]);
}
"""
