"""The shortest start time: just above it there is a start, just below it none; and what the verdict says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from softstart import Drive, optimize, simulate
from softstart.optimal import shortest
from softstart.optimal.collocation import search as collocation
from softstart.optimal.front import default_start_times
from softstart.optimal.lp import ideal, rows
from softstart.optimal.momentum import momentum_shortest_time
from softstart.optimal.problem import Problem, Terminal
from softstart.optimal.result import NotConverged
from softstart.optimal.shortest import shortest_start_time, verdict_on
from softstart.profile import TorqueProfile

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


@pytest.mark.parametrize(
    ("given", "terminal"),
    [
        ({}, "synchronous"),
        ({"load_kind": "reactive"}, "steady"),
        ({"damping": 0.5, "contact_law": "dead-zone"}, "reached"),
        ({"target_speed": "880 rpm"}, "reached"),  # Newton's steps alone go to and fro here
    ],
)
def test_it_parts_what_can_be_from_what_cannot(
    given: dict[str, Any], terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rows, "ROUNDS", 1)  # whether there is a start, not how good it is
    problem = Problem(CRANE.replace(**given), 1.0, terminal)
    time = shortest_start_time(problem)
    assert time >= momentum_shortest_time(problem) * (1.0 - 1e-9)
    assert ideal.search(Problem(problem.drive, 1.002 * time, terminal)) is not None
    assert ideal.search(Problem(problem.drive, 0.998 * time, terminal)) is None


@pytest.mark.parametrize("turns", [4.0, 3.2, 3.4])
def test_without_a_gap_it_is_bang_bang(turns: float) -> None:
    """Greatest speed at t_f with z'(t_f) = 0: u = Ms where 1 > p cos(Omega r), r the time left, else 0.

    p makes z' = 0. The start is wound up, so that T never comes near 0.
    """
    swing = float(CRANE.Ms / CRANE.J1 + CRANE.Mc / CRANE.J2) / float(CRANE.Omega) ** 2
    drive = CRANE.replace(gap=0.0, start_position=0.3 * swing)
    Omega, Ms = float(drive.Omega), float(drive.Ms)
    end = turns * float(drive.elastic_period)
    cells = 400_000
    r = (np.arange(cells) + 0.5) * end / cells
    wave = np.cos(Omega * r)

    def torque(p: float) -> NDArray[np.float64]:
        return np.where(p * wave < 1.0, Ms, 0.0)

    def rate(p: float) -> float:
        free = (float(drive.Mc / drive.J2) / Omega - 0.3 * swing * Omega) * math.sin(Omega * end)
        return float(torque(p) @ wave) * end / cells / float(drive.J1) + free

    p = brentq(rate, -50.0, 50.0) if abs(rate(0.0)) > 1e-3 else 0.0
    impulse = float(torque(p).sum()) * end / cells - float(drive.Mc) * end
    problem = Problem(drive.replace(target_speed=impulse / float(drive.J1 + drive.J2)), 1.0)
    found = shortest_start_time(problem)
    assert found >= end * (1.0 - 1e-6)
    assert found <= end * (1.0 + 1e-3)  # a rest on a grid of 80 steps is cut at its steps


def test_the_verdict_names_time_and_momentum() -> None:
    said = verdict_on(Problem(CRANE, 0.2))
    assert "even if it acted all the time" in said.constraint
    assert f"{said.shortest_start_time:.6g} s" in said.sentence
    assert "0.2 s" in said.sentence
    assert said.shortest_start_time == pytest.approx(shortest_start_time(Problem(CRANE, 0.2)))


def test_the_verdict_names_the_gap_and_the_swing() -> None:
    problem = Problem(CRANE, 0.238)
    assert momentum_shortest_time(problem) < 0.238
    assert "gap and the swing" in verdict_on(problem).constraint


LIMITS: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "lag": ({"torque_lag": 0.02}, {}, "torque lag of 0.02 s"),
    "rate": ({"torque_rate": 900.0}, {}, "torque rate of 900 N m/s"),
    "curve": ({}, {"torque_speed": ((0.0, 62.0), (30.0, 62.0), (70.0, 20.0))}, "torque-speed curve"),
    "k_dyn": ({}, {"k_dyn": 1.1, "minimise": "heat"}, "bound of 1.1 on K_dyn"),
    "heat": ({}, {"heat": 0.1}, "bound of 0.1 s on the heat"),
}


@pytest.mark.parametrize(("given", "bounds", "words"), LIMITS.values(), ids=LIMITS)
def test_the_verdict_names_the_limit_that_forbids_it(
    given: dict[str, Any], bounds: dict[str, Any], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The choice of words alone: what each problem takes at least is put in by hand (collocation is slow)."""

    def taken(problem: Problem) -> float:
        drive = problem.drive
        limited = drive.torque_lag > 0.0 or math.isfinite(drive.torque_rate) or problem.torque_speed
        return 0.4 if limited or problem.k_dyn is not None or problem.heat is not None else 0.25

    monkeypatch.setattr(shortest, "shortest_start_time", taken)
    said = verdict_on(Problem(CRANE.replace(**given), 0.3, **bounds))
    assert words in said.constraint
    assert "0.4 s" in said.sentence
    assert said.shortest_start_time == 0.4


