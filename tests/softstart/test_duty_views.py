"""A duty as people see it: life of the shafts, limits of every step, tables, figures, strategies compared."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from softstart import (
    Chain,
    Drive,
    Duty,
    DutyRun,
    DutyStep,
    InputError,
    Shift,
    compare_duty,
    fatigue,
    run_duty,
    simulate,
)
from softstart.chain import Mass, Motor, Shaft
from softstart.views.duties import asked_of, duty_figure, duty_sheet, how_of, worst_recorded

CRANE = Drive.load("crane-4amtkf").replace(
    damping=1.0, load_kind="reactive", motor_friction=0.5, minimum_torque=-62.0, start_position="mid-gap",
    permissible_torque=110.0, permissible_start_time=0.5, fatigue_slope=6.6, fatigue_torque=150.0,
    fatigue_cycles=2e6,
)  # fmt: skip
THERE_AND_BACK = Duty(
    [
        DutyStep("start"),
        DutyStep("hold", time=0.2),
        DutyStep("reverse"),
        DutyStep("stop"),
        DutyStep("jog", time=0.15, repeat=2),
    ],
    shift=Shift(cycles_per_hour=30.0, hours=7.5, shifts_per_year=200.0),
)
START = Duty([DutyStep("start")])


@cache
def ramp() -> DutyRun:
    return run_duty(CRANE, "ramp", THERE_AND_BACK)


def text_of(run: DutyRun, slope: float | None = None) -> str:
    sheet = duty_sheet(run, slope)
    return "\n".join([*sheet.lines, *sheet.conclusions, *sheet.notes])


# ---- life -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["direct", "shaped"])
def test_a_duty_of_one_start_has_the_damage_of_that_start(name: str) -> None:
    (life,) = fatigue(simulate(CRANE, name)).rows
    (shaft,) = run_duty(CRANE, name, START).life().shafts
    assert shaft.cycles == life.starts
    assert shaft.equivalent_torque == life.equivalent_torque
    np.testing.assert_array_equal(shaft.spectrum, life.spectrum)
    assert shaft.shares.tolist() == pytest.approx([1.0], rel=1e-12)


def four_point(history: np.ndarray) -> list[float]:
    """Ranges of a closed history by the four-point method: an inner range no larger than both outer ones."""
    closed = np.roll(history, -int(np.abs(history).argmax()))
    closed = np.append(closed, closed[0])
    turns = closed[np.concatenate([[True], np.diff(closed) != 0.0])]
    inner = np.sign(np.diff(turns))
    turns = turns[np.concatenate([[True], inner[1:] != inner[:-1], [True]])].tolist()
    found, stack = [], []
    for value in turns:
        stack.append(value)
        while len(stack) >= 4:
            a, b, c, d = stack[-4:]
            if not abs(b - c) <= min(abs(a - b), abs(c - d)):
                break
            found.append(abs(b - c))
            del stack[-3:-1]
    return sorted([*found, max(stack) - min(stack)], reverse=True)


def test_the_cycles_are_those_of_a_dense_trace_of_the_second_cycle() -> None:
    """Sampled 200,000 times, counted by another method; cycles above a thousandth of the largest."""
    run = ramp()
    begin = next(one.begin for one in run.executed if one.cycle == 2)
    torque = run.at(np.linspace(begin, run.executed[-1].end, 200_000))["T"][:, 0]
    sampled = np.array(four_point(torque))
    (shaft,) = run.life().shafts
    assert set(shaft.spectrum[:, 2]) == {1.0}
    large = [ranges[ranges > 1e-3 * sampled[0]] for ranges in (shaft.spectrum[:, 0], sampled)]
    assert large[0].size == large[1].size > 20
    # a sample misses an extreme by half the curvature times the square of half a step
    np.testing.assert_allclose(large[0], large[1], atol=1e-4 * sampled[0])


def test_damage_of_more_cycles_is_that_of_one() -> None:
    """From the second cycle on all are alike, but for the state in which the first one ends."""
    (two,), (five,) = (run_duty(CRANE, "ramp", THERE_AND_BACK, cycles=n).life().shafts for n in (2, 5))
    assert five.damage == pytest.approx(two.damage, rel=1e-3)
    assert five.spectrum[:, 2].sum() == pytest.approx(two.spectrum[:, 2].sum(), rel=0.1)


def test_a_single_cycle_is_counted_and_said() -> None:
    one = run_duty(CRANE, "ramp", THERE_AND_BACK, cycles=1)
    assert one.life().counted == 1
    assert one.life().worst.damage > 0.0
    assert "One cycle: its damage depends" in text_of(one)
    assert "One cycle" not in text_of(ramp())
    assert "The duty ends in motion" in text_of(run_duty(CRANE, "ramp", START))


def test_life_in_hours_shifts_and_years() -> None:
    (shaft,) = ramp().life().shafts
    assert shaft.cycles == 1.0 / shaft.damage
    assert shaft.hours == pytest.approx(shaft.cycles / 30.0, rel=1e-15)
    assert shaft.shifts == pytest.approx(shaft.hours / 7.5, rel=1e-15)
    assert shaft.years == pytest.approx(shaft.shifts / 200.0, rel=1e-15)
    assert shaft.shares.sum() == pytest.approx(1.0, rel=1e-12)
    # one cycle of the equivalent torque does the same damage
    assert (shaft.equivalent_torque / 150.0) ** 6.6 / 2e6 == pytest.approx(shaft.damage, rel=1e-12)


def test_what_is_missing_for_a_life_is_said() -> None:
    bare = CRANE.replace(fatigue_slope=None, fatigue_torque=None, fatigue_cycles=None)
    run = run_duty(bare, "ramp", THERE_AND_BACK)
    life = run.life(5.0)
    assert math.isnan(life.worst.cycles)
    assert math.isnan(life.worst.years)
    text = text_of(run, 5.0)
    assert "The life is relative only: [limits.fatigue] has no point of an S-N curve; give it torque" in text
    assert "damage-equivalent torque" in text
    run = run_duty(CRANE, "ramp", THERE_AND_BACK.replace(shift=None))
    assert not math.isnan(run.life().worst.cycles)
    assert math.isnan(run.life().worst.hours)
    assert "The life is in cycles only: the duty has no [shift]" in text_of(run)
    assert "only: " not in text_of(ramp())


def test_an_undamped_shaft_has_no_life_but_a_table_of_steps() -> None:
    duty = Duty([DutyStep("start"), DutyStep("stop", time=0.3, by="coast"), DutyStep("start")])
    run = run_duty(CRANE.replace(damping=0.0), "ramp", duty)
    with pytest.raises(InputError, match="damping is missing in motor - load"):
        run.life()
    sheet = run.sheet
    assert len(sheet.tables[0].rows) == 3
    assert any(note.startswith("No life: damping is missing") for note in sheet.notes)
    assert "damage\n%" not in [column.heading for column in sheet.tables[0].columns]


def test_a_rigid_gap_has_no_life() -> None:
    masses = [Mass(0.035, name="motor"), Mass(0.175, torque=7.16, kind="reactive", name="load")]
    shaft = Shaft(math.inf, gap=0.5, restitution=0.3)
    rigid = Chain(masses, [shaft], Motor(62.0), target_speed=92.0)
    run = run_duty(rigid, "direct", START)
    with pytest.raises(InputError, match="impacts in a rigid gap have no finite torque"):
        run.life()
    assert any("rigid gap" in note for note in run.notes)
    assert "impulse\nN m s" in [column.heading for column in run.tables[0].columns]
    assert "impulse\nN m s" not in [column.heading for column in ramp().tables[0].columns]


def test_required_life_and_starts_per_hour() -> None:
    """30 cycles an hour with a start, a reversal and two jogs are 120 starts."""
    asked = CRANE.replace(starts_per_hour=60.0, required_life="20000 h")
    text = text_of(run_duty(asked, "ramp", THERE_AND_BACK))
    assert "The required life of 20000 h is not reached." in text
    assert "[limits] starts_per_hour is 60, the duty has 120: 30 cycles per hour with 4 starts" in text
    agrees = text_of(run_duty(asked.replace(starts_per_hour=120.0), "ramp", THERE_AND_BACK))
    assert "starts_per_hour" not in agrees


# ---- limits -----------------------------------------------------------------------------------------------


def test_limits_hold_for_every_step_in_both_directions() -> None:
    run = ramp()
    start, hold, reverse, stop, _ = run.rows
    for row in run.rows:
        (torque, *times) = run.margins_of(row)
        assert torque.name == "shaft torque"
        assert torque.value == max(row.largest[0], -row.smallest[0])
        assert torque.kept == (torque.value <= 110.0)
        assert bool(times) == (row in (start, reverse))
    assert [one.kept for one in run.margins_of(start)] == [True, True]
    assert -reverse.smallest[0] > reverse.largest[0]  # loaded backwards
    assert [one.kept for one in run.margins_of(reverse)] == [True, False]  # 0.7 s of 0.5 s
    assert stop.largest[0] > 110.0  # a backward motion is braked with a positive torque
    assert sum(not margin.kept for _, margin in run.margins()) == 2
    assert run.worst.number == 4
    assert hold.start_time != hold.start_time
    table = run.tables[0]
    place = [column.heading for column in table.columns].index("margin\n%")
    torque, time = "shaft torque", "start time"
    assert [row[place + 1] for row in table.rows] == [time, torque, time, torque, torque]
    for row, cells in zip(run.rows, table.rows, strict=True):
        least = min(margin.share for margin in run.margins_of(row))
        assert float(cells[place]) == pytest.approx(100.0 * least, abs=0.051)
    text = text_of(run)
    assert text.count("Worst step: 4, stop, K_dyn") == 1
    assert "Limits are exceeded in step 3, reverse: start time" in text


def test_a_mirrored_duty_has_the_same_margins() -> None:
    back = Duty([DutyStep("start", set_speed=-CRANE.target_speed), DutyStep("stop")])
    there = Duty([DutyStep("start"), DutyStep("stop")])
    pairs = zip(run_duty(CRANE, "direct", there).rows, run_duty(CRANE, "direct", back).rows, strict=True)
    for row, mirrored in pairs:
        np.testing.assert_array_equal(row.largest, -mirrored.smallest)
        np.testing.assert_array_equal(row.smallest, -mirrored.largest)
        assert row.start_time == mirrored.start_time or row.step.do == "stop"
    run = run_duty(CRANE.replace(permissible_torque=100.0), "direct", back)
    assert not run.margins_of(run.rows[0])[0].kept


def test_rows_have_the_worst_figures_of_cycles_and_repetitions() -> None:
    run = ramp()
    jogs = [one for one in run.executed if one.number == 5]
    assert len(jogs) == 4
    row = run.rows[4]
    assert row.largest[0] == max(one.largest[0] for one in jogs)
    assert row.smallest[0] == min(one.smallest[0] for one in jogs)
    assert row.impact_energy[0] == max(one.impact_energy[0] for one in jogs)
    assert row.contacts == max(one.contacts for one in jogs)
    assert all(one.time >= 0.0 for one in run.executed)


def test_each_shaft_of_a_chain_has_its_own_limit() -> None:
    chain = Chain.load("crane-4-mass")
    chain = chain.replace(
        shafts=[one.replace(damping_ratio=0.02, permissible_torque=1000.0 * (k + 1))
                for k, one in enumerate(chain.shafts)],
    )  # fmt: skip
    run = run_duty(chain, "ramp", Duty([DutyStep("start")]))
    single = simulate(chain, "ramp")
    (margin,) = run.margins_of(run.rows[0])
    assert margin.name == "permissible torque"
    assert margin.value == single.used_torque
    shafts = run.sheet.tables[1]
    assert [row[0] for row in shafts.rows] == list(chain.shaft_names)
    assert [float(row[-1]) for row in shafts.rows] == pytest.approx(100.0 * single.utilisation, abs=0.051)
    assert len(run.life().shafts) == 3


def test_a_start_time_is_a_settled_time_where_the_speed_is_held() -> None:
    run = run_duty(CRANE, "speed-ramp", Duty([DutyStep("start"), DutyStep("stop")]))
    start = run.rows[0]
    assert [one.name for one in run.margins_of(start)] == ["shaft torque", "settled time"]
    assert run.executed[0].start_time == simulate(CRANE, "speed-ramp").settled_time
    assert start.start_time == max(one.start_time for one in run.executed if one.number == 1)
    assert how_of(run, run.rows[1]) == "strategy"
    assert "settled\ns" in [column.heading for column in run.tables[0].columns]


# ---- words and figures ------------------------------------------------------------------------------------


def test_the_table_says_how_each_step_was_done() -> None:
    run = ramp()
    assert [how_of(run, row) for row in run.rows] == [
        "strategy", "holding torque", "plugging", "torque (default)", "torque (default)",
    ]  # fmt: skip
    text = text_of(run)
    assert "ramp cannot stop: its stops are by torque (default)." in text
    assert "Plugging: ramp cannot reverse" in text
    asked = Duty([DutyStep("start"), DutyStep("stop", by="coast")])
    other = run_duty(CRANE, "ramp", asked, stop="torque")
    assert how_of(other, other.rows[1]) == "coast"
    assert "configured" not in text_of(other)


def test_a_jog_that_does_not_move_the_load_is_not_gentle() -> None:
    """An s-curve of 10 s is, in a jog of 0.1 s, hardly above the friction of the load; `direct` moves it."""
    jog = Duty([DutyStep("jog", time=0.1, by="coast")])
    slow = run_duty(CRANE, "s-curve", jog, parameters={"time": 10.0})
    assert min(one.angle for one in slow.executed) < 0.01 * 0.1 * CRANE.target_speed
    assert "Step 1, jog: the load hardly moves, or the wrong way, under s-curve" in text_of(slow)
    assert "hardly moves" not in text_of(run_duty(CRANE, "direct", jog))


def test_a_shift_that_leaves_no_time_for_a_cycle_is_said() -> None:
    """3600 s an hour over the time of a cycle are the most cycles of an hour."""
    most = 3600.0 / ramp().cycle_time
    for share, says in ((0.999, False), (1.001, True)):
        duty = THERE_AND_BACK.replace(shift=Shift(cycles_per_hour=share * most))
        text = text_of(run_duty(CRANE, "ramp", duty))
        assert ("for a cycle, which takes longer under ramp" in text) == says


def test_a_stop_is_configured_where_it_is_not_the_default() -> None:
    run = run_duty(CRANE, "ramp", THERE_AND_BACK, stop="coast")
    assert how_of(run, run.rows[3]) == "coast (configured)"


def test_a_step_in_words_has_the_units_of_the_machine() -> None:
    hoist = Drive.load("hoist-15kw")
    step = DutyStep("start", set_speed="-880 rpm")
    assert asked_of(step, hoist) == "start -880 rpm"
    assert asked_of(DutyStep("load", torque=3, inertia=0.1), hoist) == "load torque 3 N m, inertia 0.1 kg m2"
    assert asked_of(DutyStep("stop", by="torque", braking_torque=20), CRANE) == "stop braking torque 20 N m"


@pytest.mark.slow
def test_the_figure_has_the_trace_and_the_steps() -> None:
    run = ramp()
    figure = duty_figure(run)
    torques, speeds = figure.axes
    motor, shaft = torques.get_lines()[:2]
    assert shaft.get_ydata().max() == pytest.approx(run.worst.peak_torque, rel=1e-9)
    assert motor.get_xdata()[-1] == run.executed[-1].end
    vertical = [line for line in speeds.get_lines() if len(set(line.get_xdata())) == 1]
    assert [line.get_xdata()[0] for line in vertical] == [one.begin for one in run.executed]
    assert {text.get_text().strip() for text in torques.texts} >= {"3 reverse", "4 stop"}
    step = worst_recorded(run)
    closer = duty_figure(run, step).axes[0].get_xlim()
    assert closer[1] == step.end
    assert step.number == run.worst.number


def test_the_trace_has_all_peaks_and_a_bounded_number_of_instants(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where many shafts rattle, of which the small reversals are left out."""
    whole = run_duty(CRANE, "ramp", THERE_AND_BACK)
    assert whole.t.size > 3000
    monkeypatch.setattr("softstart.start.duty.MOST_INSTANTS", 40)
    few = run_duty(CRANE, "ramp", THERE_AND_BACK)
    assert few.t.size < whole.t.size
    for run in (whole, few):
        for one in run.executed:
            inside = (run.t >= one.begin) & (run.t < one.end)
            torque = run.traces["T"][inside, 0]
            assert torque.max() == pytest.approx(one.largest[0], abs=1e-2 * one.peak_torque)
            assert torque.min() == pytest.approx(one.smallest[0], abs=1e-2 * one.peak_torque)


