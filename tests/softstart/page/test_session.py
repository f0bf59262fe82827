"""The state of one user: exact figures, and a mistake that changes nothing."""

from __future__ import annotations

import json
import zlib
from base64 import urlsafe_b64decode, urlsafe_b64encode
from collections import OrderedDict
from itertools import takewhile

import pytest

from softstart import DataSheet, Drive, InputError, compare, simulate
from softstart.controller import Command, PlainController, make_controller
from softstart.page import links
from softstart.page.frames import FrameBuilder
from softstart.page.frames import row as row_of_table
from softstart.page.links import inputs_of, link_of
from softstart.page.session import MAX_STRATEGIES, Session
from softstart.start.comparison import SOFT_END
from softstart.start.recommendation import CASES


class Failing(PlainController):
    name = "failing"

    def step(self, measured, state):
        raise ZeroDivisionError("no way")


def test_all_figures_are_those_of_compare_to_the_bit():
    session = Session()
    session.set_all({"shaft.gap": "0.7 rad", "shaft.damping": 0.4})
    for row, strategy in zip(compare(session.inputs.machine).rows, session.strategies, strict=True):
        assert strategy.name == row.run.controller.name
        assert strategy.k_dyn == row.run.k_dyn
        assert strategy.start_time == row.run.start_time
        list(session.compute_row(strategy.name))
        assert session.row(strategy.name).k_dyn_worn_gap == row.k_dyn_worn_gap
        assert session.row(strategy.name).settled_lost == row.settled_lost


TROLLEY = {
    "load.machine": "trolley", "load.mass": "6.5 t", "load.diameter": "315 mm", "motor.rated_power": "3 kW",
    "motor.rated_speed": "1410 rpm", "motor.inertia": "0.0062 kg*m^2", "motor.starting_ratio": 2.2,
    "gear.ratio": 38.1, "gear.backlash": "9 arcmin", "limits.output_torque": "2.3 kN*m",
}  # fmt: skip


def test_a_drive_without_stiffness_is_shown_at_both_ends_as_compare_does():
    """Each K_dyn and each verdict to the bit; also with another gap, in the tab of a link, and undone."""
    names = ["direct", "ramp"]
    session = Session(DataSheet.from_settings(TROLLEY).drive, controllers=names)

    def agree(shown, ends):
        # the page takes strategies as they are set there; one of which a time is given `compare` does, too
        time = {"ramp": {"time": 2.0 * float(shown.inputs.machine.elastic_period)}}
        table, rows = compare(ends, names, parameters=time), {}
        frames = (frame for frame in FrameBuilder(shown).idle_frames() if frame)
        for frame in takewhile(lambda frame: "map" not in frame, frames):
            rows |= {row["name"]: row for row in frame.get("rows", [])}
            if "recommendation" in frame:
                assert frame["recommendation"].startswith(table.recommendation.text)
                assert "No stiffness is known" in frame["recommendation"]
        assert {row.name: row.cases[SOFT_END].k_dyn for row in table.rows} == {
            name: row["soft"] for name, row in rows.items()
        }
        assert [rows[row.name]["limits"] for row in table.rows] == [row.against_limits for row in table.rows]

    stiff = session.inputs.machine_in_units
    assert stiff == DataSheet.from_settings(TROLLEY).drive
    agree(session, DataSheet.from_settings(TROLLEY))
    session.set("shaft.gap", "5 arcmin at output")
    changed = stiff.replace(gap=session.inputs.machine.gap)
    agree(session, changed)
    other = Session(controllers=names)
    other.restore(inputs_of(link_of(session.inputs), other.inputs))
    agree(other, changed)
    session.set("shaft.damping", 0.0)
    assert session.inputs.soft_drive.damping == 0.0
    session.set("shaft.stiffness", "35 kN*m/rad at output")  # it is known by now
    assert session.inputs.soft_drive is None
    list(session.compute_row("direct"))
    assert session.row("direct").worst_case == CASES
    session.undo()
    session.undo()
    assert session.inputs.soft_drive == changed.soft
    session.load(Drive.load("crane-4amtkf"))
    assert session.inputs.soft_drive is None  # nothing of it is unknown


