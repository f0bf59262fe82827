"""The two ways in which softstart refuses to go on."""

from __future__ import annotations

from collections.abc import Iterable


class InputError(ValueError):
    """What was asked for cannot be done; every sentence names key, value, reason and remedy.

    All mistakes found in one input are collected, so that a user mends them in one go.

    >>> raise InputError(["gap = -1 rad: a gap is 0 or more."])
    Traceback (most recent call last):
    softstart.errors.InputError: gap = -1 rad: a gap is 0 or more.
    """

    def __init__(self, sentences: Iterable[str] | str) -> None:
        self.sentences: tuple[str, ...] = (sentences,) if isinstance(sentences, str) else tuple(sentences)
        super().__init__("\n".join(self.sentences))


class SimulationError(RuntimeError):
    """A start that was begun and cannot be finished: never a shortened result returned as a good one."""
