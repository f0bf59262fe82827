"""Writing results to files: whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from softstart.errors import InputError

if TYPE_CHECKING:
    from softstart.run import Run


def write_whole(path: Path, write: Callable[[IO[Any]], object], binary: bool = False) -> None:
    """Write a file through a temporary neighbour and a rename, so that it is never half-written.

    Raises InputError if the place cannot be written.
    """
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    except OSError as error:
        raise InputError(
            f"output = {path}: the file cannot be written there: {error.strerror or error}; "
            "give a folder that exists and that you may write to."
        ) from None
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb" if binary else "w", encoding=None if binary else "utf-8") as stream:
            write(stream)
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise InputError(
            f"output = {path}: the file could not be finished: {error.strerror or error}; "
            "nothing was left behind."
        ) from None
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_run(run: Run, path: Path, times: ArrayLike | None) -> None:
    """Traces of a run as CSV with units in the header."""
    when = run.t if times is None else np.asarray(times, dtype=np.float64).ravel()
    states = run.at(when)
    columns = [when, *(states[name] for name in ("phi1", "phi2", "w1", "w2", "u", "T"))]
    header = "t [s],phi1 [rad],phi2 [rad],w1 [rad/s],w2 [rad/s],u [N*m],T [N*m]"

    def write(stream: IO[Any]) -> None:
        np.savetxt(stream, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.17g")

    write_whole(path, write)
