"""Tuned gains in files: read back to the bit, interpolated, and played wherever a controller is named."""

import math

import numpy as np
import pytest

from softstart import Drive, Duty, DutyStep, InputError, Shift, simulate, sweep
from softstart.controller import make_controller
from softstart.controller.tuned import (
    Gain,
    RobustFile,
    ScheduleFile,
    read_gain_file,
    read_gains,
    robust_text,
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
SCHEDULE = scheduled(SAVED, "here", make_controller("ramp", SAVED.fixed))


# files ----------------------------------------------------------------------------------------------------


def test_a_schedule_is_read_back_to_the_bit(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(schedule_text(SAVED, {"seed": 0}), "utf-8")
    read = read_gain_file(path)
    for name in ("controller", "gaps", "load_inertias", "fixed"):
        assert getattr(read, name) == getattr(SAVED, name)
    assert [(name, gain.scale, gain.values.tolist()) for name, gain in read.gains.items()] == [
        (name, gain.scale, gain.values.tolist()) for name, gain in SAVED.gains.items()
    ]


def test_a_robust_set_is_read_back_to_the_bit(tmp_path):
    gains = {"time": 1.0 / 3.0, "initial": 0.1 + 0.2}
    duty = Duty([DutyStep("start"), DutyStep("stop", by="coast")], shift=Shift(cycles_per_hour=4))
    brake = {"brake_torque": "90 N*m", "opening_delay": "50 ms", "closing_delay": "60 ms"}
    saved = RobustFile("ramp", gains, CRANE.replace(damping=0.1, torque_lag="2 ms", duty=duty, **brake))
    assert read_gains(robust_text(saved, {"worst": 1.0}), tmp_path / "x.toml") == saved


# interpolation --------------------------------------------------------------------------------------------


def test_gains_at_the_nodes_between_them_and_outside():
    for i, gap in enumerate(GAPS):
        for j, inertia in enumerate(INERTIAS):
            ready, own = SCHEDULE.set_up(CRANE.replace(gap=gap, load_inertia=inertia))
            assert (ready.time, ready.initial, ready.period) == (TIMES[i, j], TORQUES[i, j], 0.002)
            assert own.gap == gap
            assert ready.full_torque == CRANE.Ms  # what is not in the schedule follows the drive
    middle = SCHEDULE.gains_at(0.75, 0.5 * (0.07 + 0.175))
    assert middle["initial"] == pytest.approx(9.5)
    assert middle["time"] == pytest.approx(math.prod(TIMES[:2].ravel()) ** 0.25)
    assert SCHEDULE.gains_at(9.0, 1e-3) == {"time": TIMES[2, 0], "initial": TORQUES[2, 0]}


@pytest.mark.parametrize(("gap", "inertia"), [(0.6, 0.1), (1.25, 0.16), (3.0, 0.1), (0.6, 1.0)])
def test_gains_between_nodes_are_bilinear_in_the_value_or_its_logarithm(gap, inertia):
    """Each corner counts by the rectangle opposite to it; beyond the grid its edge counts."""
    x, y = min(gap, 2.0), min(inertia, 0.175)
    row, (left, right) = (0 if x < 1.0 else 1), INERTIAS
    top, bottom = GAPS[row : row + 2]
    corners = [(bottom - x) * (right - y), (bottom - x) * (y - left), (x - top) * (right - y)]
    weights = np.array([*corners, (x - top) * (y - left)]) / ((bottom - top) * (right - left))
    found = SCHEDULE.gains_at(gap, inertia)
    assert found["initial"] == pytest.approx(weights @ TORQUES[row : row + 2].ravel(), rel=1e-12)
    exact = math.exp(weights @ np.log(TIMES[row : row + 2].ravel()))
    assert found["time"] == pytest.approx(exact, rel=1e-12)


def test_a_schedule_goes_by_what_is_declared():
    worn = CRANE.replace(gap=2.0)
    told, unknown = simulate(worn, SCHEDULE), simulate(worn, SCHEDULE, fitted_to=CRANE.replace(gap=0.5))
    assert told.controller.time == TIMES[2, 1]
    assert unknown.controller.time == TIMES[0, 1]


# refusals -------------------------------------------------------------------------------------------------

ROBUST = robust_text(RobustFile("ramp", {"time": 0.1}, CRANE))
TOML = schedule_text(SAVED)
BAD = {
    "drive.toml": (CRANE.to_toml(), ["no tuned gains", "--controller profile"]),
    "axis.toml": (TOML.replace("gaps = [0.5, 1.0", "gaps = [1.0, 0.5"), ["gaps", "rise"]),
    "shape.toml": (TOML.replace("    [8.0, 9.0],\n", ""), ["3 rows", "2 numbers"]),
    "gain.toml": (TOML.replace("[gains.initial]", "[gains.initail]"), ["initail", "no such parameter"]),
    "refused.toml": (TOML.replace("period = 0.002", "period = -1.0"), ["period = -1"]),
    "key.toml": (ROBUST.replace("[drive.load]", "[drive.load]\nmass = 3"), ["[drive]", "no key mass"]),
    "itself.toml": (TOML.replace('"ramp"', '"itself.toml"'), ["gains are those of a controller"]),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_sentence(tmp_path, name):
    text, says = BAD[name]
    path = tmp_path / name
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


def test_code_named_by_a_file_of_gains_runs_only_when_it_is_allowed(tmp_path):
    foreign, ran = tmp_path / "mine.toml", tmp_path / "ran"
    (tmp_path / "own.py").write_text(CODE)
    foreign.write_text(robust_text(RobustFile(f"{tmp_path / 'own.py'}:Own", {}, CRANE)))
    for attempt in (
        lambda: make_controller(str(foreign)),
        lambda: simulate(CRANE, str(foreign)),
        lambda: sweep(CRANE, str(foreign), {"gap": [0.5, 1.0]}, workers=1),
    ):
        with pytest.raises(InputError, match=r"own\.py.*would run.*--allow-code.*allow_code=True"):
            attempt()
    assert not ran.exists()
    run = simulate(CRANE, make_controller(str(foreign), allow_code=True))
    assert ran.exists()
    found = sweep(CRANE, str(foreign), {"gap": [0.5, 1.0]}, workers=1, allow_code=True)
    assert found.k_dyn.values[0] == run.k_dyn
