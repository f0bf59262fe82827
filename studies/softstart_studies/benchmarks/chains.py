"""`softstart study benchmark-chains`: whole chains by softstart and by LSODA, as ratios of one run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.study import Claim, Verdict
from softstart_studies.benchmarks.contest import Contest, Duel, Outcome, agreement_claim, ratio_claim
from softstart_studies.benchmarks.problem import CHAIN, Problem

__all__ = ["BenchmarkChains"]

WANTED = 30.0  # times LSODA, one start
AT_ONCE, SAMPLED = 2000.0, 300.0  # starts/s that were asked for: constant torque, and a controller at 1 kHz


def long_chain(count: int = 8) -> Chain:
    """Equal shafts and gaps between inertias that taper off towards the load."""
    inertias = np.geomspace(0.04, 0.01, count - 1)
    masses = [*(Mass(float(J)) for J in inertias), Mass(0.2, torque=7.0)]
    shafts = [Shaft(1500.0, gap=0.05)] * (count - 1)
    return Chain(masses, shafts, Motor(62.0), target_speed=40.0, name=f"even chain of {count} masses")


DIRECT, RAMP, LONG = Problem("direct", CHAIN), Problem("ramp", CHAIN), Problem("direct", long_chain())
DUELS = (
    *(Duel(one, "lsoda-restarted", 1, "run", 20, WANTED) for one in (DIRECT, RAMP, LONG)),
    *(Duel(one, "lsoda-tight", 1, "run", 1, once=True) for one in (DIRECT, RAMP, LONG)),
    Duel(DIRECT, "lsoda-restarted", 3, "kernel", 225, goal=AT_ONCE),
    Duel(RAMP, "lsoda-sampled", 3, "kernel", 225, goal=SAMPLED),
    Duel(Problem("damped direct", CHAIN), "", 1, "kernel", 225, goal=AT_ONCE),
    Duel(Problem("damped take-up", CHAIN), "", 1, "kernel", 225, goal=SAMPLED),
)


class BenchmarkChains(Contest):
    """Starts of chains with several gaps: one `simulate` call, and batches in one compiled call.

    The differences of the peaks say how good the answer of LSODA is: they shrink with its tolerance.

    >>> BenchmarkChains.name
    'benchmark-chains'
    """

    name: ClassVar[str] = "benchmark-chains"
    title: ClassVar[str] = "Whole chains beside scipy's LSODA, as ratios of one run"
    duels = DUELS

    def claims(self, outcomes: Sequence[Outcome]) -> list[Claim]:
        """Ratio of one start, agreement at the tightest tolerance, and rates of batches."""
        single = [one for one in outcomes if one.duel.wanted]
        tight = [one for one in outcomes if one.duel.peer == "lsoda-tight"]
        batches = [one for one in outcomes if one.duel.goal]
        found = []
        if single:
            found.append(ratio_claim("One start of a chain with several gaps", single))
        if tight:
            found.append(
                agreement_claim("At its tightest tolerance LSODA comes to softstart's peaks.", tight)
            )
        if batches:
            shares = [one.our_rate / (one.duel.goal or 1.0) for one in batches]
            found.append(
                Claim(
                    f"A batch makes {AT_ONCE:,.0f} starts/s a core under constant torque, {SAMPLED:.0f} with "
                    "a controller at 1 kHz.",
                    Verdict.of(*(share >= 1.0 for share in shares)),
                    f"Least share of that: {min(shares):.2f}.",
                )
            )
        return found
