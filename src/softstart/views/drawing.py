"""How all figures look, and how they are saved. Figures take finished results and compute no claims."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.input.files import write_whole
from softstart.late import late

if TYPE_CHECKING:
    import matplotlib as mpl
    import matplotlib.figure as mpl_figure
    from matplotlib import colors, patheffects, ticker
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from scipy import ndimage

    from softstart.start.run import Run
else:
    mpl, mpl_figure = late("matplotlib"), late("matplotlib.figure")
    colors, ticker = late("matplotlib.colors"), late("matplotlib.ticker")
    patheffects, ndimage = late("matplotlib.patheffects"), late("scipy.ndimage")

# Okabe-Ito: told apart by colour-blind readers and in grey
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
SHAFTS = tuple(COLOURS[k] for k in (0, 2, 4, 3, 5, 7))  # of a chain; the motor has another one
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (3, 1)), (0, (1, 1)), (0, (8, 2)))
GREY, SMALL = "#666666", 9.5
GAP_SHADE = "#E8ECEF"
MARKERS = "osD^vPX*<>hd"
COLOUR_MAP, MISSING = "cividis", "#D0D0D0"  # even in lightness, for colour-blind and grey readers alike
LIGHT = 0.55  # share of the colours from which on numbers are dark
FINEST_CONTOUR = 50  # points along each side

PICTURE_ENDINGS = ("svg", "png")  # of each figure that is saved

Box = tuple[float, float, float, float]  # left, bottom, right, top in pixels
Pixels = NDArray[np.float64]  # x, y
Named = tuple[str, float, float, Pixels]

LETTERS = 11.0  # of a title, in an inch
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
    """A title over all panels, on the left; wrapped where the figure is narrow."""
    width = int(figure.get_figwidth() * LETTERS)
    text = "\n".join(fill(line, width) for line in text.split("\n"))
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


# maps ------------------------------------------------------------------------------------------------------


def panels(
    count: int, size: tuple[float, float], across: int, x_label: str, y_label: str
) -> tuple[Any, list[Axes]]:
    """A figure of panels of this size in inches with the same axes, so many across at most, and these."""
    columns = min(count, across)
    rows = -(-count // columns)
    whole = (1.0 + size[0] * columns, 0.7 + size[1] * rows)
    figure, axes = new_figure(rows, columns, whole, sharex=True, sharey=True, squeeze=False)
    for index, panel in enumerate(axes.flat):
        panel.set_visible(index < count)
        if index % columns == 0:
            panel.set_ylabel(y_label)
        if index + columns >= count:
            panel.set_xlabel(x_label)
            panel.tick_params(labelbottom=True)
    return figure, list(axes.flat[:count])


def colour_scale(*values: Any) -> Any:
    """Colours from the least to the largest of all finite values, logarithmic beyond a factor of 10."""
    finite = np.concatenate([one[np.isfinite(one)] for one in values])
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if high - low <= 1e-9 * abs(low):
        return colors.Normalize(low - 0.5, high + 0.5)
    return colors.LogNorm(low, high) if high > 10.0 * low > 0.0 else colors.Normalize(low, high)


def heat_map(
    axes: Axes, x: Any, y: Any, values: Any, scale: Any, *,
    decimals: int | None = None, struck: Any = None, margins: bool = False,
) -> Any:  # fmt: skip
    """Values in colours over x and y, the first row below; missing ones are grey.

    With `decimals` all cells have the same size and hold their number; those that are `struck` are struck
    out. Without, x and y are to scale, with contour lines, and the largest value is marked; of `margins` the
    line of 0 and the least one.
    """
    axes.grid(visible=False)
    axes.set_facecolor(MISSING)
    colours = {"norm": scale, "cmap": COLOUR_MAP, "shading": "nearest", "rasterized": True}
    if decimals is None:
        drawn = axes.pcolormesh(x, y, values, **colours)
        fit_axis(axes, "x", x)
        fit_axis(axes, "y", y)
        _contours(axes, np.asarray(x), np.asarray(y), values, margins)
        return drawn
    edges = [np.arange(len(one) + 1) - 0.5 for one in (x, y)]
    drawn = axes.pcolormesh(*edges, values, **(colours | {"shading": "flat"}))
    for (i, j), value in np.ndenumerate(values):
        text, light = (f"{value:.{decimals}f}", scale(value)) if math.isfinite(value) else ("-", 1.0)
        colour = "#000000" if light > LIGHT else "#FFFFFF"
        axes.text(j, i, text, ha="center", va="center", color=colour, fontsize=8.0)
        if struck is not None and struck[i, j]:
            axes.plot([j - 0.5, j + 0.5], [i - 0.5, i + 0.5], color=COLOURS[1], lw=1.2)
    axes.set_xticks(range(len(x)), list(map(str, x)))
    axes.set_yticks(range(len(y)), list(map(str, y)))
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    return drawn


def _contours(axes: Axes, x: Any, y: Any, values: Any, margins: bool) -> None:
    """Contour lines, smooth where a fine grid ripples, and a mark at the worst value with its number."""
    finite = np.isfinite(values)
    if min(values.shape) > 2 and finite.all() and float(np.ptp(values)) > 0.0:
        i, j = (-(-size // FINEST_CONTOUR) for size in values.shape)
        smooth = ndimage.uniform_filter(values, (i, j))[::i, ::j]
        levels: Any = [0.0] if margins else 6
        lines = axes.contour(x[::j], y[::i], smooth, levels=levels, colors="white", linewidths=0.9)
        around: list[Any] = [patheffects.withStroke(linewidth=2.0, foreground="#333333")]
        for artist in (lines, *axes.clabel(lines, fontsize=8, fmt="%.3g")):
            artist.set_path_effects(around)
    if finite.any():
        worst = int(np.nanargmin(values) if margins else np.nanargmax(values))
        i, j = np.unravel_index(worst, values.shape)
        right, high = j > len(x) / 2, i > len(y) / 2
        axes.plot([x[j]], [y[i]], "X", ms=8, color=COLOURS[1], mec="white", clip_on=False)
        axes.annotate(
            f"{values[i, j]:.3g}", (x[j], y[i]), xytext=(-7 if right else 7, -4), color="white", fontsize=8.5,
            textcoords="offset points", ha="right" if right else "left", va="top" if high else "bottom",
            bbox={"fc": "#333333", "ec": "none", "pad": 1.5}, zorder=6,
        )  # fmt: skip


def fit_axis(axes: Axes, name: str, values: Any) -> None:
    """The axis "x" or "y" logarithmic where values rise by a constant factor, over half a decade or more."""
    if len(values) > 2 and values[0] > 0.0 and values[-1] >= 3.0 * values[0]:
        steps = np.diff(np.log(values))
        if np.ptp(steps) < 1e-6 * steps.mean():
            getattr(axes, f"set_{name}scale")("log")
            decade_ticks(getattr(axes, f"{name}axis"))


def decade_ticks(axis: Any) -> None:
    """Numbers as they are, at 1, 2 and 5 of each decade."""
    plain_ticks(axis, ticker.LogLocator(subs=(1.0, 2.0, 5.0)))


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
