"""Every value that a person sees at the output is that of JSON through the gear, to the digits shown.

A gear changes no start, only what is seen: the results of one machine are seen through 50 random gears.
"""

import html
import math
import re
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from softstart import (
    Chain,
    Drive,
    InputError,
    compare,
    fatigue,
    optimize,
    parameter_sheet,
    pareto,
    report,
    scenarios_of,
    simulate,
    tune,
)
from softstart.cli.main import main
from softstart.input.gear import NO_GEAR, NO_OUTPUT, Gear
from softstart.quantities import RefusedError
from softstart.reporting.document import data_of, strategies
from softstart.reporting.sheet_view import common_notes, notes, settings, starts
from softstart.views.fatigue import fatigue_tables
from softstart.views.identification import plan_table
from softstart.views.numbers import TextTable, seen_at, units_of
from softstart.views.optima import bound_sentence, optimum_sheet, scenario_table
from softstart.views.starts import comparison_table, machine_lines, run_sheet
from softstart.views.tuning import tuning_sheet

SIZES = {  # of the units in SI, from their definitions
    "rad": 1.0, "rad/s": 1.0, "N m": 1.0, "kg m2": 1.0, "arcmin": math.pi / 10800.0, "deg": math.pi / 180.0,
    "rpm": math.pi / 30.0, "kN m": 1000.0, "lbf ft": 0.45359237 * 9.80665 * 0.3048,
}  # fmt: skip
SI = {"rad": "rad", "arcmin": "rad", "deg": "rad", "rad/s": "rad/s", "rpm": "rad/s", "kg m2": "kg*m^2"}
CHOICES = ("rad, rad/s", "arcmin, rpm, kN m", "deg, rpm, lbf ft")
QUICK = {"certified": False, "generations": 1, "restarts": 1, "workers": 1}


def gears() -> list[tuple[Gear, str]]:
    draw = np.random.default_rng(53)
    return [
        (Gear(float(draw.uniform(1.5, 300.0)), float(draw.uniform(0.4, 1.0))), CHOICES[i % len(CHOICES)])
        for i in range(50)
    ]


@cache
def results() -> SimpleNamespace:
    """What the commands compute for one machine, whose gear no start depends on."""
    drive = Drive.load("crane-4amtkf").replace(
        gear_ratio=2.0, permissible_torque=150.0, fatigue_slope=6.6, start_position="mid-gap", damping=0.3
    )
    return SimpleNamespace(
        drive=drive,
        run=simulate(drive, "ramp"),
        comparison=compare(drive, ["direct", "ramp", "shaped"]),
        lives=fatigue([simulate(drive, one) for one in ("direct", "ramp")]),
        best=optimize(drive, 0.4),
        report=report(drive, controllers=["ramp"], budget=0.0),
        sheet=parameter_sheet(drive, "speed-ramp"),
        tuning=tune(drive, "reduced-first-stage", ["0.5x", "1x"], ["1x", "2x"], free=["torque"], **QUICK),
    )


def through(result: object, drive: Drive, gear: Gear, units: str) -> None:
    """The machine of a result behind another gear: none of its starts depends on it."""
    seen = drive.replace(gear_ratio=gear.ratio, gear_efficiency=gear.efficiency, units=units)
    vars(drive).update({name: getattr(seen, name) for name in ("gear_ratio", "gear_efficiency", "units")})


def agrees(text: str, value: float) -> bool:
    """Whether a number is this value to the digits shown."""
    mantissa, _, exponent = text.partition("e")
    step = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(text) - value) <= (0.5 + 1e-6) * step


def there(gear: Gear, unit: str, value: float) -> float:
    return float(gear.to_output(value, SI.get(unit, "N*m"))) / SIZES[unit]


def columns(table: TextTable) -> dict[str, tuple[str, list[str]]]:
    """Unit and cells of each column below its heading without the unit."""
    found = {}
    for i, column in enumerate(table.columns):
        words = re.sub(r"\s+", " ", column.heading)
        unit = next((one for one in sorted(SIZES, key=len, reverse=True) if words.endswith(f" {one}")), "")
        found[words.removesuffix(f" {unit}")] = unit, [row[i] for row in table.rows]
    return found


def check(table: TextTable, heading: str, gear: Gear, values: list[float]) -> None:
    """A column of a table, whose title says where it is, against values in SI at the motor shaft."""
    assert table.title.lower().endswith("at the output")
    unit, cells = columns(table)[heading]
    for cell, value in zip(cells, values, strict=True):
        assert agrees(cell, there(gear, unit, value)) if math.isfinite(value) else cell == "-"


