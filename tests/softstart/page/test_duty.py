"""The duty of a page: steps that a hand arranges, figures of `run_duty`, and a refusal that loses nothing."""

from __future__ import annotations

import re
import time
from base64 import b64decode

import numpy as np
import pytest

from softstart import Chain, Drive, Duty, DutyStep, InputError, run_duty
from softstart.page import session as sessions
from softstart.page.controls import Controls
from softstart.page.duty import MOST_STEPS, DutyPlan
from softstart.page.frames import FrameBuilder
from softstart.page.links import inputs_of, link_of
from softstart.page.session import Session

CONVEYOR = Drive.load("conveyor-11kw")
PLAIN = Duty([DutyStep("start"), DutyStep("hold", time=1.0), DutyStep("stop")])


class Page:
    """A session with its frames and controls, and the duty in sight."""

    def __init__(self, machine, strategy="direct") -> None:
        self.session = Session(machine, controllers=["direct", "s-curve"])
        self.session.select(strategy)
        self.frames = FrameBuilder(self.session)
        self.controls = Controls(self.session, self.frames, lambda: None)
        self.frames.duty_shown = True

    def take(self, what, **message):
        self.controls.take({"what": what, **message})
        return self.frames.main_frame()

    def duty(self):
        """What is sent of the duty."""
        self.frames.sent.pop("duty", None)
        return next(frame["duty"] for frame in self.frames.other_frames() if frame and "duty" in frame)

    @property
    def steps(self) -> list[str]:
        return [step.do for step in self.session.inputs.plan.steps]


@pytest.fixture
def page() -> Page:
    return Page(CONVEYOR)


def test_a_machine_without_a_duty_starts_holds_and_stops(page):
    """Every figure is that of `run_duty`; the trace has the largest torques in single precision."""
    shown, run = page.duty(), run_duty(CONVEYOR, "direct", PLAIN)
    assert [step["do"] for step in shown["steps"]] == ["start", "hold", "stop"]
    assert (shown["k_dyn"], shown["worst"]) == (run.k_dyn, run.worst.number - 1)
    for step, row in zip(shown["steps"], run.rows, strict=True):
        assert (step["k_dyn"], step["time"], step["contacts"]) == (run.k_dyn_of(row), row.time, row.contacts)
        assert step["length"] == row.end - row.begin
    trace = shown["trace"]
    data = np.frombuffer(b64decode(trace["data"]), dtype="<f4").reshape(len(trace["channels"]), -1)
    assert trace["ends"][-1] == data.shape[1]
    T, begin = data[trace["channels"].index("T[0]")], 0
    for row, end in zip(run.rows, trace["ends"], strict=True):
        assert np.abs(T[begin:end]).max() == pytest.approx(row.peak_torque, rel=1e-6)
        assert (np.diff(data[0][begin:end]) >= 0.0).all()
        begin = end
    assert trace["peak"] == (0, pytest.approx(run.worst.peak_torque))


def test_steps_are_added_moved_removed_and_drawn_longer_and_all_is_undone(page):
    first = page.session.inputs
    page.take("duty_step", index=1)
    page.take("duty_add", index=2, do="reverse")
    assert page.steps == ["start", "hold", "reverse", "stop"]
    assert page.frames.duty_step == 2
    page.take("duty_move", index=2, to=1)
    assert page.steps == ["start", "reverse", "hold", "stop"]
    assert page.frames.duty_step == 1
    page.take("duty_remove", index=1)
    assert page.steps == ["start", "hold", "stop"]
    before = page.session.steps[0]
    for seconds in (1.2, 1.5, 1.7654):  # one drag
        page.take("duty_time", index=1, time=seconds)
    assert page.session.inputs.plan.steps[1].time == 1.77
    assert page.session.steps[0] == before + 1
    while page.session.steps[0]:
        page.session.undo()
    assert page.session.inputs is first


def test_fields_are_those_of_the_selected_step_in_the_units_of_the_page(page):
    page.take("duty_step", index=1)
    frame = page.take("edit", path="duty[2].time", text="250 ms")
    assert frame["fields"]["duty[2].time"] == {"text": "0.25"}
    frame = page.take("edit", path="duty[2].angle", text="5 turn")  # instead of the time
    assert page.session.inputs.plan.steps[1] == DutyStep("hold", angle="5 turn")
    assert (frame["fields"]["duty[2].angle"]["text"], frame["fields"]["duty[2].time"]["text"]) == ("1800", "")
    page.take("duty_step", index=2)
    page.take("edit", path="duty[3].by", text="brake")
    page.take("edit", path="duty[3].by", text="default")
    assert page.session.inputs.plan.steps[2] == DutyStep("stop")
    page.take("edit", path="duty.stop", text="coast")
    page.take("edit", path="duty.shift.cycles_per_hour", text="50")
    assert (page.session.inputs.plan.stop, page.session.inputs.plan.shift.hours) == ("coast", 8.0)
    page.take("duty_step", index=0)
    page.take("edit", path="duty[1].set_speed", text="-1000")  # rpm
    assert page.session.inputs.plan.steps[0].set_speed == pytest.approx(-1000 * np.pi / 30)


