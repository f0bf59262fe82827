"""The motor torque of the oracle: what a demand in pieces becomes behind a slew limiter and a lag."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


class TorquePath:
    """Motor torque: demand, slew limiter, first-order lag; straight or exponential between borders."""

    def __init__(self, pieces: list[tuple[float, float]], lag: float, rate: float, u0: float, t_end: float):
        self.lag, self.t_end = lag, t_end
        spans = []  # start, reference there, slope of the reference
        pieces = sorted(pieces)
        if not pieces or pieces[0][0] > 0:
            pieces = [(0.0, u0), *pieces]
        r = u0
        for (start, demand), end in zip(pieces, [p[0] for p in pieces[1:]] + [math.inf], strict=True):
            if math.isinf(rate) or r == demand:
                r = demand
                spans.append((start, r, 0.0))
                continue
            slope = math.copysign(rate, demand - r)
            arrival = start + (demand - r) / slope
            spans.append((start, r, slope))
            if arrival < end:
                spans.append((arrival, demand, 0.0))
                r = demand
            else:
                r += slope * (end - start)
        spans = [span for span in spans if span[0] < t_end]
        ends = [span[0] for span in spans[1:]] + [t_end]
        self.spans: list[
            tuple[float, float, float, float, float]
        ] = []  # start, end, reference, slope, u at start
        u = u0
        for (start, r, slope), end in zip(spans, ends, strict=True):
            u = u if lag > 0 else r
            self.spans.append((start, end, r, slope, u))
            u = self.torque(end, self.spans[-1])[0]

    def torque(self, t: Any, span: tuple[float, float, float, float, float]) -> tuple[Any, Any]:
        """u and du/dt at t (float or array) within a span; solves lag u' = r - u."""
        start, _, r, slope, u = span
        if self.lag == 0:
            return r + slope * (t - start), slope
        fade = (
            np.exp(-(t - start) / self.lag)
            if isinstance(t, np.ndarray)
            else math.exp(-(t - start) / self.lag)
        )
        away = u - r + slope * self.lag
        return r + slope * (t - start - self.lag) + away * fade, slope - away / self.lag * fade
