"""How far the work is: what is being done, how many starts were made, and how fast."""

from __future__ import annotations

import time
from collections.abc import Callable

Progress = Callable[[str], object]


class Log:
    """Counts starts, and tells whoever wants to know.

    >>> log = Log(print)
    >>> log.begin("schedule", 12)
    schedule 0 of 12, 0 starts
    """

    def __init__(self, progress: Progress | None) -> None:
        self.progress = progress
        self.began = time.perf_counter()
        self.starts = 0
        self.title, self.total, self.done = "", 0, 0

    def begin(self, title: str, total: int = 0, done: int = 0) -> None:
        """A new piece of work, of so many parts."""
        self.title, self.total, self.done = title, total, done
        self._tell()

    def did(self, starts: int, parts: int = 1) -> None:
        """So many starts more, and parts."""
        self.starts += starts
        self.done += parts
        self._tell()

    @property
    def seconds(self) -> float:
        """Since the work began."""
        return time.perf_counter() - self.began

    def _tell(self) -> None:
        if self.progress is None:
            return
        parts = f" {self.done} of {self.total}" if self.total else ""
        rate = f", {self.starts / self.seconds:,.0f}/s" if self.starts else ""
        self.progress(f"{self.title}{parts}, {self.starts:,} starts{rate}")
