"""What a torque that an inverter can play costs: lag, a limit of the torque rate, a weight on smoothness."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from softstart.optimal.optimize import optimize
from softstart.optimal.result import InfeasibleError, Optimum, OptimumError
from softstart.study import Claim, Progress, Table, Verdict
from softstart_studies.optimal_starts.crane import Extent, crane, direct_time, percent, rounded

MULTIPLE = 1.2  # of the start time of direct
PLAYABLE = 5000.0  # N m/s: a drive that takes 12 ms to its starting torque
LITTLE = 1.05


@dataclass(frozen=True)
class Price:
    """The optimum with a torque of limited smoothness; without one (`k_dyn` NaN) `why` says so."""

    lag: float  # s
    rate: float  # N m/s
    weight: float  # s
    k_dyn: float
    bound: float
    steepest: float  # N m/s, of the demand up to t_f
    heat: float
    why: str


def prices(extent: Extent, progress: Progress) -> list[Price]:
    """The ideal torque first; then each lag from the quickest rate on; then the weights."""
    asked = [(0.0, math.inf, 0.0)]
    for lag in extent.lags:
        asked += [(lag, math.inf, 0.0)] if lag > 0.0 else []
        asked += [(lag, rate, 0.0) for rate in extent.rates]
    asked += [(0.0, math.inf, weight) for weight in extent.weights]
    found = []
    for lag, rate, weight in asked:
        progress(f"torque with lag {lag:g} s, rate {rate:g} N m/s, weight {weight:g} s")
        found.append(_price(lag, rate, weight))
    return found


def _price(lag: float, rate: float, weight: float) -> Price:
    drive = crane().replace(torque_lag=lag, torque_rate=rate)
    time = MULTIPLE * direct_time(float(drive.gap))
    try:
        best = optimize(drive, time, smoothness=weight)
    except (InfeasibleError, OptimumError) as error:
        nan = math.nan
        return Price(lag, rate, weight, nan, nan, nan, nan, str(error))
    bound = best.bound.k_dyn
    return Price(lag, rate, weight, best.k_dyn, bound, steepest(best), best.heat, "")


def steepest(best: Optimum) -> float:
    """Largest |du/dt| of the demand up to t_f, N m/s; infinite where it jumps."""
    last = int(np.searchsorted(best.profile.time, best.end_time * (1.0 - 1e-9))) + 1
    time, torque = best.profile.time[:last], best.profile.torque[:last]
    step, rise = np.diff(time), np.abs(np.diff(torque))
    jumps = (step <= 0.0) & (rise > 0.0)
    return math.inf if jumps.any() else float(np.max(rise[step > 0.0] / step[step > 0.0], initial=0.0))


def table(found: list[Price]) -> Table:
    """K_dyn of each, and how much it is above that of an ideal torque."""
    least = found[0].k_dyn
    return Table(
        f"What a smooth torque costs, gap 0.5 rad, {MULTIPLE:g} x direct, synchronous",
        (
            "lag, s",
            "rate limit, N m/s",
            "weight, s",
            "K_dyn",
            "above ideal, %",
            "steepest demand, N m/s",
            "heat, s",
            "at least",
        ),
        [
            (
                one.lag,
                None if math.isinf(one.rate) else one.rate,
                one.weight,
                *(
                    None if math.isnan(one.k_dyn) else round(x, 4)
                    for x in (one.k_dyn, 100 * (one.k_dyn / least - 1))
                ),
                round(one.steepest, 1) if math.isfinite(one.steepest) else None,
                None if math.isnan(one.heat) else rounded(one.heat, 4),
                None if math.isnan(one.bound) else rounded(one.bound, 4),
            )
            for one in found
        ],
    )


def claims(found: list[Price]) -> list[Claim]:
    """Whether the optimum survives what a drive can do."""
    least = found[0].k_dyn
    solved = [one for one in found[1:] if not math.isnan(one.k_dyn)]
    limited = [one for one in solved if one.weight == 0.0]
    playable = [one for one in limited if one.rate >= PLAYABLE]
    dearest = max(playable, key=lambda one: one.k_dyn)
    said = "; ".join(
        f"{_named(one)} {one.k_dyn:.4f} ({percent(one.k_dyn / least)})"
        for one in (*limited, *solved[len(limited) :])
    )
    return [
        Claim(
            "(Not in [G]) A torque that an inverter can play costs little.",
            Verdict.CONFIRMED if dearest.k_dyn < LITTLE * least else Verdict.REFUTED,
            f"Ideal torque {least:.4f}; {said}. Down to {PLAYABLE:g} N m/s and with a lag of up to "
            f"{1000 * max(one.lag for one in playable):g} ms it costs at most "
            f"{percent(dearest.k_dyn / least)}.",
        )
    ]


def _named(one: Price) -> str:
    parts = [
        f"lag {1000 * one.lag:g} ms" if one.lag else "",
        f"rate {one.rate:g} N m/s" if math.isfinite(one.rate) else "",
        f"weight {one.weight:g} s" if one.weight else "",
    ]
    return ", ".join(part for part in parts if part)
