"""The figure of a chain's start: torques, speeds and twists over time."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure

if TYPE_CHECKING:
    from softstart.chain.run import ChainRun

__all__ = ["run_figure"]


def run_figure(run: ChainRun) -> Any:
    """Shaft torques with their located peaks, speeds of the masses, and where each twist is in its gap."""
    masses = [mass.name for mass in run.chain.masses]
    shafts = [f"{a} - {b}" for a, b in itertools.pairwise(masses)]
    gap = run.chain.at_motor_shaft().gap
    with drawing():
        figure, (torque, speed, twist) = new_figure(3, size=(8.0, 7.5), sharex=True)
        torque.plot(run.t, run.u, color="black", lw=1.0, label="motor")
        for k, name in enumerate(shafts):
            style = {"color": COLOURS[k % len(COLOURS)], "ls": DASHES[k // len(COLOURS) % len(DASHES)]}
            torque.plot(run.t, run.T[:, k], label=name, **style)
            at = run.at(run.peak_times[k])["T"][k]
            torque.plot(run.peak_times[k], at, "o", ms=4, color=style["color"])
            if gap[k] > 0.0:
                twist.plot(run.t, 2.0 * run.twist[:, k] / gap[k], label=name, **style)
        for i, name in enumerate(masses):
            colour, dash = COLOURS[i % len(COLOURS)], DASHES[i // len(COLOURS) % len(DASHES)]
            speed.plot(run.t, run.w[:, i], color=colour, ls=dash, label=name)
        for flank in (-1.0, 1.0):
            twist.axhline(flank, color="black", lw=0.8)
        torque.set_ylabel("torque, N m")
        speed.set_ylabel("speed, rad/s")
        twist.set_ylabel("twist over half the gap")
        twist.set_xlabel("time, s")
        torque.set_title(f"{run.chain.name}, at the motor shaft")
        for axes in (torque, speed, twist):
            if axes.get_legend_handles_labels()[0]:
                axes.legend(fontsize=7.5, ncols=2, loc="best")
    return figure
