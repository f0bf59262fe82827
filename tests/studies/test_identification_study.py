"""`softstart study identification`: the peer's model is the plant's, the table counts what they find."""

from __future__ import annotations

import numpy as np
import pytest

from softstart import Drive
from softstart.errors import InputError
from softstart.identification.planning import Experiment, made_up_log
from softstart.profile import TorqueProfile
from softstart_studies import identification as peers


def exact_log(position: float, lines: float = 0.0) -> peers.Log:
    """The log of the study without errors of torque and encoder."""
    reversal = Experiment(
        "reversal", TorqueProfile.steps(peers.EDGES, peers.LEVELS), peers.EDGES[-1], {}, 0, 0
    )
    drive = peers.drive().replace(encoder_lines=lines)
    return made_up_log(drive, reversal, log_period=peers.PERIOD, position=position)


@pytest.mark.parametrize("position", [-0.8, 0.0, 0.5])
def test_the_motion_by_lsoda_is_that_of_the_plant(position):
    log = exact_log(position)
    path = peers.moved([*np.log(peers.truth()), 1.0 + np.arctanh(position), 1.0], log)
    # held samples begin and end within a step of the integrator
    assert np.abs(path - log.values).max() < 2e-4 * np.abs(log.values).max()


def test_least_squares_finds_the_truth_where_nothing_is_disturbed():
    truth = peers.truth()
    values, ends = peers.by_lsoda(exact_log(-0.4), peers.drive())
    assert values == pytest.approx(truth, rel=0.02)
    assert np.all(ends[:, 0] < ends[:, 1])


def test_the_table_counts_fits_and_intervals(monkeypatch):
    truth = peers.truth()

    def near(log: peers.Log, guess: Drive) -> tuple[peers.Vector, peers.Matrix]:
        return 1.01 * truth, np.array([0.9 * truth, 1.005 * truth]).T

    def astray(log: peers.Log, guess: Drive) -> tuple[peers.Vector, peers.Matrix]:
        return 3.0 * truth, np.zeros((5, 0))

    def none(log: peers.Log, guess: Drive) -> tuple[peers.Vector, peers.Matrix]:
        raise InputError("no fit")

    monkeypatch.setattr(peers, "METHODS", {"softstart": near, "astray": astray, "none": none})
    result = peers.IdentificationStudy(peers.Extent(logs=2, factors=(1.0,))).run(None, lambda text: None)
    rows = [list(row) for row in result.tables[0].rows]
    assert rows[0][2:9] == [0.995] * 5 + ["10 of 10", 0]
    assert rows[1][2:9] == [None] * 5 + ["none", 2]
    assert rows[2][8] == 2
