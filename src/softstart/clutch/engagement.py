"""One engagement of a clutch: from rest through slip, lock-up and slip again, its figures and its energy.

A step ends at the end of a piece of the law, at the end of the run, or where an event function crosses zero
(`motion`). Peaks are at the roots of T', work comes from the products of the series: no output grid.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.clutch.laws import Law
from softstart.clutch.model import Clutch
from softstart.clutch.motion import (
    ClutchMode,
    ClutchState,
    TaylorStep,
    event_functions,
    first_crossing,
    next_mode,
    roots,
    start_mode,
    step_from,
    values,
)
from softstart.errors import SimulationError
from softstart.input.files import object_of
from softstart.quantities import time_above_0
from softstart.results import Result

MOST_STEPS = 400_000
MOST_SIMULTANEOUS = 40
REVERSALS = 2  # of the twist after the lock-up, so that the run holds both peaks of a cycle
AT_REST = 1e-9
ROUNDING = 2e-15  # of the time: accuracy of an event's instant
SAME = 1.0 + 1e-13  # ratio of peaks that count as equal
MANY_STEPS = 500  # steps, each shorter than two radians of the fastest oscillation
FIGURES = (
    "status", "slip_time", "end_time", "peak_torque", "peak_time", "slip_peak_torque", "slip_peak_time",
    "locked_peak_torque", "peak_ratio", "friction_work", "slip_work", "work_while_engaging", "lining_heat",
)  # fmt: skip
TIME_LIMIT_FACTOR = 20.0  # times the slip time on a rigid shaft, until an engagement is given up


@dataclass(frozen=True)
class EngagementEvent:
    """What happened at the instant t (s)."""

    t: float
    name: str


@dataclass(frozen=True)
class Phase:
    """A span of slip, or of lock: instants in s, peak |T| in N m with its instant, work in J."""

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
        """Error of the balance, as a share of the work of the driving side."""
        spent = self.friction + self.damping + self.load + self.kinetic + self.elastic
        return abs(self.drive - spent) / abs(self.drive) if self.drive else abs(spent)


@dataclass(frozen=True, eq=False, repr=False)
class Engagement(Result, view="clutches.engagement_sheet"):
    """One engagement, as `engage` returns it: torques in N m, times in s, work in J.

    Attributes
    ----------
    status : str
        "LOCKED", or "SLIPS" if the clutch slips at the end.
    slip_time, end_time : float
        tau1, the first instant at which the clutch side turns at w0 and is held there; end of the run.
    peak_torque, slip_peak_torque, locked_peak_torque : float
        Largest |T| of all, up to tau1, [C] (2), and after tau1.
    peak_time, slip_peak_time : float
        Instants of the first two.
    friction_work, slip_work, work_while_engaging : float
        Work of all slip, of that up to tau1, [C] (3), and of that before the torque of the law is held.
    energy : EnergyBalance
        Where the work of the driving side went.
    phases, events, steps : tuple
        Spans of slip and of lock; changes of mode; the Taylor series of all steps.

    References
    ----------
    [C], the paper on friction clutches.

    Examples
    --------
    >>> run = engage(Clutch.load("paper-c"))
    >>> round(run.slip_time, 4), run.energy.residual < 1e-12
    (4.1527, True)
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
    events: tuple[EngagementEvent, ...]
    steps: tuple[TaylorStep, ...]

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
        """M, F, T (N m), theta (rad), v, wM, wc (rad/s) and slip = w0 - wM at the instants (s).

        M is the friction torque that the clutch can transmit, F the torque that it transmits. The values
        come from the series.
        """
        when = np.atleast_1d(np.asarray(times, dtype=np.float64)).ravel()
        names = ("M", "F", "T", "theta", "v", "wM", "wc")
        indices = np.searchsorted([step.start for step in self.steps[1:]], when, side="right")
        out = {name: np.empty(when.size) for name in names}
        for index in np.unique(indices):
            step, inside = self.steps[index], indices == index
            u = np.clip((when[inside] - step.start) / step.length, 0.0, 1.0)
            for name in names:
                out[name][inside] = values(getattr(step, name), u)
        out["slip"] = self.clutch.drive_speed - out["wM"]
        return out

    @cached_property
    def t(self) -> Vector:
        """Instants in s for plots: 24 in each step, 8 where there are many steps."""
        count = 24 if len(self.steps) < MANY_STEPS else 8
        shares = np.arange(count) / count
        inner = [step.start + step.length * shares for step in self.steps]
        return np.concatenate([*inner, [self.end_time]])

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "clutch": self.clutch.summary(),
            "law": self.law.label,
            "engaged_at": self.law.engaged_at,
            **{name: getattr(self, name) for name in FIGURES},
            "mean_torque": self.clutch.mean_torque,
            "energy": {**asdict(self.energy), "residual": self.energy.residual},
            "phases": [asdict(phase) for phase in self.phases],
            "events": [{"time": event.t, "event": event.name} for event in self.events],
        }


