"""Which reading of the paper, or which plain slip in its arithmetic, gives the printed numbers: a search.

Every combination of the choices below is computed for every law, and a printed number counts as met if it is
what the reading gives, rounded or cut to the digits printed. With so many readings some numbers are met by
chance; a reading explains the table only if it meets several.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import cumulative_simpson, simpson

from softstart.arrays import Vector
from softstart.clutch import Clutch, engage
from softstart.study import Table
from softstart_studies.paper_c.printed import PRINTED

w0, MM, Mc, tM, cp = 230.0, 60.0, 20.0, 1.0, 5.0  # kgf m, s
LOADS = ("acts from t = 0", "stands until the shaft carries it", "carried by the shaft before t = 0")
OWN = "as (1) has it", "A of the other sign", "A = 0"  # of (6): the arctangent leaves the quadrant open
INERTIAS = ("as printed", "exchanged")
CARRIED = (
    "phi, phi'", "phi, phi' = 0", "phi = 0, phi'", "phi = 0, phi' = 0", "phi, -phi'", "A1 of the other sign"
)  # fmt: skip
SLIPS = ("clutch side", "load")
ROOTS = ("first", "without oscillation")
PEAKS = ("largest up to tau1", "largest up to tM", "mean + amplitude")
POWERS = {"linear": (1.0, 0.0), "quadratic-concave": (2.0, -1.0), "quadratic-convex": (0.0, 1.0)}


class Reading(NamedTuple):
    """One way of reading the paper, by its choice of each kind, and what it gives: work and peak in kgf m."""

    law: str
    choices: tuple[str, ...]
    L: float
    Md: float


USUAL = (LOADS[0], OWN[0], INERTIAS[0], CARRIED[0], SLIPS[0], ROOTS[0], PEAKS[0])


@cache
def readings(law: str) -> tuple[Reading, ...]:
    """All readings of a law.

    >>> ours = next(one for one in readings("linear") if one.choices == USUAL)
    >>> round(ours.L), round(ours.Md, 2)
    (27141, 64.66)
    """
    found = []
    for load, own, inertias in product(LOADS, OWN, INERTIAS):
        if load == LOADS[1] and own != OWN[0]:
            continue  # while the load stands, (6) does not hold
        IM, Ic = (0.1, 0.5) if inertias == INERTIAS[0] else (0.5, 0.1)
        start = _engaging(law, load, own, IM, Ic)
        for carried, slip, root in product(CARRIED, SLIPS, ROOTS):
            L, peaks = _slipping(start, carried, slip, root, IM, Ic)
            for peak, Md in zip(PEAKS, peaks, strict=True):
                found.append(Reading(law, (load, own, inertias, carried, slip, root, peak), L, Md))
    return tuple(found)


class _Start(NamedTuple):
    """At tM: twist, its rate, both speeds; work up to here by both slips, largest torque."""

    z: float
    v: float
    wM: float
    wc: float
    work: tuple[float, float]
    top: float


def _engaging(law: str, load: str, own: str, IM: float, Ic: float) -> _Start:
    """(1) up to tM, integrated; or the closed form with its own oscillation A changed."""
    t = np.linspace(0.0, tM, 601)
    if load == LOADS[1]:
        return _standing(law, t, IM, Ic)
    if law in POWERS:
        k, q = POWERS[law]
        M = MM * (k * t + q * t * t)
    else:
        M = MM * np.expm1(t) / math.expm1(1.0)
    z0 = Mc / cp if load == LOADS[2] else 0.0
    B = math.sqrt(cp * (1.0 / IM + 1.0 / Ic))
    forced, rate = _forced(law, t, B, IM, Ic)
    factor = dict(zip(OWN, (1.0, -1.0, 0.0), strict=True))[own]
    a, b = factor * (z0 - forced[0]), -factor * rate[0] / B
    z = a * np.cos(B * t) + b * np.sin(B * t) + forced
    v = B * (b * np.cos(B * t) - a * np.sin(B * t)) + rate
    wM = cumulative_simpson((M - cp * z) / IM, x=t, initial=0.0)
    wc = cumulative_simpson((cp * z - Mc) / Ic, x=t, initial=0.0)
    work = tuple(float(simpson(M * (w0 - w), x=t)) for w in (wM, wc))
    return _Start(
        float(z[-1]), float(v[-1]), float(wM[-1]), float(wc[-1]), (work[0], work[1]), cp * float(z.max())
    )


def _forced(law: str, t: Vector, B: float, IM: float, Ic: float) -> tuple[Vector, Vector]:
    """A solution of (4) without oscillation, and its rate."""
    load = Mc / Ic / B**2
    if law not in POWERS:
        a = MM / math.expm1(1.0) / IM
        grown = a * np.exp(t) / (1.0 + B**2)
        return grown - a / B**2 + load, grown
    k, q = (MM / IM / B**2 * one for one in POWERS[law])
    return k * t + q * (t * t - 2.0 / B**2) + load, k + 2.0 * q * t


def _standing(law: str, t: Vector, IM: float, Ic: float) -> _Start:
    """A load that stands until the shaft carries it, by the exact clutch; all in kgf m."""
    clutch = Clutch(
        clutch_inertia=IM, clutch_torque=MM, drive_speed=w0, engagement_time=tM, stiffness=cp,
        load_inertia=Ic, load_torque=Mc, load_kind="reactive", law=law,
    )  # fmt: skip
    run = engage(clutch, until=tM)
    at = run.at(t)
    work = [float(simpson(at["M"] * (w0 - at[w]), x=t)) for w in ("wM", "wc")]
    z, v, wM, wc = (float(at[name][-1]) for name in ("theta", "v", "wM", "wc"))
    return _Start(z, v, wM, wc, (work[0], work[1]), run.peak_torque)


def _slipping(
    start: _Start, carried: str, slip: str, root: str, IM: float, Ic: float
) -> tuple[float, tuple[float, float, float]]:
    """(3) and (2) from tM on, in closed form; speeds go on from where they were."""
    B, mean = math.sqrt(cp * (1 / IM + 1 / Ic)), (MM * Ic + Mc * IM) / (IM + Ic) / cp
    z = 0.0 if "phi = 0" in carried else start.z
    v = 0.0 if "phi' = 0" in carried else (-start.v if "-phi'" in carried else start.v)
    a, b = z - mean, v / B
    if carried == CARRIED[-1]:
        a, b = -a, -b
    s = np.linspace(0.0, 8.0, 4001)
    twist = mean + a * np.cos(B * s) + b * np.sin(B * s)
    turn = (a * np.sin(B * s) - b * (np.cos(B * s) - 1.0)) / B
    if slip == SLIPS[0]:
        steady, swing = start.wM + (MM - cp * mean) * s / IM, -cp * turn / IM
    else:
        steady, swing = start.wc + (cp * mean - Mc) * s / Ic, cp * turn / Ic
    end = int(np.argmax(steady + (swing if root == ROOTS[0] else 0.0) >= w0))
    inside = slice(0, end + 1)
    work = float(simpson(MM * (w0 - steady - swing)[inside], x=s[inside]))
    whole = max(start.top, cp * float(twist[inside].max()))
    L = start.work[0 if slip == SLIPS[0] else 1] + work
    return L, (whole, start.top, cp * (mean + math.hypot(a, b)))


def meets(value: float, printed: float) -> bool:
    """Whether a value is printed so, rounded or cut: 28729 for 28729.9, 64.6 for 64.66."""
    digit = 1.0 if printed > 1000 else 0.1
    return printed - 0.5 * digit <= value < printed + digit


def search_table() -> tuple[Table, bool]:
    """How many readings meet each printed number, and whether one set of choices meets more than one."""
    rows = []
    met: list[tuple[str, ...]] = []
    for row in PRINTED:
        every = [one for law in row.readings for one in readings(law)]
        # the work does not depend on which peak is read, the peak on little else: each is counted once
        works: Any = {(one.law, *one.choices[:-1]): one for one in every}
        peaks: Any = {(one.law, *one.choices[:3], round(one.Md, 2)): one for one in every}
        for figure, printed, different in (("L", row.L, works), ("Md", row.Md, peaks)):
            found = [one for one in different.values() if meets(getattr(one, figure), printed)]
            met += {one.choices for one in found}
            rows.append((row.law, figure, float(printed), len(different), len(found)))
    columns = ("law", "figure", "printed, kgf m", "different readings", "readings that meet it")
    table = Table("Which reading gives the printed numbers", columns, rows)
    return table, max((met.count(one) for one in met), default=0) > 1
