"""Read one parameter of a drive, and check those that limit each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from softstart.drive.parameters import PARAMETERS, Parameter
from softstart.drive.sentences import Wording
from softstart.quantities import RefusedError, Value, nearest, parse, show

__all__ = ["LIMITS", "cross_checks", "elastic_frequency", "read_parameter"]

Values = Mapping[str, object]


def read_parameter(parameter: Parameter, value: object) -> Value | str | None:
    """The value in SI, as text, or one of the choices; raises `RefusedError` with reason and remedy.

    >>> read_parameter(PARAMETERS["gap"], "500 mrad")
    0.5
    >>> read_parameter(PARAMETERS["load_kind"], "activ")
    Traceback (most recent call last):
    softstart.quantities.RefusedError: the kind of the load torque is "active" or "reactive"; did you mean ...
    """
    if not parameter.unit:
        return _read_text(parameter, value)
    if value is None and parameter.default is None and not parameter.required:
        return None
    number = parse(value, parameter.unit, infinite=parameter.infinite)
    allowed = LIMITS[parameter.limit](np.asarray(number))
    if not np.all(allowed):
        reason = f"the {parameter.meaning} must be {parameter.limit}"
        if isinstance(number, float):
            raise RefusedError(reason)
        index = tuple(int(i) for i in np.argwhere(~allowed)[0])
        raise RefusedError(reason, float(number[index]), index)
    if isinstance(number, np.ndarray):
        number.setflags(write=False)
    return number


LIMITS: dict[str, Callable[[NDArray[np.float64]], NDArray[np.bool_]]] = {
    "any": lambda x: np.ones(x.shape, dtype=np.bool_),
    "above 0": lambda x: np.asarray(x > 0.0),
    "0 or more": lambda x: np.asarray(x >= 0.0),
    "0 or less": lambda x: np.asarray(x <= 0.0),
    "from 0 to 1": lambda x: np.asarray((x >= 0.0) & (x <= 1.0)),
    "a whole number, 0 or more": lambda x: np.asarray((x >= 0.0) & (x == np.floor(x))),
}


def _read_text(parameter: Parameter, value: object) -> str:
    if not parameter.choices:
        if not isinstance(value, str):
            raise RefusedError(f"the {parameter.meaning} must be text, such as {parameter.example}")
        if parameter.name == "name" and (not value.strip() or len(value.splitlines()) > 1):
            raise RefusedError(f"the {parameter.meaning} must be one line of text that is not empty")
        if any(0xD800 <= ord(letter) < 0xE000 for letter in value):
            raise RefusedError("this text has half a character (a lone surrogate); write it anew")
        return value
    if isinstance(value, str) and value in parameter.choices:
        return value
    *first, last = (show(choice) for choice in parameter.choices)
    reason = f"the {parameter.meaning} is {', '.join(first)} or {last}"
    meant = nearest(value, parameter.choices) if isinstance(value, str) else None
    raise RefusedError(f"{reason}; did you mean {show(meant)}?" if meant else reason)


def elastic_frequency(J1: Value, J2: Value, c: Value) -> Value:
    """`Omega = sqrt(c (J1 + J2)/(J1 J2))` in rad/s, [G](8), written so that small inertias do not underflow.

    >>> round(elastic_frequency(0.035, 0.175, 368.465), 6)
    112.397
    """
    with np.errstate(over="ignore"):
        Omega = np.sqrt(np.divide(c, J1) + np.divide(c, J2))
    return float(Omega) if np.ndim(Omega) == 0 else Omega


def cross_checks(values: Values, wording: Wording) -> Iterator[str]:
    """A sentence for every pair of valid parameters that contradict each other.

    `values` holds those parameters that are valid in themselves; checks on others are left out.
    """
    arrays = {name: value.shape for name, value in values.items() if isinstance(value, np.ndarray)}
    try:
        shape = np.broadcast_shapes(*arrays.values())
    except ValueError:
        listed = ", ".join(f"{wording.label(name)} has shape {shape}" for name, shape in arrays.items())
        yield wording.sentence(
            listed, "arrays of one drive must broadcast together; give them one length, or a single number"
        )
        return
    both = _Pairs(values, wording, shape)
    yield from both.broken(
        "maximum_torque", "starting_torque", lambda most, Ms: most < Ms,
        "the largest torque must not be below {other}; raise it, or leave it out",
    )  # fmt: skip
    yield from both.broken(
        "starting_torque", "load_torque", lambda Ms, Mc: Ms <= Mc,
        "the starting torque cannot move the load against {other}; raise the one or lower the other",
    )  # fmt: skip
    if values.get("load_kind") == "reactive":
        yield from both.broken(
            "load_torque", "load_kind", lambda Mc, _: Mc < 0.0,
            'a reactive load torque is friction and must be 0 or more; write its size, or kind "active"',
        )  # fmt: skip
    yield from both.broken(
        "initial_load_speed", "target_speed", lambda w2, target: w2 >= target,
        "the load must start below {other}, the speed that it is to reach",
    )  # fmt: skip
    yield from _impossible_dynamics(values, wording)


class _Pairs:
    """Checks of one parameter against another, element by element."""

    def __init__(self, values: Values, wording: Wording, shape: tuple[int, ...]) -> None:
        self.values, self.wording, self.shape = values, wording, shape

    def broken(
        self,
        name: str,
        other: str,
        bad: Callable[[NDArray[np.float64], NDArray[np.float64]], object],
        reason: str,
    ) -> Iterator[str]:
        if self.values.get(name) is None or self.values.get(other) is None:
            return
        a, b = (np.asarray(self.values[key]) for key in (name, other))
        wrong = np.broadcast_to(np.asarray(bad(a, b)), self.shape)
        if np.any(wrong):
            at = tuple(int(i) for i in np.argwhere(wrong)[0])
            there = f"{self._named(other, at)} = {self._shown(other, at)}"
            yield self.wording.sentence(
                f"{self._named(name, at)} = {self._shown(name, at)}", reason.format(other=there)
            )

    def _own(self, name: str, at: tuple[int, ...]) -> tuple[int, ...]:
        """The index within the parameter's own array of the element used at `at` of the broadcast shape."""
        shape = np.shape(np.asarray(self.values[name]))
        return tuple(0 if n == 1 else i for n, i in zip(shape, at[len(at) - len(shape) :], strict=True))

    def _named(self, name: str, at: tuple[int, ...]) -> str:
        own = self._own(name, at)
        return self.wording.label(name) + (f"[{', '.join(map(str, own))}]" if own else "")

    def _shown(self, name: str, at: tuple[int, ...]) -> str:
        value = self.values[name]
        if isinstance(value, str):
            return show(value)
        number = float(np.asarray(value)[self._own(name, at)])
        return f"{number:.6g} {PARAMETERS[name].unit}"


def _impossible_dynamics(values: Values, wording: Wording) -> Iterator[str]:
    needed = ("motor_inertia", "load_inertia", "stiffness", "starting_torque", "load_torque")
    if any(name not in values for name in needed):
        return
    J1, J2, c, Ms, Mc = (np.asarray(values[name], dtype=np.float64) for name in needed)
    Omega = np.asarray(elastic_frequency(J1, J2, c))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        period = 2.0 * np.pi / Omega
        mean = (Ms + Mc * (J1 / J2)) / (1.0 + J1 / J2)
    if not np.all(np.isfinite(Omega) & (Omega > 0.0) & np.isfinite(period)):
        yield wording.sentence(
            ", ".join(wording.label(name) for name in needed[:3]),
            "the elastic frequency sqrt(c (J1 + J2)/(J1 J2)) is out of all bounds; check their units",
        )
    elif np.any(~(mean > 0.0) & (Ms > Mc)):
        yield wording.sentence(
            f"{wording.label('load_torque')} = {show(values['load_torque'])}",
            "this load drives so hard that the mean shaft torque (Ms J2 + J1 Mc)/(J1 + J2), "
            "which K_dyn is measured against, is not above 0; use a weaker one",
        )
