"""The report as a PDF: A4, and no page half empty."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.page.conftest import SOFTSTART

from softstart import DataSheet, Drive, Duty, Report, report
from softstart.reporting.printing import browser_that_prints, printed
from softstart.views.numbers import seen_at

FILLED = 0.8  # of the height between the margins, of each page but the last: no block is higher than a fifth
THREE = ["direct", "ramp", "s-curve"]
TRAVEL = {
    "motor.rated_power": "3 kW", "motor.rated_speed": "1430 rpm", "motor.inertia": "0.0119 kg*m^2",
    "motor.starting_ratio": "2.2", "gear.ratio": "31.5", "gear.efficiency": "0.94",
    "gear.stiffness": "25 N*m/arcmin", "gear.backlash": "15 arcmin", "load.machine": "travel",
    "load.mass": "12 t", "load.diameter": "315 mm", "limits.output_torque": "1.6 kN*m", "name": "Trolley",
}  # fmt: skip


def travel() -> Any:
    return DataSheet.from_settings(TRAVEL).drive


def of_travel(**more: Any) -> Report:
    return report(travel(), budget=0.0, **more)


REPORTS = {
    "limits": lambda: of_travel(controllers=THREE),
    "limits, all strategies": of_travel,
    "at the output": lambda: report(seen_at(travel(), "output"), budget=0.0),
    "side by side": lambda: of_travel(beside=travel().replace(gap="15 deg", name="worn")),
    "no limits": lambda: report("crane-4amtkf", budget=0.0),
    "duty": lambda: report(
        Drive.load("conveyor-11kw").replace(permissible_torque=150.0, duty=Duty.load("conveyor")), budget=0.0
    ),
    "chain": lambda: report("crane-4-mass", controllers=[*THREE, "take-up"], budget=0.0),
}


def pages_of(pdf: Path | bytes) -> Any:
    pdfium = pytest.importorskip("pypdfium2", reason="pypdfium2 is missing: make page")
    return pdfium.PdfDocument(pdf)


def filled(page: Any) -> float:
    """How far down the last ink is, from the top margin to the bottom one."""
    ink = np.asarray(page.render(scale=1.0).to_pil().convert("L")) < 200
    millimetre = len(ink) / 297.0
    content = ink[round(16 * millimetre) : round((297 - 15) * millimetre)]  # without header and footer
    return float((np.flatnonzero(content.any(axis=1))[-1] + 1) / len(content))


@pytest.mark.parametrize(
    "which", [one if one == "limits" else pytest.param(one, marks=pytest.mark.slow) for one in REPORTS]
)
def test_no_page_is_half_empty(browser: Any, which: str) -> None:
    pages = pages_of(printed(REPORTS[which]().to_html(), browser_that_prints()))
    shares = [filled(page) for page in pages]
    assert len(shares) >= 5
    assert min(shares[:-1]) > FILLED, [f"{share:.2f}" for share in shares]


def test_a_report_is_printed_to_a4(browser: Any, tmp_path: Path) -> None:
    words = ("report", "--controllers", "direct,ramp", "--budget", "0", "--pdf", str(tmp_path / "r.pdf"))
    subprocess.run([SOFTSTART, *words], check=True, capture_output=True, cwd=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["r.pdf"]
    pages = pages_of(tmp_path / "r.pdf")
    assert 4 <= len(pages) <= 10
    for page in pages:  # in points
        assert page.get_size() == pytest.approx((595.3, 841.9), abs=1.0)
