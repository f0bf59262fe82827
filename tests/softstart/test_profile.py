"""TorqueProfile: values, cutting, sampling."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from softstart import InputError, TorqueProfile


@some.composite
def profiles(draw: some.DrawFn) -> TorqueProfile:
    lengths = draw(some.lists(some.just(0.0) | some.floats(1e-6, 0.3), max_size=8))
    size = len(lengths) + 1
    torques = draw(some.lists(some.floats(-100.0, 100.0), min_size=size, max_size=size))
    return TorqueProfile(np.cumsum([0.0, *lengths]), torques)


def instants(profile: TorqueProfile) -> np.ndarray:
    """An even grid, and the middle of every piece; not the knots themselves."""
    between = 0.5 * (profile.time[1:] + profile.time[:-1])
    return np.setdiff1d(
        np.concatenate([np.linspace(0.0, 1.1 * profile.end + 0.01, 97), between]), profile.time
    )


@given(profiles(), some.floats(-120.0, 120.0), some.floats(0.0, 150.0))
def test_clipped_is_the_clipped_value_at_every_instant(
    profile: TorqueProfile, lowest: float, width: float
) -> None:
    cut = profile.clipped(lowest, lowest + width)
    t = instants(profile)
    steepest = np.max(
        np.abs(np.diff(profile.torque)) / np.maximum(np.diff(profile.time), 1e-300), initial=0.0
    )
    off = 1e-10 + 1e-15 * min(float(steepest), 1e9)
    np.testing.assert_allclose(cut.at(t), profile.at(t).clip(lowest, lowest + width), rtol=0.0, atol=off)
    assert cut.torque.min() >= lowest
    assert cut.torque.max() <= lowest + width


@given(profiles())
def test_within_its_limits_nothing_changes(profile: TorqueProfile) -> None:
    same = profile.clipped(-np.inf, 100.0)
    assert same.time.tobytes() == profile.time.tobytes()
    assert np.array_equal(same.torque, profile.torque)


@given(profiles(), some.floats(0.01, 0.5))
def test_a_sample_holds_the_mean(profile: TorqueProfile, period: float) -> None:
    sampled = profile.sampled(period)
    for k in range(int(np.ceil(profile.end / period))):
        edges = np.unique(
            np.clip([k * period, (k + 1) * period, *profile.time], k * period, (k + 1) * period)
        )
        mean = np.sum(np.diff(edges) * profile.at(0.5 * (edges[1:] + edges[:-1]))) / (edges[-1] - edges[0])
        assert float(sampled.at((k + 0.5) * period)) == pytest.approx(float(mean), abs=1e-9)
    assert float(sampled.at(profile.end + 2.0 * period)) == pytest.approx(float(profile.torque[-1]), abs=1e-9)


def test_both_profiles_are_cut_and_sampled() -> None:
    pair = TorqueProfile([0.0], [10.0], after_contact=TorqueProfile([0.0, 1.0], [0.0, 100.0]))
    assert pair.clipped(0.0, 50.0).after_contact.at([0.25, 0.75]).tolist() == [25.0, 50.0]  # type: ignore[union-attr]
    assert pair.sampled(0.5).after_contact.at([0.0, 0.5, 1.0]).tolist() == [25.0, 75.0, 100.0]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("time", "torque", "words"),
    [
        ([0.0, 1.0], [1.0], "2 times for 1 torques"),
        ([0.0, 0.2, 0.1], [1.0, 1.0, 1.0], "falls from 0.2 s to 0.1 s at knot 3"),
        ([0.0], [np.nan], "not finite"),
    ],
)
def test_what_is_no_profile(time: list[float], torque: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        TorqueProfile(time, torque)
