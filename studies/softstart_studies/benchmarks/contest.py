"""A contest: contenders solve the same starts in turns, timed by processor time; one table, one way to time.

What is timed? One call that returns the peak shaft torques of so many starts; imports, compiling and the
making of drives, arrays and grids come before. Against whom? Each row (`Duel`) names softstart's way and the
peer; `ENTRIES` says what the names stand for.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, ClassVar, NamedTuple, cast

import numpy as np

from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.views.drawing import COLOURS, drawing, new_figure
from softstart_studies.benchmarks.problem import Problem
from softstart_studies.benchmarks.process import Apart, Here, forget, memory, prepare, timed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PASSES = 7
AGREEMENT = 1e-6  # in K_dyn, where nothing is sampled
MISSING = "not installed: pip install 'softstart[benchmark]'"
TITLE = "Starts a second, by processor time of one core"
# short, so that a terminal holds them; the table of contenders says what the names mean
COLUMNS = (
    "strategy", "peer", "softstart", "peer 1/s", "ours 1/s", "ratio", "wanted", "goal 1/s", "K_dyn diff."
)  # fmt: skip
Host = Apart | Here


class Entry(NamedTuple):
    """A contender: its package, the function that makes it ready, how it is used, and that in two words."""

    package: str
    maker: str
    how: str
    short: str


ENTRIES = {
    "kernel": Entry("softstart", "exact:kernel", "compiled kernel over a batch", "kernel, batch"),
    "formula": Entry("softstart", "exact:formula", "closed forms of [G] over arrays", "closed form, arrays"),
    "batch": Entry("softstart", "exact:batch", "simulate of a batch, labelled results", "simulate, batch"),
    "run": Entry(
        "softstart", "exact:run", "one simulate call a start; Run with events and stages", "simulate, Run"
    ),
    "run-traces": Entry(
        "softstart", "exact:run_with_traces", "one simulate call a start; Run with stages and traces",
        "simulate, Run with traces",
    ),
    "lsoda": Entry(
        "scipy", "lsoda_plain:one_call", "solve_ivp LSODA, rtol 1e-8, one call with located events", "LSODA"
    ),
    "lsoda-restarted": Entry(
        "scipy", "lsoda:restarted", "solve_ivp LSODA, rtol 1e-8, located events, restarted at each stage",
        "LSODA, each stage",
    ),
    "lsoda-sampled": Entry(
        "scipy", "lsoda:restarted", "solve_ivp LSODA, rtol 1e-8, located events, restarted at each sample",
        "LSODA, each sample",
    ),
    "lsoda-tight": Entry(
        "scipy", "lsoda:tight", "the same, rtol 1e-12: whose the difference is", "LSODA, 1e-12"
    ),
    "control": Entry(
        "control", "control_response:default", "input_output_response, defaults, 1 ms grid",
        "control, defaults",
    ),
    "control-tight": Entry(
        "control", "control_response:tight", "input_output_response, LSODA 1e-8, 0.1 ms grid", "control, 1e-8"
    ),
    "diffrax": Entry(
        "diffrax", "diffrax_events:batch", "Tsit5 1e-8, root-found Events, jit and vmap over a batch",
        "diffrax, vmapped batch",
    ),
}  # fmt: skip


def version_of(package: str) -> str | None:
    """Version of an installed package, None without it.

    >>> version_of("no-such-package-here")
    """
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def prepared(host: Host, name: str, problem: Problem, starts: int) -> float:
    """Make a contender ready for so many starts; this imports its package. Seconds of the first pass."""
    seconds: float = host(
        prepare, f"{name} {starts}", f"{__package__}.{ENTRIES[name].maker}", problem, starts
    )
    return seconds


@dataclass(frozen=True)
class Duel:
    """A peer against softstart, each with as many starts a pass as a good measurement of time needs.

    `wanted` is the ratio that softstart shall reach, `goal` its starts a second; None where none was set.
    Without a peer only softstart's rate is measured. `once`: what counts is the difference, not the time.
    """

    problem: Problem
    peer: str
    peer_starts: int
    ours: str
    our_starts: int
    wanted: float | None = None
    goal: float | None = None
    once: bool = False

    @property
    def label(self) -> str:
        """Strategy and, of a chain, its machine."""
        problem = self.problem
        if problem.on_drive:
            return problem.strategy
        return f"{getattr(problem.machine, 'name', problem.machine)}, {problem.strategy}"


class Outcome(NamedTuple):
    """Medians over the passes: starts a second of processor time and ratios; largest difference in K_dyn.

    `ratio` is by processor time, `wall_ratio` by the clock. `peer_prepared` is the peer's first pass in s.
    Without a peer only `our_rate` is not NaN.
    """

    duel: Duel
    peer_rate: float
    our_rate: float
    ratio: float
    wall_ratio: float
    k_dyn_difference: float
    peer_prepared: float


def fight(duel: Duel, peer: Host, ours: Host, passes: int) -> Outcome:
    """The two in turns, so that a machine that slows down slows both; the ratio is a median, too."""
    first = prepared(peer, duel.peer, duel.problem, duel.peer_starts) if duel.peer else np.nan
    prepared(ours, duel.ours, duel.problem, duel.our_starts)
    theirs, own = [], []
    for _ in range(1 if duel.once else passes):
        if duel.peer:
            theirs.append(peer(timed, f"{duel.peer} {duel.peer_starts}"))
        own.append(ours(timed, f"{duel.ours} {duel.our_starts}"))
    rate = median(duel.our_starts / one.cpu for one in own)
    if not duel.peer:
        return Outcome(duel, np.nan, rate, np.nan, np.nan, np.nan, np.nan)
    share = duel.our_starts / duel.peer_starts
    prepared(ours, duel.ours, duel.problem, duel.peer_starts)
    same = ours(timed, f"{duel.ours} {duel.peer_starts}")
    for host in (peer, ours):
        host(forget)
    apart = np.abs(theirs[0].found - same.found) / duel.problem.machines()[0].mean_torque
    return Outcome(
        duel,
        median(duel.peer_starts / one.cpu for one in theirs),
        rate,
        median(share * a.cpu / b.cpu for a, b in zip(theirs, own, strict=True)),
        median(share * a.wall / b.wall for a, b in zip(theirs, own, strict=True)),
        float(apart.max()),
        first,
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


def ratio_claim(what: str, outcomes: Sequence[Outcome]) -> Claim:
    """That each ratio is at least the one wanted."""
    wanted = max(one.duel.wanted or 0.0 for one in outcomes)
    ratios = ", ".join(f"{one.duel.label} ({one.duel.ours}) {shown(one.ratio)}" for one in outcomes)
    return Claim(
        f"{what}: at least {wanted:,.0f} times as many starts a second as LSODA with located events.",
        Verdict.of(*(one.ratio >= (one.duel.wanted or 0.0) for one in outcomes)),
        f"Ratio: {ratios}.",
    )


def agreement_claim(statement: str, outcomes: Sequence[Outcome]) -> Claim:
    """That the largest difference in K_dyn is within AGREEMENT."""
    apart = [one.k_dyn_difference for one in outcomes]
    verdict = Verdict.of(*(value <= AGREEMENT for value in apart))
    return Claim(statement, verdict, f"Largest difference: {max(apart):.1e}.")


class Contest(Study):
    """Duels, their table and picture; what is claimed about them is of each contest.

    Every contender works in a process of its own, bound to one processor and one thread. Rates are by the
    process's own processor time, since the machine may have other work; the two of a row take turns.
    """

    duels: Sequence[Duel] = ()
    libraries: ClassVar[tuple[str, ...]] = ("numpy", "scipy", "numba")

    def __init__(
        self, duels: Sequence[Duel] | None = None, passes: int = PASSES, host: Callable[[], Host] = Apart
    ) -> None:
        self.duels = tuple(type(self).duels if duels is None else duels)
        self.passes, self.host = passes, host

    def claims(self, outcomes: Sequence[Outcome]) -> list[Claim]:
        """What this run says of each claim."""
        raise NotImplementedError

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All duels, about half a minute; nothing is written to `out`."""
        results: list[Outcome | None] = []
        with ExitStack() as stack:
            hosts: dict[str, Host] = {}

            def host_of(name: str) -> Host:
                package = ENTRIES[name].package
                if package not in hosts:
                    hosts[package] = self.host()
                    stack.callback(hosts[package].close)
                return hosts[package]

            for number, duel in enumerate(self.duels, start=1):
                peer = ENTRIES[duel.peer or duel.ours]
                missing = version_of(peer.package) is None
                how = f"{peer.package} {MISSING}" if missing else f"{peer.package}, {peer.how}"
                progress(f"{number}/{len(self.duels)} {duel.label}: {how}")
                if missing:
                    results.append(None)
                    continue
                both = host_of(duel.peer or duel.ours), host_of(duel.ours)
                results.append(fight(duel, *both, self.passes))
            memories = {package: host(memory) for package, host in hosts.items()}
        measured = [result for result in results if result is not None]
        return StudyResult(
            tables=(
                Table(TITLE, COLUMNS, [_row(*row) for row in zip(self.duels, results, strict=True)]),
                _contender_table(self.duels),
                _process_table(self.duels, measured, memories),
                self._condition_table(measured),
            ),
            claims=self.claims(measured),
            figures={name: ratio_figure(measured) for name in self.pictures},
        )

    def _condition_table(self, outcomes: Sequence[Outcome]) -> Table:
        clock = max((abs(one.wall_ratio / one.ratio - 1.0) for one in outcomes if one.duel.peer), default=0.0)
        rows = [
            ("rates", "starts a second of processor time, medians of the passes"),
            ("ratios by the clock instead", f"differ by {clock:.1%} at most"),
            ("memory", "largest of the whole process, interpreter and libraries included"),
            ("first pass", "imports and compiling included; not in the rates"),
            ("processors and threads used", "one, one"),
            ("passes, in turns", self.passes),
        ]
        return condition_table(rows, self.libraries)


