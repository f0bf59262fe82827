"""Random duties of drives and chains as plain numbers, and what each of their steps is to the oracle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import eigvalsh
from tests.duty_oracle import DutyOracle, PhaseEnd, Until
from tests.oracle import Given


def elastic_period(g: Given) -> float:
    """Of the first natural frequency with all gaps closed."""
    K = np.zeros((g.J.size, g.J.size))
    for k, c in enumerate(g.c):
        K[k : k + 2, k : k + 2] += c * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return float(2 * math.pi / math.sqrt(eigvalsh(K, np.diag(g.J))[1]))


def held_period(g: Given) -> float:
    """Dunkerley's bound of the longest period with the motor held and all gaps closed."""
    total = 0.0
    for i, J in enumerate(g.J):
        total += J * sum(1.0 / g.c[k] for k in range(min(i, g.motor), max(i, g.motor)))
    return float(2 * math.pi * math.sqrt(total))


@dataclass
class Case:
    """A machine, the torque of its starts forwards, and the steps of one cycle."""

    given: Given
    torque: float  # starting torque
    braking: float  # size of the smallest torque
    lag: float
    rate: float
    target: float
    pieces: list[Any]  # of a start: (instant, torque, slope)
    steps: list[dict[str, Any]]
    brake: float = 0.0  # friction; infinite for a lock, 0 without a brake
    closing: float = 0.0
    opening: float = 0.0
    proving: bool = False  # the brake is opened by torque proving
    dead_time: float = 0.0

    @property
    def repeated(self) -> list[tuple[dict[str, Any], int]]:
        """The steps without `repeat`, and how often each is carried out in a row."""
        return [
            ({key: value for key, value in step.items() if key != "repeat"}, step.get("repeat", 1))
            for step in self.steps
        ]


@dataclass
class Step:
    """What became of a step: its phases, the last of which is at its end."""

    do: str
    phases: list[PhaseEnd]

    @property
    def end(self) -> PhaseEnd:
        return self.phases[-1]

    @property
    def highest(self) -> np.ndarray:
        return np.max([one.highest for one in self.phases], axis=0)

    @property
    def lowest(self) -> np.ndarray:
        return np.min([one.lowest for one in self.phases], axis=0)

    @property
    def impacts(self) -> np.ndarray:
        return np.sum([one.impacts for one in self.phases], axis=0)

    @property
    def contacts(self) -> int:
        """How often flanks met."""
        return sum(kind == "closed" for one in self.phases for _, kind, _ in one.events)


