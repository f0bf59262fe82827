"""Rounding to what an inverter can be set to, and the starts with the rounded values."""

import itertools
import math
import re
import shlex
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from softstart import Drive, InputError, compare, parameter_sheet, simulate, tune
from softstart.controller import make_controller
from softstart.controller.tuned import RobustGains
from softstart.export.design import design_for
from softstart.plugins import controller_names
from softstart.reporting import Resolution, report
from softstart.reporting.sheet import make_sheet
from softstart.reporting.sheet_view import common_notes, notes, settings
from softstart.start.resolution import nearest_step, rated_torque

HOIST = Drive.load("hoist-15kw")


def sheet_of(name, steps, **parameters):
    drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    controller = make_controller(name, parameters)
    return drive, make_sheet(drive, controller, simulate(drive, controller), Resolution.read(steps))


@pytest.mark.parametrize("name", ["ramp", "shaped", "acceleration-delay"])
def test_rounded_values_are_multiples_and_their_figures_those_of_simulate(name):
    drive, sheet = sheet_of(name, "torque=0.5%,time=10ms,speed=2rpm,share=5%")
    rated = 2200.0 / drive.rated_speed
    assert rated_torque(drive) == (rated, "rated torque")
    steps = {"N*m": 0.005 * rated, "s": 0.01, "rad/s": 2.0 * math.pi / 30.0, "1": 0.05}
    for one in sheet.varied:
        step = 0.2 * math.pi if one.name == "frequency" else steps[one.unit]
        assert one.step == pytest.approx(step, rel=1e-12)
        assert one.rounded / step == pytest.approx(round(one.rounded / step), abs=1e-9)
        assert one.rounded > 0.0
        assert abs(one.rounded - one.exact) <= 0.5 * step * (1.0 + 1e-9) or one.rounded == pytest.approx(step)
    again = simulate(drive, name, parameters={one.name: one.rounded for one in sheet.settings})
    assert sheet.rounded.k_dyn == again.k_dyn
    assert sheet.rounded.start_time == again.start_time
    assert sheet.exact.k_dyn == simulate(drive, name).k_dyn
    assert {one.name for one in sheet.settings if one.step is None} <= {"period", "shaper", "raise_at"}


def test_what_holds_for_several_sheets_is_said_once():
    names = ["ramp", "shaped", "take-up"]
    found = report("crane-4amtkf", controllers=names, budget=0.0)
    several = list(found.sheets)
    assert len(several) == 2
    several.append(parameter_sheet("crane-4amtkf", "take-up"))  # of more values than all combinations
    own = [one for sheet in several for one in notes(sheet)]
    common = common_notes(several)
    assert [sum(words in one for one in own + common) for words in ("100 % of torque is", "FMU")] == [1, 1]
    assert sorted(one.partition(":")[0] for one in common if "half a step" in one) == [
        "All but take-up",
        "take-up",
    ]
    # each sheet alone says all of it
    for sheet in several:
        alone = sheet.sheet.notes
        assert alone[: len(notes(sheet))] == notes(sheet)
        assert any("100 % of torque is the rated torque" in one for one in alone)
        assert any("Torque limits of the inverter" in one for one in alone)
    page = re.sub(r"\s+", " ", found.to_html())
    assert page.count("100 % of torque is the rated torque") == 1
    assert page.count("(Structured Text, C, FMU)") == 1
    assert page.count("Torque limits of the inverter, not tighter") == 2


def test_worst_case_is_the_worst_of_all_half_steps():
    drive, sheet = sheet_of("s-curve", "torque=0.5%,time=10ms,share=5%")
    assert [one.name for one in sheet.varied] == ["initial", "time", "full_torque", "rounding"]
    runs = {}
    for sides in itertools.product((-0.5, 0.5), repeat=4):
        values = {
            one.name: min(
                one.rounded + side * one.step, {"rounding": 1.0, "full_torque": 64.0}.get(one.name, 99)
            )
            for one, side in zip(sheet.varied, sides, strict=True)
        }
        runs[tuple(values.values())] = simulate(drive, "s-curve", parameters=values)
    assert sheet.variants == 16
    assert sheet.worst_k_dyn == max(run.k_dyn for run in runs.values())
    assert sheet.slowest == max(run.start_time for run in runs.values())
    assert sheet.worst_k_dyn > sheet.rounded.k_dyn


