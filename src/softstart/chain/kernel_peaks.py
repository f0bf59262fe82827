"""The largest torque of each shaft, located within each span and never read off a grid."""

from __future__ import annotations

from softstart.chain import kernel_layout as at
from softstart.chain.kernel_layout import EVENT_LINE, TORQUE, Cube, Matrix
from softstart.chain.kernel_roots import EPS, NONE, crossing, first_root, value
from softstart.plant.jit import compiled

ROUNDING = 4.0 * EPS
SAME = 1e-12  # peaks that differ by less are equal but for rounding


@compiled
def keep_peak(shaft: Matrix, k: int, torque: float, time: float) -> None:
    """Note a candidate for the largest |T|; of those equal but for rounding the first has the time."""
    largest = abs(shaft[k, at.PEAK])
    if abs(torque) > largest:
        if abs(torque) > largest * (1.0 + SAME):
            shaft[k, at.PEAK_TIME] = time
        shaft[k, at.PEAK] = torque


@compiled
def peak_within(shaft: Matrix, series: Cube, lines: Matrix, k: int, n: int, end: float, t: float,
                h: float) -> bool:  # fmt: skip
    """Note the largest |T| of shaft k up to `end` if it is above the largest so far; False if it is lost."""
    f = lines[EVENT_LINE]
    g = lines[at.SPARE]
    total = 0.0
    for o in range(1, n + 1):
        total += abs(series[TORQUE, k, o])
    first = series[TORQUE, k, 0]
    if abs(first) + total <= abs(shaft[k, at.PEAK]):
        return True
    for o in range(n + 1):
        g[o] = series[TORQUE, k, o]
    last = value(g, n, end)
    keep_peak(shaft, k, first, t)
    keep_peak(shaft, k, last, t + end * h)
    if end == 0.0:
        return True
    for which in range(2):
        sign = 1.0 - 2.0 * which
        begin = 0.0
        while True:
            # where it rises above the largest so far
            for o in range(n + 1):
                f[o] = -sign * g[o]
            f[0] += abs(shaft[k, at.PEAK]) * (1.0 + ROUNDING)
            above = first_root(f, n, end, 0, 0.0, 0.0) if begin == 0.0 else crossing(f, 0, n, begin, end)
            if above < NONE:
                return False
            if above < 0.0:
                break
            # and the extreme behind it
            for o in range(n):
                f[o] = sign * (o + 1.0) * g[o + 1]
            f[n] = 0.0
            top = crossing(f, 0, n - 1, above, end)
            if top < NONE:
                return False
            if top < 0.0:
                break  # it rises to the end, which is noted
            if sign * value(g, n, top) <= abs(shaft[k, at.PEAK]):
                break
            keep_peak(shaft, k, value(g, n, top), t + top * h)
            begin = top
    return True
