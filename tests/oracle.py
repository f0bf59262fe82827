"""An independent answer for one start of a chain or drive: DOP853 between located events. For tests only.

Nothing here is shared with the kernel under test. Between events everything is affine in the state y (twists,
speeds, angle of the load) and in the inputs p (1, motor torque, exciting torques, load curves): the torques
T = K y + k p, the motion y' = A y + B p, and the events, which are rows that rise through zero. A rise is
bracketed by samples of the step's interpolant and then located on genuine Runge-Kutta steps of their own.
After an event the integration restarts in the new mode.

Modes of a shaft: "open"; "press" T = c z + d z' on a flank; "stiff" T = 2 c z (`modelica` while d z' > c z);
"loose" T = 0 though the flanks overlap; "joined", a spring without a gap. A rigid gap is "open" and strikes.
Directions of a mass: 0 stuck, else the sign of the speed that friction opposes; 1 if the load is active.

- "closed" and "opened" are the instants at which a flank begins and ceases to act: "loose" counts as opened.
- A start with overlap begins in contact without an event. A start exactly on a flank closes at t = 0 if it
  moves or is pushed into it. A load that is moved at once has "load-starts" at t = 0.
- Before the first torque piece the demand is u0. Without slew limit and lag u jumps with the demand.
- With `release` a brake holds the motor until that instant or, for infinity, until u >= T ("released").
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq
from tests.oracle_torque import TorquePath

FIRST_STEP = np.array([1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.6, 1.0])  # a new mode may be left again at once
LATER_STEPS = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
PRECISE = 4 * np.finfo(float).eps


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
    friction: Any = 0.0  # Coulomb friction of each mass besides Mc

    def __post_init__(self) -> None:
        self.pull = np.where(self.reactive, 0.0, self.Mc)
        self.hold = np.where(self.reactive, self.Mc, 0.0) + self.friction
        self.efficiency, self.gear = np.broadcast_arrays(self.efficiency, self.gear, self.c)[:2]


class ChainOracle:
    """One start on its way; afterwards `t`, `theta`, `w`, `T`, `peaks` and `events` (time, kind, place)."""

    def __init__(
        self,
        given: Given,
        path: TorquePath,
        target: float = math.inf,
        rtol: float = 1e-12,
        release: float = 0.0,
        most: int = 500,
    ):
        self.g, self.path, self.target, self.rtol, self.release = given, path, target, rtol, release
        self.most = most  # events
        self.latest = math.inf  # no leap goes beyond
        self.n, self.load = given.J.size, given.load % given.J.size
        self.t, self.leaps, self.span = 0.0, 0, path.spans[0]
        self.y = np.concatenate([given.theta0, given.w0, [0.0]]).astype(float)
        self.side = np.zeros(self.n - 1)
        self.form = ["joined" if gap == 0 else "open" for gap in given.gap]
        self.rigid, self.eta = ~np.isnan(given.restitution), given.efficiency
        self.rubs = given.hold > 0.0
        self.rubs[given.gear[self.eta < 1]] = True
        self.held = release > 0.0
        self.direction = np.where(self.rubs, np.sign(given.w0), 1.0)
        if self.held:
            self.direction[given.motor] = 0.0
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
        self.along = {i: self.abscissa(i, curve[2]) for i, curve in given.curves.items()}
        self.set_mode()
        self.sign[self.torques(self.y) < 0] = -1.0

    # ---- mechanics ----

    def abscissa(self, i: int, by_angle: bool) -> np.ndarray:
        """The row of the speed or the angle of mass i, on which its load curve depends."""
        row = np.zeros(2 * self.n)
        if not by_angle:
            row[self.n - 1 + i] = 1.0
            return row
        row[-1] = 1.0
        row[i : self.load] = 1.0
        row[self.load : i] = -1.0
        return row

    def inputs(self, t: Any, y: np.ndarray) -> np.ndarray:
        """1, motor torque, each exciting torque, each torque of a load curve."""
        found = [1.0 + 0.0 * t, self.path.torque(t, self.span)[0] + 0.0 * t]
        found += [a * np.cos(omega * t) + b * np.sin(omega * t) for _, omega, a, b in self.g.tones]
        found += [np.interp(self.along[i] @ y, *self.g.curves[i][:2]) for i in self.along]
        return np.array(found)

    def set_mode(self) -> None:
        """K, k, A and B of the present mode, and the rows of its events."""
        n, g = self.n, self.g
        self.K, self.k = np.zeros((n - 1, 2 * n)), np.zeros((n - 1, 2 + len(g.tones) + len(g.curves)))
        for j, form in enumerate(self.form):
            c = {"press": g.c[j], "joined": g.c[j], "stiff": 2 * g.c[j]}.get(form, 0.0)
            d = g.d[j] if form in ("press", "joined") else 0.0
            self.K[j, j], self.K[j, n - 1 + j], self.K[j, n + j] = c, d, -d
            self.k[j, 0] = -0.5 * c * self.side[j] * g.gap[j]
        self.A, self.B = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, self.k.shape[1]))
        for j in range(n - 1):
            self.A[j, n - 1 + j], self.A[j, n + j] = 1.0, -1.0
        self.A[-1, n - 1 + self.load] = 1.0
        moves = self.direction != 0
        push, by = self.pushed(self.direction)
        by[:, 0] -= self.direction * g.hold
        self.A[n - 1 : 2 * n - 1] = moves[:, None] * push / g.J[:, None]
        self.B[n - 1 : 2 * n - 1] = moves[:, None] * by / g.J[:, None]
        rows = list(self.rows())
        self.names = [(name, place) for name, place, _, _ in rows]
        self.E = np.array([row for _, _, row, _ in rows]).reshape(-1, 2 * n)
        self.F = np.array([by_input for *_, by_input in rows]).reshape(-1, self.k.shape[1])

    def pushed(self, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The torque on each mass that moves in these directions, without Coulomb friction."""
        n, g = self.n, self.g
        passed = np.zeros((n, n - 1))
        for k in range(n - 1):
            for i, sign in ((k, -1.0), (k + 1, 1.0)):
                drives = direction[i] * self.sign[k] * sign > 0
                lossy = g.gear[k] == i
                passed[i, k] = sign * ((self.eta[k] if drives else 1.0 / self.eta[k]) if lossy else 1.0)
        push, by = passed @ self.K, passed @ self.k
        push[:, n - 1 : 2 * n - 1] -= np.diag(g.ground)
        by[:, 0] -= g.pull
        by[g.motor, 1] += 1.0
        for place, i in enumerate([*(tone[0] for tone in g.tones), *g.curves]):
            by[i, 2 + place] += 1.0 if place < len(g.tones) else -1.0
        return push, by

    def rows(self) -> Any:
        """Name, place and row of each event; it happens where the row rises through zero."""
        g, n = self.g, self.n
        constant = np.eye(1, self.k.shape[1])[0]
        for k, form in enumerate(self.form):
            half, s, c, d, law = 0.5 * g.gap[k], self.side[k], g.c[k], g.d[k], g.law[k]
            spring, damper = np.array([c * s, 0.0, -c * half]), np.array([0.0, d * s, 0.0])
            table = {
                "upper": np.array([1.0, 0.0, -half]), "lower": np.array([-1.0, 0.0, -half]),
                "leave": -spring, "pass": -spring, "drop": -spring - damper, "rejoin": spring + damper,
                "stiffen": damper - spring, "soften": spring - damper,
            }  # fmt: skip
            names = {"open": ["upper", "lower"], "stiff": ["soften"], "loose": ["pass", "rejoin"]}.get(
                form, []
            )
            if form == "press":
                names = ["leave" if law == "dead-zone" or d == 0 else "drop"]
                names += ["stiffen"] if law == "modelica" and d > 0 else []
            for name in names:
                twist, rate, one = table[name]
                row = np.zeros(2 * n)
                row[k], row[n - 1 + k], row[n + k] = twist, rate, -rate
                yield name, k, row, one * constant
            dead = form == "press" and law == "dead-zone" and d > 0
            if self.eta[k] < 1 and (dead or form == "joined"):
                yield "turn", k, -self.sign[k] * self.K[k], -self.sign[k] * self.k[k]
        speeds = np.eye(2 * n)[n - 1 : 2 * n - 1]
        for i in reversed(range(n)):  # at t = 0 the load starts before the motor
            if self.held and i == g.motor:
                if math.isinf(self.release):
                    push, by = self.pushed(self.direction)
                    yield "let go", i, push[i], by[i]
            elif self.rubs[i] and self.direction[i] == 0:
                for name, way in (("forward", 1.0), ("back", -1.0)):
                    push, by = self.pushed(np.where(np.arange(n) == i, way, self.direction))
                    yield name, i, way * push[i], way * by[i] - g.hold[i] * constant
            elif self.rubs[i]:
                yield "stop", i, -self.direction[i] * speeds[i], 0.0 * constant
        for i, (points, _, _) in g.curves.items():  # where the curve bends the integration starts again
            for point in points:
                for way in (1.0, -1.0):
                    yield "bend", i, way * self.along[i], -way * point * constant
        if self.target < math.inf:
            yield "target", self.load, speeds[self.load], -self.target * constant

    def rhs(self, t: float, y: np.ndarray) -> np.ndarray:
        return np.asarray(self.A @ y + self.B @ self.inputs(t, y))

    def torques(self, y: np.ndarray) -> np.ndarray:
        return np.asarray(self.K @ y + self.k[:, 0])

    # ---- what happens at an instant ----

    def happened(self, kind: str, place: int) -> None:
        self.events.append((float(self.t), kind, place))
        if len(self.events) > self.most:
            raise RuntimeError("too many events")

    def touch(self, k: int, side: float, overlap: bool = False) -> None:
        self.side[k] = side
        v = side * (self.y[self.n - 1 + k] - self.y[self.n + k])
        if not overlap:
            self.y[k] = side * 0.5 * self.g.gap[k]
        if self.rigid[k]:
            self.strike(k, side * v)
            return
        spring = self.g.c[k] * (side * self.y[k] - 0.5 * self.g.gap[k]) if overlap else 0.0
        damper = self.g.d[k] * v
        if overlap and self.g.law[k] != "dead-zone" and spring + damper < 0:
            self.form[k] = "loose"
            return
        self.form[k] = "stiff" if self.g.law[k] == "modelica" and damper > spring else "press"
        self.sign[k] = side if spring + damper >= 0 else -side
        if not overlap:
            self.happened("closed", k)

    def strike(self, k: int, v: float) -> None:
        """An impact of a rigid gap."""
        J = self.g.J
        impulse = (1 + self.g.restitution[k]) * v / (1 / J[k] + 1 / J[k + 1])
        self.y[self.n - 1 + k] -= impulse / J[k]
        self.y[self.n + k] += impulse / J[k + 1]
        self.happened("impact", k)
        for i in (k, k + 1):
            direction = np.sign(self.y[self.n - 1 + i])
            if self.rubs[i] and direction != self.direction[i]:
                if self.direction[i] != 0:
                    self.happened("load-stops" if self.g.hold[i] > 0 else "gear-holds", i)
                self.happened("load-starts" if self.g.hold[i] > 0 else "gear-lets-go", i)
                self.direction[i] = direction

    def apply(self, name: str, k: int) -> None:
        if name in ("upper", "lower"):
            self.touch(k, 1.0 if name == "upper" else -1.0)
        elif name in ("leave", "drop"):
            self.happened("opened", k)
            overlap = self.side[k] * self.y[k] - 0.5 * self.g.gap[k]
            self.form[k] = "loose" if name == "drop" and overlap > 0 else "open"
            if name == "leave":
                self.y[k] = self.side[k] * 0.5 * self.g.gap[k]
        elif name == "pass":
            self.form[k] = "open"
            self.y[k] = self.side[k] * 0.5 * self.g.gap[k]
        elif name == "rejoin":
            self.form[k] = "press"
            self.sign[k] = self.side[k]
            self.happened("closed", k)
        elif name in ("stiffen", "soften"):
            self.form[k] = "stiff" if name == "stiffen" else "press"
        elif name == "stop":
            self.y[self.n - 1 + k] = 0.0
            self.happened("load-stops" if self.g.hold[k] > 0 else "gear-holds", k)
            self.direction[k] = 0.0
        elif name in ("forward", "back"):
            self.direction[k] = 1.0 if name == "forward" else -1.0
            self.happened("load-starts" if self.g.hold[k] > 0 else "gear-lets-go", k)
        elif name == "let go":
            self.held = False
            self.direction[k] = 0.0 if self.rubs[k] else 1.0
            self.happened("released", k)
        elif name == "turn":
            self.sign[k] = -self.sign[k]
        elif name == "target":
            self.target = math.inf
            self.happened("target", k)

    # ---- time ----

    def go(self) -> ChainOracle:
        for span in self.path.spans:
            self.span = span
            while span[1] - self.t > 1e-14 * span[1]:
                self.leap()
                self.leaps += 1
                if self.leaps > 4 * self.most:
                    raise RuntimeError("too many changes of mode")
        self.set_mode()
        self.theta, self.w = self.y[: self.n - 1], self.y[self.n - 1 : 2 * self.n - 1]
        self.T = self.torques(self.y)
        return self

    def note(self, y: np.ndarray) -> None:
        T = self.torques(y)
        self.peaks = np.where(np.abs(T) > np.abs(self.peaks), T, self.peaks)

    def leap(self) -> None:
        """Go on in the present mode until an event changes it or the torque span ends."""
        self.set_mode()
        self.note(self.y)
        end = min(self.span[1], self.latest)
        inputs = self.inputs(self.t, self.y)
        before = self.E @ self.y + self.F @ inputs
        rounding = 1e-11 * (np.abs(self.E) @ np.abs(self.y) + np.abs(self.F) @ np.abs(inputs))
        bends = np.array([name == "bend" for name, _ in self.names], bool)  # begin positive without harm
        if self.held and math.isfinite(self.release):
            if self.t >= self.release:
                self.apply("let go", self.g.motor)
                return
            end = min(end, self.release)
        for i in np.flatnonzero(~bends):
            # as friction overcome by a torque that has jumped
            if before[i] > rounding[i] or (self.names[i][0] == "let go" and before[i] >= 0):
                self.apply(*self.names[i])
                return
        waiting = np.abs(before) <= rounding
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
            step = Step(self, t_old, y_old, solver.dense_output())
            times = t_old + (solver.t - t_old) * fractions
            times[-1] = solver.t
            grid = np.append(t_old, times)
            states = np.column_stack([y_old, step.dense(times)])
            values = self.E @ states + self.F @ self.inputs(grid, states)
            values[:, 0] = before
            if fractions is FIRST_STEP:
                at_once = waiting & ~bends & np.all(values >= 0, axis=1) & (values[:, -1] > 0)
                if np.any(at_once):
                    self.apply(*self.names[int(np.argmax(at_once))])
                    return
            found = (math.inf, -1)
            for i, j in step.crossings(values, upwards=True):
                found = min(found, (step.root(self.E[i], self.F[i], grid[j], grid[j + 1]), i))
            EA, EB = self.E @ self.A, self.E @ self.B
            for i, j in step.crossings(EA @ states + EB @ self.inputs(grid, states), upwards=False):
                if values[i, j] < 0 and values[i, j + 1] < 0 and not self.F[i, 1:].any():  # a touch
                    top = step.root(EA[i], EB[i], grid[j], grid[j + 1])
                    if self.E[i] @ step.state(top) + self.F[i, 0] > 0:
                        found = min(found, (step.root(self.E[i], self.F[i], grid[j], top), i))
            KA, KB = self.K @ self.A, self.K @ self.B
            for i, j in step.crossings(KA @ states + KB @ self.inputs(grid, states), upwards=False):
                when = step.root(KA[i], KB[i], grid[j], grid[j + 1])
                if when < found[0]:
                    self.note(step.state(when))
            if found[1] >= 0:
                self.t, self.y = found[0], step.state(found[0])
                self.note(self.y)
                self.apply(*self.names[found[1]])
                return
            before, fractions = values[:, -1], LATER_STEPS
        self.t, self.y = end, solver.y.copy()
        self.note(self.y)


