"""Files on the page: a drive in and out, traces, code, the report, the command line."""

from __future__ import annotations

import re
import shlex
import zipfile
from pathlib import Path
from typing import Any

import pytest
from tests.page.conftest import INSTRUMENT, at_rest, comes_to, drawn

from softstart import Chain, DataSheet, Drive, TorqueProfile, export_controller, parameter_sheet, simulate
from softstart.controller import make_controller
from softstart.project import Project

CRANE = Drive.load("crane-4amtkf")
SHEET = {
    "motor.rated_power": "3 kW", "motor.rated_speed": "1430 rpm", "motor.inertia": "0.0119 kg*m^2",
    "load.mass": "12 t", "load.radius": "157.5 mm", "gear.ratio": "31.5",
    "gear.stiffness": "25 N*m/arcmin", "gear.backlash": "15 arcmin", "name": "gantry",
}  # fmt: skip


def put(page: Any, name: str, content: bytes) -> None:
    # the one before is cleared away by the server: what is chosen meanwhile would go with it
    page.wait_for_function("document.querySelectorAll('.q-uploader__file').length === 0")
    page.locator('input[type="file"]').first.set_input_files(
        {"name": name, "mimeType": "application/toml", "buffer": content}
    )


def saved(page: Any, name: str) -> tuple[str, bytes]:
    with page.expect_download(timeout=120_000) as download:
        page.get_by_test_id(name).click()
    return download.value.suggested_filename, Path(download.value.path()).read_bytes()


def k_dyn(page: Any, text: str) -> None:
    """Wait until the large figure shows this."""
    page.wait_for_function("text => document.getElementById('k-dyn').textContent.trim() === text", arg=text)


@pytest.fixture
def files(page: Any) -> Any:
    page.get_by_role("tab", name="Files", exact=True).click()
    return page


def test_a_drive_goes_in_and_out(files: Any, tmp_path: Path) -> None:
    own = CRANE.replace(name='../Мой "кран" <b>7</b>', gap=1.25, load_kind="reactive", damping=0.3)
    put(files, "mine.toml", own.to_toml().encode())
    k_dyn(files, f"{simulate(own, 'direct').k_dyn:.3f}")
    comes_to(files.locator(".drive-name").inner_text, own.name)
    comes_to(files.get_by_test_id("drive-trouble").is_visible, False)
    name, content = saved(files, "drive-save")
    assert re.fullmatch(r"[a-z0-9-]+\.toml", name)
    (tmp_path / name).write_bytes(content)
    assert Drive.load(tmp_path / name) == own
    files.get_by_test_id("drive-choice").click()
    files.get_by_role("option", name=Drive.load("servo-axis-small").name).click()
    k_dyn(files, f"{simulate('servo-axis-small', 'direct').k_dyn:.3f}")


def test_report_traces_and_command_line(files: Any, tmp_path: Path) -> None:
    """The report is computed aside; meanwhile everything else goes on."""
    files.get_by_test_id("project-names").click()
    files.get_by_test_id("project-customer").fill("Harbour <&> Co")
    with files.expect_download(lambda it: it.suggested_filename.endswith(".html"), timeout=120_000) as report:
        files.get_by_test_id("report-go").click()
        name, content = saved(files, "export-traces")
        assert name == "crane-travel-drive-4amtkf-h-112l6-direct-traces.csv"
        simulate(CRANE, "direct").to_csv(tmp_path / "same.csv")
        assert content == (tmp_path / "same.csv").read_bytes()
        gap = files.locator('[data-path="shaft.gap"] input[type=text]')
        gap.fill("0.75")
        gap.press("Enter")
        drive = CRANE.replace(gap=0.75)
        k_dyn(files, f"{simulate(drive, 'direct').k_dyn:.3f}")
        command = files.get_by_test_id("command")
        files.wait_for_function("() => document.querySelector('.command').innerText.includes('0.75')")
        words = shlex.split(command.inner_text())
        assert words[:2] == ["softstart", "compare"]
        assert "--set shaft.gap=0.75" in " ".join(words)
    html = Path(report.value.path()).read_text(encoding="utf-8")
    assert report.value.suggested_filename == "crane-travel-drive-4amtkf-h-112l6-report.html"
    assert html.lstrip().lower().startswith("<!doctype html")
    assert CRANE.name in html
    assert "Harbour &lt;&amp;&gt; Co" in html
    assert not re.search(r'(?:src|href)="(?:https?:)?//', html)
    name, content = saved(files, "report-file")
    assert (name, content.decode()) == (report.value.suggested_filename, html)


