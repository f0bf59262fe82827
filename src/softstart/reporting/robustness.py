"""K_dyn over gap and load inertia, each strategy as it was set up for the nominal drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from softstart.arrays import Matrix
from softstart.chain.machines import varied
from softstart.controller import Controller
from softstart.drive import Drive
from softstart.late import late
from softstart.quantities import Units
from softstart.reporting.markup import Figures, Html, html, inlined, joined, printed, tag
from softstart.reporting.strategies import K_DYN, SMALL, WIDE, name_in_figure
from softstart.start.batch import prepared
from softstart.start.fatigue import Fatigue
from softstart.views import fatigue as lives
from softstart.views.drawing import drawing, new_figure, plain_ticks
from softstart.views.printed import digits, fixed, short, units_of

if TYPE_CHECKING:
    from matplotlib import colors, patches, ticker
    from matplotlib.axes import Axes
else:
    colors, patches, ticker = (late(f"matplotlib.{name}") for name in ("colors", "patches", "ticker"))

GAPS = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)  # of the drive's own
INERTIAS = (0.4, 0.6, 0.8, 1.0, 1.25)


@dataclass(frozen=True, eq=False)
class RobustnessMap:
    """K_dyn and start time (s) of one strategy: a row a gap (rad), a column a load inertia (kg m2).

    K_dyn refers to the mean torque of the nominal drive, so that it compares shaft torques. NaN where the
    start was not finished or the load did not reach its target speed.
    """

    gaps: tuple[float, ...]
    inertias: tuple[float, ...]
    k_dyn: Matrix
    start_time: Matrix

    @property
    def failed(self) -> int:
        """In how many cells there is no start."""
        return int(np.isnan(self.k_dyn).sum())

    @property
    def worst(self) -> float:
        """The largest K_dyn; NaN if a cell has none."""
        return float(np.max(self.k_dyn))

    @property
    def worst_at(self) -> tuple[float, float]:
        """Gap (rad) and load inertia (kg m2) of the worst cell."""
        row, column = np.unravel_index(
            int(np.argmax(np.nan_to_num(self.k_dyn, nan=math.inf))), self.k_dyn.shape
        )
        return self.gaps[row], self.inertias[column]

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "gaps": list(self.gaps),
            "load_inertias": list(self.inertias),
            "k_dyn": self.k_dyn.tolist(),
            "start_time": self.start_time.tolist(),
            "worst_k_dyn": self.worst,
        }


class Mapped(Protocol):
    """A strategy with its map."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def map(self) -> RobustnessMap:
        """Its map."""


