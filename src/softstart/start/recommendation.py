"""Which strategy is recommended, and why: one rule for `compare`, the page and the report.

With limits (`drive.limits`): the simplest strategy that keeps them in the worst case asked for. Without: the
strategies that are Pareto-optimal in K_dyn and settled time, with the cost of each step from one to the next.
What is flagged, and what needs a sensor that drives do not have, is not recommended.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

from softstart.controller.base import Controller, Effort, effort_of, label_of
from softstart.controller.parameters import set_to_text
from softstart.drive import Limit, Limits, Machine
from softstart.drive.plausibility import permits_anything
from softstart.errors import Sentence
from softstart.quantities import Units
from softstart.results import OneLine
from softstart.start.fatigue import undamped, worst_damage
from softstart.start.run import Run
from softstart.views.numbers import IN_SI, units_of

SLOW: Final = 2.0  # times the time of `direct`
HIGHER: Final = 1.001  # times the K_dyn of `direct`
BETTER: Final = 0.999  # times the K_dyn of a quicker strategy: less is no gain
ALIKE: Final = 1.0 + 1e-4  # times the time of another: as quick
AT_THE_LIMIT: Final = 1e-4  # share left that is the accuracy of a search
ENDS: Final = ("lower", "upper")  # of an interval, in names of figures
CASES: Final = ("gap x4", "J2 x0.4")  # the worst case is that of the drive as it is and of these


@dataclass(frozen=True)
class Flag:
    """Why a strategy is not recommended: in a word, for tables, and in a few."""

    word: str
    text: str


@dataclass(frozen=True)
class Case:
    """A start on a drive that has changed: N m, s, NaN where it fails; K_dyn over the mean torque before.

    `start_time` is the time that a limit on it bounds (`Run.limited_time`).
    `used_life`: what the starts that the shaft line must last use of its life, %; `used_torque`: what the
    start uses of the permissible torques of a chain's shafts, %. 0 where no limit asks.
    """

    k_dyn: float
    peak_torque: float
    start_time: float
    used_life: float
    used_torque: float = 0.0

    @staticmethod
    def of(run: Run | None) -> Case:
        """That of a start; None is one that failed."""
        if run is None:
            return Case(math.nan, math.nan, math.nan, math.nan, math.nan)
        limits, used = checked_limits(run.drive), 0.0
        if limits.life is not None and limits.fatigue is not None:
            used = 100.0 * (limits.starts or 0.0) * worst_damage(run, limits.fatigue).damage
        return Case(run.k_dyn, run.peak_torque, run.limited_time, used, run.used_torque)


@dataclass(frozen=True)
class Margin:
    """A limit and the worst figure beside it; `case` says where that is, "" on the drive as it is.

    `figure` is that of the start; `value` is what the limit bounds: of a torque at the output the figure
    there. A sentence has them in `units`.
    """

    of: Limit
    figure: float
    case: str
    units: Units = IN_SI

    @property
    def value(self) -> float:
        """What is bounded, in the unit of the limit."""
        return float(self.of.scale * self.figure)

    @property
    def name(self) -> str:
        """Name of the limit."""
        return self.of.name

    @property
    def unit(self) -> str:
        """Unit of value and limit."""
        return self.of.unit

    @property
    def limit(self) -> float:
        """What is permitted."""
        return float(self.of.most)

    @property
    def seen(self) -> tuple[str, float, float, str]:
        """Name, value, limit and unit as a sentence has them."""
        if self.unit != "N m":
            return self.name, self.value, self.limit, self.unit
        units = self.units if self.of.scale == 1.0 else self.units.at_motor  # it is there already
        name = self.name.replace("shaft", "output") if units.gear else self.name
        of_value, of_limit = (float(units.shown(one, "N*m")) for one in (self.value, self.limit))
        return name, of_value, of_limit, units.label("N*m")

    @property
    def share(self) -> float:
        """What is left, as a share of the limit: below 0 where it is exceeded, NaN where the start fails."""
        return float(self.of.share_left(self.figure))

    @property
    def kept(self) -> bool:
        """Whether the limit is kept."""
        return self.share >= 0.0

    @property
    def brief(self) -> str:
        """Whether it is kept, and the margin: "kept 28.3 %", "4.2 % over", "exceeded x109"."""
        if self.share < -1.0:
            return f"exceeded x{_times(self.share)}"
        if math.isnan(self.share):
            return "exceeded"
        percent = f"{100.0 * abs(self.share):.1f} %"
        return f"kept {percent}" if self.kept else f"{percent} over"

    def summary(self) -> dict[str, object]:
        """As plain data."""
        plain = {"limit": self.name, "unit": self.unit, "value": self.value, "permitted": self.limit}
        return {**plain, "margin": self.share, "kept": self.kept, "case": self.case}

    def __str__(self) -> str:
        """As "shaft torque 93.2 N m of 130 N m with gap x4 (margin 28.3 %)", "used life 109 times ..."."""
        case = f" with {self.case}" if self.case else ""
        name, value, limit, unit = self.seen
        if math.isnan(value):
            return f"no {name}{case}, as the load does not reach its speed"
        if self.share < -1.0:
            return f"{name} {_times(self.share)} times what is permitted{case}"
        percent = 100.0 * self.share
        left = f"margin {percent:.3g} %" if self.kept else f"{-percent:.3g} % over"
        left = "at the limit" if 0.0 <= self.share < AT_THE_LIMIT else left
        return f"{name} {value:.4g} {unit} of {limit:.4g} {unit}{case} ({left})"


def _times(share: float) -> str:
    """How often a limit is used up of which this share is left: 26.1, 172,000."""
    return f"{float(f'{1.0 - share:.3g}'):,.6g}"


@dataclass(frozen=True, eq=False, repr=False)
class Row(OneLine):
    """One strategy: its start, and how it fares when the drive is not the one it was set up for.

    The robustness figures keep the controller as it was set up for the nominal drive, while the gap is
    4 times as wide (`k_dyn_worn_gap`) or the load inertia 0.4 times as large (`k_dyn_light_load`); they
    refer to the nominal drive's mean torque, so the three K_dyn compare torques. NaN where that start fails.

    `intervals` of 95 %, by figure, where the drive is known within intervals only (`compare`).
    `direct` is the start that times are compared with, None where that fails; `worst_case` names those of the
    `cases` that must keep the limits, besides the drive as it is. `setting` are the parameters that were set
    for this machine, at equal time or for its limits.
    """

    run: Run
    direct: Run | None
    cases: Mapping[str, Case] = field(default_factory=dict)
    worst_case: tuple[str, ...] = CASES
    label: str = ""  # a name of its own in tables
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    setting: Mapping[str, float] = field(default_factory=dict)

    @property
    def set_to(self) -> str:
        """The parameters that were set for this machine: "time 0.134 s"; "" for the strategy as it is."""
        return set_to_text(self.controller, self.setting, units_of(self.run.drive))

    @property
    def controller(self) -> Controller:
        """The strategy as it was set up."""
        assert self.run.controller is not None
        return self.run.controller

    @property
    def name(self) -> str:
        """Name of the strategy in tables."""
        return self.label or label_of(self.controller)

    @property
    def marked(self) -> str:
        """The name with the flags, for pictures."""
        words = ", ".join(flag.word for flag in self.flags)
        return f"{self.name} ({words})" if words else self.name

    @property
    def effort(self) -> Effort:
        """What it takes to build it."""
        return effort_of(self.controller)

    @property
    def settled_lost(self) -> float:
        """Settled time over that of `direct`, s."""
        return float(self.run.settled_time) - (math.nan if self.direct is None else self.direct.settled_time)

    @property
    def k_dyn_worn_gap(self) -> float:
        """K_dyn with a gap 4 times as wide."""
        return self.cases["gap x4"].k_dyn

    @property
    def k_dyn_light_load(self) -> float:
        """K_dyn with 0.4 of the load inertia."""
        return self.cases["J2 x0.4"].k_dyn

    @property
    def flags(self) -> tuple[Flag, ...]:
        """Why it is never recommended: slow, not settled, K_dyn above that of direct start; empty if not."""
        return flags(self.run, self.direct)

    @cached_property
    def _own(self) -> Case:
        return Case.of(self.run)

    def margins(self, limits: Limits) -> tuple[Margin, ...]:
        """The margin to each limit, in the worst of the drive as it is and of `worst_case`."""
        own = {"": self._own, **{case: self.cases[case] for case in self.worst_case}}
        found, names = [], {"start_time": self.run.limited_name}
        for limit in limits.each:
            values = {case: float(getattr(one, limit.figure)) for case, one in own.items()}
            # of values that are equal but for rounding that of the machine as it is
            worst = max(values, key=lambda case: (math.isnan(values[case]), float(f"{values[case]:.12g}")))
            named = replace(limit, name=names.get(limit.figure, limit.name))
            found.append(Margin(named, values[worst], worst, units_of(self.run.drive)))
        return tuple(found)

    @property
    def least_margin(self) -> Margin | None:
        """The margin that decides, to the limits that are checked: the least; None without limits."""
        margins = self.margins(checked_limits(self.run.drive))
        return min(margins, key=lambda one: (not math.isnan(one.share), one.share), default=None)

    @property
    def against_limits(self) -> str:
        """Whether it keeps the limits, and the margin, see `Margin.brief`; "" without limits."""
        least = self.least_margin
        return "" if least is None else least.brief

    def summary(self) -> dict[str, Any]:
        """The figures of the run and of this row under the names used everywhere."""
        limits = checked_limits(self.run.drive)
        return {
            **self.run.summary(),
            "settled_time_lost": self.settled_lost,
            "k_dyn_worn_gap": self.k_dyn_worn_gap,
            "k_dyn_light_load": self.k_dyn_light_load,
            "effort": self.effort.value,
            "set_to": dict(self.setting),
            "flags": [flag.text for flag in self.flags],
            **{
                f"{name}_{end}": v
                for name, ends in self.intervals.items()
                for end, v in zip(ENDS, ends, strict=True)
            },
            **({"limits": [one.summary() for one in self.margins(limits)]} if limits else {}),
        }


def flags(run: Run, direct: Run | None) -> tuple[Flag, ...]:
    """Why this strategy is never recommended; empty if it may be.

    Slow is what takes more than twice as long as `direct` until the load has settled, unless the drive has a
    limit on the start time, which then decides.
    """
    if math.isnan(run.start_time) and not run.regulated:
        return (Flag("no start", "does not reach the target speed"),)
    found = []
    if math.isnan(run.settled_time) and run.regulated:
        band = f"{100.0 * run.band:.3g} % of its speed"
        found.append(Flag("not settled", f"the load does not stay within {band} by {run.end_time:.4g} s"))
    elif math.isnan(run.settled_time):
        text = f"the load falls below its speed again, not settled within {run.settling_end:.4g} s"
        found.append(Flag("not settled", text))
    if direct is None:
        return tuple(found)
    slower = run.settled_time / direct.settled_time
    if slower > SLOW and run.drive.limits.start_time is None:
        found.append(Flag(f"slow x{slower:.3g}", f"takes {slower:.3g} times as long as direct start"))
    ratio = run.k_dyn / direct.k_dyn
    if ratio > HIGHER:
        text = f"K_dyn {run.k_dyn:.3f} above that of direct start, {direct.k_dyn:.3f}"
        found.append(Flag(f"K_dyn x{ratio:.3g}", text))
    return tuple(found)


@dataclass(frozen=True, eq=False, repr=False)
class Recommendation(OneLine):
    """What is recommended, and why, in one text that is the same wherever it is shown.

    Attributes
    ----------
    text : Sentence
        Answer, margin and reason; its advice is for the person who gives the limits.
    recommended : Row or None
        With limits, the simplest strategy that keeps them, if one does.
    best : tuple of Row
        The Pareto-optimal ones in K_dyn and settled time, the quickest first.
    limits : Limits
        Those of the drive.
    """

    text: Sentence
    recommended: Row | None
    best: tuple[Row, ...]
    limits: Limits

    @property
    def shown(self) -> tuple[Row, ...]:
        """The strategies to set off in tables: the recommended one, without limits the best."""
        if self.limits:
            return () if self.recommended is None else (self.recommended,)
        return self.best

    def verdict(self, row: Row) -> str:
        """What the rule says of a strategy."""
        refused = _why_not(row, self.limits)
        if refused:
            return refused
        if self.limits:
            more = "keeps the limits, with more effort or less margin"
            return "recommended" if row is self.recommended else more
        return "Pareto-optimal" if row in self.best else "dominated by another strategy"

    def summary(self) -> dict[str, object]:
        """As plain data."""
        return {
            "text": self.text,
            "recommended": None if self.recommended is None else self.recommended.name,
            "best": [row.name for row in self.best],
        }


LOOSE = "The permissible torque is above 10 times the starting torque: check it before you rely on this."


def recommend(drive: Machine, rows: Iterable[Row], tried: Sequence[Row] = ()) -> Recommendation:
    """The recommendation among the strategies started on a drive.

    `tried` are the best settings of strategies that keep the limits with none.
    """
    rows, limits = list(rows), checked_limits(drive)
    able = [row for row in rows if not row.flags and row.effort is not Effort.SENSOR]
    best = _pareto_set(able)
    if limits:
        doubt = LOOSE * any(permits_anything(drive))
        return _with_limits(limits, rows, able, best, f"{doubt} {unchecked_life(drive)}".strip(), tried)
    advice = f"For a recommendation, give {drive.LIMITS_GIVEN}." if best else ""
    fact = f"{_pareto_optimal(best, rows)} {unchecked_life(drive)}".rstrip()
    page = "For a recommendation, enter limits on the left." if best else ""
    return Recommendation(Sentence(fact, advice, page), None, best, limits)


def _pareto_set(able: Sequence[Row]) -> tuple[Row, ...]:
    """The quickest, then each one with a lower K_dyn than all quicker ones."""
    found: list[Row] = []
    for row in sorted(able, key=lambda row: (row.run.settled_time, row.run.k_dyn, row.effort.order)):
        if not found or row.run.k_dyn < BETTER * found[-1].run.k_dyn:
            if found and row.run.settled_time <= ALIKE * found[-1].run.settled_time:
                found.pop()  # as quick
            found.append(row)
    return tuple(found)


def checked_limits(drive: Machine) -> Limits:
    """The limits of a drive, or chain, without a life that cannot be computed."""
    limits: Limits = drive.limits
    return replace(limits, life=None) if unchecked_life(drive) else limits


def margins_of(run: Run) -> tuple[Margin, ...]:
    """The margin of one start to each limit of its machine that is checked.

    >>> from softstart import Drive, simulate
    >>> drive = Drive.load("crane-4amtkf").replace(permissible_torque=200.0)
    >>> print(*margins_of(simulate(drive, "direct")))
    shaft torque 164.8 N m of 200 N m (margin 17.6 %)
    """
    return Row(run, None, worst_case=()).margins(checked_limits(run.drive))


def unchecked_life(drive: Machine) -> str:
    """Why the life that is asked for is not checked; "" if it is, or if none is."""
    limits = drive.limits
    if limits.life is None:
        return ""
    if limits.fatigue is None or not limits.fatigue.points:
        return "The life is not checked: [limits.fatigue] has no point of an S-N curve."
    swings = "The life is not checked: without damping the shaft swings for all time."
    return swings if undamped(drive) else ""


def _pareto_optimal(best: Sequence[Row], rows: Sequence[Row]) -> str:
    """The Pareto-optimal strategies, with what each step from one to the next costs."""
    if not best:
        return f"None is recommended: {_refused(rows)}."
    first = best[0]
    parts = [f"{first.name}, K_dyn {first.run.k_dyn:.3f}, settled in {first.run.settled_time:.4g} s"]
    for before, row in pairwise(best):
        change, longer = row.run.k_dyn - before.run.k_dyn, row.run.settled_time - before.run.settled_time
        parts.append(
            f"{row.name}, {row.run.k_dyn:.3f}, settled in {row.run.settled_time:.4g} s "
            f"({change:+.3f} K_dyn for {1e3 * longer:+.3g} ms)"
        )
    return f"Pareto-optimal in K_dyn and settled time: {'; '.join(parts)}."


def _refused(rows: Sequence[Row]) -> str:
    return "; ".join(f"{row.name} ({_why_not(row, Limits())})" for row in rows)


def _why_not(row: Row, limits: Limits) -> str:
    """Why a strategy is not recommended; "" if it may be."""
    if row.flags:
        return row.flags[0].text
    if row.effort is Effort.SENSOR:
        return Effort.SENSOR.meaning
    broken = [one for one in row.margins(limits) if not one.kept]
    return str(min(broken, key=lambda one: one.share)) if broken else ""


def _with_limits(
    limits: Limits,
    rows: Sequence[Row],
    able: Sequence[Row],
    best: tuple[Row, ...],
    unchecked: str,
    tried: Sequence[Row],
) -> Recommendation:
    def _answer(text: str, chosen: Row | None) -> Recommendation:
        return Recommendation(Sentence(f"{text} {unchecked}".rstrip()), chosen, best, limits)

    def least(row: Row) -> float:
        shares = [one.share for one in row.margins(limits)]
        return -math.inf if any(map(math.isnan, shares)) else min(shares, default=math.inf)

    at_best = {row.name: row for row in tried if not row.flags}

    def why_not(row: Row) -> str:
        row = at_best.get(row.name, row)
        return f"{row.name}, {_why_not(row, limits)}{f' at best ({row.set_to})' if row.setting else ''}"

    passing = [row for row in able if keeps(row, limits)]
    if not passing:
        nearest = max([*able, *at_best.values()], key=least, default=None)
        reason = f"Nearest: {why_not(nearest)}" if nearest else _refused(rows)
        return _answer(f"No strategy keeps the limits. {reason}.", None)
    effort = min(row.effort.order for row in passing)
    chosen = max((row for row in passing if row.effort.order == effort), key=least)
    margins = _capital("; ".join(map(str, chosen.margins(limits))))
    setting = (
        f", set to {chosen.set_to}; settled in {chosen.run.settled_time:.4g} s" if chosen.setting else ""
    )
    text = (
        f"Recommended: {chosen.name}, the simplest strategy that keeps the limits ({chosen.effort.meaning})"
        f"{setting}. {margins}."
    )
    simpler = sorted((row for row in rows if row.effort.order < effort), key=lambda row: row.effort.order)
    if simpler:
        text = f"{text} Simpler ones do not: {'; '.join(map(why_not, simpler))}."
    others = [row for row in passing if row.setting and row is not chosen]
    if others:
        also = "; ".join(f"{row.name} when set to {row.set_to}" for row in others)
        text = f"{text} These do as well: {also}."
    return _answer(text, chosen)


def keeps(row: Row, limits: Limits) -> bool:
    """Whether a strategy keeps all limits in the worst case and may be recommended."""
    return not row.flags and row.effort is not Effort.SENSOR and all(one.kept for one in row.margins(limits))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