def test_a_report_is_saved_as_pdf_with_another_machine(files: Any) -> None:
    files.get_by_test_id("report-kind").click()
    files.get_by_role("option", name="PDF").click()
    files.get_by_test_id("report-beside").click()
    files.get_by_role("option", name="conveyor-11kw").click()
    with files.expect_download(timeout=180_000) as download:
        files.get_by_test_id("report-go").click()
    assert download.value.suggested_filename == "crane-travel-drive-4amtkf-h-112l6-report.pdf"
    assert Path(download.value.path()).read_bytes().startswith(b"%PDF-")


def test_what_the_page_saves_of_a_strategy_it_loads(files: Any, tmp_path: Path) -> None:
    """A profile comes back as it was; a wrong file is refused in a sentence."""
    profile = TorqueProfile([0.0, 0.1, 0.1], [20.0, 62.0, 30.0])
    profile.to_toml(tmp_path / "own-profile.toml")
    put(files, "own-profile.toml", (tmp_path / "own-profile.toml").read_bytes())
    caption = files.get_by_test_id("export-strategy")
    comes_to(caption.inner_text, "Selected: own-profile")
    name, saved_profile = saved(files, "export-profile-toml")
    assert name == "own-profile.toml"
    (tmp_path / name).write_bytes(saved_profile)
    again = TorqueProfile.load(tmp_path / name)
    assert (again.time.tolist(), again.torque.tolist()) == (profile.time.tolist(), profile.torque.tolist())
    put(files, "wrong.csv", b"nothing")
    files.get_by_test_id("drive-trouble").get_by_text("wrong.csv").first.wait_for()
    comes_to(caption.inner_text, "Selected: own-profile")


def test_a_program_of_the_selected_strategy(files: Any, tmp_path: Path) -> None:
    """The ZIP file has what `export_controller` gives."""
    with files.expect_download(lambda it: it.suggested_filename.endswith(".zip"), timeout=120_000) as zipped:
        files.get_by_test_id("program-go").click()
    assert zipped.value.suggested_filename == "crane-travel-drive-4amtkf-h-112l6-direct-c99.zip"
    expected = export_controller(make_controller("direct"), CRANE, "c").files
    with zipfile.ZipFile(zipped.value.path()) as archive:
        assert sorted(archive.namelist()) == sorted(expected)
        assert archive.read("direct.c").decode() == expected["direct.c"]
    comes_to(lambda: "under the program" in files.get_by_test_id("program-answer").inner_text(), True)


def test_a_drive_from_its_data_sheet(page: Any) -> None:
    """The sentences of what is missing, then the drive that `DataSheet` makes of the same numbers."""
    page.get_by_role("tab", name="Sheet", exact=True).click()
    before = page.locator(".drive-name").inner_text()
    page.get_by_test_id("sheet-use").click()
    trouble = page.get_by_test_id("sheet-trouble")
    trouble.get_by_text("Rated power is missing").wait_for()
    comes_to(page.locator(".drive-name").inner_text, before)
    assert page.get_by_test_id("sheet-load-reeving").is_hidden()
    for path, text in SHEET.items():
        page.get_by_test_id(f"sheet-{path.replace('.', '-')}").fill(text)
    comes_to(trouble.is_hidden, True)  # what has been filled in is no longer missed
    page.get_by_test_id("sheet-use").click()
    sheet = DataSheet.from_settings(SHEET | {"load.machine": "travel"})
    drive = sheet.drive
    k_dyn(page, f"{simulate(drive, 'direct').k_dyn:.3f}")
    comes_to(page.locator(".drive-name").inner_text, "gantry")
    comes_to(trouble.is_hidden, True)
    name, content = saved(page, "sheet-save")
    assert (name, content.decode()) == ("gantry.toml", sheet.drive_toml())


