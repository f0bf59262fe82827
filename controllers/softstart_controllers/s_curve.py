"""Torque ramp with rounded ends: what every inverter offers as S-curve."""

from __future__ import annotations

from dataclasses import dataclass

from softstart.controller import Numbers, parameter
from softstart.drive import Drive
from softstart_controllers.ramp import Ramp


@dataclass(frozen=True)
class SCurve(Ramp):
    """Torque that rises in an S: its rate is a trapezoid over time, so the jerk of the motor is limited.

    With x = t_k/time, e = rounding/2 and the samples t_k = k `period`, each held until the next one:

        u(t_k) = initial + (full_torque - initial) s(x)
        s(x) = x^2/(2 e (1 - e))               x < e
               (x - e/2)/(1 - e)               e <= x <= 1 - e
               1 - (1 - x)^2/(2 e (1 - e))     x > 1 - e

    rounding = 0 is the ramp, 1 (default) has no straight part. By default it begins with the load torque and
    takes two elastic periods: the full S is a ramp over one elastic period passed through a mean over another
    one, and each alone leaves no oscillation in a closed, undamped drive; so it is forgiving where the
    elastic frequency is not well known.

    Source: practice of inverters.

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), SCurve(initial=0, time=0.1))
    >>> run.at([0.0255, 0.0505, 0.0755])["u"].round(9).tolist()
    [7.75, 31.0, 54.25]
    """

    name = "s-curve"
    summary = "torque rises in an S from the load torque to the starting torque"

    # fmt: off
    rounding: float = parameter("1", "share of the time spent in the rounded ends", 1.0,
        limit="from 0 to 1", between=(0.0, 1.0))
    # fmt: on

    def numbers(self, drive: Drive) -> Numbers:
        """None beside the parameters."""
        return {}
