"""`softstart study benchmark-chains`: starts of whole chains by softstart and by LSODA, as ratios."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import ClassVar, NamedTuple

import numpy as np

from softstart import __version__
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.chain.kernel_records import elastic_period
from softstart.chain.run import ChainRun
from softstart.chain.simulation import simulate_chain
from softstart.controller.finding import make_controller
from softstart.drive import Drive
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart_studies.benchmarks.chains.lsoda import Problem, lsoda_start
from softstart_studies.benchmarks.contenders import condition_table
from softstart_studies.benchmarks.contest import rounded

__all__ = ["BenchmarkChains", "Case", "cases"]

PASSES = 5
WANTED = 30.0
TIGHT = 1e-12  # the tolerance at which LSODA shows who is right
COLUMNS = (
    "chain", "masses", "gaps", "strategy", "contacts", "lsoda, ms", "softstart, ms", "ratio",
    "peak diff.", "peak diff. at 1e-12",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A chain and how it is started: at once, or by a ramp sampled each millisecond."""

    chain: Chain
    ramp: float = 0.0

    @property
    def strategy(self) -> str:
        """In a word."""
        return "ramp, 1 kHz" if self.ramp > 0.0 else "direct"

    def problem(self) -> Problem:
        """For LSODA."""
        motor = self.chain.motor
        assert motor is not None
        return Problem(self.chain, motor.starting_torque, elastic_period(self.chain), self.ramp)

    def ours(self) -> ChainRun:
        """By softstart, with everything that a run notes."""
        motor = self.chain.motor
        assert motor is not None
        parameters: dict[str, object] = {"torque": motor.starting_torque}
        name = "direct"
        if self.ramp > 0.0:
            name = "ramp"
            parameters = {
                "initial": 0.0,
                "full_torque": motor.starting_torque,
                "time": self.ramp,
                "period": 1e-3,
            }
        return simulate_chain(self.chain, make_controller(name, parameters), fitted_to=ANY_DRIVE)


class Measured(NamedTuple):
    """Medians in s of processor time, contacts of the start, largest differences of the peaks as shares."""

    lsoda: float
    softstart: float
    contacts: int
    difference: float
    tight: float

    @property
    def ratio(self) -> float:
        """How many times as fast."""
        return self.lsoda / self.softstart


ANY_DRIVE = Drive.load("crane-4amtkf")  # direct and ramp are told everything; nothing is derived from it


def long_chain(count: int = 8) -> Chain:
    """Equal shafts and gaps between inertias that taper off towards the load."""
    inertias = np.geomspace(0.04, 0.01, count - 1)
    masses = [*(Mass(float(J)) for J in inertias), Mass(0.2, torque=7.0)]
    shafts = [Shaft(1500.0, gap=0.05)] * (count - 1)
    return Chain(masses, shafts, Motor(62.0), target_speed=40.0, name=f"even chain of {count} masses")


def cases() -> tuple[Case, ...]:
    """What is measured."""
    crane = Chain.load("crane-4-mass")
    return Case(crane), Case(crane, ramp=0.5), Case(long_chain())


class BenchmarkChains(Study):
    """Starts of chains with several gaps: one `simulate_chain` call against LSODA with located events.

    In turns, in one process and thread; times are of the processor. The differences of the peaks say how good
    the answer of LSODA is: they shrink with its tolerance.

    >>> BenchmarkChains.name
    'benchmark-chains'
    """

    name: ClassVar[str] = "benchmark-chains"
    title: ClassVar[str] = "Whole chains beside scipy's LSODA, as ratios of one run"

    def __init__(self, chosen: Sequence[Case] | None = None, passes: int = PASSES) -> None:
        self.chosen, self.passes = chosen, passes

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All cases, about half a minute; nothing is written to `out`."""
        chosen = cases() if self.chosen is None else self.chosen
        rows, found = [], []
        for number, case in enumerate(chosen, start=1):
            progress(f"{number}/{len(chosen)} {case.chain.name}, {case.strategy}")
            one = measured(case, self.passes)
            found.append(one)
            gaps = int((case.chain.at_motor_shaft().gap > 0.0).sum())
            rows.append(
                (
                    case.chain.name, len(case.chain.masses), gaps, case.strategy, one.contacts,
                    rounded(1e3 * one.lsoda), rounded(1e3 * one.softstart), rounded(one.ratio),
                    float(f"{one.difference:.1e}"), float(f"{one.tight:.1e}"),
                )
            )  # fmt: skip
        least = min(one.ratio for one in found)
        closer = max(one.tight for one in found)
        conditions: list[tuple[str, object]] = [
            (
                "lsoda",
                "solve_ivp, rtol = atol = 1e-8, a right-hand side for each mode, restarted at each event",
            ),
            ("softstart", f"{__version__}: simulate_chain with its record; events, peaks and states located"),
            ("passes, in turns; medians", self.passes),
        ]
        return StudyResult(
            tables=(
                Table("One start of a chain, processor time", COLUMNS, rows),
                condition_table(conditions, ("numpy", "scipy", "numba")),
            ),
            claims=(
                Claim(
                    f"A chain with several gaps takes LSODA at least {WANTED:.0f} times as long.",
                    Verdict.CONFIRMED if least >= WANTED else Verdict.REFUTED,
                    f"Least ratio: {rounded(least)}.",
                ),
                Claim(
                    "At its tightest tolerance LSODA comes to softstart's peaks.",
                    Verdict.CONFIRMED if closer < 1e-6 else Verdict.REFUTED,
                    f"Largest difference: {closer:.1e} of the peak.",
                ),
            ),
        )


def measured(case: Case, passes: int) -> Measured:
    """Both in turns, after a first pass that is not counted."""
    problem = case.problem()
    ours = case.ours()
    theirs = lsoda_start(problem)
    tight = lsoda_start(problem, TIGHT)
    of_lsoda, of_ours = [], []
    for _ in range(passes):
        begin = time.process_time()
        lsoda_start(problem)
        middle = time.process_time()
        for _ in range(10):
            case.ours()
        of_lsoda.append(middle - begin)
        of_ours.append(0.1 * (time.process_time() - middle))
    contacts = sum(event.kind == "gap closed" for event in ours.events)
    apart, apart_tight = (
        float(np.max(np.abs(other.peaks - ours.peak_torques) / ours.peak_torques))
        for other in (theirs, tight)
    )
    return Measured(median(of_lsoda), median(of_ours), contacts, apart, apart_tight)
