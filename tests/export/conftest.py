"""Exports, compiled and run by the tools of their own languages (`make export-test`).

A tool that is missing fails the tests that need it: nothing is skipped here. The head of the run says which
tools there are.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

import pytest
from tests.export import tools


def pytest_report_header() -> list[str]:
    """Which tools there are, and their versions."""
    lines = [f"{name}: {tools.version_of(name)}" for name in tools.COMMANDS]
    for name in tools.LIBRARIES:
        try:
            lines.append(f"{name}: {version(name)}")
        except PackageNotFoundError:
            lines.append(f"{name}: missing")
    return lines


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All of them are marked `export`."""
    for item in items:
        if item.path.parent == tools.HERE:
            item.add_marker(pytest.mark.export)
