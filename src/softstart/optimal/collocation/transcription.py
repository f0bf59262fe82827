"""The statement as a nonlinear program: Legendre collocation of degree 3, arcs of free duration.

An arc is cut into intervals at fixed shares of its duration. Within an interval the state is a cubic through
its beginning and three Gauss points, where it obeys the dynamics; all intervals of a kind share one function,
so that a finer mesh is quickly written down. Bounds and scales are expressions of the parameters, so that one
program, once built, serves every drive, start time and bound that lead to the same phases: a warm start needs
that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.optimal.collocation import statement
from softstart.optimal.collocation.program import Numbers, Phase, Program
from softstart.optimal.collocation.statement import INFINITY, Condition, State

SX = Any  # casadi has no types

TAIL_POINTS = 128


def tail_rows(program: Program, p: Numbers) -> Matrix:
    """Rows (z, v, w2[, u], demand, 1) that give T at `TAIL_POINTS` instants after t_f.

    Coasting, the first peak comes within half an elastic period; a lag delays it. Holding is watched for a
    whole one.
    """
    if not program.tail:
        return np.zeros((0, (4 if program.lagged else 3) + 2))
    period = 2.0 * math.pi / p.Omega
    length = period if program.tail == "hold" else 0.5 * period + 5.0 * p.lag
    length = min(length, 1.5 * period)
    # y = (z, v, u, demand, 1), y' = A y
    inverse = 1.0 / p.J1 + 1.0 / p.J2
    drive_by_demand = not program.lagged
    A = np.zeros((5, 5))
    A[0, 1] = 1.0
    A[1] = [-p.c * inverse, -p.d * inverse, 1.0 / p.J1, 0.0, p.Mc / p.J2]
    if drive_by_demand:
        A[1, 2], A[1, 3] = 0.0, 1.0 / p.J1
    else:
        A[2, 2], A[2, 3] = -1.0 / p.lag, 1.0 / p.lag
    step = _exponential(A * (length / TAIL_POINTS))
    torque = np.array([p.c, p.d, 0.0, 0.0, 0.0])
    rows = np.empty((TAIL_POINTS, 5))
    for i in range(TAIL_POINTS):
        torque = torque @ step
        rows[i] = torque
    z, v, u, demand, one = rows.T
    w2 = np.zeros(TAIL_POINTS)
    return np.column_stack([z, v, w2, u, demand, one] if program.lagged else [z, v, w2, demand, one])


def _exponential(A: Matrix) -> Matrix:
    """exp(A) by scaling and squaring a Taylor series."""
    halvings = max(0, math.ceil(math.log2(max(1e-300, float(np.abs(A).sum(axis=1).max())) / 0.25)))
    small = A / 2.0**halvings
    term = total = np.eye(A.shape[0])
    for k in range(1, 14):
        term = term @ small / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total


POINTS = ca.collocation_points(3, "legendre")
SLOPES, END_WEIGHTS, QUADRATURE = (np.array(a) for a in ca.collocation_coeff(POINTS))
# Path constraints in contact are asked for at these shares of an interval: seen at the Gauss points alone, an
# optimum finds the bulges between them.
CHECKS = tuple((k + 1) / 8 for k in range(7))

NAMES = (
    "J1", "J2", "c", "d", "gap", "Mc", "lag", "rate", "lowest", "highest", "target", "base", "smoothness",
    "latest", "largest_peak", "most_heat", "z_start", "v_start", "w2_start",
)  # fmt: skip


class Parameters:
    """The numbers of a drive as symbols, under the names of the statement."""

    def __init__(self, program: Program) -> None:
        self.symbols = {name: ca.SX.sym(name) for name in NAMES}
        states = 4 if program.lagged else 3
        self.gap_scale, self.contact_scale = ca.SX.sym("gap_scale", 4), ca.SX.sym("contact_scale", 4)
        self.line_symbols = ca.SX.sym("lines", 2, program.lines)
        self.lines = [(self.line_symbols[0, i], self.line_symbols[1, i]) for i in range(program.lines)]
        self.tail = ca.SX.sym("tail", TAIL_POINTS if program.tail else 0, states + 2)
        own = [*self.symbols.values(), self.gap_scale, self.contact_scale, ca.vec(self.line_symbols)]
        self.own = ca.vertcat(*own)  # all but the tail
        self.vector = ca.vertcat(self.own, ca.vec(self.tail))

    def __getattr__(self, name: str) -> SX:
        try:
            return self.__dict__["symbols"][name]
        except KeyError:
            raise AttributeError(name) from None

    def scale(self, phase: Phase) -> SX:
        """Sizes of the states in a phase."""
        return self.contact_scale if phase.contact else self.gap_scale


def _cubic_at(share: float) -> Vector:
    """Weights of an interval's beginning and its Gauss points in the value of their cubic at a share."""
    nodes = np.array([0.0, *POINTS])
    weights = [np.prod([(share - b) / (a - b) for b in nodes if b != a]) for a in nodes]
    return np.array(weights)


