"""The duty in a real browser: what a hand does with the strip of steps, and what is seen then."""

from __future__ import annotations

from typing import Any

import pytest
from tests.page.conftest import INSTRUMENT, answered, at_rest, comes_to, drawn, opened
from tests.page.test_accessibility import STILL, axe, violations

from softstart import Drive, Duty, DutyStep, run_duty

CONVEYOR = Drive.load("conveyor-11kw")
PLAIN = Duty([DutyStep("start"), DutyStep("hold", time=1.0), DutyStep("stop")])
__all__ = ["axe"]

DUTY = f"{INSTRUMENT}.duty"
# whether anything but paper is drawn between the axes
INK = """() => {
  const canvas = document.querySelector(".duty-trace canvas");
  const paper = new OffscreenCanvas(canvas.width, canvas.height);
  const copy = paper.getContext("2d", { willReadFrequently: true });
  copy.drawImage(canvas, 0, 0);
  const { data } = copy.getImageData(60, 22, canvas.width - 80, canvas.height / 2);
  const colours = new Set();
  for (let i = 0; i < data.length; i += 4) colours.add(`${data[i]},${data[i + 1]},${data[i + 2]}`);
  return colours.size;
}"""


@pytest.fixture(scope="session")
def conveyor(start_server: Any) -> str:
    """The address of a server of the conveyor."""
    pytest.importorskip("nicegui", reason="NiceGUI is missing: make page")
    return start_server("conveyor-11kw").url


@pytest.fixture
def page(visit: Any, conveyor: str) -> Any:
    """The page of the conveyor with the duty under direct."""
    return with_duty(visit(url=conveyor))


def with_duty(page: Any) -> Any:
    page.get_by_role("tab", name="Duty", exact=True).click()
    page.wait_for_function(f"{DUTY}.view && !{DUTY}.view.waits")
    return page


def steps(page: Any) -> list[str]:
    return page.locator(".duty-step b").all_inner_texts()


def k_of_duty(page: Any) -> float:
    return float(page.locator(".duty-k").get_attribute("data-value") or "nan")


def step(page: Any, index: int) -> Any:
    return page.locator(".duty-step").nth(index)


def drag(page: Any, x: float, y: float, by: float) -> None:
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by, y, steps=6)
    page.mouse.up()


def test_the_duty_is_that_of_run_duty_and_its_picture_is_not_empty(page):
    run = run_duty(CONVEYOR, "direct", PLAIN)
    comes_to(lambda: k_of_duty(page), run.k_dyn)
    rows = page.locator(".duty-table tbody tr")
    shown = [row.split("\t")[2] for row in rows.all_inner_texts()]
    assert shown == [f"{run.k_dyn_of(row):.3f}" for row in run.rows]
    assert "worst" in rows.nth(run.worst.number - 1).inner_text()
    drawn(page)
    assert page.evaluate(INK) > 5
    page.get_by_role("button", name="step alone", exact=False).click()
    drawn(page)
    assert page.evaluate(INK) > 5


def test_steps_are_added_moved_and_removed_by_mouse_and_by_keyboard(page):
    step(page, 2).click()
    page.get_by_role("button", name="add hold", exact=True).click()
    page.get_by_role("button", name="add jog", exact=True).click()
    comes_to(lambda: steps(page), ["start", "hold", "stop", "hold", "jog"])
    at_rest(page)  # the blocks have the widths of their times
    assert page.locator("[data-path='duty[5].time'] input").input_value() == "0.2"
    first, last = step(page, 0).bounding_box(), step(page, 4).bounding_box()
    drag(page, last["x"] + 8, last["y"] + 30, first["x"] - last["x"] - 6)
    comes_to(lambda: steps(page), ["jog", "start", "hold", "stop", "hold"])
    step(page, 0).focus()
    page.keyboard.press("Alt+ArrowRight")  # it is jogged in motion then, which is refused
    comes_to(lambda: steps(page), ["start", "jog", "hold", "stop", "hold"])
    page.wait_for_selector(".duty-status.wrong")
    assert "jogged at rest" in page.locator(".duty-status").inner_text()
    assert page.locator(".duty-step.wrong").count() == 1
    page.keyboard.press("Delete")
    comes_to(lambda: steps(page), ["start", "hold", "stop", "hold"])
    page.wait_for_function(f"{DUTY}.view.trace")
    assert page.locator(".duty-status").is_hidden()
    page.keyboard.press("Control+z")
    comes_to(lambda: steps(page), ["start", "jog", "hold", "stop", "hold"])


