"""A four-stroke in-line engine at constant speed: torques of gas and inertia, and forces on its housing.

Constant speed of the crank is assumed throughout; `Engine.speed_fluctuation` tells how far from true that is.
The rod is replaced by two masses at its pins; friction and the valve drive are left out.

Which orders the inertia forces have, and which of them shafts remove, is seen in one array F of the vectors
that turn with the crank (F[q], at q times its speed) and against it (F[-q]); a shaft removes one of them. The
force is sum F[q] exp(i q phi), a complex number: upwards + i sideways, sideways to where the crank turns on
top. So the crank pin of a throw at angle phi is r exp(i phi), and a moment about the crank axis, positive
with the crank, is Im(conj(place) force). Everything is over w^2, in kg m: at constant speed all forces grow
with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Complex, Vector
from softstart.balancing.gas import SimpleCycle, torque_harmonics
from softstart.balancing.parts import (
    CYCLE_ANGLE,
    HIGHEST,
    BalancerShaft,
    Counterweights,
    Cylinders,
    Masses,
    Operation,
)
from softstart.balancing.slider_crank import acceleration_harmonics, inertia_torque_harmonics
from softstart.chain.periodic_torque import PeriodicTorque
from softstart.errors import InputError
from softstart.input.documents import document_text
from softstart.input.files import Library
from softstart.input.parameter_file import ParameterFile
from softstart.input.parameter_set import Rows, component, parameter

TURNS = np.roll(np.arange(-HIGHEST, HIGHEST + 1.0), -HIGHEST)  # of F: 0, 1 .. 24, -24 .. -1
ORDERS = 0.5 * np.arange(2 * HIGHEST + 1)  # of torques: multiples 0, 0.5, 1 .. of the crank speed
ROUNDING = 1e-13  # of the sum of the sizes
LIBRARY = Library("softstart.balancing", "an engine", "engines")


def force_at(force: Complex, phi: ArrayLike) -> Complex:
    """The vector at crank angles in rad, over w^2."""
    return (np.exp(1j * np.multiply.outer(np.asarray(phi), TURNS)) * force).sum(axis=-1)


def largest_of_orders(force: Complex) -> Vector:
    """Largest size of each order 0, 1 .. 24, over w^2: half the long axis of the ellipse of its vector."""
    sizes = np.abs(force)
    return np.append(sizes[:1], sizes[1 : HIGHEST + 1] + sizes[:HIGHEST:-1])


def cleaned(sums: Complex, scale: float) -> Complex:
    """The sums, 0 where they cancel but for rounding."""
    return np.where(np.abs(sums) < ROUNDING * scale, 0.0, sums)


def shaking_of_crank(
    cylinders: Cylinders, masses: Masses, counterweights: Counterweights
) -> tuple[Complex, Complex]:
    """Forces and couples over w^2 of all cylinders with their counterweights, as vectors that turn.

    [B](1) for one cylinder without counterweights: m r cos(phi), half of it forwards and half backwards.

    >>> one = Cylinders("82 mm", "71 mm", "121 mm", firing_angles=(0.0,))
    >>> force, _ = shaking_of_crank(one, Masses(1.0), Counterweights())
    >>> float(force[1].real), float(force[-1].real)
    (0.01775, 0.01775)
    """
    r, m = cylinders.crank.r, masses.reciprocating
    half = 0.5 * m * r * acceleration_harmonics(cylinders.crank.ratio, HIGHEST)
    one = np.concatenate([half, half[:0:-1]])
    one[1] += r * (
        masses.rotating * (1.0 - counterweights.rotating_share) - m * counterweights.reciprocating_share
    )
    # at crank angle phi the crank of a cylinder stands at phi - its firing angle
    each: Complex = one * np.exp(-1j * np.outer(cylinders.firing_angles, TURNS))
    scale = cylinders.count * (m + masses.rotating) * r
    couple = cleaned(cylinders.places @ each, 0.5 * scale * cylinders.count * cylinders.spacing)
    return cleaned(each.sum(axis=0), scale), couple


def shaking_of_shafts(shafts: Sequence[BalancerShaft]) -> tuple[Complex, Complex, Complex]:
    """Forces and couples over w^2 of balancer shafts, and C_j of the moment about the crank, as of a torque.

    A force F exp(i q phi) at a place has the moment Im(conj(place) F exp(i q phi)).

    >>> force, couple, moment = shaking_of_shafts([BalancerShaft(0.02, -1, phase="180 deg", height=0.03)])
    >>> complex(force[-1].round(6)), complex(moment[2].round(9))  # 0.0006 sin(phi)
    ((-0.02+0j), -0.0006j)
    """
    force, couple, moment = np.zeros((3, TURNS.size), dtype=np.complex128)
    for shaft in shafts:
        turn = int(shaft.ratio)
        vector = shaft.imbalance * turn**2 * np.exp(1j * shaft.phase)
        force[turn] += vector
        couple[turn] += shaft.along * vector
        about = -1j * shaft.place.conjugate() * vector
        moment[2 * abs(turn)] += about if turn > 0 else about.conjugate()
    scale = sum(shaft.imbalance * shaft.ratio**2 for shaft in shafts)
    return cleaned(force, scale), couple, moment


class Engine(ParameterFile, library=LIBRARY):
    """A four-stroke engine: cylinders in one row, their masses and pressure, counterweights and shafts.

    Parameters
    ----------
    cylinders : Cylinders
        Bore, stroke, rod, spacing (m) and firing angles (rad).
    masses : Masses
        Masses of one cylinder, kg, and inertia of the crank, kg m^2.
    gas : SimpleCycle or None
        Pressure in a cylinder over the cycle, Pa; forces and couples do not need it.
    operation : Operation
        Speed range, rad/s, and load, 0 to 1.
    counterweights : Counterweights, optional
        Shares of the masses that are balanced on the crank.
    shafts : tuple of BalancerShaft, optional
        Balancer shafts that the engine has.
    name, source, assumed : str, optional
        Name of the engine, source of its numbers, and which of them are assumed.

    Raises
    ------
    InputError
        If the parts do not fit one another.

    References
    ----------
    [B]: Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms.

    Examples
    --------
    >>> engine = Engine.load("vaz-11113")
    >>> round(engine.displacement * 1e6, 1), engine.cylinders.count
    (749.9, 2)
    """

    # fmt: off
    cylinders: Cylinders = component(Cylinders, kw_only=False)
    masses: Masses = component(Masses, kw_only=False)
    counterweights: Counterweights = component(Counterweights, default=Counterweights())
    gas: SimpleCycle | None = component(SimpleCycle, default=None)
    operation: Operation = component(Operation)
    shafts: Rows[BalancerShaft] = component(BalancerShaft, least=0, default=())
    name: str = parameter("name", "", "name of the engine", '"my engine"', default="unnamed engine")
    source: str = parameter("source", "", "source of the numbers", '"data sheet"', default="")
    assumed: str = parameter("assumed", "", "which values are assumed", '"rod_length, all masses"',
        default="")
    # fmt: on

    def contradictions(self) -> Iterator[str]:
        """Sentences on pressures below that without heat."""
        for speed in (self.gas.speeds or (0.0,)) if self.gas else ():
            try:
                self._weights(speed, None)
            except InputError as error:
                yield from error.sentences

    def to_toml(self) -> str:
        """The engine as TOML text, which `from_toml` reads back to an equal one."""
        blocks = ((table, holder.values().items()) for _, table, holder in self.blocks())
        kept = ((table, {name: value for name, value in values if value != ""}) for table, values in blocks)
        return document_text(kept, units=False)

    # ---- figures -----------------------------------------------------------------------------------------

    @property
    def displacement(self) -> float:
        """Displacement in m^3 of all cylinders."""
        return self.cylinders.count * self.cylinders.displacement

    @property
    def tuning_speed(self) -> float:
        """Speed in rad/s at which a balancer is tuned, by default the highest."""
        return self.operation.tuning_speed or self.operation.highest_speed

    def _weights(self, speed: float, load: float | None) -> tuple[SimpleCycle, Vector]:
        """The pressure, and the factors of its shapes; raises InputError without one, or at a bad load."""
        load = self.operation.load if load is None else load
        if self.gas is None:
            raise InputError("[cycle]: it gives the gas torque; add one.")
        if not 0.0 <= load <= 1.0:
            raise InputError(f"load = {load}: it must be from 0 to 1.")
        return self.gas, self.gas.weights(self.cylinders, speed, load)

    # ---- torques over the crank angle --------------------------------------------------------------------

    def pressure(self, theta: ArrayLike, speed: float, load: float | None = None) -> Vector:
        """Pressure in Pa in a cylinder, theta rad after its firing dead centre."""
        theta = np.asarray(theta, dtype=np.float64)
        gas, weights = self._weights(speed, load)
        difference = weights @ gas.shapes(self.cylinders, theta.ravel())
        return difference.reshape(theta.shape) + gas.crankcase_pressure

    def gas_torque(self, phi: ArrayLike, speed: float, load: float | None = None) -> Vector:
        """Torque in N m of the gas of all cylinders on the crank, at crank angles in rad."""
        theta = np.mod(-np.subtract.outer(self.cylinders.firing_angles, phi), CYCLE_ANGLE)
        difference = self.pressure(theta, speed, load) - self._weights(speed, load)[0].crankcase_pressure
        return -self.cylinders.area * (difference * self.cylinders.crank.slope(theta)).sum(axis=0)

    def inertia_torque(self, phi: ArrayLike, speed: float) -> Vector:
        """Torque in N m of the reciprocating masses on the crank: -m w^2 s' s'' for each cylinder."""
        theta, crank = -np.subtract.outer(self.cylinders.firing_angles, phi), self.cylinders.crank
        products: Vector = (crank.slope(theta) * crank.curvature(theta)).sum(axis=0)
        return -self.masses.reciprocating * speed**2 * products

    def torque(self, phi: ArrayLike, speed: float, load: float | None = None) -> Vector:
        """Torque in N m of gas and inertia on the crank. Its reaction acts on the housing."""
        return self.gas_torque(phi, speed, load) + self.inertia_torque(phi, speed)

    # ---- harmonics ---------------------------------------------------------------------------------------

    @cached_property
    def _turned(self) -> Complex:
        """Sum over the cylinders of exp(-i q firing angle), 0 where an order cancels."""
        sums: Complex = np.exp(-1j * np.outer(ORDERS, self.cylinders.firing_angles)).sum(axis=1)
        sums[np.abs(sums) < 1e-12 * self.cylinders.count] = 0.0
        return sums

    def gas_harmonics(self, speed: float, load: float | None = None) -> Complex:
        """C_q of the gas torque Re sum C_q exp(i q phi) in N m, q as in `ORDERS`; [B](2) has z A and z B."""
        gas, weights = self._weights(speed, load)
        return weights @ torque_harmonics(gas, self.cylinders) * self._turned

    @cached_property
    def inertia_harmonics(self) -> Complex:
        """The same of the inertia torque over w^2, in kg m^2, [B](3): B_k sin is -i B_k here."""
        harmonics = np.zeros(2 * HIGHEST + 1, dtype=np.complex128)
        crank = self.cylinders.crank
        whole = inertia_torque_harmonics(crank.ratio, HIGHEST)
        harmonics[::2] = -1j * self.masses.reciprocating * crank.r**2 * whole
        return harmonics * self._turned

    def torque_harmonics(self, speed: float, load: float | None = None) -> Complex:
        """The same of gas and inertia together, in N m."""
        return self.gas_harmonics(speed, load) + speed**2 * self.inertia_harmonics

    def torque_of_time(self, speed: float, load: float | None = None, orders: float = 12.0) -> PeriodicTorque:
        """The torque at this constant speed in rad/s: its harmonics up to `orders` that do not cancel.

        >>> torque = Engine.load("vaz-11113").torque_of_time(471.0)
        >>> torque.orders[:3].tolist(), round(torque.mean, 1) > 0
        ([1.0, 2.0, 3.0], True)
        """
        if not 0.5 <= orders <= HIGHEST:
            raise InputError(f"orders = {orders}: harmonics from order 0.5 to {HIGHEST} can be taken.")
        harmonics = self.torque_harmonics(speed, load)
        kept = (self._turned != 0.0) & (ORDERS > 0.0) & (orders >= ORDERS)
        return PeriodicTorque(
            float(harmonics[0].real), ORDERS[kept], harmonics[kept].real, -harmonics[kept].imag, float(speed)
        )

    # ---- forces on the housing ---------------------------------------------------------------------------

    @cached_property
    def crank_shaking(self) -> tuple[Complex, Complex]:
        """Forces over w^2 in kg m, and couples in kg m^2, of the crank drive with its counterweights."""
        return shaking_of_crank(self.cylinders, self.masses, self.counterweights)

    # ---- work and speed ----------------------------------------------------------------------------------

    def indicated_work(self, speed: float, load: float | None = None) -> float:
        """Work in J of the gas in one cycle of all cylinders: 4 pi times the mean torque."""
        return CYCLE_ANGLE * float(self.gas_harmonics(speed, load)[0].real)

    def speed_fluctuation(self, speed: float, load: float | None = None) -> float | None:
        """Coefficient (w_max - w_min)/w against a constant load torque: excess work over inertia and w^2.

        None without that inertia or a pressure. It measures the error of the constant speed that is assumed
        everywhere.
        """
        if self.masses.inertia is None or self.gas is None:
            return None
        phi = np.linspace(0.0, CYCLE_ANGLE, 7200, endpoint=False)
        integral = self.torque_harmonics(speed, load)[1:] / (1j * ORDERS[1:])
        excess = (np.exp(1j * np.outer(phi, ORDERS[1:])) @ integral).real
        return float(np.ptp(excess) / (self.masses.inertia * speed**2))
