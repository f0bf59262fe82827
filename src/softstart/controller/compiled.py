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
from softstart.kernel.motor import STEP_SIGNATURE
from softstart.kernel.records import MEASURED, Reply, record, size

# indices of `measured`
from softstart.kernel.motor import (  # isort: skip
    M_LOAD_SPEED as LOAD_SPEED,
    M_MOTOR_ANGLE as MOTOR_ANGLE,
    M_MOTOR_SPEED as MOTOR_SPEED,
    M_MOTOR_TORQUE as MOTOR_TORQUE,
    M_SHAFT_TORQUE as SHAFT_TORQUE,
    M_STAGE as STAGE,
    M_TIME as TIME,
)

# indices of `command`; the new state follows from STATE on
from softstart.kernel.motor import ASK_AGAIN, SLOPE, TORQUE, NEW_STATE as STATE  # isort: skip

__all__ = [
    "ASK_AGAIN",
    "LOAD_SPEED",
    "MEASURED",
    "MOTOR_ANGLE",
    "MOTOR_SPEED",
    "MOTOR_TORQUE",
    "NEVER",
    "SHAFT_TORQUE",
    "SLOPE",
    "STAGE",
    "STATE",
    "TIME",
    "TORQUE",
    "Reply",
    "Vector",
    "as_record",
    "compiled",
    "compiled_step",
    "inner",
    "keep_state",
    "record",
    "size",
]


@inner
def keep_state(state: Vector, command: Vector) -> None:
    """The new state is the old one, until the step changes it."""
    for i in range(state.shape[0]):
        command[STATE + i] = state[i]


INTERFACE = (Path(__file__), *(Path(str(one.__file__)) for one in (jit, motor, records)))


def _called(function: Any, seen: set[int]) -> set[Path]:
    """The files of all compiled functions that this one names, and those that they name."""
    files: set[Path] = set()
    for name in function.__code__.co_names:
        inner = getattr(function.__globals__.get(name), "py_func", None)
        if inner is not None and id(inner) not in seen:
            seen.add(id(inner))
            files |= {Path(inner.__code__.co_filename), *_called(inner, seen)}
    return files


def compiled_step(function: Callable[..., None]) -> Any:
    """Compile `step(parameters, measured, state, command)` with the kernel's one signature.

    All arguments are float64 vectors. The step must fill all of `command` except SLOPE, which is 0 before,
    and must not allocate arrays (that keeps it near 10 ns a call). It is cached on disk, and the kernel is
    not compiled again for it.

    Parameters
    ----------
    function : callable
        The step, in the part of Python that numba compiles.

    Returns
    -------
    A compiled step, as `CompiledController.kernel` takes it.

    Raises
    ------
    numba.core.errors.TypingError
        At the first call, where numba cannot compile the step.

    Examples
    --------
    >>> @compiled_step
    ... def step(parameters, measured, state, command):
    ...     command[TORQUE] = parameters[0]
    ...     command[ASK_AGAIN] = measured[TIME] + 0.001
    >>> import numpy as np
    >>> command = np.zeros(3)
    >>> step(np.array([62.0]), np.zeros(7), np.zeros(0), command)
    >>> command.tolist()
    [62.0, 0.001, 0.0]
    """
    source = getattr(function, "__code__", None)
    file = "<unknown>" if source is None else str(source.co_filename)
    in_a_file = not file.startswith("<")
    if in_a_file:
        own = _called(function, set())
        drop_stale({Path(file), *own}, INTERFACE)
    return compiled_as(STEP_SIGNATURE, in_a_file, OPTIONS)(function)
