"""Numbers and quantities as a report prints them."""

from __future__ import annotations

import math

MINUS, NOTHING = "\N{MINUS SIGN}", "\N{EN DASH}"
UNITS = {
    "kg*m^2": "kg m\N{SUPERSCRIPT TWO}",
    "N*m": "N m",
    "N*m/rad": "N m/rad",
    "N*m*s/rad": "N m s/rad",
    "N*m/s": "N m/s",
    "1": "",
}
RPM = 30.0 / math.pi  # of one rad/s


def fixed(value: float | None, decimals: int) -> str:
    """A number with so many decimals; a dash for what there is not.

    >>> fixed(0.98123, 3), fixed(float("nan"), 3), fixed(-1.5, 1)
    ('0.981', '\N{EN DASH}', '\N{MINUS SIGN}1.5')
    """
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return ("" if value > 0 else MINUS) + "infinite"
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if not text.strip("-0.") else text.replace("-", MINUS)


def digits(value: float | None, count: int = 4) -> str:
    """A number with so many significant digits, without an exponent where that can be read.

    >>> digits(0.0165988), digits(164.81), digits(2.6e-5), digits(368.465, 6)
    ('0.01660', '164.8', '2.600e\N{MINUS SIGN}05', '368.465')
    """
    if value is None or not math.isfinite(value) or value == 0.0:
        return fixed(value, 0)
    order = math.floor(math.log10(abs(value)))
    if not -4 <= order <= 6:
        return f"{value:.{count - 1}e}".replace("-", MINUS)
    return fixed(value, max(0, count - 1 - order))


def short(value: float) -> str:
    """A number as short as it is, at most six digits.

    >>> short(0.175), short(62.0), short(float("inf"))
    ('0.175', '62', 'infinite')
    """
    return fixed(value, 0) if not math.isfinite(value) else f"{value:.6g}".replace("-", MINUS)


def unit(written: str) -> str:
    """A unit as it is printed.

    >>> unit("N*m"), unit("rad/s")
    ('N m', 'rad/s')
    """
    return UNITS.get(written, written.replace("*", " "))


def percent(share: float, decimals: int = 1) -> str:
    """A share in per cent.

    >>> percent(0.0772)
    '7.7\N{NO-BREAK SPACE}%'
    """
    return f"{fixed(100.0 * share, decimals)}\N{NO-BREAK SPACE}%"


def decimals_of(step: float) -> int:
    """Decimals that show every multiple of a step.

    >>> decimals_of(0.5), decimals_of(0.01), decimals_of(1.0), decimals_of(0.125)
    (1, 2, 0, 3)
    """
    for count in range(9):
        if abs(step * 10**count - round(step * 10**count)) < 1e-9 * max(1.0, step * 10**count):
            return count
    return 9


def listed(words: list[str]) -> str:
    """Words in a row.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
