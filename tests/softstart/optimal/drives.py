"""Machines and torques that several tests of optimal starts draw or share."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from softstart import Drive, Run, TorqueProfile, simulate
from softstart.chain import Chain, Mass, Motor, Shaft

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
LONG, SHORT = 0.2883042, 0.2522662  # s: 1.2 and 1.05 times the start time of constant torque
CURVE = ((0.0, 62.0), (30.0, 60.0), (80.0, 20.0))
HOIST = Drive(
    motor_inertia=0.19, starting_torque=250, stiffness=3200, gap="6 deg", load_inertia=0.065, load_torque=120,
    damping=1.5, target_speed="970 rpm", start_position="hanging",
)  # fmt: skip
HELD = HOIST.replace(brake="motor")
QUICK = CRANE.replace(gap=0.0, target_speed=20.0)  # its shortest start is found in a moment


def played(machine: Any, profile: TorqueProfile, until: float | None = None, base: Any = None) -> Run:
    """The exact run under a demand."""
    return simulate(machine, "profile", until, parameters={"profile": profile}, base=base)


def random_drive(rng: np.random.Generator) -> tuple[Drive, dict[str, Any]]:
    """A drive of any class, at rest, and the options of its optimum."""
    J1, Ms = 10 ** rng.uniform(-3, 0), 10 ** rng.uniform(0, 3)
    J2 = J1 * 10 ** rng.uniform(-0.5, 1.3)
    Omega = 2.0 * math.pi * 10 ** rng.uniform(0.5, 1.8)
    c = Omega**2 * J1 * J2 / (J1 + J2)
    Mc = Ms * rng.choice([0.0, rng.uniform(0.05, 0.6)])
    target = (Ms - Mc) / (J1 + J2) * 2.0 * math.pi / Omega * 10 ** rng.uniform(-0.3, 0.7)
    gap = Ms / c * 10 ** rng.uniform(-1.0, 1.0)
    drive = Drive(
        motor_inertia=J1, load_inertia=J2, starting_torque=Ms, load_torque=Mc, stiffness=c, gap=gap,
        load_kind=rng.choice(["active", "reactive"]).item(), target_speed=target,
        damping=2.0 * rng.choice([0.0, 0.02, 0.2]) * c / Omega,
        minimum_torque=-Ms * rng.choice([0.0, 0.0, 0.5]),
        torque_lag=rng.choice([0.0, 0.1, 0.5]) / Omega,
        torque_rate=rng.choice([math.inf, math.inf, 3.0]) * Ms * Omega / (2.0 * math.pi),
        start_position=gap * rng.choice([-0.5, 0.0, 0.5]),
    )  # fmt: skip
    options: dict[str, Any] = {"terminal": rng.choice(["synchronous", "steady", "reached"]).item()}
    if rng.random() < 0.25:
        options["torque_speed"] = ((0.0, Ms), (0.7 * target, 0.95 * Ms), (2.0 * target, 0.3 * Ms))
    return drive, options


def moving_drive(rng: np.random.Generator, **fixed: Any) -> Drive:
    """Everything that a drive may have, in units of its own; masses may move at first."""
    J1, Ms = 10 ** rng.uniform(-3, 0), 10 ** rng.uniform(0, 3)
    J2 = J1 * 10 ** rng.uniform(-1, 1.3)
    Omega = 2 * math.pi * 10 ** rng.uniform(0.3, 2)
    c = Omega**2 * J1 * J2 / (J1 + J2)
    Mc = Ms * rng.choice([0.0, rng.uniform(0, 0.8)])
    gap = Ms / c * rng.choice([0.0, 10 ** rng.uniform(-1.5, 1.3)])
    target = (Ms - Mc) / (J1 + J2) * 2 * math.pi / Omega * 10 ** rng.uniform(-0.7, 1)
    w2 = rng.choice([0.0, 0.0, rng.uniform(-0.3, 0.5)]) * target
    given: dict[str, Any] = {
        "motor_inertia": J1,
        "load_inertia": J2,
        "starting_torque": Ms,
        "load_torque": Mc,
        "load_kind": rng.choice(["active", "reactive"]).item(),
        "stiffness": c,
        "damping": 2 * rng.choice([0, 0.02, 0.3]) * c / Omega,
        "contact_law": rng.choice(["no-pull", "dead-zone", "modelica"]).item(),
        "gap": gap,
        "start_position": gap * rng.choice([0.0, -0.5, rng.uniform(-0.6, 0.6)]),
        "torque_lag": rng.choice([0, 0, 0.3]) / Omega,
        "initial_load_speed": w2,
        "initial_motor_speed": w2 + rng.choice([0.0, 0.0, rng.uniform(-0.3, 0.5)]) * target,
        "target_speed": target,
    }
    return Drive(**(given | fixed))


def with_both_parts(rng: np.random.Generator, drive: Drive) -> Drive:
    """The same load torque against forward motion, of which a part, or more than all of it, is active.

    With a share below a half friction holds the load at rest; with one below 0 the active part drives.
    """
    share, Mc = float(rng.choice([-0.4, 0.2, 0.5, 0.7, 0.95])), float(drive.Mc)
    where = {} if share > 0.5 or drive.start_position != "hanging" else {"start_position": "mid-gap"}
    return drive.replace(
        load_kind="active", load_torque=share * Mc, load_friction=(1.0 - share) * Mc, **where
    )


def placed_drive(rng: np.random.Generator) -> Drive:
    """A drive at rest at a random named position, a third of them behind a brake."""
    drive = moving_drive(rng, initial_load_speed=0.0, initial_motor_speed=0.0)
    hangs = drive.load_kind == "active" and drive.Mc > 0.0
    where = ["driving-flank", "mid-gap", "opposite-flank", *(["hanging"] if hangs else [])]
    brake: dict[str, Any] = {"brake": "motor"} if rng.random() < 0.35 else {}
    if brake and rng.random() < 0.5:
        brake["release"] = float(rng.uniform(0.05, 1.5)) * drive.elastic_period
    return drive.replace(start_position=rng.choice(where).item(), **brake)


def random_unknown(seed: int) -> Drive:
    """A random drive that starts at rest somewhere in its gap: damped or not, with a lag or not."""
    rng = np.random.default_rng([seed, 14])
    drive = moving_drive(rng, initial_load_speed=0.0, initial_motor_speed=0.0, contact_law="no-pull")
    gap = float(drive.Ms / drive.c * 10 ** rng.uniform(-1.0, 1.0))
    return drive.replace(gap=gap, start_position="unknown")


def random_torque(rng: np.random.Generator, drive: Drive) -> TorqueProfile:
    """Bangs, ramps and rests within the limits, some in time with the shaft so that contacts repeat."""
    low, high = float(drive.minimum_torque), float(drive.Ms)
    count = int(rng.integers(1, 14))
    lengths = drive.elastic_period * 10 ** rng.uniform(-1.3, 0.7, count)
    levels = rng.choice([low, high, 0.0, rng.uniform(low, high)], count)
    if rng.random() < 0.5:
        levels = rng.uniform(low, high, count)
    times = np.concatenate([[0.0], np.cumsum(lengths)])
    if rng.random() < 0.3:
        return TorqueProfile(times, [*levels, high])
    return TorqueProfile.steps([*times, times[-1] + 1.0], [*levels, high])


def gentle_torque(rng: np.random.Generator, drive: Drive, end: float = 0.3) -> TorqueProfile:
    """Little torque at first, mostly, so that the gap closes once; then more, in steps or ramps."""
    low, high, few = float(drive.minimum_torque), float(drive.Ms), int(rng.integers(1, 9))
    first = rng.uniform(0.0, 0.4 * end, 2) * rng.choice([0.0, 1.0], 2)
    levels = [0.0, rng.uniform(max(low, -0.1 * high), 0.4 * high), *rng.uniform(0.5 * high, high, few)]
    times = np.cumsum([*first, *rng.uniform(0.03, 0.3, few) * end])
    if rng.random() < 0.4:
        rising = times + 3e-4 * end * np.arange(1, times.size + 1)
        return TorqueProfile(np.concatenate([[0.0], rising]), [0.0, *levels])
    return TorqueProfile.steps(
        np.concatenate([[0.0], times + 3e-6 * end * np.arange(1, times.size + 1)]), levels
    )


def shaken(rng: np.random.Generator, profile: TorqueProfile, low: float, high: float) -> TorqueProfile:
    """A demand with its torques and instants changed a little or more."""
    size = 10 ** rng.uniform(-4.0, -0.5)
    torque = np.clip(profile.torque + size * high * rng.normal(size=profile.torque.size), low, high)
    return TorqueProfile(profile.time * (1.0 + 0.1 * size * rng.normal()), torque)


def random_chain(rng: np.random.Generator, curved: bool = False) -> Chain:
    """Three to five masses with one to four gaps, any contact law, friction and lag in some; load curves."""
    count = int(rng.integers(3, 6))
    inertias = 0.03 * 10.0 ** rng.uniform(-1.0, 0.5, count)
    masses = [Mass(float(J), name=f"m{i}") for i, J in enumerate(inertias)]
    kind = "reactive" if rng.random() < 0.4 else "active"
    masses[-1] = masses[-1].replace(torque=float(rng.uniform(2.0, 15.0)), kind=kind)
    if curved:
        for i in (1, count - 1):
            points = np.cumsum(rng.uniform(2.0, 10.0, 4)) - 10.0
            masses[i] = masses[i].replace(curve_speed=points, curve_torque=rng.uniform(-5.0, 20.0, 4))
    law = ("no-pull", "dead-zone", "modelica")[int(rng.integers(3))]
    ratio = float(rng.choice([0.0, 0.02, 0.1]))
    shafts = [
        Shaft(
            float(2000.0 * 10.0 ** rng.uniform(-0.5, 0.8)),
            gap=float(rng.choice([0.0, 0.02, 0.06])) if k else 0.04,
            damping_ratio=ratio,
            contact_law=law,
            efficiency=0.9 if kind == "active" and rng.random() < 0.2 else 1.0,
        )
        for k in range(count - 1)
    ]
    motor = Motor(60.0, mass="m0", maximum_torque=60.0, torque_lag=float(rng.choice([0.0, 0.0, 3e-3])))
    return Chain(masses, shafts, motor=motor, load_mass=f"m{count - 1}", target_speed=1e4)


def damped_crane(ratio: float = 0.02) -> Chain:
    """The crane with four masses and a damping ratio in each shaft."""
    chain = Chain.load("crane-4-mass")
    return dataclasses.replace(chain, shafts=tuple(one.replace(damping_ratio=ratio) for one in chain.shafts))


def three_masses(
    kind: str = "active",
    law: str = "no-pull",
    efficiency: float = 1.0,
    motor: dict[str, Any] | None = None,
    **load: Any,
) -> Chain:
    """Three masses with two gaps, which close, bounce and close again."""
    shafts = [
        Shaft(c, damping_ratio=0.02, gap=0.05, contact_law=law, efficiency=efficiency) for c in (3e3, 2e3)
    ]
    masses = [Mass(0.1), Mass(0.02), Mass(0.4, torque=20.0, kind=kind, **load)]
    return Chain(masses, shafts, Motor(100.0, **(motor or {})), target_speed=20.0)


def without_gaps(**motor: Any) -> Chain:
    """Three masses in a row without gaps, at rest under their load: everything linear."""
    shafts = [Shaft(c, damping_ratio=0.02, start_position=20.0 / c) for c in (3e3, 2e3)]
    return Chain(
        [Mass(0.1), Mass(0.02), Mass(0.4, torque=20.0)], shafts, Motor(100.0, **motor), target_speed=20.0
    )
