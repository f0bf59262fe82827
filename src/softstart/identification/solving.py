"""From logs to a drive: `identify`."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from scipy.stats import chi2

from softstart.arrays import Matrix, Vector
from softstart.chain.model import Chain, load_machine
from softstart.drive import FRICTIONS, PARAMETERS, Drive
from softstart.errors import InputError, listed
from softstart.identification.chains import reduced_drive, reduction_note
from softstart.identification.fitting import (
    FACTOR,
    FREE,
    MOST_FRICTION,
    MOST_RIPPLE,
    STEP,
    Fitter,
    Other,
    Progress,
    Solution,
    Space,
    TimeIsUpError,
    chosen,
    covariance_of,
    position_of,
    quantile_of,
    root_of,
    usual,
)  # fmt: skip
from softstart.identification.logs import Log, TorqueIs
from softstart.identification.model import FILTER, POSITION, LogModel
from softstart.identification.planning import plan_experiments
from softstart.identification.result import AT_LIMIT, Estimate, Identification
from softstart.parallel import on_one_thread
from softstart.quantities import show, to_si

CURVED: Final = 0.05  # of half a quadratic interval, by which an end of a bent one lies elsewhere
MOST_LOAD: Final = 0.99  # of the starting torque
SURE: Final = 4.0  # standard deviations of an effect that the model has not, to be named
LARGE_RIPPLE: Final = 0.06  # of the largest torque: more is no ripple
FAR: Final = 5.0  # standard deviations that hardly a sample is off
UNSETTLED: Final = 4.0  # gain of the likelihood by another step, from which the fit is none
CHANCE: Final = 1e-5  # that errors alone look like this
WAVES: Final = 20  # torques that change slowly, of which none must be left
LAGS: Final = 20  # samples over which what is left must not be correlated
TOO_NOISY: Final = 5.0  # standard deviations of a variance that is larger than the encoder explains
DOUBTFUL: Final = 5.0  # ratio of inertias found and guessed that is told
SUSPECT: Final = 25.0  # ratio of inertia by log and guess that only a wrong unit explains


@on_one_thread
def identify(
    logs: Log | str | os.PathLike[str] | Sequence[Log | str | os.PathLike[str]],
    drive: Drive | Chain | str,
    *,
    free: Iterable[str] | None = None,
    torque_is: TorqueIs = "measured",
    columns: dict[str, str] | None = None,
    torque_constant: float | str | None = None,
    rated_torque: float | str | None = None,
    searches: int = 12,
    seed: int = 0,
    time_limit: float | str | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Find the parameters of a drive from what an inverter logged of its starts, each with its interval.

    The exact plant under the torque of the log is fitted to the angle or speed of the motor. A search follows
    each log from its beginning over longer and longer parts, from the guess and from points up to a factor of
    4 around it, until two searches end at the same minimum. Then the squares are weighted by the covariance
    of what the encoder rounds and of a torque error that the plant integrates, both of a size that restricted
    maximum likelihood finds; intervals allow for not knowing that size, and follow the likelihood itself
    where they are wide.

    Parameters
    ----------
    logs : Log, path, or sequence of them
        Logs of one drive, each beginning at standstill, or their CSV or MDF files (`Log.load`).
    drive : Drive, Chain or str
        The guess, by factors of 3 if need be; what is not free stays as it is there. For a chain with one
        dominant gap the two masses that stand for it are found, and the error of that is predicted. The
        position in the gap is free for each log where the load is reactive or the drive says "unknown".
    free : iterable of str, optional
        What to find: names of parameters, and "position". By default inertias, stiffness, gap, damping, load
        torque, with a torque demand the lag, and each friction that the guess has; a name after a plus, as
        "+motor_friction", is found beside these.
    torque_is : {"measured", "demand"}
        What the torque of files is, see `Log`.
    columns : dict, optional
        What files call the columns, see `Log.load`.
    torque_constant : float or str, optional
        N m/A: files hold the current in place of the torque, see `Log.load`.
    rated_torque : float or str, optional
        N m: the torque at 100 % of files that have it in %; by default that of the drive, or its rated
        power over its rated speed.
    searches : int
        At most so many searches.
    seed : int
        Of the points at which searches begin.
    time_limit : float or str, optional
        Time in s, after which the best fit so far is the answer, without intervals.
    progress : callable, optional
        Called with a text that says what is being done.

    Returns
    -------
    Identification
        Drive, intervals (none where the drive does not explain the logs, or time was short), what is
        unknown and why, what the logs show that the model has not.

    Raises
    ------
    InputError
        For bad input, for logs that no drive explains, and for units that cannot be right.

    Examples
    --------
    >>> from softstart.identification.planning import made_up_log
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> guess = crane.replace(gap=0.2, stiffness=200.0, load_inertia=0.4)
    >>> found = identify(made_up_log(crane, "two levels, then reverse", ripple=1.0), guess, searches=2)
    >>> found["gap"].lower < 0.08 < found["gap"].upper
    True

    References
    ----------
    D. A. Harville, J. Amer. Statist. Assoc. 72 (1977) 320-338; M. G. Kenward, J. H. Roger, Biometrics 53
    (1997) 983-997; docs/identification.md.
    """
    began = time.perf_counter()
    drive = load_machine(drive) if isinstance(drive, str) else drive
    machine, drive = drive, reduced_drive(drive)
    given = [logs] if isinstance(logs, Log | str | os.PathLike) else list(logs)
    if not given:
        raise InputError("logs: there is none; give a log, or the path of its CSV file.")
    files: dict[str, Any] = {
        "columns": columns, "torque_is": torque_is, "torque_constant": torque_constant,
        "rated_torque": drive.rated if rated_torque is None else rated_torque,
    }  # fmt: skip
    rated = "" if drive.rated_torque or drive.rated is None else f" in % of {drive.rated:.5g} N m"
    power = ", rated_power/rated_speed"
    read = [one if isinstance(one, Log) else Log.load(one, **files) for one in given]
    read = [one.summed(float(drive.encoder_lines)) for one in read]
    if isinstance(searches, bool) or not isinstance(searches, int) or searches < 1:
        raise InputError(f"searches = {searches}: give a whole number of 1 or more.")
    asked, moving = _free(free, drive, read)
    for one in read:
        _check_inertia(one, drive)
    base = drive.replace(start_position="mid-gap") if moving else _standing(drive)
    space = Space.of(asked, drive, [moving for _ in read], [one.kind == "angle" for one in read])
    fitter = Fitter([LogModel(one, base) for one in read], space, progress)
    guess, lower, upper = _bounds(space, drive, read)
    limit = None if time_limit is None else float(to_si(time_limit, "s", name="time_limit"))
    deadline = math.inf if limit is None else began + limit
    found = fitter.search(guess, lower, upper, searches, seed, deadline)
    solution = fitter.refine(found[0][0], lower, upper)
    doubts, estimates = _misfits(fitter, solution), list[Estimate]()
    if not doubts:
        fitter.deadline = deadline
        try:
            fitter.progress("other explanations")
            solution, others = fitter.elsewhere(solution, _untold(fitter, solution, guess))
            if not (doubts := _misfits(fitter, solution)):
                estimates = _estimates(fitter, solution, guess, others)
        except TimeIsUpError:
            fitter.about(solution.errors.weights)
            doubts = [
                f"The time limit of {limit:g} s came before the intervals: none is stated, and another drive "
                "may explain the logs as well. Remedy: a longer --time-limit, or fewer samples."
            ]
        fitter.deadline = math.inf
    estimates = estimates or _without_intervals(space, solution)
    covariance = covariance_of(solution.part.jacobian, space)
    changes = {one.name: one.value for one in estimates if one.name in PARAMETERS}
    sizes = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    kept = len(estimates)
    sizes[len(space.shared) : kept] *= -1.0  # the further forward a position, the smaller its root
    best = found[0][1]
    notes = [
        *(f"{one.name}: {note}{power * note.endswith(rated or '?')}" for one in read for note in one.notes),
        *_reduction(machine, drive, read[0], free, progress),
        *doubts,
        *([] if doubts else _advice(drive.replace(**changes), estimates, read)),
        *_other_scale(drive, drive.replace(**changes)),
        "The scale of the torque cannot be found from motion: if the signal is 10 % low, so are both "
        "inertias, stiffness, damping and load torque, and K_dyn hardly moves.",
    ]
    return Identification(
        drive=drive.replace(**changes, source=_source(drive, read)),
        guess=drive,
        logs=tuple(read),
        estimates=tuple(estimates),
        correlations=(covariance / np.outer(sizes, sizes))[:kept, :kept],
        ripple=solution.errors.ripple,
        searches=len(found),
        agreed=sum(cost <= 1.01 * best + 1e-300 for _, cost in found),
        seconds=time.perf_counter() - began,
        notes=tuple(notes),
        residuals=tuple(fitter.left(solution.x)),
    )


