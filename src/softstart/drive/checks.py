"""Checks of the parameters of a drive against one another."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from types import SimpleNamespace
from typing import Any, Final, TypeVar

import numpy as np

from softstart.arrays import Vector
from softstart.input.gear import Gear
from softstart.input.parameters import Parameter, Wording
from softstart.quantities import RefusedError, Units, show

BROADCAST: Final = "the arrays of a table must broadcast together; give them one length, or a single number"
FRICTIONS: Final = ("motor_friction", "motor_viscous_friction", "load_viscous_friction")

GRAVITY: Final = 9.80665  # m/s^2

Values = Mapping[str, Any]
Numeric = TypeVar("Numeric", float, Vector)


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


def mean_torque_of(M1: Numeric, J1: Numeric, J2: Numeric, Mc: Numeric) -> Numeric:
    """`M12avg = (M1 J2 + J1 Mc)/(J1 + J2)`, N m, [G](11): it accelerates both masses alike.

    >>> round(mean_torque_of(62.0, 0.035, 0.175, 7.16), 6)
    52.86
    """
    return (M1 * J2 + J1 * Mc) / (J1 + J2)


def wrong_units(values: Values, parameter: Parameter, wording: Wording, gear: Gear | str) -> Iterator[str]:
    """A sentence if the units in which a machine is to be shown cannot be read, or it has no such shaft.

    `gear` is that to the output, or the reason why there is none.
    """
    try:
        Units.read(values.get(parameter.name, ""), gear=gear)
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

    given = _symbols(values)

    def at(name: str, index: tuple[int, ...]) -> str:
        """A parameter and its value at this index of the broadcast shape."""
        value, label = values[name], wording.label(parameters[name])
        if isinstance(value, str):
            return f"{label} = {show(value)}"
        array = np.asarray(value)
        position = tuple(
            0 if n == 1 else i for n, i in zip(array.shape, index[len(index) - array.ndim :], strict=True)
        )
        place = f"[{', '.join(map(str, position))}]" if position else ""
        return f"{label}{place} = {float(array[position]):.6g} {parameters[name].unit}"

    for name, other, rule, reason in RULES:
        wrong = rule(given)
        if wrong is not False and np.any(wrong):
            index = tuple(np.argwhere(np.broadcast_to(wrong, shape))[0].tolist())
            yield wording.sentence(at(name, index), reason.format(other=at(other, index)))


def _symbols(values: Values) -> SimpleNamespace:
    """The values that rules compare, by symbols; NaN, never true in comparisons, where one is unknown."""

    def get(name: str) -> Any:
        return math.nan if values.get(name) is None else values[name]

    where, friction = values.get("start_position"), values.get("load_friction", 0.0)
    drag, b1, b2 = (values.get(name, 0.0) for name in FRICTIONS)
    Ms, most, torque = get("starting_torque"), get("maximum_torque"), get("load_torque")
    Mc, push = torque + friction, Ms - drag
    left = np.fmax(most, Ms) - drag - Mc  # for viscous friction
    return SimpleNamespace(
        Ms=Ms, most=most, torque=torque, Mc=Mc, drag=drag, b1=b1, b2=b2, push=push,
        ratio=get("motor_inertia") / get("load_inertia"), target=get("target_speed"),
        w1=get("initial_motor_speed"), w2=get("initial_load_speed"), rated=get("rated_torque"),
        power=get("rated_power"), speed=get("rated_speed"), permitted=get("permissible_torque"),
        output=get("permissible_output_torque"),
        soft=get("soft_stiffness"), c=get("stiffness"),
        to_output=Gear(get("gear_ratio"), values.get("gear_efficiency", 1.0), Mc).of_torques,
        slow=(left > 0.0) & ((b1 + b2) * get("target_speed") >= left),
        busy=get("permissible_start_time") * get("starts_per_hour"),  # s in an hour
        opening_late=_opening_late(values),
        reactive=values.get("load_kind") == "reactive", braked=values.get("brake") == "motor",
        hangs=isinstance(where, str) and where == "hanging",
    )  # fmt: skip


def _opening_late(values: Values) -> Any:
    """Whether the release of a brake at a time has an opening delay besides."""
    release, delay = values.get("release"), values.get("opening_delay", 0.0)
    return not isinstance(release, str | None) and (delay > 0.0) & (release != delay)


VISCOUS = "at {other} this takes more torque than the motor has left; lower the one or the other"
# two parameters, whether their values contradict each other, and why
# fmt: off
RULES: tuple[tuple[str, str, Callable[[Any], Any], str], ...] = (
    ("maximum_torque", "starting_torque", lambda v: v.most < v.Ms,
     "the largest torque must not be below {other}; raise it, or leave it out"),
    ("soft_stiffness", "stiffness", lambda v: v.soft >= v.c,
     "the soft end must be below {other}, the stiff end; leave it out where the stiffness is known"),
    ("starting_torque", "load_torque", lambda v: v.Ms <= v.torque,
     "the starting torque cannot move the load against {other}; raise the one or lower the other"),
    ("starting_torque", "load_friction", lambda v: (v.Ms > v.torque) & (v.Ms <= v.Mc),
     "the starting torque cannot move the load against its torque and {other}; raise the one or lower the "
     "other"),
    ("motor_friction", "starting_torque", lambda v: (v.drag > 0.0) & (v.push <= v.Mc) & (v.Ms > v.Mc),
     "with this friction {other} cannot move the load; lower the friction, or raise the torque"),
    ("motor_viscous_friction", "target_speed", lambda v: (v.b1 > 0.0) & v.slow, VISCOUS),
    ("load_viscous_friction", "target_speed", lambda v: (v.b2 > 0.0) & v.slow, VISCOUS),
    ("load_torque", "load_kind", lambda v: v.reactive & (v.torque < 0.0),
     'a reactive load torque is friction and must be 0 or more; write its size, or kind "active"'),
    ("rated_torque", "rated_power", lambda v: abs(v.rated * v.speed - v.power) > 0.05 * v.power,
     "with the rated speed this is not {other}; data sheets agree within 5 %: one of the three is wrong"),
    ("initial_load_speed", "target_speed", lambda v: v.w2 >= v.target,
     "the load must start below {other}, the speed that it is to reach"),
    ("permissible_torque", "load_torque", lambda v: abs(v.torque) >= v.permitted,
     "at constant speed the shaft already carries {other}; give the permissible peak, at the motor shaft"),
    ("permissible_output_torque", "load_torque",
     lambda v: np.maximum(abs(v.torque), v.Mc) * v.to_output >= v.output,
     "at constant speed the output already carries more: {other} at the motor shaft, and the friction of the "
     "load, brought to the output; give the permissible peak, at the output"),
    ("permissible_torque", "load_friction", lambda v: (abs(v.torque) < v.permitted) & (v.Mc >= v.permitted),
     "at constant speed the shaft already carries the load torque and {other}; give the permissible peak, at "
     "the motor shaft"),
    ("starts_per_hour", "permissible_start_time", lambda v: v.busy > 3600.0,
     "so many starts of {other} take more than an hour; lower one of the two"),
    ("start_position", "load_kind", lambda v: v.reactive and v.hangs,
     'only an active load hangs; friction holds a reactive one where it stands, write "unknown"'),
    ("initial_motor_speed", "brake", lambda v: v.braked & (abs(v.w1) > 0.0),
     'a motor that is held stands still; leave the speed out, or write brake "none"'),
    ("release", "opening_delay", lambda v: v.opening_late,
     "a release at a time counts from the start, and {other} from the command of the start; leave one out"),
    ("load_torque", "starting_torque",
     lambda v: (v.push > v.Mc) & ((v.push + v.Mc * v.ratio) / (1.0 + v.ratio) <= 0.0),
     "against {other} this load drives so hard that the mean shaft torque (Ms J2 + J1 Mc)/(J1 + J2), to "
     "which K_dyn refers, is not above 0; use a weaker one"),
)
# fmt: on
