"""A chain on the page: its fields, its figures to the bit, its traces by shaft and body, map and link."""

from __future__ import annotations

import base64
import json
from itertools import pairwise

import numpy as np
import pytest

from softstart import Drive, InputError, simulate
from softstart.chain import Chain
from softstart.controller import make_controller
from softstart.page import links
from softstart.page.controls import Controls
from softstart.page.downloads import command_text
from softstart.page.frames import Screen, channels_at, traces_of
from softstart.page.machines import axes_about, changed, entries, k_dyn_row, machine_from
from softstart.page.sentences import changed_since, differences
from softstart.page.session import Session

CHAIN = Chain.load("crane-4-mass")
DAMPED = changed(CHAIN, {f"shaft[{i}].damping_ratio": "0.04" for i in (1, 2, 3)})


def screen_of(chain: Chain, *controllers: str) -> tuple[Session, Screen, Controls]:
    session = Session(chain, controllers=controllers or ["direct", "ramp"])
    screen = Screen(session)
    return session, screen, Controls(session, screen, lambda: None)


def test_the_figures_of_a_chain_are_those_of_simulate():
    session, screen, controls = screen_of(DAMPED, "direct", "ramp", "take-up")
    assert screen.first()["figure"]["k_dyn"] == simulate(DAMPED, "direct").k_dyn
    controls.take({"what": "slide", "path": "shaft[2].gap", "position": 100})
    controls.take({"what": "edit", "path": "mass[4].inertia", "text": "50 kg*m^2"})
    assert not screen.mistakes
    now = session.machine
    assert now.shafts[1].gap == screen.entries["shaft[2].gap"].scale.value(100)
    assert now.masses[3].inertia == 50.0
    for name in ("direct", "ramp", "take-up"):
        assert session.result(name).k_dyn == simulate(now, name).k_dyn
    rows = [row for frame in screen.at_rest() if frame for row in frame.get("rows", ())]
    worn = {row["name"]: row["worn"] for row in rows if "worn" in row}
    wide = simulate(now.changed(gaps=4.0), "ramp", fitted_to=now, base=now).k_dyn
    assert worn["ramp"] == wide
    session.undo()
    session.undo()
    assert session.machine is DAMPED


@pytest.mark.parametrize("path", ["start.target_speed", "motor.maximum_torque", "motor.minimum_torque"])
def test_an_empty_field_gives_back_what_follows_another_one(path):
    """The rated speed is the target then, the starting torque the largest; or it says what it needs."""
    session, screen, controls = screen_of(CHAIN, "direct")
    before = session.machine
    controls.take({"what": "edit", "path": path, "text": ""})
    if path == "motor.minimum_torque":
        assert "the field is empty" in screen.mistakes[path]
        assert session.machine is before
    else:
        assert not screen.mistakes
        assert session.machine.target_speed == CHAIN.motor.rated_speed
        assert session.machine.motor.maximum_torque >= CHAIN.motor.starting_torque


def test_a_damping_ratio_that_was_not_given_is_taken_back():
    session, screen, controls = screen_of(CHAIN, "direct")
    controls.take({"what": "slide", "path": "shaft[2].damping_ratio", "position": 60})
    assert session.machine.shafts[1].damping_ratio == 0.02
    controls.take({"what": "reset", "path": "shaft[2].damping_ratio"})
    assert not screen.mistakes
    assert session.machine == CHAIN
    shown = screen.first()["fields"]["shaft[2].damping_ratio"]
    assert (shown["text"], shown["position"]) == ("0", 0)


@pytest.mark.parametrize(
    "chain", [CHAIN, DAMPED, Chain.load("tractor-like")], ids=["bare", "damped", "tractor"]
)
def test_each_field_reads_what_it_writes(chain):
    """Every slider is set to its middle, every value written back as it is shown: nothing else changes."""
    before = {path: chain.by_path()[path][1] for path in entries(chain)}
    for path, value in before.items():
        if isinstance(value, float):
            assert changed(chain, {path: repr(value)}).by_path()[path][1] == value
    for path, scale in ((path, one.scale) for path, one in entries(chain).items() if one.scale):
        there = changed(chain, {path: repr(scale.value(300))}).by_path()
        assert there[path][1] == scale.value(300)
        assert {key: there[key][1] for key in before if key != path} == {
            key: value for key, value in before.items() if key != path
        }


def test_traces_hold_each_shaft_and_body():
    run = simulate(DAMPED, "direct")
    traces = traces_of(run)
    states = run.at(traces["t"])
    for k in range(3):
        assert np.array_equal(traces[f"T[{k}]"], states["T"][:, k])
        assert np.array_equal(traces[f"theta[{k}]"], states["twist"][:, k])
        assert np.abs(traces[f"T[{k}]"]).max() == pytest.approx(run.peak_torques[k], rel=1e-12)
    assert np.array_equal(traces["w[3]"], states["w"][:, 3])
    assert {event.time for event in run.events} <= set(traces["t"])


