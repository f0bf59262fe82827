"""What `softstart balance` tells people: the engine, its orders, the designs and what they leave."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.balancing import Balance, Residual

RPM = math.pi / 30.0


class Shown(NamedTuple):
    """A titled table: headings (with line breaks), cells, and how many columns from the left are text."""

    title: str
    headings: list[str]
    rows: list[list[str]]
    texts: int


def engine_lines(found: Balance) -> list[str]:
    """The engine in a few lines; a star marks what is assumed."""
    from softstart.balancing import MeasuredCycle
    from softstart.views.numbers import printable, short

    engine = found.engine
    cylinders, masses, weights = engine.cylinders, engine.masses, engine.counterweights
    gas = engine.gas

    def star(*keys: str) -> str:
        return "*" if any(key in engine.assumed for key in keys) else ""

    def mm(key: str) -> str:
        return f"{short(1e3 * getattr(cylinders, key))} mm{star('cylinders.' + key)}"

    firing = ", ".join(short(math.degrees(angle)) for angle in cylinders.firing_angles)
    load = f"load {short(found.load)}{star('operation.load')}"
    if isinstance(gas, MeasuredCycle):
        pressure = f"measured, {len(gas.angles)} points"
    else:
        mean = engine.indicated_work(found.tuning_speed, found.load) / engine.displacement
        ratio = f"{short(gas.compression_ratio)}{star('cycle.compression_ratio')}"
        pressure = (
            f"simple cycle, compression {ratio}, mean indicated pressure {1e-5 * mean:.2f} bar"
            f"{star('cycle.mean_indicated_pressure')} at the tuning speed, {load}"
        )
    shares = (
        f"{short(100 * weights.reciprocating_share)} % of the reciprocating"
        f"{star('counterweights.reciprocating_share')} and {short(100 * weights.rotating_share)} % of the "
        f"rotating{star('counterweights.rotating_share')}"
    )
    low, high = (getattr(engine.operation, key) / RPM for key in ("lowest_speed", "highest_speed"))
    speeds = f"{short(low)} to {short(high)} rpm{star('operation.lowest_speed', 'operation.highest_speed')}"
    fluctuation = engine.speed_fluctuation(found.tuning_speed, found.load)
    uneven = "" if fluctuation is None else f", speed fluctuation there {100 * fluctuation:.2g} %"
    lines = [
        printable(engine.name),
        f"  cylinders  {cylinders.count} in line, bore {mm('bore')}, stroke {mm('stroke')}, rod "
        f"{mm('rod_length')}, {1e6 * engine.displacement:.1f} cm3, firing at {firing} deg",
        f"  masses     reciprocating {short(masses.reciprocating)} kg{star('masses.reciprocating')}, "
        "rotating "
        f"{short(masses.rotating)} kg{star('masses.rotating')} a cylinder; on the crank {shares}",
        f"  gas        {pressure}",
        f"  speeds     {speeds}, tuning speed {short(found.tuning_speed / RPM)} rpm"
        f"{star('balancer.tuning_speed')}{uneven}",
    ]
    if engine.assumed:
        lines.append("  * assumed, not from the source")
    return lines


def tables(found: Balance) -> list[Shown]:
    """Orders, designs, and the first-order moment over the speeds."""
    return [orders_table(found), designs_table(found), speeds_table(found)]


def orders_table(found: Balance) -> Shown:
    """The orders at the tuning speed."""
    from softstart.views.numbers import column_of

    rows = found.orders()
    columns = {
        "order": [f"{row['order']:g}" for row in rows],
        "gas\ncos": column_of([row["gas_cosine"] for row in rows]),
        "gas\nsin": column_of([row["gas_sine"] for row in rows]),
        "inertia\nsin": column_of([row["inertia_sine"] for row in rows]),
        "torque\nN m": column_of([row["torque"] for row in rows]),
        "force\nN": column_of([row["force"] for row in rows]),
        "couple\nN m": column_of([row["couple"] for row in rows]),
    }
    title = (
        f"Orders at {found.tuning_speed / RPM:.6g} rpm: torque on the crank; force without balancer shafts"
    )
    return Shown(title, list(columns), [list(row) for row in zip(*columns.values(), strict=True)], 0)


def designs_table(found: Balance) -> Shown:
    """What each design needs and leaves."""
    from softstart.views.numbers import column_of, number

    i, all_of = found.tuning_index, found.residuals
    columns = {
        "balancer": [one.name for one in all_of],
        "h\nmm": [number(_at(one.height, i), 2) for one in all_of],
        "e\nmm": [number(_at(one.offset, i), 2) for one in all_of],
        "moment\nN m": column_of([float(one.first_order[i]) for one in all_of]),
        "at most\nN m": column_of([float(one.first_order.max()) for one in all_of]),
        "all orders\nN m": column_of([float(one.moment[i]) for one in all_of]),
        "force\nN": column_of([float(one.force[i]) for one in all_of]),
        "all orders\nN": column_of([float(one.all_forces[i]) for one in all_of]),
    }
    title = f"Left on the housing at {found.tuning_speed / RPM:.6g} rpm, first and all orders"
    return Shown(title, list(columns), [list(row) for row in zip(*columns.values(), strict=True)], 1)


def _at(values: np.ndarray[tuple[int], np.dtype[np.float64]] | None, index: int) -> float | None:
    return None if values is None else 1e3 * float(values[index])


def speeds_table(found: Balance) -> Shown:
    """The first-order moment over the speeds asked for."""
    from softstart.views.numbers import number

    where = [int(np.argmin(np.abs(found.speeds - speed))) for speed in found.shown]
    headings = ["speed\nrpm", *(one.name.replace("-", "\n", 1) for one in found.residuals)]
    rows = [
        [f"{found.speeds[i] / RPM:.6g}", *(number(float(one.first_order[i]), 1) for one in found.residuals)]
        for i in where
    ]
    return Shown("First-order moment left on the housing, N m", headings, rows, 0)


def conclusion(found: Balance) -> str:
    """What the balancer of [B] does here."""
    if found.note:
        return found.note
    i, rpm = found.tuning_index, f"{found.tuning_speed / RPM:.6g} rpm"
    none, fixed, inertia, both = (
        found.residual(name) for name in ("none", "fixed-h", "inertia-only", "fixed-h-e")
    )
    assert both.offset is not None
    return (
        f"Two shafts of {found.imbalance:.4g} kg m together at h = {_mm(fixed, i)} mm take the first-order "
        "force "
        f"from {none.force[i]:.4g} to {fixed.force[i]:.4g} N and the first-order moment at {rpm} from "
        f"{none.first_order[i]:.4g} to {fixed.first_order[i]:.4g} N m; designed for the inertia alone (h = "
        f"{_mm(inertia, i)} mm) they leave {inertia.first_order[i]:.4g} N m. Moved sideways by "
        f"{1e3 * both.offset[i]:.4g} mm as well they leave nothing there."
    )


def _mm(one: Residual, index: int) -> str:
    return "-" if one.height is None else f"{1e3 * one.height[index]:.4g}"


def footnotes(found: Balance) -> list[str]:
    """Which design is which, and what is assumed."""
    designs = "; ".join(f"{one.name}: {one.about}" for one in found.residuals)
    notes = [
        f"{designs}. At most: over all speeds.",
        "The crank turns at constant speed; the moments are those that alternate, about the crank axis.",
    ]
    if found.engine.assumed:
        notes.append(f"Assumed: {', '.join(found.engine.assumed)}.")
    return notes


def show_balance(to: Console, found: Balance) -> None:
    """All of it."""
    from softstart.views.numbers import Column
    from softstart.views.terminal import print_table, sentence

    for index, line in enumerate(engine_lines(found)):
        sentence(to, line, "bold" if index == 0 else "")
    for shown in tables(found):
        to.print()
        columns = [Column(name, i >= shown.texts) for i, name in enumerate(shown.headings)]
        print_table(to, columns, shown.rows, title=shown.title)
    to.print()
    sentence(to, conclusion(found), "bold")
    for note in footnotes(found):
        sentence(to, note, "dim")
