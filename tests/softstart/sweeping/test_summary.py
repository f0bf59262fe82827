"""What a sweep is summed up to, against numpy, and its pictures."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart import Drive, Status, simulate, sweep
from softstart.sweeping.entry import SweepProgress
from softstart.sweeping.summary import SHARES, spread, summarise
from softstart.views.sweeps import pace, sweep_figure

CRANE = Drive.load("crane-4amtkf")
NUMBERS = st.lists(st.floats(-1e300, 1e300) | st.just(np.nan), min_size=1, max_size=40)


@settings(max_examples=40, deadline=None)
@given(NUMBERS, st.integers(1, 10))
def test_spreads_are_exact_in_any_pieces(values, size):
    whole = np.array(values) + 0.0
    found = spread(np.split(whole, range(size, len(whole), size)))
    good = whole[~np.isnan(whole)]
    assert found["count"] == good.size
    if not good.size:
        assert np.isnan([value for name, value in found.items() if name != "count"]).all()
        return
    assert (found["min"], found["max"]) == (good.min(), good.max())
    for name, share in SHARES.items():
        assert share == int(name[1:]) / 100
        assert found[name] == np.quantile(good, share, method="inverted_cdf")


def test_the_worst_case_and_how_starts_ended():
    grid = {"gap": [0.5, 3.0, 2.0], "controller": ["ramp", "direct"], "load_inertia": [0.3, 0.1]}
    results = sweep(CRANE, None, grid, workers=1, chunk=2)
    summary = summarise(results)
    worst = max(
        (simulate(CRANE.replace(gap=gap, load_inertia=J2), name).k_dyn, gap, name, J2)
        for gap in grid["gap"] for name in grid["controller"] for J2 in grid["load_inertia"]
    )  # fmt: skip
    assert summary.spreads["k_dyn"]["max"] == worst[0]
    assert summary.worst == {"gap": worst[1], "controller": worst[2], "load_inertia": worst[3]}
    assert summary.statuses == {"REACHED": 12}
    late = summarise(
        sweep(CRANE, "direct", {"gap": [0.5, 2.0]}, until=0.1, workers=1, figures=["start_time"])
    )
    assert late.statuses == {Status.STOPPED_EARLY.name: 2}
    assert (late.share_reached, late.judged, late.worst) == (0.0, "start_time", {})


def results_over(controller="direct", /, **axes):
    return sweep(CRANE, controller, {key.replace("__", "."): value for key, value in axes.items()}, workers=1)


def test_two_axes_are_a_map_of_the_largest_over_the_others():
    axes = {"gap": np.geomspace(4, 0.2, 9), "load__inertia": np.linspace(0.07, 0.35, 7)}
    results = results_over(**axes)
    figure = sweep_figure(results)
    panel = figure.axes[0]
    mesh = panel.collections[0]
    # rows in the order of the axis whatever that of the grid, every start in its place
    drawn = mesh.get_array().reshape(9, 7)
    np.testing.assert_array_equal(drawn, results.k_dyn.values[::-1])
    assert (panel.get_xscale(), panel.get_yscale()) == ("linear", "log")
    assert panel.get_xlabel() == "load inertia J2, kg m2"
    assert panel.get_ylabel() == "gap, rad"
    (marker,) = panel.lines
    worst = results.k_dyn.where(results.k_dyn == results.k_dyn.max(), drop=True)
    assert marker.get_xydata().tolist() == [[float(worst.load_inertia[0]), float(worst.gap[0])]]
    many = results_over(**axes, stiffness=[100, 200, 300, 400], damping=[0.0, 1.0])
    drawn = sweep_figure(many).axes[0].collections[0].get_array().reshape(9, 7)
    np.testing.assert_array_equal(drawn, many.k_dyn.max(["stiffness", "damping"]).values[::-1])


def test_one_axis_makes_curves():
    results = results_over(None, gap=[2.0, 0.5, 1.0], controller=["direct", "ramp"])
    (panel, *_) = sweep_figure(results).axes
    lines = panel.lines[:2]
    for line, name in zip(lines, ("direct", "ramp"), strict=True):
        assert line.get_label() == name
        np.testing.assert_array_equal(
            line.get_ydata(), results.k_dyn.sel(controller=name, gap=[0.5, 1.0, 2.0])
        )
    assert sweep_figure(results_over(None, controller=["direct", "ramp"])) is None


def test_starts_without_a_figure_leave_a_hole():
    results = sweep(
        CRANE, "ramp", {"gap": [0.5, 1.0, 2.0], "controller.period": [0.001, 0.002, 1e-9]}, workers=1
    )
    figure = sweep_figure(results)
    assert np.ma.getmaskarray(figure.axes[0].collections[0].get_array()).reshape(3, 3)[:, 0].all()
    assert "grey: no figure" in figure.get_suptitle()


def test_one_start_is_no_starts():
    assert pace(SweepProgress(1, 1, 0, 0.01)) == "1 start; 100 starts/s in 0.0 s."
    assert pace(SweepProgress(4000, 4000, 500, 2.0)).startswith(
        "4,000 starts, of which 500 were finished before"
    )
