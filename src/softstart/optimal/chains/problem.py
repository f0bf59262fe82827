"""The least peak torque of a chain, its lower bound, and whether an answer holds on the exact chain.

        minimise    P  over the motor torque u(t), lowest_torque <= u <= highest_torque
        subject to  J_i w_i' = T_(i-1) - T_i - M_i (+ u at the motor's mass)
                    T_k = the contact law of shaft k of its twist theta_k and theta_k' = w_k - w_(k+1)
                    |T_k(t)| <= P  for all shafts k and 0 <= t <= t_f + one elastic period
        and at t_f  reached:     w_load >= target_speed
                    synchronous: all w_i = target_speed
                    steady:      also T_k = the load torques behind shaft k
        t_f <= start_time; everything brought to the motor shaft; K_dyn = P / mean torque of the chain.

With a torque lag u follows the demand, and with a rate limit the demand rises no faster. How often gaps close
and in which order is left free.

The lower bound (momentum). The load mass alone obeys J_L w_L' = T - M_L, T the torque of the shafts beside
it, brought to the motor's direction; with T <= P from the instant t_c on at which a shaft can first drive it,

    J_L (target - w_L(0)) + M_L t_f <= n P (t_f - t_c)

for an active load torque and a load mass without damping to the ground, n the number of shafts at the load
mass (1 at the end of a chain). Else, and where the load moves forward at first, what is left after its last
standstill counts, J_L target <= (n P - M_L)(t_f - t_c). That is proved for every torque within the limits,
whatever the contacts and the damping. For t_c the chain has to begin at rest, motor and load on its ends, all
gaps open or touching, no load torque on other masses, gears without losses:

- Nothing but the motor's mass and the falling load mass moves before t_1, when the motor's shaft can close
  under full torque U: t_1^2 = 2 J_1 travel/U.
- From then on the speed of each mass is bounded by energy. E, kinetic and elastic, grows by no more than
  U |w_1| + M_L |w_L| a second, so that d sqrt(2E)/dt <= S = U/sqrt(J_1) + M_L/sqrt(J_L), and the relative
  speed at the load's shaft is at most A t, A = S sqrt(1/J_b + 1/J_L), J_b the mass before the load.

So the shaft cannot pull before t_c, where M_L t_1^2/(2 J_L) + A (t_c^2 - t_1^2)/2 is what its gap leaves. No
contact law adds energy. Everywhere else t_c = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.chain.model import Chain
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late
from softstart.optimal.problem import TERMINALS, Problem, Terminal
from softstart.optimal.result import LowerBound, Optimum, OptimumError
from softstart.profile import TorqueProfile
from softstart.start.run import Run

_collocation = late("softstart.optimal.chains.collocation")
_solving = late("softstart.optimal.chains.solving")

SHORT = 1e-6  # of the target speed and of P: by so much a terminal condition may be missed
SAME = 1e-6  # a claim and its exact replay differ by no more than this share
ROUNDING = 1e-9


@dataclass(frozen=True)
class ChainProblem(Problem):
    """The least K_dyn of a chain within a start time; the mathematics stands at the top of this file.

    `drive` is the chain. Other objectives, bounds, torque-speed curves and smoothing are for drives.
    """

    drive: Chain  # type: ignore[assignment]
    terminal: Terminal = "reached"
    base: Drive | Chain | None = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        wrong = [*self._not_asked(), *self._not_solved()]
        if self.terminal not in TERMINALS:
            wrong.append(f"terminal = {self.terminal!r}: choose one of {', '.join(TERMINALS)}.")
        if self.start_time is None and self.minimise == "k_dyn":
            wrong.append("start_time: minimising k_dyn needs a bound on the start time.")
        if wrong:
            raise InputError(wrong)

    def _not_asked(self) -> Iterator[str]:
        """What an optimum of a chain does not take."""
        asked = {
            "minimise": self.minimise if self.minimise != "k_dyn" else "",
            "k_dyn": self.k_dyn, "heat": self.heat, "torque_speed": self.torque_speed,
            "smoothness": self.smoothness,
        }  # fmt: skip
        for name, value in asked.items():
            if value:
                yield (
                    f"{name} = {value}: on a chain the least K_dyn for a start time is found, without other "
                    "objectives, bounds or curves; leave it out, or reduce the chain to a drive."
                )

    def _not_solved(self) -> Iterator[str]:
        """What about the chain itself is in the way."""
        chain = self.drive
        if chain.motor is None:
            yield "[motor] is missing: an optimal start needs one; add it to the chain."
        if chain.target_speed is None:
            yield "target_speed is missing: an optimal start ends at one; add it to the chain."
        if len(chain.positions) > 1:
            yield "position = unknown: on a chain an optimum is for one position; give it."
        arrays = chain.at_motor_shaft()
        if chain.target_speed is not None and arrays.w0[arrays.load] >= chain.target_speed:
            yield "initial_speed: the load has its target speed already; there is nothing to optimise."
        for k, shaft in enumerate(chain.shafts):
            if shaft.rigid:
                yield (
                    f"[shaft] {k + 1} is rigid: its torque in an impact is infinite, and no start has a "
                    "least peak; give it a stiffness."
                )
        if arrays.held is not None and self.terminal != "reached":
            yield f"terminal = {self.terminal}: a mass of the chain stays at rest; ask for reached."
        if any(mass.curve_angle is not None for mass in chain.masses):
            yield "curve_angle: an optimum is not found where load torques depend on angles; give speeds."
        if self.terminal == "steady" and any(mass.curve is not None for mass in chain.masses):
            yield "terminal = steady: load curves leave no steady torque; ask for reached or synchronous."
        if (arrays.Mc < 0.0).any():
            yield "torque: a load torque below 0 drives instead of braking; an optimum needs 0 or more."

    @property
    def lowest_torque(self) -> float:
        """Smallest motor torque, N m."""
        assert self.drive.motor is not None
        return float(self.drive.motor.minimum_torque)

    @property
    def highest_torque(self) -> float:
        """Largest motor torque, N m: the starting torque, or maximum_torque where that is less."""
        motor = self.drive.motor
        assert motor is not None
        return float(min(motor.starting_torque, motor.maximum_torque))

    @property
    def target(self) -> float:
        """Speed in rad/s that is to be reached."""
        assert self.drive.target_speed is not None
        return float(self.drive.target_speed)

    def lower_bound(self) -> LowerBound:
        """The momentum bound on K_dyn of every start of the chain."""
        return momentum_bound(self)

    def casadi(self, run: Run | None = None) -> Any:
        """The problem in one order of contacts as a nonlinear program of CasADi: `Problem.casadi` of a chain.

        The order is that of `run`, a start of this chain that lasts to one elastic period after the start
        time; by default that of the first answer of the linear programs. The first guess has straight lines
        between the ends of its phases. InputError for gears with losses, load curves, contact_law
        modelica, and starts of more than 120 phases.

        >>> import casadi
        >>> from softstart.chain import Mass, Motor, Shaft
        >>> shafts = [Shaft(3000.0, damping_ratio=0.02, gap=0.05)]
        >>> chain = Chain([Mass(0.1), Mass(0.4, torque=20.0)], shafts, Motor(100.0), target_speed=20.0)
        >>> nlp = ChainProblem(chain, 0.2).casadi()
        >>> quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.tol": 1e-7}
        >>> solver = casadi.nlpsol("s", "ipopt", nlp.nlp, quiet)
        >>> out = solver(x0=nlp.x0, p=nlp.p, lbx=nlp.lbx, ubx=nlp.ubx, lbg=nlp.lbg, ubg=nlp.ubg)
        >>> bool(nlp.k_dyn(out["x"]) < 1.0)
        True
        """
        if run is None:
            run = _solving.optimize_chain(self, time_limit=0.0).run
        return _collocation.as_casadi(self, run, straight=True)


@dataclass(frozen=True, eq=False, repr=False)
class ChainOptimum(Optimum):
    """The best start of a chain that was found: an `Optimum` of a `ChainProblem`."""

    problem: ChainProblem

    @property
    def heat(self) -> float:
        """I2t heat in s: the integral of (u/Ms)^2 from 0 to t_f, of the demand where the motor lags."""
        motor = self.problem.drive.motor
        assert motor is not None
        return self.profile.heat(self.end_time, motor.starting_torque)

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere; those of each shaft too."""
        shafts = dict(zip(self.problem.drive.shaft_names, self.run.k_dyns.tolist(), strict=True))
        return {**super().summary(), "k_dyns": shafts}