def _reduction(
    machine: Any, drive: Drive, log: Log, free: Iterable[str] | None, progress: Progress | None
) -> list[str]:
    """What the reduction of more masses leaves out, and how far that moves what is found."""
    if len(machine.mass_names) == 2:
        return []
    asked = None if free is None else list(free)
    return [
        reduction_note(
            machine,
            drive,
            log,
            lambda one: identify(one, drive, free=asked, searches=1, progress=progress).shared,
        )
    ]


def _source(drive: Drive, logs: Sequence[Log]) -> str:
    names = ", ".join(one.name for one in logs[:3]) + (f" and {len(logs) - 3} more" if len(logs) > 3 else "")
    return f"identified from {names}" + (f"; else: {drive.source}" if drive.source else "")


def _standing(drive: Drive) -> Drive:
    """The drive at one position: that of the file."""
    return drive.design_drive.replace(initial_speed=0.0) if drive.initial_speed else drive.design_drive


def _free(free: Iterable[str] | None, drive: Drive, logs: Sequence[Log]) -> tuple[tuple[str, ...], bool]:
    """The parameters to find, and whether the position of each log is among them."""
    demand = any(one.torque_is == "demand" for one in logs)
    moving = (drive.start_position == "unknown" or drive.load_kind == "reactive") and float(drive.gap) > 0.0
    names = usual(drive, lag=demand)
    asked = chosen(free, [*names, *([POSITION] if moving else [])], (*FREE, POSITION), "logs")
    for name in asked if free is not None else ():
        if name == FILTER and any(one.kind == "angle" for one in logs):
            raise InputError(f"free = {show(name)}: an angle has no filter of the speed; leave it out.")
        if name in FREE[6:8] and not demand:
            raise InputError(
                f"free = {show(name)}: with a measured torque it is in the samples already; leave it "
                "out, or log the "
                'demand (torque_is = "demand").'
            )
        if name == "load_torque" and not float(drive.load_torque):
            raise InputError(f"free = {show(name)}: the guess is 0; give one that has the right sign.")
    if asked in ([], [POSITION]):
        raise InputError("free: there is nothing to find; name parameters, as gap and stiffness.")
    # the filter, which is not the drive's, last
    return tuple(name for name in FREE if name in asked), POSITION in asked


