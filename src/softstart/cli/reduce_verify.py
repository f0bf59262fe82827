"""A start designed on the reduced drive, verified on the whole chain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from softstart.cli.options import Mistakes
from softstart.errors import InputError

if TYPE_CHECKING:
    from softstart.chain import Reduction
    from softstart.chain.verification import Verification


def verified(found: Reduction, names: Sequence[str]) -> list[Verification]:
    """The controllers of these names, set up for the drive, started on the drive and on the chain."""
    from softstart.chain.verification import verify_on_chain
    from softstart.cli.running import Attributed, make_controllers

    drive = found.to_drive()
    done = []
    for controller in make_controllers(names, {}, prefix=True):
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
    from softstart.cli.show import column_of, number

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
