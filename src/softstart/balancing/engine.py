"""A four-stroke in-line engine at constant speed: torques of gas and inertia, and forces on its housing.

Constant speed of the crank is assumed throughout; `Engine.speed_fluctuation` tells how far from true that is.
The rod is replaced by two masses at its pins; friction and the valve drive are left out.

Inertia forces are resolved by order into two vectors, one turning with the crank, one against it. A force
across the crank is a complex number: upwards + i sideways, sideways to where the crank turns on top. So the
crank pin of a throw at angle phi is r exp(i phi), and a moment about the crank axis, positive with the crank,
is Im(conj(place) force). Everything is over w^2, in kg m: at constant speed all forces grow with it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Complex, Vector
from softstart.balancing.gas import Gas, MeasuredCycle, SimpleCycle, shape_work, torque_harmonics
from softstart.balancing.parts import (
    CYCLE_ANGLE,
    BalancerShaft,
    Counterweights,
    Cylinders,
    Layout,
    Masses,
    Operation,
)
from softstart.balancing.slider_crank import acceleration_harmonics, inertia_torque_harmonics
from softstart.chain.periodic_torque import PeriodicTorque
from softstart.errors import InputError
from softstart.input.documents import Table, document_text, made, read_document
from softstart.input.files import Library
from softstart.input.parameters import Parameter
from softstart.quantities import nearest, show

HIGHEST = 24  # order of the crank speed
ROUNDING = 1e-13  # of the sum of the sizes
INDICATOR_FILE = "indicator.csv"
LIBRARY = Library("softstart.balancing", "an engine", "engines")

TOP = Table(
    "",
    (
        Parameter("name", "", "name of the engine", '"my engine"', default="unnamed engine"),
        Parameter("source", "", "source of the numbers", '"data sheet"', default=""),
        Parameter(
            "assumed", "", "keys whose values are assumed, with commas between",
            '"cylinders.rod_length, masses.*"', default="",
        ),
    ),
)  # fmt: skip

INDICATOR = Table(
    "indicator",
    (
        Parameter("file", "", "CSV file of crank angle and pressure", '"indicator.csv"'),
        Parameter(
            "crankcase_pressure", "Pa", "pressure below the pistons", '"1 bar"', "above 0", default=1e5,
        ),
    ),
    required=False,
)  # fmt: skip

CYLINDERS, MASSES, COUNTERWEIGHTS, OPERATION, BALANCER, CYCLE = (
    replace(part.TABLES[0], required=required)
    for part, required in (
        (Cylinders, True), (Masses, True), (Counterweights, True), (Operation, True), (Layout, False),
        (SimpleCycle, False),
    )
)  # fmt: skip
SHAFT = replace(BalancerShaft.TABLES[0], many=True)
USUAL = dict.fromkeys(("lowest_speed", "highest_speed", "tuning_speed", "speeds"), "rpm")
TABLES = (TOP, CYLINDERS, MASSES, COUNTERWEIGHTS, CYCLE, INDICATOR, OPERATION, BALANCER, SHAFT)


def assumed_keys(text: str, changed: Mapping[str, object], found: Mapping[str, Any]) -> tuple[str, ...]:
    """The keys named in a text as "masses.*, cycle.speeds", but those `changed` by the user.

    A star stands for all keys of a table that are there in `found`.

    >>> assumed_keys("masses.*", {"masses.rotating": 1}, {"masses": {"reciprocating": 1, "rotating": 2}})
    ('masses.reciprocating',)
    >>> assumed_keys("mases.*", {}, {})
    Traceback (most recent call last):
    softstart.errors.InputError: assumed = "mases.*": an engine file has no such key; did you mean masses.*?
    """
    known: dict[str, list[str]] = {}
    for table in (table for table in TABLES if table.name):
        values = found.get(table.name)
        here = values.items() if isinstance(values, Mapping) else ()
        known[f"{table.name}.*"] = [f"{table.name}.{key}" for key, value in here if value is not None]
        known |= {p.path: [p.path] for p in table.parameters}
    names = [name.strip() for name in text.split(",") if name.strip()]
    wrong = []
    for name in (name for name in names if name not in known):
        meant = nearest(name, list(known))
        hint = f"did you mean {meant}?" if meant else "write masses.rotating, or masses.* for all."
        wrong.append(f"assumed = {show(name)}: an engine file has no such key; {hint}")
    if wrong:
        raise InputError(wrong)
    keys = dict.fromkeys(key for name in names for key in known[name])
    return tuple(key for key in keys if key not in changed)


@dataclass(frozen=True, eq=False)
class Shaking:
    """Forces sum_q forward_q exp(i q phi) + backward_q exp(-i q phi), q = 0, 1 .. the last index.

    Forces are in kg m; each times its place along the crank, they are couples in kg m^2.
    """

    forward: Complex
    backward: Complex

    def __add__(self, other: Shaking) -> Shaking:
        scale = float(max(self.largest.max(), other.largest.max()))
        return Shaking(
            _clean(self.forward + other.forward, scale), _clean(self.backward + other.backward, scale)
        )

    def at(self, phi: ArrayLike) -> Complex:
        """The vector at crank angles in rad, over w^2."""
        turning = np.exp(1j * np.multiply.outer(np.asarray(phi, dtype=np.float64), self.orders))
        found: Complex = (turning * self.forward + turning.conj() * self.backward).sum(axis=-1)
        return found

    def up_to(self, highest: int | None) -> Shaking:
        """The same with the orders up to `highest` only."""
        end = None if highest is None else highest + 1
        return Shaking(self.forward[:end], self.backward[:end])

    @property
    def orders(self) -> Vector:
        """Multiples 0, 1, 2 .. of the crank speed."""
        return np.arange(self.forward.size, dtype=np.float64)

    @property
    def largest(self) -> Vector:
        """Largest size of each order, over w^2: half the long axis of the ellipse that its vector draws."""
        return np.abs(self.forward) + np.abs(self.backward)


def shaking_of_crank(
    cylinders: Cylinders, masses: Masses, counterweights: Counterweights, highest: int
) -> tuple[Shaking, Shaking]:
    """Forces and couples of all cylinders with their counterweights.

    [B](1) for one cylinder without counterweights: m r cos(phi), half of it forwards and half backwards.

    >>> one = Cylinders("82 mm", "71 mm", "121 mm", firing_angles=(0.0,))
    >>> force, _ = shaking_of_crank(one, Masses(1.0), Counterweights(), 2)
    >>> float(force.forward[1].real), float(force.backward[1].real)
    (0.01775, 0.01775)
    """
    crank = cylinders.crank
    harmonics = np.array(acceleration_harmonics(crank.ratio, highest))
    orders = np.arange(highest + 1)
    # at crank angle phi the crank of a cylinder stands at phi - its firing angle
    turned = np.exp(-1j * np.outer(cylinders.firing_angles, orders))
    half = 0.5 * masses.reciprocating * crank.r * harmonics
    forward, backward = half * turned, half * turned.conj()
    rotating = masses.rotating * (1.0 - counterweights.rotating_share)
    rotating -= masses.reciprocating * counterweights.reciprocating_share
    forward[:, 1] += rotating * crank.r * turned[:, 1]
    along = np.array(cylinders.places)
    scale = cylinders.count * (masses.reciprocating + masses.rotating) * crank.r
    arms = max(0.5 * cylinders.count * cylinders.spacing, 1e-300)
    return (
        Shaking(_clean(forward.sum(axis=0), scale), _clean(backward.sum(axis=0), scale)),
        Shaking(_clean(along @ forward, scale * arms), _clean(along @ backward, scale * arms)),
    )


def _clean(sums: Complex, scale: float) -> Complex:
    """The sums, 0 where they cancel but for rounding."""
    return np.where(np.abs(sums) < ROUNDING * scale, 0.0, sums)


def shaking_of_shafts(shafts: Sequence[BalancerShaft], highest: int) -> tuple[Shaking, Shaking, Complex]:
    """Forces and couples of balancer shafts, and the moment M_q about the crank, Re sum M_q exp(i q phi).

    >>> shaft = BalancerShaft(0.02, -1, phase="180 deg", height=0.03)
    >>> force, couple, moment = shaking_of_shafts([shaft], 2)
    >>> complex(force.backward[1].round(6)), complex(moment[1].round(9))
    ((-0.02+0j), -0.0006j)
    """
    vectors = np.zeros((2, 2, highest + 1), dtype=np.complex128)
    scale = sum(shaft.imbalance * shaft.ratio**2 for shaft in shafts)
    moment = np.zeros(highest + 1, dtype=np.complex128)
    for shaft in shafts:
        q = int(abs(shaft.ratio))
        force = shaft.imbalance * shaft.ratio**2 * np.exp(1j * shaft.phase)
        side = 0 if shaft.ratio > 0 else 1
        vectors[0, side, q] += force
        vectors[1, side, q] += shaft.along * force
        moment[q] += moment_harmonic(shaft.place, force, forward=shaft.ratio > 0)
    return Shaking(*_clean(vectors[0], scale)), Shaking(*vectors[1]), moment


def moment_harmonic(place: complex, force: complex, *, forward: bool) -> complex:
    """M in Re(M exp(i q phi)) = Im(conj(place) force exp(+-i q phi)), the moment of a turning force.

    >>> moment_harmonic(0.03, -0.02, forward=False)  # 0.0006 sin(phi)
    -0.0006j
    """
    arm = place.conjugate() * force
    return -1j * arm if forward else (-1j * arm).conjugate()


@dataclass(frozen=True)
class Engine:
    """A four-stroke engine: cylinders in one row, their masses and pressure, counterweights and shafts.

    Parameters
    ----------
    cylinders : Cylinders
        Bore, stroke, rod, spacing (m) and firing angles (rad).
    masses : Masses
        Masses of one cylinder, kg, and inertia of the crank, kg m^2.
    gas : SimpleCycle, MeasuredCycle or None
        Pressure in a cylinder over the cycle, Pa; forces and couples do not need it.
    operation : Operation
        Speed range, rad/s, and load, 0 to 1.
    counterweights : Counterweights, optional
        Shares of the masses that are balanced on the crank.
    shafts : tuple of BalancerShaft, optional
        Balancer shafts that the engine has.
    layout : Layout, optional
        Given values of a two-shaft balancer that is to be designed.
    name, source : str, optional
        Name of the engine, and source of its numbers.
    assumed : tuple of str, optional
        Keys, as in a file, whose values are assumed and not from the source.

    Raises
    ------
    InputError
        If the parts do not fit one another.

    References
    ----------
    [B]: Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms; docs/paper-b.md.

    Examples
    --------
    >>> engine = Engine.load("vaz-11113")
    >>> round(engine.displacement * 1e6, 1), engine.cylinders.count
    (749.9, 2)
    """

    cylinders: Cylinders
    masses: Masses
    gas: Gas | None
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
        wrong = [] if self.gas is None else list(self.gas.refuse(self.cylinders))
        if isinstance(self.gas, MeasuredCycle) and self.operation.load != 1.0:
            wrong.append(_fixed_load(self.operation.load))
        wrong += [
            f"ratio = {shaft.ratio:g}: orders up to {HIGHEST} are looked at; give a smaller ratio."
            for shaft in self.shafts
            if abs(shaft.ratio) > HIGHEST
        ]
        if wrong:
            raise InputError(wrong)

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
        found = read_document(text, TABLES, "an engine", where=where, also=also, usual=USUAL)
        before = f"{where}: " if where else ""
        wrong: list[str] = []

        def part(place: str, make: Any, values: Any) -> Any:
            return made(make, values, f"{before}{place}{' ' if place else ''}", wrong)

        named: dict[str, Any] = found.pop("")
        cycle, indicator = found["cycle"], found["indicator"]
        parts: dict[str, Any] = {
            key: part(f"[{table}]", make, found[table] or {})
            for key, table, make in (
                ("cylinders", "cylinders", Cylinders), ("masses", "masses", Masses),
                ("operation", "operation", Operation), ("counterweights", "counterweights", Counterweights),
                ("layout", "balancer", Layout), ("gas", "cycle", SimpleCycle),
            )
            if found[table] or table == "counterweights"
        }  # fmt: skip
        parts.setdefault("gas", None)
        parts["shafts"] = [
            part(f"[shaft] {i},", BalancerShaft, row) for i, row in enumerate(found["shaft"], 1)
        ]
        about = {"text": named.pop("assumed"), "changed": also or {}, "found": found}
        parts["assumed"] = part("", assumed_keys, about)
        if cycle is not None and indicator is not None:
            wrong.append(f"{before}[cycle], [indicator]: both give the pressure; leave one out.")
        elif indicator is not None:
            measured = {"path": Path(folder) / indicator["file"]}
            measured["crankcase_pressure"] = indicator["crankcase_pressure"]
            parts["gas"] = part("[indicator]", MeasuredCycle.from_csv, measured)
        if wrong:
            raise InputError(wrong)
        try:
            return cls(**parts, **named)
        except InputError as error:
            raise InputError(f"{before}{sentence}" for sentence in error.sentences) from None

    def to_toml(self) -> str:
        """The engine as TOML text, which `from_toml` reads back to an equal one.

        A measured pressure is not in it: it stands in its own file.
        """
        blocks: list[tuple[Table, Any]] = [
            (TOP, {"name": self.name, "source": self.source, "assumed": ", ".join(self.assumed)}),
            (CYLINDERS, self.cylinders.values()),
            (MASSES, self.masses.values()),
            (COUNTERWEIGHTS, self.counterweights.values()),
            (OPERATION, self.operation.values()),
            *((BALANCER, layout.values()) for layout in [self.layout] if layout is not None),
            *((SHAFT, shaft.values()) for shaft in self.shafts),
        ]
        if isinstance(self.gas, MeasuredCycle):
            about = {"file": INDICATOR_FILE, "crankcase_pressure": self.gas.crankcase_pressure}
            blocks.insert(1, (INDICATOR, about))
        elif self.gas is not None:
            blocks.insert(4, (CYCLE, self.gas.values()))
        kept = ((table, {k: v for k, v in given.items() if v != ""}) for table, given in blocks)
        return document_text(kept, units=False)

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

    def _weights(self, speed: float, load: float | None) -> tuple[Gas, Vector]:
        """The pressure, and the factors of its shapes; raises InputError where none is given."""
        if self.gas is None:
            raise InputError("[cycle], [indicator]: one of the two gives the gas torque; add one.")
        return self.gas, self.gas.weights(self.cylinders, speed, self._load(load))

    # ---- torques over the crank angle --------------------------------------------------------------------

    def pressure(self, theta: ArrayLike, speed: float, load: float | None = None) -> Vector:
        """Pressure in Pa in a cylinder, theta rad after its firing dead centre."""
        theta = np.asarray(theta, dtype=np.float64)
        gas, weights = self._weights(speed, load)
        difference = weights @ gas.shapes(self.cylinders, theta.ravel())
        found: Vector = difference.reshape(theta.shape) + gas.crankcase_pressure
        return found

    def gas_torque(self, phi: ArrayLike, speed: float, load: float | None = None) -> Vector:
        """Torque in N m of the gas of all cylinders on the crank, at crank angles in rad."""
        theta = np.mod(-np.subtract.outer(self.cylinders.firing_angles, phi), CYCLE_ANGLE)
        difference = self.pressure(theta, speed, load) - self._weights(speed, load)[0].crankcase_pressure
        found: Vector = -self.cylinders.area * (difference * self.cylinders.crank.slope(theta)).sum(axis=0)
        return found

    def inertia_torque(self, phi: ArrayLike, speed: float) -> Vector:
        """Torque in N m of the reciprocating masses on the crank: -m w^2 s' s'' for each cylinder."""
        theta, crank = -np.subtract.outer(self.cylinders.firing_angles, phi), self.cylinders.crank
        found: Vector = (crank.slope(theta) * crank.curvature(theta)).sum(axis=0)
        return -self.masses.reciprocating * speed**2 * found

    def torque(self, phi: ArrayLike, speed: float, load: float | None = None) -> Vector:
        """Torque in N m of gas and inertia on the crank. Its reaction acts on the housing."""
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
        gas, weights = self._weights(speed, load)
        found: Complex = weights @ torque_harmonics(gas, self.cylinders, HIGHEST) * self._turned
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
        gas, weights = self._weights(speed, load)
        return float(self.cylinders.count * (weights @ shape_work(gas, self.cylinders)))

    def speed_fluctuation(self, speed: float, load: float | None = None) -> float | None:
        """Coefficient (w_max - w_min)/w against a constant load torque: excess work over inertia and w^2.

        None without that inertia or a pressure. It measures the error of the constant speed that is assumed
        everywhere.
        """
        if self.masses.inertia is None or self.gas is None:
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
