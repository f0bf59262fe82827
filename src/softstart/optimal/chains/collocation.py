"""The optimum of a chain by an independent method: multi-phase collocation in a known order of contacts.

While no contact changes a chain is linear. Each such stretch is a phase of free length, in Radau collocation
of order 9; the demand is a continuous chain of straight lines, finer than that of the linear programs:

    minimise    P over lengths, demands u, states (theta, w, realised torque)
    subject to  x' = f(x, u) at all points; 0 <= side T <= P where a shaft presses, |theta| <= gap/2 where its
                gap is open; limits of torque and rate
                a phase ends where a flank is reached, a torque vanishes, or a load breaks away or stops
                and the terminal condition at start_time; one elastic period follows, as in `problem`

Only the order of contacts and a first guess come from a start found otherwise; neither the kernel nor its
sensitivities nor the linear programs have a part in it. Another order of contacts may be better or worse.
Where flanks overlap without torque (a damped shaft that lets go) nothing is asked of them: the exact replay
tells.

Method: L. T. Biegler, Nonlinear Programming, SIAM 2010, chapter 10.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.kernel.records import CONTACT, JOINED, OPEN, S_END, S_START
from softstart.optimal.chains.problem import ChainProblem, carried_loads
from softstart.optimal.collocation.search import QUIET, CasadiProblem
from softstart.optimal.collocation.transcription import Slot
from softstart.optimal.result import NotConverged
from softstart.profile import TorqueProfile
from softstart.start.run import Run

DEGREE = 5
STRIDE = 2.0  # rad of the fastest vibration in contact, or times the lag, that an element may span
ELEMENTS = 28  # at least, in an elastic period: twice the knots of the linear programs
MOST_PHASES = 120
LEAST = 1e-9  # of the start time: what is shorter is no phase
SHORTER, LONGER = 0.2, 5.0  # of its first guess: limits of the length of a phase
ASIDE = 1e-3  # of the target: what moves off from rest is not on a bound
SMOOTH = 1e-5  # weight of squared steps of the demand, in mean torques
OPTIONS = {**QUIET, "ipopt.tol": 1e-7, "ipopt.max_iter": 200}
NEAR = {"ipopt.mu_init": 1e-3, "ipopt.bound_push": 1e-4, "ipopt.bound_frac": 1e-4}  # from a start found
PATIENCE = 0.05  # s of processor time for each state

SX = Any  # casadi has no types


@dataclass(frozen=True)
class Phase:
    """A stretch without a change of contact, s; one entry for each shaft, or for each mass."""

    begin: float
    end: float
    pressing: tuple[int, ...]  # 1, -1: the flank; 2: a spring without a gap; 0: no torque
    kept_open: tuple[bool, ...]  # the gap is open throughout
    moving: tuple[float, ...]  # sign of the speed that friction opposes; 0: held

    @property
    def length(self) -> float:
        """How long it lasts, s."""
        return self.end - self.begin


def phases_of(problem: ChainProblem, run: Run) -> list[Phase]:
    """The phases of a start that reaches to one elastic period after the start time, which ends one too."""
    assert problem.start_time is not None
    recorded = run.recorded
    ends, modes = recorded.spans[:, [S_START, S_END]], recorded.of_shafts(1)[:-1]
    sides = np.where(modes == CONTACT, recorded.of_shafts(2)[:-1], 2.0 * (modes == JOINED)).astype(int)
    moving = np.where(problem.drive.at_motor_shaft().reactive, recorded.of_masses(1)[:-1], 1.0)
    found: list[Phase] = []
    if run.end_time < (problem.start_time + run.elastic_period) * (1.0 - LEAST):
        raise InputError(
            f"run: it ends at {run.end_time:.6g} s; give one to an elastic period after the start time."
        )
    parts = ((0.0, problem.start_time), (problem.start_time, problem.start_time + run.elastic_period))
    for begin, end in parts:
        own: list[Phase] = []
        for (a, b), side, mode, move in zip(ends.clip(begin, end), sides, modes, moving, strict=True):
            if b - a <= LEAST * end:
                continue
            one = Phase(a, b, tuple(side.tolist()), tuple((mode == OPEN).tolist()), tuple(move.tolist()))
            if own and _alike(own[-1], one):
                both = tuple(p and q for p, q in zip(own[-1].kept_open, one.kept_open, strict=True))
                own[-1] = replace(own[-1], end=b, kept_open=both)
            else:
                own.append(one)
        found += [*own[:-1], replace(own[-1], end=end)]
    return found


def _alike(a: Phase, b: Phase) -> bool:
    return (a.pressing, a.moving) == (b.pressing, b.moving)


def _refuse(problem: ChainProblem, phases: list[Phase]) -> None:
    arrays = problem.drive.at_motor_shaft()
    wrong = []
    if (arrays.efficiency != 1.0).any():
        wrong.append("efficiency: the collocation of chains has no gears with losses; leave confirm out.")
    if any(mass.curve is not None for mass in problem.drive.masses):
        wrong.append("curve_torque: the collocation of chains has no load curves; leave confirm out.")
    if "modelica" in arrays.law:
        wrong.append("contact_law = modelica: the collocation of chains has no-pull and dead-zone.")
    if len(phases) > MOST_PHASES:
        wrong.append(
            f"{len(phases)} phases of contact: the collocation of chains follows at most {MOST_PHASES}; "
            "damp the shafts."
        )
    if wrong:
        raise InputError(wrong)


@dataclass
class _Build:
    """Variables and conditions as they are added."""

    x: list[SX] = field(default_factory=list)
    x0: list[float] = field(default_factory=list)
    lbx: list[float] = field(default_factory=list)
    ubx: list[float] = field(default_factory=list)
    slots: list[Slot] = field(default_factory=list)
    g: list[SX] = field(default_factory=list)
    lbg: list[float] = field(default_factory=list)
    ubg: list[float] = field(default_factory=list)

    def variable(self, slot: Slot, guess: float, low: float = -math.inf, high: float = math.inf) -> SX:
        self.x.append(ca.SX.sym(f"{slot.kind}{len(self.x)}"))
        self.x0.append(min(max(guess, low), high))
        self.lbx.append(low)
        self.ubx.append(high)
        self.slots.append(slot)
        return self.x[-1]

    def between(self, low: float, value: SX, high: float) -> None:
        self.g.append(value)
        self.lbg.append(low)
        self.ubg.append(high)

    def zero(self, value: SX) -> None:
        self.between(0.0, value, 0.0)


class _Statement:
    """The chain in its units: base torque, target speed, overlap under the base torque or half of the gap."""

    def __init__(self, problem: ChainProblem) -> None:
        chain = problem.drive
        assert chain.motor is not None
        self.problem, self.arrays, self.motor = problem, chain.at_motor_shaft(), chain.motor
        self.joints, self.count = self.arrays.c.size, self.arrays.J.size
        self.half = 0.5 * self.arrays.gap
        self.base, self.target = problem.base_torque, problem.target
        self.lag, self.rate = float(self.motor.torque_lag), float(self.motor.torque_rate)
        self.low, self.high = problem.lowest_torque / self.base, problem.highest_torque / self.base

    def scales(self, phase: Phase) -> tuple[Vector, Vector]:
        """Origin and size of twists, speeds and realised torque in a phase, SI."""
        pressing = np.array(phase.pressing)
        zero = np.where(np.abs(pressing) == 1, pressing * self.half, 0.0)
        size = np.where((pressing != 0) | (self.half == 0.0), self.base / self.arrays.c, self.half)
        rest = self.count + 1
        return (
            np.concatenate([zero, np.zeros(rest)]),
            np.concatenate([size, np.full(self.count, self.target), [self.base]]),
        )

    def overlap(self, k: int, phase: Phase, x: list[SX]) -> SX:
        return x[k] - (phase.pressing[k] * self.half[k] if abs(phase.pressing[k]) == 1 else 0.0)

    def torque(self, k: int, flank: float, x: list[SX]) -> SX:
        """Spring and damper, c z + d z', at a flank, N m."""
        v = x[self.joints + k] - x[self.joints + k + 1]
        return self.arrays.c[k] * (x[k] - flank * self.half[k]) + self.arrays.d[k] * v

    def torques(self, phase: Phase, x: list[SX]) -> list[SX]:
        return [
            0.0 if not side else self.torque(k, side if abs(side) == 1 else 0.0, x)
            for k, side in enumerate(phase.pressing)
        ]

    def push(self, i: int, phase: Phase, x: list[SX], T: list[SX]) -> SX:
        """What acts on a mass, but for its reactive load, N m."""
        arrays, w = self.arrays, x[self.joints + i]
        total = -arrays.d_ground[i] * w - (0.0 if arrays.reactive[i] else arrays.Mc[i])
        total += x[-1] if i == arrays.motor else 0.0
        total += T[i - 1] if i > 0 else 0.0
        return total - (T[i] if i < self.joints else 0.0)

    def rates(self, phase: Phase, x: list[SX], u: SX) -> list[SX]:
        """The derivative of the state; without a lag its last component is the demand itself."""
        arrays, T = self.arrays, self.torques(phase, x)
        found = [x[self.joints + k] - x[self.joints + k + 1] for k in range(self.joints)]
        for i in range(self.count):
            held = math.isinf(arrays.J[i]) or (arrays.reactive[i] and phase.moving[i] == 0.0)
            friction = phase.moving[i] * arrays.Mc[i] if arrays.reactive[i] else 0.0
            found.append(0.0 if held else (self.push(i, phase, x, T) - friction) / arrays.J[i])
        return [*found, (u - x[-1]) / self.lag if self.lag else 0.0]

    def elements(self, phase: Phase, period: float) -> int:
        """How many elements of a phase."""
        arrays = self.arrays
        stiff = arrays.c * (1.0 / arrays.J[:-1] + 1.0 / arrays.J[1:])
        fastest = math.sqrt(max([0.0, *stiff[np.array(phase.pressing) != 0].tolist()]))
        if self.lag:
            fastest = max(fastest, 1.0 / self.lag)
        return max(2, math.ceil(phase.length * max(fastest / STRIDE, ELEMENTS / period)))

    def kept(self, build: _Build, phase: Phase, x: list[SX], peak: SX) -> None:
        """What holds at each point of a phase."""
        arrays, T = self.arrays, self.torques(phase, x)
        for k, side in enumerate(phase.pressing):
            if side:
                way = float(side) if abs(side) == 1 else 1.0
                pulls = abs(side) == 2 or arrays.law[k] == "dead-zone"
                build.between(-math.inf, way * T[k] / self.base - peak, 0.0)
                build.between(0.0, way * T[k] / self.base + (peak if pulls else 0.0), math.inf)
                if pulls and abs(side) == 1:
                    build.between(0.0, way * self.overlap(k, phase, x) * arrays.c[k] / self.base, math.inf)
            elif phase.kept_open[k]:
                build.between(-1.0, x[k] / self.half[k], 1.0)
        for i in range(self.count):
            w = x[self.joints + i]
            if arrays.reactive[i] and phase.moving[i]:
                build.between(-ASIDE, phase.moving[i] * w / self.target, math.inf)
            elif arrays.reactive[i] and arrays.Mc[i] > 0.0:
                build.between(-1.0, self.push(i, phase, x, T) / arrays.Mc[i], 1.0)

    def ends(self, phase: Phase, then: Phase, x: list[SX], twist: Vector) -> Iterator[SX]:
        """What vanishes where one phase becomes the next; `twist` is the guess there."""
        arrays = self.arrays
        for k, (now, next_) in enumerate(zip(phase.pressing, then.pressing, strict=True)):
            if now == next_:
                continue
            flank = now or next_
            overlap = flank * float(twist[k]) - self.half[k]
            reached = now == 0 and abs(overlap) < 1e-6 * max(self.half[k], self.base / arrays.c[k])
            if reached or arrays.law[k] == "dead-zone":
                yield (x[k] - flank * self.half[k]) * arrays.c[k] / self.base
            else:
                yield self.torque(k, flank, x) / self.base
        T = self.torques(phase, x)
        for i, (was, way) in enumerate(zip(phase.moving, then.moving, strict=True)):
            if was == way:
                continue
            if was == 0.0:
                yield (self.push(i, phase, x, T) - way * arrays.Mc[i]) / self.base
            else:
                yield x[self.joints + i] / self.target

    def terminal(self, build: _Build, phase: Phase, x: list[SX]) -> None:
        """What holds at the start time."""
        speeds = [x[self.joints + i] / self.target for i in range(self.count)]
        if self.problem.terminal == "reached":
            build.between(1.0, speeds[self.arrays.load], math.inf)
            return
        for one in speeds:
            build.zero(one - 1.0)
        if self.problem.terminal == "steady":
            for T, load in zip(self.torques(phase, x), carried_loads(self.problem), strict=True):
                if not isinstance(T, float):
                    build.zero((T - load) / self.base)


