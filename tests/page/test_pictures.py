"""The pictures of the README and the documentation: `make pictures` writes them to docs/_static."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from tests.page.conftest import SOFTSTART, at_rest

FOLDER = os.environ.get("SOFTSTART_PICTURES")
pytestmark = pytest.mark.slow  # nothing of the page is judged
LARGEST = 90_000  # bytes: they are part of every clone


def taken(part: Any, path: Path) -> int:
    """Take a picture and reduce it to a palette; returns its size in bytes."""
    part.screenshot(path=path)
    picture = Image.open(path).convert("RGB")
    picture.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(path, optimize=True)
    return path.stat().st_size


@pytest.mark.parametrize(("dark", "name"), [(False, "page.png"), (True, "page-dark.png")])
def test_the_page(dark: bool, name: str, visit: Any, tmp_path: Path) -> None:
    page = visit(width=1320, height=780, dark=dark)
    page.locator('tr[data-name="direct"] input[type=checkbox]').check()
    page.locator('tr[data-name="pulse-coast-hold"] input[type=radio]').check()
    page.wait_for_function("document.querySelector('#k-dyn').dataset.value < 1")
    at_rest(page)
    assert taken(page, Path(FOLDER or tmp_path) / name) < LARGEST


def test_the_figure_of_the_report_for_the_readme(browser: Any, tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    subprocess.run([SOFTSTART, "report", "--out", str(report)], check=True, capture_output=True)
    page = browser.new_page(viewport={"width": 1000, "height": 900}, color_scheme="light")
    page.goto(report.as_uri())
    figure = page.locator("h2:has-text('Lower bound and optimum') >> xpath=following::figure[1]")
    assert taken(figure, Path(FOLDER or tmp_path) / "report.png") < LARGEST
    page.close()