def _check_inertia(log: Log, drive: Drive) -> None:
    """Refuse a log whose units cannot be right: torque over acceleration is not near the inertia guessed."""
    seen = np.isfinite(log.values)
    time, values = log.time[seen], log.values[seen]
    speed = values if log.kind == "speed" else np.gradient(values, time)
    impulse = np.concatenate(
        [[0.0], np.cumsum(0.5 * (log.torque[1:] + log.torque[:-1]) * np.diff(log.time))]
    )[seen]
    inertia = float(np.max(np.abs(impulse))) / max(float(np.max(np.abs(speed))), 1e-300)
    low, high = float(drive.J1), float(drive.J1 + drive.J2)
    if low / SUSPECT <= inertia <= high * SUSPECT:
        return
    raise InputError(
        f"{log.name}: torque and motion tell an inertia of about {inertia:.3g} kg m2, and the drive has "
        f"{low + float(drive.J2):.3g} kg m2; look at the units of its columns: time in ms, speed in "
        "rpm, angle in degrees or revolutions, torque in % are written in the first line, as time [ms], or "
        'given as --columns "time=NAME [ms]".'
    )


def _bounds(space: Space, drive: Drive, logs: Sequence[Log]) -> tuple[Vector, Vector, Vector]:
    """Where the search begins, and how far it may go."""
    typical = float(np.median(np.diff(logs[0].time)))
    guess: list[float] = []
    lower: list[float] = []
    upper: list[float] = []
    for i, name in enumerate(space.shared):
        value = float(getattr(drive, name, 0.0))
        if name in FRICTIONS:
            guess, lower, upper = [*guess, space.number(i, value)], [*lower, 0.0], [*upper, MOST_FRICTION]
            continue
        if value == 0.0 and name == "damping":  # a damping ratio of 2 %
            reduced = drive.J1 * drive.J2 / (drive.J1 + drive.J2)
            value = 0.04 * math.sqrt(float(drive.c * reduced))
        elif value == 0.0:
            value = typical
        reach = 3.0 * FACTOR
        if name in ("damping", "torque_lag", "computing_delay", FILTER):
            reach = 100.0
        guess.append(space.number(i, value))
        lower.append(space.number(i, value / reach))
        most = value * reach
        if name == "load_torque":  # more is no drive: it could not start
            most = math.copysign(min(abs(most), MOST_LOAD * float(drive.Ms)), value)
        upper.append(space.number(i, most))
    for _ in range(sum(space.positions)):
        guess, lower, upper = [*guess, root_of(0.0)], [*lower, 0.0], [*upper, 1.0]
    for log in (one for one in logs if one.kind == "angle"):
        first = float(log.values[np.isfinite(log.values)][0])
        reach = max(20.0 * log.count, 100.0 * log.scale)
        guess, lower, upper = [*guess, -first], [*lower, -first - reach], [*upper, -first + reach]
    return np.array(guess), np.array(lower), np.array(upper)


