"""Torque is never cut off in silence: how far and for how long a demand lay beyond the limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from softstart import Drive, TorqueProfile, compare, simulate
from softstart.controller import Controller, make_controller, ready_controller_names
from softstart.views import starts

CRANE = Drive.load("crane-4amtkf")  # 0 to 64 N m, Ms 62 N m
ABOVE = TorqueProfile([0.0, 0.1, 0.1, 0.3, 0.4], [0.0, 128.0, 20.0, 20.0, -30.0])
END = 0.5
# 64 to 128 N m in 50 ms; below 0 N m from 0.34 s on
WANTED = (64.0, 0.05 + END - 0.34)


def played(profile: TorqueProfile, **parameters: Any) -> Controller:
    return make_controller("profile", {"profile": profile, **parameters})


def test_a_profile_beyond_the_limits_is_measured_in_closed_form() -> None:
    run = simulate(CRANE, played(ABOVE), END)
    for one in (run, simulate("crane-4-mass", played(ABOVE), END)):
        np.testing.assert_allclose(one.clipped, WANTED, rtol=1e-12)
    when = np.linspace(0.0, END, 1001)[:-1]
    np.testing.assert_allclose(run.at(when)["u"], np.clip(ABOVE.at(when), 0.0, 64.0), atol=1e-9)


def test_a_constant_demand_is_cut_off_to_the_end_of_the_run() -> None:
    """Lag and rate limit are no clipping."""
    run = simulate(CRANE, make_controller("direct", {"torque": "80 N*m"}))
    assert run.clipped == (16.0, run.end_time)
    slow = CRANE.replace(torque_lag=0.02, torque_rate=300.0)
    assert simulate(slow, "direct").clipped == (0.0, 0.0)
    for name in ready_controller_names({}):
        assert simulate(CRANE, name).clipped == (0.0, 0.0), name


def test_a_profile_obeys_the_limits_of_the_machine_that_runs() -> None:
    """Set up for a drive that cannot brake, it brakes one that can."""
    braking = TorqueProfile([0.0, 0.1, 0.2], [40.0, 40.0, -50.0])
    both = CRANE.replace(minimum_torque=-64.0)
    run = simulate(both, played(braking), END, fitted_to=CRANE)
    assert run.at(0.3)["u"] == -50.0
    assert run.clipped == (0.0, 0.0)
    other = simulate(CRANE, played(braking), END, fitted_to=both)
    assert other.at(0.3)["u"] == 0.0
    np.testing.assert_allclose(other.clipped, (50.0, END - 0.1 - 0.1 * 40.0 / 90.0), rtol=1e-12)


def test_it_is_said_once() -> None:
    sentence = "up to 64 N m beyond the limits 0 and 64 N m, for 0.21 s"
    table = compare(CRANE, [played(ABOVE)], until=END)
    assert sum(sentence in note for note in starts.remarks(table)) == 1
    run = table.rows[0].run
    assert sum(sentence in text for row in starts.figure_rows(run) for text in row) == 1
    assert starts.outcome(run).startswith(run.status.value)
    assert sentence in starts.outcome(run)
