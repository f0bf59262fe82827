"""Linear-quadratic feedback of the estimated state, switched on at contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from softstart.controller import CompiledController, parameter, stack
from softstart.controller.compiled import Vector
from softstart.drive import Drive
from softstart.plant.vector import encoder_count
from softstart.start.metrics import base_torque
from softstart_controllers import landing
from softstart_controllers.contact_designs import feedback_gains, observer_gains
from softstart_controllers.sampled import (
    PATIENCE_DEFAULT,
    PERIOD_DEFAULT,
    check,
    number,
    patience,
    sample_period,
)
from softstart_controllers.state_feedback_step import N_STATE, step

LOW = 0.5  # of the accelerating torque
IMPACT = 0.7  # c dw12/Omega, of the shaft torque under the full torque
RISE = 0.75  # of the elastic period
TORQUE_WEIGHT = 3.0
RATE_WEIGHT = 4.0
UNCERTAINTY = 0.03
FASTEST = 6.0  # bandwidth of the filter in elastic frequencies, however fine the encoder
SLOWEST = 0.05  # likewise, however coarse the encoder
SLEWED_SHARE = 0.25  # of Ms
OPENS = 0.5  # of the threshold: a shaft that pulls so much has let go


@dataclass(frozen=True)
class StateFeedback(CompiledController):
    """Soft landing, then a linear-quadratic regulator of the shaft torque on a Kalman filter.

    It measures the motor angle (encoder) and the motor torque. The gap is nowhere among its numbers.

    *Landing.* As `shaped`: the gap is closed `approach_speed` faster than the load, with at most
    `low_torque`; the contact is seen in the encoder angle (`landing`), which also gives twist and twist rate.

    *Estimate.* From contact on the closed drive is followed under the torque realised and corrected by the
    encoder: phi1, w1, the twist z, its rate, and the load torque, a constant that wanders. The gains are
    those of the stationary Kalman filter (`control.dlqe`) for an unknown part `uncertainty` Omega^2
    M12avg_base of T'' (white, of that size over 1/Omega) and for the rounding of the encoder. The estimate of
    the load takes up what is wrong in the model, so the shaft torque settles at its reference: integral
    action. While a reactive load is at rest the twist is the motor's own way.

    *Feedback.* The reference T_ref rises from the mean shaft torque under the low torque to that under
    `full_torque` in the time `rise`. With M = (u J2 + Mc J1)/(J1 + J2), the mean torque under the motor
    torque u, and M_y that under the torque the lagging motor has reached by now,

        M = T_ref + 2 zeta T_ref'/Omega - f1 (T - T_ref) - f2 (T' - T_ref')/Omega - f3 (M_y - T_ref)

    u is limited to 0 and full_torque. f1 to f3 minimise (`control.dlqr`) the sum over the samples of

        torque_weight (T - T_ref)^2 + rate_weight ((T' - T_ref')/Omega)^2 + (M - T_ref)^2

    for the drive with its lag, sampled. Here T is c z. A limited torque rate counts as more lag, by the time
    in which it slews a quarter of Ms; a dead time is bridged by the model.

    *Limits.* Designs are made for groups without units on a grid (`contact_designs`) and kept on disk, so
    neighbouring weights may give the same start. Where the estimate pulls by half the threshold, the gap
    counts as open again and is closed anew. At `patience` the feedback is dropped for the full torque.

    Source: linear-quadratic-Gaussian control as in the manual of python-control; landing as `shaped`.

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf")
    >>> [round(simulate(crane.replace(gap=gap), StateFeedback()).k_dyn, 1) for gap in (0.5, 2)]
    [1.0, 1.0]
    """

    name: ClassVar[str] = "state-feedback"
    summary: ClassVar[str] = "soft landing, then LQR of the shaft torque on a Kalman filter"
    source: ClassVar[str] = "LQG, python-control"
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = N_STATE

    low_torque: float | None = parameter(
        "N*m",
        "torque limit while the gap is open",
        "load torque plus half the accelerating torque",
        multiples=(0.3, 2.0),
    )
    approach_speed: float | None = parameter(
        "rad/s",
        "speed at which the gap is closed",
        "c dw12/Omega = 0.7 of the mean shaft torque under the full torque",
        multiples=(0.3, 3.0),
    )
    full_torque: float | None = parameter(
        "N*m", "torque limit after the rise", "starting torque Ms", multiples=(0.4, 1.0)
    )
    rise: float | None = parameter(
        "s",
        "time in which the reference rises after contact",
        "three quarters of the elastic period",
        multiples=(0.2, 5.0),
    )
    torque_weight: float | None = parameter(
        "1",
        "weight of the error of T, that of the mean torque under the motor being 1",
        "3",
        multiples=(0.03, 30.0),
    )
    rate_weight: float | None = parameter(
        "1",
        "weight of T'/Omega, that of the mean torque under the motor being 1",
        "4",
        multiples=(0.03, 30.0),
    )
    threshold: float | None = parameter(
        "N*m",
        "mean shaft torque over the window that means contact",
        "0.1 M12avg_base, at most half of what low torque and speed control can make the shaft carry",
    )
    uncertainty: float | None = parameter(
        "1",
        "unknown part of T'' that the filter reckons with, as a share of Omega^2 M12avg_base",
        "0.03",
        multiples=(0.1, 10.0),
    )
    patience: float | None = parameter("s", "latest instant for the feedback to act", PATIENCE_DEFAULT)
    period: float | None = parameter("s", "sample period", PERIOD_DEFAULT)

    def __post_init__(self) -> None:
        check(
            self,
            above_zero=(
                "low_torque",
                "approach_speed",
                "full_torque",
                "torque_weight",
                "rate_weight",
                "threshold",
                "uncertainty",
                "period",
            ),
            not_negative=("rise", "patience"),
        )

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """From the nominal drive; neither gap nor start position enter."""
        held = np.maximum(drive.Mc, 0.0)
        low = held + LOW * (drive.Ms - held) if self.low_torque is None else self.low_torque
        period = sample_period(drive) if self.period is None else self.period
        full = drive.Ms if self.full_torque is None else self.full_torque
        impact = IMPACT * landing.shaft_torque_under(drive, full)
        speed = drive.Omega * impact / drive.c if self.approach_speed is None else self.approach_speed
        return {
            "low_torque": number(low),
            "approach_speed": number(speed),
            "full_torque": drive.Ms,
            "rise": number(RISE * drive.elastic_period),
            "torque_weight": TORQUE_WEIGHT,
            "rate_weight": RATE_WEIGHT,
            "threshold": number(landing.contact_threshold(drive, low, speed, period)),
            "uncertainty": UNCERTAINTY,
            "patience": patience(drive),
            "period": period,
        }

    def vector(self, drive: Drive) -> Vector:
        """The numbers in the order of the indices from P_PERIOD to P_OPENS."""
        numbers = landing.landing_numbers(
            drive,
            period=self.period,
            low_torque=self.low_torque,
            approach_speed=self.approach_speed,
            threshold=self.threshold,
            patience=self.patience,
            stiffness=drive.c,
        )
        period = np.asarray(self.period)
        step = drive.Omega * period
        ratio = np.minimum(0.5 * drive.d * drive.Omega / drive.c, landing.LARGEST_DAMPING)
        share = drive.J2 / (drive.J1 + drive.J2)
        lag = drive.torque_lag + SLEWED_SHARE * np.asarray(drive.Ms) / drive.torque_rate
        back = feedback_gains(step, ratio, drive.Omega * lag, self.torque_weight, self.rate_weight)
        unit = base_torque(drive) / drive.c
        density = np.asarray(self.uncertainty) ** 2
        noise = np.asarray(encoder_count(drive)) ** 2 / 12.0 / unit**2 / density
        noise = np.clip(noise, share**2 / step / FASTEST**8, share**2 / step / SLOWEST**8)
        kalman = observer_gains(step, ratio, share, noise)
        return stack(
            drive, *numbers, self.full_torque, np.maximum(np.asarray(self.rise, float), period),
            drive.torque_lag, drive.computing_delay, 1.0 / drive.J2, *np.moveaxis(back, -1, 0),
            kalman[..., 0], kalman[..., 1] * drive.Omega, kalman[..., 2], kalman[..., 3] * drive.Omega,
            kalman[..., 4] * drive.c * (drive.J1 + drive.J2) / drive.J1, -OPENS * np.asarray(self.threshold),
        )  # fmt: skip
