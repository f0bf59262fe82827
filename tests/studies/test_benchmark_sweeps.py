"""The study of sweeps, small: its grid, its verdicts, and one real run."""

from __future__ import annotations

import sys

import pytest

from softstart import sweep
from softstart.drive import Drive
from softstart.study import Verdict, find_study
from softstart_studies.benchmarks import lsoda
from softstart_studies.benchmarks.sweeps import PERIOD, BenchmarkSweeps, Found, Task, claims, sample

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


def test_verdicts():
    def verdicts(**change):
        good = {"starts": 10, "rate": 5000.0, "peer_rate": 5.0, "apart": 1e-6, "memory": 500.0}
        return [claim.verdict for claim in claims(Found(**(good | change)))]

    assert verdicts() == [Verdict.CONFIRMED] * 3
    for place, change in enumerate(({"rate": 499.0}, {"apart": 1e-3}, {"memory": 2049.0})):
        found = verdicts(**change)
        assert found.pop(place) is Verdict.REFUTED
        assert set(found) == {Verdict.CONFIRMED}
    assert len(verdicts(memory=None)) == 2


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="processes are watched through /proc")
def test_a_small_run(tmp_path):
    result = BenchmarkSweeps(starts=10_000, peer_starts=2, workers=1).run(tmp_path, lambda text: None)
    for words in ("below 2 GiB", "same K_dyn"):
        (claim,) = [claim for claim in result.claims if words in claim.statement]
        assert claim.verdict is Verdict.CONFIRMED, claim
    assert dict(result.tables[0].rows)["starts by LSODA"] == 2
    assert not list(tmp_path.iterdir())
