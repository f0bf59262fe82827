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
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softstart.arrays import Complex, Vector
from softstart.balancing.engine import ORDERS, Engine, cleaned, force_at, largest_of_orders, shaking_of_shafts
from softstart.balancing.parts import CYCLE_ANGLE, TURN, BalancerShaft
from softstart.errors import InputError
from softstart.input.files import object_of
from softstart.quantities import number_in, to_si
from softstart.results import OneLine, Result

NOTHING = 1e-9  # of the forces of all cylinders: rounding, not a force
RPM = 30.0 / math.pi  # of one rad/s
POINTS = 96  # speeds over the range
PHI = np.linspace(0.0, 4.0 * np.pi, 1440, endpoint=False)  # for the largest sums of all orders


def free_force(engine: Engine) -> complex:
    """First-order inertia force over w^2, in kg m, that turns against the crank: what the shafts balance.

    >>> round(free_force(Engine.load("vaz-11113")).real, 5)
    0.02414
    """
    force = complex(engine.crank_shaking[0][-1])  # index -1: turns once a turn against the crank
    scale = engine.cylinders.count * engine.masses.reciprocating * engine.cylinders.crank.r
    return force if abs(force) > NOTHING * scale else 0j


def couple_shaft(engine: Engine, turn: int) -> tuple[BalancerShaft, ...]:
    """The imbalances, as far apart as the outer cylinders, against the first-order couple that turns with the
    crank (`turn` 1) or against it (-1).
    """
    couple = -complex(engine.crank_shaking[1][turn])
    ends = engine.cylinders.places[:: engine.cylinders.count - 1] if couple else ()
    return tuple(
        BalancerShaft(
            abs(couple) / (ends[-1] - ends[0]), turn, float(np.angle(couple * along)) % TURN, along=along
        )
        for along in ends
    )


def balancer_arm(engine: Engine, speed: float, load: float | None = None, *, gas: bool = True) -> complex:
    """Height + i offset in m with which the first order of the reaction torque vanishes at this speed.

    With A cos(phi) + B sin(phi) the first order of the torque (of inertia, and of the `gas` too), and throws
    together, h = B/F_b and e = A/F_b.

    >>> place = balancer_arm(Engine.load("vaz-11113"), 4500 * math.pi / 30)
    >>> round(1000 * place.real, 2), round(1000 * place.imag, 2)  # mm
    (25.93, 10.27)
    """
    torque = engine.inertia_harmonics[2] * speed**2
    if gas:
        torque = torque + engine.gas_harmonics(speed, load)[2]
    return complex(1j * torque / (speed**2 * free_force(engine).conjugate()))


def two_shafts(engine: Engine, place: complex) -> tuple[BalancerShaft, BalancerShaft]:
    """The two shafts, half the imbalance each, with height + i offset in m of the middle between them.

    Both are given that place: moving them apart about it changes neither force nor moment.

    >>> two_shafts(Engine.load("vaz-11113"), 0.03)[0].height
    0.03
    """
    force = -free_force(engine)
    phase = math.atan2(force.imag, force.real) % TURN
    # ratio -1: both against the crank, so that they balance what the counterweights cannot
    half = BalancerShaft(0.5 * abs(force), -1, phase, place.real, place.imag)
    return half, half


# name and what it is; whether its arm is for the gas torque too, not that of inertia alone; whether it is
# computed at every speed, not at the tuning speed once; whether its offset e is used too, not h alone
DESIGNS = (
    ("inertia-only", "h for the inertia torque alone", False, False, False),
    ("fixed-h", "h for gas and inertia at the tuning speed [B]", True, False, False),
    ("variable-h", "h(n) for gas and inertia at every speed [B]", True, True, False),
    ("fixed-h-e", "h and sideways offset e at the tuning speed", True, False, True),
    ("variable-h-e", "h(n) and e(n) at every speed", True, True, True),
)


@dataclass(frozen=True, eq=False, repr=False)
class Residual(OneLine):
    """What one layout leaves on the housing, one entry for each speed.

    `height` and `offset` in m of the middle of the shafts (None without designed ones). The moments are
    about the crank axis and act on the housing, in N m: `first_order_moment` is the amplitude at crank speed,
    cosine and sine its parts, `moment` the largest deviation from the mean with all orders to 24, sampled
    every half degree. Forces in N, and couples about an axis across the crank in N m, NaN without a spacing:
    the largest at crank speed, and with all orders. `shafts` are those that do it, at the tuning speed.
    """

    name: str
    about: str
    shafts: tuple[BalancerShaft, ...]
    speeds: Vector
    height: Vector | None
    offset: Vector | None
    first_order_moment: Vector
    first_order_moment_cosine: Vector
    first_order_moment_sine: Vector
    moment: Vector
    first_order_force: Vector
    force: Vector
    first_order_couple: Vector
    couple: Vector

    @property
    def columns(self) -> dict[str, Vector | None]:
        """All that is given for each speed but the speed, by its name."""
        apart = "name", "about", "shafts", "speeds"
        return {name: values for name, values in vars(self).items() if name not in apart}

    def row(self, index: int) -> dict[str, float | None]:
        """The values at one of the speeds, as plain data."""
        columns = {"speed": self.speeds, **self.columns}
        return {name: None if values is None else float(values[index]) for name, values in columns.items()}


