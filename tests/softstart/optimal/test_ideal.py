"""Kernels of an ideal start against matrix exponentials, entries against the exact plant and by search."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import linprog

from softstart import Drive, TorqueProfile
from softstart.arrays import Vector
from softstart.optimal.exact import replay
from softstart.optimal.lp import ideal
from softstart.optimal.lp.motion import (
    Contact,
    Entry,
    FromContact,
    ThroughGap,
    ThroughStandstill,
    entry_of,
    no_ideal,
)
from softstart.optimal.problem import Problem
from softstart.optimal.shortest import shortest_start_time

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
DAMPED = (0.0, 0.1, 3.0, 6.5564, 20.0, 500.0)  # N m s/rad; 6.5564 is nearly critical


def contact_of(d: float) -> Contact:
    return Contact(0.035, 0.175, 368.465, d, 7.16)


def exact(contact: Contact) -> Vector:
    """The matrix of d/ds [z, z', w2, u, 1] in contact."""
    A = np.zeros((5, 5))
    both = 1.0 / contact.J1 + 1.0 / contact.J2
    A[0, 1] = 1.0
    A[1] = -contact.c * both, -contact.d * both, 0.0, 1.0 / contact.J1, contact.Mc / contact.J2
    A[2] = contact.c / contact.J2, contact.d / contact.J2, 0.0, 0.0, -contact.Mc / contact.J2
    return A


@pytest.mark.parametrize("d", DAMPED)
def test_kernels_are_the_matrix_exponential(d: float) -> None:
    contact = contact_of(d)
    A = exact(contact)
    for s in (0.0, 1e-6, 1e-3, 0.02, 0.3, 4.0):
        E = expm(A * s)
        assert float(contact.h(s)) == pytest.approx(E[0, 1], rel=1e-9, abs=1e-13)
        assert float(contact.dh(s)) == pytest.approx(E[1, 1], rel=1e-9, abs=1e-11)
        assert float(contact.H(s)) == pytest.approx(E[0, 3] * contact.J1, rel=1e-8, abs=1e-15)


@pytest.mark.parametrize("d", DAMPED)
def test_rows_are_the_motion_under_steps_of_torque(d: float) -> None:
    contact, rng = contact_of(d), np.random.default_rng(3)
    edges = np.concatenate([[0.0], np.cumsum(rng.uniform(1e-3, 0.03, 5))])
    u, v, z0 = rng.uniform(0.0, 62.0, 5), 2.5, 0.04
    A, x = exact(contact), np.array([z0, v, 0.0, 0.0, 1.0])
    for k, length in enumerate(np.diff(edges)):
        x[3] = u[k]
        x = expm(A * length) @ x
        s = edges[k + 1 : k + 2]
        T = contact.c * x[0] + contact.d * x[1]
        for rows, truth in (
            (contact.twist(s, edges), x[0]),
            (contact.rate(s, edges), x[1]),
            (contact.load_speed(s, edges), x[2]),
            (contact.torque(s, edges), T),
        ):
            by_u, by_v, constant, by_z = rows
            value = by_u[0] @ u + by_v[0] * v + constant[0] + by_z[0] * z0
            assert value == pytest.approx(truth, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("d", DAMPED)
@pytest.mark.parametrize("length", [0.02, 0.4, 9.0])
@pytest.mark.parametrize("before", [False, True])
def test_running_sums_are_the_plain_ones(d: float, length: float, before: bool) -> None:
    """A heavily damped shaft has one very quick exponential: running sums would overflow."""
    contact, rng = contact_of(d), np.random.default_rng(4)
    s = np.linspace(0.0, length, 301)
    at = np.sort(np.concatenate([rng.uniform(0.0, length, 20), s[[7, 150, -1]]]))
    of_h, of_dh = rng.normal(size=(2, at.size))
    lag = at[None, :] - s[:, None]
    counted = lag >= 0.0 if before else lag > 0.0
    plain = (contact.h(lag) * counted) @ of_h + (contact.dh(lag) * counted) @ of_dh
    first = (np.searchsorted(at, s, side="right"), np.searchsorted(at, s))
    found = contact.sums(s, at, of_h, of_dh, first)[before]
    assert found == pytest.approx(plain, rel=1e-9, abs=1e-8)


@pytest.mark.parametrize("d", DAMPED)
def test_an_impulse_of_torque_raises_T_for_half_a_period(d: float) -> None:
    contact = contact_of(d)
    s = np.linspace(0.0, contact.half_period, 400)[1:-1]
    assert (contact.c * contact.h(s) + contact.d * contact.dh(s) > 0.0).all()
    after = contact.half_period * 1.001
    assert contact.c * contact.h(after) + contact.d * contact.dh(after) < 0.0


# entries ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"start_position": -0.25},
        {"start_position": 0.1, "initial_motor_speed": 3.0},
        {"initial_motor_speed": 5.0, "initial_load_speed": 4.0},
        {"load_torque": 0.0},
        {"damping": 1.0, "load_torque": 20.0},
    ],
)
def test_pieces_cross_the_gap_as_asked(given: dict[str, float]) -> None:
    problem = Problem(CRANE.replace(**given), 0.5)
    entry = entry_of(problem)
    assert isinstance(entry, ThroughGap)
    for te in np.linspace(entry.earliest, min(entry.latest, 3.0 * entry.earliest), 5):
        low, high = (float(of(np.array(te))) for of in (entry.slowest, entry.fastest))
        for v in (low, 0.5 * (low + high), high):
            run = replay(problem.drive, as_profile(entry, te, v), te + 0.01)
            assert run.first_contact == pytest.approx(te, rel=1e-9)
            state = run.at(run.first_contact)
            assert float(state["v"]) == pytest.approx(v, rel=1e-7, abs=1e-7)
            assert float(state["w2"]) == pytest.approx(float(entry.load_speed(np.array(te))), abs=1e-9)


