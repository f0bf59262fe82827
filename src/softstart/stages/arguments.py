"""What the stage equations accept: numbers in their range that broadcast together."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from softstart.errors import InputError

Array = npt.NDArray[np.float64]
Value = float | Array

_ABOVE_ZERO = {
    "J1": "the motor inertia in kg m2",
    "J2": "the load inertia in kg m2",
    "c": "the stiffness in N m/rad",
    "Ms": "the starting torque in N m",
    "Omega": "the elastic frequency in rad/s",
    "base": "the mean shaft torque that K_dyn is measured against, in N m,",
}
_NOT_NEGATIVE = {
    "gap": "the total gap in rad",
    "t": "the time since the stage began in s",
    "dw12": "the speed of impact in rad/s",
    "r": "the ratio M1/Ms",
}


def checked(**given: npt.ArrayLike) -> tuple[Array, ...]:
    """The arguments as float64 arrays, in the order given.

    Raises `InputError` with one sentence for each argument that is not finite or outside its range, and for
    arrays whose shapes do not broadcast together.

    >>> checked(J1=0, gap=[0.5, -1])
    Traceback (most recent call last):
    softstart.errors.InputError: J1 = 0: the motor inertia in kg m2 must be finite and above 0.
    gap[1] = -1: the total gap in rad must be finite and 0 or more.
    """
    wrong: list[str] = []
    arrays: list[Array] = []
    for name, value in given.items():
        try:
            array = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            wrong.append(f"{name} = {value!r}: a number or an array of numbers is needed.")
            continue
        arrays.append(array)
        good, rule = np.isfinite(array), "must be finite"
        if name in _ABOVE_ZERO:
            good, rule = good & (array > 0), f"{_ABOVE_ZERO[name]} must be finite and above 0"
        elif name in _NOT_NEGATIVE:
            good, rule = good & (array >= 0), f"{_NOT_NEGATIVE[name]} must be finite and 0 or more"
        if not np.all(good):
            where = tuple(int(i) for i in np.argwhere(~good)[0])
            index = f"[{', '.join(map(str, where))}]" if where else ""
            wrong.append(f"{name}{index} = {float(array[where]):g}: {rule}.")
    if not wrong:
        try:
            np.broadcast_shapes(*(array.shape for array in arrays))
        except ValueError:
            shapes = ", ".join(f"{name} {array.shape}" for name, array in zip(given, arrays, strict=True))
            wrong.append(f"The arrays do not broadcast together; their shapes are {shapes}.")
    if wrong:
        raise InputError(wrong)
    return tuple(arrays)


def free_load_torque(Mc: Array, kind: str) -> Array:
    """Torque in N m on the load while the gap is open: Mc if active, 0 if reactive and at rest.

    Raises `InputError` for another kind and for a reactive load with `Mc < 0`.

    >>> float(free_load_torque(np.asarray(7.16), "reactive"))
    0.0
    """
    if kind not in ("active", "reactive"):
        raise InputError(f'kind = {kind!r}: a load is "active" or "reactive".')
    if kind == "active":
        return Mc
    refuse_negative_friction(Mc)
    return np.zeros_like(Mc)


def refuse_negative_friction(Mc: Array) -> None:
    """Raise `InputError` where a reactive load torque is below zero: friction opposes, it never drives."""
    if np.any(Mc < 0):
        raise InputError(
            f"Mc = {float(np.min(Mc)):g}: the torque of a reactive load in N m must be 0 or more."
        )


def approach(M1: Array, J1: Array, J2: Array, Mc: Array) -> Array:
    """Relative acceleration `M1/J1 + Mc/J2` of the free masses in rad/s2.

    Raises `InputError` unless it is above zero: the gap would never close on the driving flank.

    >>> float(approach(*checked(M1=62, J1=0.5, J2=2, Mc=4)))
    126.0
    """
    a = M1 / J1 + Mc / J2
    if np.any(a <= 0):
        raise InputError(
            f"M1/J1 + Mc/J2 = {float(np.min(a)):g} rad/s2: the masses do not approach each other "
            "and the gap never closes; raise the motor torque of the open stage."
        )
    return a


def plain(value: Array) -> Value:
    """A Python float when the value has no dimensions, the array otherwise."""
    return float(value) if np.ndim(value) == 0 else value
