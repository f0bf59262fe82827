"""What is shown of a tuning: sentences, tables, maps over gap and load inertia, and the files of --out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from softstart.controller.parameters import declared_parameters
from softstart.errors import Sentence
from softstart.tuning.problem import MARGIN
from softstart.views.drawing import SMALL, colour_scale, drawing, entitle, heat_map, panels
from softstart.views.numbers import (
    Column,
    DataColumn,
    TextTable,
    at_output,
    column_of,
    gear_in_words,
    label,
    plural,
    short,
    titled,
    units_of,
)
from softstart.views.sheet import Sheet, Writer, columns_file
from softstart.views.starts import hertz, machine_lines

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import DataArray, Dataset

    from softstart.tuning.outcome import RobustSet, Tuning

PRICES = {
    "robust_over_schedule": "one set / each cell tuned",
    "schedule_over_optimum": "each cell tuned / optimum",
    "robust_over_optimum": "one set / optimum",
}
MOST_DERIVED = 5  # values in a sentence
SHOWN = 24  # cells on a terminal
SAME_TIME = 1e-3  # bounds on the start time that differ by less count as one


def figure_of(tuning: Tuning, what: str) -> Figure:
    """Maps of the gains, of the metric tuned and by default, of the robust set, of its price."""
    robust = None if tuning.robust is None else tuning.robust.cells
    table = {"price": tuning.price, "robust": robust}.get(what, tuning.schedule)
    assert table is not None
    name, metric, q = tuning.metric, _metric(tuning), tuning.problem
    if what == "gains":
        si = {one.name: one.unit for one in tuning.problem.ranges}
        units = units_of(tuning.drive)
        table = table.assign({name: units.shown(table[name], unit) for name, unit in si.items()})
        maps = {name: label(name, units.label(unit)) for name, unit in si.items()}
        return _maps(tuning, table, maps, "gains of each cell")
    if what == "price":
        maps = {one: title for one, title in PRICES.items() if one in table}
        return _maps(tuning, table, maps, f"price of robustness, ratios of {metric}", alike=3)
    gains = "tuned for each cell" if what == "metric" else "one set for all"
    maps = {f"{name}_default": f"{metric}, defaults", name: f"{metric}, {gains}"}
    return _maps(tuning, table, maps | {q.time: f"{q.time_name}, {gains}, s"}, gains, alike=2)


def _maps(tuning: Tuning, table: Dataset, maps: dict[str, str], title: str, alike: int = 0) -> Figure:
    """Maps side by side; the first `alike` share one scale of colours."""
    q, units = tuning.problem, units_of(tuning.drive)
    gaps, inertias = (
        [f"{units.shown(value, si):.3g}" for value in axis]
        for axis, si in ((q.gaps, "rad"), (q.load_inertias, "kg*m^2"))
    )
    size = max(3.2, 1.2 + 0.62 * len(inertias)), max(1.6, 0.9 + 0.42 * len(gaps))
    fields = [np.asarray(table[name], dtype=np.float64) for name in maps]
    late = ~np.asarray(table["in_time"], dtype=bool) if tuning.metric in maps else None
    if late is not None and late.any():
        title += " (struck out: later than allowed)"
    with drawing():
        own = "" if len(tuning.drive.mass_names) == 2 else " at its own shaft"
        figure, axes = panels(
            len(maps), size, 3, f"load inertia J2{own}, kg m2", f"gap, {units.label('rad')}"
        )
        for index, (panel, name) in enumerate(zip(axes, maps, strict=True)):
            values = fields[index]
            scale = colour_scale(*(fields[:alike] if index < alike else [values]))
            struck = late if name in (tuning.metric, q.time) else None
            largest = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
            decimals = min(max(2 - math.floor(math.log10(largest)), 0), 6) if largest else 2  # three digits
            heat_map(panel, inertias, gaps, values, scale, decimals=decimals, struck=struck)
            panel.set_title(maps[name], loc="left", fontsize=SMALL)
        entitle(figure, titled(f"{tuning.drive.name}: {tuning.controller}, {title}", units))
    return figure


def _metric(tuning: Tuning) -> str:
    """The metric in words."""
    return "share of the limits" if tuning.problem.metric == MARGIN else label(tuning.metric)


def any_in_time(tuning: Tuning) -> bool:
    """Whether anything that was found keeps its bound on the start time."""
    scheduled = tuning.schedule is not None and bool(tuning.schedule["in_time"].any())
    return scheduled or (tuning.robust is not None and tuning.robust.feasible)


def tuning_question(tuning: Tuning) -> str:
    """What was asked, in a sentence."""
    q = tuning.problem
    by = "worst case" if q.quantile == 1.0 else f"quantile {q.quantile:g}"
    duty = "" if q.plan is None else f" over the duty {q.plan.words()}"
    over = f", {by} of {len(q.scenarios)} scenarios a cell" if len(q.scenarios) > 1 else ""
    what = "margin to the limits maximised" if q.metric == MARGIN else f"{_metric(tuning)} minimised"
    return (
        f"{tuning.controller}: {what}{duty}, {q.time_name} {q.bound}, "
        f"gaps: {len(q.gaps)}, load inertias: {len(q.load_inertias)}{over}. Tuned: "
        f"{'; '.join(f'{one.name} {one.text(units_of(tuning.drive))}' for one in q.ranges)}."
    )


def _columns(table: Dataset) -> dict[str, list[Any]]:
    """The cells of a table over the grid, the load inertia changing fastest."""
    frame = table.to_dataframe(["gap", "load_inertia"]).reset_index()
    return {str(name): values for name, values in frame.to_dict("list").items()}


_TIMES = {"start_time": "start\ntime s", "settled_time": "settled\nin s"}


def schedule_cells(tuning: Tuning, table: Dataset) -> TextTable:
    """The schedule, one row per cell."""
    of, metric, q, units = _columns(table), _metric(tuning), tuning.problem, units_of(tuning.drive)
    numbers = {
        f"gap\n{units.label('rad')}": units.shown(np.array(of["gap"]), "rad").tolist(),
        "J2\nkg m2": units.shown(np.array(of["load_inertia"]), "kg*m^2").tolist(),
        **{
            label(one.name, seen.label(one.unit), "\n"): seen.shown(np.array(of[one.name]), one.unit).tolist()
            for one in tuning.problem.ranges
            for seen in (units.of_setting(one.name, one.unit),)
        },
        f"{metric}\ndefault": of[f"{tuning.metric}_default"],
        f"{metric}\ntuned": of[tuning.metric],
        _TIMES[q.time]: of[q.time],
    }
    columns = {heading: column_of(values) for heading, values in numbers.items()} | {
        "at most\ns": [one.replace("inf", "-") for one in column_of(of[f"{q.time}_bound"])],
        "in\ntime": ["yes" if good else "no" for good in of["in_time"]],
        "searches\nagree": [f"{n} of {tuning.problem.restarts}" for n in of["agreement"]],
    }
    return TextTable.of(titled("Gains for each cell", units), columns, most=SHOWN, keys=2)


def _robust_table(tuning: Tuning, robust: RobustSet) -> TextTable:
    """The robust set beside the defaults."""
    si, units = {one.name: one.unit for one in tuning.problem.ranges}, units_of(tuning.drive)

    def there(name: str) -> str:
        return "" if units.gear else at_output(tuning.drive, robust.gains[name], si[name])

    def shown(gains: Mapping[str, float]) -> Callable[[str], float]:
        return lambda name: float(units.of_setting(name, si[name]).shown(gains[name], si[name]))

    columns = [
        DataColumn("parameter", str),
        DataColumn("default", shown(robust.defaults), text=short),
        DataColumn("robust", shown(robust.gains), text=short),
        DataColumn("unit", lambda name: units.of_setting(name, si[name]).label(si[name])),
        DataColumn("robust, at\nthe output", there, text=str, optional=True),
    ]
    return TextTable.of_data(titled("One set for all", units), columns, list(robust.gains))


def _tables(tuning: Tuning) -> Iterator[TextTable]:
    """The schedule, the robust set and its metric over the grid, and what it costs."""
    if tuning.schedule is not None:
        yield schedule_cells(tuning, tuning.schedule)
    if tuning.robust is not None:
        yield _robust_table(tuning, tuning.robust)
        yield _grid(tuning, f"{_metric(tuning)} with this set", tuning.robust.cells[tuning.metric])
    if tuning.price is not None and "robust_over_schedule" in tuning.price:
        title = "Price of robustness: one set over gains for each cell"
        yield _grid(tuning, title, tuning.price["robust_over_schedule"])


def _grid(tuning: Tuning, title: str, values: DataArray) -> TextTable:
    """A figure over the grid, one row per gap."""
    q, units = tuning.problem, units_of(tuning.drive)
    gaps = [short(float(units.shown(gap, "rad"))) for gap in q.gaps]
    cells = gaps, *(column_of(column) for column in values.to_numpy().T.tolist())
    inertias = [units.shown(inertia, "kg*m^2") for inertia in q.load_inertias]
    headings = [f"gap {units.label('rad')}", *(f"J2 {inertia:.4g}" for inertia in inertias)]
    return TextTable(titled(title, units), list(map(Column, headings)), list(zip(*cells, strict=True)))


def _digits(value: float) -> str:
    """A figure in a sentence: three decimals, or three digits where these say nothing.

    >>> _digits(1.0774), _digits(0.0), _digits(2.513e-8), _digits(3.21e14)
    ('1.077', '0.000', '2.51e-08', '3.21e+14')
    """
    return f"{value:.3f}" if value == 0.0 or 0.1 <= abs(value) < 1e6 else f"{value:.3g}"


def _between(values: ArrayLike) -> str:
    """Least to largest value."""
    numbers = np.asarray(values, dtype=np.float64)
    finite = numbers[np.isfinite(numbers)]
    ends = (finite.min(), finite.max()) if finite.size else ()
    return " to ".join(dict.fromkeys(_digits(end) for end in ends)) or "none"


def conclusions(tuning: Tuning) -> list[str]:
    """What tuning for each cell brings, what one set does, and what robustness costs."""
    name, metric, table, price = tuning.metric, _metric(tuning), tuning.schedule, tuning.price
    one, quantile = tuning.robust, tuning.problem.quantile
    sentences = [f"Warning: {warning}" for warning in tuning.plausibility_warnings]
    shares = list[tuple[str, Any, Any]]()
    if table is not None:
        late = int((~table["in_time"]).sum())
        timing = f"{late} of {table['in_time'].size} cells late" if late else "all in time"
        shares.append(("gains for each cell", table[name], table[f"{name}_default"]))
        sentences.append(
            f"Gains for each cell: {metric} {_between(table[name])} (defaults "
            f"{_between(table[f'{name}_default'])}); {timing}."
        )
    if one is not None:
        kind = "at most" if quantile == 1.0 else f"quantile {quantile:g}"
        timing = "all in time" if one.feasible else f"{100 * one.excess:.1f} % late"
        shares.append(("one set for all", one.worst, one.worst_default))
        sentences.append(
            f"One set for all: {metric} {kind} {_digits(one.worst)} (defaults of the nominal drive "
            f"{_digits(one.worst_default)}); {timing}; {one.agreement} of {one.restarts} "
            "searches agree."
        )
        if one.ends is not None:
            end = "stiff" if one.ends[0] >= one.ends[1] else "soft"
            drives = (tuning.problem.drive, tuning.problem.soft)
            ends = " and ".join(
                f"{_digits(worst)} at {hertz(at)} Hz" for at, worst in zip(drives, one.ends, strict=True)
            )
            sentences.append(f"One set at both ends of the stiffness: {ends}. The {end} end is critical.")
    if tuning.problem.metric == MARGIN:
        margins = (
            f"{what} {100.0 * (1.0 - float(np.max(tuned))):.3g} % (defaults "
            f"{100.0 * (1.0 - float(np.max(default))):.3g} %)"
            for what, tuned, default in shares
        )
        sentences.append(f"Smallest margin to the limits: {'; '.join(margins)}.")
    ratios = [
        f"{title} {_between(price[ratio])}"
        for ratio, title in PRICES.items()
        if price is not None and ratio in price
    ]
    return [*sentences, f"Ratios of {metric}: {'; '.join(ratios)}."] if ratios else sentences


def derived_note(robust: RobustSet) -> str:
    """What the robust set takes from the nominal drive beside its gains, and how to get the same; else ""."""
    if not robust.derived:
        return ""
    nominal = robust.controller.nominal
    si, units = declared_parameters(robust.controller.controller), units_of(nominal)

    def words(value: float, si: str, digits: int) -> str:
        return f"{units.shown(value, si):.{digits}g} {units.label(si)}".rstrip()

    texts = [
        f"{name} = {words(value, si[name].unit if name in si else '1', 5)}"
        for name, value in robust.derived.items()
    ]
    more = f" and {len(texts) - MOST_DERIVED} more (table about.derived)" if len(texts) > MOST_DERIVED else ""
    gap, inertia = nominal.gap_and_inertia
    return (
        f"The set derives from the nominal drive (gap {words(gap, 'rad', 4)}, "
        f"J2 {words(inertia, 'kg*m^2', 4)}): "
        f"{', '.join(texts[:MOST_DERIVED])}{more}. In other cells the gains alone derive other values, with "
        "other results. The same controller everywhere: --controller robust.toml, for an export --gains "
        "robust.toml, in Python robust.controller (RobustGains)."
    )


def tuning_notes(tuning: Tuning) -> list[str]:
    """What the columns mean, and how reliable the search is."""
    drive, q, price, notes = tuning.drive, tuning.problem, tuning.price, list[str]()
    noun = "start" if q.plan is None else "duty"
    if len(drive.mass_names) > 2:
        load = drive.mass_names[drive.load_index]
        notes.append(f"gap: total backlash at the motor shaft; J2: inertia of {load} at its own shaft.")
    if tuning.robust is not None:
        notes += tuning.robust.controller.controller.doubts(tuning.robust.controller.nominal)
        notes += [one for one in (tuning.robust_loop, derived_note(tuning.robust)) if one]
    if q.soft is not None:
        notes.append(
            Sentence(
                f"No stiffness is known. Gains are set up for an elastic frequency of {hertz(q.drive)} Hz, "
                f"the stiff end of its range, and evaluated there and at {hertz(q.soft)} Hz.",
                "When it is known, give shaft.elastic_frequency or a stiffness, and tune again.",
            )
        )
    if tuning.schedule is not None:
        sure = int((tuning.schedule["agreement"] == q.restarts).sum())
        notes.append(
            f"Searches agree: within 1 % of the best; all {q.restarts} do in {sure} of {len(q.cells)} cells."
        )
        if not bool(tuning.schedule["in_time"].all()):
            notes.append("Late cells have the smallest delay found.")
    if tuning.between is not None:
        beyond = 100 * float(tuning.between["excess"].max())
        notes.append(
            f"Half way between the cells, with interpolated gains: {_metric(tuning)} "
            f"{_between(tuning.between[tuning.metric])}, at most {beyond:.1f} % late."
        )
    if price is not None and "robust_over_schedule" in price:
        robust, each = (np.asarray(price[f"{side}_bound"]) for side in ("robust", "schedule"))
        known = np.isfinite(robust) & np.isfinite(each)
        difference = float(np.max(np.abs(robust[known] / each[known] - 1.0), initial=0.0))
        if difference > SAME_TIME:
            notes.append(
                f"Permitted {q.time_name}s: one set, that of the defaults of the nominal drive; each cell "
                f"tuned, that of the defaults there. They differ by up to {100.0 * difference:.1f} %."
            )
    for ratio, title in PRICES.items():
        if price is not None and ratio in price and (missing := int(price[ratio].isnull().sum())):
            notes.append(f"{title}: {missing} of {price[ratio].size} cells late or without an optimum.")
    if price is not None and any("optimum" in str(name) for name in price):
        notes.append("Optimum: drive of the cell, motor without lag, dead time and noise; terminal reached.")
    if drive.gear is not None and not units_of(drive).gear:
        gaps, inertias = (
            " to ".join(dict.fromkeys(at_output(drive, value, unit) for value in (axis[0], axis[-1])))
            for axis, unit in ((q.gaps, "rad"), (q.load_inertias, "kg*m^2"))
        )
        notes.append(
            f"Gaps at the output: {gaps} {units_of(drive).label('rad')}, load inertias there: {inertias} "
            f"kg m2. {gear_in_words(drive)}"
        )
    return [*notes, *([f"{plural(tuning.starts, noun)}."] if tuning.starts else [])]


def tuning_sheet(tuning: Tuning) -> Sheet:
    """What is shown of a tuning."""
    files: dict[str, str | Writer] = {}
    figures, what = ["price"] if tuning.price is not None else [], tuning.drive.WHAT.removeprefix("a ")
    if tuning.schedule is not None:
        figures += ["metric", "gains"]
        files |= {"schedule.toml": partial(tuning.to_toml, what="schedule"), "schedule.csv": tuning.to_csv}
    if tuning.robust is not None:
        figures.append("robust")
        files["robust.toml"] = partial(tuning.to_toml, what="robust")
        files["robust-cells.csv"] = columns_file(_columns(tuning.robust.cells))
    for name in ("between", "price"):
        if (table := getattr(tuning, name)) is not None:
            files[f"{name}.csv"] = columns_file(_columns(table))
    return Sheet(
        titled(f"{tuning.drive.name}: {tuning.controller} tuned", units_of(tuning.drive)),
        machine_lines(tuning.drive),
        tuning_question(tuning),
        tables=list(_tables(tuning)),
        conclusions=conclusions(tuning),
        notes=tuning_notes(tuning),
        figures={one: partial(figure_of, tuning, one) for one in figures},
        files=files,
        machine=tuning.drive,
        behind=[
            f"Each TOML file of gains stands for a controller everywhere: `softstart simulate {what}.toml "
            "--controller FILE`; a schedule takes the gap and load inertia that the drive declares."
        ],
    )
