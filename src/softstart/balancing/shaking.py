"""Inertia forces on the housing, by order: two vectors for each, one turning with the crank, one against it.

A force across the crank is a complex number: upwards + i sideways, sideways to where the crank turns on top.
So the crank pin of a throw at angle phi is r exp(i phi), and a moment about the crank axis, positive with the
crank, is Im(conj(place) force). Everything is over w^2, in kg m: at constant speed all forces grow with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.balancing.parts import BalancerShaft, Counterweights, Cylinders, Masses
from softstart.balancing.slider_crank import Vector, acceleration_harmonics

__all__ = ["Shaking", "shaking_of_crank", "shaking_of_shafts"]

Complex = NDArray[np.complex128]
ROUNDING = 1e-13  # of the sum of the sizes


@dataclass(frozen=True, eq=False)
class Shaking:
    """Forces sum_q forward_q exp(i q phi) + backward_q exp(-i q phi), q = 0, 1 .. the last index.

    Forces are in kg m; each times its place along the crank, they are couples in kg m^2.
    """

    forward: Complex
    backward: Complex

    def __add__(self, other: Shaking) -> Shaking:
        return Shaking(self.forward + other.forward, self.backward + other.backward)

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
    """The sums over the cylinders, 0 where they cancel but for rounding."""
    return np.where(np.abs(sums) < ROUNDING * scale, 0.0, sums)


def shaking_of_shafts(shafts: Sequence[BalancerShaft], highest: int) -> tuple[Shaking, Shaking, Complex]:
    """Forces and couples of balancer shafts, and the moment M_q about the crank, Re sum M_q exp(i q phi).

    >>> shaft = BalancerShaft(0.02, -1, phase="180 deg", height=0.03)
    >>> force, couple, moment = shaking_of_shafts([shaft], 2)
    >>> complex(force.backward[1].round(6)), complex(moment[1].round(9))
    ((-0.02+0j), -0.0006j)
    """
    vectors = np.zeros((2, 2, highest + 1), dtype=np.complex128)
    moment = np.zeros(highest + 1, dtype=np.complex128)
    for shaft in shafts:
        q = int(abs(shaft.ratio))
        force = shaft.imbalance * shaft.ratio**2 * np.exp(1j * shaft.phase)
        side = 0 if shaft.ratio > 0 else 1
        vectors[0, side, q] += force
        vectors[1, side, q] += shaft.along * force
        moment[q] += moment_harmonic(shaft.place, force, forward=shaft.ratio > 0)
    return Shaking(*vectors[0]), Shaking(*vectors[1]), moment


def moment_harmonic(place: complex, force: complex, *, forward: bool) -> complex:
    """M in Re(M exp(i q phi)) = Im(conj(place) force exp(+-i q phi)), the moment of a turning force.

    >>> moment_harmonic(0.03, -0.02, forward=False)  # 0.0006 sin(phi)
    -0.0006j
    """
    arm = place.conjugate() * force
    return -1j * arm if forward else (-1j * arm).conjugate()
