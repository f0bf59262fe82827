"""Processes that compute: one that dies costs nothing, one that dies of its chunk is an error and no hang."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

from softstart import Command, Drive, InputError, PlainController, SimulationError, sweep
from softstart.sweeping import entry

from .conftest import alive, children

CRANE = Drive.load("crane-4amtkf")


@pytest.mark.slow
def test_a_killed_process_costs_nothing(sweeping, uninterrupted, tmp_path, monkeypatch):
    monkeypatch.setattr(entry, "first_start", lambda *asked: False)  # as if not compiled: no threads
    others, killed = set(children(os.getpid())), []  # those of earlier tests in this process

    def kill(now):
        if now.done and len(killed) < 2:
            killed.append(next(pid for pid in children(os.getpid()) if pid not in others))
            os.kill(killed[-1], signal.SIGKILL)

    found = sweep(
        "crane-4amtkf", "current-limit-feedback", sweeping.grid, to=tmp_path / "a", workers=2,
        chunk=sweeping.chunk, progress=kill,
    )  # fmt: skip
    assert len(killed) == 2
    assert not [pid for pid in children(os.getpid()) if alive(pid) and pid not in others]
    assert found.drop_attrs().identical(uninterrupted.drop_attrs())


DEADLY = """
import os, signal
from dataclasses import dataclass
from softstart import Command, PlainController

@dataclass(frozen=True)
class Deadly(PlainController):
    share: float = 1.0

    def step(self, measured, state):
        if self.share == 0.5:
            os.kill(os.getpid(), signal.SIGKILL)
        if self.share == 0.25:
            raise ZeroDivisionError("a share of nothing")
        return Command(62.0 * self.share, measured.time + 0.01)
"""


@pytest.mark.slow
def test_a_chunk_that_kills_its_process_is_an_error_that_keeps_the_rest(tmp_path):
    (tmp_path / "mine.py").write_text(DEADLY)
    name = f"{tmp_path / 'mine.py'}:Deadly"
    grid = {"controller.share": [1.0, 0.9, 0.5, 0.8]}
    with pytest.raises(SimulationError, match=r"process died 2 times \(signal 9\).*chunk 2 of the sweep"):
        sweep(CRANE, name, grid, to=tmp_path / "a", workers=2, chunk=1)
    assert {"0", "1"} <= {path.name for path in (tmp_path / "a" / "status" / "c").iterdir()}
    with pytest.raises(SimulationError, match=r"controller Deadly failed .*mine\.py.*a share of nothing"):
        sweep(CRANE, name, {"controller.share": [1.0, 0.9, 0.25]}, workers=2, chunk=1)
    assert not [pid for pid in children(os.getpid()) if alive(pid)]


def test_objects_that_no_other_process_can_load_are_refused():
    class Local(PlainController):
        def step(self, measured, state):
            return Command(62.0)

    with pytest.raises(InputError, match=r"the controller cannot be handed .*Local.*workers=1"):
        sweep(CRANE, Local(), {"gap": [0.5, 1.0]}, workers=2, chunk=1)
    assert sweep(CRANE, Local(), {"gap": [0.5, 1.0]}, workers=1).status.values.tolist() == [0, 0]


SIZES = """
import sys
import numpy as np
from pathlib import Path
from softstart import sweep
grid = {"gap": np.linspace(0.1, 4, int(sys.argv[1])), "load_inertia": np.linspace(0.05, 0.4, 1000)}
sweep("crane-4amtkf", "direct", grid, to=sys.argv[2], workers=1, chunk=4000)
lines = Path("/proc/self/status").read_text().splitlines()
print(next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024)
"""


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="memory is told by Linux")
def test_memory_does_not_grow_with_the_grid(tmp_path):
    peaks = []
    for gaps in (20, 400):  # 400,000 starts: 13 MB of figures, 3 MB for each axis spread over the grid
        told = subprocess.run(
            [sys.executable, "-c", SIZES, str(gaps), str(tmp_path / str(gaps))],
            capture_output=True,
            check=True,
        )
        peaks.append(float(told.stdout))
    assert peaks[1] - peaks[0] < 5.0


def test_a_grid_of_a_million_million_starts_begins_at_once(tmp_path):
    class EnoughError(Exception):
        pass

    def stop(now):
        if now.done > 0:
            raise EnoughError

    axis = np.linspace(0.1, 0.4, 10_000)
    grid = {"gap": axis, "load_inertia": axis, "stiffness": 1000.0 * axis}
    tracemalloc.start()
    try:
        with pytest.raises(EnoughError):
            sweep(CRANE, "direct", grid, to=tmp_path / "a", workers=1, progress=stop)
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()
