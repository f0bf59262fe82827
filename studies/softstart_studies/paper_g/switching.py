"""Two idealised ways of ending the reduced torque: at an instant, and a delay after contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart import Drive, formulas
from softstart.arrays import Vector
from softstart.controller import CompiledController, Sensor, compiled_step, parameter, stack
from softstart.controller.compiled import ASK_AGAIN, STAGE, STATE, TIME, TORQUE

SHARE = 0.25  # reduced torque over Ms, as in the check table


@compiled_step
def switch_at_instant(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Reduced until the clock says so."""
    waiting = measured[TIME] < parameters[2]
    command[TORQUE] = parameters[0] if waiting else parameters[1]
    command[ASK_AGAIN] = parameters[2] if waiting else math.inf


@compiled_step
def switch_after_contact(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """State = (instant at which the torque is raised, 0 before contact)."""
    t = measured[TIME]
    deadline = state[0]
    if measured[STAGE] >= 2.0 and deadline == 0.0:
        deadline = t + parameters[2]
    waiting = deadline == 0.0 or t < deadline
    command[TORQUE] = parameters[0] if waiting else parameters[1]
    command[ASK_AGAIN] = deadline if waiting and deadline > 0.0 else math.inf
    command[STATE] = deadline


def reduced_stages(drive: Drive, torque: Any) -> formulas.TwoStages:
    """Stages 1 and 2 of `drive` under a constant motor torque in N m, [G](3), (15), (18).

    >>> round(reduced_stages(Drive.load("crane-4amtkf"), 15.5).k_dyn, 4)
    1.2677
    """
    J1, J2, c, gap, Ms, Mc = drive.J1, drive.J2, drive.c, drive.gap, drive.Ms, drive.Mc
    return formulas.two_stages(torque, torque, J1=J1, J2=J2, c=c, gap=gap, Ms=Ms, Mc=Mc)


@dataclass(frozen=True)
class SwitchAtInstant(CompiledController):
    """Reduced torque for the time t1 + t2 of the drive it is set up for, then Ms: what [G] warns of.

    >>> from softstart import simulate
    >>> new = Drive.load("crane-4amtkf")
    >>> round(simulate(new.replace(gap=2), SwitchAtInstant(), fitted_to=new).k_dyn, 4)
    3.1279
    """

    name: ClassVar[str] = "switch-at-instant"
    summary: ClassVar[str] = "torque reduced for the time that stages 1 and 2 take in the new drive, then Ms"
    source: ClassVar[str] = "[G], page 22"
    kernel: ClassVar[Any] = switch_at_instant

    torque: float | None = parameter("N*m", "reduced torque", "a quarter of the starting torque")
    full_torque: float | None = parameter("N*m", "torque afterwards", "starting torque Ms")
    instant: float | None = parameter("s", "when the torque is raised", "t1 + t2, [G](3) and (15)")

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """The lengths of stages 1 and 2 under the reduced torque."""
        torque = SHARE * drive.Ms if self.torque is None else self.torque
        start = reduced_stages(drive, torque)
        instant = start.open_duration + start.contact_duration
        return {"torque": torque, "full_torque": drive.Ms, "instant": instant}

    def vector(self, drive: Drive) -> Vector:
        """(torque, full torque, instant)."""
        return stack(self.torque, self.full_torque, self.instant)


@dataclass(frozen=True)
class SwitchAfterContact(CompiledController):
    """Reduced torque until a delay after the first contact, then Ms; it sees the contact at once.

    The delay of [G] is the length of stage 2, (15). With the time of the peak of stage 2, (14), the torque
    rises while the shaft carries it: the gap does not open again.

    >>> from softstart import simulate
    >>> new = Drive.load("crane-4amtkf")
    >>> round(simulate(new, SwitchAfterContact()).k_dyn, 4)
    2.3894
    """

    name: ClassVar[str] = "switch-after-contact"
    summary: ClassVar[str] = "torque reduced until a delay after the first contact, then Ms"
    source: ClassVar[str] = "[G], page 22"
    sensors: ClassVar[Sensor] = Sensor.STAGE
    kernel: ClassVar[Any] = switch_after_contact
    state_size: ClassVar[int] = 1

    torque: float | None = parameter("N*m", "reduced torque", "a quarter of the starting torque")
    full_torque: float | None = parameter("N*m", "torque afterwards", "starting torque Ms")
    delay: float | None = parameter("s", "time from contact to Ms", "length of stage 2, [G](15)")

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """The length of stage 2 under the reduced torque."""
        torque = SHARE * drive.Ms if self.torque is None else self.torque
        delay = reduced_stages(drive, torque).contact_duration
        return {"torque": torque, "full_torque": drive.Ms, "delay": delay}

    def vector(self, drive: Drive) -> Vector:
        """(torque, full torque, delay)."""
        return stack(self.torque, self.full_torque, self.delay)
