"""How gentle any start could be: a bound for every start time, and the optima found in the time given."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.controller.base import label_of
from softstart.drive import Drive
from softstart.errors import InputError, listed
from softstart.late import late
from softstart.optimal.chains.problem import ChainProblem
from softstart.optimal.front import FrontPoint, PointAsked, computed
from softstart.optimal.lp import ideal, whole_search
from softstart.optimal.momentum import momentum_shortest_time
from softstart.optimal.problem import REACTS, Terminal, best_start, problem_of
from softstart.optimal.pulse_coast_hold import applies
from softstart.optimal.result import InfeasibleError, OptimumError
from softstart.optimal.solving import optimize
from softstart.processes import DiedError, Worker
from softstart.processes import Progress as WorkerProgress
from softstart.reporting.choice import Choice
from softstart.reporting.gentle_starts import GentleStart, gentle_starts
from softstart.reporting.markup import Figures, Html, html, inlined, joined, table, tag
from softstart.reporting.strategies import GREY, K_DYN, SMALL, WIDE, name_in_figure, ordered
from softstart.start.comparison import REFERENCE
from softstart.start.recommendation import Row
from softstart.views.drawing import COLOURS, DASHES, MARKERS, drawing, name_points, new_figure, plain_ticks
from softstart.views.printed import digits, fixed, percent, short

if TYPE_CHECKING:
    from matplotlib import ticker
    from matplotlib.axes import Axes
else:
    ticker = late("matplotlib.ticker")

DESCENT = "slp"  # the method of an optimum on a chain
TIGHT = 1.0  # per cent between an optimum and its bound that counts as certified
TERMINAL: Terminal = "reached"
SHARES = (1.02, 1.05, 1.1, 1.2, 1.35, 1.6)  # of the start time of direct, where optima are looked for
INSTANTS = 80  # of the curve of the bound
EARLIER = 0.85  # of the quickest strategy: from where on the curve is drawn
POLL = 0.1  # s
GENTLER = 0.999  # times an optimum: what is no more than its last digits is not gentler
SEARCHED = 0.5  # of the budget, after which the search on a chain goes into no new demand
QUICK_SHARE = 0.3  # of the budget is kept for starts that are good and not proved best

Progress = Callable[[float, str], object]


@dataclass(frozen=True)
class Limit:
    """What no start can go below, and what the best one reaches.

    `times` (s) and `bounds`: a K_dyn that no torque over time within the motor's limits can go below, however
    it is controlled. `shortest`: no torque at all is quicker, s. `points`: optima, each re-simulated exactly;
    `missing` start times (s) whose optimum was not found within `budget` s. `known` are starts found by a
    quick search where there is no optimum, or a less gentle one. `refusal` says why there is nothing.
    """

    times: tuple[float, ...] = ()
    bounds: tuple[float, ...] = ()
    shortest: float = math.nan
    points: tuple[FrontPoint, ...] = ()
    missing: tuple[float, ...] = ()
    known: tuple[GentleStart, ...] = ()
    budget: float = 0.0
    refusal: str = ""

    def optimum_at(self, start_time: float) -> FrontPoint | None:
        """The optimum for a start time, if it was found."""
        return next((p for p in self.points if p.found and p.start_time_bound == start_time), None)

    def gentlest_known(self, start_time: float, rows: Sequence[Row] = ()) -> float | None:
        """Least K_dyn of `rows`, optima and other starts found that take no longer, None without any."""
        found = [p.k_dyn for p in self.found if p.k_dyn is not None and p.start_time_bound <= start_time]
        found += [one.k_dyn for one in self.known if one.start_time <= start_time]
        found += [row.run.k_dyn for row in rows if row.run.start_time <= start_time]
        return min(found, default=None)

    @property
    def gave_up(self) -> list[FrontPoint]:
        """Start times at which the search came to its end without an optimum."""
        return [p for p in self.points if p.status == "NOT_FOUND"]

    @property
    def found(self) -> list[FrontPoint]:
        """The optima in order of start time."""
        return sorted((p for p in self.points if p.found), key=lambda p: p.start_time_bound)

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "terminal": TERMINAL,
            "shortest_start_time": self.shortest,
            "start_time": list(self.times),
            "k_dyn_lower_bound": list(self.bounds),
            "optima": [
                {key: value for key, value in p.summary().items() if key not in ("profile", "seconds")}
                for p in self.points
            ],
            "not_found": list(self.missing),
            "known_starts": [one.summary() for one in self.known],
            "budget": self.budget,
            "refusal": self.refusal,
        }


def bound_at(drive: Any, start_time: float) -> float | None:
    """The K_dyn that no start within `start_time` s can go below; None where there is no bound.

    >>> round(bound_at(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042), 4)
    0.9092
    """
    if not start_time > 0.0:
        return None
    try:
        bound = problem_of(drive, start_time, TERMINAL).lower_bound()
    except InputError:
        return None
    return bound.k_dyn if math.isfinite(bound.k_dyn) and bound.kind != "none" else None


def limit(
    drive: Any,
    own: Sequence[float],
    reference: float,
    budget: float,
    progress: Progress,
    meanwhile: Callable[[], object] = lambda: None,
    seeds: Sequence[str] | None = None,
) -> Limit:
    """The limit for start times around those of the strategies, `own`, of which the first matter most.

    Where there is a formula the optima are computed at once; the others, by linear program or collocation,
    in a process of their own that is ended after `budget` s. `reference` is the start time of direct, s.
    `meanwhile` is called once while that process computes. Of a chain the optimum is looked for in the first
    start time alone, by linear programs on its exact start from the demands of `seeds`, names of strategies.
    """
    try:
        problem = problem_of(drive, 1.0, TERMINAL)
    except InputError as error:
        return Limit(refusal=error.sentences[0])
    if isinstance(problem, ChainProblem):
        return _by_descent(drive, own, budget, progress, meanwhile, seeds)
    shortest = momentum_shortest_time(problem)
    least = reference if math.isfinite(reference) else min(own, default=math.nan)
    if not (math.isfinite(least) and math.isfinite(shortest)):
        return Limit(refusal="No strategy reaches the target speed, so there is no start time to judge by.")
    asked = list(dict.fromkeys([*own, *(share * least for share in SHARES)]))
    longest = max(*asked, 1.05 * shortest)
    soonest = max(1.0005 * shortest, EARLIER * min(asked))
    times = np.linspace(soonest, longest, INSTANTS)
    bounds = [bound_at(drive, float(t)) for t in times]
    curve = [(float(t), b) for t, b in zip(times, bounds, strict=True) if b is not None]
    points, left = _by_formula(drive, asked)
    known: list[GentleStart] = []
    if left and budget > 0.0:
        began = time.monotonic()
        points += _in_own_process(drive, left, (1.0 - QUICK_SHARE) * budget, progress, meanwhile)
        progress(1.0, "looking for gentle starts")
        best = {p.start_time_bound: p.k_dyn for p in points if p.k_dyn is not None}
        order = sorted(left, key=lambda t: t in best)  # those without an optimum first
        known = gentle_starts(drive, order, budget - (time.monotonic() - began))
        known = [one for one in known if one.k_dyn < GENTLER * best.get(one.start_time_bound, math.inf)]
    settled = {p.start_time_bound for p in points if p.status != "NOT_FOUND"}
    return Limit(
        times=tuple(t for t, _ in curve),
        bounds=tuple(b for _, b in curve),
        shortest=shortest,
        points=tuple(sorted(points, key=lambda p: p.start_time_bound)),
        missing=tuple(sorted(t for t in asked if t not in settled)),
        known=tuple(known),
        budget=budget,
    )


def _by_descent(
    chain: Any,
    own: Sequence[float],
    budget: float,
    progress: Progress,
    meanwhile: Callable[[], object],
    seeds: Sequence[str] | None,
) -> Limit:
    """The limit of a chain: what is found in the time given is not proved the gentlest."""
    known = [one for one in own if math.isfinite(one)]
    if not known:
        return Limit(refusal="No strategy reaches the target speed.")
    asked = known[:1]
    times = np.linspace(EARLIER * min(known), max(known), INSTANTS).tolist()
    curve = [(t, b) for t in times if (b := bound_at(chain, t)) is not None]
    points: list[FrontPoint] = []
    if asked and budget > 0.0:
        points = _in_own_process(chain, asked, budget, progress, meanwhile, SEARCHED * budget, seeds)
    else:
        meanwhile()
    found = {p.start_time_bound for p in points if p.found}
    return Limit(
        times=tuple(t for t, _ in curve),
        bounds=tuple(b for _, b in curve),
        points=tuple(points),
        missing=tuple(t for t in asked if t not in found),
        budget=budget,
    )


def _by_formula(drive: Drive, asked: Iterable[float]) -> tuple[list[FrontPoint], list[float]]:
    """Optima of the closed form, and the start times for which there is none."""
    points, left = [], []
    for start_time in asked:
        try:
            best = optimize(drive, start_time, terminal="reached", method="closed-form")
            points.append(FrontPoint.of_optimum(best, start_time))
        except (InputError, InfeasibleError, OptimumError):
            left.append(start_time)
    return points, left


def _in_own_process(
    drive: Any,
    asked: Sequence[float],
    budget: float,
    progress: Progress,
    meanwhile: Callable[[], object],
    time_limit: float = 0.0,
    seeds: Sequence[str] | None = None,
) -> list[FrontPoint]:
    """Optima by the other methods, as many as are found in time; each search ends after its `time_limit`."""
    points: list[FrontPoint] = []
    worker = Worker(quiet=True)
    try:
        worker.submit(optima, drive, asked, time_limit, seeds, reports=True)
        began = time.monotonic()
        meanwhile()
        while True:
            spent = time.monotonic() - began
            progress(min(spent / budget, 1.0), f"looking for the optimum, at most {budget:g} s")
            message = worker.receive(min(POLL, max(budget - spent, 0.0)))
            if message is None and spent >= budget:
                break
            if message is not None and message.kind != "part":
                break  # it is done
            if message is not None:
                points.append(message.content)
    except DiedError:
        pass  # what it found counts
    finally:
        worker.end()
    return points


def optima(
    drive: Any,
    start_times: Sequence[float],
    time_limit: float = 0.0,
    seeds: Sequence[str] | None = None,
    *,
    progress: WorkerProgress,
) -> None:
    """Look for the optima of start times and send each at once: the first one first, then by distance to it.

    Each is looked for beside the optimum of the nearest start time that has one.
    """
    known: dict[float, Any] = {}
    for start_time in sorted(start_times, key=lambda one: abs(one - start_times[0])):
        nearest = min(known, key=lambda one: abs(one - start_time), default=None)
        warm = None if nearest is None or time_limit else known[nearest]  # a search with time has its seeds
        try:
            point, left = computed(
                PointAsked(drive, {"seeds": seeds}, TERMINAL, start_time, warm, time_limit)
            )
            known |= {} if left is None else {start_time: left}
        except InputError as error:  # of no class it solves
            point = FrontPoint.not_found(str(error), start_time, TERMINAL)
        progress.part(point)


def limit_section(drive: Any, choice: Choice, limit: Limit, figures: Figures) -> Html:
    """Figure, table and what can and cannot be said."""
    if limit.refusal:
        return tag(
            "p",
            f"For this {drive.WHAT.removeprefix('a ')} there is no limit to compare with. {limit.refusal}",
        )
    caption = [
        (
            f"Every strategy (filled: {choice.role}, and best of an ordinary inverter) by its start time and "
            "K_dyn. Below the dashed line (hatched) no start is possible, with whatever motor torque within "
            "its limits and however it is controlled."
        )
    ]
    if limit.found:
        caption.append(
            (
                "The solid line joins the best profiles found that serve every start position, each "
                "simulated exactly; feedback reacts to the contact and can lie below it."
            )
            if len(drive.positions) > 1
            else "The solid line joins optimal starts, each simulated exactly."
        )
    if limit.known:
        caption.append(
            "The dash-dotted line is the gentlest start known in that time, of a strategy, a profile or "
            "a quick search (crosses): possible, not proved best."
        )
    starts = "; ".join(
        f"{one.name} {fixed(one.row.run.k_dyn, 3)} at {digits(one.row.run.start_time)} s"
        for one in choice.candidates
    )
    title = f"K_dyn against start time: {starts}"
    return html(
        figures.shown(
            "limit",
            lambda: inlined(limit_figure(choice.rows, filled(choice), limit), "limit", title),
            " ".join(caption),
        )
        if choice.of(REFERENCE)
        else None,
        how_near(drive, choice.rows, limit),
        tag("ul", joined(tag("li", one) for one in _notes(drive, choice, limit)), class_="notes"),
    )


def filled(choice: Choice) -> list[Row]:
    """The rows of the two strategies that the report is about."""
    return [one.row for one in (choice.chosen, choice.ordinary) if one is not None]


def how_near(drive: Any, found: Sequence[Row], limit: Limit) -> Html:
    """Each strategy beside the bound, the optimum and the gentlest start known in its own start time."""
    rows, bounded = [], bool(limit.bounds)
    for row in ordered(found):
        run, best = row.run, limit.optimum_at(row.run.start_time)
        bound, known = bound_at(drive, run.start_time), limit.gentlest_known(run.start_time, found)
        is_best = best is not None and known is not None and best.k_dyn == known
        cells = [label_of(run.controller), digits(run.start_time), fixed(run.k_dyn, 3)]
        cells += [fixed(bound, 3)] if bounded else []
        cells += [fixed(known, 3) + (f" ({best_start(drive)})" if is_best else "")]
        cells += [fixed(run.k_dyn / known if known else None, 2)]
        rows.append(cells + ([fixed(run.k_dyn / bound if bound else None, 2)] if bounded else []))
    heads = ["strategy", "start time, s", "K_dyn"]
    heads += ["lower bound at that time"] if bounded else []
    heads += ["lowest known in that time", "times the lowest known"]
    heads += ["times the bound"] if bounded else []
    caption = "How near each strategy comes to the limit in its own start time"
    return table(heads, rows, caption=caption, class_="names near")


def _notes(drive: Any, choice: Choice, limit: Limit) -> list[str]:
    motor = drive.motor
    least, most = motor.minimum_torque, min(motor.starting_torque, motor.maximum_torque)
    bound = (
        "Lower bound: proved from the momentum of the load, for every torque from "
        f"{short(float(least))} to {short(float(most))} N m over time and any number of contacts. A dash: no "
        "bound at that start time."
    )
    none = "There is no bound for this machine: gears with losses, or a motor on the load mass."
    return [
        bound if limit.bounds else none,
        *_on_optima(drive, limit),
        *_on_the_shortest(choice, limit),
        *_on_missing(drive, limit),
        *_on_the_recommended(drive, choice, limit),
    ]


def _on_optima(drive: Any, limit: Limit) -> list[str]:
    """Of how many optima it is proved that nothing is gentler, and among which starts."""
    every, single, loose = [], [], []
    notes = [
        (
            f"In {digits(p.start_time_bound)} s, the start time of the chosen strategy, the gentlest start "
            f"found has K_dyn {fixed(p.k_dyn, 3)}: by linear programs on the exact start of the chain, from "
            "the torque of that strategy. It is simulated exactly, and not proved the gentlest."
        )
        for p in limit.found
        if p.method == DESCENT
    ]
    for p in limit.found if len(drive.positions) == 1 and not notes else ():
        bound, above = bound_at(drive, p.start_time_bound), p.gap_percent
        if bound and p.k_dyn is not None and 100.0 * (p.k_dyn / bound - 1.0) <= TIGHT:
            every.append(100.0 * (p.k_dyn / bound - 1.0))
        elif above is not None and above <= TIGHT:
            single.append(p)
        else:
            loose.append(math.inf if above is None else above)
    if limit.found and len(drive.positions) > 1:
        notes.append(f"The best fixed profiles are those found, not proved best. {REACTS}")
    if every:
        notes.append(
            f"{len(every)} of {len(limit.found)} optima are certified against every other start: none "
            f"lies more than {digits(max(*every, 0.001), 1)} % above the lower bound."
        )
    if single:
        times, most = (
            _times([p.start_time_bound for p in single]),
            max(*(p.gap_percent or 0.0 for p in single), 0.001),
        )
        notes.append(
            (
                f"That at {times} is certified among starts whose gap closes only once, to {digits(most, 1)} "
                "%. That a start that bounces in the gap is gentler, down to the lower bound, is not ruled "
                "out."
            )
            if len(single) == 1
            else (
                f"Those at {times} are certified among starts whose gap closes only once, to "
                f"{digits(most, 1)} %. That a start that bounces in the gap is gentler, down to the "
                "lower bound, is not ruled out."
            )
        )
    if loose:
        count, every_one = len(loose), len(limit.found)
        notes.append(
            (
                f"{count} of {every_one} optima are the best starts found, up to {digits(max(loose), 2)} % "
                "above their lower bound: gentler ones may exist."
            )
            if max(loose) < math.inf
            else f"{count} of {every_one} optima are the best starts found: gentler ones may exist."
        )
    return notes


def _on_the_shortest(choice: Choice, limit: Limit) -> list[str]:
    """Start times for which there is no start with a single contact, or just one."""
    refused = [p for p in limit.points if p.status == "INFEASIBLE"]
    if refused and len(choice.rows[0].run.drive.positions) > 1:
        return [refused[-1].status_text]
    once = [row.run.start_time for row in choice.rows if row.run.contacts == 1]
    soonest = min((time for time in once if not math.isnan(time)), default=math.inf)
    # within rounding of the shortest time the search may refuse a start that a strategy has made
    none = [p for p in refused if p.start_time_bound < soonest and p.shortest_start_time is not None]
    only = [p for p in refused if p.start_time_bound >= soonest]
    notes = []
    if none:
        notes.append(
            f"In {_times([p.start_time_bound for p in none])} there is no start whose gap closes only "
            f"once; the shortest such start takes {digits(none[0].shortest_start_time, 5)} s. Quicker "
            "starts bounce in the gap."
        )
    if only:
        notes.append(
            f"In {_times([p.start_time_bound for p in only])} there is no choice: no start whose gap "
            "closes only once was found that is noticeably quicker, so there is no optimum to tell."
        )
    return notes


def _on_missing(drive: Any, limit: Limit) -> list[str]:
    """Where there is no optimum, why, and what is shown instead."""
    notes = []
    if limit.missing:
        ended = (
            f"none was found within {short(limit.budget)} s of search"
            if limit.budget
            else "none was looked for"
        )
        if gave_up := limit.gave_up:
            ended = (
                f"{ended}; at {_times([p.start_time_bound for p in gave_up])} the search ended without one"
            )
        notes.append(
            f"For {_times(limit.missing)} no {best_start(drive)} is shown: {_why_hard(drive)}, and "
            f"{ended}. The lower bound holds nevertheless."
        )
    if limit.known:
        notes.append(
            "Starts found: the best of some thousand torques over time that a quick search tried, each "
            "simulated exactly. They are known to be possible, not known to be the gentlest: the limit "
            "lies between them and the lower bound."
        )
    return notes


def _on_the_recommended(drive: Any, choice: Choice, limit: Limit) -> list[str]:
    """Between which figures the least K_dyn lies in the start time of the recommended strategy."""
    best = choice.chosen
    if best is None:
        return []
    time, own = best.row.run.start_time, best.row.run.k_dyn
    bound, known = bound_at(drive, time), limit.gentlest_known(time, choice.rows)
    if bound is None or known is None:
        return []
    optimum = limit.optimum_at(time)
    if optimum is not None and 100.0 * (known / bound - 1.0) <= TIGHT:
        return []
    figures = {
        "time": digits(time), "name": best.name, "least": fixed(bound, 3), "known": fixed(known, 3),
        "own": fixed(own, 3), "most": percent(1.0 - bound / own), "certain": percent(1.0 - known / own),
    }  # fmt: skip
    return [
        (
            "In the {time} s of {name} the least possible K_dyn thus lies between {least} (proved) and "
            "{known} (found): {name} with {own} could be undercut by {certain} for certain, by {most} at "
            "most."
        ).format(**figures)
        if known < own
        else (
            "In the {time} s of {name} the least possible K_dyn thus lies between {least} (proved) and "
            "{known} (that of {name} itself, the gentlest start known): {most} less at most."
        ).format(**figures)
    ]


def _times(times: Sequence[float]) -> str:
    """Start times in words, each once, or how many there are."""
    words = list(dict.fromkeys(f"{digits(t)} s" for t in times))
    return f"{len(times)} start times" if len(words) > 4 else listed(words)


def _why_hard(drive: Any) -> str:
    if len(drive.positions) > 1:
        return "the start position is unknown, and one torque for every position has a search of its own"
    problem = problem_of(drive, 1.0, "reached")
    if isinstance(problem, ChainProblem):
        return "there is no formula for a chain, only a search by linear programs on its exact start"
    if ideal.not_linear(problem) and (reason := whole_search.not_linear(problem)):
        return f"they need a numerical search (direct collocation), because {reason}"
    if reason := applies(problem):
        return f"there is no formula ({reason}), only a search by linear programs"
    return "so near the shortest start time there is no formula, and a linear program has to be certified"


def limit_figure(rows: Sequence[Row], strong: Sequence[Row], limit: Limit) -> Any:
    """K_dyn against start time: the bound that nothing goes below, optima, every strategy."""
    placed = [row for row in rows if not math.isnan(row.run.start_time)]
    optima = limit.found
    own = [row.run.start_time for row in placed] + [p.start_time_bound for p in optima]
    own += [one.start_time for one in limit.known]
    left, right = min(own), max(own)
    right = max(right, 1.001 * left)  # a single start
    values = [row.run.k_dyn for row in placed] + [p.k_dyn for p in optima if p.k_dyn is not None]
    values += [one.k_dyn for one in limit.known]
    with drawing():
        figure, axes = new_figure(1, 1, (WIDE, 3.6))
        left, right = left - 0.15 * (right - left), right + 0.04 * (right - left)
        if limit.times:
            t, k = _within(limit, left, right, 2.0 * max(values))
            axes.fill_between(t, 0.0, k, fc="#F1F1F1", ec="#DADADA", hatch="////", lw=0.0, zorder=0)
            axes.plot(t, k, color=COLOURS[4], ls=DASHES[1], lw=1.8, label="lower bound: no torque goes below")
            values.append(float(k.min()))
        if optima:
            axes.plot(
                [p.start_time_bound for p in optima], [p.k_dyn for p in optima], "-", color=COLOURS[0],
                lw=1.2, marker=".", ms=7, label=f"{best_start(rows[0].run.drive)} found", zorder=3,
            )  # fmt: skip
        if limit.known:
            steps = sorted({right, *own})
            axes.step(
                steps, [limit.gentlest_known(t, placed) for t in steps], where="post", ls=DASHES[2],
                color="black", lw=1.0, zorder=3,
                label="gentlest start known: possible, not proved best",
            )  # fmt: skip
            axes.plot(
                [one.start_time for one in limit.known], [one.k_dyn for one in limit.known], "+",
                color="black", ms=6, zorder=3,
            )  # fmt: skip
        for index, row in enumerate(placed):
            best = row in strong
            colour = COLOURS[(index + 1) % len(COLOURS)]
            axes.plot([row.run.start_time], [row.run.k_dyn], MARKERS[index % len(MARKERS)],
                      ms=8 if best else 6.5, mfc=colour if best else "white", mew=1.6,
                      color=colour, zorder=4)  # fmt: skip
        axes.axhline(1.0, color=GREY, lw=0.8, ls=":")
        low, high = min(values), max(values)
        if high > 4.0 * low:
            _logarithmic(axes, low, high)
        else:
            room = max(high - low, 0.1 * high)
            axes.set_ylim(max(0.0, low - 0.35 * room), high + 0.15 * room)
        axes.set_xlim(left, right)
        axes.set_xlabel("start time, s")
        axes.set_ylabel(K_DYN)
        handles = axes.get_legend_handles_labels()[0]
        if handles:
            figure.legend(handles=handles, loc="outside upper center", ncols=3, fontsize=SMALL)
        points = [(name_in_figure(row.marked), row.run.start_time, row.run.k_dyn) for row in placed]
        name_points(figure, axes, points)
    return figure


def _within(limit: Limit, left: float, right: float, most: float) -> tuple[Any, Any]:
    """The curve of the bound in the frame: near the shortest start time it rises beyond all others."""
    times, bounds = np.array(limit.times), np.minimum(limit.bounds, most)
    inside = times[(times > left) & (times < right)]
    ends = [t for t in (left, right) if times[0] <= t <= times[-1]]
    t = np.union1d(inside, ends) if inside.size or ends else times
    return t, np.interp(t, times, bounds)


def _logarithmic(axes: Axes, low: float, high: float) -> None:
    axes.set_yscale("log")
    plain_ticks(axes.yaxis, ticker.LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axes.set_ylim(0.8 * low, 1.2 * high)
