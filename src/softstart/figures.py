"""All figures. They take finished results and draw; they compute nothing that is a claim."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart.export import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softstart.start.run import Run

# Okabe-Ito: told apart by colour-blind readers and in grey
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)), (0, (3, 1)), (0, (1, 1)), (0, (8, 2)))
GAP_SHADE = "#E8ECEF"

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
    import matplotlib as mpl

    settings: Any = STYLE
    with mpl.rc_context(settings):
        yield


def new_figure(
    rows: int = 1, columns: int = 1, size: tuple[float, float] | None = None, **options: Any
) -> Any:
    """A Figure outside pyplot (nothing to close, no window) and its axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size)
    return figure, figure.subplots(rows, columns, **options)


def save_figure(figure: Figure, folder: Path, stem: str) -> list[Path]:
    """Write stem.svg and stem.png into the folder, each whole or not at all."""
    written = []
    for ending, options in (("svg", {"metadata": {"Date": None}}), ("png", {"dpi": 160})):
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


def run_figure(run: Run) -> Any:
    """Torques, speeds and the place in the gap over time; grey where the gap is open."""
    with drawing():
        figure, (torque, speed, twist) = new_figure(3, 1, (8.0, 7.5), sharex=True)
        for axes in (torque, speed, twist):
            shade_open_gap(axes, run)
        _torques(torque, run)
        _speeds(speed, run)
        half = 0.5 * float(run.drive.gap)
        twist.plot(run.t, run.theta, color=COLOURS[2])
        for flank in (half, -half):
            twist.axhline(flank, color="#444444", lw=0.8, ls="--")
        twist.set_title("twist phi1 - phi2, flanks dashed", loc="left", fontsize=9.5)
        twist.set_ylabel("rad")
        twist.set_xlabel("time, s     (grey: gap open)")
        twist.set_xlim(0.0, run.end_time)
        name = run.controller.name or type(run.controller).__name__
        figure.suptitle(f"{run.drive.name}: {name}", x=0.01, ha="left", fontsize=11)
    return figure


def _torques(axes: Axes, run: Run) -> None:
    axes.plot(run.t, run.u, color=COLOURS[1], ls=DASHES[1], label="motor torque u")
    axes.plot(run.t, run.T, color=COLOURS[0], label="shaft torque T")
    if run.k_dyn > 0.0:
        axes.axhline(run.peak_torque / run.k_dyn, color="#666666", lw=0.8, ls=":", label="K_dyn = 1")
        axes.plot([run.peak_time], [_signed_peak(run)], "o", ms=4, color=COLOURS[0])
    axes.set_title(f"K_dyn = {run.k_dyn:.3f}", loc="left", fontsize=9.5)
    axes.set_ylabel("torque, N m")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.1)


def _speeds(axes: Axes, run: Run) -> None:
    axes.plot(run.t, run.w1, color=COLOURS[1], ls=DASHES[1], label="motor w1")
    axes.plot(run.t, run.w2, color=COLOURS[0], label="load w2")
    axes.axhline(float(run.drive.target_speed), color="#666666", lw=0.8, ls=":", label="target")
    reached = run.start_time == run.start_time
    if reached:
        axes.axvline(run.start_time, color="#666666", lw=0.8, ls=":")
    axes.set_title(
        f"start time {run.start_time:.4f} s" if reached else run.status.value, loc="left", fontsize=9.5
    )
    axes.set_ylabel("speed, rad/s")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.1)


def _signed_peak(run: Run) -> float:
    stage = max(run.stages, key=lambda one: abs(one.peak_torque))
    return stage.peak_torque


def comparison_figure(runs: Sequence[Run], title: str) -> Any:
    """Shaft torque (above) and motor torque (below) of several starts, one row of panels each."""
    with drawing():
        figure, axes = new_figure(
            len(runs), 1, (8.0, 1.0 + 1.35 * len(runs)), sharex=True, sharey=True, squeeze=False
        )
        longest = max(run.end_time for run in runs)
        for index, (panel, run) in enumerate(zip(axes[:, 0], runs, strict=True)):
            shade_open_gap(panel, run)
            panel.plot(run.t, run.u, color=COLOURS[1], ls=DASHES[1], lw=1.1, label="motor torque u")
            panel.plot(run.t, run.T, color=COLOURS[0], label="shaft torque T")
            name = run.controller.name or type(run.controller).__name__
            panel.set_title(
                f"{name}:  K_dyn {run.k_dyn:.3f},  start {run.start_time:.4f} s",
                loc="left",
                fontsize=9.5,
                pad=3,
            )
            panel.set_ylabel("N m")
            if index == 0:
                panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
        axes[-1, 0].set_xlabel("time, s     (grey: gap open)")
        axes[-1, 0].set_xlim(0.0, longest)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def trade_off_figure(points: Sequence[tuple[str, float, float]], title: str) -> Any:
    """K_dyn against start time, one point a strategy: (name, start time in s, K_dyn)."""
    markers = "osD^vPX*"
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.6))
        for index, (name, time, k) in enumerate(points):
            axes.plot(
                [time],
                [k],
                markers[index % 8],
                ms=9,
                mfc="none",
                mew=2.0,
                color=COLOURS[index % 8],
                label=name,
                clip_on=False,
            )
        axes.axhline(1.0, color="#666666", lw=0.8, ls=":")
        axes.set_xlabel("start time, s")
        axes.set_ylabel("K_dyn")
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.08)
        axes.set_title(title, loc="left")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
