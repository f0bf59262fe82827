"""Where a report comes from: enough to make it again."""

from __future__ import annotations

import platform
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Any

from softstart import __version__
from softstart.drive import Drive


@dataclass(frozen=True)
class Provenance:
    """Versions, date (UTC), the drive's file and the command."""

    made: str
    softstart: str
    python: str
    libraries: tuple[tuple[str, str], ...]
    drive_toml: str
    command: str

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "date": self.made,
            "softstart": self.softstart,
            "python": self.python,
            "libraries": dict(self.libraries),
            "drive": self.drive_toml,
            "command": self.command,
        }


def provenance(drive: Drive, command: str) -> Provenance:
    """That of a report made now.

    >>> made = provenance(Drive.load("crane-4amtkf"), "softstart report")
    >>> made.command, "numpy" in dict(made.libraries)
    ('softstart report', True)
    """
    return Provenance(
        datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"), __version__, platform.python_version(),
        tuple((name, version(name)) for name in _libraries()), drive.to_toml(), command,
    )  # fmt: skip


def _libraries() -> list[str]:
    """The installed ones that softstart requires to run."""
    try:
        needed = [one for one in requires("softstart") or [] if "extra ==" not in one]
    except PackageNotFoundError:
        needed = []
    found = []
    for one in needed or ["numpy", "scipy", "numba", "matplotlib"]:
        name = re.split(r"[^A-Za-z0-9._-]", one, maxsplit=1)[0]
        try:
            version(name)
        except PackageNotFoundError:
            continue
        found.append(name)
    return sorted(found)
