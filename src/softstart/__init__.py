"""softstart: how a drive with a gap in its transmission is started gently and fast.

>>> from softstart import Drive, simulate
>>> round(simulate(Drive.load("crane-4amtkf"), "direct").k_dyn, 4)
3.1179
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from softstart.balancing import Engine, PeriodicTorque, balance
    from softstart.chain import (
        Chain,
        ChainRun,
        natural_vibration,
        reduce_chain,
        simulate_chain,
        verify_on_chain,
    )
    from softstart.clutch import Clutch, Engagement, EngagementFront, engage, optimize_engagement
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
    from softstart.linear.view import LinearView, linear_view
    from softstart.optimal.front import Front, pareto
    from softstart.optimal.problem import Problem
    from softstart.optimal.result import InfeasibleError, Optimum, OptimumError
    from softstart.optimal.robust import RobustOptimum, optimize_robust, worth_of_contact_sensor
    from softstart.optimal.solving import optimize
    from softstart.profile import TorqueProfile
    from softstart.reporting.result import Report, report
    from softstart.start.comparison import Comparison, compare
    from softstart.start.run import Run
    from softstart.start.simulation import simulate
    from softstart.start.status import Status
    from softstart.sweeping.entry import sweep
    from softstart.tuning.outcome import Tuning
    from softstart.tuning.solving import tune

__version__ = "0.1.0"

# where each public name lives; loaded when first used, so that `import softstart` is quick
_HOME = {
    "Chain": "softstart.chain",
    "ChainRun": "softstart.chain",
    "natural_vibration": "softstart.chain",
    "reduce_chain": "softstart.chain",
    "simulate_chain": "softstart.chain",
    "verify_on_chain": "softstart.chain",
    "Clutch": "softstart.clutch",
    "Command": "softstart.controller",
    "Comparison": "softstart.start.comparison",
    "CompiledController": "softstart.controller",
    "Controller": "softstart.controller",
    "Drive": "softstart.drive",
    "Engagement": "softstart.clutch",
    "EngagementFront": "softstart.clutch",
    "Engine": "softstart.balancing",
    "Front": "softstart.optimal.front",
    "InfeasibleError": "softstart.optimal.result",
    "InputError": "softstart.errors",
    "LinearView": "softstart.linear.view",
    "Measured": "softstart.controller",
    "Optimum": "softstart.optimal.result",
    "OptimumError": "softstart.optimal.result",
    "PeriodicTorque": "softstart.balancing",
    "PlainController": "softstart.controller",
    "Problem": "softstart.optimal.problem",
    "Report": "softstart.reporting.result",
    "RobustOptimum": "softstart.optimal.robust",
    "Run": "softstart.start.run",
    "Sensor": "softstart.controller",
    "SimulationError": "softstart.errors",
    "Status": "softstart.start.status",
    "TorqueProfile": "softstart.profile",
    "Tuning": "softstart.tuning.outcome",
    "balance": "softstart.balancing",
    "compare": "softstart.start.comparison",
    "engage": "softstart.clutch",
    "linear_view": "softstart.linear.view",
    "optimize": "softstart.optimal.solving",
    "optimize_engagement": "softstart.clutch",
    "optimize_robust": "softstart.optimal.robust",
    "pareto": "softstart.optimal.front",
    "report": "softstart.reporting.result",
    "simulate": "softstart.start.simulation",
    "sweep": "softstart.sweeping.entry",
    "tune": "softstart.tuning.solving",
    "worth_of_contact_sensor": "softstart.optimal.robust",
}

__all__ = [
    "Chain",
    "ChainRun",
    "Clutch",
    "Command",
    "Comparison",
    "CompiledController",
    "Controller",
    "Drive",
    "Engagement",
    "EngagementFront",
    "Engine",
    "Front",
    "InfeasibleError",
    "InputError",
    "LinearView",
    "Measured",
    "Optimum",
    "OptimumError",
    "PeriodicTorque",
    "PlainController",
    "Problem",
    "Report",
    "RobustOptimum",
    "Run",
    "Sensor",
    "SimulationError",
    "Status",
    "TorqueProfile",
    "Tuning",
    "balance",
    "compare",
    "engage",
    "linear_view",
    "natural_vibration",
    "optimize",
    "optimize_engagement",
    "optimize_robust",
    "pareto",
    "reduce_chain",
    "report",
    "simulate",
    "simulate_chain",
    "sweep",
    "tune",
    "verify_on_chain",
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
