"""Sweeps, loops, plans and wear at the output: what is shown is that of the motor shaft through the gear.

A gear changes no start: one result is seen through 50 random gears.
"""

from dataclasses import replace
from datetime import date
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.softstart.test_output_view import agrees, check, columns, gears, there

from softstart import Drive, linear_view, simulate, sweep
from softstart.cli.main import main
from softstart.identification.result import Estimate
from softstart.identification.wear import Line
from softstart.input.gear import Gear
from softstart.start.recommendation import margins_of
from softstart.sweeping.summary import summarise
from softstart.views.identification import wear_conclusion, wear_notes, wear_table
from softstart.views.linear import linear_notes, tables
from softstart.views.numbers import units_of
from softstart.views.sweeps import TWO_WAYS, as_seen, start_table, sweep_sheet

CRANE = Drive.load("crane-4amtkf").replace(start_position="mid-gap")
AXES = {"gap": [0.25, 0.5], "load_inertia": [0.1, 0.175], "load_torque": [3.0, 7.16], "rated_speed": [90.0]}


@cache
def grid() -> Any:
    """Starts over gap, inertia, load torque and a speed of the motor."""
    return sweep(CRANE, "direct", AXES, figures=["k_dyn", "peak_torque", "impact_speed"], workers=1)


def behind(gear: Gear, units: str) -> Drive:
    return CRANE.replace(gear_ratio=gear.ratio, gear_efficiency=gear.efficiency, units=f"{units}, at output")


@pytest.mark.parametrize(("gear", "units"), gears())
def test_a_grid_is_that_of_the_file_through_the_gear(gear: Gear, units: str) -> None:
    """Axes, figures, spreads and the worst place; K_dyn is the same, and so is the file."""
    results, drive = grid(), behind(gear, units)
    before = results.to_dataframe().to_csv()
    seen, frame = as_seen(results, drive), results["k_dyn"].to_dataframe().reset_index()
    table = start_table(seen)
    for name, heading in (("gap", "gap"), ("load_inertia", "load inertia"), ("load_torque", "load torque"),
                          ("rated_speed", "rated speed")):  # fmt: skip
        check(table, heading, gear, frame[name].tolist())
    for name in ("peak_torque", "impact_speed"):
        check(table, name.replace("_", " "), gear, results[name].values.ravel().tolist())
    for cell, value in zip(columns(table)["K_dyn"][1], results["k_dyn"].values.ravel(), strict=True):
        assert agrees(cell, value)
    sheet = sweep_sheet(results, summary := summarise(results), drive)
    spread = next(row for row in sheet.tables[1].rows if row[0] == "peak_torque")
    for cell, end in zip(spread[2:], ("min", "q05", "q50", "q95", "max"), strict=True):
        assert agrees(cell, there(gear, spread[1], summary.spreads["peak_torque"][end]))
    (gap, unit), *_ = ((float(row[3]), row[4]) for row in sheet.tables[0].rows if row[0] == "gap")
    assert gap == pytest.approx(there(gear, unit, 0.5), rel=5.1e-6)
    assert f"gap {there(gear, unit, 0.5):.5g}" in sheet.conclusions[0]
    assert ", at the output. All starts" in sheet.conclusions[0]
    assert results.to_dataframe().to_csv() == before


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_torques_of_a_grid_go_as_its_loads_where_all_go_one_way(first: float, second: float) -> None:
    """By i eta, by i/eta where all loads drive; where some do and others not, there is no one factor."""
    results = grid().isel(load_torque=[0, 1]).assign_coords(load_torque=[first, second])
    results["load_torque"].attrs["units"] = "N*m"
    seen = as_seen(results, behind(Gear(40.0, 0.8), "rad"))
    if (first < 0.0) != (second < 0.0):
        assert seen["peak_torque"].attrs.get("seen", 1.0) == 1.0
        assert seen.attrs["at"] == ""
    else:
        assert seen["peak_torque"].attrs["seen"] == pytest.approx(50.0 if first < 0.0 else 32.0, rel=1e-14)


def test_where_some_loads_drive_everything_is_at_the_motor_shaft() -> None:
    drive = behind(Gear(40.0, 0.8), "arcmin, rpm")
    results = sweep(drive, "direct", {"load_torque": [-2.0, 4.0]}, figures=["peak_torque"], workers=1)
    sheet = sweep_sheet(results, summarise(results), drive)
    assert TWO_WAYS in sheet.notes
    assert "at the output" not in " ".join(table.title for table in sheet.tables)
    for cell, value in zip(
        columns(sheet.tables[-1])["peak torque"][1], results["peak_torque"].values, strict=True
    ):
        assert agrees(cell, value)


def test_in_a_grid_each_load_is_judged_by_its_own_way_through_the_gear() -> None:
    """Margins of a limit at the output, one load driven and one that drives, are those of single starts."""
    drive = behind(Gear(40.0, 0.8), "rad").replace(permissible_output_torque=5000.0)
    loads = [-2.0, 4.0]
    results = sweep(drive, "direct", {"load_torque": loads}, figures=["peak_torque", "margin"], workers=1)
    for load, factor, margin in zip(loads, (50.0, 32.0), results["margin"].values, strict=True):
        run = simulate(drive.replace(load_torque=load), "direct")
        (one,) = margins_of(run)
        assert one.share == pytest.approx(margin, rel=1e-9)
        assert one.value == pytest.approx(factor * run.peak_torque, rel=1e-12)


