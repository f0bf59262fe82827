"""An independent answer for one start of a chain: DOP853 between located events. For tests only.

Nothing here is shared with the kernel under test. Every event is a function of time and state that rises
through zero; it is bracketed by samples of the step's interpolant and then located on genuine Runge-Kutta
steps of their own. After an event the integration restarts in the new mode.

Modes of a shaft: "open"; "press" T = c z + d z' on a flank; "stiff" T = 2 c z (`modelica` while d z' > c z);
"loose" T = 0 though the flanks overlap; "joined", a spring without a gap. A rigid gap is "open" and strikes.
Directions of a mass: 0 stuck, else the sign of the speed that friction opposes; 1 if the load is active.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq
from tests.oracle_torque import TorquePath

FIRST_STEP = np.array([1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.6, 1.0])  # a new mode may be left again at once
LATER_STEPS = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
EVENT_CAP = 500


@dataclass
class Given:
    """A chain at its motor shaft, in SI; `tones` are (mass, frequency, cosine, sine) of exciting torques."""

    J: np.ndarray
    Mc: np.ndarray
    reactive: np.ndarray
    w0: np.ndarray
    c: np.ndarray
    d: np.ndarray
    gap: np.ndarray
    law: list[str]
    theta0: np.ndarray
    ground: np.ndarray
    tones: list[tuple[int, float, float, float]]
    restitution: np.ndarray  # NaN where elastic
    motor: int
    load: int = -1
    efficiency: Any = 1.0
    gear: Any = -1  # the mass at which the gear of each shaft sits
    # of some masses points and torques of a load curve, and whether it is by angle, 0 where the load begins
    curves: dict[int, tuple[np.ndarray, np.ndarray, bool]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.efficiency, self.gear = np.broadcast_arrays(self.efficiency, self.gear, self.c)[:2]


class ChainOracle:
    """One start on its way; afterwards `t`, `theta`, `w`, `T`, `peaks` and `events` (time, kind, place)."""

    def __init__(self, given: Given, path: TorquePath, target: float = math.inf, rtol: float = 1e-12):
        self.g, self.path, self.target, self.rtol = given, path, target, rtol
        self.n = given.J.size
        self.t, self.leaps = 0.0, 0
        self.y = np.concatenate([given.theta0, given.w0, [0.0]]).astype(float)  # and the load's angle
        self.side = np.zeros(self.n - 1)
        self.form = ["joined" if gap == 0 else "open" for gap in given.gap]
        self.rigid, self.eta = ~np.isnan(given.restitution), given.efficiency
        self.rubs = given.reactive.copy()
        self.rubs[given.gear[self.eta < 1]] = True
        self.direction = np.where(self.rubs, np.sign(given.w0), 1.0)
        self.sign = np.ones(self.n - 1)  # of the torques of shafts with lossy gears
        self.events: list[tuple[float, str, int]] = []
        self.peaks = np.zeros(self.n - 1)
        elastic = np.where(self.rigid, 0.0, given.c)
        rate = np.sqrt(2 * np.max((np.append(elastic, 0) + np.append(0, elastic)) / given.J))
        rate = max([rate, *(tone[1] for tone in given.tones)])
        self.period = 2 * math.pi / rate if rate > 0 else path.t_end
        twist = max(np.abs(given.gap).max(), np.abs(given.theta0).max(), 1e-6)
        speed = max(twist * rate, 1e-6)
        self.size = np.concatenate([np.full(self.n - 1, twist), np.full(self.n, speed), [twist]])
        for k in range(self.n - 1):
            if self.form[k] == "open" and abs(self.y[k]) > 0.5 * given.gap[k]:
                self.touch(k, math.copysign(1.0, self.y[k]), overlap=True)
        self.sign[self.torques(self.y) < 0] = -1.0

    # ---- mechanics ----

    def overlap(self, y: np.ndarray) -> np.ndarray:
        return self.side * y[: self.n - 1] - 0.5 * self.g.gap

    def torques(self, y: np.ndarray) -> np.ndarray:
        theta, w = y[: self.n - 1], y[self.n - 1 : 2 * self.n - 1]
        v = w[:-1] - w[1:]
        T = np.zeros(self.n - 1)
        for k, form in enumerate(self.form):
            z = theta[k] - self.side[k] * 0.5 * self.g.gap[k]
            if form in ("press", "joined"):
                T[k] = self.g.c[k] * z + self.g.d[k] * v[k]
            elif form == "stiff":
                T[k] = 2 * self.g.c[k] * z
        return T

    def pushed(self, t: float, y: np.ndarray) -> np.ndarray:
        """The torque on each mass without friction of a reactive load or of gears."""
        T = self.torques(y)
        q = np.append(0.0, T) - np.append(T, 0.0) - self.g.ground * y[self.n - 1 : 2 * self.n - 1]
        q[self.g.motor] += self.path.torque(t, self.span)[0]
        for i, omega, cosine, sine in self.g.tones:
            q[i] += cosine * math.cos(omega * t) + sine * math.sin(omega * t)
        for i, (points, torques, _) in self.g.curves.items():
            q[i] -= np.interp(self.along(y, i), points, torques)
        return q - np.where(self.rubs & ~self.g.reactive, self.g.Mc, 0.0)

    def along(self, y: np.ndarray, i: int) -> float:
        """The speed or the angle of mass i, on which its load curve depends."""
        if not self.g.curves[i][2]:
            return float(y[self.n - 1 + i])
        load = self.g.load % self.n
        return float(y[-1] + (y[i:load].sum() if i < load else -y[load:i].sum()))

    def rubbing(self, y: np.ndarray, i: int, direction: float) -> float:
        """The friction on mass i if it moves in this direction; the load torque where nothing rubs."""
        R = float(self.g.Mc[i]) if self.g.reactive[i] or not self.rubs[i] else 0.0
        T = self.torques(y)
        for k in (i - 1, i):
            if 0 <= k < self.n - 1 and self.eta[k] < 1 and self.g.gear[k] == i:
                on_mass = T[k] if k < i else -T[k]
                drives = direction * self.sign[k] * (1 if k < i else -1) > 0
                passed = self.eta[k] * on_mass if drives else on_mass / self.eta[k]
                R += direction * (on_mass - passed)
        return R

    def rhs(self, t: float, y: np.ndarray) -> np.ndarray:
        w = y[self.n - 1 : 2 * self.n - 1]
        a = self.pushed(t, y) / self.g.J
        for i in np.flatnonzero(self.rubs | (self.g.Mc != 0)):
            a[i] -= self.direction[i] * self.rubbing(y, int(i), self.direction[i]) / self.g.J[i]
        a[self.direction == 0] = 0.0
        return np.concatenate([w[:-1] - w[1:], a, [w[self.g.load]]])

    # ---- events: functions that rise through zero ----

    def functions(self) -> list[tuple[str, int, Callable[[float, np.ndarray], float]]]:
        g, n = self.g, self.n
        found: list[tuple[str, int, Callable[[float, np.ndarray], float]]] = []

        def add(name: str, place: int, function: Callable[[float, np.ndarray], float]) -> None:
            found.append((name, place, function))

        for k in range(n - 1):
            half, s, c, d, law = 0.5 * g.gap[k], self.side[k], g.c[k], g.d[k], g.law[k]
            spring = lambda y, k=k, s=s, c=c, half=half: c * (s * y[k] - half)  # noqa: E731
            damper = lambda y, k=k, s=s, d=d: d * s * (y[n - 1 + k] - y[n + k])  # noqa: E731
            if self.form[k] == "open":
                add("upper", k, lambda t, y, k=k, half=half: y[k] - half)
                add("lower", k, lambda t, y, k=k, half=half: -y[k] - half)
            elif self.form[k] == "press":
                if law == "dead-zone" or d == 0:
                    add("leave", k, lambda t, y, spring=spring: -spring(y))
                else:
                    add("drop", k, lambda t, y, a=spring, b=damper: -a(y) - b(y))
                if law == "modelica" and d > 0:
                    add("stiffen", k, lambda t, y, a=spring, b=damper: b(y) - a(y))
            elif self.form[k] == "stiff":
                add("soften", k, lambda t, y, a=spring, b=damper: a(y) - b(y))
            elif self.form[k] == "loose":
                add("pass", k, lambda t, y, spring=spring: -spring(y))
                add("rejoin", k, lambda t, y, a=spring, b=damper: a(y) + b(y))
        for k in range(n - 1):
            dead = self.form[k] == "press" and g.law[k] == "dead-zone" and g.d[k] > 0
            if self.eta[k] < 1 and (dead or self.form[k] == "joined"):
                add("turn", k, lambda t, y, k=k: -self.sign[k] * self.torques(y)[k])
        for i in range(n):
            if self.rubs[i] and self.direction[i] == 0:
                add("forward", i, lambda t, y, i=i: self.pushed(t, y)[i] - self.rubbing(y, i, 1.0))
                add("back", i, lambda t, y, i=i: -self.pushed(t, y)[i] - self.rubbing(y, i, -1.0))
            elif self.rubs[i]:
                add("stop", i, lambda t, y, i=i, s=self.direction[i]: -s * y[n - 1 + i])
        for i, (points, _, _) in g.curves.items():  # where the curve bends the integration starts again
            for point in points:
                add("bend", i, lambda t, y, i=i, x=point: self.along(y, i) - x)
                add("bend", i, lambda t, y, i=i, x=point: x - self.along(y, i))
        if self.target < math.inf:
            load = g.load % n
            add("target", load, lambda t, y: y[n - 1 + load] - self.target)
        return found

    def touch(self, k: int, side: float, overlap: bool = False) -> None:
        self.side[k] = side
        v = side * (self.y[self.n - 1 + k] - self.y[self.n + k])
        if not overlap:
            self.y[k] = side * 0.5 * self.g.gap[k]
        if self.rigid[k]:
            e, J = self.g.restitution[k], self.g.J
            impulse = (1 + e) * side * v / (1 / J[k] + 1 / J[k + 1])
            self.y[self.n - 1 + k] -= impulse / J[k]
            self.y[self.n + k] += impulse / J[k + 1]
            self.events.append((self.t, "impact", k))
            for i in (k, k + 1):
                direction = np.sign(self.y[self.n - 1 + i])
                if self.rubs[i] and direction != self.direction[i]:
                    stops, starts = ("load-stops", "load-starts")
                    if not self.g.reactive[i]:
                        stops, starts = ("gear-holds", "gear-lets-go")
                    if self.direction[i] != 0:
                        self.events.append((self.t, stops, i))
                    self.events.append((self.t, starts, i))
                    self.direction[i] = direction
            return
        spring = self.g.c[k] * self.overlap(self.y)[k] if overlap else 0.0
        damper = self.g.d[k] * v
        if overlap and self.g.law[k] != "dead-zone" and spring + damper < 0:
            self.form[k] = "loose"
            return
        self.form[k] = "stiff" if self.g.law[k] == "modelica" and damper > spring else "press"
        self.sign[k] = side if spring + damper >= 0 else -side
        if not overlap:
            self.events.append((self.t, "closed", k))

    def apply(self, name: str, k: int) -> None:
        if name in ("upper", "lower"):
            self.touch(k, 1.0 if name == "upper" else -1.0)
        elif name in ("leave", "drop"):
            self.events.append((self.t, "opened", k))
            self.form[k] = "loose" if name == "drop" and self.overlap(self.y)[k] > 0 else "open"
            if name == "leave":
                self.y[k] = self.side[k] * 0.5 * self.g.gap[k]
        elif name == "pass":
            self.form[k] = "open"
            self.y[k] = self.side[k] * 0.5 * self.g.gap[k]
        elif name == "rejoin":
            self.form[k] = "press"
            self.sign[k] = self.side[k]
            self.events.append((self.t, "closed", k))
        elif name in ("stiffen", "soften"):
            self.form[k] = "stiff" if name == "stiffen" else "press"
        elif name == "stop":
            self.y[self.n - 1 + k] = 0.0
            self.events.append((self.t, "load-stops" if self.g.reactive[k] else "gear-holds", k))
            self.direction[k] = 0.0
        elif name in ("forward", "back"):
            self.direction[k] = 1.0 if name == "forward" else -1.0
            self.events.append((self.t, "load-starts" if self.g.reactive[k] else "gear-lets-go", k))
        elif name == "bend":
            return
        elif name == "turn":
            self.sign[k] = -self.sign[k]
        else:
            self.target = math.inf
            self.events.append((self.t, "target", k))

    # ---- time ----

    def go(self) -> ChainOracle:
        for span in self.path.spans:
            self.span = span
            while span[1] - self.t > 1e-14 * span[1]:
                self.leap()
                self.leaps += 1
                if len(self.events) > EVENT_CAP or self.leaps > 4 * EVENT_CAP:
                    raise RuntimeError("too many events")
        self.theta, self.w, self.T = (
            self.y[: self.n - 1],
            self.y[self.n - 1 : 2 * self.n - 1],
            self.torques(self.y),
        )
        return self

    def note(self, y: np.ndarray) -> None:
        T = self.torques(y)
        self.peaks = np.where(np.abs(T) > np.abs(self.peaks), T, self.peaks)

    def leap(self) -> None:
        """Go on in the present mode until an event changes it or the torque span ends."""
        end = self.span[1]
        functions = self.functions()
        self.note(self.y)
        before = np.array([f(self.t, self.y) for _, _, f in functions])
        sizes = np.array([self.magnitude(name, place) for name, place, _ in functions])
        bends = np.array([name == "bend" for name, _, _ in functions], bool)  # begin positive without harm
        over = [i for i in range(len(functions)) if before[i] > 1e-11 * sizes[i] and not bends[i]]
        if over:  # as friction overcome by a torque that has jumped
            self.apply(*functions[over[0]][:2])
            return
        waiting = np.abs(before) <= 1e-11 * sizes
        before[waiting] = 0.0
        solver = DOP853(
            self.rhs, self.t, self.y, end, max_step=self.period / 6, rtol=self.rtol,
            atol=self.rtol * 1e-2 * self.size, first_step=min(1e-4 * self.period, end - self.t),
        )  # fmt: skip
        fractions = FIRST_STEP
        while solver.status == "running":
            t_old, y_old = solver.t, solver.y
            solver.step()
            if solver.status == "failed":
                raise RuntimeError(f"DOP853 failed at t = {t_old}")
            dense = solver.dense_output()
            times = t_old + (solver.t - t_old) * fractions
            times[-1] = solver.t
            states = dense(times).T
            values = np.array(
                [[f(t, y) for t, y in zip(times, states, strict=True)] for _, _, f in functions]
            )
            values = values.reshape(len(functions), times.size)
            if fractions is FIRST_STEP:
                at_once = np.flatnonzero(waiting & ~bends & np.all(values >= 0, axis=1) & (values[:, -1] > 0))
                if at_once.size:
                    self.apply(*functions[int(at_once[0])][:2])
                    return
            grid = np.append(t_old, times)
            history = np.column_stack([before, values])
            found: tuple[float, int] | None = None
            for i in range(len(functions)):
                rises = np.flatnonzero((history[i, :-1] < 0) & (history[i, 1:] >= 0))
                if rises.size:
                    k = int(rises[0])
                    when = self.root(functions[i][2], t_old, y_old, float(grid[k]), float(grid[k + 1]))
                    if found is None or when < found[0]:
                        found = (when, i)
            self.note_tops(
                t_old, y_old, grid, np.vstack([y_old, states]), math.inf if found is None else found[0]
            )
            if found is not None:
                self.y = self.single_step(t_old, y_old, found[0])
                self.t = found[0]
                self.note(self.y)
                self.apply(*functions[found[1]][:2])
                return
            before, fractions = values[:, -1], LATER_STEPS
        self.t, self.y = end, solver.y.copy()
        self.note(self.y)

    def magnitude(self, name: str, place: int) -> float:
        """What is not zero among the numbers of which an event function is made."""
        if name in ("upper", "lower", "leave", "pass"):
            return float(self.g.gap[place]) * (self.g.c[place] if name in ("leave", "pass") else 1.0)
        if name == "bend":
            return float(self.size[-1] if self.g.curves[place][2] else self.size[self.n])
        if name in ("stop", "target"):
            return float(np.abs(self.y[self.n - 1 : 2 * self.n - 1]).max()) + 1e-300
        if name in ("forward", "back"):
            return float(self.g.Mc[place]) + float(
                np.abs(self.torques(self.y))[max(place - 1, 0) : place + 1].sum()
            )
        spring = float(self.g.c[place] * (abs(self.y[place]) + self.g.gap[place]))
        if name == "turn":  # its twist is near 0
            damper = float(self.g.d[place] * np.abs(self.y[self.n - 1 : 2 * self.n - 1]).max())
            return float(np.abs(self.peaks).max()) + damper + 1e-300
        return spring

    def note_tops(
        self, t_old: float, y_old: np.ndarray, grid: np.ndarray, states: np.ndarray, until: float
    ) -> None:
        """Extremes of the torques within the step."""

        def rate(t: float, y: np.ndarray, k: int) -> float:
            slopes = self.rhs(t, y)
            v, a = slopes[k], slopes[self.n - 1 + k] - slopes[self.n + k]
            if self.form[k] == "stiff":
                return float(2 * self.g.c[k] * v)
            return float(self.g.c[k] * v + self.g.d[k] * a)

        for k, form in enumerate(self.form):
            if form not in ("press", "stiff", "joined"):
                continue
            slopes = [rate(t, y, k) for t, y in zip(grid, states, strict=True)]
            for j in range(grid.size - 1):
                if slopes[j] * slopes[j + 1] < 0:
                    when = self.root(lambda t, y, k=k: rate(t, y, k), t_old, y_old, grid[j], grid[j + 1])
                    if when < until:
                        self.note(self.single_step(t_old, y_old, when))

    def single_step(self, t_old: float, y_old: np.ndarray, t: float) -> np.ndarray:
        """A Runge-Kutta step of its own to t: the interpolant is of lower order."""
        h = t - t_old
        stages = np.zeros((DOP853.n_stages, y_old.size))
        for i in range(DOP853.n_stages):
            stages[i] = self.rhs(t_old + DOP853.C[i] * h, y_old + h * (DOP853.A[i, :i] @ stages[:i]))
        return np.asarray(y_old + h * (DOP853.B @ stages))

    def root(self, f: Any, t_old: float, y_old: np.ndarray, low: float, high: float) -> float:
        def genuine(t: float) -> float:
            return float(f(t, self.single_step(t_old, y_old, t)))

        at_low, at_high = genuine(low), genuine(high)
        width = high - low
        for _ in range(10):  # the interpolant may put it on the wrong side of a sample
            if at_low * at_high < 0:
                break
            if abs(at_low) < abs(at_high):
                low -= 1e-3 * width
                at_low = genuine(low)
            else:
                high += 1e-3 * width
                at_high = genuine(high)
        if at_low * at_high >= 0:
            return low if abs(at_low) < abs(at_high) else high
        return float(brentq(genuine, low, high, xtol=1e-300, rtol=4 * np.finfo(float).eps))
