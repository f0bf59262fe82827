"""What the shaft carries while the gap is closed and a reactive load starts to move.

[G] says only that the terms with `Mc` vanish from (2)-(6) while such a load is at rest. This page completes
stage 2 from [G](7) with Coulomb friction. The load is stuck until `T > Mc`:

    T = M1 (1 - cos ws t) + B sin ws t,     ws = sqrt(c/J1),  B = dw12 sqrt(c J1)

At `T = Mc` the torque rises at `ws S`, `S^2 = B^2 + Mc (2 M1 - Mc)` (energy); if `S^2 <= 0` it never gets
there. From then on the load slips and `T` swings with the frequency Omega of the whole drive, `s` counted
from the break-away:

    T = Mc + over (1 - cos Omega s) + rise sin Omega s,     over = (M1 - Mc) share,  rise = S sqrt(share),
                                                            share = J2/(J1 + J2)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softstart.stages.arguments import Array, Value, checked, plain, refuse_negative_friction
from softstart.stages.contact import angle_to_peak, peak_of_swing


def reactive_peak_shaft_torque(
    M1: ArrayLike, Mc: ArrayLike, dw12: ArrayLike, *, J1: ArrayLike, J2: ArrayLike, c: ArrayLike
) -> Value:
    """Peak in N m of the contact stage of a reactive load that is at rest at contact; stands in for [G](13).

    `Mc + over + sqrt(over^2 + rise^2)`, or `M1 + sqrt(M1^2 + B^2)` where the load stays stuck (symbols
    above). Arguments as in `softstart.stages`; raises `InputError` too for `Mc < 0`. Source: derived from
    [G](7).

    >>> from softstart.stages import impact_speed
    >>> dw12 = impact_speed(62, 0.035, 0.175, 7.16, 0.5, kind="reactive")
    >>> round(reactive_peak_shaft_torque(62, 7.16, dw12, J1=0.035, J2=0.175, c=368.465), 4)
    163.7848
    """
    M1, Mc, dw12, J1, J2, c = checked(M1=M1, Mc=Mc, dw12=dw12, J1=J1, J2=J2, c=c)
    B, S2, moves = _break_away(M1, Mc, dw12, J1, c)
    share = J2 / (J1 + J2)
    slipping = Mc + peak_of_swing((M1 - Mc) * share, np.sqrt(share * np.maximum(S2, 0)))
    return plain(np.where(moves, slipping, peak_of_swing(M1, B)))


def reactive_contact_stage_duration(
    M1: ArrayLike, Mc: ArrayLike, dw12: ArrayLike, *, J1: ArrayLike, J2: ArrayLike, c: ArrayLike
) -> Value:
    """Time in s from contact until `T` is back at zero, reactive load at rest; stands in for [G](15).

    `inf` where the gap stays closed: the load moves and `c J2 dw12^2 <= Mc^2`, friction holds the flanks
    together. `nan` where the load stops again before the gap opens, which takes `M1 < Mc`: the stuck phase
    after it begins at an instant without closed form, so `softstart.simulate` must be asked. Arguments as in
    `softstart.stages`; raises `InputError` too for `Mc < 0`. Source: derived from [G](7).

    >>> from softstart.stages import impact_speed
    >>> dw12 = impact_speed(62, 0.035, 0.175, 7.16, 0.5, kind="reactive")
    >>> round(reactive_contact_stage_duration(62, 7.16, dw12, J1=0.035, J2=0.175, c=368.465), 6)
    0.036789
    """
    M1, Mc, dw12, J1, J2, c = checked(M1=M1, Mc=Mc, dw12=dw12, J1=J1, J2=J2, c=c)
    B, S2, moves = _break_away(M1, Mc, dw12, J1, c)
    S, share = np.sqrt(np.maximum(S2, 0)), J2 / (J1 + J2)
    ws, Omega = np.sqrt(c / J1), np.sqrt(c / J1 + c / J2)
    over, rise = (M1 - Mc) * share, S * np.sqrt(share)

    to_break_away = 2 * np.arctan2(Mc, B + S) / ws  # tan(ws t/2) = Mc/(B + S), the root that does not cancel
    below2 = share * B**2 - (1 - share) * Mc**2  # amplitude^2 - mean^2; T comes down to zero only if >= 0
    angle = np.arctan2(rise, -over) + np.arctan2(np.sqrt(np.maximum(below2, 0)), -(Mc + over))
    # Proportional to w2 where T is back at zero; w2 rises and falls once, so its sign tells of a stop before.
    w2 = over * (angle - np.sin(angle)) + rise * (1 - np.cos(angle))

    opens = np.where(w2 >= 0, to_break_away + angle / Omega, np.nan)
    stays = np.where(over >= 0, np.inf, np.nan)
    slipping = np.where((below2 <= 0) & (Mc > 0), stays, opens)
    return plain(np.where(moves, slipping, 2 * angle_to_peak(M1, B) / ws))


def _break_away(M1: Array, Mc: Array, dw12: Array, J1: Array, c: Array) -> tuple[Array, Array, Array]:
    """Impact torque B of the stuck load, S^2, and whether the load moves at all."""
    refuse_negative_friction(Mc)
    B = dw12 * np.sqrt(c * J1)
    S2 = B**2 + Mc * (2 * M1 - Mc)
    return B, S2, (S2 > 0) | (Mc == 0)
