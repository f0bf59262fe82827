"""Tuned gains in files: read back to the bit, interpolated, and played wherever a controller is named."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softstart import Drive, InputError, records, simulate, sweep, tune
from softstart.controller import make_controller
from softstart.controller.tuned import (
    Gain,
    RobustFile,
    RobustGains,
    ScheduleFile,
    read_gain_file,
    read_gains,
    robust_text,
    schedule_csv,
    schedule_text,
    scheduled,
)

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
GAPS, INERTIAS = (0.5, 1.0, 2.0), (0.07, 0.175)
TIMES = np.array([[0.1, 0.2], [0.3, 0.1 + 0.2], [1.0 / 3.0, 0.05]])
TORQUES = np.array([[8.0, 9.0], [10.0, 11.0], [12.0, 13.0]])
SAVED = ScheduleFile(
    "ramp",
    GAPS,
    INERTIAS,
    {"time": Gain("logarithmic", TIMES), "initial": Gain("linear", TORQUES)},
    {"period": 0.002},
)
SCHEDULE = scheduled(SAVED, "here")


def same(a, b):
    assert (a.controller, a.gaps, a.load_inertias) == (b.controller, b.gaps, b.load_inertias)
    assert (a.fixed, list(a.gains)) == (b.fixed, list(b.gains))
    for name, gain in a.gains.items():
        assert gain.scale == b.gains[name].scale
        assert np.array_equal(gain.values, b.gains[name].values)


# files ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", ["toml", "csv"])
def test_a_schedule_is_read_back_to_the_bit(tmp_path, ending):
    path = tmp_path / f"mine.{ending}"
    text = schedule_text(SAVED, {"seed": 0}) if ending == "toml" else schedule_csv(SAVED, {"k_dyn": TORQUES})
    path.write_text(text, "utf-8")
    same(read_gain_file(path), SAVED)


@given(
    st.dictionaries(
        st.sampled_from(["initial", "time", "full_torque"]),
        st.floats(allow_nan=False, allow_infinity=False, width=64),
        min_size=1,
    )
)
def test_a_robust_set_is_read_back_to_the_bit(tmp_path_factory, parameters):
    saved = RobustFile("ramp", parameters, CRANE.replace(damping=0.1, torque_lag="2 ms"))
    assert read_gains(robust_text(saved, {"worst": 1.0}), tmp_path_factory.getbasetemp() / "x.toml") == saved


# interpolation --------------------------------------------------------------------------------------------


def test_nodes_are_exact():
    for i, gap in enumerate(GAPS):
        for j, inertia in enumerate(INERTIAS):
            ready, own = SCHEDULE.set_up(CRANE.replace(gap=gap, load_inertia=inertia))
            assert (ready.time, ready.initial, ready.period) == (TIMES[i, j], TORQUES[i, j], 0.002)
            assert own.gap == gap
            assert ready.full_torque == CRANE.Ms  # what is not in the schedule follows the drive


def test_between_the_nodes_and_outside():
    middle = SCHEDULE.gains_at(0.75, 0.5 * (0.07 + 0.175))
    assert middle["initial"] == pytest.approx(9.5)
    assert middle["time"] == pytest.approx(math.prod(TIMES[:2].ravel()) ** 0.25)
    assert SCHEDULE.gains_at(9.0, 1e-3) == {"time": TIMES[2, 0], "initial": TORQUES[2, 0]}
    assert SCHEDULE.gains_at(0.0, 9.0) == {"time": TIMES[0, 1], "initial": TORQUES[0, 1]}


# where they are played ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "gains", [SCHEDULE, RobustGains("set", make_controller("ramp", {"time": 0.1}), CRANE)]
)
def test_batches_start_as_single_drives_do(gains):
    drives = records(CRANE, gap=[0.3, 0.8, 2.0, 0.3], load_inertia=[0.07, 0.2, 0.07, 0.2])
    together = simulate(drives, gains)
    for k, drive in enumerate(drives.elements()):
        run = simulate(drive, gains)
        assert float(together.k_dyn[k]) == run.k_dyn
        assert float(together.start_time[k]) == run.start_time
    assert np.array_equal(simulate(list(drives.elements()), gains).k_dyn, together.k_dyn)


def test_a_schedule_goes_by_what_is_declared_and_a_set_by_its_own_drive():
    worn = CRANE.replace(gap=2.0)
    told, unknown = simulate(worn, SCHEDULE), simulate(worn, SCHEDULE, fitted_to=CRANE.replace(gap=0.5))
    assert told.controller.time == TIMES[2, 1]
    assert unknown.controller.time == TIMES[0, 1]
    gains = RobustGains("set", make_controller("acceleration-delay", {"torque": 14.0}), CRANE)
    for other in (worn, CRANE.replace(load_inertia=0.07)):
        run = simulate(other, gains)
        same_run = simulate(other, "acceleration-delay", parameters={"torque": 14.0}, fitted_to=CRANE)
        assert run.k_dyn == same_run.k_dyn == simulate(other, gains, fitted_to=other).k_dyn


def test_what_tune_writes_does_what_tune_says(tmp_path):
    options = {"generations": 2, "population": 6, "restarts": 1, "certified": False, "workers": 1}
    tuned = tune(CRANE, "acceleration-delay", [0.5, 1.0], ["2 J1", "1x"], **options)
    for ending, write in (("toml", tuned.to_toml), ("csv", tuned.to_csv)):
        path = tmp_path / f"schedule.{ending}"
        write(path)
        for gap in (0.5, 1.0):
            for inertia in (0.07, 0.175):
                run = simulate(CRANE.replace(gap=gap, load_inertia=inertia), str(path))
                assert run.k_dyn == float(tuned.schedule.k_dyn.sel(gap=gap, load_inertia=inertia))
    tuned.to_toml(tmp_path / "robust.toml", "robust")
    made = make_controller(str(tmp_path / "robust.toml"))
    assert isinstance(made, RobustGains)
    assert made.nominal == CRANE
    assert made.parameters == tuned.robust.parameters


# refusals -------------------------------------------------------------------------------------------------

ROBUST_TOML = robust_text(RobustFile("ramp", {"time": 0.1}, CRANE))
TOML, CSV = schedule_text(SAVED), schedule_csv(SAVED)
BAD = {
    "missing.toml": (None, ["there is no such file"]),
    "drive.toml": (CRANE.to_toml(), ["no tuned gains", "--controller profile"]),
    "axis.toml": (TOML.replace("gaps = [0.5, 1.0", "gaps = [1.0, 0.5"), ["gaps", "rise"]),
    "shape.toml": (TOML.replace("    [8.0, 9.0],\n", ""), ["3 rows", "2 numbers"]),
    "gain.toml": (TOML.replace("[gains.initial]", "[gains.initail]"), ["initail", "no such parameter"]),
    "refused.toml": (TOML.replace("period = 0.002", "period = -1.0"), ["period = -1"]),
    "key.toml": (
        ROBUST_TOML.replace("[drive.load]", "[drive.load]\nmass = 3"),
        ["[drive]", "[load] has no key mass"],
    ),
    "rows.csv": (CSV.rsplit("\n", 2)[0] + "\n", ["one row for each combination"]),
    "itself.toml": (TOML.replace('"ramp"', '"itself.toml"'), ["gains are those of a controller"]),
    "json.csv": (CSV.replace('# gains: {"time"', "# gains: {time"), ["no JSON object"]),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_sentence(tmp_path, name):
    text, says = BAD[name]
    path = tmp_path / name
    if text is not None:
        path.write_text(text, "utf-8")
    with pytest.raises(InputError) as refused:
        make_controller(str(path))
    assert len(refused.value.sentences) == 1
    assert str(path) in str(refused.value)
    for words in says:
        assert words in str(refused.value)


# code in files of gains -----------------------------------------------------------------------------------

CODE = """
from pathlib import Path
from softstart import Command, PlainController
Path(__file__).with_name("ran").touch()

class Own(PlainController):
    def step(self, measured, state):
        return Command(40.0)
"""


@pytest.fixture
def foreign(tmp_path):
    """A file of gains that names code, which leaves a trace when it runs."""
    (tmp_path / "own.py").write_text(CODE)
    path = tmp_path / "mine.toml"
    path.write_text(robust_text(RobustFile(f"{tmp_path / 'own.py'}:Own", {}, CRANE)))
    return path


def test_code_named_by_a_file_of_gains_runs_only_when_it_is_allowed(foreign):
    for attempt in (
        lambda: make_controller(str(foreign)),
        lambda: simulate(CRANE, str(foreign)),
        lambda: sweep(CRANE, str(foreign), {"gap": [0.5, 1.0]}, workers=1),
    ):
        with pytest.raises(InputError, match=r"own\.py.*would run.*--allow-code.*allow_code=True"):
            attempt()
    assert not foreign.with_name("ran").exists()
    run = simulate(CRANE, make_controller(str(foreign), allow_code=True))
    assert foreign.with_name("ran").exists()
    found = sweep(CRANE, str(foreign), {"gap": [0.5, 1.0]}, workers=1, allow_code=True)
    assert found.k_dyn.values[0] == run.k_dyn
