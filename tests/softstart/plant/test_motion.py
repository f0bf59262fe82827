"""The closed forms of one span against matrix exponentials, through every kind of damping and resonance."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from softstart import Drive, simulate
from softstart.plant import layout as at
from softstart.plant.crossing import bounds
from softstart.plant.motion import (
    FROM_START,
    IN_PARTS,
    SERIES,
    derivatives,
    forcing_tail,
    motion,
    prepare,
    remainders,
    write_without_cancelling,
)  # fmt: skip


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


# where the parts of the torque cancel ---------------------------------------------------------------------

CRANE = Drive.load("crane-4amtkf")
# w0, zeta: gap open, undamped, damped, overdamped
SPRINGS = [(0.0, 0.0), (3.0, 0.0), (3.0, 0.4), (3.0, 3.0), (3.0, 40.0)]


def by_series(
    spring: tuple[float, float],
    rate: float,
    start: tuple[float, float],
    f: tuple[float, float, float],
    s: float,
) -> tuple[float, float]:
    """The motion by its power series in arithmetic of 160 digits; f is the torque, its slope, and E."""
    with localcontext() as context:
        context.prec = 160
        w0, zeta, lam, x = (Decimal(number) for number in (*spring, rate, s))
        before, this = Decimal(start[0]), Decimal(start[1])
        z, v, power, e = before, this, Decimal(1), Decimal(f[2])
        for n in range(900):
            push = Decimal(f[n]) if n < 2 else e * lam**n * (-1) ** n
            before, this = this, push - 2 * zeta * this - w0 * w0 * before
            power *= x / (n + 1)
            z += before * power
            v += this * power
        return float(z), float(v)


@pytest.mark.parametrize("x", [1e-300, 1e-9, 1e-3, 0.3, 0.999, 1.001, 3.0, 50.0])
def test_what_follows_the_first_terms_of_the_exponential(x: float) -> None:
    with localcontext() as context:
        context.prec = 80
        y = Decimal(x)
        second = (-y).exp() - 1 + y if x > 1e-20 else y * y / 2
        third = y * y / 2 - second if x > 1e-20 else y**3 / 6
        fourth = y**3 / 6 - third if x > 1e-20 else y**4 / 24
        expected = [float(second), float(third), float(fourth)]
    np.testing.assert_allclose(remainders(x), expected, rtol=2e-14)


@pytest.mark.parametrize("spring", SPRINGS)
@pytest.mark.parametrize("rate", [1.0, 1e-3, 1e-6, 1e-9, 1e-12])
def test_a_lag_far_longer_than_the_span(spring: tuple[float, float], rate: float) -> None:
    """The limiter rises with 1 a second, the lag takes 1/rate: E is 1/rate, and the motion is tiny."""
    w0, zeta = spring
    f = (0.0, 0.0, 1.0 / rate)
    m = np.zeros(at.N_M).view(at.MOTION)[0]
    inverse = 1.0 / w0**2 if w0 else 0.0
    prepare(m, 0.0, 0.0, w0 * w0, 2.0 * zeta, w0 * w0, w0, inverse, zeta, -f[2], 1.0, f[2], rate)
    write_without_cancelling(m, f[0], f[1], False)
    assert m.form == FROM_START
    near = 3e-12 * max(1.0, (zeta / max(w0, 1.0)) ** 2)
    for s in (0.3, 1.0, 2.0):
        exact = by_series(spring, rate, (0.0, 0.0), f, s)
        np.testing.assert_allclose(motion(m, s), exact, rtol=near)


@pytest.mark.parametrize("spring", SPRINGS[1:])
@pytest.mark.parametrize("rate", [0.0, 1e-6, 1e3, 1e9])
@pytest.mark.parametrize("length", [1e-5, 1e-9, 1e-15])
def test_a_torque_that_rises_faster_than_the_spring_can_answer(
    spring: tuple[float, float], rate: float, length: float
) -> None:
    """By 1 within the span: B/w0^2 is far larger than the motion; also behind a lag of any length."""
    w0, zeta = spring
    length = min(length, 1.0 / rate) if rate else length
    slope = 1.0 / length
    e = slope / rate if rate else 0.0
    f = (0.3, 0.0 if rate else slope, e)
    m = np.zeros(at.N_M).view(at.MOTION)[0]
    prepare(m, 0.01, -0.2, w0 * w0, 2.0 * zeta, w0 * w0, w0, 1.0 / w0**2, zeta, 0.3 - e, slope, e, rate)
    write_without_cancelling(m, f[0], f[1], True)
    assert m.form == SERIES
    limits = bounds(m, 0.0, length, 0.01, -0.2, forcing_tail(m, 0.0))
    for s in np.linspace(0.0, length, 5):
        z, v = motion(m, s)
        np.testing.assert_allclose((z, v), by_series(spring, rate, (0.01, -0.2), f, s), rtol=1e-14)
        found = (v, *derivatives(m, s, z, v, forcing_tail(m, s)))
        assert np.all(np.abs(found) <= np.array(limits[:4]) * (1.0 + 1e-9))


def root_of(f: Callable[[Decimal], Decimal], low: float, high: float) -> float:
    """Where f rises through zero, in the arithmetic of the caller."""
    below, above = Decimal(low), Decimal(high)
    for _ in range(160):
        middle = (below + above) / 2
        below, above = (middle, above) if f(middle) < 0 else (below, middle)
    return float(above)


@pytest.mark.parametrize("lag", [1e-2, 1.0, 1e2, 1e4, 1e6, 1e9])
@pytest.mark.parametrize("rise", [1e-9, 1e-6, 1e-3, 0.05])
def test_first_contact_behind_any_lag_and_limit(lag: float, rise: float) -> None:
    """From mid-gap: the torque of the ramp behind the lag, twice integrated, less that of the ramp's end."""
    drive = CRANE.replace(
        torque_lag=lag, torque_rate=float(CRANE.Ms) / rise, start_position="mid-gap", load_torque=1e-9
    )
    run = simulate(drive, "direct", until=200.0)
    with localcontext() as context:
        context.prec = 80
        L, R, D = Decimal(lag), Decimal(float(drive.torque_rate)), Decimal(float(drive.Ms))
        J1, J2, half = Decimal(float(drive.J1)), Decimal(float(drive.J2)), Decimal(float(drive.gap)) / 2
        Mc, end = Decimal(float(drive.Mc)), D / R

        def ramp(t: Decimal) -> Decimal:
            """The second integral of a ramp behind the lag."""
            return R * (t**3 / 6 - L * t**2 / 2 + L**2 * t - L**3 * (1 - (-t / L).exp()))

        def twist(t: Decimal) -> Decimal:
            u = ramp(t) - (ramp(t - end) if t > end else 0)
            return u / J1 + Mc * t**2 / (2 * J2) - half

        contact = root_of(twist, 0.0, 200.0)
    assert run.first_contact == pytest.approx(contact, rel=2e-13)


