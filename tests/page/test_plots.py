"""Window, instant and files of the plots, the moving scheme of the drive, and the map, in a real browser."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tests.page.conftest import INSTRUMENT, at_rest, comes_to, drawn

from softstart import Drive, simulate

CRANE = Drive.load("crane-4amtkf")
DIRECT = simulate(CRANE, "direct")
HALF = float(CRANE.gap) / 2.0
INSTANT = "Number.parseFloat(document.querySelector('.player .instant').textContent) / 1000"


def box(page: Any) -> dict[str, float]:
    found: dict[str, float] = page.locator(".plots canvas").bounding_box()
    return found


def button(page: Any, text: str) -> Any:
    return page.locator(".player button", has_text=text)


def saved(page: Any, text: str) -> tuple[str, str]:
    """Name and content of the file that a button gives."""
    with page.expect_download() as download:
        button(page, text).click()
    return download.value.suggested_filename, Path(download.value.path()).read_text(encoding="utf-8")


def points(page: Any) -> dict[str, np.ndarray]:
    """Columns of the CSV by strategy and name, as they are seen now."""
    name, text = saved(page, "CSV")
    assert name == "Crane-travel-drive-4AMTKF-H-112L6.csv"
    rows = list(csv.DictReader(text.splitlines()))
    found: dict[str, np.ndarray] = {}
    for strategy in {row["strategy"] for row in rows}:
        own = [row for row in rows if row["strategy"] == strategy]
        for column in own[0]:
            if column != "strategy" and own[0][column]:
                found[f"{strategy} {column}"] = np.array([float(row[column]) for row in own])
    return found


def seen(page: Any, right: Callable[[dict[str, np.ndarray]], bool]) -> dict[str, np.ndarray]:
    """The points, when they are as they must be."""
    for _ in range(50):
        if right(found := points(page)):
            return found
        page.wait_for_timeout(200)
    raise AssertionError(f"these points came last: {found}")


def refined(page: Any, least: int) -> dict[str, np.ndarray]:
    """The points, when the server has sent those of the window for all that is drawn."""
    ticked = page.locator(".strategies tbody tr:has(input:checked)").evaluate_all(
        "(rows) => rows.map((one) => one.dataset.name)"
    )
    wanted = {f"{name} time_s" for name in ticked}
    return seen(page, lambda found: wanted <= found.keys() and found["direct time_s"].size >= least)


def scheme(page: Any) -> Any:
    """How the shaft stands in the scheme: share of the gap, flank that is touched, whether it is struck."""
    return page.evaluate(f"{INSTRUMENT}.scheme.states")[0]


def instant(page: Any) -> float:
    """The instant that is read, s."""
    return float(page.locator(".player .instant").inner_text().removesuffix(" ms")) / 1000.0


def hold(page: Any, share: float) -> float:
    page.locator(".player input").evaluate(
        "(one, share) => { one.value = share * one.max; one.dispatchEvent(new Event('input')); }", share
    )
    page.wait_for_function("document.querySelector('.player .instant').textContent !== ''")
    drawn(page)
    return instant(page)


def test_a_window_shows_the_exact_start(page):
    page.locator('tr[data-name="ramp"] input[type=checkbox]').check()
    all_of_it = refined(page, 2)
    assert all_of_it["direct time_s"][[0, -1]] == pytest.approx([0.0, DIRECT.end_time], rel=1e-6)
    assert button(page, "all").is_disabled()
    place = box(page)
    page.mouse.move(place["x"] + 140, place["y"] + 90)
    page.mouse.down()
    page.mouse.move(place["x"] + 180, place["y"] + 110, steps=5)
    page.mouse.up()
    seen = refined(page, 1000)
    times = seen["direct time_s"]
    assert times[-1] - times[0] < 0.1 * DIRECT.end_time
    assert np.diff(times).max() < 2e-3 * (times[-1] - times[0])
    for strategy in ("direct", "ramp"):
        at = seen[f"{strategy} time_s"]
        exact = simulate(CRANE, strategy).at(at)["T"]
        scale = np.abs(exact).max() + 1.0
        # times and torques have seven digits; beside a step of the slope that is seen
        assert seen[f"{strategy} shaft_torque_Nm"] == pytest.approx(exact, abs=2e-4 * scale)
    assert seen["direct twist_rad"] == pytest.approx(DIRECT.at(times)["theta"], abs=1e-5)
    button(page, "all").click()
    page.wait_for_function("document.querySelector('.player [title^=\"The whole\"]').disabled")


def test_wheel_drag_and_keys_move_the_window(page):
    place = box(page)
    page.mouse.move(place["x"] + 300, place["y"] + 90)
    page.mouse.wheel(0, -600)
    first = refined(page, 1000)["direct time_s"]
    assert first[-1] - first[0] == pytest.approx(
        (DIRECT.end_time / 0.9) * 1.0015**-600, rel=0.15
    )  # the axis goes to a round number beyond the end
    page.keyboard.down("Shift")
    page.mouse.move(place["x"] + 300, place["y"] + 90)
    page.mouse.down()
    page.mouse.move(place["x"] + 200, place["y"] + 90, steps=4)
    page.mouse.up()
    page.keyboard.up("Shift")
    span = first[-1] - first[0]

    def spans(found: dict[str, np.ndarray], share: float) -> bool:
        times = found["direct time_s"]
        return times[-1] - times[0] == pytest.approx(share * span, rel=0.02)

    seen(page, lambda found: found["direct time_s"][0] > first[0] and spans(found, 1.0))
    page.locator(".plots canvas").focus()
    page.keyboard.press("+")
    seen(page, lambda found: spans(found, 0.5))
    page.locator(".plots canvas").focus()
    page.keyboard.press("0")
    seen(page, lambda found: found["direct time_s"][-1] == pytest.approx(DIRECT.end_time, rel=1e-6))
    page.locator(".plots canvas").focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_function(f"{INSTANT} > 0")


def test_the_scheme_stands_as_the_drive_does(page):
    for share in (0.0, 0.05, 0.2, 0.43, 0.7, 0.9):
        t = hold(page, share)
        assert t == pytest.approx(share * DIRECT.end_time, rel=1e-3, abs=1e-5)
        stands = DIRECT.at(t)
        pin = min(max(float(stands["theta"]) / HALF, -1.0), 1.0)
        assert scheme(page)["share"] == pytest.approx(pin, abs=0.02)
        side = next(s.side for s in reversed(DIRECT.stages) if s.start <= t)
        assert scheme(page)["side"] == side
    contact = next(stage for stage in DIRECT.stages if stage.side != 0)
    hold(page, contact.start / DIRECT.end_time + 2e-3)
    assert scheme(page)["struck"]
    comes_to(page.locator(".scheme .front.struck").count, 1)
    hold(page, 0.5 * (contact.start + contact.end) / DIRECT.end_time)
    assert not scheme(page)["struck"]


def test_a_start_is_played_to_its_end(page):
    page.locator(".player select").select_option("3")
    button(page, "\u25b6").click()
    page.wait_for_function(f"{INSTANT} > 0")
    assert instant(page) <= DIRECT.end_time * 1.001  # shown with a few digits
    page.wait_for_function("document.querySelector('.player [title=\"Play\"]')")
    page.wait_for_function(f"Math.abs({INSTANT} / {DIRECT.end_time!r} - 1) < 1e-3")


def test_what_is_seen_is_saved_as_a_picture(page):
    at_rest(page)
    with page.expect_download() as download:
        button(page, "PNG").click()
    assert download.value.suggested_filename == "Crane-travel-drive-4AMTKF-H-112L6.png"
    with Image.open(download.value.path()) as picture:
        assert picture.size == (round(box(page)["width"]), round(box(page)["height"]))
        assert len(picture.convert("RGB").getcolors(100_000)) > 20


def test_a_file_saved_while_figures_arrive_is_whole(page):
    """What the server sends is drawn with the next picture; a file may be asked for before that."""
    page.evaluate("""() => {
      const { instrument } = window.getElement(document.querySelector(".instrument"));
      const take = instrument.take.bind(instrument);
      window.files = [];
      instrument.take = (number, frame) => {
        take(number, frame);
        if (frame.traces?.direct) window.files.push(instrument.plots.csv());
      };
    }""")
    page.locator('[data-path="shaft.gap"] input[type=text]').fill("0.6 rad")
    page.locator('[data-path="shaft.gap"] input[type=text]').press("Enter")
    page.wait_for_function("window.files.length > 0")
    for table in page.evaluate("window.files"):
        assert len(table.splitlines()) > 100


def test_maps_of_two_strategies_are_compared(page):
    whole = """(strategy) => {
      const { map } = window.getElement(document.querySelector(".instrument")).instrument;
      return map.head?.strategy === strategy && map.ready;
    }"""
    page.locator('tr[data-name="ramp"] input[type=radio]').check()
    page.wait_for_function(whole, arg="ramp")
    page.evaluate("""() => {
      const { map } = window.getElement(document.querySelector(".instrument")).instrument;
      map.head = null;
      map.rows = []; // nothing has come yet
      map.other.click();
    }""")
    page.locator('tr[data-name="direct"] input[type=radio]').check()
    page.wait_for_function(whole, arg="direct")
    assert page.locator("#map-other").is_checked()
    page.locator('tr[data-name="ramp"] input[type=radio]').check()
    page.wait_for_function(whole, arg="ramp")
    place = page.locator(".map-canvas canvas").bounding_box()
    page.mouse.move(place["x"] + 150, place["y"] + 60)
    page.wait_for_function("document.querySelector('.map .said').textContent.includes('(direct: ')")
    words = page.locator(".map .said").inner_text().replace("(direct:", "").replace(")", "").split()
    gap, inertia = float(words[1]), float(words[4])
    own, other = float(words[words.index("K") + 1]), float(words[-1])
    drive = CRANE.replace(gap=gap, load_inertia=inertia)
    assert own == pytest.approx(simulate(drive, "ramp").k_dyn, abs=2e-3)
    assert other == pytest.approx(simulate(drive, "direct").k_dyn, abs=2e-3)
