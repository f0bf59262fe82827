"""The figures by which starts are judged. Every K_dyn comes from `stages.dynamic_coefficient`."""

from __future__ import annotations

from typing import Any

from softstart import stages
from softstart.drive import Drive


def base_torque(drive: Drive) -> Any:
    """M12avg_base = (Ms J2 + J1 Mc)/(J1 + J2) in N m, [G](16): the mean shaft torque under full torque.

    >>> round(base_torque(Drive.load("crane-4amtkf")), 2)
    52.86
    """
    return stages.mean_shaft_torque(drive.Ms, drive.J1, drive.J2, drive.Mc)


def k_dyn(peak_torque: Any, drive: Drive) -> Any:
    """Dynamic coefficient K_dyn = peak |T| / M12avg_base, [G](16); `drive` gives the base.

    >>> round(k_dyn(105.72, Drive.load("crane-4amtkf")), 3)
    2.0
    """
    return stages.dynamic_coefficient(peak_torque, base_torque(drive))
