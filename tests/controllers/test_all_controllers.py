"""What every shipped controller must keep to."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests import twin
from tests.controllers.starts import CRANE, random_drive, traced

from softstart import Drive, InputError, simulate
from softstart.controller import CompiledController, declared_parameters, make_controller
from softstart.controller.finding import controller_class, ready_controller_names
from softstart.drive import library
from softstart.kernel.records import NOTES

ALL = ready_controller_names()  # all but `profile`; a new one is tested as soon as it is registered
SAMPLED = [name for name in ALL if "period" in declared_parameters(controller_class(name))]
DOCS = Path(__file__).parents[2] / "docs"
DRIVES = [Drive.load(name) for name in library.names()]


@pytest.mark.parametrize("name", ALL)
def test_defaults_are_numbers_and_a_twin_in_plain_python_gives_the_same_bits(name: str) -> None:
    controller = make_controller(name)
    assert isinstance(controller, CompiledController)
    texts = {name for name, one in declared_parameters(controller).items() if one.kind == "text"}
    for drive in DRIVES:
        values = controller.fitted(drive).parameters
        assert all(isinstance(values.pop(text), str) for text in texts)
        assert all(isinstance(value, float) and math.isfinite(value) for value in values.values()), values
        both = controller, twin.plain(controller, drive)
        one, two = (simulate(drive, played).trajectory for played in both)
        assert all(np.array_equal(one.notes[name], two.notes[name], equal_nan=True) for name in NOTES.names)
        assert np.array_equal(one.states, two.states)
        assert np.array_equal(one.events, two.events)


@pytest.mark.parametrize("name", ALL)
def test_says_what_it_is_and_where_it_is_described(name: str) -> None:
    cls = controller_class(name)
    assert cls.name == name
    assert cls.summary
    assert cls.source
    assert "effort" in {key for base in cls.__mro__[:-1] for key in vars(base)} or cls.sensors
    if not DOCS.is_dir():
        pytest.skip("installed without docs/")
    heading = rf"^## .*\b{re.escape(name)}\b"
    assert re.search(heading, (DOCS / "controllers.md").read_text("utf-8"), re.M), "add a section"
    row = rf"^\|.*`{re.escape(name)}`"
    assert re.search(row, (DOCS / "howto" / "choose-a-strategy.md").read_text("utf-8"), re.M), (
        "add it to the table"
    )


@pytest.mark.parametrize("name", SAMPLED)
def test_reaches_the_target_speed_of_any_sensible_drive(name: str) -> None:
    rng = np.random.default_rng(11)
    for number in range(100):
        drive = random_drive(rng, **({"load_kind": "active"} if number % 4 == 0 else {}))
        if number % 4 == 0:  # a load that pushes
            drive = drive.replace(load_torque=-0.1 * float(drive.Ms) * min(1.0, float(drive.J2 / drive.J1)))
        assert not math.isnan(simulate(drive, name).start_time), drive


@pytest.mark.parametrize(
    ("name", "median", "slower"),
    [
        ("shaped", 0.58, 1.1),
        ("state-feedback", 0.58, 1.12),
        ("current-limit-feedback", 0.65, 1.25),
        ("pulse-coast-hold", 0.6, 1.25),
    ],
)
def test_softer_than_direct_on_random_drives(name: str, median: float, slower: float) -> None:
    """K_dyn over that of `direct`: measured median 0.53, 0.53, 0.60, 0.56; start time 1.06 to 1.11 times."""
    rng = np.random.default_rng(7)
    ratios, times = [], []
    for drive in [random_drive(rng) for _ in range(100)]:
        run, direct = simulate(drive, name), simulate(drive, "direct")
        ratios.append(run.k_dyn / direct.k_dyn)
        times.append(run.start_time / direct.start_time)
    assert np.median(ratios) < median
    assert max(ratios) < 1.0
    assert np.median(times) < slower


@pytest.mark.parametrize("name", ["current-limit-feedback", "shaped", "state-feedback", "pulse-coast-hold"])
def test_gives_up_waiting(name: str) -> None:
    run = simulate(CRANE, name, parameters={"detection_threshold": 1e6, "contact_timeout": 0.3})
    assert float(run.at(0.29)["u"]) < 40.0
    assert float(run.at(max(0.6, run.end_time))["u"]) == pytest.approx(62.0, abs=1.0)


@pytest.mark.parametrize("name", SAMPLED)
def test_asks_at_whole_sample_periods_only(name: str) -> None:
    run, trace = traced(CRANE, make_controller(name, {"period": 0.0007}))
    asked = np.setdiff1d(trace[:, 0], run.trajectory.events["time"])
    assert np.abs(asked / 0.0007 - np.rint(asked / 0.0007)).max() < 1e-9


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("ramp", {"period": 0.0}),
        ("ramp", {"initial": math.nan}),
        ("s-curve", {"rounding": 1.5}),
        ("acceleration-delay", {"drop": -0.3}),
        ("acceleration-delay", {"delay": math.inf}),
        ("pulse-coast-hold", {"detection_threshold": math.nan}),
        ("take-up", {"slowing": -1.0}),
        ("state-feedback", {"torque_weight": 0.0}),
        ("shaped", {"shaper": "ei"}),
        ("reduced-two-stage", {"raise_at": "top"}),
        ("acceleration-delay", {"raise_at": "top"}),
        ("ramp", {"period": -1.0, "time": -1.0}),
    ],
)
def test_refuses_impossible_parameters_in_one_sentence_each(name: str, wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError) as caught:
        make_controller(name, wrong)
    assert len(caught.value.sentences) == len(wrong)
    assert all(key in str(caught.value) for key in wrong)
