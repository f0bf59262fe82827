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
    DEMAND,
    MEAN,
    RAMPED,
    RUB,
    W1,
    W2,
    Layout,
    Model,
    Phase,
    R,
    Row,
    U,
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
CELLS = 24_000  # in linear programs, a half of them for starts that close once: some 0.4 ms each
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


def dual_bounds(
    problem: Problem, k_dyn: float, end: float | None = None, *, cells: int = CELLS
) -> tuple[LowerBound, LowerBound]:
    """Lower bounds on K_dyn for any number of contacts, and for starts whose gap closes once.

    Both hold for every start that ends at the start time, or `end` in s, or before. `k_dyn` is what is to be
    judged: the work ends once a bound is within 5e-4 of it, or after linear programs with so many cells in
    all: a count, so that equal requests have equal bounds. Where nothing is better the momentum bound.

    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    >>> for bound in dual_bounds(Problem(drive.replace(torque_lag=0.002), 0.2883042), 0.9237):
    ...     print(round(bound.k_dyn, 2), bound.kind)
    0.92 duality
    0.92 duality
    """
    if end is not None:
        limit = None if problem.minimise == "k_dyn" else problem.k_dyn
        problem = replace(problem, start_time=end, minimise="k_dyn" if limit is None else "heat", k_dyn=limit)
    whole = momentum_bound(problem)
    if not_covered(problem):
        return whole, whole
    best = [whole, whole]
    for machine in problem.machines:
        left = [i for i in (0, 1) if best[i].k_dyn < k_dyn * (1.0 - WITHIN)]
        if not left or whole.kind == "none":
            break
        found = _Search(problem, machine, k_dyn).both(cells // len(problem.machines))
        for i, peak in enumerate(found):
            if peak * float(machine.Ms) / problem.base_torque > best[i].k_dyn:
                best[i] = LowerBound(
                    peak * float(machine.Ms) / problem.base_torque,
                    "duality",
                    _covers(problem, machine, i == 1),
                )
    return best[0], best[1]


def _covers(problem: Problem, machine: Drive, once: bool) -> str:
    """The class of starts in words."""
    limits = f"{problem.lowest_torque:g} to {problem.highest_torque:g}"
    every = f"every torque from {limits} N m over time, by whatever "
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

    @property
    def longest(self) -> float:
        """Of the first contact, to the end."""
        return self.close[1] if self.close else self.start[1]


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
        self.tail = self.kernel() * (not (m.pulls and m.sticks))
        if m.sticks:  # the load moves on until then
            self.tail = min(self.tail, 0.99 * m.W / (m.mu2 * m.mc))
        self.after, self.left = self.coasting(), 0

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

    def kernel(self, n: int = 400) -> float:
        """No torque after the end lowers T sooner than after so long."""
        m, h = self.model, self.model.half / 400
        E, x = m.step(Phase("contact", "moves", h)).E, np.eye(8)[W1]
        for k in range(n):
            x = E @ x
            if m.T @ x <= 0.0:
                return k * h
        return m.half * (1.0 - 1e-9)

    def coasting(self, n: int = 200) -> Vector:
        """Most T, less the least P, that the least torque after the end can bring once the gap has opened."""
        m, h = self.model, self.tail / 200
        if h <= 0.0:
            return np.zeros(1)
        step = m.step(Phase("contact", "moves", h))
        x, most, found = np.zeros(8), 0.0, [0.0]
        x[[W1, W2]], x[[U, R]], p = m.W, m.hi * m.slow, np.zeros(6)
        for _ in range(n):
            p[[DEMAND, RUB]] = -min(1.0, float(x[m.demand]) / (h * m.rate)) if m.ramped else 0.0, -m.F
            x = step.E @ x + step.fixed + step.G @ p
            most = max(most, float(m.T @ x))
            found.append(most)
        return np.maximum(np.array(found) - m.least, 0.0)

    def speed(self, t: float) -> float:
        """Largest z' in the open gap until t."""
        return float(self.speeds[min(int(np.searchsorted(self.times, t)), self.speeds.size - 1)])

    def plain(self, box: Box) -> float:
        """What momentum says of a box."""
        m = self.model
        left = box.move[1] if box.move else box.longest
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
        tie = itertools.count()
        heap = [(self.plain(box), next(tie), box, False) for box in boxes]
        heapq.heapify(heap)
        while heap:
            value, _, box, done = heapq.heappop(heap)
            if value >= goal or self.left <= 0:
                return value
            if not done:
                low, box = self.judged(box, goal)
                heapq.heappush(heap, (max(value, low), next(tie), box, True))
                continue
            halves = self.split(box)
            if not halves:
                return value
            for half in halves:
                heapq.heappush(heap, (max(value, self.plain(half)), next(tie), half, False))
        return math.inf

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


class _Instants:
    """Edges of a box as times from the end on; far ones where there is no such instant."""

    def __init__(self, search: _Search, box: Box) -> None:
        far, m = -box.start[1], search.model
        every = box.close, box.move, box.part
        spans = [(-span[1], -span[0]) if span else None for span in every]
        (self.c0, self.c1), (self.s0, self.s1) = (one or (far, far) for one in spans[:2])
        self.o0, self.o1 = spans[2] or (math.inf, math.inf)
        self.tail = 0.0 if box.part else search.tail
        self.speed = search.speed(self.c1 + box.start[1]) if box.close else 0.0
        self.most = self.speed * (self.c1 - self.c0 + m.d)  # T until all have closed
        # z' is not below 0 so soon after a closing
        self.rises = self.c1 - self.c0 <= 0.5 * m.half
        self.begin = self.c0 if box.again else self.s0
        instants = self.c0, self.c1, self.s0, self.s1, self.o0
        marks = {t for t in instants if far < t < 0.0}
        self.marks, self.far = {far, 0.0, self.tail} | marks, far

    def phase(self, t: float, moves: bool) -> Phase:
        """At t between marks."""
        shaft: Any = "open" if t < self.c0 else "enter" if t < self.c1 else "contact"
        load: Any = "moves" if not moves or t > self.s1 else "rests" if t < self.begin else "held"
        shaft = "free" if t > self.o0 else shaft
        return Phase(shaft, load, 0.0, self.most * (shaft == "enter"))


def layout(search: _Search, box: Box, begin: float) -> Layout:
    """The cells and rows of a box, with a node at the start of length `begin`."""
    m, at = search.model, _Instants(search, box)
    cells, rows, node = list[Phase](), list[Row](), {at.far: 0}
    joins = m.d > 0.0
    for a, b in pairwise(sorted(at.marks | {-begin})):
        phase, t = at.phase(0.5 * (a + b), box.move is not None), a
        for h in _lengths(phase.shaft, b - a, 2.0 * math.pi / PER_PERIOD / box.finer, search.held):
            t += h
            one = phase._replace(length=h)
            if phase.shaft == "free":
                # T cannot rise more quickly once all have opened, as z' is limited
                rise = m.quickest * (t - at.o0 + m.d) if t - h >= at.o1 else 1.0
                late = -1.0 if at.o0 >= at.c1 else at.most
                one = one._replace(most=min(1.0, rise), joins=joins, begin=late if joins else -1.0)
                joins = False
            cells.append(one)
            rows += _limits(m, one, len(cells)) if b <= 0.0 else _after(search, h, t, len(cells))
        node[b] = len(cells)
    rows += _entering(m, at, cells) + list(_instants(m, at, box, node))
    unit, terminal = np.eye(8), list[tuple[Vector, float]]()
    if m.terminal == "reached":
        rows.append(Row(node[0.0], -unit[W2], -m.W))
    else:
        terminal = [(unit[W2], m.W), (unit[W1], m.W), (unit[Z], m.mc + m.b2 * m.W)]
        # so small a load torque at a steady end counts as none, and no torque does not fix z
        terminal = terminal[: 3 if m.terminal == "steady" and m.mc > 2e-4 else 2]
    return Layout(cells, rows, terminal, node[0.0], node[-begin])


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


def _after(search: _Search, h: float, t: float, node: int) -> Iterator[Row]:
    """T after the end, until which t has gone by, under the least torque: the start itself has no less."""
    m, k = search.model, math.ceil(t / search.tail * (search.after.size - 1))
    more, unit = float(search.after[min(k, search.after.size - 1)]), np.eye(8)
    factor = 1.0 + 2.0 * m.mu2**2 * m.b2 * search.tail  # as the load may have become quicker
    yield Row(node, m.T, more, factor)
    yield Row(node, unit[MEAN] / h, more, factor)
    if m.ramped:
        yield Row(node, -unit[RAMPED] / h, 0.0)


def _limits(m: Model, cell: Phase, node: int) -> Iterator[Row]:
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
        yield Row(node, m.T, 0.0, 1.0)
        yield Row(node, unit[MEAN] / h, 0.0, 1.0)
        if cell.load == "rests":
            yield Row(node, m.T, m.mc)
        yield Row(node, -m.T, 0.0, float(m.pulls))
        if m.pulls and not m.joined:
            yield Row(node, -unit[Z], 0.0)
    elif cell.shaft == "free":
        yield Row(node, unit[Z], 0.0, 1.0)
        yield Row(node, -unit[Z], m.gap, 1.0)
        yield Row(node, unit[Z] - unit[Y], 0.0) if m.d > 0.0 else Row(node, unit[MEAN] / h, 0.0)


def _entering(m: Model, at: _Instants, cells: list[Phase]) -> list[Row]:
    """T <= (z + width v)/2 + d z' while the closing is within its cell: the chord of max(0, z)."""
    most, unit = (0.5 * at.speed + m.d * m.drag) * (at.c1 - at.c0), np.eye(8)
    entering = [k for k, cell in enumerate(cells) if cell.shaft == "enter" and at.rises]
    return [Row(k + 1, unit[MEAN] / cells[k].length, most) for k in entering]


def _instants(m: Model, at: _Instants, box: Box, node: dict[float, int]) -> Iterator[Row]:
    """What is known at closing, opening and breakaway, less what can change within their cells."""
    unit, closed = np.eye(8), at.c1 <= at.o0
    if box.close and closed and at.c1 in node and at.c1 < 0.0:
        yield Row(node[at.c1], -unit[Z], 0.0)
    if box.part and closed and at.o0 in node:
        width = at.o1 - at.o0
        back = width + m.d * (not m.pulls)
        yield Row(node[at.o0], unit[Z], m.drag * back, back)
        yield Row(node[at.o0], unit[W1] - unit[W2], m.drag * width, width)
    if box.move and at.s1 in node:
        width = at.s1 - at.s0
        yield Row(node[at.s1], unit[W2], -m.mu2 * m.mc * width, m.mu2 * width)
        if at.c1 <= at.s1 <= at.o0 and m.b1 == 0.0:
            change = width * (width + m.d)
            least = m.mc - width * m.d * m.mu1 * (m.hi + m.F) - change * m.F * m.mu1
            yield Row(node[at.s1], -m.T, -least, change)
