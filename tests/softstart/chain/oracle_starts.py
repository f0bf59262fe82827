"""Starts of chains, given both to the kernel and to the oracle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from tests.oracle import ChainOracle, Given
from tests.oracle_torque import TorquePath
from tests.softstart.kernel.pieces import Pieces

from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.chain.periodic_torque import PeriodicTorque
from softstart.drive import Drive
from softstart.start.run import Run
from softstart.start.simulation import simulate

NAMES = {
    "gap closed": "closed",
    "gap opened": "opened",
    "load starts": "load-starts",
    "load stops": "load-stops",
    "target speed reached": "target",
    "impact": "impact",
    "gear holds": "gear-holds",
    "gear lets go": "gear-lets-go",
}
ANY_DRIVE = Drive.load("crane-4amtkf")  # the pieces take nothing from it


def random_chain(rng: np.random.Generator, count: int, rigid: bool = False) -> dict[str, Any]:
    """Keywords of `both` for a chain of `count` masses, a few periods of its fastest mode long."""
    J = 10 ** rng.uniform(-0.6, 0.6, count)
    c = 10 ** rng.uniform(2, 3.5, count - 1)
    rate = math.sqrt(2 * np.max((np.append(c, 0) + np.append(0, c)) / J))
    torque = float(rng.uniform(5, 50))
    twist = torque / c
    gap = twist * 10 ** rng.uniform(-1, 1, count - 1) * (rng.random(count - 1) < 0.8)
    damped = rng.random(count - 1) < 0.6
    law = [str(rng.choice(["no-pull", "dead-zone", "modelica"])) for _ in range(count - 1)]
    restitution = np.full(count - 1, math.nan)
    if rigid:
        k = int(rng.integers(count - 1))
        gap[k] = max(gap[k], twist[k])
        restitution[k] = rng.uniform(0.6, 1.0)
    t_end = 2 * math.pi / rate * float(rng.uniform(2, 6))
    tones = []
    if rng.random() < 0.5:
        place, omega = int(rng.integers(count)), float(rate * rng.uniform(0.05, 0.6))
        tones = [(place, omega, 0.3 * torque, -0.2 * torque)]
    sprung = damped & np.isnan(restitution)
    return {
        "J": J, "c": c, "gap": gap, "law": law, "restitution": restitution, "tones": tones, "t_end": t_end,
        "d": np.where(sprung, 2 * rng.uniform(0, 0.6, count - 1) * np.sqrt(c * J.min()), 0.0),
        "theta0": gap * rng.uniform(-0.45, 0.45, count - 1),
        "w0": np.where(rng.random(count) < 0.5, 0.0, rng.normal(size=count)),
        "Mc": torque * rng.uniform(0, 0.5, count) * (rng.random(count) < 0.6),
        "reactive": rng.random(count) < 0.5,
        "ground": np.where(rng.random(count) < 0.3, rng.uniform(0, 1.0, count), 0.0),
        "pieces": [(0.0, torque), (0.4 * t_end, torque * float(rng.uniform(-0.5, 1.0)))],
        "lag": 0.0 if rng.random() < 0.5 else 0.05 * t_end,
        "rate": math.inf if rng.random() < 0.5 else 8 * torque / t_end,
        "motor": int(rng.integers(count)),
        "target": float(rng.uniform(0.1, 1.0)),
    }  # fmt: skip


def with_losses(rng: np.random.Generator, drawn: dict[str, Any]) -> dict[str, Any]:
    """The same with losses in most gears of its springs, on either side of them."""
    count = drawn["c"].size
    lossy = (rng.random(count) < 0.7) & np.isnan(drawn["restitution"])
    efficiency = np.where(lossy, rng.uniform(0.4, 0.99, count), 1.0)
    return drawn | {"efficiency": efficiency, "gear": np.arange(count) + rng.integers(0, 2, count)}


def built(given: Given, motor: Motor, target: float) -> Chain:
    """The same as a `Chain`."""
    masses, shafts = [], []
    for i in range(given.J.size):
        own = {"torque": float(given.Mc[i]), "kind": "reactive" if given.reactive[i] else "active"}
        own["friction"] = float(np.broadcast_to(given.friction, given.J.shape)[i])
        if i in given.curves:
            points, torques, by_angle = given.curves[i]
            own |= {"curve_angle" if by_angle else "curve_speed": list(points), "curve_torque": list(torques)}
        ground, speed = float(given.ground[i]), float(given.w0[i])
        masses.append(Mass(float(given.J[i]), damping=ground, initial_speed=speed, **own))
    for k in range(given.c.size):
        place = {"gap": float(given.gap[k]), "start_position": float(given.theta0[k])}
        if not math.isnan(given.restitution[k]):
            shafts.append(Shaft(restitution=float(given.restitution[k]), **place))
            continue
        loss = {"efficiency": float(given.efficiency[k]), "side": "after" if given.gear[k] == k else "before"}
        elastic = {"damping": float(given.d[k]), "contact_law": given.law[k]}
        shafts.append(Shaft(float(given.c[k]), **place, **elastic, **loss))
    return Chain(
        masses, shafts, motor, target_speed=target, load_mass=f"mass {given.load % given.J.size + 1}"
    )


def both(
    *, pieces: list[tuple[float, float]], lag: float, rate: float, t_end: float, target: float,
    u0: float = 0.0, check: bool = True, **drawn: Any,
) -> tuple[Run, ChainOracle]:  # fmt: skip
    """The same start by the kernel and, to `check` it, by the oracle; `drawn` are fields of `Given`."""
    given = Given(**drawn | {"reactive": drawn["reactive"] & (drawn["Mc"] > 0)})
    target = max(target, float(given.w0[given.load]) + 1e-2)
    excitation: dict[str | int, PeriodicTorque] = {
        i: PeriodicTorque(0.0, [1.0], [cosine], [sine], speed=omega) for i, omega, cosine, sine in given.tones
    }
    largest = max(*(abs(u) for _, u in pieces), 1.0)
    motor = Motor(
        largest, mass=f"mass {given.motor + 1}", minimum_torque=-largest, torque_lag=lag, torque_rate=rate,
        initial_torque=u0,
    )  # fmt: skip
    played = Pieces(pieces=tuple(pieces), end=math.inf)
    run = simulate(built(given, motor, target), played, t_end, fitted_to=ANY_DRIVE, excitation=excitation)
    oracle = ChainOracle(given, TorquePath(list(pieces), lag, rate, u0, t_end), target)
    return run, oracle.go() if check else oracle


def differences(run: Run, oracle: ChainOracle) -> dict[str, float]:
    """Largest differences in units of what occurs."""
    last = run.at(run.end_time)
    speeds = np.abs(run.w).max()
    twists = np.abs(run.twist).max()
    torques = max(np.abs(oracle.peaks).max(), 1e-3)
    mine = sorted((round(e.time, 7), NAMES.get(e.kind, e.kind), e.place, e.time) for e in run.events)
    theirs = sorted((round(when, 7), kind, k, when) for when, kind, k in oracle.events)
    same = [event[1:3] for event in mine] == [event[1:3] for event in theirs]
    found = {
        "w": float(np.abs(last["w"] - oracle.w).max() / speeds),
        "twist": float(np.abs(last["twist"] - oracle.theta).max() / twists),
        "peak": float(np.abs(run.peak_torques - np.abs(oracle.peaks)).max() / torques),
        "events": 0.0 if same else math.inf,
    }
    if same and run.events:
        apart = max(abs(a[3] - b[3]) for a, b in zip(mine, theirs, strict=True))
        found["times"] = apart / run.end_time
    return found
