"""Maps over gap and load inertia."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softstart.reporting.markup import Html, html, tag
from softstart.reporting.pictures import maps_figure
from softstart.reporting.values import digits, fixed, short

if TYPE_CHECKING:
    from softstart.reporting.choice import Candidate
    from softstart.reporting.figure_list import Figures
    from softstart.reporting.result import Report

MOST = 4  # maps


def robustness_section(report: Report, figures: Figures) -> Html:
    """The maps of the strategies that matter, in one scale of colours."""
    shown = _shown(report)
    first = shown[0].map
    drive = report.drive
    gap, inertia = float(drive.gap), float(drive.J2)
    gaps = f"gaps from {digits(first.gaps[0], 3)} to {digits(first.gaps[-1], 3)} rad"
    if gap == 0.0:
        gaps = "no gap (the drive has none, so the maps have one row and say nothing about play)"
    text = (
        f"Gears wear and loads change. Each strategy was set up once, for the drive as it is, and then "
        f"started at "
        f"{gaps} and load inertias from {short(first.inertias[0])} to {short(first.inertias[-1])} kg m². "
        f"K_dyn refers "
        "to the drive as it is everywhere, so the numbers compare shaft torques."
    )
    nominal = (
        min(first.gaps, key=lambda v: abs(v - gap)),
        min(first.inertias, key=lambda v: abs(v - inertia)),
    )
    title = "K_dyn over gap and load inertia: " + "; ".join(
        f"{one.name}, worst {fixed(one.worst, 3)} at gap {short(one.map.worst_at[0])} rad and J2 "
        f"{short(one.map.worst_at[1])} kg m²"
        for one in shown
    )
    caption = (
        "K_dyn over gap and load inertia, all maps in one scale of colours, dark is gentle. Framed: the "
        "drive as it "
        "is. Grey: the load does not reach its target speed."
    )
    return html(tag("p", text), figures.drawn(maps_figure(shown, nominal), title, caption))


def _shown(report: Report) -> list[Candidate]:
    """The recommended one, the best ordinary one, direct, and those with the least worst case besides."""
    choice = report.choice
    others = sorted(
        (one for one in choice.candidates if one.means.realisable),
        key=lambda one: math.inf if math.isnan(one.worst) else one.worst,
    )
    first = [choice.recommended, choice.ordinary, choice.of("direct")]
    return list(dict.fromkeys([one for one in first if one is not None] + others))[:MOST]