@pytest.mark.slow
def test_a_duty_in_a_notebook_and_as_one_line() -> None:
    run = ramp()
    assert repr(run).startswith("<DutyRun: Crane travel drive 4AMTKF(H)112L6: duty under ramp. Worst step: 4")
    assert "<svg" in run._repr_html_()
    assert run.to_dataframe()["step"].tolist() == [one.number for one in run.executed]


# ---- several strategies -----------------------------------------------------------------------------------


def test_strategies_side_by_side() -> None:
    table = compare_duty(CRANE, ["ramp", "speed-ramp"], THERE_AND_BACK)
    assert [row.name for row in table.rows] == ["ramp", "speed-ramp"]
    assert [row.name for row in table.ranked] == ["speed-ramp", "ramp"]
    direct = run_duty(CRANE, "direct", THERE_AND_BACK).life().worst.damage
    for row in table.rows:
        assert row.life is not None
        assert row.relative == pytest.approx(direct / row.life.worst.damage, rel=1e-12)
    assert table.rows[0].k_dyn == ramp().k_dyn
    (shown,) = table.tables
    headings = [column.heading for column in shown.columns]
    assert headings[:6] == ["strategy", "K\n1 start", "K\n2 hold", "K\n3 reverse", "K\n4 stop", "K\n5 jog"]
    assert "ramp" in " ".join(table.notes)