@pytest.mark.parametrize("lag", [0.0, 1e-9, 1e-6, 0.01])
@pytest.mark.parametrize("damping", [0.0, 0.6])
def test_a_limiter_without_effect_has_none(lag: float, damping: float) -> None:
    """Wound up from the driving flank: a limiter that slews in 1e-10 s and less hardly counts."""
    drive = CRANE.replace(start_position="driving-flank", damping=damping, torque_lag=lag)
    step = simulate(drive, "direct", until=0.4)
    for rate in (1e12, 1e14, 1e16, 1e18, 1e24):
        run = simulate(drive.replace(torque_rate=rate), "direct", until=0.4)
        near = 1e-12 + 100.0 * 62.0 / rate  # the slewing, s, times rates of change of no more than 100/s
        assert run.peak_torque == pytest.approx(step.peak_torque, rel=near), rate
        mine, theirs = run.at(0.3), step.at(0.3)
        for name in ("w1", "w2", "T"):
            assert float(mine[name]) == pytest.approx(float(theirs[name]), rel=near), rate


def test_ordinary_spans_are_written_in_parts() -> None:
    """A lag of a few ms and a limiter of tenths of a second change no bit."""
    m = span(3.0, 0.2, 2.0, (1.0, -2.0, 3.0))
    assert m.form == IN_PARTS
