"""The quickest start that keeps the limits: against closed form, collocation, bounds and strategies."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
import pytest
from tests.softstart.kernel.test_brake import HOIST

from softstart import Drive, InputError, TorqueProfile, compare, optimize, simulate
from softstart.controller import ready_controller_names
from softstart.optimal.collocation import search as collocation
from softstart.optimal.momentum import momentum_bound
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import PulseCoastHold
from softstart.optimal.result import InfeasibleError, Optimum
from softstart.views.optima import bound_sentence, comparison, question

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
HELD = HOIST.replace(brake="motor", start_position="hanging", permissible_torque=175.0)
# a permissible start time is held against the answer only: tests of other limits share it
IN_TIME = HELD.replace(permissible_start_time=0.3)
TOO_LATE = HELD.replace(permissible_torque=153.0, permissible_start_time=0.2)


@pytest.fixture(scope="module", autouse=True)
def collocated_once() -> Iterator[None]:
    """What collocation finds is also where the search for the least start time begins: the same program."""
    solve = cache(collocation.solve)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(collocation, "solve", lambda problem, warm=None: solve(problem))  # none is warm here
        yield


@cache
def quickest(drive: Drive) -> Optimum:
    """The answer, which several tests look at."""
    return optimize(drive, limits=True)


@pytest.mark.parametrize("torque", [25.0, 40.0, 50.0])
def test_where_a_formula_is_exact_the_bound_is_reached(torque: float) -> None:
    best = optimize(CRANE.replace(permissible_torque=torque), limits=True)
    assert best.kept is not None
    assert best.run.peak_torque == pytest.approx(torque, rel=1e-5)
    assert best.run.peak_torque <= torque
    assert best.kept.at_least <= best.end_time <= best.kept.at_least * (1.0 + 1e-5)
    assert (best.kept.binding, best.kept.kept) == ("shaft torque", True)
    formula = PulseCoastHold.of(best.problem).least_peak_for(60.0, best.end_time)
    assert formula == pytest.approx(torque, rel=1e-5)


@pytest.mark.slow
def test_it_is_the_least_start_time_that_collocation_finds() -> None:
    torque = 60.0
    best = quickest(CRANE.replace(permissible_torque=torque))
    k_dyn = torque / CRANE.mean_torque
    other = optimize(CRANE, minimise="start_time", k_dyn=k_dyn, method="collocation")
    assert other.method == "collocation"
    assert best.end_time == pytest.approx(other.end_time, rel=2e-3)


@pytest.mark.parametrize("k_dyn", [0.95, 1.0])
def test_the_least_start_time_is_the_root_of_the_formula(k_dyn: float) -> None:
    best = optimize(CRANE, minimise="start_time", k_dyn=k_dyn)
    assert best.kept is not None
    assert best.k_dyn <= k_dyn
    assert best.kept.at_least <= best.end_time <= best.kept.at_least * (1.0 + 2e-5)
    assert best.minimised == best.end_time == best.summary()["start_time"]
    assert best.gap_percent == pytest.approx(100.0 * (best.end_time / best.kept.at_least - 1.0))
    formula = PulseCoastHold.of(best.problem).least_peak_for(60.0, best.end_time)
    assert formula == pytest.approx(k_dyn * CRANE.mean_torque, rel=2e-5)
    assert momentum_bound(Problem(CRANE, 0.9999 * best.kept.at_least)).k_dyn > k_dyn


@pytest.mark.slow
@pytest.mark.parametrize(
    ("drive", "k_dyn", "others"),
    [
        (CRANE.replace(torque_lag=0.005), 1.1, {}),
        (CRANE.replace(damping=1.0), 1.05, {"torque_speed": ((0.0, 62.0), (60.0, 45.0))}),
        (CRANE, None, {}),
    ],
)
def test_the_least_start_time_is_that_of_the_casadi_problem(
    drive: Drive, k_dyn: float | None, others: dict[str, Any]
) -> None:
    """No later, but for its mesh, and the K_dyn is kept, to which a mesh keeps within 0.1 % only."""
    best = optimize(drive, minimise="start_time", k_dyn=k_dyn, **others)
    other = optimize(drive, minimise="start_time", k_dyn=k_dyn, method="collocation", **others)
    assert other.method == "collocation"
    assert best.k_dyn <= (k_dyn or np.inf)
    assert best.end_time == pytest.approx(other.end_time, rel=2e-4)
    assert best.kept is not None
    assert best.kept.at_least <= min(best.end_time, other.end_time)


def test_a_least_start_time_where_collocation_does_not_converge() -> None:
    """The hoist under its brake: the roots of the programs need no mesh."""
    best = optimize("hoist-15kw", minimise="start_time", k_dyn=1.05)
    assert [(one.method, one.value is None) for one in best.tried] == [("collocation", True), ("lp", False)]
    assert best.k_dyn <= 1.05
    assert 0.0 <= best.gap_percent < 0.05
    assert question(best) == "least start time, K_dyn at most 1.05, terminal synchronous"
    assert comparison(best, []).startswith(
        "Least start time: 0.2019 s, K_dyn 1.050. The bound of K_dyn forbids"
    )


@pytest.mark.slow
def test_a_k_dyn_that_no_start_has_is_refused() -> None:
    with pytest.raises(InfeasibleError, match=r"no start of Crane .* with K_dyn of 0.1 or less was found"):
        optimize(CRANE, minimise="start_time", k_dyn=0.1)


@pytest.mark.parametrize(
    "drive",
    [
        IN_TIME,
        pytest.param(HELD.replace(torque_lag=0.005), marks=pytest.mark.slow),
        TOO_LATE,
        CRANE.replace(permissible_torque=60.0),
        pytest.param(CRANE.replace(permissible_torque=45.0, load_kind="reactive"), marks=pytest.mark.slow),
    ],
)
def test_nothing_keeps_the_limits_in_less_time(drive: Drive) -> None:
    """Shorter optima, the answer's own torque shaken, and all shipped strategies."""
    best = quickest(drive)
    assert best.kept is not None
    most = drive.limits.shaft_torque
    assert most is not None
    assert best.run.peak_torque <= most
    assert best.kept.at_least <= best.end_time
    with suppress(InfeasibleError):
        assert optimize(drive, 0.998 * best.end_time, time_limit=0.0).run.peak_torque > most
    rng = np.random.default_rng(14)
    for _ in range(40):
        torque = best.profile.torque * (1.0 + 0.05 * rng.standard_normal(best.profile.torque.size))
        shaken = TorqueProfile(best.profile.time, np.clip(torque, 0.0, drive.Ms))
        run = simulate(drive, "profile", parameters={"profile": shaken})
        keeps = run.peak_torque <= most and run.contacts == 1
        assert not (keeps and run.start_time < best.kept.at_least * (1.0 - 1e-9))
    for name in ready_controller_names():
        run = simulate(drive, name)
        keeps = run.peak_torque <= most and run.contacts <= 1
        assert not (keeps and run.start_time < best.kept.at_least * (1.0 - 1e-9)), name


