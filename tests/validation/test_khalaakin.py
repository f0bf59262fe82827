"""[B] Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms: (1) to (5).

The paper gives coefficients with three and four digits; what follows from them is compared to those. It
prints no engine data: the model's own figures are not compared to the paper's here, see docs/paper-b.md.
"""

import math

import numpy as np
import pytest

from softstart.balancing import Counterweights, Cylinders, Engine, Masses, balance
from softstart.balancing.engine import force_at, largest, shaking_of_crank, shaking_of_shafts

RPM = math.pi / 30.0
TUNING = 4500.0 * RPM
F_B, M_B = 4.98e-4, 2.099e-5  # N/rpm^2, (4); N m/rpm^2, (5) read with 1e-5
r = 0.0355


def test_formula_4_is_an_imbalance():
    imbalance = F_B / RPM**2
    assert round(imbalance, 4) == 0.0454  # kg m
    assert round(imbalance / r, 2) == 1.28  # kg on 35.5 mm


@pytest.mark.parametrize(("moment", "h", "at_tuning"), [(M_B, 42.1, 425.0), (0.1 * M_B, 4.21, 42.5)])
def test_formulas_4_and_5_give_the_arm(moment, h, at_tuning):
    assert 1e3 * moment / F_B == pytest.approx(h, rel=2e-3)  # both readings of the exponent of (5)
    assert moment * 4500.0**2 == pytest.approx(at_tuning, rel=2e-4)


def test_formula_4_by_the_model_of_an_engine_with_that_mass():
    # 1.28 kg reciprocate in all, half of it on the crank: first-order force of (1), and of its halves
    cylinders = Cylinders("82 mm", "71 mm", "121 mm", firing_angles=(0.0, "360 deg"))
    mass = F_B / RPM**2 / r
    force, _ = shaking_of_crank(cylinders, Masses(mass / 2), Counterweights())
    n = 3000.0
    assert largest(force)[1] * (n * RPM) ** 2 == pytest.approx(F_B * n**2, rel=1e-12)
    half, _ = shaking_of_crank(cylinders, Masses(mass / 2), Counterweights(0.5, 1.0))
    assert abs(half[1]) < 1e-12 * abs(half[-1])
    assert largest(half)[1] * (n * RPM) ** 2 == pytest.approx(0.5 * F_B * n**2, rel=1e-12)


def test_formula_1_and_its_balance():
    vaz = Engine.load("vaz-11113")
    phi = np.linspace(0.0, 2.0 * np.pi, 61)
    bare = shaking_of_crank(vaz.cylinders, Masses(0.68), Counterweights())[0]
    first = bare[1] * np.exp(1j * phi) + bare[-1] * np.exp(-1j * phi)
    assert first == pytest.approx(2 * 0.68 * r * np.cos(phi), abs=1e-15)  # A_1 = 1
    # at 90 deg the force of the shafts is that of the counterweights, reversed
    found = balance(vaz)
    shafts = shaking_of_shafts(found.residual("fixed-h").shafts)[0]
    crank = vaz.crank_shaking[0]
    counterweights = crank[1] * 1j + crank[-1] * -1j
    assert force_at(shafts, math.pi / 2) == pytest.approx(-counterweights, abs=1e-16)
    assert force_at(shafts, math.pi / 2).imag > 0.02  # and not nothing


def test_formula_2_z_cylinders():
    vaz = Engine.load("vaz-11113")
    one = Engine.load("vaz-11113", also={"cylinders.firing_angles": [0.0]})
    assert vaz.gas_harmonics(TUNING)[::2] == pytest.approx(2.0 * one.gas_harmonics(TUNING)[::2], rel=1e-12)
    assert np.all(vaz.gas_harmonics(TUNING)[1::2] == 0.0)


def test_formula_3_two_cylinders():
    vaz = Engine.load("vaz-11113")
    x = 35.5 / 121.0
    B_1 = x / 4 + x**3 / 16 + 15 * x**5 / 512
    first = 2 * 0.68 * r**2 * TUNING**2 * B_1
    assert -(TUNING**2 * vaz.inertia_harmonics[2]).imag == pytest.approx(first, rel=1e-4)  # x^7 is left out


def test_claims_on_the_arm():
    found = balance(Engine.load("vaz-11113"))
    i, w = found.tuning_index, found.tuning_speed
    assert w == pytest.approx(TUNING, rel=1e-14)
    fixed, variable, alone = (found.residual(name) for name in ("fixed-h", "variable-h", "inertia-only"))
    sine = np.abs(fixed.first_order_moment_sine)
    assert sine[i] < 1e-10 < np.delete(sine, i).min()  # complete, of the sine, at the tuning speed only
    assert np.abs(variable.first_order_moment_sine).max() < 1e-10  # h(n): at all speeds
    assert alone.first_order_moment[i] > 2.0 * fixed.first_order_moment[i]