def _row(duel: Duel, outcome: Outcome | None) -> tuple[object, ...]:
    rates: tuple[object, ...] = (None, None, None)
    difference = None
    if outcome is not None:
        values = (outcome.peer_rate, outcome.our_rate, outcome.ratio)
        rates = tuple(None if np.isnan(value) else rounded(value) for value in values)
        difference = float(f"{outcome.k_dyn_difference:.1e}") if duel.peer else None
    return (duel.label, duel.peer, duel.ours, *rates, duel.wanted, duel.goal, difference)


def _contender_table(duels: Sequence[Duel]) -> Table:
    """What the names in the first table stand for; a missing peer's row says how to get it."""
    rows = []
    for name in dict.fromkeys(name for duel in duels for name in (duel.ours, duel.peer) if name):
        entry, found = ENTRIES[name], version_of(ENTRIES[name].package)
        rows.append((name, f"{entry.package} {found or ''}".strip(), entry.how if found else MISSING))
    return Table("Contenders", ("name", "package", "how it is used"), rows)


def _process_table(
    duels: Sequence[Duel], outcomes: Sequence[Outcome], memories: dict[str, float | None]
) -> Table:
    """One row a process: its largest memory and batch, and the longest first pass."""
    sizes = [pair for d in duels for pair in ((d.peer_starts, d.peer), (d.our_starts, d.ours)) if pair[1]]
    rows = []
    for package, used in memories.items():
        peers = [one for one in outcomes if one.duel.peer and ENTRIES[one.duel.peer].package == package]
        rows.append((
            f"{package} {version_of(package)}",
            None if used is None else round(used),
            max(count for count, name in sizes if ENTRIES[name].package == package),
            rounded(max(one.peer_prepared for one in peers)) if peers else None,
        ))  # fmt: skip
    return Table("Processes", ("process", "memory, MiB", "largest batch", "first pass, s"), rows)


