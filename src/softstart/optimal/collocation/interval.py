"""The conditions of one interval, and the parameters in which they are written.

Within an interval the state is a cubic through its beginning and three Gauss points, where it obeys the
dynamics. All intervals of a kind share one function, so that a finer mesh is quickly written down.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from softstart.optimal.collocation import statement
from softstart.optimal.collocation.phases import Phase, Program
from softstart.optimal.collocation.scaling import Numbers
from softstart.optimal.collocation.statement import Condition, State
from softstart.optimal.collocation.tail import TAIL_POINTS

SX = Any
Vector = NDArray[np.float64]

POINTS = ca.collocation_points(3, "legendre")
SLOPES, END_WEIGHTS, QUADRATURE = (np.array(a) for a in ca.collocation_coeff(POINTS))
# Path constraints in contact are asked for at these shares of an interval: seen at the Gauss points alone, an
# optimum finds the bulges between them.
LOOKS = tuple((k + 1) / 8 for k in range(7))

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


LOOK_WEIGHTS = [_cubic_at(share) for share in LOOKS]


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
    names: tuple[str, ...]


@lru_cache(maxsize=64)
def interval_piece(program: Program, phase: Phase, kept: float, on_border: bool) -> Piece:
    """Collocation, path constraints, limits of torque and rate in an interval.

    `kept` is the least shaft torque, `on_border` says that a path constraint ends the phase there.
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
        looks = ca.mtimes(cubic, np.array(LOOK_WEIGHTS).T)
        for k, share in enumerate(LOOKS):
            here = at(looks[:, k], before + share * (after - before))
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
        tuple(row.name for row in rows),
    )


def path_conditions(
    program: Program, p: Parameters, phase: Phase, here: State, peak: SX, kept: float = 0.0
) -> list[Condition]:
    """Path constraints and torque limits at a point."""
    limits = statement.torque_limits(program, p, here)
    return [*statement.path(program, p, phase, here, peak, kept), *limits]
