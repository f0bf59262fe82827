"""The two-shaft balancer of [B]: both shafts at crank speed against the crank, on an arm from the crank axis.

Counterweights on the crank turn with it; the shafts take the half of the first-order inertia force that turns
against it. Their force acts at the middle between them, at the height h above the crank axis and the offset e
sideways, and so has a moment about it:

    F_b = u w^2,    M_b = u w^2 (h sin(phi) + e cos(phi))      (throws together, u the imbalance of both)

[B] speaks of h alone: with it only the sine of the first-order reaction torque can be balanced.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from softstart.balancing.engine import Engine
from softstart.balancing.parts import BalancerShaft

__all__ = ["DESIGNS", "Design", "arm", "free_force", "two_shafts"]

NOTHING = 1e-9  # of the forces of all cylinders: rounding, not a force


def free_force(engine: Engine) -> complex:
    """First-order inertia force over w^2, in kg m, that turns against the crank: what the shafts balance.

    >>> round(free_force(Engine.load("vaz-11113")).real, 5)
    0.02414
    """
    force = complex(engine.crank_shaking[0].backward[1])
    scale = engine.cylinders.count * engine.masses.reciprocating * engine.cylinders.crank.r
    return force if abs(force) > NOTHING * scale else 0j


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
    phase = math.atan2(force.imag, force.real) % (2.0 * math.pi)
    first, second = (
        BalancerShaft(0.5 * abs(force), -1, phase, place.real, place.imag + side * half) for side in (-1, 1)
    )
    return first, second


@dataclass(frozen=True)
class Design:
    """A way to lay out the balancer; `place(engine, speed, tuning speed, load)` is its arm h + i e in m."""

    name: str
    about: str
    place: Callable[[Engine, float, float, float | None], complex]


def _inertia_only(engine: Engine, speed: float, tuning: float, load: float | None) -> complex:
    return complex(arm(engine, tuning, load, gas=False).real)


def _fixed(engine: Engine, speed: float, tuning: float, load: float | None) -> complex:
    return complex(arm(engine, tuning, load).real)


def _variable(engine: Engine, speed: float, tuning: float, load: float | None) -> complex:
    return complex(arm(engine, speed, load).real)


def _fixed_both(engine: Engine, speed: float, tuning: float, load: float | None) -> complex:
    return arm(engine, tuning, load)


def _variable_both(engine: Engine, speed: float, tuning: float, load: float | None) -> complex:
    return arm(engine, speed, load)


DESIGNS = (
    Design("inertia-only", "h for the inertia torque alone", _inertia_only),
    Design("fixed-h", "h for gas and inertia at the tuning speed [B]", _fixed),
    Design("variable-h", "h(n) for gas and inertia at every speed [B]", _variable),
    Design("fixed-h-e", "h and sideways offset e at the tuning speed", _fixed_both),
    Design("variable-h-e", "h(n) and e(n) at every speed", _variable_both),
)
