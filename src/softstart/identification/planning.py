"""What an experiment would tell, before it is run: Fisher information, and a torque that tells more.

`plan_experiments` answers which experiment to run: expected intervals of the standard ones, and of one torque
whose levels are chosen for this drive.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
from scipy.optimize import minimize

from softstart.arrays import Vector
from softstart.chain.machines import records
from softstart.controller import Controller, make_controller
from softstart.drive import FRICTIONS, Drive
from softstart.errors import InputError
from softstart.identification.fitting import Fitter, Point, Sizes, data_of
from softstart.identification.logs import Log, TorqueIs
from softstart.identification.model import POSITION, LogModel
from softstart.identification.traces import FEWEST, Kind
from softstart.identification.unknowns import chosen, unknowns_of, usual, values_of
from softstart.kernel.records import S_PHI
from softstart.profile import TorqueProfile
from softstart.quantities import nearest, show, to_si
from softstart.start.batch import prepared
from softstart.start.comparison import INTERVAL
from softstart.start.engine import ended
from softstart.start.rows import MAX_EVENTS

LEVEL: Final = 0.65  # of the starting torque
SAMPLES: Final = 400  # of an experiment at most
RIPPLE: Final = 0.025  # of the torque level
PLACE: Final = -0.6  # position in the gap for which widths are stated
CHECKED: Final = 257  # start positions from which an experiment is simulated first, see `largest`
DESIGN, COARSE = 2, 4  # of these every second while a torque is designed, and every fourth for the travel
KINKS: Final = 16  # parts of the distance between them in which changes of the contacts are located
EXACT: Final = 1e-9  # relative error of a largest value
SHORTEST: Final = 1e-13  # of the gap, between positions
PIECES: Final = 9  # levels of a designed torque at least
ROUGH: Final = 150  # samples at most while a torque is designed
DRAWS: Final = 40  # random torques, from the best of which
TRIALS: Final = 200  # torques are then tried in search of a better one
EXACTLY, EVERY = 10, 4  # so many of these, one in so many of the best, are computed exactly
SPREAD: Final = 0.15  # of the largest level: the first steps
WIDER: Final = 4.0  # times the largest level of a seed: as far as a design may go
NEAR: Final = 0.01  # relative distance of a design to its limits: for positions between those checked then


@dataclass(frozen=True, eq=False)
class Experiment:
    """A torque demand and what it would tell.

    Attributes
    ----------
    name : str
        What it is called.
    profile : TorqueProfile
        The torque demand.
    end : float
        When the log ends, s.
    widths : dict
        Half an interval of 95 % over the value for each parameter; infinite where it would be unknown.
    peak : float
        Peak of the shaft torque on the exact plant, N m, from the worst position in the gap.
    travel : float
        How far the load is moved at most from where it stood, rad at the motor shaft.
    wanted : tuple of str
        The parameters that `score` is about; all of them if it is empty.
    found_by : str
        "standard", or what the torque was designed with.

    Examples
    --------
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> shaking = plan_experiments(crane, optimise=False)["shaking"]
    >>> shaking.peak < crane.load_torque * 6, round(shaking.travel, 1)
    (True, 0.1)

    References
    ----------
    docs/identification.md.
    """

    name: str
    profile: TorqueProfile
    end: float
    widths: dict[str, float]
    peak: float
    travel: float
    wanted: tuple[str, ...] = ()
    found_by: str = "standard"

    @property
    def score(self) -> float:
        """Root mean square of the half intervals of the wanted parameters; less is better.

        Of logarithms, so that units do not matter (A-optimal). A determinant (D-optimal) would pay for a
        vague gap with a sharp inertia.
        """
        widths = np.array([self.widths[name] for name in self.wanted or self.widths])
        return float(np.sqrt(np.mean(np.minimum(widths, 1e3) ** 2)))


@dataclass(frozen=True, eq=False)
class Plan:
    """Experiments for a drive, the standard ones and the best one found.

    Attributes
    ----------
    drive : Drive
        The drive as it is thought to be.
    experiments : tuple of Experiment
        The standard ones, then the planned one.
    log_period, ripple : float
        Sample period of the log, s; torque error in each sample, N m.

    Examples
    --------
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> plan = plan_experiments(crane, log_period="4 ms", optimise=False)
    >>> [one.name for one in plan.experiments]
    ['start', 'two levels', 'two levels, then reverse', 'reversed three times', 'shaking']
    >>> plan["start"].widths["gap"] > plan["two levels, then reverse"].widths["gap"]
    True

    References
    ----------
    docs/identification.md.
    """

    drive: Drive
    experiments: tuple[Experiment, ...]
    log_period: float
    ripple: float
    lines: float

    def __getitem__(self, name: str) -> Experiment:
        """The experiment of this name."""
        return next(one for one in self.experiments if one.name == name)

    @property
    def best(self) -> Experiment:
        """The one that tells most."""
        return min(self.experiments, key=lambda one: one.score)

    def summary(self) -> dict[str, Any]:
        """Everything as numbers and words, for JSON."""
        return {
            "drive": self.drive.name,
            "log_period": self.log_period,
            "ripple": self.ripple,
            "encoder_lines": self.lines,
            "experiments": [
                {
                    "name": one.name,
                    "half_width_percent": {name: 100.0 * width for name, width in one.widths.items()},
                    "peak_shaft_torque": one.peak,
                    "travel": one.travel,
                    "found_by": one.found_by,
                    "time": one.profile.time.tolist(),
                    "torque": one.profile.torque.tolist(),
                    "end": one.end,
                }
                for one in self.experiments
            ],
            "best": self.best.name,
        }

    def _repr_html_(self) -> Any:
        """What a notebook shows."""
        from softstart.views import identification as views
        from softstart.views import sheet

        return sheet.as_html(views.plan_sheet(self))


def plan_experiments(
    drive: Drive | str,
    *,
    log_period: float | str = "4 ms",
    ripple: float | str | None = None,
    free: Sequence[str] | None = None,
    signal: Kind = "angle",
    wanted: Sequence[str] = (),
    max_torque: float | str | None = None,
    max_travel: float | str | None = None,
    optimise: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Find what standard experiments would tell about a drive, and a torque that tells more.

    No fit is made: the derivatives of the exact plant and the covariance of encoder and torque error give the
    interval that a fit would have (Fisher information). The position in the gap is unknown in each where the
    load is reactive.

    The planned torque has at least nine levels, on edges of the best standard experiment that keeps the
    limits, and its duration. From the best of 40 random torques the levels are improved by linear
    approximations (COBYLA: M. J. D. Powell), minimising `Experiment.score` with the peak of the shaft torque
    from each position and the travel within the limits. The best torque that keeps all limits on the exact
    plant is returned: never less than the best standard experiment tells within them. It is a local optimum.

    Parameters
    ----------
    drive : Drive or str
        The drive as it is thought to be.
    log_period : float or str
        Sample period of the log, s.
    ripple : float or str, optional
        Standard deviation of the torque error in each sample, N m; 2.5 % of 0.65 Ms by default.
    free : sequence of str, optional
        What is to be found, as in `identify`.
    signal : {"angle", "speed"}
        What the log holds beside the torque. An angle has the drive's encoder; a speed the difference of its
        counts.
    wanted : sequence of str, optional
        The parameters that the planned torque is to tell best; all that are to be found by default.
    max_torque : float or str, optional
        Largest shaft torque that a planned experiment may have, N m; by default the permissible one of the
        drive, or else the largest of the standard experiments.
    max_travel : float or str, optional
        How far the load may be moved, rad at the motor shaft; no limit by default.
    optimise : bool
        Whether to look for a better torque.
    progress : callable, optional
        Called with a text that says what is being done.

    Returns
    -------
    Plan
        The experiments with their intervals, peaks and travel.

    Raises
    ------
    InputError
        For bad input, and for limits that no experiment keeps.

    Examples
    --------
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> plan_experiments(crane, optimise=False).best.name
    'reversed three times'

    References
    ----------
    A. C. Atkinson, A. N. Donev, Optimum Experimental Designs, 1992; docs/identification.md.
    """
    drive = Drive.load(drive) if isinstance(drive, str) else drive
    period = float(to_si(log_period, "s", name="log_period"))
    if not 0.0 < period < math.inf:
        raise InputError(f"log_period = {show(log_period)}: the sample period of the log is above 0.")
    level = _level(drive)
    error = RIPPLE * level if ripple is None else float(to_si(ripple, "N*m", name="ripple"))
    if not 0.0 < error <= float(drive.Ms):
        raise InputError(
            f"ripple = {show(ripple)}: the torque error of a sample is above 0 and at most the "
            f"starting torque, {float(drive.Ms):.4g} N m."
        )
    shortest = min(float(np.sum(durations)) for durations, _ in standard_levels(drive, level).values())
    if period > shortest / FEWEST:
        raise InputError(
            f"log_period = {show(log_period)}: the shortest experiment lasts {shortest:.3g} s, and a "
            f"fit needs {FEWEST} samples; give a sample period of {shortest / FEWEST:.2g} s or less."
        )
    asked = _asked(free, drive)
    for name in wanted:
        if name not in asked:
            near = nearest(name, asked)
            hint = f"did you mean {near}?" if near else f"those are {', '.join(asked)}."
            raise InputError(f"wanted = {show(name)}: it is no parameter that is to be found; {hint}")
    bench = Bench(drive, period, error, asked, signal, tuple(wanted), progress or (lambda _: None))
    standard = [bench.experiment(name, *levels) for name, levels in standard_levels(drive, level).items()]
    usual_peak = max(one.peak for one in standard)
    usual_peak = usual_peak if drive.permissible_torque is None else drive.permissible_torque
    torque = float(to_si(usual_peak if max_torque is None else max_torque, "N*m", name="max_torque"))
    travel = math.inf if max_travel is None else float(to_si(max_travel, "rad", name="max_travel"))
    for key, limit, given in (("max_torque", torque, max_torque), ("max_travel", travel, max_travel)):
        if not limit > 0.0:
            raise InputError(f"{key} = {show(given)}: a limit is above 0.")
    planned = [bench.designed(standard, torque, travel)] if optimise else []
    return Plan(drive, (*standard, *planned), period, error, float(drive.encoder_lines))


