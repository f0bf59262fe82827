"""The problem as mathematics: dynamics, path constraints, boundary conditions, objective.

State x = (z, v, w2[, u]): z = phi1 - phi2 - gap/2 twist beyond the driving flank, v = w1 - w2, w2 load speed,
and the motor torque u where it lags behind its demand. Everything is in the units of program.py. A condition
is a name, an expression, and the limits between which the expression must lie.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca

from softstart.optimal.collocation.program import Phase, Program

SX = Any  # casadi has no types
INFINITY = float("inf")


class State(NamedTuple):
    """A point of the motion."""

    z: SX
    v: SX
    w2: SX
    u: SX

    @property
    def w1(self) -> SX:
        """Motor speed."""
        return self.w2 + self.v


class Condition(NamedTuple):
    """lower <= value <= upper."""

    name: str
    value: SX
    lower: SX
    upper: SX


def at_most(name: str, value: SX, upper: SX) -> Condition:
    """Value <= upper."""
    return Condition(name, value - upper, -INFINITY, 0.0)


def at_least(name: str, value: SX, lower: SX) -> Condition:
    """Value >= lower."""
    return Condition(name, value - lower, 0.0, INFINITY)


def equal(name: str, value: SX, other: SX) -> Condition:
    """Value = other."""
    return Condition(name, value - other, 0.0, 0.0)


# ---- dynamics --------------------------------------------------------------------------------------------


def shaft_torque(program: Program, p: Any, phase: Phase, x: State) -> SX:
    """T of a phase: 0 in the gap, c z + d z' on the flank; `modelica` c z + min(c z, d z')."""
    if not phase.contact:
        return 0.0
    if phase.stiff:
        return 2.0 * p.c * x.z
    return p.c * x.z + p.d * x.v


def load_acceleration(p: Any, phase: Phase, T: SX) -> SX:
    """J2 w2' = T - Mc, friction against the motion; a load at rest stays there."""
    return 0.0 if phase.load == 0 else (T - phase.load * p.Mc) / p.J2


def dynamics(program: Program, p: Any, phase: Phase, x: State, demand: SX) -> list[SX]:
    """Right-hand side of x' = (z', v', w2'[, u'])."""
    T = shaft_torque(program, p, phase, x)
    a1 = (x.u - T) / p.J1
    a2 = load_acceleration(p, phase, T)
    rates = [x.v, a1 - a2, a2]
    return [*rates, (demand - x.u) / p.lag] if program.lagged else rates


# ---- path constraints ------------------------------------------------------------------------------------


def path(program: Program, p: Any, phase: Phase, x: State, peak: SX, kept: float = 0.0) -> list[Condition]:
    """What must hold all along a phase; in contact `kept` is the least torque of the shaft, Ms = 1."""
    T = shaft_torque(program, p, phase, x)
    if phase.end == "lowest demand":  # after t_f only the peak matters
        return [at_most("peak", T, peak)]
    if not phase.contact:
        conditions = [at_most("near flank", x.z, 0.0)]
        if program.gap:
            conditions.append(at_least("far flank", x.z, -p.gap))
    elif program.law == "dead-zone" and program.damped:
        conditions = [at_least("contact", p.c * x.z, kept)]
        if program.peak_counts:
            conditions.append(at_least("pull", T, -peak))
    else:
        conditions = [at_least("contact", p.c * x.z + p.d * x.v, kept)]
    if phase.stiff:
        conditions.append(at_least("stiff", p.d * x.v, p.c * x.z))
    elif phase.contact and program.law == "modelica" and program.damped:
        conditions.append(at_most("soft", p.d * x.v, p.c * x.z))
    if phase.contact and phase.load == 0:
        conditions.append(at_most("load at rest", T, p.Mc))
    elif phase.contact and program.peak_counts:
        conditions.append(at_most("peak", T, peak))
    if program.reactive and phase.load != 0:
        conditions.append(at_least("load moves on", phase.load * x.w2, 0.0))
    return conditions


def torque_limits(program: Program, p: Any, x: State) -> list[Condition]:
    """Motor torque below every line of the torque-speed curve; the lowest torque can be had at any speed."""
    return [
        at_most("torque-speed curve", x.u, ca.fmax(intercept + slope * x.w1, p.lowest))
        for intercept, slope in p.lines
    ]


# ---- boundary conditions ---------------------------------------------------------------------------------


def start(p: Any) -> State:
    """The drive at t = 0; a torque that lags or is limited in rate begins at 0."""
    return State(p.z_start, p.v_start, p.w2_start, 0.0)


def phase_end(program: Program, p: Any, phase: Phase, x: State, demand: SX) -> list[Condition]:
    """What ends a phase."""
    T = shaft_torque(program, p, phase, x)
    if phase.end == "contact":
        landing = [equal("landing", x.z, 0.0)]
        return [*landing, at_least("load moves at once", p.d * x.v, p.Mc)] if program.pressed_in else landing
    if phase.end == "load stops":
        return [equal("load stops", x.w2, 0.0)]
    if phase.end == "breakaway":
        return [equal("breakaway", T, p.Mc)]
    if phase.end == "softer":
        return [equal("softer", p.d * x.v, p.c * x.z)]
    if phase.end == "lowest demand":
        return [equal("lowest demand", demand, p.lowest)]
    if phase.end == "terminal":
        return terminal(program, p, phase, x, demand)
    return []


def terminal(program: Program, p: Any, phase: Phase, x: State, demand: SX) -> list[Condition]:
    """At t_f: w2 = target; synchronous also w1 = w2; steady also T = Mc."""
    T = shaft_torque(program, p, phase, x)
    conditions = [equal("load speed", x.w2, p.target)]
    if program.terminal in ("synchronous", "steady"):
        conditions.append(equal("motor speed", x.v, 0.0))
        held = holding_torque(p, x, T)
        if program.demand == "continuous" and program.lines and program.terminal == "synchronous":
            conditions.append(at_most("held demand", demand, held))
            if program.lagged:  # the torque goes on rising to the demand while the curve falls
                w1 = x.w1 + p.lag * (x.u - T) / p.J1
                later = [intercept + slope * w1 for intercept, slope in p.lines]
                conditions += [at_most("torque-speed curve after the start", demand, one) for one in later]
        elif program.demand == "continuous":
            conditions.append(equal("held demand", demand, held))
    if program.terminal == "steady":
        conditions.append(equal("steady torque", T, p.Mc))
    return conditions


def holding_torque(p: Any, x: State, T: SX) -> SX:
    """u_eq = (T (J1 + J2) - Mc J1)/J2, which holds T, as far as the motor can."""
    most = p.highest
    for intercept, slope in p.lines:
        most = ca.fmin(most, ca.fmax(intercept + slope * x.w1, p.lowest))
    return ca.fmax(ca.fmin((T * (p.J1 + p.J2) - p.Mc * p.J1) / p.J2, most), p.lowest)


# ---- objective -------------------------------------------------------------------------------------------


def objective(program: Program, p: Any, peak: SX, heat: SX, t_f: SX, roughness: SX) -> SX:
    """K_dyn = P/M12avg_base, heat = integral of (u/Ms)^2, or t_f; and weight x integral of (demand'/Ms)^2."""
    value = {"k_dyn": peak / p.base, "heat": heat, "start_time": t_f}[program.minimise]
    return value + p.smoothness * roughness if program.smooth else value
