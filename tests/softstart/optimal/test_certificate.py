"""The certificate is never above a start that can be had: random starts, judged without its formulas."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import linprog

from softstart import Drive, TorqueProfile
from softstart.arrays import Vector
from softstart.optimal import certificate
from softstart.optimal.certificate import _Dual, _Envelope, _Search, certified_bound, not_certified
from softstart.optimal.exact import replay
from softstart.optimal.lp.ideal import Multipliers
from softstart.optimal.lp.motion import Contact, entry_of
from softstart.optimal.problem import Problem, Terminal

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
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
        top = inner + np.where(
            (bend > 0.0) & (inner >= left) & (inner >= right),
            (right - left) ** 2 / np.maximum(8.0 * bend, 1e-300),
            0.0,
        )
        return float(max(np.abs(T).max(), top.max()))

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
        rows = [
            np.hstack([T[:, :n], -ones]),
            np.hstack([-T[:, :n], -ones]),
            np.hstack([-kept[:, :n], 0.0 * ones]),
        ]
        most = [-T[:, n], T[:, n], kept[:, n] - above]
        equal = []
        if self.terminal == "reached":
            quarter = self.step(math.pi / float(drive.Omega) / 40.0)
            tail, x = [], X
            for _ in range(40):
                x = quarter @ x
                tail.append(self.torque(x.T))
            after = np.array(tail)
            rows += [np.hstack([after[:, :n], -np.ones((40, 1))]), np.append(-T[-1, :n], 0.0)[None, :]]
            most += [-after[:, n], T[-1:, n] - drive.Mc]
        else:
            equal.append((X[1], 0.0))
        if self.terminal == "steady":
            equal.append((T[-1], drive.Mc))
        if target is not None:
            equal.append((X[2], target))
        found = linprog(
            np.append(np.zeros(n), 1.0) if cost is None else np.append(cost, 0.1),
            np.vstack(rows),
            np.concatenate(most),
            np.array([np.append(row[:n], 0.0) for row, _ in equal]) if equal else None,
            np.array([right - row[n] for row, right in equal]) if equal else None,
            [(0.0, Ms)] * n + [(0.0, None)],
            method="highs",
        )
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
        motor_inertia=J1,
        load_inertia=J2,
        starting_torque=Ms,
        load_torque=Mc,
        load_kind="reactive" if reactive else "active",
        stiffness=c,
        damping=0.0 if reactive else 2.0 * rng.choice([0.0, 0.02, 0.1, 0.5, 1.5]) * c / Omega,
        contact_law=rng.choice(["no-pull", "dead-zone"]).item(),
        gap=gap,
        start_position=position,
        initial_load_speed=w2,
        initial_motor_speed=w2 + moving * rng.uniform(0.0, 1.0) * Ms / (J1 * Omega),
        target_speed=UNBOUNDED,
    )


def entered(rng: np.random.Generator, drive: Drive) -> tuple[float, Vector] | None:
    """(te, state) that the exact plant reaches under random pulses before both masses move in contact."""
    quick = math.sqrt(2.0 * float(drive.J1) * max(float(drive.gap), 0.2 * drive.Ms / drive.c) / drive.Ms)
    levels = [
        float(drive.Ms),
        *rng.choice([0.0, float(drive.Ms), float(drive.Ms) * rng.random()], 3).tolist(),
    ]
    times = np.concatenate([[0.0], np.cumsum(quick * 10 ** rng.uniform(-1.0, 0.2, len(levels)))])
    if float(drive.theta0) >= 0.5 * float(drive.gap) and drive.load_kind == "active":
        z, v = drive.theta0 - 0.5 * drive.gap, drive.initial_motor_speed - drive.initial_load_speed
        return 0.0, np.array([z, v, drive.initial_load_speed, 0.0, 1.0], dtype=np.float64)
    run = replay(drive, TorqueProfile.steps(times, levels), float(times[-1]) + 40.0 * quick)
    reactive = drive.load_kind == "reactive"
    begins = [
        event.time for event in run.events if event.kind == ("load starts" if reactive else "gap closed")
    ]
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
    monkeypatch.setattr(certificate, "ENTRY_CELLS", 600)
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
        search = _Search(problem, 1.002 * peak, start.te if rng.random() < 0.5 else None)
        bound = search.bound()
        assert bound <= peak * (1.0 + 1e-7)
        for dual in search.duals:  # at this very entry and duration, without any cell
            fixed, by_v = dual.at(start.tau)
            missing = target - float(start.entered[2])
            assert fixed + by_v * start.entered[1] + dual.by.speed * missing <= peak * (1.0 + 1e-7)
        ratios.append(bound / peak)
    assert max(ratios) > 0.98  # and it says something


def random_multipliers(rng: np.random.Generator, problem: Problem, tail_at: Vector) -> Multipliers:
    share = np.sort(rng.uniform(0.0, 1.0, 12))
    share[-1] = 1.0
    pulls = problem.drive.contact_law == "dead-zone" and problem.drive.d > 0.0
    peak, trough = rng.exponential(size=(2, 12)) * rng.choice([0.0, 1.0], (2, 12))
    tail = rng.exponential(size=tail_at.size) * (0.3 if problem.terminal == "reached" else 0.0)
    trough *= pulls
    total = peak.sum() + trough.sum() + tail.sum() + 1e-12
    J2, Omega = float(problem.drive.J2), float(problem.drive.Omega)
    ends = problem.terminal != "reached"
    return Multipliers(
        share,
        peak / total,
        trough / total,
        rng.exponential(size=12) * rng.choice([0.0, 0.3], 12),
        tail_at,
        tail / total,
        speed=rng.normal() * J2 * Omega,
        rate=ends * rng.normal() * float(problem.drive.c) / Omega,
        torque=float(problem.terminal == "steady") * rng.normal(),
    )


DRIVES: dict[str, dict[str, Any]] = {
    "undamped": {},
    "reactive": {"load_kind": "reactive"},
    "damped": {"damping": 2.0},
    "dead-zone": {"damping": 2.0, "contact_law": "dead-zone"},
    "overdamped": {"damping": 40.0},
    "in contact": {"damping": 0.3, "start_position": 0.33, "initial_motor_speed": 2.0},
}


@pytest.mark.parametrize("given", DRIVES.values(), ids=DRIVES)
@pytest.mark.parametrize("terminal", get_args(Terminal))
def test_any_numbers_at_all_make_a_bound(given: dict[str, Any], terminal: Terminal) -> None:
    """D(te, tau) of random multipliers against the same sum for random torques, and over a cell of tau."""
    rng = np.random.default_rng(31)
    problem = Problem(CRANE.replace(**given), 0.3, terminal)
    entry, contact = entry_of(problem), Contact.of(problem.drive)
    coasting = min(contact.half_period, math.pi / contact.Omega)
    envelope = _Envelope(contact, 0.3 + coasting)
    pulls = problem.drive.contact_law == "dead-zone"
    Ms = problem.highest_torque
    for _ in range(4):
        by = random_multipliers(rng, problem, coasting * np.linspace(0.2, 1.0, 5))
        v = float(entry.slowest(np.array([entry.earliest]))[0]) * rng.uniform(0.2, 1.0)
        tau = 0.25 * 10 ** rng.uniform(-1.5, 0.0)
        dual = _Dual(problem, entry, by, envelope, v, tau)
        search = _Search(problem, 1.0)
        search.missing, search.low, search.high = np.zeros(2), np.array([v]), np.array([v])
        taus = np.linspace(0.5 * tau, tau, 13)
        least = search._dual(dual, taus[0], tau, 1).item()
        at_end = search._dual(dual, tau, tau, 1).item()
        shares = (np.arange(40) + 0.5) / 40
        for t in taus:
            q = dual._weights(shares * t, t, dual._first(shares))[0]
            for weights in (q, rng.normal(size=40)):  # the torque that presses most, and any
                u = np.where(weights < 0.0, Ms, 0.0)
                start = Start(problem.drive, terminal, 0.0, np.array([entry.z0, v, 0.0, 0.0, 1.0]), t, u)
                value = the_sum(start, by, pulls)
                scale = 1e-9 * (abs(value) + Ms)
                assert value >= least - scale
                if t == tau:
                    assert value >= at_end - scale
        assert at_end > -math.inf


def the_sum(start: Start, by: Multipliers, pulls: bool) -> float:
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
    for share, peak, trough, closed in zip(by.share, by.peak, by.trough, by.closed, strict=True):
        x = at(share * start.tau)
        T = float(start.torque(x))
        total += (peak - trough) * T - closed * (drive.c * x[0] if pulls else T)
    for s, weight in zip(by.tail_at, by.tail, strict=True):
        total += weight * float(start.torque(at(start.tau + s)))
    end = nodes[-1]
    total -= by.speed * end[2] + by.rate * end[1] + by.torque * (float(start.torque(end)) - drive.Mc)
    return float(total)


@pytest.mark.parametrize("d", [0.0, 0.5, 3.0, 6.5564, 60.0])
@pytest.mark.parametrize("longest", [0.01, 0.3, 8.0])
def test_the_envelope_is_above_the_kernels(d: float, longest: float) -> None:
    contact = Contact(0.035, 0.175, 368.465, d, 7.16)
    envelope = _Envelope(contact, longest)
    s = np.unique(np.concatenate([np.linspace(0.0, longest, 20001), np.geomspace(1e-7, longest, 20001)]))
    h, dh = contact.h(s), contact.dh(s)
    ddh = -2.0 * contact.zeta * dh - contact.Omega**2 * h
    third = -2.0 * contact.zeta * ddh - contact.Omega**2 * dh
    for name, bent in (
        ("T", contact.c * ddh + contact.d * third),
        ("z", contact.c * ddh),
        ("rate", third),
        ("w2", third * contact.J1 / (contact.J1 + contact.J2)),
    ):
        assert np.abs(bent).max() <= envelope.by_v[name]
        assert np.abs(bent).max() / contact.J1 <= envelope.kernels[name][2] * (1.0 + 1e-12)
    over = contact.Omega**2
    assert np.abs(over * ddh).max() <= envelope.by_overlap["rate"]
    assert np.abs(over * (contact.c * dh + contact.d * ddh)).max() <= envelope.by_overlap["T"]


def test_what_the_bound_covers_is_said() -> None:
    said = certified_bound(Problem(CRANE, 0.2883042), 0.909)
    assert said.kind == "certificate"
    assert "gap closes once" in said.covers
    assert "both masses have the target speed" in said.covers
    reactive = certified_bound(Problem(CRANE.replace(load_kind="reactive"), 0.3, "reached"), 0.8)
    assert "moving on once it moves" in reactive.covers
    closed = certified_bound(Problem(CRANE.replace(gap=0.0), 0.3, "reached"), 0.8)
    assert "whose gap stays closed until the target speed is reached" in closed.covers


def test_nothing_is_certified_where_the_start_is_no_linear_problem() -> None:
    assert "start time" in not_certified(Problem(CRANE, None, minimise="start_time"))
    assert "brake" in not_certified(Problem(CRANE.replace(minimum_torque=-5.0), 0.3))
