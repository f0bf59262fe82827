"""A gearbox catalogue on every surface: what a newcomer types of a trolley, and what comes of it."""

from __future__ import annotations

import io
import math
import re
import sys

import pytest
from tests.oracle import integrate

from softstart import DataSheet, Drive, compare
from softstart.cli.sweep import read_axes
from softstart.cli.tune import read_axis
from softstart.controller.recipe import Recipe
from softstart.tuning.problem import gaps_of

# 3 kW, 1410 rpm, 38.1:1, 6.5 t on wheels of 315 mm; gearbox at its output: 9 arcmin, 35 kN m/rad, 1.6 kN m
SHEET = {
    "load.machine": "travel", "motor.rated_power": "3 kW", "motor.rated_speed": "1410 rpm",
    "motor.inertia": "0.0083 kg*m^2", "gear.ratio": "38.1:1",
    "gear.stiffness": "35 kN*m/rad", "gear.backlash": "9 arcmin", "load.mass": "6.5 t",
    "load.diameter": "315 mm", "limits.output_torque": "1.6 kN*m",
}  # fmt: skip
TYPED = [
    "", "", "trolley", "3", "1410", "0.0083", "", "", "", "", "", "", "", "", "38.1:1", "",
    "35 kN*m/rad", "9", "", "", "6.5 t", "315", "", "", "", "", "", "", "", "", "1.6 kN*m", "",
]  # fmt: skip
FORM = {path: str(text).split(" rpm")[0] for path, text in SHEET.items()}
RATIO, ETA = 38.1, 0.95  # the efficiency is assumed
THERE = {
    "stiffness": 35000.0, "gap": math.radians(9 / 60), "load_inertia": 6500 * 0.1575**2,
    "load_torque": 0.008 * 6500 * 9.80665 * 0.1575, "permissible_output_torque": 1600.0,
}  # fmt: skip
AT_MOTOR = {  # by hand
    "stiffness": 35000.0 / (RATIO**2 * ETA), "gap": math.radians(9 / 60) * RATIO,
    "load_inertia": THERE["load_inertia"] / (RATIO**2 * ETA),
    "load_torque": THERE["load_torque"] / (RATIO * ETA),
    "motor_inertia": 0.0083, "target_speed": 1410 * math.pi / 30, "gear_ratio": RATIO, "gear_efficiency": ETA,
}  # fmt: skip


def form(values: dict[str, str]) -> DataSheet:
    """The sheet of the page with this typed into its fields."""
    pytest.importorskip("nicegui")
    from nicegui import Client
    from nicegui.page import page

    from softstart.page.data_sheet_panel import DataSheetPanel
    from softstart.page.session import Session

    with Client(page("/never-opened")) as client:
        panel = DataSheetPanel(Session(controllers=["direct"]), "A")
        for name, field in panel._fields.items():
            field.value = values.get(DataSheet.PARAMETERS[name].path, "")
        found = panel.sheet()
        client.delete()
    assert found is not None
    return found


def test_a_newcomer_gets_the_same_drive_by_prompt_file_page_and_python(run, place, monkeypatch):
    """Each value at either shaft is that of the sheet, by hand; of the computed ones files have 5 digits."""
    monkeypatch.setattr(sys, "stdin", io.StringIO("".join(f"{line}\n" for line in TYPED)))
    assert run("init", "--ask", "--out", "asked.toml").code == 0
    python = DataSheet.from_settings(SHEET)
    (place / "sheet.toml").write_text(python.to_toml())
    assert run("init", "sheet.toml", "--out", "file.toml").code == 0
    page = form(FORM)
    (place / "page.toml").write_text(page.drive_toml())
    drives = {name: Drive.load(f"{name}.toml") for name in ("asked", "file", "page", "sheet")}
    assert drives["asked"] == drives["file"] == drives["page"]
    assert drives["sheet"] == python.drive == page.drive
    for drive in (*drives.values(), python.drive):
        assert {name: getattr(drive, name) for name in AT_MOTOR} == pytest.approx(AT_MOTOR, rel=1e-12)
        assert {name: drive.at_output[name] for name in THERE} == pytest.approx(THERE, rel=1e-12)
        assert drive.Ms == pytest.approx(1.5 * 3000 / (1410 * math.pi / 30), rel=5e-5)
        assert drive.limits.shaft_torque == pytest.approx(1600 / (RATIO * ETA), rel=1e-15)
    text = (place / "asked.toml").read_text()
    assert 'stiffness = "35000 N*m/rad at output"' in text
    assert 'gap = "9 arcmin at output"' in text


