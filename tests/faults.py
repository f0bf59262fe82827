"""Which tests find the small faults of `faults.toml`: `python tests/faults.py [WORD]`, in 45 minutes.

Each fault is put into a copy of the checkout, and the tests that could see it are run, but the slow ones. A
table says how many of them fail, and names one; exit code 1 if a fault is found by none. A test that alone
finds one is not to go. WORD: only the faults whose meaning has it.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PARTS = "src", "controllers", "studies", "tests", "docs", "pyproject.toml", "README.md", "CONTRIBUTING.md"
PATIENCE = 900.0  # s for the tests of one fault
ENOUGH = 10  # tests that find it


def failing(folder: Path, fault: dict[str, str]) -> list[str]:
    """The tests that fail in a copy of the checkout with the fault."""
    for part in PARTS:
        (shutil.copytree if (ROOT / part).is_dir() else shutil.copy2)(ROOT / part, folder / part)
    path = folder / fault["path"]
    source = path.read_text()
    if source.count(fault["right"]) != 1:
        raise SystemExit(f"{fault['path']}: {fault['right']!r} does not stand there once; mend faults.toml.")
    path.write_text(source.replace(fault["right"], fault["wrong"]))
    packages = os.pathsep.join(str(folder / one) for one in PARTS[:3])
    words = ["-q", "-rfE", "--tb=no", "-p", "no:cacheprovider"]
    words += ["--few-kernels", "-m", "not slow", f"--maxfail={ENOUGH}", fault["path"]]
    words += [f"tests/{one}" for one in fault["tests"].split()]
    try:
        said = subprocess.run(
            [sys.executable, "-m", "pytest", *words],
            cwd=folder, env={**os.environ, "PYTHONPATH": packages}, capture_output=True, text=True,
            timeout=PATIENCE, check=False,
        ).stdout  # fmt: skip
    except subprocess.TimeoutExpired:
        return ["(they do not end)"]
    return re.findall(r"^(?:FAILED|ERROR) (\S+)", said, re.MULTILINE)


def main(words: list[str]) -> int:
    """One fault after the other."""
    missed = 0
    for fault in tomllib.loads((ROOT / "tests" / "faults.toml").read_text())["fault"]:
        if all(word in fault["meaning"] for word in words):
            with tempfile.TemporaryDirectory(prefix="softstart-fault-") as folder:
                found = failing(Path(folder), fault)
            missed += not found
            print(f"{len(found):4d}  {fault['meaning']}: {found[0] if found else 'NO TEST'}", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