def test_gains_tuned_for_another_drive_keep_its_numbers():
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    light = crane.replace(load_inertia=0.07)
    gains = RobustGains("mine", make_controller("shaped"), light)
    sheet = make_sheet(crane, gains, simulate(crane, gains), Resolution())
    values = {one.name: one.rounded for one in sheet.settings}
    assert sheet.name == "shaped (mine)"
    assert sheet.rounded.k_dyn == simulate(crane, "shaped", parameters=values, fitted_to=light).k_dyn


@pytest.mark.parametrize(
    ("step", "time", "moved"),
    [("80ms", 0.16, ("time",)), ("1s", None, ())],
)
def test_a_sheet_keeps_the_rule_by_which_its_strategy_was_chosen(step, time, moved):
    """With the worn gap a ramp in 80 ms exceeds the limit; one in a second is slow: neither is printed."""
    drive = Drive.load("crane-4amtkf").replace(permissible_torque=193.0)
    made = report(drive, controllers=["direct", "ramp"], resolution=f"time={step}", budget=0.0)
    (sheet,) = made.sheets
    assert (sheet.name, sheet.moved) == ("ramp", moved)
    if time is None:
        assert sheet.rounded is None
        assert "takes 2.27 times as long as direct start" in sheet.failure
        assert made.summary()["sheets"][0]["settings"][1]["rounded"] is None
        assert ">set to<" not in made.to_html().partition("Parameter sheets for the inverter</h2>")[2]
        return
    assert sheet.rounded.controller.time == pytest.approx(time)
    worn = compare(drive, [sheet.rounded.controller]).rows[0]
    assert all(margin.kept for margin in worn.margins(drive.limits))


def test_torque_is_not_rounded_beyond_the_motor():
    drive, sheet = sheet_of("direct", "torque=7 N*m", torque=63.0)
    assert drive.maximum_torque == 64.0
    assert sheet.varied[0].rounded == 63.0


@given(
    st.floats(1e-6, 1e6), st.sampled_from([0.1, 0.01, 0.001, 0.5, 0.25, 1.0, 2.0, 0.3581]), st.floats(1, 1e7)
)
def test_nearest_step(value, step, most):
    found = nearest_step(value, step, most)
    count = Fraction(found) / Fraction(step)
    assert abs(count - round(count)) < 1e-9 * max(1, count)
    assert round(count) >= 1
    if found <= most and value <= most - step and value >= step:
        assert abs(found - value) <= 0.5 * step + 1e-9 * value
    assert found <= max(most, step) * (1.0 + 1e-9)
    assert nearest_step(found, step) == found


def test_bad_resolutions_are_refused_in_one_sentence():
    for text, says in (
        ("tme=10ms", "did you mean time?"), ("time=10kg", "not a time"), ("torque=0%", "above 0"),
        ("torque=nan%", "not a number"), ("speed=50 Hz", "frequency"), ("time=inf", "finite"),
        ("", "write keys and values"), ("time=1ms,time=2ms", "given twice"),
    ):  # fmt: skip
        with pytest.raises(InputError) as caught:
            Resolution.read(text, "--resolution")
        (sentence,) = caught.value.sentences
        assert sentence.startswith('--resolution "')
        assert says in sentence
    with pytest.raises(InputError) as caught:
        report("crane-4amtkf", resolution="x=1", budget=math.nan)
    assert len(caught.value.sentences) == 2