class Player:
    """A cycle of a case on the oracle, step by step."""

    def __init__(self, case: Case, **fields: Any):
        self.case = case
        self.oracle = DutyOracle(
            case.given, case.lag, case.rate, case.dead_time, band=0.01 * case.target, speed=case.target,
            longest=400.0 * elastic_period(case.given), **fields,
        )  # fmt: skip
        self.speed = 0.0  # commanded; 0 at standstill
        self.oracle.brake = case.brake

    def cycle(self) -> list[Step]:
        """All steps, a jog that is repeated as so many."""
        return [self.step(**step) for step, times in self.case.repeated for _ in range(times)]

    def step(self, do: str, **given: Any) -> Step:
        first = len(self.oracle.ends)
        getattr(self, do)(**given)
        return Step(do, self.oracle.ends[first:])

    def start(self, set_speed: float = math.nan, time: float = math.inf, angle: float = math.inf) -> None:
        """The torque of the start, until the load has its speed; then on to the time or angle of the step.

        A brake holds the motor fast until it is open; but for torque proving the start begins then.
        """
        o, case, speed = self.oracle, self.case, self.case.target if math.isnan(set_speed) else set_speed
        stood, self.speed, ends = self.speed == 0.0, speed, ends_of(self.oracle, time, angle)
        torque: Any = [(t, *(self.way * one for one in rest)) for t, *rest in case.pieces]
        if stood and case.brake > 0.0:
            o.brake = math.inf
            if case.proving:
                o.phase(Until("proved", 0.0, self.way), torque=torque)
                torque = None
            if case.opening > 0.0:
                o.phase(Until("time", case.opening), torque=None if case.proving else REST)
        o.brake = 0.0
        end = o.phase(Until("load", speed, self.way), *ends(self.way), torque=torque)
        if end.reason == "load" and min(time, angle) < math.inf:
            self.keep(*ends(self.way))

    def reverse(self, set_speed: float = math.nan, **ends: float) -> None:
        self.start(-self.speed if math.isnan(set_speed) else set_speed, **ends)

    @property
    def period(self) -> float:
        """With the load as it is now."""
        return elastic_period(self.oracle.given)

    @property
    def way(self) -> float:
        """The direction of the command."""
        return math.copysign(1.0, self.speed)

    def keep(self, *until: Until) -> None:
        """In a line, over one elastic period, to the torque under which all masses keep the set speed."""
        o, period, holds = self.oracle, self.period, holding_torque(self.oracle.given, self.speed)
        o.phase(*until, torque=[(0.0, o.limited, (holds - o.limited) / period), (period, holds)])

    def hold(self, time: float = math.inf, angle: float = math.inf) -> None:
        """Go on at the torque that holds the load; at standstill a pause without torque."""
        if self.speed == 0.0:
            self.oracle.phase(Until("time", time), torque=REST)
        else:
            self.keep(*ends_of(self.oracle, time, angle)(self.way))

    def jog(self, time: float, set_speed: float = math.nan, **stop: Any) -> None:
        self.start(set_speed, time)
        self.stop(**stop)

    def brake(self, time: float = math.inf) -> None:
        self.stop(by="brake", time=time)

    def stop(
        self, by: str, braking_torque: float = math.nan, brake_speed: float = 0.0,
        brake_time: float = math.nan, time: float = math.inf,
    ) -> None:  # fmt: skip
        """Braking torque until the motor stands, or none; then the brake closes, and all come to rest."""
        o, braked = self.oracle, self.case.brake > 0.0
        o.watch()
        size, ends = self.case.braking if math.isnan(braking_torque) else braking_torque, ends_of(o, time)
        torque = [(0.0, -self.way * size)] if by == "torque" else REST
        slows = by == "torque" or (by == "coast" and braked) or brake_speed > 0.0
        # without load and friction a motor without torque stands in its band
        slow = brake_speed if abs(holding_torque(o.given, 0.0)) > 0.0 else max(brake_speed, o.band)
        if not math.isnan(brake_time):
            if brake_time > 0.0:
                o.phase(Until("time", brake_time), torque=torque)
        elif slows and self.way * o.y[o.n - 1 + o.given.motor] > brake_speed:
            o.phase(Until("motor", self.way * slow, -self.way), torque=torque)
        if braked:
            if self.case.closing > 0.0:
                o.phase(Until("time", self.case.closing), torque=REST)
            if math.isinf(self.case.brake):
                self.stand()
            o.brake = self.case.brake
        self.rest(ends)
        if 0.0 < o.brake < math.inf and not ends():
            self.stand()

    def stand(self) -> None:
        """On to the next standstill of the motor, if it moves: a lock closes there."""
        o, still = self.oracle, 1e-9 * self.case.target
        speed = float(o.y[o.n - 1 + o.given.motor])
        if abs(speed) > still:
            way = math.copysign(1.0, speed)
            o.phase(Until("motor", way * still, -way), torque=REST)

    def rest(self, ends: Any) -> None:
        """Without torque until all masses have stood for a period, or to the time of the step."""
        end = self.oracle.phase(Until("stand", held_period(self.oracle.given)), *ends(), torque=REST)
        self.oracle.watch(False)
        if end.reason == "stand" and ends():
            self.oracle.phase(*ends(), torque=REST)
        self.speed = 0.0

    def load(self, mass: int = -1, time: float = math.inf, **changes: float) -> None:
        ends = ends_of(self.oracle, time)
        self.oracle.load(mass, **changes)
        self.oracle.watch()
        self.rest(ends)


REST = [(0.0, 0.0)]  # no torque


def ends_of(oracle: DutyOracle, time: float, angle: float = math.inf) -> Callable[..., list[Until]]:
    """What is left from here on of the time and the travel of a step, at any instant of it."""
    begin, phi = oracle.time, float(oracle.y[-1])

    def left(way: float = 1.0) -> list[Until]:
        ends = [Until("time", begin + time - oracle.time)] if time < math.inf else []
        return ends + [Until("angle", phi + way * angle - float(oracle.y[-1]), way)] * (angle < math.inf)

    return left


def holding_torque(g: Given, speed: float) -> float:
    """The motor torque under which all masses keep this speed: from both ends inwards, with gear losses."""
    need = g.pull + math.copysign(1.0, speed) * g.hold + speed * g.ground
    for i, (points, torques, _) in g.curves.items():
        need[i] += np.interp(speed, points, torques)
    arrives, n = [0.0, 0.0], need.size
    for side, masses in enumerate((range(g.motor), range(n - 1, g.motor, -1))):
        for i in masses:
            through = arrives[side] + float(need[i])
            eta = float(g.efficiency[i if side == 0 else i - 1])
            arrives[side] = through / eta if through * speed > 0.0 else through * eta
    return float(need[g.motor]) + sum(arrives)


