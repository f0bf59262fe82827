"""What a store keeps on disk, read beside the process that writes it."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any


def parts_in(path: Path) -> list[dict[str, Any]]:
    """The finished parts in a file, in the order of their keys; none where there is no whole file."""
    try:
        with closing(sqlite3.connect(f"file:{path}?immutable=1", uri=True)) as base:
            rows = base.execute("SELECT record FROM parts WHERE key <> '' ORDER BY key").fetchall()
    except sqlite3.Error:
        return []
    return [json.loads(text) for (text,) in rows]