def test_an_assumption_is_shown_until_its_value_is_set():
    """The stiffness that is typed is known; an undo, or a slider back at its place, brings the text back."""
    session = Session(DataSheet.from_settings(TROLLEY).drive, controllers=["direct"])

    def shown():
        frames = (frame for frame in FrameBuilder(session).idle_frames() if frame)
        return next(frame["assumed"] for frame in frames if "assumed" in frame)

    as_loaded, stiffness = shown(), session.inputs.machine.stiffness
    assert [text for text in as_loaded if text.startswith("elastic frequency 30 Hz")]
    session.set("stiffness", "40 N*m/rad")
    assert shown() == [text for text in as_loaded if not text.startswith("elastic frequency")]
    assert "elastic frequency" not in session.inputs.machine.to_toml()
    session.set("stiffness", stiffness)
    assert shown() == as_loaded
    assert session.inputs.soft_drive == session.inputs.origin.soft
    session.set("shaft.damping", 0.0)
    assert shown() == [text for text in as_loaded if not text.startswith("damping ratio")]
    session.undo()
    assert shown() == as_loaded
    session.set("load.inertia", "0.1 kg*m^2")
    assert shown() == as_loaded
    session.set("load.torque", "2 N*m")  # all that the resistance was for
    assert shown() == [text for text in as_loaded if not text.startswith("resistance")]


@pytest.mark.parametrize(("time", "selected"), [("0.2 s", "ramp"), ("1 s", "direct")])
def test_the_gentlest_takes_no_more_than_twice_the_time_of_direct(time, selected):
    """A ramp of 1 s has a lower K_dyn, and takes 2.3 times as long."""
    session = Session(controllers=["direct", "ramp"])
    session.select("ramp")
    session.set_parameter("time", time)
    session.offer()
    assert session.inputs.selected == selected
    assert session.result("ramp").k_dyn < session.result("direct").k_dyn


def test_what_is_recommended_is_selected_until_the_user_selects_another_one():
    session = Session(controllers=["direct", "ramp"])
    session.offer()
    session.set("limits.shaft_torque", 200.0)
    before = session.steps
    session.follow(session.recommendation())
    assert session.inputs.selected == session.recommendation().recommended.name == "ramp"
    assert session.steps == before  # it is no step to undo
    session.select("direct")
    session.set("limits.shaft_torque", 210.0)
    session.follow(session.recommendation())
    assert session.inputs.selected == "direct"


def test_of_stored_inputs_the_latest_stay(monkeypatch):
    monkeypatch.setattr(links, "MAX_STORED", 2)
    monkeypatch.setattr(links, "_stored", OrderedDict())
    first, second, third = (Session(controllers=["direct"]) for _ in range(3))
    known = [links.store(one) for one in (first, second, first, third)]
    assert links.stored(*known[0]) is first.inputs  # kept again after the second
    assert links.stored(*known[1]) is None
    assert links.stored(*known[3]) is third.inputs


def test_undo_and_redo_go_through_every_change():
    session = Session(controllers=["direct", "ramp"])
    seen = [session.inputs]
    for change in (
        lambda: session.set("shaft.gap", 1.0),
        lambda: session.select("ramp"),
        lambda: session.set_parameter("time", 0.2),
        lambda: session.add("mine", make_controller("s-curve")),
        lambda: session.remove("direct"),
        lambda: session.load(Drive.load("servo-axis-small")),
    ):
        change()
        seen.append(session.inputs)
    assert session.steps == (6, 0)
    for inputs in reversed(seen[:-1]):
        session.undo()
        assert session.inputs is inputs
    session.undo()  # nothing is left
    assert session.inputs is seen[0]
    assert session.result("direct").k_dyn == simulate(session.inputs.machine, "direct").k_dyn
    for inputs in seen[1:]:
        session.redo()
        assert session.inputs is inputs
    session.undo()
    session.set("shaft.gap", 0.25)
    assert session.steps == (6, 0)  # a new change ends what could be redone


def test_a_drag_is_one_step_and_results_follow_undo(monkeypatch):
    session = Session(controllers=["direct"])
    for gap in (0.6, 0.7, 0.8):
        session.set_all({"shaft.gap": gap}, gesture="shaft.gap")
    session.set_all({"load.inertia": 0.2}, gesture="load.inertia")
    assert session.steps == (2, 0)
    monkeypatch.setattr("softstart.page.session.PAUSE", -1.0)  # as if the hand had rested
    session.set_all({"load.inertia": 0.3}, gesture="load.inertia")
    assert session.steps == (3, 0)
    session.undo()
    session.undo()
    assert session.inputs.machine.gap == 0.8
    assert session.result("direct").k_dyn == simulate(session.inputs.machine, "direct").k_dyn
    session.undo()
    assert session.inputs.machine.gap == 0.5
    assert session.result("direct").k_dyn == simulate(session.inputs.machine, "direct").k_dyn