def _sizes(solution: Solution, covariance: Matrix) -> list[float]:
    """Half the quadratic interval of each number."""
    return [
        quantile_of(freedom) * math.sqrt(float(variance))
        for freedom, variance in zip(solution.freedom, np.diag(covariance), strict=True)
    ]


def _untold(fitter: Fitter, solution: Solution, guess: Vector) -> list[int]:
    """The numbers that the logs do not tell, were all intervals quadratic."""
    space = fitter.space
    sizes = _sizes(solution, covariance_of(solution.part.jacobian, space))
    return [
        i
        for i, name in enumerate(space.names)
        if not name.startswith("offset")
        and not space.known(i, float(solution.x[i]), sizes[i], float(guess[i]))
    ]


def _without_intervals(space: Space, solution: Solution) -> list[Estimate]:
    """The best fit, of which no number is called known."""
    x = solution.x.tolist()
    values = [space.value(i, x[i]) for i in range(len(space.shared))]
    values += [position_of(one) for one in x[len(values) : len(values) + sum(space.positions)]]
    return [
        Estimate(name, value, math.nan, math.nan, known=False, reason="no interval is stated")
        for name, value in zip(space.names, values, strict=False)
    ]


def _estimates(fitter: Fitter, solution: Solution, guess: Vector, others: Sequence[Other]) -> list[Estimate]:
    """Values and intervals: their ends are where the fit gets worse, with all else refitted."""
    space, found, lost = fitter.space, [], set[str]()
    covariance = covariance_of(solution.part.jacobian, space)
    sizes, untold = _sizes(solution, covariance), _untold(fitter, solution, guess)
    told = [i not in untold for i, name in enumerate(space.names) if not name.startswith("offset")]
    for i, (name, tells) in enumerate(zip(space.names, told, strict=False)):
        position = i >= len(space.shared)
        middle, half = float(solution.x[i]), sizes[i]
        fitter.progress(f"interval of {name}")
        ends = [fitter.end(solution, i, sign, half, others) for sign in (-1.0, 1.0)]
        bent = max(abs(ends[0] - middle + half), abs(ends[1] - middle - half)) > CURVED * half
        known = tells and space.known(i, middle, 0.5 * (ends[1] - ends[0]))
        known = known and not (position and "gap" in lost)  # a share of the gap
        ends_there = not position and _limited(solution, i, name, ends)
        here = not position and _limited(solution, i, name, [middle])
        reason = AT_LIMIT if here or (known and ends_there) else "" if known else _why(i, covariance, space)
        known = not reason
        if not known:
            lost.add(name)
        of = position_of if position else partial(space.value, i)
        middle, *ends = (of(one) for one in (middle, *ends))
        found.append(Estimate(name, middle, min(ends), max(ends), known, bent, reason))
    fitter.about(solution.errors.weights)
    return found


