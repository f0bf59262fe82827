"""First guess and mesh: a roughly possible trajectory of the whole start, and how finely its arcs are cut.

The gap is crossed with constant acceleration; in contact the shaft torque rises smoothly to the level that
brings the load to its speed in the time left, and is held. A solution gives its own trajectory instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from softstart.arrays import Vector
from softstart.optimal.collocation.program import Numbers, Phase, Program
from softstart.optimal.collocation.transcription import POINTS, Mesh, Slot
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import PulseCoastHold

Reading = tuple[Vector, float, float, Vector, Vector]  # durations, peak, heat, states, demands


@dataclass(frozen=True)
class ArcTrajectory:
    """States (n, 4) = (z, v, w2, u) and demand at shares of an arc's duration."""

    duration: float
    shares: Vector
    states: Vector
    demand_shares: Vector
    demand: Vector


@dataclass(frozen=True)
class Trajectory:
    """A whole start, in the units of program.py."""

    arcs: tuple[ArcTrajectory, ...]
    peak: float

    def values(self, program: Program, p: Numbers, slots: tuple[Slot, ...]) -> Vector:
        """The trajectory as values of the variables."""
        phases = program.arcs
        out = np.empty(len(slots))
        for i, slot in enumerate(slots):
            arc = self.arcs[slot.arc]
            if slot.kind == "state":
                scale = p.contact_scale if phases[slot.arc].contact else p.gap_scale
                value = np.interp(slot.share, arc.shares, arc.states[:, slot.component])
                out[i] = value / scale[slot.component]
            elif slot.kind == "demand":
                out[i] = np.interp(slot.share, arc.demand_shares, arc.demand)
            else:
                out[i] = arc.duration if slot.kind == "duration" else self.peak
        return out


def quickest_contact(p: Numbers) -> float:
    """Instant of the contact under full torque, roughly; 0 without a gap."""
    travel, v = max(0.0, -p.z_start), p.v_start
    if travel == 0.0 and v >= 0.0:
        return 0.0
    a = p.highest / p.J1
    crossing = (
        2.0 * travel / (v + math.sqrt(v * v + 2.0 * a * travel))
        if v > 0.0
        else (math.sqrt(v * v + 2.0 * a * travel) - v) / a
    )
    ramp = p.highest / p.rate
    # half of the ramp, and of the lag, are lost; a crossing wholly within the ramp goes with t^3
    within = (6.0 * travel * p.J1 / p.rate) ** (1.0 / 3.0) if p.rate < 1e20 else 0.0
    slow = min(crossing + 0.5 * ramp, within) if p.rate < 1e20 else crossing
    return max(crossing, slow) + min(p.lag, crossing)


def likely_contact(problem: Problem, p: Numbers) -> float:
    """Instant of the contact in the best start: as much later than the quickest as in pulse, coast, hold."""
    quickest = quickest_contact(p)
    starts = PulseCoastHold.of(problem)
    if problem.start_time is None or quickest == 0.0 or starts.v0 < 0.0:
        return 1.15 * quickest
    ideal = starts.course(starts.full_peak).t_contact
    time = problem.start_time - max(0.0, quickest * p.units.time - ideal)
    P = starts.least_peak_for(problem.target, time) if time > ideal else math.inf
    later = starts.course(P).t_contact / ideal if math.isfinite(P) else 1.15
    return quickest * min(max(later, 1.05), 4.0)


def first_trajectory(program: Program, p: Numbers, contact: float, end: float) -> Trajectory:
    """A start with its contact at `contact` and its end at `end`."""
    arcs: list[ArcTrajectory] = []
    z, v, w2 = p.z_start, p.v_start, p.w2_start
    before = [phase for phase in program.phases if not phase.contact]
    for phase in before:
        pieces, (z, v, w2) = _crossing(p, phase, (z, v, w2), contact / len(before), phase is before[-1])
        arcs += pieces
    left = end - (contact if before else 0.0)
    peak = 0.0
    for phase in program.phases:
        if not phase.contact:
            continue
        if phase.load == 0 or phase.stiff:
            travel = 0.1 * p.d * v / p.c if phase.stiff else p.Mc / p.c - z
            piece = _pressing(p, z, v, w2, max(travel, 1e-6), left)
            left -= piece.duration
            z, v = float(piece.states[-1, 0]), float(piece.states[-1, 1])
            arcs.append(piece)
        elif phase.end == "terminal":
            pieces, peak = _driving(p, phase, z, w2, left)
            arcs += pieces
        else:
            last = arcs[-1]
            u = float(last.demand[-1])
            trajectory = np.repeat(last.states[-1:], 2, axis=0)
            arcs.append(
                ArcTrajectory((u - p.lowest) / p.rate, ENDS, trajectory, ENDS, np.array([u, p.lowest]))
            )
    return Trajectory(tuple(arcs), peak)


ENDS = np.array([0.0, 1.0])
FINE = np.linspace(0.0, 1.0, 33)


def _crossing(
    p: Numbers, phase: Phase, start: tuple[float, float, float], time: float, lands: bool
) -> tuple[list[ArcTrajectory], tuple[float, float, float]]:
    """The gap, with constant relative acceleration."""
    z0, v0, w20 = start
    a2 = -phase.load * p.Mc / p.J2
    travel = (-z0 if lands else 0.25 * -z0) or 1e-6
    time = max(time, 1e-6)
    a = 2.0 * (travel - v0 * time) / time**2
    u = min(max(p.J1 * (a + a2), p.lowest), p.highest)
    pieces = []
    for k in range(phase.arcs):
        t = time * (k + FINE) / phase.arcs
        w2 = w20 + a2 * t
        states = np.column_stack([z0 + v0 * t + 0.5 * a * t**2, v0 + a * t, w2, np.full(t.size, u)])
        pieces.append(ArcTrajectory(time / phase.arcs, FINE, states, ENDS, np.array([u, u])))
    return pieces, (z0 + travel, v0 + a * time, w20 + a2 * time)


