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
from softstart.chain.model import Chain
from softstart.controller import Controller, make_controller, ready_controller_names
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.late import late
from softstart.optimal.problem import Problem, Terminal, problem_of
from softstart.optimal.result import InfeasibleError, NotConverged, Optimum, OptimumError, Verdict
from softstart.optimal.shortest import shortest_start_time
from softstart.optimal.solving import optimize
from softstart.processes import Pool, checked_workers
from softstart.start.run import Run
from softstart.start.simulation import simulate
from softstart.store import Records, Target

notebook = late("softstart.views.notebook")
optima = late("softstart.views.optima")  # it draws results of this module
chains = late("softstart.optimal.chains.problem")

Status = Literal["OPTIMAL", "INFEASIBLE", "NOT_FOUND"]
Progress = Callable[[str], object]

YARDSTICK: Terminal = "reached"  # a controller is judged by the instant its load has the target speed
SHORT, LONG, COUNT = 1.02, 1.6, 12
QUICKEST = 1.08  # first start time of a chain, or of an unknown position, over that of direct: what is
# shortest is not known there


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

    def proved_by(self, other: FrontPoint) -> FrontPoint:
        """The same point with the lower bound of another one, whose starts include those of this one."""
        return replace(
            self,
            k_dyn_lower_bound=other.k_dyn_lower_bound,
            bound_kind=other.bound_kind,
            bound_covers=other.bound_covers,
        )

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

    drive: Any  # Drive or Chain
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
    drive: Drive | Chain,
    start_times: Sequence[float] | None = None,
    *,
    terminal: Terminal = "reached",
    controllers: Sequence[str | Controller] | None = None,
    method: str = "auto",
    torque_speed: tuple[tuple[float, float], ...] = (),
    smoothness: float = 0.0,
    base: Drive | Chain | None = None,
    save_to: str | Path | None = None,
    progress: Progress | None = None,
    each: Callable[[FrontPoint], object] | None = None,
    workers: int = 1,
    scheduler: str | None = None,
) -> Front:
    """Find the least K_dyn for each of several bounds on the start time, with its lower bound.

    The sweep goes from long start times to short ones, on a chain from short to long ones. An optimum by
    collocation, or of a chain, starts from the one before, so such points are computed one after another; all
    others at once. The results do not depend on who computes them. Start times too short for any start are
    marked infeasible, no error.

    Parameters
    ----------
    drive : Drive or Chain
        The drive, or the chain: of its local optima each starts from that of the next shorter start time and
        from the strategies, the best of these.
    start_times : sequence of float, optional
        Bounds on the start time, s; by default `default_start_times(drive, terminal)`.
    terminal : {"synchronous", "steady", "reached"}
        What holds at the end of each optimal start, as in `optimize`.
    controllers : sequence of str or Controller, optional
        What to put beside the curve; by default all installed controllers that run without being given a
        parameter, none for an empty list. Each is simulated, and judged by the optimum at its own start time
        with terminal `reached`: the fair yardstick.
    method : {"auto", "closed-form", "lp", "collocation"}
        As in `optimize`.
    torque_speed : sequence of (float, float)
        Corners (rad/s, N m) of a concave limit of the motor torque over the motor speed.
    smoothness : float
        Weight in s of integral (du/dt)^2 dt / Ms^2; makes the torque continuous.
    base : Drive, optional
        The drive to whose mean shaft torque K_dyn refers, if not `drive`.
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
    asked_for: dict[str, Any] = {"torque_speed": torque_speed, "smoothness": smoothness, "base": base}
    problem_of(drive, 1.0, terminal, method=method, **asked_for)
    times = None if start_times is None else _checked(start_times)
    made = [
        make_controller(one) for one in (ready_controller_names() if controllers is None else controllers)
    ]
    inputs = _inputs(drive, base, terminal, method, torque_speed, smoothness)
    count = checked_workers(None if scheduler is not None and workers == 1 else workers, scheduler)
    target = None if save_to is None else Target("save_to", Path(save_to), "limit curve")
    start: Any = simulate  # of drives and of chains
    runs = [start(drive, one, base=base) for one in made]
    if times is None:
        _tell(progress, "looking for the shortest start time")
        times = default_start_times(drive, terminal, torque_speed=torque_speed, smoothness=smoothness)
    options = {"method": method, **asked_for}
    own = [run.start_time for run in runs if not math.isnan(run.start_time)]
    asked = {(terminal, t) for t in times} | {(YARDSTICK, t) for t in own}
    with (
        Records(target, inputs, ["terminal", "start_time_bound"]) as saved,
        Pool(
            count, scheduler=scheduler, describe=PointAsked.__str__, kept="Finished points are kept."
        ) as pool,
    ):
        found = _Sweep(drive, options, saved, progress, each, pool).through(asked)
    points = tuple(found[terminal, t] for t in times)
    if not any(point.found for point in points) and any(point.status == "NOT_FOUND" for point in points):
        raise OptimumError(next(point.status_text for point in points if point.status == "NOT_FOUND"))
    return Front(drive, terminal, points, tuple(_beside(run, found) for run in runs))


def default_start_times(
    drive: Drive | Chain, terminal: Terminal = "reached", count: int = COUNT, **options: Any
) -> list[float]:
    """`count` start times in s, from 1.02 of the shortest feasible one to 1.6 of that of `direct`.

    Where the shortest one cannot be found, that of `direct` stands for it; on a chain 1.08 of that, and where
    the start position is unknown, with half as many times. Closer together towards the short end, where the
    curve is steep. `options` go to `Problem`.
    """
    direct = simulate(drive, "direct").start_time
    shortest = shortest_known(drive, terminal, **options)
    if shortest is None:
        shortest, count = direct * QUICKEST / SHORT, count // 2 if len(drive.positions) > 1 else count
    if not math.isfinite(shortest):
        shortest = direct
    if not math.isfinite(shortest):
        raise OptimumError("No start time was found at which there is an optimum; name some to be tried.")
    longest = LONG * (direct if LONG * direct > 1.2 * shortest else shortest)  # direct may never get there
    share = np.linspace(0.0, 1.0, count) ** 2
    times: list[float] = (SHORT * shortest + (longest - SHORT * shortest) * share).tolist()
    return times


def shortest_known(drive: Drive | Chain, terminal: Terminal, **options: Any) -> float | None:
    """The shortest feasible start time, s; None of a chain and over several positions: nobody knows it."""
    if isinstance(drive, Chain) or len(drive.positions) > 1:
        return None
    return shortest_start_time(Problem(drive, 1.0, terminal, **options))


class PointAsked(NamedTuple):
    """A point to be computed, what another one left to start from, and for how long (s) to go on.

    Without a time limit a chain is looked for from all its seeds, a drive until there is an optimum.
    """

    drive: Drive | Chain
    options: dict[str, Any]
    terminal: Terminal
    start_time: float
    warm: Any = None
    time_limit: float | None = None

    def __str__(self) -> str:
        return f"the optimum for a start time of {self.start_time:.5g} s"


def computed(asked: PointAsked) -> tuple[FrontPoint, Any]:
    """The point, and what the next one can start from."""
    terminal, start_time, warm = asked.terminal, asked.start_time, asked.warm
    why = ""
    for start in (warm, None) if warm is not None else (None,):
        from_seeds = start is None and isinstance(asked.drive, Chain)
        seconds = asked.time_limit if asked.time_limit is not None else math.inf if from_seeds else 0.0
        try:
            best = optimize(
                asked.drive, start_time, terminal=terminal, warm=start, time_limit=seconds, **asked.options
            )
        except InfeasibleError as error:
            return FrontPoint.of_verdict(error.verdict, start_time, terminal), warm
        except (OptimumError, NotConverged) as error:
            why = str(error)
            continue  # where the warm start failed, it is tried without
        return FrontPoint.of_optimum(best, start_time), best.warm
    return FrontPoint.not_found(why, start_time, terminal), None


@dataclass(frozen=True)
class _Sweep:
    """Optima for many start times: of drives the longest first, of chains the shortest.

    An answer of a chain, stretched over more time, leads to a good local optimum; pressed into less time it
    misses the target. Of a drive, what is impossible in a long time needs no search in a shorter one.
    """

    drive: Drive | Chain
    options: dict[str, Any]
    saved: Records
    progress: Progress | None
    each: Callable[[FrontPoint], object] | None
    pool: Pool

    def through(self, asked: set[tuple[Terminal, float]]) -> dict[tuple[Terminal, float], FrontPoint]:
        """All points asked for."""
        found: dict[tuple[Terminal, float], FrontPoint] = {}
        first = 1.0 if isinstance(self.drive, Chain) else -1.0
        order = sorted(asked, key=lambda one: (one[0], first * one[1]))
        for terminal in dict.fromkeys(terminal for terminal, _ in order):
            chain = _Chain(self, terminal, [t for other, t in order if other == terminal])
            too_short: FrontPoint | None = None
            for start_time in chain.start_times:
                record = self.saved.find(terminal, start_time)
                if record is not None:
                    point = FrontPoint.of_record(record)
                elif too_short is not None:  # what no longer start time allowed, no shorter one does
                    point = too_short.for_shorter(start_time)
                else:
                    number = order.index((terminal, start_time)) + 1
                    _tell(
                        self.progress, f"start time {number} of {len(order)}: {start_time:.5g} s, {terminal}"
                    )
                    point = chain.computed(start_time)
                    if point.status != "NOT_FOUND":  # another attempt may find it
                        self.saved.add(point.record())
                if point.status == "INFEASIBLE" and first < 0.0:
                    too_short = point
                    chain.stopped = True
                found[terminal, start_time] = point
                if self.each is not None:
                    self.each(point)
            longest_first = sorted(chain.start_times, reverse=True)
            found |= {(terminal, t): point for t, point in _monotone(found, terminal, longest_first)}
        return found


def _monotone(
    found: dict[tuple[Terminal, float], FrontPoint], terminal: Terminal, start_times: list[float]
) -> Iterator[tuple[float, FrontPoint]]:
    """The points: none above one of a shorter start time, no bound below that of a longer one.

    A start may arrive early, so that it counts for every longer time as well; and what no start of a longer
    time can do, none of a shorter one can.
    """
    proof, proved = FrontPoint(math.inf, terminal, "NOT_FOUND", ""), []
    for point in (found[terminal, t] for t in start_times):
        if point.found and (point.k_dyn_lower_bound or 0.0) >= (proof.k_dyn_lower_bound or 0.0):
            proof = point
        proved.append(point if point.status == "INFEASIBLE" else point.proved_by(proof))
    gentlest: FrontPoint | None = None
    for point in reversed(proved):
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
            yield point.start_time_bound, early.proved_by(point)


class _Chain:
    """Points of one terminal condition, in the order of the sweep.

    A point of the collocation, and of a chain, leaves something for the next one to start from: these are
    computed one after another. Where the first point leaves nothing, the others are computed in advance.
    """

    def __init__(self, sweep: _Sweep, terminal: Terminal, start_times: list[float]) -> None:
        self.sweep, self.terminal, self.start_times = sweep, terminal, start_times
        self.stopped = False  # the last point was infeasible, and so are all shorter ones
        self._warm: Any = None
        self._ahead: Iterator[tuple[PointAsked, tuple[FrontPoint, Any]]] | None = None
        self._done: dict[float, tuple[FrontPoint, Any]] = {}

    def computed(self, start_time: float) -> FrontPoint:
        """The point of a start time."""
        results = self.sweep.pool.results
        if self._warm is None and self._ahead is not None:
            while start_time not in self._done:
                asked, answer = next(self._ahead, (None, None))
                if asked is None or answer is None:
                    break  # it was not computed in advance
                self._done[asked.start_time] = answer
        if self._warm is not None or start_time not in self._done:
            ((_, answer),) = results(computed, [self._point(start_time, self._warm)])
            self._done[start_time] = answer
        point, self._warm = self._done[start_time]
        if self._ahead is None and self._warm is None:
            self._ahead = results(computed, self._shorter_than(start_time))
        return point

    def _shorter_than(self, start_time: float) -> Iterator[PointAsked]:
        for other in self.start_times:
            if self.stopped or self._warm is not None:
                return
            if other < start_time and self.sweep.saved.find(self.terminal, other) is None:
                yield self._point(other)

    def _point(self, start_time: float, warm: Any = None) -> PointAsked:
        return PointAsked(self.sweep.drive, self.sweep.options, self.terminal, start_time, warm)


def _beside(run: Run, found: dict[tuple[Terminal, float], FrontPoint]) -> ControllerPoint:
    return ControllerPoint(
        run.controller_name, run.k_dyn, run.start_time, run.status.value,
        None if math.isnan(run.start_time) else found[YARDSTICK, run.start_time],
    )  # fmt: skip


def _inputs(
    drive: Drive | Chain,
    base: Drive | Chain | None,
    terminal: str,
    method: str,
    corners: Any,
    smoothness: float,
) -> dict[str, Any]:
    """All that a point depends on besides its start time, as plain data."""
    return {
        "version of softstart": __version__,
        "drive": drive.to_toml(),
        "base drive": base.to_toml() if base else "",
        "terminal": terminal,
        "method": method,
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
