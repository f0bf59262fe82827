"""Wear: how the gap grows from identification to identification, and when it reaches a limit."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any, Final

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from softstart.arrays import Matrix, Vector
from softstart.chain.machines import quantity_of
from softstart.errors import InputError
from softstart.identification.result import Estimate, Identification
from softstart.quantities import show
from softstart.results import Result
from softstart.start.comparison import INTERVAL

YEAR: Final = 365.25  # days


@dataclass(frozen=True)
class Line:
    """The growth of the gap by weighted least squares: `start + slope t`, t in years."""

    start: float  # gap at t = 0, rad
    slope: float  # rad a year
    covariance: Matrix  # of both, wider where the gaps scatter more than their intervals say
    chance: float  # that gaps with such intervals scatter as much about a line; 1 for two gaps
    quantile: float  # of 95 %: normal, or Student's where the scatter of the gaps is the variance

    @staticmethod
    def through(years: Vector, gaps: Vector, deviations: Vector) -> Line:
        """The line through these gaps, whose standard deviations are known.

        >>> line = Line.through(np.array([0.0, 1.0]), np.array([0.08, 0.09]), np.array([0.003, 0.004]))
        >>> round(line.slope, 6), round(math.sqrt(line.covariance[1, 1]), 6)
        (0.01, 0.005)
        """
        (slope, start), covariance = np.polyfit(years, gaps, 1, w=1.0 / deviations, cov="unscaled")
        squares = float(np.sum(((start + slope * years - gaps) / deviations) ** 2))
        chance, quantile, freedom = 1.0, INTERVAL.quantile, gaps.size - 2
        if freedom:
            chance = float(chi2.sf(squares, freedom))
        if freedom and squares > freedom:
            covariance = squares / freedom * covariance
            quantile = float(student.ppf(0.5 + 0.5 * INTERVAL.inside, freedom))
        return Line(float(start), float(slope), covariance[::-1, ::-1], chance, quantile)

    @property
    def growth(self) -> tuple[float, float, float]:
        """Growth and its interval of 95 %, rad a year."""
        half = self.quantile * math.sqrt(float(self.covariance[1, 1]))
        return self.slope, self.slope - half, self.slope + half

    def at(self, years: Vector) -> tuple[Vector, Vector]:
        """The gap at these times, and half its interval."""
        rows = np.column_stack([np.ones_like(years), years])
        half = self.quantile * np.sqrt(np.einsum("ij,jk,ik->i", rows, self.covariance, rows))
        return rows @ np.array([self.start, self.slope]), half

    def reaches(self, gap: float) -> tuple[float, float, float]:
        """When the line reaches a gap, and the interval of 95 % of that, years: Fieller's theorem.

        The interval holds all times at which the gap of the line may be that. It is open (infinite) where the
        growth may be 0; NaN, where the gap does not grow.

        >>> line = Line.through(np.array([0.0, 1.0]), np.array([0.08, 0.09]), np.array([1e-3, 1e-3]))
        >>> [round(t, 3) for t in line.reaches(0.12)]
        [4.0, 3.231, 5.352]
        """
        (v00, v01), (_, v11) = (self.quantile**2 * self.covariance).tolist()
        off = self.start - gap
        # (off + slope t)^2 <= v00 + 2 v01 t + v11 t^2
        a, b, c = self.slope**2 - v11, off * self.slope - v01, off**2 - v00
        middle = -off / self.slope if self.slope > 0.0 else math.nan
        if a > 0.0 and self.slope <= 0.0:  # it shrinks
            return math.nan, math.inf, math.inf
        root = math.sqrt(max(b * b - a * c, 0.0))
        low, high = sorted(((-b - root) / a, (-b + root) / a))
        if a > 0.0:
            return middle, low, high
        return middle, high if b * b > a * c else -math.inf, math.inf


@dataclass(frozen=True, eq=False, repr=False)
class Wear(Result, view="identification.wear_sheet"):
    """How the gap of a drive grows, and when it reaches its limit."""

    found: tuple[Identification, ...]  # the oldest first
    names: tuple[str, ...]
    dates: tuple[date, ...]  # when their logs were taken
    line: Line
    limit: float | None  # the gap at which the drive is worn, rad

    @property
    def gaps(self) -> tuple[Estimate, ...]:
        """The gap of each identification."""
        return tuple(identification["gap"] for identification in self.found)

    @property
    def worn(self) -> tuple[date | None, date | None, date | None] | None:
        """When the gap reaches its limit, the earliest and the latest date of 95 %; None for never."""
        if self.limit is None:
            return None
        return tuple(_date_after(self.dates[0], years) for years in self.line.reaches(self.limit))  # type: ignore[return-value]

    def summary(self) -> dict[str, Any]:
        """Everything as plain data."""
        growth = dict(zip(("growth", "growth_lower", "growth_upper"), self.line.growth, strict=True))
        worn = zip(("worn", "worn_earliest", "worn_latest"), self.worn or (), strict=False)
        gaps = [
            {
                "name": name,
                "date": str(when),
                "gap": gap.value,
                "gap_lower": gap.lower,
                "gap_upper": gap.upper,
            }
            for name, when, gap in zip(self.names, self.dates, self.gaps, strict=True)
        ]
        return {
            "drive": self.found[-1].drive.name, "gaps": gaps, **growth, "limit": self.limit,
            **{key: when and str(when) for key, when in worn}, "notes": list(self.notes),
        }  # fmt: skip


def follow_wear(
    found: Sequence[Identification | str | os.PathLike[str]],
    dates: Sequence[str | date],
    limit: float | str | None = None,
) -> Wear:
    """Follow the gap of a drive through its identifications, and say when it is worn.

    Parameters
    ----------
    found : sequence of Identification or path
        Two or more identifications of one drive, or the folders that `softstart identify --out` wrote.
    dates : sequence of str or date
        When their logs were taken, as "2026-05-31".
    limit : float or str, optional
        Gap at which the drive is worn, rad or with a unit; also "9 arcmin at output".

    Returns
    -------
    Wear
        `line.growth`, rad a year, with its interval; `worn`, the date of the limit with its interval; notes.

    Raises
    ------
    InputError
        For bad input, for one identification alone, and for a gap that is unknown in one of them.

    Examples
    --------
    >>> from softstart import Drive, identify
    >>> from softstart.identification.planning import simulated_log
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> plan = {"log_period": 8e-3, "ripple": 1.0}
    >>> each = [identify(simulated_log(one, "two levels, then reverse", **plan), one, searches=1)
    ...     for one in (crane, crane.replace(gap=0.1))]
    >>> wear = follow_wear(each, ["2024-05-01", "2026-05-01"], limit=0.15)
    >>> wear.line.growth[1] < 0.01 < wear.line.growth[2]
    True

    References
    ----------
    E. C. Fieller, Some problems in interval estimation, J. Royal Statist. Soc. B 16 (1954) 175-185.
    """
    if isinstance(found, Identification | str | os.PathLike) or len(found) < 2:
        raise InputError("wear: one identification shows no growth; name two or more, of other dates.")
    if len(dates) != len(found):
        raise InputError(
            f"dates: there are {len(dates)} for {len(found)} identifications; give the date of each, as "
            "2026-05-31."
        )
    rows = []
    for i, (when, one) in enumerate(zip(dates, found, strict=True), 1):
        name = f"log {i}" if isinstance(one, Identification) else str(one)
        read = one if isinstance(one, Identification) else Identification.load(one)
        gap = next((estimate for estimate in read.estimates if estimate.name == "gap"), None)
        if gap is None or not gap.known:
            raise InputError(f"wear: gap unknown in {name}: {gap.reason if gap else 'it was not free'}.")
        rows.append((_date_of(when), name, read, gap))
    rows.sort(key=lambda row: row[0])
    days, names, each, gaps = zip(*rows, strict=True)
    if days[0] == days[-1]:
        raise InputError(f"dates: all identifications are of {days[0]}; growth takes two dates.")
    line = Line.through(
        np.array([(one - days[0]).days / YEAR for one in days]),
        np.array([one.value for one in gaps]),
        np.array([deviation(one) for one in gaps]),
    )
    # through the gear of the last one, as the plate may have been read since
    worn = None if limit is None else quantity_of(each[-1].drive, "gap", limit, "limit")
    if worn is not None and not worn > 0.0:
        raise InputError(f"limit = {show(limit)}: the gap of a worn drive is above 0.")
    return Wear(each, names, days, line, worn)


def deviation(gap: Estimate) -> float:
    """The standard deviation of an estimate."""
    return 0.5 * (gap.upper - gap.lower) / INTERVAL.quantile


def _date_of(text: str | date) -> date:
    try:
        return text if isinstance(text, date) else date.fromisoformat(text)
    except ValueError:
        raise InputError(f"dates: {show(text)} is no date; write one as 2026-05-31.") from None


def _date_after(first: date, years: float) -> date | None:
    """The date so many years later; None beyond what a calendar has."""
    if not math.isfinite(years):
        return None
    day = first.toordinal() + years * YEAR
    return date.fromordinal(round(day)) if 1.0 <= day <= date.max.toordinal() else None
