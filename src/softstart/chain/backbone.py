"""Free vibration with gaps: the frequency falls with the amplitude (the backbone curve).

Exact for two masses; by exact simulation for a chain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.chain.model import Chain, Mass, Shaft
from softstart.chain.reduction import reduce_chain
from softstart.chain.simulation import simulate_chain
from softstart.chain.vibration import natural_vibration
from softstart.drive.checks import elastic_frequency
from softstart.errors import InputError
from softstart.quantities import Value

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Backbone", "backbone", "chain_backbone"]

Vector = NDArray[np.float64]


def backbone(J1: float, J2: float, c: float, gap: float, amplitude: Value) -> Value:
    """Frequency in rad/s of the free vibration of two masses without drive torque, exact.

    `amplitude` is the largest shaft torque over c, the largest twist of the spring in rad. The masses swing
    through the gap with the relative speed `v = Omega amplitude`, and half a sine on each side:

        T = 2 pi/Omega + 2 gap/v                                                          [R]

    so `w/Omega = 1/(1 + gap/(pi amplitude))`: half of Omega where the amplitude is gap/pi, none at rest.

    >>> float(backbone(1.0, 1.0, 2.0, 0.0, 0.1))
    2.0
    >>> round(float(backbone(1.0, 1.0, 2.0, 0.1, 0.1 / math.pi)), 12)
    1.0
    """
    amplitudes: NDArray[np.float64] = np.asarray(amplitude, np.float64)
    if not np.all(amplitudes > 0.0):
        raise InputError("amplitude: the largest twist of the spring must be above 0.")
    Omega = elastic_frequency(J1, J2, c)
    return Omega / (1.0 + gap / (math.pi * amplitudes))


@dataclass(frozen=True, eq=False)
class Backbone:
    """Frequency against amplitude of the free vibration of a chain with its gaps, at the motor shaft, in SI.

    `torque` is the largest shaft torque with which the vibration is released, N m. `frequency` is that of the
    motion along the gap-free shape, rad/s, by simulation; `two_masses` that of the two masses of the modal
    reduction, by the exact formula of `backbone`; `Omega` the gap-free frequency of the mode.
    """

    chain: Chain
    mode: int
    Omega: float
    torque: Vector
    frequency: Vector
    two_masses: Vector

    def summary(self) -> dict[str, Any]:
        """All of it as plain data."""
        return {
            "chain": self.chain.name,
            "assumed": self.chain.assumed,
            "mode": self.mode,
            "Omega": self.Omega,
            "torque": self.torque.tolist(),
            "frequency": self.frequency.tolist(),
            "two_masses": self.two_masses.tolist(),
        }

    def plot(self) -> Figure:
        """The frequencies, over that without gaps, against the largest torque."""
        from softstart.views.drawing import COLOURS, drawing, new_figure

        with drawing():
            figure, axes = new_figure(size=(6.5, 4.0))
            axes.semilogx(self.torque, self.frequency / self.Omega, "o-", color=COLOURS[0], label="chain")
            if np.isfinite(self.two_masses).all():
                two = self.two_masses / self.Omega
                axes.semilogx(self.torque, two, "--", color=COLOURS[1], label="two masses, exact")
            axes.set_xlabel("largest torque at release, N m")
            axes.set_ylabel("frequency over that without gaps")
            axes.set_title(f"{self.chain.name}: free vibration with gaps, mode {self.mode}")
            axes.legend()
        drawn: Figure = figure
        return drawn


def chain_backbone(chain: Chain, torque: Value, mode: int = 1, periods: int = 60) -> Backbone:
    """The free vibration of the chain with its gaps, released from rest with the shaft torques of a mode.

    `torque` holds the largest shaft torques (N m at the motor shaft), in the ratio of the gap-free mode among
    the shafts. The chain is simulated exactly, without damping, friction, load and motor torque, for so many
    gap-free periods. The frequency is the strongest line of the motion along the gap-free shape, under a Hann
    window: for a motion that is not periodic it is known to about one over the length of the run.

    >>> found = chain_backbone(Chain([Mass(1), Mass(1)], [Shaft(2, gap=0.1)]), 2 * 0.1 / math.pi)
    >>> round(float(found.frequency[0]), 4), round(float(found.two_masses[0]), 4)
    (1.0, 1.0)
    """
    vibration = natural_vibration(chain)
    if not 1 <= mode < vibration.Omega.size:
        raise InputError(f"mode = {mode}: the elastic modes are 1 to {vibration.Omega.size - 1}.")
    torques: Vector = np.atleast_1d(np.asarray(torque, np.float64))
    if not (torques.size and np.all(torques > 0.0) and np.all(np.isfinite(torques))):
        raise InputError("torque: the largest shaft torques at release must be above 0 N m.")
    arrays = chain.at_motor_shaft()
    if arrays.rigid.any():
        raise InputError("chain: a free vibration with gaps needs a spring in every shaft; one is rigid.")
    share = vibration.torque[mode] / np.abs(vibration.torque[mode]).max()
    Omega = float(vibration.Omega[mode])
    found = [_main_line(chain, size * share, vibration.shape[mode], Omega, periods, mode) for size in torques]
    two = np.full(torques.size, math.nan)
    if mode == 1:
        reduced = reduce_chain(chain, 2, method="modal", force=True).reduced
        (a, b), (shaft,) = reduced.masses, reduced.shafts
        amplitude = torques / shaft.stiffness
        two = np.asarray(backbone(a.inertia, b.inertia, shaft.stiffness, shaft.gap, amplitude))
    return Backbone(chain, mode, Omega, torques, np.array(found), two)


def _main_line(chain: Chain, torques: Vector, shape: Vector, Omega: float, periods: int, mode: int) -> float:
    """The frequency of the free vibration released with these shaft torques, rad/s."""
    from scipy.optimize import minimize_scalar

    arrays = chain.at_motor_shaft()
    twist = torques / arrays.c + 0.5 * arrays.gap * np.sign(torques)
    masses = [Mass(float(J)) for J in arrays.J]
    rows = zip(arrays.c, arrays.gap, twist, strict=True)
    shafts = [Shaft(float(c), gap=float(gap), start_position=float(at)) for c, gap, at in rows]
    length = periods * 2.0 * math.pi / Omega
    run = simulate_chain(Chain(masses, shafts), None, length)
    t = np.linspace(0.0, length, 64 * periods + 1)
    relative = np.concatenate(
        [np.zeros((t.size, 1)), -np.cumsum(run.at(t)["twist"], axis=1)], axis=1
    )  # the rigid motion has no part in a shape
    along = relative @ (arrays.J * shape)
    window = np.hanning(t.size)
    signal = (along - along.mean()) * window / window.sum()

    def line(w: float) -> float:
        return float(abs(np.exp(-1j * w * t) @ signal))

    step = 0.5 * math.pi / length
    lowest = 0.1 if mode == 1 else 0.5  # below lie the lines of lower modes
    places = np.arange(max(lowest * Omega, 4.0 * step), 1.15 * Omega, step)
    best = float(places[int(np.argmax([line(w) for w in places]))])
    refined = minimize_scalar(
        lambda w: -line(w),
        bounds=(best - step, best + step),
        method="bounded",
        options={"xatol": 1e-7 * best},
    )
    return float(refined.x)
