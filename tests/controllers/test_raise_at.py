"""The strategies of [G] that raise their torque at the peak of stage 2, (14), or at its end, (15)."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from softstart import Drive, machine_table, simulate
from softstart.arrays import Vector
from softstart.controller import make_controller
from softstart.kernel.records import S_REF, S_START
from softstart_controllers.reduced_two_stage import ReducedTwoStage

CRANE = Drive.load("crane-4amtkf")
NAMES = ("reduced-two-stage", "acceleration-delay")
GAPS, INERTIAS = (0.05, 0.25, 1.0, 2.0), (0.4, 2.0, 5.0, 20.0)  # rad; over J1
POSITIONS = ("mid-gap", "driving-flank", "opposite-flank", "hanging")


def cell(name: str, where: str, damping: float, kind: str) -> Vector:
    """K_dyn over gaps and inertias: by how much `peak` is above `end`."""
    gap, inertia = (grid.ravel() for grid in np.meshgrid(GAPS, INERTIAS, indexing="ij"))
    J2 = inertia * CRANE.J1
    drive = CRANE.replace(torque_lag=0.004, load_kind=kind, start_position=where)
    d = [2.0 * damping * CRANE.c / CRANE.replace(load_inertia=one).Omega for one in J2.tolist()]
    drives = machine_table(drive, gap=gap, load_inertia=J2, damping=d)
    peak, end = (simulate(drives, make_controller(name, {"raise_at": at})) for at in ("peak", "end"))
    return (peak.k_dyn - end.k_dyn).values


@pytest.mark.parametrize("name", NAMES)
def test_the_crane(name: str) -> None:
    """Gentler and faster, from the same measurement."""
    end, peak = (simulate(CRANE, make_controller(name, {"raise_at": at})) for at in ("end", "peak"))
    assert (round(end.k_dyn, 3), round(end.start_time, 4)) == (2.387, 0.4033)
    assert peak.k_dyn < 1.3
    assert round(peak.start_time, 3) == 0.392
    assert peak.contacts == 1
    assert simulate(CRANE, name).k_dyn == peak.k_dyn  # it is the default


def test_the_torque_is_raised_at_the_located_peak() -> None:
    run = simulate(CRANE, ReducedTwoStage(torque=15.5, raise_at="peak"))
    spans = run.trajectory.spans
    raised = spans[spans[:, S_REF] == 62.0][0, S_START]
    assert float(run.at(raised)["v"]) == pytest.approx(0.0, abs=1e-9)  # T' = c v


@pytest.mark.parametrize("name", NAMES)
def test_peak_is_never_harder_over_a_map(name: str) -> None:
    for where, damping, kind in itertools.product(POSITIONS, (0.0, 0.1), ("active", "reactive")):
        if (where, kind) != ("hanging", "reactive"):
            assert cell(name, where, damping, kind).max() < 1e-6, (where, damping, kind)
