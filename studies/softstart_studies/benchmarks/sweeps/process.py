"""`softstart sweep` in processes of its own, watched and killed."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from softstart.errors import SimulationError
from softstart.sweeping.store import LIST, STATUS

SOFTSTART = (sys.executable, "-c", "import sys; from softstart.cli import main; sys.exit(main())")
GLANCE = 0.02  # s, between looks at the finished chunks
WEIGHED = 0.25  # s, between looks at the memory, which take some processor time themselves
ENDS = 5.0  # s, until a command that was asked to end has ended
PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096


@dataclass(frozen=True)
class Ended:
    """What a command and all its processes took: s of the clock, s of processor time, MiB at most."""

    wall: float
    cpu: float
    memory: float | None


def run(arguments: Sequence[str]) -> Ended:
    """A command to its end; SimulationError with its last words if it fails."""
    begin = time.perf_counter()
    memory = weighed = 0.0
    with begun(arguments) as child:
        while True:
            pid, code, used = os.wait4(child.pid, os.WNOHANG)
            if pid:
                break
            if (now := time.monotonic()) - weighed > WEIGHED:
                weighed = now
                memory = max(memory, _memory_of_tree(child.pid))
            time.sleep(GLANCE)
        wall = time.perf_counter() - begin
        child.returncode = os.waitstatus_to_exitcode(code)
        said = _last_words(child)
    if child.returncode:
        raise SimulationError(f"benchmark: softstart sweep ended with {child.returncode}: {said}")
    return Ended(wall, used.ru_utime + used.ru_stime, memory or None)


def killed_at(arguments: Sequence[str], results: Path, chunks: int) -> dict[str, int]:
    """Begin a command, kill it once so many chunks are finished; the finished ones with their times."""
    with begun(arguments) as child:
        while len(finished(results)) < chunks:
            if child.poll() is not None:
                raise SimulationError(f"benchmark: softstart sweep ended too early: {_last_words(child)}")
            time.sleep(GLANCE)
        child.send_signal(signal.SIGKILL)
        child.wait()
        _last_words(child)
    return finished(results)


@contextmanager
def begun(arguments: Sequence[str]) -> Iterator[subprocess.Popen[bytes]]:
    """A command that runs; it has ended after the block, and writes into no folder that is removed then."""
    child = subprocess.Popen([*SOFTSTART, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        yield child
    finally:
        if child.poll() is None:
            child.terminate()  # it ends its own workers
            try:
                child.wait(ENDS)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


def finished(results: Path) -> dict[str, int]:
    """The files of the finished chunks in a folder of results, and when each was written."""
    try:
        with closing(sqlite3.connect(f"file:{results / LIST}?immutable=1", uri=True)) as base:
            parts = [json.loads(text).get("part") for (text,) in base.execute("SELECT record FROM parts")]
    except sqlite3.Error:  # it is being written
        return {}
    files = ("/".join([STATUS, "c", *map(str, index)]) for index in parts if isinstance(index, list))
    return {name: (results / name).stat().st_mtime_ns for name in files}


def _last_words(child: subprocess.Popen[bytes]) -> str:
    if child.stderr is None:
        return ""
    with child.stderr as stream:
        lines = stream.read().decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else "without a word"


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


PATIENCE = 60.0  # s, for the scheduler to say where it is


@dataclass(frozen=True)
class Cluster:
    """Where the scheduler is, and its workers."""

    address: str
    workers: tuple[subprocess.Popen[bytes], ...]


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[Cluster]:
    """A scheduler with so many workers of one thread each, gone at the end of the block."""
    made: list[subprocess.Popen[bytes]] = []

    def dask(*arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", *arguments, "--dashboard-address", "127.0.0.1:0"]
        made.append(
            subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        )
        return made[-1]

    try:
        dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", "scheduler.json")
        address = _address(folder / "scheduler.json")
        options = ("--nthreads", "1", "--no-nanny", "--local-directory", "work")
        yield Cluster(address, tuple(dask("worker", address, *options) for _ in range(workers)))
    finally:
        for process in made:
            process.kill()
            process.wait()


def _address(path: Path) -> str:
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        try:
            return str(json.loads(path.read_text())["address"])
        except (OSError, ValueError):
            time.sleep(0.05)
    raise SimulationError("benchmark: the dask scheduler did not start.")
