"""The forces and moments of an engine, and its balancers, in words, tables and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.arrays import Vector
from softstart.balancing.gas import MeasuredCycle
from softstart.balancing.parts import CYCLE_ANGLE
from softstart.views.drawing import (
    COLOURS,
    DASHES,
    GREY,
    SMALL,
    drawing,
    entitle,
    head,
    legend_above,
    new_figure,
)
from softstart.views.numbers import NOTHING, Table, column_of, number, printable, short

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softstart.balancing.design import Balance, Residual

RPM = math.pi / 30.0
STEPS = 1440  # of the torque over the cycle: half degrees
COUPLED = "couple-shaft", "two-couple-shafts"  # designs for the couple
BARS = 6.0  # highest order in the bar chart
STYLES = {
    "none": (COLOURS[6], DASHES[0]),
    "own-shafts": (COLOURS[7], DASHES[3]),
    "inertia-only": (COLOURS[1], DASHES[1]),
    "fixed-h": (COLOURS[0], DASHES[0]),
    "variable-h": (COLOURS[2], DASHES[2]),
    "fixed-h-e": (COLOURS[3], DASHES[4]),
    "variable-h-e": (COLOURS[4], DASHES[5]),
    "couple-shaft": (COLOURS[0], DASHES[1]),
    "two-couple-shafts": (COLOURS[3], DASHES[2]),
}


def engine_lines(found: Balance) -> list[str]:
    """The engine in a few lines; a star marks what is assumed."""
    engine = found.engine
    cylinders, masses, weights = engine.cylinders, engine.masses, engine.counterweights
    gas = engine.gas

    def star(*keys: str) -> str:
        return "*" if any(key in engine.assumed for key in keys) else ""

    def mm(key: str) -> str:
        return f"{short(1e3 * getattr(cylinders, key))} mm{star('cylinders.' + key)}"

    firing = ", ".join(short(math.degrees(angle)) for angle in cylinders.firing_angles)
    load = f"load {short(found.load)}{star('operation.load')}"
    if gas is None:
        pressure = "none given, so only the inertia shakes"
    elif isinstance(gas, MeasuredCycle):
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


def tables(found: Balance) -> list[Table]:
    """Orders, designs, and what is left of first order over the speeds: moment, and couple if any."""
    others = [one for one in found.residuals if not one.name.endswith(COUPLED)]
    shown = [_orders(found), _designs(found), _speeds(found, "moment", "first_order", others)]
    coupled = any(np.any(one.couple > 0.0) for one in found.residuals)
    return [*shown, _speeds(found, "couple", "couple", found.residuals)] if coupled else shown


def _orders(found: Balance) -> Table:
    """The orders at the tuning speed."""
    rows, keys = found.orders(), ("cosine", "sine") if found.engine.gas else ()
    cells = {
        "order": [f"{row['order']:g}" for row in rows],
        **{f"gas\n{key[:3]}": column_of([row[f"gas_{key}"] for row in rows]) for key in keys},
        "inertia\nsin": column_of([row["inertia_sine"] for row in rows]),
        "torque\nN m": column_of([row["torque"] for row in rows]),
        "force\nN": column_of([row["force"] for row in rows]),
        "couple\nN m": column_of([row["couple"] for row in rows]),
    }
    title = (
        f"Orders at {found.tuning_speed / RPM:.6g} rpm: torque on the crank; force without balancer shafts"
    )
    return Table.of(title, cells)


def _designs(found: Balance) -> Table:
    """What each design needs and leaves."""
    i, all_of = found.tuning_index, found.residuals
    cells = {
        "balancer": [one.name for one in all_of],
        "h\nmm": [number(_mm_at(one.height, i), 2) for one in all_of],
        "e\nmm": [number(_mm_at(one.offset, i), 2) for one in all_of],
        "moment\nN m": column_of([float(one.first_order[i]) for one in all_of]),
        "at most\nN m": column_of([float(one.first_order.max()) for one in all_of]),
        "all orders\nN m": column_of([float(one.moment[i]) for one in all_of]),
        "force\nN": column_of([float(one.force[i]) for one in all_of]),
        "all orders\nN": column_of([float(one.all_forces[i]) for one in all_of]),
    }
    if any(one.all_couples[i] > 0.0 for one in all_of):
        cells["couple\nN m"] = column_of([float(one.couple[i]) for one in all_of])
        cells["couple, all\nN m"] = column_of([float(one.all_couples[i]) for one in all_of])
    title = f"Left on the housing at {found.tuning_speed / RPM:.6g} rpm, first and all orders"
    return Table.of(title, cells, ("balancer",))


def _mm_at(values: Vector | None, index: int) -> float | None:
    return None if values is None else 1e3 * float(values[index])


def _speeds(found: Balance, what: str, key: str, residuals: Sequence[Residual]) -> Table:
    """What is left over the speeds asked for."""
    where = [int(np.argmin(np.abs(found.speeds - speed))) for speed in found.shown]
    cells = {"speed\nrpm": [f"{found.speeds[i] / RPM:.6g}" for i in where]}
    for one in residuals:
        cells[one.name.replace("-", "\n", 1)] = [number(float(getattr(one, key)[i]), 1) for i in where]
    return Table.of(f"First-order {what} left on the housing, N m", cells)


def conclusion(found: Balance) -> str:
    """What the balancer of [B] does here, and what the shafts for the couples do."""
    sentences = [_of_forces(found)] if found.imbalance else []
    if coupled := [one for one in found.residuals if one.name.endswith(COUPLED)]:
        i, (shaft, other, *second) = found.tuning_index, coupled[-1].shafts
        before, *left = (one.couple[i] for one in (found.residuals[0], *coupled))
        text = (
            f"One shaft against the crank with two opposite imbalances of {shaft.imbalance:.4g} kg m, "
            f"{1e3 * (other.along - shaft.along):.4g} mm apart, takes the first-order couple at "
            f"{found.tuning_speed / RPM:.6g} rpm from {before:.4g} to {left[0]:.4g} N m"
        )
        if second:
            text += f"; a second one with {second[0].imbalance:.4g} kg m that turns with the crank, or "
            text += f"counterweights at its ends, to {left[1]:.4g} N m"
        sentences.append(f"{text}.")
    return " ".join(sentences) or found.note


def _of_forces(found: Balance) -> str:
    i, rpm = found.tuning_index, f"{found.tuning_speed / RPM:.6g} rpm"
    none, inertia = found.residual("none"), found.residual("inertia-only")
    start = f"Two shafts of {found.imbalance:.4g} kg m together at h = "
    if found.engine.gas is None:
        return (
            f"{start}{_mm(inertia, i)} mm take the first-order force from {none.force[i]:.4g} to "
            f"{inertia.force[i]:.4g} N and the first-order moment of the inertia at {rpm} from "
            f"{none.first_order[i]:.4g} to {inertia.first_order[i]:.4g} N m."
        )
    fixed, both = found.residual("fixed-h"), found.residual("fixed-h-e")
    assert both.offset is not None
    return (
        f"{start}{_mm(fixed, i)} mm take the first-order "
        f"force from {none.force[i]:.4g} to {fixed.force[i]:.4g} N and the first-order moment at {rpm} from "
        f"{none.first_order[i]:.4g} to {fixed.first_order[i]:.4g} N m; designed for the inertia alone (h = "
        f"{_mm(inertia, i)} mm) they leave {inertia.first_order[i]:.4g} N m. Moved sideways by "
        f"{1e3 * both.offset[i]:.4g} mm as well they leave nothing there."
    )


def _mm(one: Residual, index: int) -> str:
    return NOTHING if one.height is None else f"{1e3 * one.height[index]:.4g}"


def footnotes(found: Balance) -> list[str]:
    """Which design is which, and what is assumed."""
    designs = "; ".join(f"{one.name}: {one.about}" for one in found.residuals)
    notes = [
        f"{designs}. At most: over all speeds.",
        "The crank turns at constant speed; the moments are those that alternate, about the crank axis.",
    ]
    if not found.engine.cylinders.couples_known:
        notes.append("The couples are not known: they need the spacing of the cylinders.")
    if found.engine.assumed:
        notes.append(f"Assumed: {', '.join(found.engine.assumed)}.")
    return notes


def torque_over_cycle(found: Balance) -> tuple[tuple[str, ...], list[list[float]]]:
    """Torque and pressure over the crank angle at the tuning speed: headings and rows."""
    engine, w = found.engine, found.tuning_speed
    phi = np.linspace(0.0, CYCLE_ANGLE, STEPS + 1)
    gas, inertia = engine.gas_torque(phi, w, found.load), engine.inertia_torque(phi, w)
    pressure = engine.pressure(phi - engine.cylinders.firing_angles[0], w, found.load)
    headings = (
        "crank angle [deg]",
        "gas torque [N*m]",
        "inertia torque [N*m]",
        "pressure in cylinder 1 [Pa]",
    )
    return headings, np.column_stack([np.degrees(phi), gas, inertia, pressure]).tolist()


def figures(found: Balance) -> dict[str, Any]:
    """All figures by the stem of their file: torque over crank angle, residuals over speed, forces."""
    return {
        **({} if found.engine.gas is None else {"torque": torque_figure(found)}),
        "residual": residual_figure(found),
        "forces": force_figure(found),
    }


def _title(found: Balance, what: str) -> str:
    assumed = "   (with assumed values)" if found.engine.assumed else ""
    return f"{found.engine.name}: {what}{assumed}"


def torque_figure(found: Balance) -> Any:
    """Torque over the crank angle at the tuning speed with its first order, and the orders as bars."""
    engine, w = found.engine, found.tuning_speed
    phi = np.linspace(0.0, CYCLE_ANGLE, STEPS + 1)
    gas, inertia = engine.gas_torque(phi, w, found.load), engine.inertia_torque(phi, w)
    harmonics = engine.torque_harmonics(w, found.load)
    mean, first = harmonics[0].real, harmonics[2]
    degrees = np.degrees(phi)
    with drawing():
        figure, (torque, bars) = new_figure(2, 1, (8.0, 6.8))
        torque.plot(degrees, gas, color=COLOURS[1], ls=DASHES[1], lw=1.1, label="gas")
        torque.plot(degrees, inertia, color=COLOURS[2], ls=DASHES[2], lw=1.1, label="inertia")
        torque.plot(degrees, gas + inertia, color=COLOURS[0], label="both")
        wave = mean + (first * np.exp(1j * phi)).real
        torque.plot(degrees, wave, color=COLOURS[6], ls=DASHES[3], lw=1.8, label="mean and first order")
        torque.set_xticks(np.arange(0.0, 721.0, 90.0))
        torque.set_xlim(0.0, 720.0)
        head(torque, f"mean {mean:.1f} N m", "torque on the crank, N m", "crank angle, deg")
        legend_above(torque, 4)
        _bars(bars, found)
        what = f"reaction torque at {w / RPM:.0f} rpm, load {found.load:g}"
        entitle(figure, _title(found, what))
    return figure


def _bars(axes: Axes, found: Balance) -> None:
    """Amplitudes of the orders of gas, inertia and both."""
    rows = [row for row in found.orders() if row["order"] <= BARS and row["torque"] > 0.0]
    places = np.arange(len(rows))
    kinds = (
        ("gas", [math.hypot(row["gas_cosine"], row["gas_sine"]) for row in rows], COLOURS[1], "//"),
        (
            "inertia",
            [math.hypot(row["inertia_cosine"], row["inertia_sine"]) for row in rows],
            COLOURS[2],
            "..",
        ),
        ("both", [row["torque"] for row in rows], COLOURS[0], ""),
    )
    for index, (name, heights, colour, hatch) in enumerate(kinds):
        drawn = axes.bar(
            places + 0.27 * (index - 1),
            heights,
            0.25,
            color=colour,
            hatch=hatch,
            edgecolor="white",
            label=name,
        )
        if name == "both":
            axes.bar_label(drawn, [f"{height:.0f}" for height in heights], fontsize=8, padding=1)
    axes.set_xticks(places, [f"{row['order']:g}" for row in rows])
    axes.set_xlabel("order of the crank speed")
    axes.set_ylabel("amplitude, N m")
    axes.grid(False, axis="x")
    legend_above(axes, 3)


def residual_figure(found: Balance) -> Any:
    """First-order moment left, the arm that each design needs, and the forces, over the speed."""
    rpm = found.speeds / RPM
    designed = [one for one in found.residuals if one.height is not None]
    with drawing():
        coupled = found.residuals if any(np.any(one.couple > 0.0) for one in found.residuals) else ()
        rows = 2 + bool(designed) + bool(coupled)
        figure, panels = new_figure(rows, 1, (8.0, 3.1 * rows), sharex=True)
        moment, force = panels[0], panels[-1 - bool(coupled)]
        for one in found.residuals:
            colour, dash = STYLES[one.name]
            moment.plot(rpm, one.first_order, color=colour, ls=dash, label=one.name, clip_on=False, zorder=3)
        moment.set_ylabel("moment of first order\non the housing, N m")
        moment.set_ylim(bottom=0.0)
        if designed:
            _arms(panels[1], found)
        _forces(force, found)
        for one in coupled:
            colour, dash = STYLES[one.name]
            panels[-1].plot(rpm, one.couple, color=colour, ls=dash, label=one.name)
            panels[-1].set_ylabel("couple of first order\non the housing, N m")
        for axes in panels:
            axes.axvline(found.tuning_speed / RPM, color=GREY, lw=0.9, ls=":")
        panels[-1].set_xlabel("crank speed, rpm     (dotted: tuning speed)")
        force.set_xlim(rpm[0], rpm[-1])
        entitle(figure, _title(found, f"what is left, load {found.load:g}"))
        handles, labels = moment.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _arms(axes: Axes, found: Balance) -> None:
    """Height of each design, and the sideways offset of the last."""
    rpm = found.speeds / RPM
    for one in found.residuals:
        if one.height is not None and one.name in ("inertia-only", "fixed-h", "variable-h"):
            colour, dash = STYLES[one.name]
            axes.plot(rpm, 1e3 * np.abs(one.height), color=colour, ls=dash)
    last = found.residual("variable-h-e")
    if last.offset is not None:
        colour, dash = STYLES[last.name]
        axes.plot(rpm, 1e3 * np.abs(last.offset), color=colour, ls=dash, label="sideways |e(n)|")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda value, place: f"{value:g}")
    axes.set_ylabel("height |h| of the shafts\nfrom the crank, mm")
    legend_above(axes, 1)


def _forces(axes: Axes, found: Balance) -> None:
    """Forces of first order and of all orders, without shafts and with the designed ones."""
    rpm = found.speeds / RPM
    shown = [found.residuals[0]]
    shown += [one for one in found.residuals if one.name in ("own-shafts", "fixed-h")]
    for one in shown:
        colour, dash = STYLES[one.name]
        label = "any designed shafts" if one.height is not None else one.name
        axes.plot(rpm, 1e-3 * one.all_forces, color=colour, ls=dash, label=label)
    legend_above(axes, 3)
    axes.set_ylabel("largest force\non the housing, kN")
    axes.set_ylim(bottom=0.0)


def force_figure(found: Balance) -> Any:
    """The force vector over a turn at the tuning speed: first order on the left, all orders on the right."""
    engine, w2 = found.engine, found.tuning_speed**2
    crank = engine.crank_shaking[0]
    reciprocating = engine.bare_shaking[0]
    kinds = [
        ("without counterweights", reciprocating, COLOURS[1], DASHES[1]),
        ("with counterweights", crank, COLOURS[6], DASHES[0]),
    ]
    if found.imbalance:
        shafts = engine.shaft_shaking(found.shafts("fixed-h"))[0]
        kinds.append(("force of the two shafts", shafts, COLOURS[2], DASHES[2]))
        kinds.append(("left with the shafts", crank + shafts, COLOURS[0], DASHES[0]))
    elif engine.shafts:
        kinds.append(("left with the shafts", crank + engine.shaft_shaking()[0], COLOURS[0], DASHES[0]))
    phi = np.linspace(0.0, 2.0 * np.pi, 721)
    with drawing():
        figure, panels = new_figure(1, 2, (6.6, 5.6), sharex=True, sharey=True)
        for axes, title, highest in ((panels[0], "first order", 1), (panels[1], "all orders", None)):
            for name, shaking, colour, dash in kinds:
                force = 1e-3 * w2 * shaking.up_to(highest).at(phi)
                axes.plot(force.imag, force.real, color=colour, ls=dash, label=name)
                axes.plot(force.imag[:1], force.real[:1], "o", ms=5, color=colour)
                axes.plot(force.imag[180:181], force.real[180:181], "s", ms=5, color=colour, mfc="white")
            axes.set_aspect("equal", adjustable="box")
            axes.axhline(0.0, color=GREY, lw=0.6)
            axes.axvline(0.0, color=GREY, lw=0.6)
            axes.set_title(title, loc="left", fontsize=SMALL)
            axes.set_xlabel("sideways, kN")
        panels[0].set_ylabel("along the cylinders, kN")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        title = _title(found, f"force on the housing at {found.tuning_speed / RPM:.0f} rpm")
        dots = "dot: crank at top dead centre; square: 90 deg later"
        figure.suptitle(f"{title}\n{dots}", x=0.01, ha="left", fontsize=10)
    return figure
