"""What an experiment would tell, before it is run: Fisher information, and a torque that tells more."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.optimize import minimize
from scipy.stats import norm

from softstart.arrays import Vector
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.identification.fitting import FREE, Errors, Fitter, Space, covariance_of
from softstart.identification.logs import FEWEST, Kind, Log, TorqueIs
from softstart.identification.model import POSITION, LogModel
from softstart.identification.result import CONFIDENCE, WIDEST
from softstart.late import late
from softstart.plant import record
from softstart.profile import TorqueProfile
from softstart.quantities import nearest, show, to_si

views = late("softstart.views.identification")  # above this module; see softstart.late

LEVEL: Final = 0.65  # of the starting torque
SAMPLES: Final = 400  # of an experiment at most
RIPPLE: Final = 0.025  # of the torque level
EVALUATIONS: Final = 100


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
        Peak of the shaft torque, N m, the worst of the positions in the gap.
    travel : float
        How far the load is moved at most from where it stood, rad at the motor shaft.

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

    @property
    def score(self) -> float:
        """One figure: the root mean square of the logarithmic standard deviations; less is better."""
        return _score(np.array(list(self.widths.values())))


@dataclass(frozen=True, eq=False)
class Plan:
    """Experiments for a drive, the standard ones and the best one found.

    Attributes
    ----------
    drive : Drive
        The drive as it is thought to be.
    experiments : tuple of Experiment
        The standard ones, and last the planned one.
    log_period, ripple : float
        Sample period of the log, s; torque error in each sample, N m.

    Examples
    --------
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> plan = plan_experiments(crane, log_period="4 ms", optimise=False)
    >>> [one.name for one in plan.experiments]
    ['start', 'two levels', 'two levels, then reverse', 'shaking']
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
                    "time": one.profile.time.tolist(),
                    "torque": one.profile.torque.tolist(),
                    "end": one.end,
                }
                for one in self.experiments
            ],
            "best": self.best.name,
        }


