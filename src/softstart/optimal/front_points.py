"""The points of a front: an optimum for one start time, and a controller beside it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from softstart.controller import Controller
from softstart.optimal.result import Optimum, Verdict

Status = Literal["OPTIMAL", "INFEASIBLE", "NOT_FOUND"]


@dataclass(frozen=True)
class FrontPoint:
    """The least K_dyn for one bound on the start time, or why there is none. Times in s.

    `status` is OPTIMAL, INFEASIBLE (no start is that quick; `shortest_start_time` would do) or NOT_FOUND (the
    method gave up; `status_text` says why). What there is not is None. `time` and `torque` are the knots of
    the profile, s and N m.

    >>> point = FrontPoint(0.3, "reached", "OPTIMAL", "", k_dyn=1.01, k_dyn_lower_bound=1.0)
    >>> point.found, round(point.gap_percent, 6), FrontPoint.of_record(point.record()) == point
    (True, 1.0, True)
    """

    start_time_bound: float
    terminal: str
    status: Status
    status_text: str
    k_dyn: float | None = None
    k_dyn_lower_bound: float | None = None
    bound_kind: str = "none"
    bound_covers: str = ""
    start_time: float | None = None
    heat: float | None = None
    contacts: int | None = None
    method: str = ""
    why: str = ""
    seconds: float | None = None
    shortest_start_time: float | None = None
    time: tuple[float, ...] = ()
    torque: tuple[float, ...] = ()

    @property
    def found(self) -> bool:
        """Whether there is an optimum."""
        return self.status == "OPTIMAL"

    @property
    def gap_percent(self) -> float | None:
        """How far K_dyn lies above its bound, in per cent."""
        if self.k_dyn is None or self.k_dyn_lower_bound is None:
            return None
        return 100.0 * (self.k_dyn / self.k_dyn_lower_bound - 1.0)

    @classmethod
    def of_optimum(cls, best: Optimum, start_time: float) -> FrontPoint:
        """The point of an optimum for this bound on the start time."""
        told = best.summary()
        names = ("terminal", "k_dyn", "k_dyn_lower_bound", "bound_kind", "bound_covers", "start_time", "heat",
                 "contacts", "method", "why", "seconds")  # fmt: skip
        return cls(
            start_time, status="OPTIMAL", status_text="", time=tuple(best.profile.time.tolist()),
            torque=tuple(best.profile.torque.tolist()), **{name: told[name] for name in names},
        )  # fmt: skip

    @classmethod
    def of_verdict(cls, verdict: Verdict, start_time: float, terminal: str) -> FrontPoint:
        """The point of a start time that no start meets."""
        shortest = verdict.shortest_start_time
        known = shortest if math.isfinite(shortest) else None
        return cls(start_time, terminal, "INFEASIBLE", verdict.sentence, shortest_start_time=known)

    @classmethod
    def not_found(cls, why: str, start_time: float, terminal: str) -> FrontPoint:
        """The point of a start time for which the method gave up."""
        return cls(start_time, terminal, "NOT_FOUND", why)

    def for_shorter(self, start_time: float) -> FrontPoint:
        """The point of a start time shorter than this one, where this one is infeasible already."""
        shortest = self.shortest_start_time
        least = f"; the shortest is {shortest:.6g} s" if shortest is not None else ""
        said = f"No start whose gap closes only once takes {start_time:.6g} s ({self.terminal}){least}."
        return replace(self, start_time_bound=start_time, status_text=said)

    def summary(self) -> dict[str, Any]:
        """The figures under the names used everywhere."""
        about = asdict(self)
        profile = {"time": list(about.pop("time")), "torque": list(about.pop("torque"))}
        return {**about, "gap_percent": self.gap_percent, "profile": profile if self.found else None}

    def record(self) -> dict[str, Any]:
        """All fields as plain data, for `of_record`."""
        return asdict(self)

    @classmethod
    def of_record(cls, record: dict[str, Any]) -> FrontPoint:
        """The point that `record` was made from."""
        knots = {name: tuple(record[name]) for name in ("time", "torque")}
        return cls(**{**record, **knots})


@dataclass(frozen=True)
class ControllerPoint:
    """A controller: its K_dyn, its start time in s, and the optimum at just that start time.

    `start_time` is NaN where the load does not reach its target speed; then there is no `optimum`.
    """

    name: str
    k_dyn: float
    start_time: float
    status_text: str
    optimum: FrontPoint | None

    @property
    def ratio(self) -> float | None:
        """K_dyn of the controller / least K_dyn at its own start time with terminal `reached`."""
        if self.optimum is None or self.optimum.k_dyn is None:
            return None
        return self.k_dyn / self.optimum.k_dyn

    def summary(self) -> dict[str, Any]:
        """The figures under the names used everywhere."""
        best = self.optimum
        return {
            "controller": self.name,
            "k_dyn": self.k_dyn,
            "start_time": self.start_time,
            "status_text": self.status_text,
            "optimal_k_dyn": best.k_dyn if best else None,
            "k_dyn_lower_bound": best.k_dyn_lower_bound if best else None,
            "ratio": self.ratio,
            "optimum_status": best.status if best else None,
            "optimum_status_text": best.status_text if best else None,
        }


def label_of(controller: Controller) -> str:
    """The controller's name, or that of its class."""
    return controller.name or type(controller).__name__
