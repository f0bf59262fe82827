"""`softstart study benchmark-starts`: starts a second of softstart and of its peers, as ratios of one run."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import ClassVar

from softstart.study import Progress, Study, StudyResult, Table
from softstart_studies.benchmarks import contenders
from softstart_studies.benchmarks.child import Child
from softstart_studies.benchmarks.contenders import ENTRIES
from softstart_studies.benchmarks.contest import Duel, Outcome, fight, rounded
from softstart_studies.benchmarks.host import Host
from softstart_studies.benchmarks.picture import ratio_figure
from softstart_studies.benchmarks.problem import crane_problem
from softstart_studies.benchmarks.verdicts import MANY, claims

__all__ = ["BenchmarkStarts"]

PASSES = 7
# as many starts as make a pass last about a tenth of a second or two
DUELS = (
    Duel("direct", "lsoda", 20, "kernel", 100_000, MANY),
    Duel("reduced-first-stage", "lsoda", 20, "kernel", 100_000, MANY),
    Duel("reduced-two-stage", "lsoda", 20, "kernel", 100_000, MANY),
    Duel("direct", "lsoda-restarted", 20, "kernel", 100_000),
    Duel("reduced-first-stage", "lsoda-restarted", 20, "kernel", 100_000),
    Duel("reduced-two-stage", "lsoda-restarted", 20, "kernel", 100_000),
    Duel("direct", "lsoda", 20, "batch", 100_000),
    Duel("ramp", "lsoda-sampled", 2, "kernel", 5_000, 100.0),
    Duel("direct", "lsoda", 20, "run", 200, 20.0),
    Duel("direct", "lsoda", 20, "run-traces", 200, 20.0),
    Duel("direct", "control", 4, "run-traces", 200),
    Duel("direct", "control-tight", 4, "run-traces", 200),
    Duel("direct", "diffrax", 1_000, "kernel", 100_000),
)
MISSING = "not installed: pip install 'softstart[benchmark]'"
TITLE = "Starts a second, by processor time of one core"
# short, so that a terminal holds them; the table of contenders says what the names mean
COLUMNS = ("strategy", "peer", "softstart", "peer 1/s", "ours 1/s", "ratio", "wanted", "K_dyn diff.")


class BenchmarkStarts(Study):
    """Constant, staged and sampled torque on the crane drive of [G]: scipy, python-control, diffrax and we.

    Every contender works in a process of its own, bound to one processor and one thread. Rates are by the
    process's own processor time, since the machine may have other work; the two of a row take turns.

    >>> BenchmarkStarts.name, BenchmarkStarts.pictures
    ('benchmark-starts', ('benchmark-starts-ratios',))
    """

    name: ClassVar[str] = "benchmark-starts"
    title: ClassVar[str] = "Speed and memory beside scipy, python-control and diffrax, as ratios of one run"
    pictures: ClassVar[tuple[str, ...]] = ("benchmark-starts-ratios",)

    def __init__(
        self, duels: Sequence[Duel] = DUELS, passes: int = PASSES, host: Callable[[], Host] = Child
    ) -> None:
        self.duels, self.passes, self.host = tuple(duels), passes, host

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All duels, about half a minute; nothing is written to `out`."""
        results: list[Outcome | None] = []
        memories: dict[str, float | None] = {}
        with ExitStack() as stack:
            hosts: dict[str, Host] = {}

            def host_of(name: str) -> Host:
                package = ENTRIES[name].package
                if package not in hosts:
                    hosts[package] = self.host()
                    stack.callback(hosts[package].close)
                return hosts[package]

            for number, duel in enumerate(self.duels, start=1):
                peer = ENTRIES[duel.peer]
                if contenders.installed(duel.peer) is None:
                    progress(f"{number}/{len(self.duels)} {duel.strategy}: {peer.package} {MISSING}")
                    results.append(None)
                    continue
                progress(f"{number}/{len(self.duels)} {duel.strategy}: {peer.package}, {peer.how}")
                problem = crane_problem(duel.strategy)
                results.append(fight(duel, problem, host_of(duel.peer), host_of(duel.ours), self.passes))
            for package, host in hosts.items():
                memories[package] = host.memory()
        rows = list(zip(self.duels, results, strict=True))
        measured = [result for result in results if result is not None]
        return StudyResult(
            tables=(
                Table(TITLE, COLUMNS, [_row(*row) for row in rows]),
                _contender_table(self.duels),
                _process_table(self.duels, measured, memories),
                _condition_table(self.passes, measured),
            ),
            claims=claims(measured),
            figures={self.pictures[0]: ratio_figure(measured)},
        )


def _row(duel: Duel, outcome: Outcome | None) -> tuple[object, ...]:
    names = (duel.strategy, duel.peer, duel.ours)
    if outcome is None:
        return (*names, None, None, None, duel.wanted, None)
    rates = (rounded(outcome.peer_rate), rounded(outcome.our_rate), rounded(outcome.ratio))
    return (*names, *rates, duel.wanted, float(f"{outcome.k_dyn_difference:.1e}"))


def _contender_table(duels: Sequence[Duel]) -> Table:
    """What the names in the first table stand for; a missing peer's row says how to get it."""
    rows = []
    for name in dict.fromkeys(name for duel in duels for name in (duel.ours, duel.peer)):
        entry, version = ENTRIES[name], contenders.installed(name)
        rows.append((name, f"{entry.package} {version or ''}".strip(), entry.how if version else MISSING))
    return Table("Contenders", ("name", "package", "how it is used"), rows)


def _process_table(
    duels: Sequence[Duel], outcomes: Sequence[Outcome], memories: dict[str, float | None]
) -> Table:
    """One row a process: its largest memory and batch, and the longest first pass."""
    rows = []
    for package, memory in memories.items():
        first = [one.peer_prepared for one in outcomes if ENTRIES[one.duel.peer].package == package]
        sizes = [(d.peer_starts, d.peer) for d in duels] + [(d.our_starts, d.ours) for d in duels]
        largest = max(count for count, name in sizes if ENTRIES[name].package == package)
        rows.append(
            (
                f"{package} {contenders.version_of(package)}",
                None if memory is None else round(memory),
                largest,
                rounded(max(first)) if first else None,
            )
        )
    return Table("Processes", ("process", "memory, MiB", "largest batch", "first pass, s"), rows)


def _condition_table(passes: int, outcomes: Sequence[Outcome]) -> Table:
    libraries = ("numpy", "scipy", "numba", "control", "jax", "diffrax")
    versions = {name: contenders.version_of(name) or "not installed" for name in libraries}
    clock = max((abs(one.wall_ratio / one.ratio - 1.0) for one in outcomes), default=0.0)
    rows = [
        ("rates", "starts a second of processor time, medians of the passes"),
        ("ratios by the clock instead", f"differ by {clock:.1%} at most"),
        ("memory", "largest of the whole process, interpreter and libraries included"),
        ("first pass", "imports and compiling included; not in the rates"),
        ("processors of the machine", os.cpu_count()),
        ("machine", f"{platform.machine()}, {platform.system()}"),
        ("processors and threads used", "one, one"),
        ("passes, in turns", passes),
        ("python", platform.python_version()),
        *versions.items(),
    ]
    return Table("Conditions", ("what", "value"), rows)