@pytest.mark.parametrize(("gear", "units"), gears())
def test_every_value_is_that_of_json_through_the_gear(gear: Gear, units: str) -> None:
    found = results()
    machines = [found.drive, *(one.drive for one in (found.run, found.comparison, found.lives, found.tuning))]
    machines += [row.run.drive for row in found.comparison.rows]
    machines += [found.best.run.drive, found.best.problem.drive, found.report.drive]
    machines += [row.run.drive for row in found.report.comparison.rows]
    for one in machines:
        through(found, one, gear, f"{units}, at output")
    # the machine
    text, drive = "\n".join(machine_lines(found.drive)), found.drive
    for name, value in (
        ("J1", drive.J1),
        ("Ms", drive.Ms),
        ("c", drive.c),
        ("J2", drive.J2),
        ("Mc", drive.Mc),
    ):
        number, unit = re.search(rf"\b{name} = (\S+) ([a-z]+(?: [a-z0-9]+)?(?:/rad)?)", text, re.I).groups()
        si = {"c": "N*m/rad"}.get(name, SI.get(unit, "N*m"))
        expected = gear.to_output(value, si) / SIZES[unit.removesuffix("/rad")]
        assert float(number) == pytest.approx(expected, rel=5.1e-6)
    assert f"i = {gear.ratio:.6g}, eta = {gear.efficiency:.6g}" in text
    # simulate
    json, sheet = found.run.summary(), run_sheet(found.run)
    facts = dict(map(tuple, sheet.facts))
    for name, value in (
        ("peak shaft torque", json["peak_torque"]), ("speed of impact", json["impact_speed"]),
        ("motor torque at contact", json["torque_at_contact"]),
    ):  # fmt: skip
        number, unit = re.match(r"(\S+) ([a-z/]+(?: [a-z]+)?)(?: at |$)", facts[name], re.I).groups()
        assert float(number) == pytest.approx(there(gear, unit, value), rel=5.1e-6)
    check(sheet.tables[0], "peak torque", gear, [stage.peak_torque for stage in found.run.stages])
    permitted = 150.0 * gear.ratio * gear.efficiency
    peak, of, limit = re.search(r"output torque (\S+) (\w+ \w+) of (\S+) ", facts["limits"]).groups()
    assert float(limit) == pytest.approx(permitted / SIZES[of], rel=5.1e-4)
    assert float(peak) == pytest.approx(there(gear, of, json["peak_torque"]), rel=5.1e-4)
    # compare
    rows = found.comparison.summary()["strategies"]
    table = comparison_table(found.comparison.rows)
    check(table, "peak", gear, [row["peak_torque"] for row in rows])
    check(table, "u at contact", gear, [row["torque_at_contact"] for row in rows])
    # fatigue
    lives = found.lives.summary()["strategies"]
    check(fatigue_tables(found.lives, found.lives.rows)[0], "equivalent torque", gear,
          [row.equivalent_torque for row in found.lives.rows])  # fmt: skip
    assert [row.equivalent_torque for row in found.lives.rows] == [one["equivalent_torque"] for one in lives]
    # optimize
    facts = dict(map(tuple, optimum_sheet(found.best).facts))
    number, unit = re.match(r"(\S+) (\w+ \w+) at ", facts["peak shaft torque"]).groups()
    assert float(number) == pytest.approx(there(gear, unit, found.best.summary()["peak_torque"]), rel=5.1e-6)
    low, high, unit = re.search(
        r"from (\S+) to (\S+) (\w+ \w+) at the output", bound_sentence(found.best)
    ).groups()
    assert (float(low), float(high)) == pytest.approx((0.0, there(gear, unit, drive.Ms)), rel=5.1e-6)
    # tune
    torques = [one for row in found.tuning.summary()["schedule"]["torque"] for one in row]
    schedule, robust = tuning_sheet(found.tuning).tables[:2]
    check(schedule, "gap", gear, [0.25, 0.25, 0.5, 0.5])
    check(schedule, "J2", gear, [drive.J2, 2.0 * drive.J2] * 2)
    check(schedule, "torque", gear, torques)
    unit = columns(robust)["unit"][1][0]
    shown = float(columns(robust)["robust"][1][0])
    assert shown == pytest.approx(there(gear, unit, found.tuning.robust.gains["torque"]), rel=5.1e-6)
    # report
    heads, data, _ = data_of(found.report)
    assert heads.endswith("|#at the motor shaft")
    given = {row[1]: row[2:] for row in data}
    for symbol, si in (("J1", "kg*m^2"), ("Ms", "N*m"), ("c", "N*m/rad"), ("gap", "rad"), ("J2", "kg*m^2")):
        text, of, motor = given[symbol]
        value = getattr(drive, symbol)
        size = SIZES[of.removesuffix("/rad").replace("²", "2")]
        assert float(text) == pytest.approx(gear.to_output(value, si) / size, rel=5.1e-6)
        assert float(motor.split()[0]) == pytest.approx(value, rel=5.1e-4)
    limit = next(row for row in data if row[0].startswith("permissible peak"))
    assert float(limit[2]) == pytest.approx(permitted / SIZES[limit[3]], rel=5.1e-6)
    peaks = sorted(found.report.summary()["strategies"], key=lambda one: one["k_dyn"])
    check(strategies(found.report), "peak", gear, [one["peak_torque"] for one in peaks])


