"""Lower bounds by weak duality over boxes of the instants of end, closing, breakaway and opening.

For any numbers m >= 0 on limits G x(t) <= g + P p that every start of a box keeps, and n on its terminal
equations G x(t_f) = e, let lambda' = -A^T lambda run back from the end and jump by m G (by -n G) where such a
limit (equation) applies. With q = B^T lambda and x' = A x + g + B p every start of the box has

    P (sum m p + int of max -q p where the shaft is free)
        >= lambda(0) x(0) + int of lambda g + int of min q p - sum m g + n e,

so that numbers alone, wherever they come from, make a bound. A coarse linear program gives good ones, and the
integrals are enclosed in continuous time: neither its tolerances nor its grid enter. Multipliers are fixed
in time before the end, so that one set proves something of every end at once. A box for which that is too
little is split or gets finer cells. Phases, limits and why they hold: docs/theory/optimum.md, "Weak duality".
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from softstart.arrays import Indices, Vector
from softstart.drive import Drive
from softstart.optimal.bounds import momentum_bound
from softstart.optimal.duality_program import (
    MEAN,
    RAMPED,
    W1,
    W2,
    Layout,
    Model,
    Phase,
    Row,
    Y,
    Z,
    good_multipliers,
    proved,
)
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import first_true
from softstart.optimal.result import LowerBound
from softstart.optimal.starts import parts

Span = tuple[float, float]

WITHIN = 5e-4  # the work ends once the bound is within this share of what is judged
CELLS = 20_000  # in linear programs, a half of them for starts that close once: some 0.45 ms each
PARTS = 400  # of the ends of a box, of each of which is known what is proved
PROGRAMS = 12  # for one box at most
PER_PERIOD, LONG, EDGE = 18, 3.0, 4.0  # cells of a period; longer ones where T is held, so far from events
FINEST = 4  # times finer cells, at most
NARROWEST = 1e-4  # of the start time

ENDINGS = {
    "synchronous": "both masses have the target speed",
    "steady": "both masses have the target speed and the shaft has the load torque",
    "reached": "the target speed is reached",
}


def not_covered(problem: Problem) -> str:
    """Why momentum alone bounds a problem; empty if duality does too.

    >>> drive = Drive.load("crane-4amtkf")
    >>> not_covered(Problem(drive, 0.5)), not_covered(Problem(drive.replace(minimum_torque=-5.0), 0.5))
    ('', 'the motor may brake')
    """
    if problem.start_time is None:
        return "without a bound on the start time any peak above the load torque will do"
    return next((why for one in problem.machines if (why := _not_covered(problem, one))), "")


def _not_covered(problem: Problem, machine: Any) -> str:
    if not isinstance(machine, Drive):
        return "it is for a drive of two masses"
    rows, masses, shafts = parts(machine)
    preload = float(machine.c) * (float(machine.theta0) - 0.5 * float(machine.gap))
    law = machine.contact_law == "modelica" and machine.d > 0.0 and machine.gap > 0.0
    return first_true({
        "the motor may brake": problem.lowest_torque < 0.0,
        "the damped modelica law is not linear in contact": law,
        "a mass moves at first": bool(masses["w0"].any()),
        "gears have losses, or the load torque follows a curve": bool(
            rows.curves.size or (shafts["eta"] != 1.0).any() or not np.isfinite(masses["J"]).all()
        ),
        "a brake holds the motor at first": machine.brake != "none",
        "friction stops the load between falling and rising":
            bool(machine.reactive_torque > 0.0 and not machine.rests),
        "the start is wound up against the load":
            machine.theta0 < -0.5 * machine.gap or (machine.reactive_torque > 0.0 and preload > machine.Mc),
    })  # fmt: skip


def dual_bounds(problem: Problem, k_dyn: float, *, cells: int = CELLS) -> tuple[LowerBound, LowerBound]:
    """Lower bounds on K_dyn for any number of contacts, and for starts whose gap closes once.

    Both hold for every start that ends at the start time or before. `k_dyn` is what is to be judged: the work
    ends once a bound is within 5e-4 of it, or after linear programs with so many cells in all, a count, so
    that equal requests have equal bounds. Where nothing is better the momentum bound.

    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    >>> _, once = dual_bounds(Problem(drive.replace(torque_lag=0.002), 0.2883042), 0.9237, cells=4000)
    >>> once.kind, 0.91 < once.k_dyn < 0.9237
    ('duality', True)
    """
    whole = momentum_bound(problem)
    if not_covered(problem) or whole.kind == "none":
        return whole, whole
    best = [whole, whole]
    for machine in problem.machines:
        if best[0].k_dyn >= k_dyn * (1.0 - WITHIN):
            break
        found = _Search(problem, machine, k_dyn).both(cells // len(problem.machines))
        for i, peak in enumerate(found):
            least = peak * float(machine.Ms) / problem.base_torque
            if least > best[i].k_dyn:
                best[i] = LowerBound(least, "duality", _covers(problem, machine, i == 1))
    return best[0], best[1]


def _covers(problem: Problem, machine: Drive, once: bool) -> str:
    """The class of starts in words."""
    every = f"every torque from {problem.torques} over time, by whatever "
    if not once:
        return every + "controller, however often the gap closes"
    open_gap = machine.theta0 < 0.5 * machine.gap
    closing = "whose gap closes once and stays closed" if open_gap else "whose gap stays closed"
    moving = ", the load moving on once it moves," if machine.reactive_torque > 0.0 else ""
    return f"{every}controller, {closing}{moving} until {ENDINGS[problem.terminal]}"


@dataclass(frozen=True, eq=False)
class Box:
    """Starts whose instants lie within these times before their end, in 1/Omega.

    `close` is None where the gap is closed at first, `move`, the last standstill of the load, where it does
    not rest, `part`, the first opening, where the gap stays closed. `again`: the load may have moved before.
    """

    start: Span
    close: Span | None
    move: Span | None
    part: Span | None
    again: bool
    finer: int = 1
    known: Vector | None = None  # what is proved so far of equal parts of `start`


class _Search:
    """The boxes of a machine, the least bound first; everything without dimensions."""

    def __init__(self, problem: Problem, machine: Drive, k_dyn: float) -> None:
        self.model = m = Model(problem, machine)
        self.end = m.end
        self.goal = k_dyn * problem.base_torque / m.Ms * (1.0 - WITHIN)
        self.times, self.speeds, self.first = self.in_the_gap()
        # what the load loses until the closing, as torque
        self.fallen = 0.0 if m.sticks or m.b2 else m.mc
        self.held = self.goal <= m.mu1 * (m.hi - m.F) + m.mu2 * m.mc  # some u holds so large a T
        self.left = 0  # cells of linear programs

    def both(self, cells: int) -> tuple[float, float]:
        """(any number of contacts, those that close once): the least P, in Ms."""
        m = self.model
        self.left = cells // 2
        once = self.least(self.boxes([None], False), self.goal)
        parted: list[Span | None] = [] if m.joined else [(0.0, math.inf)]
        if not m.sticks and not parted:
            return once, once
        self.left = cells // 2
        more = self.boxes([None, *parted] if m.sticks else parted, m.sticks)
        return min(once, self.least(more, min(once, self.goal))), once

    def in_the_gap(self, n: int = 4000) -> tuple[Vector, Vector, float]:
        """Under the full demand, with the gap open: times, z' then, and a time before the closing."""
        m = self.model
        h, x = self.end / n, m.x0
        step = m.step(Phase("open", "rests" if m.sticks else "moves", h))
        path = [x]
        for _ in range(n):
            room = (m.hi - float(x[m.demand])) / (h * m.rate) if m.ramped else m.hi
            x = step.E @ x + step.fixed + step.G[:, 0] * (min(room, 1.0) if m.ramped else m.hi)
            path.append(x)
        every, times = np.array(path), np.linspace(0.0, self.end, n + 1)
        closed = np.flatnonzero(every[:, Z] >= 0.0)
        first = 0.0 if m.z0 >= 0.0 else float(times[closed[0] - 1]) if closed.size else self.end
        return times, every[:, W1] - every[:, W2], first

    def plain(self, box: Box) -> float:
        """What momentum says of a box."""
        m = self.model
        left = (box.move or box.close or box.start)[1]
        lost = self.fallen * max(self.first, box.start[0] - left)
        return m.mc + (m.W / m.mu2 + lost) / left if left > 0.0 else math.inf

    def boxes(self, parted: list[Span | None], again: bool) -> list[Box]:
        """The first ones: cells of closing, breakaway or, with the gap closed at first, of the end."""
        m, longest = self.model, self.end - self.first
        if longest <= 0.0:
            return []
        waits = m.sticks and m.z0 <= 0.0  # waiting at rest makes every start end as late as it may
        need = (m.W / m.mu2 + self.fallen * self.first) / max(self.goal - m.mc, 1e-9)
        cuts = longest - (longest - min(need, longest)) * np.linspace(0.0, 1.0, 7) ** 1.5
        found = []
        for high, low in [*pairwise(cuts.tolist()), (float(cuts[-1]), 0.0)]:
            start = (self.end, self.end) if waits else (0.0, self.end)
            close = ((low, longest) if m.sticks else (low, high)) if m.z0 < 0.0 else None
            if close is None and not m.sticks:
                start = (low, high)
            for part in parted:
                box = Box(start, close, (low, high) if m.sticks else None, part, again)
                found += [one] if (one := self.cut(box)) else []
        return found

    def least(self, boxes: list[Box], goal: float) -> float:
        """The least bound over all boxes; what is known of it above the goal or when the work is done."""
        tie, narrow = itertools.count(), math.inf
        heap = [(self.plain(box), next(tie), box) for box in boxes]
        heapq.heapify(heap)
        while heap and heap[0][0] < min(goal, narrow) and self.left > 0:
            value, _, box = heapq.heappop(heap)
            low, box = self.judged(box, goal)
            value = max(value, low)
            halves = self.split(box) if value < goal else []
            if not halves:
                narrow = min(narrow, value)
            for half in halves:
                heapq.heappush(heap, (max(value, self.plain(half)), next(tie), half))
        return min(narrow, heap[0][0] if heap else math.inf)

    def judged(self, box: Box, goal: float) -> tuple[float, Box]:
        """What linear programs prove of a box, each for the end of which least is known."""
        low, high = box.start
        known = np.zeros(PARTS) if box.known is None else box.known.copy()
        edges = np.linspace(low, high, PARTS + 1)
        for _ in range(PROGRAMS):
            k = PARTS - 1 - int(np.argmin(known[::-1]))
            if known[k] >= goal or self.left <= 0:
                break
            at = layout(self, box, float(edges[k + 1]))
            self.left -= len(at.cells) - at.before
            if (by := good_multipliers(self.model, at)) is None:
                break
            times, bound = proved(self.model, at, by)
            known = np.maximum(known, bound[-1] if low == high else _least_within(times, bound, edges))
            if known[k] < goal:
                if by.value - known[k] < 0.25 * (goal - known[k]) or box.finer >= FINEST:
                    break  # it is less the cells than the width of the box
                box = replace(box, finer=2 * box.finer)
        return float(known.min()), replace(box, known=known)

    def cut(self, box: Box, **changes: Any) -> Box | None:
        """With other instants, less what these exclude; None where nothing is left."""
        new, old = replace(box, **changes), box.start
        (low, high), close, move, part = new.start, new.close, new.move, new.part
        if close:
            close = max(close[0], move[0] if move else 0.0), min(close[1], high - self.first)
            low = max(low, min(close[0] + self.first, high))
        longest = close[1] if close else high
        if move:
            move = move[0], min(move[1], longest)
        if part:
            part = part[0], min(part[1], longest - self.model.lasts)
        if any(one and one[1] < one[0] for one in (close, move, part)):
            return None
        known = new.known
        if known is not None and (low, high) != old:
            edges = (np.linspace(*one, PARTS + 1) for one in (old, (low, high)))
            known = _least_within(next(edges), known, next(edges))
        return replace(new, start=(low, high), close=close, move=move, part=part, known=known)

    def split(self, box: Box) -> list[Box]:
        """The halves of a box; none where it is narrow."""
        sticks = self.model.sticks
        weights = {"close": 0.5 if sticks else 4.0, "move": 4.0, "part": 1.0}
        weights["start"] = 1.0 if box.close else 4.0
        spans = {name: span for name in weights if (span := getattr(box, name))}
        name = max(spans, key=lambda one: weights[one] * (spans[one][1] - spans[one][0]))
        low, high = spans[name]
        if weights[name] * (high - low) < 4.0 * NARROWEST * self.end:
            return []
        middle = 0.5 * (low + high)
        halves = (self.cut(box, **{name: one}) for one in ((low, middle), (middle, high)))
        return [half for half in halves if half]


