"""An optimal start as one nonlinear program of CasADi: N masses, the phases of contact in the order of a run.

Between two changes of contact a machine is linear. Each such stretch is a phase of free duration, in Radau
collocation of order 9, and the torque demand u is a chain of straight lines, continuous within a phase:

    minimise    P/M12avg_base, or the heat, or t_f; + smoothness * integral of (du/dt)^2/Ms^2
    over        the peak P, the durations of the phases, the demand u, the states (twists, speeds[, torque])
    subject to  J_i w_i' = T_(i-1) - T_i - loads (+ M at the motor, 0 while held),  twist_k' = w_k - w_(k+1)
                T_k = c z + d z' where flanks press, else 0;  lag M' = u - M, or M = u without a lag
                lowest <= u <= highest, |du/dt| <= rate, M <= lines of the torque-speed curve at w_motor
                |T_k| <= P;  T_k >= 0 on a flank (no-pull) or z >= 0 (dead-zone);  |twist_k| <= gap/2 if open
                |torque on it| <= Mc on a load that sticks;  sign * w >= 0 while it moves
    a phase     ends where a flank is reached (z = 0), a torque vanishes, a load sticks (w = 0) or breaks away
                (torque on it = Mc), or the brake is released (at its time; by torque proving at M = T)
    and at t_f  reached: w_load >= target; synchronous: all w = target; steady: also T_k = the loads behind it
                t_f <= start_time, K_dyn <= k_dyn, integral of (M/Ms)^2 from 0 to t_f <= heat

After t_f follows one elastic period in which the same holds but the terminal condition, and P counts. The
order of contacts and a first guess come from a run; another order may be better or worse. Where flanks
overlap without torque (a damped shaft that lets go) nothing is asked of them: the exact replay tells.

Method: L. T. Biegler, Nonlinear Programming, SIAM 2010, chapter 10.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import casadi
import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.errors import InputError
from softstart.kernel import records as rec
from softstart.optimal.problem import Problem
from softstart.optimal.result import NotConverged
from softstart.optimal.starts import parts, steady_shaft_torques
from softstart.profile import TorqueProfile
from softstart.start.run import Run

ca: Any = casadi

DEGREE = 5
LEAST = 1e-9  # of the start time: what is shorter is no phase
OPTIONS = {
    "ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "error_on_fail": False, "ipopt.tol": 1e-7,
    "ipopt.max_iter": 200, "ipopt.max_cpu_time": 120.0, "ipopt.acceptable_tol": 1e-3,
    "ipopt.acceptable_iter": 8, "ipopt.acceptable_constr_viol_tol": 1e-8,
    "ipopt.acceptable_obj_change_tol": 1e-6,
    "ipopt.option_file_name": "",  # else IPOPT reads ipopt.opt of the current folder, whoever wrote it
}  # fmt: skip
NEAR = {"ipopt.mu_strategy": "adaptive", "ipopt.bound_push": 1e-4, "ipopt.bound_frac": 1e-4}

SX = Any  # casadi has no types: a matrix of expressions, a column for each instant


class PhaseTable(NamedTuple):
    """A phase in numbers: its duration, s; states at shares of it; demands, N m, at edges of elements."""

    length: float
    shares: Vector
    states: Matrix
    edges: Vector
    demands: Vector


@dataclass(frozen=True)
class CollocationSolution:
    """A start as the collocation has it."""

    profile: TorqueProfile  # the demand to one elastic period after t_f
    value: float  # the figure that is minimised
    end_time: float  # t_f, s
    peak: float  # the largest |T|, N m
    phases: list[PhaseTable]


@dataclass(frozen=True, eq=False)
class CasadiProblem:
    """The problem as one nonlinear program of CasADi, f least over x with lbx <= x <= ubx, lbg <= g <= ubg.

    `nlp` has the symbols x (n,), f and g (m,) for `casadi.nlpsol`; the solver is called with `arguments`: the
    first guess x0 and the bounds. Torques are in units of the base torque, speeds of the target speed,
    durations of their first guess, twists of the base torque over the stiffness in contact and of gap/2 in
    the gap: x and g are of the order of 1. Ordered along the start: peak P, then for each phase its duration,
    its demands at the edges of its elements, and its states at five Radau points of each element. dg/dx is
    banded with elements, but for the full column of P and those of the durations; the Hessian alike.
    """

    nlp: dict[str, Any]
    arguments: dict[str, Vector]
    reading: Callable[[Vector], CollocationSolution]

    def solution(self, x: Any) -> CollocationSolution:
        """What a solution x (n,) of `nlpsol` says, by its own collocation; a simulation of it is exact."""
        values, size = np.array(x, dtype=float).ravel(), self.arguments["x0"].size
        if values.size != size:
            raise InputError(f"x: {values.size} numbers; give the {size} of nlpsol's out['x'].")
        return self.reading(values)


@dataclass(frozen=True, eq=False)
class ContactPhase:
    """A stretch without a change of contact, s; one entry for each shaft, or for each mass."""

    begin: float
    end: float
    pressing: tuple[int, ...]  # 1, -1: the flank; 2: a spring without a gap; 0: no torque
    moving: tuple[int, ...]  # sign of the speed that friction opposes; 0: held
    braked: bool  # the brake holds the motor
    kept_open: NDArray[np.bool_]  # the gap is open throughout
    open_at_end: NDArray[np.bool_]
    last: bool = False  # it ends at t_f

    @property
    def length(self) -> float:
        """How long it lasts in the run, s."""
        return self.end - self.begin


def phases_of(problem: Problem, run: Run) -> list[ContactPhase]:
    """The phases of a run: to t_f, and to one elastic period after it."""
    t_f, first = problem.start_time, run.start_time
    if math.isnan(first):  # the speed comes to its target from below
        first = run.end_time - run.elastic_period
    if t_f is None or (problem.minimise != "k_dyn" and first < t_f):
        t_f = first
    if not run.end_time >= (t_f + run.elastic_period) * (1.0 - LEAST):
        raise InputError(
            f"run: it ends at {run.end_time:.6g} s; give one to an elastic period after the start time."
        )
    trajectory, phases = run.trajectory, list[ContactPhase]()
    times, modes = trajectory.spans[:, [rec.S_START, rec.S_END]], trajectory.of_shafts("mode")[:-1]
    flanks, joined = trajectory.of_shafts("side")[:-1], 2.0 * (modes == rec.JOINED)
    sides = np.where(modes == rec.CONTACT, flanks, joined).astype(int)
    moving = trajectory.of_masses("direction")[:-1].astype(int)
    braked = trajectory.spans[:, rec.S_BRAKED] != 0.0
    kinds = list(zip(map(tuple, sides.tolist()), map(tuple, moving.tolist()), braked.tolist(), strict=True))
    for begin, end in ((0.0, t_f), (t_f, t_f + run.elastic_period)):
        lasting = np.flatnonzero(np.diff(times.clip(begin, end))[:, 0] > LEAST * end).tolist()
        for kind, group in groupby(lasting, key=kinds.__getitem__):
            spans = list(group)
            reached, is_open = phases[-1].end if phases else 0.0, modes[spans] == rec.OPEN
            until = min(float(times[spans[-1], 1]), end)
            phases.append(ContactPhase(reached, until, *kind, is_open.all(axis=0), is_open[-1]))
        phases[-1] = replace(phases[-1], end=end, last=end == t_f)
    return phases


class _Machine:
    """The equations of a machine, from the rows of the kernel; SI units at the motor shaft."""

    def __init__(self, problem: Problem) -> None:
        rows, mass, shaft = parts(problem.drive)
        given = rows.machine
        self.J, self.ground, self.load_torque = mass["J"], mass["ground"], mass["active"] + mass["mean"]
        self.hold = mass["Mc"] + mass["friction"]
        self.c, self.d, self.half, self.law = shaft["c"], shaft["d"], shaft["half_gap"], shaft["law"]
        self.motor, self.load, self.Ms = int(given.motor), int(given.load), problem.starting_torque
        self.lag, self.rate, self.release_at = float(given.lag), float(given.rate), float(given.release_at)
        self.first_torque = [float(given.initial_torque)]
        self.first = [*shaft["theta0"], *mass["w0"], *self.first_torque * bool(self.lag)]
        self.masses, self.shafts, self.carried = mass.size, shaft.size, steady_shaft_torques(rows)
        self.at_motor = ca.DM(np.eye(self.masses)[self.motor])
        self.not_covered = {
            "efficiency: no gears with losses": (shaft["eta"] != 1.0).any(),
            "stiffness: no rigid shafts": shaft["rigid"].any(),
            "curve_torque: no load curves": rows.curves.size > 0,
            "contact_law = modelica: no-pull and dead-zone": (self.d[self.law == rec.MODELICA] > 0.0).any(),
        }

    def split(self, x: SX, u: SX) -> tuple[SX, SX, SX]:
        """Twists, speeds, realised torque of states x under the demand u."""
        k, n = self.shafts, self.shafts + self.masses
        return x[:k, :], x[k:n, :], x[n, :] if self.lag else u

    def flanks(self, phase: ContactPhase) -> Vector:
        """The twists at which the flanks that press begin to, rad."""
        return np.where(np.abs(phase.pressing) == 1, phase.pressing * self.half, 0.0)

    def torques(self, phase: ContactPhase, x: SX) -> SX:
        """T = c z + d z' of the shafts that press, N m."""
        twist, w, _ = self.split(x, 0.0)
        pressing = np.array(phase.pressing) != 0
        return pressing * self.c * (twist - self.flanks(phase)) + pressing * self.d * (w[:-1, :] - w[1:, :])

    def push(self, phase: ContactPhase, x: SX, u: SX) -> SX:
        """T_(i-1) - T_i - loads (+ M at the motor), N m: the torque on each mass but friction and brake."""
        _, w, M = self.split(x, u)
        T, none = self.torques(phase, x), ca.DM.zeros(1, x.shape[1])
        shafts = ca.vertcat(none, T) - ca.vertcat(T, none)
        return ca.mtimes(self.at_motor, M) + shafts - self.ground * w - self.load_torque

    def slopes(self, phase: ContactPhase, x: SX, u: SX) -> SX:
        """The derivatives x' = f(x, u)."""
        _, w, M = self.split(x, u)
        moving = np.array(phase.moving)
        held = np.isinf(self.J) | ((self.hold > 0.0) & (moving == 0))
        held[self.motor] |= phase.braked
        push = self.push(phase, x, u) - moving * self.hold
        slopes = [w[:-1, :] - w[1:, :], np.where(held, 0.0, 1.0 / self.J) * push]
        return ca.vertcat(*slopes, (u - M) / self.lag) if self.lag else ca.vertcat(*slopes)


