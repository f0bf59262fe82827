"""A torque profile, played back: an optimum, a recording, anything that has been worked out beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softstart.controller import CompiledController, Sensor, compiled_step, parameter
from softstart.controller.compiled import (
    MEASURED,
    NEVER,
    Double,
    Reply,
    Vector,
    as_record,
    compiled,
    record,
    size,
)
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.profile import TorqueProfile

FIRST, WAITING, SECOND = 0.0, 1.0, 2.0  # phases


class Parameters:
    """Times and torques of the first profile follow, each in `room` places; then those of the second."""

    period: Double
    knots: int
    knots_after: int
    room: int


class State:
    """The knot passed last, the phase, and the instant at which the second profile takes over."""

    knot: int
    phase: float
    origin: Double


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Reply, State)
N_PARAMETERS = size(PARAMETERS)


@compiled
def play(numbers: Vector, begin: int, room: int, count: int, origin: float, knot: int, y: Any) -> int:
    """The line of the profile that holds at the instant y.ask_again, which becomes its end.

    Its times are in `numbers` from `begin` on, its torques `room` places later.
    """
    t = y.ask_again
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
    y.torque = torque
    y.slope = slope
    y.ask_again = until
    return knot


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """The line that holds now, of the first profile or of the second."""
    p = as_record(parameters[:N_PARAMETERS], PARAMETERS)
    m = as_record(measured, MEASURED)
    x = as_record(state, STATE)
    y = as_record(command, COMMAND)
    t = m.time
    count_after = int(p.knots_after)
    room = int(p.room)
    profiles = parameters[N_PARAMETERS:]
    knot = int(x.knot)
    phase = x.phase
    origin = x.origin
    if phase == FIRST and count_after > 0 and m.stage >= 2.0:
        phase = WAITING
        origin = math.ceil(t / p.period) * p.period if p.period > 0.0 else t
    if phase == WAITING and t >= origin:
        phase = SECOND
        knot = 0
    y.ask_again = t
    if phase == SECOND:
        after = profiles.shape[0] // 2 - room
        knot = play(profiles, 2 * room, after, count_after, origin, knot, y)
    else:
        knot = play(profiles, 0, room, int(p.knots), 0.0, knot, y)
        if phase == WAITING:
            y.ask_again = min(y.ask_again, origin)
    if y.ask_again == math.inf and (phase == SECOND or count_after == 0):
        y.ask_again = NEVER
    y.knot = knot
    y.phase = phase
    y.origin = origin


@dataclass(frozen=True)
class Profile(CompiledController):
    """A demand given as a function of time: straight lines between knots, steps where two knots coincide.

        u(t) = u_k + (u_k+1 - u_k) (t - t_k)/(t_k+1 - t_k)    t_k <= t < t_k+1

    played exactly, then the last torque is held; beyond the torque limits of the drive that runs it is cut
    off. With a sample `period` each sample holds the mean of the profile until the next one: its impulse is
    kept within these limits.
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

    name = "profile"
    summary = "plays a torque profile from a file or from Python"
    source = "practice"
    sensors = Sensor.STAGE
    kernel = step
    needs = ("file", "profile")

    # fmt: off
    file: str = parameter("", "path of the profile (CSV or TOML)",
        default_text="none: this or profile is needed")
    profile: TorqueProfile | None = parameter("",  # noqa: RUF009  a field, as the others
        "the profile itself, a TorqueProfile; from Python only",
        default_text="none: this or file is needed", python_only=True)
    period: float = parameter("s", "sample period", 0.0, "0: the profile as it is, without sampling",
        "0 or more")
    # fmt: on

    def __post_init__(self) -> None:
        super().__post_init__()
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
        if self.played.after_contact is None:
            object.__setattr__(self, "sensors", Sensor.NONE)  # what it need not see it does not ask for

    @cached_property
    def played(self) -> TorqueProfile:
        """The profile, read from its file if there is one."""
        if self.profile is not None:
            return self.profile
        return TorqueProfile.load(str(self.file))

    @property
    def parameters(self) -> dict[str, object]:
        """The file's name, or how many knots the profile has and when it ends in s; the period in s."""
        about: dict[str, object] = {"file": self.file}
        if self.file is None:
            about = {"profile": {"knots": int(self.played.time.size), "end": self.played.end}}
        return {**about, "period": self.period}

    def vector(self, drive: Drive) -> Vector:
        """(period, knots, knots after contact, room, times, torques, times, torques)."""
        period = float(self.period or 0.0)
        first = self.played.sampled(period) if period > 0.0 else self.played
        second = first.after_contact
        parts = [first.time, first.torque]
        if second is not None:
            parts += [second.time, second.torque]
        head = [period, first.time.size, 0.0 if second is None else second.time.size, first.time.size]
        return np.concatenate([head, *parts])
