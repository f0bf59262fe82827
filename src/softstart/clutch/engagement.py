"""One engagement of a clutch: from rest through slip, lock-up and slip again, its figures and its energy.

A step ends at the end of a piece of the law, at the end of the run, or where an event function reaches zero;
the first of these is found without missing any (`polynomials`). Where several event functions are zero at the
beginning of a step already, the sign is that of their first term that is more than rounding. Peaks are at the
roots of T', work comes from the products of the series: no output grid.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.clutch.laws import Law
from softstart.clutch.model import Clutch
from softstart.clutch.motion import (
    LOCKED,
    POWERS,
    Mode,
    Motion,
    State,
    event_functions,
    follow,
    motion,
    start_mode,
    step_of,
)
from softstart.clutch.polynomials import definite, definite_integral, first_root, leading, roots, value
from softstart.errors import InputError, SimulationError
from softstart.quantities import to_si

MOST_STEPS = 400_000
MOST_AT_ONCE = 40
REVERSALS = 2  # of the twist after the lock-up, so that the run holds both peaks of a cycle
STILL = 1e-9
ROUNDING = 2e-15  # of the time: accuracy of an event's instant
SAME = 1.0 + 1e-13  # ratio of peaks that count as equal
MANY = 500  # steps, each shorter than two radians of the fastest oscillation
PATIENCE = 20.0  # times the slip time on a rigid shaft, until an engagement is given up


@dataclass(frozen=True)
class Event:
    """What happened at the instant t (s)."""

    t: float
    name: str


@dataclass
class History:
    """All steps of an engagement and what happened between them."""

    steps: list[Motion] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    lost_at_release: float = 0.0  # J left in a damped flank when it separates, lost in its own damper
    locked_at: float = math.nan  # first lock-up, s
    mode: Mode = field(default_factory=lambda: Mode(1, 1, None))  # at the end


def history(clutch: Clutch, law: Law, until: float | None, time_limit: float) -> History:
    """The engagement up to `until`, or else until its end.

    The end is one period 2 pi sqrt(Ic/cp) after the first lock-up, with a gap not before the twist has
    reversed twice, and never while the clutch slips again. An engagement that does not get there ends at
    `time_limit`.
    """
    found = History()
    state, mode = State(), start_mode(clutch)
    period = 2.0 * math.pi / clutch.locked_frequency
    last = until if until is not None else time_limit
    watched, reversals, direction, at_once = math.inf, 0, 0.0, 0
    while state.t < last:
        if len(found.steps) >= MOST_STEPS:
            raise SimulationError(
                f"The engagement was given up at {state.t:.6g} s: {MOST_STEPS} steps were not enough; end it "
                "sooner with until, or make the shaft less stiff."
            )
        step, event = _next(clutch, law, state, mode, min(last, watched) if state.t < watched else last)
        M = step.M[0] if step.h == 0.0 else float(step.M @ step.h**POWERS)
        if step.h > 0.0:
            found.steps.append(step)
            at_once = 0
        state = step.after()
        if event:
            at_once += 1
            if at_once > MOST_AT_ONCE:
                raise SimulationError(
                    f"The engagement was given up at {state.t:.6g} s: {MOST_AT_ONCE} changes at one instant."
                )
            found.lost_at_release += _left(clutch, event, state, mode)
            state, mode, name = follow(clutch, event, state, mode, M)
            if name:
                found.events.append(Event(state.t, name))
            if mode.slip == LOCKED and math.isnan(found.locked_at):
                found.locked_at, watched = state.t, state.t + period
                reversals, direction = 0, 0.0
        if abs(state.v) > STILL * clutch.drive_speed and state.v * direction <= 0.0:
            reversals, direction = reversals + (direction != 0.0), math.copysign(1.0, state.v)
        complete = clutch.gap == 0.0 or reversals >= REVERSALS
        if until is None and mode.slip == LOCKED and state.t >= watched and complete:
            break
    found.mode = mode
    return found


def _left(clutch: Clutch, event: str, state: State, mode: Mode) -> float:
    """Energy in J that a damped flank still holds where it separates; negative back in contact."""
    if event not in ("open", "pressed") or clutch.damping == 0.0:
        return 0.0
    side = mode.side if event == "open" else mode.pressed
    inside = side * state.theta - 0.5 * clutch.gap
    energy = 0.5 * clutch.stiffness * inside**2
    return energy if event == "open" else -energy


def _next(clutch: Clutch, law: Law, state: State, mode: Mode, last: float) -> tuple[Motion, str]:
    """The step from here to whatever comes first, and the event function that ends it, if one does."""
    index = law.index(state.t)
    piece = law.pieces[index]
    end = law.starts[index + 1] if index + 1 < len(law.pieces) else math.inf
    end = min(end, last)
    h = end - state.t
    longest = step_of(clutch, mode, piece)
    whole = h <= longest
    if not whole:
        h /= math.ceil(h / longest)
    if not math.isfinite(h):
        raise SimulationError("The engagement never ends; give until.")
    step = motion(clutch, state, mode, piece, h, end if whole else state.t + h)
    powers = h**POWERS
    name, share = "", 1.0
    jitter = ROUNDING * state.t / h
    for one, a in event_functions(clutch, step):
        scaled = a * powers
        first = leading(scaled, jitter)
        if first == scaled.size:
            continue
        if scaled[first] > 0.0:
            return step.shorter(0.0), one
        root = first_root(scaled, jitter)
        if root is not None and root < share:
            name, share = one, root
    if name:
        return step.shorter(h * share), name
    return step, ""


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


@dataclass(frozen=True, eq=False)
class Engagement:
    """One engagement, as `engage` returns it: torques in N m, times in s, work in J.

    Parameters
    ----------
    clutch : Clutch
        The clutch.
    law : Law
        Its engagement law.
    status : str
        "LOCKED", or "SLIPS" if the clutch slips at the end.
    slip_time : float
        tau1, the first instant at which the clutch side turns at w0 and is held there, s.
    end_time : float
        End of the run, s.
    peak_torque, peak_time : float
        Largest |T| of all, N m, and its instant, s.
    slip_peak_torque, slip_peak_time : float
        Largest |T| up to tau1, [C] (2), and its instant.
    locked_peak_torque : float
        Largest |T| after tau1, N m.
    friction_work : float
        Work of all slip, before and after tau1, J.
    slip_work : float
        Work of the slip up to tau1, J, [C] (3).
    work_while_engaging : float
        Work of the slip before the torque of the law is held, J.
    energy : EnergyBalance
        Where the work of the driving side went.
    phases : tuple of Phase
        Spans of slip and of lock.
    events : tuple of Event
        All changes of mode.
    steps : tuple of Motion
        The Taylor series of all steps.

    References
    ----------
    [C], the paper on friction clutches; see docs/paper-c.md.

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
        """M, F, T (N m), theta (rad), v, wM, wc (rad/s) and slip = w0 - wM at the instants (s).

        M is the friction torque that the clutch can transmit, F the torque that it transmits. The values
        come from the series.
        """
        when = np.atleast_1d(np.asarray(times, dtype=np.float64)).ravel()
        names = ("M", "F", "T", "theta", "v", "wM", "wc")
        out = {name: np.empty(when.size) for name in names}
        starts = [step.state.t for step in self.steps]
        for i, t in enumerate(when.tolist()):
            step = self.steps[max(bisect_right(starts, t) - 1, 0)]
            powers = min(max(t - step.state.t, 0.0), step.h) ** POWERS
            for name in names:
                out[name][i] = getattr(step, name) @ powers
        out["slip"] = self.clutch.drive_speed - out["wM"]
        return out

    @cached_property
    def t(self) -> Vector:
        """Instants in s for plots: 24 in each step, 8 where there are many steps."""
        count = 24 if len(self.steps) < MANY else 8
        shares = np.arange(count) / count
        inner = [step.state.t + step.h * shares for step in self.steps]
        return np.concatenate([*inner, [self.end_time]])

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
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
            "energy": {**asdict(self.energy), "residual": self.energy.residual},
            "phases": [asdict(phase) for phase in self.phases],
            "events": [{"time": event.t, "event": event.name} for event in self.events],
        }

    def plot(self) -> Any:
        """Torques, speeds and friction power over time."""
        from softstart.views import clutches as views

        return views.engagement_figure([self], self.clutch.name)