# the lower bound -------------------------------------------------------------------------------------------


def momentum_bound(problem: ChainProblem) -> LowerBound:
    """A lower bound of K_dyn for every torque within the limits, however often gaps close.

    >>> problem = ChainProblem(Chain.load("crane-4-mass"), 0.42)
    >>> round(momentum_bound(problem).k_dyn, 3)
    0.872
    """
    assert problem.start_time is not None
    arrays = problem.drive.at_motor_shaft()
    load = arrays.load
    J, Mc, w0 = float(arrays.J[load]), float(arrays.Mc[load]), float(arrays.w0[load])
    left = problem.start_time * (1.0 + ROUNDING) - earliest_pull(problem)
    sides = (load > 0) + (load < arrays.J.size - 1)
    covers = (
        f"every torque from {problem.lowest_torque:g} to {problem.highest_torque:g} N m over time, by "
        "whatever controller, however often and in whichever order the gaps close"
    )
    if load == arrays.motor or (arrays.efficiency != 1.0).any():
        return LowerBound(0.0, "none", "no bound is known where the motor or a gear with losses adds to T")
    if problem.drive.masses[load].curve is not None:
        return LowerBound(0.0, "none", "no bound is known where the load torque follows a curve")
    if left <= 0.0:
        return LowerBound(math.inf, "momentum", covers)
    gained, taken = J * (problem.target - w0), Mc
    if w0 <= 0.0 and (arrays.reactive[load] or arrays.d_ground[load] > 0.0):
        gained = J * problem.target
    elif w0 <= 0.0:
        taken = Mc * problem.start_time / left
    P = (gained / left + taken) / sides
    return LowerBound(P * (1.0 - ROUNDING) / problem.base_torque, "momentum", covers)


