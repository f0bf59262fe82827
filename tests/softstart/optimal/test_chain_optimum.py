"""Optimal starts of chains: against strategies, bounds, exact replay and the refusals of bad input."""

import dataclasses
import math
import sys

import numpy as np
import pytest

from softstart import InputError, optimize, pareto, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.errors import SimulationError
from softstart.optimal.chains import global_search
from softstart.optimal.chains.problem import ChainProblem, check, earliest_pull, momentum_bound
from softstart.optimal.chains.search import Search
from softstart.optimal.chains.starts import Player
from softstart.optimal.result import InfeasibleError, LowerBound, OptimumError
from softstart.profile import TorqueProfile


def damped(ratio=0.02):
    """The crane with four masses and a damping ratio in each shaft."""
    chain = Chain.load("crane-4-mass")
    return dataclasses.replace(chain, shafts=tuple(one.replace(damping_ratio=ratio) for one in chain.shafts))


def without_gaps(**motor):
    """Three masses in a row without gaps, at rest under their load: everything linear."""
    return Chain(
        [Mass(0.1), Mass(0.02), Mass(0.4, torque=20.0)],
        [Shaft(3000.0, damping_ratio=0.02, start_position=20.0 / 3000.0),
         Shaft(2000.0, damping_ratio=0.02, start_position=20.0 / 2000.0)],
        Motor(100.0, **motor),
        target_speed=20.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def crane():
    """The first answer for the crane, which takes a few seconds."""
    return optimize(damped(), 0.42, seeds=["s-curve"], tolerance=0.05)


def test_the_crane_starts_more_gently_than_any_torque_known_before(crane):
    assert crane.k_dyn < 1.02 * 1.19  # the best of the prototypes
    assert crane.bound.k_dyn < crane.k_dyn
    assert crane.end_time <= 0.42
    assert crane.run.start_time <= 0.42


def test_the_claim_is_the_exact_replay(crane):
    until = 0.42 + crane.run.elastic_period
    again = simulate(damped(), "profile", until, parameters={"profile": crane.profile})
    assert again.k_dyn == pytest.approx(crane.claimed, rel=1e-6)
    assert again.peak_torques.max() == pytest.approx(crane.run.peak_torque, rel=1e-9)
    assert float(again.at(0.42)["w"][-1]) >= damped().target_speed * (1.0 - 1e-6)


@pytest.mark.slow
def test_searches_around_a_start_keep_the_time_and_the_better_one():
    """Also from where a few programs have led; without time nothing is tried."""
    search = Search(ChainProblem(damped(), 0.42), Player(damped()))
    run = simulate(damped(), "s-curve")
    times = np.linspace(0.0, min(run.end_time, search.until), 2001)
    first = search.descended(search.sampled(times, run.at(times)["u"]), 6, 5e-3)
    assert first is not None
    last = search.beyond(first, 0.05, math.inf)
    assert last.merit <= first.merit
    assert last.miss.max() <= 1e-5
    assert search.beyond(first, 0.05, -math.inf) is first


def test_a_small_miss_at_the_end_changes_torques_at_their_limits_by_little():
    """An undamped chain forgets nothing: a change of 0.2 N m for a miss of 1e-7 raised K_dyn by half."""
    chain = Chain.load("crane-4-mass")
    search = Search(ChainProblem(chain, 0.4786), Player(chain))
    early = search.knots < 0.3 * search.end

    def with_miss(rest):
        return search.play(np.where(early, search.high, rest))

    short, enough = 30.0, 62.0  # the rest of the torques between which the terminal condition is met
    for _ in range(60):
        middle = 0.5 * (short + enough)
        short, enough = (middle, enough) if with_miss(middle).miss.max() > 1e-7 else (short, middle)
    found = with_miss(short)
    assert 1e-7 < found.miss.max() < 2e-6
    done = search.finished(found)
    assert done.miss.max() == 0.0
    assert np.abs(done.torques - found.torques).max() < 1e-3
    assert done.played.peak == pytest.approx(found.played.peak, rel=1e-3)


def test_no_strategy_as_quick_is_gentler(crane):
    for name in ("s-curve", "shaped", "ramp", "acceleration-delay", "state-feedback", "direct"):
        run = simulate(damped(), name)
        assert run.start_time > 0.4201 or run.k_dyn > crane.k_dyn


@pytest.mark.parametrize("terminal", ["reached", "synchronous", "steady"])
def test_without_gaps_the_answer_is_the_optimum(terminal):
    """One linear program is then the whole problem, so that a finer trust region changes nothing."""
    chain = without_gaps()
    one = optimize(chain, 0.3, terminal=terminal, seeds=["direct"], tolerance=2e-3)
    two = optimize(chain, 0.3, terminal=terminal, seeds=["s-curve"], tolerance=2e-3)
    assert one.k_dyn == pytest.approx(two.k_dyn, rel=2e-3)
    assert one.k_dyn >= one.bound.k_dyn
    state = one.run.at(0.3)
    if terminal != "reached":
        np.testing.assert_allclose(state["w"], 20.0, rtol=2e-6)
    if terminal == "steady":
        np.testing.assert_allclose(state["T"], 20.0, atol=1e-4)


def test_lag_and_rate_limit_are_kept():
    chain = without_gaps(torque_lag=4e-3, torque_rate=1500.0)
    best = optimize(chain, 0.3, seeds=["s-curve"], tolerance=1e-3)
    slopes = np.diff(best.profile.torque) / np.diff(best.profile.time)
    assert best.profile.torque[0] == 0.0
    assert np.abs(slopes).max() <= 1500.0 * (1.0 + 1e-9)
    free = optimize(without_gaps(), 0.3, seeds=["s-curve"], tolerance=1e-3)
    assert best.k_dyn >= free.k_dyn * (1.0 - 2e-3)


def test_no_random_torque_beats_the_momentum_bound():
    rng = np.random.default_rng(3)
    nearest = math.inf
    for i in range(60):
        chain = damped(float(rng.choice([0.0, 0.05])))
        gaps, inertia = float(10.0 ** rng.uniform(-2, 0.3)), float(rng.uniform(0.1, 2))
        chain = chain.changed(gaps=gaps, load_inertia=inertia)
        if i % 3 == 0:
            masses = [*chain.masses[:-1], chain.masses[-1].replace(kind="reactive")]
            chain = dataclasses.replace(chain, masses=tuple(masses))
        player = Player(chain)
        time = np.sort(np.append(0.0, rng.uniform(0.0, 0.5, 5)))
        torque = rng.uniform(0.0, 62.0, 6) if i % 2 else np.full(6, rng.uniform(40.0, 62.0))
        try:
            played = player.play(TorqueProfile(time, torque), 1.5)
        except SimulationError:
            continue
        start_time = float(played.recorded.notes["start_time"])
        if math.isnan(start_time):
            continue
        problem = ChainProblem(chain, start_time)
        ratio = played.peak / problem.base_torque / momentum_bound(problem).k_dyn
        nearest = min(nearest, ratio)
        pulls = played.recorded.events
        closed = pulls["time"][(pulls["kind"] == 1) & (pulls["place"] == 2)]
        if closed.size:
            assert earliest_pull(problem) <= closed[0]
    assert 1.0 <= nearest < 2.5


def test_the_check_names_what_does_not_hold():
    chain = damped()
    problem = ChainProblem(chain, 0.42)
    profile = TorqueProfile([0.0], [63.0])
    run = simulate(chain, "profile", 0.3, parameters={"profile": profile})
    with pytest.raises(OptimumError) as caught:
        check(problem, run, profile, 0.3, 1.0, LowerBound(9.0, "momentum", ""))
    for part in ("beyond its limits", "was claimed", "terminal condition", "below its lower bound"):
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"method": "lp"}, "method = lp: on a chain"),
        ({"limits": True}, "limits: this is for drives"),
        ({"minimise": "heat"}, "minimise = heat: on a chain"),
        ({"smoothness": 0.1}, "smoothness = 0.1"),
        ({"terminal": "steedy"}, "terminal = 'steedy'"),
        ({"seeds": []}, "seeds: the list is empty"),
        ({"start_time": -1.0}, "start_time = -1.0"),
    ],
)
def test_what_a_chain_does_not_take_is_refused(changes, sentence):
    with pytest.raises(InputError, match=sentence):
        optimize(damped(), **{"start_time": 0.42, **changes})


