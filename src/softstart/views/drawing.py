"""How all figures look, and how they are saved. Figures take finished results and compute no claims."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.input.files import write_whole
from softstart.late import late

if TYPE_CHECKING:
    import matplotlib as mpl
    import matplotlib.figure as mpl_figure
    from matplotlib import ticker
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softstart.start.run import Run
else:
    mpl, mpl_figure = late("matplotlib"), late("matplotlib.figure")
    ticker = late("matplotlib.ticker")

# Okabe-Ito: told apart by colour-blind readers and in grey
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
SHAFTS = tuple(COLOURS[k] for k in (0, 2, 4, 3, 5, 7))  # of a chain; the motor has another one
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (3, 1)), (0, (1, 1)), (0, (8, 2)))
GREY, SMALL = "#666666", 9.5
GAP_SHADE = "#E8ECEF"
MARKERS = "osD^vPX*<>hd"

PICTURE_ENDINGS = ("svg", "png")  # of each figure that is saved

Box = tuple[float, float, float, float]  # left, bottom, right, top in pixels
Pixels = NDArray[np.float64]  # x, y
Named = tuple[str, float, float, Pixels]

LABEL_SIZE = 8.0  # of the letters, points
FAR = 14.0  # points between a label and its point from which on a thin line joins them
SAME = 4.0  # pixels between points that are one to the eye

STYLE: dict[str, Any] = {
    "figure.figsize": (8.0, 5.0),
    "figure.constrained_layout.use": True,
    "font.size": 9.5,
    "axes.grid": True,
    "grid.color": "#D9D9D9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "softstart",
}


@contextmanager
def drawing() -> Iterator[None]:
    """Softstart's look, without touching the caller's settings or needing a screen."""
    settings: Any = STYLE
    with mpl.rc_context(settings), warnings.catch_warnings():
        # a drive may be named in any script: what the font lacks is drawn as a box
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        yield


def new_figure(
    rows: int = 1, columns: int = 1, size: tuple[float, float] | None = None, **options: Any
) -> Any:
    """A Figure outside pyplot (nothing to close, no window) and its axes."""
    figure = mpl_figure.Figure(figsize=size)
    return figure, figure.subplots(rows, columns, **options)


def save_figure(figure: mpl_figure.Figure, folder: Path, stem: str) -> list[Path]:
    """Write stem.svg and stem.png into the folder, each whole or not at all."""
    written = []
    for ending, options in zip(PICTURE_ENDINGS, ({"metadata": {"Date": None}}, {"dpi": 160}), strict=True):
        path = folder / f"{stem}.{ending}"
        with drawing():
            write_whole(path, lambda f, e=ending, o=options: figure.savefig(f, format=e, **o), binary=True)  # type: ignore[misc]
        written.append(path)
    return written


def entitle(figure: Figure, text: str) -> None:
    """A title over all panels, on the left."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=11)


def head(axes: Axes, title: str, up: str, across: str = "") -> None:
    """A small title on the left of a panel, and what its axes show."""
    axes.set_title(title, loc="left", fontsize=SMALL)
    axes.set_ylabel(up)
    if across:
        axes.set_xlabel(across)


def legend_above(axes: Axes, columns: int, **options: Any) -> None:
    """A legend of one row at the right, beside the title of a panel."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.1, **options)


def plain_ticks(axis: Any, locator: Any) -> None:
    """Numbers as they are, not as powers, on a logarithmic axis."""
    axis.set_major_locator(locator)
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(ticker.NullLocator())


def shade_open_gap(axes: Axes, run: Run, until: float = math.inf) -> None:
    """Grey where the gap is open."""
    spans = [(one.start, one.duration) for one in run.stages if one.side == 0 and one.start < until]
    axes.broken_barh(
        [span for span in spans if span[1] > 0.0], (0.0, 1.0), color=GAP_SHADE, lw=0, zorder=0,
        transform=axes.get_xaxis_transform(),
    )  # fmt: skip


# names beside the points of a figure, placed so that they cover nothing ------------------------------------


def name_points(figure: Figure, axes: Axes, named: Sequence[tuple[str, float, float]]) -> None:
    """A label beside each point (text, x, y), clear of all points, lines of the axes, legend and labels.

    Points in one place share a label, of one line each. The layout of the figure is settled and fixed by
    this: call it last.
    """
    with drawing():
        figure.draw_without_rendering()
    figure.set_layout_engine("none")
    points = _together([(text, x, y, axes.transData.transform((x, y))) for text, x, y in named])
    spots = [spot for *_, spot in points]
    taken = [_around(spot[0], spot[1], 6.0 * _scale(axes)) for spot in spots]
    for line in axes.get_lines():
        if line.get_transform() == axes.transData:
            taken += [_around(x, y, 2.0) for x, y in _along(axes.transData.transform(line.get_xydata()))]
    legend = axes.get_legend()
    if legend is not None:
        taken.append(_box(legend))
    frame, scale = _box(axes), _scale(axes)
    for text, x, y, spot in sorted(points, key=lambda one: -one[3][1]):
        label = axes.annotate(text, (x, y), (0, 0), textcoords="offset points", fontsize=LABEL_SIZE)
        width, height = _size(label)
        label.remove()
        others = [other for other in spots if other is not spot]
        dx, dy = _free_corner(spot, width, height, taken, others, frame, scale)
        taken.append((spot[0] + dx, spot[1] + dy, spot[0] + dx + width, spot[1] + dy + height))
        axes.annotate(
            text, (x, y), (dx / scale, dy / scale), textcoords="offset points", fontsize=LABEL_SIZE,
            arrowprops=_leader(dx, dy, width, height, scale), zorder=5,
            bbox={"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.5},
        )  # fmt: skip


def _together(points: Sequence[Named]) -> list[Named]:
    """Points that cover each other made one, their texts below each other."""
    made: list[Named] = []
    for text, x, y, spot in points:
        for index, (before, x0, y0, other) in enumerate(made):
            if float(np.hypot(*(spot - other))) < SAME:
                made[index] = (f"{before}\n{text}", x0, y0, other)
                break
        else:
            made.append((text, x, y, spot))
    return made


def _leader(dx: float, dy: float, width: float, height: float, scale: float) -> dict[str, Any] | None:
    """A thin line from the label to its point, if the two are far apart."""
    across = max(dx, -dx - width, 0.0)
    upward = max(dy, -dy - height, 0.0)
    if math.hypot(across, upward) < FAR * scale:
        return None
    return {"arrowstyle": "-", "lw": 0.5, "color": "#999999", "shrinkA": 1.0, "shrinkB": 4.0}


def _free_corner(
    spot: Pixels,
    width: float,
    height: float,
    taken: Sequence[Box],
    others: Sequence[Pixels],
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
            box = (spot[0] + dx, spot[1] + dy, spot[0] + dx + width, spot[1] + dy + height)
            covered = 5.0 * sum(shared(box, other) for other in taken) + 10.0 * (
                width * height - shared(box, frame)
            )
            if any(_distance(box, other) < 1.5 * _distance(box, spot) for other in others):
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


def _distance(box: Box, spot: Pixels) -> float:
    """From a rectangle to a point outside it, 0 inside."""
    across = max(box[0] - spot[0], spot[0] - box[2], 0.0)
    upward = max(box[1] - spot[1], spot[1] - box[3], 0.0)
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