@dataclass
class Step:
    """One accepted step, entered again: states by a Runge-Kutta step of their own, and roots on them."""

    run: ChainOracle
    t: float
    y: np.ndarray
    dense: Any

    def state(self, t: float) -> np.ndarray:
        h = t - self.t
        stages = np.zeros((DOP853.n_stages, self.y.size))
        for i in range(DOP853.n_stages):
            stages[i] = self.run.rhs(self.t + DOP853.C[i] * h, self.y + h * (DOP853.A[i, :i] @ stages[:i]))
        return np.asarray(self.y + h * (DOP853.B @ stages))

    @staticmethod
    def crossings(values: np.ndarray, upwards: bool) -> list[tuple[int, int]]:
        """Rows and the samples before which they first rise through zero; or those of each change of sign."""
        if upwards:
            rises = (values[:, :-1] < 0) & (values[:, 1:] >= 0)
            return [(int(i), int(np.argmax(rises[i]))) for i in np.flatnonzero(rises.any(axis=1))]
        return [(int(i), int(j)) for i, j in np.argwhere(values[:, :-1] * values[:, 1:] < 0)]

    def root(self, row: np.ndarray, by_input: np.ndarray, low: float, high: float) -> float:
        """Where a row is zero: found on the interpolant, then on genuine steps, as it is of lower order."""

        def value(t: float, y: np.ndarray) -> float:
            return float(row @ y + by_input @ self.run.inputs(t, y))

        def interpolated(t: float) -> float:
            return value(t, self.dense(t))

        at_low, at_high = interpolated(low), interpolated(high)
        if at_low * at_high < 0:
            t = float(brentq(interpolated, low, high, xtol=1e-300, rtol=PRECISE))
        else:
            t = low if abs(at_low) < abs(at_high) else high
        near = 1e-4 * (high - low)
        slope = (interpolated(t + near) - interpolated(t - near)) / (2 * near)
        for _ in range(5):
            change = -value(t, self.state(t)) / slope if slope else 0.0
            if not abs(change) <= 1e-3 * (high - low):  # a grazing root: the interpolant's is as good
                break
            t += change
            if abs(change) <= 2e-16 * abs(t):
                break
        return t


