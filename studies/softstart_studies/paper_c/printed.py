"""The table of [C] as printed, beside what its own equations (1)-(3) give."""

from __future__ import annotations

from dataclasses import dataclass

from softstart.clutch import Clutch, Engagement, engage
from softstart.study import Table

KGF = 9.80665  # N
IN_KGF = (KGF, "kgf m")


@dataclass(frozen=True)
class Row:
    """A row of the printed table: friction work L, peak torque Md in kgf m, our readings of the law."""

    law: str
    L: int
    Md: float
    readings: tuple[str, ...]


PRINTED = (
    Row("linear", 28729, 64.6, ("linear",)),
    Row("quadratic", 25082, 66.5, ("quadratic-concave", "quadratic-convex")),
    Row("exponential", 27217, 75.7, ("exponential",)),
)


def clutch(law: str = "linear") -> Clutch:
    """The clutch of [C] under a law.

    >>> clutch().load_inertia / KGF
    0.5
    """
    return Clutch.load("paper-c", also={"law.kind": law})


def engagements() -> dict[str, Engagement]:
    """Each reading of each law, engaged."""
    return {reading: engage(clutch(reading)) for row in PRINTED for reading in row.readings}


def tables(runs: dict[str, Engagement]) -> tuple[Table, Table]:
    """Printed and recomputed side by side, and what the paper does not print."""
    rows = []
    for row, reading in ((one, reading) for one in PRINTED for reading in one.readings):
        L, Md = runs[reading].slip_work / KGF, runs[reading].slip_peak_torque / KGF
        off = 100.0 * (row.L / L - 1.0), 100.0 * (row.Md / Md - 1.0)
        rows.append((row.law, reading, row.L, round(L), off[0], row.Md, round(Md, 2), off[1]))
    behind = [
        (name, run.slip_time, run.slip_peak_time, run.work_while_engaging / run.slip_work, run.peak_ratio,
         run.locked_peak_torque / KGF, (run.friction_work - run.slip_work) / KGF, run.energy.residual)
        for name, run in runs.items()
    ]  # fmt: skip
    return (
        Table(
            "Table of [C], printed and recomputed",
            ("law", "read as", "L printed, kgf m", "L recomputed, kgf m", "print off, %",
             "Md printed, kgf m", "Md recomputed, kgf m", "print off in Md, %"),
            rows,
        ),
        Table(
            "Behind the table",
            ("law", "tau1, s", "time of the peak, s", "share of L before tM", "peak over mean torque",
             "peak after lock-up, kgf m", "work of slip after lock-up, kgf m", "energy residual"),
            behind,
        ),
    )  # fmt: skip
