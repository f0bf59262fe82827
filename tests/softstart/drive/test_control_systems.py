"""The drive in python-control, against closed forms and the independent integrator."""

import control
import numpy as np
import pytest
from tests.oracle import integrate

from softstart.drive import Drive
from softstart.drive.control_systems import contact_torque, initial_state

CRANE = Drive.load("crane-4amtkf")
TIGHT = {"rtol": 1e-10, "atol": 1e-12, "max_step": 1e-3}


def start(drive, until, demand, points=2001, **options):
    system = drive.to_control(nonlinear=True)
    t = np.linspace(0.0, until, points)
    response = control.input_output_response(
        system, t, np.full_like(t, demand), initial_state(drive), solve_ivp_method="DOP853",
        solve_ivp_kwargs=TIGHT, **options,
    )  # fmt: skip
    return t, dict(zip(system.output_labels, response.outputs, strict=True))


def test_in_contact_poles_and_mean_torque():
    system = CRANE.to_control()
    assert system.input_labels == ["motor_torque", "load_torque"]
    assert system.output_labels == ["z", "w1", "w2", "shaft_torque"]
    poles = sorted(system.poles(), key=lambda pole: pole.imag)
    np.testing.assert_allclose(poles, [-1j * CRANE.Omega, 0.0, 1j * CRANE.Omega], atol=1e-9)  # a rigid mode
    assert np.linalg.matrix_rank(control.ctrb(system.A, system.B)) == 3
    damped = CRANE.replace(damping=0.4).to_control()
    pole = max(damped.poles(), key=lambda p: p.imag)
    assert abs(pole) == pytest.approx(CRANE.Omega, rel=1e-12)
    assert -2 * pole.real == pytest.approx(0.4 * (1 / CRANE.J1 + 1 / CRANE.J2), rel=1e-12)
    # Under constant inputs and with damping the torque settles at its mean, (Ms J2 + J1 Mc)/(J1 + J2).
    t = np.linspace(0, 3, 3001)
    response = control.forced_response(damped, t, np.outer([CRANE.Ms, CRANE.Mc], np.ones_like(t)))
    mean = (CRANE.Ms * CRANE.J2 + CRANE.J1 * CRANE.Mc) / (CRANE.J1 + CRANE.J2)
    assert response.outputs[3, -1] == pytest.approx(mean, rel=1e-6)


def test_states_of_the_whole_drive():
    assert CRANE.to_control(nonlinear=True).state_labels == ["phi1", "w1", "phi2", "w2"]
    slow = CRANE.replace(torque_lag=0.01, torque_rate=500.0, start_position=0.3, initial_motor_speed=2)
    assert slow.to_control(nonlinear=True).state_labels == ["phi1", "w1", "phi2", "w2", "reference", "u"]
    np.testing.assert_array_equal(initial_state(slow), [0.3, 2.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("kind", "lag", "law", "friction"),
    [
        ("active", 0.0, "modelica", 0.0), ("reactive", 0.0, "dead-zone", 0.0),
        ("reactive", 0.004, "no-pull", 0.0), ("active", 0.0, "no-pull", 3.0),
    ],
)  # fmt: skip
def test_a_short_start_is_that_of_the_integrator(kind, lag, law, friction):
    drive = CRANE.replace(
        load_kind=kind, torque_lag=lag, damping=0.3, contact_law=law, load_friction=friction
    )
    t, out = start(drive, 0.045, 62.0, points=46)
    values = {"J1": 0.035, "J2": 0.175, "c": 368.465, "d": 0.3, "gap": 0.5, "Mc": 7.16, "kind": kind}
    values |= {
        "load_friction": friction,
        "law": law,
        "theta0": 0.0,
        "w1_0": 0.0,
        "w2_0": 0.0,
        "torque_pieces": [(0.0, 62.0)],
    }
    exact = [integrate(**values, lag=lag, rate=np.inf, u0=0.0, t_end=until) for until in t[1:]]
    for name in ("w1", "w2", "T"):
        expected = np.array([getattr(one, name) for one in exact])
        assert np.abs(out[name][1:] - expected).max() <= 2e-6 * np.abs(expected).max(), name
    if lag:
        np.testing.assert_allclose(out["u"], 62.0 * (1 - np.exp(-t / lag)), rtol=1e-8, atol=1e-9)


def test_a_reactive_load_sticks_again():
    """Driven by its speed alone, a reactive load comes to rest and stays; an active one turns back."""
    drive = CRANE.replace(load_kind="reactive", initial_load_speed=10.0, initial_motor_speed=10.0)
    _, out = start(drive, 0.5, 0.0)
    assert out["w2"].min() > -1e-3
    assert abs(out["w2"][-1]) < 1e-4
    _, out = start(drive.replace(load_kind="active"), 0.5, 0.0)
    assert out["w2"][-1] < -5.0


def test_limits_and_rate_of_the_torque_and_another_gap():
    t, out = start(CRANE.replace(torque_rate=2000.0), 0.06, 1000.0)
    np.testing.assert_allclose(out["u"], np.minimum(2000.0 * t, 64.0), atol=0.2)
    assert np.all(start(CRANE, 0.01, -5.0)[1]["u"] == 0.0)  # minimum_torque
    assert np.all(start(CRANE, 0.03, 62.0, params={"gap": 2.0})[1]["T"] == 0.0)


def test_contact_laws_on_both_flanks():
    """By hand: 0.5 rad beyond the gap, c z = 20 N m, d z' = +-50 N m."""
    for law, approaching, parting in (("no-pull", 70, 0), ("dead-zone", 70, -30), ("modelica", 40, 0)):
        for rate, torque in ((50.0, approaching), (-50.0, parting)):
            assert contact_torque(1.0, rate, 40.0, 1.0, 1.0, law=law) == torque
            assert contact_torque(-1.0, -rate, 40.0, 1.0, 1.0, law=law) == -torque
