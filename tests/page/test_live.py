"""The live part of the page in a real browser: what a hand does, and what is seen then."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest
from tests.page.conftest import (
    INSTRUMENT,
    answered,
    at_rest,
    choose,
    comes_to,
    drawn,
    opened,
    settled,
    wait_for_rows,
)  # fmt: skip

from softstart import Drive, simulate
from softstart.controller import make_controller
from softstart.page.session import Session

CRANE = Drive.load("crane-4amtkf")
STEPS = 60


def k_dyn(page: Any) -> float:
    return float(page.locator("#k-dyn").get_attribute("data-value"))


def wait_for_k(page: Any, value: float) -> None:
    page.wait_for_function(
        "(wanted) => Math.abs(document.querySelector('#k-dyn').dataset.value - wanted) < 1e-12 * wanted",
        arg=value,
    )


def slider(page: Any, path: str) -> Any:
    return page.locator(f'[data-path="{path}"] input[type=range]')


def field(page: Any, path: str) -> Any:
    return page.locator(f'[data-path="{path}"] input[type=text]')


def enter(page: Any, path: str, text: str) -> None:
    field(page, path).fill(text)
    field(page, path).press("Enter")


def kept(page: Any) -> None:
    """Wait until the tab has stored its inputs."""
    at_rest(page)
    page.wait_for_function(
        "(sessionStorage.getItem('softstart-inputs') ?? '').includes(location.hash.slice(1))"
    )


def shows(page: Any, path: str, text: str) -> None:
    """Wait until a field shows a text: figures may come before the fields do."""
    page.wait_for_function(
        '([path, text]) => document.querySelector(`[data-path="${path}"] input[type=text]`).value === text',
        arg=[path, text],
    )


def drag(page: Any, path: str, start: float, end: float, steps: int) -> None:
    """From one share of the slider's length to another, by mouse."""
    while (box := slider(page, path).bounding_box()) is None:
        page.wait_for_timeout(20)  # the fields are being made anew
    x, y, width = box["x"] + 6, box["y"] + box["height"] / 2, box["width"] - 12
    page.mouse.move(x + start * width, y)
    page.mouse.down()
    page.mouse.move(x + end * width, y, steps=steps)
    page.mouse.up()


def test_a_slider_moved_by_mouse_gives_the_k_dyn_of_simulate(page):
    comes_to(lambda: k_dyn(page), simulate(CRANE, "direct").k_dyn)
    drag(page, "shaft.gap", 0.25, 0.8, 12)
    page.wait_for_function("document.querySelector('[data-path=\"shaft.gap\"] input[type=text]').value > 1.2")
    gap = float(settled(page, "document.getElementById('field-shaft-gap').value"))
    wait_for_k(page, simulate(CRANE.replace(gap=gap), "direct").k_dyn)
    for name in ("shaped", "ramp"):
        shown = page.locator(f'tr[data-name="{name}"] td[data-key="k_dyn"]').inner_text()
        assert shown == f"{simulate(CRANE.replace(gap=gap), name).k_dyn:.3f}"


@pytest.mark.alone
def test_the_first_picture_is_drawn_within_two_seconds(page):
    """From the request on; the best of three, since others may take the processor."""
    drawn = f"""() => {{
      const {{ plots, figure }} = {INSTRUMENT};
      return plots.main?.u && document.querySelector("#k-dyn[data-value]") && performance.now();
    }}"""
    times = []
    for _ in range(3):
        page.reload(wait_until="commit")
        page.wait_for_function("document.querySelector('.instrument')")
        times.append(page.wait_for_function(drawn).json_value())
    assert min(times) < 2000.0, times


@pytest.mark.alone
def test_sixty_steps_of_a_drag_give_at_least_55_updates(page):
    """While the start is played, 100 times slower than it is, and of the strategy that is slowest to design.

    On a machine whose processor others take away for half a second, the page leaves steps out on purpose:
    the best of three drags counts.
    """
    choose(page, "state-feedback")
    page.locator(".player select").select_option("100")
    page.get_by_role("button", name="Play", exact=True).click()
    page.evaluate("""() => {
      window.updates = 0;
      new MutationObserver((all) => {
        window.updates += all.filter((one) => one.addedNodes.length).length;
      }).observe(document.querySelector("#k-dyn"), { childList: true });
    }""")
    for ends in [(0.02, 0.98), (0.98, 0.02), (0.02, 0.98)]:
        page.evaluate("window.updates = 0")
        drag(page, "shaft.gap", *ends, STEPS)
        if (updates := settled(page, "window.updates")) >= 55:
            break
    assert updates >= 55


