"""The report of a chain: its figures are those of the starts, and nothing else gets in."""

from __future__ import annotations

import re

import pytest

from softstart import Chain, InputError, fatigue, simulate
from softstart.project import Project
from softstart.reporting import Report, report
from softstart.reporting.limit import bound_at

from .conftest import Page

CHAIN = Chain.load("crane-4-mass")


@pytest.fixture(scope="module")
def made() -> Report:
    return report(CHAIN, controllers=["ramp", "take-up"], budget=0.0)


def test_the_figures_are_those_of_the_starts_on_the_chain(made):
    page = made.to_html()
    text = Page(page).text
    ramp, gentle, direct = (simulate(CHAIN, name) for name in ("ramp", "take-up", "direct"))
    assert made.choice.chosen.name == "take-up"
    assert f"{gentle.peak_torque:.2f} N m instead of {direct.peak_torque:.1f} N m" in text
    assert f"settled after {gentle.settled_time:.4f} s instead of {direct.settled_time:.4f} s" in text
    for run in (ramp, gentle, direct):
        row = re.findall(rf'<tr[^>]*><th scope="row"[^>]*>{run.controller_name}</th>(.*?)</tr>', page)
        assert len(row) == 6  # page 1, the rule, the strategies, at equal time, shafts, beside the bound
        assert all(f">{run.k_dyn:.3f}<" in row[k] for k in (0, 2))
        assert re.findall(r">([\d.]+)<", row[4]) == [f"{k:.3f}" for k in run.shaft_factors]
    for name in CHAIN.shaft_names:
        assert name in page
    assert f"rise = {gentle.controller.rise:.6g} s" in text  # the parameters of each run
    assert page.count("<figure>") == 6


def test_no_start_is_below_the_bound_and_the_sheet_is_started_on_the_chain(made):
    """Rounded values give the figures of `simulate`."""
    gentle = simulate(CHAIN, "take-up")
    assert bound_at(CHAIN, gentle.start_time) < gentle.k_dyn
    sheet, ordinary = made.sheets
    assert (sheet.name, ordinary.name) == ("take-up", "ramp")
    values = {one.name: one.rounded for one in sheet.settings}
    again = simulate(CHAIN, "take-up", parameters=values)
    assert sheet.rounded.k_dyn == pytest.approx(again.k_dyn, rel=1e-12)
    assert sheet.worst_k_dyn >= sheet.rounded.k_dyn
    assert sheet.variants == 2 * len(sheet.varied) + 2


def test_lives_of_shafts_are_those_of_fatigue_and_sources_of_a_drive_are_refused(made):
    page = Page(made.to_html()).text
    assert "Lives cannot be given: damping is missing in rotor - pinion" in page
    about = Project.read('[[source]]\nparameter = "shaft.gap"\norigin = "guessed"')
    with pytest.raises(InputError, match=r'"shaft\.gap" is a parameter of a drive'):
        report(CHAIN, controllers=["ramp"], project=about)
    damped = Chain.load("crane-4-mass", also={f"shaft[{k}].damping_ratio": "0.02" for k in (1, 2, 3)})
    of_damped = report(damped, controllers=["take-up"], budget=0.0)
    page = of_damped.to_html()
    found = fatigue([simulate(damped, name) for name in ("take-up", "direct")])
    last = re.findall(r">take-up</th>(.*?)</tr>", page)[-1]
    relative = [float(cell) for cell in re.findall(r">([\d.]+)<", last)]
    assert relative == pytest.approx([life.relative for life in found.by_run[0]], rel=5e-3)
    assert "Longest life: take-up" in page
    # the shaft line lasts as long as the shaft that gains least
    assert of_damped.life_gain == pytest.approx(min(life.relative for life in found.by_run[0]), rel=1e-9)
    assert of_damped.life_gain < 0.95 * max(life.relative for life in found.by_run[0])
