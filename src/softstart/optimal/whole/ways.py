"""The orders in which the phases of a start may follow each other, and which problems they are for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from softstart.optimal.problem import Problem
from softstart.optimal.replay import replay
from softstart.optimal.whole.answer import Kind
from softstart.profile import TorqueProfile

DOUBLINGS = 40


def not_linear(problem: Problem) -> str:
    """Why the whole start is no linear program with given instants; empty if it is one."""
    drive: Any = problem.drive
    if problem.minimise != "k_dyn":
        return f"what is asked for is the least {problem.minimise}, and only K_dyn is linear"
    if problem.heat is not None:
        return "a bound on the heat is not linear"
    if problem.smoothness > 0.0:
        return "the weight on the smoothness is not linear"
    return _no_phases(drive)


def _no_phases(drive: Any) -> str:
    half = 0.5 * drive.gap
    v0 = drive.initial_motor_speed - drive.initial_load_speed
    reactive = drive.load_kind == "reactive" and drive.Mc > 0.0
    if drive.contact_law == "modelica" and drive.d > 0.0:
        return "the damped modelica law is not linear in contact"
    if drive.start_position < -half or (drive.start_position == -half and v0 < 0.0):
        return "the start begins on the far flank"
    if drive.start_position >= half and v0 < 0.0:
        return "the flanks part at once"
    if reactive and (drive.initial_load_speed != 0.0 or (drive.start_position >= half and v0 != 0.0)):
        return "a reactive load that moves before the contact"
    if reactive and drive.c * (drive.start_position - half) > drive.Mc:
        return "the start is wound up against the load"
    return ""


@dataclass(frozen=True)
class Way:
    """An order of phases, and how soon full torque passes it: contact at `tc`, breakaway at `tb`, s."""

    kinds: tuple[Kind, ...]
    tc: float
    tb: float


def ways(problem: Problem) -> Iterator[Way]:
    """The orders of phases that a start may have."""
    drive: Any = problem.drive
    reactive = drive.load_kind == "reactive" and drive.Mc > 0.0
    touching = drive.start_position >= 0.5 * drive.gap
    tc, tb = _under_full_torque(problem)
    if not reactive:
        yield Way(("contact",) if touching else ("gap", "contact"), tc, tc)
        return
    yield Way(("stuck", "contact") if touching else ("resting", "stuck", "contact"), tc, tb)
    if not touching and drive.d > 0.0:
        fastest = math.sqrt(2.0 * problem.highest_torque / drive.J1 * drive.gap) + drive.initial_motor_speed
        if drive.d * fastest > drive.Mc:
            yield Way(("resting", "contact"), tc, tc)


def _under_full_torque(problem: Problem) -> tuple[float, float]:
    """Contact and breakaway on the exact plant under the largest torque, s; inf: they never come."""
    drive: Any = problem.drive
    full = TorqueProfile([0.0], [problem.highest_torque])
    touching = drive.start_position >= 0.5 * drive.gap
    reactive = drive.load_kind == "reactive" and drive.Mc > 0.0
    until = 2.0 * math.pi / drive.Omega + 2.0 * math.sqrt(drive.gap * drive.J1 / problem.highest_torque)
    for _ in range(DOUBLINGS):
        run = replay(drive, full, until, problem.base)
        tc = 0.0 if touching else run.first_contact
        moving = [event.time for event in run.events if event.kind == "load starts"]
        tb = moving[0] if moving else math.nan
        if math.isfinite(tc) and (math.isfinite(tb) or not reactive):
            return tc, max(tc, tb) if reactive else tc
        until *= 2.0
    return math.inf, math.inf
