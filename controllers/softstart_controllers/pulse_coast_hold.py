"""The optimal start as feedback: pulse, coast, hold, from motor angle and motor torque alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Effort, parameter, stack
from softstart.controller.compiled import Vector, size
from softstart.drive import Drive
from softstart_controllers.pulse_coast_hold_step import RING, STATE, step
from softstart_controllers.sampled import (
    PATIENCE_DEFAULT,
    PERIOD_DEFAULT,
    check,
    encoder_count,
    patience,
    sample_period,
)

SHARE_REACTIVE, SHARE_ACTIVE = 0.8, 0.7  # of the speed that makes the stuck load's shaft carry Ms
HOLD_SHARE = 0.98
DAMPING_RATIO = 0.9
STIFFENING = 0.5
CERTAINTY = 7.0
UNCERTAINTY = 0.15
INERTIA_RATIO = 3.0
RATIO_DEVIATION = 0.6  # of J1/J2, beforehand
LEAST_RATIO, MOST_RATIO = 0.02, 4.0  # J1/J2
J1_DEVIATION = 0.04
TORQUE_DEVIATION = 0.002  # of Ms, of the torque measured while the motor is free
SHAFT_DEVIATION = 0.003  # of Ms, while the shaft is in contact
LOAD_DEVIATION = 0.01  # of Ms, of the load torque
FLOOR = 1e-5  # of Ms/c: an ideal encoder is no better
COARSE = 0.04  # of Ms/c: with larger counts the contact is over before it is seen
RISE_PERIODS = 4.0
SLOW = 1.3


@dataclass(frozen=True)
class PulseCoastHold(CompiledController):
    """The gentlest start, pulse, coast, hold (`softstart.optimal.pulse_coast_hold`), as feedback.

    It measures the motor angle (encoder) and the motor torque, every `period`. It knows the motor, the
    stiffness and damping of the shaft and the load torque; the gap, J2 and, after the first instant, the
    speed of the load it does not. (J2 only enters the defaults of `period` and `patience`.)

    *Pulse.* Ms until the motor is `coast_speed` faster than the load, no more than that with the impulse
    which the lag still holds back: int (demand - u) dt, as measured. Its ratio to u is the mean time D by
    which the torque is late; it replaces the one told. The pulse also tells J1 (a filter of phi1, w1 and
    1/J1). Coasting into the load at the relative speed v swings the shaft to c v/Omega (without Mc), so to
    K_dyn = (v sqrt(c J1)/Ms) sqrt(x (x + 1))/(x + Mc/Ms) with x = J2/J1. That hardly depends on x, and not
    at all on the gap unless the load moves. By default it is a little below 1, from J2 = 2 J1 on.

    *Coast.* No torque, until the encoder is behind the free motor by `certainty` standard deviations of the
    prediction and of the rounding (and 2 of 1/J1, on which the decay of the torque turns: it so is no
    contact). The prediction comes from a filter that stays some samples behind, which has not yet seen the
    contact. The way lost grows with the cube of the time since contact, a c v s^3/6 with a = 1/J1: that tells
    s (`contact`).

    *Contact.* From there an extended Kalman filter on (phi1, w1, z, w2, 1/J2), z the twist beyond the gap,
    first sees the samples since contact, then each new one (`shaft_filter`). 1/J2 begins at
    1/(`inertia_ratio` J1) with a standard deviation of 60 %. `uncertainty` is the share of the twist in a
    sample that the model may miss: it stands for a stiffness that is not the one told. The state is carried
    on by D, and by a sample more without torque: as long as z' is above 0 then, there is none; then there is
    as much as ends at z' = 0. If the gap closes during the pulse, it goes on until the drive, coasting, will
    swing as far as it would have from the coast speed.

    *Hold.* From the peak T = P on

        u = P (J1 + J2)/J2 - Mc J1/J2 + `stiffening` (P - T) - kd T',   kd = 2 damping_ratio J1 Omega/c

    within 0 and Ms, while P rises to `hold_share` of M12avg of the estimated J2 in one elastic period: the
    start then is no longer than it needs to be, and K_dyn the same at every gap. If the gap opens all the
    same, it begins again, with the speed of the load and J2 as estimated and a coast speed that they allow.

    *Where it cannot work* it raises the torque to Ms in four elastic periods of the motor against a held
    load: an encoder count above 4 % of Ms/c (the contact would be over before it is seen), a torque later
    than 1.3 sqrt(J1/c) (lag, dead time and half of what the rate limit takes to Ms), a load that pushes the
    motor, a gap open for the ninth time; and, from the torque of then on, after `patience`.

    Where u >= 0 cannot hold a load back (an active one in a wide gap), K_dyn rises with the gap; so does that
    of the optimum.

    >>> from softstart import Drive, simulate
    >>> crane = Drive.load("crane-4amtkf").replace(torque_lag=0.002, load_kind="reactive")
    >>> worn = crane.replace(gap=2, load_inertia="0.07 kg*m^2")
    >>> [round(simulate(drive, PulseCoastHold(), fitted_to=crane).k_dyn, 2) for drive in (crane, worn)]
    [0.98, 1.0]
    """

    name: ClassVar[str] = "pulse-coast-hold"
    summary: ClassVar[str] = "pulse to a motor speed, coast until the shaft torque peaks, hold the peak"
    source: ClassVar[str] = "softstart: the optimum of docs/optimal-starts.md as feedback"
    effort: ClassVar[Effort | None] = Effort.ENCODER
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = size(STATE)

    coast_speed: float | None = parameter(
        "rad/s",
        "speed relative to the load to which the pulse brings the motor",
        "0.8 Ms/sqrt(c J1) with a reactive load, 0.7 Ms/sqrt(c J1) with an active one",
        multiples=(0.4, 1.6),
    )
    hold_share: float | None = parameter(
        "1",
        "share of M12avg to which the shaft torque is raised after the peak",
        "0.98",
        between=(0.6, 1.0),
    )
    damping_ratio: float | None = parameter("1", "damping ratio of the hold", "0.9", between=(0.2, 1.5))
    stiffening: float | None = parameter(
        "1", "motor torque per missing shaft torque in the hold", "0.5", between=(0.0, 2.0)
    )
    inertia_ratio: float | None = parameter(
        "1", "J2/J1 as first guessed at contact", "3", multiples=(0.3, 4.0)
    )
    certainty: float | None = parameter(
        "1", "standard deviations of the motor's angle that mean contact", "7", between=(4.0, 12.0)
    )
    uncertainty: float | None = parameter(
        "1", "unknown part of the twist in each sample", "0.15", between=(0.01, 0.5)
    )
    patience: float | None = parameter("s", "latest instant for the feedback to act", PATIENCE_DEFAULT)
    period: float | None = parameter("s", "sample period", PERIOD_DEFAULT)

    def __post_init__(self) -> None:
        check(
            self,
            above_zero=("coast_speed", "inertia_ratio", "certainty", "period"),
            not_negative=("hold_share", "damping_ratio", "stiffening", "uncertainty", "patience"),
        )

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """From motor, stiffness and kind of load; J2 enters period and patience, the gap nothing."""
        share = SHARE_ACTIVE if drive.load_kind == "active" else SHARE_REACTIVE
        return {
            "coast_speed": share * drive.Ms / math.sqrt(drive.c * drive.J1),
            "hold_share": HOLD_SHARE,
            "damping_ratio": DAMPING_RATIO,
            "stiffening": STIFFENING,
            "inertia_ratio": INERTIA_RATIO,
            "certainty": CERTAINTY,
            "uncertainty": UNCERTAINTY,
            "patience": patience(drive),
            "period": sample_period(drive),
        }

    def vector(self, drive: Drive) -> Vector:
        """The numbers of `Parameters`."""
        h: Any = self.period
        inertia_ratio: Any = self.inertia_ratio
        a, ratio, rate = 1.0 / drive.J1, 1.0 / inertia_ratio, drive.torque_rate
        windup, count, noise = drive.Ms / drive.c, encoder_count(drive), drive.torque_noise
        free = a * h * math.hypot(TORQUE_DEVIATION * drive.Ms, noise)
        slew, late = drive.Ms / rate, drive.torque_lag + drive.computing_delay
        slewing = 0.5 * slew > late
        delay = late if slewing else late + 0.5 * slew
        Omega1 = math.sqrt(drive.c * a)
        friction = drive.Mc > 0.0 and drive.load_kind == "reactive"
        rounding = count**2 / 12.0 + (FLOOR * windup) ** 2
        return stack(
            h, drive.Ms, drive.Mc, friction, drive.initial_load_speed, drive.c, drive.d, a,
            (J1_DEVIATION * a) ** 2, ratio * a,
            (RATIO_DEVIATION * ratio * a) ** 2, LEAST_RATIO * a, MOST_RATIO * a, self.coast_speed,
            self.hold_share, delay, _samples(drive, self.coast_speed, rounding, self.certainty, delay, h),
            rounding, self.certainty, free**2, math.hypot(SHAFT_DEVIATION * drive.Ms, noise),
            self.uncertainty, LOAD_DEVIATION * drive.Ms, self.damping_ratio, self.stiffening,
            h * Omega1 / (2.0 * math.pi * RISE_PERIODS), self.patience,
            count > COARSE * windup or (0.5 * slew + late) * Omega1 > SLOW, 0.5 / rate if slewing else 0.0,
            rate if math.isfinite(rate) else 0.0,
        )  # fmt: skip


def _samples(drive: Drive, v: Any, rounding: float, certainty: Any, delay: float, period: float) -> int:
    """How many samples the filter of the free motor stays behind."""
    far = 2.0 * certainty * math.sqrt(rounding)
    coasting = math.cbrt(6.0 * far * drive.J1 / (drive.c * v))
    pulsing = (24.0 * far * drive.J1**2 / (drive.c * drive.Ms)) ** 0.25 + delay
    return min(max(math.ceil(max(coasting, pulsing) / period) + 4, 6), RING)
