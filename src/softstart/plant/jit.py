"""How the kernel's functions are compiled: once, cached on disk, without the interpreter lock.

`_nrt=False` leaves out numba's reference counting. The kernel allocates nothing, so there is nothing to
count; take the option out and `softstart study benchmark-starts` shows what counting nothing costs.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import llvmlite.binding
import numba.extending
from llvmlite import ir
from numba.core import cgutils

_njit: Any = numba.njit
_cfunc: Any = numba.cfunc
_intrinsic: Any = numba.extending.intrinsic
_external: Any = cgutils.get_or_insert_function

OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}

compiled: Any = _njit(**OPTIONS)
inlined: Any = _njit(**OPTIONS, forceinline=True)  # small and called from one or two places
# large and called from one place: merged before compilation, where `inlined` compiles it by itself as well
merged: Any = _njit(**OPTIONS, inline="always")


def apart(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile by itself, once: kernels call it by its address, and its code is no part of theirs.

    LLVM optimises what a function calls again within each caller, and each caller of that one: what is long,
    needed rarely or called by several kernels costs less here. Its callers must import it from its module,
    which gives its address a name before they are loaded.
    """

    def declared(function: Callable[..., Any]) -> Any:
        symbol = f"{function.__module__}.{function.__qualname__}"
        code = _cfunc(signature, **OPTIONS)(function)
        llvmlite.binding.add_symbol(symbol, code.address)

        def call(context: Any, builder: Any, _: Any, values: Any) -> Any:
            kinds = [context.get_value_type(one) for one in signature.args]
            kind = ir.FunctionType(context.get_value_type(signature.return_type), kinds)
            return builder.call(_external(builder.module, kind, symbol), values)

        def typed(*_: Any) -> Any:
            return signature, call

        context = inspect.Parameter("context", inspect.Parameter.POSITIONAL_OR_KEYWORD)
        own = inspect.signature(function).parameters.values()
        typed.__signature__ = inspect.Signature([context, *own])  # type: ignore[attr-defined]
        declaration = _intrinsic(typed)
        declaration.code = code  # kept for as long as it can be called
        return declaration

    return declared


def compiled_as(signature: object, cache: bool = True) -> Any:
    """Compile with one explicit signature, as soon as the function is defined."""
    return _njit(signature, **{**OPTIONS, "cache": cache})
