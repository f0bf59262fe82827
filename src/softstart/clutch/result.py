"""`Engagement`: the figures of one engagement, its energy balance and its traces."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.clutch.engaging import Event, History
from softstart.clutch.laws import Law
from softstart.clutch.model import Clutch
from softstart.clutch.motion import LOCKED, POWERS, Motion
from softstart.clutch.polynomials import definite, definite_integral, roots, value

__all__ = ["EnergyBalance", "Engagement", "Phase", "figures_of"]

Vector = NDArray[np.float64]

SAME = 1.0 + 1e-13
MANY = 500  # steps, of which each is less than two radians of the fastest swing


@dataclass(frozen=True)
class Phase:
    """A span in which the clutch slips, or is locked: instants in s, peak |T| in N m with its instant, work
    in J.
    """

    kind: str
    start: float
    end: float
    peak_torque: float
    peak_time: float
    friction_work: float


@dataclass(frozen=True)
class EnergyBalance:
    """Where the work of the driving side went, in J.

    `drive` is its work; `friction` the heat in the clutch, `damping` that in the shaft, `load` the work
    against the load torque, `kinetic` and `elastic` what is stored at the end.
    """

    drive: float
    friction: float
    damping: float
    load: float
    kinetic: float
    elastic: float

    @property
    def residual(self) -> float:
        """What does not add up, as a share of the work of the driving side."""
        spent = self.friction + self.damping + self.load + self.kinetic + self.elastic
        return abs(self.drive - spent) / abs(self.drive) if self.drive else abs(spent)


@dataclass(frozen=True, eq=False)
class Engagement:
    """One engagement: torques in N m, times in s, work in J.

    `status` is "LOCKED", or "SLIPS" if the clutch slips at the end. `slip_time` is tau1, the first instant at
    which the clutch side turns at w0 and is held there. `peak_torque` is the largest |T| of all,
    `slip_peak_torque` that up to tau1, [C] (2), `locked_peak_torque` that behind it. `friction_work` counts
    slip before and after tau1; `slip_work` that up to tau1, [C] (3).
    """

    clutch: Clutch
    law: Law
    status: str
    slip_time: float
    end_time: float
    peak_torque: float
    peak_time: float
    slip_peak_torque: float
    slip_peak_time: float
    locked_peak_torque: float
    friction_work: float
    slip_work: float
    work_while_engaging: float
    energy: EnergyBalance
    phases: tuple[Phase, ...]
    events: tuple[Event, ...]
    steps: tuple[Motion, ...]

    @property
    def peak_ratio(self) -> float:
        """`peak_torque` over the torque (MM Ic + Mc IM)/(IM + Ic) about which the slipping shaft swings."""
        return self.peak_torque / self.clutch.mean_torque

    @property
    def lining_heat(self) -> float:
        """Friction work over the area of the linings, J/m^2; NaN if no area is given."""
        area = self.clutch.lining_area
        return math.nan if area is None else self.friction_work / area

    def at(self, times: ArrayLike) -> dict[str, Vector]:
        """M, F, T (N m), theta (rad), v, wM, wc (rad/s) and slip = w0 - wM at the instants (s), from the
        series.

        M is the friction torque that the clutch can have, F the torque that goes through it.
        """
        when = np.atleast_1d(np.asarray(times, dtype=np.float64)).ravel()
        names = ("M", "F", "T", "theta", "v", "wM", "wc")
        out = {name: np.empty(when.size) for name in names}
        starts = [step.state.t for step in self.steps]
        for i, t in enumerate(when.tolist()):
            step = self.steps[max(bisect_right(starts, t) - 1, 0)]
            at = min(max(t - step.state.t, 0.0), step.h) ** POWERS
            for name in names:
                out[name][i] = getattr(step, name) @ at
        out["slip"] = self.clutch.drive_speed - out["wM"]
        return out

    @cached_property
    def t(self) -> Vector:
        """Instants in s that show all there is to see: 24 in each step, 8 where there are many steps."""
        count = 24 if len(self.steps) < MANY else 8
        shares = np.arange(count) / count
        inner = [step.state.t + step.h * shares for step in self.steps]
        return np.concatenate([*inner, [self.end_time]])

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        energy = {name: getattr(self.energy, name) for name in EnergyBalance.__dataclass_fields__}
        return {
            "clutch": self.clutch.summary(),
            "law": self.law.label,
            "engaged_at": self.law.engaged_at,
            "status": self.status,
            "slip_time": self.slip_time,
            "end_time": self.end_time,
            "peak_torque": self.peak_torque,
            "peak_time": self.peak_time,
            "slip_peak_torque": self.slip_peak_torque,
            "slip_peak_time": self.slip_peak_time,
            "locked_peak_torque": self.locked_peak_torque,
            "mean_torque": self.clutch.mean_torque,
            "peak_ratio": self.peak_ratio,
            "friction_work": self.friction_work,
            "slip_work": self.slip_work,
            "work_while_engaging": self.work_while_engaging,
            "lining_heat": self.lining_heat,
            "energy": {**energy, "residual": self.energy.residual},
            "phases": [dict(vars(phase)) for phase in self.phases],
            "events": [{"time": event.t, "event": event.name} for event in self.events],
        }

    def plot(self) -> Any:
        """Torques, speeds and friction power over time."""
        from softstart.clutch.pictures import engagement_figure

        return engagement_figure([self], self.clutch.name)


def figures_of(clutch: Clutch, law: Law, found: History) -> Engagement:
    """The figures of a history: peaks at the roots of T', work from the products of the series."""
    book = _Book(clutch, found.locked_at, law.engaged_at)
    for step in found.steps:
        book.take(step)
    last = found.steps[-1].after()
    elastic = 0.0
    mode = found.mode
    flank = mode.side or mode.pressed
    if flank:
        elastic = 0.5 * clutch.stiffness * (last.theta - 0.5 * flank * clutch.gap) ** 2
    if mode.side == 0:
        elastic = 0.0  # pressed in without torque: counted as lost at the release
    kinetic = 0.5 * (clutch.clutch_inertia * last.wM**2 + clutch.load_inertia * last.wc**2)
    energy = EnergyBalance(
        book.drive, book.friction, book.damping + found.lost_at_release, book.load, kinetic, elastic
    )
    phases = tuple(book.phases)
    slipping = [p for p in phases if p.start < found.locked_at or math.isnan(found.locked_at)]
    locked = [p for p in phases if p.start >= found.locked_at]
    top = max(phases, key=lambda p: p.peak_torque)
    slip_top = max(slipping, key=lambda p: p.peak_torque)
    return Engagement(
        clutch=clutch, law=law, status="LOCKED" if mode.slip == LOCKED else "SLIPS",
        slip_time=found.locked_at, end_time=found.steps[-1].end,
        peak_torque=top.peak_torque, peak_time=top.peak_time,
        slip_peak_torque=slip_top.peak_torque, slip_peak_time=slip_top.peak_time,
        locked_peak_torque=max((p.peak_torque for p in locked), default=math.nan),
        friction_work=book.friction, slip_work=sum(p.friction_work for p in slipping),
        work_while_engaging=book.engaging,
        energy=energy, phases=phases, events=tuple(found.events), steps=tuple(found.steps),
    )  # fmt: skip


