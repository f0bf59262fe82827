"""What is shown of an optimal start and of a front: words, tables, figures, files of --out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.optimal.front import Front
from softstart.optimal.problem import REACTS, best_k_dyn, best_start
from softstart.optimal.result import Kept, Optimum
from softstart.start.recommendation import margins_of
from softstart.start.run import Run
from softstart.views.drawing import COLOURS, DASHES, GREY, drawing, head, mark_points, new_figure, plain_ticks
from softstart.views.numbers import NOTHING, TextTable, column_of, number, short, with_unit
from softstart.views.sheet import Sheet, records_file
from softstart.views.starts import machine_lines, over_time, shaft_torques, speeds, twists

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AIMS = {"heat": "least heat", "start_time": "least start time"}
REPLAY = "softstart simulate {what}.toml --controller profile --param file=profile.csv"
UNRECORDED = (
    "profile", "seconds", "tried", "k_dyn_if_position_known", "k_dyn_each", "start_times", "scenarios",
)  # fmt: skip
TALL = 4.0  # largest over smallest K_dyn from which on the axis is logarithmic
TICKS = (0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0)


# one optimal start ------------------------------------------------------------------------------------------


def controller_summary(run: Run) -> dict[str, Any]:
    """The figures of a controller that matter beside an optimum."""
    return {"controller": run.controller_name, "k_dyn": run.k_dyn, "start_time": run.start_time}


def _facts(best: Optimum) -> list[list[str]]:
    """The figures of the optimum, as words and numbers."""
    run, bound, problem, kept = best.run, best.bound, best.problem, best.kept
    bounded, shafts = bound.kind != "none", run.drive.shaft_names
    gap = [
        "gap between them",
        f"{best.optimality_gap_percent:.3g} %" if bounded or kept is not None else NOTHING,
    ]

    def allowed(most: float | None, unit: str = "") -> str:
        return "" if most is None else f", {short(most)}{unit} allowed"

    facts = [
        ["K_dyn", number(best.k_dyn, 6) + allowed(problem.k_dyn)],
        ["lower bound of K_dyn", f"{number(bound.k_dyn, 6)}, {bound.kind}" if bounded else NOTHING],
    ]
    facts += [gap] if problem.minimise == "k_dyn" and kept is None else []
    facts += [["peak shaft torque", f"{short(run.peak_torque)} N m at {short(run.peak_time)} s"]]
    if len(shafts) > 1:
        facts += [[f"K_dyn in {name}", number(one, 6)] for name, one in zip(shafts, best.k_dyns, strict=True)]
    latest = problem.start_time if kept is None else None
    facts += [["start time", f"{short(best.end_time)} s{allowed(latest, ' s')}"]]
    facts += [["its lower bound", f"{short(kept.at_least)} s"], gap] if kept is not None else []
    facts += [["I2t heat", f"{short(best.heat)} s of starting torque{allowed(problem.heat, ' s')}"]]
    if best.heat_at_least:
        facts += [["its lower bound", f"{short(best.heat_at_least)} s, momentum"], gap]
    facts += [
        ["first contact", with_unit(run.first_contact, "s")],
        ["contacts", str(run.contacts)],
        ["knots of the profile", str(best.profile.time.size)],
    ]
    if not problem.scenarios:
        each = best.alone.items()
        facts += [[f"K_dyn if known to start at {name}", number(one.k_dyn, 6)] for name, one in each]
    tried = ", ".join(f"{one.method} {number(one.value, 6).replace('-', 'none')}" for one in best.tried)
    return [*facts, ["answers of the searches", tried]] if len(best.tried) > 1 else facts


def optimum_question(best: Optimum) -> str:
    """What was asked for."""
    problem, kept = best.problem, best.kept
    aim = _aim(best)
    if _by_limits(best) and kept is not None:
        limits = ", ".join(f"{one.name} {short(one.limit)} {one.unit}" for one in kept.margins)
        aim = f"least start time that keeps the limits ({limits})"
    bounds = {
        "start time at most {:.6g} s": None if _by_limits(best) else problem.start_time,
        "K_dyn at most {:.6g}": problem.k_dyn,
        "heat at most {:.6g} s": problem.heat,
        "one profile for {} machines": len(best.runs) if problem.scenarios else None,
        f"terminal {problem.terminal}": 0.0,
        "motor torque limited over its speed": 0.0 if problem.torque_speed else None,
        "smoothness {:.6g} s": problem.smoothness or None,
    }
    return ", ".join([aim, *(words.format(most) for words, most in bounds.items() if most is not None)])


def _aim(best: Optimum) -> str:
    """What is the least of all."""
    problem = best.problem
    least = "least largest K_dyn" if problem.scenarios else best_k_dyn(problem.drive)
    return AIMS.get(problem.minimise, least)


def comparison(best: Optimum, others: Sequence[Run]) -> str:
    """The optimum beside `direct` and the gentlest shipped controller, or the quickest within limits."""
    if best.kept is not None:
        return _within_limits(best, best.kept, others)
    blind = "Best fixed profile: " if len(best.problem.machines) > 1 else ""
    largest = "largest " if best.problem.scenarios else ""
    text = f"{blind}{largest}K_dyn {best.k_dyn:.3f} in {best.end_time:.4g} s"
    reaching = sorted((run for run in others if not math.isnan(run.start_time)), key=lambda run: run.k_dyn)
    others = [run for run in reaching if run.controller_name != "direct"]
    for run in reaching:
        if run.controller_name == "direct":
            text += f"; direct has {run.k_dyn:.3f} in {run.start_time:.4g} s"
    for run in others:
        if run.start_time <= best.end_time * (1.0 + 1e-9):
            quick = "the gentlest shipped controller as quick"
            return f"{text}; {quick}, {run.controller_name}, has {run.k_dyn:.3f}."
    return f"{text}; no other shipped controller is as quick." if others else f"{text}."


def _within_limits(best: Optimum, kept: Kept, others: Sequence[Run]) -> str:
    """The quickest start that keeps the limits: margins, what forbids a quicker one, shipped strategies."""
    limits, what = _by_limits(best), "bound of K_dyn" if kept.binding == "K_dyn" else kept.binding
    text = f"Least start time: {best.end_time:.4g} s, K_dyn {best.k_dyn:.3f}."
    if limits:
        least = "Least start time that keeps the " + ("limits" if kept.kept else "others")
        none = "" if kept.kept else "No start keeps all limits. "
        text = f"{none}{least}: {best.end_time:.4g} s. {_capital('; '.join(map(str, kept.margins)))}."
    forbids = f"The {what} forbids" if what else "No limit but the motor torque forbids"
    by = "" if kept.tight or kept.refused is None else f" (the next one found: {kept.refused})"
    less = 100.0 * (1.0 - kept.at_least / best.end_time)
    text += f" {forbids} a quicker start{by}. None takes less than {kept.at_least:.6g} s ({less:.2g} % less)."

    def keeps(run: Run) -> bool:
        if not limits:
            return not math.isnan(run.start_time) and run.k_dyn <= (best.problem.k_dyn or math.inf)
        return all(one.kept for one in margins_of(run))

    what = "keeps them" if limits else "keeps it" if kept.margins else "reaches the target speed"
    first = min(filter(keeps, others), key=lambda run: run.start_time, default=None)
    if first is None:
        return f"{text} No shipped strategy {what}."
    takes = f"{first.controller_name}, takes {first.start_time:.4g} s"
    return f"{text} The quickest shipped strategy that {what}, {takes}."


def _by_limits(best: Optimum) -> bool:
    """Whether the quickest start within the limits of the drive was asked for."""
    return best.kept is not None and best.problem.minimise == "k_dyn"


def _known(best: Optimum) -> list[str]:
    """What it is worth to know the start position, or the machine, where one profile serves several."""
    problem, found = best.problem, list[str]()
    if best.alone:
        what = "machine" if problem.scenarios else "position"
        worst = f"scenario {best.worst + 1}" if problem.scenarios else best.run.position
        name, hardest = max(best.alone.items(), key=lambda item: item[1].k_dyn)
        lower = 100.0 * (1.0 - hardest.k_dyn / best.k_dyn)
        missing = len(problem.machines) - len(best.alone)
        none = f" ({missing} of {len(problem.machines)} without an optimum)" if missing else ""
        found.append(
            f"Largest K_dyn: {worst}. With the {what} known, the largest of the optima is "
            f"{hardest.k_dyn:.4f} ({name}), {lower:.1f} % lower{none}."
        )
    return [*found, REACTS] if len(problem.drive.positions) > 1 else found


def scenario_table(best: Optimum) -> TextTable:
    """What is different in each machine that the profile serves, and its start."""
    machines = (best.problem.drive, *best.problem.scenarios)
    lever_rule_model = [one.lever_rule_model for one in machines]
    columns = {
        "scenario": [str(index) for index in range(1, len(machines) + 1)],
        "gap\nrad": column_of([one.gap for one in lever_rule_model]),
        "J2\nkg m2": column_of([one.J2 for one in lever_rule_model]),
        "Mc\nN m": column_of([one.Mc for one in lever_rule_model]),
        "K_dyn": [number(k, 4) for k in best.k_dyn_each],
        "start\ntime s": column_of(list(best.start_times), 5),
    }
    return TextTable.of("", columns, bold=[best.worst])


def bound_sentence(best: Optimum) -> str:
    """What the lower bound covers."""
    kept, bound = best.kept, best.bound
    if kept is not None:
        unchecked = f" {kept.unchecked}" if kept.unchecked else ""
        return f"The lower bound of the start time covers {kept.covers}".rstrip(".") + f".{unchecked}"
    if bound.kind == "none":
        return f"No lower bound is known here: {bound.covers}" if bound.covers else "No lower bound."
    return f"The lower bound ({bound.kind}) covers {bound.covers}".rstrip(".") + "."


def optimum_figure(best: Optimum) -> Any:
    """Motor torque, shaft torque with its bound, speeds and twist of an optimal start, with all limits."""
    problem, others = best.problem, [one for one in best.runs if one is not best.run]

    def motor(axes: Axes, run: Run) -> None:
        least, most = problem.lowest_torque, problem.highest_torque
        for limit in (least, most):
            axes.axhline(limit, color=COLOURS[3], lw=1.0, ls=DASHES[1], label="limits" if limit else None)
        if problem.torque_speed:
            at_speed = np.interp(run.w1, *np.array(problem.torque_speed).T)
            axes.plot(run.t, at_speed, color=COLOURS[3], lw=1.0, ls=":", label="limit at w1")
        axes.plot(run.t, run.u, color=COLOURS[1], label="realised u")
        inside = best.profile.time <= run.end_time
        times = np.append(best.profile.time[inside], run.end_time)
        demand = np.append(best.profile.torque[inside], best.profile.at(run.end_time))
        axes.plot(times, demand, color=COLOURS[6], lw=0.9, ls=DASHES[3], label="demand")
        low, high = float(np.min(run.u)), float(np.max(run.u))
        head(axes, f"motor torque {low:.4g} to {high:.4g} of {least:.4g} to {most:.4g} N m", "torque, N m")
        axes.margins(y=0.08)

    def shaft(axes: Axes, run: Run) -> None:
        for other in others:
            axes.plot(other.t, other.T, color=GREY, lw=0.7)
        shaft_torques(axes, run)
        title = f"K_dyn {best.k_dyn:.4f}"
        if best.bound.kind != "none":
            least = best.bound.k_dyn * problem.base_torque
            axes.axhline(least, color=COLOURS[4], lw=1.6, ls=DASHES[3], label="bound")
            title += f", at least {best.bound.k_dyn:.4f}"
        limit = run.permissible_torque if _by_limits(best) else math.nan
        most = limit if problem.k_dyn is None else problem.k_dyn * problem.base_torque
        if not math.isnan(most):
            axes.axhline(most, color=COLOURS[3], lw=1.0, ls=DASHES[1], label="permissible")
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))  # "15 % less" is seen as that
        head(axes, title, "torque, N m")

    def speed(axes: Axes, run: Run) -> None:
        speeds(axes, run)
        if problem.start_time is not None and best.kept is None:
            axes.axvline(problem.start_time, color=COLOURS[3], lw=1.0, ls=DASHES[1], label="allowed")

    aim = "least start time within limits" if _by_limits(best) else _aim(best)
    title = f"{best.run.drive.name}: {aim}, terminal {problem.terminal}, {best.method}"
    return over_time(best.run, (motor, shaft, speed, twists), title, "thin: other machines" if others else "")


def optimum_sheet(best: Optimum, others: Sequence[Run] = ()) -> Sheet:
    """What is shown of an optimal start; `others` are the same machine under strategies."""
    problem = best.problem
    drive, several = problem.drive, bool(problem.scenarios)
    numbers = [f"-{index}" for index in range(1, len(best.runs) + 1)] if several else [""]
    traces = {f"trace-optimum{n}.csv": run.to_csv for n, run in zip(numbers, best.runs, strict=True)}
    record = {k: v for k, v in best.summary().items() if k not in UNRECORDED}
    others = sorted(others, key=lambda run: run.k_dyn)
    beside = {
        "strategy": [run.controller_name for run in others],
        "K_dyn": [number(run.k_dyn, 4) for run in others],
        "start time s": [number(run.start_time, 5) for run in others],
    }
    replay = REPLAY.format(what=drive.WHAT.removeprefix("a "))
    about = {"drive": drive.name, "k_dyn": best.k_dyn}
    return Sheet(
        f"{drive.name}: {'one profile for all' if several else best_start(drive)}",
        [*machine_lines(drive), f"  asked  {optimum_question(best)}", f"  method {best.method}: {best.why}"],
        facts=_facts(best),
        tables=[
            *([scenario_table(best)] if several else []),
            TextTable.of("The strategies on this drive", beside, ("strategy",)),
        ],
        conclusions=[comparison(best, others)],
        notes=[*_known(best), bound_sentence(best)],
        figures={"optimum": lambda: optimum_figure(best)},
        files={
            "profile.csv": best.profile.to_csv,
            "profile.toml": lambda path: best.profile.to_toml(path, about=about),
            "profile.c": best.profile.to_c,
            "figures.csv": records_file([record]),
            **traces,
        },
        machine=drive,
        behind=[f"## The profile\n\nPlayed again it gives the same K\\_dyn:\n\n```sh\n{replay}\n```"],
    )


# a front ----------------------------------------------------------------------------------------------------


def _front_tables(front: Front) -> list[TextTable]:
    """The curve, and the controllers, the gentlest first."""
    points, blind = front.points, len(front.drive.positions) > 1
    order = sorted(front.controllers, key=lambda one: one.k_dyn)
    curve = {
        "start time\nallowed s": column_of([p.start_time_bound for p in points], 5),
        "K_dyn": [number(p.k_dyn, 4) for p in points],
        "lower\nbound": [number(p.k_dyn_lower_bound, 4) for p in points],
        "gap\n%": [number(p.optimality_gap_percent, 3) for p in points],
        "bound": [p.bound_kind if p.found else NOTHING for p in points],
        "heat\ns": column_of([p.heat for p in points]),
        "contacts": [NOTHING if p.contacts is None else str(p.contacts) for p in points],
        "method": [p.method if p.found else p.status.lower().replace("_", " ") for p in points],
    }
    least = [one.optimum.k_dyn if one.optimum else None for one in order]
    controllers = {
        "strategy": [one.name for one in order],
        "K_dyn": [number(one.k_dyn, 4) for one in order],
        "start\ntime s": column_of([one.start_time for one in order], 5),
        f"{'best fixed profile' if blind else 'least K_dyn'}\nat that time": [number(k, 4) for k in least],
        f"times\n{'that' if blind else 'the least'}": [number(one.ratio, 3) for one in order],
    }
    title = f"{_capital(best_k_dyn(front.drive))}, terminal {front.terminal}"
    beside = f"Controllers against the {best_start(front.drive)} at their own start time"
    return [TextTable.of(title, curve, ("bound", "method")), TextTable.of(beside, controllers, ("strategy",))]


def _front_conclusion(front: Front) -> str:
    """What the curve spans, and the gentlest controller beside the optimum of just its own start time."""
    found = [point for point in front.points if point.found]
    if not found:
        return "None of these start times is feasible."
    ends = (f"{one.k_dyn:.3f} in {one.start_time_bound:.4g} s" for one in found[:1] + found[1:][-1:])
    text = f"{_capital(best_k_dyn(front.drive))} {' to '.join(ends)}."
    best = front.gentlest
    if best is None or best.optimum is None or best.optimum.k_dyn is None:
        return text
    return (
        f"{text} Gentlest strategy: {best.name}, K_dyn {best.k_dyn:.3f} in {best.start_time:.4g} s, "
        f"where the {best_start(front.drive)} has {best.optimum.k_dyn:.3f}."
    )


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _footnotes(front: Front) -> list[str]:
    """What the bound covers, and why some points are missing."""
    found = [REACTS] if len(front.drive.positions) > 1 else []
    for point in front.points:
        if not point.found:
            found.append(point.status_text)
        elif point.bound_covers:
            found.append(f"Lower bound ({point.bound_kind}): {point.bound_covers}".rstrip(".") + ".")
    for one in front.controllers:
        if one.optimum is not None and one.k_dyn < (one.optimum.k_dyn_lower_bound or 0.0):
            lies = "lies below the lower bound of its start time"
            found.append(f"{one.name} {lies}: its start is not of the class covered.")
        if one.ratio is None:
            found.append(f"{one.name}: {(one.optimum or one).status_text}")
    return list(dict.fromkeys(found))


def front_figure(front: Front) -> Any:
    """Minimum K_dyn over start time with its lower bound, and the controllers as named points."""
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 5.0))
        draw_front(axes, front)
    return figure


def draw_front(axes: Axes, front: Front) -> None:
    """The same on given axes."""
    found = [(p.start_time_bound, p.k_dyn, p.k_dyn_lower_bound) for p in front.points if p.k_dyn is not None]
    bounded = [one for one in found if one[2] is not None]
    placed = [one for one in front.controllers if not math.isnan(one.start_time)]
    best, shortest = best_start(front.drive), front.shortest_start_time
    refused = [p.start_time_bound for p in front.points if not p.found]
    if found:
        times, k, _ = zip(*found, strict=True)
        axes.plot(times, k, "o-", ms=3.5, color=COLOURS[0], label=best, zorder=3)
    if bounded:
        t, above, below = zip(*bounded, strict=True)
        axes.fill_between(t, below, above, color=COLOURS[5], alpha=0.45, lw=0)
        axes.plot(t, below, ls=DASHES[1], lw=1.2, color=COLOURS[4], label="lower bound", zorder=3)
    if refused:
        axes.plot(refused, [0.03] * len(refused), "x", ms=6, mew=1.5, color=GREY, clip_on=False,
                  transform=axes.get_xaxis_transform(), label=f"no {best}")  # fmt: skip
    if not math.isnan(shortest):
        axes.axvline(shortest, color=GREY, ls=DASHES[1], label=f"shortest found, {shortest:.4f} s")
    ratios = ("" if one.ratio is None else f", x{one.ratio:.2f}" for one in placed)
    marks = [(one.name + x, one.start_time, one.k_dyn) for one, x in zip(placed, ratios, strict=True)]
    mark_points(axes, marks)
    _scale(axes, [k for _, k, _ in found] + [one.k_dyn for one in placed])
    times_of = f"start time, s     (x: K_dyn over that of the {best} at the same start time)"
    title = f"{front.drive.name}: {best_k_dyn(front.drive)}, terminal {front.terminal}"
    head(axes, title, "K_dyn", times_of)


def _scale(axes: Axes, values: Sequence[float]) -> None:
    """From 0 on, or logarithmic where the largest would press the smallest flat."""
    from matplotlib import ticker

    shown = [k for k in values if k > 0.0]
    if not shown:
        return
    low, high = min(shown), max(shown)
    if high < TALL * low:
        axes.set_ylim(0.0, 1.08 * high)
    else:
        axes.set_yscale("log")
        plain_ticks(axes.yaxis, ticker.FixedLocator(list(TICKS)))
        axes.set_ylim(0.85 * low, 1.15 * high)
    axes.axhline(1.0, color=GREY, lw=0.8, ls=":")
    axes.margins(x=0.04)


def front_sheet(front: Front) -> Sheet:
    """What is shown of a curve over start times."""
    return Sheet(
        f"{front.drive.name}: {best_k_dyn(front.drive)} against start time, terminal {front.terminal}",
        machine_lines(front.drive),
        tables=_front_tables(front),
        conclusions=[_front_conclusion(front)],
        notes=_footnotes(front),
        figures={"pareto": lambda: front_figure(front)},
        panel=lambda ax: draw_front(ax, front),
        records=front.records,
        files={"pareto.csv": front.to_csv},
        machine=front.drive,
    )