class _Program:
    """Variables and conditions, as the phases are written down; demands and P in base torques."""

    def __init__(self, problem: Problem, run: Run) -> None:
        self.problem, self.machine, self.run = problem, _Machine(problem), run
        self.phases, self.period = phases_of(problem, run), run.elastic_period
        self.base, self.target = problem.base_torque, problem.target
        self.low, self.high = problem.lowest_torque / self.base, problem.highest_torque / self.base
        self.continuous = math.isfinite(self.machine.rate) or problem.smoothness > 0.0
        points = ca.collocation_points(DEGREE, "radau")
        self.points = np.array(points)
        self.derivative, _, self.weights = (np.array(one) for one in ca.collocation_coeff(points))
        count = len(self.phases)
        wrong = self.machine.not_covered | {f"{count} phases of contact: at most 120": count > 120}
        if any(wrong.values()):
            raise InputError([f"{text} in the collocation." for text, is_so in wrong.items() if is_so])

    def variable(self, name: str, guess: Any, low: float, high: float) -> SX:
        """A column of as many variables as the guess has."""
        guesses = np.ravel(guess).tolist()
        self.x.append(ca.SX.sym(name, len(guesses)))
        self.limits += [(min(max(one, low), high), low, high) for one in guesses]
        return self.x[-1]

    def between(self, low: float, value: SX, high: float) -> None:
        """Low <= value <= high for each element of a matrix."""
        self.g.append(ca.vec(value))
        self.bounds += [(low, high)] * value.numel()

    def write(self, mesh: list[Vector], guesses: list[PhaseTable], peak: float) -> CasadiProblem:
        """The program on a mesh, the edges of the elements of each phase as shares of it; P in N m."""
        self.x, self.limits = list[SX](), list[tuple[float, float, float]]()
        self.g, self.bounds = list[SX](), list[tuple[float, float]]()
        self.read = list[SX]()  # durations, demands and states of each phase
        most = math.inf if self.problem.k_dyn is None else self.problem.k_dyn
        self.peak = self.variable("peak", peak / self.base, 0.0, most)
        self.elapsed, self.heat, self.rough, self.steps = (ca.SX(0.0) for _ in range(4))
        self.state, self.demand = ca.SX(self.machine.first), ca.SX(self.machine.first_torque) / self.base
        for number, (edges, guess) in enumerate(zip(mesh, guesses, strict=True)):
            self.phase(number, edges, guess)
            if self.phases[number].last:
                self.terminal(self.phases[number])
                t_f, rough = self.elapsed, self.rough
                value = {"k_dyn": self.peak, "heat": self.heat, "start_time": t_f}[self.problem.minimise]
        self.between(0.0, (self.elapsed - t_f) / self.period - 1.0, 0.0)
        # torques after the start and a P that do not matter get one value
        f = value + self.problem.smoothness * rough if self.problem.smoothness else value
        f = f / (1.0 if self.problem.minimise == "k_dyn" else self.period)
        return self.finished(f + 1e-5 * (self.steps + self.peak), value, t_f, mesh)

    def phase(self, number: int, edges: Vector, guess: PhaseTable) -> None:
        """The states x' = f(x, u) at the Radau points of a phase; what holds there and at its end."""
        machine, phase, widths = self.machine, self.phases[number], np.diff(edges)
        then = self.phases[number + 1] if number + 1 < len(self.phases) else phase
        waits = phase.braked and not self.continuous and not machine.lag and math.isinf(machine.release_at)
        shortest = 0.0 if waits else 0.1  # of the duration in the run
        share = guess.length / phase.length
        length = self.variable("duration", share, shortest, 8.0) * phase.length
        kept = int(self.continuous)  # where it may not jump, the demand goes on
        demands = np.interp(edges, guess.edges, guess.demands)[kept:] / self.base
        u = self.variable("demand", demands, self.low, self.high)
        u = ca.vertcat(self.demand, u).T if kept else u.T
        zero, size = self.scales(phase)
        shares = self.shares(edges)
        states = np.transpose([np.interp(shares, guess.shares, column) for column in guess.states.T])
        scaled = self.variable("state", (states - zero) / size, -math.inf, math.inf)
        x = zero + size * ca.reshape(scaled, size.size, -1)
        rise = u[1:] - u[:-1]
        demand = self.base * ca.vertcat(*(u[:-1] + p * rise for p in self.points))
        demand = ca.reshape(demand, 1, -1)  # one for each point, as x
        nodes = [x[:, j::DEGREE] for j in range(DEGREE)]
        nodes = [ca.horzcat(self.state, nodes[-1][:, :-1]), *nodes]
        moves = length * ca.mtimes(machine.slopes(phase, x, demand), ca.diag(np.repeat(widths, DEGREE)))
        for j in range(DEGREE):
            moved = sum(self.derivative[m, j] * node for m, node in enumerate(nodes))
            self.between(0.0, (moved - moves[:, j::DEGREE]) / size, 0.0)
        M = machine.split(x, demand)[2] / machine.Ms
        self.heat += length * ca.mtimes(M**2, ca.DM(np.kron(widths, self.weights.ravel())))
        self.rough += (self.base / machine.Ms) ** 2 * ca.mtimes(rise**2, ca.DM(1.0 / widths)) / length
        self.steps += ca.sumsqr(rise)
        if math.isfinite(machine.rate):
            most = machine.rate / self.base * length * ca.DM(widths).T
            self.between(-math.inf, ca.horzcat(rise - most, -rise - most), 0.0)
        self.curve(ca.horzcat(self.state, x), ca.horzcat(self.base * u[0], demand))
        self.kept(phase, then, x, demand)
        self.read += [length, self.base * u.T, x.T]
        self.elapsed, self.demand, self.state = self.elapsed + length, u[-1], x[:, -1]
        self.change(phase, then, demand[-1])

    def shares(self, edges: Vector) -> Vector:
        """The Radau points of elements, as shares of their phase."""
        return np.asarray((edges[:-1, None] + np.diff(edges)[:, None] * self.points).ravel())

    def scales(self, phase: ContactPhase) -> tuple[Vector, Vector]:
        """Origin and size of twists, speeds and realised torque in a phase, SI."""
        machine, pressing = self.machine, np.array(phase.pressing)
        twists = np.where((pressing != 0) | (machine.half == 0.0), self.base / machine.c, machine.half)
        rest = [self.target] * machine.masses + [self.base] * bool(machine.lag)
        return np.append(machine.flanks(phase), np.zeros(len(rest))), np.append(twists, rest)

    def curve(self, x: SX, demand: SX) -> None:
        """M below each line of the torque-speed curve; the lowest torque can be had at any speed."""
        _, w, M = self.machine.split(x, demand)
        for (speed, torque), (next_speed, next_torque) in pairwise(self.problem.torque_speed):
            incline = (next_torque - torque) / (next_speed - speed)
            line = ca.fmax(torque + incline * (w[self.machine.motor, :] - speed), self.low * self.base)
            self.between(-math.inf, (M - line) / self.base, 0.0)

    def kept(self, phase: ContactPhase, then: ContactPhase, x: SX, u: SX) -> None:
        """What holds in a phase; at its end not for what changes there (`then` follows)."""
        machine, points = self.machine, x.shape[1]
        twist, w, _ = machine.split(x, u)
        T, push = machine.torques(phase, x) / self.base, machine.push(phase, x, u)
        for k, (side, next_side) in enumerate(zip(phase.pressing, then.pressing, strict=True)):
            inner = slice(points if side == next_side else points - 1)
            if side:
                pressed = np.sign(side) * T[k, inner]
                pulls = abs(side) == 2 or machine.law[k] == rec.DEAD_ZONE
                self.between(-math.inf, pressed - self.peak, 0.0)
                self.between(0.0, pressed + self.peak if pulls else pressed, math.inf)
                if abs(side) == 1 and pulls:
                    overlap = side * twist[k, inner] - machine.half[k]
                    self.between(0.0, overlap * machine.c[k] / self.base, math.inf)
            elif phase.kept_open[k]:
                self.between(-1.0, twist[k, inner] / machine.half[k], 1.0)
        for i in np.flatnonzero(machine.hold > 0.0).tolist():
            inner = slice(points if phase.moving[i] == then.moving[i] else points - 1)
            if phase.moving[i]:
                self.between(-1e-3, phase.moving[i] * w[i, inner] / self.target, math.inf)  # off rest
            elif i != machine.motor or not phase.braked:
                self.between(-1.0, push[i, inner] / machine.hold[i], 1.0)
        if phase.braked and math.isinf(machine.release_at):
            inner = slice(points if then.braked else points - 1)
            self.between(-math.inf, push[machine.motor, inner] / self.base, 0.0)

    def change(self, phase: ContactPhase, then: ContactPhase, u: SX) -> None:
        """What vanishes where one phase becomes the next; at an impact T of a damped shaft jumps."""
        machine, base, x = self.machine, self.base, self.state
        push, struck = machine.push(phase, x, u) / base, set()
        if phase.braked and not then.braked:
            late = (self.elapsed - machine.release_at) / self.period
            self.between(0.0, push[machine.motor] if math.isinf(machine.release_at) else late, 0.0)
        for k, (side, next_side) in enumerate(zip(phase.pressing, then.pressing, strict=True)):
            T = machine.torques(then if next_side else phase, x)[k] / base
            closes = next_side and phase.open_at_end[k]
            if side != next_side and (machine.law[k] == rec.DEAD_ZONE or closes):
                self.between(0.0, (x[k] - (side or next_side) * machine.half[k]) * machine.c[k] / base, 0.0)
            elif side != next_side:
                self.between(0.0, T, 0.0)
            if side != next_side and next_side and machine.d[k] > 0.0:
                struck |= {k, k + 1}
                self.between(-math.inf, next_side * T - self.peak, 0.0)
        for i, (sign, next_sign) in enumerate(zip(phase.moving, then.moving, strict=True)):
            if sign == next_sign or (i == machine.motor and phase.braked):
                continue
            if sign:
                self.between(0.0, x[machine.shafts + i] / self.target, 0.0)
            elif i in struck:  # it moves at once
                moves = next_sign * machine.push(then, x, u)[i] - machine.hold[i]
                self.between(0.0, moves / base, math.inf)
            else:
                self.between(0.0, push[i] - next_sign * machine.hold[i] / base, 0.0)

    def terminal(self, phase: ContactPhase) -> None:
        """What holds at t_f, and the bounds on t_f and heat."""
        machine, problem = self.machine, self.problem
        _, w, _ = machine.split(self.state, 0.0)
        if problem.terminal == "reached":
            self.between(1.0, w[machine.load] / self.target, math.inf)
        else:
            self.between(0.0, w / self.target - 1.0, 0.0)
        if problem.terminal == "steady":
            missing = (machine.torques(phase, self.state) - machine.carried) / self.base
            self.between(0.0, missing[np.flatnonzero(phase.pressing).tolist()], 0.0)
        if problem.start_time is not None:
            self.between(-math.inf, self.elapsed / problem.start_time, 1.0)
        if problem.heat is not None:
            self.between(-math.inf, self.heat / problem.heat, 1.0)

    def finished(self, f: SX, value: SX, t_f: SX, mesh: list[Vector]) -> CasadiProblem:
        """All of it, and how to read a solution."""
        problem, x = self.problem, ca.vertcat(*self.x)
        read = ca.Function("read", [x], [self.base * self.peak, value, t_f, *self.read])

        def reading(values: Vector) -> CollocationSolution:
            (peak, figure, end), rest = np.split(np.array(read(values), dtype=object), [3])
            phases, times, begin = [], [], 0.0
            for edges, (length, u, x) in zip(mesh, rest.reshape(-1, 3), strict=True):
                demands = np.array(u).ravel().clip(problem.lowest_torque, problem.highest_torque)
                phases.append(PhaseTable(float(length), self.shares(edges), np.array(x), edges, demands))
                times.append(begin + float(length) * edges)
                begin = times[-1][-1]
            profile = TorqueProfile(np.concatenate(times), np.concatenate([one.demands for one in phases]))
            return CollocationSolution(profile, float(figure), float(end), float(peak), phases)

        nlp = {"x": x, "f": f, "g": ca.vertcat(*self.g)}
        (x0, lbx, ubx), (lbg, ubg) = np.array(self.limits).T, np.array(self.bounds).T
        return CasadiProblem(nlp, {"x0": x0, "lbx": lbx, "ubx": ubx, "lbg": lbg, "ubg": ubg}, reading)

    def from_run(self, straight: bool) -> CasadiProblem:
        """The program on elements of equal length in each phase, from the states and demands of the run."""
        machine, run, mesh, guesses = self.machine, self.run, [], []
        stiffness = machine.c * (1.0 / machine.J[:-1] + 1.0 / machine.J[1:])
        for phase in self.phases:
            fastest = math.sqrt(stiffness[np.array(phase.pressing) != 0].max(initial=0.0))
            # an element spans 3 rad of the fastest vibration in contact, and a 16th of an elastic period
            count = math.ceil(phase.length * max(fastest / 3.0, 16.0 / self.period))
            edges = np.linspace(0.0, 1.0, 1 + max(2, count))
            inside = phase.begin + phase.length * edges.clip(LEAST, 1.0 - LEAST)
            span = run.trajectory.spans[run.trajectory.index(inside)]
            demands = span[:, rec.S_REF] + span[:, rec.S_SLOPE] * (inside - span[:, rec.S_START])
            shares = np.array([0.0, 1.0]) if straight else self.shares(edges)
            values = run.trajectory.at(phase.begin + phase.length * shares)
            states = [values["twist"], values["w"], *[values["u"][:, None]] * bool(machine.lag)]
            demands = np.full(edges.size, demands.mean()) if straight else demands
            guesses.append(PhaseTable(phase.length, shares, np.concatenate(states, axis=1), edges, demands))
            mesh.append(edges)
        return self.write(mesh, guesses, run.peak_torque)


