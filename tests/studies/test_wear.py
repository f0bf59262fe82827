"""`softstart study wear`: a short life against single starts and single optima."""

from __future__ import annotations

import numpy as np
import pytest

from softstart import optimize, simulate
from softstart_studies.crane import WITH_INVERTER, published
from softstart_studies.wear import Extent, live

PART = Extent(
    life=(0.5, 1.0),
    scheduled=(0.5, 1.0),
    restarts=1,
    generations=3,
    controllers=("ramp", "acceleration-delay"),
    front_points=4,
)
NEW = WITH_INVERTER
pytestmark = pytest.mark.slow  # all wait for the study


@pytest.fixture(scope="module")
def life():
    return live(PART, lambda text: None)


def test_defaults_and_fixed_gains_are_those_of_the_new_drive(life):
    for name, ways in life.courses.items():
        for gap, k in zip(life.gaps, ways["defaults"].k_dyn, strict=True):
            assert simulate(NEW.replace(gap=gap), published(name), fitted_to=NEW).k_dyn == k
        assert ways["fixed"].k_dyn[0] == pytest.approx(ways["scheduled"].k_dyn[0], rel=1e-12)


def test_the_front_between_its_points_is_the_optimum_to_half_a_percent(life):
    front = life.fronts[0]
    time = float(np.sqrt(front.start_times[1] * front.start_times[2]))
    best = optimize(NEW.replace(torque_lag=0.0), time, terminal="reached").k_dyn
    assert front.at(time) == pytest.approx(best, rel=5e-3)
    assert np.isnan(front.at(0.5 * front.start_times[0]))
    assert np.all(np.diff(front.k_dyn) <= 1e-9)
