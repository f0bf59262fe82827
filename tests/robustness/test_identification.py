"""How often the intervals of `identify` hold the truth.

Simulated logs of one drive with a torque error of 2.5 %, from random places in the gap and random phases of
the encoder (docs/identification.md). `--size 30`: thirty times as many logs.
"""

from __future__ import annotations

import numpy as np
import pytest

from softstart import Drive, Identification, identify
from softstart.drive import FRICTIONS
from softstart.identification.planning import simulated_log

DRIVE = Drive.load("crane-4amtkf").replace(
    damping=0.3, torque_lag=0.004, load_kind="reactive", gap=0.08, start_position="unknown"
)
RUBBED = DRIVE.replace(motor_friction=1.0, motor_viscous_friction=0.02, load_viscous_friction=0.02)
NAMES = (
    "motor_inertia", "load_inertia", "stiffness", "gap", "damping", "load_torque", "torque_lag",
)  # fmt: skip
REVERSE = "two levels, then reverse"
RIPPLE = 1.0  # N m, 2.5 % of the level of the experiments


def distances(found: Identification, truth: dict[str, float]) -> list[float]:
    """Distance of each estimate from the truth over its interval on that side; 1 or less holds it."""
    return [
        abs(truth[one.name] - one.value)
        / abs((one.upper if truth[one.name] > one.value else one.lower) - one.value)
        for one in found.estimates
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("drive", "lines"),
    [(DRIVE, 1024.0), (DRIVE, 64.0), (RUBBED, 1024.0)],
    ids=["fine", "coarse", "friction"],
)
def test_intervals_hold_the_truth(drive: Drive, lines: float, pytestconfig: pytest.Config) -> None:
    truth = drive.replace(encoder_lines=lines)
    every: list[float] = []
    for number in range(1, 1 + pytestconfig.getoption("size")):
        generator = np.random.default_rng([number, 4000, round(lines)])
        position, phase = generator.uniform(-1.0, 1.0), generator.uniform()
        log = simulated_log(
            truth, REVERSE, log_period=4e-3, ripple=RIPPLE, position=position, phase=phase,
            seed=int(generator.integers(2**31)),
        )  # fmt: skip
        values = {name: float(getattr(truth, name)) for name in (*NAMES, *FRICTIONS)}
        every += distances(identify(log, truth, searches=1), values | {"position 1": position})
    held = int(np.sum(np.array(every) <= 1.0))
    print(f"{held} of {len(every)} intervals hold the truth")
    assert held / len(every) >= (0.8 if pytestconfig.getoption("size") == 1 else 0.9)
    assert np.mean(every) > 0.2  # nor are they far too wide
    assert max(every) < 3.0 or pytestconfig.getoption("size") > 1
