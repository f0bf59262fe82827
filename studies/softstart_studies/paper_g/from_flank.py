"""What becomes of the conclusions of [G] where the start begins on a flank, not in the middle of the gap."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from softstart import Run, TorqueProfile, simulate
from softstart.controller import Controller, make_controller
from softstart.study import Claim, Table, Verdict
from softstart_studies.crane import CRANE, published
from softstart_studies.paper_g.crane import (
    GAP_1,
    GAP_2,
    HEAVY,
    LIGHT,
    SHARE,
    TORQUE,
    Method,
    crane,
    simulated,
    ways,
)

POSITIONS = ("mid-gap", "driving-flank", "opposite-flank")
GAPS = (0.5, 0.8, 1.2, 2.0)
STIFFNESSES = float(CRANE.c) * np.linspace(0.8, 1.2, 9) ** 2  # the elastic frequency off by up to 20 %


def start(where: str, r: float, method: Method, gap: float = GAP_1, inertias: int = HEAVY) -> Run:
    """A start of the crane drive from this position; torques and base of [G].

    >>> round(start("driving-flank", 0.25, 1).k_dyn, 6)
    2.0
    """
    return simulated(crane(inertias, gap).replace(start_position=where), r, method)


def k_dyn(where: str, controller: str | Controller, gap: float = GAP_1, **changes: float) -> float:
    """K_dyn of a strategy set up for the drive of [G]; `changes` are of the drive that runs."""
    told = CRANE.replace(start_position=where)
    made = published(controller) if isinstance(controller, str) else controller
    return simulate(told.replace(gap=gap, **changes), made, fitted_to=told, base=CRANE).k_dyn


def reduced(where: str) -> float:
    """K_dyn of the first contact under the reduced torque: from a flank the gap does not open, and it is all.

    >>> [round(reduced(where), 4) for where in POSITIONS]
    [1.2677, 0.5339, 1.6569]
    """
    held = make_controller("profile", {"profile": TorqueProfile([0.0, 60.0], [TORQUE] * 2)})
    return simulate(CRANE.replace(start_position=where), held).k_dyn_first_contact


def at_peak(where: str) -> float:
    """K_dyn of a quarter of the torque, raised at the peak of stage 2."""
    return k_dyn(where, published("reduced-two-stage", torque=TORQUE, raise_at="peak"))


def spread(where: str, controller: str) -> float:
    """Largest over least K_dyn over the gap."""
    k = [k_dyn(where, controller, gap) for gap in GAPS]
    return max(k) / min(k)


def stage(where: str, number: int, method: Method = 2, inertias: int = HEAVY) -> float:
    """Length of stage 1 or 2 under a quarter of the torque, s; NaN where there is no such stage."""
    return start(where, SHARE, method, inertias=inertias).stage_durations[number - 1] or math.nan


def lighter(where: str, r: float) -> float:
    """K_dyn of method 1 at J2 = 2 J1 over that at 5 J1."""
    return start(where, r, 1, inertias=LIGHT).k_dyn / start(where, r, 1).k_dyn


# the conclusion in words, what its number is, and the number from a position
NUMBERS: Sequence[tuple[str, str, Callable[[str], float]]] = (
    ("method 1 damps, never below 2", "method 1, r = 0.25: K", lambda p: start(p, SHARE, 1).k_dyn),
    ("method 2 can go below 2", "first contact: K", reduced),
    ("method 2 is to be preferred", "method 2, whole start: K", lambda p: start(p, SHARE, 2).k_dyn),
    ("(not in [G]) raise at the peak", "whole start: K", at_peak),
    ("a wider gap raises K markedly", "direct, K at 2 rad over K at 0.5 rad",
     lambda p: k_dyn(p, "direct", GAP_2) / k_dyn(p, "direct")),
    ("a smaller J2 lowers K", "direct, K at 2 J1 over K at 5 J1", lambda p: lighter(p, 1.0)),
    ("the least K is proportional to J2", "r = 0.01, K at 2 J1 over K at 5 J1", lambda p: lighter(p, 0.01)),
    ("stage 2 is almost as long under both", "stage 2, method 1 over method 2",
     lambda p: stage(p, 2, 1) / stage(p, 2, 2)),
    ("stage 1 sets the time", "stage 1, s", lambda p: start(p, SHARE, 2).stage_durations[0]),
    ("stage 1 lasts the same whatever J2", "stage 1, at 2 J1 over at 5 J1",
     lambda p: stage(p, 1, inertias=LIGHT) / stage(p, 1)),
    ("switching by time fails with wear", "worn to 2 rad: K", lambda p: k_dyn(p, ways()["instant"], GAP_2)),
    ("acceleration and delay does not", "worn to 2 rad: K", lambda p: k_dyn(p, "acceleration-delay", GAP_2)),
    ("the delay fits within 10-20 % of the frequency", "largest K within 20 %",
     lambda p: max(k_dyn(p, "acceleration-delay", stiffness=c) for c in STIFFNESSES.tolist())),
    ("feedback is invariant to the gap", "largest over least K",
     lambda p: spread(p, "current-limit-feedback")),
)  # fmt: skip


def table() -> Table:
    """A row for each conclusion: its figure from mid-gap, as in [G], and from both flanks."""
    said, what, number = zip(*NUMBERS, strict=True)
    found = {where: [one(where) for one in number] for where in POSITIONS}
    cells: dict[str, Sequence[object]] = {"": range(1, len(NUMBERS) + 1), "[G] says": said, "figure": what}
    return Table.of("The conclusions from a flank", {**cells, **found})


def claim() -> Claim:
    """On the driving flank nothing is left of the gap."""
    flat = [start("driving-flank", r, 1, gap).k_dyn for r in (0.05, SHARE, 1.0) for gap in (GAP_1, GAP_2)]
    hanging = simulate(CRANE.replace(start_position="hanging"), "direct").k_dyn
    return Claim(
        "(Not in [G]) The conclusions hold where the start begins on a flank.",
        Verdict.PARTLY,
        "From the driving flank no gap is crossed: direct and method 1 have K = 2 at every M1/Ms and gap "
        f"(to {max(abs(k - 2.0) for k in flat):.0e}), so that neither the reduced torque nor wear matters; "
        f"a hanging load lowers it to {hanging:.4f}. Raised at the peak a quarter of the torque has "
        f"{at_peak('driving-flank'):.4f}, from the opposite flank, across the whole gap, "
        f"{at_peak('opposite-flank'):.4f}.",
    )
