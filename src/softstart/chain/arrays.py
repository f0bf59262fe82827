"""A chain brought to one shaft, as arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softstart.drive import ContactLaw

if TYPE_CHECKING:
    from softstart.chain.model import Chain

__all__ = ["ChainArrays", "arrays_at"]

Vector = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ChainArrays:
    """N masses and N - 1 shafts, all brought to one shaft, in SI; the arrays are read-only.

    Of the masses: `J` inertia, `d_ground` damping to the ground, `Mc` load torque (braking where positive),
    `reactive` its kind, `w0` speed at the start, `speed_ratio` the speed of the mass's own shaft over that of
    the reference shaft (`i` of [R]; own speed = speed here * speed_ratio).
    Of the shafts: `c` stiffness (infinite where `rigid`), `d` damping, `gap` total gap, `restitution` (NaN
    where not rigid), `law` contact laws, `theta0` twist at the start, `efficiency` of its gear and `gear`,
    the index of the mass at which that sits: it turns with the mass, the shaft lies on its other side.
    `motor` and `load` are the indices of the masses with the motor and with the target speed.
    """

    J: Vector
    d_ground: Vector
    Mc: Vector
    reactive: Flags
    w0: Vector
    speed_ratio: Vector
    c: Vector
    d: Vector
    gap: Vector
    rigid: Flags
    restitution: Vector
    law: tuple[ContactLaw, ...]
    theta0: Vector
    efficiency: Vector
    gear: NDArray[np.int64]
    motor: int
    load: int

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def efficiency_from_motor(self) -> Vector:
        """The share of the motor's power that comes to each mass: the product of the gears on the way."""
        shares = np.ones(self.J.size)
        for i in range(self.motor, self.J.size - 1):
            shares[i + 1] = shares[i] * self.efficiency[i]
        for i in range(self.motor, 0, -1):
            shares[i - 1] = shares[i] * self.efficiency[i - 1]
        return shares


def arrays_at(chain: Chain, index: int) -> ChainArrays:
    """The chain at the shaft of mass `index`.

    With `i` the speed of a shaft over that of the reference: inertias, dampings and stiffnesses times `i^2`,
    torques times `i`, angles and speeds over `i`.
    """
    masses, shafts = chain.masses, chain.shafts
    i = np.array(chain.speed_ratios(index))
    of_shaft = np.array([i[k] if shaft.side == "before" else i[k + 1] for k, shaft in enumerate(shafts)])
    return ChainArrays(
        J=np.array([mass.inertia for mass in masses]) * i * i,
        d_ground=np.array([mass.damping for mass in masses]) * i * i,
        Mc=np.array([mass.torque for mass in masses]) * i,
        reactive=np.array([mass.kind == "reactive" for mass in masses]),
        w0=np.array([mass.initial_speed for mass in masses]) / i,
        speed_ratio=i,
        c=np.array([shaft.stiffness for shaft in shafts]) * of_shaft * of_shaft,
        d=np.array([shaft.damping for shaft in shafts]) * of_shaft * of_shaft,
        gap=np.array([shaft.gap for shaft in shafts]) / of_shaft,
        rigid=np.array([shaft.rigid for shaft in shafts]),
        restitution=np.array([math.nan if s.restitution is None else s.restitution for s in shafts]),
        law=tuple(shaft.contact_law for shaft in shafts),
        theta0=np.array([shaft.start_position for shaft in shafts]) / of_shaft,
        efficiency=np.array([shaft.efficiency for shaft in shafts]),
        gear=np.array([k + (shaft.side == "before") for k, shaft in enumerate(shafts)]),
        motor=chain.motor_index,
        load=chain.load_index,
    )
