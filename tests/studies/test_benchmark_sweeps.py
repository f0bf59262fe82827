"""The study of sweeps, small: its grid, its verdicts, and one real run with all its killing."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from softstart import sweep
from softstart.drive import Drive
from softstart.study import Verdict, find_study
from softstart_studies.benchmarks import lsoda
from softstart_studies.benchmarks.sweeps.study import BenchmarkSweeps, Found, _same, claims
from softstart_studies.benchmarks.sweeps.task import PERIOD, Task, sample

CRANE = Drive.load("crane-4amtkf")


@pytest.fixture(scope="module")
def few():
    """Few of the starts, with a ramp time that is no whole number of samples."""
    grid = {
        "gap": [0.25, 4.0],
        "load_inertia": [0.07, 0.3],
        "stiffness": [200.0, 700.0],
        "controller.time": [1 / 3],
    }
    return sweep(CRANE, "ramp", grid, parameters={"period": PERIOD}, workers=1)


def test_the_peer_solves_the_same_starts(few, monkeypatch):
    """LSODA comes nearer the tighter it is: the difference is its own."""
    apart = []
    for tolerance in (1e-6, 1e-11):
        monkeypatch.setattr(lsoda, "TOLERANCE", tolerance)
        found = [abs(lsoda.start(line)[0][0] / base - k_dyn) for line, base, k_dyn in sample(few, 2)]
        apart.append(max(found))
    assert apart[1] < 1e-7 < apart[0]


def test_sizes():
    assert Task(1_000_000).size == 1_000_000
    assert Task(400).shape == (2, 2, 10, 10)
    assert BenchmarkSweeps().task == Task(1_000_000)
    assert isinstance(find_study("benchmark-sweeps"), BenchmarkSweeps)


def test_the_same_is_the_same_to_the_bit(few):
    assert _same(few, few.copy(deep=True))
    other = few.copy(deep=True)
    other.k_dyn[0, 0, 0, 0] = np.nextafter(other.k_dyn[0, 0, 0, 0], 9)
    assert not _same(few, other)
    holes = few.copy(deep=True)
    holes.k_dyn[0, 0, 0, 0] = np.nan
    assert not _same(few, holes)
    assert _same(holes, holes.copy(deep=True))


def test_verdicts():
    def verdicts(**change):
        good = {
            "starts": 10, "rate": 5000.0, "peer_rate": 5.0, "apart": 1e-6, "memory": 500.0, "resumed": True,
            "kept": True, "on_cluster": True,
        }  # fmt: skip
        return [claim.verdict for claim in claims(Found(**(good | change)))]

    assert verdicts() == [Verdict.CONFIRMED] * 5
    for place, change in enumerate(
        ({"rate": 499.0}, {"apart": 1e-3}, {"memory": 2049.0}, {"kept": False}, {"on_cluster": False})
    ):
        found = verdicts(**change)
        assert found.pop(place) is Verdict.REFUTED
        assert set(found) == {Verdict.CONFIRMED}
    assert len(verdicts(memory=None, on_cluster=None)) == 3


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="processes are watched through /proc")
def test_a_small_run_is_killed_and_has_the_same_bits(tmp_path):
    told = []
    result = BenchmarkSweeps(starts=10_000, peer_starts=2, workers=1, clustered=False).run(
        tmp_path, told.append
    )
    for words in ("below 2 GiB", "Killed twice", "same K_dyn"):
        (claim,) = [claim for claim in result.claims if words in claim.statement]
        assert claim.verdict is Verdict.CONFIRMED, claim
    rates = dict(result.tables[1].rows)
    assert rates["starts by LSODA"] == 2
    assert not list(tmp_path.iterdir())
