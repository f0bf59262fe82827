"""Names beside the points of a figure, placed so that they cover nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Box = tuple[float, float, float, float]  # left, bottom, right, top in pixels
Place = NDArray[np.float64]  # x, y in pixels
Named = tuple[str, float, float, Place]

SIZE = 8.0  # of the letters, points
FAR = 14.0  # points between a label and its point from which on a thin line joins them
SAME = 4.0  # pixels between points that are one to the eye


def name_points(figure: Figure, axes: Axes, named: Sequence[tuple[str, float, float]]) -> None:
    """A label beside each point (text, x, y), clear of all points, lines of the axes, legend and labels.

    Points at one place share a label, of one line each. The layout of the figure is settled and fixed by
    this: call it last.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    points = _together([(text, x, y, axes.transData.transform((x, y))) for text, x, y in named])
    at = [place for *_, place in points]
    taken = [_around(place[0], place[1], 6.0 * _scale(axes)) for place in at]
    for line in axes.get_lines():
        if line.get_transform() == axes.transData:
            taken += [_around(x, y, 2.0) for x, y in _along(axes.transData.transform(line.get_xydata()))]
    legend = axes.get_legend()
    if legend is not None:
        taken.append(_box(legend))
    frame, scale = _box(axes), _scale(axes)
    for text, x, y, place in sorted(points, key=lambda one: -one[3][1]):
        label = axes.annotate(text, (x, y), (0, 0), textcoords="offset points", fontsize=SIZE)
        width, height = _size(label)
        label.remove()
        others = [other for other in at if other is not place]
        dx, dy = _free_place(place, width, height, taken, others, frame, scale)
        taken.append((place[0] + dx, place[1] + dy, place[0] + dx + width, place[1] + dy + height))
        axes.annotate(
            text, (x, y), (dx / scale, dy / scale), textcoords="offset points", fontsize=SIZE,
            arrowprops=_leader(dx, dy, width, height, scale), zorder=5,
            bbox={"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.5},
        )  # fmt: skip


def _together(points: Sequence[Named]) -> list[Named]:
    """Points that cover each other made one, their texts below each other."""
    made: list[Named] = []
    for text, x, y, place in points:
        for index, (before, x0, y0, there) in enumerate(made):
            if float(np.hypot(*(place - there))) < SAME:
                made[index] = (f"{before}\n{text}", x0, y0, there)
                break
        else:
            made.append((text, x, y, place))
    return made


def _leader(dx: float, dy: float, width: float, height: float, scale: float) -> dict[str, Any] | None:
    """A thin line from the label to its point, if the two are far apart."""
    across = max(dx, -dx - width, 0.0)
    upward = max(dy, -dy - height, 0.0)
    if math.hypot(across, upward) < FAR * scale:
        return None
    return {"arrowstyle": "-", "lw": 0.5, "color": "#999999", "shrinkA": 1.0, "shrinkB": 4.0}


def _free_place(
    place: Place,
    width: float,
    height: float,
    taken: Sequence[Box],
    others: Sequence[Place],
    frame: Box,
    scale: float,
) -> tuple[float, float]:
    """The nearest lower left corner, relative to the point, at which the label covers least."""
    best, least = (0.0, 0.0), math.inf
    for points in (9.0, 14.0, 20.0, 28.0, 38.0, 50.0, 66.0, 84.0, 110.0):
        away = points * scale
        for turn in np.arange(0.0, 360.0, 22.5):
            # the middle of the label on an ellipse around the point that keeps its edge `away`
            c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
            dx = c * (away + 0.5 * width) - 0.5 * width
            dy = s * (away + 0.5 * height) - 0.5 * height
            box = (place[0] + dx, place[1] + dy, place[0] + dx + width, place[1] + dy + height)
            covered = sum(shared(box, other) for other in taken) + 10.0 * (
                width * height - shared(box, frame)
            )
            if any(_distance(box, other) < 1.5 * _distance(box, place) for other in others):
                covered += 0.3 * width * height  # it would seem to belong to that one
            if covered < least - 1e-6:
                best, least = (dx, dy), covered
        if least < 1e-6:
            break
    return best


def shared(a: Box, b: Box) -> float:
    """Area that two rectangles share.

    >>> shared((0, 0, 2, 2), (1, 1, 3, 3)), shared((0, 0, 1, 1), (2, 0, 3, 1))
    (1, 0.0)
    """
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    return wide * high if wide > 0.0 and high > 0.0 else 0.0


def _distance(box: Box, place: Place) -> float:
    """From a rectangle to a point outside it, 0 inside."""
    across = max(box[0] - place[0], place[0] - box[2], 0.0)
    upward = max(box[1] - place[1], place[1] - box[3], 0.0)
    return math.hypot(across, upward)


def _scale(axes: Axes) -> float:
    """Pixels in a point."""
    return float(axes.get_figure(root=True).dpi) / 72.0  # type: ignore[union-attr]


def _box(artist: Any) -> Box:
    left, bottom, right, top = artist.get_window_extent().extents
    return float(left), float(bottom), float(right), float(top)


def _size(label: Any) -> tuple[float, float]:
    left, bottom, right, top = _box(label)
    return right - left, top - bottom


def _around(x: float, y: float, half: float) -> Box:
    return x - half, y - half, x + half, y + half


def _along(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points along a line in pixels, a few pixels apart."""
    parts = [np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / 4.0)) for a, b in pairwise(corners)]
    return np.concatenate(parts) if parts else corners