def engage(clutch: Clutch | str | os.PathLike[str], *, until: float | str | None = None) -> Engagement:
    """Engage the clutch from rest, the shaft in the middle of its gap.

    Times of events, peaks and work are exact to about 1e-12 of their size: Taylor series of the 24th order,
    located roots, no output grid.

    Parameters
    ----------
    clutch : Clutch, str or path
        The clutch, with its engagement law, or its name or file.
    until : float or str, optional
        End of the run: s, or text with a unit. By default one elastic period 2 pi sqrt(Ic/cp) after the first
        lock-up (with a gap not before the twist has reversed twice, and not while the clutch slips again), so
        that the peak after the lock-up is included. Without damping a clutch may slip again in each period,
        ever less; a later `until` shows more of that.

    Returns
    -------
    Engagement
        Torques in N m, times in s, work in J.

    Raises
    ------
    InputError
        If `until` is not a time above 0.
    SimulationError
        If the engagement cannot be completed.

    References
    ----------
    [C] (1)-(5).

    Examples
    --------
    >>> run = engage(Clutch.load("paper-c"))
    >>> run.status, round(run.slip_time, 4), round(run.peak_ratio, 4), run.energy.residual < 1e-12
    ('LOCKED', 4.1527, 1.2123, True)
    """
    clutch = object_of(clutch, Clutch, Clutch.load, "clutch: give one Clutch")
    end = None if until is None else time_above_0(until, "until", "; leave it out to run to the lock-up")
    law = clutch.friction
    events: list[EngagementEvent] = []
    steps, mode, lost = _steps(clutch, law, end, events)
    return _figures(clutch, law, steps, events, mode, lost)


def _time_limit(clutch: Clutch, law: Law) -> float:
    """When an engagement is given up, s: by far later than a rigid shaft is at speed."""
    inertia = clutch.clutch_inertia + clutch.load_inertia
    needed = clutch.drive_speed * inertia + clutch.load_torque * law.engaged_at
    periods = 2.0 * math.pi / clutch.locked_frequency + 2.0 * math.pi / clutch.B
    return TIME_LIMIT_FACTOR * (law.engaged_at + needed / (law.held - clutch.load_torque) + periods)


def _steps(
    clutch: Clutch, law: Law, until: float | None, events: list[EngagementEvent]
) -> tuple[list[TaylorStep], ClutchMode, float]:
    """The steps up to `until` or the end, the last mode, and the energy in J lost as damped flanks separate.

    The end is one period 2 pi sqrt(Ic/cp) after the first lock-up, with a gap not before the twist has
    reversed twice, and never while the clutch slips again. An engagement that does not get there ends at the
    time limit.
    """
    steps: list[TaylorStep] = []
    state, mode = ClutchState(), start_mode(clutch)
    last = _time_limit(clutch, law) if until is None else until
    earliest_end = math.inf  # until then at least, once it has locked
    lost, reversals, direction, simultaneous = 0.0, 0, 0.0, 0
    while state.t < last:
        if len(steps) >= MOST_STEPS:
            raise SimulationError(
                f"The engagement was aborted at {state.t:.6g} s after {MOST_STEPS} steps; set until, "
                "or reduce the stiffness."
            )
        stop = min(last, earliest_end) if state.t < earliest_end else last
        step = step_from(clutch, law, state, mode, stop)
        step, name = _first_event(clutch, step)
        if step.length > 0.0:
            steps.append(step)
            state, simultaneous = step.after(), 0
        if name:
            simultaneous += 1
            if simultaneous > MOST_SIMULTANEOUS:
                raise SimulationError(
                    f"The engagement was aborted: {MOST_SIMULTANEOUS} events at the instant {state.t:.6g} s."
                )
            # a damped flank separates while compressed; its energy leaves the balance here
            lost += mode.elastic_energy(clutch, state.theta)
            state, mode, event = next_mode(clutch, name, state, mode, float(step.M.sum()))
            lost -= mode.elastic_energy(clutch, state.theta)
            if event:
                events.append(EngagementEvent(state.t, event))
            if event == "locked" and earliest_end == math.inf:
                earliest_end = state.t + 2.0 * math.pi / clutch.locked_frequency
                reversals, direction = 0, 0.0
        v = state.wM - state.wc
        if abs(v) > AT_REST * clutch.drive_speed and v * direction <= 0.0:
            reversals, direction = reversals + (direction != 0.0), math.copysign(1.0, v)
        complete = clutch.gap == 0.0 or reversals >= REVERSALS
        # both peaks of the locked oscillation lie in the run
        if until is None and mode.locked and state.t >= earliest_end and complete:
            break
    return steps, mode, lost


