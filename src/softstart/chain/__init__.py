"""Chains of masses with gaps and gears [R]: their natural frequencies, their reduction, their motion.

>>> from softstart.chain import Chain, natural_vibration
>>> natural_vibration(Chain.load("crane-4-mass")).Omega.round(1)
array([   0. ,  114.6,  618.5, 1630.3])
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from softstart.chain.elements import Mass, Motor, Shaft
from softstart.chain.model import Chain, ChainArrays

if TYPE_CHECKING:
    from softstart.chain.batch import simulate_chains
    from softstart.chain.fatigue import ChainFatigue, ShaftLife, chain_fatigue
    from softstart.chain.reduction import Reduction, reduce_chain
    from softstart.chain.run import ChainRun
    from softstart.chain.simulation import (
        TwoMassError,
        Verification,
        simulate_chain,
        two_mass_error,
        verify_on_chain,
    )
    from softstart.chain.vibration import Vibration, natural_vibration
    from softstart.chain.vibration_with_gaps import Backbone, ForcedResponse, chain_backbone, forced_response

__all__ = [
    "Backbone",
    "Chain",
    "ChainArrays",
    "ChainFatigue",
    "ChainRun",
    "ForcedResponse",
    "Mass",
    "Motor",
    "Reduction",
    "Shaft",
    "ShaftLife",
    "TwoMassError",
    "Verification",
    "Vibration",
    "chain_backbone",
    "chain_fatigue",
    "forced_response",
    "natural_vibration",
    "reduce_chain",
    "simulate_chain",
    "simulate_chains",
    "two_mass_error",
    "verify_on_chain",
]

# loaded when first used: they need compiled code
_HOME = {
    "Backbone": "softstart.chain.vibration_with_gaps",
    "ChainFatigue": "softstart.chain.fatigue",
    "ChainRun": "softstart.chain.run",
    "ForcedResponse": "softstart.chain.vibration_with_gaps",
    "Reduction": "softstart.chain.reduction",
    "ShaftLife": "softstart.chain.fatigue",
    "TwoMassError": "softstart.chain.simulation",
    "Verification": "softstart.chain.simulation",
    "Vibration": "softstart.chain.vibration",
    "chain_backbone": "softstart.chain.vibration_with_gaps",
    "chain_fatigue": "softstart.chain.fatigue",
    "forced_response": "softstart.chain.vibration_with_gaps",
    "natural_vibration": "softstart.chain.vibration",
    "reduce_chain": "softstart.chain.reduction",
    "simulate_chain": "softstart.chain.simulation",
    "simulate_chains": "softstart.chain.batch",
    "two_mass_error": "softstart.chain.simulation",
    "verify_on_chain": "softstart.chain.simulation",
}


def __getattr__(name: str) -> object:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'softstart.chain' has no attribute {name!r}")
