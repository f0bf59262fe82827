"""Chains of masses with gaps and gears [R]: their natural frequencies, their reduction, their motion.

>>> from softstart.chain import Chain, natural_vibration
>>> natural_vibration(Chain.load("crane-4-mass")).Omega.round(1)
array([   0. ,  114.6,  618.5, 1630.3])
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from softstart.chain.arrays import ChainArrays
from softstart.chain.elements import Mass, Motor, Shaft
from softstart.chain.machines import by_name
from softstart.chain.model import Chain
from softstart.vibration import Reduction, Vibration
from softstart.vibration import natural_vibration as _natural_vibration
from softstart.vibration import reduce_chain as _reduce_chain

if TYPE_CHECKING:
    from softstart.chain.two_masses import TwoMassError, Verification, two_mass_error, verify_on_chain

__all__ = [
    "Chain",
    "ChainArrays",
    "Mass",
    "Motor",
    "Reduction",
    "Shaft",
    "TwoMassError",
    "Verification",
    "Vibration",
    "natural_vibration",
    "reduce_chain",
    "two_mass_error",
    "verify_on_chain",
]

natural_vibration, reduce_chain = by_name(_natural_vibration), by_name(_reduce_chain)

# loaded when first used: they need compiled code
_HOME = {
    "TwoMassError": "softstart.chain.two_masses",
    "Verification": "softstart.chain.two_masses",
    "two_mass_error": "softstart.chain.two_masses",
    "verify_on_chain": "softstart.chain.two_masses",
}


def __getattr__(name: str) -> object:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'softstart.chain' has no attribute {name!r}")
