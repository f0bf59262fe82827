"""axe-core finds no serious violation, contrast of 4.5:1 included, on the page and in a report.

axe-core is fetched from the npm registry (`npm pack`), or is the file of SOFTSTART_AXE; without it: skipped.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from softstart.reporting import report

AXE = "axe-core@4.14.1"
STILL = "document.getAnimations().every(one => one.playState !== 'running')"  # no colour fades
HARMFUL = ("serious", "critical")


@pytest.fixture(scope="session")
def axe(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The text of axe.min.js."""
    if named := os.environ.get("SOFTSTART_AXE"):
        return Path(named).read_text("utf-8")
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("axe-core: npm is missing; install it, or name axe.min.js in SOFTSTART_AXE")
    folder = tmp_path_factory.mktemp("axe")
    try:
        subprocess.run(
            [npm, "pack", AXE, "--silent"], cwd=folder, check=True, capture_output=True, timeout=60
        )
    except (subprocess.SubprocessError, OSError) as error:
        pytest.skip(f"axe-core cannot be fetched: {error}")
    with tarfile.open(next(folder.glob("*.tgz"))) as packed:
        found = packed.extractfile("package/axe.min.js")
        assert found is not None
        return found.read().decode("utf-8")


def violations(page: Any, axe: str) -> list[str]:
    """What axe-core calls serious or critical, a line each with the places."""
    page.evaluate(axe)
    found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
    return [
        f"{one['id']} ({one['impact']}): " + "; ".join(node["html"][:160] for node in one["nodes"][:4])
        for one in found["violations"]
        if one["impact"] in HARMFUL
    ]


def test_the_page_has_no_serious_violation(visit: Callable[..., Any], axe: str) -> None:
    page = visit(1280, 800)
    page.wait_for_function("document.querySelectorAll('tbody tr').length > 5")
    for name in ("Optimum", "Pareto", "Checks", "Tuning", "Sheet", "Log", "Files"):
        page.get_by_role("tab", name=name, exact=True).click()
        if name == "Checks":
            page.get_by_test_id("checks-go").click()
            page.get_by_test_id("checks-answer").locator("figure, p").nth(3).wait_for(timeout=60_000)
        if name == "Sheet":  # mistakes, then a drive with doubts
            page.get_by_test_id("sheet-use").click()
            page.get_by_test_id("sheet-trouble").locator(".trouble").first.wait_for()
        if name == "Files":
            page.get_by_test_id("project-names").click()
            page.get_by_test_id("paste-text").fill("time,torque\n0,20\n100,62")
            page.get_by_test_id("paste-add").click()
            page.get_by_test_id("paste-trouble").locator(".trouble").first.wait_for()
            page.locator('[data-path="shaft.gap"] input[type=text]').fill("9 rad")
            page.keyboard.press("Enter")
            page.locator(".doubt").first.wait_for()
        for colours in ("light", "dark"):
            page.emulate_media(color_scheme=colours)
            page.wait_for_function(
                f"document.body.classList.contains('body--dark') === {str(colours == 'dark').lower()}"
            )
            page.wait_for_function(STILL)
            assert violations(page, axe) == [], (name, colours)


def test_a_report_has_no_serious_violation(browser: Any, axe: str, tmp_path: Path) -> None:
    made = report("hoist-15kw", controllers=["s-curve"], budget=0.0)
    made.save(tmp_path / "report.html")
    page = browser.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    assert violations(page, axe) == []
    page.close()