# ---- random cases ---------------------------------------------------------------------------------------


def decades(rng: np.random.Generator, low: float, high: float) -> float:
    return float(10 ** rng.uniform(math.log10(low), math.log10(high)))


def random_drive(seed: int) -> Case:
    """A damped drive on duty: a few contacts in each step, so that errors of the oracle do not grow."""
    rng = np.random.default_rng([50, seed])
    J1 = decades(rng, 1e-2, 1.0)
    J2, period, twist = J1 * decades(rng, 0.5, 10.0), decades(rng, 0.02, 0.2), decades(rng, 0.01, 0.3)
    reduced = J1 * J2 / (J1 + J2)
    c = reduced * (2 * math.pi / period) ** 2
    Ms = c * twist
    given = masses(rng, np.array([J1, J2]), np.array([c]), Ms, period)
    given.d[0] = 2 * float(rng.uniform(0.05, 0.4)) * math.sqrt(c * reduced)
    return on_duty(rng, given, Ms, period)


def random_chain(seed: int) -> Case:
    """A damped chain of three or four masses on duty."""
    rng = np.random.default_rng([51, seed])
    count = int(rng.integers(3, 5))
    J, c = 10 ** rng.uniform(-1.0, 0.3, count), 10 ** rng.uniform(2.5, 3.5, count - 1)
    Ms = float(rng.uniform(0.05, 0.2) * c.min())
    given = masses(rng, J, c, Ms, 0.0)
    given.d[:] = 2 * rng.uniform(0.1, 0.4, count - 1) * np.sqrt(c * J[:-1] * J[1:] / (J[:-1] + J[1:]))
    return on_duty(rng, given, Ms, elastic_period(given))


def masses(rng: np.random.Generator, J: np.ndarray, c: np.ndarray, Ms: float, period: float) -> Given:
    """Masses at rest; an active load hangs, another one is anywhere in its gap; all have some friction."""
    count, active = J.size, rng.random() < 0.4
    gap = Ms / c * 10 ** rng.uniform(-1.0, 0.7, count - 1)
    if count > 2:
        gap *= rng.random(count - 1) < 0.6
    Mc, friction = np.zeros(count), np.zeros(count)
    Mc[-1] = Ms * float(rng.uniform(0.1, 0.5))
    friction[0] = Ms * float(rng.uniform(0.02, 0.1))
    friction[-1] = Ms * float(rng.uniform(0.0, 0.15)) if rng.random() < 0.5 else 0.0
    rate = Ms / J.sum() if period == 0.0 else 1.0 / period
    ground = J * rate * 10 ** rng.uniform(-4, -2, count) * (rng.random(count) < 0.5)
    law = [str(rng.choice(["no-pull", "dead-zone", "modelica"])) for _ in c]
    reactive = np.array([False] * (count - 1) + [not active])
    theta0 = 0.5 * gap + Mc[-1] / c if active else gap * rng.uniform(-0.45, 0.45, count - 1)
    return Given(
        J=J, Mc=Mc, reactive=reactive, w0=np.zeros(count), c=c, d=np.zeros(count - 1), gap=gap, law=law,
        theta0=theta0, ground=ground, tones=[], restitution=np.full(count - 1, math.nan), motor=0,
        friction=friction,
    )  # fmt: skip


def on_duty(rng: np.random.Generator, given: Given, Ms: float, period: float) -> Case:
    """The machine with a motor, a brake where its load is active or by chance, and a cycle of steps."""
    active, Mc = not given.reactive[-1], float(given.Mc[-1])
    held = float(given.hold.sum() + given.pull.sum())
    target = (Ms - held) / float(given.J.sum()) * period * float(rng.uniform(1.5, 4.0))
    brake = 0.0
    if active or rng.random() < 0.3:
        brake = math.inf if rng.random() < 0.3 else 1.3 * Mc + Ms * float(rng.uniform(0.1, 0.8))
    closing, opening = rng.uniform(0.05, 0.6, 2) * period * (rng.random(2) < 0.7)
    if math.isinf(brake):  # it closes at standstill
        closing, opening = 0.0, 0.3 * period
    steps = [step for part in cycle(rng, active, brake, target, period) for step in part]
    for step in steps:
        if step["do"] == "load":
            step["Mc"] = Mc * float(rng.uniform(0.3, 1.2))
            step["J"] = float(given.J[-1]) * decades(rng, 0.5, 2.0)
            if not active and rng.random() < 0.4:
                step["friction"] = Mc * float(rng.uniform(0.0, 0.3))
    pieces: list[Any] = [(0.0, Ms)]
    if rng.random() < 0.6:
        first, t = float(rng.uniform(0.5, 0.9)) * Ms, float(rng.uniform(0.5, 2.0)) * period
        pieces = [(0.0, first, (Ms - first) / t), (t, Ms)] if rng.random() < 0.5 else [(0.0, first), (t, Ms)]
    return Case(
        given, Ms, max(float(rng.uniform(0.4, 1.0)) * Ms, 1.3 * Mc if active else 0.0),
        0.0 if rng.random() < 0.5 else period * decades(rng, 0.02, 0.2),
        math.inf if rng.random() < 0.5 else Ms / (period * decades(rng, 0.05, 0.5)),
        target, pieces, steps, brake, float(closing), float(opening),
    )  # fmt: skip


