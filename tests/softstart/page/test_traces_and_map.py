"""What is drawn is what was computed: thinning keeps extrema, the map is made of simulated starts."""

from __future__ import annotations

import base64
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from softstart import Drive, simulate
from softstart.controller import make_controller
from softstart.page.frames import Screen, drawn, landmarks, thinned, traces_of
from softstart.page.machines import STEPS, Scale, axes_about, entries, k_dyn_row
from softstart.page.session import Session
from softstart.quantities import Units

CRANE = Drive.load("crane-4amtkf")
CHANNELS = {"u": "u", "T[0]": "T", "theta[0]": "theta", "w[0]": "w1", "w[1]": "w2"}
SCALES = {path: one.scale for path, one in entries(CRANE).items() if one.scale}


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


@settings(max_examples=40, deadline=None)
@given(
    st.tuples(st.integers(1, 4), st.integers(1, 20), st.integers(1, 10)).flatmap(
        lambda shape: arrays(np.float64, shape, elements=st.floats(-1e6, 1e6))
    )
)
def test_each_bucket_keeps_its_least_and_largest(boxes):
    width = boxes.shape[2]
    keep = thinned(boxes.reshape(boxes.shape[0], -1), width)
    for k in range(boxes.shape[1]):
        kept = boxes[:, k, keep[keep // width == k] % width]
        assert np.array_equal(boxes[:, k].max(axis=1), kept.max(axis=1))
        assert np.array_equal(boxes[:, k].min(axis=1), kept.min(axis=1))


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
    screen = Screen(session)
    screen.kept = kept
    rows = [frame for frame in screen.at_rest() if frame and "map_row" in frame]
    for frame in rows[:3]:
        head, index = frame["map"], frame["map_row"]["index"]
        one = drive.replace(gap=head["gaps"][4], load_inertia=head["inertias"][index])
        run = simulate(drive if kept else one, "direct")
        assert head["limit"][index] == pytest.approx(130.0 / run.peak_torque * run.k_dyn, rel=1e-13)
    assert len({frame["map"]["of"] for frame in rows}) == 1
    without = Screen(Session(controllers=["direct"]))
    assert next(frame for frame in without.at_rest() if frame and "map" in frame)["map"]["limit"] is None


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


@pytest.mark.parametrize("controller", ["direct", "shaped", "current-limit-feedback"])
def test_the_map_is_made_of_simulated_starts(controller):
    axes = axes_about(CRANE, 4, 3)
    made = make_controller(controller)
    for inertia in axes.inertias:
        row = k_dyn_row(CRANE, made, axes.gaps, inertia)
        for gap, k in zip(axes.gaps, row, strict=True):
            assert k == simulate(CRANE.replace(gap=gap, load_inertia=inertia), made).k_dyn


def test_with_the_controller_kept_the_map_refers_to_the_drive_of_the_moment():
    made = make_controller("reduced-first-stage")
    row = k_dyn_row(CRANE, made, (0.5, 2.0), 0.07, CRANE)
    for gap, k in zip((0.5, 2.0), row, strict=True):
        other = CRANE.replace(gap=gap, load_inertia=0.07)
        assert k == simulate(other, made, fitted_to=CRANE, base=CRANE).k_dyn


@given(st.sampled_from(sorted(SCALES)), st.integers(0, STEPS))
def test_a_slider_shows_the_position_it_was_set_to(name, position):
    scale = SCALES[name]
    value = scale.value(position)
    assert scale.low <= value <= scale.high
    assert abs(scale.position(value) - position) <= 1  # four digits of the value may be half a step off
    assert float(f"{value:.6g}") == value  # the field shows what is computed with


def test_a_slider_stays_at_its_end_for_values_beyond():
    assert Scale(1.0, 10.0, logarithmic=True).position(-3.0) == 0
    assert Scale(0.0, 1.0).position(7.0) == STEPS
