"""The certificate is never above a start that can be had: random starts, judged without its formulas."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import linprog
from tests.softstart.optimal.drives import CRANE, played

from softstart import Drive, TorqueProfile, optimize
from softstart.arrays import Vector
from softstart.optimal import certificate, contact_motion
from softstart.optimal.bounds import momentum_bound
from softstart.optimal.certificate import _Dual, _Multipliers, _Search, not_certified
from softstart.optimal.contact_motion import Contact, entries
from softstart.optimal.problem import Problem, Terminal

UNBOUNDED = 1e9  # rad/s: a target that is set later to what is reached


@dataclass
class Start:
    """What happens from te on: masses in contact under steps of torque, by matrix exponentials alone."""

    drive: Drive
    terminal: Terminal
    te: float
    entered: Vector  # z, z', w2, u, 1
    tau: float
    u: Vector

    @property
    def pulls(self) -> bool:
        return bool(self.drive.contact_law == "dead-zone" and self.drive.d > 0.0)

    def step(self, s: float) -> Vector:
        drive, A = self.drive, np.zeros((5, 5))
        both = 1.0 / drive.J1 + 1.0 / drive.J2
        A[0, 1] = 1.0
        A[1] = -drive.c * both, -drive.d * both, 0.0, 1.0 / drive.J1, drive.Mc / drive.J2
        A[2] = drive.c / drive.J2, drive.d / drive.J2, 0.0, 0.0, -drive.Mc / drive.J2
        return np.asarray(expm(A * s))

    def torque(self, x: Vector) -> Vector:
        return np.asarray(self.drive.c * x[..., 0] + self.drive.d * x[..., 1])

    def motion(self, first: Vector, levels: Vector, length: float, samples: int) -> Vector:
        E, x, out = self.step(length / samples), first.copy(), [first.copy()]
        for level in levels:
            x[3] = level
            for _ in range(samples):
                x = E @ x
                out.append(x)
            x = x.copy()
        return np.array(out)

    def crest(self, x: Vector, length: float) -> float:
        """Greatest |T|, between samples by parabolas: at 0.03 radian apart they are true to 1e-8."""
        T = self.torque(x)
        inner = np.abs(T[1:-1])
        left, right = np.abs(T[:-2]), np.abs(T[2:])
        bend = 2.0 * inner - left - right
        peaked = (bend > 0.0) & (inner >= left) & (inner >= right)
        more = np.where(peaked, (right - left) ** 2 / np.maximum(8.0 * bend, 1e-300), 0.0)
        return float(max(np.abs(T).max(), (inner + more).max()))

    def judged(self) -> tuple[float, float] | None:
        """(peak of |T| in N m, load speed at the end); None if this is no start of the class."""
        drive = self.drive
        length = self.tau / self.u.size
        x = self.motion(self.entered, self.u, length, max(4, math.ceil(length * float(drive.Omega) / 0.03)))
        T, end = self.torque(x), x[-1]
        kept = drive.c * x[1:, 0] if self.pulls else T
        if kept.min() < -1e-9 * drive.Ms:
            return None
        if drive.load_kind == "reactive" and drive.Mc > 0.0 and x[:, 2].min() < -1e-9:
            return None
        peak = self.crest(x, length)
        if self.terminal == "reached":
            if x[:-1, 2].max() > end[2] or self.torque(end) < drive.Mc * (1.0 - 1e-9):
                return None  # it was there before
            tail = self.motion(end, np.zeros(1), math.pi / float(drive.Omega), 400)
            falling = np.flatnonzero(np.diff(self.torque(tail)) < 0.0)
            last = int(falling[0]) + 2 if falling.size else 401
            peak = max(peak, self.crest(tail[: max(last, 3)], 0.0) if last > 1 else 0.0)
        return peak, float(end[2])

    def programmed(self, n: int, cost: Vector | None, target: float | None) -> Vector | None:
        """Torques of a program made of matrix exponentials: least P for a target, or least cost."""
        drive, checks = self.drive, 3
        E, Ms = self.step(self.tau / (n * checks)), float(drive.Ms)
        X = np.zeros((5, n + 1))
        X[:, n] = self.entered
        T_rows, z_rows = [], []
        for k in range(n):
            X[3], X[3, k] = 0.0, 1.0
            for _ in range(checks):
                X = E @ X
                T_rows.append(self.torque(X.T))
                z_rows.append(drive.c * X[0])
        X[3] = 0.0
        T, z, ones = np.array(T_rows), np.array(z_rows), np.ones((n * checks, 1))
        kept = z if self.pulls else T
        above = np.where(np.arange(n * checks) < checks, 0.0, 1e-3 * Ms)
        rows = [np.hstack([a[:, :n], b]) for a, b in ((T, -ones), (-T, -ones), (-kept, 0.0 * ones))]
        most = [-T[:, n], T[:, n], kept[:, n] - above]
        equal = [(X[2], target)] if target is not None else []
        if self.terminal == "reached":
            quarter = self.step(math.pi / float(drive.Omega) / 40.0)
            x = X
            after = np.array([self.torque((x := quarter @ x).T) for _ in range(40)])
            rows += [np.hstack([after[:, :n], -np.ones((40, 1))]), np.append(-T[-1, :n], 0.0)[None, :]]
            most += [-after[:, n], T[-1:, n] - drive.Mc]
        else:
            equal.append((X[1], 0.0))
        if self.terminal == "steady":
            equal.append((T[-1], drive.Mc))
        found = linprog(
            np.append(np.zeros(n), 1.0) if cost is None else np.append(cost, 0.1), np.vstack(rows),
            np.concatenate(most), np.array([np.append(row[:n], 0.0) for row, _ in equal]) if equal else None,
            np.array([right - row[n] for row, right in equal]) if equal else None,
            [(0.0, Ms)] * n + [(0.0, None)], method="highs",
        )  # fmt: skip
        return np.asarray(found.x[:n]) if found.status == 0 else None


def random_drive(rng: np.random.Generator) -> Drive:
    """Loads of both kinds, damped or not, from the gap, from a flank or in contact."""
    J1, Ms = 10 ** rng.uniform(-2, 0), 10 ** rng.uniform(0.5, 2.5)
    J2 = J1 * 10 ** rng.uniform(-1, 1.2)
    Omega = 2.0 * math.pi * 10 ** rng.uniform(0.5, 1.5)
    c = Omega**2 * J1 * J2 / (J1 + J2)
    Mc = Ms * rng.choice([0.0, rng.uniform(0.02, 0.7), rng.uniform(0.02, 0.7)])
    reactive = bool(rng.random() < 0.35 and Mc > 0.0)
    gap = Ms / c * rng.choice([0.0, 10 ** rng.uniform(-1.5, 0.5), 10 ** rng.uniform(-1.5, 0.5)])
    position = gap * rng.choice([0.0, -0.5, 0.5, rng.uniform(-0.5, 0.5)])
    if rng.random() < 0.2:
        position = 0.5 * gap + (Mc if reactive else Ms) / c * rng.uniform(0.0, 0.9)
    moving = 0.0 if reactive else rng.choice([0.0, 1.0])
    w2 = moving * rng.uniform(-1.0, 1.0) * Ms / (J2 * Omega)
    return Drive(
        motor_inertia=J1, load_inertia=J2, starting_torque=Ms, load_torque=Mc, stiffness=c, gap=gap,
        load_kind="reactive" if reactive else "active", start_position=position, target_speed=UNBOUNDED,
        damping=0.0 if reactive else 2.0 * rng.choice([0.0, 0.02, 0.1, 0.5, 1.5]) * c / Omega,
        contact_law=rng.choice(["no-pull", "dead-zone"]).item(), initial_load_speed=w2,
        initial_motor_speed=w2 + moving * rng.uniform(0.0, 1.0) * Ms / (J1 * Omega),
    )  # fmt: skip


def entered(rng: np.random.Generator, drive: Drive) -> tuple[float, Vector] | None:
    """(te, state) that the exact plant reaches under random pulses before both masses move in contact."""
    quick = math.sqrt(2.0 * float(drive.J1) * max(float(drive.gap), 0.2 * drive.Ms / drive.c) / drive.Ms)
    levels = float(drive.Ms) * np.append(1.0, rng.choice([0.0, 1.0, rng.random()], 3))
    times = np.concatenate([[0.0], np.cumsum(quick * 10 ** rng.uniform(-1.0, 0.2, levels.size))])
    if float(drive.theta0) >= 0.5 * float(drive.gap) and drive.load_kind == "active":
        z, v = drive.theta0 - 0.5 * drive.gap, drive.initial_motor_speed - drive.initial_load_speed
        return 0.0, np.array([z, v, drive.initial_load_speed, 0.0, 1.0], dtype=np.float64)
    run = played(drive, TorqueProfile.steps(times, levels), float(times[-1]) + 40.0 * quick)
    reactive = drive.load_kind == "reactive"
    first = "load starts" if reactive else "gap closed"
    begins = [event.time for event in run.events if event.kind == first]
    opened = [event.time for event in run.events if event.kind == "gap opened"]
    if not begins or (opened and opened[0] < begins[0]):
        return None
    state = run.at(begins[0])
    z = float(drive.Mc / drive.c) if reactive else 0.0
    return begins[0], np.array([z, float(state["v"]), float(state["w2"]), 0.0, 1.0])


def random_start(rng: np.random.Generator, terminal: Terminal) -> Start | None:
    drive = random_drive(rng)
    if not_certified(Problem(drive, 1.0, terminal)):
        return None
    entry = entered(rng, drive)
    if entry is None:
        return None
    tau = float(drive.elastic_period) * 10 ** rng.uniform(-0.5, 0.4)
    start = Start(drive, terminal, *entry, tau, np.zeros(1))
    if terminal == "reached" and rng.random() < 0.4:
        n = int(rng.integers(1, 10))
        start.u = float(drive.Ms) * rng.choice([0.0, 1.0, rng.random()], n)
        return start
    u = start.programmed(20, rng.normal(size=20) * float(drive.Ms) / 20.0, None)
    if u is None:
        return None
    start.u = u
    return start


def pressed(rng: np.random.Generator, start: Start, target: float, peak: float) -> tuple[Start, float]:
    """The best of several random entries, each with the least peak for the same target and end."""
    best, end = start, start.te + start.tau
    for k in range(3):
        entry = (start.te, start.entered) if k == 0 else entered(rng, start.drive)
        if entry is None or entry[0] >= end:
            continue
        other = Start(start.drive, start.terminal, *entry, end - entry[0], np.zeros(1))
        u = other.programmed(30, None, target)
        if u is None:
            continue
        other.u = u
        judged = other.judged()
        if judged is not None and judged[0] < peak and abs(judged[1] - target) < 1e-8 * abs(target):
            best, peak = other, judged[0]
    return best, peak


@pytest.mark.parametrize("terminal", get_args(Terminal))
def test_no_start_at_all_gets_below(terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each start sets its own target and time; half of them are improved by programs at random entries."""
    monkeypatch.setattr(certificate, "MOST_PROGRAMS", 3)
    monkeypatch.setattr(certificate, "MOST_CELLS", 150)
    monkeypatch.setattr(contact_motion, "ENTRY_CELLS", 60)
    rng = np.random.default_rng(20)
    ratios: list[float] = []
    while len(ratios) < 8:
        start = random_start(rng, terminal)
        judged = start.judged() if start is not None else None
        if start is None or judged is None or judged[1] <= max(start.drive.initial_load_speed, 0.0):
            continue
        peak, target = judged
        if len(ratios) % 3:
            start, peak = pressed(rng, start, target, peak)
        problem = Problem(start.drive.replace(target_speed=target), start.te + start.tau, terminal)
        near = start.te if rng.random() < 0.5 else None
        cells = entries(problem, start.te + start.tau, near)
        k = max(int(np.searchsorted(cells.te, start.te)) - 1, 0)  # the cell of this entry
        speeds = cells.slowest[k], start.entered[1], cells.fastest[k]
        assert np.all(np.diff(speeds) >= -1e-8 * cells.fastest.max())
        search = _Search(problem, cells, 1.002 * peak, near)
        bound = search.least()
        assert bound <= peak * (1.0 + 1e-7)
        for dual in search.duals:  # at this very entry and duration, without any cell
            one_sided = np.abs(dual.by.of_T) if start.pulls else np.maximum(dual.by.of_T, 0.0)
            assert one_sided.sum() + dual.by.tail.sum() < 1.0 + 1e-9
            fixed, by_v = dual.at(start.tau)
            missing = target - float(start.entered[2])
            assert fixed + by_v * start.entered[1] + dual.by.speed * missing <= peak * (1.0 + 1e-7)
        ratios.append(bound / peak)
    assert max(ratios) > 0.98  # and it says something


