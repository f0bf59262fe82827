"""Which experiment to run: expected intervals of standard ones, and of a torque planned for a drive."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.optimize import minimize

from softstart.arrays import Matrix, Vector
from softstart.chain.machines import quantity_of
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.identification.fitting import ErrorScales, FitPoint, Fitter
from softstart.identification.logs import FEWEST, Kind, Log, TorqueIs
from softstart.identification.model import POSITION, LogModel
from softstart.identification.result import FRICTIONS
from softstart.identification.unknowns import (
    DEFAULT_PARAMETERS,
    default_parameters,
    model_parameters,
    position_is_unknown,
    selected_parameters,
    unknowns_of,
)
from softstart.input.files import object_of
from softstart.kernel.records import S_PHI
from softstart.profile import TorqueProfile
from softstart.quantities import number_in, show
from softstart.results import OneLine, Result
from softstart.start.comparison import INTERVAL

LEVEL: Final = 0.65  # of the starting torque
SAMPLES: Final = 400  # of an experiment at most
RIPPLE: Final = 0.025  # of the torque level
STATED_POSITION: Final = -0.6  # position in the gap for which widths are stated
CHECKED_POSITIONS: Final = (
    257  # start positions from which an experiment is simulated first, see `largest_over_position`
)
COARSE: Final = 4  # of these every fourth while a torque is designed, and for the travel
KINKS: Final = 16  # parts of the distance between them in which changes of the contacts are located
EXACT: Final = 1e-9  # relative error of a largest value
SHORTEST: Final = 1e-13  # of the gap, between positions
LEAST: Final = 0.05  # of the levels of a standard experiment: a smaller torque is none
PIECES: Final = 9  # levels of a designed torque at least
ROUGH: Final = 150  # samples at most while a torque is designed
DRAWS, TRIALS = 40, 200  # random torques, and torques tried from the best of them on
EXACTLY: Final = 5  # so many of the best are computed exactly
SPREAD: Final = 0.15  # of the largest level: the first steps
WIDER: Final = 4.0  # times the largest level of a seed: as far as a design may go
NEAR: Final = 0.01  # relative distance of a design to its limits: for positions between those checked then


@dataclass(frozen=True, eq=False, repr=False)
class Experiment(OneLine):
    """A torque demand and what it would tell."""

    name: str
    profile: TorqueProfile
    end: float  # of the log, s
    widths: dict[str, float]  # half an interval of 95 % over the value; infinite where it would be unknown
    peak: float  # of the shaft torque, N m, from the worst position in the gap
    travel: float  # of the load, rad at the motor shaft, from the worst position
    score: float = math.nan  # root mean square of the half intervals of wanted parameters; less is better


@dataclass(frozen=True, eq=False, repr=False)
class ExperimentPlan(Result, view="identification.plan_sheet"):
    """Experiments for a drive: the standard ones, then the planned one."""

    drive: Drive
    experiments: tuple[Experiment, ...]
    log_period: float  # s
    ripple: float  # torque error in each sample, N m

    def __getitem__(self, name: str) -> Experiment:
        """The experiment of this name."""
        return next(experiment for experiment in self.experiments if experiment.name == name)

    @property
    def best(self) -> Experiment:
        """The one that tells most."""
        return min(self.experiments, key=lambda experiment: experiment.score)

    def summary(self) -> dict[str, Any]:
        """Everything as numbers and words, for JSON."""
        return {
            "drive": self.drive.name,
            "log_period": self.log_period,
            "ripple": self.ripple,
            "encoder_lines": float(self.drive.encoder_lines),
            "experiments": [
                {
                    "name": experiment.name,
                    "half_width_percent": {name: 100.0 * width for name, width in experiment.widths.items()},
                    "peak_shaft_torque": experiment.peak,
                    "travel": experiment.travel,
                    "time": experiment.profile.time.tolist(),
                    "torque": experiment.profile.torque.tolist(),
                    "end": experiment.end,
                }
                for experiment in self.experiments
            ],
            "best": self.best.name,
        }


def plan_experiments(
    drive: Drive | str | os.PathLike[str],
    *,
    log_period: float | str = "4 ms",
    ripple: float | str | None = None,
    free: Sequence[str] | None = None,
    wanted: Sequence[str] | None = None,
    max_torque: float | str | None = None,
    max_travel: float | str | None = None,
    optimise: bool = True,
    progress: Callable[[str], None] | None = None,
) -> ExperimentPlan:
    """Find what standard experiments would tell about a drive, and a torque that tells more.

    No fit is made: the derivatives of the exact plant and the covariance of encoder and torque error give the
    interval that a fit would have (Fisher information), of a log of the motor's angle from an unknown
    position in the gap where friction holds the load.

    The planned torque has at least nine levels, and the duration of the best standard experiment that keeps
    the limits. From the best of 40 random torques the levels are improved by linear approximations (COBYLA),
    minimising `Experiment.score`. The best torque that keeps all limits on the exact plant is returned, a
    local optimum: it never tells less than the best standard experiment within them.

    Parameters
    ----------
    drive : Drive, str or path
        The drive as it is thought to be.
    log_period : float or str
        Sample period of the log, s.
    ripple : float or str, optional
        Standard deviation of the torque error in each sample, N m; 2.5 % of 0.65 Ms by default.
    free : sequence of str, optional
        What is to be found, as in `identify`.
    wanted : sequence of str, optional
        The parameters that the planned torque is to tell best; all that are to be found by default.
    max_torque : float or str, optional
        Largest shaft torque that a planned experiment may have, N m; by default the permissible one of the
        drive, or else the largest of the standard experiments.
    max_travel : float or str, optional
        How far the load may be moved, rad at the motor shaft, or "1 turn at output"; no limit by default.
    optimise : bool
        Whether to look for a better torque.
    progress : callable, optional
        Called with a text that says what is being done.

    Returns
    -------
    Plan
        `experiments`, each with its profile, `widths` (half intervals over values), peak of the shaft torque,
        N m, and travel of the load, rad, both from the worst position; `best` is the one that tells most.

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
    A. C. Atkinson, A. N. Donev, Optimum Experimental Designs, 1992.
    """
    drive = object_of(drive, Drive, Drive.load, "drive: give one Drive")
    standard = standard_levels(drive)
    longest = min(float(np.sum(durations)) for durations, _ in standard.values()) / FEWEST
    period = _between("log_period", log_period, "s", longest, f"a fit needs {FEWEST} samples of each log")
    error = RIPPLE * _level(drive)
    if ripple is not None:
        error = _between("ripple", ripple, "N*m", float(drive.Ms), "more is no error of the torque")
    names = _asked(free, drive)
    aims = selected_parameters(wanted, names, names, "this plan", key="wanted")
    test = VirtualTest(drive, period, error, names, tuple(aims), progress or (lambda _: None))
    experiments = [test.experiment(name, *levels) for name, levels in standard.items()]
    if optimise:
        torque = drive.limits.shaft_torque or max(one.peak for one in experiments)
        travel = math.inf
        if max_torque is not None:
            most = quantity_of(drive, "permissible_torque", max_torque, "max_torque")
            torque = _between("max_torque", most, "N*m")
        if max_travel is not None:
            travel = _between("max_travel", quantity_of(drive, "gap", max_travel, "max_travel"), "rad")
        experiments.append(test.optimised(standard, torque, travel))
    return ExperimentPlan(drive, tuple(experiments), period, error)


def _between(name: str, quantity: float | str, unit: str, most: float = math.inf, why: str = "") -> float:
    """A number above 0 and at most this."""
    value = number_in(unit, quantity, name)
    if not 0.0 < value <= most:
        limit = f" and at most {most:.3g} {unit}: {why}" if why else ""
        raise InputError(f"{name} = {show(quantity)}: give a value above 0{limit}.")
    return value


def simulated_log(
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
    """A log simulated with the exact plant, with a torque error of `ripple` N m in each sample.

    It begins at a `position` in the gap and a `phase` of the encoder.

    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08)
    >>> simulated_log(crane, "start").kind
    'angle'
    """
    if isinstance(experiment, Experiment):
        profile, end = experiment.profile, experiment.end
    else:
        profile, end = stepped_torque(*standard_levels(drive)[experiment])
    time = np.arange(0.0, end, log_period)
    demand = profile.at(time)
    played = demand + ripple * np.random.default_rng(seed).standard_normal(time.size)
    start = {POSITION: position} if position_is_unknown(drive) else {}
    states = LogModel.of(Log.planned(time, played), _at_rest(drive)).motion(start).at(time)
    angle, speed = states["phi"][:, 0] - states["phi"][0, 0], states["w"][:, 0]
    if count := _count_of(drive):
        angle = np.floor(angle / count + phase) * count
        speed = np.diff(angle, prepend=angle[0]) / log_period
    torque = demand if torque_is == "demand" else states["u"]
    values = {signal: speed if signal == "speed" else angle}
    return Log(time, torque, **values, torque_is=torque_is, name="simulated log")


def _count_of(drive: Drive) -> float:
    """What the encoder counts, rad; 0 of an ideal one."""
    return 2.0 * math.pi / (4.0 * float(drive.encoder_lines)) if drive.encoder_lines else 0.0


def _at_rest(drive: Drive) -> Drive:
    return drive.replace(start_position="mid-gap") if position_is_unknown(drive) else drive.design_drive


def _asked(free: Sequence[str] | None, drive: Drive) -> tuple[str, ...]:
    names = [name for name in default_parameters(drive, lag=True) if float(getattr(drive, name))]
    possible = [*DEFAULT_PARAMETERS, "load_torque", "torque_lag", *FRICTIONS]
    asked = selected_parameters(free, names, possible, "this log")
    if missing := [name for name in asked if not float(getattr(drive, name))]:
        raise InputError(f"free = {show(missing[0])}: it is 0 in the drive; give a guess of it.")
    return tuple(asked)


def _level(drive: Drive) -> float:
    Ms, Mc = float(drive.Ms), abs(float(drive.Mc))
    return max(LEVEL * Ms, min(Ms, 1.5 * Mc))


def standard_levels(drive: Drive) -> dict[str, tuple[Vector, Vector]]:
    """Durations and levels of the standard experiments."""
    level, Mc = _level(drive), abs(float(drive.Mc))
    crossing = math.sqrt(2.0 * float(drive.gap) * float(drive.J1) / level)
    part = 1.5 * crossing + 2.0 * float(drive.elastic_period) + 4.0 * float(drive.torque_lag)
    lower, back = Mc + 0.25 * (level - Mc), -LEVEL * level
    table: dict[str, tuple[list[float], list[float]]] = {
        "start": ([2.0], [level]),
        "two levels": ([1.0, 1.0], [level, lower]),
    }
    if drive.rests:
        table["two levels, then reverse"] = ([1.0, 1.0, 2.0], [level, lower, back])
        table["reversed three times"] = ([1.0, 1.0, 2.0, 2.0, 2.0], [level, lower, back, -back, back])
        if Mc > 0.0:
            forth, back = 0.8 * Mc, 0.8 * float(drive.backward_torque)
            table["shaking"] = ([1.0] * 4, [forth, back, forth, back])
    return {name: (part * np.array(parts), np.array(levels)) for name, (parts, levels) in table.items()}


def largest_over_position(figure: Callable[[Vector], Sequence[Vector] | Matrix], places: Vector) -> float:
    """The largest value of a figure that is continuous in the start position, from values and contacts.

    An interval is halved while it may hold a larger value, by the values at its ends and the slopes there and
    beside; and where the contacts change: one that is only just made has a steep and narrow peak beside it.

    >>> positions = np.linspace(0.0, 1.0, 5)
    >>> round(largest_over_position(lambda x: (1.0 - abs(x - 0.1234567), x > 0.12), positions), 9)
    1.0
    """
    span, (values, counts) = float(np.ptp(places)), figure(places)
    close = 1.01 * span / (KINKS * CHECKED_POSITIONS)
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


def stepped_torque(durations: Vector, levels: Vector) -> tuple[TorqueProfile, float]:
    """The torque of these levels, and when it ends.

    >>> stepped_torque(np.array([0.1, 0.2]), np.array([30.0, 10.0]))[1].__round__(12)
    0.3
    """
    edges = np.concatenate([[0.0], np.cumsum(durations)])
    return TorqueProfile.steps(edges, levels), float(edges[-1])


@dataclass(frozen=True, eq=False)
class VirtualTest:
    """A drive, an inverter's log and an encoder: what any torque would tell."""

    drive: Drive
    period: float  # of the samples, s
    ripple: float  # torque error in each, N m
    free: tuple[str, ...]  # what is to be found
    wanted: tuple[str, ...] = ()  # what of it a score is about; all if none
    progress: Callable[[str], None] = lambda _: None

    @property
    def places(self) -> Vector:
        """Positions in the gap, from -1 to 1."""
        return np.linspace(-1.0, 1.0, CHECKED_POSITIONS) if position_is_unknown(self.drive) else np.zeros(1)

    def experiment(self, name: str, durations: Vector, levels: Vector) -> Experiment:
        """What these levels would tell, and how they load the drive."""
        self.progress(name)
        profile, end = stepped_torque(durations, levels)
        widths = self.widths(profile, end, SAMPLES)
        peak, travel = self.worst_peak_and_travel(profile, end)
        return Experiment(name, profile, end, widths, peak, travel, self.score(widths))

    def score(self, widths: dict[str, float]) -> float:
        """Of logarithms, so that units do not matter: A-optimal.

        A determinant (D-optimal) would pay for a vague gap with a sharp inertia.
        """
        wanted = [widths[name] for name in self.wanted or widths]
        return float(np.sqrt(np.mean(np.minimum(wanted, 1e3) ** 2)))

    def widths(
        self, profile: TorqueProfile, end: float, samples: int, *, vague: bool = False
    ) -> dict[str, float]:
        """Half the expected interval of each parameter over its value; if unknown infinite, or `vague`."""
        drive = self.drive
        period = max(self.period, end / samples)
        time = np.arange(0.0, end + 0.5 * period, period)
        log = Log.planned(time, profile.at(time))
        unknowns = unknowns_of(self.free, drive, [log], [position_is_unknown(drive)])
        numbers = {POSITION: STATED_POSITION, "offset": 0.0}
        values = [numbers.get(one.name, getattr(drive, one.name, 0.0)) for one in unknowns]
        x = np.array([one.number(float(value)) for one, value in zip(unknowns, values, strict=True)])
        signal = LogModel.of(log, _at_rest(drive), SAMPLES).signals([model_parameters(unknowns, x, 0)])[0]
        if count := _count_of(drive):
            signal = np.round(signal / count) * count
        model = LogModel.of(log.changed(values=signal, count=count), _at_rest(drive), SAMPLES)
        fitter = Fitter([model], unknowns)
        spot = fitter.linearize_log(x, 0, np.zeros(model.blocks))
        spot = spot._replace(jacobian=spot.rotation @ fitter.jacobian(x, 0, spot.error))
        # a longer period stands for samples left out: the same error of the torque in each of them
        sizes = ErrorScales(1.0, self.ripple * math.sqrt(self.period / period))
        variances = np.diag(fitter.covariance(FitPoint(x, sizes, (spot,))))
        reach = np.minimum(INTERVAL.quantile * np.sqrt(variances), 50.0).tolist()
        widths = {}
        for p, number, half in zip(unknowns, x.tolist(), reach, strict=True):
            if p.log is None:
                share = math.sinh(half) if p.kind == "logarithm" else p.share(number, half)
                widths[p.name] = share if vague or p.known(number, half) else math.inf
        return widths

    def worst_peak_and_travel(self, profile: TorqueProfile, end: float) -> tuple[float, float]:
        """Largest shaft torque and travel of the load, of all positions in the gap."""
        peak = largest_over_position(
            lambda places: self.peaks_and_travels(profile, end, places)[[0, 2]], self.places
        )
        return peak, largest_over_position(
            lambda places: self.peaks_and_travels(profile, end, places)[1:], self.places[::COARSE]
        )

    def peaks_and_travels(self, profile: TorqueProfile, end: float, places: Vector) -> Matrix:
        """From each position peak of the shaft torque, travel of the load, and changes of the contact.

        The travel is seen at events and samples: exact for a load that friction holds, as it turns at events
        only.
        """
        times = np.union1d(profile.time[profile.time < end], end)
        if not self.drive.rests:
            times = np.union1d(times, np.linspace(0.0, end, SAMPLES))
        model = LogModel.of(Log.planned(times, profile.at(times)), _at_rest(self.drive))
        starts = [{POSITION: place} if position_is_unknown(self.drive) else {} for place in places.tolist()]
        loads = np.empty((3, places.size))
        for i, motion in enumerate(model.motions(starts)):
            angles = motion.states[:, S_PHI]
            travel = np.max(np.abs(angles - angles[0]))
            loads[:, i] = abs(motion.shafts["peak"][0]), travel, motion.notes.gap_events
        return loads

    def utilisation(self, durations: Vector, levels: Vector, torque: float, travel: float) -> float:
        """The worst of some positions over the limits."""
        peaks, travels, _ = self.peaks_and_travels(*stepped_torque(durations, levels), self.places[::COARSE])
        return max(float(peaks.max()) / torque, float(travels.max()) / travel)

    def scaled_to_limits(
        self, durations: Vector, levels: Vector, torque: float, travel: float
    ) -> Experiment | None:
        """The experiment, its levels made smaller until it keeps the limits; None if hardly any is left."""
        share = 1.0
        while share > LEAST:
            over = self.utilisation(durations, share * levels, torque, travel)
            if over <= 1.0:
                experiment = self.experiment("planned", durations, share * levels)
                over = max(experiment.peak / torque, experiment.travel / travel)
                if over <= 1.0:
                    return experiment
            share *= (1.0 - NEAR) / over
        return None

    def optimised(
        self, standard: dict[str, tuple[Vector, Vector]], torque: float, travel: float
    ) -> Experiment:
        """The torque within the limits that tells most, from the best of the standard ones."""
        experiments = {
            name: self.scaled_to_limits(*levels, torque, travel) for name, levels in standard.items()
        }
        kept = {name: experiment for name, experiment in experiments.items() if experiment is not None}
        if not kept:
            raise InputError(
                f"max_torque = {torque:.4g} N m, max_travel = {travel:.4g} rad: no experiment keeps them, "
                "however small its torque; raise the limit."
            )
        seed = min(kept, key=lambda name: kept[name].score)
        durations = standard[seed][0]
        pieces = math.ceil(PIECES / durations.size)
        levels = np.repeat(kept[seed].profile.at(np.cumsum(durations) - durations), pieces)
        durations = np.repeat(durations / pieces, pieces)
        scale = float(np.max(np.abs(levels)))
        lower = max(min(float(levels.min()), float(self.drive.minimum_torque)) / scale, -WIDER)
        upper = min(float(self.drive.Ms) / scale, WIDER)
        tried: list[tuple[float, Vector]] = []

        def score(shares: Vector) -> float:
            """Of levels within the bounds, made smaller until some positions keep the limits."""
            played = scale * np.clip(shares, lower, upper)
            for _ in range(3):
                over = self.utilisation(durations, played, torque, travel) + NEAR
                if over <= 1.0:
                    break
                played = played * (1.0 - NEAR) / over
            # a design needs the slope of what is unknown
            widths = self.widths(*stepped_torque(durations, played), ROUGH, vague=True)
            tried.append((self.score(widths), played))
            return math.log(tried[-1][0])

        self.progress("planned")
        generator = np.random.default_rng(0)
        draws = [levels / scale, *generator.uniform(lower, upper, (DRAWS, levels.size))]
        minimize(score, min(draws, key=score), method="COBYLA", options={"rhobeg": SPREAD, "maxiter": TRIALS})
        tried.sort(key=lambda experiment: experiment[0])
        exact = (self.scaled_to_limits(durations, played, torque, travel) for _, played in tried[:EXACTLY])
        return min(
            (experiment for experiment in (kept[seed], *exact) if experiment is not None),
            key=lambda experiment: experiment.score,
        )
