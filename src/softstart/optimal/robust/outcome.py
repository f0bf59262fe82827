"""What comes out of a robust optimisation: one profile, its runs, and what a contact sensor is worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.drive import Drive
from softstart.optimal.result import LowerBound
from softstart.profile import TorqueProfile
from softstart.start import metrics
from softstart.start.run import Run


@dataclass(frozen=True, eq=False, repr=False)
class RobustOptimum:
    """One torque profile for several drives, as the exact plant runs it on each of them.

    Every run goes to one elastic period after its own start time, the profile still playing. All K_dyn refer
    to `base`. `lower_bound` is the largest bound of a scenario by itself: no profile, reacting or not, does
    better on all of them.
    """

    scenarios: tuple[Drive, ...]
    start_time: float  # s allowed
    base: Drive
    react_to_contact: bool
    profile: TorqueProfile
    runs: tuple[Run, ...]
    lower_bound: LowerBound
    seconds: float  # computing time
    note: str = ""  # where a contact sensor is left unused, that this is so

    @property
    def k_dyn_each(self) -> tuple[float, ...]:
        """Dynamic coefficient of each scenario's whole run."""
        return tuple(float(metrics.k_dyn(run.peak_torque, self.base)) for run in self.runs)

    @property
    def k_dyn(self) -> float:
        """The worst of them, which was minimised."""
        return max(self.k_dyn_each)

    @property
    def worst(self) -> int:
        """Index of the scenario with the worst K_dyn."""
        return int(np.argmax(self.k_dyn_each))

    @property
    def start_times(self) -> tuple[float, ...]:
        """Start time of each scenario, s."""
        return tuple(run.start_time for run in self.runs)

    @property
    def gap_percent(self) -> float:
        """How far the worst K_dyn lies above the bound, in per cent."""
        return 100.0 * (self.k_dyn / self.lower_bound.k_dyn - 1.0)

    def __repr__(self) -> str:
        """One line that says what came out."""
        what = "reacting to the contact" if self.react_to_contact else "one profile"
        return (
            f"<RobustOptimum: worst K_dyn {self.k_dyn:.5f} over {len(self.scenarios)} scenarios, {what}, "
            f"latest start {max(self.start_times):.5f} s>"
        )

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere (JSON, tables, docs)."""
        bound = self.lower_bound
        after = self.profile.after_contact
        profile: dict[str, Any] = _knots(self.profile)
        if after is not None:
            profile["after_contact"] = _knots(after)
        return {
            "drive": self.base.name,
            "terminal": "reached",
            "react_to_contact": self.react_to_contact,
            "note": self.note,
            "start_time_bound": self.start_time,
            "k_dyn": self.k_dyn,
            "k_dyn_each": list(self.k_dyn_each),
            "k_dyn_lower_bound": bound.k_dyn if bound.kind != "none" else None,
            "bound_kind": bound.kind,
            "bound_covers": bound.covers,
            "start_times": list(self.start_times),
            "worst": self.worst,
            "scenarios": [
                {"drive": d.name, "gap": d.gap, "load_inertia": d.J2, "load_torque": d.Mc}
                for d in self.scenarios
            ],
            "seconds": self.seconds,
            "profile": profile,
        }


def _knots(profile: TorqueProfile) -> dict[str, Any]:
    return {"time": profile.time.tolist(), "torque": profile.torque.tolist()}


@dataclass(frozen=True, eq=False, repr=False)
class SensorWorth:
    """The best profile that plays blindly, and the best that starts its second part at the contact.

    `alone` holds the K_dyn that each scenario could have if it were the only one, where that was asked for.
    """

    blind: RobustOptimum
    reacting: RobustOptimum
    alone: tuple[float, ...] | None = None

    @property
    def percent(self) -> float:
        """By how much the sensor lowers the worst K_dyn, per cent of the blind one; 0 if left unused."""
        return max(100.0 * (1.0 - self.reacting.k_dyn / self.blind.k_dyn), 0.0)

    def __repr__(self) -> str:
        """One line that says what came out."""
        return (
            f"<SensorWorth: worst K_dyn {self.blind.k_dyn:.5f} blind, {self.reacting.k_dyn:.5f} reacting to "
            f"the contact: {self.percent:.1f} % lower>"
        )

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere (JSON, tables, docs)."""
        return {
            "k_dyn_blind": self.blind.k_dyn,
            "k_dyn_reacting": self.reacting.k_dyn,
            "percent": self.percent,
            "k_dyn_alone": None if self.alone is None else list(self.alone),
            "blind": self.blind.summary(),
            "reacting": self.reacting.summary(),
        }
