"""`softstart study gaps-and-inertias`: a part of it against single starts, the rule of tuning, optima."""

from __future__ import annotations

import numpy as np
import pytest

from softstart import simulate
from softstart.study import Verdict
from softstart_studies.crane import WITH_INVERTER, published
from softstart_studies.gaps_and_inertias import Extent, grid, present

PART = Extent(
    gaps=(0.5, 2.0),
    inertias=(5.0,),
    restarts=1,
    generations=3,
    controllers=("ramp", "acceleration-delay"),
    front_points=3,
)


pytestmark = pytest.mark.slow  # all wait for the study


@pytest.fixture(scope="module")
def found():
    return grid(PART, lambda text: None)


@pytest.mark.parametrize("name", ["ramp", "acceleration-delay"])
def test_every_cell_is_a_start_that_can_be_repeated(found, name):
    tuning = found.tunings[name]
    for i, gap in enumerate(PART.gaps):
        for j, ratio in enumerate(PART.inertias):
            drive = WITH_INVERTER.replace(gap=gap, load_inertia=ratio * WITH_INVERTER.J1)
            run = simulate(drive, tuning.scheduled)
            assert found.values(name, "tuned", "k_dyn")[i, j] == pytest.approx(run.k_dyn, rel=1e-12)
            assert run.start_time <= simulate(drive, published(name)).start_time * (1.0 + 1e-12)
            robust = simulate(drive, tuning.robust.controller)
            assert found.values(name, "one set", "k_dyn")[i, j] == pytest.approx(robust.k_dyn, rel=1e-12)
            # no start is gentler than the optimum in its own time (1 %: three optima, interpolated)
            over = found.ratio(name, "tuned")[i, j]
            assert np.isnan(over) or over > 0.99


def test_the_rule_holds_and_is_said(found):
    assert all(found.never_worse(name) for name in found.tunings)
    result = present(found, lambda text: None)
    (first, *_) = result.claims
    assert first.verdict is Verdict.CONFIRMED
    assert first.evidence.startswith("4 cells and controllers compared")
