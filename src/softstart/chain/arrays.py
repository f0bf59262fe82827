"""A chain as arrays at one shaft, where gears are gone: what simulation and natural frequencies work with."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.chain.elements import ChainParts, Shaft
from softstart.drive import ContactLaw

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ChainArrays:
    """N masses and N - 1 shafts, all brought to one shaft, in SI; the arrays are read-only.

    Of the masses: `J` inertia, `d_ground` damping to the ground, `active` load torque (braking where
    positive) and `friction`, the reactive one; `Mc` is their sum, which forward motion takes; `w0` speed at
    the start, `speed_ratio` the speed of the mass's own shaft over that of the reference shaft (`i` of [R];
    own speed = speed here * speed_ratio).
    Of the shafts: `c` stiffness (infinite where `rigid`), `d` damping, `gap` total gap, `restitution` (NaN
    where not rigid), `law` contact laws, `theta0` twist at the start, `permissible` torque (NaN where none),
    `torque_ratio` a torque here over the same at the shaft itself, `efficiency` of its gear and `gear`, the
    index of the mass at which that sits: it turns with the mass, the shaft lies on its other side.
    `motor` and `load` are the indices of the masses with the motor and with the target speed.
    """

    J: Vector
    d_ground: Vector
    active: Vector
    friction: Vector
    w0: Vector
    speed_ratio: Vector
    c: Vector
    d: Vector
    gap: Vector
    rigid: Flags
    restitution: Vector
    law: tuple[ContactLaw, ...]
    theta0: Vector
    permissible: Vector
    torque_ratio: Vector
    efficiency: Vector
    gear: NDArray[np.int64]
    motor: int
    load: int

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def Mc(self) -> Vector:
        """The load torques against forward motion, N m."""
        return self.active + self.friction

    @property
    def held(self) -> int | None:
        """The mass that stays at rest, of infinite inertia."""
        infinite = np.flatnonzero(np.isinf(self.J))
        return int(infinite[0]) if infinite.size else None

    @property
    def moving_J(self) -> Vector:
        """The inertias of the masses that move, 0 for the one that does not."""
        return self.J if self.held is None else np.where(np.isinf(self.J), 0.0, self.J)

    @property
    def path(self) -> range:
        """The shafts that lead from the motor to the load; all of them where both are on one mass."""
        low, high = sorted((self.motor, self.load))
        return range(low, high) if low < high else range(self.c.size)

    def mean_torques(self, motor_torque: float) -> Vector:
        """Mean torque of each shaft, N m, while all masses speed up as one.

        T_k = sum (J_i a + Mc_i) over the masses that shaft k drives, with a = (u - sum Mc)/sum J.

        >>> from softstart.chain import Chain
        >>> Chain.load("crane-4-mass").at_motor_shaft().mean_torques(62.0).round(2)
        array([53.9 , 53.38, 52.34])
        """
        J, load = self.moving_J, float(self.Mc.sum())
        if self.held is None:
            needed = J * (motor_torque - load) / float(J.sum()) + self.Mc
        else:  # nothing speeds up: what the loads leave is held
            needed = self.Mc + np.where(np.isinf(self.J), motor_torque - load, 0.0)
        torques = np.cumsum(needed)[:-1]
        torques[self.motor :] = np.cumsum(needed[::-1])[::-1][1 + self.motor :]
        return torques

    def mean_torque(self, motor_torque: float) -> float:
        """Mean torque of the shafts from motor to load, N m: of `mean_torques`, weighted by compliance.

        It is M12avg = (u J2 + J1 Mc)/(J1 + J2) of [G](16) with J1 and J2 by the lever rule, where the load
        torque is on the load mass.
        """
        torques, path = self.mean_torques(motor_torque), list(self.path)
        weights = np.where(self.rigid, 0.0, 1.0 / self.c)[path]
        return float(np.average(torques[path], weights=weights if weights.any() else None))

    @property
    def efficiency_from_motor(self) -> Vector:
        """The share of the motor's power that comes to each mass: the product of the gears on the way."""
        shares = np.ones(self.J.size)
        for i in range(self.motor, self.J.size - 1):
            shares[i + 1] = shares[i] * self.efficiency[i]
        for i in range(self.motor, 0, -1):
            shares[i - 1] = shares[i] * self.efficiency[i - 1]
        return shares


