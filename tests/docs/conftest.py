"""Says at the end which commands of the pages took longest."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from tests.docs.reader import end_warm

SHOWN = 12


@pytest.fixture(scope="session", autouse=True)
def _ends() -> Iterator[None]:
    """Leave no process behind."""
    yield
    end_warm()


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """The slowest, longest first."""
    reports = [r for outcome in ("passed", "failed") for r in terminalreporter.getreports(outcome)]
    took = [one for r in reports for name, value in r.user_properties if name == "took" for one in value]
    if took:
        terminalreporter.section(f"{len(took)} commands and Python blocks; the slowest")
        for processor, seconds, name in sorted(took, reverse=True)[:SHOWN]:
            terminalreporter.write_line(f"{seconds:6.1f} s, {processor:5.1f} s of processor time  {name}")
        total = sum(processor for processor, _, _ in took)
        terminalreporter.write_line(f"all together {total:.0f} s of processor time")