def cycle(rng: np.random.Generator, active: bool, brake: float, target: float, period: float) -> list[Any]:
    """Parts of a cycle that return to rest: lists of steps, in some order."""

    def stop(forwards: bool) -> dict[str, Any]:
        """A stop that the machine can make: an active load that is let down does not coast."""
        choices = ["torque"] + ["coast"] * (forwards or not active) + ["brake"] * (0 < brake < math.inf)
        by = str(rng.choice(choices))
        stop: dict[str, Any] = {"by": by}
        if by == "brake":
            stop |= (
                {"brake_time": float(rng.uniform(0.0, 1.0)) * period}
                if rng.random() < 0.5 or (active and not forwards)
                else {"brake_speed": float(rng.uniform(0.2, 0.9)) * target}
            )
        return stop

    def speed(way: float) -> dict[str, float]:
        return (
            {}
            if way > 0 and rng.random() < 0.5
            else {"set_speed": way * target * float(rng.uniform(0.5, 1.0))}
        )

    def hold() -> dict[str, Any]:
        if rng.random() < 0.5:
            return {"do": "hold", "time": float(rng.uniform(0.3, 2.0)) * period}
        return {"do": "hold", "angle": float(rng.uniform(0.3, 2.0)) * period * target}

    def run(way: float) -> list[dict[str, Any]]:
        return [{"do": "start", **speed(way)}, hold(), {"do": "stop", **stop(way > 0)}]

    def turn() -> list[dict[str, Any]]:
        return [
            {"do": "start"}, hold(), {"do": "reverse", "set_speed": -0.8 * target}, hold(),
            {"do": "stop", **stop(False)},
        ]  # fmt: skip

    def jog(way: float) -> list[dict[str, Any]]:
        time = float(rng.uniform(0.7, 1.5)) * period
        jogs = {"do": "jog", "time": time, "set_speed": way * target, "repeat": int(rng.integers(1, 3))}
        return [{**jogs, **stop(way > 0)}]

    load = [{"do": "load"}]
    pause = [{"do": "hold", "time": float(rng.uniform(0.5, 2.0)) * period}]
    several = [
        [run(1.0), load, run(-1.0)],
        [turn(), pause, jog(1.0)],
        [run(1.0), jog(-1.0), load, jog(1.0)],
        [jog(1.0), run(-1.0), pause, run(1.0)],
    ]
    return several[int(rng.integers(len(several)))]


# ---- single cases ---------------------------------------------------------------------------------------


def given_of(J: list[float], c: list[float], d: list[float], gap: list[float], **changes: Any) -> Given:
    """Masses at rest in mid-gap, without loads and friction but for these changes."""
    n = len(J)
    fields: dict[str, Any] = {
        "J": J, "c": c, "d": d, "gap": gap, "Mc": np.zeros(n), "reactive": np.zeros(n, bool),
        "w0": np.zeros(n), "theta0": np.zeros(n - 1), "ground": np.zeros(n), "friction": np.zeros(n),
        "restitution": np.full(n - 1, math.nan), "efficiency": np.ones(n - 1), "gear": np.arange(n - 1),
    }  # fmt: skip
    arrays = {name: np.asarray(value) for name, value in (fields | changes).items() if name != "curves"}
    motor = int(arrays.pop("motor", 0))
    return Given(**arrays, law=["no-pull"] * (n - 1), tones=[], motor=motor, curves=changes.get("curves", {}))


