"""Starts of chains with several gaps under `take-up`: the tables of docs/take-up.md.

`python -m tests.controllers.several_gaps` prints them; with `--optima` those that need optima instead, with
`--aims` each start beside the least K_dyn found in its own time (docs/several-gaps.md).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from softstart import Controller, OptimumError, optimize, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.controller import make_controller

CRANE = Chain.load("crane-4-mass")


def seen(chain: Chain, damping_ratio: float = 0.02, phase: float = 0.0, at: Sequence[float] = ()) -> Chain:
    """The chain behind a real motor: 4096 lines, a lag of 2 ms, a dead time of 1 ms.

    `at` places each twist in its gap, from -1 (opposite flank) to 1 (driving flank).
    """
    values = {"encoder_lines": 4096, "torque_lag": 0.002, "computing_delay": 0.001, "encoder_phase": phase}
    values |= {f"shaft_{k}_damping_ratio": damping_ratio for k in range(1, len(chain.masses))}
    for k, where in enumerate(at):
        values[f"shaft_{k + 1}_start_position"] = float(0.5 * chain.shafts[k].gap * where)
    return chain.with_values(values)


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

    flanks: list[Sequence[float] | None] = [(-1.0, -1.0, -1.0), *[None] * (count - 1)]
    inertias = (0.4, 0.7, 1.0)
    c = {f"shaft_{k}_stiffness": shaft.stiffness for k, shaft in enumerate(CRANE.shafts, 1)}
    J1 = {"mass_1_inertia": CRANE.masses[0].inertia}
    wrong = [{name: by * value for name, value in one.items()} for one in (c, J1) for by in (1.2, 0.8)]
    groups = {
        f"gaps x{gaps:g}": [one(CRANE.scaled(gaps, inertia), at) for inertia in inertias for at in flanks]
        for gaps in (0.5, 1.0, 2.0, 4.0)
    }
    groups["driving flank"] = [one(CRANE.scaled(1.0, inertia), (1.0, 1.0, 1.0)) for inertia in inertias]
    groups["stiffness or J1 20 % off"] = [
        one(CRANE.with_values(which)) for which in wrong for _ in range(count)
    ]
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


OWN = make_controller("take-up").fitted(NOMINAL.design_drive).parameters
PARTS: dict[str, dict[str, float]] = {  # `take-up` without one of them
    "nothing": {},
    "damping by the load's speed": {"damping_ratio": 0.0},
    "damping by T'": {"rate_damping_ratio": 0.0},
    "both dampings": {"damping_ratio": 0.0, "rate_damping_ratio": 0.0},
    "slowing before a falling load": {"slowing": 0.0},
    "telling the load from a light part": {"contact_share": 0.2 * OWN["contact_share"]},
    "low speed (the speed 3 times)": {"take_up_speed": 3.0 * OWN["take_up_speed"]},
    "stiff speed loop (a quarter)": {"speed_gain": 0.25 * OWN["speed_gain"]},
}
GAPS = ("gaps x0.5", "gaps x1", "gaps x2", "gaps x4")
STRATEGIES = ("take-up", "current-limit-feedback", "pulse-coast-hold", "state-feedback", "s-curve")


def mean_and_worst(figures: Any) -> str:
    """Two numbers of many."""
    return f"{figures.mean():.2f}, {figures.max():.2f}" if not np.isnan(figures).any() else "-"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of Markdown."""
    print("| " + " | ".join(heads) + " |")
    print("|---|" + "--:|" * (len(heads) - 1))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print()


# what limits every feedback ---------------------------------------------------------------------------------

SPEEDS = 0.3 * (2.0 / 0.3) ** np.linspace(0.0, 1.0, 41)  # of the take-up speed
HARD = 1.3  # K_dyn from which on a start is looked at
IDLE = 0.05  # of Ms


