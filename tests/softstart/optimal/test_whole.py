"""The linear program of the whole start: against an independent integrator, the other methods, and itself.

A torque that lags less, rises faster or may brake more can do all that the other one can: P is ordered.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from tests.softstart.optimal.test_collocation_march import march

from softstart import Drive, optimize
from softstart.errors import InputError
from softstart.optimal import pulse_coast_hold
from softstart.optimal.collocation import search as collocation
from softstart.optimal.exact import replay, torque_allowed, with_tail
from softstart.optimal.lp import ideal, whole_search
from softstart.optimal.lp.whole import Instants, WholeProgram
from softstart.optimal.lp.whole_search import phase_orders
from softstart.optimal.problem import Problem, Terminal
from softstart.optimal.result import InfeasibleError
from softstart.optimal.shortest import shortest_start_time

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
REACTIVE = CRANE.replace(load_kind="reactive")
CURVE = ((0.0, 62.0), (40.0, 62.0), (90.0, 40.0))

CASES: dict[str, tuple[Drive, float, Terminal, tuple[tuple[float, float], ...]]] = {
    "lag": (CRANE.replace(torque_lag=0.005), 0.29, "synchronous", ()),
    "lag, reached": (CRANE.replace(torque_lag=0.005), 0.27, "reached", ()),
    "lag, steady": (CRANE.replace(torque_lag=0.003), 0.3, "steady", ()),
    "rate": (CRANE.replace(torque_rate=3000.0), 0.3, "synchronous", ()),
    "lag and rate, reached": (CRANE.replace(torque_rate=4000.0, torque_lag=0.002), 0.29, "reached", ()),
    "brake": (CRANE.replace(minimum_torque=-30.0), 0.26, "synchronous", ()),
    "curve": (CRANE, 0.3, "synchronous", CURVE),
    "damped, lag": (CRANE.replace(damping=0.5, torque_lag=0.004), 0.28, "reached", ()),
    "dead-zone, brake": (
        CRANE.replace(damping=0.5, contact_law="dead-zone", minimum_torque=-10.0), 0.27, "synchronous", ()
    ),
    "reactive, lag": (REACTIVE.replace(torque_lag=0.005), 0.3, "reached", ()),
    "reactive, damped": (REACTIVE.replace(damping=0.5), 0.27, "synchronous", ()),
    "reactive, pressed in at once": (REACTIVE.replace(damping=6.0, load_torque=5.0), 0.29, "steady", ()),
    "reactive, touching": (
        REACTIVE.replace(torque_lag=0.004, start_position=0.25), 0.28, "synchronous", ()
    ),
    "touching, lag": (CRANE.replace(torque_lag=0.004, start_position=0.25), 0.28, "synchronous", ()),
}  # fmt: skip
LONG = dict.fromkeys(("lag", "reactive, lag", "reactive, pressed in at once"), pytest.mark.slow)


@pytest.mark.parametrize("case", [pytest.param(case, marks=LONG.get(case, ())) for case in CASES])
def test_others_see_the_same_start(
    case: str, monkeypatch: pytest.MonkeyPatch, small_certificate: None
) -> None:
    """An independent integrator, the exact plant with every limit, and for some cases collocation.

    `optimize` takes what the program finds, and holds it to all its promises: limits, contacts, terminal,
    peak after t_f.
    """
    drive, end, terminal, curve = CASES[case]
    problem = Problem(drive, end, terminal, torque_speed=curve)
    found = []

    def noted(*given: Any) -> Any:
        found.append(searched(*given))
        return found[-1]

    searched = whole_search.search
    monkeypatch.setattr(whole_search, "search", noted)
    best = optimize(drive, end, terminal=terminal, torque_speed=curve, time_limit=0.0)
    assert best.method == "lp"
    assert best.run.contacts == 1
    assert best.claimed == pytest.approx(best.k_dyn, rel=3e-4)
    assert best.k_dyn >= best.k_dyn_lower_bound * (1.0 - 1e-5)
    (answer,) = found
    an_independent_integrator_agrees(problem, answer)
    if case in ("lag", "rate", "brake", "reactive, lag"):
        other = collocation.solve(problem)
        assert answer.P / problem.base_torque <= other.claimed * (1.0 + 3e-4)
        assert answer.P / problem.base_torque >= other.claimed * (1.0 - 5e-3)


def an_independent_integrator_agrees(problem: Problem, best: Any) -> None:
    profile, end = best.profile(problem), best.at.end
    assert end <= problem.start_time * (1.0 + 1e-12)
    path = march(problem.drive, profile, end)
    assert path.w2 == pytest.approx(problem.target, rel=1e-6)
    assert path.opened == 0
    assert path.peak <= best.P * (1.0 + 2e-4)
    if problem.terminal != "reached":  # else the peak may come after t_f
        assert path.peak == pytest.approx(best.P, rel=3e-4)
        assert path.v == pytest.approx(0.0, abs=1e-6 * problem.target)
    if not problem.drive.theta0 >= 0.5 * problem.drive.gap:
        assert path.contact == pytest.approx(best.at.tc, rel=1e-6)


IDEAL: dict[str, tuple[dict[str, Any], float, Terminal]] = {
    "bang-bang": ({}, 0.2522662, "synchronous"),
    "reached": ({}, 0.2522662, "reached"),
    "steady": ({"damping": 0.5}, 0.3, "steady"),
    "dead-zone": ({"damping": 0.5, "contact_law": "dead-zone"}, 0.27, "synchronous"),
    "reactive": ({"load_kind": "reactive"}, 0.27, "synchronous"),
}


@pytest.mark.parametrize(("given", "end", "terminal"), IDEAL.values(), ids=IDEAL)
def test_without_a_lag_it_is_the_program_from_the_contact_on(
    given: dict[str, Any], end: float, terminal: Terminal
) -> None:
    problem = Problem(CRANE.replace(**given), end, terminal)
    whole_start, from_contact = whole_search.search(problem), ideal.search(problem)
    assert whole_start is not None
    assert from_contact is not None
    assert pytest.approx(from_contact.P, rel=3e-4) == whole_start.P


def test_pulse_coast_hold_comes_out() -> None:
    problem = Problem(CRANE, 0.33)
    best = whole_search.search(problem)
    assert best is not None
    truth = pulse_coast_hold.solve(problem).claimed
    assert truth * (1.0 - 1e-5) <= best.P / problem.base_torque <= truth * (1.0 + 4e-4)


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("torque_lag", [1e-7, 0.003, 0.02]),
        ("torque_rate", [1e7, 5e3, 1.5e3]),
        ("minimum_torque", [-62.0, -10.0, 0.0]),
    ],
)
def test_what_can_do_less_starts_no_gentler(key: str, values: list[float]) -> None:
    peaks = []
    for value in values:
        best = whole_search.search(Problem(CRANE.replace(**{key: value}), 0.32))
        assert best is not None
        peaks.append(best.P)
    assert all(after >= before * (1.0 - 1e-4) for before, after in pairwise(peaks))
    assert peaks[-1] > peaks[0] * 1.002
    if key != "minimum_torque":  # hardly any lag, hardly any limit of the rate: the ideal torque
        assert peaks[0] == pytest.approx(pulse_coast_hold.solve(Problem(CRANE, 0.32)).claimed
                                         * Problem(CRANE, 0.32).base_torque, rel=5e-4)  # fmt: skip


def test_units_do_not_matter() -> None:
    """Torques 1000-fold, times 1/50: the same start, to the accuracy of the search."""
    k, s = 1e3, 0.02
    drive = CRANE.replace(torque_lag=0.004)
    other = drive.replace(
        motor_inertia=drive.J1 * k * s * s, load_inertia=drive.J2 * k * s * s, stiffness=drive.c * k,
        starting_torque=drive.Ms * k, maximum_torque=drive.maximum_torque * k, load_torque=drive.Mc * k,
        target_speed=60.0 / s, torque_lag=0.004 * s,
    )  # fmt: skip
    here, there = whole_search.solve(Problem(drive, 0.29)), whole_search.solve(Problem(other, 0.29 * s))
    assert here is not None
    assert there is not None
    assert there.claimed == pytest.approx(here.claimed, rel=2e-5)


@pytest.mark.parametrize(
    "given",
    [
        {"torque_lag": 0.005},
        pytest.param({"load_kind": "reactive", "damping": 0.5}, marks=pytest.mark.slow),
        pytest.param({"torque_rate": 3e3}, marks=pytest.mark.slow),
    ],
)
def test_the_shortest_start_time_parts_what_can_be_from_what_cannot(given: dict[str, Any]) -> None:
    drive = CRANE.replace(**given)
    shortest = shortest_start_time(Problem(drive, minimise="start_time"))
    assert whole_search.search(Problem(drive, 1.003 * shortest)) is not None
    with pytest.raises(InfeasibleError) as told:
        optimize(drive, 0.997 * shortest)
    assert told.value.verdict.shortest_start_time == pytest.approx(shortest, rel=1e-5)


@pytest.mark.parametrize("damping", [0.1, 0.5])
def test_a_steady_end_without_load_torque_takes_little_longer(damping: float) -> None:
    """T and w1 - w2 vanish together only as exp(-c t/d) while the shaft pushes."""
    idle = CRANE.replace(load_torque=0.0, torque_rate=2e4, damping=damping)
    loaded = idle.replace(load_torque=0.1)
    longer, shorter = (shortest_start_time(Problem(drive, 1.0, "steady")) for drive in (idle, loaded))
    decay = damping / float(idle.c) * math.log(0.1 / 1e-3)  # on from the smaller torque to 1 mN m
    momentum = shorter * 0.1 / float(idle.Ms)  # spent against it
    assert shorter - 2.0 * momentum <= longer <= shorter + decay


@pytest.mark.parametrize("terminal", ["synchronous", "reached"])
def test_a_torque_that_lags_stays_below_the_curve_after_the_start(terminal: Terminal) -> None:
    """At t_f the torque is on the curve, which falls on, and the demand is above the torque."""
    drive = Drive(
        motor_inertia=0.38, load_inertia=2.86, starting_torque=5.8, minimum_torque=-2.9, load_torque=0.0,
        stiffness=1.08e4, gap=0.005, start_position=-0.0025, load_kind="reactive", target_speed=0.0592,
        torque_lag=5.6e-4, torque_rate=500.0,
    )  # fmt: skip
    curve = ((0.0, 5.8), (0.0415, 5.51), (0.1185, 1.74))
    problem, at = Problem(drive, 0.0927, terminal, torque_speed=curve), Instants(0.0486, 0.0486, 0.0927)
    grid = whole_search.first_grid(problem, next(phase_orders(problem)), at, 80)
    found = WholeProgram(problem, at, grid).solve()
    assert found is not None
    later = at.end + float(drive.elastic_period) * np.linspace(0.0, 1.0, 2000)
    run = replay(drive, with_tail(problem, found.profile(problem), at.end), float(later[-1]))
    left = torque_allowed(problem, run.at(later)["w1"]) - run.at(later)["u"]
    assert left.min() > 0.0
    assert left[0] < 1e-4 * drive.Ms  # else it tests nothing


def test_more_time_than_the_load_leaves_is_not_used() -> None:
    """An active load comes back by itself: however much time there is, the gap is closed after a while."""
    drive = CRANE.replace(torque_lag=0.004)
    best, longer = (whole_search.search(Problem(drive, end)) for end in (1.2, 4.0))
    assert best is not None
    assert longer is not None
    assert longer.at.end <= 4.0
    assert longer.P <= best.P * (1.0 + 1e-4)
    assert longer.at.tc < math.sqrt(2.0 * drive.gap * drive.J2 / drive.Mc)


def test_finer_grids_change_little(monkeypatch: pytest.MonkeyPatch) -> None:
    drive, end, terminal, _ = CASES["lag"]
    problem = Problem(drive, end, terminal)
    best = whole_search.search(problem)
    assert best is not None
    for name, value in (
        ("COARSE", 60),
        ("MIDDLE", 160),
        ("REFINEMENT", replace(whole_search.REFINEMENT, most=400)),
    ):
        monkeypatch.setattr(whole_search, name, value)
    finer = whole_search.search(problem)
    assert finer is not None
    assert pytest.approx(best.P, rel=2e-4) == finer.P
    assert finer.P <= best.P * (1.0 + 5e-5)


@pytest.mark.slow
def test_windings_are_tried_where_full_torque_needs_none() -> None:
    """A damped impact under full torque breaks the load away at once; the gentlest start winds it up."""
    drive = Drive(
        motor_inertia=0.010638, starting_torque=4.8655, torque_lag=0.020356, torque_rate=57.06,
        stiffness=3.8355, damping=0.06246, gap=7.9476, load_inertia=0.015795, load_torque=2.3819,
        load_kind="reactive", target_speed=15.4946, start_position=-3.9738,
    )  # fmt: skip
    curve = ((0.0, 4.8655), (10.846, 4.6222), (30.989, 1.4596))
    problem = Problem(drive, 0.5062, "reached", torque_speed=curve)
    best = whole_search.search(problem)
    assert best is not None
    assert best.at.tb - best.at.tc > 0.003
    impact = next(order for order in phase_orders(problem) if "stuck" not in order.kinds)
    hard = whole_search._Timings(problem, impact, 0.5062, 40).best(0.5062)
    assert hard is not None
    assert best.P < 0.9 * hard.P


@pytest.mark.parametrize(
    ("drive", "options", "why"),
    [
        (CRANE, {"smoothness": 1e-4}, "the weight on the smoothness is not linear"),
        (CRANE, {"heat": 1.0}, "a bound on the heat is not linear"),
        (CRANE, {"minimise": "heat"}, "only K_dyn is linear"),
        (CRANE.replace(contact_law="modelica", damping=0.5), {}, "modelica"),
        (CRANE.replace(start_position=-0.3), {}, "far flank"),
        (CRANE.replace(start_position=0.3, initial_load_speed=1.0), {}, "part at once"),
        (REACTIVE.replace(initial_load_speed=1.0, initial_motor_speed=1.0), {}, "moves before"),
        (REACTIVE.replace(start_position=2.0), {}, "wound up"),
    ],
)
def test_what_is_not_linear_is_named(drive: Drive, options: dict[str, Any], why: str) -> None:
    problem = Problem(drive, 0.4, **options)
    assert why in whole_search.not_linear(problem)
    with pytest.raises(InputError, match=r"method = lp: .*; use method = collocation"):
        optimize(drive, 0.4, method="lp", **options)


@pytest.mark.parametrize(
    "name", [pytest.param("servo-axis-small", marks=pytest.mark.slow), "nordin-servo-60kw"]
)
def test_the_drives_with_a_lag_that_come_along_have_optima(name: str, small_certificate: None) -> None:
    drive = Drive.load(name)
    shortest = shortest_start_time(Problem(drive, terminal="reached", minimise="start_time"))
    ratios = []
    for share in (1.02, 1.2, 1.6):
        best = optimize(drive, share * shortest, terminal="reached", time_limit=0.0)
        ratios.append(best.k_dyn / best.k_dyn_lower_bound)
    assert np.all(np.array(ratios) >= 1.0 - 1e-5)
    assert ratios[-1] < 1.03  # with time enough the bound of an ideal torque is nearly met
