"""Sweeps of chains: each start is that of `simulate`, to the bit, whatever the axes; resumed to the bit."""

import numpy as np
import pytest

from softstart import InputError, Status, simulate, sweep
from softstart.chain import Chain
from softstart.start.batch import figure_columns

CHAIN = Chain.from_toml(
    Chain.load("crane-4-mass").to_toml(),
    also={f"shaft[{k}].damping_ratio": "0.02" for k in (1, 2, 3)}
    | {"shaft[2].permissible_torque": "150", "motor.torque_lag": "2 ms"},
)
GRID = {
    "controller": ["s-curve", "take-up"],
    "shaft.gap": ["1x", "2x"],
    "mass[crane].inertia": ["0.4x", 80.0],
    "shaft[pinion - wheel shaft].stiffness": [800.0, "1.2x"],
    "start.position": ["unknown", "driving-flank"],
}


def same(results, **options):
    """Whether every figure at every place is that of a single start."""
    for index in np.ndindex(results.status.shape):
        one = results.isel(dict(zip(results.status.dims, index, strict=True)))
        values = {str(key): value.item() for key, value in one.coords.items()}
        controller = values.pop("controller", "s-curve")
        own = {k.removeprefix("controller_"): values.pop(k) for k in [*values] if k.startswith("controller_")}
        values.pop("sample", None)
        run = simulate(CHAIN.with_values(values), controller, parameters=own, **options)
        assert list(Status)[int(one.status)] is run.status
        expected = {"k_dyn": run.k_dyn, "start_time": run.start_time, "peak_torque": run.peak_torque}
        expected |= {f"k_dyn_{k + 1}": value for k, value in enumerate(run.k_dyns)}
        for name, value in expected.items():
            np.testing.assert_equal(float(one[name]), float(value), err_msg=f"{name} {values}")
        if np.isfinite(run.start_time):
            assert float(one.margin) == pytest.approx(1.0 - 0.01 * run.used_torque, rel=1e-12)


def test_any_mass_shaft_gap_load_and_position():
    results = sweep(CHAIN, None, GRID, workers=1, chunk=5)
    assert dict(results.sizes) == {
        "controller": 2, "gap": 2, "mass_4_inertia": 2, "shaft_2_stiffness": 2, "start_position": 2,
    }  # fmt: skip
    assert results.mass_4_inertia.values.tolist() == [27.68, 80.0]
    same(results)


def test_samples_and_parameters_of_the_controller_set_up_for_another_chain():
    sample = {"shaft[1].gap": [0.05, 0.3, 0.1], "load.torque": [100.0, 143.2, 0.0]}
    nominal = CHAIN.scaled(gaps=1.5)
    grid = {"sample": sample, "controller.time": ["50 ms", "0.2 s"]}
    results = sweep(CHAIN, "s-curve", grid, fitted_to=nominal, workers=1)
    assert results.shaft_1_gap.values.tolist() == sample["shaft[1].gap"]
    same(results, fitted_to=nominal)


def test_figures_of_a_chain_are_named():
    known = figure_columns(CHAIN.shaft_names)
    assert {"k_dyn_3", "peak_torque_1", "used_torque", "margin", "gap_events"} <= set(known)
    results = sweep(CHAIN, "direct", {"gap": ["1x"]}, figures=["peak_torque_2", "used_torque"], workers=1)
    run = simulate(CHAIN, "direct")
    assert float(results.peak_torque_2[0]) == run.peak_torques[1]
    assert float(results.used_torque[0]) == pytest.approx(run.used_torque, rel=1e-12)
    with pytest.raises(InputError, match="did you mean k_dyn_3"):
        sweep(CHAIN, "direct", {"gap": ["1x"]}, figures=["k_dyn_4"])