def _limited(solution: Solution, i: int, name: str, numbers: Sequence[float]) -> bool:
    """Whether a value, or an end of its interval, is where the search ends and not where the logs say.

    A friction of 0 is a limit of the drive, not of the search.
    """
    lower, upper = float(solution.lower[i]), float(solution.upper[i])
    near = 1e-3 * (upper - lower)
    return any((one < lower + near and name not in FRICTIONS) or one > upper - near for one in numbers)


def _why(i: int, covariance: Matrix, space: Space) -> str:
    """With what an unknown number goes together, or that nothing depends on it."""
    sizes = np.sqrt(np.diag(covariance))
    ratio = np.abs(covariance[i] / (sizes[i] * sizes))
    ratio[i] = 0.0
    names = space.names
    partner = int(np.argmax(ratio))
    if ratio[partner] > 0.9 and not names[partner].startswith("offset"):
        return f"the logs tell it only together with {names[partner]} (correlation {ratio[partner]:.2f})"
    return "the motion of the motor hardly depends on it in these logs"


def _advice(drive: Drive, estimates: Sequence[Estimate], logs: Sequence[Log]) -> list[str]:
    """What is unknown, why, and the experiment that would tell it."""
    unknown = [one for one in estimates if not one.known and not one.name.startswith(POSITION)]
    if not unknown:
        return []
    names = [one.name for one in unknown]
    drive = drive.replace(**{one.name: 0.5 * one.upper for one in unknown if one.value == 0.0})
    reasons: dict[str, list[str]] = {}
    for one in unknown:
        reasons.setdefault(one.reason, []).append(one.name)
    told = "; ".join(f"{listed(group)}: {reason}" for reason, group in reasons.items())
    if AT_LIMIT in reasons:
        return [f"Unknown: {told}. Remedy: begin from another guess of {listed(reasons[AT_LIMIT])} (--set)."]
    period = float(np.median(np.diff(logs[0].time)))
    try:
        tried = plan_experiments(drive, log_period=period, optimise=False).experiments
    except InputError:  # the standard experiments are too short for a log as slow as this one
        return [f"Unknown: {told}. Remedy: take samples more often than each {1e3 * period:.3g} ms."]
    would = [one for one in tried if all(one.widths.get(name, math.inf) < math.inf for name in names)]
    remedy = "give what is known of it, and leave it out of --free: no standard experiment would tell it"
    if would:
        best = min(would, key=lambda one: max(one.widths[name] for name in names))
        widths = listed([f"{name} within {100.0 * best.widths[name]:.2g} %" for name in names])
        remedy = f'a log of "{best.name}" would tell {widths} (softstart plan)'
    return [f"Unknown: {told}. Remedy: {remedy}."]