@pytest.mark.parametrize("name", ["ramp", "s-curve"])
def test_the_time_from_0_to_100_percent_is_rounded_and_started_too(name):
    drive, sheet = sheet_of(name, "time=5ms")
    values = {one.name: one.rounded for one in sheet.settings}
    share = (values["full_torque"] - values["initial"]) / rated_torque(drive)[0]
    rise = sheet.full_rise
    assert rise.exact * share == pytest.approx(values["time"], rel=1e-12)
    assert rise.rounded == pytest.approx(0.05, abs=1e-12)  # 48.8 ms
    assert rise.rise == pytest.approx(rise.rounded * share, rel=1e-12)
    again = simulate(drive, name, parameters={**values, "time": rise.rise})
    assert (rise.run.k_dyn, rise.run.start_time) == (again.k_dyn, again.start_time)


def test_a_ramp_is_started_as_the_gear_backlash_compensation_of_an_inverter_counts_it():
    _, sheet = sheet_of("ramp", "time=1ms")
    gear, settings = sheet.gear_ramp, {one.name: one.rounded for one in sheet.settings}
    rise = settings["full_torque"] - settings["initial"]
    step = gear.rounded / 4000.0 * rated_torque(sheet.own)[0]  # N m in each cycle of 3.3 ms
    assert gear.rise == pytest.approx(rise / step * 3.3e-3)
    assert gear.run.controller.time == gear.rise
    assert sheet_of("s-curve", "time=1ms")[1].gear_ramp is None


def test_torque_limits_are_multiples_that_leave_the_start_alone():
    """Printed limits may be a little wide, never tight: pulse-coast-hold takes the whole of Ms."""
    drive, sheet = sheet_of("pulse-coast-hold", "torque=0.5%")
    high = float(sheet.rounded.u.max())
    said = re.search(
        r"^([\d.]+) N m \(([\d.]+) % of the rated torque\)", " ".join(sheet.torque_limits(drive))
    )
    limit, share = float(said[1]), float(said[2])
    step = 0.005 * rated_torque(drive)[0]
    assert high <= limit <= high + step
    assert share / 0.5 == pytest.approx(round(share / 0.5), abs=1e-9)
    assert limit == pytest.approx(share / 100.0 * rated_torque(drive)[0], abs=5e-3)


@pytest.mark.parametrize("name", ["pulse-coast-hold", "acceleration-delay"])
def test_what_a_strategy_computes_with_is_what_changes_its_start(name):
    """Data that are not named may be wrong: set up for a drive with other ones, it runs the same."""
    drive, sheet = sheet_of(name, "time=1ms")
    values = {one.name: one.exact for one in sheet.settings}
    assert set(sheet.computes_with) <= {"J1", "J2", "c", "Ms", "Mc", "the torque lag"}
    for key, symbol in (
        ("load_inertia", "J2"),
        ("stiffness", "c"),
        ("gap", "the gap"),
        ("load_torque", "Mc"),
    ):
        believed = drive.replace(**{key: 0.9 * getattr(drive, key)})
        run = simulate(drive, name, parameters=values, fitted_to=believed)
        if symbol not in sheet.computes_with:
            assert run.k_dyn == sheet.exact.k_dyn


def test_the_worst_case_counts_the_rounded_values_themselves():
    servo = Drive.load("servo-axis-small")
    shaped = make_controller("shaped")
    sheet = make_sheet(servo, shaped, simulate(servo, shaped), Resolution())
    assert sheet.worst_k_dyn >= sheet.rounded.k_dyn
    assert sheet.slowest >= sheet.rounded.start_time


def printed_values(sheet):
    """The values of a sheet as its text says them, in SI, and its K_dyn."""
    drive, text = sheet.drive, str(sheet)
    rated = (15e3 if drive.name == HOIST.name else 2200.0) / drive.rated_speed
    units = {
        "ms": 1e-3, "rpm": math.pi / 30.0, "Hz": 2.0 * math.pi, "": 1.0,
        "% of the rated torque": 0.01 * rated, "% of torque per % of speed": rated / drive.rated_speed,
    }  # fmt: skip
    values = {}
    for name, shown, unit, *_ in settings(sheet).rows:
        assert re.search(rf"^{name} +{re.escape(shown)}\b", text, re.MULTILINE)
        word = shown in ("peak", "zv")
        values[name.replace(" ", "_")] = shown if word else float(shown) * units[unit]
    k_dyn, time = re.search(r"^values of the sheet +([\d.]+) +[\d.]+ +([\d.]+)$", text, re.MULTILINE).groups()
    return values, k_dyn, time


