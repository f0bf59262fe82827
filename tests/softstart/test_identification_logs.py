"""Logs as inverters write them: files, currents, torques in %, clocks, uneven samples."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from tests.softstart.test_identification import NAMES, REVERSE, TRUTH

from softstart import InputError, Log, identify
from softstart.arrays import Vector
from softstart.identification.model import LogModel
from softstart.identification.planning import made_up_log

GUESS = TRUTH.replace(gap=0.2, stiffness=200, load_inertia=0.4, motor_inertia=0.02, load_torque=12)


@pytest.fixture(scope="module")
def log() -> Log:
    return made_up_log(TRUTH, REVERSE, log_period=2e-3, ripple=1.0, seed=3)


def replayed(time: Vector, demand: Vector, position: float, seed: int, ripple: float = 1.0) -> Log:
    """What the true drive logs at any instants under a demand held between them, counted by its encoder."""
    generator = np.random.default_rng(seed)
    torque = demand + ripple * generator.standard_normal(time.size)
    blank = Log(time, torque, angle=900.0 * (time - time[0]) ** 2.1, torque_is="demand")
    model = LogModel.of(blank, TRUTH.replace(start_position="mid-gap"))
    states = model.motion({"position": position}).at(model.times)
    count = 2.0 * math.pi / 4096.0
    angle = np.floor(states["phi"][:, 0] / count + generator.uniform()) * count
    return Log(time, demand, angle=angle, torque_is="demand", name=f"seed {seed}")


def demand_at(log: Log, time: Vector) -> Vector:
    """The levels of the experiment at other instants."""
    smooth = np.round(log.torque / 5.0) * 5.0
    found: Vector = smooth[np.searchsorted(log.time, time - time[0], side="right") - 1]
    return found


def holds(found, width: float = 2.0) -> bool:  # type: ignore[no-untyped-def]
    """Whether each value is within two intervals of the truth."""
    return all(
        abs(math.log(found[name].value / float(getattr(TRUTH, name))))
        < width * 0.5 * math.log(found[name].upper / found[name].lower)
        for name in NAMES
    )


# ---- the clock ------------------------------------------------------------------------------------------


def test_the_origin_of_the_clock_does_not_matter(log: Log) -> None:
    later = Log(log.time + 86400.0, log.torque, angle=log.values, torque_is="demand")
    drive = TRUTH.replace(start_position="mid-gap")
    one, two = (LogModel.of(each, drive).signals([{"position": 0.3}])[0] for each in (log, later))
    assert two == pytest.approx(one, abs=1e-7)  # a day in float64 has instants of 1.5e-11 s


@pytest.mark.slow
def test_logs_with_clocks_and_sampling_of_their_own_are_fitted_together(log: Log) -> None:
    end = float(log.time[-1])
    each = []
    for seed, period, origin, position in ((4, 2e-3, 0.0, -0.7), (5, 5e-3, 1000.0, 0.5)):
        time = np.arange(int(end / period)) * period
        made = replayed(time, demand_at(log, time), position, seed)
        each.append(
            Log(time + origin, made.torque, angle=made.values, torque_is="demand", name=f"log {seed}")
        )
    both = identify(each, GUESS, searches=3)
    alone = identify(each[1], GUESS, searches=3)
    assert holds(both)
    assert both["gap"].half_width < alone["gap"].half_width
    assert both["position 1"].value == pytest.approx(-0.7, abs=0.1)
    assert both["position 2"].value == pytest.approx(0.5, abs=0.1)


# ---- columns --------------------------------------------------------------------------------------------


def test_a_current_with_a_factor_stands_for_the_torque(log: Log, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = zip(log.time.tolist(), (log.torque / 1.2).tolist(), log.values.tolist(), strict=True)
    path.write_text("t [s],current [A],phi [rad]\n" + "\n".join(f"{t},{i},{a}" for t, i, a in rows))
    read = Log.load(path, columns={"torque": "1.2 * current [N*m]"}, torque_is="demand")
    assert read.torque == pytest.approx(log.torque, rel=1e-14, abs=1e-14)
    turned = Log.load(path, columns={"angle": "-phi", "torque": "-1.2*current[N*m]"}, torque_is="demand")
    assert turned.torque == pytest.approx(-log.torque, rel=1e-14, abs=1e-14)
    with pytest.raises(InputError, match=r"current \[A\].*is a current.*\[N\*m\]"):
        Log.load(path, columns={"torque": "1.2*current"})


def test_a_unit_in_columns_takes_the_place_of_that_of_the_file(log: Log, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    speed = np.gradient(log.values, log.time) * 30.0 / math.pi
    rows = zip(log.time.tolist(), log.torque.tolist(), speed.tolist(), strict=True)
    path.write_text("t [s];M [%];n [1/min]\n" + "\n".join(f"{t};{u};{n}" for t, u, n in rows))
    names = {"time": "t", "torque": "M [N*m]", "speed": "n[rpm]"}
    read = Log.load(path, columns=names)
    assert read.kind == "speed"
    assert read.values == pytest.approx(speed * math.pi / 30.0, rel=1e-12, abs=1e-12)
    assert np.array_equal(Log.load(path, columns=names | {"speed": "n"}).values, read.values)
    with pytest.raises(InputError, match=r"n .1/min.*frequency"):
        Log.load(path, columns=names | {"speed": "n [Hz]"})
    with pytest.raises(InputError, match="did you mean torque"):
        Log.load(path, columns={"torqe": "M"})


# ---- files of inverters, scopes and spreadsheets -----------------------------------------------------------

FILES = {  # heading, row, decimal mark, encoding, what the columns are called
    "preamble": (
        "Name;MyScope\nStarttime of export;2025-03-11 08:12:05\n\nTime [ms];ActTorque [%];ActPos [deg]",
        "{t:.0f};{percent:.8f};{deg:.8f}", ",", "utf-8", {"torque": ".12*ActTorque[Nm]", "angle": "ActPos"},
    ),
    "spreadsheet": (
        "Zeit [ms];Drehmoment [Nm];Lage [deg]", "{t:.1f};{torque:.8f};{deg:.8f}", ",", "utf-8-sig",
        {"time": "zeit", "torque": "Drehmoment", "angle": "Lage"},
    ),
    "tabs": (
        "Motor trace\texport 3.2\nTime\tTorque ref.\tPosition", "{t:.1f}\t{torque:.8f}\t{turns:.10f}", ".",
        "utf-16", {"time": "Time [ms]", "torque": "Torque ref. [Nm]", "angle": "Position [rev]"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", FILES)
def test_a_file_is_read_by_the_names_of_its_columns(log: Log, kind: str, tmp_path: Path) -> None:
    heading, row, point, encoding, columns = FILES[kind]
    rows = [
        row.format(
            t=1e3 * t, torque=u, percent=100.0 * u / 12.0, deg=math.degrees(a), turns=a / (2.0 * math.pi)
        ).replace(".", point)
        for t, u, a in zip(2.0 * log.time, log.torque, log.values, strict=True)
    ]
    path = tmp_path / "trace.csv"
    path.write_text("\n".join([heading, *rows]), encoding=encoding)
    with pytest.raises(InputError, match=r"there are the columns .*; write --columns"):
        Log.load(path)
    read = Log.load(path, columns=columns)
    assert read.time == pytest.approx(2.0 * log.time, abs=1e-9)
    assert read.torque == pytest.approx(log.torque, abs=1e-7)
    assert read.values == pytest.approx(log.values, abs=1e-7)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("\0\0", "this is not a text file; export the signals as CSV"),
        ("s;torque;angle\n0;1;2\n1;1;2", "none is called time; write --columns .time=NAME .ms."),
        ("time;torque [%];angle\n0;1;2\n1;1;2", r"torque \[%\].*of %, as .torque=1.2\*NAME \[N\*m\]"),
        ("time,torque,speed [%]\n0,1,2\n1,1,2", r"speed \[%\].*is no unit.*speed=NAME \[rad/s\]"),
        ("time,torque,torque,angle\n0,1,1,2\n1,1,1,2", "2 are called torque; write"),
        ("time,torque,speed,angle\n0,1,1,2\n1,1,1,2", "they name both of angle and speed"),
        ("time torque angle\n0 1 2\n1 1 2", "there are the columns time torque angle; none is called time"),
    ],
)
def test_what_is_no_log_is_told_what_to_write(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=sentence):
        Log.load(tmp_path / "a.csv")
