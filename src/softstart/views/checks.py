"""What the page shows of its checks: start positions, and margins to the limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from softstart.drive import UNKNOWN_POSITIONS
from softstart.start.comparison import Comparison
from softstart.start.run import Run
from softstart.views.numbers import TextTable, number, short
from softstart.views.sheet import Sheet


def positions_sheet(runs: Mapping[str, Run], reasons: Sequence[str] = ()) -> Sheet:
    """K_dyn from each start position, of starts by label; `reasons` why there is only one position."""
    title = "K_dyn by start position"
    rows = [
        [label, *(number(start.k_dyn, 3) for start in (*run.positions.values(), run))]
        for label, run in sorted(runs.items(), key=lambda item: item[1].k_dyn)
    ]
    if not rows or len(rows[0]) < 3:
        reasons = reasons or ["There is no gap, or it is preloaded."]
        return Sheet(title, notes=["There is only one start position.", *reasons])
    names = (position.replace("-", " ") for position in UNKNOWN_POSITIONS)
    return Sheet(title, tables=[TextTable.of_rows("", ("strategy",), (*names, "worst"), rows)])


def margins_sheet(comparison: Comparison) -> Sheet:
    """The worst figure of each strategy beside each limit, and the smallest margin; the largest first."""
    title, limits = "Margins to the limits", comparison.recommendation.limits
    if not limits:
        return Sheet(title, notes=["No limits are given: enter them under Limits, on the left."])
    shares = {row.name: math.nan if (m := row.least_margin) is None else m.share for row in comparison.rows}
    ranked = sorted(
        comparison.rows, key=lambda row: math.inf if math.isnan(shares[row.name]) else -shares[row.name]
    )
    rows = [
        [row.name, row.against_limits, (least.case if (least := row.least_margin) else "") or "as it is",
         *(short(float(f"{margin.value:.4g}")) for margin in row.margins(limits))]
        for row in ranked
    ]  # fmt: skip
    heads = [
        f"{margin.name}\n{margin.unit}, at most {margin.limit:.4g}" for margin in ranked[0].margins(limits)
    ]
    return Sheet(
        title, tables=[TextTable.of_rows("", ("strategy", "least margin", "worst with"), heads, rows)]
    )
