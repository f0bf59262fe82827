"""Figures of sweeps: a figure of the starts along one axis, or over two as a map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.drive import PARAMETERS
from softstart.sweeping.summary import plan_of
from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

MOST_PANELS = 6
MOST_LINES = 8
MOST_CELLS = 4_000_000  # of a map
COLOUR_MAP = "cividis"  # for colour-blind readers, and even in grey
WIDE = 10.0  # largest over smallest value from which on colours are logarithmic
MISSING = "#D0D0D0"
FINEST_CONTOUR = 50  # points along each side


def sweep_figure(results: xarray.Dataset, name: str = "k_dyn") -> Any:
    """A figure of the starts over the grid, or None where nothing can be drawn.

    Two long axes of numbers make a map; further axes make panels, or, if these were too many, the map shows
    the largest value over them. One axis of numbers makes curves.
    """
    field = results[name]
    long = [str(dim) for dim in field.dims if field.sizes[dim] > 1]
    numeric = [dim for dim in long if dim in results.coords and results[dim].dtype.kind in "fiu"]
    across = sorted(sorted(numeric, key=lambda dim: -field.sizes[dim])[:2], key=long.index)
    rest = [dim for dim in long if dim not in across]
    if not across or math.prod(field.sizes[dim] for dim in across) > MOST_CELLS:
        return None
    combinations = math.prod(field.sizes[dim] for dim in rest)
    if len(across) == 1:
        if combinations > MOST_LINES:
            return _curves(
                results, name, across[0], [("largest over the rest", _largest(results, name, across))]
            )
        return _curves(results, name, across[0], _each(results, name, across, rest))
    if combinations > MOST_PANELS:
        others = ", ".join(_shown(dim) for dim in rest)
        return _maps(results, name, across, [(f"largest over {others}", _largest(results, name, across))])
    return _maps(results, name, across, _each(results, name, across, rest))


Part = tuple[str, Any]  # title, and the values along the axes drawn


def _each(results: xarray.Dataset, name: str, across: list[str], rest: list[str]) -> list[Part]:
    """A part for every combination of the other axes."""
    parts = []
    for index in np.ndindex(*(results.sizes[dim] for dim in rest)):
        one = results[name].isel(dict(zip(rest, index, strict=True)))
        values = [(dim, results[dim].values[i]) for dim, i in zip(rest, index, strict=True)]
        labels = [
            str(value) if dim == "controller" else f"{_shown(dim)} {_text(value)}" for dim, value in values
        ]
        parts.append((", ".join(labels), one.squeeze().transpose(*across).values))
    return parts


def _largest(results: xarray.Dataset, name: str, across: list[str]) -> Any:
    """The largest value over all axes that are not drawn, read piece by piece."""
    field, plan = results[name], plan_of(results)
    kept = [list(field.dims).index(dim) for dim in across]
    away = tuple(i for i in range(field.ndim) if i not in kept)
    found = np.full([plan.shape[i] for i in kept], np.nan)
    for number in range(plan.chunks):
        place = plan.place(number)
        part = tuple(place[i] for i in kept)
        values = field[place].values
        found[part] = np.fmax(found[part], np.fmax.reduce(values, axis=away) if away else values)
    return found


def _maps(results: xarray.Dataset, name: str, across: list[str], parts: list[Part]) -> Any:
    from matplotlib.colors import LogNorm, Normalize

    high, wide = across
    orders = [np.argsort(results[dim].values) for dim in across]
    y, x = (results[dim].values[order] for dim, order in zip(across, orders, strict=True))
    finite = np.concatenate([values[np.isfinite(values)] for _, values in parts])
    if not finite.size:
        return None
    low, top = float(finite.min()), float(finite.max())
    logarithmic = low > 0.0 and top > WIDE * low
    scale = LogNorm(low, top) if logarithmic else Normalize(low, top if top > low else low + 1.0)
    columns = 2 if len(parts) == 4 else min(len(parts), 3)
    rows = -(-len(parts) // columns)
    with drawing():
        size = (2.2 + 3.6 * columns, 0.9 + 3.1 * rows) if len(parts) > 1 else (7.6, 5.2)
        figure, axes = new_figure(rows, columns, size, sharex=True, sharey=True, squeeze=False)
        for panel in axes.flat[len(parts) :]:
            panel.set_visible(False)
        for panel, (title, values) in zip(axes.flat, parts, strict=False):
            drawn = _map(panel, x, y, values[np.ix_(*orders)], scale)
            panel.set_title(title, loc="left", fontsize=9.5)
            for axis, values_of, set_scale in (("x", x, panel.set_xscale), ("y", y, panel.set_yscale)):
                if _geometric(values_of):
                    set_scale("log")
                    _plain_ticks(getattr(panel, f"{axis}axis"))
        for panel in axes.flat[max(0, len(parts) - columns) : len(parts)]:  # the lowest of each column
            panel.tick_params(labelbottom=True)
            panel.set_xlabel(_label(results, wide))
        for panel in axes[:, 0]:
            panel.set_ylabel(_label(results, high))
        bar = figure.colorbar(drawn, ax=axes, label=_label(results, name))
        if logarithmic:
            _plain_ticks(bar.ax.yaxis)
        note = "   (grey: no figure)" if any(np.isnan(values).any() for _, values in parts) else ""
        figure.suptitle(f"{_title(results)}: {_label(results, name)}{note}", x=0.01, ha="left", fontsize=11)
    return figure


def _map(panel: Axes, x: Any, y: Any, values: Any, scale: Any) -> Any:
    panel.set_facecolor(MISSING)
    panel.grid(visible=False)
    drawn = panel.pcolormesh(x, y, values, norm=scale, cmap=COLOUR_MAP, shading="nearest", rasterized=True)
    if min(values.shape) > 2 and np.isfinite(values).all() and float(np.ptp(values)) > 0.0:
        from matplotlib.patheffects import withStroke

        around: list[Any] = [withStroke(linewidth=2.0, foreground="#333333")]
        lines = panel.contour(*_coarse(x, y, values), levels=6, colors="white", linewidths=0.9)
        for text in panel.clabel(lines, fontsize=8, fmt="%.3g"):
            text.set_path_effects(around)
        lines.set_path_effects(around)
    if np.isfinite(values).any():
        i, j = np.unravel_index(int(np.nanargmax(values)), values.shape)
        panel.plot([x[j]], [y[i]], "X", ms=8, color=COLOURS[1], mec="white", clip_on=False)
        panel.annotate(
            f"{values[i, j]:.3g}", (x[j], y[i]), xytext=(-7 if j > len(x) / 2 else 7, -4), color="white",
            textcoords="offset points", ha="right" if j > len(x) / 2 else "left",
            va="top" if i > len(y) / 2 else "bottom", fontsize=8.5,
            bbox={"fc": "#333333", "ec": "none", "pad": 1.5}, zorder=6,
        )  # fmt: skip
    return drawn


def _coarse(x: Any, y: Any, values: Any) -> tuple[Any, Any, Any]:
    """Means over small blocks: contour lines of a fine grid are smooth where their values ripple."""
    for axis in (0, 1):
        step = -(-values.shape[axis] // FINEST_CONTOUR)
        whole = values.shape[axis] // step * step
        values = np.moveaxis(values, axis, 0)[:whole]
        values = np.moveaxis(values.reshape(-1, step, values.shape[1]).mean(axis=1), 0, axis)
        if axis == 0:
            y = y[:whole].reshape(-1, step).mean(axis=1)
        else:
            x = x[:whole].reshape(-1, step).mean(axis=1)
    return x, y, values


def _curves(results: xarray.Dataset, name: str, along: str, parts: list[Part]) -> Any:
    order = np.argsort(results[along].values)
    x = results[along].values[order]
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.8))
        for index, (label, values) in enumerate(parts):
            axes.plot(x, values[order], color=COLOURS[index % 8], ls=DASHES[index % 8], label=label or None,
                      marker="o" if len(x) < 30 else None, ms=3.5)  # fmt: skip
        if _geometric(x):
            axes.set_xscale("log")
            _plain_ticks(axes.xaxis)
        if name == "k_dyn":
            axes.axhline(1.0, color="#666666", lw=0.8, ls=":")
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel(_label(results, along))
        axes.set_ylabel(_label(results, name))
        axes.set_title(_title(results), loc="left")
        if any(label for label, _ in parts):
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _geometric(values: Any) -> bool:
    """Whether values in order rise by a constant factor, over at least half a decade."""
    if len(values) < 3 or values[0] <= 0.0 or values[-1] < 3.0 * values[0]:
        return False
    steps = np.diff(np.log(values))
    return bool(np.ptp(steps) < 1e-6 * steps.mean())


def _plain_ticks(axis: Any) -> None:
    """Numbers as they are, at 1, 2 and 5 of each decade."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def _title(results: xarray.Dataset) -> str:
    return str(results.attrs.get("title", "sweep"))


def _shown(name: str) -> str:
    return name.removeprefix("controller_").replace("_", " ")


def _label(results: xarray.Dataset, name: str) -> str:
    """What an axis of the picture is called: symbol or words, and the unit."""
    if name == "k_dyn":
        return "K_dyn"
    unit = str(results[name].attrs.get("units", ""))
    symbol = PARAMETERS[name].symbol if name in PARAMETERS else ""
    words = f"{_shown(name)} {symbol}" if symbol and symbol != name else _shown(name)
    return f"{words}, {unit.replace('*', ' ').replace('^', '')}" if unit not in ("", "1") else words


def _text(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"
