"""Following a hand: the newest drive wins, nothing queues up, mistakes stay beside their fields."""

from __future__ import annotations

import asyncio
import json
import math
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from softstart import InputError, simulate
from softstart.controller import make_controller
from softstart.controller.tuned import RobustGains
from softstart.drive.plausibility import plausibility_warnings
from softstart.page import links
from softstart.page.controls import Controls
from softstart.page.downloads import command_text
from softstart.page.frames import FrameBuilder
from softstart.page.live import MAX_QUICK, WINDOW, Live
from softstart.page.machines import STEPS, axes_about, parameter_fields
from softstart.page.panels import grid_of
from softstart.page.session import Session
from softstart.quantities import parse
from softstart.views.numbers import units_of


class Line:
    """A line to a browser that draws a frame some turns of the loop after it was sent, or never."""

    def __init__(self) -> None:
        self.frames: list[tuple[int, dict[str, Any]]] = []
        self.most_on_their_way = 0
        self.live: Live | None = None
        self.draws = True

    def send(self, number: int, frame: dict[str, Any]) -> None:
        json.dumps(frame, allow_nan=False)  # it can go over a line
        self.frames.append((number, frame))
        if number:
            self.most_on_their_way = max(self.most_on_their_way, self.live.on_their_way)
            if self.draws:
                asyncio.get_running_loop().call_later(0.002, self.live.drawn, number)


async def until(true) -> None:
    """Wait for a condition; a busy machine may take its time."""
    async with asyncio.timeout(120.0):
        while not true():
            await asyncio.sleep(0.005)


async def followed(session: Session, hand, line: Line | None = None) -> Line:
    """Run a page without a browser while `hand` moves."""
    line = line or Line()
    frames = FrameBuilder(session)
    live = line.live = Live(frames, line.send)
    controls = Controls(session, frames, live.poke)
    session.on_change(live.poke)
    task = asyncio.create_task(live.run())
    await asyncio.sleep(0.01)
    assert not line.frames  # a page that is not there yet would be built twice
    controls.take({"what": "hello", "stored": None, "link": ""})
    try:
        await hand(controls, line)
    finally:
        task.cancel()
    return line


def rows_of_map(line: Line) -> dict[int, Any]:
    return {frame["map_row"]["index"]: frame for _, frame in line.frames if "map_row" in frame}


def test_the_last_step_of_a_hand_always_arrives_and_frames_never_pile_up():
    session = Session(controllers=["direct", "ramp", "shaped"])

    async def hand(controls, line):
        for position in range(100, 400, 5):
            controls.take({"what": "slide", "path": "shaft.gap", "position": position, "stamp": position})
            await asyncio.sleep(0)
        await until(lambda: "map_row" in line.frames[-1][1])  # the last thing that is done at rest

    line = asyncio.run(followed(session, hand))
    assert line.most_on_their_way <= WINDOW
    frames = [frame for number, frame in line.frames if number and "figure" in frame]
    assert len(frames) < 60  # coalesced
    assert frames[-1]["stamp"] == 395
    assert frames[-1]["figure"]["k_dyn"] == simulate(session.inputs.machine, "direct").k_dyn
    rows = {}
    for _, frame in line.frames:
        rows |= {row["name"]: row for row in frame.get("rows", [])}
    for name in session.inputs.controllers:
        assert rows[name]["k_dyn"] == simulate(session.inputs.machine, name).k_dyn
        assert rows[name]["worn"] == session.row(name).k_dyn_worn_gap


def test_every_step_has_its_quick_frame_until_the_browser_stops_drawing():
    session = Session(controllers=["direct"])

    async def hand(controls, line):
        await until(lambda: line.frames and line.live.on_their_way == 0)
        line.frames.clear()
        line.draws = False
        for position in range(MAX_QUICK + 20):
            controls.take({"what": "slide", "path": "shaft.gap", "position": position + 100})

    line = asyncio.run(followed(session, hand))
    assert len([number for number, _ in line.frames if number == 0]) == MAX_QUICK