def test_a_press_on_the_map_goes_to_that_gap_and_inertia(page):
    at_rest(page)
    box, plots = page.locator(".map canvas").bounding_box(), page.locator(".plots").bounding_box()
    x, y = box["x"] + 0.62 * box["width"], box["y"] + 0.3 * box["height"]
    page.mouse.move(plots["x"] + 200, y)  # what begins elsewhere is not meant
    page.mouse.down()
    page.mouse.move(x, y, steps=4)
    page.mouse.up()
    answered(page)
    comes_to(field(page, "shaft.gap").input_value, "0.5")
    page.mouse.click(x, y)
    page.wait_for_function("document.getElementById('field-shaft-gap').value != '0.5'")
    gap = float(field(page, "shaft.gap").input_value())
    inertia = float(field(page, "load.inertia").input_value())
    assert gap > 0.5
    assert inertia > 0.175
    wait_for_k(page, simulate(CRANE.replace(gap=gap, load_inertia=inertia), "direct").k_dyn)
    page.locator(".map canvas").focus()
    page.keyboard.press("ArrowLeft")  # and its neighbour by keyboard
    page.wait_for_function(
        "(gap) => document.querySelector('[data-path=\"shaft.gap\"] input[type=text]').value < gap", arg=gap
    )


def test_a_press_on_the_map_means_what_its_axis_says_after_values_in_other_units(page):
    """5.7 deg typed on a page in rad: it stays in rad, and a press sets what the read-out of the map said."""
    at_rest(page)
    enter(page, "shaft.gap", "5.7 deg")
    shows(page, "shaft.gap", "5.7 deg")
    row = page.locator('[data-path="shaft.gap"]')
    box = page.locator(".map canvas").bounding_box()
    for units, size in ((None, 1.0), ("deg, rpm", math.pi / 180), ("mm on 80 mm, rpm", 1e-3 / 0.04)):
        if units:
            page.locator("#field-units").fill(units)
            page.locator("#field-units").press("Enter")
            comes_to(row.locator(".unit").inner_text, units.split()[0].strip(","))
        for share in (0.4, 0.6):  # before and after the map is drawn anew
            page.mouse.move(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
            said = page.locator(".map .said")
            page.wait_for_function("document.querySelector('.map .said').textContent !== ''")
            drawn(page)
            number, unit = said.inner_text().split()[1:3]
            assert unit == row.locator(".unit").text_content()  # hidden beside "5.7 deg"
            page.mouse.down()
            page.mouse.up()
            answered(page)
            gap = float(settled(page, "document.getElementById('field-shaft-gap').value"))
            assert gap == pytest.approx(float(number), rel=1e-3)
            here = page.evaluate(f"{INSTRUMENT}.state.here[0]")
            assert here == pytest.approx(float(number) * size, rel=1e-3)
            at_rest(page)


@pytest.mark.parametrize("finger", ["tap", "swipe"])
def test_a_finger_scrolls_over_the_pictures_and_a_tap_goes_there(visit, finger):
    """On a tablet the pictures fill the width: a swipe over them moves the page, not the drive."""
    page = visit(768, 1024, has_touch=True)
    at_rest(page)
    page.locator(".map canvas").scroll_into_view_if_needed()
    box = page.locator(".map canvas").bounding_box()
    x, y = box["x"] + 0.62 * box["width"], box["y"] + 0.5 * box["height"]
    places = "[...document.querySelectorAll('*')].reduce((sum, one) => sum + one.scrollTop, 0)"
    if finger == "tap":
        page.touchscreen.tap(x, y)
        page.wait_for_function("document.getElementById('field-shaft-gap').value != '0.5'")
        return
    before = page.evaluate(places)
    line = page.context.new_cdp_session(page)
    for step in range(11):  # downwards, towards the top of the page
        kind, at = "touchMove" if step else "touchStart", {"x": x, "y": y + 20 * step}
        line.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [at]})
    line.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.wait_for_function(f"(before) => {places} < before - 50", arg=before)
    answered(page)
    assert field(page, "shaft.gap").input_value() == "0.5"


