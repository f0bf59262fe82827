"""`least_work`: the law with the least friction work at a given peak of the shaft torque, and how far it may
be off.

In turns, the cuts name the end that looks best (`cells`), and the linear program finds the law that leads
there and what its multipliers prove (`program`), until what is proved and what is found agree. Each law is
engaged on the exact clutch, and its figures are those of that run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.clutch.model import Clutch
from softstart.clutch.optimal.cells import least_over_ends
from softstart.clutch.optimal.program import Answer, Cut, Program
from softstart.clutch.optimal.slip import Slip
from softstart.clutch.result import Engagement
from softstart.clutch.start import engage
from softstart.errors import SimulationError

__all__ = ["COVERS", "OptimalLaw", "Search"]

Vector = NDArray[np.float64]

STEPS = 160
CLOSE = 2e-4  # of the work: found and proved agree
TURNS = 25
# by which a law may exceed its peak between the instants checked; the bound is that of the peak it has
OVER = 2e-4
AGREES = 1e-9
TOUCHES = (
    2e-4,
    1e-3,
    5e-3,
)  # of MM: how far from merely touching w0 an end is sought, the next where one fails

COVERS = {
    "any": "all laws with 0 <= M(t) <= MM for t < tM and M = MM from tM on, with which the clutch slips for "
    "at least "
    "one elastic period after tM; peak and work up to the first lock-up",
    "nondecreasing": "all nondecreasing laws with 0 <= M(t) <= MM for t < tM and M = MM from tM on, with "
    "which the "
    "clutch slips for at least one elastic period after tM; peak and work up to the first lock-up",
}


@dataclass(frozen=True, eq=False)
class OptimalLaw:
    """A law with the least friction work at its peak torque; SI.

    `times`, `torques` are its table (steps are two points at one instant). `run` is its engagement, which
    `peak_torque` and `slip_work` are taken from. No law of the class has less work than `work_bound` at this
    peak.
    """

    times: tuple[float, ...]
    torques: tuple[float, ...]
    run: Engagement
    work_bound: float

    @property
    def peak_torque(self) -> float:
        """Largest shaft torque up to the lock-up, N m."""
        return self.run.slip_peak_torque

    @property
    def slip_work(self) -> float:
        """Friction work up to the lock-up, J."""
        return self.run.slip_work

    @property
    def gap_percent(self) -> float:
        """How far above the bound the work is, percent."""
        return 100.0 * (self.slip_work / self.work_bound - 1.0)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "peak_torque": self.peak_torque,
            "slip_work": self.slip_work,
            "work_bound": self.work_bound,
            "gap_percent": self.gap_percent,
            "slip_time": self.run.slip_time,
            "locked_peak_torque": self.run.locked_peak_torque,
            "friction_work": self.run.friction_work,
            "times": list(self.times),
            "torques": list(self.torques),
        }


class Search:
    """Optima of one clutch in one class of laws; what was proved for one peak serves the next.

    >>> search = Search(Clutch.load("paper-c"), "any", steps=60)
    >>> best = search.least_work(60 * 9.80665)
    >>> best.peak_torque <= 60 * 9.80665 * 1.0002, best.work_bound <= best.slip_work, best.gap_percent < 0.1
    (True, True, True)
    """

    def __init__(self, clutch: Clutch, law_class: str = "any", steps: int = STEPS) -> None:
        self.clutch, self.law_class = clutch, law_class
        self.slip = Slip.of(clutch)
        self.program = Program(self.slip, law_class == "nondecreasing", steps)
        self.cuts: list[Cut] = []
        middle = self.slip.w0 - 0.8 * self.slip.g * self.slip.tM
        self.cuts.append(self.program.solve(np.array([0.0, 0.0, middle]), 1.2 * self.slip.Tm).cut)

    def work_bound(self, P: float) -> float:
        """Work in J below which no law of the class with a peak of P (N m) lies, as far as proved by now."""
        return least_over_ends(self.slip, self.cuts, P, 0.3 * CLOSE * self._scale).bound

    @property
    def _scale(self) -> float:
        return 0.5 * self.slip.I * self.slip.w0**2

    def least_work(self, P: float) -> OptimalLaw:
        """The law of the least work whose peak is P (N m) at most, by no more than `OVER` of it above.

        Raises SimulationError if none is found whose work on the exact clutch is that of the program.
        """
        best: OptimalLaw | None = None
        before, level = -math.inf, 0
        for _ in range(TURNS):
            touch = TOUCHES[level] * self.slip.MM
            least = least_over_ends(self.slip, self.cuts, P, 0.3 * CLOSE * self._scale, touch)
            at = (np.array(one) for one in (least.s, least.p, least.q))
            answer = self.program.solve(np.array([float(x) for x in self.slip.start_of_end(*at)]), P)
            self.cuts.append(answer.cut)
            found = self._engaged(answer)
            allowed = found is not None and found.peak_torque <= P * (1.0 + OVER)
            if found is not None and allowed and (best is None or found.slip_work < best.slip_work):
                best = found
            if best is not None and best.slip_work - least.bound <= CLOSE * least.bound:
                break
            if least.bound <= before * (1.0 + 1e-7):  # this end has nothing more to say
                level += 1
                if level == len(TOUCHES):
                    break
            before = least.bound
        if best is None:
            raise SimulationError(
                f"No law with a peak of {P:.6g} N m was found for {self.clutch.name}: the grid of "
                f"{self.program.edges.size - 1} steps is too coarse for it; ask for more steps or a higher "
                f"peak."
            )
        bound = self.work_bound(max(best.peak_torque, self.slip.Tm))
        if best.slip_work < bound * (1.0 - 1e-9):
            raise SimulationError(
                f"A law with less work than proved possible ({bound:.9g} J): a mistake in softstart."
            )
        return OptimalLaw(best.times, best.torques, best.run, bound)

    def _engaged(self, answer: Answer) -> OptimalLaw | None:
        """The law on the exact clutch, checked against what the program says; None if it locks before it
        should.
        """
        times, torques = merged(self.program.edges, answer.torques, self.slip.MM)
        run = engage(self.clutch.with_table(times, torques))
        s = run.slip_time - self.slip.tM
        if not s >= self.slip.period:
            return None
        matrix, free = self.slip.ends_by(self.program.edges)
        a, b, _, A = (matrix @ answer.torques + free).tolist()
        turn = self.slip.B * s
        p, q = a * math.cos(turn) + b * math.sin(turn), b * math.cos(turn) - a * math.sin(turn)
        claimed = float(self.slip.work(np.array(A), np.array(s), np.array(p), np.array(q)))
        if abs(claimed - run.slip_work) > AGREES * run.slip_work:
            raise SimulationError(
                f"The program claims {claimed:.12g} J of friction work and the exact clutch has "
                f"{run.slip_work:.12g} J: "
                "a mistake in softstart."
            )
        return OptimalLaw(tuple(times), tuple(torques), run, 0.0)


def merged(edges: Vector, torques: Vector, MM: float) -> tuple[list[float], list[float]]:
    """Constant torques between edges as a table of steps, equal neighbours joined; MM is held behind.

    >>> merged(np.array([0.0, 1.0, 2.0, 3.0]), np.array([5.0, 5.0, 0.0]), 5.0)
    ([0.0, 2.0, 2.0, 3.0, 3.0], [5.0, 5.0, 0.0, 0.0, 5.0])
    """
    values = np.append(torques, MM).tolist()
    times, heights = [0.0], [values[0]]
    for t, before, after in zip(edges[1:].tolist(), values, values[1:], strict=False):
        if after != before:
            times += [t, t]
            heights += [before, after]
    if times[-1] < edges[-1]:
        times.append(float(edges[-1]))
        heights.append(MM)
    return times, heights
