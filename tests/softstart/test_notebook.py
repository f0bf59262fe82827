"""What a notebook shows of a result: well-formed, complete, and never a script."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from typing import Any

import pytest

from softstart import Chain, Drive, compare, fatigue, optimize, simulate

CRANE = Drive.load("crane-4amtkf").replace(name="<script>alert(1)</script> & co")
DAMPED = CRANE.replace(damping=1.0)

MADE: dict[str, Callable[[], Any]] = {
    "run": lambda: simulate(DAMPED, "ramp"),
    "chain": lambda: simulate(Chain.load("crane-4-mass"), "ramp"),
    "comparison": lambda: compare(DAMPED, ["direct", "ramp", "shaped"]),
    "optimum": lambda: optimize(CRANE, 0.45),
    "fatigue": lambda: fatigue([simulate(DAMPED, "direct"), simulate(DAMPED, "ramp")]),
}


@pytest.mark.parametrize("name", MADE)
def test_a_cell_is_well_formed_and_shows_the_figures(name):
    text = MADE[name]()._repr_html_()
    assert "<script" not in text
    assert text.count("<svg") == 1
    page = ET.fromstring(f"<div>{text.replace('<br>', '<br/>')}</div>")
    cells = ["".join(cell.itertext()) for cell in page.iter("td")]
    assert len(cells) >= 6
    if name != "chain":
        assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; co" in text
    if name in ("run", "comparison"):
        assert any(cell.startswith(f"{simulate(DAMPED, 'ramp').k_dyn:.3f}") for cell in cells)