def _first_event(clutch: Clutch, step: TaylorStep) -> tuple[TaylorStep, str]:
    """The step up to the first event within it, and the event function; the whole step without one."""
    name, share = "", math.inf
    jitter = ROUNDING * step.start / step.length
    for function, a in event_functions(clutch, step):
        u = first_crossing(a, jitter)
        if u is not None and u < share:
            name, share = function, u
    return (step.cut(share) if name else step), name


def _figures(
    clutch: Clutch,
    law: Law,
    steps: list[TaylorStep],
    events: list[EngagementEvent],
    mode: ClutchMode,
    lost: float,
) -> Engagement:
    """Peaks, work and energy of the steps."""
    drive, load, damping = 0.0, 0.0, lost
    works = [0.0 if step.mode.locked else _integral(step, step.F, _slip(clutch, step)) for step in steps]
    for step in steps:
        drive += clutch.drive_speed * _integral(step, step.F)
        load += step.R * _integral(step, step.wc)
        if clutch.damping > 0.0 and step.mode.presses:
            damping += clutch.damping * _integral(step, step.v, step.v)
    end = steps[-1].after()
    kinetic = 0.5 * (clutch.clutch_inertia * end.wM**2 + clutch.load_inertia * end.wc**2)
    elastic = mode.elastic_energy(clutch, end.theta)
    phases = []
    for locked, group in groupby(zip(steps, works, strict=True), lambda one: one[0].mode.locked):
        parts, done = zip(*group, strict=True)
        peak, when = _peak(parts)
        kind = "locked" if locked else "slip"
        phases.append(Phase(kind, parts[0].start, parts[-1].end, peak, when, sum(done)))
    slip_time = next((event.t for event in events if event.name == "locked"), math.nan)
    slipping = [phase for phase in phases if not phase.start >= slip_time]
    top, slip_top = (max(some, key=lambda phase: phase.peak_torque) for some in (phases, slipping))
    return Engagement(
        clutch=clutch, law=law, status="LOCKED" if mode.locked else "SLIPS",
        slip_time=slip_time, end_time=end.t,
        peak_torque=top.peak_torque, peak_time=top.peak_time,
        slip_peak_torque=slip_top.peak_torque, slip_peak_time=slip_top.peak_time,
        locked_peak_torque=max((p.peak_torque for p in phases if p.start >= slip_time), default=math.nan),
        friction_work=sum(works), slip_work=sum(phase.friction_work for phase in slipping),
        work_while_engaging=sum(
            work for step, work in zip(steps, works, strict=True) if step.start < law.engaged_at
        ),
        energy=EnergyBalance(drive, sum(works), damping, load, kinetic, elastic),
        phases=tuple(phases), events=tuple(events), steps=tuple(steps),
    )  # fmt: skip


def _slip(clutch: Clutch, step: TaylorStep) -> Vector:
    """w0 - wM."""
    return np.append(clutch.drive_speed - step.wM[0], -step.wM[1:])


def _integral(step: TaylorStep, a: Vector, b: Vector | None = None) -> float:
    """Integral over the step of one series, or of the product of two, every term of it."""
    product = a if b is None else np.convolve(a, b)
    return step.length * float((product / np.arange(1, product.size + 1)).sum())


def _peak(steps: Iterable[TaylorStep]) -> tuple[float, float]:
    """Largest |T| of the steps and its instant; of equal peaks the first."""
    top, when = 0.0, 0.0
    for step in steps:
        if np.abs(step.T).sum() <= top:  # a bound of |T| in the step
            continue
        # extrema: the ends, and the roots of T'
        u = np.concatenate([[0.0], roots(step.T[1:] * np.arange(1, step.T.size)), [1.0]])
        sizes = np.abs(values(step.T, u))
        if sizes.max() > top * SAME:
            top, when = float(sizes.max()), step.start + float(u[sizes.argmax()]) * step.length
    return top, when
