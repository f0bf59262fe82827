"""Starts that the tests of the controllers share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from tests.twin import PlainTwin, plain

from softstart import Drive, Run, simulate
from softstart.controller import Command, CompiledController, Measured
from softstart.kernel.records import S_REF, S_START

CRANE = Drive.load("crane-4amtkf")
CRANES = [
    CRANE.replace(gap=gap, load_inertia=J2, torque_lag=lag, load_kind=kind)
    for gap, J2 in ((0.5, 0.175), (2.0, 0.07))
    for lag in (0.0, 0.002)
    for kind in ("active", "reactive")
]


def random_drive(rng: np.random.Generator, **fixed: Any) -> Drive:
    """A drive that somebody might build: 4 decades of inertia, 2 to 200 Hz, gaps up to 10 windups."""
    J1 = 10 ** rng.uniform(-4, 0.5)
    J2 = J1 * 10 ** rng.uniform(-0.5, 1.3)
    Ms = J1 * 10 ** rng.uniform(2.5, 3.7)
    Mc = Ms * rng.uniform(0, 0.5)
    frequency = 10 ** rng.uniform(0.3, 2.3)
    Omega = 2 * math.pi * frequency
    c = Omega**2 * J1 * J2 / (J1 + J2)
    given: dict[str, Any] = {
        "motor_inertia": J1, "load_inertia": J2, "starting_torque": Ms, "load_torque": Mc, "stiffness": c,
        "load_kind": rng.choice(["active", "reactive"]).item(),
        "damping": 2 * rng.choice([0, 0, 0.02, 0.3]) * c / Omega,
        "gap": Ms / c * rng.choice([0, 10 ** rng.uniform(-2, 1)]),
        "torque_lag": rng.choice([0, 0, 0.02, 0.2]) / frequency,
        "encoder_lines": rng.choice([0, 1024, 4096, 32768]).item(),
        "target_speed": (Ms - Mc) / (J1 + J2) * 10 ** rng.uniform(0.3, 1.7) / frequency,
    }  # fmt: skip
    given["start_position"] = given["gap"] * rng.choice([0, -0.5, rng.uniform(-0.5, 0.5)])
    return Drive(**(given | fixed))


def raised_at(run: Run) -> float:
    """First instant at which the demand is the starting torque, s."""
    spans = run.trajectory.spans
    full = spans[:, S_REF] >= 0.999 * float(run.drive.Ms)
    return float(spans[full, S_START][0]) if full.any() else math.nan


def traced(drive: Drive, controller: CompiledController) -> tuple[Run, np.ndarray[Any, Any]]:
    """A run in plain Python, with rows (time, state) after each asking."""
    rows: list[tuple[float, ...]] = []

    class Listening(PlainTwin):
        def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
            answer = super().step(measured, state)
            rows.append((measured.time, *answer.state))
            return answer

    twin = plain(controller, drive)
    run = simulate(drive, Listening(twin.twin, twin.numbers))
    trace = np.array(rows)
    return run, trace[trace[:, 0] <= run.end_time]


def index(states: Any, path: str) -> int:
    """The place of a field, `free.inverse` of a record within it, in the row of a controller's state."""
    name, _, rest = path.partition(".")
    inner, offset = states.fields[name][:2]
    return int(offset) // 8 + (index(inner, rest) if rest else 0)