CHECK_WEIGHTS = [_cubic_at(share) for share in CHECKS]


def parameter_vector(given: Numbers, tail: Vector) -> Vector:
    """The numbers in the order of `Parameters.vector`."""
    lines = np.array(given.lines).reshape(-1, 2)
    own = [given.values[name] for name in NAMES]
    return np.concatenate(
        [own, given.gap_scale, given.contact_scale, lines.ravel(), tail.ravel(order="F")]
    )  # CasADi stores by columns: a line is a column of its matrix


class Piece(NamedTuple):
    """The conditions of one interval as a function of its variables; built once for all intervals alike."""

    function: Any  # (beginning, inner, node, demand before, after, h, peak, parameters) -> (values, heat)
    lower: Vector
    upper: Vector


@lru_cache(maxsize=64)
def interval_piece(program: Program, phase: Phase, kept: float, on_border: bool) -> Piece:
    """Collocation, path constraints, limits of torque and rate in an interval.

    `kept` is the least shaft torque, `on_border` means that a path constraint ends the phase there.
    """
    p = Parameters(program)
    states = 4 if program.lagged else 3
    x, node, inner = ca.SX.sym("x", states), ca.SX.sym("node", states), ca.SX.sym("inner", states, 3)
    before, after, h, peak = (ca.SX.sym(name) for name in ("before", "after", "h", "peak"))
    scale = p.scale(phase)[:states]
    rows: list[Condition] = []

    def at(point: SX, demand: SX) -> State:
        return State(point[0], point[1], point[2], point[3] if program.lagged else demand)

    if program.rated:
        slope = after - before
        if phase.end == "lowest demand":
            rows.append(statement.equal("release", slope, -p.rate * h))
        else:
            rows.append(statement.at_most("rate up", slope, p.rate * h))
            rows.append(statement.at_least("rate down", slope, -p.rate * h))
    cubic = ca.horzcat(x, inner)
    slopes = ca.mtimes(cubic, SLOPES)
    heat = 0.0
    for j, tau in enumerate(POINTS):
        wanted = before + tau * (after - before)
        here = at(inner[:, j], wanted)
        rates = ca.vertcat(*statement.dynamics(program, p, phase, here, wanted))
        defect = (slopes[:, j] - h * rates) / scale
        rows += [Condition("dynamics", defect[i], 0.0, 0.0) for i in range(states)]
        if not phase.contact:
            rows += path_conditions(program, p, phase, here, peak)
        heat += h * float(QUADRATURE[j, 0]) * here.u**2
    if phase.contact:
        checks = ca.mtimes(cubic, np.array(CHECK_WEIGHTS).T)
        for k, share in enumerate(CHECKS):
            here = at(checks[:, k], before + share * (after - before))
            conditions = path_conditions(program, p, phase, here, peak, kept)
            every = k % 2 == 1 or phase.load == 0
            rows += [condition for condition in conditions if every or condition.name == "peak"]
    gap = (ca.mtimes(cubic, END_WEIGHTS) - node) / scale
    rows += [Condition("continuity", gap[i], 0.0, 0.0) for i in range(states)]
    rows += statement.torque_limits(program, p, at(x, before))
    if on_border:
        # its end condition puts it on the border: asked for twice, the multipliers would be undetermined
        rows += statement.torque_limits(program, p, at(node, after))
    else:
        rows += path_conditions(program, p, phase, at(node, after), peak, kept)
    inputs = [x, inner, node, before, after, h, peak, p.own]
    return Piece(
        ca.Function("interval", inputs, [ca.vertcat(*(row.value for row in rows)), heat]),
        np.array([row.lower for row in rows]),
        np.array([row.upper for row in rows]),
    )


def path_conditions(
    program: Program, p: Parameters, phase: Phase, here: State, peak: SX, kept: float = 0.0
) -> list[Condition]:
    """Path constraints and torque limits at a point."""
    limits = statement.torque_limits(program, p, here)
    return [*statement.path(program, p, phase, here, peak, kept), *limits]


Mesh = tuple[tuple[float, ...], ...]  # the edges of the intervals of every arc, as shares of its duration

