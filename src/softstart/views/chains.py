"""What is shown of a chain: its vibration, its reduction, and starts beside the reduced drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.errors import listed
from softstart.views.drawing import COLOURS, drawing, entitle, head, legend_above, new_figure
from softstart.views.drives import drive_lines
from softstart.views.numbers import DataColumn, TextTable, column_of, number, short
from softstart.views.sheet import Sheet, records_file, rows_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softstart.chain.model import Chain
    from softstart.chain.two_masses import TwoMassError, Verification
    from softstart.drive import Drive
    from softstart.vibration import Reduction, Vibration

MOST_MODES = 12
ALIKE = 0.01  # share by which two K_dyn differ at least where one counts as lower
TALLEST, DISC = 150.0, 16.0  # px, of the discs of the scheme: the tallest, and their thickness
WIDEST, LONGEST_NAME = 60.0, 26  # inches of a figure; characters of a mass in it


# sheets ----------------------------------------------------------------------------------------------------


def vibration_sheet(found: Vibration) -> Sheet:
    """The natural frequencies of a chain."""
    masses = [mass.name for mass in found.chain.masses]
    modes = found.modes
    frequencies = [[m, float(found.Omega[m]), float(found.frequency[m])] for m in modes]
    return Sheet(
        title=f"{found.chain.name}: natural frequencies",
        lines=drive_lines(found.chain),
        tables=[frequencies_table(found)],
        figures={"shapes": partial(shapes_figure, found)},
        files={
            "frequencies.csv": rows_file(("mode", "Omega [rad/s]", "frequency [Hz]"), frequencies),
            "shapes.csv": rows_file(("mode", *masses), [[m, *found.shape[m].tolist()] for m in modes]),
        },
        machine=found.chain,
    )


def reduction_sheet(found: Reduction, off: TwoMassError | None = None) -> Sheet:
    """Natural frequencies, the two masses beside the chain, and how far their K_dyn is off."""
    shown = vibration_sheet(found.vibration)
    starts, files = off.verified if off else (), dict(shown.files)
    if starts:
        rows = [{key: value for key, value in one.summary().items() if key != "chain"} for one in starts]
        files["verified.csv"] = records_file(rows)
    if (drive := drive_of(found)) is not None:
        files["drive.toml"] = drive.to_toml()
    return replace(
        shown,
        title=f"{shown.title} and reduction",
        tables=[*shown.tables, two_masses_table(found), verified_table(starts)],
        conclusions=two_mass_verdict(off) if off else [],
        notes=[note[0].upper() + note[1:] + "." for note in found.notes],
        files=files,
    )


# words -----------------------------------------------------------------------------------------------------


def reordered(verified: Sequence[Verification]) -> tuple[Verification, Verification] | None:
    """The pair that the two-mass model ranks in the opposite order, the lower K_dyn on the chain first.

    Of several the one that differs most on the chain; strategies that are alike are no pair.
    """
    less = 1.0 - ALIKE
    ordered = sorted(verified, key=lambda one: one.chain_k_dyn)
    pairs = [
        (a, b)
        for a, b in combinations(ordered, 2)
        if a.chain_k_dyn < less * b.chain_k_dyn and b.drive.k_dyn < less * a.drive.k_dyn
    ]
    return max(pairs, key=lambda pair: pair[1].chain_k_dyn / pair[0].chain_k_dyn, default=None)


def two_mass_verdict(error: TwoMassError) -> list[str]:
    """Whether the two-mass model is valid, and for what it is not."""
    worst, pair = error.worst, reordered(error.verified)
    of_strategies = f"{_percent(abs(worst.error))} ({worst.name}), " if worst is not None else ""
    sentences = [
        f"The two-mass model is {'' if error.enough else 'not '}valid for this chain: largest K_dyn error "
        f"{of_strategies}{_percent(error.of_torques)} ({error.TORQUES} torque profiles); limit "
        f"{_percent(error.LIMIT)}."
    ]
    if error.failed:
        sentences.append(f"Only the two-mass model starts under {listed(list(error.failed))}.")
    if pair and not error.enough:
        names = " and ".join(one.name for one in pair)
        sentences.append(f"The two-mass model ranks {names} in the opposite order.")
    return (
        sentences if error.enough else [*sentences, "Use the chain itself; all analysis commands accept it."]
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 1.0 else f"{100.0 * share:.0f} %"


def drive_of(found: Reduction) -> Drive | None:
    """The drive that comes out where the chain has a motor and a target speed."""
    complete = found.chain.motor is not None and found.chain.target_speed is not None
    return found.to_drive() if complete else None


def summary(found: Reduction, off: TwoMassError | None) -> dict[str, Any]:
    """All of it as plain data, in SI."""
    drive, done = drive_of(found), off.verified if off else ()
    orders = (
        {}
        if off is None
        else {
            "order_on_drive": [one.name for one in sorted(done, key=lambda v: v.drive.k_dyn)],
            "order_on_chain": [one.name for one in sorted(done, key=lambda v: v.chain_k_dyn)],
            "order_differs": reordered(done) is not None,
            "conclusion": " ".join(two_mass_verdict(off)),
        }
    )
    return {
        **found.summary(),
        "vibration": found.vibration.summary(),
        "drive": drive and dict(drive.given()),
        "verified": [one.summary() for one in done],
        "verdict": off and off.summary() | orders,
    }


# tables ----------------------------------------------------------------------------------------------------


def frequencies_table(vibration: Vibration) -> TextTable:
    """The lowest natural frequencies with their nodes."""
    shown = vibration.modes[:MOST_MODES]
    nodes = [", ".join(f"{n.shaft + 1 + n.share:.2f}" for n in vibration.nodes[m]) or "-" for m in shown]
    more = len(vibration.modes) - len(shown)
    of_nodes = "nodes (7.30: behind mass 7, at 0.30 of the twist to mass 8)"
    cells = {
        of_nodes: nodes,
        "mode": list(map(str, shown)),
        "Omega\nrad/s": column_of(vibration.Omega[shown].tolist(), 6),
        "Hz": column_of(vibration.frequency[shown].tolist(), 5),
    }
    title = f"Natural frequencies, gaps closed{f' (and {more} above)' if more else ''}"
    return TextTable.of(title, cells, texts=[of_nodes])


def two_masses_table(found: Reduction) -> TextTable:
    """The chain beside the two masses, and how far these are off."""
    names = {
        "first elastic frequency, rad/s": "Omega",
        "node position": "node",
        "participation of the motor": "participation",
        "stiffness motor - load, N m/rad": "stiffness",
        "total inertia, kg m2": "inertia",
        "total backlash, rad": "gap",
    }
    chain, two = ([getattr(one, key) for key in names.values()] for one in (found.whole, found.reduced))
    off = [100.0 * (b - a) / a if a else 0.0 for a, b in zip(chain, two, strict=True)]
    cells = {
        "at the motor shaft": [*names, "J1, kg m2", "J2, kg m2"],
        "chain": [*map(short, chain), "-", "-"],
        "two-mass\nmodel": [*map(short, two), short(found.J1), short(found.J2)],
        "deviation\n%": [*map(_signed, off), "-", "-"],
    }
    condition = (
        f"condition: {number(found.least_ratio, 1)}, at least {found.factor:g}{', fails' * found.forced}"
    )
    title = f"Two-mass model of the {len(found.chain.masses)} masses ({condition})"
    return TextTable.of(title, cells, texts=["at the motor shaft"])


def _signed(percent: float) -> str:
    """A difference in per cent; a dash where there is nothing to compare.

    >>> _signed(73.44), _signed(-1e-9), _signed(float("nan"))
    ('+73.4', '0', '-')
    """
    return "-" if math.isnan(percent) else f"{percent:+.1f}" if abs(percent) > 1e-6 else "0"


VERIFIED = (
    DataColumn("strategy", lambda one: one.name),
    DataColumn("largest in", lambda one: one.worst_place),
    DataColumn("K_dyn\nmodel", lambda one: one.drive.k_dyn, 4),
    DataColumn("K_dyn\nchain", lambda one: one.chain_k_dyn, 4),
    DataColumn("deviation\n%", lambda one: 100.0 * one.error, 1),
    DataColumn("start time\nmodel s", lambda one: one.drive.start_time),
    DataColumn("start time\nchain s", lambda one: one.chain.start_time),
)


def verified_table(verified: Sequence[Verification]) -> TextTable:
    """The starts on the drive and on the chain."""
    return TextTable.of_data("Designed on the two-mass model, verified on the chain", VERIFIED, verified)


# figure ----------------------------------------------------------------------------------------------------


def shapes_figure(vibration: Vibration, modes: int = 3) -> Figure:
    """The chain at the motor shaft to scale, and below it the lowest elastic shapes with their nodes.

    The height of a disc goes with the fourth root of its inertia, as that of steel discs of one thickness;
    the length of a spring with its compliance, as in the centre-of-mass analogy of [R]; the opening of a gap
    with its angle. Without `modes` the chain alone.
    """
    chain = vibration.chain
    with drawing():
        figure, panels = new_figure(1 + bool(modes), 1, squeeze=False, sharex=True)
        middles = _scheme(panels[0, 0], chain)
        width = min(max(8.0, (middles[-1] + 190.0) / 85.0), WIDEST)
        figure.set_size_inches(width, 2.8 + 2.4 * bool(modes))
        for axes in panels[1:, 0]:
            axes.axhline(0.0, color="black", lw=0.8)
            for m in range(1, min(modes, vibration.Omega.size - 1) + 1):
                colour, label = COLOURS[(m - 1) % len(COLOURS)], f"mode {m}: {vibration.frequency[m]:.4g} Hz"
                axes.plot(middles, vibration.shape[m], "o-", ms=4, color=colour, label=label)
                nodes = [n.shaft + n.share for n in vibration.nodes[m]]
                at = np.interp(nodes, range(len(middles)), middles)
                axes.plot(at, 0.0 * at, "o", ms=8, mfc="white", mec=colour, mew=1.6, zorder=4)
            axes.grid(False)
            axes.tick_params("x", length=0, labelbottom=False)
            head(axes, "shapes with the gaps closed; circles: nodes", "amplitude at the motor shaft")
            legend_above(axes, modes)
        panels[-1, 0].set_xlabel("at the motor shaft: inertias in kg m2, stiffnesses in N m/rad, gaps in rad")
        title = [chain.name, f"assumed: {chain.assumed}"] if chain.assumed else [chain.name]
        entitle(figure, "\n".join(fill(one, 115, max_lines=2, placeholder=" ...") for one in title))
    return figure


def _scheme(axes: Axes, chain: Chain) -> list[float]:
    """Draw the row of discs and shafts; where the discs are. Lengths are those of a screen, in pixels."""
    arrays = chain.at_motor_shaft()
    grounded = np.where(np.isinf(arrays.J), arrays.moving_J.max(), arrays.moving_J)
    tall = TALLEST * (grounded / grounded.max()) ** 0.25
    springs = 44.0 + 420.0 / arrays.c / (1.0 / arrays.c).sum()
    openings = np.where(arrays.gap > 0.0, 11.0 + 90.0 * arrays.gap / max(arrays.gap.sum(), 1e-300), 0.0)
    middles: list[float] = np.cumsum([0.0, *(springs + openings + DISC)]).tolist()
    for k, mass in enumerate(chain.masses):
        x = middles[k]
        name = mass.name if len(mass.name) <= LONGEST_NAME else f"{mass.name[:LONGEST_NAME]}..."
        axes.bar(x, tall[k], DISC, bottom=-0.5 * tall[k], color="#B9C6D3", edgecolor="black")
        axes.text(x, 0.5 * tall[k] + 6.0, name, rotation=35, rotation_mode="anchor", parse_math=False)
        below = [short_of(arrays.J[k])]
        below += ["motor"] if k == arrays.motor and chain.motor is not None else []
        below += [f"Mc {short_of(arrays.Mc[k])} N m"] if arrays.Mc[k] else []
        axes.text(x, -0.5 * TALLEST - 6.0, "\n".join(below), ha="center", va="top")
    for k, shaft in enumerate(chain.shafts):
        says = ["rigid" if arrays.rigid[k] else short_of(arrays.c[k])]
        says += [f"gap {short_of(arrays.gap[k])}"] if arrays.gap[k] else []
        says += [f"{short_of(shaft.ratio)} : 1"] if shaft.ratio != 1.0 else []
        says += [f"efficiency {shaft.efficiency:.3g}"] if shaft.efficiency < 1.0 else []
        start, end = middles[k] + 0.5 * DISC, middles[k + 1] - 0.5 * DISC
        axes.text(0.5 * (start + end), -18.0, "\n".join(says), ha="center", va="top", fontsize=7.5)
        coiled = start + springs[k]
        at = np.linspace(start + 6.0, coiled - 6.0, 4 * max(3, round(springs[k] / 14.0)) + 1)[1::2]
        y = 0.0 * at if arrays.rigid[k] else np.resize([7.0, -7.0], at.size)
        axes.plot([start, start + 6.0, *at, coiled - 6.0, coiled], [0.0, 0.0, *y, 0.0, 0.0], color="black",
                  lw=4.0 if arrays.rigid[k] else 1.2)  # fmt: skip
        if arrays.gap[k]:  # a stop behind the spring, another one before the next mass
            axes.plot([coiled, coiled], [-10.0, 14.0], color=COLOURS[1], lw=3.0)
            axes.plot([end - 8.0, end - 8.0], [-10.0, 14.0], color=COLOURS[1], lw=3.0)
            axes.plot([end - 8.0, end], [0.0, 0.0], color="black", lw=1.2)
    axes.set_ylim(-0.5 * TALLEST - 55.0, 0.5 * TALLEST + 75.0)
    axes.set_xlim(-50.0, middles[-1] + 140.0)
    axes.grid(False)
    axes.set_yticks([])
    axes.tick_params("x", length=0, labelbottom=False)
    axes.spines[:].set_visible(False)
    return middles


def short_of(value: float) -> str:
    """A number of three digits for a label.

    >>> short_of(20100.0), short_of(0.0301)
    ('20.1k', '0.0301')
    """
    size, letter = next((one for one in ((1e6, "M"), (1e3, "k")) if abs(value) >= one[0]), (1.0, ""))
    return f"{value / size:.3g}{letter}"
