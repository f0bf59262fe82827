"""Gains of chains: a candidate is the start that `simulate` makes, and files of gains play on the chain."""

import json

import numpy as np
import pytest
from tests.softstart.tuning.test_trials import trials

from softstart import InputError, simulate, tune
from softstart.chain import Chain
from softstart.controller import make_controller
from softstart.tuning.question import gaps_of, inertias_of

CHAIN = Chain.load("crane-4-mass")
DAMPED = Chain.from_toml(CHAIN.to_toml(), also={f"shaft[{k}].damping_ratio": "0.02" for k in (1, 2, 3)})
OFF = {"shaft[2].gap": "20 %", "load_torque": "10 %"}
QUICK = {"restarts": 1, "generations": 3, "workers": 1}


@pytest.mark.parametrize(("name", "position"), [("s-curve", "unknown"), ("take-up", "mid-gap")])
def test_each_candidate_is_the_start_that_simulate_makes(name, position):
    chain = CHAIN.with_values({"start_position": position})
    tried = trials(name, chain, OFF, gaps=(0.5, 1.0), load_inertias=(40.0, 69.2))
    cells = np.array([0, 3])
    places = np.random.default_rng(3).random((2, len(tried.question.ranges)))
    values = tried.values(cells, places)
    judged = tried.judged(cells, values, to_the_end=True)
    for k, cell in enumerate(cells):
        one = tried.question.drive_of(int(cell))
        controller = make_controller(name, {key: float(value[k]) for key, value in values.items()})
        for s, scenario in enumerate(tried.question.scenarios):
            off = one.with_values({key: level.of(one.knob(key).value) for key, level in scenario.items()})
            run = simulate(off, controller, fitted_to=one, base=one)
            assert judged.metric[k, s] == run.k_dyn
            assert judged.start_time[k, s] == run.start_time or np.isnan(run.start_time)


def test_the_margin_is_that_of_the_shaft_with_the_least():
    also = {"shaft[1].permissible_torque": "400", "shaft[3].permissible_torque": "1500 N*m"}
    chain = Chain.from_toml(DAMPED.to_toml(), also=also)
    found = tune(chain, "s-curve", ["1x"], ["1x"], metric="margin", free=["time"], **QUICK)
    run = simulate(chain, found.scheduled)
    assert float(found.schedule.limit_share[0, 0]) == pytest.approx(np.nanmax(run.utilisation), rel=1e-12)
    assert found.robust.worst <= found.robust.worst_default
    with pytest.raises(InputError, match="the chain has no limits; give shafts their permissible_torque"):
        tune(DAMPED, "s-curve", metric="margin")


def test_the_torque_of_one_shaft_is_a_metric():
    found = tune(DAMPED, "s-curve", ["1x"], ["1x"], metric="k_dyn_3", free=["time"], schedule=False, **QUICK)
    run = simulate(DAMPED, found.robust.controller, base=DAMPED)
    assert found.robust.worst == run.k_dyns[2]


def test_files_of_gains_play_on_the_chain_of_each_cell(tmp_path):
    """Never worse than the defaults; the figures of each cell are those of `simulate` with the file."""
    found = tune(DAMPED, "s-curve", ["1x", "4x"], ["0.4x", "1x"], **QUICK)
    assert bool((found.schedule.k_dyn <= found.schedule.k_dyn_default).all())
    assert bool(found.schedule.in_time.all())
    assert found.robust.worst <= found.robust.worst_default
    schedule, robust = tmp_path / "schedule.toml", tmp_path / "robust.toml"
    found.to_toml(schedule)
    found.to_toml(robust, "robust")
    for cell in np.ndindex(2, 2):
        chain = DAMPED.moved(found.question.gaps[cell[0]], found.question.load_inertias[cell[1]])
        assert float(found.schedule.k_dyn[cell]) == simulate(chain, str(schedule)).k_dyn
        assert float(found.robust.cells.k_dyn[cell]) == simulate(chain, str(robust), base=chain).k_dyn
    assert found.price is not None
    assert "schedule_optimum" not in found.price  # asked for a chain alone
    json.dumps(found.summary())


def test_gaps_and_inertias_of_a_chain():
    assert gaps_of(CHAIN, ["2x", "0.6"]) == (0.6, 1.0)
    assert inertias_of(CHAIN, ["1x", "100 kg*m^2"]) == (69.2, 100.0)
    # 0.031 kg m2 at the shaft of the crane, which turns twenty times slower
    assert inertias_of(CHAIN, "5 J1") == (62.0,)
    with pytest.raises(InputError, match="no gap that could be widened"):
        gaps_of(CHAIN.changed(gaps=0.0), ["0.5"])


@pytest.mark.slow
def test_an_optimum_stands_beside_the_gains_where_it_is_asked_for():
    short = DAMPED.with_values({"target_speed": 20.0})
    found = tune(
        short, "s-curve", ["1x"], ["1x"], free=["time"], certified=True, schedule=False, start_time="1.3x",
        **QUICK,
    )  # fmt: skip
    ratio = float(found.price.robust_over_optimum[0, 0])
    assert ratio >= 1.0 - 1e-6
    assert float(found.price.robust_lower_bound[0, 0]) <= float(found.price.robust_optimum[0, 0])