def _halved(phase: PhaseTable, span: float, rate: float) -> Vector:
    """The edges, and one more in each element beside a bend of the demand by a fifth of its `span`."""
    widths = np.diff(phase.edges)
    slopes, steepest = np.diff(phase.demands) / (widths * phase.length), span / (widths * phase.length)
    bent = np.abs(np.diff(slopes)) > 0.2 * np.minimum(rate, np.maximum(steepest[1:], steepest[:-1]))
    beside = np.append(bent, False) | np.append(False, bent)
    return np.sort(np.append(phase.edges, (phase.edges[:-1] + 0.5 * widths)[beside]))


def as_casadi(problem: Problem, run: Run, straight: bool = False) -> CasadiProblem:
    """The problem in the order of contacts of `run` as one nonlinear program of CasADi.

    `run` is one of this machine under any torque, to one elastic period after its start time. The first guess
    has its states and torques; with `straight`, straight lines between the ends of its phases and mean
    torques. InputError for gears with losses, load curves, rigid shafts, damping with contact_law modelica,
    more than 120 phases, and a run that ends too early.

    >>> from softstart import Drive, TorqueProfile, simulate
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> pulse = TorqueProfile([0.0, 0.0076, 0.0076, 0.0217, 0.0217], [62.0, 62.0, 0.0, 0.0, 56.2])
    >>> run = simulate(drive, "profile", 0.4, parameters={"profile": pulse})
    >>> nlp = as_casadi(Problem(drive, 0.2883042), run)
    >>> nlp.nlp["x"].shape == (nlp.arguments["x0"].size, 1)
    True
    """
    return _Program(problem, run).from_run(straight)


