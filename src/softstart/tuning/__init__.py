"""Gains tuned over gaps and load inertias: a schedule, one robust set, and the price of robustness."""

from softstart.tuning.outcome import RobustSet, Tuning
from softstart.tuning.solving import tune

__all__ = ["RobustSet", "Tuning", "tune"]
