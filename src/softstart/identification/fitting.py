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
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import brentq, least_squares, lsq_linear, minimize
from scipy.stats import qmc
from scipy.stats import t as student

from softstart.arrays import Matrix, Vector
from softstart.errors import InputError, SimulationError
from softstart.identification.model import LogModel, edges
from softstart.identification.unknowns import FACTOR, Unknown, values_of
from softstart.start.comparison import INTERVAL

HORIZONS: Final = (0.07, 0.13, 0.27, 0.5, 1.0)  # of each log, in which the search follows it step by step
AGREED: Final = 2  # searches that end at the best minimum before it is believed
STEP: Final = 1e-6  # of x, for derivatives of the motion
APART: Final = 0.02  # of x, or half a standard error if that is less: for derivatives of covariances
TURNS: Final = 3  # of the most likely torque error at one x; fewer if it moves by less than
ERROR_SETTLED: Final = 0.1  # standard deviations, all samples together
# beforehand a torque error of 2.5 % of the largest torque, within a factor of 3: a log that cannot tell how
# large it is (coarse encoder, few samples) must not conclude that there is none
RIPPLE, RIPPLE_FACTOR = 0.025, 3.0
MOST_RIPPLE: Final = 0.25  # of the largest torque: more is no small error, of which G tells
LOADS: Final = (
    0.08,
    0.25,
    0.45,
    0.7,
)  # load torques from which other explanations are sought, over the largest
NEAR: Final = 0.04  # relative error of the root of a difference of L at an end of an interval
FARTHER: Final = 1.6  # times as far, where an end is not reached
MOST_STEPS, HALVINGS = 30, 7  # towards the most likely x, each step cut if need be
LONGEST_STEP: Final = 0.7  # of a number of x
STEEP, ROUGHLY = 1e-3, 0.02  # what L must still gain for another step; where all else is refitted
SAME: Final = 0.3  # standard errors between two explanations that are one
HOPELESS: Final = 100.0  # above the least L: no place there is as likely

Progress = Callable[[str], None]
Errors = tuple[Vector, ...]  # the torque error of each log, one number for each block of samples


class Data(NamedTuple):
    """What a log tells: its samples that count, their values, and the deviations of their rounding."""

    rows: NDArray[np.bool_]
    values: Vector
    root: Vector


class Sizes(NamedTuple):
    """How large the errors are: of the measurement in units of `Data.root`, of the torque in N m."""

    noise: float
    ripple: float


class Spot(NamedTuple):
    """A log about an x and a torque error, in units of its rounding, turned so that V is diagonal."""

    error: Vector  # the torque error e, one number for each block of samples
    residual: Vector  # f(x, e) - G e - y
    jacobian: Matrix
    rotation: Matrix
    eigenvalues: Vector  # of G G'
    response: Matrix  # G, not turned

    def variance(self, sizes: Sizes) -> Vector:
        """The diagonal of V."""
        found: Vector = sizes.noise**2 + sizes.ripple**2 * self.eigenvalues
        return found

    def innovations(self, sizes: Sizes) -> Vector:
        """What is left in each sample that the samples before it did not tell, of unit size."""
        # V = upper' upper, without the product that rounding would break, and with a positive diagonal
        upper = np.linalg.qr(np.sqrt(self.variance(sizes))[:, None] * self.rotation, mode="r")
        upper *= np.sign(np.diag(upper))[:, None]
        return np.asarray(solve_triangular(upper, self.rotation.T @ self.residual, trans=1))

    def likely_error(self, residual: Vector, sizes: Sizes) -> Vector:
        """The most likely torque error for a turned residual: the best linear unbiased prediction."""
        pulled = self.rotation.T @ (residual / self.variance(sizes))
        return np.asarray(-(sizes.ripple**2) * (self.response.T @ pulled))


