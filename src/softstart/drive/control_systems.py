"""A drive as systems of the python-control library, so that its users can go on there.

In contact (linear), with `z` the twist beyond the gap on the touching side:

    z'  = w1 - w2,    T = c z + d (w1 - w2)
    w1' = (motor_torque - b1 w1 - T)/J1,    w2' = (T - b2 w2 - load_torque)/J2

Three states, not four: the sum of the angles neither acts on the torque nor shows in it, and would be an
unobservable double integrator in every Bode plot and observer design. Add `1/s` to `w1` for the motor angle.

The whole drive (nonlinear) has the gap, the contact law, the load torque, the torque limits, the rate limit
of the demand and the lag of the torque. It is meant for design work with python-control; exact peaks and
events come from `softstart.simulate`, which locates them. Two idealisations cannot be written as an ordinary
differential equation and are smoothed over a thousandth of the elastic period: sticking of a reactive load or
of a motor with friction (Karnopp 1985, doi:10.1115/1.3140698: stuck below a millionth of the target speed),
and the rate limit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from softstart.arrays import Vector

if TYPE_CHECKING:
    import control

    from softstart.drive.model import Drive


# The smoothing of what sticks or slews, in elastic periods, and the speed below which a load is stuck, in
# target speeds.
_SMOOTHING = 1e-3
_STUCK = 1e-6


def in_contact(drive: Drive) -> control.StateSpace:
    """The drive in contact: inputs `motor_torque`, `load_torque` (N m, braking); states `z`, `w1`, `w2`.

    Outputs are the states and `contact_torque`. Holds while the flank presses (`contact_torque > 0`; with
    the `modelica` law also while the damping torque is below that of the spring).


    >>> from softstart.drive import Drive
    >>> in_contact(Drive.load("crane-4amtkf")).output_labels
    ['z', 'w1', 'w2', 'shaft_torque']
    """
    import control

    J1, J2, c, d = drive.J1, drive.J2, drive.c, drive.d
    torque = np.array([[c, d, -d]])
    states = ["z", "w1", "w2"]
    _, b1, b2 = drive.frictions
    return control.StateSpace(
        np.vstack([[[0.0, 1.0, -1.0]], -torque / J1, torque / J2]) - np.diag([0.0, b1 / J1, b2 / J2]),
        np.array([[0.0, 0.0], [1.0 / J1, 0.0], [0.0, -1.0 / J2]]),
        np.vstack([np.eye(3), torque]),
        np.zeros((4, 2)),
        inputs=["motor_torque", "load_torque"],
        states=states,
        outputs=[*states, "shaft_torque"],
        name=_system_name(drive),
    )


def contact_torque(theta: float, rate: float, c: float, d: float, gap: float, *, law: str) -> float:
    """Torque in N m that the shaft passes to the load at the twist `theta` (rad) and its rate (rad/s).

    On the touching side, `z = |theta| - gap/2 > 0` and `z'` its rate: `no-pull` max(0, c z + d z'),
    `dead-zone` c z + d z', `modelica` 0 if c z + d z' <= 0, else c z + min(c z, d z') (ElastoBacklash of the
    Modelica Standard Library); 0 while the gap is open.

    >>> [contact_torque(1.0, -8.0, 4.0, 1.0, 0.5, law=law) for law in ("no-pull", "dead-zone", "modelica")]
    [0.0, -5.0, 0.0]
    """
    z = abs(theta) - 0.5 * gap
    if z <= 0.0:
        return 0.0
    side = math.copysign(1.0, theta)
    spring, damper = c * z, d * side * rate
    if law != "dead-zone" and spring + damper <= 0.0:
        return 0.0
    return side * (spring + (min(spring, damper) if law == "modelica" else damper))


def whole_drive(drive: Drive) -> control.NonlinearIOSystem:
    """The whole drive: input `demand` (N m), outputs `phi1, w1, phi2, w2, u, T` in SI.

    States `phi1, w1, phi2, w2`, then `reference` (the demand behind the rate limit) if `torque_rate` is
    finite and `u` if there is a `torque_lag`. `params` holds J1, J2, c, d, gap, Mc (the load torque of its
    kind), load_friction, b1 and b2, to be overridden in a simulation. Give it `initial_state(drive)`, and a
    `max_step` below the shortest stage to the solver, or it may step over a contact.

    >>> from softstart.drive import Drive
    >>> whole_drive(Drive.load("servo-axis-small")).state_labels
    ['phi1', 'w1', 'phi2', 'w2', 'u']
    """
    import control

    states = _states(drive)
    actuator = _actuator(drive, states)
    smoothing = _SMOOTHING * drive.elastic_period
    stuck = _STUCK * drive.target_speed
    active, drag = drive.load_kind == "active", drive.motor_friction
    law = drive.contact_law

    def rate(torque: float, speed: float, friction: float, inertia: float) -> float:
        direction = 1.0
        if friction > 0.0:
            if abs(speed) <= stuck and abs(torque) <= friction:
                return -speed / smoothing
            direction = math.copysign(1.0, speed if abs(speed) > stuck else torque)
        return (torque - direction * friction) / inertia

    def torque(x: Vector, p: dict[str, float]) -> float:
        return contact_torque(x[0] - x[2], x[1] - x[3], p["c"], p["d"], p["gap"], law=law)

    def update(t: float, x: Vector, inputs: Vector, params: dict[str, float]) -> Vector:
        T = torque(x, params)
        u, internal = actuator(x, inputs[0])
        pull, hold = (params["Mc"], 0.0) if active else (0.0, params["Mc"])
        hold += params["load_friction"]
        w2_rate = rate(T - params["b2"] * x[3] - pull, x[3], hold, params["J2"])
        w1_rate = rate(u - T - params["b1"] * x[1], x[1], drag, params["J1"])
        return np.array([x[1], w1_rate, x[3], w2_rate, *internal])

    def output(t: float, x: Vector, inputs: Vector, params: dict[str, float]) -> Vector:
        return np.array([*x[:4], actuator(x, inputs[0])[0], torque(x, params)])

    system: control.NonlinearIOSystem = control.nlsys(
        update,
        output,
        inputs=["demand"],
        outputs=["phi1", "w1", "phi2", "w2", "u", "T"],
        states=states,
        name=_system_name(drive),
        params={symbol: float(getattr(drive, symbol)) for symbol in ("J1", "J2", "c", "d", "gap")}
        | {"Mc": float(drive.load_torque), "load_friction": float(drive.load_friction)}
        | {"b1": drive.motor_viscous_friction, "b2": drive.load_viscous_friction},
    )
    return system


def initial_state(drive: Drive) -> Vector:
    """The state in which `whole_drive(drive)` starts; the motor torque and its reference start at 0.

    >>> from softstart.drive import Drive
    >>> initial_state(Drive.load("crane-4amtkf").replace(start_position=-0.25))
    array([-0.25,  0.  ,  0.  ,  0.  ])
    """
    mechanical = [drive.theta0, drive.initial_motor_speed, 0.0, drive.initial_load_speed]
    return np.array([*mechanical, *(0.0 for _ in _states(drive)[4:])])


def _states(drive: Drive) -> list[str]:
    states = ["phi1", "w1", "phi2", "w2"]
    if math.isfinite(drive.torque_rate):
        states.append("reference")
    if drive.torque_lag > 0.0:
        states.append("u")
    return states


def _actuator(drive: Drive, states: list[str]) -> Callable[[Vector, float], tuple[float, list[float]]]:
    """The function that gives motor torque and the rates of the actuator's states."""
    low, high = drive.minimum_torque, drive.maximum_torque
    lag, rate = drive.torque_lag, drive.torque_rate
    follow = _SMOOTHING * drive.elastic_period
    limited, lagging = "reference" in states, "u" in states

    def actuator(x: Vector, demand: float) -> tuple[float, list[float]]:
        wanted = min(max(demand, low), high)
        rates = []
        if limited:
            reference = float(x[4])
            rates.append(min(max((wanted - reference) / follow, -rate), rate))
            wanted = reference
        if lagging:
            u = float(x[-1])
            rates.append((wanted - u) / lag)
            wanted = u
        return wanted, rates

    return actuator


def _system_name(drive: Drive) -> str:
    """The name without the dots and brackets that python-control gives a meaning."""
    return re.sub(r"\W+", "_", drive.name).strip("_") or "drive"