def test_the_recommendation_to_a_newcomer_is_safe_at_the_output():
    """Direct start is not. The peak of the ramp, also with a worn gap, by another integrator, times i eta.

    1e-3, since the ramp of the controller is set once a millisecond.
    """
    drive = DataSheet.from_settings(SHEET).drive
    found = compare(drive, ["direct", "ramp"])
    direct, ramp = (next(row for row in found.rows if row.name == name) for name in ("direct", "ramp"))
    assert found.recommendation.recommended is ramp
    assert (there := direct.run.peak_torque_at_output) > 1600.0
    assert there == pytest.approx(direct.run.peak_torque * RATIO * ETA, rel=1e-14)
    set_to = ramp.run.controller.parameters
    low, full, time = (float(set_to[name]) for name in ("initial", "full_torque", "time"))

    def peak(gap: float) -> float:
        """From the worst of three positions."""
        return max(
            integrate(
                J1=drive.J1, J2=drive.J2, c=drive.c, d=drive.d, gap=gap, Mc=drive.Mc, kind="reactive",
                law="no-pull", theta0=where * gap, w1_0=0.0, w2_0=0.0, lag=0.0, rate=math.inf, u0=0.0,
                torque_pieces=[(0.0, low, (full - low) / time), (time, full)], t_end=0.8, rtol=1e-9,
            ).peak
            for where in (-0.5, 0.0, 0.5)
        )  # fmt: skip

    assert ramp.run.peak_torque == pytest.approx(peak(drive.gap), rel=1e-3)
    (margin,) = ramp.margins(drive.limits)
    assert (margin.name, margin.limit, margin.case, margin.kept) == ("output torque", 1600.0, "gap x4", True)
    assert margin.value == pytest.approx(RATIO * ETA * peak(4.0 * drive.gap), rel=1e-3)
    assert margin.share == pytest.approx(1.0 - margin.value / 1600.0, rel=1e-12)


def test_grids_and_axes_are_taken_at_the_output():
    drive = DataSheet.from_settings(SHEET).drive
    gaps = read_axis("4.5 arcmin at output, 1x, 18 arcmin at the output shaft", "--gaps", "rad")
    assert gaps_of(drive, gaps) == pytest.approx([drive.gap * one for one in (0.5, 1, 2)], rel=1e-11)
    gaps = read_axis("4.5 arcmin at output:18 arcmin at output:4", "--gaps", "rad")
    assert gaps_of(drive, gaps) == pytest.approx([drive.gap * one for one in (0.5, 1, 1.5, 2)], rel=1e-11)
    for text in ("4.5 arcmin at output, 1x", "4.5 arcmin at output:9 arcmin at output:2"):
        axis = read_axes([f"shaft.gap={text}"], Recipe("direct"), drive)["gap"]
        assert axis == pytest.approx([drive.gap / 2, drive.gap], rel=1e-11)


def test_a_setting_is_told_at_both_shafts(as_json):
    settings = "--set", "gear.ratio=38.1", "--set", "gear.efficiency=95 %"
    there = "--set", "shaft.gap=9 arcmin at output", "--set", "limits.shaft_torque=5 kN*m at output"
    told = as_json("simulate", "crane-4amtkf", "--controller", "direct", *settings, *there)
    assert told["at_output"]["gap"] == pytest.approx(math.radians(9 / 60), rel=1e-15)
    assert told["at_output"]["permissible_torque"] == pytest.approx(5000.0, rel=1e-15)
    assert told["peak_torque_at_output"] == pytest.approx(38.1 * 0.95 * told["peak_torque"], rel=1e-14)
    table = as_json("compare", "crane-4amtkf", "--controllers", "direct", *settings, *there)
    (limit,) = table["strategies"][0]["limits"]
    assert limit["permitted"] == pytest.approx(5000 / (38.1 * 0.95), rel=1e-15)


def test_another_ratio_is_as_if_it_stood_in_the_file(place, as_json):
    text = Drive.load("crane-4amtkf").replace(gear_ratio=38.1, target_speed=60.0).to_toml()
    text = re.sub("(?m)^gap = .*", 'gap = "45 arcmin at output"', text)
    text = re.sub("(?m)^stiffness = .*", 'stiffness = "500 kN*m/rad at output"', text)
    (place / "old.toml").write_text(text)
    (place / "new.toml").write_text(text.replace("ratio = 38.1", "ratio = 20"))
    for words in (["simulate", "--controller", "ramp"], ["compare", "--controllers", "ramp"]):
        command, *more = words
        new = as_json(command, "new.toml", *more)
        assert as_json(command, "old.toml", *more, "--set", "gear.ratio=20") == new
        assert as_json(command, "old.toml", *more) != new


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (["simulate", "crane-4amtkf", "--controller", "direct", "--set", "shaft.gap=9 arcmin at output"],
         'shaft.gap = "9 arcmin at output": without gear.ratio nothing is "at output"; give it'),
        (["simulate", "crane-4-mass", "--controller", "direct", "--set", "shaft[2].gap=9 arcmin at output"],
         'side = "before" or "after"'),
        (["simulate", "crane-4-mass", "--controller", "direct", "--set", "limits.output_torque=1600"],
         "shaft[N].permissible_torque"),
        (["simulate", "crane-4amtkf", "--controller", "direct", "--set", "limits.output_torque=1600"],
         "limits.output_torque = 1600.0: without gear.ratio there is no output"),
        (["tune", "--controller", "ramp", "--set", "gear.ratio=38", "--gaps", "9 arcmin, 9 arcmin at output"],
         "behind some of the values only"),
        (["tune", "crane-4-mass", "--controller", "ramp", "--gaps", "9 arcmin at output"],
         "the gears of a chain are in its shafts"),
        (["simulate", "crane-4amtkf", "--controller", "ramp", "--param", "time=1 s at output"],
         'does not take "at output"'),
        (["simulate", "crane-4amtkf", "--controller", "ramp", "--until", "1 s at output"],
         '"at output" does not apply here'),
    ],
)  # fmt: skip
def test_what_has_no_output_is_refused(refused, line, says):
    assert says in " ".join(refused(*line).split())
