"""Figures 2, 3 and 4 of [G] and the check table: closed forms, and the plant at points on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.study import Table
from softstart.views.drawing import COLOURS, DASHES, drawing, head, new_figure
from softstart_studies.crane import K_DYN
from softstart_studies.paper_g.crane import (
    BASE,
    GAP_1,
    GAP_2,
    HEAVY,
    LIGHT,
    METHODS,
    RATIOS,
    Method,
    closed_form,
    crane,
    simulated,
)

POINTS: Vector = np.linspace(0.05, 1.0, 20)  # where the plant is asked too
# J2/J1, gap in rad, r, and what the check table gives: K method 1, K method 2, t1, t1 + t2 of method 1
PRINTED = (
    (5, 0.5, 1.0, "3.1179", "3.1179", "0.0166", "0.0533"),
    (5, 0.5, 0.25, "2.3894", "1.2677", "0.0321", "0.0743"),
    (5, 2.0, 1.0, "4.8654", "4.8654", "0.0332", "0.0658"),
    (5, 2.0, 0.25, "3.1729", "2.2144", "0.0643", "0.1008"),
    (2, 0.5, 1.0, "2.7157", "2.7157", "0.0163", "0.0485"),
)
QUANTITIES = ("K method 1", "K method 2", "t1, s", "t1 + t2 method 1, s")
TITLES = {
    "2": "Fig. 2 of [G]: $\\delta_1 = 0.5$ rad, base of $J_2''$",
    "3": "Fig. 3 of [G]: $J_2'' = 5\\,J_1$",
    "4": "Fig. 4 of [G]: $J_2'' = 5\\,J_1$",
}


@dataclass(frozen=True)
class Curve:
    """One curve of a figure over RATIOS, and the plant's values at POINTS."""

    label: str
    values: Vector
    exact: Vector  # on the curve, at the points
    points: Vector  # by simulation

    @property
    def disagreement(self) -> float:
        """Largest relative difference between the plant and the closed form."""
        return float(np.max(np.abs(self.points / self.exact - 1.0)))


def k_dyn_curve(ratio: float, gap: float, method: Method, label: str) -> Curve:
    """K_dyn of stage 2 by [G](17) or (18), base of J2'' = 5 J1.

    >>> k_dyn_curve(5, 0.5, 2, "method 2").disagreement < 1e-9
    True
    """
    drive = crane(ratio, gap)
    values, exact = (np.asarray(closed_form(drive, r, method, BASE).k_dyn) for r in (RATIOS, POINTS))
    runs = [simulated(drive, float(r), method) for r in POINTS]
    return Curve(
        f"{label}, method {method}", values, exact, np.array([run.k_dyn_first_contact for run in runs])
    )


def duration_curve(gap: float, method: Method, stages: int, label: str) -> Curve:
    """Length in s of stage 1 by [G](3), or of stages 1 + 2 by (3) and (15)."""
    drive = crane(HEAVY, gap)
    forms = [closed_form(drive, r, method) for r in (RATIOS, POINTS)]
    values, exact = (np.asarray(sum((one.open_duration, one.contact_duration)[:stages])) for one in forms)
    runs = [simulated(drive, float(r), method) for r in POINTS]
    return Curve(label, values, exact, np.array([sum(run.stage_durations[:stages]) for run in runs]))


def figures() -> dict[str, list[Curve]]:
    """The curves by the number of the figure of [G].

    Fig. 2: K_dyn for J2' and J2'' at delta1, both methods. Fig. 3: for delta1 and delta2 at J2''. Fig. 4: the
    length of stages 1 + 2 for both methods and of stage 1, both gaps, at J2''.
    """
    inertias = ((HEAVY, "$J_2'' = 5\\,J_1$"), (LIGHT, "$J_2' = 2\\,J_1$"))
    gaps = ((GAP_2, "$\\delta_2 = 2$ rad"), (GAP_1, "$\\delta_1 = 0.5$ rad"))
    spans: tuple[tuple[Method, int, str], ...] = (
        (1, 2, "$t_1 + t_2$, method 1"), (2, 2, "$t_1 + t_2$, method 2"), (1, 1, "$t_1$"),
    )  # fmt: skip
    return {
        "2": [k_dyn_curve(ratio, GAP_1, method, text) for ratio, text in inertias for method in METHODS],
        "3": [k_dyn_curve(HEAVY, gap, method, text) for gap, text in gaps for method in METHODS],
        "4": [duration_curve(gap, *span[:2], f"{text}, {span[2]}") for gap, text in gaps for span in spans],
    }