def test_limits_that_forbid_it_only_together(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        shortest, "shortest_start_time", lambda problem: 0.25 if problem.ideal_torque else 0.4
    )
    said = verdict_on(Problem(CRANE.replace(torque_lag=0.02, torque_rate=900.0), 0.3))
    assert "together" in said.constraint


def test_a_start_that_takes_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shortest, "shortest_start_time", lambda problem: math.inf)
    said = verdict_on(Problem(CRANE, 0.3, minimise="heat", k_dyn=0.1))
    assert said.constraint == "K_dyn <= 0.1"
    assert "found none, which is no proof" in said.sentence


IDLE = Drive(
    motor_inertia=0.035, load_inertia=0.175, starting_torque=62.0, load_torque=0.0, stiffness=368.465,
    gap=0.0, target_speed=41.265,
)  # fmt: skip


@pytest.mark.parametrize(
    ("drive", "start_time", "k_dyn"),
    [
        (IDLE, 0.17, 0.9198),  # with a load torque of 0.03 N m
        (IDLE.replace(load_torque=0.001), 0.17, 0.9198),
        (IDLE.replace(damping=0.1), 0.2, 0.7629),
        (CRANE.replace(load_torque=0.01), 0.27, 0.8689),
    ],
)
def test_a_steady_start_without_load_torque(drive: Drive, start_time: float, k_dyn: float) -> None:
    """It costs what little load torque costs, and ends with T = Mc and equal speeds."""
    best = optimize(drive, start_time, terminal="steady", time_limit=0.0)
    assert best.k_dyn == pytest.approx(k_dyn, rel=2e-3)
    end = best.run.at(best.end_time)
    assert end["T"] == pytest.approx(drive.Mc, abs=1e-3 * best.problem.base_torque)
    assert end["w1"] == pytest.approx(end["w2"], abs=1e-3 * drive.target_speed)


def test_the_least_time_of_a_steady_start_without_load_torque() -> None:
    """It is known: 0.152995 s. Constant torque over three elastic periods ends steady, K_dyn 2 u/Ms."""
    periods, u = 3.0 * float(IDLE.elastic_period), 51.672
    assert u * periods == pytest.approx(0.21 * 41.265, rel=1e-4)
    run = simulate(IDLE, "profile", parameters={"profile": TorqueProfile.steps([0.0, periods], [u])})
    assert run.k_dyn == pytest.approx(2.0 * u / 62.0, rel=1e-6)
    assert shortest_start_time(Problem(IDLE, 1.0, "steady")) == pytest.approx(0.152995, rel=2e-4)


def test_several_contacts_are_pointed_out() -> None:
    """Constant torque may be there in time where a single contact is not."""
    drive = CRANE.replace(target_speed=10.0)
    problem = Problem(drive, 0.9 * shortest_start_time(Problem(drive, 1.0, "reached")), "reached")
    said = verdict_on(problem).sentence
    assert ("Constant torque" in said) == ("contacts" in said)


def test_what_was_not_found_is_not_called_impossible(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search that does not converge proves nothing: the start time stays unknown, and is said to be."""

    def gives_up(problem: Problem, warm: Any = None) -> None:
        raise NotConverged("no solution found", 1.0)

    monkeypatch.setattr(collocation, "solve", gives_up)
    drive = CRANE.replace(contact_law="modelica", damping=0.5)  # of no linear program
    assert math.isnan(shortest_start_time(Problem(drive, 0.3)))
    assert shortest_start_time(Problem(drive, 0.3, minimise="heat", k_dyn=0.5)) == math.inf
    said = verdict_on(Problem(drive, 0.1))
    assert "was not found" in said.sentence
    assert "no start time" not in said.sentence
    assert default_start_times(drive)[0] == pytest.approx(1.02 * simulate(drive, "direct").start_time)
    with pytest.raises(NotConverged):
        optimize(drive, 0.3, method="collocation")
