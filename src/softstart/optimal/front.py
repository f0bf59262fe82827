"""The curve of the least K_dyn against the start time, and where the controllers lie beside it."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from numbers import Real
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple

import numpy as np

from softstart import __version__
from softstart.chain.machines import Machine
from softstart.controller import Controller, make_controller, ready_controller_names
from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.late import late
from softstart.optimal.optimize import optimize, shortest_start_time
from softstart.optimal.problem import Problem, Terminal
from softstart.optimal.result import InfeasibleError, Optimum, OptimumError, Verdict
from softstart.parallel import Pool, checked_workers
from softstart.profile import TorqueProfile
from softstart.start.run import Run
from softstart.start.simulation import simulate
from softstart.store import Records, Target

notebook = late("softstart.views.notebook")
optima = late("softstart.views.optima")  # it draws results of this module

Status = Literal["OPTIMAL", "INFEASIBLE", "NOT_FOUND"]
Progress = Callable[[str], object]

YARDSTICK: Terminal = "reached"  # a controller is judged by the instant its load has the target speed
SHORT, LONG, COUNT = 1.02, 1.6, 12
CHUNKS = 2  # stretches of start times for each worker


@dataclass(frozen=True)
class FrontPoint:
    """The least K_dyn for one bound on the start time, or why there is none. Times in s.

    `status` is OPTIMAL, INFEASIBLE (no start is that quick; `shortest_start_time` would do) or NOT_FOUND (the
    method failed; `status_text` has the reason). Missing values are None. `time` and `torque` are the knots
    of the profile, s and N m.

    >>> point = FrontPoint(0.3, "reached", "OPTIMAL", "", k_dyn=1.01, k_dyn_lower_bound=1.0)
    >>> point.found, round(point.gap_percent, 6), FrontPoint.of_record(point.record()) == point
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
    def gap_percent(self) -> float | None:
        """How far K_dyn lies above its bound, in per cent."""
        if self.k_dyn is None or self.k_dyn_lower_bound is None:
            return None
        return 100.0 * (self.k_dyn / self.k_dyn_lower_bound - 1.0)

    @classmethod
    def of_optimum(cls, best: Optimum, start_time: float) -> FrontPoint:
        """The point of an optimum for this bound on the start time."""
        figures = best.summary()
        names = ("terminal", "k_dyn", "k_dyn_lower_bound", "bound_kind", "bound_covers", "start_time", "heat",
                 "contacts", "method", "why", "seconds")  # fmt: skip
        return cls(
            start_time, status="OPTIMAL", status_text="", time=tuple(best.profile.time.tolist()),
            torque=tuple(best.profile.torque.tolist()), **{name: figures[name] for name in names},
        )  # fmt: skip

    @classmethod
    def of_verdict(cls, verdict: Verdict, start_time: float, terminal: str) -> FrontPoint:
        """The point of a start time that no start meets."""
        shortest = verdict.shortest_start_time
        known = shortest if math.isfinite(shortest) else None
        return cls(start_time, terminal, "INFEASIBLE", verdict.sentence, shortest_start_time=known)

    @classmethod
    def not_found(cls, why: str, start_time: float, terminal: str) -> FrontPoint:
        """The point of a start time for which the method failed."""
        return cls(start_time, terminal, "NOT_FOUND", why)

    def for_shorter(self, start_time: float) -> FrontPoint:
        """The point of a start time shorter than this one, where this one is infeasible already."""
        shortest = self.shortest_start_time
        least = f"; the shortest found is {shortest:.6g} s" if shortest is not None else ""
        reason = f"A start time of {start_time:.6g} s is too short ({self.terminal}){least}."
        return replace(self, start_time_bound=start_time, status_text=reason)

    def summary(self) -> dict[str, Any]:
        """The figures under the names used everywhere."""
        about = asdict(self)
        profile = {"time": list(about.pop("time")), "torque": list(about.pop("torque"))}
        return {**about, "gap_percent": self.gap_percent, "profile": profile if self.found else None}

    def record(self) -> dict[str, Any]:
        """All fields as plain data, for `of_record`."""
        return asdict(self)

    @classmethod
    def of_record(cls, record: dict[str, Any]) -> FrontPoint:
        """The point that `record` was made from."""
        knots = {name: tuple(record[name]) for name in ("time", "torque")}
        return cls(**{**record, **knots})


@dataclass(frozen=True)
class ControllerPoint:
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
            "controller": self.name,
            "k_dyn": self.k_dyn,
            "start_time": self.start_time,
            "status_text": self.status_text,
            "optimal_k_dyn": best.k_dyn if best else None,
            "k_dyn_lower_bound": best.k_dyn_lower_bound if best else None,
            "ratio": self.ratio,
            "optimum_status": best.status if best else None,
            "optimum_status_text": best.status_text if best else None,
        }