def _pressing(p: Numbers, z: float, v: float, w2: float, travel: float, left: float) -> ArcTrajectory:
    """The first bit of a contact, until the load breaks away or the shaft softens."""
    u = 0.5 * p.highest
    speed = math.sqrt(v * v + 2.0 * u / p.J1 * travel)
    time = min(2.0 * travel / (v + speed), 0.2 * left)
    t = time * FINE
    rise = travel / time
    states = np.column_stack([z + rise * t, np.full(t.size, rise), np.full(t.size, w2), np.full(t.size, u)])
    return ArcTrajectory(time, FINE, states, ENDS, np.array([u, u]))


def _driving(p: Numbers, phase: Phase, z: float, w2: float, left: float) -> tuple[list[ArcTrajectory], float]:
    """T rises from c z to its level as half a cosine and is held there."""
    rise = min(0.4 * left, 0.5 * 2.0 * math.pi / p.Omega)
    T0 = p.c * z
    # J2 (target - w2) = integral of T - Mc, with T on average halfway up during the rise
    level = (p.J2 * (p.target - w2) + p.Mc * left - 0.5 * rise * T0) / (left - 0.5 * rise)
    durations = [rise, *([(left - rise) / (phase.arcs - 1)] * (phase.arcs - 1))]
    pieces = []
    begin = 0.0
    for duration in durations:
        t = begin + duration * FINE
        s = np.minimum(t / rise, 1.0)
        q = math.pi * s
        T = T0 + (level - T0) * 0.5 * (1.0 - np.cos(q))
        slope = (level - T0) * 0.5 * math.pi / rise * np.sin(q)
        bend = np.where(s < 1.0, (level - T0) * 0.5 * (math.pi / rise) ** 2 * np.cos(q), 0.0)
        momentum = T0 * t + (level - T0) * (0.5 * (np.minimum(t, rise) - rise / math.pi * np.sin(q)))
        momentum += (level - T0) * np.maximum(t - rise, 0.0) - p.Mc * t
        u = np.clip(T + p.J1 * (bend / p.c + (T - p.Mc) / p.J2), p.lowest, p.highest)
        states = np.column_stack([T / p.c, slope / p.c, w2 + momentum / p.J2, u])
        pieces.append(ArcTrajectory(duration, FINE, states, FINE, u))
        begin += duration
    return pieces, max(level, p.Mc)


def from_solution(mesh: Mesh, read: Reading, first: Vector) -> Trajectory:
    """The trajectory of a solution, `read` as by `Solution.read`; `first` is the state at t = 0."""
    durations, peak, _, states, demands = read
    if states.shape[1] == 3:
        states = np.column_stack([states, np.zeros(len(states))])
    arcs: list[ArcTrajectory] = []
    at = 0
    begin = first
    for duration, edges in zip(durations, mesh, strict=True):
        n = len(edges) - 1
        own = np.vstack([begin, states[4 * at : 4 * (at + n)]])
        inner = np.array(edges)
        width = np.diff(inner)
        where = (inner[:-1, None] + width[:, None] * np.array([*POINTS, 1.0])).ravel()
        both_ends = np.column_stack([inner[:-1] + 1e-9 * width, inner[1:] - 1e-9 * width]).ravel()
        arcs.append(
            ArcTrajectory(
                float(duration), np.append(0.0, where), own, both_ends, demands[at : at + n].ravel()
            )
        )
        begin, at = own[-1], at + n
    return Trajectory(tuple(arcs), float(peak))


STRIDE = 0.6  # rad of the elastic oscillation an interval may span at first
FEWEST, MOST = 6, 30  # intervals of an arc at first


def first_mesh(program: Program, p: Numbers, trajectory: Trajectory) -> Mesh:
    """Even cuts, fine enough for the elastic oscillation and the torque lag."""
    mesh = []
    for phase, arc in zip(program.arcs, trajectory.arcs, strict=True):
        n = arc.duration * p.Omega / STRIDE if phase.contact else 0.0
        if program.lagged:
            n = max(n, arc.duration / (2.0 * p.lag))
        if program.demand != "steps":
            n = 1.5 * n
        if not phase.contact:
            n = max(n, 4) - 2
        mesh.append(_even(min(max(math.ceil(n), FEWEST if phase.contact else 4), MOST)))
    return tuple(mesh)


def _even(n: int) -> tuple[float, ...]:
    return tuple((np.arange(n + 1) / n).tolist())


def refined(mesh: Mesh, flagged: list[bool]) -> Mesh:
    """The mesh with flagged intervals halved."""
    marks = iter(flagged)
    finer = []
    for edges in mesh:
        kept = [edges[0]]
        for begin, end in pairwise(edges):
            if next(marks):
                kept.append(0.5 * (begin + end))
            kept.append(end)
        finer.append(tuple(kept))
    return tuple(finer)


def intervals(mesh: Mesh) -> int:
    """How many there are."""
    return sum(len(edges) - 1 for edges in mesh)