def single_cases() -> dict[str, Case]:
    """What the random cases do not have: each with the part of the rules that it is about."""
    hoist = given_of(
        [0.19, 0.065], [3200.0], [4.0], [0.1], Mc=[0.0, 120.0], friction=[3.0, 6.0], ground=[0.0, 0.01],
        theta0=[0.05 + 120.0 / 3200.0],
    )  # fmt: skip
    up_and_down: list[dict[str, Any]] = [
        {"do": "start"}, {"do": "hold", "time": 0.15}, {"do": "stop", "by": "torque", "brake_speed": 4.0},
        {"do": "load", "Mc": 150.0, "J": 0.09}, {"do": "start", "set_speed": -20.0},
        {"do": "hold", "angle": 5.0}, {"do": "stop", "by": "torque", "braking_torque": 190.0},
        {"do": "load", "Mc": 120.0, "J": 0.065},
    ]  # fmt: skip
    # a crane's travel: the load turns the machine on, as wind does, and friction holds it
    wind = given_of(
        [0.035, 0.2], [368.0], [0.8], [0.3], Mc=[0.0, -3.0], friction=[0.6, 4.5], ground=[2e-3, 1e-3]
    )
    travel: list[dict[str, Any]] = [
        {"do": "start", "angle": 2.5}, {"do": "brake"}, {"do": "start", "set_speed": -18.0, "time": 0.4},
        {"do": "reverse", "set_speed": 21.0, "angle": 9.0}, {"do": "hold", "time": 0.2},
        {"do": "stop", "by": "torque", "brake_time": 0.05, "time": 2.5},
        {"do": "jog", "time": 0.1, "by": "torque", "braking_torque": 12.0},
        {"do": "load", "Mc": 3.0, "time": 0.35}, {"do": "start"}, {"do": "brake", "time": 1.5},
    ]  # fmt: skip
    # four masses, the motor on the second one, gears that lose on either side of their shafts
    geared = given_of(
        [0.4, 0.3, 0.5, 0.8], [900.0, 1500.0, 700.0], [4.0, 5.0, 4.0], [0.05, 0.0, 0.1], motor=1,
        Mc=[1.5, 0.0, 0.0, 6.0], reactive=[True, False, False, True], friction=[0.0, 1.0, 0.4, 0.0],
        efficiency=[0.9, 0.85, 0.95], gear=[0, 2, 2], ground=[0.01, 0.0, 0.02, 0.0],
        theta0=[0.01, 0.0, -0.02],
    )  # fmt: skip
    shift: list[dict[str, Any]] = [
        {"do": "start"}, {"do": "hold", "time": 0.6}, {"do": "stop", "by": "coast"},
        {"do": "load", "mass": 0, "Mc": 3.0, "J": 0.7}, {"do": "load", "J": 0.5},
        {"do": "start", "set_speed": -6.0}, {"do": "hold", "angle": 3.0}, {"do": "stop", "by": "torque"},
        {"do": "jog", "time": 0.25, "by": "brake", "repeat": 2},
    ]  # fmt: skip
    # a fan: a load curve over the speed brakes it
    curve = (np.array([0.0, 10.0, 20.0, 30.0]), np.array([0.0, 2.0, 8.0, 18.0]), False)
    fan = given_of([0.05, 0.3], [600.0], [1.0], [0.0], friction=[0.3, 1.2], curves={1: curve})
    blow: list[dict[str, Any]] = [
        {"do": "start", "set_speed": 24.0}, {"do": "hold", "time": 0.5}, {"do": "stop", "by": "coast"},
        {"do": "hold", "time": 0.1}, {"do": "start", "set_speed": 12.0}, {"do": "stop", "by": "torque"},
    ]  # fmt: skip
    return {
        "proving": Case(
            hoist, 250.0, 200.0, 0.02, 9000.0, 30.0, [(0.0, 150.0, 800.0), (0.125, 250.0)], up_and_down,
            260.0, 0.03, 0.04, proving=True,
        ),
        "travel": Case(
            wind, 40.0, 25.0, 0.0, math.inf, 24.0, [(0.0, 40.0)], travel, 15.0, 0.02, 0.03
        ),
        "dead-time": Case(
            wind, 40.0, 25.0, 0.004, 1500.0, 24.0, [(0.0, 20.0), (0.06, 40.0)], travel, 15.0, 0.02, 0.03,
            dead_time=0.007,
        ),
        "gears": Case(geared, 30.0, 24.0, 0.0, math.inf, 8.0, [(0.0, 30.0)], shift, 40.0, 0.0, 0.05),
        "fan": Case(fan, 26.0, 20.0, 0.003, math.inf, 30.0, [(0.0, 26.0)], blow),
    }  # fmt: skip
