"""Each start of a sweep is that of `simulate`, to the bit, whatever the axes, their order and the chunks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart import Drive, InputError, Status, machine_table, simulate, sweep
from softstart.controller import make_controller, ready_controller_names
from softstart.controller.tuned import GainSchedule, RobustGains
from softstart.start.batch import figure_columns
from softstart.start.recommendation import Row
from softstart.sweeping.summary import summarise
from softstart.views.sweeps import sweep_conclusion, sweep_figure

CRANE = Drive.load("crane-4amtkf").replace(
    torque_lag="2 ms", damping=0.3, permissible_torque=130.0, permissible_start_time=0.5
)
FIGURES = tuple(figure_columns(("",)))
POOL = {
    "gap": [0.03, 0.5, 3.1],
    "load.inertia": ["700 kg*cm^2", 0.2],
    "stiffness": [222.2, 400.0],
    "torque_lag": [0.0, 0.003],
    "encoder_lines": [0, 500],
    "load.kind": ["reactive", "active"],
    "contact_law": ["modelica", "no-pull"],
    "target_speed": [30.0, 61.0],
}

NAMES = {"load.inertia": "load_inertia", "load.kind": "load_kind", "controller.period": "controller_period"}


def same(results, index, one):
    """Whether the figures there are those of a single start."""
    for name in FIGURES:
        if name == "status":
            assert list(Status)[int(results.status[index])] is one.status
        elif name in (summary := one.summary()):
            expected = np.nan if summary[name] is None else summary[name]
            np.testing.assert_equal(float(results[name][index]), float(expected), err_msg=name)
    margins = [margin.share for margin in Row(one, None, worst_case=()).margins(one.drive.limits)]
    least = np.nan if np.isnan(one.start_time) else min(margins)
    np.testing.assert_equal(float(results["margin"][index]), least)
    assert results["keeps_limits"][index] == (least >= 0.0)


def single(results, index, controller="", **options):
    """`simulate` at one place of a grid."""
    place = {
        str(k): v.item()
        for k, v in results.isel(dict(zip(results.status.dims, index, strict=True))).coords.items()
    }
    controller = place.pop("controller", controller)
    own = {k.removeprefix("controller_"): place.pop(k) for k in list(place) if k.startswith("controller_")}
    place.pop("sample", None)
    return simulate(CRANE.replace(**place), controller, parameters=own, **options)


@settings(max_examples=15, deadline=None)
@given(st.data())
def test_any_axes_in_any_order(data):
    keys = data.draw(
        st.lists(
            st.sampled_from([*POOL, "controller", "controller.period"]), min_size=1, max_size=4, unique=True
        )
    )
    grid = {}
    for key in keys:
        values = {"controller": ["ramp", "acceleration-delay"], "controller.period": [0.001, 0.0013]}.get(
            key, POOL.get(key)
        )
        grid[key] = data.draw(st.lists(st.sampled_from(values), min_size=1, unique=True))
    controller = None if "controller" in grid else "ramp"
    chunk = data.draw(st.integers(1, 9))
    results = sweep(CRANE, controller, grid, figures=FIGURES, chunk=chunk, workers=1)
    assert list(results.status.dims) == [NAMES.get(key, key) for key in grid]
    whole = sweep(CRANE, controller, grid, figures=FIGURES, workers=1)
    assert whole.drop_attrs().identical(results.drop_attrs())
    for index in np.ndindex(results.status.shape):
        if data.draw(st.booleans()):
            same(results, index, single(results, index, controller))


@pytest.mark.parametrize("name", ready_controller_names())
def test_parameters_of_every_controller_as_axes(name):
    rng = np.random.default_rng(5)
    fitted = make_controller(name).fitted(CRANE)
    for key, value in fitted.parameters.items():
        if not isinstance(value, float):
            continue
        grid = {
            "gap": rng.uniform(0.01, 4, 3),
            f"controller.{key}": (value or 0.01) * np.array([0.8, 0.93]),
            "stiffness": [300, 500],
        }
        results = sweep(CRANE, name, grid, figures=FIGURES, workers=1, fitted_to=CRANE)
        same(results, (2, 1, 0), single(results, (2, 1, 0), name, fitted_to=CRANE))


def test_only_limits_make_a_margin():
    grid = {"gap": [0.1, 0.5, 2.0, 4.0], "load.inertia": [0.07, 0.1, 0.175, 0.3]}
    found = sweep(CRANE, "direct", grid, workers=1)
    assert {"margin", "keeps_limits"} <= set(found)
    free = CRANE.replace(permissible_torque=None, permissible_start_time=None)
    many = [CRANE.replace(permissible_torque=torque) for torque in (80.0, 200.0)]
    margins = simulate([*many, free], "direct").margin.values
    peak = simulate(free, "direct").peak_torque
    assert margins[0] == 1.0 - peak / 80.0
    assert margins[2] == 1.0  # no limit, nothing used
    assert 0.0 < summarise(found).share_kept < 1.0
    assert "the limits of shaft torque and start time, least margin -" in sweep_conclusion(
        found, summarise(found)
    )
    assert sweep_figure(found, "margin") is not None
    assert "margin" not in sweep(free, "direct", {"gap": [0.5]}, workers=1)
    with pytest.raises(InputError, match="figures = margin: the drive has no limits that it could refer to"):
        sweep(free, "direct", {"gap": [0.5]}, figures=["margin"], workers=1)


def test_until_is_that_of_simulate():
    grid = {"gap": [0.5, 2.0], "load_inertia": [0.1, 0.3]}
    results = sweep(CRANE, "current-limit-feedback", grid, figures=FIGURES, workers=1, until=0.3)
    assert results.status.values.tolist() != [[0, 0], [0, 0]]
    for index in np.ndindex(2, 2):
        same(results, index, single(results, index, "current-limit-feedback", until=0.3))


def test_tuned_gains_in_the_place_of_a_controller(tmp_path):
    ramp = make_controller("ramp")
    times = ("time", "logarithmic", np.array([[0.1, 0.12], [0.2, 0.3]]))
    tuned = (
        RobustGains("robust", make_controller("ramp", {"time": 0.12}), CRANE),
        GainSchedule("schedule", ramp, (0.5, 2.0), (0.1, 0.3), (times,)),
    )
    grid = {"gap": [0.3, 0.7, 1.1, 3.0], "load_inertia": [0.1, 0.17]}
    for gains in tuned:
        results = sweep(CRANE, gains, grid, workers=1, figures=FIGURES, chunk=3)
        for index in np.ndindex(4, 2):
            same(results, index, single(results, index, gains))
        sweep(CRANE, gains, grid, workers=1, to=tmp_path / gains.label)
        with pytest.raises(InputError, match="has no such parameter"):
            sweep(CRANE, gains, {"controller.time": [0.1, 0.2]}, workers=1)
    other = RobustGains("robust", make_controller("ramp", {"time": 0.12}), CRANE.replace(gap=1.0))
    with pytest.raises(InputError, match="another controller"):
        sweep(CRANE, other, grid, workers=1, to=tmp_path / "robust")


def test_starts_that_fail_are_nan_with_a_status():
    results = sweep(CRANE, "ramp", {"controller.period": [0.001, 1e-9]}, workers=1, chunk=1)
    assert list(Status)[int(results.status[1])] is Status.TOO_MANY_EVENTS
    assert np.isnan(results.k_dyn[1])
    meanings = results.status.attrs["flag_meanings"].split()
    assert meanings[results.status.attrs["flag_values"].index(int(results.status[1]))] == "too_many_events"


@pytest.mark.parametrize("wrong", [
    {"workers": 1.5}, {"chunk": 0}, {"figures": []}, {"figures": ["k_dyn", 3]}, {"until": float("nan")},
    {"fitted_to": machine_table(CRANE, gap=[1, 2])}, {"scheduler": "tcp://127.0.0.1:1", "workers": 2},
])  # fmt: skip
def test_options_that_cannot_be_are_refused_in_one_sentence(wrong):
    with pytest.raises(InputError) as caught:
        sweep(CRANE, "direct", {"gap": [0.5, 1.0]}, **wrong)
    assert len(caught.value.sentences) == 1
    assert next(iter(wrong)) in caught.value.sentences[0]


def test_a_grid_beyond_memory_needs_a_folder():
    axes = {"gap": np.linspace(0, 1, 100_000), "stiffness": np.linspace(100, 500, 10_000)}
    with pytest.raises(InputError, match=r"1,000,000,000 starts are too many .*to=FOLDER"):
        sweep(CRANE, "direct", axes)
