"""[B] Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms: (1), (3), (4).

The paper prints no engine data: the model's own figures are not compared to the paper's here, see
docs/paper-b.md. Formula (2): `balancing/test_orders.py`; (4) and (5) printed beside the model:
`studies/test_paper_b.py`; the arms: `balancing/test_balancer.py`.
"""

import math

import numpy as np
import pytest

from softstart.balancing import Counterweights, Cylinders, Engine, Masses, balance
from softstart.balancing.engine import force_at, largest, shaking_of_crank, shaking_of_shafts

RPM = math.pi / 30.0
TUNING = 4500.0 * RPM
F_B = 4.98e-4  # N/rpm^2, (4)
r = 0.0355


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


def test_formula_3_two_cylinders():
    vaz = Engine.load("vaz-11113")
    x = 35.5 / 121.0
    B_1 = x / 4 + x**3 / 16 + 15 * x**5 / 512
    first = 2 * 0.68 * r**2 * TUNING**2 * B_1
    assert -(TUNING**2 * vaz.inertia_harmonics[2]).imag == pytest.approx(first, rel=1e-4)  # x^7 is left out