def test_what_no_strategy_keeps_is_named() -> None:
    """A stop by the torque of the motor exceeds the limit, whatever the strategy."""
    duty = Duty([DutyStep("start"), DutyStep("hold", time=0.2), DutyStep("stop", by="torque")])
    table = compare_duty(CRANE.replace(permissible_start_time=None), ["ramp", "speed-ramp"], duty)
    assert (
        "No strategy keeps all limits; each exceeds one in step 3, stop (by torque, not by the strategy)."
        in table.sheet.conclusions
    )


def test_a_sentence_of_several_strategies_stands_once() -> None:
    duty = Duty([DutyStep("start"), DutyStep("stop")])
    with pytest.raises(InputError):
        compare_duty(CRANE.replace(minimum_torque=0.0), ["ramp", "direct"], duty, stop="torque")
    table = compare_duty(
        CRANE.replace(minimum_torque=0.0), ["ramp", "direct", "speed-ramp"], duty, stop="torque"
    )
    (note,) = (note for note in table.notes if "has no braking torque" in note)
    assert note.startswith("ramp, direct: ")


def test_the_map_strikes_out_what_exceeds_a_limit() -> None:
    """A line through each cell whose step exceeds a limit; the first row is above."""
    table = compare_duty(CRANE, ["ramp", "speed-ramp"], THERE_AND_BACK)
    (axes,) = table.figures["duty"]().axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["speed-ramp", "ramp"]
    struck = {
        (round(float(np.mean(one.get_xdata()))), round(float(np.mean(one.get_ydata())))) for one in axes.lines
    }
    runs = [row.run for row in reversed(table.rows)]
    broken = {
        (step, row)
        for row, run in enumerate(runs)
        for step, one in enumerate(run.rows if run else ())
        if run and not all(margin.kept for margin in run.margins_of(one))
    }
    assert struck == broken != set()


