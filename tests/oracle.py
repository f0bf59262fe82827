"""An independent answer for one start of a drive with a gap: DOP853 between located events. For tests only.

Nothing here is shared with the plant under test. Between events the drive is integrated by scipy's DOP853.
Every event is a linear function of the state that rises through zero; it is bracketed by samples of the step,
found on the step's interpolant, and then polished with genuine Runge-Kutta steps, since the interpolant is of
lower order. After an event the integration restarts in the new mode.

Modes. Gap open: T = 0. On a flank (`side` +1 or -1, overlap z >= 0 on that side): "press" T = c z + d z',
"stiff" T = 2 c z (`modelica` while d z' > c z), "loose" T = 0 though z > 0 (`no-pull` and `modelica` while
c z + d z' <= 0). Load: `direction` 0 is stuck, else the sign of the speed that friction opposes; 1 if active.

Corners defined here:

- "closed" and "opened" are the instants at which a flank begins and ceases to act: "loose" counts as opened.
  A loose flank that passes back into the gap is no event.
- A start with overlap begins in contact without an event. A start exactly on a flank closes at t = 0 if it
  moves into it, or is pushed into it from rest. A load that is moved at once has "load-starts" at t = 0.
- A reactive load whose speed passes zero without resting gives "load-stops" and "load-starts" at one instant.
- `modelica` has the cut of ElastoBacklash, T = max(0, ...). Its special case of gap <= 1e-10 rad is left out.
- Before the first torque piece the demand is u0. With rate = inf and lag = 0, u jumps with the demand.
- Coulomb friction of the motor holds it at rest as long as |u - T| <= friction ("motor-stops" and
  "motor-starts"); b1 and b2 are viscous friction of motor and load.
- With `release` a brake holds the motor (w1 = 0, w1_0 must be 0) until that instant, or, for infinity, until
  u >= T for the first time ("released"; at t = 0 if it is so from the start).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq
from tests.oracle_cases import random_case
from tests.oracle_torque import TorquePath

__all__ = ["Contact", "Start", "integrate", "random_case"]

EVENT_CAP = 5000
FIRST_STEP = np.array([1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.6, 1.0])  # a new mode may be left again at once
LATER_STEPS = np.array([0.2, 0.4, 0.6, 0.8, 1.0])


@dataclass
class Contact:
    """One contact stage; `end` is None if the run ended in it, `peak` has the sign of T."""

    side: int
    start: float
    end: float | None = None
    peak: float = 0.0
    peak_time: float = 0.0


@dataclass
class Start:
    """What became of a start. `work`: motor, shaft (integral of T v) and load, J, if asked for."""

    peak: float
    peak_time: float
    events: list[tuple[float, str]]
    contacts: list[Contact]
    theta: float
    w1: float
    w2: float
    phi2: float
    u: float
    T: float
    work: tuple[float, float, float] | None


@dataclass(frozen=True)
class Drive:
    """Parameters in SI units."""

    J1: float
    J2: float
    c: float
    d: float
    gap: float
    Mc: float
    reactive: bool
    law: str
    friction: float = 0.0
    b1: float = 0.0
    b2: float = 0.0


@dataclass
class Mode:
    """What is latched between events."""

    side: int = 0
    form: str = "open"
    direction: int = 1
    held: bool = False
    rubs: int = 0  # sign of the motor speed that its friction opposes
    stuck: bool = False  # the motor is held by its friction


def integrate(
    *,
    J1: float,
    J2: float,
    c: float,
    d: float,
    gap: float,
    Mc: float,
    kind: str,
    law: str,
    theta0: float,
    w1_0: float,
    w2_0: float,
    torque_pieces: list[tuple[float, float]],
    lag: float,
    rate: float,
    u0: float,
    t_end: float,
    target: float | None = None,
    rtol: float = 1e-11,
    energy: bool = False,
    release: float = 0.0,
    friction: float = 0.0,
    b1: float = 0.0,
    b2: float = 0.0,
) -> Start:
    """Integrate one start from t = 0 to t_end; see the module for its modes and corners."""
    drive = Drive(J1, J2, c, d, gap, Mc, kind == "reactive", law, friction, b1, b2)
    path = TorquePath(torque_pieces, lag, rate, u0, t_end)
    return _Run(drive, path, (theta0, w1_0 - w2_0, w2_0), target, rtol, energy, release).go()


class _Run:
    """The state of one start on its way, and what has been noted of it."""

    def __init__(
        self,
        drive: Drive,
        path: TorquePath,
        start: tuple[float, float, float],
        target: float | None,
        rtol: float,
        energy: bool,
        release: float,
    ):
        self.drive, self.path, self.target, self.rtol, self.energy = drive, path, target, rtol, energy
        theta, v, w2 = start
        Omega = math.sqrt(self.drive.c / self.drive.J1 + self.drive.c / self.drive.J2)
        self.period = 2 * math.pi / Omega
        torque = max(abs(self.drive.Mc), 1e-300, *(max(abs(s[2]), abs(s[4])) for s in path.spans))
        speed = max(abs(v), Omega * torque / self.drive.c, abs(theta) * Omega)
        speed = max(speed, math.sqrt(self.drive.gap * torque * (1 / self.drive.J1 + 1 / self.drive.J2)))
        self.scale = np.array([speed / Omega, speed, speed])
        self.t, self.span = 0.0, path.spans[0]
        self.y = np.array([theta, v, w2, 0.0] + [0.0] * (3 if energy else 0))
        self.atol = (
            1e-3
            * rtol
            * np.array([speed / Omega, speed, speed, speed / Omega] + [torque * speed / Omega] * 3)
        )
        self.atol = self.atol[: len(self.y)]
        self.held_until = release
        self.mode = Mode(held=release > 0.0)
        self.stand_or_slide(v + w2)
        self.events: list[tuple[float, str]] = []
        self.contacts: list[Contact] = []
        self.peak, self.peak_time = 0.0, 0.0

    # ---- the drive in its present mode ----

    def stiffness(self) -> tuple[float, float]:
        """T = kq q + kv v; q is the twist from the flank in contact, or theta while the gap is open."""
        return {"press": (self.drive.c, self.drive.d), "stiff": (2 * self.drive.c, 0.0)}.get(
            self.mode.form, (0.0, 0.0)
        )

    def torque(self) -> float:
        kq, kv = self.stiffness()
        return float(kq * self.y[0] + kv * self.y[1])

    def rhs(self) -> Any:
        kq, kv = self.stiffness()
        J1, J2, energy = self.drive.J1, self.drive.J2, self.energy
        moves, friction = self.mode.direction != 0, self.mode.direction * self.drive.Mc
        path, span, held = self.path, self.span, self.mode.held or self.mode.stuck
        drag, b1, b2 = self.mode.rubs * self.drive.friction, self.drive.b1, self.drive.b2

        def derivative(t: float, y: np.ndarray) -> list[float]:
            q, v, w2, *_ = y.tolist()
            u, T = path.torque(t, span)[0], kq * q + kv * v
            a2 = (T - friction - b2 * w2) / J2 if moves else 0.0
            rates = [v, (0.0 if held else (u - drag - b1 * (v + w2) - T) / J1) - a2, a2, w2]
            return [*rates, u * (v + w2), T * v, friction * w2] if energy else rates

        return derivative

    def slope_functional(self) -> np.ndarray:
        """dT/dt as coefficients of (q, v, w2, u, 1)."""
        kq, kv = self.stiffness()
        motor = 0.0 if self.mode.held or self.mode.stuck else 1 / self.drive.J1
        load = 1 / self.drive.J2 if self.mode.direction else 0.0
        mobility = motor + load
        friction = self.mode.direction * self.drive.Mc / self.drive.J2
        friction -= motor * self.mode.rubs * self.drive.friction
        b1, b2 = self.drive.b1 * motor, self.drive.b2 * load
        by_v = kq - kv * kv * mobility - kv * b1
        return np.array([-kv * kq * mobility, by_v, kv * (b2 - b1), kv * motor, kv * friction])

    def event_functionals(self) -> tuple[list[str], np.ndarray]:
        """Names, and coefficients of (q, v, w2, u, 1): each fires when it rises through zero."""
        side, form, c, d = self.mode.side, self.mode.form, self.drive.c, self.drive.d
        table: dict[str, tuple[float, float, float, float, float]] = {}
        if form == "open":
            table["upper"] = (1, 0, 0, 0, -self.drive.gap / 2)
            table["lower"] = (-1, 0, 0, 0, -self.drive.gap / 2)
        elif form == "stiff":
            table["soften"] = (side * c, -side * d, 0, 0, 0)
        elif form == "loose":
            table["pass"] = (-side, 0, 0, 0, 0)
            table["rejoin"] = (side * c, side * d, 0, 0, 0)
        elif self.drive.law == "dead-zone" or d == 0:
            table["leave"] = (-side, 0, 0, 0, 0)
        else:
            table["drop"] = (-side * c, -side * d, 0, 0, 0)
            if self.drive.law == "modelica":
                table["stiffen"] = (-side * c, side * d, 0, 0, 0)
        if self.drive.reactive and self.mode.direction:
            table["stop"] = (0, 0, -self.mode.direction, 0, 0)
        elif self.drive.reactive:
            kq, kv = self.stiffness()
            table["break forward"] = (kq, kv, 0, 0, -self.drive.Mc)
            table["break backward"] = (-kq, -kv, 0, 0, -self.drive.Mc)
        if self.mode.held and math.isinf(self.held_until):
            kq, kv = self.stiffness()
            table["let go"] = (-kq, -kv, 0, 1, 0)
        if self.mode.stuck:
            kq, kv = self.stiffness()
            table["motor forward"] = (-kq, -kv, 0, 1, -self.drive.friction)
            table["motor backward"] = (kq, kv, 0, -1, -self.drive.friction)
        elif self.mode.rubs:
            table["motor stop"] = (0, -self.mode.rubs, -self.mode.rubs, 0, 0)
        if self.target is not None:
            table["target"] = (0, 0, 1, 0, -self.target)
        return list(table), np.array(list(table.values()), dtype=float)

    # ---- what happens at an instant ----

    def happened(self, kind: str) -> None:
        self.events.append((self.t, kind))
        if len(self.events) > EVENT_CAP:
            raise RuntimeError(f"more than {EVENT_CAP} events at t = {self.t}")

    def touch(self, side: int, *, overlap: bool = False) -> None:
        """Enter contact with a flank: at its surface, or at the start of the run with overlap."""
        self.y[0] = self.y[0] - side * self.drive.gap / 2 if overlap else 0.0
        spring, damper = side * self.drive.c * self.y[0], side * self.drive.d * self.y[1]
        self.mode.side, self.mode.form = side, "press"
        if self.drive.law == "modelica" and self.drive.d > 0 and (damper > spring or not overlap):
            self.mode.form = "stiff"
        if overlap and self.drive.law != "dead-zone" and spring + damper <= 0:
            self.mode.form = "loose"
            return
        self.contacts.append(Contact(side, self.t, peak_time=self.t))
        if not overlap:
            self.happened("closed")

    def part(self, form: str) -> None:
        self.contacts[-1].end = self.t
        self.mode.form = form
        self.happened("opened")
        if form == "open":
            self.release()

    def release(self) -> None:
        self.y[0] = self.mode.side * self.drive.gap / 2
        self.mode.side, self.mode.form = 0, "open"

    def begin_move(self, direction: int) -> None:
        self.mode.direction = direction
        self.happened("load-starts")

    def apply(self, name: str) -> None:
        if name in ("upper", "lower"):
            self.touch(1 if name == "upper" else -1)
        elif name in ("leave", "drop"):
            self.part("open" if name == "leave" else "loose")
        elif name == "pass":
            self.release()
        elif name == "rejoin":
            self.mode.form = "press"
            self.contacts.append(Contact(self.mode.side, self.t, peak_time=self.t))
            self.happened("closed")
        elif name in ("stiffen", "soften"):
            self.mode.form = "stiff" if name == "stiffen" else "press"
        elif name == "stop":
            self.y[2], self.mode.direction = 0.0, 0
            self.happened("load-stops")
        elif name == "let go":
            self.mode.held = False
            self.happened("released")
            self.stand_or_slide(0.0)
        elif name == "motor stop":
            self.y[1] = -self.y[2]
            self.happened("motor-stops")
            self.stand_or_slide(0.0)
        elif name.startswith("motor"):
            self.slide(1 if name.endswith("forward") else -1)
        elif name.startswith("break"):
            self.begin_move(1 if name.endswith("forward") else -1)
        else:
            self.target = None
            self.happened("target")

    def stand_or_slide(self, w1: float) -> None:
        """The friction of the motor opposes its speed, or holds it."""
        if self.drive.friction > 0.0 and not self.mode.held:
            self.mode.rubs, self.mode.stuck = int(np.sign(w1)), w1 == 0.0

    def slide(self, direction: int) -> None:
        self.mode.stuck, self.mode.rubs = False, direction
        self.happened("motor-starts")

    def settle(self) -> None:
        """Changes that follow at once from where the drive is: flank touched, stuck mass overcome."""
        self.release_if_due()
        if self.mode.form == "open":
            grows = bends = 0.0
            if not self.mode.held and not self.mode.stuck:
                grows = self.path.torque(self.t, self.span)[1]
                if self.path.lag > 0.0:  # a ramp behind a lag begins with u = u' = 0
                    bends = (self.span[3] - grows) / self.path.lag
            changes = (self.y[1], self.rhs()(self.t, self.y)[1], grows, bends)
            heading = next((x for x in changes if x != 0), 0.0)
            for side in (1, -1):
                if side * self.y[0] >= self.drive.gap / 2 and side * heading > 0:
                    self.touch(side)
                    break
        if self.mode.direction == 0 and abs(self.torque()) > self.drive.Mc:
            self.begin_move(1 if self.torque() > 0 else -1)
        self.release_if_due()
        pushed = self.path.torque(self.t, self.span)[0] - self.torque()
        if self.mode.stuck and abs(pushed) > self.drive.friction:
            self.slide(1 if pushed > 0 else -1)

    def release_if_due(self) -> None:
        """Torque proved, or the instant has come."""
        proved = math.isinf(self.held_until) and self.path.torque(self.t, self.span)[0] >= self.torque()
        if self.mode.held and (proved or self.t >= self.held_until):
            self.apply("let go")

    def note_torque(self) -> None:
        T = self.torque()
        if self.mode.form in ("press", "stiff") and abs(T) > abs(self.contacts[-1].peak):
            self.contacts[-1].peak, self.contacts[-1].peak_time = T, self.t
        if abs(T) > self.peak:
            self.peak, self.peak_time = abs(T), self.t

    # ---- time ----

    def begin(self) -> None:
        theta, w2 = float(self.y[0]), float(self.y[2])
        self.mode.direction = int(np.sign(w2)) if self.drive.reactive else 1
        if abs(theta) > self.drive.gap / 2:
            self.touch(1 if theta > 0 else -1, overlap=True)
        if self.target is not None and w2 >= self.target:
            self.apply("target")

    def go(self) -> Start:
        self.begin()
        for span in self.path.spans:
            self.span = span
            while span[1] - self.t > 1e-14 * span[1]:  # an event may fall on the border
                self.settle()
                self.note_torque()
                self.run_mode()
        u, y = float(self.path.torque(self.path.t_end, self.span)[0]), self.y.tolist()
        theta = y[0] + self.mode.side * self.drive.gap / 2
        work = (y[4], y[5], y[6]) if self.energy else None
        return Start(
            self.peak,
            self.peak_time,
            self.events,
            self.contacts,
            theta,
            y[1] + y[2],
            y[2],
            y[3],
            u,
            self.torque(),
            work,
        )

    def run_mode(self) -> None:
        """Go on in the present mode until an event changes it or the torque span ends."""
        rhs, end = self.rhs(), self.span[1]
        if self.mode.held:
            end = min(end, self.held_until)
        names, functionals = self.event_functionals()
        slope = self.slope_functional()
        size = np.abs(functionals[:, :3]) @ self.scale + np.abs(functionals[:, 4])
        before = self.values(functionals, np.array([self.t]), self.y[:, None])[:, 0]
        waiting = np.abs(before) <= 1e-13 * size  # just fired, or exactly on its border
        before[waiting] = 0.0
        h = min(1e-4 * self.period, end - self.t)
        solver = DOP853(
            rhs, self.t, self.y, end, max_step=self.period / 8, rtol=self.rtol, atol=self.atol, first_step=h
        )
        fractions, slope_before = FIRST_STEP, 0.0
        drift = self.drift(functionals, self.t, np.asarray(rhs(self.t, self.y)))
        while solver.status == "running":
            t_old, y_old = solver.t, solver.y
            message = solver.step()
            if solver.status == "failed":
                raise RuntimeError(f"DOP853 failed at t = {t_old}: {message}")
            dense = solver.dense_output()
            times = t_old + (solver.t - t_old) * fractions
            times[-1] = solver.t
            states = dense(times)
            values = self.values(functionals, times, states)
            step = _Step(rhs, t_old, y_old, dense, self)
            if fractions is FIRST_STEP:
                at_once = waiting & np.all(values >= 0, axis=1) & (values[:, -1] > 0)
                if np.any(at_once):
                    self.apply(names[int(np.argmax(at_once))])
                    return
            found = None
            history = np.column_stack([before, values])
            grid = np.concatenate([[t_old], times])
            rises = (history[:, :-1] < 0) & (history[:, 1:] >= 0)
            for i in np.flatnonzero(rises.any(axis=1)):
                k = int(np.argmax(rises[i]))
                instant = step.root(functionals[i], grid[k], grid[k + 1])
                if found is None or instant < found[0]:
                    found = (instant, names[i])
            # f may be above zero for a moment between two samples: then it has a maximum within the step
            drift_before, drift = drift, self.drift(functionals, solver.t, solver.f)
            tops = (drift_before > 0) & (drift < 0) & np.all(history < 0, axis=1)
            tops &= before + drift_before * (solver.t - t_old) >= 0
            for i in np.flatnonzero(tops):
                top = step.top(functionals[i], solver.t)
                if step.value(functionals[i], top, step.state(top)) >= 0:
                    instant = step.root(functionals[i], t_old, top)
                    if found is None or instant < found[0]:
                        found = (instant, names[i])
            if self.mode.form in ("press", "stiff"):
                slopes = self.values(slope[None, :], times, states)[0]
                bends = np.concatenate([[slope_before], slopes])
                for k in np.flatnonzero(bends[:-1] * bends[1:] < 0):
                    instant = step.root(slope, grid[k], grid[k + 1])
                    if found is None or instant < found[0]:
                        self.t, self.y = instant, step.state(instant)
                        self.note_torque()
                slope_before = slopes[-1]
            if found is not None:
                self.t, self.y = found[0], step.state(found[0])
                self.note_torque()
                self.apply(found[1])
                return
            before, fractions = values[:, -1], LATER_STEPS
        self.t, self.y = end, solver.y.copy()
        self.note_torque()

    def drift(self, functionals: np.ndarray, t: float, rates: np.ndarray) -> np.ndarray:
        """d/dt of the functionals, with the derivative of the state."""
        du = self.path.torque(t, self.span)[1]
        return np.asarray(functionals[:, :3] @ rates[:3] + functionals[:, 3] * du)

    def values(self, functionals: np.ndarray, times: np.ndarray, states: np.ndarray) -> np.ndarray:
        u = self.path.torque(times, self.span)[0] * np.ones_like(times)
        return functionals[:, :3] @ states[:3] + np.outer(functionals[:, 3], u) + functionals[:, 4:]


class _Step:
    """One accepted step, re-entered: states in it by a Runge-Kutta step of their own, and roots on them."""

    def __init__(self, rhs: Any, t: float, y: np.ndarray, dense: Any, run: _Run):
        self.rhs, self.t, self.y, self.dense, self.run = rhs, t, y, dense, run

    def state(self, t: float) -> np.ndarray:
        h = t - self.t
        stages = np.zeros((DOP853.n_stages, len(self.y)))
        for i in range(DOP853.n_stages):
            stages[i] = self.rhs(self.t + DOP853.C[i] * h, self.y + h * (DOP853.A[i, :i] @ stages[:i]))
        return self.y + h * (DOP853.B @ stages)

    def value(self, functional: np.ndarray, t: float, y: np.ndarray) -> float:
        u = self.run.path.torque(t, self.run.span)[0]
        return float(functional[:3] @ y[:3] + functional[3] * u + functional[4])

    def top(self, functional: np.ndarray, end: float) -> float:
        """Where the functional, rising at the start of the step and falling at its end, is largest."""

        def drift(t: float) -> float:
            rates = np.asarray(self.rhs(t, self.state(t)))
            return float(self.run.drift(functional[None, :], t, rates)[0])

        if not drift(self.t) > 0 > drift(end):  # but for rounding
            return end
        return float(brentq(drift, self.t, end, xtol=1e-300, rtol=4 * np.finfo(float).eps))

    def root(self, functional: np.ndarray, low: float, high: float) -> float:
        def interpolated(t: float) -> float:
            return self.value(functional, t, self.dense(t))

        at_low, at_high = interpolated(low), interpolated(high)
        if at_low * at_high < 0:
            t = brentq(interpolated, low, high, xtol=1e-300, rtol=4 * np.finfo(float).eps)
        else:
            t = low if abs(at_low) < abs(at_high) else high
        for _ in range(4):
            y = self.state(t)
            rates, (_, du) = np.asarray(self.rhs(t, y)), self.run.path.torque(t, self.run.span)
            gradient = float(functional[:3] @ rates[:3] + functional[3] * du)
            change = -self.value(functional, t, y) / gradient if gradient != 0 else 0.0
            if not abs(change) <= 1e-3 * (high - low):  # a grazing root: the interpolant's is as good
                break
            t += change
            if abs(change) <= 2e-16 * abs(t):
                break
        return t
