"""What is drawn is what was computed: thinned traces, maps, and the fields and traces of a chain."""

from __future__ import annotations

import base64
from itertools import pairwise, product

import numpy as np
import pytest

from softstart import Drive, simulate
from softstart.chain import Chain
from softstart.controller import make_controller
from softstart.page import links
from softstart.page.controls import Controls
from softstart.page.frames import FrameBuilder, channels_at, drawn, landmarks, traces_of
from softstart.page.machines import STEPS, Scale, axes_about, k_dyn_row, with_typed_changes
from softstart.page.session import Session
from softstart.quantities import Units

CRANE = Drive.load("crane-4amtkf")
CHANNELS = {"u": "u", "T[0]": "T", "theta[0]": "theta", "w[0]": "w1", "w[1]": "w2"}
CHAIN = Chain.load("crane-4-mass")
DAMPED = with_typed_changes(CHAIN, {f"shaft[{i}].damping_ratio": "0.04" for i in (1, 2, 3)})


@pytest.mark.parametrize("controller", ["direct", "state-feedback", "ramp"])
@pytest.mark.parametrize("stiffness", [368.465, 40_000.0, 4e6])  # 8 to 800 periods: what is thinned is much
def test_thinned_traces_keep_every_located_instant(controller, stiffness):
    run = simulate(CRANE.replace(stiffness=stiffness), controller)
    traces = traces_of(run)
    assert traces["t"].size < 8000
    assert set(landmarks(run)) <= set(traces["t"])
    # the peak is located by the kernel and evaluated again from the record: a few roundings apart
    assert np.abs(traces["T[0]"]).max() == pytest.approx(run.peak_torque, rel=1e-13)
    assert run.peak_time in traces["t"]
    exact = run.at(traces["t"])
    for name, own in CHANNELS.items():
        assert np.array_equal(traces[name], exact[own])
    for event in run.events:
        assert event.time in traces["t"]
    for stage in run.stages:
        assert stage.peak_time in traces["t"]


@pytest.mark.parametrize("window", [(0.1, 0.11), (0.0, 1e-5), (0.4, 0.6), (0.7, 0.8)])
def test_a_window_is_as_fine_as_a_screen(window):
    run = simulate(CRANE, "direct")
    traces = traces_of(run, window=window)
    assert np.all(np.diff(traces["t"]) > 0.0)
    assert traces["t"][[0, -1]].tolist() == [0.0, run.end_time]
    exact = run.at(traces["t"])
    for name, own in CHANNELS.items():
        assert np.array_equal(traces[name], exact[own])
    begin, end = window[0], min(window[1], run.end_time)
    within = traces["t"][(traces["t"] >= begin) & (traces["t"] <= end)]
    if begin < run.end_time:
        assert np.diff(within).max() < (end - begin) / 1500
        assert set(landmarks(run)) <= set(traces["t"])


@pytest.mark.parametrize("kept", [False, True])
def test_the_limit_of_the_map_is_the_permissible_torque_over_the_mean_one(kept):
    drive = Drive.from_toml(CRANE.to_toml() + "\n[limits]\nshaft_torque = 130.0\n")
    session = Session(drive, controllers=["direct"])
    frames = FrameBuilder(session)
    frames.fixed = kept
    rows = [frame for frame in frames.idle_frames() if frame and "map_row" in frame]
    for frame in rows[:3]:
        head, index = frame["map"], frame["map_row"]["index"]
        one = drive.replace(gap=head["gaps"][4], load_inertia=head["inertias"][index])
        run = simulate(drive if kept else one, "direct")
        assert head["limit"][index] == pytest.approx(130.0 / run.peak_torque * run.k_dyn, rel=1e-13)
    assert len({frame["map"]["of"] for frame in rows}) == 1
    without = FrameBuilder(Session(controllers=["direct"]))
    assert next(frame for frame in without.idle_frames() if frame and "map" in frame)["map"]["limit"] is None


def test_packed_traces_come_back_to_single_precision():
    found = Session(controllers=["direct"]).result("direct")
    for units, whole in product((Units(), Units("deg", "rpm")), (True, False)):
        picture = drawn(found, units, whole)
        assert (picture["channels"] == ["t", "T[0]"]) is not whole
        rows = np.frombuffer(base64.b64decode(picture["data"]), dtype="<f4")
        traces = traces_of(found.run)
        for name, row in zip(picture["channels"], rows.reshape(len(picture["channels"]), -1), strict=True):
            si = {"w": "rad/s", "theta": "rad"}.get(name.partition("[")[0], "")
            assert np.array_equal(row, units.shown(traces[name], si).astype("f4"))


@pytest.mark.parametrize("kept", [False, True], ids=["fitted to each", "kept"])
@pytest.mark.parametrize(
    ("machine", "controller"),
    [
        (CRANE, "reduced-first-stage"),
        (CRANE, "shaped"),
        (CRANE, "current-limit-feedback"),
        (DAMPED, "ramp"),
    ],
)
def test_the_map_is_made_of_simulated_starts(machine, controller, kept):
    axes, made, base = axes_about(machine, 4, 3), make_controller(controller), machine if kept else None
    for inertia in axes.inertias:
        row = k_dyn_row(machine, made, axes.gaps, inertia, base)
        for gap, k in zip(axes.gaps, row, strict=True):
            there = machine.with_gap_and_inertia(gap, inertia)
            assert there.gap_and_inertia == (pytest.approx(gap), pytest.approx(inertia))
            assert k == simulate(there, made, fitted_to=base, base=base).k_dyn


