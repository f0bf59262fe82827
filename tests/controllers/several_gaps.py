"""Chains with several gaps for `take-up`: those of the tables of docs/take-up.md."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from softstart import Controller, simulate
from softstart.chain import Chain, Mass, Motor, Shaft

CRANE = Chain.load("crane-4-mass")


def seen(chain: Chain, damping_ratio: float = 0.02, phase: float = 0.0, at: Sequence[float] = ()) -> Chain:
    """The chain behind a real motor: 4096 lines, a lag of 2 ms, a dead time of 1 ms.

    `at` places each twist in its gap, from -1 (opposite flank) to 1 (driving flank).
    """
    assert chain.motor is not None
    motor = chain.motor.replace(
        encoder_lines=4096, torque_lag=0.002, computing_delay=0.001, encoder_phase=phase
    )
    shafts = [shaft.replace(damping=0.0, damping_ratio=damping_ratio) for shaft in chain.shafts]
    if len(at):
        places = zip(shafts, at, strict=True)
        shafts = [s.replace(start_position=float(0.5 * s.gap * where)) for s, where in places]
    return replace(chain, shafts=tuple(shafts), motor=motor)


def off(chain: Chain, stiffness: float = 1.0, J1: float = 1.0) -> Chain:
    """The chain with other stiffnesses, or another inertia of the motor, than the controller is told."""
    shafts = tuple(s.replace(stiffness=stiffness * s.stiffness) for s in chain.shafts)
    first = chain.masses[0]
    return replace(
        chain, shafts=shafts, masses=(first.replace(inertia=J1 * first.inertia), *chain.masses[1:])
    )


NOMINAL = seen(CRANE)


def rigid_time(chain: Chain) -> float:
    """Time in s in which the chain without gaps and springs reaches its target speed under Ms."""
    at = chain.at_motor_shaft()
    assert chain.motor is not None
    assert chain.target_speed is not None
    return float(at.J.sum() * chain.target_speed / (chain.motor.starting_torque - at.Mc.sum()))


def crane_cells(seed: int, count: int = 4) -> Mapping[str, list[Chain]]:
    """The crane's chain with other gaps, loads, positions and parameters, in groups."""
    rng = np.random.default_rng(seed)

    def one(chain: Chain, at: Sequence[float] | None = None, damping_ratio: float = 0.02) -> Chain:
        places = rng.uniform(-1.0, 1.0, len(chain.shafts)) if at is None else at
        return seen(chain, damping_ratio, float(rng.uniform()), places)

    def flanks() -> Iterator[Sequence[float] | None]:
        yield (-1.0, -1.0, -1.0)
        yield from [None] * (count - 1)

    inertias = (0.4, 0.7, 1.0)
    wrong = ((1.2, 1.0), (0.8, 1.0), (1.0, 1.2), (1.0, 0.8))
    groups = {
        f"gaps x{gaps:g}": [one(CRANE.changed(gaps, inertia), at) for inertia in inertias for at in flanks()]
        for gaps in (0.5, 1.0, 2.0, 4.0)
    }
    groups["driving flank"] = [one(CRANE.changed(1.0, inertia), (1.0, 1.0, 1.0)) for inertia in inertias]
    groups["stiffness or J1 20 % off"] = [one(off(CRANE, *which)) for which in wrong for _ in range(count)]
    groups["undamped"] = [one(CRANE, damping_ratio=0.0) for _ in range(count)]
    return groups


def random_chain(rng: np.random.Generator, masses: int) -> Chain:
    """A driveline: light parts between motor and load, one gap to three, damping ratios of 0.5 to 3 %."""
    J1, Ms = 0.03 * 10 ** rng.uniform(-1, 1), 60.0 * 10 ** rng.uniform(-1, 1)
    light = J1 * 10 ** rng.uniform(-1.5, -0.5, masses - 2)
    load = J1 * 10 ** rng.uniform(0.0, 1.0)
    windup = 10 ** rng.uniform(-1.7, -0.6)  # rad under Ms, of the whole chain
    parts = rng.dirichlet(np.ones(masses - 1) * 2.0)
    gaps = windup * 10 ** rng.uniform(-0.5, 0.7, masses - 1)
    gaps[rng.permutation(masses - 1)[int(rng.integers(1, min(3, masses - 1) + 1)) :]] = 0.0
    kind: Any = "active" if rng.uniform() < 0.5 else "reactive"
    shafts = [Shaft(Ms / windup / share, gap=gap) for share, gap in zip(parts, gaps, strict=True)]
    rows = [Mass(J1, name="motor"), *(Mass(J) for J in light)]
    rows.append(Mass(load, name="load", torque=rng.uniform(0.05, 0.4) * Ms, kind=kind))
    base = Chain(rows, shafts, Motor(Ms, maximum_torque=1.05 * Ms))
    # a target speed that takes 6 to 15 elastic periods of the reduction
    slow = replace(base, target_speed=1.0)
    periods = rng.uniform(6.0, 15.0)
    speed = periods * slow.design_drive.elastic_period / rigid_time(slow)
    made = replace(base, target_speed=float(speed))
    return seen(made, float(rng.uniform(0.005, 0.03)), float(rng.uniform()), rng.uniform(-1, 1, masses - 1))


def random_chains(seed: int, count: int) -> list[Chain]:
    """Seeded chains with 3, 4 and 5 masses in turn."""
    rng = np.random.default_rng(seed)
    return [random_chain(rng, 3 + i % 3) for i in range(count)]


def played(
    chains: Sequence[Chain], controller: str | Controller, fitted_to: Chain | None = None
) -> tuple[Any, Any]:
    """K_dyn of each chain over its own mean torque, and start time over the rigid one."""
    found = simulate(chains, controller, fitted_to=fitted_to, time_limit=10.0, workers=1)
    K = found.peak_torque.values / np.array([chain.mean_torque for chain in chains])
    return K, found.start_time.values / np.array([rigid_time(chain) for chain in chains])
