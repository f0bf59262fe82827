"""Is the oracle of a duty right? Closed forms, conservation laws, mirrored and divided duties."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.duty_oracle import DutyOracle, PhaseEnd, Until
from tests.oracle import Given

J1, J2, C, W0 = 0.4, 1.0, 2000.0, 30.0
REDUCED = J1 * J2 / (J1 + J2)
OMEGA = math.sqrt(C / REDUCED)
PERIOD = 2 * math.pi / OMEGA


def two_masses(**changes: Any) -> Given:
    """Two masses without damping, friction and gap, both at W0."""
    fields: dict[str, Any] = {
        "J": np.array([J1, J2]), "Mc": np.zeros(2), "reactive": np.zeros(2, bool), "w0": np.full(2, W0),
        "c": np.array([C]), "d": np.zeros(1), "gap": np.zeros(1), "law": ["dead-zone"],
        "theta0": np.zeros(1), "ground": np.zeros(2), "tones": [], "restitution": np.full(1, math.nan),
        "motor": 0, "friction": np.zeros(2),
    }  # fmt: skip
    return Given(**fields | {name: np.array(value) for name, value in changes.items()})


def duty(given: Given, **fields: Any) -> DutyOracle:
    return DutyOracle(given, **{"speed": W0, "longest": 100 * PERIOD} | fields)


def first_zero(speed: Callable[[float], float], end: float) -> float:
    """When a speed first falls to 0."""
    t = np.linspace(0.0, end, 5_001)
    first = int(np.argmax([speed(one) < 0.0 for one in t.tolist()]))
    return float(brentq(speed, t[first - 1], t[first], xtol=1e-15))


def test_a_stop_by_constant_torque() -> None:
    """From rest in the twist: w1 = W0 - B/J (t + J2/J1 sin(W t)/W), T swings about its mean, to twice it."""
    B = 25.0
    J, mean = J1 + J2, -B * J2 / (J1 + J2)

    def w1(t: float) -> float:
        return W0 - B / J * (t + J2 / J1 * math.sin(OMEGA * t) / OMEGA)

    stands = first_zero(w1, 2.0 * W0 * J / B)
    run = duty(two_masses())
    end = run.phase(Until("motor", 0.0, -1.0), torque=[(0.0, -B)])
    assert (end.reason, end.w[0]) == ("motor", 0.0)
    assert end.time == pytest.approx(stands, rel=1e-12)
    assert J2 * end.w[1] == pytest.approx(J * W0 - B * stands, abs=1e-10)  # momentum
    assert end.T[0] == pytest.approx(mean * (1 - math.cos(OMEGA * stands)), abs=1e-9)
    assert [end.lowest[0], end.highest[0]] == pytest.approx([2 * mean, 0.0], rel=1e-11, abs=1e-11)
    # then without torque: what is left of the momentum in the mean, and the swing with its energy
    rest = run.phase(Until("time", 10.3 * PERIOD), torque=[(0.0, 0.0)])
    assert J1 * rest.w[0] + J2 * rest.w[1] == pytest.approx(J * W0 - B * stands, abs=1e-10)
    assert rest.energy == pytest.approx(end.energy, rel=1e-11)
    amplitude = math.sqrt(C * (2 * rest.energy - (J * W0 - B * stands) ** 2 / J))
    assert [rest.lowest[0], rest.highest[0]] == pytest.approx([-amplitude, amplitude], rel=1e-10)


def coasting(friction: float = 7.0) -> tuple[DutyOracle, float, float]:
    """Both masses slow down at one rate by friction of the load, with the twist that this takes."""
    a = friction / (J1 + J2)
    twist = J1 * a / C
    given = two_masses(Mc=[0.0, friction], reactive=[False, True], theta0=[twist])
    return duty(given), a, twist


def test_a_coast_by_friction() -> None:
    """The load stands after W0/a and W0^2/2a, and stays; the motor swings on its spring from there on."""
    run, a, twist = coasting()
    end = run.phase(Until("load", 0.0, -1.0))
    assert [end.time, end.phi] == pytest.approx([W0 / a, W0**2 / (2 * a)], rel=1e-11)
    assert [end.lowest[0], end.highest[0]] == pytest.approx([J1 * a, J1 * a], rel=1e-8)
    assert end.w == pytest.approx([0.0, 0.0], abs=1e-9)
    rest = run.phase(Until("time", 3.5 * 2 * math.pi * math.sqrt(J1 / C)))
    assert (rest.w[1], rest.phi) == (0.0, pytest.approx(end.phi, abs=1e-12))
    assert rest.twist[0] == pytest.approx(-twist, rel=1e-7)
    assert [rest.lowest[0], rest.highest[0]] == pytest.approx([-C * twist, C * twist], rel=1e-7)


def test_the_braking_distance_of_a_coulomb_brake() -> None:
    """It closes after a delay on a free motor, which stands before the load; that swings on."""
    brake, delay = 60.0, 0.13
    a = brake / (J1 + J2)

    def w1(t: float) -> float:
        return W0 - a * (t + J2 / J1 * math.sin(OMEGA * t) / OMEGA)

    stands = first_zero(w1, 2.0 * W0 / a)
    run = duty(two_masses(), band=0.01)
    run.phase(Until("time", delay))
    run.brake = brake
    end = run.phase(Until("motor", 0.0, -1.0))
    assert end.time == pytest.approx(delay + stands, rel=1e-12)
    twist = -J2 * a / C * (1 - math.cos(OMEGA * stands))
    phi2 = W0 * (delay + stands) - a * (stands**2 / 2) - J1 / (J1 + J2) * twist
    assert end.twist[0] == pytest.approx(twist, rel=1e-9)
    assert end.phi == pytest.approx(phi2, rel=1e-11)
    # the load swings against the brake, which holds as long as the shaft torque is below its friction
    assert abs(end.T[0]) < brake
    after = run.phase(Until("time", 0.01 * PERIOD))
    assert after.w[0] == 0.0
    rate, t = math.sqrt(C / J2), 0.01 * PERIOD
    expected = -end.w[1] / rate * math.sin(rate * t) + twist * math.cos(rate * t)
    assert after.twist[0] == pytest.approx(expected, rel=1e-9)
    # opened while it stands: all goes on from this twist, with the momentum of the load alone
    run.brake = 0.0
    free = run.phase(Until("time", 3.0 * PERIOD))
    assert J1 * free.w[0] + J2 * free.w[1] == pytest.approx(J2 * after.w[1], abs=1e-10)
    assert free.energy == pytest.approx(after.energy, rel=1e-11)


def test_a_lock_holds_until_it_opens_and_torque_proving() -> None:
    """An active load on the locked motor swings about Mc; proved where the torque in a line reaches T."""
    Mc = 50.0
    given = two_masses(Mc=[0.0, Mc], w0=[0.0, 0.0], theta0=[Mc / C])
    run = duty(given)
    run.brake = math.inf
    held = run.phase(Until("time", 3.0 * PERIOD), torque=[(0.0, 0.0)])
    assert [*held.w, held.phi] == pytest.approx([0.0, 0.0, 0.0], abs=1e-10)
    proved = run.phase(Until("proved", 0.0, 1.0), torque=[(0.0, 0.0, 400.0)])
    assert proved.time - held.time == pytest.approx(Mc / 400.0, rel=1e-9)
    assert proved.w == pytest.approx([0.0, 0.0], abs=1e-9)
    run.brake = 0.0
    up = run.phase(Until("time", 2.0 * PERIOD))
    t = 2.0 * PERIOD  # the torque goes on rising from Mc: momentum is 400 t^2/2
    assert J1 * up.w[0] + J2 * up.w[1] == pytest.approx(200.0 * t**2, rel=1e-8)
    # lifted, then let down by another load: the momentum follows the sum of the torques
    run.load(Mc=20.0, J=2.0)
    before = J1 * up.w[0] + 2.0 * up.w[1]
    down = run.phase(Until("time", PERIOD), torque=[(0.0, 5.0)])
    assert J1 * down.w[0] + 2.0 * down.w[1] == pytest.approx(before + (5.0 - 20.0) * PERIOD, abs=1e-9)


def test_when_all_masses_stand() -> None:
    """The motor swings on a load that sticks, damped: the last time that its speed enters the band."""
    d, friction, twist, band, dwell = 6.0, 500.0, 0.05, 0.02, 0.4
    given = two_masses(w0=[0.0, 0.0], theta0=[twist], d=[d], Mc=[0.0, friction], reactive=[False, True])
    decay = d / (2 * J1)
    rate = math.sqrt(C / J1 - decay**2)

    def w1(t: Any) -> Any:
        return -twist * (C / J1) / rate * np.exp(-decay * t) * np.sin(rate * t)

    t = np.linspace(0.0, 3.0, 30_001)
    last = int(np.flatnonzero(np.abs(w1(t)) > band)[-1])
    enters = brentq(lambda t: abs(w1(t)) - band, t[last], t[last + 1], xtol=1e-15)
    run = duty(given, band=band)
    run.watch()
    end = run.phase(Until("stand", dwell))
    assert end.reason == "stand"
    assert [end.since, end.time] == pytest.approx([enters, enters + dwell], rel=1e-8)
    again = run.phase(Until("stand", 2.0 * dwell))
    assert [again.since, again.time] == pytest.approx([enters, enters + 3.0 * dwell], rel=1e-8)


def test_lag_and_slew_go_on_over_phases() -> None:
    """The limiter ramps through a phase, the lag follows: u = r - rate lag (1 - exp(-t/lag))."""
    lag, rate = 0.02, 300.0
    run = duty(two_masses(), lag=lag, rate=rate)
    first = run.phase(Until("time", 0.05), torque=[(0.0, 40.0)])
    second = run.phase(Until("time", 0.07))
    for end in (first, second):
        u = rate * (end.time - lag * -math.expm1(-end.time / lag))
        assert end.u == pytest.approx(u, rel=1e-12)
    # a demand of 0 from here on: the limiter comes down from 36, not from u
    third = run.phase(Until("time", 0.3), torque=[(0.0, 0.0)])
    falls = 36.0 / rate
    at_end = second.u + 0.0
    u = 36.0 + rate * lag - rate * falls + (at_end - 36.0 - rate * lag) * math.exp(-falls / lag)
    assert third.u == pytest.approx(u * math.exp(-(0.3 - falls) / lag), rel=1e-9)
    momentum = (J1 + J2) * W0 - lag * third.u + 36.0**2 / 2 / rate + 36.0 * falls / 2  # the integral of u
    assert J1 * third.w[0] + J2 * third.w[1] == pytest.approx(momentum, rel=1e-12)


def test_the_energy_of_an_impact() -> None:
    """Through half the gap under constant torque: v^2 = u gap/J1 as the flanks meet; with a lock v = w2."""
    u, gap = 12.0, 0.4
    given = two_masses(gap=[gap], law=["no-pull"], w0=[0.0, 0.0])
    run = duty(given)
    end = run.phase(Until("time", 1.01 * math.sqrt(gap * J1 / u)), torque=[(0.0, u)])
    assert end.impacts == pytest.approx([0.5 * REDUCED * u * gap / J1], rel=1e-11)
    run = duty(two_masses(gap=[gap], law=["no-pull"], w0=[0.0, -3.0]))
    run.brake = math.inf
    assert run.phase(Until("time", 0.07)).impacts == pytest.approx([0.5 * J2 * 9.0], rel=1e-11)


GAP: dict[str, Any] = {
    "gap": [0.4], "law": ["no-pull"], "d": [4.0], "w0": [0.0, 0.0], "Mc": [0.5, 6.0], "reactive": [True, True]
}  # fmt: skip


def there_and_back(run: DutyOracle, way: float = 1.0, cut: float = 1.0) -> list[PhaseEnd]:
    """Start, ramp to the load torque, hold, stop by torque, brake, load change, jog."""
    found = []

    def phase(*until: Until, torque: list[Any] | None = None) -> None:
        if cut < 1.0:
            first = run.phase(*until, Until("time", 0.4 * PERIOD), torque=torque)
            if first.reason != "time" or until[0] == ("time", 0.4 * PERIOD, 1.0):
                found.append(first)
                return
            torque = None
            until = tuple(shortened(run, one) for one in until)
        found.append(run.phase(*until, torque=torque))

    run.watch(False)
    phase(Until("load", way * 12.0, way), torque=[(0.0, way * 10.0), (0.3, way * 60.0, way * 100.0)])
    phase(Until("time", PERIOD), torque=[(0.0, run.demand, (way * 6.5 - run.demand) / PERIOD)])
    phase(Until("angle", way * 1.0, way), torque=[(0.0, way * 6.5)])
    phase(Until("motor", way * 3.0, -way), torque=[(0.0, -way * 40.0)])
    run.watch()
    run.brake = 20.0
    phase(Until("stand", 0.6 * PERIOD), torque=[(0.0, 0.0)])
    run.load(J=1.7, Mc=9.0)
    run.brake = 0.0
    run.watch(False)
    phase(Until("time", PERIOD), torque=[(0.0, -way * 30.0)])
    run.watch()
    phase(Until("stand", 0.6 * PERIOD), torque=[(0.0, 0.0)])
    return found


def shortened(run: DutyOracle, one: Until) -> Until:
    """What is left of it after 0.4 periods."""
    left = {"time": 0.4 * PERIOD, "angle": travel(run)}
    if one.kind == "stand" and not math.isnan(run.ends[-1].since):
        left["stand"] = run.time - max(run.ends[-1].since, run.ends[-1].begin)
    return one._replace(value=one.value - left.get(one.kind, 0.0))


def travel(run: DutyOracle) -> float:
    end = run.ends[-1]
    return end.phi - (run.ends[-2].phi if len(run.ends) > 1 else 0.0)


def same(mine: list[PhaseEnd], theirs: list[PhaseEnd], way: float = 1.0, within: float = 1e-9) -> None:
    """The ends of phases are equal, or mirrored for a `way` of -1."""
    assert [one.reason for one in mine] == [one.reason for one in theirs]
    for one, other in zip(mine, theirs, strict=True):
        assert one.time == pytest.approx(other.time, rel=within)
        assert one.since == pytest.approx(other.since, rel=within, nan_ok=True)
        for name, scale in (("twist", 0.4), ("w", 12.0), ("T", 60.0), ("u", 60.0), ("phi", 4.0)):
            expected = way * np.asarray(getattr(other, name))
            assert np.asarray(getattr(one, name)) == pytest.approx(expected, abs=within * scale), name


FIELDS = {"at-once": {}, "lag": {"lag": 0.01, "rate": 2000.0}}


def divided(torque: str, way: float = 1.0, cut: float = 1.0, rtol: float = 1e-12) -> list[PhaseEnd]:
    fields = {"band": 0.12, "speed": 12.0, "rtol": rtol} | FIELDS[torque]
    return there_and_back(duty(two_masses(**GAP), **fields), way, cut)


whole = cache(divided)


@pytest.mark.parametrize("torque", FIELDS)
def test_a_mirrored_duty(torque: str) -> None:
    back = divided(torque, -1.0)
    same(whole(torque), back, -1.0)
    for one, other in zip(whole(torque), back, strict=True):
        assert one.highest == pytest.approx(-other.lowest, abs=1e-8)
        assert one.energy == pytest.approx(other.energy, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("torque", FIELDS)
def test_a_finer_tolerance_changes_nothing(torque: str) -> None:
    same(whole(torque), divided(torque, rtol=1e-13))


@pytest.mark.parametrize("torque", FIELDS)
def test_a_phase_cut_in_two(torque: str) -> None:
    same(whole(torque), divided(torque, cut=0.5))


def test_a_phase_that_is_over_at_once_and_one_that_never_ends() -> None:
    run = duty(two_masses(), longest=PERIOD)
    end = run.phase(Until("load", 20.0, 1.0), torque=[(0.0, 10.0)])
    assert (end.reason, end.time) == ("load", 0.0)
    with pytest.raises(RuntimeError, match="does not end"):
        run.phase(Until("load", 20.0, -1.0), torque=[(0.0, 10.0)])
