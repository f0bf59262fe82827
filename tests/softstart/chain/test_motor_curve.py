"""A motor torque over speed as a load curve of the rotor, against an integrator of its own."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from softstart import InputError, compare, simulate
from softstart.chain import Chain, Mass, Motor, Shaft, reduce_chain

RPM = math.pi / 30.0
SPEEDS = np.array([0.0, 600.0, 1200.0, 1400.0, 1450.0, 1500.0]) * RPM
TORQUES = np.array([10.0, 9.0, 14.0, 25.0, 20.0, 0.0]) * 1e3  # of an induction motor, direct on line
J1, J2, C, D, LOAD = 80.0, 50.0, 5e6, 500.0, 1000.0


def chain(starting_torque: float, curve: np.ndarray, ratio: float = 1.0, unit: float = 1.0) -> Chain:
    """Motor and mill; the mill behind a gear of this ratio, speeds of the curve in rpm if `unit` is so."""
    at = [f"{speed / RPM:.17g} rpm" for speed in SPEEDS] if unit == RPM else SPEEDS.tolist()
    rotor = Mass(J1, name="rotor", curve_speed=at, curve_torque=curve.tolist())
    mill = Mass(J2 * ratio**2, torque=LOAD * ratio, kind="reactive", name="mill")
    shaft = Shaft(C, damping=D, ratio=ratio)
    return Chain([rotor, mill], [shaft], Motor(starting_torque), target_speed=1480 * RPM)


@cache
def by_hand(more: float) -> tuple[float, float, float]:
    """Peak torque, its instant and the start time: the mill sticks to LOAD, then both turn."""

    def motor(w: float) -> float:
        return more + float(np.interp(w, SPEEDS, TORQUES))

    def held(_: float, y: np.ndarray) -> list[float]:
        return [y[1], (motor(y[1]) - C * y[0] - D * y[1]) / J1]

    def lets_go(_: float, y: np.ndarray) -> float:
        return C * y[0] + D * y[1] - LOAD

    def turns(_: float, y: np.ndarray) -> list[float]:
        torque = C * y[0] + D * (y[1] - y[2])
        return [y[1] - y[2], (motor(y[1]) - torque) / J1, (torque - LOAD) / J2]

    def there(_: float, y: np.ndarray) -> float:
        return y[2] - 1480 * RPM

    lets_go.terminal = there.terminal = True  # type: ignore[attr-defined]
    exact = {"rtol": 1e-10, "atol": 1e-12, "method": "DOP853"}
    first = solve_ivp(held, (0.0, 1.0), [0.0, 0.0], events=lets_go, **exact)
    begin = [*first.y[:, -1], 0.0]
    then = solve_ivp(turns, (first.t[-1], 3.0), begin, events=there, dense_output=True, **exact)
    assert then.y[2].min() >= 0.0, "the mill never stops again"
    t = np.linspace(first.t[-1], then.t[-1], 100_001)
    x, w1, w2 = then.sol(t)
    torque = C * x + D * (w1 - w2)
    return float(torque.max()), float(t[torque.argmax()]), float(then.t[-1])


@pytest.mark.parametrize("ratio", [1.0, 4.0])
@pytest.mark.parametrize(("starting", "curve"), [(1.0, -TORQUES), (2e3, -TORQUES), (10e3, 10e3 - TORQUES)])
def test_the_curve_starts_the_machine_whatever_the_motor_adds(starting, curve, ratio) -> None:
    """Alone, beside a constant torque, and as the difference to the torque at standstill."""
    more = starting if starting < 10e3 else 0.0
    run = simulate(chain(starting, curve, ratio, RPM), "direct")
    peak, at, start_time = by_hand(more)
    assert run.peak_torque == pytest.approx(peak, rel=1e-6)
    assert run.peak_time == pytest.approx(at, rel=2e-5)
    assert run.start_time == pytest.approx(start_time, rel=1e-8)
    if more == 2e3:
        assert (peak, at) == pytest.approx((11067.83, 1.578864), rel=2e-5)
    assert bool(run.drive.warnings) == (starting < LOAD)
    if starting == 10e3:  # the torque at standstill is what K_dyn refers to
        assert run.base_torque == pytest.approx((10e3 * J2 + LOAD * J1) / (J1 + J2), rel=1e-12)


def test_who_cannot_start_is_told_and_who_can_is_not() -> None:
    weak = chain(1.0, -0.09 * TORQUES)  # 900 N m at standstill, against 1000
    with pytest.raises(InputError, match="nor do load curves over speed drive it"):
        simulate(weak, "direct", fitted_to=chain(2e3, -TORQUES))
    dip = chain(1.0, -np.array([10e3, 500.0, 14e3, 25e3, 20e3, 0.0]))  # sticks at 600 rpm
    with pytest.raises(InputError, match="nor do load curves"):
        simulate(dip, "direct")
    assert math.isnan(simulate(dip, "direct", 3.0).start_time)
    braking = chain(1.0, TORQUES)
    with pytest.raises(InputError, match="nor do load curves"):
        simulate(braking, "direct")


def test_all_that_takes_a_chain_takes_one_that_its_curve_drives() -> None:
    machine = chain(1.0, -TORQUES)
    assert reduce_chain(machine).to_drive().load_torque == 0.0, "the curve carries the load"
    part = chain(200.0, -0.09 * TORQUES)
    assert reduce_chain(part).to_drive().load_torque == pytest.approx(1000.0 - 900.0)
    assert reduce_chain(chain(2e3, -TORQUES)).to_drive().load_torque == 1000.0, "the motor moves it by itself"
    (row,) = compare(machine, ["direct"]).rows
    assert row.run.peak_torque == simulate(machine, "direct").peak_torque
    assert simulate([machine, machine], "direct").peak_torque.values.tolist() == [row.run.peak_torque] * 2
