"""`softstart study identification`: the peers' models are the plant's, the table counts what they find."""

from __future__ import annotations

import json

import numpy as np
import pytest

from softstart import Drive
from softstart.errors import InputError
from softstart.identification.planning import Experiment, made_up_log
from softstart.profile import TorqueProfile
from softstart.study import find_study
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
    truth = [np.log(float(getattr(peers.drive(), name))) for name in peers.NAMES]
    path = peers.moved([*truth, 1.0 + np.arctanh(position), 1.0], log)
    # held samples begin and end within a step of the integrator
    assert np.abs(path - log.values).max() < 2e-4 * np.abs(log.values).max()


def test_least_squares_finds_the_truth_where_nothing_is_disturbed():
    truth = np.array([float(getattr(peers.drive(), name)) for name in peers.NAMES])
    values, ends = peers.by_lsoda(exact_log(-0.4), peers.drive())
    assert values == pytest.approx(truth, rel=0.02)
    assert np.all(ends[:, 0] < ends[:, 1])


@pytest.mark.slow
def test_multiple_shooting_finds_the_truth_where_nothing_is_disturbed():
    """Its gap is a little off: the edges are rounded."""
    truth = np.array([float(getattr(peers.drive(), name)) for name in peers.NAMES])
    values, ends = peers.by_shooting(exact_log(-0.4), peers.drive())
    assert values == pytest.approx(truth, rel=0.03)
    assert np.all(ends[:, 0] <= ends[:, 1])


def test_a_speed_drop_needs_a_reversal():
    log = exact_log(0.0)
    with pytest.raises(InputError, match="never changes its sign"):
        peers.by_speed_drop(
            peers.Log(log.time, np.abs(log.torque), angle=log.values, torque_is="demand"), peers.drive()
        )


def test_the_table_counts_fits_and_intervals(monkeypatch):
    truth = np.array([float(getattr(peers.drive(), name)) for name in peers.NAMES])

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
    json.dumps(result.summary())
    assert list(result.figures) == list(peers.IdentificationStudy.pictures)


def test_it_is_found_by_its_name():
    assert isinstance(find_study("identification"), peers.IdentificationStudy)