def _other_scale(guess: Drive, found: Drive) -> list[str]:
    """A wrong unit of speed or angle is explained by another drive: only the guess can tell."""
    ratio = float((found.J1 + found.J2) / (guess.J1 + guess.J2))
    if 1.0 / DOUBTFUL < ratio < DOUBTFUL:
        return []
    return [
        f"The inertias found are {ratio:.2g} times those of the guess. If that is not off so far, "
        "look at the "
        "units of the log: rpm called rad/s makes inertias and stiffness 9.5 times too small and the gap as "
        "much too wide, and fits as well."
    ]


def _misfits(fitter: Fitter, solution: Solution) -> list[str]:
    """What the logs show that the model has not, each tried as a torque of its own shape."""
    notes, rows = [], 0
    errors, part = solution.errors, solution.part
    drive = fitter.models[0].guess
    extra = [name for name in FRICTIONS if name not in fitter.space.shared]
    had = {name: float(getattr(drive, name)) for name in extra}
    steps = {
        name: STEP * unit for name, unit in zip(extra, Space.of(extra, drive, (), ()).units, strict=True)
    }
    columns: dict[str, list[Vector]] = {}
    unexplained = 1.0
    for i, (model, weights) in enumerate(zip(fitter.models, errors.weights, strict=True)):
        values = fitter.space.values(solution.x, i) | had
        signals = model.signals([values, *(values | {name: had[name] + steps[name]} for name in extra)])
        shapes = {
            name: (signal - signals[0]) / steps[name] for name, signal in zip(extra, signals[1:], strict=True)
        }
        response = model.torque_responses(values)
        shapes["offset"] = math.sqrt(model.block) * response.sum(axis=1)
        size = np.sqrt(errors.noise**2 + errors.ripple**2 * weights.eigenvalues)
        for name, shape in shapes.items():
            columns.setdefault(name, []).append((weights.rotation @ shape[fitter.counts[i]]) / size)
        here = slice(rows, rows := rows + size.size)
        unexplained = min(
            unexplained,
            _slow_torque(
                weights.rotation @ weights.response / size[:, None], part.jacobian[here], part.residual[here]
            ),
        )
    best = ("", 0.0, 0.0)
    for name, parts in columns.items():
        column = np.concatenate(parts)
        alone = column - part.jacobian @ np.linalg.lstsq(part.jacobian, column, rcond=None)[0]
        strength = float(alone @ alone)
        if strength < 1e-6 * float(column @ column):
            continue
        amount, error = -float(alone @ part.residual) / strength, 1.0 / math.sqrt(strength)
        if amount < -had.get(name, math.inf):
            continue  # it would drive
        if name == "offset" and abs(amount) > fitter.largest_torque:
            continue  # no small effect, of which alone the derivative tells
        if abs(amount) > SURE * error and abs(amount) / error > abs(best[1]) / max(best[2], 1e-300):
            best = (name, amount, error)
    name, amount, error = best
    if name in FRICTIONS:
        one = PARAMETERS[name]
        notes.append(
            f"The logs show {one.meaning} of {had[name] + amount:.3g} +- {2.0 * error:.2g} {one.unit}, and "
            f"the drive has {had[name]:.3g}: gap and load torque may be far off. "
            f"Remedy: find it too, --free +{one.path}."
        )
    elif name:
        notes.append(
            f"The logs show an offset of the torque signal of {amount:.3g} +- {2.0 * error:.2g} N m, which "
            "the model has not: gap and load torque may be far off."
        )
    counted = all(one.log.kind == "angle" and one.log.count for one in fitter.models)
    excess = errors.noise**2 - 1.0 - TOO_NOISY * math.sqrt(2.0 / part.residual.size)
    if unexplained < CHANCE or (counted and excess > 0.0):
        notes.append(
            (
                f"A torque that changes slowly is left (chance {unexplained:.1g})"
                if unexplained < CHANCE
                else f"What is left of the angle is {errors.noise:.3g} times what the encoder rounds"
            )
            + ": something else moves this drive (another friction or load, cogging, a torque that was not "
            "realised), or the times of the samples are not exact."
        )
    usual, ripple = max(fitter.largest_torque, 0.5 * float(fitter.models[0].guess.Ms)), errors.ripple
    if ripple > min(LARGE_RIPPLE * usual, MOST_RIPPLE * fitter.largest_torque):
        share = 100.0 * ripple / fitter.largest_torque
        notes.append(
            f"A torque error of {ripple:.3g} N m in each sample, {share:.0f} % of the largest, is needed to "
            "explain the logs: something else moves this drive (a second gap, a cut or clipped signal, "
            "another kind of load), or the torque signal is poor."
        )
    for log, left in zip(
        (one.log for one in fitter.models),
        [fitter.likely(solution.x, i, errors).residual for i in range(len(fitter.models))],
        strict=True,
    ):
        chance = _whiteness(left)
        if chance < 1e-4:
            notes.append(
                f"{log.name}: what is left is not independent from sample to sample (chance {chance:.1g}): "
                "the log holds something that the model has not, as a second gap, an elastic part, a filter."
            )
        far = int(np.sum(np.abs(left) > FAR))
        if far > 2 + 0.005 * left.size:
            notes.append(f"{log.name}: {far} samples lie more than {FAR:g} standard deviations off.")
    notes.extend(_unsettled(fitter, solution))
    if notes:
        notes.append(
            "The drive does not explain the logs: the values are its best fit, and no interval is stated."
        )
    return notes


