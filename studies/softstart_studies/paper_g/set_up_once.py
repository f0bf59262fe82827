"""Strategies set up for the new drive, while gap, elastic frequency, inertia or stiffness change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from softstart import MachineTable, machine_table
from softstart.arrays import Vector
from softstart.study import Claim, Table, Verdict
from softstart.views.drawing import drawing, new_figure
from softstart_studies.crane import CRANE, K_DYN, draw_lines, published, spread
from softstart_studies.paper_g.crane import (
    BASE,
    GAP_1,
    GAP_2,
    HEAVY,
    LIGHT,
    SHARE,
    closed_form,
    k_dyn,
    many,
    ways,
)

GAPS: Vector = np.linspace(GAP_1, GAP_2, 61)
DEVIATIONS: Vector = np.linspace(-0.3, 0.4, 71)  # of the elastic frequency
BAND = 0.20  # of it, the wider bound of [G]
KEPT, NEARLY_KEPT = 1.05, 1.10  # K_dyn over (18) that counts as kept, with wear and with the frequency
INVARIANT = 0.05  # spread that may be called invariant
Cause = Literal["load inertia", "stiffness"]


@dataclass(frozen=True)
class Sweep:
    """K_dyn over x for each way of raising the torque, M1/Ms = 0.25, base of the new drive.

    `promised` is (18), for a torque that is raised as the drive at hand needs it; `first` and `whole` are
    K_dyn of the first contact and of the whole start, by the way, which is set up for the new drive.
    """

    x: Vector  # the gap in rad, or the deviation of the elastic frequency
    J2: Vector  # kg m2
    c: Vector  # N m/rad
    promised: Vector
    first: Mapping[str, Vector]
    whole: Mapping[str, Vector]

    def within(self, band: float) -> Any:
        """Where x is off by no more than this."""
        return np.abs(self.x) <= band + 1e-9


def swept(x: Vector, drives: MachineTable, **changed: Vector) -> Sweep:
    """All starts."""
    found = {way: many(drives, controller) for way, controller in ways().items()}
    first, whole = ({way: pair[i] for way, pair in found.items()} for i in (0, 1))
    J2, c = (np.broadcast_to(changed.get(name, getattr(CRANE, name)), x.shape) for name in ("J2", "c"))
    promised = closed_form(CRANE, SHARE, 2, BASE, **changed).k_dyn
    return Sweep(x, J2, c, np.asarray(promised), first, whole)


def worn() -> Sweep:
    """While the gap wears.

    >>> found = worn()
    >>> bool(found.first["instant"][-1] > 1.3 * found.promised[-1])
    True
    """
    return swept(GAPS, machine_table(CRANE, gap=GAPS), gap=GAPS)


def detuned(cause: Cause) -> Sweep:
    """While the elastic frequency moves; by the load it can only fall to that of an infinite inertia.

    Omega^2 = c/J1 + c/J2, so J2 = J1/(Omega^2 J1/c - 1): from 5 J1 up Omega falls by 8.7 % at the most.

    >>> float(detuned("load inertia").x[0].round(2))
    -0.08
    """
    if cause == "stiffness":
        c = CRANE.c * (1.0 + DEVIATIONS) ** 2
        return swept(DEVIATIONS, machine_table(CRANE, stiffness=c), c=c)
    over = (CRANE.Omega * (1.0 + DEVIATIONS)) ** 2 * CRANE.J1 / CRANE.c - 1.0
    possible = over > 0.01
    J2 = CRANE.J1 / over[possible]
    return swept(DEVIATIONS[possible], machine_table(CRANE, load_inertia=J2), J2=J2)


# wear ----------------------------------------------------------------------------------------------------


def time_fails(found: Sweep) -> Claim:
    """At first contact yes; over the whole start the delay of [G] is harder still."""
    first, whole, delayed = found.first["instant"], found.whole["instant"], found.whole["delay (15)"]
    excess = float(first[-1] / found.promised[-1])
    gentler = bool(np.all(whole <= delayed + 0.01))
    softest = int(np.argmin(whole))
    return Claim(
        "Switching by time is unacceptable, because wear lengthens the stages.",
        Verdict.REFUTED if excess <= KEPT else Verdict.of(True, not gentler),
        "Set up for 0.5 rad and worn to 2 rad, the torque rises as the gap closes: first contact "
        f"{_ends(first)}, {100 * (excess - 1):.0f} % above (18) and near method 1 "
        f"({k_dyn(HEAVY, GAP_2, SHARE, 1):.4f}). Over the whole start K is {_ends(whole)}, with a least of "
        f"{whole[softest]:.4f} at {found.x[softest]:.2f} rad, where the instant falls near the peak of "
        f"stage 2: {'at no gap harder' if gentler else 'sometimes harder'} than the delay that [G] puts in "
        f"its place ({_ends(delayed)}).",
    )


def acceleration_holds(found: Sweep) -> Claim:
    """At first contact; over the whole start only with the delay (14)."""
    first, whole, half = found.first["delay (15)"], found.whole["delay (15)"], found.whole["delay (14)"]
    excess, of_whole, of_half = (float(np.max(k / found.promised)) for k in (first, whole, half))
    return Claim(
        "Torque held reduced by the acceleration of the motor and then for a delay equal to stage 2 does "
        "not fail with wear.",
        Verdict.REFUTED if excess >= KEPT else Verdict.of(True, of_whole < KEPT),
        f"At 1 kHz with an encoder the first contact is that of (18) to {max(abs(excess - 1), 1e-16):.0e}: "
        f"{_ends(first)}. But raised at the end of stage 2 or later, the torque makes the second contact "
        f"hard: whole start {_ends(whole)}. With the delay (14), half as long, the whole start stays within "
        f"{100 * (of_half - 1):.1f} % of (18): {_ends(half)}.",
    )


def _ends(k: Vector) -> str:
    return f"{k[0]:.4f} to {k[-1]:.4f}"


def wear_figure(found: Sweep) -> Any:
    """K_dyn over the gap for three ways of ending the reduced torque."""
    titles = ("first contact", "whole start (steps: sampled at 1 kHz)")
    with drawing():
        drawn, panels = new_figure(1, 2, (9.0, 4.6), sharey=True)
        for axes, title, k in zip(panels, titles, (found.first, found.whole), strict=True):
            lines = {"promised by (18)": (found.x, found.promised)}
            lines |= {way: (found.x, values) for way, values in k.items()}
            draw_lines(axes, lines, title, "gap $\\delta$, rad     (set up for 0.5 rad)", levels=[2.0])
        panels[0].set(ylabel=K_DYN, ylim=(0.0, 4.0))
        panels[0].legend(loc="lower right", handlelength=3.2)
    return drawn


# elastic frequency ---------------------------------------------------------------------------------------


def delay_fits(by_load: Sweep, by_shaft: Sweep) -> Claim:
    """The 10-20 % of [G].

    >>> delay_fits(detuned("load inertia"), detuned("stiffness")).verdict.value
    'partly'
    """
    load, shaft = (one.first["delay (15)"] / one.promised for one in (by_load, by_shaft))
    near, far = by_shaft.within(BAND / 2), by_shaft.within(BAND)
    inside = by_load.within(BAND)
    by_J2, by_c = (bool(np.all(k < NEARLY_KEPT)) for k in (load[inside], shaft[far]))
    lost = float(np.max(by_shaft.x[shaft > NEARLY_KEPT], initial=-np.inf))
    worst = int(np.argmax(np.where(far, shaft, 0.0)))
    first, promised, whole = by_shaft.first["delay (15)"], by_shaft.promised, by_shaft.whole["delay (15)"]
    half_J2, half_c = (one.whole["delay (14)"] / one.promised for one in (by_load, by_shaft))
    half = max(float(np.max(half_J2[inside])), float(np.max(half_c[far])))
    lowest = 1.0 - float(np.sqrt(CRANE.J2 / (CRANE.J1 + CRANE.J2)))
    return Claim(
        "The delay fits while J2 varies so little that the elastic frequency stays within 10-20 %.",
        Verdict.REFUTED if not by_J2 else Verdict.of(True, by_c),
        f"At first contact J2 does not matter: from {100 * by_load.x[0]:+.1f} % (no J2 lowers the frequency "
        f"of this drive by more than {100 * lowest:.1f} %) to {100 * by_load.x[-1]:+.1f} % K is that of "
        f"(18) to {np.abs(load - 1).max():.0e}. Where the stiffness moves the frequency, it holds within 10 "
        f"% (to {np.abs(shaft[near] - 1).max():.0e}) and breaks from {100 * lost:+.1f} % on, where the "
        f"torque rises inside stage 2: {first[worst]:.4f} instead of {promised[worst]:.4f} at "
        f"{100 * by_shaft.x[worst]:+.1f} %. Over the whole start, within 20 %, K is "
        f"{_span(by_load.whole['delay (15)'][inside])} by J2 and {_span(whole[far])} by "
        f"stiffness, where (18) promises {_span(promised[far])}; with the delay (14) it is at most "
        f"{100 * (half - 1):.0f} % above (18).",
    )


def _span(k: Vector) -> str:
    return f"{float(k.min()):.2f} to {float(k.max()):.2f}"


def frequency_figure(by_load: Sweep, by_shaft: Sweep) -> Any:
    """K_dyn over the deviation of the elastic frequency; the bands of 10 and 20 % shaded."""
    with drawing():
        drawn, panels = new_figure(1, 2, (9.0, 4.6), sharex=True, sharey=True)
        for axes, one, what in zip(panels, (by_load, by_shaft), ("$J_2$", "$c_{12}$"), strict=True):
            for band, colour in ((20, "#F0F2F4"), (10, "#E2E6EA")):
                axes.axvspan(-band, band, color=colour, lw=0, zorder=0)
            x = 100 * one.x
            lines = {
                "promised by (18)": (x, one.promised),
                "delay (15), first contact": (x, one.first["delay (15)"]),
                "delay (15), whole start": (x, one.whole["delay (15)"]),
                "delay (14), whole start": (x, one.whole["delay (14)"]),
            }
            across = "deviation of $\\Omega$, %     (grey: 10 and 20 %)"
            draw_lines(axes, lines, f"frequency changed by {what}", across, levels=[2.0])
        panels[0].set(ylabel=f"{K_DYN}, base of the new drive", ylim=(0.0, 3.5))
        panels[0].legend(loc="lower left", handlelength=3.2)
    return drawn


# gap, inertia, stiffness ---------------------------------------------------------------------------------

INERTIAS: Vector = np.linspace(LIGHT, HEAVY, 13) * CRANE.J1
STIFFNESSES: Vector = np.linspace(0.8, 1.2, 9) * CRANE.c
EVERY: tuple[Vector, ...] = (GAPS[::4], INERTIAS, STIFFNESSES)
CHANGED = ("gap 0.5 to 2 rad", "J2 2 to 5 J1", "c -20 to +20 %", "all three")
Spreads = dict[str, tuple[Vector, ...]]


def spreads() -> Spreads:
    """K_dyn of the whole start by strategy, set up for the new drive: over each parameter, and all three.

    >>> round(spread(spreads()["direct"][0]), 2)
    0.56
    """
    delays = ways()
    strategies = {
        "direct": published("direct"),
        "acceleration-delay, (15)": delays["delay (15)"],
        "acceleration-delay, (14)": delays["delay (14)"],
        "current-limit-feedback": published("current-limit-feedback"),
    }
    names = ("gap", "load_inertia", "stiffness")
    coarse = np.meshgrid(GAPS[::20], INERTIAS[::4], STIFFNESSES[::2], indexing="ij")
    batches = [machine_table(CRANE, **{name: values}) for name, values in zip(names, EVERY, strict=True)]
    batches.append(machine_table(CRANE, **{n: grid.ravel() for n, grid in zip(names, coarse, strict=True)}))
    return {name: tuple(many(batch, one)[1] for batch in batches) for name, one in strategies.items()}


def spreads_table(found: Spreads) -> Table:
    """Least and largest K_dyn and the relative spread, for each parameter and all together."""
    rows = [
        (name, what, len(k), float(k.min()), float(k.max()), f"{100 * spread(k):.1f} %")
        for name, columns in found.items()
        for what, k in zip(CHANGED, columns, strict=True)
    ]
    columns = ("strategy", "changed", "starts", "least K_dyn", "largest K_dyn", "largest/least - 1")
    return Table("K_dyn of strategies set up once", columns, rows)


def feedback_is_invariant(found: Spreads) -> Claim:
    """Feedback against the direct start."""
    direct, feedback = found["direct"], found["current-limit-feedback"]
    whole, without = spread(feedback[-1]), spread(direct[-1])
    said = "; ".join(
        f"{name} {100 * spread(k):.1f} % (direct {100 * spread(reference):.1f} %)"
        for name, k, reference in zip((*CHANGED[:-1], "all together"), feedback, direct, strict=True)
    )
    return Claim(
        "Regulators acting on the current-limit level or as a flexible feedback are invariant to the gap "
        "and to the other mechanical parameters.",
        Verdict.of(whole < INVARIANT, whole < 0.5 * without),
        f"Spread of K over the whole start of current-limit-feedback, set up once: {said}. Not invariant, "
        f"but its largest K of all {len(feedback[-1])} drives is {feedback[-1].max():.4f} where the direct "
        f"start has {direct[-1].max():.4f}.",
    )


def spreads_figure(found: Spreads) -> Any:
    """K_dyn over gap, inertia and stiffness, each strategy set up once."""
    names = ("gap $\\delta$, rad", "$J_2/J_1$", "$c_{12}$ over nominal")
    with drawing():
        drawn, panels = new_figure(1, 3, (9.0, 4.4), sharey=True)
        for i, (axes, across, unit) in enumerate(zip(panels, names, (1.0, CRANE.J1, CRANE.c), strict=True)):
            lines = {name: (EVERY[i] / unit, columns[i]) for name, columns in found.items()}
            draw_lines(axes, lines, "", across, levels=[2.0])
        panels[0].set(ylabel=f"{K_DYN} of the whole start, base of the new drive", ylim=(0.0, 5.2))
        panels[2].legend(loc="upper right", handlelength=3.2)
        panels[0].set_title("each set up for 0.5 rad, $J_2 = 5\\,J_1$, nominal $c_{12}$", loc="left")
    return drawn