def made_up_log(
    drive: Drive,
    experiment: str | Experiment,
    *,
    log_period: float = 1e-3,
    ripple: float = 0.0,
    position: float = -0.6,
    phase: float = 0.3,
    seed: int = 0,
    signal: Kind = "angle",
    torque_is: TorqueIs = "demand",
) -> Log:
    """A log that the exact plant makes up: torque error, encoder and all; for trying, and for tests.

    `ripple` is the standard deviation of the error of the torque in each sample, N m; `position` where in the
    gap it begins; `phase` that of the encoder.

    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08)
    >>> made_up_log(crane, "start").kind
    'angle'
    """
    levels = standard_levels(drive, _level(drive))
    if isinstance(experiment, Experiment):
        profile, end = experiment.profile, experiment.end
    elif experiment in levels:
        profile, end = steps_of(*levels[experiment])
    else:
        raise InputError(f"experiment = {show(experiment)}: it is none of {', '.join(levels)}.")
    time = np.arange(0.0, end, log_period)
    demand = profile.at(time)
    generator = np.random.default_rng(seed)
    played = demand + ripple * generator.standard_normal(time.size)
    model = LogModel.of(Log.planned(time, played, signal), _at_rest(drive))
    start = {POSITION: position} if float(drive.gap) > 0.0 and _moving(drive) else {}
    states = model.motion(start).at(time)
    angle = states["phi"][:, 0] - states["phi"][0, 0]
    count = 2.0 * math.pi / (4.0 * float(drive.encoder_lines)) if drive.encoder_lines else 0.0
    if count:
        angle = np.floor(angle / count + phase) * count
    speed = states["w"][:, 0] if not count else np.diff(angle, prepend=angle[0]) / log_period
    torque = demand if torque_is == "demand" else states["u"]
    values = {signal: speed if signal == "speed" else angle}
    return Log(time, torque, **values, torque_is=torque_is, name="made-up log")


