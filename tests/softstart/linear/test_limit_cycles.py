"""Limit cycles through the gap: predicted by the describing function, seen on the exact plant."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.softstart.linear.speed_loops import FREE, SpeedPI, loop_of
from tests.twin import chain_of

from softstart import linear_view
from softstart.linear.limit_cycles import n_at, share

# speed control behind a slow actuator: stable while the flank presses, not with the load let go
SLOW = FREE.replace(
    torque_lag=0.02, computing_delay=0.01, damping=2.0, contact_law="dead-zone", load_torque=0.0
)


@pytest.fixture(scope="module")
def unbiased():
    return linear_view(SLOW, SpeedPI(4.0, 20.0))


def test_a_known_cycle_without_load_torque(unbiased):
    """Measured on the exact plant, from the predicted cycle on, after 60 periods."""
    assert unbiased.stable
    (found,) = unbiased.cycles
    assert found.stable
    assert (found.bias, found.mean_torque) == (0.0, 0.0)
    assert found.confirmed
    # one harmonic of a twist whose shaft torque is zero for a third of the time: a few per cent
    assert found.measured_frequency == pytest.approx(found.frequency, rel=0.04)
    assert found.measured_amplitude == pytest.approx(found.amplitude, rel=0.08)


def test_a_chain_of_two_masses_has_the_cycles_of_its_drive(unbiased):
    (mine,), (same,) = unbiased.cycles, linear_view(chain_of(SLOW), SpeedPI(4.0, 20.0)).cycles
    assert same.frequency == pytest.approx(mine.frequency, rel=1e-9)
    assert same.measured_amplitude == pytest.approx(mine.measured_amplitude, rel=1e-6)


def test_harmonic_balance_holds_at_the_cycle(unbiased):
    cycle = unbiased.cycles[0]
    n = share(cycle.amplitude, 0.5 * SLOW.gap)
    contact = complex(unbiased.outside.contact(np.array([cycle.frequency]))[0])
    assert abs(1.0 + n * contact) < 1e-8


def test_the_cycle_is_reached_from_the_start_itself():
    """A start of the same drive, without any help, ends in the cycle that was predicted."""
    from softstart import simulate

    view = linear_view(SLOW, SpeedPI(4.0, 20.0, reference=60.0))
    found = view.cycles[0]
    run = simulate(SLOW.replace(target_speed=1e6), SpeedPI(4.0, 20.0, reference=60.0), 6.0, time_limit=10.0)
    late = np.linspace(5.0, 6.0, 4001)
    twist = run.at(late)["theta"]
    assert 0.5 * np.ptp(twist) == pytest.approx(found.measured_amplitude, rel=1e-2)


def test_with_a_load_torque_the_cycle_is_biased():
    view = linear_view(SLOW.replace(load_torque=7.16), SpeedPI(4.0, 20.0))
    assert [one.stable for one in view.cycles] == [False, True]
    small, large = view.cycles
    assert large.confirmed
    for one in (small, large):
        assert one.mean_torque == pytest.approx(7.16)
        assert one.bias > 0.0
        n = n_at(one.amplitude, 0.25, SLOW.c, 7.16)
        contact = complex(view.outside.contact(np.array([one.frequency]))[0])
        assert abs(1.0 + n * contact) < 1e-7
    assert "boundary" in small.verdict


def test_a_boundary_between_rest_and_vibration():
    drive = SLOW.replace(damping=0.5)
    view = linear_view(drive, SpeedPI(1.0, 20.0))
    low, high = view.cycles
    assert (low.stable, high.stable) == (False, True)
    assert low.confirmed
    # the large one is there, but with so little damping a small part of the energy decides about it, which
    # one harmonic does not tell well: the verdict says so, and by how much
    assert not high.confirmed
    assert high.verdict.startswith("there is a limit cycle, further off")
    assert f"{100 * (high.measured_frequency / high.frequency - 1):+.1f} %" in high.verdict


def test_torque_limits_are_told():
    view = linear_view(SLOW.replace(maximum_torque=100.0, minimum_torque=-100.0), SpeedPI(4.0, 20.0))
    (found,) = view.cycles
    assert found.beyond_limits
    assert found.demand_amplitude > 100.0


def test_no_gap_no_cycle():
    assert linear_view(SLOW.replace(gap=0.0), SpeedPI(4.0, 20.0)).cycles == ()


def test_the_loop_outside_of_the_shaft_closes_to_the_loop_in_contact():
    """With n = 1 the balance is that of the contact: at the gain margin both pass through -1 together.

    The harmonic balance keeps one harmonic of the held demand, so it is near, not equal.
    """
    view = loop_of(SLOW, SpeedPI(4.0, 20.0))
    (crossing,) = [one for one in view.margins.phase_crossovers if one.margin == view.gain_margin]
    critical = loop_of(SLOW, SpeedPI(4.0 * view.gain_margin, 20.0 * view.gain_margin))
    contact = complex(critical.outside.contact(np.array([crossing.frequency]))[0])
    assert abs(contact + 1.0) < 5e-3
    assert math.isclose(critical.gain_margin, 1.0, rel_tol=1e-6) or critical.gain_margin > 1.0