def test_a_map_left_half_way_is_old_until_all_its_rows_have_come():
    """Going back to the strategy before does not make the rows of both a map of one."""
    session = Session(controllers=["direct", "ramp"])

    async def hand(controls, line):
        await until(lambda: len(rows_of_map(line)) == 17)
        controls.take({"what": "select", "name": "ramp"})
        await until(lambda: any(row["map"]["strategy"] == "ramp" for row in rows_of_map(line).values()))
        controls.take({"what": "select", "name": "direct"})
        line.frames.clear()
        await until(lambda: len(rows_of_map(line)) == 17)
        (now,) = [frame for _, frame in line.frames if "map_is_old" in frame]
        assert now["map_is_old"]
        assert {row["map"]["strategy"] for row in rows_of_map(line).values()} == {"direct"}

    asyncio.run(followed(session, hand))


def test_what_fails_is_told_and_following_goes_on():
    line, told = Line(), []

    async def scene():
        frames = FrameBuilder(Session(controllers=["direct"]))
        whole, frames.main_frame = frames.main_frame, {}.popitem  # a KeyError
        line.live = Live(frames, line.send, told.append)
        task = asyncio.create_task(line.live.run())
        line.live.poke()
        await until(lambda: told)
        frames.main_frame = whole
        line.live.poke()
        await until(lambda: any("figure" in frame for number, frame in line.frames if number))
        task.cancel()

    asyncio.run(scene())
    assert ["KeyError" in one for one in told] == [True]


def controls_of(session: Session) -> tuple[Controls, FrameBuilder]:
    frames = FrameBuilder(session)
    return Controls(session, frames, lambda: None), frames


def test_a_mistake_stays_beside_its_field_until_it_is_mended():
    session = Session(controllers=["direct"])
    controls, frames = controls_of(session)
    controls.take({"what": "edit", "path": "shaft.gap", "text": "4 metres"})
    assert "not an angle" in frames.main_frame()["mistakes"]["shaft.gap"]
    controls.take({"what": "edit", "path": "load.torque", "text": "8"})
    assert list(frames.mistakes) == ["shaft.gap"]
    assert session.inputs.machine.gap == 0.5
    controls.take({"what": "edit", "path": "shaft.gap", "text": "4 deg"})
    assert not frames.mistakes
    shown = frames.main_frame()["fields"]["shaft.gap"]
    assert (shown["text"], shown["position"]) == ("4 deg", 21)  # the page stays in rad
    controls.take({"what": "edit", "path": "shaft.gap", "text": "1" * 100_000})
    assert frames.mistakes["shaft.gap"].startswith("Total gap: the text has more than 200 characters")
    controls.take({"what": "leave", "path": "shaft.gap"})  # Escape: the drive keeps every digit
    assert not frames.mistakes
    assert session.inputs.machine.gap == parse("4 deg", "rad")
    controls.take({"what": "reset", "path": "shaft.gap"})
    controls.take({"what": "reset", "path": "load.torque"})
    assert session.inputs.machine == session.inputs.origin
    session.load(session.inputs.machine.replace(gap=0.005))  # another drive brings its own sliders
    assert frames.main_frame()["mistakes"] == {}
    assert frames.entries["shaft.gap"].scale.high == max(frames.axes.gaps) == 0.02


def test_a_page_loaded_anew_goes_on_with_the_inputs_that_its_tab_has_stored():
    before = Session(controllers=["direct", "ramp"])
    before.set_all({"shaft.gap": 0.1 + 0.2, "name": 'my "own" drive'})
    tuned = RobustGains("robust", make_controller("ramp", {"time": 0.3}), before.inputs.machine)
    before.add("ramp (robust)", tuned)
    (kept,) = [frame["keep"] for frame in FrameBuilder(before).idle_frames() if frame and "keep" in frame]
    session = Session(controllers=["direct", "ramp"])
    controls, frames = controls_of(session)
    controls.take({"what": "hello", "stored": {**kept, "server": "of yesterday"}, "link": ""})
    assert session.inputs.machine == session.inputs.origin != before.inputs.machine
    controls.take({"what": "hello", "stored": kept, "link": kept["link"]})
    assert session.inputs.machine is before.inputs.machine
    assert session.inputs.controllers["ramp (robust)"] is tuned
    assert session.inputs.selected == "ramp (robust)"
    assert session.steps == (0, 0)
    assert not frames.mistakes
    assert len([frame for frame in frames.idle_frames() if frame and "keep" in frame]) == 1
    assert not [frame for frame in frames.idle_frames() if frame and "keep" in frame]  # not twice


