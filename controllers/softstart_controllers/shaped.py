"""Soft landing, then torque steps that leave no swing behind: zero-vibration shaping from contact on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from softstart.controller import CompiledController, parameter, stack
from softstart.controller.compiled import Vector
from softstart.drive import Drive
from softstart.errors import InputError
from softstart_controllers import landing, shaping
from softstart_controllers.sampled import (
    PATIENCE_DEFAULT,
    PERIOD_DEFAULT,
    check,
    number,
    patience,
    sample_period,
)
from softstart_controllers.shaped_step import N_STATE, step

SHAPERS = {"zv": shaping.ZV, "zvd": shaping.ZVD}
LOW = 0.5  # of the accelerating torque
IMPACT = {"zv": 0.7, "zvd": 0.3}  # c dw12/Omega, of the shaft torque under the full torque


@dataclass(frozen=True)
class Shaped(CompiledController):
    """Soft landing, then the torque raised in steps that leave no swing in the shaft.

    It measures the motor angle (encoder) and the motor torque. The gap is nowhere among its numbers.

    *Landing.* The motor closes the gap `approach_speed` faster than the load, with at most `low_torque`. The
    contact is seen in the second difference of the encoder angle against that of a free motor, which is the
    mean shaft torque over a short window; it counts from `threshold` on, and at least from six times the
    encoder's rounding. Its size gives the instant of contact too, and so twist and twist rate at the sample
    that sees it (`landing`).

    *Steps.* The impact has already excited the shaft: T(0) = 0, T'(0) = c dw12. From this state the torque is
    raised in levels of n samples each, two (`zv`) or four (`zvd`), to `full_torque`, chosen so that nothing
    swings after the last step. Undamped and for n samples in a quarter of the elastic period, with I = c
    dw12/Omega and the mean torque M_f under the full torque, the two levels of the mean torque are

        M_0, M_1 = (M_f - I)/2, (M_f + I)/2

    and I = 0 gives the two equal steps of the textbook. n is the smallest number whose levels rise; then T
    never exceeds M_f: K_dyn = 1 with `full_torque` = Ms. The equations, with damping and lag, are in
    `shaping`. `zvd` makes the derivative of what is left with respect to the frequency zero as well; it takes
    twice as long, and a softer landing.

    No such levels may exist: the landing was too hard, or a load at rest still holds. Then the mean torque
    is T - 4 T'/Omega, within 0 and the full torque, which lets the swing die out (T'' = -4 Omega T'), or the
    torque is low until the load breaks away, and the levels are asked for again in every sample. Where the
    flanks part again, the gap is closed anew.

    *Limits.* After contact it counts on its model: elastic `frequency`, inertias, load torque and speed of
    the load are those of the nominal drive. A first-order lag of the torque commutes with the shaper, and is
    allowed for; so is a dead time of up to one sample. A limited torque rate is not. Contact not seen within
    `patience` is waited for no longer.

    Source: posicast of Smith (1957), ZV and ZVD of Singer and Seering (1990), with the state at contact.

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(simulate(crane, Shaped(shaper=kind)).k_dyn, 1) for kind in ("zv", "zvd")]
    [1.0, 1.0]
    """

    name: ClassVar[str] = "shaped"
    summary: ClassVar[str] = "soft landing, then torque steps that leave no swing in the shaft (ZV, ZVD)"
    source: ClassVar[str] = "Smith 1957, Singer and Seering 1990"
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = N_STATE

    shaper: str | None = parameter("", "zv or zvd", "zv", "text")
    low_torque: float | None = parameter(
        "N*m",
        "torque limit while the gap is open",
        "load torque plus half the accelerating torque",
        multiples=(0.3, 2.0),
    )
    approach_speed: float | None = parameter(
        "rad/s",
        "speed at which the gap is closed",
        "c dw12/Omega = 0.7 (zv) or 0.3 (zvd) of the mean shaft torque under the full torque",
        multiples=(0.3, 3.0),
    )
    full_torque: float | None = parameter(
        "N*m", "torque after the last step", "starting torque Ms", multiples=(0.4, 1.0)
    )
    frequency: float | None = parameter(
        "rad/s", "undamped elastic frequency of the model", "Omega", multiples=(0.7, 1.4)
    )
    threshold: float | None = parameter(
        "N*m",
        "mean shaft torque over the window that means contact",
        "0.1 M12avg_base, at most half of what low torque and speed control can make the shaft carry",
    )
    patience: float | None = parameter("s", "longest wait for contact and plan", PATIENCE_DEFAULT)
    period: float | None = parameter("s", "sample period", PERIOD_DEFAULT)

    def __post_init__(self) -> None:
        if self.shaper is not None and self.shaper not in SHAPERS:
            raise InputError(
                f'shaper = "{self.shaper}": the controller shaped knows the shapers "zv" and "zvd".'
            )
        check(
            self,
            above_zero=("low_torque", "approach_speed", "full_torque", "frequency", "threshold", "period"),
            not_negative=("patience",),
        )

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """From the nominal drive; neither gap nor start position enter."""
        held = np.maximum(drive.Mc, 0.0)
        low = held + LOW * (drive.Ms - held) if self.low_torque is None else self.low_torque
        period = sample_period(drive) if self.period is None else self.period
        full = drive.Ms if self.full_torque is None else self.full_torque
        shaper = self.shaper or "zv"
        impact = IMPACT[shaper] * landing.shaft_torque_under(drive, full)
        speed = drive.Omega * impact / drive.c if self.approach_speed is None else self.approach_speed
        return {
            "shaper": shaper,
            "low_torque": number(low),
            "approach_speed": number(speed),
            "full_torque": drive.Ms,
            "frequency": drive.Omega,
            "threshold": number(landing.contact_threshold(drive, low, speed, period)),
            "patience": patience(drive),
            "period": period,
        }

    def vector(self, drive: Drive) -> Vector:
        """The numbers in the order of the indices from P_PERIOD to P_DEAD."""
        inertia = drive.J1 * drive.J2 / (drive.J1 + drive.J2)
        numbers = landing.landing_numbers(
            drive,
            period=self.period,
            low_torque=self.low_torque,
            approach_speed=self.approach_speed,
            threshold=self.threshold,
            patience=self.patience,
            stiffness=inertia * np.asarray(self.frequency) ** 2,
        )
        return stack(
            drive, *numbers, SHAPERS[self.shaper or "zv"], self.full_torque, drive.torque_lag,
            drive.computing_delay,
        )  # fmt: skip