def test_limits_open_in_sight_and_stay_open(page):
    summary = page.locator("details:has(summary:text('Limits')) summary")
    summary.click()
    page.wait_for_function("""() => {
      const folds = [...document.querySelectorAll(".controls details")];
      const fold = folds.find((one) => one.textContent.startsWith("Limits"));
      const [seen, part] = [fold.closest(".controls"), fold].map((one) => one.getBoundingClientRect());
      return fold.open && part.bottom <= Math.min(seen.bottom, window.innerHeight) + 1;
    }""")
    page.locator("#field-units").fill("deg, rpm")
    page.locator("#field-units").press("Enter")
    comes_to(page.locator('[data-path="shaft.gap"] .unit').inner_text, "deg")
    assert page.locator("details:has(summary:text('Limits'))").get_attribute("open") is not None


def test_a_fold_that_a_hand_has_opened_is_open_after_a_reload(page):
    page.locator("details:has(summary:text('Limits')) summary").click()
    page.locator("#field-limits-shaft_torque").wait_for()
    page.reload()
    opened(page)
    assert page.locator("#field-limits-shaft_torque").is_visible()


def test_the_recommended_strategy_is_marked_and_its_figure_is_the_large_one(visit):
    """Until another one is selected; at 1280 pixels the last column is whole."""
    page = visit(select="")
    page.locator("details:has(summary:text('Limits')) summary").click()
    drive = CRANE.with_settings(["limits.shaft_torque=75", "limits.start_time=1.0"])
    for path, text in (("limits.start_time", "1.0"), ("limits.shaft_torque", "75")):
        enter(page, path, text)
    session = Session(drive)  # as the strategies are set there
    recommended = session.recommendation().recommended
    comes_to(page.locator(".figure .name").inner_text, recommended.name)
    wait_for_k(page, recommended.run.k_dyn)
    marks = page.locator(".strategies .mark:visible")
    comes_to(marks.count, 1)
    assert marks.locator("xpath=ancestor::tr").get_attribute("data-name") == recommended.name
    place = page.locator(".strategies")
    assert place.evaluate("e => e.scrollWidth <= e.clientWidth")
    wide = "[...document.querySelectorAll('.flag')].filter((e) => e.offsetLeft < 0).map((e) => e.innerText)"
    assert page.evaluate(wide) == []
    choose(page, "direct")
    enter(page, "limits.shaft_torque", "90")
    at_rest(page)
    assert page.locator(".figure .name").inner_text() == "direct"


def test_the_switch_to_the_output_changes_fields_table_canvases_and_the_map(page):
    """A press on the map sets what its read-out says; a reload keeps the switch."""
    output = page.locator('.shaft input[value="output"]')
    assert output.is_disabled()  # without a gear
    page.locator("details:has(summary:text('Gear')) summary").click()
    enter(page, "gear.ratio", "38")
    comes_to(output.is_enabled, True)
    output.check(force=True)
    shows(page, "shaft.gap", "0.0131579")
    peak = simulate(CRANE, "direct").peak_torque
    cell = page.locator('tr[data-name="direct"] td[data-key="peak_torque"]')
    comes_to(cell.inner_text, f"{38.0 * peak:.0f}")
    at_rest(page)
    assert page.evaluate(f"{INSTRUMENT}.plots.main.units.at") == ", at the output"
    box = page.locator(".map canvas").bounding_box()
    place = box["x"] + 0.62 * box["width"], box["y"] + 0.3 * box["height"]
    page.mouse.move(*place)
    comes_to(lambda: "rad" in page.locator(".said").inner_text(), True)
    read = float(re.search(r"\S+ (\S+) rad", page.locator(".said").inner_text())[1])
    page.mouse.click(*place)
    page.wait_for_function("document.getElementById('field-shaft-gap').value != '0.0131579'")
    gap = float(field(page, "shaft.gap").input_value())
    assert gap == pytest.approx(read, rel=1e-3)
    inertia = float(field(page, "load.inertia").input_value())
    drive = CRANE.replace(gap=38.0 * gap, load_inertia=inertia / 38.0**2)
    comes_to(cell.inner_text, f"{38.0 * simulate(drive, 'direct').peak_torque:.0f}")
    kept(page)
    page.reload()
    opened(page)
    comes_to(output.is_checked, True)


