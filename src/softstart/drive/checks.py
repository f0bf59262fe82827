"""Checks of the parameters of a drive against one another."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import numpy as np

from softstart.input.parameters import Parameter, Wording
from softstart.quantities import RefusedError, Units, Value, show

__all__ = ["FRICTIONS", "contradictions", "elastic_frequency", "wrong_units"]

BROADCAST: Final = "arrays of records must broadcast together; give them one length, or a single number"
FRICTIONS: Final = ("motor_friction", "motor_viscous_friction", "load_viscous_friction")

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
    arrays = {name: value.shape for name, value in values.items() if isinstance(value, np.ndarray)}
    try:
        shape = np.broadcast_shapes(*arrays.values()) if arrays else ()
    except ValueError:
        listed = ", ".join(
            f"{wording.label(parameters[name])} has shape {shape}" for name, shape in arrays.items()
        )
        yield wording.sentence(listed, BROADCAST)
        return
    both = _Pairs(values, parameters, wording, shape)
    yield from both.broken(
        "maximum_torque", "starting_torque", lambda most, Ms: most < Ms,
        "the largest torque must not be below {other}; raise it, or leave it out",
    )  # fmt: skip
    yield from both.broken(
        "starting_torque", "load_torque", lambda Ms, Mc: Ms <= Mc,
        "the starting torque cannot move the load against {other}; raise the one or lower the other",
    )  # fmt: skip
    yield from _friction_too_large(both)
    if values.get("load_kind") == "reactive":
        yield from both.broken(
            "load_torque", "load_kind", lambda Mc, _: Mc < 0.0,
            'a reactive load torque is friction and must be 0 or more; write its size, or kind "active"',
        )  # fmt: skip
    yield from both.broken(
        "rated_torque", "rated_power", lambda torque, power: _unequal(values, torque, power),
        "with the rated speed this is not {other}; data sheets agree within 5 %: one of the three is wrong",
    )  # fmt: skip
    yield from both.broken(
        "initial_load_speed", "target_speed", lambda w2, target: w2 >= target,
        "the load must start below {other}, the speed that it is to reach",
    )  # fmt: skip
    yield from _impossible_starts(both)
    yield from _impossible_dynamics(values, parameters, wording)


def _unequal(values: Values, torque: Value, power: Value) -> Any:
    """Whether torque times speed is not the power, beyond what a data sheet rounds."""
    speed = values.get("rated_speed")
    if speed is None:
        return False
    with np.errstate(over="ignore"):
        return np.abs(np.multiply(torque, speed) - power) > 0.05 * np.asarray(power)


class _Pairs:
    """Checks of one parameter against another, element by element."""

    def __init__(
        self, values: Values, parameters: Mapping[str, Parameter], wording: Wording, shape: tuple[int, ...]
    ) -> None:
        self.values, self.parameters, self.wording, self.shape = values, parameters, wording, shape

    def broken(self, name: str, other: str, bad: Callable[[Any, Any], Any], reason: str) -> Iterator[str]:
        a, b = self.values.get(name), self.values.get(other)
        if a is None or b is None:
            return
        wrong = bad(a, b)
        if wrong is False or not np.any(wrong):
            return
        first = np.argwhere(np.broadcast_to(wrong, self.shape))[0]
        at = tuple(int(i) for i in first)
        there = f"{self._named(other, at)} = {self._shown(other, at)}"
        subject = f"{self._named(name, at)} = {self._shown(name, at)}"
        yield self.wording.sentence(subject, reason.format(other=there))

    def _own(self, name: str, at: tuple[int, ...]) -> tuple[int, ...]:
        """The index within the parameter's own array of the element used at `at` of the broadcast shape."""
        shape = np.shape(self.values[name])
        return tuple(0 if n == 1 else i for n, i in zip(shape, at[len(at) - len(shape) :], strict=True))

    def _named(self, name: str, at: tuple[int, ...]) -> str:
        own = self._own(name, at)
        index = f"[{', '.join(map(str, own))}]" if own else ""
        return self.wording.label(self.parameters[name]) + index

    def _shown(self, name: str, at: tuple[int, ...]) -> str:
        value = self.values[name]
        if isinstance(value, str):
            return show(value)
        number = float(np.asarray(value)[self._own(name, at)])
        return f"{number:.6g} {self.parameters[name].unit}"


def _impossible_starts(both: _Pairs) -> Iterator[str]:
    """Positions and brakes that do not go with the load or its speed."""
    if both.values.get("load_kind") == "reactive" and _is(both.values.get("start_position"), "hanging"):
        yield from both.broken(
            "start_position", "load_kind", lambda *_: True,
            'only an active load hangs; friction holds a reactive one where it stands, write "unknown"',
        )  # fmt: skip
    if both.values.get("brake") == "motor":
        yield from both.broken(
            "initial_motor_speed", "brake", lambda w1, _: w1 != 0.0,
            'a motor that is held stands still; leave the speed out, or write brake "none"',
        )  # fmt: skip


def _friction_too_large(both: _Pairs) -> Iterator[str]:
    """Friction against which the motor cannot start, or not reach the target speed of the load."""
    needed = ("starting_torque", "maximum_torque", "load_torque", "target_speed")
    Ms, most, Mc, target = (both.values.get(name) for name in needed)
    friction, b1, b2 = (both.values.get(name, 0.0) for name in FRICTIONS)
    if Ms is None or Mc is None:
        return
    yield from both.broken(
        "motor_friction", "starting_torque", lambda one, Ms: (one > 0.0) & (Ms - one <= Mc) & (Ms > Mc),
        "with this friction {other} cannot move the load; lower the friction, or raise the torque",
    )  # fmt: skip
    if target is None:
        return
    left = np.maximum(Ms, Ms if most is None else most) - friction - Mc
    slow = (left > 0.0) & ((np.add(b1, b2)) * target >= left)
    for name in FRICTIONS[1:]:
        yield from both.broken(
            name, "target_speed", lambda one, _: (one > 0.0) & slow,
            "at {other} this takes more torque than the motor has left; lower the one or the other",
        )  # fmt: skip


def _is(value: object, word: str) -> bool:
    return isinstance(value, str) and value == word


def _impossible_dynamics(
    values: Values, parameters: Mapping[str, Parameter], wording: Wording
) -> Iterator[str]:
    needed = ("motor_inertia", "load_inertia", "starting_torque", "load_torque")
    if any(name not in values for name in needed):
        return
    J1, J2, Ms, Mc = (values[name] for name in needed)
    Ms = Ms - values.get("motor_friction", 0.0)
    mean = (Ms + Mc * (J1 / J2)) / (1.0 + J1 / J2)
    if np.any(~np.asarray(mean > 0.0) & np.asarray(Ms > Mc)):
        yield wording.sentence(
            f"{wording.label(parameters['load_torque'])} = {show(values['load_torque'])}",
            "this load drives so hard that the mean shaft torque (Ms J2 + J1 Mc)/(J1 + J2), "
            "which K_dyn is measured against, is not above 0; use a weaker one",
        )