def axes_of(drive: Drive) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Gaps (rad) and load inertias (kg m2) of the map; a drive without a gap has one row.

    >>> axes_of(Drive.load("crane-4amtkf"))[0]
    (0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
    """
    gap, inertia = float(drive.gap), float(drive.J2)
    gaps = tuple(float(f"{share * gap:.12g}") for share in GAPS) if gap > 0.0 else (0.0,)
    return gaps, tuple(float(f"{share * inertia:.12g}") for share in INERTIAS)


def robustness(drive: Drive, controller: Controller) -> RobustnessMap:
    """The map of a controller that was set up for `drive`."""
    gaps, inertias = axes_of(drive)
    shape = len(gaps), len(inertias)
    many = varied(drive, {"gap": np.array(gaps)[:, None], "load_inertia": np.array(inertias)[None, :]})
    found = prepared(many).figures(controller.set_ups(drive), drive.mean_torque)
    time = np.asarray(found["start_time"][0], dtype=np.float64).reshape(shape)
    k = np.asarray(found["k_dyn"][0], dtype=np.float64).reshape(shape)
    return RobustnessMap(gaps, inertias, np.where(np.isnan(time), np.nan, k), time)


def robustness_section(drive: Drive, shown: Sequence[Mapped], figures: Figures) -> Html:
    """The maps of strategies, in one scale of colours."""
    first, units = shown[0].map, units_of(drive)
    least, most = (digits(units.shown(gap, "rad"), 3) for gap in (first.gaps[0], first.gaps[-1]))
    gaps = f"gaps from {least} to {most} {units.angle}"
    if drive.gap == 0.0:
        gaps = "no gap (the drive has none, so the maps have one row and say nothing about play)"
    text = (
        "Gears wear and loads change. Each strategy was set up once, for the drive as it is, and then "
        f"started at {gaps} and load inertias from {short(first.inertias[0])} to "
        f"{short(first.inertias[-1])} kg m². K_dyn refers to the drive as it is everywhere, so the "
        "numbers compare shaft torques."
    )
    caption = (
        "K_dyn over gap and load inertia, all maps in one scale of colours, dark is gentle. "
        "Framed: the drive as it is. Grey: the load does not reach its target speed."
    )
    return html(tag("p", text), figures.shown("maps", lambda: maps_picture(drive, shown), caption))


def maps_picture(drive: Drive, shown: Sequence[Mapped]) -> Html:
    """The maps as an <svg> element."""
    first, units = shown[0].map, units_of(drive)
    nominal = (
        min(first.gaps, key=lambda v: abs(v - float(drive.gap))),
        min(first.inertias, key=lambda v: abs(v - float(drive.J2))),
    )
    worst = "; ".join(
        (
            f"{one.name}, worst {fixed(one.map.worst, 3)} at gap "
            f"{digits(units.shown(one.map.worst_at[0], 'rad'), 3)} {units.angle} and J2 "
            f"{short(one.map.worst_at[1])} kg m²"
        )
        for one in shown
    )
    title = f"K_dyn over gap and load inertia: {worst}"
    return inlined(maps_figure([(one.name, one.map) for one in shown], nominal, units), "maps", title)


def life_chapter(found: Fatigue | str | None) -> list[tuple[str, str, Html]]:
    """Key, title and content of the chapter on the life of the shaft line; none where it is not asked for."""
    if found is None:
        return []
    if isinstance(found, str):
        content = tag("p", f"Lives cannot be given. {found}")
    else:
        shown = lives.fatigue_table(found, sorted(found.rows, key=lambda row: -row.relative))
        content = html(
            tag("p", lives.conclusion(found)),
            printed(shown, caption="Life of the shaft line under each strategy"),
            tag("ul", joined(tag("li", one) for one in lives.notes(found)), class_="notes"),
        )
    return [("life", "How long the shaft line lasts", content)]


def maps_figure(
    shown: Sequence[tuple[str, RobustnessMap]], nominal: tuple[float, float], units: Units
) -> Any:
    """K_dyn over gap and load inertia, one map a strategy, all in one scale of colours."""
    first = shown[0][1]
    rows, columns = len(first.gaps), len(first.inertias)
    finite = np.concatenate([one.k_dyn[np.isfinite(one.k_dyn)] for _, one in shown])
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (1.0, 2.0)
    high = max(high, low * 1.02)
    scale = colors.LogNorm(low, high) if high > 3.0 * low else colors.Normalize(low, high)
    down = math.ceil(len(shown) / 2)
    gaps = [units.shown(one, "rad") for one in first.gaps]
    inertia, gap = _thousand(first.inertias), _thousand(gaps)
    with drawing():
        size = (WIDE, 0.35 + down * (0.66 + 0.22 * max(rows, 2)))
        figure, axes = new_figure(down, 2, size, squeeze=False)
        drawn: Any = None
        for panel, (name, one) in zip(axes.flat, shown, strict=False):
            panel.grid(visible=False)
            panel.set_facecolor("#D0D0D0")
            edges = np.arange(columns + 1) - 0.5, np.arange(rows + 1) - 0.5
            cells = np.ma.masked_invalid(one.k_dyn)
            drawn = panel.pcolormesh(
                *edges, cells, cmap="cividis", norm=scale, edgecolors="face", linewidth=0.3
            )
            for (i, j), value in np.ndenumerate(one.k_dyn):
                dark = math.isnan(value) or float(scale(value)) > 0.55
                text = f"{value:.2f}" if math.isfinite(value) else "none"
                panel.text(j, i, text, ha="center", va="center", fontsize=SMALL - 1.0,
                           color="black" if dark else "white")  # fmt: skip
            _frame(panel, first.gaps.index(nominal[0]), first.inertias.index(nominal[1]))
            panel.set_title(f"{name_in_figure(name)}: {_worst(one)}", loc="left", fontsize=SMALL + 0.5)
            panel.set_xticks(
                range(columns), [f"{v / inertia:.3g}" for v in first.inertias], fontsize=SMALL - 0.5
            )
            panel.set_yticks(range(rows), [f"{v / gap:.4g}" for v in gaps], fontsize=SMALL - 0.5)
            panel.tick_params(length=0)
        for panel in axes.flat[len(shown) :]:
            panel.set_axis_off()
        for panel in axes[:, 0]:
            panel.set_ylabel(f"gap, {_powers(gap)}{units.angle}", fontsize=SMALL)
        for panel in axes.flat[max(0, len(shown) - 2) : len(shown)]:
            panel.set_xlabel(f"load inertia J2, {_powers(inertia)}kg m²", fontsize=SMALL)
        bar = figure.colorbar(drawn, ax=axes, shrink=0.9, aspect=28)
        bar.set_label(K_DYN, fontsize=SMALL)
        bar.solids.set_rasterized(False)  # a picture of pixels would have to be loaded
        bar.solids.set_edgecolor("face")
        _plain_ticks(bar, low, high)
    return figure


def _thousand(values: Sequence[float]) -> float:
    """The power of a thousand in whose multiples small or large numbers are short, 1 for usual ones."""
    if max(values) == 0.0 or (values[0] >= 1e-2 and max(values) < 1e4):
        return 1.0
    return 1e3 ** math.floor(math.log10(max(values)) / 3.0)


def _powers(unit: float) -> str:
    """Such a power, to stand before a unit."""
    return "" if unit == 1.0 else f"$10^{{{round(math.log10(unit))}}}$ "


def _worst(one: RobustnessMap) -> str:
    return f"worst {one.worst:.3f}" if math.isfinite(one.worst) else "grey: no start"


def _plain_ticks(bar: Any, low: float, high: float) -> None:
    ticks = [float(f"{v:.2g}") for v in np.geomspace(low, high, 6)]
    plain_ticks(bar.ax.yaxis, ticker.FixedLocator([v for v in ticks if low <= v <= high]))
    bar.ax.tick_params(labelsize=SMALL - 0.5)


def _frame(axes: Axes, row: int, column: int) -> None:
    """A frame around the drive as it is."""
    for colour, width in (("white", 3.4), ("#D55E00", 1.8)):
        axes.add_patch(
            patches.Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, fc="none", ec=colour, lw=width, zorder=5)
        )