@pytest.mark.parametrize("width", [1920, 1280, 1024, 768])
def test_the_data_sheet_lies_over_nothing(visit, width):
    page = visit(width, 1080)
    page.get_by_role("tab", name="Sheet", exact=True).click()
    page.get_by_test_id("sheet-use").wait_for()
    drawn(page)
    assert page.evaluate("""() => {
      const parts = [".controls", ".centre", ".figure", ".panel-tabs", ".panel-body"];
      const boxes = parts.map((name) => document.querySelector(name).getBoundingClientRect());
      const beside = (a, b) => Math.min(a.right, b.right) <= Math.max(a.left, b.left) + 1;
      const below = (a, b) => Math.min(a.bottom, b.bottom) <= Math.max(a.top, b.top) + 1;
      return boxes.every((a, i) => boxes.slice(i + 1).every((b) => beside(a, b) || below(a, b)));
    }""")
    assert page.locator(".strategies").evaluate("e => e.scrollWidth <= e.clientWidth")


def test_a_fold_with_values_is_open_after_a_reload(page):
    fold = page.locator("details:has(summary:text('Limits'))")
    assert fold.get_attribute("open") is None
    fold.locator("summary").click()
    limit = page.locator("#field-limits-shaft_torque")
    limit.fill("70")
    limit.press("Enter")
    at_rest(page)
    before = page.locator(".controls").evaluate("e => e.scrollTop")
    page.reload()
    opened(page)
    comes_to(limit.input_value, "70")
    assert limit.is_visible()
    assert page.locator("details:has(summary:text('Gear'))").get_attribute("open") is None  # nothing is in it
    assert page.locator(".controls").evaluate("e => e.scrollTop") == 0 <= before  # only a hand scrolls
    fold.locator("summary").click()  # closed by hand it stays closed, whatever is built anew
    page.locator("#field-units").fill("deg, rpm")
    page.locator("#field-units").press("Enter")
    comes_to(page.locator('[data-path="shaft.gap"] .unit').inner_text, "deg")
    assert fold.get_attribute("open") is None


def test_a_mistake_stands_beside_its_field_and_the_state_stays(page):
    before = k_dyn(page)
    field(page, "motor.starting_torque").fill("5")  # weaker than its load
    field(page, "motor.starting_torque").press("Tab")
    page.locator("#field-motor-starting_torque-mistake").wait_for(state="visible")
    comes_to(field(page, "motor.starting_torque").input_value, "5")
    comes_to(lambda: k_dyn(page), before)
    field(page, "motor.starting_torque").press("Escape")
    page.locator("#field-motor-starting_torque-mistake").wait_for(state="hidden")
    comes_to(field(page, "motor.starting_torque").input_value, "62")


def test_everything_is_reached_by_keyboard(page):
    slider(page, "shaft.gap").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    page.wait_for_function(
        "document.querySelector('[data-path=\"shaft.gap\"] input[type=text]').value == '0.51'"
    )
    wait_for_k(page, simulate(CRANE.replace(gap=0.51), "direct").k_dyn)
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "field-shaft-gap"
    page.locator('tr[data-name="direct"] input[type=radio]').focus()
    page.keyboard.press("ArrowDown")  # the next strategy
    page.wait_for_function("document.querySelector('.figure .name').textContent == 'pulse-coast-hold'")
    wait_for_k(page, simulate(CRANE.replace(gap=0.51), "pulse-coast-hold").k_dyn)
    outline = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
    assert outline != "none"


