"""The search: what it finds, that jumps do it no harm, and that it goes on where it was."""

import numpy as np
import pytest
from scipy.optimize import rosen

from softstart.tuning.search import agreement, evolve, populations
from softstart.tuning.trials import cost, excess, in_time, upper


def valley(places):
    """Rosenbrock's function over the box, least at (0.75, 0.75)."""
    return rosen(4.0 * places.T - 2.0)


def stairs(places):
    """A bowl in steps: its gradient is zero almost everywhere."""
    return np.round(np.abs(places - [0.37, 0.61]).sum(axis=1), 3)


def many(places):
    """Rastrigin's function: a hundred minima, the least one at 0.4."""
    z = 10.0 * (places - 0.4)
    return np.sum(z**2 - 10.0 * np.cos(2.0 * np.pi * z) + 10.0, axis=1)


PROBLEMS = [valley, stairs, many]


def searched(problems, seeds, generations, first=None):
    """The last populations of searches at once, one for each problem."""
    seeds = np.broadcast_to(np.array(seeds, dtype=float), (len(problems), *np.shape(seeds)))

    def costs(which, places, most):
        return np.array([problems[k](row[None])[0] for k, row in zip(which, places, strict=True)])

    begin = populations(costs, seeds, 24, (1,)) if first is None else first
    *_, last = evolve(costs, begin, (1,), generations)
    return last


def test_the_least_costs_are_found():
    found = searched(PROBLEMS, [[0.5, 0.5]], 60)
    places, costs = found.best
    assert (costs <= [1e-3, 2e-3, 1e-2]).all()
    assert costs.tolist() == [one(place[None])[0] for one, place in zip(PROBLEMS, places, strict=True)]
    assert np.all((found.places >= 0.0) & (found.places <= 1.0))


def test_a_corner_and_one_parameter():
    assert searched([lambda x: -x.sum(axis=1)], [[0.9, 0.2, 0.5]], 80).best[1][0] <= -2.999
    assert searched([lambda x: np.abs(x[:, 0] - 0.123)], [[0.5]], 30).best[0][0, 0] == pytest.approx(
        0.123, abs=3e-4
    )


def test_searches_agree_that_are_within_1_percent_of_the_best_and_of_what_was_settled_on():
    assert agreement([1.0, 1.0099, 1.0101, 2.0], 1.0) == 2
    assert agreement([1.0, 1.0099], 0.99) == 0


# the rule -------------------------------------------------------------------------------------------------


def test_the_rule():
    """In time beats late, less late beats more, late beats never; then the metric."""
    bound = np.array([0.3, 0.4])
    order = [
        ([1.0, 1.2], [0.3, 0.4]),
        ([0.5, 1e80], [0.2, 0.3]),  # as damage by a steep S-N curve
        ([0.1, 0.1], [0.33, 0.3]),
        ([0.0, 0.0], [0.3, 0.6]),
        ([0.0, 0.0], [0.2, np.nan]),
        ([np.nan, np.nan], [np.nan, np.nan]),
    ]
    costs = [cost(np.array([k]), np.array([t]), bound, 1.0)[0] for k, t in order]
    assert costs == sorted(costs)
    assert len(set(costs)) == len(costs)
    assert in_time(np.array(costs)).tolist() == [True, True, False, False, False, False]
    assert costs[0] == pytest.approx(1.2, rel=1e-6)


def test_the_quantile_forgives_failures_too():
    k, t = np.array([[1.0, 2.0, 3.0, np.nan]]), np.array([[0.3, 0.3, 0.3, np.nan]])
    assert cost(k, t, 0.3, 0.75)[0] == pytest.approx(3.0, rel=1e-6)
    assert not in_time(cost(k, t, 0.3, 1.0))[0]
    assert excess(np.array([0.3 * (1 + 1e-12), 0.33]), 0.3, 1.0) == pytest.approx(0.1)
    assert excess(np.array([0.3 * (1 + 1e-12)]), 0.3, 1.0) == 0.0


@pytest.mark.parametrize("share", [0.1, 0.95, 1.0])
def test_the_quantile_is_that_of_numpy(share):
    values = np.random.default_rng(0).normal(size=(3, 20))
    assert np.array_equal(upper(values, share), np.quantile(values, share, axis=1, method="inverted_cdf"))


def test_where_the_worst_start_is_the_same_the_mean_over_all_is_made_small():
    two = np.array([[1.5, 2.0 - 1e-7], [1.2, 2.0], [1.1, 2.01]])
    assert cost(two, np.full((3, 2), 0.2), 0.3, 1.0).argsort().tolist() == [1, 0, 2]

    def costs(which, places, most):  # K of two starts, one of which no gain changes
        k = np.stack([1.0 + np.abs(places - 0.3).sum(axis=1), np.full(len(places), 2.0)], axis=1)
        return cost(k, np.full(k.shape, 0.2), 0.3, 1.0)

    *_, last = evolve(costs, populations(costs, np.full((1, 1, 2), 0.9), 16, (0,)), (0,), 60, 1e-10)
    assert last.best[0][0] == pytest.approx([0.3, 0.3], abs=0.01)
