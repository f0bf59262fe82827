"""Piston engines: the torques and forces they shake their mounts with, and two-shaft balancers [B].

[B]: Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms (VAZ-11113).

>>> from softstart.balancing import Engine, balance
>>> found = balance(Engine.load("vaz-11113"))
>>> round(float(found.residual("none").first_order_moment[found.tuning_index]), 1)
149.5
"""

from __future__ import annotations

from softstart.balancing.design import Balance, Residual, balance
from softstart.balancing.engine import Engine
from softstart.balancing.gas import SimpleCycle
from softstart.balancing.parts import BalancerShaft, Counterweights, Cylinders, Masses, Operation

__all__ = [
    "Balance",
    "BalancerShaft",
    "Counterweights",
    "Cylinders",
    "Engine",
    "Masses",
    "Operation",
    "Residual",
    "SimpleCycle",
    "balance",
]