def random_multipliers(rng: np.random.Generator, problem: Problem) -> _Multipliers:
    pulls = problem.drive.contact_law == "dead-zone" and problem.drive.d > 0.0
    peak, low, z = rng.exponential(size=(3, 12)) * rng.choice([0.0, 1.0], (3, 12))
    tail = rng.exponential(size=certificate.TAIL) * (0.03 if problem.terminal == "reached" else 0.0)
    total = peak.sum() + pulls * low.sum() + tail.sum() + 1e-12
    J2, Omega = float(problem.drive.J2), float(problem.drive.Omega)
    ends = problem.terminal != "reached"
    return _Multipliers(
        (peak - low) / total, -pulls * z / total, tail / total,
        speed=rng.normal() * J2 * Omega,
        rate=ends * rng.normal() * float(problem.drive.c) / Omega,
        torque=float(problem.terminal == "steady") * rng.normal(),
    )  # fmt: skip


DRIVES: dict[str, dict[str, Any]] = {
    "undamped": {},
    "reactive": {"load_kind": "reactive"},
    "damped": {"damping": 2.0},
    "dead-zone": {"damping": 2.0, "contact_law": "dead-zone"},
    "overdamped": {"damping": 40.0},
    "overdamped in contact": {"damping": 40.0, "start_position": 0.33},
    "in contact": {"damping": 0.3, "start_position": 0.33, "initial_motor_speed": 2.0},
}


