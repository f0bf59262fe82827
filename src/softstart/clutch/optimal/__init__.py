"""The engagement law with the least friction work for each peak of the shaft torque, with proof."""

from __future__ import annotations

from softstart.clutch.optimal.front import EngagementFront, LawBeside, optimize_engagement
from softstart.clutch.optimal.solving import OptimalLaw, Search

__all__ = ["EngagementFront", "LawBeside", "OptimalLaw", "Search", "optimize_engagement"]
