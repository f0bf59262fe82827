"""The search: what it finds, that jumps do it no harm, and that running at once changes nothing."""

import numpy as np
import pytest
from scipy.optimize import rosen

from softstart.tuning.search import agreement, polish, search, together
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


@pytest.mark.parametrize(("cost_of", "least"), [(valley, 1e-3), (stairs, 2e-3), (many, 1e-2)])
def test_the_least_cost_is_found(cost_of, least):
    found = search(cost_of, [0.5, 0.5], (1,), 24, 60)
    assert found.cost <= least
    assert found.cost == cost_of(found.place[None])[0]


def test_the_answer_is_never_worse_than_a_seed():
    best = np.array([0.4, 0.4])
    found = search(many, [best, [0.9, 0.9]], (2,), 8, 1)
    assert found.cost <= many(best[None])[0]
    assert np.all((found.place >= 0.0) & (found.place <= 1.0))


def test_polish_ends_at_a_corner():
    found = polish(lambda x: -x.sum(axis=1), np.array([0.9, 0.2, 0.5]), -1.6, (0,), 40)
    assert found.place.tolist() == [1.0, 1.0, 1.0]


def test_one_parameter():
    found = search(lambda x: np.abs(x[:, 0] - 0.123), [0.5], (0,), 8, 30)
    assert found.place[0] == pytest.approx(0.123, abs=3e-4)


def test_searches_at_once_find_what_they_find_alone():
    costs = [valley, stairs, many]
    alone = [search(one, [0.5, 0.5], (k,), 8 + 4 * k, 5 + k) for k, one in enumerate(costs)]
    calls = []

    def batch(whose, places):
        calls.append(set(whose.tolist()))
        return np.array([costs[k](row[None])[0] for k, row in zip(whose, places, strict=True)])

    runs = [
        lambda cost_of, k=k: search(cost_of, [0.5, 0.5], (k,), 8 + 4 * k, 5 + k) for k in range(len(costs))
    ]
    for a, b in zip(alone, together(batch, runs), strict=True):
        assert (a.place.tolist(), a.cost, a.tried) == (b.place.tolist(), b.cost, b.tried)
    assert calls[0] == {0, 1, 2}


def test_a_search_that_fails_ends_all():
    def fails(cost_of):
        cost_of(np.zeros((1, 1)))
        raise ZeroDivisionError("its own")

    def goes_on(cost_of):
        while True:
            cost_of(np.zeros((1, 1)))

    with pytest.raises(ZeroDivisionError, match="its own"):
        together(lambda whose, places: places[:, 0], [goes_on, fails, goes_on])


def test_a_batch_that_fails_ends_all():
    def broken(whose, places):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        together(broken, [lambda cost_of: cost_of(np.zeros((2, 3)))] * 3)


# the rule -------------------------------------------------------------------------------------------------


def test_the_rule():
    """In time beats late, less late beats more, late beats never; then the metric."""
    bound = np.array([0.3, 0.4])
    order = [
        ([1.0, 1.2], [0.3, 0.4]),
        ([0.5, 1.3], [0.2, 0.3]),
        ([0.1, 0.1], [0.33, 0.3]),
        ([0.0, 0.0], [0.3, 0.6]),
        ([0.0, 0.0], [0.2, np.nan]),
        ([np.nan, np.nan], [np.nan, np.nan]),
    ]
    costs = [cost(np.array([k]), np.array([t]), bound, 1.0)[0] for k, t in order]
    assert costs == sorted(costs)
    assert len(set(costs)) == len(costs)
    assert in_time(np.array(costs)).tolist() == [True, True, False, False, False, False]
    assert costs[0] == 1.2


def test_the_quantile_forgives_failures_too():
    k, t = np.array([[1.0, 2.0, 3.0, np.nan]]), np.array([[0.3, 0.3, 0.3, np.nan]])
    assert cost(k, t, 0.3, 0.75)[0] == 3.0
    assert not in_time(cost(k, t, 0.3, 1.0))[0]
    assert excess(np.array([0.3 * (1 + 1e-12), 0.33]), 0.3, 1.0) == pytest.approx(0.1)
    assert excess(np.array([0.3 * (1 + 1e-12)]), 0.3, 1.0) == 0.0


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.95, 1.0])
def test_the_quantile_is_that_of_numpy(share):
    values = np.random.default_rng(0).normal(size=(3, 20))
    assert np.array_equal(upper(values, share), np.quantile(values, share, axis=1, method="inverted_cdf"))


def test_agreement():
    assert agreement([2.0, 2.019, 2.021], 2.0) == (2, 0.0105)
    assert agreement([1.1, 1.2], 1.0) == (0, 0.2)
