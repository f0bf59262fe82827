"""Designs kept on disk beside the compiled kernels: importing python-control alone takes a second."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path

from softstart.errors import InputError
from softstart.input.files import write_whole

FOLDER = Path(__file__).parent / "__pycache__"


def kept(
    key: str, source: Path, make: Callable[[], Sequence[float]], folder: Path | None = None
) -> list[float]:
    """What `make` returns, from the file of an earlier call if there is one.

    A file is valid for one text of `source` and one version of python-control. What cannot be read or written
    is made again: a read-only installation only loses the second.

    >>> kept("doctest", Path(__file__), lambda: [0.1, 2.0])
    [0.1, 2.0]
    """
    return kept_all([key], source, lambda _: make(), folder)[key]


def kept_all(
    keys: Sequence[str], source: Path, make: Callable[[str], Sequence[float]], folder: Path | None = None
) -> dict[str, list[float]]:
    """What `make` returns for each key, as `kept`, but the file is read and written once.

    >>> kept_all(["doctest 1", "doctest 2"], Path(__file__), lambda key: [float(key[-1])])
    {'doctest 1': [1.0], 'doctest 2': [2.0]}
    """
    path = _path(source, folder)
    known = _readable(path)
    found = {key: numbers for key in keys if (numbers := _numbers(known.get(key))) is not None}
    made = {key: [float(value) for value in make(key)] for key in keys if key not in found}
    if made:
        with suppress(InputError):
            write_whole(path, lambda stream: json.dump({**_readable(path), **made}, stream))
    return {key: found[key] if key in found else made[key] for key in keys}


def _path(source: Path, folder: Path | None) -> Path:
    """The file for this text of the source and this version of python-control."""
    stamp = hashlib.sha256(source.read_bytes() + _control().encode()).hexdigest()[:16]
    return (folder or FOLDER) / f"{source.stem}-designs-{stamp}.json"


@cache
def _control() -> str:
    """Version of python-control; looking it up takes 2 ms."""
    return version("control")


def _numbers(value: object) -> list[float] | None:
    """What a file holds for a key, if that is numbers."""
    try:
        return [float(number) for number in value] if isinstance(value, list) else None
    except (ValueError, TypeError):
        return None


def _readable(path: Path) -> dict[str, object]:
    """What the file holds; empty if it is missing or broken."""
    try:
        return _read(path, path.stat().st_mtime_ns)
    except (OSError, ValueError):
        return {}


@lru_cache(maxsize=8)  # a file that has changed is read again
def _read(path: Path, changed: int) -> dict[str, object]:
    known = json.loads(path.read_text("utf-8"))
    return known if isinstance(known, dict) else {}