def test_an_edge_that_is_drawn_sets_the_time_and_keys_do(page):
    at_rest(page)
    box = step(page, 1).bounding_box()
    drag(page, box["x"] + box["width"] - 3, box["y"] + 30, box["width"])
    answered(page)
    time = float(page.locator("[data-path='duty[2].time'] input").input_value())
    assert 1.8 < time < 2.2  # twice as wide
    duty = Duty([DutyStep("start"), DutyStep("hold", time=time), DutyStep("stop")])
    comes_to(lambda: k_of_duty(page), run_duty(CONVEYOR, "direct", duty).k_dyn)
    page.keyboard.press("Control+z")  # one step, however many positions there were
    comes_to(lambda: page.locator("[data-path='duty[2].time'] input").input_value(), "1")
    step(page, 1).focus()
    page.keyboard.press("Shift+ArrowRight")
    comes_to(lambda: page.locator("[data-path='duty[2].time'] input").input_value(), "1.1")


def test_the_strip_and_the_trace_have_the_same_edges(page):
    drawn(page)
    edges = page.evaluate(f"{DUTY}.plot.places.map(({{ x, w }}) => x + w)")
    left = page.locator(".duty-trace canvas").bounding_box()["x"]
    for index, edge in enumerate(edges):
        box = step(page, index).bounding_box()
        assert box["x"] + box["width"] == pytest.approx(left + edge, abs=1.0)


def test_a_wrong_value_is_said_beside_its_field(page):
    step(page, 1).click()
    field = page.locator("[data-path='duty[2].time'] input")
    field.fill("a while")
    field.press("Enter")
    comes_to(lambda: page.locator("[data-path='duty[2].time']").get_attribute("class").count("wrong"), 1)
    field.press("Escape")
    comes_to(field.input_value, "1")


def test_the_duty_stays_when_the_page_is_loaded_anew(page):
    page.get_by_role("button", name="add hold", exact=True).click()
    comes_to(lambda: steps(page), ["start", "hold", "hold", "stop"])
    at_rest_with_duty(page)
    page.reload()
    with_duty(opened(page))
    assert steps(page) == ["start", "hold", "hold", "stop"]


def at_rest_with_duty(page: Any) -> None:
    at_rest(page)
    page.wait_for_function(
        "(sessionStorage.getItem('softstart-inputs') ?? '').includes(location.hash.slice(1))"
    )


@pytest.mark.parametrize(("button", "begin"), [("Duty TOML", "[[duty]]"), ("Steps CSV", "step,do,"),
                                               ("Trace CSV", "step,do,time_in_step_s,motor")])  # fmt: skip
def test_files_of_the_duty(page, button, begin):
    with page.expect_download() as download:
        page.locator(".duty-files button", has_text=button).click()
    text = download.value.path().read_text("utf-8")
    assert text.startswith(begin)
    if button == "Duty TOML":
        assert Duty.from_toml(text) == PLAIN


@pytest.mark.parametrize("size", [(1024, 768), (1280, 800), (1920, 1080)])
def test_the_duty_has_no_serious_violation_and_fits(visit, conveyor, axe, size):
    page = with_duty(visit(*size, url=conveyor))
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    for tab in page.get_by_role("tab").all():
        assert tab.bounding_box()["x"] + tab.bounding_box()["width"] <= size[0] + 1
    for colours in ("light", "dark"):
        page.emulate_media(color_scheme=colours)
        page.wait_for_function(
            f"document.body.classList.contains('body--dark') === {str(colours == 'dark').lower()}"
        )
        page.wait_for_function(STILL)
        assert violations(page, axe) == []


def test_the_duty_at_the_output_names_its_units_in_heads_facts_and_trace(page):
    """As the switch says: the torque i eta times that of the motor shaft, in the unit of the page."""
    run = run_duty(CONVEYOR, "direct", PLAIN)
    page.locator("details:has(summary:text('Gear')) summary").click()
    for path, text in (("gear.ratio", "31.5"), ("units", "deg, rpm, kN m")):
        field = page.locator(f"[data-path='{path}'] input")
        field.fill(text)
        field.press("Enter")
        answered(page)
    page.locator('.shaft input[value="output"]').check(force=True)
    comes_to(lambda: page.locator(".duty-table thead th").all_inner_texts()[3], "largest\nkN m")
    page.wait_for_function(f"{DUTY}.view.at === ', at the output' && {DUTY}.view.trace")
    cell = page.locator(".duty-table tbody tr").nth(run.worst.number - 1).locator("td").nth(2).inner_text()
    assert float(cell) == pytest.approx(31.5 * run.worst.peak_torque / 1000.0, rel=5.1e-4)
    assert "kN m" in page.locator(".duty-k").locator("xpath=ancestor::*[3]").inner_text()
    trace = page.evaluate(f"{DUTY}.plot.csv({DUTY}.view)").splitlines()[0]
    assert trace.startswith("step,do,time_in_step_s,motor_torque_kNm_at_output,")
    drawn(page)
    assert page.evaluate(INK) > 5