class Point(NamedTuple):
    """An x, the sizes of the errors that are most likely there, and each log about it."""

    x: Vector
    sizes: Sizes
    spots: tuple[Spot, ...]
    drift: Vector = np.zeros(0)  # d ln|V|/dx, halved
    value: float = math.nan  # of the restricted likelihood, see `Fitter.valued`

    @property
    def likelihood(self) -> float:
        """L."""
        variances = [(one.residual, one.variance(self.sizes)) for one in self.spots]
        return sum(float(np.log(v).sum() + r @ (r / v)) for r, v in variances)

    @property
    def white(self) -> tuple[Vector, Matrix]:
        """Residual and derivatives of all logs, independent and of unit size."""
        roots = [np.sqrt(one.variance(self.sizes)) for one in self.spots]
        residuals = [one.residual / root for one, root in zip(self.spots, roots, strict=True)]
        jacobians = [one.jacobian / root[:, None] for one, root in zip(self.spots, roots, strict=True)]
        return np.concatenate(residuals), np.vstack(jacobians)


def data_of(model: LogModel, logged: Vector) -> Data:
    """The samples that count, with the deviations of what encoder or log round."""
    log = model.log
    rows = np.isfinite(logged)
    if log.kind != "angle" or log.count == 0.0:
        return Data(rows, logged[rows], np.full(int(rows.sum()), max(log.floor, 1e-3 * log.scale)))
    values, variance = edges(log.time[rows], logged[rows], log.count)
    counts = np.isfinite(variance)
    rows[rows] = counts
    return Data(rows, values[counts], np.sqrt(variance[counts]))


