"""Gains of chains: metrics of their shafts, and files of gains play on the chain of each cell."""

import json

import numpy as np
import pytest
from tests.softstart.tuning.test_trials import CHAIN

from softstart import InputError, simulate, tune
from softstart.chain import Chain
from softstart.tuning.problem import gaps_of, inertias_of

DAMPED = Chain.from_toml(CHAIN.to_toml(), also={f"shaft[{k}].damping_ratio": "0.02" for k in (1, 2, 3)})
QUICK = {"restarts": 1, "generations": 3, "workers": 1}


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
        chain = DAMPED.with_gap_and_inertia(found.problem.gaps[cell[0]], found.problem.load_inertias[cell[1]])
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
        gaps_of(CHAIN.scaled(gaps=0.0), ["0.5"])
