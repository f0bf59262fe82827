"""What is left of the forces and moments on the housing over the speeds, without and with balancer shafts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.balancing.design import DESIGNS, free_force, two_shafts
from softstart.balancing.engine import HIGHEST, Engine
from softstart.balancing.parts import BalancerShaft
from softstart.balancing.shaking import moment_harmonic
from softstart.balancing.slider_crank import Vector
from softstart.errors import InputError
from softstart.late import late
from softstart.quantities import to_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

views = late("softstart.views.balances")

__all__ = ["Balance", "Residual", "balance"]

RPM = math.pi / 30.0
POINTS = 96  # speeds over the range
PHI = np.linspace(
    0.0, 4.0 * np.pi, 1440, endpoint=False
)  # where the largest sums of all orders are looked for


@dataclass(frozen=True, eq=False)
class Residual:
    """What one layout leaves, an entry a speed.

    `height` and `offset` in m of the middle of the shafts (None without designed ones). The moments are
    about the crank axis and act on the housing, in N m: `first_order` is the amplitude at crank speed,
    `first_order_cosine` and `first_order_sine` its parts, `moment` the largest deviation from the mean with
    all orders to 24, looked for every half degree. Forces in N: `force` the largest at crank speed,
    `all_forces` with all orders. `couple` in N m is the largest of first order about an axis across the
    crank.
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

    @property
    def first_order(self) -> Vector:
        """Amplitude in N m of the moment at crank speed."""
        return np.hypot(self.first_order_cosine, self.first_order_sine)

    def row(self, index: int) -> dict[str, float | None]:
        """The values at one of the speeds, as plain data."""
        return {
            "speed": float(self.speeds[index]),
            "height": None if self.height is None else float(self.height[index]),
            "offset": None if self.offset is None else float(self.offset[index]),
            "first_order_moment": float(self.first_order[index]),
            "first_order_moment_cosine": float(self.first_order_cosine[index]),
            "first_order_moment_sine": float(self.first_order_sine[index]),
            "moment": float(self.moment[index]),
            "first_order_force": float(self.force[index]),
            "force": float(self.all_forces[index]),
            "first_order_couple": float(self.couple[index]),
        }


