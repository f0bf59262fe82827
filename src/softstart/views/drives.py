"""The drive of a result in a few lines, and for which drive the controllers are set up."""

from __future__ import annotations

import math
from typing import Any

from softstart.drive import INFORMATIVE_TABLES, PARAMETERS, Drive
from softstart.views.numbers import printable, short

POSITIONS = {
    "driving-flank": "on the driving flank",
    "mid-gap": "in the middle of the gap",
    "opposite-flank": "on the opposite flank",
    "hanging": "with the load hanging in the wound-up shaft",
    "unknown": "at an unknown position in the gap: the worst of both flanks and the middle counts",
}


def drive_lines(drive: Drive) -> list[str]:
    """The drive in a few lines: its name, the parameters that matter, and under which laws it starts."""
    extra = []
    if drive.d:
        extra.append(f"d = {short(float(drive.d))} N m s/rad")
    if isinstance(drive.start_position, str):
        if drive.start_position != "mid-gap":
            extra.append(f"starts {POSITIONS[drive.start_position]}")
    elif drive.theta0:
        extra.append(f"starts at twist {short(float(drive.theta0))} rad")
    if drive.brake == "motor":
        proving = isinstance(drive.release, str)
        until = (
            "its torque has reached the shaft torque" if proving else f"{short(float(drive.release_time))} s"
        )
        extra.append(f"the brake holds the motor until {until}")
    friction, b1, b2 = map(float, drive.frictions)
    if friction:
        extra.append(f"friction of the motor {short(friction)} N m")
    if b1 or b2:
        extra.append(f"viscous friction b1 = {short(b1)}, b2 = {short(b2)} N m s/rad")
    if drive.torque_lag:
        extra.append(f"torque lag {short(float(drive.torque_lag))} s")
    if math.isfinite(float(drive.torque_rate)):
        extra.append(f"torque rate {short(float(drive.torque_rate))} N m/s")
    if drive.computing_delay:
        extra.append(f"computing delay {short(float(drive.computing_delay))} s")
    if drive.torque_noise:
        extra.append(f"noise of the measured torque {short(float(drive.torque_noise))} N m")
    if drive.initial_load_speed or drive.initial_motor_speed:
        w1, w2 = float(drive.initial_motor_speed), float(drive.initial_load_speed)
        extra.append(f"initial speeds w1 = {short(w1)}, w2 = {short(w2)} rad/s")
    rpm = float(drive.target_speed) * 30.0 / math.pi
    gap, c = short(float(drive.gap)), short(float(drive.c))
    return [
        printable(drive.name),
        f"  motor  J1 = {short(float(drive.J1))} kg m2, starting torque Ms = {short(float(drive.Ms))} N m",
        f"  shaft  c = {c} N m/rad, gap = {gap} rad, contact law {drive.contact_law}",
        f"  load   J2 = {short(float(drive.J2))} kg m2, Mc = {short(float(drive.Mc))} N m, {drive.load_kind}",
        f"  start  to {short(float(drive.target_speed))} rad/s ({rpm:.4g} rpm)",
        *(["  also   " + ", ".join(extra)] if extra else []),
        *([f"  assumed: {printable(drive.assumed)}"] if drive.assumed else []),
    ]


def controllers_set_up(drive: Drive | None, fitted_to: Any) -> str:
    """For which drive the controllers are set up, and by what that differs from the one that runs.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> controllers_set_up(crane.replace(gap=2.0), crane)
    'strategies are set up for "Crane travel drive 4AMTKF(H)112L6": shaft.gap 0.5 there, 2 here'
    """
    found = []
    for parameter in PARAMETERS.values() if drive is not None else ():
        there, here = getattr(fitted_to, parameter.name), getattr(drive, parameter.name)
        changes = (
            parameter.name not in ("name", "source", "assumed") and parameter.table not in INFORMATIVE_TABLES
        )
        if changes and there != here:
            shown = [_set(value) for value in (there, here)]
            found.append(f"{parameter.path} {shown[0]} there, {shown[1]} here")
    most = 6
    more = f", and {len(found) - most} more" if len(found) > most else ""
    differs = ": " + "; ".join(found[:most]) + more if found else ""
    return f'strategies are set up for "{printable(fitted_to.name)}"{differs}'


def _set(value: object) -> str:
    return short(value) if isinstance(value, float) else "not set" if value in (None, "") else str(value)
