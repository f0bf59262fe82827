"""Every command and every Python block of the pages runs as its page says (`make docs-commands`).

With `--rewrite` the pages are changed to show what is printed; look at the changes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.docs.reader import ROOT, Reader
from tests.docs.steps import pages, steps

PAGES = {page.relative_to(ROOT).as_posix(): page for page in pages(ROOT)}
TO_DO = {name: found for name, page in PAGES.items() if (found := steps(page.read_text(encoding="utf-8")))}
SLOW = (  # those that take longest: `make docs-commands ONLY='-m slow'`
    "docs/benchmarks.md",
    "docs/gaps-and-inertias.md",
    "docs/howto/add-a-controller.md",
    "docs/identification.md",
    "docs/optimal-starts.md",
    "docs/paper-r.md",
    "docs/real-starts.md",
    "docs/several-gaps.md",
    "docs/sweeps.md",
    "docs/tuning.md",
)
PARTS = [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in TO_DO]


@pytest.mark.parametrize("name", PARTS)
def test_page(
    name: str,
    tmp_path: Path,
    record_property: Callable[[str, object], None],
    request: pytest.FixtureRequest,
) -> None:
    reader = Reader(tmp_path, name)
    for step in TO_DO[name]:
        reader.do(step)
    record_property("took", reader.took)
    if request.config.getoption("--rewrite"):
        reader.rewrite(PAGES[name])
    assert not reader.wrong, "\n".join(["", *reader.wrong])
