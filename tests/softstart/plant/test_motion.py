"""The closed forms of one span against matrix exponentials, through every kind of damping and resonance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from softstart.plant import layout as at
from softstart.plant.motion import derivatives, forcing_tail, motion, prepare


def span(w0: float, ratio: float, rate: float, forcing: tuple[float, float, float]) -> np.ndarray:
    """Coefficients of a span that starts at z = 0.3, z' = -0.7."""
    m = np.zeros(at.N_M).view(at.MOTION)[0]
    prepare(m, 0.3, -0.7, w0 * w0, 1.0, w0 * w0, w0, 1.0 / w0**2, ratio * w0, *forcing, rate)
    return m


def by_matrix(
    w0: float, ratio: float, rate: float, forcing: tuple[float, float, float], s: float
) -> np.ndarray:
    """The same by the exponential of the augmented system (z, z', 1, s, exp(-rate s))."""
    a, b, e = forcing
    system = np.array(
        [
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [-w0 * w0, -2.0 * ratio * w0, a, b, e],
            [0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, -rate],
        ]
    )
    return np.asarray(expm(system * s) @ np.array([0.3, -0.7, 1.0, 0.0, 1.0]))[:2]


@settings(max_examples=400, deadline=None)
@given(
    w0=st.floats(0.1, 30.0),
    ratio=st.one_of(st.floats(0.0, 3.0), st.sampled_from([0.0, 1.0, 1.0 - 1e-9, 1.0 + 1e-9, 0.99, 1.01])),
    nearness=st.one_of(st.floats(0.01, 10.0), st.sampled_from([1.0, 1.0 + 1e-9, 1.0 - 1e-5, 0.999])),
    forcing=st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    s=st.floats(0.0, 3.0),
)
@example(w0=1.0, ratio=1.0, nearness=1.0, forcing=(1.0, -2.0, 3.0), s=2.5)  # all three rates equal
@example(w0=2.0, ratio=1.5, nearness=1.0, forcing=(1.0, -2.0, 3.0), s=2.5)  # lag on the slow rate
@example(w0=1.0, ratio=0.99999, nearness=0.99999, forcing=(0.0, 0.0, 1.0), s=1.0)  # lag on the decay rate
def test_contact(
    w0: float, ratio: float, nearness: float, forcing: tuple[float, float, float], s: float
) -> None:
    # lambda near one of the spring's own decay rates, where the textbook solution divides by zero
    slow = w0 * (ratio - math.sqrt(ratio * ratio - 1.0)) if ratio > 1.0 else w0
    rate = slow * nearness
    m = span(w0, ratio, rate, forcing)
    mine = np.array(motion(m, s))
    expected = by_matrix(w0, ratio, rate, forcing, s)
    size = 1.0 + np.abs(forcing).sum() * (1.0 + s) / min(1.0, w0 * w0)
    np.testing.assert_allclose(mine, expected, atol=2e-11 * size * max(1.0, w0))


@settings(max_examples=200, deadline=None)
@given(rate=st.floats(1e-3, 1e4), forcing=st.tuples(*[st.floats(-5.0, 5.0)] * 3), s=st.floats(0.0, 2.0))
def test_open_gap(rate: float, forcing: tuple[float, float, float], s: float) -> None:
    m = np.zeros(at.N_M).view(at.MOTION)[0]
    prepare(m, 0.3, -0.7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *forcing, rate)
    a, b, e = forcing
    x = rate * s
    z, v = motion(m, s)
    assert v == pytest.approx(-0.7 + a * s + b * s * s / 2 - e * math.expm1(-x) / rate, abs=1e-13 * 20)
    # int of (1 - exp(-rate s))/rate: by series where it would cancel
    if x < 0.5:
        tail = s * s * sum((-x) ** n / math.factorial(n + 2) for n in range(25))
    else:
        tail = (x + math.expm1(-x)) / rate**2
    assert z == pytest.approx(0.3 - 0.7 * s + a * s * s / 2 + b * s**3 / 6 + e * tail, abs=1e-13 * 50)


@pytest.mark.parametrize("ratio", [0.0, 0.3, 1.0, 2.0])
def test_derivatives_are_those_of_the_motion(ratio: float) -> None:
    m = span(3.0, ratio, 2.0, (1.0, -2.0, 3.0))
    s, h = 0.7, 1e-4
    z, v = motion(m, s)
    a, jerk, snap = derivatives(m, s, z, v, forcing_tail(m, s))
    speeds = [motion(m, s + k * h)[1] for k in (-2, -1, 0, 1, 2)]
    assert a == pytest.approx((speeds[3] - speeds[1]) / (2 * h), rel=1e-6)
    assert jerk == pytest.approx((speeds[3] - 2 * speeds[2] + speeds[1]) / h**2, rel=1e-5)
    third = (speeds[4] - 2 * speeds[3] + 2 * speeds[1] - speeds[0]) / (2 * h**3)
    assert snap == pytest.approx(third, rel=1e-3)