@dataclass(frozen=True, eq=False)
class Front:
    """The least K_dyn for each bound on the start time, and the controllers against that limit.

    Parameters
    ----------
    drive : Drive or Chain
        The drive or the chain.
    terminal : {"synchronous", "steady", "reached"}
        What holds at the end of each optimal start.
    points : tuple of FrontPoint
        The optima, in order of start time.
    controllers : tuple of ControllerPoint
        Each with its own start time and K_dyn, and the optimum at just that start time with terminal
        `reached`.

    Examples
    --------
    >>> from softstart import Drive, pareto
    >>> crane = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> front = pareto(crane, [0.2883042], terminal="synchronous", controllers=[])
    >>> [round(point.k_dyn, 4) for point in front.points], front.shortest_start_time
    ([0.9092], nan)

    References
    ----------
    docs/optimal-starts.md; the optimum at each start time: docs/theory/optimum.md.
    """

    drive: Machine
    terminal: Terminal
    points: tuple[FrontPoint, ...]
    controllers: tuple[ControllerPoint, ...]

    @property
    def shortest_start_time(self) -> float:
        """Shortest feasible start time in s, known if a start time was too short; else NaN."""
        judged = [one.optimum for one in self.controllers if one.optimum is not None]
        known = [
            point.shortest_start_time
            for point in (*self.points, *judged)
            if point.shortest_start_time is not None and point.terminal == self.terminal
        ]
        return known[0] if known else math.nan

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "drive": self.drive.name,
            "terminal": self.terminal,
            "shortest_start_time": self.shortest_start_time,
            "points": [point.summary() for point in self.points],
            "controllers": [point.summary() for point in self.controllers],
        }

    def to_csv(self, path: str | Path) -> None:
        """Write the curve, then the controllers, as one table; numbers with all their digits."""
        columns = (
            "what", "start_time_bound", "start_time", "k_dyn", "k_dyn_lower_bound", "bound_kind",
            "gap_percent", "optimal_k_dyn", "ratio", "heat", "contacts", "method", "status",
        )  # fmt: skip
        rows = [{"what": "optimum", **point.summary()} for point in self.points]
        for one in self.controllers:
            rows.append({**one.summary(), "what": one.name})

        def cell(value: Any) -> str:
            if value is None or (isinstance(value, float) and math.isnan(value)):
                return ""
            return repr(value) if isinstance(value, float) else str(value)

        def write(stream: IO[Any]) -> None:
            table = csv.writer(stream, lineterminator="\n")
            table.writerow(columns)
            table.writerows([cell(row.get(name)) for name in columns] for row in rows)

        write_whole(Path(path), write)

    def _repr_html_(self) -> Any:
        """What a notebook shows."""
        return notebook.of_front(self)

    def plot(self) -> Any:
        """The curve with its bound, and the controllers as points."""
        return optima.front_figure(self)


