"""Compiling a controller's step for the kernel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from softstart.arrays import Vector
from softstart.controller.base import NEVER
from softstart.kernel import jit, motor, records
from softstart.kernel.jit import OPTIONS, as_record, compiled_as, drop_stale
from softstart.kernel.jit import unfused as compiled
from softstart.kernel.jit import unfused_inner as inner
from softstart.kernel.motor import NEW_STATE, STEP_SIGNATURE
from softstart.kernel.records import MEASURED, Double, Doubles, Reply, record, size

__all__ = [
    "MEASURED", "NEVER", "Double", "Doubles", "Reply", "Vector", "as_record", "compiled", "compiled_step",
    "inner", "keep_state", "record", "size",
]  # fmt: skip


@inner
def keep_state(state: Vector, command: Vector) -> None:
    """The new state is the old one, until the step changes it."""
    for i in range(state.shape[0]):
        command[NEW_STATE + i] = state[i]


INTERFACE = (Path(__file__), *(Path(str(one.__file__)) for one in (jit, motor, records)))


def _called(function: Callable[..., object], seen: set[int]) -> set[Path]:
    """The files of all compiled functions that this one names, and those that they name."""
    files: set[Path] = set()
    for name in function.__code__.co_names:
        callee = getattr(function.__globals__.get(name), "py_func", None)
        if callee is not None and id(callee) not in seen:
            seen.add(id(callee))
            files |= {Path(callee.__code__.co_filename), *_called(callee, seen)}
    return files


def compiled_step(parameters: Any = None, state: Any = None) -> Any:
    """Compile `step(parameters, measured, state, command)` with the kernel's one signature.

    All arguments are float64 vectors, which `as_record` gives names. The step must fill all of `command`
    except the slope, which is 0 before, and must not allocate arrays (that keeps it near 10 ns a call). It is
    cached on disk, and the kernel is not compiled again for it.

    Parameters
    ----------
    parameters, state : the records of the numbers that the step is given and of its state, from
        `softstart.controller.compiled.record`. A class whose step is compiled without them (`@compiled_step`)
        has `state_size` and a method `vector`.

    Returns
    -------
    The step, for `kernel` of a `CompiledController`; Python can call it too.

    Raises
    ------
    numba.TypingError
        When the step is first needed: for code that numba cannot compile.

    Examples
    --------
    >>> class Parameters:
    ...     torque: float
    >>> PARAMETERS, COMMAND = record(Parameters), record(Reply)
    >>> @compiled_step(PARAMETERS)
    ... def step(parameters, measured, state, command):
    ...     y = as_record(command, COMMAND)
    ...     y.torque = as_record(parameters, PARAMETERS).torque
    ...     y.ask_again = as_record(measured, MEASURED).time + 0.001
    >>> import numpy as np
    >>> command = np.zeros(3)
    >>> step(np.array([62.0]), np.zeros(7), np.zeros(0), command)
    >>> command.tolist()
    [62.0, 0.001, 0.0]
    """
    if callable(parameters):
        return _compiled(parameters)

    def with_records(function: Callable[..., None]) -> Any:
        step = _compiled(function)
        step.records = parameters, 0 if state is None else size(state)
        step.state_record = state
        return step

    return with_records


def _compiled(function: Callable[..., None]) -> Any:
    source = getattr(function, "__code__", None)
    file = "<unknown>" if source is None else str(source.co_filename)
    in_a_file = not file.startswith("<")
    if in_a_file:
        drop_stale({Path(file), *_called(function, set())}, INTERFACE)
    return compiled_as(STEP_SIGNATURE, in_a_file, OPTIONS)(function)