def solve_collocation(problem: Problem, run: Run, straight: bool = False) -> CollocationSolution:
    """The best start in the order of contacts of `run` by IPOPT; elements beside jumps are then halved.

    Raises InputError as `as_casadi`, and NotConverged where IPOPT finds no solution on the first mesh.
    """
    program = _Program(problem, run)
    nlp = program.from_run(straight)
    best = nlp.reading(_minimised(nlp, {} if straight else NEAR))
    span = problem.highest_torque - problem.lowest_torque
    for _ in range(3):
        mesh = [_halved(phase, span, program.machine.rate) for phase in best.phases]
        nlp = program.write(mesh, best.phases, best.peak)
        try:
            coarser, best = best, nlp.reading(_minimised(nlp, NEAR | {"ipopt.max_iter": 100}))
        except NotConverged:  # the coarser one is a solution too
            break
        if abs(best.value - coarser.value) <= 2e-4 * coarser.value:  # finer elements are not needed
            break
    return best


def _minimised(nlp: CasadiProblem, options: dict[str, Any]) -> Vector:
    """The solution of IPOPT from the first guess; NotConverged if there is none."""
    solver = ca.nlpsol("start", "ipopt", nlp.nlp, OPTIONS | options)
    try:
        out = solver(**nlp.arguments)
    except RuntimeError as error:
        if "KeyboardInterrupt" in str(error):
            raise KeyboardInterrupt from error
        raise
    stats, g = solver.stats(), np.array(out["g"]).ravel()
    if not stats["success"]:
        low, high = nlp.arguments["lbg"], nlp.arguments["ubg"]
        violation = float(np.maximum(low - g, g - high).max(initial=0.0))
        raise NotConverged(str(stats["return_status"]), violation)
    return np.array(out["x"]).ravel()
