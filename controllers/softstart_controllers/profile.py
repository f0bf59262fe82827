"""A torque profile, played back: an optimum, a recording, anything that has been worked out beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import Any, ClassVar

import numpy as np

from softstart.controller import CompiledController, Sensor, compiled_step, parameter, stack
from softstart.controller.compiled import (
    ASK_AGAIN,
    NEVER,
    SLOPE,
    STAGE,
    STATE,
    TIME,
    TORQUE,
    Vector,
    inlined,
)
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.profile import TorqueProfile

# parameters: these four, then times and torques of the first profile, then those of the second
P_PERIOD, P_KNOTS, P_KNOTS_AFTER, P_ROOM, P_FIRST = range(5)
# state: the knot passed last, whether the second profile waits or plays, the instant at which it takes over
S_KNOT, S_PHASE, S_ORIGIN = range(3)
FIRST, WAITING, SECOND = 0.0, 1.0, 2.0


@inlined
def play(
    numbers: Vector, begin: int, room: int, count: int, origin: float, knot: int, command: Vector
) -> int:
    """The line of the profile that holds at the instant in command[ASK_AGAIN], which becomes its end."""
    t = command[ASK_AGAIN]
    torques = begin + room
    while knot + 1 < count and origin + numbers[begin + knot + 1] <= t:
        knot += 1
    torque = numbers[torques + knot]
    slope = 0.0
    until = math.inf
    if knot + 1 < count:
        until = origin + numbers[begin + knot + 1]
        rise = numbers[torques + knot + 1] - torque
        steepness = rise / (numbers[begin + knot + 1] - numbers[begin + knot])
        if math.isfinite(steepness):  # else the knots are a rounding apart: a step
            slope = steepness
            torque += slope * (t - (origin + numbers[begin + knot]))
    command[TORQUE] = torque
    command[SLOPE] = slope
    command[ASK_AGAIN] = until
    return knot


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Parameters: (period, knots, knots after contact, room, times, torques, times, torques)."""
    t = measured[TIME]
    period = parameters[P_PERIOD]
    count_after = int(parameters[P_KNOTS_AFTER])
    room = int(parameters[P_ROOM])
    knot = int(state[S_KNOT])
    phase = state[S_PHASE]
    origin = state[S_ORIGIN]
    if phase == FIRST and count_after > 0 and measured[STAGE] >= 2.0:
        phase = WAITING
        origin = math.ceil(t / period) * period if period > 0.0 else t
    if phase == WAITING and t >= origin:
        phase = SECOND
        knot = 0
    command[ASK_AGAIN] = t
    if phase == SECOND:
        knot = play(parameters, P_FIRST + 2 * room, (parameters.shape[0] - P_FIRST) // 2 - room, count_after,
                    origin, knot, command)  # fmt: skip
    else:
        knot = play(parameters, P_FIRST, room, int(parameters[P_KNOTS]), 0.0, knot, command)
        if phase == WAITING:
            command[ASK_AGAIN] = min(command[ASK_AGAIN], origin)
    if command[ASK_AGAIN] == math.inf and (phase == SECOND or count_after == 0):
        command[ASK_AGAIN] = NEVER
    command[STATE + S_KNOT] = knot
    command[STATE + S_PHASE] = phase
    command[STATE + S_ORIGIN] = origin


