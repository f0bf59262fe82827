"""How all figures look, and how they are saved. Figures take finished results and compute no claims."""

from __future__ import annotations

import html
import io
import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.input.files import write_whole
from softstart.views.numbers import cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.collections import QuadMesh
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.ticker import Locator

    from softstart.start.run import Run

# Okabe-Ito: told apart by colour-blind readers and in grey
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
# of strategies, on light and on dark paper: told apart by colour-blind readers, and none is near the red of a
# limit or the black of the motor torque (tests/softstart/page/test_palette.py)
STRATEGIES = (
    ("#359798", "#6ac2c1"), ("#b18e25", "#e3970d"), ("#2400e9", "#3753fe"), ("#715646", "#317154"),
    ("#5a7600", "#b3d26f"), ("#860e6d", "#7a8d3b"), ("#a441b0", "#eea8ff"), ("#1d4e00", "#84fe41"),
    ("#ff42bd", "#c00093"), ("#9164ff", "#967ffe"), ("#581130", "#b37fa9"), ("#5e00a9", "#844fc3"),
    ("#30015f", "#965215"),
)  # fmt: skip
SHAFTS = tuple(COLOURS[k] for k in (0, 2, 4, 3, 5, 7))  # of a chain; the motor has another one
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (3, 1)), (0, (1, 1)), (0, (8, 2)))
GREY, SMALL = "#666666", 9.5
MOTOR: dict[str, Any] = {"color": "#000000", "ls": DASHES[1]}  # what the motor does, as on the page
LIMIT = "#C02822"  # red: what is permitted, as on the page
GAP_SHADE = "#E8ECEF"
MARKERS = "osD^vPX*<>hd"
COLOUR_MAP, MISSING = "cividis", "#D0D0D0"  # even in lightness, for colour-blind and grey readers alike
LIGHT = 0.55  # share of the colours from which on numbers are dark
FINEST_CONTOUR = 50  # points along each side

PICTURE_ENDINGS = ("svg", "png")  # of each figure that is saved

LONGEST_NAME = 32  # characters in a figure
LETTERS = 11.0  # of a title, in an inch
NARROW, FLATTER = 4.4, 0.7  # inches, and share of the height, of a figure in a column of a page

# what a page does not need: ids that nothing refers to would be in it twice, a <style> would hold for all
UNUSED = (
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->"
    r'| id="[A-Za-z0-9.]+_\d+"'
)
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
    """Softstart's look, without touching the caller's settings or needing a screen.

    Of these only the fonts count: a matplotlibrc may ask for LaTeX, or for a figure of any size.
    """
    import matplotlib as mpl

    settings: Any = mpl.rcParams
    fonts = {name: settings[name] for name in ("font.family", "font.sans-serif")}
    with mpl.rc_context(), warnings.catch_warnings():
        mpl.rcdefaults()
        settings.update(STYLE | fonts)
        # a drive may be named in any script: what the font lacks is drawn as a box
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        yield