@pytest.mark.parametrize("machine", ["crane-4amtkf", "crane-4-mass"])
def test_a_slider_sets_exactly_the_value_that_its_field_shows_and_no_other(machine):
    session = Session(machine, controllers=["direct"])
    controls, frames = controls_of(session)
    scales = {path: one.scale for path, one in parameter_fields(session.inputs.machine).items() if one.scale}
    for path, scale in scales.items():
        before = session.inputs.machine.parameters_by_path()
        for position in (0, 77, 300, STEPS):
            controls.take({"what": "slide", "path": path, "position": position})
            assert not frames.mistakes, path
            shown, si = frames.main_frame()["fields"][path], frames.entries[path].unit
            text, value = shown["text"], session.inputs.machine.parameters_by_path()[path][1]
            assert parse(session.inputs.units.typed(text, si), si) == value
            assert value == pytest.approx(scale.value(position), rel=1e-3)
            assert scale.low <= scale.value(position) <= scale.high
            assert shown["position"] == pytest.approx(position, abs=1)
        now = session.inputs.machine.parameters_by_path()
        assert {key for key in before if before[key] != now[key]} <= {path}
        session.load(session.inputs.origin)


@pytest.mark.parametrize(
    ("machine", "gap"), [("crane-4amtkf", "shaft.gap"), ("crane-4-mass", "shaft[1].gap")]
)
def test_angles_and_speeds_are_in_the_units_of_the_user(machine, gap):
    """In fields, sliders, plots, map, link and command; a bare number is one of them, and stays it."""
    session = Session(machine, controllers=["direct", "ramp"])
    controls, frames = controls_of(session)
    loaded = session.inputs.origin
    assert (session.inputs.units.angle, session.inputs.units.speed) == ("rad", "rpm")  # as its file has them
    controls.take({"what": "edit", "path": "units", "text": "deg, rad/s"})
    frame = frames.main_frame()
    rows = {row["path"]: row for group in frame["groups"] for row in group["rows"]}
    assert (rows[gap]["unit"], rows["start.target_speed"]["unit"]) == ("deg", "rad/s")
    first = loaded.parameters_by_path()[gap][1]
    assert float(frame["fields"][gap]["text"]) == pytest.approx(math.degrees(first), rel=1e-5)
    assert session.inputs.machine.parameters_by_path()[gap][1] == first  # only what is typed changes
    assert frame["traces"]["direct"]["units"]["angle"] == "deg"
    assert (frame["here"][0], frame["angle"][0]) == (loaded.gap_and_inertia[0], "deg")

    controls.take({"what": "edit", "path": gap, "text": "4"})
    assert session.inputs.machine.parameters_by_path()[gap][1] == parse("4 deg", "rad")
    controls.take({"what": "slide", "path": gap, "position": 77})
    text = frames.main_frame()["fields"][gap]["text"]
    assert len(text) <= 5
    assert f'"{text} deg"' in session.inputs.machine.to_toml()
    assert f"{gap}={text}deg" in command_text(session.inputs.machine, {"direct": make_controller("direct")})
    assert links.inputs_of(links.link_of(session.inputs), session.inputs).machine == session.inputs.machine
    controls.take({"what": "jump", "gap": math.radians(30.0), "inertia": loaded.gap_and_inertia[1]})
    assert frames.main_frame()["here"][0] == pytest.approx(math.radians(30.0), rel=1e-6)
    controls.take({"what": "edit", "path": "units", "text": "mm on 80 mm"})
    controls.take({"what": "edit", "path": gap, "text": "0.3"})
    assert session.inputs.machine.parameters_by_path()[gap][1] == 0.0075
    controls.take({"what": "edit", "path": "units", "text": "cubits"})
    assert 'write for example "deg, rpm, kN m, at output"' in frames.mistakes["units"]


