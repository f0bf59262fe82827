"""A Drive as the kernel's vector p."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from softstart.drive import Drive
from softstart.plant import layout as at

LAWS: Final = {"no-pull": at.NO_PULL, "dead-zone": at.DEAD_ZONE, "modelica": at.MODELICA}
COUNTS_PER_LINE: Final = 4  # quadrature
LONGEST: Final = 100_000  # elastic periods of one start


def encoder_count(drive: Drive) -> float | at.Vector:
    """Angle of one encoder count in rad: 2 pi/(4 lines); 0 for an ideal encoder.

    >>> round(encoder_count(Drive.load("crane-4amtkf")) * 1e6, 2)
    383.5
    """
    lines = np.asarray(drive.encoder_lines, dtype=np.float64)
    count = np.where(lines > 0.0, 2.0 * math.pi / (COUNTS_PER_LINE * np.maximum(lines, 1.0)), 0.0)
    return count if count.ndim else float(count)


def plant_vector(drive: Drive, time_limit: float | None = None, max_events: int = 1_000_000) -> at.Matrix:
    """One row of p for each start of the drive (one row for a scalar drive).

    Without `time_limit` a start that never reaches its target speed is given up after a hundred times
    the duration of a stiff drive's start plus a hundred elastic periods, counted from a brake's release. No
    start lasts more than `LONGEST` elastic periods: its figures are integrals over each of them.
    """
    shape = drive.shape
    count = math.prod(shape)

    def column(values: object) -> at.Vector:
        if isinstance(values, float | int):
            return np.full(count, values, dtype=np.float64)
        return np.broadcast_to(np.asarray(values, dtype=np.float64), shape).reshape(count)

    J1, J2, c = column(drive.J1), column(drive.J2), column(drive.c)
    Mc, Ms = column(drive.Mc), column(drive.Ms)
    target = column(drive.target_speed)
    rows = np.zeros((count, at.N_P))
    p = rows.view(at.PLANT)[:, 0]
    p["J1"], p["J2"], p["c"], p["d"] = J1, J2, c, column(drive.d)
    p["gap"], p["Mc"] = column(drive.gap), Mc
    # a reactive load without torque never sticks: it is the same as an active one
    p["reactive"] = (Mc > 0.0) if drive.load_kind == "reactive" else 0.0
    p["law"] = LAWS[drive.contact_law]
    p["rate"] = column(drive.torque_rate)
    p["u_min"], p["u_max"] = column(drive.minimum_torque), column(drive.maximum_torque)
    p["target"] = target
    p["encoder"] = column(encoder_count(drive))
    p["encoder_phase"] = column(drive.encoder_phase)
    p["torque_noise"], p["noise_seed"] = column(drive.torque_noise), column(drive.noise_seed)
    p["dead_time"] = column(drive.computing_delay)
    p["theta_0"] = column(drive.theta0)
    p["release_at"] = column(drive.release_time)
    p["w1_0"] = column(drive.initial_motor_speed)
    p["w2_0"] = column(drive.initial_load_speed)
    w0sq = c * (1.0 / J1 + 1.0 / J2)
    p["period"] = 2.0 * math.pi / np.sqrt(w0sq)
    # a lag below 1e-12 of the elastic period changes no digit, but its rate would overflow
    lag = column(drive.torque_lag)
    p["lag"] = np.where(lag > 1e-12 * p["period"], lag, 0.0)
    friction, b1, b2 = map(column, drive.frictions)
    p["friction"], p["decay1"], p["decay2"] = friction, b1 / J1, b2 / J2
    net = np.maximum(Ms - Mc - (friction + (b1 + b2) * target), 1e-3 * (Ms - Mc))
    stiff = (J1 + J2) * (target + np.abs(p["w2_0"]) + np.abs(p["w1_0"])) / net
    held = np.where(p["release_at"] < math.inf, p["release_at"], 0.0)
    p["longest"] = LONGEST * p["period"]
    if time_limit is None:
        limit = 100.0 * (stiff + p["period"]) + held
        # a tenth of it is more than any start takes: then it is not too long, but does not reach its target
        ample = (limit > p["longest"]) & (0.1 * limit < p["longest"])
        p["time_limit"] = np.where(ample, 0.999 * p["longest"], np.minimum(limit, p["longest"]))
    else:
        p["time_limit"] = np.minimum(time_limit, p["longest"])
    p["event_cap"] = max_events
    p["inv_J1"], p["inv_J2"], p["inv_J"] = 1.0 / J1, 1.0 / J2, 1.0 / (J1 + J2)
    p["w0sq_slip"], p["inv_w0sq"], p["w0_slip"] = w0sq, 1.0 / w0sq, np.sqrt(w0sq)
    return rows
