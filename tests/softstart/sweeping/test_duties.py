"""A sweep over a duty is `run_duty` at every place of the grid, to the bit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from softstart import Chain, Drive, Duty, DutyRun, DutyStep, InputError, SimulationError, run_duty, sweep
from softstart.start.status import Status
from softstart.sweeping.summary import summarise
from softstart.views.sweeps import sweep_sheet

CONVEYOR = Drive.load("conveyor-11kw").replace(minimum_torque=-100.0)
CHAIN = Chain.load("crane-4-mass").with_damping_ratio(0.02)
DUTY = Duty([DutyStep("start"), DutyStep("hold", time=0.2), DutyStep("reverse"), DutyStep("stop")])
JOG = Duty([DutyStep("jog", time=0.1, by="coast")])
FIGURES = ("start_time", "cycle_time", "contacts", "impact_energy", "damage", "margin", "keeps_limits")


def figures_of(run: DutyRun) -> dict[str, float]:
    """The figures of a duty as it was run by itself."""
    last = [one for one in run.executed if one.cycle == run.cycles]
    times = [one.start_time for one in run.executed if one.step.do in ("start", "reverse")]
    margins = [margin.share for row in run.rows for margin in run.margins_of(row)]
    return {
        "k_dyn": run.k_dyn,
        "peak_torque": run.worst.peak_torque,
        **{f"k_dyn_step_{row.number}": run.k_dyn_of(row) for row in run.rows},
        "start_time": max(times, default=math.nan),
        "cycle_time": run.cycle_time,
        "contacts": sum(one.contacts for one in last),
        "impact_energy": float(np.sum([one.impact_energy for one in last])),
        "damage": run.life().worst.damage,
        **({"margin": min(margins), "keeps_limits": min(margins) >= 0.0} if margins else {}),
    }


def place(results: Any, **index: int) -> dict[str, float]:
    """The figures at a place of the grid."""
    return {str(name): float(values.isel(index)) for name, values in results.items() if name != "status"}


def steps_of(duty: Duty) -> list[str]:
    return ["k_dyn", "peak_torque", *(f"k_dyn_step_{k + 1}" for k in range(len(duty.steps)))]


@pytest.mark.parametrize("name", ["ramp", "speed-ramp"])
def test_every_place_is_run_duty_to_the_bit(name: str) -> None:
    """From an unknown position, with limits, forth and back."""
    drive = CONVEYOR.replace(start_position="unknown", permissible_torque=200, permissible_start_time=2)
    gaps = [CONVEYOR.gap, 2.5 * CONVEYOR.gap]
    asked = [*steps_of(DUTY), *FIGURES]
    results = sweep(drive, name, {"gap": gaps}, duty=DUTY, stop="torque", figures=asked, workers=1)
    assert set(asked) <= set(results)
    for i, gap in enumerate(gaps):
        run = run_duty(drive.replace(gap=gap), name, DUTY, stop="torque")
        assert place(results, gap=i) == figures_of(run)
    assert {Status.CARRIED_OUT.name} == set(summarise(results).statuses)


@pytest.mark.parametrize("recorded", [False, True])
def test_a_chain_and_its_shafts(recorded: bool) -> None:
    duty = Duty([DutyStep("start"), DutyStep("stop", time=0.3)])
    asked = [*steps_of(duty), "start_time", "cycle_time", "contacts", "k_dyn_2", "peak_torque_3"]
    asked += ["impact_energy"] * recorded
    grid = {"shaft[2].gap": ["1x", "2x"]}
    results = sweep(CHAIN, "take-up", grid, duty=duty, cycles=1, figures=asked, workers=1)
    for i, gap in enumerate(results["shaft_2_gap"].values.tolist()):
        run = run_duty(CHAIN.with_values({"shaft[2].gap": gap}), "take-up", duty, cycles=1)
        peaks = np.max([one.peak_torques for one in run.executed], axis=0)
        here = place(results, shaft_2_gap=i)
        assert here.pop("k_dyn_2") == peaks[1] / run.base_torque
        assert here.pop("peak_torque_3") == peaks[2]
        expected = figures_of(run)
        assert here == {name: expected[name] for name in here}


def test_where_the_duty_cannot_be_carried_out_figures_are_nan_and_the_status_says_so() -> None:
    duty = Duty([DutyStep("start"), DutyStep("stop", by="coast")])
    weak = {"full_torque": 140.0}
    results = sweep(CONVEYOR, "ramp", {"load.torque": [30.0, 145.0]}, duty=duty, parameters=weak, workers=1)
    run = run_duty(CONVEYOR.replace(load_torque=30.0), "ramp", duty, parameters=weak)
    assert results.k_dyn.values[0] == run.k_dyn
    with pytest.raises(SimulationError):
        run_duty(CONVEYOR.replace(load_torque=145.0), "ramp", duty, parameters=weak)
    assert all(math.isnan(value) for value in place(results, load_torque=1).values())
    names = [list(Status)[code].name for code in results.status.values]
    assert names == ["CARRIED_OUT", "NOT_CARRIED_OUT"]
    sheet = sweep_sheet(results, summarise(results), CONVEYOR)
    assert "50 % of the duties were carried out." in sheet.conclusions[0]
    assert any("a step cannot be finished" in note for note in sheet.notes)


def test_a_duty_of_jogs_has_a_margin_of_torque_and_no_start_time() -> None:
    drive = CONVEYOR.replace(permissible_torque=200, permissible_start_time=2)
    results = sweep(drive, "direct", {"gap": ["1x"]}, duty=JOG, workers=1)
    assert np.isnan(results.start_time.item())
    assert results.margin.item() == 1.0 - results.peak_torque.item() / 200.0


def test_it_goes_on_and_takes_no_other_duty(tmp_path: Any) -> None:
    drive = Drive.from_toml(CONVEYOR.replace(duty=JOG).to_toml())
    grid, options = {"gap": ["1x", "2x", "3x"]}, {"chunk": 1, "workers": 1, "to": tmp_path / "kept"}
    told: list[Any] = []

    def stop(now: Any) -> None:
        told.append(now)
        if now.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(drive, "direct", grid, duty=True, progress=stop, **options)
    again: list[Any] = []
    results = sweep(drive, "direct", grid, duty=JOG, progress=again.append, **options)
    assert (again[0].before, again[-1].done, str(again[-1])[:16]) == (2, 3, "3 of 3 duties (1")
    whole = sweep(drive, "direct", grid, duty=JOG, workers=1)
    assert whole.k_dyn.identical(results.k_dyn.load())
    assert results.attrs["softstart_duty"] == "jog by coast; 2 cycles"
    other = Duty([DutyStep("jog", time=0.2, by="coast")])
    for text, changes in (("duty", {"duty": other}), ("cycles of the duty", {"duty": JOG, "cycles": 3})):
        with pytest.raises(InputError, match=f"contains a sweep with another {text};"):
            sweep(drive, "direct", grid, **options, **changes)
    with pytest.raises(InputError, match="another cycles of the duty, duty and figures"):
        sweep(drive, "direct", grid, **options)


@pytest.mark.slow
def test_processes_compute_the_same_bits() -> None:
    grid, options = {"gap": ["1x", "2x", "3x"], "controller.time": [0.05, 0.1]}, {"duty": DUTY, "chunk": 2}
    alone = sweep(CONVEYOR, "ramp", grid, workers=1, **options)
    assert sweep(CONVEYOR, "ramp", grid, workers=2, **options).identical(alone)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"duty": True}, "duty is missing: Belt conveyor 11 kW, level has no [[duty]]"),
        ({"stop": "coast"}, 'stop = "coast": a single start has no stop; give a duty as well.'),
        ({"duty": JOG, "until": 0.3}, "until = 0.3: the steps of a duty say when it ends; leave it out."),
        ({"duty": JOG, "cycles": 0}, "cycles = 0: give a whole number of 1 or more."),
        (
            {"duty": DUTY, "stop": "cost"},
            'stop = "cost": the stop is "strategy", "torque", "coast" or "brake"',
        ),
        ({"duty": JOG, "figures": ["k_dyn_step_2"]}, "there is no such figure; did you mean k_dyn_step_1?"),
        ({"duty": DUTY, "stop": 3}, "stop = 3: the stop is"),
        ({"duty": DUTY, "stop": "brake"}, "the machine has no brake"),
        ({"figures": ["damage"]}, 'figures = "damage": there is no such figure'),
    ],
)
def test_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        sweep(CONVEYOR, "ramp", {"gap": [0.1, 0.2]}, workers=1, **options)
    (said,) = caught.value.sentences
    assert sentence in said


def test_what_one_corner_cannot_do_is_refused_before_anything_is_computed() -> None:
    braked = CONVEYOR.replace(brake_torque=50.0, load_kind="active")
    duty = Duty([DutyStep("start"), DutyStep("stop", by="brake")])
    with pytest.raises(InputError, match="weaker than the load"):
        sweep(braked, "direct", {"load.torque": [10.0, 60.0]}, duty=duty, workers=1, progress=pytest.fail)
