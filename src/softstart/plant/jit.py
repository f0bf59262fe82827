"""How the kernel's functions are compiled: once, cached on disk, without the interpreter lock.

`_nrt=False` leaves out numba's reference counting. The kernel allocates nothing, so there is nothing to
count; take the option out and `softstart study benchmark-starts` shows what counting nothing costs.
"""

from __future__ import annotations

from typing import Any

import numba

_njit: Any = numba.njit

OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}

compiled: Any = _njit(**OPTIONS)
inlined: Any = _njit(**OPTIONS, forceinline=True)  # small and called from one or two places
# large and called from one place: merged before compilation, where `inlined` compiles it by itself as well
merged: Any = _njit(**OPTIONS, inline="always")


def compiled_as(signature: object, cache: bool = True) -> Any:
    """Compile with one explicit signature, as soon as the function is defined."""
    return _njit(signature, **{**OPTIONS, "cache": cache})
