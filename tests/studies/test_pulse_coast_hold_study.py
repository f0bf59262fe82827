"""The study of pulse-coast-hold: what it says is what came out; a part of the grid with an active load."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softstart import simulate
from softstart.optimal.optimize import optimize
from softstart.study import Verdict, find_study
from softstart_studies.pulse_coast_hold import PulseCoastHoldStudy, present
from softstart_studies.pulse_coast_hold.cells import Cell, grid, spread, spread_of_optimum
from softstart_studies.pulse_coast_hold.crane import LAG, TOLD, Extent, ideal, starts
from softstart_studies.pulse_coast_hold.pictures import ratios_figure, tolerances_figure
from softstart_studies.pulse_coast_hold.tolerances import Case, cases, rounded_up
from softstart_studies.pulse_coast_hold.verdicts import of_grid, of_tolerances

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


@pytest.fixture(scope="module")
def result():
    return present(PART, lambda text: None)


def test_it_is_registered():
    assert isinstance(find_study("pulse-coast-hold"), PulseCoastHoldStudy)


def test_drives_of_the_grid():
    batch = starts("reactive", (0.5, 2.0), (2.0, 5.0), 4)
    one = next(batch.elements())
    assert (one.gap, one.load_inertia, one.encoder_phase) == (0.5, 2.0 * TOLD.J1, 0.0)
    assert (one.torque_lag, one.encoder_lines, one.load_kind) == (LAG, 4096, "reactive")
    assert ideal("active", 2.0, 5.0).torque_lag == 0.0


def test_cells_are_single_starts_over_the_optimum_of_an_ideal_torque():
    cell = grid("active", PART, lambda text: None)[1]
    runs = [
        simulate(drive, "pulse-coast-hold", fitted_to=TOLD)
        for drive in starts("active", (1.0,), (5.0,), PART.phases).elements()
    ]
    assert cell.k_dyn.tolist() == [run.k_dyn for run in runs]
    latest = max(run.start_time for run in runs)
    best = optimize(ideal("active", 1.0, 5.0), latest, terminal="reached")
    assert cell.over.max() == pytest.approx(max(run.k_dyn for run in runs) / best.k_dyn, rel=1e-12)
    for run in runs:  # what is said is no smaller than the ratio at the own start time
        own = optimize(ideal("active", 1.0, 5.0), run.start_time, terminal="reached").k_dyn
        assert run.k_dyn / own <= run.k_dyn / best.k_dyn * (1.0 + 1e-9)


def test_rounding_up_gives_more_time():
    for time in np.linspace(0.1, 0.5, 50):
        assert 1.0 <= rounded_up(time) / time <= 1.01 + 1e-12


def test_tolerances_named_are_tolerances_run():
    found = cases("active", PART, lambda text: None)
    assert [case.what for case in found] == [
        "as told", "lag assumed 1 ms", "lag assumed 3 ms", "dead time 1 ms"
    ]  # fmt: skip
    batch = starts("active", (0.5,), (5.0,), PART.phases)
    told = TOLD.replace(torque_lag=0.5 * LAG)
    runs = [simulate(drive, "pulse-coast-hold", fitted_to=told) for drive in batch.elements()]
    assert found[1].k_dyn == max(run.k_dyn for run in runs)


def test_verdicts_follow_the_numbers():
    good = [Cell(gap, 2.0, np.array([1.0, 1.02]), np.array([0.2, 0.2]), 0.97, 1) for gap in (0.5, 2.0)]
    bad = [*good, Cell(1.0, 2.0, np.array([1.2]), np.array([0.2]), 1.0, 1)]
    assert spread(good) == pytest.approx(0.02 / 1.01)
    assert spread_of_optimum(good) == 0.0
    assert [claim.verdict for claim in of_grid("reactive", good)] == [Verdict.CONFIRMED, Verdict.CONFIRMED]
    assert [claim.verdict for claim in of_grid("reactive", bad)] == [Verdict.REFUTED, Verdict.REFUTED]
    assert of_tolerances([Case("active", "x", 1.2, 1.29)]).verdict is Verdict.CONFIRMED
    assert of_tolerances([Case("active", "x", 1.2, 1.31)]).verdict is Verdict.REFUTED


def test_tables_can_be_written_and_pictures_are_there(result):
    for table in result.tables:
        assert table.rows
        for row in table.rows:
            assert not any(isinstance(cell, float) and not math.isfinite(cell) for cell in row)
    assert tuple(result.figures) == PulseCoastHoldStudy.pictures
    assert len({claim.statement for claim in result.claims}) == len(result.claims)


def test_pictures_show_the_numbers():
    cells = [Cell(gap, 2.0, np.array([1.0]), np.array([0.2]), 0.95, 1) for gap in (0.5, 2.0)]
    axes = ratios_figure({"reactive": cells}).axes[0]
    assert axes.images[0].get_array().tolist() == [[pytest.approx(1.0 / 0.95)] * 2]
    axes = tolerances_figure([Case("active", "one", 1.1, 1.2), Case("active", "two", 1.1, 1.05)]).axes[0]
    assert list(axes.lines[0].get_xdata()) == [1.2, 1.05]
