"""The drive in python-control, against closed forms and an independent event-located integration."""

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from softstart.drive import Drive
from softstart.drive.control_systems import initial_state, shaft_torque

TIGHT = {"rtol": 1e-10, "atol": 1e-12, "max_step": 1e-3}


@pytest.fixture
def crane():
    return Drive.load("crane-4amtkf")


def start(drive, until, demand, points=2001):
    system = drive.to_control(nonlinear=True)
    t = np.linspace(0.0, until, points)
    response = control.input_output_response(
        system,
        t,
        np.full_like(t, demand),
        initial_state(drive),
        solve_ivp_method="DOP853",
        solve_ivp_kwargs=TIGHT,
    )
    return t, dict(zip(system.output_labels, response.outputs, strict=True))


def test_in_contact_names_and_poles(crane):
    system = crane.to_control()
    assert isinstance(system, control.StateSpace)
    assert system.input_labels == ["motor_torque", "load_torque"]
    assert system.state_labels == ["z", "w1", "w2"]
    assert system.output_labels == ["z", "w1", "w2", "shaft_torque"]
    assert system.name == "Crane_travel_drive_4AMTKF_H_112L6"
    poles = sorted(system.poles(), key=lambda pole: pole.imag)
    np.testing.assert_allclose(
        poles, [-1j * crane.Omega, 0.0, 1j * crane.Omega], atol=1e-9
    )  # and a rigid mode


def test_in_contact_damped(crane):
    drive = crane.replace(damping=0.4)
    pole = max(drive.to_control().poles(), key=lambda p: p.imag)
    inverse = 1 / drive.J1 + 1 / drive.J2
    assert abs(pole) == pytest.approx(drive.Omega, rel=1e-12)
    assert -2 * pole.real == pytest.approx(drive.d * inverse, rel=1e-12)


def test_in_contact_is_minimal_and_settles_at_the_mean_torque(crane):
    system = crane.to_control()
    assert np.linalg.matrix_rank(control.ctrb(system.A, system.B)) == 3
    assert np.linalg.matrix_rank(control.obsv(system.A / crane.Omega, system.C[1:2])) == 3  # from w1 alone
    # Under constant inputs and with damping the torque settles at its mean, (Ms J2 + J1 Mc)/(J1 + J2).
    damped = crane.replace(damping=0.4).to_control()
    t = np.linspace(0, 3, 3001)
    response = control.forced_response(damped, t, np.outer([crane.Ms, crane.Mc], np.ones_like(t)))
    mean = (crane.Ms * crane.J2 + crane.J1 * crane.Mc) / (crane.J1 + crane.J2)
    assert response.outputs[3, -1] == pytest.approx(mean, rel=1e-6)


def test_whole_drive_names(crane):
    system = crane.to_control(nonlinear=True)
    assert isinstance(system, control.NonlinearIOSystem)
    assert system.input_labels == ["demand"]
    assert system.state_labels == ["phi1", "w1", "phi2", "w2"]
    assert system.output_labels == ["phi1", "w1", "phi2", "w2", "u", "T"]
    slow = crane.replace(torque_lag=0.01, torque_rate=500.0, start_position=0.3, initial_motor_speed=2)
    assert slow.to_control(nonlinear=True).state_labels == ["phi1", "w1", "phi2", "w2", "reference", "u"]
    np.testing.assert_array_equal(initial_state(slow), [0.3, 2.0, 0.0, 0.0, 0.0, 0.0])


def test_the_first_two_stages_of_g(crane):
    t, out = start(crane, 0.06, crane.Ms, points=6001)
    J1, J2, c, gap, Ms, Mc = crane.J1, crane.J2, crane.c, crane.gap, crane.Ms, crane.Mc
    closing = np.sqrt(gap * J1 * J2 / (Ms * J2 + Mc * J1))  # [G](3)
    speed = (Ms / J1 + Mc / J2) * closing  # [G](10)
    mean = (Ms * J2 + J1 * Mc) / (J1 + J2)
    peak = mean * (1 + np.sqrt(1 + (c * speed / (crane.Omega * mean)) ** 2))  # [G](13)
    assert peak / mean == pytest.approx(3.1179, abs=5e-5)  # the check table
    assert np.all(out["T"][t < closing - 1e-5] == 0.0)
    assert out["T"].max() == pytest.approx(peak, rel=1e-5)  # read off a grid of 10 us
    within = (t > closing) & (t < 0.053)
    phase = crane.Omega * (t[within] - closing)
    exact = mean * (1 - np.cos(phase)) + c * speed / crane.Omega * np.sin(phase)  # [G](11)
    np.testing.assert_allclose(out["T"][within], exact, atol=1e-5 * peak)