def pareto(
    drive: Machine,
    start_times: Sequence[float] | None = None,
    *,
    terminal: Terminal = "reached",
    controllers: Sequence[str | Controller] | None = None,
    torque_speed: tuple[tuple[float, float], ...] = (),
    smoothness: float = 0.0,
    base: Machine | None = None,
    save_to: str | Path | None = None,
    progress: Progress | None = None,
    each: Callable[[FrontPoint], object] | None = None,
    workers: int = 1,
    scheduler: str | None = None,
) -> Front:
    """Find the least K_dyn for each of several bounds on the start time, with its lower bound.

    The sweep goes from long start times to short ones; each optimum is one more first demand for the next
    one. Several workers have a stretch of start times each. No point is left above one of a shorter start
    time, as a start may arrive early, and no bound below that of a longer one. Start times too short for any
    start are marked infeasible, no error.

    Parameters
    ----------
    drive : Drive or Chain
        The machine.
    start_times : sequence of float, optional
        Bounds on the start time, s; by default `default_start_times(drive, terminal)`.
    terminal : {"synchronous", "steady", "reached"}
        What holds at the end of each optimal start, as in `optimize`.
    controllers : sequence of str or Controller, optional
        What to put beside the curve; by default all installed controllers that run without being given a
        parameter, none for an empty list. Each is simulated, and judged by the optimum at its own start time
        with terminal `reached`: the fair yardstick.
    torque_speed : sequence of (float, float)
        Corners (rad/s, N m) of a concave limit of the motor torque over the motor speed.
    smoothness : float
        Weight in s of integral (du/dt)^2 dt / Ms^2; makes the torque continuous.
    base : Drive or Chain, optional
        The machine to whose mean shaft torque K_dyn refers, if not `drive`.
    save_to : str or path, optional
        A file in which each finished point is kept at once. A second call with the same inputs takes them
        from there; other inputs are refused.
    progress : callable, optional
        Called with a text before each point that is computed.
    each : callable, optional
        Called with each point at once, also with those of the controllers' own start times.
    workers : int
        Processes of this machine; by default all is computed in this one.
    scheduler : str, optional
        Address of a dask scheduler whose workers compute instead.

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
        If the start under a controller cannot be finished, or workers cannot go on.

    Examples
    --------
    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> front = pareto(crane, [0.2, 0.2883042], terminal="synchronous", controllers=[])
    >>> [point.status for point in front.points], round(front.points[1].k_dyn, 6)
    (['INFEASIBLE', 'OPTIMAL'], 0.909247)

    References
    ----------
    docs/optimal-starts.md; each point: `optimize`.
    """
    options: dict[str, Any] = {"torque_speed": torque_speed, "smoothness": smoothness, "base": base}
    Problem(drive, 1.0, terminal, **options)
    times = None if start_times is None else _checked(start_times)
    made = [
        make_controller(one) for one in (ready_controller_names() if controllers is None else controllers)
    ]
    inputs = _inputs(drive, base, terminal, torque_speed, smoothness)
    count = checked_workers(None if scheduler is not None and workers == 1 else workers, scheduler)
    target = None if save_to is None else Target("save_to", Path(save_to), "limit curve")
    runs = [simulate(drive, one, base=base) for one in made]
    if times is None:
        _tell(progress, "looking for the shortest start time")
        times = default_start_times(drive, terminal, torque_speed=torque_speed, smoothness=smoothness)
    own = [run.start_time for run in runs if not math.isnan(run.start_time)]
    found: dict[tuple[Terminal, float], FrontPoint] = {}
    with (
        Records(target, inputs, ["terminal", "start_time_bound"]) as saved,
        Pool(count, scheduler=scheduler, describe=Stretch.__str__, kept="Finished points are kept.") as pool,
    ):
        for ending in dict.fromkeys([terminal, YARDSTICK]):
            asked = {*(times if ending == terminal else ()), *(own if ending == YARDSTICK else ())}
            points = list(
                _swept(
                    drive, options, ending, sorted(asked, reverse=True), saved, pool, count, progress, each
                )
            )
            found |= {(ending, t): point for t, point in _monotone(points)}
    curve = tuple(found[terminal, t] for t in times)
    if not any(point.found for point in curve) and any(point.status == "NOT_FOUND" for point in curve):
        raise OptimumError(next(point.status_text for point in curve if point.status == "NOT_FOUND"))
    return Front(drive, terminal, curve, tuple(_beside(run, found) for run in runs))


def default_start_times(
    drive: Machine, terminal: Terminal = "reached", count: int = COUNT, **options: Any
) -> list[float]:
    """`count` start times in s, from 1.02 of the shortest found to 1.6 of that of `direct`.

    Closer together towards the short end, where the curve is steep. `options` go to `Problem`.
    """
    shortest = shortest_start_time(Problem(drive, 1.0, terminal, **options))
    if not math.isfinite(shortest):
        raise OptimumError("No start time was found at which there is an optimum; name some to be tried.")
    direct = simulate(drive, "direct").start_time
    longest = LONG * (direct if LONG * direct > 1.2 * shortest else shortest)  # direct may never get there
    share = np.linspace(0.0, 1.0, count) ** 2
    times: list[float] = (SHORT * shortest + (longest - SHORT * shortest) * share).tolist()
    return times


class Stretch(NamedTuple):
    """Start times that follow each other, long ones first, and a demand to begin with."""

    drive: Machine
    options: dict[str, Any]
    terminal: Terminal
    start_times: tuple[float, ...]
    near: TorqueProfile | None

    def __str__(self) -> str:
        return f"the optima for start times of {self.start_times[-1]:.5g} s to {self.start_times[0]:.5g} s"


def computed(asked: Stretch) -> list[FrontPoint]:
    """The points of a stretch; what is infeasible makes all shorter ones so."""
    points: list[FrontPoint] = []
    near = asked.near
    for start_time in asked.start_times:
        if points and points[-1].status == "INFEASIBLE":
            points.append(points[-1].for_shorter(start_time))
            continue
        try:
            best = optimize(asked.drive, start_time, terminal=asked.terminal, near=near, **asked.options)
        except InfeasibleError as error:
            points.append(FrontPoint.of_verdict(error.verdict, start_time, asked.terminal))
        except OptimumError as error:
            points.append(FrontPoint.not_found(str(error), start_time, asked.terminal))
        else:
            points.append(FrontPoint.of_optimum(best, start_time))
            near = best.profile
    return points


