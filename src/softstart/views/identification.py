"""An identification and a plan of experiments in words, tables and figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.drive import PARAMETERS
from softstart.identification.model import FILTER, POSITION, LogModel
from softstart.identification.result import AT_LIMIT
from softstart.identification.wear import YEAR
from softstart.views.drawing import COLOURS, GREY, drawing, entitle, head, new_figure
from softstart.views.numbers import NOTHING, Table, number, short

if TYPE_CHECKING:
    from softstart.identification.planning import Experiment, Plan
    from softstart.identification.result import Estimate, Identification
    from softstart.identification.wear import Wear
    from softstart.start.recommendation import Row

UNITS = {one.name: (one.path, one.unit) for one in PARAMETERS.values()}


def headline(found: Identification) -> list[str]:
    """What was identified from what."""
    samples = sum(one.time.size for one in found.logs)
    if not found.logs:
        return [f"{found.drive.name}: {found.drive.source}"]
    logs = f"{len(found.logs)} logs" if len(found.logs) > 1 else found.logs[0].name
    known = sum(one.known for one in found.shared)
    told = f"{known} of {len(found.shared)} parameters are told by the logs"
    return [
        f"{found.drive.name}: identified from {logs}",
        f"  {samples} samples of torque and {' and '.join(sorted({one.kind for one in found.logs}))}; "
        f"{told if found.stated else 'best fit, no intervals'}",
        f"  {found.agreed} of {found.searches} searches ended at the best minimum; torque error "
        f"{found.ripple:.3g} N m in each sample",
    ]


def estimates_table(found: Identification) -> Table:
    """A row for each parameter: guess, value, interval."""
    rows = found.estimates
    cells = {
        "parameter": [_name(one) for one in rows],
        "unit": [UNITS[one.name][1] if _shared(one) else "s" if one.name == FILTER else "1" for one in rows],
        "guess": [_guess(found, one) for one in rows],
        "found": [_found(one) for one in rows],
        "+- %": [
            number(100.0 * one.half_width, 2) if one.known and one.value and _shared(one) else NOTHING
            for one in rows
        ],
        "from": [_digits(one.lower, one) for one in rows],
        "to": [_digits(one.upper, one) for one in rows],
    }
    title = "Found, with intervals of 95 %" if found.stated else "Best fit, no intervals"
    return Table.of(title, cells, ("parameter", "unit"))


def _found(one: Estimate) -> str:
    if one.known or math.isnan(one.upper):
        return _digits(one.value, one)
    return AT_LIMIT if one.reason == AT_LIMIT else "unknown"


def _shared(one: Estimate) -> bool:
    return one.name in UNITS


def _name(one: Estimate) -> str:
    if _shared(one):
        return UNITS[one.name][0]
    return one.name.replace("position", "position in gap, log").replace("_", " ")


def _guess(found: Identification, one: Estimate) -> str:
    return short(float(getattr(found.guess, one.name))) if _shared(one) else NOTHING


def _digits(value: float, one: Estimate) -> str:
    """As many digits as the interval leaves meaning, one more than are certain."""
    width = 0.5 * (one.upper - one.lower)
    if math.isnan(width):  # no interval is stated
        return NOTHING if math.isnan(value) else f"{value:.3g}"
    if not (math.isfinite(width) and width > 0.0 and value):
        return short(value)
    digits = max(2, min(7, 2 + math.ceil(math.log10(max(abs(value) / width, 1.0)))))
    return f"{value:.{digits}g}"


def k_dyn_table(each: Mapping[str, tuple[float, float, float]]) -> Table:
    """K_dyn of strategies with intervals."""
    rows = sorted(each.items(), key=lambda one: one[1][0])
    cells = {
        "strategy": [name for name, _ in rows],
        "K_dyn": [number(value, 3) for _, (value, _, _) in rows],
        "from": [number(lower, 3) for _, (_, lower, _) in rows],
        "to": [number(upper, 3) for _, (_, _, upper) in rows],
    }
    stated = all(math.isfinite(upper) for _, _, upper in each.values())
    title = "K_dyn of the drive found" + (", with intervals of 95 %" if stated else "")
    return Table.of(title, cells, ("strategy",))


def figure(found: Identification) -> Any:
    """Each log beside the start of the drive found, and below what is left."""
    with drawing():
        made, axes = new_figure(
            3, len(found.logs), (4.5 + 3.5 * len(found.logs), 6.0), squeeze=False, sharex="col"
        )
        entitle(made, f"{found.drive.name}: what was logged, and the start of the drive found")
        values = {one.name: one.value for one in found.estimates if not one.name.startswith(POSITION)}
        for i, (log, left) in enumerate(zip(found.logs, found.residuals, strict=True)):
            own = f"{POSITION} {i + 1}"
            position = {POSITION: found[own].value} if own in {one.name for one in found.estimates} else {}
            base = found.guess.replace(start_position="mid-gap") if position else found.guess.design_drive
            model = LogModel(log, base).signals([values | position])[0]
            seen = np.isfinite(log.values)
            time, unit = log.time - log.time[0], "rad" if log.kind == "angle" else "rad/s"
            head(axes[0][i], log.name, "torque, N m")
            axes[0][i].plot(
                time,
                log.torque,
                color=COLOURS[0],
                drawstyle="steps-post" if log.torque_is == "demand" else None,
            )
            offset = float(np.median(log.values[seen] - model[seen])) if log.kind == "angle" else 0.0
            head(axes[1][i], "", f"{log.kind}, {unit}")
            axes[1][i].plot(time[seen], log.values[seen], ".", ms=2.5, color=GREY, label="log")
            axes[1][i].plot(time, model + offset, color=COLOURS[1], lw=1.0, label="drive found")
            axes[1][i].legend(loc="best")
            head(axes[2][i], "", f"drive - log, {unit}", "time, s")
            axes[2][i].plot(time[seen], left, color=COLOURS[2], lw=0.8)
            axes[2][i].axhline(0.0, color=GREY, lw=0.6)
        return made


def plan_headline(plan: Plan) -> list[str]:
    """What the plan is for."""
    encoder = f"{plan.lines:g} encoder lines" if plan.lines else "an ideal encoder"
    return [
        f"{plan.drive.name}: what an experiment would tell",
        f"  a sample each {1e3 * plan.log_period:g} ms, {encoder}, a torque error of "
        f"{plan.ripple:.3g} N m in each",
    ]


def plan_table(plan: Plan) -> Table:
    """Half an interval of 95 % of each parameter, in %, under each experiment."""
    shown = plan.experiments
    names = list(shown[0].widths)
    cells = {
        "parameter": [
            *(UNITS[name][0] for name in names),
            "peak shaft torque, N m",
            "load moves, rad",
            "lasts, s",
        ],
        **{one.name.replace(", ", ",\n"): _column(one, names) for one in shown},
    }
    return Table.of("Half intervals of 95 %, in % of the value", cells, ("parameter",))


def _column(one: Experiment, names: Sequence[str]) -> list[str]:
    widths = [one.widths[name] for name in names]
    told = ["unknown" if math.isinf(width) else f"{100.0 * width:.2g}" for width in widths]
    return [*told, f"{one.peak:.3g}", f"{one.travel:.3g}", f"{one.end:.3g}"]


def plan_conclusion(plan: Plan) -> str:
    """Which experiment tells most."""
    best = plan.best
    designed = "".join(
        f" {one.name[0].upper()}{one.name[1:]}: {one.found_by}."
        for one in plan.experiments
        if one.found_by != "standard"
    )
    lost = [name for name, width in best.widths.items() if math.isinf(width)]
    if lost:
        return f'"{best.name}" tells most, and still leaves {", ".join(lost)} unknown.{designed}'
    worst = max(best.widths, key=lambda name: best.widths[name])
    return (
        f'"{best.name}" tells most: every parameter within {100.0 * best.widths[worst]:.2g} %, {worst} the '
        f"worst; the shaft torque reaches {best.peak:.3g} N m.{designed}"
    )


def plan_figure(plan: Plan) -> Any:
    """The torque of each experiment."""
    with drawing():
        made, axes = new_figure(
            len(plan.experiments), 1, (7.0, 1.3 * len(plan.experiments) + 1.0), sharex=True, squeeze=False
        )
        entitle(made, f"{plan.drive.name}: torque demand of each experiment")
        for axis, one, colour in zip(axes[:, 0], plan.experiments, COLOURS, strict=False):
            time = np.linspace(0.0, one.end, 1000)
            axis.plot(time, one.profile.at(time), color=colour)
            axis.axhline(0.0, color=GREY, lw=0.6)
            head(axis, one.name, "N m")
        axes[-1, 0].set_xlabel("time, s")
        return made


def wear_table(wear: Wear) -> Table:
    """The gap of each identification."""
    cells = {
        "date": [str(one) for one in wear.dates],
        "identification": list(wear.names),
        "gap rad": [_digits(one.value, one) for one in wear.gaps],
        "from": [_digits(one.lower, one) for one in wear.gaps],
        "to": [_digits(one.upper, one) for one in wear.gaps],
    }
    return Table.of("Gap, with intervals of 95 %", cells, ("date", "identification"))


def wear_conclusion(wear: Wear) -> list[str]:
    """How fast the gap grows, when it reaches its limit, and which strategies keep what they promise then."""
    growth, lower, upper = wear.line.growth
    said = [f"The gap grows by {growth:.3g} rad a year ({lower:.3g} to {upper:.3g})."]
    if wear.worn is None:
        return said
    reached, earliest, latest = wear.worn
    when = "not on this line" if reached is None else f"on {reached}"
    begin = "before any of these dates" if earliest is None else str(earliest)
    end = "never, as the growth may be none" if latest is None else str(latest)
    if math.isinf(wear.line.reaches(float(wear.limit or 0.0))[1]):
        said.append(f"It does not reach {short(float(wear.limit or 0.0))} rad: it does not grow.")
    else:
        said.append(
            f"It reaches {short(float(wear.limit or 0.0))} rad {when}; the interval of 95 % goes from "
            f"{begin} to {end}, if wear goes on as it has."
        )
    if wear.found[-1].drive.limits:
        good = [row.name for row in wear.then if row.least_margin is not None and row.least_margin.kept]
        said.append(
            "Strategies that keep the limits of the drive then, at the upper end of their intervals too: "
            f"{', '.join(good) or 'none'}."
        )
    else:
        lost = [
            f"{two.name} {100.0 * (two.run.k_dyn / one.run.k_dyn - 1.0):+.1f} %"
            for one, two in zip(wear.now, wear.then, strict=True)
        ]
        said.append(
            f"K_dyn then, beside now: {', '.join(lost)}. Give [limits] to the drive to know which is enough."
        )
    return said


def wear_strategies(wear: Wear) -> Table:
    """Each strategy now and with the gap at its limit, set up for the drive found last."""
    pairs = sorted(zip(wear.now, wear.then, strict=True), key=lambda pair: pair[1].run.k_dyn)
    now, then = [one for one, _ in pairs], [one for _, one in pairs]

    def span(row: Row) -> str:
        return " to ".join(number(end, 3) for end in row.intervals["k_dyn"])

    cells = {
        "strategy": [row.name for row in now],
        "K_dyn\nnow": [number(row.run.k_dyn, 3) for row in now],
        "95 %": [span(row) for row in now],
        "K_dyn\nworn": [number(row.run.k_dyn, 3) for row in then],
        "95 % ": [span(row) for row in then],
        "peak to\nN m": [f"{row.intervals['peak_torque'][1]:.4g}" for row in then],
    }
    if wear.found[-1].drive.limits:
        cells |= {
            "limits now": [row.against_limits for row in now],
            "worn": [row.against_limits for row in then],
        }
    title = f"Strategies now, and with a gap of {short(float(wear.limit or 0.0))} rad"
    return Table.of(title, cells, ("strategy", "95 %", "95 % ", "limits now", "worn"))


def wear_figure(wear: Wear) -> Any:
    """The gaps over time, the line with its interval, and the limit."""
    first = wear.dates[0]
    years = [(one - first).days / YEAR for one in wear.dates]
    end = max(1.3 * years[-1], min(wear.line.reaches(wear.limit)[0], 4.0 * years[-1]) if wear.limit else 0.0)
    with drawing():
        made, ((axes,),) = new_figure(1, 1, (7.0, 4.0), squeeze=False)
        entitle(made, f"{wear.found[-1].drive.name}: wear")
        time = np.linspace(0.0, end if math.isfinite(end) else 1.3 * years[-1], 200)
        line, half = wear.line.at(time)
        axes.fill_between(time, line - half, line + half, color=COLOURS[0], alpha=0.2, lw=0.0)
        axes.plot(time, line, color=COLOURS[0], label="line, interval of 95 %")
        values = np.array([one.value for one in wear.gaps])
        reach = np.array([[one.value - one.lower, one.upper - one.value] for one in wear.gaps]).T
        axes.errorbar(
            years, values, yerr=reach, fmt="o", ms=5, capsize=3, color=COLOURS[1], label="identified"
        )
        if wear.limit is not None:
            axes.axhline(wear.limit, color=GREY, ls="--", lw=1.0, label="limit")
        head(axes, "", "gap, rad", f"years after {first}")
        axes.set_ylim(bottom=0.0)
        axes.legend(loc="best")
        return made
