"""What comes out: a candidate of a method, a bound, and the optimum that has passed the exact plant."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from softstart.arrays import Vector
from softstart.errors import SimulationError
from softstart.kernel import records as rec
from softstart.optimal.problem import Problem
from softstart.profile import TorqueProfile
from softstart.results import Result
from softstart.start.recommendation import Margin
from softstart.start.run import Run

Method = Literal["closed-form", "descent", "collocation"]
BoundKind = Literal["duality", "momentum", "none"]
BINDING = 1e-3  # a limit is what forbids a quicker start if less than this share of it is left


def heat_of(run: Run, until: float) -> float:
    """I2t heat in s: the integral of (u/Ms)^2 of the realised torque from 0 to `until`, exact."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    start, end = np.minimum(run.trajectory.spans[:, [rec.S_START, rec.S_END]].T, until)
    half = 0.5 * (end - start)
    times = start[:, None] + half[:, None] * (nodes + 1.0)
    index = np.repeat(np.arange(half.size), nodes.size)
    u = run.trajectory.at(times.ravel(), index)["u"].reshape(times.shape)
    return float(half @ (u * u @ weights)) / float(run.drive.motor.starting_torque) ** 2


def largest_heat(runs: Iterable[Run], until: float) -> float:
    """The largest heat of these starts, from whatever position: one that ended before `until` has less."""
    return max(heat_of(one, until) for run in runs for one in run.each)


@dataclass(frozen=True)
class LowerBound:
    """No torque profile of the class in `covers` has a smaller K_dyn than `k_dyn`."""

    k_dyn: float
    kind: BoundKind
    covers: str


@dataclass(frozen=True)
class Trial:
    """A search: its minimised figure on the exact plant, or why it failed."""

    method: Method
    value: float | None
    failure: str = ""


@dataclass(frozen=True)
class Kept:
    """How the quickest start keeps the limits of the drive, or the bound on K_dyn, and how quick any can be.

    Attributes
    ----------
    margins : tuple of Margin
        The margin to each limit, or to the bound on K_dyn; that of the start time may be below 0.
    at_least : float
        No start that keeps the permissible shaft torque, or that K_dyn, takes less time than this, s.
    unchecked : str
        Why the life that is asked for was left out; "" if it was not.
    refused : Margin or None
        What the next quicker start that was found exceeds most; None if there is none.
    """

    margins: tuple[Margin, ...]
    at_least: float
    unchecked: str
    refused: Margin | None = None
    covers: ClassVar[str] = "every torque within the motor's limits, however often the gap closes"  # proved

    @property
    def tight(self) -> Margin | None:
        """A limit of which nothing is left; None where there is none."""
        used = [one for one in self.margins if one.name != "start time" and one.share < BINDING]
        return min(used, key=lambda one: one.share, default=None)

    @property
    def binding(self) -> str:
        """The limit that forbids a quicker start; "" where it is the motor torque that does."""
        one = self.tight or self.refused
        return "" if one is None else one.name

    @property
    def kept(self) -> bool:
        """Whether all limits are kept, that of the start time too."""
        return all(one.kept for one in self.margins)

    def summary(self) -> dict[str, Any]:
        """Under the names used everywhere."""
        return {
            "kept": self.kept,
            "binding": self.binding,
            "start_time_at_least": self.at_least,
            "start_time_covers": self.covers,
            "unchecked": self.unchecked,
            "refused": None if self.refused is None else self.refused.summary(),
            "margins": [one.summary() for one in self.margins],
        }


