"""The sheet of speed-ramp: its values in the units of inverters."""

from __future__ import annotations

import pytest
from tests.softstart.reporting.conftest import Page

from softstart import Drive, report, simulate
from softstart.controller import make_controller
from softstart.reporting import Resolution
from softstart.reporting.inverters import at_inverters, inverters, speed_values
from softstart.reporting.sheet import make_sheet
from softstart.start.resolution import gain_base

CRANE = Drive.load("crane-4amtkf")


def test_a_per_cent_of_speed_error_gives_the_torque_that_the_sheet_says():
    """kp in N m s/rad times 1 % of the rated speed is kp_percent per cent of the rated torque."""
    values = make_controller("speed-ramp", {"rounding": 0.25}).fitted(CRANE).parameters
    shown = speed_values(values, CRANE)
    torque = values["kp"] * 0.01 * float(CRANE.rated_speed)
    rated = 2200.0 / float(CRANE.rated_speed)
    assert float(shown["kp_percent"]) == pytest.approx(100.0 * torque / rated, rel=1e-3)
    assert float(shown["kp"]) == pytest.approx(values["kp"], rel=1e-3)
    assert float(shown["tn_ms"]) == pytest.approx(1e3 * values["tn"], rel=1e-3)
    assert float(shown["rounding_s"]) == pytest.approx(0.25 * values["ramp_time"], rel=1e-3)
    assert float(shown["limit_percent"]) == pytest.approx(100.0 * 62.0 / rated, rel=1e-3)
    assert float(shown["rate"]) == pytest.approx(880.0 / values["ramp_time"], rel=1e-3)
    assert gain_base(CRANE.replace(rated_power=None, rated_speed=None))[1] == "target speed"


def test_every_text_of_a_family_is_filled_in():
    values = make_controller("speed-ramp", {}).fitted(CRANE).parameters
    found = dict(at_inverters(values, CRANE))
    assert len(found) == sum("speed" in family for family in inverters()["family"]) == 3
    assert all("{" not in text for text in found.values())
    abb = next(text for name, text in found.items() if name.startswith("ABB ACS880"))
    assert abb.startswith(f"25.02 Speed proportional gain {speed_values(values, CRANE)['kp_percent']},")


def test_kp_is_rounded_in_per_cent_per_per_cent_and_started_again():
    controller = make_controller("speed-ramp", {})
    sheet = make_sheet(CRANE, controller, simulate(CRANE, controller), Resolution.read("share=5%"))
    kp = next(one for one in sheet.settings if one.name == "kp")
    base = gain_base(CRANE)[0]
    assert kp.rounded / (0.05 * base) == pytest.approx(round(kp.rounded / (0.05 * base)), abs=1e-9)
    assert kp.shown(CRANE)[1:3] == ("% of torque per % of speed", "5.220 N m s/rad")
    again = simulate(CRANE, "speed-ramp", parameters=sheet.values)
    assert sheet.rounded.settled_time == again.settled_time
    assert sheet.loop.startswith("Speed loop with the gap closed: phase margin ")
    assert again.settled_time <= sheet.slowest < 1.1 * again.settled_time
    assert {"preload", "filter_time"}.isdisjoint(one.name for one in sheet.varied)  # what is off stays off


@pytest.mark.slow
def test_a_report_has_the_sheet_with_settled_times():
    made = report(CRANE, controllers=["direct", "ramp", "speed-ramp", "shaped"], budget=0.0)
    assert [sheet.name for sheet in made.sheets] == ["shaped", "ramp", "speed-ramp"]
    text = Page(made.to_html()).text
    assert "speed-ramp at inverters" in text
    assert "Kp in per cent of torque per per cent of speed" in text
    assert "settled time, s" in text
    assert "speed-ramp (an inverter with closed-loop speed control)" in text
