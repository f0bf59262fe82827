"""A lag and a slew limiter of any length before a start, against 80-digit arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal, localcontext

import pytest

from softstart import Drive, simulate

CRANE = Drive.load("crane-4amtkf")


def root_of(f: Callable[[Decimal], Decimal], low: float, high: float) -> float:
    """Where f rises through zero, in the arithmetic of the caller."""
    below, above = Decimal(low), Decimal(high)
    for _ in range(160):
        middle = (below + above) / 2
        below, above = (middle, above) if f(middle) < 0 else (below, middle)
    return float(above)


@pytest.mark.parametrize("lag", [1e-2, 1.0, 1e2, 1e4, 1e6, 1e9])
@pytest.mark.parametrize("rise", [1e-9, 1e-6, 1e-3, 0.05])
def test_first_contact_behind_any_lag_and_limit(lag: float, rise: float) -> None:
    """From mid-gap: the torque of the ramp behind the lag, twice integrated, less that of the ramp's end."""
    drive = CRANE.replace(
        torque_lag=lag, torque_rate=float(CRANE.Ms) / rise, start_position="mid-gap", load_torque=1e-9
    )
    run = simulate(drive, "direct", until=200.0)
    with localcontext() as context:
        context.prec = 80
        L, R, D = Decimal(lag), Decimal(float(drive.torque_rate)), Decimal(float(drive.Ms))
        J1, J2, half = Decimal(float(drive.J1)), Decimal(float(drive.J2)), Decimal(float(drive.gap)) / 2
        Mc, end = Decimal(float(drive.Mc)), D / R

        def ramp(t: Decimal) -> Decimal:
            """The second integral of a ramp behind the lag."""
            return R * (t**3 / 6 - L * t**2 / 2 + L**2 * t - L**3 * (1 - (-t / L).exp()))

        def twist(t: Decimal) -> Decimal:
            u = ramp(t) - (ramp(t - end) if t > end else 0)
            return u / J1 + Mc * t**2 / (2 * J2) - half

        contact = root_of(twist, 0.0, 200.0)
    assert run.first_contact == pytest.approx(contact, rel=2e-13)


@pytest.mark.parametrize("lag", [0.0, 1e-9, 1e-6, 0.01])
@pytest.mark.parametrize("damping", [0.0, 0.6])
def test_a_limiter_without_effect_has_none(lag: float, damping: float) -> None:
    """Wound up from the driving flank: a limiter that slews in 1e-10 s and less hardly counts."""
    drive = CRANE.replace(start_position="driving-flank", damping=damping, torque_lag=lag)
    step = simulate(drive, "direct", until=0.4)
    for rate in (1e12, 1e14, 1e16, 1e18, 1e24):
        run = simulate(drive.replace(torque_rate=rate), "direct", until=0.4)
        near = 1e-12 + 100.0 * 62.0 / rate  # the slewing, s, times rates of change of no more than 100/s
        assert run.peak_torque == pytest.approx(step.peak_torque, rel=near), rate
        mine, theirs = run.at(0.3), step.at(0.3)
        for name in ("w1", "w2", "T"):
            assert float(mine[name]) == pytest.approx(float(theirs[name]), rel=near), rate