def _unsettled(fitter: Fitter, solution: Solution) -> list[str]:
    """That the likelihood still grows from where the fit ended, beyond a limit of the search or before it."""
    space, slope, shared = fitter.space, solution.slope, len(fitter.space.shared)
    lower, upper = solution.lower.copy(), solution.upper.copy()
    upper[:shared] = math.inf
    lower[[i for i, name in enumerate(space.shared) if name not in FRICTIONS]] = -math.inf
    step = fitter.outward(solution.x, slope, lower, upper)
    if -float(2.0 * slope.gradient @ step + step @ slope.curvature @ step) < UNSETTLED:
        return []
    held = [n for i, n in enumerate(space.shared) if _limited(solution, i, n, [float(solution.x[i])])]
    if not held:
        return ["The search for the most likely drive did not settle: begin from another guess (--set)."]
    return [
        f"The fit would be better beyond the limit of the search for {listed(held)}: begin from another "
        "guess (--set), unless something else moves this drive."
    ]


def _slow_torque(response: Matrix, jacobian: Matrix, residual: Vector) -> float:
    """Chance that no torque that changes slowly is left: the share of it in what is left is chi-square.

    Of the torques cos(k pi t/T), of which the parameters explain a part. All are whitened.
    """
    count = response.shape[1]
    waves = np.cos(math.pi * np.outer(np.arange(count) + 0.5, np.arange(min(WAVES, count))) / count)
    both = np.column_stack([jacobian, response @ waves])
    both /= np.maximum(np.linalg.norm(both, axis=0), 1e-300)
    of_all, values, _ = np.linalg.svd(both, full_matrices=False)
    of_model, known, _ = np.linalg.svd(both[:, : jacobian.shape[1]], full_matrices=False)
    of_all, of_model = of_all[:, values > 1e-6 * values[0]], of_model[:, known > 1e-6 * known[0]]
    gained = float(np.sum((of_all.T @ residual) ** 2) - np.sum((of_model.T @ residual) ** 2))
    return float(chi2.sf(max(gained, 0.0), max(of_all.shape[1] - of_model.shape[1], 1)))


def _whiteness(left: Vector) -> float:
    """Chance of correlations as large as these in independent numbers: G. M. Ljung, G. E. P. Box (1978).

    >>> 0.001 < _whiteness(np.random.default_rng(0).standard_normal(500)) < 0.999
    True
    """
    centred = left - left.mean()
    n, lags = centred.size, min(LAGS, centred.size // 4)
    power = float(centred @ centred)
    ratios = np.array([float(centred[k:] @ centred[:-k]) / power for k in range(1, lags + 1)])
    return float(chi2.sf(n * (n + 2.0) * np.sum(ratios**2 / (n - np.arange(1, lags + 1))), lags))