@pytest.mark.parametrize(("gear", "units"), gears())
def test_a_sheet_sets_the_motor_and_says_what_that_is_at_the_output(gear: Gear, units: str) -> None:
    """Its values, the starts with them, and its notes; what is typed into the inverter is the motor's."""
    found, drive = results().sheet, results().drive
    own = [row[:3] for row in settings(found).rows]
    for one in (drive, found.exact.drive, found.rounded.drive):
        through(found, one, gear, f"{units}, at output")
    rows = settings(found).rows
    assert [[*row[:2], row[2].removesuffix(" of the motor")] for row in rows] == own
    for setting, row in zip(found.settings, rows, strict=True):
        if setting.unit in ("N*m", "N*m*s/rad"):
            number, unit = row[3].split(" ", 1)
            value = float(gear.to_output(setting.rounded, setting.unit))
            assert agrees(number, value / SIZES[unit.removesuffix(" s/rad")])
    check(starts(found), "peak torque", gear,
          [found.exact.peak_torque, found.rounded.peak_torque, found.worst_peak])  # fmt: skip
    said = re.search(
        r"of (\S+) (\w+ \w+) at the output, (\S+) .* takes: (\S+) \w+ \w+ at the output \((\S+) %",
        " ".join([*common_notes([found]), *notes(found)]),
    )
    number, unit, motor, limit, percent = said.groups()
    rated = float(drive.rated)
    assert float(number) == pytest.approx(there(gear, unit, rated), rel=5.1e-5)
    assert float(motor) == pytest.approx(rated / SIZES[unit], rel=5.1e-5)
    assert float(limit) == pytest.approx(there(gear, unit, 0.01 * float(percent) * rated), rel=1e-4)
    for one in (drive, found.exact.drive, found.rounded.drive):
        through(found, one, gear, "")


@pytest.mark.slow
def test_the_report_says_the_shaft_once_in_each_part() -> None:
    """The whole page at the output: numbers of the first page, captions, and the sheet in its own units."""
    drive = results().drive.replace(
        gear_ratio=38.1, gear_efficiency=0.95, units="arcmin, rpm, kN m, at output"
    )
    made = report(drive, controllers=["ramp"], budget=0.0)
    page = re.sub(r"<style.*?</style>|<svg class=.plot.*?</svg>", "", made.to_html(), flags=re.DOTALL)
    text = " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).split())
    peak = made.choice.chosen.run.peak_torque * 38.1 * 0.95 / 1000.0
    assert f"peak shaft torque, at the output {peak:.3f} kN m" in text
    assert "Strategies on this drive, by K dyn , at the output" in text
    assert "Data of the drive, at the output shaft" in text
    assert "everything brought to the output shaft" in text
    assert "at the output, N m" not in text
    assert re.search(r"parameter sheets: the [a-z ]+, [0-9.]+ N m at the motor shaft", text)


def shown_of(drive: Drive) -> list[object]:
    """All that `compare` and `simulate` print for a machine."""
    comparison = compare(drive, ["direct", "ramp"])
    run = run_sheet(comparison.rows[1].run)
    return [machine_lines(drive), comparison_table(comparison.rows), comparison.recommendation.text,
            run.facts, run.tables, run.title]  # fmt: skip


def test_turned_round_the_numbers_are_the_old_ones() -> None:
    for gear, units in gears()[1:2]:
        drive = Drive.load("crane-4amtkf").replace(
            gear_ratio=gear.ratio, gear_efficiency=gear.efficiency, units=units, permissible_torque=150.0
        )
        assert shown_of(seen_at(seen_at(drive, "output"), "motor")) == shown_of(drive)