@cache
def loop() -> Any:
    """A loop with a limit cycle through the gap."""
    return linear_view(CRANE.replace(damping=0.3), "state-feedback")


@pytest.mark.slow
def test_limit_cycles_are_seen_through_the_gear() -> None:
    """Twists and torques are; frequencies and margins are the same at both shafts."""
    for gear, units in gears()[:12]:
        cycle_through(gear, units)


def cycle_through(gear: Gear, units: str) -> None:
    cycle = SimpleNamespace(
        frequency=60.0, amplitude=0.3, bias=0.1, demand_amplitude=12.0, stable=True, beyond_limits=False,
        mean_torque=7.16, share=0.4,
    )  # fmt: skip
    view = replace(loop(), drive=behind(gear, units))
    vars(view)["cycles"] = (cycle,)
    modes, drives, cycles = tables(view, view.loop)
    check(cycles, "amplitude", gear, [0.3])
    check(cycles, "bias", gear, [0.1])
    check(cycles, "demand +-", gear, [12.0])
    assert (modes.rows, drives.rows) == tuple(one.rows for one in tables(loop(), loop().loop)[:2])
    assert cycles.rows[0][0] == "60.00"
    mean, unit = linear_notes(view)[0].split("cycles: ")[1].split(" at the output. ")[0].split(" ", 1)
    assert float(mean) == pytest.approx(there(gear, unit, 7.16), rel=5.1e-4)
    size, unit, *_ = view.warning.split("amplitude of the twist ")[1].split()
    assert float(size) == pytest.approx(there(gear, unit, 0.3), rel=5.1e-3)


@pytest.mark.parametrize(("gear", "units"), gears()[:12])
def test_wear_is_seen_through_the_gear(gear: Gear, units: str) -> None:
    """The growth of the gap, its values with intervals, and what else has changed."""

    def found(gap: float, inertia: float) -> Any:
        estimates = (
            Estimate("gap", gap, gap - 0.01, gap + 0.01, True, ""),
            Estimate("load_inertia", inertia, inertia - 1e-3, inertia + 1e-3, True, ""),
        )
        return SimpleNamespace(
            drive=behind(gear, units), estimates=estimates, shared=estimates,
            __getitem__=lambda name: next(one for one in estimates if one.name == name),
        )  # fmt: skip

    first, last = found(0.5, 0.175), found(0.6, 0.275)
    line = Line.through(np.array([0.0, 1.0]), np.array([0.5, 0.6]), np.array([0.005, 0.005]))
    wear: Any = SimpleNamespace(
        found=(first, last), names=("a", "b"), dates=(date(2025, 1, 1), date(2026, 1, 1)), line=line,
        limit=None, worn=None, gaps=tuple(one.estimates[0] for one in (first, last)),
    )  # fmt: skip
    check(wear_table(wear, units_of(last.drive)), "gap", gear, [0.5, 0.6])
    growth, unit = wear_conclusion(wear)[0].split("at the output: ")[1].split(" a year")[0].split(" ")
    assert float(growth) == pytest.approx(there(gear, unit, line.slope), rel=5.1e-3)
    (note,) = wear_notes(wear)
    said = note.split("changed from ")[1].split(" at the output")[0]
    before, now, unit = said.replace(" to ", " ").split(" ", 2)
    assert float(before) == pytest.approx(there(gear, unit, 0.175), rel=5.1e-4)
    assert float(now) == pytest.approx(there(gear, unit, 0.275), rel=5.1e-4)


@pytest.mark.slow
def test_a_plan_and_a_sheet_are_seen_at_either_shaft(capsys: pytest.CaptureFixture[str]) -> None:
    """From the command line: the same widths; peak times i eta, travel over i."""
    gear = Gear(38.1, 0.95)
    settings = ["--set", "gear.ratio=38.1", "--set", "gear.efficiency=0.95", "--set", "load.kind=reactive"]
    shown = {}
    for shaft in ("motor", "output"):
        assert main(["plan", "crane-4amtkf", "--standard", *settings, "--at", shaft]) == 0
        lines = capsys.readouterr().out.splitlines()
        shown[shaft] = {line[: line.index("  ")]: line.split() for line in lines if "  " in line.strip()}
    for words, si, unit in (("peak shaft torque, N m", "N*m", "N m"), ("load moves, rad", "rad", "rad")):
        pairs = list(zip(*(shown[shaft][words] for shaft in ("motor", "output")), strict=True))
        numbers = [tuple(map(float, pair)) for pair in pairs if pair[0][0].isdigit()]
        assert numbers
        for motor, output in numbers:
            assert output == pytest.approx(there(gear, unit, motor), rel=0.011), si
    assert shown["motor"]["shaft.gap"] == shown["output"]["shaft.gap"]
    for command in (["linear"], ["sheet"], ["sweep", "--axis", "shaft.gap=0.5"]):
        at = [*settings, "--controller", "state-feedback", "--at", "output"]
        assert main([command[0], "crane-4amtkf", *command[1:], *at]) == 0
        assert "all values are at the output of the gear" in capsys.readouterr().out
        assert main([command[0], "crane-4amtkf", *command[1:], *at[6:]]) == 2
        said = capsys.readouterr().err
        assert '--at output: without gear.ratio nothing is "at output"; give it, or leave --at out.' in said
