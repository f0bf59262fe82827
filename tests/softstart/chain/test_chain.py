"""The chain itself: files, mistakes, and bringing it to a shaft."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.twin import chain_of

from softstart import Drive, InputError
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.views.drives import drive_lines

BASE = """
[[mass]]
name = "rotor"
inertia = 1

[[shaft]]
stiffness = "2 kN*m/rad"
gap = "1 deg"

[[mass]]
name = "drum"
inertia = 4
"""

positive = st.floats(1e-3, 1e3)


@st.composite
def chains(draw: st.DrawFn) -> Chain:
    n = draw(st.integers(2, 7))
    kinds = [draw(st.sampled_from(["active", "reactive"])) for _ in range(n)]
    masses = [
        Mass(
            draw(positive),
            damping=draw(st.floats(0.0, 10.0)),
            torque=draw(st.floats(0.0 if kind == "reactive" else -5.0, 5.0)),
            kind=kind,
            initial_speed=draw(st.floats(-3.0, 3.0)),
        )
        for kind in kinds
    ]
    shafts = [
        Shaft(
            draw(positive),
            damping=draw(st.floats(0.0, 10.0)),
            gap=draw(st.floats(0.0, 1.0)),
            ratio=draw(st.floats(0.1, 20.0)),
            side=draw(st.sampled_from(["before", "after"])),
            start_position=draw(st.floats(-0.1, 0.1)),
        )
        for _ in range(n - 1)
    ]
    return Chain(masses, shafts, Motor(62.0, mass=f"mass {draw(st.integers(1, n))}"), target_speed=10.0)


@given(chains(), st.data())
@settings(max_examples=60, deadline=None)
def test_energy_and_power_do_not_depend_on_the_reference_shaft(chain: Chain, data: st.DataObject) -> None:
    """Kinetic energy, power of the loads, elastic energy at the same angles: formed on own shafts."""
    k = data.draw(st.integers(0, len(chain.masses) - 1))
    there = chain.brought_to(k)
    kinetic = [sum(m.inertia * m.initial_speed**2 for m in one.masses) for one in (chain, there)]
    power = [sum(m.torque * m.initial_speed for m in one.masses) for one in (chain, there)]
    assert kinetic[1] == pytest.approx(kinetic[0], rel=1e-11)
    assert power[1] == pytest.approx(power[0], rel=1e-11, abs=1e-11)
    i = np.array(chain.speed_ratios(k))
    angles = np.array([mass.initial_speed for mass in chain.masses])  # any angles on own shafts
    for j, shaft in enumerate(chain.shafts):
        before, after = angles[j], angles[j + 1]
        twist = before - after * shaft.ratio if shaft.side == "before" else before / shaft.ratio - after
        brought, moved = angles[j] / i[j] - angles[j + 1] / i[j + 1], there.shafts[j]
        elastic = shaft.stiffness * twist**2
        assert moved.stiffness * brought**2 == pytest.approx(elastic, rel=1e-9, abs=1e-12)
        across = shaft.gap * np.sqrt(shaft.stiffness)
        assert moved.gap * np.sqrt(moved.stiffness) == pytest.approx(across, rel=1e-11)


@given(chains())
@settings(max_examples=40, deadline=None)
def test_a_chain_survives_its_file_a_pickle_and_the_way_there_and_back(chain: Chain) -> None:
    assert Chain.from_toml(chain.to_toml()) == chain
    copy = pickle.loads(pickle.dumps(chain))
    assert copy == chain
    assert hash(copy) == hash(chain)
    twice = chain.brought_to(0).brought_to(len(chain.masses) - 1)
    assert twice.masses == chain.brought_to(0).masses  # ratios are 1 there: nothing is left to bring


def test_a_drive_and_its_chain_are_described_alike() -> None:
    drive = Drive.load("crane-4amtkf").replace(damping=0.3)
    chain = chain_of(drive)
    assert drive_lines(chain) == drive_lines(drive)
    for what in ("damping_ratio", "elastic_period", "stiffnesses", "dampings", "frictions"):
        assert getattr(chain, what) == pytest.approx(getattr(drive, what), rel=1e-12), what


def test_all_mistakes_of_a_file_are_told_at_once() -> None:
    text = """