@pytest.mark.parametrize(("ratio", "eta"), [(38.0, 0.9), (1.7, 1.0), (0.5, 0.8)])
def test_the_page_at_the_output_shows_and_takes_what_is_there(ratio, eta):
    """Angles i times smaller, torques i eta larger, stiffness and inertia i^2 eta.

    What belongs to the motor stays there, and K_dyn is the same; fields show six digits.
    """
    session = Session(controllers=["direct", "ramp"])
    controls, frames = controls_of(session)
    machine = session.inputs.machine
    controls.take({"what": "show_at", "output": True})
    assert 'without gear ratio nothing is "at output"' in frames.mistakes[""]
    for path, value in (("gear.ratio", ratio), ("gear.efficiency", eta), ("limits.shaft_torque", 90.0)):
        session.set(path, value)
    at_motor = frames.main_frame()
    assert (at_motor["at"], at_motor["no_output"]) == ("", "")
    controls.take({"what": "show_at", "output": True})
    frame = frames.main_frame()
    assert frame["at"] == ", at the output"
    assert frame["fields"]["units"]["text"] == at_motor["fields"]["units"]["text"]  # the switch says it
    factors = {
        "shaft.gap": 1.0 / ratio, "start.target_speed": 1.0 / ratio, "load.torque": ratio * eta,
        "shaft.stiffness": ratio**2 * eta, "load.inertia": ratio**2 * eta, "limits.shaft_torque": ratio * eta,
        "motor.starting_torque": 1.0, "motor.inertia": 1.0,
    }  # fmt: skip
    for path, factor in factors.items():
        shown, before = (float(one["fields"][path]["text"]) for one in (frame, at_motor))
        assert shown == pytest.approx(factor * before, rel=1e-5), path
        loaded = session.inputs.machine.parameters_by_path()[path][1]
        controls.take({"what": "edit", "path": path, "text": frame["fields"][path]["text"]})
        assert session.inputs.machine.parameters_by_path()[path][1] == pytest.approx(loaded, rel=1e-5)
        assert frames.mistakes == {}
    controls.take({"what": "slide", "path": "load.torque", "position": 300})
    shown = frames.main_frame()["fields"]["load.torque"]["text"]
    assert len(shown.replace(".", "")) <= 5  # of a round number there
    assert session.inputs.machine.load_torque == pytest.approx(float(shown) / (ratio * eta), rel=1e-9)
    session.set("load.torque", machine.load_torque)
    run = session.result("direct").run
    (row,) = frames.main_frame()["rows"]
    assert row["k_dyn"] == run.k_dyn
    assert row["peak_torque"] == pytest.approx(run.peak_torque * ratio * eta, rel=1e-12)
    trace = frames.main_frame()["traces"]["direct"]
    assert trace["peak"][1] == pytest.approx(run.peak_torque * ratio * eta, rel=1e-12)
    assert trace["allowed"] == pytest.approx(90.0 * ratio * eta, rel=1e-5)
    gap, inertia = frames.axes.gaps[3], frames.axes.inertias[3]
    controls.take({"what": "jump", "gap": gap, "inertia": inertia})
    assert session.inputs.machine.gap_and_inertia == pytest.approx((gap, inertia), rel=1e-5)
    again = links.inputs_of(links.link_of(session.inputs), session.inputs)
    assert again.units == session.inputs.units
    controls.take({"what": "edit", "path": "units", "text": "arcmin, rpm, kN m"})
    assert session.inputs.units.text == "arcmin, rpm, kN m, at output"
    controls.take({"what": "show_at", "output": False})
    assert session.inputs.units.text == "arcmin, rpm, kN m"


class Reader:
    """Who reads the page: what the browser has of all frames so far, and what he takes a number for.

    The sizes of the units are written here once more, by hand.
    """

    def __init__(self, machine: str) -> None:
        self.sizes = {
            "rad": 1.0,
            "deg": math.pi / 180,
            "arcmin": math.pi / 10800,
            "rad/s": 1.0,
            "rpm": math.pi / 30,
        }
        self.session = Session(machine, controllers=["direct"])
        self.controls, self.frames = controls_of(self.session)
        self.frames.axes = axes_about(self.session.inputs.origin, 5, 2)
        self.labels: dict[str, str] = {}
        self.seen: dict[str, Any] = {}
        self.arc = 0.04  # m, half the diameter of the circle on which angles in mm are arcs
        self.look()
        self.head = next(frame for frame in self.frames.idle_frames() if frame and "map" in frame)["map"]

    def do(self, what: str, **arguments: Any) -> None:
        self.controls.take({"what": what, **arguments})
        assert not self.frames.mistakes
        self.look()

    def look(self) -> None:
        self.seen = self.frames.main_frame()
        for group in self.seen.get("groups", ()):
            self.labels |= {row["path"]: row["unit"] for row in group["rows"]}

    def si(self, number: str, unit: str) -> float:
        return float(number) * (1e-3 / self.arc if unit == "mm" else self.sizes[unit])

    def read(self, path: str) -> float:
        """The value of a field, by the unit behind its number, else by that which stands beside the field."""
        number, _, unit = self.seen["fields"][path]["text"].partition(" ")
        return self.si(number, unit or self.labels[path])


