"""Reduction of chains [R]: partial systems merged by the lever rule, or two masses with the first mode."""

from __future__ import annotations

from softstart.chain.reduction.condition import FACTOR
from softstart.chain.reduction.result import Frequency, Reduction, Step, TwoMassFigures
from softstart.chain.reduction.solving import reduce_chain

__all__ = ["FACTOR", "Frequency", "Reduction", "Step", "TwoMassFigures", "reduce_chain"]
