"""One engagement, from rest through slip, lock-up and slip again, with every event located.

A step ends at the end of a piece of the law, of the run, or where an event function reaches zero; which comes
first is found without missing any (`polynomials`). Of functions that are zero already where a step begins,
the sign is that of their first term that is more than rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from softstart.clutch.laws import Law
from softstart.clutch.model import Clutch
from softstart.clutch.modes import event_functions, follow, start_mode
from softstart.clutch.motion import LOCKED, POWERS, Mode, Motion, State, motion, step_of
from softstart.clutch.polynomials import first_root, leading
from softstart.errors import SimulationError

__all__ = ["Event", "History", "history"]

MOST_STEPS = 400_000
MOST_AT_ONCE = 40
TURNS = 2  # of the twist behind the lock-up: both peaks of a cycle are seen
STILL = 1e-9
ROUNDING = 2e-15  # of the time: how well an event is placed


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
    lost_at_release: float = 0.0  # J left in a damped flank when it comes off, lost in its own damper
    locked_at: float = math.nan  # first lock-up, s
    mode: Mode = field(default_factory=lambda: Mode(1, 1, None))  # at the end


def history(clutch: Clutch, law: Law, until: float | None, time_limit: float) -> History:
    """The engagement up to `until`, or else until its end.

    The end is one period 2 pi sqrt(Ic/cp) after the first lock-up, with a gap not before the twist has turned
    twice, and in no case while the clutch slips again. An engagement that never comes to that is cut at
    `time_limit`.
    """
    found = History()
    state, mode = State(), start_mode(clutch)
    period = 2.0 * math.pi / clutch.locked_frequency
    last = until if until is not None else time_limit
    watched, turns, way, at_once = math.inf, 0, 0.0, 0
    while state.t < last:
        if len(found.steps) >= MOST_STEPS:
            raise SimulationError(
                f"The engagement was given up at {state.t:.6g} s: {MOST_STEPS} steps were not enough; end it "
                f"sooner "
                "with until, or make the shaft less stiff."
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
            state, mode, told = follow(clutch, event, state, mode, M)
            if told:
                found.events.append(Event(state.t, told))
            if mode.slip == LOCKED and math.isnan(found.locked_at):
                found.locked_at, watched, turns, way = state.t, state.t + period, 0, 0.0
        if abs(state.v) > STILL * clutch.drive_speed and state.v * way <= 0.0:
            turns, way = turns + (way != 0.0), math.copysign(1.0, state.v)
        seen = clutch.gap == 0.0 or turns >= TURNS
        if until is None and mode.slip == LOCKED and state.t >= watched and seen:
            break
    found.mode = mode
    return found


def _left(clutch: Clutch, event: str, state: State, mode: Mode) -> float:
    """Energy in J that a damped flank still holds where it comes off; back in contact, less by that."""
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
    name, at = "", 1.0
    jitter = ROUNDING * state.t / h
    for one, a in event_functions(clutch, step):
        scaled = a * powers
        first = leading(scaled, jitter)
        if first == scaled.size:
            continue
        if scaled[first] > 0.0:
            return step.shorter(0.0), one
        root = first_root(scaled, jitter)
        if root is not None and root < at:
            name, at = one, root
    if name:
        return step.shorter(h * at), name
    return step, ""