@dataclass(frozen=True, eq=False)
class Fitter:
    """Logs, their models, and the unknowns; each method is a function of what it is given."""

    models: tuple[LogModel, ...]
    unknowns: tuple[Unknown, ...]
    data: tuple[Data, ...]
    progress: Progress = lambda _: None

    @classmethod
    def of(
        cls, models: Sequence[LogModel], unknowns: Sequence[Unknown], progress: Progress | None = None
    ) -> Fitter:
        """The fit of these unknowns to the logs of these models."""
        data = tuple(data_of(one, one.log.values) for one in models)
        return cls(tuple(models), tuple(unknowns), data, progress or (lambda _: None))

    @property
    def lower(self) -> Vector:
        """The least x."""
        return np.array([one.lower for one in self.unknowns])

    @property
    def upper(self) -> Vector:
        """The largest x."""
        return np.array([one.upper for one in self.unknowns])

    @property
    def weights(self) -> Matrix:
        """What is known beforehand, as the curvature of L/2."""
        return np.diag([one.weight for one in self.unknowns])

    @property
    def largest_torque(self) -> float:
        """The largest torque of the logs, N m."""
        return max(float(np.max(np.abs(one.log.torque))) for one in self.models)

    # ---- one log at one x --------------------------------------------------------------------------------

    def residual(self, x: Vector, log: int, error: Vector | None = None) -> Vector:
        """Model minus log in the samples that count, in units of their rounding."""
        return np.asarray(self._residuals([x], log, error)[0])

    def jacobian(self, x: Vector, log: int, error: Vector | None = None) -> Matrix:
        """The derivatives of the residual, by differences."""
        moved = self._moved(log)
        steps = [-STEP if self.unknowns[i].kind == "position" and x[i] > 0.5 else STEP for i in moved]
        unit = np.eye(x.size)
        points = [x, *(x + step * unit[i] for i, step in zip(moved, steps, strict=True))]
        residuals = self._residuals(points, log, error)
        found = np.zeros((residuals.shape[1], x.size))
        found[:, moved] = ((residuals[1:] - residuals[0]) / np.array(steps)[:, None]).T
        for i in self._offset(log):
            found[:, i] = 1.0 / self.data[log].root
        return found

    def _residuals(self, points: Sequence[Vector], log: int, error: Vector | None) -> Matrix:
        rows, values, root = self.data[log]
        model = self.models[log]
        signals = model.signals([values_of(self.unknowns, x, log) for x in points], error)[:, rows]
        offsets = np.array([sum(x[i] for i in self._offset(log)) for x in points])
        return np.asarray((signals + offsets[:, None] - values) / root)

    def _moved(self, log: int) -> list[int]:
        """Which numbers the motion of a log depends on."""
        return [i for i, one in enumerate(self.unknowns) if one.kind != "offset" and one.log in (None, log)]

    def _offset(self, log: int) -> list[int]:
        return [i for i, one in enumerate(self.unknowns) if one.kind == "offset" and one.log == log]

    def response(self, x: Vector, log: int, error: Vector | None = None) -> Matrix:
        """G: how the samples that count answer to a torque error, in units of their rounding."""
        rows, _, root = self.data[log]
        values = values_of(self.unknowns, x, log)
        return np.asarray(self.models[log].responses(values, error)[rows] / root[:, None])

    def spot(self, x: Vector, log: int, error: Vector, *, derivatives: bool = False) -> Spot:
        """A log about x and this torque error."""
        response = self.response(x, log, error)
        eigenvalues, vectors = np.linalg.eigh(response @ response.T)
        residual = vectors.T @ (self.residual(x, log, error) - response @ error)
        jacobian = vectors.T @ self.jacobian(x, log, error) if derivatives else np.zeros((residual.size, 0))
        return Spot(error, residual, jacobian, vectors.T, np.maximum(eigenvalues, 0.0), response)

    def left(self, point: Point) -> list[Vector]:
        """Model minus log in each sample of each log, in its unit."""
        found = []
        for log, (model, spot) in enumerate(zip(self.models, point.spots, strict=True)):
            values = values_of(self.unknowns, point.x, log)
            response = model.responses(values, spot.error)
            one = model.signals([values], spot.error)[0] - response @ spot.error - model.log.values
            one += sum(point.x[i] for i in self._offset(log))
            found.append(one[np.isfinite(model.log.values)])
        return found

    # ---- the search --------------------------------------------------------------------------------------

    def search(self, most: int, seed: int) -> list[tuple[Vector, float]]:
        """Minima of the plain squares, best first: from the guess, then from points all over the range.

        Each search follows the logs from their beginning, over longer and longer parts: what comes early is
        explained before errors can pile up, which is what makes the basin wide.
        """
        guess = np.array([one.guess for one in self.unknowns])
        free = [i for i, one in enumerate(self.unknowns) if one.kind != "offset"]
        draws = qmc.Sobol(len(free), seed=seed).random_base2(max(1, math.ceil(math.log2(max(most, 2)))))
        found: list[tuple[Vector, float]] = []
        for number in range(most):
            start = guess.copy()
            for i, draw in zip(free, draws[number - 1], strict=True) if number else ():
                one, move = self.unknowns[i], 2.0 * draw - 1.0
                if one.kind == "position":
                    start[i] = math.sqrt(draw)
                elif one.is_friction:
                    start[i] = guess[i] + move * math.log(FACTOR)
                else:
                    start[i] = one.number(one.value(guess[i]) * FACTOR**move)
            self.progress(f"search {number + 1}")
            try:
                found.append(self._followed(np.clip(start, self.lower, self.upper)))
            except (InputError, SimulationError):
                continue
            found.sort(key=lambda one: one[1])
            if agreeing(found) >= AGREED:
                break
        if not found:
            raise InputError("The logs cannot be computed with any of the values tried; check their units.")
        return found

    def _followed(self, x: Vector) -> tuple[Vector, float]:
        cost = math.inf
        for share in HORIZONS:
            last = share == HORIZONS[-1]
            pull = np.zeros((0, x.size)) if last else np.eye(x.size)
            plain = self._plain(share)
            found = least_squares(
                lambda at, x=x, pull=pull, plain=plain: np.concatenate(
                    [*(plain.residual(at, i) for i in range(len(plain.models))), pull @ (at - x)]
                ),
                x,
                jac=lambda at, pull=pull, plain=plain: np.vstack(
                    [*(plain.jacobian(at, i) for i in range(len(plain.models))), pull]
                ),
                bounds=(self.lower, self.upper), max_nfev=60 if last else 25, xtol=1e-10,
            )  # fmt: skip
            x, cost = found.x, float(2.0 * found.cost)
        return x, cost

    def _plain(self, share: float) -> Fitter:
        """The first share of each log, its samples weighted alike."""
        models = tuple(one if share >= 1.0 else one.first(share) for one in self.models)
        data = []
        for model, one in zip(models, self.data, strict=True):
            rows = one.rows[: model.times.size]
            count = int(rows.sum())
            data.append(Data(rows, one.values[:count], np.full(count, model.log.scale)))
        return replace(self, models=models, data=tuple(data))

    # ---- the most likely x -------------------------------------------------------------------------------

    def refined(self, x: Vector, held: int | None = None) -> Point:
        """The most likely x near this one. `held`: the number that stays."""
        errors = tuple(np.zeros(one.blocks) for one in self.models)
        return self.descended(self.settled(x, errors, Sizes(1.0, RIPPLE * self.largest_torque)), held)

    def settled(self, x: Vector, errors: Errors, sizes: Sizes) -> Point:
        """The covariance at x about the torque errors that are most likely there, sought from `errors`."""
        spots = []
        for log, error in enumerate(errors):
            spot = self.spot(x, log, error)
            for _ in range(TURNS):
                new = spot.likely_error(spot.residual, sizes)
                if np.linalg.norm(new - spot.error) < ERROR_SETTLED * sizes.ripple:
                    break
                spot = self.spot(x, log, new)
            spots.append(spot)
        return Point(x, sizes, tuple(spots))

    def descended(self, point: Point, held: int | None = None, best: Point | None = None) -> Point:
        """Where L is least, from a settled point; with sizes and drift of the best point, or its own.

        Bounded linear least squares for each step, cut until L is less: the drift of ln|V| is a force on x,
        which is added to the residual along J, so that the steps end where J' V^-1 r + drift = 0.
        """
        for _ in range(MOST_STEPS):
            point = self.derived(point, best)
            step, gain = self.step(point, held)
            if gain < (STEEP if best is None else ROUGHLY):
                break
            length = min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step))), 1e-300))
            for cut in (length * 0.5 ** np.arange(HALVINGS)).tolist():
                at = np.clip(point.x + cut * step, self.lower, self.upper)
                new = self.settled(at, tuple(one.error for one in point.spots), point.sizes)
                if new.likelihood < point.likelihood - 0.1 * cut * gain:
                    break
            else:
                break
            point = new
            self.progress("weights and fit")
        return point if point.spots[0].jacobian.size else self.derived(point, best)

    def derived(self, point: Point, best: Point | None = None) -> Point:
        """The point with the derivatives of its spots, and with sizes and drift unless those of the best."""
        spots = tuple(
            one._replace(jacobian=one.rotation @ self.jacobian(point.x, i, one.error))
            for i, one in enumerate(point.spots)
        )
        if best is not None:
            return point._replace(spots=spots, drift=best.drift)
        point = Point(point.x, self.sized(spots, spots, point.sizes), spots, np.zeros(point.x.size))
        small = point.sizes.ripple <= MOST_RIPPLE * self.largest_torque
        return point._replace(drift=self.drift(point)) if small else point

    def step(self, point: Point, held: int | None = None) -> tuple[Vector, float]:
        """The step to the least L, were it quadratic, and what is gained by it."""
        residual, jacobian = point.white
        damped = np.vstack([jacobian, np.sqrt(self.weights)])
        force = jacobian @ np.linalg.solve(damped.T @ damped, point.drift)
        free = np.array([i for i in range(point.x.size) if i != held])
        room = np.array([self.lower - point.x - 1e-12, self.upper - point.x + 1e-12])[:, free]
        wanted = np.concatenate([-residual - force, np.zeros(point.x.size)])
        step = np.zeros(point.x.size)
        step[free] = lsq_linear(damped[:, free], wanted, bounds=(room[0], room[1]), method="bvls").x
        gradient = jacobian.T @ residual + point.drift
        return step, -float(2.0 * gradient @ step + np.sum((damped @ step) ** 2))

    def drift(self, point: Point) -> Vector:
        """D ln|V|/dx, halved; the most likely torque error follows x, by how much, the response says."""
        found, ripple = np.zeros(point.x.size), point.sizes.ripple
        deviations = np.sqrt(np.diag(self.covariance(point)))
        for log, spot in enumerate(point.spots):
            turned = spot.rotation @ spot.response / spot.variance(point.sizes)[:, None]
            inverse = spot.rotation.T @ turned
            for i in self._moved(log):
                at, move = point.x.copy(), min(APART, 0.5 * float(deviations[i]))
                move = -move if self.unknowns[i].kind == "position" and at[i] > 0.5 else move
                at[i] += move
                error = spot.error + move * spot.likely_error(spot.jacobian[:, i], point.sizes)
                more = self.response(at, log, error) - spot.response
                found[i] += ripple**2 * float(np.sum(inverse * more)) / move
        return found

    def covariance(self, point: Point) -> Matrix:
        """Of x; what the logs do not tell is as uncertain as it was beforehand."""
        jacobian = point.white[1]
        return np.asarray(np.linalg.inv(jacobian.T @ jacobian + self.weights))

    # ---- how large the errors are ------------------------------------------------------------------------

    def restricted(
        self, spots: Sequence[Spot], about: Sequence[Spot], sizes: Sizes, *, follows: bool = True
    ) -> float:
        """L + ln|J' V^-1 J|; J and V of the last term are those of `about`.

        Where x `follows` along J, it need not be the most likely one.
        """
        value = (math.log(sizes.ripple / (RIPPLE * self.largest_torque)) / math.log(RIPPLE_FACTOR)) ** 2
        information, pull = np.zeros_like(self.weights), np.zeros(len(self.weights))
        for one, other in zip(spots, about, strict=True):
            variance = one.variance(sizes)
            value += float(np.log(variance).sum() + one.residual @ (one.residual / variance))
            weighted = other.jacobian / other.variance(sizes)[:, None]
            information += other.jacobian.T @ weighted
            if follows:
                pull += weighted.T @ one.residual
        values, vectors = np.linalg.eigh(information)
        kept = values > 1e-12 * values[-1]
        along = (vectors.T @ pull)[kept]
        return value + float(np.log(values[kept]).sum() - np.sum(along**2 / values[kept]))

    def sized(
        self, spots: Sequence[Spot], about: Sequence[Spot], before: Sizes, *, follows: bool = True
    ) -> Sizes:
        """Noise and ripple where `restricted` is least, from where they stood; at least the rounding."""

        def sizes_at(logs: Vector) -> Sizes:
            excess, ripple = np.exp(np.clip(logs, -60.0, 60.0)).tolist()
            return Sizes(math.hypot(1.0, excess), ripple)

        begin = np.log([math.sqrt(max(before.noise**2 - 1.0, 0.01)), before.ripple])
        simplex = begin + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]])
        options = {"xatol": 3e-3, "fatol": 1e-3, "initial_simplex": simplex}

        def loss(logs: Vector) -> float:
            return self.restricted(spots, about, sizes_at(logs), follows=follows)

        return sizes_at(minimize(loss, begin, method="Nelder-Mead", options=options).x)

    # ---- intervals ---------------------------------------------------------------------------------------

    def valued(self, point: Point, best: Point) -> Point:
        """A point with the sizes that are most likely there, and its value of `restricted`."""
        sizes = self.sized(point.spots, best.spots, point.sizes, follows=False)
        return point._replace(
            sizes=sizes, value=self.restricted(point.spots, best.spots, sizes, follows=False)
        )

    def threshold(self, best: Point) -> float:
        """By how much `restricted` is larger at the ends of an interval.

        nu ln(1 + t^2/nu), with Student's quantile t, for errors whose size is known with nu degrees of
        freedom: were f linear, the ends are those of Student's t. It is 1.96^2 if the size is known. Minus
        twice the log likelihood of the logarithm of a deviation with nu of them has the curvature 4 nu.
        """
        each = [self.restricted(best.spots, best.spots, one) for one in self._ripples(best, (-0.1, 0.0, 0.1))]
        freedom = max((each[0] - 2.0 * each[1] + each[2]) / 0.04, 2.0)
        quantile = float(student.ppf(0.5 + 0.5 * INTERVAL.inside, freedom))
        return freedom * math.log1p(quantile**2 / freedom)

    def halves(self, best: Point) -> Vector:
        """Half the interval of each number, were f linear: the farthest end over all sizes of the errors."""
        reach, most = np.zeros(best.x.size), self.threshold(best)
        most += self.restricted(best.spots, best.spots, best.sizes)
        for sizes in self._ripples(best, np.linspace(-1.5, 1.5, 31).tolist()):
            left = most - self.restricted(best.spots, best.spots, sizes)
            if left > 0.0:
                reach = np.maximum(reach, left * np.diag(self.covariance(best._replace(sizes=sizes))))
        return np.asarray(np.sqrt(reach))

    @staticmethod
    def _ripples(best: Point, logs: Sequence[float]) -> list[Sizes]:
        return [best.sizes._replace(ripple=best.sizes.ripple * math.exp(one)) for one in logs]

    def refitted(self, i: int, number: float, near: Point, best: Point) -> Point:
        """All else refitted with x_i at a number, from a point nearby."""
        along = self.covariance(near)[:, i]
        x = np.clip(near.x + along / along[i] * (number - near.x[i]), self.lower, self.upper)
        x[i] = number
        begin = self.settled(x, tuple(one.error for one in near.spots), near.sizes)
        return self.valued(self.descended(begin, i, best), best)

    def end(self, i: int, sign: float, half: float, best: Point, others: Sequence[Point]) -> float:
        """The end of the interval of x_i above (sign 1) or below; `half` is half of it, were f linear.

        Where `restricted`, with all else refitted, is larger than at the best point by `threshold`; or a
        bound, if it is not as large there. It is sought from the best point and from other explanations, and
        the farthest is the end. None lies nearer than the linear one.
        """
        bound = float((self.upper if sign > 0.0 else self.lower)[i])
        far = sign * min(sign * float(best.x[i]) + half, sign * bound)
        for about in (best, *others):
            far = sign * max(sign * far, sign * self._end_from(i, sign, far, about, best))
        return far

    def _end_from(self, i: int, sign: float, first: float, about: Point, best: Point) -> float:
        bound = float((self.upper if sign > 0.0 else self.lower)[i])
        middle, most = float(about.x[i]), math.sqrt(self.threshold(best))
        points = {middle: about}

        def over(number: float) -> float:
            """The root of the difference, less that at an end."""
            if number not in points:
                near = points[min(points, key=lambda one: abs(one - number))]
                try:
                    points[number] = self.refitted(i, number, near, best)
                except (InputError, SimulationError):
                    points[number] = near._replace(value=best.value + HOPELESS)
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

    def explanations(self, best: Point, seek: bool) -> tuple[Point, list[Point]]:
        """The best point, and other places where the logs are explained nearly as well, if they are sought.

        A start that begins at the flank and one that crosses the gap first are two valleys: no step along
        one of them finds the other. So positions begin in mid-gap with the load torque at values over its
        range, all else is fitted, then the load torque too; and again from the flank.
        """
        places = [i for i, one in enumerate(self.unknowns) if one.kind == "position"]
        loads = [i for i, one in enumerate(self.unknowns) if one.name == "load_torque"]
        if not seek or not places or not loads:
            return best, []
        (load,) = loads
        starts: list[tuple[Vector, int | None]] = []
        for share in LOADS:
            x = best.x.copy()
            x[load], x[places] = share * self.upper[load], math.sqrt(0.5)
            starts.append((x, load))
        flank = best.x.copy()
        flank[places] = 0.0
        found = []
        for x, held in (*starts, (flank, None)):
            try:
                first = self.valued(self.refined(x, held), best)
                if first.value < best.value + HOPELESS:
                    found.append(self.refined(first.x) if held is not None else first)
            except (InputError, SimulationError):
                continue
        for one in found:
            if self.valued(one, best).value < best.value:
                best = self.valued(one, one)
        others: list[Point] = []
        for one in (self.valued(one, best) for one in found if one.x is not best.x):
            apart = [float(np.linalg.norm(best.white[1] @ (one.x - two.x))) for two in (best, *others)]
            if one.value < best.value + self.threshold(best) and min(apart) > SAME:
                others.append(one)
        return best, others


def agreeing(found: Sequence[tuple[Vector, float]]) -> int:
    """How many searches ended at the best minimum."""
    return sum(cost <= 1.01 * found[0][1] + 1e-300 for _, cost in found)
