"""Reduce a chain to few masses that keep its low frequencies [R], with the error of every step."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from softstart.chain.frequencies import elastic_frequencies
from softstart.chain.model import Chain
from softstart.chain.partial import squared_frequencies
from softstart.chain.reduction.condition import FACTOR, error_bound, pieces
from softstart.chain.reduction.modal import modal
from softstart.chain.reduction.result import Frequency, Method, Reduction, Step
from softstart.chain.reduction.working import Working
from softstart.chain.vibration import natural_vibration
from softstart.errors import InputError

__all__ = ["reduce_chain"]

Vector = NDArray[np.float64]


def reduce_chain(
    chain: Chain,
    to: int | None = None,
    *,
    up_to: float | None = None,
    method: Method = "lever",
    factor: float = FACTOR,
    force: bool = False,
) -> Reduction:
    """The chain with `to` masses, or with as few as keep its frequencies up to `up_to` (rad/s).

    Kept are the `to - 1` lowest elastic frequencies, or those up to `up_to`. Method "lever" merges the
    partial system of the highest frequency, again and again [R]; "modal" gives the two masses that have
    the first frequency and the node of the chain exactly. The motor's and the load's mass are never shared or
    put together. Refused with `InputError` where a partial system, or a piece between two gaps, lies below
    sqrt(`factor`) times the highest wanted frequency, unless `force`.

    >>> reduction = reduce_chain(Chain.load("crane-4-mass"), to=2)
    >>> [(step.kind, step.masses, round(step.ratio)) for step in reduction.steps]
    [('mass', ('pinion',), 190), ('mass', ('wheel shaft',), 26)]
    >>> round(reduction.frequencies[0].error, 4)
    -0.0195
    """
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
        tuple(_notes(chain, reduced)),
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
    remedy = f"; stop before that with --up-to {1.001 * w:.4g} in place of --to, or go on with --force"
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