def test_strategies_are_drawn_hidden_and_sorted(page):
    page.locator('tr[data-name="ramp"] input[type=checkbox]').check()
    wait_for_rows(page)
    assert page.locator('tr[data-name="ramp"] input[type=checkbox]').is_checked()
    rows = page.locator(".strategies tbody tr")
    names = rows.evaluate_all("all => all.map((tr) => tr.dataset.name)")
    assert names == sorted(names, key=lambda name: simulate(CRANE, name).k_dyn)  # without a press
    page.locator('th[data-key="start_time"] button').click()
    names = rows.evaluate_all("all => all.map((tr) => tr.dataset.name)")
    assert names == sorted(names, key=lambda name: simulate(CRANE, name).start_time)
    page.locator('tr[data-name="s-curve"] td.number').first.click()
    wait_for_k(page, simulate(CRANE, "s-curve").k_dyn)


def test_older_frames_change_neither_what_was_written_nor_what_was_selected(page):
    instrument = 'const { instrument } = window.getElement(document.querySelector(".instrument"));'
    written = field(page, "shaft.gap").evaluate(f"""(field) => {{
      {instrument}
      const before = {{ ...instrument.state.fields, "shaft.gap": {{ text: "0.6", position: 180 }} }};
      field.value = "700 mrad";
      for (const what of ["input", "change"]) field.dispatchEvent(new Event(what));
      instrument.controls.show(before, {{}}, instrument.state.stamp);  // of a slide that came before
      return field.value;
    }}""")
    assert written == "700 mrad"
    wait_for_k(page, simulate(CRANE.replace(gap=0.7), "direct").k_dyn)
    radio = page.locator('tr[data-name="ramp"] input[type=radio]')
    selected = radio.evaluate(f"""(radio) => {{
      {instrument}
      radio.click();
      instrument.table.show({{ ...instrument.state, selected: "shaped" }});  // pressed before
      return radio.checked;
    }}""")
    assert selected
    wait_for_k(page, simulate(CRANE.replace(gap=0.7), "ramp").k_dyn)
    assert radio.is_checked()


def test_a_lost_line_is_taken_up_again_with_the_same_drive(page):
    enter(page, "shaft.gap", "1 rad")
    wait_for_k(page, simulate(CRANE.replace(gap=1.0), "direct").k_dyn)
    page.evaluate("window.socket.io.engine.close()")
    page.wait_for_function("!window.socket.connected")
    page.wait_for_function("window.socket.connected")
    drag(page, "load.inertia", 0.5, 0.7, 5)
    page.wait_for_function(
        "document.querySelector('[data-path=\"load.inertia\"] input[type=text]').value > 0.2"
    )
    inertia = float(settled(page, "document.getElementById('field-load-inertia').value"))
    wait_for_k(page, simulate(CRANE.replace(gap=1.0, load_inertia=inertia), "direct").k_dyn)


def test_a_page_loaded_anew_goes_on_with_its_drive(page, visit):
    enter(page, "shaft.gap", "1.3 rad")
    wait_for_k(page, simulate(CRANE.replace(gap=1.3), "direct").k_dyn)
    page.locator('tr[data-name="ramp"] input[type=radio]').check()
    enter(page, "strategy.time", "200 ms")
    expected = simulate(CRANE.replace(gap=1.3), make_controller("ramp", {"time": 0.2})).k_dyn
    wait_for_k(page, expected)
    kept(page)
    page.reload()
    wait_for_k(opened(page), expected)
    shows(page, "shaft.gap", "1.3")
    other = visit()  # another tab has nothing of it
    wait_for_k(other, simulate(CRANE, "direct").k_dyn)
    linked = visit(url=page.url, select="")  # but a link brings all of it
    wait_for_k(linked, expected)
    shows(linked, "strategy.time", "0.2")


def test_a_reference_is_kept_drawn_and_cleared(page):
    direct = simulate(CRANE, "direct")
    keep, foot = page.get_by_text("Keep as reference"), page.locator(".strategies tfoot")
    comes_to(foot.is_visible, False)
    keep.click()
    foot.wait_for(state="visible")
    enter(page, "shaft.gap", "0.07 rad")
    page.locator('tr[data-name="ramp"] input[type=radio]').check()
    wait_for_k(page, simulate(CRANE.replace(gap=0.07), "ramp").k_dyn)
    comes_to(foot.locator('[data-key="k_dyn"]').inner_text, f"{direct.k_dyn:.3f}")
    peak = page.evaluate("""() => {
      const { plots } = window.getElement(document.querySelector(".instrument")).instrument;
      return plots.reference.peak[1];
    }""")
    assert peak == direct.peak_torque
    page.get_by_label("clear the reference").click()
    foot.wait_for(state="hidden")