class _Book:
    """Adds up work and keeps peaks, step by step."""

    def __init__(self, clutch: Clutch, locked_at: float, engaged_at: float) -> None:
        self.clutch = clutch
        self.engaged_at = engaged_at
        self.drive = self.friction = self.damping = self.load = self.engaging = 0.0
        self.phases: list[Phase] = []

    def take(self, step: Motion) -> None:
        clutch, h = self.clutch, step.h
        self.drive += clutch.drive_speed * definite_integral(step.F, h)
        self.load += step.R * definite_integral(step.wc, h)
        if clutch.damping > 0.0 and step.mode.side != 0:
            self.damping += clutch.damping * definite(step.v, step.v, h)
        work = 0.0
        if step.mode.slip != LOCKED:
            slip = -step.wM
            slip[0] += clutch.drive_speed
            work = definite(step.F, slip, h)
        self.friction += work
        if step.state.t < self.engaged_at:
            self.engaging += work
        kind = "locked" if step.mode.slip == LOCKED else "slip"
        if not self.phases or self.phases[-1].kind != kind:
            self.phases.append(Phase(kind, step.state.t, step.end, 0.0, step.state.t, 0.0))
        before = self.phases[-1]
        top, when = peak_of(step, before.peak_torque)
        if top <= before.peak_torque * SAME:  # of equal peaks the first
            top, when = before.peak_torque, before.peak_time
        self.phases[-1] = Phase(kind, before.start, step.end, top, when, before.friction_work + work)


def peak_of(step: Motion, known: float = 0.0) -> tuple[float, float]:
    """Largest |T| of the step and its instant; (0, its begin) if it is no larger than `known`."""
    scaled = step.T * step.h**POWERS
    if np.abs(scaled).sum() <= known:
        return 0.0, step.state.t
    instants: Sequence[float] = [0.0, *roots(scaled[1:] * POWERS[1:]), 1.0]
    best = max(instants, key=lambda u: abs(value(scaled, u)))
    return abs(value(scaled, best)), step.state.t + best * step.h