[[mass]]
inertia = -1
[[shaft]]
stifness = 5
gap = "1 m"
ratio = 0
[[mass]]
inertia = 1
king = "active"
[motor]
starting_torque = "6 N"
"""
    with pytest.raises(InputError) as caught:
        Chain.from_toml(text, where="bad.toml")
    said = str(caught.value)
    for piece in (
        "[mass] 1, inertia = -1: the inertia on its own shaft must be above 0",
        "did you mean stiffness?",
        'gap = "1 m": m is a length',
        "ratio = 0",
        "did you mean kind?",
        "N is a force, not a torque",
    ):
        assert piece in said
    assert all(sentence.startswith("bad.toml: ") for sentence in caught.value.sentences)


SHAFT = '[[shaft]]\nstiffness = "2 kN*m/rad"\ngap = "1 deg"\n'


@pytest.mark.parametrize(
    ("shaft", "more", "reason"),
    [
        ("[[shaft]]\n", "", "[shaft] 1, stiffness is missing"),
        ("[[shaft]]\nstiffness = 5\nrestitution = 0.5\n", "", "closes on a spring has no impact"),
        ("[[shaft]]\nrestitution = 0.5\ngap = 0.1\ndamping = 1\n", "", "a rigid joint has no damping"),
        ("[[shaft]]\nstiffness = 5\ndamping = 1\ndamping_ratio = 0.1\n", "", "both give the damping"),
        ("[[shaft]]\nstiffness = inf\ngap = 0.1\n", "", "restitution is missing"),
        ("[[shaft]]\nstiffness = 5\ngap = 0.1\nbacklash = '1 mm'\n", "", "both give the gap"),
        ("[[shaft]]\nstiffness = 5\nbacklash = '1 mm'\n", "", "diameter is missing"),
        ("[[shaft]]\nrestitution = 1\ngap = 0.1\nstart_position = 0.2\n", "", "lets the twist lie between"),
        (SHAFT, "[motor]\nmass = 'rotr'\nstarting_torque = 5", "did you mean"),
        (SHAFT, "[start]\nload = 'hook'", "its masses are"),
        (SHAFT, "[[mass]]\ninertia = 1\nkind = 'reactive'\ntorque = -5", "torque = -5.0: a reactive load"),
        (SHAFT, "[[mass]]\ninertia = 1", "joined by 2 shafts, and there are 1"),
        (SHAFT, "[[shaft]]\nfrom = 1", "make one of equal branches, whose inertias, stiffnesses"),
        (SHAFT, "[[shaft]]\nstiffness = 1\n[[mass]]\nname = 'drum'\ninertia = 1", "2 masses have this name"),
    ],
)
def test_what_parts_say_against_themselves_and_one_another(shaft: str, more: str, reason: str) -> None:
    with pytest.raises(InputError) as caught:
        Chain.from_toml(BASE.replace(SHAFT, shaft) + more)
    assert reason in str(caught.value)


def test_a_damping_ratio_is_that_of_the_two_masses_alone() -> None:
    """d = 2 zeta sqrt(c J1 J2/(J1 + J2)), whatever gears lie beside it; welded masses count as one."""
    masses = [Mass(1.0), Mass(2.0), Mass(6.0), Mass(5.0)]
    shafts = [Shaft(8.0), Shaft(3.0, damping_ratio=0.05, ratio=4, side="after"), Shaft(restitution=0.0)]
    chain = Chain(masses, shafts)
    J2, J3, c = 2.0, (6.0 + 5.0) / 16.0, 3.0 / 16.0
    d = 2 * 0.05 * np.sqrt(c * J2 * J3 / (J2 + J3))
    np.testing.assert_allclose(chain.at_motor_shaft().d, [0.0, d, 0.0], rtol=1e-14)
    np.testing.assert_allclose(chain.brought_to(0).at_motor_shaft().d, [0.0, d, 0.0], rtol=1e-14)
    assert Chain.from_toml(chain.to_toml()) == chain


@given(chains(), st.data())
@settings(max_examples=40, deadline=None)
def test_the_mean_torque_is_that_of_the_lever_rule(chain: Chain, data: st.DataObject) -> None:
    """[G](16) with the two masses of the lever rule: share x of a mass goes to the load."""
    load = data.draw(st.sampled_from([mass.name for mass in chain.masses]))
    masses = [mass.replace(torque=5.0 if mass.name == load else 0.0) for mass in chain.masses]
    chain = replace(chain, masses=tuple(masses), load_mass=load)
    assume(chain.motor_index != chain.load_index)
    at = chain.at_motor_shaft()
    low, high = sorted((at.motor, at.load))
    place = np.concatenate([[0.0], np.cumsum(1.0 / at.c[low:high])]) / np.sum(1.0 / at.c[low:high])
    x = np.concatenate([np.zeros(low), place, np.ones(at.J.size - high - 1)])
    J2 = float(at.J @ (x if at.motor < at.load else 1.0 - x))
    J1, Mc = float(at.J.sum()) - J2, float(at.Mc[at.load])
    assert chain.mean_torque == pytest.approx((62.0 * J2 + J1 * Mc) / (J1 + J2), rel=1e-10)


def test_a_chain_that_nothing_damps_says_so() -> None:
    bare = Chain.load("crane-4-mass")
    assert "undamped" in bare.warnings[0]
    assert Chain.load("crane-4-mass", also={"shaft[2].damping_ratio": 0.01}).warnings == ()
    assert Chain([Mass(1.0), Mass(1.0)], [Shaft(5.0)]).warnings == ()


def test_names_and_places() -> None:
    chain = Chain([Mass(1), Mass(2, name="drum")], [Shaft(1)])
    assert [mass.name for mass in chain.masses] == ["mass 1", "drum"]
    assert chain.index("motor") == 0
    assert chain.load_mass == "drum"
    with pytest.raises(InputError, match="did you mean"):
        chain.index("drun")
    with pytest.raises(InputError, match="0 to 1"):
        chain.index(2)
    with pytest.raises(InputError, match="at least 2 masses"):
        Chain([Mass(1)], [])
