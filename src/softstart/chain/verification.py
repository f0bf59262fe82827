"""A start designed on the reduced drive, verified on the whole chain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from softstart.chain.model import Chain
from softstart.chain.run import ChainRun
from softstart.chain.simulation import simulate_chain
from softstart.controller.base import Controller
from softstart.controller.finding import make_controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.start import metrics
from softstart.start.run import Run
from softstart.start.simulation import simulate

__all__ = ["Verification", "verify_on_chain"]


@dataclass(frozen=True, eq=False)
class Verification:
    """A controller set up for the drive, on drive and chain; K_dyn over the drive's mean torque."""

    drive: Run
    chain: ChainRun

    @property
    def name(self) -> str:
        """Name of the controller."""
        return self.drive.controller.name or type(self.drive.controller).__name__

    @property
    def worst_shaft(self) -> int:
        """The index of the shaft between motor and load with the largest torque at the motor shaft."""
        arrays = self.chain.chain.at_motor_shaft()
        first, last = sorted((arrays.motor, arrays.load))
        if first == last:
            first, last = 0, arrays.J.size - 1
        return first + int(self.chain.peak_torques[first:last].argmax())

    @property
    def worst_place(self) -> str:
        """Between which masses it is."""
        masses = self.chain.chain.masses
        return f"{masses[self.worst_shaft].name} - {masses[self.worst_shaft + 1].name}"

    @property
    def worst_k_dyn(self) -> float:
        """Its largest torque over the mean torque of the drive."""
        return float(metrics.k_dyn(float(self.chain.peak_torques[self.worst_shaft]), self.drive.drive))

    @property
    def error(self) -> float:
        """How far the K_dyn of the drive is from that of the chain's shaft beside the motor, as a share."""
        return self.drive.k_dyn / self.chain.k_dyn - 1.0

    def summary(self) -> dict[str, Any]:
        """Both side by side, as plain data."""
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
            "gear_losses": self.chain.energy.gears,
            "chain": self.chain.summary(),
        }


def verify_on_chain(
    chain: Chain | str,
    drive: Drive,
    controller: str | Controller,
    until: float | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
) -> Verification:
    """Run a controller that is set up for `drive` on that drive and on the chain it stands for.

    >>> from softstart.chain import Chain, reduce_chain
    >>> chain = Chain.load("crane-4-mass")
    >>> found = verify_on_chain(chain, reduce_chain(chain, to=2).to_drive(), "s-curve")
    >>> found.worst_place, found.chain.k_dyn > found.drive.k_dyn
    ('rotor - pinion', True)
    """
    if drive.shape != ():
        raise InputError(f"{drive.name}: a batch of shape {drive.shape}; give a single drive.")
    made = make_controller(controller, parameters)
    whole = simulate_chain(chain, made, until, fitted_to=drive, base=drive)
    return Verification(simulate(drive, made, until), whole)