def condition_table(rows: Sequence[tuple[str, object]], libraries: Sequence[str]) -> Table:
    """What the figures mean, and under which conditions they were measured."""
    machine = [
        ("processors of the machine", os.cpu_count()),
        ("machine", f"{platform.machine()}, {platform.system()}"),
        ("python", platform.python_version()),
        *((name, version_of(name) or "not installed") for name in libraries),
    ]
    return Table("Conditions", ("what", "value"), [*rows, *machine])


def ratio_figure(outcomes: Sequence[Outcome]) -> Figure:
    """One bar a row of the table, coloured by peer; a black tick where a ratio was wanted."""
    outcomes = [one for one in outcomes if one.duel.peer]
    packages = list(dict.fromkeys(ENTRIES[one.duel.peer].package for one in outcomes))
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 1.4 + 0.42 * len(outcomes)))
        for place, one in enumerate(outcomes):
            package = ENTRIES[one.duel.peer].package
            axes.barh(place, one.ratio, height=0.66, left=0.0, color=COLOURS[packages.index(package)])
            # at the right edge, where no bar and no tick can cross it
            axes.annotate(
                shown(one.ratio), (1.0, place), xycoords=("axes fraction", "data"), ha="right", va="center"
            )
            if one.duel.wanted is not None:
                axes.plot([one.duel.wanted] * 2, [place - 0.42, place + 0.42], color="black", lw=1.8)
        axes.set_xscale("log")
        wanted = [one.duel.wanted or 1.0 for one in outcomes]
        axes.set_xlim(1.0, 10.0 * max([1.0, *wanted, *(one.ratio for one in outcomes)]))
        names = [(one.duel.label, ENTRIES[one.duel.ours], ENTRIES[one.duel.peer]) for one in outcomes]
        axes.set_yticks(range(len(outcomes)))
        axes.set_yticklabels([f"{label}:  {ours.short} : {peer.short}" for label, ours, peer in names])
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("starts/s of softstart : starts/s of the peer     (black tick: wanted)")
        axes.set_title("Same starts, same end, one core, in one run", loc="left")
    return cast("Figure", figure)
