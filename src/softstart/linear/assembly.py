"""The loop put together from the controller's law and the sampled plant, broken at the demand or closed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from softstart.drive import Drive
from softstart.linear.margins import Margins, margins
from softstart.linear.modes import Mode, modes
from softstart.linear.operating_point import OperatingPoint, closed
from softstart.linear.realisation import TOLERANCE, System, minimal, scaled, unscaled
from softstart.linear.response import Vector
from softstart.linear.sampled_plant import Continuous, SampledPlant, in_contact, sampled
from softstart.plant.start import M_MOTOR_TORQUE
from softstart.start.metrics import base_torque

if TYPE_CHECKING:
    import control

COARSEST = 1e-5  # tolerance for what the closed loop shows
TURNING = 1e-4  # of the elastic frequency: slower poles are the free turning, seen through rounding
ON_THE_CIRCLE = 1e-9  # poles this near to the unit circle do not count as stable


@dataclass(frozen=True, eq=False)
class Loop:
    """A controller linearised at `point`, on a drive that need not be the one of the point."""

    drive: Drive
    point: OperatingPoint
    differencing: bool

    @property
    def period(self) -> float:
        """Sample period, s."""
        return self.point.plant.period

    @property
    def tolerance(self) -> float:
        """What counts as not shown by the closed loop: more than the law is uncertain, 1e-8 to 1e-5."""
        return min(max(TOLERANCE, 100.0 * self.point.mismatch), COARSEST)

    @cached_property
    def plant(self) -> SampledPlant:
        """The drive in contact at the samples."""
        return self._plant(0.0)

    @cached_property
    def broken(self) -> System:
        """L(z), minimal: from a demand put into the plant to the negative of the one answered."""
        return self._minimal(self.plant)

    @cached_property
    def minimal_law(self) -> System:
        """The controller without states that do not count: from what is measured to the demand."""
        law, inputs, outputs = self.point.law, self.point.derivative.input_scales, self._base
        return unscaled(minimal(scaled(law, self._law_scales, inputs, outputs)), inputs, outputs)

    def broken_delayed(self, delay: float) -> System:
        """L(z) with so much further dead time, s, between answer and torque; not minimal."""
        return self._broken(self._plant(delay))

    def broken_with_gain(self, gain: float) -> System:
        """L(z) with the demand multiplied on its way to the motor."""
        L = self.broken
        return System(L.A, L.B * gain, L.C, L.D * gain)

    def margins(self) -> Margins:
        """The margins of L."""
        return margins(self.broken, self.period, self.broken_delayed, self._torque_jumps)

    @property
    def _torque_jumps(self) -> bool:
        """Whether the measured torque has no lag and the controller makes use of it."""
        used = np.any(np.vstack([self.point.law.B, self.point.law.D]) != 0.0, axis=0)
        return "u" not in self._continuous.rows and bool(
            used[self.point.derivative.inputs.index(M_MOTOR_TORQUE)]
        )

    def modes(self) -> tuple[Mode, ...]:
        """The closed loop's poles that show in the shaft torque or in the demand.

        The drive's turning as a whole, which a torque controller leaves free (poles at 1), is not among them.
        """
        found = modes(self._closed_outputs, self.period, self.tolerance)
        return tuple(mode for mode in found if mode.frequency > TURNING * float(self.drive.Omega))

    @cached_property
    def stable(self) -> bool:
        """Whether all these modes die out."""
        return all(abs(mode.value) < 1.0 - ON_THE_CIRCLE for mode in self.modes())

    def control_system(self, into: str, out: str) -> control.StateSpace:
        """L(z) for python-control."""
        import control

        return control.StateSpace(*self.broken, self.period, inputs=[into], outputs=[out])

    @cached_property
    def _closed_outputs(self) -> System:
        whole, read = closed(self.plant, self.point.law)
        torque = np.hstack([self.plant.rows["T"], np.zeros((1, len(self.point.states)))])
        system = System(whole, np.zeros((whole.shape[0], 0)), np.vstack([torque, read]), np.zeros((2, 0)))
        outputs = np.concatenate([self._base, self._base])
        return scaled(system, self._scales(self.plant), np.zeros(0), outputs)

    def _plant(self, further: float) -> SampledPlant:
        delay = float(self.drive.computing_delay) + further
        inputs = self.point.derivative.inputs
        return sampled(self._continuous, self.period, delay, inputs, self.differencing)

    @cached_property
    def _continuous(self) -> Continuous:
        return in_contact(self.drive)

    def _broken(self, plant: SampledPlant) -> System:
        A, B, C, _ = plant.system
        law = self.point.law
        whole = np.block([[A, np.zeros((A.shape[0], law.A.shape[0]))], [law.B @ C, law.A]])
        into = np.vstack([B, np.zeros((law.A.shape[0], 1))])
        return System(whole, into, -np.hstack([law.D @ C, law.C]), np.zeros((1, 1)))

    def _minimal(self, plant: SampledPlant) -> System:
        system = scaled(self._broken(plant), self._scales(plant), self._base, self._base)
        return unscaled(minimal(system), self._base, self._base)

    @property
    def _base(self) -> Vector:
        return np.array([float(base_torque(self.drive))])

    @property
    def _law_scales(self) -> Vector:
        return np.asarray(self.point.derivative.scales[list(self.point.states)])

    def _scales(self, plant: SampledPlant) -> Vector:
        """The size of each state: windup, elastic speed, mean torque."""
        base = float(self._base[0])
        windup = base / float(self.drive.c)
        speed = float(self.drive.Omega) * windup
        size = plant.system.A.shape[0]
        sizes = np.full(size, base)
        sizes[:4] = windup, windup, speed, speed
        if self.differencing:
            sizes[-1] = windup
        return np.concatenate([sizes, self._law_scales])