STRATEGIES = [name for name in controller_names() if name != "profile"]


@pytest.mark.parametrize("name", STRATEGIES)
@pytest.mark.parametrize("drive", [Drive.load("crane-4amtkf"), HOIST], ids=["crane", "hoist"])
def test_the_k_dyn_of_a_sheet_is_that_of_a_start_with_exactly_the_printed_values(drive, name):
    sheet = parameter_sheet(drive, name)
    values, k_dyn, time = printed_values(sheet)
    run = simulate(drive, name, parameters=values)
    assert (f"{run.k_dyn:.4f}", f"{run.limited_time:.5f}") == (k_dyn, time)


@pytest.mark.parametrize(
    ("name", "given", "steps"),
    [("take-up", {"rise": "33 ms"}, {}), ("shaped", {}, {"time": "10 ms", "torque": "2%"})],
)
def test_the_program_that_a_sheet_names_has_its_values(name, given, steps):
    crane = Drive.load("crane-4amtkf")
    sheet = parameter_sheet(crane, name, parameters=given, resolution=steps)
    words = shlex.split(sheet.export_command("crane-4amtkf"))
    assert words[:5] == ["softstart", "export", "crane-4amtkf", "--controller", name]
    parameters = dict(word.split("=") for flag, word in itertools.pairwise(words) if flag == "--param")
    program = design_for(make_controller(name, parameters), crane)
    assert program.controller.controller.parameters == sheet.rounded.controller.parameters


def test_the_sheet_of_a_tuned_set_has_all_its_cells(tmp_path):
    crane, path = Drive.load("crane-4amtkf"), tmp_path / "robust.toml"
    tuned = tune(crane, "reduced-first-stage", ["1x", "4x"], ["1x"], free=["torque"], certified=False,
                 generations=2, restarts=1)  # fmt: skip
    tuned.to_toml(path, "robust")
    sheet = parameter_sheet(crane, str(path), resolution="torque=4%")
    exact = tuned.robust.cells["k_dyn"].to_numpy().ravel().tolist()
    assert [cell.exact.k_dyn for cell in sheet.cells] == pytest.approx(exact, rel=1e-12)
    values, *_ = printed_values(sheet)
    text = str(sheet)
    for cell in sheet.cells:
        there = crane.replace(gap=cell.gap, load_inertia=cell.load_inertia)
        run = simulate(there, "reduced-first-stage", parameters=values, fitted_to=crane)
        assert re.search(
            rf"^{cell.gap:.3f} +0.1750 +{cell.exact.k_dyn:.4f} +{run.k_dyn:.4f} ", text, re.MULTILINE
        )
        assert run.k_dyn != cell.exact.k_dyn
    worst = max(cell.rounded.k_dyn for cell in sheet.cells)
    assert f"In the worst of the 2 cells that they were tuned for: K_dyn {worst:.4f}," in text.replace(
        "\n", " "
    )
    assert sheet.export_command("x", str(path)) == ""  # which rounds to other steps
    usual = parameter_sheet(crane, str(path)).export_command("x")
    assert usual == "softstart export x --controller robust.toml --as st --out reduced-first-stage-st"


def test_a_sheet_is_set_for_the_limits_as_in_compare_and_says_their_margins():
    drive = Drive.load("crane-4amtkf").replace(permissible_torque=170.0, permissible_start_time=0.6)
    (row,) = compare(drive, ["s-curve"]).rows
    sheet = parameter_sheet(drive, "s-curve")
    assert row.setting
    assert {one.name: one.exact for one in sheet.settings}.items() >= row.setting.items()
    (torque, time) = sheet.margins
    assert torque.kept
    assert f"With these values: {torque}; {time}." in str(sheet).replace("\n", " ")
