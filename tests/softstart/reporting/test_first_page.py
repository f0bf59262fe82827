"""Page 1 and what a report says of itself: verdicts are the margins, names and sources those of the file."""

import base64
import html
import re
from dataclasses import replace

import pytest

from softstart import Drive
from softstart.drive.plausibility import plausibility_warnings
from softstart.errors import InputError
from softstart.project import Project
from softstart.reporting import document, report
from softstart.reporting.document import css_string

from .conftest import Page, verbatim

HOIST = Drive.load("hoist-15kw").replace(permissible_torque=180.0, permissible_start_time=0.25)
ABOUT = """
[project]
customer = "Harbour <Cranes> Ltd"
number = "SC-0147"
checked = "B. Checker, 2026-11-20"
logo = "logo.svg"
paper = "letter"
decimal = "comma"
[[revision]]
number = "A"
change = "first issue"
[[source]]
parameter = "shaft.gap"
origin = "identified"
note = "5.9 to 6.1 deg (95 %)"
[[source]]
parameter = "shaft.damping"
origin = "guessed"
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("project")
    (folder / "logo.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
    (folder / "about.toml").write_text(ABOUT)
    return report(HOIST, controllers=["s-curve"], budget=0.0, project=folder / "about.toml")


@pytest.fixture(scope="module")
def page(made):
    return made.to_html()


def test_verdicts_are_the_margins_of_the_rule(made):
    point = Page(document.document(replace(made, project=made.project.replace(decimal="point"))))
    (table,) = [rows for rows in point.tables if rows[0][-1] == "verdict" and "margin" in rows[0]]
    wanted = [
        ["fail" if margin.share < 0.0 else "pass", row.name, f"{100.0 * margin.share:.1f} %"]
        for row in made.choice.shown
        for margin in row.margins(HOIST.limits)
    ]
    assert [[row[-1], row[0], row[4].replace("\N{MINUS SIGN}", "-")] for row in table[1:]] == wanted
    assert {verdict for verdict, *_ in wanted} == {"pass", "fail"}


GEARED = HOIST.replace(
    name="PAPER crane, FOOTER", gear_ratio=38.0, gap=4.0, assumed="efficiency 0.95; damping ratio 0.02",
    permissible_torque=260.0, starts_per_hour=60, required_life="20000 h", fatigue_slope=5,
    fatigue_torque=40, fatigue_cycles=2e6,
)  # fmt: skip


def test_a_customer_reads_output_torques_years_and_doubts_and_nothing_that_is_for_the_author():
    made = report(GEARED, controllers=["ramp", "shaped"], budget=0.0)
    page = made.to_html()
    read = Page(page)
    text = read.text.partition(" as a file for softstart")[0]
    for name, shown in read.rows("at the output, N m").items():
        peak = made.row(name).run.peak_torque
        assert float(shown["at the output, N m"]) == pytest.approx(38.0 * peak, rel=1e-3)
    data = read.rows("at the output shaft")
    there = {name: row["at the output shaft"] for name, row in data.items()}
    assert there["inertia of the load at the motor shaft"] == "93.86 kg m²"  # 38² J2
    assert there["total angular gap"] == "0.105263 rad"  # 4 rad at the motor
    assert data["time of operation that the shaft line must last"]["value"] == "2.28"  # years of 8766 h
    assert plausibility_warnings(GEARED)
    for sentence in (*plausibility_warnings(GEARED), "efficiency 0.95", "damping ratio 0.02"):
        assert sentence in text
    assert re.findall(r"--\w+|\[limits|[Gg]ive |softstart (?:compare|pareto|serve|optimize)", text) == []
    assert "times what is permitted" in text
    assert re.findall(r"e\+\d+ %|\d{3,}\.\d % over", text) == []  # of a limit that is exceeded a hundredfold
    assert not [row for one in read.tables for row in one[1:] if set(row[1:]) <= {"\N{EN DASH}", ""}]
    (style,) = re.findall(r"<style>(.*?)</style>", page, re.DOTALL)
    assert "@page { size: A4;" in style
    assert f"@top-left {{ content: {css_string(GEARED.name)};" in style


def test_names_logo_revisions_and_sources_are_in_the_page(made, page):
    assert "Harbour &lt;Cranes&gt; Ltd" in page
    logo = base64.b64encode(b"<svg xmlns='http://www.w3.org/2000/svg'/>").decode()
    assert f'src="data:image/svg+xml;base64,{logo}"' in page
    assert "default-src 'none'; style-src 'unsafe-inline'; img-src data:" in page
    assert "size: letter;" in page
    text = Page(page).text
    for words in ("first issue", "B. Checker, 2026-11-20", "identified, 5,9 to 6,1 deg", "shaft.damping"):
        assert words in text
    assert made.project.source_of("shaft.gap").startswith("identified")


def test_decimal_commas_stand_in_text_and_figures_and_in_no_command(made, page):
    read = Page(page)
    shown = re.sub(r"<(pre|code|style|title)\b.*?</\1>|<[^>]*>", " ", page, flags=re.DOTALL)
    assert re.findall(r"(?<![\w.])\d+\.\d+(?![\w.])", shown) == []
    assert re.search(r"<text[^>]*>0,\d+</text>", page)
    assert "04.005 Motoring Current Limit" in read.text
    assert Drive.from_toml(made.provenance["drive"]) == made.drive
    (file,) = verbatim(page)
    assert Drive.from_toml(html.unescape(file)) == made.drive


def test_what_is_wrong_in_a_project_is_one_clear_sentence():
    for text, says in (
        ('[project]\ncustmer = "x"', "did you mean customer?"),
        ('[project]\npaper = "A3"', "A3"),
        ('[[source]]\nparameter = "shaft.gapp"', "did you mean shaft.gap?"),
        ('[project]\nlogo = "nowhere.png"', "no such file"),
        ('[project]\nlogo = "logo.exe"', "give a PNG, JPEG or SVG file"),
        ('[project]\ncustomer = "a\\nb"', "line"),
    ):
        with pytest.raises(InputError) as refused:
            Project.read(text, "about.toml")
        (sentence,) = refused.value.sentences
        assert says.lower() in sentence.lower()
        assert sentence.startswith("about.toml: ")
