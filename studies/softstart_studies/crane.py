"""What studies share: the crane drive of [G], its strategies, percentages, and lines in a figure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from softstart import Drive
from softstart.arrays import Vector
from softstart.controller import Controller, make_controller
from softstart.study import Progress
from softstart.views.drawing import COLOURS, DASHES, GREY, head

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
    markers: Sequence[str] = ("",), levels: Iterable[float] = (), first: int = 0,
) -> None:  # fmt: skip
    """Lines (x, y) by their labels, a colour and dashes each from number `first` on; dotted at `levels`."""
    for level in levels:
        axes.axhline(level, color=GREY, lw=0.9, ls=":", zorder=1)
    for index, (label, (x, y)) in enumerate(lines.items(), start=first):
        look = {"marker": markers[index % len(markers)], "ms": 5, "mfc": "white"}
        axes.plot(x, y, color=COLOURS[index], ls=DASHES[index], label=label, **look)
    head(axes, title, up, across)