@dataclass(frozen=True, eq=False, repr=False)
class Optimum(Result, view="optima.optimum_sheet"):
    """The best start found, as the exact plant runs it, and how much better any start could be.

    Parameters
    ----------
    problem : Problem
        What was minimised, within which bounds.
    profile : TorqueProfile
        The demand over time, with what follows t_f.
    runs : tuple of Run
        The exact re-simulation of the machine and of each scenario to one elastic period after t_f; all
        figures are taken from them. Where the start position is unknown, that of the worst one.
    bound : LowerBound
        What no other start can go below, and for which starts that is proved.
    method, why : str
        The method, and where its answer comes from.
    claimed : float
        The minimised figure as the method computed it, before the re-simulation.
    end_time : float
        t_f, s; the latest of all machines.
    seconds : float
        Computing time, s.
    alone : mapping of str to Optimum
        Where one torque serves several positions or scenarios: the optimum of each by itself, as a drive
        could have it that knows where it stands. Without those that have no start that quick.
    tried : tuple of Trial
        All searches in their order; the answer is that of the best one.
    kept : Kept or None
        Where the quickest start was asked for, how it keeps the limits, and the lower bound of its time.
    heat_at_least : float
        Where the heat is minimised: no start has less, s.
    bound_once : LowerBound or None
        What no start goes below whose gap closes once and stays closed; None where only `bound` is known.

    Examples
    --------
    >>> from softstart import Drive, optimize
    >>> best = optimize(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042)
    >>> round(best.k_dyn, 4), round(best.heat, 4), best.run.contacts
    (0.9092, 0.2153, 1)
    """

    problem: Problem
    profile: TorqueProfile
    runs: tuple[Run, ...]
    bound: LowerBound
    method: Method
    why: str
    claimed: float
    end_time: float
    seconds: float = 0.0
    alone: Mapping[str, Optimum] = field(default_factory=dict, repr=False)
    tried: tuple[Trial, ...] = ()
    kept: Kept | None = None
    heat_at_least: float = 0.0
    bound_once: LowerBound | None = None

    @property
    def k_dyn_each(self) -> tuple[float, ...]:
        """Dynamic coefficient of each machine's whole run."""
        base = self.problem.base_torque
        return tuple(run.peak_torque / base for run in self.runs)

    @property
    def k_dyns(self) -> Vector:
        """Dynamic coefficient of each shaft; the largest of all machines."""
        largest: Vector = np.max([run.k_dyns for run in self.runs], axis=0)
        return largest

    @property
    def worst(self) -> int:
        """Index of the machine with the largest peak."""
        return int(np.argmax(self.k_dyn_each))

    @property
    def run(self) -> Run:
        """The run with the largest peak."""
        return self.runs[self.worst]

    @property
    def start_times(self) -> tuple[float, ...]:
        """Start time of each machine, s."""
        return tuple(run.start_time for run in self.runs)

    @property
    def k_dyn(self) -> float:
        """Dynamic coefficient of the whole run, re-simulated; the largest of all machines."""
        return max(self.k_dyn_each)

    @property
    def k_dyn_lower_bound(self) -> float:
        """No start of the class that the bound covers has a smaller K_dyn."""
        return self.bound.k_dyn

    @property
    def minimised(self) -> float:
        """The figure that was minimised, of the run."""
        return {"k_dyn": self.k_dyn, "heat": self.heat, "start_time": self.end_time}[self.problem.minimise]

    @property
    def optimality_gap_percent(self) -> float:
        """How far K_dyn, or what was minimised instead, lies above its lower bound, in per cent."""
        found, least = self.k_dyn, self.bound.k_dyn
        if self.kept is not None:
            found, least = self.end_time, self.kept.at_least
        elif self.problem.minimise == "heat":
            found, least = self.heat, self.heat_at_least
        return 100.0 * (found / least - 1.0) if least > 0.0 else math.inf

    @property
    def heat(self) -> float:
        """I2t heat of the realised torque from 0 to t_f, in s: integral of (u/Ms)^2."""
        return largest_heat(self.runs, self.end_time)

    def __repr__(self) -> str:
        """One line with the main figures."""
        return (
            f"<Optimum: K_dyn {self.k_dyn:.5f}, at least {self.bound.k_dyn:.5f} ({self.bound.kind}), "
            f"start time {self.end_time:.5f} s, {self.problem.terminal}, {self.method}>"
        )

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere (JSON, tables, docs)."""
        problem, run = self.problem, self.run
        bounded = self.kept is not None or self.bound.kind != "none"
        limits = self.kept is not None and problem.minimise == "k_dyn"
        found: dict[str, Any] = {
            "drive": problem.drive.name,
            "minimise": "start_time" if limits else problem.minimise,
            "terminal": problem.terminal,
            "start_time_bound": problem.start_time if self.kept is None else None,
            "k_dyn_bound": problem.k_dyn,
            "heat_bound": problem.heat,
            "method": self.method,
            "why": self.why,
            "tried": [
                {"method": one.method, "value": one.value, "failure": one.failure} for one in self.tried
            ],
            "k_dyn": self.k_dyn,
            "k_dyn_claimed": self.claimed if problem.minimise == "k_dyn" else None,
            "k_dyn_lower_bound": self.bound.k_dyn if self.bound.kind != "none" else None,
            "bound_kind": self.bound.kind,
            "bound_covers": self.bound.covers,
            "k_dyn_lower_bound_once": self.bound_once and self.bound_once.k_dyn,
            "gap_percent": self.optimality_gap_percent
            if bounded and math.isfinite(self.optimality_gap_percent)
            else None,
            "peak_torque": run.peak_torque,
            "start_time": self.end_time,
            "start_time_lower_bound": None if self.kept is None else self.kept.at_least,
            "heat": self.heat,
            "heat_lower_bound": self.heat_at_least or None,
            "contacts": run.contacts,
            "first_contact": run.first_contact,
            "seconds": self.seconds,
            "profile": {"time": self.profile.time.tolist(), "torque": self.profile.torque.tolist()},
        }
        if len(run.drive.shaft_names) > 1:
            found["k_dyns"] = dict(zip(run.drive.shaft_names, self.k_dyns.tolist(), strict=True))
        if problem.scenarios:
            found["k_dyn_each"], found["start_times"] = list(self.k_dyn_each), list(self.start_times)
            found["worst"], found["scenarios"] = self.worst, [one.name for one in problem.scenarios]
        if self.alone:
            found["k_dyn_if_position_known"] = {at: one.k_dyn for at, one in self.alone.items()}
        if limits and self.kept is not None:
            found["limits"] = self.kept.summary()
        return found


@dataclass(frozen=True)
class Infeasibility:
    """Why no start of the class asked for exists, and how short the start time may be."""

    problem: Problem
    sentence: str
    shortest_start_time: float = math.inf  # the shortest one found; inf if none was
    at_least: float = 0.0  # no start is shorter, s
    shortest: TorqueProfile | None = None  # the torque of the shortest start found

    def summary(self) -> dict[str, Any]:
        """The verdict under the names used everywhere."""
        return {
            "status": "INFEASIBLE",
            "status_text": self.sentence,
            "drive": self.problem.drive.name,
            "terminal": self.problem.terminal,
            "start_time_bound": self.problem.start_time,
            "shortest_start_time": self.shortest_start_time,
            "start_time_lower_bound": self.at_least,
        }


class InfeasibleError(SimulationError):
    """No torque profile meets the bounds.

    Parameters
    ----------
    verdict : Infeasibility
        What was asked for, and what start time would do.

    Examples
    --------
    >>> from softstart import Drive, InfeasibleError, optimize
    >>> try:
    ...     optimize(Drive.load("crane-4amtkf").replace(gap=0.0, target_speed=20.0), 0.05, terminal="reached")
    ... except InfeasibleError as error:
    ...     print(round(error.verdict.shortest_start_time, 4))
    0.0804
    """

    def __init__(self, verdict: Infeasibility) -> None:
        self.verdict = verdict
        super().__init__(verdict.sentence)


class OptimumError(SimulationError):
    """A method's answer does not stand: the exact plant or the lower bound contradicts it.

    Examples
    --------
    >>> from softstart import OptimumError, SimulationError
    >>> issubclass(OptimumError, SimulationError)
    True
    """


class NotConverged(RuntimeError):  # noqa: N818 - the name states the outcome
    """IPOPT found no solution: `reason` is its own status, `violation` the largest violated constraint.

    `violation` is relative to the units of the problem (base torque, target speed, start time). A large one
    indicates a problem without solution, a small one a search that failed.
    """

    def __init__(self, reason: str, violation: float) -> None:
        self.reason, self.violation = reason, violation
        super().__init__(
            f"collocation: {reason} (largest violated constraint {violation:.2g} of the drive's own units)."
        )
