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
    "InputError": "softstart.errors",
    "Measured": "softstart.controller",
    "PlainController": "softstart.controller",
    "Run": "softstart.run",
    "Sensor": "softstart.controller",
    "SimulationError": "softstart.errors",
    "Status": "softstart.status",
    "compare": "softstart.comparison",
    "simulate": "softstart.simulation",
}

__all__ = [
    "Command",
    "Comparison",
    "CompiledController",
    "Controller",
    "Drive",
    "InputError",
    "Measured",
    "PlainController",
    "Run",
    "Sensor",
    "SimulationError",
    "Status",
    "compare",
    "simulate",
]


def __getattr__(name: str) -> object:
    if name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'softstart' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
