"""Every command and every Python block of the pages runs as its page says (`make docs-commands`)."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.docs.reader import ROOT, Reader
from tests.docs.steps import Step, pages, steps

PAGES = {page.relative_to(ROOT).as_posix(): page for page in pages(ROOT)}
TO_DO = {name: found for name, page in PAGES.items() if (found := steps(page.read_text(encoding="utf-8")))}
SLOW = (  # those that take longest: `make docs-commands ONLY='-m slow'`
    "docs/benchmarks.md",
    "docs/gaps-and-inertias.md",
    "docs/howto/add-a-controller.md",
    "docs/howto/set-a-speed-ramp.md",
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
def test_page(name: str, tmp_path: Path) -> None:
    reader = Reader(tmp_path, name)
    for step in TO_DO[name]:
        reader.do(step)
    assert not reader.wrong, "\n".join(["", *reader.wrong])


def test_a_long_command_must_print_what_the_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """More is not waited for: the command is interrupted then."""
    serves = "import time\nprint('ready at 7', flush=True)\ntime.sleep(600)\n"
    reader = Reader(tmp_path, "page")
    reader.do(Step("python", serves, 1, long=True, output="ready at 7"))
    assert reader.wrong == []
    monkeypatch.setattr("tests.docs.reader.PRINTED", 1.0)
    reader.do(Step("python", serves, 1, long=True, output="ready at 8"))
    assert "not printed: ready at 8" in "\n".join(reader.wrong)


def test_what_follows_a_directive_is_read_too() -> None:
    page = "```{math}\na = b\n```\n\n```python\nprint(1)\n```\n\n```text\n1\n```\n"
    (one,) = steps(page)
    assert (one.kind, one.text, one.output) == ("python", "print(1)\n", "1")