# ---- a drive --------------------------------------------------------------------------------------------


@dataclass
class Start:
    """What became of the start of a drive."""

    peak: float
    events: list[tuple[float, str]]
    theta: float
    w1: float
    w2: float
    phi2: float
    u: float
    T: float


def integrate(
    *, J1: float, J2: float, c: float, d: float, gap: float, Mc: float, kind: str, law: str, theta0: float,
    w1_0: float, w2_0: float, torque_pieces: list[Any], lag: float, rate: float, u0: float, t_end: float,
    target: float | None = None, rtol: float = 1e-12, release: float = 0.0, friction: float = 0.0,
    b1: float = 0.0, b2: float = 0.0, load_friction: float = 0.0,
) -> Start:  # fmt: skip
    """A start of two masses; `friction` is Coulomb friction of the motor, b1 and b2 viscous friction.

    `load_friction` is Coulomb friction of the load besides Mc.
    """
    one, two = np.full(1, c), np.array([J1, J2])
    given = Given(
        two, np.array([friction, Mc]), np.array([friction > 0.0, kind == "reactive"]), np.array([w1_0, w2_0]),
        one, np.full(1, d), np.full(1, gap), [law], np.full(1, theta0), np.array([b1, b2]), [],
        np.full(1, math.nan), 0, friction=np.array([0.0, load_friction]),
    )  # fmt: skip
    path = TorquePath(torque_pieces, lag, rate, u0, t_end)
    run = ChainOracle(given, path, math.inf if target is None else target, rtol, release, 5000).go()
    events = [
        (time, name.replace("load", "motor") if place == 0 else name) for time, name, place in run.events
    ]
    (theta, w1, w2, phi2), u = run.y.tolist(), float(path.torque(t_end, run.span)[0])
    return Start(float(abs(run.peaks[0])), events, theta, w1, w2, phi2, u, float(run.T[0]))


