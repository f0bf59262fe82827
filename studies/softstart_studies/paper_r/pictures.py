"""The figures of the study: they draw what the other files found."""

from __future__ import annotations

from typing import Any

import numpy as np

from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure
from softstart_studies.paper_r.findings import normal, widened
from softstart_studies.paper_r.four_to_two import SHARES, STIFFNESSES, ErrorMap
from softstart_studies.paper_r.free import placed, tractor
from softstart_studies.paper_r.locked import FREQUENCIES, TORQUES, forced, locked

__all__ = ["locking_figure", "map_figure", "node_figure", "shapes_figure"]


def map_figure(found: ErrorMap) -> Any:
    """The error of the lever rule over inner inertia and stiffnesses, with the condition."""
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 5.0))
        axes.set_xscale("log")  # before the labels, which cut their gaps into the lines as drawn now
        axes.set_yscale("log")
        levels = [0.1, 0.3, 1.0, 3.0, 10.0, 30.0]
        drawn = axes.contour(
            STIFFNESSES, SHARES, -100 * found.lever, levels, colors=COLOURS[0], linewidths=1.4
        )
        axes.clabel(drawn, fmt="%g %%", inline_spacing=1)
        held = axes.contour(STIFFNESSES, SHARES, found.ratio, [10.0], colors=COLOURS[1], linestyles="--")
        axes.clabel(held, fmt="$(w_{(1,2)}/w)^2$ = %g", inline_spacing=1)
        axes.set_xlabel("$c_1/c_3$")
        axes.set_ylabel("$(I_2 + I_3)/(I_1 + I_4)$")
        axes.set_title(
            "Four masses to two, $I_4 = 5 I_1$: how low the lever rule puts the frequency", loc="left"
        )
    return figure


def shapes_figure() -> Any:
    """The first free shape for gaps of several widths."""
    chain = tractor()
    names = [mass.name for mass in chain.masses]
    first = names.index("flywheel")
    runs = widened()
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.6))
        for i, width in enumerate((0.0, 1.0, 2.0, 4.0)):
            run = runs[width]
            label = "without gaps" if width == 0.0 else f"gaps {width:g} times those of [R]"
            axes.plot(
                range(len(names) - first),
                normal(run)[first:],
                "o",
                ls=DASHES[i],
                color=COLOURS[i],
                label=f"{label}: {run.Omega:.1f} rad/s",
            )
        axes.axhline(0.0, color="black", lw=0.8)
        axes.set_xticks(range(len(names) - first), names[first:], rotation=30, ha="right")
        axes.set_ylabel("amplitude at the crank, track = 1")
        axes.set_title("Shape of the first free vibration (assumed chain)", loc="left")
        axes.legend()
    return figure


def node_figure() -> Any:
    """What one gap does in each section, against the torque of the mode there."""
    names = [mass.name.split()[0] for mass in tractor().masses]
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.4))
        for mode in (1, 2):
            found = placed(mode)
            axes.plot(
                [p.torque for p in found],
                [p.frequency for p in found],
                "os"[mode - 1],
                color=COLOURS[mode - 1],
                label=f"mode {mode} (filled: node in the section)",
                mfc="white",
            )
            inside = [p for p in found if p.node]
            axes.plot(
                [p.torque for p in inside],
                [p.frequency for p in inside],
                "os"[mode - 1],
                color=COLOURS[mode - 1],
            )
            for p in found if mode == 2 else ():
                axes.annotate(
                    f"{names[p.shaft]}-{names[p.shaft + 1]}",
                    (p.torque, p.frequency),
                    textcoords="offset points",
                    xytext=(6, 4) if p.torque < 0.9 else (-6, 6),
                    ha="left" if p.torque < 0.9 else "right",
                    fontsize=8,
                )
        axes.set_xlabel("torque of the mode in the section, of its largest")
        axes.set_ylabel("$w/\\Omega$ with a gap of 0.05 rad there")
        axes.set_title("Where a gap lowers the frequency (assumed chain)", loc="left")
        axes.legend(loc="lower left")
    return figure


def locking_figure() -> Any:
    """Free frequency over the constant torque, and the forced response."""
    with drawing():
        figure, (left, right) = new_figure(1, 2, (9.0, 4.2))
        found = [locked(torque) for torque in TORQUES]
        left.plot([one.torque for one in found], [one.frequency for one in found], "o-", color=COLOURS[0])
        left.set_xlabel("constant torque, N m")
        left.set_ylabel("$w/\\Omega$ of the free vibration")
        left.set_title("Locking (assumed chain)", loc="left")
        for i, (gaps, torque, label) in enumerate(
            ((0.0, 0.0, "no gaps"), (1.0, 0.0, "gaps"), (1.0, 540.0, "gaps, 540 N m constant"))
        ):
            right.semilogy(
                FREQUENCIES,
                np.array(forced(gaps, torque)),
                "o",
                ms=3,
                ls=DASHES[i],
                color=COLOURS[i],
                label=label,
            )
        right.set_xlabel("frequency, rad/s")
        right.set_ylabel("amplitude at the crank nose, deg")
        right.set_title("Forced response", loc="left")
        right.legend()
    return figure
