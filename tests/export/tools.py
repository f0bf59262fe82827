"""The tools of other languages: which of them there are, and how they are run."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent
COMMANDS = ("gcc", "cmake", "arm-none-eabi-gcc", "qemu-system-arm", "SOFTSTART_ST_COMPILER")
LIBRARIES = ("fmpy", "tree-sitter", "tree-sitter-iec61131-3-st", "xmlschema")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off")


def path_of(name: str) -> str | None:
    """Where a tool is; a name in capitals is a variable that names it."""
    return shutil.which(os.environ.get(name, "") if name.isupper() else name)


def version_of(name: str) -> str:
    """The first line that the tool says of its version, or that it is missing."""
    path = path_of(name)
    if path is None:
        return "not named" if name.isupper() else "missing"
    said = subprocess.run([path, "--version"], capture_output=True, text=True, check=False).stdout
    return said.partition("\n")[0] or path


def run(*command: str | Path, cwd: Path | None = None, may_fail: bool = False) -> str:
    """What a command prints; a missing tool, or a failure unless it may, fails the test with what is said."""
    assert shutil.which(str(command[0])), f"{command[0]} is missing: install it to run this test"
    ended = subprocess.run(
        list(map(str, command)), cwd=cwd, capture_output=True, text=True, check=False, timeout=300
    )
    assert may_fail or ended.returncode == 0, (
        f"{' '.join(map(str, command))}\n{ended.stdout[-2000:]}{ended.stderr[-4000:]}"
    )
    return ended.stdout
