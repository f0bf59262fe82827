"""From logs to a drive: `identify`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.linalg import orth
from scipy.stats import chi2

from softstart.arrays import Matrix, Vector
from softstart.chain.machines import MachineLike, as_machine
from softstart.chain.model import Chain
from softstart.drive import PARAMETERS, Drive, Machine
from softstart.errors import InputError, Sentence, listed
from softstart.identification.fitting import (
    MOST_RIPPLE,
    STEP,
    ErrorScales,
    FitPoint,
    Fitter,
    LogLinearization,
    agreeing_searches,
)
from softstart.identification.log_files import MOTIONS, SIGNALS
from softstart.identification.logs import TURN, Log
from softstart.identification.model import FILTER, POSITION, LogModel
from softstart.identification.result import AT_LIMIT, FRICTIONS, Estimate, Identification
from softstart.identification.unknowns import (
    FREE,
    Unknown,
    default_parameters,
    model_parameters,
    position_is_unknown,
    selected_parameters,
    unknowns_of,
)
from softstart.parallel import single_threaded_blas
from softstart.quantities import show, to_si
from softstart.vibration import reduce_chain

DOMINANT: Final = 0.5  # of all gaps of a chain, at the motor shaft
SIGNIFICANT: Final = 4.0  # standard deviations of an effect that the model has not, to be named
LARGE_RIPPLE: Final = 0.06  # of the largest torque: more is no ripple
OUTLIER: Final = 5.0  # standard deviations that hardly a sample is off
UNSETTLED: Final = 4.0  # gain of the likelihood by another step, from which the fit is none
CHANCE, INDEPENDENT = 1e-5, 1e-4  # that errors alone leave such a slow torque, such correlations
WAVES: Final = 20  # torques that change slowly, of which none must be left
LAGS: Final = 20  # samples over which what is left must not be correlated
DOUBTFUL: Final = 5.0  # ratio of inertias found and guessed that is told
STEP_ALIKE: Final = 1e-3  # error of the step of an encoder by log and lines
SUSPECT: Final = 25.0  # ratio of inertia by log and guess that only a wrong unit explains


@single_threaded_blas
def identify(
    logs: Log | Sequence[Log],
    drive: MachineLike,
    *,
    free: Iterable[str] | None = None,
    searches: int = 12,
    progress: Callable[[str], None] | None = None,
) -> Identification:
    """Identify the parameters of a drive, with confidence intervals, from inverter logs of its starts.

    The exact plant under the torque of the log is fitted to the angle or speed of the motor: by searches from
    the guess and from points up to a factor of 4 around it, then by maximum likelihood, with the covariance
    of what the encoder rounds and of a torque error that the plant integrates. The ends of an interval are
    where the likelihood, with all else and the size of the errors fitted again, has dropped.

    Parameters
    ----------
    logs : Log or sequence of Log
        Logs of one drive, each beginning at standstill; `Log.load` reads them from CSV files.
    drive : Drive, Chain, str or path
        The guess, by factors of 3 if need be; what is not free stays as it is there. For a chain with one
        dominant gap the two masses that stand for it are found. The
        position in the gap is free for each log where friction holds the load or the drive says "unknown".
        A `load_friction` besides the load torque is kept as it is.
    free : iterable of str, optional
        What to find: names of parameters, and "position". By default inertias, stiffness, gap, damping, load
        torque, with a torque demand the lag, and each friction that the guess has; a name after a plus, as
        "+motor_friction", is found beside these.
    searches : int
        At most so many searches; fewer if two of them end at the best minimum.
    progress : callable, optional
        Called with a text that says what is being done.

    Returns
    -------
    Identification
        Drive, intervals (none where the drive does not explain the logs), what is unknown and why, what the
        logs show that the model has not.

    Raises
    ------
    InputError
        For bad input, for logs that no drive explains, and for units that cannot be right.

    Examples
    --------
    >>> from softstart.identification.planning import simulated_log
    >>> crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", gap=0.08, damping=0.3)
    >>> guess = crane.replace(gap=0.2, stiffness=200.0, load_inertia=0.4)
    >>> found = identify(simulated_log(crane, "two levels, then reverse", ripple=1.0), guess, searches=2)
    >>> found["gap"].lower < 0.08 < found["gap"].upper
    True

    References
    ----------
    D. A. Harville, J. Amer. Statist. Assoc. 72 (1977) 320-338; D. M. Bates, D. G. Watts, Nonlinear Regression
    Analysis, 1988.
    """
    machine = as_machine(drive)
    drive = reduced_drive(machine)
    given_logs = [logs] if isinstance(logs, Log) else logs
    read = [_directed(one.integrated(float(drive.encoder_lines)), drive) for one in given_logs]
    if not read or searches < 1:
        raise InputError("logs, searches: give at least one log and one search.")
    names, moving = _free(free, drive, read)
    for one in read:
        _check_inertia(one, drive)
        _check_step(one, float(drive.encoder_lines))
    base = drive if moving else drive.design_drive
    base = base.replace(**({"start_position": "mid-gap"} if moving else {"initial_speed": 0.0}))
    unknowns = unknowns_of(names, drive, read, [moving for _ in read])
    fitter = Fitter([LogModel.of(one, base) for one in read], unknowns, progress or (lambda _: None))
    minima = fitter.search(searches)
    fitter.progress("weights and fit")
    best, others = fitter.most_likely(minima[0][0]), list[FitPoint]()
    misfit_warnings = model_mismatch(fitter, best)
    if not misfit_warnings:
        seek, best = _any_undetermined(fitter, best), fitter.with_likelihood(best, best)
        if seek:
            fitter.progress("other explanations")
            best, others = fitter.explanations(best)
        misfit_warnings = model_mismatch(fitter, best)
    estimates = _without_intervals(unknowns, best.x) if misfit_warnings else _estimates(fitter, best, others)
    changes = {one.name: one.value for one in estimates if one.name in PARAMETERS}
    source = f"identified from {', '.join(one.name for one in read)}"
    identified = drive.replace(**changes, source=source + (f"; else: {drive.source}" if drive.source else ""))
    notes = [
        *(f"{one.name}: {note}" for one in read for note in one.notes),
        *_neglected_modes(machine),
        *(misfit_warnings or _unknown_parameters(estimates)),
        *_scale_warning(drive, identified),
        "The torque scale cannot be identified from motion: if the signal is 10 % low, so are both inertias, "
        "stiffness, damping and load torque; K_dyn hardly changes.",
    ]
    return Identification(
        drive=identified,
        guess=drive,
        logs=tuple(read),
        estimates=tuple(estimates),
        correlations=_correlations(fitter, best),
        ripple=best.sizes.ripple,
        searches=len(minima),
        agreed=agreeing_searches(minima),
        notes=tuple(notes),
        residuals=tuple(fitter.unscaled_residuals(best)),
    )


def _directed(log: Log, drive: Drive) -> Log:
    """The log as the drive counts: where both directions are alike, the first one is forward."""
    turned = log.forward()
    if turned is log or float(drive.active_torque) == 0.0:
        return turned
    note = (
        "the drive first turns backward, driven by the active load; if the log has the opposite sign "
        "convention, change both signs: set columns to torque=-NAME,angle=-NAME"
    )
    return log.changed(notes=(*log.notes, note.replace("angle", log.kind)))


def reduced_drive(machine: Machine) -> Drive:
    """The drive of two masses that stands for a machine; refused where no gap is the larger part of all.

    >>> reduced_drive(Chain.load("crane-4-mass"))
    Traceback (most recent call last):
    softstart.errors.InputError: drive = Crane travel drive as a chain of four masses: its widest gap is 40 %
    of all; ...
    """
    if isinstance(machine, Chain) and (held := machine.at_motor_shaft().held) is not None:
        raise InputError(
            f"drive = {machine.name}: {machine.mass_names[held]} stays at rest, but the model has two free "
            "masses; remove it if it did not hold the chain during the log."
        )
    gaps = machine.gaps
    whole = float(gaps.sum())
    if whole > 0.0 and float(gaps.max()) <= DOMINANT * whole:
        raise InputError(
            f"drive = {machine.name}: its widest gap is {100.0 * float(gaps.max()) / whole:.0f} % of all; "
            "the model has one gap, so that one gap must be the larger part."
        )
    return machine.two_masses


def _neglected_modes(chain: Machine) -> list[str]:
    """What the reduction of more than two masses leaves out."""
    if not isinstance(chain, Chain) or len(chain.masses) <= 2:
        return []
    first, second = (reduce_chain(chain, force=True).vibration.Omega[1:3] / TURN).tolist()
    return [
        f"{chain.name} has {len(chain.masses)} masses; its two-mass model was identified, with the first "
        f"natural frequency, {first:.4g} Hz. Modes from {second:.4g} Hz on are neglected; the intervals do "
        "not include that error."
    ]


def _free(free: Iterable[str] | None, drive: Drive, logs: Sequence[Log]) -> tuple[list[str], bool]:
    """The parameters to find, and whether the position of each log is among them."""
    demand = any(log.torque_is == "demand" for log in logs)
    names = default_parameters(drive, lag=demand) + ([POSITION] if position_is_unknown(drive) else [])
    chosen_names = selected_parameters(free, names, (*FREE, POSITION), "logs")
    reasons = {}
    if any(log.kind == "angle" for log in logs):
        reasons[FILTER] = "an angle has no speed filter; remove it."
    if not demand:
        already = (
            'a measured torque contains it already; remove it, or log the demand (torque_is = "demand").'
        )
        reasons |= dict.fromkeys(("torque_lag", "computing_delay"), already)
    if not float(drive.load_torque):
        reasons["load_torque"] = "the guess is 0; give a guess with the right sign."
    if wrong := [name for name in chosen_names if name in reasons and free is not None]:
        raise InputError(f"free = {show(wrong[0])}: {reasons[wrong[0]]}")
    if chosen_names in ([], [POSITION]):
        raise InputError("free: nothing to identify; name parameters, for example gap and stiffness.")
    # the filter, which is not the drive's, last
    return [name for name in FREE if name in chosen_names], POSITION in chosen_names


def _check_inertia(log: Log, drive: Drive) -> None:
    """Refuse a log whose units cannot be right: torque over acceleration is far from the inertia guessed."""
    speed, impulse = log.speed_and_impulse
    inertia = float(np.max(np.abs(impulse))) / max(float(np.max(np.abs(speed))), 1e-300)
    low, high = float(drive.J1), float(drive.J1 + drive.J2)
    if low / SUSPECT <= inertia <= high * SUSPECT:
        return
    raise InputError(
        f"{log.name}: torque and motion give an inertia of about {inertia:.3g} kg m2, but the drive has "
        f"{low + float(drive.J2):.3g} kg m2; check the units of the columns: write time in ms, speed in rpm, "
        "angle in degrees or revolutions, torque in % in the first line, as time [ms], or set columns to "
        '"time=NAME [ms]".'
    )


def _check_step(log: Log, lines: float) -> None:
    """Refuse a log whose steps are those of the encoder in another unit than the log says."""
    period = float(np.median(np.diff(log.time))) if log.kind == "speed" else 1.0
    counts = log.count * period * 4.0 * lines / TURN
    si = SIGNALS[log.kind].unit
    for unit in MOTIONS[log.kind]:
        # 1 if the numbers are in this unit and were read in SI
        share = counts * float(to_si(f"1 {unit}", si))
        if abs(share - 1.0) < STEP_ALIKE and abs(counts - 1.0) > STEP_ALIKE:
            raise InputError(
                f"{log.name}: the {log.kind} changes in steps of {log.count:.4g} {si}, the counts of "
                f'{lines:g} encoder lines in {unit}; set columns to "{log.kind}=NAME[{unit}]", or '
                "motor.encoder_lines to 0 for another encoder."
            )


def _any_undetermined(fitter: Fitter, best: FitPoint) -> bool:
    """Whether there is a number that the logs do not tell, were all intervals symmetric."""
    fits = zip(fitter.unknowns, best.x.tolist(), fitter.half_widths(best).tolist(), strict=True)
    return any(one.kind != "offset" and not one.known(x, half, one.guess) for one, x, half in fits)


def _without_intervals(unknowns: Sequence[Unknown], x: Vector) -> list[Estimate]:
    """The best fit, of which no number is called known."""
    return [
        Estimate(p.title, p.value(number), math.nan, math.nan, False, "no confidence interval")
        for p, number in zip(unknowns, x.tolist(), strict=True)
        if p.kind != "offset"
    ]


def _correlations(fitter: Fitter, best: FitPoint) -> Matrix:
    """Of the estimates; the further forward a position, the smaller its number in the fit."""
    covariance = fitter.covariance(best)
    signs = [-1.0 if p.kind == "position" else 1.0 for p in fitter.unknowns]
    sizes = np.sqrt(np.diag(covariance)) * signs
    kept = sum(p.kind != "offset" for p in fitter.unknowns)
    return np.asarray((covariance / np.outer(sizes, sizes))[:kept, :kept])


def _estimates(fitter: Fitter, best: FitPoint, others: Sequence[FitPoint]) -> list[Estimate]:
    """Values and intervals: their ends are where the fit gets worse, with all else refitted."""
    estimates, lost = [], set[str]()
    halves, covariance = fitter.half_widths(best), fitter.covariance(best)
    for i, (p, x, half) in enumerate(zip(fitter.unknowns, best.x.tolist(), halves.tolist(), strict=True)):
        if p.kind == "offset":
            continue
        fitter.progress(f"interval of {p.title}")
        ends = [fitter.end(i, sign, half, best, others) for sign in (-1.0, 1.0)]
        known = p.known(x, half, p.guess) and p.known(x, 0.5 * (ends[1] - ends[0]))
        known = known and not (p.kind == "position" and "gap" in lost)  # a share of the gap
        limited = p.limited(x) or (known and any(map(p.limited, ends)))
        reason = AT_LIMIT if limited else "" if known else _reason(i, covariance, fitter.unknowns)
        if reason:
            lost.add(p.name)
        lower, upper = sorted(map(p.value, ends))
        estimates.append(Estimate(p.title, p.value(x), lower, upper, not reason, reason))
    return estimates


def _reason(i: int, covariance: Matrix, unknowns: Sequence[Unknown]) -> str:
    """With what an unknown number goes together, or that nothing depends on it."""
    sizes = np.sqrt(np.diag(covariance))
    ratio = np.abs(covariance[i] / (sizes[i] * sizes))
    ratio[i] = 0.0
    partner = int(np.argmax(ratio))
    if ratio[partner] > 0.9 and unknowns[partner].kind != "offset":
        name = unknowns[partner].title
        return f"not separately identifiable from {name} (correlation {ratio[partner]:.2f})"
    return "the motor motion in these logs hardly depends on it"


def _unknown_parameters(estimates: Sequence[Estimate]) -> list[str]:
    """What is unknown, why, and what helps."""
    reasons: dict[str, list[str]] = {}
    for estimate in estimates:
        if not estimate.known and not estimate.name.startswith(POSITION):
            reasons.setdefault(estimate.reason, []).append(estimate.name)
    if not reasons:
        return []
    remedy, command = "log an experiment that identifies it", "softstart plan"
    if AT_LIMIT in reasons:
        remedy, command = f"start from another initial guess of {listed(reasons[AT_LIMIT])}", "--set"
    groups = "; ".join(f"{listed(group)}: {reason}" for reason, group in reasons.items())
    return [Sentence(f"Unknown: {groups}.", f"Remedy: {remedy} ({command}).", page=f"Remedy: {remedy}.")]


def _scale_warning(guess: Drive, identified: Drive) -> list[str]:
    """A wrong unit of speed or angle is explained by another drive: only the guess can tell."""
    ratio = float((identified.J1 + identified.J2) / (guess.J1 + guess.J2))
    if 1.0 / DOUBTFUL < ratio < DOUBTFUL:
        return []
    return [
        f"The identified inertias are {ratio:.2g} times those of the guess. If the guess is better, check "
        "the units of the log: rpm read as rad/s makes inertias and stiffness 9.5 times too small and the "
        "gap as much too wide, with the same fit."
    ]


def model_mismatch(fitter: Fitter, best: FitPoint) -> list[str]:
    """What the logs contain that the model does not."""
    sizes, largest, shown = best.sizes, fitter.largest_torque, list[str]()
    usual_torque = max(largest, 0.5 * float(fitter.models[0].guess.Ms))
    if sizes.ripple > min(LARGE_RIPPLE * usual_torque, MOST_RIPPLE * largest):
        share = 100.0 * sizes.ripple / largest
        shown.append(f"a torque error of {sizes.ripple:.3g} N m in each sample, {share:.0f} % of the largest")
    if (slow := min(_slow_torque(one, sizes) for one in best.spots)) < CHANCE:
        shown.append(f"a torque that changes slowly (chance {slow:.1g})")
    for model, spot in zip(fitter.models, best.spots, strict=True):
        left = spot.innovations(sizes)
        if (chance := _whiteness(left)) < INDEPENDENT:
            shown.append(f"{model.log.name}: errors not independent of each other (chance {chance:.1g})")
        if (far := int(np.sum(np.abs(left) > OUTLIER))) > 2 + 0.005 * left.size:
            shown.append(f"{model.log.name}: {far} samples more than {OUTLIER:g} standard deviations off")
    notes = _effects(fitter, best)
    if shown:
        notes.append(
            "Unmodelled effects are likely (another friction or load, cogging, a second gap, elastic parts, "
            "a demand not realised; signals filtered, clipped, cut or of another shaft): "
            f"{'; '.join(shown)}."
        )
    wider = [
        replace(one, lower=one.lower - (0.0 if one.is_friction else 1e3), upper=one.upper + 1e3)
        if one.kind in ("logarithm", "power")
        else one
        for one in fitter.unknowns
    ]
    if replace(fitter, unknowns=wider).step(best)[1] > UNSETTLED:
        ends = [one.name for one, x in zip(fitter.unknowns, best.x.tolist(), strict=True) if one.limited(x)]
        where = f"beyond the limit of the search for {listed(ends)}" if ends else "elsewhere"
        notes.append(f"The fit improves {where}: start from another initial guess.")
    if notes:
        notes.append("The model does not fit the logs; best-fit values without confidence intervals.")
    return notes


def _effects(fitter: Fitter, best: FitPoint) -> list[str]:
    """The friction, or the offset of the torque, that explains most of what is left, if it is sure."""
    residual, jacobian = best.white
    names, drive = {one.name for one in fitter.unknowns}, fitter.models[0].guess
    missing = unknowns_of([name for name in FRICTIONS if name not in names], drive, (), ())
    steps = {one.name: STEP * one.scale for one in missing}
    had = {name: float(getattr(drive, name)) for name in steps}
    logs = []  # of each the shape of each effect in what is left
    for i, (model, spot) in enumerate(zip(fitter.models, best.spots, strict=True)):
        values = model_parameters(fitter.unknowns, best.x, i) | had
        points = [values, *(values | {name: had[name] + step} for name, step in steps.items())]
        signals = model.signals(points, spot.error)[:, model.rows] / model.root
        shapes = [(one - signals[0]) / step for one, step in zip(signals[1:], steps.values(), strict=True)]
        shapes.append(model.log.sign * math.sqrt(model.block) * spot.response.sum(axis=1))
        logs.append(np.array(shapes) @ spot.rotation.T / np.sqrt(spot.variance(best.sizes)))
    sure = [(SIGNIFICANT, "", 0.0, 0.0)]
    for name, shape in zip((*steps, "offset"), np.hstack(logs), strict=True):
        alone = shape - jacobian @ np.linalg.lstsq(jacobian, shape, rcond=None)[0]
        strength = float(alone @ alone)
        if strength < 1e-6 * float(shape @ shape):
            continue
        size, deviation = -float(alone @ residual) / strength, 1.0 / math.sqrt(strength)
        drives = size < -had.get(name, math.inf)
        far = name == "offset" and abs(size) > fitter.largest_torque  # of a small effect alone J tells
        if not drives and not far:
            sure.append((abs(size) / deviation, name, size, deviation))
    _, effect, amount, error = max(sure)
    if not effect:
        return []
    what, unit, remedy = "an offset of the torque signal", "N m", ""
    if effect != "offset":
        parameter = PARAMETERS[effect]
        what, unit = parameter.meaning, parameter.unit
        remedy = f"Remedy: identify it too, --free +{parameter.path}."
    value = had.get(effect, 0.0)
    fact = (
        f"The logs contain {what} of {value + amount:.3g} +- {2.0 * error:.2g} {unit}, but the drive has "
        f"{value:.3g}: gap and load torque may be far off."
    )
    return [Sentence(fact, remedy, page="")]  # the page has no choice of unknowns


def _slow_torque(spot: LogLinearization, sizes: ErrorScales) -> float:
    """Chance that no torque that changes slowly is left: the share of it in what is left is chi-square.

    Of the torques cos(k pi t/T), of which the parameters explain a part.
    """
    root = np.sqrt(spot.variance(sizes))
    count, known = spot.response.shape[1], spot.jacobian.shape[1]
    waves = np.cos(math.pi * np.outer(np.arange(count) + 0.5, np.arange(min(WAVES, count))) / count)
    both = np.column_stack([spot.jacobian, spot.rotation @ spot.response @ waves]) / root[:, None]
    both /= np.maximum(np.linalg.norm(both, axis=0), 1e-300)
    of_all, of_model = orth(both, rcond=1e-6), orth(both[:, :known], rcond=1e-6)
    residual = spot.residual / root
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