@pytest.mark.slow
def test_a_life_that_is_asked_for_may_be_what_forbids_a_quicker_start() -> None:
    curve: dict[str, Any] = {"fatigue_slope": 6.6, "fatigue_torque": (90.0,), "fatigue_cycles": (2e6,)}
    life = {"starts_per_hour": 600.0, "required_life": 3600.0 * 2e5}
    drive = HELD.replace(**curve, **life)
    best = optimize(drive, limits=True)
    assert best.kept is not None
    used = {one.name: one.value for one in best.kept.margins}
    assert best.kept.binding == "used life"
    assert used["used life"] == pytest.approx(100.0, rel=2e-4)
    assert used["used life"] <= 100.0
    assert used["shaft torque"] < 170.0
    assert best.end_time > quickest(IN_TIME).end_time
    alone = optimize(drive.replace(permissible_torque=None), limits=True)  # nothing bounds its K_dyn
    assert alone.kept is not None
    assert [one.name for one in alone.kept.margins] == ["used life"]
    assert alone.end_time == pytest.approx(best.end_time, rel=1e-4)


@pytest.mark.slow
def test_an_unknown_position_keeps_the_limits_from_each(hasty_search: None) -> None:
    """One profile, the peak and the start time the worst of three; in less time momentum forbids it."""
    drive = CRANE.replace(gap=0.02, start_position="unknown", target_speed=30.0, permissible_torque=70.0)
    best = optimize(drive, limits=True, time_limit=0.0)
    assert best.kept is not None
    played = {"parameters": {"profile": best.profile}}
    each = [simulate(one, "profile", **played) for one in drive.positions.values()]
    assert best.method == "robust"
    assert max(run.peak_torque for run in each) == best.run.peak_torque <= 70.0
    assert max(run.start_time for run in each) == best.run.start_time == best.end_time
    (margin,) = best.kept.margins
    assert margin.share == pytest.approx(1.0 - best.run.peak_torque / 70.0)
    assert 0.0 < best.kept.at_least <= best.end_time
    sooner = 0.999 * best.kept.at_least
    hardest = max(momentum_bound(Problem(one, sooner, "reached")).k_dyn for one in drive.positions.values())
    assert hardest * drive.mean_torque > 70.0


