"""The drives that one torque profile has to serve."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from numbers import Real
from typing import Any

import numpy as np

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.optimal.problem import Problem


def scenarios_of(
    drive: Drive,
    *,
    gaps: Iterable[float] = (),
    inertias: Iterable[float] = (),
    load_torques: Iterable[float] = (),
) -> tuple[Drive, ...]:
    """The full grid of a drive's gaps (rad), load inertias (kg m2) and load torques (N m).

    A list left out keeps the drive's own value. The drive itself comes first, also where it is not on the
    grid, since K_dyn refers to the first scenario. Raises InputError for values that no drive can have.

    >>> nominal = Drive.load("crane-4amtkf")
    >>> [s.gap for s in scenarios_of(nominal, gaps=[0.3, 0.5, 1.0])]
    [0.5, 0.3, 1.0]
    >>> len(scenarios_of(nominal, gaps=[0.3, 1.0], inertias=[0.07, 0.175]))
    5
    """
    if not isinstance(drive, Drive) or drive.shape != ():
        raise InputError(f"drive = {drive!r}: give a single Drive; its values are varied here.")
    own = (("gaps", "gap"), ("inertias", "load_inertia"), ("load_torques", "load_torque"))
    lists = [
        _values(name, given) for (name, _), given in zip(own, (gaps, inertias, load_torques), strict=True)
    ]
    axes = [
        list(dict.fromkeys(values)) or [getattr(drive, key)]
        for values, (_, key) in zip(lists, own, strict=True)
    ]
    found = [drive]
    for gap, load_inertia, load_torque in itertools.product(*axes):
        one = drive.replace(gap=gap, load_inertia=load_inertia, load_torque=load_torque)
        if one not in found:
            found.append(one)
    return tuple(found)


def _values(name: str, given: Iterable[float]) -> list[float]:
    try:
        values = [float(value) for value in given]
    except (TypeError, ValueError):
        raise InputError(f"{name} = {given!r}: give a list of numbers in SI units.") from None
    return values


def check_scenarios(scenarios: Sequence[Drive], start_time: Any, base: Any) -> tuple[Drive, ...]:
    """The scenarios as a tuple, or one InputError with everything that is wrong."""
    if isinstance(scenarios, Drive) or not isinstance(scenarios, Sequence) or isinstance(scenarios, str):
        raise InputError(
            f"scenarios = {scenarios!r}: give a list of Drives; scenarios_of makes one from a drive's gaps, "
            "inertias and load torques."
        )
    drives = tuple(scenarios)
    if not drives:
        raise InputError("scenarios: the list is empty; give one Drive or more.")
    if (
        not isinstance(start_time, Real)
        or isinstance(start_time, bool)
        or not 0.0 < float(start_time) < math.inf
    ):
        raise InputError(f"start_time = {start_time!r}: give the time allowed in s, above 0.")
    if base is not None and (not isinstance(base, Drive) or base.shape != ()):
        raise InputError(f"base = {base!r}: K_dyn refers to one single Drive; Drive.load reads one.")
    wrong: list[str] = []
    for i, drive in enumerate(drives):
        try:
            reached(drive, float(start_time), base)
        except InputError as error:
            wrong += [f"scenario {i + 1}: {sentence}" for sentence in error.sentences]
    if not wrong:
        low, high = limits(drives)
        if low >= high:
            wrong.append(
                f"scenarios: one needs a torque of at least {low:g} N m, another allows {high:g} N m at "
                "most; one profile cannot serve both, so leave one of them out."
            )
        wrong += [
            f"scenario {i + 1}: load_torque = {drive.Mc:g} N m, but the torque that all scenarios allow is "
            f"only {high:g} N m; leave out the scenario with the weakest motor."
            for i, drive in enumerate(drives)
            if drive.Mc >= high
        ]
    if wrong:
        raise InputError(wrong)
    return tuple(reached(drive, float(start_time), base).drive for drive in drives)


def reached(drive: Drive, start_time: float, base: Drive | None) -> Problem:
    """A scenario by itself: the load is to reach its target speed in time."""
    return Problem(drive, start_time=start_time, terminal="reached", base=base)


def limits(drives: Sequence[Drive]) -> tuple[float, float]:
    """The torque in N m that every scenario allows: highest of the lowest, lowest of the highest."""
    problems = [reached(drive, 1.0, None) for drive in drives]
    return max(p.lowest_torque for p in problems), min(p.highest_torque for p in problems)


def differing(drives: Sequence[Drive], count: int) -> tuple[Drive, ...]:
    """So many of the drives that differ most in gap, inertia, load torque, stiffness; in their order.

    The two ends of the widest spread come first, then always the one farthest from those chosen.

    >>> drive = Drive.load("crane-4amtkf")
    >>> [d.gap for d in differing([drive.replace(gap=g) for g in (0.3, 0.4, 0.5, 0.7)], 2)]
    [0.3, 0.7]
    """
    if len(drives) <= count:
        return tuple(drives)
    rows = np.array([[d.gap, d.J1, d.J2, d.Mc, d.c, d.d, d.Ms] for d in drives], dtype=np.float64)
    rows = rows / np.maximum(np.abs(rows).max(axis=0), 1e-300)
    apart = np.linalg.norm(rows[:, None] - rows[None], axis=2)
    chosen = [int(i) for i in np.unravel_index(int(np.argmax(apart)), apart.shape)]
    while len(chosen) < count:
        chosen.append(int(np.argmax(apart[chosen].min(axis=0))))
    return tuple(drives[i] for i in sorted(chosen[:count]))
