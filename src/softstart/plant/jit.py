"""How the kernel's functions are compiled: once, cached on disk, without the interpreter lock.

`_nrt=False` leaves out numba's reference counting. The kernel allocates nothing, so there is nothing to
count; take the option out and `softstart study benchmark-starts` shows what counting nothing costs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import llvmlite.binding
import numba
from numba import types

_njit: Any = numba.njit
_cfunc: Any = numba.cfunc

OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}

compiled: Any = _njit(**OPTIONS)
inlined: Any = _njit(**OPTIONS, forceinline=True)  # small and called from one or two places
# large and called from one place: merged before compilation, where `inlined` compiles it by itself as well
merged: Any = _njit(**OPTIONS, inline="always")


def apart(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile by itself, once: kernels call it by its address, and its code is no part of theirs.

    LLVM optimises what a function calls again within each caller, and each caller of that one: long searches,
    and what is needed rarely, cost less here. Arguments are records and numbers, the result is a number.
    """

    def declared(function: Callable[..., Any]) -> Any:
        symbol = f"{function.__module__}.{function.__qualname__}"
        code = _cfunc(signature, **OPTIONS)(function)
        llvmlite.binding.add_symbol(symbol, code.address)
        declaration: Any = types.ExternalFunction(symbol, signature)
        declaration.code = code  # kept for as long as it can be called
        return declaration

    return declared


def compiled_as(signature: object, cache: bool = True) -> Any:
    """Compile with one explicit signature, as soon as the function is defined."""
    return _njit(signature, **{**OPTIONS, "cache": cache})
