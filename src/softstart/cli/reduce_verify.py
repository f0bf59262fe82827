"""A start designed on the reduced drive, verified on the whole chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from softstart import metrics
from softstart.cli.options import Mistakes
from softstart.errors import InputError

if TYPE_CHECKING:
    from softstart.chain import Reduction
    from softstart.chain.run import ChainRun
    from softstart.run import Run


@dataclass(frozen=True)
class Verified:
    """One controller, set up for the drive, on the drive and on the chain."""

    name: str
    drive: Run
    chain: ChainRun

    @property
    def worst_shaft(self) -> int:
        """The shaft between motor and load with the largest torque, in N m at the motor shaft."""
        arrays = self.chain.chain.at_motor_shaft()
        first, last = sorted((arrays.motor, arrays.load))
        return first + int(self.chain.peak_torques[first:last].argmax())

    @property
    def worst_k_dyn(self) -> float:
        """Its largest torque over the same mean torque as every K_dyn here."""
        return float(metrics.k_dyn(float(self.chain.peak_torques[self.worst_shaft]), self.drive.drive))

    @property
    def worst_place(self) -> str:
        """Between which masses it is."""
        masses = self.chain.chain.masses
        return f"{masses[self.worst_shaft].name} - {masses[self.worst_shaft + 1].name}"

    @property
    def error(self) -> float:
        """How far the K_dyn of the drive is from that of the chain's shaft beside the motor, as a share."""
        return self.drive.k_dyn / self.chain.k_dyn - 1.0

    def summary(self) -> dict[str, Any]:
        """Everything as plain data."""
        return {
            "controller": self.name,
            "k_dyn": self.drive.k_dyn,
            "peak_torque": self.drive.peak_torque,
            "start_time": self.drive.start_time,
            "chain_k_dyn": self.chain.k_dyn,
            "chain_peak_torque": self.chain.peak_torque,
            "chain_start_time": self.chain.start_time,
            "k_dyn_error": self.error,
            "worst_k_dyn": self.worst_k_dyn,
            "worst_shaft": self.worst_place,
            "chain": self.chain.summary(),
        }


def verified(found: Reduction, names: Sequence[str]) -> list[Verified]:
    """The controllers of these names, set up for the drive, started on the drive and on the chain."""
    from softstart.chain.simulation import simulate_chain
    from softstart.cli.running import Attributed, make_controllers
    from softstart.simulation import simulate

    drive = found.to_drive()
    made = make_controllers(names, {}, prefix=True)
    done = []
    for name, controller in zip(names, made, strict=True):
        with Attributed():
            run = simulate(drive, controller)
            whole = simulate_chain(found.chain, controller, fitted_to=drive)
        done.append(Verified(name, run, whole))
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


def columns(done: Sequence[Verified]) -> dict[str, list[str]]:
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