def _swept(
    drive: Machine, options: dict[str, Any], terminal: Terminal, times: list[float], saved: Records,
    pool: Pool, workers: int, progress: Progress | None, each: Callable[[FrontPoint], object] | None,
) -> Iterator[FrontPoint]:  # fmt: skip
    """The points of one terminal condition, those kept before first."""
    known = {t: FrontPoint.of_record(one) for t in times if (one := saved.find(terminal, t)) is not None}
    for point in known.values():
        _told(each, point)
        yield point
    missing = [t for t in times if t not in known]
    if workers == 1:
        too_short = next((one for one in known.values() if one.status == "INFEASIBLE"), None)
        for number, t in enumerate(missing, start=1):
            _tell(progress, f"start time {number} of {len(missing)}: {t:.5g} s, {terminal}")
            if too_short is not None and t < too_short.start_time_bound:
                point = too_short.for_shorter(t)
            else:
                longer = {time: one for time, one in known.items() if one.found and time > t}
                last = longer[min(longer)] if longer else None
                near = None if last is None else TorqueProfile(last.time, last.torque)
                (point,) = computed(Stretch(drive, options, terminal, (t,), near))
            known[t] = point
            too_short = point if point.status == "INFEASIBLE" else too_short
            if point.status != "NOT_FOUND":  # another attempt may find it
                saved.add(point.record())
            _told(each, point)
            yield point
        return
    size = max(1, math.ceil(len(missing) / (CHUNKS * workers)))
    chunks = [tuple(missing[i : i + size]) for i in range(0, len(missing), size)]
    asked = [Stretch(drive, options, terminal, one, None) for one in chunks]
    for stretch, points in pool.results(computed, asked):
        _tell(progress, str(stretch))
        for point in points:
            if point.status != "NOT_FOUND":
                saved.add(point.record())
            _told(each, point)
            yield point


def _told(each: Callable[[FrontPoint], object] | None, point: FrontPoint) -> None:
    if each is not None:
        each(point)


def _monotone(points: Sequence[FrontPoint]) -> Iterator[tuple[float, FrontPoint]]:
    """The points, none above one of a shorter start time: a start may arrive early."""
    gentlest: FrontPoint | None = None
    for point in sorted(points, key=lambda one: one.start_time_bound):
        known = math.inf if point.k_dyn is None else point.k_dyn
        if gentlest is None or gentlest.k_dyn is None or known <= gentlest.k_dyn:
            gentlest = point if point.found else gentlest
            yield point.start_time_bound, point
        else:
            early = replace(
                gentlest,
                start_time_bound=point.start_time_bound,
                why=f"the start for {gentlest.start_time_bound:.6g} s is gentler, and may arrive early",
                seconds=point.seconds,
            )
            bounds = ("k_dyn_lower_bound", "bound_kind", "bound_covers")
            yield point.start_time_bound, replace(early, **{name: getattr(point, name) for name in bounds})


def _beside(run: Run, found: dict[tuple[Terminal, float], FrontPoint]) -> ControllerPoint:
    return ControllerPoint(
        run.controller_name, run.k_dyn, run.start_time, run.status.value,
        None if math.isnan(run.start_time) else found[YARDSTICK, run.start_time],
    )  # fmt: skip


def _inputs(
    drive: Machine,
    base: Machine | None,
    terminal: str,
    corners: Any,
    smoothness: float,
) -> dict[str, Any]:
    """All that a point depends on besides its start time, as plain data."""
    return {
        "version of softstart": __version__,
        "drive": drive.to_toml(),
        "base drive": base.to_toml() if base else "",
        "terminal": terminal,
        "torque-speed limit": [[float(speed), float(torque)] for speed, torque in corners],
        "smoothness": float(smoothness),
    }


def _checked(start_times: Sequence[float]) -> list[float]:
    """Start times above 0, sorted, each once."""
    given = list(start_times)
    if not given:
        raise InputError("start_times: the list is empty; give at least one start time in s.")
    wrong = [
        f"start_times = {t!r}: give times above 0 s as numbers."
        for t in given
        if not isinstance(t, Real) or isinstance(t, bool) or not 0.0 < float(t) < math.inf
    ]
    if wrong:
        raise InputError(wrong)
    return sorted({float(t) for t in given})


def _tell(progress: Progress | None, doing: str) -> None:
    if progress is not None:
        progress(doing)