def test_a_link_brings_back_drive_strategies_and_selection():
    session = Session()
    session.set_all({"shaft.gap": 0.1 + 0.2, "name": "Kran \u00e4, <b>"})
    session.select("shaped")
    session.set_parameter("shaper", "zvd")
    session.show("ramp")
    session.add("mine", make_controller("s-curve"))  # a label of the user's own stands for a file
    session.select("shaped")
    other = Session()
    other.restore(inputs_of(link_of(session.inputs), other.inputs))
    assert other.inputs.machine == session.inputs.machine
    assert other.inputs.origin == session.inputs.origin
    assert (other.inputs.selected, other.inputs.controllers["shaped"].shaper) == ("shaped", "zvd")
    assert set(other.inputs.drawn) == {*session.inputs.drawn} - {"mine"}
    assert other.result("shaped").k_dyn == session.result("shaped").k_dyn


def test_at_equal_time_the_table_is_that_of_compare_and_switching_off_restores_it():
    """Each figure to the bit; the switch is a step to undo and travels in the link."""
    names = ["direct", "s-curve", "take-up"]
    session = Session(controllers=names)
    as_set = table(session)
    session.set_at_time("1.1x")
    assert all(line["k_dyn"] is None for line in table(session))  # until it is computed
    list(FrameBuilder(session).idle_frames())
    comparison = compare(session.inputs.machine, names, at_time="1.1x")
    assert [one.name for one in comparison.too_slow] == ["take-up"]
    lines = {line["name"]: line for line in table(session)}
    for expected in comparison.rows:
        line = lines[expected.name]
        assert (line["k_dyn"], line["set_to"]) == (expected.run.k_dyn, expected.set_to)
        assert line["worn"] == expected.k_dyn_worn_gap
        assert line["settled"] <= comparison.at_time
    slow = lines["take-up"]
    assert (slow["k_dyn"], slow["flag"]) == (None, "too slow")
    assert slow["trouble"] == comparison.too_slow[0].within(comparison.at_time)
    assert session.lowest_at_equal_time() == comparison.at_equal_time
    other = Session(controllers=names)
    other.restore(inputs_of(link_of(session.inputs), other.inputs))
    assert other.inputs.at_time == "1.1x"
    session.undo()
    assert [line["k_dyn"] for line in table(session)] == [line["k_dyn"] for line in as_set]
    session.redo()
    assert table(session) == list(lines.values())  # still known
    session.set("gap", 1.0)
    assert table(session)[1]["k_dyn"] is None  # of another machine
    session.set_at_time("")
    assert table(session)[1]["k_dyn"] == simulate(session.inputs.machine, "s-curve").k_dyn


def table(session):
    return [row_of_table(session, result) for result in session.strategies]


@pytest.mark.parametrize("text", ["soon", "0x", "-1 s", "0.3 m", "11x", "1e9 s", "nan", "1" * 50])
def test_a_time_that_sets_nothing_is_refused_and_in_a_link_it_is_said(text):
    session = Session(controllers=["s-curve"])
    with pytest.raises(InputError):
        session.set_at_time(text)
    assert (session.inputs.at_time, session.steps) == ("", (0, 0))
    content = unpacked(link_of(session.inputs)) | {"at_time": text}
    session.restore(inputs_of(packed(content), session.inputs))
    list(FrameBuilder(session).idle_frames())
    line = table(session)[0]
    assert line["k_dyn"] is None
    assert line["trouble"]


def test_a_reference_stays_while_drive_and_strategies_change_and_travels_in_the_link():
    session = Session()
    session.select("ramp")
    session.set("shaft.gap", "4 deg")
    kept = simulate(session.inputs.machine, "ramp").k_dyn
    session.set_reference()
    session.set_parameter("time", "200 ms")
    session.set("shaft.gap", 1.0)
    assert session.reference().k_dyn == kept
    assert session.result("ramp").k_dyn != kept
    other = Session()
    other.restore(inputs_of(link_of(session.inputs), other.inputs))
    assert other.reference().k_dyn == kept
    session.load(Drive.load("servo-axis-small"))  # two drives
    assert session.reference().k_dyn == kept
    session.set_reference(False)
    assert session.reference() is None
    assert inputs_of(link_of(session.inputs), other.inputs).reference is None
    session.undo()
    assert session.reference().k_dyn == kept