ANGLES, SPEEDS = ("rad", "deg", "arcmin", "mm on 80 mm"), ("rad/s", "rpm")
ACTS = st.one_of(
    st.tuples(st.just("units"), st.sampled_from(ANGLES), st.sampled_from(SPEEDS)),
    st.tuples(st.just("gap"), st.integers(1, 99), st.sampled_from(["", " rad", " deg", " arcmin"])),
    st.tuples(st.just("speed"), st.integers(50, 99), st.sampled_from(["", " rad/s", "0 rpm"])),
    st.tuples(st.just("click"), st.floats(0.0, 1.0), st.just("")),
    st.tuples(st.sampled_from(["slide", "undo", "redo"]), st.just(300), st.just("")),
)


@pytest.mark.parametrize(
    ("machine", "gap"),
    [("crane-4amtkf", "shaft.gap"), pytest.param("crane-4-mass", "shaft[2].gap", marks=pytest.mark.slow)],
)
@settings(max_examples=4, deadline=None)
@example(acts=[("gap", 6, " deg"), ("click", 0.5, ""), ("speed", 60, " rad/s")])
@given(acts=st.lists(ACTS, min_size=2, max_size=8))
def test_what_is_read_what_is_typed_and_what_is_clicked_are_in_one_unit(machine, gap, acts):
    """After any changes of units and values in any unit: the number beside a unit is the value of the drive.

    The head of the map is that of the beginning: a click must not depend on which frame drew the axis.
    """
    reader = Reader(machine)
    session = reader.session
    for act, value, unit in acts:
        before = session.inputs.machine.gap_and_inertia[0]
        if act == "units":
            reader.do("edit", path="units", text=f"{value}, {unit}")
            assert session.inputs.machine.gap_and_inertia[0] == before
            assert (reader.labels[gap], reader.labels["start.target_speed"]) == (
                value[:2] if "mm" in value else value,
                unit,
            )
        elif act == "gap":
            units = dict(reader.labels)
            reader.do("edit", path=gap, text=f"{value}{unit}")
            assert reader.labels == units  # nothing else changes its unit
            typed = reader.si(str(value), unit.strip() or units[gap])
            assert session.inputs.machine.parameters_by_path()[gap][1] == pytest.approx(typed, rel=1e-8)
        elif act == "speed":
            units = dict(reader.labels)
            reader.do("edit", path="start.target_speed", text=f"{value}{unit}")
            assert reader.labels == units
        elif act == "click":
            gaps = reader.head["gaps"]
            node = gaps[round(value * (len(gaps) - 1))]
            name, size = reader.seen["angle"]
            said = f"{node / size:.6g}"  # what the read-out of the map shows
            reader.do("jump", gap=node, inertia=reader.head["inertias"][0])
            assert session.inputs.machine.gap_and_inertia[0] == pytest.approx(
                reader.si(said, name), rel=1e-5, abs=1e-12
            )
        else:
            reader.do(act, **({"path": gap, "position": value} if act == "slide" else {}))
        for path in (gap, "start.target_speed"):
            assert reader.read(path) == pytest.approx(
                session.inputs.machine.parameters_by_path()[path][1], rel=1e-5
            )
        seen, drive = reader.seen, session.inputs.machine
        assert seen["here"] == drive.gap_and_inertia
        assert seen["angle"][0] == reader.labels[gap]
        assert seen["figure"]["speed_unit"] == reader.labels["start.target_speed"]
        trace = seen["traces"]["direct"]
        assert (trace["units"]["angle"], trace["units"]["speed"]) == (
            seen["angle"][0],
            seen["figure"]["speed_unit"],
        )
        shown = reader.si(str(trace["target"]), trace["units"]["speed"])
        assert shown == pytest.approx(drive.target_speed, rel=1e-9)
        if drive.gap_and_inertia[0] > 0.0:  # else there is nothing to tune
            assert grid_of(session.inputs.machine_in_units, "0.2", "1x")[0] == [
                pytest.approx(reader.si("0.2", seen["angle"][0]), rel=1e-8)
            ]
        assert (
            units_of(session.inputs.machine_in_units) == reader.session.inputs.units
        )  # those of a report and of a tab


