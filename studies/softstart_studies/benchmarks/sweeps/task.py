"""The grid of sampled starts, as a command line and as plain numbers for the peer."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from softstart.drive import Drive
from softstart_studies.benchmarks.problem import DRIVE, Line, Problem

if TYPE_CHECKING:
    import xarray

CONTROLLER = "ramp"
PERIOD = 1e-3  # s
FEW = 10  # values of stiffness and of ramp time


@dataclass(frozen=True)
class Task:
    """About `starts` starts of the crane drive of [G] under a ramp of 0.3 to 0.6 s sampled at 1 kHz.

    Gap 0.25 to 4 rad and load inertia 2 to 10 J1 take as many values each as it needs, stiffness (half to
    twice) and ramp time ten.

    >>> Task(1_000_000).shape
    (100, 100, 10, 10)
    """

    starts: int

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Values along gap, load inertia, stiffness and ramp time."""
        side = max(2, round(math.sqrt(self.starts / FEW**2)))
        return side, side, FEW, FEW

    @property
    def size(self) -> int:
        """How many starts these are."""
        return math.prod(self.shape)

    @property
    def arguments(self) -> list[str]:
        """Of `softstart sweep`."""
        gaps, inertias, stiffnesses, times = self.shape
        axes = (
            f"shaft.gap=0.25:4:{gaps}",
            f"load.inertia=0.07:0.35:{inertias}",
            f"shaft.stiffness=184:737:{stiffnesses}:log",
            f"controller.time=0.3:0.6:{times}",
        )
        given = [word for axis in axes for word in ("--axis", axis)]
        return ["sweep", DRIVE, "--controller", CONTROLLER, "--param", f"period={PERIOD}", *given]


def sample(results: xarray.Dataset, count: int) -> Iterator[tuple[Line, float, float]]:
    """Starts spread at random over the grid: each for the peer, its mean torque, and the K_dyn found."""
    drive = Drive.load(DRIVE)
    rng = np.random.default_rng(1)
    for flat in rng.choice(results.k_dyn.size, size=min(count, results.k_dyn.size), replace=False):
        index = np.unravel_index(int(flat), results.k_dyn.shape)
        one = results.k_dyn[tuple(int(i) for i in index)]
        own = drive.replace(**{name: float(one[name]) for name in ("gap", "load_inertia", "stiffness")})
        line = Problem(CONTROLLER, ramp_time=float(one.controller_time)).line(own)
        yield line, float(own.mean_torque), float(one)
