"""The figures of the study: they draw what the other files found and compute nothing."""

from __future__ import annotations

from typing import Any

from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure
from softstart_studies.paper_b.over_speed import Course
from softstart_studies.paper_b.vaz import MOMENTS, TUNING

TOP = 440.0  # N m


def figure_2(course: Course) -> Any:
    """Balancing moment against the reaction torque of first order."""
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.8))
        axes.plot(course.rpm, course.both, color=COLOURS[6], label="reaction torque, first order (model)")
        axes.plot(course.rpm, course.sine, color=COLOURS[2], ls=DASHES[2], label="its sine (model)")
        axes.plot(
            course.rpm, course.shafts, color=COLOURS[0], label="$M_b(n)$ of the shafts, h fixed (model)"
        )
        for index, (reading, moment) in enumerate(MOMENTS):
            label = f"$M_b(n)$ by (5), read with {reading} (printed)"
            style = {"color": COLOURS[1 + 2 * index], "ls": DASHES[1 + 2 * index]}
            axes.plot(course.rpm, moment * course.rpm**2, label=label, **style)
        axes.axvline(TUNING, color="#666666", lw=0.9, ls=":")
        axes.set_ylim(0.0, TOP)
        axes.set_xlim(course.rpm[0], course.rpm[-1])
        axes.set_xlabel("crank speed, rpm     (dotted: tuning speed)")
        axes.set_ylabel("moment of first order, N m")
        axes.set_title("What fig. 2 of [B] shows: VAZ-11113, full load, with assumed values", loc="left")
        axes.legend(loc="upper left")
    return figure


def figure_3(course: Course) -> Any:
    """Gas and inertia of first order over the speed."""
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.4))
        axes.plot(course.rpm, course.both, color=COLOURS[6], label="both")
        axes.plot(course.rpm, course.gas, color=COLOURS[1], ls=DASHES[1], label="gas")
        axes.plot(course.rpm, course.inertia, color=COLOURS[2], ls=DASHES[2], label="inertia")
        axes.axvline(TUNING, color="#666666", lw=0.9, ls=":")
        axes.set_ylim(bottom=0.0)
        axes.set_xlim(course.rpm[0], course.rpm[-1])
        axes.set_xlabel("crank speed, rpm     (dotted: tuning speed)")
        axes.set_ylabel("torque of first order, N m")
        axes.set_title("What fig. 3 of [B] shows: VAZ-11113, full load", loc="left")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.1)
    return figure
