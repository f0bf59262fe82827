"""What is shown of an optimal start and of a front: words, tables, figures, files of --out."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.optimal.front import Front
from softstart.optimal.result import Optimum
from softstart.quantities import Units
from softstart.start.metrics import REFERENCE
from softstart.start.recommendation import margins_of
from softstart.start.run import Run
from softstart.views.drawing import COLOURS, DASHES, GREY, LIMIT, drawing, head, new_figure
from softstart.views.numbers import (
    NOTHING,
    DataColumn,
    TextTable,
    number,
    seen,
    short,
    titled,
    units_of,
    with_unit,
)
from softstart.views.sheet import Sheet, records_file
from softstart.views.starts import machine_lines
from softstart.views.traces import draw_trade_off, over_time, shaft_torques, speeds, twists

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softstart.drive import Machine

REACTS = (  # what is to be said beside a best fixed profile
    "It is one torque over time for every start position: feedback reacts to the contact, and its K_dyn can "
    "be lower."
)
OBJECTIVES = {"heat": "minimum heat", "start_time": "minimum start time"}
REPLAY = "softstart simulate {what}.toml --controller profile --param file=profile.csv"
UNRECORDED = (
    "profile", "seconds", "tried", "k_dyn_if_position_known", "k_dyn_each", "start_times", "scenarios",
)  # fmt: skip


def best_start(machine: Machine) -> str:
    """What the best torque over time is called: no optimum where the position is unknown, as feedback reacts.

    >>> from softstart import Drive
    >>> best_start(Drive.load("crane-4amtkf")), best_start(Drive.load("long-travel-3kw"))
    ('optimum', 'best fixed profile')
    """
    return "best fixed profile" if len(machine.positions) > 1 else "optimum"


def best_k_dyn(machine: Machine) -> str:
    """What its K_dyn is called."""
    return "K_dyn of the best fixed profile" if len(machine.positions) > 1 else "minimum K_dyn"


# one optimal start ------------------------------------------------------------------------------------------


def controller_summary(run: Run) -> dict[str, Any]:
    """The figures of a controller that matter beside an optimum."""
    return {"controller": run.controller_name, "k_dyn": run.k_dyn, "start_time": run.start_time}


def _facts(best: Optimum) -> list[list[str]]:
    """The figures of the optimum, as words and numbers; those that it does not have are empty."""
    run, bound, problem, kept = best.run, best.bound, best.problem, best.kept
    bounded, shafts = bound.kind != "none", run.drive.shaft_names
    known, heat = bounded or kept is not None, best.heat_at_least
    units = units_of(run.drive)
    gap = f"{best.optimality_gap_percent:.3g} %" if known else NOTHING
    of_shafts = zip(shafts, best.k_dyns, strict=True) if len(shafts) > 1 else ()
    known_starts = {} if problem.scenarios else best.alone
    searches = ", ".join(f"{one.method} {number(one.value, 6).replace('-', 'none')}" for one in best.tried)

    def limited(limit: float | None, unit: str = "") -> str:
        return "" if limit is None else f" (limit {short(limit)}{unit})"

    return [
        ["K_dyn", number(best.k_dyn, 6) + limited(problem.k_dyn)],
        ["lower bound of K_dyn", f"{number(bound.k_dyn, 6)}, {bound.kind}" if bounded else NOTHING],
        ["above the bound", gap if problem.minimise == "k_dyn" and kept is None else ""],
        ["peak shaft torque", f"{seen(run.peak_torque, 'N*m', units)} at {short(run.peak_time)} s"],
        *([f"K_dyn in {name}", number(k, 6)] for name, k in of_shafts),
        ["start time", f"{short(best.end_time)} s{limited(None if kept else problem.start_time, ' s')}"],
        ["lower bound of the start time", f"{short(kept.at_least)} s" if kept else ""],
        ["above the bound", gap if kept else ""],
        ["I2t heat", f"{short(best.heat)} s of starting torque{limited(problem.heat, ' s')}"],
        ["lower bound of the heat", f"{short(heat)} s, momentum" if heat else ""],
        ["above the bound", gap if heat else ""],
        ["first contact", with_unit(run.first_contact, "s")],
        ["contacts", str(run.contacts)],
        ["knots of the profile", str(best.profile.time.size)],
        *(
            [f"K_dyn, known start position {name}", number(one.k_dyn, 6)]
            for name, one in known_starts.items()
        ),
        ["results of the searches", searches if len(best.tried) > 1 else ""],
    ]


def optimum_question(best: Optimum) -> str:
    """The problem that was solved."""
    problem, kept = best.problem, best.kept
    objective = _objective(best)
    if _by_limits(best) and kept is not None:
        limits = ", ".join(
            f"{name} {short(most)} {of}" for name, _, most, of in (m.seen for m in kept.margins)
        )
        objective = f"minimum start time within the limits ({limits})"
    bounds = {
        "start time at most {:.6g} s": None if _by_limits(best) else problem.start_time,
        "K_dyn at most {:.6g}": problem.k_dyn,
        "heat at most {:.6g} s": problem.heat,
        "one profile for {} machines": len(best.runs) if problem.scenarios else None,
        f"terminal {problem.terminal}": 0.0,
        "torque-speed curve of the motor": 0.0 if problem.torque_speed else None,
        "smoothness {:.6g} s": problem.smoothness or None,
    }
    return ", ".join(
        [objective, *(text.format(value) for text, value in bounds.items() if value is not None)]
    )


def _objective(best: Optimum) -> str:
    """What is minimised."""
    problem = best.problem
    k_dyn = "minimum of the largest K_dyn" if problem.scenarios else best_k_dyn(problem.drive)
    return OBJECTIVES.get(problem.minimise, k_dyn)


def optimum_conclusions(best: Optimum, others: Sequence[Run]) -> list[str]:
    """The optimum, and the best shipped controller beside it: in K_dyn, or in start time within limits."""
    kept, problem = best.kept, best.problem
    if kept is None:
        subject = "Best fixed profile: " if len(problem.machines) > 1 else ""
        subject += "largest K_dyn" if problem.scenarios else "K_dyn"
        quick = [
            run for run in others
            if run.controller_name != REFERENCE and run.start_time <= best.end_time * (1.0 + 1e-9)
        ]  # fmt: skip
        first = min(quick, key=lambda run: run.k_dyn, default=None)
        name = "none" if first is None else f"{first.controller_name}, K_dyn {first.k_dyn:.3f}"
        beside = [f"Best shipped controller within this start time: {name}."] if others else []
        return [f"{subject} {best.k_dyn:.3f} in {best.end_time:.4g} s.", *beside]
    limits = _by_limits(best)
    if limits and not kept.kept:
        answer = (
            f"No start keeps all limits; minimum start time that keeps the others: {best.end_time:.4g} s."
        )
    else:
        answer = f"Minimum start time: {best.end_time:.4g} s, K_dyn {best.k_dyn:.3f}."
    margins = "; ".join(map(str, kept.margins)) if limits else ""
    less = 100.0 * (1.0 - kept.at_least / best.end_time)
    bound = f"Lower bound of the start time: {kept.at_least:.6g} s ({less:.2g} % lower)."
    nearest = "" if kept.tight or kept.refused is None else f" Next limit on the way: {kept.refused}."
    active = (
        f"Active limit: {kept.binding}." if kept.binding else "Only the motor torque limits the start time."
    )

    def keeps(run: Run) -> bool:
        if limits:
            return all(one.kept for one in margins_of(run))
        return not math.isnan(run.start_time) and run.k_dyn <= (problem.k_dyn or math.inf)

    first = min(filter(keeps, others), key=lambda run: run.start_time, default=None)
    within = " within the limits" if limits or kept.margins else ""
    name = "none" if first is None else f"{first.controller_name}, {first.start_time:.4g} s"
    return [
        answer,
        *([f"{margins[:1].upper()}{margins[1:]}."] if margins else []),
        f"{bound} {active}{nearest}",
        f"Quickest shipped controller{within}: {name}.",
    ]


def _by_limits(best: Optimum) -> bool:
    """Whether the quickest start within the limits of the drive is the problem."""
    return best.kept is not None and best.problem.minimise == "k_dyn"


def _value_of_knowledge(best: Optimum) -> list[str]:
    """What K_dyn would be if the start position, or the machine, were known, where one profile serves all."""
    problem, notes = best.problem, list[str]()
    if best.alone:
        what = "machine" if problem.scenarios else "position"
        worst = f"scenario {best.worst + 1}" if problem.scenarios else best.run.position
        name, optimum = max(best.alone.items(), key=lambda item: item[1].k_dyn)
        lower = 100.0 * (1.0 - optimum.k_dyn / best.k_dyn)
        missing = len(problem.machines) - len(best.alone)
        without = f"; {missing} of {len(problem.machines)} without an optimum" if missing else ""
        notes = [
            f"Largest K_dyn: {worst}. With a known {what}: {optimum.k_dyn:.4f} ({name}), {lower:.1f} % "
            f"lower{without}."
        ]
    return [*notes, REACTS] if len(problem.drive.positions) > 1 else notes


SCENARIOS = (  # of (number, two masses, K_dyn, start time)
    DataColumn("scenario", lambda row: str(row[0])),
    DataColumn("gap\nrad", lambda row: row[1].gap, si="rad"),
    DataColumn("J2\nkg m2", lambda row: row[1].J2, si="kg*m^2"),
    DataColumn("Mc\nN m", lambda row: row[1].Mc, si="N*m"),
    DataColumn("K_dyn", lambda row: row[2], 4),
    DataColumn("start\ntime s", lambda row: row[3], digits=5),
)
STRATEGIES = (
    DataColumn("strategy", lambda run: run.controller_name),
    DataColumn("K_dyn", lambda run: run.k_dyn, 4),
    DataColumn("start time s", lambda run: run.start_time, 5),
)


def scenario_table(best: Optimum) -> TextTable:
    """What is different in each machine that the profile serves, and its start."""
    models = [one.lever_rule_model for one in best.problem.machines]
    rows = list(zip(itertools.count(1), models, best.k_dyn_each, best.start_times, strict=False))
    return TextTable.of_data("", SCENARIOS, rows, units_of(best.problem.drive), bold=[best.worst])


_TORQUES = re.compile(r"from (\S+) to (\S+) N m(?: at the motor shaft)?")  # what results are saved with


def covers_seen(text: str, units: Units) -> str:
    """What a bound covers, its torques as they are seen.

    >>> covers_seen("every torque from 0 to 62 N m over time", Units(torque="kN*m"))
    'every torque from 0 to 0.062 kN m over time'
    """
    if not units.gear and units.torque == "N*m":
        return text

    def there(found: re.Match[str]) -> str:
        low, high = (short(float(units.shown(float(one), "N*m"))) for one in found.groups())
        return f"from {low} to {high} {units.label('N*m')}{units.behind}"

    return _TORQUES.sub(there, text)


def bound_sentence(best: Optimum) -> str:
    """What the lower bound covers."""
    kept, bound = best.kept, best.bound
    if kept is not None:
        unchecked = f" {kept.unchecked}" if kept.unchecked else ""
        return f"The lower bound of the start time covers {kept.covers}".rstrip(".") + f".{unchecked}"
    if bound.kind == "none":
        return f"No lower bound is known: {bound.covers}" if bound.covers else "No lower bound."
    units = units_of(best.problem.drive)
    said = f"The lower bound ({bound.kind}) covers {covers_seen(bound.covers, units)}".rstrip(".") + "."
    once = best.bound_once
    if once is None or once.k_dyn <= bound.k_dyn:
        return said
    return f"{said} That of {number(once.k_dyn, 6)} covers {covers_seen(once.covers, units)}."


def optimum_figure(best: Optimum) -> Figure:
    """Motor torque, shaft torque with its bound, speeds and twist of an optimal start, with all limits."""
    problem, others = best.problem, [one for one in best.runs if one is not best.run]
    units = units_of(best.run.drive)

    def torque(value: Any) -> Any:
        return units.shown(value, "N*m")

    def motor(axes: Axes, run: Run) -> None:
        least, most = problem.lowest_torque, problem.highest_torque
        for limit in (least, most):
            axes.axhline(torque(limit), color=LIMIT, lw=1.0, ls=DASHES[1], label="limits" if limit else None)
        if problem.torque_speed:
            at_speed = np.interp(run.w1, *np.array(problem.torque_speed).T)
            axes.plot(run.t, torque(at_speed), color=LIMIT, lw=1.0, ls=":", label="limit at w1")
        axes.plot(run.t, torque(run.u), color=COLOURS[1], label="realised u")
        inside = best.profile.time <= run.end_time
        times = np.append(best.profile.time[inside], run.end_time)
        demand = np.append(best.profile.torque[inside], best.profile.at(run.end_time))
        axes.plot(times, torque(demand), color=COLOURS[6], lw=0.9, ls=DASHES[3], label="demand")
        ends = np.array([np.min(run.u), np.max(run.u), least, most], dtype=np.float64)
        low, high, least, most = torque(ends).tolist()
        unit = units.label("N*m")
        head(
            axes,
            f"motor torque {low:.4g} to {high:.4g} of {least:.4g} to {most:.4g} {unit}",
            f"torque, {unit}",
        )
        axes.margins(y=0.08)

    def shaft(axes: Axes, run: Run) -> None:
        for other in others:
            axes.plot(other.t, torque(other.T), color=GREY, lw=0.7)
        shaft_torques(axes, run)
        title = f"K_dyn {best.k_dyn:.4f}"
        if best.bound.kind != "none":
            least = best.bound.k_dyn * problem.base_torque
            axes.axhline(torque(least), color=COLOURS[4], lw=1.6, ls=DASHES[3], label="bound")
            title += f", at least {best.bound.k_dyn:.4f}"
        if problem.k_dyn is not None:
            most = torque(problem.k_dyn * problem.base_torque)
            axes.axhline(most, color=LIMIT, lw=1.0, ls=DASHES[1], label="permissible")
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))  # "15 % less" is seen as that
        head(axes, title, f"torque, {units.label('N*m')}")

    def speed(axes: Axes, run: Run) -> None:
        speeds(axes, run)
        if problem.start_time is not None and best.kept is None:
            axes.axvline(problem.start_time, color=LIMIT, lw=1.0, ls=DASHES[1], label="allowed")

    objective = "minimum start time within limits" if _by_limits(best) else _objective(best)
    title = f"{best.run.drive.name}: {objective}, terminal {problem.terminal}, {best.method}"
    return over_time(best.run, (motor, shaft, speed, twists), title, "thin: other machines" if others else "")


def optimum_sheet(best: Optimum, others: Sequence[Run] = ()) -> Sheet:
    """What is shown of an optimal start; `others` are the same machine under strategies."""
    problem = best.problem
    drive, several = problem.drive, bool(problem.scenarios)
    numbers = [f"-{index}" for index in range(1, len(best.runs) + 1)] if several else [""]
    traces = {f"trace-optimum{n}.csv": run.to_csv for n, run in zip(numbers, best.runs, strict=True)}
    record = {k: v for k, v in best.summary().items() if k not in UNRECORDED}
    others = sorted(others, key=lambda run: run.k_dyn)
    replay = REPLAY.format(what=drive.WHAT.removeprefix("a "))
    about = {"drive": drive.name, "k_dyn": best.k_dyn}
    return Sheet(
        titled(f"{drive.name}: {'one profile for all' if several else best_start(drive)}", units_of(drive)),
        [*machine_lines(drive), f"  task   {optimum_question(best)}", f"  method {best.method}: {best.why}"],
        facts=_facts(best),
        tables=[
            *([scenario_table(best)] if several else []),
            TextTable.of_data("The strategies on this drive", STRATEGIES, others),
        ],
        conclusions=optimum_conclusions(best, others),
        notes=[*_value_of_knowledge(best), bound_sentence(best)],
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


CURVE = (
    DataColumn("start time\nallowed s", lambda p: p.start_time_bound, digits=5),
    DataColumn("K_dyn", lambda p: p.k_dyn, 4),
    DataColumn("lower\nbound", lambda p: p.k_dyn_lower_bound, 4),
    DataColumn("above\nbound %", lambda p: p.optimality_gap_percent, 3),
    DataColumn("bound", lambda p: p.bound_kind if p.found else NOTHING),
    DataColumn("heat\ns", lambda p: p.heat),
    DataColumn("contacts", lambda p: p.contacts, 0),
    DataColumn("method", lambda p: p.method if p.found else p.status.lower().replace("_", " ")),
)


def _front_tables(front: Front) -> list[TextTable]:
    """The curve, and the controllers, that with the lowest K_dyn first."""
    best = best_start(front.drive)
    controllers = (
        DataColumn("strategy", lambda one: one.name),
        DataColumn("K_dyn", lambda one: one.k_dyn, 4),
        DataColumn("start\ntime s", lambda one: one.start_time, digits=5),
        DataColumn(f"{best}\nat that time", lambda one: one.optimum and one.optimum.k_dyn, 4),
        DataColumn("ratio", lambda one: one.ratio, 3),
    )
    title = f"{best_k_dyn(front.drive)}, terminal {front.terminal}"
    ranked = sorted(front.controllers, key=lambda one: one.k_dyn)
    return [
        TextTable.of_data(title[:1].upper() + title[1:], CURVE, front.points),
        TextTable.of_data(f"Controllers against the {best} at their own start time", controllers, ranked),
    ]


def _front_conclusions(front: Front) -> list[str]:
    """What the curve spans, and the best controller beside the optimum of its own start time."""
    points = [point for point in front.points if point.found]
    if not points:
        return ["None of these start times is feasible."]
    ends = " to ".join(f"{p.k_dyn:.3f} in {p.start_time_bound:.4g} s" for p in points[:1] + points[1:][-1:])
    text, best = f"{best_k_dyn(front.drive)} {ends}.", front.gentlest
    curve = text[:1].upper() + text[1:]
    if best is None or best.optimum is None or best.optimum.k_dyn is None:
        return [curve]
    return [
        curve,
        f"Lowest K_dyn of the controllers: {best.name}, {best.k_dyn:.3f} in {best.start_time:.4g} s; "
        f"{best_start(front.drive)} at that time: {best.optimum.k_dyn:.3f}.",
    ]


def _footnotes(front: Front) -> list[str]:
    """What the bound covers, and why some points are missing."""
    notes = [REACTS] if len(front.drive.positions) > 1 else []
    for point in front.points:
        if not point.found:
            notes.append(point.status_text)
        elif point.bound_covers:
            covers = covers_seen(point.bound_covers, units_of(front.drive))
            notes.append(f"Lower bound ({point.bound_kind}): {covers}".rstrip(".") + ".")
    for one in front.controllers:
        if one.optimum is not None and one.k_dyn < (one.optimum.k_dyn_lower_bound or 0.0):
            notes.append(
                f"{one.name} is below the lower bound of its start time, which does not cover its start."
            )
        if one.ratio is None:
            notes.append(f"{one.name}: {(one.optimum or one).status_text}")
    return list(dict.fromkeys(notes))


def front_figure(front: Front) -> Figure:
    """Minimum K_dyn over start time with its lower bound, and the controllers as named points."""
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 5.0))
        draw_front(axes, front)
    return figure


def draw_front(axes: Axes, front: Front) -> None:
    """The same on given axes."""
    optima = [(p.start_time_bound, p.k_dyn) for p in front.points if p.k_dyn is not None]
    bound = [
        (p.start_time_bound, p.k_dyn_lower_bound) for p in front.points if p.k_dyn_lower_bound is not None
    ]
    points = [
        (one.name, one.start_time, one.k_dyn) for one in front.controllers if not math.isnan(one.start_time)
    ]
    ratios = {one.name: f", x{one.ratio:.2f}" for one in front.controllers if one.ratio is not None}
    best, shortest = best_start(front.drive), front.shortest_start_time
    title = f"{front.drive.name}: {best_k_dyn(front.drive)}, terminal {front.terminal}"
    note = f"     (x: K_dyn over that of the {best} at the same start time)"
    refused = [p.start_time_bound for p in front.points if not p.found]
    if refused:
        axes.plot(refused, [0.03] * len(refused), "x", ms=6, mew=1.5, color=GREY, clip_on=False,
                  transform=axes.get_xaxis_transform(), label=f"no {best}")  # fmt: skip
    if not math.isnan(shortest):
        axes.axvline(shortest, color=GREY, ls=DASHES[1], label=f"shortest found, {shortest:.4f} s")
    draw_trade_off(axes, points, title=title, optima=optima, best=best, bound=bound, note=note, notes=ratios)
    axes.set_xlim(left=min([axes.get_xlim()[0], *(0.98 * t for t in refused)]))


def front_sheet(front: Front) -> Sheet:
    """What is shown of a curve over start times."""
    return Sheet(
        f"{front.drive.name}: {best_k_dyn(front.drive)} against start time, terminal {front.terminal}",
        machine_lines(front.drive),
        tables=_front_tables(front),
        conclusions=_front_conclusions(front),
        notes=_footnotes(front),
        figures={"pareto": lambda: front_figure(front)},
        panel=lambda ax: draw_front(ax, front),
        records=front.records,
        files={"pareto.csv": front.to_csv},
        machine=front.drive,
    )
