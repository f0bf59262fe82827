"""Two contenders on the same starts, in turns: rates, their ratio, and how far their K_dyn lie apart."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

import numpy as np

from softstart_studies.benchmarks.host import Host
from softstart_studies.benchmarks.problem import GAPS, Problem, crane


@dataclass(frozen=True)
class Duel:
    """A peer against softstart, each with as many starts a pass as a good measurement of time needs.

    `wanted` is the ratio that softstart shall reach, None where none was set.
    """

    strategy: str
    peer: str
    peer_starts: int
    ours: str
    our_starts: int
    wanted: float | None = None


@dataclass(frozen=True)
class Outcome:
    """Medians over the passes: starts a second of processor time and ratios; largest difference in K_dyn.

    `ratio` is by processor time, `wall_ratio` by the clock. `peer_prepared` is the peer's first pass in s.
    """

    duel: Duel
    peer_rate: float
    our_rate: float
    ratio: float
    wall_ratio: float
    k_dyn_difference: float
    peer_prepared: float


def fight(duel: Duel, problem: Problem, peer: Host, ours: Host, passes: int) -> Outcome:
    """The two in turns, so that a machine that slows down slows both; the ratio is a median, too."""
    prepared = peer.prepare(duel.peer, problem, duel.peer_starts)
    ours.prepare(duel.ours, problem, duel.our_starts)
    theirs, own = [], []
    for _ in range(passes):
        theirs.append(peer.timed(duel.peer, problem, duel.peer_starts))
        own.append(ours.timed(duel.ours, problem, duel.our_starts))
    share = duel.our_starts / duel.peer_starts
    ours.prepare(duel.ours, problem, duel.peer_starts)
    same = ours.timed(duel.ours, problem, duel.peer_starts)
    for host in (peer, ours):
        host.forget()
    apart = np.abs(theirs[0].peaks - same.peaks) / crane(GAPS[0]).mean_torque
    return Outcome(
        duel,
        median(duel.peer_starts / one.cpu for one in theirs),
        median(duel.our_starts / one.cpu for one in own),
        median(share * a.cpu / b.cpu for a, b in zip(theirs, own, strict=True)),
        median(share * a.wall / b.wall for a, b in zip(theirs, own, strict=True)),
        float(apart.max()),
        prepared,
    )


def rounded(value: float) -> float:
    """Three digits: more would be noise.

    >>> rounded(6487.3)
    6490.0
    """
    return float(f"{value:.3g}")


def shown(value: float) -> str:
    """Three digits, for a reader.

    >>> shown(6487.3), shown(21.13)
    ('6,490', '21')
    """
    return f"{rounded(value):,.0f}"
