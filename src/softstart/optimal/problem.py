"""The question an optimum answers: what to minimise, within which bounds, ending how."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from numbers import Real
from typing import Any, Literal, get_args

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late
from softstart.quantities import to_si

_collocation = late("softstart.optimal.collocation.search")  # a module above this one

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
        text = given.strip() if isinstance(given, str) else ""
        multiple = text[-1:] in ("x", "X")
        value: Any = given
        if text:
            try:
                value = to_si(text[:-1] if multiple else text, "1" if multiple else "s", name=name)
            except InputError:
                if not multiple and (not text.isalpha() or text == "nan"):
                    raise  # it says what is wrong with number or unit
                value = math.nan
        if not _number(value) or not 0.0 < float(value) < math.inf:
            shown = f'"{given}"' if isinstance(given, str) else repr(given)
            raise InputError(
                f'{name} = {shown}: give a time above 0 s, as 0.3 or "300 ms", or a multiple of the start '
                'time of direct, as "1.2x".'
            )
        return cls(float(value), multiple)

    def seconds(self, direct: Callable[[], float]) -> float:
        """The bound in s; `direct` gives the start time of the drive under its constant starting torque."""
        return self.value * direct() if self.multiple else self.value

    def __str__(self) -> str:
        """As it is typed."""
        return f"{self.value:g}x" if self.multiple else f"{self.value:g} s"


def usual_terminal(drive: Drive) -> Terminal:
    """How an optimal start ends if nobody says: `reached` where one profile serves several positions.

    >>> usual_terminal(Drive.load("crane-4amtkf"))
    'synchronous'
    """
    return "reached" if len(drive.positions) > 1 else "synchronous"


USUAL = StartTime(1.2, multiple=True)  # where a bound is needed and none is given
REACTS = (  # what is to be said beside a best fixed profile
    "It is one torque over time for every start position: feedback reacts to the contact, and its K_dyn can "
    "be lower."
)


def best_start(machine: Any) -> str:
    """What the best torque over time is called: no optimum where the position is unknown, as feedback reacts.

    >>> best_start(Drive.load("crane-4amtkf")), best_start(Drive.load("long-travel-3kw"))
    ('optimum', 'best fixed profile')
    """
    return "best fixed profile" if len(machine.positions) > 1 else "optimum"


def best_k_dyn(machine: Any) -> str:
    """What its K_dyn is called."""
    return "K_dyn of the best fixed profile" if len(machine.positions) > 1 else "least K_dyn"


@dataclass(frozen=True)
class Problem:
    """What an optimal start minimises, within which bounds, and how it ends.

        minimise   K_dyn = peak |T| over the whole run / M12avg_base, or heat, or the start time
        subject to lowest_torque <= u <= highest_torque, the drive's lag and rate, u <= torque_speed(w1),
                   t_f <= start_time, K_dyn <= k_dyn, heat <= heat
        and at t_f synchronous: w1 = w2 = target_speed, from then on the shaft torque is held
                   steady:      also T = Mc; without load torque T = 0, the flanks just touch
                   reached:     only w2 = target_speed for the first time; the motor coasts until T peaks

    The drive's computing_delay is left out: a profile that is known beforehand is sent that much earlier.
    Where the start position is unknown, one profile serves all: terminal `reached`, K_dyn the worst.

    Parameters
    ----------
    drive : Drive
        The drive, a single one.
    start_time : float, optional
        Bound on t_f, s; None only where the start time is minimised.
    terminal : {"synchronous", "steady", "reached"}
        What holds at t_f.
    minimise : {"k_dyn", "heat", "start_time"}
        `heat` is the integral of (u/Ms)^2 from 0 to t_f in s, u the realised torque.
    k_dyn, heat : float, optional
        Bounds on what is not minimised (1, s).
    torque_speed : sequence of (float, float)
        Corners (rad/s, N m) of a concave limit of the motor's torque over its speed.
    smoothness : float
        Weight in s of integral (du/dt)^2 dt / Ms^2 against K_dyn: makes the demand continuous from 0 on.
    base : Drive, optional
        The drive to whose mean shaft torque K_dyn refers, if not `drive`.
    first_torque, first_demand : float
        Motor torque at t = 0 and the demand that it follows, N m: not 0 where a brake held the motor before.

    Raises
    ------
    InputError
        For everything that is wrong, at once.

    Examples
    --------
    >>> problem = Problem(Drive.load("crane-4amtkf").replace(target_speed=60), start_time=0.2883042)
    >>> problem.terminal, problem.highest_torque, round(problem.base_torque, 2)
    ('synchronous', 62.0, 52.86)

    References
    ----------
    The mathematics: docs/theory/optimum.md.
    """

    drive: Drive
    start_time: float | None = None
    terminal: Terminal = "synchronous"
    minimise: Objective = "k_dyn"
    k_dyn: float | None = None
    heat: float | None = None
    torque_speed: tuple[tuple[float, float], ...] = ()
    smoothness: float = 0.0
    base: Drive | None = None
    first_torque: float = 0.0
    first_demand: float = 0.0

    def __post_init__(self) -> None:
        wrong: list[str] = []
        drive = self.drive
        if not isinstance(drive, Drive):
            raise InputError(f"drive = {drive!r}: give a Drive; Drive.load reads one from a file or by name.")
        if drive.computing_delay != 0.0:
            object.__setattr__(self, "drive", drive := drive.replace(computing_delay=0.0))
        wrong += drive.without_friction("optimal starts and bounds are known without this friction only")
        if drive.Mc < 0.0:
            wrong.append(
                f"load_torque = {drive.Mc:g} N m: this load drives instead of braking; an optimal start "
                "needs a load torque of 0 or more."
            )
        for name, choices in (("terminal", TERMINALS), ("minimise", OBJECTIVES)):
            if getattr(self, name) not in choices:
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
        wrong += _check_corners(self.torque_speed)
        if len(drive.positions) > 1:
            wrong += self._not_over_positions()
        if drive.initial_load_speed >= drive.target_speed:
            wrong.append(
                f"initial_load_speed = {drive.initial_load_speed:g} rad/s: the load has its target speed of "
                f"{drive.target_speed:g} rad/s already; there is nothing to optimise."
            )
        if wrong:
            raise InputError(wrong)

    def _not_over_positions(self) -> Iterator[str]:
        """What cannot be asked of one profile for all positions."""
        asked = {
            "terminal": self.terminal if self.terminal != "reached" else "",
            "minimise": self.minimise if self.minimise != "k_dyn" else "",
            "k_dyn": self.k_dyn, "heat": self.heat, "torque_speed": self.torque_speed,
            "smoothness": self.smoothness,
        }  # fmt: skip
        for name, value in asked.items():
            if value:
                yield (
                    f"{name} = {value}: the start position is unknown, and one profile for all positions has "
                    'the least largest K_dyn with terminal "reached"; leave it out, or give a position.'
                )

    @property
    def lowest_torque(self) -> float:
        """Smallest motor torque, N m: the drive's minimum_torque (0 unless the motor may brake)."""
        return float(self.drive.minimum_torque)

    @property
    def highest_torque(self) -> float:
        """Largest motor torque, N m: the starting torque Ms, or maximum_torque where that is less."""
        return float(min(self.drive.Ms, self.drive.maximum_torque))

    @property
    def target(self) -> float:
        """Speed in rad/s that is to be reached."""
        return float(self.drive.target_speed)

    @property
    def base_torque(self) -> float:
        """M12avg_base in N m, the torque to which K_dyn refers."""
        return float((self.base or self.drive).mean_torque)

    def lower_bound(self) -> Any:
        """The momentum bound on K_dyn of every start; see `softstart.optimal.momentum.momentum_bound`."""
        from softstart.optimal.momentum import momentum_bound

        return momentum_bound(self)

    def casadi(self) -> Any:
        """The problem as one nonlinear program of CasADi, for your own solver, options or sensitivities.

        minimise P / M12avg_base (or heat, or t_f) over x = (P, durations, demands, states), subject to
        Legendre collocation of x' = f(x, u) in the phases of the likeliest order, |T| <= P, the limits of
        the motor and the terminal conditions. Sparsity and scaling: `CasadiProblem`, which it returns. Raises
        InputError for a problem of no class known to the collocation. Source: docs/theory/optimum.md.

        >>> import casadi
        >>> problem = Problem(Drive.load("crane-4amtkf").replace(target_speed=60), start_time=0.2883042)
        >>> nlp = problem.casadi()
        >>> quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
        >>> solver = casadi.nlpsol("s", "ipopt", nlp.nlp, quiet)
        >>> out = solver(x0=nlp.x0, p=nlp.p, lbx=nlp.lbx, ubx=nlp.ubx, lbg=nlp.lbg, ubg=nlp.ubg)
        >>> round(nlp.k_dyn(out["x"]), 3), round(nlp.profile(out["x"]).torque.max(), 1).item()
        (0.909, 62.0)
        """
        return _collocation.as_casadi(self)

    @property
    def ideal_torque(self) -> bool:
        """True where any measurable torque within the limits can be had: no lag, rate, curve or smoothing."""
        drive = self.drive
        return (
            drive.torque_lag == 0.0
            and math.isinf(drive.torque_rate)
            and not self.torque_speed
            and self.smoothness == 0.0
        )