def _moving(drive: Drive) -> bool:
    return drive.start_position == "unknown" or drive.load_kind == "reactive"


def _at_rest(drive: Drive) -> Drive:
    return drive.replace(start_position="mid-gap") if _moving(drive) else drive.design_drive


def _asked(free: Sequence[str] | None, drive: Drive) -> tuple[str, ...]:
    names = usual(drive, lag=True)
    asked = chosen(free, names, list(dict.fromkeys([*names, *FRICTIONS])), "this log")
    missing = [name for name in asked if float(getattr(drive, name)) == 0.0]
    if free is not None and missing:
        raise InputError(f"free = {show(missing[0])}: it is 0 in the drive; give a guess of it.")
    return tuple(name for name in asked if name not in missing)


def _level(drive: Drive) -> float:
    Ms, Mc = float(drive.Ms), abs(float(drive.Mc))
    return max(LEVEL * Ms, min(Ms, 1.5 * Mc))


def standard_levels(drive: Drive, level: float) -> dict[str, tuple[Vector, Vector]]:
    """Durations and levels of the standard experiments."""
    crossing = math.sqrt(2.0 * float(drive.gap) * float(drive.J1) / level)
    part = 1.5 * crossing + 2.0 * float(drive.elastic_period) + 4.0 * float(drive.torque_lag)
    Mc = abs(float(drive.Mc))
    lower = Mc + 0.25 * (level - Mc)
    found = {
        "start": ([2.0 * part], [level]),
        "two levels": ([part, part], [level, lower]),
    }
    if drive.load_kind == "reactive":
        back = LEVEL * level
        found["two levels, then reverse"] = ([part, part, 2.0 * part], [level, lower, -back])
        found["reversed three times"] = ([part] * 2 + [2.0 * part] * 3, [level, lower, -back, back, -back])
        if Mc > 0.0:
            found["shaking"] = ([part] * 4, [0.8 * Mc, -0.8 * Mc, 0.8 * Mc, -0.8 * Mc])
    return {name: (np.array(times), np.array(levels)) for name, (times, levels) in found.items()}