def _least_within(edges: Vector, values: Vector, others: Vector) -> Vector:
    """The least of values between edges within each part between others."""
    first = np.clip(np.searchsorted(edges, others[:-1], "right") - 1, 0, values.size - 1)
    after: Indices = np.clip(np.searchsorted(edges, others[1:], "left"), first + 1, values.size)
    return np.array([values[a:b].min() for a, b in zip(first, after, strict=True)])


# cells and rows of a box ------------------------------------------------------------------------------------


def layout(search: _Search, box: Box, begin: float) -> Layout:
    """The cells and rows of a box, with a node where starts of length `begin` do.

    Times run up to 0, the end; instants that there are not are the first.
    """
    m, far, unit = search.model, -box.start[1], np.eye(8)
    (c0, c1), (s0, s1) = ((-span[1], -span[0]) if span else (far, far) for span in (box.close, box.move))
    o0, o1 = (-box.part[1], -box.part[0]) if box.part else (math.inf, math.inf)
    rested = c0 if box.again else s0
    # the largest z' in the open gap
    speed = float(search.speeds[np.searchsorted(search.times[:-1], c1 - far)])
    most = speed * (c1 - c0 + m.d)  # T until all have closed
    joins = follows = m.d > 0.0 and o0 >= c1  # y begins with z
    cells, rows, before = list[Phase](), list[Row](), 0
    for a, b in pairwise(sorted({far, 0.0} | {t for t in (c0, c1, s0, s1, o0, -begin) if far < t < 0.0})):
        t, before = 0.5 * (a + b), len(cells) if a == -begin else before
        shaft: Any = "free" if t > o0 else "open" if t < c0 else "enter" if t < c1 else "contact"
        load: Any = "moves" if t > s1 else "rests" if t < rested else "held"
        for h in _lengths(shaft, b - a, 2.0 * math.pi / PER_PERIOD / box.finer, search.held):
            cell = Phase(shaft, load, h, most * (shaft == "enter"), joins and shaft == "free")
            joins = joins and not cell.joins
            cells.append(cell)
            rows += _limits(m, cell, len(cells), follows)
            if shaft == "enter" and c1 - c0 <= 0.5 * m.lasts:  # z' >= 0 then: the chord of max(0, z)
                rows.append(Row(len(cells), unit[MEAN] / h, 0.5 * speed * (c1 - c0)))
        if b == c1 < 0.0 and c1 <= o0:
            rows.append(Row(len(cells), -unit[Z], 0.0))
        if b == o0 >= c1 and m.lasts > 0.0:  # z' >= -P on the way back to the opening
            back = o1 - o0 + m.d * (not m.pulls)
            rows.append(Row(len(cells), unit[Z], 0.0, back))
            rows.append(Row(len(cells), unit[W1] - unit[W2], 0.0, o1 - o0))
        if b == s1:  # the last standstill is no earlier than s0, and T no more than P since
            rows.append(Row(len(cells), unit[W2], -m.mu2 * m.mc * (s1 - s0), m.mu2 * (s1 - s0)))
    if m.terminal == "reached":
        return Layout(cells, [*rows, Row(len(cells), -unit[W2], -m.W)], [], before)
    terminal = [(unit[W2], m.W), (unit[W1], m.W), (unit[Z], m.mc + m.b2 * m.W)]
    # so small a load torque at a steady end counts as none, and no torque does not fix z
    return Layout(cells, rows, terminal[: 3 if m.terminal == "steady" and m.mc > 2e-4 else 2], before)