def random_case(rng: np.random.Generator) -> dict[str, Any]:
    """Arguments of `integrate` for a start drawn at random, a few to ten elastic periods long."""

    def decades(low: float, high: float) -> float:
        return float(10 ** rng.uniform(math.log10(low), math.log10(high)))

    J1 = decades(1e-3, 1e2)
    J2 = J1 * decades(0.1, 100)
    period, twist = decades(5e-3, 1.0), decades(1e-3, 0.3)  # twist: of the shaft under the starting torque
    Omega = 2 * math.pi / period
    c = Omega**2 * J1 * J2 / (J1 + J2)
    zeta = 0.0 if rng.random() < 0.25 else float(rng.uniform(0, 1.5))
    Ms, speed, t_end = c * twist, Omega * twist, period * float(rng.uniform(3, 10))
    gap = 0.0 if rng.random() < 0.05 else twist * decades(1e-3, 100)
    place = rng.random()
    theta0 = 0.0 if place < 0.25 else gap * float(rng.uniform(-0.5, 0.5))
    if place > 0.75:
        theta0 = float(rng.choice([-1, 1])) * (gap / 2 + twist * float(rng.uniform(0, 2)))
    w1, w2 = (0.0 if rng.random() < 0.5 else speed * float(rng.normal()) for _ in range(2))
    starts = [0.0, *sorted(float(t) for t in rng.uniform(0, t_end, rng.integers(0, 4)))]
    return {
        "J1": J1, "J2": J2, "c": c, "d": 2 * zeta * c / Omega, "gap": gap,
        "Mc": Ms * float(rng.uniform(0, 0.9)),
        "kind": str(rng.choice(["active", "reactive"])),
        "law": str(rng.choice(["no-pull", "dead-zone", "modelica"])),
        "theta0": theta0, "w1_0": w1, "w2_0": w2,
        "torque_pieces": [(t, Ms * float(rng.uniform(-0.3, 1.2))) for t in starts],
        "lag": 0.0 if rng.random() < 0.5 else decades(2e-4, 2e-2),
        "rate": math.inf if rng.random() < 0.5 else Ms / (period * decades(0.05, 3)),
        "u0": 0.0 if rng.random() < 0.6 else Ms * float(rng.uniform(-0.3, 1.0)), "t_end": t_end,
        "target": Ms / (J1 + J2) * t_end * float(rng.uniform(0.05, 0.8)),
    }  # fmt: skip
