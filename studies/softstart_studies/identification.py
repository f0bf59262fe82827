"""`identify` beside least squares on LSODA, on the same simulated logs.

The drive is the crane of [G] with a gap of 80 mrad, damped, without load torque, so that the peer needs no
dry friction. It starts from a random place in its gap. Each log has the torque demand and the angle of an
encoder with 1024 lines every 4 ms; the torque is 1 N m (2.5 %) off in each sample, which nobody is told. The
guess, the same for all, is off by up to a factor of 1.5 in every parameter, or true.

The peer: the usual residual of a simulation, scipy's `least_squares` on LSODA, with intervals from its
Jacobian and the variance of the residual.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.integrate import odeint
from scipy.optimize import least_squares
from scipy.stats import t as student

from softstart import Drive, identify
from softstart.arrays import Matrix, Vector
from softstart.errors import InputError
from softstart.identification.logs import Log
from softstart.identification.planning import Experiment, simulated_log
from softstart.profile import TorqueProfile
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict

NAMES = ("motor_inertia", "load_inertia", "stiffness", "gap", "damping")
SYMBOLS = ("J1", "J2", "c", "gap", "d")
PERIOD, RIPPLE, LINES = 4e-3, 1.0, 1024.0
ASTRAY = 1.5  # factor by which a gap or a stiffness is off where a fit has failed


def drive() -> Drive:
    """The truth.

    >>> drive().load_torque, drive().gap
    (0.0, 0.08)
    """
    return Drive.load("crane-4amtkf").replace(
        gap=0.08, damping=0.3, load_torque=0.0, torque_lag=0.0, encoder_lines=LINES, start_position="unknown"
    )


def truth() -> Vector:
    """Its parameters, in the order of `NAMES`."""
    return np.array([float(getattr(drive(), name)) for name in NAMES])


@dataclass(frozen=True)
class Extent:
    """What is computed: so many logs, fitted from guesses that are off by up to each of these factors."""

    logs: int = 10
    factors: tuple[float, ...] = (1.5, 1.0)


class Fit(NamedTuple):
    """Values in the order of `NAMES`, their intervals of 95 % (none: (k, 0)), and processor time in s."""

    values: Vector
    intervals: Matrix
    seconds: float


EDGES = (0.0, 0.1, 0.3, 0.44, 0.56, 0.68)  # s, of the torque demand
LEVELS = (20.0, 40.0, -10.0, -40.0, -20.0)  # N m

Method = Callable[[Log, Drive], tuple[Vector, Matrix]]


# the peers -----------------------------------------------------------------------------------------------


def moved(x: Sequence[float], log: Log) -> Vector:
    """Angle of the motor at the samples, rad: x = logarithms of `NAMES`, and 1 + artanh of the position
    in the gap, 1 + offset: none is near 0, so that relative steps are fit for differences.
    """
    J1, J2, c, gap, d = np.exp(x[:5]).tolist()
    half, last = 0.5 * gap, log.time.size - 1
    torque, begin = log.torque.tolist(), float(log.time[0])

    def rates(state: Any, now: float) -> tuple[float, float, float, float]:
        phi1, w1, phi2, w2 = state
        u = torque[min(int((now - begin) / PERIOD + 1e-9), last)]
        twist, T = phi1 - phi2, 0.0
        if twist > half:
            T = max(c * (twist - half) + d * (w1 - w2), 0.0)
        elif twist < -half:
            T = min(c * (twist + half) + d * (w1 - w2), 0.0)
        return w1, (u - T) / J1, w2, T / J2

    start = [0.0, 0.0, -half * math.tanh(x[5] - 1.0), 0.0]
    path = odeint(rates, start, log.time, rtol=1e-7, atol=1e-9, hmax=0.5 * PERIOD, mxstep=5000)
    found: Vector = path[:, 0] + x[6] - 1.0
    return found


def by_lsoda(log: Log, guess: Drive) -> tuple[Vector, Matrix]:
    """Least squares of the angle, the motion simulated by LSODA."""
    x0 = np.array([*(math.log(float(getattr(guess, name))) for name in NAMES), 1.0, 1.0])
    found = least_squares(
        lambda x: moved(x, log) - log.values, x0, x_scale="jac", diff_step=1e-4, max_nfev=60
    )
    spare = log.time.size - x0.size
    covariance = np.linalg.pinv(found.jac.T @ found.jac) * 2.0 * found.cost / spare
    half = student.ppf(0.975, spare) * np.sqrt(np.diag(covariance))[:5]
    ends = np.array([found.x[:5] - half, found.x[:5] + half]).T
    return np.exp(found.x[:5]), np.exp(np.clip(ends, -50, 50))


def by_softstart(log: Log, guess: Drive) -> tuple[Vector, Matrix]:
    """`identify`, with its defaults."""
    found = {one.name: one for one in identify(log, guess).estimates}
    ends = [[found[name].lower, found[name].upper] for name in NAMES]
    return np.array([found[name].value for name in NAMES]), np.array(ends)


METHODS: Mapping[str, Method] = {
    "softstart": by_softstart,
    "least squares on LSODA": by_lsoda,
}


# what they find ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Findings:
    """By case and method: the fits of all logs, None where there is none."""

    fits: Mapping[tuple[str, str], tuple[Fit | None, ...]]

    def kept(self, case: str, method: str) -> list[Fit]:
        """Those that did not fail: gap and stiffness within a factor of 1.5."""
        return [
            one
            for one in self.fits[case, method]
            if one is not None and np.all(np.abs(np.log(one.values / truth())[2:4]) < math.log(ASTRAY))
        ]


def logs(off: float, count: int) -> list[tuple[Log, Drive]]:
    """Simulated logs and a guess for each, off by up to a factor.

    >>> log, guess = logs(1.5, 1)[0]
    >>> log.torque_is, bool(guess.gap != drive().gap)
    ('demand', True)
    """
    made = []
    reversal = Experiment("reversal", TorqueProfile.steps(EDGES, LEVELS), EDGES[-1], {}, math.nan, math.nan)
    for number in range(count):
        rng = np.random.default_rng(number)
        truth = drive()
        log = simulated_log(
            truth, reversal, log_period=PERIOD, ripple=RIPPLE, position=rng.uniform(-1.0, 1.0),
            phase=rng.uniform(), seed=int(rng.integers(2**31)),
        )  # fmt: skip
        moves = np.exp(math.log(off) * rng.uniform(-1.0, 1.0, len(NAMES))).tolist()
        guess = {name: float(getattr(truth, name)) * move for name, move in zip(NAMES, moves, strict=True)}
        made.append((log, truth.replace(**guess)))
    return made


def fitted(method: Method, log: Log, guess: Drive) -> Fit | None:
    """The fit, None where the method gives none."""
    begun = time.process_time()
    try:
        values, intervals = method(log, guess)
    except (InputError, np.linalg.LinAlgError, RuntimeError, ValueError):
        return None
    return Fit(values, intervals, time.process_time() - begun)


def find(extent: Extent, progress: Progress) -> Findings:
    """All fits."""
    found: dict[tuple[str, str], tuple[Fit | None, ...]] = {}
    for off in extent.factors:
        made = logs(off, extent.logs)
        case = f"within a factor of {off:g}" if off > 1.0 else "true"
        for name, method in METHODS.items():
            progress(f"guess {case}: {name}")
            found[case, name] = tuple(fitted(method, log, guess) for log, guess in made)
    return Findings(found)


def errors(fits: Sequence[Fit]) -> Vector:
    """Root mean square of the relative error of each parameter."""
    if not fits:
        return np.full(len(NAMES), math.nan)
    found: Vector = np.sqrt(np.mean(np.log(np.array([one.values for one in fits]) / truth()) ** 2, axis=0))
    return found


def coverage(fits: Sequence[Fit]) -> tuple[int, int]:
    """How many intervals hold the truth, of how many."""
    with_ends = [one.intervals for one in fits if one.intervals.size]
    held = sum(int(np.sum((ends[:, 0] <= truth()) & (truth() <= ends[:, 1]))) for ends in with_ends)
    return held, len(NAMES) * len(with_ends)


def table(found: Findings) -> Table:
    """One row for each case and method."""
    rows: list[tuple[object, ...]] = []
    for case, name in found.fits:
        fits = found.kept(case, name)
        held, of = coverage(fits)
        failed = len(found.fits[case, name]) - len(fits)
        off = [None if math.isnan(one) else float(f"{100.0 * one:.3g}") for one in errors(fits)]
        seconds = float(f"{np.median([one.seconds for one in fits]):.2g}") if fits else None
        rows.append((case, name, *off, f"{held} of {of}" if of else "none", failed, seconds))
    return Table(
        "Relative rms error in %, intervals that hold the truth, failed fits",
        ("guess", "method", *SYMBOLS, "intervals of 95 %", "failed", "processor time, s"),
        rows,
    )


def claims(found: Findings) -> tuple[Claim, ...]:
    """Each with its verdict and number."""
    shares: dict[str, list[float]] = {}
    gaps: dict[str, list[float]] = {}
    for case, name in found.fits:
        fits = found.kept(case, name)
        held, of = coverage(fits)
        if of:
            shares.setdefault(name, []).append(held / of)
        if fits:
            gaps.setdefault(name, []).append(float(errors(fits)[3]))
    own, others = shares.pop("softstart", [0.0]), [one for many in shares.values() for one in many]
    told = "; ".join(
        f"{name} {', '.join(f'{100.0 * one:.0f} %' for one in many)}"
        for name, many in {"softstart": own, **shares}.items()
    )
    best = min(gaps, key=lambda name: max(gaps[name])) if gaps else "none"
    return (
        Claim(
            "The intervals of softstart hold the truth in 90 % of all cases or more.",
            Verdict.of(*(one >= 0.9 for one in own)),
            f"Over all parameters and logs: {told}.",
        ),
        Claim(
            "The usual intervals of least squares, with the variance of the residual, hold it less often.",
            Verdict.of(*(one < 0.9 for one in others)),
            f"{len(others)} cases: {', '.join(f'{100.0 * one:.0f} %' for one in others)}.",
        ),
        Claim(
            "softstart finds the gap of a reversal best.",
            Verdict.of(best == "softstart"),
            "Relative rms error, the larger of both guesses: "
            f"{'; '.join(f'{name} {100.0 * max(one):.2f} %' for name, one in gaps.items())}.",
        ),
    )


class IdentificationStudy(Study):
    """`identify` and its peer."""

    name: ClassVar[str] = "identification"
    title: ClassVar[str] = "The drive from logs: softstart beside least squares on LSODA"

    def __init__(self, extent: Extent | None = None) -> None:
        self.extent = extent or Extent()

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """Make the logs, fit them by each method, compare."""
        found = find(self.extent, progress)
        return StudyResult([table(found)], claims(found))