def largest(figure: Callable[[Vector], tuple[Vector, Vector]], places: Vector) -> float:
    """The largest value of a figure that is continuous in the start position.

    `figure` gives values and counts of contacts. An interval is halved while it may hold a larger value, by
    the values at its ends and the slopes there and beside; and where the count changes: a contact that is
    only just made, or just missed, has a steep and narrow peak beside it.

    >>> round(largest(lambda x: (1.0 - abs(x - 0.1234567), x > 0.12), np.linspace(0.0, 1.0, 5)), 9)
    1.0
    """
    span, (values, counts) = float(np.ptp(places)), figure(places)
    close = 1.01 * span / (KINKS * CHECKED)
    while True:
        steps, rises = np.diff(places), np.pad(np.abs(np.diff(values)), 1)
        room = np.maximum(rises[1:-1], np.maximum(rises[:-2], rises[2:]))
        may = np.maximum(values[1:], values[:-1]) + room > (1.0 + EXACT) * values.max()
        may = (may & (steps > SHORTEST * span)) | ((counts[1:] != counts[:-1]) & (steps > close))
        if not may.any():
            return float(values.max())
        after = np.flatnonzero(may) + 1
        middles = 0.5 * (places[after - 1] + places[after])
        more = figure(middles)
        places = np.insert(places, after, middles)
        values, counts = np.insert(values, after, more[0]), np.insert(counts, after, more[1])


def _player(profile: TorqueProfile) -> Controller:
    return make_controller("profile", {"profile": profile})


def steps_of(durations: Vector, levels: Vector) -> tuple[TorqueProfile, float]:
    """The torque of these levels, and when it ends.

    >>> steps_of(np.array([0.1, 0.2]), np.array([30.0, 10.0]))[1].__round__(12)
    0.3
    """
    edges = np.concatenate([[0.0], np.cumsum(durations)])
    return TorqueProfile.steps(edges, levels), float(edges[-1])


