"""Axes read, and every mistake in them told at once, with the name that was meant."""

from __future__ import annotations

import numpy as np
import pytest

from softstart import Drive, InputError, machine_table, sweep
from softstart.controller.recipe import Recipe
from softstart.sweeping.grid import read_grid

CRANE = Drive.load("crane-4amtkf")


def test_names_and_units():
    grid = read_grid(
        {
            "load.inertia": ["700 kg*cm^2", 0.175],
            "gap": np.array([0.5, 2.0]),
            "controller.time": ("120 ms", 0.2),
            "load_kind": ["reactive", "active"],
            "controller_period": range(1, 3),
        },
        Recipe("ramp"),
        CRANE,
    )
    assert {name: one.values.tolist() for name, one in grid.items()} == {
        "load_inertia": [0.07, 0.175], "gap": [0.5, 2.0], "controller_time": [0.12, 0.2],
        "load_kind": ["reactive", "active"], "controller_period": [1.0, 2.0],
    }  # fmt: skip
    assert [one.attrs.get("units") for one in grid.values()] == ["kg*m^2", "rad", "s", None, "s"]


ONE_SENTENCE = {
    "not a grid": ([1, 2], "direct", "mapping of axes to values"),
    "unknown": ({"gapp": [1]}, "direct", "gapp: there is no such axis; did you mean gap?"),
    "a bare parameter": ({"full_torque": [1]}, "ramp", "did you mean controller.full_torque?"),
    "no such parameter": (
        {"controller.tim": [1]}, "ramp", "ramp has no such parameter; did you mean controller.time?"
    ),
    "one value": ({"gap": 0.5}, "direct", "gap = 0.5: give the values of an axis as a list"),
    "negative": ({"gap": [0.5, -1]}, "direct", "gap[1] = -1.0: the total angular gap must be 0 or more"),
    "twice": ({"gap": [0.5, 1, 0.5]}, "direct", "gap = 0.5: this value is given twice"),
    "same axis": ({"gap": [1], "shaft.gap": [2]}, "direct", "shaft.gap: gap is an axis already"),
    "a kind that is a number": ({"load.kind": [1]}, "direct", "takes names"),
    "controller and axis": ({"controller": ["direct"]}, "ramp", "one of the two"),
    "not shared": (
        {"controller": ["direct", "ramp"], "controller.time": [1]}, None,
        "controller.time: not all of direct, ramp have this parameter",
    ),
    "samples of two lengths": ({"sample": {"gap": [1], "damping": [1, 2]}}, "direct", "gap has 1, damp"),
    "samples called like a parameter": ({"gap": {"gap": [1], "damping": [2]}}, "direct", "none of their"),
}  # fmt: skip


@pytest.mark.parametrize("kind", ONE_SENTENCE)
def test_one_clear_sentence(kind):
    grid, controller, says = ONE_SENTENCE[kind]
    with pytest.raises(InputError) as caught:
        sweep(CRANE, controller, grid, workers=1)
    assert len(caught.value.sentences) == 1
    assert says in caught.value.sentences[0]
    assert caught.value.sentences[0].endswith((".", "?"))


def test_all_mistakes_at_once():
    with pytest.raises(InputError) as caught:
        sweep(
            CRANE,
            "ramp",
            {"gapp": [1], "load.inertia": [-1.0], "controller.tme": [1], "stiffness": ["soft"]},
            figures=["k_dym"],
            until=-1.0,
            fitted_to=machine_table(CRANE, gap=[1.0, 2.0]),
        )
    told = "\n".join(caught.value.sentences)
    assert len(caught.value.sentences) == 7
    for words in ("gapp", "load.inertia", "controller.tme", "stiffness", "k_dyn?", "until", "fitted_to"):
        assert words in told


IMPOSSIBLE = {
    "two axes": (
        {"starting_torque": [10, 60], "load.torque": [5, 12], "maximum_torque": [80]},
        "starting_torque = 10 N.m: .* load_torque = 12 N",
    ),
    "not at an end": (
        {"starting_torque": [50, 10, 60], "load.torque": [12], "maximum_torque": [80]},
        "starting_torque = 10 N.m: .* load_torque = 12 N",
    ),
    "a kind": ({"load.kind": ["active", "reactive"], "load.torque": [1, -1]}, "load_torque = -1 N"),
    "samples": ({"sample": {"starting_torque": [10, 60], "load_torque": [3, 60], "maximum_torque": [70, 71]}},
                r"starting_torque\[1\] = 60"),
    "a controller's": ({"controller.time": [0.1, -0.1]}, r"time\[1\] = -0.1"),
}  # fmt: skip


@pytest.mark.parametrize("kind", IMPOSSIBLE)
def test_an_impossible_corner_is_found_before_anything_is_computed(kind, tmp_path):
    grid, says = IMPOSSIBLE[kind]
    with pytest.raises(InputError, match=says) as caught:
        sweep(CRANE, "ramp", grid, to=tmp_path / "never")
    assert len(caught.value.sentences) == 1
    assert not list(tmp_path.iterdir())


def test_samples_may_be_possible_where_a_full_grid_is_not():
    found = sweep(
        CRANE, "direct", {"sample": {"starting_torque": [10, 60], "load_torque": [3, 12]}}, workers=1
    )
    assert found.status.values.tolist() == [0, 0]
