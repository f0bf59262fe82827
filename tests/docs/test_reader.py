"""What the reader of a page sees of commands that take long."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.docs import reader
from tests.docs.steps import Step, steps

SERVES = "import time\nprint('ready at 7', flush=True)\ntime.sleep(60)\n"
WORKS = "while True: pass"


def watched(folder: Path, shown: str) -> list[str]:
    one = reader.Reader(folder, "page")
    one.do(Step("python", SERVES, 1, long=True, output=shown))
    return one.wrong


def test_it_is_enough_that_a_long_command_prints_what_the_page_shows(tmp_path: Path) -> None:
    began = time.perf_counter()
    assert watched(tmp_path, "ready at 7") == []
    assert time.perf_counter() - began < reader.WATCHED


def test_it_must_print_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "PRINTED", 1.0)
    assert "not printed: ready at 8" in "\n".join(watched(tmp_path, "ready at 8"))


def test_the_work_of_helpers_is_work_too(tmp_path: Path) -> None:
    starts = f"import subprocess, sys; subprocess.run([sys.executable, '-c', '{WORKS}'])"
    with reader._started([sys.executable, "-c", starts], tmp_path, subprocess.DEVNULL) as process:
        until = time.perf_counter() + 30.0
        together = 0.0
        while together < 1.0 and time.perf_counter() < until:
            time.sleep(0.1)
            own, together = reader._work_of(process)
    assert together >= 1.0 > own


def test_what_follows_a_directive_is_read_too() -> None:
    page = "```{math}\na = b\n```\n\n```python\nprint(1)\n```\n\n```text\n1\n```\n"
    (one,) = steps(page)
    assert (one.kind, one.text, one.output) == ("python", "print(1)\n", "1")
