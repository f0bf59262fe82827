"""How all figures look, and how they are saved. Figures take finished results and compute no claims."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart.input.files import write_whole
from softstart.late import late

if TYPE_CHECKING:
    import matplotlib as mpl
    import matplotlib.figure as mpl_figure
    from matplotlib.axes import Axes

    from softstart.start.run import Run
else:
    mpl, mpl_figure = late("matplotlib"), late("matplotlib.figure")

# Okabe-Ito: told apart by colour-blind readers and in grey
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (3, 1)), (0, (1, 1)), (0, (8, 2)))
GREY, SMALL = "#666666", 9.5
GAP_SHADE = "#E8ECEF"

PICTURE_ENDINGS = ("svg", "png")  # of each figure that is saved

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
    with mpl.rc_context(settings):
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


def shade_open_gap(axes: Axes, run: Run) -> None:
    """Grey where the gap is open."""
    for stage in run.stages:
        if stage.side == 0 and stage.duration > 0.0:
            axes.axvspan(stage.start, stage.end, color=GAP_SHADE, lw=0, zorder=0)
