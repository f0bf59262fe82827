"""Gains tuned over a duty: better than the defaults, the best of a grid, the same bits by any worker."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest

from softstart import Drive, Duty, DutyStep, InputError, run_duty, tune
from softstart.controller import make_controller
from softstart.views.tuning import tuning_question

CONVEYOR = Drive.load("conveyor-11kw").replace(minimum_torque=-100.0, gap=0.07)
CELL: dict[str, Any] = {"gaps": [0.07], "inertias": ["1x"]}
SMALL: dict[str, Any] = {"generations": 3, "population": 6, "restarts": 1, "workers": 1}
JOG = Duty([DutyStep("jog", time=0.3, by="strategy")])
STOP = Duty([DutyStep("start"), DutyStep("hold", time=0.1), DutyStep("stop")])


def test_a_jog_is_tuned_to_the_best_of_a_grid() -> None:
    """Its K_dyn over the time of the ramp has two minima inside the range."""
    duty, ends = Duty([DutyStep("jog", time=0.15, by="coast")]), (0.02, 0.085)
    options = {**CELL, **SMALL, "free": {"time": ends}, "generations": 5, "robust": False}
    tuned = tune(CONVEYOR, "ramp", duty=duty, cycles=1, **options)
    assert tuned.schedule is not None
    cell = tuned.schedule.isel(gap=0, load_inertia=0)
    runs = [
        run_duty(CONVEYOR, "ramp", duty, parameters={"time": at}, cycles=1) for at in np.linspace(*ends, 21)
    ]
    grid = [run.k_dyn for run in runs]
    assert 0 < np.argmin(grid) < len(grid) - 1
    assert cell.k_dyn.item() == pytest.approx(min(grid), rel=2e-3)
    assert cell.k_dyn.item() < 0.97 * cell.k_dyn_default.item()
    tuned_run = run_duty(CONVEYOR, "ramp", duty, parameters={"time": cell.time.item()}, cycles=1)
    assert cell.k_dyn.item() == tuned_run.k_dyn
    assert np.isnan(cell.start_time)
    assert bool(cell.in_time)
    assert "over the duty jog by coast; 1 cycle" in tuning_question(tuned)


def test_a_stop_by_the_strategy_is_tuned_by_the_metric_of_its_step() -> None:
    """The settled time of the start stays within its bound, and the figures are those of `run_duty`."""
    options = {**CELL, **SMALL, "free": {"kp": ("0.4x", "1x")}, "schedule": False, "cycles": 1}
    tuned = tune(CONVEYOR, "speed-ramp", duty=STOP, metric="k_dyn_step_3", **options)
    assert tuned.robust is not None
    default = run_duty(CONVEYOR, "speed-ramp", STOP, cycles=1)
    run = run_duty(CONVEYOR, "speed-ramp", STOP, cycles=1, parameters=tuned.robust.parameters)
    assert run.k_dyn_of(run.rows[2]) == tuned.robust.worst < 0.95 * tuned.robust.worst_default
    assert tuned.robust.worst_default == default.k_dyn_of(default.rows[2])
    assert run.rows[0].start_time <= default.rows[0].start_time
    assert set(tuned.robust.gains) == {"kp"}


def test_gains_note_the_duty_that_they_are_tuned_for(tmp_path: Any) -> None:
    duty = Duty([DutyStep("start"), DutyStep("stop", by="torque")])
    drive = CONVEYOR.replace(duty=duty)
    tuned = tune(drive, "ramp", **CELL, duty=True, stop="torque", free=["initial"], cycles=1, **SMALL)
    tuned.to_toml(tmp_path / "robust.toml", "robust")
    about = tomllib.loads((tmp_path / "robust.toml").read_text(encoding="utf-8"))["about"]
    assert about["duty"] == tuned.summary()["duty"] == "start, stop by torque; stops by torque; 1 cycle"
    assert tuned.price is not None
    assert not any("optimum" in str(name) for name in tuned.price)
    again = make_controller(str(tmp_path / "robust.toml"))
    assert tuned.robust is not None
    assert run_duty(drive, again, cycles=1).k_dyn == tuned.robust.worst


def test_an_interrupted_search_goes_on_and_takes_no_other_duty(tmp_path: Any) -> None:
    options = {**CELL, **SMALL, "free": ["initial"], "robust": False, "save_to": tmp_path / "tuning.sqlite"}
    duty = Duty([DutyStep("jog", time=0.15, by="coast")])
    tuned = tune(CONVEYOR, "ramp", duty=duty, **options)
    again = tune(CONVEYOR, "ramp", duty=duty, **options)
    assert again.schedule is not None
    assert tuned.schedule is not None
    assert again.schedule.identical(tuned.schedule)
    assert again.starts < tuned.starts
    with pytest.raises(InputError, match="contains a tuning with another duty;"):
        tune(CONVEYOR, "ramp", duty=Duty([DutyStep("jog", time=0.1, by="coast")]), **options)


@pytest.mark.slow
def test_processes_find_the_same_bits_and_damage_is_a_metric() -> None:
    """In 1.1 of the time of direct: any seed has 0.8 of the damage or less; in their own time the defaults

    leave next to nothing, which takes a longer search to find.
    """
    duty = Duty([DutyStep("start"), DutyStep("stop", by="coast")])
    options = {**SMALL, "duty": duty, "free": ["initial", "time"], "metric": "damage", "robust": False}
    grid = {"gaps": [0.07, 0.14], "inertias": ["1x"], "start_time": "1.1x"}
    alone = tune(CONVEYOR, "ramp", **grid, **options)
    both = tune(CONVEYOR, "ramp", **grid, **{**options, "workers": 2})
    assert alone.schedule is not None
    assert both.schedule is not None
    assert alone.schedule.identical(both.schedule)
    cell = alone.schedule.isel(gap=0, load_inertia=0)
    gains = {name: cell[name].item() for name in ("initial", "time")}
    run = run_duty(CONVEYOR, "ramp", duty, parameters=gains)
    assert run.life().worst.damage == cell.damage.item() < 0.85 * cell.damage_default.item()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"duty": True}, "duty is missing: Belt conveyor 11 kW, level has no [[duty]]"),
        ({"stop": "coast"}, 'stop = "coast": a single start has no stop; give a duty as well.'),
        ({"duty": STOP, "metric": "k_dyn_step_4"}, 'metric = "k_dyn_step_4": this is not a result of a duty'),
        ({"duty": STOP, "certified": True}, "certified = True: an optimum is that of a single start"),
        ({"duty": JOG}, 'by = "strategy": ramp cannot stop a machine'),
    ],
)
def test_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        tune(CONVEYOR, "ramp", **CELL, **{**SMALL, **options})
    (said,) = caught.value.sentences
    assert sentence in said
