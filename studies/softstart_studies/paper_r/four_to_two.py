"""Four masses to two [R]: the errors over the share of the inner inertia and the ratio of stiffnesses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softstart.chain import Chain, Mass, Shaft, natural_vibration, reduce_chain
from softstart.study import Claim, Table

__all__ = ["ErrorMap", "claims", "error_map", "four_masses", "map_table"]

Grid = NDArray[np.float64]

SHARES = np.geomspace(1e-3, 1.0, 25)  # (I2 + I3)/(I1 + I4)
STIFFNESSES = np.geomspace(0.1, 10.0, 21)  # c1/c3
OUTER = (1.0, 5.0)  # I1, I4: the crane drive of [G]


class ErrorMap(NamedTuple):
    """Over shares (rows) and stiffness ratios (columns): `lever` error of the frequency, as a share; `modal`
    error of the motor's participation (its frequency and node are exact); `ratio` the least squared partial
    frequency of (I1-c1-I2) and (I3-c3-I4) over that of the chain; `inner` that of the merged inner mass.
    """

    lever: Grid
    lever_participation: Grid
    modal: Grid
    ratio: Grid
    inner: Grid


def four_masses(share: float, stiffness: float, gap: float = 0.1) -> Chain:
    """Four masses, two stiffnesses and a rigid gap in the middle, as in fig. 1 of [R].

    `share` is (I2 + I3)/(I1 + I4), I2 = I3; `stiffness` c1/c3; 1/c1 + 1/c3 = 1.

    >>> [round(mass.inertia, 2) for mass in four_masses(0.1, 1.0).masses]
    [1.0, 0.3, 0.3, 5.0]
    """
    I1, I4 = OUTER
    inner = 0.5 * share * (I1 + I4)
    c1, c3 = 1.0 + stiffness, 1.0 + 1.0 / stiffness
    return Chain(
        [Mass(I1), Mass(inner), Mass(inner), Mass(I4)],
        [Shaft(c1), Shaft(gap=gap, restitution=1.0), Shaft(c3)],
    )


def error_map(shares: Grid = SHARES, stiffnesses: Grid = STIFFNESSES) -> ErrorMap:
    """The errors over the grid; the chain is taken with its gap closed."""
    maps = [np.empty((shares.size, stiffnesses.size)) for _ in range(5)]
    for i, share in enumerate(shares):
        for j, stiffness in enumerate(stiffnesses):
            for grid, value in zip(maps, _errors(float(share), float(stiffness)), strict=True):
                grid[i, j] = value
    return ErrorMap(*maps)


def _errors(share: float, stiffness: float) -> tuple[float, float, float, float, float]:
    chain = four_masses(share, stiffness)
    J, c = chain.at_motor_shaft().J, chain.at_motor_shaft().c
    lever = paper_reduction(chain)
    modal = reduce_chain(chain, force=True)
    Omega = float(natural_vibration(chain).Omega[1])
    after = float(natural_vibration(lever).Omega[1])
    J1, J2 = (mass.inertia for mass in lever.masses)
    pieces = (c[0] / J[0] + c[0] / J[1], c[2] / J[2] + c[2] / J[3])
    inner = (c[0] + c[2]) / (J[1] + J[2])
    return (
        after / Omega - 1.0,
        J2 / J1 / modal.whole.participation - 1.0,
        modal.reduced.participation / modal.whole.participation - 1.0,
        float(min(pieces)) / Omega**2,
        float(inner) / Omega**2,
    )


def paper_reduction(chain: Chain) -> Chain:
    """The formulas of [R] themselves: 1/C = 1/c1 + 1/c3, the inner inertia shared by the lever rule."""
    I1, I2, I3, I4 = (mass.inertia for mass in chain.masses)
    c1, c3 = chain.shafts[0].stiffness, chain.shafts[2].stiffness
    C = 1.0 / (1.0 / c1 + 1.0 / c3)
    first, last = I1 + (I2 + I3) * C / c3, I4 + (I2 + I3) * C / c1
    return Chain([Mass(first), Mass(last)], [Shaft(C, gap=chain.shafts[1].gap)])


def map_table() -> Table:
    """The errors at some shares, c1 = c3 and the worst of all stiffness ratios."""
    shares = np.array([0.001, 0.003, 0.01, 0.03, 0.1, 0.2, 0.3, 0.5, 1.0])
    found = error_map(shares)
    middle = int(np.argmin(np.abs(np.log(STIFFNESSES))))
    rows = [
        (
            float(share),
            round(100 * float(found.lever[i, middle]), 4),
            round(100 * float(found.lever[i][np.argmax(np.abs(found.lever[i]))]), 4),
            round(100 * float(found.modal[i, middle]), 4),
            round(float(found.ratio[i, middle]), 1),
            round(float(found.inner[i, middle]), 1),
        )
        for i, share in enumerate(shares)
    ]
    return Table(
        "Four masses to two, I4 = 5 I1: error in the first frequency by the share of the inner inertia",
        (
            "(I2 + I3)/(I1 + I4)",
            "lever, c1 = c3, %",
            "lever, worst c1/c3 of 0.1 to 10, %",
            "modal: participation, c1 = c3, %",
            "(w_(1,2)/w)^2, c1 = c3",
            "inner mass: (w_p/w)^2, c1 = c3",
        ),
        rows,
    )


def claims(found: ErrorMap) -> list[Claim]:
    """Whether the condition of [R] does what it promises."""
    error = np.abs(found.lever)
    held = found.ratio >= 10.0
    both = held & (found.inner >= 10.0)
    tenth = int(np.argmin(np.abs(SHARES - 0.1)))
    worst = float(error[held].max())
    low, high = (100 * float(extreme(-found.lever[tenth])) for extreme in (np.min, np.max))
    at_hundredth = 100 * float(error[SHARES <= 0.0101].max())
    allowed = 1.0 / np.sqrt(1.0 - 1.0 / found.inner[both]) - 1.0
    return [
        Claim(
            "Four masses may be reduced to two where the partial systems (I1-c1-I2) and (I3-c3-I4) swing far "
            "above the frequency wanted",
            "confirmed",
            f"Where both squares are at least 10 times that of the chain, its frequency comes out at most "
            f"{100 * worst:.1f} % off; the inner mass on both springs decides: where its square is 10 times "
            f"as well, at most {100 * float(error[both].max()):.2f} %, and never more than the bound "
            f"1/sqrt(1 - (w/w_p)^2) - 1 (largest used share of it "
            f"{float((error[both] / allowed).max()):.2f}).",
        ),
        Claim(
            "The lever rule keeps the low frequency",
            "partly",
            f"With an inner inertia of {SHARES[tenth]:.2f} of the outer ones it is "
            f"{low:.1f} to {high:.1f} % low, over c1/c3 of 0.1 to 10; with 0.01, at most "
            f"{at_hundredth:.2f} %. "
            "The modal reduction keeps frequency and node exactly; the motor's participation is then at most "
            f"{100 * float(np.abs(found.modal[tenth]).max()):.1f} % off (lever: "
            f"{100 * float(np.abs(found.lever_participation[tenth]).max()):.1f} %).",
        ),
    ]
