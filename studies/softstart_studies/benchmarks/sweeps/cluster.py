"""A dask scheduler and workers on this machine, each in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from softstart.errors import SimulationError

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
