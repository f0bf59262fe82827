"""The study of pulse-coast-hold: what it says is what came out; a part of the grid with an active load."""

from __future__ import annotations

import numpy as np
import pytest

from softstart import simulate
from softstart.optimal.optimize import optimize
from softstart.study import Verdict
from softstart_studies.crane import LAG, WITH_INVERTER
from softstart_studies.pulse_coast_hold import (
    Case,
    Extent,
    Grid,
    cases,
    ideal,
    invariant_to_the_gap,
    near_the_optimum,
    run,
    starts,
    within_tolerances,
)

# a light enough part: the optimum has its closed form there
PART = Extent(
    kinds=("active",),
    gaps=(0.5, 1.0),
    ratios=(5.0,),
    phases=3,
    tolerance_gaps=(0.5,),
    tolerance_ratios=(5.0,),
    deviations=(),
)


def test_cells_are_single_starts_over_the_optimum_of_an_ideal_torque():
    found = run("active", PART.gaps, PART.ratios, PART.phases)
    runs = [
        simulate(drive, "pulse-coast-hold", fitted_to=WITH_INVERTER)
        for drive in starts("active", (1.0,), (5.0,), PART.phases).elements()
    ]
    assert found.k_dyn[1, 0].tolist() == [start.k_dyn for start in runs]
    latest = max(start.start_time for start in runs)
    best = optimize(ideal("active", 1.0, 5.0), latest, terminal="reached")
    assert found.over[1, 0].max() == pytest.approx(max(start.k_dyn for start in runs) / best.k_dyn, rel=1e-12)


def test_tolerances_named_are_tolerances_run():
    found = cases("active", PART, lambda text: None)
    assert [case.what for case in found] == [
        "as told", "lag assumed 1 ms", "lag assumed 3 ms", "dead time 1 ms"
    ]  # fmt: skip
    batch = starts("active", (0.5,), (5.0,), PART.phases)
    told = WITH_INVERTER.replace(torque_lag=0.5 * LAG)
    runs = [simulate(drive, "pulse-coast-hold", fitted_to=told) for drive in batch.elements()]
    assert found[1].k_dyn == max(run.k_dyn for run in runs)


def worked_out(*k: list[float]) -> Grid:
    """A gap for each list of K_dyn, J2 = 2 J1; the optimum is 0.97."""
    k_dyn = np.array(k)[:, None, :]
    time = np.full_like(k_dyn, 0.2)
    optimum = np.full((len(k), 1, 1), 0.97)
    return Grid("reactive", (0.5, 2.0), (2.0,), k_dyn, time, np.ones_like(time), optimum)


def test_verdicts_follow_the_numbers():
    good, bad = worked_out([1.0, 1.02], [1.0, 1.02]), worked_out([1.0, 1.02], [1.0, 1.2])
    assert good.spread(good.k_dyn) == pytest.approx(0.02 / 1.01)
    assert good.spread(good.optimum) == 0.0
    for found, verdict in ((good, Verdict.CONFIRMED), (bad, Verdict.REFUTED)):
        assert near_the_optimum(found).verdict is invariant_to_the_gap(found).verdict is verdict
    assert within_tolerances([Case("active", "x", 1.2, 1.29)]).verdict is Verdict.CONFIRMED
    assert within_tolerances([Case("active", "x", 1.2, 1.31)]).verdict is Verdict.REFUTED
