"""`softstart study benchmark-sweeps`: a million sampled starts, their rate beside LSODA, and their memory.

The command `softstart sweep` runs in a process of its own and is watched; scipy's LSODA makes some of the
same starts in a plain loop.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from softstart.drive import Drive
from softstart.errors import SimulationError
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart_studies.benchmarks import lsoda
from softstart_studies.benchmarks.contest import condition_table, rounded
from softstart_studies.benchmarks.problem import DRIVE, Line, Problem

if TYPE_CHECKING:
    import xarray

__all__ = ["BenchmarkSweeps"]

SOFTSTART = (sys.executable, "-c", "import sys; from softstart.cli import main; sys.exit(main())")
WEIGHED = 0.25  # s, between looks at the memory, which take some processor time themselves
PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096
CONTROLLER = "ramp"
PERIOD = 1e-3  # s
FEW = 10  # values of stiffness and of ramp time
STARTS = 1_000_000
PEER_STARTS = 60
WORKERS = 2
TIMES = 100.0  # LSODA
MEMORY = 2048.0  # MiB
AGREEMENT = 1e-4  # in K_dyn, of sampled starts


@dataclass(frozen=True)
class Task:
    """About `starts` starts of the crane drive of [G] under a ramp of 0.3 to 0.6 s sampled at 1 kHz.

    Gap 0.25 to 4 rad and load inertia 2 to 10 J1 take as many values each as it needs, stiffness (half to
    twice) and ramp time ten.

    >>> Task(1_000_000).shape
    (100, 100, 10, 10)
    """

    starts: int

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Values along gap, load inertia, stiffness and ramp time."""
        side = max(2, round(math.sqrt(self.starts / FEW**2)))
        return side, side, FEW, FEW

    @property
    def size(self) -> int:
        """How many starts these are."""
        return math.prod(self.shape)

    @property
    def arguments(self) -> list[str]:
        """Of `softstart sweep`."""
        gaps, inertias, stiffnesses, times = self.shape
        axes = (
            f"shaft.gap=0.25:4:{gaps}",
            f"load.inertia=0.07:0.35:{inertias}",
            f"shaft.stiffness=184:737:{stiffnesses}:log",
            f"controller.time=0.3:0.6:{times}",
        )
        given = [word for axis in axes for word in ("--axis", axis)]
        return ["sweep", DRIVE, "--controller", CONTROLLER, "--param", f"period={PERIOD}", *given]


def sample(results: xarray.Dataset, count: int) -> Iterator[tuple[Line, float, float]]:
    """Starts spread at random over the grid: each for the peer, its mean torque, and the K_dyn found."""
    drive = Drive.load(DRIVE)
    rng = np.random.default_rng(1)
    for flat in rng.choice(results.k_dyn.size, size=min(count, results.k_dyn.size), replace=False):
        index = np.unravel_index(int(flat), results.k_dyn.shape)
        one = results.k_dyn[tuple(int(i) for i in index)]
        own = drive.replace(**{name: float(one[name]) for name in ("gap", "load_inertia", "stiffness")})
        line = Problem(CONTROLLER, ramp_time=float(one.controller_time)).line(own)
        yield line, float(own.mean_torque), float(one)


class Ended(NamedTuple):
    """What a command and all its processes took: s of the clock, s of processor time, MiB at most."""

    wall: float
    cpu: float
    memory: float | None


