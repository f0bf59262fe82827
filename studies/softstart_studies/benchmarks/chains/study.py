"""`softstart study benchmark-chains`: starts of whole chains by softstart and by LSODA, as ratios."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, ClassVar, NamedTuple

import numpy as np

from softstart import __version__, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.controller import Controller
from softstart.controller.finding import make_controller
from softstart.drive import Drive
from softstart.start.batch import prepared
from softstart.start.run import Run
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart_studies.benchmarks.chains.lsoda import Problem, lsoda_start
from softstart_studies.benchmarks.contenders import condition_table
from softstart_studies.benchmarks.contest import rounded

__all__ = ["BatchCase", "BenchmarkChains", "Case", "batch_cases", "cases"]

PASSES = 5
WANTED = 30.0
TIGHT = 1e-12  # the tolerance at which LSODA shows who is right
COLUMNS = (
    "chain", "masses", "gaps", "strategy", "contacts", "lsoda, ms", "softstart, ms", "ratio",
    "peak diff.", "peak diff. at 1e-12",
)  # fmt: skip
SIDE = 15  # of the batch: so many gaps times so many inertias of the load
PEER_STARTS = 3
AT_ONCE, SAMPLED = 2000.0, 300.0  # starts/s that were asked for: constant torque, and a controller at 1 kHz
BATCH_COLUMNS = (
    "chain", "strategy", "starts", "lsoda, starts/s", "softstart, starts/s", "goal", "with preparation",
    "ratio", "peak diff.",
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

    @property
    def controller(self) -> Controller:
        """What starts the chain."""
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
        return make_controller(name, parameters)

    def problem(self) -> Problem:
        """For LSODA."""
        motor = self.chain.motor
        assert motor is not None
        return Problem(self.chain, motor.starting_torque, self.chain.elastic_period, self.ramp)

    def ours(self) -> Run:
        """By softstart, with everything that a run notes."""
        return simulate(self.chain, self.controller, fitted_to=ANY_DRIVE)


@dataclass(frozen=True)
class BatchCase:
    """Chains that differ in gaps and in the inertia of the load, started in one compiled call.

    `damped` chains have a damping ratio of 2 % in each shaft; LSODA, which here knows no damping, starts the
    others one by one. `feedback` names a controller instead of direct and ramp.
    """

    ramp: float = 0.0
    damped: bool = False
    feedback: str = ""
    side: int = SIDE

    @property
    def goal(self) -> float:
        """Starts/s on one core that were asked for."""
        return SAMPLED if self.ramp > 0.0 or self.feedback else AT_ONCE

    def chains(self) -> list[Chain]:
        """What is started."""
        chain = Chain.load("crane-4-mass")
        if self.damped:
            shafts = tuple(shaft.replace(damping_ratio=0.02) for shaft in chain.shafts)
            chain = replace(chain, shafts=shafts, name=f"{chain.name}, 2 % damping")
        shares = np.linspace(0.9, 1.1, self.side).tolist()
        return [chain.changed(gaps=gap, load_inertia=inertia) for gap in shares for inertia in shares]


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


ANY_CHAIN = Chain.load("crane-4-mass")
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


def batch_cases() -> tuple[BatchCase, ...]:
    """What is measured in batches."""
    return (
        BatchCase(),
        BatchCase(ramp=0.5),
        BatchCase(damped=True),
        BatchCase(damped=True, feedback="take-up"),
    )


class BenchmarkChains(Study):
    """Starts of chains with several gaps: one `simulate` call against LSODA with located events.

    Then batches of chains in one compiled call on one core, with the starts/s that were asked for.

    In turns, in one process and thread; times are of the processor. The differences of the peaks say how good
    the answer of LSODA is: they shrink with its tolerance.

    >>> BenchmarkChains.name
    'benchmark-chains'
    """

    name: ClassVar[str] = "benchmark-chains"
    title: ClassVar[str] = "Whole chains beside scipy's LSODA, as ratios of one run"

    def __init__(
        self,
        chosen: Sequence[Case] | None = None,
        passes: int = PASSES,
        batches: Sequence[BatchCase] | None = None,
    ) -> None:
        self.chosen, self.passes, self.batches = chosen, passes, batches

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
        several = []
        for batch in batch_cases() if self.batches is None else self.batches:
            progress(f"a batch, {batch.feedback or Case(ANY_CHAIN, batch.ramp).strategy}")
            several.append(measured_batch(batch, self.passes))
        least = min(one.ratio for one in found)
        slowest = min(row[4] / row[5] for row in several)
        closer = max(one.tight for one in found)
        conditions: list[tuple[str, object]] = [
            (
                "lsoda",
                "solve_ivp, rtol = atol = 1e-8, a right-hand side for each mode, restarted at each event",
            ),
            ("softstart", f"{__version__}: simulate with its record; events, peaks and states located"),
            ("passes, in turns; medians", self.passes),
        ]
        return StudyResult(
            tables=(
                Table("One start of a chain, processor time", COLUMNS, rows),
                Table("Batches of chains: starts/s of processor time on one core", BATCH_COLUMNS, several),
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
                Claim(
                    f"A batch makes {AT_ONCE:,.0f} starts/s a core under constant torque, {SAMPLED:.0f} with "
                    "a controller at 1 kHz.",
                    Verdict.CONFIRMED if slowest >= 1.0 else Verdict.REFUTED,
                    f"Least share of that: {slowest:.2f}.",
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


def measured_batch(case: BatchCase, passes: int) -> tuple[Any, ...]:
    """A row: the best of several compiled calls, and of one call that prepares its chains too."""
    chains = case.chains()
    nominal = Case(chains[len(chains) // 2], case.ramp)
    controller = make_controller(case.feedback) if case.feedback else nominal.controller
    batch, told = prepared(chains), nominal.chain.design_drive
    means = np.array([chain.mean_torque for chain in chains])
    set_ups = [controller.set_up(told)]
    batch.figures(set_ups, means[:1], np.zeros(1, dtype=np.int64))
    ours, theirs = [], []
    for _ in range(passes):
        begin = time.process_time()
        found = batch.figures(set_ups, means)
        ours.append(len(chains) / (time.process_time() - begin))
    fresh = case.chains()
    simulate(case.chains()[:1], controller, fitted_to=told, workers=1)
    begin = time.process_time()
    simulate(fresh, controller, fitted_to=told, workers=1)
    prepared_too = len(chains) / (time.process_time() - begin)
    apart: list[float] = []
    for i, chain in enumerate([] if case.damped else chains[:PEER_STARTS]):
        begin = time.process_time()
        other = lsoda_start(Case(chain, case.ramp).problem())
        theirs.append(1.0 / (time.process_time() - begin))
        peaks = np.array([found[f"peak_torque_{k + 1}"][0][i] for k in range(len(chain.shafts))])
        apart.append(float(np.max(np.abs(other.peaks / peaks - 1.0))))
    rate, peer = max(ours), median(theirs) if theirs else math.nan
    return (
        nominal.chain.name, case.feedback or nominal.strategy, len(chains),
        "" if case.damped else rounded(peer), rounded(rate), case.goal, rounded(prepared_too),
        "" if case.damped else rounded(rate / peer), "" if case.damped else float(f"{max(apart):.1e}"),
    )  # fmt: skip
