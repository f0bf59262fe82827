"""The figures of the study: they draw what the other files found and compute nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from softstart.start.run import Run
from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure, shade_open_gap
from softstart_studies.paper_g.curves import Curve
from softstart_studies.paper_g.frequency import Detuned
from softstart_studies.paper_g.invariance import GAPS, INERTIAS, STIFFNESSES, Spread
from softstart_studies.paper_g.wear import Wear
from softstart_studies.paper_g.whole_start import WholeStart

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKED = 5  # a marker at every so many points
K_DYN = "$K_{dyn}$"
RATIO = "$M_1/M_s$"
MARKERS = "os^"
GREY = "#666666"
# colour and dash of K_dyn at first contact, over the whole start, and with the torque raised at the peak
PROMISED, FIRST, WHOLE, PEAK = range(4)
LOOK: tuple[dict[str, Any], ...] = (
    {"color": "#9A9A9A", "ls": "-", "lw": 3.5},
    {"color": COLOURS[0], "ls": DASHES[1]},
    {"color": COLOURS[1], "ls": DASHES[0]},
    {"color": COLOURS[2], "ls": DASHES[2], "lw": 2.0},
)


def curves_figure(curves: Sequence[Curve], kinds: int, title: str, unit: str, top: float) -> Figure:
    """Curves over M1/Ms, `kinds` of them a colour, with the plant's points on them."""
    scale = 1000.0 if unit == "time, ms" else 1.0
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 5.0))
        for index, curve in enumerate(curves):
            colour, kind = COLOURS[index // kinds], index % kinds
            look = {"color": colour, "ls": DASHES[kind]}
            axes.plot(curve.r, scale * curve.values, **look, zorder=2)
            axes.plot(
                curve.at, scale * curve.points, MARKERS[kind], ms=4.5, mec=colour, mfc="white", zorder=3
            )
            axes.plot(
                [], [], **look, marker=MARKERS[kind], ms=4.5, mec=colour, mfc="white", label=curve.label
            )
        if unit != "time, ms":
            two_line(axes)
        worst = max(curve.disagreement for curve in curves)
        axes.set_xlabel(f"{RATIO}     (lines: closed form; points: exact plant, at most {worst:.0e} off)")
        axes.set_ylabel(unit)
        axes.set_xlim(0.0, 1.02)
        axes.set_ylim(0.0, top)
        axes.set_title(title, loc="left")
        axes.legend(loc="upper left" if unit != "time, ms" else "upper right", handlelength=3.2)
    return figure  # type: ignore[no-any-return]


def two_line(axes: Any) -> None:
    """Where K_dyn = 2."""
    axes.axhline(2.0, color=GREY, lw=0.9, ls=(0, (1, 2)), zorder=1)


def whole_start_figure(starts: Sequence[WholeStart]) -> Figure:
    """K_dyn of method 2 at first contact and over the whole start."""
    with drawing():
        figure, panels = new_figure(1, len(starts), (9.0, 4.9), sharey=True)
        for axes, start in zip(panels, starts, strict=True):
            two_line(axes)
            axes.plot(start.r, start.first_contact, **LOOK[PROMISED], label="method 2, first contact, (18)")
            axes.plot(start.r, start.method_1, **LOOK[WHOLE], label="method 1")
            axes.plot(
                start.r[::MARKED],
                start.whole[::MARKED],
                "s",
                ms=5,
                mec=COLOURS[1],
                mfc="white",
                label="method 2, whole start",
                zorder=3,
            )
            axes.plot(start.r, start.at_peak, **LOOK[PEAK], label="raised at peak of stage 2, whole start")
            axes.set_title(f"$\\delta = {start.gap:g}$ rad, $J_2 = 5\\,J_1$", loc="left")
            axes.set_xlabel(RATIO)
            axes.set_xlim(0.0, 1.02)
        panels[0].set_ylabel(K_DYN)
        panels[0].set_ylim(0.0, 5.2)
        panels[0].legend(loc="upper left", handlelength=3.2)
    return figure  # type: ignore[no-any-return]


def traces_figure(runs: Sequence[tuple[str, Run]], end: float) -> Figure:
    """Shaft and motor torque of several starts, one panel each."""
    with drawing():
        figure, panels = new_figure(
            len(runs), 1, (8.0, 1.2 + 2.4 * len(runs)), sharex=True, sharey=True, squeeze=False
        )
        for axes, (title, run) in zip(panels[:, 0], runs, strict=True):
            shade_open_gap(axes, run)
            base = run.peak_torque / run.k_dyn
            axes.axhline(base, color=GREY, lw=0.9, ls=DASHES[3])
            axes.plot(run.t, run.T, color=COLOURS[0], label="shaft torque $M_{12}$")
            axes.plot(run.t, run.u, color=COLOURS[1], ls=DASHES[1], label="motor torque $M_1$")
            for stage in [stage for stage in run.stages if stage.side != 0][:2]:
                if stage.peak_time < end:
                    axes.plot([stage.peak_time], [stage.peak_torque], "o", ms=4.5, color=COLOURS[0])
                    axes.annotate(
                        f"{K_DYN} = {stage.peak_torque / base:.3f}",
                        (stage.peak_time, stage.peak_torque),
                        xytext=(7, 3),
                        textcoords="offset points",
                    )
            axes.set_title(title, loc="left")
            axes.set_ylabel("torque, N m")
        last = panels[-1, 0]
        last.set_xlabel(f"time, s     (grey: gap open; dotted: mean torque, {K_DYN} = 1)")
        last.set_xlim(0.0, end)
        last.set_ylim(-5.0, 150.0)
        panels[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    return figure  # type: ignore[no-any-return]


def wear_figure(found: Wear) -> Figure:
    """K_dyn over the gap for three ways of ending the reduced torque."""
    ways = (
        ("at an instant: $t_1 + t_2$ of the new drive", found.by_time, COLOURS[0], DASHES[1]),
        ("acceleration-delay, delay (15)", found.by_delay, COLOURS[1], DASHES[0]),
        ("acceleration-delay, delay (14)", found.by_half_delay, COLOURS[2], DASHES[2]),
    )
    with drawing():
        figure, panels = new_figure(1, 2, (9.0, 4.6), sharey=True)
        for axes, title in zip(
            panels, ("first contact", "whole start (steps: sampled at 1 kHz)"), strict=True
        ):
            two_line(axes)
            axes.plot(found.gaps, found.promised, **LOOK[PROMISED], label="promised by (18)")
            for label, kept, colour, dash in ways:
                k = kept.first_contact if title == "first contact" else kept.whole
                axes.plot(found.gaps, k, color=colour, ls=dash, label=label)
            axes.set_title(title, loc="left")
            axes.set_xlim(0.45, 2.05)
            axes.set_xticks([0.5, 1.0, 1.5, 2.0])
            axes.set_xlabel("gap $\\delta$, rad     (set up for 0.5 rad)")
        panels[0].set_ylabel(K_DYN)
        panels[0].set_ylim(0.0, 4.0)
        panels[0].legend(loc="lower right", handlelength=3.2)
    return figure  # type: ignore[no-any-return]


def frequency_figure(sweeps: Sequence[Detuned]) -> Figure:
    """K_dyn over the deviation of the elastic frequency; the bands of 10 and 20 % shaded."""
    names = {"load inertia": "frequency changed by $J_2$", "stiffness": "frequency changed by $c_{12}$"}
    with drawing():
        figure, panels = new_figure(1, len(sweeps), (9.0, 4.6), sharex=True, sharey=True)
        for axes, sweep in zip(panels, sweeps, strict=True):
            axes.axvspan(-20, 20, color="#F0F2F4", lw=0, zorder=0)
            axes.axvspan(-10, 10, color="#E2E6EA", lw=0, zorder=0)
            two_line(axes)
            x = 100 * sweep.deviations
            axes.plot(x, sweep.promised, **LOOK[PROMISED], label="promised by (18)")
            axes.plot(x, sweep.first_contact, **LOOK[FIRST], label="delay (15), first contact")
            axes.plot(x, sweep.whole, **LOOK[WHOLE], label="delay (15), whole start")
            axes.plot(x, sweep.half_delay, **LOOK[PEAK], label="delay (14), whole start")
            axes.set_title(names[sweep.cause], loc="left")
            axes.set_xlabel("deviation of $\\Omega$, %     (grey: 10 and 20 %)")
        panels[0].set_ylabel(f"{K_DYN}, base of the nominal drive")
        panels[0].set_ylim(0.0, 3.5)
        panels[0].legend(loc="lower left", handlelength=3.2)
    return figure  # type: ignore[no-any-return]


def invariance_figure(spreads: Sequence[Spread]) -> Figure:
    """K_dyn over gap, inertia and stiffness, each strategy set up once."""
    with drawing():
        figure, panels = new_figure(1, 3, (9.0, 4.4), sharey=True)
        for index, one in enumerate(spreads):
            look = {"color": COLOURS[index], "ls": DASHES[index], "label": one.strategy}
            for axes, x, k in zip(
                panels,
                (GAPS, INERTIAS, STIFFNESSES),
                (one.by_gap, one.by_inertia, one.by_stiffness),
                strict=True,
            ):
                axes.plot(x, k, **look)
        for axes, name in zip(
            panels, ("gap $\\delta$, rad", "$J_2/J_1$", "$c_{12}$ over nominal"), strict=True
        ):
            two_line(axes)
            axes.set_xlabel(name)
        panels[0].set_ylabel(f"{K_DYN} of the whole start, base of the nominal drive")
        panels[0].set_ylim(0.0, 5.2)
        panels[2].legend(loc="upper right", handlelength=3.2)
        panels[0].set_title("each set up for 0.5 rad, $J_2 = 5\\,J_1$, nominal $c_{12}$", loc="left")
    return figure  # type: ignore[no-any-return]
