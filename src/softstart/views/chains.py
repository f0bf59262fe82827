"""Chains in words, tables and figures: vibration, reduction, and starts beside the reduced drive."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.views.drawing import COLOURS, drawing, new_figure
from softstart.views.numbers import Table, column_of, number, short

if TYPE_CHECKING:
    from softstart.chain.two_masses import TwoMassError, Verification
    from softstart.vibration import Reduction, Vibration

MOST_MODES = 12
ALIKE = 0.01  # share by which two K_dyn differ at least where one strategy counts as gentler


# words -----------------------------------------------------------------------------------------------------


def conclusion(found: Reduction) -> str:
    """What came out."""
    masses, kept = len(found.chain.masses), f"first natural frequency {found.whole.Omega:.6g} rad/s"
    if masses == 2:
        return f"The chain has two masses already: {kept}."
    off = 100.0 * (found.reduced.participation / found.whole.participation - 1.0)
    said = (
        f"{masses} masses became 2, with the {kept}, the node and the inertia of the chain; the "
        f"participation of the motor is {off:+.2g} % off."
    )
    if found.forced:
        said += f" The condition fails: its least ratio is {found.least_ratio:.3g}, below {found.factor:g}."
    return said


def footnotes(found: Reduction) -> list[str]:
    """What a reader must know."""
    notes = [note[0].upper() + note[1:] + "." for note in found.notes]
    if found.chain.assumed:
        notes.append(f"Assumed: {found.chain.assumed}.")
    return notes


def reordered(done: Sequence[Verification]) -> tuple[Verification, Verification] | None:
    """The pair that stands the other way round on the chain, the one that is gentler there first.

    Of several the one that differs most on the chain; strategies that are alike are no pair.
    """
    pairs = []
    for one, other in combinations(done, 2):
        gentler, harder = sorted((one, other), key=lambda v: v.chain_k_dyn)
        if (
            gentler.chain_k_dyn < (1.0 - ALIKE) * harder.chain_k_dyn
            and harder.drive.k_dyn < (1.0 - ALIKE) * gentler.drive.k_dyn
        ):
            pairs.append((gentler, harder))
    return max(pairs, key=lambda pair: pair[1].chain_k_dyn / pair[0].chain_k_dyn, default=None)


def enough(found: TwoMassError) -> str:
    """Whether two masses are enough, and for what they are not, in a few sentences."""
    limit = f"{100.0 * found.LIMIT:g} %"
    if found.enough:
        torques = f"and under {found.TORQUES} torques over time "
        return (
            f"Two masses are enough: K_dyn of {', '.join(one.name for one in found.verified)} {torques}"
            f"is off by {_percent(found.error)} at most (limit {limit})."
        )
    said = [f"{name} does not start the chain" for name in found.failed]
    worst = found.worst
    if worst is not None and abs(worst.error) > found.LIMIT:
        said.append(
            f"{worst.name} has K_dyn {worst.chain_k_dyn:.3g} on the chain and {worst.drive.k_dyn:.3g} on them"
        )
    if found.of_torques > found.LIMIT:
        said.append(f"of {found.TORQUES} torques over time the worst is {_percent(found.of_torques)} off")
    text = f"Two masses are not enough: {'; '.join(said)} (limit {limit})."
    pair = reordered(found.verified)
    if pair is not None:
        gentler, harder = pair
        text += (
            f" On the chain {gentler.name} is gentler than {harder.name} (K_dyn {gentler.chain_k_dyn:.3g} "
            f"and {harder.chain_k_dyn:.3g}), on two masses it is the other way round "
            f"({gentler.drive.k_dyn:.3g} and {harder.drive.k_dyn:.3g})."
        )
    return f"{text} Choose by the chain: simulate, compare, optimize, tune, sweep, linear and others take it."


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 1.0 else f"{100.0 * share:.0f} %"


def verdict(found: TwoMassError | None) -> dict[str, Any]:
    """The same as plain data; nothing where no drive comes out."""
    if found is None:
        return {"verified": [], "verdict": None}
    done = found.verified
    orders = {
        "order_on_drive": [one.name for one in sorted(done, key=lambda v: v.drive.k_dyn)],
        "order_on_chain": [one.name for one in sorted(done, key=lambda v: v.chain_k_dyn)],
        "order_differs": reordered(done) is not None,
        "said": enough(found),
    }
    return {"verified": [one.summary() for one in done], "verdict": {**found.summary(), **orders}}


# tables ----------------------------------------------------------------------------------------------------


def tables(found: Reduction, off: TwoMassError | None = None) -> list[Table]:
    """Frequencies, the two masses beside the chain, and the starts on both."""
    shown = [frequencies_table(found.vibration), two_masses_table(found)]
    return shown if off is None or not off.verified else [*shown, verified_table(off.verified)]


def frequencies_table(vibration: Vibration) -> Table:
    """The lowest natural frequencies with their nodes."""
    count = min(vibration.Omega.size, MOST_MODES)
    nodes = [", ".join(f"{n.shaft + 1 + n.share:.2f}" for n in vibration.nodes[m]) for m in range(count)]
    more = vibration.Omega.size - count
    title = f"Natural frequencies, gaps closed{f' (and {more} above)' if more else ''}"
    of_nodes = "nodes (7.30: behind mass 7, at 0.30 of the twist to mass 8)"
    cells = {
        of_nodes: [node or "-" for node in nodes],
        "mode": [str(m) for m in range(count)],
        "Omega\nrad/s": column_of([float(w) for w in vibration.Omega[:count]], 6),
        "Hz": column_of([float(f) for f in vibration.frequency[:count]], 5),
    }
    return Table.of(title, cells, texts=[of_nodes])


def two_masses_table(found: Reduction) -> Table:
    """The chain beside the two masses, and how far these are off."""
    names = {
        "first elastic frequency, rad/s": "Omega",
        "node: share of the twist before it": "node",
        "participation of the motor": "participation",
        "stiffness motor - load, N m/rad": "stiffness",
        "whole inertia, kg m2": "inertia",
        "whole gap, rad": "gap",
    }
    chain, two = ([getattr(one, key) for key in names.values()] for one in (found.whole, found.reduced))
    off = [100.0 * (b - a) / a if a else 0.0 for a, b in zip(chain, two, strict=True)]
    cells = {
        "at the motor shaft": [*names, "J1, kg m2", "J2, kg m2"],
        "chain": [*map(short, chain), "-", "-"],
        "two masses": [*map(short, two), short(found.J1), short(found.J2)],
        "off\n%": [*(f"{one:+.1f}" if abs(one) > 1e-6 else "0" for one in off), "-", "-"],
    }
    condition = f"condition: {number(found.least_ratio, 1)}, at least {found.factor:g}"
    return Table.of(f"Two masses ({condition})", cells, texts=["at the motor shaft"])


def verified_table(done: Sequence[Verification]) -> Table:
    """The starts on the drive and on the chain."""
    cells = {
        "strategy": [one.name for one in done],
        "largest in": [one.worst_place for one in done],
        "K_dyn\ndrive": [number(one.drive.k_dyn, 4) for one in done],
        "K_dyn\nchain": [number(one.chain_k_dyn, 4) for one in done],
        "chain off\n%": [f"{100 * one.error:+.1f}" for one in done],
        "start time\ndrive s": column_of([one.drive.start_time for one in done], 4),
        "start time\nchain s": column_of([one.chain.start_time for one in done], 4),
    }
    title = "Designed on the two masses, verified on the chain"
    return Table.of(title, cells, texts=["strategy", "largest in"])


def files(found: Reduction, off: TwoMassError | None) -> dict[str, tuple[Sequence[str], list[list[Any]]]]:
    """The tables of --out with all digits: headings and rows by file name."""
    vibration, names = found.vibration, [mass.name for mass in found.chain.masses]
    modes = range(vibration.Omega.size)
    frequencies = [[m, float(vibration.Omega[m]), float(vibration.frequency[m])] for m in modes]
    made: dict[str, tuple[Sequence[str], list[list[Any]]]] = {
        "frequencies.csv": (("mode", "Omega [rad/s]", "frequency [Hz]"), frequencies),
        "shapes.csv": (("mode", *names), [[m, *vibration.shape[m].tolist()] for m in modes]),
    }
    if off is not None and off.verified:
        rows = [{k: v for k, v in one.summary().items() if k != "chain"} for one in off.verified]
        made["verified.csv"] = (list(rows[0]), [list(row.values()) for row in rows])
    return made


# figures ---------------------------------------------------------------------------------------------------


def shapes_figure(vibration: Vibration, modes: int = 3) -> Any:
    """The lowest elastic shapes along the compliance of the chain, with their nodes; grey where gaps are."""
    arrays = vibration.chain.at_motor_shaft()
    place = np.concatenate([[0.0], np.cumsum(1.0 / arrays.c)])
    place = place / place[-1]
    shown = min(modes, vibration.Omega.size - 1)
    with drawing():
        figure, axes = new_figure(size=(8.0, 4.2))
        for k in np.flatnonzero(arrays.gap > 0.0):
            axes.axvspan(place[k], place[k + 1], color="#E8ECEF", lw=0, zorder=0)
        axes.axhline(0.0, color="black", lw=0.8)
        for m in range(1, shown + 1):
            colour = COLOURS[(m - 1) % len(COLOURS)]
            label = f"mode {m}: {vibration.frequency[m]:.4g} Hz"
            axes.plot(place, vibration.shape[m], "o-", ms=4, color=colour, label=label)
            nodes = [
                place[n.shaft] + n.share * (place[n.shaft + 1] - place[n.shaft]) for n in vibration.nodes[m]
            ]
            axes.plot(nodes, np.zeros(len(nodes)), "o", ms=8, mfc="white", mec=colour, mew=1.6, zorder=4)
        _name_masses(axes, place, [mass.name for mass in vibration.chain.masses])
        axes.set_ylabel("amplitude at the motor shaft")
        axes.set_title(f"{vibration.chain.name}: shapes with the gaps closed")
        axes.legend()
    return figure


def _name_masses(axes: Any, place: np.ndarray[Any, Any], names: list[str]) -> None:
    """Names below the axis; masses at nearly one place share a tick."""
    ticks: list[float] = []
    labels: list[list[str]] = []
    for x, name in zip(place.tolist(), names, strict=True):
        if ticks and x - ticks[-1] < 0.05:
            labels[-1].append(name)
        else:
            ticks.append(x)
            labels.append([name])
    texts = [group[0] if len(group) == 1 else f"{group[0]} ... {group[-1]}" for group in labels]
    axes.set_xticks(ticks, texts, rotation=30, ha="right")
    axes.set_xlabel("place along the chain, by compliance (grey: shafts with a gap)")
