"""Formulas (4) and (5) of [B] as printed, and what the engine model gives."""

from __future__ import annotations

from softstart.balancing.design import free_force
from softstart.study import Table
from softstart_studies.paper_b.vaz import FORCE, MOMENTS, RADIUS, RPM, TUNING, VAZ, first_order

W = TUNING * RPM
COLUMNS = ("quantity", "unit", "printed", "model", "note")
WHOLE = "model: the whole first-order force, counterweights and shafts together"
SHAFTS = "model: the shafts alone, half of the first-order force"


def imbalances() -> tuple[float, float]:
    """Imbalance in kg m of the whole first-order force of the model, and of its two shafts.

    >>> [round(one, 5) for one in imbalances()]
    [0.04828, 0.02414]
    """
    shafts = abs(free_force(VAZ))
    return 2.0 * shafts, shafts


def printed_force(rpm: float = TUNING) -> float:
    """F_b in N by (4).

    >>> round(printed_force(), 1)
    10084.5
    """
    return FORCE * rpm**2


def printed_imbalance() -> float:
    """Imbalance m r in kg m that (4) is.

    >>> round(printed_imbalance(), 4), round(printed_imbalance() / RADIUS, 2)
    (0.0454, 1.28)
    """
    return FORCE / RPM**2


def printed_arm(moment: float) -> float:
    """Arm h = M_b/F_b in m by (4) and (5), the same at all speeds.

    >>> [round(1000 * printed_arm(m), 2) for _, m in MOMENTS]
    [42.15, 4.21]
    """
    return moment / FORCE


def table() -> Table:
    """Side by side: what follows from the printed formulas, and the model, which is not fitted to them."""
    whole, shafts = imbalances()
    cosine, sine = first_order(VAZ, TUNING)
    rows: list[tuple[object, ...]] = []
    for imbalance, note in ((whole, WHOLE), (shafts, SHAFTS)):
        rows += [
            ("F_b/n^2, (4)", "N/rpm^2", FORCE, round(imbalance * RPM**2, 8), note),
            ("F_b at 4500 rpm", "N", printed_force(), round(imbalance * W**2, 2), note),
            ("m r", "kg m", round(printed_imbalance(), 6), round(imbalance, 6), note),
            (
                "m on r = 35.5 mm",
                "kg",
                round(printed_imbalance() / RADIUS, 4),
                round(imbalance / RADIUS, 4),
                note,
            ),
        ]
    for reading, moment in MOMENTS:
        note = f"(5) read with {reading}"
        rows += [
            ("M_b at 4500 rpm", "N m", round(moment * TUNING**2, 3), round(sine, 3), f"{note}; model: sine"),
            ("h = M_b/F_b", "mm", round(1e3 * printed_arm(moment), 3), round(1e3 * sine / (shafts * W**2), 3),
             f"{note}; model: its sine over the force of its shafts"),
            ("h = M_b/F_b", "mm", round(1e3 * printed_arm(moment), 3), round(1e3 * sine / printed_force(), 3),
             f"{note}; model: its sine over the printed F_b"),
        ]  # fmt: skip
    rows += [
        ("cosine of the first order", "N m", None, round(cosine, 3), "no arm h balances it"),
        ("amplitude of the first order", "N m", None, round((cosine**2 + sine**2) ** 0.5, 3),
         "a rough estimate for an engine of 0.75 l is near 150; [B] prints none"),
    ]  # fmt: skip
    return Table("Formulas (4) and (5): printed and by the engine model", COLUMNS, rows)
