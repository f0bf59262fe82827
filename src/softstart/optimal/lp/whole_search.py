"""The search for the instants of a whole start: the orders of phases, then the instants, then the grid.

P over the instants is smooth but for kinks. A scan finds where its minima are; from there the program itself,
linearised in the instants, gives the direction, first on a coarse grid, then on grids that are finer where
the torque switches or T exceeds its limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.optimal.exact import replay
from softstart.optimal.lp.motion import Contact
from softstart.optimal.lp.rows import Refinement, WarmStarts, contact_grid, no_linear_objective, refined
from softstart.optimal.lp.whole import Grid, Instants, Kind, WholeAnswer, WholeProgram
from softstart.optimal.problem import Problem
from softstart.optimal.result import Candidate
from softstart.profile import TorqueProfile

Timing = tuple[float, float, float]  # see _Timings
Value = Callable[[Timing], float]

DOUBLINGS = 40  # of the time in which full torque is simulated until the load moves
COARSE, MIDDLE = 40, 80  # steps of the contact: to find the instants, to refine them
REFINEMENT = Refinement(most=260, mending=6, settled=2e-5)
SCANNED = 14  # instants of the contact that are tried at first
# durations of the winding up that are tried, as multiples of the one under full torque and of a quarter of
# the period in which the motor swings against the load at rest: a damped impact under full torque has none
WINDING, SWING = (1.0, 6.0), (0.02, 0.5)
ENOUGH = 5e-6  # relative: other instants that lower P by less end the search
LATER = (1.05, 1.3)  # times an end
SOONER = (0.93, 0.8, 0.6, 0.45, 0.35, 0.25, 0.18, 0.12, 0.08, 0.05)  # shares of an end that are tried
TRIALS = 25  # of better instants
FINEST = 1e-7  # of t_f, to which they are found
LOCAL_MINIMA = 3
MOST_INHERITED = 400  # edges of a grid that another start time begins with
DRIFT = 1e-4  # relative: an answer on a grid of its own that is so much gentler is worth its time
MENDED = (1e-3, 1e-4)  # of t_f: how far instants may move where its steps exceed a limit
EARLIEST = 1.0 + 1e-7  # just later than under full torque: the grid cannot do better


# orders of phases -----------------------------------------------------------------------------------------


def not_linear(problem: Problem) -> str:
    """Why the whole start is no linear program with given instants; empty if it is one."""
    smooth = "the weight on the smoothness is not linear" if problem.smoothness > 0.0 else ""
    return no_linear_objective(problem) or smooth or _no_phases(problem.drive)


def _no_phases(drive: Any) -> str:
    half = 0.5 * drive.gap
    v0 = drive.initial_motor_speed - drive.initial_load_speed
    reactive = drive.load_kind == "reactive" and drive.Mc > 0.0
    if drive.contact_law == "modelica" and drive.d > 0.0:
        return "the damped modelica law is not linear in contact"
    if drive.theta0 < -half or (drive.theta0 == -half and v0 < 0.0):
        return "the start begins on the far flank"
    if drive.theta0 >= half and v0 < 0.0:
        return "the flanks part at once"
    if reactive and (drive.initial_load_speed != 0.0 or (drive.theta0 >= half and v0 != 0.0)):
        return "a reactive load that moves before the contact"
    if reactive and drive.c * (drive.theta0 - half) > drive.Mc:
        return "the start is wound up against the load"
    return ""


@dataclass(frozen=True)
class PhaseOrder:
    """An order of phases, and how soon full torque passes it: contact at `tc`, breakaway at `tb`, s."""

    kinds: tuple[Kind, ...]
    tc: float
    tb: float


def phase_orders(problem: Problem) -> Iterator[PhaseOrder]:
    """The orders of phases that a start may have."""
    drive: Any = problem.drive
    reactive = drive.load_kind == "reactive" and drive.Mc > 0.0
    touching = drive.theta0 >= 0.5 * drive.gap
    tc, tb = _under_full_torque(problem)
    if not reactive:
        yield PhaseOrder(("contact",) if touching else ("gap", "contact"), tc, tc)
        return
    yield PhaseOrder(("stuck", "contact") if touching else ("resting", "stuck", "contact"), tc, tb)
    if not touching and drive.d > 0.0:
        fastest = math.sqrt(2.0 * problem.highest_torque / drive.J1 * drive.gap) + drive.initial_motor_speed
        if drive.d * fastest > drive.Mc:
            yield PhaseOrder(("resting", "contact"), tc, tc)


def _under_full_torque(problem: Problem) -> tuple[float, float]:
    """Contact and breakaway on the exact plant under the largest torque, s; inf: they never come."""
    drive: Any = problem.drive
    full = TorqueProfile([0.0], [problem.highest_torque])
    touching = drive.theta0 >= 0.5 * drive.gap
    reactive = drive.load_kind == "reactive" and drive.Mc > 0.0
    until = 2.0 * math.pi / drive.Omega + 2.0 * math.sqrt(drive.gap * drive.J1 / problem.highest_torque)
    for _ in range(DOUBLINGS):
        run = replay(drive, full, until, problem.base)
        tc = 0.0 if touching else run.first_contact
        moving = [event.time for event in run.events if event.kind == "load starts"]
        tb = moving[0] if moving else math.nan
        if math.isfinite(tc) and (math.isfinite(tb) or not reactive):
            return tc, max(tc, tb) if reactive else tc
        until *= 2.0
    return math.inf, math.inf


# the search ------------------------------------------------------------------------------------------------


def solve(
    problem: Problem, start: tuple[PhaseOrder, Timing] | None = None, near: Any = None, loose: bool = False
) -> Candidate | None:
    """The optimum of a problem that `not_linear` has nothing against; None if no torque meets the terms.

    With `start` it is looked for from these instants on, with `near`, what the answer of another start time
    leaves, from its instants on and on its grid, instead of by a scan. If that is `loose`, no bound will tell
    that a grid of its own would be better, and this is tried, ever more rarely while it gains nothing.
    """
    assert problem.start_time is not None
    wait = pause = 0
    if near is not None:
        known = near if isinstance(near, _Known) else None
        best = None if known is None else _beside(problem, known)
        if best is not None and known is not None and loose:
            wait, pause = known.wait - 1, known.pause
            if wait < 0:
                own = _refined(problem, _order_of(problem, best.grid), best)
                pause = 2 * pause + 1 if own.P > best.P * (1.0 - DRIFT) else 0
                best, wait = min(own, best, key=lambda one: one.P), pause
    else:
        best = search(problem) if start is None else _from(problem, *start)
    if best is None:
        return None
    left = _Known(best.at, best.grid, best.beyond, float(problem.start_time), wait, pause)
    note = f"{best.edges.size - 1} steps"
    return Candidate(best.profile(problem), best.at.end, best.P / problem.base_torque, "lp", note, left)


@dataclass(frozen=True, eq=False)
class _Known:
    """An answer from which that of another start time is found: its instants, grid and start time in s.

    `wait`: so many such answers pass before one gets a grid of its own; `pause`: how many waited last.
    """

    at: Instants
    grid: Grid
    beyond: bool
    latest: float
    wait: int
    pause: int


def search(problem: Problem) -> WholeAnswer | None:
    """The best answer over all instants, on a grid refined where the torque switches."""
    assert problem.start_time is not None
    latest = float(problem.start_time)
    orders = list(phase_orders(problem))
    found = [(order, best) for order in orders if (best := _coarse(problem, order, latest)) is not None]
    found = [(order, _sooner(problem, order, latest, best)) for order, best in found]
    for share in SOONER:  # with all that time the gap could not close only once
        if found or any(_too_late(problem, order, latest) for order in orders):
            break
        sooner = [(order, _Timings(problem, order, latest, COARSE).best(share * latest)) for order in orders]
        found = [(order, best) for order, best in sooner if best is not None]
    return _refined(problem, *min(found, key=lambda one: one[1].P)) if found else None


def _from(problem: Problem, order: PhaseOrder, at: Timing) -> WholeAnswer | None:
    assert problem.start_time is not None
    best = _Timings(problem, order, float(problem.start_time), MIDDLE).moved(at, 0.1 * at[2])
    return None if best is None else _refined(problem, order, best)


def _order_of(problem: Problem, grid: Grid) -> PhaseOrder:
    """The order of phases of a grid."""
    kinds = tuple(kind for kind, _ in grid)
    return next(one for one in phase_orders(problem) if one.kinds == kinds)


def _beside(problem: Problem, near: _Known) -> WholeAnswer | None:
    """The answer for another start time, from the instants known and on their grid, mended if need be."""
    assert problem.start_time is not None
    latest = float(problem.start_time)
    if sum(edges.size for _, edges in near.grid) > MOST_INHERITED:
        return None
    order = _order_of(problem, near.grid)
    timings = _Timings(problem, order, latest, 0, near.grid, near.beyond)
    winding = near.at.tb - near.at.tc if timings.winds else 0.0
    end = min(near.at.end * latest / near.latest, latest)
    later = near.at.tb + end - near.at.end  # with as much time in contact
    for x in (near.at.tb, near.at.tb * end / near.at.end, later):
        start = timings.timing(x, winding, end)
        if math.isfinite(timings.peak(start)):
            best = timings.moved(start, 0.1 * end)
            break
    else:
        return None
    for width in MENDED:
        if best is None or not best.broken.any():
            break
        best = _moved(problem, order, best, best.finer(best.broken), width * end)
    return best


def _coarse(problem: Problem, order: PhaseOrder, latest: float) -> WholeAnswer | None:
    """The best answer on a coarse grid, or on a finer one where there is hardly enough time."""
    for steps in (COARSE, MIDDLE):
        best = _Timings(problem, order, latest, steps).best(latest)
        if best is not None:
            return best
    return None


def _sooner(problem: Problem, order: PhaseOrder, latest: float, best: WholeAnswer) -> WholeAnswer:
    """The best answer known, or a better one that ends sooner: more time may be of no use."""
    trials = _Timings(problem, order, latest, COARSE)
    winding = best.at.tb - best.at.tc if trials.winds else 0.0
    answers = [best]
    for share in SOONER:
        at = trials.timing(best.at.tb, winding, share * best.at.end)
        if at[0] < at[2] and math.isfinite(trials.peak(at)):
            answers.append(trials.moved(at, 0.1 * at[2]) or best)
        elif len(answers) > 1:
            break
    return min(answers, key=lambda one: one.P)


def _too_late(problem: Problem, order: PhaseOrder, latest: float) -> bool:
    """True if the load gets moving, but not to its speed: a start that ends sooner is no help."""
    speed, _ = greatest_speed(problem, order, latest, COARSE)
    return -math.inf < speed < problem.target


def greatest_speed(
    problem: Problem, order: PhaseOrder, end: float, steps: int, near: Timing | None = None
) -> tuple[float, Timing]:
    """The greatest load speed at `end`, rad/s, and the instants it needs; -inf where none fit.

    Where `near`, those of a similar end, lead to a start, or were those of a later end, no others are tried.
    """
    return _Timings(problem, order, end, steps).greatest_speed(end, near)


class _Timings:
    """Answers over the instants of one order of phases, each computed once.

    A timing is (x, w, end): x is when the load begins to be driven, w how long the shaft is
    wound up before, 0 where it is not; `latest` bounds the end.
    """

    def __init__(
        self, problem: Problem, order: PhaseOrder, latest: float, steps: int, grid: Grid | None = None,
        full_tail: bool = False,
    ) -> None:  # fmt: skip
        self.problem, self.order, self.latest, self.steps, self.grid = problem, order, latest, steps, grid
        self.full_tail = full_tail
        self.winds = "stuck" in order.kinds
        self.waits = "gap" in order.kinds or "resting" in order.kinds
        self.answers: dict[Timing, WholeAnswer | None] = {}
        self.speeds: dict[Timing, tuple[float, Vector | None]] = {}
        self.warm = WarmStarts(), WarmStarts()
        self.shortest_winding = max(order.tb - order.tc, 1e-9 * latest) if self.winds else 0.0

    def program(self, at: Timing, grid: Grid | None = None) -> WholeProgram | None:
        """The program with these instants; None where they are out of order."""
        x, w, end = at
        tc = x - w if self.waits else 0.0
        if (self.waits and tc < self.order.tc) or (self.winds and w <= 0.0) or x >= end:
            return None
        instants = Instants(tc, x, end)
        grid = grid or self.grid or first_grid(self.problem, self.order, instants, self.steps)
        return WholeProgram(self.problem, instants, grid, self.full_tail, self.warm)

    def peak(self, at: Timing) -> float:
        """P, N m; inf where there is no start."""
        if at not in self.answers:
            program = self.program(at)
            self.answers[at] = None if program is None else program.solve()
        answer = self.answers[at]
        return math.inf if answer is None else answer.P

    def slowness(self, at: Timing) -> float:
        """Minus the greatest load speed, rad/s; inf where no start fits."""
        if at not in self.speeds:
            program = self.program(at)
            self.speeds[at] = (-math.inf, None) if program is None else program.greatest_speed()
        return -self.speeds[at][0]

    def best(self, end: float) -> WholeAnswer | None:
        """The least P over the instants, from this end on; None where there is no start."""
        start = self._least(end, fast=False)
        if math.isinf(self.peak(start)):  # little time: a narrow window is left, if any
            speed, start = self.greatest_speed(end)
            for share in LATER if self.steps > COARSE else ():  # where the window is wider, and from there on
                if not speed >= self.problem.target:
                    near = self.greatest_speed(share * end)
                    if math.isfinite(near[0]):
                        speed, start = self.greatest_speed(end, near[1])
            if not speed >= self.problem.target or math.isinf(self.peak(start)):
                return None
            self._down(start, 0.1 * end, fast=False)
        return self.found()

    def found(self) -> WholeAnswer | None:
        """The answer with the least P so far."""
        return self.answers[min(self.answers, key=self.peak)]

    def greatest_speed(self, end: float, near: Timing | None = None) -> tuple[float, Timing]:
        """The greatest load speed at the end, rad/s, and the instants it needs; -inf where none fit."""
        if near is not None:
            start = self._down((near[0], near[1], end), 0.1 * near[0], fast=True)
            if math.isfinite(self.slowness(start)) or end < near[2]:
                return -self.slowness(start), start
        start = self._least(end, fast=True)
        return -self.slowness(start), start

    def moved(self, start: Timing, width: float) -> WholeAnswer | None:
        """The least P near a start known, at first within `width` s."""
        self._down(start, width, fast=False)
        return self.found()

    def timing(self, x: float, w: float, end: float) -> Timing:
        """A shaft that is touched from the beginning is wound up all the time before x."""
        return (x, w, end) if self.waits or not self.winds else (x, x, end)

    def _least(self, end: float, fast: bool) -> Timing:
        """The instants with the least value found: a scan, then down from its lowest points."""
        value = self.slowness if fast else self.peak
        tried = self._scan(value, end)
        xs = sorted({at[0] for at in tried})
        lowest = {x: min((at for at in tried if at[0] == x), key=lambda at: tried[at]) for x in xs}
        values = [math.inf, *(tried[lowest[x]] for x in xs), math.inf]
        minima = [k for k in range(len(xs)) if values[k] >= values[k + 1] <= values[k + 2]]
        ends = []
        for k in sorted(minima, key=lambda k: values[k + 1])[:LOCAL_MINIMA]:
            if math.isfinite(values[k + 1]):
                width = max(xs[min(k + 1, len(xs) - 1)] - xs[k], xs[k] - xs[max(k - 1, 0)])
                ends.append(self._down(lowest[xs[k]], min(width, 0.1 * end) or 0.1 * end, fast))
        return min(ends or tried, key=value)

    def _scan(self, value: Value, end: float) -> dict[Timing, float]:
        """Values over a coarse net of instants, the earliest first."""
        windings = [0.0]
        if self.winds and self.waits:
            drive: Any = self.problem.drive
            quarter = 0.5 * math.pi * math.sqrt(drive.J1 / drive.c)
            least, most = (
                max(one * self.shortest_winding, share * quarter)
                for one, share in zip(WINDING, SWING, strict=True)
            )
            count = math.ceil(math.log2(most / least)) + 1
            windings = sorted({self.shortest_winding, *np.geomspace(least, most, count).tolist()})
        tried = {(end, 0.0, end): math.inf}
        late = 0
        for x in self._times(end):
            timings = [self.timing(x, w, end) for w in windings]
            here = {at: value(at) for at in timings}
            tried |= here
            none = math.isinf(min(here.values()))
            late = late + 1 if none and math.isfinite(min(tried.values())) else 0
            if late == 2:
                break  # no time is left
        return tried

    def _times(self, end: float) -> list[float]:
        first = self.order.tb * EARLIEST
        if not (self.waits or self.winds):
            return [0.0]
        shares = np.linspace(0.0, 1.0, SCANNED, endpoint=False) ** 2.5
        return (first + (end - first) * shares).tolist() if first < end else []

    def _down(self, start: Timing, width: float, fast: bool) -> Timing:
        """From a known start to the best one near it, by the program linearised in the instants.

        A step is taken where it helps, and may then be longer; else it is tried again, shorter.
        """
        value = self.slowness if fast else self.peak
        at, least = start, value(start)
        reach = width
        for _ in range(TRIALS):
            if not math.isfinite(least) or reach < FINEST * at[2]:
                break
            there = self._shifted(at, reach, fast)
            if there is None or there == at:
                break
            gained = least - value(there)
            moved = max(abs(there[i] - at[i]) for i in range(3))
            if gained > 0.0:
                at, least = there, value(there)
                if gained < ENOUGH * abs(least):
                    break
                reach *= 1.5 if moved > 0.5 * reach else 0.5
            else:
                reach = 0.25 * min(reach, moved)
        return at

    def _shifted(self, at: Timing, reach: float, fast: bool) -> Timing | None:
        """Where the best instants seem to be, none further than `reach`."""
        x, w, end = at
        own = self.program(at)
        answer = self.answers.get(at)
        found = self.speeds[at][1] if fast else answer.x if answer is not None else None
        if own is None or found is None:
            return None
        tiny = 1e-6 * end
        # which instant, by how much it is tried, how far it may go
        free: list[tuple[int, float, list[float]]] = []
        if self.waits or self.winds:
            free.append((0, tiny, [-reach, reach]))
        if self.waits and self.winds:
            by = min(tiny, 1e-3 * w)
            room = x - w - by >= self.order.tc
            free.append((1, by if room else -by, [-min(reach, 0.3 * w), min(reach, 0.3 * w)]))
        if not fast:
            free.append((2, -tiny, [-reach, min(reach, self.latest - end)]))
        shifts = np.array([by for _, by, _ in free])
        near = []
        for i, by, _ in free:
            moved = [x, w, end]
            moved[i] += by
            near.append(self.program(self.timing(*moved), own.grid))
        if not free or any(one is None for one in near):
            return None
        weights = np.array([{0: 1.0, 1: -1.0, 2: 0.0}[i] for i, _, _ in free])
        soonest = self.order.tc - (x - w) if self.waits else -0.5 * x  # no contact before that of full torque
        ends = np.array([limits for _, _, limits in free])
        programs = [one for one in near if one is not None]
        shift = own.shifted(fast, found, programs, shifts, ends, (weights, soonest))
        if shift is None:
            return None
        moved = [x, w, end]
        for (i, _, _), by in zip(free, shift.tolist(), strict=True):
            moved[i] += by
        there = self.timing(*moved)
        while self.waits and there[0] - there[1] < self.order.tc:  # by rounding
            there = there[0] + 1e-12 * end, there[1], there[2]
        return there


def first_grid(problem: Problem, order: PhaseOrder, at: Instants, steps: int) -> Grid:
    """Even steps in the gap and while the shaft is wound up; fine ends in a long contact."""
    contact = Contact.of(problem.drive)
    grids: dict[Kind, Vector] = {
        "gap": np.linspace(0.0, 1.0, steps // 4 + 1),
        "resting": np.linspace(0.0, 1.0, steps // 4 + 1),
        "stuck": np.linspace(0.0, 1.0, steps // 8 + 1),
        "contact": contact_grid(contact, at.end - at.tb, steps),
    }
    return tuple((kind, grids[kind]) for kind in order.kinds)


def _refined(problem: Problem, order: PhaseOrder, best: WholeAnswer) -> WholeAnswer:
    """The same instants, moved a little, on a grid that is finer where the torque switches or T exceeds P."""

    def moved(best: WholeAnswer, grid: Grid, width: float, mending: bool) -> WholeAnswer:
        return _moved(problem, order, best, grid, width)

    grid = first_grid(problem, order, best.at, MIDDLE)
    return refined(best, grid, REFINEMENT, problem.highest_torque, moved)


def _moved(problem: Problem, order: PhaseOrder, best: WholeAnswer, grid: Grid, width: float) -> WholeAnswer:
    """The best instants within `width` of those known, on another grid."""
    assert problem.start_time is not None
    near = _Timings(problem, order, float(problem.start_time), 0, grid, best.beyond)
    winding = best.at.tb - best.at.tc if near.winds else 0.0
    found = near.moved(near.timing(best.at.tb, winding, best.at.end), width)
    return found if found is not None else best
