"""What method 2 comes to over the whole start: the second contact, which [G] does not look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart import Run, simulate
from softstart.arrays import Vector
from softstart.study import Claim, Verdict
from softstart.views.drawing import COLOURS, DASHES, GREY, drawing, head, new_figure, shade_open_gap
from softstart_studies.crane import CRANE, K_DYN, draw_lines
from softstart_studies.paper_g.crane import (
    GAP_1,
    GAP_2,
    HEAVY,
    METHODS,
    RATIOS,
    SHARE,
    crane,
    ratio_where,
    simulated,
)

R: Vector = RATIOS[4:]  # 0.05 to 1, as the points of figs. 2-4
DAMPING_RATIO = 0.05  # d Omega/(2 c), what a real shaft may have; [G] has none


@dataclass(frozen=True)
class WholeStart:
    """K_dyn over M1/Ms at one gap, by simulation of the whole start."""

    gap: float
    method_1: Vector
    first_contact: Vector  # method 2
    whole: Vector  # method 2
    at_peak: Vector  # torque raised at the peak of stage 2, whole start


def at_peak(gap: float, r: float) -> Run:
    """A start with the torque raised at the peak of stage 2, [G](14): half of stage 2 after contact.

    T is then at its turning point: it goes on to swing about M12avg_base by what it is away from it, so
    K_dyn = max(K, 2 - K) with K of [G](18), for the whole start.

    >>> round(at_peak(0.5, 0.25).k_dyn, 4)
    1.2677
    """
    given = {"torque": r * float(CRANE.Ms), "raise_at": "peak"}
    return simulate(crane(HEAVY, gap), "reduced-two-stage", parameters=given)


def whole_start(gap: float) -> WholeStart:
    """All starts at one gap.

    >>> found = whole_start(0.5)
    >>> bool(np.allclose(found.whole, found.method_1, rtol=1e-12))
    True
    """
    first, second = ([simulated(crane(HEAVY, gap), r, method) for r in R.tolist()] for method in METHODS)
    return WholeStart(
        gap,
        np.array([run.k_dyn for run in first]),
        np.array([run.k_dyn_first_contact for run in second]),
        np.array([run.k_dyn for run in second]),
        np.array([at_peak(gap, r).k_dyn for r in R.tolist()]),
    )


def traces() -> dict[str, Run]:
    """Two starts with a quarter of the torque, raised at the end and at the peak of stage 2."""
    return {
        "method 2: raised at the end of stage 2, (15)": simulated(crane(), SHARE, 2),
        "raised at the peak of stage 2, (14)": at_peak(GAP_1, SHARE),
    }


def method_2_is_gentler(starts: Sequence[WholeStart]) -> Claim:
    """The torque raised at the end of stage 2 meets an open gap whose flanks part at the speed of impact."""
    apart = max(float(np.max(np.abs(start.whole / start.method_1 - 1.0))) for start in starts)
    first, second = (simulated(crane(), SHARE, method) for method in METHODS)
    damped = crane().replace(damping=2 * DAMPING_RATIO * CRANE.c / CRANE.Omega)
    soft_1, soft_2 = (simulated(damped, SHARE, method) for method in METHODS)
    worn, quarter = starts[-1], int(np.argmin(np.abs(R - SHARE)))
    return Claim(
        "Method 2 is to be preferred, for it lowers the shock further than method 1.",
        Verdict.REFUTED if apart < 1e-9 else Verdict.PARTLY,
        "Only until stage 3. The gap opens again with the flanks parting at the speed they met with, and "
        "Ms, raised there, brings them back at it: over the whole start method 2 has the K of method 1 at "
        f"every M1/Ms and both gaps (largest difference {apart:.0e}, {len(R) * len(starts)} pairs of "
        f"starts). At M1/Ms = 0.25 and 0.5 rad: first contact {second.k_dyn_first_contact:.4f}, second "
        f"{second.k_dyn:.4f}, method 1 {first.k_dyn:.4f}, and "
        f"{1000 * (second.start_time - first.start_time):.0f} ms later at its target speed; at 2 rad "
        f"{worn.first_contact[quarter]:.4f}, {worn.whole[quarter]:.4f}, {worn.method_1[quarter]:.4f}. "
        f"Damping of {100 * DAMPING_RATIO:.0f} % of the critical one leaves "
        f"{soft_2.k_dyn_first_contact:.4f}, {soft_2.k_dyn:.4f} and {soft_1.k_dyn:.4f} at 0.5 rad.",
    )


def raising_at_the_peak(starts: Sequence[WholeStart]) -> Claim:
    """Not in [G]: half the delay does what method 2 promises."""
    apart = 0.0
    for start in starts:
        promised = np.maximum(start.first_contact, 2.0 - start.first_contact)
        apart = max(apart, float(np.max(np.abs(start.at_peak / promised - 1.0))))
    best = ratio_where(1.0, HEAVY, GAP_1, 2)
    new, worn, calm = (at_peak(*one).k_dyn for one in ((GAP_1, SHARE), (GAP_2, SHARE), (GAP_1, best)))
    return Claim(
        "(Not in [G]) Raised at the peak of stage 2, (14), instead of its end, (15), the torque keeps what "
        "(18) promises.",
        Verdict.CONFIRMED if apart < 1e-9 else Verdict.PARTLY,
        f"K of the whole start is max(K, 2 - K) with K of (18), to {apart:.0e} in {len(R) * len(starts)} "
        f"starts: {new:.4f} at 0.5 rad and {worn:.4f} at 2 rad for M1/Ms = 0.25, and {calm:.4f}, with no "
        f"oscillation left, for M1/Ms = {best:.4f} at 0.5 rad.",
    )


def figure(starts: Sequence[WholeStart]) -> Any:
    """K_dyn of method 2 at first contact and over the whole start."""
    with drawing():
        drawn, panels = new_figure(1, len(starts), (9.0, 4.9), sharey=True)
        for axes, start in zip(panels, starts, strict=True):
            lines = {
                "method 2, first contact, (18)": (R, start.first_contact),
                "method 1": (R, start.method_1),
                "raised at peak of stage 2, whole start": (R, start.at_peak),
            }
            draw_lines(
                axes, lines, f"$\\delta = {start.gap:g}$ rad, $J_2 = 5\\,J_1$", "$M_1/M_s$", levels=[2.0]
            )
            axes.plot(R[::5], start.whole[::5], "s", ms=5, color=COLOURS[1], mfc="white",
                      label="method 2, whole start", zorder=3)  # fmt: skip
        panels[0].set(ylabel=K_DYN, xlim=(0.0, 1.02), ylim=(0.0, 5.2))
        panels[0].legend(loc="upper left", handlelength=3.2)
    return drawn


def traces_figure(end: float = 0.26) -> Any:
    """Shaft and motor torque of the two starts, one panel each."""
    runs = traces()
    with drawing():
        drawn, panels = new_figure(len(runs), 1, (8.0, 6.0), sharex=True, sharey=True)
        for axes, (title, run) in zip(panels, runs.items(), strict=True):
            shade_open_gap(axes, run)
            base = run.peak_torque / run.k_dyn
            axes.axhline(base, color=GREY, lw=0.9, ls=":")
            axes.plot(run.t, run.T, color=COLOURS[0], label="shaft torque $M_{12}$")
            axes.plot(run.t, run.u, color=COLOURS[1], ls=DASHES[1], label="motor torque $M_1$")
            for stage in [one for one in run.stages if one.side != 0 and one.peak_time < end][:2]:
                peak = (stage.peak_time, stage.peak_torque)
                axes.plot(*peak, "o", ms=4.5, color=COLOURS[0])
                axes.annotate(
                    f"{K_DYN} = {peak[1] / base:.3f}", peak, xytext=(7, 3), textcoords="offset points"
                )
            head(axes, title, "torque, N m")
        panels[-1].set_xlabel(f"time, s     (grey: gap open; dotted: mean torque, {K_DYN} = 1)")
        panels[-1].set(xlim=(0.0, end), ylim=(-5.0, 150.0))
        panels[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    return drawn
