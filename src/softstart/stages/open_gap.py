"""How long the gap stays open after the start, and how fast it closes: [G](1)-(6), (10)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softstart.stages.arguments import Value, approach, checked, free_load_torque, plain


def open_stage_duration(
    M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike, gap: ArrayLike, *, kind: str = "active"
) -> Value:
    """Time in s until the gap closes: `t1 = sqrt(gap J1 J2 / (M1 J2 + Mc J1))`, [G](3).

    Arguments as in `softstart.stages`; raises `InputError` too where the masses do not approach each other.
    Source: [G], page 18.

    >>> round(open_stage_duration(62, 0.035, 0.175, 7.16, 0.5), 6)
    0.01661
    """
    M1, J1, J2, Mc, gap = checked(M1=M1, J1=J1, J2=J2, Mc=Mc, gap=gap)
    return plain(np.sqrt(gap / approach(M1, J1, J2, free_load_torque(Mc, kind))))


def open_stage_angles(
    t: ArrayLike, M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike, *, kind: str = "active"
) -> tuple[Value, Value]:
    """Angles `phi1 = M1 t^2/(2 J1)`, `phi2 = -Mc t^2/(2 J2)` in rad at time t of the open stage, [G](2).

    They solve [G](1), `M1 = J1 phi1''`, `-Mc = J2 phi2''`, from rest. Arguments and errors as in
    `softstart.stages`. Source: [G], page 18.

    >>> phi1, phi2 = open_stage_angles(0.01, 62, 0.035, 0.175, 7.16)
    >>> round(phi1, 6), round(phi2, 6)
    (0.088571, -0.002046)
    """
    t, M1, J1, J2, Mc = checked(t=t, M1=M1, J1=J1, J2=J2, Mc=Mc)
    return plain(M1 * t**2 / (2 * J1)), plain(-free_load_torque(Mc, kind) * t**2 / (2 * J2))


def open_stage_speeds(
    t: ArrayLike, M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike, *, kind: str = "active"
) -> tuple[Value, Value]:
    """Speeds `w1 = M1 t/J1`, `w2 = -Mc t/J2` in rad/s at time t of the open stage, [G](4).

    Arguments and errors as in `softstart.stages`. Source: [G], page 18.

    >>> w1, w2 = open_stage_speeds(0.01, 62, 0.035, 0.175, 7.16)
    >>> round(w1, 6), round(w2, 6)
    (17.714286, -0.409143)
    """
    t, M1, J1, J2, Mc = checked(t=t, M1=M1, J1=J1, J2=J2, Mc=Mc)
    return plain(M1 * t / J1), plain(-free_load_torque(Mc, kind) * t / J2)


def closing_angles(
    M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike, gap: ArrayLike, *, kind: str = "active"
) -> tuple[Value, Value]:
    """Angles `phi1, phi2` in rad at which the gap closes; their difference is `gap/2`, [G](6).

    `phi1 = (gap/2) M1 J2/(M1 J2 + Mc J1)`, `phi2 = -(gap/2) Mc J1/(M1 J2 + Mc J1)`. Arguments and errors as
    in `open_stage_duration`. Source: [G], page 18.

    >>> phi1, phi2 = closing_angles(62, 0.035, 0.175, 7.16, 0.5)
    >>> round(phi1, 6), round(phi2, 6)
    (0.244356, -0.005644)
    """
    M1, J1, J2, Mc, gap = checked(M1=M1, J1=J1, J2=J2, Mc=Mc, gap=gap)
    Mc = free_load_torque(Mc, kind)
    half = gap / 2 / approach(M1, J1, J2, Mc)
    return plain(half * M1 / J1), plain(-half * Mc / J2)


def closing_speeds(
    M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike, gap: ArrayLike, *, kind: str = "active"
) -> tuple[Value, Value]:
    """Speeds `w1(0-) = M1 t1/J1`, `w2(0-) = -Mc t1/J2` in rad/s with which the gap closes, [G](5).

    Arguments and errors as in `open_stage_duration`. Source: [G], page 18.

    >>> w1, w2 = closing_speeds(62, 0.035, 0.175, 7.16, 0.5)
    >>> round(w1, 4), round(w2, 4)
    (29.4231, -0.6796)
    """
    t1 = open_stage_duration(M1, J1, J2, Mc, gap, kind=kind)
    return open_stage_speeds(t1, M1, J1, J2, Mc, kind=kind)


def impact_speed(
    M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike, gap: ArrayLike, *, kind: str = "active"
) -> Value:
    """Speed of impact `dw12 = w1(0-) - w2(0-) = sqrt(gap (M1/J1 + Mc/J2))` in rad/s, [G](5), (10).

    Stage 2 starts from it, `dM12/dt(0) = c dw12` [G](9). Arguments and errors as in `open_stage_duration`.
    Source: [G], pages 18-19.

    >>> round(impact_speed(62, 0.035, 0.175, 7.16, 0.5), 4)
    30.1027
    """
    M1, J1, J2, Mc, gap = checked(M1=M1, J1=J1, J2=J2, Mc=Mc, gap=gap)
    return plain(np.sqrt(gap * approach(M1, J1, J2, free_load_torque(Mc, kind))))
