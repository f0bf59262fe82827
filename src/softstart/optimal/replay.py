"""Running a torque profile on the exact plant."""

from __future__ import annotations

import numpy as np

from softstart.controller import make_controller
from softstart.drive import Drive
from softstart.profile import TorqueProfile
from softstart.start.run import Run
from softstart.start.simulation import simulate


def replay(drive: Drive, profile: TorqueProfile, until: float, base: Drive | None = None) -> Run:
    """The start of the drive under the profile, to `until` in s, exactly.

    >>> run = replay(Drive.load("crane-4amtkf"), TorqueProfile([0.0], [62.0]), until=0.4)
    >>> round(run.k_dyn, 4)
    3.1179
    """
    player = make_controller("profile", {"profile": profile})
    return simulate(drive, player, until, base=base)


def heat_of(run: Run, until: float) -> float:
    """I2t heat in s: the integral of (u/Ms)^2 of the realised torque from 0 to `until`, exact."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    total = 0.0
    for index, row in enumerate(run.segments):
        start, end = float(row[0]), min(float(row[1]), until)
        if end <= start:
            continue
        times = start + 0.5 * (end - start) * (nodes + 1.0)
        u = run.states_in(np.full(times.size, index), times)["u"]
        total += 0.5 * (end - start) * float(weights @ (u * u))
    return total / float(run.drive.Ms) ** 2
