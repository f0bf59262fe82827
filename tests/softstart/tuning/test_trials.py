"""Candidates tried in one batch are the very starts that `simulate` makes one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softstart import Drive, InputError, simulate
from softstart.chain import Chain
from softstart.controller import make_controller
from softstart.tuning.problem import TuningProblem, recipe_of, tuning_scenarios
from softstart.tuning.ranges import Range, ranges_of
from softstart.tuning.trials import Trials

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
CHAIN = Chain.load("crane-4-mass").with_values({"start_position": "mid-gap"})


def trials(name, drive=CRANE, tolerances=None, robust=False, **change):
    recipe = recipe_of(name)
    asked = {
        "drive": drive, "recipe": recipe, "gaps": (0.5, 2.0), "load_inertias": (0.07, 0.175),
        "ranges": ranges_of(recipe.make(), None), "scenarios": tuning_scenarios(drive, tolerances),
        "metric": "k_dyn", "start_time": None, "quantile": 1.0, "seed": 0, "restarts": 1,
        "population": 8, "generations": 2,
    }  # fmt: skip
    return Trials(TuningProblem(**(asked | change)), robust)


UNKNOWN = CHAIN.with_values({"start_position": "unknown"})
OFF = {"shaft[2].gap": "20 %", "load_torque": "10 %"}
OF_CHAINS = {"gaps": (0.5, 1.0), "load_inertias": (40.0, 69.2)}


@pytest.mark.parametrize(
    ("name", "machine", "tolerances", "cells"),
    [
        ("acceleration-delay", CRANE, {"load_torque": "20 %"}, {}),
        ("current-limit-feedback", CRANE, {"load_torque": "20 %"}, {}),
        ("s-curve", UNKNOWN, OFF, OF_CHAINS),
        ("take-up", CHAIN, OFF, OF_CHAINS),
    ],
)
def test_each_candidate_is_the_start_that_simulate_makes(name, machine, tolerances, cells):
    tried = trials(name, machine, tolerances, **cells)
    places = np.random.default_rng(3).random((3, len(tried.problem.ranges)))
    cells = np.array([0, 3, 1])
    values = tried.values(cells, places)
    judged = tried.judged(cells, values, to_the_end=True)
    for k, cell in enumerate(cells):
        one = tried.problem.drive_of(int(cell))
        controller = make_controller(name, {key: float(value[k]) for key, value in values.items()})
        for s, scenario in enumerate(tried.problem.scenarios):
            off = one.with_values(
                {key: level.of(one.parameter_value(key).value) for key, level in scenario.items()}
            )
            run = simulate(off, controller, fitted_to=one, base=one)
            assert judged.metric[k, s] == run.k_dyn
            assert judged.start_time[k, s] == run.start_time or np.isnan(run.start_time)


def test_one_set_is_set_up_for_the_nominal_drive():
    tried = trials("acceleration-delay", robust=True)
    judged = tried.judged(np.zeros(2, dtype=int), {"torque": np.array([12.0, 20.0])})
    for k, torque in enumerate((12.0, 20.0)):
        for cell in range(4):
            drive = tried.problem.drive_of(cell)
            run = simulate(drive, "acceleration-delay", parameters={"torque": torque}, fitted_to=CRANE)
            assert judged.metric[k, cell] == pytest.approx(run.k_dyn, rel=1e-12)
            assert judged.start_time[k, cell] == pytest.approx(run.start_time, rel=1e-12)


def test_a_candidate_that_its_controller_refuses_is_the_worst_and_alone():
    tried = trials("s-curve")
    values = {"rounding": np.array([0.5, 1.5, 1.0])}  # a share
    judged = tried.judged(np.zeros(3, dtype=int), values)
    assert np.isnan(judged.metric[:, 0]).tolist() == [False, True, False]
    run = simulate(tried.problem.drive_of(0), "s-curve", parameters={"rounding": 0.5})
    assert judged.metric[0, 0] == run.k_dyn


# ranges ---------------------------------------------------------------------------------------------------


@given(
    place=st.floats(0.0, 1.0),
    default=st.floats(1e-6, 1e6),
    low=st.floats(0.01, 0.9),
    high=st.floats(1.0, 100.0),
    logarithmic=st.booleans(),
)
def test_places_and_values(place, default, low, high, logarithmic):
    one = Range("x", "1", multiples=(low, high), logarithmic=logarithmic)
    value = float(one.value(place, default))
    assert low * default * (1 - 1e-12) <= value <= high * default * (1 + 1e-12)
    assert float(one.value(one.place(value, default), default)) == pytest.approx(value, rel=1e-9)
    assert float(one.value(0.0, default)) == pytest.approx(low * default)
    assert float(one.value(1.0, default)) == pytest.approx(high * default)


def test_the_users_ranges():
    ramp = make_controller("ramp")
    wide, narrow, share = ranges_of(
        ramp, {"time": (0.01, 1), "initial": (7, 20), "full_torque": ("0.5x", "1x")}
    )
    assert (wide.logarithmic, narrow.logarithmic, share.multiples) == (True, False, (0.5, 1.0))
    assert [one.name for one in ranges_of(ramp, ["time"])] == ["time"]
    assert [one.name for one in ranges_of(ramp, "time")] == ["time"]
    with pytest.raises(InputError) as refused:
        ranges_of(ramp, {"tme": None, "period": None, "time": (2, 1)})
    assert len(refused.value.sentences) == 3


# tolerances -----------------------------------------------------------------------------------------------


def test_all_combinations_or_a_sample_of_them():
    three = {"stiffness": "10 %", "load_torque": "1 N*m", "encoder_phase": [0.0, 0.25, 0.5]}
    found = tuning_scenarios(CRANE, three)
    assert found[0] == {}
    assert len(found) == 1 + 2 * 2 * 3
    phases = {one["encoder_phase"].of(0.7) for one in found[1:]}
    assert phases == {0.0, 0.25, 0.5}
    assert {round(one["load_torque"].of(7.16), 9) for one in found[1:]} == {6.16, 8.16}
    more = tuning_scenarios(CRANE, three | {"motor_inertia": "5 %", "torque_lag": ["1 ms", "3 ms"]}, seed=1)
    assert len(more) == 17
    shares = np.array([one["stiffness"].of(1.0) for one in more[1:]])
    assert np.all((shares >= 0.9) & (shares <= 1.1))
    assert np.array_equal(np.sort(np.floor((shares - 0.9) / 0.2 * 16)), np.arange(16))  # one in each stratum
    assert {one["torque_lag"].of(0.0) for one in more[1:]} == {0.001, 0.003}
    assert more == tuning_scenarios(
        CRANE, three | {"motor_inertia": "5 %", "torque_lag": ["1 ms", "3 ms"]}, seed=1
    )
