"""Tables and templates of the report with every optional value absent, and every list present."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from markupsafe import Markup
from tests.softstart.variants import TOGETHER, machines, variants

from softstart import Drive, report
from softstart.chain import Chain
from softstart.reporting import Report
from softstart.reporting import document as documents
from softstart.reporting.document import data_of, of_part
from softstart.views.drives import drive_lines

from .conftest import Page

MACHINES = {one.name: one for one in machines()}
QUICK = ("Crane travel drive 4AMTKF(H)112L6", "unnamed chain")
FAN = MACHINES["unnamed chain"]
SLOW = pytest.mark.slow


@pytest.fixture(scope="module")
def made() -> Report:
    return report("crane-4amtkf", controllers=["direct"], budget=0.0)


@pytest.mark.parametrize("name", [one if one in QUICK else pytest.param(one, marks=SLOW) for one in MACHINES])
def test_every_value_stands_in_the_table_of_data(made: Report, name: str) -> None:
    """As many numbers as the value has, in the unit of the machine, beside the same ones in another unit."""
    lists = 0
    for what, machine in [("as it is", MACHINES[name]), *variants(MACHINES[name])]:
        heads, rows, absent = data_of(replace(made, drive=machine))
        cells: dict[str, list[str]] = {row[0]: row for row in rows}
        assert len(cells) == len(rows), what  # each is said of its own part
        for path, (parameter, value) in machine.parameters_by_path().items():
            if isinstance(value, tuple):
                lists += 1
                meaning = of_part(machine, path, parameter)
                number, other = cells[meaning][2], cells[meaning][4]
                assert len(number.split(", ")) == len(value), what
                assert not other or len(other.split(", ")) == len(value), what
        assert all(len(row) == len(heads.split("|")) for row in rows), what
        assert all("None" not in cell and "(" not in cell for row in rows for cell in row[2:]), what
        assert not any("REQUIRED" in one for one in absent), what
        assert drive_lines(machine)[0] == machine.name, what
    assert lists


def test_a_list_is_shown_in_both_units(made: Report) -> None:
    """Numbers by hand: 50 rad/s are 477.465 rpm, 1.5 rad are 85.9437 degrees."""
    points = {"fatigue_torque": [200, 90], "fatigue_cycles": [1e5, 2e6]}
    crane = Drive.load("crane-4amtkf").replace(**points)
    (row,) = [one for one in data_of(replace(made, drive=crane))[1] if one[2] == "200, 90"]
    assert row[3] == "N m"
    curves = dict(variants(FAN))
    for case, meaning, shown in (
        (0, "fan: rising speeds", ["0, 50, 100", "rad/s", "0, 477.465, 954.93 rpm"]),
        (1, "fan: rising angles", ["0, 85.9437, 171.887", "deg", "0, 1.500, 3.000 rad"]),
    ):
        rows = data_of(replace(made, drive=curves[str(TOGETHER["chain"][case])]))[1]
        assert [row[2:5] for row in rows if row[0].startswith(meaning)] == [shown]


@pytest.mark.slow
@pytest.mark.parametrize("kind", TOGETHER)
def test_every_template_is_rendered(made: Report, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole page, whose figures are those of other tests."""
    monkeypatch.setattr(documents, "svg_of", lambda figure, key, title: Markup())
    base = MACHINES[QUICK[0]] if kind == "drive" else FAN
    some = made if kind == "drive" else report(FAN, controllers=["direct"], budget=0.0)
    for what, machine in [*variants(base)][: len(TOGETHER[kind])]:
        page = Page(replace(some, drive=machine).to_html())
        assert "None" not in page.text.replace("None is recommended", ""), what


@pytest.mark.slow
@pytest.mark.parametrize("case", range(2))
def test_a_load_curve_is_reported(case: int, tmp_path: Path) -> None:
    """The report of a fan is written, says that the load torque follows a curve, and plots the start."""
    fan: Any = dict(variants(FAN))[str(TOGETHER["chain"][case])]
    assert isinstance(fan, Chain)
    report(fan, controllers=["direct"], budget=0.0).save(tmp_path / "r.html")
    page = Page((tmp_path / "r.html").read_text("utf-8"))
    assert f"load curve of fan over its {'angle' if case else 'speed'}, 3 points" in page.text
    assert "its torque and inertia are constant during the start" not in page.text
