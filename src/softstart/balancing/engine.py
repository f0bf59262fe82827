"""A four-stroke in-line engine at constant speed: torques of gas and inertia, and forces on its housing.

Constant speed of the crank is assumed throughout; `Engine.speed_fluctuation` says how far that is from true.
The rod counts as two masses, at its pins; friction and the drive of valves are left out.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.balancing.assumed import assumed_keys
from softstart.balancing.cycle import SimpleCycle
from softstart.balancing.indicator import MeasuredCycle
from softstart.balancing.parts import (
    CYCLE_ANGLE,
    BalancerShaft,
    Counterweights,
    Cylinders,
    Layout,
    Masses,
    Operation,
)
from softstart.balancing.periodic_torque import PeriodicTorque
from softstart.balancing.shaking import Shaking, shaking_of_crank, shaking_of_shafts
from softstart.balancing.slider_crank import Vector, inertia_torque_harmonics
from softstart.balancing.tables import (
    BALANCER,
    COUNTERWEIGHTS,
    CYCLE,
    CYLINDERS,
    INDICATOR,
    LIBRARY,
    MASSES,
    OPERATION,
    SHAFT,
    TABLES,
    TOP,
)
from softstart.balancing.work import shape_work, torque_harmonics
from softstart.errors import InputError
from softstart.input.documents import Table, document_text, read_document

__all__ = ["HIGHEST", "INDICATOR_FILE", "Engine"]

INDICATOR_FILE = "indicator.csv"

HIGHEST = 24  # the highest order of the crank speed that is looked at
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Engine:
    """Cylinders in one row, their masses, the pressure in them, and what balances them.

    `shafts` are balancer shafts the engine has; `layout` is what is fixed of a two-shaft balancer that is to
    be designed. `assumed` names the keys, as in a file, whose values are assumed and not from the source.

    >>> engine = Engine.load("vaz-11113")
    >>> round(engine.displacement * 1e6, 1), engine.cylinders.count
    (749.9, 2)
    """

    cylinders: Cylinders
    masses: Masses
    gas: SimpleCycle | MeasuredCycle
    operation: Operation
    counterweights: Counterweights = field(default_factory=Counterweights)
    shafts: tuple[BalancerShaft, ...] = ()
    layout: Layout | None = None
    name: str = "unnamed engine"
    source: str = ""
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "shafts", tuple(self.shafts))
        object.__setattr__(self, "assumed", tuple(self.assumed))
        wrong = list(self.gas.refuse(self.cylinders))
        if isinstance(self.gas, MeasuredCycle) and self.operation.load != 1.0:
            wrong.append(_fixed_load(self.operation.load))
        wrong += [
            f"ratio = {shaft.ratio:g}: orders up to {HIGHEST} are looked at; give a smaller ratio."
            for shaft in self.shafts
            if abs(shaft.ratio) > HIGHEST
        ]
        if wrong:
            raise InputError(wrong)

    # ---- where engines come from -------------------------------------------------------------------------

    @classmethod
    def load(cls, engine: str | os.PathLike[str], also: Mapping[str, object] | None = None) -> Engine:
        """An engine from its TOML file, or a shipped one by its name; `also` as in `from_toml`."""
        text, where = LIBRARY.find(engine)
        return cls.from_toml(text, where=where, folder=Path(where).parent, also=also)

    @classmethod
    def from_toml(
        cls,
        text: str,
        *,
        where: str = "",
        folder: str | os.PathLike[str] = "",
        also: Mapping[str, object] | None = None,
    ) -> Engine:
        """An engine from TOML text; a measured pressure is looked for in `folder`.

        `also` holds changes as typed, {"masses.reciprocating": "0.7 kg"}; what is changed is no longer
        assumed.

        >>> engine = Engine.load("vaz-11113")
        >>> Engine.from_toml(engine.to_toml()) == engine
        True
        """
        found = read_document(text, TABLES, "an engine", where=where, also=also)
        before = f"{where}: " if where else ""
        wrong: list[str] = []

        def part(place: str, make: Any, values: dict[str, Any]) -> Any:
            try:
                return make(**values)
            except InputError as error:
                wrong.extend(f"{before}{place}{' ' if place else ''}{s}" for s in error.sentences)
                return None

        named: dict[str, Any] = found.pop("")
        cylinders = part("[cylinders]", Cylinders, found["cylinders"])
        made: dict[str, Any] = {
            "masses": part("[masses]", Masses, found["masses"]),
            "operation": part("[operation]", Operation, found["operation"]),
            "counterweights": part("[counterweights]", Counterweights, found["counterweights"] or {}),
            "shafts": [part(f"[shaft] {i},", BalancerShaft, row) for i, row in enumerate(found["shaft"], 1)],
            "layout": part("[balancer]", Layout, found["balancer"]) if found["balancer"] else None,
            "assumed": part(
                "", assumed_keys, {"text": named.pop("assumed"), "changed": also or {}, "found": found}
            ),
        }
        gas: Any = None
        if (found["cycle"] is None) == (found["indicator"] is None):
            how = "neither is there" if found["cycle"] is None else "both are there"
            wrong.append(f"{before}[cycle], [indicator]: one of the two gives the pressure, and {how}.")
        elif found["cycle"] is not None:
            gas = part("[cycle]", SimpleCycle, found["cycle"])
        else:
            row = found["indicator"]
            path = Path(folder) / row["file"]
            gas = part(
                "[indicator]",
                MeasuredCycle.from_csv,
                {"path": path, "crankcase_pressure": row["crankcase_pressure"]},
            )
        if wrong:
            raise InputError(wrong)
        try:
            return cls(cylinders, gas=gas, **made, **named)
        except InputError as error:
            raise InputError(f"{before}{sentence}" for sentence in error.sentences) from None

    def to_toml(self) -> str:
        """The engine as TOML text in SI, which `from_toml` reads back to an equal one.

        A measured pressure is not in it: it stands in its own file.
        """
        blocks: list[tuple[Table, Any]] = [
            (TOP, {"name": self.name, "source": self.source, "assumed": ", ".join(self.assumed)}),
            (CYLINDERS, vars(self.cylinders)),
            (MASSES, vars(self.masses)),
            (COUNTERWEIGHTS, vars(self.counterweights)),
            (OPERATION, vars(self.operation)),
            *((BALANCER, vars(layout)) for layout in [self.layout] if layout is not None),
            *((SHAFT, vars(shaft)) for shaft in self.shafts),
        ]
        if isinstance(self.gas, MeasuredCycle):
            about = {"file": INDICATOR_FILE, "crankcase_pressure": self.gas.crankcase_pressure}
            blocks.insert(1, (INDICATOR, about))
        else:
            blocks.insert(4, (CYCLE, vars(self.gas)))
        return document_text((table, {k: v for k, v in given.items() if v != ""}) for table, given in blocks)

    # ---- figures -----------------------------------------------------------------------------------------

    @property
    def displacement(self) -> float:
        """Displacement in m^3 of all cylinders."""
        return self.cylinders.count * self.cylinders.displacement

    @property
    def tuning_speed(self) -> float:
        """Speed in rad/s at which a balancer is tuned: that of the layout, else the highest."""
        return self.operation.highest_speed if self.layout is None else self.layout.tuning_speed

    def _load(self, load: float | None) -> float:
        if load is None:
            return self.operation.load
        if isinstance(self.gas, MeasuredCycle) and load != 1.0:
            raise InputError(_fixed_load(load))
        if not 0.0 <= load <= 1.0:
            raise InputError(f"load = {load}: it must be from 0 to 1.")
        return float(load)

    # ---- torques over the crank angle --------------------------------------------------------------------

    def pressure(self, theta: ArrayLike, speed: float, load: float | None = None) -> Vector:
        """Pressure in Pa in a cylinder, theta rad after its firing dead centre."""
        theta = np.asarray(theta, dtype=np.float64)
        weights = self.gas.weights(self.cylinders, speed, self._load(load))
        difference = weights @ self.gas.shapes(self.cylinders, theta.ravel())
        found: Vector = difference.reshape(theta.shape) + self.gas.crankcase_pressure
        return found

    def gas_torque(self, phi: ArrayLike, speed: float, load: float | None = None) -> Vector:
        """Torque in N m of the gas of all cylinders on the crank, at crank angles in rad."""
        phi = np.asarray(phi, dtype=np.float64)
        crank, area = self.cylinders.crank, self.cylinders.area
        found = np.zeros(phi.shape)
        for firing in self.cylinders.firing_angles:
            theta = np.mod(phi - firing, CYCLE_ANGLE)
            difference = self.pressure(theta, speed, load) - self.gas.crankcase_pressure
            found -= area * difference * crank.slope(theta)
        return found

    def inertia_torque(self, phi: ArrayLike, speed: float) -> Vector:
        """Torque in N m of the reciprocating masses on the crank: -m w^2 s' s'' for each cylinder."""
        phi = np.asarray(phi, dtype=np.float64)
        crank = self.cylinders.crank
        found = np.zeros(phi.shape)
        for firing in self.cylinders.firing_angles:
            found -= crank.slope(phi - firing) * crank.curvature(phi - firing)
        torque: Vector = self.masses.reciprocating * speed**2 * found
        return torque

    def torque(self, phi: ArrayLike, speed: float, load: float | None = None) -> Vector:
        """Torque in N m of gas and inertia on the crank. The housing has to bear the same, reversed."""
        return self.gas_torque(phi, speed, load) + self.inertia_torque(phi, speed)

    # ---- harmonics ---------------------------------------------------------------------------------------

    @cached_property
    def orders(self) -> Vector:
        """Multiples 0, 0.5, 1 .. of the crank speed: the orders of the harmonics below."""
        found: Vector = 0.5 * np.arange(2 * HIGHEST + 1, dtype=np.float64)
        return found

    @cached_property
    def _turned(self) -> Complex:
        """Sum over the cylinders of exp(-i q firing angle), 0 where an order cancels."""
        found: Complex = np.exp(-1j * np.outer(self.orders, self.cylinders.firing_angles)).sum(axis=1)
        found[np.abs(found) < 1e-12 * self.cylinders.count] = 0.0
        return found

    def gas_harmonics(self, speed: float, load: float | None = None) -> Complex:
        """C_q of the gas torque Re sum C_q exp(i q phi) in N m, q as in `orders`; [B](2) has z A and z B."""
        weights = self.gas.weights(self.cylinders, speed, self._load(load))
        one = torque_harmonics(self.gas, self.cylinders, HIGHEST)
        found: Complex = (weights @ one) * self._turned
        return found

    @cached_property
    def inertia_harmonics(self) -> Complex:
        """The same of the inertia torque over w^2, in kg m^2, [B](3): B_k sin is -i B_k here."""
        found = np.zeros(2 * HIGHEST + 1, dtype=np.complex128)
        crank = self.cylinders.crank
        whole = np.array(inertia_torque_harmonics(crank.ratio, HIGHEST))
        found[::2] = -1j * self.masses.reciprocating * crank.r**2 * whole
        return found * self._turned

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
        found = self.torque_harmonics(speed, load)
        kept = (self._turned != 0.0) & (self.orders > 0.0) & (self.orders <= orders)
        return PeriodicTorque(
            float(found[0].real), self.orders[kept], found[kept].real, -found[kept].imag, float(speed)
        )

    # ---- forces on the housing ---------------------------------------------------------------------------

    @cached_property
    def crank_shaking(self) -> tuple[Shaking, Shaking]:
        """Forces over w^2 in kg m, and couples in kg m^2, of the crank drive with its counterweights."""
        return shaking_of_crank(self.cylinders, self.masses, self.counterweights, HIGHEST)

    @cached_property
    def bare_shaking(self) -> tuple[Shaking, Shaking]:
        """The same as if there were no counterweights."""
        bare = Counterweights(reciprocating_share=0.0, rotating_share=0.0)
        return shaking_of_crank(self.cylinders, self.masses, bare, HIGHEST)

    def shaft_shaking(
        self, shafts: Sequence[BalancerShaft] | None = None
    ) -> tuple[Shaking, Shaking, Complex]:
        """Forces, couples and moment about the crank over w^2 of these balancer shafts, else its own."""
        return shaking_of_shafts(self.shafts if shafts is None else shafts, HIGHEST)

    # ---- work and speed ----------------------------------------------------------------------------------

    def indicated_work(self, speed: float, load: float | None = None) -> float:
        """Work in J of the gas in one cycle of all cylinders: 4 pi times the mean torque."""
        weights = self.gas.weights(self.cylinders, speed, self._load(load))
        return float(self.cylinders.count * (weights @ shape_work(self.gas, self.cylinders)))

    def speed_fluctuation(self, speed: float, load: float | None = None) -> float | None:
        """Coefficient (w_max - w_min)/w against a constant load torque: excess work over inertia and w^2.

        None without that inertia. It measures what the constant speed that is assumed everywhere leaves out.
        """
        if self.masses.inertia is None:
            return None
        phi = np.linspace(0.0, CYCLE_ANGLE, 7200, endpoint=False)
        orders = self.orders[1:]
        integral = self.torque_harmonics(speed, load)[1:] / (1j * orders)
        excess = (np.exp(1j * np.outer(phi, orders)) @ integral).real
        return float(np.ptp(excess) / (self.masses.inertia * speed**2))


def _fixed_load(load: float) -> str:
    return (
        f"load = {load:g}: a measured pressure is that of the load at which it was measured; leave the load "
        "at 1, or describe the pressure by [cycle]."
    )
