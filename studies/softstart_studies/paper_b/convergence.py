"""How exact the orders are: two independent ways for inertia, refined quadrature and FFT for gas."""

from __future__ import annotations

import numpy as np

from softstart.balancing.parts import CYCLE_ANGLE
from softstart.balancing.slider_crank import SliderCrank, acceleration_harmonics, inertia_torque_harmonics
from softstart.study import Table
from softstart_studies.paper_b.series import acceleration_series, inertia_torque_series
from softstart_studies.paper_b.vaz import RPM, TUNING, VAZ

ORDERS = 12


def differences(ratio: float) -> tuple[float, float]:
    """Largest difference of FFT and power series: A_q of the acceleration, B_k of the torque.

    >>> max(differences(0.3)) < 1e-14
    True
    """
    force = np.array(acceleration_harmonics(ratio, ORDERS)) - acceleration_series(ratio, ORDERS)
    torque = np.array(inertia_torque_harmonics(ratio, ORDERS)) - inertia_torque_series(ratio, ORDERS)
    return float(np.abs(force).max()), float(np.abs(torque).max())


def inertia_by_samples(samples: int) -> float:
    """Largest error of B_1 .. B_4 by FFT with so many samples a turn."""
    phi = 2.0 * np.pi * np.arange(samples) / samples
    crank = VAZ.cylinders.crank
    one = SliderCrank(crank.ratio, 1.0)
    torque = -one.slope(phi) * one.curvature(phi) / crank.ratio**2
    found = -2.0 / samples * np.fft.rfft(torque).imag[:5]
    return float(np.abs(found - inertia_torque_series(crank.ratio, 4)).max())


def gas_by_samples(samples: int) -> float:
    """Largest error in N m of the orders 1 to 4 of the gas torque by FFT with so many samples a cycle."""
    w = TUNING * RPM
    phi = CYCLE_ANGLE * np.arange(samples) / samples
    found = 2.0 / samples * np.fft.rfft(VAZ.gas_torque(phi, w))[2:9:2]
    return float(np.abs(found - VAZ.gas_harmonics(w)[2:9:2]).max())


def table() -> Table:
    """Errors over samples: inertia exponentially, gas by the kinks of the pressure."""
    rows: list[tuple[object, ...]] = [
        ("inertia torque, B_1 .. B_4", n, f"{inertia_by_samples(n):.1e}", "of the power series in lambda")
        for n in (8, 12, 16, 24, 32)
    ]
    rows += [
        ("gas torque, orders 1 .. 4", n, f"{gas_by_samples(n):.1e}", "N m, of Gauss quadrature")
        for n in (90, 180, 360, 720, 7200)
    ]
    return Table("Convergence of the orders", ("what", "samples", "largest error", "unit"), rows)
