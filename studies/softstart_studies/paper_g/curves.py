"""Figures 2, 3 and 4 of [G] and the check table: closed forms, and the plant at points on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from softstart.arrays import Vector
from softstart.study import Table
from softstart_studies.paper_g.crane import (
    CRANE,
    GAP_1,
    GAP_2,
    HEAVY,
    LIGHT,
    METHODS,
    POINTS,
    RATIOS,
    Method,
    base,
    closed_form,
    crane,
    simulated,
)

# J2/J1, gap in rad, r, and what the check table gives: K method 1, K method 2, t1, t1 + t2 of method 1
PRINTED = (
    (5, 0.5, 1.0, "3.1179", "3.1179", "0.0166", "0.0533"),
    (5, 0.5, 0.25, "2.3894", "1.2677", "0.0321", "0.0743"),
    (5, 2.0, 1.0, "4.8654", "4.8654", "0.0332", "0.0658"),
    (5, 2.0, 0.25, "3.1729", "2.2144", "0.0643", "0.1008"),
    (2, 0.5, 1.0, "2.7157", "2.7157", "0.0163", "0.0485"),
)
QUANTITIES = ("K method 1", "K method 2", "t1, s", "t1 + t2 method 1, s")


@dataclass(frozen=True)
class Curve:
    """One curve of a figure over M1/Ms, and the plant's values at some points of it."""

    label: str
    r: Vector
    values: Vector
    at: Vector
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
    runs = [simulated(drive, float(r), method, CRANE) for r in POINTS]
    return Curve(
        label,
        RATIOS,
        np.asarray(closed_form(drive, RATIOS, method, base()).k_dyn),
        POINTS,
        np.asarray(closed_form(drive, POINTS, method, base()).k_dyn),
        np.array([run.k_dyn_first_contact for run in runs]),
    )


def duration_curve(gap: float, method: Method | None, label: str) -> Curve:
    """Length in s of stages 1 + 2 by [G](3) and (15), or of stage 1 alone where no method is named."""
    drive = crane(HEAVY, gap)
    runs = [simulated(drive, float(r), method or 1) for r in POINTS]
    on_curve, at_points = (closed_form(drive, r, method or 1) for r in (RATIOS, POINTS))
    with_contact = 0.0 if method is None else 1.0
    return Curve(
        label,
        RATIOS,
        np.asarray(on_curve.open_duration + with_contact * on_curve.contact_duration),
        POINTS,
        np.asarray(at_points.open_duration + with_contact * at_points.contact_duration),
        np.array([run.stage_durations[0] + with_contact * run.stage_durations[1] for run in runs]),
    )


def figure_2() -> list[Curve]:
    """K_dyn for J2' and J2'' at delta1, both methods."""
    return [
        k_dyn_curve(ratio, GAP_1, method, f"$J_2{prime} = {ratio}\\,J_1$, method {method}")
        for ratio, prime in ((HEAVY, "''"), (LIGHT, "'"))
        for method in METHODS
    ]


def figure_3() -> list[Curve]:
    """K_dyn for delta1 and delta2 at J2'', both methods."""
    return [
        k_dyn_curve(HEAVY, gap, method, f"$\\delta_{index} = {gap:g}$ rad, method {method}")
        for index, gap in ((2, GAP_2), (1, GAP_1))
        for method in METHODS
    ]


def figure_4() -> list[Curve]:
    """Length of stages 1 + 2 for both methods and of stage 1, both gaps, at J2''."""
    spans: tuple[tuple[Method | None, str], ...] = (
        (1, "$t_1 + t_2$, method 1"),
        (2, "$t_1 + t_2$, method 2"),
        (None, "$t_1$"),
    )
    return [
        duration_curve(gap, method, f"$\\delta_{index} = {gap:g}$ rad, {what}")
        for index, gap in ((2, GAP_2), (1, GAP_1))
        for method, what in spans
    ]


def worked_table() -> Table:
    """The check table: as printed, by closed form, and by the plant.

    The check table adds durations already rounded: 0.0321 + 0.0422 is given as 0.0743, where t1 + t2 is
    0.074396 s, and 0.0163 + 0.0322 as 0.0485, where it is 0.048550 s. The last column says so.
    """
    rows: list[tuple[object, ...]] = []
    for ratio, gap, r, *printed in PRINTED:
        drive = crane(ratio, gap)
        forms = [closed_form(drive, r, method, base()) for method in METHODS]
        runs = [simulated(drive, r, method, CRANE) for method in METHODS]
        opened, closed = float(forms[0].open_duration), float(forms[0].contact_duration)
        computed = (float(forms[0].k_dyn), float(forms[1].k_dyn), opened, opened + closed)
        by_plant = (
            runs[0].k_dyn_first_contact,
            runs[1].k_dyn_first_contact,
            runs[0].first_contact,
            sum(runs[0].stage_durations),
        )
        for name, text, form, plant in zip(QUANTITIES, printed, computed, by_plant, strict=True):
            rows.append(
                (
                    ratio,
                    gap,
                    r,
                    name,
                    text,
                    round(form, 6),
                    round(plant, 6),
                    _note(text, form, (opened, closed)),
                )
            )
    return Table(
        "Worked example: the check table recomputed",
        ("J2/J1", "gap, rad", "M1/Ms", "quantity", "printed", "closed form", "plant", "note"),
        rows,
    )


def _note(printed: str, exact: float, terms: tuple[float, ...]) -> str:
    if f"{exact:.4f}" == printed:
        return "all digits"
    if f"{sum(round(term, 4) for term in terms):.4f}" == printed:
        return f"print adds rounded terms: {' + '.join(f'{term:.4f}' for term in terms)}"
    return "differs"


def agreement_table(figures: Mapping[str, Sequence[Curve]]) -> Table:
    """Largest relative difference between plant and closed form, one row per figure."""
    rows = []
    for name, curves in figures.items():
        points = sum(len(curve.at) for curve in curves)
        rows.append((name, len(curves), points, max(curve.disagreement for curve in curves)))
    return Table(
        "Plant against closed form",
        ("figure of [G]", "curves", "simulated points", "largest relative difference"),
        rows,
    )