def reference_start(drive, until, demand, t_eval):
    """Staged integration with located events: the gap open, then in contact, a stuck load breaking away."""
    J1, J2, c, d, half, Mc = drive.J1, drive.J2, drive.c, drive.d, drive.gap / 2, drive.Mc
    lag = drive.torque_lag
    state = {"closed": False, "stuck": drive.load_kind == "reactive"}

    def torque(x):
        if not state["closed"]:
            return 0.0
        return c * (x[0] - x[2] - half) + d * (x[1] - x[3])

    def f(t, x):
        T = torque(x)
        u = x[4] if lag else demand
        return [
            x[1],
            (u - T) / J1,
            x[3],
            0.0 if state["stuck"] else (T - Mc) / J2,
            (demand - x[4]) / lag if lag else 0.0,
        ]

    def closes(t, x):
        return -1.0 if state["closed"] else x[0] - x[2] - half

    def breaks_away(t, x):
        return torque(x) - Mc if state["stuck"] else -1.0

    for event in (closes, breaks_away):
        event.terminal, event.direction = True, 1
    t, x, rows = 0.0, np.zeros(5), []
    while t < until:
        ts = t_eval[(t_eval >= t) & (t_eval <= until)]
        found = solve_ivp(
            f, (t, until), x, "DOP853", ts, events=(closes, breaks_away), rtol=1e-11, atol=1e-13
        )
        rows += [[s, *y, torque(y)] for s, y in zip(found.t, found.y.T, strict=True)]
        if found.status == 0:
            break
        which = 0 if len(found.t_events[0]) else 1
        t, x = found.t_events[which][0], found.y_events[which][0]
        state["closed" if which == 0 else "stuck"] = which == 0
        if which == 0 and state["stuck"] and torque(x) > Mc:
            state["stuck"] = False
    return np.array(rows)


@pytest.mark.parametrize("kind", ["active", "reactive"])
@pytest.mark.parametrize("lag", [0.0, 0.004])
@pytest.mark.parametrize("law", ["no-pull", "dead-zone"])
def test_a_short_start_against_scipy(crane, kind, lag, law):
    drive = crane.replace(load_kind=kind, torque_lag=lag, damping=0.3, contact_law=law)
    t, out = start(drive, 0.045, 62.0)
    rows = reference_start(drive, 0.045, 62.0, t)
    np.testing.assert_allclose(rows[:, 0], t)
    for column, name in ((1, "phi1"), (2, "w1"), (3, "phi2"), (4, "w2"), (6, "T")):
        exact = rows[:, column]
        assert np.abs(out[name] - exact).max() <= 2e-6 * np.abs(exact).max(), name
    if lag:
        np.testing.assert_allclose(out["u"], 62.0 * (1 - np.exp(-t / lag)), rtol=1e-8, atol=1e-9)


def test_a_reactive_load_sticks_again(crane):
    """Driven by its speed alone, a reactive load comes to rest and stays; an active one turns back."""
    drive = crane.replace(load_kind="reactive", initial_load_speed=10.0, initial_motor_speed=10.0)
    _, out = start(drive, 0.5, 0.0)
    assert out["w2"].min() > -1e-3
    assert abs(out["w2"][-1]) < 1e-4
    _, out = start(drive.replace(load_kind="active"), 0.5, 0.0)
    assert out["w2"][-1] < -5.0


def test_limits_rate_and_lag_of_the_torque(crane):
    drive = crane.replace(torque_rate=2000.0)
    t, out = start(drive, 0.06, 1000.0)
    np.testing.assert_allclose(out["u"], np.minimum(2000.0 * t, 64.0), atol=0.2)
    _, out = start(crane, 0.01, -5.0)
    assert np.all(out["u"] == 0.0)  # minimum_torque


def test_parameters_can_be_overridden_in_a_simulation(crane):
    system = crane.to_control(nonlinear=True)
    t = np.linspace(0, 0.03, 301)
    wide = control.input_output_response(
        system, t, np.full_like(t, 62.0), initial_state(crane), params={"gap": 2.0}, solve_ivp_kwargs=TIGHT
    )
    assert np.all(wide.outputs[5] == 0.0)


@pytest.mark.parametrize(
    ("law", "rate", "expected"),
    [
        ("no-pull", -50.0, 0.0),
        ("dead-zone", -50.0, -30.0),
        ("modelica", -50.0, 0.0),
        ("no-pull", 50.0, 70.0),
        ("dead-zone", 50.0, 70.0),
        ("modelica", 50.0, 40.0),
    ],
)
def test_contact_laws(law, rate, expected):
    # z = 0.5 beyond the gap, c z = 20, d z' = +-50
    assert shaft_torque(1.0, rate, 40.0, 1.0, 1.0, law=law) == expected
    assert shaft_torque(-1.0, -rate, 40.0, 1.0, 1.0, law=law) == -expected
    assert shaft_torque(0.5, rate, 40.0, 1.0, 1.0, law=law) == 0.0
