"""Functions of every statement that can be translated; Python executes them too."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softstart.controller.compiled import compiled, record
from softstart.kernel.jit import as_record

TABLE = np.array([0.5, -1.5, 2.5, 8.0])
SCALE, COUNT, FAR = 2.5, 3, math.inf
PAIR = (1.0, 4.0)


class Inner:
    """Within a record."""

    low: float  # N m
    high: float
    ring: Any


class Outer:
    """A record with all that one may have."""

    x: float  # m
    sample: int
    running: bool
    inner: Inner
    grid: Any


INNER = record(Inner, ring=4)
OUTER = record(Outer, inner=INNER, grid=(3, 4))


def arithmetic(x: float, y: float, n: int, k: int) -> float:
    return x + y * SCALE - x * y / 4.0 - (x - y) + n * x - n / 2 + n // 3 + n % 3 + k // -2 + k % -4 - (-x)


def powers(x: float) -> float:
    return x**2 + (x + 1.0) ** 3 - x**4 + abs(x) ** 0.5


def comparisons(x: float, y: float, n: int, k: int) -> int:
    result = 0
    if x < y:
        result += 1
    if x <= y <= 2.0:
        result += 2
    if not (x == y or n != k) and x > -1.0:
        result += 4
    if n in (1, 3) or k not in (0, 2):
        result += 8
    if n:
        result += 16
    return result


def conditional(x: float, y: float) -> float:
    a, b = (x, y) if x > y else (y, 2.0 * x)
    c = 1.0 if a > 3.0 else -1.0 if a > 1.0 else 0.5
    return a * c + b


def extremes(x: float, y: float, n: int, k: int) -> float:
    return min(x, y, 1.0) + max(x, n) * 3.0 + min(n, k) + abs(n) + max(min(x, y), 0.0)


def mathematics(x: float, y: float) -> float:
    a = math.sqrt(abs(x)) + math.exp(-abs(y)) + math.log(1.0 + abs(x)) + math.sin(x) + math.cos(y)
    return a + math.atan2(x, 1.0 + abs(y)) + math.copysign(2.0, x) + math.floor(x) + math.ceil(y) + int(x)


def loops(n: int, x: float) -> float:
    total = 0.0
    for i in range(n):
        total += i * x
    for i in range(2, n):
        if i == 4:
            continue
        total -= i
    for i in range(n, -2, -2):
        total += 0.25 * i
        if total > 1e6:
            break
    for _ in range(3):
        total *= 0.5
    for share in (3.0, 2.0, x):
        total += share * share
    stop = n
    for i in range(stop):
        stop = 0
        total += i
    return total


def whiles(n: int, x: float) -> float:
    y, passes = x, 0
    while abs(y) > 0.1 and passes < n:
        y *= 0.5
        passes += 1
        if y == 0.25:
            break
        if passes % 2 == 0:
            continue
        y += 0.01
    while True:
        passes += 1
        if passes > 10:
            break
    return y + passes


def early(x: float) -> tuple[float, int]:
    if x < 0.0:
        return 0.0, 1
    if x > 2.0:
        return x, 2
    return 1.0, 0


def swapped(x: float, y: float, n: int) -> float:
    x, y = y, x
    a = b = x + 1.0
    a, b, c = b + y, a - y, a
    for _ in range(n):
        a, b = b, a + b
    return a + 10.0 * b + 100.0 * c


@compiled
def doubled(o: Any, by: float) -> float:
    """Changes what it is given."""
    o.x *= 2.0
    o.inner.high += by
    return o.x


@compiled
def both(x: float) -> tuple[float, float]:
    """Two values."""
    return x + 1.0, x - 1.0


def calls(o: Any, x: float) -> float:
    before = o.x + doubled(o, x) * o.x  # the first operand is what it was
    a, b = both(x)
    _, c = both(b)
    if x > 0.0 and doubled(o, 1.0) > 3.0:
        before += 0.5
    if x > 0.0 or doubled(o, 1.0) > 3.0:
        before += 0.25
    return before + a * c + o.x


def records(o: Any, x: float, n: int) -> float:
    inner, ring = o.inner, o.inner.ring
    inner.low, inner.high = inner.high, inner.low
    o.sample += 1
    o.running = x > 0.0
    for i in range(4):
        ring[i] = ring[(i + n) % 4] + x * i
    k = n % 3
    row = o.grid[k]
    k = 0
    row[1] = x
    for i in range(3):
        for j in range(4):
            o.grid[i, j] += i - j
    kept = ring[k]
    ring[k] = 99.0
    return kept + o.grid[n % 3, 1] + inner.low + o.sample + (1.0 if o.running else 0.0) + k


def chosen(o: Any, p: Any, x: float) -> float:
    part = o.inner if x > 1.0 else p.inner
    return part.low + 2.0 * part.high


def tables(n: int, x: float) -> float:
    return TABLE[n % 4] * x + PAIR[n % 2] + COUNT + (0.0 if x < FAR else 1.0)


def kinds(n: int, x: float) -> float:
    value = 0
    if x > 1.0:
        value = x
    flag = x > 0.0
    count = n + flag
    return value + count + bool(n) + float(n) / 4


def views(row: Any, x: float) -> float:
    o = as_record(row, OUTER)
    o.x = x
    return o.x + o.inner.low


def widened(n: int, x: float) -> float:
    before = n * 2
    n = n + x
    n += 1
    return n + before


def quotients(x: float, y: float) -> float:
    y = y + 4.5  # not 0
    signs = math.copysign(1.0, x % y) + math.copysign(4.0, (2.0 * y) % -y) + 16.0 * math.copysign(1.0, x // y)
    return signs + x % -y + 3.0 * (x // -y)


def whole_quotients(n: int, k: int) -> int:
    k = k + 3
    return n // k + 5 * (n % k) + (n // (k * k + 1)) % -3


def more_powers(x: float) -> float:
    return (x + 9.0) ** 5 + (x + 9.0) ** -2 + (x + 9.0) ** 2.0 + (x + 9.0) ** -1


def same_names(x: float, y: float, n: int) -> float:  # as those that the export makes
    value_1 = x if x > y else y
    count_5, x_changed, result_0, unused_real = 1.0, 2.0, 3.0, 4.0
    for _ in range(3):
        value_2 = y if n > 2 else x
        count_5 += value_1 * 0.5 + value_2
    n = n + x_changed
    n_changed = 5.0
    return value_1 + count_5 + x_changed + result_0 + unused_real + n + n_changed


@compiled
def pieces(pair: tuple[float, float], pair_0: float, scale: float = 2.0) -> float:
    """Names of parts that are names too, and a default."""
    pair_1 = pair_0 + 1.0
    pair = (pair[1], pair[0])
    return pair[0] * scale + 10.0 * pair[1] + 100.0 * pair_0 + 1000.0 * pair_1


def handed_on(x: float, y: float) -> float:
    return pieces((x, y), 3.0) + pieces((y, x), 1.0, 0.5)


def orders(o: Any, x: float, n: int) -> float:
    n, y = n + 0.5, n
    a, b = c, d = x, y
    x, y = a, b = y, x
    total = 0.0
    for share in (x, y, o.x):
        total += share
        y = 100.0
        o.x = 50.0
    while COUNT < 0:
        total += 1.0
    return total + a * 2.0 + b * 3.0 + c * 5.0 + d * 7.0 + n


def from_the_end(o: Any, n: int) -> float:
    ring, m = o.inner.ring, n % 4 - 3
    ring[-1] += 1.0
    return ring[-4] + 10.0 * ring[-1] + PAIR[-1] + (1.0, 5.0, 7.0)[m if m > -3 else 0] + o.grid[-1, -2]


def widest(x: float, n: int) -> float:
    flags = x > 0.0 or n > 2
    return (1.0 if not (n or x) else 2.0) + (4.0 if flags and n else 8.0)


def arrays_from_the_end(o: Any, n: int, x: float) -> float:
    ring = o.inner.ring
    ring[n % 4 - 2] += x
    k = n % 4 - 4
    o.grid[k // 2, n % 3 - 1] = x
    return ring[k] + o.grid[-1, n % 3 - 3] + ring[n % 4]
