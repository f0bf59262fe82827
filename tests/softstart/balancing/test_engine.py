"""Engines from files and from Python: what is read, what is refused, what drives a chain."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.softstart.balancing.engines import RPM, engine

from softstart import Engine, InputError, PeriodicTorque
from softstart.balancing import BalancerShaft, Cylinders

VAZ = Engine.load("vaz-11113")
GOOD = VAZ.to_toml()


def test_engines_are_values():
    assert Engine.from_toml(GOOD) == VAZ
    assert hash(Engine.from_toml(GOOD)) == hash(VAZ)
    assert replace(VAZ, name="other") != VAZ
    with pytest.raises(AttributeError):
        VAZ.name = "other"
    four = engine((1, 3, 4, 2), shafts=[BalancerShaft(0.01, 2, height=0.1), BalancerShaft(0.01, -2)])
    assert Engine.from_toml(four.to_toml()) == four


BAD = {
    "rod": ("cylinders.rod_length", "30 mm", "[cylinders] rod_length = 0.03 m: the rod must be longer"),
    "order": ("cylinders.firing_order", [1, 2], "both are given"),
    "frequency": ("operation.highest_speed", "50 Hz", "Hz is a frequency"),
    "key": ("masses.reciprocatin", 1, "did you mean masses.reciprocating?"),
}


@pytest.mark.parametrize("kind", BAD)
def test_each_mistake_has_its_sentence(kind):
    key, value, says = BAD[kind]
    with pytest.raises(InputError) as caught:
        Engine.from_toml(GOOD, also={key: value})
    (sentence,) = caught.value.sentences
    assert says in sentence
    assert sentence.endswith((".", "?"))


def test_all_mistakes_are_told_at_once():
    text = GOOD + "[[shaft]]\nimbalance = 0.01\nratio = 0.5\n"
    wrong = {"cylinders.rod_length": "30 mm", "operation.highest_speed": "500 rpm"}
    with pytest.raises(InputError) as caught:
        Engine.from_toml(text, where="my.toml", also=wrong)
    said = caught.value.sentences
    assert len(said) == 3
    assert all(sentence.startswith("my.toml: ") for sentence in said)
    assert any("[shaft] 1, ratio = 0.5: a balancer shaft turns a whole number" in s for s in said)


def test_firing_order_and_angles():
    with pytest.raises(InputError, match="each cylinder from 1 to 4 is named once"):
        Cylinders(0.08, 0.08, 0.13, firing_order=(1, 3, 3, 2))
    with pytest.raises(InputError, match="neither is given"):
        Cylinders(0.08, 0.08, 0.13)
    with pytest.raises(InputError, match="or 2, at most 24"):
        engine(shafts=[BalancerShaft(0.01, 30)])


# the torque for a chain --------------------------------------------------------------------------------


def test_torque_of_time_is_the_torque_over_the_crank_angle():
    made = engine((1, 3, 4, 2), bore=0.08)
    w = 200.0
    t = np.linspace(0.0, 0.2, 301)
    torque = made.torque_of_time(w, orders=24)
    exact = made.torque(w * t, w)
    assert torque.mean == pytest.approx(made.indicated_work(w) / (4.0 * math.pi), rel=1e-13)
    assert np.abs(torque.at(t) - exact).max() < 0.01 * np.ptp(exact)  # what is beyond order 24
    errors = [np.abs(made.torque_of_time(w, orders=n).at(t) - exact).max() for n in (4, 8, 16, 24)]
    assert errors == sorted(errors, reverse=True)
    assert torque.orders.tolist() == list(range(2, 25, 2))  # the others cancel
    assert torque.frequencies == pytest.approx(w * torque.orders)
    assert engine((1,)).torque_of_time(w).orders[0] == 0.5


def test_a_periodic_torque_repeats_and_has_its_mean():
    torque = VAZ.torque_of_time(3000.0 * RPM)
    period = 2.0 * math.pi / torque.speed
    t = np.linspace(0.0, period, 400, endpoint=False)
    assert torque.at(t) == pytest.approx(torque.at(t + 7.0 * period), rel=1e-9)
    assert torque.at(t).mean() == pytest.approx(torque.mean, rel=1e-12)
    power = np.mean((torque.at(t) - torque.mean) ** 2)
    assert power == pytest.approx(0.5 * np.sum(torque.amplitudes**2), rel=1e-12)  # Parseval
    assert torque.at(0.1).shape == ()
    assert PeriodicTorque(**torque.summary()).at(0.01) == torque.at(0.01)