def watched(arguments: Sequence[str]) -> Ended:
    """A command to its end; SimulationError with its last words if it fails."""
    begin, memory = time.perf_counter(), 0.0
    child = subprocess.Popen([*SOFTSTART, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        while True:
            pid, code, used = os.wait4(child.pid, os.WNOHANG)
            if pid:
                break
            memory = max(memory, _memory_of_tree(child.pid))
            time.sleep(WEIGHED)
        child.returncode = os.waitstatus_to_exitcode(code)
    finally:
        if child.returncode is None:
            child.terminate()  # it ends its own workers
            child.wait()
    assert child.stderr is not None
    with child.stderr as stream:
        lines = stream.read().decode(errors="replace").strip().splitlines()
    if child.returncode:
        said = lines[-1] if lines else "without a word"
        raise SimulationError(f"benchmark: softstart sweep ended with {child.returncode}: {said}")
    return Ended(time.perf_counter() - begin, used.ru_utime + used.ru_stime, memory or None)


def _memory_of_tree(root: int) -> float:
    """Resident memory of a process and all it started, MiB; what they share counts for each. 0 if unknown."""
    parents: dict[int, int] = {}
    for path in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(path.name)] = int((path / "stat").read_text().rpartition(")")[2].split()[1])
        except (OSError, ValueError):
            continue  # it is gone
    tree, grown = {root}, True
    while grown:
        more = {pid for pid, parent in parents.items() if parent in tree} - tree
        tree, grown = tree | more, bool(more)
    pages = 0
    for pid in tree:
        try:
            pages += int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        except (OSError, ValueError):
            continue
    return pages * PAGE / 2**20


@dataclass(frozen=True)
class Found:
    """Starts, starts/s and core of both, largest difference in K_dyn, MiB."""

    starts: int
    rate: float
    peer_rate: float
    apart: float
    memory: float | None


def claims(found: Found) -> list[Claim]:
    """One claim for everything that was measured.

    >>> [claim.verdict.value for claim in claims(Found(1000, 2e4, 10.0, 1e-6, 700.0))]
    ['confirmed', 'confirmed', 'confirmed']
    """
    ratio = found.rate / found.peer_rate
    made = [
        Claim(
            f"A sweep makes at least {TIMES:.0f} times as many sampled starts a second and core as LSODA.",
            Verdict.of(ratio >= TIMES),
            f"{found.rate:,.0f} against {found.peer_rate:.3g} starts/s: {ratio:,.0f} times.",
        ),
        Claim(
            f"Both have the same K_dyn within {AGREEMENT:g}.",
            Verdict.of(found.apart <= AGREEMENT),
            f"Largest difference: {found.apart:.1e}.",
        ),
    ]
    if found.memory is not None:
        made.append(
            Claim(
                "All processes of a sweep together stay below 2 GiB.",
                Verdict.of(found.memory < MEMORY),
                f"At most {found.memory:,.0f} MiB with {found.starts:,} starts.",
            )
        )
    return made


class BenchmarkSweeps(Study):
    """A grid of sampled starts by `softstart sweep`, and some of them by LSODA.

    >>> BenchmarkSweeps.name, BenchmarkSweeps().task.size
    ('benchmark-sweeps', 1000000)
    """

    name: ClassVar[str] = "benchmark-sweeps"
    title: ClassVar[str] = "A million sampled starts: rate beside LSODA, memory"

    def __init__(self, starts: int = STARTS, peer_starts: int = PEER_STARTS, workers: int = WORKERS) -> None:
        self.task, self.peer_starts, self.workers = Task(starts), peer_starts, workers

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it, a few minutes; the results of the sweep are thrown away."""
        import xarray

        size = self.task.size
        with tempfile.TemporaryDirectory(prefix="softstart-sweeps-", dir=out) as home:
            progress(f"{size:,} starts on {self.workers} processes")
            given = ("--out", home, "--json", "--workers", str(self.workers))
            whole = watched([*self.task.arguments, *given])
            results = xarray.open_zarr(Path(home) / "sweep.zarr", chunks=None)
            progress(f"{self.peer_starts} of them by LSODA")
            chosen = list(sample(results, self.peer_starts))
        begin = time.process_time()
        peaks = [float(lsoda.start(line)[0][0]) for line, _, _ in chosen]
        cpu = time.process_time() - begin
        apart = max(abs(peak / base - k_dyn) for peak, (_, base, k_dyn) in zip(peaks, chosen, strict=True))
        found = Found(size, size / whole.cpu, len(chosen) / cpu, apart, whole.memory)
        rows = [
            ("starts", size),
            ("clock, s", rounded(whole.wall)),
            ("processor time, s", rounded(whole.cpu)),
            ("memory, MiB", None if whole.memory is None else round(whole.memory)),
            ("softstart sweep, starts/s and core", rounded(found.rate)),
            ("LSODA, starts/s and core", rounded(found.peer_rate)),
            ("ratio", rounded(found.rate / found.peer_rate)),
            ("starts by LSODA", len(chosen)),
            ("largest difference in K_dyn", float(f"{apart:.1e}")),
        ]
        table = Table("Rates by processor time", ("what", "value"), rows)
        return StudyResult(tables=(table, _condition_table(self.task, self.workers)), claims=claims(found))


def _condition_table(task: Task, workers: int) -> Table:
    rows = [
        ("grid", " x ".join(map(str, task.shape)) + " (gap, load inertia, stiffness, ramp time)"),
        ("processor time", "of the whole command: imports, all processes, writing, summing up, figure"),
        ("memory", "most at any time, resident, summed over all processes; shared pages count in each"),
        ("LSODA", "scipy solve_ivp, rtol 1e-8, located events, restarted at each sample; a plain loop"),
        ("processes", workers),
    ]
    return condition_table(rows, ("numpy", "scipy", "numba", "xarray", "zarr"))