def as_casadi(problem: ChainProblem, run: Run, straight: bool = False) -> CasadiProblem:
    """The problem in the order of contacts of `run`; see `ChainProblem.casadi`.

    With `straight` the first guess has straight lines between the ends of the phases of `run`, and the mean
    torque of each; else its states and torques.
    """
    phases = phases_of(problem, run)
    _refuse(problem, phases)
    statement, build = _Statement(problem), _Build()
    joints, count, period = statement.joints, statement.count, run.elastic_period
    assert problem.start_time is not None
    points = [0.0, *ca.collocation_points(DEGREE, "radau")]
    C = np.array(ca.collocation_coeff(points[1:])[0])
    peak = build.variable(Slot("peak", 0, 0.0), run.k_dyn, 0.0)
    states = 1 + joints + count if statement.lag else joints + count
    arrays = statement.arrays
    state: list[SX] = [*arrays.theta0.tolist(), *arrays.w0.tolist(), statement.motor.initial_torque]
    first = statement.motor.initial_torque / statement.base
    demand = first if math.isfinite(statement.rate) else build.variable(
        Slot("demand", 0, 0.0), float(run.at(0.0)["u"]) / statement.base, statement.low, statement.high
    )  # fmt: skip
    knots, widths, lengths = [demand], [], []
    for number, phase in enumerate(phases):
        share = build.variable(Slot("duration", number, 0.0), 1.0, SHORTER, LONGER)
        lengths.append(share * phase.length)
        elements = statement.elements(phase, period)
        zero, size = statement.scales(phase)
        guess = _guess(run, phase, elements, points, straight)
        for element in range(elements):
            h = lengths[-1] / elements
            after = build.variable(
                Slot("demand", number, (element + 1) / elements),
                guess[2][element] / statement.base, statement.low, statement.high,
            )  # fmt: skip
            if math.isfinite(statement.rate):
                most = statement.rate * period / statement.base  # scaled by the period
                build.between(-math.inf, after - demand - most * h / period, 0.0)
                build.between(0.0, after - demand + most * h / period, math.inf)
            inner = []
            for j in range(1, DEGREE + 1):
                at = guess[1][element * DEGREE + j - 1]
                u = statement.base * (demand + points[j] * (after - demand))
                scaled = [
                    build.variable(
                        Slot("state", number, (element + points[j]) / elements, one),
                        (at[one] - zero[one]) / size[one],
                    )
                    for one in range(states)
                ]
                whole = [zero[one] + size[one] * value for one, value in enumerate(scaled)]
                inner.append(whole if statement.lag else [*whole, u])
                statement.kept(build, phase, inner[-1], peak)
            every = [state, *inner]
            for j in range(1, DEGREE + 1):
                u = statement.base * (demand + points[j] * (after - demand))
                slope = statement.rates(phase, inner[j - 1], u)
                for one in range(states):
                    moved = sum(float(C[m, j - 1]) * (every[m][one] - zero[one]) for m in range(DEGREE + 1))
                    build.zero((moved - h * slope[one]) / size[one])
            state, demand = inner[-1], after
            knots.append(after)
            widths.append(h)
        if phase.end == problem.start_time:
            statement.terminal(build, phase, state)
            build.zero(sum(lengths) / problem.start_time - 1.0)
        elif number + 1 < len(phases):
            for vanishes in statement.ends(phase, phases[number + 1], state, run.at(phase.end)["twist"]):
                build.zero(vanishes)
    build.zero(sum(lengths) / (problem.start_time + period) - 1.0)
    x = ca.vertcat(*build.x)
    read = ca.Function("read", [x], [ca.vertcat(*widths), ca.vertcat(*knots)])
    base = statement.base

    def reading(values: Vector) -> tuple[TorqueProfile, float]:
        lasting, torque = (np.array(one).ravel() for one in read(values))
        when = np.concatenate([[0.0], np.cumsum(lasting)])
        low, high = problem.lowest_torque, problem.highest_torque
        return TorqueProfile(when, np.clip(base * torque, low, high)), base * float(values[0])

    # torques that do not matter, as those after the start, have one value
    smoothed = peak + SMOOTH * sum((b - a) ** 2 for a, b in pairwise(knots))
    nlp = {"x": x, "p": ca.SX.sym("p", 0), "f": smoothed, "g": ca.vertcat(*build.g)}
    lbx, ubx, lbg, ubg = (np.array(one) for one in (build.lbx, build.ubx, build.lbg, build.ubg))
    return CasadiProblem(
        problem, nlp, np.array(build.x0), np.zeros(0), lbx, ubx, lbg, ubg, tuple(build.slots), reading
    )


