"""Closed forms, limits and scaling of an engagement."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

from softstart.clutch import LAWS, Clutch, engage
from softstart.clutch.motion import first_crossing, roots

PAPER = Clutch.load("paper-c")


def linear_torque(clutch, t):
    """T(t) of (4) and (5) under the linear law: a ramp up to tM, less the same ramp begun there."""
    IM, Ic, B, tM = clutch.clutch_inertia, clutch.load_inertia, clutch.B, clutch.engagement_time
    ramps = [np.where(s > 0.0, s - np.sin(B * s) / B, 0.0) for s in (t, t - tM)]
    swing = clutch.load_torque * IM / (IM + Ic) * (1.0 - np.cos(B * t))
    return Ic / (IM + Ic) * clutch.clutch_torque / tM * (ramps[0] - ramps[1]) + swing


def rigid_slip_time(clutch):
    """w0 (IM + Ic) = integral of M - Mc, with the means of the laws over 0 .. tM = 1 s, T = 1 s."""
    e = math.e
    mean = {"linear": 1 / 2, "quadratic-concave": 2 / 3, "quadratic-convex": 1 / 3}
    mean["exponential"] = (e - 2) / (e - 1)
    inertia = clutch.clutch_inertia + clutch.load_inertia
    left = clutch.drive_speed * inertia - (mean[clutch.law] * clutch.clutch_torque - clutch.load_torque)
    return 1.0 + left / (clutch.clutch_torque - clutch.load_torque)


@pytest.mark.parametrize("load_torque", [0.0, 196.133])
def test_linear_law_is_the_closed_form(load_torque):
    clutch = PAPER.replace(load_torque=load_torque)
    run = engage(clutch)
    t = np.linspace(0.0, run.slip_time, 2001)
    assert run.at(t)["T"] == pytest.approx(linear_torque(clutch, t), abs=1e-11 * clutch.clutch_torque)


def test_the_work_while_engaging_ends_with_the_law():
    """Of friction torque times slip up to tM, by the trapezoidal rule: what slips on is no part of it."""
    run = engage(PAPER)
    t = np.linspace(0.0, PAPER.engagement_time, 100_001)
    states = run.at(t)
    assert run.work_while_engaging == pytest.approx(trapezoid(states["F"] * states["slip"], t), rel=1e-9)
    assert run.work_while_engaging < 0.5 * run.slip_work


def test_without_load_and_with_a_stiff_shaft_friction_takes_what_the_masses_get():
    # L = I w0^2/2 whatever the law: the classical result, here up to what the oscillation keeps
    for law in LAWS:
        clutch = PAPER.replace(law=law, load_torque=0.0, stiffness=PAPER.stiffness * 1e4)
        inertia = clutch.clutch_inertia + clutch.load_inertia
        run = engage(clutch, until=3.5)
        assert run.slip_work == pytest.approx(0.5 * inertia * clutch.drive_speed**2, rel=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_a_stiff_shaft_slips_as_long_as_a_rigid_one(law):
    errors = []
    for stiffer in (1e2, 1e4):
        clutch = PAPER.replace(law=law, stiffness=PAPER.stiffness * stiffer)
        run = engage(clutch, until=1.01 * rigid_slip_time(clutch))
        errors.append(abs(run.slip_time - rigid_slip_time(clutch)))
    assert errors[0] < 0.1
    assert errors[1] < 0.02
    assert errors[1] < errors[0] + 1e-12


@pytest.mark.parametrize(
    ("Ic", "Mc", "stiffness", "speed", "gap", "rises"),
    [(0.1, 5.0, 65.6, 48.0, 15.24, 0.8), (1.0, 10.0, 191.4, 36.0, 0.26, 0.5)],
)
def test_a_run_with_a_gap_lasts_until_the_peak_of_the_locked_cycle(Ic, Mc, stiffness, speed, gap, rises):
    """Locked and without damping E = Ic v^2/2 + cp z^2/2 - Mc theta stays: at the driving flank's peak v = 0.

    At lock-up the twist falls; the peak comes after it has turned at the far side and crossed the gap again.
    """
    run = engage(
        Clutch(
            clutch_inertia=0.2, load_inertia=Ic, clutch_torque=100.0, load_torque=Mc,
            stiffness=stiffness, drive_speed=speed, engagement_time=rises, gap=gap,
        )
    )  # fmt: skip
    locked = run.at(run.slip_time)
    theta, v = float(locked["theta"][0]), speed - float(locked["wc"][0])
    assert v < 0.0
    inside = max(theta - 0.5 * gap, 0.0)
    energy = 0.5 * Ic * v**2 + 0.5 * stiffness * inside**2 - Mc * theta
    peak = Mc + math.sqrt(Mc**2 + 2.0 * stiffness * (energy + 0.5 * Mc * gap))
    assert [event.name for event in run.events].count("locked") == 1
    assert run.locked_peak_torque == pytest.approx(peak, rel=1e-10)


def test_units_and_scales():
    in_si = Clutch(
        clutch_inertia=0.980665, clutch_torque=588.399, drive_speed=230.0, engagement_time=1.0,
        stiffness=49.03325, load_inertia=4.903325, load_torque=196.133,
    )  # fmt: skip
    one, other = engage(PAPER), engage(in_si)
    assert one.peak_torque == pytest.approx(other.peak_torque, rel=1e-14)
    assert one.slip_work == pytest.approx(other.slip_work, rel=1e-14)
    # time by 2: speeds halve, stiffness and torque fall to a quarter with the inertias kept
    slow = PAPER.replace(
        engagement_time=2.0, drive_speed=115.0, stiffness=PAPER.stiffness / 4,
        clutch_torque=PAPER.clutch_torque / 4, load_torque=PAPER.load_torque / 4,
    )  # fmt: skip
    run, first = engage(slow), one
    assert run.slip_time == pytest.approx(2.0 * first.slip_time, rel=1e-13)
    assert run.slip_work == pytest.approx(first.slip_work / 4, rel=1e-13)


def test_roots_of_a_step():
    random = np.random.default_rng(1)
    for _ in range(60):
        known = np.sort(random.choice(np.arange(1, 100), random.integers(1, 6), replace=False)) / 100.0
        a = np.poly([*known, *random.uniform(1.2, 4.0, 3)])[::-1]
        # five roots a hundredth apart: 1e-16 times the condition
        assert roots(a) == pytest.approx(known, abs=1e-9)
        assert first_crossing(a if a[0] < 0.0 else -a) == pytest.approx(known[0], abs=1e-9)