@pytest.mark.parametrize("start", [0.0, 0.25, 0.25 + 0.012])
def test_pieces_wind_a_standing_load_up_as_asked(start: float) -> None:
    problem = Problem(CRANE.replace(load_kind="reactive", start_position=start), 0.5)
    entry = entry_of(problem)
    assert isinstance(entry, ThroughStandstill)
    for te in np.linspace(entry.earliest, 2.0 * entry.earliest, 4):
        low, high = (float(of(np.array(te))) for of in (entry.slowest, entry.fastest))
        for v in (low + 1e-3 * (high - low), 0.5 * (low + high), high):
            profile = as_profile(entry, te, v).followed_by(te, TorqueProfile([0.0], [62.0]))
            run = replay(problem.drive, profile, te + 0.01)
            moves = next(event.time for event in run.events if event.kind == "load starts")
            assert moves == pytest.approx(te, rel=1e-7)
            assert float(run.at(moves)["v"]) == pytest.approx(v, rel=1e-5)


def as_profile(entry: Entry, te: float, v: float) -> TorqueProfile:
    pieces = [piece for piece in entry.pieces(te, v) if piece[0] > 0.0]
    times = np.concatenate([[0.0], np.cumsum([length for length, _ in pieces])])
    return TorqueProfile.steps(times, [torque for _, torque in pieces])


@pytest.mark.parametrize(
    "given", [{}, {"start_position": -0.2, "initial_motor_speed": 2.0}, {"load_torque": 0.0}]
)
def test_least_and_greatest_speed_after_the_gap_against_a_program(given: dict[str, float]) -> None:
    """Of all torques on a fine grid with the way as their moment: the grid can only be a little worse."""
    entry = entry_of(Problem(CRANE.replace(**given), 0.5))
    assert isinstance(entry, ThroughGap)
    for te in np.linspace(entry.earliest * 1.05, min(0.95 * entry.latest, 0.2), 4):
        edges = np.linspace(0.0, te, 401)
        impulse = np.diff(edges) / entry.J1
        way = impulse * (te - 0.5 * (edges[1:] + edges[:-1]))
        needed = entry.travel - entry.v0 * te - 0.5 * entry.pull * te**2
        for sign, of in ((1.0, entry.slowest), (-1.0, entry.fastest)):
            found = linprog(
                sign * impulse, A_eq=way[None, :], b_eq=[needed], bounds=(0.0, entry.Ms), method="highs"
            )
            speed = entry.v0 + entry.pull * te + sign * found.fun
            claimed = float(of(np.array(te)))
            assert sign * (speed - claimed) >= -1e-9 * speed
            assert speed == pytest.approx(claimed, rel=1e-3)  # a grid cuts the pulse at its steps


def test_bounds_of_the_speed_over_a_cell() -> None:
    for given in ({}, {"load_torque": 40.0}, {"initial_motor_speed": 4.0}, {"load_kind": "reactive"}):
        entry = entry_of(Problem(CRANE.replace(**given), 0.5))
        edges = np.linspace(entry.earliest, min(entry.latest, 0.2), 30)
        assert (np.diff(entry.slowest(edges)) <= 1e-9).all()
        inside = 0.3 * edges[:-1] + 0.7 * edges[1:]
        top = entry.fastest_between(edges[:-1], edges[1:])
        for te in (edges[:-1], inside, edges[1:]):
            assert (entry.fastest(te) <= top * (1.0 + 1e-12)).all()


