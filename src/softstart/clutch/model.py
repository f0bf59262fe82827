"""`Clutch`: a slipping clutch whose driving side turns at constant speed, a shaft and a load behind it."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Self, cast

import numpy as np

from softstart.clutch.laws import LAWS, Law, LawKind, shaped_law, table_law
from softstart.errors import InputError
from softstart.input.documents import Table, document_text, read_document, read_table
from softstart.input.files import Library
from softstart.input.parameters import Parameter
from softstart.quantities import nearest, show

WHAT = "a clutch"
LIBRARY = Library("softstart.clutch", "a clutch", "clutches")

PARAMETERS = (
    Parameter("name", "", "name of the clutch", '"my clutch"', default="unnamed clutch"),
    Parameter("source", "", "source of the numbers", '"data sheet"', default="not given"),
    Parameter(
        "inertia", "kg*m^2", "inertia IM of the clutch side", '"0.98 kg*m^2"', "above 0", table="clutch",
        name="clutch_inertia",
    ),
    Parameter(
        "torque", "N*m", "friction torque MM of the engaged clutch", '"588 N*m"', "above 0", table="clutch",
        name="clutch_torque",
    ),
    Parameter(
        "speed", "rad/s", "constant speed w0 of the driving side", '"230 rad/s"', "above 0", table="clutch",
        name="drive_speed",
    ),
    Parameter(
        "engagement_time", "s", "time tM in which the friction torque rises", '"1 s"', "above 0",
        table="clutch",
    ),
    Parameter(
        "lining_area", "m^2", "area of all friction faces", '"0.05 m^2"', "above 0", default=None,
        table="clutch",
    ),
    Parameter("stiffness", "N*m/rad", "stiffness cp of the shaft", '"49 N*m/rad"', "above 0", table="shaft"),
    Parameter(
        "damping", "N*m*s/rad", "damping of the shaft", '"0.5 N*m*s/rad"', "0 or more", default=0.0,
        table="shaft",
    ),
    Parameter("gap", "rad", "total angular gap", '"0.02 rad"', "0 or more", default=0.0, table="shaft"),
    Parameter(
        "inertia", "kg*m^2", "inertia Ic of the load", '"4.9 kg*m^2"', "above 0", table="load",
        name="load_inertia",
    ),
    Parameter(
        "torque", "N*m", "torque Mc of the load", '"196 N*m"', "0 or more", table="load", name="load_torque",
    ),
    Parameter(
        "kind", "", "kind of the load torque", '"active"', default="active", choices=("active", "reactive"),
        table="load", name="load_kind",
    ),
    Parameter(
        "kind", "", "engagement law", '"linear"', default="linear", choices=(*LAWS, "table"), table="law",
        name="law",
    ),
    Parameter(
        "time_constant", "s", "time constant of the exponential law", '"1 s"', default=1.0, table="law",
    ),
    Parameter(
        "times", "s", "instants of the table", "[0, 0.5, 1]", "0 or more", default=None, many=True,
        table="law", name="law_times",
    ),
    Parameter(
        "torques", "N*m", "friction torques of the table", "[0, 200, 588]", "0 or more", default=None,
        many=True, table="law", name="law_torques",
    ),
)  # fmt: skip

TABLES = tuple(
    Table(table, tuple(p for p in PARAMETERS if p.table == table), required=table != "law")
    for table in ("", "clutch", "shaft", "load", "law")
)
KEYWORDS = Table("", PARAMETERS)

ABOVE = 1.0 + 1e-9  # a table may exceed MM by rounding
SLOWEST, FASTEST = 1e-9, 1e9  # 1/s: beyond, the 24th power of a rate overflows


@dataclass(frozen=True)
class Clutch:
    """A slipping clutch with constant driving speed, a shaft and a load: [C] (1).

    All values are numbers in SI, or text with a unit.

    Parameters
    ----------
    clutch_inertia : float
        IM, inertia of the clutch side, kg m^2.
    clutch_torque : float
        MM, friction torque of the engaged clutch, N m.
    drive_speed : float
        w0, constant speed of the driving side, rad/s.
    engagement_time : float
        tM, time in which the friction torque rises, s.
    stiffness : float
        cp, stiffness of the shaft, N m/rad.
    load_inertia : float
        Ic, inertia of the load, kg m^2.
    load_torque : float
        Mc, torque of the load, N m.
    lining_area : float, optional
        Area of all friction faces, m^2.
    damping : float, optional
        Damping of the shaft, N m s/rad.
    gap : float, optional
        Total angular gap (backlash) of the shaft, rad.
    load_kind : str, optional
        "active" (acts always, may turn the load back) or "reactive" (friction: holds the load at rest).
    law : str, optional
        Engagement law: "linear", "quadratic-concave", "quadratic-convex", "exponential" or "table".
    time_constant : float, optional
        Time constant of the exponential law, s.
    law_times, law_torques : tuple of float, optional
        Points of the table: s, N m.
    name, source : str, optional
        Name of the clutch, and source of its numbers.

    Raises
    ------
    InputError
        If any value is wrong; with one sentence for each.

    References
    ----------
    [C] (1); see docs/paper-c.md.

    Examples
    --------
    >>> clutch = Clutch.load("paper-c")
    >>> round(clutch.clutch_torque, 3), round(clutch.mean_torque / clutch.clutch_torque, 6)
    (588.399, 0.888889)
    >>> clutch.replace(stiffness=-1, law="linaer")
    Traceback (most recent call last):
    softstart.errors.InputError: stiffness = -1: the stiffness cp of the shaft must be above 0.
    law = "linaer": the engagement law is "linear", ... or "table"; did you mean "linear"?
    """

    clutch_inertia: float
    clutch_torque: float
    drive_speed: float
    engagement_time: float
    stiffness: float
    load_inertia: float
    load_torque: float
    lining_area: float | None = None
    damping: float = 0.0
    gap: float = 0.0
    load_kind: str = "active"
    law: str = "linear"
    time_constant: float = 1.0
    law_times: tuple[float, ...] | None = None
    law_torques: tuple[float, ...] | None = None
    name: str = "unnamed clutch"
    source: str = "not given"

    def __post_init__(self) -> None:
        given = {p.name: getattr(self, p.name) for p in PARAMETERS}
        for name, value in read_table(given, KEYWORDS).items():
            object.__setattr__(self, name, tuple(value.tolist()) if isinstance(value, np.ndarray) else value)
        wrong = self._mistakes()
        if wrong:
            raise InputError(wrong)

    # making one -------------------------------------------------------------------------------------------

    @classmethod
    def load(cls, clutch: str | os.PathLike[str], also: Mapping[str, object] | None = None) -> Self:
        """A shipped clutch by its name, or the TOML file at this path; `also` as in `from_toml`.

        >>> Clutch.load("paper-d")
        Traceback (most recent call last):
        softstart.errors.InputError: "paper-d": there is no such file, and no shipped clutch of this name;
        did you mean paper-c?
        """
        text, where = LIBRARY.find(clutch)
        return cls.from_toml(text, where=where, also=also)

    @classmethod
    def from_toml(cls, text: str, where: str = "", also: Mapping[str, object] | None = None) -> Self:
        """A clutch from the tables [clutch], [shaft], [load] and [law] of a text.

        `where` is put before each sentence; `also` holds changes by path, as {"load.torque": "100 N*m"}.
        """
        found = read_document(text, TABLES, WHAT, where=where, also=also)
        values = {
            p.name: found[p.table][p.key]
            for p in PARAMETERS
            if found[p.table] is not None and p.key in found[p.table]
        }
        try:
            return cls(**values)
        except InputError as error:
            before = f"{where}: " if where else ""
            raise InputError([f"{before}{sentence}" for sentence in error.sentences]) from None

    def replace(self, **changes: Any) -> Self:
        """A clutch with some parameters changed, checked like a new one."""
        known = [p.name for p in PARAMETERS]
        strays = [
            f"{name} = {show(value)}: a clutch has no such parameter; "
            + (f"did you mean {near}?" if (near := nearest(name, known)) else f"it has {', '.join(known)}.")
            for name, value in changes.items()
            if name not in known
        ]
        if strays:
            raise InputError(strays)
        return dataclasses.replace(self, **changes)

    def with_table(self, times: Sequence[float], torques: Sequence[float]) -> Self:
        """The clutch with a law of its own: friction torques (N m) at instants (s), joined by lines."""
        return self.replace(law="table", law_times=list(times), law_torques=list(torques))

    # what follows from it ---------------------------------------------------------------------------------

    @cached_property
    def friction(self) -> Law:
        """The friction torque over time."""
        if self.law == "table":
            assert self.law_times is not None
            assert self.law_torques is not None
            return table_law(self.law_times, self.law_torques)
        return shaped_law(
            cast("LawKind", self.law), self.clutch_torque, self.engagement_time, self.time_constant
        )

    @property
    def mean_torque(self) -> float:
        """(MM Ic + Mc IM)/(IM + Ic): mean shaft torque in N m while the clutch slips."""
        IM, Ic = self.clutch_inertia, self.load_inertia
        return (self.clutch_torque * Ic + self.load_torque * IM) / (IM + Ic)

    @property
    def B(self) -> float:
        """Elastic frequency of the slipping clutch, rad/s: B^2 = cp (1/IM + 1/Ic), [C] (4)."""
        return math.sqrt(self.stiffness * (1.0 / self.clutch_inertia + 1.0 / self.load_inertia))

    @property
    def locked_frequency(self) -> float:
        """Elastic frequency once the clutch has locked, rad/s: sqrt(cp/Ic)."""
        return math.sqrt(self.stiffness / self.load_inertia)

    @property
    def rigid_slip_time(self) -> float:
        """Slip time in s on a rigid shaft, if behind tM: w0 (IM + Ic) = integral of M - Mc."""
        law, needed = self.friction, self.drive_speed * (self.clutch_inertia + self.load_inertia)
        t, given = 0.0, 0.0
        for piece, end in zip(law.pieces[:-1], law.starts[1:], strict=True):
            s = end - piece.start
            gained = (piece.a - self.load_torque + (piece.b / 2.0 + piece.q * s / 3.0) * s) * s
            if piece.e:
                gained += piece.e * (piece.T * math.expm1(s / piece.T) - s)
            given, t = given + gained, end
        return t + (needed - given) / (law.held - self.load_torque)

    def summary(self) -> dict[str, Any]:
        """The parameters as plain data, for JSON."""
        return {p.name: getattr(self, p.name) for p in PARAMETERS}

    def to_toml(self) -> str:
        """The clutch as a file that `load` reads, in SI.

        >>> clutch = Clutch.load("tractor-pto")
        >>> Clutch.from_toml(clutch.to_toml()) == clutch
        True
        """
        return document_text((table, self.summary()) for table in TABLES)

    # checks -----------------------------------------------------------------------------------------------

    def _mistakes(self) -> list[str]:
        """What single values do not show."""
        wrong = []
        held = self.clutch_torque
        if self.law == "table":
            wrong = list(self._table_mistakes())
            if not wrong and self.law_torques is not None:
                held = self.law_torques[-1]
        elif self.law_times is not None or self.law_torques is not None:
            kinds = ", ".join(LAWS)
            wrong.append(
                f'law = "{self.law}": only the law "table" has law_times and law_torques; write law = '
                f'"table", or leave them out for {kinds}.'
            )
        if self.time_constant == 0.0:
            wrong.append(
                "time_constant = 0: the time constant of the exponential law must not be 0; [C] has 1 s."
            )
        elif self.law == "exponential" and abs(self.engagement_time / self.time_constant) > 500.0:
            wrong.append(
                f"time_constant = {self.time_constant:g}: engagement_time is more than 500 of these, which "
                "is a step and no law; give a longer time constant."
            )
        if not held > self.load_torque:
            wrong.append(
                f"load_torque = {self.load_torque:g}: the clutch holds {held:g} N m and cannot bring this "
                "load to speed; give a smaller load torque or a larger friction torque."
            )
        return wrong or list(self._too_fast_or_slow())

    def _too_fast_or_slow(self) -> Iterator[str]:
        """The series of a motion take high powers of its rates."""
        free = 1.0 / self.clutch_inertia + 1.0 / self.load_inertia
        rates = {"stiffness": self.B, "load_inertia": self.locked_frequency}
        if self.damping > 0.0:
            rates["damping"] = max(self.damping * free, SLOWEST)
        if self.law == "exponential":
            rates["time_constant"] = abs(1.0 / self.time_constant)
        for name, rate in rates.items():
            if not SLOWEST <= rate <= FASTEST:
                yield (
                    f"{name} = {getattr(self, name):g}: with it a rate of the motion is {rate:.3g} 1/s, and "
                    f"it must be between {SLOWEST:g} and {FASTEST:g}; check the number, the inertias and "
                    "their units."
                )
                return

    def _table_mistakes(self) -> list[str]:
        times, torques = self.law_times, self.law_torques
        if times is None or torques is None:
            missing = "law_times" if times is None else "law_torques"
            return [f'law = "table": {missing} is missing; give instants in s and friction torques in N m.']
        if len(times) != len(torques):
            return [
                f"law_torques has {len(torques)} values and law_times {len(times)}: give a torque for each "
                f"instant."
            ]
        wrong = []
        if times[0] != 0.0:
            wrong.append(f"law_times[0] = {times[0]:g}: a table begins at 0 s.")
        for i, (before, after) in enumerate(pairwise(times), start=1):
            if after < before:
                wrong.append(f"law_times[{i}] = {after:g}: the instants must not go back; sort them.")
                break
        most = max(torques)
        if most > self.clutch_torque * ABOVE:
            wrong.append(
                f"law_torques[{torques.index(most)}] = {most:g}: more than the engaged clutch has, "
                f"clutch_torque = "
                f"{self.clutch_torque:g} N m; lower the table or raise clutch_torque."
            )
        return wrong
