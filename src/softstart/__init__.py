"""softstart: torque strategies for the soft start of drives with backlash.

The public names are listed in `__init__.pyi`, where type checkers look for them. Each is imported when first
used, so that `import softstart` is quick.

>>> from softstart import Drive, simulate
>>> round(simulate(Drive.load("crane-4amtkf"), "direct").k_dyn, 4)
3.1179
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path

from softstart.isolation import NUMBA, isolate

isolate(NUMBA)

__version__ = "0.1.0"

_DEFINED_IN = {
    name.name: str(line.module)
    for line in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(line, ast.ImportFrom)
    for name in line.names
}
__all__ = sorted(_DEFINED_IN)  # noqa: PLE0605 - a list, which the rule does not see


def __getattr__(name: str) -> object:
    if name in _DEFINED_IN:
        value = getattr(import_module(_DEFINED_IN[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'softstart' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