@pytest.mark.parametrize("strategy", ["direct", "take-up"])
def test_stages_of_a_gap_are_open_where_it_carries_nothing(strategy):
    """The kernel's events against the states: no torque in an open gap, no twist within a closed one."""
    session, screen, _ = screen_of(DAMPED, strategy)
    picture = screen.first()["traces"][strategy]
    run = session.result(strategy).run
    halves = 0.5 * DAMPED.at_motor_shaft().gap
    for k, shaft in enumerate(picture["shafts"]):
        stages = shaft["stages"]
        assert stages[0][0] == 0.0
        assert stages[-1][1] == run.end_time
        assert all(before[1] == after[0] for before, after in pairwise(stages))
        for start, end, side in stages:
            inside = channels_at(run, np.linspace(start, end, 9)[1:-1])
            if side == 0:
                assert np.all(inside[f"T[{k}]"] == 0.0)
            else:
                assert np.all(side * inside[f"theta[{k}]"] >= halves[k] * (1.0 - 1e-9))
    data = np.frombuffer(base64.b64decode(picture["data"]), dtype="<f4")
    assert data.size % len(picture["channels"]) == 0
    assert json.loads(json.dumps(picture)) is not None


def test_the_map_of_a_chain_is_made_of_its_starts():
    axes = axes_about(DAMPED, 3, 3)
    assert DAMPED.gap_and_inertia == (pytest.approx(0.5), 69.2)
    controller = make_controller("ramp")
    row = k_dyn_row(DAMPED, controller, axes.gaps, axes.inertias[2])
    for gap, k in zip(axes.gaps, row, strict=True):
        there = DAMPED.moved(gap, axes.inertias[2])
        assert there.gap_and_inertia == (pytest.approx(gap), pytest.approx(axes.inertias[2]))
        assert k == simulate(there, "ramp").k_dyn


def test_gaps_that_were_closed_on_the_map_open_again_as_they_were():
    session, _, controls = screen_of(DAMPED)
    controls.take({"what": "jump", "gap": 0.0, "inertia": 69.2})
    assert [shaft.gap for shaft in session.machine.shafts] == [0.0, 0.0, 0.0]
    controls.take({"what": "jump", "gap": 0.5, "inertia": 69.2})
    assert [shaft.gap for shaft in session.machine.shafts] == pytest.approx([0.1, 0.2, 0.01])


def test_a_map_is_not_computed_again_for_another_place_of_it():
    session, screen, controls = screen_of(DAMPED, "direct")
    screen.axes = axes_about(DAMPED, 3, 3)
    assert [frame for frame in screen.at_rest() if frame and "map_row" in frame]
    controls.take({"what": "jump", "gap": 0.31, "inertia": 44.4})
    assert not screen.first()["map_is_old"]
    session.set("shaft[1].stiffness", 5000.0)
    assert screen.first()["map_is_old"]


def test_a_chain_without_gaps_has_no_map():
    closed = changed(CHAIN, {f"shaft[{i}].gap": "0" for i in (1, 2, 3)})
    _, screen, _ = screen_of(closed, "direct")
    assert not screen.first()["mapped"]
    assert not [frame for frame in screen.at_rest() if frame and "map_row" in frame]


def test_a_link_brings_the_chain_back_and_a_drive_replaces_it():
    session, screen, _ = screen_of(DAMPED)
    session.set("shaft[3].gap", "0.6 deg")
    other = links.bench_of(links.link_of(session), Session(controllers=["direct"]).bench)
    assert other.drive == session.machine
    assert [group["title"] for group in screen.first()["groups"]][3:5] == ["rotor", "rotor - pinion"]
    session.take(Drive.load("crane-4amtkf"))
    assert [group["title"] for group in screen.first()["groups"]] == [
        "Units", "Drive", "Motor", "Shaft", "Load", "Start", "Limits"
    ]  # fmt: skip
    session.undo()
    frame = screen.first()
    assert frame["fields"]["shaft[3].gap"]["text"] == "0.6 deg"
    assert frame["figure"]["k_dyn"] == simulate(other.drive, "direct").k_dyn


@pytest.mark.parametrize("machines", [(CHAIN, CHAIN), (Drive.load("crane-4amtkf"), CHAIN)])
def test_a_reference_stays_while_a_chain_is_loaded_and_in_its_link(machines):
    session, screen, controls = screen_of(machines[0])
    controls.take({"what": "reference", "kept": True})
    session.take(machines[1])
    k = simulate(machines[0], "direct").k_dyn
    assert screen.first()["reference"]["k_dyn"] == k
    other, opened, controls = screen_of(Drive.load("hoist-15kw"))
    controls.take({"what": "hello", "kept": None, "link": links.link_of(session)})
    assert opened.first()["reference"]["k_dyn"] == k
    assert other.machine == machines[1]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "[[mass]]\ninertia = 1.0\n[[mass]]\ninertia = 2.0\n[[shaft]]\nstiffness = 9.0\n",
            r"\[motor\] is missing",
        ),
        (
            "[[mass]]\ninertia = 1.0\n[[mass]]\ninertia = 2.0\n[[shaft]]\nstiffness = 9.0\n"
            "[motor]\nstarting_torque = 3.0\n",
            "target_speed is missing",
        ),
    ],
)
def test_a_chain_that_cannot_start_is_refused_and_nothing_changes(text, said):
    session = Session(controllers=["direct"])
    before = session.machine
    with pytest.raises(InputError, match=said):
        session.take(machine_from(text))
    assert session.machine is before


def test_words_for_a_changed_chain():
    wider = changed(CHAIN, {"shaft[1].gap": "0.3"})
    assert differences(CHAIN, wider) == "shaft[1].gap 0.1 rad"
    assert changed_since(CHAIN, Drive.load("crane-4amtkf")).startswith(
        "For Crane travel drive as a chain of four"
    )
    made = {name: make_controller(name) for name in ("direct", "ramp")}
    assert command_text(wider, made) == (
        "softstart compare crane-4-mass --set 'shaft[1].gap=0.3' --controllers direct,ramp"
    )