def worked_table() -> Table:
    """The check table: as printed, by closed form, and by the plant.

    The check table adds durations already rounded: 0.0321 + 0.0422 is given as 0.0743, where t1 + t2 is
    0.074396 s, and 0.0163 + 0.0322 as 0.0485, where it is 0.048550 s. The last column says so.
    """
    rows: list[tuple[object, ...]] = []
    for ratio, gap, r, *printed in PRINTED:
        drive = crane(ratio, gap)
        first, second = (closed_form(drive, r, method, BASE) for method in METHODS)
        runs = [simulated(drive, r, method) for method in METHODS]
        terms = float(first.open_duration), float(first.contact_duration)
        computed = (float(first.k_dyn), float(second.k_dyn), terms[0], sum(terms))
        plant = (
            *(run.k_dyn_first_contact for run in runs),
            runs[0].first_contact,
            sum(runs[0].stage_durations),
        )
        for name, text, form, by_plant in zip(QUANTITIES, printed, computed, plant, strict=True):
            rows.append((ratio, gap, r, name, text, form, by_plant, _note(text, form, terms)))
    columns = ("J2/J1", "gap, rad", "M1/Ms", "quantity", "printed", "closed form", "plant", "note")
    return Table("Worked example: the check table recomputed", columns, rows)


def _note(printed: str, exact: float, terms: tuple[float, ...]) -> str:
    if f"{exact:.4f}" == printed:
        return "all digits"
    if f"{sum(round(term, 4) for term in terms):.4f}" == printed:
        return f"print adds rounded terms: {' + '.join(f'{term:.4f}' for term in terms)}"
    return "differs"


def agreement_table(drawn: Mapping[str, Sequence[Curve]]) -> Table:
    """Largest relative difference between plant and closed form, one row per figure."""
    return Table.of("Plant against closed form", {
        "figure of [G]": drawn,
        "curves": map(len, drawn.values()),
        "simulated points": [len(curves) * len(POINTS) for curves in drawn.values()],
        "largest relative difference": [max(one.disagreement for one in curves) for curves in drawn.values()],
    })  # fmt: skip


def figure(number: str, curves: Sequence[Curve]) -> Any:
    """A figure of [G]: curves over M1/Ms, a colour for each gap or inertia, and the plant's points."""
    times = number == "4"
    kinds, scale = (3, 1000.0) if times else (2, 1.0)
    with drawing():
        drawn, axes = new_figure(1, 1, (8.0, 5.0))
        for index, curve in enumerate(curves):
            colour, kind = COLOURS[index // kinds], index % kinds
            look: dict[str, Any] = {"color": colour, "ls": DASHES[kind]}
            marks: dict[str, Any] = {"marker": "os^"[kind], "ms": 4.5, "mec": colour, "mfc": "white"}
            axes.plot(RATIOS, scale * curve.values, **look, zorder=2)
            axes.plot(POINTS, scale * curve.points, **marks, ls="none", zorder=3)
            axes.plot([], [], **look, **marks, label=curve.label)
        worst = max(curve.disagreement for curve in curves)
        across = f"$M_1/M_s$     (lines: closed form; points: exact plant, at most {worst:.0e} off)"
        head(axes, TITLES[number], "time, ms" if times else K_DYN, across)
        axes.set(xlim=(0.0, 1.02), ylim=(0.0, 250.0 if times else 5.2 if number == "3" else 3.5))
        axes.legend(loc="upper right" if times else "upper left", handlelength=3.2)
    return drawn
