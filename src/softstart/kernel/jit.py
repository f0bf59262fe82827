"""How the kernel's functions are compiled: once, cached on disk, without the interpreter lock.

`_nrt=False` leaves out numba's reference counting. The kernel allocates nothing, so there is nothing to
count; take the option out and `softstart study benchmark-starts` shows what counting nothing costs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, TypeVar

import llvmlite.binding
import numba
from numba import types
from numba.extending import lower_builtin, type_callable

from softstart.errors import InputError

if vars(numba.config).get("DISABLE_JIT"):
    raise InputError(
        "NUMBA_DISABLE_JIT = 1: softstart simulates with compiled code alone; unset this variable."
    )


OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}
FUSED = {**OPTIONS, "fastmath": {"contract"}}  # a x + b is rounded once: quicker, and more exact

_njit: Any = numba.njit  # its annotations do not know `_nrt`
_cfunc: Any = numba.cfunc
_lower_builtin: Any = lower_builtin
F = TypeVar("F", bound=Callable[..., object])


class Decorator(Protocol):
    """Compiles a function, which type checkers see as it is written."""

    def __call__(self, function: F, /) -> F: ...


compiled: Decorator = _njit(**FUSED)
# called by compiled functions alone, a fifth less to compile: Python that calls it crashes
INNER = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
inner: Decorator = _njit(**FUSED, **INNER)
# the same digits as the same lines in Python, for controllers
unfused: Decorator = _njit(**OPTIONS)
unfused_inner: Decorator = _njit(**OPTIONS, **INNER)


class Compiled:
    """A function with one explicit signature, compiled when it is first needed.

    Compiled functions may call it by its name, or be handed it: a kernel that calls a step by its address
    does not compile it again.
    """

    def __init__(self, function: Callable[..., Any], signature: Any, options: Mapping[str, Any]) -> None:
        self.function, self.signature, self.options = function, signature, options
        self.__doc__, self.__module__, self.__wrapped__ = function.__doc__, function.__module__, function
        self.__name__ = self.__qualname__ = function.__qualname__

    @cached_property
    def dispatcher(self) -> Any:
        """What Python calls, and what compiled functions are handed."""
        made = _njit(self.signature, **self.options)(self.function)
        # the address, which numba would look up for each call: `__wrapper_address__` is its protocol for
        # functions that are passed to compiled ones. There is one signature, and so one result of compiling
        found = made.get_compile_result(self.signature)
        address = found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name)
        made.__wrapper_address__ = lambda: address
        made.get_compile_result = lambda _: found
        return made

    @cached_property
    def _numba_type_(self) -> Any:
        """What numba takes its name for in a compiled function: that one has a copy of its own."""
        self._copy = _njit(**self.options, **INNER)(self.function)  # numba does not keep it
        return types.Dispatcher(self._copy)

    def __call__(self, first: Any, *args: Any) -> Any:
        """Call it; one that is handed another one has it first."""
        return self.dispatcher(first.dispatcher if type(first) is Compiled else first, *args)


def compiled_as(
    signature: object, cache: bool = True, options: Mapping[str, object] = FUSED
) -> Callable[[Callable[..., object]], Compiled]:
    """Compile with one explicit signature, when the function is first needed."""
    return lambda function: Compiled(function, signature, {**options, "cache": cache})


def compile_now(module: ModuleType) -> None:
    """Compile all functions of a module that have one signature."""
    for one in vars(module).values():
        if isinstance(one, Compiled):
            one.dispatcher  # noqa: B018


def as_record(row: Any, dtype: Any) -> Any:
    """The same memory with names: row 0 of `row.view(dtype)`, in compiled functions at no cost.

    numba compiles `view` again for each pair of types, a tenth of a second each.

    >>> import numpy as np
    >>> float(as_record(np.array([3.0, 4.0]), np.dtype([("x", float), ("y", float)]))["y"])
    4.0
    """
    return row[: dtype.itemsize // row.itemsize].view(dtype)[0]


@type_callable(as_record)
def _typed(_: Any) -> Callable[..., object]:
    return lambda row, dtype: dtype.dtype


@_lower_builtin(as_record, types.Array, types.DType)
def _lowered(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    data = context.make_array(signature.args[0])(context, builder, args[0]).data
    return builder.bitcast(data, context.get_value_type(signature.return_type))


def separately_compiled(signature: Any) -> Callable[[Callable[..., object]], Any]:
    """Compile by itself, once: the kernel calls it by its symbol, and its code is no part of its callers.

    LLVM optimises what a function calls again within each caller, and each caller of that one: what is large
    and called from several places costs less here. Arguments are records and numbers, the result is a number.
    """

    def declared(function: Callable[..., object]) -> Any:
        symbol = f"{function.__module__}.{function.__qualname__}"
        code = _cfunc(signature, **FUSED)(function)
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
