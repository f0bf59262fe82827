"""The grid in chunks: every start in one chunk and one only, no chunk larger than asked for."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from softstart.sweeping.grid import ChunkGrid

SHAPES = st.lists(st.integers(1, 9), min_size=1, max_size=4)


@given(SHAPES, st.integers(1, 50), st.integers(0, 15))
def test_chunks_part_the_grid(shape, most, singles):
    single = [bool(singles >> i & 1) for i in range(len(shape))]
    plan = ChunkGrid.of(shape, single, most)
    counted = np.zeros(plan.shape, dtype=int)
    for index in plan.indices():
        place = plan.place(index)
        counted[place] += 1
        assert counted[place].size == plan.size(index) <= most
        assert all(part.stop - part.start == 1 for part, alone in zip(place, single, strict=True) if alone)
    assert (counted == 1).all()


def test_chunks_of_a_grid_beyond_all_memory_are_found_at_once():
    plan = ChunkGrid.of([10_000] * 4, [False] * 4)
    assert plan.starts == 10**16
    assert math.prod(plan.chunk) <= 16_384
    last = plan.place([count - 1 for count in plan.counts])
    assert [part.stop for part in last] == [10_000] * 4
    assert next(plan.indices()) == (0, 0, 0, 0)


@given(st.integers(1, 10**12))
def test_small_grids_have_work_for_many(size):
    plan = ChunkGrid.of([size], [False])
    assert plan.chunk[0] <= 16_384
    assert math.prod(plan.counts) >= min(64, size // 1024)