def test_what_stands_in_the_way_on_the_chain_is_refused():
    chain = damped()
    for wrong, sentence in (
        (dataclasses.replace(chain, motor=None), r"\[motor\] is missing"),
        (dataclasses.replace(chain, position="unknown"), "position = unknown"),
    ):
        with pytest.raises(InputError, match=sentence):
            optimize(wrong, 0.42)


def test_a_start_time_before_any_shaft_can_pull_has_a_verdict():
    with pytest.raises(InfeasibleError, match="no shaft drives the load before") as caught:
        optimize(damped(), 0.005)
    assert caught.value.verdict.shortest_start_time == pytest.approx(0.00914, rel=1e-3)
    with pytest.raises(OptimumError, match=r"reaches the target speed after 0\.36"):
        optimize(damped(), 0.2, seeds=["direct"])


def test_seeds_are_for_chains():
    with pytest.raises(InputError, match="seeds = "):
        optimize("crane-4amtkf", 0.3, seeds=["direct"])


def test_a_demand_is_sampled_with_its_impulse():
    search = Search(ChainProblem(damped(), 0.42), Player(damped()))
    time = np.linspace(0.0, search.until, 5001)
    torque = 30.0 + 20.0 * np.sin(40.0 * time)
    sampled = search.profile(search.sampled(time, torque))
    for until in (0.1, 0.3):
        ours, theirs = (np.trapezoid(np.interp(time, t, u)[time < until], time[time < until])
                        for t, u in ((sampled.time, sampled.torque), (time, torque)))  # fmt: skip
        assert ours == pytest.approx(theirs, rel=2e-3)


