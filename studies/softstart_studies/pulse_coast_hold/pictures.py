"""The figures of the study; they compute nothing that is claimed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from softstart import simulate
from softstart.drive import LoadKind
from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure
from softstart_studies.pulse_coast_hold.cells import CONTROLLER, Cell
from softstart_studies.pulse_coast_hold.crane import TOLD, Extent
from softstart_studies.pulse_coast_hold.tolerances import Case
from softstart_studies.pulse_coast_hold.verdicts import MOST, WITH_TOLERANCES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

K_DYN = "$K_{dyn}$"
GREY = "#666666"


def starts_figure(extent: Extent) -> Figure:
    """Motor torque, shaft torque and speeds of the corner cells, a column a kind of load."""
    gaps, ratios = (extent.gaps[0], extent.gaps[-1]), (extent.ratios[0], extent.ratios[-1])
    corners = [(gap, ratio) for ratio in ratios for gap in gaps]
    with drawing():
        figure, panels = new_figure(
            3, len(extent.kinds), (9.5, 8.0), sharex=True, sharey="row", squeeze=False
        )
        for column, kind in enumerate(extent.kinds):
            motor, shaft, speed = panels[:, column]
            told = TOLD.replace(load_kind=kind)
            for index, (gap, ratio) in enumerate(corners):
                drive = told.replace(gap=gap, load_inertia=ratio * float(TOLD.J1), encoder_phase=0.3)
                run = simulate(drive, CONTROLLER, fitted_to=told)
                colour, dash = COLOURS[index], DASHES[index]
                label = f"gap {gap:g} rad, $J_2$ = {ratio:g} $J_1$: {K_DYN} {run.k_dyn:.3f}"
                motor.plot(run.t, run.u, color=colour, ls=dash, label=label)
                shaft.plot(run.t, run.T / drive.mean_torque, color=colour, ls=dash)
                speed.plot(run.t, run.w2, color=colour, ls=dash)
                speed.plot(run.t, run.w1, color=colour, lw=0.7, alpha=0.8)
            motor.set_title(f"{kind} load", loc="left")
            motor.set_ylim(-3.0, 125.0)
            motor.set_yticks([0, 20, 40, 60])
            motor.legend(loc="upper left", handlelength=3.2, fontsize=8.5)
            shaft.axhline(1.0, color=GREY, lw=0.9, ls=":")
            speed.axhline(float(TOLD.target_speed), color=GREY, lw=0.9, ls=":")
            speed.set_xlabel("time, s")
        panels[0, 0].set_ylabel("motor torque, N m")
        panels[1, 0].set_ylabel("shaft torque / $M_{12avg}$")
        panels[2, 0].set_ylabel("speed, rad/s\n(load; thin: motor; dotted: target)")
    return figure  # type: ignore[no-any-return]


def ratios_figure(grids: Mapping[LoadKind, Sequence[Cell]]) -> Figure:
    """The worst K_dyn over the optimum of each cell, as a map; K_dyn and that of the optimum written in."""
    with drawing():
        figure, panels = new_figure(1, len(grids), (9.5, 4.6), squeeze=False)
        top = max(float(cell.over.max()) for found in grids.values() for cell in found)
        for axes, (kind, found) in zip(panels[0], grids.items(), strict=True):
            gaps = sorted({cell.gap for cell in found})
            ratios = sorted({cell.ratio for cell in found})
            field = np.full((len(ratios), len(gaps)), np.nan)
            for cell in found:
                row, column = ratios.index(cell.ratio), gaps.index(cell.gap)
                field[row, column] = cell.over.max()
                axes.text(
                    column, row,
                    f"{cell.over.max():.3f}\n{cell.k_dyn.max():.3f} / {cell.optimum:.3f}",
                    ha="center", va="center", fontsize=8.5,
                )  # fmt: skip
            image = axes.imshow(
                field, cmap="YlOrBr", vmin=1.0, vmax=max(*MOST.values(), top), origin="lower", aspect="auto"
            )
            axes.grid(visible=False)
            axes.set_xticks(range(len(gaps)), [f"{gap:g}" for gap in gaps])
            axes.set_yticks(range(len(ratios)), [f"{ratio:g}" for ratio in ratios])
            axes.set_xlabel("gap, rad")
            axes.set_title(f"{kind} load (at most {MOST[kind]:.2f} asked)", loc="left")
        panels[0, 0].set_ylabel("$J_2/J_1$")
        figure.colorbar(image, ax=panels[0, :], label=f"worst {K_DYN} over the optimum")
        figure.suptitle(
            f"worst ratio of each cell; below it the worst {K_DYN} / that of the optimum", fontsize=9.5
        )
    return figure  # type: ignore[no-any-return]


def tolerances_figure(found: Sequence[Case]) -> Figure:
    """The worst ratio under each deviation."""
    names = list(dict.fromkeys(case.what for case in found))
    kinds = list(dict.fromkeys(case.kind for case in found))
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 5.2))
        for index, kind in enumerate(kinds):
            here = [case for case in found if case.kind == kind]
            places = [names.index(case.what) + 0.18 * (2 * index - len(kinds) + 1) for case in here]
            axes.plot(
                [case.over for case in here], places, "os"[index % 2], color=COLOURS[index], ms=6,
                mfc="white", mew=1.6, label=f"{kind} load",
            )  # fmt: skip
        axes.axvline(WITH_TOLERANCES, color=GREY, lw=1.0, ls="--", label="asked")
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.set_xlim(left=1.0)
        axes.set_xlabel(f"worst {K_DYN} over the optimum")
        figure.legend(loc="outside lower center", ncols=3)
    return figure  # type: ignore[no-any-return]
