"""The curve of the least K_dyn against the start time, and where the controllers lie beside it."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from softstart import __version__
from softstart.chain.machines import MachineLike, as_machine
from softstart.controller import ready_controller_names
from softstart.drive.machine import Machine
from softstart.errors import InputError, Mistakes
from softstart.input.files import write_whole
from softstart.optimal.optimize import solve, start_time_of_direct
from softstart.optimal.path import Path as StartPath
from softstart.optimal.problem import Problem, StartTime, Terminal
from softstart.optimal.result import InfeasibleError, Optimum, OptimumError
from softstart.optimal.torque_speed import Corners, refuse_weak_curve
from softstart.results import OneLine, Result
from softstart.start.demand import ControllerLike, as_controller
from softstart.start.recommendation import SLOW
from softstart.start.simulation import simulate
from softstart.store import PartStore, Target

Status = Literal["OPTIMAL", "INFEASIBLE", "NOT_FOUND"]
Progress = Callable[[str], object]

COMPARISON_TERMINAL: Terminal = (
    "reached"  # a controller is judged by the instant its load has the target speed
)
SHORT, LONG, COUNT = 1.02, 1.6, 12
COLUMNS = (
    "what", "start_time_bound", "start_time", "k_dyn", "k_dyn_lower_bound", "bound_kind", "gap_percent",
    "optimal_k_dyn", "ratio", "heat", "contacts", "method", "status",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class FrontPoint(OneLine):
    """The least K_dyn for one bound on the start time, or why there is none. Times in s.

    `status` is OPTIMAL, INFEASIBLE (no start is that quick; `shortest_start_time` would do) or NOT_FOUND (the
    method failed; `status_text` has the reason). Missing values are None. `time` and `torque` are the knots
    of the profile, s and N m.

    >>> point = FrontPoint(0.3, "reached", "OPTIMAL", "", k_dyn=1.01, k_dyn_lower_bound=1.0)
    >>> point.found, round(point.optimality_gap_percent, 6), FrontPoint.of_record(asdict(point)) == point
    (True, 1.0, True)
    """

    start_time_bound: float
    terminal: str
    status: Status
    status_text: str
    k_dyn: float | None = None
    k_dyn_lower_bound: float | None = None
    bound_kind: str = "none"
    bound_covers: str = ""
    k_dyn_lower_bound_once: float | None = None
    start_time: float | None = None
    heat: float | None = None
    contacts: int | None = None
    method: str = ""
    why: str = ""
    seconds: float | None = None
    shortest_start_time: float | None = None
    time: tuple[float, ...] = ()
    torque: tuple[float, ...] = ()

    @property
    def found(self) -> bool:
        """Whether there is an optimum."""
        return self.status == "OPTIMAL"

    @property
    def optimality_gap_percent(self) -> float | None:
        """How far K_dyn lies above its bound, in per cent."""
        if self.k_dyn is None or self.k_dyn_lower_bound is None:
            return None
        return 100.0 * (self.k_dyn / self.k_dyn_lower_bound - 1.0)

    @classmethod
    def of_optimum(cls, best: Optimum, start_time: float) -> FrontPoint:
        """The point of an optimum for this bound on the start time."""
        figures = {**(every := best.summary()), **every["profile"], "status": "OPTIMAL", "status_text": ""}
        figures["start_time_bound"] = start_time
        return cls.of_record({name: figures[name] for name in cls.__dataclass_fields__ if name in figures})

    def summary(self) -> dict[str, Any]:
        """The figures under the names used everywhere."""
        about = asdict(self)
        profile = {"time": list(about.pop("time")), "torque": list(about.pop("torque"))}
        return {
            **about,
            "gap_percent": self.optimality_gap_percent,
            "profile": profile if self.found else None,
        }

    @classmethod
    def of_record(cls, record: dict[str, Any]) -> FrontPoint:
        """The point with these fields, as `asdict` gives them and JSON keeps them."""
        return cls(**record | {name: tuple(record[name]) for name in ("time", "torque")})


@dataclass(frozen=True, repr=False)
class ControllerPoint(OneLine):
    """A controller: its K_dyn, its start time in s, and the optimum at just that start time.

    `start_time` is NaN where the load does not reach its target speed; then there is no `optimum`.
    """

    name: str
    k_dyn: float
    start_time: float
    status_text: str
    optimum: FrontPoint | None

    @property
    def ratio(self) -> float | None:
        """K_dyn of the controller / least K_dyn at its own start time with terminal `reached`."""
        if self.optimum is None or self.optimum.k_dyn is None:
            return None
        return self.k_dyn / self.optimum.k_dyn

    def summary(self) -> dict[str, Any]:
        """The figures under the names used everywhere."""
        best = self.optimum
        return {
            "controller": self.name, "k_dyn": self.k_dyn, "start_time": self.start_time,
            "status_text": self.status_text, "optimal_k_dyn": best and best.k_dyn,
            "k_dyn_lower_bound": best and best.k_dyn_lower_bound, "ratio": self.ratio,
            "optimum_status": best and best.status, "optimum_status_text": best and best.status_text,
        }  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Front(Result, view="optima.front_sheet"):
    """The least K_dyn for each bound on the start time, and the controllers against that limit.

    Parameters
    ----------
    drive : Drive or Chain
        The machine.
    terminal : {"synchronous", "steady", "reached"}
        What holds at the end of each optimal start.
    points : tuple of FrontPoint
        The optima, in order of start time.
    controllers : tuple of ControllerPoint
        Each with the optimum at just its own start time with terminal `reached`.

    Examples
    --------
    >>> from softstart import Drive, pareto
    >>> crane = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> front = pareto(crane, [0.2883042], terminal="synchronous", controllers=[])
    >>> [round(point.k_dyn, 4) for point in front.points], front.shortest_start_time
    ([0.9092], nan)
    """

    drive: Machine
    terminal: Terminal
    points: tuple[FrontPoint, ...]
    controllers: tuple[ControllerPoint, ...]

    @property
    def shortest_start_time(self) -> float:
        """Shortest feasible start time in s, known if a start time was too short; else NaN."""
        points = (*self.points, *(one.optimum for one in self.controllers))
        known = (p.shortest_start_time for p in points if p is not None and p.terminal == self.terminal)
        return next((shortest for shortest in known if shortest is not None), math.nan)

    @property
    def gentlest(self) -> ControllerPoint | None:
        """The controller with the lowest K_dyn of those that have an optimum and are not slow.

        Not that with the least ratio: where a controller is as quick as any start can be, no start is better
        within its time, and its ratio is 1 however hard it starts.
        """
        judged = [one for one in self.controllers if one.ratio is not None]
        latest = SLOW * min((one.start_time for one in judged), default=math.nan)
        quick = (one for one in judged if one.start_time <= latest)
        return min(quick, key=lambda one: one.k_dyn, default=None)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "drive": self.drive.name,
            "terminal": self.terminal,
            "shortest_start_time": self.shortest_start_time,
            "points": [point.summary() for point in self.points],
            "controllers": [point.summary() for point in self.controllers],
        }

    @property
    def records(self) -> list[dict[str, Any]]:
        """The curve, then the controllers, as rows of one table."""
        rows = [{"what": "optimum", **point.summary()} for point in self.points]
        for one in self.controllers:  # a missing start time is an empty cell
            rows.append({**one.summary(), "what": one.name} | ({} if one.optimum else {"start_time": None}))
        return [{name: row.get(name) for name in COLUMNS} for row in rows]

    def to_csv(self, path: str | Path) -> None:
        """Write `records`; numbers with all their digits."""

        def write(stream: Any) -> None:
            table = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
            table.writeheader()
            table.writerows(self.records)

        write_whole(Path(path), write)


def pareto(
    drive: MachineLike,
    start_times: Sequence[float | str | StartTime] | None = None,
    *,
    terminal: Terminal = "reached",
    controllers: Sequence[ControllerLike] | None = None,
    torque_speed: tuple[tuple[float, float], ...] = (),
    smoothness: float = 0.0,
    base: Machine | None = None,
    save_to: str | Path | None = None,
    progress: Progress | None = None,
) -> Front:
    """Find the least K_dyn for each of several bounds on the start time, with its lower bound.

    Each point is what `optimize` finds; the starts on the way are found once for all. No point is left above
    one of a shorter start time, as a start may arrive early. Start times too short for any start are marked
    infeasible.

    Parameters
    ----------
    drive : Drive, Chain, str or path
        The machine, or its name or file.
    start_times : sequence of float or str, optional
        Bounds on the start time: in s, with a unit ("300 ms"), or as multiples of the start time of `direct`
        ("1.2x"); by default 12 from 1.02 of the shortest found to 1.6 of that of `direct`, closer together
        towards the short end, where the curve is steep.
    terminal, torque_speed, smoothness, base : optional
        As in `optimize`.
    controllers : sequence of str, Controller or torque over time, optional
        What to put beside the curve, each judged by the optimum at its own start time with terminal
        `reached`; by default all installed controllers that run without being given a parameter.
    save_to : str or path, optional
        A file in which each finished point is kept at once, and from which a second call takes it.
    progress : callable, optional
        Called with a text before each point that is computed.

    Returns
    -------
    Front
        The curve and the controllers beside it.

    Raises
    ------
    InputError
        For bad input.
    OptimumError
        If not a single point could be computed.
    SimulationError
        If the start under a controller cannot be finished.

    Examples
    --------
    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> front = pareto(crane, [0.2883042, 0.33], terminal="synchronous", controllers=[])
    >>> [round(point.k_dyn, 4) for point in front.points]
    [0.9092, 0.8081]
    """
    problem = Problem(drive, 1.0, terminal, torque_speed=torque_speed, smoothness=smoothness, base=base)
    drive, base, torque_speed = as_machine(drive), problem.base, problem.torque_speed
    tell = progress or (lambda doing: None)
    times = None if start_times is None else _seconds(start_times, drive, torque_speed)
    names = ready_controller_names() if controllers is None else controllers
    made = [as_controller(one) for one in names]
    target = None if save_to is None else Target("save_to", Path(save_to), "Pareto curve")
    runs = [simulate(drive, one, base=base) for one in made]
    paths = {end: StartPath(replace(problem, terminal=end)) for end in (terminal, COMPARISON_TERMINAL)}
    if times is None:
        tell("looking for the shortest start time")
        times = _usual_times(paths[terminal], drive)
    own = [run.start_time for run in runs if not math.isnan(run.start_time)]
    inputs = {
        "version of softstart": __version__,
        "drive": drive.saved_as,
        "base drive": base.saved_as if base else "",
        "terminal": terminal,
        "torque-speed limit": [list(corner) for corner in torque_speed],
        "smoothness": float(smoothness),
    }
    wanted = [*((terminal, t) for t in times), *((COMPARISON_TERMINAL, t) for t in own)]
    with PartStore(target, inputs, ["terminal", "start_time_bound"]) as saved:
        found = {
            end: _points(path, [t for ending, t in wanted if ending == end], saved, tell)
            for end, path in paths.items()
        }
    curve = tuple(found[terminal][t] for t in times)
    failed = [point.status_text for point in curve if point.status == "NOT_FOUND"]
    if failed and not any(point.found for point in curve):
        raise OptimumError(failed[0])
    judged = found[COMPARISON_TERMINAL]
    beside = tuple(
        ControllerPoint(
            run.controller_name, run.k_dyn, run.start_time, run.status.value, judged.get(run.start_time)
        )
        for run in runs
    )
    return Front(drive, terminal, curve, beside)


def _usual_times(path: StartPath, drive: Machine) -> list[float]:
    """Start times in s, from 1.02 of the shortest found to 1.6 of that of `direct`."""
    refuse_weak_curve(path.problem)
    if path.shortest is None:
        raise OptimumError("No start time was found at which there is an optimum; name some to be tried.")
    shortest, direct = path.shortest.end, simulate(drive, "direct").start_time
    longest = LONG * (direct if LONG * direct > 1.2 * shortest else shortest)  # direct may never get there
    share = np.linspace(0.0, 1.0, COUNT) ** 2
    times: list[float] = (SHORT * shortest + (longest - SHORT * shortest) * share).tolist()
    return times


def _points(
    path: StartPath, start_times: Iterable[float], saved: PartStore, tell: Progress
) -> dict[float, FrontPoint]:
    """The points by start time, long ones first; those saved before are not computed again."""
    problem, points = path.problem, list[FrontPoint]()
    asked = sorted(set(start_times), reverse=True)
    for number, t in enumerate(asked, start=1):
        if record := saved.find(problem.terminal, t):
            points.append(FrontPoint.of_record(record))
            continue
        tell(f"start time {number} of {len(asked)}: {t:.5g} s, {problem.terminal}")
        points.append(front_point(replace(problem, start_time=t), path))
        if points[-1].status != "NOT_FOUND":  # another attempt may find it
            saved.add(asdict(points[-1]))
    return {point.start_time_bound: point for point in _monotone(points)}


def front_point(problem: Problem, path: StartPath) -> FrontPoint:
    """The point of one problem; `path` has the starts that are known at other times."""
    assert problem.start_time is not None
    try:
        return FrontPoint.of_optimum(solve(problem, path=path), problem.start_time)
    except InfeasibleError as error:
        shortest = error.verdict.shortest_start_time
        return FrontPoint(
            problem.start_time, problem.terminal, "INFEASIBLE", str(error),
            shortest_start_time=shortest if math.isfinite(shortest) else None,
        )  # fmt: skip
    except OptimumError as error:
        return FrontPoint(problem.start_time, problem.terminal, "NOT_FOUND", str(error))


def _monotone(points: Iterable[FrontPoint]) -> Iterator[FrontPoint]:
    """The points, none above one of a shorter start time: a start may arrive early."""
    gentlest: FrontPoint | None = None
    for point in sorted(points, key=lambda one: one.start_time_bound):
        known = math.inf if point.k_dyn is None else point.k_dyn
        if gentlest is None or gentlest.k_dyn is None or known <= gentlest.k_dyn:
            gentlest = point if point.found else gentlest
            yield point
        else:
            own = (
                "start_time_bound", "seconds", "k_dyn_lower_bound", "bound_kind", "bound_covers",
                "k_dyn_lower_bound_once",
            )  # fmt: skip
            why = f"the start for {gentlest.start_time_bound:.6g} s is gentler, and may arrive early"
            yield replace(gentlest, why=why, **{name: getattr(point, name) for name in own})


def _seconds(
    start_times: Sequence[float | str | StartTime], drive: Machine, torque_speed: Corners
) -> list[float]:
    """Start times in s, sorted, each once; multiples are of that of `direct`."""
    times: list[Any] = [start_times] if isinstance(start_times, str) else list(start_times)
    if not times:
        raise InputError("start_times: the list is empty; give at least one start time in s.")
    wrong, direct = Mistakes(), cache(lambda: start_time_of_direct(drive, torque_speed))
    bounds = list[StartTime]()
    for time in times:
        with wrong.collect():
            bounds.append(StartTime.of(time, "start_times"))
    wrong.raise_if_any()
    return sorted({bound.seconds(direct) for bound in bounds})