def breakaway(entry: ThroughStandstill, pieces: list[tuple[float, float]]) -> tuple[float, float] | None:
    """When and how fast T = Mc is reached, the gap not opening again; None if it opens or never comes.

    In the gap parabolas, in contact turns about (u/c, 0) in the plane (z, v/ws), drawn from the pieces alone.
    """
    ws, z0, t = math.sqrt(entry.c / entry.J1), entry.Mc / entry.c, 0.0
    z, v = (-entry.travel, 0.0) if entry.travel > 0.0 else (entry.preload, 0.0)
    for duration, u in pieces:
        left = duration
        if z < 0.0:
            a = u / entry.J1
            arriving = v + math.sqrt(v * v - 2.0 * a * z)
            s = -2.0 * z / arriving if arriving > 0.0 else math.inf
            if s >= left:
                z, v, t = z + v * left + 0.5 * a * left * left, v + a * left, t + left
                continue
            z, v, t, left = 0.0, v + a * s, t + s, left - s
        mean = u / entry.c
        radius, angle = math.hypot(z - mean, v / ws), math.atan2(v / ws, z - mean)
        s = math.inf
        if radius > 0.0 and abs(z0 - mean) <= radius:
            turn = angle - math.acos((z0 - mean) / radius)
            s = max(turn if turn > -1e-9 else turn + 2.0 * math.pi, 0.0) / ws
        stop = min(s, left)
        turns_back = mean < radius and (angle + math.pi) / ws < stop
        if turns_back or mean + radius * math.cos(angle - ws * stop) < 0.0:
            return None
        if s <= left:
            return t + s, ws * radius * math.sin(angle - ws * s)
        z, v = mean + radius * math.cos(angle - ws * left), radius * ws * math.sin(angle - ws * left)
        t += left
    return None


def test_no_torque_winds_a_standing_load_up_slower_faster_or_sooner() -> None:
    """Random torques, then small changes of those that come nearest to the least speed."""
    rng = np.random.default_rng(8)
    nearest, arrived, quicker = math.inf, 0, 0
    for _ in range(60):
        Ms, c = 1.0 / rng.uniform(0.03, 0.97), 10 ** rng.uniform(-1, 1)
        way = rng.choice([0.0, 10 ** rng.uniform(-2, 1.5)]) / c
        preload = rng.choice([0.0, rng.uniform(0.0, 0.95)]) / c if way == 0.0 else 0.0
        entry = ThroughStandstill(way, 1.0, c, 1.0, Ms, preload)
        scale, best = 2.0 * entry.earliest, None
        top = float(entry.fastest(np.array(0.0)))
        most = float(entry.fastest_between(np.array(0.0), np.array(0.0)))
        for _ in range(120):
            if best is not None and rng.random() < 0.6:
                spread = 10 ** rng.uniform(-4, -0.5)
                pieces = [(dt * math.exp(rng.normal() * spread), u) for dt, u in best[1]]
            else:
                levels = rng.choice([0.0, Ms, Ms * rng.random()], 4)
                pieces = [(scale * 10 ** rng.uniform(-2, 0.3), float(u)) for u in levels]
                pieces += [(50.0 * scale, float(rng.choice([0.0, Ms, Ms * rng.random()])))]
            found = breakaway(entry, pieces)
            if found is None:
                continue
            te, v = found
            over = (v - float(entry.slowest(np.array([te]))[0])) / most
            arrived += 1
            quicker += v > top * (1.0 + 1e-6)
            assert te >= entry.earliest * (1.0 - 1e-9)
            assert over >= -1e-8
            assert v <= most * (1.0 + 1e-9)
            nearest = min(nearest, over if v > 0.05 * most else math.inf)
            if best is None or over < best[0]:
                best = over, pieces
    assert arrived > 1000
    assert nearest < 1e-3
    assert quicker > 0  # a wound shaft that is let go first


def test_where_the_start_is_no_linear_problem_the_reason_is_given() -> None:
    reasons = {
        "the motor may brake": {"minimum_torque": -10.0},
        "modelica": {"damping": 0.5, "contact_law": "modelica"},
        "the load runs away": {"initial_load_speed": 5.0},
        "damped shaft moves a reactive": {"damping": 0.5, "load_kind": "reactive"},
        "moves before the contact": {"load_kind": "reactive", "initial_motor_speed": 1.0},
        "wound up against": {"start_position": -0.3},
    }
    for words, given in reasons.items():
        assert words in no_ideal(Problem(CRANE.replace(**given), 0.5))
    assert no_ideal(Problem(CRANE, 0.5)) == ""
    assert isinstance(entry_of(Problem(CRANE.replace(start_position=0.26), 0.5)), FromContact)


@pytest.mark.slow
def test_more_time_never_makes_a_start_harder() -> None:
    """The start may take less than it is allowed: drawn out, a contact this hard would open the gap again."""
    drive = Drive(
        motor_inertia=0.121, starting_torque=60.0, stiffness=8706.0, gap=0.669, load_inertia=0.0433,
        load_torque=10.23, target_speed=22.6,
    )  # fmt: skip
    shortest = shortest_start_time(Problem(drive, 1.0, "reached"))
    peaks = []
    for share in (1.06, 1.35, 1.6):
        found = ideal.search(Problem(drive, share * shortest, "reached"))
        assert found is not None
        assert found.end_time <= share * shortest * (1.0 + 1e-12)
        peaks.append(found.P)
    assert all(later <= sooner * (1.0 + 2e-4) for sooner, later in pairwise(peaks)), peaks