def at_speeds(cells: Sequence[Chain], shares: Iterable[float]) -> Any:
    """K_dyn of each start (columns) at shares of the take-up speed (rows), all else as it is."""
    speed, impulse = OWN["take_up_speed"], OWN["contact_share"] * OWN["take_up_speed"]
    made = [{"take_up_speed": x * speed, "contact_share": impulse / (x * speed)} for x in shares]
    return np.array([played(cells, make_controller("take-up", one), NOMINAL)[0] for one in made])


def idle_before_the_peak(chain: Chain) -> bool:
    """Whether the motor gives less than 5 % of Ms, on the mean, from the first sign of the load to the peak.

    The first sign is the first torque of the motor shaft after the first one of the load's shaft.
    """
    run = simulate(chain, "take-up", fitted_to=NOMINAL)
    times = np.arange(0.0, run.peak_time, 1e-4)
    T, u = (run.at(times)[name] for name in ("T", "u"))
    met = np.logical_or.accumulate(T[:, -1] > 0.0)
    sign = np.logical_or.accumulate(met & (T[:, 0] > 0.0))
    assert chain.motor is not None
    return not sign.any() or u[sign].mean() < IDLE * chain.motor.starting_torque


def limits(groups: Mapping[str, Sequence[Chain]]) -> None:
    """Print what the speed alone decides, and how far it can be chosen."""
    rows = []
    for name in GAPS:
        K = at_speeds(groups[name], SPEEDS)
        now, *near = at_speeds(groups[name], [1.0, 0.998, 1.002])
        hard = [chain for chain, one in zip(groups[name], now, strict=True) if one > HARD]
        moved = 100.0 * np.abs(near / now - 1.0)
        rows.append([
            name, *map(mean_and_worst, (now, K[K.mean(axis=1).argmin()], K.min(axis=0))),
            f"{np.sqrt((moved**2).mean()):.0f}, {moved.max():.0f}",
            f"{sum(map(idle_before_the_peak, hard))} of {len(hard)}",
        ])  # fmt: skip
    heads = ["as it is", "best speed for all", "best speed for each", "speed 0.2 % off: rms, most, %", "idle"]
    table(["starts", *heads], rows)


def displaced(chain: Chain, most: float, rng: np.random.Generator) -> Chain:
    """The chain with each of its start positions up to `most` off, in rad at the motor shaft."""
    values = {}
    for k, gap in enumerate(chain.at_motor_shaft().gap):
        shaft, half = chain.shafts[k], 0.5 * float(chain.shafts[k].gap)
        to = shaft.start_position + rng.uniform(-most, most) * 2.0 * half / gap
        values[f"shaft_{k + 1}_start_position"] = float(min(max(to, -half), half))
    return chain.with_values(values)


COUNT = 2.0 * np.pi / (4 * 4096)  # rad, of the encoder


def optima(groups: Mapping[str, Sequence[Chain]]) -> None:
    """Print K_dyn over that of the best start found for the same time, and what that start owes to foresight.

    The load inertia is 0.4 times the nominal one. The torque of the best start is replayed on chains whose
    positions are up to some counts of the encoder off.
    """
    rows = []
    for place, i in (("opposite flanks", 0), ("random", 2)):
        for name in GAPS:
            chain, rng = groups[name][i], np.random.default_rng(i)
            K, time = played([chain], "take-up", NOMINAL)
            t = float(time[0]) * rigid_time(chain)
            best = optimize(chain, t, seeds=["take-up", "direct", "s-curve"])
            again = []
            for counts in (3, 10, 30):
                near = [displaced(chain, counts * COUNT, rng) for _ in range(40)]
                off_by = played(near, make_controller("profile", {"profile": best.profile}), NOMINAL)[0]
                again.append(mean_and_worst(off_by))
            figures = f"{t:.3f}", f"{K[0]:.2f}", f"{best.k_dyn:.2f}", f"{K[0] / best.k_dyn:.2f}"
            rows.append([f"{name}, {place}", *figures, *again])
    heads = ["time, s", "take-up", "best found", "ratio", "off by 3 counts", "10", "30"]
    table(["start", *heads], rows)


