"""What stands for a chain in front of a controller where no two masses do."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from softstart.chain.elements import Motor
from softstart.drive import Machine
from softstart.errors import InputError


@Machine.register
class Unreduced:
    """What controllers may know of a chain that cannot be reduced to two masses.

    That is what its motor, its target, its load torque and its first elastic period are; for anything else it
    says why there are no two masses. So a strategy starts such a chain if nothing of it has to be derived
    from them.

    >>> from softstart import Chain
    >>> from softstart.chain.elements import Mass, Shaft
    >>> masses = [Mass(0.035), Mass(0.05, name="table"), Mass(0.5)]
    >>> shafts = [Shaft(4e3), Shaft(2e2)]
    >>> chain = Chain(masses, shafts, Motor(62), load_mass="table", target_speed=92)
    >>> chain.design_drive.Ms
    62.0
    >>> chain.design_drive.Omega
    Traceback (most recent call last):
    softstart.errors.InputError: load = 'table': the node of the first elastic mode ... (fitted_to).
    """

    def __init__(self, chain: Machine, sentences: Iterable[str]) -> None:
        self._chain, self._sentences = chain, sentences

    @property
    def design_drive(self) -> Unreduced:
        """Itself, as of a drive."""
        return self

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # what Python asks for, as a copy or a pickle
            raise AttributeError(name)
        if name in ("name", "target_speed", "mean_torque", "elastic_period"):
            return getattr(self._chain, name)
        if name == "Mc":
            return self._chain.lever_rule_model.Mc
        motor = {"Ms": "starting_torque"}.get(name, name)
        if motor in Motor.PARAMETERS:
            return getattr(self._chain.motor, motor)
        *before, last = self._sentences
        remedy = "or name the drive for which the controller is set up (fitted_to)"
        raise InputError([*before, f"{last.rstrip('.')}; {remedy}."])
