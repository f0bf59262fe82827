"""Sweeps, tunings and Pareto curves on a dask cluster: a real scheduler and workers, one of them killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from softstart import Drive, InputError, parallel, sweep

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
        deadline = time.monotonic() + 300
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
    client = pytest.importorskip("distributed").Client
    waits = client.wait_for_workers
    # the scheduler may take longer to answer
    monkeypatch.setattr(client, "wait_for_workers", lambda self, count, timeout: waits(self, count, 1.0))
    with pytest.raises(InputError, match="it has no worker; start some"):
        sweep(CRANE, "direct", {"gap": [0.5, 1.0]}, scheduler=cluster.address())


@pytest.mark.slow
def test_two_workers_of_which_one_is_killed_find_the_same(
    cluster, sweeping, uninterrupted, tmp_path, monkeypatch
):
    monkeypatch.setattr(parallel, "CLUSTER_TIMEOUT", 300.0)  # the workers may only just begin
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
