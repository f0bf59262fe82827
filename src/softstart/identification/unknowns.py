"""The unknowns of a fit: which numbers it finds, on which scale, from which guess, and in which bounds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from softstart.arrays import Vector
from softstart.drive import PARAMETERS, Drive
from softstart.errors import InputError
from softstart.hints import nearest
from softstart.identification.logs import Log
from softstart.identification.model import FILTER, POSITION
from softstart.identification.result import FRICTIONS, WIDEST
from softstart.quantities import show

DEFAULT_PARAMETERS: Final = ("motor_inertia", "load_inertia", "stiffness", "gap", "damping")
FREE: Final = (*DEFAULT_PARAMETERS, "load_torque", "torque_lag", "computing_delay", *FRICTIONS, FILTER)
FACTOR: Final = 4.0  # how far from the guess searches begin; they may go 3 times as far
WIDE_RANGE: Final = ("damping", "torque_lag", "computing_delay", FILTER)  # and these a factor of 100
MOST_LOAD: Final = 0.99  # of the starting torque: with more the drive could not start
MOST_FRICTION: Final = 3.0  # units; as far as a search goes
LEAST_FRICTION: Final = 1e-8  # units; less is none, which the plant's events could not tell from rounding
# a power where a logarithm would stretch what is small until no derivative is left of it, and the interval of
# all else would be that of a drive without it: a motion depends on torques of the load linearly, and on the
# root of a gap, the time that the motor takes through it
POWERS: Final = {"gap": 0.5, "load_torque": 1.0} | dict.fromkeys(FRICTIONS, 1.0)


@dataclass(frozen=True)
class Unknown:
    """One number x of a fit, and the value that it stands for.

    x = ln(value/scale), or (value/scale)^power. A position in the gap is 1 - 2 x^2: with the root of the gap
    x makes the time to the driving flank. An offset of an angle is x itself.
    """

    name: str
    kind: Literal["logarithm", "power", "position", "offset"]
    guess: float
    lower: float
    upper: float
    scale: float = 1.0
    power: float = 1.0
    log: int | None = None  # the only one that it is of

    @property
    def title(self) -> str:
        """Its name, with the number of its log."""
        return self.name if self.log is None else f"{self.name} {self.log + 1}"

    @property
    def is_friction(self) -> bool:
        """Whether it may be 0."""
        return self.name in FRICTIONS

    @property
    def weight(self) -> float:
        """1/variance of x beforehand: e^3, 3 units of a power, a quarter of a position."""
        return {"position": 16.0, "offset": 0.0}.get(self.kind, 1.0 / 9.0) + 1e-12

    def value(self, x: float) -> float:
        """The value at this x.

        >>> crane = Drive.load("crane-4amtkf")
        >>> gap, position = unknowns_of(["gap"], crane, (), [True])
        >>> gap.value(gap.number(0.3)).__round__(12), position.value(position.number(-0.6)).__round__(12)
        (0.3, -0.6)
        """
        if self.kind == "position":
            return 1.0 - 2.0 * x * x
        if self.kind == "logarithm":
            return self.scale * math.exp(x)
        if self.kind == "power":
            return self.scale * x ** (1.0 / self.power) if x > LEAST_FRICTION else 0.0
        return x

    def number(self, value: float) -> float:
        """The x of this value, the inverse of `value`."""
        if self.kind == "position":
            return math.sqrt(max(0.5 * (1.0 - value), 0.0))
        if self.kind == "logarithm":
            return math.log(value / self.scale)
        return float((value / self.scale) ** self.power)

    def search_start(self, draw: float) -> float:
        """The x at which a search begins, for a number drawn from 0 to 1."""
        factor = FACTOR ** (2.0 * draw - 1.0)
        if self.kind == "position":
            return math.sqrt(draw)
        if self.is_friction:
            return self.guess + math.log(factor)
        return self.number(self.value(self.guess) * factor)

    def share(self, x: float, half: float) -> float:
        """Half an interval of x as a share of the value, to first order."""
        return half if self.kind == "logarithm" else half / max(self.power * x, 1e-300)

    def known(self, x: float, half: float, guess: float | None = None) -> bool:
        """Whether half an interval of x tells what the value is.

        Within a factor of 3; a friction within a tenth of the torque that accelerates, a position within half
        the gap. A small load torque that comes out too large by chance has a narrow relative interval: where
        x is above its guess, the interval is compared with the guess, at most by that factor of 3.

        >>> load, position = unknowns_of(["load_torque"], Drive.load("crane-4amtkf"), (), [True])
        >>> load.known(1.0, 0.5), load.known(1.5, 0.6, guess=1.0), position.known(0.7, 0.2)
        (True, False, True)
        """
        if self.kind == "position":
            return half < 0.25
        if self.is_friction:
            return 2.0 * half < 1.0
        over = 1.0 if guess is None else self.value(x) / self.value(guess)
        return 2.0 * self.share(x, half) * min(max(over, 1.0), WIDEST) < math.log(WIDEST)

    def limited(self, x: float) -> bool:
        """Whether this x is where the search ends; a friction of 0 is a limit of the drive, not of it."""
        near = 1e-3 * (self.upper - self.lower)
        below = x < self.lower + near and not self.is_friction
        return self.kind in ("logarithm", "power") and (below or x > self.upper - near)


def unknowns_of(
    names: Sequence[str], drive: Drive, logs: Sequence[Log], moving: Sequence[bool]
) -> tuple[Unknown, ...]:
    """The parameters that all logs share, then the position of each log that is `moving`, then offsets.

    An offset is that of an angle counted from its first sample, as `LogModel` has it.
    """
    # the unit of a friction takes a tenth of the torque that accelerates, if viscous at the target speed
    torque = 0.1 * max(float(drive.Ms) - abs(float(drive.Mc)), 0.1 * float(drive.Ms))
    unknowns = []
    for name in names:
        value, power = float(getattr(drive, name, 0.0)), POWERS.get(name)
        if name in FRICTIONS:
            unit = torque / float(drive.target_speed) if "viscous" in name else torque
            unknowns.append(Unknown(name, "power", value / unit, 0.0, MOST_FRICTION, unit))
            continue
        if value == 0.0 and name == "damping":  # a damping ratio of 2 %
            value = 0.04 * math.sqrt(float(drive.c * drive.J1 * drive.J2 / (drive.J1 + drive.J2)))
        value = value or min(float(np.median(np.diff(one.time))) for one in logs)
        reach = 100.0 if name in WIDE_RANGE else 3.0 * FACTOR
        if power is None:
            middle, end, sign = math.log(abs(value)), math.log(reach), math.copysign(1.0, value)
            unknowns.append(Unknown(name, "logarithm", middle, middle - end, middle + end, sign))
        else:
            room = MOST_LOAD * float(drive.Ms) - float(drive.load_friction)  # which is kept as it is
            most = max(room / abs(value), 1.0) if name == "load_torque" else reach
            unknowns.append(
                Unknown(name, "power", 1.0, reach**-power, min(reach, most) ** power, value, power)
            )
    half = math.sqrt(0.5)
    unknowns += [Unknown(POSITION, "position", half, 0.0, 1.0, log=i) for i, one in enumerate(moving) if one]
    for i, log in enumerate(logs):
        if log.kind == "angle":
            room = max(20.0 * log.count, 100.0 * log.scale)
            unknowns.append(Unknown("offset", "offset", 0.0, -room, room, log=i))
    return tuple(unknowns)


def model_parameters(unknowns: Sequence[Unknown], x: Vector, log: int) -> dict[str, float]:
    """The parameters of the model of one log at x."""
    return {
        p.name: p.value(number)
        for p, number in zip(unknowns, x.tolist(), strict=True)
        if p.kind != "offset" and p.log in (None, log)
    }


def position_is_unknown(drive: Drive) -> bool:
    """Whether a log may begin anywhere in the gap."""
    return (drive.start_position == "unknown" or drive.rests) and float(drive.gap) > 0.0


def default_parameters(drive: Drive, *, lag: bool) -> list[str]:
    """What is found where nothing is said: what the drive has, and the lag of its torque if that shows.

    >>> default_parameters(Drive.load("crane-4amtkf").replace(motor_friction=1.5), lag=True)[-2:]
    ['load_torque', 'motor_friction']
    """
    others = ["load_torque", *(["torque_lag"] if lag else []), *FRICTIONS]
    needed = {"gap", *others}
    return [
        name for name in (*DEFAULT_PARAMETERS, *others) if name not in needed or float(getattr(drive, name))
    ]


def selected_parameters(
    free: Iterable[str] | None,
    default_parameters: Sequence[str],
    possible: Sequence[str],
    where: str,
    key: str = "free",
) -> list[str]:
    """The parameters to find: those named, or with a plus before a name the usual ones and that one.

    Names of the drive file stand for those of Python. `where` says what cannot tell any other parameter.

    >>> selected_parameters(["+motor.friction"], ["gap", "stiffness"], FREE, "logs")
    ['gap', 'stiffness', 'motor_friction']
    """
    if free is None:
        return list(default_parameters)
    texts, paths = list(free), {parameter.path: name for name, parameter in PARAMETERS.items()}
    names = list(default_parameters) if any(name.startswith("+") for name in texts) else []
    for text in texts:
        name = paths.get(text.removeprefix("+"), text.removeprefix("+"))
        if name not in possible:
            near = nearest(name, possible)
            hint = f"did you mean {near}?" if near else f"those are {', '.join(possible)}."
            raise InputError(f"{key} = {show(text)}: it is no parameter that {where} can tell; {hint}")
        names.append(name)
    return list(dict.fromkeys(names))