def test_at_equal_time_each_strategy_is_set_and_marked_if_too_slow_until_it_is_switched_off(page):
    at_rest(page)

    def cell(name, key):
        return page.locator(f'tr[data-name="{name}"] [data-key="{key}"]')

    as_set = cell("s-curve", "k_dyn").inner_text()
    switch, time = page.get_by_label("equal time").first, page.get_by_label("equal time", exact=True).last
    assert time.input_value() == "1.3x"
    assert not cell("s-curve", "set_to").is_visible()
    switch.check()
    comes_to(cell("s-curve", "set_to").inner_text, "time 0.134 s")
    best = simulate(CRANE, make_controller("s-curve", {"time": 0.134})).k_dyn
    assert cell("s-curve", "k_dyn").inner_text() == f"{best:.3f}" != as_set
    time.fill("1.1x")
    time.press("Enter")
    comes_to(cell("take-up", "flag").inner_text, "too slow")
    assert "no value of full_torque" in page.locator('tr[data-name="take-up"]').get_attribute("title")
    kept(page)
    page.reload()
    opened(page)
    comes_to(switch.is_checked, True)
    comes_to(cell("take-up", "flag").inner_text, "too slow")
    switch.uncheck()
    comes_to(cell("s-curve", "k_dyn").inner_text, as_set)
    comes_to(cell("s-curve", "set_to").is_visible, False)
    page.keyboard.press("Control+z")
    comes_to(switch.is_checked, True)


def test_undo_and_redo_by_buttons_and_keys(visit):
    page = visit(select="")  # to select another one would be a step to undo
    first = k_dyn(page)
    drag(page, "shaft.gap", 0.25, 0.8, 12)
    page.wait_for_function("document.querySelector('[data-path=\"shaft.gap\"] input[type=text]').value > 1.2")
    dragged = settled(page, "Number(document.querySelector('#k-dyn').dataset.value)")
    assert dragged != first
    page.get_by_label("Undo", exact=True).click()
    wait_for_k(page, first)  # the figure comes before the frame with all else
    page.wait_for_function("document.querySelector('[aria-label=Undo]').disabled")
    page.keyboard.press("Control+Shift+z")
    wait_for_k(page, dragged)
    slider(page, "shaft.gap").focus()
    page.keyboard.press("Control+z")
    wait_for_k(page, first)
    field(page, "shaft.gap").fill("0.9")  # here the keys are those of the text
    page.keyboard.press("Control+y")
    answered(page)
    comes_to(lambda: k_dyn(page), first)


def test_colours_follow_the_system_and_the_switch(page):
    page.emulate_media(color_scheme="dark")
    opened(page)
    page.wait_for_function("document.body.classList.contains('body--dark')")
    paper = "getComputedStyle(document.querySelector('.controls')).backgroundColor"
    light = [int(part) > 200 for part in re.findall(r"\d+", page.evaluate(paper))[:3]]
    assert light == [False] * 3
    page.locator('.theme input[value="light"]').check(force=True)
    page.wait_for_function(f"{paper} == 'rgb(255, 255, 255)'")
    page.emulate_media(color_scheme="light")
    page.locator('.theme input[value="dark"]').check(force=True)
    page.wait_for_function(f"{paper} != 'rgb(255, 255, 255)'")


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1920, 1080)])
def test_the_main_view_fits_without_scrolling(visit, width, height):
    page = visit(width, height)
    at_rest(page)
    sizes = page.evaluate(
        "['.controls', '.strategies', '.centre'].map((name) => document.querySelector(name))"
        ".map((part) => [part.scrollHeight - part.clientHeight, part.scrollWidth - part.clientWidth])"
    )
    assert sizes == [[0, 0]] * 3
    whole = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
    assert page.evaluate(whole) == [width, height]
