"""Figures 2 and 3 of [B]: moments of first order over the speed."""

from __future__ import annotations

from typing import Any

from softstart.balancing import Balance
from softstart.views.drawing import COLOURS, DASHES, GREY, drawing, legend_above, new_figure
from softstart_studies.paper_b.tables import curves
from softstart_studies.paper_b.vaz import MOMENTS, TUNING

TOP = 440.0  # N m


def over_speed(found: Balance) -> tuple[Any, Any]:
    """Figure 2, balancing moment against the reaction torque; and 3, its parts: first order, full load."""
    one = curves(found)
    lines = (("both", one.both, 6, 0), ("gas", one.gas, 1, 1), ("inertia", one.inertia, 2, 2))
    with drawing():
        second, axes = new_figure(1, 1, (8.0, 4.8))
        axes.plot(one.rpm, one.both, color=COLOURS[6], label="reaction torque, first order (model)")
        axes.plot(one.rpm, one.sine, color=COLOURS[2], ls=DASHES[2], label="its sine (model)")
        axes.plot(one.rpm, one.shafts, color=COLOURS[0], label="$M_b(n)$ of the shafts, h fixed (model)")
        for look, (reading, moment) in zip((1, 3), MOMENTS, strict=True):
            label = f"$M_b(n)$ by (5), read with {reading} (printed)"
            axes.plot(one.rpm, moment * one.rpm**2, label=label, color=COLOURS[look], ls=DASHES[look])
        axes.set_ylim(0.0, TOP)
        axes.set_ylabel("moment of first order, N m")
        axes.legend(loc="upper left")
        third, other = new_figure(1, 1, (8.0, 4.4))
        for name, values, colour, dash in lines:
            other.plot(one.rpm, values, color=COLOURS[colour], ls=DASHES[dash], label=name)
        other.set_ylim(bottom=0.0)
        other.set_ylabel("torque of first order, N m")
        legend_above(other, 3)
        titles = "What fig. 2 of [B] shows: VAZ-11113, full load, with assumed values", \
            "What fig. 3 of [B] shows: VAZ-11113, full load"  # fmt: skip
        for one_axes, title in zip((axes, other), titles, strict=True):
            one_axes.axvline(TUNING, color=GREY, lw=0.9, ls=":")
            one_axes.set_xlim(one.rpm[0], one.rpm[-1])
            one_axes.set_xlabel("crank speed, rpm     (dotted: tuning speed)")
            one_axes.set_title(title, loc="left")
    return second, third
