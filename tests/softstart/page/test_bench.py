"""The state of one user: exact figures, and a mistake that changes nothing."""

from __future__ import annotations

import contextlib
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart import Drive, InputError, compare, simulate
from softstart.controller import Command, PlainController, make_controller
from softstart.page.bench import MAX_STRATEGIES, Bench
from softstart.page.command_text import command_text


class Failing(PlainController):
    name = "failing"

    def step(self, measured, state):
        raise ZeroDivisionError("no way")


def test_all_figures_are_those_of_compare_to_the_bit():
    bench = Bench()
    bench.set_all({"shaft.gap": "0.7 rad", "shaft.damping": 0.4})
    for row, strategy in zip(compare(bench.drive).rows, bench.strategies, strict=True):
        assert strategy.name == row.run.controller.name
        assert strategy.k_dyn == row.run.k_dyn
        assert strategy.start_time == row.run.start_time
        assert bench.worn(strategy.name) == row.k_dyn_worn_gap
        assert bench.time_lost(strategy.name) == row.time_lost


def test_set_takes_numbers_and_texts_and_counts_changes():
    bench = Bench(controllers=["direct"])
    calls = []
    stop = bench.on_change(lambda: calls.append(bench.version))
    bench.set("shaft.gap", 0.1 + 0.2)
    assert bench.drive.gap == 0.1 + 0.2  # to the bit, not through a rounded text
    bench.set("target_speed", "880 rpm")
    stop()
    bench.set("load.kind", "reactive")
    assert calls == [1, 2]
    assert bench.version == 3
    assert bench.drive.load_kind == "reactive"


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("shaft.gap", "-1", "0 or more"),
        ("shaft.gap", "4 m", "length"),
        ("shaft.gap", "[1, 2]", "gap"),
        ("motor.starting_torque", "7 N*m", "starting_torque"),
        ("load.inertia", float("nan"), "not a number"),
        ("nothing.here", 1.0, "no parameter"),
        ("load.kind", "rective", "reactive"),
    ],
)
def test_a_mistake_is_a_sentence_and_changes_nothing(path, value, said):
    bench = Bench(controllers=["direct"])
    before, known = bench.drive, bench.result("direct")
    with pytest.raises(InputError, match=said):
        bench.set(path, value)
    assert bench.drive is before
    assert bench.version == 0
    assert bench.result("direct") is known


def test_several_changes_are_one_step_or_none():
    bench = Bench(controllers=["direct"])
    with pytest.raises(InputError):
        bench.set_all({"shaft.gap": 1.0, "load.inertia": -1.0})
    assert bench.drive.gap == 0.5
    bench.set_all({"shaft.gap": 1.0, "load.inertia": 0.1})
    assert (bench.drive.gap, bench.drive.J2, bench.version) == (1.0, 0.1, 1)


@settings(max_examples=40, deadline=None)
@given(st.text(max_size=40), st.text(max_size=40))
def test_no_text_whatever_breaks_the_bench(path, text):
    bench = Bench(controllers=["direct"])
    before = bench.drive
    for change in (lambda: bench.set(path, text), lambda: bench.load(text)):
        with contextlib.suppress(InputError):
            change()
        assert bench.drive is before or bench.version > 0
        assert bench.result("direct").k_dyn > 0.0


def test_load_takes_a_file_or_leaves_everything():
    bench = Bench(controllers=["direct"])
    other = Drive.load("nordin-servo-60kw")
    bench.load(other.to_toml())
    assert bench.drive == bench.origin == other
    with pytest.raises(InputError, match=r"mine.toml: \[shaft\]"):
        bench.load(other.to_toml().replace("gap =", "gapp ="), where="mine.toml")
    assert bench.drive == other


def test_a_failing_controller_is_a_sentence_in_its_row():
    bench = Bench(controllers=["direct"])
    label = bench.add("mine", Failing())
    found = bench.result(label)
    assert found.run is None
    assert "ZeroDivisionError" in found.status
    assert "Traceback" not in found.status
    assert found.k_dyn != found.k_dyn
    assert bench.selected == "mine"
    bench.remove(label)
    assert bench.selected == "direct"
    with pytest.raises(InputError, match="last strategy"):
        bench.remove("direct")


def test_an_added_controller_joins_with_its_own_figures():
    bench = Bench(controllers=["direct"])
    soft = make_controller("ramp", {"time": "300 ms"})
    assert bench.add("  ramp  300 ms ", soft, select=False) == "ramp 300 ms"
    assert bench.result("ramp 300 ms").k_dyn == simulate(bench.drive, soft).k_dyn
    assert bench.shown == ("direct", "ramp 300 ms")
    for number in range(MAX_STRATEGIES - 2):
        bench.add(f"more {number}", soft)
    with pytest.raises(InputError, match="remove one first"):
        bench.add("too many", soft)


def test_the_selected_strategy_is_always_one_of_those_drawn():
    bench = Bench(controllers=["direct", "ramp"])
    bench.show("direct", visible=False)
    assert bench.shown == ("direct",)
    assert command_text(bench.drive, {label: bench.controllers[label] for label in bench.shown}).endswith(
        "--controllers direct"
    )
    bench.select("ramp")
    assert bench.shown == ("ramp",)
    bench.add("tuned", make_controller("ramp"))
    bench.remove("tuned")
    assert bench.selected in bench.shown


def test_a_start_with_too_many_events_waits_for_rest():
    class Busy(PlainController):
        def step(self, measured, state):
            return Command(62.0, measured.time + 1e-4)

    bench = Bench(controllers=["direct"])
    bench.add("busy", Busy())
    quick = bench.result("busy", max_events=100)
    assert quick.run is None
    assert bench.ready("busy") is None  # given up for now, not for good
    assert bench.result("busy").k_dyn == pytest.approx(bench.result("direct").k_dyn, rel=1e-12)


def test_an_unknown_strategy_is_told_with_the_nearest_name():
    with pytest.raises(InputError, match="did you mean ramp"):
        Bench().select("rammp")


def test_state_and_server_need_no_nicegui_until_the_page_is_built():
    code = (
        "import sys, softstart.page.serve, softstart.page.layout, softstart.page.bench, softstart.cli.serve;"
        "sys.exit('nicegui' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
