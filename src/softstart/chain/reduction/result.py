"""What a reduction is: its steps, the frequencies before and after, and the drive that comes out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from softstart.chain.model import Chain
from softstart.chain.vibration import Vibration, natural_vibration
from softstart.drive import Drive
from softstart.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Frequency", "Method", "Reduction", "Step", "TwoMassFigures", "two_mass_figures"]

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
        efficiencies of gears, which a drive does not have, are left out.

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
        note = f"; assumed: {self.chain.assumed}" if self.chain.assumed else ""
        return Drive(
            **chain.motor.keywords(),
            name=f"{self.chain.name}, reduced to two masses ({self.method})",
            source=f"reduced from a chain of {len(self.chain.masses)} masses: {self.chain.source}{note}",
            motor_inertia=motor.inertia,
            load_inertia=load.inertia,
            load_torque=motor.torque + load.torque,
            load_kind=bigger.kind,
            stiffness=shaft.stiffness,
            damping=shaft.damping,
            gap=shaft.gap,
            contact_law=shaft.contact_law,
            start_position=sign * shaft.start_position,
            target_speed=chain.target_speed,
            initial_motor_speed=motor.initial_speed,
            initial_load_speed=load.initial_speed,
        )

    def plot(self) -> Figure:
        """What each step does to the kept frequencies, with the bounds."""
        from softstart.chain.pictures import reduction_figure

        figure: Figure = reduction_figure(self)
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
            "steps": [
                {
                    "kind": step.kind,
                    "masses": list(step.masses),
                    "Omega": step.Omega,
                    "ratio": step.ratio,
                    "masses_left": step.masses_left,
                    "errors": list(step.errors),
                    "bounds": list(step.bounds),
                }
                for step in self.steps
            ],
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
