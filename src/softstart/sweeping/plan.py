"""The grid cut into chunks, which are never listed: a chunk is a number, and its place follows from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from softstart.errors import InputError

MOST = 16_384  # starts of a chunk: sampled ones take about a second
LEAST = 1_024
PARTS = 64  # into which a small grid is cut, so that all processes have work


@dataclass(frozen=True)
class Plan:
    """A grid of `shape` in chunks of shape `chunk`, the last index fastest; those at the edge are smaller.

    >>> plan = Plan((3, 5), (1, 2))
    >>> plan.chunks, plan.index(5), plan.place(5), plan.size_at((1, 2))
    (9, (1, 2), (slice(1, 2, None), slice(4, 5, None)), 1)
    """

    shape: tuple[int, ...]
    chunk: tuple[int, ...]

    @property
    def starts(self) -> int:
        """How many starts the grid has."""
        return math.prod(self.shape)

    @property
    def counts(self) -> tuple[int, ...]:
        """How many chunks there are along each axis."""
        return tuple(-(-size // step) for size, step in zip(self.shape, self.chunk, strict=True))

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return math.prod(self.counts)

    def index(self, number: int) -> tuple[int, ...]:
        """Where a chunk stands among the chunks of each axis."""
        found = []
        for count in reversed(self.counts):
            number, remainder = divmod(number, count)
            found.append(remainder)
        return tuple(reversed(found))

    def place(self, number: int) -> tuple[slice, ...]:
        """The part of the grid that is a chunk's."""
        return self.place_at(self.index(number))

    def place_at(self, index: Sequence[int]) -> tuple[slice, ...]:
        """The same from where the chunk stands among the chunks of each axis."""
        return tuple(
            slice(i * step, min((i + 1) * step, size))
            for i, step, size in zip(index, self.chunk, self.shape, strict=True)
        )

    def size_at(self, index: Sequence[int]) -> int:
        """How many starts the chunk there has."""
        return math.prod(part.stop - part.start for part in self.place_at(index))


def plan_for(shape: Sequence[int], single: Sequence[bool], most: int | None = None) -> Plan:
    """Chunks of at most `most` starts, of one value along the axes that are `single`.

    Without `most` a chunk has a 64th of the grid, within 1,024 and 16,384 starts.

    >>> plan_for((1000, 1000), (False, False)).chunk, plan_for((2, 100), (True, False)).chunk
    ((15, 1000), (1, 100))
    """
    room = min(max(math.prod(shape) // PARTS, LEAST), MOST) if most is None else most
    chunk = []
    for size, alone in zip(reversed(shape), reversed(single), strict=True):
        step = 1 if alone else max(1, min(size, room))
        room //= step
        chunk.append(step)
    return Plan(tuple(shape), tuple(reversed(chunk)))


def checked_chunk(value: object) -> int | None:
    """The number of starts of a chunk, or None."""
    if value is None:
        return None
    if isinstance(value, int) and not isinstance(value, bool) and value >= 1:
        return value
    raise InputError(f"chunk = {value!r}: the starts of a chunk are a whole number of 1 or more.")