# what was aimed at ------------------------------------------------------------------------------------------

SEARCHES = ("s-curve", "current-limit-feedback", "reduced-two-stage", "take-up")  # each a search of its own
AIMS = {
    "nominal": "K_dyn 1.10 in 0.47 s", "gaps x4": "1.20", "stiffness or J1 20 % off": "1.30",
    "undamped": "K_dyn 2.0",
}  # fmt: skip


def least(chain: Chain, seconds: float) -> float:
    """The least K_dyn found for a start time by a search from each of four strategies: no proved optimum."""
    found = []
    for seed in SEARCHES:
        with suppress(OptimumError):
            found.append(optimize(chain, seconds, time_limit=0.0, seeds=[seed]).k_dyn)
    return min(found)


def aims() -> None:
    """Print K_dyn of `take-up` beside the least found in its own time, of each start and of the groups.

    The last group are ten random chains on which nothing was tuned.
    """
    groups = {"nominal": [NOMINAL], **crane_cells(3, 3)}
    groups["stiffness or J1 20 % off"] = groups["stiffness or J1 20 % off"][::2]
    rows, usual = [], list[float]()
    for name, chains in {**groups, "random chains": random_chains(1, 10)}.items():
        pairs = []
        for chain in chains:
            (K,), (time,) = played([chain], "take-up", NOMINAL if name in groups else None)
            best = math.nan if name == "undamped" else least(chain, time * rigid_time(chain))
            pairs.append((K, K / best))
            share = chain.masses[-1].inertia / CRANE.masses[-1].inertia
            print(f"{name}, J2 x{share:.1f}, time x{time:.2f}: {K:.2f}, least {best:.2f}", flush=True)
        K, ratio = np.array(pairs).T
        usual += ratio.tolist() if name in (*GAPS[:3], "driving flank") else []
        both = map(mean_and_worst, (K, ratio))
        rows.append([name, str(len(chains)), *both, AIMS.get(name, "1.08, 1.15")])
    rows.append([
        "gaps x0.5 to x2, driving flank", str(len(usual)), "", mean_and_worst(np.array(usual)), "1.08, 1.15"
    ])  # fmt: skip
    print()
    table(["starts", "number", "K_dyn: mean, worst", "ratio: mean, worst", "aimed at"], rows)


def main() -> None:
    """Print the tables."""
    groups = crane_cells(3, 8)
    if "--aims" in sys.argv:
        return aims()
    if "--optima" in sys.argv:
        return optima(groups)
    rows = []
    for group, cells in groups.items():
        found = [played(cells, name, NOMINAL) for name in STRATEGIES]
        rows.append([group, *(f"{mean_and_worst(K)} ({time.mean():.2f})" for K, time in found)])
    table(["starts", *STRATEGIES], rows)
    K, time = played([NOMINAL], "take-up", NOMINAL)
    print(f"nominal: K_dyn {K[0]:.3f} in {time[0] * rigid_time(NOMINAL):.3f} s\n")
    rows = []
    for part, changes in PARTS.items():
        other = make_controller("take-up", changes)
        rows.append([part, *(mean_and_worst(played(cells, other, NOMINAL)[0]) for cells in groups.values())])
    table(["without", *groups], rows)
    limits(groups)
    rows = []
    for chain in random_chains(1, 10):
        gaps, drive = sum(shaft.gap > 0.0 for shaft in chain.shafts), chain.design_drive
        sample = make_controller("take-up").fitted(drive).parameters["period"]
        delay = float(drive.Omega * (drive.torque_lag + drive.computing_delay + sample))  # rad
        found = [played([chain], name) for name in STRATEGIES]
        figures = (f"{K[0]:.2f} ({time[0]:.2f})" for K, time in found)
        rows.append([f"{len(chain.masses)}, {gaps}", chain.masses[-1].kind, f"{delay:.1f}", *figures])
    table(["masses, gaps", "load", "delay", *STRATEGIES], rows)


if __name__ == "__main__":
    main()
