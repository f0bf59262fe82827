"""A race of candidates decides as all their starts do, and a start that is given up is one that loses."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.softstart.tuning.test_tune import Wait

from softstart import Drive, tune
from softstart.controller import make_controller
from softstart.start.batch import prepared
from softstart.tuning import gains
from softstart.tuning.search import evolve, populations
from softstart.tuning.trials import Judged, Raced, Trials, cost

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
BOUND = 0.3


class Table(Trials):
    """Candidates whose starts stand in a table: place k is its row k."""

    def __init__(self, metric, start_time, quantile, name="k_dyn"):
        self.table, self.made = Judged(metric, start_time), 0
        size = metric.shape[1]
        self.problem = SimpleNamespace(metric=name, quantile=quantile)
        self.starts_of, self.bound = np.arange(size)[None], np.full((1, size), BOUND)
        self.spared = size - max(int(np.ceil(quantile * size - 1e-9)), 1)

    def values(self, jobs, places):
        return {"row": places[:, 0]}

    def judged(self, jobs, values, to_the_end=False, which=None, limits=None):
        rows = values["row"].astype(int)[:, None]
        self.made += which.size
        judged = self.table.at((rows, which))
        if limits is not None and not self.spared:  # as the kernel gives up
            lost = (judged.metric > limits.metric) | (judged.start_time > limits.start_time)
            judged = Judged(*(np.where(lost, np.nan, part) for part in judged))
        return judged


NUMBERS = st.sampled_from([0.0, 0.5, 1.0, 1.0 + 1e-7, 1.0 + 1e-5, 1.5, np.nan])
TIMES = st.sampled_from([0.2, BOUND, BOUND * (1.0 + 1e-9), BOUND * (1.0 + 3e-9), 0.33, 0.6, np.nan])


@st.composite
def tables(draw):
    shape = draw(st.tuples(st.integers(1, 7), st.integers(1, 7)))
    metric, time = (draw(arrays(float, shape, elements=one)) for one in (NUMBERS, TIMES))
    return metric, time, draw(st.sampled_from([1.0, 0.75, 0.5])), draw(st.randoms(use_true_random=False))


@given(tables())
def test_a_race_equals_all_starts(table):
    """Costs up to what is to be beaten to the bit, all others above it, for whatever order and parent."""
    metric, time, quantile, random = table
    count, size = metric.shape
    trials, jobs = Table(metric, time, quantile), np.zeros(count, dtype=int)
    exact = cost(metric, time, BOUND, quantile)
    parents = np.array([random.choice([*exact, np.inf, -np.inf]) for _ in jobs])
    order = np.array([random.sample(range(size), size) for _ in jobs])
    raced = trials.raced(jobs, np.arange(count, dtype=float)[:, None], parents, order)
    wins = exact <= parents
    assert np.array_equal(raced.costs[wins], exact[wins])
    assert np.all(raced.costs[~wins] > parents[~wins])
    assert trials.made == raced.starts <= metric.size
    assert np.all((raced.deciders >= 0) & (raced.deciders < size))


def test_a_candidate_that_has_lost_makes_no_further_start():
    """Its worst start comes first: one start each for those that lose, all for the one that wins."""
    metric = np.array([[1.0, 3.0, 1.0, 1.0], [1.0, 1.5, 1.0, 1.0], [1.0, 2.5, 1.0, 1.0]])
    trials = Table(metric, np.full(metric.shape, 0.2), 1.0)
    order = np.tile([1, 0, 2, 3], (3, 1))
    raced = trials.raced(np.zeros(3, dtype=int), np.arange(3.0)[:, None], np.full(3, 2.0), order)
    assert np.isinf(raced.costs).tolist() == [True, False, True]
    assert raced.deciders.tolist() == [1, 1, 1]
    assert raced.starts == 1 + 4 + 1


def test_a_metric_that_may_be_negative_does_not_race():
    """With others far below 0 the mean decides in favour of a candidate with a larger start; times race."""
    metric = np.array([[1.0 + 1e-9, -9.0], [1.0, 0.0]])
    trials = Table(metric, np.array([[0.2, 0.2], [0.2, 0.9]]), 1.0, "torque_at_contact")
    jobs, places = np.zeros(2, dtype=int), np.arange(2.0)[:, None]
    exact = cost(metric, trials.table.start_time, BOUND, 1.0)
    raced = trials.raced(jobs, places, np.array([exact[0]] * 2), np.array([[0, 1], [1, 0]]))
    assert raced.costs[0] == exact[0] < 1.0
    assert np.isinf(raced.costs[1])
    assert raced.starts == 3


@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 0.7]))
def test_a_search_takes_the_same_way_with_a_race(seed, quantile):
    rng = np.random.default_rng(seed)
    centres, weights = rng.random((2, 5, 2))

    def starts(places):
        metric = 1.0 + np.abs(places[:, None] - centres).sum(axis=2)
        return metric, 0.25 + 0.1 * np.abs(places @ weights.T - 0.5)

    def exhaustive(which, places, most):
        return cost(*starts(places), BOUND, quantile)

    def race(which, places, most):
        order = rng.permuted(np.tile(np.arange(5), (len(places), 1)), axis=1)
        rows = np.arange(float(len(places)))[:, None]
        return Table(*starts(places), quantile).raced(np.zeros(len(places), int), rows, most, order).costs

    ends = [
        list(evolve(one, populations(one, np.full((1, 1, 2), 0.9), 10, (seed,)), (seed,), 6))[-1]
        for one in (exhaustive, race)
    ]
    for one, other in zip(*ends, strict=True):
        assert np.array_equal(one, other)


# starts -----------------------------------------------------------------------------------------------------

WORN = {"gaps": [0.5, 2.0], "inertias": ["2 J1", "5 J1"]}
FEW = {"generations": 5, "population": 8, "restarts": 2, "certified": False, "workers": 1}
CASES = {
    "tolerances": (CRANE, "ramp", {"tolerances": {"stiffness": "10 %"}}),
    "late": (CRANE, "acceleration-delay", {"start_time": 0.235}),
    "peak": (CRANE, "current-limit-feedback", {"metric": "peak_torque", "start_time": "1.3x"}),
    "quantile": (CRANE, "reduced-two-stage", {"quantile": 0.75}),
    "positions": (CRANE.replace(start_position="unknown", load_kind="reactive"), "s-curve", {}),
    "settled": (CRANE.replace(torque_lag=0.005), "speed-ramp", {"start_time": "0.6 s"}),
    "overshoot": (CRANE.replace(torque_lag=0.005), "speed-ramp", {"metric": "overshoot"}),
    "signed": (CRANE, "ramp", {"metric": "torque_at_contact"}),
}


def everything(tuning):
    """Everything that was found, to the bit."""
    return {k: v for k, v in tuning.summary().items() if k not in ("starts", "seconds")}


@pytest.mark.parametrize("case", CASES)
def test_tuning_with_a_race_is_tuning_with_all_starts(case, monkeypatch):
    drive, name, options = CASES[case]
    raced = tune(drive, name, **WORN, **FEW, **options)

    def exhaustive(trials, pool, jobs, places, most):
        costs = trials.costs(jobs, places)
        return Raced(costs, np.zeros(len(jobs), dtype=int), len(jobs) * trials.starts_of.shape[1])

    monkeypatch.setattr(gains, "race", exhaustive)
    all_starts = tune(drive, name, **WORN, **FEW, **options)
    assert everything(raced) == everything(all_starts)
    assert raced.starts < all_starts.starts


@pytest.mark.parametrize("name", ["ramp", "pulse-coast-hold", "take-up", "speed-ramp"])
def test_a_start_is_given_up_only_if_its_peak_or_its_time_is_beyond(name):
    """400 pairs of limits around peak and time; what is not given up is the same to the bit.

    A peak beyond is always seen; a time beyond not if the target speed is reached in the span that passes it.
    """
    torque, time = (np.geomspace(0.5, 2.0, 20),) * 2
    torque, time = (one.ravel() for one in np.meshgrid(torque, time))
    batch, ready = prepared([CRANE]), [make_controller(name).set_up(CRANE)]
    (peak,) = batch.results(ready).peaks[0]
    free = batch.figures(ready, 1.0)
    end = free["settled_time" if "settled_time" in free else "start_time"][0][0]
    which = np.zeros(400, dtype=int)
    results = batch.results(ready, which, give_up=(torque * peak, time * end))
    given_up = batch.read(results, 1.0, which)["status"][0] == "NO_BETTER"
    assert not np.any(given_up & (torque > 1.0) & (time > 1.0))
    assert np.all(given_up[(torque < 1.0) | (time < 0.8)])
    whole = batch.results(ready)
    for part in ("starts", "shafts"):
        same, row = getattr(results, part)[~given_up], getattr(whole, part)[0]
        assert len(same) >= 100
        assert all(one.tobytes() == row.tobytes() for one in same)


def test_a_start_that_cannot_reach_its_speed_in_time_is_given_up_before_that_time():
    """Up to 1.02 times M12avg lets the load gain (T - Mc)/J2 at most; a torque that comes late shows it."""
    drive = CRANE.replace(load_kind="reactive")  # which stays at rest while the gap is open
    batch = prepared([drive])
    late = [make_controller("ramp", {"time": 0.3}).set_up(drive)]
    most, limit = 1.02 * drive.mean_torque, 0.25
    zero = np.zeros(1, dtype=int)
    alone = batch.results(late, zero, give_up=(np.array([np.inf]), np.array([limit])))["time"][0]
    both = batch.results(late, zero, give_up=(np.array([most]), np.array([limit])))
    assert limit <= alone < limit + 0.05
    fastest = limit - drive.target_speed * drive.load_inertia / (most - drive.Mc)
    assert fastest < both["time"][0] < 0.5 * limit
    assert both.peaks[0, 0] < most


def test_a_plain_controller_is_given_up_too():
    batch, ready = prepared([CRANE]), [Wait().set_up(CRANE)]
    time = batch.figures(ready, 1.0)["start_time"][0]
    zero = np.zeros(1, dtype=int)
    for share, status in ((0.9, "NO_BETTER"), (1.1, "REACHED")):
        given_up = batch.results(ready, zero, give_up=(np.array([np.inf]), share * time))
        assert batch.read(given_up, 1.0, zero)["status"][0].tolist() == [status]
