"""Files that lie in the current folder configure no library: a folder may come from a stranger.

numba reads `.numba_config.yaml` of the current folder when it is imported and whenever it compiles. Such a
file may move its cache, from which it loads pickles, that is, code. matplotlib reads `matplotlibrc` there.
Environment variables and files in the home folder are the user's own and remain.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType, ModuleType

NUMBA = "numba.core.config"
# module -> what names the file in its source, and what stands there instead: an empty name is that of no file
NAMES = {NUMBA: (b".numba_config.yaml", b""), "matplotlib": (b"yield 'matplotlibrc'", b"yield ''")}
_isolated = set[str]()


class _WithoutFile(SourceFileLoader):
    """Loads a module that looks for no file in the current folder."""

    def get_code(self, fullname: str) -> CodeType:
        source = self.get_data(self.path).replace(*NAMES[fullname])
        code: CodeType = self.source_to_code(source, self.path)
        return code


class _Finder:
    """Finds these modules whenever and however they are imported."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path) if name in _isolated else None
        if spec is not None and spec.origin is not None:
            spec.loader = _WithoutFile(name, spec.origin)
        return spec


def isolate(name: str) -> None:
    """Keep one of the modules of NAMES from reading its file in the current folder.

    Of numba that is so even if it was imported before; of others whoever did that decides.
    """
    module = sys.modules.get(name)
    if module is not None and name == NUMBA:
        module._config_fname = ""  # type: ignore[attr-defined]
        module.reload_config()  # what the file has set goes back to the defaults; all else stays
    _isolated.add(name)
    if _Finder not in sys.meta_path:
        sys.meta_path.insert(0, _Finder)