def test_a_duty_that_cannot_be_finished_has_a_sentence() -> None:
    """direct cannot stop by itself, which the duty asks for."""
    duty = Duty([DutyStep("start"), DutyStep("stop", by="strategy")])
    table = compare_duty(CRANE, ["direct", "speed-ramp"], duty)
    direct, held = table.rows
    assert direct.run is None
    assert 'by = "strategy"' in direct.reason
    assert held.run is not None
    assert math.isnan(held.relative)  # without direct
    assert table.tables[0].rows[0][1] == "-"
    assert any(note.startswith("direct: ") for note in table.notes)
    assert table.summary()["strategies"][0] == {"controller": "direct", "reason": direct.reason}
    with pytest.raises(InputError, match='by = "strategy"'):
        compare_duty(CRANE, ["direct", "ramp"], duty)


def test_estimated_damping_is_that_of_fatigue() -> None:
    bare = Drive.load("crane-4amtkf").replace(start_position="mid-gap")
    table = compare_duty(bare, ["direct"], START, estimate_damping={"gears": 3, "couplings": 2})
    lives = fatigue(simulate(bare, "direct"), estimate_damping={"gears": 3, "couplings": 2})
    assert table.drive == lives.drive
    assert table.rows[0].life is not None
    assert table.rows[0].life.worst.equivalent_torque == lives.rows[0].equivalent_torque
    assert any("from 3 gears and 2 couplings" in note for note in table.notes)
    without = compare_duty(bare, ["direct"], START)
    assert without.rows[0].life is None
    assert without.no_life.startswith("damping is missing")
