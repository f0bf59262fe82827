"""Natural vibration of a chain with its gaps closed, and the two masses that stand for it.

The mass-normalised stiffness of a chain is B'B with B bidiagonal, one row per shaft, and its natural
frequencies are the singular values of B. The entries of a bidiagonal matrix determine them to the last
digits, however many decades they span (J. Demmel, W. Kahan, SIAM J. Sci. Stat. Comput. 11 (1990) 873-912,
doi:10.1137/0911052), and LAPACK keeps those digits (qd algorithm) if the matrix is square, so that nothing
is rotated before: a row of zeros makes it so. An eigensolver for K x = w^2 J x keeps the digits of the
highest frequency only.

A mode shape is two Holzer tables, one from each end, joined at the mass where they fit best (the twisted
factorisation of I. S. Dhillon, B. N. Parlett, Linear Algebra Appl. 387 (2004) 1-28,
doi:10.1016/j.laa.2003.12.028): small amplitudes keep their sign and their digits, and so do the nodes, which
singular vectors lose.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softstart.arrays import Indices, Matrix, Vector
from softstart.drive import Drive
from softstart.drive.checks import elastic_frequency
from softstart.drive.model import BRAKE
from softstart.errors import InputError
from softstart.results import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softstart.chain.arrays import ChainArrays
    from softstart.chain.model import Chain

AT_REST = 1e18  # times the inertia of all others: the motion of a mass at rest is below rounding
FACTOR = 10.0
"""The least (frequency/first natural frequency)^2 of all that two masses leave out; see `reduce_chain`."""


# ---- natural frequencies and mode shapes ------------------------------------------------------------------


class Node(NamedTuple):
    """A place that stays at rest: `share` of the twist of shaft `shaft` lies before it (0 at the mass)."""

    shaft: int
    share: float


@dataclass(frozen=True, eq=False, repr=False)
class Vibration(Result, view="chains.vibration_sheet"):
    """Natural vibration of a chain, in SI at the motor shaft, gaps closed, undamped.

    `Omega[m]` is the frequency of mode m in rad/s; mode 0 is the rigid one, exactly 0, which a chain with a
    mass at rest does not have: `modes` are those that exist. `shape[m]` are the amplitudes of the masses, the
    largest 1. `torque[m]` are the torques of the shafts in N m per rad of that.
    Frequencies are right to 1e-14 of themselves, also where inertias and stiffnesses span 12 decades; shapes
    to about 1e-14 over the relative distance to the next frequency. Modes closer than about 1e-9 are told
    apart in frequency, but their shapes are any two of the same plane.
    """

    chain: Chain
    Omega: Vector
    shape: Matrix
    torque: Matrix

    @property
    def frequency(self) -> Vector:
        """The frequencies in Hz."""
        return self.Omega / (2.0 * math.pi)

    @property
    def modes(self) -> range:
        """The numbers of the modes: from 0, the rigid one, or from 1 where a mass stays at rest."""
        return range(0 if self.chain.at_motor_shaft().held is None else 1, self.Omega.size)

    @cached_property
    def nodes(self) -> tuple[tuple[Node, ...], ...]:
        """The nodes of each mode: mode m has m of them; the twist of a shaft is shared evenly along it.

        >>> from softstart import Chain
        >>> natural_vibration(Chain.load("crane-4-mass")).nodes[1]
        (Node(shaft=2, share=0.699...),)
        """
        return tuple(tuple(_nodes(shape.tolist())) for shape in self.shape)

    def plot(self, modes: int = 3, *, ax: Axes | None = None) -> Any:
        """The lowest elastic shapes with their nodes."""
        return super().plot(ax=ax) if ax is not None else self.figures["shapes"](modes)

    def summary(self) -> dict[str, object]:
        """The frequencies, shapes, torques and nodes as plain data."""
        masses = [mass.name for mass in self.chain.masses]
        modes = [
            {
                "Omega": float(self.Omega[m]),
                "frequency": float(self.frequency[m]),
                "shape": self.shape[m].tolist(),
                "torque": self.torque[m].tolist(),
                "nodes": [
                    {"between": masses[n.shaft : n.shaft + 2], "share": n.share} for n in self.nodes[m]
                ],
            }
            for m in self.modes
        ]
        return {
            "chain": self.chain.name,
            "assumed": self.chain.assumed,
            "masses": masses,
            "modes": modes,
        }


def natural_vibration(chain: Chain) -> Vibration:
    """Frequencies and shapes of the chain with its gaps closed, undamped: J_k w^2 x_k = T_k - T_(k-1).

    Parameters
    ----------
    chain : Chain, str or path
        A chain of N masses, or its name or file; a motor is not needed.

    Returns
    -------
    Vibration
        At the motor shaft: `Omega` in rad/s, one for each mode, and `shape`, a row of N amplitudes for each
        mode. A rigid joint makes one body of its two masses, and one mode less.

    Raises
    ------
    InputError
        If every joint of the chain is rigid, so that nothing vibrates.

    Examples
    --------
    >>> from softstart import Chain
    >>> natural_vibration(Chain.load("crane-4-mass")).Omega.round(1)
    array([   0. ,  114.6,  618.5, 1630.3])

    References
    ----------
    [R]; J. Demmel, W. Kahan, SIAM J. Sci. Stat. Comput. 11 (1990) 873-912, doi:10.1137/0911052: frequencies.
    I. S. Dhillon, B. N. Parlett, Linear Algebra Appl. 387 (2004) 1-28, doi:10.1016/j.laa.2003.12.028: shapes.
    """
    bodies = with_gaps_closed(chain.at_motor_shaft())
    return vibration_at(chain, elastic_frequencies(bodies.J, bodies.c))


def vibration_at(chain: Chain, elastic: Vector) -> Vibration:
    """The shapes and shaft torques of a chain at its elastic frequencies, rad/s.

    >>> from softstart import Chain
    >>> chain = Chain.load("crane-4-mass")
    >>> vibration_at(chain, natural_vibration(chain).Omega[1:]).torque[1].round()
    array([407., 431., 456.])
    """
    arrays = chain.at_motor_shaft()
    bodies = with_gaps_closed(arrays)
    Omega = np.append(0.0, elastic)
    of_bodies = np.vstack([np.ones(bodies.J.size), shapes(bodies.J, bodies.c, elastic)])
    shape = of_bodies[:, bodies.body]
    # the inertia torques summed from the end where they are smaller, not a difference of amplitudes
    inertial = _all_finite(arrays) * Omega[:, None] ** 2 * shape
    left, right = np.cumsum(inertial, axis=1), np.cumsum(inertial[:, ::-1], axis=1)[:, ::-1]
    size = np.abs(inertial)
    nearer = np.cumsum(size, axis=1)[:, :-1] <= np.cumsum(size[:, ::-1], axis=1)[:, -2::-1]
    return Vibration(chain, Omega, shape, np.where(nearer, left[:, :-1], -right[:, 1:]))


def _nodes(shape: list[float]) -> Iterator[Node]:
    for k, (here, there) in enumerate(pairwise(shape)):
        if here == 0.0:
            yield Node(k, 0.0)
        elif here * there < 0.0:
            yield Node(k, here / (here - there))


@dataclass(frozen=True, eq=False)
class Closed:
    """The chain with all gaps closed, at the motor shaft: what vibrates linearly.

    `J` inertias of the bodies, kg m2, `c` stiffnesses between them, N m/rad; `body[k]` is the body to which
    mass k belongs, `shaft[b]` the shaft that joins body b and b + 1.
    """

    J: Vector
    c: Vector
    body: Indices
    shaft: Indices


def with_gaps_closed(arrays: ChainArrays) -> Closed:
    """Join what rigid shafts hold together. A rigid gap counts as closed, like an elastic one.

    >>> from softstart.chain import Chain, Mass, Shaft
    >>> chain = Chain([Mass(1), Mass(2), Mass(3)], [Shaft(gap=0.1, restitution=1), Shaft(5)])
    >>> with_gaps_closed(chain.at_motor_shaft()).J
    array([3., 3.])
    """
    body = np.append(0, np.cumsum(~arrays.rigid))
    shaft = np.flatnonzero(~arrays.rigid)
    if shaft.size == 0:
        raise InputError("shaft: every joint of the chain is rigid, so nothing vibrates; give a stiffness.")
    return Closed(_summed(_all_finite(arrays), body), arrays.c[shaft], body, shaft)


def _summed(J: Vector, body: Indices) -> Vector:
    total = np.zeros(body[-1] + 1)
    np.add.at(total, body, J)
    return total


def _all_finite(arrays: ChainArrays) -> Vector:
    return np.where(np.isinf(arrays.J), AT_REST * arrays.moving_J.sum(), arrays.J)


def elastic_frequencies(J: Vector, c: Vector) -> Vector:
    """The elastic frequencies in rad/s, ascending: the singular values of B, 0 left out.

    B[k, k] = sqrt(c_k/J_k), B[k, k+1] = -sqrt(c_k/J_(k+1)), for n inertias `J` in kg m2 and the n - 1
    stiffnesses `c` between them in N m/rad.

    >>> elastic_frequencies(np.array([0.035, 0.175]), np.array([368.465])).round(6)
    array([112.397])
    """
    B, k = np.zeros((J.size, J.size)), np.arange(c.size)
    B[k, k], B[k, k + 1] = np.sqrt(c / J[:-1]), -np.sqrt(c / J[1:])
    return np.asarray(np.linalg.svd(B, compute_uv=False)[-2::-1], np.float64)


def shapes(J: Vector, c: Vector, Omega: Vector) -> Matrix:
    """The shapes at the elastic frequencies `Omega`, one row each: amplitudes of the masses, largest one 1.

    >>> J, c = np.array([1.0, 3.0]), np.array([3.0])
    >>> shapes(J, c, elastic_frequencies(J, c)).round(12)
    array([[ 1.        , -0.33333333]])
    """
    amplitudes = np.ones((Omega.size, J.size))
    forth, back = (J.tolist(), c.tolist()), (J[::-1].tolist(), c[::-1].tolist())
    for x, square in zip(amplitudes, (Omega * Omega).tolist(), strict=True):  # x: a view of the row
        before, rise = _holzer(*forth, square)
        behind, fall = _holzer(*back, square)
        meet = int(np.nanargmin(np.abs(square * J + np.array(before) + np.array(behind[::-1])) / J))
        for k in range(meet, 0, -1):
            x[k - 1] = x[k] / rise[k]
        for k in range(meet + 1, J.size):
            x[k] = x[k - 1] / fall[-k]
    largest = np.argmax(np.abs(amplitudes), axis=1)[:, None]
    scaled: Matrix = amplitudes / np.take_along_axis(amplitudes, largest, axis=1)
    return scaled


def _holzer(J: list[float], c: list[float], square: float) -> tuple[list[float], list[float]]:
    """A Holzer table from the first mass: the torque before each mass, N m per rad of its amplitude, and its
    amplitude over that of the mass before.
    """
    torques, ratios = [0.0], [1.0]
    for inertia, stiffness in zip(J[:-1], c, strict=True):
        through = torques[-1] + square * inertia
        ratios.append(1.0 - through / stiffness or 1e-30)
        torques.append(through / ratios[-1])
    return torques, ratios


# ---- two masses -------------------------------------------------------------------------------------------


class TwoMassFigures(NamedTuple):
    """What two masses should have in common with the chain; all at the motor shaft.

    `Omega` first elastic frequency, rad/s; `node` the share of the twist between motor and load that lies
    before the node of its shape; `participation` of the motor in it, `J shape_motor^2/sum(J_k shape_k^2)`,
    J the whole inertia (J2/J1 for two masses); `stiffness` between motor and load, N m/rad; `inertia` the
    whole, kg m2; `gap` the whole, rad.
    """

    Omega: float
    node: float
    participation: float
    stiffness: float
    inertia: float
    gap: float


@dataclass(frozen=True, eq=False, repr=False)
class Reduction(Result, view="chains.reduction_sheet"):
    """A chain reduced to two masses at the motor shaft, which have its frequency, node, inertia and gap.

    `J1` at the motor and `J2` at the load, kg m2, `c` N m/rad, `d` N m s/rad, `gap` rad. `vibration` is the
    natural vibration of the `chain`. `whole` and `reduced` are the figures of both; what they differ in is
    the error: how strongly the motor takes part in the mode, and the stiffness. Where a mass stays at rest,
    two masses have the frequency of the chain without it. `least_ratio` is the least squared frequency, over
    that of the two masses, of what is left out; `forced` says that it is below `factor`. `notes` say what a
    reader must know.
    """

    chain: Chain
    vibration: Vibration
    J1: float
    J2: float
    c: float
    d: float
    gap: float
    whole: TwoMassFigures
    reduced: TwoMassFigures
    factor: float
    least_ratio: float
    notes: tuple[str, ...]

    @property
    def forced(self) -> bool:
        """Whether more than the first mode matters."""
        return self.least_ratio < self.factor

    def to_drive(self) -> Drive:
        """The two-mass drive, for `compare`, `optimize` and `tune`.

        All load torques and frictions act on its load; where the motor alone could not move them, less what
        load curves that drive the chain carry at standstill; damping to the ground and the efficiencies of
        gears are left out, but the ratio from motor to load is kept: output torques are without losses, the
        safe side. It starts where the chain does, in mid-gap if the chain does not say otherwise.

        >>> from softstart import Chain
        >>> drive = reduce_chain(Chain.load("crane-4-mass")).to_drive()
        >>> round(drive.J1, 4), round(drive.J2, 4), round(drive.c, 1), drive.gap
        (0.0351, 0.1749, 383.8, 0.5)
        """
        chain, arrays = self.chain, self.chain.freed.at_motor_shaft()
        if chain.motor is None:
            raise InputError("[motor] is missing: a drive needs its starting torque; add it to the chain.")
        if chain.target_speed is None:
            raise InputError("[start] target_speed is missing: a drive needs it; add it to the chain.")
        active, friction = float(arrays.active.sum()), float(arrays.friction.sum())
        if chain.motor.starting_torque <= (load := active + friction):  # curves carry it, or nothing does
            left = min(max(1.0 + chain.curve_torque / load, 0.0), 1.0)
            active, friction = left * active, left * friction
        twist = float(arrays.theta0.sum()) * (1.0 if arrays.motor < arrays.load else -1.0)
        speed = float(arrays.J @ arrays.w0) / self.whole.inertia
        law = chain.freed.shafts[0].contact_law
        ratio = 1.0 / float(arrays.speed_ratio[arrays.load])  # turns of the motor for one of the load
        return Drive(
            **chain.motor.keywords(),
            name=f"{chain.name}, reduced to two masses",
            source=f"reduced from a chain of {len(chain.masses)} masses: {chain.source}",
            assumed=chain.assumed,
            units=chain.units,
            gear_ratio=ratio if abs(ratio - 1.0) > 1e-12 else None,
            motor_inertia=self.J1,
            load_inertia=self.J2,
            load_torque=active or friction,
            load_kind="active" if active or not friction else "reactive",
            load_friction=friction if active else 0.0,
            stiffness=self.c,
            damping=self.d,
            gap=self.gap,
            contact_law=law,
            start_position="unknown" if len(chain.positions) > 1 else twist or "mid-gap",
            target_speed=chain.target_speed,
            initial_motor_speed=speed,
            initial_load_speed=speed,
            **({name: getattr(chain, name) for name in BRAKE} if chain.brake == "motor" else {}),
        )

    def summary(self) -> dict[str, object]:
        """The figures of both, the ratio and the notes as plain data."""
        whole, reduced = self.whole.Omega, self.reduced.Omega
        return {
            "chain": self.chain.name,
            "assumed": self.chain.assumed,
            "masses": [self.chain.masses[self.chain.motor_index].name, self.chain.load_mass],
            "factor": self.factor,
            "least_ratio": self.least_ratio,
            "forced": self.forced,
            "frequencies": [{"whole": whole, "reduced": reduced, "error": reduced / whole - 1.0}],
            "whole": self.whole._asdict(),
            "reduced": self.reduced._asdict(),
            "notes": list(self.notes),
        }


def reduce_chain(chain: Chain, *, factor: float = FACTOR, force: bool = False) -> Reduction:
    """Reduce a chain to the two masses that have its first natural frequency and its node.

    With the shape x of the first elastic mode, at the motor x1 and at the load x2, and the whole inertia J:

        J1 + J2 = J,   J1 x1 + J2 x2 = 0,   c = Omega^2 J1 J2/J

    The damping gives the mode the damping of the chain: `d (x1 - x2)^2/(J1 x1^2 + J2 x2^2)` equals
    `sum(d_k (x_k - x_(k+1))^2)/sum(J_k x_k^2)`. Gaps add up, torques too.

    Two masses stand for the chain only as long as nothing else vibrates: the second mode, and with open gaps
    the pieces between them, must lie far above the first mode. How much K_dyn is off, because light masses
    between gaps have impacts of their own, only starts can tell: `two_mass_error`. A chain with a mass at
    rest vibrates below the first frequency of the chain without it: it has no two masses unless by `force`.

    Parameters
    ----------
    chain : Chain, str or path
        The whole chain, or its name or file; a motor is needed by `Reduction.to_drive` only.
    factor : float
        Smallest allowed (w/Omega)^2, 1 or more: w is the frequency of the second mode, or of a piece between
        two gaps; Omega that of the first mode.
    force : bool
        Whether to reduce also where that condition fails.

    Returns
    -------
    Reduction
        The two masses at the motor shaft, and what they differ in from the chain; `to_drive` makes a `Drive`.

    Raises
    ------
    InputError
        If the condition of `factor` fails, unless `force`; if the node does not lie between motor and load,
        so that no two masses there have it; for bad input.

    Examples
    --------
    >>> from softstart import Chain
    >>> reduction = reduce_chain(Chain.load("crane-4-mass"))
    >>> round(reduction.reduced.Omega, 2), round(reduction.least_ratio, 1)
    (114.64, 29.1)
    >>> round(reduction.reduced.participation / reduction.whole.participation - 1.0, 3)
    -0.039

    References
    ----------
    [R].
    """
    arrays, load = chain.at_motor_shaft(), chain.load_mass
    wrong = []
    if not factor >= 1.0:
        wrong.append(f"factor = {factor!r}: it says how far above the first frequency; write 1 or more.")
    if arrays.motor == arrays.load:
        wrong.append(f"load = {load!r}: motor and load are the same mass; name another one.")
    if wrong:
        raise InputError(wrong)
    vibration, free = natural_vibration(chain), chain.freed
    of_free = vibration if free is chain else natural_vibration(free)
    arrays = free.at_motor_shaft()
    Omega, x = float(of_free.Omega[1]), of_free.shape[1]
    x1, x2 = float(x[arrays.motor]), float(x[arrays.load])
    if not x1 * x2 < 0.0:
        raise InputError(
            f"load = {load!r}: the node of the first elastic mode ({Omega:.6g} rad/s) does not lie between "
            f"the motor ({free.masses[arrays.motor].name}) and the load, so no two masses there vibrate as "
            "the chain does; use the chain itself, or name another load."
        )
    refused, ratios = [], []
    for what, w in _left_out(of_free, vibration):
        ratios.append((w / Omega) ** 2)
        if ratios[-1] < factor:
            refused.append(
                f"two masses: {what} vibrates at {w:.6g} rad/s, and ({w:.6g}/{Omega:.6g})^2 = "
                f"{ratios[-1]:.3g} is below the {factor:g} from which the first mode ({Omega:.6g} rad/s) "
                "stands for all; use the chain itself, or go on with --force."
            )
    if refused and not force:
        raise InputError(refused)
    J, modal = float(arrays.J.sum()), float(arrays.J @ x**2)
    J1, J2 = J * x2 / (x2 - x1), J * x1 / (x1 - x2)
    c = Omega**2 * J1 * J2 / J
    d = float(arrays.d @ (x[:-1] - x[1:]) ** 2) / modal * (J1 * x1**2 + J2 * x2**2) / (x1 - x2) ** 2
    gap = float(arrays.gap.sum())
    reduced = TwoMassFigures(elastic_frequency(J1, J2, c), J2 / (J1 + J2), J2 / J1, c, J1 + J2, gap)
    least, notes = min(ratios, default=math.inf), tuple(_notes(chain))
    return Reduction(chain, vibration, J1, J2, c, d, gap, _figures(vibration), reduced, factor, least, notes)


def _figures(vibration: Vibration) -> TwoMassFigures:
    """Those of the chain itself. With a mass at rest its first mode has no node between motor and load."""
    arrays, x = vibration.chain.at_motor_shaft(), vibration.shape[1]
    x1, x2, J = float(x[arrays.motor]), float(x[arrays.load]), arrays.moving_J
    whole = float(J.sum())
    return TwoMassFigures(
        Omega=float(vibration.Omega[1]),
        node=x1 / (x1 - x2) if arrays.held is None else math.nan,
        participation=whole * x1**2 / float(J @ x**2),
        stiffness=float(1.0 / np.sum(1.0 / arrays.c[list(arrays.path)])),
        inertia=whole,
        gap=float(arrays.gap.sum()),
    )


def _left_out(vibration: Vibration, whole: Vibration) -> Iterator[tuple[str, float]]:
    """What two masses leave out, with its frequency in rad/s: a mass at rest, the second mode, and of each
    piece between two gaps, which vibrates by itself while they are open, the first elastic one.

    `vibration` is that of the chain without the mass at rest, `whole` with it.
    """
    chain = vibration.chain
    if (held := whole.chain.at_motor_shaft().held) is not None:
        yield f"the chain held at rest by {whole.chain.masses[held].name}", float(whole.Omega[1])
    if vibration.Omega.size > 2:
        yield "the second mode", float(vibration.Omega[2])
    arrays, names = chain.at_motor_shaft(), [mass.name for mass in chain.masses]
    gaps = np.flatnonzero(arrays.gap > 0.0) + 1
    bodies = with_gaps_closed(arrays)
    for first, last in pairwise([0, *gaps.tolist(), len(names)] if gaps.size else []):
        inner = (bodies.shaft >= first) & (bodies.shaft < last - 1)
        if inner.any():
            group = bodies.body[first:last]
            J = _summed(arrays.J[first:last], group - group[0])
            at = float(elastic_frequencies(J, bodies.c[inner])[0])
            yield f"with open gaps the piece {' - '.join(names[first:last])}", at


def _notes(chain: Chain) -> Iterator[str]:
    """What the two masses leave out."""
    if (held := chain.at_motor_shaft().held) is not None:
        yield (
            f"{chain.masses[held].name} stays at rest: the two masses leave it out, with its shaft, and turn "
            "freely where the chain is held; frequencies and starts of the chain have both"
        )
    if curved := [mass.name for mass in chain.masses if mass.curve is not None]:
        yield f"the load curves of {', '.join(curved)} are left out of the drive; the chain has them"
    torques = [mass for mass in chain.masses if mass.torque]
    if len({mass.kind for mass in torques}) > 1:
        kinds = ", ".join(f"{mass.name} {mass.kind}" for mass in torques)
        yield f"load torques of both kinds ({kinds}): they count as the larger kind"
    if any(mass.damping for mass in chain.masses):
        yield "the damping to the ground is left out of the drive, which has none"
    if (efficiency := math.prod(shaft.efficiency for shaft in chain.shafts)) < 1.0:
        yield (
            f"the efficiencies of the gears (together {efficiency:.4g}) are left out of the drive, which "
            "starts as if nothing were lost; the chain is started with them"
        )
    if any(shaft.rigid and shaft.gap > 0.0 for shaft in chain.shafts):
        yield "rigid gaps are counted with the springs beside them: their impacts are not kept"
    if len({shaft.contact_law for shaft in chain.shafts}) > 1:
        yield "the shafts have different contact laws; the drive has that of the first shaft"