@dataclass(frozen=True, eq=False, repr=False)
class Balance(Result, view="balances.balance_sheet"):
    """An engine over its speed range at one load: as it is, and with the balancers designed for it.

    The first of `residuals` is the engine without balancer shafts; "own-shafts" follows if it has any; then,
    if there is a first-order force for two shafts to balance, those of `DESIGNS`; then, if there is a
    first-order couple, "couple-shaft" and, where a part of it turns with the crank, "two-couple-shafts".
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
        if any(residual.shafts for residual in self.residuals if residual.name != "own-shafts"):
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

    @property
    def shown_indices(self) -> list[int]:
        """The indices of the speeds asked for."""
        return [int(np.argmin(np.abs(self.speeds - speed))) for speed in self.shown]

    def orders(self) -> list[dict[str, float]]:
        """The harmonics at the tuning speed, up to order 6, of what does not cancel; plain data.

        Torques on the crank in N m (of the gas only with a pressure) as cosine and sine of `order` times the
        crank angle; the largest force in N and couple in N m without balancer shafts.
        """
        engine, w = self.engine, self.tuning_speed
        inertia = engine.inertia_harmonics * w**2
        pressed = engine.gas is not None
        gas = engine.gas_harmonics(w, self.load) if pressed else 0.0 * inertia
        force, couple = (largest_of_orders(forces) * w**2 for forces in engine.crank_shaking)
        # without a spacing of the cylinders forces are known, couples are not
        couple = couple if engine.cylinders.couples_known else math.nan * couple
        tiny = 1e-9 * float(np.abs(gas + inertia).max())
        rows = []
        for j in range(1, 13):
            shaken = (force[j // 2], couple[j // 2]) if j % 2 == 0 else (0.0, 0.0)
            if max(abs(gas[j]), abs(inertia[j])) <= tiny and not (shaken[0] > 0.0 or shaken[1] > 0.0):
                continue
            row = {"order": ORDERS[j]}
            if pressed:
                row |= {"gas_cosine": gas[j].real, "gas_sine": -gas[j].imag}
            row |= {"inertia_cosine": inertia[j].real, "inertia_sine": -inertia[j].imag}
            row |= {"torque": abs(gas[j] + inertia[j]), "force": shaken[0], "couple": shaken[1]}
            rows.append({name: float(value) for name, value in row.items()})
        return rows

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        engine = self.engine
        work = None if engine.gas is None else engine.indicated_work(self.tuning_speed, self.load)
        return {
            "engine": engine.name,
            "source": engine.source,
            "assumed": engine.assumed,
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
            "free_couple": abs(engine.crank_shaking[1][-1]) if engine.cylinders.couples_known else None,
            "note": self.note,
            "orders": self.orders(),
            "designs": [
                {
                    "name": residual.name,
                    "about": residual.about,
                    "at_tuning_speed": residual.row(self.tuning_index),
                    **{
                        f"largest_{name}": float(values.max())
                        for name, values in residual.columns.items()
                        if values is not None and name.endswith(("moment", "force", "couple"))
                    },
                    "speeds": [residual.row(i) for i in self.shown_indices],
                }
                for residual in self.residuals
            ],
        }


def balance(
    engine: Engine | str | os.PathLike[str],
    speeds: Sequence[float | str] | None = None,
    *,
    load: float | None = None,
    tuning_speed: float | str | None = None,
) -> Balance:
    """Forces and moments of an engine at constant speed over its speed range, without and with balancers.

    Parameters
    ----------
    engine : Engine, str or path
        The engine, or its name or file.
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
    [B]: Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms.

    Examples
    --------
    >>> found = balance(Engine.load("vaz-11113"))
    >>> [round(float(one.first_order_moment[found.tuning_index]), 1) for one in found.residuals]
    [149.5, 123.4, 55.1, 55.1, 0.0, 0.0]
    """
    engine = object_of(engine, Engine, Engine.load, "engine: give one Engine")
    operation = engine.operation
    own_speed = engine.tuning_speed if tuning_speed is None else tuning_speed
    tuning = number_in("rad/s", own_speed, "tuning_speed")
    if speeds is None:
        shown = _round_speeds(operation.lowest_speed, operation.highest_speed)
    else:
        shown = np.atleast_1d(np.asarray(to_si(list(speeds), "rad/s", "speeds")))
    for name, values in (("tuning_speed", np.array([tuning])), ("speeds", shown)):
        if np.any(values <= 0.0):
            raise InputError(f"{name} = {values.min():g} rad/s: a speed must be above 0.")
    range_of = np.linspace(operation.lowest_speed, operation.highest_speed, POINTS)
    all_speeds = np.unique(np.concatenate([range_of, shown, [tuning]]))
    load_used = operation.load if load is None else float(load)
    torque = np.outer(all_speeds**2, engine.inertia_harmonics)
    if engine.gas is not None:
        torque += [engine.gas_harmonics(float(speed), load_used) for speed in all_speeds]

    layouts: list[tuple[str, str, tuple[BalancerShaft, ...], Complex | None]]
    layouts = [("none", "no balancer shafts", (), None)]
    if engine.shafts:
        layouts.append(("own-shafts", "the shafts of the file", engine.shafts, None))
    for name, about, gas, variable, sideways in DESIGNS if free_force(engine) else ():
        if gas and engine.gas is None:
            continue
        speeds_of_arm = all_speeds if variable else np.full(all_speeds.size, tuning)
        places = np.array([balancer_arm(engine, float(w), load_used, gas=gas) for w in speeds_of_arm])
        places = places if sideways else places.real + 0j  # [B] uses h alone
        shafts = two_shafts(engine, complex(places[np.argmin(np.abs(all_speeds - tuning))]))
        layouts.append((name, about, shafts, places))
    against, along = couple_shaft(engine, -1), couple_shaft(engine, 1)
    if against:
        layouts.append(("couple-shaft", "a shaft against the crank, two opposite imbalances", against, None))
    if along:
        layouts.append(("two-couple-shafts", "a second one that turns with the crank", against + along, None))
    residuals = tuple(_residual(engine, all_speeds, torque, *layout) for layout in layouts)
    return Balance(engine, load_used, tuning, all_speeds, shown, residuals)


def _round_speeds(low: float, high: float) -> Vector:
    """The ends of the range and the round speeds between: at most a dozen.

    >>> (_round_speeds(850 / RPM, 3600 / RPM) * RPM).round(6).tolist()
    [850.0, 1000.0, 1500.0, 2000.0, 2500.0, 3000.0, 3500.0, 3600.0]
    """
    step = 250.0 * math.ceil((high - low) * RPM / 2500.0) / RPM
    inside = step * np.arange(math.ceil(1.02 * low / step), 0.98 * high / step)
    return np.concatenate([[low], inside, [high]])


def _residual(
    engine: Engine,
    speeds: Vector,
    torque: Complex,
    name: str,
    about: str,
    shafts: tuple[BalancerShaft, ...],
    places: Complex | None,
) -> Residual:
    """What these shafts leave of torque and forces, for each speed; `places` of those that were designed."""
    w2 = speeds**2
    *vectors, moment = shaking_of_shafts(shafts)
    moments = np.tile(moment, (speeds.size, 1))
    if places is not None:
        moments[:, 2] = -1j * places * free_force(engine).conjugate()  # u (h sin(phi) + e cos(phi))
    left = w2[:, None] * moments - torque
    left[:, 0] = 0.0  # the mean goes through the mounts whatever is done
    angle = np.outer(ORDERS, PHI)
    # einsum: threads of a BLAS cost more than such a small product where other processes work too
    swing = np.einsum("sq,qp->sp", left.real, np.cos(angle))
    swing -= np.einsum("sq,qp->sp", left.imag, np.sin(angle))
    force, couple = (
        cleaned(crank + shaft, float(max(largest_of_orders(crank).max(), largest_of_orders(shaft).max())))
        for crank, shaft in zip(engine.crank_shaking, vectors, strict=True)
    )
    known = 1.0 if engine.cylinders.couples_known else math.nan
    turn = PHI[: PHI.size // 2]
    return Residual(
        name=name,
        about=about,
        shafts=shafts,
        speeds=speeds,
        height=None if places is None else places.real,
        offset=None if places is None else places.imag,
        first_order_moment=np.abs(left[:, 2]),
        first_order_moment_cosine=left[:, 2].real,
        first_order_moment_sine=-left[:, 2].imag,
        moment=np.abs(swing).max(axis=1),
        first_order_force=largest_of_orders(force)[1] * w2,
        force=np.abs(force_at(force, turn)).max() * w2,
        first_order_couple=largest_of_orders(couple)[1] * w2 * known,
        couple=np.abs(force_at(couple, turn)).max() * w2 * known,
    )