def earliest_pull(problem: ChainProblem) -> float:
    """No shaft drives the load mass before this instant, s; see the top of this file."""
    arrays = problem.drive.at_motor_shaft()
    last = arrays.J.size - 1
    alone = arrays.motor == 0 and arrays.load == last and last > 1
    open_gaps = np.abs(arrays.theta0) <= 0.5 * arrays.gap
    others = np.delete(arrays.Mc, last)
    quiet = not arrays.w0.any() and not others.any() and bool(open_gaps.all())
    quiet = quiet and arrays.held is None and all(mass.curve is None for mass in problem.drive.masses)
    if not alone or not quiet or (arrays.efficiency != 1.0).any():
        return 0.0
    U = max(problem.highest_torque, -problem.lowest_torque)
    falls = 0.0 if arrays.reactive[last] else float(arrays.Mc[last])
    J1, Jb, JL = float(arrays.J[0]), float(arrays.J[-2]), float(arrays.J[-1])
    half = 0.5 * arrays.gap
    reach = float(half[-1] - arrays.theta0[-1])
    t1 = math.sqrt(2.0 * float(half[0] - abs(arrays.theta0[0])) * J1 / U)
    fallen = 0.5 * falls / JL * t1 * t1
    if fallen >= reach:
        return math.sqrt(2.0 * reach * JL / falls) if falls > 0.0 else 0.0
    A = (U / math.sqrt(J1) + falls / math.sqrt(JL)) * math.sqrt(1.0 / Jb + 1.0 / JL)
    return math.sqrt(t1 * t1 + 2.0 * (reach - fallen) / A)


# the check -------------------------------------------------------------------------------------------------


def check(problem: ChainProblem, run: Run, profile: TorqueProfile, end: float, claimed: float,
          bound: LowerBound) -> None:  # fmt: skip
    """OptimumError with a sentence for each thing that does not hold; `run` is the exact start."""
    low, high = problem.lowest_torque, problem.highest_torque
    allowed = ROUNDING * max(abs(low), abs(high))
    wrong = []
    if profile.torque.min() < low - allowed or profile.torque.max() > high + allowed:
        wrong.append(
            f"The demand goes from {profile.torque.min():.6g} to {profile.torque.max():.6g} N m, beyond its "
            f"limits of {low:g} and {high:g} N m."
        )
    assert problem.start_time is not None
    if end > problem.start_time * (1.0 + ROUNDING):
        wrong.append(f"The start takes {end:.9g} s, longer than {problem.start_time:.9g} s.")
    if not abs(run.k_dyn - claimed) <= SAME * run.k_dyn:
        wrong.append(f"K_dyn is {run.k_dyn:.9g} in the exact re-simulation, {claimed:.9g} was claimed.")
    miss = terminal_miss(problem, *(run.at(end)[name] for name in ("w", "T")))
    if miss.max() > SHORT:
        wrong.append(
            f"The terminal condition ({problem.terminal}) is missed by {miss.max():.3g} of the target at "
            f"{end:.6g} s."
        )
    if run.k_dyn < bound.k_dyn * (1.0 - 1e-5):
        wrong.append(f"K_dyn is {run.k_dyn:.8g}, below its lower bound of {bound.k_dyn:.8g}.")
    if wrong:
        raise OptimumError(" ".join(wrong))


def carried_loads(problem: ChainProblem) -> Vector:
    """The torques of the shafts while all masses turn at one speed, N m."""
    arrays = problem.drive.at_motor_shaft()
    torques = -np.cumsum(arrays.Mc)[:-1]
    torques[arrays.motor :] = np.cumsum(arrays.Mc[::-1])[::-1][1 + arrays.motor :]
    return torques


def terminal_miss(problem: ChainProblem, w: Vector, T: Vector) -> Vector:
    """By how much each part of the terminal condition is missed, as a share of target or load torques."""
    load = problem.drive.load_index
    if problem.terminal == "reached":
        return np.maximum(1.0 - w[[load]] / problem.target, 0.0)
    missed = np.abs(w / problem.target - 1.0)
    if problem.terminal == "synchronous":
        return np.asarray(missed)
    scale = max(problem.base_torque, 1e-300)
    return np.concatenate([missed, np.abs(T - carried_loads(problem)) / scale])