def packed(content) -> str:
    text = content if isinstance(content, bytes) else json.dumps(content).encode()
    return urlsafe_b64encode(zlib.compress(text)).decode()


def unpacked(link):
    return json.loads(zlib.decompress(urlsafe_b64decode(link + "=" * (-len(link) % 4))))


def test_a_link_that_is_not_one_is_refused_in_a_sentence_and_names_no_code():
    """Not even where it holds some of one; only strategies that the page has are given parameters."""
    now = Session(controllers=["direct"]).inputs
    content = unpacked(link_of(Session(controllers=["direct"]).inputs))
    parts = [{"parameters": {"direct": [1]}}, {"parameters": 3}, {"drawn": 3}, {"drive": 3}, {"reference": 3},
             {"reference": {"label": "direct", "drive": 3, "parameters": {}}}]  # fmt: skip
    whole = ["x", "%%%", "A" * 20_000, "\u00e4", *map(packed, (b"[1]", b"[" * 60_000, b"[" * 5_000_000))]
    for link in (*whole, *(packed(content | one) for one in parts)):
        with pytest.raises(InputError, match="copy the whole link again"):
            inputs_of(link, now)
    assert inputs_of(packed(content | {"selected": [1]}), now).selected == "direct"
    evil = {"parameters": {"evil.py:Evil": {}, "gains.toml": {}}, "selected": "evil.py:Evil"}
    inputs = inputs_of(packed(content | evil | {"drawn": ["gains.toml"]}), now)
    assert dict(inputs.controllers) == dict(now.controllers)
    assert (inputs.selected, inputs.visible) == ("direct", frozenset())


def test_a_failing_controller_is_a_sentence_in_its_row():
    session = Session(controllers=["direct"])
    label = session.add("mine", Failing())
    found = session.result(label)
    assert found.run is None
    assert "ZeroDivisionError" in found.status
    assert "Traceback" not in found.status
    assert found.k_dyn != found.k_dyn
    assert session.inputs.selected == "mine"
    session.remove(label)
    assert session.inputs.selected == "direct"
    with pytest.raises(InputError, match="last strategy"):
        session.remove("direct")


def test_an_added_controller_joins_with_its_own_figures():
    session = Session(controllers=["direct"])
    soft = make_controller("ramp", {"time": "300 ms"})
    assert session.add("  ramp  300 ms ", soft, select=False) == "ramp 300 ms"
    assert session.result("ramp 300 ms").k_dyn == simulate(session.inputs.machine, soft).k_dyn
    assert session.inputs.drawn == ("direct", "ramp 300 ms")
    for number in range(MAX_STRATEGIES - 2):
        session.add(f"more {number}", soft)
    with pytest.raises(InputError, match="remove one first"):
        session.add("too many", soft)


def test_what_was_computed_for_a_machine_does_not_survive_another_one():
    session = Session(controllers=["direct", "ramp"])
    session.select("ramp")
    session.set_parameter("time", "200 ms")
    session.add("optimum 0.4 s", make_controller("s-curve"))
    session.set("gap", 1.0)
    assert session.inputs.selected == "optimum 0.4 s"  # it stays while values of this machine change
    link = link_of(Session("hoist-15kw").inputs)
    assert set(inputs_of(link, session.inputs).controllers) == {"direct", "ramp"}
    session.load(Drive.load("hoist-15kw"))
    assert (list(session.inputs.controllers), session.inputs.selected) == (["direct", "ramp"], "direct")
    assert session.inputs.controllers["ramp"].time == 0.2
    session.undo()
    assert "optimum 0.4 s" in session.inputs.drawn
    session.undo()
    assert set(inputs_of(link_of(session.inputs), session.inputs).controllers) == {
        "direct",
        "ramp",
        "optimum 0.4 s",
    }


def test_a_start_with_too_many_events_waits_for_rest():
    class Busy(PlainController):
        def step(self, measured, state):
            return Command(62.0, measured.time + 1e-4)

    session = Session(controllers=["direct"])
    session.add("busy", Busy())
    quick = session.result("busy", max_events=100)
    assert quick.run is None
    assert session.ready("busy") is None  # given up for now, not for good
    assert session.result("busy").k_dyn == pytest.approx(session.result("direct").k_dyn, rel=1e-12)