def new_figure(
    rows: int = 1, columns: int = 1, size: tuple[float, float] | None = None, **options: Any
) -> tuple[Figure, Any]:
    """A Figure outside pyplot (nothing to close, no window) and its axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size)
    return figure, figure.subplots(rows, columns, **options)


def save_figure(figure: Figure, folder: Path, stem: str) -> list[Path]:
    """Write stem.svg and stem.png into the folder, each whole or not at all."""
    written = []
    for ending, options in zip(PICTURE_ENDINGS, ({"metadata": {"Date": None}}, {"dpi": 160}), strict=True):
        path = folder / f"{stem}.{ending}"
        with drawing():
            write_whole(path, lambda f, e=ending, o=options: figure.savefig(f, format=e, **o), binary=True)  # type: ignore[misc]
        written.append(path)
    return written


def svg_of(figure: Figure, key: str = "softstart", title: str = "") -> str:
    """The figure as an <svg> element; the same one gives the same text. Screen readers read `title`."""
    import matplotlib as mpl

    stream = io.StringIO()
    with drawing(), mpl.rc_context({"svg.hashsalt": key}):
        metadata = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        figure.savefig(stream, format="svg", metadata=metadata, bbox_inches="tight")
    text = re.sub(UNUSED, "", stream.getvalue(), flags=re.DOTALL).strip()
    label = f' role="img" aria-label="{html.escape(title)}"' if title else ""
    return text.replace("<svg ", f'<svg class="plot"{label} ', 1)


def narrowed(figure: Figure) -> Figure:
    """The figure for a column of a page, where text of the full width is too small to read.

    It is narrower with text of the same size, and legends have rows of their own. One whose panels are side
    by side has no room there and stays as it is.
    """
    specs = [spec for axes in figure.axes if (spec := axes.get_subplotspec()) is not None]
    legends = [(axes, legend) for axes in figure.axes if (legend := axes.get_legend()) is not None]
    beside = [axes for axes, legend in legends if _anchor(axes, legend)[0] >= 1.0 > _anchor(axes, legend)[1]]
    alone = len({spec.colspan.start for spec in specs}) == 1 and not (beside and len(specs) > 1)
    if not alone or figure.get_figwidth() <= NARROW:
        return figure
    figure.set_size_inches(NARROW, FLATTER * figure.get_figheight())
    if title := figure.get_suptitle():
        entitle(figure, " ".join(title.split()))
    letters = int(NARROW * LETTERS) - 4  # beside the scale
    for axes in figure.axes:
        axes.set_title(fill(axes.get_title("left"), letters), loc="left", fontsize=SMALL)
        axes.set_xlabel(fill(axes.get_xlabel(), letters))
    with drawing():
        for axes, legend in legends:
            labels = [text.get_text() for text in legend.get_texts()]
            handles = [one for one in legend.legend_handles if one is not None]
            if axes in beside:
                legend.remove()
                figure.legend(
                    handles=handles, labels=labels, loc="outside lower center", ncols=2, fontsize=8.5
                )
                figure.set_figheight(figure.get_figheight() + 0.2 * len(labels) / 2)
            elif _anchor(axes, legend)[1] >= 1.0:
                columns = min(len(labels), 3)
                legend_above(axes, columns, columnspacing=1.0, handlelength=1.5, fontsize=8.5)
                title = axes.get_title("left")
                axes.set_title(title, loc="left", fontsize=SMALL, pad=6 + 14 * -(-len(labels) // columns))
    return figure


def _anchor(axes: Axes, legend: Legend) -> tuple[float, float]:
    """Where a legend hangs, in shares of its panel: right of it, or above."""
    x, y = axes.transAxes.inverted().transform(legend.get_bbox_to_anchor().min)
    return round(float(x), 6), round(float(y), 6)


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


def legend_above(axes: Axes, columns: int, **options: float) -> None:
    """A legend of one row at the right, beside the title of a panel."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.1, **options)


def legend_beside(axes: Axes, columns: int = 1, **options: float) -> None:
    """A legend at the right of a panel, for names that have no room elsewhere."""
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), ncols=columns, **options)


def verbatim(name: str) -> str:
    """A name for a figure: not set as a formula, and cut where it is too long."""
    return cut(name, LONGEST_NAME).replace("$", r"\$")


def strategy_colours(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """The colours of strategies on light and dark paper: of installed ones the same in all figures.

    Others, as tuned gains and optima, follow in their order.

    >>> strategy_colours(["ramp"])["ramp"] == strategy_colours(["direct", "mine", "ramp"])["ramp"]
    True
    """
    from softstart.controller.finding import ready_controller_names  # a start takes longer to import

    order = dict.fromkeys([*ready_controller_names(), *names])
    places = {name: STRATEGIES[place % len(STRATEGIES)] for place, name in enumerate(order)}
    return {name: places[name] for name in names}


def mark_points(
    axes: Axes,
    points: Sequence[tuple[str, float, float]],
    filled: Sequence[int] = (),
    notes: Mapping[str, str] | None = None,
) -> None:
    """A mark for each strategy (name, x, y), named in the legend beside the panel; some are filled.

    `notes` are added to names there.
    """
    colours = strategy_colours([name for name, _, _ in points])
    for index, (name, x, y) in enumerate(points):
        colour, marker = colours[name][0], MARKERS[index % len(MARKERS)]
        label = verbatim(name + (notes or {}).get(name, ""))
        axes.plot([x], [y], marker, ms=8, mfc=colour if index in filled else "none", mew=1.8, color=colour,
                  label=label, clip_on=False, ls="none", zorder=4)  # fmt: skip
    legend_beside(axes, fontsize=8.5)


def line_of(index: int, dashed: bool = False) -> dict[str, Any]:
    """Colour and dashes of one of many lines: dashes from the ninth line on, or of each line other ones."""
    rounds = index // len(COLOURS) + (index if dashed else 0)
    return {"color": COLOURS[index % len(COLOURS)], "ls": DASHES[rounds % len(DASHES)]}


def plain_ticks(axis: Axis, locator: Locator) -> None:
    """Numbers as they are, not as powers, on a logarithmic axis."""
    from matplotlib import ticker

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
) -> tuple[Figure, list[Axes]]:
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