@pytest.mark.parametrize(
    ("step", "key", "text", "sentence"),
    [
        (2, "time", "0", "must be above 0"),
        (2, "time", "", "Time is missing"),
        (1, "repeat", "1.5", "must be a whole number"),
        (1, "set_speed", "5 kg", "a mass, not a"),
        (3, "by", "parachute", "parachute"),
    ],
)
def test_a_wrong_value_is_said_beside_its_field_and_changes_nothing(page, step, key, text, sentence):
    page.take("duty_step", index=step - 1)
    before, path = page.session.inputs, f"duty[{step}].{key}"
    frame = page.take("edit", path=path, text=text)
    assert sentence in frame["mistakes"][path]
    assert page.session.inputs is before


@pytest.mark.parametrize("machine", [CONVEYOR, Chain.load("crane-4-mass")])
def test_a_brake_is_given_and_taken_back(machine):
    page = Page(machine)
    page.take("edit", path="brake.torque", text="300")
    frame = page.take("edit", path="brake.closing_delay", text="60 ms")
    assert (frame["fields"]["brake.torque"]["text"], frame["mistakes"]) == ("300", {})
    assert (page.session.inputs.machine.brake, page.session.inputs.machine.closing_delay) == ("motor", 0.06)
    page.take("edit", path="brake.closing_delay", text="0")
    page.take("edit", path="brake.torque", text="")
    assert page.session.inputs.machine.brake == "none"


def test_an_order_that_cannot_be_is_a_sentence_and_nothing_is_lost(page):
    page.take("duty_move", index=0, to=2)
    assert page.steps == ["hold", "stop", "start"]
    shown = page.duty()
    assert 'a step "start" must come before it' in shown["trouble"]
    assert (shown["wrong"], shown["trace"], shown["toml"]) == (1, None, "")
    with pytest.raises(InputError, match='a step "start" must come before it'):
        _ = page.session.inputs.machine_with_duty
    page.take("duty_move", index=2, to=0)
    assert page.duty()["trace"] is not None


def test_what_a_machine_cannot_do_is_said_with_its_step():
    shown = Page("crane-4amtkf").duty()  # its load drives it, and nothing stops it
    assert "nothing holds the load" in shown["trouble"]
    assert (shown["wrong"], shown["trace"]) == (2, None)
    assert Duty.from_toml(shown["toml"]) == PLAIN  # it can be saved


def test_too_much_for_the_page_is_a_sentence(page, monkeypatch):
    page.take("edit", path="duty[1].repeat", text="1e9")
    assert "a duty at most 10000" in page.duty()["trouble"]
    page.session.undo()
    monkeypatch.setattr(sessions, "LONGEST_DUTY", 0.0)
    assert page.session.duty_result(0.0).given_up
    for _ in range(MOST_STEPS):
        frame = page.take("duty_add", index=0, do="hold")
    assert frame["mistakes"][""] == f"There are {MOST_STEPS} steps already; remove one first."
    page.take("duty_remove", index=99)
    assert len(page.steps) == MOST_STEPS


def test_a_long_duty_waits_for_rest(page, monkeypatch):
    monkeypatch.setattr("softstart.page.frames.LIVE_DUTY", 0.0)
    assert page.duty() | {"waits": True, "trace": None} == page.duty()
    page.frames.sent.pop("duty")
    at_rest = [frame["duty"] for frame in page.frames.idle_frames() if frame and "duty" in frame]
    assert [shown["waits"] for shown in at_rest] == [False]
    assert at_rest[0]["k_dyn"] == run_duty(CONVEYOR, "direct", PLAIN).k_dyn


def test_a_busy_machine_makes_no_duty_long(page, monkeypatch):
    """What counts is the time that the processor spends on it, not the time that it waits for one."""

    def waiting(*given, progress, **options):
        def wait(step):
            time.sleep(0.2)
            progress(step)

        return run_duty(*given, progress=wait, **options)

    monkeypatch.setattr(sessions, "run_duty", waiting)
    shown = page.duty()
    assert not shown["waits"]
    assert shown["k_dyn"] == run_duty(CONVEYOR, "direct", PLAIN).k_dyn


