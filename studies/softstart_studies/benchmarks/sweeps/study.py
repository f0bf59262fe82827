"""`softstart study benchmark-sweeps`: a million sampled starts, beside LSODA, killed and on a cluster."""

from __future__ import annotations

import signal
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from softstart.errors import SimulationError
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.sweeping.summary import pieces, plan_of
from softstart_studies.benchmarks import lsoda
from softstart_studies.benchmarks.contest import condition_table, rounded, version_of
from softstart_studies.benchmarks.sweeps import process
from softstart_studies.benchmarks.sweeps.process import Ended, cluster
from softstart_studies.benchmarks.sweeps.task import Task, sample

if TYPE_CHECKING:
    import xarray


TIMES = 100.0  # LSODA
MEMORY = 2048.0  # MiB
AGREEMENT = 1e-4  # in K_dyn, of sampled starts


@dataclass(frozen=True)
class Found:
    """Starts, starts/s and core of both, largest difference in K_dyn, MiB, and whether the bits agree."""

    starts: int
    rate: float
    peer_rate: float
    apart: float
    memory: float | None
    resumed: bool
    kept: bool
    on_cluster: bool | None


def claims(found: Found) -> list[Claim]:
    """One claim for everything that was tried.

    >>> [claim.verdict.value for claim in claims(Found(1000, 2e4, 10.0, 1e-6, 700.0, True, True, None))]
    ['confirmed', 'confirmed', 'confirmed', 'confirmed']
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
    made.append(
        Claim(
            "Killed twice and begun again, a sweep has the same bits and computes no finished chunk again.",
            Verdict.of(found.resumed and found.kept),
            f"Bits {'agree' if found.resumed else 'differ'}; finished chunks were "
            f"{'kept' if found.kept else 'computed again'}.",
        )
    )
    if found.on_cluster is not None:
        made.append(
            Claim(
                "On two dask workers, of which one is killed, a sweep has the same bits.",
                Verdict.of(found.on_cluster),
                f"Bits {'agree' if found.on_cluster else 'differ'}.",
            )
        )
    return made


__all__ = ["BenchmarkSweeps"]

STARTS = 1_000_000
PEER_STARTS = 60
WORKERS = 2
KILLED_AT = (0.3, 0.65)  # shares of the chunks
RESULTS = "sweep.zarr"


@dataclass(frozen=True)
class Peer:
    """LSODA on some of the starts: how many, s of processor time, and the largest difference in K_dyn."""

    starts: int
    cpu: float
    apart: float


class BenchmarkSweeps(Study):
    """The same grid four times: as it is, by LSODA in part, killed twice, and on two dask workers.

    >>> BenchmarkSweeps.name, BenchmarkSweeps().task.size
    ('benchmark-sweeps', 1000000)
    """

    name: ClassVar[str] = "benchmark-sweeps"
    title: ClassVar[str] = "A million sampled starts: rate beside LSODA, memory, killed and resumed, on dask"

    def __init__(
        self,
        starts: int = STARTS,
        peer_starts: int = PEER_STARTS,
        workers: int = WORKERS,
        clustered: bool = True,
    ) -> None:
        self.task, self.peer_starts, self.workers = Task(starts), peer_starts, workers
        self.clustered = clustered

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it, a few minutes; the results of the sweeps are thrown away."""
        with tempfile.TemporaryDirectory(prefix="softstart-sweeps-", dir=out) as home:
            return self._run(Path(home), progress)

    def _run(self, home: Path, progress: Progress) -> StudyResult:
        import xarray

        local = ("--workers", str(self.workers))
        progress(f"{self.task.size:,} starts on {self.workers} processes")
        whole = process.run(self._arguments(home / "whole", *local))
        results = xarray.open_zarr(home / "whole" / RESULTS, chunks=None)
        progress(f"{self.peer_starts} of them by LSODA")
        peer = _by_lsoda(results, self.peer_starts)
        progress("the same, killed twice")
        again, kept = self._killed(home / "killed", *local)
        resumed = _same(results, xarray.open_zarr(home / "killed" / RESULTS, chunks=None))
        clustered: Ended | None = None
        on_cluster: bool | None = None
        if self.clustered and version_of("distributed") is not None:
            progress("the same on two dask workers, one of them killed")
            clustered = self._clustered(home)
            on_cluster = _same(results, xarray.open_zarr(home / "cluster" / RESULTS, chunks=None))
        elif self.clustered:
            progress("dask: not installed: pip install 'softstart[cluster]'")
        chunks = plan_of(results).chunks
        found = Found(
            self.task.size, self.task.size / whole.cpu, peer.starts / peer.cpu, peer.apart, whole.memory,
            resumed, kept, on_cluster,
        )  # fmt: skip
        return StudyResult(
            tables=(
                _run_table(
                    self.task.size, (("local", whole), ("last of three, local", again), ("dask", clustered))
                ),
                _rate_table(found, peer),
                _condition_table(self.task, self.workers, chunks),
            ),
            claims=claims(found),
        )

    def _arguments(self, folder: Path, *more: str) -> list[str]:
        chunk = str(max(1, min(16_384, self.task.size // 60)))
        return [*self.task.arguments, "--chunk", chunk, "--out", str(folder), "--json", *more]

    def _killed(self, folder: Path, *more: str) -> tuple[Ended, bool]:
        """Killed twice, then finished: what the last run took, and whether finished chunks were kept."""
        arguments = self._arguments(folder, *more)
        results = folder / RESULTS
        before: dict[str, int] = {}
        kept = True
        for share in KILLED_AT:
            after = process.killed_at(arguments, results, round(share * self._chunks()))
            kept = kept and before.items() <= after.items()
            before = after
        last = process.run(arguments)
        return last, kept and before.items() <= process.finished(results).items()

    def _chunks(self) -> int:
        """About how many chunks there are."""
        return max(1, self.task.size // min(16_384, max(1, self.task.size // 60)))

    def _clustered(self, home: Path) -> Ended:
        (home / "dask").mkdir()
        with cluster(home / "dask", 2) as made:
            results = home / "cluster" / RESULTS
            arguments = self._arguments(home / "cluster", "--scheduler", made.address)
            begin = time.perf_counter()
            with process.begun(arguments) as child:
                while len(process.finished(results)) < round(KILLED_AT[0] * self._chunks()):
                    if child.poll() is not None:
                        raise SimulationError(
                            "benchmark: the sweep on dask ended before a worker was killed."
                        )
                    time.sleep(0.01)
                made.workers[0].send_signal(signal.SIGKILL)
                _, said = child.communicate()
            if child.returncode:
                raise SimulationError(
                    f"benchmark: the sweep on dask failed: {said.decode(errors='replace')[-300:]}"
                )
            return Ended(time.perf_counter() - begin, float("nan"), None)


def _by_lsoda(results: xarray.Dataset, count: int) -> Peer:
    """A plain loop over some of the starts."""
    chosen = list(sample(results, count))
    begin = time.process_time()
    peaks = [float(lsoda.start(line)[0][0]) for line, _, _ in chosen]
    cpu = time.process_time() - begin
    apart = max(abs(peak / base - k_dyn) for peak, (_, base, k_dyn) in zip(peaks, chosen, strict=True))
    return Peer(len(chosen), cpu, apart)


def _same(one: xarray.Dataset, other: xarray.Dataset) -> bool:
    """Whether two sweeps are the same to the bit, read chunk by chunk."""
    return one.sizes == other.sizes and all(
        np.array_equal(_bits(values), _bits(other[name][place].values))
        for name in one.data_vars
        for place, values in pieces(one, str(name))
    )


def _bits(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values).view(np.uint8)


def _run_table(size: int, runs: tuple[tuple[str, Ended | None], ...]) -> Table:
    rows = [
        (
            name,
            rounded(one.wall),
            None if np.isnan(one.cpu) else rounded(one.cpu),
            None if one.memory is None else round(one.memory),
        )
        for name, one in runs
        if one is not None
    ]
    columns = ("run", "clock, s", "processor, s", "memory, MiB")
    return Table(f"Runs of {size:,} starts", columns, rows)


def _rate_table(found: Found, peer: Peer) -> Table:
    rows = [
        ("softstart sweep, starts/s and core", rounded(found.rate)),
        ("LSODA, starts/s and core", rounded(found.peer_rate)),
        ("ratio", rounded(found.rate / found.peer_rate)),
        ("starts by LSODA", peer.starts),
        ("largest difference in K_dyn", float(f"{found.apart:.1e}")),
    ]
    return Table("Rates by processor time", ("what", "value"), rows)


def _condition_table(task: Task, workers: int, chunks: int) -> Table:
    rows = [
        ("grid", " x ".join(map(str, task.shape)) + " (gap, load inertia, stiffness, ramp time)"),
        ("chunks", chunks),
        ("processor time", "of the whole command: imports, all processes, writing, summing up, figure"),
        ("memory", "most at any time, resident, summed over all processes; shared pages count in each"),
        ("LSODA", "scipy solve_ivp, rtol 1e-8, located events, restarted at each sample; a plain loop"),
        ("processes", workers),
    ]
    return condition_table(rows, ("numpy", "scipy", "numba", "xarray", "zarr", "distributed"))
