"""What everyone solves, as plain numbers, and what everyone hands back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from softstart.drive import Drive

DRIVE, TARGET = "crane-4amtkf", 60.0  # target in rad/s
START_TIMES = (0.2883042, 0.2522662)  # s: 1.2 and 1.05 times that of constant Ms


@dataclass(frozen=True)
class Task:
    """Undamped drive with active load, from rest at mid-gap: least peak of the shaft torque T.

    w1 = w2 = target at t_f <= start_time, 0 <= u <= Ms, one contact. K_dyn = peak T / base. SI units.
    """

    start_time: float
    J1: float
    J2: float
    c: float
    gap: float
    Mc: float
    Ms: float
    target: float
    base: float


@dataclass(frozen=True)
class Answer:
    """Torque in N m, linear between its knots (two at one instant are a step), up to `end_time` in s.

    `claimed` is K_dyn as the package computed it.
    """

    claimed: float
    time: tuple[float, ...]
    torque: tuple[float, ...]
    end_time: float


def crane() -> Drive:
    """The drive of [G] with the target of the task."""
    from softstart.drive import Drive

    return Drive.load(DRIVE).replace(target_speed=TARGET)


def crane_task(start_time: float) -> Task:
    """The task as numbers, taken from softstart's drive.

    >>> task = crane_task(START_TIMES[0])
    >>> task.c, task.gap, round(task.base, 3)
    (368.465, 0.5, 52.86)
    """
    drive = crane()
    values = {name: float(getattr(drive, name)) for name in ("J1", "J2", "c", "gap", "Mc", "Ms")}
    base = drive.mean_torque
    return Task(start_time=start_time, target=float(drive.target_speed), base=base, **values)


def steps(claimed: float, edges: ArrayLike, levels: ArrayLike) -> Answer:
    """An answer whose torque is `levels[i]` from `edges[i]` to `edges[i + 1]`.

    >>> steps(0.9, [0.0, 0.1, 0.3], [62.0, 0.0])
    Answer(claimed=0.9, time=(0.0, 0.1, 0.1, 0.3), torque=(62.0, 62.0, 0.0, 0.0), end_time=0.3)
    """
    at, held = np.asarray(edges, dtype=np.float64), np.asarray(levels, dtype=np.float64)
    if at.size != held.size + 1:
        raise ValueError(f"{held.size} levels need {held.size + 1} edges, not {at.size}.")
    time, torque = np.repeat(at, 2)[1:-1].tolist(), np.repeat(held, 2).tolist()
    return Answer(float(claimed), tuple(time), tuple(torque), float(at[-1]))
