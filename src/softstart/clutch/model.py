"""`Clutch`: a slipping clutch whose driving side turns at constant speed, a shaft and a load behind it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, Self, cast, get_args

from softstart.clutch.laws import LAWS, Law, LawKind, shaped_law, table_law
from softstart.drive import LoadKind
from softstart.input.documents import document_text
from softstart.input.files import Library
from softstart.input.parameter_file import ParameterFile
from softstart.input.parameter_set import MaybeNumber, MaybeSeries, Number, parameter

LIBRARY = Library("softstart.clutch", "a clutch", "clutches")

ABOVE = 1.0 + 1e-9  # a table may exceed MM by rounding
SLOWEST, FASTEST = 1e-9, 1e9  # 1/s: beyond, the 24th power of a rate overflows


class Clutch(ParameterFile, kw_only=False, library=LIBRARY):
    """A slipping clutch with constant driving speed, a shaft and a load: [C] (1).

    All values are numbers in SI, or text with a unit.

    Parameters
    ----------
    {parameters}

    Raises
    ------
    InputError
        If any value is wrong; with one sentence for each.

    References
    ----------
    [C] (1).

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

    clutch_inertia: Number = parameter(
        "clutch.inertia", "kg*m^2", "inertia IM of the clutch side", '"0.98 kg*m^2"', "above 0"
    )
    clutch_torque: Number = parameter(
        "clutch.torque", "N*m", "friction torque MM of the engaged clutch", '"588 N*m"', "above 0"
    )
    drive_speed: Number = parameter(
        "clutch.speed", "rad/s", "constant speed w0 of the driving side", '"230 rad/s"', "above 0"
    )
    engagement_time: Number = parameter(
        "clutch.engagement_time", "s", "time tM in which the friction torque rises", '"1 s"', "above 0"
    )
    stiffness: Number = parameter(
        "shaft.stiffness", "N*m/rad", "stiffness cp of the shaft", '"49 N*m/rad"', "above 0"
    )
    load_inertia: Number = parameter(
        "load.inertia", "kg*m^2", "inertia Ic of the load", '"4.9 kg*m^2"', "above 0"
    )
    load_torque: Number = parameter("load.torque", "N*m", "torque Mc of the load", '"196 N*m"', "0 or more")
    lining_area: MaybeNumber = parameter(
        "clutch.lining_area", "m^2", "area of all friction faces", '"0.05 m^2"', "above 0", default=None
    )
    damping: Number = parameter(
        "shaft.damping", "N*m*s/rad", "damping of the shaft", '"0.5 N*m*s/rad"', "0 or more", default=0.0
    )
    gap: Number = parameter("shaft.gap", "rad", "total angular gap", '"0.02 rad"', "0 or more", default=0.0)
    load_kind: LoadKind = parameter(
        "load.kind", "", "kind of the load torque", '"active"', default="active", choices=get_args(LoadKind)
    )
    law: str = parameter(
        "law.kind", "", "engagement law", '"linear"', default="linear", choices=(*LAWS, "table")
    )
    time_constant: Number = parameter(
        "law.time_constant", "s", "time constant of the exponential law", '"1 s"', default=1.0
    )
    law_times: MaybeSeries = parameter(
        "law.times", "s", "instants of the table", "[0, 0.5, 1]", "0 or more", default=None, many=True
    )
    law_torques: MaybeSeries = parameter(
        "law.torques",
        "N*m",
        "friction torques of the table",
        "[0, 200, 588]",
        "0 or more",
        default=None,
        many=True,
    )
    name: str = parameter("name", "", "name of the clutch", '"my clutch"', default="unnamed clutch")
    source: str = parameter("source", "", "source of the numbers", '"data sheet"', default="not given")

    # making one -------------------------------------------------------------------------------------------

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
        kind = cast("LawKind", self.law)
        return shaped_law(kind, self.clutch_torque, self.engagement_time, self.time_constant)

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

    def summary(self) -> dict[str, Any]:
        """The parameters as plain data, for JSON."""
        return {p.name: getattr(self, p.name) for table in self.TABLES for p in table.parameters}

    def to_toml(self) -> str:
        """The clutch as a file that `load` reads, in SI.

        >>> clutch = Clutch.load("tractor-pto")
        >>> Clutch.from_toml(clutch.to_toml()) == clutch
        True
        """
        return document_text((table, holder.values()) for _, table, holder in self.blocks())

    # checks -----------------------------------------------------------------------------------------------

    def contradictions(self) -> list[str]:
        """Sentences on values that contradict one another."""
        wrong = []
        held = self.clutch_torque
        if self.law == "table":
            wrong = self._table_mistakes()
            if not wrong and self.law_torques is not None:
                held = self.law_torques[-1]
        elif self.law_times is not None or self.law_torques is not None:
            wrong.append(
                f'law = "{self.law}": only the law "table" has law_times and law_torques; write law = '
                f'"table", or leave them out for {", ".join(LAWS)}.'
            )
        if self.law == "exponential" and self.engagement_time > 500.0 * abs(self.time_constant):
            wrong.append(
                f"time_constant = {self.time_constant:g}: engagement_time is more than 500 of these, which "
                "is a step and no law; give a longer time constant, as 1 s in [C]."
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
        times, torques = self.law_times or (), self.law_torques or ()
        if not (len(times) == len(torques) > 0 and times[0] == 0.0 and sorted(times) == list(times)):
            return [
                f"law_times, law_torques: there are {len(times)} and {len(torques)} values; a table has a "
                "torque (N m) for each instant (s), begins at 0 s, and its instants do not go back."
            ]
        most = max(torques)
        if most > self.clutch_torque * ABOVE:
            return [
                f"law_torques[{torques.index(most)}] = {most:g}: more than the engaged clutch has, "
                f"clutch_torque = {self.clutch_torque:g} N m; lower the table or raise clutch_torque."
            ]
        return []
