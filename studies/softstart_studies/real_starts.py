"""Where a start begins: crane, hoist and conveyor from each position, under every strategy.

The crane is that of [G] with a damping ratio estimated from two pairs of gears and two couplings (3 %), hoist
and conveyor are the shipped ones. Without a lag of the torque a brake with torque proving lets a hanging load
go at once, so it is left out.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from softstart import Drive, Fatigue, Run, fatigue, optimize, simulate
from softstart.controller import ready_controller_names
from softstart.errors import InputError
from softstart.optimal.result import InfeasibleError, Optimum, OptimumError
from softstart.start.fatigue import damped, impacts, worst_damage
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.views.drawing import COLOURS, GREY, MARKERS, drawing, head, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POSITIONS = ("mid-gap", "driving-flank", "opposite-flank", "hanging")
TURNS = 5  # of which the least time of each contender counts
SLOWER = 1.2  # start time allowed to an optimum, over that of direct from there
KEPT = 1.05  # K_dyn from the worst position over that from mid-gap, up to which a promise is kept
ALIKE = 0.01  # relative differences below this decide no order


def drives() -> dict[str, Drive]:
    """The three, damped.

    >>> {name: round(drive.damping, 3) for name, drive in drives().items()}
    {'crane': 0.197, 'hoist': 1.5, 'conveyor': 0.9}
    """
    return {
        "crane": damped(Drive.load("crane-4amtkf"), {"gears": 2, "couplings": 2}),
        "hoist": Drive.load("hoist-15kw"),
        "conveyor": Drive.load("conveyor-11kw"),
    }


@dataclass(frozen=True)
class Extent:
    """What is computed."""

    drives: tuple[str, ...] = ("crane", "hoist", "conveyor")
    positions: tuple[str, ...] = POSITIONS
    strategies: tuple[str, ...] | None = None  # None: all that need no parameter
    optima: tuple[str, ...] = ("crane", "hoist", "conveyor")  # drives whose optima are sought
    unknown: tuple[str, ...] = ("crane", "conveyor")  # drives whose position may be unknown


@dataclass(frozen=True)
class Case:
    """One drive from one position: its starts by strategy, their lives, the optimum in the time allowed."""

    drive: Drive
    runs: Mapping[str, Run]
    lives: Fatigue
    optimum: Optimum | None
    seconds: tuple[float, float]  # of the starts, and of their lives

    @property
    def direct(self) -> Run:
        """The start under the full torque."""
        return self.runs["direct"]

    def life(self, name: str) -> float:
        """Life over that of direct."""
        return self.lives.rows[list(self.runs).index(name)].relative

    def in_time(self) -> dict[str, Run]:
        """The starts that take no longer than the optimum may."""
        most = SLOWER * self.direct.start_time
        return {name: run for name, run in self.runs.items() if run.start_time <= most}

    def gentlest(self) -> str:
        """The strategy with the least K_dyn among those."""
        return min(self.in_time(), key=lambda name: self.runs[name].k_dyn)


@dataclass(frozen=True)
class Findings:
    """All cases by drive and position, and the profiles for an unknown position by drive."""

    cases: Mapping[tuple[str, str], Case]
    unknown: Mapping[str, Optimum]

    def of(self, drive: str) -> dict[str, Case]:
        """The cases of a drive, by position."""
        return {where: case for (name, where), case in self.cases.items() if name == drive}

    @property
    def drives(self) -> tuple[str, ...]:
        """The drives, in order."""
        return tuple(dict.fromkeys(name for name, _ in self.cases))


def find(extent: Extent, progress: Progress) -> Findings:
    """All of it."""
    cases, unknown = {}, {}
    names = extent.strategies or tuple(ready_controller_names())
    for name in extent.drives:
        drive = drives()[name]
        own = [one for one in extent.positions if one != "hanging" or drive.load_kind == "active"]
        for where in own:
            progress(f"{name} from {where}")
            there = drive.replace(start_position=where, brake="none")
            cases[name, where] = _case(there, names, name in extent.optima)
        if name in extent.unknown:
            progress(f"{name}: one profile for an unknown position")
            latest = SLOWER * max(cases[name, one].direct.start_time for one in own if one != "hanging")
            there = drive.replace(start_position="unknown", brake="none")
            unknown[name] = optimize(there, latest)
    return Findings(cases, unknown)


def _case(drive: Drive, names: Sequence[str], optimum: bool) -> Case:
    runs = {name: simulate(drive, name) for name in names}
    lives = fatigue(list(runs.values()))
    best = None
    if optimum:
        try:
            best = optimize(drive, SLOWER * runs["direct"].start_time, terminal="reached")
        except (InfeasibleError, OptimumError, InputError):
            best = None
    return Case(drive, runs, lives, best, _seconds(drive, names, lives))


def _seconds(drive: Drive, names: Sequence[str], lives: Fatigue) -> tuple[float, float]:
    """Best of three: the starts, and turning points, cycles, damage and impacts of them."""
    best = [math.inf, math.inf]
    for _ in range(3):
        begun = time.perf_counter()
        runs = [simulate(drive, name) for name in names]
        started = time.perf_counter()
        for run in runs:
            worst_damage(run, lives.curve)
            impacts(run)
        best = [min(best[0], started - begun), min(best[1], time.perf_counter() - started)]
    return best[0], best[1]


# tables --------------------------------------------------------------------------------------------------


def tables(found: Findings) -> tuple[Table, ...]:
    """The strategies from each position, the optima, and lives."""
    return (*(_strategies(found, name) for name in found.drives), _optima(found), _order(found))


def _round(value: float, digits: int = 4) -> float | None:
    return None if not math.isfinite(value) else float(f"{value:.{digits}g}")


def _strategies(found: Findings, name: str) -> Table:
    cases = found.of(name)
    columns = ["strategy"]
    for where in cases:
        columns += [f"{where}: {what}" for what in ("K_dyn", "time over direct", "life over direct")]
    rows = []
    for one in next(iter(cases.values())).runs:
        row: list[object] = [one]
        for case in cases.values():
            run = case.runs[one]
            later = run.start_time / case.direct.start_time
            row += [_round(run.k_dyn), _round(later), _round(case.life(one), 3)]
        rows.append(row)
    return Table(f"The {name} from each position", columns, rows)


def _optima(found: Findings) -> Table:
    rows: list[tuple[object, ...]] = []
    for (name, where), case in found.cases.items():
        best, gentlest = case.optimum, case.gentlest()
        known = (None, None) if best is None else (_round(best.k_dyn), _round(best.bound.k_dyn))
        rows.append(
            (name, where, *known, gentlest, _round(case.runs[gentlest].k_dyn), _round(case.direct.k_dyn))
        )
    for name, profile in found.unknown.items():
        bound = _round(profile.bound.k_dyn)
        rows.append((name, "unknown: one profile for all", _round(profile.k_dyn), bound, None, None, None))
    return Table(
        f"Least K_dyn in {SLOWER} times the start time of direct",
        ("drive", "position", "optimum", "its bound", "gentlest strategy in time", "its K_dyn", "direct"),
        rows,
    )


def _order(found: Findings) -> Table:
    rows = []
    for (name, where), case in found.cases.items():
        same, pairs = concordance(case)
        best = max(case.runs, key=case.life)
        rows.append((name, where, case.gentlest(), best, same, pairs))
    return Table(
        "Order by K_dyn and by life",
        (
            "drive",
            "position",
            "gentlest in time",
            "longest life",
            "pairs of strategies in the same order",
            "of",
        ),
        rows,
    )


def concordance(case: Case) -> tuple[int, int]:
    """Pairs of strategies that K_dyn and life put in the same order, and pairs that both put in an order."""
    same = pairs = 0
    for a, b in combinations(case.runs, 2):
        k, life = (math.log(f(b) / f(a)) for f in (lambda n: case.runs[n].k_dyn, case.life))
        if abs(k) > ALIKE and abs(life) > ALIKE:
            pairs += 1
            same += (k > 0.0) != (life > 0.0)
    return same, pairs


# claims --------------------------------------------------------------------------------------------------


def claims(found: Findings) -> tuple[Claim, ...]:
    """Each with its verdict and number."""
    made = [position_decides(found), promises_are_kept(found), positions_agree_on_the_gentlest(found)]
    if any(case.optimum for case in found.cases.values()):
        made.append(strategies_reach_the_optimum(found))
    if found.unknown:
        made.append(a_sensor_is_worth_it(found))
    return (*made, life_ranks_as_k_dyn(found), life_costs_little(found), unknown_costs_three(found))


def position_decides(found: Findings) -> Claim:
    """How much the position alone changes the K_dyn of one strategy."""
    spreads = {}
    for name in found.drives:
        cases = found.of(name)
        for one in next(iter(cases.values())).runs:
            k = [case.runs[one].k_dyn for case in cases.values()]
            spreads[name, one] = max(k) / min(k)
    parts = []
    for name in found.drives:
        own = {one: value for (drive, one), value in spreads.items() if drive == name}
        least, most = min(own, key=own.__getitem__), max(own, key=own.__getitem__)
        parts.append(f"{name} {own[least]:.2f} ({least}) to {own[most]:.2f} ({most})")
    return Claim(
        "Where a start begins changes the peak of a strategy by more than a tenth.",
        Verdict.of(*(value > 1.1 for value in spreads.values())),
        f"Largest over least K_dyn of a strategy over the positions: {'; '.join(parts)}.",
    )


def promises_are_kept(found: Findings) -> Claim:
    """K_dyn of the worst position beside that of mid-gap, where strategies are usually judged."""
    kept: list[tuple[float, str]] = []
    broken: list[tuple[float, str]] = []
    for name in found.drives:
        cases = found.of(name)
        for one, run in cases["mid-gap"].runs.items():
            worst = max(cases, key=lambda where: cases[where].runs[one].k_dyn)
            ratio = cases[worst].runs[one].k_dyn / run.k_dyn
            text = f"{one} on the {name} {ratio:.2f} from {worst}"
            (kept if ratio <= KEPT else broken).append((ratio, text))
    worse = "; ".join(text for _, text in sorted(broken, reverse=True)[:4])
    return Claim(
        f"The K_dyn of a start in mid-gap holds from every position, within {100 * (KEPT - 1):.0f} %.",
        Verdict.of(bool(kept), not broken),
        f"Of {len(kept) + len(broken)} strategies and drives {len(kept)} keep it. "
        + (f"Largest ratios: {worse}." if broken else ""),
    )


def positions_agree_on_the_gentlest(found: Findings) -> Claim:
    """Which strategy is the gentlest in time, by position."""
    parts, agree = [], []
    for name in found.drives:
        best = {where: case.gentlest() for where, case in found.of(name).items()}
        agree.append(len(set(best.values())) == 1)
        parts.append(f"{name}: " + ", ".join(f"{one} from {where}" for where, one in best.items()))
    return Claim(
        f"One strategy is the gentlest from every position, within {SLOWER} times the time of direct.",
        Verdict.of(*agree),
        "; ".join(parts) + ".",
    )


def strategies_reach_the_optimum(found: Findings) -> Claim:
    """The gentlest strategy in time over the optimum, and the optimum over its bound."""
    ratios, gaps = {}, []
    for (name, where), case in found.cases.items():
        if case.optimum is not None:
            run = case.runs[case.gentlest()]
            ratios[f"{name} {where}"] = run.k_dyn / case.optimum.k_dyn
            gaps.append(case.optimum.k_dyn / case.optimum.bound.k_dyn - 1.0)
    least, most = min(ratios, key=ratios.__getitem__), max(ratios, key=ratios.__getitem__)
    return Claim(
        "From every position some strategy is within 10 % of the optimum in the same time.",
        Verdict.of(*(value <= 1.1 for value in ratios.values())),
        f"Gentlest strategy over optimum: {ratios[least]:.3f} ({least}) to {ratios[most]:.3f} ({most}). "
        f"The optima lie at most {100.0 * max(gaps):.2g} % above their bounds.",
    )


def a_sensor_is_worth_it(found: Findings) -> Claim:
    """One profile over time for all positions, beside the worst of the optima of known ones."""
    parts, gains = [], []
    for name, profile in found.unknown.items():
        cases = {where: case for where, case in found.of(name).items() if where != "hanging"}
        known = max(case.optimum.k_dyn for case in cases.values() if case.optimum is not None)
        feedback = min(
            max(case.runs[one].k_dyn for case in cases.values())
            for one in next(iter(cases.values())).runs
            if all(one in case.in_time() for case in cases.values())
        )
        gains.append(profile.k_dyn / known)
        parts.append(
            f"{name}: one profile {profile.k_dyn:.3f}, optima of known positions at most {known:.3f}, "
            f"best strategy that is not told the position {feedback:.3f}"
        )
    return Claim(
        "To know the position lowers the worst K_dyn of a prescribed torque by more than a tenth.",
        Verdict.of(*(gain > 1.1 for gain in gains)),
        "; ".join(parts) + ".",
    )


def life_ranks_as_k_dyn(found: Findings) -> Claim:
    """Pairs of strategies in the same order, and the most striking exception."""
    counted = [concordance(case) for case in found.cases.values()]
    same, pairs = (sum(one[i] for one in counted) for i in (0, 1))
    text = ""
    odd = [
        (case.life(one), name, where, one, case)
        for (name, where), case in found.cases.items()
        for one in case.runs
        if case.runs[one].k_dyn < case.direct.k_dyn * (1.0 - ALIKE) and case.life(one) < 1.0 - ALIKE
    ]
    if odd:
        life, name, where, one, case = min(odd, key=lambda found: found[0])
        row = case.lives.rows[list(case.runs).index(one)]
        low, load = float(row.turning_points[:, 1].min()), float(case.drive.Mc)
        text = (
            f" {one} on the {name} from {where} has K_dyn {case.runs[one].k_dyn:.3f} where direct has "
            f"{case.direct.k_dyn:.3f}, and {life:.2g} of its life: meanwhile its torque falls to "
            f"{low:.0f} N m (load {load:.0f} N m)."
        )
    return Claim(
        "Life and K_dyn put the strategies in the same order.",
        Verdict.CONFIRMED if same == pairs else Verdict.PARTLY if 2 * same > pairs else Verdict.REFUTED,
        f"{same} of {pairs} pairs of strategies, over all drives and positions.{text}",
    )


def life_costs_little(found: Findings) -> Claim:
    """The time to count and judge cycles and impacts, beside that of the starts."""
    ratios = {
        name: sum(case.seconds[1] for case in found.of(name).values())
        / sum(case.seconds[0] for case in found.of(name).values())
        for name in found.drives
    }
    return Claim(
        "Life adds at most 20 % to the time of a start.",
        Verdict.of(*(value <= 0.2 for value in ratios.values())),
        "Over all strategies and positions, on this machine: "
        + ", ".join(f"{name} {100.0 * value:.0f} %" for name, value in ratios.items())
        + ".",
    )


def unknown_costs_three(found: Findings) -> Claim:
    """The time of starts from an unknown position, beside that of the three known ones, in turns."""
    ratios = {}
    for name in found.drives:
        own = found.of(name)
        unknown = next(iter(own.values())).drive.replace(start_position="unknown")
        strategies = list(next(iter(own.values())).runs)
        turns = [
            [_processor_time(one, strategies) for one in (unknown, *unknown.positions.values())]
            for _ in range(TURNS)
        ]
        worst, *known = (min(column) for column in zip(*turns, strict=True))
        ratios[name] = len(known) * worst / sum(known)
    return Claim(
        "The worst of three positions takes at most 3.2 times the time of one.",
        Verdict.of(*(value <= 3.2 for value in ratios.values())),
        "Processor time of the starts of all strategies, over the mean of the three positions by themselves: "
        + ", ".join(f"{name} {value:.2f}" for name, value in ratios.items())
        + ".",
    )


def _processor_time(drive: Drive, strategies: Sequence[str]) -> float:
    begun = time.process_time()
    for name in strategies:
        simulate(drive, name)
    return time.process_time() - begun


# pictures ------------------------------------------------------------------------------------------------


def positions_figure(found: Findings) -> Figure:
    """K_dyn of each strategy from each position, a panel a drive."""
    with drawing():
        figure, axes = new_figure(1, len(found.drives), (11.0, 4.2), sharey=True, squeeze=False)
        for panel, name in zip(axes[0], found.drives, strict=True):
            cases = found.of(name)
            strategies = list(next(iter(cases.values())).runs)
            for index, (where, case) in enumerate(cases.items()):
                k = [case.runs[one].k_dyn for one in strategies]
                panel.plot(
                    k, range(len(strategies)), MARKERS[index], color=COLOURS[index], ms=7, mfc="none",
                    mew=1.6, label=where,
                )  # fmt: skip
            panel.axvline(1.0, color=GREY, lw=0.8, ls=":")
            panel.set_yticks(range(len(strategies)), strategies)
            head(panel, name, "", "K_dyn")
        axes[0, 0].invert_yaxis()
        axes[0, 0].legend(fontsize=8)
    return figure  # type: ignore[no-any-return]


def life_figure(found: Findings) -> Figure:
    """Life over K_dyn, a panel a drive, a mark a position."""
    with drawing():
        figure, axes = new_figure(1, len(found.drives), (11.0, 3.8), squeeze=False)
        for panel, name in zip(axes[0], found.drives, strict=True):
            for index, (where, case) in enumerate(found.of(name).items()):
                points = [(run.k_dyn / case.direct.k_dyn, case.life(one)) for one, run in case.runs.items()]
                panel.plot(
                    *zip(*points, strict=True), MARKERS[index], color=COLOURS[index], mfc="none", label=where
                )
            panel.axhline(1.0, color=GREY, lw=0.8, ls=":")
            panel.axvline(1.0, color=GREY, lw=0.8, ls=":")
            panel.set_yscale("log")
            head(panel, name, "life over that of direct", "K_dyn over that of direct")
        axes[0, 0].legend(fontsize=8)
    return figure  # type: ignore[no-any-return]


class RealStarts(Study):
    """Strategies, optima and lives from each position at which a start may begin.

    >>> RealStarts.name, RealStarts.pictures
    ('real-starts', ('real-starts-positions', 'real-starts-life'))
    """

    name: ClassVar[str] = "real-starts"
    title: ClassVar[str] = "Crane, hoist and conveyor from each position: peaks, optima, lives"
    pictures: ClassVar[tuple[str, ...]] = ("real-starts-positions", "real-starts-life")

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; nothing is written beyond tables and pictures."""
        return present(find(Extent(), progress), progress)


def present(found: Findings, progress: Progress) -> StudyResult:
    """Tables, claims and figures of what was found."""
    progress("drawing")
    return RealStarts.result(tables(found), claims(found), (positions_figure(found), life_figure(found)))
