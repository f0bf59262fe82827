"""What is computed in the background: cancelled, put among the strategies, saved; and its panels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.page.conftest import comes_to

from softstart import Drive, optimize, simulate
from softstart.controller import make_controller

CRANE = Drive.load("crane-4amtkf")


def state(page: Any, name: str) -> str:
    return str(page.get_by_test_id(f"{name}-state").inner_text())


def test_an_optimum_is_that_of_optimize_and_joins_the_strategies(page: Any, tmp_path: Path) -> None:
    best = optimize(CRANE, 1.2 * simulate(CRANE, "direct").start_time)
    page.get_by_role("tab", name="Optimum", exact=True).click()
    assert page.get_by_test_id("optimum-takes").inner_text().startswith("Takes ")
    page.get_by_test_id("optimum-time").fill("1.2x")
    page.get_by_test_id("optimum-go").click()
    comes_to(lambda: state(page, "optimum").startswith("Done in"), True)
    answer = page.get_by_test_id("optimum-answer")
    answer.locator("p").first.wait_for()
    shown = " ".join(answer.inner_text().split())
    assert f"K_dyn {best.k_dyn:.6f} lower bound of K_dyn {best.bound.k_dyn:.6f}" in shown
    cell = page.locator(f'tr[data-name="optimum {best.end_time:.4g} s"] td[data-key="k_dyn"]')
    comes_to(cell.inner_text, f"{best.k_dyn:.3f}")
    file = f"optimum-{best.end_time:.4g}-s.csv"
    with page.expect_download() as download:
        page.get_by_test_id("optimum-file").get_by_text(file, exact=True).click()
    assert download.value.suggested_filename == file
    download.value.save_as(tmp_path / file)
    again = make_controller("profile", {"file": str(tmp_path / file)})
    assert simulate(CRANE, again).k_dyn == best.k_dyn

    comes_to(page.get_by_test_id("optimum-stale").is_visible, False)
    gap = page.locator('[data-path="shaft.gap"] input[type=text]')
    gap.fill("0.7")
    gap.press("Enter")
    changed = "For total gap 0.5 rad; the drive has changed since."
    comes_to(lambda: page.get_by_test_id("optimum-stale").inner_text(), changed)
    page.get_by_test_id("optimum-time").fill("soon")
    page.get_by_test_id("optimum-go").click()
    page.get_by_text('Start time "soon": this is not a number with a unit').wait_for()
    comes_to(answer.is_visible, False)  # of another question


def test_the_limit_is_cancelled_in_mid_run_and_the_page_lives_on(page: Any, server: Any) -> None:
    page.get_by_role("tab", name="Pareto", exact=True).click()
    page.get_by_test_id("curve-go").click()
    comes_to(lambda: state(page, "curve").startswith("Computing: start "), True)
    before = set(server.jobs())
    page.get_by_test_id("curve-cancel").click()
    comes_to(lambda: state(page, "curve").startswith("Cancelled after"), True)
    comes_to(lambda: before <= set(server.jobs()), False)
    comes_to(page.get_by_test_id("curve-go").is_enabled, True)
    direct = page.locator('tr[data-name="direct"] td[data-key="k_dyn"]')
    comes_to(direct.inner_text, f"{simulate(CRANE, 'direct').k_dyn:.3f}")


def test_tables_of_an_answer_stay_within_their_column(page: Any) -> None:
    """At 1280 pixels nothing is to be scrolled sideways; what has no room goes on below its first column."""
    page.get_by_role("tab", name="Pareto", exact=True).click()
    page.get_by_test_id("curve-go").click()
    answer = page.get_by_test_id("curve-answer")
    answer.locator("table").first.wait_for()
    assert answer.evaluate("e => e.scrollWidth - e.clientWidth <= 1")
    titles = answer.locator("caption").all_inner_texts()
    assert titles[:2] == ["Minimum K_dyn, terminal reached", "Minimum K_dyn, terminal reached, continued"]


def test_panels_stay_within_their_column(page: Any) -> None:
    """Nothing is cut off sideways."""
    panel = page.locator(".instrument .panel").first
    for name in ("Optimum", "Pareto", "Tuning", "Files", "Checks", "Sheet", "Log"):
        page.get_by_role("tab", name=name, exact=True).click()
        panel.wait_for()
        comes_to(lambda: panel.evaluate("e => e.scrollWidth - e.clientWidth <= 1"), True)
