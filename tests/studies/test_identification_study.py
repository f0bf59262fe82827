"""`softstart study identification`: the peer's model is the plant's, and it finds the truth."""

from __future__ import annotations

import numpy as np
import pytest

from softstart.identification.planning import Experiment, simulated_log
from softstart.profile import TorqueProfile
from softstart_studies import identification as peers


def exact_log(position: float, lines: float = 0.0) -> peers.Log:
    """The log of the study without errors of torque and encoder."""
    reversal = Experiment(
        "reversal", TorqueProfile.steps(peers.EDGES, peers.LEVELS), peers.EDGES[-1], {}, 0, 0
    )
    drive = peers.drive().replace(encoder_lines=lines)
    return simulated_log(drive, reversal, log_period=peers.PERIOD, position=position)


@pytest.mark.parametrize("position", [-0.8, 0.5])
def test_the_motion_by_lsoda_is_that_of_the_plant(position):
    log = exact_log(position)
    path = peers.moved([*np.log(peers.truth()), 1.0 + np.arctanh(position), 1.0], log)
    # held samples begin and end within a step of the integrator
    assert np.abs(path - log.values).max() < 2e-4 * np.abs(log.values).max()


@pytest.mark.slow
def test_least_squares_finds_the_truth_where_nothing_is_disturbed():
    truth = peers.truth()
    values, ends = peers.by_lsoda(exact_log(-0.4), peers.drive())
    assert values == pytest.approx(truth, rel=0.02)
    assert np.all(ends[:, 0] < ends[:, 1])
