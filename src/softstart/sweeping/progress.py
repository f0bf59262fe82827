"""How far a sweep is."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

RECENT = 30.0  # s, over which the rate is taken


@dataclass(frozen=True)
class Progress:
    """Starts finished of all, and of these by an earlier run; seconds of this run, and starts a second.

    >>> print(Progress(1500, 4000, 500, 2.0, 500.0))
    1,500 of 4,000 starts (37 %), 500 starts/s, 5 s left
    """

    done: int
    starts: int
    before: int
    seconds: float
    rate: float

    @property
    def left(self) -> float:
        """Seconds that are left at this rate, NaN as long as there is none."""
        return (self.starts - self.done) / self.rate if self.rate > 0.0 else math.nan

    def __str__(self) -> str:
        share = f"{self.done:,} of {self.starts:,} starts ({100 * self.done // self.starts:.0f} %)"
        if not self.rate > 0.0:
            return share
        return f"{share}, {self.rate:,.0f} starts/s, {_time(self.left)} left"


Told = Callable[[Progress], object]


class Watch:
    """Counts finished starts and tells how far the sweep is; the rate is that of the last half minute."""

    def __init__(self, starts: int, before: int, told: Told | None) -> None:
        self.starts, self.before, self.told = starts, before, told
        self.done = before
        self.begin = time.monotonic()
        self.marks = deque([(self.begin, before)])
        self._tell(self.begin)

    def add(self, starts: int) -> None:
        """So many more are finished."""
        self.done += starts
        now = time.monotonic()
        self.marks.append((now, self.done))
        while len(self.marks) > 2 and now - self.marks[1][0] > RECENT:
            self.marks.popleft()
        self._tell(now)

    def _tell(self, now: float) -> None:
        if self.told is None:
            return
        since, done = self.marks[0]
        rate = (self.done - done) / (now - since) if now > since else 0.0
        self.told(Progress(self.done, self.starts, self.before, now - self.begin, rate))


def _time(seconds: float) -> str:
    """A duration in words.

    >>> _time(59), _time(125), _time(7300)
    ('59 s', '2 min 5 s', '2 h 1 min')
    """
    whole = math.ceil(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
