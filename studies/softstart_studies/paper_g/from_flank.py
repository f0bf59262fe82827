"""What becomes of the conclusions of [G] where the start begins on a flank, not in the middle of the gap."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from softstart import Drive, Run, TorqueProfile, simulate
from softstart.controller import Controller, make_controller
from softstart.study import Claim, Table, Verdict
from softstart_studies.paper_g.crane import (
    CRANE,
    GAP_1,
    GAP_2,
    HEAVY,
    LIGHT,
    SHARE,
    crane,
    published,
    simulated,
)
from softstart_studies.paper_g.switching import SwitchAtInstant

POSITIONS = ("mid-gap", "driving-flank", "opposite-flank")
GAPS = (0.5, 0.8, 1.2, 2.0)
DETUNED = np.linspace(0.8, 1.2, 9)  # elastic frequency over that which the delay was set for
Figure = Callable[[str], float]


def start(where: str, r: float, method: int, gap: float = GAP_1, inertias: int = HEAVY) -> Run:
    """A start of the crane drive from this position; torques and base of [G].

    >>> round(start("driving-flank", 0.25, 1).k_dyn, 6)
    2.0
    """
    drive = crane(inertias, gap).replace(start_position=where)
    return simulated(drive, r, 1 if method == 1 else 2, base=CRANE)


def reduced(where: str) -> float:
    """K_dyn of the first contact under the reduced torque: from a flank the gap does not open, and it is all.

    >>> [round(reduced(where), 4) for where in POSITIONS]
    [1.2677, 0.5339, 1.6569]
    """
    drive = CRANE.replace(start_position=where)
    held = make_controller("profile", {"profile": TorqueProfile([0.0, 60.0], [SHARE * CRANE.Ms] * 2)})
    return simulate(drive, held, base=CRANE).k_dyn_first_contact


def k_dyn(where: str, controller: str | Controller, gap: float = GAP_1, **changes: float) -> float:
    """K_dyn of a strategy set up for the drive of [G]; `changes` are of the drive that runs."""
    told = CRANE.replace(start_position=where)
    made = published(controller) if isinstance(controller, str) else controller
    return simulate(told.replace(gap=gap, **changes), made, fitted_to=told, base=CRANE).k_dyn


def at_peak(where: str) -> float:
    """K_dyn of a quarter of the torque, raised at the peak of stage 2."""
    given = {"torque": SHARE * float(CRANE.Ms), "raise_at": "peak"}
    return k_dyn(where, make_controller("reduced-two-stage", given))


def detuned(where: str) -> float:
    """The largest K_dyn with the stiffness so that the frequency is off by up to 20 %."""
    c = float(CRANE.c)
    return max(k_dyn(where, "acceleration-delay", stiffness=float(c * f * f)) for f in DETUNED)


def spread(where: str, controller: str) -> float:
    """Largest over least K_dyn over the gap."""
    k = [k_dyn(where, controller, gap) for gap in GAPS]
    return max(k) / min(k)


def open_gap(where: str, inertias: int = HEAVY) -> float:
    """Length of stage 1 under a quarter of the torque, s."""
    return start(where, SHARE, 2, inertias=inertias).stage_durations[0]


def ratio(a: float, b: float) -> float:
    """a/b; NaN where there is no such stage."""
    return a / b if b else math.nan


# number and words of the conclusion, the figure and what it is
FIGURES: Sequence[tuple[int, str, str, Figure]] = (
    (1, "method 1 damps, never below 2", "method 1, r = 0.25: K", lambda p: start(p, SHARE, 1).k_dyn),
    (2, "method 2 can go below 2", "first contact: K", reduced),
    (3, "method 2 is to be preferred", "method 2, whole start: K", lambda p: start(p, SHARE, 2).k_dyn),
    (4, "(not in [G]) raise at the peak", "whole start: K", at_peak),
    (5, "a wider gap raises K markedly", "direct, K at 2 rad over K at 0.5 rad",
     lambda p: k_dyn(p, "direct", GAP_2) / k_dyn(p, "direct")),
    (6, "a smaller J2 lowers K", "direct, K at 2 J1 over K at 5 J1",
     lambda p: start(p, 1.0, 1, inertias=LIGHT).k_dyn / start(p, 1.0, 1).k_dyn),
    (7, "the least K is proportional to J2", "r = 0.01, K at 2 J1 over K at 5 J1",
     lambda p: start(p, 0.01, 1, inertias=LIGHT).k_dyn / start(p, 0.01, 1).k_dyn),
    (8, "stage 2 is almost as long under both", "stage 2, method 1 over method 2",
     lambda p: ratio(start(p, SHARE, 1).stage_durations[1], start(p, SHARE, 2).stage_durations[1])),
    (9, "stage 1 sets the time", "stage 1, s", open_gap),
    (10, "stage 1 lasts the same whatever J2", "stage 1, at 2 J1 over at 5 J1",
     lambda p: ratio(open_gap(p, LIGHT), open_gap(p))),
    (11, "switching by time fails with wear", "worn to 2 rad: K",
     lambda p: k_dyn(p, SwitchAtInstant(), GAP_2)),
    (12, "acceleration and delay does not", "worn to 2 rad: K",
     lambda p: k_dyn(p, "acceleration-delay", GAP_2)),
    (13, "the delay fits within 10-20 % of the frequency", "largest K within 20 %", detuned),
    (14, "feedback is invariant to the gap", "largest over least K",
     lambda p: spread(p, "current-limit-feedback")),
)  # fmt: skip


def table() -> Table:
    """A row for each conclusion: its figure from mid-gap, as in [G], and from both flanks."""
    rows = [
        (number, says, what, *(_cell(figure(where)) for where in POSITIONS))
        for number, says, what, figure in FIGURES
    ]
    return Table("The conclusions from a flank", ("", "[G] says", "figure", *POSITIONS), rows)


def _cell(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 4)


def claim() -> Claim:
    """On the driving flank nothing is left of the gap."""
    flat = [start("driving-flank", r, 1, gap).k_dyn for r in (0.05, SHARE, 1.0) for gap in (GAP_1, GAP_2)]
    apart = max(abs(k - 2.0) for k in flat)
    best, wide = (at_peak(where) for where in ("driving-flank", "opposite-flank"))
    hanging: Drive = CRANE.replace(start_position="hanging")
    held = simulate(hanging, "direct").k_dyn
    return Claim(
        "(Not in [G]) The conclusions hold where the start begins on a flank.",
        Verdict.PARTLY,
        f"From the driving flank no gap is crossed: direct and method 1 have K = 2 at every M1/Ms and gap "
        f"(to {apart:.0e}), so that neither the reduced torque nor wear matters; a hanging load lowers it to "
        f"{held:.4f}. Raised at the peak a quarter of the torque has {best:.4f}, from the opposite flank, "
        f"across the whole gap, {wide:.4f}.",
    )
