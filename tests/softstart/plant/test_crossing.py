"""The certified search never passes a crossing, also where two lie close together."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart.plant import layout as at
from softstart.plant.crossing import NO_CROSSING, RISING, WATCH, bounds, first_crossing, load_speed
from softstart.plant.jit import compiled
from softstart.plant.motion import derivatives, forcing_tail, motion, prepare, write_without_cancelling
from softstart.plant.steady import largest_gain, steady_target
from softstart.plant.terms import terms

NO_LOAD = (0.0,) * 7


def swing(
    z0: float, v0: float, w0: float, zeta: float, forcing: tuple[float, float, float], rate: float
) -> np.ndarray:
    m = np.zeros(at.N_M).view(at.MOTION)[0]
    prepare(m, z0, v0, w0 * w0, 1.0, w0 * w0, w0, 1.0 / w0**2, zeta, *forcing, rate)
    return m


def swing_from_start(
    z0: float, v0: float, w0: float, zeta: float, forcing: tuple[float, float, float], rate: float
) -> np.ndarray:
    """The same motion, its torque written as it is for a lag far longer than the span."""
    m = swing(z0, v0, w0, zeta, forcing, rate)
    a, b, e = forcing
    write_without_cancelling(m, a + e, b - rate * e, False)
    return m


SWING = (
    st.floats(-1.0, 1.0),
    st.floats(-5.0, 5.0),
    st.floats(0.5, 10.0),
    st.floats(0.0, 12.0),
    st.tuples(*[st.floats(-5.0, 5.0)] * 3),
)
SWINGS = st.one_of(
    st.builds(swing, *SWING, st.floats(0.1, 50.0)), st.builds(swing_from_start, *SWING, st.floats(1e-3, 2.0))
)


def weights(largest: float) -> st.SearchStrategy[float]:
    """Zero, or a number of ordinary size of either sign."""
    return st.one_of(st.just(0.0), st.floats(1e-6, largest), st.floats(-largest, -1e-6))


@compiled
def _combined(m, alpha, beta, gamma, instants, values):  # type: ignore[no-untyped-def]
    for i in range(instants.shape[0]):
        s = instants[i]
        z, v = motion(m, s)
        a = derivatives(m, s, z, v, forcing_tail(m, s))[0]
        values[i] = alpha * z + beta * v + gamma * a


def combined(m: np.ndarray, alpha: float, beta: float, gamma: float, instants: np.ndarray) -> np.ndarray:
    """alpha z + beta z' + gamma z'' at each instant."""
    values = np.empty(instants.size)
    _combined(m, alpha, beta, gamma, instants, values)
    return values


@pytest.mark.parametrize("by_terms", [0.0, 1.0])
@settings(max_examples=300, deadline=None)
@given(SWINGS, st.floats(0.0, 1.0), weights(2.0), weights(1.0), weights(0.2))
def test_against_a_fine_grid(
    by_terms: float, m: np.ndarray, above: float, alpha: float, beta: float, gamma: float
) -> None:
    end = 4.0
    m.by_terms = by_terms

    def f(*instants: float) -> np.ndarray:
        return c0 + combined(m, alpha, beta, gamma, np.array(instants))

    c0 = 0.0
    c0 = above - float(f(0.0)[0]) + 1e-9  # begins above zero
    found = first_crossing(m, c0, alpha, beta, gamma, 0.0, NO_LOAD, WATCH, 0.0, end)
    grid = np.linspace(0.0, end, 2001)
    values = f(*grid)
    size = 1.0 + float(np.abs(values).max())
    negative = np.flatnonzero(values < -1e-9 * size)
    if found == NO_CROSSING:
        assert negative.size == 0
    else:
        assert 0.0 <= found <= end
        assert abs(f(found)[0]) < 1e-11 * size
        assert negative.size == 0 or found <= grid[negative[0]]
        before = values[grid < found]
        assert before.size == 0 or before.min() > -1e-11 * size


@settings(max_examples=300, deadline=None)
@given(SWINGS, st.floats(0.0, 3.0))
def test_bounds_hold_to_the_end_of_the_span(m: np.ndarray, s: float) -> None:
    end = 4.0
    z, v = motion(m, s)
    limits = bounds(m, s, end, z, v, forcing_tail(m, s))
    for later in np.linspace(s, end, 60):
        z, v = motion(m, later)
        found = (v, *derivatives(m, later, z, v, forcing_tail(m, later)))
        for value, limit in zip(found, limits, strict=False):
            assert abs(value) <= limit * (1 + 1e-9) + 1e-9


