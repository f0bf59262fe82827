"""Optimal start, limit and tuning on the page: computed aside, cancelled, put among the strategies."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.page.conftest import comes_to, drawn
from tests.patience import patient

from softstart import Drive, optimize, simulate
from softstart.controller import make_controller

CRANE = Drive.load("crane-4amtkf")
LONG = 60.0  # s


def tab(page: Any, name: str) -> None:
    page.get_by_role("tab", name=name, exact=True).click()


def state(page: Any, name: str) -> str:
    return str(page.get_by_test_id(f"{name}-state").inner_text())


def until(what: Callable[[], bool], seconds: float, page: Any) -> None:
    latest = time.monotonic() + patient(seconds)
    while not what():
        assert time.monotonic() < latest
        page.wait_for_timeout(50)


def done(page: Any, name: str, seconds: float = LONG) -> None:
    until(lambda: bool(re.match("Done|Not computed|Cancelled", state(page, name))), seconds, page)
    trouble = page.get_by_test_id(f"{name}-trouble")
    assert state(page, name).startswith("Done in"), trouble.inner_text()


def answer(page: Any, name: str) -> str:
    """What the answer of a panel says, in one line."""
    shown = page.get_by_test_id(f"{name}-answer")
    shown.locator("p").first.wait_for(timeout=1000 * LONG)
    return " ".join(shown.inner_text().split())


def k_dyn(page: Any, strategy: str) -> str:
    """That of a strategy in the table; a new row is empty until the server has started its strategy."""
    cell = page.locator(f'tr[data-name="{strategy}"] td[data-key="k_dyn"]')
    until(lambda: bool(cell.inner_text()), LONG, page)
    return str(cell.inner_text())


def saved(page: Any, panel: str, file: str) -> str:
    """The text of the file that a button gives."""
    with page.expect_download() as download:
        page.get_by_test_id(f"{panel}-file").get_by_text(file, exact=True).click()
    assert download.value.suggested_filename == file
    return Path(download.value.path()).read_text(encoding="utf-8")


def test_an_optimum_is_that_of_optimize_and_joins_the_strategies(page: Any, tmp_path: Path) -> None:
    direct = simulate(CRANE, "direct").start_time
    best = optimize(CRANE, 1.2 * direct)
    tab(page, "Optimum")
    page.get_by_test_id("optimum-time").fill("1.2x")
    page.get_by_test_id("optimum-go").click()
    done(page, "optimum")
    shown = answer(page, "optimum")
    assert f"K_dyn {best.k_dyn:.6f} lower bound of K_dyn {best.bound.k_dyn:.6f}" in shown
    assert "contacts 1" in shown
    label = f"optimum {best.end_time:.4g} s"
    assert k_dyn(page, label) == f"{best.k_dyn:.3f}"
    stem = f"optimum-{best.end_time:.4g}-s"
    for suffix in ("csv", "toml", "c"):
        text = saved(page, "optimum", f"{stem}.{suffix}")
        (tmp_path / f"{stem}.{suffix}").write_text(text, encoding="utf-8")
        if suffix == "c":
            assert "double torque_profile(double time)" in text
            continue
        again = make_controller("profile", {"file": str(tmp_path / f"{stem}.{suffix}")})
        assert simulate(CRANE, again).k_dyn == best.k_dyn

    comes_to(page.get_by_test_id("optimum-stale").is_visible, False)
    gap = page.locator('[data-path="shaft.gap"] input[type=text]')
    gap.fill("0.7")
    gap.press("Enter")
    page.get_by_test_id("optimum-stale").wait_for()
    changed = "For shaft.gap 0.5 rad; the drive has changed since."
    comes_to(lambda: page.get_by_test_id("optimum-stale").inner_text(), changed)

    page.get_by_test_id("optimum-time").fill("soon")
    page.get_by_test_id("optimum-go").click()
    page.get_by_text('Start time = "soon": this is not a number with a unit').wait_for()
    comes_to(lambda: page.get_by_test_id("optimum-answer").is_visible(), False)  # of another question


def test_the_limit_is_cancelled_in_mid_run_and_the_page_lives_on(page: Any, server: Any) -> None:
    tab(page, "Limit")
    until(lambda: bool(server.jobs()), 10.0, page)  # the process that waits for work
    page.get_by_test_id("curve-go").click()
    until(lambda: state(page, "curve").startswith("Computing: start "), LONG, page)
    before = set(server.jobs())
    page.get_by_test_id("curve-cancel").click()
    until(lambda: state(page, "curve").startswith("Cancelled after"), LONG, page)
    assert before - set(server.jobs()), "the process of the cancelled job is still there"
    comes_to(page.get_by_test_id("curve-go").is_enabled, True)
    comes_to(lambda: k_dyn(page, "direct"), f"{simulate(CRANE, 'direct').k_dyn:.3f}")


def test_two_users_have_their_own_sessions_and_a_closed_tab_ends_its_jobs(
    visit: Callable[..., Any], server: Any
) -> None:
    first, second = visit(), visit()
    tab(first, "Limit")
    first.get_by_test_id("curve-go").click()
    tab(second, "Optimum")
    second.get_by_test_id("optimum-go").click()
    done(second, "optimum")
    best = f"optimum {optimize(CRANE, '1.2x').end_time:.4g} s"
    assert k_dyn(second, best)
    assert first.get_by_text(best, exact=True).count() == 0
    until(lambda: len(server.jobs()) > 0, 5.0, second)
    first.context.close()
    until(lambda: len(server.jobs()) <= 1, 25.0, second)  # one process waits for the next job
    second.get_by_test_id("optimum-time").fill("0.5")
    second.get_by_test_id("optimum-go").click()
    assert k_dyn(second, "optimum 0.5 s") == f"{optimize(CRANE, 0.5).k_dyn:.3f}"


def test_panels_stay_within_their_column(page: Any) -> None:
    """Nothing is cut off sideways."""
    for name in ("Optimum", "Limit", "Tuning", "Files", "Checks", "Sheet", "Log"):
        tab(page, name)
        panel = page.locator(".instrument .panel").first
        panel.wait_for()
        drawn(page)
        inside, box = panel.evaluate("e => [e.scrollWidth, e.clientWidth]")
        assert inside <= box + 1, name


def test_jobs_are_shown_in_every_tab_of_their_user_and_after_a_reload(
    page: Any, visit: Any, server: Any
) -> None:
    second = page.context.new_page()
    second.goto(server.url)
    stranger = visit()
    for one in (page, second, stranger):
        one.wait_for_selector("#k-dyn[data-value]")
        one.get_by_role("tab", name="Tuning", exact=True).click()
    page.get_by_test_id("tuning-go").click()
    second.get_by_test_id("tuning-state").filter(has_text="Computing").wait_for()
    second.get_by_test_id("tuning-cancel").click()
    page.get_by_test_id("tuning-state").filter(has_text="Cancelled").wait_for()
    comes_to(stranger.get_by_test_id("tuning-state").is_visible, False)
    for one in (page, second):
        one.get_by_role("tab", name="Optimum", exact=True).click()
    page.get_by_test_id("optimum-go").click()
    for one in (page, second):
        one.get_by_test_id("optimum-answer").wait_for(timeout=60_000)
    found = '.strategies tbody tr[data-name^="optimum"]'
    comes_to(page.locator(found).count, 1)
    comes_to(second.locator(found).count, 0)
    comes_to(page.get_by_test_id("optimum-use").is_visible, False)
    second.get_by_test_id("optimum-use").click()
    second.locator(found).wait_for()
    page.reload()
    page.get_by_role("tab", name="Optimum", exact=True).click()
    page.get_by_test_id("optimum-answer").wait_for()
    comes_to(page.locator(found).count, 1)
    second.close()
