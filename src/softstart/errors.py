"""The two errors that softstart raises."""

from __future__ import annotations

from collections.abc import Iterable


class InputError(ValueError):
    """The input is wrong; each sentence names the key, the value, the reason and the remedy.

    All mistakes of one input are collected, so that they can be corrected in one go.

    Parameters
    ----------
    sentences : str or iterable of str
        One sentence for each mistake; the attribute `sentences` is the tuple of them.

    Examples
    --------
    >>> raise InputError(["gap = -1 rad: a gap is 0 or more."])
    Traceback (most recent call last):
    softstart.errors.InputError: gap = -1 rad: a gap is 0 or more.
    """

    def __init__(self, sentences: Iterable[str] | str) -> None:
        self.sentences: tuple[str, ...] = (sentences,) if isinstance(sentences, str) else tuple(sentences)
        super().__init__("\n".join(self.sentences))


class SimulationError(RuntimeError):
    """A simulation cannot be finished; a shortened result is never returned as a good one.

    Parameters
    ----------
    *args
        The sentence that says which start failed, and why.

    Examples
    --------
    >>> from softstart import SimulationError
    >>> issubclass(SimulationError, RuntimeError)
    True
    """
