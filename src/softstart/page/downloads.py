"""Names of downloads and texts of files: whatever a user calls a drive, the file's name is a safe one."""

from __future__ import annotations

import re
import tempfile
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

LONGEST = 60
RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))}


def file_name(*parts: str, suffix: str) -> str:
    """A file name made of texts that a user has typed: letters, digits, hyphens, and dots within numbers.

    >>> file_name("Crane travel drive 4AMTKF(H)112L6", suffix=".toml")
    'crane-travel-drive-4amtkf-h-112l6.toml'
    >>> file_name("optimum 0.4482 s", suffix=".csv")
    'optimum-0.4482-s.csv'
    >>> file_name("../../etc/passwd", suffix=".csv")
    'etc-passwd.csv'
    >>> file_name("\\u041a\\u0440\\u0430\\u043d", "CON", suffix=".toml")
    'softstart-con.toml'
    >>> file_name("nul", suffix=".c"), file_name("", suffix=".c")
    ('softstart-nul.c', 'softstart.c')
    """
    plain = unicodedata.normalize("NFKD", "-".join(parts)).encode("ascii", "ignore").decode()
    stem = re.sub(r"(?<!\d)\.|\.(?!\d)|[^a-z0-9.]+", "-", plain.lower())  # a dot only within a number
    stem = re.sub(r"-+", "-", stem)[:LONGEST].strip("-.")
    if stem in RESERVED:
        stem = f"softstart-{stem}"
    return (stem or "softstart") + suffix


def text_of(write: Callable[[Path], Any], suffix: str) -> str:
    """The text that `write(path)` would write into a file of its own.

    >>> text_of(lambda path: path.write_text("hello"), ".txt")
    'hello'
    """
    with tempfile.TemporaryDirectory(prefix="softstart-") as folder:
        path = Path(folder) / f"file{suffix}"
        write(path)
        return path.read_text("utf-8")
