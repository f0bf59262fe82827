"""How the kernel's functions are compiled: once, cached on disk, without the interpreter lock.

`_nrt=False` leaves out numba's reference counting. The kernel allocates nothing, so there is nothing to
count; take the option out and `softstart study benchmark-starts` shows what counting nothing costs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
from numba import types

_njit: Any = numba.njit
_cfunc: Any = numba.cfunc

OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False, "fastmath": {"contract"}}

compiled: Any = _njit(**OPTIONS)


def compiled_as(signature: Any, cache: bool = True, contract: bool = True) -> Any:
    """Compile with one explicit signature, as soon as the function is defined; it may be handed to a kernel.

    A kernel that calls a function by its address does not compile it again: LLVM would otherwise optimise
    what a function calls within each caller, and each caller of that one. Without `contract` each product is
    rounded before it is added to something, as in Python.
    """
    options = OPTIONS | {"cache": cache, "fastmath": {"contract"} if contract else False}

    def compile_now(function: Any) -> Any:
        made = _njit(signature, **options)(function)
        # the address, which numba would look up for each call: `__wrapper_address__` is its protocol for
        # functions that are passed to compiled ones. There is one signature, and so one result of compiling
        found = made.get_compile_result(signature)
        address = found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name)
        made.__wrapper_address__ = lambda: address
        made.get_compile_result = lambda _: found
        return made

    return compile_now


def apart(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile by itself, once: the kernel calls it by its symbol, and its code is no part of its callers.

    LLVM optimises what a function calls again within each caller, and each caller of that one: what is large
    and called from several places costs less here. Arguments are records and numbers, the result is a number.
    """

    def declared(function: Callable[..., Any]) -> Any:
        symbol = f"{function.__module__}.{function.__qualname__}"
        code = _cfunc(signature, **OPTIONS)(function)
        llvmlite.binding.add_symbol(symbol, code.address)
        declaration: Any = types.ExternalFunction(symbol, signature)
        declaration.code = code  # kept for as long as it can be called
        return declaration

    return declared


def drop_stale(sources: Iterable[Path], needed: Iterable[Path] = ()) -> None:
    """Drop what numba has cached of these files if one of them, or of those they need, has changed since.

    Numba notices a change in a function's own file, but not in the functions it calls: wrong numbers without
    a word.
    """
    files = set(sources)
    try:
        cached = [
            one for file in files for one in (file.parent / "__pycache__").glob(f"{file.stem}.*.nb[ic]")
        ]
        if not cached:
            return
        changed = max(file.stat().st_mtime for file in {*files, *needed})
        if changed > min(one.stat().st_mtime for one in cached):
            for one in cached:
                one.unlink(missing_ok=True)
    except OSError:
        return  # another process is compiling or cleaning, or the folder is read-only: numba decides
