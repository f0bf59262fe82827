"""Life of the shafts of a chain: against the drive's own turning points, dense samples, and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from tests.twin import chain_of

from softstart import Chain, Drive, InputError, fatigue, simulate
from softstart.start.fatigue import rainflow_cycles, torque_turning_points

DAMPED = {f"shaft[{k}].damping_ratio": "0.02" for k in (1, 2, 3)}


@pytest.fixture(scope="module")
def chain() -> Chain:
    return Chain.load("crane-4-mass", also=DAMPED)


def test_turning_points_are_those_of_dense_samples(chain: Chain) -> None:
    run = simulate(chain, "ramp")
    t = np.linspace(0.0, run.end_time, 100_000)
    sampled = run.at(t)["T"]
    for k in range(3):
        points = torque_turning_points(run, k)
        located, dense = (rainflow_cycles(one, repeated=True) for one in (points[:, 1], sampled[:, k]))
        scale = located[0, 0]
        large = [one[one[:, 0] > 1e-2 * scale] for one in (located, dense)]
        assert large[0].shape == large[1].shape
        np.testing.assert_allclose(large[0][:, 0], large[1][:, 0], atol=1e-5 * scale)
        assert np.abs(points[:, 1]).max() == pytest.approx(run.peak_torques[k], rel=1e-9)
        rises = np.diff(points[:, 1])
        assert (rises[1:] * rises[:-1] < 0.0).all()
        assert (np.diff(points[:, 0]) >= 0.0).all()


def test_estimated_damping_is_the_ratio_of_the_first_natural_vibration() -> None:
    """A chain of two masses lives as its drive, whose gap wears alike."""
    parts = {"gears": 3, "couplings": 2}
    bare = Chain.load("crane-4-mass")
    assert bare.with_damping_ratio(0.04).damping_ratio == pytest.approx(0.04, rel=1e-12)
    assert fatigue(simulate(bare, "ramp"), estimate_damping=parts).drive == bare.with_damping_ratio(0.04)
    drive = Drive.load("crane-4amtkf")
    runs = [simulate(one, "ramp", fitted_to=drive) for one in (drive, chain_of(drive))]
    (mine,), (same,) = (fatigue(run, estimate_damping=parts, worn_gap=2.0).rows for run in runs)
    for name in ("relative_range", "worn_relative", "equivalent_torque", "relative", "impact_energy"):
        assert getattr(same, name) == pytest.approx(getattr(mine, name), rel=1e-7), name
    assert same.impacts == mine.impacts


def test_what_cannot_be_counted_is_refused() -> None:
    with pytest.raises(InputError, match="damping is missing in rotor - pinion"):
        fatigue(simulate("crane-4-mass", "ramp"))