def test_margins_are_those_of_compare() -> None:
    best = quickest(IN_TIME)
    played = compare(IN_TIME, [best.run.controller], worst_case=[]).rows[0].margins(IN_TIME.limits)
    assert best.kept is not None
    assert [str(one) for one in best.kept.margins] == [str(one) for one in played]
    assert best.summary()["limits"]["margins"] == [one.summary() for one in best.kept.margins]


def test_a_start_time_that_cannot_be_kept_is_said() -> None:
    best = quickest(TOO_LATE)
    assert best.kept is not None
    assert not best.kept.kept
    assert best.kept.at_least > 0.2  # a proof that no start with one contact keeps both
    assert comparison(best, []).startswith(
        "No start keeps all limits. Least start time that keeps the others"
    )
    assert question(best).startswith("least start time that keeps the limits (shaft torque 153 N m, start")


@pytest.mark.slow
def test_with_wide_limits_the_motor_torque_is_what_forbids_a_quicker_start() -> None:
    drive = CRANE.replace(permissible_torque=1000.0)
    best = optimize(drive, limits=True)
    assert best.kept is not None
    assert best.kept.binding == ""
    assert best.end_time == pytest.approx(0.2498, abs=1e-4)  # the shortest start with one contact
    direct = simulate(drive, "direct")
    assert best.kept.at_least < direct.start_time < best.end_time
    said = comparison(best, [direct])
    assert "No limit forbids a quicker start" in said
    assert f"direct, takes 0.2403 s, with {direct.contacts} contacts" in said
    assert "however often the gap closes" in bound_sentence(best)


@pytest.mark.parametrize(
    ("drive", "given", "said"),
    [
        (CRANE, {}, "limits: .* has no permissible shaft torque; give limits.shaft_torque in its file"),
        (CRANE.replace(permissible_start_time=0.3), {}, "has no permissible shaft torque"),
        (HELD, {"start_time": 0.3}, "start_time: limits asks for the least start time; leave this out"),
        (HELD, {"minimise": "heat"}, "minimise: limits asks"),
        (HELD, {"confirm": True}, "confirm: limits asks"),
    ],
)
def test_what_cannot_be_asked_is_refused(drive: Drive, given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        optimize(drive, limits=True, **given)


@pytest.mark.parametrize("share", [0.4, 1.5])
def test_a_brake_that_is_released_late_is_no_bound_on_the_start_time(share: float) -> None:
    """Momentum rules out no start time beforehand; the answer is later than the release all the same."""
    drive = HELD.replace(release=share * HELD.elastic_period, target_speed=20.0, permissible_torque=180.0)
    best = optimize(drive, limits=True, time_limit=0.0)
    assert best.kept is not None
    assert best.run.peak_torque <= 180.0
    assert 0.0 <= best.kept.at_least <= best.end_time
    assert best.end_time > drive.release


def test_a_torque_that_no_start_keeps_is_proved_so() -> None:
    """The active load falls back through half the gap and hits harder than 9 N m by itself."""
    with pytest.raises(
        InfeasibleError, match=r"keeps them \(shaft torque 9 N m\): within .* has a peak below"
    ):
        optimize(CRANE.replace(permissible_torque=9.0), limits=True)
