"""Writing results to files: whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from softstart.errors import InputError


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