def colour_scale(*values: Matrix) -> Normalize:
    """Colours from the least to the largest of all finite values, logarithmic beyond a factor of 10."""
    from matplotlib import colors

    finite = np.concatenate([one[np.isfinite(one)] for one in values])
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if high - low <= 1e-9 * abs(low):
        return colors.Normalize(low - 0.5, high + 0.5)
    return colors.LogNorm(low, high) if high > 10.0 * low > 0.0 else colors.Normalize(low, high)


def heat_map(
    axes: Axes, x: Vector | Sequence[str], y: Vector | Sequence[str], values: Matrix, scale: Normalize, *,
    decimals: int | None = None, struck: NDArray[np.bool_] | None = None, margins: bool = False,
) -> QuadMesh:  # fmt: skip
    """Values in colours over x and y, the first row below; missing ones are grey.

    With `decimals` all cells have the same size and hold their number; those that are `struck` are struck
    out. Without, x and y are to scale, with contour lines, and the largest value is marked; of `margins` the
    line of 0 and the least one.
    """
    axes.grid(visible=False)
    axes.set_facecolor(MISSING)
    if decimals is None:
        across, up = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        colours = axes.pcolormesh(
            across, up, values, norm=scale, cmap=COLOUR_MAP, shading="nearest", rasterized=True
        )
        fit_axis(axes, "x", across)
        fit_axis(axes, "y", up)
        _contours(axes, across, up, values, margins)
        return colours
    edges = [np.arange(len(one) + 1) - 0.5 for one in (x, y)]
    colours = axes.pcolormesh(*edges, values, norm=scale, cmap=COLOUR_MAP, shading="flat")
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
    return colours


def _contours(axes: Axes, x: Vector, y: Vector, values: Matrix, margins: bool) -> None:
    """Contour lines, and a mark at the worst value with its number."""
    finite = np.isfinite(values)
    if min(values.shape) > 2 and finite.all() and float(np.ptp(values)) > 0.0:
        i, j = (-(-size // FINEST_CONTOUR) for size in values.shape)  # a fine grid ripples
        lines = axes.contour(
            x[::j], y[::i], values[::i, ::j], [0.0] if margins else 6, colors="white", linewidths=0.9
        )
        axes.clabel(lines, fontsize=8, fmt="%.3g")
    if finite.any():
        worst = int(np.nanargmin(values) if margins else np.nanargmax(values))
        i, j = np.unravel_index(worst, values.shape)
        axes.plot([x[j]], [y[i]], "X", ms=8, color=COLOURS[1], mec="white", clip_on=False)
        axes.text(
            x[j], y[i], f" {values[i, j]:.3g} ", color="white", fontsize=8.5, zorder=6,
            ha="right" if j > len(x) / 2 else "left", va="top" if i > len(y) / 2 else "bottom",
            bbox={"fc": "#333333", "ec": "none", "pad": 1.5},
        )  # fmt: skip


def fit_axis(axes: Axes, name: str, values: Vector) -> None:
    """The axis "x" or "y" logarithmic where values rise by a constant factor, over half a decade or more."""
    if len(values) > 2 and values[0] > 0.0 and values[-1] >= 3.0 * values[0]:
        steps = np.diff(np.log(values))
        if np.ptp(steps) < 1e-6 * steps.mean():
            getattr(axes, f"set_{name}scale")("log")
            decade_ticks(getattr(axes, f"{name}axis"))


def decade_ticks(axis: Axis) -> None:
    """Numbers as they are, at 1, 2 and 5 of each decade."""
    from matplotlib import ticker

    plain_ticks(axis, ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
