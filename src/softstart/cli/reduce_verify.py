"""A start designed on the reduced drive, verified on the whole chain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

from softstart.cli.options import Mistakes
from softstart.errors import InputError

if TYPE_CHECKING:
    from softstart.chain import Reduction
    from softstart.chain.simulation import Verification

FAR = 1.5  # times the K_dyn of the drive: from there on the two masses do not tell the load of the chain
ALIKE = 0.01  # share by which two K_dyn differ at least where one strategy counts as gentler


def verified(
    found: Reduction, names: Sequence[str], params: Mapping[str, Mapping[str, Any]]
) -> list[Verification]:
    """The controllers of these names, set up for the drive, started on the drive and on the chain."""
    from softstart.chain.simulation import verify_on_chain
    from softstart.cli.running import Attributed, make_controllers

    drive = found.to_drive()
    done = []
    for controller in make_controllers(names, params, prefix=True):
        with Attributed():
            done.append(verify_on_chain(found.chain, drive, controller))
    return done


def check(found: Reduction, names: Sequence[str] | None) -> None:
    """That there is a drive to design on, where controllers are to be verified."""
    from softstart.cli.reduce import makes_drive

    if names is None or makes_drive(found):
        return
    mistakes = Mistakes()
    count = len(found.reduced.masses)
    if count != 2:
        with mistakes.noted():
            raise InputError(
                f"--verify: a start is designed on two masses, and {count} are left; leave out --to and "
                "--up-to, or take --method modal."
            )
    with mistakes.noted():
        if found.chain.motor is None or found.chain.target_speed is None:
            raise InputError(
                "--verify: a start needs the tables [motor] and [start] with a target_speed; add them."
            )
    mistakes.settle()


def columns(done: Sequence[Verification]) -> dict[str, list[str]]:
    """The table of them."""
    from softstart.views.numbers import column_of, number

    return {
        "strategy": [one.name for one in done],
        "K_dyn\ndrive": [number(one.drive.k_dyn, 4) for one in done],
        "K_dyn\nchain": [number(one.chain.k_dyn, 4) for one in done],
        "drive off\n%": [f"{100 * one.error:+.1f}" for one in done],
        "start time\ndrive s": column_of([one.drive.start_time for one in done], 4),
        "start time\nchain s": column_of([one.chain.start_time for one in done], 4),
        "largest K\nof a shaft": [number(one.worst_k_dyn, 4) for one in done],
        "which": [one.worst_place for one in done],
    }


def reordered(done: Sequence[Verification]) -> tuple[Verification, Verification] | None:
    """The pair that stands the other way round on the chain, the one that is gentler there first.

    Of several the one that differs most on the chain; strategies that are alike are no pair.
    """
    pairs = []
    for one, other in combinations(done, 2):
        gentler, harder = sorted((one, other), key=lambda v: v.chain.k_dyn)
        if (
            gentler.chain.k_dyn < (1.0 - ALIKE) * harder.chain.k_dyn
            and harder.drive.k_dyn < (1.0 - ALIKE) * gentler.drive.k_dyn
        ):
            pairs.append((gentler, harder))
    return max(pairs, key=lambda pair: pair[1].chain.k_dyn / pair[0].chain.k_dyn, default=None)


def caution(done: Sequence[Verification]) -> str:
    """One sentence where the chain orders or loads strategies otherwise than the two masses; else none."""
    said = []
    pair = reordered(done)
    if pair is not None:
        gentler, harder = pair
        said.append(
            f"{gentler.name} is gentler than {harder.name} (K_dyn {gentler.chain.k_dyn:.3g} and "
            f"{harder.chain.k_dyn:.3g}), on the drive it is the other way round "
            f"({gentler.drive.k_dyn:.3g} and {harder.drive.k_dyn:.3g})"
        )
    far = max(done, key=_ratio, default=None)
    if far is not None and _ratio(far) > FAR:
        said.append(f"{far.name} has {_ratio(far):.2f} times its K_dyn on the drive")
    return f"On the chain {', and '.join(said)}: choose by the chain." if said else ""


def verdict(done: Sequence[Verification]) -> dict[str, Any] | None:
    """The same as plain data; None without starts."""
    if not done:
        return None
    return {
        "order_on_drive": [one.name for one in sorted(done, key=lambda v: v.drive.k_dyn)],
        "order_on_chain": [one.name for one in sorted(done, key=lambda v: v.chain.k_dyn)],
        "order_differs": reordered(done) is not None,
        "largest_ratio": max(map(_ratio, done)),
        "caution": caution(done) or None,
    }


def _ratio(one: Verification) -> float:
    """K_dyn on the chain over that on the drive."""
    return one.chain.k_dyn / one.drive.k_dyn
