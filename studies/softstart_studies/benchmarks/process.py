"""Work in a process of its own, bound to one processor and one thread, with its memory."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from softstart.errors import SimulationError
from softstart.parallel import DiedError, Worker

ACCOUNT = Path("/proc/self/status")  # of Linux
# what Worker does for BLAS and numba, for jax
ONE_THREAD = {
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}


class Apart:
    """A process that calls functions; what they keep in their modules stays there."""

    def __init__(self) -> None:
        self.worker = Worker()
        self.worker.run(bind_to_one_processor)

    def __call__(self, function: Callable[..., Any], *arguments: object) -> Any:
        """What the function returns; SimulationError with one sentence if it or its process fails."""
        try:
            return self.worker.run(function, *arguments)
        except DiedError as death:
            raise SimulationError(f"benchmark: the process of a contender ended: {death}.") from None
        except Exception as error:  # a contender's package may fail in any way
            text = " ".join(f"{type(error).__name__}: {error}".split())
            raise SimulationError(f"benchmark: a contender failed: {text}.") from error

    def close(self) -> None:
        """End the process."""
        self.worker.kill()


class Here:
    """The same in this process."""

    def __call__(self, function: Callable[..., Any], *arguments: object) -> Any:
        """What the function returns."""
        return function(*arguments)

    def close(self) -> None:
        """Nothing to be done."""


def bind_to_one_processor() -> None:
    """One processor where the system offers that, so that no library's thread pool has more; one thread."""
    os.environ.update(ONE_THREAD)
    if sys.platform == "linux":
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def memory() -> float | None:
    """Largest resident memory of this process, MiB, where Linux tells it.

    Not `ru_maxrss`: a child inherits that of its parent.
    """
    if not ACCOUNT.exists():
        return None
    kib = [line.split()[1] for line in ACCOUNT.read_text().splitlines() if line.startswith("VmHWM:")]
    return int(kib[0]) / 1024 if kib else None
