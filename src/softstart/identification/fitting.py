"""The fit: a search that needs no good guess, the most likely parameters, and intervals by refitting.

The log is y = f(x, e) + n: f the exact plant under the torque of the log and an error e of it, independent
with the standard deviation `ripple` in each sample; n is what the encoder rounds, with the deviations `root`
(`model.edges`), times `noise`. About the e that is most likely at x, y has the covariance

    V = noise^2 + ripple^2 G G'         G = df/de, both in units of `root`

so that least squares without G would be far too sure of itself: a torque error is integrated twice and stays
in all later samples. The eigenvectors of G G' make V diagonal for every noise and ripple. Then

    L(x) = ln|V| + r' V^-1 r -> min,    r = f(x, e) - G e - y          gives x
    L + ln|J' V^-1 J| -> min,           J = dr/dx                      gives noise and ripple

the second being restricted maximum likelihood (D. A. Harville, J. Amer. Statist. Assoc. 72 (1977) 320-338).
An end of an interval of x_i is where the second, with all other numbers and noise and ripple fitted again,
is larger by 1.96^2 (profile likelihood): its error of the torque, which is not known, is in the interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import brentq, least_squares, lsq_linear, minimize
from scipy.stats import qmc
from scipy.stats import t as student

from softstart.arrays import Matrix, Vector
from softstart.errors import InputError, SimulationError
from softstart.identification.model import LogModel
from softstart.identification.unknowns import Unknown, model_parameters
from softstart.start.comparison import INTERVAL

HORIZONS: Final = (0.07, 0.13, 0.27, 0.5, 1.0)  # of each log, in which the search follows it step by step
AGREED: Final = 2  # searches that end at the best minimum before it is believed
STEP: Final = 1e-6  # of x, for derivatives of the motion
COVARIANCE_STEP: Final = (
    0.02  # of x, or half a standard error if that is less: for derivatives of covariances
)
MOST_UPDATES: Final = 3  # of the most likely torque error at one x; fewer if it moves by less than
ERROR_SETTLED: Final = 0.1  # standard deviations, all samples together
# beforehand a torque error of 2.5 % of the largest torque, within a factor of 3: a log that cannot tell how
# large it is (coarse encoder, few samples) must not conclude that there is none
RIPPLE, RIPPLE_FACTOR = 0.025, 3.0
MOST_RIPPLE: Final = 0.25  # of the largest torque: more is no small error, of which G tells
LOADS: Final = (0.08, 0.25, 0.45, 0.7)  # of the largest load torque: from there other explanations are sought
NEAR: Final = 0.04  # relative error of the root of a difference of L at an end of an interval
FARTHER: Final = 1.6  # times as far, where an end is not reached
MOST_STEPS, HALVINGS = 30, 7  # towards the most likely x, each step cut if need be
LONGEST_STEP: Final = 0.7  # of a number of x
STEEP, ROUGHLY = 1e-3, 0.02  # what L must still gain for another step; where all else is refitted
SAME: Final = 0.3  # standard errors between two explanations that are one
LARGEST_EXCESS: Final = 100.0  # above the least L: no place there is as likely


class ErrorScales(NamedTuple):
    """How large the errors are: of the measurement in units of its rounding, of the torque in N m."""

    noise: float
    ripple: float


class LogLinearization(NamedTuple):
    """A log about an x and a torque error, in units of its rounding, turned so that V is diagonal."""

    error: Vector  # the torque error e, one number for each block of samples
    residual: Vector  # f(x, e) - G e - y
    rotation: Matrix
    eigenvalues: Vector  # of G G'
    response: Matrix  # G, not turned
    jacobian: Matrix = np.zeros((0, 0))

    def variance(self, sizes: ErrorScales) -> Vector:
        """The diagonal of V."""
        return sizes.noise**2 + sizes.ripple**2 * self.eigenvalues

    def innovations(self, sizes: ErrorScales) -> Vector:
        """What is left in each sample that the samples before it did not tell, of unit size."""
        # V = upper' upper, without the product that rounding would break, and with a positive diagonal
        upper = np.linalg.qr(np.sqrt(self.variance(sizes))[:, None] * self.rotation, mode="r")
        upper *= np.sign(np.diag(upper))[:, None]
        return np.asarray(solve_triangular(upper, self.rotation.T @ self.residual, trans=1))

    def likely_error(self, residual: Vector, sizes: ErrorScales) -> Vector:
        """The most likely torque error for a turned residual: the best linear unbiased prediction."""
        pulled = self.rotation.T @ (residual / self.variance(sizes))
        return np.asarray(-(sizes.ripple**2) * (self.response.T @ pulled))


class FitPoint(NamedTuple):
    """An x, the sizes of the errors that are most likely there, and each log about it."""

    x: Vector
    sizes: ErrorScales
    spots: tuple[LogLinearization, ...]
    drift: Vector = np.zeros(0)  # d ln|V|/dx, halved
    value: float = math.nan  # of the restricted likelihood, see `Fitter.with_likelihood`

    @property
    def errors(self) -> list[Vector]:
        """The torque error of each log."""
        return [spot.error for spot in self.spots]

    @property
    def likelihood(self) -> float:
        """L."""
        variances = [(spot.residual, spot.variance(self.sizes)) for spot in self.spots]
        return sum(float(np.log(v).sum() + r @ (r / v)) for r, v in variances)

    @property
    def white(self) -> tuple[Vector, Matrix]:
        """Residual and derivatives of all logs, independent and of unit size."""
        roots = [np.sqrt(spot.variance(self.sizes)) for spot in self.spots]
        residuals = [spot.residual / root for spot, root in zip(self.spots, roots, strict=True)]
        jacobians = [spot.jacobian / root[:, None] for spot, root in zip(self.spots, roots, strict=True)]
        return np.concatenate(residuals), np.vstack(jacobians)


@dataclass(frozen=True, eq=False)
class Fitter:
    """Models of logs, and the unknowns; each method is a function of what it is given."""

    models: Sequence[LogModel]
    unknowns: Sequence[Unknown]
    progress: Callable[[str], None] = lambda _: None

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        """The least and the largest x."""
        return np.array([p.lower for p in self.unknowns]), np.array([p.upper for p in self.unknowns])

    @property
    def weights(self) -> Matrix:
        """What is known beforehand, as the curvature of L/2."""
        return np.diag([p.weight for p in self.unknowns])

    @property
    def largest_torque(self) -> float:
        """The largest torque of the logs, N m."""
        return max(float(np.max(np.abs(model.log.torque))) for model in self.models)

    # ---- one log at one x --------------------------------------------------------------------------------

    def residuals(self, points: Sequence[Vector], log: int, error: Vector | None = None) -> Matrix:
        """Model minus log in the samples that count, in units of their rounding, a row for each x."""
        model = self.models[log]
        signals = model.signals([model_parameters(self.unknowns, x, log) for x in points], error)
        offsets = np.array([sum(x[i] for i in self._offset(log)) for x in points])
        return np.asarray((signals[:, model.rows] + offsets[:, None] - model.values) / model.root)

    def jacobian(self, x: Vector, log: int, error: Vector | None = None) -> Matrix:
        """The derivatives of the residual, by differences."""
        moved = self._moved(log)
        steps = [-STEP if self.unknowns[i].kind == "position" and x[i] > 0.5 else STEP for i in moved]
        unit = np.eye(x.size)
        points = [x, *(x + step * unit[i] for i, step in zip(moved, steps, strict=True))]
        residuals = self.residuals(points, log, error)
        jacobian = np.zeros((residuals.shape[1], x.size))
        jacobian[:, moved] = ((residuals[1:] - residuals[0]) / np.array(steps)[:, None]).T
        for i in self._offset(log):
            jacobian[:, i] = 1.0 / self.models[log].root
        return jacobian

    def _moved(self, log: int) -> list[int]:
        """Which numbers the motion of a log depends on."""
        return [i for i, p in enumerate(self.unknowns) if p.kind != "offset" and p.log in (None, log)]

    def _offset(self, log: int) -> list[int]:
        return [i for i, p in enumerate(self.unknowns) if p.kind == "offset" and p.log == log]

    def response(self, x: Vector, log: int, error: Vector | None = None) -> Matrix:
        """G: how the samples that count answer to a torque error, in units of their rounding."""
        model = self.models[log]
        responses = model.responses(model_parameters(self.unknowns, x, log), error)
        return np.asarray(responses[model.rows] / model.root[:, None])

    def linearize_log(self, x: Vector, log: int, error: Vector) -> LogLinearization:
        """A log about x and this torque error, without derivatives."""
        response = self.response(x, log, error)
        eigenvalues, vectors = np.linalg.eigh(response @ response.T)
        residual = vectors.T @ (self.residuals([x], log, error)[0] - response @ error)
        return LogLinearization(error, residual, vectors.T, np.maximum(eigenvalues, 0.0), response)

    def unscaled_residuals(self, point: FitPoint) -> list[Vector]:
        """Model minus log in each sample of each log, in its unit."""
        residuals = []
        for log, (model, error) in enumerate(zip(self.models, point.errors, strict=True)):
            values = model_parameters(self.unknowns, point.x, log)
            residual = model.signals([values], error)[0] - model.responses(values, error) @ error
            residual += sum(point.x[i] for i in self._offset(log)) - model.log.values
            residuals.append(residual[np.isfinite(residual)])
        return residuals

    # ---- the search --------------------------------------------------------------------------------------

    def search(self, most: int) -> list[tuple[Vector, float]]:
        """Minima of the plain squares, best first: from the guess, then from points all over the range.

        Each search follows the logs from their beginning, over longer and longer parts: what comes early is
        explained before errors can pile up, which is what makes the basin wide.
        """
        guess = np.array([one.guess for one in self.unknowns])
        free = [i for i, one in enumerate(self.unknowns) if one.kind != "offset"]
        draws = qmc.Sobol(len(free), seed=0).random_base2(max(1, (most - 1).bit_length()))
        minima: list[tuple[Vector, float]] = []
        for number in range(most):
            start = guess.copy()
            if number:
                ends = zip(free, draws[number - 1], strict=True)
                start[free] = [self.unknowns[i].search_start(draw) for i, draw in ends]
            self.progress(f"search {number + 1}")
            try:
                minima.append(self._followed(np.clip(start, *self.bounds)))
            except (InputError, SimulationError):
                continue
            minima.sort(key=lambda one: one[1])
            if agreeing_searches(minima) >= AGREED:
                break
        if not minima:
            raise InputError("The logs cannot be computed with any of the values tried; check their units.")
        return minima

    def _followed(self, x: Vector) -> tuple[Vector, float]:
        cost, logs = math.inf, range(len(self.models))
        for share in HORIZONS:
            last = share == HORIZONS[-1]
            pull = np.zeros((0, x.size)) if last else np.eye(x.size)
            part = replace(self, models=[model.first(share) for model in self.models])
            fit = least_squares(
                lambda at, x=x, pull=pull, part=part: np.concatenate(
                    [*(part.residuals([at], i)[0] for i in logs), pull @ (at - x)]
                ),
                x,
                jac=lambda at, pull=pull, part=part: np.vstack([*(part.jacobian(at, i) for i in logs), pull]),
                bounds=self.bounds, max_nfev=60 if last else 25, xtol=1e-10,
            )  # fmt: skip
            x, cost = fit.x, float(2.0 * fit.cost)
        return x, cost

    # ---- the most likely x -------------------------------------------------------------------------------

    def most_likely(self, x: Vector, held: int | None = None) -> FitPoint:
        """The most likely x near this one. `held`: the number that stays."""
        errors = [np.zeros(model.blocks) for model in self.models]
        point = self.linearized(x, errors, ErrorScales(1.0, RIPPLE * self.largest_torque))
        return self.minimized(point, held)

    def linearized(self, x: Vector, errors: Sequence[Vector], sizes: ErrorScales) -> FitPoint:
        """The covariance at x about the torque errors that are most likely there, sought from `errors`."""
        spots = []
        for log, error in enumerate(errors):
            spot = self.linearize_log(x, log, error)
            for _ in range(MOST_UPDATES):
                new = spot.likely_error(spot.residual, sizes)
                if np.linalg.norm(new - spot.error) < ERROR_SETTLED * sizes.ripple:
                    break
                spot = self.linearize_log(x, log, new)
            spots.append(spot)
        return FitPoint(x, sizes, tuple(spots))

    def minimized(self, point: FitPoint, held: int | None = None, best: FitPoint | None = None) -> FitPoint:
        """Where L is least, from a settled point; with sizes and drift of the best point, or its own.

        Bounded linear least squares for each step, cut until L is less: the drift of ln|V| is a force on x,
        which is added to the residual along J, so that the steps end where J' V^-1 r + drift = 0.
        """
        point = self.with_derivatives(point, best)
        for _ in range(MOST_STEPS):
            step, gain = self.step(point, held)
            if gain < (STEEP if best is None else ROUGHLY):
                break
            length = min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-300))
            for cut in (length * 0.5 ** np.arange(HALVINGS)).tolist():
                new = self.linearized(np.clip(point.x + cut * step, *self.bounds), point.errors, point.sizes)
                if new.likelihood < point.likelihood - 0.1 * cut * gain:
                    break
            else:
                break
            point = self.with_derivatives(new, best)
        return point

    def with_derivatives(self, point: FitPoint, best: FitPoint | None = None) -> FitPoint:
        """The point with the derivatives of its spots, and with sizes and drift unless those of the best."""
        spots = tuple(
            spot._replace(jacobian=spot.rotation @ self.jacobian(point.x, i, spot.error))
            for i, spot in enumerate(point.spots)
        )
        if best is not None:
            return point._replace(spots=spots, drift=best.drift)
        point = FitPoint(point.x, self.estimated_scales(spots, point.sizes), spots, np.zeros(point.x.size))
        small = point.sizes.ripple <= MOST_RIPPLE * self.largest_torque
        return point._replace(drift=self.drift(point)) if small else point

    def step(self, point: FitPoint, held: int | None = None) -> tuple[Vector, float]:
        """The step to the least L, were it quadratic, and what is gained by it."""
        residual, jacobian = point.white
        damped = np.vstack([jacobian, np.sqrt(self.weights)])
        force = jacobian @ np.linalg.solve(damped.T @ damped, point.drift)
        free = np.array([i for i in range(point.x.size) if i != held])
        lower, upper = self.bounds
        room = (lower - point.x - 1e-12)[free], (upper - point.x + 1e-12)[free]
        wanted = np.concatenate([-residual - force, np.zeros(point.x.size)])
        step = np.zeros(point.x.size)
        step[free] = lsq_linear(damped[:, free], wanted, bounds=room, method="bvls").x
        gradient = jacobian.T @ residual + point.drift
        return step, -float(2.0 * gradient @ step + np.sum((damped @ step) ** 2))

    def drift(self, point: FitPoint) -> Vector:
        """D ln|V|/dx, halved; the most likely torque error follows x, by how much, the response says."""
        drift, ripple = np.zeros(point.x.size), point.sizes.ripple
        deviations = np.sqrt(np.diag(self.covariance(point)))
        for log, spot in enumerate(point.spots):
            turned = spot.rotation @ spot.response / spot.variance(point.sizes)[:, None]
            inverse = spot.rotation.T @ turned
            for i in self._moved(log):
                at, move = point.x.copy(), min(COVARIANCE_STEP, 0.5 * float(deviations[i]))
                move = -move if self.unknowns[i].kind == "position" and at[i] > 0.5 else move
                at[i] += move
                error = spot.error + move * spot.likely_error(spot.jacobian[:, i], point.sizes)
                more = self.response(at, log, error) - spot.response
                drift[i] += ripple**2 * float(np.sum(inverse * more)) / move
        return drift

    def covariance(self, point: FitPoint) -> Matrix:
        """Of x; what the logs do not tell is as uncertain as it was beforehand."""
        jacobian = point.white[1]
        return np.asarray(np.linalg.inv(jacobian.T @ jacobian + self.weights))

    # ---- how large the errors are ------------------------------------------------------------------------

    def restricted(
        self,
        spots: Sequence[LogLinearization],
        sizes: ErrorScales,
        about: Sequence[LogLinearization] | None = None,
    ) -> float:
        """L + ln|J' V^-1 J|; J and V of the last term are those of `about`.

        Without `about` x need not be the most likely one: it follows along J.
        """
        value = (math.log(sizes.ripple / (RIPPLE * self.largest_torque)) / math.log(RIPPLE_FACTOR)) ** 2
        information, pull = np.zeros_like(self.weights), np.zeros(len(self.weights))
        for spot, other in zip(spots, about or spots, strict=True):
            variance = spot.variance(sizes)
            value += float(np.log(variance).sum() + spot.residual @ (spot.residual / variance))
            weighted = other.jacobian / other.variance(sizes)[:, None]
            information += other.jacobian.T @ weighted
            if about is None:
                pull += weighted.T @ spot.residual
        values, vectors = np.linalg.eigh(information)
        kept = values > 1e-12 * values[-1]
        along = (vectors.T @ pull)[kept]
        return value + float(np.log(values[kept]).sum() - np.sum(along**2 / values[kept]))

    def estimated_scales(
        self,
        spots: Sequence[LogLinearization],
        before: ErrorScales,
        about: Sequence[LogLinearization] | None = None,
    ) -> ErrorScales:
        """Noise and ripple where `restricted` is least, from where they stood; at least the rounding."""

        def sizes_at(logs: Vector) -> ErrorScales:
            excess, ripple = np.exp(np.clip(logs, -60.0, 60.0)).tolist()
            return ErrorScales(math.hypot(1.0, excess), ripple)

        begin = np.log([math.sqrt(max(before.noise**2 - 1.0, 0.01)), before.ripple])
        simplex = begin + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]])
        options = {"xatol": 3e-3, "fatol": 1e-3, "initial_simplex": simplex}
        minimum = minimize(
            lambda logs: self.restricted(spots, sizes_at(logs), about), begin,
            method="Nelder-Mead", options=options,
        )  # fmt: skip
        return sizes_at(minimum.x)

    # ---- intervals ---------------------------------------------------------------------------------------

    def with_likelihood(self, point: FitPoint, best: FitPoint) -> FitPoint:
        """A point with the sizes that are most likely there, and its value of `restricted`."""
        sizes = self.estimated_scales(point.spots, point.sizes, best.spots)
        return point._replace(sizes=sizes, value=self.restricted(point.spots, sizes, best.spots))

    def threshold(self, best: FitPoint) -> float:
        """By how much `restricted` is larger at the ends of an interval.

        nu ln(1 + t^2/nu), with Student's quantile t, for errors whose size is known with nu degrees of
        freedom: were f linear, the ends are those of Student's t. It is 1.96^2 if the size is known. Minus
        twice the log likelihood of the logarithm of a deviation with nu of them has the curvature 4 nu.
        """
        low, middle, high = (self.restricted(best.spots, one) for one in _ripples(best, [-0.1, 0.0, 0.1]))
        freedom = max((low - 2.0 * middle + high) / 0.04, 2.0)
        quantile = float(student.ppf(0.5 + 0.5 * INTERVAL.inside, freedom))
        return freedom * math.log1p(quantile**2 / freedom)

    def half_widths(self, best: FitPoint) -> Vector:
        """Half the interval of each number, were f linear: the farthest end over all sizes of the errors."""
        reach = np.zeros(best.x.size)
        most = self.threshold(best) + self.restricted(best.spots, best.sizes)
        for sizes in _ripples(best, np.linspace(-1.5, 1.5, 31).tolist()):
            left = most - self.restricted(best.spots, sizes)
            if left > 0.0:
                reach = np.maximum(reach, left * np.diag(self.covariance(best._replace(sizes=sizes))))
        return np.asarray(np.sqrt(reach))

    def refitted(self, i: int, number: float, near: FitPoint, best: FitPoint) -> FitPoint:
        """All else refitted with x_i at a number, from a point nearby."""
        along = self.covariance(near)[:, i]
        x = np.clip(near.x + along / along[i] * (number - near.x[i]), *self.bounds)
        x[i] = number
        point = self.linearized(x, near.errors, near.sizes)
        return self.with_likelihood(self.minimized(point, i, best), best)

    def end(self, i: int, sign: float, half: float, best: FitPoint, others: Sequence[FitPoint]) -> float:
        """The end of the interval of x_i above (sign 1) or below; `half` is half of it, were f linear.

        Where `restricted`, with all else refitted, is larger than at the best point by `threshold`; or a
        bound, if it is not as large there. It is sought from the best point and from other explanations, and
        the farthest is the end. None lies nearer than the linear one.
        """
        bound = float(self.bounds[sign > 0.0][i])
        far = sign * min(sign * float(best.x[i]) + half, sign * bound)
        for about in (best, *others):
            far = sign * max(sign * far, sign * self._end_from(i, sign, far, about, best))
        return far

    def _end_from(self, i: int, sign: float, first: float, about: FitPoint, best: FitPoint) -> float:
        bound = float(self.bounds[sign > 0.0][i])
        middle, most = float(about.x[i]), math.sqrt(self.threshold(best))
        points = {middle: about}

        def over(number: float) -> float:
            """The root of the difference, less that at an end."""
            if number not in points:
                near = points[min(points, key=lambda one: abs(one - number))]
                try:
                    points[number] = self.refitted(i, number, near, best)
                except (InputError, SimulationError):
                    points[number] = near._replace(value=best.value + LARGEST_EXCESS)
            return math.sqrt(max(points[number].value - best.value, 0.0)) - most

        reach = max(sign * (first - middle), 0.1 * abs(first - float(best.x[i])))
        inside, outside = middle, sign * min(sign * middle + reach, sign * bound)
        while over(outside) < -NEAR * most:
            if outside == bound:
                return bound
            further = sign * (middle + FARTHER * (outside - middle))
            inside, outside = outside, sign * min(further, sign * bound)
        if inside == middle or over(outside) <= 0.0:
            return outside  # no nearer than from the best point
        return float(brentq(over, inside, outside, xtol=0.5 * NEAR * abs(outside - middle)))

    def explanations(self, best: FitPoint) -> tuple[FitPoint, list[FitPoint]]:
        """The best point, and other places where the logs are explained nearly as well.

        A start that begins at the flank and one that crosses the gap first are two valleys: no step along
        one of them finds the other. So positions begin in mid-gap with the load torque at values over its
        range, all else is fitted, then the load torque too; and again from the flank.
        """
        places = [i for i, one in enumerate(self.unknowns) if one.kind == "position"]
        load = next((i for i, one in enumerate(self.unknowns) if one.name == "load_torque"), None)
        if not places or load is None:
            return best, []
        found = []
        for share in (*LOADS, None):
            x = best.x.copy()
            x[places] = 0.0 if share is None else math.sqrt(0.5)
            if share is not None:
                x[load] = share * self.unknowns[load].upper
            try:
                first = self.with_likelihood(self.most_likely(x, None if share is None else load), best)
                if first.value < best.value + LARGEST_EXCESS:
                    found.append(first if share is None else self.most_likely(first.x))
            except (InputError, SimulationError):
                continue
        for one in found:
            if self.with_likelihood(one, best).value < best.value:
                best = self.with_likelihood(one, one)
        others: list[FitPoint] = []
        for one in (self.with_likelihood(one, best) for one in found if one.x is not best.x):
            apart = [float(np.linalg.norm(best.white[1] @ (one.x - two.x))) for two in (best, *others)]
            if one.value < best.value + self.threshold(best) and min(apart) > SAME:
                others.append(one)
        return best, others


def _ripples(best: FitPoint, logs: Sequence[float]) -> list[ErrorScales]:
    """The sizes of the best point with the ripple so many e-folds larger."""
    return [best.sizes._replace(ripple=best.sizes.ripple * math.exp(log)) for log in logs]


def agreeing_searches(minima: Sequence[tuple[Vector, float]]) -> int:
    """How many searches ended at the best minimum."""
    return sum(cost <= 1.01 * minima[0][1] + 1e-300 for _, cost in minima)
