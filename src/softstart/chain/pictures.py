"""Figures of chains: shapes with their nodes, and what each step of a reduction does to the frequencies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.views.drawing import COLOURS, drawing, new_figure

if TYPE_CHECKING:
    from softstart.chain.reduction import Reduction
    from softstart.chain.vibration import Vibration

__all__ = ["reduction_figure", "shapes_figure"]


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


def reduction_figure(reduction: Reduction) -> Any:
    """The partial frequency of each step over what it had to be above, and the errors with their bounds."""
    steps = [step for step in reduction.steps if math.isfinite(step.ratio)]
    with drawing():
        figure, (above, below) = new_figure(2, size=(8.0, 5.6), sharex=True)
        left = [step.masses_left for step in steps]
        above.semilogy(left, [step.ratio for step in steps], "o-", color=COLOURS[0])
        above.axhline(reduction.factor, color=COLOURS[1], ls="--", label=f"condition: {reduction.factor:g}")
        above.set_ylabel("(partial / wanted frequency)$^2$")
        above.legend()
        for i in range(len(reduction.frequencies)):
            colour = COLOURS[i % len(COLOURS)]
            errors = [100 * abs(step.errors[i]) if i < len(step.errors) else math.nan for step in steps]
            bounds = [100 * step.bounds[i] if i < len(step.bounds) else math.nan for step in steps]
            below.semilogy(
                left, np.maximum(errors, 1e-12), "o-", color=colour, label=f"frequency {i + 1}: error"
            )
            below.semilogy(left, np.maximum(bounds, 1e-12), ":", color=colour, label="its bound")
        below.set_ylabel("error, %")
        below.set_xlabel("masses left")
        below.xaxis.get_major_locator().set_params(integer=True)
        below.legend()
        below.invert_xaxis()
        above.set_title(f"{reduction.chain.name}: reduction, method {reduction.method}")
    return figure
