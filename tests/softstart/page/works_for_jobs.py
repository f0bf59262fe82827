"""Functions that the tests of jobs run in processes of their own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from softstart.errors import InputError, SimulationError


def collect(file: str, line: str, *, progress: Any) -> tuple[int, int, str]:
    """Write a line; say the process's number, its niceness, and its limit on threads."""
    progress(0.5, "half of it")
    with Path(file).open("a", encoding="utf-8") as stream:
        stream.write(line + "\n")
    return os.getpid(), os.nice(0), os.environ["OPENBLAS_NUM_THREADS"]


def endless(started: str, *, progress: Any) -> None:
    """Never ends, does not listen to requests to end, and has begun another process that does neither."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    other = subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(600)"])
    progress(None, "without an end")
    Path(started).write_text(f"{os.getpid()} {other.pid}", encoding="utf-8")
    while True:
        time.sleep(600)


def failing(how: str, *, progress: Any) -> Any:
    """Fails in one of the ways in which computations fail."""
    if how == "input":
        raise InputError(["gap = -1: a gap is 0 or more.", "load.inertia = 0: it must be above 0."])
    if how == "simulation":
        raise SimulationError("The start cannot be finished.")
    if how == "memory":
        raise MemoryError
    if how == "mistake":
        return {}["not there"]
    if how == "unsendable":
        return lambda: None
    os.kill(os.getpid(), signal.SIGKILL)
    return None
