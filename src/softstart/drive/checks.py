"""Checks of the parameters of a drive against one another."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from softstart.input.parameters import Parameter, Wording
from softstart.quantities import RefusedError, Units, show

BROADCAST: Final = "arrays of records must broadcast together; give them one length, or a single number"
FRICTIONS: Final = ("motor_friction", "motor_viscous_friction", "load_viscous_friction")

GRAVITY: Final = 9.80665  # m/s^2

Values = Mapping[str, Any]


def elastic_frequency(J1: Any, J2: Any, c: Any) -> Any:
    """`Omega = sqrt(c (J1 + J2)/(J1 J2))` in rad/s, [G](8), written so that small inertias do not underflow.

    >>> round(elastic_frequency(0.035, 0.175, 368.465), 6)
    112.397
    """
    if type(J1) is type(J2) is type(c) is float:
        return math.sqrt(c / J1 + c / J2)
    with np.errstate(over="ignore"):
        Omega = np.sqrt(np.divide(c, J1) + np.divide(c, J2))
    return float(Omega) if np.ndim(Omega) == 0 else Omega


def wrong_units(values: Values, parameter: Parameter, wording: Wording) -> Iterator[str]:
    """A sentence if the units in which a machine is to be shown cannot be read."""
    try:
        Units.read(values.get(parameter.name, ""))
    except RefusedError as refusal:
        yield wording.refused(parameter, values[parameter.name], refusal)


def contradictions(values: Values, parameters: Mapping[str, Parameter], wording: Wording) -> Iterator[str]:
    """A sentence for every pair of valid parameters that contradict each other.

    `values` holds those parameters that are valid in themselves; checks on others are left out.
    """
    shapes = {name: value.shape for name, value in values.items() if isinstance(value, np.ndarray)}
    try:
        shape = np.broadcast_shapes(*shapes.values()) if shapes else ()
    except ValueError:
        listed = (f"{wording.label(parameters[name])} has shape {one}" for name, one in shapes.items())
        yield wording.sentence(", ".join(listed), BROADCAST)
        return

    def at(name: str, index: tuple[int, ...]) -> str:
        """A parameter and its value at this index of the broadcast shape."""
        value, label = values[name], wording.label(parameters[name])
        if isinstance(value, str):
            return f"{label} = {show(value)}"
        array = np.asarray(value)
        own = tuple(
            0 if n == 1 else i for n, i in zip(array.shape, index[len(index) - array.ndim :], strict=True)
        )
        place = f"[{', '.join(map(str, own))}]" if own else ""
        return f"{label}{place} = {float(array[own]):.6g} {parameters[name].unit}"

    for name, other, wrong, reason in _rules(values):
        if wrong is not False and np.any(wrong):
            index = tuple(np.argwhere(np.broadcast_to(wrong, shape))[0].tolist())
            yield wording.sentence(at(name, index), reason.format(other=at(other, index)))


def _rules(values: Values) -> Iterator[tuple[str, str, Any, str]]:
    """Two parameters, whether their values contradict each other, and why; NaN, never true, where unknown."""

    def get(*names: str) -> list[Any]:
        return [math.nan if values.get(name) is None else values[name] for name in names]

    J1, J2, Ms, most, torque = get(
        "motor_inertia", "load_inertia", "starting_torque", "maximum_torque", "load_torque"
    )
    Mc = torque + values.get("load_friction", 0.0)
    friction, b1, b2 = (values.get(name, 0.0) for name in FRICTIONS)
    target, w1, w2 = get("target_speed", "initial_motor_speed", "initial_load_speed")
    rated, power, speed = get("rated_torque", "rated_power", "rated_speed")
    reactive = values.get("load_kind") == "reactive"
    yield (
        "maximum_torque", "starting_torque", most < Ms,
        "the largest torque must not be below {other}; raise it, or leave it out",
    )  # fmt: skip
    yield (
        "starting_torque", "load_torque", Ms <= torque,
        "the starting torque cannot move the load against {other}; raise the one or lower the other",
    )  # fmt: skip
    yield (
        "starting_torque", "load_friction", (Ms > torque) & (Ms <= Mc),
        "the starting torque cannot move the load against its torque and {other}; raise the one or lower the "
        "other",
    )  # fmt: skip
    push = Ms - friction
    yield (
        "motor_friction", "starting_torque", (friction > 0.0) & (push <= Mc) & (Ms > Mc),
        "with this friction {other} cannot move the load; lower the friction, or raise the torque",
    )  # fmt: skip
    left = np.fmax(most, Ms) - friction - Mc
    slow = (left > 0.0) & ((b1 + b2) * target >= left)
    for name, b in zip(FRICTIONS[1:], (b1, b2), strict=True):
        yield (
            name, "target_speed", (b > 0.0) & slow,
            "at {other} this takes more torque than the motor has left; lower the one or the other",
        )  # fmt: skip
    yield (
        "load_torque", "load_kind", reactive & (torque < 0.0),
        'a reactive load torque is friction and must be 0 or more; write its size, or kind "active"',
    )  # fmt: skip
    yield (
        "rated_torque", "rated_power", abs(rated * speed - power) > 0.05 * power,
        "with the rated speed this is not {other}; data sheets agree within 5 %: one of the three is wrong",
    )  # fmt: skip
    yield (
        "initial_load_speed", "target_speed", w2 >= target,
        "the load must start below {other}, the speed that it is to reach",
    )  # fmt: skip
    permitted, longest, starts = get("permissible_torque", "permissible_start_time", "starts_per_hour")
    yield (
        "permissible_torque", "load_torque", abs(torque) >= permitted,
        "at constant speed the shaft already carries {other}; give the permissible peak, at the motor shaft",
    )  # fmt: skip
    output, ratio = get("permissible_output_torque", "gear_ratio")
    yield (
        "permissible_output_torque", "load_torque", np.maximum(abs(torque), Mc) * ratio >= output,
        "at constant speed the output already carries more: {other} at the motor shaft, and the friction of "
        "the load, times the gear ratio; give the permissible peak, at the output",
    )  # fmt: skip
    yield (
        "permissible_torque", "load_friction", (abs(torque) < permitted) & (Mc >= permitted),
        "at constant speed the shaft already carries the load torque and {other}; give the permissible peak, "
        "at the motor shaft",
    )  # fmt: skip
    yield (
        "starts_per_hour", "permissible_start_time", longest * starts > 3600.0,
        "so many starts of {other} take more than an hour; lower one of the two",
    )  # fmt: skip
    hangs = isinstance(where := values.get("start_position"), str) and where == "hanging"
    yield (
        "start_position", "load_kind", reactive and hangs,
        'only an active load hangs; friction holds a reactive one where it stands, write "unknown"',
    )  # fmt: skip
    yield (
        "initial_motor_speed", "brake", (values.get("brake") == "motor") & (abs(w1) > 0.0),
        'a motor that is held stands still; leave the speed out, or write brake "none"',
    )  # fmt: skip
    yield (
        "load_torque", "starting_torque", (push > Mc) & ((push + Mc * (J1 / J2)) / (1.0 + J1 / J2) <= 0.0),
        "against {other} this load drives so hard that the mean shaft torque (Ms J2 + J1 Mc)/(J1 + J2), to "
        "which K_dyn refers, is not above 0; use a weaker one",
    )  # fmt: skip
