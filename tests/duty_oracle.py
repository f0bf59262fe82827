"""A whole duty by the oracle: phases, each with a motor torque of its own, over one machine. For tests.

Nothing here is shared with the kernel under test. `DutyOracle` holds the state between phases: twists,
speeds, modes, torque behind limiter and lag, brake, load. A phase is one `ChainOracle` that begins there and
ends at the first of its `Until`, located as an event. Times within a phase count from its beginning.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from tests.oracle import ChainOracle, Given
from tests.oracle_torque import TorquePath


class Until(NamedTuple):
    """What ends a phase.

    kind      value                         way
    time      s after its beginning
    load      speed of the load             +1 it rises to it, -1 it falls to it
    motor     speed of the motor            +1 it rises to it, -1 it falls to it
    angle     travel of the load, rad       sign of the travel
    stand     s of the phase for which all masses have been in the band
    proved    0                             sign of the motor torque that carries the shaft torque
    """

    kind: str
    value: float
    way: float = 1.0


@dataclass
class PhaseEnd:
    """What became of a phase: `time`, `events` and `since` count from the beginning of the duty."""

    reason: str
    begin: float
    time: float
    twist: np.ndarray
    w: np.ndarray
    phi: float  # angle of the load
    T: np.ndarray
    u: float
    highest: np.ndarray  # torque of each shaft, signed
    lowest: np.ndarray
    events: list[tuple[float, str, int]]
    since: float  # from when on all masses are in the band; NaN if they are not
    energy: float  # kinetic and elastic
    impacts: np.ndarray  # kinetic energy of the relative motion as the flanks of each shaft meet, their sum


class PhaseOracle(ChainOracle):
    """A start that begins where the phase before ended and is over at the first of its `Until`."""

    def __init__(self, duty: DutyOracle, given: Given, path: TorquePath, until: Iterable[Until]):
        lock = math.isinf(duty.brake)
        self.duty, self.until, self.reason = duty, list(until), ""
        self.begin_angle, speeds = float(duty.y[-1]), duty.y[duty.n - 1 : 2 * duty.n - 1]
        self.place = np.where(np.abs(speeds) <= duty.band, 0.0, np.sign(speeds))  # in, above, below the band
        self.impacts = np.zeros(given.c.size)
        super().__init__(given, path, math.inf, duty.rtol, 2.0 * path.t_end if lock else 0.0, duty.most)
        self.y, self.form, self.size = duty.y.copy(), [*duty.form], duty.size
        self.side, self.sign = duty.side.copy(), duty.sign.copy()
        self.direction = np.where(self.rubs, np.sign(speeds), 1.0)
        if lock:  # on a motor that stands, but for the band of a stop
            self.direction[given.motor] = self.y[self.n - 1 + given.motor] = 0.0
        self.highest, self.lowest = np.full(self.n - 1, -math.inf), np.full(self.n - 1, math.inf)
        self.since = duty.since - duty.time
        if self.place.any() or not duty.watched:
            self.since = math.nan
        elif math.isnan(self.since):
            self.since = 0.0
        self.set_latest()

    def set_latest(self) -> None:
        """When time ends the phase."""
        limits = [one.value for one in self.until if one.kind == "time"]
        if not math.isnan(self.since):
            begin = self.duty.time if self.duty.rest_from is None else self.duty.rest_from
            stands = max(self.since, begin - self.duty.time)
            limits += [stands + one.value for one in self.until if one.kind == "stand"]
        self.latest = min([self.path.t_end, *limits])

    def rows(self) -> Any:
        yield from super().rows()
        one = np.eye(1, self.k.shape[1])[0]
        states = np.eye(2 * self.n)
        speeds = states[self.n - 1 : 2 * self.n - 1]
        seen = {"load": speeds[self.load], "motor": speeds[self.g.motor], "angle": states[-1]}
        for place, (kind, value, way) in enumerate(self.until):
            if kind in seen:
                threshold = self.begin_angle + value if kind == "angle" else value
                yield "until", place, way * seen[kind], -way * threshold * one
            elif kind == "proved":
                push, by = self.pushed(self.direction)
                yield "until", place, way * push[self.g.motor], way * by[self.g.motor]
        if not self.duty.watched:
            return
        for i in range(self.n):
            if self.place[i]:
                yield "enter", i, -self.place[i] * speeds[i], self.duty.band * one
            else:
                yield "above", i, speeds[i], -self.duty.band * one
                yield "below", i, -speeds[i], -self.duty.band * one

    def apply(self, name: str, k: int) -> None:
        if name == "until":
            self.reason = self.until[k].kind
        elif name in ("enter", "above", "below"):
            self.place[k] = {"enter": 0.0, "above": 1.0, "below": -1.0}[name]
            self.since = math.nan if self.place.any() else self.t
            self.set_latest()
        else:
            super().apply(name, k)
            ends = {self.g.motor: ("motor", 0.0), self.load: ("load", 0.0)}
            if name == "stop" and any(one[:2] == ends.get(k) for one in self.until):
                self.reason = ends[k][0]

    def touch(self, k: int, side: float, overlap: bool = False) -> None:
        if not overlap:
            light = 1.0 / self.g.J
            light[self.g.motor] *= not self.held  # a lock holds it fast
            v = self.y[self.n - 1 + k] - self.y[self.n + k]
            self.impacts[k] += 0.5 * v**2 / (light[k] + light[k + 1])
        super().touch(k, side, overlap)

    def note(self, y: np.ndarray) -> None:
        T = self.torques(y)
        self.highest, self.lowest = np.maximum(self.highest, T), np.minimum(self.lowest, T)

    def go(self) -> PhaseOracle:
        for span in self.path.spans:
            self.span = span
            while not self.reason and min(span[1], self.latest) - self.t > 1e-14 * span[1]:
                self.leap()
                self.leaps += 1
                if self.leaps > 4 * self.most:
                    raise RuntimeError("too many changes of mode")
            if not self.reason and self.latest - self.t <= 1e-14 * self.latest:
                timed = any(one.kind == "time" and self.t >= one.value * (1 - 1e-13) for one in self.until)
                self.reason = "time" if timed else "stand"
            if self.reason:
                break
        if not self.reason or (self.latest == self.path.t_end and self.reason == "stand"):
            raise RuntimeError("the phase does not end")
        motor = self.n - 1 + self.g.motor
        if self.reason == "motor" and any(one[:2] == ("motor", 0.0) for one in self.until):
            self.y[motor] = 0.0  # located; friction or a lock may hold it from here on
        self.set_mode()
        self.note(self.y)
        return self


@dataclass
class DutyOracle:
    """A machine on duty: each call of `phase` integrates one phase, `load` changes the load at rest.

    `brake` is Coulomb friction on the motor from the next phase on; 0 open, infinite for a lock.
    """

    given: Given
    lag: float = 0.0
    rate: float = math.inf
    dead_time: float = 0.0  # after which a new demand takes effect, s
    band: float = 0.0  # rad/s, for "stand"
    speed: float = 1.0  # a speed that is reached, for the tolerances
    longest: float = math.inf  # of a phase without a time, s
    rtol: float = 1e-12
    most: int = 5000
    ends: list[PhaseEnd] = field(default_factory=list)

    def __post_init__(self) -> None:
        first = ChainOracle(self.given, TorquePath([], 0.0, math.inf, 0.0, 1.0), rtol=self.rtol)
        self.y, self.form, self.side, self.sign = first.y, first.form, first.side, first.sign
        angle = self.speed * first.period
        size = np.maximum(
            first.size, np.concatenate([first.size[: first.n - 1], np.full(first.n, self.speed), [angle]])
        )
        self.size, self.n = size, first.n
        self.time = self.u = self.limited = self.brake = 0.0
        self.pieces: list[Any] = [(0.0, 0.0)]
        self.watched, self.since = False, math.nan
        self.rest_from: float | None = None  # from when on "stand" counts, if not the beginning of the phase

    @property
    def demand(self) -> float:
        """The demand of the motor torque now."""
        return demand_at(self.pieces, 0.0)

    def watch(self, on: bool = True) -> None:
        """From now on it is noted since when all masses are in the band."""
        self.watched, self.since = on, math.nan

    def load(self, mass: int = -1, **changes: float) -> None:
        """Another inertia J, torque Mc, `reactive` or `friction` of a mass; angles and speeds go on."""
        g = self.given
        fields: dict[str, Any] = {"friction": np.broadcast_to(g.friction, g.J.shape).astype(float)}
        for name, value in changes.items():
            fields[name] = np.array(fields.get(name, getattr(g, name)))
            fields[name][mass] = value
        self.given = replace(g, **fields)

    def phase(self, *until: Until, torque: list[Any] | None = None) -> PhaseEnd:
        """One phase under these torque pieces, or those of the phase before, which go on."""
        g = self.given
        if 0.0 < self.brake < math.inf:
            friction = np.broadcast_to(g.friction, g.J.shape).astype(float)
            friction[g.motor] += self.brake
            g = replace(g, friction=friction)
        pieces = self.pieces if torque is None else self.after_dead_time(torque)
        timed = [one.value for one in until if one.kind == "time"]
        end = min([self.longest, *timed])
        path = TorquePath(pieces, self.lag, self.rate, self.u, end, self.limited)
        run = PhaseOracle(self, g, path, until).go()
        self.limited = run.span[2] + run.span[3] * (run.t - run.span[0])
        self.u = float(path.torque(run.t, run.span)[0])
        self.pieces = [(0.0, *piece_at(pieces, run.t)), *shifted(pieces, run.t)]
        begin, self.time = self.time, float(self.time + run.t)
        self.since = float(begin + run.since)
        self.y, self.form, self.side, self.sign = run.y, run.form, run.side, run.sign
        w, T = run.y[self.n - 1 : 2 * self.n - 1].copy(), run.torques(run.y)
        events = [(float(begin + t), kind, place) for t, kind, place in run.events]
        found = PhaseEnd(
            run.reason, begin, self.time, run.y[: self.n - 1].copy(), w, float(run.y[-1]), T, self.u,
            run.highest, run.lowest, events, self.since, self.energy(), run.impacts,
        )  # fmt: skip
        self.ends.append(found)
        return found

    def after_dead_time(self, torque: list[Any]) -> list[Any]:
        """The pieces under way until the new ones take effect."""
        before = [one for one in self.pieces if one[0] < self.dead_time]
        return before + [(start + self.dead_time, *rest) for start, *rest in torque]

    def energy(self) -> float:
        """Kinetic energy and that of the springs, J; of masses that are held fast none."""
        g, w, twist = self.given, self.y[self.n - 1 : 2 * self.n - 1], self.y[: self.n - 1]
        overlap = np.maximum(np.abs(twist) - 0.5 * g.gap, 0.0)
        kinetic = np.where(w != 0.0, np.where(np.isinf(g.J), 0.0, g.J) * w**2, 0.0).sum()
        return float(kinetic + (np.nan_to_num(g.c, posinf=0.0) * overlap**2).sum()) / 2


def piece_at(pieces: list[Any], t: float) -> tuple[float, float]:
    """Demand at t and its slope."""
    start, demand, slope = next(
        ((s, u, *rise, 0.0)[:3] for s, u, *rise in reversed(pieces) if s <= t), (0.0, 0.0, 0.0)
    )
    return demand + slope * (t - start), slope


def demand_at(pieces: list[Any], t: float) -> float:
    return piece_at(pieces, t)[0]


def shifted(pieces: list[Any], t: float) -> list[Any]:
    """The pieces that begin after t, counted from there."""
    return [(start - t, *rest) for start, *rest in pieces if start > t]