def test_a_value_is_shown_in_the_unit_in_which_it_was_typed_and_no_other_field_is():
    """36 arcmin stay 36 arcmin, not 0.6 deg; in a page that is in deg they are 0.6."""
    reader = Reader("crane-4amtkf")
    reader.do("edit", path="shaft.gap", text="36 arcmin")
    assert (reader.seen["fields"]["shaft.gap"]["text"], reader.labels["shaft.gap"]) == ("36 arcmin", "rad")
    reader.do("edit", path="units", text="deg")
    assert (reader.seen["fields"]["shaft.gap"]["text"], reader.labels["shaft.gap"]) == ("0.6", "deg")
    reader.do("undo")
    reader.do("slide", path="shaft.gap", position=300)
    reader.do("undo")
    assert reader.seen["fields"]["shaft.gap"]["text"] == "36 arcmin"


def test_parameters_of_the_selected_strategy_are_fields():
    """Their values are those that the start runs with; an empty field or `reset` is the default again."""
    session = Session(controllers=["direct", "ramp", "shaped"])
    controls, frames = controls_of(session)
    session.select("ramp")
    frame = frames.main_frame()
    main, more = frame["strategy"]
    assert (main["title"], more["title"]) == ("parameters of ramp", "more parameters")
    assert [row["path"] for row in main["rows"] if row["scale"]] == [
        "strategy.initial", "strategy.time", "strategy.full_torque"
    ]  # fmt: skip
    default = session.result("ramp").run.controller.time
    scales = {path: one.scale for path, one in frames.entries.items() if one.scale}
    shown = frame["fields"]["strategy.time"]
    ((mark, meaning),) = shown["marks"]
    assert (float(shown["text"]), shown["changed"]) == (pytest.approx(default, rel=1e-3), False)
    assert shown["position"] == mark == scales["strategy.time"].position(default)
    assert meaning.startswith("default: ")
    assert "strategy" not in frames.main_frame()  # the browser has these rows

    controls.take({"what": "edit", "path": "strategy.time", "text": "200 ms"})
    assert session.inputs.controllers["ramp"].time == 0.2
    assert frames.main_frame()["changed"] == ["ramp"]
    ramp = make_controller("ramp", {"time": 0.2})
    assert session.result("ramp").k_dyn == simulate(session.inputs.machine, ramp).k_dyn
    controls.take({"what": "slide", "path": "strategy.time", "position": 600})
    assert session.inputs.controllers["ramp"].time == scales["strategy.time"].high
    controls.take({"what": "edit", "path": "strategy.time", "text": " "})
    assert session.inputs.controllers["ramp"].time is None
    controls.take({"what": "edit", "path": "strategy.time", "text": "4 m"})
    assert "length" in frames.mistakes["strategy.time"]
    controls.take({"what": "reset", "path": "strategy.time"})
    assert not frames.mistakes
    assert session.changed == ()

    session.select("shaped")
    controls.take({"what": "edit", "path": "strategy.shaper", "text": "zvd"})
    assert session.inputs.controllers["shaped"].shaper == "zvd"
    controls.take({"what": "edit", "path": "strategy.time", "text": "1"})  # that is one of the ramp's
    assert "no such field" in frames.mistakes[""]


def test_what_is_assumed_or_can_hardly_be_is_told_at_rest():
    session = Session(controllers=["direct"])
    controls, frames = controls_of(session)
    known = {"assumed": "efficiency 0.95; damping ratio 0.02", "gear_ratio": 31.5}
    session.load(session.inputs.machine.replace(**known))
    controls.take({"what": "edit", "path": "shaft.gap", "text": "4 rad"})
    figure = frames.main_frame()["figure"]
    assert figure["output_torque"] == pytest.approx(31.5 * figure["peak_torque"], rel=1e-12)
    (remarks,) = [frame for frame in frames.idle_frames() if frame and "plausibility_warnings" in frame]
    assert remarks["assumed"] == session.inputs.machine.assumed.split("; ")
    (doubt,) = plausibility_warnings(session.inputs.machine)
    assert remarks["plausibility_warnings"] == [doubt[0].upper() + doubt[1:]]


