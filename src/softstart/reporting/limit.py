"""How gentle any start could be: a bound for every start time, and the optima found in the time given."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.controller.base import label_of
from softstart.errors import InputError, listed
from softstart.late import late
from softstart.optimal.bounds import momentum_bound, momentum_shortest_time
from softstart.optimal.front import FrontPoint, Stretch, computed
from softstart.optimal.optimize import optimize
from softstart.optimal.problem import REACTS, Problem, Terminal, best_start
from softstart.optimal.pulse_coast_hold import NotApplicable, applies, solve
from softstart.parallel import DiedError, Worker
from softstart.parallel import Progress as WorkerProgress
from softstart.profile import TorqueProfile
from softstart.reporting.choice import Choice
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

TIGHT = 1.0  # per cent between an optimum and a lower bound that counts as proof
TERMINAL: Terminal = "reached"
SHARES = (1.0, 1.02, 1.05, 1.1, 1.2, 1.35, 1.6)  # of the start time of direct, where optima are looked for
INSTANTS = 80  # of the curve of the bound
EARLIER = 0.85  # of the quickest strategy: from where on the curve is drawn
POLL = 0.1  # s

Progress = Callable[[float, str], object]


@dataclass(frozen=True)
class Limit:
    """What no start can go below, and what the best ones found reach.

    `times` (s) and `bounds`: a K_dyn that no torque over time within the motor's limits can go below, however
    it is controlled. `shortest`: no torque at all is quicker, s. `points`: optima, each re-simulated exactly;
    `missing` start times (s) whose optimum was not found within `budget` s. `refusal` says why there is
    nothing.
    """

    times: tuple[float, ...] = ()
    bounds: tuple[float, ...] = ()
    shortest: float = math.nan
    points: tuple[FrontPoint, ...] = ()
    missing: tuple[float, ...] = ()
    budget: float = 0.0
    refusal: str = ""

    def optimum_at(self, start_time: float) -> FrontPoint | None:
        """The optimum for a start time, if it was found."""
        return next((p for p in self.found if p.start_time_bound == start_time), None)

    def lowest_known(self, start_time: float, rows: Sequence[Row]) -> float | None:
        """Lowest K_dyn of `rows` and of the optima that take no longer, None without any."""
        found = [p.k_dyn for p in self.found if p.k_dyn is not None and p.start_time_bound <= start_time]
        found += [row.run.k_dyn for row in rows if row.run.start_time <= start_time]
        return min(found, default=None)

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
            "budget": self.budget,
            "refusal": self.refusal,
        }


def bound_at(drive: Any, start_time: float) -> float | None:
    """The K_dyn that no start within `start_time` s can go below; None where there is no bound.

    >>> from softstart import Drive
    >>> round(bound_at(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042), 4)
    0.9092
    """
    if not start_time > 0.0:
        return None
    try:
        bound = momentum_bound(Problem(drive, start_time, TERMINAL))
    except InputError:
        return None
    return bound.k_dyn if math.isfinite(bound.k_dyn) and bound.kind != "none" else None


def limit(
    drive: Any,
    chosen: Sequence[float],
    own: Sequence[float],
    reference: float,
    budget: float,
    progress: Progress,
    meanwhile: Callable[[], object] = lambda: None,
) -> Limit:
    """The limit for start times around those of the strategies, `own`, of which those `chosen` matter most.

    Where there is a formula the optima are computed at once. At the others, those chosen and shares of the
    start time of direct, `reference` in s, they are searched in a process of their own that is ended after
    `budget` s. `meanwhile` is called once while that process computes.
    """
    try:
        problem = Problem(drive, 1.0, TERMINAL)
    except InputError as error:
        return Limit(refusal=error.sentences[0])
    shortest = momentum_shortest_time(problem)
    least = reference if math.isfinite(reference) else min(own, default=math.nan)
    if not (math.isfinite(least) and math.isfinite(shortest)):
        return Limit(refusal="No strategy reaches the target speed, so there is no start time to judge by.")
    asked = list(dict.fromkeys([*chosen, *(share * least for share in SHARES)]))
    times = np.linspace(
        max(1.0005 * shortest, EARLIER * min(*asked, *own)), max(*asked, *own, 1.05 * shortest), INSTANTS
    ).tolist()
    curve = [(t, bound) for t in times if (bound := bound_at(drive, t)) is not None]
    points = list(_by_formula(drive, dict.fromkeys([*asked, *own])))
    left = [t for t in asked if t not in {p.start_time_bound for p in points}]
    if left and budget > 0.0:
        points += _in_own_process(drive, left, budget, progress, meanwhile)
    else:
        meanwhile()
    settled = {p.start_time_bound for p in points if p.status != "NOT_FOUND"}
    return Limit(
        tuple(t for t, _ in curve),
        tuple(bound for _, bound in curve),
        shortest,
        tuple(sorted(points, key=lambda p: p.start_time_bound)),
        tuple(sorted(t for t in asked if t not in settled)),
        budget,
    )


def _by_formula(drive: Any, asked: Iterable[float]) -> Iterator[FrontPoint]:
    """Optima of the closed form, where it holds."""
    for start_time in asked:
        with suppress(NotApplicable):
            solve(Problem(drive, start_time, TERMINAL))
            yield FrontPoint.of_optimum(optimize(drive, start_time, terminal=TERMINAL), start_time)


def _in_own_process(
    drive: Any, asked: Sequence[float], budget: float, progress: Progress, meanwhile: Callable[[], object]
) -> list[FrontPoint]:
    """Optima by search, as many as are found in time."""
    points: list[FrontPoint] = []
    worker = Worker(quiet=True)
    try:
        worker.submit(optima, drive, asked, reports=True)
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
        worker.kill()
    return points


def optima(drive: Any, start_times: Sequence[float], *, progress: WorkerProgress) -> None:
    """Look for the optima of start times and send each at once: the first one first, then by distance to it.

    Each begins with the optimum of the nearest start time that has one.
    """
    near: dict[float, TorqueProfile] = {}
    for start_time in sorted(start_times, key=lambda one: abs(one - start_times[0])):
        nearest = min(near, key=lambda one: abs(one - start_time), default=math.nan)
        (point,) = computed(Stretch(drive, {}, TERMINAL, (start_time,), near.get(nearest)))
        if point.found:
            near[start_time] = TorqueProfile(point.time, point.torque)
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
    """Each strategy beside the bound and the lowest K_dyn known in its own start time."""
    rows, bounded = [], bool(limit.bounds)
    for row in ordered(found):
        run, best = row.run, limit.optimum_at(row.run.start_time)
        bound, known = bound_at(drive, run.start_time), limit.lowest_known(run.start_time, found)
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
        *_on_missing(drive, limit),
        *_on_the_recommended(drive, choice, limit),
    ]


def _on_optima(drive: Any, limit: Limit) -> list[str]:
    """How much better than the optima other starts could be, and which starts."""
    if limit.found and len(drive.positions) > 1:
        return [f"The best fixed profiles are those found, not proved best. {REACTS}"]
    every, single, loose = [], [], []
    for p in limit.found:
        bound, left = bound_at(drive, p.start_time_bound), p.gap_percent
        over = math.inf if not bound or p.k_dyn is None else 100.0 * (p.k_dyn / bound - 1.0)
        if over <= TIGHT:
            every.append(max(over, 0.001))
        elif p.bound_kind == "certificate" and left is not None and left <= TIGHT:
            single.append((p.start_time_bound, max(left, 0.001)))
        else:
            loose.append(over)
    notes, count = [], len(limit.found)
    if every:
        notes.append(
            f"{len(every)} of {count} optima are proved against every other start: none lies more than "
            f"{digits(max(every), 1)} % above the lower bound."
        )
    if single:
        notes.append(
            f"Proved to {digits(max(share for _, share in single), 1)} % among starts whose gap closes only "
            f"once: the optimum at {_times([t for t, _ in single])}. That a start that bounces in the gap "
            "has a lower K_dyn, down to the lower bound, is not ruled out."
        )
    if loose:
        above = f", up to {digits(max(loose), 2)} % above the lower bound" if max(loose) < math.inf else ""
        notes.append(
            f"{len(loose)} of {count} optima are the best starts found{above}: better ones may exist."
        )
    return notes


def _on_missing(drive: Any, limit: Limit) -> list[str]:
    """Where there is no optimum, and why."""
    notes = []
    if refused := [p for p in limit.points if p.status == "INFEASIBLE"]:
        shortest = refused[-1].shortest_start_time
        known = f"; the shortest one found takes {digits(shortest, 5)} s" if shortest else ""
        notes.append(
            f"In {_times([p.start_time_bound for p in refused])} the search found no start at all{known}."
        )
    if limit.missing:
        reason = applies(Problem(drive, 1.0, TERMINAL)) or "so near the shortest start time"
        ended = "none was looked for"
        if limit.budget:
            ended = f"none was found within {short(limit.budget)} s of search"
        notes.append(
            f"For {_times(limit.missing)} no {best_start(drive)} is shown: there is no formula ({reason}), "
            f"and {ended}. The lower bound holds nevertheless."
        )
    return notes


def _on_the_recommended(drive: Any, choice: Choice, limit: Limit) -> list[str]:
    """Between which figures the least K_dyn lies in the start time of the recommended strategy."""
    best = choice.chosen
    if best is None:
        return []
    time, own = best.row.run.start_time, best.row.run.k_dyn
    bound, known = bound_at(drive, time), limit.lowest_known(time, choice.rows)
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
            "{known} (that of {name} itself): {most} less at most."
        ).format(**figures)
    ]


def _times(times: Sequence[float]) -> str:
    """Start times in words, each once, or how many there are."""
    words = list(dict.fromkeys(f"{digits(t)} s" for t in times))
    return f"{len(times)} start times" if len(words) > 4 else listed(words)


def limit_figure(rows: Sequence[Row], strong: Sequence[Row], limit: Limit) -> Any:
    """K_dyn against start time: the bound that nothing goes below, optima, every strategy."""
    placed = [row for row in rows if not math.isnan(row.run.start_time)]
    optima = limit.found
    own = [row.run.start_time for row in placed] + [p.start_time_bound for p in optima]
    left, right = min(own), max(own)
    right = max(right, 1.001 * left)  # a single start
    values = [row.run.k_dyn for row in placed] + [p.k_dyn for p in optima if p.k_dyn is not None]
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