def _guess(run: Run, phase: Phase, elements: int, points: list[float], straight: bool) -> Any:
    """Instants, states there (twists, speeds, realised torque), demands at the ends of elements."""
    shares = ((np.arange(elements)[:, None] + np.array(points[1:])) / elements).ravel()
    times = np.minimum(phase.begin + phase.length * shares, run.end_time)
    ends = np.minimum(phase.begin + phase.length * np.arange(1, elements + 1) / elements, run.end_time)

    def states(when: Vector) -> Vector:
        found = run.at(np.minimum(when, run.end_time))
        return np.concatenate([found["twist"], found["w"], found["u"][:, None]], axis=1)

    if not straight:
        return times, states(times), states(ends)[:, -1]
    a, b = states(np.array([phase.begin, phase.end]))
    mean = float(states(times)[:, -1].mean())
    rows = a + shares[:, None] * (b - a)
    rows[:, -1] = mean
    return times, rows, np.full(elements, mean)


def solve(problem: ChainProblem, run: Run, straight: bool = False) -> tuple[TorqueProfile, float]:
    """The demand of the least peak torque in the order of contacts of `run`, and that K_dyn as claimed.

    Raises
    ------
    InputError
        For chains that the collocation does not cover, and more phases than it follows.
    NotConverged
        Where IPOPT finds no solution.
    """
    one = as_casadi(problem, run, straight)
    count = sum(slot.kind == "state" for slot in one.slots)
    options: dict[str, Any] = {
        **OPTIONS,
        **({} if straight else NEAR),
        "ipopt.max_cpu_time": max(60.0, PATIENCE * count),
    }
    solver = ca.nlpsol("chain", "ipopt", one.nlp, options)
    try:
        out = solver(x0=one.x0, p=one.p, lbx=one.lbx, ubx=one.ubx, lbg=one.lbg, ubg=one.ubg)
    except RuntimeError as error:
        if "KeyboardInterrupt" in str(error):
            raise KeyboardInterrupt from error
        raise
    stats, g = solver.stats(), np.array(out["g"]).ravel()
    if not stats["success"]:
        violation = float(np.maximum(one.lbg - g, g - one.ubg).max(initial=0.0))
        raise NotConverged(str(stats["return_status"]), violation)
    return one.profile(out["x"]), one.k_dyn(out["x"])