def test_a_slider_stays_at_its_end_for_values_beyond():
    assert Scale(1.0, 10.0, logarithmic=True).position(-3.0) == 0
    assert Scale(0.0, 1.0).position(7.0) == STEPS


def frames_of(chain: Chain, *controllers: str) -> tuple[Session, FrameBuilder, Controls]:
    session = Session(chain, controllers=controllers or ["direct", "ramp"])
    frames = FrameBuilder(session)
    return session, frames, Controls(session, frames, lambda: None)


def test_the_figures_of_a_chain_are_those_of_simulate():
    session, frames, controls = frames_of(DAMPED, "direct", "ramp", "take-up")
    assert frames.main_frame()["figure"]["k_dyn"] == simulate(DAMPED, "direct").k_dyn
    controls.take({"what": "slide", "path": "shaft[2].gap", "position": 100})
    controls.take({"what": "edit", "path": "mass[4].inertia", "text": "50 kg*m^2"})
    assert not frames.mistakes
    now = session.inputs.machine
    assert now.shafts[1].gap == frames.entries["shaft[2].gap"].scale.value(100)
    assert now.masses[3].inertia == 50.0
    for name in ("direct", "ramp", "take-up"):
        assert session.result(name).k_dyn == simulate(now, name).k_dyn
    rows = [row for frame in frames.idle_frames() if frame for row in frame.get("rows", ())]
    worn = {row["name"]: row["worn"] for row in rows if "worn" in row}
    wide = simulate(now.scaled(gaps=4.0), "ramp", fitted_to=now, base=now).k_dyn
    assert worn["ramp"] == wide
    session.undo()
    session.undo()
    assert session.inputs.machine is DAMPED


def test_traces_hold_each_shaft_and_body():
    run = simulate(DAMPED, "direct")
    traces = traces_of(run)
    states = run.at(traces["t"])
    for k in range(3):
        assert np.array_equal(traces[f"T[{k}]"], states["T"][:, k])
        assert np.array_equal(traces[f"theta[{k}]"], states["twist"][:, k])
        assert np.abs(traces[f"T[{k}]"]).max() == pytest.approx(run.peak_torques[k], rel=1e-12)
    assert np.array_equal(traces["w[3]"], states["w"][:, 3])
    assert {event.time for event in run.events} <= set(traces["t"])


@pytest.mark.parametrize("strategy", ["direct", "take-up"])
def test_stages_of_a_gap_are_open_where_it_carries_nothing(strategy):
    """The kernel's events against the states: no torque in an open gap, no twist within a closed one."""
    session, frames, _ = frames_of(DAMPED, strategy)
    picture = frames.main_frame()["traces"][strategy]
    run = session.result(strategy).run
    halves = 0.5 * DAMPED.at_motor_shaft().gap
    for k, shaft in enumerate(picture["shafts"]):
        stages = shaft["stages"]
        assert stages[0][0] == 0.0
        assert stages[-1][1] == run.end_time
        assert all(before[1] == after[0] for before, after in pairwise(stages))
        for start, end, side in stages:
            inside = channels_at(run, np.linspace(start, end, 9)[1:-1])
            if side == 0:
                assert np.all(inside[f"T[{k}]"] == 0.0)
            else:
                assert np.all(side * inside[f"theta[{k}]"] >= halves[k] * (1.0 - 1e-9))


def test_gaps_that_were_closed_on_the_map_open_again_as_they_were():
    session, _, controls = frames_of(DAMPED)
    controls.take({"what": "jump", "gap": 0.0, "inertia": 69.2})
    assert [shaft.gap for shaft in session.inputs.machine.shafts] == [0.0, 0.0, 0.0]
    controls.take({"what": "jump", "gap": 0.5, "inertia": 69.2})
    assert [shaft.gap for shaft in session.inputs.machine.shafts] == pytest.approx([0.1, 0.2, 0.01])


def test_a_map_is_computed_again_for_another_stiffness_and_not_for_another_place_of_it():
    session, frames, controls = frames_of(DAMPED, "direct")
    frames.axes = axes_about(DAMPED, 3, 3)
    assert [frame for frame in frames.idle_frames() if frame and "map_row" in frame]
    controls.take({"what": "jump", "gap": 0.31, "inertia": 44.4})
    assert not frames.main_frame()["map_is_old"]
    session.set("shaft[1].stiffness", 5000.0)
    assert frames.main_frame()["map_is_old"]
    closed = with_typed_changes(CHAIN, {f"shaft[{i}].gap": "0" for i in (1, 2, 3)})
    _, frames, _ = frames_of(closed, "direct")  # no gap, no map
    assert not frames.main_frame()["mapped"]
    assert not [frame for frame in frames.idle_frames() if frame and "map_row" in frame]


def test_a_link_brings_the_chain_back_and_a_drive_replaces_it():
    session, frames, _ = frames_of(DAMPED)
    session.set("shaft[3].gap", "0.6 deg")
    other = links.inputs_of(links.link_of(session.inputs), Session(controllers=["direct"]).inputs)
    assert other.machine == session.inputs.machine
    session.load(Drive.load("crane-4amtkf"))
    assert "shaft.gap" in frames.main_frame()["fields"]
    session.undo()
    frame = frames.main_frame()
    assert frame["fields"]["shaft[3].gap"]["text"] == "0.6 deg"
    assert frame["figure"]["k_dyn"] == simulate(other.machine, "direct").k_dyn