@dataclass(frozen=True, eq=False)
class Bench:
    """A drive, an inverter's log and an encoder: what any torque would tell.

    Attributes
    ----------
    drive : Drive
        The drive as it is thought to be.
    period, ripple : float
        Sample period of the log, s; torque error in each sample, N m.
    free, wanted : tuple of str
        What is to be found, and what of it `Experiment.score` is about.
    signal : {"angle", "speed"}
        What the log holds.
    progress : callable
        Called with the name of each experiment.
    """

    drive: Drive
    period: float
    ripple: float
    free: tuple[str, ...]
    signal: Kind = "angle"
    wanted: tuple[str, ...] = ()
    progress: Callable[[str], None] = lambda _: None

    @property
    def moving(self) -> bool:
        """Whether the position in the gap is unknown."""
        return _moving(self.drive) and float(self.drive.gap) > 0.0

    @property
    def wide(self) -> Drive:
        """The drive with a motor that has the torque of any design."""
        limit = 10.0 * float(self.drive.Ms)
        return _at_rest(self.drive).replace(maximum_torque=limit, minimum_torque=-limit, brake="none")

    @property
    def places(self) -> Vector:
        """Positions of the motor in the gap, rad."""
        half = 0.5 * float(self.drive.gap)
        return np.linspace(-half, half, CHECKED) if self.moving else np.zeros(1)

    def experiment(self, name: str, durations: Vector, levels: Vector, rough: bool = False) -> Experiment:
        """What these levels would tell; roughly, for a design."""
        self.progress(name)
        profile, end = steps_of(durations, levels)
        period = max(self.period, end / (ROUGH if rough else SAMPLES))
        time = np.arange(0.0, end + 0.5 * period, period)
        log = Log.planned(time, profile.at(time), self.signal)
        unknowns = unknowns_of(self.free, self.drive, [log], [self.moving])
        numbers = {POSITION: PLACE, "offset": 0.0}
        x = np.array([
            one.number(float(numbers.get(one.name, getattr(self.drive, one.name, 0.0)))) for one in unknowns
        ])  # fmt: skip
        model = LogModel.of(log, _at_rest(self.drive), SAMPLES)
        signal = model.signals([values_of(unknowns, x, 0)])[0]
        count = 2.0 * math.pi / (4.0 * float(self.drive.encoder_lines)) if self.drive.encoder_lines else 0.0
        count = count if self.signal == "angle" else count / period
        model = replace(model, log=log.changed(values=signal, count=count))
        logged = np.round(signal / count) * count if count else signal
        fitter = Fitter((model,), unknowns, (data_of(model, logged),))
        spot = fitter.spot(x, 0, np.zeros(model.blocks), derivatives=True)
        # a longer period stands for samples left out: the same error of the torque in each of them
        sizes = Sizes(1.0, self.ripple * math.sqrt(self.period / period))
        variances = np.diag(fitter.covariance(Point(x, sizes, (spot,), np.zeros(x.size))))
        widths = {}
        for one, number, variance in zip(unknowns, x.tolist(), variances.tolist(), strict=True):
            half = min(INTERVAL.quantile * math.sqrt(variance), 50.0)
            if one.log is None:
                width = math.sinh(half) if one.kind == "logarithm" else one.share(number, half)
                # a design needs the slope of what is unknown
                widths[one.name] = width if rough or one.known(number, half) else math.inf
        peak, travel = (math.nan, math.nan) if rough else self.load(profile, end)
        return Experiment(name, profile, end, widths, peak, travel, self.wanted)

    def load(self, profile: TorqueProfile, end: float) -> tuple[float, float]:
        """Largest shaft torque and travel of the load, of all positions in the gap."""
        peak = largest(lambda places: self.peaks(profile, end, places), self.places)
        return peak, largest(lambda places: self.travels(profile, end, places), self.places[::COARSE])

    def peaks(self, profile: TorqueProfile, end: float, places: Vector) -> tuple[Vector, Vector]:
        """Peak of the shaft torque from each of these positions, and how often the gap opens and closes."""
        starts = records(self.wide, start_position=places) if self.moving else [self.wide]
        notes = prepared(starts).notes([_player(profile).set_up(self.wide)], until=end)
        for one in notes.starts:
            ended(one, int(one["status"]), end, MAX_EVENTS, f"Experiment of {end:.4g} s,")
        return notes.peaks[:, 0], notes["gap_events"]

    def travels(self, profile: TorqueProfile, end: float, places: Vector) -> tuple[Vector, Vector]:
        """Travel of the load from each of these positions, and how often the gap opens and closes.

        Seen at events and samples: exact for a reactive load, which turns at events only.
        """
        times = np.union1d(profile.time[profile.time < end], end)
        if self.drive.load_kind != "reactive":
            times = np.union1d(times, np.linspace(0.0, end, SAMPLES))
        model = LogModel.of(Log.planned(times, profile.at(times), self.signal), _at_rest(self.drive))
        found = np.empty((2, places.size))
        for i, share in enumerate((places / (0.5 * float(self.drive.gap) or 1.0)).tolist()):
            motion = model.motion({POSITION: share} if self.moving else {})
            angles = motion.states[:, S_PHI]
            found[:, i] = np.max(np.abs(angles - angles[0])), motion.notes.gap_events
        return found[0], found[1]

    def excess(self, profile: TorqueProfile, end: float, torque: float, travel: float) -> float:
        """By which share the worst of some positions exceeds the limits, below 0 where all keep them."""
        places = self.places[::DESIGN]
        found = float(self.peaks(profile, end, places)[0].max()) / torque
        if travel < math.inf:
            found = max(
                found, float(self.travels(profile, end, self.places[:: 4 * COARSE])[0].max()) / travel
            )
        return found - 1.0

    def keeping(self, one: Experiment, torque: float, travel: float) -> Experiment | None:
        """The experiment, its levels made smaller until it keeps the limits."""
        edges = edges_of(one)
        durations = np.diff([*edges, one.end])
        for share in (1.0, 0.99, 0.98, 0.97, 0.95, 0.93, *0.85 ** np.arange(1, 20)):
            levels = share * one.profile.at(edges)
            if self.excess(*steps_of(durations, levels), torque, travel) > 0.0:
                continue
            found = one if share == 1.0 else self.experiment(one.name, durations, levels)
            if found.peak <= torque and found.travel <= travel:
                return found
        return None

    def designed(self, seeds: Sequence[Experiment], torque: float, travel: float) -> Experiment:
        """The torque within the limits that tells most, from the best of the seeds."""
        kept = [one for one in (self.keeping(seed, torque, travel) for seed in seeds) if one is not None]
        if not kept:
            raise InputError(
                f"max_torque = {torque:.4g} N m, max_travel = {travel:.4g} rad: no experiment keeps them, "
                "however small its torque; raise the limit."
            )
        seed = min(kept, key=lambda one: one.score)
        durations, levels = self._pieces(seed)
        scale = float(np.max(np.abs(levels)))
        lower = max(min(float(levels.min()), float(self.drive.minimum_torque)) / scale, -WIDER)
        upper = min(float(self.drive.Ms) / scale, WIDER)

        def limited(shares: Vector) -> Vector:
            """Levels within the bounds, made smaller until some positions keep the limits."""
            shares = np.clip(shares, lower, upper)
            for _ in range(3):
                over = self.excess(*steps_of(durations, scale * shares), torque, travel) + NEAR
                if over <= 0.0:
                    break
                shares = shares * (1.0 - NEAR) / (1.0 + over)
            return np.asarray(shares)

        tried: list[tuple[float, Vector]] = []

        def score(shares: Vector) -> float:
            kept = scale * limited(shares)
            tried.append((self.experiment("planned", durations, kept, rough=True).score, kept))
            return math.log(tried[-1][0])

        generator = np.random.default_rng(0)
        draws = [levels / scale, *generator.uniform(lower, upper, (DRAWS, levels.size))]
        options = {"rhobeg": SPREAD, "maxiter": TRIALS}
        minimize(score, min(draws, key=score), method="COBYLA", options=options)
        tried.sort(key=lambda one: one[0])
        best = seed
        for _, each in tried[: EVERY * EXACTLY : EVERY]:
            exact = self.keeping(self.experiment("planned", durations, each), torque, travel)
            best = min((one for one in (best, exact) if one is not None), key=lambda one: one.score)
        by = f'"{seed.name}"' if best is seed else f'COBYLA, from "{seed.name}"'
        return replace(best, name="planned", found_by=by)

    def _pieces(self, seed: Experiment) -> tuple[Vector, Vector]:
        """Durations and levels of a seed, cut into more pieces with edges on samples."""
        edges = np.append(edges_of(seed), seed.end)
        each = math.ceil(PIECES / (edges.size - 1))
        cut = np.concatenate([np.linspace(*ends, each, endpoint=False) for ends in pairwise(edges)])
        period = max(self.period, seed.end / ROUGH)
        cut = np.unique(np.round(cut / period)) * period
        return np.diff(np.append(cut, seed.end)), seed.profile.at(cut)


def edges_of(one: Experiment) -> Vector:
    """Where the levels of an experiment begin, s."""
    return np.unique(np.concatenate([[0.0], one.profile.time]))[: None if one.profile.end < one.end else -1]
