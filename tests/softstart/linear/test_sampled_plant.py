"""The drive at the sample instants, shifted by whole samples."""

from __future__ import annotations

import numpy as np
import pytest
from tests.softstart.linear.speed_loops import CRANE

from softstart.linear.plant import in_contact, sampled

Z = np.exp(1j * np.linspace(0.05, 3.0, 30)) * 1.01


@pytest.mark.parametrize("lag", [0.0, 0.003])
@pytest.mark.parametrize("differencing", [False, True])
def test_whole_samples_of_delay_are_powers_of_z(lag, differencing):
    drive = CRANE.replace(torque_lag=lag, damping=1.0)
    for plant in (in_contact(drive), in_contact(drive, gaps_open=True)):
        for fraction in (0.0, 0.0004):
            plain = sampled(plant, 0.001, fraction, (1, 2, 3), differencing)
            late = sampled(plant, 0.001, 0.003 + fraction, (1, 2, 3), differencing)
            expected = plain.system.response(Z) * (Z**-3)[:, None, None]
            assert late.system.response(Z) == pytest.approx(expected, rel=1e-9, abs=1e-12)
