"""The reduced torque that the strategies of [G] start with, and when they raise it."""

from __future__ import annotations

from typing import Any

import numpy as np

from softstart import formulas
from softstart.controller import parameter
from softstart.drive import Drive
from softstart_controllers.sampled import number

SHARE = 0.15
INSTANTS = ("peak", "end")  # of stage 2, at which the torque is raised
RAISE_AT = "peak"


def reduced_torque(drive: Drive) -> Any:
    """Load torque plus 15 % of the accelerating torque Ms - Mc: enough to move on, near 0.25 Ms in [G].

    >>> round(reduced_torque(Drive.load("crane-4amtkf")), 3)
    15.386
    """
    held = np.maximum(drive.Mc, 0.0)
    torque = held + SHARE * (drive.Ms - held)
    return torque if np.ndim(torque) else float(torque)


def raise_parameter() -> Any:
    """`raise_at` as a field of a controller."""
    return parameter(
        "",
        "instant of stage 2 at which the torque is raised: its torque peak, [G](14), or its end, [G](15)",
        RAISE_AT,
        "text",
        choices=INSTANTS,
    )


def delay_of(drive: Drive, torque: Any, raise_at: str) -> Any:
    """Time in s from contact until the torque is raised.

    >>> [round(delay_of(Drive.load("crane-4amtkf"), 15.5, one), 4) for one in INSTANTS]
    [0.0164, 0.0328]
    """
    return (0.5 if raise_at == "peak" else 1.0) * stage_2_duration(drive, torque)


def closing_speed(drive: Drive, torque: Any) -> Any:
    """Speed in rad/s at which the driving flanks first meet, [G](10), from any start position and speeds.

    >>> round(closing_speed(Drive.load("crane-4amtkf"), 62), 3)
    30.103
    """
    rolling = np.where(drive.load_kind == "active", 1.0, np.sign(drive.initial_load_speed))
    a = np.asarray(torque) / drive.J1 + rolling * drive.Mc / drive.J2
    way = np.maximum(0.5 * np.asarray(drive.gap) - drive.design_drive.theta0, 0.0)
    v = np.asarray(drive.initial_motor_speed) - drive.initial_load_speed
    return number(np.sqrt(np.maximum(v * v + 2.0 * a * way, 0.0)))


def stage_2_duration(drive: Drive, torque: Any) -> Any:
    """Length of stage 2 in s under the reduced torque: [G](15), for a stuck reactive load the exact one.

    Where friction keeps the gap of a reactive load closed for good, [G](15) is taken all the same.

    >>> round(stage_2_duration(Drive.load("crane-4amtkf"), 15.5), 4)
    0.0328
    """
    dw12 = closing_speed(drive, torque)
    contact = (torque, drive.J1, drive.J2, drive.Mc, drive.c, dw12)
    duration = np.asarray(formulas.contact_stage(*contact).duration)
    if drive.load_kind == "reactive":
        stuck = formulas.contact_stage(*contact, "reactive").duration
        resting = np.asarray(drive.initial_load_speed) == 0.0
        duration = np.where(resting & np.isfinite(stuck), stuck, duration)
    return number(duration)
