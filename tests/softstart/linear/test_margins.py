"""Margins against closed forms, against python-control, and by what they promise: poles on the circle."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.softstart.linear.speed_loops import CRANE, FREE, SpeedPI

from softstart import Command, PlainController, linear_view
from softstart.linear.loop import Loop, margins
from softstart.linear.systems import System


def closed_poles(loop):
    """Poles of 1 + L = 0, but for the turning as a whole, which a torque loop does not hold (poles at 1)."""
    poles = np.linalg.eigvals(loop.A - loop.B @ loop.C)
    return poles[np.abs(poles - 1.0) > 1e-4]


def off_the_circle(loop, frequency, period):
    """How far the closed-loop pole nearest to a point of the circle is from the circle itself."""
    poles = closed_poles(loop)
    return abs(abs(poles[np.argmin(np.abs(poles - np.exp(1j * frequency * period)))]) - 1.0)


@given(st.floats(0.05, 1.9))
def test_an_integrator(gain):
    # L = g/(z - 1): |L| = g/(2 sin(w/2)), phase -90 degrees - w/2, L(-1) = -g/2
    found = margins(System(*(np.array([[v]]) for v in (1.0, 1.0, gain, 0.0))), 1.0)
    w = 2.0 * math.asin(0.5 * gain)
    assert found.gain_margin == pytest.approx(2.0 / gain, rel=1e-9)
    assert [one.frequency for one in found.gain_crossovers] == pytest.approx([w], rel=1e-9)
    assert found.phase_margin == pytest.approx(0.5 * math.pi - 0.5 * w, rel=1e-9)
    assert found.delay_margin == pytest.approx(found.phase_margin / w, rel=1e-9)


def pair(r, angle, k):
    """Where |z - r e^(i angle)| |z - r e^(-i angle)| = k on the circle: quadratic in cos w."""
    a, b = 1.0 + r * r, r * math.cos(angle)
    rest = a * a - 2.0 * r * r + 2.0 * r * r * math.cos(2.0 * angle) - k**2
    return sorted(math.acos(one) for one in np.roots([4.0 * r * r, -4.0 * a * b, rest]))


@pytest.mark.parametrize("angle", [0.05, 0.3, 2.5])
def test_no_crossing_of_a_narrow_resonance_or_notch_is_missed(angle):
    """L = k/((z - p)(z - p*)), above 1 near its peak alone; (z - p)(z - p*)/(k z^2), below 1 in a notch."""
    for narrow, resonates in ((1e-5, True), (3e-2 * angle, False)):
        r = 1.0 - (narrow if resonates else 0.1 * narrow)
        k = 2.0 * narrow * math.sin(angle) * (1.5 if resonates else 1.0)
        A, B = [[2.0 * r * math.cos(angle), -r * r], [1.0, 0.0]], [[1.0], [0.0]]
        loop = System(np.array(A), np.array(B), np.array([[0.0, k]]), np.zeros((1, 1)))
        if not resonates:
            A, C = [[0.0, 0.0], [1.0, 0.0]], [[-A[0][0] / k, r * r / k]]
            loop = System(np.array(A), np.array(B), np.array(C), np.array([[1.0 / k]]))
        found = [one.frequency for one in margins(loop, 1.0).gain_crossovers]
        assert len(found) == 2
        assert found == pytest.approx(pair(r, angle, k), rel=1e-6)


@pytest.mark.parametrize("angle", [0.3, 1.0, 2.5])
def test_no_crossing_of_a_notch_beside_a_resonance_is_missed(angle):
    """L = k (z - q)(z - q*)/((z - p)(z - p*)): above 1 at the pole and far away, below it about the zero.

    |z - r e^(ia)|^2 |z - r e^(-ia)|^2 is quadratic in cos w, so the four crossings are those of a quadratic.
    """
    k, r, apart = 1.5, 1.0 - 1e-4, 2e-4

    def squared(at):
        a, b = 1.0 + r * r, r * math.cos(at)
        return np.array([4.0 * r * r, -4.0 * a * b, a * a - 2.0 * r * r + 2.0 * r * r * math.cos(2.0 * at)])

    pole, zero = angle, angle + apart
    expected = sorted(map(math.acos, np.roots(k**2 * squared(zero) - squared(pole))))
    p, q = ([1.0, -2.0 * r * math.cos(at), r * r] for at in (pole, zero))
    C = [[k * (q[1] - p[1]), k * (q[2] - p[2])]]
    A, B = [[-p[1], -p[2]], [1.0, 0.0]], [[1.0], [0.0]]
    loop = System(np.array(A), np.array(B), np.array(C), np.array([[k]]))
    found = [one.frequency for one in margins(loop, 1.0).gain_crossovers]
    assert found == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_as_python_control_has_them(seed):
    rng = np.random.default_rng(seed)
    poles = [*rng.uniform(0.3, 0.95, 2), 0.9 * np.exp(1j * rng.uniform(0.3, 2.0))]
    poles = np.array([*poles, np.conj(poles[-1])])
    whole = control.zpk([rng.uniform(-0.5, 0.5)], poles, 0.05 * rng.uniform(1, 5), dt=0.01)
    state = control.ss(whole)
    ours = margins(System(state.A, state.B, state.C, state.D), 0.01)
    gm, _, sm, w_gm, w_pm, _ = control.stability_margins(whole, returnall=True)
    for one in ours.gain_crossovers:
        index = int(np.argmin(np.abs(w_pm - one.frequency)))
        assert w_pm[index] == pytest.approx(one.frequency, rel=1e-6)
    assert len(w_pm) == len(ours.gain_crossovers)
    inside = [k for k, w in zip(gm, w_gm, strict=True) if 0.0 < w < math.pi / 0.01 * (1 - 1e-9)]
    mine = [one.margin for one in ours.phase_crossovers if one.frequency < math.pi / 0.01 * (1 - 1e-9)]
    assert sorted(mine) == pytest.approx(sorted(inside), rel=1e-6)
    assert ours.modulus_margin <= np.min(sm) * (1.0 + 1e-6)


LAGGING = FREE.replace(torque_lag=0.02, computing_delay=0.01, damping=2.0)


@pytest.fixture(scope="module")
def views():
    """Loops with a lag, a delay, an observer, encoder differences."""
    return [
        linear_view(LAGGING.replace(encoder_lines=1024), SpeedPI(2.0, 5.0)),
        linear_view(CRANE, "state-feedback"),
        linear_view(CRANE.replace(torque_lag=0.001), "current-limit-feedback"),
    ]


def test_the_gain_margin_puts_a_pole_on_the_circle(views):
    for view in views:
        own, m = view.loop, view.loop.margins
        crossings = [one for one in m.phase_crossovers if one.margin == m.gain_margin]
        L = own.broken
        loop = L._replace(B=m.gain_margin * L.B)
        assert off_the_circle(loop, crossings[0].frequency, view.loop.period) < 1e-8
        below, above = (closed_poles(loop._replace(B=factor * loop.B)) for factor in (0.98, 1.02))
        assert np.max(np.abs(below)) < 1.0 < np.max(np.abs(above))


def test_the_delay_margin_puts_a_pole_on_the_circle(views):
    for view in views:
        own, m = view.loop, view.loop.margins
        assert off_the_circle(own.broken_delayed(m.delay_margin), m.delay_frequency, view.loop.period) < 1e-8
        L = own.broken_delayed(m.delay_margin).at(np.array([m.delay_frequency]), view.loop.period)
        assert abs(L[0] + 1.0) < 1e-7
        for share in (*np.linspace(0.0, 0.98, 40 if m.delay_margin < 0.02 else 6), 0.999):
            assert np.max(np.abs(closed_poles(own.broken_delayed(share * m.delay_margin)))) < 1.0
        assert np.max(np.abs(closed_poles(own.broken_delayed(1.001 * m.delay_margin)))) > 1.0


def test_the_modulus_margin_is_the_least_distance(views):
    for view in views:
        w = np.geomspace(0.01 * view.drive.Omega, math.pi / view.loop.period, 5_000)
        L = view.loop.broken.at(w, view.loop.period)
        nearest = float(np.min(np.abs(1.0 + L)))
        assert view.loop.margins.modulus_margin <= nearest * (1.0 + 1e-9)
        assert view.loop.margins.modulus_margin == pytest.approx(nearest, rel=1e-3)
        assert view.loop.margins.sensitivity_peak == pytest.approx(1.0 / view.loop.margins.modulus_margin)


class TorqueOfBefore(PlainController):
    """Feeds back its own torque of one sample ago, and a little speed."""

    name = "torque-of-before"

    def step(self, measured, state):
        return Command(10.0 - 0.9 * measured.motor_torque - 0.3 * measured.motor_speed, measured.time + 0.001)


def test_no_delay_below_the_margin_does_harm_where_the_loop_jumps():
    view = linear_view(FREE.replace(damping=1.0), TorqueOfBefore())
    margin = view.loop.margins.delay_margin
    inside = [share * margin for share in np.linspace(0.0, 0.999, 60)]
    inside += [k * view.loop.period for k in range(60) if k * view.loop.period < margin]
    for delay in inside:
        assert np.max(np.abs(closed_poles(view.loop.broken_delayed(delay)))) < 1.0
    assert np.max(np.abs(closed_poles(view.loop.broken_delayed(margin * (1 + 1e-6))))) > 1.0 - 1e-9


class Known(Loop):
    """L = 0.5/(z - 1), whose crossover bears 2.6 samples more; the largest pole is of a known size."""

    period, stable, rotation = 1.0, True, 0.0

    def __init__(self, middle, width):
        object.__setattr__(self, "size", lambda delay: 1.0 + (0.5 * width) ** 2 - (delay - middle) ** 2)

    def broken_delayed(self, delay):
        return System(*(np.array([[v]]) for v in (1.0, 1.0, 0.5, 0.0)))

    def closed(self, delay=0.0):
        return np.array([[-max(self.size(delay), 0.0)]]), np.ones(1), np.ones((2, 1))


@pytest.mark.parametrize("place", np.linspace(2.0, 3.0, 23).tolist())
def test_a_delay_that_does_harm_for_a_twentieth_of_a_sample_is_the_margin(place):
    """Between two parabola's zeros, wherever in a sample."""
    assert Known(place, 0.05).delay_margin == pytest.approx((place - 0.025, math.pi), rel=1e-7)
