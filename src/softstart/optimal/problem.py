"""The question an optimum answers: what to minimise, within which bounds, ending how."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from softstart.chain.machines import as_machine
from softstart.drive.machine import Machine
from softstart.errors import InputError
from softstart.quantities import read_multiple, time_above_0

if TYPE_CHECKING:
    from softstart.start.run import Run

Terminal = Literal["synchronous", "steady", "reached"]
Objective = Literal["k_dyn", "heat", "start_time"]

TERMINALS = get_args(Terminal)
OBJECTIVES = get_args(Objective)


@dataclass(frozen=True)
class StartTime:
    """A bound on the start time as it is asked for: `value` in s, or as a multiple of that of `direct`."""

    value: float
    multiple: bool = False

    @classmethod
    def of(cls, given: object, name: str = "start_time") -> StartTime:
        """The bound that a number or a text stands for; InputError if it is none.

        >>> StartTime.of("250 ms"), StartTime.of("1.2x")
        (StartTime(value=0.25, multiple=False), StartTime(value=1.2, multiple=True))
        """
        if isinstance(given, StartTime):
            return given
        try:
            multiple = read_multiple(given, name)
            if multiple is not None and 0.0 < multiple[0] < math.inf:
                return cls(multiple[0], True)
            return cls(time_above_0(given, name, ', as 0.3 or "300 ms"'))
        except InputError as error:
            either = 'or a multiple of the start time of direct, as "1.2x".'
            sentences = [f"{sentence.removesuffix('.')}, {either}" for sentence in error.sentences]
            raise InputError(sentences) from None

    def seconds(self, direct: Callable[[], float]) -> float:
        """The bound in s; `direct` gives the start time of the drive under its constant starting torque."""
        return self.value * direct() if self.multiple else self.value

    def __str__(self) -> str:
        """As it is typed."""
        return f"{self.value:g}x" if self.multiple else f"{self.value:g} s"


USUAL = StartTime(1.2, multiple=True)  # where a bound is needed and none is given


@dataclass(frozen=True)
class Problem:
    """What an optimal start minimises, within which bounds, and how it ends.

        minimise   K_dyn = peak |T| over the whole run / base torque, or heat, or the start time
                   over the motor torque u(t)
        subject to J_i w_i' = T_(i-1) - T_i - M_i (+ u at the motor's mass), everything at the motor shaft,
                   T_k = the contact law of shaft k of its twist and its rate w_k - w_(k+1),
                   lowest_torque <= u <= highest_torque, u <= torque_speed(w_motor), lag and rate limit of u,
                   t_f <= start_time, K_dyn <= k_dyn, heat <= heat
        and at t_f reached:     w_load >= target_speed
                   synchronous: all w_i = target_speed
                   steady:      also T_k = the load torques behind shaft k; without load torque T = 0

    The peak is that of all shafts from 0 to one elastic period after t_f; the torque after t_f belongs to the
    answer. How often and in which order gaps close is left free. The computing delay of a drive is left out:
    a profile that is known beforehand is sent that much earlier. One torque serves all `scenarios`, and
    every start position of a machine whose position is unknown; then only `reached` can be asked for, and
    K_dyn is the largest.

    Parameters
    ----------
    drive : Drive or Chain
        The machine, a single one.
    start_time : float, optional
        Bound on t_f, s; None only where the start time is minimised.
    terminal : {"synchronous", "steady", "reached"}, optional
        What holds at t_f; by default `synchronous` for one start of two masses, else `reached`.
    minimise : {"k_dyn", "heat", "start_time"}
        `heat` is the integral of (u/Ms)^2 from 0 to t_f in s, u the realised torque.
    k_dyn, heat : float, optional
        Bounds on what is not minimised (1, s).
    torque_speed : sequence of (float, float)
        Corners (rad/s, N m) of a concave limit of the motor's torque over its speed.
    smoothness : float
        Weight in s of integral (du/dt)^2 dt / Ms^2 against what is minimised; the demand is continuous.
    base : Drive or Chain, optional
        The machine to whose mean shaft torque K_dyn refers, if not `drive`.
    scenarios : sequence of Drive or Chain
        Other machines that the same torque is to serve.

    Raises
    ------
    InputError
        For everything that is wrong, at once.

    Examples
    --------
    >>> from softstart import Drive
    >>> problem = Problem(Drive.load("crane-4amtkf").replace(target_speed=60), start_time=0.2883042)
    >>> problem.terminal, problem.highest_torque, round(problem.base_torque, 2)
    ('synchronous', 62.0, 52.86)
    """

    drive: Any
    start_time: float | None = None
    terminal: Any = None
    minimise: Objective = "k_dyn"
    k_dyn: float | None = None
    heat: float | None = None
    torque_speed: Any = ()  # pairs of numbers once it is read
    smoothness: float = 0.0
    base: Any = None
    scenarios: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        wrong: list[str] = []
        others = [as_machine(one, "scenarios") for one in self.scenarios]
        object.__setattr__(self, "drive", _without_delay(as_machine(self.drive)))
        object.__setattr__(self, "base", None if self.base is None else as_machine(self.base, "base"))
        object.__setattr__(self, "scenarios", tuple(map(_without_delay, others)))
        for name, choices in (("terminal", TERMINALS), ("minimise", OBJECTIVES)):
            if getattr(self, name) not in (*choices, None):
                wrong.append(f"{name} = {getattr(self, name)!r}: choose one of {', '.join(choices)}.")
        for name, unit in (("start_time", "s"), ("k_dyn", "1"), ("heat", "s")):
            value = getattr(self, name)
            if value is None:
                continue
            if not _number(value) or not 0.0 < float(value) < math.inf:
                wrong.append(f"{name} = {value!r}: give a bound above 0 (in {unit}), or leave it out.")
            else:
                object.__setattr__(self, name, float(value))
        if self.minimise in ("k_dyn", "heat") and self.start_time is None:
            wrong.append(
                f"start_time: minimising {self.minimise} needs a bound on the start time, else the start may "
                "take indefinitely long."
            )
        if self.minimise in OBJECTIVES and getattr(self, self.minimise) is not None:
            wrong.append(
                f"{self.minimise}: it is what is minimised; leave the bound out, or minimise something else."
            )
        if not _number(self.smoothness) or not 0.0 <= float(self.smoothness) < math.inf:
            wrong.append(f"smoothness = {self.smoothness!r}: a weight in s, 0 or more.")
        wrong += self._wrong_corners()
        several = len(self.scenarios) > 0
        for number, machine in enumerate((self.drive, *self.scenarios), start=1):
            about = f"scenario {number}: " if several else ""
            wrong += [about + sentence for sentence in _wrong_with(machine)]
        if not wrong:
            two = len(self.drive.mass_names) == 2 and len(self.machines) == 1
            object.__setattr__(self, "terminal", self.terminal or ("synchronous" if two else "reached"))
            wrong += self._wrong_together()
        if wrong:
            raise InputError(wrong)

    def _wrong_together(self) -> Iterator[str]:
        """What does not go together."""
        from softstart.optimal.starts import parts

        if len(self.machines) > 1 and self.terminal != "reached":
            yield (
                f"terminal = {self.terminal}: one torque over time for several machines or start positions "
                'ends with the load at its speed, "reached"; leave terminal out, or give one position.'
            )
        if self.lowest_torque >= self.highest_torque:
            yield (
                f"scenarios: one needs a torque of at least {self.lowest_torque:g} N m, another allows "
                f"{self.highest_torque:g} N m at most; leave one of them out."
            )
        for machine in self.machines:
            given, masses, _ = parts(machine)
            taken = float((masses["Mc"] + masses["active"])[int(given.machine.load)])
            if len(self.machines) > 1 and taken >= self.highest_torque:
                yield (
                    f"scenarios: a load torque of {taken:g} N m is not below the motor torque of "
                    f"{self.highest_torque:g} N m that all allow; leave that one out."
                )
            if self.terminal != "reached" and np.isinf(masses["J"]).any():
                yield f"terminal = {self.terminal}: a mass stays at rest; ask for reached."
            if self.terminal == "steady" and given.curves.size:
                yield "terminal = steady: load curves leave no steady torque; ask for reached or synchronous."

    def _wrong_corners(self) -> Iterator[str]:
        """What is wrong with the torque-speed curve, whose corners become pairs of numbers."""
        try:
            points = tuple((float(speed), float(torque)) for speed, torque in self.torque_speed)
        except (TypeError, ValueError):
            yield f"torque_speed = {self.torque_speed!r}: give corners (speed in rad/s, torque in N m)."
            return
        object.__setattr__(self, "torque_speed", points)
        shown = f"torque_speed = {points!r}"
        slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(points) if b[0] > a[0]]
        if len(points) == 1 or len(slopes) < len(points) - 1:
            yield f"{shown}: give two corners or more, in order of rising speed."
        elif any(not math.isfinite(number) for point in points for number in point):
            yield f"{shown}: give finite numbers."
        elif low := next((point for point in points if point[1] < 0.0), None):
            yield (
                f"{shown}: {low[1]:g} N m at {low[0]:g} rad/s: a limit of the torque is 0 or more; end the "
                "curve where it comes to 0."
            )
        elif any(b > a + 1e-12 * abs(a) for a, b in pairwise(slopes)):
            yield (
                f"{shown}: this curve bends upward, so the best torque could not be proved best; give a "
                "concave one (each piece falls at least as steeply as the one before)."
            )

    @cached_property
    def machines(self) -> tuple[Any, ...]:
        """The machine at each of its start positions, then the scenarios at theirs."""
        every = (one for each in (self.drive, *self.scenarios) for one in each.positions.values())
        return tuple(dict.fromkeys(every))

    @property
    def lowest_torque(self) -> float:
        """Smallest motor torque that all machines allow, N m: 0 unless the motor may brake."""
        return max(float(one.motor.minimum_torque) for one in self.machines)

    @property
    def torques(self) -> str:
        """Smallest and largest motor torque in words that are saved with a result: "0 to 62 N m"."""
        where = " at the motor shaft" if self.drive.gear else ""
        return f"{self.lowest_torque:g} to {self.highest_torque:g} N m{where}"

    @property
    def highest_torque(self) -> float:
        """Largest motor torque that all allow, N m: starting torque or maximum_torque."""
        return min(float(min(one.motor.starting_torque, one.motor.maximum_torque)) for one in self.machines)

    @property
    def starting_torque(self) -> float:
        """Ms in N m, to which the heat refers."""
        return float(self.drive.motor.starting_torque)

    @property
    def target(self) -> float:
        """Speed in rad/s that is to be reached."""
        return float(self.drive.target_speed)

    @property
    def base_torque(self) -> float:
        """The mean shaft torque in N m to which K_dyn refers."""
        return float((self.base or self.drive).mean_torque)

    def casadi(self, run: Run | None = None) -> Any:
        """The problem as one nonlinear program of CasADi, for your own solver, options or sensitivities.

        minimise P / base torque (or heat, or t_f) over x = (P, durations, demands, states), subject to
        collocation of x' = f(x, u) in the phases of one order of contacts, |T| <= P, the limits of the motor
        and the terminal condition. The order is that of `run`, a start that lasts to one elastic period after
        the start time; by default that of the answer of `optimize`. The first guess has straight lines
        between the ends of the phases. Raises InputError for gears with losses, load curves, contact_law
        modelica and starts of too many phases. Source: docs/theory/optimum.md.

        >>> import casadi
        >>> from softstart import Drive
        >>> problem = Problem(Drive.load("crane-4amtkf").replace(target_speed=60), start_time=0.2883042)
        >>> nlp = problem.casadi()
        >>> quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
        >>> solver = casadi.nlpsol("s", "ipopt", nlp.nlp, quiet)
        >>> round(nlp.solution(solver(**nlp.arguments)["x"]).value, 2)
        0.91
        """
        from softstart.optimal.optimize import solve, whole_run
        from softstart.optimal.statement import as_casadi

        return as_casadi(self, run or whole_run(solve(self)), straight=True)


def _without_delay(machine: Machine) -> Machine:
    """A profile that is known beforehand is sent earlier by the computing delay."""
    if machine.motor is None or machine.motor.computing_delay == 0.0:
        return machine
    return machine.with_values({"computing_delay": 0.0})


def _wrong_with(machine: Any) -> Iterator[str]:
    """What about a machine is in the way of an optimum."""
    if machine.motor is None or machine.target_speed is None:
        missing = "[motor]" if machine.motor is None else "target_speed"
        yield f"{missing} is missing: an optimal start needs one; add it to the chain."
        return
    from softstart.kernel.records import CURVE
    from softstart.optimal.starts import parts

    given, masses, shafts = parts(next(iter(machine.positions.values())))
    if shafts["rigid"].any():
        yield (
            "[shaft] rigid: the torque of a rigid shaft in an impact is infinite, and no start has a least "
            "peak; give it a stiffness."
        )
        return
    target = float(given.machine.target)
    if masses["w0"][int(given.machine.load)] >= target:
        yield (
            f"initial speed: the load has its target speed of {target:g} rad/s already; there is nothing to "
            "optimise."
        )
    if (masses["Mc"] + masses["active"] < 0.0).any():
        yield (
            f"load torque = {float((masses['Mc'] + masses['active']).min()):g} N m: this load drives instead "
            "of braking; an optimal start needs a load torque of 0 or more."
        )
    if (given.curves.view(CURVE)["by_angle"] != 0.0).any():
        yield "curve_angle: an optimum is not found where load torques depend on angles; give speeds."


def _number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)
