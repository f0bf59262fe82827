"""A long sweep in a process of its own, which can be killed."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from tests.kept import parts_in

LONG = """
from softstart import sweep
from softstart.sweeping import entry
from tests.softstart.sweeping.conftest import Sweeping
import sys
if sys.argv[3] == "True":
    first_start = entry.first_start
    entry.first_start = lambda *asked: first_start(*asked) and False  # as if not compiled
sweep("crane-4amtkf", "current-limit-feedback", Sweeping.grid, to=sys.argv[1], chunk=Sweeping.chunk,
      workers=int(sys.argv[2]), progress=lambda now: print(now.done, flush=True))
"""


class Sweeping:
    """12,000 sampled starts in 60 chunks, a second or two of one processor."""

    grid: ClassVar = {
        "load.kind": ["active", "reactive"],
        "gap": np.linspace(0.25, 4.0, 60),
        "load_inertia": np.linspace(0.07, 0.35, 100),
    }
    chunk, chunks = 200, 60

    def begin(self, folder: Path, workers: int, processes: bool) -> subprocess.Popen[str]:
        """Start it, with processes instead of threads if asked."""
        return subprocess.Popen(
            [sys.executable, "-W", "error", "-c", LONG, str(folder), str(workers), str(processes)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=Path(__file__).parents[3],
        )  # fmt: skip

    def finished(self, folder: Path) -> dict[str, int]:
        """The files of the finished chunks, and when each was written."""
        parts = parts_in(folder / "status" / "softstart.sqlite")
        names = ["/".join(["status", "c", *map(str, one["part"])]) for one in parts]
        return {name: (folder / name).stat().st_mtime_ns for name in names}

    def wait_for(self, folder: Path, chunks: int, process: subprocess.Popen[str]) -> None:
        """Until so many chunks are finished."""
        deadline = time.monotonic() + 300
        while len(self.finished(folder)) < chunks:
            assert process.poll() is None, process.communicate()
            assert time.monotonic() < deadline
            time.sleep(0.005)


@pytest.fixture(scope="package")
def sweeping():
    return Sweeping()


@pytest.fixture(scope="package")
def uninterrupted():
    """What the long sweep finds if nothing happens to it."""
    from softstart import sweep

    return sweep("crane-4amtkf", "current-limit-feedback", Sweeping.grid, workers=1)


def alive(pid: int) -> bool:
    """Whether there is such a process, and it runs."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def children(pid: int) -> list[int]:
    """The processes that a process has started."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((path / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        found += [int(path.name)] if parent == pid else []
    return found