@settings(max_examples=300, deadline=None)
@given(SWINGS, st.floats(0.0, 3.0), st.floats(0.0, 1.0), weights(2.0), weights(1.0), weights(0.2))
def test_the_least_curvature_of_the_terms_is_least(
    m: np.ndarray, s: float, window: float, alpha: float, beta: float, gamma: float
) -> None:
    """f'' by the equation of motion, at 40 instants of the window, is nowhere below what `terms` says."""
    lowest = terms(m, 0.5, alpha, beta, gamma, 0.0, NO_LOAD, s, s + window)[3]
    for later in np.linspace(s, s + window, 40):
        z, v = motion(m, later)
        a, jerk, snap = derivatives(m, later, z, v, forcing_tail(m, later))
        f, slope, curve = terms(m, 0.5, alpha, beta, gamma, 0.0, NO_LOAD, later, s + window)[:3]
        # the equation of motion cancels: 2 zeta v + w0^2 z against the forcing
        swing = (abs(m.A) + abs(m.B) * 4.0 + abs(m.E) + m.w0sq * abs(z) + m.zeta * abs(v)) * 1e-13
        stiff = 1.0 + m.rate + m.zeta + m.w0sq
        assert f == pytest.approx(0.5 + alpha * z + beta * v + gamma * a, rel=1e-9, abs=swing * stiff)
        assert slope == pytest.approx(alpha * v + beta * a + gamma * jerk, rel=1e-9, abs=swing * stiff**2)
        exact = alpha * a + beta * jerk + gamma * snap
        assert curve == pytest.approx(exact, rel=1e-9, abs=swing * stiff**3)
        assert lowest <= curve + 1e-12 * abs(curve) + 1e-12


@pytest.mark.parametrize("by_terms", [0.0, 1.0])
def test_a_pair_of_crossings_a_millionth_apart_is_seen(by_terms: float) -> None:
    """z = cos(s) dips below its threshold for a moment only: a grid or a sign test would miss it."""
    m = swing(1.0, 0.0, 1.0, 0.0, (0.0, 0.0, 0.0), 1.0)
    m.by_terms = by_terms
    for dip in (1e-3, 1e-6, 1e-10):
        s = first_crossing(m, 1.0 - dip, 1.0, 0.0, 0.0, 0.0, NO_LOAD, WATCH, 0.0, 6.0)
        assert s == pytest.approx(math.acos(-1.0 + dip), rel=1e-7)
        assert s < math.pi
    assert first_crossing(m, 1.0 + 1e-6, 1.0, 0.0, 0.0, 0.0, NO_LOAD, WATCH, 0.0, 6.0) == NO_CROSSING


def test_an_event_just_handled_does_not_fire_again() -> None:
    m = swing(0.0, 1.0, 1.0, 0.0, (0.0, 0.0, 0.0), 1.0)  # z = sin(s) leaves zero upwards
    assert first_crossing(m, 0.0, 1.0, 0.0, 0.0, 0.0, NO_LOAD, RISING, 0.0, 6.0) == pytest.approx(
        math.pi, rel=1e-14
    )
    touching = swing(0.0, 0.0, 1.0, 0.0, (1.0, 0.0, 0.0), 1.0)  # z = 1 - cos(s) touches zero
    assert first_crossing(touching, 0.0, 1.0, 0.0, 0.0, 0.0, NO_LOAD, RISING, 0.0, 6.0) == NO_CROSSING


@settings(max_examples=300, deadline=None)
@given(
    v0=st.floats(0.01, 50.0),
    mean=st.floats(0.0, 5.0),
    load=st.floats(0.0, 4.0),
    J2=st.floats(0.1, 10.0),
    share=st.floats(0.0, 1.2),
)
def test_the_target_search_of_steady_contacts_agrees(
    v0: float, mean: float, load: float, J2: float, share: float
) -> None:
    """The Newton that starts at the peak of T finds and misses what the certified search does."""
    w0, J1 = 2.0, 1.0
    k = w0 * w0 * J1 * J2 / (J1 + J2)
    u = mean * k - load * J1 / J2 * 1.0  # so that z swings about some place near `mean`
    m = np.zeros(at.N_M).view(at.MOTION)[0]
    prepare(m, 0.0, v0, k, 0.0, w0 * w0, w0, 1.0 / w0**2, 0.0, u / J1 + load / J2, 0.0, 0.0, 0.0)
    m.w0 = w0
    end = 2.0 * math.atan2(v0, -w0 * m.p0) / w0
    total = J1 + J2
    speeds = (0.3, (u - load) / total, 0.0, 0.0, J1 / total, 1.0 / J2, -load / J2)
    times = np.linspace(0.0, end, 400)
    w2 = np.array([load_speed(m, speeds, s, motion(m, s)[1]) for s in times])
    p = np.zeros(at.N_P).view(at.PLANT)[0]
    p.Mc = load
    assert w2.max() <= 0.3 + largest_gain(p, m, speeds, end) * (1 + 1e-12) + 1e-12
    target = 0.3 + share * (w2.max() - 0.3) + 1e-6
    found = steady_target(m, speeds, target, end)
    expected = first_crossing(m, target, 0.0, 0.0, 0.0, -1.0, speeds, WATCH, 0.0, end)
    if abs(w2.max() - target) > 1e-4 * (abs(target) + 1.0):  # beside the very top, where either may be right
        # near the start the load has hardly gained: the difference of two speeds leaves fewer digits
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * end)
