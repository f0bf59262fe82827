"""Processes that compute: one that dies costs nothing, one that dies of its chunk is an error and no hang."""

from __future__ import annotations

import os
import tracemalloc

import numpy as np
import pytest

from softstart import Command, Drive, InputError, PlainController, SimulationError, sweep

from .conftest import alive, children

CRANE = Drive.load("crane-4amtkf")


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