def test_a_duty_out_of_sight_is_not_computed(page, monkeypatch):
    page.frames.duty_shown = False
    monkeypatch.setattr(Session, "duty_result", lambda *_: pytest.fail("it was computed"))
    list(page.frames.other_frames())


@pytest.mark.parametrize("machine", [CONVEYOR, Chain.load("crane-4-mass")])
def test_the_duty_of_a_file_is_shown_saved_and_travels_in_the_link(machine):
    own = Duty([DutyStep("start", repeat=2), DutyStep("stop", time="5 s"), DutyStep("hold", time=2.0)])
    session = Session(machine.replace(duty=own))
    assert session.inputs.machine == machine
    assert session.inputs.machine_with_duty == machine.replace(duty=own)
    other = inputs_of(link_of(session.inputs), Session().inputs)
    assert other.duty == session.inputs.duty == DutyPlan(own.steps)
    session.load(CONVEYOR)
    assert session.inputs.duty is None
    assert session.inputs.machine_with_duty is session.inputs.machine


def test_each_strategy_has_the_k_dyn_of_its_worst_step_at_rest(page):
    rows = {}
    for frame in page.frames.idle_frames():
        rows |= {row["name"]: row for row in (frame or {}).get("rows", [])}
    for name in ("direct", "s-curve"):
        assert rows[name]["duty"] == run_duty(CONVEYOR, name, PLAIN).k_dyn
    page.take("duty_add", index=3, do="jog")
    assert page.frames.main_frame()["rows"][0]["duty"] is None  # it was of another duty


def test_a_chain_shows_all_its_shafts():
    chain = Chain.load("crane-4-mass")
    page = Page(chain)
    page.session.set_duty(DutyPlan((DutyStep("start"), DutyStep("stop", by="coast", time=3.0))))
    shown = page.duty()
    assert len([name for name in shown["trace"]["channels"] if name.startswith("T[")]) == 3
    run = run_duty(chain, "direct", page.session.inputs.plan.duty)
    assert shown["trace"]["worst"] == int(run.worst.peak_torques.argmax())
    assert page.session.inputs.plan.added(1, "load", chain).steps[1].torque == chain.masses[-1].torque


@pytest.mark.parametrize(("ratio", "eta"), [(31.5, 0.94), (0.5, 0.7), (1.0, 1.0)])
def test_a_duty_is_seen_at_the_output(page, ratio, eta):
    """Torques i eta, speeds and angles over i; K_dyn, times and margins are the same at both shafts."""
    for path, value in (("gear.ratio", ratio), ("gear.efficiency", eta), ("limits.shaft_torque", 300.0)):
        page.session.set(path, value)
    page.session.set("units", "rad, rad/s, kN m")
    motor = page.duty()
    page.take("show_at", output=True)
    output = page.duty()
    assert (motor["at"], output["at"], output["units"]["torque"]) == ("", ", at the output", "kN m")
    for one, other in zip(motor["steps"], output["steps"], strict=True):
        for key in ("largest", "smallest"):
            assert other[key] == pytest.approx(one[key] * ratio * eta, rel=1e-12, abs=1e-12)
        assert other["angle"] == pytest.approx(one["angle"] / ratio, rel=1e-12)
        alike = ("k_dyn", "time", "contacts", "impact_energy", "damage", "kept")
        assert [other[key] for key in alike] == [one[key] for key in alike]
        assert re.findall(r"[\d.]+ %", other["limits"]) == re.findall(r"[\d.]+ %", one["limits"])
    for key in ("peak_torque", "base"):
        assert output[key] == pytest.approx(motor[key] * ratio * eta, rel=1e-12)
    assert output["trace"]["allowed"] == pytest.approx(0.3 * ratio * eta, rel=1e-12)
    assert output["trace"]["peak"][1] == pytest.approx(motor["trace"]["peak"][1] * ratio * eta, rel=1e-12)
    for name, here, there in zip(motor["trace"]["channels"], *map(rows_of, (motor, output)), strict=True):
        factor = {"t": 1.0, "w": 1.0 / ratio}.get(name[0], ratio * eta)
        assert there == pytest.approx(factor * here, rel=1e-6, abs=1e-9)


def rows_of(shown):
    """The channels of the trace."""
    trace = shown["trace"]
    return np.frombuffer(b64decode(trace["data"]), dtype="<f4").reshape(len(trace["channels"]), -1)