@dataclass(frozen=True, eq=False)
class Balance:
    """An engine over its speed range at one load: as it is, and with the balancers designed for it.

    The first of `residuals` is the engine without balancer shafts; "own-shafts" follows if it has any; then,
    if there is a first-order force for two shafts to balance, the designs of `softstart.balancing.design`.
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
        if self.imbalance:
            return ""
        return (
            "The first-order inertia forces of the cylinders cancel one another: two shafts at crank speed "
            "have nothing to balance, and no balancer was designed."
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

    def shafts(self, name: str) -> tuple[BalancerShaft, BalancerShaft]:
        """The two shafts of a design at the tuning speed, as an engine takes them."""
        one = self.residual(name)
        if one.height is None or one.offset is None:
            raise InputError(f"{name}: no shafts were designed for it.")
        return two_shafts(self.engine, complex(one.height[self.tuning_index], one.offset[self.tuning_index]))

    def orders(self) -> list[dict[str, float]]:
        """The harmonics at the tuning speed, up to order 6, of what does not cancel; plain data.

        Torques on the crank in N m as cosine and sine of `order` times the crank angle; the largest force in
        N and couple in N m without balancer shafts.
        """
        engine, w = self.engine, self.tuning_speed
        gas, inertia = engine.gas_harmonics(w, self.load), engine.inertia_harmonics * w**2
        force, couple = (one.largest * w**2 for one in engine.crank_shaking)
        tiny = 1e-9 * float(np.abs(gas + inertia).max())
        rows = []
        for j in range(1, 13):
            whole, both = j % 2 == 0, gas[j] + inertia[j]
            if abs(gas[j]) < tiny and abs(inertia[j]) < tiny and not (whole and force[j // 2] > tiny):
                continue
            rows.append(
                {
                    "order": float(engine.orders[j]),
                    "gas_cosine": float(gas[j].real),
                    "gas_sine": float(-gas[j].imag),
                    "inertia_cosine": float(inertia[j].real),
                    "inertia_sine": float(-inertia[j].imag),
                    "torque": float(abs(both)),
                    "force": float(force[j // 2]) if whole else 0.0,
                    "couple": float(couple[j // 2]) if whole else 0.0,
                }
            )
        return rows

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        engine = self.engine
        shown = [int(np.argmin(np.abs(self.speeds - speed))) for speed in self.shown]
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
            "mean_torque": float(engine.torque_harmonics(self.tuning_speed, self.load)[0].real),
            "indicated_work": engine.indicated_work(self.tuning_speed, self.load),
            "speed_fluctuation": engine.speed_fluctuation(self.tuning_speed, self.load),
            "imbalance": self.imbalance,
            "force_per_speed_squared": self.imbalance * RPM**2,
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
                    "speeds": [one.row(i) for i in shown],
                }
                for one in self.residuals
            ],
        }

    def plot(self) -> Figure:
        """First-order moment, arm and force over the speed, for all designs."""
        return self.figures()["residual"]

    def figures(self) -> dict[str, Figure]:
        """All figures by the stem of their file: torque over crank angle, residuals over speed, forces."""
        found: dict[str, Figure] = views.figures(self)
        return found


def balance(
    engine: Engine,
    speeds: Sequence[float | str] | None = None,
    *,
    load: float | None = None,
    tuning_speed: float | str | None = None,
) -> Balance:
    """An engine at constant speed, without and with balancers, over its speeds.

    `speeds` (rad/s, or text with a unit) are those to be shown, by default round ones over the range; `load`
    and `tuning_speed` default to what the engine says. Raises InputError.

    >>> found = balance(Engine.load("vaz-11113"))
    >>> [round(float(one.first_order[found.tuning_index]), 1) for one in found.residuals]
    [149.5, 123.4, 55.1, 55.1, 0.0, 0.0]
    """
    operation = engine.operation
    tuning = (
        engine.tuning_speed if tuning_speed is None else float(to_si(tuning_speed, "rad/s", "tuning_speed"))
    )
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
        for design in DESIGNS:
            places = np.array([design.place(engine, float(w), tuning, given) for w in every])
            moments = nothing.copy()
            moments[:, 1] = [moment_harmonic(complex(one), -force, forward=False) for one in places]
            shafts, about = two_shafts(engine, complex(places[0])), (design.name, design.about)
            residuals.append(_residual(engine, about, every, given, shafts, moments, places))
    return Balance(engine, given, tuning, every, asked, tuple(residuals))


def _round_speeds(low: float, high: float) -> Vector:
    """The ends of the range and the round speeds between: at most a dozen.

    >>> (_round_speeds(850 * RPM, 3600 * RPM) / RPM).round(6).tolist()
    [850.0, 1000.0, 1500.0, 2000.0, 2500.0, 3000.0, 3500.0, 3600.0]
    """
    steps = (100.0, 250.0, 500.0, 1000.0, 2500.0, 5000.0)
    step = next((one for one in steps if (high - low) / RPM / one < 10.0), 1e4)
    inside = step * np.arange(np.ceil(low / RPM / step), high / RPM / step + 1.0)
    inside = inside[(inside > low / RPM * 1.02) & (inside < high / RPM * 0.98)]
    return np.concatenate([[low], inside * RPM, [high]])


def _residual(
    engine: Engine,
    about: tuple[str, str],
    speeds: Vector,
    load: float,
    shafts: Sequence[BalancerShaft],
    moments: NDArray[np.complex128],
    places: NDArray[np.complex128] | None = None,
) -> Residual:
    """What is left with the forces of these shafts and with these moments over w^2, a row a speed."""
    w2 = speeds**2
    left = np.array([-engine.torque_harmonics(float(speed), load) for speed in speeds])
    left[:, ::2] += w2[:, None] * moments
    left[:, 0] = 0.0  # the mean goes through the mounts whatever is done
    shaft_force, shaft_couple, _ = engine.shaft_shaking(shafts)
    force = engine.crank_shaking[0] + shaft_force
    couple = engine.crank_shaking[1] + shaft_couple
    angle = np.outer(engine.orders, PHI)
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
        couple=couple.largest[1] * w2,
    )
