"""Starts of chains, given both to the kernel and to the oracle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from tests.oracle_torque import TorquePath
from tests.softstart.chain.chain_oracle import ChainOracle, Given
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
        tones = [
            (int(rng.integers(count)), float(rate * rng.uniform(0.05, 0.6)), 0.3 * torque, -0.2 * torque)
        ]
    return {
        "J": J,
        "c": c,
        "d": np.where(
            damped & np.isnan(restitution), 2 * rng.uniform(0, 0.6, count - 1) * np.sqrt(c * J.min()), 0.0
        ),
        "gap": gap,
        "law": law,
        "restitution": restitution,
        "theta0": gap * rng.uniform(-0.45, 0.45, count - 1),
        "w0": np.where(rng.random(count) < 0.5, 0.0, rng.normal(size=count)),
        "Mc": torque * rng.uniform(0, 0.5, count) * (rng.random(count) < 0.6),
        "reactive": rng.random(count) < 0.5,
        "ground": np.where(rng.random(count) < 0.3, rng.uniform(0, 1.0, count), 0.0),
        "tones": tones,
        "pieces": [(0.0, torque), (0.4 * t_end, torque * float(rng.uniform(-0.5, 1.0)))],
        "lag": 0.0 if rng.random() < 0.5 else 0.05 * t_end,
        "rate": math.inf if rng.random() < 0.5 else 8 * torque / t_end,
        "motor": int(rng.integers(count)),
        "t_end": t_end,
        "target": float(rng.uniform(0.1, 1.0)),
    }


def with_losses(rng: np.random.Generator, drawn: dict[str, Any]) -> dict[str, Any]:
    """The same with losses in most gears of its springs, on either side of them."""
    count = drawn["c"].size
    lossy = (rng.random(count) < 0.7) & np.isnan(drawn["restitution"])
    efficiency = np.where(lossy, rng.uniform(0.4, 0.99, count), 1.0)
    return drawn | {"efficiency": efficiency, "gear": np.arange(count) + rng.integers(0, 2, count)}


def of_curve(curve: tuple[np.ndarray, np.ndarray, bool] | None) -> dict[str, Any]:
    """Keywords of a `Mass` for its load curve."""
    if curve is None:
        return {}
    points, torques, by_angle = curve
    return {"curve_angle" if by_angle else "curve_speed": list(points), "curve_torque": list(torques)}


def both(
    J: np.ndarray, c: np.ndarray, d: np.ndarray, gap: np.ndarray, law: list[str], restitution: np.ndarray,
    theta0: np.ndarray, w0: np.ndarray, Mc: np.ndarray, reactive: np.ndarray, ground: np.ndarray,
    tones: list[tuple[int, float, float, float]], pieces: list[tuple[float, float]], lag: float, rate: float,
    motor: int, t_end: float, target: float, rtol: float = 1e-12, efficiency: np.ndarray | None = None,
    gear: np.ndarray | None = None, check: bool = True, u0: float = 0.0,
    curves: dict[int, tuple[np.ndarray, np.ndarray, bool]] | None = None, load: int = -1,
) -> tuple[Run, ChainOracle]:  # fmt: skip
    """The same start by the kernel and, to `check` it, by the oracle."""
    reactive = reactive & (Mc > 0)
    target = max(target, float(w0[load]) + 1e-2)
    eta = np.ones(c.size) if efficiency is None else efficiency
    after = np.zeros(c.size, bool) if gear is None else gear == np.arange(c.size)
    largest = max(*(abs(u) for _, u in pieces), 1.0)
    chain = Chain(
        [
            Mass(float(J[i]), torque=float(Mc[i]), kind="reactive" if reactive[i] else "active",
                 damping=float(ground[i]), initial_speed=float(w0[i]), **of_curve((curves or {}).get(i)))
            for i in range(J.size)
        ],
        [
            Shaft(gap=float(gap[k]), restitution=float(restitution[k]), start_position=float(theta0[k]))
            if restitution[k] == restitution[k]
            else Shaft(float(c[k]), damping=float(d[k]), gap=float(gap[k]), contact_law=law[k],  # type: ignore[arg-type]
                       start_position=float(theta0[k]), efficiency=float(eta[k]),
                       side="after" if after[k] else "before")
            for k in range(c.size)
        ],
        Motor(largest, mass=f"mass {motor + 1}", minimum_torque=-largest, torque_lag=lag, torque_rate=rate,
              initial_torque=u0),
        target_speed=target, load_mass=f"mass {load % J.size + 1}",
    )  # fmt: skip
    excitation: dict[str | int, PeriodicTorque] = {
        i: PeriodicTorque(0.0, [1.0], [cosine], [sine], speed=omega)  # type: ignore[arg-type]
        for i, omega, cosine, sine in tones
    }
    controller = Pieces(pieces=tuple(pieces), end=math.inf)
    run = simulate(chain, controller, t_end, fitted_to=ANY_DRIVE, excitation=excitation)
    given = Given(
        J,
        Mc,
        reactive,
        w0,
        c,
        d,
        gap,
        law,
        theta0,
        ground,
        np.zeros(J.size),
        tones,
        restitution,
        motor,
        load,
        efficiency=eta,
        gear=gear,
        curves=curves or {},
    )
    path = TorquePath(list(pieces), lag, rate, u0, t_end)
    oracle = ChainOracle(given, path, target, rtol)
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
