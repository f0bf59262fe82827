"""The law of [G]'s reduced torque: low until contact is seen and for a time after that, then full torque.

Three strategies follow it. What differs is when the torque is raised, and by what the contact is seen:

    reduced-first-stage    at contact                            sees the gap
    reduced-two-stage      at the peak or the end of stage 2     sees the gap
    acceleration-delay     at the peak or the end of stage 2     sees the encoder
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from softstart import formulas
from softstart.controller import CompiledController, Sensor, compiled_step, parameter
from softstart.controller.compiled import MEASURED, NEVER, Double, Reply, Vector, as_record, record
from softstart.drive import Drive
from softstart.input.parameters import Limit
from softstart_controllers.sampled import full_torque_parameter, pulling_load

SHARE = 0.15
INSTANTS = ("peak", "end")  # of stage 2, at which the torque is raised


class Parameters:
    """What the step is given; `wait` counts from contact."""

    torque: float
    full_torque: float
    wait: Double


class State:
    """When the torque is raised; 0 before contact."""

    raise_at: Double


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Reply, State)


@compiled_step(PARAMETERS, STATE)
def step_of_gap(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Reduced until the wait after contact has passed or the gap opens again; asked at its events."""
    p = as_record(parameters, PARAMETERS)
    m = as_record(measured, MEASURED)
    y = as_record(command, COMMAND)
    y.raise_at = as_record(state, STATE).raise_at
    if m.stage >= 2.0 and y.raise_at == 0.0:
        y.raise_at = m.time + p.wait
    waiting = m.stage < 2.0 or (m.stage < 3.0 and m.time < y.raise_at)
    y.torque = p.torque if waiting else p.full_torque
    if waiting:
        y.ask_again = y.raise_at if y.raise_at > m.time else math.inf
    else:
        y.ask_again = NEVER


def reduced_torque(drive: Drive) -> float:
    """Load torque plus 15 % of the accelerating torque Ms - Mc: enough to move on, near 0.25 Ms in [G].

    >>> round(reduced_torque(Drive.load("crane-4amtkf")), 3)
    15.386
    """
    held = pulling_load(drive)
    return held + SHARE * (drive.Ms - held)


def reduced_torque_parameter(meaning: str, limit: Limit = "any") -> Any:
    """The reduced torque as a field of a controller."""
    text = "load torque plus 15 % of the accelerating torque"
    return parameter(
        "N*m", meaning, lambda drive, p: reduced_torque(drive), text, limit, multiples=(0.3, 4.0)
    )


@dataclass(frozen=True)
class ReducedTorque(CompiledController):
    """A torque that is low until contact and for a time after it, switched at the events of the gap."""

    sensors = Sensor.STAGE
    time_parameter = "torque"
    kernel = step_of_gap

    torque: float = reduced_torque_parameter("reduced torque")
    full_torque: float = full_torque_parameter("torque once it is raised")


def raise_parameter() -> Any:
    """`raise_at` as a field of a controller."""
    meaning = "instant of stage 2 at which the torque is raised, its torque peak [G](14) or its end [G](15)"
    return parameter("", meaning, "peak", choices=INSTANTS)


def delay_of(drive: Drive, torque: float, raise_at: str) -> float:
    """Time in s from contact until the torque is raised.

    >>> [round(delay_of(Drive.load("crane-4amtkf"), 15.5, one), 4) for one in INSTANTS]
    [0.0164, 0.0328]
    """
    return (0.5 if raise_at == "peak" else 1.0) * stage_2_duration(drive, torque)


def closing_speed(drive: Drive, torque: float) -> float:
    """Speed in rad/s at which the driving flanks first meet, [G](10), from any start position and speeds.

    >>> round(closing_speed(Drive.load("crane-4amtkf"), 62), 3)
    30.103
    """
    a = torque / drive.J1 + load_drift(drive)
    way = max(0.5 * drive.gap - drive.design_drive.theta0, 0.0)
    v = drive.initial_motor_speed - drive.initial_load_speed
    return math.sqrt(max(v * v + 2.0 * a * way, 0.0))


def load_drift(drive: Drive) -> float:
    """By how much the load slows down while the gap is open for the first time, rad/s^2.

    >>> round(load_drift(Drive.load("crane-4amtkf")), 2)
    40.91
    """
    w2 = drive.initial_load_speed
    pull = drive.Mc if w2 > 0.0 else drive.backward_torque if w2 < 0.0 else drive.falling_torque
    return pull / drive.J2


def stage_2_duration(drive: Drive, torque: float) -> float:
    """Length of stage 2 in s under the reduced torque: [G](15), for a load that friction holds the exact one.

    Where friction then keeps the gap closed for good, [G](15) is taken all the same.

    >>> round(stage_2_duration(Drive.load("crane-4amtkf"), 15.5), 4)
    0.0328
    """
    dw12 = closing_speed(drive, torque)
    if drive.rests and drive.initial_load_speed == 0.0:
        contact = (torque, drive.J1, drive.J2, drive.Mc, drive.c, dw12, "reactive")
        stuck = float(formulas.contact_stage(*contact).duration)
        if math.isfinite(stuck):
            return stuck
    return swing_duration(drive, torque, dw12)


def swing_duration(drive: Drive, torque: float, dw12: float) -> float:
    """Length of stage 2 in s for flanks that meet at dw12 in rad/s, active load: [G](15)."""
    return 2.0 * math.atan2(drive.c * dw12 / drive.Omega, -mean_under(drive, torque)) / drive.Omega


def mean_under(drive: Drive, torque: float) -> float:
    """M12avg in N m, the mean shaft torque under a motor torque, [G](12)."""
    return float(formulas.mean_shaft_torque(torque, drive.J1, drive.J2, drive.Mc))
