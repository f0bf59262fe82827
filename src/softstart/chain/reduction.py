"""Reduction of a chain to few masses that keep its low frequencies [R], with the error of every step."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from softstart.arrays import Vector, plain_fields
from softstart.chain.elements import Mass, Shaft
from softstart.chain.merging import Working
from softstart.chain.model import Chain
from softstart.chain.vibration import (
    Vibration,
    closed,
    elastic_frequencies,
    natural_vibration,
    squared_frequencies,
)
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late

if TYPE_CHECKING:
    from matplotlib.figure import Figure

views = late("softstart.views.chains")

Method = Literal["lever", "modal"]


@dataclass(frozen=True)
class Step:
    """One step: which partial system went, and what the kept frequencies have become.

    `kind` is "joint" (rigid, exact), "mass" (shared between its neighbours), "pair" (made one mass) or
    "modal". `Omega` is the partial frequency, `ratio` its square over that of the highest wanted frequency.
    `errors` are shares of the frequencies of the whole chain, after this step and all before it; `bounds`
    say how large they can be.
    """

    kind: Literal["joint", "mass", "pair", "modal"]
    masses: tuple[str, ...]
    Omega: float
    ratio: float
    masses_left: int
    errors: tuple[float, ...]
    bounds: tuple[float, ...]


class Frequency(NamedTuple):
    """A kept frequency in rad/s: of the whole chain, of the reduced one, and the error as a share."""

    whole: float
    reduced: float
    error: float
    bound: float


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


@dataclass(frozen=True)
class Reduction:
    """A chain reduced: `reduced` lies at the motor shaft and has the gaps of all merged sections.

    `wanted` is the highest frequency to keep, rad/s; `factor` what the condition asks for; `least_ratio` the
    least of all `ratio`s, `forced` whether it is below the factor. `notes` say what a reader must know.
    """

    chain: Chain
    reduced: Chain
    method: Method
    wanted: float
    factor: float
    least_ratio: float
    forced: bool
    steps: tuple[Step, ...]
    frequencies: tuple[Frequency, ...]
    notes: tuple[str, ...]

    @cached_property
    def whole_vibration(self) -> Vibration:
        """The natural vibration of the whole chain."""
        return natural_vibration(self.chain)

    @property
    def figures(self) -> tuple[TwoMassFigures, TwoMassFigures]:
        """Of the whole chain and of the reduced one; see `TwoMassFigures`."""
        return two_mass_figures(self.chain), two_mass_figures(self.reduced)

    def to_drive(self) -> Drive:
        """The two-mass drive, for `compare`, `optimize` and `tune`.

        All load torques act on its load, under the kind of the larger part; damping to the ground and the
        efficiencies of gears, which a drive does not have, are left out. It starts where the chain does, in
        mid-gap if the chain does not say otherwise.

        >>> from softstart.chain import reduce_chain
        >>> drive = reduce_chain(Chain.load("crane-4-mass"), to=2).to_drive()
        >>> round(drive.J1, 4), round(drive.J2, 4), round(drive.c, 1), drive.gap
        (0.035, 0.175, 368.3, 0.5)
        """
        chain = self.reduced
        if len(chain.masses) != 2:
            raise InputError(f"to = {len(chain.masses)}: a drive has two masses; reduce the chain to 2.")
        if chain.motor is None:
            raise InputError("[motor] is missing: a drive needs its starting torque; add it to the chain.")
        if chain.target_speed is None:
            raise InputError("[start] target_speed is missing: a drive needs it; add it to the chain.")
        motor, load = chain.masses[chain.motor_index], chain.masses[chain.load_index]
        sign = 1.0 if chain.motor_index == 0 else -1.0
        shaft = chain.shafts[0]
        bigger = max((motor, load), key=lambda mass: abs(mass.torque))
        unknown = len(self.chain.positions) > 1
        return Drive(
            **chain.motor.keywords(),
            name=f"{self.chain.name}, reduced to two masses ({self.method})",
            source=f"reduced from a chain of {len(self.chain.masses)} masses: {self.chain.source}",
            assumed=self.chain.assumed,
            units=self.chain.units,
            motor_inertia=motor.inertia,
            load_inertia=load.inertia,
            load_torque=motor.torque + load.torque,
            load_kind=bigger.kind,
            stiffness=shaft.stiffness,
            damping=shaft.damping,
            gap=shaft.gap,
            contact_law=shaft.contact_law,
            start_position="unknown" if unknown else sign * (shaft.start_position or 0.0) or "mid-gap",
            target_speed=chain.target_speed,
            initial_motor_speed=motor.initial_speed,
            initial_load_speed=load.initial_speed,
        )

    def plot(self) -> Figure:
        """What each step does to the kept frequencies, with the bounds."""
        figure: Figure = views.reduction_figure(self)
        return figure

    def summary(self) -> dict[str, Any]:
        """The same as plain data."""
        before, after = self.figures
        return {
            "chain": self.chain.name,
            "assumed": self.chain.assumed,
            "method": self.method,
            "masses": [mass.name for mass in self.reduced.masses],
            "wanted": self.wanted,
            "factor": self.factor,
            "least_ratio": self.least_ratio,
            "forced": self.forced,
            "steps": [plain_fields(step) for step in self.steps],
            "frequencies": [frequency._asdict() for frequency in self.frequencies],
            "whole": before._asdict(),
            "reduced": after._asdict(),
            "notes": list(self.notes),
        }


def two_mass_figures(chain: Chain) -> TwoMassFigures:
    """The figures of a chain, or of the two masses that stand for it.

    >>> two_mass_figures(Chain.from_drive(Drive.load("crane-4amtkf"))).participation.__round__(12)
    5.0
    """
    vibration = natural_vibration(chain)
    arrays = chain.at_motor_shaft()
    shape = vibration.shape[1]
    at_motor, at_load = float(shape[arrays.motor]), float(shape[arrays.load])
    between = slice(min(arrays.motor, arrays.load), max(arrays.motor, arrays.load))
    with np.errstate(divide="ignore"):
        node = float(np.divide(at_motor, at_motor - at_load))
    return TwoMassFigures(
        Omega=float(vibration.Omega[1]),
        node=node,
        participation=float(arrays.J.sum() * at_motor**2 / (arrays.J @ shape**2)),
        stiffness=float(1.0 / np.sum(1.0 / arrays.c[between])),
        inertia=float(arrays.J.sum()),
        gap=float(arrays.gap.sum()),
    )


FACTOR = 10.0
"""How far: `w_partial^2 >= FACTOR w^2`. One step then moves `w` by 5.4 % at most (see `error_bound`)."""


def error_bound(Omega: Vector, inverse_squares: float) -> Vector:
    """How far, as a share, frequencies `Omega` can be moved by steps with this sum of `1/w_partial^2`.

    Every step keeps `1/w_i^2`, of every frequency, within `1/w_partial^2`: squared periods move by at most
    the squared period of the partial system. Proof for a shared mass I with springs c1, c2 and S = c1 + c2,
    w' being the frequency afterwards. (1) Put the mass where its springs hold it, at rest: its kinetic energy
    is less than that of its shares by I (c1 c2/S^2) (x1 - x2)^2, which is the strain energy over
    w_partial^2; hence w^2 <= w'^2/(1 - w'^2/w_partial^2). (2) Leave it out of the true shape: with p
    where the springs would hold it, the strain energy is at most w^2 (kinetic energy + I p^2
    w^2/(w_partial^2 - w^2)); hence w'^2 <= w^2/(1 - w^2/w_partial^2). Both hold for each
    frequency by the min-max principle. A pair is the same seen from the torques, where compliances are the
    masses.

    >>> error_bound(np.array([1.0]), 0.1).round(3)
    array([0.054])
    """
    moved = Omega * Omega * inverse_squares
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(moved < 1.0, 1.0 / np.sqrt(1.0 - moved) - 1.0, math.inf)


def pieces(chain: Chain) -> list[tuple[tuple[str, ...], float]]:
    """The pieces between the gaps, with their lowest elastic frequency in rad/s; single masses are left out.

    >>> pieces(Chain.load("crane-4-mass"))
    []
    """
    arrays = chain.at_motor_shaft()
    if not arrays.gap.any():
        return []
    names = [mass.name for mass in chain.masses]
    cuts: list[int] = [0, *(np.flatnonzero(arrays.gap > 0.0) + 1).tolist(), len(names)]
    body = closed(arrays)
    found = []
    for first, last in pairwise(cuts):
        group = body.body[first:last]
        inner = body.shaft[(body.shaft >= first) & (body.shaft < last - 1)]
        if inner.size:
            J = np.zeros(inner.size + 1)
            np.add.at(J, group - group[0], arrays.J[first:last])
            found.append((tuple(names[first:last]), float(elastic_frequencies(J, arrays.c[inner])[0])))
    return found


def modal(chain: Chain) -> tuple[Chain, list[Step]]:
    """The two masses, and the one step that leads there.

    With the shape x of the first elastic mode, at the motor x1 and at the load x2, and the whole inertia J:

        J1 + J2 = J,   J1 x1 + J2 x2 = 0,   c = Omega^2 J1 J2/J

    so that frequency, whole inertia and the ratio of the amplitudes, that is the node, are those of the
    chain. The damping gives the mode the damping of the chain: `d (x1 - x2)^2/(J1 x1^2 + J2 x2^2)` equals
    `sum(d_k (x_k - x_(k+1))^2)/sum(J_k x_k^2)`. Gaps add up, torques too.

    >>> modal(Chain.load("crane-4-mass"))[0].masses[0].inertia.__round__(5)
    0.03505
    """
    vibration = natural_vibration(chain)
    arrays = chain.at_motor_shaft()
    x = vibration.shape[1]
    x1, x2 = float(x[arrays.motor]), float(x[arrays.load])
    if not x1 * x2 < 0.0:
        raise InputError(
            f"method = 'modal': the node of the first elastic mode ({vibration.Omega[1]:.6g} rad/s) does not "
            f"lie between the motor ({chain.masses[arrays.motor].name}) and the load ({chain.load_mass}), so "
            "no two masses there have it; take method lever, or name another load."
        )
    J = float(arrays.J.sum())
    J1, J2 = J * x2 / (x2 - x1), J * x1 / (x1 - x2)
    Omega = float(vibration.Omega[1])
    twist = x[:-1] - x[1:]
    d = float(arrays.d @ twist**2 / (arrays.J @ x**2)) * (J1 * x1**2 + J2 * x2**2) / (x1 - x2) ** 2
    first, last = chain.masses[arrays.motor], chain.masses[arrays.load]
    torques = {kind: float(arrays.Mc[arrays.reactive == (kind == "reactive")].sum()) for kind in _KINDS}
    ground = float(arrays.d_ground @ x**2 / (arrays.J @ x**2))  # of the mode; shared out by inertia
    speed = float(arrays.J @ arrays.w0) / J
    rotor = Mass(J1, name=first.name, damping=ground * J1, initial_speed=speed)
    load = Mass(
        J2,
        name=last.name,
        damping=ground * J2,
        torque=sum(torques.values()),
        kind="reactive" if abs(torques["reactive"]) > abs(torques["active"]) else "active",
        initial_speed=speed,
    )
    way = 1.0 if arrays.motor < arrays.load else -1.0
    shaft = Shaft(
        Omega**2 * J1 * J2 / J,
        damping=d,
        gap=float(arrays.gap.sum()),
        contact_law=chain.shafts[0].contact_law,
        efficiency=math.prod(shaft.efficiency for shaft in chain.shafts),
        start_position=way * float(arrays.theta0.sum()) or None,
    )
    motor = None if chain.motor is None else replace(chain.motor, mass=first.name)
    reduced = replace(chain, masses=(rotor, load), shafts=(shaft,), motor=motor, load_mass=last.name)
    second = float(vibration.Omega[2]) if vibration.Omega.size > 2 else math.inf
    error = float(np.sqrt(shaft.stiffness / J1 + shaft.stiffness / J2)) / Omega - 1.0
    names = tuple(mass.name for mass in chain.masses)
    return reduced, [Step("modal", names, second, (second / Omega) ** 2, 2, (error,), (0.0,))]


_KINDS = ("active", "reactive")


def reduce_chain(
    chain: Chain,
    to: int | None = None,
    *,
    up_to: float | None = None,
    method: Method = "lever",
    factor: float = FACTOR,
    force: bool = False,
) -> Reduction:
    """Reduce a chain to `to` masses, or to as few as keep its frequencies up to `up_to`.

    Kept are the `to - 1` lowest elastic frequencies, or those up to `up_to`. The motor's and the load's mass
    are never shared or put together.

    Parameters
    ----------
    chain : Chain
        The whole chain.
    to : int, optional
        Number of masses to reduce to, 2 or more. By default 2, or with `up_to` and "lever" as few as keep
        those frequencies.
    up_to : float, optional
        Highest frequency to keep, rad/s.
    method : {"lever", "modal"}
        "lever" merges the partial system of the highest frequency, again and again [R]; "modal" gives the
        two masses that have the first frequency and the node of the chain exactly.
    factor : float
        Smallest allowed (Omega/wanted)^2, 1 or more: Omega is the frequency of a partial system that is
        merged, or of a piece between two gaps; wanted is the highest frequency to keep.
    force : bool
        Whether to reduce also where that condition fails.

    Returns
    -------
    Reduction
        The reduced chain at the motor shaft, its steps, and each kept frequency (rad/s) with its error and
        the bound on that; `to_drive` makes a `Drive` of two masses.

    Raises
    ------
    InputError
        For bad input, and where the condition of `factor` fails, unless `force`.

    Examples
    --------
    >>> reduction = reduce_chain(Chain.load("crane-4-mass"), to=2)
    >>> [(step.kind, step.masses, round(step.ratio)) for step in reduction.steps]
    [('mass', ('pinion',), 190), ('mass', ('wheel shaft',), 26)]
    >>> round(reduction.frequencies[0].error, 4)
    -0.0195

    References
    ----------
    [R]; the lever rule with its proved error, and the modal reduction: docs/theory/reduction.md.
    """
    given, chain = chain, chain.freed
    to = _checked(chain, to, up_to, method, factor)
    whole = natural_vibration(chain).Omega[1:]
    if up_to is None:
        kept = min((to or 2) - 1, whole.size)
    else:
        kept = int(np.count_nonzero(whole <= up_to))
        if kept == 0:
            raise InputError(
                f"up_to = {up_to!r}: the lowest elastic frequency is {whole[0]:.6g} rad/s; ask for more."
            )
        if to is not None and kept > to - 1:
            raise InputError(
                f"up_to = {up_to!r}: {kept} elastic frequencies are not above it, which takes more than {to} "
                "masses; raise to or lower up_to."
            )
    wanted = whole[:kept]
    if method == "modal":
        reduced, steps = modal(chain)
    else:
        reduced, steps = _lever(chain, to, wanted, factor)
    two = len(reduced.masses) == 2 < len(chain.masses)
    ratios = [step.ratio for step in steps]
    ratios += [(Omega / wanted[-1]) ** 2 for _, Omega in pieces(chain)] if two else []
    refusals = [] if force else list(_refusals(chain, steps, two, wanted, factor))
    if refusals:
        raise InputError(refusals)
    after = natural_vibration(reduced).Omega[1:]
    bounds = steps[-1].bounds if steps else (0.0,) * kept
    frequencies = tuple(
        Frequency(float(w), float(v), float(v / w - 1.0), b)
        for w, v, b in zip(wanted, after, bounds, strict=False)
    )
    least = min(ratios, default=math.inf)
    return Reduction(
        chain,
        reduced,
        method,
        float(wanted[-1]),
        factor,
        least,
        least < factor,
        tuple(steps),
        frequencies,
        tuple(_notes(given, reduced)),
    )


def _checked(chain: Chain, to: int | None, up_to: float | None, method: str, factor: float) -> int | None:
    """The number of masses to reduce to; raises `InputError` for everything that cannot be asked."""
    wrong = []
    n = len(chain.masses)
    if method not in ("lever", "modal"):
        wrong.append(f"method = {method!r}: the method is 'lever' or 'modal'.")
    if to is not None and not 2 <= to <= n:
        wrong.append(f"to = {to}: the chain has {n} masses; write a number from 2 to {n}.")
    if method == "modal" and to not in (None, 2):
        wrong.append(f"to = {to}: the modal method gives two masses; write 2, or take method lever.")
    if not factor >= 1.0:
        wrong.append(f"factor = {factor!r}: it says how far above the wanted range; write 1 or more.")
    if chain.motor_index == chain.load_index:
        wrong.append(f"load = {chain.load_mass!r}: motor and load are the same mass; name another one.")
    if wrong:
        raise InputError(wrong)
    if to is None and (up_to is None or method == "modal"):
        return 2
    return to


def _lever(chain: Chain, to: int | None, wanted: Vector, factor: float) -> tuple[Chain, list[Step]]:
    working = Working.of(chain)
    steps: list[Step] = []
    inverse = 0.0

    def note(kind: str, masses: tuple[str, ...], square: float) -> None:
        after = elastic_frequencies(working.J, working.c) if np.all(np.isfinite(working.c)) else wanted
        errors = after[: wanted.size] / wanted[: after.size] - 1.0
        steps.append(
            Step(
                kind,  # type: ignore[arg-type]
                masses,
                math.sqrt(square),
                square / float(wanted[-1]) ** 2,
                len(working.stations),
                tuple(map(float, errors)),
                tuple(map(float, error_bound(wanted, inverse))),
            )
        )

    for k in _rigid(working):
        names = _names(working, k, k + 1)
        working.join(k)
        note("joint", names, math.inf)
    least = to or (2 if _pieces_swing_above(chain, wanted, factor) else 3)
    while len(working.stations) > least:
        square, k, pair = max(_mergeable(working))
        if to is None and square < factor * wanted[-1] ** 2:
            break
        inverse += 1.0 / square
        names = _names(working, k, k + 1) if pair else _names(working, k)
        if pair:
            working.join(k)
        else:
            working.share_out(k)
        note("pair" if pair else "mass", names, square)
    return working.chain(chain), steps


def _rigid(working: Working) -> Iterator[int]:
    """The rigid joints, one after the other while they are being closed."""
    while True:
        rigid = [k for k, section in enumerate(working.sections) if section.e == 0.0]
        if not rigid:
            return
        if {rigid[0], rigid[0] + 1} == {working.motor, working.load}:
            raise InputError("shaft: motor and load are joined rigidly, so nothing is left between them.")
        yield rigid[0]


def _mergeable(working: Working) -> Iterator[tuple[float, int, bool]]:
    """Squared frequency and place of the partial systems that may go; True for a pair."""
    of_mass, of_pair = squared_frequencies(working.J, working.c)
    ends = {working.motor, working.load}
    for k in range(1, of_mass.size - 1):
        if k not in ends:
            yield float(of_mass[k]), k, False
    for k in range(of_pair.size):
        if {k, k + 1} != ends:
            yield float(of_pair[k]), k, True


def _names(working: Working, *places: int) -> tuple[str, ...]:
    return tuple(" + ".join(working.stations[k].names) for k in places)


def _pieces_swing_above(chain: Chain, wanted: Vector, factor: float) -> bool:
    return all(Omega**2 >= factor * wanted[-1] ** 2 for _, Omega in pieces(chain))


def _refusals(chain: Chain, steps: list[Step], two: bool, wanted: Vector, factor: float) -> Iterator[str]:
    """Where the condition fails, and what to do."""
    w = float(wanted[-1])
    remedy = f"; stop before that with --up-to {1.001 * w:.4g}, or go on with --force"
    if two and steps[0].kind != "modal" and wanted.size == 1:
        remedy = f"; --method modal keeps this frequency in two masses{remedy.replace(';', ',', 1)}"
    for step in steps:
        if step.ratio < factor:
            who = " and ".join(step.masses)
            what = {"mass": "the mass", "pair": "the pair", "modal": "the second mode of"}[step.kind]
            yield (
                f"reduce to {step.masses_left}: {what} {who} swings at {step.Omega:.6g} rad/s, and "
                f"({step.Omega:.6g}/{w:.6g})^2 = {step.ratio:.3g} is below the {factor:g} that keeps the "
                f"wanted {w:.6g} rad/s{remedy}."
            )
            return
    if two:
        for names, Omega in pieces(chain):
            ratio = (Omega / w) ** 2
            if ratio < factor:
                yield (
                    f"reduce to 2: with open gaps the piece {' - '.join(names)} swings at {Omega:.6g} rad/s, "
                    f"and ({Omega:.6g}/{w:.6g})^2 = {ratio:.3g} is below the {factor:g} that lets it pass as "
                    f"one mass{remedy}."
                )


def _notes(chain: Chain, reduced: Chain) -> Iterator[str]:
    """What the reduced chain leaves out."""
    if (held := chain.at_motor_shaft().held) is not None:
        yield f"{chain.masses[held].name} stays at rest and is left out, with its shaft; the chain has both"
    if curved := [mass.name for mass in chain.masses if mass.curve is not None]:
        yield f"the load curves of {', '.join(curved)} are left out of the drive; the chain has them"
    torques = [mass for mass in chain.masses if mass.torque]
    if len({mass.kind for mass in torques}) > 1:
        kinds = ", ".join(f"{mass.name} {mass.kind}" for mass in torques)
        yield f"load torques of both kinds ({kinds}): where they meet they count as the larger kind"
    if any(mass.damping for mass in chain.masses) and len(reduced.masses) == 2:
        yield "the damping to the ground is left out of the drive, which has none"
    efficiency = math.prod(shaft.efficiency for shaft in chain.shafts)
    if efficiency < 1.0 and len(reduced.masses) == 2:
        yield (
            f"the efficiencies of the gears (together {efficiency:.4g}) are left out of the drive, which "
            "starts as if nothing were lost; the chain is started with them"
        )
    if any(shaft.rigid and shaft.gap > 0.0 for shaft in chain.shafts):
        yield "rigid gaps are counted with the springs beside them: their impacts are not kept"
    if len({shaft.contact_law for shaft in chain.shafts}) > 1:
        yield "the shafts have different contact laws; a merged one has that of its first shaft"
