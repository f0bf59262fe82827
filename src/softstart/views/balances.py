"""What is shown of an engine: its forces and moments by order, its balancers, and what these leave."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.balancing.engine import TURNS, force_at, shaking_of_crank, shaking_of_shafts
from softstart.balancing.parts import CYCLE_ANGLE, HIGHEST, Counterweights
from softstart.views.drawing import (
    COLOURS,
    DASHES,
    GREY,
    drawing,
    entitle,
    head,
    legend_above,
    line_of,
    new_figure,
)
from softstart.views.numbers import RPM, DataColumn, TextTable, number, printable, short
from softstart.views.sheet import Sheet, columns_file, records_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softstart.balancing.design import Balance

STEPS = 1440  # of the torque over the cycle: half degrees
COUPLED = "couple-shaft", "two-couple-shafts"  # designs for the couple
BARS = 6.0  # highest order in the bar chart
OVER_SPEED = (  # what is drawn over the speed, a height if there are any, a couple if it is not 0
    ("moment of first order\non the housing, N m", "first_order_moment", 1.0),
    ("height |h| of the shafts\nfrom the crank, mm", "height", 1e3),
    ("largest force\non the housing, kN", "force", 1e-3),
    ("couple of first order\non the housing, N m", "first_order_couple", 1.0),
)


def balance_sheet(found: Balance) -> Sheet:
    """Orders, designs, what they leave over the speeds, and the balancer in a sentence."""
    engine, assumed = found.engine, printable(found.engine.assumed)
    designs = "; ".join(f"{one.name}: {one.about}" for one in found.residuals)
    unknown = "The couples are not known: they need the spacing of the cylinders."
    rows = [{"balancer": one.name, **one.row(i)} for one in found.residuals for i in range(one.speeds.size)]
    return Sheet(
        title=f"{engine.name}: forces, moments and balancers",
        lines=_lines(found),
        tables=[_orders(found), _designs(found), *_speeds(found)],
        conclusions=[_conclusion(found)],
        notes=[
            f"{designs}. At most: over all speeds.",
            "The crank turns at constant speed; the moments are those that alternate, about the crank axis.",
            "" if engine.cylinders.couples_known else unknown,
            f"Assumed: {assumed}." if assumed else "",
        ],
        figures=drawings(found),
        files={
            "engine.toml": engine.to_toml(),
            "orders.csv": records_file(found.orders()),
            "residuals.csv": records_file(rows),
            **({} if engine.gas is None else {"torque.csv": columns_file(_cycle(found))}),
        },
        behind=[f"Source: {engine.source}" if engine.source else ""],
    )


def drawings(found: Balance) -> dict[str, Callable[[], Figure]]:
    """What draws each figure, by the stem of its file."""
    figures = {"torque": torque_figure} if found.engine.gas is not None else {}
    figures |= {"residual": residual_figure, "forces": force_figure}
    return {stem: partial(draw, found) for stem, draw in figures.items()}


# words and tables ------------------------------------------------------------------------------------------


def _lines(found: Balance) -> list[str]:
    """The engine in a few lines."""
    engine, gas, w, of = found.engine, found.engine.gas, found.tuning_speed, found.engine.counterweights
    cylinders, masses, operation = engine.cylinders, engine.masses, engine.operation
    bore, stroke, rod = (1e3 * one for one in (cylinders.bore, cylinders.stroke, cylinders.rod_length))
    firing = ", ".join(short(math.degrees(angle)) for angle in cylinders.firing_angles)
    pressure = "none given, so only the inertia shakes"
    if gas is not None:
        mean = 1e-5 * engine.indicated_work(w, found.load) / engine.displacement
        pressure = f"compression {gas.compression_ratio:g}, mean pressure {mean:.2f} bar, load {found.load:g}"
    uneven = engine.speed_fluctuation(w, found.load)
    low, high = operation.lowest_speed * RPM, operation.highest_speed * RPM
    return [
        printable(engine.name),
        f"  cylinders  {cylinders.count} in line, bore {bore:g} mm, stroke {stroke:g} mm, rod {rod:g} mm, "
        f"{1e6 * engine.displacement:.1f} cm3, firing at {firing} deg",
        f"  masses     reciprocating {masses.reciprocating:g} kg, rotating {masses.rotating:g} kg per "
        f"cylinder; on the crank {of.reciprocating_share:.0%} and {of.rotating_share:.0%} of them",
        f"  gas        {pressure}",
        f"  speeds     {low:g} to {high:g} rpm, tuning speed {w * RPM:g} rpm"
        f"{'' if uneven is None else f', speed fluctuation there {uneven:.1%}'}",
    ]


ORDERS = (  # of the rows of `Balance.orders`
    DataColumn("order", lambda row: row["order"], text="{:g}".format),
    DataColumn("gas\ncos", lambda row: row.get("gas_cosine"), optional=True),
    DataColumn("gas\nsin", lambda row: row.get("gas_sine"), optional=True),
    DataColumn("inertia\nsin", lambda row: row["inertia_sine"]),
    DataColumn("torque\nN m", lambda row: row["torque"]),
    DataColumn("force\nN", lambda row: row["force"]),
    DataColumn("couple\nN m", lambda row: row["couple"]),
)
DESIGNS = (  # of the rows of `Residual`, with the largest moment over all speeds
    DataColumn("balancer", lambda row: row["balancer"]),
    DataColumn("h\nmm", lambda row: _in_mm(row["height"]), 2),
    DataColumn("e\nmm", lambda row: _in_mm(row["offset"]), 2),
    DataColumn("moment\nN m", lambda row: row["first_order_moment"]),
    DataColumn("at most\nN m", lambda row: row["largest_moment"]),
    DataColumn("all orders\nN m", lambda row: row["moment"]),
    DataColumn("force\nN", lambda row: row["first_order_force"]),
    DataColumn("all orders\nN", lambda row: row["force"]),
    DataColumn("couple\nN m", lambda row: row["first_order_couple"]),
    DataColumn("couple, all\nN m", lambda row: row["couple"]),
)


def _in_mm(length: float | None) -> float | None:
    return None if length is None else 1e3 * length


def _orders(found: Balance) -> TextTable:
    """The orders at the tuning speed."""
    title = f"Orders at {_rpm(found)}: torque on the crank; force without balancer shafts"
    return TextTable.of_data(title, ORDERS, found.orders())


def _designs(found: Balance) -> TextTable:
    """What each design needs and leaves."""
    rows = [
        {"balancer": one.name, "largest_moment": one.first_order_moment.max(), **one.row(found.tuning_index)}
        for one in found.residuals
    ]
    columns = DESIGNS if any(row["couple"] > 0.0 for row in rows) else DESIGNS[:-2]
    return TextTable.of_data(f"Left on the housing at {_rpm(found)}, first and all orders", columns, rows)


def _speeds(found: Balance) -> list[TextTable]:
    """What is left of first order over the speeds asked for: moment, and couple if any."""
    tables, where = [], found.shown_indices
    for what in ("moment", "couple"):
        of = [one for one in found.residuals if what == "couple" or not one.name.endswith(COUPLED)]
        left = {one.name.replace("-", "\n", 1): one.columns[f"first_order_{what}"] for one in of}
        if what == "moment" or any(values is not None and np.any(values > 0.0) for values in left.values()):
            cells = {"speed\nrpm": [f"{found.speeds[i] * RPM:.6g}" for i in where]}
            cells |= {
                name: [number(float(v[i]), 1) for i in where] for name, v in left.items() if v is not None
            }
            tables.append(TextTable.of(f"First-order {what} left on the housing, N m", cells))
    return tables


def _rpm(found: Balance) -> str:
    return f"{found.tuning_speed * RPM:.6g} rpm"


def _conclusion(found: Balance) -> str:
    """The imbalances of the shafts; what they leave is in the tables."""
    coupled = [one for one in found.residuals if one.name.endswith(COUPLED)]
    sentences = []
    if found.imbalance:
        sentences.append(f"Two shafts of {found.imbalance:.4g} kg m together balance the first-order force.")
    if coupled:
        shaft, other, *second = coupled[-1].shafts
        also = second and (
            f"; a second one with {second[0].imbalance:.4g} kg m that turns with the crank, or "
            "counterweights at its ends"
        )
        sentences.append(
            f"One shaft against the crank with two opposite imbalances of {shaft.imbalance:.4g} kg m, "
            f"{1e3 * (other.along - shaft.along):.4g} mm apart{also or ''}."
        )
    return " ".join(sentences) or found.note


def _cycle(found: Balance) -> dict[str, Any]:
    """Torque and pressure over the crank angle at the tuning speed."""
    engine, w, load = found.engine, found.tuning_speed, found.load
    phi = np.linspace(0.0, CYCLE_ANGLE, STEPS + 1)
    pressure = engine.pressure(phi - engine.cylinders.firing_angles[0], w, load)
    return {
        "crank angle [deg]": np.degrees(phi).tolist(),
        "gas torque [N*m]": engine.gas_torque(phi, w, load).tolist(),
        "inertia torque [N*m]": engine.inertia_torque(phi, w).tolist(),
        "pressure in cylinder 1 [Pa]": pressure.tolist(),
    }


# figures ---------------------------------------------------------------------------------------------------


def _entitle(figure: Figure, found: Balance, what: str, more: str = "") -> None:
    assumed = "   (with assumed values)" if found.engine.assumed else ""
    entitle(figure, f"{found.engine.name}: {what}{assumed}{more}")


def torque_figure(found: Balance) -> Figure:
    """Torque over the crank angle at the tuning speed with its first order, and the orders as bars."""
    degrees, gas, inertia, _ = map(np.array, _cycle(found).values())
    harmonics = found.engine.torque_harmonics(found.tuning_speed, found.load)
    mean, wave = harmonics[0].real, (harmonics[2] * np.exp(1j * np.radians(degrees))).real
    rows = [row for row in found.orders() if row["order"] <= BARS and row["torque"] > 0.0]
    of_gas, of_inertia = (
        [math.hypot(row[f"{what}_cosine"], row[f"{what}_sine"]) for row in rows]
        for what in ("gas", "inertia")
    )
    parts = {
        "gas": (gas, of_gas, 1, "//"),
        "inertia": (inertia, of_inertia, 2, ".."),
        "both": (gas + inertia, [row["torque"] for row in rows], 0, ""),
    }
    with drawing():
        figure, (torque, bars) = new_figure(2, 1, (8.0, 6.8))
        for index, (name, (values, heights, colour, hatch)) in enumerate(parts.items()):
            torque.plot(degrees, values, color=COLOURS[colour], ls=DASHES[colour], label=name)
            drawn = bars.bar(np.arange(len(rows)) + 0.27 * (index - 1), heights, 0.25, label=name,
                             color=COLOURS[colour], hatch=hatch, edgecolor="white")  # fmt: skip
        torque.plot(degrees, mean + wave, color="black", ls=DASHES[3], lw=1.8, label="mean and first order")
        torque.set_xticks(np.arange(0.0, 721.0, 90.0))
        torque.set_xlim(0.0, 720.0)
        head(torque, f"mean {mean:.1f} N m", "torque on the crank, N m", "crank angle, deg")
        legend_above(torque, 4)
        bars.bar_label(drawn, fmt="%.0f", fontsize=8, padding=1)
        bars.set_xticks(range(len(rows)), [f"{row['order']:g}" for row in rows])
        head(bars, "", "amplitude, N m", "order of the crank speed")
        bars.grid(False, axis="x")
        legend_above(bars, 3)
        _entitle(figure, found, f"reaction torque at {_rpm(found)}, load {found.load:g}")
    return figure


def residual_figure(found: Balance) -> Figure:
    """First-order moment left, the arm that each design needs, forces and couples, over the speed."""
    shown = {}
    for up, key, scale in OVER_SPEED:
        curves = [
            (i, one.name, scale * np.abs(values))
            for i, one in enumerate(found.residuals)
            if (values := one.columns[key]) is not None and not (key == "height" and one.name.endswith("-e"))
        ]
        if (key != "first_order_couple" and curves) or any(np.any(values > 0.0) for *_, values in curves):
            shown[up] = curves
    with drawing():
        figure, panels = new_figure(len(shown), 1, (8.0, 3.1 * len(shown)), sharex=True)
        for axes, (up, curves) in zip(panels, shown.items(), strict=True):
            for i, name, values in curves:
                axes.plot(found.speeds * RPM, values, label=name, clip_on=False, **line_of(i, dashed=True))
            axes.set_ylabel(up)
            axes.axvline(found.tuning_speed * RPM, color=GREY, lw=0.9, ls=":")
            if up.startswith("height"):
                axes.set_yscale("log")
                axes.yaxis.set_major_formatter(lambda value, place: f"{value:g}")
            else:
                axes.set_ylim(bottom=0.0)
        panels[-1].set_xlabel("crank speed, rpm     (dotted: tuning speed)")
        panels[-1].set_xlim(*(found.speeds[[0, -1]] * RPM))
        _entitle(figure, found, f"what is left, load {found.load:g}")
        _legend_below(figure, panels[0], 3)
    return figure


def force_figure(found: Balance) -> Figure:
    """The force vector over a turn at the tuning speed: first order on the left, all orders on the right."""
    engine = found.engine
    bare = shaking_of_crank(engine.cylinders, engine.masses, Counterweights(0.0, 0.0))[0]
    crank = engine.crank_shaking[0]
    kinds = {"without counterweights": bare, "with counterweights": crank}
    shafts = next((one.shafts for one in found.residuals if one.height is not None), engine.shafts)
    if shafts:
        kinds["force of the shafts"] = shaking_of_shafts(shafts)[0]
        kinds["left with the shafts"] = crank + kinds["force of the shafts"]
    looks = ((1, "--"), (6, "-"), (2, "-."), (0, "-"))
    phi = np.linspace(0.0, 2.0 * np.pi, 721)
    with drawing():
        figure, panels = new_figure(1, 2, (6.6, 5.6), sharex=True, sharey=True)
        for axes, title, highest in zip(panels, ("first order", "all orders"), (1, HIGHEST), strict=True):
            for (name, vectors), (index, dash) in zip(kinds.items(), looks, strict=False):
                colour = COLOURS[index]
                shown = np.where(np.abs(TURNS) <= highest, vectors, 0.0)
                force = 1e-3 * found.tuning_speed**2 * force_at(shown, phi)
                axes.plot(force.imag, force.real, color=colour, ls=dash, label=name)
                axes.plot(force.imag[:1], force.real[:1], "o", ms=5, color=colour)
                axes.plot(force.imag[180:181], force.real[180:181], "s", ms=5, color=colour, mfc="white")
            axes.set_aspect("equal", adjustable="box")
            axes.axhline(0.0, color=GREY, lw=0.6)
            axes.axvline(0.0, color=GREY, lw=0.6)
            head(axes, title, "along the cylinders, kN" if axes is panels[0] else "", "sideways, kN")
        _legend_below(figure, panels[0], 2)
        dots = "\ndot: crank at top dead centre; square: 90 deg later"
        _entitle(figure, found, f"force on the housing at {_rpm(found)}", dots)
    return figure


def _legend_below(figure: Figure, axes: Axes, columns: int) -> None:
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=columns)
