"""The figures of the study that softstart itself does not draw; they compute nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure
from softstart_studies.optimal_starts.profiles import OptimalStart
from softstart_studies.optimal_starts.sensor import Sensed
from softstart_studies.optimal_starts.smooth import Price
from softstart_studies.optimal_starts.terminals import Endings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

K_DYN = "$K_{dyn}$"
GREY = "#666666"


def profiles_figure(found: Sequence[OptimalStart], base: float, target: float) -> Figure:
    """Torques and speeds of the optimal starts, a column a gap, a colour a start time."""
    gaps = sorted({one.gap for one in found})
    multiples = sorted({one.multiple for one in found})
    with drawing():
        figure, panels = new_figure(3, len(gaps), (9.5, 7.6), sharex=True, sharey="row", squeeze=False)
        for column, gap in enumerate(gaps):
            motor, shaft, speed = panels[:, column]
            shaft.axhline(base, color=GREY, lw=0.9, ls=":")
            refused = []
            for one in found:
                index = multiples.index(one.multiple)
                if one.gap != gap:
                    continue
                if one.run is None:
                    refused.append(f"{one.multiple:g}")
                    continue
                look: dict[str, Any] = {"color": COLOURS[index], "ls": DASHES[index]}
                label = (
                    f"{one.multiple:g} x: {one.point.start_time_bound:.4f} s, {K_DYN} {one.point.k_dyn:.4f}"
                )
                motor.plot(one.run.t, one.run.u, **look, label=label)
                shaft.plot(one.run.t, one.run.T, **look)
                speed.plot(one.run.t, one.run.w2, **look)
                speed.plot(one.run.t, one.run.w1, color=COLOURS[index], lw=0.8, alpha=0.8)
                end = one.point.start_time or 0.0
                speed.plot([end], [float(one.run.at(end)["w2"])], "o", ms=5, color=COLOURS[index])
            title = f"gap {gap:g} rad" + (f"; {', '.join(refused)} x: infeasible" if refused else "")
            motor.set_title(title, loc="left")
            motor.set_ylim(-3.0, 100.0)
            motor.set_yticks([0, 20, 40, 60])
            motor.legend(loc="upper left", handlelength=3.2)
            speed.axhline(target, color=GREY, lw=0.9, ls=":")
            speed.set_xlabel("time, s     (dots: end of the start)")
        panels[0, 0].set_ylabel("motor torque, N m")
        panels[1, 0].set_ylabel(f"shaft torque, N m\n(dotted: {K_DYN} = 1)")
        panels[2, 0].set_ylabel("speed, rad/s\n(load; thin: motor; dotted: target)")
    return figure  # type: ignore[no-any-return]


def terminals_figure(found: Sequence[Endings]) -> Figure:
    """K_dyn of the three terminals over the start time, and what they cost beside reached."""
    looks = {"reached": (0, "o"), "synchronous": (1, "s"), "steady": (2, "^")}
    with drawing():
        figure, panels = new_figure(2, len(found), (9.0, 6.2), sharex="col", sharey="row", squeeze=False)
        for column, one in enumerate(found):
            above, below = panels[:, column]
            above.axhline(1.0, color=GREY, lw=0.9, ls=":")
            for terminal, (index, marker) in looks.items():
                look: dict[str, Any] = {
                    "color": COLOURS[index], "ls": DASHES[index], "marker": marker, "ms": 5, "mfc": "white",
                }  # fmt: skip
                solved = [p for p in one.by_terminal[terminal] if p.k_dyn is not None]
                above.plot(
                    [p.start_time_bound for p in solved], [p.k_dyn for p in solved], **look, label=terminal
                )
                if terminal != "reached":
                    costs = one.costs(terminal)
                    below.plot(
                        [time for time, _ in costs], [100.0 * (cost - 1.0) for _, cost in costs], **look
                    )
            above.set_title(f"gap {one.gap:g} rad", loc="left")
            below.set_xlabel("start time, s")
        panels[0, 0].set_ylabel(f"least {K_DYN}")
        panels[0, 0].set_ylim(bottom=0.5)
        panels[1, 0].set_ylabel(f"{K_DYN} above that of reached, %")
        panels[1, 0].set_yscale("symlog", linthresh=0.1)
        panels[1, 0].set_yticks([0, 0.1, 1, 10], ["0", "0.1", "1", "10"])
        panels[1, 0].set_ylim(-0.03, 60.0)
        panels[0, -1].legend(loc="upper right", handlelength=3.2)
    return figure  # type: ignore[no-any-return]


def sensor_figure(found: Sequence[Sensed]) -> Figure:
    """K_dyn over the gap under one torque, a panel a start time."""
    with drawing():
        figure, panels = new_figure(1, len(found), (9.0, 4.2), sharey=True, squeeze=False)
        for axes, one in zip(panels[0], found, strict=True):
            axes.axhline(1.0, color=GREY, lw=0.9, ls=":")
            lines = (
                ("one torque, blind", one.blind, "s"),
                ("planned again after the contact", one.reacting, "o"),
                ("own optimum of each gap", one.alone, "^"),
            )
            for index, (label, values, marker) in enumerate(lines):
                axes.plot(one.gaps, values, marker, color=COLOURS[index], ls=DASHES[index],
                          ms=6, mfc="white", mew=1.6, label=label)  # fmt: skip
            axes.set_title(f"start time {one.start_time:.4f} s", loc="left")
            axes.set_xlabel("gap, rad")
            axes.set_xticks(one.gaps)
            axes.margins(x=0.1)
        panels[0, 0].set_ylabel(K_DYN)
        panels[0, 0].set_ylim(bottom=0.0)
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, handlelength=3.2)
    return figure  # type: ignore[no-any-return]


def smooth_figure(found: Sequence[Price]) -> Figure:
    """K_dyn over the limit of the torque rate with and without lag, and over the weight of smoothness."""
    ideal, rest = found[0], [one for one in found[1:] if not math.isnan(one.k_dyn)]
    with drawing():
        figure, (left, right) = new_figure(1, 2, (9.0, 4.4), sharey=True)
        for axes in (left, right):
            axes.axhline(ideal.k_dyn, color=GREY, lw=1.0, ls=DASHES[1], label="ideal torque")
            axes.set_xscale("log")
        for index, lag in enumerate(sorted({one.lag for one in rest if one.weight == 0.0})):
            curve = [one for one in rest if one.lag == lag and one.weight == 0.0 and math.isfinite(one.rate)]
            name = f"lag {1000 * lag:g} ms" if lag else "no lag"
            left.plot([one.rate for one in curve], [one.k_dyn for one in curve], "os^"[index],
                      ls=DASHES[index], color=COLOURS[index], ms=5.5, mfc="white", label=name)  # fmt: skip
        weighed = [one for one in rest if one.weight > 0.0]
        right.plot([one.weight for one in weighed], [one.k_dyn for one in weighed], "^-", color=COLOURS[2],
                   ms=5.5, mfc="white", label="weighted smoothness")  # fmt: skip
        left.set_xlim(1500.0, 30000.0)
        left.set_xticks([2000, 5000, 10000, 20000], ["2000", "5000", "10000", "20000"])
        left.minorticks_off()
        left.set_xlabel("limit of the torque rate, N m/s")
        right.set_xlabel("weight of smoothness, s")
        left.set_ylabel(f"least {K_DYN}")
        left.legend(loc="upper right")
        right.legend(loc="upper left")
    return figure  # type: ignore[no-any-return]