def arrays_at(chain: ChainParts, index: int) -> ChainArrays:
    """The chain at the shaft of mass `index`.

    With `i` the speed of a shaft over that of the reference: inertias, dampings and stiffnesses times `i^2`,
    torques times `i`, angles and speeds over `i`.
    """
    masses, shafts = chain.masses, chain.shafts
    i = np.array(chain.speed_ratios(index))
    of_shaft = np.array([i[k] if shaft.side == "before" else i[k + 1] for k, shaft in enumerate(shafts)])
    J = np.array([mass.inertia for mass in masses]) * i * i
    c = np.array([shaft.stiffness for shaft in shafts]) * of_shaft * of_shaft
    permissible = [math.nan if s.permissible_torque is None else s.permissible_torque for s in shafts]
    gap = np.array([shaft.gap for shaft in shafts]) / of_shaft
    torque, active = (
        np.array([mass.torque for mass in masses]) * i,
        [mass.kind == "active" for mass in masses],
    )
    pulls = np.where(active, torque, 0.0)
    angles = np.array([math.nan if s.start_position is None else s.start_position for s in shafts]) / of_shaft
    return ChainArrays(
        J=J,
        d_ground=np.array([mass.damping for mass in masses]) * i * i,
        active=pulls,
        friction=np.where(active, 0.0, torque) + np.array([mass.friction for mass in masses]) * i,
        w0=np.array([mass.initial_speed for mass in masses]) / i,
        speed_ratio=i,
        c=c,
        d=np.array([shaft.damping for shaft in shafts]) * of_shaft * of_shaft + _from_ratios(shafts, J, c),
        gap=gap,
        rigid=np.array([shaft.rigid for shaft in shafts]),
        restitution=np.array([math.nan if s.restitution is None else s.restitution for s in shafts]),
        law=tuple(shaft.contact_law for shaft in shafts),
        theta0=np.where(np.isnan(angles), _twists(chain, gap, c, pulls), angles),
        permissible=np.array(permissible) * of_shaft,
        torque_ratio=of_shaft,
        efficiency=np.array([shaft.efficiency for shaft in shafts]),
        gear=np.array([k + (shaft.side == "before") for k, shaft in enumerate(shafts)]),
        motor=chain.motor_index,
        load=chain.load_index,
    )


def _from_ratios(shafts: tuple[Shaft, ...], J: Vector, c: Vector) -> Vector:
    """The dampings of the shafts that have a damping ratio: d = 2 zeta sqrt(c J1 J2/(J1 + J2)).

    J1 and J2 are the masses that the shaft joins, each with those joined to it rigidly without a gap: what
    swings on this shaft when all others are cut.
    """
    welded = [shaft.rigid and shaft.gap == 0.0 for shaft in shafts]
    dampings = np.zeros(len(shafts))
    for k, shaft in enumerate(shafts):
        if shaft.damping_ratio:
            first, last = k, k + 1
            while first > 0 and welded[first - 1]:
                first -= 1
            while last < len(shafts) and welded[last]:
                last += 1
            before, after = float(J[first : k + 1].sum()), float(J[k + 1 : last + 1].sum())
            both = before * after / (before + after) if math.isfinite(before + after) else min(before, after)
            dampings[k] = 2.0 * shaft.damping_ratio * math.sqrt(c[k] * both)
    return dampings


def _twists(chain: ChainParts, gap: Vector, c: Vector, pulls: Vector) -> Vector:
    """Twists of the shafts at the chain's position; those of an unknown one are 0, its middle.

    The driving flank is that on which the motor drives the masses behind the shaft. Hanging, each shaft is
    wound up by the active loads `pulls` behind it.
    """
    if chain.position in ("mid-gap", "unknown"):
        return np.zeros(gap.size)
    motor = chain.motor_index
    drives = np.where(np.arange(gap.size) >= motor, 1.0, -1.0)
    if chain.position != "hanging":
        return (0.5 if chain.position == "driving-flank" else -0.5) * drives * gap
    behind = np.cumsum(pulls)[:-1]
    behind[motor:] = np.cumsum(pulls[::-1])[::-1][1 + motor :]
    return np.sign(behind) * drives * (0.5 * gap + np.abs(behind) / c)
