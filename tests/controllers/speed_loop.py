"""A speed ramp on two masses, independently: plain Python for its law, matrix exponentials for the drive.

Nothing is shared with the kernel and the compiled step. In each mode (gap open; flank pressed; flanks that
overlap without torque; load at rest or moving) the drive is linear, so the state after any time is a matrix
exponential. Events, passages and maxima are bracketed by eight points in each sample, and located on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from softstart import Drive

Vector = np.ndarray[Any, Any]
TWIST, MOTOR, LOAD, ANGLE, TORQUE, DEMAND, ONE = range(7)
PARTS = 8


def root(row: Vector, A: Vector, y: Vector, low: float, high: float) -> float:
    """Where the row of the state is zero; an end where rounding has changed the sign."""

    def value(x: float) -> float:
        return float(row @ expm(A * x) @ y)

    if value(low) * value(high) >= 0.0:
        return low if abs(value(low)) < abs(value(high)) else high
    return float(brentq(value, low, high, xtol=1e-18, rtol=1e-15))


@dataclass
class Law:
    """The law as it is documented, with all parameters in SI."""

    drive: Drive
    ramp_time: float
    rounding: float
    kp: float
    tn: float
    filter_time: float
    feed_forward: float
    torque_limit: float
    preload: float
    period: float
    commands: Callable[[float], tuple[float, float]]  # run, set speed
    k: int = -1
    w: float = 0.0
    total: float = 0.0
    command: tuple[float, float] | None = None
    ramp: tuple[float, float, float] = (0.0, 0.0, 0.0)  # begin, from, to
    wait: float = 0.0

    def torque(self, measured: float) -> float:
        """The demand at the next sample."""
        drive, T = self.drive, self.period
        self.k += 1
        t = self.k * T
        decay = math.exp(-T / self.filter_time) if self.filter_time else 0.0
        self.w = measured if self.k == 0 else decay * self.w + (1.0 - decay) * measured
        run, speed = self.commands(t)
        to = speed if run else 0.0
        if (run, speed) != self.command:
            if run and (self.command is None or not self.command[0]) and self.preload:
                a = (self.preload - drive.motor_friction) / drive.J1
                wait = math.sqrt(2.0 * drive.gap / a) + drive.torque_lag + drive.computing_delay
                self.wait = t + math.ceil(wait / T) * T
            self.command, self.ramp = (run, speed), (t, self.w, to)
        if t < self.wait - 0.5 * T:
            return math.copysign(self.preload, to)
        if self.wait:
            self.ramp, self.total, self.wait = (t, self.w, to), math.copysign(self.preload, to), 0.0
        begin, low, high = self.ramp
        whole = self.ramp_time * abs(high - low) / drive.target_speed
        n, a = high, 0.0
        if t - begin < whole * (1.0 - 1e-12):
            n, a = self.reference((t - begin) / whole)
            n, a = low + (high - low) * n, (high - low) / whole * a
        e = n - self.w
        v = self.kp * e + self.total + self.feed_forward * (drive.J1 + drive.J2) * a
        least, most = (
            max(drive.minimum_torque, -self.torque_limit),
            min(drive.maximum_torque, self.torque_limit),
        )
        u = sorted((least, v, most))[1]
        if not (u != v and (v - u) * e > 0.0):
            self.total += self.kp / self.tn * T * e
        return u

    def reference(self, x: float) -> tuple[float, float]:
        """Share and rate: the integral of a trapezoid whose flanks take `rounding` each."""
        r = self.rounding
        top = 1.0 / (1.0 - r)
        if x < r:
            return 0.5 * top / r * x * x, top / r * x
        if x > 1.0 - r:
            return 1.0 - 0.5 * top / r * (1.0 - x) ** 2, top / r * (1.0 - x)
        return top * (x - 0.5 * r), top


@dataclass
class Found:
    """What became of a start."""

    peak: float = 0.0
    highest: float = -math.inf
    contacts: int = 0
    passages: list[tuple[float, float]] = field(default_factory=list)  # time, level
    times: list[float] = field(default_factory=list)  # of the samples, with speeds of motor and load
    speeds: list[tuple[float, float]] = field(default_factory=list)


class Loop:
    """One start, from a gap that is open or a shaft without one."""

    def __init__(self, drive: Drive, law: Law, levels: tuple[float, ...]):
        self.d, self.law, self.levels, self.found = drive, law, levels, Found()
        self.half = 0.5 * drive.gap
        self.form, self.side = ("joined", 0.0) if drive.gap == 0.0 else ("open", 0.0)
        friction = drive.load_kind == "reactive"
        self.friction = drive.Mc if friction else 0.0
        self.pull = 0.0 if friction else drive.Mc
        self.way = 0.0 if friction else 1.0
        self.y = np.array([drive.theta0, 0.0, 0.0, drive.theta0, 0.0, 0.0, 1.0])  # the load begins at angle 0
        self.powers = cache(self._powers)

    def shaft(self, form: str, side: float) -> Vector:
        """The row of the shaft torque, as far as spring and damper act."""
        row = np.zeros(7)
        if form in ("press", "loose", "joined"):
            row[[TWIST, MOTOR, LOAD, ONE]] = self.d.c, self.d.d, -self.d.d, -self.d.c * side * self.half
        return row

    def matrix(self, form: str, side: float, way: float) -> Vector:
        d, T = self.d, self.shaft(form if form != "loose" else "open", side)
        A = np.zeros((7, 7))
        A[TWIST, [MOTOR, LOAD]] = 1.0, -1.0
        A[ANGLE, MOTOR] = 1.0
        A[MOTOR] = -T / d.J1
        A[MOTOR, TORQUE] += 1.0 / d.J1
        if way:
            A[LOAD] = T / d.J2
            A[LOAD, ONE] -= (self.pull + way * self.friction) / d.J2
        if d.torque_lag:
            A[TORQUE, [TORQUE, DEMAND]] = -1.0 / d.torque_lag, 1.0 / d.torque_lag
        return A

    def _powers(self, form: str, side: float, way: float, h: float) -> tuple[Vector, Vector]:
        A = self.matrix(form, side, way)
        return A, np.array([expm(A * (h * k / PARTS)) for k in range(PARTS + 1)])

    def exits(self) -> tuple[list[str], Vector]:
        """Rows that rise through zero where the mode ends."""
        y = np.eye(7)
        spring = self.shaft(self.form, self.side)
        overlap = self.side * y[TWIST] - self.half * y[ONE]
        rows: dict[str, Vector] = {}
        if self.form == "open":
            rows = {"upper": y[TWIST] - self.half * y[ONE], "lower": -y[TWIST] - self.half * y[ONE]}
        elif self.form == "press":
            rows = {"let": -self.side * spring}
        elif self.form == "loose":
            rows = {"open": -overlap, "again": self.side * spring}
        if self.friction and self.way:
            rows["stop"] = -self.way * y[LOAD]
        elif self.friction:
            T = spring if self.form in ("press", "joined") else np.zeros(7)
            rows |= {"forward": T - self.friction * y[ONE], "back": -T - self.friction * y[ONE]}
        return list(rows), np.array(list(rows.values())).reshape(-1, 7)

    def leave(self, name: str) -> None:
        if name in ("upper", "lower"):
            self.form, self.side = "press", 1.0 if name == "upper" else -1.0
            self.y[TWIST] = self.side * self.half
            self.found.contacts += 1
        elif name == "let":
            over = self.side * self.y[TWIST] - self.half
            self.form = "loose" if self.d.d and over > 0.0 else "open"
        elif name == "open":
            self.form = "open"
        elif name == "again":
            self.form = "press"
            self.found.contacts += 1
        elif name == "stop":
            self.y[LOAD], self.way = 0.0, 0.0
        else:
            self.way = 1.0 if name == "forward" else -1.0
        if self.friction and not self.way and self.form in ("press", "joined"):
            T = self.shaft(self.form, self.side) @ self.y
            self.way = math.copysign(1.0, T) if abs(T) > self.friction * (1.0 + 1e-12) else 0.0

    def hold(self, t: float, h: float, row: Vector, largest: Callable[[float], None]) -> None:
        """The values of a row at the eight points, and at its extremes between them."""
        A, P = self.powers(self.form, self.side, self.way, h)
        Y = P @ self.y
        slopes = Y @ (row @ A)
        for k in np.flatnonzero(slopes[:-1] * slopes[1:] < 0.0):
            at = root(row @ A, A, self.y, h * k / PARTS, h * (k + 1) / PARTS)
            largest(row @ expm(A * at) @ self.y)
        largest(Y[0] @ row)
        largest(Y[-1] @ row)

    def go(self, t: float, end: float) -> float:
        """To the end, or to the end of the mode; returns the instant."""
        h = end - t
        A, P = self.powers(self.form, self.side, self.way, h)
        Y = P @ self.y
        names, rows = self.exits()
        values = Y @ rows.T
        first, name = math.inf, ""
        for i, one in enumerate(names):
            for k in range(PARTS):
                if values[k, i] < 0.0 <= values[k + 1, i]:
                    low, high = h * k / PARTS, h * (k + 1) / PARTS
                    at = root(rows[i], A, self.y, low, high)
                    if at < first:
                        first, name = at, one
                    break
        length = min(first, h)
        self.watch(t, length)
        self.y = P[-1] @ self.y if length == h else expm(A * length) @ self.y
        if name:
            self.leave(name)
        return end if length == h else t + length

    def watch(self, t: float, length: float) -> None:
        """Note maxima and passages."""
        A, P = self.powers(self.form, self.side, self.way, length)
        found = self.found
        speed = np.eye(7)[LOAD]
        self.hold(t, length, speed, lambda w: setattr(found, "highest", max(found.highest, w)))
        if self.form in ("press", "joined"):
            row = self.shaft(self.form, self.side)
            self.hold(t, length, row, lambda T: setattr(found, "peak", max(found.peak, abs(T))))
        w = (P @ self.y)[:, LOAD]
        for level in self.levels:
            for k in np.flatnonzero((w[:-1] - level) * (w[1:] - level) < 0.0):
                low, high = length * k / PARTS, length * (k + 1) / PARTS
                at = root(speed - level * np.eye(7)[ONE], A, self.y, low, high)
                found.passages.append((t + at, level))

    def run(self, until: float) -> Found:
        """The whole start."""
        d, T = self.d, self.law.period
        q = 2.0 * math.pi / (4.0 * d.encoder_lines) if d.encoder_lines else 0.0
        edge, counted, k = 0.5 + d.encoder_phase, 0, 0
        due: list[tuple[float, float]] = []
        t = 0.0
        while t < until:
            w = self.y[MOTOR]
            self.found.times.append(t)
            self.found.speeds.append((w, self.y[LOAD]))
            if q:
                count = math.floor(self.y[ANGLE] / q + edge) - math.floor(edge)
                w, counted = ((count - counted) * q / T if k else w), count
            due.append((t + d.computing_delay, self.law.torque(float(w))))
            k += 1
            end = min(k * T, until)
            while t < end:
                while due and due[0][0] <= t + 1e-12 * T:
                    self.y[DEMAND] = due.pop(0)[1]
                    if not d.torque_lag:
                        self.y[TORQUE] = self.y[DEMAND]
                t = self.go(t, min(end, due[0][0]) if due else end)
        return self.found


def of_run(run: Any, commands: Any = None, until: float | None = None) -> Found:
    """The start of a simulated run, independently."""
    drive, target = run.drive, float(run.drive.target_speed)
    law = Law(drive, **run.controller.parameters, commands=commands or (lambda t: (1.0, target)))
    return Loop(drive, law, (target, 0.98 * target, 1.02 * target)).run(until or run.end_time)
