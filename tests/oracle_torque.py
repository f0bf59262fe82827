"""The motor torque of the oracle: what a demand in pieces becomes behind a slew limiter and a lag.

A piece is (instant, demand) or (instant, demand, slope): it holds, or runs in a line, until the next one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np


class TorquePath:
    """Motor torque: demand, slew limiter, first-order lag; straight or exponential between borders.

    `limited` is what leaves the limiter at the beginning, if it is not u0, the torque behind the lag.
    """

    def __init__(
        self,
        pieces: list[Any],
        lag: float,
        rate: float,
        u0: float,
        t_end: float,
        limited: float | None = None,
    ):
        self.lag, self.t_end = lag, t_end
        spans = []  # start, reference there, slope of the reference
        pieces = sorted(
            (start, demand, *slope) if slope else (start, demand, 0.0) for start, demand, *slope in pieces
        )
        if not pieces or pieces[0][0] > 0:
            pieces = [(0.0, u0, 0.0), *pieces]
        r = u0 if limited is None else limited
        for (start, demand, rise), end in zip(pieces, [p[0] for p in pieces[1:]] + [math.inf], strict=True):
            if math.isinf(rate):
                r = demand
            if r != demand:
                slope = math.copysign(rate, demand - r)
                spans.append((start, r, slope))
                # the limiter and the line approach each other, or never meet
                closing = (slope - rise) / (demand - r)
                arrival = start + 1 / closing if closing > 0 else math.inf
                if arrival >= end:
                    r += slope * (end - start)
                    continue
                r = demand + rise * (arrival - start)
            else:
                arrival = start
            slope = min(max(rise, -rate), rate)
            spans.append((arrival, r, slope))
            r += slope * (end - arrival) if slope else 0.0
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
        grown = -np.expm1((start - t) / self.lag)  # of the lag's step response; no digits cancel
        now = u + (r - u) * grown + slope * (t - start - self.lag * grown)
        return now, slope * grown + (r - u) / self.lag * (1.0 - grown)
