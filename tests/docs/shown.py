"""Whether a program printed what a page shows: words alike, numbers within the digits shown."""

from __future__ import annotations

import re

NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")
SKIP = "..."


def difference(shown: str, printed: str) -> str:
    """The first line that was not printed, or not after the one before it; nothing if all were.

    Lines may be left out; `...` says so to the reader, and at the end of a line skips the rest of it.

    >>> difference("K 0.91\\n...\\nend ...", "first\\nK 0.9092\\nmore\\nend of it")
    ''
    >>> difference("K 0.93", "K 0.9092")
    'not printed: K 0.93'
    >>> difference("c\\na", "a\\nb\\nc")
    'not printed after the line before it: a'
    """
    left = iter(printed.splitlines())
    wanted = [line for line in (one.strip() for one in shown.splitlines()) if line and line != SKIP]
    for line in wanted:
        if not any(alike(line, one.strip()) for one in left):
            elsewhere = any(alike(line, one.strip()) for one in printed.splitlines())
            return f"not printed{' after the line before it' if elsewhere else ''}: {line}"
    return ""


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