def problem_of(
    machine: Any, start_time: float | None, terminal: Terminal | None = None, *, method: str = "auto",
    limits: bool = False, **asked: Any,
) -> Problem:  # fmt: skip
    """The problem of a drive or a chain, its terminal condition the usual one if none is given.

    InputError for what cannot be asked of it, by which method and whether for the least time within limits.

    >>> problem_of(Drive.load("crane-4amtkf"), 0.5).terminal
    'synchronous'
    """
    from softstart.drive.records import is_machine

    if isinstance(machine, Drive) or not is_machine(machine):
        return Problem(machine, start_time, terminal or usual_terminal(machine), **asked)
    from softstart.optimal.chains.problem import ChainProblem

    refuse_for_chain(method, limits)
    return ChainProblem(machine, start_time, terminal or "reached", **asked)


def refuse_for_chain(method: str, limits: bool) -> None:
    """What cannot be asked of an optimum of a chain."""
    wrong = []
    if method != "auto":
        wrong.append(
            f"method = {method}: on a chain the optimum is found by successive linear programs on its exact "
            "start; use method = auto."
        )
    if limits:
        wrong.append("limits: this is for drives; leave it out, or reduce the chain to a drive.")
    if wrong:
        raise InputError(wrong)


def _number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _check_corners(corners: Sequence[Sequence[float]]) -> list[str]:
    """What is wrong with a torque-speed curve."""
    if not corners:
        return []
    shown = f"torque_speed = {corners!r}"
    try:
        points = [(float(speed), float(torque)) for speed, torque in corners]
    except (TypeError, ValueError):
        return [f"{shown}: give corners (speed in rad/s, torque in N m)."]
    if len(points) < 2 or any(b[0] <= a[0] for a, b in pairwise(points)):
        return [f"{shown}: give two corners or more, in order of rising speed."]
    if any(not math.isfinite(number) for point in points for number in point):
        return [f"{shown}: give finite numbers."]
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(points)]
    if any(b > a + 1e-12 * abs(a) for a, b in pairwise(slopes)):
        return [
            f"{shown}: this curve bends upward, so the best torque could not be proved best; give a concave "
            "one (each piece falls at least as steeply as the one before)."
        ]
    return []
