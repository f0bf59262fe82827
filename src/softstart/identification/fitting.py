"""The fit: a search that needs no good guess, then least squares weighted by what the errors do.

The log is y = f(x, e) + n: f the exact plant under the torque of the log and an error e of it, independent
with the standard deviation `ripple` in each sample, n what the encoder rounds, with the covariance B
(`edges`). About the e that is most likely at x, y has the covariance V = noise^2 B + ripple^2 G G', G the
response to e, and x is found by

    L(x) = ln|V| + r' V^-1 r -> min        r = f(x, e) - G e - y

Least squares without G is far too sure of itself: a torque error is integrated twice and stays in all later
samples. Both deviations follow from restricted maximum likelihood,

    ln|V| + ln|J' V^-1 J| + r' P r -> min,    P = V^-1 - V^-1 J (J' V^-1 J)^-1 J' V^-1

seen through L^-1 (B = L L') and the singular vectors of L^-1 G, where V is diagonal (D. A. Harville, J.
Amer. Statist. Assoc. 72 (1977) 320-338).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.optimize import least_squares, minimize
from scipy.stats import qmc
from scipy.stats import t as student

from softstart.arrays import Matrix, Vector
from softstart.drive import FRICTIONS, PARAMETERS, Drive
from softstart.errors import InputError, SimulationError
from softstart.identification.covariance import edges, root_of_covariance
from softstart.identification.logs import Log
from softstart.identification.model import POSITION, LogModel
from softstart.identification.result import CONFIDENCE, WIDEST
from softstart.quantities import nearest, show

FREE: Final = (
    "motor_inertia", "load_inertia", "stiffness", "gap", "damping", "load_torque",
    "torque_lag", "computing_delay", *FRICTIONS, "speed_filter",
)  # fmt: skip
HORIZONS: Final = (0.07, 0.13, 0.27, 0.5, 1.0)  # of each log, in which the search follows it step by step
FACTOR: Final = 4.0  # how far from the guess searches begin; they may go 3 times as far
STEP: Final = 1e-6
ROUNDS: Final = 5  # of weights and fit; fewer if nothing moves by more than
SETTLED: Final = 5e-4  # in logarithms
# beforehand a torque error of 2.5 % of the largest torque, within a factor of 3: a log that cannot tell how
# large it is (coarse encoder, few samples) must not conclude that there is none
RIPPLE, RIPPLE_FACTOR = 0.025, 3.0
MOST_STEPS, HALVINGS = 20, 7  # towards an end of an interval, or the most likely x
TURNS: Final = 4  # of the most likely torque error at one x; fewer if it moves by less than
ERROR_SETTLED: Final = 0.1  # standard deviations, all samples together
STEEP: Final = 1e-3  # what the likelihood must still gain for another step
ROUNDS_OF_ENDS: Final = 2  # of deviations and an end
SCANNED: Final = 5  # values of what the logs do not tell, at which all else is fitted
SCAN_STEPS: Final = 10  # of these fits, from which ends of intervals are then followed
LOADS: Final = (0.08, 0.25, 0.45, 0.7)  # load torques from which valleys are sought, over the largest
FIRST_ROUNDS: Final = 2  # of weights and fit, on the way to a valley
LONGEST_STEP: Final = 0.7  # of a number of x, towards it
HOPELESS: Final = 100.0  # above the least L: no place there is as likely
CLOSE: Final = 0.04  # how far the root of the squares may be off there
MOST_RIPPLE: Final = 0.25  # of the largest torque: more is no small error, see `Fitter.slope`
APART: Final = 0.02  # of x, or half a standard error if that is less: for derivatives of covariances
AGREED: Final = 2  # searches that end at the best minimum before it is believed
WIDEST_FRICTION: Final = 1.0  # units of a friction, see `Space.of`; its interval is wider if it is unknown
MOST_FRICTION: Final = 3.0  # units; as far as a search goes
LEAST_FRICTION: Final = 1e-8  # units; less is none, which the plant's events could not tell from rounding
# x = (value/unit)^power where a logarithm would stretch what is small until no derivative is left of it, and
# the interval of all else would be that of a drive without it: a motion depends on torques of the load
# linearly, and on the root of a gap, the time that the motor takes through it
POWERS: Final = {"gap": 0.5, "load_torque": 1.0} | dict.fromkeys(FRICTIONS, 1.0)


Progress = Callable[[str], None]


@dataclass(frozen=True)
class Space:
    """The unknowns x: logarithms, powers of gap, load torque and frictions, positions, offsets of angles.

    First come the parameters that all logs share, then for each log its position (where that is free) and its
    offset (where it holds angles). Frictions may be 0. See `POWERS`. A position is the root of the share of
    the gap before the driving flank, `position_of`: with the root of the gap it makes the time to the flank.
    """

    shared: tuple[str, ...]
    positions: tuple[bool, ...]
    offsets: tuple[bool, ...]
    units: tuple[float, ...]  # of the shared ones: sign of a logarithm, value of a power at x = 1

    @classmethod
    def of(
        cls, shared: Sequence[str], drive: Drive, positions: Sequence[bool], offsets: Sequence[bool]
    ) -> Space:
        """The space of these parameters of a drive.

        The unit of a friction is the one that takes a tenth of the torque that accelerates, at the target
        speed if it is viscous; that of gap and load torque is the drive's own.

        >>> crane = Drive.load("crane-4amtkf").replace(motor_friction=1.5)
        >>> space = Space.of(["gap", "motor_friction"], crane, [True], [False])
        >>> round(space.values(np.array([*space.point(crane), 0.2]), 0)["motor_friction"], 12)
        1.5
        """
        torque = 0.1 * max(float(drive.Ms) - abs(float(drive.Mc)), 0.1 * float(drive.Ms))
        of_speed = torque / float(drive.target_speed)
        own = {name: float(getattr(drive, name)) or 1.0 for name in ("gap", "load_torque")}
        units = own | {"motor_friction": torque} | dict.fromkeys(FRICTIONS[1:], of_speed)
        sign = {name: math.copysign(1.0, float(getattr(drive, name, 1.0))) for name in shared}
        return cls(
            tuple(shared), tuple(positions), tuple(offsets), tuple(units.get(n, sign[n]) for n in shared)
        )

    def point(self, drive: Drive) -> list[float]:
        """The shared part of x at the parameters of a drive, none of which with a logarithm is 0."""
        return [self.number(i, float(getattr(drive, name))) for i, name in enumerate(self.shared)]

    def number(self, i: int, value: float) -> float:
        """x_i at a value of the shared parameter i, the inverse of `value`."""
        scaled, power = value / self.units[i], POWERS.get(self.shared[i])
        return math.log(scaled) if power is None else math.copysign(abs(scaled) ** power, scaled)

    def share(self, i: int, x: float, half: float) -> float:
        """Half an interval of x_i about x as a share of the value, to first order."""
        power = POWERS.get(self.shared[i])
        return half if power is None else half / max(power * x, 1e-300)

    def known(self, i: int, x: float, half: float, guess: float | None = None) -> bool:
        """Whether half an interval of x_i about x tells what it is: within a factor of 3, or half a gap.

        The value found must not decide: the log tells a small load torque in N m, and where it comes out too
        large by chance, its relative interval is narrow. So where x is above its guess, the interval is
        compared with the guess (at most by the factor of 3 that a guess may be off).

        >>> space = Space.of(["load_torque"], Drive.load("crane-4amtkf"), [True], [False])
        >>> space.known(0, 1.0, 0.5), space.known(0, 1.5, 0.6, guess=1.0), space.known(1, 0.7, 0.2)
        (True, False, True)
        """
        if i >= len(self.shared):
            return half < 0.25
        if self.shared[i] in FRICTIONS:
            return 2.0 * half < WIDEST_FRICTION
        over = 1.0 if guess is None else self.value(i, x) / self.value(i, guess)
        return 2.0 * self.share(i, x, half) * min(max(over, 1.0), WIDEST) < math.log(WIDEST)

    def value(self, i: int, x: float) -> float:
        """The value of the shared parameter i at this x_i."""
        power = POWERS.get(self.shared[i])
        if power is None:
            return self.units[i] * math.exp(x)
        return self.units[i] * math.copysign(abs(x) ** (1.0 / power), x) if x > LEAST_FRICTION else 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """What each number of x stands for."""
        own = [f"{POSITION} {i}" for i, free in enumerate(self.positions, 1) if free]
        return (*self.shared, *own, *(f"offset {i}" for i, free in enumerate(self.offsets, 1) if free))

    @property
    def weak(self) -> Vector:
        """1/variance of each number of x beforehand: e^3, 3 units of a power, 1/4 of a position."""
        shared, places = len(self.shared), sum(self.positions)
        return np.array([1.0 / 9.0] * shared + [16.0] * places + [0.0] * sum(self.offsets)) + 1e-12

    def place(self, log: int) -> tuple[int | None, int | None]:
        """Where in x the position and the offset of a log stand."""
        first, second = len(self.shared), len(self.shared) + sum(self.positions)
        return (
            first + sum(self.positions[:log]) if self.positions[log] else None,
            second + sum(self.offsets[:log]) if self.offsets[log] else None,
        )

    def values(self, x: Vector, log: int) -> dict[str, float]:
        """The parameters of the model of one log."""
        found = {name: self.value(i, float(x[i])) for i, name in enumerate(self.shared)}
        position, _ = self.place(log)
        return found if position is None else found | {POSITION: position_of(float(x[position]))}


def position_of(x: float) -> float:
    """The position in the gap, 1 at the driving flank, where the root of the share before that flank is x.

    >>> position_of(0.0), round(position_of(root_of(-0.6)), 12)
    (1.0, -0.6)
    """
    return 1.0 - 2.0 * x * x


def root_of(position: float) -> float:
    """The inverse of `position_of`."""
    return math.sqrt(max(0.5 * (1.0 - position), 0.0))


def usual(drive: Drive, *, lag: bool) -> list[str]:
    """What is found where nothing is said: what the drive has, and the lag of its torque if that shows.

    >>> usual(Drive.load("crane-4amtkf").replace(motor_friction=1.5), lag=True)[-2:]
    ['load_torque', 'motor_friction']
    """
    others = ("gap", "load_torque", *(["torque_lag"] if lag else []), *FRICTIONS)
    missing = {name for name in others if float(getattr(drive, name)) == 0.0}
    names = (*FREE[:5], *others[1:])
    return [name for name in names if name not in missing]


def chosen(
    free: Iterable[str] | None, usual: Sequence[str], possible: Sequence[str], where: str
) -> list[str]:
    """The parameters to find: those named, or with a plus before a name the usual ones and that one.

    Names of the drive file stand for those of Python. `where` says what cannot tell any other parameter.

    >>> chosen(["+motor.friction"], ["gap", "stiffness"], FREE, "logs")
    ['gap', 'stiffness', 'motor_friction']
    """
    if free is None:
        return list(usual)
    asked, paths = list(free), {one.path: name for name, one in PARAMETERS.items()}
    found = list(usual) if any(name.startswith("+") for name in asked) else []
    for given in asked:
        name = paths.get(given.removeprefix("+"), given.removeprefix("+"))
        if name not in possible:
            near = nearest(name, possible)
            hint = f"did you mean {near}?" if near else f"those are {', '.join(possible)}."
            raise InputError(f"free = {show(given)}: it is no parameter that {where} can tell; {hint}")
        found.append(name)
    return list(dict.fromkeys(found))


class Part(NamedTuple):
    """What a log gives at one x: its residual and the derivatives of its signal, in the rows that count."""

    residual: Vector
    jacobian: Matrix


class Weights(NamedTuple):
    """The covariance of one log, diagonal where it is seen through a matrix: noise^2 + ripple^2 eigenvalues.

    It holds for small errors beside the torque error `error`, which the model has (`Fitter.about`).
    """

    rotation: Matrix
    eigenvalues: Vector
    response: Matrix  # to the torque error
    root: Vector  # deviation of the measurement, B = diag(root^2)
    error: Vector | None  # of the torque, one for each block
    shift: Vector | None  # what the linear response to it adds to the signal


class Errors(NamedTuple):
    """How large the errors are: noise in units of what the encoder rounds, ripple of the torque in N m."""

    weights: Sequence[Weights]
    noise: float
    ripple: float


class Likely(NamedTuple):
    """A log about the torque error that is most likely at one x, in units of what the encoder rounds."""

    value: float  # ln|V| + r' V^-1 r
    root: Matrix  # V = root root'
    seen: Matrix  # the response to the torque error, each of one standard deviation
    residual: Vector  # root^-1 r


class Slope(NamedTuple):
    """L(x + s) = value + 2 gradient' s + s' curvature s, nearly; see the head of this file."""

    value: float
    gradient: Vector
    curvature: Matrix


class Solution(NamedTuple):
    """Where the fit ended, within which bounds, and how sure it is."""

    x: Vector
    errors: Errors
    freedom: Vector  # degrees of freedom of the variance of each number of x
    part: Part
    lower: Vector
    upper: Vector
    slope: Slope


Other = tuple[Vector, Matrix, float]  # another explanation: x, its covariance, L


class TimeIsUpError(Exception):
    """The time of a fit is up."""


class Fitter:
    """Logs, their models and which of their samples count."""

    def __init__(self, models: Sequence[LogModel], space: Space, progress: Progress | None = None) -> None:
        self.models, self.space = list(models), space
        told = [self._measured(one.log, one.log.values) for one in models]
        self.values = [values for values, _ in told]  # NaN where there is none, or where others tell it
        self.counts = [np.isfinite(values) for values in self.values]
        self.roots = [np.sqrt(variance[rows]) for (_, variance), rows in zip(told, self.counts, strict=True)]
        self._progress = progress or (lambda _: None)
        self.deadline = math.inf

    def progress(self, text: str) -> None:
        """Say what is being done; raises `TimeIsUpError` after the deadline."""
        if time.perf_counter() > self.deadline:
            raise TimeIsUpError
        self._progress(text)

    @property
    def largest_torque(self) -> float:
        """The largest torque of the logs, N m."""
        return max(float(np.max(np.abs(one.log.torque))) for one in self.models)

    # ---- residuals ---------------------------------------------------------------------------------------

    def part(self, x: Vector, log: int, share: float = 1.0, derivatives: bool = True) -> Part:
        """Residual (model minus log) and derivatives over the first `share` of a log."""
        model, space = self.models[log], self.space
        short = model if share >= 1.0 else model.first(share)
        rows = self.counts[log][: short.times.size]
        position, offset = space.place(log)
        moved = [*range(len(space.shared)), *([] if position is None else [position])]
        points = [space.values(x, log)]
        steps = []
        for i in moved if derivatives else ():
            step = -STEP if i == position and x[i] > 0.5 else STEP
            other = x.copy()
            other[i] += step
            steps.append(step)
            points.append(space.values(other, log))
        signals = short.signals(points)
        base = signals[0] - self.values[log][: short.times.size]
        if short.shift is not None:
            base = base - short.shift[: base.size]
        if offset is not None:
            base = base + x[offset]
        jacobian = np.zeros((int(rows.sum()), x.size))
        for column, i, step in zip(signals[1:], moved, steps, strict=False):
            jacobian[:, i] = ((column - signals[0]) / step)[rows]
        if offset is not None:
            jacobian[:, offset] = 1.0
        return Part(base[rows], jacobian)

    def left(self, x: Vector) -> list[Vector]:
        """Model minus log in each sample of each log."""
        found = []
        for i, model in enumerate(self.models):
            _, offset = self.space.place(i)
            one = model.signals([self.space.values(x, i)])[0] - model.log.values
            if model.shift is not None:
                one -= model.shift
            found.append((one if offset is None else one + x[offset])[np.isfinite(model.log.values)])
        return found

    def parts(self, x: Vector, share: float = 1.0, derivatives: bool = True) -> list[Part]:
        """Residuals and derivatives of every log."""
        return [self.part(x, i, share, derivatives) for i in range(len(self.models))]

    # ---- the search --------------------------------------------------------------------------------------

    def search(
        self, guess: Vector, lower: Vector, upper: Vector, most: int, seed: int, deadline: float = math.inf
    ) -> list[tuple[Vector, float]]:
        """Minima of the plain squares, best first: from the guess, then from points all over the range.

        Each search follows the logs from their beginning, over longer and longer parts: what comes early is
        explained before errors can pile up, which is what makes the basin wide.
        """
        free = [i for i, name in enumerate(self.space.names) if not name.startswith("offset")]
        draws = qmc.Sobol(len(free), seed=seed).random_base2(max(1, math.ceil(math.log2(max(most, 2)))))
        found: list[tuple[Vector, float]] = []
        for number in range(most):
            start = guess.copy()
            for i, draw in zip(free, draws[number - 1], strict=True) if number else ():
                move = 2.0 * draw - 1.0
                if i >= len(self.space.shared):
                    start[i] = math.sqrt(draw)
                elif self.space.shared[i] in FRICTIONS:
                    start[i] = guess[i] + move * math.log(FACTOR)
                else:
                    start[i] = self.space.number(i, self.space.value(i, guess[i]) * FACTOR**move)
            self.progress(f"search {number + 1}")
            try:
                found.append(self._follow(np.clip(start, lower, upper), lower, upper))
            except (InputError, SimulationError):
                continue
            found.sort(key=lambda one: one[1])
            best = found[0][1]
            if (
                sum(cost <= 1.01 * best + 1e-300 for _, cost in found) >= AGREED
                or time.perf_counter() > deadline
            ):
                break
        if not found:
            raise InputError("The logs cannot be computed with any of the values tried; check their units.")
        return found

    def _follow(self, x: Vector, lower: Vector, upper: Vector) -> tuple[Vector, float]:
        scales = [one.log.scale for one in self.models]
        for share in HORIZONS:
            anchor, last = x.copy(), share == HORIZONS[-1]
            pull = 0.0 if last else 1.0

            def residual(
                x: Vector, share: float = share, anchor: Vector = anchor, pull: float = pull
            ) -> Vector:
                rows = [p.residual / s for p, s in zip(self.parts(x, share, False), scales, strict=True)]
                return np.concatenate([*rows, pull * (x - anchor)])

            def jacobian(x: Vector, share: float = share, pull: float = pull) -> Matrix:
                rows = [p.jacobian / s for p, s in zip(self.parts(x, share), scales, strict=True)]
                return np.vstack([*rows, pull * np.eye(x.size)])

            found = least_squares(
                residual, x, jac=jacobian, bounds=(lower, upper), max_nfev=60 if last else 25, xtol=1e-10
            )
            x = found.x
        return x, float(2.0 * found.cost)

    # ---- weights -----------------------------------------------------------------------------------------

    def weights(self, x: Vector) -> list[Weights]:
        """The shape of each log's covariance at x, about the torque error that its model has."""
        made = []
        for i, model in enumerate(self.models):
            rows = self.counts[i]
            response = model.torque_responses(self.space.values(x, i))
            model.shift = None if model.error is None else response @ model.error
            response = response[rows]
            root = self.roots[i]
            seen = response / root[:, None]
            eigenvalues, vectors = np.linalg.eigh(seen @ seen.T)
            eigenvalues = np.maximum(eigenvalues, 0.0)
            made.append(Weights(vectors.T / root, eigenvalues, response, root, model.error, model.shift))
        return made

    def about(self, weights: Sequence[Weights]) -> None:
        """Give each model the torque error about which its weights hold."""
        for model, one in zip(self.models, weights, strict=True):
            model.error, model.shift = one.error, one.shift

    @staticmethod
    def _measured(log: Log, logged: Vector) -> tuple[Vector, Vector]:
        """The values of a log that count, NaN for all others, and their variance by encoder or rounding."""
        rows = np.isfinite(logged)
        values, variance = np.full(logged.size, math.nan), np.full(logged.size, math.inf)
        if log.kind != "angle" or log.count == 0.0:
            values[rows], variance[rows] = logged[rows], max(log.floor, 1e-3 * log.scale) ** 2
            return values, variance
        values[rows], variance[rows] = edges(log.time[rows], logged[rows], log.count)
        values[~np.isfinite(variance)] = math.nan
        return values, variance

    def foreseen(self, x: Vector, ripple: float) -> Matrix:
        """Derivatives of all logs, whitened for a ripple that is known: what logs not yet made will tell."""
        found = []
        for i, model in enumerate(self.models):
            values = self.space.values(x, i)
            logged = model.signals([values])[0]
            if model.log.count:  # as it will be logged
                logged = np.round(logged / model.log.count) * model.log.count
            self.values[i], variance = self._measured(model.log, logged)
            rows = self.counts[i] = np.isfinite(self.values[i])
            response = model.torque_responses(values)[rows]
            size = np.sqrt(variance[rows])[:, None]
            factor = root_of_covariance(1.0, ripple * response / size)
            found.append(solve_triangular(factor, self.part(x, i).jacobian / size, lower=True))
        return np.vstack(found)

    def deviations(self, parts: Sequence[Part], before: Errors) -> tuple[Errors, Vector]:
        """Noise and ripple by restricted maximum likelihood, from where they stood, and how sure they are."""
        weights, noise, ripple = before
        turned = [
            (w.rotation @ p.residual, w.rotation @ p.jacobian, w.eigenvalues)
            for p, w in zip(parts, weights, strict=True)
        ]
        least = 1.0  # what the encoder rounds is a floor below the noise
        usual = math.log(RIPPLE * self.largest_torque)

        def gathered(logs: Vector) -> tuple[Matrix, Vector, float]:
            s, u = np.exp(np.clip(logs, -60.0, 60.0))
            information, pulled, rest = np.zeros((1, 1)), np.zeros(1), 0.0
            for r, jacobian, eigenvalues in turned:
                variance = least + s * s + u * u * eigenvalues
                weighted = jacobian / variance[:, None]
                information = information + jacobian.T @ weighted
                pulled = pulled + weighted.T @ r
                rest += float(np.log(variance).sum()) + float(r @ (r / variance))
            return information, pulled, rest

        def loss(logs: Vector) -> float:
            information, pulled, rest = gathered(logs)
            values, vectors = np.linalg.eigh(information)
            kept = values > 1e-12 * values[-1]
            along = (vectors.T @ pulled)[kept]
            before = ((float(logs[1]) - usual) / math.log(RIPPLE_FACTOR)) ** 2
            return rest + before + float(np.log(values[kept]).sum() - np.sum(along**2 / values[kept]))

        starts = [np.log([one * noise, two * ripple]) for one, two in ((1.0, 1.0), (1.0, 10.0), (0.1, 1.0))]
        rough, fine = {"xatol": 0.1, "fatol": 0.03}, {"xatol": 1e-3, "fatol": 1e-4}
        tried = [minimize(loss, one, method="Nelder-Mead", options=rough) for one in starts]
        best: Vector = min(tried, key=lambda one: float(one.fun)).x
        best = minimize(loss, best, method="Nelder-Mead", options=fine).x
        s, u = np.exp(best)

        def log_variances(logs: Vector) -> Vector:
            found: Vector = np.log(
                np.maximum(np.diag(np.linalg.pinv(gathered(logs)[0], rcond=1e-14)), 1e-300)
            )
            return found

        # Satterthwaite: a variance that rests on uncertain deviations has as many degrees of freedom as make
        # its own spread right
        which = [1] if s * s < 0.01 * least else [0, 1]
        steps = 0.1 * np.eye(2)[which]
        middle = loss(best)
        bends = np.array([(loss(best + h) + loss(best - h) - 2.0 * middle) / 0.01 for h in steps])
        slopes = np.array([(log_variances(best + h) - log_variances(best - h)) / 0.2 for h in steps])
        spread = (slopes**2 * (2.0 / np.maximum(bends, 1e-6))[:, None]).sum(axis=0)
        freedom: Vector = np.maximum(2.0 / np.maximum(spread, 1e-6), 2.0)
        return Errors(weights, math.sqrt(least + float(s) ** 2), float(u)), freedom

    # ---- the weighted fit --------------------------------------------------------------------------------

    def whitened(self, x: Vector, errors: Errors, derivatives: bool = True) -> Part:
        """Residual and derivatives of all logs, independent and of unit size."""
        residuals, jacobians = [], []
        self.about(errors.weights)
        parts = self.parts(x, derivatives=derivatives)
        for part, weights in zip(parts, errors.weights, strict=True):
            size = np.sqrt(errors.noise**2 + errors.ripple**2 * weights.eigenvalues)
            residuals.append((weights.rotation @ part.residual) / size)
            jacobians.append((weights.rotation @ part.jacobian) / size[:, None])
        return Part(np.concatenate(residuals), np.vstack(jacobians))

    def refine(self, x: Vector, lower: Vector, upper: Vector) -> Solution:
        """The most likely x near this one: weights and fit in turns, then L itself and the deviations.

        With weights that do not move, a fit finds only where r' V^-1 r is least, at which its errors may be
        large; but it comes from afar.
        """
        x, errors, freedom = self._weighted(x, lower, upper, ROUNDS)
        return self._settled(x, errors, freedom, lower, upper)

    def _weighted(
        self, x: Vector, lower: Vector, upper: Vector, rounds: int
    ) -> tuple[Vector, Errors, Vector]:
        """Weights, fit and torque error in turns until none moves.

        The torque error that explains most of what is left (the best linear unbiased prediction) is added to
        the torque of the model, and its linear response taken off again: so the derivatives are those along
        the motion that was logged, with its own contacts, and not along that of the ideal torque.
        """
        noise, ripple = 1.0, RIPPLE * self.largest_torque
        for model in self.models:
            model.error = model.shift = None
        for number in range(rounds):
            weights = self.weights(x)  # before the parts, which it shifts
            errors, freedom = self.deviations(self.parts(x), Errors(weights, noise, ripple))
            noise, ripple = errors.noise, errors.ripple
            new = self.fit(x, errors, lower, upper)
            moved, x = float(np.max(np.abs(new - x))), new
            self.progress("weights and fit")
            if moved < SETTLED or number == rounds - 1:
                break
            self.predict(x, errors)
        return x, errors, freedom

    def _settled(self, x: Vector, errors: Errors, freedom: Vector, lower: Vector, upper: Vector) -> Solution:
        """The most likely x near this one, and the deviations there, in turns."""
        for _ in range(ROUNDS):
            new, _ = self.descended(x, errors, lower, upper)
            moved, x = float(np.max(np.abs(new - x))), new
            before, weights = errors, self.weights(x)
            errors, freedom = self.deviations(self.parts(x), errors._replace(weights=weights))
            self.progress("weights and fit")
            if moved < SETTLED or abs(math.log(errors.ripple / before.ripple)) < SETTLED:
                break
        return Solution(x, errors, freedom, self.whitened(x, errors), lower, upper, self.slope(x, errors))

    def likely(self, x: Vector, log: int, errors: Errors) -> Likely:
        """A log about the torque error that is most likely at x, which its model has from then on."""
        model, values = self.models[log], self.space.values(x, log)
        size = errors.weights[log].root
        for turn in range(TURNS):
            response = model.torque_responses(values)
            model.shift = None if model.error is None else response @ model.error
            residual = self.part(x, log, derivatives=False).residual / size
            seen = errors.ripple * response[self.counts[log]] / size[:, None]
            root = root_of_covariance(errors.noise, seen)
            white = solve_triangular(root, residual, lower=True, check_finite=False)
            value = 2.0 * float(np.log(np.diag(root)).sum()) + float(white @ white)
            pulled = solve_triangular(root, white, lower=True, trans=1, check_finite=False)
            shares = -(seen.T @ pulled)
            before = np.zeros(1) if model.error is None else model.error / errors.ripple
            if turn == TURNS - 1 or float(np.linalg.norm(shares - before)) < ERROR_SETTLED:
                break
            model.error = errors.ripple * shares
        return Likely(value, root, seen, white)

    def likelihood(self, x: Vector, errors: Errors) -> float:
        """L at x, with what was known beforehand of the torque error; infinite where there is no motion."""
        try:
            total = sum(self.likely(x, i, errors).value for i in range(len(self.models)))
        except SimulationError:
            return math.inf
        return total + self._beforehand(errors.ripple)

    def _beforehand(self, ripple: float) -> float:
        return (math.log(ripple / (RIPPLE * self.largest_torque)) / math.log(RIPPLE_FACTOR)) ** 2

    def slope(self, x: Vector, errors: Errors) -> Slope:
        """L at x and its derivatives; the curvature is that of r' V^-1 r.

        The torque error that is most likely follows x; by how much, the response says.
        """
        value, gradient = self._beforehand(errors.ripple), np.zeros(x.size)
        curvature, each = np.zeros((x.size, x.size)), []
        for log, one in enumerate(errors.weights):
            likely = self.likely(x, log, errors)
            jacobian = self.part(x, log).jacobian / one.root[:, None]
            jacobian = solve_triangular(likely.root, jacobian, lower=True, check_finite=False)
            value += likely.value
            gradient += jacobian.T @ likely.residual
            curvature += jacobian.T @ jacobian
            each.append((likely, jacobian))
        if errors.ripple > MOST_RIPPLE * self.largest_torque:
            return Slope(value, gradient, curvature)
        deviations = np.sqrt(np.diag(np.linalg.inv(curvature + np.diag(self.space.weak))))
        for log, (likely, jacobian) in enumerate(each):
            model, size, ripple = self.models[log], errors.weights[log].root, errors.ripple
            before, shift = model.error, model.shift
            known = np.zeros(likely.seen.shape[1]) if before is None else before
            inverse = cho_solve((likely.root, True), likely.seen, check_finite=False)
            pulls = solve_triangular(likely.root, jacobian, lower=True, trans=1, check_finite=False)
            position, _ = self.space.place(log)
            moved = [*range(len(self.space.shared)), *([] if position is None else [position])]
            moves = np.minimum(APART, 0.5 * deviations[moved])
            moves[[i == position and x[i] > 0.5 for i in moved]] *= -1.0
            points = [
                self.space.values(x + move * np.eye(x.size)[i], log)
                for i, move in zip(moved, moves, strict=True)
            ]
            plants = model.plants(points)
            for i, move, point, plant in zip(moved, moves, points, plants, strict=True):
                model.error = known - move * ripple * (likely.seen.T @ pulls[:, i])
                response = model.torque_responses(point, plant)[self.counts[log]]
                more = ripple * response / size[:, None] - likely.seen
                gradient[i] += float(np.sum(inverse * more)) / move
            model.error, model.shift = before, shift
        return Slope(value, gradient, curvature)

    def descended(self, x: Vector, errors: Errors, lower: Vector, upper: Vector) -> tuple[Vector, Slope]:
        """Where L is least, from x, with these deviations; and L there."""
        self.about(errors.weights)
        x = np.clip(x, lower, upper)
        slope = self.slope(x, errors)
        for _ in range(MOST_STEPS):
            step = self.outward(x, slope, lower, upper)
            gain = -float(2.0 * slope.gradient @ step + step @ slope.curvature @ step)
            if gain < STEEP:
                break
            length = min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-300))
            for cut in 0.5 ** np.arange(HALVINGS):
                point = np.clip(x + cut * length * step, lower, upper)
                if self.likelihood(point, errors) < slope.value - 0.1 * cut * length * gain:
                    break
            else:
                break
            x, last = point, slope.value
            slope = self.slope(x, errors)
            if last - slope.value < STEEP:
                break
        return x, slope

    def predict(self, x: Vector, errors: Errors) -> None:
        """Take the most likely torque error of each log into its model."""
        for model, part, one in zip(
            self.models, self.parts(x, derivatives=False), errors.weights, strict=True
        ):
            size = errors.noise**2 + errors.ripple**2 * one.eigenvalues
            pulled = one.rotation.T @ ((one.rotation @ part.residual) / size)
            model.error = -(errors.ripple**2) * (one.response.T @ pulled)

    def fit(self, x: Vector, errors: Errors, lower: Vector, upper: Vector, most: int = 30) -> Vector:
        """The weighted least squares from x, in at most so many steps."""
        found = least_squares(
            lambda point: self.whitened(point, errors, False).residual,
            np.clip(x, lower + 1e-12, upper - 1e-12),
            jac=lambda point: self.whitened(point, errors).jacobian,
            bounds=(lower, upper),
            x_scale="jac",
            max_nfev=most,
            xtol=1e-9,
            ftol=STEEP / sum(rows.size for rows in self.roots),
        )
        return np.asarray(found.x, dtype=np.float64)

    def elsewhere(self, solution: Solution, unknown: Sequence[int]) -> tuple[Solution, list[Other]]:
        """Where else the logs are explained nearly as well; and the solution, if that is better there.

        A start that begins at the flank and one that crosses the gap first are two valleys: no step along
        one of them finds the other. Where logs leave anything unknown, positions begin in mid-gap with the
        load torque at values over its range, and at the flank; all else is fitted, then the load torque
        too. Each other shared number of `unknown` takes values over its range, and all else is fitted.
        """
        space, first = self.space, len(self.space.shared)
        last = first + sum(space.positions)
        load = space.shared.index("load_torque") if "load_torque" in space.shared else None
        found: list[tuple[Vector, int | None]] = []
        valleys = [solution]
        for i in unknown if last > first else ():
            if i >= first or i == load:
                continue
            least, most = (abs(space.value(i, float(x[i]))) for x in (solution.lower, solution.upper))
            for value in np.geomspace(max(least, 1e-3 * most), most, SCANNED).tolist():
                x, lower, upper = self._fixed(solution, i, value)
                self.about(solution.errors.weights)
                try:
                    found.append((self.fit(x, solution.errors, lower, upper, SCAN_STEPS), i))
                except (InputError, SimulationError):
                    continue
        if unknown and last > first and load is not None:
            most = abs(space.value(load, float(solution.upper[load])))
            starts = [self._fixed(solution, load, share * most) for share in LOADS]
            flank = solution.x.copy()
            flank[first:last] = root_of(1.0)
            for start, lower, upper in (*starts, (flank, solution.lower, solution.upper)):
                try:
                    x, errors, freedom = self._weighted(start, lower, upper, FIRST_ROUNDS)
                    found.append((x, load if lower[load] > solution.lower[load] else None))
                    self.about(solution.errors.weights)
                    if self.likelihood(x, solution.errors) > solution.slope.value + HOPELESS:
                        continue
                    valleys.append(self._settled(x, errors, freedom, solution.lower, solution.upper))
                except (InputError, SimulationError):
                    continue
        best = min(valleys, key=lambda one: one.slope.value)
        found.extend((one.x, None) for one in valleys if one is not best)
        others = []
        for x, fixed in found:
            self.about(best.errors.weights)
            try:
                slope = self.slope(x, best.errors)
            except (InputError, SimulationError):
                continue
            curvature = slope.curvature + np.diag(space.weak)
            if fixed is not None:
                curvature[fixed, fixed] += 1e12
            covariance = np.asarray(np.linalg.inv(curvature), dtype=np.float64)
            others.append((x, covariance, slope.value))
        return best, others

    def _fixed(self, solution: Solution, i: int, value: float) -> tuple[Vector, Vector, Vector]:
        """A shared number at this value, with positions in mid-gap: x and the bounds of all else."""
        x, lower, upper = solution.x.copy(), solution.lower.copy(), solution.upper.copy()
        x[i] = self.space.number(i, math.copysign(value, self.space.units[i]))
        first = len(self.space.shared)
        x[first : first + sum(self.space.positions)] = root_of(0.0)
        lower[i], upper[i] = x[i] - 1e-9, x[i] + 1e-9
        return x, lower, upper

    def end(
        self, solution: Solution, i: int, sign: float, half: float, others: Sequence[Other] = ()
    ) -> float:
        """The end of the interval of x_i above (sign 1) or below; `half` is half the quadratic one.

        The largest x_i where L is larger by at most the square of Student's quantile. All other numbers move
        along, until dL/dx = lambda e_i. Each step solves this for a quadratic L, so it follows a bent
        valley, along which a fit at fixed x_i creeps (D. J. Venzon, S. H. Moolgavkar, Appl. Statist. 37
        (1988) 87-94). The first step ends where a quadratic has its interval; where L is right there, that
        is the end. So is a bound that L does not exclude. The steps begin at that of the `others` from which
        they get furthest, see `elsewhere`.

        A fit that went far along a valley has explained errors as motion: the deviations are found again from
        what is left at the end, and hold for both places. No end lies nearer than the quadratic.
        """
        bound = float((solution.upper if sign > 0.0 else solution.lower)[i])
        middle, errors, least = float(solution.x[i]), solution.errors, solution.slope.value
        quantile = quantile_of(solution.freedom[i])
        begin, far = solution.x, middle + sign * half
        for point, covariance, value in others:
            left = least + quantile**2 - value
            reach = float(point[i]) + sign * math.sqrt(max(left, 0.0) * float(covariance[i, i]))
            if left > 0.0 and sign * (reach - far) > 0.0:
                begin, far = point, reach
        self.about(errors.weights)
        end, x, straight = self._traced(solution, i, sign, begin, errors, least, quantile)
        for _ in range(0 if straight else ROUNDS_OF_ENDS):
            last = end
            errors, freedom = self.deviations(self.parts(x), errors._replace(weights=self.weights(x)))
            self.about(solution.errors.weights)
            slope = self.slope(solution.x, errors)
            step = self.outward(solution.x, slope, solution.lower, solution.upper)
            least = slope.value + min(float(2.0 * slope.gradient @ step + step @ slope.curvature @ step), 0.0)
            quantile = quantile_of(freedom[i])
            self.about(errors.weights)
            end, x, _ = self._traced(solution, i, sign, x, errors, least, quantile)
            if abs(end - last) < CLOSE * abs(end - middle):
                break
        return sign * min(sign * bound, max(sign * end, sign * middle + half))

    def _traced(
        self,
        solution: Solution,
        i: int,
        sign: float,
        x: Vector,
        errors: Errors,
        least: float,
        quantile: float,
    ) -> tuple[float, Vector, bool]:
        """The end for these deviations, from x; where that is in x; whether one step sufficed."""
        same = x is solution.x and errors is solution.errors
        slope = solution.slope if same else self.slope(x, errors)
        middle, bound = float(solution.x[i]), float((solution.upper if sign > 0.0 else solution.lower)[i])
        best, straight = middle, False

        def ratio_of(value: float) -> float:
            return math.sqrt(max(value - least, 0.0)) / quantile

        over = max(ratio_of(slope.value) - 1.0, 0.0)
        best = sign * max(sign * best, sign * (middle + float(x[i] - middle) / (1.0 + over)))
        for number in range(MOST_STEPS):
            step = self.outward(x, slope, solution.lower, solution.upper, i, sign, least + quantile**2)
            length = min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-300))
            for cut in 0.5 ** np.arange(HALVINGS):
                point = np.clip(x + cut * length * step, solution.lower, solution.upper)
                ratio = ratio_of(self.likelihood(point, errors))
                if ratio <= 1.0 + max(0.1, 0.5 * over) and (
                    ratio < 1.0 + over or sign * float(point[i] - x[i]) > 0.0
                ):
                    break
            else:
                break
            moved, x, over = abs(float(point[i] - x[i])), point, max(ratio - 1.0, 0.0)
            best = sign * max(sign * best, sign * (middle + float(x[i] - middle) / max(ratio, 1.0)))
            straight = number == 0 and cut * length == 1.0 and abs(ratio - 1.0) < CLOSE
            if over < CLOSE and (straight or x[i] == bound or moved < 0.5 * CLOSE * abs(best - middle)):
                break
            slope = self.slope(x, errors)
        return best, x, straight

    def outward(
        self,
        x: Vector,
        slope: Slope,
        lower: Vector,
        upper: Vector,
        i: int = 0,
        sign: float = 0.0,
        most: float = 0.0,
    ) -> Vector:
        """The step to the least L, were it quadratic, or to the end of x_i; numbers at bounds stay there."""
        step, free = np.zeros(x.size), np.ones(x.size, dtype=bool)
        curvature = slope.curvature + np.diag(self.space.weak)
        for _ in range(x.size + 1):
            fixed = step[~free]
            pull = slope.gradient[free] + curvature[np.ix_(free, ~free)] @ fixed
            spread = np.linalg.inv(curvature[np.ix_(free, free)])
            step[free] = -spread @ pull
            if sign != 0.0 and free[i]:
                along = spread[:, int(free[:i].sum())]
                value = slope.value + float(2.0 * slope.gradient[~free] @ fixed)
                value += float(fixed @ curvature[np.ix_(~free, ~free)] @ fixed)
                left = most - (value - float(pull @ spread @ pull))
                step[free] += sign * math.sqrt(max(left, 0.0) / float(along[int(free[:i].sum())])) * along
            outside = free & ((x + step < lower) | (x + step > upper))
            if not outside.any():
                break
            step[outside] = (np.clip(x + step, lower, upper) - x)[outside]
            free &= ~outside
        return step


def quantile_of(freedom: float) -> float:
    """Student's quantile of an interval, for a variance with these degrees of freedom.

    >>> round(quantile_of(1e9), 4)
    1.96
    """
    return float(student.ppf(0.5 + 0.5 * CONFIDENCE, freedom))


def covariance_of(jacobian: Matrix, space: Space) -> Matrix:
    """Covariance of x; what the logs do not tell is as uncertain as it was beforehand, see `Space.weak`."""
    found = np.linalg.inv(jacobian.T @ jacobian + np.diag(space.weak))
    return np.asarray(found, dtype=np.float64)
