"""The tables: formulas (4) and (5) beside the model, moments and designs over the speed, assumptions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softstart.arrays import Vector
from softstart.balancing import Balance
from softstart.balancing.design import free_force
from softstart.study import Table
from softstart_studies.paper_b.vaz import (
    FORCE,
    MOMENTS,
    RADIUS,
    RPM,
    TUNING,
    VARIED,
    VAZ,
    first_order,
    left_at_load,
)


def printed_and_model() -> Table:
    """Side by side: what follows from the printed formulas, and the model, which is not fitted to them."""
    shafts, w = abs(free_force(VAZ)), TUNING * RPM
    cosine, sine, amplitude = first_order()
    given, force = FORCE / RPM**2, FORCE * TUNING**2
    rows: list[tuple[object, ...]] = []
    for imbalance, note in (
        (2.0 * shafts, "model: the whole first-order force, counterweights and shafts together"),
        (shafts, "model: the shafts alone, half of the first-order force"),
    ):
        rows += [
            ("F_b/n^2, (4)", "N/rpm^2", FORCE, round(imbalance * RPM**2, 8), note),
            ("F_b at 4500 rpm", "N", force, round(imbalance * w**2, 2), note),
            ("m r", "kg m", round(given, 6), round(imbalance, 6), note),
            ("m on r = 35.5 mm", "kg", round(given / RADIUS, 4), round(imbalance / RADIUS, 4), note),
        ]
    for reading, moment in MOMENTS:
        note, h = f"(5) read with {reading}", round(1e3 * moment / FORCE, 3)
        rows += [
            ("M_b at 4500 rpm", "N m", round(moment * TUNING**2, 3), round(sine, 3), f"{note}; model: sine"),
            ("h = M_b/F_b", "mm", h, round(1e3 * sine / (shafts * w**2), 3),
             f"{note}; model: its sine over the force of its shafts"),
            ("h = M_b/F_b", "mm", h, round(1e3 * sine / force, 3),
             f"{note}; model: its sine over the printed F_b"),
        ]  # fmt: skip
    rows += [
        ("cosine of the first order", "N m", None, round(cosine, 3), "no arm h balances it"),
        ("amplitude of the first order", "N m", None, round(amplitude, 3),
         "a rough estimate for an engine of 0.75 l is near 150; [B] prints none"),
    ]  # fmt: skip
    columns = ("quantity", "unit", "printed", "model", "note")
    return Table("Formulas (4) and (5): printed and by the engine model", columns, rows)


class Curves(NamedTuple):
    """First orders over the speed in rpm, amplitudes in N m, and the moment of the shafts with h fixed."""

    rpm: Vector
    gas: Vector
    inertia: Vector
    both: Vector
    sine: Vector
    shafts: Vector


def curves(found: Balance) -> Curves:
    """The curves of figures 2 and 3 at full load.

    >>> from softstart_studies.paper_b.vaz import balanced
    >>> one = curves(balanced())
    >>> bool(abs(one.sine - one.shafts).min() < 1e-9)
    True
    """
    w = found.speeds
    gas = np.array([VAZ.gas_harmonics(float(speed), 1.0)[2] for speed in w])
    inertia = VAZ.inertia_harmonics[2] * w**2
    height = found.residual("fixed-h").height
    assert height is not None
    both, shafts = gas + inertia, found.imbalance * height * w**2
    return Curves(w / RPM, np.abs(gas), np.abs(inertia), np.abs(both), -both.imag, shafts)


def loads() -> Table:
    """What the arm for full load leaves at other loads."""
    rows = []
    for load, n in ((load, n) for load in (1.0, 0.5, 0.0) for n in (850.0, 3200.0, 4500.0, 5600.0)):
        left = (*left_at_load(load, n), left_at_load(load, n, sideways=True)[1])
        rows.append((load, n, *(round(one, 2) for one in left)))
    columns = ("load", "n, rpm", "without shafts", "with h(n) of load 1", "with h(n), e(n) of load 1")
    return Table("First-order moment left at other loads, N m", columns, rows)


def assumptions() -> Table:
    """The first-order reaction torque with one assumption changed at a time."""
    base = [round(one, 1) for one in first_order()]
    rows: list[tuple[object, ...]] = [("as assumed", *base, *base)]
    for what, (key, *two) in VARIED.items():
        rows.append((what, *(round(one, 1) for value in two for one in first_order({key: value}))))
    parts = [f"{part}, {which}" for which in ("first", "second") for part in ("cosine", "sine", "amplitude")]
    columns = ("assumption, first and second value", *parts)
    return Table("First-order reaction torque at 4500 rpm in N m", columns, rows)
