"""Engagement laws: how the friction torque MM(t) of a clutch rises, in pieces that are known exactly.

A piece is a polynomial of at most second degree plus one exponential term, so that its Taylor series is known
from any instant on. After the last piece the torque is held. Symbols and the laws' numbers are those of [C].
A law can be read from a CSV file: instants and friction torques, with straight lines between.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.input.columns import Wanted, read_columns
from softstart.input.files import file_text
from softstart.quantities import show

LawKind = Literal["linear", "quadratic-concave", "quadratic-convex", "exponential"]
LAWS: tuple[LawKind, ...] = get_args(LawKind)


@dataclass(frozen=True)
class Piece:
    """M(t) = a + b s + q s^2 + e (exp(s/T) - 1) with s = t - start, from `start` on; N m, s."""

    start: float
    a: float
    b: float = 0.0
    q: float = 0.0
    e: float = 0.0
    T: float = math.inf

    def series(self, t: float, order: int) -> list[float]:
        """Taylor coefficients of M about the instant t, from the zeroth to the `order`-th.

        >>> Piece(0.0, 1.0, b=2.0, q=3.0).series(1.0, 3)
        [6.0, 8.0, 3.0, 0.0]
        """
        s = t - self.start
        coefficients = [0.0] * (order + 1)
        coefficients[0] = self.a + (self.b + self.q * s) * s
        coefficients[1] = self.b + 2.0 * self.q * s
        coefficients[2] = self.q
        if self.e != 0.0:
            coefficients[0] += self.e * math.expm1(s / self.T)
            term = self.e * math.exp(s / self.T)
            for n in range(1, order + 1):
                term /= n * self.T
                coefficients[n] += term
        return coefficients

    def torque(self, t: float) -> float:
        """M(t) in N m."""
        return self.series(t, 2)[0]


@dataclass(frozen=True)
class Law:
    """Friction torque over time: `pieces` in order from t = 0 on, the last of them constant from there on.

    `label` says what it is; `engaged_at` is the instant in s from which the torque is held.
    """

    label: str
    pieces: tuple[Piece, ...]

    @property
    def engaged_at(self) -> float:
        """tM, s."""
        return self.pieces[-1].start

    @property
    def held(self) -> float:
        """The torque that is held at last, N m."""
        return self.pieces[-1].a

    def piece_at(self, t: float) -> tuple[Piece, float]:
        """The piece that acts from the instant t on, and the instant at which it ends (s)."""
        index = sum(piece.start <= t for piece in self.pieces[1:])
        return self.pieces[index], (*(piece.start for piece in self.pieces[1:]), math.inf)[index]

    def torque(self, t: ArrayLike) -> Vector:
        """M at the instants t (s), in N m; at a step, the torque behind it.

        >>> shaped_law("linear", 60.0, 2.0).torque([0.0, 1.0, 5.0]).tolist()
        [0.0, 30.0, 60.0]
        """
        times = np.asarray(t, dtype=np.float64)
        values = [self.piece_at(time)[0].torque(time) for time in times.ravel().tolist()]
        return np.array(values).reshape(times.shape)


def shaped_law(kind: LawKind, MM: float, tM: float, time_constant: float = 1.0) -> Law:
    """One of the laws of [C], up to MM (N m) at tM (s).

    linear            MM t/tM
    quadratic-concave MM (2 t/tM - (t/tM)^2)
    quadratic-convex  MM (t/tM)^2
    exponential       MM (exp(t/T) - 1)/(exp(tM/T) - 1); [C] has T = 1 s. T < 0 gives a law that saturates.

    >>> round(float(shaped_law("exponential", 60.0, 1.0).torque(0.5)), 6)
    22.65244
    """
    pieces = {
        "linear": Piece(0.0, 0.0, b=MM / tM),
        "quadratic-concave": Piece(0.0, 0.0, b=2.0 * MM / tM, q=-MM / tM**2),
        "quadratic-convex": Piece(0.0, 0.0, q=MM / tM**2),
    }
    if kind == "exponential":
        rising = Piece(0.0, 0.0, e=MM / math.expm1(tM / time_constant), T=time_constant)
        label = f"exponential, T = {time_constant:g} s"
    else:
        rising, label = pieces[kind], kind
    return Law(label, (rising, Piece(tM, MM)))


def table_law(times: Sequence[float], torques: Sequence[float], label: str = "table") -> Law:
    """Straight lines between points (s, N m); two points at one instant are a step; the last torque is held.

    >>> law = table_law([0.0, 1.0, 1.0, 2.0], [0.0, 10.0, 20.0, 20.0])
    >>> law.torque([0.5, 1.0, 9.0]).tolist(), law.engaged_at
    ([5.0, 20.0, 20.0], 1.0)
    """
    pieces: list[Piece] = []
    points = list(zip(map(float, times), map(float, torques), strict=True))
    for (t0, m0), (t1, m1) in pairwise(points):
        if t1 > t0:
            pieces.append(Piece(t0, m0, b=(m1 - m0) / (t1 - t0)))
    end, last = points[-1]
    while pieces and pieces[-1].b == 0.0 and pieces[-1].a == last:
        end = pieces.pop().start
    return Law(label, (*pieces, Piece(end, last)))


def read_law(path: str | os.PathLike[str]) -> tuple[list[float], list[float]]:
    """(times in s, torques in N m) of a CSV file with two columns (`softstart.input.columns`).

    A heading may give units, as `t [ms],M [kgf*m]`. Two lines with the same instant are a step. Raises
    InputError for all lines that are wrong.
    """
    wanted = (Wanted(("time", "t"), "s"), Wanted(("torque", "m"), "N*m"))
    text = file_text(path, "a table of the law", "CSV")
    times, torques = read_columns(text, show(os.fspath(path)), wanted).values
    return times.tolist(), torques.tolist()
