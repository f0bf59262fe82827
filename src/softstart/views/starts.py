"""What is shown of a start and of a comparison of starts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from softstart.start.run import Run
from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure, shade_open_gap

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
