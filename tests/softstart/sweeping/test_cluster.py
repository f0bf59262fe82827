"""Sweeps, tunings and limit curves on a dask cluster: a real scheduler and workers, one of them killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from softstart import Drive, InputError, parallel, pareto, sweep, tune

CRANE = Drive.load("crane-4amtkf")


class Cluster:
    """A scheduler on a free port, and workers of one thread each."""

    def __init__(self, folder):
        self.folder, self.processes, self.workers = folder, [], []
        self.log = (folder / "log").open("w")
        self._dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", "scheduler.json")

    def _dask(self, *arguments):
        command = [sys.executable, "-m", "dask", *arguments, "--dashboard-address", "127.0.0.1:0"]
        self.processes.append(subprocess.Popen(command, stdout=self.log, stderr=self.log, cwd=self.folder))
        return self.processes[-1]

    def address(self):
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            try:
                return json.loads((self.folder / "scheduler.json").read_text())["address"]
            except (OSError, ValueError):
                time.sleep(0.02)
        raise AssertionError((self.folder / "log").read_text())

    def with_workers(self, count):
        """The address, when so many workers are started, or more."""
        self.workers = [one for one in self.workers if one.poll() is None]
        worker = ("worker", self.address(), "--nthreads", "1", "--no-nanny", "--local-directory", "work")
        while len(self.workers) < count:
            self.workers.append(self._dask(*worker))
        return self.address()

    def close(self):
        for process in self.processes:
            process.kill()
            process.wait()
        self.log.close()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    pytest.importorskip("distributed")
    made = Cluster(tmp_path_factory.mktemp("cluster"))
    yield made
    made.close()


@pytest.mark.slow
def test_a_cluster_without_workers_is_named(cluster, monkeypatch):
    monkeypatch.setattr(parallel, "CLUSTER_TIMEOUT", 1.0)
    with pytest.raises(InputError, match="it has no worker; start some"):
        sweep(CRANE, "direct", {"gap": [0.5, 1.0]}, scheduler=cluster.address())


@pytest.mark.slow
def test_two_workers_of_which_one_is_killed_find_the_same(cluster, sweeping, uninterrupted, tmp_path):
    address = cluster.with_workers(2)
    killed = []

    def kill(now):
        if now.done >= 2000 and not killed:
            killed.append(cluster.workers[0].pid)
            os.kill(killed[0], signal.SIGKILL)

    found = sweep(
        "crane-4amtkf", "current-limit-feedback", sweeping.grid, to=tmp_path / "a", scheduler=address,
        chunk=sweeping.chunk, progress=kill,
    )  # fmt: skip
    assert killed
    assert found.drop_attrs().identical(uninterrupted.drop_attrs())
    assert len(sweeping.finished(tmp_path / "a")) == sweeping.chunks


@pytest.mark.slow
def test_tunings_and_limit_curves_are_the_same_on_a_cluster(cluster, tmp_path):
    address = cluster.with_workers(1)
    crane = CRANE.replace(target_speed=60.0)

    def told(result):
        found = {key: value for key, value in result.summary().items() if key != "seconds"}
        price = found.pop(
            "price"
        )  # whose lower bounds differ in the tenth digit with what was computed before
        return found, {key: np.array(value, dtype=object) for key, value in price.items()}

    def same(one, other):
        (found, price), (expected, prices) = told(one), told(other)
        assert {**found, "starts": 0} == {**expected, "starts": 0}
        for key, values in prices.items():
            assert price[key].ravel().tolist() == pytest.approx(values.ravel().tolist(), rel=1e-8)

    options = {"generations": 3, "population": 8, "restarts": 2, "start_time": "1.4x"}
    asked = (crane, "ramp", [0.5, 2.0], ["2 J1", "5 J1"])
    alone = tune(*asked, **options, workers=1)
    kept = tmp_path / "tuning.sqlite"
    same(tune(*asked, **options, scheduler=address, save_to=kept), alone)
    again = tune(*asked, **options, workers=1, save_to=kept)
    assert again.starts == 0
    same(again, alone)

    def points(front):
        return [{**point.summary(), "seconds": 0.0} for point in front.points], [
            one.summary() for one in front.controllers
        ]

    asked = (crane, [0.2, 0.2523, 0.3, 0.33])
    front = pareto(*asked, controllers=["ramp"])
    assert {point.method for point in front.points if point.found} == {"closed-form", "descent"}
    assert points(pareto(*asked, controllers=["ramp"], scheduler=address)) == points(front)


@pytest.mark.slow
def test_a_scheduler_that_is_not_there(monkeypatch):
    monkeypatch.setattr(parallel, "CLUSTER_TIMEOUT", 0.5)
    with pytest.raises(
        InputError, match=r'scheduler = "tcp://127\.0\.0\.1:9": no dask scheduler answers there'
    ):
        sweep(CRANE, "direct", {"gap": [0.5, 1.0]}, scheduler="tcp://127.0.0.1:9")


def test_without_dask_the_sentence_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'softstart\[cluster\]'"):
        sweep(CRANE, "direct", {"gap": np.array([0.5, 1.0])}, scheduler="tcp://127.0.0.1:9")