@pytest.mark.parametrize(
    ("machine", "path", "text"),
    [("crane-4amtkf", "limits.shaft_torque", "70"), ("crane-4-mass", "shaft[2].permissible_torque", "90")],
)
def test_a_limit_is_given_and_taken_back_by_an_empty_field(machine, path, text):
    session = Session(machine, controllers=["direct"])
    controls, frames = controls_of(session)
    before = session.inputs.machine
    controls.take({"what": "edit", "path": path, "text": text})
    assert frames.main_frame()["fields"][path]["text"] == text
    assert session.inputs.machine.limits
    again = FrameBuilder(session).main_frame()  # as after a reload: a fold that has values is open
    assert [one["title"] for one in again["groups"] if path in [row["path"] for row in one["rows"]]] == again[
        "filled"
    ]
    controls.take({"what": "edit", "path": path, "text": ""})
    assert not frames.mistakes
    assert session.inputs.machine == before
    assert not session.inputs.machine.limits


def test_fields_take_values_at_the_output_of_a_gear_and_its_permissible_torque():
    """Without a ratio that is one sentence beside the field; the line of the traces is M/i at the motor."""
    session = Session("crane-4amtkf", controllers=["direct"])
    controls, frames = controls_of(session)

    def edit(path: str, text: str) -> None:
        controls.take({"what": "edit", "path": path, "text": text})

    edit("shaft.gap", "9 arcmin at output")
    (said,) = frames.mistakes.values()
    assert "without gear ratio" in said
    assert session.inputs.machine == session.inputs.origin
    for path, text in (
        ("gear.ratio", "38.1"), ("gear.efficiency", "95 %"), ("shaft.gap", "9 arcmin at output"),
        ("limits.output_torque", "5 kN*m"),
    ):  # fmt: skip
        edit(path, text)
    assert not frames.mistakes
    assert session.inputs.machine.gap == pytest.approx(math.radians(9 / 60) * 38.1, rel=1e-14)
    first = frames.main_frame()
    assert first["fields"]["shaft.gap"]["text"].startswith("9 arcmin")
    assert first["traces"]["direct"]["allowed"] == pytest.approx(5000 / 38.1 / 0.95, rel=1e-14)
    run = session.result("direct").run
    assert first["figure"]["output_torque"] == pytest.approx(38.1 * 0.95 * run.peak_torque, rel=1e-12)
    grid = grid_of(session.inputs.machine, "4.5 arcmin at output, 1x", "290 kg*m^2 at output")
    assert grid[0] == pytest.approx([session.inputs.machine.gap / 2, session.inputs.machine.gap], rel=1e-14)
    with pytest.raises(InputError, match="behind some of the values only"):
        grid_of(session.inputs.machine, "4.5 arcmin, 9 arcmin at output", "1x")


WHATS = [
    "slide", "edit", "reset", "jump", "select", "show", "fix", "remove", "undo", "redo", "hello", "window",
    "at_time", "duty_step", "duty_add", "duty_remove", "duty_move", "duty_time", "?",
]  # fmt: skip
KEYS = [
    "path", "text", "position", "gap", "inertia", "name", "visible", "fixed", "on", "stored",
    "link", "begin", "end", "stamp", "index", "to", "do", "time",
]  # fmt: skip
JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.floats()
    | st.text(max_size=12)
    | st.sampled_from(["shaft.gap", "direct", "duty[2].time", "jog"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=30, deadline=None)
@given(st.fixed_dictionaries({"what": st.sampled_from(WHATS)}, optional=dict.fromkeys(KEYS, JSON)) | JSON)
def test_no_message_whatever_kills_the_page(message):
    session = Session(controllers=["direct"])
    controls, frames = controls_of(session)
    frames.duty_shown = True
    controls.take(message)
    frame = frames.main_frame()
    json.dumps(list(frames.other_frames()), allow_nan=False)
    json.dumps(frame, allow_nan=False)
    assert frame["figure"]["k_dyn"] is not None
    assert "Internal error in softstart" not in str(frame["mistakes"])