def test_an_undamped_chain_is_approached_through_damped_ones():
    chain = dataclasses.replace(
        without_gaps(),
        shafts=(Shaft(3000.0, gap=0.02), Shaft(2000.0, gap=0.02)),
        masses=(Mass(0.1), Mass(0.02), Mass(0.4, torque=10.0)),
    )
    assert chain.warnings
    best = optimize(chain, 0.2, seeds=["s-curve"], tolerance=0.05, time_limit=0.0)
    assert "similar problem" in best.why or "s-curve" in best.why
    assert best.bound.k_dyn <= best.k_dyn <= simulate(chain, "direct").k_dyn


def test_the_global_search_is_repeatable_and_named_where_it_is_missing(monkeypatch):
    pytest.importorskip("cma")
    search = Search(ChainProblem(damped(), 0.42), Player(damped()))
    one, two = (global_search.found(search, 3, evaluations=96)[1] for _ in range(2))
    np.testing.assert_array_equal(one, two)
    assert one.min() >= 0.0
    assert one.max() <= 62.0
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(InputError, match=r"needs the package cma.*softstart\[search\]"):
        optimize(damped(), 0.42, seeds=["cma"])


@pytest.mark.slow
def test_a_front_over_start_times_falls():
    chain = without_gaps()
    front = pareto(chain, [0.25, 0.3, 0.4], controllers=["direct"])
    values = [point.k_dyn for point in front.points]
    assert values == sorted(values, reverse=True)
    assert all(point.k_dyn >= point.k_dyn_lower_bound for point in front.points)
    assert front.controllers[0].ratio is None or front.controllers[0].ratio >= 1.0 - 1e-3


def loaded(*, held=False, **load):
    """Three masses with two gaps; `load` is that of the last, which `held` ties to ground by a soft shaft."""
    masses = [Mass(0.1), Mass(0.02), Mass(0.4, **load)]
    shafts = [Shaft(3000.0, damping_ratio=0.02, gap=0.05), Shaft(2000.0, damping_ratio=0.02, gap=0.05)]
    if held:
        masses, shafts = [*masses, Mass("inf", name="ground")], [*shafts, Shaft(5.0, damping=0.05)]
    return Chain(masses, shafts, Motor(100.0), target_speed=10.0 if held else 20.0)


@pytest.mark.parametrize(
    "chain",
    [
        loaded(torque=5.0, curve_speed=[0.0, 8.0, 30.0], curve_torque=[0.0, 10.0, 40.0]),
        loaded(curve_speed=[-1.0, 1.0, 5.0, 30.0], curve_torque=[-30.0, 30.0, 15.0, 20.0]),
        loaded(held=True),
    ],
    ids=["fan", "falling", "ground"],
)
def test_load_curves_and_ground(chain):
    """K_dyn replays exactly, no strategy as quick is gentler, and the bound says what it covers."""
    best = optimize(chain, 0.25, time_limit=0.0)
    until = 0.25 + best.run.elastic_period
    again = simulate(chain, "profile", until, parameters={"profile": best.profile})
    assert again.k_dyn == pytest.approx(best.claimed, rel=1e-6)
    assert float(again.at(best.end_time)["w"][chain.load_index]) >= chain.target_speed * (1.0 - 1e-6)
    for name in ("direct", "s-curve", "ramp", "take-up"):
        run = simulate(chain, name)
        assert not run.start_time <= best.end_time or run.k_dyn > best.k_dyn
    if chain.masses[2].curve is None:
        assert best.bound.kind == "momentum"
        assert 0.0 < best.bound.k_dyn < best.k_dyn
    else:
        assert (best.bound.kind, best.bound.k_dyn) == ("none", 0.0)
        assert "follows a curve" in best.bound.covers
        assert best.summary()["k_dyn_lower_bound"] is None


def test_load_curves_over_angles_are_refused():
    with pytest.raises(InputError, match="curve_angle: an optimum is not found"):
        optimize(loaded(curve_angle=[0.0, 1.0], curve_torque=[0.0, 10.0]), 0.25)


def test_a_chain_that_never_reaches_its_speed_is_told():
    """Tied to ground by a stiff shaft: neither the search nor full torque gets there."""
    chain = dataclasses.replace(loaded(held=True), shafts=(*loaded(held=True).shafts[:2], Shaft(1e6)))
    with pytest.raises(OptimumError, match="never reaches the target speed"):
        optimize(chain, 0.25, time_limit=0.0, seeds=["direct"])
