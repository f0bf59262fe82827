"""The certificate behind lag, rate limit and friction is attacked: no start is below what it proves.

`python tests/robustness/test_optima.py` lists the gap between optimum and bound on random drives.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq, linprog

from softstart import Drive, TorqueProfile, optimize
from softstart.optimal.exact import replay
from softstart.optimal.momentum import momentum_bound
from softstart.optimal.problem import Problem
from softstart.optimal.whole_certificate import _Cells, _Program, dual_at, not_certified, whole_bound
from softstart.optimal.whole_dual import Dual, Start, _freely, _take, _value
from softstart.start.run import Run

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
TORQUES = 250  # for each class
CURVE = ((0.0, 62.0), (30.0, 60.0), (80.0, 20.0))
STEEP = ((0.0, 62.0), (12.0, 55.0), (70.0, 10.0))  # less torque before the contact already


def random_drive(rng: np.random.Generator) -> tuple[Drive, dict[str, Any]]:
    """A drive of any class, at rest, and the options of its optimum."""
    J1, Ms = 10 ** rng.uniform(-3, 0), 10 ** rng.uniform(0, 3)
    J2 = J1 * 10 ** rng.uniform(-0.5, 1.3)
    Omega = 2.0 * math.pi * 10 ** rng.uniform(0.5, 1.8)
    c = Omega**2 * J1 * J2 / (J1 + J2)
    Mc = Ms * rng.choice([0.0, rng.uniform(0.05, 0.6)])
    target = (Ms - Mc) / (J1 + J2) * 2.0 * math.pi / Omega * 10 ** rng.uniform(-0.3, 0.7)
    gap = Ms / c * 10 ** rng.uniform(-1.0, 1.0)
    drive = Drive(
        motor_inertia=J1, load_inertia=J2, starting_torque=Ms, load_torque=Mc, stiffness=c, gap=gap,
        load_kind=rng.choice(["active", "reactive"]).item(), target_speed=target,
        damping=2.0 * rng.choice([0.0, 0.02, 0.2]) * c / Omega,
        minimum_torque=-Ms * rng.choice([0.0, 0.0, 0.5]),
        torque_lag=rng.choice([0.0, 0.1, 0.5]) / Omega,
        torque_rate=rng.choice([math.inf, math.inf, 3.0]) * Ms * Omega / (2.0 * math.pi),
        start_position=gap * rng.choice([-0.5, 0.0, 0.5]),
    )  # fmt: skip
    options: dict[str, Any] = {"terminal": rng.choice(["synchronous", "steady", "reached"]).item()}
    if rng.random() < 0.25:
        options["torque_speed"] = ((0.0, Ms), (0.7 * target, 0.95 * Ms), (2.0 * target, 0.3 * Ms))
    return drive, options


# any multipliers, any start: the cell in which it lies proves less ------------------------------------------


def durations(run: Run, start: Start, te: float) -> tuple[float, float, float] | None:
    """(in the gap, winding up, in contact) in steps of a start of the class; None if it is none."""
    events = [event for event in run.events if event.time <= te + start.tail * start.h]
    closed = sum(event.kind == "gap closed" for event in events)
    if closed > 1 or (start.open and closed == 0):
        return None
    if any(event.kind in ("gap opened", "load stops") for event in events):
        return None
    tc = run.first_contact if start.open else 0.0
    moved = [event.time for event in events if event.kind == "load starts"]
    tb = moved[0] if start.rests and moved else tc
    if start.rests and not moved:
        return None
    return (tc / start.h, (tb - tc) / start.h, (te - tb) / start.h) if tb < te else None


def gentle_torque(rng: np.random.Generator, drive: Drive) -> TorqueProfile:
    """Little torque at first, mostly, so that the gap closes once; then more, in steps or ramps."""
    low, high, few = float(drive.minimum_torque), float(drive.Ms), int(rng.integers(1, 9))
    first = rng.uniform(0.0, 0.12, 2) * rng.choice([0.0, 1.0], 2)
    levels = [0.0, rng.uniform(max(low, -0.1 * high), 0.4 * high), *rng.uniform(0.5 * high, high, few)]
    times = np.cumsum([*first, *rng.uniform(0.01, 0.1, few)])
    if rng.random() < 0.4:
        return TorqueProfile(
            np.concatenate([[0.0], times + 1e-4 * np.arange(1, times.size + 1)]), [0.0, *levels]
        )
    return TorqueProfile.steps(np.concatenate([[0.0], times + 1e-6 * np.arange(1, times.size + 1)]), levels)


CLASSES: list[tuple[dict[str, Any], dict[str, Any]]] = [
    ({"torque_lag": 0.005}, {}),
    ({"torque_lag": 0.01, "damping": 1.5}, {"terminal": "reached"}),
    ({"torque_rate": 2000.0}, {}),
    ({"torque_rate": 2000.0, "damping": 0.5}, {"terminal": "steady"}),  # held: undamped, the gap opens again
    ({"torque_rate": 2500.0, "torque_lag": 0.004, "damping": 1.0}, {"terminal": "steady"}),
    ({"torque_rate": 3000.0, "torque_lag": 0.004, "start_position": 0.25}, {}),
    ({"minimum_torque": -20.0, "torque_lag": 0.003, "damping": 0.5}, {"terminal": "reached"}),
    ({"damping": 1.0}, {"torque_speed": CURVE}),
    ({"torque_lag": 0.006}, {"torque_speed": CURVE, "terminal": "reached"}),
    ({"torque_rate": 2500.0, "damping": 0.5}, {"torque_speed": STEEP}),
    ({"torque_lag": 0.006, "start_position": -0.25}, {"torque_speed": STEEP, "terminal": "reached"}),
    ({"load_kind": "reactive", "torque_lag": 0.005}, {}),
    ({"load_kind": "reactive", "torque_lag": 0.005, "torque_rate": 3e3}, {"torque_speed": STEEP}),
    ({"load_kind": "reactive", "damping": 1.0}, {"torque_speed": STEEP, "terminal": "reached"}),
    ({"load_kind": "reactive", "damping": 1.0}, {}),
    ({"load_kind": "reactive", "damping": 2.0, "torque_lag": 0.005, "minimum_torque": -10.0}, {}),
    ({"load_kind": "reactive", "torque_rate": 2500.0, "damping": 0.5}, {"terminal": "reached"}),
    ({"load_kind": "reactive", "torque_lag": 0.01, "start_position": 0.25}, {}),
    ({"load_kind": "reactive", "start_position": 0.25, "damping": 3.0}, {"terminal": "steady"}),
]


@pytest.mark.parametrize(("given", "options"), CLASSES)
def test_no_start_is_gentler_than_its_cell(given: dict[str, Any], options: dict[str, Any]) -> None:
    """Equations that a start misses are paid for with their multipliers, half of them of another time."""
    drive = CRANE.replace(gap=0.5, **given)
    problem = Problem(drive, 0.3, **options)
    assert not not_certified(problem)
    start, longer = Start(problem, 300), Start(replace(problem, start_time=0.32), 320)
    rng = np.random.default_rng(15)
    starts, closest = 0, math.inf
    duals: list[tuple[Dual, Any]] = []
    rare = problem.torque_speed == STEEP or math.isfinite(start.held)
    for trial in range(6 * TORQUES if rare else TORQUES):
        profile = gentle_torque(rng, drive)
        if problem.torque_speed:  # else few are below it
            profile = TorqueProfile(profile.time, profile.torque * rng.uniform(0.4, 1.0))
        te = 0.3 if start.rests else float(rng.uniform(0.12, 0.3))
        if math.isfinite(start.held):
            falling = (start.high - start.low) / start.rate
            gentle = TorqueProfile(profile.time, profile.torque * rng.uniform(0.05, 0.4))  # T stays above 0
            profile = gentle.followed_by(te - falling, TorqueProfile([0.0], [start.held]))
        run = replay(drive, profile, te + start.tail * start.h)
        if problem.torque_speed and not below_curve(run, te, problem):
            continue
        found = durations(run, start, te)
        if found is None:
            continue
        gap, winding, contact = found
        winds = start.rests and (winding > 1e-6 or not start.open)
        if trial % 25 == 0 or not duals:  # good multipliers for another start than most
            source = longer if trial // 25 % 2 else start
            steps = counted(source, *(start.h / source.h * one for one in found))
            by = _Program(source, steps).solve(math.inf)
            assert by is not None
            by = by.on(start)
            cells = _Cells(start, winds)
            cells.lowest[:] = -math.inf
            dual = Dual(start, by)
            cells.raise_by(dual, math.inf)
            duals = [*duals[-5:], (dual, cells)]
        end = run.at(te)
        T = float(end["T"])
        for dual, cells in duals:
            if start.rests and cells.winds != winds:
                continue
            k = int(winding if start.rests else gap) if start.open and (winds or not start.rests) else 0
            cell = (cells.i == int(contact)) & (cells.k == k)
            by = dual.by
            w2, v = float(end["w2"]), float(end["w1"] - end["w2"])
            paid = by.speed * (w2 - problem.target) + by.rate * v + by.end_torque * (T - drive.Mc)
            proved = cells.lowest[cell].item()
            starts += 1
            closest = min(closest, (run.peak_torque - paid - proved) / drive.Ms)
    assert starts > 15
    assert closest >= -1e-9


@pytest.mark.parametrize(("given", "options"), CLASSES)
def test_no_durations_within_a_cell_prove_less_than_it(
    given: dict[str, Any], options: dict[str, Any]
) -> None:
    """Wide cells, whose curvature counts, against the durations in them on a finer grid."""
    start = Start(Problem(CRANE.replace(gap=0.5, **given), 0.3, **options), 30)
    fine = start.refined(1)
    by = _Program(start, counted(start, 3.0, 3.0, 15.0)).solve(math.inf)
    assert by is not None
    cells, parts = _Cells(start, start.rests), fine.n // start.n
    proved, finer = Dual(start, by).cells(cells.i, cells.k, start.rests), Dual(fine, by.on(fine))
    for i, k in np.ndindex(parts + 1, parts + 1 if start.open else 1):
        inside = np.array([parts * cells.i + i, parts * cells.k + k])
        some = (inside.sum(axis=0) <= fine.n) & (inside[0] > 0)
        found = finer.nodes(*inside[:, some], start.rests)
        assert np.all(found >= proved[some] - 1e-9 * CRANE.Ms)


def counted(start: Start, gap: float, winding: float, contact: float) -> tuple[int, int, int]:
    """Whole steps for the durations of a start; one of a load at rest lasts all the time."""
    tau = max(round(contact), 1)
    if not start.rests:
        return (math.ceil(gap) if start.open else 0), 0, tau
    if not start.open:
        return 0, start.n - tau, tau
    w = max(round(winding), 1) if winding > 1e-6 else 0
    return start.n - tau - w, w, tau


def below_curve(run: Run, te: float, problem: Problem) -> bool:
    """Whether a start keeps to the torque-speed curve."""
    times = np.linspace(0.0, te, 400)
    state = run.at(times)
    speed, torque = zip(*problem.torque_speed, strict=True)
    return bool(np.all(state["u"] <= np.interp(state["w1"], speed, torque)))


@pytest.mark.parametrize(
    ("given", "end", "options"),
    [
        ({"torque_lag": 0.005}, 0.2883042, {}),
        ({"torque_lag": 0.005, "damping": 1.0}, 0.27, {}),
        ({"torque_lag": 0.005, "damping": 0.5, "torque_rate": 2500.0}, 0.3, {}),
        ({"torque_lag": 0.005, "damping": 1.0, "minimum_torque": -20.0}, 0.29, {"terminal": "reached"}),
        ({"load_kind": "reactive", "damping": 1.0}, 0.2883042, {}),
        (
            {"load_kind": "reactive", "damping": 1.0, "torque_lag": 0.005, "start_position": 0.25},
            0.2883042,
            {},
        ),
    ],
)
def test_the_gap_is_below_half_a_per_cent(given: dict[str, Any], end: float, options: dict[str, Any]) -> None:
    best = optimize(CRANE.replace(**given), end, time_limit=0.0, **options)
    assert best.bound.kind == "certificate"
    assert "half an elastic period longer" in best.bound.covers
    assert best.bound.k_dyn <= best.k_dyn <= 1.005 * best.bound.k_dyn
    assert best.bound.k_dyn > 1.005 * momentum_bound(best.problem).k_dyn


def test_the_least_over_demands_of_limited_rate_is_exact() -> None:
    """The recursion over the steps finds the minimum of the linear program, ties and limits included."""
    rng = np.random.default_rng(15)
    for _ in range(300):
        n = int(rng.integers(1, 60))
        q = [rng.normal(size=n), np.cumsum(rng.normal(size=n)), rng.integers(-2, 3, n)][rng.integers(3)] * 1.0
        low, high = -float(rng.choice([0.0, 1.0])), float(rng.choice([1.0, rng.uniform(0.1, 2.0)]))
        rise = float(rng.choice([0.02, 0.25, 1.0, 5.0]))
        first = float(rng.choice([0.0, low, high, rng.uniform(low, high)]))
        kinks, count, least = np.empty((4, 2 * n + 2)), np.zeros(4, dtype=np.int64), np.zeros(2)
        for one in q:
            _take(one, rise, low, high, kinks, count, least)
        found = _value(first, 0.5 * rise, kinks, count, least)
        steps = np.eye(n, k=1) - np.eye(n)  # the last one ends at `first`
        limit, end = np.full(n, rise), np.zeros(n)
        limit[-1], end[-1] = 0.5 * rise, first
        best = linprog(
            q, A_ub=np.vstack([steps, -steps]), b_ub=np.concatenate([limit - end, limit + end]),
            bounds=(low, high),
        ).fun  # fmt: skip
        assert found == pytest.approx(best, abs=1e-9 * max(np.abs(q).sum(), 1.0))


def test_the_gap_in_closed_form_is_the_integral() -> None:
    """Against matrix exponentials: q between its zeros, its integral, and the adjoint state at the end."""
    rng = np.random.default_rng(15)
    J1, high, twice = 0.035, 62.0, 0
    for trial in range(150):
        g, low = float(rng.uniform(0.001, 0.1)), -float(rng.choice([0.0, 20.0]))
        lag = float(rng.choice([0.0, 10 ** rng.uniform(-4, -1)]))
        X = rng.normal(size=5) * (1.0, 0.1 * g, 1.0, 0.1 * g * lag / J1, 1.0)
        if trial % 3 == 0:
            X[1] = -X[0] * g * rng.random()
        A = np.zeros((6, 6))  # of p, and the integral of q
        A[0, 1] = 1.0
        if lag > 0.0:
            A[1, 3], A[3, 3], A[3, 5] = 1.0 / J1, -1.0 / lag, 1.0 / lag
        else:
            A[1, 5] = 1.0 / J1
        begin, q_of = np.append(X, 0.0), A[:, 5]

        def weight(x: float, begin: Any = begin, A: Any = A) -> float:
            return float(begin @ expm(A * x) @ A[:, 5])

        times = np.linspace(0.0, g, 40)
        q = np.array([begin @ expm(A * x) @ q_of for x in times])
        zeros = [brentq(weight, times[k], times[k + 1]) for k in np.flatnonzero(q[1:] * q[:-1] < 0.0)]
        twice += len(zeros) > 1
        swept = np.diff([float((begin @ expm(A * x))[5]) for x in (0.0, *zeros, g)])
        end = (begin @ expm(A * g))[:5]
        found = _freely(X, g, J1, lag, low, high)
        wanted = np.minimum(swept * low, swept * high).sum()
        assert found == pytest.approx(wanted, abs=1e-9 * g * high * np.abs(q).max())
        assert end == pytest.approx(X, abs=1e-12 * np.abs(end).max())
    assert twice > 5


@pytest.mark.parametrize("lag", [0.0, 0.005])
@pytest.mark.parametrize("damping", [0.5, 2.0])
def test_what_is_taken_off_for_torque_above_the_linear_one_is_enough(lag: float, damping: float) -> None:
    """A steady end without load torque: the change of the Lagrange function, whatever the demand."""
    drive = CRANE.replace(load_torque=0.0, damping=damping, torque_lag=lag)
    start = Start(Problem(drive, 0.3, "steady"), 300)
    contact = 250
    by = _Program(start, (40, 0, contact)).solve(math.inf)
    assert by is not None
    with_it, below = Dual(start, by).lost.sum(), start.below.copy()
    start.below[:] = 0.0
    dual = Dual(start, by)
    taken = with_it - dual.lost.sum()
    rates = np.zeros((6, 6))  # of z, z', w2, u, the integral of T, with the torque above
    rates[:4, :4] = start.rates["contact"][:4, :4]
    rates[4, :2], rates[4, 5] = (start.c, start.d), 1.0
    rates[1, 5], rates[2, 5] = -1.0 / start.J1 - 1.0 / start.J2, 1.0 / start.J2
    move = expm(rates * start.h)
    rng = np.random.default_rng(15)
    price = dual.p[:contact, 2] / start.J2 - dual.p[:contact, 1] * (1.0 / start.J1 + 1.0 / start.J2)
    worst = np.append(np.zeros(start.tail), price + by.torque[start.tail : start.tail + contact] < 0.0)
    costs = []
    for trial in range(40):
        share = worst if trial == 0 else rng.random(worst.size) ** rng.choice([0.0, 1.0, 9.0])
        more = below[: worst.size] * share
        y, L = np.zeros(6), 0.0
        for k in range(worst.size - 1, -1, -1):
            y[4:] = 0.0, more[k]
            y = move @ y
            L += by.torque[k] * y[4]
            if k == start.tail:
                L -= by.speed * y[2] + by.rate * y[1]
                L -= by.end_torque * (start.c * y[0] + start.d * y[1] + more[k])
        costs.append(-L)
    assert 0.0 < max(costs) <= taken * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("given", "instants"),
    [
        ({"torque_lag": 0.005}, (0.0267, 0.0267, 0.2883)),
        ({"damping": 1.0, "start_position": 0.25}, (0.0, 0.0, 0.25)),
        ({"load_kind": "reactive", "torque_lag": 0.005}, (0.027, 0.033, 0.2883)),
    ],
)
def test_the_weight_of_the_demand_is_what_the_bound_gains_by_it(
    given: dict[str, Any], instants: tuple[float, float, float]
) -> None:
    dual = dual_at(Problem(CRANE.replace(**given), 0.2883042), instants)
    start, (gap, winding, contact) = dual.start, dual.by.durations

    def bound() -> float:
        k = winding if start.rests else gap
        return dual.nodes(np.array([contact]), np.array([k]), start.rests).item()

    times, q = dual.weights(dual.by.durations)
    before = bound()
    start.high += 0.01
    whole = np.minimum([*q, 2.0 * q[-1] - q[-2]], 0.0)  # the last weight is that of the first step's end
    gained = start.h * float(np.sum(0.5 * (whole[1:] + whole[:-1])))  # F integrates by trapezoids
    assert (bound() - before) / 0.01 == pytest.approx(gained, rel=0.01)
    assert times.min() == pytest.approx(start.h)
    assert times.max() == pytest.approx(start.h * (gap + winding + contact + start.tail))


@pytest.mark.parametrize("end", [0.2883042, 0.27])
def test_it_is_below_the_closed_form(end: float) -> None:
    """An ideal torque on an undamped shaft, whose optimum is known exactly."""
    problem = Problem(CRANE, end)
    exact = optimize(CRANE, end).k_dyn
    proved = whole_bound(problem, exact)
    assert 0.995 * exact < proved.k_dyn <= exact


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"contact_law": "modelica", "damping": 1.0}, "modelica law is not linear"),
        ({"start_position": -0.3}, "other flank first"),
        ({"load_kind": "reactive", "start_position": 0.27}, "wound up against a load at rest"),
        ({"load_kind": "reactive", "initial_load_speed": 3.0, "initial_motor_speed": 3.0}, "moves before"),
        ({"stiffness": 4e6}, "so many elastic periods"),
    ],
)
def test_what_it_does_not_cover_is_named(given: dict[str, Any], why: str) -> None:
    assert why in not_certified(Problem(CRANE.replace(**given), 0.3))