def plan_experiments(
    drive: Drive | str,
    *,
    log_period: float | str = "4 ms",
    ripple: float | str | None = None,
    free: Sequence[str] | None = None,
    signal: Kind = "angle",
    most_torque: float | str | None = None,
    most_travel: float | str | None = None,
    optimise: bool = True,
    tell: Callable[[str], None] | None = None,
) -> Plan:
    """Find what standard experiments would tell about a drive, and a torque that tells more.

    No fit is made: the derivatives of the exact plant and the covariance of encoder and torque error give the
    interval that a fit would have (Fisher information). The position in the gap is unknown in each where the
    load is reactive. The planned torque starts from the best standard one that keeps the limits; levels and
    times are moved as long as the intervals become narrower.

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
    most_torque : float or str, optional
        Largest shaft torque that an experiment may have, N m; that of the standard start by default.
    most_travel : float or str, optional
        How far the load may be moved, rad at the motor shaft; no limit by default.
    optimise : bool
        Whether to look for a better torque.
    tell : callable, optional
        Is told what is being done.

    Returns
    -------
    Plan
        The experiments with their intervals, peaks and travel.

    Raises
    ------
    InputError
        For bad input.

    Examples
    --------
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> plan_experiments(crane, optimise=False).best.name
    'two levels, then reverse'

    References
    ----------
    A. C. Atkinson, A. N. Donev, Optimum Experimental Designs, 1992; docs/identification.md.
    """
    drive = drive if isinstance(drive, Drive) else Drive.load(drive)
    if drive.shape:
        raise InputError("drive: a batch of drives has no plan; give one drive.")
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
    shortest = min(float(np.sum(durations)) for durations, _ in _standard(drive, level).values())
    if period > shortest / FEWEST:
        raise InputError(
            f"log_period = {show(log_period)}: the shortest experiment lasts {shortest:.3g} s, and a "
            f"fit needs {FEWEST} samples; give a sample period of {shortest / FEWEST:.2g} s or less."
        )
    bench = _Bench(drive, period, error, _asked(free, drive), signal, tell or (lambda _: None))
    standard = [bench.experiment(name, *levels) for name, levels in _standard(drive, level).items()]
    torque = standard[0].peak if most_torque is None else float(to_si(most_torque, "N*m", name="most_torque"))
    travel = math.inf if most_travel is None else float(to_si(most_travel, "rad", name="most_travel"))
    planned = [bench.better(standard, torque, travel)] if optimise else []
    lines = float(drive.encoder_lines)
    return Plan(drive, (*standard, *(one for one in planned if one is not None)), period, error, lines)


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
    levels = _standard(drive, _level(drive))
    if isinstance(experiment, Experiment):
        profile, end = experiment.profile, experiment.end
    elif experiment in levels:
        profile, end = _profile(*levels[experiment])
    else:
        raise InputError(f"experiment = {show(experiment)}: it is none of {', '.join(levels)}.")
    time = np.arange(0.0, end, log_period)
    demand = profile.at(time)
    generator = np.random.default_rng(seed)
    played = demand + ripple * generator.standard_normal(time.size)
    blank = Log(
        time, played, angle=time**2 * float(np.sign(np.sum(demand[: time.size // 4]))), torque_is="demand"
    )
    model = LogModel(blank, _at_rest(drive))
    states = model.states({POSITION: position} if float(drive.gap) > 0.0 and _moving(drive) else {})
    angle = states[:, record.PHI1_OUT] - states[0, record.PHI1_OUT]
    count = 2.0 * math.pi / (4.0 * float(drive.encoder_lines)) if drive.encoder_lines else 0.0
    if count:
        angle = np.floor(angle / count + phase) * count
    speed = states[:, record.W1_OUT] if not count else np.diff(angle, prepend=angle[0]) / log_period
    torque = demand if torque_is == "demand" else states[:, record.U_OUT]
    values = {signal: speed if signal == "speed" else angle}
    return Log(time, torque, **values, torque_is=torque_is, name="made-up log")


def _moving(drive: Drive) -> bool:
    return drive.start_position == "unknown" or drive.load_kind == "reactive"


def _at_rest(drive: Drive) -> Drive:
    return drive.replace(start_position="mid-gap") if _moving(drive) else drive.assumed


def _asked(free: Sequence[str] | None, drive: Drive) -> tuple[str, ...]:
    names = (
        *FREE[:5],
        *(["load_torque"] if float(drive.load_torque) else []),
        *(["torque_lag"] if float(drive.torque_lag) else []),
    )
    if free is None:
        return tuple(name for name in names if float(getattr(drive, name)) != 0.0)
    for name in free:
        if name not in names:
            near = nearest(name, names)
            hint = f"did you mean {near}?" if near else f"those are {', '.join(names)}."
            raise InputError(f"free = {show(name)}: it is no parameter that this log could tell; {hint}")
        if float(getattr(drive, name)) == 0.0:
            raise InputError(f"free = {show(name)}: it is 0 in the drive; give a guess of it.")
    return tuple(free)


def _level(drive: Drive) -> float:
    Ms, Mc = float(drive.Ms), abs(float(drive.Mc))
    return max(LEVEL * Ms, min(Ms, 1.5 * Mc))


def _standard(drive: Drive, level: float) -> dict[str, tuple[Vector, Vector]]:
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
        found["two levels, then reverse"] = ([part, part, 2.0 * part], [level, lower, -LEVEL * level])
        if Mc > 0.0:
            found["shaking"] = ([part] * 4, [0.8 * Mc, -0.8 * Mc, 0.8 * Mc, -0.8 * Mc])
    return {name: (np.array(times), np.array(levels)) for name, (times, levels) in found.items()}


def _profile(durations: Vector, levels: Vector) -> tuple[TorqueProfile, float]:
    edges = np.concatenate([[0.0], np.cumsum(durations)])
    return TorqueProfile.steps(edges, levels), float(edges[-1])


def _score(widths: Vector) -> float:
    logs = np.minimum(widths, 1e3)
    return float(np.sqrt(np.mean(logs**2)))


class _Bench:
    """A drive, an inverter's log and an encoder: what any torque would tell."""

    def __init__(
        self,
        drive: Drive,
        period: float,
        ripple: float,
        free: tuple[str, ...],
        signal: Kind,
        tell: Callable[[str], None],
    ) -> None:
        self.drive, self.period, self.ripple, self.free, self.signal, self.tell = (
            drive,
            period,
            ripple,
            free,
            signal,
            tell,
        )
        self.moving = _moving(drive) and float(drive.gap) > 0.0
        self.base = _at_rest(drive)
        self.count = 2.0 * math.pi / (4.0 * float(drive.encoder_lines)) if drive.encoder_lines else 0.0
        self.quantile = float(norm.ppf(0.5 + 0.5 * CONFIDENCE))

    def experiment(self, name: str, durations: Vector, levels: Vector) -> Experiment:
        """What these levels would tell."""
        self.tell(name)
        profile, end = _profile(durations, levels)
        period = max(self.period, end / SAMPLES)
        time = np.arange(0.0, end + 0.5 * period, period)
        blank = Log(time, profile.at(time), angle=time**2 * float(np.sign(levels[0])), torque_is="demand")
        model = LogModel(blank, self.base)
        space = Space(
            self.free,
            (self.moving,),
            (self.signal == "angle",),
            tuple(math.copysign(1.0, float(getattr(self.drive, one))) for one in self.free),
        )
        x = np.array(
            [math.log(abs(float(getattr(self.drive, one)))) for one in self.free]
            + ([-0.6] if self.moving else [])
            + ([0.0] if self.signal == "angle" else [])
        )
        values = space.values(x, 0)
        states = model.states(values)
        angle = states[:, record.PHI1_OUT] - states[0, record.PHI1_OUT]
        kept = object.__new__(Log)
        vars(kept).update(vars(blank))
        vars(kept)["values"] = angle if self.signal == "angle" else states[:, record.W1_OUT]
        vars(kept)["kind"] = self.signal
        vars(kept)["count"] = self.count if self.signal == "angle" else self.count / period
        model.log = kept
        fitter = Fitter([model], space)
        # a longer period stands for samples left out: the same error of the torque in each of them
        ripple = self.ripple * math.sqrt(self.period / period)
        part = fitter.whitened(x, Errors(fitter.weights(x, ripple), 1.0, ripple))
        sizes = np.sqrt(np.diag(covariance_of(part.jacobian, space)))[: len(self.free)]
        widths = np.sinh(np.minimum(self.quantile * sizes, 50.0))
        unknown = 2.0 * self.quantile * sizes > math.log(WIDEST)
        peak, travel = self._load(model, values)
        widths[unknown] = math.inf
        told = dict(zip(self.free, widths.tolist(), strict=True))
        return Experiment(name, profile, end, told, peak, travel)

    def _load(self, model: LogModel, values: dict[str, float]) -> tuple[float, float]:
        """Largest shaft torque and travel of the load, from both flanks and from the middle."""
        peak = travel = 0.0
        for position in (-1.0, 0.0, 1.0) if self.moving else (0.0,):
            at = values | ({POSITION: position} if self.moving else {})
            states = model.states(at)
            peak = max(peak, float(np.max(np.abs(states[:, record.T_OUT]))))
            way = states[:, record.PHI2_OUT]
            travel = max(travel, float(np.max(np.abs(way - way[0]))))
        return peak, travel

    def better(self, standard: Sequence[Experiment], torque: float, travel: float) -> Experiment | None:
        """Levels and times moved from the best standard experiment that keeps the limits."""
        allowed = [one for one in standard if one.peak <= torque and one.travel <= travel]
        start = min(allowed, key=lambda one: one.score, default=None)
        if start is None:
            return None
        Ms = float(self.drive.Ms)
        durations = np.diff(np.concatenate([_edges(start), [start.end]]))
        levels = start.profile.at(_edges(start))
        braking = min(float(np.min(levels)), float(self.drive.minimum_torque))
        found = start

        def loss(moves: Vector) -> float:
            nonlocal found
            times = durations * np.exp(np.clip(moves[: durations.size], -1.5, 1.5))
            times *= min(1.0, 1.5 * start.end / float(times.sum()))
            torques = np.clip(levels + moves[durations.size :] * Ms, braking, Ms)
            if np.any(times < 2.0 * self.period):
                return 1e3
            one = self.experiment("planned", times, torques)
            over = max(0.0, one.peak / torque - 1.0) + max(0.0, one.travel / travel - 1.0)
            if over == 0.0 and one.score < found.score:
                found = one
            return math.log(one.score) + 30.0 * over

        first = np.zeros(2 * durations.size)
        simplex = np.vstack([first, first + 0.25 * np.eye(first.size)])
        minimize(
            loss,
            first,
            method="Nelder-Mead",
            options={"maxfev": EVALUATIONS, "initial_simplex": simplex, "adaptive": True},
        )
        if found is start:
            found = Experiment("planned", start.profile, start.end, start.widths, start.peak, start.travel)
        return found


def _edges(one: Experiment) -> Vector:
    """Where the levels of an experiment begin."""
    return np.unique(np.concatenate([[0.0], one.profile.time]))[: None if one.profile.end < one.end else -1]
