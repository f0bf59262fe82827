"""The pressure: against an integration of the first law, and by its work."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from tests.softstart.balancing.engines import RPM, engine

from softstart.balancing import Cylinders, SimpleCycle
from softstart.balancing.gas import torque_harmonics
from softstart.errors import InputError

ONE = Cylinders(0.08, 0.084, 0.14, firing_angles=(0.0,))
W = 300.0


def volume(cycle, theta):
    return ONE.displacement / (cycle.compression_ratio - 1.0) + ONE.stroke_volume(theta)


def pressure(cycle, theta, load=1.0):
    theta = np.atleast_1d(np.asarray(theta, dtype=float))
    return cycle.weights(ONE, W, load) @ cycle.shapes(ONE, theta) + cycle.crankcase_pressure


cycles = st.builds(
    SimpleCycle,
    st.floats(6.0, 18.0),
    st.floats(8e5, 2e6),
    intake_pressure=st.floats(0.8e5, 1.5e5),
    combustion_start=st.floats(0.0, 0.6),
    combustion_duration=st.floats(0.5, 1.6),
    vibe_exponent=st.floats(0.5, 4.0),
    compression_exponent=st.floats(1.25, 1.38),
    expansion_exponent=st.floats(1.2, 1.38),
    exhaust_opening=st.floats(1.7, 3.1),
    blowdown=st.floats(0.0, 2.0),
)


@pytest.mark.parametrize(("m", "start", "duration", "opening"), [(0.5, 0.1, 0.8, 2.0), (4.0, 0.6, 1.6, 3.0)])
def test_burning_obeys_the_first_law(m, start, duration, opening):
    # dp = [(n - 1) Q dx - n p dV]/V, integrated with nothing of the module but Q and the first pressure
    times = {"combustion_start": start, "combustion_duration": duration, "exhaust_opening": opening}
    cycle = SimpleCycle(10.0, 9e5, vibe_exponent=m, **times)
    n, Q, log = cycle.expansion_exponent, cycle.heat(ONE, W), math.log(1000.0)

    def rate(psi, p):
        tau = min(max((psi + start) / duration, 0.0), 1.0)
        dx = log * (m + 1.0) * tau**m * 1e-3 ** (tau ** (m + 1.0)) / duration / (1.0 - 1e-3) * (tau < 1.0)
        sine, cosine = math.sin(psi), math.cos(psi)
        q = math.sqrt(1.0 - (0.3 * sine) ** 2)
        stroke = 0.042 * (1.0 - cosine) + 0.14 * (1.0 - q)
        V = ONE.area * (0.084 / 9.0 + stroke)
        dV = ONE.area * 0.042 * sine * (1.0 + 0.3 * cosine / q)
        return ((n - 1.0) * Q * dx - n * p * dV) / V

    first = float(pressure(cycle, -start % (4 * math.pi))[0])
    middle = duration - start  # the rate has a jump there
    exact = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-3}
    burning = solve_ivp(rate, (-start, middle), [first], **exact)
    expanding = solve_ivp(rate, (middle, opening), burning.y[:, -1], **exact)
    there = pressure(cycle, np.array([middle, opening]))
    assert there == pytest.approx([burning.y[0, -1], expanding.y[0, -1]], rel=3e-9)  # of the integration


@settings(max_examples=4, deadline=None)
@given(cycles, st.floats(0.0, 1.0))
def test_mean_torque_is_the_indicated_work(cycle, load):
    # int p dV by a quadrature of its own against 4 pi times the mean torque
    x, weights = np.polynomial.legendre.leggauss(40)
    work = 0.0
    for low, high in pairwise(sorted({0.0, *cycle.breaks(), 4.0 * math.pi})):
        half = 0.5 * (high - low) / 6
        for i in range(6):
            theta = low + half * (2 * i + 1 + x)
            dV = -ONE.area * ONE.crank.slope(theta)
            work += half * float(np.sum(weights * pressure(cycle, theta, load) * dV))
    made = engine(bore=0.08, stroke=0.084, rod_length=0.14, gas=cycle)
    mean = made.gas_harmonics(W, load)[0].real
    scale = cycle.heat(ONE, W)
    assert 4.0 * math.pi * mean == pytest.approx(made.indicated_work(W, load), abs=1e-13 * scale)
    assert made.indicated_work(W, load) == pytest.approx(work, abs=1e-12 * scale)


def test_compression_and_gas_exchange_are_what_was_asked_for():
    cycle = SimpleCycle(10.0, "9 bar", intake_pressure="0.95 bar", combustion_start="5 deg")
    theta = np.radians([400.0, 540.0, 600.0, 700.0])
    v = volume(cycle, theta)
    assert pressure(cycle, theta)[:2] == pytest.approx([0.95e5, 0.95e5], rel=1e-13)
    expected = 0.95e5 * (v[1] / v[2:]) ** 1.32
    assert pressure(cycle, theta)[2:] == pytest.approx(expected, rel=1e-13)
    assert pressure(cycle, np.radians([250.0, 350.0])) == pytest.approx([1.1e5, 1.1e5], rel=1e-13)


@pytest.mark.parametrize(
    ("share", "left"), [(0.0, 1.0), (0.25, (2 + math.sqrt(2)) / 4), (0.5, 0.5), (1.0, 0.0)]
)
def test_in_the_blowdown_the_pressure_falls_along_half_a_cosine(share, left):
    cycle = SimpleCycle(10.0, "9 bar", exhaust_opening="130 deg", blowdown="40 deg")
    theta = np.radians([129.999999, 130.0 + 40.0 * share])
    v, (before, during) = volume(cycle, theta), pressure(cycle, theta)
    expanded = before * (v[0] / v[1]) ** cycle.expansion_exponent
    assert during == pytest.approx(left * expanded + (1.0 - left) * 1.1e5, rel=1e-7)


def test_mean_pressure_follows_its_table_over_the_speeds():
    cycle = SimpleCycle(9.9, ("8 bar", "10 bar"), speeds=("1000 rpm", "3000 rpm"))
    for rpm, bar in ((500.0, 8.0), (1000.0, 8.0), (1500.0, 8.5), (3000.0, 10.0), (4000.0, 10.0)):
        torque = cycle.weights(ONE, rpm * RPM, 1.0) @ torque_harmonics(cycle, ONE)[:, 0].real
        assert 4.0 * math.pi * torque / ONE.displacement == pytest.approx(1e5 * bar, rel=1e-12)


def test_load_scales_intake_and_heat():
    cycle = SimpleCycle(9.9, "9 bar", intake_pressure="0.9 bar", idle_pressure="0.3 bar")
    full, half, none = (cycle.weights(ONE, W, load) for load in (1.0, 0.5, 0.0))
    assert [full[0], half[0], none[0]] == pytest.approx([0.9e5, 0.6e5, 0.3e5], rel=1e-14)
    assert [half[2] / full[2], none[2] / full[2]] == pytest.approx([2 / 3, 1 / 3], rel=1e-14)


BAD = {
    "compression_ratio": ({"compression_ratio": 1.0}, "must be above 1"),
    "falling": ({"mean_indicated_pressure": (8e5, 9e5), "speeds": (2.0, 1.0)}, "several rising speeds"),
    "late": ({"combustion_duration": "200 deg"}, "it burns from -15 to 185 deg"),
    "blowdown": ({"blowdown": "300 deg"}, "until 430 deg"),
}


@pytest.mark.parametrize("kind", BAD)
def test_an_impossible_cycle_is_refused(kind):
    change, says = BAD[kind]
    with pytest.raises(InputError, match=says):
        SimpleCycle(**({"compression_ratio": 9.0, "mean_indicated_pressure": 9e5} | change))


def test_a_mean_pressure_below_that_without_heat_is_refused():
    with pytest.raises(InputError, match="does more work without any heat"):
        engine(gas=SimpleCycle(9.0, "0.01 bar", intake_pressure="3 bar"))
