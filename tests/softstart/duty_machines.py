"""Duties of the oracle as machines and duties of softstart, and how far apart the two are."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from tests.duty_cases import Case, Step
from tests.softstart.chain.oracle_starts import built
from tests.softstart.kernel.pieces import Pieces

from softstart import Drive, Duty, DutyRun, DutyStep, run_duty
from softstart.chain import Chain, Motor

LOADS = {"Mc": "torque", "J": "inertia"}


def drive_of(case: Case) -> Drive:
    g = case.given
    return Drive(
        motor_inertia=float(g.J[0]), motor_friction=float(g.friction[0]), starting_torque=case.torque,
        motor_viscous_friction=float(g.ground[0]), minimum_torque=-case.braking, torque_lag=case.lag,
        torque_rate=case.rate, encoder_lines=0, stiffness=float(g.c[0]), damping=float(g.d[0]),
        gap=float(g.gap[0]), contact_law=g.law[0], load_inertia=float(g.J[1]), load_torque=float(g.Mc[1]),
        load_kind="reactive" if g.reactive[1] else "active", load_friction=float(g.friction[1]),
        load_viscous_friction=float(g.ground[1]), target_speed=case.target,
        start_position=float(g.theta0[0]), computing_delay=case.dead_time, **brake_of(case),
    )  # fmt: skip


def chain_of(case: Case) -> Chain:
    motor = Motor(
        case.torque, mass=f"mass {case.given.motor + 1}", minimum_torque=-case.braking, torque_lag=case.lag,
        torque_rate=case.rate, encoder_lines=0, computing_delay=case.dead_time,
    )  # fmt: skip
    chain = built(case.given, motor, case.target)
    return chain.replace(**brake_of(case))


def machine_of(case: Case) -> Drive | Chain:
    return chain_of(case) if case.given.J.size > 2 or case.given.curves else drive_of(case)


def brake_of(case: Case) -> dict[str, Any]:
    """The parameters of its brake; an ideal lock has delays alone."""
    torque = {"brake_torque": case.brake} if 0.0 < case.brake < math.inf else {}
    delays = {"closing_delay": case.closing, "opening_delay": case.opening} if case.brake > 0.0 else {}
    return {**torque, **delays, **({"brake": "motor", "release": "torque"} if case.proving else {})}


def duty_of(case: Case) -> Duty:
    steps = [{LOADS.get(key, key): value for key, value in step.items()} for step in case.steps]
    for step in steps:
        if "mass" in step:
            step["mass"] = f"mass {step['mass'] + 1}"
    return Duty(steps=[DutyStep(**step) for step in steps])


def run_of(case: Case, cycles: int = 1) -> DutyRun:
    return run_duty(machine_of(case), Pieces(pieces=tuple(case.pieces)), duty_of(case), cycles=cycles)


def differences(case: Case, run: DutyRun, steps: list[Step]) -> dict[str, float]:
    """Largest differences at the ends of all phases, and of peaks and times, of what occurs.

    The run may have more cycles than the steps of the oracle.
    """
    assert len(run.executed) >= len(steps)
    peak = max(float(np.abs([step.highest, step.lowest]).max()) for step in steps)
    found: dict[str, float] = dict.fromkeys(
        ("time", "w", "twist", "phi", "T", "peaks", "since", "impacts"), 0.0
    )

    def note(name: str, mine: Any, theirs: Any, scale: float) -> None:
        apart = np.abs(np.asarray(mine) - np.asarray(theirs)).max() / scale
        found[name] = max(found[name], float(apart) if np.isfinite(apart) else math.inf)

    energy = 0.5 * float(case.given.J.sum()) * case.target**2
    length, twist = steps[-1].end.time, float(np.max(peak / case.given.c + 0.5 * case.given.gap))
    for ran, step in zip(run.executed, steps, strict=False):
        note("time", [ran.begin, ran.end], [step.phases[0].begin, step.end.time], length)
        note("peaks", [ran.largest, ran.smallest], [step.highest, step.lowest], peak)
        if step.do in ("stop", "load", "brake") and step.end.reason == "stand":
            note("since", ran.begin + ran.time, step.end.since, length)
        note("impacts", ran.impact_energy, step.impacts, energy)
        if case.given.J.size == 2:
            assert ran.contacts == step.contacts
        for end in step.phases:
            before = run.at(min(end.time, run.executed[-1].end))
            note("w", before["w"][0], end.w, case.target)
            note("twist", before["twist"][0], end.twist, twist)
            note("T", before["T"][0], end.T, peak)
            note("phi", before["phi"][0, case.given.load], end.phi, max(abs(end.phi), twist))
    return found