def figures_of(clutch: Clutch, law: Law, found: History) -> Engagement:
    """The figures of a history."""
    totals = _Totals(clutch, law.engaged_at)
    for step in found.steps:
        totals.add(step)
    last = found.steps[-1].after()
    elastic = 0.0
    mode = found.mode
    flank = mode.side or mode.pressed
    if flank:
        elastic = 0.5 * clutch.stiffness * (last.theta - 0.5 * flank * clutch.gap) ** 2
    if mode.side == 0:
        elastic = 0.0  # compressed without torque: counted as lost at the release
    kinetic = 0.5 * (clutch.clutch_inertia * last.wM**2 + clutch.load_inertia * last.wc**2)
    energy = EnergyBalance(
        totals.drive, totals.friction, totals.damping + found.lost_at_release, totals.load, kinetic, elastic
    )
    phases = tuple(totals.phases)
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
        friction_work=totals.friction, slip_work=sum(p.friction_work for p in slipping),
        work_while_engaging=totals.engaging,
        energy=energy, phases=phases, events=tuple(found.events), steps=tuple(found.steps),
    )  # fmt: skip


class _Totals:
    """Adds up work and keeps peaks, step by step."""

    def __init__(self, clutch: Clutch, engaged_at: float) -> None:
        self.clutch = clutch
        self.engaged_at = engaged_at
        self.drive = self.friction = self.damping = self.load = self.engaging = 0.0
        self.phases: list[Phase] = []

    def add(self, step: Motion) -> None:
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


def engage(clutch: Clutch, *, until: float | str | None = None) -> Engagement:
    """Engage the clutch from rest, the shaft in the middle of its gap.

    Times of events, peaks and work are exact to about 1e-12 of their size: Taylor series of the 24th order,
    located roots, no output grid.

    Parameters
    ----------
    clutch : Clutch
        The clutch, with its engagement law.
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
    [C] (1)-(5); see docs/paper-c.md.

    Examples
    --------
    >>> run = engage(Clutch.load("paper-c"))
    >>> run.status, round(run.slip_time, 4), round(run.peak_ratio, 4), run.energy.residual < 1e-12
    ('LOCKED', 4.1527, 1.2123, True)
    """
    end: float | None = None
    if until is not None:
        end = float(to_si(until, "s", name="until"))
        if not end > 0.0:
            raise InputError(f"until = {until!r}: the end of the run is a time above 0 s.")
    law = clutch.friction
    periods = 2.0 * math.pi / clutch.locked_frequency + 2.0 * math.pi / clutch.B
    limit = PATIENCE * (max(clutch.rigid_slip_time, law.engaged_at) + periods)
    return figures_of(clutch, law, history(clutch, law, end, limit))
