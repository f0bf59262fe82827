"""Four masses to two [R]: the errors over the share of the inner inertia and the ratio of stiffnesses."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softstart.chain import Chain, Mass, Shaft, natural_vibration, reduce_chain
from softstart.study import Claim, Table
from softstart.views.drawing import COLOURS, drawing, head, new_figure

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
    title = "Four masses to two, I4 = 5 I1: error in the first frequency by the share of the inner inertia"
    return Table.of(title, {
        "(I2 + I3)/(I1 + I4)": shares,
        "lever, c1 = c3, %": 100 * found.lever[:, middle],
        "lever, worst c1/c3 of 0.1 to 10, %": [100 * max(row, key=abs) for row in found.lever],
        "modal: participation, c1 = c3, %": 100 * found.modal[:, middle],
        "(w_(1,2)/w)^2, c1 = c3": found.ratio[:, middle],
        "inner mass: (w_p/w)^2, c1 = c3": found.inner[:, middle],
    })  # fmt: skip


def map_figure(found: ErrorMap) -> Any:
    """The error of the lever rule over inner inertia and stiffnesses, with the condition."""
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 5.0))
        axes.set(
            xscale="log", yscale="log"
        )  # before the labels, which cut their gaps into the lines as drawn now
        grid, levels = (STIFFNESSES, SHARES), [0.1, 0.3, 1.0, 3.0, 10.0, 30.0]
        drawn = axes.contour(*grid, -100 * found.lever, levels, colors=COLOURS[0], linewidths=1.4)
        axes.clabel(drawn, fmt="%g %%", inline_spacing=1)
        held = axes.contour(*grid, found.ratio, [10.0], colors=COLOURS[1], linestyles="--")
        axes.clabel(held, fmt="$(w_{(1,2)}/w)^2$ = %g", inline_spacing=1)
        title = "Four masses to two, $I_4 = 5 I_1$: how low the lever rule puts the frequency"
        head(axes, title, "$(I_2 + I_3)/(I_1 + I_4)$", "$c_1/c_3$")
    return figure


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
            "Four masses may be reduced to two where the partial systems (I1-c1-I2) and (I3-c3-I4) swing "
            "far above the frequency wanted",
            "confirmed",
            "Where both squares are at least 10 times that of the chain, its frequency comes out at most "
            f"{100 * worst:.1f} % off; the inner mass on both springs decides: where its square is 10 times "
            f"as well, at most {100 * float(error[both].max()):.2f} %, and never more than the bound "
            "1/sqrt(1 - (w/w_p)^2) - 1 (largest used share of it "
            f"{float((error[both] / allowed).max()):.2f}).",
        ),
        Claim(
            "The lever rule keeps the low frequency",
            "partly",
            f"With an inner inertia of {SHARES[tenth]:.2f} of the outer ones it is {low:.1f} to {high:.1f} "
            f"% low, over c1/c3 of 0.1 to 10; with 0.01, at most {at_hundredth:.2f} %. The modal reduction "
            "keeps frequency and node exactly; the motor's participation is then at most "
            f"{100 * float(np.abs(found.modal[tenth]).max()):.1f} % off (lever: "
            f"{100 * float(np.abs(found.lever_participation[tenth]).max()):.1f} %).",
        ),
    ]
