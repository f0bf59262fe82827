"""The two errors that softstart raises, the collector of their sentences, and one warning."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

MORE_MISTAKES = re.compile(r"(\d+) more errors\.")
MOST, LONGEST = 30, 1500  # sentences of one error, and characters of one sentence: more would fill pages


class Sentence(str):
    """A sentence of a result: the fact, then advice to the person who gives the input.

    As text it is both. A report for a customer shows `fact` alone, the page `fact` and its own advice.

    >>> sentence = Sentence("The position is unknown.", "Give start.position.", page="Choose a position.")
    >>> print(sentence)
    The position is unknown. Give start.position.
    >>> sentence.fact, sentence.on_page
    ('The position is unknown.', 'The position is unknown. Choose a position.')
    """

    fact: str
    advice: str
    on_page: str

    def __new__(cls, fact: str, advice: str = "", page: str | None = None) -> Sentence:
        self = super().__new__(cls, f"{fact} {advice}".strip())
        self.fact, self.advice = fact, advice
        self.on_page = f"{fact} {advice if page is None else page}".strip()
        return self

    def after(self, before: str) -> Sentence:
        """The same with a text in front."""
        return Sentence(before + self.fact, self.advice, self.on_page.removeprefix(self.fact).strip())


def fact_of(text: str) -> str:
    """A sentence without its advice."""
    return text.fact if isinstance(text, Sentence) else text


class InputError(ValueError):
    """The input is wrong; each sentence names the key, the value, the reason and the remedy.

    All mistakes of one input are collected, so that they can be corrected in one go; what is more than can be
    read is counted, and long sentences lose their middle.

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
        texts = [sentences] if isinstance(sentences, str) else list(sentences)
        if len(texts) > MOST + 1:
            texts[MOST:] = [f"{len(texts) - MOST} more errors."]
        self.sentences: tuple[str, ...] = tuple(map(_readable, texts))
        super().__init__("\n".join(self.sentences))


class Mistakes:
    """Collects what is wrong with an input, to raise it as one InputError.

    >>> mistakes = Mistakes()
    >>> with mistakes.collect():
    ...     raise InputError("gap = -1: a gap is 0 or more.")
    >>> mistakes.raise_if_any()
    Traceback (most recent call last):
    softstart.errors.InputError: gap = -1: a gap is 0 or more.
    """

    def __init__(self) -> None:
        self.sentences: list[str] = []

    @contextmanager
    def collect(self, before: str = "") -> Iterator[None]:
        """Keep the sentences of an InputError raised inside, each with `before` in front of it."""
        try:
            yield
        except InputError as error:
            self.sentences.extend(before + sentence for sentence in error.sentences)

    def raise_if_any(self, before: str = "") -> None:
        """Raise what was noted, if anything was, each with `before` in front of it."""
        if self.sentences:
            raise InputError([before + sentence for sentence in self.sentences])


def _readable(sentence: str) -> str:
    """The sentence without its middle if it is too long: what is wrong, and the remedy at its end."""
    if len(sentence) <= LONGEST:
        return sentence
    return f"{sentence[: LONGEST // 2]} ... {sentence[-LONGEST // 3 :]}"


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


class DamagedWarning(UserWarning):
    """Saved results are not as they were written; the sentence names the part, which is computed again."""


def listed(words: Sequence[str]) -> str:
    """Words in a sentence.

    >>> listed(["a", "b", "c"]), listed(["a"])
    ('a, b and c', 'a')
    """
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} and {words[-1]}"
