"""The figures by which starts are judged: K_dyn, settling time, energy balance.

Every K_dyn comes from `formulas.dynamic_coefficient`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from softstart.kernel import records as rec
from softstart.start.kernel_input import SETTLED_BAND
from softstart.start.trajectory import Trajectory

REFERENCE = "direct"  # the strategy beside which start times and lives of the others stand


def settled_time(trajectory: Trajectory, target_speed: float, band: float = SETTLED_BAND) -> float:
    """First instant, not before the start time, from which on the load keeps its speed, s.

    It keeps it where w2 >= (1 - band) target_speed to the end of the run; NaN if it is below at the end. The
    start time is a first passage: of two loads that swing, the one that swings further is there first, and
    falls back. This is the settling time of control engineering with three changes:

    - The band is one-sided, as the torque of a start goes on beyond the target speed, where a speed
      controller takes over.
    - It does not begin before the start time, so that both may be compared.
    - It is 0.1 %, not the usual 2 %: enough for rounding and for a load that creeps to its speed. Swings of
      the load speed are smaller than those of the torque. On the crane drive of [G] `reduced-first-stage` is
      7 ms quicker than direct start by its first passage; its load then falls back by 0.5 %, and has settled
      21 ms later than with direct start.

    The shaft torque has no part in it: undamped it swings for all time under every strategy
    (`Run.settling_time` is for damped drives), and its size is what K_dyn judges. The crossing is located in
    the polynomials of the spans.
    """
    start = float(trajectory.notes.start_time)
    if math.isnan(start):
        return math.nan
    return trajectory.load_settles(start, (1.0 - band) * target_speed)


@dataclass(frozen=True)
class Energy:
    """Where the energy went, J; `residual` is what the sum misses and shows the accuracy of the run.

    motor + exciting = kinetic + elastic + load + ground + shafts + gears + impacts + residual, all from the
    start of the run: work of the motor and of the exciting torques, change of kinetic and elastic energy,
    work against the load torques, friction of the motor and damping to the ground, damping in the shafts and
    what their springs still hold when flanks part, losses of gears (never below 0), impacts of rigid flanks.
    """

    motor: float
    exciting: float
    kinetic: float
    elastic: float
    load: float
    ground: float
    shafts: float
    gears: float
    impacts: float
    residual: float

    @property
    def dissipated(self) -> float:
        """All that is turned into heat, but for the work against the load."""
        return self.ground + self.shafts + self.gears + self.impacts


def energy_balance(trajectory: Trajectory) -> Energy:
    """The energy balance of a recorded start; the residual is computed, not assumed."""
    motor, exciting, load, ground, shafts, gears, elastic = trajectory.work().tolist()
    masses = trajectory.input.masses[0].view(rec.MASS)[:, 0]
    moves = np.isfinite(masses["J"])
    gained = trajectory.of_masses("speed")[-1] ** 2 - masses["w0"] ** 2
    kinetic = 0.5 * float(masses["J"][moves] @ gained[moves])
    struck = np.isin(trajectory.events["kind"], [rec.IMPACT, rec.SETTLED])
    impacts = float(trajectory.events["value"][struck].sum())
    residual = motor + exciting - kinetic - elastic - load - ground - shafts - gears - impacts
    return Energy(motor, exciting, kinetic, elastic, load, ground, shafts, gears, impacts, residual)
