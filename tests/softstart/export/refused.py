# ruff: noqa: PLW0603, PLW2901, B007, PLW0120, B020
"""Functions that cannot be translated; the line that is to be named ends in a comment."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softstart.controller.compiled import compiled

TOTAL = 0.0
TABLE = np.array([1.0, 2.0])


def listed(x: float) -> float:
    parts = [x * k for k in range(3)]  # here
    return parts[0]


def summed(x: float) -> float:
    return sum(k * x for k in range(3))  # here


def texts(x: float) -> float:
    name = f"{x:g}"  # here
    return len(name)


def tried(x: float) -> float:
    try:  # here
        return 1.0 / x
    except ZeroDivisionError:
        return 0.0


def raised(x: float) -> float:
    if x < 0.0:
        raise ValueError  # here
    return x


def globally(x: float) -> float:
    global TOTAL  # here
    TOTAL += x
    return TOTAL


def allocated(x: float) -> float:
    room = np.zeros(3)  # here
    return float(room[0]) + x


def plain(x: float) -> float:
    return x


def calls_plain(x: float) -> float:
    return plain(x)  # here


def keyword(x: float) -> float:
    return math.copysign(x, y=1.0)  # type: ignore[call-arg]  # here


def attribute(x: float) -> float:
    return x.real  # here


def beyond_loop(n: int) -> float:
    for i in range(n):
        pass
    return 1.0 * i  # here


def changes_loop_variable(n: int) -> float:
    total = 0.0
    for i in range(n):
        i += 1  # here
        total += i
    return total


def fractional(x: float) -> float:
    total = 0.0
    for i in range(x):  # type: ignore[call-overload]  # here
        total += i
    return total


def several_lengths(x: float) -> Any:
    if x > 0.0:
        return x, x
    return x  # here


def with_else(n: int) -> float:
    for i in range(n):  # here
        pass
    else:
        return 1.0
    return 0.0


def ambiguous(o: Any, p: Any, x: float) -> float:
    if x > 0.0:  # noqa: SIM108  what is refused
        part = o.inner
    else:
        part = p.inner
    return part.low  # here


def sliced(o: Any) -> float:
    return o.inner.ring[1:]  # here


def shifted(n: int) -> float:
    return n << 2  # here


def unknown_field(o: Any) -> float:
    return o.nothing  # here


def asserted(x: float) -> float:
    assert x > 0.0  # here
    return x


def one_of_two(x: float) -> float:
    return x or 1.5  # here


def same_loop_name(n: int) -> int:
    total = 0
    for i in range(3):
        for i in range(n):  # here
            total += i
    return total


def in_a_later_bound(n: int) -> int:
    total = 0
    for i in range(n):
        total += i
    for i in range(5, i):  # here
        total += i
    return total


def without_a_value(x: float) -> Any:  # here
    if x > 0.0:
        return x


@compiled
def moved(o: Any) -> int:
    o.sample += 1
    return o.sample % 3


def chained(o: Any, x: float) -> bool:
    return x < o.x < moved(o)  # here


def in_a_place(o: Any) -> float:
    o.inner.ring[moved(o)] += 1.0  # here
    return o.x


def beside_an_index(o: Any) -> float:
    o.inner.ring[o.sample % 4] += moved(o)  # here
    return o.x


def copies(o: Any, p: Any) -> float:
    o.inner, p.inner = p.inner, o.inner  # here
    return o.x


def beyond(o: Any) -> float:
    return o.inner.ring[4]  # here


def beyond_a_tuple(x: float) -> float:
    return (x, 1.0)[2]  # noqa: PLE0643  # here


def fixed(x: float) -> float:
    TABLE[0] = x  # here
    return x


def huge(n: int) -> int:
    return n + 2**64  # here


def by_nothing(n: int) -> int:
    return n + 1 // 0 + n.nothing  # here


def whole_powers(n: int) -> int:
    return n**-n  # here


def several_arguments(x: float) -> float:
    return halved(x, x)  # here


@compiled
def halved(x: float) -> float:
    return 0.5 * x


def keywords_only(x: float, *, y: float) -> float:  # here
    return x + y
