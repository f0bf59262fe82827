"""Rigid joints closed: masses that move as one, and the springs between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softstart.chain.arrays import ChainArrays
from softstart.errors import InputError

__all__ = ["Closed", "closed"]

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Closed:
    """The chain with all gaps closed, at the motor shaft: what vibrates linearly.

    `body[k]` is the body to which mass k belongs; `shaft[b]` the shaft that joins body b and b + 1.
    """

    J: Vector
    c: Vector
    body: NDArray[np.intp]
    shaft: NDArray[np.intp]


def closed(arrays: ChainArrays) -> Closed:
    """Join what rigid shafts hold together. A rigid gap counts as closed, like an elastic one.

    >>> from softstart.chain import Chain, Mass, Shaft
    >>> chain = Chain([Mass(1), Mass(2), Mass(3)], [Shaft(gap=0.1, restitution=1), Shaft(5)])
    >>> closed(chain.at_motor_shaft()).J
    array([3., 3.])
    """
    body = np.concatenate([[0], np.cumsum(~arrays.rigid)])
    shaft = np.flatnonzero(~arrays.rigid)
    if shaft.size == 0:
        raise InputError("shaft: every joint of the chain is rigid, so nothing vibrates; give a stiffness.")
    J = np.zeros(shaft.size + 1)
    np.add.at(J, body, arrays.J)
    return Closed(J, arrays.c[shaft], body, shaft)
