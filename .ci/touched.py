"""Print the test files that a change touches, for `make check`.

    python .ci/touched.py [BASE]      changed since BASE; by default since origin/main, else since HEAD

These are changed test files, test files that import a changed module, and those in the folder of tests that
mirrors the folder of a changed module. Without any, the anchors of the plant are run.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
SOURCES = {"src": "softstart", "controllers": "controllers", "studies": "studies"}
ANCHORS = "tests/softstart/kernel/test_anchors.py"


def git(*words: str) -> list[str]:
    """The lines that a git command prints; none if it fails."""
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.splitlines()


def touched(changed: list[str]) -> list[str]:
    """Test files for changed files, all relative to the root of the repository."""
    apart = ("tests/page/", "tests/export/", "tests/docs/")  # have commands of their own: make page, ...
    paths = (path.relative_to(ROOT).as_posix() for path in (ROOT / "tests").rglob("test_*.py"))
    texts = {name: (ROOT / name).read_text() for name in paths if not name.startswith(apart)}
    found = {name for name in changed if name in texts}
    for name in changed:
        root, _, below = name.partition("/")
        if root not in SOURCES or not name.endswith(".py"):
            continue
        module = below.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        imported = re.compile(rf"\b{re.escape(module)}\b|from {re.escape(module.rpartition('.')[0])} import")
        room = Path(below).parts[1:-1]
        mirror = "/".join(("tests", SOURCES[root], *room)) + "/"
        found |= {
            test
            for test, text in texts.items()
            if (room and test.startswith(mirror)) or imported.search(text)
        }
    return sorted(found) or [ANCHORS]


if __name__ == "__main__":
    base = sys.argv[1] if len(sys.argv) > 1 else next(iter(git("merge-base", "HEAD", "origin/main")), "HEAD")
    untracked = git("ls-files", "--others", "--exclude-standard")
    print("\n".join(touched([*git("diff", "--name-only", base), *untracked])))
