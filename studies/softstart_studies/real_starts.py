"""Where a start begins: crane, hoist and conveyor from each position, under every strategy.

The crane is that of [G] with a damping ratio estimated from two pairs of gears and two couplings (3 %), hoist
and conveyor are the shipped ones. Without a lag of the torque a brake with torque proving lets a hanging load
go at once, so it is left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from softstart import Drive, Fatigue, Run, fatigue, optimize, simulate
from softstart.controller import ready_controller_names
from softstart.errors import InputError
from softstart.optimal.result import InfeasibleError, Optimum, OptimumError
from softstart.start.fatigue import damped
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.views.drawing import COLOURS, GREY, MARKERS, drawing, head, new_figure
from softstart_studies.crane import spread

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POSITIONS = ("mid-gap", "driving-flank", "opposite-flank", "hanging")
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

    @property
    def strategies(self) -> tuple[str, ...]:
        """The strategies, in order."""
        return tuple(next(iter(self.cases.values())).runs)


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
        with suppress(InfeasibleError, OptimumError, InputError):
            best = optimize(drive, SLOWER * runs["direct"].start_time, terminal="reached")
    return Case(drive, runs, lives, best)


# tables --------------------------------------------------------------------------------------------------


def tables(found: Findings) -> tuple[Table, ...]:
    """The strategies from each position with their lives, and the optima."""
    return (*(_strategies(found, name) for name in found.drives), _optima(found))


def _strategies(found: Findings, name: str) -> Table:
    cases = found.of(name)
    names = found.strategies
    cells: dict[str, Sequence[object]] = {"strategy": names}
    for where, case in cases.items():
        runs, direct = [case.runs[one] for one in names], case.direct.start_time
        cells[f"{where}: K_dyn"] = [run.k_dyn for run in runs]
        cells[f"{where}: time over direct"] = [run.start_time / direct for run in runs]
        cells[f"{where}: life over direct"] = [case.life(one) for one in names]
    return Table.of(f"The {name} from each position", cells)


def _optima(found: Findings) -> Table:
    rows: list[tuple[object, ...]] = []
    for (name, where), case in found.cases.items():
        best, gentlest = case.optimum, case.gentlest()
        known = (None, None) if best is None else (best.k_dyn, best.bound.k_dyn)
        rows.append((name, where, *known, gentlest, case.runs[gentlest].k_dyn, case.direct.k_dyn))
    for name, profile in found.unknown.items():
        known = profile.k_dyn, profile.bound.k_dyn
        rows.append((name, "unknown: one profile for all", *known, None, None, None))
    columns = (
        "drive",
        "position",
        "optimum",
        "its bound",
        "gentlest strategy in time",
        "its K_dyn",
        "direct",
    )
    return Table(f"Least K_dyn in {SLOWER} times the start time of direct", columns, rows)


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
    return (*made, life_ranks_as_k_dyn(found))


def position_decides(found: Findings) -> Claim:
    """How much the position alone changes the K_dyn of one strategy."""
    parts: list[str] = []
    all_spreads: list[float] = []
    for name in found.drives:
        cases = found.of(name).values()
        spreads = {one: 1.0 + spread([case.runs[one].k_dyn for case in cases]) for one in found.strategies}
        least, most = (extreme(spreads, key=spreads.__getitem__) for extreme in (min, max))
        parts.append(f"{name} {spreads[least]:.2f} ({least}) to {spreads[most]:.2f} ({most})")
        all_spreads += spreads.values()
    return Claim(
        "Where a start begins changes the peak of a strategy by more than a tenth.",
        Verdict.of(*(value > 1.1 for value in all_spreads)),
        f"Largest over least K_dyn of a strategy over the positions: {'; '.join(parts)}.",
    )


def promises_are_kept(found: Findings) -> Claim:
    """K_dyn of the worst position beside that of mid-gap, where strategies are usually judged."""
    ratios = []
    for name in found.drives:
        cases = found.of(name)
        for one in found.strategies:
            k = {where: case.runs[one].k_dyn for where, case in cases.items()}
            worst = max(k, key=k.__getitem__)
            ratio = k[worst] / k["mid-gap"]
            ratios.append((ratio, f"{one} on the {name} {ratio:.2f} from {worst}"))
    kept = [ratio <= KEPT for ratio, _ in ratios]
    worse = "; ".join(text for ratio, text in sorted(ratios, reverse=True)[:4] if ratio > KEPT)
    return Claim(
        f"The K_dyn of a start in mid-gap holds from every position, within {100 * (KEPT - 1):.0f} %.",
        Verdict.of(*kept),
        f"Of {len(kept)} strategies and drives {sum(kept)} keep it. "
        + (f"Largest ratios: {worse}." if worse else ""),
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
        f"Gentlest strategy over optimum: {ratios[least]:.3f} ({least}) to {ratios[most]:.3f} ({most}). The "
        f"optima lie at most {100.0 * max(gaps):.2g} % above their bounds.",
    )


def a_sensor_is_worth_it(found: Findings) -> Claim:
    """One profile over time for all positions, beside the worst of the optima of known ones."""
    parts, gains = [], []
    for name, profile in found.unknown.items():
        cases = {where: case for where, case in found.of(name).items() if where != "hanging"}
        known = max(case.optimum.k_dyn for case in cases.values() if case.optimum is not None)
        feedback = min(
            max(case.runs[one].k_dyn for case in cases.values())
            for one in found.strategies
            if all(one in case.in_time() for case in cases.values())
        )
        gains.append(profile.k_dyn / known)
        parts.append(
            f"{name}: one profile {profile.k_dyn:.3f}, optima of known positions at most {known:.3f}, best "
            f"strategy that is not told the position {feedback:.3f}"
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
            f"{case.direct.k_dyn:.3f}, and {life:.2g} of its life: meanwhile its torque falls to {low:.0f} "
            f"N m (load {load:.0f} N m)."
        )
    return Claim(
        "Life and K_dyn put the strategies in the same order.",
        Verdict.CONFIRMED if same == pairs else Verdict.PARTLY if 2 * same > pairs else Verdict.REFUTED,
        f"{same} of {pairs} pairs of strategies, over all drives and positions.{text}",
    )


# pictures ------------------------------------------------------------------------------------------------


def positions_figure(found: Findings) -> Figure:
    """K_dyn of each strategy from each position, a panel a drive."""
    places = range(len(found.strategies))
    with drawing():
        figure, axes = new_figure(1, len(found.drives), (11.0, 4.2), sharey=True, squeeze=False)
        for panel, name in zip(axes[0], found.drives, strict=True):
            points = {
                where: ([case.runs[one].k_dyn for one in found.strategies], places)
                for where, case in found.of(name).items()
            }
            _draw_points(panel, name, points, "", "K_dyn")
            panel.axvline(1.0, color=GREY, lw=0.8, ls=":")
        axes[0, 0].set_yticks(places, found.strategies)
        axes[0, 0].invert_yaxis()
        axes[0, 0].legend(fontsize=8)
    return figure


def life_figure(found: Findings) -> Figure:
    """Life over K_dyn, a panel a drive, a mark a position."""
    with drawing():
        figure, axes = new_figure(1, len(found.drives), (11.0, 3.8), squeeze=False)
        for panel, name in zip(axes[0], found.drives, strict=True):
            points = {
                where: (
                    [run.k_dyn / case.direct.k_dyn for run in case.runs.values()],
                    [case.life(one) for one in case.runs],
                )
                for where, case in found.of(name).items()
            }
            _draw_points(panel, name, points, "life over that of direct", "K_dyn over that of direct")
            panel.axhline(1.0, color=GREY, lw=0.8, ls=":")
            panel.axvline(1.0, color=GREY, lw=0.8, ls=":")
            panel.set_yscale("log")
        axes[0, 0].legend(fontsize=8)
    return figure


def _draw_points(panel: Any, name: str, points: Mapping[str, tuple[Any, Any]], up: str, across: str) -> None:
    for index, (where, (x, y)) in enumerate(points.items()):
        look = {"color": COLOURS[index], "mfc": "none", "mew": 1.6, "label": where}
        panel.plot(x, y, MARKERS[index], **look)
    head(panel, name, up, across)


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
