"""softstart: how a drive with a gap in its transmission is started gently and fast.

>>> from softstart import Drive, simulate
>>> round(simulate(Drive.load("crane-4amtkf"), "direct").k_dyn, 4)
3.1179
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from softstart.comparison import Comparison, compare
    from softstart.controller import (
        Command,
        CompiledController,
        Controller,
        Measured,
        PlainController,
        Sensor,
    )
    from softstart.drive import Drive
    from softstart.errors import InputError, SimulationError
    from softstart.optimal.front import Front, pareto
    from softstart.optimal.problem import Problem
    from softstart.optimal.result import InfeasibleError, Optimum, OptimumError
    from softstart.optimal.robust import RobustOptimum, optimize_robust, worth_of_contact_sensor
    from softstart.optimal.solving import optimize
    from softstart.profile import TorqueProfile
    from softstart.run import Run
    from softstart.simulation import simulate
    from softstart.status import Status

__version__ = "0.1.0.dev0"

# where each public name lives; loaded when first used, so that `import softstart` is quick
_HOME = {
    "Command": "softstart.controller",
    "Comparison": "softstart.comparison",
    "CompiledController": "softstart.controller",
    "Controller": "softstart.controller",
    "Drive": "softstart.drive",
    "Front": "softstart.optimal.front",
    "InfeasibleError": "softstart.optimal.result",
    "InputError": "softstart.errors",
    "Measured": "softstart.controller",
    "Optimum": "softstart.optimal.result",
    "OptimumError": "softstart.optimal.result",
    "PlainController": "softstart.controller",
    "Problem": "softstart.optimal.problem",
    "RobustOptimum": "softstart.optimal.robust",
    "Run": "softstart.run",
    "Sensor": "softstart.controller",
    "SimulationError": "softstart.errors",
    "Status": "softstart.status",
    "TorqueProfile": "softstart.profile",
    "compare": "softstart.comparison",
    "optimize": "softstart.optimal.solving",
    "optimize_robust": "softstart.optimal.robust",
    "pareto": "softstart.optimal.front",
    "simulate": "softstart.simulation",
    "worth_of_contact_sensor": "softstart.optimal.robust",
}

__all__ = [
    "Command",
    "Comparison",
    "CompiledController",
    "Controller",
    "Drive",
    "Front",
    "InfeasibleError",
    "InputError",
    "Measured",
    "Optimum",
    "OptimumError",
    "PlainController",
    "Problem",
    "RobustOptimum",
    "Run",
    "Sensor",
    "SimulationError",
    "Status",
    "TorqueProfile",
    "compare",
    "optimize",
    "optimize_robust",
    "pareto",
    "simulate",
    "worth_of_contact_sensor",
]


def __getattr__(name: str) -> object:
    if name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'softstart' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
