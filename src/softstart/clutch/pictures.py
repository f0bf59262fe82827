"""Figures of engagements and of optimal laws: they draw what was found and compute nothing."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure

if TYPE_CHECKING:
    from softstart.clutch.engagement import Engagement
    from softstart.clutch.front import EngagementFront

GREY = "#666666"
SMALL = 9.5
MARKERS = "osD^vPX*"


def engagement_figure(
    runs: Sequence[Engagement], title: str, labels: Sequence[str] = (), unit: tuple[float, str] = (1.0, "N m")
) -> Any:
    """Friction and shaft torque, speeds and friction power of engagements; `unit` is (size in N m, name)."""
    size, name = unit
    names = labels or [run.law.label for run in runs]
    with drawing():
        figure, (friction, torque, speed) = new_figure(3, 1, (8.5, 8.0), sharex=True)
        for index, (run, label) in enumerate(zip(runs, names, strict=True)):
            look: dict[str, Any] = {"color": COLOURS[index % 8], "ls": DASHES[index % 8]}
            t, traces = run.t, run.at(run.t)
            friction.plot(*_drawn(run, size), **look, label=label)
            torque.plot(t, traces["T"] / size, **look)
            torque.plot([run.peak_time], [run.peak_torque / size], "o", ms=4, color=look["color"])
            speed.plot(t, traces["wM"], **look)
            speed.plot(t, traces["wc"], color=look["color"], ls=":", lw=1.0)
            speed.axvline(run.slip_time, color=look["color"], lw=0.7, ls=":")
        clutch = runs[0].clutch
        torque.axhline(clutch.mean_torque / size, color=GREY, lw=0.8, ls=":")
        speed.axhline(clutch.drive_speed, color=GREY, lw=0.8, ls=":")
        friction.set_ylabel(f"friction torque, {name}")
        torque.set_ylabel(f"shaft torque, {name}")
        torque.set_title("points: peaks; dotted: mean while the clutch slips", loc="left", fontsize=SMALL)
        speed.set_ylabel("speed, rad/s")
        speed.set_title("clutch side; dotted: load, driving side, end of slip", loc="left", fontsize=SMALL)
        speed.set_xlabel("time, s")
        speed.set_xlim(0.0, max(run.end_time for run in runs))
        friction.set_ylim(bottom=0.0)
        friction.legend(loc="lower right", handlelength=3.2)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def _drawn(run: Engagement, size: float) -> tuple[Any, Any]:
    """The law over the run piece by piece, so that a step is upright."""
    edges = [*(one for one in run.law.starts if one < run.end_time), run.end_time]
    spans = [np.linspace(start, end, 41) for start, end in pairwise(edges)]
    values = [
        [piece.torque(t) / size for t in span] for piece, span in zip(run.law.pieces, spans, strict=False)
    ]
    return np.concatenate(spans), np.concatenate(values)


def front_figure(fronts: Sequence[EngagementFront], unit: tuple[float, str] = (1.0, "N m")) -> Any:
    """Friction work over the peak of the shaft torque with the known laws, and some laws of each front."""
    size, name = unit
    work = "J" if size == 1.0 else name
    with drawing():
        figure, panels = new_figure(1, 1 + len(fronts), (4.4 + 3.2 * len(fronts), 4.6))
        front, *laws = np.atleast_1d(panels)
        for index, (one, panel) in enumerate(zip(fronts, laws, strict=True)):
            colour = COLOURS[index]
            peaks = [point.peak_torque / size for point in one.points]
            front.plot(
                peaks,
                [p.slip_work / size for p in one.points],
                "-o",
                ms=3.5,
                color=colour,
                label=one.law_class,
            )
            front.plot(peaks, [p.work_bound / size for p in one.points], color=colour, ls=DASHES[3], lw=2.5)
            for number, which in enumerate(_some(len(one.points))):
                point = one.points[which]
                t = np.append(point.times, 1.15 * point.times[-1])
                M = np.append(point.torques, point.torques[-1]) / size
                panel.plot(t, M, color=COLOURS[number + 2], ls=DASHES[number], lw=1.3,
                           label=f"peak {point.peak_torque / size:.4g} {name}")  # fmt: skip
            panel.set_title(f"laws, {one.law_class}", loc="left", fontsize=SMALL)
            panel.set_xlabel("time, s")
            panel.set_ylabel(f"friction torque, {name}")
            panel.legend(loc="lower right", fontsize=8)
        for index, law in enumerate(fronts[0].laws):
            front.plot(
                [law.run.slip_peak_torque / size], [law.run.slip_work / size], MARKERS[index], ms=7,
                mfc="none", mew=1.6, color=COLOURS[index + 3], label=law.name,
            )  # fmt: skip
        front.axvline(fronts[0].clutch.mean_torque / size, color=GREY, lw=0.8, ls=":")
        front.set_xlabel(f"peak of the shaft torque, {name}     (dotted: none lower)")
        front.set_ylabel(f"friction work, {work}")
        front.set_title("least work; wide dots: bound", loc="left", fontsize=SMALL)
        front.legend(loc="center right", fontsize=8)
        figure.suptitle(fronts[0].clutch.name, x=0.01, ha="left", fontsize=11)
    return figure


def _some(count: int) -> list[int]:
    """Three points of a front: the first, one between, the last."""
    return sorted({0, count // 2, count - 1})
