"""Figures 2 and 3 of [B]: moments of first order over the speed; the designs of the balancer over it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.balancing import Balance
from softstart.balancing.design import arm, free_force
from softstart.balancing.engine import moment_harmonic
from softstart.study import Table
from softstart.views.drawing import COLOURS, DASHES, GREY, drawing, legend_above, new_figure
from softstart_studies.paper_b.vaz import LOADS, MOMENTS, RPM, SPEEDS, TUNING, VAZ


@dataclass(frozen=True)
class Curves:
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
    speeds = found.speeds
    gas = np.array([VAZ.gas_harmonics(float(w), 1.0)[2] for w in speeds])
    inertia = VAZ.inertia_harmonics[2] * speeds**2
    fixed = found.residual("fixed-h")
    assert fixed.height is not None
    both = gas + inertia
    return Curves(
        speeds / RPM,
        np.abs(gas),
        np.abs(inertia),
        np.abs(both),
        -both.imag,
        found.imbalance * fixed.height * speeds**2,
    )


def curves_table(found: Balance) -> Table:
    """Figures 2 and 3 in numbers."""
    one = curves(found)
    rows = []
    for n in SPEEDS.tolist():
        i = int(np.argmin(np.abs(one.rpm - n)))
        values = (one.gas[i], one.inertia[i], one.both[i], one.sine[i], one.shafts[i])
        rows.append((n, *(round(float(v), 2) for v in values), *(round(m * n**2, 2) for _, m in MOMENTS)))
    columns = (
        "n, rpm",
        "gas",
        "inertia",
        "both",
        "sine of both",
        "M_b of the model, h fixed",
        "M_b printed, 1e-5",
        "M_b printed, 1e-6",
    )
    return Table("Figures 2 and 3: first-order moments in N m at full load", columns, rows)


def designs_table(found: Balance) -> Table:
    """The first-order moment that each design leaves, and its arm."""
    rows = []
    for n in SPEEDS.tolist():
        i = int(np.argmin(np.abs(found.speeds / RPM - n)))
        last = found.residual("variable-h-e")
        assert last.height is not None
        assert last.offset is not None
        left = [round(float(one.first_order[i]), 2) for one in found.residuals]
        rows.append((n, *left, round(1e3 * float(last.height[i]), 2), round(1e3 * float(last.offset[i]), 2)))
    names = [one.name for one in found.residuals]
    columns = ("n, rpm", *names, "h(n), mm", "e(n), mm")
    return Table("First-order moment left on the housing, N m, at full load", columns, rows)


def left_at_load(load: float, rpm: float, *, sideways: bool = False) -> tuple[float, float]:
    """First-order moment in N m without shafts at a load, and what the arm for full load leaves of it.

    >>> [round(one, 9) for one in left_at_load(1.0, 4500.0, sideways=True)][1]
    0.0
    """
    w = rpm * RPM
    place = arm(VAZ, w, 1.0)
    place = place if sideways else complex(place.real)
    torque = VAZ.torque_harmonics(w, load)[2]
    balancing = w**2 * moment_harmonic(place, -free_force(VAZ), forward=False)
    return float(abs(torque)), float(abs(balancing - torque))


def loads_table() -> Table:
    """What the arm for full load leaves at other loads."""
    rows = []
    for load in LOADS:
        for n in (850.0, 3200.0, 4500.0, 5600.0):
            without, with_h = left_at_load(load, n)
            rows.append(
                (load, n, *(round(v, 2) for v in (without, with_h, left_at_load(load, n, sideways=True)[1])))
            )
    columns = ("load", "n, rpm", "without shafts", "with h(n) of load 1", "with h(n), e(n) of load 1")
    return Table("First-order moment left at other loads, N m", columns, rows)


def tuned_without_phase() -> float:
    """What is left in N m at the tuning speed if M_b is made equal in amplitude, not in the sine.

    >>> tuned_without_phase() > left_at_load(1.0, 4500.0)[1]
    True
    """
    first = VAZ.torque_harmonics(4500.0 * RPM, 1.0)[2]
    return float(abs(first + 1j * abs(first)))  # M_b = |M| sin(phi), which is -i |M|


def distance(found: Balance) -> tuple[float, float]:
    """Arm h(n) in mm at the lowest and at the highest speed."""
    last = found.residual("variable-h")
    assert last.height is not None
    return 1e3 * float(last.height[0]), 1e3 * float(last.height[-1])


def spread(values: Vector) -> float:
    """(largest - smallest)/mean in percent.

    >>> spread(np.array([1.0, 2.0, 3.0]))
    100.0
    """
    return float(100.0 * np.ptp(values) / math.fsum(values) * len(values))


TOP = 440.0  # N m


def figure_2(curves: Curves) -> Any:
    """Balancing moment against the reaction torque of first order."""
    with drawing():
        figure, axes = _over_speed(
            curves, 4.8, "What fig. 2 of [B] shows: VAZ-11113, full load, with assumed values"
        )
        axes.plot(curves.rpm, curves.both, color=COLOURS[6], label="reaction torque, first order (model)")
        axes.plot(curves.rpm, curves.sine, color=COLOURS[2], ls=DASHES[2], label="its sine (model)")
        axes.plot(
            curves.rpm, curves.shafts, color=COLOURS[0], label="$M_b(n)$ of the shafts, h fixed (model)"
        )
        for index, (reading, moment) in enumerate(MOMENTS):
            label = f"$M_b(n)$ by (5), read with {reading} (printed)"
            style = {"color": COLOURS[1 + 2 * index], "ls": DASHES[1 + 2 * index]}
            axes.plot(curves.rpm, moment * curves.rpm**2, label=label, **style)
        axes.set_ylim(0.0, TOP)
        axes.set_ylabel("moment of first order, N m")
        axes.legend(loc="upper left")
    return figure


def figure_3(curves: Curves) -> Any:
    """Gas and inertia of first order over the speed."""
    with drawing():
        figure, axes = _over_speed(curves, 4.4, "What fig. 3 of [B] shows: VAZ-11113, full load")
        axes.plot(curves.rpm, curves.both, color=COLOURS[6], label="both")
        axes.plot(curves.rpm, curves.gas, color=COLOURS[1], ls=DASHES[1], label="gas")
        axes.plot(curves.rpm, curves.inertia, color=COLOURS[2], ls=DASHES[2], label="inertia")
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel("torque of first order, N m")
        legend_above(axes, 3)
    return figure


def _over_speed(curves: Curves, height: float, title: str) -> Any:
    """A figure and its axes over the speed, with the tuning speed."""
    figure, axes = new_figure(1, 1, (8.0, height))
    axes.axvline(TUNING, color=GREY, lw=0.9, ls=":")
    axes.set_xlim(curves.rpm[0], curves.rpm[-1])
    axes.set_xlabel("crank speed, rpm     (dotted: tuning speed)")
    axes.set_title(title, loc="left")
    return figure, axes
