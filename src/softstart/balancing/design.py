"""The two-shaft balancer of [B], and the forces and moments left on the housing, without and with it.

Both shafts turn at crank speed against the crank. Counterweights on the crank turn with it; the shafts
balance the half of the first-order inertia force that turns against it. Their force acts midway between
them, at the height h above the crank axis and the offset e sideways, and so has a moment about it:

    F_b = u w^2,    M_b = u w^2 (h sin(phi) + e cos(phi))      (throws together, u the imbalance of both)

[B] uses h alone: with it only the sine of the first-order reaction torque can be balanced.

Where the forces cancel between the cylinders, the couples about the middle of the crank often do not: the
half that turns against the crank is balanced by one shaft with two opposite imbalances u, L apart, u L w^2;
with a second shaft, or counterweights at the ends of the crank, the other half too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.arrays import Complex, Vector
from softstart.balancing.engine import HIGHEST, Engine, moment_harmonic
from softstart.balancing.parts import CYCLE_ANGLE, TURN, BalancerShaft
from softstart.errors import InputError
from softstart.quantities import to_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NOTHING = 1e-9  # of the forces of all cylinders: rounding, not a force
RPM = 30.0 / math.pi  # of one rad/s
POINTS = 96  # speeds over the range
PHI = np.linspace(0.0, 4.0 * np.pi, 1440, endpoint=False)  # for the largest sums of all orders


def free_force(engine: Engine) -> complex:
    """First-order inertia force over w^2, in kg m, that turns against the crank: what the shafts balance.

    >>> round(free_force(Engine.load("vaz-11113")).real, 5)
    0.02414
    """
    force = complex(engine.crank_shaking[0].backward[1])
    scale = engine.cylinders.count * engine.masses.reciprocating * engine.cylinders.crank.r
    return force if abs(force) > NOTHING * scale else 0j


def free_couple(engine: Engine, *, forward: bool = False) -> complex:
    """First-order couple over w^2, in kg m^2, that turns against the crank, or with it if `forward`.

    >>> round(abs(free_couple(Engine.load("vaz-11113"))), 5)
    0.0
    """
    couple = engine.crank_shaking[1]
    return complex((couple.forward if forward else couple.backward)[1])


def couple_shaft(engine: Engine, *, forward: bool = False) -> tuple[BalancerShaft, ...]:
    """The two imbalances of the shaft for that couple, as far apart as the outer cylinders."""
    couple = -free_couple(engine, forward=forward)
    ends = engine.cylinders.places[:: engine.cylinders.count - 1] if couple else ()
    return tuple(
        BalancerShaft(
            abs(couple) / (ends[-1] - ends[0]),
            1 if forward else -1,
            float(np.angle(couple * along)) % TURN,
            along=along,
        )
        for along in ends
    )


def arm(engine: Engine, speed: float, load: float | None = None, *, gas: bool = True) -> complex:
    """Height + i offset in m with which the first order of the reaction torque vanishes at this speed.

    With A cos(phi) + B sin(phi) the first order of the torque (of inertia, and of the `gas` too), and throws
    together, h = B/F_b and e = A/F_b.

    >>> place = arm(Engine.load("vaz-11113"), 4500 * math.pi / 30)
    >>> round(1000 * place.real, 2), round(1000 * place.imag, 2)  # mm
    (25.93, 10.27)
    """
    torque = engine.inertia_harmonics[2] * speed**2
    if gas:
        torque = torque + engine.gas_harmonics(speed, load)[2]
    return complex(1j * torque / (speed**2 * free_force(engine).conjugate()))


def two_shafts(engine: Engine, place: complex) -> tuple[BalancerShaft, BalancerShaft]:
    """The two shafts, half the imbalance each, with the middle between them at height + i offset in m.

    >>> one, other = two_shafts(Engine.load("vaz-11113"), 0.03)
    >>> one.height, other.offset - one.offset
    (0.03, 0.16)
    """
    force = -free_force(engine)
    half = 0.0 if engine.layout is None else 0.5 * engine.layout.spacing
    phase = math.atan2(force.imag, force.real) % TURN
    first, second = (
        BalancerShaft(0.5 * abs(force), -1, phase, place.real, place.imag + side * half) for side in (-1, 1)
    )
    return first, second


# name and what it is; whether its arm is for the gas torque too, not that of inertia alone; whether it is
# computed at every speed, not at the tuning speed once; whether its offset e is used too, not h alone
DESIGNS = (
    ("inertia-only", "h for the inertia torque alone", False, False, False),
    ("fixed-h", "h for gas and inertia at the tuning speed [B]", True, False, False),
    ("variable-h", "h(n) for gas and inertia at every speed [B]", True, True, False),
    ("fixed-h-e", "h and sideways offset e at the tuning speed", True, False, True),
    ("variable-h-e", "h(n) and e(n) at every speed", True, True, True),
)


@dataclass(frozen=True, eq=False)
class Residual:
    """What one layout leaves on the housing, one entry for each speed.

    `height` and `offset` in m of the middle of the shafts (None without designed ones). The moments are
    about the crank axis and act on the housing, in N m: `first_order` is the amplitude at crank speed,
    `first_order_cosine` and `first_order_sine` its parts, `moment` the largest deviation from the mean with
    all orders to 24, sampled every half degree. Forces in N: `force` the largest at crank speed,
    `all_forces` with all orders; `couple` and `all_couples` the same of the couple about an axis across the
    crank, N m; NaN without a spacing. `shafts` are those that do it, at the tuning speed.
    """

    name: str
    about: str
    speeds: Vector
    height: Vector | None
    offset: Vector | None
    first_order_cosine: Vector
    first_order_sine: Vector
    moment: Vector
    force: Vector
    all_forces: Vector
    couple: Vector
    all_couples: Vector
    shafts: tuple[BalancerShaft, ...]

    @property
    def first_order(self) -> Vector:
        """Amplitude in N m of the moment at crank speed."""
        return np.hypot(self.first_order_cosine, self.first_order_sine)

    def row(self, index: int) -> dict[str, float | None]:
        """The values at one of the speeds, as plain data."""
        columns = {
            "speed": self.speeds,
            "height": self.height,
            "offset": self.offset,
            "first_order_moment": self.first_order,
            "first_order_moment_cosine": self.first_order_cosine,
            "first_order_moment_sine": self.first_order_sine,
            "moment": self.moment,
            "first_order_force": self.force,
            "force": self.all_forces,
            "first_order_couple": self.couple,
            "couple": self.all_couples,
        }
        return {name: None if values is None else float(values[index]) for name, values in columns.items()}


@dataclass(frozen=True, eq=False)
class Balance:
    """An engine over its speed range at one load: as it is, and with the balancers designed for it.

    The first of `residuals` is the engine without balancer shafts; "own-shafts" follows if it has any; then,
    if there is a first-order force for two shafts to balance, the designs of `softstart.balancing.design`;
    then, if there is a first-order couple, "couple-shaft" and, where a part of it turns with the crank,
    "two-couple-shafts".
    Speeds in rad/s; `shown` are those that were asked for.
    """

    engine: Engine
    load: float
    tuning_speed: float
    speeds: Vector
    shown: Vector
    residuals: tuple[Residual, ...]

    @property
    def imbalance(self) -> float:
        """Imbalance in kg m of both designed shafts together."""
        return abs(free_force(self.engine))

    @property
    def note(self) -> str:
        """Why no balancer was designed; empty if one was."""
        if self.imbalance or free_couple(self.engine) or free_couple(self.engine, forward=True):
            return ""
        known = self.engine.cylinders.couples_known
        return (
            f"The first-order inertia forces {'and couples ' * known}of the cylinders cancel one another: "
            f"{'shafts at crank speed have nothing to balance, and ' * known}no balancer was designed."
        )

    def residual(self, name: str) -> Residual:
        """The residual of this name; raises InputError."""
        for one in self.residuals:
            if one.name == name:
                return one
        raise InputError(f"{name}: there is {', '.join(one.name for one in self.residuals)}.")

    @cached_property
    def tuning_index(self) -> int:
        """The index of the tuning speed in `speeds`."""
        return int(np.argmin(np.abs(self.speeds - self.tuning_speed)))

    def shafts(self, name: str) -> tuple[BalancerShaft, ...]:
        """The shafts of a design at the tuning speed, as an engine takes them."""
        found = self.residual(name).shafts
        if not found:
            raise InputError(f"{name}: no shafts were designed for it.")
        return found

    def orders(self) -> list[dict[str, float]]:
        """The harmonics at the tuning speed, up to order 6, of what does not cancel; plain data.

        Torques on the crank in N m (of the gas only with a pressure) as cosine and sine of `order` times the
        crank angle; the largest force in N and couple in N m without balancer shafts.
        """
        engine, w = self.engine, self.tuning_speed
        inertia = engine.inertia_harmonics * w**2
        pressed = engine.gas is not None
        gas = engine.gas_harmonics(w, self.load) if pressed else 0.0 * inertia
        force, couple = (one.largest * w**2 for one in engine.crank_shaking)
        couple = couple if engine.cylinders.couples_known else math.nan * couple
        tiny = 1e-9 * float(np.abs(gas + inertia).max())
        rows = []
        for j in range(1, 13):
            shaken = (force[j // 2], couple[j // 2]) if j % 2 == 0 else (0.0, 0.0)
            if max(abs(gas[j]), abs(inertia[j])) <= tiny and not (shaken[0] > 0.0 or shaken[1] > 0.0):
                continue
            row = {"order": engine.orders[j]}
            if pressed:
                row |= {"gas_cosine": gas[j].real, "gas_sine": -gas[j].imag}
            row |= {"inertia_cosine": inertia[j].real, "inertia_sine": -inertia[j].imag}
            row |= {"torque": abs(gas[j] + inertia[j]), "force": shaken[0], "couple": shaken[1]}
            rows.append({name: float(value) for name, value in row.items()})
        return rows

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        engine = self.engine
        shown = [int(np.argmin(np.abs(self.speeds - speed))) for speed in self.shown]
        work = None if engine.gas is None else engine.indicated_work(self.tuning_speed, self.load)
        return {
            "engine": engine.name,
            "source": engine.source,
            "assumed": list(engine.assumed),
            "displacement": engine.displacement,
            "cylinders": engine.cylinders.count,
            "firing_angles": list(engine.cylinders.firing_angles),
            "throw_angles": list(engine.cylinders.throw_angles),
            "load": self.load,
            "tuning_speed": self.tuning_speed,
            "mean_torque": work and work / CYCLE_ANGLE,
            "indicated_work": work,
            "speed_fluctuation": engine.speed_fluctuation(self.tuning_speed, self.load),
            "imbalance": self.imbalance,
            "force_per_speed_squared": self.imbalance / RPM**2,
            "free_couple": abs(free_couple(engine)) if engine.cylinders.couples_known else None,
            "note": self.note,
            "orders": self.orders(),
            "designs": [
                {
                    "name": one.name,
                    "about": one.about,
                    "at_tuning_speed": one.row(self.tuning_index),
                    "largest_first_order_moment": float(one.first_order.max()),
                    "largest_first_order_moment_speed": float(self.speeds[one.first_order.argmax()]),
                    "largest_moment": float(one.moment.max()),
                    "largest_first_order_force": float(one.force.max()),
                    "largest_force": float(one.all_forces.max()),
                    "largest_first_order_couple": float(one.couple.max()),
                    "largest_couple": float(one.all_couples.max()),
                    "speeds": [one.row(i) for i in shown],
                }
                for one in self.residuals
            ],
        }

    def plot(self) -> Figure:
        """First-order moment, arm and force over the speed, for all designs."""
        from softstart.views import balances as views

        figure: Figure = views.residual_figure(self)
        return figure

    def figures(self) -> dict[str, Figure]:
        """All figures by the stem of their file: torque over crank angle, residuals over speed, forces."""
        from softstart.views import balances as views

        return {stem: draw() for stem, draw in views.drawings(self).items()}


def balance(
    engine: Engine,
    speeds: Sequence[float | str] | None = None,
    *,
    load: float | None = None,
    tuning_speed: float | str | None = None,
) -> Balance:
    """Forces and moments of an engine at constant speed over its speed range, without and with balancers.

    Parameters
    ----------
    engine : Engine
        The engine.
    speeds : sequence of float or str, optional
        Speeds to be shown: rad/s, or text with a unit. By default round ones over the range.
    load : float, optional
        Load, 0 to 1; by default that of the engine.
    tuning_speed : float or str, optional
        Speed at which the balancer is designed: rad/s, or text with a unit; by default that of the engine.

    Without a gas pressure the moments are those of the inertia alone.

    Returns
    -------
    Balance
        Orders, designs and what they leave: N, N m, m, rad/s.

    Raises
    ------
    InputError
        If a speed is not above 0, or the load not from 0 to 1.

    References
    ----------
    [B]: Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms; docs/paper-b.md.

    Examples
    --------
    >>> found = balance(Engine.load("vaz-11113"))
    >>> [round(float(one.first_order[found.tuning_index]), 1) for one in found.residuals]
    [149.5, 123.4, 55.1, 55.1, 0.0, 0.0]
    """
    operation = engine.operation
    given_speed = engine.tuning_speed if tuning_speed is None else tuning_speed
    tuning = float(to_si(given_speed, "rad/s", "tuning_speed"))
    if not tuning > 0.0:
        raise InputError(f"tuning_speed = {tuning:g} rad/s: it must be above 0.")
    low, high = operation.lowest_speed, operation.highest_speed
    if speeds is None:
        asked = _round_speeds(low, high)
    else:
        asked = np.atleast_1d(np.asarray(to_si(list(speeds), "rad/s", "speeds")))
    if np.any(asked <= 0.0):
        raise InputError(f"speeds = {asked.min():g} rad/s: each must be above 0.")
    every = np.unique(np.concatenate([np.linspace(low, high, POINTS), asked, [tuning]]))
    given = operation.load if load is None else engine._load(load)
    nothing = np.zeros((every.size, HIGHEST + 1), dtype=np.complex128)
    residuals = [_residual(engine, ("none", "no balancer shafts"), every, given, (), nothing)]
    if engine.shafts:
        about = ("own-shafts", "the shafts of the file")
        moments = np.tile(engine.shaft_shaking()[2], (every.size, 1))
        residuals.append(_residual(engine, about, every, given, engine.shafts, moments))
    if force := free_force(engine):
        for name, what, gas, variable, sideways in DESIGNS:
            if gas and engine.gas is None:
                continue
            speeds_of_arm = every if variable else np.full(every.size, tuning)
            places = np.array([arm(engine, float(w), given, gas=gas) for w in speeds_of_arm])
            places = places if sideways else places.real + 0j
            moments = nothing.copy()
            moments[:, 1] = [moment_harmonic(complex(one), -force, forward=False) for one in places]
            shafts = two_shafts(engine, complex(places[int(np.argmin(np.abs(every - tuning)))]))
            residuals.append(_residual(engine, (name, what), every, given, shafts, moments, places))
    against, along = couple_shaft(engine), couple_shaft(engine, forward=True)
    if against:
        about = ("couple-shaft", "a shaft against the crank with two opposite imbalances")
        residuals.append(_residual(engine, about, every, given, against, nothing))
    if along:
        about = ("two-couple-shafts", "a second one that turns with the crank")
        residuals.append(_residual(engine, about, every, given, (*against, *along), nothing))
    return Balance(engine, given, tuning, every, asked, tuple(residuals))


def _round_speeds(low: float, high: float) -> Vector:
    """The ends of the range and the round speeds between: at most a dozen.

    >>> (_round_speeds(850 / RPM, 3600 / RPM) * RPM).round(6).tolist()
    [850.0, 1000.0, 1500.0, 2000.0, 2500.0, 3000.0, 3500.0, 3600.0]
    """
    ends = np.array([low, high]) * RPM
    steps = (100.0, 250.0, 500.0, 1000.0, 2500.0, 5000.0)
    step = next((one for one in steps if (ends[1] - ends[0]) / one < 10.0), 1e4)
    inside = step * np.arange(np.ceil(ends[0] / step), ends[1] / step + 1.0)
    inside = inside[(inside > ends[0] * 1.02) & (inside < ends[1] * 0.98)]
    return np.concatenate([[low], inside / RPM, [high]])


def _residual(
    engine: Engine,
    about: tuple[str, str],
    speeds: Vector,
    load: float,
    shafts: Sequence[BalancerShaft],
    moments: Complex,
    places: Complex | None = None,
) -> Residual:
    """What is left with the forces of these shafts and with these moments over w^2, a row per speed."""
    w2 = speeds**2
    if engine.gas is None:
        left = -np.outer(w2, engine.inertia_harmonics)
    else:
        left = np.array([-engine.torque_harmonics(float(speed), load) for speed in speeds])
    left[:, ::2] += w2[:, None] * moments
    left[:, 0] = 0.0  # the mean goes through the mounts whatever is done
    shaft_force, shaft_couple, _ = engine.shaft_shaking(shafts)
    force = engine.crank_shaking[0] + shaft_force
    couple = engine.crank_shaking[1] + shaft_couple
    angle, known = np.outer(engine.orders, PHI), 1.0 if engine.cylinders.couples_known else math.nan
    # einsum: threads of a BLAS cost more than such a small product where other processes work too
    swing = np.einsum("sq,qp->sp", left.real, np.cos(angle)) - np.einsum(
        "sq,qp->sp", left.imag, np.sin(angle)
    )
    return Residual(
        *about,
        speeds=speeds,
        height=None if places is None else places.real,
        offset=None if places is None else places.imag,
        first_order_cosine=left[:, 2].real,
        first_order_sine=-left[:, 2].imag,
        moment=np.abs(swing).max(axis=1),
        force=force.largest[1] * w2,
        all_forces=np.abs(force.at(PHI[: PHI.size // 2])).max() * w2,
        couple=couple.largest[1] * w2 * known,
        all_couples=np.abs(couple.at(PHI[: PHI.size // 2])).max() * w2 * known,
        shafts=tuple(shafts),
    )