@dataclass(frozen=True)
class Profile(CompiledController):
    """A demand given as a function of time: straight lines between knots, steps where two knots coincide.

        u(t) = u_k + (u_k+1 - u_k) (t - t_k)/(t_k+1 - t_k)    t_k <= t < t_k+1

    played exactly, then the last torque is held; beyond the torque limits of the drive it is cut off. With a
    sample `period` each sample holds the mean of the cut profile until the next one: its impulse is kept.
    A profile with `after_contact` needs a sensor of the contact: at the first closing of the gap (with a
    period, at the first sample from then on) its second profile takes over, on a clock that starts there.

    It knows nothing of the drive: a profile worked out for one drive is played as it is on any other.

    Source: practice; the optimal starts of softstart are such profiles.

    >>> from softstart import Drive, simulate
    >>> pulse = TorqueProfile([0.0, 0.1, 0.1], [20.0, 62.0, 30.0])
    >>> run = simulate(Drive.load("crane-4amtkf"), Profile(profile=pulse))
    >>> run.at([0.05, 0.1])["u"].round(12).tolist()
    [41.0, 30.0]
    """

    name: ClassVar[str] = "profile"
    summary: ClassVar[str] = "plays a torque profile from a file or from Python"
    source: ClassVar[str] = "practice"
    sensors: ClassVar[Sensor] = Sensor.STAGE
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = 3
    needs: ClassVar[tuple[str, ...]] = ("file", "profile")

    file: str | None = parameter(
        "", "path of the profile, CSV or TOML", "none: this or profile is needed", "text"
    )
    profile: TorqueProfile | None = parameter(  # noqa: RUF009  a field, as the others
        "", "the profile itself, a TorqueProfile; from Python only", "none: this or file is needed", "object"
    )
    period: float | None = parameter("s", "sample period", "0: the profile as it is, without sampling")

    def __post_init__(self) -> None:
        if (self.file is None) == (self.profile is None):
            both = "both were given" if self.file is not None else "it has none"
            raise InputError(
                f"profile: the controller profile plays one torque profile, and {both}; "
                "name its file with --param file=PATH, or give profile=TorqueProfile(...) in Python."
            )
        if self.profile is not None and not isinstance(self.profile, TorqueProfile):
            raise InputError(
                f"profile = {self.profile!r}: this is no TorqueProfile; name a file with --param file=PATH, "
                "or give profile=TorqueProfile(...) in Python."
            )
        if self.period is not None and not (isinstance(self.period, Real) and 0.0 <= self.period < math.inf):
            raise InputError(
                f"period = {self.period}: the parameter of the controller profile must be one finite number, "
                "0 or more."
            )
        if self.played.after_contact is None:
            object.__setattr__(self, "sensors", Sensor.NONE)  # what it need not see it does not ask for

    @cached_property
    def played(self) -> TorqueProfile:
        """The profile, read from its file if there is one."""
        if self.profile is not None:
            return self.profile
        return TorqueProfile.load(str(self.file))

    @property
    def parameters(self) -> dict[str, Any]:
        """The file's name, or how many knots the profile has and when it ends in s; the period in s."""
        about: dict[str, Any] = {"file": self.file}
        if self.file is None:
            about = {"profile": {"knots": int(self.played.time.size), "end": self.played.end}}
        return {**about, "period": self.period}

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """No sampling."""
        return {"period": 0.0}

    def vector(self, drive: Drive) -> Vector:
        """(period, knots, knots after contact, room, times, torques, times, torques)."""
        limits = stack(drive, drive.minimum_torque, drive.maximum_torque).reshape(-1, 2)
        pairs, which = np.unique(limits, axis=0, return_inverse=True)
        period = float(self.period or 0.0)
        made = [self._tables(float(low), float(high), period) for low, high in pairs]
        room, room_after = (max(tables[i].shape[1] for tables in made) for i in range(2))
        rows = np.array(
            [
                [
                    period,
                    first.shape[1],
                    second.shape[1],
                    room,
                    *_padded(first, room),
                    *_padded(second, room_after),
                ]
                for first, second in made
            ]
        )
        if len(rows) == 1:
            return np.broadcast_to(rows[0], (*drive.shape, rows.shape[1]))
        return rows[which.ravel()].reshape(*drive.shape, -1)

    def _tables(self, low: float, high: float, period: float) -> tuple[Vector, Vector]:
        """Knots of both profiles as the drive can play them, rows of times and torques."""
        second = self.played.after_contact
        return (
            _table(self.played, low, high, period),
            _table(second, low, high, period) if second is not None else np.zeros((2, 0)),
        )


def _table(profile: TorqueProfile, low: float, high: float, period: float) -> Vector:
    """Knots within the limits, sampled if there is a period."""
    within = profile.clipped(low, high)
    if period > 0.0:
        within = within.sampled(period)
    return np.stack([within.time, within.torque])


def _padded(table: Vector, room: int) -> Vector:
    """Times, then torques, each in `room` places."""
    return np.pad(table, ((0, 0), (0, room - table.shape[1]))).ravel()
