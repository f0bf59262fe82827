"""The first crossing of a polynomial on [0, 1], certified.

At x, with f > 0 and |f''| <= M2 up to the end, `f(x + d) >= f + f' d - M2 d^2/2`: the first zero of that
parabola is a step that provably passes no zero of f. The steps shrink quadratically onto a simple zero,
always from the left.
"""

from __future__ import annotations

import math

from softstart.chain.kernel_layout import Vector
from softstart.plant.jit import compiled

NONE = -1.0
LOST = -2.0  # the iteration did not end: reported as an error, never passed over
EPS = 2.220446049250313e-16
MAX_STEPS = 20_000
CLEARLY = 1e4  # what is above so many times its rounding is not zero
FAINT = 1e-10  # a leading coefficient below this share of what follows is taken for rounding


@compiled
def value(f: Vector, n: int, x: float) -> float:
    """The polynomial f_0 + ... + f_n x^n."""
    total = f[n]
    for i in range(n - 1, -1, -1):
        total = total * x + f[i]
    return total


@compiled
def crossing(f: Vector, low: int, n: int, begin: float, end: float) -> float:
    """First x in [begin, end] at which f/x^low falls through zero; it is positive, or rises, at `begin`."""
    most = 0.0
    power = 1.0
    for i in range(2, n - low + 1):
        most += i * (i - 1) * abs(f[low + i]) * power
        power *= end
    x = begin
    for _ in range(MAX_STEPS):
        y = f[n]
        dy = 0.0
        size = abs(y)  # of its terms: rounding is in proportion
        for i in range(n - 1, low - 1, -1):
            dy = dy * x + y
            y = y * x + f[i]
            size = size * x + abs(f[i])
        if y <= EPS * size:
            if dy < 0.0:
                return x
            if most == 0.0:
                return NONE
            x += max(2.0 * dy / most, 2.0 * math.sqrt(EPS * size / most), EPS * end)
        else:
            if most == 0.0:
                if dy >= 0.0:
                    return NONE
                step = -y / dy
            else:
                root = math.sqrt(dy * dy + 2.0 * most * y)
                step = 2.0 * y / (root - dy) if dy < 0.0 else (root + dy) / most
            if x + step <= x:
                return x
            x += step
        if x > end:
            return NONE
    return LOST


@compiled
def first_root(f: Vector, n: int, end: float, zeros: int, noise: float, faint: float) -> float:
    """First x in [0, end] at which f falls below zero.

    The first `zeros` coefficients are zero by the nature of what has just happened, unless f_0 clearly is
    not, where speeds have jumped. Of the others `noise` (of f_0) and `faint` (of the rest) say what may be
    rounding. Where f begins at zero it is divided by powers of x, and the first coefficient that counts says
    whether it falls at once.
    """
    low = zeros
    if f[0] > CLEARLY * noise:
        low = 0
    elif zeros == 0:
        if f[0] < -noise:
            return 0.0
        if f[0] <= noise:
            low = 1
    if low > 0:
        while True:
            if low > n:
                return NONE
            rest = 0.0
            for i in range(low + 1, n + 1):
                rest += abs(f[i])
            least = max(faint, FAINT * rest)
            if f[low] > least:
                break
            if f[low] < -least:
                return 0.0
            low += 1
    rest = 0.0
    power = end
    for i in range(low + 1, n + 1):
        rest += abs(f[i]) * power
        power *= end
    if f[low] > rest * (1.0 + 1e-12):
        return NONE
    return crossing(f, low, n, 0.0, end)