def _lengths(shaft: str, whole: float, fine: float, held: bool) -> list[float]:
    """Of the cells of a phase: even ones, but for the middle of a long contact."""

    def even(length: float, each: float, least: int) -> list[float]:
        n = max(least, math.ceil(length / each))
        return [length / n] * n

    if shaft == "enter":
        return even(whole, fine, 1)
    if shaft == "open":
        return even(whole, fine / 0.6, 2)
    if not held or whole <= 3.0 * EDGE:
        return even(whole, fine, 2)
    edge = even(EDGE, fine, 1)
    return edge + even(whole - 2.0 * EDGE, LONG * fine, 1) + edge


def _limits(m: Model, cell: Phase, node: int, follows: bool) -> Iterator[Row]:
    """What holds at the end of a cell and throughout it."""
    unit, h = np.eye(8), cell.length
    if m.ramped:
        yield Row(node, unit[RAMPED] / h, m.hi)
        yield Row(node, -unit[RAMPED] / h, 0.0)
    if cell.load == "held" and cell.shaft != "free" and not m.pulls:
        yield Row(node, -unit[W2], 0.0)
    if cell.shaft == "open":
        yield Row(node, unit[Z], 0.0)
    elif cell.shaft == "contact":
        yield Row(node, unit[MEAN] / h, 0.0, 1.0)
        if cell.load == "rests":
            yield Row(node, m.T, m.mc)
        yield Row(node, -m.T, 0.0, float(m.pulls))
        if m.pulls and not m.joined:
            yield Row(node, -unit[Z], 0.0)
    elif cell.shaft == "free":
        yield Row(node, unit[Z], 0.0, 1.0)
        yield Row(node, -unit[Z], m.gap, 1.0)
        if follows:
            yield Row(node, unit[Z] - unit[Y], 0.0)
        elif m.d == 0.0:
            yield Row(node, unit[MEAN] / h, 0.0)
