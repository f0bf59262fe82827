"""How hard a start is on the shaft: dynamic coefficient, [G](16)-(18), and the two methods that lower it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softstart.stages.arguments import Value, checked, plain
from softstart.stages.contact import (
    contact_stage_duration,
    elastic_frequency,
    mean_shaft_torque,
    peak_shaft_torque,
)
from softstart.stages.open_gap import impact_speed, open_stage_duration
from softstart.stages.reactive import reactive_contact_stage_duration, reactive_peak_shaft_torque


class TwoStages(NamedTuple):
    """What the first opening and the first contact of a start come to, from `method_1` or `method_2`.

    Floats or arrays of one shape: `k_dyn` (no unit), `peak` of the shaft torque in N m, `open_duration` and
    `contact_duration` in s. The sum of the durations is fig. 4 of [G].

    >>> TwoStages(3.1, 164.8, 0.0166, 0.0367).k_dyn
    3.1
    """

    k_dyn: Value
    peak: Value
    open_duration: Value
    contact_duration: Value


def dynamic_coefficient(peak: ArrayLike, base: ArrayLike) -> Value:
    """K_dyn = |peak|/base, [G](16): the one place where a K_dyn is computed.

    `peak` and `base` in N m; `base` is `mean_shaft_torque(Ms, J1, J2, Mc)` of this drive or of the one it is
    compared with, and above zero (`InputError`). Source: [G], page 19.

    >>> round(dynamic_coefficient(164.81, 52.86), 4)
    3.1179
    """
    peak, base = checked(peak=peak, base=base)
    return plain(np.abs(peak) / base)


def dynamic_coefficient_of_impact(dw12: ArrayLike, c: ArrayLike, Omega: ArrayLike, base: ArrayLike) -> Value:
    """K_dyn when the full starting torque acts from contact on, active load, [G](17).

    `1 + sqrt(1 + (c dw12/(Omega base))^2)`, so never below 2. Arguments and errors as in `softstart.stages`.
    Source: [G], page 19.

    >>> round(dynamic_coefficient_of_impact(30.1027, 368.465, 112.397, 52.86), 4)
    3.1179
    """
    return dynamic_coefficient(peak_shaft_torque(base, dw12, c, Omega), base)


def dynamic_coefficient_of_stages(
    *,
    M1_open: ArrayLike,
    M1_contact: ArrayLike,
    J1: ArrayLike,
    J2: ArrayLike,
    c: ArrayLike,
    gap: ArrayLike,
    Mc_open: ArrayLike,
    Mc_contact: ArrayLike,
    base: ArrayLike,
) -> Value:
    """K_dyn with motor and load torque of their own in each stage, active load, [G](18).

    With `M(n) = M1(n) J2 + Mc(n) J1`, stage 1 open and stage 2 in contact:

        K_dyn = M(2)/((J1 + J2) base) (1 + sqrt(1 + Omega^2 J1 J2 gap M(1)/M(2)^2))

    `Mc_open = 0` is a load at rest until contact, as (2)-(6) without the terms of Mc. Arguments and errors as
    in `softstart.stages`. Source: [G], pages 19-20.

    >>> drive = {"J1": 0.035, "J2": 0.175, "c": 368.465, "gap": 0.5, "Mc_open": 7.16, "Mc_contact": 7.16}
    >>> round(dynamic_coefficient_of_stages(M1_open=15.5, M1_contact=15.5, base=52.86, **drive), 4)
    1.2677
    """
    mean, Omega = mean_shaft_torque(M1_contact, J1, J2, Mc_contact), elastic_frequency(J1, J2, c)
    dw12 = impact_speed(M1_open, J1, J2, Mc_open, gap)
    return dynamic_coefficient(peak_shaft_torque(mean, dw12, c, Omega), base)


def method_1(
    r: ArrayLike,
    *,
    J1: ArrayLike,
    J2: ArrayLike,
    c: ArrayLike,
    gap: ArrayLike,
    Ms: ArrayLike,
    Mc: ArrayLike,
    kind: str = "active",
    base: ArrayLike | None = None,
) -> TwoStages:
    """Method 1: motor torque `r Ms` while the gap is open, `Ms` from contact on, [G](3), (13), (15), (17).

    `base` in N m: mean shaft torque for K_dyn, by default this drive's own (fig. 2 of [G] takes that of
    `J2 = 5 J1` for all curves). A reactive load is taken exactly, `softstart.stages.reactive`. Arguments and
    errors as in `softstart.stages` and `open_stage_duration`. Source: [G], page 19.

    >>> start = method_1(0.25, J1=0.035, J2=0.175, c=368.465, gap=0.5, Ms=62, Mc=7.16)
    >>> round(start.k_dyn, 4), round(start.open_duration + start.contact_duration, 4)
    (2.3894, 0.0744)
    """
    drive = {"r": r, "J1": J1, "J2": J2, "c": c, "gap": gap, "Ms": Ms, "Mc": Mc}
    return _two_stages(drive, kind, base, reduced_in_contact=False)


def method_2(
    r: ArrayLike,
    *,
    J1: ArrayLike,
    J2: ArrayLike,
    c: ArrayLike,
    gap: ArrayLike,
    Ms: ArrayLike,
    Mc: ArrayLike,
    kind: str = "active",
    base: ArrayLike | None = None,
) -> TwoStages:
    """Method 2: motor torque `r Ms` in the open stage and the contact stage, [G](3), (13), (15), (18).

    `base`, reactive load, arguments and errors as in `method_1`. Source: [G], pages 19-20.

    >>> method_2(0.25, J1=0.035, J2=0.175, c=368.465, gap=[0.5, 2], Ms=62, Mc=7.16).k_dyn.round(4)
    array([1.2677, 2.2144])
    """
    drive = {"r": r, "J1": J1, "J2": J2, "c": c, "gap": gap, "Ms": Ms, "Mc": Mc}
    return _two_stages(drive, kind, base, reduced_in_contact=True)


def _two_stages(
    drive: dict[str, ArrayLike], kind: str, base: ArrayLike | None, *, reduced_in_contact: bool
) -> TwoStages:
    r, J1, J2, c, gap, Ms, Mc = checked(**drive)
    M1_open = r * Ms
    M1_contact = M1_open if reduced_in_contact else Ms
    dw12 = impact_speed(M1_open, J1, J2, Mc, gap, kind=kind)
    if kind == "reactive":
        peak = reactive_peak_shaft_torque(M1_contact, Mc, dw12, J1=J1, J2=J2, c=c)
        contact = reactive_contact_stage_duration(M1_contact, Mc, dw12, J1=J1, J2=J2, c=c)
    else:
        mean, Omega = mean_shaft_torque(M1_contact, J1, J2, Mc), elastic_frequency(J1, J2, c)
        peak = peak_shaft_torque(mean, dw12, c, Omega)
        contact = contact_stage_duration(mean, dw12, c, Omega)
    open_duration = open_stage_duration(M1_open, J1, J2, Mc, gap, kind=kind)
    k_dyn = dynamic_coefficient(peak, mean_shaft_torque(Ms, J1, J2, Mc) if base is None else base)
    return TwoStages(*(plain(x) for x in np.broadcast_arrays(k_dyn, peak, open_duration, contact)))
