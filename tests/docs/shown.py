"""Whether a page shows what a program prints: all lines, words alike, numbers within the digits shown."""

from __future__ import annotations

import re

NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")
SKIP = "..."


def difference(shown: str, printed: str, ended: bool = True) -> str:
    """The first line that is only shown or only printed; nothing if the page shows the output whole.

    A line `...` stands for any lines, at the end of a line for the rest of it; a program that has not
    `ended` may print more.

    >>> difference("K 0.91\\n...\\nend ...", "K 0.9092\\nmore\\nend of it")
    ''
    >>> difference("K 0.93", "K 0.9092"), difference("a\\nc", "a\\nb\\nc"), difference("a", "a\\nb")
    ('not printed: K 0.93', 'not shown: b', 'not shown: b')
    >>> difference("a", "a\\nb", ended=False), difference("...\\nb", "a\\nb"), difference("a\\n...\\na", "a")
    ('', '', 'not printed: a')
    """
    left, skips = _lines(printed), False
    for line in _lines(shown):
        if line == SKIP:
            skips = True
            continue
        at = next((i for i, one in enumerate(left) if alike(line, one)), None)
        if at is None:
            return f"not printed: {line}"
        if at and not skips:
            return f"not shown: {left[0]}"
        left, skips = left[at + 1 :], False
    return f"not shown: {left[0]}" if left and ended and not skips else ""


def _lines(text: str) -> list[str]:
    return [one.strip() for one in text.splitlines() if one.strip()]


def alike(shown: str, printed: str) -> bool:
    """Whether one line stands for the other.

    >>> alike("start time 0.288 s", "start  time   0.28831 s"), alike("0.29 s", "0.28 s"), alike("3 m", "3 s")
    (True, False, False)
    """
    if shown.endswith(SKIP):
        words = shown.removesuffix(SKIP).split()
        return len(printed.split()) >= len(words) and _alike(words, printed.split()[: len(words)])
    return _alike(shown.split(), printed.split())


def named(comment: str) -> list[str]:
    """The figures in a comment that says nothing else.

    >>> named("1.267724, then 2.389365"), named("takes 3 s")
    (['1.267724', '2.389365'], [])
    """
    return NUMBER.findall(comment) if re.fullmatch(r"[-+\d.,e\s]*(?:then[-+\d.,e\s]*)*", comment) else []


def among(figure: str, printed: str) -> bool:
    """Whether a figure is among those printed, to the digits that both have.

    >>> among("3.117851", "K_dyn  3.11785, at 1 s"), among("3.12", "3.11785"), among("3.13", "3.11785")
    (True, True, False)
    """
    return any(_equal(figure, one) or _equal(one, figure) for one in NUMBER.findall(printed))


def _alike(shown: list[str], printed: list[str]) -> bool:
    one, other = " ".join(shown), " ".join(printed)
    if NUMBER.sub("#", one) != NUMBER.sub("#", other):
        return False
    numbers = zip(NUMBER.findall(one), NUMBER.findall(other), strict=True)
    return all(_equal(a, b) for a, b in numbers)


def _equal(shown: str, printed: str) -> bool:
    """Equal when rounded to the digits shown."""
    a, b = (float(text.replace(",", "")) for text in (shown, printed))
    mantissa, _, exponent = shown.replace(",", "").partition("e")
    digits = len(mantissa.partition(".")[2])
    return abs(a - b) <= 0.5001 * 10.0 ** (int(exponent or 0) - digits)
