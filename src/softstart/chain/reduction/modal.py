"""Two masses with the first elastic frequency and the node of a chain, exactly."""

from __future__ import annotations

import math

import numpy as np

from softstart.chain.model import Chain, Mass, Shaft
from softstart.chain.reduction.result import Step
from softstart.chain.vibration import natural_vibration
from softstart.errors import InputError

__all__ = ["modal"]


def modal(chain: Chain) -> tuple[Chain, list[Step]]:
    """The two masses, and the one step that leads there.

    With the shape x of the first elastic mode, at the motor x1 and at the load x2, and the whole inertia J:

        J1 + J2 = J,   J1 x1 + J2 x2 = 0,   c = Omega^2 J1 J2/J

    so that frequency, whole inertia and the ratio of the amplitudes, that is the node, are those of the
    chain. The damping gives the mode the damping of the chain: `d (x1 - x2)^2/(J1 x1^2 + J2 x2^2)` equals
    `sum(d_k (x_k - x_(k+1))^2)/sum(J_k x_k^2)`. Gaps add up, torques too.

    >>> modal(Chain.load("crane-4-mass"))[0].masses[0].inertia.__round__(5)
    0.03505
    """
    vibration = natural_vibration(chain)
    arrays = chain.at_motor_shaft()
    x = vibration.shape[1]
    x1, x2 = float(x[arrays.motor]), float(x[arrays.load])
    if not x1 * x2 < 0.0:
        raise InputError(
            f"method = 'modal': the node of the first elastic mode ({vibration.Omega[1]:.6g} rad/s) does not "
            f"lie between the motor ({chain.masses[arrays.motor].name}) and the load ({chain.load_mass}), so "
            "no two masses there have it; take method lever, or name another load."
        )
    J = float(arrays.J.sum())
    J1, J2 = J * x2 / (x2 - x1), J * x1 / (x1 - x2)
    Omega = float(vibration.Omega[1])
    twist = x[:-1] - x[1:]
    d = float(arrays.d @ twist**2 / (arrays.J @ x**2)) * (J1 * x1**2 + J2 * x2**2) / (x1 - x2) ** 2
    first, last = chain.masses[arrays.motor], chain.masses[arrays.load]
    torques = {kind: float(arrays.Mc[arrays.reactive == (kind == "reactive")].sum()) for kind in _KINDS}
    ground = float(arrays.d_ground @ x**2 / (arrays.J @ x**2))  # of the mode; shared out by inertia
    speed = float(arrays.J @ arrays.w0) / J
    rotor = Mass(J1, name=first.name, damping=ground * J1, initial_speed=speed)
    load = Mass(
        J2,
        name=last.name,
        damping=ground * J2,
        torque=sum(torques.values()),
        kind="reactive" if abs(torques["reactive"]) > abs(torques["active"]) else "active",
        initial_speed=speed,
    )
    way = 1.0 if arrays.motor < arrays.load else -1.0
    shaft = Shaft(
        Omega**2 * J1 * J2 / J,
        damping=d,
        gap=float(arrays.gap.sum()),
        contact_law=chain.shafts[0].contact_law,
        efficiency=math.prod(shaft.efficiency for shaft in chain.shafts),
        start_position=way * float(arrays.theta0.sum()),
    )
    motor = None if chain.motor is None else chain.motor.replace(mass=first.name)
    reduced = Chain(
        [rotor, load],
        [shaft],
        motor,
        load_mass=last.name,
        target_speed=chain.target_speed,
        name=chain.name,
        source=chain.source,
        assumed=chain.assumed,
    )
    second = float(vibration.Omega[2]) if vibration.Omega.size > 2 else math.inf
    error = float(np.sqrt(shaft.stiffness / J1 + shaft.stiffness / J2)) / Omega - 1.0
    names = tuple(mass.name for mass in chain.masses)
    return reduced, [Step("modal", names, second, (second / Omega) ** 2, 2, (error,), (0.0,))]


_KINDS = ("active", "reactive")