def test_ratio_1_and_efficiency_1_change_the_label_alone() -> None:
    drive = Drive.load("crane-4amtkf").replace(gear_ratio=1.0, permissible_torque=150.0)
    motor, output = (repr(shown_of(seen_at(drive, shaft))) for shaft in ("motor", "output"))
    label = r", at the output|At the output|'  output [^']*', |\['the same at the output', '[^']*'\], "
    words = [
        re.sub("(?i)(shaft|output) torque ", "torque ", re.sub(label, "", one)) for one in (motor, output)
    ]
    assert words[0] == words[1]
    assert "at the output" in output
    assert "150 N m" in output


@pytest.mark.parametrize(("machine", "reason"), [("crane-4amtkf", NO_GEAR), ("crane-4-mass", NO_OUTPUT)])
@pytest.mark.parametrize(
    "command", ["compare", "simulate", "optimize", "pareto", "tune", "fatigue", "report"]
)
def test_without_an_output_it_is_refused_in_one_sentence(
    machine: str, reason: str, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    controller = ["--controller", "ramp"] if command in ("simulate", "tune") else []
    assert main([command, machine, *controller, "--at", "output"]) == 2
    said = reason.replace("or write the value at the motor shaft", "or leave --at out")
    assert capsys.readouterr().err == f"softstart: --at output: {said}.\n"
    kind = Chain if machine == "crane-4-mass" else Drive
    with pytest.raises(InputError, match=re.escape(reason)):
        kind.load(machine).replace(units="at output")
    with pytest.raises(RefusedError, match=re.escape(reason)):
        seen_at(kind.load(machine), "output")


def test_scenarios_of_an_optimum_are_at_the_output_too() -> None:
    drive = Drive.load("crane-4amtkf").replace(
        gear_ratio=38.1, gear_efficiency=0.95, start_position="mid-gap", units="arcmin, kN m, at output"
    )
    machines = scenarios_of(drive, gaps=[0.5, 1.0])
    problem = SimpleNamespace(machines=machines, drive=drive)
    best = SimpleNamespace(problem=problem, k_dyn_each=[1.0, 1.0], start_times=[0.4, 0.4], worst=0)
    table = scenario_table(best)
    gear = Gear(38.1, 0.95)
    check(table, "gap", gear, [0.5, 1.0])
    check(table, "J2", gear, [drive.J2] * 2)
    check(table, "Mc", gear, [drive.Mc] * 2)


@pytest.mark.slow
def test_csv_files_and_saved_results_know_no_shaft(tmp_path: Path) -> None:
    """A plan and a saved curve are the same at either shaft."""
    drive = Drive.load("crane-4amtkf").replace(gear_ratio=38.1, start_position="mid-gap")
    there = seen_at(drive, "output")
    plan = SimpleNamespace(
        drive=there, experiments=[SimpleNamespace(name="start", widths={}, peak=50.0, travel=3.0, end=1.0)]
    )
    assert plan_table(plan).rows == [
        ["peak shaft torque, N m", "50"],
        ["load moves, rad", "3"],
        ["lasts, s", "1"],
    ]
    assert plan_table(plan, units_of(there)).rows[0] == ["peak shaft torque, N m", "1.9e+03"]
    state = tmp_path / "state.sqlite"
    first, second = (pareto(one, [0.45], controllers=["direct"], save_to=state) for one in (drive, there))
    assert first.summary() == second.summary()
    assert "at the motor shaft" in first.points[0].bound_covers


def test_the_parts_of_a_load_are_at_the_shaft_of_their_sum() -> None:
    drive = Drive.load("crane-4amtkf").replace(
        gear_ratio=40, gear_efficiency=0.8, load_torque=4.0, load_friction=1.5, start_position="mid-gap"
    )
    for units, said in (
        ("", "Mc = 5.5 N m, 4 N m active and 1.5 N m friction"),
        ("N m, at output", "Mc = 176 N m, 128 N m active and 48 N m friction"),
        ("kN m, at output", "Mc = 0.176 kN m, 0.128 kN m active and 0.048 kN m friction"),
    ):
        seen = drive.replace(units=units)
        assert said in "\n".join(machine_lines(seen))
        page = html.unescape(report(seen, controllers=["ramp"], budget=0.0).to_html()).replace("\xa0", " ")
        assert page.count(said.partition(", ")[2]) >= 2  # in the scheme, and in what the model leaves out