@pytest.mark.parametrize("given", DRIVES.values(), ids=DRIVES)
@pytest.mark.parametrize("terminal", get_args(Terminal))
def test_any_numbers_at_all_make_a_bound(
    given: dict[str, Any], terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """D(te, tau) of random multipliers against the same sum for random torques, and over a cell of tau.

    Coarse steps of the integral of q prove no more than fine ones.
    """
    rng = np.random.default_rng(31)
    problem = Problem(CRANE.replace(**given), 0.3, terminal)
    Ms, cells = problem.highest_torque, entries(problem, 0.3)
    for _ in range(4):
        by = random_multipliers(rng, problem)
        low, high = np.sort(rng.uniform(0.2, 1.0, 2)) * float(cells.fastest.max())
        tau = 0.25 * 10 ** rng.uniform(-1.5, 0.0)
        missing, search = 20.0 * rng.normal(size=2), _Search(problem, cells, 1.0)
        proved = list[float]()
        for fine in (2.0, 0.5, 0.001, 0.02):
            monkeypatch.setattr(certificate, "FINE", fine)
            dual = _Dual(problem, cells, by, tau)
            proved.append(dual.at(tau)[0])
        assert max(proved) <= proved[2] + 1e-9 * abs(proved[2])
        cells.slowest[0], cells.fastest[0], search.missing[:2] = low, high, missing
        taus = np.linspace(0.5 * tau, tau, 13)
        least = search._proved(dual, taus[0], tau, slice(1)).item()
        at_end = search._proved(dual, tau, tau, slice(1)).item()
        curved = (dual.still + dual.growing * tau) * (0.5 * tau) ** 2 / 8.0
        assert -math.inf < least <= at_end - curved + 1e-9 * abs(at_end)
        for t in taus:
            q = dual.weights(t)[0] - dual.momentum
            q = q[(np.arange(40) * q.size) // 40 + q.size // 80]
            for weights in (q, rng.normal(size=40)):  # the torque that presses most, and any
                u = np.where(weights < 0.0, Ms, 0.0)
                v, w2 = rng.uniform(low, high), -rng.choice(missing)
                if weights is q:
                    v, w2 = low if dual.at(t)[1] > 0.0 else high, -missing[np.argmin(by.speed * missing)]
                start = Start(problem.drive, terminal, 0.0, np.array([cells.z0, v, w2, 0.0, 1.0]), t, u)
                value = the_sum(start, by)
                scale = 1e-9 * (abs(value) + Ms)
                assert value >= least - scale
                if t == tau:
                    assert value >= at_end - scale


def the_sum(start: Start, by: _Multipliers) -> float:
    """Sum of multipliers times limits, with T, z, z' and w2 from matrix exponentials."""
    drive, n = start.drive, start.u.size
    edges = np.linspace(0.0, start.tau, n + 1)
    nodes, step = [start.entered], start.step(start.tau / n)
    for level in start.u:
        x = nodes[-1].copy()
        x[3] = level
        nodes.append(step @ x)

    def at(s: float) -> Vector:
        k = min(int(np.searchsorted(edges, s, side="right")) - 1, n)
        x = nodes[k].copy()
        x[3] = start.u[k] if k < n else 0.0
        return np.asarray(start.step(s - edges[k]) @ x)

    total = 0.0
    for share, of_T, of_z in zip(np.arange(1, 13) / 12, by.of_T, by.of_z, strict=True):
        x = at(min(share * start.tau, start.tau))
        total += of_T * float(start.torque(x)) + of_z * drive.c * x[0]
    for s, weight in zip(certificate._after(Contact.of(drive)), by.tail, strict=True):
        total += weight * float(start.torque(at(start.tau + s))) if weight else 0.0
    end = nodes[-1]
    total -= by.speed * end[2] + by.rate * end[1] + by.torque * (float(start.torque(end)) - drive.Mc)
    return float(total)


@pytest.mark.parametrize("given", DRIVES.values(), ids=DRIVES)
def test_the_curvature_over_tau_is_enclosed(given: dict[str, Any]) -> None:
    """Each multiplier alone: second differences at fixed v and u(s/tau) stay below M, and get near it."""
    problem, ends, sharp = Problem(CRANE.replace(**given), 0.3), 24 + certificate.TAIL, list[float]()
    cells, step = entries(problem, 0.3), 1e-3 / float(problem.drive.Omega)
    speed = float(cells.fastest[0])
    for unit in np.eye(ends + 3)[[2, 11, 14, 23, ends - 1, ends, ends + 1, ends + 2]]:
        T, z, tail, numbers = np.split(unit, [12, 24, ends])
        by, most = _Multipliers(T, -z, tail, *numbers.tolist()), 0.0
        for angle, u, v, z0 in product((50, 1600, 3100), ([62, 62], [0, 62]), (0.0, speed), (0.0, 30.0)):
            cells.fastest[:], cells = v, replace(cells, z0=z0)
            x, tau = np.array([z0, v, 0.0, 0.0, 1.0]), angle * step
            dual, taus = _Dual(problem, cells, by, 0.1), (tau - step, tau, tau + step)
            f = [the_sum(Start(problem.drive, "reached", 0.0, x, one, np.array(u)), by) for one in taus]
            bent = abs(f[0] - 2.0 * f[1] + f[2]) / step**2
            most = max(most, bent / (dual.still + dual.growing * taus[2]))
        sharp.append(most)
    assert 0.25 < max(sharp) < 1.0 + 1e-4


@settings(max_examples=150, deadline=None)
@drawn(st.floats(0.0, 4.0) | st.just(1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.1, 30.0))
def test_a_free_motion_stays_within_its_enclosure(share: float, y: float, rate: float, length: float) -> None:
    """At any damping, of y' and y'' and of the responses of T, z and z' to a step of v or z."""
    d = 2.0 * share * math.sqrt(368.465 / (1.0 / 0.035 + 1.0 / 0.175))
    contact = Contact(0.035, 0.175, 368.465, d, 7.16)
    free = np.array([[0.0, 1.0], [-(contact.Omega**2), -2.0 * contact.zeta]])
    step, x = expm(free * length / contact.Omega / 2000), np.array([y, contact.Omega * rate])
    bounds = contact.swing(*x.tolist())
    path = np.array([x, *(x := step @ x for _ in range(2000))])
    assert np.abs(path[:, 1]).max() <= bounds[0] * (1.0 + 1e-12)
    assert np.abs(path @ free[1]).max() <= bounds[1] * (1.0 + 1e-12)
    _, h, dh = contact.responses(np.linspace(0.0, length / contact.Omega, 2001))
    np.testing.assert_allclose(
        np.array([dh + 2.0 * contact.zeta * h, h * contact.Omega]).T @ [y, rate], path[:, 0], atol=1e-9
    )


def test_it_is_close_where_momentum_is_far() -> None:
    """K_dyn above 1, at 1.2 times the start time of direct: the momentum bound is 38 % below."""
    best = optimize(Drive.load("crane-4amtkf-light"), "1.2x")
    assert 0.9985 * best.k_dyn < best.bound.k_dyn <= best.k_dyn
    assert momentum_bound(best.problem).k_dyn < 0.75 * best.k_dyn


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"minimum_torque": -5.0}, "brake"),
        ({"contact_law": "modelica", "damping": 1.0}, "modelica law is not linear"),
        ({"damping": 1.0, "load_torque": 0.0}, "did not push"),
        ({"initial_load_speed": 3.0}, "runs away"),
        ({"load_kind": "reactive", "damping": 1.0}, "depends on the speed"),
        ({"load_kind": "reactive", "initial_motor_speed": 3.0}, "moves before the contact"),
        ({"load_kind": "reactive", "start_position": 0.27}, "wound up against the load"),
    ],
)
def test_nothing_is_certified_where_the_start_is_no_linear_problem(given: dict[str, Any], why: str) -> None:
    assert why in not_certified(Problem(CRANE.replace(**given), 0.3, "steady"))
