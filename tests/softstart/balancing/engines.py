"""Engines that many tests use."""

from __future__ import annotations

import math

from softstart.balancing import Counterweights, Cylinders, Engine, Masses, Operation, SimpleCycle

RPM = math.pi / 30.0
ORDERS = {
    "single": (1,),
    "two, throws together": (1, 2),
    "three": (1, 3, 2),
    "four": (1, 3, 4, 2),
    "six": (1, 5, 3, 6, 2, 4),
}


def engine(order=(1,), *, firing_angles=None, weights=None, shafts=(), gas=None, **lengths):
    """An engine of usual size that fires in this order."""
    usual = {"bore": 0.08, "stroke": 0.084, "rod_length": 0.14, "spacing": 0.09} | lengths
    when = {"firing_order": order} if firing_angles is None else {"firing_angles": firing_angles}
    return Engine(
        Cylinders(**usual, **when),
        Masses(0.5, 0.4),
        gas=gas or SimpleCycle(9.5, "9 bar"),
        operation=Operation("1000 rpm", "6000 rpm"),
        counterweights=weights or Counterweights(),
        shafts=shafts,
        name="a test engine",
    )
