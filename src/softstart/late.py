"""Modules that are imported when first used.

Heavy libraries (matplotlib, xarray, casadi) would make `import softstart` slow, and a result's `plot()` is
drawn by a module above it. Both are named here as text and imported at the first access to an attribute:

    if TYPE_CHECKING:
        import xarray
    else:
        xarray = late("xarray")

Everything else is imported at the top of its module.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import Any


class _Late(ModuleType):
    """Stands for a module until one of its attributes is needed."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # inspection, by doctest or a debugger, imports nothing
            raise AttributeError(name)
        return getattr(import_module(self.__name__), name)


def late(module: str) -> Any:
    """Return a stand-in for `module` (a full dotted name), which is imported when first used.

    >>> json = late("json")
    >>> json.dumps([1, 2])
    '[1, 2]'
    """
    return _Late(module)