SHORTEST = 1e-3  # of the time unit: minimum length, to which a redundant arc shrinks
SHORTEST_SMALL = 1e-6  # arcs of a narrow gap, of a load that breaks away
# The least shaft torque, of Ms, from the second interval of a contact on: rounding must not part the flanks.
KEPT = 5e-4
UNDETERMINED = 1e-6  # weight in the objective, near 1, of what else nothing would determine
# Phases that end where one of their path constraints does.
SURFACES = ("contact", "load stops", "breakaway", "softer")


class Slot(NamedTuple):
    """What a variable stands for: "state" (component), "demand", "duration" or "peak"; where on which arc."""

    kind: str
    arc: int
    share: float
    component: int = 0


@dataclass(frozen=True, eq=False)
class Transcribed:
    """A nonlinear program of CasADi: functions of variables and parameters, and how to read its variables."""

    program: Program
    mesh: Mesh
    nlp: dict[str, SX]
    limits: Any  # parameters -> (lbx, ubx, lbg, ubg)
    readout: Any  # (variables, parameters) -> (durations, peak, heat, points, demands)
    slots: tuple[Slot, ...]


class _Writer:
    """Collects variables and conditions while the phases are written down."""

    def __init__(self, program: Program, mesh: Mesh) -> None:
        self.program, self.mesh = program, mesh
        self.p = Parameters(program)
        self.states = 4 if program.lagged else 3
        self.variables: list[SX] = []
        self.lower: list[SX] = []
        self.upper: list[SX] = []
        self.slots: list[Slot] = []
        self.values: list[SX] = []
        self.limits: list[tuple[Any, Any]] = []
        self.peak = self.variable(Slot("peak", 0, 0.0), 0.0, self.p.largest_peak)
        self.heat: SX = 0.0
        self.roughness: SX = 0.0
        self.durations: list[SX] = []
        self.points: list[SX] = []
        self.demands: list[SX] = []

    def variable(self, slot: Slot, lower: SX, upper: SX) -> SX:
        symbol = ca.SX.sym(slot.kind)
        self.variables.append(symbol)
        self.lower.append(lower)
        self.upper.append(upper)
        self.slots.append(slot)
        return symbol

    def ask(self, *conditions: Condition) -> None:
        for condition in conditions:
            n = condition.value.shape[0]
            self.values.append(condition.value)
            self.limits.append((np.full(n, condition.lower), np.full(n, condition.upper)))

    def demand(self, arc: int, share: float) -> SX:
        return self.variable(Slot("demand", arc, share), self.p.lowest, self.p.highest)

    def point(self, phase: Phase, arc: int, share: float) -> SX:
        """New scaled states; returns the states themselves."""
        own = ca.SX.sym("state", self.states)
        self.variables.append(own)
        self.lower += [-INFINITY] * self.states
        self.upper += [INFINITY] * self.states
        self.slots += [Slot("state", arc, share, i) for i in range(self.states)]
        return own * self.p.scale(phase)[: self.states]

    def state(self, x: SX, demand: SX) -> State:
        return State(x[0], x[1], x[2], x[3] if self.program.lagged else demand)

    # ---- arcs --------------------------------------------------------------------------------------------

    def write(self) -> Transcribed:
        program, p = self.program, self.p
        arcs = program.arcs
        first = statement.start(p)
        x = ca.vertcat(*first[: self.states])
        demand: SX = 0.0
        for arc, phase in enumerate(arcs):
            if arc == 0:
                self.first_point(phase, x)
            x, demand = self.arc(arc, phase, x, demand)
            if arc + 1 == len(arcs) or arcs[arc + 1] is not phase:
                end = self.state(x, demand)
                self.ask(*statement.phase_end(program, p, phase, end, demand))
                if phase.contact is False and program.peak_counts and program.damped:
                    # damping makes T jump at the impact
                    self.ask(*path_conditions(program, p, arcs[arc + 1], end, self.peak))
            if arc + 1 == program.start_arcs:
                self.end_of_start()
        if program.tail:
            self.tail(arcs[-1], x, demand)
        return self.finished()

    def first_point(self, phase: Phase, x: SX) -> None:
        """Path constraints at t = 0."""
        here = self.state(x, 0.0)
        if self.program.demand == "continuous":
            self.ask(*path_conditions(self.program, self.p, phase, here, self.peak))
        else:  # limits of the torque come with the first interval
            self.ask(*statement.path(self.program, self.p, phase, here, self.peak))

    def arc(self, arc: int, phase: Phase, x: SX, demand: SX) -> tuple[SX, SX]:
        """All intervals of one arc from the state x on; returns its end."""
        small = not phase.contact or phase.load == 0 or phase.stiff or phase.end == "lowest demand"
        shortest = 0.0 if phase.end == "lowest demand" else (SHORTEST_SMALL if small else SHORTEST)
        duration = self.variable(Slot("duration", arc, 0.0), shortest, self.p.latest)
        self.durations.append(duration)
        edges, arcs = self.mesh[arc], self.program.arcs
        for begin, end in pairwise(edges):
            last = end == 1.0 and (arc + 1 == len(arcs) or arcs[arc + 1] is not phase)
            x, demand = self.interval(arc, phase, x, demand, duration, begin, end, last)
        return x, demand

    def interval(
        self, arc: int, phase: Phase, x: SX, demand: SX, duration: SX, begin: float, end: float, last: bool
    ) -> tuple[SX, SX]:
        """One interval: its variables, its conditions, its share of heat and roughness."""
        program = self.program
        h = duration * (end - begin)
        before, after = self.interval_demand(arc, demand, begin, end)
        inner = ca.horzcat(*(self.point(phase, arc, begin + tau * (end - begin)) for tau in POINTS))
        node = self.point(phase, arc, end)
        begins = begin == 0.0 and (arc == 0 or program.arcs[arc - 1] is not phase)
        kept = KEPT if phase.end == "terminal" and not begins else 0.0
        piece = interval_piece(program, phase, kept, last and phase.end in SURFACES)
        values, heat = piece.function(x, inner, node, before, after, h, self.peak, self.p.own)
        self.values.append(values)
        self.limits.append((piece.lower, piece.upper))
        if arc < program.start_arcs:
            self.heat += heat
            if program.smooth:
                self.roughness += (after - before) ** 2 / h
        self.points += [inner, node]
        self.demands.append(ca.vertcat(before, after))
        return node, after

    def interval_demand(self, arc: int, demand: SX, begin: float, end: float) -> tuple[SX, SX]:
        """The demand at both ends of an interval."""
        if self.program.demand == "steps":
            level = self.demand(arc, 0.5 * (begin + end))
            return level, level
        if self.program.demand == "ramps":
            return self.demand(arc, begin), self.demand(arc, end)
        return demand, self.demand(arc, end)

    # ---- the whole start ---------------------------------------------------------------------------------

    def end_of_start(self) -> None:
        self.t_f = sum(self.durations)
        if self.program.minimise != "start_time":
            self.ask(statement.at_most("start time", self.t_f, self.p.latest))
        if self.program.heat_bound:
            self.ask(statement.at_most("heat", self.heat, self.p.most_heat))

    def tail(self, phase: Phase, x: SX, demand: SX) -> None:
        """T after the last arc is linear in the state there: rows of coefficients, see `tail_rows`."""
        p = self.p
        here = self.state(x, demand)
        wanted = p.lowest
        if self.program.tail == "hold":
            wanted = statement.holding_torque(p, here, statement.shaft_torque(self.program, p, phase, here))
        later = ca.mtimes(p.tail, ca.vertcat(x, wanted, 1.0))
        self.ask(statement.at_most("peak after the start", later, self.peak))

    def undetermined(self) -> SX:
        """What nothing else fixes (a redundant switch, a peak not minimised): equal arcs, low peak."""
        out: SX = self.peak if self.program.minimise != "k_dyn" else 0.0
        for (a, one), (b, other) in pairwise(zip(self.program.arcs, self.durations, strict=True)):
            if a is b:
                out += (one - other) ** 2
        return out

    def finished(self) -> Transcribed:
        program, p = self.program, self.p
        x = ca.vertcat(*self.variables)
        f = statement.objective(program, p, self.peak, self.heat, self.t_f, self.roughness)
        g = ca.vertcat(*self.values)
        lower, upper = (np.concatenate([limit[i] for limit in self.limits]) for i in (0, 1))
        bounds: list[SX] = [ca.vertcat(*self.lower), ca.vertcat(*self.upper), lower, upper]
        read: list[SX] = [
            ca.vertcat(*self.durations),
            self.peak,
            self.heat,
            ca.horzcat(*self.points),
            ca.horzcat(*self.demands),
        ]
        return Transcribed(
            program,
            self.mesh,
            {"x": x, "p": p.vector, "f": f + UNDETERMINED * self.undetermined(), "g": g},
            ca.Function("limits", [p.vector], bounds),
            ca.Function("readout", [x, p.vector], read),
            tuple(self.slots),
        )


@lru_cache(maxsize=16)
def transcribe(program: Program, mesh: Mesh) -> Transcribed:
    """The nonlinear program of these phases on this mesh."""
    return _Writer(program, mesh).write()