def test_of_a_drive_without_stiffness_all_columns_are_in_sight(visit: Any) -> None:
    """Those of both ends, and verdicts; the recommendation and the hint of the box to paste are whole."""
    page = visit(width=1280, height=800)
    page.get_by_role("tab", name="Files", exact=True).click()
    given = SHEET | {"load.machine": "travel", "limits.output_torque": "1.6 kN*m"}
    sheet = DataSheet.from_settings({key: given[key] for key in given if key != "gear.stiffness"})
    put(page, "sheet.toml", sheet.to_toml().encode())
    page.locator(".strategies table.ends.held").wait_for()
    at_rest(page)
    whole = "e => [e.scrollWidth - e.clientWidth <= 1, e.scrollHeight - e.clientHeight <= 1]"
    comes_to(lambda: page.locator(".strategies").evaluate(whole)[0], True)
    assert page.locator(".strategies .flag").first.is_visible()
    assert page.get_by_test_id("paste-text").evaluate(whole) == [True, True]
    page.set_viewport_size({"width": 768, "height": 1024})
    comes_to(lambda: page.locator(".advice").evaluate(whole), [True, True])


def test_the_parameter_sheet_is_copied_as_a_text(visit: Any) -> None:
    """For the selected strategy; as a file it is the same text."""
    page = visit(select="s-curve", permissions=["clipboard-read", "clipboard-write"])
    page.get_by_role("tab", name="Files", exact=True).click()
    page.get_by_test_id("parameters-go").click()
    page.get_by_test_id("parameters-copy").click()
    wanted = str(parameter_sheet("crane-4amtkf", "s-curve"))
    comes_to(lambda: page.evaluate("navigator.clipboard.readText()"), wanted)
    name, content = saved(page, "parameters-file")
    assert (name, content.decode()) == ("crane-travel-drive-4amtkf-h-112l6-s-curve-parameters.txt", wanted)


def test_a_chain_file_takes_the_place_of_the_drive(files: Any) -> None:
    """Figures, fields and flanks are those of the chain."""
    chain = Chain.load("crane-4-mass")
    put(files, "mine.toml", chain.to_toml().encode())
    field = files.locator('[data-path="shaft[2].gap"] input[type=text]')
    field.wait_for(timeout=120_000)
    run = simulate(chain, "direct")
    k_dyn(files, f"{run.k_dyn:.3f}")
    at_rest(files)  # the figure comes before the start
    files.locator(".plots canvas").focus()
    for _ in range(60):
        files.keyboard.press("ArrowRight")
    drawn(files)
    when = float(files.locator(".instant").inner_text().removesuffix(" ms")) / 1000.0
    twist = run.at([when])["twist"][0]
    shares = [
        max(-1.0, min(2.0 * angle / gap, 1.0))
        for angle, gap in zip(twist, chain.at_motor_shaft().gap, strict=True)
    ]
    pins = [one["share"] for one in files.evaluate(f"{INSTRUMENT}.scheme.states")]
    assert pins == pytest.approx(shares, abs=0.05)


def test_a_profile_is_pasted_and_the_project_saved_and_loaded_again(files: Any, tmp_path: Path) -> None:
    own = simulate(CRANE, TorqueProfile([0.0, 0.1], [20.0, 62.0]))
    files.get_by_test_id("paste-text").fill("0\t20\n0.1\t62")
    files.get_by_test_id("paste-add").click()
    k_dyn(files, f"{own.k_dyn:.3f}")
    files.get_by_role("tab", name="Explore", exact=True).click()
    field = files.locator('[data-path="strategy.name"] input')
    comes_to(field.input_value, "mine")
    field.fill("by hand")
    field.press("Enter")
    files.locator("tr", has_text="by hand").first.wait_for()
    files.locator(".drive-name").click()
    files.keyboard.press("Control+z")
    comes_to(field.input_value, "mine")
    files.keyboard.press("Control+Shift+z")
    comes_to(field.input_value, "by hand")
    files.get_by_role("tab", name="Files", exact=True).click()
    name, content = saved(files, "project-save")
    (tmp_path / name).write_bytes(content)
    project = Project.open(tmp_path / name)
    assert (project.strategy, project.single()) == ("by hand", CRANE)
    gap = files.locator('[data-path="shaft.gap"] input[type=text]')
    gap.fill("0.75")
    gap.press("Enter")
    put(files, name, content)
    k_dyn(files, f"{own.k_dyn:.3f}")
    comes_to(gap.input_value, "0.5")
    files.locator(".drive-name").click()
    files.keyboard.press("Control+z")
    comes_to(gap.input_value, "0.75")
