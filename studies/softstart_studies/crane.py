"""What studies share: the crane drive of [G], its strategies, percentages, and lines in a figure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart import Drive, Run
from softstart.arrays import Vector
from softstart.controller import Controller, make_controller
from softstart.study import Progress
from softstart.views.drawing import COLOURS, DASHES, GREY, drawing, head, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CRANE = Drive.load("crane-4amtkf")  # [G]: J1 = 0.035 kg m2, J2'' = 5 J1, delta1 = 0.5 rad, Ms = 62 N m
TARGET = 60.0  # rad/s, where start times are compared
LAG = 0.002  # s, of the torque of an inverter, assumed; encoder of 4096 lines and 1 kHz are the defaults
WITH_INVERTER = CRANE.replace(target_speed=TARGET, torque_lag=LAG)
RAISED_AT_THE_END = ("reduced-two-stage", "acceleration-delay")  # of stage 2, in [G]
K_DYN = "$K_{dyn}$"


def published(controller: str, **parameters: object) -> Controller:
    """A strategy as [G] proposes it: reduced torques are raised at the end of stage 2, (15), not its peak.

    >>> published("acceleration-delay").raise_at
    'end'
    """
    if controller in RAISED_AT_THE_END:
        parameters = {"raise_at": "end"} | parameters
    return make_controller(controller, parameters)


def prefixed(progress: Progress, what: str) -> Progress:
    """Progress with a few words before each report."""
    return lambda text: progress(f"{what}: {text}")


def percent(ratio: float, digits: int = 0) -> str:
    """How much more or less than 1, as text.

    >>> percent(1.56), percent(0.827), percent(1.0123, 1)
    ('+56 %', '-17 %', '+1.2 %')
    """
    return f"{100 * (ratio - 1):+.{digits}f} %"


def spread(k: Any) -> float:
    """Largest over least, less 1.

    >>> round(spread([1.0, 1.1]), 3)
    0.1
    """
    return float(np.max(k) / np.min(k)) - 1.0


def mean_and_most(ratio: Vector) -> tuple[float, float]:
    """Mean and largest of what is known; NaN where nothing is.

    >>> mean_and_most(np.array([1.0, 1.5, np.nan]))
    (1.25, 1.5)
    """
    known = ratio[np.isfinite(ratio)]
    return (float(known.mean()), float(known.max())) if known.size else (math.nan, math.nan)


def draw_lines(
    axes: Any, lines: Mapping[str, tuple[Any, Any]], title: str, across: str = "", up: str = "", *,
    markers: Sequence[str] = ("",), levels: Iterable[float] = (),
) -> None:  # fmt: skip
    """Lines (x, y) by their labels, a colour, dashes and marker each; dotted at `levels`."""
    for level in levels:
        axes.axhline(level, color=GREY, lw=0.9, ls=":", zorder=1)
    for index, (label, (x, y)) in enumerate(lines.items()):
        look = {"marker": markers[index % len(markers)], "ms": 5, "mfc": "white"}
        axes.plot(x, y, color=COLOURS[index], ls=DASHES[index], label=label, **look)
    head(axes, title, up, across)


def starts_figure(columns: Mapping[str, Mapping[str, Run]]) -> Figure:
    """Motor torque, shaft torque over its mean, and speeds of starts by their labels; a column each."""
    with drawing():
        figure, panels = new_figure(3, len(columns), (9.5, 7.8), sharex=True, sharey="row", squeeze=False)
        for (title, runs), (motor, shaft, speed) in zip(columns.items(), panels.T, strict=True):
            base = {name: run.peak_torque / run.k_dyn for name, run in runs.items()}
            draw_lines(motor, {name: (run.t, run.u) for name, run in runs.items()}, title)
            of_mean = {name: (run.t, run.T / base[name]) for name, run in runs.items()}
            draw_lines(shaft, of_mean, "", levels=[1.0])
            targets = {float(run.drive.target_speed) for run in runs.values()}
            lines = {name: (run.t, run.w2) for name, run in runs.items()}
            draw_lines(speed, lines, "", "time, s     (dots: load at its target speed)", levels=targets)
            for index, run in enumerate(runs.values()):
                speed.plot(run.t, run.w1, color=COLOURS[index], lw=0.8, alpha=0.8)
                end = run.start_time, float(run.at(run.start_time)["w2"])
                speed.plot(*end, "o", ms=5, color=COLOURS[index])
            motor.legend(loc="upper left", handlelength=3.2, fontsize=8.5)
        panels[0, 0].set(ylabel="motor torque, N m", ylim=(-3.0, 125.0), yticks=[0, 20, 40, 60])
        panels[1, 0].set_ylabel("shaft torque / $M_{12avg}$")
        panels[2, 0].set_ylabel("speed, rad/s\n(load; thin: motor; dotted: target)")
    return figure
