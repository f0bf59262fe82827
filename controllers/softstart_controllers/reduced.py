"""The reduced torque that the strategies of [G] start with."""

from __future__ import annotations

from typing import Any

import numpy as np

from softstart.drive import Drive

SHARE = 0.15


def reduced_torque(drive: Drive) -> Any:
    """Load torque plus 15 % of the accelerating torque Ms - Mc: enough to move on, near 0.25 Ms in [G].

    >>> round(reduced_torque(Drive.load("crane-4amtkf")), 3)
    15.386
    """
    held = np.maximum(drive.Mc, 0.0)
    torque = held + SHARE * (drive.Ms - held)
    return torque if np.ndim(torque) else float(torque)
