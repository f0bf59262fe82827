"""What a notebook shows of a result: well-formed, complete, and never a script."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from typing import Any

import pytest

import softstart
from softstart import Chain, Drive, compare, fatigue, optimize, pareto, simulate

CRANE = Drive.load("crane-4amtkf")
DAMPED = CRANE.replace(damping=1.0, name="<script>alert(1)</script> & co")
QUICK: Any = {"certified": False, "generations": 2, "population": 6, "restarts": 1, "workers": 1}


def optimum() -> Any:
    """One in closed form."""
    return optimize(DAMPED.replace(damping=0.0), 0.45)


MADE: dict[str, tuple[Callable[[], Any], bool]] = {
    "run": (lambda: simulate(DAMPED, "ramp"), True),
    "chain": (lambda: simulate(Chain.load("crane-4-mass"), "ramp"), True),
    "comparison": (lambda: compare(DAMPED, ["direct", "ramp", "shaped"]), True),
    "optimum": (optimum, True),
    "front": (lambda: pareto(DAMPED.replace(damping=0.0), [0.45, 0.5], controllers=["direct"]), True),
    "fatigue": (lambda: fatigue([simulate(DAMPED, "direct"), simulate(DAMPED, "ramp")]), True),
    "linear": (lambda: softstart.linear_view(DAMPED, "current-limit-feedback"), True),
    "plan": (lambda: softstart.plan_experiments(DAMPED, optimise=False), True),
    "tuning": (lambda: softstart.tune(DAMPED, "ramp", ["1x"], ["1x"], free=["time"], **QUICK), True),
}


@pytest.mark.parametrize("name", MADE)
def test_a_cell_is_well_formed_and_shows_the_figures(name):
    make, drawn = MADE[name]
    text = make()._repr_html_()
    assert "<script" not in text
    assert text.count("<svg") == drawn
    page = ET.fromstring(f"<div>{text.replace('<br>', '<br/>')}</div>")
    cells = ["".join(cell.itertext()) for cell in page.iter("td")]
    assert len(cells) >= 6
    if name != "chain":
        assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; co" in text
    if name == "run":
        assert f"{simulate(DAMPED, 'ramp').k_dyn:.6f}" in cells
    if name == "comparison":
        first = [cell for cell in cells if re.fullmatch("[a-z-]+", cell)]
        assert first[0] == "shaped"  # the gentlest
        assert f"{simulate(DAMPED, 'shaped').k_dyn:.3f}" in cells
