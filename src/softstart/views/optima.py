"""What is shown of an optimal start and of a front: words, tables, figures, files of --out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.late import late
from softstart.optimal.front import ControllerPoint, Front
from softstart.optimal.problem import REACTS, best_k_dyn, best_start
from softstart.optimal.result import Kept, Optimum
from softstart.start.recommendation import Row, checked_limits
from softstart.start.run import Run
from softstart.views.drawing import (
    COLOURS,
    DASHES,
    GREY,
    MARKERS,
    SHAFTS,
    drawing,
    entitle,
    head,
    legend_above,
    name_points,
    new_figure,
    plain_ticks,
    save_figure,
    shade_open_gap,
)
from softstart.views.markdown import (
    figure_table,
    markdown,
    markdown_table,
    write_drive_report,
    write_rows,
)
from softstart.views.numbers import NOTHING, Table, column_of, number, short
from softstart.views.printed import units_of

if TYPE_CHECKING:
    from matplotlib import ticker
    from matplotlib.axes import Axes
else:
    ticker = late("matplotlib.ticker")

AIMS = {"k_dyn": "K_dyn", "heat": "heat", "start_time": "start time"}
REPLAY = "softstart simulate {what}.toml --controller profile --param file=profile.csv"
FEW = 8  # masses and shafts with a name each in a figure
TALL = 4.0  # largest over smallest K_dyn from which on the axis is logarithmic
TICKS = (0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0)


# one optimal start ------------------------------------------------------------------------------------------


def controller_summary(run: Run) -> dict[str, Any]:
    """The figures of a controller that matter beside an optimum."""
    return {"controller": run.controller_name, "k_dyn": run.k_dyn, "start_time": run.start_time}


def figure_rows(best: Optimum) -> list[list[str]]:
    """The figures of the optimum, as words and numbers."""
    run, bound, problem = best.run, best.bound, best.problem
    bounded = bound.kind != "none"
    latest = problem.start_time if best.kept is None else None
    allowed = "" if latest is None else f", {short(latest)} s allowed"
    most = "" if problem.k_dyn is None else f", {short(problem.k_dyn)} allowed"
    hottest = "" if problem.heat is None else f", {short(problem.heat)} s allowed"
    gap = ["gap between them", f"{best.gap_percent:.3g} %" if bounded or best.kept is not None else NOTHING]
    coolest = (
        [["its lower bound", f"{short(best.heat_at_least)} s, momentum"], gap] if best.heat_at_least else []
    )
    return [
        ["K_dyn", number(best.k_dyn, 6) + most],
        ["lower bound of K_dyn", f"{number(bound.k_dyn, 6)}, {bound.kind}" if bounded else NOTHING],
        *([gap] if problem.minimise == "k_dyn" and best.kept is None else []),
        ["peak shaft torque", f"{short(run.peak_torque)} N m at {short(run.peak_time)} s"],
        *_of_shafts(best),
        ["start time", f"{short(best.end_time)} s{allowed}"],
        *([["its lower bound", f"{short(best.kept.at_least)} s"], gap] if best.kept is not None else []),
        ["I2t heat", f"{short(best.heat)} s of starting torque{hottest}"],
        *coolest,
        ["first contact", NOTHING if math.isnan(run.first_contact) else f"{short(run.first_contact)} s"],
        ["contacts", str(run.contacts)],
        ["knots of the profile", str(best.profile.time.size)],
        *[
            [f"K_dyn if known to start at {name}", number(one.k_dyn, 6)]
            for name, one in best.alone.items()
            if not problem.scenarios
        ],
        *([["answers of the searches", _searches(best)]] if len(best.tried) > 1 else []),
        ["computed in", f"{best.seconds:.2g} s"],
    ]


def _of_shafts(best: Optimum) -> list[list[str]]:
    """K_dyn of each of several shafts."""
    run, names = best.run, best.run.drive.shaft_names
    if len(names) == 1:
        return []
    return [[f"K_dyn in {name}", number(one, 6)] for name, one in zip(names, run.k_dyns, strict=True)]


def _searches(best: Optimum) -> str:
    """What each method found, in the order in which they were tried."""
    return ", ".join(
        f"{one.method} {'none' if one.value is None else number(one.value, 6)}" for one in best.tried
    )


def question(best: Optimum) -> str:
    """What was asked for."""
    problem = best.problem
    words = [_aim(best)]
    if _by_limits(best) and best.kept is not None:
        limits = [f"{one.name} {short(one.limit)} {one.unit}" for one in best.kept.margins]
        words = [f"least start time that keeps the limits ({', '.join(limits)})"]
    elif problem.start_time is not None:
        words.append(f"start time at most {problem.start_time:.6g} s")
    if problem.k_dyn is not None:
        words.append(f"K_dyn at most {problem.k_dyn:.6g}")
    if problem.heat is not None:
        words.append(f"heat at most {problem.heat:.6g} s")
    if problem.scenarios:
        words.append(f"one profile for {len(best.runs)} machines")
    words.append(f"terminal {problem.terminal}")
    if problem.torque_speed:
        words.append("motor torque limited over its speed")
    if problem.smoothness:
        words.append(f"smoothness {problem.smoothness:.6g} s")
    return ", ".join(words)


def _aim(best: Optimum) -> str:
    """What is the least of all."""
    problem = best.problem
    if problem.minimise != "k_dyn":
        return f"least {AIMS[problem.minimise]}"
    return "least largest K_dyn" if problem.scenarios else best_k_dyn(problem.drive)


def comparison(best: Optimum, others: Sequence[Run]) -> str:
    """The optimum beside `direct` and the gentlest shipped controller, or the quickest within limits."""
    if best.kept is not None:
        return _within_limits(best, best.kept, others)
    blind = "Best fixed profile: " if len(best.problem.machines) > 1 else ""
    largest = "largest " if best.problem.scenarios else ""
    text = f"{blind}{largest}K_dyn {best.k_dyn:.3f} in {best.end_time:.4g} s"
    reaching = [run for run in others if not math.isnan(run.start_time)]
    direct = next((run for run in reaching if run.controller_name == "direct"), None)
    if direct is not None:
        text += f"; direct has {direct.k_dyn:.3f} in {direct.start_time:.4g} s"
    quick = [run for run in reaching if run.start_time <= best.end_time * (1.0 + 1e-9) and run is not direct]
    if quick:
        gentlest = min(quick, key=lambda run: run.k_dyn)
        name = gentlest.controller_name
        text += f"; the gentlest shipped controller as quick, {name}, has {gentlest.k_dyn:.3f}"
    elif reaching:
        gentlest = min(reaching, key=lambda run: run.k_dyn)
        text += (
            "; no other shipped controller is as quick, the gentlest of all, "
            f"{gentlest.controller_name}, has {gentlest.k_dyn:.3f} in {gentlest.start_time:.4g} s"
        )
    return text + "."


def known_sentences(best: Optimum) -> list[str]:
    """What it is worth to know the start position, or the machine, where one profile serves several."""
    problem = best.problem
    if len(problem.machines) == 1:
        return []
    what = "machine" if problem.scenarios else "position"
    reacts = [REACTS] if len(problem.drive.positions) > 1 else []
    if not best.alone:
        return reacts
    worst = f"scenario {best.worst + 1}" if problem.scenarios else best.run.position
    name, hardest = max(best.alone.items(), key=lambda item: item[1].k_dyn)
    lower = 100.0 * (1.0 - hardest.k_dyn / best.k_dyn)
    missing = len(problem.machines) - len(best.alone)
    none = f" ({missing} of {len(problem.machines)} without an optimum)" if missing else ""
    return [
        f"Largest K_dyn: {worst}. With the {what} known, the largest of the optima is {hardest.k_dyn:.4f} "
        f"({name}), {lower:.1f} % lower{none}.",
        *reacts,
    ]


def scenario_table(best: Optimum) -> Table:
    """What is different in each machine that the profile serves, and its start."""
    machines = (best.problem.drive, *best.problem.scenarios)
    lumped = [one.lumped for one in machines]
    columns = {
        "scenario": [str(index) for index in range(1, len(machines) + 1)],
        "gap\nrad": column_of([one.gap for one in lumped]),
        "J2\nkg m2": column_of([one.J2 for one in lumped]),
        "Mc\nN m": column_of([one.Mc for one in lumped]),
        "K_dyn": [number(k, 4) for k in best.k_dyn_each],
        "start\ntime s": column_of(list(best.start_times), 5),
    }
    return Table.of("", columns)


def _within_limits(best: Optimum, kept: Kept, others: Sequence[Run]) -> str:
    """The quickest start that keeps the limits: margins, what forbids a quicker one, shipped strategies."""
    if _by_limits(best):
        margins = "; ".join(map(str, kept.margins))
        least, which = "Least start time that keeps the", "limits" if kept.kept else "others"
        text = "" if kept.kept else "No start keeps all limits. "
        text += f"{least} {which}: {best.end_time:.4g} s. {margins[:1].upper()}{margins[1:]}."
    else:
        text = f"Least start time: {best.end_time:.4g} s, K_dyn {best.k_dyn:.3f}."
    if kept.binding == "K_dyn":
        text += " The bound of K_dyn forbids a quicker start."
    elif kept.binding:
        text += f" The {kept.binding} forbids a quicker start."
    else:
        text += " No limit forbids a quicker start, but the motor torque."
    less = 100.0 * (1.0 - kept.at_least / best.end_time)
    text += f" None takes less than {kept.at_least:.6g} s ({less:.2g} % less)."
    passing = [run for run in others if _keeps(run, best)]
    keeps = "keeps them" if _by_limits(best) else "keeps it" if kept.margins else "reaches the target speed"
    if not passing:
        return f"{text} No shipped strategy {keeps}."
    first = min(passing, key=lambda run: run.start_time)
    taken = f"{first.controller_name}, takes {first.start_time:.4g} s"
    return f"{text} The quickest shipped strategy that {keeps}, {taken}."


def _by_limits(best: Optimum) -> bool:
    """Whether the quickest start within the limits of the drive was asked for."""
    return best.kept is not None and best.problem.minimise == "k_dyn"


def _keeps(run: Run, best: Optimum) -> bool:
    if not _by_limits(best):
        return not math.isnan(run.start_time) and run.k_dyn <= (best.problem.k_dyn or math.inf)
    margins = Row(run, None, worst_case=()).margins(checked_limits(run.drive))
    return all(one.kept for one in margins)


def bound_sentence(best: Optimum) -> str:
    """What the lower bound covers."""
    if best.kept is not None:
        unchecked = f" {best.kept.unchecked}" if best.kept.unchecked else ""
        return f"The lower bound of the start time covers {best.kept.covers}".rstrip(".") + f".{unchecked}"
    if best.bound.kind == "none":
        return (
            f"No lower bound is known here: {best.bound.covers}" if best.bound.covers else "No lower bound."
        )
    return f"The lower bound ({best.bound.kind}) covers {best.bound.covers}".rstrip(".") + "."


def optimum_figure(best: Optimum) -> Any:
    """Motor torque, shaft torque with its bound, speeds and twist of an optimal start, with all limits."""
    run = best.run
    several = len(run.drive.shaft_names) > 1
    with drawing():
        figure, panels = new_figure(4, 1, (8.0, 9.0), sharex=True)
        for axes in panels:
            if not several:
                shade_open_gap(axes, run)
            axes.axvline(best.end_time, color=GREY, lw=0.8, ls=":")
        motor, shaft, speed, twist = panels
        _motor_torque(motor, best)
        _shaft_torque(shaft, best)
        _speeds(speed, best)
        _twist(twist, best)
        for axes in panels if several else ():  # too many names to stand beside the title
            axes.legend(fontsize=6.5, loc="center left", bbox_to_anchor=(1.0, 0.5))
        grey = ("" if several else "grey: gap open; ") + ("thin: other machines; " if best.runs[1:] else "")
        twist.set_xlabel(f"time, s     ({grey}dotted: end of the start)")
        twist.set_xlim(0.0, run.end_time)
        aim = "least start time within limits" if _by_limits(best) else _aim(best)
        asked = f"{aim}, terminal {best.problem.terminal}, {best.method}"
        entitle(figure, f"{run.drive.name}: {asked}")
    return figure


def _legend(axes: Axes, columns: int) -> None:
    legend_above(axes, columns, columnspacing=1.2, handlelength=1.8)


def _motor_torque(axes: Axes, best: Optimum) -> None:
    run, problem = best.run, best.problem
    t = run.t
    for limit in (problem.lowest_torque, problem.highest_torque):
        axes.axhline(limit, color=COLOURS[3], lw=1.0, ls=DASHES[1], label="limits" if limit else None)
    if problem.torque_speed:
        speeds, torques = np.array(problem.torque_speed).T
        axes.plot(
            t, np.interp(run.w1, speeds, torques), color=COLOURS[3], lw=1.0, ls=":", label="limit at w1"
        )
    axes.plot(t, run.u, color=COLOURS[1], label="realised u")
    knots_t, knots_u = _steps_until(best, run.end_time)
    axes.plot(knots_t, knots_u, color=COLOURS[6], lw=0.9, ls=DASHES[3], label="demand")
    low, high = float(np.min(run.u)), float(np.max(run.u))
    least, most = problem.lowest_torque, problem.highest_torque
    head(axes, f"motor torque {low:.4g} to {high:.4g} of {least:.4g} to {most:.4g} N m", "N m")
    axes.margins(y=0.08)
    _legend(axes, 4)


def _steps_until(best: Optimum, end: float) -> tuple[Any, Any]:
    """The knots of the demand up to the end of the run, where its last torque is held."""
    profile = best.profile
    inside = profile.time <= end
    return (
        np.append(profile.time[inside], end),
        np.append(profile.torque[inside], profile.at(end)),
    )


def _shafts(run: Run) -> list[tuple[str, dict[str, Any]]]:
    """Name and line of each shaft; more than `FEW` are not named."""
    names = run.drive.shaft_names if len(run.drive.shaft_names) > 1 else ("shaft torque",)
    names = names if len(names) <= FEW else [f"_{name}" for name in names]
    return [(name, {"color": SHAFTS[k % len(SHAFTS)]}) for k, name in enumerate(names)]


def _shaft_torque(axes: Axes, best: Optimum) -> None:
    run, base = best.run, best.problem.base_torque
    for other in (one for one in best.runs if one is not run):
        axes.plot(other.t, other.T, color=GREY, lw=0.7)
    for (name, line), torque in zip(_shafts(run), run.T.reshape(run.t.size, -1).T, strict=True):
        axes.plot(run.t, torque, label=name, **line)
    peak = run.peak_torque
    axes.axhline(peak, color=COLOURS[0], lw=0.9, ls=DASHES[1], label="peak")
    if best.bound.kind != "none":
        least = best.bound.k_dyn * base
        axes.axhline(least, color=COLOURS[4], lw=1.6, ls=DASHES[3], label="bound")
    axes.axhline(base, color=GREY, lw=0.8, ls=":", label="K_dyn = 1")
    limit = best.problem.drive.limits.shaft_torque if _by_limits(best) else None
    most = limit if best.problem.k_dyn is None else best.problem.k_dyn * base
    if most is not None:
        axes.axhline(most, color=COLOURS[3], lw=1.0, ls=DASHES[1], label="permissible")
    axes.plot([run.peak_time], [peak], "o", ms=4, color=COLOURS[0])
    if not math.isnan(run.first_contact):
        axes.plot([run.first_contact], [0.0], "^", ms=6, color=COLOURS[1], clip_on=False, label="contact")
    title = f"K_dyn {best.k_dyn:.4f}"
    if best.bound.kind != "none":
        title += f", at least {best.bound.k_dyn:.4f}"
    head(axes, title, "N m")
    _legend(axes, 5)


def _speeds(axes: Axes, best: Optimum) -> None:
    run, problem, units = best.run, best.problem, units_of(best.run.drive)
    for i, name in enumerate(run.drive.mass_names):
        if i not in (run.drive.motor_index, run.drive.load_index):
            axes.plot(
                run.t,
                units.shown(run.w[:, i], "rad/s"),
                color=GREY,
                lw=0.7,
                label=name if run.w.shape[1] <= FEW else None,
            )
    axes.plot(run.t, units.shown(run.w1, "rad/s"), color=COLOURS[1], ls=DASHES[1], label="motor w1")
    axes.plot(run.t, units.shown(run.w2, "rad/s"), color=COLOURS[0], label="load w2")
    axes.axhline(float(units.shown(problem.target, "rad/s")), color=GREY, lw=0.8, ls=":", label="target")
    title = f"start time {best.end_time:.4f} s"
    if problem.start_time is not None and best.kept is None:
        title += f", {problem.start_time:.4f} s allowed"
        axes.axvline(problem.start_time, color=COLOURS[3], lw=1.0, ls=DASHES[1], label="allowed")
    head(axes, title, units.of("rad/s"))
    _legend(axes, 4)


def _twist(axes: Axes, best: Optimum) -> None:
    run, units = best.run, units_of(best.run.drive)
    half, unit = float(units.shown(0.5 * run.drive.gaps[0], "rad")), units.of("rad")
    if run.drive.gaps.size == 1:
        axes.plot(run.t, units.shown(run.theta, "rad"), color=COLOURS[2], label="twist phi1 - phi2")
    else:
        half, unit = 1.0, "twist/half gap"
        for (name, line), gap, twist in zip(_shafts(run), run.drive.gaps, run.twist.T, strict=True):
            if gap > 0.0:
                axes.plot(run.t, 2.0 * twist / gap, label=name, **line)
    for flank in (half, -half):
        axes.axhline(flank, color="#444444", lw=0.8, ls=DASHES[1], label="flanks" if flank == half else None)
    contacts = "1 contact" if run.contacts == 1 else f"{run.contacts} contacts"
    at = "" if math.isnan(run.first_contact) else f", first at {run.first_contact:.4f} s"
    head(axes, contacts + at, unit)
    _legend(axes, 4)


def write_optimum(best: Optimum, others: Sequence[Run], folder: Path, command: str) -> None:
    """Everything about an optimal start."""
    drive = best.problem.drive
    save_figure(optimum_figure(best), folder, "optimum")
    best.profile.to_csv(folder / "profile.csv")
    best.profile.to_toml(folder / "profile.toml", about={"drive": drive.name, "k_dyn": best.k_dyn})
    best.profile.to_c(folder / "profile.c")
    numbers = [f"-{index}" for index in range(1, len(best.runs) + 1)] if best.problem.scenarios else [""]
    traces = [f"trace-optimum{number}.csv" for number in numbers]
    for name, run in zip(traces, best.runs, strict=True):
        run.to_csv(folder / name)
    left_out = {
        "profile",
        "seconds",
        "tried",
        "k_dyn_if_position_known",
        "k_dyn_each",
        "start_times",
        "scenarios",
    }
    summary = {key: value for key, value in best.summary().items() if key not in left_out}
    write_rows(folder / "figures.csv", [summary])
    rows = figure_rows(best)[:-1]  # without the computing time: the same command writes the same report
    others = sorted(others, key=lambda run: run.k_dyn)
    beside = {
        "strategy": [run.controller_name for run in others],
        "K_dyn": [number(run.k_dyn, 4) for run in others],
        "start time s": [number(run.start_time, 5) for run in others],
    }
    replay = REPLAY.format(what=drive.WHAT.removeprefix("a "))
    parts = [
        f"# {markdown(drive.name)}: {'one profile for all' if best.problem.scenarios else best_start(drive)}",
        f"Asked: {markdown(question(best))}. Method {best.method}: {markdown(best.why)}",
        markdown(comparison(best, others)),
        figure_table(rows),
        *([markdown_table(scenario_table(best))] if best.problem.scenarios else []),
        *map(markdown, known_sentences(best)),
        markdown(bound_sentence(best)),
        "![optimum](optimum.svg)",
        "## The profile",
        "[profile.csv](profile.csv), [profile.toml](profile.toml) and, as an interpolating function in C, "
        f"[profile.c](profile.c). Played again it gives the same K\\_dyn:\n\n```sh\n{replay}\n```\n\n"
        f"Traces of the start: {', '.join(f'[{name}]({name})' for name in traces)}.",
    ]
    if others:
        parts += ["## The controllers on this drive", markdown_table(Table.of("", beside, ("strategy",)))]
    write_drive_report(folder, parts, drive, command)


# a front ----------------------------------------------------------------------------------------------------


def front_tables(front: Front) -> list[Table]:
    """The curve, and the controllers, the one nearest to the limit first."""
    points, blind = front.points, len(front.drive.positions) > 1
    order = sorted(front.controllers, key=lambda one: one.ratio or math.inf)
    curve = {
        "start time\nallowed s": column_of([p.start_time_bound for p in points], 5),
        "K_dyn": [number(p.k_dyn, 4) for p in points],
        "lower\nbound": [number(p.k_dyn_lower_bound, 4) for p in points],
        "gap\n%": [number(p.gap_percent, 3) for p in points],
        "bound": [p.bound_kind if p.found else "-" for p in points],
        "heat\ns": column_of([p.heat for p in points]),
        "contacts": ["-" if p.contacts is None else str(p.contacts) for p in points],
        "method": [p.method if p.found else p.status.lower().replace("_", " ") for p in points],
    }
    controllers = {
        "strategy": [one.name for one in order],
        "K_dyn": [number(one.k_dyn, 4) for one in order],
        "start\ntime s": column_of([one.start_time for one in order], 5),
        f"{'best fixed profile' if blind else 'least K_dyn'}\nat that time": [
            number(one.optimum.k_dyn if one.optimum else None, 4) for one in order
        ],
        f"times\n{'that' if blind else 'the least'}": [number(one.ratio, 3) for one in order],
    }
    return [
        Table.of(
            f"{_capital(best_k_dyn(front.drive))}, terminal {front.terminal}", curve, ("bound", "method")
        ),
        Table.of(
            f"Controllers against the {best_start(front.drive)} at their own start time",
            controllers,
            ("strategy",),
        ),
    ]


def front_conclusion(front: Front) -> str:
    """What the curve spans, and which controller comes nearest to it."""
    found = [point for point in front.points if point.found]
    if not found:
        return "None of these start times is feasible."
    first, last = found[0], found[-1]
    text = f"{_capital(best_k_dyn(front.drive))} {first.k_dyn:.3f} in {first.start_time_bound:.4g} s"
    if last is not first:
        text += f" to {last.k_dyn:.3f} in {last.start_time_bound:.4g} s"
    judged = [one for one in front.controllers if one.ratio is not None]
    if not judged:
        return text + "."
    best = min(judged, key=lambda one: one.ratio or math.inf)
    least = best.optimum.k_dyn if best.optimum is not None else math.nan
    named = f"{best.name}, K_dyn {best.k_dyn:.3f} where"
    if len(front.drive.positions) > 1:
        then = f"the best fixed profile in its start time of {best.start_time:.4g} s has {least:.3f}"
        return f"{text}. Lowest beside it: {named} {then}."
    return (
        f"{text}. Nearest to the limit: {named} {least:.3f} is the least "
        f"in its start time of {best.start_time:.4g} s."
    )


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def footnotes(front: Front) -> list[str]:
    """What the bound covers, and why some points are missing."""
    covers = dict.fromkeys(
        f"Lower bound ({point.bound_kind}): {point.bound_covers}".rstrip(".") + "."
        for point in front.points
        if point.found and point.bound_covers
    )
    missing = dict.fromkeys(point.status_text for point in front.points if not point.found)
    reacts = [REACTS] if len(front.drive.positions) > 1 else []
    apart = [
        f"{one.name}: {one.status_text if one.optimum is None else one.optimum.status_text}"
        for one in front.controllers
        if one.ratio is None
    ]
    below = [
        f"{one.name} lies below the lower bound of its start time: its start is not of the class covered."
        for one in front.controllers
        if one.optimum is not None and one.k_dyn < (one.optimum.k_dyn_lower_bound or 0.0)
    ]
    return [*reacts, *covers, *below, *missing, *apart]


def front_figure(front: Front) -> Any:
    """Least K_dyn over start time with its lower bound, and the controllers as labelled points."""
    found = [(p.start_time_bound, p.k_dyn, p.k_dyn_lower_bound) for p in front.points if p.k_dyn is not None]
    placed = [one for one in front.controllers if not math.isnan(one.start_time)]
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 5.4))
        _curve(axes, found, best_start(front.drive))
        for index, one in enumerate(placed):
            axes.plot([one.start_time], [one.k_dyn], MARKERS[index % len(MARKERS)], ms=7, mfc="none", mew=1.8,
                      color=COLOURS[(index + 1) % 8], clip_on=False, zorder=4)  # fmt: skip
        _scale(axes, [k for _, k, _ in found] + [one.k_dyn for one in placed])
        _where_nothing_starts(axes, front)
        axes.set_xlabel(
            f"start time, s     (x: K_dyn over that of the {best_start(front.drive)} at the same start time)"
        )
        axes.set_ylabel("K_dyn")
        axes.set_title(
            f"{front.drive.name}: {best_k_dyn(front.drive)}, terminal {front.terminal}", loc="left"
        )
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper right")
        name_points(figure, axes, [(_with_ratio(one), one.start_time, one.k_dyn) for one in placed])
    return figure


def _with_ratio(one: ControllerPoint) -> str:
    """Its name, and how many times the K_dyn of the best profile at its start time it has."""
    return one.name if one.ratio is None else f"{one.name}, x{one.ratio:.2f}"


def _curve(axes: Axes, found: Sequence[tuple[float, float, float | None]], name: str) -> None:
    if not found:
        return
    times, k = [one[0] for one in found], [one[1] for one in found]
    bounded = [(t, k, low) for t, k, low in found if low is not None]
    axes.plot(times, k, "o-", ms=3.5, color=COLOURS[0], label=name, zorder=3)
    if bounded:
        t, above, below = (list(column) for column in zip(*bounded, strict=True))
        axes.fill_between(t, below, above, color=COLOURS[5], alpha=0.45, lw=0)
        axes.plot(t, below, ls=DASHES[1], lw=1.2, color=COLOURS[4], label="lower bound", zorder=3)


def _where_nothing_starts(axes: Axes, front: Front) -> None:
    """Hatched, where no start is known; crosses at the start times that were refused."""
    refused = [p.start_time_bound for p in front.points if not p.found]
    if refused:
        axes.plot(refused, [0.03] * len(refused), "x", ms=6, mew=1.5, color=GREY, clip_on=False,
                  transform=axes.get_xaxis_transform(), label=f"no {best_start(front.drive)}")  # fmt: skip
    shortest = front.shortest_start_time
    if not math.isnan(shortest):
        left, right = axes.get_xlim()
        if left < shortest:
            axes.axvspan(left, shortest, fc="#F6F6F6", ec="#DDDDDD", hatch="///", lw=0, zorder=0)
            axes.set_xlim(left, right)
        axes.axvline(shortest, color=GREY, lw=1.0, ls=DASHES[1], label=f"shortest found, {shortest:.4f} s")


def _scale(axes: Axes, values: Sequence[float]) -> None:
    """From 0 on, or logarithmic where the largest would press the smallest flat."""
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


def write_front(front: Front, folder: Path, command: str) -> None:
    """Everything about a curve over start times, but its saved state."""
    save_figure(front.plot(), folder, "pareto")
    front.to_csv(folder / "pareto.csv")
    parts = [
        f"# {markdown(front.drive.name)}: {markdown(best_k_dyn(front.drive))} against start time",
        f"Terminal {front.terminal}.",
        markdown(front_conclusion(front)),
        "![pareto](pareto.svg)",
    ]
    for title, table in zip(("The curve", "The controllers"), front_tables(front), strict=True):
        if table.rows:
            parts += [f"## {title}", markdown_table(table)]
    parts += [
        *map(markdown, footnotes(front)),
        "All numbers with their digits: [pareto.csv](pareto.csv). Points with their torque profiles, from "
        "which the same command goes on: [pareto.sqlite](pareto.sqlite).",
    ]
    write_drive_report(folder, parts, front.drive, command)
